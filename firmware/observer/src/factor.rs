//! The covariance P as U D Uᵀ: U has ones on its diagonal and zeros below, D is diagonal and never negative.
//!
//! A reading is taken in by Bierman's recursion, a step by Thornton's weighted Gram–Schmidt orthogonalisation (G. J. Bierman, *Factorization
//! Methods for Discrete Sequential Estimation*, 1977, chapters V and VI). Neither takes a difference of variances, so that readings 10⁵ times
//! sharper than what was known before do not make P indefinite in seven digits. No root is taken. States keep their own units: D scales with them.

use crate::Real;

/// The factors of P, for at most `N` components.
#[derive(Debug, Clone)]
pub struct Factor<T, const N: usize> {
    count: usize,
    /// `columns[j][i]` = Uᵢⱼ, i < j.
    columns: [[T; N]; N],
    d: [T; N],
    /// Uᵀ h of the reading that is looked at.
    projected: [T; N],
    /// Rows of [Φ U, I] while a step is taken, with weights D and Q.
    carried: [[T; N]; N],
    noise: [[T; N]; N],
}

impl<T: Real, const N: usize> Factor<T, N> {
    /// Of components that are known to these standard deviations, independently; at most `N` of them.
    pub fn diagonal(sigma: impl Iterator<Item = T>) -> Self {
        let zero = [[T::of(0.0); N]; N];
        let mut factor =
            Self { count: 0, columns: zero, d: zero_row(), projected: zero_row(), carried: zero, noise: zero };
        for (d, sigma) in factor.d.iter_mut().zip(sigma) {
            *d = sigma * sigma;
            factor.count += 1;
        }
        factor
    }

    /// Whether all of it are numbers, and no variance is negative.
    pub fn is_sound(&self) -> bool {
        let variances = self.d[..self.count].iter().all(|d| *d >= T::of(0.0) && *d < T::of(f64::INFINITY));
        let slopes = |j: usize| self.columns[j][..j].iter().all(|u| u.abs() < T::of(f64::INFINITY));
        variances && (0..self.count).all(slopes)
    }

    /// Uᵢⱼ.
    fn u(&self, i: usize, j: usize) -> T {
        if i == j { T::of(1.0) } else { self.columns[j][i] }
    }

    /// Pᵢⱼ = Σ U_ik D_k U_jk over k ≥ max(i, j).
    pub fn covariance(&self, i: usize, j: usize) -> T {
        let mut sum = T::of(0.0);
        for k in i.max(j)..self.count {
            sum += self.u(i, k) * self.d[k] * self.u(j, k);
        }
        sum
    }

    /// h P hᵀ of a reading's gradient h, which [`Self::take_in`] then remembers.
    pub(crate) fn variance_of(&mut self, h: &[T]) -> T {
        let mut variance = T::of(0.0);
        for j in 0..self.count {
            let f = h[j] + dot(&self.columns[j][..j], h);
            self.projected[j] = f;
            variance += f * f * self.d[j];
        }
        variance
    }

    /// Takes in the reading whose gradient [`Self::variance_of`] was given last, of this variance; gives the gain P hᵀ / S.
    ///
    /// ```text
    /// α₀ = r,   f = Uᵀ h,   g = D f
    /// αⱼ = αⱼ₋₁ + fⱼ gⱼ,   Dⱼ ← Dⱼ αⱼ₋₁ / αⱼ,   Uᵢⱼ ← Uᵢⱼ − (fⱼ / αⱼ₋₁) Kᵢ,   Kᵢ ← Kᵢ + gⱼ Uᵢⱼ of before;   K / αₙ is the gain
    /// ```
    pub(crate) fn take_in(&mut self, variance: T, gain: &mut [T; N]) {
        let mut before = variance;
        for j in 0..self.count {
            let f = self.projected[j];
            let g = self.d[j] * f;
            let alpha = before + f * g;
            let share = -(f / before);
            for (u, k) in self.columns[j][..j].iter_mut().zip(gain.iter_mut()) {
                let old = *u;
                *u = old + share * *k;
                *k += old * g;
            }
            gain[j] = g;
            self.d[j] = self.d[j] * (before / alpha);
            before = alpha;
        }
        for k in &mut gain[..self.count] {
            *k = *k / before;
        }
    }

    /// P ← Φ P Φᵀ + Q: Φ of the first `moving` components, the identity of the others; Q is diagonal.
    ///
    /// The rows w of [Φ U, I] are made orthogonal under the weights (D, Q), the last one first:
    /// ```text
    /// Dⱼ = ‖wⱼ‖²,   Uᵢⱼ = ⟨wᵢ, wⱼ⟩ / Dⱼ,   wᵢ ← wᵢ − Uᵢⱼ wⱼ   for i < j
    /// ```
    /// Rows of constants have entries in their own columns only.
    pub(crate) fn propagate(&mut self, phi: &[[T; N]; N], moving: usize, q: &[T; N]) {
        let (zero, one, n) = (T::of(0.0), T::of(1.0), self.count);
        for i in 0..n {
            self.noise[i][..n].fill(zero);
            self.noise[i][i] = one;
            for j in 0..n {
                self.carried[i][j] = if i >= moving {
                    if j < i { zero } else { self.u(i, j) }
                } else if j < moving {
                    phi[i][j] + dot(&self.columns[j][..j], &phi[i])
                } else {
                    dot(&self.columns[j][..moving], &phi[i])
                };
            }
        }
        let old = self.d;
        let (mut carried_weighted, mut noise_weighted) = (zero_row::<T, N>(), zero_row::<T, N>());
        for j in (0..n).rev() {
            let from = if j < moving { 0 } else { moving };
            let mut d = zero;
            for k in from..n {
                carried_weighted[k] = self.carried[j][k] * old[k];
                noise_weighted[k] = self.noise[j][k] * q[k];
                d += carried_weighted[k] * self.carried[j][k] + noise_weighted[k] * self.noise[j][k];
            }
            self.d[j] = d;
            let (before, own) = self.carried.split_at_mut(j);
            let (noise_before, noise_own) = self.noise.split_at_mut(j);
            for i in 0..j {
                let product = dot(&carried_weighted[from..n], &before[i][from..n])
                    + dot(&noise_weighted[from..n], &noise_before[i][from..n]);
                let u = if d > zero { product / d } else { zero };
                self.columns[j][i] = u;
                for k in from..n {
                    before[i][k] = before[i][k] - u * own[0][k];
                    noise_before[i][k] = noise_before[i][k] - u * noise_own[0][k];
                }
            }
        }
    }
}

fn zero_row<T: Real, const N: usize>() -> [T; N] {
    [T::of(0.0); N]
}

/// Σ aᵢ bᵢ over the shorter of both.
pub(crate) fn dot<T: Real>(a: &[T], b: &[T]) -> T {
    let mut sum = T::of(0.0);
    for (a, b) in a.iter().zip(b) {
        sum += *a * *b;
    }
    sum
}
