//! Windows of a recording as a problem of their own, for what a part of the samples tells as well as all of them.
//!
//! ```text
//! runs     ├──────────────┤ ├────┤ ├─────────────────────────┤      between gaps
//! windows        ├───────────────┤            ├─────────┤            no end of one leaves a lone piece of a run
//! ```

use std::ops::Range;

use crate::calibrate::data::series::SHORTEST_RUN;
use crate::calibrate::residuals::point::Point;
use crate::calibrate::residuals::problem::Problem;
use solve::{BATCH, LeastSquares, Shape, Stage, Step};

/// Windows, where the recording is longer than they are.
const WINDOWS: usize = 10;

/// Samples of a run that an end of a window leaves at least: a lone one does not determine its own states. Runs have [`SHORTEST_RUN`] samples and
/// windows end at batches, so that the next batch or the one after it will do.
const SHORTEST_PIECE: usize = SHORTEST_RUN - BATCH + 1;

/// Windows of a problem's stages as a problem of their own; the point stays that of the whole.
pub(crate) struct Windows<'a, 'm> {
    problem: &'a Problem<'m>,
    /// First stage of each window in the whole, a multiple of [`BATCH`] as their lengths are; the last one may be shorter.
    windows: Vec<Range<usize>>,
    /// Stages before each window.
    before: Vec<usize>,
    stages: usize,
}

impl<'a, 'm> Windows<'a, 'm> {
    pub(crate) fn of(problem: &'a Problem<'m>, samples: usize) -> Self {
        let windows = windows(&problem.series.segments, problem.series.stages(), samples);
        let mut stages = 0;
        let before = windows
            .iter()
            .map(|window| {
                stages += window.len();
                stages - window.len()
            })
            .collect();
        Windows { problem, windows, before, stages }
    }

    /// The stage of the whole, and where its window ends.
    pub(crate) fn stage(&self, k: usize) -> (usize, usize) {
        let window = self.before.partition_point(|before| *before <= k) - 1;
        (self.windows[window].start + k - self.before[window], self.windows[window].end)
    }
}

impl<'m> LeastSquares for Windows<'_, 'm> {
    type Point = Point<'m>;
    type Scratch = crate::calibrate::residuals::problem::Scratch;

    fn scratch(&self) -> Self::Scratch {
        self.problem.scratch()
    }

    fn shape(&self) -> Shape {
        Shape { stages: self.stages, ..self.problem.shape() }
    }

    fn linearise(&self, point: &Point<'m>, first: usize, scratch: &mut Self::Scratch, batch: &mut [Stage]) {
        let (start, end) = self.stage(first);
        self.problem.linearise(point, start, scratch, batch);
        if start + batch.len() == end
            && let Some(last) = batch.last_mut()
        {
            last.unlink();
        }
    }

    fn cost(&self, point: &Point<'m>, stages: Range<usize>, scratch: &mut Self::Scratch) -> f64 {
        stages.map(|k| self.stage(k).0).map(|k| self.problem.cost(point, k..k + 1, scratch)).sum()
    }

    fn retract(&self, point: &Point<'m>, step: &Step, to: &mut Point<'m>) {
        to.clone_from(point);
        let size = self.shape().stage;
        for k in 0..self.stages {
            let at = self.stage(k).0 * size;
            for (x, dx) in to.states[at..at + size].iter_mut().zip(&step.states[k * size..]) {
                *x += dx;
            }
        }
    }
}

/// About `samples` of so many stages in windows that begin at a batch, all of them where there are not many more.
fn windows(runs: &[Range<usize>], whole: usize, samples: usize) -> Vec<Range<usize>> {
    let length = (samples / WINDOWS).next_multiple_of(BATCH);
    if whole <= length * (WINDOWS + 1) {
        return std::iter::once(0..whole).collect();
    }
    let run = |at: usize| &runs[runs.partition_point(|run| run.end <= at)];
    let next = |wanted: usize, fits: &dyn Fn(usize) -> bool| (wanted..whole).step_by(BATCH).find(|at| fits(*at));
    let begins = |at: usize| run(at).start == at || run(at).end - at >= SHORTEST_PIECE;
    let ends = |at: usize| run(at).start == at || at - run(at).start >= SHORTEST_PIECE;
    let first = |w: usize| (w * (whole - length) / (WINDOWS - 1)) / BATCH * BATCH;
    let mut end = 0;
    (0..WINDOWS)
        .filter_map(|w| {
            let start = next(first(w).max(end), &begins)?;
            end = next(start + length, &ends).unwrap_or(whole);
            Some(start..end)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn no_window_leaves_a_lone_piece_of_a_run(
            lengths in prop::collection::vec(SHORTEST_RUN..60, 120..400),
            samples in 400usize..1200,
        ) {
            let mut whole = 0;
            let runs: Vec<Range<usize>> = lengths
                .iter()
                .map(|length| {
                    whole += length;
                    whole - length..whole
                })
                .collect();
            let windows = windows(&runs, whole, samples);
            prop_assert!(windows.windows(2).all(|pair| pair[0].end <= pair[1].start), "{windows:?}");
            prop_assert!(windows.iter().all(|w| w.start % BATCH == 0 && (w.end == whole || w.len() % BATCH == 0)));
            let looked_at: usize = windows.iter().map(|w| w.len()).sum();
            prop_assert!(whole == looked_at || looked_at.abs_diff(samples) <= 20 * BATCH, "{looked_at} of {samples}");
            for run in &runs {
                for window in &windows {
                    let piece = run.end.min(window.end).saturating_sub(run.start.max(window.start));
                    prop_assert!(piece == 0 || piece >= SHORTEST_PIECE, "{piece} samples of {run:?} in {window:?}");
                }
            }
        }
    }
}
