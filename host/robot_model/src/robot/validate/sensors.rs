//! Sensors, and the parameters that gyros bring.

use protocol::description::GyroPart;

use super::super::file::{PartName, SensorKind, SensorTable, StartOrFixed};
use super::super::{Encoder, Gyro, Joint, JointKind, Parameter, ParameterSpec, RobotError, Sensor, Symbol, Tachometer};
use super::checks::{by_kind, by_kind_with, finite, positive, rotation, within};
use super::{Checked, start_or_fixed};

pub(super) fn gyro_parameters(sensors: &[Sensor]) -> Vec<ParameterSpec> {
    let gyros = || {
        sensors.iter().filter_map(|sensor| match sensor {
            Sensor::Gyro(gyro) => Some(gyro),
            _ => None,
        })
    };
    let spec = |symbol: Symbol, gyro: usize, axis: usize, value: Parameter| ParameterSpec {
        name: format!("{}{}[{}]", symbol.name(), gyro + 1, ["x", "y", "z"][axis]),
        symbol,
        joints: Vec::new(),
        unit: symbol.unit(JointKind::Revolute),
        value,
    };
    let mut specs = Vec::new();
    for (gyro, g) in gyros().enumerate() {
        for axis in 0..3 {
            let value =
                Parameter { start: g.bias_rad_s[axis], free: g.bias_free, simulated: g.bias_simulated_rad_s[axis] };
            specs.push(spec(Symbol::Bias { gyro, axis }, gyro, axis, value));
        }
    }
    for (gyro, g) in gyros().enumerate() {
        for axis in 0..3 {
            let value = Parameter { start: 0.0, free: g.rotation_free, simulated: 0.0 };
            specs.push(spec(Symbol::Misalignment { gyro, axis }, gyro, axis, value));
        }
    }
    specs
}

/// The lags of gyros that have one.
pub(super) fn lag_parameters(sensors: &[Sensor]) -> Vec<ParameterSpec> {
    let gyros = sensors.iter().filter_map(|sensor| match sensor {
        Sensor::Gyro(gyro) => Some(gyro),
        _ => None,
    });
    let lags = gyros.enumerate().filter_map(|(gyro, sensor)| {
        let symbol = Symbol::Lag { gyro };
        let unit = symbol.unit(JointKind::Revolute);
        let name = format!("{}{}", symbol.name(), gyro + 1);
        Some(ParameterSpec { name, symbol, joints: vec![sensor.body], unit, value: sensor.lag_s? })
    });
    lags.collect()
}

/// Zeros and scale errors of link encoders that do not count as their motor's does.
pub(super) fn encoder_parameters(sensors: &[Sensor], joints: &[Joint]) -> Vec<ParameterSpec> {
    let of = |symbol: Symbol| {
        let mut specs: Vec<ParameterSpec> = sensors
            .iter()
            .filter_map(|sensor| {
                let Sensor::LinkEncoder(encoder) = sensor else { return None };
                let value = if symbol == Symbol::Zero { encoder.zero? } else { encoder.scale_error? };
                Some(ParameterSpec {
                    name: format!("{}[{}]", symbol.name(), encoder.joint + 1),
                    symbol,
                    joints: vec![encoder.joint],
                    unit: symbol.unit(joints[encoder.joint].kind),
                    value,
                })
            })
            .collect();
        specs.sort_by_key(|spec| spec.joints.clone());
        specs
    };
    [of(Symbol::Zero), of(Symbol::ScaleError)].concat()
}

