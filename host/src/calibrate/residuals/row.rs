//! One row of the problem before it goes into a stage: its residual, weight, and what it depends on.

use nalgebra::Vector3;

use crate::model::{Linear, SensorFrame};
use solve::Stage;

/// A whitened row of (30).
pub(crate) struct InitialRow {
    pub residual: f64,
    pub gradient: [(usize, f64); 2],
}

/// A sensor row before weighting.
pub(crate) struct Row<'a> {
    /// The channel it predicts, if it predicts one.
    pub channel: Option<usize>,
    /// Predicted − measured, in the channel's unit.
    pub residual: f64,
    /// 1/σ.
    pub weight: f64,
    /// Where its derivatives are.
    pub depends: Depends<'a>,
    /// Derivatives of ẋ at the stage, for rows that are read late.
    pub linear: &'a Linear,
}

/// What a sensor row depends on.
pub(crate) enum Depends<'a> {
    /// One state component, `offset_s` later.
    Component { component: usize, offset_s: f64 },
    /// One axis of a gyro on a base at rest, `offset_s` later.
    BodyRate {
        frame: &'a SensorFrame,
        body: usize,
        /// Row of R.
        sensor_axis: [f64; 3],
        offset_s: f64,
        /// Border columns.
        bias: usize,
        rotation: usize,
        by_rotation: [f64; 3],
    },
    /// Anything else that depends on what sensors see, written out: (state component, slope) and (border column, slope).
    Listed { states: &'a [(usize, f64)], border: &'a [(usize, f64)] },
    /// Anything at all, `offset_s` later.
    Free { states: &'a [(usize, f64)], offset_s: f64, border: &'a [(usize, f64)] },
}

impl Row<'_> {
    /// Which kind of row [`push`](Self::push) makes: 0 unit, 1 sensor, 2 other.
    pub(crate) fn kind(&self) -> usize {
        match self.depends {
            Depends::Component { offset_s: 0.0, .. } => 0,
            Depends::BodyRate { offset_s: 0.0, .. } | Depends::Listed { .. } => 1,
            Depends::Component { .. } | Depends::BodyRate { .. } | Depends::Free { .. } => 2,
        }
    }

    /// Adds this row with its weighted derivatives to the stage, by the narrowest kind of row that holds them.
    pub(crate) fn push(&self, size: usize, joints: usize, stage: &mut Stage) {
        let (weight, residual) = (self.weight, self.weight * self.residual);
        match self.depends {
            Depends::Component { component, offset_s: 0.0 } => stage.unit_row(component, weight, residual),
            Depends::Component { component, offset_s } => {
                self.add_later(weight, component, offset_s, size, &mut stage.row(residual));
            }
            Depends::BodyRate { frame, body, sensor_axis, offset_s, bias, rotation, by_rotation } => {
                let mut row = if offset_s == 0.0 { stage.sensor_row(residual) } else { stage.row(residual) };
                for column in 0..2 * joints {
                    let slope = frame.slope(body, column).dot(&Vector3::from(sensor_axis));
                    if slope != 0.0 {
                        self.add_later(weight * slope, column, offset_s, size, &mut row);
                    }
                }
                row.add_shared(bias, weight);
                for (axis, slope) in by_rotation.into_iter().enumerate() {
                    row.add_shared(rotation + axis, weight * slope);
                }
            }
            Depends::Free { states, offset_s, border } => {
                let mut row = stage.row(residual);
                for &(component, slope) in states {
                    self.add_later(weight * slope, component, offset_s, size, &mut row);
                }
                for &(column, slope) in border {
                    row.add_shared(column, weight * slope);
                }
            }
            Depends::Listed { states, border } => {
                let mut row = stage.sensor_row(residual);
                for &(component, slope) in states {
                    row.add_state(component, weight * slope);
                }
                for &(column, slope) in border {
                    row.add_shared(column, weight * slope);
                }
            }
        }
    }

    /// slope · δ(component, `offset_s` later): the component itself and offset times its time derivative.
    fn add_later(&self, slope: f64, component: usize, offset_s: f64, size: usize, row: &mut solve::Row<'_>) {
        row.add_state(component, slope);
        if offset_s != 0.0 {
            let columns = self.linear.slopes.len() / size;
            let derivative = &self.linear.slopes[component * columns..(component + 1) * columns];
            for (i, l) in derivative[..size].iter().enumerate() {
                row.add_state(i, slope * offset_s * l);
            }
            for (j, l) in derivative[size..].iter().enumerate() {
                row.add_shared(j, slope * offset_s * l);
            }
        }
    }
}

impl InitialRow {
    pub(crate) fn push(&self, stage: &mut Stage) {
        let mut row = stage.row(self.residual);
        for (component, slope) in self.gradient {
            row.add_state(component, slope);
        }
    }
}
