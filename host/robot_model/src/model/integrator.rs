//! One step of the dynamics with the input held, and its exact derivatives by the chain rule through the method's stages. States that only relax towards
//! the others, as those of lagging gyros, go by their own solution (`relaxation`). Errors of measured inputs are held over a step, as inputs are; the noise
//! model says what they are in the next.

use serde::{Deserialize, Serialize};

use super::relaxation::Relaxation;
use super::{Dynamics, Input, Linear};
use solve::simd::compiled_for_this_machine;

/// A one-step method.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Integrator {
    /// x + T f(x, u), equation (31): what the paper does. Damps springs by −k_s T.
    Euler,
    /// The classical fourth-order Runge–Kutta method: one step a sample, or more where friction is too steep for one.
    RungeKutta4,
}

/// φ(x, u) and `[∂φ/∂x | ∂φ/∂z]`, size × (size + coordinates), row-major.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct StepSlopes {
    /// The state after the step.
    pub next: Vec<f64>,
    /// Its derivatives.
    pub slopes: Vec<f64>,
}

/// Scratch space of the integrator: one a thread.
#[derive(Debug, Clone)]
pub struct Stepper {
    integrator: Integrator,
    linear: Linear,
    x: Vec<f64>,
    k: Vec<f64>,
    /// Derivatives of the stage's state and of its slope k.
    dx: Vec<f64>,
    dk: Vec<f64>,
    /// Where a part of a step begins, what it has of derivatives, and their product with those before.
    from: Vec<f64>,
    of_part: StepSlopes,
    product: Vec<f64>,
    /// States that relax, and the rows of their derivatives.
    relaxing: Vec<Relaxation>,
    relaxed: Vec<f64>,
}

const RUNGE_KUTTA_4: [(f64, f64); 4] = [(0.0, 1.0 / 6.0), (0.5, 1.0 / 3.0), (0.5, 1.0 / 3.0), (1.0, 1.0 / 6.0)];
const EULER: [(f64, f64); 1] = [(0.0, 1.0)];

impl Integrator {
    /// The method's inner stages: (how far along the last slope the stage's state lies, the weight of its slope).
    pub(super) fn stages(self) -> &'static [(f64, f64)] {
        match self {
            Integrator::Euler => &EULER,
            Integrator::RungeKutta4 => &RUNGE_KUTTA_4,
        }
    }

    /// Equal parts in which a step of this length is made where a joint comes to rest; one where steps are never divided.
    pub fn parts_near_rest(self, dynamics: &Dynamics<'_>, duration_s: f64) -> usize {
        match self {
            Integrator::Euler => 1,
            Integrator::RungeKutta4 => dynamics.parts_near_rest(duration_s),
        }
    }

    /// Whether no step of this length is divided, as kernels ask that divide none.
    pub fn leaves_whole(self, dynamics: &Dynamics<'_>, duration_s: f64) -> bool {
        self.parts_near_rest(dynamics, duration_s) == 1
    }
}

impl Stepper {
    /// Scratch space for `integrator`.
    pub fn new(integrator: Integrator) -> Self {
        Stepper {
            integrator,
            linear: Linear::default(),
            x: Vec::new(),
            k: Vec::new(),
            dx: Vec::new(),
            dk: Vec::new(),
            from: Vec::new(),
            of_part: StepSlopes::default(),
            product: Vec::new(),
            relaxing: Vec::new(),
            relaxed: Vec::new(),
        }
    }

