//! The links' torque M(q) q̈ + c(q, q̇) + g(q) of a chain whose inertia and torques of the speeds depend on parameters of laws.
//!
//! It is linear in both: a sum of chains, each with a weight that is a polynomial of the parameters.
//!
//! ```text
//! s: scale of the torques of the speeds, m: a mass       (1 − s)(1 · without + m · mass without) + s (1 · with + m · mass with)
//! ```
//! A torque is linear in the bodies too. So chains that differ by nothing else are one chain with the weighted bodies of all.

use std::borrow::Cow;
use std::ops::Sub;

use super::number::expression::Expression;
use crate::robot::chain::{Chain, MAX_JOINTS};

/// A factor of a weight.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Factor {
    /// The coordinate.
    Times(usize),
    /// One less the coordinate.
    Without(usize),
}

impl Factor {
    /// At coordinates z.
    fn value<T: Copy + From<f64> + Sub<Output = T>>(self, z: &[T]) -> T {
        match self {
            Factor::Times(i) => z[i],
            Factor::Without(i) => T::from(1.0) - z[i],
        }
    }
}

/// Chains with their weights.
#[derive(Debug, Clone)]
pub(super) struct Links {
    terms: Vec<(Chain, Vec<Factor>)>,
}

/// [`Links`] at given parameters.
#[derive(Debug, Clone)]
pub(super) struct WeightedLinks<'m> {
    /// What they come to: a chain with the bodies of all, or one without and one with torques of the speeds where these are scaled.
    sums: Vec<Sum<'m>>,
    /// Chains that depend on coordinates.
    terms: Vec<Term<'m>>,
}

#[derive(Debug, Clone)]
struct Sum<'m> {
    chain: Cow<'m, Chain>,
    /// M and c + g, where they are the same everywhere.
    constant: Option<Constant>,
}

#[derive(Debug, Clone)]
struct Term<'m> {
    chain: &'m Chain,
    /// M and c + g, where they are the same everywhere.
    constant: Option<Constant>,
    /// (coordinate, ∂weight).
    slopes: Vec<(usize, f64)>,
}

/// What a chain is at every position and speed.
#[derive(Debug, Clone)]
struct Constant {
    mass: Vec<f64>,
    bias: Vec<f64>,
}

impl Constant {
    fn of(chain: &Chain) -> Option<Self> {
        let m = chain.joints();
        chain.is_constant().then(|| {
            let (mut mass, mut bias) = (vec![0.0; m * m], vec![0.0; m]);
            chain.mass_matrix(&vec![0.0; m], &mut mass);
            chain.bias_torque(&vec![0.0; m], &vec![0.0; m], &mut bias);
            Constant { mass, bias }
        })
    }

    /// M a + c + g.
    fn torque(&self, a: &[f64], out: &mut [f64]) {
        for ((torque, row), bias) in out.iter_mut().zip(self.mass.chunks_exact(a.len())).zip(&self.bias) {
            *torque = bias + row.iter().zip(a).map(|(mass, a)| mass * a).sum::<f64>();
        }
    }
}

impl<'m> Sum<'m> {
    fn of(chain: Cow<'m, Chain>) -> Self {
        let constant = Constant::of(&chain);
        Sum { chain, constant }
    }

    fn mass_matrix(&self, q: &[f64], out: &mut [f64]) {
        match &self.constant {
            Some(constant) => out.copy_from_slice(&constant.mass),
            None => self.chain.mass_matrix(q, out),
        }
    }

    fn bias_torque(&self, q: &[f64], qd: &[f64], out: &mut [f64]) {
        match &self.constant {
            Some(constant) => out.copy_from_slice(&constant.bias),
            None => self.chain.bias_torque(q, qd, out),
        }
    }

    /// The derivatives of M a + c + g by q and q̇ at constant accelerations a.
    fn derivatives(&self, [q, qd, a]: [&[f64]; 3], by_q: &mut [f64], by_qd: &mut [f64]) {
        if self.constant.is_some() {
            by_q.fill(0.0);
            by_qd.fill(0.0);
            return;
        }
        let mut torque = [0.0; MAX_JOINTS];
        self.chain.link_torque_derivatives(q, qd, a, &mut torque[..q.len()], by_q, by_qd);
    }
}

impl Term<'_> {
    /// M a + c + g.
    fn torque(&self, [q, qd, a]: [&[f64]; 3], out: &mut [f64]) {
        match &self.constant {
            Some(constant) => constant.torque(a, out),
            None => self.chain.link_torque(q, qd, a, out),
        }
    }
}

impl Links {
    /// One chain as described.
    pub(super) fn of(chain: Chain) -> Self {
        Links { terms: vec![(chain, Vec::new())] }
    }

    /// The kinematics, the same for all terms.
    pub(super) fn chain(&self) -> &Chain {
        &self.terms[0].0
    }

    /// Whether anything but the bodies as described moves.
    pub(super) fn is_sum(&self) -> bool {
        self.terms.len() > 1
    }

