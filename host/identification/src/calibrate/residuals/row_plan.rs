//! Which rows the channels of a recording make: one of a channel that reads a component of the state, three of a gyro.

use super::preset::GyroRows;
use crate::calibrate::data::series::Series;
use crate::model::Model;
use crate::robot::{ChannelKind, Side};

/// The channels by kind: what makes one or three rows.
#[derive(Debug, Clone, Default)]
pub(crate) struct RowPlan {
    /// Channel, state component that it reads, and that component's derivative.
    pub scalars: Vec<ScalarRow>,
    pub gyros: Vec<GyroRow>,
}

/// A channel that reads one state component.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ScalarRow {
    pub channel: usize,
    pub component: usize,
    pub offset_s: f64,
    pub weight: f64,
    /// Joint and side of a position.
    pub position: Option<(usize, Side)>,
    /// The reading is that of so many samples later.
    pub shift: i32,
}

/// A gyro: three channels.
#[derive(Debug, Clone, Copy)]
pub(crate) struct GyroRow {
    /// First of its three channels.
    pub channel: usize,
    pub gyro: usize,
    pub body: usize,
    pub offset_s: f64,
    /// Of each axis.
    pub weight: [f64; 3],
}

impl RowPlan {
    /// The paper takes all readings at the tick itself.
    pub(crate) fn of(series: &Series, model: &Model, gyro_rows: GyroRows) -> Self {
        let layout = model.layout();
        let mut plan = RowPlan::default();
        for (channel, spec) in series.channels.iter().enumerate() {
            let offset_s = if gyro_rows == GyroRows::Chained { 0.0 } else { spec.offset_s };
            let weight = 1.0 / spec.sigma;
            let (component, position) = match spec.kind {
                ChannelKind::MotorPosition { joint } => (layout.theta(joint), Some((joint, Side::Motor))),
                ChannelKind::LinkPosition { joint } => (layout.q(joint), Some((joint, Side::Link))),
                ChannelKind::MotorSpeed { joint } => (layout.thetad(joint), None),
                ChannelKind::LinkSpeed { joint } => (layout.qd(joint), None),
                ChannelKind::GyroAxis { gyro, body, axis } => {
                    if axis == 0 {
                        plan.gyros.push(GyroRow {
                            channel,
                            gyro,
                            body: model.body(body),
                            offset_s,
                            weight: [weight; 3],
                        });
                    }
                    continue;
                }
            };
            plan.scalars.push(ScalarRow { channel, component, offset_s, weight, position, shift: 0 });
        }
        plan
    }
}
