//! How often the firmware's safety stops a robot that has nothing.
//!
//! ```sh
//! cargo run --release -p tests --bin healthy                     # 200 robots drawn at random, each plays the calibration
//! cargo run --release -p tests --bin healthy -- --effects 1      # one robot with each effect of the catalogue, medium and large
//! ```
//!
//! Appends a line of JSON a robot to a file and leaves out those that it holds already: it may be stopped and started again.
//! Ends with 1 if a healthy robot was stopped.

use std::process::ExitCode;

use tests::healthy::{Outcome, healthy, study, with_effects};
use tests::study::Arguments;

const USAGE: &str = "healthy [--robots N] [--effects SEED] [--first SEED] [--workers N] [--out FILE.jsonl]";

fn main() -> ExitCode {
    let (mut robots, mut effects) = (200_u64, None);
    let understood = Arguments::read(USAGE, "healthy.jsonl", |name, value| match name {
        "--robots" => value.parse().map(|n| robots = n).is_ok(),
        "--effects" => value.parse().map(|seed| effects = Some(seed)).is_ok(),
        _ => false,
    });
    let Arguments { first, workers, out } = match understood {
        Ok(arguments) => arguments,
        Err(text) => {
            eprintln!("{text}");
            return ExitCode::from(2);
        }
    };
    let cases = match effects {
        Some(seed) => with_effects(seed),
        None => healthy(first, robots),
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
        println!("seed {}, {effect}: {end}, after {after_s:.1} s", case.seed);
    }
    let stopped = outcomes.iter().filter(|outcome| !outcome.finished()).count();
    println!("{stopped} of {} calibrations were stopped", outcomes.len());
    for (watch, what) in ["encoder stands", "joint against its duty", "gyro against encoders"].iter().enumerate() {
        let largest = outcomes.iter().filter(|outcome| outcome.finished()).map(|outcome| outcome.nearest[watch]);
        println!("{what}: at most {:.3} of its bound in those that were not", largest.fold(0.0, f32::max));
    }
    ExitCode::from(u8::from(effects.is_none() && stopped > 0))
}
