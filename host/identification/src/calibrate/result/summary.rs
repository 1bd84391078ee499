//! From the solution of the least-squares problem to the result that users read.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector, Vector3};

use super::calibration::Calibration;
use super::calibration::Covariance;
use super::calibration::ParameterEstimate;
use super::calibration::RecordingUsed;
use super::calibration::Seconds;
use super::calibration::Status;
use super::channels;
use crate::calibrate::identifiability::observability::Unobservable;
use crate::calibrate::identifiability::observability::{self, Held};
use crate::calibrate::noise_estimate::reml::Residue;
use crate::calibrate::residuals::point::{BorderLayout, Point};
use crate::calibrate::residuals::preset::NoiseSource;
use crate::calibrate::residuals::preset::Preset;
use crate::calibrate::residuals::problem::Problem;
use crate::model::rotation;
use crate::recording::Recording;
use crate::robot::Robot;
use solve::LeastSquares;
use solve::border::Border;
use solve::levenberg::{self, Solution};

/// Correlations of this size are told.
const STRONG: f64 = 0.9;

/// Two-sided 95 % of the normal distribution.
const NORMAL_95: f64 = 1.959_963_984_540_054;

/// A parameter that a held direction may shift by more than this many of its standard errors has no interval that could be trusted.
const SPOILT: f64 = 0.5;

const AXES: [&str; 3] = ["x", "y", "z"];

/// What went into a calibration.
pub(crate) fn used(recording: &Recording) -> RecordingUsed {
    RecordingUsed {
        path: recording.source.path.display().to_string(),
        sha256: recording.source.sha256.clone(),
        samples: recording.len(),
        gaps: recording.gaps(),
        missing_ticks: recording.missing_ticks(),
    }
}

/// A name, unit, start value and estimate for every result.
struct Column {
    name: String,
    unit: &'static str,
    initial: f64,
    estimate: f64,
}

fn columns(problem: &Problem<'_>, robot: &Robot, start: &Point<'_>, end: &Point<'_>) -> Vec<Column> {
    let coordinates = problem.model.coordinates();
    let (initial, estimate) = (coordinates.to_physical(&start.z), coordinates.to_physical(&end.z));
    let mut columns: Vec<Column> = coordinates
        .names()
        .zip(initial.into_iter().zip(estimate))
        .map(|((name, unit), (initial, estimate))| Column { name: name.to_string(), unit, initial, estimate })
        .collect();
    for (gyro, spec) in robot.gyros().enumerate() {
        let nominal = nalgebra::Matrix3::from_fn(|i, j| spec.rotation[i][j]);
        let delta = rotation::boxminus(&end.rotations[gyro], &nominal);
        for (axis, letter) in AXES.iter().enumerate() {
            let name = format!("R_imu{}[{letter}]", gyro + 1);
            columns.push(Column { name, unit: "rad", initial: 0.0, estimate: delta[axis] });
        }
    }
    let many = end.biases.len() > 1;
    for (recording, biases) in end.biases.iter().enumerate() {
        for (gyro, bias) in biases.iter().enumerate() {
            for (axis, letter) in AXES.iter().enumerate() {
                let suffix = if many { format!("@{}", recording + 1) } else { String::new() };
                let name = format!("bias{}[{letter}]{suffix}", gyro + 1);
                let initial = start.biases[recording][gyro][axis];
                columns.push(Column { name, unit: "rad/s", initial, estimate: bias[axis] });
            }
        }
    }
    columns
}

/// Name, unit and value of every result at a point.
pub(crate) fn values(problem: &Problem<'_>, robot: &Robot, point: &Point<'_>) -> Vec<(String, &'static str, f64)> {
    columns(problem, robot, point, point).into_iter().map(|c| (c.name, c.unit, c.estimate)).collect()
}

/// The covariance of the results: of the rotations relative to their nominal values too. There a turn that is hardly known about one axis
/// reaches the others. Unknowns in `wider` have so many times their standard error.
fn physical_covariance(
    robot: &Robot,
    problem: &Problem<'_>,
    end: &Point<'_>,
    (border, wider): (&Border, &[(usize, f64)]),
) -> Option<DMatrix<f64>> {
    let layout = problem.border();
    let mut slopes = observability::result_slopes(problem.model, &end.z, layout);
    let results = problem.model.coordinates().results();
    for (gyro, spec) in robot.gyros().enumerate() {
        let nominal = nalgebra::Matrix3::from_fn(|i, j| spec.rotation[i][j]);
        let by_turn = rotation::boxminus_slopes(&rotation::boxminus(&end.rotations[gyro], &nominal));
        let unknown = layout.rotation(gyro);
        slopes.fixed_view_mut::<3, 3>(results + unknown - layout.dynamics, unknown).copy_from(&by_turn);
    }
    let mut covariance = &slopes * border.covariance()? * slopes.transpose();
    let base = problem.model.coordinates().iter().count();
    for &(unknown, factor) in wider {
        let is_of = |result: usize| match unknown {
            unknown if unknown < base => result == unknown,
            // A law's coordinate may stand in several results.
            unknown if unknown < layout.dynamics => {
                slopes[(result, unknown)] != 0.0 && (base..results).contains(&result)
            }
            unknown => result == results + unknown - layout.dynamics,
        };
        for result in (0..covariance.nrows()).filter(|&result| is_of(result)) {
            covariance.row_mut(result).scale_mut(factor);
            covariance.column_mut(result).scale_mut(factor);
        }
    }
    Some(covariance)
}

