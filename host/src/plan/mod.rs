//! A motion that shows the parameters of a robot, an effect that it may have, or which of several effects it has, as well as its limits, a length and a duty budget allow.
//!
//! ```text
//!  Belief ──▶ robots that it may be ──┬─▶ preset on each of them          ──▶ what a plan is held against
//!                                     ╰─▶ blocks on each of them ─▶ information ─▶ exchange ─▶ motion
//!                                              ▲ others like the chosen ones ◀──────╯             │
//!                      whole motion on these robots and on others, limits and watches with a margin ◀╯
//! ```
//!
//! Every block and every motion is played under the firmware's whole control loop ([`Rehearsal`]), and what it tells is judged as
//! `host check` and a calibration judge it ([`information`](crate::calibrate::information)). The preset calibration motion is a candidate like any other.

mod block;
mod choice;
mod draws;
mod error;
mod result;
mod targets;
mod trial;

use firmware::motion::preset;
use protocol::motion::{Limits, MAX_SEGMENTS};
use protocol::{Motion, MotionEnd};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

pub use block::Block;
use block::REST_OF_BLOCK_S;
pub use choice::Criterion;
use choice::{Budget, Candidate, Choice, Goal, Merit, Selection, Yardstick};
pub use draws::Belief;
pub use error::PlanError;
pub use result::{ExpectedError, JointDemand, Plan};
pub use targets::can_show;
use trial::{Conduct, Trial, try_all};

use crate::calibrate::CalibrateError;
use crate::calibrate::information::{Information, SizedLaw, Weights};
use crate::effect::Effect;
use crate::link::joint_limits;
use crate::robot::InputUnit;
use crate::simulate::{Rehearsal, Truth};

/// How a plan is made.
#[derive(Debug, Clone)]
pub struct Settings {
    /// Decides which robots and which blocks are tried.
    pub seed: u64,
    /// Longest motion, s; none is the preset's length.
    pub length_s: Option<f64>,
    /// Highest root mean square of the duty of a joint over the motion, as a fraction; none is that of the preset.
    pub duty_rms: Option<f64>,
    /// What the motion is chosen by.
    pub criterion: Criterion,
    /// Whether it is to show the dynamic parameters.
    pub parameters: bool,
    /// Effects that it is to show, or to tell from one another.
    pub effects: Vec<&'static Effect>,
    /// Rounds in which blocks like the chosen ones are tried.
    pub rounds: usize,
    /// Threads.
    pub threads: usize,
}

impl Default for Settings {
    fn default() -> Self {
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        Self {
            seed: 0,
            length_s: None,
            duty_rms: None,
            criterion: Criterion::A,
            parameters: true,
            effects: Vec::new(),
            rounds: 4,
            threads,
        }
    }
}

/// Robots on which blocks are tried, the likeliest among them.
const ROBOTS: usize = 4;
/// Further robots on which a whole motion must hold.
const MORE_ROBOTS: usize = 8;
/// Draws until there are so many robots on which the preset is played to its end.
const MOST_DRAWS: usize = 3 * (ROBOTS + MORE_ROBOTS);
/// Blocks drawn before the first choice, and in each further round.
const DRAWN: [usize; 2] = [24, 6];
/// Blocks like the chosen ones in each further round.
const MUTATED: usize = 14;
/// A watch may come as near to its bound, unless the preset comes nearer on the same robot.
const WATCH: f64 = 0.8;
/// Motor and link may go as far, part of the half range, unless the preset goes farther on the same robot.
const TRAVEL: f64 = 0.95;
/// No block is shorter, s: a move, and the way home.
const SHORTEST_S: f64 = 2.0;
/// Motions of a round that are made and tried whole until one keeps all limits.
const ATTEMPTS: usize = 12;

/// What is going on, for whoever watches.
#[derive(Debug, Clone, Copy)]
pub struct Progress {
    /// What is being done.
    pub stage: &'static str,
    /// Expected errors of the best motion so far, as a part of the preset's; none before the first one.
    pub error_ratio: Option<f64>,
}

