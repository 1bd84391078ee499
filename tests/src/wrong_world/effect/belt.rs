//! Effects of elastic transmissions.

use rand::RngExt;

use super::{Hiding, Size, Truth, of_joint};
use crate::wrong_world::memory::SlipStack;

/// See [`Hiding::hide`].
pub(super) fn hide(to: &mut Hiding<'_>, id: &str, size: Size) -> Option<Vec<Truth>> {
    Some(match id {
        "backlash" => backlash(to, size),
        "belt_hardening" => hardening(to, size),
        "belt_slack_side" => slack_side(to, size),
        "belt_hysteresis" => hysteresis(to, size),
        _ => return None,
    })
}

/// Contact takes on its damping over a seventh of the half gap, and grease damps inside.
fn backlash(to: &mut Hiding<'_>, size: Size) -> Vec<Truth> {
    let gaps = to.gaps;
    of_belts(to, |to, joint| {
        let half_gap = to.draw(size, gaps);
        if let Some(belt) = &mut to.machine.joints[joint].belt {
            belt.half_gap = half_gap;
        }
        vec![of_joint("backlash", "h", joint, half_gap)]
    })
}

/// The cubic part is lost at large windup.
fn hardening(to: &mut Hiding<'_>, size: Size) -> Vec<Truth> {
    of_belts(to, |to, joint| {
        let (share, windup) = (to.draw(size, [0.1, 0.3, 0.9]), 0.5 * to.usage[joint].windup);
        let Some(belt) = &mut to.machine.joints[joint].belt else { return Vec::new() };
        (belt.hardening, belt.saturation) = (share * belt.stiffness / windup.powi(2), 5.0 * windup);
        vec![of_joint("belt_hardening", "k3", joint, belt.hardening)]
    })
}

fn slack_side(to: &mut Hiding<'_>, size: Size) -> Vec<Truth> {
    of_belts(to, |to, joint| {
        let share = to.draw_signed(size, [0.05, 0.12, 0.28]);
        if let Some(belt) = &mut to.machine.joints[joint].belt {
            belt.slack = share;
        }
        vec![of_joint("belt_slack_side", "r", joint, share)]
    })
}

/// Elements that slip: the first stiffness is the catalogue's k₁ in name only, and there is no relaxation time.
fn hysteresis(to: &mut Hiding<'_>, size: Size) -> Vec<Truth> {
    of_belts(to, |to, joint| {
        let (share, windup) = (to.draw(size, [0.12, 0.24, 0.45]), to.usage[joint].windup);
        let mut yields = [(); 4].map(|()| windup * to.rng.random_range(0.03_f64.ln()..0.5_f64.ln()).exp());
        yields.sort_by(f64::total_cmp);
        let Some(belt) = &mut to.machine.joints[joint].belt else { return Vec::new() };
        belt.slip = SlipStack { stiffness: share * belt.stiffness, yields };
        vec![of_joint("belt_hysteresis", "k1", joint, belt.slip.stiffness).not_comparable()]
    })
}

fn of_belts(to: &mut Hiding<'_>, mut set: impl FnMut(&mut Hiding<'_>, usize) -> Vec<Truth>) -> Vec<Truth> {
    let mut truths = Vec::new();
    for joint in to.some_of(to.elastic()) {
        truths.extend(set(to, joint));
    }
    truths
}
