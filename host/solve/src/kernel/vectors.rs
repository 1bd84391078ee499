//! Sums of vectors: products of a matrix with a vector.

use super::Change;
use crate::simd::{LANES, Quad, Simd};

/// Four numbers of any precision.
pub trait Four {
    /// In double precision.
    fn load<S: Simd>(&self, simd: S) -> S::Vector;
}

impl Four for Quad {
    #[inline(always)]
    fn load<S: Simd>(&self, simd: S) -> S::Vector {
        simd.load(&self.0)
    }
}

/// `Σ_k group[k] by[k]`.
#[inline(always)]
pub fn weighted<S: Simd, F: Four>(simd: S, group: &[F], by: &[f64]) -> S::Vector {
    let (mut even, mut odd) = (simd.splat(0.0), simd.splat(0.0));
    let ((pairs, last), (by_pairs, by_last)) = (group.as_chunks::<2>(), by.as_chunks::<2>());
    for ([a, b], [x, y]) in pairs.iter().zip(by_pairs) {
        even = simd.mul_add(a.load(simd), simd.splat(*x), even);
        odd = simd.mul_add(b.load(simd), simd.splat(*y), odd);
    }
    for (a, x) in last.iter().zip(by_last) {
        even = simd.mul_add(a.load(simd), simd.splat(*x), even);
    }
    simd.add(even, odd)
}

/// Changes the vector `to`, four numbers a group, by `Σ_k groups[k] by[k]`; groups of so many rows.
#[inline(always)]
pub fn change_weighted<S: Simd, F: Four, C: Change>(
    simd: S,
    groups: &[F],
    rows: usize,
    by: &[f64],
    to: &mut [[f64; LANES]],
) {
    debug_assert_eq!(groups.len(), to.len() * rows, "a group has a place in the vector");
    let zero = simd.splat(0.0);
    let mut pairs = groups.chunks_exact(2 * rows);
    let (to_pairs, to_last) = to.as_chunks_mut::<2>();
    for (pair, to) in (&mut pairs).zip(to_pairs) {
        let (first, second) = pair.split_at(rows);
        let (first, second) = (&first[..by.len()], &second[..by.len()]);
        let mut sums = [zero; 4];
        let even = by.len() - by.len() % 2;
        for k in (0..even).step_by(2) {
            let (x, y) = (simd.splat(by[k]), simd.splat(by[k + 1]));
            sums[0] = simd.mul_add(first[k].load(simd), x, sums[0]);
            sums[1] = simd.mul_add(second[k].load(simd), x, sums[1]);
            sums[2] = simd.mul_add(first[k + 1].load(simd), y, sums[2]);
            sums[3] = simd.mul_add(second[k + 1].load(simd), y, sums[3]);
        }
        for k in even..by.len() {
            let x = simd.splat(by[k]);
            sums[0] = simd.mul_add(first[k].load(simd), x, sums[0]);
            sums[1] = simd.mul_add(second[k].load(simd), x, sums[1]);
        }
        to[0] = simd.store(C::of(simd, &Quad(to[0]), simd.add(sums[0], sums[2])));
        to[1] = simd.store(C::of(simd, &Quad(to[1]), simd.add(sums[1], sums[3])));
    }
    let last = pairs.remainder();
    if let ([to], false) = (to_last, last.is_empty()) {
        *to = simd.store(C::of(simd, &Quad(*to), weighted(simd, &last[..by.len()], by)));
    }
}

/// The sum of every vector.
#[inline(always)]
pub fn add_across<S: Simd>(simd: S, v: [S::Vector; LANES]) -> S::Vector {
    let [a, b, c, d] = simd.transpose(v);
    simd.add(simd.add(a, b), simd.add(c, d))
}
