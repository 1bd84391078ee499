//! The small dense loops of the elimination, on matrices of [`Quad`]s: groups of four columns, one group after the other, so that what a
//! loop runs over is contiguous and needs no index.
//!
//! Everything is built of one loop, the `tile`: four rows times two groups of `C ± Σ_k a[k]ᵀ b[k]`, whose eight sums stay in
//! registers while k runs. Eight are what two multiply-add units with a latency of four cycles need; twelve would leave the compiler
//! no register of sixteen to spare, and a sum that is spilled doubles the time.
//! Only the groups on and above the diagonal of symmetric matrices are computed. The factorisation is `D = Uᵀ U`, so that the matrices
//! of all loops lie alike: left-looking by blocks of four, whose diagonal blocks are factored as `L diag Lᵀ` (one division a pivot on
//! the critical path, the roots come afterwards, four at a time).

use std::marker::PhantomData;
use std::ops::Range;

use crate::simd::{LANES, Quad, Simd, Work};

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
    /// Groups that no sums come to: what would, and all behind it, comes behind them.
    pub gap: Range<usize>,
}

impl<'a> Sums<'a> {
    /// All of a matrix.
    #[inline(always)]
    pub fn of(values: &'a mut [Quad], rows: usize) -> Self {
        Sums { values, rows, gap: 0..0 }
    }

    /// Where group g begins.
    #[inline(always)]
    fn group(&self, g: usize) -> usize {
        self.rows * if g < self.gap.start { g } else { g + self.gap.len() }
    }
}

/// What becomes of the numbers that are there when a sum comes.
pub trait Change {
    /// The numbers after it.
    fn of<S: Simd>(simd: S, before: &Quad, sum: S::Vector) -> S::Vector;
}

/// The sum is added.
#[derive(Debug)]
pub struct Add;

/// The sum is taken off.
#[derive(Debug)]
pub struct Subtract;

/// The sum stands in their place.
#[derive(Debug)]
pub struct Set;

impl Change for Add {
    #[inline(always)]
    fn of<S: Simd>(simd: S, before: &Quad, sum: S::Vector) -> S::Vector {
        simd.add(simd.load(&before.0), sum)
    }
}

impl Change for Subtract {
    #[inline(always)]
    fn of<S: Simd>(simd: S, before: &Quad, sum: S::Vector) -> S::Vector {
        simd.sub(simd.load(&before.0), sum)
    }
}

impl Change for Set {
    #[inline(always)]
    fn of<S: Simd>(_simd: S, _before: &Quad, sum: S::Vector) -> S::Vector {
        sum
    }
}

/// Changes four rows of a group by their sums.
#[inline(always)]
fn change<S: Simd, C: Change>(simd: S, out: &mut [Quad], sum: [S::Vector; LANES]) {
    for (out, sum) in out[..LANES].iter_mut().zip(sum) {
        *out = Quad(simd.store(C::of(simd, out, sum)));
    }
}

/// Four rows of two groups of sums: `Σ_k a[k]_r b[k]`, `Σ_k a[k]_r c[k]`.
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

/// Four rows of sums from `row` on, and group by group from `group` on: the group `left` of the rows times all groups of `right`.
#[inline(always)]
fn strip<S: Simd, C: Change>(
    simd: S,
    rows: Rows<'_>,
    left: usize,
    right: Range<usize>,
    sums: &mut Sums<'_>,
    (row, mut group): (usize, usize),
) {
    let a = rows.group(left);
    let mut j = right.start;
    while j + 1 < right.end {
        let (first, second) = tile(simd, a, rows.group(j), rows.group(j + 1));
        let (at, then) = (sums.group(group) + row, sums.group(group + 1) + row);
        change::<S, C>(simd, &mut sums.values[at..at + LANES], first);
        change::<S, C>(simd, &mut sums.values[then..then + LANES], second);
        (j, group) = (j + 2, group + 2);
    }
    if j < right.end {
        let sum = narrow_tile(simd, a, rows.group(j));
        let at = sums.group(group) + row;
        change::<S, C>(simd, &mut sums.values[at..at + LANES], sum);
    }
}

/// Changes `sums` by `Σ_k rows[k]ᵀ rows[k]`: the groups `left` times themselves and all behind them up to `end`, on and above the diagonal. What is
/// below it is nothing that anybody reads.
#[inline(always)]
pub fn upper<S: Simd, C: Change>(simd: S, rows: Rows<'_>, left: Range<usize>, end: usize, sums: &mut Sums<'_>) {
    simd.apart(&mut Upper { rows, left, end, sums, change: PhantomData::<C> });
}

/// What [`upper`] does.
struct Upper<'a, 'b, C> {
    rows: Rows<'a>,
    left: Range<usize>,
    end: usize,
    sums: &'a mut Sums<'b>,
    change: PhantomData<C>,
}

impl<C: Change> Work for &mut Upper<'_, '_, C> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Upper { rows, ref left, end, ref mut sums, .. } = *self;
        for (at, i) in left.clone().enumerate() {
            strip::<S, C>(simd, rows, i, i..end, sums, (at * LANES, at));
        }
    }
}

/// Changes `sums` by `Σ_k rows[k]ᵀ rows[k]`: the groups `left` times the groups `right`.
#[inline(always)]
pub fn product<S: Simd, C: Change>(
    simd: S,
    rows: Rows<'_>,
    left: Range<usize>,
    right: Range<usize>,
    sums: &mut Sums<'_>,
) {
    simd.apart(&mut Product { rows, left, right, sums, change: PhantomData::<C> });
}

/// What [`product`] does.
struct Product<'a, 'b, C> {
    rows: Rows<'a>,
    left: Range<usize>,
    right: Range<usize>,
    sums: &'a mut Sums<'b>,
    change: PhantomData<C>,
}

impl<C: Change> Work for &mut Product<'_, '_, C> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Product { rows, ref left, ref right, ref mut sums, .. } = *self;
        for (at, i) in left.clone().enumerate() {
            strip::<S, C>(simd, rows, i, right.clone(), sums, (at * LANES, 0));
        }
    }
}

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
    simd.apart(FactorFront { front, right })
}

/// What [`factor`] does.
struct FactorFront<'a> {
    front: &'a mut [Quad],
    right: &'a mut [f64],
}

impl Work for FactorFront<'_> {
    type Output = Result<(), Pivot>;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Result<(), Pivot> {
        factor_front(simd, self.front, self.right)
    }
}

#[inline(always)]
fn factor_front<S: Simd>(simd: S, front: &mut [Quad], right: &mut [f64]) -> Result<(), Pivot> {
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

/// The sum of every vector.
#[inline(always)]
pub fn add_across<S: Simd>(simd: S, v: [S::Vector; LANES]) -> S::Vector {
    let [a, b, c, d] = simd.transpose(v);
    simd.add(simd.add(a, b), simd.add(c, d))
}
