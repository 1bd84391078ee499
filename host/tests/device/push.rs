//! Stories of `host robot push`: the binary against simulated robots that keep their flash, and against a scripted device.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command as Process, Stdio};

use crate::peer::{Doggy, Peer};
use crate::program::host;
use host::robot::Robot;
use protocol::description::Descriptions;
use protocol::{Command, ToDevice};
use serde_json::Value;

/// A robot as Doggy with another name, narrower limits and finer encoders.
fn neighbour(folder: &Path) -> String {
    let text = Robot::builtin("doggy").unwrap().toml().to_owned();
    let text = text.replace("name = \"doggy\"", "name = \"neighbour\"");
    let text = text.replace("counts_per_turn = 1024", "counts_per_turn = 2048").replace("-0.6, 0.6", "-0.5, 0.5");
    let robot = Robot::parse(&text).unwrap();
    assert_eq!((robot.name.as_str(), robot.joints[1].limits), ("neighbour", [-0.5, 0.5]));
    std::fs::write(folder.join("neighbour.toml"), text).unwrap();
    "neighbour.toml".to_owned()
}

#[test]
fn a_description_is_stored_and_runs_when_the_device_is_switched_on_again() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let robot = neighbour(folder);
    let said = host(folder, &["robot", "push", &robot, "--port", "sim:flash=flash.bin"], 0);
    for told in [
        "doggy, firmware",
        "runs the description that is built in",
        "robot: doggy -> neighbour",
        "encoder 2, counts per turn: 1024 -> 2048",
        "neighbour is stored as description 1",
        "it runs from the next start on",
    ] {
        assert!(said.contains(told), "{told}: {said}");
    }

    // The same robot is simulated with the same flash: it starts with the stored description.
    let output = Process::new(env!("CARGO_BIN_EXE_host"))
        .current_dir(folder)
        .args(["robot", "push", &robot, "--port", "sim:flash=flash.bin", "--json"])
        .output()
        .unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(said.contains("neighbour, firmware") && said.contains("runs the stored description 1"), "{said}");
    assert!(said.contains("was stored already as description 1") && said.contains("; it runs\n"), "{said}");
    let pushed: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((pushed["sequence"].as_u64(), pushed["runs"].as_bool()), (Some(1), Some(true)));
    assert_eq!(pushed["changes"].as_array().unwrap().len(), 0);

    // And back again: another number, the other copy.
    let said = host(folder, &["robot", "push", "doggy", "--port", "sim:flash=flash.bin"], 0);
    assert!(said.contains("robot: neighbour -> doggy") && said.contains("doggy is stored as description 2"), "{said}");
    let said = host(folder, &["watch", "--port", "sim:flash=flash.bin", "--for", "0.2"], 0);
    assert!(said.contains("doggy, firmware"), "{said}");
}

/// A running simulation, which does not outlive its test.
struct Simulation(Child);

impl Simulation {
    fn end(mut self) {
        let id = self.0.id().to_string();
        assert!(Process::new("kill").args(["-INT", &id]).status().unwrap().success());
        assert!(self.0.wait().unwrap().success());
    }
}

impl Drop for Simulation {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A simulated robot behind a port of its own: pushed to twice while it runs, recorded after it was switched on again.
#[test]
fn a_robot_that_runs_takes_a_description_and_is_recorded_with_it_later() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let robot = neighbour(folder);
    let simulate = || {
        let mut simulation = Process::new(env!("CARGO_BIN_EXE_host"));
        simulation.current_dir(folder).args(["simulate", "--robot", &robot, "--flash", "flash.bin", "--pace", "fast"]);
        let mut simulation = simulation.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
        let mut port = String::new();
        BufReader::new(simulation.stdout.as_mut().unwrap()).read_line(&mut port).unwrap();
        (Simulation(simulation), port.trim_end().to_owned())
    };
    let (simulation, port) = simulate();
    host(folder, &["robot", "push", "doggy", "--port", &port], 0);
    let said = host(folder, &["robot", "push", &robot, "--port", &port], 0);
    assert!(said.contains("description 1 (CRC-32") && said.contains("stored and does not run"), "{said}");
    assert!(said.contains("is stored as description 2"), "{said}");
    simulation.end();
    let (simulation, port) = simulate();
    let run = ["record", "--port", &port, "--robot", &robot, "--set-zero", "--motion", "validation", "-o", "run.mcap"];
    let said = host(folder, &run, 0);
    assert!(said.contains("neighbour, firmware") && said.contains(", 0 lost"), "{said}");
    simulation.end();
}

