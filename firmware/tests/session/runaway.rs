//! Sensors and wires that lie: no joint runs away, at any time of the calibration.
//!
//! Where the joints really are is the plant's to say; the core sees what the broken sensor tells.

use firmware::Inputs;
use firmware::motion::preset;
use protocol::{Duty, EventKind, Fault, MAX_JOINTS, MotionEnd};

use crate::bench::{Bench, Wires};
use crate::motions::limits;
use crate::plant::Plant;

/// How far a joint really was beyond its limit when the motors were let go, and when it came to rest, rad.
#[derive(Debug)]
struct Beyond {
    fault: Fault,
    at_stop: f64,
    at_rest: f64,
}

const MISMATCH: [Fault; 2] = [Fault::RotationMismatch { gyro: 0 }, Fault::RotationMismatch { gyro: 1 }];

/// The calibration; after `from_ms` of it `lie` falsifies what the core reads.
fn calibration_with(from_ms: u32, wires: Wires, lie: impl FnMut(&mut Inputs) + 'static) -> Beyond {
    calibration_of(Plant::doggy(3, 1), from_ms, wires, lie)
}

fn calibration_of(plant: Plant, from_ms: u32, wires: Wires, mut lie: impl FnMut(&mut Inputs) + 'static) -> Beyond {
    let joints = plant.joints.len();
    let mut bench = Bench::new(plant);
    bench.wires = wires;
    bench.prepare(&preset::calibration(&limits(joints)));
    bench.start().unwrap();
    bench.run(from_ms);
    bench.disturb.inputs = Some(Box::new(move |inputs| lie(inputs)));
    let event = bench.until(100_000, |kind| matches!(kind, EventKind::MotionEnded { .. }));
    let EventKind::MotionEnded { end: MotionEnd::Fault(fault), .. } = event.kind else {
        panic!("from {from_ms} ms on: {event:?}, joints at {:?}", positions(&bench));
    };
    assert!(bench.outputs.stop && bench.in_force == [Duty::ZERO; MAX_JOINTS], "zero in the tick of the fault");
    let at_stop = beyond(&bench);
    bench.run(1000);
    Beyond { fault, at_stop, at_rest: beyond(&bench) }
}

fn positions(bench: &Bench) -> Vec<f64> {
    bench.plant.joints.iter().map(|joint| joint.state[2]).collect()
}

/// The farthest joint's way beyond its limit, negative within, rad.
fn beyond(bench: &Bench) -> f64 {
    let ways = positions(bench).into_iter().zip(&bench.limits).map(|(at, limits)| at.abs() - f64::from(limits.max));
    ways.fold(f64::NEG_INFINITY, f64::max)
}

/// Prints the worst of them, and gives it: at the stop and at rest, rad beyond the limit.
fn worst(what: &str, all: &[Beyond]) -> (f64, f64) {
    let worst = |key: fn(&Beyond) -> f64| all.iter().map(key).fold(f64::NEG_INFINITY, f64::max);
    let (at_stop, at_rest) = (worst(|beyond| beyond.at_stop), worst(|beyond| beyond.at_rest));
    eprintln!("{what}, {} motions: {at_stop:.3} rad beyond the limit at the stop, {at_rest:.3} at rest", all.len());
    (at_stop, at_rest)
}

/// One phase of an encoder is open: its count goes to and fro by one.
fn open_phase(encoder: usize) -> impl FnMut(&mut Inputs) + 'static {
    let mut base = None;
    move |inputs| {
        let count = inputs.encoders[encoder].unwrap();
        inputs.encoders[encoder] = Some(*base.get_or_insert(count) + (count & 1));
    }
}

/// Ticks of the slow stage, which lasts from 3.4 to 29.2 s, at every place of a move and its pause.
fn slow_stage() -> impl Iterator<Item = u32> {
    (3500..29_000).step_by(730)
}

#[test]
fn an_open_phase_in_the_slow_stage_stops_the_motion_within_the_limits() {
    let mut all = Vec::new();
    for from_ms in slow_stage() {
        for encoder in 0..3 {
            let beyond = calibration_with(from_ms, Wires::RIGHT, open_phase(encoder));
            let found = [Fault::EncoderStuck { encoder: encoder as u8 }, MISMATCH[0], MISMATCH[1]];
            assert!(found.contains(&beyond.fault), "{beyond:?}");
            all.push(beyond);
        }
    }
    assert!(worst("an open phase, slow", &all).0 <= 0.05);
}

/// The joint is fast when its encoder breaks, up to 4.2 rad/s, and its motor at full duty: the motor is let go 17 ms later,
/// and the joint coasts.
#[test]
fn an_open_phase_in_the_fast_stage_stops_the_motion_at_once() {
    let mut all = Vec::new();
    for from_ms in (29_300..74_000).step_by(770) {
        for encoder in 0..3 {
            let beyond = calibration_with(from_ms, Wires::RIGHT, open_phase(encoder));
            assert!(!matches!(beyond.fault, Fault::JointLimit { .. }), "{beyond:?}");
            all.push(beyond);
        }
    }
    let (at_stop, at_rest) = worst("an open phase, fast", &all);
    assert!(at_stop < 0.2 && at_rest < 0.3, "{at_stop} {at_rest}");
}

