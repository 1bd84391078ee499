//! The description file as it is written: one struct per table, nothing checked but names and types.
//!
//! [`super::validate`] turns it into a [`Robot`](super::Robot). Fields whose unit depends on the kind of joint come in
//! two spellings (`limits_rad`, `limits_m`), of which the right one must be given.

use std::collections::BTreeMap;

use serde::Deserialize;

use super::{Friction, GravityLoad, InputUnit, JointKind, Side, Transmission, Unmodelled};

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RobotFile {
    pub name: String,
    #[serde(default)]
    pub description: String,
    pub sample_period_s: f64,
    pub coriolis: bool,
    pub gravity_m_s2: [f64; 3],
    pub input: InputTable,
    #[serde(default)]
    pub parameters: ParameterTable,
    pub joint: Vec<JointTable>,
    #[serde(default)]
    pub sensor: Vec<SensorTable>,
    pub import: Option<ImportTable>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct InputTable {
    pub unit: InputUnit,
    pub supply_v: Option<f64>,
    pub sigma: Option<f64>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct JointTable {
    pub name: String,
    pub kind: JointKind,
    pub axis: [f64; 3],
    #[serde(default)]
    pub origin_m: [f64; 3],
    pub rotation: Option<[[f64; 3]; 3]>,
    pub limits_rad: Option<[f64; 2]>,
    pub limits_m: Option<[f64; 2]>,
    pub gravity: GravityLoad,
    pub transmission: Transmission,
    pub friction: FrictionTable,
    pub gear: f64,
    pub unmodelled_rad_s2: Option<Unmodelled>,
    pub unmodelled_m_s2: Option<Unmodelled>,
    pub body: BodyTable,
    #[serde(default)]
    pub parameters: ParameterTable,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FrictionTable {
    pub law: FrictionLaw,
    pub speed: Option<Side>,
    pub acts: Option<Side>,
    pub slope_s_rad: Option<f64>,
    pub slope_s_m: Option<f64>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum FrictionLaw {
    None,
    Coulomb,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct BodyTable {
    pub mass_kg: f64,
    pub centre_m: [f64; 3],
    pub inertia_kg_m2: InertiaTable,
}

/// Elements of the inertia tensor about the body's centre (xy is the element, −∫xy dm).
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct InertiaTable {
    pub xx: f64,
    pub yy: f64,
    pub zz: f64,
    #[serde(default)]
    pub xy: f64,
    #[serde(default)]
    pub xz: f64,
    #[serde(default)]
    pub yz: f64,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ParameterTable {
    pub k_pwm: Option<StartOrFixed<f64>>,
    pub k_t: Option<StartOrFixed<f64>>,
    pub k_mi: Option<StartOrFixed<f64>>,
    pub b: Option<StartOrFixed<f64>>,
    pub mu: Option<StartOrFixed<f64>>,
    pub k_s: Option<StartOrFixed<f64>>,
    pub d_s: Option<StartOrFixed<f64>>,
    pub v: Option<StartOrFixed<f64>>,
    pub o: Option<StartOrFixed<f64>>,
    #[serde(rename = "J")]
    pub j: Option<StartOrFixed<f64>>,
    pub mx: Option<StartOrFixed<f64>>,
    pub my: Option<StartOrFixed<f64>>,
    pub mz: Option<StartOrFixed<f64>>,
}

/// `{ start = … }` is estimated from there, `{ fixed = … }` is known; `simulated` is what a simulated robot has instead.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct StartOrFixed<V> {
    pub start: Option<V>,
    pub fixed: Option<V>,
    pub simulated: Option<V>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SensorTable {
    pub kind: SensorKind,
    pub joint: String,
    #[serde(default)]
    pub offset_us: f64,
    pub counts_per_turn: Option<u32>,
    pub sigma_rad: Option<f64>,
    pub sigma_m: Option<f64>,
    pub zero_rad: Option<StartOrFixed<f64>>,
    pub zero_m: Option<StartOrFixed<f64>>,
    pub scale_error: Option<StartOrFixed<f64>>,
    pub sigma_rad_s: Option<f64>,
    pub sigma_m_s: Option<f64>,
    pub side: Option<Side>,
    pub rotation: Option<StartOrFixed<[[f64; 3]; 3]>>,
    pub bias_rad_s: Option<StartOrFixed<[f64; 3]>>,
    pub range_rad_s: Option<f64>,
    pub part: Option<PartName>,
    pub lag_s: Option<StartOrFixed<f64>>,
}

/// A gyro that the firmware has a driver for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum PartName {
    Icm42688p,
    Bmi323,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum SensorKind {
    MotorEncoder,
    LinkEncoder,
    Tachometer,
    Gyro,
}

impl SensorKind {
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::MotorEncoder => "motor_encoder",
            Self::LinkEncoder => "link_encoder",
            Self::Tachometer => "tachometer",
            Self::Gyro => "gyro",
        }
    }
}

// Keeps the file's friction next to the type it becomes.
impl FrictionTable {
    pub(super) fn with_slope(&self, slope_s: f64) -> Friction {
        let acts = self.acts.unwrap_or(Side::Motor);
        Friction::Coulomb { speed: self.speed.unwrap_or(acts), acts, slope_s }
    }
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ImportTable {
    pub time: Option<ImportTimeTable>,
    pub separator: Option<String>,
    pub decimal: Option<String>,
    #[serde(default)]
    pub missing: Vec<String>,
    pub torque_on: Option<String>,
    /// By the recording's names: `u1`, `theta1`, `g1x`.
    #[serde(default)]
    pub columns: BTreeMap<String, ImportColumnTable>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ImportTimeTable {
    pub column: String,
    pub unit: String,
    pub zero: Option<f64>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ImportColumnTable {
    pub column: Option<String>,
    pub unit: Option<String>,
    pub scale: Option<f64>,
    pub sign: Option<i64>,
    pub zero: Option<f64>,
    pub side: Option<Side>,
    pub counts_per_turn: Option<f64>,
}