#[test]
fn what_the_firmware_cannot_run_is_told_before_anything_is_sent() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let said = host(folder, &["robot", "push", "one_joint", "--port", "sim:"], 4);
    assert!(said.contains("cannot run one_joint: it has 1 joints, and the board drives 3 motors"), "{said}");
    assert!(said.contains("robot's file"), "an advice: {said}");

    let doggy = Robot::builtin("doggy").unwrap().toml().to_owned();
    let gyro = "kind = \"gyro\"";
    let swapped = doggy.replacen(gyro, "kind = \"gyro\"\npart = \"bmi323\"", 1);
    std::fs::write(folder.join("swapped.toml"), swapped).unwrap();
    let said = host(folder, &["robot", "push", "swapped.toml", "--port", "sim:"], 4);
    assert!(said.contains("gyro 1 is a BMI323, and the board reads one of type ICM-42688-P there"), "{said}");

    let unknown = doggy.replacen(gyro, "kind = \"gyro\"\npart = \"l3gd20\"", 1);
    std::fs::write(folder.join("unknown.toml"), unknown).unwrap();
    let said = host(folder, &["robot", "push", "unknown.toml", "--port", "sim:"], 4);
    assert!(said.contains("l3gd20"), "{said}");
    host(folder, &["robot", "push", "doggy"], 2);
    host(folder, &["robot", "push", "no_such_robot", "--port", "sim:"], 2);
    host(folder, &["robot", "push", "doggy", "--port", "/dev/no-such-port"], 3);
    std::fs::write(folder.join("flash.bin"), "too short").unwrap();
    let said = host(folder, &["robot", "push", "doggy", "--port", "sim:flash=flash.bin"], 3);
    assert!(said.contains("no flash of"), "{said}");
}

#[test]
fn a_board_without_a_place_refuses_and_nothing_is_sent_to_it() {
    let folder = tempfile::tempdir().unwrap();
    let peer = Peer::start(Doggy::default());
    let said = host(folder.path(), &["robot", "push", "doggy", "--port", &peer.path], 3);
    assert!(said.contains("this board cannot store a description") && said.contains("PORTING.md"), "{said}");
    for message in peer.finish() {
        let ToDevice::Request { command, .. } = message else { continue };
        assert!(matches!(command, Command::Status | Command::Stop), "{command:?}");
    }
}

/// A device that says it has stored the description, and whose handshake does not tell it.
#[test]
fn what_the_handshake_does_not_tell_is_not_believed() {
    let folder = tempfile::tempdir().unwrap();
    let mut doggy = Doggy { lost_answers: 1, ..Doggy::default() };
    doggy.hello.description = Descriptions { can_store: true, ..Descriptions::default() };
    let peer = Peer::start(doggy);
    let said = host(folder.path(), &["robot", "push", "doggy", "--port", &peer.path], 3);
    assert!(said.contains("the handshake tells another description"), "{said}");
    let commands = peer.finish().into_iter().filter_map(|message| match message {
        ToDevice::Request { command, .. } => Some(command),
        _ => None,
    });
    let ends = commands.filter(|command| matches!(command, Command::DescriptionEnd { .. }));
    assert_eq!(ends.count(), 2, "its answer was lost once");
}
