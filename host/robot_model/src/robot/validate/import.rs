//! The section `[import]`: names of columns against the robot's, units against what each column measures.

use super::super::file::{ImportColumnTable, ImportTable, ImportTimeTable};
use super::super::import::{COUNTS, COUNTS_PER_SECOND, Dimension, UNITS};
use super::super::{
    ChannelKind, Encoder, Import, ImportColumn, ImportTime, Joint, Robot, RobotError, Sensor, Side, TimeUnit,
};
use super::Checked;

pub(super) fn import(table: &ImportTable, robot: &Robot) -> Checked<Import> {
    let known: Vec<Target<'_>> = targets(robot);
    for name in table.columns.keys() {
        if !known.iter().any(|target| target.name == *name) {
            let names = known.iter().map(|target| target.name.as_str()).collect::<Vec<_>>().join(", ");
            let advice = format!("the robot has no such column; there are {names}");
            return Err(RobotError::invalid("import.columns", name, advice));
        }
    }
    let separator = character("import.separator", table.separator.as_deref(), ',', &[',', ';', '\t', '|'])?;
    let decimal = character("import.decimal", table.decimal.as_deref(), '.', &['.', ','])?;
    if separator == decimal {
        let advice = "columns and decimals cannot both be told by a comma; is the separator \";\"?";
        return Err(RobotError::invalid("import.decimal", format!("{decimal:?}"), advice));
    }
    let columns: Vec<ImportColumn> =
        known.iter().map(|target| column(target, table.columns.get(&target.name))).collect::<Checked<_>>()?;
    let time = table.time.as_ref().map(time).transpose()?;
    for (i, column) in columns.iter().enumerate() {
        let earlier = columns[..i].iter().find(|earlier| earlier.column == column.column);
        let also = earlier.map(|earlier| earlier.name.as_str());
        let also = also.or(time.as_ref().filter(|time| time.column == column.column).map(|_| "the time"));
        if let Some(also) = also {
            let advice = format!("{also} comes from this column already");
            return Err(RobotError::invalid(format!("import.columns.{}", column.name), &column.column, advice));
        }
    }
    let torque_on = table.torque_on.clone();
    if let Some(name) = columns.iter().find(|column| Some(&column.column) == torque_on.as_ref()).map(|c| &c.name) {
        let advice = format!("{name} comes from this column already");
        return Err(RobotError::invalid("import.torque_on", torque_on.unwrap_or_default(), advice));
    }
    Ok(Import { time, separator, decimal, missing: table.missing.clone(), torque_on, columns })
}

fn character(field: &str, given: Option<&str>, default: char, allowed: &[char]) -> Checked<char> {
    let Some(text) = given else { return Ok(default) };
    let mut characters = text.chars();
    match (characters.next(), characters.next()) {
        (Some(one), None) if allowed.contains(&one) => Ok(one),
        _ => Err(RobotError::invalid(field, format!("{text:?}"), format!("must be one of {allowed:?}"))),
    }
}

fn time(table: &ImportTimeTable) -> Checked<ImportTime> {
    let Some(unit) = TimeUnit::ALL.into_iter().find(|unit| unit.name() == table.unit) else {
        return Err(RobotError::invalid("import.time.unit", &table.unit, "must be one of s, ms, us, ns"));
    };
    let zero = number("import.time.zero", table.zero, 0.0)?;
    Ok(ImportTime { column: table.column.clone(), unit, zero })
}

/// A column of the recording that the table must fill.
struct Target<'a> {
    name: String,
    dimension: Dimension,
    /// The joint whose gear may still have to be applied.
    geared: Option<&'a Joint>,
    /// The encoder whose counts may be given.
    encoder: Option<&'a Encoder>,
    /// Whether that encoder sits on the motor.
    on_motor: bool,
}

fn targets(robot: &Robot) -> Vec<Target<'_>> {
    let dimension = Dimension::of_input(robot.input.unit);
    let inputs = robot.joints.iter().enumerate().map(|(j, joint)| Target {
        name: format!("u{}", j + 1),
        dimension,
        geared: dimension.is_effort().then_some(joint),
        encoder: None,
        on_motor: false,
    });
    let channels = robot.channels().into_iter().map(|channel| {
        let joint = match channel.kind {
            ChannelKind::GyroAxis { body, .. } => body,
            ChannelKind::MotorPosition { joint }
            | ChannelKind::LinkPosition { joint }
            | ChannelKind::MotorSpeed { joint }
            | ChannelKind::LinkSpeed { joint } => joint,
        };
        let on_motor = matches!(channel.kind, ChannelKind::MotorPosition { .. } | ChannelKind::MotorSpeed { .. });
        let encoder = robot.sensors.iter().find_map(|sensor| match (sensor, channel.kind) {
            (Sensor::MotorEncoder(encoder), ChannelKind::MotorPosition { joint }) if encoder.joint == joint => {
                Some(encoder)
            }
            (Sensor::LinkEncoder(encoder), ChannelKind::LinkPosition { joint }) if encoder.joint == joint => {
                Some(encoder)
            }
            _ => None,
        });
        Target {
            dimension: Dimension::of_channel(channel.kind, robot.joints[joint].kind),
            name: channel.column,
            geared: on_motor.then_some(&robot.joints[joint]),
            encoder,
            on_motor,
        }
    });
    inputs.chain(channels).collect()
}

