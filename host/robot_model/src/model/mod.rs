//! The elastic-joint model: equations (6)–(12) over a serial chain, its integrators and its sensors.
//!
//! ```text
//! u ─▶ drive (motor torque, friction, transmission) ─▶ link torques ─▶ accelerations ─▶ one step ─▶ sensors
//!      drive.rs                                        dynamics.rs                       integrator.rs  sensor.rs
//! ```
//!
//! The state is x = (q, q̇, θ, θ̇), equation (8): q and q̇ of all n joints, θ and θ̇ of the elastic ones (a rigid joint has θ = q).
//! Where the recorded input is a measurement, what it errs by is a state as well, held over a step and unknown anew in the next:
//! the motor gets u + e. So its noise enters the equations where the input does, and is weighed in the input's unit.
//! Effects extend it by their [`law`]s: passive joints, own states, other torques.
//! Everything is on the link side of the gear, in SI. A [`Model`] knows a robot; [`Dynamics`] is a model at given
//! parameters. Derivatives are exact: laws are written once over any scalar and run on dual numbers. Run on an
//! [`Expression`] they write their formulas down, for programs in other languages (`traced`).

mod drive;
mod dynamics;
pub mod fast;
mod inertia;
mod input;
mod integrator;
pub mod law;
mod laws;
mod links;
mod number;
mod parameters;
mod relaxation;
pub mod rotation;
mod sensor;
mod supply;
#[cfg(test)]
mod tests;
pub mod traced;

pub use dynamics::{Dynamics, Linear, LinksAt, MOST_PARTS, WHOLE};
pub use input::Input;
pub use integrator::{Integrator, StepSlopes, Stepper};
pub use laws::Lagging;
pub use number::expression::{self, Expression};
pub use number::quantity::{Number, Quantity, variable};
pub use parameters::{Coordinate, Coordinates};
pub use sensor::laws::{GyroReading, PositionReading, SensorLaws};
pub use sensor::{GyroSlopes, SensorFrame};

use std::sync::Arc;

use crate::robot::chain::Chain;
use crate::robot::{InputNoise, Robot, RobotError, Symbol, Transmission};
use drive::Drive;
use law::Law;
use laws::Laws;
use links::Links;
use parameters::Source;

/// Why a model cannot be extended.
#[derive(Debug, thiserror::Error)]
pub enum ModelError {
    /// Passive joints that do not fit.
    #[error(transparent)]
    Robot(#[from] RobotError),
    /// Too much at one joint.
    #[error("{got} parameters and states of effects at one joint; at most {most} are possible: leave some effects out")]
    TooManyVariables {
        /// What was asked for.
        got: usize,
        /// What is possible.
        most: usize,
    },
}

/// The equations of one robot.
#[derive(Debug, Clone)]
pub struct Model {
    links: Links,
    coordinates: Coordinates,
    transmissions: Vec<Transmission>,
    drives: Vec<Drive>,
    layout: Layout,
    laws: Laws,
    /// How each joint's link encoder reads: at zero, and by what share too much.
    link_readings: Vec<[Source; 2]>,
    /// How late each gyro is.
    gyro_lags: Vec<Source>,
    /// Links in the chain that carry the robot's bodies.
    bodies: Vec<usize>,
}

impl Model {
    /// The base model of `robot`.
    pub fn new(robot: &Robot) -> Self {
        let (chain, links) = laws::base_links(robot, &Coordinates::of(robot, &[]));
        Self::of(robot, Vec::new(), chain, links)
    }

    /// The model of `robot` with `laws` of effects, asked in this order.
    ///
    /// # Errors
    /// [`ModelError`].
    pub fn extended(robot: &Robot, laws: Vec<Arc<dyn Law>>) -> Result<Self, ModelError> {
        let coordinates = Coordinates::of(robot, &laws);
        let (chain, links) = laws::links(robot, &laws, &coordinates)?;
        let model = Self::of(robot, laws, chain, links);
        let (got, most) = (model.laws.most_variables(), drive::lanes::MOST_VARIABLES);
        if got > most { Err(ModelError::TooManyVariables { got, most }) } else { Ok(model) }
    }

