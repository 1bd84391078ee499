//! The small dense loops of the elimination, on matrices of [`Quad`]s: rows of groups of four columns.
//!
//! Everything is built of one loop, the [`tile`]: four rows times two groups of `C ± Σ_k a[k]ᵀ b[k]`, whose eight sums stay in
//! registers while k runs. Eight are what two multiply-add units with a latency of four cycles need; twelve would leave the compiler
//! no register of sixteen to spare, and a sum that is spilled doubles the time.
//! Only the groups on and above the diagonal of symmetric matrices are computed. The factorisation is `D = Uᵀ U`, so that the matrices
//! of all loops lie alike: left-looking by blocks of four, whose diagonal blocks are factored as `L diag Lᵀ` (one division a pivot on
//! the critical path, the roots come afterwards, four at a time).

use crate::simd::{LANES, Quad, Simd};

/// Block sizes that are compiled; a stage of n unknowns runs in the next larger one.
pub const STAGE_SIZES: [usize; 9] = [4, 8, 12, 16, 20, 24, 28, 32, 36];

/// The largest stage that can be solved.
pub const MAX_STAGE_SIZE: usize = STAGE_SIZES[STAGE_SIZES.len() - 1];

/// Groups of four that hold `width` columns.
pub const fn groups(width: usize) -> usize {
    width.div_ceil(LANES)
}

/// Rows that are multiplied with themselves.
#[derive(Debug, Clone, Copy)]
pub struct Rows<'a> {
    /// The matrix by rows.
    pub values: &'a [Quad],
    /// Groups from one row to the next.
    pub stride: usize,
    /// Number of rows.
    pub count: usize,
}

/// A matrix that sums are added to.
#[derive(Debug)]
pub struct Sums<'a> {
    /// The matrix by rows.
    pub values: &'a mut [Quad],
    /// Groups from one row to the next.
    pub stride: usize,
}

/// `sums[row + r][group + g] ± = Σ_k rows[k][left]_r rows[k][right + g]` for r < 4, g < C.
#[inline(always)]
fn tile<S: Simd, const C: usize, const SUBTRACT: bool>(
    simd: S,
    rows: Rows<'_>,
    (left, right): (usize, usize),
    sums: &mut Sums<'_>,
    (row, group): (usize, usize),
) {
    let mut sum = [[simd.splat(0.0); C]; LANES];
    // No `chunks_exact`: it divides, which costs more than two rows.
    let mut rest = rows.values;
    for k in 0..rows.count {
        if k > 0 {
            rest = &rest[rows.stride..];
        }
        let factors = &rest[left].0;
        let k = &rest[right..right + C];
        let mut values = [simd.splat(0.0); C];
        for g in 0..C {
            values[g] = simd.load(&k[g].0);
        }
        for r in 0..LANES {
            let factor = simd.splat(factors[r]);
            for g in 0..C {
                sum[r][g] = simd.mul_add(factor, values[g], sum[r][g]);
            }
        }
    }
    for r in 0..LANES {
        let out = &mut sums.values[(row + r) * sums.stride + group..][..C];
        for g in 0..C {
            let before = simd.load(&out[g].0);
            let after = if SUBTRACT { simd.sub(before, sum[r][g]) } else { simd.add(before, sum[r][g]) };
            out[g] = Quad(simd.store(after));
        }
    }
}

/// Tiles of the four rows `left` times the groups `right`, added to (or subtracted from) `sums` from `(row, group)` on.
#[inline(always)]
pub fn strip<S: Simd, const SUBTRACT: bool>(
    simd: S,
    rows: Rows<'_>,
    left: usize,
    right: std::ops::Range<usize>,
    sums: &mut Sums<'_>,
    (row, group): (usize, usize),
) {
    let mut j = right.start;
    while j + 1 < right.end {
        tile::<S, 2, SUBTRACT>(simd, rows, (left, j), sums, (row, group + j - right.start));
        j += 2;
    }
    if j < right.end {
        tile::<S, 1, SUBTRACT>(simd, rows, (left, j), sums, (row, group + j - right.start));
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
            // Also refuses NaN.
            if !(a[i][i] > 0.0 && a[i][i].is_finite()) {
                return Err(Pivot { index: i, value: a[i][i] });
            }
        }
        Ok(Diagonal { below, scale: simd.store(simd.sqrt(simd.load(&inverse))) })
    }
}

