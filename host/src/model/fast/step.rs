//! One step of four samples, with its derivatives by state and coordinates.

use super::drive::Accelerations;
use super::{Dynamics, Fast, Samples};
use crate::model::Integrator;
use solve::simd::{Quad, Simd, Wide};

/// φ(x, u) and `[∂φ/∂x | ∂φ/∂z]` of four samples, and the space that it takes to make them: one a thread.
#[derive(Debug, Clone, Default)]
pub struct StepQuads {
    /// The states after the step, one quad a component.
    pub next: Vec<Quad>,
    /// Their derivatives, size × (size + coordinates) by rows.
    pub slopes: Vec<Quad>,
    x: Vec<Quad>,
    k: Vec<Quad>,
    /// f's derivatives, and those of the inner stage's state and of its slope k.
    f: Vec<Quad>,
    dx: Vec<Quad>,
    dk: Vec<Quad>,
}

impl StepQuads {
    /// The states `duration_s` after `samples` (which are at `x`) with the inputs `u` held; with derivatives where `WITH_SLOPES`.
    #[inline(always)]
    pub fn step<S: Simd, const N: usize, const WITH_SLOPES: bool>(
        &mut self,
        integrator: Integrator,
        (fast, dynamics): (&Fast, &Dynamics<'_>),
        (samples, x): (&Samples<S, N>, &[Quad]),
        u: &[Quad],
        duration_s: &Quad,
    ) {
        let simd = samples.simd;
        let (size, columns) = (4 * N, dynamics.columns());
        self.next.clear();
        self.next.extend_from_slice(x);
        if WITH_SLOPES {
            for matrix in [&mut self.f, &mut self.dx, &mut self.dk, &mut self.slopes] {
                matrix.resize(size * columns, Quad::default());
            }
            self.slopes.fill(Quad::default());
            for i in 0..size {
                self.slopes[i * columns + i] = Quad([1.0; 4]);
            }
        }
        self.k.resize(size, Quad::default());
        let h = Wide::load(simd, &duration_s.0);
        let inner = integrator.stages();
        for (stage, &(along, weight)) in inner.iter().enumerate() {
            let (step, scale) = (h * along, h * weight);
            let moved;
            let samples = if stage == 0 {
                samples
            } else {
                self.x.clear();
                self.x.extend_from_slice(x);
                for (x, k) in self.x.iter_mut().zip(&self.k) {
                    x.0 = step.mul_add(Wide::load(simd, &k.0), Wide::load(simd, &x.0)).to_array();
                }
                moved = Samples::new(simd, fast, &self.x);
                &moved
            };
            let a = Accelerations::of(dynamics, samples, u);
            for i in 0..N {
                self.k[i] = Quad(samples.qd[i].to_array());
                self.k[N + i] = Quad(a.qdd[i].to_array());
                self.k[2 * N + i] = Quad(samples.thetad[i].to_array());
                self.k[3 * N + i] = Quad(a.thetadd[i].to_array());
            }
            for (next, k) in self.next.iter_mut().zip(&self.k) {
                next.0 = scale.mul_add(Wide::load(simd, &k.0), Wide::load(simd, &next.0)).to_array();
            }
            if WITH_SLOPES {
                a.slopes(dynamics, samples, u, columns, &mut self.f);
                if stage == 0 {
                    self.first_slopes::<S, N>(simd, columns, inner.len() > 1, scale);
                } else {
                    self.inner_slopes::<S, N>(simd, columns, step, scale);
                }
            }
        }
    }

    /// dk = ∂f at the start of the step, where ∂x is the unit matrix. Only kept for methods that have inner stages.
    #[inline(always)]
    fn first_slopes<S: Simd, const N: usize>(&mut self, simd: S, columns: usize, keep: bool, scale: Wide<S>) {
        if keep {
            self.dk.fill(Quad::default());
        }
        for i in 0..N {
            for (row, speed) in [(i, N + i), (2 * N + i, 3 * N + i)] {
                // The derivative of a position is its speed.
                let to = &mut self.slopes[row * columns + speed].0;
                *to = (Wide::load(simd, to) + scale).to_array();
                let from = &self.f[speed * columns..(speed + 1) * columns];
                for (to, from) in self.slopes[speed * columns..(speed + 1) * columns].iter_mut().zip(from) {
                    to.0 = scale.mul_add(Wide::load(simd, &from.0), Wide::load(simd, &to.0)).to_array();
                }
                if keep {
                    self.dk[row * columns + speed] = Quad([1.0; 4]);
                    self.dk[speed * columns..(speed + 1) * columns].copy_from_slice(from);
                }
            }
        }
    }

    /// dx = [1 | 0] + h dk, then dk = f_x dx + [0 | f_z], of which the step takes `scale`.
    #[inline(always)]
    fn inner_slopes<S: Simd, const N: usize>(&mut self, simd: S, columns: usize, step: Wide<S>, scale: Wide<S>) {
        let size = 4 * N;
        for (dx, dk) in self.dx.iter_mut().zip(&self.dk) {
            dx.0 = (Wide::load(simd, &dk.0) * step).to_array();
        }
        for i in 0..size {
            let unit = &mut self.dx[i * columns + i].0;
            *unit = (Wide::load(simd, unit) + 1.0).to_array();
        }
        for i in 0..N {
            for (row, speed, depends) in [(i, N + i, 0..4 * N), (2 * N + i, 3 * N + i, 0..0)] {
                let from = &self.dx[speed * columns..(speed + 1) * columns];
                self.dk[row * columns..(row + 1) * columns].copy_from_slice(from);
                let f = &self.f[speed * columns..(speed + 1) * columns];
                for c in 0..columns {
                    let mut sum = Wide::splat(simd, 0.0);
                    if c >= size {
                        sum = Wide::load(simd, &f[c].0);
                    }
                    if depends.is_empty() {
                        // A motor sees its own joint only.
                        for j in [i, N + i, 2 * N + i, 3 * N + i] {
                            let dx = Wide::load(simd, &self.dx[j * columns + c].0);
                            sum = Wide::load(simd, &f[j].0).mul_add(dx, sum);
                        }
                    } else {
                        for j in depends.clone() {
                            let dx = Wide::load(simd, &self.dx[j * columns + c].0);
                            sum = Wide::load(simd, &f[j].0).mul_add(dx, sum);
                        }
                    }
                    self.dk[speed * columns + c].0 = sum.to_array();
                }
            }
        }
        for (to, dk) in self.slopes.iter_mut().zip(&self.dk) {
            to.0 = scale.mul_add(Wide::load(simd, &dk.0), Wide::load(simd, &to.0)).to_array();
        }
    }
}
