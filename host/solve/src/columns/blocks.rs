//! Sums of the columns by blocks of stages.
//!
//! ```text
//!   stages   0 ─ 1 ─ 2 │ 3 ─ 4 ─ 5 │ 6 ─ 7        │: the chain breaks, a block begins
//!   S, s        block 0  +  block 1  +  block 2  =  all stages
//! ```
//! No state links two blocks, so what the elimination leaves of [β, γ] is a sum over blocks: the information and the score that each block has on its
//! own. Cross-validation over blocks and the scatter between blocks follow from these sums without another fit.

use std::sync::Mutex;

use super::sums::BlockSums;
use super::sweep::{Leave, sweep};
use super::{ExtraColumns, LeastSquares};
use crate::factor::Factor;

/// Takes what it wants of the sums of each block as the sweep leaves it.
struct Blocks<'a, T, F> {
    /// The first stage of every block, ascending.
    starts: &'a [usize],
    take: &'a F,
    taken: &'a Mutex<Vec<Option<T>>>,
}

impl<T, F: Fn(usize, &BlockSums<'_>) -> T> Blocks<'_, T, F> {
    fn take(&self, stage: usize, sums: &BlockSums<'_>) {
        let block = self.starts.partition_point(|start| *start <= stage).saturating_sub(1);
        let taken = (self.take)(block, sums);
        if let Ok(mut all) = self.taken.lock() {
            all[block] = Some(taken);
        }
    }
}

impl<T, F: Fn(usize, &BlockSums<'_>) -> T> Leave for Blocks<'_, T, F> {
    fn leave(&mut self, stage: usize, sums: &BlockSums<'_>) {
        self.take(stage, sums);
    }

    fn begins(&self, stage: usize) -> bool {
        self.starts.binary_search(&stage).is_ok()
    }
}

/// [`eliminate`](super::eliminate) by blocks: what `take` makes of each block's place and sums, in their order. `starts` are the first stages of all blocks,
/// ascending from stage 0; the chain must break before each of them.
///
/// Memory: the sums of the block that a sweep is in, (m + q)² a thread, and what `take` keeps.
pub fn block_sums<P: LeastSquares, T: Send>(
    (problem, point): (&P, &P::Point),
    factor: &Factor,
    extra: &impl ExtraColumns<P>,
    starts: &[usize],
    threads: usize,
    take: impl Fn(usize, &BlockSums<'_>) -> T + Sync,
) -> Vec<T> {
    debug_assert!(starts.first() == Some(&0) && starts.is_sorted(), "blocks begin with stage 0 and ascend");
    let taken = Mutex::new(starts.iter().map(|_| None).collect());
    let blocks = || Blocks { starts, take: &take, taken: &taken };
    let (mut left, mut right) = (blocks(), blocks());
    let (_, swept) = sweep((problem, point, extra), factor, threads, false, [&mut left, &mut right]);
    left.take(factor.middle(), &swept.block(extra.count()));
    taken.into_inner().unwrap_or_default().into_iter().flatten().collect()
}
