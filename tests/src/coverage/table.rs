//! Outcomes counted: coverage and bias, each with the band that chance leaves it.

use std::fmt;
use std::ops::RangeInclusive;

use super::{Distance, Found, Outcome, binomial_band, chi_square_quantile};

/// The level of the intervals.
const INTERVAL: f64 = 0.95;
/// Half width of an interval, standard errors.
const HALF_WIDTH: f64 = 1.959_964;
/// The level of the bands.
const BAND: f64 = 0.999;

/// One parameter, or several together, over all recordings.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Parameter, or what is counted together.
    pub name: String,
    /// Intervals.
    pub intervals: u64,
    /// Those that hold the truth.
    pub covering: u64,
    /// Mean error in standard errors, for a single parameter.
    pub bias: Option<f64>,
    /// Root mean square of the error in standard errors: 1 if they are right.
    pub spread: f64,
}

/// The count of a study.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// Recordings.
    pub recordings: usize,
    /// Every parameter, then "dynamics together" and "all together": whether the joint 95 % ellipsoid holds the truth.
    pub rows: Vec<Row>,
}

impl Row {
    /// Share of the intervals that hold the truth.
    pub fn coverage(&self) -> f64 {
        self.covering as f64 / self.intervals as f64
    }

    /// Where the count lies in 99.9 % of studies if intervals tell the truth.
    pub fn band(&self) -> RangeInclusive<u64> {
        binomial_band(self.intervals, INTERVAL, BAND)
    }

    fn of_parameter(name: &str, found: &[&Found]) -> Self {
        let n = found.len() as f64;
        Row {
            name: name.to_owned(),
            intervals: found.len() as u64,
            covering: found.iter().filter(|found| found.z().abs() <= HALF_WIDTH).count() as u64,
            bias: Some(found.iter().map(|found| found.z()).sum::<f64>() / n),
            spread: (found.iter().map(|found| found.z().powi(2)).sum::<f64>() / n).sqrt(),
        }
    }

    fn of_ellipsoid(name: &str, distances: &[Distance]) -> Self {
        let holds = |d: &&Distance| d.chi2 <= chi_square_quantile(d.parameters as f64, INTERVAL);
        let parameters: usize = distances.iter().map(|d| d.parameters).sum();
        Row {
            name: name.to_owned(),
            intervals: distances.len() as u64,
            covering: distances.iter().filter(holds).count() as u64,
            bias: None,
            spread: (distances.iter().map(|d| d.chi2).sum::<f64>() / parameters as f64).sqrt(),
        }
    }
}

impl Table {
    /// Counts outcomes.
    pub fn of(outcomes: &[Outcome]) -> Self {
        let names: Vec<&String> =
            outcomes.first().map_or(Vec::new(), |outcome| outcome.parameters.iter().map(|found| &found.name).collect());
        let mut rows: Vec<Row> = names
            .into_iter()
            .map(|name| {
                let all = outcomes.iter().flat_map(|outcome| &outcome.parameters);
                let found: Vec<&Found> = all.filter(|found| found.name == *name).collect();
                Row::of_parameter(name, &found)
            })
            .collect();
        for (name, distance) in [
            ("dynamics together", (|outcome| outcome.dynamics) as fn(&Outcome) -> Distance),
            ("all together", |outcome| outcome.all),
        ] {
            rows.push(Row::of_ellipsoid(name, &outcomes.iter().map(distance).collect::<Vec<_>>()));
        }
        Table { recordings: outcomes.len(), rows }
    }

    /// A row by name.
    pub fn row(&self, name: &str) -> Option<&Row> {
        self.rows.iter().find(|row| row.name == name)
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "| parameter | 95 % intervals that hold the truth | band 99.9 % | bias / σ | rms / σ |")?;
        writeln!(f, "|---|---|---|---|---|")?;
        for row in &self.rows {
            let band = row.band();
            let mark = if band.contains(&row.covering) { "" } else { " (outside)" };
            let bias = row.bias.map_or(String::new(), |bias| format!("{bias:+.3}"));
            writeln!(
                f,
                "| {} | {} of {}, {:.1} %{mark} | {}–{} | {bias} | {:.3} |",
                row.name,
                row.covering,
                row.intervals,
                100.0 * row.coverage(),
                band.start(),
                band.end(),
                row.spread
            )?;
        }
        Ok(())
    }
}
