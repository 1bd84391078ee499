//! What a motion cannot tell: directions of the shared unknowns about which the readings say less than the prior guess does.
//!
//! Judged is the information of noise-free predictions ([`NoiseFree`]): every row linearised along the model's own run, all states
//! eliminated. The unit of a parameter of the dynamics is its prior guess: what makes all of the joint's torque where the robot is rigid (`robot_scale`), the
//! start value where joints have springs. A direction whose 95 % interval reaches the guess's own bounds is not determined,
//!
//! ```text
//! 1.96 / √(vᵀ D S D v) > 1        S: information of the physical parameters,  D: their prior sizes,  |v| = 1
//! ```
//!
//! It is held at the start value (of a rigid robot as near to it as the 95 % interval reaches), and every parameter that it would shift by more than half a
//! standard error is given no number.
//!
//! Coulomb friction is a case of its own. Equation (12) lets a joint that sticks creep, and how fast it creeps shows μ to the last digit;
//! but that is the sign function's smoothing, not friction. The search may use μ to explain the creeping; a number it is given only
//! where the joint slid.

use nalgebra::{DMatrix, DVector, SymmetricEigen};

use super::noise_free::{Moved, NoiseFree};
use super::observability::{self, Held};
use crate::calibrate::residuals::point::{BorderLayout, Point};
use crate::calibrate::residuals::preset::GyroRows;
use crate::calibrate::residuals::problem::Problem;
use crate::model::{SensorFrame, rotation};
use crate::robot::{Friction, Joint, JointKind, Robot, Side, Symbol};
use solve::error::SolveError;
use solve::factor;
use solve::{LeastSquares, Step};

/// Information below which a 95 % interval is wider than the prior guess, in units of the guess.
const LEAST_INFORMATION: f64 = 1.96 * 1.96;

/// A joint slides where its speed has reached this over the slope of the smoothed sign: three quarters of the friction, 5 mrad/s on Doggy.
const SLIDING: f64 = 2.0;

/// A gyro is mounted by eye: 20°.
pub(crate) const MOUNTING_RAD: f64 = 0.35;
/// Offset of a cheap gyro before anybody looked at it: 6 deg/s.
pub(crate) const OFFSET_RAD_S: f64 = 0.1;
/// Where there is no guess, as for a parameter that starts at zero: less than 1e-9 of the information that it would have alone.
const ALONE: f64 = 1e-9;

/// The information of noise-free predictions, and what it leaves open.
pub(crate) struct Judgement {
    /// Row-major, of the border's unknowns.
    pub information: Vec<f64>,
    /// Directions that are not determined, as long as their prior guess.
    pub weak: Vec<Held>,
    /// Parameters that the search needs and that no number is given for.
    pub silent: Vec<Held>,
}

/// Judges the motion at a point; `structural` is held already.
///
/// # Errors
/// As a solve's own.
pub(crate) fn judge(
    problem: &Problem<'_>,
    robot: &Robot,
    point: &Point<'_>,
    structural: &[Held],
    threads: usize,
) -> Result<Judgement, SolveError> {
    let free = NoiseFree::of(problem, point);
    let information = match problem.assumptions.gyro_rows {
        GyroRows::RigidBase => information(problem, &free.point, threads)?,
        // These rows depend on what gyro 1 measured.
        GyroRows::Chained => {
            let series = predicted_gyros(problem, &free.point);
            information(
                &Problem::new(problem.model, robot, &series, problem.assumptions.clone()),
                &free.point,
                threads,
            )?
        }
    };
    let guess = Guess::new(problem, point, &information);
    let scaled = guess.scaled(&information, structural);
    let mut weak: Vec<Held> = Vec::new();
    for direction in sparse_basis(&scaled) {
        let spread = 1.96 / direction.dot(&(&scaled * &direction)).max(0.0).sqrt();
        let reason = reason(robot, problem, &guess, &direction, spread, &free.joints);
        weak.push(Held {
            direction: guess.to_border(&direction),
            shares: direction.as_slice().to_vec(),
            reason,
            convention: false,
        });
    }
    let mut silent = sticking(problem, robot, &free.joints);
    silent.retain(|silent| !weak.iter().any(|weak| silent.shares.iter().zip(&weak.shares).any(|(a, b)| a * b > 0.99)));
    Ok(Judgement { information, weak, silent })
}

