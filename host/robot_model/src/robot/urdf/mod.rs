//! A chain from a URDF: the description file names its joints and says what a URDF does not, drives, friction, sensors.
//!
//! ```text
//!   [urdf]                              arm.urdf                      what the robot is read from
//!   file = "arm.urdf"      +     <joint name="shoulder"> …    ─▶      one description file, complete,
//!   [[joint]]                    <link> <inertial> …                  which `host robot show` prints
//!   name = "shoulder" …                                               and recordings carry
//! ```
//!
//! A joint's `kind`, `axis`, `origin_m`, `rotation`, limits and `body` come from the URDF where its table leaves them out. Links behind fixed
//! joints are part of the body before them.

mod chain;
mod text;

use std::path::Path;

use serde::Deserialize;
use toml::{Table, Value};

use self::chain::{Tree, UrdfJoint};
use super::{JointKind, RobotError};

/// The section `[urdf]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct UrdfTable {
    /// Relative to the description file.
    file: String,
    /// Joints of the URDF that move there and stand still at zero here, as a gripper's.
    #[serde(default)]
    locked: Vec<String>,
}

/// A description with what its URDF says written out.
pub(super) struct Expanded {
    /// The complete file.
    pub text: String,
    /// Fields that the URDF gave, as `joint[1].body`, and what they are called there.
    given: Vec<(String, String)>,
}

impl Expanded {
    /// The error, with its field as the URDF calls it if it stands there.
    pub(super) fn name(&self, error: RobotError) -> RobotError {
        match error {
            RobotError::Invalid { field, value, advice } => {
                let of = |given: &str| {
                    field.strip_prefix(given).is_some_and(|rest| !rest.starts_with(|c: char| c.is_alphanumeric()))
                };
                let given = self.given.iter().find(|(given, _)| of(given));
                let field = given.map_or(field.clone(), |(_, name)| format!("{name} ({field})"));
                RobotError::Invalid { field, value, advice }
            }
            other => other,
        }
    }
}

/// The description in `text` with what its `[urdf]` section points at written out; `None` where it has none. `folder` is the file's.
///
/// # Errors
/// [`RobotError`] where the URDF cannot be read or is not the chain that the description speaks of.
pub(super) fn expand(text: &str, folder: &Path) -> Result<Option<Expanded>, RobotError> {
    // What is not TOML is told by the reader of complete files, with its place.
    let Ok(mut file) = text.parse::<Table>() else { return Ok(None) };
    let Some(section) = file.remove("urdf") else { return Ok(None) };
    let section: UrdfTable = section.try_into().map_err(|error| RobotError::syntax(&error))?;
    let path = folder.join(&section.file);
    let urdf = std::fs::read_to_string(&path).map_err(|source| RobotError::Read { path: path.clone(), source })?;
    text::check(&urdf, &section.file)?;
    let unreadable = |error| RobotError::invalid("urdf.file", path.display(), format!("is no URDF: {error}"));
    let urdf = urdf_rs::read_from_string(&urdf).map_err(unreadable)?;
    let Some(Value::Array(joints)) = file.get_mut("joint") else {
        let names = Tree::of(&urdf).moving().join(", ");
        let advice = format!("add a [[joint]] table with the name of each joint of the chain; the URDF has {names}");
        return Err(RobotError::invalid("joint", "nothing", advice));
    };
    let names: Vec<String> = joints.iter().map(|joint| name(joint).unwrap_or_default().to_owned()).collect();
    let chain = Tree::of(&urdf).chain(&names, &section.locked)?;
    let mut given = Vec::new();
    for (index, (table, joint)) in joints.iter_mut().zip(&chain).enumerate() {
        if let Value::Table(table) = table {
            for key in fill(table, joint) {
                let name = match key {
                    "body" => format!("link `{}` of {}", joint.link, section.file),
                    _ => format!("joint `{}` of {}", names[index], section.file),
                };
                given.push((format!("joint[{}].{key}", index + 1), name));
            }
        }
    }
    match toml::to_string(&file) {
        Ok(text) => Ok(Some(Expanded { text, given })),
        Err(error) => Err(RobotError::invalid("urdf", section.file, error.to_string())),
    }
}

fn name(joint: &Value) -> Option<&str> {
    joint.get("name")?.as_str()
}

/// Gives a joint's table what it leaves out; which fields that were.
fn fill(table: &mut Table, joint: &UrdfJoint) -> Vec<&'static str> {
    let mut filled = Vec::new();
    let vector = |values: &[f64]| Value::Array(values.iter().map(|v| Value::Float(*v)).collect());
    let mut give = |key: &'static str, value: Value| {
        if !table.contains_key(key) {
            table.insert(key.to_owned(), value);
            filled.push(key);
        }
    };
    let (kind, limits) = match joint.kind {
        JointKind::Revolute => ("revolute", "limits_rad"),
        JointKind::Prismatic => ("prismatic", "limits_m"),
    };
    give("kind", Value::String(kind.into()));
    give("axis", vector(&joint.axis));
    give("origin_m", vector(&joint.origin_m));
    let rows = joint.rotation.iter().map(|row| vector(row)).collect();
    give("rotation", Value::Array(rows));
    if let Some(range) = joint.limits {
        give(limits, vector(&range));
    }
    let body = &joint.body;
    let mut inertia = Table::new();
    for (name, i, j) in [("xx", 0, 0), ("yy", 1, 1), ("zz", 2, 2), ("xy", 0, 1), ("xz", 0, 2), ("yz", 1, 2)] {
        inertia.insert(name.into(), Value::Float(body.inertia_kg_m2[i][j]));
    }
    let mut given = Table::new();
    given.insert("mass_kg".into(), Value::Float(body.mass_kg));
    given.insert("centre_m".into(), vector(&body.centre_m));
    given.insert("inertia_kg_m2".into(), Value::Table(inertia));
    give("body", Value::Table(given));
    filled
}
