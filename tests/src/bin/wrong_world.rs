//! The wrong-world study: robots with a main effect, trace effects, unmodelled torque, wrong fixed parameters and other friction laws, in four
//! families.
//!
//! ```sh
//! cargo run --release -p tests --bin wrong_world                                     # one robot a case
//! cargo run --release -p tests --bin wrong_world -- --family rigid --seeds 5         # of doggy, rigid, elastic2 and arm
//! cargo run --release -p tests --bin wrong_world -- --kind null --seeds 20           # of main, null and outsider
//! cargo run --release -p tests --bin wrong_world -- --size medium --effects stribeck # large, medium or weak; these main effects or outsiders
//! ```
//!
//! `--log debug` tells how a case came out as it did. Appends a line of JSON a case to a file and leaves out those that it holds already: it may be stopped and started again.

use std::process::ExitCode;

use tests::study::Arguments;
use tests::wrong_world::effect::Size;
use tests::wrong_world::family::Family;
use tests::wrong_world::{Kind, Main, Scoreboard, cases, study};
use tracing_subscriber::filter::LevelFilter;

const USAGE: &str = "wrong_world [--family doggy|rigid|elastic2|arm] [--kind main|null|outsider] [--size large|medium|weak] [--effects ID,…] [--seeds N] [--first SEED] [--workers N] [--out FILE.jsonl] [--log LEVEL]";

fn main() -> ExitCode {
    let (mut seeds, mut family, mut kind, mut size, mut effects) = (1_u64, None, None, None, Vec::<String>::new());
    let understood = Arguments::read(USAGE, "wrong_world.jsonl", |name, value| match name {
        "--seeds" => value.parse().map(|n| seeds = n).is_ok(),
        "--family" => Family::parse(value).map(|chosen| family = Some(chosen)).is_some(),
        "--kind" => Kind::parse(value).map(|chosen| kind = Some(chosen)).is_some(),
        "--size" => Size::parse(value).map(|chosen| size = Some(chosen)).is_some(),
        "--effects" => {
            effects = value.split(',').map(str::to_string).collect();
            true
        }
        "--log" => value.parse().is_ok_and(|level: LevelFilter| {
            tracing_subscriber::fmt().with_max_level(level).with_target(false).with_writer(std::io::stderr).init();
            true
        }),
        _ => false,
    });
    let Some(Arguments { first, workers, out }) = understood else { return ExitCode::from(2) };
    let mut cases = cases(first, seeds);
    cases.retain(|case| family.is_none_or(|family| case.family == family));
    cases.retain(|case| kind.is_none_or(|kind| case.kind() == kind));
    cases.retain(|case| size.is_none_or(|size| case.size == size));
    let name = |main: &Main| match main {
        Main::None => String::new(),
        Main::Effect(id) => id.clone(),
        Main::Outsider(kind) => kind.name(),
    };
    cases.retain(|case| effects.is_empty() || effects.contains(&name(&case.main)));
    if cases.is_empty() {
        eprintln!("no case of the study is meant by this\nusage: {USAGE}");
        return ExitCode::from(2);
    }
    let of = cases.len();
    match study(&out, &cases, workers, |done| eprint!("\r{done} of {of}")) {
        Ok(outcomes) => {
            eprintln!();
            print!("{}", Scoreboard::of(&outcomes));
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("\n{}: {error}", out.display());
            ExitCode::FAILURE
        }
    }
}
