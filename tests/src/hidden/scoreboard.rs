//! Counts of a study of hidden effects, with Wilson's intervals.

use std::collections::BTreeSet;
use std::fmt;

use host::diagnose::Verdict;
use host::effect::Effect;

use super::information::{Sized, asked};
use super::{Disturbance, Kind, Outcome};

/// Margins within this factor of what was asked for are of that size.
const AS_ASKED: f64 = 3.0;

/// The 95 % interval of a share of which `hits` of `n` were seen (Wilson 1927).
pub fn wilson(hits: usize, n: usize) -> [f64; 2] {
    if n == 0 {
        return [0.0, 1.0];
    }
    let (z, n) = (1.959_964, n as f64);
    let share = hits as f64 / n;
    let middle = (share + z * z / (2.0 * n)) / (1.0 + z * z / n);
    let half = z / (1.0 + z * z / n) * (share * (1.0 - share) / n + z * z / (4.0 * n * n)).sqrt();
    [(middle - half).max(0.0), (middle + half).min(1.0)]
}

/// What a study found, for a README.
#[derive(Debug, Clone, PartialEq)]
pub struct Scoreboard {
    rows: Vec<(String, usize, usize)>,
    /// How well the parameters of effects are met, a line a size.
    sizes: Vec<String>,
    /// What went wrong, a line a case.
    misses: Vec<String>,
}

impl Scoreboard {
    /// Counts.
    pub fn of(outcomes: &[Outcome]) -> Self {
        let mut board = Scoreboard { rows: Vec::new(), sizes: Vec::new(), misses: Vec::new() };
        let group = |is: &dyn Fn(&Outcome) -> bool| outcomes.iter().filter(|o| is(o)).collect::<Vec<_>>();
        for (disturbance, of) in [
            (Disturbance::Nothing, ""),
            (Disturbance::JitteredStamps, ", stamps that jitter"),
            (Disturbance::ColouredNoise, ", coloured noise of the gyros"),
        ] {
            let nothing = group(&|o| o.case.kind() == Kind::Nothing && o.case.disturbance == disturbance);
            board.row(&format!("nothing hidden{of}: nothing found"), &nothing, |o| o.verdict == Verdict::None);
        }
        for size in ["large", "medium", "small"] {
            let of_size = |o: &Outcome| o.case.kind() == Kind::Single && o.case.size == size;
            let single = group(&|o| of_size(o) && is_as_asked(o));
            board.row(&format!("one {size} effect: named, and nothing else"), &single, |o| o.named == o.case.effects);
            board.row(&format!("one {size} effect: it or one of its class"), &single, in_class);
            board.sizes(size, &single);
            let other = group(&|o| of_size(o) && !is_as_asked(o));
            let what = format!("one effect that is not to be had {size}, as near as it comes: named, and nothing else");
            board.row(&what, &other, |o| o.named == o.case.effects);
        }
        let pairs = group(&|o| o.case.kind() == Kind::Pairs);
        board.row("two medium effects: both named", &pairs, |o| o.case.effects.iter().all(|id| o.named.contains(id)));
        let outsiders = group(&|o| o.case.kind() == Kind::Outsiders);
        board.row("an effect that is not in the catalogue: unknown", &outsiders, |o| o.verdict == Verdict::Unknown);
        let placed = |o: &Outcome| o.verdict == Verdict::Unknown && o.is_right_place;
        board.row("the same: unknown, on the right equation and joint", &outsiders, placed);
        board.row("the same: another name given", &outsiders, |o| o.verdict == Verdict::Named);
        let strange = |o: &Outcome| o.named.iter().any(|named| !is_of_class(o, named));
        board.row("the same: another name given, and none of its class", &outsiders, strange);
        let set = |names: &[String]| names.iter().cloned().collect::<BTreeSet<_>>();
        let wrong = |o: &&Outcome| {
            if o.case.is_outsider { !o.named.is_empty() } else { set(&o.named) != set(&o.case.effects) }
        };
        board.misses = outcomes.iter().filter(wrong).map(miss).collect();
        board.misses.sort();
        board
    }

    /// Of effects that were named, the medians of every effect's worst parameter and of all parameters, and how many are near the truth.
    fn sizes(&mut self, size: &str, outcomes: &[&Outcome]) {
        let median = |mut errors: Vec<f64>| {
            errors.sort_by(f64::total_cmp);
            errors.get(errors.len() / 2).map(|error| 100.0 * error)
        };
        let of = |outcome: &Outcome| outcome.errors.iter().map(|(_, error)| error.abs()).collect::<Vec<_>>();
        let worst = outcomes.iter().filter_map(|outcome| of(outcome).into_iter().reduce(f64::max)).collect();
        let all: Vec<f64> = outcomes.iter().flat_map(|outcome| of(outcome)).collect();
        let n = all.len();
        let most = if size == "large" { 0.05 } else { 0.15 };
        let near = all.iter().filter(|error| **error < most).count();
        if let (Some(worst), Some(all)) = (median(worst), median(all)) {
            let line = format!("{size}: half of {n} parameters are off by less than {all:.2} %, {near} by less than");
            self.sizes
                .push(format!("{line} {:.0} %, half of all effects in none by more than {worst:.2} %", 100.0 * most));
        }
    }

