//! Are the p-values of the diagnosis' scan what they say? Robots with nothing hidden, every law of the catalogue from every start.
//!
//! ```sh
//! cargo run --release -p host --example scan_null -- 60      # sixty robots: the table of the README
//! ```

use std::sync::Arc;
use std::time::Instant;

use host::calibrate::{Preset, fit};
use host::diagnose::criteria::{BLOCKS, SCAN_SAMPLES};
use host::diagnose::{bench, block_scores, p_of_family, score_laws};
use host::effect::{CATALOGUE, Effect};
use host::model::law::Law;
use host::robot::Robot;
use host::simulate::{Direct, Options, SHORT_MOTION};
use solve::levenberg::Settings;

/// The first of the seeds.
const FIRST: u64 = 101;
/// Where the distribution is told.
const LEVELS: [f64; 5] = [0.01, 0.05, 0.1, 0.5, 0.9];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let robots: u64 = std::env::args().nth(1).map_or(Ok(60), |text| text.parse())?;
    let robot = Robot::builtin("doggy")?;
    let of_effect = |effect: &&'static Effect| Some((effect.id, effect.laws(&robot).ok()?));
    let named = CATALOGUE.iter().filter_map(of_effect);
    let named = named.flat_map(|(id, laws)| laws.into_iter().map(move |law| (id, law)));
    let (ids, laws): (Vec<&str>, Vec<Arc<dyn Law>>) = named.unzip();
    // How often each of them is below the least level.
    let mut often = vec![0; laws.len()];
    let (mut all, mut families) = (Vec::new(), Vec::new());
    for seed in FIRST..FIRST + robots {
        let simulated = Direct::record(&Options { seed, ..Options::new(robot.clone()) }, SHORT_MOTION)?;
        let base = fit(&robot, &[&simulated.recording], Preset::Default, &Settings::default(), |_, _| {})?;
        let (bench, trial) = bench(&robot, &base, &Settings::default())?;
        let (bench, trial) = bench.thinned(&trial, SCAN_SAMPLES / BLOCKS);
        let clock = Instant::now();
        let scores = block_scores(&bench, &trial, (&laws, laws.len()))?;
        let seconds = clock.elapsed().as_secs_f64();
        let columns = scores.alone.len();
        let scored = score_laws(&scores, &bench.is_contiguous(), false);
        let of_law: Vec<Option<f64>> = scored.iter().map(|law| Some(law.as_ref().ok()?.as_ref()?.p)).collect();
        for (count, p) in often.iter_mut().zip(&of_law) {
            *count += usize::from(p.is_some_and(|p| p < LEVELS[0]));
        }
        let p: Vec<f64> = of_law.into_iter().flatten().collect();
        let family = p_of_family(p.iter().copied().fold(1.0, f64::min), p.len());
        eprintln!(
            "robot {seed}: {} laws, {columns} columns of {} samples in {seconds:.1} s; the whole catalogue's p {family:.3}",
            p.len(),
            bench.series().stages()
        );
        all.extend(p);
        families.push(family);
    }
    println!("{} p-values of laws, {} of the whole catalogue\n", all.len(), families.len());
    println!("| p below | {} |", LEVELS.map(|level| level.to_string()).join(" | "));
    println!("|---|{}", "---|".repeat(LEVELS.len()));
    for (what, values) in [("share of laws", &all), ("share of catalogues", &families)] {
        let share = |level: f64| values.iter().filter(|p| **p < level).count() as f64 / values.len() as f64;
        println!("| {what} | {} |", LEVELS.map(|level| format!("{:.3}", share(level))).join(" | "));
    }
    let most = ids.iter().zip(&often).max_by_key(|(_, count)| **count);
    if let Some((id, count)) = most {
        println!("\np below {} most often: {id}, {count} times of {robots}", LEVELS[0]);
    }
    Ok(())
}
