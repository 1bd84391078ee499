//! Directions of the shared unknowns that the robot's build, or this motion, cannot show.

use nalgebra::{DMatrix, Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use crate::calibrate::residuals::point::BorderLayout;
use crate::effect::TrueValue;
use crate::model::{Model, SensorFrame, rotation};
use crate::robot::Robot;

/// A direction that no estimate is given for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Unobservable {
    /// Unit combination of parameters: name and share.
    pub direction: Vec<(String, f64)>,
    /// Why the data cannot show it.
    pub reason: String,
}

/// A held direction.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Held {
    /// In the border's unknowns; as far as nobody knows where along it the truth lies.
    pub direction: Vec<f64>,
    /// Shares of the physical parameters.
    pub shares: Vec<f64>,
    /// Why; empty where the robot file fixes the parameter.
    pub reason: String,
    /// Whether its value is a convention, by which the other parameters are told: no motion could show it.
    pub convention: bool,
}

impl Held {
    /// A direction of gyro unknowns, which are their own parameters.
    fn of_gyro(direction: Vec<f64>, reason: String) -> Self {
        Held { shares: direction.clone(), direction, reason, convention: true }
    }
}

/// Turns every gyro back about the axis that its body alone turns about, until its misalignment has no component along it.
///
/// Steps along the other two axes compose to a small turn about the held one. It changes no prediction on a rigid base, and without
/// it the result would show a number that only the path of the search explains.
pub(crate) fn without_held_turns(rotations: &mut [Matrix3<f64>], robot: &Robot, border: &BorderLayout, held: &[Held]) {
    for (gyro, spec) in robot.gyros().enumerate() {
        let nominal = Matrix3::from_fn(|i, j| spec.rotation[i][j]);
        let at = border.rotation(gyro);
        let mut axes = held.iter().filter_map(|held| {
            let axis = Vector3::from_column_slice(&held.direction[at..at + 3]);
            (axis.norm() > 0.999).then_some(axis)
        });
        // One axis is a body that turns about one joint; three are a rotation that is known.
        if let (Some(axis), None) = (axes.next(), axes.next()) {
            // Each turn leaves the square of what it removes.
            for _ in 0..8 {
                let along = rotation::boxminus(&rotations[gyro], &nominal).dot(&axis);
                rotations[gyro] = rotation::boxplus(&rotations[gyro], &(-along * axis));
            }
        }
    }
}

/// True parameters as a calibration can find them, to compare with its estimates: the gyros' misalignments without the turn that no
/// motion shows.
pub fn comparable_truth(robot: &Robot, truth: &[TrueValue]) -> Vec<TrueValue> {
    let mut truth = truth.to_vec();
    let name = |gyro: usize, axis: usize| format!("R_imu{}[{}]", gyro + 1, ["x", "y", "z"][axis]);
    let value = |name: String| truth.iter().find(|value| value.name == name).map_or(0.0, |value| value.value);
    let misalignments: Vec<[f64; 3]> =
        (0..robot.gyros().count()).map(|gyro| [0, 1, 2].map(|axis| value(name(gyro, axis)))).collect();
    for (gyro, delta) in comparable_misalignments(robot, &misalignments).into_iter().enumerate() {
        for (axis, delta) in delta.into_iter().enumerate() {
            if let Some(value) = truth.iter_mut().find(|value| value.name == name(gyro, axis)) {
                value.value = delta;
            }
        }
    }
    truth
}

/// Misalignments δ (one a gyro, rad) as a calibration can find them: the same predictions on a rigid base, no component along what
/// the robot's build hides.
pub(crate) fn comparable_misalignments(robot: &Robot, misalignments: &[[f64; 3]]) -> Vec<[f64; 3]> {
    let model = Model::new(robot);
    let gyros = robot.gyros().count();
    let border = BorderLayout { dynamics: model.coordinates().len(), gyros, recordings: 1 };
    let nominal: Vec<_> = robot.gyros().map(|g| Matrix3::from_fn(|i, j| g.rotation[i][j])).collect();
    let mut rotations: Vec<_> =
        nominal.iter().zip(misalignments).map(|(r, delta)| rotation::boxplus(r, &Vector3::from(*delta))).collect();
    without_held_turns(&mut rotations, robot, &border, &structural(&model, robot, &border));
    rotations.iter().zip(&nominal).map(|(r, nominal)| rotation::boxminus(r, nominal).into()).collect()
}

