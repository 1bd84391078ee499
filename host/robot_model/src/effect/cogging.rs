//! Cogging: the torque ripples with the motor's turn.
//!
//! ```text
//! τ_m + A_i sin(p n_G θ_i + φ_i)      p periods a turn of the motor, n_G the gear
//! ```

use rand::{Rng, RngExt};

use super::surrogate::{At, Hook, Law, Laws, Of, Parameters, Quantity, acts_on_joints, each};
use super::{Effect, EffectError, EffectParameter, Hidden, Moment, Physics, Row, Scale, Size, draw};
use crate::robot::Robot;

pub(super) const EFFECT: Effect = Effect {
    id: "cogging",
    row: Row::Motor,
    title: "torque ripple of the motors",
    equation: "τ_m + A sin(p n_G θ + φ)",
    parameters: &[
        EffectParameter::size("A[i]", "N m")
            .typically(0.012, 0.5, Scale::TorqueRms)
            .sizes("0.12, 0.5, 1.7 N m (0.1 to 2 met)"),
        EffectParameter::shape("p", "1").sizes("a whole number, 1 to 14"),
        EffectParameter::own_to_recording("phi[i]", "rad").sizes("anywhere"),
    ],
    nuisances: &[],
    confounded_with: &["position_friction", "encoder_eccentricity"],
    about: "Magnets lock to teeth, commutators switch: the torque ripples some times a turn of the motor. In slow motion \
            the ripple can be followed; at speed it is faster than the sampling and folds back to other frequencies.",
    make,
    laws,
};

/// Amplitude, shares of the torque at full voltage.
const AMPLITUDE: [f64; 3] = [0.0008, 0.0033, 0.0115];
/// Periods a turn of the motor.
const PERIODS: std::ops::RangeInclusive<u8> = 1..=14;

#[derive(Debug)]
struct Cogging {
    /// A, N m.
    amplitude: Vec<f64>,
    /// p n_G, periods a turn of the link.
    per_turn: Vec<f64>,
    /// φ, rad.
    phase: Vec<f64>,
}

impl Physics for Cogging {
    fn motor_torque(&self, at: &Moment<'_>, torque: f64) -> f64 {
        torque + self.amplitude[at.joint] * (self.per_turn[at.joint] * at.theta + self.phase[at.joint]).sin()
    }
}

fn make(robot: &Robot, size: Size, rng: &mut dyn Rng) -> Result<Hidden, EffectError> {
    let joints = draw::driven(EFFECT.id, robot)?;
    let amplitude = draw::per_joint(robot, &joints, size, AMPLITUDE, |j| draw::full_torque(robot, j), rng);
    let periods = f64::from(rng.random_range(PERIODS));
    let phase = draw::phases(robot, rng);
    let mut values: Vec<_> = draw::of_joints((EFFECT.id, robot), "A", "N m", &joints, &amplitude).collect();
    values.push(draw::single(EFFECT.id, "p", "1", periods));
    values.extend(draw::of_joints((EFFECT.id, robot), "phi", "rad", &joints, &phase));
    let per_turn = robot.joints.iter().map(|joint| periods * joint.gear).collect();
    Ok(Hidden { id: EFFECT.id, values, physics: Box::new(Cogging { amplitude, per_turn, phase }) })
}

/// Linear in A cos φ and A sin φ; p is chosen among whole numbers.
#[derive(Debug)]
struct CoggingLaw {
    parameters: Parameters,
    /// p n_G.
    per_turn: Vec<f64>,
}

impl Law for CoggingLaw {
    fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    fn hooks(&self) -> &'static [Hook] {
        &[Hook::MotorTorque]
    }

    acts_on_joints!();
}

impl CoggingLaw {
    #[inline(always)]
    fn act<T: Quantity>(&self, _hook: Hook, at: &At<'_, T>, torque: T) -> T {
        let [along, across] = *at.parameters else { return torque };
        let (sin, cos) = (at.theta * self.per_turn[at.joint]).sin_cos();
        torque + along * sin + across * cos
    }
}

fn laws(robot: &Robot) -> Laws {
    let joints = draw::all(robot);
    let with = |periods: u8| {
        let periods = f64::from(periods);
        let mut parameters = Parameters::on(EFFECT.id, robot);
        for &joint in &joints {
            parameters.wave(("A", "N m"), "phi", Of::Joint(joint), [0.0; 2]);
        }
        parameters.chosen("p", "1", periods);
        CoggingLaw { parameters, per_turn: robot.joints.iter().map(|joint| periods * joint.gear).collect() }
    };
    each(PERIODS.map(with))
}
