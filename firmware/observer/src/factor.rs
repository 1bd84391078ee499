//! The covariance P as U D Uᵀ: U has ones on its diagonal and zeros below, D is diagonal and never negative.
//!
//! A reading is taken in by Bierman's recursion, a step by Thornton's weighted Gram–Schmidt orthogonalisation (G. J. Bierman, *Factorization
//! Methods for Discrete Sequential Estimation*, 1977, chapters V and VI), the wandering of a constant by the update of Agee and Turner. None takes a
//! difference of variances, so that readings 10⁵ times sharper than what was known before do not make P indefinite in seven digits. No root is taken. States keep their own units: D scales with them.

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

    /// Uᵢⱼ of i ≤ j.
    pub fn u(&self, i: usize, j: usize) -> T {
        if i == j { T::of(1.0) } else { self.columns[j][i] }
    }

    /// Dₖ.
    pub fn d(&self, k: usize) -> T {
        self.d[k]
    }

    /// Components.
    pub fn count(&self) -> usize {
        self.count
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
        let mut projected = [T::of(0.0); N];
        for (i, h) in h.iter().enumerate().take(self.count) {
            // Most readings see one component or few.
            if *h != T::of(0.0) {
                projected[i] += *h;
                for j in i + 1..self.count {
                    projected[j] += self.columns[j][i] * *h;
                }
            }
        }
        for (f, d) in projected.iter().zip(&self.d) {
            variance += *f * *f * *d;
        }
        self.projected = projected;
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
            if f != T::of(0.0) {
                let share = -(f / before);
                for (u, k) in self.columns[j][..j].iter_mut().zip(gain.iter_mut()) {
                    let old = *u;
                    *u = old + share * *k;
                    *k += old * g;
                }
            }
            gain[j] = g;
            self.d[j] = self.d[j] * (before / alpha);
            before = alpha;
        }
        for k in &mut gain[..self.count] {
            *k = *k / before;
        }
    }

    /// P ← Φ P Φᵀ + Q: Φ of the first `moving` components, the identity of the others; Q is diagonal, and zero of the others.
    ///
    /// Constants keep their factors, and what ties the moving components to them is Φ U. The rows w of [Φ U, I] of the moving components are made
    /// orthogonal under the weights (D, Q), the last one first:
    /// ```text
    /// Dⱼ = ‖wⱼ‖²,   Uᵢⱼ = ⟨wᵢ, wⱼ⟩ / Dⱼ,   wᵢ ← wᵢ − Uᵢⱼ wⱼ   for i < j
    /// ```
    pub(crate) fn propagate(&mut self, phi: &[[T; N]; N], moving: usize, q: &[T; N]) {
        let (zero, one, m) = (T::of(0.0), T::of(1.0), moving.min(self.count));
        for i in 0..m {
            self.noise[i][..m].fill(zero);
            self.noise[i][i] = one;
            for j in 0..m {
                self.carried[i][j] = phi[i][j] + dot(&self.columns[j][..j], &phi[i]);
            }
        }
        for column in &mut self.columns[m..self.count] {
            let before = *column;
            for (to, phi) in column[..m].iter_mut().zip(phi) {
                *to = dot(&before[..m], phi);
            }
        }
        let old = self.d;
        let (mut carried_weighted, mut noise_weighted) = (zero_row::<T, N>(), zero_row::<T, N>());
        for j in (0..m).rev() {
            let mut d = zero;
            for k in 0..m {
                carried_weighted[k] = self.carried[j][k] * old[k];
                noise_weighted[k] = self.noise[j][k] * q[k];
                d += carried_weighted[k] * self.carried[j][k] + noise_weighted[k] * self.noise[j][k];
            }
            self.d[j] = d;
            let (before, own) = self.carried.split_at_mut(j);
            let (noise_before, noise_own) = self.noise.split_at_mut(j);
            for (i, (row, noise_row)) in before.iter_mut().zip(noise_before).enumerate() {
                let product = dot(&carried_weighted[..m], row) + dot(&noise_weighted[..m], noise_row);
                let u = if d > zero { product / d } else { zero };
                self.columns[j][i] = u;
                for k in 0..m {
                    row[k] = row[k] - u * own[0][k];
                    noise_row[k] = noise_row[k] - u * noise_own[0][k];
                }
            }
        }
    }

    /// P ← P + c e eᵀ, e the unit vector of component `i`: Agee's and Turner's update (Bierman, chapter III), which adds and never subtracts variances.
    /// ```text
    /// for j = i … 0:   s = aⱼ,   D = Dⱼ + c s²,   c′ = c Dⱼ/D,   aₖ ← aₖ − s Uₖⱼ,   Uₖⱼ ← Uₖⱼ + (c s/D) aₖ   for k < j
    /// ```
    pub(crate) fn add_variance(&mut self, i: usize, variance: T) {
        let mut a = zero_row::<T, N>();
        a[i] = T::of(1.0);
        let mut c = variance;
        for j in (0..=i).rev() {
            let s = a[j];
            let d = self.d[j] + c * s * s;
            if d > T::of(0.0) {
                let share = c * s / d;
                c = c * (self.d[j] / d);
                for (a, u) in a[..j].iter_mut().zip(&mut self.columns[j]) {
                    *a = *a - s * *u;
                    *u += share * *a;
                }
            }
            self.d[j] = d;
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
