//! What is kept of every stage for the back-substitution and for further steps by the same factor: U and `[Y | Z y]`, in double or single precision.
//!
//! ```text
//! one stage, by groups of four columns:  U, each group down to its diagonal block | [Y | Z], n rows a group | y
//! ```
//! That is the order of the front, so that keeping is copying.
//!
//! The elimination itself is always in double precision, and so are the Schur complement and its gradient. What is kept is read to find the
//! states' step, and to eliminate the gradient of another point near the end of a search: in single precision it has seven digits, which the
//! next iteration mends, at half the memory and half of its traffic, which is what the time goes into.
//!
//! Memory of single precision goes from one factor to the next: what went back to the system would come again page by page, each emptied
//! anew, which takes as long as half an iteration.

use std::sync::Mutex;

use super::kernel;
use crate::simd::{LANES, Quad, Simd, fetch};

/// How a factor keeps what the back-substitution needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Precision {
    /// Eight bytes a number: steps are as good as the elimination.
    Double,
    /// Four bytes a number: steps have seven digits.
    Single,
}

/// A number as it is kept.
pub(super) trait Kept: Copy + Send + Sync {
    fn keep<S: Simd>(simd: S, values: S::Vector) -> [Self; LANES];
    fn back<S: Simd>(simd: S, values: &[Self; LANES]) -> S::Vector;
}

impl Kept for f64 {
    #[inline(always)]
    fn keep<S: Simd>(simd: S, values: S::Vector) -> [f64; LANES] {
        simd.store(values)
    }
    #[inline(always)]
    fn back<S: Simd>(simd: S, values: &[f64; LANES]) -> S::Vector {
        simd.load(values)
    }
}

impl Kept for f32 {
    #[inline(always)]
    fn keep<S: Simd>(simd: S, values: S::Vector) -> [f32; LANES] {
        simd.store_single(values)
    }
    #[inline(always)]
    fn back<S: Simd>(simd: S, values: &[f32; LANES]) -> S::Vector {
        simd.load_single(values)
    }
}

impl<T: Kept> kernel::Four for [T; LANES] {
    #[inline(always)]
    fn load<S: Simd>(&self, simd: S) -> S::Vector {
        T::back(simd, self)
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

    /// Four numbers.
    #[inline(always)]
    pub(super) fn quad(&self, at: usize) -> [f64; LANES] {
        match self {
            Store::Double(groups) => groups[at],
            Store::Single(groups) => groups[at].map(f64::from),
            Store::Nothing(_) => unreachable!("a factor that keeps nothing is not handed out"),
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

    /// Asks for the memory, which will soon be written.
    pub(super) fn fetch(&self) {
        match self {
            StoreMut::Double(all) => fetch(all),
            StoreMut::Single(all) => fetch(all),
            StoreMut::Nothing(_) => {}
        }
    }

    /// Keeps a factored front `[U | Y | Z]` and y. All of it belongs to one stage.
    #[inline(always)]
    pub(super) fn keep<S: Simd>(&mut self, simd: S, front: &[Quad], right: &[f64]) {
        match self {
            StoreMut::Double(to) => keep(simd, front, right, to),
            StoreMut::Single(to) => keep(simd, front, right, to),
            StoreMut::Nothing(_) => {}
        }
    }
}

/// Groups that U takes.
pub(super) const fn triangle(n: usize) -> usize {
    n * (n / LANES + 1) / 2
}

/// Where the groups of U begin: each has the rows down to its diagonal block.
#[inline(always)]
pub(super) const fn upper_group(group: usize) -> usize {
    triangle(group * LANES)
}

#[inline(always)]
fn keep<S: Simd, T: Kept>(simd: S, front: &[Quad], right: &[f64], to: &mut [[T; LANES]]) {
    let n = right.len();
    let own = n / LANES;
    let (u, to) = to.split_at_mut(triangle(n));
    for (group, front) in front[..own * n].chunks_exact(n).enumerate() {
        let rows = (group + 1) * LANES;
        keep_all(simd, &front[..rows], &mut u[upper_group(group)..][..rows]);
    }
    let (rows, y) = to.split_at_mut(front.len() - own * n);
    keep_all(simd, &front[own * n..], rows);
    for (to, from) in y.iter_mut().zip(right.as_chunks::<LANES>().0) {
        *to = T::keep(simd, simd.load(from));
    }
}

#[inline(always)]
fn keep_all<S: Simd, T: Kept>(simd: S, from: &[Quad], to: &mut [[T; LANES]]) {
    for (to, from) in to.iter_mut().zip(from) {
        *to = T::keep(simd, simd.load(&from.0));
    }
}

/// `own = −U⁻¹ ([Y | Z] known + y)` of one stage: `known` is the step of the stage it was eliminated into, and of the shared unknowns.
#[inline(always)]
pub(super) fn substitute<S: Simd, T: Kept>(simd: S, kept: &[[T; LANES]], known: &[Quad], own: &mut [Quad]) {
    let n = own.len() * LANES;
    let (u, rest) = kept.split_at(triangle(n));
    let (rows, y) = rest.split_at(n * known.len());
    let (by_neighbour, by_shared) = rows.split_at(n * own.len());
    let (neighbour, shared) = known.split_at(own.len());
    for (block, (y, own)) in y.iter().zip(&mut *own).enumerate() {
        let mut sums = [simd.splat(0.0); LANES];
        // What does not wait for the neighbour comes first.
        for (rows, known) in [(by_shared, shared), (by_neighbour, neighbour)] {
            for (group, known) in rows.chunks_exact(n).zip(known) {
                let rows = &group[block * LANES..][..LANES];
                let known = simd.load(&known.0);
                for r in 0..LANES {
                    sums[r] = simd.mul_add(T::back(simd, &rows[r]), known, sums[r]);
                }
            }
        }
        let sum = simd.add(kernel::add_across(simd, sums), T::back(simd, y));
        own.0 = simd.store(simd.sub(simd.splat(0.0), sum));
    }
    backward(simd, u, own);
}

/// Solves `U x = x` in place.
#[inline(always)]
fn backward<S: Simd, T: Kept>(simd: S, u: &[[T; LANES]], x: &mut [Quad]) {
    for block in (0..x.len()).rev() {
        let rows = |group: usize| &u[upper_group(group) + block * LANES..][..LANES];
        let mut sums = [simd.splat(0.0); LANES];
        for group in block + 1..x.len() {
            let (rows, known) = (rows(group), simd.load(&x[group].0));
            for r in 0..LANES {
                sums[r] = simd.mul_add(T::back(simd, &rows[r]), known, sums[r]);
            }
        }
        let own = rows(block);
        let mut value = simd.store(simd.sub(simd.load(&x[block].0), kernel::add_across(simd, sums)));
        for i in (0..LANES).rev() {
            let row = simd.store(T::back(simd, &own[i]));
            for k in i + 1..LANES {
                value[i] -= row[k] * value[k];
            }
            value[i] *= row[i];
        }
        x[block].0 = value;
    }
}