/// Coulomb friction of joints that never slid.
pub(crate) fn sticking(problem: &Problem<'_>, robot: &Robot, moved: &[Moved]) -> Vec<Held> {
    let stuck = |joint: usize| match robot.joints[joint].friction {
        Friction::None => None,
        Friction::Coulomb { speed, slope_s, .. } => {
            let fastest = if speed == Side::Motor { moved[joint].speed } else { moved[joint].link_speed };
            (fastest < SLIDING / slope_s).then_some(fastest)
        }
    };
    let coordinates = problem.model.coordinates().iter().enumerate();
    let frictions = coordinates.filter(|(_, coordinate)| coordinate.spec.symbol == Symbol::Mu);
    let stuck = frictions.filter_map(|(i, coordinate)| {
        let speeds: Option<Vec<f64>> = coordinate.spec.joints.iter().map(|&joint| stuck(joint)).collect();
        let fastest = speeds?.into_iter().fold(0.0, f64::max);
        let joint = &robot.joints[*coordinate.spec.joints.first()?];
        let mut shares = vec![0.0; problem.border().size()];
        shares[i] = 1.0;
        let reason = format!(
            "{} never turned faster than {fastest:.1e} {}/s: it sticks, and does not show what sliding takes",
            joint.name,
            unit(joint)
        );
        Some(Held { direction: shares.clone(), shares, reason, convention: false })
    });
    stuck.collect()
}

fn unit(joint: &Joint) -> &'static str {
    if joint.kind == JointKind::Revolute { "rad" } else { "m" }
}

/// How many directions `information` leaves open besides those that are held.
pub(crate) fn open(problem: &Problem<'_>, point: &Point<'_>, information: &[f64], structural: &[Held]) -> usize {
    let guess = Guess::new(problem, point, information);
    sparse_basis(&guess.scaled(information, structural)).len()
}

/// Whether two sets of held directions span the same, as far as a search cares.
pub(crate) fn same(problem: &Problem<'_>, point: &Point<'_>, one: &[Held], other: &[Held]) -> bool {
    let guess = Guess::new(problem, point, &[]);
    let (a, b) = (guess.orthonormal(one), guess.orthonormal(other));
    a.ncols() == b.ncols() && (&a - &b * (b.transpose() * &a)).norm() < 0.05
}

/// `point` with its components along held directions as they are at `start`.
pub(crate) fn at_start<'m>(
    problem: &Problem<'m>,
    point: Point<'m>,
    start: &Point<'m>,
    held: &[Held],
    information: &[f64],
) -> Point<'m> {
    if held.is_empty() {
        return point;
    }
    let left = problem.scale.is_of_motion().then(|| left_of_the_way(problem, &point, start, held, information));
    let (mut at, mut to) = (point.clone(), point);
    // The coordinates of the dynamics are not linear in the parameters: each round leaves the square of what it removes.
    for _ in 0..6 {
        let guess = Guess::new(problem, &at, &[]);
        let axes = guess.orthonormal(held);
        let mut way = axes.transpose() * guess.in_units(&difference(problem.border(), start, &at));
        if let Some(left) = left.as_ref().filter(|left| left.len() == way.len()) {
            way -= left;
        }
        let back = &axes * way;
        let border = guess.to_border(&back);
        let step = Step { states: vec![0.0; at.states.len()], border };
        problem.retract(&at, &step, &mut to);
        std::mem::swap(&mut at, &mut to);
    }
    at
}

