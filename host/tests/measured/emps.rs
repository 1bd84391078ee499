//! EMPS, a published benchmark: a carriage on a ball screw, measured. The program's figures beside the published ones (host/doc/emps.md).

use crate::files::{machine, parameter, within};
use crate::program::{host, json};

#[test]
fn published_figures_come_out_with_and_without_direction_dependent_friction() {
    let Some(data) = machine("emps") else { return };
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for (table, run) in [("emps_id.csv", "id.mcap"), ("emps_pulses_val.csv", "pulses.mcap")] {
        host(at, &["import", data.join(table).to_str().unwrap(), "--robot", "emps", "-o", run], 0);
    }
    host(at, &["calibrate", "id.mcap", "-o", "cal.json"], 0);
    let cal = json(&at.join("cal.json"));
    // The joint fit as the page prints it, its last digit either way. What it says of itself reaches the published values.
    for (name, value, digit, published) in [
        ("b[1]", 94.87, 0.01, 95.1089),
        ("v[1]", 206.3, 0.1, 203.5034),
        ("mu[1]", 20.22, 0.01, 20.3935),
        ("o[1]", -3.19, 0.01, -3.1648),
    ] {
        let parameter = parameter(&cal["parameters"], name);
        let (found, error) = (parameter["estimate"].as_f64().unwrap(), parameter["std_error"].as_f64().unwrap());
        assert!((found - value).abs() < digit, "{name}: {found}, measured {value}");
        assert!((found - published).abs() < 2.0 * error, "{name}: {found} ± {error}, published {published}");
    }
    assert_eq!(cal["scatter"]["coloured"], true);
    // The reversals of the motion, at which friction is not that of the law.
    assert_eq!(cal["pushes"].as_array().unwrap().len(), 7, "{}", cal["pushes"]);

    // The published recipe, identified on the free motion, tested on the one with pulses: 1 % and the printed digits.
    let torque = |run: &str, out: &str| {
        let recipe = ["--metric", "torque", "--identify-on", "id.mcap", "--corner", "100", "-o", out];
        host(at, &[&["verify", "cal.json", run], &recipe[..]].concat(), 0);
        json(&at.join(out))
    };
    let (own, cross) = (torque("id.mcap", "own.json"), torque("pulses.mcap", "cross.json"));
    for (name, published) in [("b[1]", 95.1089), ("v[1]", 203.5034), ("mu[1]", 20.3935), ("o[1]", -3.1648)] {
        let found = parameter(&own["parameters"], name)["identified"].as_f64().unwrap();
        assert!((found / published - 1.0).abs() < 0.01, "{name}: {found} of the published {published}");
    }
    // Published 4.08 % and 5.98 %; measured 4.03 % and 5.93 %.
    within(&own["joints"][0]["relative_error_identified"], 0.0395..=0.0414);
    within(&cross["joints"][0]["relative_error_identified"], 0.0585..=0.0604);

    // With the friction that differs by direction the recipe leaves 3.1 % and 5.3 %.
    host(at, &["calibrate", "id.mcap", "--extend", "asymmetric_friction", "-o", "extended.json"], 0);
    let extended = |run: &str, out: &str| {
        let recipe = ["--metric", "torque", "--identify-on", "id.mcap", "--corner", "100", "-o", out];
        host(at, &[&["verify", "extended.json", run], &recipe[..]].concat(), 0);
        json(&at.join(out))
    };
    let own = extended("id.mcap", "own2.json");
    let dv = parameter(&own["parameters"], "asymmetric_friction.dv[1]");
    assert_eq!(dv["unit"], "N s/m");
    // Half the difference of 166.7 and 240.3 N s/m: −36.8; measured −36.4 both ways.
    within(&dv["identified"], -37.5..=-35.5);
    within(&dv["calibrated"], -38.0..=-34.5);
    within(&own["joints"][0]["relative_error_identified"], 0.030..=0.0314);
    within(&extended("pulses.mcap", "cross2.json")["joints"][0]["relative_error_identified"], 0.0525..=0.0538);

    // A recording with the wrong sign is refused, whichever of the two it is.
    let table = std::fs::read_to_string(data.join("emps_pulses_val.csv")).unwrap();
    let turned = |line: &str| {
        let mut fields: Vec<String> = line.split(',').map(str::to_owned).collect();
        if let Ok(input) = fields[1].parse::<f64>() {
            fields[1] = (-input).to_string();
        }
        fields.join(",") + "\n"
    };
    std::fs::write(at.join("turned.csv"), table.lines().map(turned).collect::<String>()).unwrap();
    host(at, &["import", "turned.csv", "--robot", "emps", "-o", "turned.mcap"], 0);
    for runs in [["turned.mcap", "id.mcap"], ["id.mcap", "turned.mcap"]] {
        let arguments = ["verify", "cal.json", runs[0], "--metric", "torque", "--identify-on", runs[1]];
        let text = host(at, &arguments, 4);
        assert!(text.contains("turned.mcap cannot be used") && text.contains("--unchecked"), "{text}");
    }
}

#[test]
fn the_diagnosis_finds_friction_by_direction_its_rise_at_low_speed_and_the_ripple_of_the_screw() {
    let Some(data) = machine("emps") else { return };
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for (table, run) in [("emps_id.csv", "id.mcap"), ("emps_pulses_val.csv", "pulses.mcap")] {
        host(at, &["import", data.join(table).to_str().unwrap(), "--robot", "emps", "-o", run], 0);
    }
    host(at, &["diagnose", "id.mcap", "--holdout", "pulses.mcap", "-o", "diagnosis.json"], 10);
    let diagnosis = json(&at.join("diagnosis.json"));
    let findings = diagnosis["findings"].as_array().unwrap();
    let find = |id: &str| findings.iter().find(|finding| finding["effect"] == id);
    let by_direction = find("asymmetric_friction").unwrap_or_else(|| panic!("{}", diagnosis["summary"]));
    // Published: half the difference of 166.7 and 240.3 N s/m.
    within(&parameter(&by_direction["parameters"], "asymmetric_friction.dv[1]")["estimate"], DV);
    assert!(find("stribeck").is_some(), "{}", diagnosis["summary"]);
    let ripple = find("cogging").unwrap_or_else(|| panic!("{}", diagnosis["summary"]));
    // Its phase is another one on the motion with pulses.
    assert!(ripple["flags"].as_array().unwrap().iter().any(|flag| flag == "own_phase"), "{ripple}");
    let gains = diagnosis["holdout_gain"]["by_horizon"].as_array().unwrap();
    let ahead = gains.iter().find(|gain| gain["horizon_s"] == 0.5).unwrap();
    assert!(ahead["share"].as_f64().unwrap() >= 0.25 && ahead["ci95"][0].as_f64().unwrap() > 0.0, "{ahead}");
    for finding in findings {
        assert!(finding["holdout_gain"]["ci95"][1].as_f64().unwrap() > 0.0, "{finding}");
    }
}

/// What Δv comes out as: −36.8 N s/m published.
const DV: std::ops::RangeInclusive<f64> = -39.8..=-33.0;

#[test]
fn options_of_the_torque_metric_belong_to_it() {
    let folder = tempfile::tempdir().unwrap();
    let text = host(folder.path(), &["verify", "cal.json", "run.mcap", "--identify-on", "run.mcap"], 2);
    assert!(text.contains("--metric torque"), "{text}");
    let page = ["verify", "cal.json", "run.mcap", "--metric", "torque", "--report", "page.html"];
    let text = host(folder.path(), &page, 2);
    assert!(text.contains("no page"), "{text}");
}
