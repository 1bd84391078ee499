//! Factors by which a wrong unit or a gear makes a reading too large.

use crate::recording::Recording;
use crate::robot::{JointKind, Sensor};

pub(super) const DEGREES: f64 = 180.0 / std::f64::consts::PI;

/// A reading is this many times what it should be, for this reason.
#[derive(Debug, Clone)]
pub(super) struct Mistake {
    pub factor: f64,
    /// "looks like …".
    pub looks: String,
    pub advice: String,
}

fn mistake(factor: f64, looks: &str, advice: String) -> Mistake {
    Mistake { factor, looks: looks.to_owned(), advice }
}

/// What makes the motor position of a joint (or its link position, if `at_link`) too large or too small.
pub(super) fn of_position(recording: &Recording, joint: usize, at_link: bool) -> Vec<Mistake> {
    let description = &recording.robot.joints[joint];
    let column = format!("{}{}", if at_link { "q" } else { "theta" }, joint + 1);
    let mapping = |entry: &str| format!("or write {entry} for {column} under import.columns in the robot file");
    let mut list = Vec::new();
    let degrees = mapping("unit = \"deg\"");
    let gear = description.gear;
    if description.kind == JointKind::Revolute {
        list.push(mistake(
            DEGREES,
            "looks like degrees",
            format!("give angles in rad (divide by 57.29578), {degrees}"),
        ));
    } else {
        list.push(mistake(
            1e3,
            "looks like millimetres",
            format!("give positions in m (divide by 1000), {}", mapping("unit = \"mm\"")),
        ));
    }
    if !at_link && !(0.9..1.1).contains(&gear) {
        let motor = mapping("side = \"motor\"");
        list.push(mistake(
            gear,
            "looks like the motor's side of the gear",
            format!("give positions on the link side: divide by the gear ratio {gear} of the robot file, {motor}"),
        ));
        let both = mapping("unit = \"deg\", side = \"motor\"");
        list.push(mistake(
            gear * DEGREES,
            "looks like degrees on the motor's side of the gear",
            format!("give positions in SI on the link side: divide by {}, {both}", gear * DEGREES),
        ));
        list.push(mistake(
            1.0 / gear,
            "looks as if the gear had been applied twice",
            format!("positions are divided by the gear ratio {gear} once: multiply by it, or take side = \"motor\" out of import.columns.{column} in the robot file"),
        ));
    }
    let counts = recording.robot.sensors.iter().find_map(|sensor| match sensor {
        Sensor::MotorEncoder(encoder) if !at_link && encoder.joint == joint => {
            encoder.counts_per_turn.map(|counts| f64::from(counts) * gear)
        }
        Sensor::LinkEncoder(encoder) if at_link && encoder.joint == joint => encoder.counts_per_turn.map(f64::from),
        _ => None,
    });
    if let Some(per_turn) = counts {
        let counts = mapping("unit = \"counts\"");
        list.push(mistake(
            per_turn / std::f64::consts::TAU,
            "looks like encoder counts",
            format!("give positions in SI: multiply by 2π/{per_turn}, {counts}"),
        ));
    }
    if description.kind == JointKind::Prismatic {
        list.push(mistake(
            1e-3,
            "looks converted from millimetres twice",
            "positions are in m once divided by 1000: multiply by it once".to_owned(),
        ));
    } else {
        list.push(mistake(
            1.0 / DEGREES,
            "looks converted from degrees twice",
            "angles are in rad once divided by 57.29578: multiply by it once".to_owned(),
        ));
    }
    list
}

/// What makes a gyro's rates too large or too small.
pub(super) fn of_rate() -> Vec<Mistake> {
    let mapping =
        |unit: &str| format!("or write unit = \"{unit}\" for its columns under import.columns in the robot file");
    vec![
        mistake(
            DEGREES,
            "looks like degrees per second",
            format!("give rates in rad/s (divide by 57.29578), {}", mapping("deg/s")),
        ),
        mistake(
            1e3 * DEGREES,
            "looks like thousandths of degrees per second",
            format!("give rates in rad/s (divide by 57295.78), {}", mapping("mdeg/s")),
        ),
        mistake(
            1.0 / DEGREES,
            "looks converted to rad/s twice",
            "rates are in rad/s once divided by 57.29578: multiply by it once".to_owned(),
        ),
    ]
}

/// The mistake whose factor is nearest to `factor`, if one is within `tolerance` of it (as a ratio).
pub(super) fn nearest(mistakes: &[Mistake], factor: f64, tolerance: f64) -> Option<&Mistake> {
    let distance = |mistake: &Mistake| (factor / mistake.factor).ln().abs();
    mistakes
        .iter()
        .filter(|mistake| distance(mistake) <= tolerance.ln())
        .min_by(|a, b| distance(a).total_cmp(&distance(b)))
}
