//! Backlash: free play between motor and link.
//!
//! ```text
//! δ = q − θ ∓ h outside ±h, no torque inside;   τ_c = k_s δ + w(|δ|) d_s (q̇ − θ̇)
//! ```
//!
//! The teeth do not meet all at once: the damping's share w rises from 0 to 1 over the first milliradian of contact,
//! so that an impact makes no jump of torque.

use rand::Rng;

use super::{Belt, Effect, EffectError, EffectParameter, Hidden, Physics, Size, TrueValue};
use crate::robot::{JointKind, Robot, Transmission};

pub(super) const EFFECT: Effect = Effect {
    id: "backlash",
    title: "free play in the transmission",
    equation: "τ_c = 0 inside ±h, k_s (q − θ ∓ h) + d_s (q̇ − θ̇) outside",
    parameters: &[EffectParameter { name: "h[i]", unit: "rad", sizes: "half gap 2, 8, 20 mrad (1 to 30 met)" }],
    confounded_with: "belt_hardening",
    about: "Worn teeth or a slack belt leave a gap in which motor and link do not feel each other. At every reversal \
            the motor crosses it alone, then meets the link with a blow.",
    make,
};

/// Half gap, rad.
const HALF_GAP_RAD: [f64; 3] = [0.002, 0.008, 0.020];
/// Depth of contact over which the damping takes hold, rad.
const CONTACT_RAD: f64 = 1e-3;

#[derive(Debug)]
struct Backlash {
    /// Half gap of every joint, rad; zero where the transmission is rigid.
    half_gap: Vec<f64>,
}

impl Physics for Backlash {
    fn transmission_torque(&self, joint: usize, belt: &Belt, torque: f64) -> f64 {
        let half_gap = self.half_gap[joint];
        if half_gap == 0.0 {
            return torque;
        }
        let depth = belt.wind.abs() - half_gap;
        if depth <= 0.0 {
            return 0.0;
        }
        let grip = (depth / CONTACT_RAD).min(1.0);
        belt.k_s * depth * belt.wind.signum() + grip * belt.d_s * belt.wind_rate
    }
}

fn make(robot: &Robot, size: Size, rng: &mut dyn Rng) -> Result<Hidden, EffectError> {
    let mut half_gap = vec![0.0; robot.joints.len()];
    for (half_gap, joint) in half_gap.iter_mut().zip(&robot.joints) {
        if joint.transmission == Transmission::Elastic && joint.kind == JointKind::Revolute {
            *half_gap = size.draw(HALF_GAP_RAD, rng);
        }
    }
    if half_gap.iter().all(|h| *h == 0.0) {
        let reason = "no joint turns through an elastic transmission";
        return Err(EffectError::Unsuited { effect: EFFECT.id, reason });
    }
    Ok(gaps(half_gap))
}

/// Free play of these half gaps, rad, one a joint; zero is none.
pub(crate) fn gaps(half_gap: Vec<f64>) -> Hidden {
    let name = |joint: usize| format!("{}.h[{}]", EFFECT.id, joint + 1);
    let values = half_gap
        .iter()
        .enumerate()
        .filter(|(_, h)| **h > 0.0)
        .map(|(joint, h)| TrueValue { name: name(joint), unit: "rad", value: *h })
        .collect();
    Hidden { id: EFFECT.id, values, physics: Box::new(Backlash { half_gap }) }
}
