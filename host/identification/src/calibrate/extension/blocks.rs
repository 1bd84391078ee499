//! What blocks of time say of shared unknowns and of laws, each on its own, with all states eliminated.
//!
//! ```text
//!   trial ─▶ factor ─▶ sums of [β, γ] by block ─▶ Σ r² of block b at β + x:   squares_b + 2 s_bᵀ x + xᵀ K_b x
//! ```
//! The chain breaks between blocks, so a recording's Σ r² is the sum of such quadratics (and of the border's own rows, which know no block).
//! Cross-validation, the scatter between blocks and the constancy of a parameter follow from them without another search.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use super::bench::Bench;
use super::scores::Asked;
use super::trial::Trial;
use crate::calibrate::error::CalibrateError;
use crate::calibrate::residuals::problem::Problem;
use crate::model::Model;
use solve::border::Border;
use solve::columns::{BlockSums, Entries, ExtraColumns, block_sums};
use solve::factor::Factor;
use solve::inverse::log_determinants_of_states;

/// Σ r² of one block around a point: `squares + 2 gradientᵀ x + xᵀ information x`.
#[derive(Debug, Clone, PartialEq)]
pub struct Quadratic {
    /// Σ r² at the point, with the states at their Gauss–Newton step.
    pub squares: f64,
    /// Half its slope.
    pub gradient: DVector<f64>,
    /// Half its curvature.
    pub information: DMatrix<f64>,
}

impl Quadratic {
    /// Σ r² at x.
    pub fn at(&self, x: &DVector<f64>) -> f64 {
        self.squares + 2.0 * self.gradient.dot(x) + x.dot(&(&self.information * x))
    }
}

/// The blocks of a trial, in the free directions of its shared unknowns (each of about unit information), weighted as the trial is.
#[derive(Debug, Clone)]
pub struct BlockFit {
    /// Of every block.
    pub blocks: Vec<Quadratic>,
    /// Information of the rows that belong to no block.
    pub prior: DMatrix<f64>,
    /// Of every block: rows less states, the Σ r² that noise of the assumed size leaves.
    pub freedom: Vec<f64>,
    /// The free directions in the unknowns' own units, m × f.
    pub free: DMatrix<f64>,
    /// The coordinates of each law of the trial.
    pub laws: Vec<Range<usize>>,
    /// What the rows of every block are multiplied by.
    pub weights: Vec<f64>,
    /// Of every block, without its weight: ln |H_xx| less that of what is assumed of states which laws bring, the Laplace term of the marginal likelihood.
    pub log_determinants: Vec<f64>,
}

impl BlockFit {
    /// Of each block, the amplitude of `direction` (in the unknowns' own units, taken for 1 at the fit) that it shows by itself with all else where the fit has it, and the
    /// information that it has of it.
    pub fn amplitudes(&self, direction: &[f64]) -> Vec<(f64, f64)> {
        let d = self.free.clone().svd(true, true).solve(&DVector::from_row_slice(direction), 1e-12);
        let Ok(d) = d else { return Vec::new() };
        let of_block = |block: &Quadratic| {
            let information = d.dot(&(&block.information * &d));
            (1.0 - block.gradient.dot(&d) / information, information)
        };
        self.blocks.iter().map(of_block).collect()
    }
}

/// A parameter of a trial's dynamics: its slope there, and what steps make of it.
#[derive(Debug, Clone)]
pub struct ParameterAt {
    /// As in results.
    pub name: String,
    /// By free direction.
    pub slope: DVector<f64>,
    /// After each step.
    pub stepped: Vec<f64>,
}

/// What one block says of one law.
#[derive(Debug, Clone)]
pub struct LawBlock {
    /// f × d: free shared unknowns by columns.
    pub coupling: DMatrix<f64>,
    /// d × d.
    pub information: DMatrix<f64>,
    /// d.
    pub gradient: DVector<f64>,
}