/// Robots, and what the preset does on them.
struct Bench<'a> {
    belief: &'a Belief,
    settings: &'a Settings,
    limits: Vec<Limits>,
    /// Laws of the effects that are to be shown.
    laws: Vec<SizedLaw>,
    /// The first [`ROBOTS`] of them judge; the likeliest is the first.
    robots: Vec<Truth>,
    /// What rows of those that judge are weighted by.
    weights: Vec<Weights>,
    preset: Motion,
    preset_trials: Vec<Trial>,
    left_out: usize,
}

/// A motion with the trials of it.
struct Tried {
    motion: Motion,
    blocks: Vec<Block>,
    trials: Vec<Trial>,
    /// Against the preset's: see [`Yardstick::score`].
    score: f64,
}

/// The motion that a plan ends with.
#[derive(Clone, Copy)]
struct Seen<'a> {
    motion: &'a Motion,
    blocks: &'a [Block],
    trials: &'a [Trial],
    is_preset: bool,
}

impl Tried {
    fn seen(&self, is_preset: bool) -> Seen<'_> {
        Seen { motion: &self.motion, blocks: &self.blocks, trials: &self.trials, is_preset }
    }
}

/// Plans a motion. `go_on` says no when the search must end; the best motion so far is then made and tried to the end.
///
/// # Errors
/// [`PlanError`].
pub fn plan(
    belief: &Belief,
    settings: &Settings,
    progress: &dyn Fn(Progress),
    go_on: &(dyn Fn() -> bool + Sync),
) -> Result<Plan, PlanError> {
    if belief.robot.input.unit != InputUnit::Duty {
        return Err(PlanError::Unsuited { reason: "it is not driven by duty".to_owned() });
    }
    let before_s = f64::from(block::REST_MS) * 1e-3;
    if let Some(length_s) = settings.length_s.filter(|length_s| *length_s < before_s + SHORTEST_S) {
        return Err(PlanError::TooShort { length_s, least_s: before_s + SHORTEST_S });
    }
    let mut rng = ChaCha8Rng::seed_from_u64(settings.seed);
    progress(Progress { stage: "preset", error_ratio: None });
    let bench = Bench::new(belief, settings, &mut rng, go_on)?;
    let judges = &bench.preset_trials[..ROBOTS];
    let mean = |of: &dyn Fn(&Conduct) -> f64| judges.iter().map(|t| of(&t.conduct)).sum::<f64>() / ROBOTS as f64;
    let preset_s = mean(&|conduct| conduct.duration_s);
    let length_s = settings.length_s.unwrap_or(preset_s);
    let most_duty = |conduct: &Conduct| conduct.joints.iter().fold(0.0_f64, |most, j| most.max(j.duty_squared_s));
    let mut budget = Budget {
        duration_s: length_s - before_s,
        segments: MAX_SEGMENTS - block::segments_before(&bench.limits),
        duty_squared_s: match settings.duty_rms {
            Some(rms) => rms * rms * length_s,
            None => judges.iter().fold(0.0_f64, |most, t| most.max(most_duty(&t.conduct))) * length_s / preset_s,
        },
    };
    let yardstick = bench.yardstick(length_s / preset_s)?;

    let mut pool = Pool::default();
    let joints = bench.limits.len();
    let mut fresh = Block::of_preset(joints);
    fresh.extend((0..DRAWN[0]).map(|_| Block::draw(joints, &mut rng)));
    let mut choice = Choice { blocks: Vec::new(), score: f64::INFINITY };
    let mut complete = true;
    let mut planned: Option<Tried> = None;
    for round in 0..=settings.rounds {
        let error_ratio = planned.as_ref().map(|tried| tried.score.exp());
        progress(Progress { stage: if round == 0 { "first blocks" } else { "further blocks" }, error_ratio });
        // A first choice is made of what there is.
        let had_time = go_on() && pool.add(&bench, fresh, go_on)?;
        complete &= had_time;
        if !had_time && planned.is_some() {
            break;
        }
        let selection = Selection { candidates: &pool.candidates, yardstick: &yardstick, budget: &budget };
        choice = selection.exchange(&choice.blocks, go_on);
        tracing::debug!(
            round,
            candidates = pool.candidates.len(),
            blocks = choice.blocks.len(),
            sum_of_blocks = choice.score.exp(),
            "exchange"
        );
        let least = planned.as_ref().map_or(f64::INFINITY, |tried| tried.score);
        planned = bench.make(&mut pool, &yardstick, &mut budget, &mut choice, (length_s, least))?.or(planned);
        if !had_time {
            break;
        }
        fresh = pool.like(&choice, joints, &mut rng);
    }
    let preset_fits = settings.length_s.is_none_or(|length_s| preset_s <= length_s)
        && settings
            .duty_rms
            .is_none_or(|rms| judges.iter().all(|t| most_duty(&t.conduct) <= rms * rms * t.conduct.duration_s));
    let planned = planned.filter(|tried| !preset_fits || tried.score < bench.score(&yardstick, judges));
    match &planned {
        Some(tried) => result::plan(&bench, &yardstick, tried.seen(false), (pool.tried, complete)),
        None if preset_fits => result::plan(&bench, &yardstick, bench.preset_seen(), (pool.tried, complete)),
        None if !complete => Err(PlanError::NoTime),
        None => Err(PlanError::NoneKeepsLimits),
    }
}

