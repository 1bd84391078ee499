//! A model as a table of numbers: its equations and their derivatives, written down as a sequence of operations.
//!
//! ```text
//! values   | x | u | t | constants | results of the instructions, one each |
//! outputs  places of values that are ẋ, y or derivatives; all others are zero
//! ```
//! A calibration on the host writes the table, with the parameters' values worked in; the device reads it. So a robot's model changes without
//! another program on the device, with every effect that the calibration knows.

use crate::{Input, Model, Real};

/// What an instruction does with values a, b, c.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Operation {
    /// a + b
    Add,
    /// a − b
    Sub,
    /// a b
    Mul,
    /// a / b
    Div,
    /// −a
    Neg,
    /// sin a
    Sin,
    /// cos a
    Cos,
    /// eᵃ
    Exp,
    /// ln a
    Ln,
    /// tanh a
    Tanh,
    /// √a
    Sqrt,
    /// |a|
    Abs,
    /// b where a is above zero, else c
    WherePositive,
}

/// An operation on values that stand before its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Instruction {
    /// What is done.
    pub operation: Operation,
    /// Places of a, b and c; those that the operation has no use for are zero.
    pub operands: [u16; 3],
}

/// A value that is an output.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Output {
    /// Place in the vector of outputs: the values, then their derivatives by rows.
    pub place: u16,
    /// Place of the value.
    pub value: u16,
}

/// A sequence of operations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tape<'t, T> {
    /// Numbers.
    pub constants: &'t [T],
    /// In order.
    pub instructions: &'t [Instruction],
    /// What comes out; each place at most once.
    pub outputs: &'t [Output],
}

/// A model as numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Table<'t, T> {
    /// Components that move.
    pub moving: usize,
    /// All components.
    pub states: usize,
    /// Inputs.
    pub inputs: usize,
    /// Readings.
    pub readings: usize,
    /// ẋ.
    pub rates: Tape<'t, T>,
    /// ẋ and its derivatives by what moves.
    pub rates_slopes: Tape<'t, T>,
    /// y and its derivatives by all components.
    pub readings_slopes: Tape<'t, T>,
}

/// Why a table is no model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum TableError {
    /// An instruction, or an output, names a value that is not there before it.
    #[error(
        "{of} {number} of the table names a value that is not there: make the table anew with `host export --observer`"
    )]
    Operand {
        /// What names it.
        of: &'static str,
        /// Which one.
        number: usize,
    },
    /// Sizes that contradict each other.
    #[error("the table's sizes contradict each other: make it anew with `host export --observer`")]
    Sizes,
    /// The memory that was given.
    #[error("the table needs room for {needed} values, there is room for {given}: give it more memory")]
    Memory {
        /// Values.
        needed: usize,
        /// Values.
        given: usize,
    },
}

impl<T> Tape<'_, T> {
    /// Values that it works on, `given` among them.
    fn values(&self, given: usize) -> usize {
        given + self.constants.len() + self.instructions.len()
    }

    fn check(&self, given: usize, outputs: usize) -> Result<(), TableError> {
        let known = given + self.constants.len();
        for (number, instruction) in self.instructions.iter().enumerate() {
            if instruction.operands.iter().any(|operand| usize::from(*operand) >= known + number) {
                return Err(TableError::Operand { of: "instruction", number });
            }
        }
        let all = self.values(given);
        let is_wrong = |output: &Output| usize::from(output.value) >= all || usize::from(output.place) >= outputs;
        match self.outputs.iter().position(is_wrong) {
            Some(number) => Err(TableError::Operand { of: "output", number }),
            None => Ok(()),
        }
    }
}

impl<T> Table<'_, T> {
    /// What a tape is given: x, u and the time.
    fn given(&self) -> usize {
        self.states + self.inputs + 1
    }

    /// Values that the longest of its tapes works on.
    pub fn memory(&self) -> usize {
        let of = |tape: &Tape<'_, T>| tape.values(self.given());
        of(&self.rates).max(of(&self.rates_slopes)).max(of(&self.readings_slopes))
    }
}

