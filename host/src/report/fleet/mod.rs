//! The tables of `host table`, for people and for programs: the calibrations, their means, whether they agree. A page here, CSV and Markdown in
//! files of their own.

mod csv;
mod markdown;

use super::number::{significant, with_error};
use super::{Cell, Page, Section, Table, Tone};
use crate::fleet::{Fleet, Group};

pub use self::csv::csv;
pub use self::markdown::markdown;

/// The whole page.
pub fn page(fleet: &Fleet) -> Page {
    let used = fleet.calibrations.len() - fleet.left_out.iter().filter(|left| is_entry(fleet, &left.path)).count();
    let mut page = Page::new("Calibrations merged")
        .lead(format!("{used} calibrations of {} robots.", fleet.groups.len()))
        .fact("left out", fleet.left_out.len().to_string());
    for group in &fleet.fleets {
        page.push(section(&format!("Fleet {}", group.name), group));
    }
    for group in &fleet.groups {
        page.push(section(&group.name, group));
    }
    page.push(files(fleet));
    page
}

fn is_entry(fleet: &Fleet, path: &str) -> bool {
    fleet.calibrations.iter().any(|entry| entry.path == path)
}

fn section(title: &str, group: &Group) -> Section {
    let merged = &group.merged;
    let mut section = Section::new(title);
    section.note(if merged.consistent { Tone::Good } else { Tone::Warning }, verdict(group));
    let mut table = Table::new()
        .words("parameter")
        .words("unit")
        .numbers("mean ± error", "")
        .numbers("spread", "")
        .numbers("p", "");
    for parameter in &merged.parameters {
        let (mean, error) = parameter.best(merged.consistent);
        let p = parameter.p_value.map_or("–".to_owned(), |p| significant(p, 2));
        let tone = if parameter.p_value.is_some_and(|p| p < 0.01) { Tone::Warning } else { Tone::Plain };
        table.row([
            parameter.name.as_str().into(),
            parameter.unit.as_str().into(),
            with_error(mean, Some(error)).into(),
            (if parameter.spread > 0.0 { significant(parameter.spread, 2) } else { "–".to_owned() }).into(),
            Cell::toned(p, tone),
        ]);
    }
    section.table(&table);
    section
}

fn files(fleet: &Fleet) -> Section {
    let mut section = Section::new("Files");
    let mut table = Table::new().words("file").words("group").numbers("samples", "").words("");
    for entry in &fleet.calibrations {
        let reason = fleet.left_out.iter().find(|left| left.path == entry.path).map_or("", |left| &left.reason);
        table.row([
            entry.path.as_str().into(),
            entry.group.as_str().into(),
            entry.samples.to_string().into(),
            Cell::toned(reason, if reason.is_empty() { Tone::Plain } else { Tone::Warning }),
        ]);
    }
    for left in fleet.left_out.iter().filter(|left| !is_entry(fleet, &left.path)) {
        table.row([left.path.as_str().into(), "".into(), "".into(), Cell::toned(&left.reason, Tone::Warning)]);
    }
    section.table(&table);
    section
}

/// Whether the members agree, in a sentence.
fn verdict(group: &Group) -> String {
    let merged = &group.merged;
    match merged.p_value {
        None => format!("One calibration: {}.", group.members.join(", ")),
        Some(p) => format!(
            "{} members: {} (χ² {:.1} on {} degrees of freedom, p {}). {}",
            merged.count,
            if merged.consistent { "they agree within their errors" } else { "they do not agree within their errors" },
            merged.chi2,
            merged.dof,
            significant(p, 2),
            if merged.consistent {
                "The means are those of one robot."
            } else {
                "The means are those of a population, with its spread; a model that lacks something spreads recordings of one robot as well."
            }
        ),
    }
}
