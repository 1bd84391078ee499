//! Everything that must stop the robot, and how fast.

use firmware::{GyroInput, Inputs, motion::preset};
use protocol::sample::Flags;
use protocol::{Action, Command, Duty, EventKind, Fault, JointSet, MAX_JOINTS, MotionEnd, Refusal, Segment, State};

use crate::bench::{Bench, MOTION};
use crate::motions::limits;
use crate::plant::{COUNTS_PER_RAD, Plant};

const ZERO: [Duty; MAX_JOINTS] = [Duty::ZERO; MAX_JOINTS];

/// Doggy in the slow stage of its calibration, joint 1 under way.
fn moving() -> Bench {
    let mut bench = Bench::ready(&preset::calibration(&limits(3)));
    bench.start().unwrap();
    bench.run(4000);
    assert_eq!(bench.in_force[0], Duty(1500), "the yaw moves");
    bench
}

/// Changes what the core reads from now on.
fn disturb(bench: &mut Bench, change: impl FnMut(&mut Inputs) + 'static) {
    bench.disturb.inputs = Some(Box::new(change));
}

/// The motion ends by this fault within so many ticks: zero duty in the very tick that tells it, and every tick after.
fn stops(bench: &mut Bench, fault: Fault, within: u32) {
    let event = bench.until(within, |kind| *kind == EventKind::FaultRaised(fault));
    assert!(bench.outputs.stop && bench.in_force == ZERO, "zero in the tick of the fault");
    let sample = *bench.samples.last().unwrap();
    assert_eq!((sample.seq, sample.duty), (event.seq, ZERO));
    assert!(sample.flags.contains(Flags::STOPPED | Flags::FAULT));
    assert!(bench.events().contains(&EventKind::MotionEnded { motion: MOTION, end: MotionEnd::Fault(fault) }));
    for _ in 0..300 {
        bench.tick();
        assert!(bench.outputs.stop && bench.in_force == ZERO && bench.outputs.duty == ZERO);
        assert_eq!(bench.samples.last().unwrap().seq, bench.core.control().next_seq() - 1, "the loop goes on");
    }
    assert_eq!(bench.status().state, State::Fault(fault));
    assert_eq!(bench.start(), Err(Refusal::Fault(fault)), "latched");
}

/// With the cause gone, the fault can be cleared and the motion started again.
fn recovers(bench: &mut Bench) {
    bench.disturb = Default::default();
    bench.run(20);
    bench.ask(Command::ClearFault).unwrap();
    assert_eq!(bench.start(), Ok(()));
    bench.run(4000);
    assert!(bench.in_force[0] != Duty::ZERO, "it moves again");
}

fn does_not_clear(bench: &mut Bench, fault: Fault) {
    assert_eq!(bench.ask(Command::ClearFault), Err(Refusal::Fault(fault)), "its cause lasts");
}

#[test]
fn silence_of_the_host() {
    let mut bench = moving();
    bench.disturb.no_heartbeat = true;
    // The last heartbeat was heard at most 20 ticks ago.
    stops(&mut bench, Fault::HeartbeatLost, 102);
    does_not_clear(&mut bench, Fault::HeartbeatLost);
    recovers(&mut bench);
}

#[test]
fn the_emergency_stop() {
    let mut bench = moving();
    disturb(&mut bench, |inputs| inputs.emergency_stop = true);
    stops(&mut bench, Fault::EmergencyStop, 1);
    does_not_clear(&mut bench, Fault::EmergencyStop);
    recovers(&mut bench);
}

#[test]
fn the_emergency_stop_latches_at_rest_too() {
    let mut bench = Bench::ready(&preset::calibration(&limits(1)));
    disturb(&mut bench, |inputs| inputs.emergency_stop = true);
    bench.run(1);
    bench.disturb = Default::default();
    assert_eq!(bench.start(), Err(Refusal::Fault(Fault::EmergencyStop)));
    assert!(!bench.samples.last().unwrap().flags.contains(Flags::STOPPED), "nothing was under way");
}

