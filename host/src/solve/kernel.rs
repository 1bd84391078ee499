//! The small dense loops of the elimination, for stages of compiled sizes and rows of any width that is a multiple of [`LANES`].
//!
//! Every loop runs over rows of contiguous columns, so the compiler vectorises it for the instruction set in force;
//! [`vectorised`] selects that set at run time. `FMA` says whether a fused multiply-add is one instruction there:
//! where it is not, the fused form would be a slow library call.

/// Columns handled together: row widths are multiples of this.
pub const LANES: usize = 4;

/// Block sizes that are compiled; a stage of n unknowns runs in the next larger one.
pub const STAGE_SIZES: [usize; 9] = [4, 8, 12, 16, 20, 24, 28, 32, 36];

/// The largest stage that can be solved.
pub const MAX_STAGE_SIZE: usize = STAGE_SIZES[STAGE_SIZES.len() - 1];

/// Rounds a width up to a multiple of [`LANES`].
pub const fn padded(width: usize) -> usize {
    width.div_ceil(LANES) * LANES
}

/// A piece of work that is compiled once with and once without fused multiply-add.
pub trait Work {
    /// What the work returns.
    type Output;
    /// Does the work. Implementations mark this `#[inline(always)]`, so that it is compiled for the selected instruction set.
    fn run<const FMA: bool>(self) -> Self::Output;
}

/// Runs `work` with the best instruction set that this machine has.
pub fn vectorised<W: Work>(work: W) -> W::Output {
    #[cfg(target_arch = "x86_64")]
    if let Some(v3) = pulp::x86::V3::try_new() {
        struct WithFma<W>(W);
        impl<W: Work> pulp::NullaryFnOnce for WithFma<W> {
            type Output = W::Output;
            #[inline(always)]
            fn call(self) -> W::Output {
                self.0.run::<true>()
            }
        }
        return pulp::Simd::vectorize(v3, WithFma(work));
    }
    // NEON's multiply-add is always fused.
    work.run::<{ cfg!(target_arch = "aarch64") }>()
}

#[inline(always)]
fn fma<const FMA: bool>(a: f64, b: f64, c: f64) -> f64 {
    if FMA { a.mul_add(b, c) } else { a * b + c }
}

/// The rows of a product: a row-major matrix with stride `stride`, of which columns from `left_at` meet columns from `right_at`.
#[derive(Debug, Clone, Copy)]
pub struct Product<'a> {
    /// The matrix, `rows × stride`.
    pub source: &'a [f64],
    /// Number of rows summed over.
    pub rows: usize,
    /// Columns from one row to the next.
    pub stride: usize,
    /// First column of the left factor.
    pub left_at: usize,
    /// First column of the right factor.
    pub right_at: usize,
}

/// `c[i][j] += sign Σ_r left[r][i] · right[r][j]` for i < `rows_out`, j < `width` (a multiple of [`LANES`]); `c` has stride `width`.
#[inline(always)]
pub fn gram<const FMA: bool>(c: &mut [f64], width: usize, rows_out: usize, product: Product<'_>, sign: f64) {
    let mut j = 0;
    while j + 2 * LANES <= width {
        gram_columns::<FMA, { 2 * LANES }>(c, width, rows_out, product, sign, j);
        j += 2 * LANES;
    }
    if j < width {
        gram_columns::<FMA, LANES>(c, width, rows_out, product, sign, j);
    }
}

