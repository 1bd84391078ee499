//! Do intervals tell the truth? Many simulated recordings, each of a robot with parameters of its own, calibrated; then how often
//! the 95 % intervals hold the truth.
//!
//! ```text
//! seed ─▶ robot (±15 %) ─▶ short motion, process noise ─▶ recording ─▶ calibrate ─▶ one line of JSON ─┐
//! seed + 1 …                                                                        one line of JSON ─┴▶ Table
//! ```

mod bands;
mod table;

use std::path::Path;

use host::calibrate::{Calibration, Preset, calibrate, comparable_truth};
use host::robot::Robot;
use host::simulate::{Direct, Options, SHORT_MOTION};
use serde::{Deserialize, Serialize};
use solve::levenberg::Settings;

use crate::is_dynamic;

pub use bands::{binomial_band, chi_square_band, chi_square_quantile};
pub use table::{Row, Table};

/// What one recording tells.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// Decides robot, sensors' noise and process noise.
    pub seed: u64,
    /// In `host::simulate::ProcessNoise::UNIT`.
    pub process_noise: f64,
    /// How the calibration ended.
    pub status: String,
    /// Its iterations.
    pub iterations: usize,
    /// Every identifiable parameter.
    pub parameters: Vec<Found>,
    /// The estimate's error under its covariance, parameters of the dynamics together: χ² of as many degrees of freedom.
    pub dynamics: Distance,
    /// The same of all parameters.
    pub all: Distance,
}

/// A parameter's truth and estimate.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Found {
    /// Name, as in CAL.json.
    pub name: String,
    /// True value.
    pub truth: f64,
    /// Estimate.
    pub estimate: f64,
    /// Its standard error.
    pub std_error: f64,
}

/// A squared distance in units of the covariance.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Distance {
    /// Number of parameters.
    pub parameters: usize,
    /// eᵀ C⁻¹ e.
    pub chi2: f64,
}

impl Found {
    /// Error in standard errors.
    pub fn z(&self) -> f64 {
        (self.estimate - self.truth) / self.std_error
    }

    /// Whether it belongs to the dynamics: not a gyro's bias or rotation.
    pub fn is_dynamic(&self) -> bool {
        is_dynamic(&self.name)
    }
}

/// Simulates and calibrates the robot of a seed, on so many threads.
///
/// # Panics
/// If the built-in robot cannot be simulated or calibrated, or its covariance is not positive definite: then there is nothing to
/// measure.
pub fn outcome(seed: u64, process_noise: f64, threads: usize) -> Outcome {
    let robot = Robot::builtin("doggy").expect("the built-in robot is valid");
    let options = Options { seed, process_noise, ..Options::new(robot.clone()) };
    let simulated = Direct::record(&options, SHORT_MOTION).expect("the built-in robot plays the built-in motion");
    let settings = Settings { threads, ..Settings::default() };
    let calibration = calibrate(&robot, &[&simulated.recording], Preset::Default, &settings, |_, _| {})
        .unwrap_or_else(|error| panic!("seed {seed}: {error}"));
    let truth = comparable_truth(&robot, &simulated.truth);
    let parameters = calibration.parameters.iter().filter_map(|parameter| {
        let truth = truth.iter().find(|value| value.name == parameter.name)?.value;
        let name = parameter.name.clone();
        Some(Found { name, truth, estimate: parameter.estimate, std_error: parameter.std_error? })
    });
    let parameters: Vec<Found> = parameters.collect();
    Outcome {
        seed,
        process_noise,
        status: format!("{:?}", calibration.status).to_lowercase(),
        iterations: calibration.iterations,
        dynamics: distance(&calibration, &parameters, is_dynamic),
        all: distance(&calibration, &parameters, |_| true),
        parameters,
    }
}

/// eᵀ C⁻¹ e of the parameters that are wanted.
fn distance(calibration: &Calibration, found: &[Found], wanted: impl Fn(&str) -> bool) -> Distance {
    let covariance = &calibration.covariance;
    let places: Vec<usize> = (0..covariance.parameters.len()).filter(|&i| wanted(&covariance.parameters[i])).collect();
    let n = places.len();
    let error = nalgebra::DVector::from_iterator(
        n,
        places.iter().map(|&i| {
            let found = found.iter().find(|found| found.name == covariance.parameters[i]);
            found.map_or(f64::NAN, |found| found.estimate - found.truth)
        }),
    );
    // In units of the standard errors, so that the elimination is well scaled.
    let sigma: Vec<f64> = places.iter().map(|&i| covariance.matrix[i][i].sqrt()).collect();
    let correlation =
        nalgebra::DMatrix::from_fn(n, n, |i, j| covariance.matrix[places[i]][places[j]] / (sigma[i] * sigma[j]));
    let error = nalgebra::DVector::from_fn(n, |i, _| error[i] / sigma[i]);
    let factor = correlation.cholesky().expect("a covariance is positive definite");
    Distance { parameters: n, chi2: error.dot(&factor.solve(&error)) }
}

/// Runs the seeds from `first` on that `file` does not hold yet, and appends a line each; returns all `count` in order. A line that
/// was cut off is left as it is and made again.
///
/// # Errors
/// If the file cannot be read or written.
pub fn study(
    file: &Path,
    first: u64,
    count: u64,
    process_noise: f64,
    workers: usize,
    progress: impl Fn(u64) + Sync,
) -> std::io::Result<Vec<Outcome>> {
    let seeds: Vec<u64> = (first..first + count).collect();
    let mut outcomes = crate::study::resume(
        file,
        &seeds,
        |seed, outcome: &Outcome| outcome.seed == *seed && outcome.process_noise == process_noise,
        workers,
        |seed| outcome(*seed, process_noise, 1),
        progress,
    )?;
    outcomes.sort_by_key(|outcome| outcome.seed);
    Ok(outcomes)
}
