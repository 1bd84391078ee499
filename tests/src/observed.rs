//! Is the observer as sure as it says, and as good as a filter in double precision? Doggies drawn at random, each calibrated on one motion and observed on another;
//! and once more with a bearing in the base that the calibration does not know.

use std::path::Path;

use host::calibrate::{Calibration, Preset, calibrate};
use host::observe::{Consistency, SETTLING_S, Sensors, Truth, observe};
use host::recording::Recording;
use host::robot::Robot;
use host::simulate::{Direct, Options, SHORT_MOTION};
use host::verify::CalibratedModel;
use host::verify::filter;
use host::verify::system::Columns;
use serde::{Deserialize, Serialize};
use solve::levenberg::Settings;

/// A robot.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Case {
    /// Draws parameters, mounts and noise.
    pub seed: u64,
    /// Torque noise on motors and links, as in the study of intervals.
    pub process_noise: f64,
}

/// The observer with one choice of sensors.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Observed {
    /// `both`, `encoders` or `gyros`.
    pub sensors: String,
    /// Of the innovations.
    pub nis: Option<Consistency>,
    /// Of the true errors of q, q̇, θ, θ̇ together.
    pub nees: Option<Consistency>,
    /// Events of the watchdog.
    pub events: usize,
    /// Largest error of a q or q̇ (root mean square) over that of the filter of `verify`, which reads all sensors in double precision.
    pub over_filter: f64,
}

/// What became of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// Which.
    pub case: Case,
    /// Length of the motion that was observed, s.
    pub duration_s: f64,
    /// By choice of sensors.
    pub observed: Vec<Observed>,
    /// Time from the first motor that moves to the first event, s, where a bearing of the base is hidden; none if there was no event. All sensors are read.
    pub bearing_event_s: Option<f64>,
}

/// Records two motions, calibrates on the first, observes the second.
///
/// # Panics
/// If the robot cannot be simulated or calibrated: then there is nothing to measure.
pub fn outcome(case: &Case) -> Outcome {
    let robot = Robot::builtin("doggy").expect("a built-in robot");
    let options = Options { seed: case.seed, process_noise: case.process_noise, ..Options::new(robot.clone()) };
    let record = |n| Direct::record_nth(&options, SHORT_MOTION, n).expect("the robot can be simulated");
    let (first, second) = (record(1), record(2));
    let calibration = calibrate(&robot, &[&first.recording], Preset::Default, &Settings::default(), |_, _| {})
        .expect("the recording can be calibrated");
    let model = CalibratedModel::of(&calibration, None).expect("a calibration of this version");
    let by_filter = filter_errors(&model, &second);
    let truth = Truth { t_us: second.recording.t_us.clone(), columns: second.states.clone() };
    let of_sensors = |sensors| {
        let (observation, estimates) =
            observe(&calibration, &second.recording, sensors, Some(&truth), |_| {}).expect("it can be observed");
        let names: Vec<&str> = observation.states.iter().map(|state| state.name.as_str()).collect();
        let over = |(name, by_filter): &(String, f64)| {
            let place = names.iter().position(|known| known == name).expect("states have their names");
            error(&second, name, |k| estimates.states[place][k]) / by_filter
        };
        Observed {
            sensors: observation.sensors.clone(),
            nis: observation.nis,
            nees: observation.nees,
            events: observation.events.len(),
            over_filter: by_filter.iter().map(over).fold(0.0, f64::max),
        }
    };
    let observed = [Sensors::Both, Sensors::Encoders, Sensors::Gyros].map(of_sensors).to_vec();
    let bearing_event_s = bearing_event_s(&calibration, case);
    Outcome { case: *case, duration_s: second.recording.duration_s(), observed, bearing_event_s }
}

/// Duty from which on a motor moves: bias windows are at zero, moves above.
pub const MOVING_DUTY: f64 = 0.02;

/// When the observer of `calibration` finds that the same robot has got a bearing in its base.
fn bearing_event_s(calibration: &Calibration, case: &Case) -> Option<f64> {
    let options = format!("seed={},process_noise={},effect=base_bearing", case.seed, case.process_noise);
    let options = Options::parse(&options).expect("options of a simulated robot");
    let changed = Direct::record_nth(&options, SHORT_MOTION, 2).expect("the robot can be simulated").recording;
    let moves = |k: &usize| changed.duty.iter().any(|duty| duty[*k].abs() > MOVING_DUTY);
    let begin_s = (0..changed.len()).find(moves).map(|k| changed.time_s(k))?;
    let (observation, _) = observe(calibration, &changed, Sensors::Both, None, |_| {}).expect("it can be observed");
    observation.events.first().map(|event| event.t_s - begin_s)
}

/// Errors of q and q̇ by the filter of `verify`.
fn filter_errors(model: &CalibratedModel, simulated: &Direct) -> Vec<(String, f64)> {
    let recording: &Recording = &simulated.recording;
    let t_s: Vec<f64> = (0..recording.len()).map(|k| recording.motion_time_s(k)).collect();
    let duty = model.inputs_as_they_act(&recording.duty, &recording.segments());
    let columns = Columns {
        t_s: &t_s,
        duty: duty.iter().map(Vec::as_slice).collect(),
        measured: recording.channels.iter().map(|channel| channel.values.as_slice()).collect(),
        sigma: recording.channels.iter().map(|channel| channel.spec.sigma).collect(),
        segments: recording.segments(),
        period_s: recording.period_s,
    };
    let track = filter::run(&model.system(), &columns, None);
    let layout = model.model().layout();
    let joints = 0..layout.joints();
    let states = joints.flat_map(|i| [(format!("q{}", i + 1), layout.q(i)), (format!("qd{}", i + 1), layout.qd(i))]);
    states
        .map(|(name, place)| {
            let error = error(simulated, &name, |k| track.state(k)[place]);
            (name, error)
        })
        .collect()
}

/// Root mean square of estimate − truth once a filter has settled.
fn error(simulated: &Direct, name: &str, estimate: impl Fn(usize) -> f64) -> f64 {
    let (_, truth) = simulated.states.iter().find(|(known, _)| known == name).expect("states have their names");
    let settled = (0..truth.len()).filter(|k| simulated.recording.time_s(*k) >= SETTLING_S);
    let (count, squares) = settled.fold((0.0, 0.0), |(n, sum), k| (n + 1.0, sum + (estimate(k) - truth[k]).powi(2)));
    f64::sqrt(squares / count)
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
