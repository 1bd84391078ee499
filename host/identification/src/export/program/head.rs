//! The head of a program: where it comes from, what it lost, what every number means.

use crate::export::{Exported, Loss, Place};

/// Lines of a comment.
pub(in crate::export) fn of_program(exported: &Exported<'_>, losses: &[Loss]) -> Vec<String> {
    let mut lines = exported.origin();
    lines.push(String::new());
    lines.push("What this file keeps of the model:".to_owned());
    lines.extend(losses.iter().map(|loss| format!("  {loss}")));
    let robot = exported.calibrated.robot();
    lines.push(String::new());
    lines.push("State x, everything on the link side of the gears:".to_owned());
    lines.extend(exported.states.iter().enumerate().map(|(i, state)| {
        let unit = if state.unit.is_empty() { "" } else { state.unit };
        format!("  x[{i}]  {}  {unit}", state.name)
    }));
    lines.push("Input u, held over a step:".to_owned());
    let unit = robot.input.unit.symbol();
    lines.extend(robot.joints.iter().enumerate().map(|(i, joint)| {
        format!("  u[{i}]  {} of joint {}", if unit.is_empty() { "duty, -1 to 1," } else { unit }, joint.name)
    }));
    lines.push("Parameters p, with their standard errors:".to_owned());
    lines.extend(exported.parameters.iter().enumerate().map(|(i, p)| {
        let error = match p.std_error {
            Some(error) => format!("± {error:.2e}"),
            None => "NOT IDENTIFIED by the recordings".to_owned(),
        };
        format!("  p[{i}]  {} = {} {}, {error}", p.name, p.value, p.unit).replace(" ,", ",")
    }));
    lines.push("Readings y of the sensors:".to_owned());
    lines.extend(exported.readings.iter().enumerate().map(|(i, channel)| {
        let late =
            if channel.offset_s == 0.0 { String::new() } else { format!(", {} s after the state", channel.offset_s) };
        format!("  y[{i}]  {}  {}{late}", channel.name, channel.unit)
    }));
    lines.push("Time t: seconds since the start of the motion, for what drifts.".to_owned());
    lines
}

/// The parameters' covariance by rows, in the order of the parameters; zeros where the calibration has none. None if it has none at all.
pub(super) fn covariance(exported: &Exported<'_>) -> Option<Vec<f64>> {
    let covariance = &exported.calibration.covariance;
    if covariance.matrix.is_empty() {
        return None;
    }
    let places: Vec<Option<usize>> =
        exported.parameters.iter().map(|p| covariance.parameters.iter().position(|name| *name == p.name)).collect();
    let entry = |row: &Option<usize>, column: &Option<usize>| match (row, column) {
        (Some(row), Some(column)) => covariance.matrix[*row][*column],
        _ => 0.0,
    };
    Some(places.iter().flat_map(|row| places.iter().map(move |column| entry(row, column))).collect())
}

/// States of gyros that lag: the first of three, the parameter that tells the time constant, and what share of it the time constant is.
pub(super) fn lags(exported: &Exported<'_>) -> Vec<(usize, usize, f64)> {
    let (model, z) = (exported.calibrated.model(), exported.calibrated.z());
    let of = |(state, coordinate): (usize, usize)| {
        exported.parameters.iter().enumerate().find_map(|(place, parameter)| {
            let Place::Result(i) = parameter.place else { return None };
            let (told_s, slopes) = model.coordinates().physical_and_slopes(z, i);
            slopes.iter().any(|(own, _)| *own == coordinate).then(|| (state, place, z[coordinate].exp() / told_s))
        })
    };
    model.lags().filter_map(of).collect()
}

/// Text in lines of so many columns, each with `before` in front.
pub(super) fn wrapped(items: impl IntoIterator<Item = String>, before: &str) -> String {
    let mut text = String::new();
    let mut line = before.to_owned();
    for item in items {
        if line.len() + item.len() > 118 && line.len() > before.len() {
            text += line.trim_end();
            text.push('\n');
            line = before.to_owned();
        }
        line += &item;
        line += ", ";
    }
    text + line.trim_end() + "\n"
}
