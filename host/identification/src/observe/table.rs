//! A calibrated model as the observer's table of numbers: its program with the parameters' values worked in, and the noise of the calibration.
//!
//! ```text
//! Exported ─▶ Program (graph in x, u, p, t) ── p by its values, biases of gyros as states ──▶ three tapes ──▶ observer::Table
//! CAL.json's noise ──────────────────────────────────────────────────────────────────────────────────────▶ observer::Settings
//! ```

use std::collections::HashMap;

use observer::{Instruction, Operation, Output, Sensors, Settings, Start, Table, Tape};

use super::{ObserveError, settings};
use crate::export::{Exported, Place, Program};
use crate::model::expression::{Function, Node};
use crate::model::{Expression, Integrator};

/// A tape with its own numbers.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct OwnedTape {
    pub constants: Vec<f32>,
    pub instructions: Vec<Instruction>,
    pub outputs: Vec<Output>,
}

impl OwnedTape {
    fn tape(&self) -> Tape<'_, f32> {
        Tape { constants: &self.constants, instructions: &self.instructions, outputs: &self.outputs }
    }
}

/// Everything that an observer is told of a robot.
#[derive(Debug, Clone, PartialEq)]
pub struct Numbers {
    pub(super) moving: usize,
    pub(super) states: usize,
    pub(super) inputs: usize,
    pub(super) readings: usize,
    pub(super) rates: OwnedTape,
    pub(super) rates_slopes: OwnedTape,
    pub(super) readings_slopes: OwnedTape,
    pub(super) period_s: f32,
    pub(super) sigma: Vec<f32>,
    pub(super) is_gyro: Vec<bool>,
    pub(super) process: Vec<f32>,
    pub(super) start: Vec<Start<f32>>,
}

impl Numbers {
    /// The numbers of a calibrated model. Gyro biases that the calibration estimates are states, behind those of the model.
    ///
    /// # Errors
    /// [`ObserveError`].
    pub fn of(exported: &Exported<'_>) -> Result<Self, ObserveError> {
        if exported.integrator() == Integrator::Euler {
            return Err(ObserveError::Euler);
        }
        let program = Program::of(exported)?;
        let biases = biases(exported);
        let (moving, columns) = (program.sizes.states, program.sizes.columns());
        let (states, readings) = (moving + biases.len(), program.sizes.readings);
        let writer = Writer { program: &program, exported, biases: &biases, given: states + program.sizes.inputs + 1 };
        let mut of_rates: Vec<_> = program.rates.iter().copied().enumerate().collect();
        let rates = writer.tape(&of_rates)?;
        for (row, slopes) in program.rate_slopes.chunks(columns).enumerate() {
            of_rates.extend((0..moving).map(|column| (moving * (1 + row) + column, slopes[column])));
        }
        let mut of_readings: Vec<_> = program.readings.iter().copied().enumerate().collect();
        for (row, slopes) in program.reading_slopes.chunks(columns).enumerate() {
            let parameter = |bias: &usize| moving + program.sizes.inputs + bias;
            let places = (0..moving).chain(biases.iter().map(parameter));
            let of_row = places.enumerate().map(|(column, place)| (readings + row * states + column, slopes[place]));
            of_readings.extend(of_row);
        }
        let noise = settings::Noise::of(exported, &program, &biases)?;
        let single = |values: &[f64]| values.iter().map(|value| *value as f32).collect::<Vec<_>>();
        Ok(Numbers {
            moving,
            states,
            inputs: program.sizes.inputs,
            readings,
            rates,
            rates_slopes: writer.tape(&of_rates)?,
            readings_slopes: writer.tape(&of_readings)?,
            period_s: exported.calibrated.robot().sample_period_s as f32,
            sigma: single(&exported.sigmas()),
            is_gyro: settings::is_gyro(exported),
            process: single(&noise.process),
            start: noise.start,
        })
    }

