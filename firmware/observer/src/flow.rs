//! How a linear system δ′ = A δ + g goes on over a step: its transition matrix e^{A h}, and its response to a forcing.
//!
//! Both are Taylor series over 2ᵏ equal parts of the step, so many that no rate of A times a part is above one. What is left out is then below
//! 1/720 of a response and 1/24 of a transition for the fastest component, and nothing grows that should decay. A has few entries (a
//! position's rate is its speed), and the products of a transition's series skip the zeros.

use crate::Real;

/// Most halvings of a step: rates up to 64 over the step.
const MOST_HALVINGS: u32 = 6;

/// Terms of a response's series behind the first.
const TERMS: usize = 4;

/// Terms of a transition's series behind the first: it carries a covariance, which no one knows to four digits.
const TRANSITION_TERMS: u32 = 3;

/// Halvings of a step of `h` seconds until |Aᵢᵢ| h and √|Σ Aᵢⱼ Aⱼᵢ| h, the rates of decays and of oscillations, are at most one.
pub(crate) fn halvings<T: Real, const N: usize>(a: &[[T; N]; N], size: usize, h: T) -> u32 {
    let mut fastest = T::of(0.0);
    for i in 0..size {
        let mut square = T::of(0.0);
        for j in 0..size {
            square += (a[i][j] * a[j][i]).abs();
        }
        // It holds |Aᵢᵢ|² as the term j = i.
        if square > fastest {
            fastest = square;
        }
    }
    let mut ratio = fastest * h * h;
    let mut count = 0;
    while count < MOST_HALVINGS && ratio > T::of(1.0) {
        ratio = ratio * T::of(0.25);
        count += 1;
    }
    count
}

/// e^{A h}; `room` is used meanwhile.
///
/// I + A h (I + A h/2 (I + A h/3)) of a part, squared as often as the step was halved.
pub(crate) fn transition<T: Real, const N: usize>(
    a: &[[T; N]; N],
    size: usize,
    h: T,
    halvings: u32,
    phi: &mut [[T; N]; N],
    room: &mut [[T; N]; N],
) {
    let (zero, one) = (T::of(0.0), T::of(1.0));
    let part = h * T::power_of_two(-(halvings as i32));
    let (mut known, mut next) = (phi, room);
    for i in 0..size {
        known[i][..size].fill(zero);
        known[i][i] = one;
    }
    for term in (1..=TRANSITION_TERMS).rev() {
        let scale = part / T::of(f64::from(term));
        for i in 0..size {
            let row = &mut next[i][..size];
            row.fill(zero);
            row[i] = one;
            for k in 0..size {
                let factor = a[i][k] * scale;
                if factor != zero {
                    add(row, factor, &known[k]);
                }
            }
        }
        core::mem::swap(&mut known, &mut next);
    }
    for _ in 0..halvings {
        for i in 0..size {
            let row = &mut next[i][..size];
            row.fill(zero);
            for k in 0..size {
                add(row, known[i][k], &known[k]);
            }
        }
        core::mem::swap(&mut known, &mut next);
    }
    // An odd count of products ends in the other matrix.
    if (TRANSITION_TERMS + halvings) % 2 == 1 {
        for i in 0..size {
            next[i][..size].copy_from_slice(&known[i][..size]);
        }
    }
}

/// How a forcing goes on within a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Shape {
    /// It stays.
    Constant,
    /// It grows as the square of the time, to its value at the end of the step.
    Square,
}

/// 1/n!.
const SHARES: [f64; 8] = [1.0, 1.0, 1.0 / 2.0, 1.0 / 6.0, 1.0 / 24.0, 1.0 / 120.0, 1.0 / 720.0, 1.0 / 5040.0];

/// δ after `h` seconds of δ′ = A δ + g from δ = 0.
///
/// A part of p seconds that begins at δ adds p Σ (A p)ᵏ (A δ/(k+1)! + cₖ g). A constant forcing has cₖ = 1/(k+1)!. A growing one has in part b of B the
/// shape (b + s)²/B², 0 ≤ s ≤ 1, and cₖ = (b²/(k+1)! + 2 b/(k+2)! + 2/(k+3)!)/B².
pub(crate) fn response<T: Real, const N: usize>(
    a: &[[T; N]; N],
    size: usize,
    h: T,
    halvings: u32,
    (forcing, shape): (&[T; N], Shape),
) -> [T; N] {
    let (one, two) = (T::of(1.0), T::of(2.0));
    let parts = 1u32 << halvings;
    let part = h * T::power_of_two(-(halvings as i32));
    let less = T::power_of_two(-2 * (halvings as i32));
    let (mut state, mut slope, mut product) = ([T::of(0.0); N], [T::of(0.0); N], [T::of(0.0); N]);
    let mut begin = T::of(0.0);
    for _ in 0..parts {
        multiply(a, size, &state, &mut slope);
        let mut sum = [T::of(0.0); N];
        for k in (0..=TERMS).rev() {
            let [first, second, third] = [SHARES[k + 1], SHARES[k + 2], SHARES[k + 3]].map(T::of);
            let share = match shape {
                Shape::Constant => first,
                Shape::Square => (begin * begin * first + two * (begin * second + third)) * less,
            };
            multiply(a, size, &sum, &mut product);
            for i in 0..size {
                sum[i] = first * slope[i] + share * forcing[i] + part * product[i];
            }
        }
        add(&mut state[..size], part, &sum);
        begin += one;
    }
    state
}

/// A v.
pub(crate) fn multiply<T: Real, const N: usize>(a: &[[T; N]; N], size: usize, v: &[T; N], product: &mut [T; N]) {
    for i in 0..size {
        product[i] = crate::factor::dot(&a[i][..size], v);
    }
}

/// to ← to + factor from.
fn add<T: Real>(to: &mut [T], factor: T, from: &[T]) {
    for (to, from) in to.iter_mut().zip(from) {
        *to += factor * *from;
    }
}
