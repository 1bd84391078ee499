//! A simulated robot has something that the model does not know. `host diagnose` says what, from the recording alone.

use std::path::{Path, PathBuf};

use host::simulate::SHORT_MOTION;
use serde_json::Value;
use tempfile::TempDir;
use tests::{host_succeeds, json, run_host};

/// A robot that was recorded on the short motion, and what is true of it.
struct Recorded {
    scratch: TempDir,
    truth: Value,
}

impl Recorded {
    /// The robot of `seed` with these effects, as in `sim:effect=…`.
    fn new(seed: u64, effects: &[&str]) -> Self {
        let scratch = tempfile::tempdir().unwrap();
        let file = |name: &str| scratch.path().join(name);
        let (motion, truth, run) = (file("motion.toml"), file("truth.json"), file("run.mcap"));
        std::fs::write(&motion, SHORT_MOTION).unwrap();
        let effects: String = effects.iter().map(|effect| format!(",effect={effect}")).collect();
        let port = format!("sim:seed={seed},truth={}{effects}", truth.display());
        let arguments = ["record".as_ref(), "--port".as_ref(), port.as_ref(), "--motion".as_ref(), &*motion];
        host_succeeds(arguments.into_iter().chain(["-o".as_ref(), &*run]));
        let truth = json(&truth);
        Self { scratch, truth }
    }

    fn file(&self, name: &str) -> PathBuf {
        self.scratch.path().join(name)
    }

    /// The exit code, DIAG.json and what a terminal shows.
    fn diagnosed(&self, without: &[&str]) -> (i32, Value, String) {
        let (run, diag, page) = (self.file("run.mcap"), self.file("diag.json"), self.file("diag.html"));
        let mut arguments = vec![Path::new("diagnose"), &run, Path::new("-o"), &diag, Path::new("--report"), &page];
        for id in without {
            arguments.extend([Path::new("--without"), Path::new(id)]);
        }
        let output = run_host(arguments);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        eprintln!("{said}");
        let page = std::fs::read_to_string(&page).unwrap();
        let diag = json(&diag);
        assert!(
            page.contains(&diag["base_fit"]["sentence"].as_str().unwrap().replace('\'', "&#39;")),
            "the page leads with whether the model fits"
        );
        (output.status.code().unwrap(), diag, said)
    }

    fn true_value(&self, name: &str) -> f64 {
        let effects = self.truth["effects"].as_array().unwrap();
        let mut values = effects.iter().flat_map(|effect| effect["parameters"].as_array().unwrap());
        values.find(|value| value["name"] == name).unwrap()["value"].as_f64().unwrap()
    }
}

fn finding(diag: &Value) -> &Value {
    &diag["findings"][0]
}

fn estimate(finding: &Value, name: &str) -> f64 {
    let parameters = finding["parameters"].as_array().unwrap();
    parameters.iter().find(|p| p["name"] == name).unwrap()["estimate"].as_f64().unwrap()
}

/// The gain half a second ahead, with its interval.
fn gain(finding: &Value, sensor: &str) -> [f64; 3] {
    let gains = finding["gain"].as_array().unwrap();
    let gain = gains.iter().find(|gain| gain["channel"] == sensor && gain["horizon_s"] == 0.5).unwrap();
    [&gain["gain"], &gain["ci95"][0], &gain["ci95"][1]].map(|value| value.as_f64().unwrap())
}

#[test]
fn of_a_robot_without_an_effect_nothing_is_said() {
    let (exit, diag, said) = Recorded::new(3, &[]).diagnosed(&[]);
    assert_eq!((exit, &diag["verdict"]), (0, &Value::from("none")), "{said}");
    assert_eq!(diag["findings"], Value::Array(Vec::new()));
    let scan = diag["scan"].as_array().unwrap();
    assert!(scan.len() >= 30, "{} candidates", scan.len());
    // Each is the least p of a whole catalogue that is at least so small by chance; under 0.01 would be a false alarm.
    for candidate in scan {
        assert!(candidate["p_value"].as_f64().unwrap() > 0.01, "{candidate}");
    }
    assert_eq!(diag["base"]["parameters"], diag["extended"]["parameters"]);
}

