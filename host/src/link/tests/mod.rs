//! The link against scripted devices behind pseudo-terminals.

mod capture;
pub mod firmware;
pub mod peer;

use std::sync::Arc;
use std::time::{Duration, Instant};

use protocol::hello::SchemaKey;
use protocol::motion::Header;
use protocol::units::text;
use protocol::{
    Action, Command, Event, EventKind, Flags, Motion, MotionId, Refusal, Report, ResetReason, Sample, Segment,
    ToDevice, message::Level,
};

use self::peer::{Doggy, Peer, Script, Wire, doggy};
use super::{Arrival, Device, LinkError, Options, ScaleError, Scales};
use crate::robot::Robot;

fn open(peer: &Peer) -> Result<Device, LinkError> {
    Device::open(&peer.path, &Options { greetings: 3, ..Options::default() })
}

/// For what must come: a busy machine may stand still for a while, a broken program never sends it.
const PATIENCE: Duration = Duration::from_secs(10);

/// The requests among messages.
fn requests(heard: Vec<ToDevice>) -> Vec<(u8, Command)> {
    let request = |message| match message {
        ToDevice::Request { id, command } => Some((id, command)),
        _ => None,
    };
    heard.into_iter().filter_map(request).collect()
}

/// Takes `n` samples and whatever comes between them.
fn take(device: &Device, n: usize) -> (Vec<u64>, Vec<Arrival>) {
    let (mut seqs, mut rest) = (Vec::new(), Vec::new());
    while seqs.len() < n {
        match device.next(PATIENCE).unwrap().expect("samples come") {
            Arrival::Sample { seq, t_us, sample } => {
                assert_eq!((seq as u32, t_us as u32), (sample.seq, sample.t_us));
                seqs.push(seq);
            }
            other => rest.push(other),
        }
    }
    (seqs, rest)
}

#[test]
fn a_stream_arrives_whole_with_unwrapped_numbers() {
    let peer = Peer::start(Doggy::default());
    let mut device = open(&peer).unwrap();
    assert_eq!(device.hello(), &doggy());
    device.settle().unwrap();
    device.stream().unwrap();
    // The counter wraps within the first 101 ticks.
    let (seqs, _) = take(&device, 300);
    assert!(seqs.windows(2).all(|w| w[1] == w[0] + 1), "{seqs:?}");
    device.end_stream().unwrap();
    while device.next(Duration::ZERO).unwrap().is_some() {}
    let balance = device.balance();
    assert!(balance.closed && balance.ticks >= 300, "{balance:?}");
    assert_eq!((balance.missing, balance.damaged_frames), (0, 0));
}

#[test]
fn the_balance_is_exact_whatever_happens_on_the_way() {
    // Of 16 samples the device drops one, the line loses one and damages one. The last frames of the stream are lost
    // as well: only the device's closing account tells of them.
    let fate = |seq: u32, frame: &mut Vec<u8>| {
        match seq % 16 {
            3 => return false,
            7 => frame.clear(),
            11 => frame[20] ^= 0x40,
            _ => {}
        }
        true
    };
    let peer = Peer::start(Doggy { fate: Box::new(fate), samples_per_tick: 4, ..Doggy::default() });
    let mut device = open(&peer).unwrap();
    device.settle().unwrap();
    device.stream().unwrap();
    take(&device, 2000);
    let status = device.end_stream().unwrap();
    while device.next(Duration::ZERO).unwrap().is_some() {}
    let balance = device.balance();
    let seqs = (0..balance.ticks as u32).map(|k| status.first_seq.wrapping_add(k));
    let count = |rest| seqs.clone().filter(|seq| seq % 16 == rest).count() as u64;
    assert!(balance.closed && balance.ticks > 2000, "{balance:?}");
    assert_eq!(balance.device_dropped, count(3));
    assert_eq!(balance.line_lost, count(7) + count(11));
    // A flipped byte is one damaged frame unless it becomes the delimiter or was the code byte; 0x40 at byte 20 is neither.
    assert_eq!(balance.damaged_frames, count(11));
    assert_eq!(balance.host_dropped, 0);
    assert_eq!(balance.missing, count(3) + count(7) + count(11));
}

