//! The elastic-joint model: equations (6)–(12) over a serial chain, its integrators and its sensors.
//!
//! ```text
//! u ─▶ drive (motor torque, friction, transmission) ─▶ link torques ─▶ accelerations ─▶ one step ─▶ sensors
//!      drive.rs                                        dynamics.rs                       integrator.rs  sensor.rs
//! ```
//!
//! The state is x = (q, q̇, θ, θ̇), equation (8): q and q̇ of all n joints, θ and θ̇ of the elastic ones (a rigid joint has θ = q).
//! Everything is on the link side of the gear, in SI. A [`Model`] knows a robot; [`Dynamics`] is a model at given
//! parameters. Derivatives are exact: laws are written once over any scalar and run on dual numbers.

mod drive;
mod dynamics;
pub mod fast;
mod integrator;
mod parameters;
pub mod rotation;
mod sensor;
#[cfg(test)]
mod tests;

pub use dynamics::{Dynamics, Linear};
pub use integrator::{Integrator, StepSlopes, Stepper};
pub use parameters::{Coordinate, Coordinates};
pub use sensor::{GyroSlopes, SensorFrame};

use crate::robot::chain::Chain;
use crate::robot::{Robot, Transmission};
use drive::Drive;

/// The equations of one robot.
#[derive(Debug, Clone)]
pub struct Model {
    chain: Chain,
    coordinates: Coordinates,
    transmissions: Vec<Transmission>,
    drives: Vec<Drive>,
    layout: Layout,
}

impl Model {
    /// The base model of `robot`.
    pub fn new(robot: &Robot) -> Self {
        let coordinates = Coordinates::of(robot);
        let transmissions: Vec<_> = robot.joints.iter().map(|joint| joint.transmission).collect();
        Model {
            chain: robot.chain(),
            drives: (0..robot.joints.len()).map(|joint| Drive::of(robot, &coordinates, joint)).collect(),
            layout: Layout::of(&transmissions),
            coordinates,
            transmissions,
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

    /// The kinematic chain.
    pub fn chain(&self) -> &Chain {
        &self.chain
    }

    /// The model at solver coordinates `z`.
    pub fn at(&self, z: &[f64]) -> Dynamics<'_> {
        Dynamics::new(self, z)
    }
}

/// Where the components of the state stand: (q, q̇, θ, θ̇).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Layout {
    joints: usize,
    /// For each joint, its place among the elastic ones.
    elastic: Vec<Option<usize>>,
    elastic_count: usize,
}

impl Layout {
    fn of(transmissions: &[Transmission]) -> Self {
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
        Layout { joints: transmissions.len(), elastic, elastic_count }
    }

    /// Number of state components.
    pub fn size(&self) -> usize {
        2 * (self.joints + self.elastic_count)
    }

    /// Number of joints n.
    pub fn joints(&self) -> usize {
        self.joints
    }

    /// Whether joint i has a spring.
    pub fn is_elastic(&self, i: usize) -> bool {
        self.elastic[i].is_some()
    }

    /// q of joint i.
    pub fn q(&self, i: usize) -> usize {
        i
    }

    /// q̇ of joint i.
    pub fn qd(&self, i: usize) -> usize {
        self.joints + i
    }

    /// θ of joint i (q where it is rigid).
    pub fn theta(&self, i: usize) -> usize {
        self.elastic[i].map_or(i, |e| 2 * self.joints + e)
    }

    /// θ̇ of joint i (q̇ where it is rigid).
    pub fn thetad(&self, i: usize) -> usize {
        self.elastic[i].map_or(self.joints + i, |e| 2 * self.joints + self.elastic_count + e)
    }

    /// For each component of the state, the component that is its time derivative, if one is.
    pub(crate) fn speed_of(&self) -> Vec<Option<usize>> {
        let mut speed = vec![None; self.size()];
        for i in 0..self.joints {
            speed[self.q(i)] = Some(self.qd(i));
            speed[self.theta(i)] = Some(self.thetad(i));
        }
        speed
    }
}
