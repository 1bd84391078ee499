//! What a law has to explain, besides standing out of the noise, to be named.

use super::found::{Accepted, Scanned};
use crate::calibrate::Trial;

/// Of what accepted causes explain, the share that another law on the same equation has to add to be one more cause.
const REST: f64 = 0.01;
/// Inflation of scores (see [`Trial::inflation`]) from which on residuals have a structure of their own: some 20 to 40 on a measured robot and where gaps are
/// explained by a smooth law, next to 1 where all causes are found.
const STRUCTURED: f64 = 5.0;
/// Of what a law explains a sample, the share that it has to explain of samples that it was not fitted to.
const UNSEEN: f64 = 0.25;

/// Whether a law of this score explains too little beside accepted causes on the same equation to be one more: no more than what the law of one of them may leave
/// of it (laws are smooth, gaps and dead bands are not).
pub fn is_rest(accepted: &[Accepted], explained: f64, scanned: &Scanned, score: f64) -> bool {
    accepted.iter().any(|accepted| accepted.named.effect.row == scanned.named.effect.row) && score < REST * explained
}

/// Whether one more law holds what it promises. Where residuals keep their structure with it, as those of every measured robot do, many laws find
/// something there; one that is the robot's finds it in samples that it was not fitted to too. `unseen` is ½ Σ r² of such, a sample.
pub fn keeps(scanned: &Scanned, current: &Trial, samples: usize, unseen: impl Fn(&Trial) -> Option<f64>) -> bool {
    let Some(trial) = scanned.trial.as_ref().filter(|trial| trial.inflation > STRUCTURED) else { return true };
    let promised = scanned.score / samples as f64;
    let gained = unseen(current).zip(unseen(trial)).map(|(current, with)| 2.0 * (current - with));
    tracing::debug!(effect = scanned.named.effect.id, promised, gained, "a sample, unseen");
    gained.is_some_and(|gained| gained >= UNSEEN * promised)
}

/// What laws are worth against one another, and against none.
#[derive(Debug, Clone, Copy)]
pub struct Scale {
    /// ln of the samples that decide.
    ln_samples: f64,
    /// What scores are too large by: that of the residuals which the law with the largest score leaves.
    inflation: f64,
}

impl Scale {
    /// That of these refits of so many samples on top of the `current` model.
    pub fn of(refitted: &[Scanned], current: &Trial, samples: usize) -> Self {
        let fitted = refitted.iter().filter_map(|s| Some((s.score, s.trial.as_ref()?)));
        let best = fitted.max_by(|a, b| a.0.total_cmp(&b.0)).map_or(current, |(_, trial)| trial);
        Scale::after(best, samples)
    }

    /// Where this model is the best there is.
    pub fn after(best: &Trial, samples: usize) -> Self {
        Scale { ln_samples: (samples.max(2) as f64).ln(), inflation: best.inflation }
    }

    /// What a law is worth: its score, as far as noise of this size makes it so, less Schwarz's price of its parameters. A law that contains
    /// another one as a special case gains as much; the simpler one is meant.
    pub fn worth(self, score: f64, freedom: usize) -> f64 {
        score / self.inflation - freedom as f64 * self.ln_samples
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn in_structured_residuals_the_simpler_law_is_meant() {
        // Of a robot with free play and viscous friction, whose smooth law of the gaps leaves a structure: unlike motors have six parameters,
        // viscous friction two.
        let (unlike_motors, viscous) = ((23_166.0, 6), (22_971.0, 2));
        let better = |inflation: f64| {
            let scale = Scale { ln_samples: 16_046f64.ln(), inflation };
            scale.worth(viscous.0, viscous.1) - scale.worth(unlike_motors.0, unlike_motors.1)
        };
        // 4 ln 16,046 = 38.7 against 195, and against 195 / 15.6 = 12.5.
        assert!((better(1.0) + 156.3).abs() < 0.1, "{}", better(1.0));
        assert!((better(15.6) - 26.2).abs() < 0.1, "{}", better(15.6));
    }
}
