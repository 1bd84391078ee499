//! One step of four samples, with its derivatives by state and coordinates.

use super::drive::Accelerations;
use super::laws::Drives;
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
    drives: Drives,
    x: Vec<Quad>,
    k: Vec<Quad>,
    /// f's derivatives at every inner stage, each as large as `slopes`; only the rows of the accelerations are made.
    f: Vec<Quad>,
    /// A one among zeros: a window of it is a column of the unit matrix.
    unit: Vec<Quad>,
}

#[inline(always)]
fn load<S: Simd>(simd: S, quad: &Quad) -> Wide<S> {
    Wide::load(simd, &quad.0)
}

impl StepQuads {
    /// The states `duration_s` after `samples` (which are at `x`) with the inputs `u` held, from these times on; with derivatives where `WITH_SLOPES`.
    #[inline(always)]
    pub fn step<S: Simd, const N: usize, const WITH_SLOPES: bool>(
        &mut self,
        integrator: Integrator,
        (fast, dynamics): (&Fast, &Dynamics<'_>),
        (samples, x): (&Samples<S, N>, &[Quad]),
        (u, time_s): (&[Quad], &Quad),
        duration_s: &Quad,
    ) {
        let simd = samples.simd;
        let (size, columns) = (4 * N, dynamics.columns());
        self.next.clear();
        self.next.extend_from_slice(x);
        let inner = integrator.stages();
        let all = size * columns;
        if WITH_SLOPES {
            self.f.resize(inner.len() * all, Quad::default());
            self.slopes.resize(all, Quad::default());
        }
        self.k.resize(size, Quad::default());
        let h = Wide::load(simd, &duration_s.0);
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
            let a = if fast.has_laws {
                let x = if stage == 0 { x } else { &self.x };
                self.drives.act(dynamics, x, (u, time_s), WITH_SLOPES);
                Accelerations::by(samples, &self.drives.torque, &self.drives.thetadd)
            } else {
                Accelerations::of(dynamics, samples, u)
            };
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
                let f = &mut self.f[stage * all..(stage + 1) * all];
                match fast.has_laws {
                    true => a.slopes_by(samples, &self.drives.rows, columns, f),
                    false => a.slopes(dynamics, samples, u, columns, f),
                }
            }
        }
        if !WITH_SLOPES {
            return;
        }
        if inner.len() == 1 {
            return self.single_slopes::<S, N>(simd, columns, h * inner[0].1);
        }
        self.unit.resize(3 * size, Quad::default());
        self.unit[size] = Quad([1.0; 4]);
        for c in 0..size {
            self.column::<S, N, true>(simd, (columns, c), inner, h, fast.is_coupled);
        }
        for c in size..columns {
            self.column::<S, N, false>(simd, (columns, c), inner, h, fast.is_coupled);
        }
    }

    /// 1 + h ∂f of a method with one stage.
    #[inline(always)]
    fn single_slopes<S: Simd, const N: usize>(&mut self, simd: S, columns: usize, scale: Wide<S>) {
        self.slopes.fill(Quad::default());
        for i in 0..4 * N {
            self.slopes[i * columns + i] = Quad([1.0; 4]);
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
            }
        }
    }

    /// Column c of a method with inner stages, one `BY_STATE` or by a coordinate: dx = e_c + h dk, then dk = f_x dx + f_c, of which the step
    /// takes its share. What belongs to a column stays in registers through all stages; a stage's matrices would not even stay in the
    /// nearest cache.
    #[inline(always)]
    fn column<S: Simd, const N: usize, const BY_STATE: bool>(
        &mut self,
        simd: S,
        (columns, c): (usize, usize),
        inner: &[(f64, f64)],
        h: Wide<S>,
        is_coupled: bool,
    ) {
        let (size, zero) = (4 * N, Wide::splat(simd, 0.0));
        let unit = if BY_STATE { &self.unit[size - c..2 * size - c] } else { &self.unit[2 * size..] };
        // Derivatives of the accelerations (of links, of motors) and of the speeds before them.
        let (mut fast, mut slow) = ([[zero; N]; 2], [[zero; N]; 2]);
        let (mut speeds, mut positions) = (fast, slow);
        for i in 0..N {
            for (half, speed) in [N + i, 3 * N + i].into_iter().enumerate() {
                fast[half][i] = load(simd, &self.f[speed * columns + c]);
                slow[half][i] = load(simd, &unit[speed]);
                let scale = h * inner[0].1;
                speeds[half][i] = scale.mul_add(fast[half][i], slow[half][i]);
                positions[half][i] = scale.mul_add(slow[half][i], load(simd, &unit[speed - N]));
            }
        }
        for (f, &(along, weight)) in self.f.chunks_exact(size * columns).zip(inner).skip(1) {
            let (step, scale) = (h * along, h * weight);
            // By q, q̇, θ, θ̇.
            let mut dx = [[zero; N]; 4];
            for i in 0..N {
                for half in 0..2 {
                    dx[2 * half][i] = step.mul_add(slow[half][i], load(simd, &unit[2 * half * N + i]));
                    dx[2 * half + 1][i] = step.mul_add(fast[half][i], load(simd, &unit[(2 * half + 1) * N + i]));
                }
            }
            for i in 0..N {
                let (link, motor) = (&f[(N + i) * columns..][..columns], &f[(3 * N + i) * columns..][..columns]);
                let (mut of_link, mut of_motor) = (zero, zero);
                if !BY_STATE {
                    (of_link, of_motor) = (load(simd, &link[c]), load(simd, &motor[c]));
                }
                for part in 0..4 {
                    for j in 0..N {
                        of_link = load(simd, &link[part * N + j]).mul_add(dx[part][j], of_link);
                    }
                    // A motor sees its own joint only, …
                    of_motor = load(simd, &motor[part * N + i]).mul_add(dx[part][i], of_motor);
                }
                if is_coupled {
                    // … and through the supply the speeds of all motors.
                    for j in (0..N).filter(|&j| j != i) {
                        of_motor = load(simd, &motor[3 * N + j]).mul_add(dx[3][j], of_motor);
                    }
                }
                (fast[0][i], fast[1][i]) = (of_link, of_motor);
            }
            slow = [dx[1], dx[3]];
            for half in 0..2 {
                for i in 0..N {
                    speeds[half][i] = scale.mul_add(fast[half][i], speeds[half][i]);
                    positions[half][i] = scale.mul_add(slow[half][i], positions[half][i]);
                }
            }
        }
        for half in 0..2 {
            for i in 0..N {
                self.slopes[(2 * half * N + i) * columns + c] = Quad(positions[half][i].to_array());
                self.slopes[((2 * half + 1) * N + i) * columns + c] = Quad(speeds[half][i].to_array());
            }
        }
    }
}
