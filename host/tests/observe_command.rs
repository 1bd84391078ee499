//! `host observe` as a user meets it: the commands of host/doc/observer.md, their files, refusals.

mod program;

use program::{host, json};

/// The commands of the document, without the program's name.
fn commands() -> Vec<Vec<String>> {
    let document = include_str!("../doc/observer.md");
    let block = document.split("```sh\n").nth(1).and_then(|rest| rest.split("```").next()).unwrap();
    block.lines().map(|line| line.split_whitespace().skip(1).map(str::to_owned).collect()).collect()
}

#[test]
fn the_document_is_true_and_what_cannot_be_observed_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let short = concat!(env!("CARGO_MANIFEST_DIR"), "/src/simulate/motion/short.toml");
    host(folder.path(), &["record", "-q", "--port", "sim:seed=4", "--motion", short, "-o", "run.mcap"], 0);
    host(folder.path(), &["calibrate", "-q", "run.mcap", "-o", "cal.json"], 0);
    for command in commands() {
        let arguments: Vec<&str> = command.iter().map(String::as_str).collect();
        let said = host(folder.path(), &arguments, 0);
        assert!(said.contains("innovations (NIS)") && said.contains("bias1[x]"), "{said}");
    }
    let observed = json(&at("observed.json"));
    assert_eq!(observed["sensors"], "both");
    assert_eq!(observed["states"].as_array().unwrap().len(), 12 + 6);
    assert!(observed["events"].as_array().unwrap().is_empty() && observed["nees"].is_null());
    let within = observed["nis"]["within_95"].as_f64().unwrap();
    assert!((0.93..=0.97).contains(&within), "{within}");
    assert!(std::fs::read_to_string(at("observed.html")).unwrap().contains("Watchdog"));
    let table = std::fs::read_to_string(at("states.csv")).unwrap();
    let samples = observed["recording"]["samples"].as_u64().unwrap() as usize;
    assert!(table.starts_with("t_us,q1,q2,q3,qd1,") && table.lines().count() == samples + 1);

    // The estimates of one run are as good as a truth for another: names and times are those of the recording.
    let truth = ["observe", "cal.json", "run.mcap", "--truth", "states.csv", "-o", "against.json"];
    host(folder.path(), &truth, 0);
    assert!(json(&at("against.json"))["errors"].as_array().unwrap().len() >= 12);
    std::fs::write(at("other.csv"), "t_us,speed\n0,1\n").unwrap();
    let said = host(folder.path(), &["observe", "cal.json", "run.mcap", "--truth", "other.csv"], 4);
    assert!(said.contains("q1, q2"), "{said}");

    let mut paper = json(&at("cal.json"));
    paper["preset"] = "paper".into();
    std::fs::write(at("paper.json"), paper.to_string()).unwrap();
    assert!(host(folder.path(), &["observe", "paper.json", "run.mcap"], 4).contains("--preset default"));
    assert!(host(folder.path(), &["observe", "cal.json", "run.mcap", "-o", "observed.json"], 2).contains("--force"));
}
