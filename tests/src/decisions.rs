//! What half and twice of a deciding constant would have decided otherwise, from the debug logs of diagnoses.
//!
//! ```text
//!   hidden --log debug 2> LOG ─▶ lines of scans, additions, coverage, drops ─▶ decisions ─▶ one row a constant
//! ```
//! Each decision is taken again by itself, with all that came before it as it was: what follows from another decision is not told.

use std::fmt;

use host::diagnose::criteria::{COVERED, LEVEL, PROMISING, REFITTED, SIEVE, WEIGHT};
use host::diagnose::p_of_family;
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// A law of a scan.
struct Scanned {
    effect: String,
    score: f64,
    freedom: usize,
}

/// What a log tells of the decisions in it.
#[derive(Default)]
pub struct Decisions {
    /// Gain of a law over that of the best curve which stands for it.
    covered: Vec<f64>,
    /// p of laws that are asked whether the others predict as well without them.
    needed: Vec<f64>,
    /// Weights of accepted laws among their rivals.
    weights: Vec<f64>,
    /// Of accepted laws, the score over that of the best of the scan.
    shares_of_best: Vec<f64>,
    /// And its place in the scan, from 0.
    ranks: Vec<usize>,
    /// And the p of its score in white noise.
    sieved: Vec<f64>,
}

/// The number or text behind `name=`.
fn field<'a>(line: &'a str, name: &str) -> Option<&'a str> {
    let from = line.find(&format!(" {name}="))? + name.len() + 2;
    line[from..].split_whitespace().next().map(|value| value.trim_matches('"'))
}

/// Without the codes that terminals colour by.
fn without_colours(log: &str) -> String {
    let mut parts = log.split("\x1b[");
    let first = parts.next().unwrap_or_default().to_string();
    parts.fold(first, |text, part| text + part.split_once('m').map_or(part, |(_, rest)| rest))
}

fn number(line: &str, name: &str) -> Option<f64> {
    field(line, name)?.parse().ok()
}

impl Decisions {
    /// Of the lines of a log, of one diagnosis after the other.
    pub fn of(log: &str) -> Self {
        let log = without_colours(log);
        let mut decisions = Self::default();
        let mut scan: Vec<Scanned> = Vec::new();
        let mut is_scan_over = true;
        for line in log.lines() {
            if line.contains(" scan effect=") {
                if std::mem::take(&mut is_scan_over) {
                    scan.clear();
                }
                let scanned = (field(line, "effect"), number(line, "score"), number(line, "freedom"));
                if let (Some(effect), Some(score), Some(freedom)) = scanned {
                    scan.push(Scanned { effect: effect.to_string(), score, freedom: freedom as usize });
                }
                continue;
            }
            is_scan_over = true;
            if line.contains(" covered? ") {
                let curve = ["tangent", "refitted"].iter().filter_map(|name| number(line, name)).fold(0.0, f64::max);
                decisions.covered.extend(number(line, "own").map(|own| own / curve));
            } else if line.contains(" drop? ") {
                decisions.needed.extend(number(line, "p"));
            } else if line.contains(" accepted effect=") {
                decisions.weights.extend(number(line, "weight"));
                let place = scan.iter().position(|scanned| field(line, "effect") == Some(&scanned.effect));
                if let Some(place) = place {
                    let best = scan.iter().map(|scanned| scanned.score).fold(0.0, f64::max);
                    decisions.shares_of_best.push(scan[place].score / best);
                    decisions.ranks.push(place);
                    // The catalogue has about so many laws.
                    let noise = ChiSquared::new(scan[place].freedom.max(1) as f64);
                    let alone = noise.map_or(1.0, |noise| noise.sf(scan[place].score));
                    decisions.sieved.push(p_of_family(alone, host::effect::CATALOGUE.len()));
                }
            }
        }
        decisions
    }
}

impl fmt::Display for Decisions {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let count = |of: &[f64], passes: &dyn Fn(f64) -> bool| of.iter().filter(|value| passes(**value)).count();
        writeln!(f, "| constant | value | question | decisions | yes | at half | at twice |")?;
        writeln!(f, "|---|---|---|---|---|---|---|")?;
        let mut row = |name: &str, value: f64, question: &str, of: usize, yes: &dyn Fn(f64) -> usize| {
            let [own, half, twice] = [1.0, 0.5, 2.0].map(|times| yes(times * value));
            writeln!(f, "| `{name}` | {value} | {question} | {of} | {own} | {half} | {twice} |")
        };
        let covered = |least: f64| count(&self.covered, &|share| share >= least);
        row("COVERED", COVERED, "gains enough beside the best curve", self.covered.len(), &covered)?;
        let needed = |level: f64| count(&self.needed, &|p| p < level);
        row("LEVEL", LEVEL, "the others predict worse without it", self.needed.len(), &needed)?;
        let named = |least: f64| count(&self.weights, &|weight| weight >= least.min(1.0));
        row("WEIGHT", WEIGHT, "the name goes to one law", self.weights.len(), &named)?;
        let promising = |least: f64| count(&self.shares_of_best, &|share| share >= least);
        row("PROMISING", PROMISING, "an accepted law was refitted", self.shares_of_best.len(), &promising)?;
        let refitted = |most: f64| self.ranks.iter().filter(|rank| (**rank as f64) < most.floor()).count();
        row("REFITTED", REFITTED as f64, "an accepted law was refitted", self.ranks.len(), &refitted)?;
        let sieved = |level: f64| count(&self.sieved, &|p| p < level);
        row("SIEVE", SIEVE, "an accepted law was refitted", self.sieved.len(), &sieved)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decisions_are_taken_again_at_half_and_twice() {
        let log = r#"T DEBUG scan effect="stribeck" gain=900.0 score=1000.0 freedom=3 p=0.001
T DEBUG scan effect="cogging" gain=90.0 score=150.0 freedom=6 p=0.2
T DEBUG supported? effect="cogging" gain=140.0 ci95=Some([100.0, 180.0]) p=0.001 gains=[1, 2]
T DEBUG covered? effect="cogging" own=140.0 tangent=200.0 refitted=233.3
T DEBUG accepted effect="cogging" weight=0.95
T DEBUG drop? effect="cogging" lost=120.0 ci95=Some([90.0, 150.0]) p=0.007
"#;
        let coloured = log.replace("DEBUG", "\x1b[34mDEBUG\x1b[0m").replace("effect=", "\x1b[3meffect\x1b[0m=");
        let table = Decisions::of(&coloured).to_string();
        let of = |name: &str| -> Vec<String> {
            let line = table.lines().find(|line| line.contains(name)).unwrap_or_else(|| panic!("{name}: {table}"));
            line.split('|').map(|cell| cell.trim().to_string()).skip(4).take(4).collect()
        };
        assert_eq!(of("COVERED"), ["1", "1", "1", "0"]);
        assert_eq!(of("LEVEL"), ["1", "1", "0", "1"]);
        assert_eq!(of("WEIGHT"), ["1", "1", "1", "0"]);
        assert_eq!(of("PROMISING"), ["1", "1", "1", "0"]);
        assert_eq!(of("REFITTED"), ["1", "1", "1", "1"]);
    }
}
