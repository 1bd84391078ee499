//! `host effects`: the catalogue of what a robot may have beyond the base model.

use std::fmt::Write as _;

use super::{Exit, Failure, Ui, json};
use crate::effect::{CATALOGUE, Effect, EffectParameter, Role, Typical};

/// Print the catalogue of effects
///
/// What a robot may have beyond the base model: each effect's law, its parameters, and what else looks like it. Below a
/// parameter stand its role and its typical size: the median, as a share of a scale of the robot, and one standard
/// deviation in decades. Any effect can be put into a simulated robot: `host simulate --effect backlash=large`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Only this effect, with what it is about
    #[arg(value_name = "ID")]
    id: Option<String>,
    /// Print JSON: an array, or with an ID one object
    #[arg(long)]
    json: bool,
}

/// Prints to stdout.
pub fn run(args: Args, ui: &Ui) -> Result<Exit, Failure> {
    let one = args.id.as_deref().map(Effect::by_id).transpose();
    let one = one.map_err(|error| Failure::usage(error).advice("`host effects` prints all of them"))?;
    let text = match (one, args.json) {
        (Some(effect), true) => json(effect)?,
        (None, true) => json(&CATALOGUE[..])?,
        (Some(effect), false) => format!("{}\n{}\n", entry(effect), effect.about),
        (None, false) => CATALOGUE.into_iter().map(entry).collect::<Vec<_>>().join("\n"),
    };
    ui.print(&text)?;
    Ok(Exit::Ok)
}

/// An effect as people read it.
fn entry(effect: &Effect) -> String {
    let mut text = format!("{:<21} {}\n    {}\n", effect.id, effect.title, effect.equation);
    for parameter in effect.parameters.iter().chain(effect.nuisances) {
        // Writing into a String cannot fail.
        let _ = writeln!(text, "    {:<13} {:<14} {}", parameter.name, parameter.unit, parameter.sizes);
        let _ = writeln!(text, "    {:<28} {}", "", role(parameter));
    }
    let _ = writeln!(text, "    looks like    {}", effect.confounded_with.join(", "));
    text
}

/// Role and typical size of a parameter.
fn role(parameter: &EffectParameter) -> String {
    let role = match parameter.role {
        Role::Size => "size",
        Role::InverseSize => "size, smaller is stronger",
        Role::Shape => "shape",
        Role::Nuisance => "nuisance",
        Role::PerRecording => "own to each recording",
    };
    let Some(Typical { median, decades, of }) = parameter.typical else { return role.to_owned() };
    let share = match (of.words(), parameter.unit) {
        ("", "1") => String::new(),
        ("", unit) => format!(" {unit}"),
        (scale, _) => format!(" × {scale}"),
    };
    format!("{role}: {median}{share}, ± {decades} decades")
}