    fn of(robot: &Robot, laws: Vec<Arc<dyn Law>>, chain: Chain, links: Links) -> Self {
        let coordinates = Coordinates::of(robot, &laws);
        let transmissions: Vec<_> = robot.joints.iter().map(|joint| joint.transmission).collect();
        let first = laws.iter().map(|law| law.base_joints().len()).sum();
        let mut layout = Layout::of(&transmissions, first, chain.joints());
        layout.inputs = if robot.input_noise() == InputNoise::None { 0 } else { robot.joints.len() };
        let last = robot.joints.len() - 1;
        // Sensors of the outermost body sit on its outer part.
        let bodies: Vec<usize> =
            (0..=last).map(|body| if body == last { chain.joints() - 1 } else { first + body }).collect();
        let laws = Laws::of(robot, laws, &coordinates, &mut layout, &bodies);
        Model {
            links,
            drives: (0..robot.joints.len()).map(|joint| Drive::of(robot, &coordinates, joint)).collect(),
            layout,
            link_readings: (0..robot.joints.len())
                .map(|joint| [Symbol::Zero, Symbol::ScaleError].map(|symbol| coordinates.source(robot, symbol, joint)))
                .collect(),
            gyro_lags: robot
                .gyros()
                .enumerate()
                .map(|(gyro, sensor)| coordinates.source(robot, Symbol::Lag { gyro }, sensor.body))
                .collect(),
            coordinates,
            transmissions,
            laws,
            bodies,
        }
    }

    /// Where the state's components stand.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// The free parameters of the dynamics.
    pub fn coordinates(&self) -> &Coordinates {
        &self.coordinates
    }

    /// The kinematic chain, passive joints included.
    pub fn chain(&self) -> &Chain {
        self.links.chain()
    }

    /// The link of the [`chain`](Self::chain) that carries `body` of the robot with its sensors.
    pub fn body(&self, body: usize) -> usize {
        self.bodies[body]
    }

    /// Whether its drives have no constant torque and no friction on the link, and its bodies are as described.
    fn is_plain(&self) -> bool {
        !self.links.is_sum() && self.drives.iter().all(Drive::is_plain)
    }

    /// Where a link stands whose encoder reads `reading`, rad or m, at solver coordinates `z`.
    pub fn link_position(&self, joint: usize, reading: f64, z: &[f64]) -> f64 {
        let [zero, scale_error] = self.link_readings[joint].map(|source| source.value(z));
        (reading - zero) / (1.0 + scale_error)
    }

    /// How late a gyro is beyond what is known, s, and the coordinate that it is, if it is estimated.
    pub fn gyro_lag(&self, gyro: usize, z: &[f64]) -> (f64, Option<usize>) {
        match self.gyro_lags.get(gyro) {
            Some(Source::Free { coordinate, .. }) => (z[*coordinate], Some(*coordinate)),
            Some(Source::Known(lag_s)) => (*lag_s, None),
            None => (0.0, None),
        }
    }

    /// Whether a gyro is late beyond what is known, or that is estimated.
    pub fn has_gyro_lags(&self) -> bool {
        self.gyro_lags.iter().any(|lag| *lag != Source::Known(0.0))
    }

    /// The laws beyond the base model.
    pub fn laws(&self) -> &[Arc<dyn Law>] {
        self.laws.list()
    }

    /// What a lagging gyro reads in place of its body's rate.
    pub fn lagging(&self, gyro: usize) -> Option<Lagging> {
        self.laws.lagging(gyro)
    }

    /// How many own states a law brings.
    pub fn own_states_of(&self, law: &dyn Law) -> usize {
        self.laws.own_states_of(law)
    }

    /// Standard deviation of what a step of each of the laws' own states may be wrong by, over 1 ms.
    pub fn own_sigma(&self) -> &[f64] {
        self.laws.own_sigma()
    }

