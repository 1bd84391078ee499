//! Segment by segment, against the laws that `protocol::motion` states.

use protocol::Segment;
use protocol::motion::Header;
use protocol::units::text;

use super::*;

/// Counts per rad of both joints: round numbers.
const SCALE: f32 = 10_000.0;

fn motion(gain: f32, actions: &[Action]) -> Motion {
    let header = Header {
        name: text("test"),
        stages: [text("stage")].into_iter().collect(),
        gain: [gain; 2].into_iter().collect(),
    };
    let mut motion = Motion::new(header);
    motion.segments = actions.iter().map(|action| Segment { stage: 0, action: action.clone() }).collect();
    motion
}

fn move_to(joints: JointSet, targets: &[f32], tolerance: f32) -> Action {
    let targets = targets.iter().copied().collect();
    Action::MoveTo { joints, targets, ceiling: Duty(1500), tolerance, timeout_ms: 100 }
}

fn at(first: i32, second: i32) -> Positions {
    [first, second, 0, 0, 0, 0, 0]
}

/// Plays with the joints standing still; gives the duties of joints 1 and 2 and the phase of every tick.
fn play(motion: &Motion, positions: Positions) -> Vec<(u8, i16, i16)> {
    let mut player = Player::new(motion, [SCALE; MAX_JOINTS], &positions, 1000);
    let mut out = Vec::new();
    while let Step::Playing { phase, duty, .. } = player.step(motion, &positions) {
        assert_eq!(duty[2..], [Duty::ZERO; 5], "joints that the robot does not have");
        out.push((phase, duty[0].0, duty[1].0));
    }
    out
}

#[test]
fn zero_and_hold_keep_the_position_they_find() {
    let motion = motion(2.0, &[Action::Zero { duration_ms: 3 }, Action::Hold { ceiling: Duty(500), duration_ms: 2 }]);
    let mut player = Player::new(&motion, [SCALE; MAX_JOINTS], &at(0, 0), 1000);
    let mut duties = Vec::new();
    // Moved by hand during the zero: that is where it is held; 100 counts off are 0.01 rad · 2 = 0.02.
    for position in [0, 300, 1000, 1000, 900] {
        let Step::Playing { phase, duty, .. } = player.step(&motion, &at(position, 0)) else { panic!("too short") };
        duties.push((phase, duty[0].0));
    }
    assert_eq!(duties, [(0, 0), (0, 0), (0, 0), (1, 0), (1, 200)]);
    assert_eq!(player.step(&motion, &at(0, 0)), Step::Finished);
    assert_eq!(player.step(&motion, &at(0, 0)), Step::Finished, "and stays so");
}

#[test]
fn a_move_pulls_in_proportion_up_to_its_ceiling_and_keeps_the_others() {
    let motion = motion(2.0, &[move_to(JointSet::only(0), &[0.05], 0.001)]);
    let played = play(&motion, at(0, -40));
    assert_eq!(played[0], (0, 1000, 0), "0.05 rad · 2; joint 2 stays where it was at the start");
    let far = play(&motion, at(-10_000, 0));
    assert_eq!(far[0].1, 1500, "its ceiling");
    assert_eq!(play(&motion, at(10_000, 0))[0].1, -1500);
}

#[test]
fn a_move_ends_when_it_has_stayed_within_tolerance_for_20_ms() {
    let motion = motion(2.0, &[move_to(JointSet::first(2), &[0.1, -0.1], 0.01)]);
    assert_eq!(play(&motion, at(1050, -950)).len(), 21, "both are near from the first tick on");
    assert_eq!(play(&motion, at(1050, -850)).len(), 100, "one of them never is");
}

#[test]
fn a_move_that_does_not_arrive_says_so_in_its_last_tick() {
    let motion = motion(2.0, &[move_to(JointSet::only(0), &[0.1], 0.01)]);
    let mut player = Player::new(&motion, [SCALE; MAX_JOINTS], &at(0, 0), 1000);
    for tick in 0..100 {
        let Step::Playing { timed_out, .. } = player.step(&motion, &at(0, 0)) else { panic!("too short") };
        assert_eq!(timed_out, tick == 99);
    }
    assert_eq!(player.step(&motion, &at(0, 0)), Step::Finished);
}