pub(super) fn sensor(at: &str, table: &SensorTable, joints: &[Joint], period_s: f64) -> Checked<Sensor> {
    let Some(joint) = joints.iter().position(|joint| joint.name == table.joint) else {
        let known = joints.iter().map(|joint| joint.name.as_str()).collect::<Vec<_>>().join(", ");
        return Err(RobotError::invalid(
            format!("{at}.joint"),
            &table.joint,
            format!("no such joint; there are {known}"),
        ));
    };
    let kind = joints[joint].kind;
    let period_us = period_s * 1e6;
    within(&format!("{at}.offset_us"), table.offset_us, 0.0, period_us, "the sensor is read within the tick")?;
    let offset_s = table.offset_us * 1e-6;
    let allowed: &[&str] = match table.kind {
        SensorKind::MotorEncoder => &["counts_per_turn", "sigma_rad", "sigma_m"],
        SensorKind::LinkEncoder => &["counts_per_turn", "sigma_rad", "sigma_m", "zero_rad", "zero_m", "scale_error"],
        SensorKind::Tachometer => &["side", "sigma_rad_s", "sigma_m_s"],
        SensorKind::Gyro => &["rotation", "bias_rad_s", "sigma_rad_s", "range_rad_s", "part", "lag_s"],
    };
    if let Some(stray) = given_fields(table).find(|field| !allowed.contains(field)) {
        let advice = format!("a {} has no such field; it takes {}", table.kind.name(), allowed.join(", "));
        return Err(RobotError::invalid(format!("{at}.{stray}"), "given", advice));
    }
    let noise = "give the standard deviation of one reading";
    match table.kind {
        SensorKind::MotorEncoder | SensorKind::LinkEncoder => {
            let sigma = by_kind(kind, table.sigma_rad, table.sigma_m, &format!("{at}.sigma"), noise)?;
            positive(&format!("{at}.sigma"), sigma, noise)?;
            if table.counts_per_turn == Some(0) {
                return Err(RobotError::invalid(format!("{at}.counts_per_turn"), 0, "count all four edges of a turn"));
            }
            if table.kind == SensorKind::LinkEncoder && kind == JointKind::Prismatic && table.counts_per_turn.is_some()
            {
                let advice = "a sliding link makes no turns; leave it out";
                return Err(RobotError::invalid(format!("{at}.counts_per_turn"), "given", advice));
            }
            let (zero, scale_error) = (zero(at, table, kind)?, scale_error(at, table)?);
            let encoder = Encoder { joint, counts_per_turn: table.counts_per_turn, sigma, zero, scale_error, offset_s };
            Ok(if table.kind == SensorKind::MotorEncoder {
                Sensor::MotorEncoder(encoder)
            } else {
                Sensor::LinkEncoder(encoder)
            })
        }
        SensorKind::Tachometer => {
            let fields = ((table.sigma_rad_s, "sigma_rad_s"), (table.sigma_m_s, "sigma_m_s"));
            let sigma = by_kind_with(kind, fields.0, fields.1, at, noise)?;
            positive(&format!("{at}.sigma"), sigma, noise)?;
            let Some(side) = table.side else {
                let advice = "say whose speed it measures: \"motor\" or \"link\"";
                return Err(RobotError::invalid(format!("{at}.side"), "missing", advice));
            };
            Ok(Sensor::Tachometer(Tachometer { joint, side, sigma, offset_s }))
        }
        SensorKind::Gyro => gyro(at, table, joint, offset_s),
    }
}

fn zero(at: &str, table: &SensorTable, kind: JointKind) -> Checked<Option<Parameter>> {
    if table.zero_rad.is_none() && table.zero_m.is_none() {
        return Ok(None);
    }
    let advice = "give `{ start = 0.0 }` to estimate it or `{ fixed = … }` if known";
    let given = by_kind(kind, table.zero_rad, table.zero_m, &format!("{at}.zero"), advice)?;
    let (start, free) = start_or_fixed(&format!("{at}.zero"), given)?;
    let simulated = given.simulated.unwrap_or(start);
    finite(&format!("{at}.zero"), &[start, simulated])?;
    Ok(Some(Parameter { start, free, simulated }))
}

/// A tenth is another unit or another gear, not an error.
const MOST_SCALE_ERROR: f64 = 0.1;

fn scale_error(at: &str, table: &SensorTable) -> Checked<Option<Parameter>> {
    let advice = "give the share by which it tells too much; more is another unit";
    bounded(&format!("{at}.scale_error"), table.scale_error, MOST_SCALE_ERROR, advice)
}

/// A filter of 10 Hz has 23 ms.
const MOST_LAG_S: f64 = 0.05;

fn lag(at: &str, table: &SensorTable) -> Checked<Option<Parameter>> {
    let advice = "give it in seconds; a gyro that is later shows no joint's dynamics";
    bounded(&format!("{at}.lag_s"), table.lag_s, MOST_LAG_S, advice)
}

