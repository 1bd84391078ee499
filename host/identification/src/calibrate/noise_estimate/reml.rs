//! Noise from the recording: restricted maximum likelihood for the standard deviation of every channel and of every state component's step.
//!
//! Residuals are smaller than the noise, because the states follow it: N_g rows of a group g have but N_g − tr_g degrees of freedom, tr_g the trace
//! of the hat matrix J H⁻¹ Jᵀ over them. The likelihood of what the states leave, in θ_g = ln σ_g², has
//!
//! ```text
//!   slope        ½ (Σ_g r² − dof_g)                       zero where σ_g² = Σ r² / dof_g: χ² per degree of freedom is 1
//!   information  ½ w_gᵀ (I − J H⁻¹ Jᵀ) w_h                the average of observed and expected; w_g: residuals of group g alone
//! ```
//! (Patterson and Thompson 1971; Gilmour, Thompson and Cullis 1995.) All of it comes from one elimination of extra columns: w_g as they are,
//! and random signs on the rows of g, whose quadratic form is dof_g on average with as small an error as Σ r² has itself. The shared
//! parameters stay where they are meanwhile, two dozen degrees of freedom of 10⁵. Contiguous windows of the recording are enough.
//!
//! Positions have no noise of their own: what a step misses is an acceleration, or the error of a measured input, and the position follows.

use nalgebra::{DMatrix, DVector};

use super::floor;
use super::windows::Windows;
use crate::calibrate::residuals::noise::{self, LEAST_SPEED, Noise};
use crate::calibrate::residuals::point::Point;
use crate::calibrate::residuals::problem::Problem;
use crate::model::Layout;
use crate::robot::{InputNoise, Robot};
use solve::columns::{self, Entries, ExtraColumns};
use solve::error::SolveError;
use solve::factor::Factor;
use solve::{LeastSquares, Stage, Step};

/// Samples that are looked at, where the recording is longer.
const SAMPLES: usize = 12_000;
/// Samples for a look at what is left.
const FEW_SAMPLES: usize = 8_000;
/// Random vectors: the error of dof_g is that of Σ r² over the root of their number.
const PROBES: usize = 1;
/// Rounds at most, and the gain in log-likelihood that a further one must promise: ten nats are 3 % of the noise of a channel that is looked at so
/// often.
const MOST_ROUNDS: usize = 8;
const LEAST_GAIN: f64 = 10.0;
/// Largest change of ln σ² in a round: a factor of ten in σ.
const LARGEST_CHANGE: f64 = 4.6;
/// A row of no group.
const NO_GROUP: u8 = u8::MAX;

/// How an estimate of the noise went.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Estimate {
    /// What it could not fall below.
    pub floor: Noise,
    /// Rounds that it took.
    pub rounds: usize,
}

/// What is left in the residuals at a solution.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Residue {
    /// What estimates of the noise could not fall below.
    pub floor: Option<Noise>,
    /// Degrees of freedom that a row has, of channels and then of state components; not a number where there is no row.
    pub freedom: Vec<f64>,
    /// Of state components; none where there are too few degrees of freedom.
    pub process_chi2_per_dof: Vec<Option<f64>>,
}

/// χ² per degree of freedom of fewer degrees says nothing.
pub(crate) const FEWEST_DEGREES: f64 = 30.0;

/// Residuals and random signs of every group, a column each.
struct GroupColumns<'a> {
    groups: usize,
    /// Groups of the rows of each stage, in the order of [`Stage::residuals`].
    labels: &'a [Vec<u8>],
    probes: usize,
}

impl<P: LeastSquares> ExtraColumns<P> for GroupColumns<'_> {
    type Scratch = ();

    fn scratch(&self) {}

    fn count(&self) -> usize {
        self.groups * (self.probes + 1)
    }

    fn fill(&self, _: &P::Point, first: usize, _: &mut (), stages: &[Stage], entries: &mut [Entries]) {
        for (k, (stage, entries)) in (first..).zip(stages.iter().zip(entries)) {
            for (i, ((row, residual), label)) in stage.residuals().zip(&self.labels[k]).enumerate() {
                if *label == NO_GROUP {
                    continue;
                }
                let mut signs = scrambled((k as u64) << 16 | i as u64);
                for probe in 0..self.probes {
                    let sign = if signs & 1 == 0 { 1.0 } else { -1.0 };
                    signs >>= 1;
                    entries.add(row, probe * self.groups + usize::from(*label), sign);
                }
                entries.add(row, self.probes * self.groups + usize::from(*label), residual);
            }
        }
    }
}

/// Sixty-four random bits that belong to `key` (the mixing function of SplitMix64): whatever thread asks, the same.
fn scrambled(key: u64) -> u64 {
    let mut z = key.wrapping_add(0x9e37_79b9_7f4a_7c15).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ z >> 31
}

/// The windows with the groups of all their rows.
struct Grouped<'a, 'm> {
    windows: Windows<'a, 'm>,
    labels: Vec<Vec<u8>>,
    /// Rows of every group.
    rows: Vec<usize>,
}

