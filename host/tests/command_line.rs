//! The command line as other programs see it: exit codes, and which stream carries what.

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
fn completions_go_to_stdout() {
    let output = host().args(["completions", "bash"]).output().unwrap();
    assert_eq!(output.status.code(), Some(0));
    assert!(text(&output.stdout).contains("complete"), "{}", text(&output.stdout));
    assert!(output.stderr.is_empty());
}
