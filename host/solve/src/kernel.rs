//! The small dense loops of the elimination, on matrices of [`Quad`]s: groups of four columns, one group after the other, so that what a
//! loop runs over is contiguous and needs no index.
//!
//! Everything is built of one loop, the `tile`: four rows times two groups of `C ± Σ_k a[k]ᵀ b[k]`, whose eight sums stay in
//! registers while k runs. Eight are what two multiply-add units with a latency of four cycles need; twelve would leave the compiler
//! no register of sixteen to spare, and a sum that is spilled doubles the time.
//! Only the groups on and above the diagonal of symmetric matrices are computed. The factorisation is `D = Uᵀ U`, so that the matrices
//! of all loops lie alike: left-looking by blocks of four, whose diagonal blocks are factored as `L diag Lᵀ` (one division a pivot on
//! the critical path, the roots come afterwards, four at a time).

use crate::simd::{LANES, Quad, Simd};

/// The largest stage that can be solved.
pub const MAX_STAGE_SIZE: usize = 36;

/// Groups of four that hold `width` columns.
pub const fn groups(width: usize) -> usize {
    width.div_ceil(LANES)
}

/// Rows that are multiplied with themselves.
#[derive(Debug, Clone, Copy)]
pub struct Rows<'a> {
    /// The matrix by groups: row k of group g is at `g · capacity + k`.
    pub values: &'a [Quad],
    /// Rows that a group has room for.
    pub capacity: usize,
    /// Rows that are there.
    pub count: usize,
}

impl<'a> Rows<'a> {
    #[inline(always)]
    fn group(&self, g: usize) -> &'a [Quad] {
        &self.values[g * self.capacity..][..self.count]
    }
}

/// A matrix that sums are added to, by groups.
#[derive(Debug)]
pub struct Sums<'a> {
    /// Row i of group g is at `g · rows + i`.
    pub values: &'a mut [Quad],
    /// Rows of a group.
    pub rows: usize,
}

/// `out[r] ± = sum[r]`.
#[inline(always)]
fn add_to<S: Simd, const SUBTRACT: bool>(simd: S, out: &mut [Quad], sum: [S::Vector; LANES]) {
    for (out, sum) in out[..LANES].iter_mut().zip(sum) {
        let before = simd.load(&out.0);
        *out = Quad(simd.store(if SUBTRACT { simd.sub(before, sum) } else { simd.add(before, sum) }));
    }
}

/// Four rows of two groups of sums: `± Σ_k a[k]_r b[k]`, `± Σ_k a[k]_r c[k]`.
#[inline(always)]
fn tile<S: Simd>(simd: S, a: &[Quad], b: &[Quad], c: &[Quad]) -> ([S::Vector; LANES], [S::Vector; LANES]) {
    let zero = simd.splat(0.0);
    let (mut first, mut second) = ([zero; LANES], [zero; LANES]);
    for ((a, b), c) in a.iter().zip(b).zip(c) {
        let (b, c) = (simd.load(&b.0), simd.load(&c.0));
        for r in 0..LANES {
            let factor = simd.splat(a.0[r]);
            first[r] = simd.mul_add(factor, b, first[r]);
            second[r] = simd.mul_add(factor, c, second[r]);
        }
    }
    (first, second)
}

/// [`tile`] of one group.
#[inline(always)]
fn narrow_tile<S: Simd>(simd: S, a: &[Quad], b: &[Quad]) -> [S::Vector; LANES] {
    // Even and odd rows apart: four sums alone would wait for one another.
    let (mut even, mut odd) = ([simd.splat(0.0); LANES], [simd.splat(0.0); LANES]);
    let ((a2, a1), (b2, b1)) = (a.as_chunks::<2>(), b.as_chunks::<2>());
    for (a, b) in a2.iter().zip(b2) {
        let (b0, b1) = (simd.load(&b[0].0), simd.load(&b[1].0));
        for r in 0..LANES {
            even[r] = simd.mul_add(simd.splat(a[0].0[r]), b0, even[r]);
            odd[r] = simd.mul_add(simd.splat(a[1].0[r]), b1, odd[r]);
        }
    }
    for (a, b) in a1.iter().zip(b1) {
        let b = simd.load(&b.0);
        for r in 0..LANES {
            even[r] = simd.mul_add(simd.splat(a.0[r]), b, even[r]);
        }
    }
    for r in 0..LANES {
        even[r] = simd.add(even[r], odd[r]);
    }
    even
}

/// `sums[4·block + r][group + g] ± = Σ_k rows[k][left]_r rows[k][right + g]`: four rows `left` times all groups of `right`.
#[inline(always)]
pub fn strip<S: Simd, const SUBTRACT: bool>(
    simd: S,
    rows: Rows<'_>,
    left: usize,
    right: std::ops::Range<usize>,
    sums: &mut Sums<'_>,
    (block, group): (usize, usize),
) {
    let a = rows.group(left);
    let (mut j, mut at) = (right.start, group * sums.rows + block * LANES);
    while j + 1 < right.end {
        let (first, second) = tile(simd, a, rows.group(j), rows.group(j + 1));
        add_to::<S, SUBTRACT>(simd, &mut sums.values[at..], first);
        add_to::<S, SUBTRACT>(simd, &mut sums.values[at + sums.rows..], second);
        (j, at) = (j + 2, at + 2 * sums.rows);
    }
    if j < right.end {
        let sum = narrow_tile(simd, a, rows.group(j));
        add_to::<S, SUBTRACT>(simd, &mut sums.values[at..], sum);
    }
}

