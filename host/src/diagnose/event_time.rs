//! When an event was: a law that is nothing but around one time shows a search no way to a time far from where it starts.
//!
//! ```text
//! score │           ▁█▁               a jump excites the transmission: its score has a peak as narrow as that rings, on a broad hill
//!       │   ▁▂▃▄▅▆▇▇▇█▇▆▅▄▃▂▁
//!       └──┼──────┼──────┼──────┼── t   the scan's starts, a second apart
//!       ▐██▌                    ▐██▌    few samples: no time between two of their windows is better than another
//! ```
//! So the times at which the current model fits worst are tried beside those of a coarse grid, and ever finer grids around the best.

use std::sync::Arc;

use super::found::Named;
use super::scan::Scan;
use crate::calibrate::{Bench, Series, Trial};
use crate::model::law::Law;

/// Step of the grid over all that the scan does not tell from its start, s.
const COARSE_S: f64 = 0.5;
/// Steps of the grids around the best time, s: each reaches over the step of the one before, the last is as fine as samples.
const FINE_S: [f64; 4] = [0.1, 0.02, 0.004, 0.001];
/// Times on each side of the best one, on fine grids.
const ON_EACH_SIDE: i32 = 5;
/// Worst times that are tried.
const WORST: usize = 12;

/// The law at the time that scores best on `bench`, on top of `current`, looked for around the one at which it did on the `scanned` samples; as it
/// is, where it has no time or nothing scores.
pub fn timed(scanned: &Series, (bench, current): (&Bench<'_>, &Trial), named: Named) -> Named {
    let Some(start_s) = named.law.event_s() else { return named };
    let [from_s, to_s] = untold(scanned, start_s);
    let steps = |span_s: f64| (span_s / COARSE_S).ceil() as i32 + 1;
    let coarse = (-steps(start_s - from_s)..=steps(to_s - start_s)).map(|i| f64::from(i) * COARSE_S);
    let worst = bench.worst_times(current, WORST).unwrap_or_default().into_iter().map(|t| t - start_s);
    let on_each_side = |step_s: f64| (-ON_EACH_SIDE..=ON_EACH_SIDE).map(move |i| f64::from(i) * step_s);
    let grids =
        std::iter::once(coarse.chain(worst).collect()).chain(FINE_S.map(|step_s| on_each_side(step_s).collect()));
    let mut best = named;
    for later_s in grids {
        let Some(law) = best_of(bench, current, &*best.law, later_s) else { break };
        best.law = law;
    }
    tracing::debug!(effect = best.effect.id, from_s, to_s, start_s, found_s = best.law.event_s(), "timed");
    best
}

/// The law that clues have started, at the time next to theirs that scores best: they come from a model that the event has bent, and a jump between
/// two samples shows no way to one between two others. As it is, where it has no time.
pub fn beside((bench, current): (&Bench<'_>, &Trial), named: Named) -> Named {
    if named.law.event_s().is_none() {
        return named;
    }
    let mut best = named;
    for step_s in &FINE_S[2..] {
        let later_s = (-ON_EACH_SIDE..=ON_EACH_SIDE).map(|i| f64::from(i) * step_s).collect();
        let Some(law) = best_of(bench, current, &*best.law, later_s) else { break };
        best.law = law;
    }
    best
}

/// The law so much later, s, as scores best.
fn best_of(bench: &Bench<'_>, current: &Trial, law: &dyn Law, later_s: Vec<f64>) -> Option<Arc<dyn Law>> {
    let laws: Vec<Arc<dyn Law>> = later_s.into_iter().filter_map(|by_s| law.later(by_s)).collect();
    let scan = Scan::of(&bench.scores(current, &laws).ok()?, current.inflation);
    let scored = laws.into_iter().zip(scan.scores).filter_map(|(law, score)| Some((law, score?.score)));
    scored.max_by(|(_, a), (_, b)| a.total_cmp(b)).map(|(law, _)| law)
}

/// The times that these samples do not tell from `time_s`: those to the next ones on either side.
fn untold(series: &Series, time_s: f64) -> [f64; 2] {
    let times = || (0..series.stages()).map(|k| series.time_s(k));
    let before = times().filter(|t| *t <= time_s).fold(f64::NEG_INFINITY, f64::max);
    let behind = times().filter(|t| *t > time_s).fold(f64::INFINITY, f64::min);
    [before, behind].map(|t| if t.is_finite() { t } else { time_s })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibrate::{Preset, fit};
    use crate::effect::{Effect, Size};
    use crate::robot::Robot;
    use crate::simulate::{Direct, EffectChoice, Options, SHORT_MOTION};
    use solve::levenberg::Settings;

    #[test]
    fn a_jump_is_found_far_from_where_its_law_starts() {
        let robot = Robot::builtin("doggy").unwrap();
        let effect = Effect::by_id("belt_tooth_skip").unwrap();
        // A fifth of a milliradian; a tooth is a hundred times as much.
        let effects = vec![EffectChoice { effect, size: Size::Level(-5.3) }];
        let Direct { recording, effects, .. } =
            Direct::record(&Options { seed: 3, effects, ..Options::new(robot.clone()) }, SHORT_MOTION).unwrap();
        let time = effects[0].parameters.iter().find(|value| value.unit == "s").unwrap();
        let (joint, true_s) = (&time.name[time.name.find('[').unwrap()..], time.value);
        let from_start_s = |k: usize| recording.time_s(k) - recording.time_s(0);
        let behind = (0..recording.len()).find(|k| from_start_s(*k) > true_s + 3.0).unwrap_or(recording.len());
        let recording = recording.part(0..behind);
        let settings = Settings::default();
        let fitted = fit(&robot, &[&recording], Preset::Default, &settings, |_, _| {}).unwrap();
        let (bench, base) = Bench::new(&robot, fitted.series.clone(), &fitted, fitted.noise.clone(), settings).unwrap();

        let of_joint = |law: &Arc<dyn Law>| law.parameters().results[0].name.ends_with(joint);
        let laws = effect.laws(&robot).unwrap().into_iter().filter(of_joint);
        let off = |law: &Arc<dyn Law>| (law.event_s().unwrap() - true_s).abs();
        // Few samples, which do not tell the jump from one somewhere else between the same two windows.
        let few = fitted.series.excerpt(800, 4).unwrap();
        let holds = |law: &Arc<dyn Law>| {
            let [from_s, to_s] = untold(&few, law.event_s().unwrap());
            (from_s..to_s).contains(&true_s)
        };
        let law = laws.filter(holds).max_by(|a, b| off(a).total_cmp(&off(b))).unwrap();
        let off_before = off(&law);
        let found = timed(&few, (&bench, &base), Named { effect, law });
        // Measured: 1 ms, from 2.17 s.
        assert!(off(&found.law) < 3e-3 && off_before > 2.0, "{} s, {off_before} s before", off(&found.law));

        // As clues tell it: some samples late.
        let late = true_s + 0.011 - found.law.event_s().unwrap();
        let law = found.law.later(late).unwrap();
        let moved = beside((&bench, &base), Named { effect, law });
        assert!(off(&moved.law) < 3e-3, "{} s", off(&moved.law));
    }
}
