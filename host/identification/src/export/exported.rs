//! A calibrated model as every export reads it: the extended robot, its parameters with their errors, the names of its states.

use crate::calibrate::{Calibration, ParameterEstimate, Status};
use crate::model::Integrator;
use crate::robot::{Channel, JointKind, Symbol};
use crate::verify::CalibratedModel;

use super::ExportError;

/// A calibrated model, extended where the calibration is.
#[derive(Debug)]
pub struct Exported<'c> {
    /// The result that it comes from.
    pub calibration: &'c Calibration,
    /// The model at the calibrated values.
    pub calibrated: CalibratedModel,
    /// What may be varied, in the order of every file's parameters.
    pub parameters: Vec<Parameter>,
    /// Components of the state.
    pub states: Vec<Quantity>,
    /// Readings of the sensors.
    pub readings: Vec<Channel>,
}

/// A parameter of the model that is not known beforehand.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// As in CAL.json.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// The calibrated value.
    pub value: f64,
    /// Standard error; none where the recordings do not determine it.
    pub std_error: Option<f64>,
    /// What it is in the model.
    pub place: Place,
}

/// What a parameter is in the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// This one of the results of the dynamics.
    Result(usize),
    /// A gyro's bias along an axis of its own.
    Bias {
        /// Which gyro.
        gyro: usize,
        /// Sensor axis.
        axis: usize,
    },
    /// A gyro's misalignment about an axis of its body.
    Misalignment {
        /// Which gyro.
        gyro: usize,
        /// Body axis.
        axis: usize,
    },
}

/// A named component.
#[derive(Debug, Clone, PartialEq)]
pub struct Quantity {
    /// Its name, a word of letters and digits.
    pub name: String,
    /// Unit.
    pub unit: &'static str,
}

impl<'c> Exported<'c> {
    /// The model of a calibration; where gyros have biases of their own in each recording, with the mean of them.
    ///
    /// # Errors
    /// A calibration that another version wrote, or that was edited.
    pub fn of(calibration: &'c Calibration) -> Result<Self, ExportError> {
        let calibrated = CalibratedModel::of(calibration, None)?;
        let parameters = parameters(calibration, &calibrated);
        let states = states(&calibrated);
        let readings = calibrated.robot().channels();
        Ok(Exported { calibration, calibrated, parameters, states, readings })
    }

    /// The robot's name as an identifier of programming languages.
    pub fn identifier(&self) -> String {
        identifier(&self.calibrated.robot().name)
    }

    /// How many inputs.
    pub fn inputs(&self) -> usize {
        self.calibrated.robot().joints.len()
    }

    /// Equal parts of a step of the sample period in which a joint comes to rest; one where steps are never divided.
    pub fn parts(&self) -> usize {
        let (model, period_s) = (self.calibrated.model(), self.calibrated.robot().sample_period_s);
        self.calibrated.integrator().parts_near_rest(&model.at(self.calibrated.z()), period_s)
    }

    /// Joints whose friction parts steps near rest: component of their speed, κ/2, rate near rest. None of Euler's steps.
    pub(super) fn rubbing(&self) -> Vec<(usize, f64, f64)> {
        match self.integrator() {
            Integrator::Euler => Vec::new(),
            Integrator::RungeKutta4 => self.calibrated.model().at(self.calibrated.z()).rubbing().collect(),
        }
    }

    /// The method of a step.
    pub fn integrator(&self) -> Integrator {
        self.calibrated.integrator()
    }

    /// Standard deviation of each reading: as estimated, or as described.
    pub fn sigmas(&self) -> Vec<f64> {
        let noise = &self.calibration.noise;
        let sigma = |channel: &Channel| {
            noise.iter().find(|noise| noise.channel == channel.name).map_or(channel.sigma, |noise| noise.sigma)
        };
        self.readings.iter().map(sigma).collect()
    }

    /// The state of a robot that rests at zero.
    pub fn rest(&self) -> Vec<f64> {
        vec![0.0; self.states.len()]
    }

    /// What a reader must know before trusting it; none of a calibration that fits and determines everything.
    pub fn warning(&self) -> Option<String> {
        let status = match self.calibration.status {
            Status::Converged | Status::Almost => return None,
            Status::Unidentifiable => {
                let names: Vec<_> =
                    self.parameters.iter().filter(|p| p.std_error.is_none()).map(|p| p.name.as_str()).collect();
                return Some(format!("unidentifiable: the recordings do not determine {}", listed(&names)));
            }
            Status::NoProgress => "no_progress: the search ended where a step should have helped",
            Status::IterationLimit => "iteration_limit: the search did not come to an end",
            Status::DoesNotFit => "does_not_fit",
        };
        let misfit = self.calibration.misfit.join("; ");
        let why = if misfit.is_empty() { String::new() } else { format!(": {misfit}") };
        Some(format!("{status}{why}; do not trust this model"))
    }

