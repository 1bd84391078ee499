//! The parameters of the dynamics, in the coordinates in which a fit converges.
//!
//! Fitted as printed, (k_pwm, k_mi, b, μ) run away from Table 1's initial guess, since 1/b crosses zero on the way. The solver moves
//! in (k_pwm/b, k_mi/b, 1/b, μ/b) instead: equation (9) is linear in these. Where b belongs to rigid joints (it then adds to the
//! links' inertia) or is known, parameters stay as they are.

use std::sync::Arc;

use super::law::{Law, Parameters};
use super::number::quantity::Quantity;
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

/// All free parameters of the dynamics: those of the base model in the order of the robot's parameters, then the laws'.
///
/// Results are the physical parameters: as many as coordinates in the base model, but a law's may be more or fewer.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Coordinates {
    list: Vec<Coordinate>,
    laws: Vec<LawBlock>,
}

/// The parameters of one law.
#[derive(Debug, Clone, PartialEq)]
struct LawBlock {
    /// Its first coordinate and its first result.
    first: usize,
    first_result: usize,
    parameters: Parameters,
}

impl Coordinates {
    /// The free dynamics parameters of `robot`, and those of `laws`.
    pub(super) fn of(robot: &Robot, laws: &[Arc<dyn Law>]) -> Self {
        let specs: Vec<&ParameterSpec> =
            robot.parameters().iter().filter(|spec| spec.value.free && !spec.joints.is_empty()).collect();
        let elastic =
            |spec: &ParameterSpec| spec.joints.iter().all(|&j| robot.joints[j].transmission == Transmission::Elastic);
        let inverse_inertia_of = |spec: &ParameterSpec| {
            specs.iter().position(|b| {
                b.symbol == Symbol::B && elastic(b) && spec.joints.iter().all(|joint| b.joints.contains(joint))
            })
        };
        let list: Vec<Coordinate> = specs
            .iter()
            .map(|spec| {
                let form = match spec.symbol {
                    Symbol::B if elastic(spec) => Form::Inverse,
                    Symbol::KPwm | Symbol::KT | Symbol::KMi | Symbol::Mu | Symbol::V | Symbol::O => {
                        inverse_inertia_of(spec).map_or(Form::Direct, Form::OverInertia)
                    }
                    _ => Form::Direct,
                };
                Coordinate { spec: (*spec).clone(), form }
            })
            .collect();
        let (mut first, mut first_result) = (list.len(), list.len());
        let laws = laws.iter().map(|law| {
            let block = LawBlock { first, first_result, parameters: law.parameters().clone() };
            first += block.parameters.coordinates.len();
            first_result += block.parameters.results.len();
            block
        });
        let laws = laws.collect();
        Coordinates { list, laws }
    }

    /// Number of coordinates.
    pub fn len(&self) -> usize {
        self.laws.last().map_or(self.list.len(), |block| block.first + block.parameters.coordinates.len())
    }