/// `Σ_k group[k] by[k]`.
#[inline(always)]
pub fn weighted<S: Simd>(simd: S, group: &[Quad], by: &[f64]) -> S::Vector {
    let (mut even, mut odd) = (simd.splat(0.0), simd.splat(0.0));
    let ((pairs, last), (by_pairs, by_last)) = (group.as_chunks::<2>(), by.as_chunks::<2>());
    for ([a, b], [x, y]) in pairs.iter().zip(by_pairs) {
        even = simd.mul_add(simd.load(&a.0), simd.splat(*x), even);
        odd = simd.mul_add(simd.load(&b.0), simd.splat(*y), odd);
    }
    for (a, x) in last.iter().zip(by_last) {
        even = simd.mul_add(simd.load(&a.0), simd.splat(*x), even);
    }
    simd.add(even, odd)
}

/// `to ± = Σ_k group[k] by[k]`.
#[inline(always)]
pub fn add_weighted<S: Simd, const SUBTRACT: bool>(simd: S, group: &[Quad], by: &[f64], to: &mut [f64; LANES]) {
    let (before, sum) = (simd.load(to), weighted(simd, group, by));
    *to = simd.store(if SUBTRACT { simd.sub(before, sum) } else { simd.add(before, sum) });
}

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
            // Also refuses NaN.
            if !(a[i][i] > 0.0 && a[i][i].is_finite()) {
                return Err(Pivot { index: i, value: a[i][i] });
            }
        }
        Ok(Diagonal { below, scale: simd.store(simd.sqrt(simd.load(&inverse))) })
    }
}

/// Factors the leading block of `front` (by groups of as many rows as `right` has) as `Uᵀ U` and solves with it the columns behind and the vector
/// `right`: `front` becomes `[U | U⁻ᵀ rest]`, with the reciprocals of U's diagonal on the diagonal and what is below the diagonal blocks
/// untouched.
#[inline(always)]
pub fn factor<S: Simd>(simd: S, front: &mut [Quad], right: &mut [f64]) -> Result<(), Pivot> {
    let n = right.len();
    let mut above = [Quad::default(); MAX_STAGE_SIZE];
    for block in 0..n / LANES {
        let first = block * LANES;
        let rest = &mut front[block * n..];
        if block > 0 {
            // The four rows lose what the rows above say of them.
            above[..first].copy_from_slice(&rest[..first]);
            let a = &above[..first];
            let mut pairs = rest.chunks_exact_mut(2 * n);
            for pair in &mut pairs {
                let (b, c) = pair.split_at_mut(n);
                let (x, y) = tile(simd, a, &b[..first], &c[..first]);
                add_to::<S, true>(simd, &mut b[first..], x);
                add_to::<S, true>(simd, &mut c[first..], y);
            }
            let b = pairs.into_remainder();
            if !b.is_empty() {
                let x = narrow_tile(simd, a, &b[..first]);
                add_to::<S, true>(simd, &mut b[first..], x);
            }
        }
        let own = &rest[first..first + LANES];
        let d = match Diagonal::of(simd, [own[0].0, own[1].0, own[2].0, own[3].0]) {
            Ok(d) => d,
            Err(pivot) => return Err(Pivot { index: first + pivot.index, ..pivot }),
        };
        let [[_, b01, b02, b03], [_, _, b12, b13], [.., b23], _] = d.below;
        let (b01, b02, b03) = (simd.splat(b01), simd.splat(b02), simd.splat(b03));
        let (b12, b13, b23) = (simd.splat(b12), simd.splat(b13), simd.splat(b23));
        let [s0, s1, s2, s3] = d.scale;
        let (s0, s1, s2, s3) = (simd.splat(s0), simd.splat(s1), simd.splat(s2), simd.splat(s3));
        for group in rest.chunks_exact_mut(n) {
            let rows = &mut group[first..first + LANES];
            let x0 = simd.load(&rows[0].0);
            let x1 = simd.mul_sub_from(b01, x0, simd.load(&rows[1].0));
            let x2 = simd.mul_sub_from(b12, x1, simd.mul_sub_from(b02, x0, simd.load(&rows[2].0)));
            let x3 = simd.mul_sub_from(b03, x0, simd.load(&rows[3].0));
            let x3 = simd.mul_sub_from(b23, x2, simd.mul_sub_from(b13, x1, x3));
            rows[0].0 = simd.store(simd.mul(x0, s0));
            rows[1].0 = simd.store(simd.mul(x1, s1));
            rows[2].0 = simd.store(simd.mul(x2, s2));
            rows[3].0 = simd.store(simd.mul(x3, s3));
        }
        let (known, right) = right.split_at_mut(first);
        let [r0, r1, r2, r3, ..] = right else { unreachable!("a block has four rows") };
        let loss = simd.store(weighted(simd, &rest[..first], known));
        let x0 = *r0 - loss[0];
        let x1 = *r1 - loss[1] - d.below[0][1] * x0;
        let x2 = *r2 - loss[2] - d.below[0][2] * x0 - d.below[1][2] * x1;
        let x3 = *r3 - loss[3] - d.below[0][3] * x0 - d.below[1][3] * x1 - d.below[2][3] * x2;
        (*r0, *r1, *r2, *r3) = (x0 * d.scale[0], x1 * d.scale[1], x2 * d.scale[2], x3 * d.scale[3]);
        for (i, scale) in d.scale.into_iter().enumerate() {
            rest[first + i].0[i] = scale;
        }
    }
    Ok(())
}

/// The sum of every vector.
#[inline(always)]
pub fn add_across<S: Simd>(simd: S, v: [S::Vector; LANES]) -> [f64; LANES] {
    let mut sums = [0.0; LANES];
    for (sum, v) in sums.iter_mut().zip(v) {
        let [a, b, c, d] = simd.store(v);
        *sum = (a + b) + (c + d);
    }
    sums
}
