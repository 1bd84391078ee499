//! A seed draws an effect, its size and all true parameters; what was hidden is looked at only after the diagnosis has spoken. The whole
//! catalogue is the study's business (`cargo run --release -p tests --bin hidden`). One of the robots has something that the catalogue of its diagnosis
//! does not hold: a torque that ripples many times a turn, which stiction or a dead band could be taken for.

use host::diagnose::Verdict;
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use tests::hidden::{Case, Disturbance, Outcome, Scoreboard, Sizes, study};

/// The heart of the catalogue.
const CORE: [&str; 16] = [
    "base_bearing",
    "viscous_friction",
    "stribeck",
    "asymmetric_friction",
    "link_friction",
    "cogging",
    "backlash",
    "belt_hardening",
    "belt_hysteresis",
    "gravity_residual",
    "coriolis",
    "link_inertia",
    "voltage_sag",
    "pwm_dead_zone",
    "input_delay",
    "gyro_lag",
];
const DRAWN: usize = 6;
const SEED: u64 = 20;
/// Small is just worth knowing; two levels below it the recording still tells it from its rivals by far.
const SIZES: [&str; 2] = ["small", "@-2"];
/// Filters that are faster than the plant's step can follow are none; stiction has no such size.
const NOT_TINY: [&str; 2] = ["gyro_lag", "stribeck"];

/// What the diagnosis has no name for, and in which robot.
const OUTSIDER: (&str, u64) = ("cogging", 3);

/// Some effects at two sizes, one that has no name, and a robot without any.
fn drawn() -> Vec<Case> {
    let mut effects = CORE;
    effects.shuffle(&mut ChaCha8Rng::seed_from_u64(SEED));
    let case = |effects: Vec<String>, size: &str, seed| Case {
        effects,
        size: size.to_string(),
        is_outsider: false,
        seed,
        disturbance: Disturbance::Nothing,
        sizes: Sizes::Catalogue,
    };
    let hidden = effects.iter().zip(SIZES.iter().cycle()).take(DRAWN).zip(SEED..);
    let hidden = hidden.map(|((effect, size), seed)| {
        let size = if NOT_TINY.contains(effect) { SIZES[0] } else { size };
        case(vec![effect.to_string()], size, seed)
    });
    let (id, seed) = OUTSIDER;
    let outsider = Case { is_outsider: true, ..case(vec![id.to_string()], "large", seed) };
    hidden.chain([outsider, case(Vec::new(), "medium", SEED + 100)]).collect()
}

/// Of the drawn effects, those that have to be named, and the names of what is not there that may be among all findings.
const LEAST_NAMED: usize = 3;
const MOST_FALSE_NAMES: usize = 3;

#[test]
fn most_of_what_is_hidden_is_found() {
    let scratch = tempfile::tempdir().unwrap();
    let outcomes = study(&scratch.path().join("hidden.jsonl"), &drawn(), 2, |_| {}).unwrap();
    eprintln!("{}", Scoreboard::of(&outcomes));
    for outcome in &outcomes {
        eprintln!("{outcome:?}");
    }
    assert_eq!(outcomes.len(), DRAWN + 2);
    let hidden = |outcome: &&Outcome| !outcome.case.effects.is_empty() && !outcome.case.is_outsider;
    let named = outcomes.iter().filter(hidden).filter(|outcome| outcome.named.contains(&outcome.case.effects[0]));
    let is_false = |outcome: &Outcome, name: &String| outcome.case.is_outsider || !outcome.case.effects.contains(name);
    let false_names: Vec<&String> =
        outcomes.iter().flat_map(|outcome| outcome.named.iter().filter(|name| is_false(outcome, name))).collect();
    let named = named.count();
    assert!(named >= LEAST_NAMED, "{named} of {DRAWN} named");
    assert!(false_names.len() <= MOST_FALSE_NAMES, "{false_names:?}");
    let nothing = outcomes.iter().find(|outcome| outcome.case.effects.is_empty()).unwrap();
    assert_eq!((nothing.verdict, nothing.named.len()), (Verdict::None, 0), "{nothing:?}");
}
