//! Kernels and vectors against plain sums, for every instruction set that this machine has.

use std::marker::PhantomData;

use rand::{RngExt, SeedableRng, rngs::StdRng};

use crate::kernel::{self, Add, Change, Rows, Set, Subtract, Sums};
use crate::simd::{LANES, Plain, Quad, Simd, Work, columns, vectorised};
use crate::{BATCH, Shape, Stage};

fn random(rng: &mut StdRng, quads: usize) -> Vec<Quad> {
    (0..quads).map(|_| Quad(std::array::from_fn(|_| rng.random_range(-1.0..1.0)))).collect()
}

/// Column `c` of row `k`, of groups of so many rows.
fn at(values: &[Quad], rows: usize, k: usize, c: usize) -> f64 {
    values[c / LANES * rows + k].0[c % LANES]
}

/// What is asked of a kernel of sums.
#[derive(Debug, Clone)]
struct Case {
    /// Groups, room and rows of the matrix that is multiplied with itself.
    groups: usize,
    capacity: usize,
    count: usize,
    left: std::ops::Range<usize>,
    /// Of a product; none for the upper part.
    right: Option<std::ops::Range<usize>>,
    gap: std::ops::Range<usize>,
}

struct Run<'a, C> {
    case: &'a Case,
    values: &'a [Quad],
    sums: &'a mut [Quad],
    height: usize,
    change: PhantomData<C>,
}

impl<C: Change> Work for Run<'_, C> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Case { capacity, count, left, right, gap, .. } = self.case.clone();
        let rows = Rows { values: self.values, capacity, count };
        let mut sums = Sums { gap, ..Sums::of(self.sums, self.height) };
        match right {
            Some(right) => kernel::product::<S, C>(simd, rows, left, right, &mut sums),
            None => kernel::upper::<S, C>(simd, rows, left, self.case.groups, &mut sums),
        }
    }
}

/// Runs a case both ways, and compares everything that is promised.
fn holds<C: Change>(case: &Case, expected: impl Fn(f64, f64) -> f64) {
    let change = PhantomData::<C>;
    let mut rng = StdRng::seed_from_u64(7);
    let height = case.left.len() * LANES + 4;
    let mut values = random(&mut rng, case.groups * case.capacity);
    // What is behind the rows is nobody's.
    for group in values.chunks_mut(case.capacity) {
        group[case.count..].fill(Quad([f64::NAN; LANES]));
    }
    let before = random(&mut rng, (case.groups + case.gap.len()) * height);
    let right = case.right.clone().unwrap_or(case.left.start..case.groups);
    let mut found = [before.clone(), before.clone()];
    let [best, plain] = &mut found;
    vectorised(Run { case, values: &values, sums: best, height, change });
    Run { case, values: &values, sums: plain, height, change }.run(Plain);
    let mut is_free = vec![true; before.len()];
    for i in 0..case.left.len() * LANES {
        for j in 0..right.len() * LANES {
            // Below the diagonal blocks of an upper part nothing is promised.
            if case.right.is_none() && j / LANES < i / LANES {
                continue;
            }
            let (a, b) = (case.left.start * LANES + i, right.start * LANES + j);
            let sum =
                (0..case.count).map(|k| at(&values, case.capacity, k, a) * at(&values, case.capacity, k, b)).sum();
            let group = j / LANES + if j / LANES < case.gap.start { 0 } else { case.gap.len() };
            let column = group * LANES + j % LANES;
            is_free[group * height + i] = false;
            let expected = expected(at(&before, height, i, column), sum);
            for found in &found {
                let found = at(found, height, i, column);
                // atol 1e-14 (sums of at most 13 products below 1)
                assert!((found - expected).abs() < 1e-14, "{case:?} row {i} column {j}: {found} instead of {expected}");
            }
        }
    }
    for (at, is_free) in is_free.into_iter().enumerate() {
        assert!(!is_free || found.iter().all(|found| found[at] == before[at]), "{case:?}: quad {at} is another's");
    }
}

#[test]
fn sums_are_those_of_the_products() {
    for groups in 1..8usize {
        for count in [0, 1, 4, 5, 12, 13] {
            for (left, right, gap) in [
                (0..groups, None, 0..0),
                (0..groups, None, 1..3),
                (groups / 2..groups, None, 0..0),
                (0..groups.div_ceil(2), Some(groups / 2..groups), 0..0),
                (groups - 1..groups, Some(0..groups), 0..0),
            ] {
                let case = Case { groups, capacity: count.max(1) + count % 3, count, left, right, gap };
                holds::<Add>(&case, |before, sum| before + sum);
                holds::<Subtract>(&case, |before, sum| before - sum);
                holds::<Set>(&case, |_, sum| sum);
            }
        }
    }
}