/// A parameter of a sensor that is `most` at most, either way.
fn bounded(field: &str, given: Option<StartOrFixed<f64>>, most: f64, advice: &str) -> Checked<Option<Parameter>> {
    let Some(given) = given else { return Ok(None) };
    let (start, free) = start_or_fixed(field, given)?;
    let simulated = given.simulated.unwrap_or(start);
    for value in [start, simulated] {
        within(field, value, -most, most, advice)?;
    }
    Ok(Some(Parameter { start, free, simulated }))
}

fn gyro(at: &str, table: &SensorTable, body: usize, offset_s: f64) -> Checked<Sensor> {
    let missing = |field: &str, advice: &str| RobotError::invalid(format!("{at}.{field}"), "missing", advice);
    let given = table.rotation.ok_or_else(|| {
        missing("rotation", "give `{ start = [[…], […], […]] }`, the nominal rotation from body to sensor axes")
    })?;
    let (nominal, rotation_free) = start_or_fixed(&format!("{at}.rotation"), given)?;
    if given.simulated.is_some() {
        let advice = "a simulated sensor is mounted within a few degrees of its nominal rotation; leave it out";
        return Err(RobotError::invalid(format!("{at}.rotation.simulated"), "given", advice));
    }
    let given = table
        .bias_rad_s
        .ok_or_else(|| missing("bias_rad_s", "give `{ start = [0.0, 0.0, 0.0] }` if nothing is known"))?;
    let (bias_rad_s, bias_free) = start_or_fixed(&format!("{at}.bias_rad_s"), given)?;
    finite(&format!("{at}.bias_rad_s"), &bias_rad_s)?;
    let bias_simulated_rad_s = given.simulated.unwrap_or(bias_rad_s);
    finite(&format!("{at}.bias_rad_s.simulated"), &bias_simulated_rad_s)?;
    let noise = "give the standard deviation of one reading in rad/s";
    let sigma_rad_s = table.sigma_rad_s.ok_or_else(|| missing("sigma_rad_s", noise))?;
    positive(&format!("{at}.sigma_rad_s"), sigma_rad_s, noise)?;
    if let Some(range) = table.range_rad_s {
        positive(&format!("{at}.range_rad_s"), range, "give the full scale in rad/s")?;
    }
    Ok(Sensor::Gyro(Gyro {
        body,
        rotation: rotation(&format!("{at}.rotation"), nominal)?,
        rotation_free,
        bias_rad_s,
        bias_free,
        bias_simulated_rad_s,
        sigma_rad_s,
        range_rad_s: table.range_rad_s,
        part: table.part.map(|part| match part {
            PartName::Icm42688p => GyroPart::Icm42688p,
            PartName::Bmi323 => GyroPart::Bmi323,
        }),
        lag_s: lag(at, table)?,
        offset_s,
    }))
}

fn given_fields(table: &SensorTable) -> impl Iterator<Item = &'static str> {
    [
        (table.counts_per_turn.is_some(), "counts_per_turn"),
        (table.sigma_rad.is_some(), "sigma_rad"),
        (table.sigma_m.is_some(), "sigma_m"),
        (table.zero_rad.is_some(), "zero_rad"),
        (table.zero_m.is_some(), "zero_m"),
        (table.scale_error.is_some(), "scale_error"),
        (table.sigma_rad_s.is_some(), "sigma_rad_s"),
        (table.sigma_m_s.is_some(), "sigma_m_s"),
        (table.side.is_some(), "side"),
        (table.rotation.is_some(), "rotation"),
        (table.bias_rad_s.is_some(), "bias_rad_s"),
        (table.range_rad_s.is_some(), "range_rad_s"),
        (table.part.is_some(), "part"),
        (table.lag_s.is_some(), "lag_s"),
    ]
    .into_iter()
    .filter_map(|(given, field)| given.then_some(field))
}

pub(super) fn same_place(a: &Sensor, b: &Sensor) -> bool {
    match (a, b) {
        (Sensor::MotorEncoder(a), Sensor::MotorEncoder(b)) | (Sensor::LinkEncoder(a), Sensor::LinkEncoder(b)) => {
            a.joint == b.joint
        }
        (Sensor::Tachometer(a), Sensor::Tachometer(b)) => a.joint == b.joint && a.side == b.side,
        // A body may carry several gyros.
        _ => false,
    }
}
