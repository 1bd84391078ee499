//! The command line as other programs see it: exit codes, and which stream carries what.

use std::os::unix::process::CommandExt;
use std::process::Command;
use std::time::{Duration, Instant};

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
    let mut host = Command::new(env!("CARGO_BIN_EXE_host"));
    let mut child = host.args(["--quiet", "demo", "--out"]).arg(folder.path()).process_group(0).spawn().unwrap();
    let until = Instant::now() + Duration::from_secs(120);
    while !files().iter().any(|file| file.ends_with(".part")) {
        assert!(Instant::now() < until, "{:?}", files());
        std::thread::sleep(Duration::from_millis(5));
    }
    let group = format!("-{}", child.id());
    assert!(Command::new("kill").args(["-INT", "--", &group]).status().unwrap().success());
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

#[test]
fn the_catalogue_is_printed_for_people_and_for_programs() {
    let output = host().arg("effects").output().unwrap();
    assert_eq!(output.status.code(), Some(0));
    let listed = text(&output.stdout);
    assert!(
        listed.contains("base_bearing") && listed.contains("N m/rad") && listed.contains("structure_mode"),
        "{listed}"
    );

    let output = host().args(["effects", "--json"]).output().unwrap();
    let all: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let all = all.as_array().unwrap();
    assert_eq!(all.len(), host::effect::CATALOGUE.len());
    for entry in all {
        for key in ["id", "title", "equation", "about"] {
            assert!(entry[key].as_str().is_some_and(|text| !text.is_empty()), "{key}: {entry}");
        }
        assert!(entry["confounded_with"].as_array().is_some_and(|names| !names.is_empty()), "{entry}");
        for key in ["parameters", "nuisances"] {
            for parameter in entry[key].as_array().unwrap() {
                let told = ["name", "unit", "sizes", "role"].iter().all(|key| parameter[key].is_string());
                assert!(told && parameter.get("typical").is_some(), "{parameter}");
            }
        }
        assert!(listed.contains(entry["id"].as_str().unwrap()), "{entry}");
    }

    let output = host().args(["effects", "backlash", "--json"]).output().unwrap();
    let one: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(all.contains(&one) && one["parameters"][0]["name"] == "h[i]", "{one}");
    let typical = serde_json::json!({ "median": 0.006, "decades": 0.5, "of": "radian" });
    assert!(one["parameters"][0]["role"] == "size" && one["parameters"][0]["typical"] == typical, "{one}");
    let output = host().args(["effects", "backlash"]).output().unwrap();
    let printed = text(&output.stdout);
    assert!(printed.contains("At every reversal") && printed.contains("size: 0.006 rad, ± 0.5 decades"), "{printed}");
}

#[test]
fn an_effect_that_does_not_exist_is_told_the_nearest() {
    for line in [&["effects", "baklash"][..], &["simulate", "--effect", "baklash"]] {
        let output = host().args(line).output().unwrap();
        assert_eq!(output.status.code(), Some(2));
        assert!(text(&output.stderr).contains("did you mean `backlash`"), "{}", text(&output.stderr));
        assert!(output.stdout.is_empty());
    }
}