#[test]
fn counts_that_are_half_or_twice_stop_the_first_moves() {
    let mut all = Vec::new();
    for scale in [0.5f64, 2.0] {
        for encoder in 0..3 {
            let lie = move |inputs: &mut Inputs| {
                inputs.encoders[encoder] = inputs.encoders[encoder].map(|count| (f64::from(count) * scale) as i32);
            };
            let beyond = calibration_with(0, Wires::RIGHT, lie);
            assert!(matches!(beyond.fault, Fault::RotationMismatch { .. }), "{beyond:?}");
            all.push(beyond);
        }
    }
    assert!(worst("half or double counts", &all).0 <= 0.05);
}

/// The gear slips: from some time on half of the steps are missing.
#[test]
fn counts_that_are_lost_on_the_way_stop_the_motion_within_the_limits() {
    let mut all = Vec::new();
    for from_ms in slow_stage() {
        for encoder in 0..3 {
            let mut base = None;
            let lie = move |inputs: &mut Inputs| {
                let count = inputs.encoders[encoder].unwrap();
                let base = *base.get_or_insert(count);
                inputs.encoders[encoder] = Some(base + (count - base) / 2);
            };
            let beyond = calibration_with(from_ms, Wires::RIGHT, lie);
            assert!(matches!(beyond.fault, Fault::RotationMismatch { .. }), "{beyond:?}");
            all.push(beyond);
        }
    }
    // The worst is a slip that begins in the middle of a move of all joints.
    assert!(worst("lost counts, slow", &all).0 <= 0.06);
}

#[test]
fn an_encoder_that_counts_backwards_is_found_in_its_first_move() {
    for encoder in 0..3 {
        let lie = move |inputs: &mut Inputs| inputs.encoders[encoder] = inputs.encoders[encoder].map(|count| -count);
        let beyond = calibration_with(0, Wires::RIGHT, lie);
        // The gyro sees both speeds' difference before the push against the duty is long enough, or just after.
        let found = [Fault::WrongWay { joint: encoder as u8 }, MISMATCH[0], MISMATCH[1]];
        assert!(found.contains(&beyond.fault), "{beyond:?}");
        assert!(beyond.at_rest < -0.4, "{beyond:?}");
    }
}

#[test]
fn a_motor_with_swapped_leads_is_found_in_its_first_move() {
    for joint in 0..3 {
        let mut wires = Wires::RIGHT;
        wires.leads[joint] = -1.0;
        let beyond = calibration_with(0, wires, |_| {});
        assert_eq!(beyond.fault, Fault::WrongWay { joint: joint as u8 });
        assert!(beyond.at_rest < -0.4, "{beyond:?}");
    }
}

#[test]
fn two_swapped_encoders_are_found_in_the_first_move() {
    for (a, b) in [(0, 1), (0, 2), (1, 2)] {
        let beyond = calibration_with(0, Wires::RIGHT, move |inputs| inputs.encoders.swap(a, b));
        // The other joint counters what seems to move its own, and so makes the driven one seem to move, backwards.
        let stuck = Fault::EncoderStuck { encoder: a as u8 };
        let found = [stuck, Fault::WrongWay { joint: a as u8 }, Fault::RotationMismatch { gyro: 1 }];
        assert!(found.contains(&beyond.fault), "{beyond:?}");
        assert!(beyond.at_rest < -0.4, "{beyond:?}");
    }
}

#[test]
fn two_swapped_motors_are_found_in_the_first_move() {
    for (a, b) in [(0, 1), (0, 2), (1, 2)] {
        let mut wires = Wires::RIGHT;
        wires.motors.swap(a, b);
        let beyond = calibration_with(0, wires, |_| {});
        // The other joint counters what seems to move its own, and so makes the driven one seem to move, backwards.
        let stuck = Fault::EncoderStuck { encoder: a as u8 };
        let found = [stuck, Fault::WrongWay { joint: a as u8 }, Fault::RotationMismatch { gyro: 1 }];
        assert!(found.contains(&beyond.fault), "{beyond:?}");
        assert!(beyond.at_rest < -0.4, "{beyond:?}");
    }
}

/// The same faults on a joint whose soft belt gives way by 0.16 rad. It is as fast at full duty as its bare motor, 12 rad/s:
/// in the fast stage it coasts beyond its limit.
#[test]
fn a_joint_with_a_soft_belt_does_not_run_away_either() {
    let half = |scale: f64| {
        move |inputs: &mut Inputs| {
            inputs.encoders[0] = inputs.encoders[0].map(|count| (f64::from(count) * scale) as i32);
        }
    };
    let lies = [0.5, 2.0, -1.0].map(|scale| calibration_of(Plant::soft(1), 0, Wires::RIGHT, half(scale)));
    assert!(worst("a soft belt, half, double or backward counts", &lies).0 < -0.2);

    let swapped = Wires { leads: [-1.0; 3], ..Wires::RIGHT };
    let swapped = calibration_of(Plant::soft(1), 0, swapped, |_| {});
    assert_eq!(swapped.fault, Fault::WrongWay { joint: 0 });
    assert!(worst("a soft belt, swapped leads", &[swapped]).0 < -0.2);

    let open = |from_ms| calibration_of(Plant::soft(1), from_ms, Wires::RIGHT, open_phase(0));
    let slow: Vec<_> = slow_stage().step_by(3).map(open).collect();
    assert!(worst("a soft belt, an open phase, slow", &slow).0 <= 0.0);
    let fast: Vec<_> = (32_000..62_000).step_by(770).map(open).collect();
    let (at_stop, at_rest) = worst("a soft belt, an open phase, fast", &fast);
    assert!(at_stop < 0.0 && at_rest < 0.4, "{at_stop} {at_rest}");
}
