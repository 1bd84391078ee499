//! How a gyro is mounted, from the directions in which it saw the joints turn.
//!
//! ```text
//!   joint j turns ──▶ the gyro reads a direction r_j      the description says R b_j: axis of the joint in body axes, turned by
//!                                                         the gyro's nominal rotation R
//!   a quarter-turn mounting S in the gyro's axes:         r_j = S R b_j for every joint that carries it
//! ```
//!
//! S is one of 24 rotations by quarter turns, or one of 24 with a mirror in them.

use std::fmt;

use super::jog::length;
use crate::robot::{Matrix3, Robot, Vector3};

/// How far a direction may be from where it should be, degrees: 4° of mounting, which a calibration finds, and what a
/// jog measures it to.
const NEAR_DEG: f64 = 15.0;

/// A turn about an axis, by less than a whole one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Turn {
    /// Unit vector in the sensor's axes.
    pub axis: Vector3,
    /// By the right hand, degrees.
    pub degrees: f64,
}

impl fmt::Display for Turn {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let along = (0..3).find(|i| self.axis[*i].abs() > 0.99);
        match along {
            Some(i) => {
                let degrees = if self.axis[i] < 0.0 { -self.degrees } else { self.degrees };
                write!(f, "{degrees:.0}° about its {} axis", ["x", "y", "z"][i])
            }
            None => {
                let [x, y, z] = self.axis;
                write!(f, "{:.0}° about ({x:.2}, {y:.2}, {z:.2}) in its axes", self.degrees)
            }
        }
    }
}

/// A joint seen by a gyro.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Seen {
    /// The joint, from 0.
    pub joint: usize,
    /// The direction in which the gyro turned, unit vector in its axes.
    pub direction: Vector3,
    /// Where the description has it.
    pub expected: Vector3,
}

/// How a gyro is mounted.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Mounting {
    /// As described.
    AsDescribed,
    /// Turned by quarter turns in its own axes; `or_mirrored`: a mirror would explain it as well.
    Turned { by: Matrix3, or_mirrored: bool },
    /// Only a mirror explains it.
    Mirrored { by: Matrix3 },
    /// Nothing of that: the joint that is farthest off, and by how much, degrees.
    Askew { joint: usize, degrees: f64 },
}

/// What the description says of the axis of every joint, in axes of every gyro: by gyro, then joint; zero where the joint
/// does not turn it.
pub(super) fn expected(robot: &Robot) -> Vec<Vec<Vector3>> {
    let chain = robot.chain();
    let n = robot.joints.len();
    let axis = |gyro: &crate::robot::Gyro, joint: usize| {
        let (mut speeds, mut rates) = (vec![0.0; n], vec![[0.0; 3]; n]);
        speeds[joint] = 1.0;
        chain.body_rates(&vec![0.0; n], &speeds, &mut rates);
        apply(&gyro.rotation, rates[gyro.body])
    };
    robot.gyros().map(|gyro| (0..n).map(|joint| axis(gyro, joint)).collect()).collect()
}

/// Decides how a gyro is mounted that saw these joints turn.
pub(super) fn judge(seen: &[Seen]) -> Mounting {
    let worst = |by: &Matrix3| {
        let off = |seen: &Seen| (seen.joint, degrees_between(seen.direction, apply(by, seen.expected)));
        seen.iter().map(off).fold((0, 0.0), |worst, now| if now.1 > worst.1 { now } else { worst })
    };
    let (joint, degrees) = worst(&IDENTITY);
    if degrees < NEAR_DEG {
        return Mounting::AsDescribed;
    }
    let fits = |wanted: f64| {
        let fitting = quarter_turns().filter(move |by| determinant(by) * wanted > 0.0 && worst(by).1 < NEAR_DEG);
        // The smallest turn: the largest trace.
        fitting.max_by(|a, b| trace(a).total_cmp(&trace(b)))
    };
    match (fits(1.0), fits(-1.0)) {
        (Some(by), mirrored) => Mounting::Turned { by, or_mirrored: mirrored.is_some() },
        (None, Some(by)) => Mounting::Mirrored { by },
        (None, None) => Mounting::Askew { joint, degrees },
    }
}

