//! Motions that cannot show everything: what they do not show is named and given no number, and what is given a number is right.

use std::path::{Path, PathBuf};

use host::calibrate::comparable_truth;
use host::effect::TrueValue;
use host::robot::Robot;
use host::simulate::SHORT_MOTION;
use protocol::{Action, JointSet, Motion};
use serde_json::Value;
use tempfile::TempDir;
use tests::{host_succeeds, json, parameter};

/// A robot that played a motion.
struct Played {
    scratch: TempDir,
    truth: Vec<TrueValue>,
}

impl Played {
    fn file(&self, name: &str) -> PathBuf {
        self.scratch.path().join(name)
    }

    /// The robot of a seed plays `motion`, every other seed with process noise.
    fn new(motion: &Motion, seed: u64) -> Self {
        let mut played = Self { scratch: tempfile::tempdir().unwrap(), truth: Vec::new() };
        let (file, truth) = (played.file("motion.toml"), played.file("truth.json"));
        std::fs::write(&file, toml::to_string(motion).unwrap()).unwrap();
        let port = format!("sim:seed={seed},process_noise={},truth={}", seed % 2, truth.display());
        let run = played.file("run.mcap");
        host_succeeds([
            "record".as_ref(),
            "--port".as_ref(),
            port.as_ref(),
            "--motion".as_ref(),
            &*file,
            "-o".as_ref(),
            &run,
        ]);
        let told = json(&truth);
        let values = told["truth"].as_array().unwrap().iter().map(|value| TrueValue {
            name: value["name"].as_str().unwrap().to_owned(),
            unit: "",
            value: value["value"].as_f64().unwrap(),
        });
        played.truth = comparable_truth(&Robot::builtin("doggy").unwrap(), &values.collect::<Vec<_>>());
        played
    }

    /// Takes everything before the first input away.
    fn without_rest(self) -> Self {
        let (run, table) = (self.file("run.mcap"), self.file("run.csv"));
        host_succeeds([Path::new("export"), &run, Path::new("--csv"), &table]);
        let text = std::fs::read_to_string(&table).unwrap();
        let moves = |row: &str| row.split(',').skip(1).take(3).any(|u| u.parse::<f64>().is_ok_and(|u| u != 0.0));
        let comments_and_header = text.lines().position(|line| line.starts_with("t_us")).unwrap();
        let (head, rows) = text.split_at(text.match_indices('\n').nth(comments_and_header).unwrap().0 + 1);
        let rows: Vec<&str> = rows.lines().skip_while(|row| !moves(row)).collect();
        std::fs::write(&table, head.to_owned() + &rows.join("\n") + "\n").unwrap();
        let force = Path::new("--force");
        host_succeeds([Path::new("import"), &table, Path::new("-o"), &run, force]);
        self
    }

    /// Calibrates and checks; no interval may miss the truth, and both say the same of what is not shown. Returns CAL.json.
    fn calibrated(&self, told: &str) -> Value {
        self.calibrated_with(&[], told)
    }

    fn calibrated_with(&self, options: &[&str], told: &str) -> Value {
        let (run, cal, check) = (self.file("run.mcap"), self.file("cal.json"), self.file("check.json"));
        let options = options.iter().map(Path::new);
        host_succeeds([Path::new("calibrate"), &run, Path::new("-o"), &cal].into_iter().chain(options));
        tests::run_host([Path::new("check"), &run, Path::new("-o"), &check]);
        let (cal, check) = (json(&cal), json(&check));
        let findings = check["findings"].as_array().unwrap();
        for parameter in cal["parameters"].as_array().unwrap() {
            let name = parameter["name"].as_str().unwrap();
            let estimate = parameter["estimate"].as_f64().unwrap();
            let truth = self.truth.iter().find(|value| value.name == name).unwrap().value;
            let error = parameter["std_error"].as_f64();
            let z = error.map(|error| (estimate - truth) / error);
            eprintln!(
                "{told}: {name:10} truth {truth:10.5} start {:10.5} estimate {estimate:10.5} ± {error:.2?} z {z:.2?}",
                parameter["initial"]
            );
            match z {
                // Some 250 intervals: 4.5 standard errors leave one in 600 runs of this story to chance.
                Some(z) => {
                    assert!(z.abs() < 4.5, "{told}: {name} is {estimate}, the truth {truth}: {z:.1} standard errors")
                }
                None => {
                    assert!(parameter["ci95"].is_null() && parameter["identifiable"] == false, "{told}: {parameter}");
                }
            }
        }
        for unobservable in cal["unobservable"].as_array().unwrap() {
            eprintln!("{told}: {unobservable}");
        }
        for finding in findings.iter().filter(|finding| finding["about"] == "identifiability") {
            eprintln!("{told}: check: {}", finding["message"]);
        }
        cal
    }
}

/// Which of these parameters were given a number.
fn identified<'n>(cal: &Value, names: &[&'n str]) -> Vec<&'n str> {
    names.iter().copied().filter(|name| parameter(cal, name)["identifiable"] == true).collect()
}

