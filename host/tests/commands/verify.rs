//! `host verify` as a user runs it: its refusals, and the whole way from a table to the page.

use std::path::Path;
use std::process::Command;

fn host(folder: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_host"));
    command.current_dir(folder);
    command
}

#[test]
fn what_is_no_calibration_is_refused_with_advice() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("cal.json"), "{\"robot\": \"doggy\"}").unwrap();
    let output = host(folder.path()).args(["verify", "cal.json", "run.mcap"]).output().unwrap();
    assert_eq!(output.status.code(), Some(4));
    let text = String::from_utf8_lossy(&output.stderr);
    assert!(text.contains("cal.json is not a calibration") && text.contains("host calibrate"), "{text}");

    let output = host(folder.path()).args(["verify", "no.json", "run.mcap"]).output().unwrap();
    assert_eq!(output.status.code(), Some(3));
    assert!(String::from_utf8_lossy(&output.stderr).contains("no.json"));
}

#[test]
fn an_existing_report_is_not_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("page.html"), "precious").unwrap();
    let args = ["verify", "cal.json", "run.mcap", "--report", "page.html"];
    assert_eq!(host(folder.path()).args(args).output().unwrap().status.code(), Some(2));
    assert_eq!(std::fs::read_to_string(folder.path().join("page.html")).unwrap(), "precious");
}