/// Everything of the result that the solution holds.
pub(crate) fn summarise<'m>(
    robot: &Robot,
    problem: &Problem<'m>,
    (start, solution): (&Point<'m>, &Solution<Point<'m>>),
    border: &Border,
    (held, silent, wider): (&[Held], &[Held], &[(usize, f64)]),
    residue: &Residue,
    threads: usize,
) -> Calibration {
    let end = &solution.point;
    let rotations: BTreeMap<_, _> = end
        .rotations
        .iter()
        .enumerate()
        .map(|(gyro, r)| (format!("imu{}", gyro + 1), std::array::from_fn(|i| std::array::from_fn(|j| r[(i, j)]))))
        .collect();
    let (noise, fit) = channels::channels(robot, problem, end, residue, threads);
    let shape = problem.shape();
    let unknowns = shape.stages * shape.stage + shape.border - held.len();
    let parameters = estimates(robot, problem, start, end, border, (held, silent, wider));
    let covariance = covariance(robot, problem, end, (border, wider), &parameters);
    Calibration {
        correlations: covariance.correlations(STRONG),
        covariance,
        robot: robot.name.clone(),
        robot_toml: robot.toml().to_string(),
        preset: Preset::Default,
        noise_source: NoiseSource::Fixed,
        extensions: Vec::new(),
        recordings: Vec::new(),
        status: match solution.status {
            levenberg::Status::Converged => Status::Converged,
            levenberg::Status::Almost => Status::Almost,
            levenberg::Status::NoProgress => Status::NoProgress,
            levenberg::Status::IterationLimit => Status::IterationLimit,
        },
        iterations: solution.iterations.len(),
        factorisations: solution.iterations.iter().filter(|iteration| !iteration.by_old_factor).count(),
        cost: solution.cost,
        dof: problem.row_count(end) as f64 - unknowns as f64,
        seconds: Seconds { start: 0.0, noise: 0.0, linearise: 0.0, factor: 0.0, solve: 0.0, total: 0.0 },
        parameters,
        unobservable: unobservable(robot, problem, end, held.iter().chain(silent)),
        rotations,
        noise,
        fit,
        misfit: Vec::new(),
        notes: Vec::new(),
        pushes: Vec::new(),
        scatter: None,
        first_states: problem.series.recordings.iter().map(|range| end.state(range.start).to_vec()).collect(),
    }
}

/// Every free parameter with its estimate at `end` (of a silent one, its start value) and its interval, in the order of results.
pub(crate) fn estimates<'m>(
    robot: &Robot,
    problem: &Problem<'m>,
    start: &Point<'m>,
    end: &Point<'m>,
    border: &Border,
    (held, silent, wider): (&[Held], &[Held], &[(usize, f64)]),
) -> Vec<ParameterEstimate> {
    let columns = columns(problem, robot, start, end);
    let covariance = physical_covariance(robot, problem, end, (border, wider));
    let slopes = observability::result_slopes(problem.model, &end.z, problem.border());
    let results = problem.model.coordinates().results();
    let base = problem.model.coordinates().iter().count();
    // Where a result of rotation, bias or base model stands among the unknowns of the border.
    let unknown = |i: usize| match i {
        i if i < base => Some(i),
        i if i < results => None,
        i => Some(problem.border().dynamics + i - results),
    };
    let is_one_of = |list: &[&Vec<f64>], i: usize| {
        unknown(i).is_some_and(|unknown| list.iter().any(|shares| shares[unknown] == 1.0))
    };
    let shifts: Vec<DVector<f64>> =
        held.iter().map(|held| shift(held, &slopes, &columns, problem.border(), results)).collect();
    let known = held.iter().filter(|held| held.reason.is_empty()).map(|held| &held.direction).collect::<Vec<_>>();
    let silent_shares: Vec<&Vec<f64>> = silent.iter().map(|silent| &silent.shares).collect();
    let mut estimates: Vec<_> = columns
        .into_iter()
        .enumerate()
        .filter(|(i, _)| *i < results || !is_one_of(&known, *i))
        .map(|(i, mut column)| {
            let silent = is_one_of(&silent_shares, i);
            let is_chosen = (0..slopes.ncols()).all(|j| slopes[(i, j)] == 0.0);
            if silent {
                column.estimate = column.initial;
            }
            let std_error = covariance.as_ref().map(|covariance| covariance[(i, i)].max(0.0).sqrt()).filter(|error| {
                !silent
                    && !is_chosen
                    && error.is_finite()
                    && !shifts.iter().any(|shift| shift[i].abs() > SPOILT * error)
            });
            let interval = |error: f64| [column.estimate - NORMAL_95 * error, column.estimate + NORMAL_95 * error];
            let estimate = ParameterEstimate {
                name: column.name,
                unit: column.unit.to_string(),
                initial: column.initial,
                estimate: column.estimate,
                ci95: std_error.map(interval),
                std_error,
                // What is chosen, not fitted, has no error and is known all the same.
                identifiable: std_error.is_some() || is_chosen,
            };
            (place_in_results(i, results, problem.border()), estimate)
        })
        .collect();
    estimates.sort_by_key(|(place, _)| *place);
    estimates.into_iter().map(|(_, estimate)| estimate).collect()
}