/// The turn of a rotation.
pub(super) fn turn(by: &Matrix3) -> Turn {
    let rotation = nalgebra::Rotation3::from_matrix_unchecked(nalgebra::Matrix3::from_fn(|i, j| by[i][j]));
    match rotation.axis_angle() {
        Some((axis, angle)) => Turn { axis: [axis.x, axis.y, axis.z], degrees: angle.to_degrees() },
        None => Turn { axis: [1.0, 0.0, 0.0], degrees: 0.0 },
    }
}

/// What stands on the axes x, y, z, as "+x, -z, +y".
pub(super) fn axes(by: &Matrix3) -> String {
    let names = by.map(|row| {
        let column = (0..3).find(|j| row[*j] != 0.0).unwrap_or(0);
        format!("{}{}", if row[column] < 0.0 { '-' } else { '+' }, ["x", "y", "z"][column])
    });
    names.join(", ")
}

const IDENTITY: Matrix3 = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// All 48 matrices that put each axis on an axis.
fn quarter_turns() -> impl Iterator<Item = Matrix3> {
    const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
    ORDERS.into_iter().flat_map(|order| {
        (0..8).map(move |signs| {
            std::array::from_fn(|i| {
                let sign = if signs >> i & 1 == 0 { 1.0 } else { -1.0 };
                std::array::from_fn(|j| if order[i] == j { sign } else { 0.0 })
            })
        })
    })
}

pub(super) fn apply(matrix: &Matrix3, vector: Vector3) -> Vector3 {
    matrix.map(|row| dot(row, vector))
}

/// The product of two matrices.
pub(super) fn product(a: &Matrix3, b: &Matrix3) -> Matrix3 {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

pub(super) fn dot(a: Vector3, b: Vector3) -> f64 {
    (0..3).map(|i| a[i] * b[i]).sum()
}

fn degrees_between(a: Vector3, b: Vector3) -> f64 {
    (dot(a, b) / (length(a) * length(b))).clamp(-1.0, 1.0).acos().to_degrees()
}

fn trace(m: &Matrix3) -> f64 {
    m[0][0] + m[1][1] + m[2][2]
}

fn determinant(m: &Matrix3) -> f64 {
    nalgebra::Matrix3::from_fn(|i, j| m[i][j]).determinant()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(by: &Matrix3, expected: &[Vector3]) -> Vec<Seen> {
        let see =
            |(joint, expected): (usize, &Vector3)| Seen { joint, direction: apply(by, *expected), expected: *expected };
        expected.iter().enumerate().map(see).collect()
    }

    /// A gyro that sees three axes: every one of the 48 mountings is told apart, and written down is what it is.
    #[test]
    fn three_axes_tell_every_mounting() {
        let robot = Robot::builtin("doggy").unwrap();
        let expected = &expected(&robot)[1];
        for by in quarter_turns() {
            match judge(&seen(&by, expected)) {
                Mounting::AsDescribed => assert_eq!(by, IDENTITY),
                Mounting::Turned { by: found, or_mirrored } => {
                    assert_eq!((found, or_mirrored), (by, false));
                    assert!(determinant(&by) > 0.0);
                }
                Mounting::Mirrored { by: found } => {
                    assert_eq!(found, by);
                    assert!(determinant(&by) < 0.0);
                }
                askew => panic!("{by:?}: {askew:?}"),
            }
        }
    }

    #[test]
    fn one_axis_tells_whether_it_is_where_it_should_be() {
        let up = [0.0, 0.0, 1.0];
        let with = |direction| judge(&[Seen { joint: 0, direction, expected: up }]);
        assert_eq!(with([0.02, 0.03, 1.0]), Mounting::AsDescribed);
        let Mounting::Turned { by, or_mirrored: true } = with([0.0, 1.0, 0.05]) else { panic!() };
        assert!((turn(&by).degrees - 90.0).abs() < 1e-9, "{by:?}");
        let Mounting::Turned { or_mirrored: true, .. } = with([0.0, 0.0, -1.0]) else { panic!() };
        let Mounting::Askew { joint: 0, degrees } = with([0.0, 0.5, 0.866]) else { panic!() };
        assert!((degrees - 30.0).abs() < 0.1, "{degrees}");
    }

    #[test]
    fn a_turn_is_told_in_words() {
        let by = [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
        assert_eq!(turn(&by).to_string(), "-90° about its z axis");
        assert_eq!(axes(&by), "+y, -x, +z");
    }
}
