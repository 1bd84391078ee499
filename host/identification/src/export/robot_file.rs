//! The description file with the identified values in the place of the start values: ready for the next `--robot`.

use toml_edit::{DocumentMut, Item, TableLike, Value};

use super::loss::{Loss, title};
use super::{ExportError, Exported};
use crate::model::rotation::orthonormalised;
use crate::robot::edit::{each, is, replace, start, vector};
use crate::robot::{Channel, ChannelKind, JointKind, ParameterSpec, Symbol};

/// The file, and what it keeps.
///
/// # Errors
/// [`ExportError::Description`] if the description inside the calibration cannot be edited.
pub fn robot_file(exported: &Exported<'_>) -> Result<(String, Vec<Loss>), ExportError> {
    let robot = exported.calibrated.robot();
    let unreadable = |message: String| ExportError::Description { message };
    let mut file: DocumentMut =
        robot.toml().parse().map_err(|error: toml_edit::TomlError| unreadable(error.to_string()))?;
    for (coordinate, value) in exported.calibrated.model().coordinates().iter().zip(values(exported)) {
        let item = entry(&mut file, exported, &coordinate.spec)
            .ok_or_else(|| unreadable(format!("no entry of `{}`", coordinate.spec.name)))?;
        start(item, Value::from(value));
    }
    gyros(&mut file, exported);
    noise(&mut file, exported);
    let losses = losses(exported);
    let head = head(exported, &losses);
    let text = file.to_string();
    let text = format!("{head}\n{}", text.trim_start());
    crate::robot::Robot::parse(&text).map_err(|error| unreadable(error.to_string()))?;
    Ok((text, losses))
}

/// The calibrated values of the base model's parameters.
fn values(exported: &Exported<'_>) -> Vec<f64> {
    exported.calibrated.model().coordinates().to_physical(exported.calibrated.z())
}

fn head(exported: &Exported<'_>, losses: &[Loss]) -> String {
    let mut lines = exported.origin();
    lines.push("start values are the calibrated ones; what this file keeps of the model:".to_owned());
    lines.extend(losses.iter().map(|loss| format!("  {loss}")));
    let unknown: Vec<_> =
        exported.parameters.iter().filter(|p| p.std_error.is_none()).map(|p| p.name.as_str()).collect();
    if !unknown.is_empty() {
        lines.push(format!("NOT IDENTIFIED by the recordings, held near their start: {}", unknown.join(", ")));
    }
    lines.into_iter().map(|line| format!("# {line}\n")).collect()
}

fn losses(exported: &Exported<'_>) -> Vec<Loss> {
    let mut losses = vec![
        Loss::exact("chain and laws of the base model", "as described, from the identified parameters"),
        Loss::exact("gyros", "mountings and biases; a bias of each recording of its own is told by its mean"),
        Loss::exact("noise of sensors", "as estimated; a gyro's three axes by their mean square"),
        Loss::lost("process noise", "the next calibration estimates it anew"),
        Loss::lost("covariance of the parameters", "the next calibration starts here, but does not weigh these values"),
    ];
    for id in &exported.calibration.extensions {
        let told = format!("{}: `--extend {id}` in the next calibration finds it again", title(id));
        losses.push(Loss::lost(id, told));
    }
    losses
}

/// The table `{ start = … }` of a parameter of joints.
fn entry<'d>(file: &'d mut DocumentMut, exported: &Exported<'_>, spec: &ParameterSpec) -> Option<&'d mut Item> {
    let robot = exported.calibrated.robot();
    let name = spec.symbol.name();
    let joint = *spec.joints.first()?;
    if let Symbol::Zero | Symbol::ScaleError = spec.symbol {
        let key = match (spec.symbol, robot.joints[joint].kind) {
            (Symbol::ScaleError, _) => "scale_error",
            (_, JointKind::Revolute) => "zero_rad",
            (_, JointKind::Prismatic) => "zero_m",
        };
        let is_it = |sensor: &dyn TableLike| {
            is(sensor, "kind", "link_encoder") && is(sensor, "joint", &robot.joints[joint].name)
        };
        return each(file, "sensor").find(|sensor| is_it(*sensor))?.get_mut(key);
    }
    if let Symbol::Lag { gyro } = spec.symbol {
        return each(file, "sensor").filter(|sensor| is(*sensor, "kind", "gyro")).nth(gyro)?.get_mut("lag_s");
    }
    // One number for all joints has no index.
    if spec.name == name {
        return file.get_mut("parameters")?.get_mut(name);
    }
    each(file, "joint").nth(joint)?.get_mut("parameters")?.get_mut(name)
}