/// Where along a held direction the truth lies nobody knows: how far does that shift the results at most? The dynamics have so many results.
fn shift(
    held: &Held,
    slopes: &DMatrix<f64>,
    columns: &[Column],
    border: &BorderLayout,
    results: usize,
) -> DVector<f64> {
    let mut shift = (slopes * DVector::from_column_slice(&held.direction)).abs();
    if held.convention {
        return shift;
    }
    for unknown in (0..border.gyros).map(|gyro| border.rotation(gyro)) {
        let result = results + unknown - border.dynamics;
        // Rot(δ) Rot(d) = Rot(δ + d + ½ δ × d + …): a turn about one axis changes what is told about the others.
        let delta = Vector3::from_fn(|axis, _| columns[result + axis].estimate);
        let turn = Vector3::from_fn(|axis, _| held.direction[unknown + axis]);
        let by_turn = 0.5 * delta.cross(&turn).abs();
        shift.rows_mut(result, 3).zip_apply(&by_turn, |shift, more| *shift += more);
    }
    shift
}

/// The covariance of those parameters that have a standard error.
fn covariance(
    robot: &Robot,
    problem: &Problem<'_>,
    end: &Point<'_>,
    (border, wider): (&Border, &[(usize, f64)]),
    parameters: &[ParameterEstimate],
) -> Covariance {
    let Some(all) = physical_covariance(robot, problem, end, (border, wider)) else { return Covariance::default() };
    let columns = columns(problem, robot, end, end);
    let places: Vec<usize> = parameters
        .iter()
        .filter(|parameter| parameter.std_error.is_some())
        .filter_map(|parameter| columns.iter().position(|column| column.name == parameter.name))
        .collect();
    Covariance {
        parameters: places.iter().map(|&i| columns[i].name.clone()).collect(),
        matrix: places.iter().map(|&i| places.iter().map(|&j| all[(i, j)]).collect()).collect(),
    }
}

/// The held directions by the names of their parameters; what the robot file fixes is no news.
pub(crate) fn unobservable<'h>(
    robot: &Robot,
    problem: &Problem<'_>,
    end: &Point<'_>,
    held: impl IntoIterator<Item = &'h Held>,
) -> Vec<Unobservable> {
    let coordinates = problem.model.coordinates();
    let mut columns = columns(problem, robot, end, end).into_iter();
    let results: Vec<String> = columns.by_ref().take(coordinates.results()).map(|column| column.name).collect();
    // Unknowns of laws go by the first result that they enter.
    let slopes = observability::result_slopes(problem.model, &end.z, problem.border());
    let base = coordinates.iter().count();
    let names = (0..coordinates.len()).map(|j| {
        let of_law = (base..results.len()).find(|&i| slopes[(i, j)] != 0.0);
        if j < base { results[j].clone() } else { of_law.map_or_else(String::new, |i| results[i].clone()) }
    });
    let names: Vec<String> = names.chain(columns.map(|column| column.name)).collect();
    held.into_iter()
        .filter(|held| !held.reason.is_empty())
        .map(|held| Unobservable { direction: observability::named(&held.shares, &names), reason: held.reason.clone() })
        .collect()
}

/// Results list biases before rotations, as the paper's (15) does, and what laws add behind the base model's.
fn place_in_results(i: usize, results: usize, border: &BorderLayout) -> (usize, usize) {
    let first_bias = results + 3 * border.gyros;
    match i {
        i if i < results => (0, i),
        i if i < first_bias => (2, i),
        i => (1, i),
    }
}
