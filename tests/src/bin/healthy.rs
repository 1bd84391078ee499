//! How often the firmware's safety stops a robot that has nothing.
//!
//! ```sh
//! cargo run --release -p tests --bin healthy                     # 200 robots of each description drawn at random, each plays its motion
//! cargo run --release -p tests --bin healthy -- --robot arm7     # of one description
//! cargo run --release -p tests --bin healthy -- --effects 1      # Doggy with each effect of the catalogue, medium and large
//! ```
//!
//! Appends a line of JSON a robot to a file and leaves out those that it holds already: it may be stopped and started again.
//! Ends with 1 if a healthy robot was stopped.

use std::process::ExitCode;

use tests::healthy::{Machine, Outcome, healthy, study, with_effects};
use tests::study::Arguments;

const USAGE: &str =
    "healthy [--robot NAME] [--robots N] [--effects SEED] [--first SEED] [--workers N] [--out FILE.jsonl]";

fn main() -> ExitCode {
    let (mut machines, mut robots, mut effects) = (Machine::ALL.to_vec(), 200_u64, None);
    let understood = Arguments::read(USAGE, "healthy.jsonl", |name, value| match name {
        "--robot" => {
            machines.retain(|machine| machine.name() == value);
            !machines.is_empty()
        }
        "--robots" => value.parse().map(|n| robots = n).is_ok(),
        "--effects" => value.parse().map(|seed| effects = Some(seed)).is_ok(),
        _ => false,
    });
    let Some(Arguments { first, workers, out }) = understood else { return ExitCode::from(2) };
    let cases = match effects {
        Some(seed) => with_effects(seed),
        None => machines.iter().flat_map(|machine| healthy(*machine, first, robots)).collect(),
    };
    let outcomes = match study(&out, &cases, workers, |done| eprintln!("{done} of {}", cases.len())) {
        Ok(outcomes) => outcomes,
        Err(error) => {
            eprintln!("{}: {error}", out.display());
            return ExitCode::from(3);
        }
    };
    for Outcome { case, end, after_s, .. } in outcomes.iter().filter(|outcome| !outcome.finished()) {
        let effect = case.effect.as_ref().map_or("nothing hidden".to_owned(), |(id, size)| format!("{id}, {size}"));
        println!("{}, seed {}, {effect}: {end}, after {after_s:.1} s", case.machine.name(), case.seed);
    }
    for machine in machines {
        say(machine, &outcomes);
    }
    let stopped = outcomes.iter().filter(|outcome| !outcome.finished()).count();
    ExitCode::from(u8::from(effects.is_none() && stopped > 0))
}

/// How many robots of a description were stopped, and how near to the bounds of the watches the others came.
fn say(machine: Machine, outcomes: &[Outcome]) {
    let of_it: Vec<&Outcome> = outcomes.iter().filter(|outcome| outcome.case.machine == machine).collect();
    if of_it.is_empty() {
        return;
    }
    let (finished, stopped): (Vec<&Outcome>, Vec<&Outcome>) = of_it.iter().partition(|outcome| outcome.finished());
    println!("{}: {} of {} motions were stopped", machine.name(), stopped.len(), of_it.len());
    for (watch, what) in ["encoder stands", "joint against its duty", "gyro against encoders"].iter().enumerate() {
        let largest = finished.iter().map(|outcome| outcome.nearest[watch]).fold(0.0, f32::max);
        println!("  {what}: at most {largest:.3} of its bound in those that were not");
    }
}
