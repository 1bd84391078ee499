//! Motions tried on the robots that it may be: what they tell, how long they last, what they ask of the machine.

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

use protocol::{Motion, MotionEnd};

use super::{Belief, PlanError};
use crate::calibrate::information::{Information, SizedLaw, Weights};
use crate::simulate::{JointPeaks, Rehearsal, SimulateError, Truth};

/// Step of the plant's integration, s: half a tick. What a plan is chosen by changes by less than noise does.
pub const STEP_S: f64 = 5e-4;

/// What a motion did on one robot.
#[derive(Debug)]
pub struct Trial {
    /// None where it was not asked for, or the motion did not end as it should.
    pub information: Option<Information>,
    /// How the motion went.
    pub conduct: Conduct,
}

/// How a motion went.
#[derive(Debug, Clone, PartialEq)]
pub struct Conduct {
    /// How it ended.
    pub end: MotionEnd,
    /// Length, s.
    pub duration_s: f64,
    /// What each joint did.
    pub joints: Vec<JointPeaks>,
    /// Largest part of its bound that a watch reached.
    pub watch: f64,
    /// Largest part of its half range that a motor or link went from the middle.
    pub travel: f64,
    /// As in [`Rehearsal`].
    pub segments: [u8; 3],
}

impl Conduct {
    fn of(belief: &Belief, rehearsal: &Rehearsal) -> Self {
        let nearest = rehearsal.nearest;
        let away = belief.robot.joints.iter().zip(&rehearsal.joints).map(|(joint, peaks)| {
            let (middle, half) = (0.5 * (joint.limits[0] + joint.limits[1]), 0.5 * (joint.limits[1] - joint.limits[0]));
            peaks.travel.iter().fold(0.0_f64, |most, end| most.max((end - middle).abs() / half))
        });
        Self {
            end: rehearsal.end,
            duration_s: rehearsal.duration_s(),
            watch: nearest.stuck.max(nearest.wrong_way).max(nearest.rotation).into(),
            travel: away.fold(0.0, f64::max),
            joints: rehearsal.joints.clone(),
            segments: rehearsal.segments,
        }
    }
}

/// Plays every motion on every robot, in `threads` threads; trials by motion, then by robot. What they tell, of `laws` as well, is judged where there are weights for the robots.
/// Returns None where `go_on` said no.
///
/// # Errors
/// [`PlanError`] if the robot cannot be simulated, or what a motion tells cannot be judged.
pub fn try_all(
    belief: &Belief,
    truths: &[Truth],
    motions: &[Motion],
    (weights, laws): (Option<&[Weights]>, &[SizedLaw]),
    threads: usize,
    go_on: &(dyn Fn() -> bool + Sync),
) -> Result<Option<Vec<Vec<Trial>>>, PlanError> {
    let jobs = motions.len() * truths.len();
    let (next, done) = (AtomicUsize::new(0), Mutex::new(Vec::new()));
    std::thread::scope(|scope| {
        for _ in 0..threads.clamp(1, jobs.max(1)) {
            scope.spawn(|| {
                loop {
                    let job = next.fetch_add(1, Relaxed);
                    if job >= jobs || !go_on() {
                        return;
                    }
                    let (motion, robot) = (&motions[job / truths.len()], job % truths.len());
                    let weights = weights.map(|weights| (&weights[robot], laws));
                    let trial = try_one(belief, &truths[robot], motion, weights);
                    let failed = trial.is_err();
                    done.lock().unwrap_or_else(|e| e.into_inner()).push((job, trial));
                    if failed {
                        return;
                    }
                }
            });
        }
    });
    let mut done = done.into_inner().unwrap_or_else(|e| e.into_inner());
    done.sort_by_key(|(job, _)| *job);
    let mut trials: Vec<Vec<Trial>> = motions.iter().map(|_| Vec::new()).collect();
    let complete = done.len() == jobs;
    for (job, trial) in done {
        trials[job / truths.len()].push(trial?);
    }
    Ok(complete.then_some(trials))
}

fn try_one(
    belief: &Belief,
    truth: &Truth,
    motion: &Motion,
    judged: Option<(&Weights, &[SizedLaw])>,
) -> Result<Trial, PlanError> {
    // The same noise for every motion: plans differ by what they move.
    let rehearsal = Rehearsal::play(&belief.robot, truth, motion, 0, STEP_S).map_err(|error| match error {
        SimulateError::Unsuited { reason } => PlanError::Unsuited { reason },
        error => PlanError::Simulate(error),
    })?;
    let conduct = Conduct::of(belief, &rehearsal);
    let information = match judged.filter(|_| rehearsal.end == MotionEnd::Finished) {
        Some((weights, laws)) => {
            let known = (truth.as_slice(), laws);
            Some(Information::of(&belief.robot, known, &rehearsal.recording, weights)?)
        }
        None => None,
    };
    Ok(Trial { information, conduct })
}