/// Drivers are enabled while they are needed: from the start until the robot has come to rest, and not at rest.
#[test]
fn drivers_are_let_go_half_a_second_after_whatever_ended_the_motion() {
    let ends: [fn(&mut Bench); 3] = [
        |bench| bench.ask(Command::Stop).unwrap(),
        |bench| disturb(bench, |inputs| inputs.emergency_stop = true),
        |bench| bench.disturb.no_heartbeat = true,
    ];
    for end in ends {
        let mut bench = Bench::ready(&preset::calibration(&limits(3)));
        assert!(!bench.outputs.armed, "nothing was started");
        bench.start().unwrap();
        assert!(bench.outputs.armed, "before the first duty");
        bench.run(4000);
        assert!(bench.outputs.armed && bench.in_force[0] != Duty::ZERO);
        end(&mut bench);
        bench.until_idle(200);
        let braking = (0..1000)
            .take_while(|_| {
                bench.tick();
                bench.outputs.armed
            })
            .count();
        assert!((480..=500).contains(&braking), "{braking} ticks");
        assert!(bench.in_force == ZERO);
    }
}

#[test]
fn an_emergency_stop_that_must_be_tested_is_pressed_once_before_anything_moves() {
    let mut bench = Bench::untested();
    bench.prepare(&preset::calibration(&limits(3)));
    assert_eq!(bench.start(), Err(Refusal::StopNotTested));
    disturb(&mut bench, |inputs| inputs.emergency_stop = true);
    bench.run(100);
    bench.disturb = Default::default();
    assert_eq!(bench.start(), Err(Refusal::Fault(Fault::EmergencyStop)), "released, and latched");
    bench.run(20);
    bench.ask(Command::ClearFault).unwrap();
    assert_eq!(bench.start(), Ok(()));
}

#[test]
fn a_clock_that_is_not_the_crystals_lets_nothing_move() {
    let mut bench = Bench::ready(&preset::calibration(&limits(3)));
    disturb(&mut bench, |inputs| inputs.wrong_clock = true);
    bench.run(1);
    assert_eq!(bench.start(), Err(Refusal::Fault(Fault::Clock)));
    does_not_clear(&mut bench, Fault::Clock);
}

/// The period began so late that its PWM timer had stopped: the sample has the duty that was in force, none.
#[test]
fn a_duty_that_was_dropped_is_told_as_none() {
    let mut bench = moving();
    disturb(&mut bench, |inputs| inputs.dropped = true);
    stops(&mut bench, Fault::Overrun, 1);
    let dropped = bench.samples.iter().find(|sample| sample.flags.contains(Flags::FAULT)).unwrap();
    assert!(dropped.duty == ZERO && dropped.flags.contains(Flags::OVERRUN));
    recovers(&mut bench);
}

#[test]
fn a_supply_too_low() {
    let mut bench = moving();
    disturb(&mut bench, |inputs| inputs.brown_out = true);
    stops(&mut bench, Fault::BrownOut, 1);
    recovers(&mut bench);
}

#[test]
fn a_gyro_whose_bus_hangs() {
    let mut bench = moving();
    disturb(&mut bench, |inputs| inputs.gyros[1] = GyroInput::BusError);
    stops(&mut bench, Fault::BusHang { gyro: 1 }, 3);
    assert!(bench.samples.last().unwrap().flags.contains(Flags::GYRO2_STALE));
    does_not_clear(&mut bench, Fault::BusHang { gyro: 1 });
    recovers(&mut bench);
}

#[test]
fn a_gyro_that_does_not_convert() {
    let mut bench = moving();
    disturb(&mut bench, |inputs| inputs.gyros[0] = GyroInput::NotReady);
    stops(&mut bench, Fault::GyroStale { gyro: 0 }, 3);
    recovers(&mut bench);
}