    /// The model.
    pub fn table(&self) -> Table<'_, f32> {
        Table {
            moving: self.moving,
            states: self.states,
            inputs: self.inputs,
            readings: self.readings,
            rates: self.rates.tape(),
            rates_slopes: self.rates_slopes.tape(),
            readings_slopes: self.readings_slopes.tape(),
        }
    }

    /// The noise, and where the filter starts.
    pub fn settings(&self, sensors: Sensors) -> Settings<'_, f32> {
        Settings {
            period_s: self.period_s,
            sigma: &self.sigma,
            is_gyro: &self.is_gyro,
            process: &self.process,
            start: &self.start,
            sensors,
        }
    }

    /// Positions that a sensor reads, and `per_sigma` standard deviations of that sensor.
    pub(super) fn steps(&self, per_sigma: f64) -> impl Iterator<Item = (usize, f64)> {
        let step = move |reading: u16| self.sigma.get(usize::from(reading)).map(|sigma| per_sigma * f64::from(*sigma));
        self.start.iter().enumerate().filter_map(move |(state, start)| Some((state, start.reading.and_then(step)?)))
    }

    /// Operations of a tick: rates with derivatives, rates, readings with derivatives.
    pub fn operations(&self) -> [usize; 3] {
        [&self.rates_slopes, &self.rates, &self.readings_slopes].map(|tape| tape.instructions.len())
    }
}

/// The parameters that are biases of gyros, by their place among all.
pub(super) fn biases(exported: &Exported<'_>) -> Vec<usize> {
    let all = exported.parameters.iter().enumerate();
    all.filter(|(_, parameter)| matches!(parameter.place, Place::Bias { .. })).map(|(place, _)| place).collect()
}

/// What a node of the graph is on a tape.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Value {
    /// Known beforehand.
    Number(f64),
    /// One of x, u and t.
    Given(usize),
    /// What this instruction gives.
    Result(usize),
}

/// Writes tapes of a program.
struct Writer<'p> {
    program: &'p Program,
    exported: &'p Exported<'p>,
    biases: &'p [usize],
    given: usize,
}

/// A tape on its way: places of operands are known when all constants are.
#[derive(Default)]
struct Draft {
    constants: Vec<f64>,
    place_of: HashMap<u64, usize>,
    instructions: Vec<(Operation, [Value; 3])>,
    known: HashMap<(Operation, [(u8, u64); 3]), usize>,
}

impl Draft {
    /// The result of an operation, written down once.
    fn add(&mut self, operation: Operation, operands: [Value; 3]) -> Value {
        let key = operands.map(|operand| match operand {
            Value::Number(number) => (0, number.to_bits()),
            Value::Given(place) => (1, place as u64),
            Value::Result(place) => (2, place as u64),
        });
        let next = self.instructions.len();
        let place = *self.known.entry((operation, key)).or_insert(next);
        if place == next {
            for operand in operands {
                self.constant(operand);
            }
            self.instructions.push((operation, operands));
        }
        Value::Result(place)
    }

    /// Room for a number.
    fn constant(&mut self, value: Value) {
        if let Value::Number(number) = value {
            let next = self.constants.len();
            let place = *self.place_of.entry(number.to_bits()).or_insert(next);
            if place == next {
                self.constants.push(number);
            }
        }
    }
}

