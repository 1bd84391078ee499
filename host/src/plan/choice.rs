//! Which blocks make the motion: exchange of blocks under the budgets of time, segments and duty, as Fedorov's algorithm exchanges
//! the points of a design.
//!
//! ```text
//!   start      the choice of the round before
//!   fill       take the block that gains most for each second, while one fits and gains
//!   exchange   leave out one block, fill anew; take in one, leave out what is missed least until it fits, fill anew;
//!              keep what is better; until nothing is
//! ```
//!
//! What blocks tell adds up: see [`information`](crate::calibrate::information).

use super::trial::{Conduct, Trial};
use crate::calibrate::information::{About, Information};

/// What a plan is chosen by.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Criterion {
    /// Mean square of the relative errors: the largest count most.
    #[default]
    A,
    /// Volume of the ellipsoid of the relative errors.
    D,
}

/// What a motion is to show.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Goal {
    /// How errors become one number.
    pub criterion: Criterion,
    /// Whether the dynamic parameters are to be known.
    pub parameters: bool,
    /// Whether the sizes of laws are, each beside the parameters and all other laws.
    pub laws: bool,
}

impl Goal {
    fn counts(self, about: About) -> bool {
        match about {
            About::Dynamics => self.parameters,
            About::LawSize => self.laws,
            About::LawShape | About::Mounting | About::Bias => false,
        }
    }
}

/// A block with what the trials of it told.
#[derive(Debug)]
pub struct Candidate {
    /// By robot.
    pub information: Vec<Information>,
    /// Mean length over the robots, s.
    pub duration_s: f64,
    /// ∫ u² dt of each joint, the largest over the robots, s.
    pub duty_squared_s: Vec<f64>,
    /// Segments.
    pub segments: usize,
}

impl Candidate {
    /// From the trials of a block on all robots, the rest before it left out of its length.
    pub fn of(trials: Vec<(Information, Conduct)>, rest_s: f64, segments: usize) -> Self {
        let duration_s =
            trials.iter().map(|(_, conduct)| conduct.duration_s - rest_s).sum::<f64>() / trials.len() as f64;
        let joints = trials.first().map_or(0, |(_, conduct)| conduct.joints.len());
        let most = |joint: usize| trials.iter().fold(0.0_f64, |most, (_, c)| most.max(c.joints[joint].duty_squared_s));
        let duty_squared_s = (0..joints).map(most).collect();
        let information = trials.into_iter().map(|(information, _)| information).collect();
        Self { information, duration_s, duty_squared_s, segments }
    }
}

/// What a motion may take.
#[derive(Debug, Clone)]
pub struct Budget {
    /// Length, s.
    pub duration_s: f64,
    /// Segments.
    pub segments: usize,
    /// ∫ u² dt of each joint, s.
    pub duty_squared_s: f64,
}

/// How good a motion is, by robot: relative errors of what it is to show.
#[derive(Debug, Clone, PartialEq)]
pub struct Merit {
    /// The criterion in logarithms of an error: smaller is better. Parameters and laws have half of it each where both are to be shown.
    pub score: f64,
    /// Relative errors of what counts.
    pub errors: Vec<f64>,
}

impl Merit {
    /// Of a motion that tells so much.
    pub fn of(information: &Information, goal: Goal) -> Option<Self> {
        let told = information.errors()?;
        let errors_of = |counts: &dyn Fn(About) -> bool| -> Vec<f64> {
            let counted = information.parameters.iter().zip(&told).filter(|(parameter, _)| counts(parameter.about));
            counted.map(|(_, error)| *error).collect()
        };
        let is_dynamic = |about: About| about == About::Dynamics;
        let (mut score, mut shares) = (0.0, 0.0);
        for of_dynamics in [true, false] {
            let counts = |about: About| goal.counts(about) && is_dynamic(about) == of_dynamics;
            let errors = errors_of(&counts);
            if errors.is_empty() {
                continue;
            }
            let count = errors.len() as f64;
            score += match goal.criterion {
                Criterion::A => 0.5 * (errors.iter().map(|error| error * error).sum::<f64>() / count).ln(),
                Criterion::D => 0.5 * information.log_volume(counts)? / count,
            };
            shares += 1.0;
        }
        Some(Self { score: score / f64::max(shares, 1.0), errors: errors_of(&|about| goal.counts(about)) })
    }
}

/// Weight of errors that grow beyond those of the reference, in squares of logarithms.
const WORSE: f64 = 2.0;

/// How motions compare with a reference over all robots.
#[derive(Debug)]
pub struct Yardstick {
    /// What the plan is chosen by.
    pub goal: Goal,
    /// Merit of the reference, by robot.
    pub reference: Vec<Merit>,
    /// What is known already, by robot.
    pub known: Vec<Information>,
}

impl Yardstick {
    /// What these trials of a motion tell, with what is known already, by robot; none where a motion did not end as it should.
    pub fn told(&self, trials: &[Trial]) -> Option<Vec<Information>> {
        let with_known = |(trial, known): (&Trial, &Information)| {
            let mut sum = known.clone();
            sum.add(trial.information.as_ref()?, 1.0);
            Some(sum)
        };
        trials.iter().zip(&self.known).map(with_known).collect()
    }

