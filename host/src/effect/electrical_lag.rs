//! Electrical lag: current, and with it torque, rises through the winding's inductance.
//!
//! ```text
//! L di/dt = U u − R i − k_e θ̇,   τ_m = k_t i      hence   T τ̇_m = (k_pwm U u − k_mi θ̇) − τ_m,   T = L/R
//! ```

use rand::Rng;

use super::{Effect, EffectError, EffectParameter, Hidden, Line, Moment, Physics, Size, draw};
use crate::robot::Robot;

pub(super) const EFFECT: Effect = Effect {
    id: "electrical_lag",
    title: "lag of the winding's current",
    equation: "T τ̇_m = (k_pwm U u − k_mi θ̇) − τ_m",
    parameters: &[EffectParameter { name: "T", unit: "s", sizes: "0.6, 1.8, 4.3 ms (0.5 to 5 met)" }],
    confounded_with: &["input_delay", "belt_hysteresis"],
    about: "A winding is a coil: the current follows the voltage with the time constant L/R. Unlike a dead time it lags \
            the back-EMF as well, and it rounds the edges of a step.",
    make,
};

const TIME_CONSTANT_S: [f64; 3] = [0.6e-3, 1.8e-3, 4.3e-3];

/// One state a joint: its motor's torque.
#[derive(Debug)]
struct ElectricalLag {
    time_constant_s: f64,
    joints: usize,
}

impl Physics for ElectricalLag {
    fn states(&self) -> usize {
        self.joints
    }

    fn state_rates(&self, own: &[f64], line: &Line<'_>, out: &mut [f64]) {
        for joint in 0..self.joints {
            out[joint] = (line.motor_torque[joint] - own[joint]) / self.time_constant_s;
        }
    }

    fn motor_torque(&self, at: &Moment<'_>, _torque: f64) -> f64 {
        at.own[at.joint]
    }
}

fn make(robot: &Robot, size: Size, rng: &mut dyn Rng) -> Result<Hidden, EffectError> {
    let time_constant_s = draw::lag(EFFECT.id, size, TIME_CONSTANT_S, rng)?;
    let values = vec![draw::single(EFFECT.id, "T", "s", time_constant_s)];
    let physics = ElectricalLag { time_constant_s, joints: robot.joints.len() };
    Ok(Hidden { id: EFFECT.id, values, physics: Box::new(physics) })
}
