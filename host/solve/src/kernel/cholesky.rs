//! `D = Uᵀ U`, left-looking by blocks of four, whose diagonal blocks are factored as `L diag Lᵀ`: one division a pivot on the critical path, the roots
//! come afterwards, four at a time.

use super::Subtract;
use super::sums::{change, narrow_tile, tile};
use super::vectors::weighted;
use crate::simd::{LANES, Quad, Simd};

/// The pivot of a factorisation that was not positive: its index and value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pivot {
    /// Index of the unknown in its stage.
    pub index: usize,
    /// The value that should have been positive.
    pub value: f64,
}

/// `D = L diag(d) Lᵀ` of a 4×4 block: what its rows need to be solved with.
struct Diagonal {
    /// `below[i][j]`, i < j: the multiple of row i that row j loses.
    below: [[f64; LANES]; LANES],
    /// 1/√d.
    scale: [f64; LANES],
}

impl Diagonal {
    /// Factors the upper triangle of `a`.
    #[inline(always)]
    fn of<S: Simd>(simd: S, mut a: [[f64; LANES]; LANES]) -> Result<Self, Pivot> {
        let mut below = [[0.0; LANES]; LANES];
        let mut inverse = [0.0; LANES];
        for i in 0..LANES {
            inverse[i] = 1.0 / a[i][i];
            for j in i + 1..LANES {
                below[i][j] = a[i][j] * inverse[i];
                for k in j..LANES {
                    a[j][k] -= below[i][j] * a[i][k];
                }
            }
        }
        for i in 0..LANES {
            // Also refuses NaN. Comparisons, because asking whether a number is finite takes a dozen steps of integers.
            if !(a[i][i] > 0.0 && a[i][i] <= f64::MAX) {
                return Err(Pivot { index: i, value: a[i][i] });
            }
        }
        Ok(Diagonal { below, scale: simd.store(simd.sqrt(simd.load(&inverse))) })
    }

    /// The four rows of a group, solved with.
    #[inline(always)]
    fn solve<S: Simd>(&self, simd: S, rows: &mut [Quad]) {
        let mut x = [simd.splat(0.0); LANES];
        for r in 0..LANES {
            x[r] = simd.load(&rows[r].0);
            for above in 0..r {
                x[r] = simd.mul_sub_from(simd.splat(self.below[above][r]), x[above], x[r]);
            }
        }
        for r in 0..LANES {
            rows[r].0 = simd.store(simd.mul(x[r], simd.splat(self.scale[r])));
        }
    }

    /// Of the right-hand side, which has lost `loss`.
    #[inline(always)]
    fn solve_right(&self, right: &mut [f64], loss: [f64; LANES]) {
        let x0 = right[0] - loss[0];
        let x1 = right[1] - loss[1] - self.below[0][1] * x0;
        let x2 = right[2] - loss[2] - self.below[0][2] * x0 - self.below[1][2] * x1;
        let x3 = right[3] - loss[3] - self.below[0][3] * x0 - self.below[1][3] * x1 - self.below[2][3] * x2;
        for ((right, x), scale) in right.iter_mut().zip([x0, x1, x2, x3]).zip(self.scale) {
            *right = x * scale;
        }
    }
}

/// Factors the leading block of `front` (by groups of as many rows as `right` has) as `Uᵀ U` and solves with it the columns behind and the vector
/// `right`: `front` becomes `[U | U⁻ᵀ rest]`, with the reciprocals of U's diagonal on the diagonal and what is below the diagonal blocks
/// untouched.
#[inline(always)]
pub fn factor<S: Simd>(simd: S, front: &mut [Quad], right: &mut [f64]) -> Result<(), Pivot> {
    let n = right.len();
    for block in 0..n / LANES {
        let first = block * LANES;
        let rest = &mut front[block * n..];
        let (own, behind) = rest.split_at_mut(n);
        let (above, own) = own.split_at_mut(first);
        let above = &*above;
        // The four rows lose what the rows above say of them; the diagonal block first, because its pivots wait for one another while the
        // others' sums need not.
        let own = &mut own[..LANES];
        change::<S, Subtract>(simd, own, narrow_tile(simd, above, above));
        let d = match Diagonal::of(simd, [own[0].0, own[1].0, own[2].0, own[3].0]) {
            Ok(d) => d,
            Err(pivot) => return Err(Pivot { index: first + pivot.index, ..pivot }),
        };
        if block > 0 {
            let mut pairs = behind.chunks_exact_mut(2 * n);
            for pair in &mut pairs {
                let (b, c) = pair.split_at_mut(n);
                let (x, y) = tile(simd, above, &b[..first], &c[..first]);
                change::<S, Subtract>(simd, &mut b[first..], x);
                change::<S, Subtract>(simd, &mut c[first..], y);
            }
            let b = pairs.into_remainder();
            if !b.is_empty() {
                let sum = narrow_tile(simd, above, &b[..first]);
                change::<S, Subtract>(simd, &mut b[first..], sum);
            }
        }
        let loss = simd.store(weighted(simd, above, &right[..first]));
        d.solve_right(&mut right[first..first + LANES], loss);
        d.solve(simd, own);
        for (i, scale) in d.scale.into_iter().enumerate() {
            own[i].0[i] = scale;
        }
        for group in behind.chunks_exact_mut(n) {
            d.solve(simd, &mut group[first..first + LANES]);
        }
    }
    Ok(())
}