#[test]
fn a_full_queue_costs_samples_and_counts_them() {
    let peer = Peer::start(Doggy { samples_per_tick: 8, ..Doggy::default() });
    let mut device = Device::open(&peer.path, &Options { queue: 50, ..Options::default() }).unwrap();
    device.settle().unwrap();
    device.stream().unwrap();
    let until = Instant::now() + PATIENCE;
    while device.balance().host_dropped < 100 {
        // Nobody takes them.
        assert!(Instant::now() < until, "{:?}", device.balance());
        std::thread::sleep(Duration::from_millis(5));
    }
    device.end_stream().unwrap();
    let mut taken = 0;
    while device.next(Duration::ZERO).unwrap().is_some() {
        taken += 1;
    }
    let balance = device.balance();
    assert_eq!((taken, balance.received), (50, 50));
    assert_eq!(balance.host_dropped, balance.ticks - 50);
    assert_eq!((balance.line_lost, balance.device_dropped), (0, 0));
}

#[test]
fn samples_of_an_earlier_session_are_not_counted() {
    let left_running = Doggy { streaming: true, first_seq: 1, seq: 5000, ..Doggy::default() };
    let peer = Peer::start(left_running);
    let mut device = open(&peer).unwrap();
    device.settle().unwrap();
    device.stream().unwrap();
    let (seqs, _) = take(&device, 50);
    let status = device.end_stream().unwrap();
    assert_eq!(seqs[0] as u32, status.first_seq);
    while device.next(Duration::ZERO).unwrap().is_some() {}
    assert_eq!(device.balance().missing, 0);
}

#[test]
fn a_lost_answer_is_asked_for_again_and_only_what_may_be_is_done_twice() {
    let doggy = Doggy { lost_answers: 2, ..Doggy::default() };
    let acted = Arc::clone(&doggy.acted);
    let peer = Peer::start(doggy);
    let mut device = open(&peer).unwrap();
    let mut motion = Motion::new(Header {
        name: text("trial"),
        stages: [text("rest")].into_iter().collect(),
        gain: [1.0; 3].into_iter().collect(),
    });
    motion.segments.push(Segment { stage: 0, action: Action::Zero { duration_ms: 10 } }).unwrap();
    device.upload(MotionId(1), &motion).unwrap();
    // A busy machine may ask once more than the losses make necessary; for nothing else meanwhile.
    let sent: Vec<_> = requests(peer.finish()).into_iter().map(|(id, _)| id).collect();
    assert!(sent.is_sorted(), "{sent:?}");
    for id in [1, 2, 3] {
        assert!(sent.iter().filter(|sent| **sent == id).count() >= 3, "request {id} in {sent:?}");
    }
    let mut acted = acted.lock().unwrap().clone();
    assert_eq!(acted.iter().filter(|command| matches!(command, Command::UploadEnd { .. })).count(), 1, "{acted:?}");
    // The parts of an upload may be, one after the other.
    acted.dedup();
    assert!(
        matches!(
            acted[..],
            [Command::UploadBegin { .. }, Command::UploadSegment { index: 0, .. }, Command::UploadEnd { .. }]
        ),
        "{acted:?}"
    );
}

#[test]
fn heartbeats_go_on_while_nobody_takes_the_samples() {
    let peer = Peer::start(Doggy::default());
    let mut device = open(&peer).unwrap();
    device.settle().unwrap();
    device.stream().unwrap();
    let begin = Instant::now();
    let mut beats = Vec::new();
    while beats.len() < 30 {
        if let ToDevice::Heartbeat(_) = peer.heard.recv_timeout(PATIENCE).expect("heartbeats go on") {
            beats.push(begin.elapsed());
        }
    }
    // One every 20 ms, by this clock or by the device's: 0.58 s. A busy machine takes longer, and stands still now and then: the
    // median tells that they come well within the device's patience of 100 ms.
    let mut gaps: Vec<_> = beats.windows(2).map(|w| w[1] - w[0]).collect();
    gaps.sort();
    assert!(beats[29] > Duration::from_millis(250), "30 beats in {:?}", beats[29]);
    assert!(gaps[14] < Duration::from_millis(60), "{gaps:?}");
}

#[test]
fn a_stop_lets_no_start_follow() {
    let peer = Peer::start(Doggy::default());
    let mut device = open(&peer).unwrap();
    let stopper = device.stopper();
    std::thread::spawn(move || stopper.stop()).join().unwrap();
    assert!(matches!(device.start(MotionId(1), None), Err(LinkError::Stopping { .. })));
    device.stop().unwrap();
    let heard = requests(peer.finish());
    assert!(heard.len() >= 2 && heard.iter().all(|(_, command)| *command == Command::Stop), "{heard:?}");
}

