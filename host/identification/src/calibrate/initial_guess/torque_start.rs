//! Start values of a rigid robot: robust least squares of its parameters on the torques along filtered differences.
//!
//! Torques are linear in the parameters, so that the search begins at the same place whatever the robot file starts with. What the torques do not show keeps
//! the file's value, and so does what they show to be impossible, as a negative inertia; the others are then found beside it. Where a torque constant is unknown,
//! torques that are known, as those of a body's weight, set the scale; without them all torques are none with all parameters zero. Such a robot, and an
//! elastic one, starts as its file says.

use nalgebra::DMatrix;

use crate::calibrate::data::series::Series;
use crate::calibrate::residuals::robot_scale::Drive;
use crate::inverse_dynamics::{self, Cornered, Identified, Readings, SHORTEST_RUN};
use crate::model::Model;
use crate::robot::{ChannelKind, Robot};

/// What the torques show.
#[derive(Debug, Clone)]
pub(crate) struct TorqueStart {
    /// Solver coordinates of the base model.
    pub z: Vec<f64>,
    /// Of these; zero where the torques do not show one.
    pub covariance: DMatrix<f64>,
    /// Corner of the positions' filter, Hz.
    pub corner_hz: f64,
    /// Standard deviation of what is left of the torques, by joint, in the input's unit.
    pub left: Vec<f64>,
}

impl TorqueStart {
    /// Standard error of a coordinate; none where the torques do not show it.
    pub fn std_error(&self, i: usize) -> Option<f64> {
        Some(self.covariance[(i, i)].sqrt()).filter(|error| *error > 0.0)
    }
}

/// The start for `model`, whose coordinates are those of the base model of `robot`; none where the method is not for this robot.
pub(crate) fn of(model: &Model, robot: &Robot, series: &Series) -> Option<TorqueStart> {
    let layout = model.layout();
    let is_rigid = (0..layout.joints()).all(|joint| !layout.is_elastic(joint)) && layout.passive().next().is_none();
    if !is_rigid || !model.laws().is_empty() || model.coordinates().is_empty() {
        return None;
    }
    let readings: Option<Vec<Readings>> =
        series.segments.iter().map(|run| readings(model, series, run.clone())).collect();
    let readings: Vec<Readings> = readings?.into_iter().filter(|run| run.time_s.len() >= SHORTEST_RUN).collect();
    let exact = Model::new(&robot.clone().with_exact_input());
    let start = model.coordinates().start();
    let mut held = Vec::new();
    loop {
        let Cornered { motion, identified: Identified { z, covariance }, .. } =
            inverse_dynamics::corner(&readings, &exact, &start, &held)?;
        let impossible: Vec<usize> = model
            .coordinates()
            .iter()
            .enumerate()
            .filter(|(i, c)| !z[*i].is_finite() || !c.spec.symbol.has_either_sign() && z[*i] <= 0.0)
            .map(|(i, _)| i)
            .filter(|i| !held.contains(i))
            .collect();
        if impossible.is_empty() {
            let missing = motion.missing_scale(&exact, &z);
            let drives: Vec<Drive> = (0..layout.joints()).map(|joint| Drive::of(robot, model, joint)).collect();
            let scaled = motion.is_scaled(&exact, &z);
            if !drives.iter().zip(scaled).all(|(drive, scaled)| scaled || matches!(drive, Drive::Known(_))) {
                return None;
            }
            // A rigid robot's coordinates are its parameters.
            let left = missing.into_iter().zip(&drives);
            let left: Vec<f64> = left.map(|(torque, drive)| torque / drive.per_input(&z)).collect();
            // Beside what is held at an impossible place the others have no errors that could be compared.
            let told = |value: f64| if value.is_finite() && held.is_empty() { value } else { 0.0 };
            let covariance = covariance.map(told);
            let corner_hz = motion.corner() / series.median_period_s();
            tracing::debug!(corner_hz, ?z, ?left, "start from torques");
            return Some(TorqueStart { z, covariance, corner_hz, left });
        }
        held.extend(impossible);
    }
}

/// Positions and inputs of one run, with what no sensor read filled in along a line.
fn readings(model: &Model, series: &Series, run: std::ops::Range<usize>) -> Option<Readings> {
    let joints = model.layout().joints();
    let start = model.coordinates().start();
    let positions = (0..joints).map(|joint| {
        let reads = |kind: ChannelKind| series.channels.iter().position(|channel| channel.kind == kind);
        let values = |channel: usize| run.clone().map(move |k| series.measured(k)[channel]);
        let link = || {
            let channel = reads(ChannelKind::LinkPosition { joint })?;
            Some(values(channel).map(|reading| model.link_position(joint, reading, &start)).collect())
        };
        let motor = reads(ChannelKind::MotorPosition { joint }).map(|channel| values(channel).collect::<Vec<f64>>());
        filled(motor.or_else(link)?)
    });
    let mut time_s = 0.0;
    let times = run.clone().map(|k| {
        let now = time_s;
        let step_s = series.duration_s(k);
        time_s += if step_s.is_nan() { 0.0 } else { step_s };
        now
    });
    Some(Readings {
        positions: positions.collect::<Option<_>>()?,
        inputs: (0..joints).map(|joint| run.clone().map(|k| series.input(k)[joint]).collect()).collect(),
        time_s: times.collect(),
    })
}

/// A column whose holes are bridged by lines; none where nothing was read.
fn filled(mut column: Vec<f64>) -> Option<Vec<f64>> {
    let first = column.iter().position(|value| value.is_finite())?;
    let (mut last, value) = (first, column[first]);
    column[..first].fill(value);
    for k in first + 1..column.len() {
        if !column[k].is_finite() {
            continue;
        }
        let (from, to) = (column[last], column[k]);
        for hole in last + 1..k {
            column[hole] = from + (to - from) * (hole - last) as f64 / (k - last) as f64;
        }
        last = k;
    }
    let value = column[last];
    column[last + 1..].fill(value);
    Some(column)
}

#[cfg(test)]
mod tests {
    use super::filled;

    #[test]
    fn holes_are_bridged_by_lines() {
        let nan = f64::NAN;
        assert_eq!(filled(vec![nan, 1.0, nan, nan, 4.0, nan]), Some(vec![1.0, 1.0, 2.0, 3.0, 4.0, 4.0]));
        assert_eq!(filled(vec![nan, nan]), None);
    }
}
