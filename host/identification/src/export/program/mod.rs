//! The model as a straight-line program: ẋ and the sensors' readings, with their exact derivatives by state, inputs and parameters.
//!
//! ```text
//! variables   | x | u | p | t |
//! Exported ──▶ Model::traced_rates ──▶ ẋ ──▶ readings at x + offset ẋ ──▶ slopes column by column ──▶ Program
//! ```

mod c;
mod head;
mod rust;
mod slopes;
mod text;

pub(super) use c::c_files;
pub use c::{CFiles, c};
pub(super) use head::of_program as head_of_program;
pub use rust::rust;

use super::{ExportError, Exported, Place};
use crate::model::expression::{Node, traced};
use crate::model::traced::TracedRates;
use crate::model::{Expression, Quantity};
use crate::robot::chain::Arithmetic;
use crate::robot::{ChannelKind, Side};

/// A model written down.
#[derive(Debug)]
pub struct Program {
    nodes: Vec<Node>,
    /// Sizes of what it is given.
    pub sizes: Sizes,
    /// ẋ.
    pub rates: Vec<Expression>,
    /// y.
    pub readings: Vec<Expression>,
    /// ∂ẋ/∂(x, u, p) by rows.
    pub rate_slopes: Vec<Expression>,
    /// ∂y/∂(x, u, p) by rows.
    pub reading_slopes: Vec<Expression>,
}

/// How many numbers a program is given of each kind, and gives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sizes {
    /// x.
    pub states: usize,
    /// u.
    pub inputs: usize,
    /// p.
    pub parameters: usize,
    /// y.
    pub readings: usize,
}

impl Sizes {
    /// Columns of the derivatives.
    pub fn columns(self) -> usize {
        self.states + self.inputs + self.parameters
    }
}

impl Program {
    /// Writes the model down.
    ///
    /// # Errors
    /// [`ExportError::Untraceable`] of a model with a law that cannot be written down.
    pub fn of(exported: &Exported<'_>) -> Result<Self, ExportError> {
        let sizes = Sizes {
            states: exported.states.len(),
            inputs: exported.inputs(),
            parameters: exported.parameters.len(),
            readings: exported.readings.len(),
        };
        let (mut program, nodes) = traced(|| write(exported, sizes));
        program.nodes = nodes;
        let roots = [&program.rates, &program.readings, &program.rate_slopes, &program.reading_slopes];
        for node in program.needed(roots.into_iter().flatten().copied()) {
            if matches!(program.node(node), Node::Constant(bits) if f64::from_bits(bits).is_nan()) {
                return Err(ExportError::Untraceable);
            }
        }
        Ok(program)
    }

    /// How a node is computed.
    pub fn node(&self, expression: Expression) -> Node {
        self.nodes[expression.place()]
    }

    /// Whether a node is the number zero.
    pub fn is_zero(&self, expression: Expression) -> bool {
        self.node(expression) == Node::Constant(0)
    }

    /// All nodes that these need, themselves included, in the order of computing.
    pub fn needed(&self, roots: impl IntoIterator<Item = Expression>) -> Vec<Expression> {
        let mut seen = vec![false; self.nodes.len()];
        let mut stack: Vec<Expression> = roots.into_iter().collect();
        let mut needed = Vec::new();
        while let Some(expression) = stack.pop() {
            if !std::mem::replace(&mut seen[expression.place()], true) {
                needed.push(expression);
                stack.extend(operands(self.node(expression)));
            }
        }
        needed.sort();
        needed
    }

    /// The values of these at given variables.
    pub fn evaluate(&self, roots: &[Expression], variables: &[f64]) -> Vec<f64> {
        let mut values = vec![0.0; self.nodes.len()];
        for expression in self.needed(roots.iter().copied()) {
            let value = |of: Expression| values[of.place()];
            values[expression.place()] = match self.node(expression) {
                Node::Constant(bits) => f64::from_bits(bits),
                Node::Variable(place) => variables[place as usize],
                Node::Add(a, b) => value(a) + value(b),
                Node::Sub(a, b) => value(a) - value(b),
                Node::Mul(a, b) => value(a) * value(b),
                Node::Div(a, b) => value(a) / value(b),
                Node::Neg(a) => -value(a),
                Node::Call(function, a) => function.at(value(a)),
                Node::WherePositive(a, then, otherwise) => value(if value(a) > 0.0 { then } else { otherwise }),
                Node::Held(a) => value(a),
            };
        }
        roots.iter().map(|root| values[root.place()]).collect()
    }
}

