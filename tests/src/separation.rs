//! How much more a planned motion tells of effects that look alike, pair by pair of the catalogue.
//!
//! ```text
//!   confounded_with ─▶ pairs of effects ─▶ host plan --separate A,B ─▶ information of each size, planned over preset
//! ```

use std::collections::BTreeSet;
use std::fmt;
use std::path::Path;
use std::time::Instant;

use host::effect::{CATALOGUE, Effect};
use host::plan::{Belief, ExpectedError, Settings, plan};
use host::robot::Robot;
use serde::{Deserialize, Serialize};

use crate::study::resume;

/// What a plan for one pair tells.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Outcome {
    /// The ids.
    pub pair: [String; 2],
    /// Sizes of both with their expected errors; or why no motion can be planned.
    pub sizes: Result<Vec<ExpectedError>, String>,
    /// Time of the plan, s.
    pub seconds: f64,
}

/// Pairs that the catalogue says look alike, each once.
pub fn pairs() -> Vec<[&'static Effect; 2]> {
    let mut seen = BTreeSet::new();
    let of_effect = |one: &'static Effect| {
        let others = one.confounded_with.iter().filter_map(|id| Effect::by_id(id).ok());
        others.map(move |other| if one.id < other.id { [one, other] } else { [other, one] })
    };
    CATALOGUE.into_iter().flat_map(of_effect).filter(|pair| seen.insert(pair.map(|effect| effect.id))).collect()
}

/// Plans a motion for every pair on the built-in three-joint robot, with so many rounds of search.
///
/// # Errors
/// If the file cannot be read or written.
///
/// # Panics
/// If the built-in robot cannot be read.
pub fn study(
    file: &Path,
    rounds: usize,
    workers: usize,
    progress: impl Fn(u64) + Sync,
) -> std::io::Result<Vec<Outcome>> {
    let belief = Belief::of_description(Robot::builtin("doggy").expect("the built-in robot is valid"));
    let is_of =
        |pair: &[&Effect; 2], outcome: &Outcome| pair.map(|effect| effect.id) == [&*outcome.pair[0], &*outcome.pair[1]];
    let make = |pair: &[&'static Effect; 2]| {
        let settings =
            Settings { parameters: false, effects: pair.to_vec(), rounds, threads: 1, ..Settings::default() };
        let began = Instant::now();
        let planned = plan(&belief, &settings, &|_| {}, &|| true);
        Outcome {
            pair: pair.map(|effect| effect.id.to_owned()),
            sizes: planned.map(|plan| plan.sizes).map_err(|error| error.to_string()),
            seconds: began.elapsed().as_secs_f64(),
        }
    };
    resume(file, &pairs(), is_of, workers, make, progress)
}

/// A table of outcomes.
#[derive(Debug)]
pub struct Table<'a>(pub &'a [Outcome]);

impl fmt::Display for Table<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "| pair | least of the sizes by the preset, standard errors | by the plan | information, least ratio | largest | s |"
        )?;
        writeln!(f, "|---|---|---|---|---|---|")?;
        let (mut planned, mut tenfold) = (0, 0);
        for outcome in self.0 {
            let pair = outcome.pair.join(", ");
            match &outcome.sizes {
                Err(why) => writeln!(f, "| {pair} | {why} | | | | |")?,
                Ok(sizes) => {
                    let seen = |of: &dyn Fn(&ExpectedError) -> Option<f64>| {
                        let errors = sizes.iter().map(|size| of(size).map_or(0.0, |error| (size.value / error).abs()));
                        errors.fold(f64::INFINITY, f64::min)
                    };
                    let ratios: Vec<f64> =
                        sizes.iter().filter_map(|size| size.ratio).map(|ratio| ratio.powi(-2)).collect();
                    let least = ratios.iter().copied().fold(f64::INFINITY, f64::min);
                    let largest = ratios.iter().copied().fold(0.0, f64::max);
                    planned += 1;
                    tenfold += usize::from(least >= 10.0);
                    let (preset, plan) = (seen(&|size| size.preset_std_error), seen(&|size| size.std_error));
                    writeln!(
                        f,
                        "| {pair} | {preset:.1} | {plan:.1} | {least:.2} | {largest:.2} | {:.0} |",
                        outcome.seconds
                    )?;
                }
            }
        }
        writeln!(f, "\n{planned} pairs planned, {tenfold} with ten times the information on every size")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pair_stands_once_and_in_one_order() {
        let pairs = pairs();
        let ids: BTreeSet<[&str; 2]> = pairs.iter().map(|pair| pair.map(|effect| effect.id)).collect();
        assert_eq!(ids.len(), pairs.len());
        assert!(ids.iter().all(|[one, other]| one < other && !ids.contains(&[*other, *one])));
        assert!(ids.contains(&["backlash", "belt_hysteresis"]));
    }

    #[test]
    fn a_table_tells_ratios_of_information_and_why_there_are_none() {
        let size = |ratio: f64| ExpectedError {
            name: "a".to_owned(),
            unit: "1".to_owned(),
            value: 2.0,
            std_error: Some(0.1),
            preset_std_error: Some(0.1 / ratio),
            ratio: Some(ratio),
            worst_ratio: Some(ratio),
            relative_error: None,
        };
        let pair = ["x".to_owned(), "y".to_owned()];
        let told = Outcome { pair: pair.clone(), sizes: Ok(vec![size(0.5), size(0.25)]), seconds: 1.0 };
        let not = Outcome { pair, sizes: Err("no".to_owned()), seconds: 0.0 };
        let table = Table(&[told, not]).to_string();
        assert!(table.contains("| x, y | 5.0 | 20.0 | 4.00 | 16.00 | 1 |"), "{table}");
        assert!(table.contains("| x, y | no |") && table.contains("1 pairs planned, 0 with ten"), "{table}");
    }
}