impl<'a> Bench<'a> {
    fn new(
        belief: &'a Belief,
        settings: &'a Settings,
        rng: &mut ChaCha8Rng,
        go_on: &(dyn Fn() -> bool + Sync),
    ) -> Result<Self, PlanError> {
        let limits = joint_limits(&belief.robot);
        let preset = preset::calibration(&limits);
        let laws = targets::laws(belief, &preset, &settings.effects)?;
        let (mut robots, mut weights, mut preset_trials) = (Vec::new(), Vec::new(), Vec::new());
        let (mut drawn, mut stopped, mut how) = (0, 0, String::new());
        while robots.len() < ROBOTS + MORE_ROBOTS {
            // The first ones judge.
            let judge = robots.len() < ROBOTS;
            let wanted = (if judge { ROBOTS } else { ROBOTS + MORE_ROBOTS }) - robots.len();
            let truths: Vec<Truth> =
                (0..wanted).map(|i| if drawn + i == 0 { belief.likely() } else { belief.draw(rng) }).collect();
            let noise: Vec<Weights> = (0..wanted).map(|i| belief.weights(drawn + i)).collect();
            let judged = (judge.then_some(&noise[..]), &laws[..]);
            let tried = try_all(belief, &truths, std::slice::from_ref(&preset), judged, settings.threads, go_on)?;
            let tried = tried.ok_or(PlanError::NoTime)?;
            drawn += wanted;
            for ((truth, noise), trial) in truths.into_iter().zip(noise).zip(tried.into_iter().flatten()) {
                if trial.conduct.end == MotionEnd::Finished {
                    robots.push(truth);
                    weights.push(noise);
                    preset_trials.push(trial);
                } else {
                    stopped += 1;
                    how = ended(trial.conduct.end);
                }
            }
            // The likeliest robot is the first one.
            if drawn > MOST_DRAWS || robots.is_empty() || robots[0] != belief.likely() {
                return Err(PlanError::PresetStopped { stopped, drawn, how });
            }
        }
        weights.truncate(ROBOTS);
        Ok(Self { belief, settings, limits, laws, robots, weights, preset, preset_trials, left_out: stopped })
    }

    /// What plans are held against: the preset, as long as the plan; and what recordings tell already.
    fn yardstick(&self, length_ratio: f64) -> Result<Yardstick, PlanError> {
        let Settings { criterion, parameters, .. } = *self.settings;
        let goal = Goal { criterion, parameters, laws: !self.laws.is_empty() };
        let (mut reference, mut known) = (Vec::new(), Vec::new());
        for (robot, trial) in self.robots.iter().zip(&self.preset_trials).take(ROBOTS) {
            let preset = trial.information.as_ref().ok_or(PlanError::NoneKeepsLimits)?;
            let mut before = preset.nothing();
            // Noise as the preset has it.
            let weights = Weights::Given(preset.noise.clone());
            for recording in &self.belief.known {
                let values = (robot.as_slice(), &self.laws[..]);
                let told = Information::of(&self.belief.robot, values, recording, &weights)?;
                before.add(&told.without_biases(), 1.0);
            }
            let mut with_preset = before.clone();
            with_preset.add(preset, length_ratio);
            let merit = Merit::of(&with_preset, goal);
            reference.push(merit.ok_or(PlanError::Calibrate(CalibrateError::Undetermined))?);
            known.push(before);
        }
        Ok(Yardstick { goal, reference, known })
    }

