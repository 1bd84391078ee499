//! When an event was: a law that is nothing but around one time shows a search no way to a time far from where it starts.
//!
//! ```text
//! score │        ▁▂▄▆█▆▄▂▁              a jump's score falls off on both sides of the true time, so that ever finer grids meet it
//!       │    ▁▂▃▅         ▅▃▂▁
//!       └──┼──────┼──────┼──────┼── t   the scan's starts, a second apart
//! ```

use std::sync::Arc;

use super::found::Named;
use super::scan::Scan;
use crate::calibrate::{Bench, Trial};
use crate::model::law::Law;

/// Steps of the grids, s: the first from one start of a scan half way to the next, each within that of the one before, the last as fine as samples.
const GRIDS_S: [f64; 4] = [0.1, 0.02, 0.004, 0.001];
/// Times on each side of the best one so far.
const ON_EACH_SIDE: i32 = 5;

/// The law at the time that scores best on top of `current`, looked for around its own; as it is, where it has no time or nothing scores.
pub fn timed(bench: &Bench<'_>, current: &Trial, named: Named) -> Named {
    let mut best = named;
    for step_s in GRIDS_S {
        let later = |i: i32| best.law.later(f64::from(i) * step_s);
        let laws: Vec<Arc<dyn Law>> = (-ON_EACH_SIDE..=ON_EACH_SIDE).filter_map(later).collect();
        if laws.is_empty() {
            break;
        }
        let Ok(scores) = bench.scores(current, &laws) else { break };
        let scored = Scan::of(&scores, current.inflation).scores;
        let score = |score: &Option<_>| score.as_ref().map_or(0.0, |score: &super::scan::Score| score.score);
        let most = laws.into_iter().zip(&scored).max_by(|a, b| score(a.1).total_cmp(&score(b.1)));
        let Some((law, _)) = most.filter(|(_, of)| of.is_some()) else { break };
        best.law = law;
    }
    best
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
    fn a_jump_is_found_half_a_second_from_where_its_law_starts() {
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

        let start_s = |law: &Arc<dyn Law>| law.parameters().coordinates[1].start;
        let of_joint = |law: &Arc<dyn Law>| law.parameters().results[0].name.ends_with(joint);
        let laws = effect.laws(&robot).unwrap().into_iter().filter(of_joint);
        let off = |law: &Arc<dyn Law>| (start_s(law) - true_s).abs();
        let mut laws: Vec<_> = laws.filter(|law| off(law) < 0.5).collect();
        assert_eq!(laws.len(), 1, "one a second");
        let law = laws.remove(0);
        let off_before = off(&law);
        let found = timed(&bench, &base, Named { effect, law });
        assert!(off(&found.law) < 0.02 && off_before > 0.05, "{} s, {off_before} s before", off(&found.law));
    }
}
