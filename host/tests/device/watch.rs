//! Stories of `host watch`: the binary against a scripted device and against simulated robots.

use std::io::{BufRead, BufReader, Read};
use std::process::{Child, Command as Process, Stdio};

use crate::peer::{Doggy, Peer};
use protocol::{Command, ToDevice};
use serde_json::Value;

fn watch(port: &str, more: &[&str]) -> Process {
    let mut host = Process::new(env!("CARGO_BIN_EXE_host"));
    host.args(["watch", "--port", port]).args(more);
    host.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    host
}

fn interrupt(child: &Child) {
    assert!(Process::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
}

#[test]
fn a_device_is_watched_for_a_while_and_nothing_is_asked_of_its_motors() {
    let peer = Peer::start(Doggy::default());
    let output = watch(&peer.path, &["--json", "--for", "0.6", "--every", "0.1"]).output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(0), "{said}");
    assert!(said.contains("doggy, firmware 0.1.0") && said.contains("0 lost"), "{said}");
    let pictures: Vec<Value> =
        String::from_utf8(output.stdout).unwrap().lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert!(pictures.len() >= 2, "{}", pictures.len());
    let last = pictures.last().unwrap();
    assert_eq!(last["encoders"].as_array().unwrap().len(), 3);
    assert_eq!(last["gyros"][1]["body"], 3);
    assert_eq!((last["state"].as_str(), last["stop_pressed"].as_bool()), (Some("idle"), Some(false)));
    assert_eq!(last["balance"]["missing"], 0);
    for message in peer.finish() {
        let ToDevice::Request { command, .. } = message else { continue };
        assert!(matches!(command, Command::Status | Command::Stream { .. } | Command::Stop), "{command:?}");
    }
}

/// Who reads the view went to sleep: the pipe is full after a second. The device does not notice.
#[test]
fn a_screen_that_stands_still_holds_nothing_up() {
    let peer = Peer::start(Doggy::default());
    let mut child = watch(&peer.path, &["--json", "--for", "2.5", "--every", "0.005"]).spawn().unwrap();
    let status = child.wait().unwrap();
    let mut said = String::new();
    child.stderr.take().unwrap().read_to_string(&mut said).unwrap();
    assert!(status.success() && said.contains("0 lost"), "{said}");
    // Never read until now: what the pipe holds is all there is.
    let mut shown = Vec::new();
    child.stdout.take().unwrap().read_to_end(&mut shown).unwrap();
    let lines = shown.iter().filter(|byte| **byte == b'\n').count();
    assert!(shown.len() >= 40_000 && lines < 250, "the pipe was full: {} bytes, {lines} lines", shown.len());
    let seen = |message| if let ToDevice::Heartbeat(heartbeat) = message { Some(heartbeat.seen_seq) } else { None };
    let seen: Vec<u32> = peer.finish().into_iter().filter_map(seen).collect();
    let followed = seen.last().unwrap().wrapping_sub(*seen.iter().find(|seq| **seq != 0).unwrap());
    assert!(followed > 1500, "samples were worked off to the end: {followed}");
}

/// A simulated robot behind a port of its own, in real time.
#[test]
fn ctrl_c_ends_the_view_and_the_simulated_robot_can_be_watched_again() {
    let mut simulation = Process::new(env!("CARGO_BIN_EXE_host"));
    simulation.args(["simulate", "--pace", "real"]).stdout(Stdio::piped()).stderr(Stdio::null());
    let mut simulation = simulation.spawn().unwrap();
    let mut port = String::new();
    BufReader::new(simulation.stdout.as_mut().unwrap()).read_line(&mut port).unwrap();
    for _ in 0..2 {
        let mut child = watch(port.trim_end(), &["--every", "0.05"]).spawn().unwrap();
        let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let line = lines.nth(3).unwrap().unwrap();
        assert!(line.contains("motor3: 0 +0.0000 rad") && line.contains("stop released"), "{line}");
        interrupt(&child);
        let output = child.wait_with_output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(0), "{said}");
        assert!(said.contains(" samples, 0 lost"), "{said}");
    }
    interrupt(&simulation);
    assert!(simulation.wait().unwrap().success());
}

#[test]
fn a_port_of_the_simulator_needs_no_second_window_and_a_closed_pipe_is_no_failure() {
    let output = watch("sim:seed=3", &["--for", "0.5", "--every", "0.1"]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(String::from_utf8(output.stdout).unwrap().lines().count() >= 2);
    let mut child = watch("sim:seed=3", &["--for", "0.5", "--every", "0.05"]).spawn().unwrap();
    drop(child.stdout.take());
    assert!(child.wait().unwrap().success());

    let output = watch("/dev/no-such-port", &["--for", "1"]).output().unwrap();
    assert_eq!(output.status.code(), Some(3));
    let output = watch("sim:", &["--for", "0"]).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
}