impl Writer<'_> {
    /// A variable of the program: states, inputs, parameters, the time.
    fn variable(&self, place: usize) -> Value {
        let sizes = self.program.sizes;
        let (inputs, parameters) = (sizes.states, sizes.states + sizes.inputs);
        if place < inputs {
            return Value::Given(place);
        }
        if place < parameters {
            return Value::Given(place + self.biases.len());
        }
        if place >= sizes.columns() {
            return Value::Given(self.given - 1);
        }
        let parameter = place - parameters;
        match self.biases.iter().position(|bias| *bias == parameter) {
            Some(bias) => Value::Given(sizes.states + bias),
            None => Value::Number(self.exported.parameters[parameter].value),
        }
    }

    /// A tape that gives these outputs by their places. What depends on parameters alone is worked out in double precision.
    fn tape(&self, outputs: &[(usize, Expression)]) -> Result<OwnedTape, ObserveError> {
        let outputs: Vec<_> = outputs.iter().filter(|(_, expression)| !self.program.is_zero(*expression)).collect();
        let mut draft = Draft::default();
        let mut values: HashMap<Expression, Value> = HashMap::new();
        for expression in self.program.needed(outputs.iter().map(|(_, expression)| *expression)) {
            // Nodes come after their operands.
            let of = |operand: Expression| values.get(&operand).copied().unwrap_or(Value::Number(f64::NAN));
            let value = match self.program.node(expression) {
                Node::Constant(bits) => Value::Number(f64::from_bits(bits)),
                Node::Variable(place) => self.variable(place as usize),
                Node::Held(a) => of(a),
                Node::Add(a, b) => sum(&mut draft, of(a), of(b)),
                Node::Sub(a, b) => difference(&mut draft, of(a), of(b)),
                Node::Mul(a, b) => product(&mut draft, of(a), of(b)),
                Node::Div(a, b) => quotient(&mut draft, of(a), of(b)),
                Node::Neg(a) => negative(&mut draft, of(a)),
                Node::Call(function, a) => match of(a) {
                    Value::Number(a) => Value::Number(function.at(a)),
                    a => draft.add(operation(function), [a, a, a]),
                },
                Node::WherePositive(a, b, c) => match of(a) {
                    Value::Number(a) => of(if a > 0.0 { b } else { c }),
                    a => draft.add(Operation::WherePositive, [a, of(b), of(c)]),
                },
            };
            values.insert(expression, value);
        }
        let of_outputs: Vec<(usize, Value)> = outputs
            .into_iter()
            .filter_map(|(place, expression)| Some((*place, *values.get(expression)?)))
            .filter(|(_, value)| *value != Value::Number(0.0))
            .collect();
        of_outputs.iter().for_each(|(_, value)| draft.constant(*value));
        self.numbered(&draft, &of_outputs)
    }

    fn numbered(&self, draft: &Draft, outputs: &[(usize, Value)]) -> Result<OwnedTape, ObserveError> {
        let place = |value: Value| {
            let place = match value {
                Value::Number(number) => self.given + draft.place_of.get(&number.to_bits()).copied().unwrap_or(0),
                Value::Given(place) => place,
                Value::Result(place) => self.given + draft.constants.len() + place,
            };
            u16::try_from(place).map_err(|_| ObserveError::Large)
        };
        let instruction = |(operation, [a, b, c]): &(Operation, [Value; 3])| {
            Ok(Instruction { operation: *operation, operands: [place(*a)?, place(*b)?, place(*c)?] })
        };
        let output = |(to, value): &(usize, Value)| {
            let to = u16::try_from(*to).map_err(|_| ObserveError::Large)?;
            Ok(Output { place: to, value: place(*value)? })
        };
        Ok(OwnedTape {
            constants: draft.constants.iter().map(|number| *number as f32).collect(),
            instructions: draft.instructions.iter().map(instruction).collect::<Result<_, ObserveError>>()?,
            outputs: outputs.iter().map(output).collect::<Result<_, ObserveError>>()?,
        })
    }
}

const ZERO: Value = Value::Number(0.0);
const ONE: Value = Value::Number(1.0);

fn sum(draft: &mut Draft, a: Value, b: Value) -> Value {
    match (a, b) {
        (Value::Number(a), Value::Number(b)) => Value::Number(a + b),
        (other, ZERO) | (ZERO, other) => other,
        _ => draft.add(Operation::Add, [a, b, b]),
    }
}

fn difference(draft: &mut Draft, a: Value, b: Value) -> Value {
    match (a, b) {
        (Value::Number(a), Value::Number(b)) => Value::Number(a - b),
        (a, ZERO) => a,
        (ZERO, b) => negative(draft, b),
        _ => draft.add(Operation::Sub, [a, b, b]),
    }
}

fn product(draft: &mut Draft, a: Value, b: Value) -> Value {
    match (a, b) {
        (Value::Number(a), Value::Number(b)) => Value::Number(a * b),
        (ZERO, _) | (_, ZERO) => ZERO,
        (other, ONE) | (ONE, other) => other,
        _ => draft.add(Operation::Mul, [a, b, b]),
    }
}

/// A division by a number is a product with its reciprocal: the device divides slowly.
fn quotient(draft: &mut Draft, a: Value, b: Value) -> Value {
    match (a, b) {
        (Value::Number(a), Value::Number(b)) => Value::Number(a / b),
        (ZERO, _) => ZERO,
        (a, Value::Number(b)) => product(draft, a, Value::Number(b.recip())),
        _ => draft.add(Operation::Div, [a, b, b]),
    }
}

fn negative(draft: &mut Draft, a: Value) -> Value {
    match a {
        Value::Number(a) => Value::Number(-a),
        a => draft.add(Operation::Neg, [a, a, a]),
    }
}

fn operation(function: Function) -> Operation {
    match function {
        Function::Sin => Operation::Sin,
        Function::Cos => Operation::Cos,
        Function::Exp => Operation::Exp,
        Function::Ln => Operation::Ln,
        Function::Tanh => Operation::Tanh,
        Function::Sqrt => Operation::Sqrt,
        Function::Abs => Operation::Abs,
    }
}
