//! The verbs for the interpreter: what `host calibrate`, `verify`, `diagnose`, `observe`, `check` and `export` compute.

use std::sync::Arc;

use host::calibrate::{CalibrateError, Calibration, Method, NoiseSource, Preset, foresight};
use host::diagnose::Options;
use host::export::{ExportError, Exported, Loss};
use host::failure::{
    Failure, calibrate_failure, calibration_failure, diagnose_failure, export_failure, observe_failure, unfit,
    verify_failure,
};
use host::observe::Sensors;
use host::recording::{self, check as checks};
use host::report;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use serde::Serialize;
use solve::levenberg::Iteration;

use crate::arrays::to_bytes;
use crate::errors::OrRaise;
use crate::recording::Recording;
use crate::robot::Robot;
use crate::work;

type Shared = Arc<recording::Recording>;

/// What a verb found: the text of its file, its page, and arrays that are in neither.
#[pyclass(frozen, module = "flexcal._native")]
pub struct Outcome {
    json: String,
    page: Box<dyn Fn() -> String + Send + Sync>,
    arrays: Vec<(&'static str, Vec<Vec<f64>>)>,
    calibrations: Vec<(&'static str, Calibration)>,
}

#[pymethods]
impl Outcome {
    /// The bytes that the binary writes with `-o`.
    #[getter]
    fn json(&self) -> &str {
        &self.json
    }

    /// The page that the binary writes with `--report`.
    fn page(&self, py: Python<'_>) -> String {
        py.detach(|| (self.page)())
    }

    /// The columns of an array by its name.
    fn array<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Vec<Bound<'py, PyBytes>>> {
        let columns = self.arrays.iter().find(|(known, _)| *known == name).map_or(&[][..], |(_, columns)| columns);
        columns.iter().map(|column| to_bytes(py, column)).collect()
    }

    /// A calibration that this result is made of, by its name.
    fn calibration(&self, py: Python<'_>, name: &str) -> PyResult<Option<Self>> {
        let calibration = self.calibrations.iter().find(|(known, _)| *known == name);
        calibration.map(|(_, calibration)| of_calibration(calibration.clone()).or_raise(py)).transpose()
    }
}

impl Outcome {
    fn new(result: &impl Serialize, page: impl Fn() -> String + Send + Sync + 'static) -> Result<Self, Failure> {
        Ok(Self {
            json: report::json(result).map_err(Failure::fault)?,
            page: Box::new(page),
            arrays: Vec::new(),
            calibrations: Vec::new(),
        })
    }
}

/// Calibrates the base model, or the model extended by effects.
#[pyfunction]
#[pyo3(signature = (recordings, *, robot, preset, noise, extend, unchecked, progress))]
#[expect(clippy::too_many_arguments, reason = "keywords of a Python function")]
pub fn calibrate(
    py: Python<'_>,
    recordings: Vec<PyRef<'_, Recording>>,
    robot: Option<PyRef<'_, Robot>>,
    preset: &str,
    noise: Option<&str>,
    extend: Vec<String>,
    unchecked: bool,
    progress: Option<Bound<'_, PyAny>>,
) -> PyResult<Outcome> {
    let preset = match preset {
        "default" => Preset::Default,
        "paper" => Preset::Paper,
        other => return wrong(py, "preset", other, "\"default\" or \"paper\""),
    };
    let noise = match noise {
        None => None,
        Some("fixed") => Some(NoiseSource::Fixed),
        Some("estimated") => Some(NoiseSource::Estimated),
        Some(other) => return wrong(py, "noise", other, "None, \"fixed\" or \"estimated\""),
    };
    let (recordings, robot) = subjects(&recordings, robot);
    work::run(py, progress.as_ref(), move |steps| {
        steps.tell("reading");
        let recordings = accepted(&recordings, unchecked)?;
        let robot = robot.or_else(|| recordings.first().map(|recording| recording.robot.clone()));
        let robot = robot.ok_or_else(|| calibrate_failure(CalibrateError::NoRecording))?;
        let method = Method::suited(preset, &robot);
        let method = Method { noise: noise.unwrap_or(method.noise), ..method };
        let iteration =
            |i: usize, state: &Iteration| steps.tell(format!("calibrating: iteration {i}, cost {:.6e}", state.cost));
        let calibration =
            host::calibrate::calibrate_extended(&robot, &recordings, method, &extend, &steps.settings(), iteration)
                .map_err(calibrate_failure)?;
        of_calibration(calibration)
    })
}

/// A calibration from the text of its file; `name` is how the user calls it.
#[pyfunction]
pub fn read_calibration(py: Python<'_>, text: &str, name: &str) -> PyResult<Outcome> {
    let outcome = parse(text, name).and_then(of_calibration).or_raise(py)?;
    // Numbers read and written again may differ in their last digit.
    Ok(Outcome { json: text.to_owned(), ..outcome })
}

/// Predicts a recording by a calibrated model.
#[pyfunction]
#[pyo3(signature = (calibration, recording, *, unchecked, progress))]
pub fn verify(
    py: Python<'_>,
    calibration: &str,
    recording: &Recording,
    unchecked: bool,
    progress: Option<Bound<'_, PyAny>>,
) -> PyResult<Outcome> {
    let calibration = parse(calibration, "this").or_raise(py)?;
    let recording = Arc::clone(&recording.recording);
    work::run(py, progress.as_ref(), move |steps| {
        accepted(std::slice::from_ref(&recording), unchecked)?;
        let (verified, traces) =
            host::verify::verify(&calibration, &recording, |step| steps.tell(step)).map_err(verify_failure)?;
        let predicted = ("predicted", traces.predicted.clone());
        let mut outcome = Outcome::new(&verified.clone(), move || {
            report::verification::page(&verified, &recording, &traces).to_html()
        })?;
        outcome.arrays.push(predicted);
        Ok(outcome)
    })
}

/// Shows what the model gets wrong.
#[pyfunction]
#[pyo3(signature = (recordings, *, holdout, robot, without, unchecked, progress))]
pub fn diagnose(
    py: Python<'_>,
    recordings: Vec<PyRef<'_, Recording>>,
    holdout: Option<PyRef<'_, Recording>>,
    robot: Option<PyRef<'_, Robot>>,
    without: Vec<String>,
    unchecked: bool,
    progress: Option<Bound<'_, PyAny>>,
) -> PyResult<Outcome> {
    let (recordings, robot) = subjects(&recordings, robot);
    let holdout = holdout.map(|holdout| Arc::clone(&holdout.recording));
    work::run(py, progress.as_ref(), move |steps| {
        steps.tell("reading");
        let runs = accepted(&recordings, unchecked)?;
        accepted(holdout.as_slice(), unchecked)?;
        let robot = robot.or_else(|| runs.first().map(|recording| recording.robot.clone()));
        let robot = robot.ok_or_else(|| calibrate_failure(CalibrateError::NoRecording))?;
        let options = Options { without, settings: steps.settings() };
        let found = host::diagnose::diagnose(&robot, &runs, holdout.as_deref(), &options, &|step| steps.tell(step))
            .map_err(diagnose_failure)?;
        let calibrations = vec![("base", found.base.clone()), ("extended", found.extended.clone())];
        let outcome = Outcome::new(&found.clone(), move || report::diagnosis::page(&found).to_html())?;
        Ok(Outcome { calibrations, ..outcome })
    })
}

/// Runs the observer on a recording.
#[pyfunction]
#[pyo3(signature = (calibration, recording, *, sensors, unchecked, progress))]
pub fn observe(
    py: Python<'_>,
    calibration: &str,
    recording: &Recording,
    sensors: &str,
    unchecked: bool,
    progress: Option<Bound<'_, PyAny>>,
) -> PyResult<Outcome> {
    let sensors = match sensors {
        "both" => Sensors::Both,
        "gyros" => Sensors::Gyros,
        "encoders" => Sensors::Encoders,
        other => return wrong(py, "sensors", other, "\"both\", \"gyros\" or \"encoders\""),
    };
    let calibration = parse(calibration, "this").or_raise(py)?;
    let recording = Arc::clone(&recording.recording);
    work::run(py, progress.as_ref(), move |steps| {
        accepted(std::slice::from_ref(&recording), unchecked)?;
        let (observation, estimates) =
            host::observe::observe(&calibration, &recording, sensors, None, |step| steps.tell(step))
                .map_err(observe_failure)?;
        let arrays = vec![
            ("t_s", vec![estimates.t_s.clone()]),
            ("states", estimates.states.clone()),
            ("sigmas", estimates.sigmas.clone()),
            ("nis_per_reading", vec![estimates.nis_per_reading.clone()]),
        ];
        let outcome =
            Outcome::new(&observation.clone(), move || report::observation::page(&observation, &estimates).to_html())?;
        Ok(Outcome { arrays, ..outcome })
    })
}

/// Tells whether a recording is fit for calibration.
#[pyfunction]
pub fn check(py: Python<'_>, recording: &Recording) -> PyResult<Outcome> {
    let recording = Arc::clone(&recording.recording);
    work::run(py, None, move |_| {
        let mut check = checks::check(&recording);
        if check.usable {
            foresight::look(&recording, &mut check);
        }
        Outcome::new(&check.clone(), move || report::check_page(&recording, &check).to_html())
    })
}

/// What writes a model for another tool: its text, and what it loses.
type Write = fn(&Exported<'_>) -> Result<(String, Vec<Loss>), ExportError>;

/// A calibrated model for another tool: its text, and what it loses.
#[pyfunction]
pub fn export(py: Python<'_>, calibration: &str, format: &str) -> PyResult<(String, Vec<String>)> {
    let write: Write = match format {
        "robot" => host::export::robot_file,
        "mjcf" => host::export::mjcf,
        "urdf" => host::export::urdf,
        "rust" => host::export::rust,
        other => return wrong(py, "format", other, "\"robot\", \"mjcf\", \"urdf\" or \"rust\""),
    };
    let calibration = parse(calibration, "this").or_raise(py)?;
    let written = Exported::of(&calibration).and_then(|exported| write(&exported)).map_err(export_failure);
    let (text, losses) = written.or_raise(py)?;
    Ok((text, losses.iter().map(ToString::to_string).collect()))
}

fn parse(text: &str, name: &str) -> Result<Calibration, Failure> {
    serde_json::from_str(text).map_err(|error| calibration_failure(name, &error))
}

fn of_calibration(calibration: Calibration) -> Result<Outcome, Failure> {
    Outcome::new(&calibration.clone(), move || report::calibration::page(&calibration).to_html())
}

/// The recordings, and the robot that stands for theirs.
fn subjects(
    recordings: &[PyRef<'_, Recording>],
    robot: Option<PyRef<'_, Robot>>,
) -> (Vec<Shared>, Option<host::robot::Robot>) {
    let recordings = recordings.iter().map(|recording| Arc::clone(&recording.recording)).collect();
    (recordings, robot.map(|robot| robot.0.clone()))
}

/// The recordings, unless results from one of them would be worthless.
fn accepted(recordings: &[Shared], unchecked: bool) -> Result<Vec<&recording::Recording>, Failure> {
    for recording in recordings.iter().filter(|_| !unchecked) {
        if let Some(finding) = host::calibrate::obstacles(recording).first() {
            let advice = format!("{}\nif it is right as it is, pass unchecked=True", finding.advice);
            return Err(unfit(recording.source.path.display(), finding).advice(advice));
        }
    }
    Ok(recordings.iter().map(Arc::as_ref).collect())
}

/// A keyword with a value that it does not take.
fn wrong<T>(py: Python<'_>, keyword: &str, value: &str, wanted: &str) -> PyResult<T> {
    Err(Failure::usage(format!("{keyword} is `{value}`")).advice(format!("give {wanted}"))).or_raise(py)
}
