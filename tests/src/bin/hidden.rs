//! How often the diagnosis finds what is hidden: the whole catalogue at three sizes, nothing, pairs, and what the catalogue does not hold.
//!
//! ```sh
//! cargo run --release -p tests --bin hidden                                  # one robot a case
//! cargo run --release -p tests --bin hidden -- --seeds 5 --only medium       # five, of one size only
//! cargo run --release -p tests --bin hidden -- --effects stribeck,cogging    # cases with one of these in it
//! cargo run --release -p tests --bin hidden -- --kind pairs                  # of single, pairs, outsiders and nothing
//! cargo run --release -p tests --bin hidden -- --sizes information           # as large as the recording tells so much, not as on machines
//! cargo run --release -p tests --bin hidden -- --nothing 200                 # nothing hidden, stamps that jitter and coloured noise among them
//! ```
//!
//! `--log debug` tells how a case came out as it did. Appends a line of JSON a case to a file and leaves out those that it holds already: it may be stopped and started again.

use std::process::ExitCode;

use host::effect::Effect;
use tests::hidden::{Kind, Scoreboard, Sizes, cases, nothing, study};
use tests::study::Arguments;
use tracing_subscriber::filter::LevelFilter;

const USAGE: &str = "hidden [--seeds N | --nothing N] [--first SEED] [--only small|medium|large] [--effects ID,…] [--kind single|pairs|outsiders|nothing] [--sizes catalogue|information] [--workers N] [--out FILE.jsonl] [--log LEVEL]";

fn main() -> ExitCode {
    let (mut seeds, mut clean, mut sizes) = (1_u64, None, Sizes::Catalogue);
    let (mut only, mut kind, mut effects) = (None, None, Vec::new());
    let understood = Arguments::read(USAGE, "hidden.jsonl", |name, value| match name {
        "--nothing" => value.parse().map(|n| clean = Some(n)).is_ok(),
        "--seeds" => value.parse().map(|n| seeds = n).is_ok(),
        "--only" if ["small", "medium", "large"].contains(&value) => {
            only = Some(value.to_string());
            true
        }
        "--effects" => {
            effects = value.split(',').map(str::to_string).collect();
            effects.iter().all(|id| Effect::by_id(id).is_ok())
        }
        "--kind" => Kind::parse(value).map(|chosen| kind = Some(chosen)).is_some(),
        "--sizes" if ["catalogue", "information"].contains(&value) => {
            sizes = if value == "information" { Sizes::Information } else { Sizes::Catalogue };
            true
        }
        "--log" => value.parse().is_ok_and(|level: LevelFilter| {
            tracing_subscriber::fmt().with_max_level(level).with_target(false).with_writer(std::io::stderr).init();
            true
        }),
        _ => false,
    });
    let Some(Arguments { first, workers, out }) = understood else { return ExitCode::from(2) };
    if clean.is_some() && (only.is_some() || kind.is_some() || !effects.is_empty()) {
        eprintln!("where nothing is hidden there is no effect, no kind and no size to choose\nusage: {USAGE}");
        return ExitCode::from(2);
    }
    let mut cases = clean.map_or_else(|| cases(first, seeds, sizes), |robots| nothing(first, robots));
    cases.retain(|case| only.as_ref().is_none_or(|size| case.size == *size));
    cases.retain(|case| kind.is_none_or(|kind| case.kind() == kind));
    cases.retain(|case| effects.is_empty() || case.effects.iter().any(|id| effects.contains(id)));
    let of = cases.len();
    match study(&out, &cases, workers, |done| eprint!("\r{done} of {of}")) {
        Ok(outcomes) => {
            eprintln!();
            let mut seconds: Vec<f64> = outcomes.iter().map(|outcome| outcome.seconds).collect();
            seconds.sort_by(f64::total_cmp);
            let median = seconds.get(seconds.len() / 2).copied().unwrap_or(f64::NAN);
            println!("{} cases, a diagnosis takes {median:.0} s on one thread (median)\n", outcomes.len());
            print!("{}", Scoreboard::of(&outcomes));
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("{}: {error}", out.display());
            ExitCode::from(3)
        }
    }
}