/// [`gram`] for the `C` columns from `j` on, two output rows at a time.
#[inline(always)]
fn gram_columns<const FMA: bool, const C: usize>(
    c: &mut [f64],
    width: usize,
    rows_out: usize,
    product: Product<'_>,
    sign: f64,
    j: usize,
) {
    let Product { source, rows, stride, left_at, right_at } = product;
    let mut i = 0;
    while i < rows_out {
        let pair = i + 1 < rows_out;
        let (mut first, mut second) = ([0.0f64; C], [0.0f64; C]);
        for r in 0..rows {
            let row = &source[r * stride..][..stride];
            let right = &row[right_at + j..][..C];
            let a = row[left_at + i];
            let b = if pair { row[left_at + i + 1] } else { 0.0 };
            for l in 0..C {
                first[l] = fma::<FMA>(a, right[l], first[l]);
                second[l] = fma::<FMA>(b, right[l], second[l]);
            }
        }
        for l in 0..C {
            c[i * width + j + l] += sign * first[l];
        }
        if pair {
            for l in 0..C {
                c[(i + 1) * width + j + l] += sign * second[l];
            }
        }
        i += 2;
    }
}

/// The pivot of a Cholesky factor that was not positive: its index and value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pivot {
    /// Index of the unknown in its stage.
    pub index: usize,
    /// The value that should have been positive.
    pub value: f64,
}

/// Doubles of a packed lower triangle of `n` rows.
pub const fn triangle(n: usize) -> usize {
    n * (n + 1) / 2
}

/// Cholesky factor of the leading `N × N` block of `a` (stride `width`) into `l`: packed lower rows, reciprocals on the diagonal.
#[inline(always)]
pub fn cholesky<const N: usize, const FMA: bool>(a: &[f64], width: usize, l: &mut [f64]) -> Result<(), Pivot> {
    let mut f = [[0.0f64; N]; N];
    for i in 0..N {
        for j in 0..=i {
            let mut sum = a[i * width + j];
            for k in 0..j {
                sum = fma::<FMA>(-f[i][k], f[j][k], sum);
            }
            if i == j {
                // Also refuses NaN.
                if !(sum > 0.0 && sum.is_finite()) {
                    return Err(Pivot { index: i, value: sum });
                }
                f[i][i] = 1.0 / sum.sqrt();
            } else {
                f[i][j] = sum * f[j][j];
            }
        }
        l[triangle(i)..triangle(i + 1)].copy_from_slice(&f[i][..=i]);
    }
    Ok(())
}

/// Solves `L T = T` in place for all columns of `t` (`N × width`).
#[inline(always)]
pub fn forward<const N: usize, const FMA: bool>(l: &[f64], t: &mut [f64], width: usize) {
    let mut j = 0;
    while j < width {
        for i in 0..N {
            let row = &l[triangle(i)..triangle(i + 1)];
            let mut sum = [0.0f64; LANES];
            sum.copy_from_slice(&t[i * width + j..][..LANES]);
            for k in 0..i {
                let above = &t[k * width + j..][..LANES];
                for c in 0..LANES {
                    sum[c] = fma::<FMA>(-row[k], above[c], sum[c]);
                }
            }
            for c in 0..LANES {
                t[i * width + j + c] = sum[c] * row[i];
            }
        }
        j += LANES;
    }
}

/// [`cholesky`] of the block `a`, then [`forward`] of `t`, in the compiled size n (one of [`STAGE_SIZES`]).
#[inline(always)]
pub fn factor_and_solve<const FMA: bool>(
    n: usize,
    a: &[f64],
    width: usize,
    l: &mut [f64],
    t: &mut [f64],
) -> Result<(), Pivot> {
    macro_rules! dispatch {
        ($($size:literal)*) => {
            match n {
                $($size => {
                    cholesky::<$size, FMA>(a, width, l)?;
                    forward::<$size, FMA>(l, t, width);
                })*
                other => unreachable!("stage size {other} is not among STAGE_SIZES"),
            }
        };
    }
    dispatch!(4 8 12 16 20 24 28 32 36);
    Ok(())
}

/// Solves `Lᵀ x = x` in place for one vector.
pub fn backward(l: &[f64], x: &mut [f64]) {
    for i in (0..x.len()).rev() {
        let mut sum = x[i];
        for k in i + 1..x.len() {
            sum -= l[triangle(k) + i] * x[k];
        }
        x[i] = sum * l[triangle(i) + i];
    }
}
