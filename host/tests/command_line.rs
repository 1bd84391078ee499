//! The command line as other programs see it: exit codes, and which stream carries what.

use std::os::unix::process::CommandExt;
use std::time::{Duration, Instant};

use assert_cmd::Command;

fn host() -> Command {
    Command::new(env!("CARGO_BIN_EXE_host"))
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

#[test]
fn a_verb_that_does_not_exist_is_a_usage_error() {
    let output = host().arg("calibrat").output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains("calibrat"), "{}", text(&output.stderr));
    assert!(output.stdout.is_empty());
}

#[test]
fn help_says_what_the_exit_codes_mean() {
    let output = host().arg("--help").output().unwrap();
    assert_eq!(output.status.code(), Some(0));
    assert!(text(&output.stdout).contains("4 data unusable"), "{}", text(&output.stdout));
}

#[test]
fn ctrl_c_leaves_no_half_made_file() {
    let folder = tempfile::tempdir().unwrap();
    let files = || -> Vec<String> {
        let files = std::fs::read_dir(folder.path()).unwrap();
        files.map(|file| file.unwrap().file_name().into_string().unwrap()).collect()
    };
    // In a group of its own, which a terminal would interrupt as a whole.
    let mut host = std::process::Command::new(env!("CARGO_BIN_EXE_host"));
    let mut child = host.args(["--quiet", "demo", "--out"]).arg(folder.path()).process_group(0).spawn().unwrap();
    let until = Instant::now() + Duration::from_secs(30);
    while !files().iter().any(|file| file.ends_with(".part")) {
        assert!(Instant::now() < until, "{:?}", files());
        std::thread::sleep(Duration::from_millis(5));
    }
    let group = format!("-{}", child.id());
    assert!(std::process::Command::new("kill").args(["-INT", "--", &group]).status().unwrap().success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    assert!(files().iter().all(|file| !file.ends_with(".part") && !file.ends_with(".json")), "{:?}", files());
}

#[test]
fn completions_go_to_stdout() {
    let output = host().args(["completions", "bash"]).output().unwrap();
    assert_eq!(output.status.code(), Some(0));
    assert!(text(&output.stdout).contains("complete"), "{}", text(&output.stdout));
    assert!(output.stderr.is_empty());
}
