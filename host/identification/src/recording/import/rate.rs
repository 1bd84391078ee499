//! The rows' own period, and which tick each row is.
//!
//! Where steps are whole multiples of one period, as a control loop's are, a longer step is a missing tick. Where they are not,
//! stamps are taken as they are: a step is a gap only where it is far longer than those around it.

use super::TableError;
use crate::robot::TimeUnit;

/// A period that differs from the robot's by a larger factor is another unit of time: units are a factor of 1000 apart,
/// the root of it is 32. At 15, a table at 60 Hz of a robot at 1 kHz would be refused; at 60, milliseconds read as
/// microseconds would pass where the table has the 20th part of the robot's rate.
const ANOTHER_UNIT: f64 = 30.0;
/// The robot's period is the table's where their steps differ by less than this share.
const SAME: f64 = 0.02;
/// A step is a multiple of the period within this share of one. Ticks of a loop jitter by some percent; logs of another clock
/// (10, 10, 12 ms) are off by a fifth. At half of it, a loop whose stamps jitter by a tenth counts as uneven, which costs
/// nothing but the count of its missing ticks; at twice of it, 10, 10, 12 ms count as even.
const MULTIPLE: f64 = 0.15;
/// Share of the steps that have to be multiples.
const MOST: f64 = 0.9;
/// Steps that differ from the period by more than this are not jitter…
const ANOTHER: f64 = 0.2;
/// …if they agree with one another within this,
const ALIKE: f64 = 0.1;
/// and as many follow one another: losses of a link come by chance.
const LEAST_RUN: usize = 20;
/// Steps on either side of one that say what is usual there.
const AROUND: usize = 10;
/// Of uneven steps, one that is so many times longer than nine in ten around it is a gap. Of nine measured logs, eight reach 1.3; the ninth, a
/// loop that stalls, has 96 of 1.5 to 3.6 and nine of 1.2 to 1.5. At 1.2 jitter cuts a log to pieces; at 3 a row that is missing among
/// 10, 10 and 12 ms is not seen.
const GAP: f64 = 1.5;

/// The ticks of a table.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::recording) struct Ticks {
    /// Mean time from row to row where none is missing, s.
    pub period_s: f64,
    /// Number of each row's tick.
    pub seq: Vec<u64>,
    /// Least and greatest step that is no gap, µs.
    steps_us: Option<(f64, f64)>,
}

/// The ticks of rows at `t_us`, which rise; `robot_period_s` is what the robot file says.
///
/// # Errors
/// [`TableError::Rate`] where the times are in another unit.
pub(super) fn ticks(t_us: &[u64], robot_period_s: f64, read_as: TimeUnit) -> Result<Ticks, TableError> {
    let robot_us = robot_period_s * 1e6;
    let steps: Vec<f64> = t_us.windows(2).map(|pair| (pair[1] - pair[0]) as f64).collect();
    let Some(found_us) = median(steps.clone()) else {
        return Ok(Ticks { period_s: robot_period_s, seq: vec![0; t_us.len()], steps_us: None });
    };
    if is_another_unit(found_us, robot_us) {
        let far = |unit: &TimeUnit| (found_us / read_as.us() * unit.us() / robot_us).ln().abs();
        let likely = TimeUnit::ALL.into_iter().min_by(|a, b| far(a).total_cmp(&far(b)));
        let likely = likely.filter(|unit| *unit != read_as && far(unit) < 0.5 * ANOTHER_UNIT.ln());
        return Err(TableError::Rate { found_us, expected_us: robot_us, read_as, likely });
    }
    let own_us = if (found_us / robot_us - 1.0).abs() <= SAME { robot_us } else { found_us };
    let counts: Vec<u64> = match is_even(&steps, own_us) {
        true => steps.iter().map(|step| (step / own_us).round().max(1.0) as u64).collect(),
        false => uneven(&steps),
    };
    let single: Vec<f64> = steps.iter().zip(&counts).filter(|(_, count)| **count == 1).map(|(step, _)| *step).collect();
    let mean_us = single.iter().sum::<f64>() / single.len().max(1) as f64;
    let keeps_robot = single.is_empty() || (mean_us / robot_us - 1.0).abs() <= SAME && own_us == robot_us;
    let mut seq = vec![0];
    for count in counts {
        seq.push(seq[seq.len() - 1] + count);
    }
    let range = single.iter().fold(None, |range: Option<(f64, f64)>, &step| match range {
        None => Some((step, step)),
        Some((low, high)) => Some((low.min(step), high.max(step))),
    });
    Ok(Ticks { period_s: if keeps_robot { robot_period_s } else { mean_us * 1e-6 }, seq, steps_us: range })
}

impl Ticks {
    /// What people should know of a table that has not the robot file's rate.
    pub(super) fn note(&self, robot_period_s: f64) -> Option<String> {
        let (low, high) = self.steps_us?;
        if self.period_s == robot_period_s {
            return None;
        }
        let steps = match high / low - 1.0 > ALIKE {
            true => format!("{low:.0} to {high:.0} µs apart, {:.1} in the mean", self.period_s * 1e6),
            false => format!("{:.1} µs apart", self.period_s * 1e6),
        };
        let robot_us = robot_period_s * 1e6;
        Some(format!("rows are {steps} (the robot file says {robot_us:.1} µs): each is taken at its own stamp"))
    }
}

/// Whether a period can only be a robot's in another unit of time; both in the same unit.
pub(in crate::recording) fn is_another_unit(found: f64, robots: f64) -> bool {
    (found / robots).ln().abs() > ANOTHER_UNIT.ln()
}

fn median(mut steps: Vec<f64>) -> Option<f64> {
    let middle = steps.len() / 2;
    (!steps.is_empty()).then(|| *steps.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// Whether steps are multiples of the period, with no part of the table at another rate.
fn is_even(steps: &[f64], period_us: f64) -> bool {
    let is_multiple = |step: &&f64| {
        let ratio = **step / period_us;
        (ratio - ratio.round().max(1.0)).abs() <= MULTIPLE
    };
    if (steps.iter().filter(is_multiple).count() as f64) < MOST * steps.len() as f64 {
        return false;
    }
    let mut run = 0..0;
    for (k, &step) in steps.iter().enumerate() {
        let other = (step / period_us - 1.0).abs() > ANOTHER;
        let goes_on = other && !run.is_empty() && (step / steps[run.start] - 1.0).abs() <= ALIKE;
        run = match (goes_on, other) {
            (true, _) => run.start..k + 1,
            (false, true) => k..k + 1,
            (false, false) => k..k,
        };
        if run.len() >= LEAST_RUN {
            return false;
        }
    }
    true
}

/// Ticks that each of uneven steps takes.
fn uneven(steps: &[f64]) -> Vec<u64> {
    let mut around = Vec::new();
    let mut count = |k: usize| {
        around.clear();
        around.extend_from_slice(&steps[k.saturating_sub(AROUND)..(k + AROUND + 1).min(steps.len())]);
        around.sort_by(f64::total_cmp);
        let nine_in_ten = around[(around.len() - 1) * 9 / 10];
        match steps[k] > GAP * nine_in_ten {
            true => (steps[k] / around[around.len() / 2]).round().max(2.0) as u64,
            false => 1,
        }
    };
    (0..steps.len()).map(&mut count).collect()
}
