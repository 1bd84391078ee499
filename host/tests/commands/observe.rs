//! `host observe` as a user meets it: the commands of host/doc/observer.md, their files, refusals.

use crate::commands_of;
use crate::program::{host, json};
use host::observe::Numbers;

#[test]
fn the_document_is_true_and_what_cannot_be_observed_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let short = concat!(env!("CARGO_MANIFEST_DIR"), "/src/simulate/motion/short.toml");
    host(folder.path(), &["record", "-q", "--port", "sim:seed=4", "--motion", short, "-o", "run.mcap"], 0);
    host(folder.path(), &["calibrate", "-q", "run.mcap", "-o", "cal.json"], 0);
    for command in commands_of(include_str!("../../doc/observer.md"), 0) {
        let arguments: Vec<&str> = command.iter().map(String::as_str).collect();
        let said = host(folder.path(), &arguments, 0);
        match command[0].as_str() {
            "observe" => {
                assert!(said.starts_with("the filter is consistent: innovations are"), "{said}");
                assert!(said.contains("innovations (NIS) in motion") && said.contains("bias1[x]"), "{said}");
            }
            _ => assert!(said.contains("observer.bin (") && said.contains("bytes): 12 states"), "{said}"),
        }
    }
    let table = Numbers::from_bytes(&std::fs::read(at("observer.bin")).unwrap()).unwrap();
    assert_eq!((table.table().moving, table.table().states, table.table().readings), (12, 18, 9));
    let observed = json(&at("observed.json"));
    assert_eq!((&observed["sensors"], &observed["status"]), (&"both".into(), &"consistent".into()));
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

    // A robot that is not the calibration's: the first line says so, with advice, and the exit code is that of unusable data.
    host(
        folder.path(),
        &["record", "-q", "--port", "sim:seed=4,effect=base_bearing", "--motion", short, "-o", "other.mcap"],
        0,
    );
    let said = host(folder.path(), &["observe", "cal.json", "other.mcap", "-o", "other.json"], 4);
    assert!(
        said.starts_with("the filter is NOT consistent")
            && said.contains("host diagnose")
            && !said.contains("bias1[x]"),
        "{said}"
    );
    assert_eq!(json(&at("other.json"))["status"], "too_sure");
    assert!(!json(&at("other.json"))["events"].as_array().unwrap().is_empty());
    host(folder.path(), &["observe", "cal.json", "other.mcap", "--unchecked"], 0);
    let calibrated = host(folder.path(), &["export", "run.mcap", "--observer", "no.bin"], 4);
    assert!(calibrated.contains("not a calibration"), "{calibrated}");

    let mut wrong = json(&at("cal.json"));
    wrong["status"] = "does_not_fit".into();
    std::fs::write(at("wrong.json"), wrong.to_string()).unwrap();
    let said = host(folder.path(), &["observe", "wrong.json", "run.mcap"], 4);
    assert!(
        said.lines().next().unwrap().contains("not to be trusted") && said.contains("WARNING: does_not_fit"),
        "{said}"
    );

    let mut paper = json(&at("cal.json"));
    paper["preset"] = "paper".into();
    std::fs::write(at("paper.json"), paper.to_string()).unwrap();
    assert!(host(folder.path(), &["observe", "paper.json", "run.mcap"], 4).contains("--preset default"));
    let said = host(folder.path(), &["export", "paper.json", "--observer", "no.bin"], 4);
    assert!(said.contains("--preset default") && !at("no.bin").exists(), "{said}");
    assert!(host(folder.path(), &["observe", "cal.json", "run.mcap", "-o", "observed.json"], 2).contains("--force"));
}
