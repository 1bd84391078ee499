//! Recordings for the interpreter.
//!
//! Whatever a recording is made from, it is what its file says: tables, arrays and simulated motions are written as the file that `save` gives, and read
//! back from there. So results here are those of the binary on that file.

use std::fmt::Write as _;
use std::path::Path;
use std::sync::Arc;

use host::calibrate::comparable_truth;
use host::failure::{Failure, read_failure, simulate_failure, table_failure};
use host::link;
use host::recording::import::{self, EmptyInputs, Imported, TableError};
use host::recording::{self, mcap};
use host::report;
use host::simulate::{Direct, EffectChoice, Options, SHORT_MOTION};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::arrays::{from_bytes, to_bytes};
use crate::errors::OrRaise;
use crate::robot::Robot;
use crate::work;

/// A recording: one entry a tick in every column.
#[pyclass(frozen, module = "flexcal._native")]
pub struct Recording {
    /// Shared with the threads that work on it.
    pub recording: Arc<recording::Recording>,
    /// What was done to a table's numbers, and columns that were passed over.
    notes: Vec<String>,
    /// What is true of a simulated robot, as JSON.
    truth: Option<String>,
}

#[pymethods]
impl Recording {
    /// Reads a recording (`MCAP`).
    #[staticmethod]
    fn read(py: Python<'_>, path: &str) -> PyResult<Self> {
        let recording = py.detach(|| recording::read(Path::new(path))).map_err(read_failure).or_raise(py)?;
        Ok(Self { recording: Arc::new(recording), notes: Vec::new(), truth: None })
    }

    /// Reads a table or bag of another program.
    #[staticmethod]
    fn import_table(py: Python<'_>, path: &str, robot: &Robot, inputs: Option<&str>) -> PyResult<Self> {
        let inputs = empty_inputs(inputs).or_raise(py)?;
        let path = Path::new(path);
        py.detach(|| of_import(import::read(path, &robot.0, inputs), path)).or_raise(py)
    }

    /// From columns: names, and the bytes of their numbers.
    #[staticmethod]
    fn from_columns(
        py: Python<'_>,
        robot: &Robot,
        columns: Vec<(String, Bound<'_, PyBytes>)>,
        name: &str,
        inputs: Option<&str>,
    ) -> PyResult<Self> {
        let inputs = empty_inputs(inputs).or_raise(py)?;
        let columns = columns
            .into_iter()
            .map(|(name, bytes)| Ok((name, from_bytes(bytes.as_bytes())?)))
            .collect::<PyResult<Vec<_>>>()?;
        let path = Path::new(name);
        py.detach(|| of_import(import::from_arrays(&columns, &robot.0, path, inputs), path)).or_raise(py)
    }

    /// A motion of a simulated robot. `motion` is `short`, `calibration`, `validation`, or the text of a motion file.
    #[staticmethod]
    #[pyo3(signature = (robot, *, motion, seed, effects, hide, process_noise, nth, progress))]
    #[expect(clippy::too_many_arguments, reason = "keywords of a Python function")]
    fn simulate(
        py: Python<'_>,
        robot: &Robot,
        motion: &str,
        seed: u64,
        effects: Vec<String>,
        hide: Option<u64>,
        process_noise: f64,
        nth: u64,
        progress: Option<Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let robot = robot.0.clone();
        let motion = match motion {
            "short" => SHORT_MOTION.to_owned(),
            name => match link::preset_motion(name, &robot) {
                Some((_, text)) => text.map_err(Failure::fault).or_raise(py)?,
                None => name.to_owned(),
            },
        };
        if !(process_noise >= 0.0 && process_noise.is_finite()) {
            let failure =
                Failure::usage(format!("process_noise is {process_noise}")).advice("give a number, 0 or above");
            return Err(crate::errors::raise(py, &failure));
        }
        let effects: Result<Vec<EffectChoice>, _> = effects.iter().map(|effect| effect.parse()).collect();
        let effects = effects.map_err(simulate_failure).or_raise(py)?;
        work::run(py, progress.as_ref(), move |steps| {
            steps.tell("playing the motion");
            let options = Options { seed, effects, hide, process_noise, ..Options::new(robot) };
            let played = Direct::record_nth(&options, &motion, nth).map_err(simulate_failure)?;
            let mut truth = comparable_truth(&options.robot, &played.truth);
            truth.extend(played.effects.iter().flat_map(|effect| effect.parameters.iter().cloned()));
            let truth = report::json(&truth).map_err(Failure::fault)?;
            let recording = as_file(&played.recording, Path::new("simulated"))?;
            Ok(Self { recording: Arc::new(recording), notes: Vec::new(), truth: Some(truth) })
        })
    }

    /// The bytes of the file.
    fn to_mcap<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let bytes = py.detach(|| file(&self.recording)).or_raise(py)?;
        Ok(PyBytes::new(py, &bytes))
    }

