//! Readings that are nonsense now and then must not decide the parameters.

use std::path::Path;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;
use tests::{estimate, host_succeeds, is_dynamic, json, parameter};

/// Standard deviation of Doggy's gyros, rad/s.
const SIGMA: f64 = 1.745e-3;

/// How many readings of each channel were left out.
fn left_out(cal: &Value) -> Vec<(&str, u64)> {
    let noise = cal["noise"].as_array().unwrap().iter();
    let counts = noise.map(|noise| (noise["channel"].as_str().unwrap(), noise["left_out"].as_u64().unwrap()));
    counts.filter(|(_, count)| *count > 0).collect()
}

/// Two percent of the readings of one gyro axis are off by 50 standard deviations either way, in a table that a user imports: every
/// parameter of the dynamics stays within 1 % of the truth, and hardly moves from what the sound table gives.
#[test]
fn two_percent_of_nonsense_on_a_gyro_axis_moves_no_parameter() {
    let scratch = tempfile::tempdir().unwrap();
    let [truth, run, table, spoilt, sound_cal, cal] =
        ["truth.json", "run.mcap", "run.csv", "spoilt.mcap", "sound.json", "cal.json"]
            .map(|name| scratch.path().join(name));
    let motion = scratch.path().join("short.toml");
    std::fs::write(&motion, host::simulate::SHORT_MOTION).unwrap();
    let port = format!("sim:seed=21,process_noise=1,truth={}", truth.display());
    let [record, with_port, with_motion, to] = ["record", "--port", "--motion", "-o"].map(Path::new);
    host_succeeds([record, with_port, Path::new(&port), with_motion, &motion, to, &run]);
    host_succeeds([Path::new("export"), &run, Path::new("--csv"), &table]);
    host_succeeds([Path::new("calibrate"), &run, Path::new("-o"), &sound_cal]);
    let sound = json(&sound_cal);
    assert_eq!(left_out(&sound), [], "nothing of a sound recording is left out");

    let text = std::fs::read_to_string(&table).unwrap();
    let header = text.lines().position(|line| line.starts_with("t_us")).unwrap();
    let column = text.lines().nth(header).unwrap().split(',').position(|name| name == "g2y").unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(21);
    let mut outliers = 0;
    let rows = text.lines().enumerate().map(|(k, row)| {
        let mut fields: Vec<String> = row.split(',').map(str::to_owned).collect();
        if k > header && rng.random_bool(0.02) {
            let sign = if rng.random_bool(0.5) { 50.0 } else { -50.0 };
            fields[column] = (fields[column].parse::<f64>().unwrap() + sign * SIGMA).to_string();
            outliers += 1;
        }
        fields.join(",")
    });
    let rows = rows.collect::<Vec<_>>().join("\n");
    std::fs::write(&table, rows + "\n").unwrap();
    assert!(outliers > 300, "{outliers}");

    host_succeeds([Path::new("import"), &table, Path::new("-o"), &spoilt]);
    let said = host_succeeds([Path::new("calibrate"), &spoilt, Path::new("-o"), &cal]);
    let (cal, told) = (json(&cal), json(&truth));
    let left_out = left_out(&cal);
    eprintln!("{outliers} outliers, left out: {left_out:?}");
    let [("gyro2.y", count)] = left_out[..] else { panic!("{left_out:?}") };
    assert!(count.abs_diff(outliers) <= outliers / 100, "{count} of {outliers} left out");
    assert!(said.contains(&format!("left out as outliers: {count} readings of gyro2.y")), "{said}");
    for value in told["truth"].as_array().unwrap() {
        let name = value["name"].as_str().unwrap();
        if !is_dynamic(name) {
            continue;
        }
        let truth = value["value"].as_f64().unwrap();
        let found = estimate(&cal, name);
        let error = parameter(&cal, name)["std_error"].as_f64().unwrap();
        let moved = (found - estimate(&sound, name)) / error;
        let percent = 100.0 * (found / truth - 1.0);
        eprintln!("{name}: {found} of {truth}, {percent:+.4} %, {moved:+.3} standard errors from the sound table's");
        assert!(percent.abs() < 1.0, "{name}: {found} of {truth}");
        assert!(moved.abs() < 0.5, "{name} moved by {moved} standard errors");
    }
}