/// The short motion with every segment changed, or left out.
fn short(change: impl Fn(u8, &mut Action) -> bool) -> Motion {
    let mut motion: Motion = toml::from_str(SHORT_MOTION).unwrap();
    let segments = std::mem::take(&mut motion.segments);
    motion.segments = segments
        .into_iter()
        .filter_map(|mut segment| change(segment.stage, &mut segment.action).then_some(segment))
        .collect();
    motion
}

/// One joint in all stages, the others held.
fn one_axis(axis: usize) -> Motion {
    short(|_, action| match action {
        Action::MoveTo { joints, targets, .. } if joints.contains(axis) => {
            let target = targets[joints.rank(axis).unwrap()];
            (*joints, *targets) = (JointSet::only(axis), [target].into_iter().collect());
            true
        }
        Action::Chirp { joints, .. } | Action::Sine { joints, .. } if joints.contains(axis) => {
            *joints = JointSet::only(axis);
            true
        }
        Action::Zero { .. } | Action::Hold { .. } => true,
        _ => false,
    })
}

/// A joint that rests is not without motion: the bodies' products of inertia let yaw and pitch shake one another, 18 counts of the
/// motor's encoder, and the gyros see every link swing on its belt. What sticks for all that shows no friction.
#[test]
fn one_axis_shows_the_motors_and_itself() {
    for (axis, seed, sticking) in [(0, 1, &["mu[3]"][..]), (1, 2, &["mu[3]"]), (2, 3, &["mu[1]", "mu[2]"])] {
        let cal = Played::new(&one_axis(axis), seed).calibrated(&format!("axis {} only", axis + 1));
        let own = ["mu", "k_s", "d_s"].map(|name| format!("{name}[{}]", axis + 1));
        let shown: Vec<&str> = ["k_pwm", "k_mi", "b"].into_iter().chain(own.iter().map(String::as_str)).collect();
        assert_eq!(identified(&cal, &shown), shown);
        assert_eq!(identified(&cal, sticking), [""; 0], "axis {} moved", axis + 1);
        let unobservable = cal["unobservable"].as_array().unwrap();
        for name in sticking {
            let told = unobservable.iter().find(|told| told["direction"][0][0] == **name).unwrap();
            let reason = told["reason"].as_str().unwrap();
            // Where a busy machine lost ticks, what creeps over the gap may draw μ so low that the model slides; then that is told.
            let reasons = ["never turned faster than", "standard errors away"];
            assert!(reasons.iter().any(|one| reason.contains(one)), "{name}: {reason}");
        }
    }
}

#[test]
fn a_slow_stage_alone_gives_no_false_number() {
    for seed in [4, 5] {
        let motion = short(|stage, _| stage < 2);
        let cal = Played::new(&motion, seed).calibrated("slow only");
        assert_eq!(identified(&cal, &["mu[1]", "mu[2]", "mu[3]"]).len(), 3);
    }
}

#[test]
fn without_a_rest_before_it_a_motion_still_tells_the_truth() {
    for seed in [6, 7] {
        let cal = Played::new(&short(|_, _| true), seed).without_rest().calibrated("no rest");
        assert_eq!(cal["unobservable"].as_array().unwrap().len(), 1, "{}", cal["unobservable"]);
    }
}

#[test]
fn a_second_of_motion_says_little_and_knows_it() {
    let motion = short(|stage, action| match action {
        Action::Zero { duration_ms } => {
            *duration_ms = 500;
            true
        }
        Action::MoveTo { joints, timeout_ms, .. } if stage == 5 && joints.len() == 3 => {
            *timeout_ms = 250;
            true
        }
        _ => false,
    });
    for seed in [8, 9] {
        Played::new(&motion, seed).calibrated("very short");
    }
}

#[test]
fn a_robot_that_never_moves_shows_its_biases_alone() {
    let motion = short(|_, action| matches!(action, Action::Zero { .. }));
    for seed in [10, 11] {
        let played = Played::new(&motion, seed);
        // Whoever records no motion by mistake is told; whoever means it says so.
        let refused = tests::run_host([Path::new("calibrate"), &played.file("run.mcap")]);
        assert_eq!(refused.status.code(), Some(4));
        assert!(String::from_utf8_lossy(&refused.stderr).contains("the input is zero in the whole recording"));
        let cal = played.calibrated_with(&["--unchecked"], "never moves");
        let parameters = cal["parameters"].as_array().unwrap();
        let shown: Vec<&str> =
            parameters.iter().filter(|p| p["identifiable"] == true).map(|p| p["name"].as_str().unwrap()).collect();
        assert_eq!(shown, ["bias1[x]", "bias1[y]", "bias1[z]", "bias2[x]", "bias2[y]", "bias2[z]"]);
        for p in parameters.iter().filter(|p| p["identifiable"] == false) {
            let (start, estimate) = (p["initial"].as_f64().unwrap(), p["estimate"].as_f64().unwrap());
            assert!((start - estimate).abs() < 1e-6, "held at its start value: {p}");
        }
        assert_eq!(cal["status"], "unidentifiable");
    }
}