    /// The score of a whole motion.
    fn score(&self, yardstick: &Yardstick, trials: &[Trial]) -> f64 {
        yardstick.told(&trials[..ROBOTS]).map_or(f64::INFINITY, |told| yardstick.score(&told))
    }

    /// Whether a motion ended as it should and kept a margin to limits and watches on robot `robot`.
    fn holds(&self, robot: usize, conduct: &Conduct) -> bool {
        self.breaks(robot, conduct).is_none()
    }

    /// The segment in which it did not.
    fn breaks(&self, robot: usize, conduct: &Conduct) -> Option<usize> {
        let preset = &self.preset_trials[robot].conduct;
        let [last, watched, farthest] = conduct.segments.map(usize::from);
        match conduct.end {
            MotionEnd::Finished if conduct.watch > WATCH.max(preset.watch) => Some(watched),
            MotionEnd::Finished if conduct.travel > TRAVEL.max(preset.travel) => Some(farthest),
            MotionEnd::Finished => None,
            MotionEnd::Stopped | MotionEnd::Fault(_) => Some(last),
        }
    }

    /// Makes and tries the whole motion of a choice; none where its score is not below `least`, or none holds on all robots. Blocks that do not hold in it are
    /// left out, and the choice is made anew.
    fn make(
        &self,
        pool: &mut Pool,
        yardstick: &Yardstick,
        budget: &mut Budget,
        choice: &mut Choice,
        (length_s, least): (f64, f64),
    ) -> Result<Option<Tried>, PlanError> {
        for _ in 0..ATTEMPTS {
            if choice.blocks.is_empty() {
                return Ok(None);
            }
            let blocks: Vec<&Block> = choice.blocks.iter().map(|&place| &pool.blocks[place]).collect();
            let (motion, owners) = block::motion("planned", &blocks, &self.limits, false);
            let motions = std::slice::from_ref(&motion);
            let whole = |robots: &[Truth], weights| -> Result<Vec<Trial>, PlanError> {
                let judged = (weights, &self.laws[..]);
                let tried = try_all(self.belief, robots, motions, judged, self.settings.threads, &|| true)?;
                Ok(tried.into_iter().flatten().flatten().collect())
            };
            let mut trials = whole(&self.robots[..ROBOTS], Some(&self.weights[..]))?;
            let mean_s = trials.iter().map(|trial| trial.conduct.duration_s).sum::<f64>() / ROBOTS as f64;
            let score = self.score(yardstick, &trials);
            let holds_on =
                |trials: &[Trial]| trials.iter().enumerate().all(|(robot, trial)| self.holds(robot, &trial.conduct));
            let holds = holds_on(&trials);
            tracing::debug!(blocks = blocks.len(), error_ratio = score.exp(), mean_s, holds, "whole motion");
            if holds && mean_s <= length_s && score >= least {
                return Ok(None);
            }
            trials.extend(whole(&self.robots[ROBOTS..], None)?);
            let holds = holds_on(&trials);
            if holds && mean_s <= length_s {
                let blocks = blocks.into_iter().cloned().collect();
                return Ok(Some(Tried { motion, blocks, trials, score }));
            }
            if holds {
                budget.duration_s -= mean_s - length_s + 0.01;
                // The choice is cut down to the budget: the last ones were added last.
                choice.blocks.pop();
            } else {
                let segments =
                    trials.iter().enumerate().filter_map(|(robot, trial)| self.breaks(robot, &trial.conduct));
                let mut left_out: Vec<usize> =
                    segments.filter_map(|segment| Some(choice.blocks[owners.get(segment).copied()??])).collect();
                left_out.sort_unstable();
                left_out.dedup();
                if left_out.is_empty() {
                    return Ok(None);
                }
                pool.leave_out(&left_out, choice);
            }
            let selection = Selection { candidates: &pool.candidates, yardstick, budget };
            *choice = selection.exchange(&choice.blocks, &|| true);
        }
        Ok(None)
    }