/// The blocks of a trial with the columns of many laws beside.
#[derive(Debug, Clone)]
pub struct BlockScores {
    /// Without any of the laws.
    pub base: BlockFit,
    /// Of each law, all blocks; none of one that cannot be asked on top of the trial.
    pub laws: Vec<Option<Vec<LawBlock>>>,
    /// Columns of each law in [`information`](Self::information).
    pub columns: Vec<Option<Range<usize>>>,
    /// Of each block, what its rows count for beside those of the others.
    pub weights: Vec<f64>,
    /// q × q, all columns with the shared unknowns eliminated, summed over blocks by their weights; not finite where a column is not. Of two laws that are not
    /// crossed it says nothing.
    pub information: DMatrix<f64>,
    /// q: the same of each column if the shared unknowns were known.
    pub alone: DVector<f64>,
}

/// What is kept of the sums of one block.
pub(crate) struct Taken {
    squares: f64,
    pub(crate) shared: DMatrix<f64>,
    pub(crate) shared_gradient: DVector<f64>,
    laws: Vec<Option<LawBlock>>,
}

/// No columns but the Jacobian's own.
pub(crate) struct NoColumns;

impl<'m> ExtraColumns<Problem<'m>> for NoColumns {
    type Scratch = ();

    fn scratch(&self) {}

    fn count(&self) -> usize {
        0
    }

    fn fill(
        &self,
        _: &crate::calibrate::residuals::point::Point<'m>,
        _: usize,
        _: &mut (),
        _: &[solve::Stage],
        _: &mut [Entries],
    ) {
    }
}

impl<'a> Bench<'a> {
    /// What the blocks of this bench say of the shared unknowns of a trial on it.
    ///
    /// # Errors
    /// A trial that cannot be factorised.
    pub fn block_fit(&self, trial: &Trial) -> Result<BlockFit, CalibrateError> {
        let model = Model::extended(self.robot, trial.laws.clone())?;
        let (problem, point, held) = self.at(&model, &trial.known());
        let mut factor = Factor::new(&problem)?;
        factor.factorise_somehow(&problem, &point, self.settings.threads).map_err(solve::error::SolveError::from)?;
        let (information, gradient) = factor.schur();
        let mut border = Border::new(&information, &gradient, &held);
        border.hold_undetermined();
        let free = border.free_directions();
        Ok(self.fit_of((&problem, &point), (&factor, &free, &information)))
    }

