//! The description of a robot that was brought up: the file that it began with, and what was found.

use protocol::{Hello, Side};
use toml_edit::{DocumentMut, Item, TableLike, Value, value};

use super::{Findings, GyroFound};
use crate::robot::edit::{each, is, replace, start, vector};
use crate::robot::{Robot, RobotError, Symbol};

/// The text of a description with the device's gears, counts per turn and ranges in the place of what stands there: for a
/// blank file, of which only chain, bodies and limits are known.
///
/// # Errors
/// [`RobotError`] if it is no description.
pub fn filled_in(text: &str, hello: &Hello) -> Result<String, RobotError> {
    let mut file = parsed(text)?;
    let names: Vec<String> = each(&mut file, "joint").map(|joint| name(joint, "name")).collect();
    let encoder = |joint: &str, side: Side| {
        let index = names.iter().position(|name| name == joint)?;
        hello.encoders.iter().find(|encoder| usize::from(encoder.joint) == index && encoder.side == side)
    };
    for joint in each(&mut file, "joint") {
        let Some(info) = encoder(&name(joint, "name"), Side::Motor) else { continue };
        set(joint, "gear", Value::from(info.gear));
    }
    let mut gyros = hello.gyros.iter();
    for sensor in each(&mut file, "sensor") {
        let side = if is(sensor, "kind", "link_encoder") { Side::Link } else { Side::Motor };
        let is_encoder = side == Side::Link || is(sensor, "kind", "motor_encoder");
        if let (true, Some(info)) = (is_encoder, encoder(&name(sensor, "joint"), side)) {
            set(sensor, "counts_per_turn", Value::from(i64::from(info.counts_per_turn.unsigned_abs())));
        }
        if is(sensor, "kind", "gyro")
            && let Some(info) = gyros.next()
        {
            // 2¹⁵ words to each side.
            set(sensor, "range_rad_s", Value::from(info.rad_s_per_lsb * 32_768.0));
        }
    }
    Ok(file.to_string())
}

/// The text of a description with what a bring-up has found: a head that tells of it, mountings and biases of gyros, and
/// friction from the duty at which each joint broke away.
///
/// # Errors
/// [`RobotError`] if the result is no description.
pub fn written(text: &str, findings: &Findings) -> Result<String, RobotError> {
    let robot = Robot::parse(text)?;
    let mut file = parsed(text)?;
    let tables = each(&mut file, "sensor").filter(|sensor| is(*sensor, "kind", "gyro"));
    for (table, GyroFound { rotation, bias_rad_s, .. }) in tables.zip(&findings.gyros) {
        if let Some(item) = table.get_mut("bias_rad_s") {
            start(item, vector(bias_rad_s.map(|bias| round(bias, 1e6))));
        }
        if let Some(item) = table.get_mut("rotation") {
            start(item, Value::Array(rotation.iter().map(|row| vector(*row)).collect()));
        }
    }
    let friction: Vec<Option<f64>> = (0..findings.joints.len())
        .map(|joint| {
            let torque = robot.joint_parameter(Symbol::KPwm, joint)?.value.start * robot.input.scale;
            Some(findings.joints[joint].break_away_duty * torque)
        })
        .collect();
    for (joint, friction) in each(&mut file, "joint").zip(friction) {
        // One that all joints share says nothing of this one.
        let Some(parameters) = joint.get_mut("parameters").and_then(Item::as_table_like_mut) else { continue };
        if let (Some(item), Some(friction)) = (parameters.get_mut("mu"), friction) {
            start(item, Value::from(round(friction, 1e4)));
        }
    }
    let text = format!("{}\n{}", head(findings), file.to_string().trim_start());
    Robot::parse(&text)?;
    Ok(text)
}

/// What was found, as comments.
fn head(findings: &Findings) -> String {
    let mut lines =
        vec!["Brought up by `host bringup`: each joint moves the way of its duty, its own encoder counts".to_owned()];
    lines.push("along with it, and gyros and encoders agree. Found by small moves:".to_owned());
    for found in &findings.joints {
        let agreement = match found.encoder_over_gyro {
            Some(ratio) => format!("encoder over gyro {ratio:.3}"),
            None => "no gyro sees it: gear and counts per turn are not checked".to_owned(),
        };
        lines.push(format!("  {}: breaks away at a duty of {:.3}; {agreement}", found.joint, found.break_away_duty));
    }
    for (index, gyro) in findings.gyros.iter().enumerate() {
        let turned = gyro.turned.as_ref().map_or("as described".to_owned(), |turned| format!("turned by {turned}"));
        let unknown = gyro.unknown.as_ref().map_or(String::new(), |unknown| format!("; {unknown}"));
        lines.push(format!("  gyro {}: {turned}{unknown}", index + 1));
    }
    lines.push("Friction starts from the break-away duty, biases from the gyros at rest.".to_owned());
    lines.into_iter().map(|line| format!("# {line}\n")).collect()
}

fn parsed(text: &str) -> Result<DocumentMut, RobotError> {
    // The words for a file that is no TOML are the description's own.
    match text.parse::<DocumentMut>() {
        Ok(file) => Ok(file),
        Err(error) => {
            Robot::parse(text)?;
            Err(RobotError::Syntax { message: error.to_string(), suggestion: String::new() })
        }
    }
}

fn name(table: &dyn TableLike, key: &str) -> String {
    table.get(key).and_then(Item::as_str).unwrap_or_default().to_owned()
}

/// Replaces a value, or adds it.
fn set(table: &mut dyn TableLike, key: &str, new: Value) {
    match table.get_mut(key) {
        Some(item) => replace(item, new),
        None => drop(table.insert(key, value(new))),
    }
}

fn round(number: f64, steps: f64) -> f64 {
    (number * steps).round() / steps
}