#[test]
fn viscous_friction_is_named_on_the_right_joints_as_far_as_it_shows() {
    let recorded = Recorded::new(3, &["viscous_friction"]);
    let (exit, diag, said) = recorded.diagnosed(&[]);
    assert_eq!((exit, &diag["verdict"]), (10, &Value::from("named")), "{said}");
    assert_eq!(diag["findings"].as_array().unwrap().len(), 1, "{said}");
    let finding = finding(&diag);
    assert_eq!(finding["effect"], "viscous_friction");
    assert_eq!(finding["row"], "motor");
    assert_eq!(finding["axes"], serde_json::json!([1, 2, 3]));
    // What is common to all joints is the back-EMF term: only differences show.
    let names = [1, 2, 3].map(|joint| format!("viscous_friction.v[{joint}]"));
    let truth = names.each_ref().map(|name| recorded.true_value(name));
    let common = truth.iter().sum::<f64>() / 3.0;
    for (name, truth) in names.iter().zip(truth) {
        let off = estimate(finding, name) - (truth - common);
        // 0.3 % to 0.8 % of the difference measured; 5 % is what a large effect is held to.
        assert!(off.abs() < 0.05 * (truth - common).abs(), "{name} is off by {off}");
    }
    assert!(diag["not_testable"].as_array().unwrap().iter().any(|entry| entry["effect"] == "viscous_friction"));
    let [gained, low, high] = gain(finding, "gyro2");
    // 0.945 in [0.926, 0.957] measured.
    assert!(low > 0.85 && gained > low && high < 0.99, "{gained} in [{low}, {high}]");
    assert!(finding["explained_excess"].as_f64().unwrap() > 0.95);
}

#[test]
fn viscous_friction_that_is_the_same_on_all_joints_is_back_emf_to_any_motion_and_is_told_as_such() {
    let recorded = Recorded::new(3, &["viscous_friction=2.5"]);
    assert_eq!([1, 2, 3].map(|joint| recorded.true_value(&format!("viscous_friction.v[{joint}]"))), [2.5; 3]);
    let (exit, diag, said) = recorded.diagnosed(&[]);
    assert_eq!((exit, &diag["verdict"]), (0, &Value::from("none")), "{said}");
    let told = diag["not_testable"].as_array().unwrap().iter().find(|entry| entry["effect"] == "viscous_friction");
    assert!(told.unwrap()["why"].as_str().unwrap().contains("k_mi"), "{told:?}");
    // The back-EMF's coefficient has it: off by what is viscous, 2.5 N m s/rad.
    let values = recorded.truth["truth"].as_array().unwrap();
    let truth = values.iter().find(|value| value["name"] == "k_mi").unwrap()["value"].as_f64().unwrap();
    let taken = tests::estimate(&diag["base"], "k_mi") - truth;
    assert!((taken - 2.5).abs() < 0.05, "k_mi took {taken}");
}

#[test]
fn what_the_catalogue_has_no_name_for_is_unknown_and_placed() {
    let recorded = Recorded::new(4, &["viscous_friction"]);
    // Motors with other constants bend friction's curve over the speed too, and so does Stribeck's law with a v_s far above what is met.
    let (exit, diag, said) = recorded.diagnosed(&["viscous_friction", "motor_mismatch", "stribeck"]);
    assert_eq!((exit, &diag["verdict"]), (11, &Value::from("unknown")), "{said}");
    assert_eq!(diag["findings"], Value::Array(Vec::new()));
    let place = &diag["unexplained"]["where"][0];
    assert_eq!(place["row"], "motor");
    assert_eq!(place["argument"], "motor_speed");
}

#[test]
fn an_id_that_does_not_exist_is_a_fault_of_usage() {
    let recorded = Recorded::new(3, &[]);
    let run = recorded.file("run.mcap");
    let output = run_host([Path::new("diagnose"), &run, Path::new("--without"), Path::new("gremlins")]);
    assert_eq!(output.status.code(), Some(2), "{}", String::from_utf8_lossy(&output.stderr));
}