    /// Coordinates of laws that a search keeps within these ends, which are farther apart than what a robot can have.
    pub fn bounds(&self) -> impl Iterator<Item = (usize, [f64; 2])> + '_ {
        self.laws.iter().flat_map(|block| block.parameters.bounds().map(|(own, ends)| (block.first + own, ends)))
    }

    /// Whether everything is known.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The base model's coordinates in order.
    pub fn iter(&self) -> impl Iterator<Item = &Coordinate> {
        self.list.iter()
    }

    /// Number of results.
    pub fn results(&self) -> usize {
        self.laws.last().map_or(self.list.len(), |block| block.first_result + block.parameters.results.len())
    }

    /// Name and unit of every result.
    pub fn names(&self) -> impl Iterator<Item = (&str, &'static str)> {
        let base = self.list.iter().map(|c| (c.spec.name.as_str(), c.spec.unit));
        base.chain(
            self.laws.iter().flat_map(|block| block.parameters.results.iter().map(|r| (r.name.as_str(), r.unit))),
        )
    }

    /// The first coordinate of a law, by its place among the laws.
    pub fn first_of_law(&self, law: usize) -> usize {
        self.laws[law].first
    }

    /// The coordinates of a law, by its place among the laws, out of all.
    pub fn of_law<'z>(&self, law: usize, z: &'z [f64]) -> &'z [f64] {
        let block = &self.laws[law];
        &z[block.first..block.first + block.parameters.coordinates.len()]
    }

    /// Solver coordinates of the start values.
    pub fn start(&self) -> Vec<f64> {
        let physical: Vec<f64> = self.list.iter().map(|c| c.spec.value.start).collect();
        let mut z = self.base_from_physical(&physical);
        for block in &self.laws {
            z.extend(block.parameters.coordinates.iter().map(|coordinate| coordinate.start));
        }
        z
    }

    /// Solver coordinates of physical values, one a result.
    pub fn from_physical<T: Quantity>(&self, physical: &[T]) -> Vec<T> {
        let mut z = self.base_from_physical(physical);
        for block in &self.laws {
            z.extend(block.parameters.recall(&physical[block.first_result..]));
        }
        z
    }

    /// Whether a result is a parameter of its own: it neither follows from others nor is chosen.
    pub fn is_own(&self, result: usize) -> bool {
        let law = self.laws.iter().rfind(|block| block.first_result <= result);
        law.is_none_or(|block| block.parameters.results[result - block.first_result].form.is_own())
    }

    /// Solver coordinates of the base model's physical values: laws' are not among them.
    pub fn base_from_physical<T: Quantity>(&self, physical: &[T]) -> Vec<T> {
        let convert = |(c, &value): (&Coordinate, &T)| match c.form {
            Form::Direct => value,
            Form::Inverse => T::from(1.0).over(value),
            Form::OverInertia(b) => value.over(physical[b]),
        };
        self.list.iter().zip(physical).map(convert).collect()
    }

    /// Physical values of solver coordinates, one a result.
    pub fn to_physical(&self, z: &[f64]) -> Vec<f64> {
        (0..self.results()).map(|i| self.physical_and_slopes(z, i).0).collect()
    }

    /// Result i, and its derivatives `(coordinate, ∂result/∂z)`.
    pub fn physical_and_slopes(&self, z: &[f64], i: usize) -> (f64, Vec<(usize, f64)>) {
        let Some(coordinate) = self.list.get(i) else {
            let law = self.laws.iter().rposition(|block| block.first_result <= i);
            // Results behind the base's belong to a law.
            let Some(law) = law else { return (f64::NAN, Vec::new()) };
            let block = &self.laws[law];
            let (value, slopes) = block.parameters.results[i - block.first_result].form.value(self.of_law(law, z));
            return (value, slopes.into_iter().map(|(own, slope)| (block.first + own, slope)).collect());
        };
        match coordinate.form {
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
    pub(super) fn value<T: Quantity>(self, z: &[T]) -> T {
        match self {
            Source::Known(value) => T::from(value),
            Source::Free { coordinate, form: Form::Direct } => z[coordinate],
            Source::Free { coordinate, form: Form::Inverse } => T::from(1.0).over(z[coordinate]),
            Source::Free { coordinate, form: Form::OverInertia(b) } => z[coordinate].over(z[b]),
        }
    }

    /// 1/parameter, for inertias.
    pub(super) fn inverse<T: Quantity>(self, z: &[T]) -> T {
        match self {
            Source::Free { coordinate, form: Form::Inverse } => z[coordinate],
            other => T::from(1.0).over(other.value(z)),
        }
    }

    /// parameter · `inverse_inertia`, without the division where the coordinate is that product already.
    pub(super) fn over_inertia<T: Quantity>(self, z: &[T], inverse_inertia: T) -> T {
        match self {
            Source::Free { coordinate, form: Form::OverInertia(_) } => z[coordinate],
            other => other.value(z) * inverse_inertia,
        }
    }
}