/// `front` factored, and the right-hand side.
struct Factored<'a>(&'a mut [Quad], &'a mut [f64]);

impl Work for Factored<'_> {
    type Output = Result<(), kernel::Pivot>;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Self::Output {
        kernel::factor(simd, self.0, self.1)
    }
}

#[test]
fn a_front_is_factored_with_all_behind_it() {
    let mut rng = StdRng::seed_from_u64(3);
    for (n, groups) in [(4, 1), (4, 2), (8, 3), (12, 6), (12, 12), (16, 7)] {
        // D = Mᵀ M + 1, so that it is positive; below its diagonal is what nobody reads.
        let m = random(&mut rng, n / LANES * n);
        let mut front = random(&mut rng, groups * n);
        for i in 0..n {
            for j in 0..n {
                let sum: f64 = (0..n).map(|k| at(&m, n, k, i) * at(&m, n, k, j)).sum();
                front[j / LANES * n + i].0[j % LANES] = if i > j { f64::NAN } else { sum + f64::from(i == j) };
            }
        }
        let right: Vec<f64> = (0..n).map(|_| rng.random_range(-1.0..1.0)).collect();
        let mut both = [(front.clone(), right.clone()), (front.clone(), right.clone())];
        let [best, plain] = &mut both;
        vectorised(Factored(&mut best.0, &mut best.1)).unwrap();
        Factored(&mut plain.0, &mut plain.1).run(Plain).unwrap();
        for (found, y) in both {
            // Uᵀ [U | rest | y] gives back what was there; on U's diagonal are reciprocals.
            let u = |k: usize, i: usize| if k == i { 1.0 / at(&found, n, k, k) } else { at(&found, n, k, i) };
            for i in 0..n {
                for j in i..groups * LANES {
                    let value = |k: usize| if j < n { u(k, j) } else { at(&found, n, k, j) };
                    let back: f64 = (0..=i).map(|k| u(k, i) * value(k)).sum();
                    let before = at(&front, n, i, j);
                    // rtol 1e-13, atol 1e-13
                    assert!(
                        (back - before).abs() < 1e-13 * (1.0 + before.abs()),
                        "{n}, {groups}: {i} {j}: {back} {before}"
                    );
                }
                let back: f64 = (0..=i).map(|k| u(k, i) * y[k]).sum();
                assert!((back - right[i]).abs() < 1e-13, "{n}, {groups}: {i}: {back} {}", right[i]);
            }
        }
    }
}

#[test]
fn what_is_no_positive_pivot_is_named() {
    for (value, index) in [(0.0, 5), (-2.0, 0), (f64::NAN, 11), (f64::INFINITY, 7)] {
        let mut front = vec![Quad::default(); 3 * 12];
        for i in 0..12 {
            front[i / LANES * 12 + i].0[i % LANES] = if i == index { value } else { 1.0 };
        }
        let mut plain = front.clone();
        let found = vectorised(Factored(&mut front, &mut [0.0; 12])).unwrap_err();
        assert_eq!(found.index, index);
        assert_eq!(found.value.to_bits(), value.to_bits());
        assert_eq!(Factored(&mut plain, &mut [0.0; 12]).run(Plain).unwrap_err().index, index);
    }
}

/// Vectors `Σ_k groups[k] by[k]`, added.
struct Weighted<'a>(&'a [[f32; LANES]], usize, &'a [f64], &'a mut [[f64; LANES]]);

impl Work for Weighted<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        kernel::change_weighted::<S, _, Add>(simd, self.0, self.1, self.2, self.3);
    }
}

