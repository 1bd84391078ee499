//! Motions for the tests of this room.

use super::*;
use crate::units::text;

pub(super) const LIMITS: [Limits; 3] = [Limits { min: -0.6, max: 0.6 }; 3];

pub(super) fn motion(action: Action) -> Motion {
    let mut motion = Motion::new(Header {
        name: text("trial"),
        stages: [text("rest"), text("slow")].into_iter().collect(),
        gain: [2.0; 3].into_iter().collect(),
    });
    motion.segments.push(Segment { stage: 1, action }).unwrap();
    motion
}

pub(super) fn move_to(joints: JointSet, targets: &[f32]) -> Action {
    Action::MoveTo {
        joints,
        targets: targets.iter().copied().collect(),
        ceiling: Duty(1500),
        tolerance: 0.01,
        timeout_ms: 4000,
    }
}

pub(super) fn chirp(from_hz: f32, to_hz: f32, spread: f32) -> Action {
    Action::Chirp {
        joints: JointSet::first(3),
        amplitude: Duty(9000),
        from_hz,
        to_hz,
        spread,
        centring: 0.5,
        duration_ms: 3000,
    }
}

pub(super) fn sine(amplitude: f32) -> Action {
    Action::Sine {
        joints: JointSet::only(1),
        amplitude,
        frequency_hz: 0.3,
        spread: 0.0,
        ceiling: Duty(2000),
        duration_ms: 6000,
    }
}
