//! The small dense loops of the elimination, on matrices of [`Quad`](crate::simd::Quad)s: groups of four columns, one group after the other, so
//! that what a loop runs over is contiguous and needs no index.
//!
//! Matrices are built of one loop, the `tile`: four rows times two groups of `C ± Σ_k a[k]ᵀ b[k]`, whose eight sums stay in
//! registers while k runs. Eight are what two multiply-add units with a latency of four cycles need; twelve would leave the compiler
//! no register of sixteen to spare, and a sum that is spilled doubles the time. In a sweep the loops run at some nine tenths of what the units can
//! do. Registers of eight numbers (AVX-512) were tried: faster alone, no faster in a sweep, where all code around them got slower.
//! Only the groups on and above the diagonal of symmetric matrices are computed. The factorisation is `D = Uᵀ U`, so that the matrices
//! of all loops lie alike.

mod cholesky;
mod sums;
mod vectors;

pub use cholesky::{Pivot, factor};
pub use sums::{Add, Change, Rows, Set, Subtract, Sums, product, upper, upper_within};
pub use vectors::{Four, add_across, change_weighted, weighted};

use crate::simd::LANES;

/// The largest stage that the solver is made for: tests go so far.
pub const MAX_STAGE_SIZE: usize = 36;

/// Groups of four that hold `width` columns.
pub const fn groups(width: usize) -> usize {
    width.div_ceil(LANES)
}