#[test]
fn a_dropped_device_is_told_to_stop() {
    let peer = Peer::start(Doggy::default());
    drop(open(&peer).unwrap());
    let heard = peer.finish();
    assert!(matches!(heard.last(), Some(ToDevice::Request { command: Command::Stop, .. })), "{heard:?}");
}

/// Answers a greeting with one report and nothing else with anything.
struct Answering(Option<Report>);

impl Script for Answering {
    fn hear(&mut self, message: &ToDevice, out: &mut Wire) {
        match (message, &self.0) {
            (ToDevice::Hello(_), Some(report)) => out.report(report),
            (ToDevice::Hello(_), None) => {}
            (ToDevice::Request { id, .. }, _) => {
                out.report(&Report::Refused { id: *id, refusal: Refusal::NotZeroed });
            }
            _ => {}
        }
    }
}

#[test]
fn another_version_is_refused_with_both_sides_printed() {
    let mut hello = doggy();
    hello.identity.protocol_version = 77;
    hello.identity.schema_key = SchemaKey([0xab; 8]);
    let peer = Peer::start(Answering(Some(Report::Hello(hello))));
    let error = open(&peer).map(drop).unwrap_err();
    let said = error.to_string();
    for part in ["protocol 77", "abababababababab", "firmware 0.1.0", "robot doggy", &SchemaKey::OURS.to_string()] {
        assert!(said.contains(part), "{part} is not in: {said}");
    }
    assert!(error.advice().contains("flash"));
}

#[test]
fn a_handshake_that_contradicts_itself_is_refused() {
    let mut hello = doggy();
    hello.encoders.pop();
    let peer = Peer::start(Answering(Some(Report::Hello(hello))));
    assert!(matches!(open(&peer).map(drop), Err(LinkError::Hello(_))));
}

#[test]
fn silence_noise_and_a_missing_port_are_told_apart() {
    let peer = Peer::start(Answering(None));
    let silent = open(&peer).map(drop).unwrap_err();
    assert!(matches!(silent, LinkError::NoAnswer { bytes: 0, .. }), "{silent}");
    assert!(silent.advice().contains("switched on"));

    struct Noise;
    impl Script for Noise {
        fn hear(&mut self, _: &ToDevice, _: &mut Wire) {}
        fn tick(&mut self, out: &mut Wire) {
            out.0.extend(b"Welcome to the bootloader\0");
        }
    }
    let peer = Peer::start(Noise);
    let noise = open(&peer).map(drop).unwrap_err();
    assert!(matches!(noise, LinkError::NoAnswer { frames: 0, damaged: 1.., .. }), "{noise}");
    assert!(noise.advice().contains("--baud"));

    let missing = Device::open("/dev/no-such-port", &Options::default()).map(drop).unwrap_err();
    assert!(matches!(missing, LinkError::Open { .. }) && missing.advice().contains("host ports"), "{missing}");
}

#[test]
fn a_refusal_and_a_deaf_device_are_told_apart() {
    let peer = Peer::start(Answering(Some(Report::Hello(doggy()))));
    let mut device = open(&peer).unwrap();
    let refused = device.start(MotionId(1), None).unwrap_err();
    assert!(refused.to_string().contains("zero") && refused.advice().contains("--set-zero"), "{refused}");

    struct Deaf;
    impl Script for Deaf {
        fn hear(&mut self, message: &ToDevice, out: &mut Wire) {
            if let ToDevice::Hello(_) = message {
                out.report(&Report::Hello(doggy()));
            }
        }
    }
    let peer = Peer::start(Deaf);
    let mut device = open(&peer).unwrap();
    assert!(matches!(device.start(MotionId(1), None), Err(LinkError::Unanswered { .. })));
}

#[test]
fn an_unplugged_device_is_gone_after_what_it_sent() {
    let peer = Peer::start(Doggy::default());
    let mut device = open(&peer).unwrap();
    device.settle().unwrap();
    device.stream().unwrap();
    take(&device, 20);
    drop(peer);
    let until = Instant::now() + PATIENCE;
    let error = loop {
        match device.next(Duration::from_millis(100)) {
            Err(error) => break error,
            Ok(_) => assert!(Instant::now() < until, "nobody noticed"),
        }
    };
    assert!(matches!(error, LinkError::Gone { .. }), "{error}");
    assert!(matches!(device.stop(), Err(LinkError::Gone { .. })));
    assert!(!device.balance().closed);
}