#[test]
fn a_gyro_that_is_stuck() {
    let mut bench = moving();
    disturb(&mut bench, |inputs| inputs.gyros[0] = GyroInput::Words([3, -4, 5]));
    stops(&mut bench, Fault::GyroStuck { gyro: 0 }, 51);
    recovers(&mut bench);
}

#[test]
fn a_gyro_at_the_end_of_its_range() {
    let mut bench = moving();
    disturb(&mut bench, |inputs| {
        if let GyroInput::Words(words) = &mut inputs.gyros[1] {
            words[2] = i16::MAX;
        }
    });
    bench.tick();
    assert!(bench.samples.last().unwrap().flags.contains(Flags::GYRO2_SATURATED), "told at once");
    stops(&mut bench, Fault::GyroRange { gyro: 1 }, 49);
    recovers(&mut bench);
}

#[test]
fn an_encoder_that_jumps_loses_the_zero() {
    let mut bench = moving();
    disturb(&mut bench, |inputs| inputs.encoders[2] = inputs.encoders[2].map(|c| c + 5000));
    stops(&mut bench, Fault::EncoderJump { encoder: 2 }, 1);
    bench.ask(Command::ClearFault).unwrap();
    assert_eq!(bench.start(), Err(Refusal::NotZeroed));
    // The links still swing on their belts, which the gyros see.
    assert_eq!(bench.ask(Command::SetZero), Err(Refusal::NotQuiet));
    bench.run(2000);
    bench.ask(Command::SetZero).unwrap();
    assert_eq!(bench.start(), Ok(()));
}

#[test]
fn an_encoder_that_does_not_answer() {
    let mut bench = moving();
    disturb(&mut bench, |inputs| inputs.encoders[1] = None);
    stops(&mut bench, Fault::EncoderStale { encoder: 1 }, 3);
    assert!(bench.samples.last().unwrap().flags.contains(Flags::ENCODER_STALE));
    recovers(&mut bench);
}

#[test]
fn an_encoder_that_is_stuck() {
    let mut bench = moving();
    let hanging = bench.plant.counts(0);
    disturb(&mut bench, move |inputs| inputs.encoders[0] = Some(hanging));
    // The gyro sees the rotation before the push is long enough.
    stops(&mut bench, Fault::RotationMismatch { gyro: 0 }, 151);
    assert_eq!(bench.ask(Command::ClearFault), Ok(()), "at rest a standing encoder proves nothing");
}

#[test]
fn a_joint_that_is_blocked() {
    let mut bench = moving();
    let at = bench.plant.joints[0].state[2];
    for _ in 0..151 {
        bench.plant.joints[0].state = [at, 0.0, at, 0.0];
        bench.tick();
    }
    assert!(bench.events().contains(&EventKind::FaultRaised(Fault::EncoderStuck { encoder: 0 })));
    bench.run(20);
    assert_eq!(bench.ask(Command::ClearFault), Ok(()), "at rest a standing encoder proves nothing");
}

#[test]
fn a_tick_that_is_missed() {
    let mut bench = moving();
    bench.disturb.clock_us = 1000;
    stops(&mut bench, Fault::Overrun, 1);
    recovers(&mut bench);
}

#[test]
fn a_tick_that_runs_too_long() {
    let mut bench = moving();
    disturb(&mut bench, |inputs| inputs.last_execution_us = 1001);
    stops(&mut bench, Fault::Overrun, 1);
    recovers(&mut bench);
}

