//! Is the observer as sure as it says? Simulated Doggies, each calibrated on one motion and observed on another.
//!
//! ```sh
//! cargo run --release -p tests --bin observed                          # 200 robots with process noise
//! cargo run --release -p tests --bin observed -- --process-noise 0
//! ```
//!
//! Appends a line of JSON a robot to a file and leaves out those that it holds already: it may be stopped and started again.

use std::process::ExitCode;

use host::observe::Consistency;
use tests::observed::{Case, Observed, study};
use tests::study::Arguments;

const USAGE: &str = "observed [--robots N] [--process-noise SIZE] [--first SEED] [--workers N] [--out FILE.jsonl]";

fn main() -> ExitCode {
    let (mut robots, mut process_noise) = (200_u64, 1.0_f64);
    let understood = Arguments::read(USAGE, "observed.jsonl", |name, value| match name {
        "--robots" => value.parse().map(|n| robots = n).is_ok(),
        "--process-noise" => value.parse().map(|size| process_noise = size).is_ok(),
        _ => false,
    });
    let Some(Arguments { first, workers, out }) = understood else { return ExitCode::from(2) };
    let cases: Vec<Case> = (first..first + robots).map(|seed| Case { seed, process_noise }).collect();
    let outcomes = match study(&out, &cases, workers, |done| eprintln!("{done} of {}", cases.len())) {
        Ok(outcomes) => outcomes,
        Err(error) => {
            eprintln!("{}: {error}", out.display());
            return ExitCode::from(3);
        }
    };
    let minutes = outcomes.iter().map(|outcome| outcome.duration_s).sum::<f64>() / 60.0;
    println!("{} robots, {minutes:.1} minutes", outcomes.len());
    println!(
        "| sensors | NIS | within 95 % | NEES | within 95 % | events | largest error over the filter's, median and worst |"
    );
    println!("|---|---|---|---|---|---|---|");
    for sensors in ["both", "encoders", "gyros"] {
        let of_it: Vec<&Observed> =
            outcomes.iter().flat_map(|outcome| &outcome.observed).filter(|found| found.sensors == sensors).collect();
        let events: usize = of_it.iter().map(|found| found.events).sum();
        let mut over: Vec<f64> = of_it.iter().map(|found| found.over_filter).collect();
        over.sort_by(f64::total_cmp);
        let at = |place: usize| over.get(place).copied().unwrap_or(f64::NAN);
        println!(
            "| {sensors} | {} | {} | {events} | {:.3}, {:.3} |",
            told(of_it.iter().filter_map(|found| found.nis)),
            told(of_it.iter().filter_map(|found| found.nees)),
            at(over.len() / 2),
            at(over.len().saturating_sub(1)),
        );
    }
    let mut delays_s: Vec<f64> = outcomes.iter().filter_map(|outcome| outcome.bearing_event_s).collect();
    delays_s.sort_by(f64::total_cmp);
    let in_time = delays_s.iter().filter(|delay_s| (0.0..=1.0).contains(*delay_s)).count();
    let latest_s = delays_s.last().copied().unwrap_or(f64::NAN);
    println!(
        "a hidden bearing: {in_time} of {} events within 1 s of motion, the latest after {latest_s:.3} s",
        outcomes.len()
    );
    // A robot's own share, as the sum over all hides one that is off.
    for sensors in ["both", "encoders", "gyros"] {
        let of_it = || outcomes.iter().flat_map(|outcome| &outcome.observed).filter(|found| found.sensors == sensors);
        println!(
            "{sensors}: robots' shares within 95 %, least and most: NIS {}, NEES {}",
            range(of_it().filter_map(|found| found.nis)),
            range(of_it().filter_map(|found| found.nees)),
        );
    }
    ExitCode::SUCCESS
}

/// Least and largest share of ticks within the band, of one robot.
fn range(found: impl Iterator<Item = Consistency>) -> String {
    let (least, most) =
        found.fold((1.0_f64, 0.0_f64), |(a, b), found| (a.min(found.within_95), b.max(found.within_95)));
    format!("{:.1} to {:.1} %", 100.0 * least, 100.0 * most)
}

/// Mean over all degrees of freedom, and the share of all ticks.
fn told(found: impl Iterator<Item = Consistency>) -> String {
    let (mut dof, mut sum, mut ticks, mut within) = (0.0, 0.0, 0.0, 0.0);
    for found in found {
        dof += found.dof as f64;
        sum += found.mean_per_dof * found.dof as f64;
        ticks += found.ticks as f64;
        within += found.within_95 * found.ticks as f64;
    }
    format!("{:.4} | {:.2} %", sum / dof, 100.0 * within / ticks)
}