/// What a node is computed from.
pub(super) fn operands(node: Node) -> impl Iterator<Item = Expression> {
    let operands = match node {
        Node::Constant(_) | Node::Variable(_) => [None; 3],
        Node::Add(a, b) | Node::Sub(a, b) | Node::Mul(a, b) | Node::Div(a, b) => [Some(a), Some(b), None],
        Node::Neg(a) | Node::Call(_, a) | Node::Held(a) => [Some(a), None, None],
        Node::WherePositive(a, b, c) => [Some(a), Some(b), Some(c)],
    };
    operands.into_iter().flatten()
}

fn write(exported: &Exported<'_>, sizes: Sizes) -> Program {
    let variables: Vec<Expression> = (0..=sizes.columns()).map(Expression::variable).collect();
    let (x, rest) = variables.split_at(sizes.states);
    let (u, rest) = rest.split_at(sizes.inputs);
    let (p, rest) = rest.split_at(sizes.parameters);
    let time_s = rest[0];
    let model = exported.calibrated.model();
    let z = coordinates(exported, p);
    let motion = model.traced_rates(x, u, time_s, &z);
    let readings = readings(exported, (x, p, time_s), &z, &motion.xdot);
    let (rate_slopes, reading_slopes) = by_columns(&motion, &readings, sizes);
    Program { nodes: Vec::new(), sizes, rates: motion.xdot, readings, rate_slopes, reading_slopes }
}

/// The model's coordinates from the parameters.
fn coordinates(exported: &Exported<'_>, p: &[Expression]) -> Vec<Expression> {
    let coordinates = exported.calibrated.model().coordinates();
    // A result that is none of its own is not asked for.
    let mut results = vec![Expression::unknown(); coordinates.results()];
    for (parameter, p) in exported.parameters.iter().zip(p) {
        if let Place::Result(i) = parameter.place {
            results[i] = *p;
        }
    }
    coordinates.from_physical(&results)
}

/// What the sensors read; each a little after the state, as its description says.
fn readings(
    exported: &Exported<'_>,
    (x, p, time_s): (&[Expression], &[Expression], Expression),
    z: &[Expression],
    xdot: &[Expression],
) -> Vec<Expression> {
    let calibrated = &exported.calibrated;
    let (model, laws) = (calibrated.model(), calibrated.sensor_laws());
    let layout = model.layout();
    let reading = |channel: &crate::robot::Channel| {
        let offset_s = Expression::from(channel.offset_s);
        let late: Vec<Expression> = x.iter().zip(xdot).map(|(x, xdot)| *x + offset_s * *xdot).collect();
        let position = |side: Side, joint: usize| {
            let [position, speed] = match side {
                Side::Motor => [layout.theta(joint), layout.thetad(joint)],
                Side::Link => [layout.q(joint), layout.qd(joint)],
            };
            laws.traced_position(model, z, (side, joint), [late[position], late[speed]])
        };
        match channel.kind {
            ChannelKind::MotorPosition { joint } => position(Side::Motor, joint),
            ChannelKind::LinkPosition { joint } => position(Side::Link, joint),
            ChannelKind::MotorSpeed { joint } => late[layout.thetad(joint)],
            ChannelKind::LinkSpeed { joint } => late[layout.qd(joint)],
            ChannelKind::GyroAxis { gyro, body, axis } => {
                let turns = model.traced_body_rates(&late)[body];
                let rate = model.lagging(gyro).map_or(turns, |lagging| lagging.rate(&late, turns));
                let (rate, bias) = seen_by_gyro(exported, p, gyro, rate);
                laws.traced_gyro(model, z, (gyro, time_s), rate, bias)[axis]
            }
        }
    };
    exported.readings.iter().map(reading).collect()
}