impl<'a, 'm> Grouped<'a, 'm> {
    fn of(problem: &'a Problem<'m>, point: &Point<'m>, samples: usize) -> Self {
        let windows = Windows::of(problem, samples);
        let (channels, size) = (problem.series.channels.len(), problem.shape().stage);
        let mut rows = vec![0; channels + size];
        let mut scratch = problem.scratch();
        let labels = (0..windows.shape().stages)
            .map(|k| {
                let (k, end) = windows.stage(k);
                let mut kinds: [Vec<u8>; 3] = Default::default();
                problem.row_channels(point, k, &mut scratch, |kind, channel| {
                    kinds[kind].push(channel.map_or(NO_GROUP, |channel| channel as u8));
                });
                let mut labels = kinds.concat();
                if problem.linked(k) && k + 1 < end {
                    labels.extend((channels..channels + size).map(|group| group as u8));
                }
                for label in labels.iter().filter(|label| **label != NO_GROUP) {
                    rows[usize::from(*label)] += 1;
                }
                labels
            })
            .collect();
        Grouped { windows, labels, rows }
    }

    /// dof of every group, Σ r² at the states' Gauss–Newton step, and `w_gᵀ (I − J H⁻¹ Jᵀ) w_h`.
    fn statistics(
        &self,
        point: &Point<'m>,
        factor: &Factor,
        probes: usize,
        threads: usize,
    ) -> (Vec<f64>, DVector<f64>, DMatrix<f64>) {
        let groups = self.rows.len();
        let extra = GroupColumns { groups, labels: &self.labels, probes };
        let reduced = columns::eliminate(&self.windows, point, factor, &extra, threads);
        let dof = (0..groups).map(|g| {
            let forms = (0..probes).map(|probe| reduced.information[(probe * groups + g, probe * groups + g)]);
            forms.sum::<f64>() / probes as f64
        });
        let dof = dof.collect();
        let first = probes * groups;
        let squares = reduced.gradient.rows(first, groups).into_owned();
        (dof, squares, reduced.information.view((first, first), (groups, groups)).into_owned())
    }

    fn freedom(&self, dof: &[f64]) -> Vec<f64> {
        // A trace lies between nothing and all rows, whatever a probe says.
        dof.iter().zip(&self.rows).map(|(dof, rows)| (dof / *rows as f64).clamp(0.0, 1.0)).collect()
    }
}

/// Looks at the residuals at a solution, in some windows.
pub(crate) fn residue(problem: &Problem<'_>, point: &Point<'_>, threads: usize) -> Result<Residue, SolveError> {
    let grouped = Grouped::of(problem, point, FEW_SAMPLES);
    let mut factor = Factor::new(&grouped.windows)?;
    if factor.factorise(&grouped.windows, point, 0.0, threads).is_err() {
        // A window knows less of its outermost states than the whole does: the result stands, this part of it is not told.
        let freedom = vec![f64::NAN; grouped.rows.len()];
        let process_chi2_per_dof = vec![None; problem.shape().stage];
        return Ok(Residue { floor: None, freedom, process_chi2_per_dof });
    }
    let (dof, squares, _) = grouped.statistics(point, &factor, PROBES, threads);
    let process = problem.series.channels.len()..grouped.rows.len();
    let chi2 = |g: usize| (dof[g] >= FEWEST_DEGREES).then(|| squares[g] / dof[g]);
    Ok(Residue { floor: None, freedom: grouped.freedom(&dof), process_chi2_per_dof: process.map(chi2).collect() })
}

/// Estimates the noise of `problem`, whose solution under its present noise is `point`; `problem` is left with the estimate.
pub(crate) fn estimate<'m>(
    problem: &mut Problem<'m>,
    robot: &Robot,
    point: &Point<'m>,
    threads: usize,
) -> Result<Estimate, SolveError> {
    let floor = floor::floor(problem, robot, point);
    let mut ascent = Ascent::new(problem, robot, floor, point.clone(), threads);
    problem.set_noise(ascent.bounded(problem.noise().clone()));
    let rounds = ascent.climb(problem)?;
    Ok(Estimate { floor: ascent.floor, rounds })
}

/// `point` with the states' step under the noise of `problem`, the shared unknowns where they are.
pub(crate) fn states<'m>(problem: &Problem<'m>, point: &Point<'m>, threads: usize) -> Result<Point<'m>, SolveError> {
    let mut factor = Factor::new(problem)?;
    factor.factorise_somehow(problem, point, threads)?;
    let mut step = Step::default();
    factor.back_substitute(&vec![0.0; problem.border().size()], threads, &mut step);
    let mut moved = point.clone();
    problem.retract(point, &step, &mut moved);
    Ok(moved)
}

/// A search for the noise at fixed shared unknowns, the states following.
struct Ascent<'m> {
    floor: Noise,
    point: Point<'m>,
    layout: Layout,
    /// Components whose steps have no noise of their own, and those whose noise is not estimated.
    exact: Vec<usize>,
    given: Vec<usize>,
    period_s: f64,
    threads: usize,
}