/// Along held directions, in units of the guess: what is left of the way from `point` to `start` where 95 % intervals do not reach all of it.
fn left_of_the_way(
    problem: &Problem<'_>,
    point: &Point<'_>,
    start: &Point<'_>,
    held: &[Held],
    information: &[f64],
) -> DVector<f64> {
    let guess = Guess::new(problem, point, information);
    let axes = guess.orthonormal(held);
    let scaled = guess.scaled(information, &[]);
    let mut way = axes.transpose() * guess.in_units(&difference(problem.border(), start, point));
    for (way, axis) in way.iter_mut().zip(axes.column_iter()) {
        let allowed = 1.96 / axis.dot(&(&scaled * axis)).max(0.0).sqrt();
        *way -= way.clamp(-allowed, allowed);
    }
    way
}

/// start ⊟ point, in the border's unknowns.
fn difference(border: &BorderLayout, start: &Point<'_>, point: &Point<'_>) -> Vec<f64> {
    let mut difference = vec![0.0; border.size()];
    for (d, (start, z)) in difference.iter_mut().zip(start.z.iter().zip(&point.z)) {
        *d = start - z;
    }
    for (gyro, (start, r)) in start.rotations.iter().zip(&point.rotations).enumerate() {
        difference[border.rotation(gyro)..][..3].copy_from_slice(rotation::boxminus(start, r).as_slice());
    }
    for (recording, (start, biases)) in start.biases.iter().zip(&point.biases).enumerate() {
        for (gyro, (start, bias)) in start.iter().zip(biases).enumerate() {
            difference[border.bias(recording, gyro)..][..3].copy_from_slice((start - bias).as_slice());
        }
    }
    difference
}

fn information(problem: &Problem<'_>, point: &Point<'_>, threads: usize) -> Result<Vec<f64>, SolveError> {
    Ok(factor::reduced(problem, point, threads)?.0)
}

/// The series with every gyro reading as the states say.
fn predicted_gyros(problem: &Problem<'_>, point: &Point<'_>) -> crate::calibrate::data::series::Series {
    let n = problem.model.layout().chain();
    let mut frame = SensorFrame::default();
    let mut series = problem.series.clone();
    for k in 0..series.stages() {
        let (q, qd) = point.state(k)[..2 * n].split_at(n);
        frame.rates(problem.model.chain(), q, qd);
        let biases = &point.biases[series.recording_of(k)];
        for gyro in &problem.rows.gyros {
            let rate = frame.gyro(gyro.body, &point.rotations[gyro.gyro], &biases[gyro.gyro]).0;
            for (axis, rate) in rate.iter().enumerate() {
                series.replace(k, gyro.channel + axis, *rate);
            }
        }
    }
    series
}

/// The prior guess: sizes of the physical parameters, and the way between them and the border's unknowns.
pub(crate) struct Guess {
    /// How large each of them is taken to be.
    pub(crate) size: DVector<f64>,
    /// ∂physical/∂border and its inverse.
    slopes: DMatrix<f64>,
    inverse: DMatrix<f64>,
    border: BorderLayout,
}

impl Guess {
    pub(crate) fn new(problem: &Problem<'_>, point: &Point<'_>, information: &[f64]) -> Self {
        let border = *problem.border();
        let m = border.size();
        let slopes = observability::physical_slopes(problem.model, &point.z, &border);
        let inverse = slopes.clone().try_inverse().unwrap_or_else(|| DMatrix::identity(m, m));
        let first_bias = border.bias(0, 0);
        let scale = problem.scale.guesses(problem.model, problem.series, point);
        let alone = |i: usize| match information.get(i * m + i) {
            Some(information) if *information > 0.0 => (LEAST_INFORMATION / (ALONE * information)).sqrt(),
            _ => 1.0,
        };
        let size = DVector::from_fn(m, |i, _| match scale.get(i) {
            Some(size) if size.is_finite() => *size,
            Some(_) => alone(i),
            // Laws of effects have no guess of their own.
            None if i < border.dynamics => alone(i),
            None if i < first_bias => MOUNTING_RAD,
            None => OFFSET_RAD_S,
        });
        Guess { size, slopes, inverse, border }
    }