    /// The preset as a plan.
    fn preset_seen(&self) -> Seen<'_> {
        Seen { motion: &self.preset, blocks: &[], trials: &self.preset_trials, is_preset: true }
    }
}

/// Blocks that were tried and hold on every robot.
#[derive(Default)]
struct Pool {
    blocks: Vec<Block>,
    candidates: Vec<Candidate>,
    /// All that were tried.
    tried: usize,
}

impl Pool {
    /// Tries blocks and takes in those that hold. Whether there was time for it.
    fn add(
        &mut self,
        bench: &Bench<'_>,
        fresh: Vec<Block>,
        go_on: &(dyn Fn() -> bool + Sync),
    ) -> Result<bool, PlanError> {
        let motions: Vec<Motion> =
            fresh.iter().map(|block| block::motion("block", &[block], &bench.limits, true).0).collect();
        let robots = &bench.robots[..ROBOTS];
        // A calibration estimates one noise of the whole motion, for which the preset's stands, and the block has its part in it.
        let weights = bench.preset_trials[..ROBOTS].iter().zip(&bench.weights).map(|(trial, weights)| {
            match (&trial.information, weights) {
                (Some(told), Weights::Estimated { .. }) => Weights::Part(told.noise.clone()),
                _ => weights.clone(),
            }
        });
        let weights: Vec<Weights> = weights.collect();
        let judged = (Some(&weights[..]), &bench.laws[..]);
        let Some(trials) = try_all(bench.belief, robots, &motions, judged, bench.settings.threads, go_on)? else {
            return Ok(false);
        };
        self.tried += fresh.len();
        for (block, trials) in fresh.into_iter().zip(trials) {
            let holds = trials.iter().enumerate().all(|(robot, trial)| bench.holds(robot, &trial.conduct));
            let told: Option<Vec<_>> =
                trials.into_iter().map(|trial| Some((trial.information?, trial.conduct))).collect();
            if let (true, Some(told)) = (holds, told) {
                let segments = block.actions(&bench.limits).len();
                self.candidates.push(Candidate::of(told, REST_OF_BLOCK_S, segments));
                self.blocks.push(block);
            }
        }
        Ok(true)
    }

    /// Blocks to be tried next: like those of the choice, and others.
    fn like(&self, choice: &Choice, joints: usize, rng: &mut ChaCha8Rng) -> Vec<Block> {
        let chosen = &choice.blocks;
        let mutated =
            (0..MUTATED).filter_map(|i| Some(self.blocks[*chosen.get(i % chosen.len().max(1))?].mutate(joints, rng)));
        let mut fresh: Vec<Block> = mutated.collect();
        fresh.extend((0..DRAWN[1]).map(|_| Block::draw(joints, rng)));
        fresh
    }

    /// Forgets blocks, and takes them out of the choice.
    fn leave_out(&mut self, places: &[usize], choice: &mut Choice) {
        for &place in places.iter().rev() {
            self.blocks.remove(place);
            self.candidates.remove(place);
            choice.blocks.retain(|block| *block != place);
            choice.blocks.iter_mut().filter(|block| **block > place).for_each(|block| *block -= 1);
        }
    }
}

/// How a motion ended, in words.
fn ended(end: MotionEnd) -> String {
    match end {
        MotionEnd::Finished => "finished".to_owned(),
        MotionEnd::Stopped => "stopped".to_owned(),
        MotionEnd::Fault(fault) => fault.to_string(),
    }
}

/// The likeliest robot in a motion.
fn rehearse_likely(bench: &Bench<'_>, motion: &Motion) -> Result<Rehearsal, PlanError> {
    Rehearsal::play(&bench.belief.robot, &bench.robots[0], motion, 0, trial::STEP_S).map_err(PlanError::Simulate)
}
