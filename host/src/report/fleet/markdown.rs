//! The merged calibrations as Markdown: a section a group, a row a parameter.

use std::fmt::Write;

use super::verdict;
use crate::fleet::{Fleet, Group};
use crate::report::number::{significant, with_error};

/// A table of every group and fleet, a row a parameter, and what was left out.
pub fn markdown(fleet: &Fleet) -> String {
    let mut text = String::new();
    for (what, group) in fleet.groups.iter().map(|g| ("", g)).chain(fleet.fleets.iter().map(|g| ("Fleet ", g))) {
        section(&mut text, what, group, fleet);
    }
    if !fleet.left_out.is_empty() {
        text += "## Left out\n\n";
        for left in &fleet.left_out {
            let _ = writeln!(text, "- {}: {}", left.path, left.reason);
        }
        text.push('\n');
    }
    text
}

fn section(text: &mut String, what: &str, group: &Group, fleet: &Fleet) {
    let merged = &group.merged;
    let _ = writeln!(text, "## {what}{}\n\n{}\n", group.name, verdict(group));
    let member = |path: &String| {
        let entry = fleet.calibrations.iter().find(|entry| entry.path == *path);
        let inner = fleet.groups.iter().find(|inner| inner.name == *path);
        entry.map(|entry| entry.estimates.clone()).or_else(|| inner.map(|inner| inner.merged.estimates()))
    };
    let members: Vec<_> = group.members.iter().filter_map(member).collect();
    let heads: String = group.members.iter().map(|name| format!(" {name} |")).collect();
    let _ = writeln!(text, "| parameter | unit |{heads} mean | spread | p |");
    let _ = writeln!(text, "|---|---|{}---|---|---|", "---|".repeat(members.len()));
    for parameter in &merged.parameters {
        let (mean, error) = parameter.best(merged.consistent);
        let own: String = members
            .iter()
            .map(|estimates| match estimates.names.iter().position(|name| *name == parameter.name) {
                Some(i) => format!(" {} |", with_error(estimates.values[i], Some(estimates.covariance[i][i].sqrt()))),
                None => " |".to_owned(),
            })
            .collect();
        let spread = if parameter.spread > 0.0 { significant(parameter.spread, 2) } else { "–".to_owned() };
        let p = parameter.p_value.map_or("–".to_owned(), |p| significant(p, 2));
        let mean = with_error(mean, Some(error));
        let _ = writeln!(text, "| {} | {} |{own} {mean} | {spread} | {p} |", parameter.name, parameter.unit);
    }
    text.push('\n');
}
