//! Electrical lag: current, and with it torque, rises through the winding's inductance.
//!
//! ```text
//! L di/dt = U u − R i − k_e θ̇,   τ_m = k_t i      hence   T τ̇_m = (k_pwm U u − k_mi θ̇) − τ_m,   T = L/R
//! ```

use rand::Rng;

use super::surrogate::{At, FASTEST_STEPS, Hook, Law, Laws, Of, Parameters, Quantity, acts_on_joints, each};
use super::{Effect, EffectError, EffectParameter, Hidden, Line, Moment, Physics, Row, Scale, Size, draw};
use crate::robot::Robot;

pub(super) const EFFECT: Effect = Effect {
    id: "electrical_lag",
    row: Row::Motor,
    title: "lag of the winding's current",
    equation: "T τ̇_m = (k_pwm U u − k_mi θ̇) − τ_m",
    parameters: &[EffectParameter::size("T", "s")
        .typically(1.6e-3, 0.45, Scale::Si)
        .sizes("0.6, 1.8, 4.3 ms (0.5 to 5 met)")],
    nuisances: &[],
    confounded_with: &["input_delay", "belt_hysteresis"],
    about: "A winding is a coil: the current follows the voltage with the time constant L/R. Unlike a dead time it lags \
            the back-EMF as well, and it rounds the edges of a step.",
    make,
    laws,
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

/// A step of the torque may be wrong by this share of the torque at full voltage.
const SIGMA: f64 = 2e-5;

/// The same equation; T by its logarithm. Below a third of a sample period a step cannot follow it.
#[derive(Debug)]
struct LagLaw {
    parameters: Parameters,
    /// N m.
    sigma: Vec<f64>,
}

impl Law for LagLaw {
    fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    fn hooks(&self) -> &'static [Hook] {
        &[Hook::MotorTorque, Hook::StateRate]
    }

    fn has_state(&self, _joint: usize) -> bool {
        true
    }

    fn state_sigma(&self, joint: usize) -> f64 {
        self.sigma[joint]
    }

    acts_on_joints!();
}

impl LagLaw {
    #[inline(always)]
    fn act<T: Quantity>(&self, hook: Hook, at: &At<'_, T>, quantity: T) -> T {
        let [time_constant] = *at.parameters else { return quantity };
        match hook {
            Hook::MotorTorque => at.own,
            _ => (at.driving - at.k_mi * at.thetad - at.own) * (-time_constant).exp(),
        }
    }
}

fn laws(robot: &Robot) -> Laws {
    let with = |start_s: f64| {
        let mut parameters = Parameters::on(EFFECT.id, robot);
        parameters.positive("T", "s", Of::All, start_s);
        parameters.within("T", [FASTEST_STEPS * robot.sample_period_s, 0.02]);
        let sigma = |joint| SIGMA * draw::torque_scale(robot, joint).max(1.0);
        LagLaw { parameters, sigma: (0..robot.joints.len()).map(sigma).collect() }
    };
    each([1.8, 0.8, 4.0].map(|periods| with(periods * robot.sample_period_s)))
}
