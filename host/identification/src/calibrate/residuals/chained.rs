//! The paper's gyro rows: gyro 1 gives the rate about the axis before it, and its measurement is the base of the others' predictions.
//!
//! With ω₁ = R₁ᵀ (z₁ − bias₁), in the axes of body 1:
//!
//! ```text
//! (22)       q̇₁ − a·ω₁                                                 a: the joint axis before gyro 1
//! (25)–(26)  R₂ (ω_body2(q, q̇) + R₁→₂(q) (ω₁ − ω_body1(q, q̇))) + bias₂ − z₂
//! (32)       bias − z, while no input has been given
//! ```
//! In (26) ω_body is the rigid-base rate, so that the bracket is R₁→₂ ω₁ plus what the joints between the two bodies add. Both rows subtract
//! the bias of gyro 1, which the print of (26) forgets.

use nalgebra::{Const, Matrix3, SVector, Vector3};
use num_dual::{Derivative, DualSVec64};

use super::point::Point;
use super::problem::{Problem, Scratch};
use super::row::{Depends, Row};
use super::row_plan::GyroRow;
use crate::model::rotation::skew;
use crate::robot::chain::{Chain, MAX_JOINTS};

/// Derivatives by joint positions are taken this many at a time.
const LANES: usize = 4;
type Lanes = DualSVec64<LANES>;

/// v of body `from` in the axes of body `to`, and the derivatives by q.
fn turned(
    chain: &Chain,
    q: &[f64],
    from: usize,
    to: usize,
    v: Vector3<f64>,
    by_q: &mut Vec<Vector3<f64>>,
) -> Vector3<f64> {
    let n = q.len();
    by_q.clear();
    by_q.resize(n, Vector3::zeros());
    let mut value = Vector3::zeros();
    let zero = Lanes::from(0.0);
    for first in (0..n).step_by(LANES) {
        let mut dual_q = [zero; MAX_JOINTS];
        for (i, dual) in dual_q[..n].iter_mut().enumerate() {
            let mut unit = SVector::<f64, LANES>::zeros();
            if (first..first + LANES).contains(&i) {
                unit[i - first] = 1.0;
            }
            *dual = Lanes::new(q[i], Derivative::some(unit));
        }
        let mut rotations = [[[zero; 3]; 3]; MAX_JOINTS];
        chain.body_rotations(&dual_q[..n], &mut rotations[..n]);
        // Into base axes by the transpose of one, out of them by the other.
        let base: [Lanes; 3] = std::array::from_fn(|j| {
            rotations[from][0][j] * v.x + rotations[from][1][j] * v.y + rotations[from][2][j] * v.z
        });
        for (axis, row) in rotations[to].iter().enumerate() {
            let component = row[0] * base[0] + row[1] * base[1] + row[2] * base[2];
            value[axis] = component.re;
            let slope = component.eps.unwrap_generic(Const::<LANES>, Const::<1>);
            for lane in 0..LANES.min(n - first) {
                by_q[first + lane][axis] = slope[lane];
            }
        }
    }
    value
}

/// [`turned`] without its derivatives.
fn turned_value(chain: &Chain, q: &[f64], from: usize, to: usize, v: Vector3<f64>) -> Vector3<f64> {
    let mut rotations = [[[0.0; 3]; 3]; MAX_JOINTS];
    chain.body_rotations(q, &mut rotations[..q.len()]);
    let [from, to] = [from, to].map(|body| Matrix3::from_fn(|i, j| rotations[body][i][j]));
    to * from.tr_mul(&v)
}