/// A table with the memory that its tapes work in.
#[derive(Debug, Clone)]
pub struct TableModel<'t, T, Memory> {
    table: Table<'t, T>,
    memory: Memory,
}

impl<'t, T: Real, Memory: AsMut<[T]>> TableModel<'t, T, Memory> {
    /// A model of a table.
    ///
    /// # Errors
    /// [`TableError`]: a table that is accepted can be run without an operand out of place.
    pub fn new(table: Table<'t, T>, mut memory: Memory) -> Result<Self, TableError> {
        let Table { moving, states, readings, .. } = table;
        if moving > states || states > usize::from(u16::MAX) || readings > usize::from(u16::MAX) {
            return Err(TableError::Sizes);
        }
        let given = table.given();
        table.rates.check(given, moving)?;
        table.rates_slopes.check(given, moving * (1 + moving))?;
        table.readings_slopes.check(given, readings * (1 + states))?;
        let (needed, given) = (table.memory(), memory.as_mut().len());
        if given < needed {
            return Err(TableError::Memory { needed, given });
        }
        Ok(Self { table, memory })
    }
}

/// Runs a tape that was checked; outputs are `values` and behind them `slopes`.
fn run<T: Real>(
    table: &Table<'_, T>,
    tape: &Tape<'_, T>,
    memory: &mut [T],
    (x, input): (&[T], Input<'_, T>),
    values: &mut [T],
    slopes: &mut [T],
) {
    // Slices of other lengths leave old values, and nothing out of place.
    let mut rest = &mut *memory;
    for (from, length) in
        [(x, table.states), (input.u, table.inputs), (&[input.time_s], 1), (tape.constants, tape.constants.len())]
    {
        let (to, behind) = rest.split_at_mut(length);
        to.iter_mut().zip(from).for_each(|(to, from)| *to = *from);
        rest = behind;
    }
    let known = table.given() + tape.constants.len();
    for (place, instruction) in (known..).zip(tape.instructions) {
        let [a, b, c] = instruction.operands.map(|operand| memory[usize::from(operand)]);
        memory[place] = match instruction.operation {
            Operation::Add => a + b,
            Operation::Sub => a - b,
            Operation::Mul => a * b,
            Operation::Div => a / b,
            Operation::Neg => -a,
            Operation::Sin => Real::sin(a),
            Operation::Cos => Real::cos(a),
            Operation::Exp => Real::exp(a),
            Operation::Ln => Real::ln(a),
            Operation::Tanh => Real::tanh(a),
            Operation::Sqrt => Real::sqrt(a),
            Operation::Abs => Real::abs(a),
            Operation::WherePositive if a > T::of(0.0) => b,
            Operation::WherePositive => c,
        };
    }
    values.fill(T::of(0.0));
    slopes.fill(T::of(0.0));
    for output in tape.outputs {
        let place = usize::from(output.place);
        let to = match place.checked_sub(values.len()) {
            None => values.get_mut(place),
            Some(place) => slopes.get_mut(place),
        };
        if let Some(to) = to {
            *to = memory[usize::from(output.value)];
        }
    }
}

impl<T: Real, Memory: AsMut<[T]>> Model<T> for TableModel<'_, T, Memory> {
    fn moving(&self) -> usize {
        self.table.moving
    }

    fn states(&self) -> usize {
        self.table.states
    }

    fn inputs(&self) -> usize {
        self.table.inputs
    }

    fn readings(&self) -> usize {
        self.table.readings
    }

    fn rates(&mut self, x: &[T], input: Input<'_, T>, xdot: &mut [T]) {
        run(&self.table, &self.table.rates, self.memory.as_mut(), (x, input), xdot, &mut []);
    }

    fn rates_slopes(&mut self, x: &[T], input: Input<'_, T>, xdot: &mut [T], by_x: &mut [T]) {
        run(&self.table, &self.table.rates_slopes, self.memory.as_mut(), (x, input), xdot, by_x);
    }

    fn readings_slopes(&mut self, x: &[T], input: Input<'_, T>, y: &mut [T], by_x: &mut [T]) {
        run(&self.table, &self.table.readings_slopes, self.memory.as_mut(), (x, input), y, by_x);
    }
}
