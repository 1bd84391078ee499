//! `host plan` as a user meets it: the commands of host/doc/plan.md, what the plan promises, the same file for the same seed, refusals.

use std::path::Path;
use std::process::Command;

use protocol::Motion;
use serde_json::Value;

use crate::commands_of;
use crate::program::{host, json};

/// Runs the commands of a block in `folder`; what those that plan said.
fn follow(folder: &Path, block: usize) -> Vec<String> {
    let mut plans = Vec::new();
    for command in commands_of(include_str!("../../doc/plan.md"), block) {
        let words: Vec<&str> = command.iter().map(String::as_str).collect();
        let (arguments, to) = match words.iter().position(|word| *word == ">") {
            Some(at) => (&words[..at], Some(words[at + 1])),
            None => (&words[..], None),
        };
        let output = Command::new(env!("CARGO_BIN_EXE_host")).current_dir(folder).args(arguments).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{arguments:?}: {said}");
        if let Some(name) = to {
            std::fs::write(folder.join(name), &output.stdout).unwrap();
        }
        if command[0] == "plan" {
            plans.push(said.into_owned());
        }
    }
    plans
}

fn motion(path: &Path) -> Motion {
    toml::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

fn named<'a>(list: &'a Value, name: &str) -> Option<&'a Value> {
    list.as_array().unwrap().iter().find(|p| p["name"] == name)
}

/// A plan from a calibration: it is played without a stop, and the errors that it promises are those of the calibration on it.
#[test]
fn what_a_plan_promises_holds() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let short = concat!(env!("CARGO_MANIFEST_DIR"), "/src/simulate/motion/short.toml");
    std::fs::copy(short, at("short.toml")).unwrap();
    for said in follow(folder.path(), 0) {
        assert!(said.contains("expected errors"), "{said}");
        assert!(said.contains("host record --port PORT --motion planned.toml"), "{said}");
    }
    let page = std::fs::read_to_string(at("planned.html")).unwrap();
    assert!(page.contains("Expected standard errors") && page.contains("Motor positions"));
    let (promised, second) = (json(&at("expected.json")), json(&at("second.json")));
    let truth = json(&at("truth.json"));
    let duration_s = promised["duration_s"].as_f64().unwrap();
    assert!(duration_s <= 24.0, "{duration_s}");
    assert_eq!(motion(&at("planned.toml")).segments.len() as u64, promised["segments"].as_u64().unwrap());
    // Played for a third of the time, the preset would have √3 of its errors: for its length the plan tells more. Measured for seeds 0 to 5: 0.67 to 0.84 of that.
    let as_long = (promised["preset_duration_s"].as_f64().unwrap() / duration_s).sqrt();
    let ratio = promised["error_ratio"].as_f64().unwrap();
    assert!(ratio < as_long, "{ratio} of the preset's errors, which has {as_long} in that time");
    let mut dynamic = 0;
    for p in promised["parameters"].as_array().unwrap().iter().filter(|p| !p["ratio"].is_null()) {
        let name = p["name"].as_str().unwrap();
        let expected = p["std_error"].as_f64().unwrap();
        let calibrated = named(&second["parameters"], name).unwrap();
        let error = calibrated["std_error"].as_f64().unwrap();
        let off =
            calibrated["estimate"].as_f64().unwrap() - named(&truth["truth"], name).unwrap()["value"].as_f64().unwrap();
        eprintln!(
            "{name:8} promised ± {expected:.3e}, calibrated ± {error:.3e}, off by {:.2} promised errors",
            off / expected
        );
        // The calibration estimates the noise of each motion anew. Measured: 0.74 to 1.42.
        assert!((0.6..1.6).contains(&(error / expected)), "{name}: promised ± {expected}, calibrated ± {error}");
        // The largest of twelve is beyond 4 in one case of a thousand.
        assert!(off.abs() < 4.0 * expected, "{name}: off by {off}, promised ± {expected}");
        dynamic += 1;
    }
    assert_eq!(dynamic, 12);
}

