//! A simulated robot at its port, played on by the host's own link: what comes out is what the plant did.

use std::sync::atomic::AtomicBool;

use crate::link::{self, CaptureError, Captured, Device, Ready, Zero};
use crate::recording::{self, Recording};
use crate::simulate::{Options, SimulationReport, Simulator};

/// A short motion of every joint: rest, steps at half the range, a chirp.
fn motion(robot: &crate::robot::Robot) -> (protocol::Motion, String) {
    let limits = link::joint_limits(robot);
    let mut motion = firmware::motion::preset::validation(&limits);
    motion.segments.truncate(9);
    let text = toml::to_string(&motion).unwrap();
    (motion, text)
}

fn play(port: &str) -> (Result<Captured, CaptureError>, Recording, SimulationReport) {
    let options = Options::parse(port).unwrap();
    let simulator = Simulator::start(&options).unwrap();
    let path = simulator.path().display().to_string();
    let mut device = Device::open(&path, &link::Options::default()).unwrap();
    let (motion, text) = motion(&options.robot);
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.mcap");
    let ready = Ready::prepare(&mut device, &options.robot, &motion, text, Zero::Set).unwrap();
    let captured = ready.run(std::fs::File::create(&file).unwrap(), &AtomicBool::new(false), |_| {});
    drop(device);
    (captured, recording::read(&file).unwrap(), simulator.finish().unwrap())
}

#[test]
fn a_clean_line_loses_nothing_and_one_seed_gives_one_recording() {
    let (first, one, report) = play("seed=11");
    let (_, again, _) = play("seed=11");
    let (_, other, _) = play("seed=12");
    let first = first.unwrap();
    assert_eq!((first.balance.missing, first.balance.damaged_frames), (0, 0));
    assert!(report.faults.line.samples >= first.samples);

    // From the start of the motion on, nothing depends on when the host asked for what.
    let of_motion = |recording: &Recording| -> Vec<Vec<f64>> {
        let start = recording.phase.iter().position(|phase| *phase == 0).unwrap();
        let end = recording.phase.iter().rposition(|phase| *phase != recording::NO_PHASE).unwrap();
        recording.channels.iter().map(|channel| channel.values[start..=end].to_vec()).collect()
    };
    let (one, again, other) = (of_motion(&one), of_motion(&again), of_motion(&other));
    assert_eq!(one, again, "the same bits");
    assert_ne!(one[3], other[3]);
}

#[test]
fn the_balance_is_exact_against_the_injected_faults() {
    let (captured, _, report) = play("seed=5,fault=drop=0.01,fault=corrupt=0.01,fault=stall-out=0.3@5");
    let (balance, faults) = (captured.unwrap().balance, report.faults);
    assert!(balance.closed);
    assert_eq!(balance.line_lost, faults.line.lost_samples());
    assert_eq!(balance.damaged_frames, faults.line.damaged_pieces);
    assert_eq!(balance.host_dropped, 0);
    assert_eq!(balance.missing, balance.device_dropped + balance.line_lost);
    assert!(balance.device_dropped > 200, "a stall of 300 ticks and a queue of 32: {}", balance.device_dropped);
    assert_eq!((faults.stalls_out, faults.stalls_in, faults.resets), (1, 0, 0));
}

#[test]
fn a_silent_host_and_a_reset_stop_the_motion_with_their_reasons() {
    let (ended, recording, report) = play("seed=5,fault=stall-in=0.3@5");
    let told = ended.unwrap_err().to_string();
    assert!(told.contains("heartbeats"), "{told}");
    assert_eq!(report.faults.stalls_in, 1);
    let last = recording.duty.iter().map(|duty| *duty.last().unwrap());
    assert!(last.into_iter().all(|duty| duty == 0.0), "zero duty at the end");

    let (ended, _, report) = play("seed=5,fault=reset@5");
    let told = ended.unwrap_err().to_string();
    assert!(told.contains("watchdog"), "{told}");
    assert_eq!(report.faults.resets, 1);
}

#[test]
fn a_robot_of_one_joint_is_played_as_well() {
    let (captured, recording, _) = play("robot=one_joint,seed=2,effect=backlash=small");
    assert_eq!(captured.unwrap().balance.missing, 0);
    assert_eq!(recording.channels.len(), 4);
    let moved = recording.channels[0].values.iter().fold(0.0, |most: f64, q| most.max(q.abs()));
    assert!(moved > 0.1, "it moved by {moved} rad");
}