/// Rates of the body that carries a gyro span fewer than two directions: turning the gyro about what they span changes no prediction.
///
/// This is decided by the chain alone. The information matrix cannot tell: under (26) the gyro's noise enters the column of this
/// angle and makes it look known.
pub(crate) fn structural(model: &Model, robot: &Robot, border: &BorderLayout) -> Vec<Held> {
    let mut held = Vec::new();
    for (gyro, spec) in robot.gyros().enumerate() {
        let fixed = |component: usize| {
            let mut direction = vec![0.0; border.size()];
            direction[border.rotation(gyro) + component] = 1.0;
            direction
        };
        if !spec.rotation_free {
            held.extend((0..3).map(|i| Held::of_gyro(fixed(i), String::new())));
        } else {
            let spanned = spanned_rates(model, robot, model.body(spec.body));
            let eigen = spanned.symmetric_eigen();
            let mut order = [0, 1, 2];
            order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
            let rank = eigen.eigenvalues.iter().filter(|&&v| v > 1e-12 * eigen.eigenvalues.max().max(1e-300)).count();
            if eigen.eigenvalues.max() <= 0.0 {
                let reason = format!("no joint turns the body of gyro {}", gyro + 1);
                held.extend((0..3).map(|i| Held::of_gyro(fixed(i), reason.clone())));
            } else if rank == 1 {
                let axis = eigen.eigenvectors.column(order[0]);
                let mut direction = vec![0.0; border.size()];
                let sign = if axis[axis.iamax()] < 0.0 { -1.0 } else { 1.0 };
                for i in 0..3 {
                    direction[border.rotation(gyro) + i] = sign * axis[i];
                }
                let joint = &robot.joints[spec.body].name;
                let reason = format!("rigid base: the {joint} rate is all that gyro {} sees", gyro + 1);
                held.push(Held::of_gyro(direction, reason));
            }
        }
        if !spec.bias_free {
            for recording in 0..border.recordings {
                for axis in 0..3 {
                    let mut direction = vec![0.0; border.size()];
                    direction[border.bias(recording, gyro) + axis] = 1.0;
                    held.push(Held::of_gyro(direction, String::new()));
                }
            }
        }
    }
    held
}

/// Σ ω ωᵀ of the body over unit speeds of every joint, at positions spread over the joints' ranges.
fn spanned_rates(model: &Model, robot: &Robot, body: usize) -> Matrix3<f64> {
    // Passive joints move a little.
    const PASSIVE_RAD: f64 = 0.05;
    let m = model.layout().chain();
    let mut frame = SensorFrame::default();
    let mut sum = Matrix3::zeros();
    for sample in 0..8 {
        // Corners and inner points of the ranges, another share of the range for each joint.
        let mut q = vec![0.0; m];
        let share = |j: usize| ((sample * (2 * j + 3)) % 8) as f64 / 7.0;
        for (j, joint) in robot.joints.iter().enumerate() {
            q[model.layout().q(j)] = joint.limits[0] + share(j) * (joint.limits[1] - joint.limits[0]);
        }
        model.layout().passive().for_each(|i| q[i] = PASSIVE_RAD * (2.0 * share(i) - 1.0));
        frame.linearise(model.chain(), &q, &vec![0.0; m]);
        for joint in 0..m {
            let rate = frame.slope(body, m + joint);
            sum += rate * rate.transpose();
        }
    }
    sum
}

/// Names a direction by its parameters, largest share first, shares below a twentieth left out.
pub(crate) fn named(direction: &[f64], names: &[String]) -> Vec<(String, f64)> {
    let norm = direction.iter().map(|v| v * v).sum::<f64>().sqrt();
    let mut shares: Vec<_> = names
        .iter()
        .zip(direction)
        .map(|(name, v)| (name.clone(), v / norm))
        .filter(|(_, share)| share.abs() > 0.05)
        .collect();
    shares.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
    shares
}

/// The Jacobian of the physical parameters by the border's unknowns, square: those of laws, rotations and biases are their own.
pub(crate) fn physical_slopes(model: &Model, z: &[f64], border: &BorderLayout) -> DMatrix<f64> {
    let mut slopes = DMatrix::identity(border.size(), border.size());
    for i in 0..model.coordinates().iter().count() {
        slopes[(i, i)] = 0.0;
        for (column, slope) in model.coordinates().physical_and_slopes(z, i).1 {
            slopes[(i, column)] += slope;
        }
    }
    slopes
}

/// The Jacobian of the results by the border's unknowns. Rotations and biases are their own; the dynamics have as many results as
/// [`Coordinates::results`](crate::model::Coordinates::results) says.
pub(crate) fn result_slopes(model: &Model, z: &[f64], border: &BorderLayout) -> DMatrix<f64> {
    let results = model.coordinates().results();
    let rest = border.size() - border.dynamics;
    let mut slopes = DMatrix::zeros(results + rest, border.size());
    for i in 0..results {
        for (column, slope) in model.coordinates().physical_and_slopes(z, i).1 {
            slopes[(i, column)] += slope;
        }
    }
    for i in 0..rest {
        slopes[(results + i, border.dynamics + i)] = 1.0;
    }
    slopes
}