    /// The state `duration_s` after `x` with the input `u` held, into `next`.
    pub fn step<'i>(
        &mut self,
        dynamics: &Dynamics<'_>,
        x: &[f64],
        input: impl Into<Input<'i>>,
        duration_s: f64,
        next: &mut [f64],
    ) {
        let input = input.into();
        let parts = self.parts(dynamics, x, input, duration_s);
        if parts == 1 {
            self.part(dynamics, x, input, duration_s, next);
        } else {
            let mut from = std::mem::take(&mut self.from);
            from.clear();
            from.extend_from_slice(x);
            for _ in 0..parts {
                self.part(dynamics, &from, input, duration_s / parts as f64, next);
                from.copy_from_slice(next);
            }
            self.from = from;
        }
    }

    /// Equal parts in which the step from `x` is made.
    fn parts(&mut self, dynamics: &Dynamics<'_>, x: &[f64], input: Input<'_>, duration_s: f64) -> usize {
        if self.integrator.leaves_whole(dynamics, duration_s) {
            return 1;
        }
        self.k.resize(x.len(), 0.0);
        dynamics.derivative(x, input, &mut self.k);
        dynamics.parts_of_step(x, &self.k, duration_s)
    }

    fn part(&mut self, dynamics: &Dynamics<'_>, x: &[f64], input: Input<'_>, duration_s: f64, next: &mut [f64]) {
        self.x.resize(x.len(), 0.0);
        self.k.clear();
        self.k.resize(x.len(), 0.0);
        next.copy_from_slice(x);
        let stages = self.integrator.stages();
        dynamics.relaxing(x, duration_s, stages.len(), &mut self.relaxing);
        for (stage, &(along, weight)) in stages.iter().enumerate() {
            for ((there, x), k) in self.x.iter_mut().zip(x).zip(&self.k) {
                *there = x + along * duration_s * k;
            }
            dynamics.derivative(&self.x, input, &mut self.k);
            for (next, k) in next.iter_mut().zip(&self.k) {
                *next += weight * duration_s * k;
            }
            for relaxation in &mut self.relaxing {
                relaxation.take(stage, self.x[relaxation.state], self.k[relaxation.state]);
            }
        }
        for relaxation in &self.relaxing {
            next[relaxation.state] = relaxation.next;
        }
    }

    /// [`step`](Self::step) with derivatives by the state and the coordinates of the dynamics.
    pub fn step_slopes<'i>(
        &mut self,
        dynamics: &Dynamics<'_>,
        x: &[f64],
        input: impl Into<Input<'i>>,
        duration_s: f64,
        out: &mut StepSlopes,
    ) {
        let input = input.into();
        let parts = self.parts(dynamics, x, input, duration_s);
        self.part_slopes(dynamics, x, input, duration_s / parts as f64, out);
        if parts > 1 {
            let (mut of_part, mut from) = (std::mem::take(&mut self.of_part), std::mem::take(&mut self.from));
            for _ in 1..parts {
                from.clone_from(&out.next);
                self.part_slopes(dynamics, &from, input, duration_s / parts as f64, &mut of_part);
                out.continue_by(&of_part, &mut self.product, (dynamics.size(), dynamics.columns()));
            }
            (self.of_part, self.from) = (of_part, from);
        }
    }

    fn part_slopes(
        &mut self,
        dynamics: &Dynamics<'_>,
        x: &[f64],
        input: Input<'_>,
        duration_s: f64,
        out: &mut StepSlopes,
    ) {
        compiled_for_this_machine(
            #[inline(always)]
            || self.part_slopes_inlined(dynamics, x, input, duration_s, out),
        );
    }

    #[inline(always)]
    fn part_slopes_inlined(
        &mut self,
        dynamics: &Dynamics<'_>,
        x: &[f64],
        input: Input<'_>,
        duration_s: f64,
        out: &mut StepSlopes,
    ) {
        let (size, columns) = (dynamics.size(), dynamics.columns());
        self.x.resize(size, 0.0);
        self.k.clear();
        self.k.resize(size, 0.0);
        self.dk.clear();
        self.dk.resize(size * columns, 0.0);
        out.next.clear();
        out.next.extend_from_slice(x);
        out.slopes.clear();
        out.slopes.resize(size * columns, 0.0);
        for i in 0..size {
            out.slopes[i * columns + i] = 1.0;
        }
        let stages = self.integrator.stages();
        dynamics.relaxing(x, duration_s, stages.len(), &mut self.relaxing);
        self.relaxed.resize(self.relaxing.len() * columns, 0.0);
        for (relaxation, row) in self.relaxing.iter().zip(self.relaxed.chunks_mut(columns)) {
            relaxation.begin_slopes(x[relaxation.state], row);
        }
        for (stage, &(along, weight)) in stages.iter().enumerate() {
            let h = along * duration_s;
            for ((there, x), k) in self.x.iter_mut().zip(x).zip(&self.k) {
                *there = x + h * k;
            }
            dynamics.linearise(&self.x, input, &mut self.linear);
            self.k.copy_from_slice(&self.linear.xdot);
            if stage == 0 {
                self.dk.copy_from_slice(&self.linear.slopes);
                if !self.relaxing.is_empty() {
                    self.dx.clear();
                    self.dx.extend_from_slice(&out.slopes);
                }
            } else {
                // dx = [1 | 0] + h dk, then dk = f_x dx + [0 | f_z].
                self.dx.clear();
                self.dx.extend(self.dk.iter().map(|dk| h * dk));
                for i in 0..size {
                    self.dx[i * columns + i] += 1.0;
                }
                for i in 0..size {
                    let row = &self.linear.slopes[i * columns..(i + 1) * columns];
                    let dk = &mut self.dk[i * columns..(i + 1) * columns];
                    if let Some(speed) = dynamics.speed_of[i] {
                        dk.copy_from_slice(&self.dx[speed * columns..(speed + 1) * columns]);
                        continue;
                    }
                    dk[..size].fill(0.0);
                    dk[size..].copy_from_slice(&row[size..]);
                    for (j, &slope) in row[..size].iter().enumerate() {
                        // Most of a motor's row is zero.
                        if slope != 0.0 {
                            for (dk, dx) in dk.iter_mut().zip(&self.dx[j * columns..(j + 1) * columns]) {
                                *dk += slope * dx;
                            }
                        }
                    }
                }
            }
            let scale = weight * duration_s;
            for (next, k) in out.next.iter_mut().zip(&self.k) {
                *next += scale * k;
            }
            for (slope, dk) in out.slopes.iter_mut().zip(&self.dk) {
                *slope += scale * dk;
            }
            for (relaxation, row) in self.relaxing.iter_mut().zip(self.relaxed.chunks_mut(columns)) {
                let i = relaxation.state;
                let own = i * columns..(i + 1) * columns;
                let (y, rate) = (self.x[i], self.k[i]);
                relaxation.take(stage, y, rate);
                relaxation.take_slopes(stage, (y, &self.dx[own.clone()]), (rate, &self.dk[own]), row);
            }
        }
        for (relaxation, row) in self.relaxing.iter().zip(self.relaxed.chunks(columns)) {
            out.next[relaxation.state] = relaxation.next;
            out.slopes[relaxation.state * columns..][..columns].copy_from_slice(row);
        }
    }
}

impl StepSlopes {
    /// This step and then `other`: ∂φ₂(φ₁)/∂x = F₂ F₁, and ∂/∂z = F₂ G₁ + G₂.
    fn continue_by(&mut self, other: &StepSlopes, product: &mut Vec<f64>, (size, columns): (usize, usize)) {
        product.clear();
        product.resize(size * columns, 0.0);
        for (row, by) in product.chunks_exact_mut(columns).zip(other.slopes.chunks_exact(columns)) {
            row[size..].copy_from_slice(&by[size..]);
            for (slope, before) in by[..size].iter().zip(self.slopes.chunks_exact(columns)) {
                if *slope != 0.0 {
                    for (to, before) in row.iter_mut().zip(before) {
                        *to += slope * before;
                    }
                }
            }
        }
        std::mem::swap(&mut self.slopes, product);
        self.next.copy_from_slice(&other.next);
    }
}
