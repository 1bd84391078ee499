//! Recordings of scripted devices: what is in the file, whatever happened.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

use protocol::hello::PanicPlace;
use protocol::motion::Header;
use protocol::units::text;
use protocol::{Action, Event, EventKind, Fault, Motion, MotionEnd, MotionError, Report, ResetReason, Segment};
use tempfile::TempDir;

use super::firmware::{elf, late, started};
use super::open;
use super::peer::{Doggy, Peer, Script, Wire};
use crate::link::{CaptureError, Captured, Dictionary, LinkError, LogCounts, News, Progress, Ready, ScaleError, Zero};
use crate::recording::{self, LogLevel, Recording};
use crate::robot::Robot;

fn motion() -> Motion {
    let mut motion = Motion::new(Header {
        name: text("trial"),
        stages: [text("rest")].into_iter().collect(),
        gain: [1.0; 3].into_iter().collect(),
    });
    motion.segments.push(Segment { stage: 0, action: Action::Zero { duration_ms: 500 } }).unwrap();
    motion
}

/// A recording of a peer: how it ended, and what is in the file.
struct Trial {
    outcome: Result<Captured, CaptureError>,
    path: PathBuf,
    _folder: TempDir,
}

impl Trial {
    fn of(peer: &Peer, stop: &AtomicBool, mut watch: impl FnMut(&Progress<'_>)) -> Self {
        Self::with(
            peer,
            stop,
            |ready| ready,
            |news| {
                if let News::Progress(now) = news {
                    watch(&now)
                }
            },
        )
    }

    /// With what is to be asked for between the preparation and the motion.
    fn with(
        peer: &Peer,
        stop: &AtomicBool,
        ask: impl for<'r> FnOnce(Ready<'r>) -> Ready<'r>,
        tell: impl FnMut(News<'_>),
    ) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.mcap");
        let mut device = open(peer).unwrap();
        let robot = Robot::builtin("doggy").unwrap();
        let motion = motion();
        let outcome = Ready::prepare(&mut device, &robot, &motion, toml::to_string(&motion).unwrap(), Zero::Keep)
            .and_then(|ready| ask(ready).run(File::create_new(&path).unwrap(), stop, tell));
        Self { outcome, path, _folder: folder }
    }

    fn plain(peer: &Peer) -> Self {
        Self::of(peer, &AtomicBool::new(false), |_| {})
    }

    fn recording(&self) -> Recording {
        recording::read(&self.path).unwrap()
    }
}

#[test]
fn a_motion_is_recorded_from_its_first_tick_to_its_last() {
    let peer = Peer::start(Doggy::default());
    let mut stages = Vec::new();
    let trial = Trial::of(&peer, &AtomicBool::new(false), |now| {
        stages.extend(now.stage.map(str::to_owned));
        assert!(now.per_mille() <= 1000 && now.total_s == 0.5);
    });
    let captured = trial.outcome.as_ref().unwrap();
    let recording = trial.recording();
    assert_eq!(recording.len() as u64, captured.samples);
    assert_eq!(recording.missing_ticks(), 0);
    assert!(recording.damage.is_empty());
    assert_eq!(recording.balance, Some(captured.balance));
    assert!(captured.balance.closed && captured.balance.missing == 0, "{captured:?}");
    assert_eq!(captured.refused, 0);
    assert_eq!(recording.phase.iter().filter(|phase| **phase == 0).count(), 500);
    assert!(recording.phase.iter().rev().take(250).all(|phase| *phase == recording::NO_PHASE), "the tail");
    assert!(recording.duty[0].iter().all(|u| *u == 0.15));
    let firmware = recording.firmware.as_ref().unwrap();
    assert_eq!((firmware.version.as_str(), firmware.robot.as_str()), ("0.1.0", "doggy"));
    assert!(firmware.details.contains("\"counts_per_turn\":1024"), "{}", firmware.details);
    assert_eq!(recording.zero_rad.len(), 3);
    assert_eq!(toml::from_str::<Motion>(&recording.motion.as_ref().unwrap().toml).unwrap(), motion());
    assert!(recording.events.iter().any(|e| e.text == "motion finished"), "{:?}", recording.events);
    assert!(stages.contains(&"rest".to_owned()), "{stages:?}");
}

