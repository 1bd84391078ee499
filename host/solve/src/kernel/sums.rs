//! Sums of products of rows: `C ± Σ_k a[k]ᵀ b[k]`.

use std::marker::PhantomData;
use std::ops::Range;

use crate::simd::{LANES, Quad, Simd, Work};

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

/// A matrix that sums are added to, taken off, or put into, by groups.
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
pub(super) fn change<S: Simd, C: Change>(simd: S, out: &mut [Quad], sum: [S::Vector; LANES]) {
    for (out, sum) in out[..LANES].iter_mut().zip(sum) {
        *out = Quad(simd.store(C::of(simd, out, sum)));
    }
}

/// Four rows of two groups of sums: `Σ_k a[k]_r b[k]`, `Σ_k a[k]_r c[k]`.
#[inline(always)]
pub(super) fn tile<S: Simd>(simd: S, a: &[Quad], b: &[Quad], c: &[Quad]) -> ([S::Vector; LANES], [S::Vector; LANES]) {
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
pub(super) fn narrow_tile<S: Simd>(simd: S, a: &[Quad], b: &[Quad]) -> [S::Vector; LANES] {
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

/// Changes `sums` by `Σ_k rows[k]ᵀ rows[k]`: the groups `left` times themselves and all behind them up to `end`. The sums of groups
/// `left.start + a` and `left.start + b`, a ≤ b, are the rows 4a … 4a + 3 of group b, or of one behind the gap. Diagonal blocks are whole; below them nothing
/// is touched.
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

// By reference, so that what goes to the function of its own is an address: a copy of just written fields, made with wide moves, would wait for them.
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

/// [`upper`] of which each group of `left` goes no further than to its own of `ends`.
#[inline(always)]
pub fn upper_within<S: Simd, C: Change>(
    simd: S,
    rows: Rows<'_>,
    left: Range<usize>,
    ends: &[usize],
    sums: &mut Sums<'_>,
) {
    simd.apart(&mut UpperWithin { rows, left, ends, sums, change: PhantomData::<C> });
}

/// What [`upper_within`] does.
struct UpperWithin<'a, 'b, C> {
    rows: Rows<'a>,
    left: Range<usize>,
    ends: &'a [usize],
    sums: &'a mut Sums<'b>,
    change: PhantomData<C>,
}

impl<C: Change> Work for &mut UpperWithin<'_, '_, C> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let UpperWithin { rows, ref left, ends, ref mut sums, .. } = *self;
        for ((at, i), end) in left.clone().enumerate().zip(ends) {
            strip::<S, C>(simd, rows, i, i..*end, sums, (at * LANES, at));
        }
    }
}

/// Changes `sums` by `Σ_k rows[k]ᵀ rows[k]`: the groups `left` times the groups `right`. The sums of groups `left.start + a` and
/// `right.start + b` are the rows 4a … 4a + 3 of group b, or of one behind the gap.
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
