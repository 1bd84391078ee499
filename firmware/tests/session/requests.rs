//! Requests: what is carried out, what is refused, and that a lost answer does no harm.

use firmware::motion::preset;
use protocol::hello::Greeting;
use protocol::motion::{Action, MAX_SEGMENT_MS};
use protocol::{
    Command, EventKind, Loss, LossCause, MotionError, MotionId, Refusal, Report, ResetReason, State, ToDevice,
};

use crate::bench::{Bench, MOTION};
use crate::motions::limits;
use crate::plant::Plant;

#[test]
fn the_handshake_tells_scales_and_zero_positions() {
    let mut bench = Bench::new(Plant::doggy(3, 1));
    let hello = |bench: &mut Bench| {
        bench.send(&ToDevice::Hello(Greeting::OURS));
        bench.run(2);
        let hello = |report: &Report| if let Report::Hello(hello) = report { Some(hello.clone()) } else { None };
        bench.reports.iter().rev().find_map(hello).unwrap()
    };
    let before = hello(&mut bench);
    assert!(before.validate().is_ok() && before.identity.agrees(&Greeting::OURS));
    assert_eq!((before.identity.robot.as_str(), before.zero), ("bench", None));
    assert_eq!(bench.events(), [EventKind::Started(ResetReason::Unknown)]);

    bench.plant.joints[1].state = [0.01, 0.0, 0.01, 0.0];
    bench.run(20);
    bench.ask(Command::SetZero).unwrap();
    assert_eq!(hello(&mut bench).zero.unwrap(), [0, 68, 0], "0.01 rad are 68.6 counts");
}

#[test]
fn no_zero_is_taken_while_the_robot_moves() {
    let mut bench = Bench::new(Plant::doggy(3, 1));
    bench.run(20);
    bench.plant.joints[0].state[3] = 2.0;
    bench.plant.joints[0].state[1] = 2.0;
    bench.run(10);
    assert_eq!(bench.ask(Command::SetZero), Err(Refusal::NotQuiet));
    bench.run(2000);
    assert_eq!(bench.ask(Command::SetZero), Ok(()));
}

#[test]
fn nothing_starts_without_zero_motion_or_heartbeat() {
    let motion = preset::validation(&limits(2));
    let mut bench = Bench::new(Plant::doggy(2, 1));
    bench.run(20);
    assert_eq!(bench.start(), Err(Refusal::NoSuchMotion { asked: MOTION, there: MotionId::NONE }));
    bench.upload(&motion).unwrap();
    assert_eq!(bench.start(), Err(Refusal::NotZeroed));
    bench.ask(Command::SetZero).unwrap();
    let other = Command::Start { motion: MotionId(9), at_seq: None };
    assert_eq!(bench.ask(other), Err(Refusal::NoSuchMotion { asked: MotionId(9), there: MOTION }));
    let now = bench.core.control().next_seq();
    let late = bench.ask(Command::Start { motion: MOTION, at_seq: Some(now) });
    assert!(matches!(late, Err(Refusal::Late { asked, .. }) if asked == now), "{late:?}");
    bench.disturb.no_heartbeat = true;
    bench.run(120);
    assert_eq!(bench.start(), Err(Refusal::Fault(protocol::Fault::HeartbeatLost)));
    bench.disturb.no_heartbeat = false;
    bench.run(40);
    assert_eq!(bench.start(), Ok(()));
    assert_eq!(bench.start(), Err(Refusal::Running));
    assert_eq!(bench.ask(Command::SetZero), Err(Refusal::Running));
    assert_eq!(bench.upload(&motion), Err(Refusal::Running));
}

#[test]
fn a_bad_upload_is_refused_and_leaves_no_motion() {
    let good = preset::validation(&limits(2));
    let mut bench = Bench::ready(&good);
    assert_eq!(bench.status().motion, MOTION);

    let mut bad = good.clone();
    let move_to = bad.segments.iter().position(|s| matches!(s.action, Action::MoveTo { .. })).unwrap();
    if let Action::MoveTo { targets, .. } = &mut bad.segments[move_to].action {
        targets[1] = 0.61;
    }
    let segment = move_to as u8;
    let outside = MotionError::OutsideLimits { segment, joint: 1, position: 0.61 };
    assert_eq!(bench.upload(&bad), Err(Refusal::Motion(outside)));
    assert_eq!(bench.status().motion, MotionId::NONE, "the old motion was forgotten with the new one's beginning");
    assert!(matches!(bench.start(), Err(Refusal::NoSuchMotion { .. })));

    let mut other_robots = good.clone();
    other_robots.gain.truncate(1);
    assert_eq!(bench.upload(&other_robots), Err(Refusal::Motion(MotionError::Gains { got: 1, joints: 2 })));

    let mut endless = good.clone();
    endless.segments[0].action = Action::Zero { duration_ms: MAX_SEGMENT_MS };
    let _ = (1..12).map(|i| endless.segments[i].action = Action::Zero { duration_ms: MAX_SEGMENT_MS }).count();
    assert!(matches!(bench.upload(&endless), Err(Refusal::Motion(MotionError::TooLong { .. }))));

    assert_eq!(bench.upload(&good), Ok(()));
    assert_eq!(bench.start(), Ok(()));
}