    #[getter]
    fn robot(&self) -> Robot {
        Robot(self.recording.robot.clone())
    }

    #[getter]
    fn path(&self) -> String {
        self.recording.source.path.display().to_string()
    }

    #[getter]
    fn sha256(&self) -> &str {
        &self.recording.source.sha256
    }

    #[getter]
    fn period_s(&self) -> f64 {
        self.recording.period_s
    }

    #[getter]
    fn samples(&self) -> usize {
        self.recording.len()
    }

    #[getter]
    fn gaps(&self) -> usize {
        self.recording.gaps()
    }

    #[getter]
    fn missing_ticks(&self) -> u64 {
        self.recording.missing_ticks()
    }

    #[getter]
    fn truth(&self) -> Option<&str> {
        self.truth.as_deref()
    }

    /// One line for people.
    #[getter]
    fn summary(&self) -> String {
        self.recording.summary()
    }

    /// What was done to the numbers of a table, and what is wrong with a file.
    #[getter]
    fn notes(&self) -> Vec<String> {
        self.notes.iter().cloned().chain(self.recording.damage.iter().map(ToString::to_string)).collect()
    }

    /// Time after the first sample, s.
    fn time<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let t_s: Vec<f64> = (0..self.recording.len()).map(|k| self.recording.time_s(k)).collect();
        to_bytes(py, &t_s)
    }

    /// A column by its name: an input (`u1`) or a channel; nothing for another name.
    fn column<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Option<Bound<'py, PyBytes>>> {
        let input =
            name.strip_prefix('u').and_then(|joint| joint.parse::<usize>().ok()).and_then(|joint| joint.checked_sub(1));
        let values = match input {
            Some(joint) => self.recording.duty.get(joint),
            None => self.recording.channel(name).map(|channel| &channel.values),
        };
        values.map(|values| to_bytes(py, values)).transpose()
    }
}

/// What inputs are in rows that have none.
fn empty_inputs(how: Option<&str>) -> Result<Option<EmptyInputs>, Failure> {
    match how {
        None => Ok(None),
        Some("hold") => Ok(Some(EmptyInputs::Hold)),
        Some("interpolate") => Ok(Some(EmptyInputs::Interpolate)),
        Some(other) => {
            Err(Failure::usage(format!("inputs is `{other}`")).advice("give None, \"hold\" or \"interpolate\""))
        }
    }
}

fn of_import(imported: Result<Imported, TableError>, path: &Path) -> Result<Recording, Failure> {
    let Imported { recording, ignored, mut notes } = imported.map_err(table_failure)?;
    if !ignored.is_empty() {
        let mut note = "not read, as the robot file does not name them:".to_owned();
        ignored.iter().for_each(|column| _ = write!(note, " {column}"));
        notes.push(note);
    }
    Ok(Recording { recording: Arc::new(as_file(&recording, path)?), notes, truth: None })
}

fn file(recording: &recording::Recording) -> Result<Vec<u8>, Failure> {
    mcap::write(Vec::new(), recording).map_err(Failure::fault)
}

/// The recording as it will be read from its file.
fn as_file(recording: &recording::Recording, path: &Path) -> Result<recording::Recording, Failure> {
    mcap::parse(&file(recording)?, path).map_err(read_failure)
}