    pub(crate) fn to_border(&self, scaled: &DVector<f64>) -> Vec<f64> {
        (&self.inverse * scaled.component_mul(&self.size)).as_slice().to_vec()
    }

    fn in_units(&self, direction: &[f64]) -> DVector<f64> {
        (&self.slopes * DVector::from_column_slice(direction)).component_div(&self.size)
    }

    /// Held directions, orthonormal in units of the guess.
    pub(crate) fn orthonormal(&self, held: &[Held]) -> DMatrix<f64> {
        let mut axes = DMatrix::zeros(self.size.len(), 0);
        for held in held {
            let mut v = self.in_units(&held.direction);
            let whole = v.norm();
            v -= &axes * (axes.transpose() * &v);
            if v.norm() > 1e-9 * whole {
                let at = axes.ncols();
                axes = axes.insert_column(at, 0.0);
                axes.set_column(at, &v.normalize());
            }
        }
        axes
    }

    /// The information in units of the guess; held directions are taken as known beyond doubt.
    pub(crate) fn scaled(&self, information: &[f64], held: &[Held]) -> DMatrix<f64> {
        let m = self.size.len();
        let by_size = DMatrix::from_fn(m, m, |i, j| self.inverse[(i, j)] * self.size[j]);
        let all = by_size.transpose() * DMatrix::from_row_slice(m, m, information) * by_size;
        let axes = self.orthonormal(held);
        let free = DMatrix::identity(m, m) - &axes * axes.transpose();
        let known = all.trace().max(1.0);
        let scaled = &free * all * &free + axes.scale(known) * axes.transpose();
        0.5 * (&scaled + scaled.transpose())
    }
}

/// The weak directions, turned within what they span so that each holds as few parameters as can be: the parameter that lies most
/// within it, then the one that does in what is left, and so on.
fn sparse_basis(scaled: &DMatrix<f64>) -> Vec<DVector<f64>> {
    let eigen = SymmetricEigen::new(scaled.clone());
    let m = scaled.nrows();
    let mut within = DMatrix::zeros(m, m);
    let mut count = 0;
    for (value, v) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
        if *value < LEAST_INFORMATION {
            within += v * v.transpose();
            count += 1;
        }
    }
    let mut basis = Vec::new();
    for _ in 0..count {
        let most = within.diagonal().imax();
        let direction = within.column(most).normalize();
        within -= &direction * (direction.transpose() * &within);
        basis.push(direction);
    }
    basis
}

/// Why the readings say nothing of a direction: in terms of the motion where one joint is concerned.
fn reason(
    robot: &Robot,
    problem: &Problem<'_>,
    guess: &Guess,
    direction: &DVector<f64>,
    spread: f64,
    moved: &[Moved],
) -> String {
    let told = if spread < 20.0 {
        format!("its readings say ± {:.0} %, the start value is as good", 100.0 * spread)
    } else {
        "it shows in no reading".to_owned()
    };
    let most = direction.iamax();
    if most >= guess.border.dynamics {
        return format!("this motion turns the gyros too little: {told}");
    }
    let Some(coordinate) = problem.model.coordinates().iter().nth(most) else { return told };
    match coordinate.spec.joints[..] {
        [joint] => {
            let name = &robot.joints[joint].name;
            let unit = unit(&robot.joints[joint]);
            let Moved { speed, windup, .. } = moved[joint];
            match coordinate.spec.symbol {
                Symbol::KS | Symbol::DS => {
                    format!("the belt of {name} never wound more than {windup:.1e} {unit}: {told}")
                }
                Symbol::Lag { .. } => format!("this motion turns the gyros too little: {told}"),
                _ => format!("{name} never turned faster than {speed:.1e} {unit}/s: {told}"),
            }
        }
        _ => {
            let fastest = moved.iter().fold(0.0_f64, |most, moved| most.max(moved.speed));
            format!("no joint turned faster than {fastest:.1e} rad/s: {told}")
        }
    }
}
