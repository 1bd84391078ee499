//! Backlash: free play between motor and link.
//!
//! ```text
//! δ = q − θ ∓ h outside ±h, no torque inside;   τ_c = k_s δ + w(|δ|) d_s (q̇ − θ̇)
//! ```
//!
//! The teeth do not meet all at once: the damping's share w rises from 0 to 1 over the first milliradian of contact,
//! so that an impact makes no jump of torque, or over h/2 where that is less, so that nothing is left of it at h = 0.

use rand::Rng;

use super::surrogate::{At, Hook, Law, Laws, Of, Parameters, Quantity, acts_on_joints, only};
use super::{Effect, EffectError, EffectParameter, Hidden, Moment, Physics, Row, Scale, Size, draw};
use crate::robot::Robot;

pub(super) const EFFECT: Effect = Effect {
    id: "backlash",
    row: Row::Link,
    title: "free play in the transmission",
    equation: "τ_c = 0 inside ±h, k_s (q − θ ∓ h) + d_s (q̇ − θ̇) outside",
    parameters: &[EffectParameter::size("h[i]", "rad")
        .typically(6e-3, 0.5, Scale::Radian)
        .sizes("half gap 2, 8, 20 mrad (1 to 30 met)")],
    nuisances: &[],
    confounded_with: &["belt_hardening", "belt_hysteresis", "k_s"],
    about: "Worn teeth or a slack belt leave a gap in which motor and link do not feel each other. At every reversal \
            the motor crosses it alone, then meets the link with a blow.",
    make,
    laws,
};

/// Half gap, rad.
const HALF_GAP_RAD: [f64; 3] = [0.002, 0.008, 0.020];
/// Depth of contact over which the damping takes hold, rad, if h/2 is not less.
const CONTACT_RAD: f64 = 1e-3;

#[derive(Debug)]
struct Backlash {
    /// Half gap of every joint, rad; zero where the transmission is rigid.
    half_gap: Vec<f64>,
}

impl Physics for Backlash {
    fn transmission_torque(&self, at: &Moment<'_>, torque: f64) -> f64 {
        let half_gap = self.half_gap[at.joint];
        if half_gap == 0.0 {
            return torque;
        }
        // The base law goes, its law takes its place: what other effects add stays.
        let others = torque - at.k_s * at.wind() - at.d_s * at.wind_rate();
        let depth = at.wind().abs() - half_gap;
        if depth <= 0.0 {
            return others;
        }
        let grip = (depth / CONTACT_RAD.min(half_gap / 2.0)).min(1.0);
        others + at.k_s * depth * at.wind().signum() + grip * at.d_s * at.wind_rate()
    }
}

fn make(robot: &Robot, size: Size, rng: &mut dyn Rng) -> Result<Hidden, EffectError> {
    let joints = draw::some(EFFECT.id, draw::elastic(robot), draw::NO_BELT)?;
    let half_gap = draw::per_joint(robot, &joints, size, HALF_GAP_RAD, |_| 1.0, rng);
    Ok(gaps(robot, half_gap))
}

/// Free play of these half gaps, rad, one a joint; zero is none.
pub fn gaps(robot: &Robot, half_gap: Vec<f64>) -> Hidden {
    let joints: Vec<usize> = (0..half_gap.len()).filter(|joint| half_gap[*joint] > 0.0).collect();
    let values = draw::of_joints((EFFECT.id, robot), "h", "rad", &joints, &half_gap).collect();
    Hidden { id: EFFECT.id, values, physics: Box::new(Backlash { half_gap }) }
}

/// Over what the corners of the law are rounded, rad.
const CORNER_RAD: f64 = 3e-4;
/// Where the search for a half gap starts, rad.
const START_RAD: f64 = 2e-3;

/// The gap's corners are rounded, so that a least-squares fit finds its way; at h = 0 nothing is left of them.
#[derive(Debug)]
struct BacklashLaw {
    parameters: Parameters,
}

impl Law for BacklashLaw {
    fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    fn hooks(&self) -> &'static [Hook] {
        &[Hook::Transmission]
    }

    acts_on_joints!();
}

impl BacklashLaw {
    #[inline(always)]
    fn act<T: Quantity>(&self, _hook: Hook, at: &At<'_, T>, torque: T) -> T {
        let [half_gap] = *at.parameters else { return torque };
        let wind = at.wind();
        // δ and dδ/dt of the belt behind the gap
        let beyond = [wind - half_gap, -wind - half_gap];
        let depth = beyond[0].ramp(CORNER_RAD) - beyond[1].ramp(CORNER_RAD);
        let grip = beyond[0].step(CORNER_RAD) + beyond[1].step(CORNER_RAD);
        torque + at.k_s * (depth - wind) + at.d_s * (grip - T::from(1.0)) * at.wind_rate()
    }
}

fn laws(robot: &Robot) -> Laws {
    let joints = draw::some(EFFECT.id, draw::elastic(robot), draw::NO_BELT)?;
    let mut parameters = Parameters::on(EFFECT.id, robot);
    for joint in joints {
        parameters.plain("h", "rad", Of::Joint(joint), START_RAD);
    }
    parameters.within("h", [0.0, 0.1]);
    only(BacklashLaw { parameters })
}
