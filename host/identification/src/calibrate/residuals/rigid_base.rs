//! The default preset's gyro rows: each axis from the state at the instant of its reading, on a base at rest.

use nalgebra::Vector3;

use super::point::Point;
use super::problem::{Problem, Scratch};
use super::row::{Depends, Late, Row};
use crate::model::Linear;

impl<'m> Problem<'m> {
    /// All axes of all gyros from the state on a base at rest.
    pub(crate) fn rigid_base_rows(
        &self,
        point: &Point<'m>,
        k: usize,
        scratch: &mut Scratch,
        with_slopes: bool,
        row: &mut impl FnMut(Row<'_>),
    ) {
        let n = self.model.layout().chain();
        let measured = self.series.measured(k);
        let recording = self.series.recording_of(k);
        let mut evaluated_at = f64::NAN;
        for gyro in &self.rows.gyros {
            let value = Vector3::from_column_slice(&measured[gyro.channel..gyro.channel + 3]);
            if value.iter().all(|v| v.is_nan()) {
                continue;
            }
            let (lag_s, lag) = self.model.gyro_lag(gyro.gyro, &point.z);
            let offset_s = self.series.instant_s(k, gyro.gyro).unwrap_or(gyro.offset_s) - lag_s;
            if offset_s != evaluated_at {
                evaluated_at = offset_s;
                self.state_at(point, k, offset_s, scratch, with_slopes);
                let Scratch { at, frame, .. } = scratch;
                let (q, qd) = at[..2 * n].split_at(n);
                if with_slopes {
                    frame.linearise(self.model.chain(), q, qd);
                } else {
                    frame.rates(self.model.chain(), q, qd);
                }
            }
            if self.law_sees_gyro(gyro.gyro) {
                self.gyro_law_rows(point, k, (gyro, &value), (offset_s, lag), (scratch, with_slopes), row);
                continue;
            }
            let rotation = &point.rotations[gyro.gyro];
            let (predicted, slopes) = scratch.frame.gyro(gyro.body, rotation, &point.biases[recording][gyro.gyro]);
            for axis in 0..3 {
                if value[axis].is_nan() {
                    continue;
                }
                let sensor_axis: [f64; 3] = std::array::from_fn(|j| rotation[(axis, j)]);
                row(Row {
                    channel: Some(gyro.channel + axis),
                    residual: predicted[axis] - value[axis],
                    weight: gyro.weight[axis],
                    depends: Depends::BodyRate {
                        frame: &scratch.frame,
                        body: gyro.body,
                        sensor_axis,
                        late: Late { offset_s, lag, start: &scratch.gyro_start, halfway: &scratch.gyro_halfway },
                        bias: self.border.bias(recording, gyro.gyro) + axis,
                        rotation: self.border.rotation(gyro.gyro),
                        by_rotation: std::array::from_fn(|j| slopes.by_rotation[(axis, j)]),
                    },
                    linear: &scratch.linear,
                });
            }
        }
    }

    /// The state `offset_s` after stage k, into the scratch: x + h f(x + h/2 f(x)), with the input that is in force there.
    fn state_at(&self, point: &Point<'m>, k: usize, offset_s: f64, scratch: &mut Scratch, with_slopes: bool) {
        let x = point.state(k);
        let Scratch { at, gyro_start, gyro_halfway, halfway, late_input, .. } = scratch;
        at.clear();
        at.extend_from_slice(x);
        if !self.late {
            return;
        }
        let before = offset_s < 0.0 && k > 0 && self.linked(k - 1);
        let input = self.input(point, if before { k - 1 } else { k }, late_input);
        let rates = |x: &[f64], linear: &mut Linear| {
            if with_slopes {
                point.dynamics.linearise(x, input, linear);
            } else {
                linear.xdot.resize(x.len(), 0.0);
                point.dynamics.derivative(x, input, &mut linear.xdot);
            }
        };
        rates(x, gyro_start);
        halfway.clear();
        halfway.extend(x.iter().zip(&gyro_start.xdot).map(|(x, rate)| x + 0.5 * offset_s * rate));
        rates(halfway, gyro_halfway);
        for (at, rate) in at.iter_mut().zip(&gyro_halfway.xdot) {
            *at += offset_s * rate;
        }
    }
}