#[test]
fn an_upload_keeps_order_and_checksum() {
    let motion = preset::validation(&limits(2));
    let mut bench = Bench::new(Plant::doggy(2, 1));
    bench.run(20);
    let part = |index: u8| Command::UploadSegment { index, segment: motion.segments[usize::from(index)].clone() };
    assert_eq!(bench.ask(part(0)), Err(Refusal::NoUpload));
    assert_eq!(bench.ask(Command::UploadEnd { checksum: 0 }), Err(Refusal::NoUpload));
    bench.ask(Command::UploadBegin { motion: MOTION, header: motion.header(), segments: 2 }).unwrap();
    assert_eq!(bench.ask(part(1)), Err(Refusal::UploadOrder { expected: 0, got: 1 }));
    bench.ask(part(0)).unwrap();
    bench.ask(part(0)).unwrap(); // The answer was lost; the host tries again under a new id.
    assert_eq!(bench.ask(Command::UploadEnd { checksum: 0 }), Err(Refusal::UploadOrder { expected: 1, got: 2 }));
    bench.ask(part(1)).unwrap();
    let wrong = bench.ask(Command::UploadEnd { checksum: 1 });
    assert!(matches!(wrong, Err(Refusal::Checksum { expected: 1, .. })), "{wrong:?}");
}

#[test]
fn a_repeated_request_is_answered_and_not_acted_on_again() {
    let motion = preset::validation(&limits(1));
    let mut bench = Bench::ready(&motion);
    bench.ask_as(200, Command::Start { motion: MOTION, at_seq: None }).unwrap();
    bench.run(100);
    let repeated = bench.ask_as(200, Command::Start { motion: MOTION, at_seq: None });
    assert_eq!(repeated, Ok(()), "the same answer, although a motion runs by now");
    assert!(matches!(bench.status().state, State::Running { phase: 0 }));
}

/// Another client than the project's host may use an id again: a stop is carried out all the same.
#[test]
fn a_stop_under_the_id_of_the_last_request_stops() {
    let mut bench = Bench::ready(&preset::validation(&limits(1)));
    bench.ask_as(77, Command::Start { motion: MOTION, at_seq: None }).unwrap();
    bench.run(6000);
    assert!(matches!(bench.status().state, State::Running { .. }));
    for _ in 0..2 {
        bench.ask_as(77, Command::Stop).unwrap();
        assert_eq!(bench.status().state, State::Idle);
        assert_eq!(bench.in_force[0], protocol::Duty::ZERO);
    }
    bench.ask_as(77, Command::ClearFault).unwrap();
    bench.ask_as(77, Command::Start { motion: MOTION, at_seq: None }).unwrap();
}

/// The host stops reading for 100 ms: the queue holds 10 samples, the other 90 are counted and told.
#[test]
fn what_the_line_does_not_take_is_counted() {
    let mut bench = Bench::ready(&preset::validation(&limits(1)));
    bench.run(10);
    let first = bench.samples.last().unwrap().seq + 11;
    bench.disturb.not_reading = true;
    bench.run(100);
    bench.disturb.not_reading = false;
    bench.read();
    bench.run(2);
    let loss = |report: &Report| if let Report::Loss(loss) = report { Some(*loss) } else { None };
    let told: Vec<Loss> = bench.reports.iter().filter_map(loss).collect();
    assert_eq!(told, [Loss { cause: LossCause::QueueFull, count: 90, first_seq: first, total: 90 }]);
    bench.ask(Command::Stream { on: false }).unwrap();
    let status = bench.status();
    let offered = status.end_seq - status.first_seq;
    assert_eq!(offered, bench.samples.len() as u32 + status.dropped, "the balance closes");
    assert_eq!(status.dropped, 90);
}

#[test]
fn the_stream_can_be_switched_and_ticks_are_counted_all_the_same() {
    let mut bench = Bench::new(Plant::doggy(1, 1));
    bench.run(50);
    assert!(bench.samples.is_empty());
    bench.ask(Command::Stream { on: true }).unwrap();
    bench.run(10);
    let first = bench.samples[0].seq;
    assert!((50..=51).contains(&first), "ticks before the stream have their numbers too: {first}");
    bench.ask(Command::Stream { on: false }).unwrap();
    let received = bench.samples.len();
    bench.run(20);
    assert_eq!(bench.samples.len(), received);
    let status = bench.status();
    assert_eq!((status.first_seq, status.end_seq - status.first_seq), (first, received as u32));
}
