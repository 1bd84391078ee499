//! How the columns of other people's tables become a recording: names, units, signs, gears.
//!
//! ```text
//!   value of the recording = sign · scale · unit · gear · (number in the table − zero)
//! ```
//!
//! `gear` is 1 where the table tells the link side; told at the motor, positions and speeds are divided by the joint's
//! gear, torques and forces multiplied by it.

use super::{ChannelKind, InputUnit, JointKind};

/// The section `[import]` of a description file.
#[derive(Debug, Clone, PartialEq)]
pub struct Import {
    /// Where time stands; `None` for a column `t_us` or `t_s`.
    pub time: Option<ImportTime>,
    /// What separates columns.
    pub separator: char,
    /// What separates whole numbers from fractions.
    pub decimal: char,
    /// Fields that mean "no valid reading", beside the empty one.
    pub missing: Vec<String>,
    /// The column that is 0 where the drives are switched off: their circuit is open, and they give no torque.
    pub torque_on: Option<String>,
    /// One entry for every column of the recording, in its order: `u1…`, then the robot's channels.
    pub columns: Vec<ImportColumn>,
}

/// The column of the table with the time.
#[derive(Debug, Clone, PartialEq)]
pub struct ImportTime {
    /// Its name.
    pub column: String,
    /// Its unit.
    pub unit: TimeUnit,
    /// Time in the table that becomes 0.
    pub zero: f64,
}

/// Units of time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TimeUnit {
    /// s.
    Seconds,
    /// ms.
    Milliseconds,
    /// µs.
    Microseconds,
    /// ns.
    Nanoseconds,
}

impl TimeUnit {
    /// All of them, the longest first.
    pub const ALL: [Self; 4] = [Self::Seconds, Self::Milliseconds, Self::Microseconds, Self::Nanoseconds];

    /// Name in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Seconds => "s",
            Self::Milliseconds => "ms",
            Self::Microseconds => "us",
            Self::Nanoseconds => "ns",
        }
    }

    /// Name for people.
    pub const fn words(self) -> &'static str {
        match self {
            Self::Seconds => "seconds",
            Self::Milliseconds => "milliseconds",
            Self::Microseconds => "microseconds",
            Self::Nanoseconds => "nanoseconds",
        }
    }

    /// One of it, µs.
    pub const fn us(self) -> f64 {
        match self {
            Self::Seconds => 1e6,
            Self::Milliseconds => 1e3,
            Self::Microseconds => 1.0,
            Self::Nanoseconds => 1e-3,
        }
    }
}

/// Where one column of the recording comes from.
#[derive(Debug, Clone, PartialEq)]
pub struct ImportColumn {
    /// Name in the recording: `u1`, `theta1`, `g1x`.
    pub name: String,
    /// Name in the table.
    pub column: String,
    /// Number in the table that becomes 0.
    pub zero: f64,
    /// What one of the table is in the recording: sign, scale, unit and gear together.
    pub factor: f64,
}

/// What a unit measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Dimension {
    Angle,
    AngularRate,
    Length,
    Speed,
    Torque,
    Force,
    Voltage,
    Current,
    Share,
}

/// A named unit: what it measures, and one of it in SI.
pub(super) struct Unit {
    pub name: &'static str,
    pub dimension: Dimension,
    pub si: f64,
}

const fn unit(name: &'static str, dimension: Dimension, si: f64) -> Unit {
    Unit { name, dimension, si }
}

const TURN: f64 = std::f64::consts::TAU;