    /// The score of a motion that tells so much of each robot, smaller is better: half the mean and half the largest over the robots,
    /// each against the reference; what counts and is told worse than by the reference counts against it.
    pub fn score(&self, information: &[Information]) -> f64 {
        let mut scores = Vec::with_capacity(information.len());
        for (information, reference) in information.iter().zip(&self.reference) {
            let Some(merit) = Merit::of(information, self.goal) else { return f64::INFINITY };
            let worse = merit
                .errors
                .iter()
                .zip(&reference.errors)
                .map(|(error, before)| (error / before).ln().max(0.0).powi(2));
            scores.push(merit.score - reference.score + WORSE * worse.sum::<f64>());
        }
        let mean = scores.iter().sum::<f64>() / scores.len().max(1) as f64;
        0.5 * (mean + scores.into_iter().fold(f64::NEG_INFINITY, f64::max))
    }
}

/// A choice of candidates, each as often as it stands there.
#[derive(Debug, Clone)]
pub struct Choice {
    /// Places of the candidates.
    pub blocks: Vec<usize>,
    /// The score of all of them.
    pub score: f64,
}

/// No block stands in a motion more often.
const MOST_REPEATS: usize = 4;
/// Less gain than this is none.
const LEAST_GAIN: f64 = 1e-4;

/// What a choice is made of and under.
#[derive(Clone, Copy)]
pub struct Selection<'a> {
    /// Blocks that there are.
    pub candidates: &'a [Candidate],
    /// What choices are judged by.
    pub yardstick: &'a Yardstick,
    /// What a motion may take.
    pub budget: &'a Budget,
}

impl Selection<'_> {
    /// Improves `from` by exchange until nothing does, or `go_on` says no.
    pub fn exchange(self, from: &[usize], go_on: &dyn Fn() -> bool) -> Choice {
        let mut best = self.fill(from.to_vec(), None);
        loop {
            let before = best.score;
            let mut place = 0;
            while place < best.blocks.len() && go_on() {
                let mut rest = best.blocks.clone();
                let left = rest.remove(place);
                let other = self.fill(rest, Some(left));
                if other.score < best.score - LEAST_GAIN {
                    best = other;
                } else {
                    place += 1;
                }
            }
            for taken in 0..self.candidates.len() {
                if !go_on() {
                    break;
                }
                let Some(with) = self.with(&best.blocks, taken) else { continue };
                let other = self.fill(with, None);
                if other.score < best.score - LEAST_GAIN {
                    best = other;
                }
            }
            if best.score >= before || !go_on() {
                return best;
            }
        }
    }

    /// These blocks and one more, without those that are missed least until it fits; none where it does not fit alone.
    fn with(self, blocks: &[usize], taken: usize) -> Option<Vec<usize>> {
        let mut chosen = blocks.to_vec();
        while !fits(self.candidates, self.budget, &chosen, &self.candidates[taken]) {
            let mut least: Option<(f64, usize)> = None;
            for place in 0..chosen.len() {
                let rest = chosen.iter().enumerate().filter(|(other, _)| *other != place).map(|(_, block)| *block);
                let score = self.yardstick.score(&self.told(rest.chain([taken])));
                if least.is_none_or(|(least, _)| score < least) {
                    least = Some((score, place));
                }
            }
            chosen.remove(least?.1);
        }
        chosen.push(taken);
        Some(chosen)
    }

    /// What these blocks tell, with what is known already, by robot.
    fn told(self, blocks: impl Iterator<Item = usize>) -> Vec<Information> {
        let mut sums = self.yardstick.known.clone();
        for block in blocks {
            sums.iter_mut().zip(&self.candidates[block].information).for_each(|(sum, more)| sum.add(more, 1.0));
        }
        sums
    }

    /// Adds what gains most for its time until nothing fits; `without` is not added first.
    fn fill(self, mut chosen: Vec<usize>, without: Option<usize>) -> Choice {
        let Self { candidates, yardstick, budget } = self;
        let mut sums = self.told(chosen.iter().copied());
        let mut score = yardstick.score(&sums);
        let mut barred = without;
        loop {
            let mut best: Option<(f64, f64, usize)> = None;
            for (place, candidate) in candidates.iter().enumerate() {
                let repeats = chosen.iter().filter(|block| **block == place).count();
                if Some(place) == barred || repeats >= MOST_REPEATS || !fits(candidates, budget, &chosen, candidate) {
                    continue;
                }
                sums.iter_mut().zip(&candidate.information).for_each(|(sum, more)| sum.add(more, 1.0));
                let with = yardstick.score(&sums);
                sums.iter_mut().zip(&candidate.information).for_each(|(sum, more)| sum.add(more, -1.0));
                let gain = (score - with) / candidate.duration_s.max(0.1);
                if with < score - LEAST_GAIN && best.is_none_or(|(most, _, _)| gain > most) {
                    best = Some((gain, with, place));
                }
            }
            let Some((_, with, place)) = best else { return Choice { blocks: chosen, score } };
            chosen.push(place);
            sums.iter_mut().zip(&candidates[place].information).for_each(|(sum, more)| sum.add(more, 1.0));
            score = with;
            barred = None;
        }
    }
}

fn fits(candidates: &[Candidate], budget: &Budget, chosen: &[usize], more: &Candidate) -> bool {
    let all = || chosen.iter().map(|&block| &candidates[block]).chain([more]);
    all().map(|c| c.duration_s).sum::<f64>() <= budget.duration_s
        && all().map(|c| c.segments).sum::<usize>() <= budget.segments
        && (0..more.duty_squared_s.len())
            .all(|joint| all().map(|c| c.duty_squared_s[joint]).sum::<f64>() <= budget.duty_squared_s)
}
