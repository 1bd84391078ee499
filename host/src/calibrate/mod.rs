//! The calibration: residuals of a recording under a model, solved jointly for all states of all samples and the shared parameters.
//!
//! ```text
//! Recording ─▶ series (one chain, broken at gaps) ─▶ start ─▶ problem ─▶ solve::levenberg ─▶ identify ─▶ Calibration
//!                                       preset: integrator, gyro rows, noise ──┘
//! ```

mod chained;
pub mod foresight;
mod identify;
mod marginal;
mod noise;
mod noise_free;
mod observability;
mod outliers;
mod point;
mod prefit;
mod preset;
mod problem;
mod reml;
mod result;
mod row;
mod search;
mod series;
mod start;
mod summary;
#[cfg(test)]
mod tests;
mod wide;

pub use noise::Noise;
pub use observability::{Unobservable, comparable_truth};
use outliers::Screened;
pub use point::{BorderLayout, Point};
pub use preset::{Assumptions, GyroRows, InitialNoise, Method, NoiseSource, Preset, ProcessNoise};
pub use problem::Problem;
use reml::Residue;
pub use result::{
    Calibration, ChannelFit, ChannelNoise, Correlation, Covariance, ParameterEstimate, RecordingUsed, Seconds, Status,
};
use search::Found;
pub use series::Series;

use std::time::{Duration, Instant};

use crate::model::Model;
use crate::recording::Recording;
use crate::robot::{ChannelKind, Robot};
use crate::solve::border::Border;
use crate::solve::factor::SolveError;
use crate::solve::levenberg::{Iteration, Settings};

/// Why recordings cannot be calibrated.
#[derive(Debug, thiserror::Error)]
pub enum CalibrateError {
    /// No recording.
    #[error("no recording was given")]
    NoRecording,
    /// Too short to say anything.
    #[error("{path} has {samples} samples in runs without a gap: a calibration needs at least {least}")]
    TooShort {
        /// The recording.
        path: String,
        /// Its samples.
        samples: usize,
        /// What is needed.
        least: usize,
    },
    /// Recordings of different robots.
    #[error("{path} was recorded on robot `{robot}`, the others on `{expected}`: calibrate one robot at a time")]
    DifferentRobot {
        /// The recording.
        path: String,
        /// Its robot.
        robot: String,
        /// The robot of the first one.
        expected: String,
    },
    /// A recording that does not have the columns of the description.
    #[error("{path} has the columns {found}, the description of `{robot}` wants {expected}")]
    DifferentColumns {
        /// The recording.
        path: String,
        /// Its columns.
        found: String,
        /// The robot.
        robot: String,
        /// Its columns.
        expected: String,
    },
    /// The motor encoders are the only channels that every method needs.
    #[error("joint {joint} (`{name}`) has no position sensor: its state cannot be found")]
    NoPosition {
        /// 1-based.
        joint: usize,
        /// Its name.
        name: String,
    },
    /// The preset does not fit the robot.
    #[error(
        "the preset `paper` wants its first gyro on the body after the first joint, a revolute one, as (22) does; use the preset `default`"
    )]
    NotThePapersRobot,
    /// The solver gave up.
    #[error("the least-squares problem cannot be solved: {0}")]
    Solve(#[from] SolveError),
}

/// Fewest samples of a recording.
const FEWEST_SAMPLES: usize = 200;

/// Relative change of the cost from which on a search ends whose weights will change anyway.
const ROUGH: f64 = 1e-5;

/// Searches at most that leave out what the one before found to be outliers.
const MOST_SIFTINGS: usize = 3;

