//! A column of the derivatives of own states that laws of the drives bring: they go by the method, as speeds do, and nothing goes by them.

use super::{Fast, MOST_OWN};
use solve::simd::{Quad, Simd, Wide};

/// The column at the last stage of a method, and of the step as far as its stages are taken.
pub(super) struct OwnColumn<S: Simd> {
    rates: [Wide<S>; MOST_OWN],
    next: [Wide<S>; MOST_OWN],
}

impl<S: Simd> OwnColumn<S> {
    /// At the first stage: `f` are its derivatives by rows of so many columns, `unit` are the column's of the state there.
    #[inline(always)]
    pub(super) fn begin(
        simd: S,
        fast: &Fast,
        (f, columns, c): (&[Quad], usize, usize),
        unit: &[Quad],
        scale: Wide<S>,
    ) -> Self {
        let zeros = [Wide::splat(simd, 0.0); MOST_OWN];
        let mut column = OwnColumn { rates: zeros, next: zeros };
        for (i, state) in fast.own.iter().enumerate() {
            column.rates[i] = Wide::load(simd, &f[state * columns + c].0);
            column.next[i] = scale.mul_add(column.rates[i], Wide::load(simd, &unit[*state].0));
        }
        column
    }

    /// Derivatives of the states `step` after the beginning.
    #[inline(always)]
    pub(super) fn moved(&self, simd: S, fast: &Fast, unit: &[Quad], step: Wide<S>) -> [Wide<S>; MOST_OWN] {
        let mut moved = self.rates;
        for (i, state) in fast.own.iter().enumerate() {
            moved[i] = step.mul_add(self.rates[i], Wide::load(simd, &unit[*state].0));
        }
        moved
    }

    /// Takes a stage in which the rate of own state i has this derivative.
    #[inline(always)]
    pub(super) fn take(&mut self, i: usize, rate: Wide<S>, scale: Wide<S>) {
        self.rates[i] = rate;
        self.next[i] = scale.mul_add(rate, self.next[i]);
    }

    /// The column into the rows of the states.
    #[inline(always)]
    pub(super) fn put(&self, fast: &Fast, to: &mut [Quad], columns: usize) {
        for (next, state) in self.next.iter().zip(&fast.own) {
            to[state * columns] = Quad(next.to_array());
        }
    }
}

/// sum + Σ row[state] x over the own states.
#[inline(always)]
pub(super) fn add_own<S: Simd>(
    simd: S,
    fast: &Fast,
    row: &[Quad],
    x: &[Wide<S>; MOST_OWN],
    mut sum: Wide<S>,
) -> Wide<S> {
    for (state, x) in fast.own.iter().zip(x) {
        sum = Wide::load(simd, &row[*state].0).mul_add(*x, sum);
    }
    sum
}
