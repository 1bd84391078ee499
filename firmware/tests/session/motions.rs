//! The preset motions, played on a robot with elastic joints.

use firmware::motion::preset;
use protocol::motion::{Action, Limits};
use protocol::sample::{Flags, NO_PHASE};
use protocol::{Duty, EventKind, Motion, MotionEnd, MotionId, Sample};

use crate::bench::{Bench, MOTION};
use crate::plant::{COUNTS_PER_RAD, Plant, RAD_S_PER_LSB};

pub fn limits(joints: usize) -> Vec<Limits> {
    [1.0, 0.6, 0.6][..joints].iter().map(|max| Limits { min: -max, max: *max }).collect()
}

/// Plays a motion; of the samples only those of the motion are kept.
fn play(plant: Plant, motion: &Motion) -> Bench {
    let mut bench = Bench::new(plant);
    bench.prepare(motion);
    bench.start().unwrap();
    let end = bench.until(130_000, |kind| matches!(kind, EventKind::MotionEnded { .. }));
    assert_eq!(end.kind, EventKind::MotionEnded { motion: MOTION, end: MotionEnd::Finished });
    bench.samples.retain(|sample| sample.phase != NO_PHASE);
    bench
}

/// Farthest position of a joint, rad.
fn reach(bench: &Bench, joint: usize) -> f64 {
    let farthest = bench.samples.iter().map(|s| s.encoders[joint].unsigned_abs()).max().unwrap();
    f64::from(farthest) / COUNTS_PER_RAD
}

/// Highest rate on any gyro axis, rad/s.
fn fastest(bench: &Bench) -> f64 {
    let words = bench.samples.iter().flat_map(|s| s.gyros.as_flattened());
    f64::from(words.map(|word| word.unsigned_abs()).max().unwrap()) * RAD_S_PER_LSB
}

/// What every motion must keep on every robot: in its limits, in order, nothing missing, every move arrived.
fn in_order(bench: &Bench, motion: &Motion) {
    for (joint, limits) in bench.limits.iter().enumerate() {
        assert!(reach(bench, joint) < limits.max.into(), "joint {joint} reached {:.3} rad", reach(bench, joint));
    }
    assert!(!bench.events().iter().any(|event| matches!(event, EventKind::MoveTimedOut { .. })));
    assert!(fastest(bench) < 1000f64.to_radians());
    let phases: Vec<u8> = bench.samples.iter().map(|sample| sample.phase).collect();
    assert!(phases.is_sorted() && phases[0] == 0);
    assert_eq!(phases.iter().max().map(|last| usize::from(*last) + 1), Some(motion.segments.len()));
    for pair in bench.samples.windows(2) {
        assert_eq!(pair[1].seq, pair[0].seq.wrapping_add(1));
        assert_eq!(pair[1].t_us, pair[0].t_us.wrapping_add(1000));
    }
    assert!(bench.samples.iter().all(|s| s.motion == MOTION && s.flags.contains(Flags::RUNNING | Flags::ZEROED)));
}

/// Measured with Doggy's figures 76.1 s; with each figure drawn within ±20 % 72.9 to 79.2 s.
#[test]
fn doggys_calibration_lasts_about_76_seconds_whatever_its_figures() {
    let motion = preset::calibration(&limits(3));
    for seed in 0..4 {
        let plant = if seed == 0 { Plant::doggy(3, 1) } else { Plant::drawn(3, seed) };
        let bench = play(plant, &motion);
        in_order(&bench, &motion);
        let ticks = bench.samples.len();
        assert!((70_000..83_000).contains(&ticks), "{ticks} ticks with seed {seed}");
    }
}

/// Measured 77.8 s with one joint, 72.9 s with two.
#[test]
fn robots_with_one_or_two_joints_have_their_60_to_100_seconds() {
    for joints in [1, 2] {
        let motion = preset::calibration(&limits(joints));
        let bench = play(Plant::doggy(joints, 1), &motion);
        in_order(&bench, &motion);
        let ticks = bench.samples.len();
        assert!((68_000..83_000).contains(&ticks), "{ticks} ticks with {joints} joints");
    }
}

/// Measured 31.1 s; with each figure drawn within ±20 % 30.3 to 31.4 s.
#[test]
fn the_validation_lasts_about_30_seconds() {
    let motion = preset::validation(&limits(3));
    for seed in 0..4 {
        let plant = if seed == 0 { Plant::doggy(3, 1) } else { Plant::drawn(3, seed) };
        let bench = play(plant, &motion);
        in_order(&bench, &motion);
        assert!((28_000..34_000).contains(&bench.samples.len()), "{} ticks", bench.samples.len());
    }
}