    /// Adds `chain`, of a body with a unit of mass (or of another moment of it) alone, times a coordinate.
    pub(super) fn add_mass(&mut self, chain: Chain, coordinate: usize) {
        self.terms.push((chain, vec![Factor::Times(coordinate)]));
    }

    /// Scales the torques of the speeds by a coordinate. To be called last.
    pub(super) fn scale_coriolis(&mut self, coordinate: usize) {
        let terms = std::mem::take(&mut self.terms);
        for (chain, factors) in terms {
            for (with, factor) in [(false, Factor::Without(coordinate)), (true, Factor::Times(coordinate))] {
                let mut factors = factors.clone();
                factors.push(factor);
                self.terms.push((chain.clone().with_coriolis(with), factors));
            }
        }
    }

    /// The weights of its chains, written down.
    pub(super) fn traced_weights(&self, z: &[Expression]) -> Vec<Expression> {
        let one = Expression::from(1.0);
        self.terms.iter().map(|(_, factors)| factors.iter().fold(one, |weight, f| weight * f.value(z))).collect()
    }

    /// What `each` gives of its chains, `size` numbers, times these weights.
    pub(super) fn traced_sum(
        &self,
        weights: &[Expression],
        size: usize,
        each: impl Fn(&Chain, &mut [Expression]),
    ) -> Vec<Expression> {
        let zero = Expression::from(0.0);
        let mut sum = vec![zero; size];
        for ((chain, _), weight) in self.terms.iter().zip(weights) {
            let mut one = vec![zero; size];
            each(chain, &mut one);
            for (sum, one) in sum.iter_mut().zip(one) {
                *sum += *weight * one;
            }
        }
        sum
    }

    /// At solver coordinates z.
    pub(super) fn at(&self, z: &[f64]) -> WeightedLinks<'_> {
        let value = |factor: &Factor| factor.value(z);
        let weight = |factors: &[Factor]| factors.iter().map(value).product::<f64>();
        let slopes = |factors: &[Factor]| {
            let slope = |(k, factor): (usize, &Factor)| {
                let others: f64 = factors.iter().enumerate().filter(|(l, _)| *l != k).map(|(_, f)| value(f)).product();
                match *factor {
                    Factor::Times(i) => (i, others),
                    Factor::Without(i) => (i, -others),
                }
            };
            factors.iter().enumerate().map(slope).collect()
        };
        let [(only, factors)] = &self.terms[..] else {
            let with_coriolis = |coriolis: bool| {
                let mut of = self.terms.iter().filter(|(chain, _)| chain.has_coriolis() == coriolis).peekable();
                let (first, _) = of.peek()?;
                Some(first.with_bodies_of(of.map(|(chain, factors)| (weight(factors), chain))))
            };
            let sums = [false, true].into_iter().filter_map(with_coriolis).map(|chain| Sum::of(Cow::Owned(chain)));
            let terms = self.terms.iter().filter(|(_, factors)| !factors.is_empty());
            let terms =
                terms.map(|(chain, factors)| Term { chain, constant: Constant::of(chain), slopes: slopes(factors) });
            return WeightedLinks { sums: sums.collect(), terms: terms.collect() };
        };
        debug_assert!(factors.is_empty(), "the bodies as described depend on nothing");
        WeightedLinks { sums: vec![Sum::of(Cow::Borrowed(only))], terms: Vec::new() }
    }
}

impl WeightedLinks<'_> {
    /// Whether M, c and g are those of others at every q and q̇.
    pub(super) fn equal(&self, others: &WeightedLinks<'_>) -> bool {
        let same = |(a, b): (&Sum<'_>, &Sum<'_>)| a.chain == b.chain;
        self.sums.len() == others.sums.len() && self.sums.iter().zip(&others.sums).all(same)
    }

    /// M(q), m × m by rows.
    pub(super) fn mass_matrix(&self, q: &[f64], out: &mut [f64]) {
        let [first, rest @ ..] = &self.sums[..] else { return out.fill(0.0) };
        first.mass_matrix(q, out);
        for sum in rest {
            let mut one = [0.0; MAX_JOINTS * MAX_JOINTS];
            sum.mass_matrix(q, &mut one[..out.len()]);
            add(out, &one);
        }
    }

    /// c(q, q̇) + g(q).
    pub(super) fn bias_torque(&self, q: &[f64], qd: &[f64], out: &mut [f64]) {
        let [first, rest @ ..] = &self.sums[..] else { return out.fill(0.0) };
        first.bias_torque(q, qd, out);
        for sum in rest {
            let mut one = [0.0; MAX_JOINTS];
            sum.bias_torque(q, qd, &mut one[..out.len()]);
            add(out, &one);
        }
    }

    /// The derivatives of M a + c + g at constant accelerations a by q and q̇ (m × m by rows), and by coordinates through `by_z(joint, coordinate,
    /// slope)`.
    pub(super) fn derivatives(
        &self,
        at: [&[f64]; 3],
        by_q: &mut [f64],
        by_qd: &mut [f64],
        mut by_z: impl FnMut(usize, usize, f64),
    ) {
        let m = at[0].len();
        let [first, rest @ ..] = &self.sums[..] else { return };
        first.derivatives(at, by_q, by_qd);
        for sum in rest {
            let (mut q_slopes, mut qd_slopes) = ([0.0; MAX_JOINTS * MAX_JOINTS], [0.0; MAX_JOINTS * MAX_JOINTS]);
            sum.derivatives(at, &mut q_slopes[..m * m], &mut qd_slopes[..m * m]);
            add(by_q, &q_slopes);
            add(by_qd, &qd_slopes);
        }
        for term in &self.terms {
            let mut torque = [0.0; MAX_JOINTS];
            term.torque(at, &mut torque[..m]);
            for &(coordinate, slope) in &term.slopes {
                for (joint, torque) in torque[..m].iter().enumerate() {
                    by_z(joint, coordinate, slope * torque);
                }
            }
        }
    }
}

