//! A robot that is brought up: one joint driven for a moment, and nothing else.

use protocol::request::{MAX_JOG_DUTY, MAX_JOG_MS};
use protocol::{Command, Duty, EventKind, Fault, Flags, MAX_JOINTS, MotionEnd, Refusal, State};

use crate::bench::{Bench, MOTION};
use crate::motions::limits;
use crate::plant::Plant;
use firmware::motion::preset;

fn jog(joint: u8, duty: i16, duration_ms: u8) -> Command {
    Command::Jog { joint, duty: Duty(duty), duration_ms }
}

/// Doggy, streaming, without zero positions.
fn fresh() -> Bench {
    let mut bench = Bench::new(Plant::doggy(3, 1));
    bench.run(20);
    bench.ask(Command::Stream { on: true }).unwrap();
    bench
}

fn ended(kind: &EventKind) -> bool {
    matches!(kind, EventKind::JogEnded { .. })
}

fn is_off(bench: &Bench) -> bool {
    bench.outputs.duty == [Duty::ZERO; MAX_JOINTS] && bench.in_force == [Duty::ZERO; MAX_JOINTS]
}

#[test]
fn a_jog_drives_its_joint_for_its_time_and_lets_the_motors_go() {
    let mut bench = fresh();
    bench.samples.clear();
    bench.ask(jog(1, -1200, 50)).unwrap();
    assert_eq!(bench.core.control().state(), State::Jogging { joint: 1 });
    let end = bench.until(100, ended);
    assert_eq!(end.kind, EventKind::JogEnded { joint: 1, end: MotionEnd::Finished });
    bench.run(2);
    let driven: Vec<_> = bench.samples.iter().filter(|s| s.duty != [Duty::ZERO; MAX_JOINTS]).collect();
    assert_eq!(driven.len(), 50, "a tick a millisecond");
    assert!(driven.iter().all(|s| s.duty[0] == Duty::ZERO && s.duty[2] == Duty::ZERO && s.duty[1] >= Duty(-1200)));
    assert_eq!(driven[49].duty[1], Duty(-1200));
    assert!(bench.plant.joints[1].state[2] < -0.002 && bench.plant.joints[0].state[2] == 0.0);
    assert!(is_off(&bench) && bench.outputs.armed, "motors brake first");
    bench.run(600);
    assert!(!bench.outputs.armed, "and are let go");
    assert_eq!(bench.core.control().state(), State::Idle);
}

#[test]
fn beyond_its_bounds_a_jog_is_refused() {
    let mut bench = fresh();
    let most = MAX_JOG_DUTY.0;
    for (duty, duration_ms) in [(most + 1, 50), (-most - 1, 50), (i16::MIN, 1), (500, 0), (500, MAX_JOG_MS + 1)] {
        let refused = bench.ask(jog(0, duty, duration_ms));
        assert_eq!(refused, Err(Refusal::JogBounds { duty: Duty(duty), duration_ms }));
    }
    assert_eq!(bench.ask(jog(3, 500, 50)), Err(Refusal::NoSuchJoint { joint: 3, joints: 3 }));
    assert!(is_off(&bench) && !bench.outputs.armed);
    assert_eq!(bench.ask(jog(0, most, MAX_JOG_MS)), Ok(()));
}

#[test]
fn outside_its_state_a_jog_is_refused_with_the_reason() {
    let mut untested = Bench::untested();
    untested.run(20);
    assert_eq!(untested.ask(jog(0, 500, 50)), Err(Refusal::StopNotTested));

    let mut bench = fresh();
    bench.disturb.no_heartbeat = true;
    bench.run(120);
    assert_eq!(bench.ask(jog(0, 500, 50)), Err(Refusal::Fault(Fault::HeartbeatLost)));
    bench.disturb.no_heartbeat = false;
    bench.run(40);

    bench.disturb.inputs = Some(Box::new(|inputs| inputs.emergency_stop = true));
    bench.run(3);
    assert_eq!(bench.ask(jog(0, 500, 50)), Err(Refusal::Fault(Fault::EmergencyStop)), "pressed");
    bench.disturb.inputs = None;
    bench.run(3);
    assert_eq!(bench.ask(jog(0, 500, 50)), Err(Refusal::Fault(Fault::EmergencyStop)), "latched");
    bench.ask(Command::ClearFault).unwrap();

    assert_eq!(bench.ask(jog(0, 500, 200)), Ok(()));
    assert_eq!(bench.ask(jog(1, 500, 50)), Err(Refusal::Running), "one at a time");
    bench.until(300, ended);

    bench.run(1000);
    let motion = preset::validation(&limits(3));
    bench.ask(Command::SetZero).unwrap();
    bench.upload(&motion).unwrap();
    bench.start().unwrap();
    bench.run(2000);
    assert_eq!(bench.ask(jog(0, 500, 50)), Err(Refusal::Running));
    assert_eq!(bench.status().motion, MOTION);
}

