//! Robots for the interpreter.

use std::path::Path;

use host::failure::robot_failure;
use host::robot;
use pyo3::prelude::*;

use crate::errors::OrRaise;

/// A robot, as its description says and checked.
#[pyclass(frozen, module = "flexcal._native")]
pub struct Robot(pub robot::Robot);

#[pymethods]
impl Robot {
    /// A built-in robot by its name, or a description file by its path.
    #[staticmethod]
    fn load(py: Python<'_>, name_or_path: &str) -> PyResult<Self> {
        robot::Robot::load(name_or_path).map(Self).map_err(robot_failure).or_raise(py)
    }

    /// From the text of a description; its URDF is looked for in `folder`.
    #[staticmethod]
    fn parse(py: Python<'_>, text: &str, folder: &str) -> PyResult<Self> {
        robot::Robot::parse_in(text, Path::new(folder)).map(Self).map_err(robot_failure).or_raise(py)
    }

    #[getter]
    fn name(&self) -> &str {
        &self.0.name
    }

    #[getter]
    fn description(&self) -> &str {
        &self.0.description
    }

    #[getter]
    fn sample_period_s(&self) -> f64 {
        self.0.sample_period_s
    }

    /// The text of the description, what stands in a URDF written out.
    #[getter]
    fn toml(&self) -> &str {
        self.0.toml()
    }

    /// Names of the joints from the base outwards.
    #[getter]
    fn joints(&self) -> Vec<&str> {
        self.0.joints.iter().map(|joint| joint.name.as_str()).collect()
    }

    /// Columns of a table: `t_us`, inputs, channels.
    #[getter]
    fn columns(&self) -> Vec<String> {
        self.0.columns()
    }

    /// Column and unit of each channel.
    #[getter]
    fn channels(&self) -> Vec<(String, String)> {
        self.0.channels().into_iter().map(|channel| (channel.column, channel.unit.to_owned())).collect()
    }
}

/// Names of the built-in robots.
#[pyfunction]
pub fn robot_names() -> Vec<&'static str> {
    robot::Robot::builtin_names().collect()
}