#[test]
fn vectors_are_summed_from_single_precision() {
    let mut rng = StdRng::seed_from_u64(5);
    for (groups, rows, count) in [(0, 4, 4), (1, 4, 3), (2, 12, 12), (3, 12, 11), (6, 5, 0), (7, 8, 1)] {
        let values: Vec<[f32; LANES]> =
            random(&mut rng, groups * rows).iter().map(|quad| quad.0.map(|value| value as f32)).collect();
        let by: Vec<f64> = (0..count).map(|_| rng.random_range(-1.0..1.0)).collect();
        let (mut best, mut plain) = (vec![[1.0; LANES]; groups], vec![[1.0; LANES]; groups]);
        vectorised(Weighted(&values, rows, &by, &mut best));
        Weighted(&values, rows, &by, &mut plain).run(Plain);
        for g in 0..groups {
            for lane in 0..LANES {
                let sum: f64 = (0..count).map(|k| f64::from(values[g * rows + k][lane]) * by[k]).sum();
                for found in [best[g][lane], plain[g][lane]] {
                    assert!((found - 1.0 - sum).abs() < 1e-14, "{groups} × {rows}: {found} instead of {}", 1.0 + sum);
                }
            }
        }
    }
}

/// A batch's transitions, set from what is four stages wide.
struct Transitions<'a> {
    batch: &'a mut [Stage],
    linked: [bool; BATCH],
    weight: &'a [f64],
    slopes: &'a [Quad],
    defect: &'a [Quad],
}

impl Work for Transitions<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        Stage::set_transitions(simd, self.batch, self.linked, self.weight, self.slopes, self.defect);
    }
}

#[test]
fn transitions_of_a_batch_are_those_of_its_stages() {
    let mut rng = StdRng::seed_from_u64(9);
    for (n, leading, border) in [(1, 0, 0), (3, 1, 2), (5, 4, 4), (12, 12, 24), (13, 6, 9)] {
        for count in 1..=BATCH {
            let shape = Shape { stages: count, stage: n, border, leading, sensed: n };
            let slopes = random(&mut rng, n * (n + leading));
            let defect = random(&mut rng, n);
            let weight: Vec<f64> = (0..n).map(|_| rng.random_range(0.5..2.0)).collect();
            let linked = std::array::from_fn(|lane| lane != 1);
            let mut found = [vec![Stage::empty(shape); count], vec![Stage::empty(shape); count]];
            let [best, plain] = &mut found;
            let (weight, slopes, defect) = (&*weight, &*slopes, &*defect);
            vectorised(Transitions { batch: best, linked, weight, slopes, defect });
            Transitions { batch: plain, linked, weight, slopes, defect }.run(Plain);
            for batch in &found {
                for (lane, stage) in batch.iter().enumerate() {
                    let mut expected = Stage::empty(shape);
                    for i in 0..n {
                        let mut row = expected.transition_row(i, weight[i], weight[i] * defect[i].0[lane]);
                        let of = &slopes[i * (n + leading)..(i + 1) * (n + leading)];
                        (0..n).for_each(|j| row.add_state(j, weight[i] * of[j].0[lane]));
                        (0..leading).for_each(|j| row.add_shared(j, weight[i] * of[n + j].0[lane]));
                    }
                    if !linked[lane] {
                        expected.unlink();
                    }
                    assert_eq!(
                        stage.dense_transition(),
                        expected.dense_transition(),
                        "{n}, {leading}, {lane} of {count}"
                    );
                    let residuals = |stage: &Stage| stage.residuals().collect::<Vec<_>>();
                    assert_eq!(residuals(stage), residuals(&expected));
                }
            }
        }
    }
}

/// The columns of four rows, and the first of them there and back in single precision.
struct Turned<'a>([&'a [f64]; LANES], &'a mut [Quad]);

impl Work for Turned<'_> {
    type Output = [f64; LANES];

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Self::Output {
        columns(simd, self.0, self.1);
        let first = self.1.first().map_or([0.0; LANES], |quad| quad.0);
        simd.store(simd.load_single(&simd.store_single(simd.load(&first))))
    }
}

#[test]
fn rows_become_columns() {
    for length in 0..10 {
        let rows: [Vec<f64>; LANES] =
            std::array::from_fn(|lane| (0..length).map(|j| 0.1 + (10 * j + lane) as f64).collect());
        let rows = [&rows[0][..], &rows[1], &rows[2], &rows[3]];
        let mut found = [vec![Quad::default(); length], vec![Quad::default(); length]];
        let [best, plain] = &mut found;
        let singles = [vectorised(Turned(rows, best)), Turned(rows, plain).run(Plain)];
        for (found, single) in found.iter().zip(singles) {
            for (j, quad) in found.iter().enumerate() {
                assert_eq!(quad.0, [rows[0][j], rows[1][j], rows[2][j], rows[3][j]]);
            }
            let expected = found.first().map_or([0.0; LANES], |quad| quad.0.map(|value| f64::from(value as f32)));
            assert_eq!(single, expected);
        }
    }
}
