//! Does a planned motion tell more than the preset one, and does it keep the limits? Doggies drawn at random.

use std::path::Path;

use firmware::motion::preset;
use host::calibrate::{Calibration, Preset, calibrate};
use host::link::joint_limits;
use host::plan::{Belief, Plan, Settings as Planning, plan};
use host::robot::Robot;
use host::simulate::{Direct, Drawn, Options, Rehearsal, Truth};
use protocol::{Motion, MotionEnd};
use serde::{Deserialize, Serialize};
use solve::levenberg::Settings;

/// A robot.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Case {
    /// Draws parameters, mounts and noise.
    pub seed: u64,
}

/// One parameter after the preset motion, and after the planned one of the same length.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Told {
    /// Its name.
    pub name: String,
    /// Relative standard error that the plan promised.
    pub promised: f64,
    /// Relative standard errors of the calibrations: preset, planned.
    pub std_error: [f64; 2],
    /// Relative errors against the truth: preset, planned.
    pub off: [f64; 2],
}

/// What became of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// Which.
    pub case: Case,
    /// How the planned motion ended under the firmware's control loop: "finished", or the fault.
    pub end: String,
    /// Lengths of the preset and the planned motion on this robot, s.
    pub duration_s: [f64; 2],
    /// Largest part of its bound that a watch reached in the planned motion.
    pub watch: f32,
    /// The parameters of the dynamics.
    pub told: Vec<Told>,
}

/// Step of the plant where a motion is only watched, s.
const STEP_S: f64 = 1e-4;

/// Calibrates on the preset motion, plans from that, calibrates on the preset and on the planned motion with other noise.
///
/// # Panics
/// If the robot cannot be simulated, calibrated or planned for: then there is nothing to measure.
pub fn outcome(case: &Case) -> Outcome {
    let robot = Robot::builtin("doggy").expect("a built-in robot");
    let options = Options { seed: case.seed, ..Options::new(robot.clone()) };
    let preset = toml::to_string(&preset::calibration(&joint_limits(&robot))).expect("a motion is TOML");
    let play = |motion: &str, n| Direct::record_nth(&options, motion, n).expect("the robot can be simulated");
    let fit = |played: &Direct| {
        calibrate(&robot, &[&played.recording], Preset::Default, &Settings::default(), |_, _| {})
            .expect("the recording can be calibrated")
    };
    let first = fit(&play(&preset, 1));
    let belief = Belief::of_calibration(robot.clone(), &first);
    let planned = plan(&belief, &Planning { seed: case.seed, threads: 1, ..Planning::default() }, &|_| {}, &|| true)
        .expect("a motion can be planned");
    let (by_preset, by_plan) = (play(&preset, 2), play(&planned.motion_toml, 2));
    let told = tell(&planned, [&fit(&by_preset), &fit(&by_plan)], &by_plan);

    let truth = Drawn::new(&options).expect("the robot can be simulated").truth;
    let truth = Truth::of(truth.into_iter().map(|value| value.value).collect());
    let motion: Motion = toml::from_str(&planned.motion_toml).expect("a planned motion is one");
    let watched = Rehearsal::play(&robot, &truth, &motion, case.seed, STEP_S).expect("the robot can be simulated");
    let end = match watched.end {
        MotionEnd::Finished => "finished".to_owned(),
        MotionEnd::Stopped => "stopped".to_owned(),
        MotionEnd::Fault(fault) => fault.to_string(),
    };
    let nearest = watched.nearest;
    Outcome {
        case: *case,
        end,
        duration_s: [by_preset.recording.duration_s(), by_plan.recording.duration_s()],
        watch: nearest.stuck.max(nearest.wrong_way).max(nearest.rotation),
        told,
    }
}

fn tell(planned: &Plan, calibrations: [&Calibration; 2], played: &Direct) -> Vec<Told> {
    let dynamic = planned.parameters.iter().filter(|p| p.ratio.is_some());
    let of_one = |p: &host::plan::ExpectedError| {
        let truth = played.truth.iter().find(|value| value.name == p.name)?.value;
        let [a, b] = calibrations.map(|calibration| calibration.parameter(&p.name));
        let (a, b) = (a?, b?);
        Some(Told {
            name: p.name.clone(),
            promised: p.std_error? / truth,
            std_error: [a.std_error? / truth, b.std_error? / truth],
            off: [a.estimate / truth - 1.0, b.estimate / truth - 1.0],
        })
    };
    dynamic.filter_map(of_one).collect()
}

/// Makes what `file` does not hold yet of `cases`.
///
/// # Errors
/// If the file cannot be read or written.
pub fn study(
    file: &Path,
    cases: &[Case],
    workers: usize,
    progress: impl Fn(u64) + Sync,
) -> std::io::Result<Vec<Outcome>> {
    crate::study::resume(file, cases, |case, outcome: &Outcome| outcome.case == *case, workers, outcome, progress)
}