#[test]
fn a_restart_in_the_middle_ends_the_stream_with_its_reason() {
    struct Restarting(Doggy, bool);
    impl Script for Restarting {
        fn hear(&mut self, message: &ToDevice, out: &mut Wire) {
            self.0.hear(message, out);
        }
        fn tick(&mut self, out: &mut Wire) {
            self.0.tick(out);
            if self.0.streaming && !self.1 && self.0.seq.wrapping_sub(self.0.first_seq) > 50 {
                self.1 = true;
                out.report(&Report::Log { level: Level::Warn, text: text("brown-out") });
                let kind = EventKind::Started(ResetReason::Watchdog);
                out.report(&Report::Event(Event { seq: 0, t_us: 0, kind }));
            }
        }
    }
    let peer = Peer::start(Restarting(Doggy::default(), false));
    let mut device = open(&peer).unwrap();
    device.settle().unwrap();
    device.stream().unwrap();
    let mut log = None;
    let error = loop {
        match device.next(PATIENCE) {
            Ok(Some(Arrival::Log { text, .. })) => log = Some(text),
            Ok(arrival) => assert!(arrival.is_some(), "nobody noticed"),
            Err(error) => break error,
        }
    };
    assert_eq!(log.as_deref(), Some("brown-out"));
    assert!(error.to_string().contains("watchdog"), "{error}");
}

#[test]
fn raw_codes_become_si() {
    let robot = Robot::builtin("doggy").unwrap();
    let mut scales = Scales::new(&doggy(), &robot).unwrap();
    let per_count = std::f64::consts::TAU / (1024.0 * 42.092);
    let mut sample = Sample { phase: 4, flags: Flags::RUNNING, execution: 10, jitter_us: -3, ..Sample::default() };
    sample.encoders[..3].copy_from_slice(&[1000, i32::MIN, 70_000]);
    sample.gyros = [[52, -23, 32_767], [1, i16::MIN, 0]];
    sample.duty[..2].copy_from_slice(&[protocol::Duty(1500), protocol::Duty(-9000)]);
    let row = scales.row(7, 7000, &sample);
    assert_eq!((row.seq, row.t_us, row.phase), (7, 7000, 4));
    assert_eq!((row.tick.flags, row.tick.execution_us, row.tick.jitter_us), (2, 40.0, -3.0));
    assert_eq!(row.duty, [0.15, -0.9, 0.0]);
    // rtol 1e-15: one multiplication.
    let close = |a: f64, b: f64| (a - b).abs() <= 1e-15 * b.abs();
    assert!(close(row.values[0], 1005.0 * per_count), "{}", row.values[0]);
    assert!(close(row.values[1], -2_147_483_648.0 * per_count), "{}", row.values[1]);
    assert_eq!(row.values[2], 0.0);
    assert!(close(row.values[3], 0.052) && close(row.values[4], -0.023), "{:?}", row.values);
    assert!(row.values[5].is_nan() && row.values[7].is_nan(), "saturated axes have no reading");
    assert_eq!((row.values[6], row.values[8]), (0.001, 0.0));

    sample.flags = Flags::GYRO2_STALE;
    let nan: Vec<bool> = scales.row(8, 8000, &sample).values.iter().map(|v| v.is_nan()).collect();
    assert_eq!(nan, [false, false, false, false, false, true, true, true, true]);
    sample.flags = Flags::ENCODER_STALE;
    assert!(scales.row(9, 9000, &sample).values[..3].iter().all(|v| v.is_nan()));
    assert!(close(scales.zero()[2], 70_000.0 * per_count));
}

#[test]
fn a_description_of_another_robot_is_refused() {
    let robot = Robot::builtin("doggy").unwrap();
    let other = |change: fn(&mut protocol::Hello)| {
        let mut hello = doggy();
        change(&mut hello);
        Scales::new(&hello, &robot).map(drop).unwrap_err()
    };
    assert_eq!(other(|h| h.zero = None), ScaleError::NotZeroed);
    let gear = other(|h| h.encoders[1].gear = 40.0);
    assert!(gear.to_string().contains("40 on the device and 42.092"), "{gear}");
    assert!(matches!(other(|h| h.tick_us = 500), ScaleError::Differs { .. }));
    assert!(matches!(other(|h| h.encoders[2].counts_per_turn = 4096), ScaleError::Differs { .. }));
    assert!(matches!(other(|h| h.gyros[1].offset_us = 40), ScaleError::Differs { .. }));
    assert!(matches!(other(|h| h.gyros.truncate(1)), ScaleError::Missing { .. }));
    let arm = Robot::builtin("one_joint").unwrap();
    assert!(matches!(Scales::new(&doggy(), &arm), Err(ScaleError::Count { what: "joints", device: 3, .. })));
}