#[test]
fn a_jog_is_ended_by_stop_silence_and_emergency_stop() {
    let mut bench = fresh();
    bench.ask(jog(0, 1000, 200)).unwrap();
    assert_eq!(bench.ask(jog(0, 1000, 200)), Err(Refusal::Running));
    bench.ask(Command::Stop).unwrap();
    assert_eq!(bench.events().last(), Some(&EventKind::JogEnded { joint: 0, end: MotionEnd::Stopped }));
    assert!(is_off(&bench));

    bench.run(600);
    bench.ask(jog(0, 1000, 200)).unwrap();
    bench.disturb.no_heartbeat = true;
    let end = bench.until(200, ended);
    let silent = MotionEnd::Fault(Fault::HeartbeatLost);
    assert_eq!(end.kind, EventKind::JogEnded { joint: 0, end: silent });
    assert!(bench.outputs.stop && is_off(&bench), "in the tick of the fault");
    bench.disturb.no_heartbeat = false;
    bench.run(600);
    bench.ask(Command::ClearFault).unwrap();

    bench.ask(jog(0, 1000, 200)).unwrap();
    bench.disturb.inputs = Some(Box::new(|inputs| inputs.emergency_stop = true));
    let end = bench.until(5, ended);
    assert_eq!(end.kind, EventKind::JogEnded { joint: 0, end: MotionEnd::Fault(Fault::EmergencyStop) });
    assert!(bench.outputs.stop && is_off(&bench));
    assert!(bench.samples.last().unwrap().flags.contains(Flags::STOP_PRESSED | Flags::FAULT));
}

/// The watches of a motion are awake: a broken phase, and leads the wrong way round.
#[test]
fn a_jog_ends_with_the_fault_that_a_motion_would() {
    let mut bench = fresh();
    bench.disturb.inputs = Some(Box::new(|inputs| inputs.encoders[0] = Some(7)));
    bench.run(20);
    bench.ask(jog(0, MAX_JOG_DUTY.0, MAX_JOG_MS)).unwrap();
    let end = bench.until(250, ended);
    assert_eq!(end.kind, EventKind::JogEnded { joint: 0, end: MotionEnd::Fault(Fault::EncoderStuck { encoder: 0 }) });
    let at = bench.plant.joints[0].state[2];
    assert!(at < 0.1, "{at} rad");

    let mut bench = fresh();
    bench.wires.leads[2] = -1.0;
    bench.ask(jog(2, MAX_JOG_DUTY.0, MAX_JOG_MS)).unwrap();
    let end = bench.until(250, ended);
    let EventKind::JogEnded { joint: 2, end: MotionEnd::Fault(fault) } = end.kind else { panic!("{end:?}") };
    assert!(matches!(fault, Fault::WrongWay { joint: 2 } | Fault::RotationMismatch { .. }), "{fault:?}");
}

/// A repeated request is answered from memory: a jog that was heard twice is done once.
#[test]
fn a_jog_that_is_repeated_is_done_once() {
    let mut bench = fresh();
    bench.ask_as(99, jog(0, 600, 20)).unwrap();
    bench.until(100, ended);
    bench.run(50);
    bench.ask_as(99, jog(0, 600, 20)).unwrap();
    bench.run(50);
    assert_eq!(bench.events().iter().filter(|kind| ended(kind)).count(), 1);
}