    fn row(&mut self, what: &str, outcomes: &[&Outcome], is_hit: impl Fn(&Outcome) -> bool) {
        self.rows.push((what.to_string(), outcomes.iter().filter(|o| is_hit(o)).count(), outcomes.len()));
    }
}

/// Whether the motion tells as much of what was hidden as its size means. Some effects are met or not: at the least that is met they tell thousands.
fn is_as_asked(outcome: &Outcome) -> bool {
    let off = |sized: &Sized| (sized.margin / asked(&outcome.case.size)).ln().abs();
    outcome.sized.iter().all(|sized| off(sized) < AS_ASKED.ln())
}

/// Whether what was hidden was named, or something that the catalogue or the motion cannot tell from it.
fn in_class(outcome: &Outcome) -> bool {
    outcome.named.first().is_some_and(|named| is_of_class(outcome, named))
}

/// Whether a name is that of what was hidden, or of something that the catalogue or the motion cannot tell from it.
fn is_of_class(outcome: &Outcome, named: &str) -> bool {
    let Some(hidden) = outcome.case.effects.first() else { return false };
    let confounded =
        |id: &str, with: &str| Effect::by_id(id).is_ok_and(|effect| effect.confounded_with.contains(&with));
    named == hidden || outcome.aliases.contains(hidden) || confounded(hidden, named) || confounded(named, hidden)
}

fn miss(outcome: &Outcome) -> String {
    let case = &outcome.case;
    let hidden = if case.effects.is_empty() { "nothing".to_string() } else { case.effects.join(" and ") };
    let of = match case.disturbance {
        _ if case.is_outsider => ", not in the catalogue",
        Disturbance::Nothing => "",
        Disturbance::JitteredStamps => " but stamps that jitter",
        Disturbance::ColouredNoise => " but coloured noise",
    };
    let said = if outcome.named.is_empty() { String::new() } else { format!(" ({})", outcome.named.join(", ")) };
    let verdict = format!("{:?}", outcome.verdict).to_lowercase();
    format!("{hidden}{of}, {}, seed {}: {verdict}{said}", case.size, case.seed)
}

impl fmt::Display for Scoreboard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "| hidden | cases | share | 95 % interval |")?;
        writeln!(f, "|---|---|---|---|")?;
        for (what, hits, n) in self.rows.iter().filter(|(_, _, n)| *n > 0) {
            let [low, high] = wilson(*hits, *n).map(|share| 100.0 * share);
            let share = 100.0 * *hits as f64 / *n as f64;
            writeln!(f, "| {what} | {hits} of {n} | {share:.0} % | {low:.0}–{high:.0} % |")?;
        }
        if !self.sizes.is_empty() {
            writeln!(f)?;
            self.sizes.iter().try_for_each(|line| writeln!(f, "* {line}"))?;
        }
        if !self.misses.is_empty() {
            writeln!(f, "\nOther answers than what was hidden:")?;
            self.misses.iter().try_for_each(|line| writeln!(f, "* {line}"))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn effects_that_cannot_be_had_of_a_size_have_a_row_of_their_own() {
        let line = r#"{"case":{"effects":["backlash"],"size":"medium","is_outsider":false,"seed":1,"sizes":"information"},
            "verdict":"unknown","named":[],"aliases":[],"place":null,"is_right_place":true,"errors":[],"seconds":1.0,
            "sized":[{"level":-14.0,"margin":1584.0}]}"#;
        let far: Outcome = serde_json::from_str(line).unwrap();
        let mut near = far.clone();
        (near.sized[0].margin, near.named) = (110.0, near.case.effects.clone());
        let board = Scoreboard::of(&[far, near]).to_string();
        assert!(board.contains("| one medium effect: named, and nothing else | 1 of 1 |"), "{board}");
        assert!(
            board.contains("not to be had medium, as near as it comes: named, and nothing else | 0 of 1 |"),
            "{board}"
        );
    }

    #[test]
    fn intervals_of_shares_are_those_of_tables() {
        // Newcombe 1998, table I: 81 of 263, 15 of 148, 0 of 20, 1 of 29 (method 3).
        let table = [
            (81, 263, [0.2553, 0.3662]),
            (15, 148, [0.0624, 0.1605]),
            (0, 20, [0.0, 0.1611]),
            (1, 29, [0.0061, 0.1718]),
        ];
        for (hits, n, [low, high]) in table {
            let [a, b] = wilson(hits, n);
            assert!((a - low).abs() < 5e-5 && (b - high).abs() < 5e-5, "{hits} of {n}: {a} {b}");
        }
    }
}
