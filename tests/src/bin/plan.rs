//! What planned motions gain. Simulated Doggies, each calibrated on the preset motion, then on that again and on one planned for it.
//!
//! ```sh
//! cargo run --release -p tests --bin plan                     # 20 robots
//! cargo run --release -p tests --bin plan -- --robots 200
//! ```
//!
//! Appends a line of JSON a robot to a file and leaves out those that it holds already: it may be stopped and started again.

use std::process::ExitCode;

use tests::planned::{Case, Told, study};
use tests::study::Arguments;

const USAGE: &str = "plan [--robots N] [--first SEED] [--workers N] [--out FILE.jsonl]";

fn main() -> ExitCode {
    let mut robots = 20_u64;
    let understood = Arguments::read(USAGE, "planned.jsonl", |name, value| match name {
        "--robots" => value.parse().map(|n| robots = n).is_ok(),
        _ => false,
    });
    let Some(Arguments { first, workers, out }) = understood else { return ExitCode::from(2) };
    let cases: Vec<Case> = (first..first + robots).map(|seed| Case { seed }).collect();
    let outcomes = match study(&out, &cases, workers, |done| eprintln!("{done} of {}", cases.len())) {
        Ok(outcomes) => outcomes,
        Err(error) => {
            eprintln!("{}: {error}", out.display());
            return ExitCode::from(3);
        }
    };
    let stopped: Vec<&str> = outcomes.iter().map(|o| o.end.as_str()).filter(|end| *end != "finished").collect();
    let nearest = outcomes.iter().fold(0.0_f32, |most, outcome| most.max(outcome.watch));
    println!(
        "{} robots, {} planned motions stopped {stopped:?}, watches at {nearest:.2} of their bounds",
        outcomes.len(),
        stopped.len()
    );
    let longer = outcomes.iter().map(|o| o.duration_s[1] / o.duration_s[0]);
    println!("length as a part of the preset's: {}", spread(longer.collect()));
    let largest = |of: fn(&Told) -> [f64; 2]| {
        let ratios = outcomes.iter().map(|outcome| {
            let most = |i: usize| outcome.told.iter().fold(0.0_f64, |most, told| most.max(of(told)[i].abs()));
            most(1) / most(0)
        });
        spread(ratios.collect())
    };
    println!("largest relative standard error, planned over preset: {}", largest(|told| told.std_error));
    println!("largest relative error against the truth, planned over preset: {}", largest(|told| told.off));
    println!(
        "| parameter | standard error, planned over preset | error against the truth, rms over robots, preset | planned | standard error over the promised |"
    );
    println!("|---|---|---|---|---|");
    let names: Vec<&str> =
        outcomes.first().into_iter().flat_map(|o| o.told.iter().map(|told| told.name.as_str())).collect();
    for name in names {
        let of_it: Vec<&Told> = outcomes.iter().flat_map(|o| &o.told).filter(|told| told.name == name).collect();
        let rms =
            |i: usize| (of_it.iter().map(|told| told.off[i] * told.off[i]).sum::<f64>() / of_it.len() as f64).sqrt();
        println!(
            "| {name} | {} | {:.3} % | {:.3} % | {} |",
            spread(of_it.iter().map(|told| told.std_error[1] / told.std_error[0]).collect()),
            100.0 * rms(0),
            100.0 * rms(1),
            spread(of_it.iter().map(|told| told.std_error[1] / told.promised).collect()),
        );
    }
    ExitCode::SUCCESS
}

/// Median, with the least and the most.
fn spread(mut values: Vec<f64>) -> String {
    values.sort_by(f64::total_cmp);
    let at = |place: usize| values.get(place).copied().unwrap_or(f64::NAN);
    format!("{:.2} ({:.2} to {:.2})", at(values.len() / 2), at(0), at(values.len().saturating_sub(1)))
}
