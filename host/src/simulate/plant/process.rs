//! Process noise: what a robot does that no equation says, as white torque noise on motors and links.
//!
//! White torque is a random walk of the speeds. Over a time t the speed of every link gains, whatever the step of the
//! integration, an independent Gaussian number of standard deviation
//!
//! ```text
//!   σ_q̇ √(t / 1 ms)      and that of every motor      σ_θ̇ √(t / 1 ms)
//! ```
//!
//! which is the noise of the state equation (31) with (36). A motor's σ_θ̇ stands for a torque density of b σ_θ̇ / √(1 ms),
//! held for a millisecond each: b σ_θ̇ / 1 ms, 0.2 N m on Doggy at [`ProcessNoise::UNIT`].

use super::super::noise::{Noise, Purpose};
use super::equations::Layout;

/// How the speeds wander.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProcessNoise {
    /// σ_q̇: what a link's speed gains in a millisecond, rad/s or m/s.
    pub link_speed: f64,
    /// σ_θ̇: the same of a motor, on the link side of its gear.
    pub motor_speed: f64,
}

impl ProcessNoise {
    /// A hundredth of the standard deviations of (36), as tight as the preset `default` takes its fixed noise.
    pub const UNIT: Self = Self { link_speed: 1.1e-4, motor_speed: 8.3e-5 };

    /// [`Self::UNIT`] times a factor.
    pub fn scaled(scale: f64) -> Self {
        Self { link_speed: scale * Self::UNIT.link_speed, motor_speed: scale * Self::UNIT.motor_speed }
    }
}

/// The time that the standard deviations are told for, s.
const PER_S: f64 = 1e-3;

/// Process noise as it is drawn.
#[derive(Debug)]
pub(super) struct Shaking {
    sigma: ProcessNoise,
    noise: Noise,
}

impl Shaking {
    pub fn new(sigma: ProcessNoise, seed: u64) -> Self {
        Self { sigma, noise: Noise::of(seed, Purpose::Process) }
    }

    pub fn begin_motion(&mut self) {
        self.noise.begin_motion();
    }

    /// What `step_s` does to the speeds in the state x. Drawn for every joint, elastic or not.
    pub fn shake(&mut self, layout: &Layout, x: &mut [f64], step_s: f64) {
        let spread = (step_s / PER_S).sqrt();
        for joint in 0..layout.joints {
            let link = self.noise.draw(spread * self.sigma.link_speed);
            let motor = self.noise.draw(spread * self.sigma.motor_speed);
            let (link_speed, motor_speed) = layout.speeds(joint);
            x[link_speed] += link;
            if let Some(motor_speed) = motor_speed {
                x[motor_speed] += motor;
            }
        }
    }
}