/// The stages of the calibration: rest of at least 3 s without duty, slow with at most 0.15 and large ways, fast with 0.90 used.
#[test]
fn the_calibration_excites_what_it_is_made_for() {
    let motion = preset::calibration(&limits(3));
    let bench = play(Plant::doggy(3, 1), &motion);
    let stage = |sample: &Sample| motion.stages[usize::from(motion.segments[usize::from(sample.phase)].stage)].as_str();
    let of = |name: &str| -> Vec<&Sample> { bench.samples.iter().filter(|s| stage(s).starts_with(name)).collect() };
    let largest = |stage, joint: usize| of(stage).iter().map(|s| s.duty[joint].0.unsigned_abs()).max().unwrap();
    let farthest = |stage, joint: usize| of(stage).iter().map(|s| s.encoders[joint].unsigned_abs()).max().unwrap();
    assert!(of("rest").len() >= 3000 && of("rest").iter().all(|s| s.duty == [Duty::ZERO; 7]));
    for joint in 0..3 {
        assert_eq!(largest("slow", joint), 1500);
        assert_eq!(largest("fast", joint), 9000);
        let half_range = [1.0, 0.6, 0.6][joint] * COUNTS_PER_RAD;
        // Measured 0.79 to 0.81 of the half range.
        let part = f64::from(farthest("slow", joint)) / half_range;
        assert!((0.75..0.86).contains(&part), "joint {joint} went {part:.3} of its half range");
    }
    // Limits that come into play cut the excitation: measured 861 ticks of 76,100.
    let limited = bench.samples.iter().filter(|s| s.flags.contains(Flags::POSITION_LIMITED)).count();
    assert!(limited < 1500, "{limited} ticks were limited by position");
}

/// Where the chirp's frequency is, by counting the zero crossings of the duty.
#[test]
fn the_chirp_rises_from_1_4_to_10_hz_in_3_seconds() {
    let motion = preset::calibration(&limits(1));
    let bench = play(Plant::doggy(1, 1), &motion);
    let chirp = motion.segments.iter().position(|s| matches!(s.action, Action::Chirp { .. })).unwrap();
    // The duty in force lags the phase by one tick.
    let duty: Vec<i16> =
        bench.samples.iter().filter(|s| usize::from(s.phase) == chirp).map(|s| s.duty[0].0).skip(1).collect();
    assert_eq!(duty.len(), 2999);
    let crossings = |part: &[i16]| part.windows(2).filter(|pair| (pair[0] >= 0) != (pair[1] >= 0)).count();
    // Two crossings a period: 2 ∫f dt = 2 (1.4 + 10) / 2 · 3 = 34.2 in all, 2 (10 − 8.6/12) / 2 … = 4.8 in the last 0.25 s.
    let (all, last) = (crossings(&duty), crossings(&duty[2749..]));
    assert!((33..=35).contains(&all), "{all} crossings in all");
    assert!((4..=6).contains(&last), "{last} crossings in the last quarter second");
}

#[test]
fn a_start_at_a_tick_begins_in_that_tick_with_zero_duty() {
    let motion = preset::validation(&limits(1));
    let mut bench = Bench::ready(&motion);
    let at_seq = bench.core.control().next_seq() + 50;
    bench.ask(protocol::Command::Start { motion: MOTION, at_seq: Some(at_seq) }).unwrap();
    assert_eq!(bench.status().state, protocol::State::Waiting { at_seq });
    let event = bench.until(60, |kind| *kind == EventKind::MotionStarted(MOTION));
    assert_eq!(event.seq, at_seq);
    let first = bench.samples.iter().find(|sample| sample.phase == 0).unwrap();
    assert_eq!((first.seq, first.motion, first.duty[0]), (at_seq, MOTION, Duty::ZERO));
    let before = bench.samples.iter().find(|sample| sample.seq + 1 == at_seq).unwrap();
    assert_eq!((before.phase, before.motion), (NO_PHASE, MotionId::NONE));
}

/// The duty that tick k computes is in force from tick k + 1 on, and the sample says so.
#[test]
fn the_sample_has_the_duty_that_is_in_force() {
    let motion = preset::validation(&limits(2));
    let mut bench = Bench::ready(&motion);
    bench.start().unwrap();
    bench.run(3500);
    for _ in 0..2000 {
        let preloaded = bench.outputs.duty;
        bench.tick();
        assert_eq!(bench.samples.last().unwrap().duty, preloaded);
        assert_eq!(bench.in_force, preloaded);
    }
    assert!(bench.outputs.duty != [Duty::ZERO; 7], "the robot moves by now");
}