#[test]
fn a_motion_starts_in_the_tick_that_was_asked_for() {
    // Farther ahead than a start may take to be seen, and over the wrap of the counter.
    let leash = Some(500);
    let peer = Peer::start(Doggy { seq: u32::MAX - 3000, samples_per_tick: 4, leash, ..Doggy::default() });
    let mut waited = Vec::new();
    let never = AtomicBool::new(false);
    fn at(ready: Ready<'_>) -> Ready<'_> {
        ready.starting_at(1000)
    }
    let trial = Trial::with(&peer, &never, at, |news| {
        if let News::Progress(now) = news {
            waited.extend(now.starts_in_ticks);
        }
    });
    trial.outcome.as_ref().unwrap();
    let recording = trial.recording();
    let first = recording.phase.iter().position(|phase| *phase == 0).unwrap();
    assert_eq!(recording.seq[first], (1 << 32) + 1000);
    assert!(first > 2000, "only {first} samples before the start");
    assert!(waited.first() > waited.last() && waited[0] < 4001, "{waited:?}");

    let peer = Peer::start(Doggy { seq: 5000, ..Doggy::default() });
    let trial = Trial::with(&peer, &never, at, |_| {});
    let error = trial.outcome.unwrap_err();
    assert!(error.to_string().contains("tick 1000 is not ahead of tick"), "{error}");
    assert!(error.advice().contains("--start-tick"), "{}", error.advice());
}

/// A device with this log, in pieces of two bytes of which some are lost.
fn logging(stream: &[u8], lost: &[usize]) -> Doggy {
    let mut doggy = Doggy::default();
    doggy.hello.code_crc = Some(protocol::frame::crc32(b"code"));
    let piece = |(k, bytes): (usize, &[u8])| Report::Defmt { at: 2 * k as u32, bytes: bytes.iter().copied().collect() };
    let pieces = stream.chunks(2).enumerate().filter(|(k, _)| !lost.contains(k));
    doggy.reports = pieces.map(piece).collect();
    doggy
}

#[test]
fn the_firmware_s_log_is_told_and_kept_in_device_time() {
    // The clock wraps 101 ms after the stream begins; the start was 50 ms before.
    let begin_us = (u32::MAX - 100).wrapping_mul(1000).wrapping_sub(50_000);
    let stream = [vec![0], started(begin_us, "doggy", 5), late(2000, 1), late(3000, 2), late(4000, 3)].concat();
    fn read(ready: Ready<'_>) -> Ready<'_> {
        ready.reading_log(Dictionary::parse(&elf(b"code"), Path::new("firmware")).unwrap())
    }
    let mut told = Vec::new();
    let tell = |news: News<'_>| {
        if let News::Log(line) = news {
            told.push(line.clone());
        }
    };
    // A piece out of the middle of the second line.
    let lost = (1 + started(begin_us, "doggy", 5).len() + 3) / 2;
    let trial = Trial::with(&Peer::start(logging(&stream, &[lost])), &AtomicBool::new(false), read, tell);
    let log = trial.outcome.as_ref().unwrap().log;
    assert_eq!(log, LogCounts { lines: 3, lost_bytes: 2, unread_frames: 1 });
    let recording = trial.recording();
    assert_eq!(recording.log, told);
    let said: Vec<_> = told.iter().map(|line| (line.t_us, line.level, line.message.as_str())).collect();
    let expected = [
        (u64::from(begin_us), LogLevel::Info, "started: doggy, 5 parts"),
        ((1 << 32) + 3000, LogLevel::Warn, "gyro 2 answers late"),
        ((1 << 32) + 4000, LogLevel::Warn, "gyro 3 answers late"),
    ];
    assert_eq!(said, expected);
}

#[test]
fn a_log_that_nobody_reads_is_told_once() {
    let stream = [vec![0], late(2000, 1), late(3000, 2), late(4000, 3)].concat();
    let mut unread = 0;
    let tell = |news: News<'_>| unread += u32::from(matches!(news, News::LogUnread));
    let trial = Trial::with(&Peer::start(logging(&stream, &[])), &AtomicBool::new(false), |ready| ready, tell);
    assert_eq!((trial.outcome.unwrap().log, unread), (LogCounts::default(), 1));
}

#[test]
fn how_the_device_started_is_in_the_file() {
    /// Its first event is still on the line when the host connects.
    struct Fresh(Doggy);
    impl Script for Fresh {
        fn hear(&mut self, message: &protocol::ToDevice, out: &mut Wire) {
            if let protocol::ToDevice::Hello(_) = message {
                let kind = EventKind::Started(self.0.hello.reset);
                out.report(&Report::Event(Event { seq: 0, t_us: 0, kind }));
            }
            self.0.hear(message, out);
        }
        fn tick(&mut self, out: &mut Wire) {
            self.0.tick(out);
        }
    }
    let started = |reset, panic| {
        let mut doggy = Doggy::default();
        (doggy.hello.reset, doggy.hello.panic) = (reset, panic);
        let recording = Trial::plain(&Peer::start(Fresh(doggy))).recording();
        assert!(recording.events.iter().all(|event| !event.text.contains("started:")), "{:?}", recording.events);
        recording.firmware.unwrap().restarted_by
    };
    assert_eq!(started(ResetReason::PowerOn, None), None);
    let place = PanicPlace { file: text("src/main.rs"), line: 7 };
    assert_eq!(started(ResetReason::Panic, Some(place)).unwrap(), "a panic of the firmware at src/main.rs:7");
    assert!(started(ResetReason::Watchdog, None).unwrap().contains("watchdog"));
}

#[test]
fn losses_on_the_way_are_in_the_file_s_balance() {
    let fate = |seq: u32, frame: &mut Vec<u8>| {
        match seq % 32 {
            5 => return false,
            9 => frame[30] ^= 0x08,
            _ => {}
        }
        true
    };
    let peer = Peer::start(Doggy { fate: Box::new(fate), ..Doggy::default() });
    let trial = Trial::plain(&peer);
    let captured = trial.outcome.as_ref().unwrap();
    let recording = trial.recording();
    let balance = recording.balance.unwrap();
    assert_eq!(balance, captured.balance);
    assert_eq!(balance.received, recording.len() as u64);
    // Each fault hits one tick in 32; the stream begins and ends anywhere.
    for lost in [balance.device_dropped, balance.line_lost, balance.damaged_frames] {
        assert!(lost.abs_diff(balance.ticks / 32) <= 1, "{balance:?}");
    }
    assert_eq!(recording.segments().len() as u64, recording.missing_ticks() + 1);
}

#[test]
fn a_fault_ends_the_recording_with_its_reason() {
    let end = MotionEnd::Fault(Fault::JointLimit { joint: 1 });
    let peer = Peer::start(Doggy { motion_end: end, ..Doggy::default() });
    let trial = Trial::plain(&peer);
    let error = trial.outcome.as_ref().unwrap_err();
    assert!(matches!(error, CaptureError::Stopped { phase: 1, segments: 1, .. }), "{error:?}");
    assert!(error.to_string().contains("joint 2 is beyond its limit"), "{error}");
    let recording = trial.recording();
    assert!(recording.balance.unwrap().closed && recording.len() > 500);
    assert!(recording.events.iter().any(|e| e.text.contains("joint 2")));
}

#[test]
fn a_wish_to_stop_stops_the_robot_and_closes_the_file() {
    let peer = Peer::start(Doggy { motion_ticks: u32::MAX, ..Doggy::default() });
    let stop = AtomicBool::new(false);
    let trial = Trial::of(&peer, &stop, |_| stop.store(true, Relaxed));
    assert!(matches!(trial.outcome, Err(CaptureError::Interrupted)), "{:?}", trial.outcome);
    let recording = trial.recording();
    let balance = recording.balance.unwrap();
    assert!(recording.damage.is_empty() && balance.closed);
    assert_eq!((balance.missing, balance.received), (0, recording.len() as u64));
    assert!(recording.events.iter().any(|e| e.text == "motion stopped by the host"), "{:?}", recording.events);
}

#[test]
fn an_unplugged_device_leaves_what_it_sent() {
    struct Unplugged(Doggy);
    impl Script for Unplugged {
        fn hear(&mut self, message: &protocol::ToDevice, out: &mut Wire) {
            self.0.hear(message, out);
        }
        fn tick(&mut self, out: &mut Wire) {
            let is_last = self.0.playing.is_some_and(|first| self.0.seq.wrapping_sub(first) > 300);
            if !is_last {
                self.0.tick(out);
            } else if self.0.worked_off.wrapping_add(1) == self.0.seq {
                // What nobody has read yet would be lost with a pseudo-terminal.
                std::panic::resume_unwind(Box::new("unplugged"));
            }
        }
    }
    let peer = Peer::start(Unplugged(Doggy::default()));
    let trial = Trial::plain(&peer);
    assert!(matches!(trial.outcome, Err(CaptureError::Link(LinkError::Gone { .. }))), "{:?}", trial.outcome);
    let recording = trial.recording();
    assert!(recording.len() >= 300 && !recording.balance.unwrap().closed, "{}", recording.len());
}

#[test]
fn a_device_that_falls_silent_is_given_up() {
    let fate = |seq: u32, frame: &mut Vec<u8>| {
        if seq < u32::MAX / 2 && seq > 100 {
            frame.clear();
        }
        true
    };
    // It does not wait for the host, but for the stream.
    let leash = Some(i32::MAX as u32);
    let peer = Peer::start(Doggy { fate: Box::new(fate), motion_ticks: u32::MAX, leash, ..Doggy::default() });
    let trial = Trial::plain(&peer);
    assert!(matches!(trial.outcome, Err(CaptureError::Link(LinkError::Silent { .. }))), "{:?}", trial.outcome);
    let balance = trial.recording().balance.unwrap();
    // Two seconds of them; fewer where the machine was busy.
    assert!(balance.closed && balance.line_lost > 200, "{balance:?}");
}

#[test]
fn nothing_moves_without_zero_or_with_a_motion_that_does_not_fit() {
    let mut doggy = Doggy::default();
    doggy.hello.zero = None;
    let peer = Peer::start(doggy);
    let trial = Trial::plain(&peer);
    assert!(matches!(trial.outcome, Err(CaptureError::Scale(ScaleError::NotZeroed))));
    assert!(!trial.path.exists());

    let peer = Peer::start(Doggy::default());
    let mut device = open(&peer).unwrap();
    let mut motion = motion();
    motion.gain.truncate(2);
    let robot = Robot::builtin("doggy").unwrap();
    let error = Ready::prepare(&mut device, &robot, &motion, String::new(), Zero::Set).map(drop).unwrap_err();
    assert!(
        matches!(error, CaptureError::Motion { source: MotionError::Gains { got: 2, joints: 3 }, .. }),
        "{error:?}"
    );
}