    /// How large each state that laws bring may be, in its unit.
    pub fn own_size(&self) -> &[f64] {
        self.laws.own_size()
    }

    /// Where the time by which inputs are late stands among the coordinates, if a law has one.
    pub fn input_delay(&self) -> Option<usize> {
        self.laws.input_delay()
    }

    /// The model at solver coordinates `z`.
    pub fn at(&self, z: &[f64]) -> Dynamics<'_> {
        Dynamics::new(self, z)
    }
}

/// Where the components of the state stand: (q, q̇) of the chain, (θ, θ̇) of elastic joints, errors of measured inputs, states of the laws' own.
///
/// ```text
/// | q: base | robot | structure | q̇ the same | θ of elastic joints | θ̇ | errors of inputs | own |
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Layout {
    /// Passive joints before the robot's first.
    first: usize,
    /// Joints of the chain, passive ones included.
    chain: usize,
    /// For each joint of the robot, its place among the elastic ones.
    elastic: Vec<Option<usize>>,
    elastic_count: usize,
    /// As many as joints where inputs are measurements, else none.
    inputs: usize,
    own: usize,
}

impl Layout {
    fn of(transmissions: &[Transmission], first: usize, chain: usize) -> Self {
        let mut elastic_count = 0;
        let elastic = transmissions
            .iter()
            .map(|&transmission| {
                (transmission == Transmission::Elastic).then(|| {
                    elastic_count += 1;
                    elastic_count - 1
                })
            })
            .collect();
        Layout { first, chain, elastic, elastic_count, inputs: 0, own: 0 }
    }

    /// Number of state components.
    pub fn size(&self) -> usize {
        2 * (self.chain + self.elastic_count) + self.inputs + self.own
    }

    /// Number of the robot's joints n.
    pub fn joints(&self) -> usize {
        self.elastic.len()
    }

    /// Joints of the chain, passive ones included: its q are the first components, its q̇ those behind them.
    pub fn chain(&self) -> usize {
        self.chain
    }

    /// Joints of the chain that are none of the robot's.
    pub fn passive(&self) -> impl Iterator<Item = usize> + use<> {
        let robot = self.first..self.first + self.elastic.len();
        (0..self.chain).filter(move |i| !robot.contains(i))
    }

    /// Whether joint i has a spring.
    pub fn is_elastic(&self, i: usize) -> bool {
        self.elastic[i].is_some()
    }

    /// q of joint i.
    pub fn q(&self, i: usize) -> usize {
        self.first + i
    }

    /// q̇ of joint i.
    pub fn qd(&self, i: usize) -> usize {
        self.chain + self.first + i
    }

    /// θ of joint i (q where it is rigid).
    pub fn theta(&self, i: usize) -> usize {
        self.elastic[i].map_or(self.q(i), |e| 2 * self.chain + e)
    }

    /// θ̇ of joint i (q̇ where it is rigid).
    pub fn thetad(&self, i: usize) -> usize {
        self.elastic[i].map_or(self.qd(i), |e| 2 * self.chain + self.elastic_count + e)
    }

    /// Errors of measured inputs, one a joint; none where inputs are commands.
    pub fn inputs(&self) -> std::ops::Range<usize> {
        let first = 2 * (self.chain + self.elastic_count);
        first..first + self.inputs
    }

    /// The error of the input of joint i.
    pub fn input(&self, i: usize) -> Option<usize> {
        self.inputs().nth(i)
    }

    /// The laws' own states.
    pub fn own(&self) -> std::ops::Range<usize> {
        self.size() - self.own..self.size()
    }

    /// For each component of the state, the component that is its time derivative, if one is.
    pub fn speed_of(&self) -> Vec<Option<usize>> {
        let mut speed = vec![None; self.size()];
        for i in 0..self.chain {
            speed[i] = Some(self.chain + i);
        }
        for i in 0..self.joints() {
            speed[self.theta(i)] = Some(self.thetad(i));
        }
        speed
    }
}
