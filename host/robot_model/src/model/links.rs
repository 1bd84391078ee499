//! The links' torque M(q) q̈ + c(q, q̇) + g(q) of a chain whose inertia and torques of the speeds depend on parameters of laws.
//!
//! It is linear in both: a sum of chains, each with a weight that is a polynomial of the parameters.
//!
//! ```text
//! s: scale of the torques of the speeds, m: a mass       (1 − s)(1 · without + m · mass without) + s (1 · with + m · mass with)
//! ```

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

/// Chains with their weights.
#[derive(Debug, Clone)]
pub(super) struct Links {
    terms: Vec<(Chain, Vec<Factor>)>,
}

/// [`Links`] at given parameters.
#[derive(Debug, Clone)]
pub(super) struct WeightedLinks<'m> {
    terms: Vec<Term<'m>>,
}

#[derive(Debug, Clone)]
struct Term<'m> {
    chain: &'m Chain,
    /// M and c + g, where they are the same everywhere.
    constant: Option<Constant>,
    weight: f64,
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
}

impl Term<'_> {
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

    /// M a + c + g and its derivatives by q and q̇ at constant accelerations a.
    fn derivatives(&self, [q, qd, a]: [&[f64]; 3], torque: &mut [f64], by_q: &mut [f64], by_qd: &mut [f64]) {
        let Some(Constant { mass, bias }) = &self.constant else {
            return self.chain.link_torque_derivatives(q, qd, a, torque, by_q, by_qd);
        };
        by_q.fill(0.0);
        by_qd.fill(0.0);
        for ((torque, row), bias) in torque.iter_mut().zip(mass.chunks_exact(a.len())).zip(bias) {
            *torque = bias + row.iter().zip(a).map(|(mass, a)| mass * a).sum::<f64>();
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
        let value = |factor: &Factor| match *factor {
            Factor::Times(i) => z[i],
            Factor::Without(i) => one - z[i],
        };
        self.terms.iter().map(|(_, factors)| factors.iter().fold(one, |weight, f| weight * value(f))).collect()
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
        let value = |factor: &Factor| match *factor {
            Factor::Times(i) => z[i],
            Factor::Without(i) => 1.0 - z[i],
        };
        let terms = self.terms.iter().map(|(chain, factors)| {
            let slopes = factors.iter().enumerate().map(|(k, factor)| {
                let others: f64 = factors.iter().enumerate().filter(|(l, _)| *l != k).map(|(_, f)| value(f)).product();
                match *factor {
                    Factor::Times(i) => (i, others),
                    Factor::Without(i) => (i, -others),
                }
            });
            let weight = factors.iter().map(value).product();
            Term { chain, constant: Constant::of(chain), weight, slopes: slopes.collect() }
        });
        WeightedLinks { terms: terms.collect() }
    }
}

impl WeightedLinks<'_> {
    /// Whether M, c and g are those of others at every q and q̇.
    pub(super) fn equal(&self, others: &WeightedLinks<'_>) -> bool {
        let same = |(a, b): (&Term<'_>, &Term<'_>)| a.weight == b.weight && a.chain == b.chain;
        self.terms.len() == others.terms.len() && self.terms.iter().zip(&others.terms).all(same)
    }

    /// M(q), m × m by rows.
    pub(super) fn mass_matrix(&self, q: &[f64], out: &mut [f64]) {
        let [only] = &self.terms[..] else {
            let mut one = [0.0; MAX_JOINTS * MAX_JOINTS];
            out.fill(0.0);
            for term in &self.terms {
                term.mass_matrix(q, &mut one[..out.len()]);
                add(out, term.weight, &one);
            }
            return;
        };
        only.mass_matrix(q, out);
    }

    /// c(q, q̇) + g(q).
    pub(super) fn bias_torque(&self, q: &[f64], qd: &[f64], out: &mut [f64]) {
        let [only] = &self.terms[..] else {
            let mut one = [0.0; MAX_JOINTS];
            out.fill(0.0);
            for term in &self.terms {
                term.bias_torque(q, qd, &mut one[..out.len()]);
                add(out, term.weight, &one);
            }
            return;
        };
        only.bias_torque(q, qd, out);
    }

    /// The derivatives of M a + c + g at constant accelerations a by q and q̇ (m × m by rows), and by coordinates through `by_z(joint, coordinate,
    /// slope)`.
    pub(super) fn derivatives(
        &self,
        [q, qd, a]: [&[f64]; 3],
        by_q: &mut [f64],
        by_qd: &mut [f64],
        mut by_z: impl FnMut(usize, usize, f64),
    ) {
        let m = q.len();
        let mut torque = [0.0; MAX_JOINTS];
        let [only] = &self.terms[..] else {
            let (mut q_slopes, mut qd_slopes) = ([0.0; MAX_JOINTS * MAX_JOINTS], [0.0; MAX_JOINTS * MAX_JOINTS]);
            by_q.fill(0.0);
            by_qd.fill(0.0);
            for term in &self.terms {
                let slopes = (&mut q_slopes[..m * m], &mut qd_slopes[..m * m]);
                term.derivatives([q, qd, a], &mut torque[..m], slopes.0, slopes.1);
                add(by_q, term.weight, &q_slopes);
                add(by_qd, term.weight, &qd_slopes);
                for &(coordinate, slope) in &term.slopes {
                    for (joint, torque) in torque[..m].iter().enumerate() {
                        by_z(joint, coordinate, slope * torque);
                    }
                }
            }
            return;
        };
        only.derivatives([q, qd, a], &mut torque[..m], by_q, by_qd);
    }
}

fn add(to: &mut [f64], weight: f64, from: &[f64]) {
    for (to, from) in to.iter_mut().zip(from) {
        *to += weight * from;
    }
}