/// The rate of a gyro's body in the gyro's axes, and its bias.
fn seen_by_gyro(
    exported: &Exported<'_>,
    p: &[Expression],
    gyro: usize,
    rate: [Expression; 3],
) -> ([Expression; 3], [Expression; 3]) {
    let calibrated = &exported.calibrated;
    let find = |place: Place| exported.parameters.iter().position(|parameter| parameter.place == place).map(|i| p[i]);
    let bias = std::array::from_fn(|axis| {
        find(Place::Bias { gyro, axis }).unwrap_or_else(|| Expression::from(calibrated.biases()[gyro][axis]))
    });
    let delta = [0, 1, 2].map(|axis| find(Place::Misalignment { gyro, axis }));
    let (nominal, rate) = match delta {
        [Some(x), Some(y), Some(z)] => {
            let of = calibrated.robot().gyros().nth(gyro);
            (of.map_or([[0.0; 3]; 3], |gyro| gyro.rotation), turned(rate, [x, y, z]))
        }
        _ => {
            let known = &calibrated.rotations()[gyro];
            (std::array::from_fn(|i| std::array::from_fn(|j| known[(i, j)])), rate)
        }
    };
    let seen = nominal.map(|row| rate[0] * row[0] + rate[1] * row[1] + rate[2] * row[2]);
    (seen, bias)
}

/// Below this square of the angle, rad², the quotients of [`turned`] go by their series.
const SMALL: f64 = 1e-4;

/// Rot(δ) v = v + (sin θ / θ) δ × v + ((1 − cos θ) / θ²) δ × (δ × v), θ = ‖δ‖.
fn turned(v: [Expression; 3], delta: [Expression; 3]) -> [Expression; 3] {
    let number = Expression::from;
    let cross = |a: [Expression; 3], b: [Expression; 3]| {
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    };
    let square = delta[0] * delta[0] + delta[1] * delta[1] + delta[2] * delta[2];
    let large = square - number(SMALL);
    let safe = large.where_positive(square, number(1.0));
    let angle = safe.sqrt();
    let (half, sine) = ((angle * 0.5).sin_cos().0, angle.sin_cos().0);
    let series = |c: [f64; 4]| ((square * c[3] + number(c[2])) * square + number(c[1])) * square + number(c[0]);
    let first = large.where_positive(sine.over(angle), series([1.0, -1.0 / 6.0, 1.0 / 120.0, -1.0 / 5040.0]));
    let second =
        large.where_positive((half * half * 2.0).over(safe), series([0.5, -1.0 / 24.0, 1.0 / 720.0, -1.0 / 40320.0]));
    let once = cross(delta, v);
    let twice = cross(delta, once);
    std::array::from_fn(|i| v[i] + first * once[i] + second * twice[i])
}

/// Derivatives of ẋ and of readings by every variable but the time, by rows.
fn by_columns(motion: &TracedRates, readings: &[Expression], sizes: Sizes) -> (Vec<Expression>, Vec<Expression>) {
    let columns = sizes.columns();
    let zero = Expression::from(0.0);
    let mut of_rates = vec![zero; motion.xdot.len() * columns];
    let mut of_readings = vec![zero; readings.len() * columns];
    let roots: Vec<Expression> = [&motion.missing[..], &motion.xdot, readings].concat();
    let tape = slopes::Tape::of(&roots);
    for column in 0..columns {
        let fixed = tape.slopes(column, &[]);
        let mut by_solution: Vec<Expression> = motion.missing.iter().map(|root| -fixed.of(*root)).collect();
        motion.inertia.solve(&mut by_solution);
        let held: Vec<_> = motion.accelerations.iter().copied().zip(by_solution).collect();
        let slopes = tape.slopes(column, &held);
        for (row, root) in motion.xdot.iter().enumerate() {
            of_rates[row * columns + column] = slopes.of(*root);
        }
        for (row, root) in readings.iter().enumerate() {
            of_readings[row * columns + column] = slopes.of(*root);
        }
    }
    (of_rates, of_readings)
}
