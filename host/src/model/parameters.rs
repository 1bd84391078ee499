//! The parameters of the dynamics, in the coordinates in which a fit converges.
//!
//! Fitted as printed, (k_pwm, k_mi, b, μ) run away from Table 1's initial guess, since 1/b crosses zero on the way. The solver moves
//! in (k_pwm/b, k_mi/b, 1/b, μ/b) instead: equation (9) is linear in these. Where b belongs to rigid joints (it then adds to the
//! links' inertia) or is known, parameters stay as they are.

use crate::robot::chain::Scalar;
use crate::robot::{ParameterSpec, Robot, Symbol, Transmission};

/// How a solver coordinate z stands for a physical parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Form {
    /// z is the parameter.
    Direct,
    /// z = 1/b.
    Inverse,
    /// z = parameter / b, with the coordinate that is 1/b.
    OverInertia(usize),
}

/// One free parameter of the dynamics.
#[derive(Debug, Clone, PartialEq)]
pub struct Coordinate {
    /// The physical parameter.
    pub spec: ParameterSpec,
    form: Form,
}

/// All free parameters of the dynamics, in the order of the robot's parameters.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Coordinates {
    list: Vec<Coordinate>,
}

impl Coordinates {
    /// The free dynamics parameters of `robot`.
    pub fn of(robot: &Robot) -> Self {
        let specs: Vec<&ParameterSpec> =
            robot.parameters().iter().filter(|spec| spec.value.free && !spec.joints.is_empty()).collect();
        let elastic =
            |spec: &ParameterSpec| spec.joints.iter().all(|&j| robot.joints[j].transmission == Transmission::Elastic);
        let inverse_inertia_of = |spec: &ParameterSpec| {
            specs.iter().position(|b| {
                b.symbol == Symbol::B && elastic(b) && spec.joints.iter().all(|joint| b.joints.contains(joint))
            })
        };
        let list = specs
            .iter()
            .map(|spec| {
                let form = match spec.symbol {
                    Symbol::B if elastic(spec) => Form::Inverse,
                    Symbol::KPwm | Symbol::KT | Symbol::KMi | Symbol::Mu => {
                        inverse_inertia_of(spec).map_or(Form::Direct, Form::OverInertia)
                    }
                    _ => Form::Direct,
                };
                Coordinate { spec: (*spec).clone(), form }
            })
            .collect();
        Coordinates { list }
    }

    /// Number of coordinates.
    pub fn len(&self) -> usize {
        self.list.len()
    }

    /// Whether everything is known.
    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// The coordinates in order.
    pub fn iter(&self) -> impl Iterator<Item = &Coordinate> {
        self.list.iter()
    }

    /// Solver coordinates of the start values.
    pub fn start(&self) -> Vec<f64> {
        let physical: Vec<f64> = self.list.iter().map(|c| c.spec.value.start).collect();
        self.from_physical(&physical)
    }

    /// Solver coordinates of physical values.
    pub fn from_physical(&self, physical: &[f64]) -> Vec<f64> {
        let convert = |(c, &value): (&Coordinate, &f64)| match c.form {
            Form::Direct => value,
            Form::Inverse => 1.0 / value,
            Form::OverInertia(b) => value / physical[b],
        };
        self.list.iter().zip(physical).map(convert).collect()
    }

    /// Physical values of solver coordinates.
    pub fn to_physical(&self, z: &[f64]) -> Vec<f64> {
        (0..self.len()).map(|i| self.physical_and_slopes(z, i).0).collect()
    }

    /// The physical value of coordinate i, and its derivatives `(coordinate, ∂physical/∂z)` (at most two).
    pub fn physical_and_slopes(&self, z: &[f64], i: usize) -> (f64, Vec<(usize, f64)>) {
        match self.list[i].form {
            Form::Direct => (z[i], vec![(i, 1.0)]),
            Form::Inverse => (1.0 / z[i], vec![(i, -1.0 / (z[i] * z[i]))]),
            Form::OverInertia(b) => (z[i] / z[b], vec![(i, 1.0 / z[b]), (b, -z[i] / (z[b] * z[b]))]),
        }
    }

    /// Where the value of `symbol` at `joint` comes from.
    pub(super) fn source(&self, robot: &Robot, symbol: Symbol, joint: usize) -> Source {
        let free = self.list.iter().position(|c| c.spec.symbol == symbol && c.spec.joints.contains(&joint));
        match free {
            Some(i) => Source::Free { coordinate: i, form: self.list[i].form },
            None => Source::Known(robot.joint_parameter(symbol, joint).map_or(0.0, |spec| spec.value.start)),
        }
    }
}

/// Where a joint's parameter comes from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Source {
    /// Known (zero where the joint has no such parameter).
    Known(f64),
    /// Estimated.
    Free { coordinate: usize, form: Form },
}

impl Source {
    /// The parameter itself.
    pub(super) fn value<T: Scalar>(self, z: &[T]) -> T {
        match self {
            Source::Known(value) => T::from(value),
            Source::Free { coordinate, form: Form::Direct } => z[coordinate],
            Source::Free { coordinate, form: Form::Inverse } => T::from(1.0) / z[coordinate],
            Source::Free { coordinate, form: Form::OverInertia(b) } => z[coordinate] / z[b],
        }
    }

    /// 1/parameter, for inertias.
    pub(super) fn inverse<T: Scalar>(self, z: &[T]) -> T {
        match self {
            Source::Free { coordinate, form: Form::Inverse } => z[coordinate],
            other => T::from(1.0) / other.value(z),
        }
    }

    /// parameter · `inverse_inertia`, without the division where the coordinate is that product already.
    pub(super) fn over_inertia<T: Scalar>(self, z: &[T], inverse_inertia: T) -> T {
        match self {
            Source::Free { coordinate, form: Form::OverInertia(_) } => z[coordinate],
            other => other.value(z) * inverse_inertia,
        }
    }
}