/// The units by their names without spaces; the first of a dimension is that of the recording. A count is a turn by
/// the encoder's counts.
pub(super) const UNITS: [Unit; 33] = [
    unit("rad", Dimension::Angle, 1.0),
    unit("mrad", Dimension::Angle, 1e-3),
    unit("deg", Dimension::Angle, TURN / 360.0),
    unit("turn", Dimension::Angle, TURN),
    unit(COUNTS, Dimension::Angle, TURN),
    unit("rad/s", Dimension::AngularRate, 1.0),
    unit("mrad/s", Dimension::AngularRate, 1e-3),
    unit("deg/s", Dimension::AngularRate, TURN / 360.0),
    unit("mdeg/s", Dimension::AngularRate, TURN / 360e3),
    unit("rpm", Dimension::AngularRate, TURN / 60.0),
    unit("turn/s", Dimension::AngularRate, TURN),
    unit(COUNTS_PER_SECOND, Dimension::AngularRate, TURN),
    unit("m", Dimension::Length, 1.0),
    unit("mm", Dimension::Length, 1e-3),
    unit("um", Dimension::Length, 1e-6),
    unit("m/s", Dimension::Speed, 1.0),
    unit("mm/s", Dimension::Speed, 1e-3),
    unit("Nm", Dimension::Torque, 1.0),
    unit("mNm", Dimension::Torque, 1e-3),
    unit("Nmm", Dimension::Torque, 1e-3),
    unit("Ncm", Dimension::Torque, 1e-2),
    unit("kNm", Dimension::Torque, 1e3),
    unit("N", Dimension::Force, 1.0),
    unit("mN", Dimension::Force, 1e-3),
    unit("kN", Dimension::Force, 1e3),
    unit("V", Dimension::Voltage, 1.0),
    unit("mV", Dimension::Voltage, 1e-3),
    unit("A", Dimension::Current, 1.0),
    unit("mA", Dimension::Current, 1e-3),
    unit("duty", Dimension::Share, 1.0),
    unit("percent", Dimension::Share, 1e-2),
    unit("%", Dimension::Share, 1e-2),
    unit("permille", Dimension::Share, 1e-3),
];

pub(super) const COUNTS: &str = "counts";
pub(super) const COUNTS_PER_SECOND: &str = "counts/s";

impl Dimension {
    /// What the input of a joint measures.
    pub(super) fn of_input(unit: InputUnit) -> Self {
        match unit {
            InputUnit::Duty => Self::Share,
            InputUnit::Volt => Self::Voltage,
            InputUnit::Ampere => Self::Current,
            InputUnit::NewtonMetre => Self::Torque,
            InputUnit::Newton => Self::Force,
        }
    }

    /// What a channel of a joint of this kind measures.
    pub(super) fn of_channel(kind: ChannelKind, joint: JointKind) -> Self {
        match (kind, joint) {
            (ChannelKind::GyroAxis { .. }, _) => Self::AngularRate,
            (ChannelKind::MotorPosition { .. } | ChannelKind::LinkPosition { .. }, JointKind::Revolute) => Self::Angle,
            (ChannelKind::MotorPosition { .. } | ChannelKind::LinkPosition { .. }, JointKind::Prismatic) => {
                Self::Length
            }
            (ChannelKind::MotorSpeed { .. } | ChannelKind::LinkSpeed { .. }, JointKind::Revolute) => Self::AngularRate,
            (ChannelKind::MotorSpeed { .. } | ChannelKind::LinkSpeed { .. }, JointKind::Prismatic) => Self::Speed,
        }
    }

    /// The same before the gear, where a motor turns whatever its joint does; `None` for what no gear changes.
    pub(super) fn at_motor(self) -> Option<Self> {
        match self {
            Self::Angle | Self::Length => Some(Self::Angle),
            Self::AngularRate | Self::Speed => Some(Self::AngularRate),
            Self::Torque | Self::Force => Some(Self::Torque),
            Self::Voltage | Self::Current | Self::Share => None,
        }
    }

    /// Names of its units.
    pub(super) fn units(self) -> String {
        let names = UNITS.iter().filter(|unit| unit.dimension == self).map(|unit| unit.name);
        names.collect::<Vec<_>>().join(", ")
    }

    /// Whether a gear multiplies it on its way to the link.
    pub(super) fn is_effort(self) -> bool {
        matches!(self, Self::Torque | Self::Force)
    }
}