fn column(target: &Target<'_>, table: Option<&ImportColumnTable>) -> Checked<ImportColumn> {
    let name = target.name.clone();
    let Some(table) = table else {
        return Ok(ImportColumn { column: name.clone(), name, zero: 0.0, factor: 1.0 });
    };
    let at = format!("import.columns.{name}");
    let unit = table.unit.as_deref().map(|unit| unit.replace(' ', ""));
    let in_counts = matches!(unit.as_deref(), Some(COUNTS | COUNTS_PER_SECOND));
    // Counts are those of what the encoder sits on.
    let side = table.side.unwrap_or(if in_counts && target.on_motor { Side::Motor } else { Side::Link });
    let at_motor = target.dimension.at_motor().zip(target.geared);
    let (dimension, gear) = match (side, at_motor) {
        (Side::Link, _) => (target.dimension, 1.0),
        (Side::Motor, Some((dimension, joint))) if target.dimension.is_effort() => (dimension, joint.gear),
        (Side::Motor, Some((dimension, joint))) => (dimension, 1.0 / joint.gear),
        (Side::Motor, None) => {
            let advice = "no gear lies between this column and what it measures; leave it out";
            return Err(RobotError::invalid(format!("{at}.side"), "motor", advice));
        }
    };
    let si = match &unit {
        None => 1.0,
        Some(unit) => named_unit(&format!("{at}.unit"), unit, dimension)?,
    };
    let counts = match (in_counts, table.counts_per_turn, target.encoder.and_then(|encoder| encoder.counts_per_turn)) {
        (true, Some(counts), _) if counts.is_finite() && counts > 0.0 => counts,
        (true, None, Some(counts)) => f64::from(counts),
        (true, given, _) => {
            let value = given.map_or("missing".to_owned(), |given| given.to_string());
            let advice = "counts need the number of counts per turn (of the motor, for a motor's encoder)";
            return Err(RobotError::invalid(format!("{at}.counts_per_turn"), value, advice));
        }
        (false, Some(given), _) => {
            let advice = "only with unit = \"counts\" or \"counts/s\"";
            return Err(RobotError::invalid(format!("{at}.counts_per_turn"), given, advice));
        }
        (false, None, _) => 1.0,
    };
    let scale = number(&format!("{at}.scale"), table.scale, 1.0)?;
    if scale == 0.0 {
        return Err(RobotError::invalid(format!("{at}.scale"), scale, "every reading would be zero"));
    }
    let sign = match table.sign {
        None | Some(1) => 1.0,
        Some(-1) => -1.0,
        Some(other) => return Err(RobotError::invalid(format!("{at}.sign"), other, "must be 1 or -1")),
    };
    let zero = number(&format!("{at}.zero"), table.zero, 0.0)?;
    let column = table.column.clone().unwrap_or_else(|| name.clone());
    Ok(ImportColumn { name, column, zero, factor: sign * scale * si * gear / counts })
}

/// One of the named unit in SI.
fn named_unit(field: &str, unit: &str, dimension: Dimension) -> Checked<f64> {
    match UNITS.iter().find(|known| known.name == unit) {
        Some(known) if known.dimension == dimension => Ok(known.si),
        Some(_) => {
            let advice = format!("measures something else than this column does; its units are {}", dimension.units());
            Err(RobotError::invalid(field, unit, advice))
        }
        None => {
            let advice = format!(
                "is not a unit that is known; this column's are {}, and `scale` serves for others",
                dimension.units()
            );
            Err(RobotError::invalid(field, unit, advice))
        }
    }
}

fn number(field: &str, given: Option<f64>, default: f64) -> Checked<f64> {
    match given.unwrap_or(default) {
        value if value.is_finite() => Ok(value),
        value => Err(RobotError::invalid(field, value, "must be a finite number")),
    }
}