#[test]
fn a_joint_carried_beyond_its_limit() {
    let mut bench = moving();
    // Somebody pushes the roll outwards at 8 rad/s.
    for _ in 0..400 {
        let at = bench.plant.joints[2].state[2];
        bench.plant.joints[2].state = [at, 8.0, at, 8.0];
        bench.tick();
        if bench.outputs.stop {
            break;
        }
    }
    let beyond = bench.plant.joints[2].state[2];
    assert!(bench.events().contains(&EventKind::FaultRaised(Fault::JointLimit { joint: 2 })));
    assert!((0.66..0.675).contains(&beyond), "limit 0.6 rad, overtravel 0.06 rad, stopped at {beyond}");
    does_not_clear(&mut bench, Fault::JointLimit { joint: 2 });
    while bench.plant.joints[2].state[2] > 0.5 {
        let at = bench.plant.joints[2].state[2];
        bench.plant.joints[2].state = [at, -1.0, at, -1.0];
        bench.tick();
    }
    recovers(&mut bench);
}

/// A motion that drives at full duty into the limits: the approach is braked, and a robot that coasts
/// for longer than its configuration says is stopped.
#[test]
fn driven_against_its_limits_a_joint_stops_there() {
    let mut motion = preset::calibration(&limits(3));
    let against = Action::Chirp {
        joints: JointSet::first(3),
        amplitude: Duty(9000),
        from_hz: 0.2,
        to_hz: 0.4,
        spread: 0.3,
        centring: 0.0,
        duration_ms: 20_000,
    };
    motion.segments = [Segment { stage: 0, action: against }].into_iter().collect();
    for seed in 0..6 {
        let plant = if seed == 0 { Plant::doggy(3, 1) } else { Plant::drawn(3, seed) };
        let mut bench = Bench::new(plant);
        bench.prepare(&motion);
        bench.start().unwrap();
        let end = bench.until(21_000, |kind| matches!(kind, EventKind::MotionEnded { .. }));
        bench.run(500);
        let reach = |joint: usize| {
            let farthest = bench.samples.iter().map(|s| s.encoders[joint].unsigned_abs()).max().unwrap();
            f64::from(farthest) / COUNTS_PER_RAD / f64::from(limits(3)[joint].max)
        };
        let reached: Vec<f64> = (0..3).map(reach).collect();
        if seed == 0 {
            // Measured 0.996 to 1.003 of the limit.
            assert_eq!(end.kind, EventKind::MotionEnded { motion: MOTION, end: MotionEnd::Finished });
            assert!(reached.iter().all(|part| (0.97..1.03).contains(part)), "{reached:?}");
        } else {
            // A robot that coasts for longer than it says may be stopped for good, at 1.10 of the limit.
            assert!(reached.iter().all(|part| (0.9..1.15).contains(part)), "seed {seed}: {reached:?}");
        }
    }
}

#[test]
fn the_host_asks_for_a_stop() {
    let mut bench = moving();
    bench.ask(Command::Stop).unwrap();
    assert_eq!(bench.in_force, ZERO, "in the tick that takes the request");
    let sample = *bench.samples.last().unwrap();
    assert!(sample.flags.contains(Flags::STOPPED) && !sample.flags.contains(Flags::FAULT));
    assert!(bench.events().contains(&EventKind::MotionEnded { motion: MOTION, end: MotionEnd::Stopped }));
    bench.run(2);
    assert!(!bench.samples.last().unwrap().flags.contains(Flags::STOPPED), "told once");
    assert_eq!(bench.start(), Ok(()));
}

/// A megabyte of noise: the loop goes on, the robot does not move, and the next request is understood.
#[test]
fn garbage_on_the_line() {
    let mut bench = Bench::ready(&preset::calibration(&limits(3)));
    for _ in 0..10_000 {
        let noise: [u8; 100] = core::array::from_fn(|_| (256.0 * bench.plant.noise.uniform()) as u8);
        bench.core.receive(&noise);
        bench.tick();
        assert_eq!(bench.in_force, ZERO);
    }
    bench.core.receive(&[0]);
    let counts = bench.core.received();
    assert!(counts.damaged > 1000, "{counts:?}");
    assert_eq!(bench.status().state, State::Idle);
    assert!(bench.samples.windows(2).all(|pair| pair[1].seq == pair[0].seq + 1));
}
