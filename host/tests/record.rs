//! Stories of `host record`: the binary against a scripted device behind a pseudo-terminal. They run in real time, beside no others.

#[path = "../src/link/tests/firmware.rs"]
#[allow(dead_code, reason = "the link's own tests use the rest of it")]
mod firmware;
#[path = "../src/link/tests/peer.rs"]
#[allow(dead_code, reason = "the link's own tests use the rest of it")]
mod peer;

use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Child, Command as Process, Output, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};
use std::time::{Duration, Instant};

use host::recording;
use peer::{Doggy, Peer, Script, Wire, doggy};
use protocol::hello::PanicPlace;
use protocol::{Command, Report, ResetReason, ToDevice};

/// Ticks that a device may be ahead of the host.
const LEASH: u32 = 150;

/// A folder, and a recording to be made in it.
struct Desk {
    folder: tempfile::TempDir,
}

impl Desk {
    fn new() -> Self {
        Self { folder: tempfile::tempdir().unwrap() }
    }

    fn file(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn record(&self, port: &str, more: &[&str]) -> Process {
        let mut host = Process::new(env!("CARGO_BIN_EXE_host"));
        host.args(["record", "--port", port, "-o"]).arg(self.file("run.mcap")).args(more);
        host.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        host
    }

    /// A motion of half a second, for the scripted device.
    fn short_motion(&self) -> String {
        let path = self.file("short.toml");
        let motion = "name = \"short\"\nstages = [\"rest\"]\ngain = [1.0, 1.0, 1.0]\n\n[[segments]]\nstage = 0\n\
                      action.zero = { duration_ms = 500 }\n";
        std::fs::write(&path, motion).unwrap();
        path.to_str().unwrap().to_owned()
    }
}

/// Exit code and what was said.
fn ended(output: Output) -> (i32, String) {
    (output.status.code().unwrap_or(-1), String::from_utf8(output.stderr).unwrap())
}

fn interrupt(child: &Child) {
    assert!(Process::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
}

#[test]
fn a_motion_is_recorded_and_the_losses_are_told() {
    let peer = Peer::start(Doggy { leash: Some(LEASH), ..Doggy::default() });
    let desk = Desk::new();
    let (code, said) = ended(desk.record(&peer.path, &["--motion", &desk.short_motion()]).output().unwrap());
    assert_eq!(code, 0, "{said}");
    assert!(said.contains("0 lost") && said.contains("doggy, firmware 0.1.0"), "{said}");
    let recording = recording::read(&desk.file("run.mcap")).unwrap();
    assert!(recording.len() >= 750 && recording.missing_ticks() == 0, "{}", recording.len());

    // A second time nothing is overwritten, and the device is not even asked.
    while peer.heard.try_recv().is_ok() {}
    let before = std::fs::read(desk.file("run.mcap")).unwrap();
    let (code, said) = ended(desk.record(&peer.path, &[]).output().unwrap());
    assert_eq!(code, 2, "{said}");
    assert!(said.contains("--force"), "{said}");
    assert_eq!(std::fs::read(desk.file("run.mcap")).unwrap(), before);
    assert!(peer.heard.try_recv().is_err());
}

#[test]
fn what_cannot_work_says_what_to_do_and_leaves_no_file() {
    struct Silent;
    impl Script for Silent {
        fn hear(&mut self, _: &ToDevice, _: &mut Wire) {}
    }
    struct Stranger;
    impl Script for Stranger {
        fn hear(&mut self, _: &ToDevice, out: &mut Wire) {
            let mut hello = doggy();
            hello.identity.protocol_version = 77;
            out.report(&Report::Hello(hello));
        }
    }
    let mut unzeroed = Doggy::default();
    unzeroed.hello.zero = None;
    let (silent, stranger, unzeroed) = (Peer::start(Silent), Peer::start(Stranger), Peer::start(unzeroed));
    let unknown = Peer::start(Doggy {
        hello: {
            let mut h = doggy();
            h.identity.robot = protocol::units::text("rover");
            h
        },
        ..Doggy::default()
    });

    let past = Peer::start(Doggy { seq: 5000, ..Doggy::default() });

    let desk = Desk::new();
    let typo = desk.file("typo.toml");
    std::fs::write(&typo, "name = \"typo\"\nstagse = []\n").unwrap();
    for (port, more, code, parts) in [
        ("/dev/no-such-port", vec![], 3, vec!["/dev/no-such-port", "host ports"]),
        (&silent.path, vec![], 3, vec!["does not answer", "switched on"]),
        (&stranger.path, vec![], 3, vec!["protocol 77", "protocol 1,", "flash the firmware"]),
        (&unzeroed.path, vec![], 3, vec!["zero positions", "--set-zero"]),
        (&unknown.path, vec![], 2, vec!["rover", "--robot"]),
        (&unzeroed.path, vec!["--set-zero", "--robot", "one_joint"], 4, vec!["one_joint", "--robot"]),
        (&unzeroed.path, vec!["--motion", "no/such/motion.toml"], 3, vec!["no/such/motion.toml", "calibration"]),
        (&unzeroed.path, vec!["--motion", typo.to_str().unwrap()], 4, vec!["stagse"]),
        (&unzeroed.path, vec!["--baud", "115200"], 2, vec!["115200 baud", "--baud"]),
        (&unzeroed.path, vec!["--baud", "0"], 2, vec!["0 is not in 1200..=20000000", "--baud"]),
        (&past.path, vec!["--start-tick", "1000"], 3, vec!["tick 1000 is not ahead of tick", "--start-tick"]),
    ] {
        let (got, said) = ended(desk.record(port, &more).output().unwrap());
        assert_eq!(got, code, "{port} {more:?}: {said}");
        for part in parts {
            assert!(said.contains(part), "{port} {more:?}: {part} is not in: {said}");
        }
        assert!(!desk.file("run.mcap").exists(), "{port} {more:?}");
    }
}

#[test]
fn the_firmware_s_log_is_shown_and_kept() {
    let logging = |code: &[u8]| {
        let mut doggy = Doggy { seq: 5000, ..Doggy::default() };
        doggy.hello.code_crc = Some(protocol::frame::crc32(code));
        let stream = [vec![0], firmware::started(250_000, "\u{1b}[2Jdoggy", 5), firmware::late(5_300_000, 2)].concat();
        doggy.reports = vec![Report::Defmt { at: 0, bytes: stream.into_iter().collect() }];
        Peer::start(doggy)
    };
    let desk = Desk::new();
    let elf = desk.file("firmware.elf");
    std::fs::write(&elf, firmware::elf(b"code")).unwrap();
    let motion = desk.short_motion();
    let record = |peer: &Peer, more: &[&str]| {
        let _ = std::fs::remove_file(desk.file("run.mcap"));
        let arguments = [&["--motion", motion.as_str()], more].concat();
        let (code, said) = ended(desk.record(&peer.path, &arguments).output().unwrap());
        assert_eq!(code, 0, "{said}");
        (said, recording::read(&desk.file("run.mcap")).unwrap())
    };
    let elf = elf.to_str().unwrap();

    let (said, run) = record(&logging(b"code"), &["--elf", elf]);
    // A pipe gets no colours, and what a device sends commands no terminal.
    assert!(said.contains("    0.250000 INFO  started: \\u{1b}[2Jdoggy, 5 parts\n"), "{said}");
    assert!(said.contains("    5.300000 WARN  gyro 2 answers late\n") && !said.contains('\u{1b}'), "{said}");
    let log: Vec<_> = run.log.iter().map(|line| (line.t_us, line.level.name(), line.message.as_str())).collect();
    assert_eq!(
        log,
        [(250_000, "info", "started: \u{1b}[2Jdoggy, 5 parts"), (5_300_000, "warn", "gyro 2 answers late")]
    );

    let (said, _) = record(&logging(b"code"), &["--elf", elf, "--quiet"]);
    assert!(said.contains("gyro 2 answers late") && !said.contains("started"), "{said}");

    let (said, run) = record(&logging(b"another"), &["--elf", elf]);
    assert!(said.contains("is not the program that runs on the device") && said.contains("flash"), "{said}");
    assert!(run.log.is_empty() && run.len() >= 750, "the recording goes on");

    let (said, _) = record(&logging(b"code"), &[]);
    assert_eq!(said.matches("--elf").count(), 1, "{said}");
}

#[test]
fn an_end_that_was_not_ordinary_is_told() {
    let started = |reset, panic| {
        let mut doggy = Doggy::default();
        (doggy.hello.reset, doggy.hello.panic) = (reset, panic);
        let (desk, peer) = (Desk::new(), Peer::start(doggy));
        let (_, said) = ended(desk.record(&peer.path, &["--motion", &desk.short_motion()]).output().unwrap());
        let check = Process::new(env!("CARGO_BIN_EXE_host")).arg("check").arg(desk.file("run.mcap")).output().unwrap();
        (said, String::from_utf8(check.stdout).unwrap() + &String::from_utf8(check.stderr).unwrap())
    };
    let (said, checked) = started(ResetReason::PowerOn, None);
    assert!(said.contains("started: power came on") && !said.contains("warning"), "{said}");
    assert!(!checked.contains("started") && !checked.contains("power"), "{checked}");
    let place = PanicPlace { file: protocol::units::text("src/main.rs"), line: 88 };
    for (reset, panic, expected) in [
        (ResetReason::Panic, Some(place), "restarted by a panic of the firmware at src/main.rs:88"),
        (ResetReason::Watchdog, None, "restarted by its watchdog"),
        (ResetReason::BrownOut, None, "restarted by a supply that fell too low"),
    ] {
        let (said, checked) = started(reset, panic);
        assert!(said.contains("warning: ") && said.contains(expected), "{said}");
        assert!(checked.contains(expected), "{checked}");
    }
}

/// Waits until a recording has at least one sample behind its head.
fn wait_for_growth(child: &mut Child, path: &Path) {
    let until = Instant::now() + Duration::from_secs(120);
    while std::fs::metadata(path).map_or(0, |m| m.len()) < 20_000 {
        if child.try_wait().unwrap().is_some() {
            let mut said = String::new();
            child.stderr.take().unwrap().read_to_string(&mut said).unwrap();
            panic!("the recording ended: {said}");
        }
        assert!(Instant::now() < until, "no recording in {}", path.display());
        std::thread::sleep(Duration::from_millis(10));
    }
}

#[test]
fn ctrl_c_stops_the_robot_first_and_closes_the_file() {
    let peer = Peer::start(Doggy { motion_ticks: u32::MAX, ..Doggy::default() });
    let desk = Desk::new();
    let mut child = desk.record(&peer.path, &["--motion", &desk.short_motion()]).spawn().unwrap();
    wait_for_growth(&mut child, &desk.file("run.mcap"));
    while peer.heard.try_recv().is_ok() {}
    interrupt(&child);
    let (code, said) = ended(child.wait_with_output().unwrap());
    assert_eq!(code, 3, "{said}");
    assert!(said.contains("stopped"), "{said}");
    let help = Process::new(env!("CARGO_BIN_EXE_host")).arg("help").output().unwrap();
    let help = String::from_utf8(help.stdout).unwrap();
    assert!(help.contains("ended by Ctrl-C: 0 of simulate and watch, 3 of record and bringup"), "{help}");
    let commands: Vec<Command> = peer
        .finish()
        .into_iter()
        .filter_map(|message| match message {
            // A start that was asked for twice on a busy machine.
            ToDevice::Request { command: Command::Start { .. }, .. } => None,
            ToDevice::Request { command, .. } => Some(command),
            _ => None,
        })
        .collect();
    assert_eq!(commands.first(), Some(&Command::Stop), "{commands:?}");
    let recording = recording::read(&desk.file("run.mcap")).unwrap();
    assert!(recording.damage.is_empty() && recording.balance.unwrap().closed);
    assert!(recording.events.iter().any(|event| event.text.contains("stopped by the host")));
}

#[test]
fn a_hundred_kills_lose_half_a_second_at_most() {
    // Four at a time: each waits for its device most of the time, and ten would be a load of their own.
    let worst = std::thread::scope(|scope| {
        let lanes: Vec<_> =
            (0..4).map(|lane| scope.spawn(move || (0..25).map(|n| kill(lane * 25 + n)).max().unwrap())).collect();
        lanes.into_iter().map(|lane| lane.join().unwrap()).max().unwrap()
    });
    eprintln!("100 kills: at most {worst} ms lost");
    // At most a quarter of a second is not flushed yet, and 150 ms are on the way.
    assert!(worst <= 420, "{worst} ms lost");
}

/// Kills a recording at a moment drawn by `seed`; how much device time of it is missing in the file, ms.
fn kill(seed: u64) -> u32 {
    let sent = Arc::new(AtomicU32::new(0));
    let told = Arc::clone(&sent);
    let fate = move |seq: u32, _: &mut Vec<u8>| {
        told.store(seq, Relaxed);
        true
    };
    // What counts is how far the file is behind the host, not how far the host is behind on a busy machine.
    let leash = Some(LEASH);
    let peer = Peer::start(Doggy { seq: 0, motion_ticks: u32::MAX, leash, fate: Box::new(fate), ..Doggy::default() });
    let desk = Desk::new();
    let mut child = desk.record(&peer.path, &["--motion", &desk.short_motion()]).spawn().unwrap();
    wait_for_growth(&mut child, &desk.file("run.mcap"));
    // SplitMix64: a moment within 1.2 s, so that flushes and syncs are hit as well as what lies between them.
    let mut z = (seed + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    std::thread::sleep(Duration::from_micros((z ^ (z >> 31)) % 1_200_000));
    child.kill().unwrap();
    let last_sent = sent.load(Relaxed);
    child.wait().unwrap();
    let recording = recording::read(&desk.file("run.mcap")).unwrap();
    assert_eq!(recording.missing_ticks(), 0, "seed {seed}");
    last_sent - *recording.seq.last().unwrap() as u32
}

/// A fault of the emergency stop is cleared by who asks for it, and by nobody else.
#[test]
fn an_emergency_stop_is_cleared_on_request_only() {
    let pressed = || Doggy { fault: Some(protocol::Fault::EmergencyStop), leash: Some(LEASH), ..Doggy::default() };
    let desk = Desk::new();
    let motion = desk.short_motion();
    let peer = Peer::start(pressed());
    let (code, said) = ended(desk.record(&peer.path, &["--motion", &motion]).output().unwrap());
    assert_eq!(code, 3, "{said}");
    assert!(said.contains("emergency stop was pressed") && said.contains("--clear-stop"), "{said}");
    let is_clear = |message: &ToDevice| matches!(message, ToDevice::Request { command: Command::ClearFault, .. });
    assert!(!peer.finish().iter().any(is_clear));

    let peer = Peer::start(pressed());
    let (code, said) = ended(desk.record(&peer.path, &["--motion", &motion, "--clear-stop"]).output().unwrap());
    assert_eq!(code, 0, "{said}");
    assert!(peer.finish().iter().any(is_clear));

    // Any other fault is cleared as before.
    let peer = Peer::start(Doggy { fault: Some(protocol::Fault::Overrun), leash: Some(LEASH), ..Doggy::default() });
    let (code, said) = ended(desk.record(&peer.path, &["--motion", &motion, "--force"]).output().unwrap());
    assert_eq!(code, 0, "{said}");
}

#[test]
fn what_a_device_calls_itself_commands_no_terminal() {
    let mut doggy = doggy();
    doggy.identity.firmware_version = protocol::units::text("1\u{1b}]0;pwn\u{7}");
    let named = || Doggy { hello: doggy.clone(), leash: Some(LEASH), ..Doggy::default() };
    let mut stranger = named();
    stranger.hello.identity.protocol_version = 77;
    stranger.hello.identity.robot = protocol::units::text("x\u{9b}2J");
    let desk = Desk::new();
    for device in [named(), stranger] {
        let peer = Peer::start(device);
        let (_, said) =
            ended(desk.record(&peer.path, &["--motion", &desk.short_motion(), "--force"]).output().unwrap());
        assert!(said.contains("1\\u{1b}]0;pwn\\u{7}"), "{said}");
        assert!(!said.contains(|c: char| c.is_control() && c != '\n'), "{said}");
    }
}

/// The device plays on when every segment must be over.
#[test]
fn a_recording_ends_by_itself() {
    let peer = Peer::start(Doggy { motion_ticks: u32::MAX, leash: Some(LEASH), ..Doggy::default() });
    let desk = Desk::new();
    let (code, said) = ended(desk.record(&peer.path, &["--motion", &desk.short_motion()]).output().unwrap());
    assert_eq!(code, 3, "{said}");
    assert!(said.contains("not over after 0.5 s"), "{said}");
    let recording = recording::read(&desk.file("run.mcap")).unwrap();
    assert!((2500..3000).contains(&recording.len()), "{}", recording.len());
    let stops = peer.finish().into_iter().filter(|m| matches!(m, ToDevice::Request { command: Command::Stop, .. }));
    assert!(stops.count() > 0);
}