fn gyros(file: &mut DocumentMut, exported: &Exported<'_>) {
    let calibrated = &exported.calibrated;
    let described: Vec<_> = calibrated.robot().gyros().cloned().collect();
    let tables = each(file, "sensor").filter(|sensor| is(*sensor, "kind", "gyro"));
    for (((table, gyro), bias), rotation) in tables.zip(described).zip(calibrated.biases()).zip(calibrated.rotations())
    {
        if let Some(item) = table.get_mut("bias_rad_s").filter(|_| gyro.bias_free) {
            start(item, vector([bias.x, bias.y, bias.z]));
        }
        if let Some(item) = table.get_mut("rotation").filter(|_| gyro.rotation_free) {
            let rotation = orthonormalised(rotation);
            let rows = (0..3).map(|i| vector([rotation[(i, 0)], rotation[(i, 1)], rotation[(i, 2)]]));
            start(item, Value::Array(rows.collect()));
        }
    }
}

/// Standard deviations of sensors, where the calibration has estimated them.
fn noise(file: &mut DocumentMut, exported: &Exported<'_>) {
    let robot = exported.calibrated.robot();
    let estimated = |channel: &Channel| {
        let noise = exported.calibration.noise.iter().find(|noise| noise.channel == channel.name);
        noise.filter(|noise| noise.floor.is_some() && noise.chi2_per_dof.is_some()).map(|noise| noise.sigma)
    };
    let mean = |wanted: &dyn Fn(ChannelKind) -> bool| {
        let found: Vec<f64> = exported.readings.iter().filter(|c| wanted(c.kind)).filter_map(estimated).collect();
        let square = found.iter().map(|sigma| sigma * sigma).sum::<f64>() / found.len() as f64;
        Some(square.sqrt()).filter(|sigma| sigma.is_finite() && *sigma > 0.0)
    };
    let joint_of = |table: &dyn TableLike| {
        let name = table.get("joint").and_then(Item::as_str)?;
        robot.joints.iter().position(|joint| joint.name == name)
    };
    let mut gyros = 0;
    for table in each(file, "sensor") {
        let Some(joint) = joint_of(table) else { continue };
        let kind = table.get("kind").and_then(Item::as_str).unwrap_or_default().to_owned();
        let at_link = is(table, "side", "link");
        let sigma = match kind.as_str() {
            "motor_encoder" => mean(&|kind| kind == ChannelKind::MotorPosition { joint }),
            "link_encoder" => mean(&|kind| kind == ChannelKind::LinkPosition { joint }),
            "tachometer" if at_link => mean(&|kind| kind == ChannelKind::LinkSpeed { joint }),
            "tachometer" => mean(&|kind| kind == ChannelKind::MotorSpeed { joint }),
            _ => {
                gyros += 1;
                mean(&|kind| matches!(kind, ChannelKind::GyroAxis { gyro, .. } if gyro + 1 == gyros))
            }
        };
        let Some(sigma) = sigma else { continue };
        let keys = ["sigma_rad", "sigma_m", "sigma_rad_s", "sigma_m_s"];
        if let Some(key) = keys.into_iter().find(|key| table.contains_key(key))
            && let Some(item) = table.get_mut(key)
        {
            replace(item, Value::from(sigma));
        }
    }
}