/// Calibrates `robot` on recordings of it, by a [`Preset`] or a [`Method`]. `progress` is called once an iteration.
///
/// Where the noise is estimated, the problem is solved under the preset's noise, roughly, and again under the noise that was found. Lone
/// readings far from what the model and their neighbours say are left out, unless the preset keeps all.
///
/// # Errors
/// [`CalibrateError`].
pub fn calibrate(
    robot: &Robot,
    recordings: &[&Recording],
    method: impl Into<Method>,
    settings: &Settings,
    mut progress: impl FnMut(usize, &Iteration),
) -> Result<Calibration, CalibrateError> {
    let begin = Instant::now();
    let Method { preset, noise } = method.into();
    check(robot, recordings, preset)?;
    let model = Model::new(robot);
    let assumptions = preset.assumptions();
    let screened = Screened::new(Series::of(robot, recordings), assumptions.without_outliers);
    let mut problem = Problem::new(&model, robot, screened.series(), assumptions);
    let structural = observability::structural(&model, robot, problem.border());
    let clock = Instant::now();
    let start = start::start(&model, robot, screened.series());
    let start_seconds = clock.elapsed().as_secs_f64();

    let estimated = noise == NoiseSource::Estimated;
    let rough = Settings { relative_cost_change: settings.relative_cost_change.max(ROUGH), ..settings.clone() };
    let first = if estimated { &rough } else { settings };
    let mut found = search::search(&problem, robot, &start, &structural, first, &mut progress)?;
    for _ in 0..MOST_SIFTINGS {
        if !screened.look(&mut problem, &found.solution.point) {
            break;
        }
        found = search::again(&problem, robot, (&start, found), &structural, first, &mut progress)?;
    }
    let by_motion = found.noise_free.clone();
    let mut noise_clock = Duration::ZERO;
    let mut floor = None;
    if estimated {
        let clock = Instant::now();
        floor = Some(reml::estimate(&mut problem, &found.solution.point, settings.threads)?.floor);
        noise_clock += clock.elapsed();
        found = search::again(&problem, robot, (&start, found), &structural, settings, &mut progress)?;
        if screened.look(&mut problem, &found.solution.point) {
            found = search::again(&problem, robot, (&start, found), &structural, settings, &mut progress)?;
        }
    }
    let clock = Instant::now();
    let residue = reml::residue(&problem, &found.solution.point, settings.threads)?;
    let residue = Residue { floor, ..residue };
    noise_clock += clock.elapsed();
    // The paper's preset shows what its noise does to the estimates.
    if preset != Preset::Paper {
        let by_noise = marginal::shown_by_noise(&problem, &found, &by_motion, settings.threads)?;
        found.silent.extend(by_noise);
    }
    let Found { mut solution, held, silent, .. } = found;
    observability::without_held_turns(&mut solution.point.rotations, robot, problem.border(), &held);
    let directions: Vec<_> = held.iter().map(|held| held.direction.clone()).collect();
    let border = Border::new(&solution.information, &solution.gradient, &directions);
    let mut calibration = summary::summarise(robot, &problem, &start, &solution, &border, (&held, &silent), &residue);
    calibration.preset = preset;
    calibration.noise_source = noise;
    for (noise, left_out) in calibration.noise.iter_mut().zip(screened.left_out()) {
        noise.left_out = left_out;
    }
    calibration.recordings = recordings.iter().map(|recording| summary::used(recording)).collect();
    if held.len() + silent.len() > structural.len() && calibration.status == Status::Converged {
        calibration.status = Status::Unidentifiable;
    }
    calibration.seconds = Seconds {
        start: start_seconds,
        noise: noise_clock.as_secs_f64(),
        linearise: solution.seconds.linearise,
        factor: solution.seconds.factor,
        solve: solution.seconds.solve,
        total: begin.elapsed().as_secs_f64(),
    };
    Ok(calibration)
}

/// The columns of a table with so many inputs and these channels.
fn columns(inputs: usize, channels: &[crate::robot::Channel]) -> String {
    let inputs = (1..=inputs).map(|i| format!("u{i}"));
    inputs.chain(channels.iter().map(|channel| channel.column.clone())).collect::<Vec<_>>().join(",")
}

fn check(robot: &Robot, recordings: &[&Recording], preset: Preset) -> Result<(), CalibrateError> {
    let first = recordings.first().ok_or(CalibrateError::NoRecording)?;
    let expected = columns(robot.joints.len(), &robot.channels());
    for recording in recordings {
        let path = recording.source.path.display().to_string();
        let specs: Vec<_> = recording.channels.iter().map(|channel| channel.spec.clone()).collect();
        let found = columns(recording.duty.len(), &specs);
        if found != expected {
            let robot = robot.name.clone();
            return Err(CalibrateError::DifferentColumns { path, found, robot, expected });
        }
        let samples = series::usable_samples(recording);
        if samples < FEWEST_SAMPLES {
            return Err(CalibrateError::TooShort { path, samples, least: FEWEST_SAMPLES });
        }
        if recording.robot.name != first.robot.name {
            let (robot, expected) = (recording.robot.name.clone(), first.robot.name.clone());
            return Err(CalibrateError::DifferentRobot { path, robot, expected });
        }
    }
    let channels = robot.channels();
    let sees = |joint: usize| {
        channels.iter().any(|channel| {
            matches!(channel.kind,
                ChannelKind::MotorPosition { joint: j } | ChannelKind::LinkPosition { joint: j } if j == joint)
        })
    };
    if let Some(joint) = (0..robot.joints.len()).find(|&joint| !sees(joint)) {
        return Err(CalibrateError::NoPosition { joint: joint + 1, name: robot.joints[joint].name.clone() });
    }
    let papers_gyro = robot
        .gyros()
        .next()
        .is_none_or(|gyro| gyro.body == 0 && robot.joints[0].kind == crate::robot::JointKind::Revolute);
    if preset == Preset::Paper && !papers_gyro {
        return Err(CalibrateError::NotThePapersRobot);
    }
    Ok(())
}
