//! A user describes a robot of his own, plays with it behind a serial port, and records it.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};

use tests::{host, host_succeeds, json, run_host};

#[test]
fn the_built_in_robots_can_be_listed_and_shown() {
    let list = String::from_utf8(run_host(["robot", "list"]).stdout).unwrap();
    assert!(list.lines().any(|line| line.starts_with("doggy ")) && list.contains("one_joint"), "{list}");
    let shown = run_host(["robot", "show", "doggy"]);
    assert!(String::from_utf8(shown.stdout).unwrap().contains("gear = 42.092"));
    let missing = run_host(["robot", "show", "dogy"]);
    assert_eq!(missing.status.code(), Some(2));
    assert!(String::from_utf8(missing.stderr).unwrap().contains("did you mean `doggy`"));
}

#[test]
fn a_typo_in_a_robot_file_is_found_and_nothing_is_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("arm.toml");
    host_succeeds([Path::new("robot"), Path::new("new"), Path::new("arm"), Path::new("-o"), &file]);
    let again = run_host([Path::new("robot"), Path::new("new"), Path::new("arm"), Path::new("-o"), &file]);
    assert_eq!(again.status.code(), Some(2), "the file is there already");

    let text =
        std::fs::read_to_string(&file).unwrap().replace("transmission = \"elastic\"", "transmision = \"elastic\"");
    std::fs::write(&file, text).unwrap();
    let refused = run_host([Path::new("robot"), Path::new("show"), &file]);
    let told = String::from_utf8(refused.stderr).unwrap();
    assert_eq!(refused.status.code(), Some(4));
    assert!(told.contains("transmision") && told.contains("did you mean `transmission`"), "{told}");
}

#[test]
fn a_simulated_robot_is_a_serial_port_until_ctrl_c() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let mut simulation = host()
        .args(["simulate", "--robot", "one_joint", "--pace", "fast", "--seed", "6", "--effect", "backlash=0.004"])
        .args(["--fault", "drop=0.02", "--link", &at("port"), "--truth", &at("truth.json")])
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut port = String::new();
    BufReader::new(simulation.stdout.as_mut().unwrap()).read_line(&mut port).unwrap();
    assert_eq!(port.trim_end(), at("port"));

    let unset = run_host(["record", "--port", &at("port"), "-o", &at("run.mcap"), "--motion", "validation"]);
    assert_eq!(unset.status.code(), Some(3), "a robot that does not know its zero does not move");
    let said =
        host_succeeds(["record", "--set-zero", "--port", &at("port"), "-o", &at("run.mcap"), "--motion", "validation"]);

    let interrupted = Command::new("kill").args(["-INT", &simulation.id().to_string()]).status().unwrap();
    assert!(interrupted.success() && simulation.wait().unwrap().success(), "Ctrl-C is the way to end it");
    assert!(!Path::new(&at("port")).exists(), "the link went with it");
    let truth = json(Path::new(&at("truth.json")));
    assert_eq!(truth["effects"][0]["parameters"][0]["value"], 0.004);
    let lost = truth["faults"]["dropped_samples"].as_u64().unwrap();
    assert!(lost > 100 && said.contains(&format!("line {lost};")), "{lost} dropped, and the recording says:\n{said}");
}