/// A plan for one effect, and one that tells two apart: the effect's size comes out as well as promised, and the plan shows more of it than the preset would in its time.
#[test]
fn what_a_plan_for_an_effect_promises_holds() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let plans = follow(folder.path(), 1);
    assert!(plans.iter().all(|said| said.contains("standard errors (preset ")), "{plans:?}");
    let [promised, apart, second] = ["expected.json", "apart.json", "second.json"].map(|name| json(&at(name)));
    assert_eq!(promised["effects"], serde_json::json!(["load_friction"]));
    assert_eq!((&promised["for_parameters"], &apart["for_parameters"]), (&Value::Bool(false), &Value::Bool(false)));
    let size = &promised["sizes"][0];
    let (name, expected) = (size["name"].as_str().unwrap(), size["std_error"].as_f64().unwrap());
    let calibrated = named(&second["parameters"], name).unwrap()["std_error"].as_f64().unwrap();
    eprintln!("{name} promised ± {expected:.3e}, calibrated ± {calibrated:.3e}");
    // Measured: 0.97.
    assert!((0.7..1.4).contains(&(calibrated / expected)), "promised ± {expected}, calibrated ± {calibrated}");
    let sizes: Vec<&str> =
        apart["sizes"].as_array().unwrap().iter().map(|size| size["name"].as_str().unwrap()).collect();
    assert!(sizes.contains(&"asymmetric_friction.dmu[1]") && sizes.contains(&"torque_offset.o[1]"), "{sizes:?}");
    let time = promised["preset_duration_s"].as_f64().unwrap() / promised["duration_s"].as_f64().unwrap();
    let [for_one, for_both] = [&promised, &apart].map(|plan| plan["error_ratio"].as_f64().unwrap());
    // Measured: 1.68 of 2.37.
    assert!(for_one < time.sqrt(), "{for_one} of the preset's errors, which has {} in that time", time.sqrt());
    // As long as the preset. Measured: 0.51.
    eprintln!("apart: {for_both} of the preset's errors");
    assert!(for_both < 0.8, "{for_both} of the preset's errors");
    let page = std::fs::read_to_string(at("apart.html")).unwrap();
    assert!(page.contains("typical size of each effect") && page.contains("torque_offset.o[1]"));
}

/// Whatever the seed: a plan of a third of the preset's length tells more than a third of the preset would.
#[test]
fn plans_of_many_seeds_tell_more_than_the_preset_in_their_time() {
    let folder = tempfile::tempdir().unwrap();
    host(folder.path(), &["record", "--port", "sim:robot=one_joint,seed=3", "-o", "first.mcap"], 0);
    host(folder.path(), &["calibrate", "first.mcap", "-o", "first.json"], 0);
    let mut worst = 0.0_f64;
    for seed in ["0", "1", "2", "3", "4"] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_host"));
        command.current_dir(folder.path()).args(["plan", "-q", "first.json", "--length", "24", "--rounds", "0"]);
        let output = command.args(["--json", "--seed", seed, "-o", &format!("{seed}.toml")]).output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
        let plan: Value = serde_json::from_slice(&output.stdout).unwrap();
        let time = plan["preset_duration_s"].as_f64().unwrap() / plan["duration_s"].as_f64().unwrap();
        let ratio = plan["error_ratio"].as_f64().unwrap();
        eprintln!("seed {seed}: {ratio:.2} of the preset's errors, which has {:.2} in that time", time.sqrt());
        worst = worst.max(ratio / time.sqrt());
    }
    // Measured with one further round and seeds 0 to 7: 0.33 to 0.73.
    assert!(worst < 0.95, "{worst}");
}

#[test]
fn the_same_seed_gives_the_same_motion() {
    let folder = tempfile::tempdir().unwrap();
    let plan = |seed: &str, name: &str| {
        host(
            folder.path(),
            &["plan", "-q", "one_joint", "--length", "12", "--rounds", "0", "--seed", seed, "-o", name],
            0,
        );
        std::fs::read_to_string(folder.path().join(name)).unwrap()
    };
    let (one, again, other) = (plan("1", "a.toml"), plan("1", "b.toml"), plan("2", "c.toml"));
    assert_eq!(one, again);
    assert_ne!(one, other);
    let said = host(folder.path(), &["plan", "one_joint", "-o", "a.toml"], 2);
    assert!(said.contains("--force"), "{said}");
}

#[test]
fn what_cannot_be_planned_is_refused_with_advice() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("cal.json"), "{}").unwrap();
    let refused: [(&[&str], i32, &str); 13] = [
        (&["plan", "doggy", "--for", "stribek", "-o", "m.toml"], 2, "did you mean `stribeck`"),
        (&["plan", "doggy", "--separate", "stribeck", "-o", "m.toml"], 2, "--separate A,B"),
        (&["plan", "doggy", "--for", "end_stop", "-o", "m.toml"], 2, "no derivative tells"),
        (&["plan", "doggy", "--for", "gyro_bias_drift", "-o", "m.toml"], 2, "another one in each recording"),
        (&["plan", "one_joint", "--for", "viscous_friction", "-o", "m.toml"], 2, "back-EMF"),
        (&["plan", "dogy", "-o", "m.toml"], 2, "did you mean `doggy`"),
        (&["plan", "emps", "-o", "m.toml"], 4, "robots that the firmware drives"),
        (&["plan", "doggy", "--length", "4", "-o", "m.toml"], 2, "give a longer --length"),
        (&["plan", "doggy", "--length=-1", "-o", "m.toml"], 2, "seconds above 0"),
        (&["plan", "doggy", "--duty", "1.5", "-o", "m.toml"], 2, "up to 1"),
        (&["plan", "cal.json", "-o", "m.toml"], 4, "host calibrate -o"),
        (&["plan", "none.json", "-o", "m.toml"], 3, "cannot read none.json"),
        (&["plan", "doggy", "--time-limit", "0.001", "-o", "m.toml"], 5, "--time-limit"),
    ];
    for (arguments, code, told) in refused {
        let said = host(folder.path(), arguments, code);
        assert!(said.contains(told), "{arguments:?}: {said}");
        assert!(!folder.path().join("m.toml").exists());
    }
}
