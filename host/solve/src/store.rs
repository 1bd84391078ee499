//! What is kept of every stage for the back-substitution and for further steps by the same factor: U and `[Y | Z y]`, in double or single precision.
//!
//! ```text
//! one stage, by groups of four:  U's rows from their diagonal block on | rows of [Y | Z] | y
//! ```
//! The elimination itself is always in double precision, and so are the Schur complement and its gradient. What is kept is read to find the
//! states' step, and to eliminate the gradient of another point near the end of a search: in single precision it has seven digits, which the
//! next iteration mends, at half the memory and half of its traffic, which is what the time goes into.
//!
//! Memory of single precision goes from one factor to the next: what went back to the system would come again page by page, each emptied
//! anew, which takes as long as half an iteration.

use std::sync::Mutex;

use super::kernel;
use crate::simd::{LANES, Quad, Simd};

/// How a factor keeps what the back-substitution needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Precision {
    /// Eight bytes a number: steps are as good as the elimination.
    Double,
    /// Four bytes a number: steps have seven digits.
    Single,
}

/// A number as it is kept.
pub(super) trait Kept: Copy + Default + Send + Sync {
    fn keep(values: [f64; LANES]) -> [Self; LANES];
    fn back(values: &[Self; LANES]) -> [f64; LANES];
}

impl Kept for f64 {
    #[inline(always)]
    fn keep(values: [f64; LANES]) -> [f64; LANES] {
        values
    }
    #[inline(always)]
    fn back(values: &[f64; LANES]) -> [f64; LANES] {
        *values
    }
}

impl Kept for f32 {
    #[inline(always)]
    fn keep(values: [f64; LANES]) -> [f32; LANES] {
        values.map(|value| value as f32)
    }
    #[inline(always)]
    fn back(values: &[f32; LANES]) -> [f64; LANES] {
        values.map(f64::from)
    }
}

/// The groups of all stages, in order.
#[derive(Debug)]
pub(super) enum Store {
    Double(Vec<[f64; LANES]>),
    Single(Vec<[f32; LANES]>),
    /// So many groups that are not kept: of a factor that nobody asks for steps.
    Nothing(usize),
}

/// A run of it.
#[derive(Debug)]
pub(super) enum StoreMut<'a> {
    Double(&'a mut [[f64; LANES]]),
    Single(&'a mut [[f32; LANES]]),
    Nothing(usize),
}

impl Store {
    pub(super) fn new(precision: Precision, groups: usize) -> Self {
        match precision {
            Precision::Double => Store::Double(vec![[0.0; LANES]; groups]),
            Precision::Single => Store::Single(Spare::take(groups)),
        }
    }

    pub(super) fn all(&mut self) -> StoreMut<'_> {
        match self {
            Store::Double(groups) => StoreMut::Double(groups),
            Store::Single(groups) => StoreMut::Single(groups),
            Store::Nothing(groups) => StoreMut::Nothing(*groups),
        }
    }

    /// The numbers from group `first` on.
    pub(super) fn copy(&self, first: usize, to: &mut [f64]) {
        for (at, to) in (first..).zip(to.as_chunks_mut::<LANES>().0) {
            *to = match self {
                Store::Double(groups) => groups[at],
                Store::Single(groups) => f32::back(&groups[at]),
                Store::Nothing(_) => unreachable!("a factor that keeps nothing is not handed out"),
            };
        }
    }
}

impl Drop for Store {
    fn drop(&mut self) {
        if let Store::Single(groups) = self {
            Spare::give(std::mem::take(groups));
        }
    }
}

/// The memory of factors that are gone, for those that come: as much as so many of them had.
struct Spare(Vec<Vec<[f32; LANES]>>);

static SPARE: Mutex<Spare> = Mutex::new(Spare(Vec::new()));

impl Spare {
    const MOST: usize = 2;

    /// So many groups, of any content: a factor writes all of them before it reads any.
    fn take(groups: usize) -> Vec<[f32; LANES]> {
        // What a thread left there when it panicked is memory all the same.
        let mut spare = SPARE.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        // The smallest that is large enough.
        let fitting = spare.0.iter().enumerate().filter(|(_, memory)| memory.capacity() >= groups);
        let smallest = fitting.min_by_key(|(_, memory)| memory.capacity()).map(|(at, _)| at);
        let memory = smallest.map(|at| spare.0.swap_remove(at));
        drop(spare);
        match memory {
            Some(mut memory) => {
                memory.resize(groups, [0.0; LANES]);
                memory
            }
            None => vec![[0.0; LANES]; groups],
        }
    }

    fn give(memory: Vec<[f32; LANES]>) {
        let mut spare = SPARE.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        spare.0.push(memory);
        if spare.0.len() > Self::MOST {
            // The smallest is the soonest made anew.
            let smallest = spare.0.iter().enumerate().min_by_key(|(_, memory)| memory.capacity());
            if let Some((at, _)) = smallest {
                spare.0.swap_remove(at);
            }
        }
    }
}

/// Leaves memory that nobody should read before it is written.
#[cfg(test)]
pub(super) fn spoil_spare() {
    (0..Spare::MOST).for_each(|_| Spare::give(vec![[f32::NAN; LANES]; 1 << 16]));
}

