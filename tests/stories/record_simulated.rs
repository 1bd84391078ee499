//! The binary records a simulated robot over its pseudo-terminal; what the simulation did is the truth.

use std::path::{Path, PathBuf};
use std::process::Output;

use host::recording::{self, Recording};
use host::simulate::{Options, SimulationReport, Simulator};
use tests::run_host;

/// A simulated robot, recorded by the binary as any robot is.
struct Session {
    output: Output,
    truth: SimulationReport,
    path: PathBuf,
    _scratch: tempfile::TempDir,
}

impl Session {
    /// With options as behind `sim:`.
    fn of(options: &str) -> Self {
        let simulator = Simulator::start(&Options::parse(options).unwrap()).unwrap();
        let scratch = tempfile::tempdir().unwrap();
        let path = scratch.path().join("run.mcap");
        let port = simulator.path().to_owned();
        let arguments: [&Path; 6] =
            ["record".as_ref(), "--set-zero".as_ref(), "--port".as_ref(), &port, "-o".as_ref(), &path];
        let output = run_host(arguments);
        Self { output, truth: simulator.finish().unwrap(), path, _scratch: scratch }
    }

    fn said(&self) -> String {
        String::from_utf8_lossy(&self.output.stderr).into_owned()
    }

    fn recording(&self) -> Recording {
        recording::read(&self.path).unwrap_or_else(|error| panic!("{error}\n{}", self.said()))
    }
}

#[test]
fn nothing_is_lost_on_a_good_line() {
    let session = Session::of("seed=11");
    assert_eq!(session.output.status.code(), Some(0), "{}", session.said());
    let recording = session.recording();
    // The calibration motion; 72 s to 82 s by the robot that the seed draws.
    assert!((60_000..100_000).contains(&recording.len()), "{} samples", recording.len());
    let balance = recording.balance.unwrap();
    assert!(balance.closed);
    assert_eq!((balance.missing, balance.damaged_frames, recording.missing_ticks()), (0, 0, 0));
    assert_eq!((balance.ticks, balance.received), (recording.len() as u64, recording.len() as u64));
    assert!(recording.rest_window().len() >= 3000, "{:?}", recording.rest_window());
}

#[test]
fn the_balance_is_the_simulation_s_own_count() {
    for seed in 21..24 {
        let session = Session::of(&format!("seed={seed},fault=drop=0.01,fault=corrupt=0.001,fault=stall-out=0.3@20"));
        assert_eq!(session.output.status.code(), Some(0), "{}", session.said());
        let recording = session.recording();
        let (balance, truth) = (recording.balance.unwrap(), session.truth.faults);
        assert!(balance.closed);
        assert_eq!(balance.line_lost, truth.line.lost_samples(), "seed {seed}");
        assert_eq!(balance.damaged_frames, truth.line.damaged_pieces, "seed {seed}");
        // The device's queue bridges a part of the stall and drops the rest; the host's never fills.
        assert!((1..300).contains(&balance.device_dropped), "{balance:?}");
        assert_eq!((truth.stalls_out, balance.host_dropped), (1, 0));
        assert_eq!(balance.missing, balance.device_dropped + balance.line_lost);
        assert_eq!(balance.ticks, recording.len() as u64 + balance.missing);
        // Rates within 5 standard errors of a binomial of 70,000.
        let share = |n: u64| n as f64 / truth.line.samples as f64;
        assert!((share(truth.line.dropped_samples) - 0.01).abs() < 0.002);
        assert!((share(truth.line.spoiled_samples) - 0.001).abs() < 0.0007);
    }
}

#[test]
fn a_line_that_holds_back_the_heartbeats_stops_the_motion() {
    let session = Session::of("seed=31,fault=stall-in=0.3@20");
    assert_eq!(session.output.status.code(), Some(3), "{}", session.said());
    assert!(session.said().contains("the host's heartbeats stayed away"), "{}", session.said());
    assert_eq!(session.truth.faults.stalls_in, 1);
    let recording = session.recording();
    let balance = recording.balance.unwrap();
    assert!(balance.closed && balance.missing == 0, "{balance:?}");
    let start = recording.phase.iter().position(|phase| *phase != recording::NO_PHASE).unwrap();
    let end = recording.phase.iter().rposition(|phase| *phase != recording::NO_PHASE).unwrap();
    // The device waits for 100 ms since the last heartbeat, which came at most 60 ms before the stall.
    let stopped_s = recording.time_s(end) - recording.time_s(start);
    assert!((20.03..20.13).contains(&stopped_s), "stopped after {stopped_s} s");
    for joint in &recording.duty {
        assert!(joint[end + 2..].iter().all(|duty| *duty == 0.0), "a duty after the stop");
    }
    assert!(recording.events.iter().any(|event| event.text == "motion stopped: the host's heartbeats stayed away"));
}

#[test]
fn a_reset_of_the_board_ends_the_recording_with_its_reason() {
    let session = Session::of("seed=41,fault=reset@10");
    assert_eq!(session.output.status.code(), Some(3), "{}", session.said());
    assert!(session.said().contains("restarted (watchdog)"), "{}", session.said());
    // Asked once more, the device tells what a handshake tells.
    assert!(session.said().contains("warning: the device was restarted by its watchdog"), "{}", session.said());
    let recording = session.recording();
    assert!((recording.len() as f64 - 10_000.0).abs() < 500.0, "{} samples", recording.len());
    assert!(!recording.balance.unwrap().closed, "the device's count went with the reset");
}