    /// What the blocks of this bench say of `laws`, each on its own on top of `trial`. `weigh` tells of each block what its rows count for.
    /// What different laws have in common is told of the first `crossed` with all others.
    ///
    /// # Errors
    /// A trial that cannot be factorised.
    pub fn block_scores(
        &self,
        trial: &Trial,
        (laws, crossed): (&[std::sync::Arc<dyn crate::model::law::Law>], usize),
        weigh: impl Fn(&BlockFit) -> Vec<f64>,
    ) -> Result<BlockScores, CalibrateError> {
        let model = Model::extended(self.robot, trial.laws.clone())?;
        let (problem, point, held) = self.at(&model, &trial.known());
        let threads = self.settings.threads;
        let mut factor = Factor::new(&problem)?;
        factor.factorise_somehow(&problem, &point, threads).map_err(solve::error::SolveError::from)?;
        let (information, gradient) = factor.schur();
        let mut border = Border::new(&information, &gradient, &held);
        // A law of the trial may say in part what the base model does, as a gyro's scale and its rotation.
        border.hold_undetermined();
        let free = border.free_directions();
        let base = self.fit_of((&problem, &point), (&factor, &free, &information));
        let weights = weigh(&base);
        let models = self.with_each(&model, trial, laws);
        let (all, columns) = Asked::columns(self, (&problem, &model, &point), (&models, crossed), trial);
        // [rest | all columns]: with the sums of all columns in total, and those of each law alone by block.
        let total = std::sync::Mutex::new(Totals::new(free.ncols(), all.count()));
        let take = |block: usize, sums: &BlockSums<'_>| {
            if let Ok(mut total) = total.lock() {
                total.add(sums, &free, weights[block]);
            }
            taken(sums, &free, &columns)
        };
        let taken = block_sums((&problem, &point), &factor, &all, &self.block_starts, threads, take);
        let total = total.into_inner().map_err(|_| CalibrateError::Undetermined)?;
        let alone = total.information.diagonal();
        let weighted = base.blocks.iter().zip(&weights);
        let shared = weighted.fold(base.prior.clone(), |sum, (block, weight)| sum + *weight * &block.information);
        let by_columns = shared.cholesky().ok_or(CalibrateError::Undetermined)?.solve(&total.coupling);
        let information = &total.information - total.coupling.transpose() * by_columns;
        let of_law =
            |law: usize| columns[law].as_ref().and_then(|_| taken.iter().map(|t| t.laws[law].clone()).collect());
        let laws = (0..columns.len()).map(of_law).collect();
        Ok(BlockScores { base, laws, columns, weights, information, alone })
    }

    fn fit_of<'m>(
        &self,
        (problem, point): (&Problem<'m>, &crate::calibrate::residuals::point::Point<'m>),
        (factor, free, information): (&Factor, &DMatrix<f64>, &[f64]),
    ) -> BlockFit {
        let take = |_: usize, sums: &BlockSums<'_>| taken(sums, free, &[]);
        let threads = self.settings.threads;
        let taken = block_sums((problem, point), factor, &NoColumns, &self.block_starts, threads, take);
        let of_block = |taken: Taken| Quadratic {
            squares: taken.squares,
            gradient: taken.shared_gradient,
            information: taken.shared,
        };
        let blocks: Vec<Quadratic> = taken.into_iter().map(of_block).collect();
        let m = free.nrows();
        let whole = free.transpose() * DMatrix::from_row_slice(m, m, information) * free;
        let prior = blocks.iter().fold(whole, |rest, block| rest - &block.information);
        // Rounding leaves a little of it where there are no such rows.
        let prior = prior.symmetric_eigen();
        let kept = prior.eigenvalues.map(|value| if value > 1e-9 { value } else { 0.0 });
        let prior = &prior.eigenvectors * DMatrix::from_diagonal(&kept) * prior.eigenvectors.transpose();
        let size = problem.model.layout().size() as f64;
        let ranges = self.blocks();
        let mut log_determinants = log_determinants_of_states(factor, &self.block_starts);
        let mut freedom = Vec::with_capacity(ranges.len());
        for (range, log_determinant) in ranges.into_iter().zip(&mut log_determinants) {
            freedom.push(problem.rows_of(point, range.clone()) as f64 - size * range.len() as f64);
            let weight = problem.stage_weight(range.start);
            *log_determinant -= 2.0 * size * range.len() as f64 * weight.ln();
            *log_determinant -= self.assumed_of_added(problem, range);
        }
        let coordinates = problem.model.coordinates();
        let laws = problem.model.laws().iter().enumerate().map(|(law, own)| {
            let first = coordinates.first_of_law(law);
            first..first + own.parameters().coordinates.len()
        });
        let weights = self.block_starts.iter().map(|start| problem.stage_weight(*start)).collect();
        BlockFit { blocks, prior, freedom, free: free.clone(), laws: laws.collect(), weights, log_determinants }
    }

    /// 2 Σ ln(1/σ) of the rows that states which laws bring have of their own: what ln |H_xx| has of them where readings say nothing.
    fn assumed_of_added(&self, problem: &Problem<'_>, range: Range<usize>) -> f64 {
        let layout = problem.model.layout();
        let added: Vec<usize> =
            layout.own().chain(layout.passive()).chain(layout.passive().map(|i| layout.chain() + i)).collect();
        let of_step: f64 = added.iter().map(|i| problem.process_weight[*i].ln()).sum();
        let initial = problem.assumptions.initial;
        let of_start = -(problem.model.own_size().iter().map(|size| (size * initial.own).ln()).sum::<f64>()
            + 2.0 * layout.passive().count() as f64 * initial.windup.ln());
        let starts = range.clone().filter(|k| self.series.starts_run(*k)).count() as f64;
        let steps = range.filter(|k| problem.linked(*k)).count() as f64;
        2.0 * (steps * of_step + starts * of_start)
    }

    /// The parameters of a trial on this bench, their slopes at it and their values at `steps` from it, in free directions of [`BlockFit`].
    ///
    /// # Errors
    /// A model that cannot be built.
    pub fn parameters_at(
        &self,
        trial: &Trial,
        fit: &BlockFit,
        steps: &[DVector<f64>],
    ) -> Result<Vec<ParameterAt>, CalibrateError> {
        let model = Model::extended(self.robot, trial.laws.clone())?;
        let coordinates = model.coordinates();
        let known = trial.known();
        let z = super::warm_start::shared(&model, self.robot, &self.series, &known).z;
        let at = |step: &DVector<f64>| {
            let moved = &fit.free * step;
            coordinates.to_physical(&z.iter().zip(moved.iter()).map(|(z, d)| z + d).collect::<Vec<_>>())
        };
        let stepped: Vec<Vec<f64>> = steps.iter().map(at).collect();
        let parameter = |(i, (name, _)): (usize, (&str, &'static str))| {
            let mut slope = DVector::zeros(fit.free.ncols());
            for (own, by) in coordinates.physical_and_slopes(&z, i).1 {
                slope += by * fit.free.row(own).transpose();
            }
            ParameterAt { name: name.to_string(), slope, stepped: stepped.iter().map(|all| all[i]).collect() }
        };
        Ok(coordinates.names().enumerate().map(parameter).collect())
    }

    /// States of a sample of the base model.
    pub fn states(&self) -> usize {
        self.layout.size()
    }

    /// The stages of every block.
    pub fn blocks(&self) -> Vec<Range<usize>> {
        let ends = self.block_starts[1..].iter().copied().chain([self.series.stages()]);
        self.block_starts.iter().copied().zip(ends).map(|(start, end)| start..end).collect()
    }

    /// Of every block but the last, whether the next one follows on it without a pause.
    pub fn is_contiguous(&self) -> Vec<bool> {
        let period_s = self.series.median_period_s();
        let series = &self.series;
        let follows = |start: usize| {
            let pause_s = series.time_s(start) - series.time_s(start - 1);
            series.recording_of(start) == series.recording_of(start - 1) && pause_s < 2.0 * period_s
        };
        self.block_starts[1..].iter().map(|start| follows(*start)).collect()
    }

    /// So many stages in the middle of every block, with the trial's states there: what a scan looks at.
    pub fn thinned(&self, trial: &Trial, stages: usize) -> (Self, Trial) {
        let middle = |block: Range<usize>| {
            let start = block.start + block.len().saturating_sub(stages) / 2;
            start..block.end.min(start + stages)
        };
        let windows: Vec<Range<usize>> = self.blocks().into_iter().map(middle).collect();
        let (series, block_starts, places) = self.series.select(&windows);
        let size = trial.layout.size();
        let states = places.iter().flat_map(|k| trial.states[k * size..(k + 1) * size].iter().copied()).collect();
        let bench = Bench { series, block_starts, ..self.clone() };
        (bench, Trial { states, ..trial.clone() })
    }
}