impl<'m> Ascent<'m> {
    fn new(problem: &Problem<'m>, robot: &Robot, floor: Noise, point: Point<'m>, threads: usize) -> Self {
        let layout = problem.model.layout().clone();
        let exact = noise::exact_steps(&layout);
        // States that a law brings have the noise of its physics; estimated, it would be a free disturbance.
        let mut given: Vec<usize> = layout.own().chain(exact.iter().copied()).collect();
        if robot.input_noise() != InputNoise::Unknown {
            given.extend(layout.inputs());
        }
        Ascent { floor, point, layout, exact, given, period_s: problem.series.median_period_s(), threads }
    }

    /// This noise, no lower than makes sense.
    fn bounded(&self, mut noise: Noise) -> Noise {
        for component in &self.exact {
            noise.process[*component] = self.floor.process[*component];
        }
        noise.join_positions(&self.layout, self.period_s, LEAST_SPEED);
        noise
    }

    /// Takes steps of all standard deviations until one promises little; how many were taken.
    fn climb(&mut self, problem: &mut Problem<'m>) -> Result<usize, SolveError> {
        let channels = problem.series.channels.len();
        let mut rounds = 0;
        let mut last: Option<(DVector<f64>, DVector<f64>)> = None;
        loop {
            rounds += 1;
            let grouped = Grouped::of(problem, &self.point, SAMPLES);
            let factor = self.follow(&grouped)?;
            let (dof, squares, information) = grouped.statistics(&self.point, &factor, PROBES, self.threads);

            let lowest: Vec<f64> = self.floor.channels.iter().chain(&self.floor.process).copied().collect();
            let present: Vec<f64> = problem.noise().channels.iter().chain(&problem.noise().process).copied().collect();
            let slope = DVector::from_fn(dof.len(), |g, _| 0.5 * (squares[g] - dof[g]));
            let free: Vec<usize> = (0..dof.len())
                .filter(|&g| {
                    grouped.rows[g] > 0
                        && !(g >= channels && self.given.contains(&(g - channels)))
                        && (present[g] > 1.001 * lowest[g] || slope[g] > 0.0)
                })
                .collect();
            let newton = newton(&free, &slope, &(0.5 * information), &dof);
            let mut next = present.clone();
            let mut made = DVector::zeros(slope.len());
            let mut gain = 0.0;
            for (&g, newton) in free.iter().zip(newton.iter()) {
                let newton = newton.clamp(-LARGEST_CHANGE, LARGEST_CHANGE);
                let change =
                    last.as_ref().map_or(newton, |(made, before)| between(newton, slope[g], made[g], before[g]));
                next[g] = (present[g] * (0.5 * change).exp()).max(lowest[g]);
                made[g] = 2.0 * (next[g] / present[g]).ln();
                gain += 0.5 * slope[g] * made[g];
            }
            last = Some((made, slope));
            let process = next.split_off(channels);
            let noise = self.bounded(Noise { channels: next, process });
            tracing::debug!(rounds, gain, ?noise, "restricted maximum likelihood");
            problem.set_noise(noise);
            if gain < LEAST_GAIN || rounds == MOST_ROUNDS {
                return Ok(rounds);
            }
        }
    }

    /// The states' step under the present weights, the shared parameters where they are; the factor there.
    fn follow(&mut self, grouped: &Grouped<'_, 'm>) -> Result<Factor, SolveError> {
        let mut factor = Factor::new(&grouped.windows)?;
        factor.factorise_somehow(&grouped.windows, &self.point, self.threads)?;
        let mut step = Step::default();
        factor.back_substitute(&vec![0.0; grouped.windows.shape().border], self.threads, &mut step);
        let mut moved = self.point.clone();
        grouped.windows.retract(&self.point, &step, &mut moved);
        self.point = moved;
        factor.factorise_somehow(&grouped.windows, &self.point, self.threads)?;
        Ok(factor)
    }
}

/// The step of a group: Newton's; where the last one, `made`, overshot the top of the likelihood (its slope was `before`), the secant's, or two
/// steps may jump to and fro for ever.
fn between(newton: f64, slope: f64, made: f64, before: f64) -> f64 {
    if slope * before >= 0.0 || made == 0.0 {
        return newton;
    }
    let secant = -made * slope / (slope - before);
    if secant.abs() < newton.abs() { secant } else { newton }
}

/// The step of the free groups. Where the information of a group is little beside its slope, the fixed point σ² ← Σ r² / dof steadies it.
fn newton(free: &[usize], slope: &DVector<f64>, information: &DMatrix<f64>, dof: &[f64]) -> DVector<f64> {
    let count = free.len();
    let reduced = DMatrix::from_fn(count, count, |i, j| {
        let own = if i == j { 1e-3 * 0.5 * dof[free[i]].max(1.0) } else { 0.0 };
        information[(free[i], free[j])] + own
    });
    let slope = DVector::from_fn(count, |i, _| slope[free[i]]);
    reduced.cholesky().map_or_else(|| DVector::zeros(count), |factor| factor.solve(&slope))
}
