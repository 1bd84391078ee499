//! How steeply Coulomb friction changes its sign.
//!
//! ```text
//! μ tanh(κ v / 2)        κ other than slope_s_rad (slope_s_m) of the robot file
//! ```
//!
//! Equation (12) rounds the sign of the speed, and its slope κ is a number of the robot file that no calibration estimates. Where it is wrong, the motion
//! errs whenever a joint turns round, and a delay of a sensor or of the input looks alike.

use rand::Rng;

use super::surrogate::{At, Hook, Law, Laws, Of, Parameters, Quantity, acts_on_joints, only};
use super::{Effect, EffectError, EffectParameter, Hidden, Moment, Physics, Row, Scale, Size, draw};
use crate::robot::{Friction, Robot};

pub(super) const EFFECT: Effect = Effect {
    id: "friction_slope",
    row: Row::Motor,
    title: "another slope of the friction at zero speed than the robot file's",
    equation: "μ tanh(κ θ̇ / 2)",
    parameters: &[EffectParameter::inverse_size("slope[i]", "s/rad")
        .typically(20.0, 0.6, Scale::Si)
        .in_place_of("slope_s_rad (slope_s_m)")
        .sizes("0.12, 0.04, 0.015 of the robot file's slope (a hundredth to seven times it tried)")],
    nuisances: &[],
    confounded_with: &["stribeck", "encoder_lag", "input_delay"],
    about: "Coulomb friction is calculated with a rounded sign of the speed. How steep it is, is slope_s_rad (slope_s_m) in \
            the robot file and is not calibrated: write the one that is found there.",
    make,
    laws,
};

/// κ of the plant, shares of the description's. On Doggy a medium one moves a reading by three of its sigmas or more.
const SHARE: [f64; 3] = [0.12, 0.04, 0.015];

/// κ as described, s/rad or s/m; 0 where nothing rubs.
fn described(robot: &Robot, joint: usize) -> f64 {
    match robot.joints[joint].friction {
        Friction::None => 0.0,
        Friction::Coulomb { slope_s, .. } => slope_s,
    }
}

#[derive(Debug)]
struct FrictionSlope {
    /// κ of every joint.
    slope: Vec<f64>,
}

impl Physics for FrictionSlope {
    fn friction_torque(&self, at: &Moment<'_>, torque: f64) -> f64 {
        torque + at.mu * ((0.5 * self.slope[at.joint] * at.friction_speed).tanh() - at.friction_sign)
    }
}

fn make(robot: &Robot, size: Size, rng: &mut dyn Rng) -> Result<Hidden, EffectError> {
    let joints = draw::some(EFFECT.id, draw::rubbing(robot), draw::NO_FRICTION)?;
    let slope = draw::per_joint(robot, &joints, size, SHARE, |joint| described(robot, joint), rng);
    let values = draw::of_joints((EFFECT.id, robot), "slope", "s/rad", &joints, &slope).collect();
    Ok(Hidden { id: EFFECT.id, values, physics: Box::new(FrictionSlope { slope }) })
}

/// Shares of the described slope.
const RANGE: [f64; 2] = [0.01, 7.0];

/// By the logarithm of κ, from the described one.
#[derive(Debug)]
struct SlopeLaw {
    parameters: Parameters,
    /// The joint of each parameter.
    joints: Vec<usize>,
}

impl Law for SlopeLaw {
    fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    fn hooks(&self) -> &'static [Hook] {
        &[Hook::Friction]
    }

    fn friction_slope(&self, joint: usize) -> Option<usize> {
        self.joints.iter().position(|own| *own == joint)
    }

    acts_on_joints!();
}

impl SlopeLaw {
    #[inline(always)]
    fn act<T: Quantity>(&self, _hook: Hook, at: &At<'_, T>, torque: T) -> T {
        let [ln_slope] = *at.parameters else { return torque };
        let sign = (at.friction_speed * ln_slope.exp() * 0.5).tanh();
        torque + at.mu * (sign - at.friction_sign)
    }
}

fn laws(robot: &Robot) -> Laws {
    let joints = draw::some(EFFECT.id, draw::rubbing(robot), draw::NO_FRICTION)?;
    let mut parameters = Parameters::on(EFFECT.id, robot);
    for &joint in &joints {
        let slope = described(robot, joint);
        parameters.positive("slope", "s/rad", Of::Joint(joint), slope);
        parameters.within(&format!("slope[{}]", joint + 1), RANGE.map(|share| share * slope));
    }
    only(SlopeLaw { parameters, joints })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::surrogate::still;

    #[test]
    fn the_number_of_the_robot_file_stands_beside_it() {
        let described = |robot: &str, joint: usize| {
            let robot = Robot::builtin(robot).unwrap();
            EFFECT.in_robot_file(&robot, &format!("friction_slope.slope[{joint}]"))
        };
        let (key, slope) = described("one_joint", 1).unwrap();
        // rtol 1e-12: it comes back from its logarithm.
        assert!(key.starts_with("slope_s_rad") && (slope / 400.0 - 1.0).abs() < 1e-12, "{key}: {slope}");
        assert_eq!(described("one_joint", 2), None);
        assert_eq!(
            super::super::encoder_lag::EFFECT.in_robot_file(&Robot::builtin("doggy").unwrap(), "encoder_lag.T[1]"),
            None
        );
    }

    #[test]
    fn the_law_is_the_plants_and_changes_nothing_at_the_described_slope() {
        let robot = Robot::builtin("doggy").unwrap();
        let law = laws(&robot).unwrap().swap_remove(0);
        assert_eq!(law.parameters().coordinates.len(), 3);
        for slope in [50.0_f64, 400.0, 1600.0] {
            let plant = FrictionSlope { slope: vec![slope; 3] };
            for speed in [-0.5, -2e-3, 0.0, 1e-3, 0.02] {
                let friction_sign = (200.0 * speed).tanh();
                let parameters = [slope.ln()];
                let at = At { joint: 1, mu: 2.5, friction_speed: speed, friction_sign, ..still(&parameters) };
                let found = law.plain(Hook::Friction, &at, at.coulomb());
                let moment = Moment { joint: 1, mu: 2.5, friction_speed: speed, friction_sign, ..Moment::default() };
                let hidden = plant.friction_torque(&moment, moment.coulomb());
                let expected = 2.5 * (0.5 * slope * speed).tanh();
                assert!((found - expected).abs() < 1e-12 && (hidden - expected).abs() < 1e-12, "{slope} {speed}");
            }
        }
    }
}
