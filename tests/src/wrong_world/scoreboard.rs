//! Counts of the wrong-world study, with Wilson's intervals.

use std::fmt;

use super::family::Family;
use super::{Case, Kind, Main, Outcome};
use crate::hidden::wilson;
use crate::wrong_world::effect::Size;
use crate::wrong_world::said::Standing;

/// Counts of a study.
#[derive(Debug, Clone, PartialEq)]
pub struct Scoreboard {
    rows: Vec<Row>,
    /// Median and slowest of each family, s.
    times: Vec<(Family, f64, f64)>,
    /// Cases with another answer than the truth, a line each.
    misses: Vec<String>,
}

/// Hits among a number of cases, findings or intervals.
#[derive(Debug, Clone, PartialEq)]
struct Row {
    what: String,
    hits: usize,
    of: usize,
}

impl Scoreboard {
    /// Counts.
    pub fn of(outcomes: &[Outcome]) -> Self {
        let mut board = Self { rows: Vec::new(), times: Vec::new(), misses: Vec::new() };
        for family in Family::ALL {
            let of_family: Vec<&Outcome> = outcomes.iter().filter(|outcome| outcome.case.family == family).collect();
            board.family(family, &of_family);
        }
        let all: Vec<&Outcome> = outcomes.iter().collect();
        board.common("all", &all);
        board.misses = outcomes.iter().filter(|outcome| !is_as_hidden(outcome)).map(miss).collect();
        board.misses.sort();
        board
    }

    fn family(&mut self, family: Family, outcomes: &[&Outcome]) {
        let of_kind = |kind: Kind| outcomes.iter().copied().filter(move |outcome| outcome.case.kind() == kind);
        let name = family.name();
        for size in Size::OF_MAINS {
            let mains: Vec<&Outcome> = of_kind(Kind::Main).filter(|outcome| outcome.case.size == size).collect();
            let what = |text: &str| format!("{name}, {}: {text}", size.name());
            self.cases(what("main effect in the list"), &mains, |outcome| outcome.lists_main());
            self.cases(what("main effect first"), &mains, |outcome| outcome.begins_with_main());
            let intervals = || mains.iter().flat_map(|outcome| &outcome.parameters).filter_map(|one| one.holds);
            self.push(
                what("intervals that hold the truth"),
                intervals().filter(|holds| *holds).count(),
                intervals().count(),
            );
        }
        let nulls: Vec<&Outcome> = of_kind(Kind::Null).collect();
        self.cases(format!("{name}, no main effect: a false name"), &nulls, |outcome| outcome.false_names() > 0);
        self.cases(format!("{name}, no main effect: none or unknown"), &nulls, |outcome| {
            ["none", "unknown"].contains(&outcome.verdict.as_str())
        });
        let outsiders: Vec<&Outcome> = of_kind(Kind::Outsider).collect();
        self.cases(format!("{name}, outsider: a false name"), &outsiders, |outcome| outcome.false_names() > 0);
        self.cases(format!("{name}, outsider: unknown"), &outsiders, |outcome| outcome.verdict == "unknown");
        self.cases(format!("{name}, outsider: the largest defect on its joint"), &outsiders, is_right_joint);
        self.common(name, outcomes);
        let mut seconds: Vec<f64> = outcomes.iter().map(|outcome| outcome.seconds).collect();
        seconds.sort_by(f64::total_cmp);
        if let (Some(median), Some(slowest)) = (seconds.get(seconds.len() / 2), seconds.last()) {
            self.times.push((family, *median, *slowest));
        }
    }

    /// What is counted over all sizes and kinds.
    fn common(&mut self, name: &str, outcomes: &[&Outcome]) {
        let findings = || outcomes.iter().flat_map(|outcome| &outcome.findings);
        let is_false = findings().filter(|finding| finding.standing == Standing::False).count();
        self.push(format!("{name}: findings that are false names"), is_false, findings().count());
        let named: Vec<&Outcome> = outcomes.iter().copied().filter(|outcome| !outcome.findings.is_empty()).collect();
        self.cases(format!("{name}: held-out predictions worse, of cases with findings"), &named, |outcome| {
            outcome.is_harmed
        });
        self.cases(format!("{name}: refused by `host check`"), outcomes, |outcome| !outcome.obstacles.is_empty());
        self.cases(format!("{name}: failed diagnoses"), outcomes, |outcome| outcome.error.is_some());
    }

    fn cases(&mut self, what: String, outcomes: &[&Outcome], is_hit: impl Fn(&Outcome) -> bool) {
        self.push(what, outcomes.iter().filter(|outcome| is_hit(outcome)).count(), outcomes.len());
    }

    fn push(&mut self, what: String, hits: usize, of: usize) {
        self.rows.push(Row { what, hits, of });
    }
}

/// Whether the largest nameless defect is on the joint that an outsider acts on.
fn is_right_joint(outcome: &Outcome) -> bool {
    let Main::Outsider(kind) = &outcome.case.main else { return false };
    let joints = outcome.case.family.robot(outcome.case.seed).joints.len();
    let axis = outcome.place.as_ref().and_then(|(_, axis, _)| *axis);
    axis == Some(kind.joint(joints) as u64 + 1)
}

/// Whether the answer agrees with the truth.
fn is_as_hidden(outcome: &Outcome) -> bool {
    let is_found = outcome.case.kind() != Kind::Main || outcome.begins_with_main();
    is_found && outcome.false_names() == 0 && outcome.error.is_none() && !outcome.is_harmed
}

fn miss(outcome: &Outcome) -> String {
    let Case { family, seed, main, size } = &outcome.case;
    let hidden = match main {
        Main::None => "no main effect".to_owned(),
        Main::Effect(id) => format!("{} {id}", size.name()),
        Main::Outsider(kind) => format!("{} outsider {}", size.name(), kind.name()),
    };
    let mark = |standing: Standing| match standing {
        Standing::Main => "",
        Standing::Trace => " (trace)",
        Standing::File => " (file)",
        Standing::False => " (false)",
    };
    let names = outcome.findings.iter().map(|finding| format!("{}{}", finding.effect, mark(finding.standing)));
    let names: Vec<String> = names.collect();
    let worse = if outcome.is_harmed { ", held-out predictions worse" } else { "" };
    let error = outcome.error.as_ref().map_or_else(String::new, |error| format!(", {error}"));
    format!("{}, seed {seed}, {hidden}: {} [{}]{worse}{error}", family.name(), outcome.verdict, names.join(", "))
}

impl fmt::Display for Scoreboard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "| family, size: what | count | share | 95 % interval |")?;
        writeln!(f, "|---|---|---|---|")?;
        for Row { what, hits, of } in self.rows.iter().filter(|row| row.of > 0) {
            let [low, high] = wilson(*hits, *of).map(|share| 100.0 * share);
            let share = 100.0 * *hits as f64 / *of as f64;
            writeln!(f, "| {what} | {hits} of {of} | {share:.0} % | {low:.0}–{high:.0} % |")?;
        }
        writeln!(f)?;
        for (family, median, slowest) in &self.times {
            writeln!(
                f,
                "* {}: half of the diagnoses within {median:.1} s, the slowest in {slowest:.1} s",
                family.name()
            )?;
        }
        if !self.misses.is_empty() {
            writeln!(f, "\nOther answers than the truth:")?;
            self.misses.iter().try_for_each(|line| writeln!(f, "* {line}"))?;
        }
        Ok(())
    }
}
