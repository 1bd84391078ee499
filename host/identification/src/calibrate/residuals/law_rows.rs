//! What laws of effects change in time and at the sensors: late inputs, late readings, and rows of sensors that err.

use nalgebra::Vector3;

use super::point::Point;
use super::problem::{Problem, Scratch};
use super::row::{Depends, Late, Row};
use super::row_plan::{GyroRow, ScalarRow};
use crate::model::Input;
use crate::model::rotation::skew;
use crate::robot::Side;

impl<'m> Problem<'m> {
    /// Takes the readings of position sensors later by whole samples where laws say so at the coordinates `z`. Says whether anything changed.
    pub(crate) fn shift_readings(&mut self, z: &[f64]) -> bool {
        let mut changed = false;
        for scalar in &mut self.rows.scalars {
            let Some((joint, side)) = scalar.position else { continue };
            let laws = self.model.laws().iter().enumerate();
            let of = laws
                .map(|(i, law)| law.shift(side, joint, self.model.coordinates().of_law(i, z), self.series.period_s));
            let shift = of.sum();
            changed |= shift != scalar.shift;
            scalar.shift = shift;
        }
        changed
    }

    /// A reading of stage k, or of so many samples later; NaN where there is none.
    pub(crate) fn reading(&self, k: usize, scalar: &ScalarRow) -> f64 {
        if scalar.shift == 0 {
            return self.series.measured(k)[scalar.channel];
        }
        self.series.beside(k, scalar.shift).map_or(f64::NAN, |k| self.series.measured(k)[scalar.channel])
    }

    /// What drives the step from stage k on.
    pub(crate) fn input<'a>(
        &'a self,
        point: &Point<'m>,
        k: usize,
        [late, by_delay]: &'a mut [Vec<f64>; 2],
    ) -> Input<'a> {
        let time_s = self.series.time_s(k);
        let Some(delay) = self.model.input_delay() else {
            return Input { u: self.series.input(k), by_delay: &[], time_s };
        };
        // The share of the step's span in which the input before the last one is still in force.
        let duration_s = self.series.period_s;
        let samples = point.z[delay] / duration_s;
        let share = samples - samples.floor();
        let whole = samples.floor().clamp(-1e6, 1e6) as i32;
        let newer = self.series.input(self.series.nearest(k, -whole));
        let older = self.series.input(self.series.nearest(k, -whole - 1));
        late.clear();
        by_delay.clear();
        for (newer, older) in newer.iter().zip(older) {
            late.push(newer + share * (older - newer));
            by_delay.push((older - newer) / duration_s);
        }
        Input { u: late, by_delay, time_s }
    }

    /// Whether laws change what this channel reads.
    pub(crate) fn law_sees(&self, scalar: &ScalarRow) -> Option<(usize, Side)> {
        scalar.position.filter(|&(joint, side)| self.sensor_laws.see_position(side, joint))
    }

    /// Whether laws change what this gyro reads, or it lags.
    pub(crate) fn law_sees_gyro(&self, gyro: usize) -> bool {
        self.sensor_laws.see_gyro(gyro) || self.model.lagging(gyro).is_some()
    }

    /// The row of a position sensor under laws, compared with `value`.
    pub(crate) fn position_row(
        &self,
        point: &Point<'m>,
        k: usize,
        (scalar, (joint, side), value): (&ScalarRow, (usize, Side), f64),
        scratch: &Scratch,
        row: &mut impl FnMut(Row<'_>),
    ) {
        let layout = self.model.layout();
        let speed = match side {
            Side::Motor => layout.thetad(joint),
            Side::Link => layout.qd(joint),
        };
        let x = point.state(k);
        let position = x[scalar.component] + scalar.offset_s * x[speed];
        let shifted_s = f64::from(scalar.shift) * self.series.period_s;
        let reading = self.sensor_laws.position(self.model, &point.z, (side, joint), [position, x[speed]], shifted_s);
        let [by_position, by_speed] = reading.slopes;
        row(Row {
            channel: Some(scalar.channel),
            residual: reading.value - value,
            weight: scalar.weight,
            depends: Depends::Free {
                states: &[(scalar.component, by_position), (speed, by_speed + scalar.offset_s * by_position)],
                late: Late { offset_s: 0.0, lag: None, start: &scratch.linear, halfway: &scratch.linear },
                border: &reading.by_z,
            },
            linear: &scratch.linear,
        });
    }

    /// The rows of a gyro under laws; the scratch's frame is that of its instant, and has its slopes where they are asked for.
    pub(crate) fn gyro_law_rows(
        &self,
        point: &Point<'m>,
        k: usize,
        (gyro, value): (&GyroRow, &Vector3<f64>),
        (offset_s, lag): (f64, Option<usize>),
        (scratch, with_slopes): (&Scratch, bool),
        row: &mut impl FnMut(Row<'_>),
    ) {
        let recording = self.series.recording_of(k);
        let (frame, m) = (&scratch.frame, self.model.layout().chain());
        let late = Late { offset_s, lag, start: &scratch.gyro_start, halfway: &scratch.gyro_halfway };
        let rotation = &point.rotations[gyro.gyro];
        let lagging = self.model.lagging(gyro.gyro);
        let turns = frame.rate(gyro.body);
        let omega = lagging.map_or(turns, |lagging| lagging.rate(&scratch.at, turns.into()).into());
        // What is read by the body's rate, and by the filtered one.
        let [by_body, by_filtered] = lagging.map_or([1.0, 0.0], |lagging| [-lagging.beyond, 1.0 + lagging.beyond]);
        let at = (gyro.gyro, self.series.time_s(k));
        let bias = point.biases[recording][gyro.gyro];
        let reading = self.sensor_laws.gyro(self.model, &point.z, at, rotation * omega, bias);
        let by_turn = -rotation * skew(&omega);
        let (mut states, mut border) = (Vec::new(), Vec::new());
        for axis in (0..3).filter(|&axis| value[axis].is_finite()) {
            let by_omega = rotation.transpose() * reading.by_rate[axis];
            states.clear();
            if with_slopes && by_body != 0.0 {
                states.extend((0..2 * m).map(|c| (c, by_body * frame.slope(gyro.body, c).dot(&by_omega))));
            }
            if let Some(lagging) = lagging {
                states.extend((0..3).map(|i| (lagging.state + i, by_filtered * by_omega[i])));
            }
            border.clear();
            let turn = by_turn.transpose() * reading.by_rate[axis];
            border.extend((0..3).map(|i| (self.border.rotation(gyro.gyro) + i, turn[i])));
            border.extend((0..3).map(|i| (self.border.bias(recording, gyro.gyro) + i, reading.by_bias[axis][i])));
            border.extend(reading.by_z.iter().map(|(z, slopes)| (*z, slopes[axis])));
            row(Row {
                channel: Some(gyro.channel + axis),
                residual: reading.value[axis] - value[axis],
                weight: gyro.weight[axis],
                depends: Depends::Free { states: &states, late, border: &border },
                linear: &scratch.linear,
            });
        }
    }
}