/// Factors the leading `N × N` block of `front` (N rows of `stride` groups) as `Uᵀ U` and solves with it the columns behind: `front`
/// becomes `[U | U⁻ᵀ rest]`, with the reciprocals of U's diagonal on the diagonal and what is below the diagonal blocks untouched.
#[inline(always)]
pub fn factor_front<S: Simd, const N: usize>(simd: S, front: &mut [Quad], stride: usize) -> Result<(), Pivot> {
    for block in 0..N / LANES {
        let (above, own) = front.split_at_mut(block * LANES * stride);
        let own = &mut own[..LANES * stride];
        if block > 0 {
            let rows = Rows { values: above, stride, count: block * LANES };
            let mut sums = Sums { values: own, stride };
            strip::<S, true>(simd, rows, block, block..stride, &mut sums, (0, block));
        }
        let a = [own[block].0, own[stride + block].0, own[2 * stride + block].0, own[3 * stride + block].0];
        let d = match Diagonal::of(simd, a) {
            Ok(d) => d,
            Err(pivot) => return Err(Pivot { index: block * LANES + pivot.index, ..pivot }),
        };
        let (first, rest) = own.split_at_mut(stride);
        let (second, rest) = rest.split_at_mut(stride);
        let (third, fourth) = rest.split_at_mut(stride);
        let [[_, b01, b02, b03], [_, _, b12, b13], [.., b23], _] = d.below;
        let (b01, b02, b03) = (simd.splat(b01), simd.splat(b02), simd.splat(b03));
        let (b12, b13, b23) = (simd.splat(b12), simd.splat(b13), simd.splat(b23));
        let [s0, s1, s2, s3] = d.scale;
        let (s0, s1, s2, s3) = (simd.splat(s0), simd.splat(s1), simd.splat(s2), simd.splat(s3));
        for (((first, second), third), fourth) in first[block..]
            .iter_mut()
            .zip(&mut second[block..stride])
            .zip(&mut third[block..stride])
            .zip(&mut fourth[block..stride])
        {
            let x0 = simd.load(&first.0);
            let x1 = simd.mul_sub_from(b01, x0, simd.load(&second.0));
            let x2 = simd.mul_sub_from(b12, x1, simd.mul_sub_from(b02, x0, simd.load(&third.0)));
            let x3 = simd.mul_sub_from(b03, x0, simd.load(&fourth.0));
            let x3 = simd.mul_sub_from(b23, x2, simd.mul_sub_from(b13, x1, x3));
            first.0 = simd.store(simd.mul(x0, s0));
            second.0 = simd.store(simd.mul(x1, s1));
            third.0 = simd.store(simd.mul(x2, s2));
            fourth.0 = simd.store(simd.mul(x3, s3));
        }
        for (i, scale) in d.scale.into_iter().enumerate() {
            own[i * stride + block].0[i] = scale;
        }
    }
    Ok(())
}

/// [`factor_front`] in the compiled size n (one of [`STAGE_SIZES`]).
#[inline(always)]
pub fn factor<S: Simd>(simd: S, n: usize, front: &mut [Quad], stride: usize) -> Result<(), Pivot> {
    macro_rules! dispatch {
        ($($size:literal)*) => {
            match n {
                $($size => factor_front::<S, $size>(simd, front, stride),)*
                other => unreachable!("stage size {other} is not among STAGE_SIZES"),
            }
        };
    }
    dispatch!(4 8 12 16 20 24 28 32 36)
}

/// Doubles that [`keep_triangle`] needs for n (a multiple of four) unknowns.
pub const fn triangle(n: usize) -> usize {
    n * (n + LANES) / 2
}

/// Copies U out of a factored front: of every row the groups from its diagonal block on.
#[inline(always)]
pub fn keep_triangle(front: &[Quad], stride: usize, n: usize, kept: &mut [f64]) {
    let mut kept = kept.as_chunks_mut::<LANES>().0.iter_mut();
    for i in 0..n {
        let row = &front[i * stride..(i + 1) * stride];
        for (quad, kept) in row[i / LANES..n / LANES].iter().zip(&mut kept) {
            *kept = quad.0;
        }
    }
}

/// Solves `U x = x` in place, with U as [`keep_triangle`] keeps it.
#[inline(always)]
pub fn backward<S: Simd>(simd: S, kept: &[f64], x: &mut [Quad]) {
    let blocks = x.len();
    let mut end = kept.len();
    for block in (0..blocks).rev() {
        let width = (blocks - block) * LANES;
        let rows = &kept[end - LANES * width..end];
        end -= LANES * width;
        let (x, known) = x.split_at_mut(block + 1);
        let mut sums = [simd.splat(0.0); LANES];
        for (g, known) in known.iter().enumerate() {
            for (r, sum) in sums.iter_mut().enumerate() {
                *sum = simd.mul_add(simd.load(quad(rows, r * width + (g + 1) * LANES)), simd.load(&known.0), *sum);
            }
        }
        let loss = add_across(simd, sums);
        let x = &mut x[block].0;
        for i in (0..LANES).rev() {
            let row = &rows[i * width..][..LANES];
            let mut sum = x[i] - loss[i];
            for k in i + 1..LANES {
                sum -= row[k] * x[k];
            }
            x[i] = sum * row[i];
        }
    }
}

/// The four values from `at` on.
#[inline(always)]
pub fn quad(values: &[f64], at: usize) -> &[f64; LANES] {
    match values[at..].first_chunk() {
        Some(quad) => quad,
        None => panic!("a group of four ends behind the matrix"),
    }
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

/// The transpose of a 4×4 block.
#[inline(always)]
pub fn transposed(v: [[f64; LANES]; LANES]) -> [[f64; LANES]; LANES] {
    let mut out = [[0.0; LANES]; LANES];
    for i in 0..LANES {
        for j in 0..LANES {
            out[j][i] = v[i][j];
        }
    }
    out
}