impl<'m> Problem<'m> {
    /// Rows (22), (25)–(26) and (32) of stage k.
    pub(crate) fn chained_rows(
        &self,
        point: &Point<'m>,
        k: usize,
        scratch: &mut Scratch,
        with_slopes: bool,
        row: &mut impl FnMut(Row<'_>),
    ) {
        let Some((first, others)) = self.rows.gyros.split_first() else { return };
        let recording = self.series.recording_of(k);
        let measured = self.series.measured(k);
        let reading = |gyro: &GyroRow| Vector3::from_column_slice(&measured[gyro.channel..gyro.channel + 3]);
        let bias = |gyro: &GyroRow| point.biases[recording][gyro.gyro];
        let base_reading = reading(first);
        let complete = base_reading.iter().all(|v| v.is_finite());
        let linear = &scratch.linear;
        let (mut states, mut border) = (Vec::new(), Vec::new());
        if complete {
            let n = self.model.layout().chain();
            let (q, qd) = point.state(k)[..2 * n].split_at(n);
            if with_slopes {
                scratch.frame.linearise(self.model.chain(), q, qd);
            } else {
                scratch.frame.rates(self.model.chain(), q, qd);
            }
            let frame = &scratch.frame;
            let rotation = point.rotations[first.gyro];
            let omega = rotation.transpose() * (base_reading - bias(first));
            // ω₁ by δ of R₁ ⊞ δ: Rot(−δ) ω₁ ≈ ω₁ + ω₁ × δ.
            let omega_by_rotation = skew(&omega);
            let omega_by_bias: Matrix3<f64> = -rotation.transpose();

            // (22): the body's rate about the joint axis that carries it.
            let axis = self.axis_before(first.body);
            if with_slopes {
                for column in 0..2 * n {
                    states.push((column, frame.slope(first.body, column).dot(&axis)));
                }
                for j in 0..3 {
                    border.push((self.border.rotation(first.gyro) + j, -axis.dot(&omega_by_rotation.column(j))));
                    border.push((self.border.bias(recording, first.gyro) + j, -axis.dot(&omega_by_bias.column(j))));
                }
            }
            row(Row {
                channel: None,
                residual: axis.dot(&(frame.rate(first.body) - omega)),
                weight: first.weight[0],
                depends: Depends::Listed { states: &states, border: &border },
                linear,
            });

            let mut by_q = Vec::new();
            for gyro in others {
                let value = reading(gyro);
                let surplus = omega - frame.rate(first.body);
                let carried = if with_slopes {
                    turned(self.model.chain(), q, first.body, gyro.body, surplus, &mut by_q)
                } else {
                    turned_value(self.model.chain(), q, first.body, gyro.body, surplus)
                };
                let rate = frame.rate(gyro.body) + carried;
                let own = point.rotations[gyro.gyro];
                let predicted = own * rate + bias(gyro);
                let by_rotation = -own * skew(&rate);
                // R₁→₂ as a matrix: its columns are the turned unit vectors. Only slopes need it.
                let mut unused = Vec::new();
                let mut turn = Matrix3::zeros();
                if with_slopes {
                    let units = [Vector3::x(), Vector3::y(), Vector3::z()];
                    turn = Matrix3::from_columns(
                        &units.map(|unit| turned(self.model.chain(), q, first.body, gyro.body, unit, &mut unused)),
                    );
                }
                for axis in (0..3).filter(|&axis| value[axis].is_finite()) {
                    states.clear();
                    border.clear();
                    if with_slopes {
                        let sensor_axis = own.row(axis).transpose();
                        for column in 0..2 * n {
                            let mut slope = frame.slope(gyro.body, column) - turn * frame.slope(first.body, column);
                            if column < n {
                                slope += by_q[column];
                            }
                            states.push((column, sensor_axis.dot(&slope)));
                        }
                        border.push((self.border.bias(recording, gyro.gyro) + axis, 1.0));
                        let carried_axis = turn.transpose() * sensor_axis;
                        for j in 0..3 {
                            border.push((self.border.rotation(gyro.gyro) + j, by_rotation[(axis, j)]));
                            let by_base = carried_axis.dot(&omega_by_rotation.column(j));
                            border.push((self.border.rotation(first.gyro) + j, by_base));
                            let by_base = carried_axis.dot(&omega_by_bias.column(j));
                            border.push((self.border.bias(recording, first.gyro) + j, by_base));
                        }
                    }
                    row(Row {
                        channel: Some(gyro.channel + axis),
                        residual: predicted[axis] - value[axis],
                        weight: gyro.weight[axis],
                        depends: Depends::Listed { states: &states, border: &border },
                        linear,
                    });
                }
            }
        }
        if self.series.rest[recording].contains(&k) {
            for gyro in &self.rows.gyros {
                let (value, bias) = (reading(gyro), bias(gyro));
                for axis in (0..3).filter(|&axis| value[axis].is_finite()) {
                    row(Row {
                        channel: None,
                        residual: bias[axis] - value[axis],
                        weight: gyro.weight[axis],
                        depends: Depends::Listed {
                            states: &[],
                            border: &[(self.border.bias(recording, gyro.gyro) + axis, 1.0)],
                        },
                        linear,
                    });
                }
            }
        }
    }

    /// The axis of the joint that carries `body`, in the axes of that body: its rate when only this joint moves.
    pub(crate) fn axis_before(&self, body: usize) -> Vector3<f64> {
        let n = self.model.layout().chain();
        let mut qd = [0.0; MAX_JOINTS];
        qd[body] = 1.0;
        let mut rates = [[0.0; 3]; MAX_JOINTS];
        self.model.chain().body_rates(&[0.0; MAX_JOINTS][..n], &qd[..n], &mut rates[..n]);
        Vector3::from(rates[body])
    }
}