fn add(to: &mut [f64], from: &[f64]) {
    for (to, from) in to.iter_mut().zip(from) {
        *to += from;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::{Robot, Symbol};

    /// Three bodies, five moments that are coordinates, torques of the speeds scaled or not: M a + c + g and its derivatives against the weighted sum of the
    /// chains, one by one. rtol 1e-12 of the largest torque.
    #[test]
    fn a_chain_with_the_bodies_of_all_is_the_weighted_sum_of_the_chains() {
        let robot = Robot::builtin("doggy").unwrap();
        let chain = robot.chain().with_coriolis(true);
        let moments: Vec<_> = (0..3).map(|joint| (joint, Symbol::J)).collect();
        let first = [0, 2].map(|joint| (joint, Symbol::FirstMoment { axis: 0 }));
        for scaled in [false, true] {
            let mut links = Links::of(chain.clone());
            for (coordinate, &(joint, symbol)) in moments.iter().chain(&first).enumerate() {
                links.add_mass(chain.massless().with_moment(joint, symbol, 1.0), coordinate);
            }
            if scaled {
                links.scale_coriolis(5);
            }
            let z = [0.013, -0.002, 0.04, 0.3, -0.1, 0.7];
            let (q, qd, a) = ([0.3, -0.5, 0.8], [1.1, -2.0, 0.7], [3.0, 5.0, -4.0]);
            let value = |factor: &Factor| match *factor {
                Factor::Times(i) => z[i],
                Factor::Without(i) => 1.0 - z[i],
            };
            let mut expected = [0.0; 3];
            for (chain, factors) in &links.terms {
                let mut torque = [0.0; 3];
                chain.link_torque(&q, &qd, &a, &mut torque);
                let weight: f64 = factors.iter().map(value).product();
                expected.iter_mut().zip(torque).for_each(|(sum, torque)| *sum += weight * torque);
            }
            let largest = expected.iter().fold(0.0f64, |most, torque| most.max(torque.abs()));
            let torque = |z: &[f64], q: &[f64], qd: &[f64]| -> Vec<f64> {
                let (at, mut mass, mut bias) = (links.at(z), [0.0; 9], [0.0; 3]);
                at.mass_matrix(q, &mut mass);
                at.bias_torque(q, qd, &mut bias);
                let needs = |i: usize| bias[i] + (0..3).map(|j| mass[3 * i + j] * a[j]).sum::<f64>();
                (0..3).map(needs).collect()
            };
            for (found, expected) in torque(&z, &q, &qd).iter().zip(expected) {
                assert!((found - expected).abs() <= 1e-12 * largest, "{found} {expected}");
            }
            let (mut by_q, mut by_qd, mut by_z) = ([0.0; 9], [0.0; 9], [0.0; 18]);
            links
                .at(&z)
                .derivatives([&q, &qd, &a], &mut by_q, &mut by_qd, |joint, i, slope| by_z[6 * joint + i] += slope);
            // Central differences: rtol 1e-8 of the largest torque.
            let step = 1e-5;
            let difference = |of: &dyn Fn(f64) -> Vec<f64>| -> Vec<f64> {
                of(step).iter().zip(of(-step)).map(|(more, less)| (more - less) / (2.0 * step)).collect()
            };
            let moved = |x: &[f64], i: usize, by: f64| {
                let mut x = x.to_vec();
                x[i] += by;
                x
            };
            for i in 0..3 {
                let by = [
                    difference(&|by| torque(&z, &moved(&q, i, by), &qd)),
                    difference(&|by| torque(&z, &q, &moved(&qd, i, by))),
                ];
                for joint in 0..3 {
                    for (by, slopes) in by.iter().zip([&by_q, &by_qd]) {
                        assert!((by[joint] - slopes[3 * joint + i]).abs() <= 1e-8 * largest, "{joint} {i}");
                    }
                }
            }
            for i in 0..6 {
                let by = difference(&|by| torque(&moved(&z, i, by), &q, &qd));
                for joint in 0..3 {
                    assert!((by[joint] - by_z[6 * joint + i]).abs() <= 1e-8 * largest, "{joint} {i}");
                }
            }
        }
    }
}