/// duty = amplitude · cos φ + centring · (start − measured), φ by the closed form of the sum over ticks.
#[test]
fn a_chirp_follows_its_law() {
    let chirp = Action::Chirp {
        joints: JointSet::first(2),
        amplitude: Duty(9000),
        from_hz: 1.4,
        to_hz: 10.0,
        spread: 0.5,
        centring: 0.0,
        duration_ms: 3000,
    };
    let played = play(&motion(2.0, &[chirp]), at(100, -100));
    assert_eq!(played.len(), 3000);
    for (k, (_, first, second)) in played.iter().enumerate() {
        let k = k as f64;
        // Σ_{i<k} (1.4 + 8.6 i / 3000) · 1 ms
        let turns = 1e-3 * (1.4 * k + 8.6 * k * (k - 1.0) / 2.0 / 3000.0);
        for (duty, factor) in [(first, 1.0), (second, 1.5)] {
            let expected = 9000.0 * (core::f64::consts::TAU * factor * turns).cos();
            // The frequencies are rounded to 24 bits: 1e-7 of up to 26 turns, 2e-5 turns, one step.
            assert!((f64::from(*duty) - expected).abs() < 2.0, "tick {k}: {duty}, expected {expected:.1}");
        }
    }
}

#[test]
fn a_chirp_is_pulled_back_to_its_start_within_its_amplitude() {
    let chirp = Action::Chirp {
        joints: JointSet::only(0),
        amplitude: Duty(1000),
        from_hz: 1.0,
        to_hz: 1.0,
        spread: 0.0,
        centring: 2.0,
        duration_ms: 1000,
    };
    let motion = motion(0.0, &[chirp]);
    let mut player = Player::new(&motion, [SCALE; MAX_JOINTS], &at(0, 0), 1000);
    let mut duty = |position| match player.step(&motion, &at(position, 0)) {
        Step::Playing { duty, .. } => duty[0].0,
        Step::Finished => panic!("too short"),
    };
    assert_eq!(duty(0), 1000, "the cosine begins at its top");
    assert_eq!(duty(100), 800, "0.01 rad · 2 back");
    assert_eq!(duty(-100), 1000, "limited to the amplitude");
}

/// target + amplitude · sin(2π (1 + i · spread) f t), under the position controller.
#[test]
fn a_sine_moves_the_target() {
    let sine = Action::Sine {
        joints: JointSet::first(2),
        amplitude: 0.02,
        frequency_hz: 1.0,
        spread: 1.0,
        ceiling: Duty(9000),
        duration_ms: 1000,
    };
    let played = play(&motion(1.0, &[sine]), at(500, -500));
    for (k, (_, first, second)) in played.iter().enumerate() {
        let turns = k as f64 * 1e-3;
        for (duty, factor) in [(first, 1.0), (second, 2.0)] {
            // 0.02 rad = 200 counts = 200 duty steps with this gain.
            let expected = 200.0 * (core::f64::consts::TAU * factor * turns).sin();
            assert!((f64::from(*duty) - expected).abs() < 1.1, "tick {k}: {duty}, expected {expected:.1}");
        }
    }
}

#[test]
fn targets_outlive_their_move_and_a_chirps_joint_stays_where_it_ends() {
    let chirp = Action::Chirp {
        joints: JointSet::only(1),
        amplitude: Duty(100),
        from_hz: 1.0,
        to_hz: 1.0,
        spread: 0.0,
        centring: 0.0,
        duration_ms: 1,
    };
    let hold = Action::Hold { ceiling: Duty(9000), duration_ms: 1 };
    let played = play(&motion(2.0, &[move_to(JointSet::first(2), &[0.1, 0.1], 1.0), chirp, hold]), at(0, 400));
    assert_eq!(played.last(), Some(&(2, 2000, 0)), "joint 1 is still pulled to 0.1 rad, joint 2 held at 0.04 rad");
}

#[test]
fn extreme_positions_and_gains_do_not_overflow() {
    let hold = Action::Hold { ceiling: Duty(10_000), duration_ms: 1 };
    for (start, now) in [(i32::MIN, i32::MAX), (i32::MAX, i32::MIN)] {
        let motion = motion(f32::MAX, core::slice::from_ref(&hold));
        let mut player = Player::new(&motion, [f32::MIN_POSITIVE; MAX_JOINTS], &at(start, 0), 1000);
        let Step::Playing { duty, .. } = player.step(&motion, &at(now, 0)) else { panic!("too short") };
        assert_eq!(duty[0].0.signum() as i32, start.signum());
    }
}