impl<'a> StoreMut<'a> {
    pub(super) fn groups(&self) -> usize {
        match self {
            StoreMut::Double(groups) => groups.len(),
            StoreMut::Single(groups) => groups.len(),
            StoreMut::Nothing(groups) => *groups,
        }
    }

    pub(super) fn split_at(self, groups: usize) -> (StoreMut<'a>, StoreMut<'a>) {
        match self {
            StoreMut::Double(all) => {
                let (a, b) = all.split_at_mut(groups);
                (StoreMut::Double(a), StoreMut::Double(b))
            }
            StoreMut::Single(all) => {
                let (a, b) = all.split_at_mut(groups);
                (StoreMut::Single(a), StoreMut::Single(b))
            }
            StoreMut::Nothing(all) => (StoreMut::Nothing(groups), StoreMut::Nothing(all - groups)),
        }
    }

    /// A part of it.
    #[inline(always)]
    pub(super) fn part(&mut self, groups: std::ops::Range<usize>) -> StoreMut<'_> {
        match self {
            StoreMut::Double(all) => StoreMut::Double(&mut all[groups]),
            StoreMut::Single(all) => StoreMut::Single(&mut all[groups]),
            StoreMut::Nothing(_) => StoreMut::Nothing(groups.len()),
        }
    }

    /// Keeps a factored front `[U | Y | Z]` and y. All of it belongs to one stage.
    #[inline(always)]
    pub(super) fn keep(&mut self, front: &[Quad], right: &[f64]) {
        match self {
            StoreMut::Double(to) => keep(front, right, to),
            StoreMut::Single(to) => keep(front, right, to),
            StoreMut::Nothing(_) => {}
        }
    }
}

/// Groups that U takes.
pub(super) const fn triangle(n: usize) -> usize {
    n * (n / LANES + 1) / 2
}

#[inline(always)]
fn keep<T: Kept>(front: &[Quad], right: &[f64], to: &mut [[T; LANES]]) {
    let n = right.len();
    let own = n / LANES;
    let behind = front.len() / n - own;
    let (u, rest) = to.split_at_mut(triangle(n));
    let (rows, y) = rest.split_at_mut(n * behind);
    let mut first = 0;
    for i in 0..n {
        let groups = i / LANES..own;
        let row = &mut u[first..first + groups.len()];
        first += groups.len();
        for (to, from) in row.iter_mut().zip(front[groups.start * n + i..].iter().step_by(n)) {
            *to = T::keep(from.0);
        }
    }
    for (i, row) in rows.chunks_exact_mut(behind).enumerate() {
        for (to, from) in row.iter_mut().zip(front[own * n + i..].iter().step_by(n)) {
            *to = T::keep(from.0);
        }
    }
    for (to, from) in y.iter_mut().zip(right.as_chunks::<LANES>().0) {
        *to = T::keep(*from);
    }
}

/// `own = −U⁻¹ ([Y | Z] known + y)` of one stage: `known` is the step of the stage it was eliminated into, and of the shared unknowns.
#[inline(always)]
pub(super) fn substitute<S: Simd, T: Kept>(simd: S, kept: &[[T; LANES]], known: &[Quad], own: &mut [Quad]) {
    let (groups, n) = (known.len(), own.len() * LANES);
    let (u, rest) = kept.split_at(triangle(n));
    let (rows, y) = rest.split_at(n * groups);
    let (neighbour, shared) = known.split_at(own.len());
    for ((rows, y), own) in rows.chunks_exact(LANES * groups).zip(y).zip(&mut *own) {
        let mut sums = [simd.splat(0.0); LANES];
        // What does not wait for the neighbour comes first.
        for (known, first) in [(shared, neighbour.len()), (neighbour, 0)] {
            for (r, sum) in sums.iter_mut().enumerate() {
                let row = &rows[r * groups + first..][..known.len()];
                for (row, known) in row.iter().zip(known) {
                    *sum = simd.mul_add(simd.load(&T::back(row)), simd.load(&known.0), *sum);
                }
            }
        }
        let (sums, y) = (kernel::add_across(simd, sums), T::back(y));
        *own = Quad(std::array::from_fn(|r| -(sums[r] + y[r])));
    }
    backward(simd, u, own);
}

/// Solves `U x = x` in place.
#[inline(always)]
fn backward<S: Simd, T: Kept>(simd: S, u: &[[T; LANES]], x: &mut [Quad]) {
    let blocks = x.len();
    let mut end = u.len();
    for block in (0..blocks).rev() {
        let width = blocks - block;
        let rows = &u[end - LANES * width..end];
        end -= LANES * width;
        let (x, known) = x.split_at_mut(block + 1);
        let mut sums = [simd.splat(0.0); LANES];
        for (r, sum) in sums.iter_mut().enumerate() {
            for (row, known) in rows[r * width + 1..(r + 1) * width].iter().zip(known.iter()) {
                *sum = simd.mul_add(simd.load(&T::back(row)), simd.load(&known.0), *sum);
            }
        }
        let loss = kernel::add_across(simd, sums);
        let x = &mut x[block].0;
        for i in (0..LANES).rev() {
            let row = T::back(&rows[i * width]);
            let mut sum = x[i] - loss[i];
            for k in i + 1..LANES {
                sum -= row[k] * x[k];
            }
            x[i] = sum * row[i];
        }
    }
}