/// Sums over blocks of all columns.
struct Totals {
    coupling: DMatrix<f64>,
    information: DMatrix<f64>,
}

impl Totals {
    fn new(free: usize, count: usize) -> Self {
        Totals { coupling: DMatrix::zeros(free, count), information: DMatrix::zeros(count, count) }
    }

    fn add(&mut self, sums: &BlockSums<'_>, free: &DMatrix<f64>, weight: f64) {
        let count = sums.count();
        let coupling = DMatrix::from_fn(sums.shared(), count, |i, j| sums.coupling(i, j));
        self.coupling += weight * (free.transpose() * coupling);
        for j in 0..count {
            for i in 0..count {
                self.information[(i, j)] += weight * sums.information(i, j);
            }
        }
    }
}

pub(crate) fn taken(sums: &BlockSums<'_>, free: &DMatrix<f64>, columns: &[Option<Range<usize>>]) -> Taken {
    let m = sums.shared();
    let of_law = |columns: &Range<usize>| LawBlock {
        coupling: free.transpose() * DMatrix::from_fn(m, columns.len(), |i, j| sums.coupling(i, columns.start + j)),
        information: DMatrix::from_fn(columns.len(), columns.len(), |i, j| {
            sums.information(columns.start + i, columns.start + j)
        }),
        gradient: DVector::from_fn(columns.len(), |j, _| sums.gradient(columns.start + j)),
    };
    Taken {
        squares: sums.squares(),
        shared: free.transpose() * DMatrix::from_fn(m, m, |i, j| sums.shared_information(i, j)) * free,
        shared_gradient: free.transpose() * DVector::from_fn(m, |i, _| sums.shared_gradient(i)),
        laws: columns.iter().map(|columns| columns.as_ref().map(of_law)).collect(),
    }
}
