//! `host export` as a user meets it: the worked example of host/doc/model.md, exit codes, files that exist.

use std::path::Path;
use std::process::Command;

use crate::program::{host, json};
use serde_json::Value;

/// The document's blocks in a language.
fn blocks(language: &str) -> impl Iterator<Item = &'static str> {
    let fence = format!("```{language}\n");
    let blocks: Vec<_> = include_str!("../../doc/model.md").split(&fence).skip(1).collect();
    blocks.into_iter().filter_map(|rest| rest.split("```").next())
}

/// The blocks of the document that are meant to be typed.
fn example() -> String {
    blocks("sh").collect::<Vec<_>>().join("\n")
}

/// What a block in Python prints in `folder`; none where Python lacks the package that it begins with, which is told.
fn by_python(block: &str, folder: &Path) -> Option<String> {
    let python = || Command::new(std::env::var_os("PYTHON").unwrap_or_else(|| "python3".into()));
    let package = block.split_whitespace().nth(1).unwrap();
    let works =
        python().args(["-c", &format!("import {package}")]).output().is_ok_and(|output| output.status.success());
    if !works {
        eprintln!(
            "SKIPPED the lines for {package} in host/doc/model.md: python3 -m pip install {package}, or PYTHON=… with it"
        );
        return None;
    }
    let output = python().args(["-c", block]).current_dir(folder).output().unwrap();
    assert!(output.status.success(), "{package}: {}", String::from_utf8_lossy(&output.stderr));
    Some(String::from_utf8(output.stdout).unwrap())
}

fn parameters(calibration: &Value) -> impl Iterator<Item = (&str, &Value)> {
    let parameters = calibration["parameters"].as_array().unwrap().iter();
    parameters.map(|parameter| (parameter["name"].as_str().unwrap(), parameter))
}

#[test]
fn the_document_is_true_and_a_second_calibration_starts_where_the_first_ended() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let binaries = Path::new(env!("CARGO_BIN_EXE_host")).parent().unwrap();
    let path = format!("{}:{}", binaries.display(), std::env::var("PATH").unwrap());
    let short = concat!(env!("CARGO_MANIFEST_DIR"), "/src/simulate/motion/short.toml");
    let ended = Command::new("sh")
        .args(["-eu", "-c", &example()])
        .envs([("PATH", path.as_str()), ("MOTION", short)])
        .current_dir(folder.path())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&ended.stderr);
    assert!(ended.status.success(), "{}:\n{said}", ended.status);
    for file in ["identified.toml", "doggy.c", "doggy.h", "doggy.rs", "doggy.xml", "doggy.urdf"] {
        let text = std::fs::read_to_string(at(file)).unwrap();
        assert!(text.contains("calibrated by host"), "{file}");
        assert!(file == "doggy.c" || text.contains("keeps of the model"), "{file}");
        assert!(said.contains(file), "{file}: {said}");
    }
    let read = |name: &str| std::fs::read_to_string(at(name)).unwrap();
    assert_eq!(read("by_c"), read("by_rust"));
    let position: f64 = read("by_c").split_whitespace().nth(1).unwrap().parse().unwrap();
    assert!(read("by_c").starts_with("q1 ") && (0.05..1.0).contains(&position), "{position}");

    for block in blocks("python") {
        if let Some(printed) = by_python(block, folder.path()) {
            let expected = if block.starts_with("import casadi") { "(12, 12)\n".to_owned() } else { read("by_c") };
            assert_eq!(printed, expected, "{block}");
        }
    }

    let (first, second) = (json(&at("cal.json")), json(&at("second.json")));
    for ((name, first), (_, second)) in parameters(&first).zip(parameters(&second)) {
        let (ended, started) = (first["estimate"].as_f64().unwrap(), second["initial"].as_f64().unwrap());
        if name.starts_with("bias") {
            continue; // starts from the recording's own rest
        }
        // Mountings are told from the new nominal ones.
        let expected = if name.starts_with("R_imu") { 0.0 } else { ended };
        assert!((started - expected).abs() <= 1e-12 * expected.abs(), "{name}: {ended}, {started}");
    }
    host(folder.path(), &["calibrate", "-q", "second.mcap", "-o", "afresh.json"], 0);
    let afresh = json(&at("afresh.json"));
    for ((name, afresh), (_, second)) in parameters(&afresh).zip(parameters(&second)) {
        let Some(error) = afresh["std_error"].as_f64().filter(|_| !name.starts_with("R_imu")) else { continue };
        let off = (second["estimate"].as_f64().unwrap() - afresh["estimate"].as_f64().unwrap()) / error;
        // Two searches for one minimum end within a tenth of a standard error of each other.
        assert!(off.abs() < 0.1, "{name}: {off} standard errors apart");
    }
    let iterations = |calibration: &Value| calibration["iterations"].as_u64().unwrap();
    eprintln!("iterations: {} afresh, {} from the robot file", iterations(&afresh), iterations(&second));
    assert!(iterations(&second) <= iterations(&afresh));

    // Files that exist are left alone, the header as well as the code.
    for arguments in [["--rust", "doggy.rs"], ["--c", "doggy.h"], ["--fmu", "doggy.fmu"]] {
        let said = host(folder.path(), &["export", "cal.json", arguments[0], arguments[1]], 2);
        assert!(said.contains("--force"), "{said}");
    }
    host(folder.path(), &["export", "cal.json", "--c", "doggy.h", "--force"], 0);
    assert_eq!(host(folder.path(), &["export", "cal.json", "--csv", "out.csv"], 2).matches("recording").count(), 2);
    assert!(host(folder.path(), &["export", "run.mcap", "--rust", "out.rs"], 4).contains("not a calibration"));
    assert!(!at("out.rs").exists() && !at("out.csv").exists());

    // What must not be trusted is written, told, and answered by the calibration's own exit code.
    for (status, code) in [("does_not_fit", 4), ("iteration_limit", 5), ("unidentifiable", 0)] {
        let mut changed = first.clone();
        changed["status"] = status.into();
        std::fs::write(at("changed.json"), changed.to_string()).unwrap();
        let said = host(folder.path(), &["export", "changed.json", "--mjcf", "changed.xml", "--force"], code);
        assert!(said.lines().next().unwrap().contains(&format!("WARNING: {status}")), "{said}");
        assert!(std::fs::read_to_string(at("changed.xml")).unwrap().contains(&format!("WARNING: {status}")));
    }
}
