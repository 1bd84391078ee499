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
    /// One axis of a gyro on a base at rest.
    BodyRate {
        frame: &'a SensorFrame,
        body: usize,
        /// Row of R.
        sensor_axis: [f64; 3],
        late: Late<'a>,
        /// Border columns.
        bias: usize,
        rotation: usize,
        by_rotation: [f64; 3],
    },
    /// Anything else that depends on what sensors see, written out: (state component, slope) and (border column, slope).
    Listed { states: &'a [(usize, f64)], border: &'a [(usize, f64)] },
    /// Anything at all.
    Free { states: &'a [(usize, f64)], late: Late<'a>, border: &'a [(usize, f64)] },
}

/// By how much a gyro's reading is later than its stage.
#[derive(Clone, Copy)]
pub(crate) struct Late<'a> {
    pub offset_s: f64,
    /// The column of the gyro's lag, if that is estimated.
    pub lag: Option<usize>,
    /// The dynamics at the stage, and halfway to the reading.
    pub start: &'a Linear,
    pub halfway: &'a Linear,
}

impl Late<'_> {
    fn is_late(&self) -> bool {
        self.offset_s != 0.0 || self.lag.is_some()
    }
}

impl Row<'_> {
    /// Which kind of row [`push`](Self::push) makes: 0 unit, 1 sensor, 2 other.
    pub(crate) fn kind(&self) -> usize {
        match self.depends {
            Depends::Component { offset_s: 0.0, .. } => 0,
            Depends::BodyRate { late, .. } if !late.is_late() => 1,
            Depends::Listed { .. } => 1,
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
            Depends::BodyRate { frame, body, sensor_axis, late, bias, rotation, by_rotation } => {
                let mut row = if late.is_late() { stage.row(residual) } else { stage.sensor_row(residual) };
                let slope = |column| frame.slope(body, column).dot(&Vector3::from(sensor_axis));
                if late.is_late() {
                    let states = (0..2 * joints).map(|column| (column, weight * slope(column)));
                    Self::add_at(states, late, size, &mut row);
                } else {
                    for column in 0..2 * joints {
                        let slope = slope(column);
                        if slope != 0.0 {
                            row.add_state(column, weight * slope);
                        }
                    }
                }
                row.add_shared(bias, weight);
                for (axis, slope) in by_rotation.into_iter().enumerate() {
                    row.add_shared(rotation + axis, weight * slope);
                }
            }
            Depends::Free { states, late, border } => {
                let mut row = stage.row(residual);
                Self::add_at(
                    states.iter().map(|(component, slope)| (*component, weight * slope)),
                    late,
                    size,
                    &mut row,
                );
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

    /// Σ slope · δ(component of x + h f(x + h/2 f(x))), h the time from the stage to the reading; and by the lag, which takes from h.
    fn add_at(states: impl Iterator<Item = (usize, f64)>, late: Late<'_>, size: usize, row: &mut solve::Row<'_>) {
        let Late { offset_s, lag, start, halfway } = late;
        if !late.is_late() {
            states.for_each(|(component, slope)| row.add_state(component, slope));
            return;
        }
        let columns = start.slopes.len() / size;
        let times = |slopes: &[f64], linear: &Linear, to: &mut [f64]| {
            for (slope, by) in slopes.iter().zip(linear.slopes.chunks_exact(columns)) {
                if *slope != 0.0 {
                    to.iter_mut().zip(by).for_each(|(to, by)| *to += slope * by);
                }
            }
        };
        let mut scratch = vec![0.0; size + 2 * columns];
        let (slopes, rest) = scratch.split_at_mut(size);
        let (first, second) = rest.split_at_mut(columns);
        states.for_each(|(component, slope)| slopes[component] += slope);
        times(slopes, halfway, first);
        times(&first[..size], start, second);
        let by = |column: usize| offset_s * (first[column] + 0.5 * offset_s * second[column]);
        for (component, slope) in slopes.iter().enumerate() {
            row.add_state(component, slope + by(component));
        }
        for column in size..columns {
            row.add_shared(column - size, by(column));
        }
        if let Some(lag) = lag {
            let along = |slopes: &[f64], linear: &Linear| -> f64 {
                slopes.iter().zip(&linear.xdot).map(|(slope, rate)| slope * rate).sum()
            };
            row.add_shared(lag, -along(slopes, halfway) - 0.5 * offset_s * along(&first[..size], start));
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
