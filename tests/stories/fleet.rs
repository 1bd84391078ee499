//! The worked example of host/doc/fleet.md, run as it stands there: recordings of several robots, a process each, one table.

use std::path::Path;
use std::process::Command;

use serde_json::Value;
use tests::{host, json, parameter, run_host};

/// The blocks of the document that are meant to be typed.
fn example() -> String {
    let document = include_str!("../../host/doc/fleet.md");
    let blocks = document.split("```sh\n").skip(1).filter_map(|rest| rest.split("```").next());
    blocks.collect::<Vec<_>>().join("\n")
}

fn numbers<'a>(merged: &'a Value, field: &'a str) -> impl Iterator<Item = (&'a str, f64)> {
    let parameters = merged["parameters"].as_array().unwrap().iter();
    parameters.map(move |p| (p["name"].as_str().unwrap(), p[field].as_f64().unwrap()))
}

#[test]
fn a_fleet_is_calibrated_by_a_process_a_recording() {
    let folder = tempfile::tempdir().unwrap();
    let short = concat!(env!("CARGO_MANIFEST_DIR"), "/../host/src/simulate/motion/short.toml");
    let binaries = host().get_program().to_owned();
    let binaries = Path::new(&binaries).parent().unwrap().to_owned();
    let path = format!("{}:{}", binaries.display(), std::env::var("PATH").unwrap());
    let ended = Command::new("sh")
        .args(["-eu", "-c", &example()])
        .envs([("PATH", path.as_str()), ("UNITS", "1 2"), ("MOTION", short)])
        .current_dir(folder.path())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&ended.stderr);
    assert!(ended.status.success(), "{}:\n{said}", ended.status);
    let at = |name: &str| folder.path().join("fleet").join(name);
    assert!(!at("failed").exists(), "{}", std::fs::read_to_string(at("failed")).unwrap());

    let table = json(&at("table.json"));
    assert_eq!(table["left_out"].as_array().unwrap().len(), 0, "{}", table["left_out"]);
    let groups = table["groups"].as_array().unwrap();
    assert_eq!(groups.len(), 2);
    for group in groups {
        let merged = &group["merged"];
        eprintln!("{}: p {}", group["name"], merged["p_value"]);
        assert_eq!(merged["count"], 2);
        // Two motions of one robot agree.
        assert_eq!(merged["consistent"], true, "{merged}");
    }
    // Two robots of one kind do not: each true parameter lies within ± 15 % of the same number.
    let fleet = &table["fleets"][0];
    assert_eq!((&fleet["name"], fleet["members"].as_array().unwrap().len()), (&Value::from("doggy"), 2));
    assert!(fleet["merged"]["p_value"].as_f64().unwrap() < 1e-9, "{fleet}");
    let spread = numbers(&fleet["merged"], "spread").find(|(name, _)| *name == "k_pwm").unwrap().1;
    let mean = numbers(&fleet["merged"], "population_mean").find(|(name, _)| *name == "k_pwm").unwrap().1;
    assert!((1e-4..0.3).contains(&(spread / mean)), "{spread} of {mean}");

    // What separate processes give merged is what one process gives with both recordings.
    let together = json(&at("unit1-together.json"));
    let merged = &groups[0]["merged"];
    let errors: Vec<(&str, f64)> = numbers(merged, "std_error").collect();
    for ((name, mean), (_, error)) in numbers(merged, "mean").zip(errors) {
        let one = parameter(&together, name);
        let Some(std_error) = one["std_error"].as_f64() else { continue };
        let off = (mean - one["estimate"].as_f64().unwrap()) / std_error;
        eprintln!(
            "{name:10} merged {mean:10.5} off by {off:6.3} standard errors, its error {:.3} of theirs",
            error / std_error
        );
        // Measured: within 0.17 standard errors of one another, errors within 7 %.
        assert!(off.abs() < 0.4, "{name}: merged {mean}, together {one}");
        assert!((0.87..1.15).contains(&(error / std_error)), "{name}: merged ± {error}, together {one}");
    }
    // Biases are each recording's own.
    for bias in ["bias1[x]@1", "bias1[x]@2", "bias2[z]@1", "bias2[z]@2"] {
        assert!(parameter(&together, bias)["std_error"].as_f64().is_some(), "{bias}");
    }
    assert!(together["parameters"].as_array().unwrap().iter().all(|p| p["name"] != "bias1[x]"));

    let csv = std::fs::read_to_string(at("table.csv")).unwrap();
    let widths: Vec<usize> = csv.lines().map(|line| line.split(',').count()).collect();
    assert!(widths.len() == 1 + 4 + 2 + 1 && widths.iter().all(|width| *width == widths[0]), "{csv}");
    assert!(std::fs::read_to_string(at("table.md")).unwrap().contains("| k_pwm | N m/V |"));

    // The same recording twice, a recording instead of a result: named, and not counted.
    let a = at("unit1/a.json");
    std::fs::copy(&a, at("unit1/again.json")).unwrap();
    let doubled = ["table".into(), a, at("unit1/again.json"), at("unit1/a.mcap"), "--json".into()];
    let output = run_host(doubled);
    assert!(output.status.success());
    let table: Value = serde_json::from_slice(&output.stdout).unwrap();
    let reasons: Vec<&str> =
        table["left_out"].as_array().unwrap().iter().map(|left| left["reason"].as_str().unwrap()).collect();
    assert!(
        matches!(reasons.as_slice(), [twice, foreign] if twice.contains("another calibration already") && foreign.contains("not a calibration")),
        "{reasons:?}"
    );
    assert_eq!(table["groups"][0]["merged"]["count"], 1);
    assert_eq!(run_host(["table".into(), at("unit1/a.mcap")]).status.code(), Some(4));
    assert_eq!(run_host(["table".into(), at("none.json")]).status.code(), Some(3));
}