    /// Where it comes from, in lines for the head of a file.
    pub fn origin(&self) -> Vec<String> {
        let Calibration { recordings, status, extensions, .. } = self.calibration;
        let mut lines: Vec<String> = self.warning().map(|warning| format!("WARNING: {warning}")).into_iter().collect();
        let robot = self.calibrated.robot();
        lines.push(format!("{}: {}", robot.name, robot.description));
        lines.push(format!("calibrated by host {}, status {}", env!("CARGO_PKG_VERSION"), word(*status)));
        for used in recordings {
            lines.push(format!("on {} ({} samples, sha256 {})", used.path, used.samples, used.sha256));
        }
        if !extensions.is_empty() {
            lines.push(format!("extended by {}", extensions.join(", ")));
        }
        lines
    }
}

/// A status as CAL.json spells it.
fn word(status: Status) -> &'static str {
    match status {
        Status::Converged => "converged",
        Status::Almost => "almost",
        Status::NoProgress => "no_progress",
        Status::IterationLimit => "iteration_limit",
        Status::Unidentifiable => "unidentifiable",
        Status::DoesNotFit => "does_not_fit",
    }
}

fn listed(names: &[&str]) -> String {
    match names {
        [] => "a combination of parameters; see `unobservable` in the calibration".to_owned(),
        _ => names.join(", "),
    }
}

fn parameters(calibration: &Calibration, calibrated: &CalibratedModel) -> Vec<Parameter> {
    let error = |name: &str| std_error(calibration, name);
    let coordinates = calibrated.model().coordinates();
    let physical = coordinates.to_physical(calibrated.z());
    let results = coordinates.names().zip(physical).enumerate();
    let mut parameters: Vec<Parameter> = results
        .filter(|(i, _)| coordinates.is_own(*i))
        .map(|(i, ((name, unit), value))| Parameter {
            name: name.to_owned(),
            unit: unit.to_owned(),
            value,
            std_error: error(name),
            place: Place::Result(i),
        })
        .collect();
    for spec in calibrated.robot().parameters().iter().filter(|spec| spec.value.free) {
        let (place, value) = match spec.symbol {
            Symbol::Bias { gyro, axis } => (Place::Bias { gyro, axis }, calibrated.biases()[gyro][axis]),
            Symbol::Misalignment { gyro, axis } => (
                Place::Misalignment { gyro, axis },
                calibration.parameter(&spec.name).map_or(0.0, |found| found.estimate),
            ),
            _ => continue,
        };
        let (name, unit) = (spec.name.clone(), spec.unit.to_owned());
        parameters.push(Parameter { std_error: error(&spec.name), name, unit, value, place });
    }
    parameters
}

/// The error of a parameter, or of the mean of what each recording has of it.
fn std_error(calibration: &Calibration, name: &str) -> Option<f64> {
    let of = |estimate: &ParameterEstimate| estimate.std_error.filter(|_| estimate.identifiable);
    if let Some(estimate) = calibration.parameter(name) {
        return of(estimate);
    }
    let recordings = 1..=calibration.recordings.len();
    let squares =
        recordings.map(|i| calibration.parameter(&format!("{name}@{i}")).and_then(of).map(|error| error * error));
    let squares = squares.collect::<Option<Vec<f64>>>().filter(|squares| !squares.is_empty())?;
    Some(squares.iter().sum::<f64>().sqrt() / squares.len() as f64)
}

fn states(calibrated: &CalibratedModel) -> Vec<Quantity> {
    let (model, robot) = (calibrated.model(), calibrated.robot());
    let layout = model.layout();
    let mut states = vec![Quantity { name: String::new(), unit: "" }; layout.size()];
    for (number, joint) in layout.passive().enumerate() {
        states[joint] = Quantity { name: format!("phi{}", number + 1), unit: "rad" };
        states[layout.chain() + joint] = Quantity { name: format!("phid{}", number + 1), unit: "rad/s" };
    }
    for (i, joint) in robot.joints.iter().enumerate() {
        let [position, speed] = match joint.kind {
            JointKind::Revolute => ["rad", "rad/s"],
            JointKind::Prismatic => ["m", "m/s"],
        };
        // θ of a rigid joint is its q: that name stands.
        states[layout.theta(i)] = Quantity { name: format!("theta{}", i + 1), unit: position };
        states[layout.thetad(i)] = Quantity { name: format!("thetad{}", i + 1), unit: speed };
        states[layout.q(i)] = Quantity { name: format!("q{}", i + 1), unit: position };
        states[layout.qd(i)] = Quantity { name: format!("qd{}", i + 1), unit: speed };
    }
    let mut own = layout.own();
    for law in model.laws() {
        for (number, place) in own.by_ref().take(model.own_states_of(&**law)).enumerate() {
            states[place].name = format!("{}_{}", id_of(&**law), number + 1);
            states[place].unit = "of its own";
        }
    }
    states
}

/// The effect that a law is of, by the names of its results.
fn id_of(law: &dyn crate::model::law::Law) -> &str {
    law.parameters().results.first().and_then(|result| result.name.split('.').next()).unwrap_or("own")
}

/// A name as an identifier: letters, digits and `_`.
pub(super) fn identifier(name: &str) -> String {
    let mut word: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    if word.starts_with(|c: char| c.is_ascii_digit()) {
        word.insert(0, '_');
    }
    word
}
