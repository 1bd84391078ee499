//! Cable spring: a cable harness or a costume pulls the link back.
//!
//! ```text
//! M q̈ = −τ_c − k_c q             drawn to the middle pose
//! M q̈ = −τ_c − k_c q − preload   at rest elsewhere, at q = −preload / k_c
//! ```

use rand::Rng;

use super::surrogate::{At, Hook, Law, Laws, Of, Parameters, Quantity, acts_on_joints, each};
use super::{Effect, EffectError, EffectParameter, Hidden, Moment, Physics, Row, Scale, Size, draw};
use crate::robot::Robot;

pub(super) const EFFECT: Effect = Effect {
    id: "cable_spring",
    row: Row::Link,
    title: "spring of cables or costume",
    equation: "k_c q + preload on the link's row",
    parameters: &[EffectParameter::size("k_c[i]", "N m/rad")
        .typically(0.04, 0.5, Scale::TorqueRmsPerRadian)
        .sizes("0.6, 1.6, 4.4 where k_s is 400 (0.5 to 5 met)")],
    nuisances: &[
        EffectParameter::nuisance("preload[i]", "N m").sizes("its torque at q = 0, where it is not at rest there")
    ],
    confounded_with: &["gravity_residual"],
    about: "Cables that cross a joint are bent by it and push back, a costume is stretched. The robot is drawn to its \
            middle pose, or to where cable and costume are at rest, on joints that feel no gravity as well.",
    make,
    laws,
};

/// Shares of k_s; where the joint is rigid, of what stands for it.
const SHARE: [f64; 3] = [0.0015, 0.004, 0.011];

#[derive(Debug)]
struct CableSpring {
    /// k_c, N m/rad.
    k_c: Vec<f64>,
}

impl Physics for CableSpring {
    fn link_load(&self, at: &Moment<'_>, load: f64) -> f64 {
        load + self.k_c[at.joint] * at.q
    }
}

fn make(robot: &Robot, size: Size, rng: &mut dyn Rng) -> Result<Hidden, EffectError> {
    let joints = draw::all(robot);
    let k_c = draw::per_joint(robot, &joints, size, SHARE, |j| draw::stiffness_scale(robot, j), rng);
    let values = draw::of_joints((EFFECT.id, robot), "k_c", "N m/rad", &joints, &k_c).collect();
    Ok(Hidden { id: EFFECT.id, values, physics: Box::new(CableSpring { k_c }) })
}

/// Linear in k_c and the preload, which not all laws and joints have.
#[derive(Debug)]
struct CableLaw {
    parameters: Parameters,
}

impl Law for CableLaw {
    fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    fn hooks(&self) -> &'static [Hook] {
        &[Hook::LinkLoad]
    }

    acts_on_joints!();
}

impl CableLaw {
    #[inline(always)]
    fn act<T: Quantity>(&self, _hook: Hook, at: &At<'_, T>, load: T) -> T {
        match *at.parameters {
            [k_c] => load + k_c * at.q,
            [k_c, preload] => load + k_c * at.q + preload,
            _ => load,
        }
    }
}

fn laws(robot: &Robot) -> Laws {
    let law = |preloaded: &[usize]| {
        let mut parameters = Parameters::on(EFFECT.id, robot);
        for joint in draw::all(robot) {
            parameters.plain("k_c", "N m/rad", Of::Joint(joint), 0.0);
        }
        for &joint in preloaded {
            parameters.plain("preload", "N m", Of::Joint(joint), 0.0);
        }
        CableLaw { parameters }
    };
    // A constant torque of the link that the description has is the preload already.
    let mut preloaded = draw::all(robot);
    preloaded.retain(|joint| !draw::has_offset_at_link(robot, *joint));
    let elsewhere = (!preloaded.is_empty()).then(|| law(&preloaded));
    each([law(&[])].into_iter().chain(elsewhere))
}

#[cfg(test)]
mod tests {
    use super::super::surrogate::still;
    use super::*;

    #[test]
    fn a_spring_at_rest_elsewhere_pulls_by_its_way_from_there() {
        let robot = Robot::builtin("doggy").unwrap();
        let laws = laws(&robot).unwrap();
        let at = |parameters| At { q: 0.3, ..still(parameters) };
        // 2 N m/rad, at rest at 0.5 rad: 2 (0.3 − 0.5) N m beside the 1 N m of others. atol 1e-15 N m.
        let load = laws[1].plain(Hook::LinkLoad, &at(&[2.0, -1.0]), 1.0);
        assert!((load - 0.6).abs() < 1e-15, "{load}");
        let load = laws[0].plain(Hook::LinkLoad, &at(&[2.0]), 1.0);
        assert!((load - 1.6).abs() < 1e-15, "{load}");
    }

    #[test]
    fn a_joint_whose_offset_is_described_has_no_preload_beside_it() {
        let robot = Robot::builtin("xl330_pendulum").unwrap();
        assert_eq!(laws(&robot).unwrap().len(), 1);
        // An offset of the motor winds the transmission, which a preload of the link does not without it.
        let elastic = include_str!("../robot/builtin/one_joint.toml");
        let motors = elastic.replace("[joint.parameters]", "[joint.parameters]\no = { start = 0.0 }");
        let links = motors.replace("speed = \"motor\"", "acts = \"link\"");
        let forms = |text: &str| laws(&Robot::parse(text).unwrap()).unwrap().len();
        assert_eq!([elastic, &motors, &links].map(forms), [2, 2, 1]);
    }
}
