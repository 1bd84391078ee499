//! One step of four samples, with its derivatives by state and coordinates.

use super::drive::Accelerations;
use super::lags::Lags;
use super::laws::Drives;
use super::own::{OwnColumn, add_own};
use super::{Dynamics, Fast, JOINTS, MOST_OWN, Samples};
use crate::model::Integrator;
use solve::simd::{Quad, Simd, Wide};

/// φ(x, u) and `[∂φ/∂x | ∂φ/∂z]` of four samples, and the space that it takes to make them: one a thread.
#[derive(Debug, Clone, Default)]
pub struct StepQuads {
    /// The states after the step, one quad a component.
    pub next: Vec<Quad>,
    /// Their derivatives, size × (size + coordinates) by rows; those by coordinates are what they were where they are not asked for.
    pub slopes: Vec<Quad>,
    drives: Drives,
    lags: Lags,
    x: Vec<Quad>,
    k: Vec<Quad>,
    /// f's derivatives at every inner stage, each as large as `slopes`; only the rows of the accelerations are made.
    f: Vec<Quad>,
    /// A one among zeros: a window of it is a column of the unit matrix.
    unit: Vec<Quad>,
}

/// What derivatives are asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SlopesBy {
    /// By the state alone.
    State,
    /// By the state and the coordinates.
    All,
}

#[inline(always)]
fn load<S: Simd>(simd: S, quad: &Quad) -> Wide<S> {
    Wide::load(simd, &quad.0)
}

impl StepQuads {
    /// The states `duration_s` after `samples` (which are at `x`) with the inputs `u` held, from these times on; with derivatives where `WITH_SLOPES`.
    #[inline(always)]
    pub fn step<S: Simd, const L: usize, const WITH_SLOPES: bool>(
        &mut self,
        (integrator, by): (Integrator, SlopesBy),
        (fast, dynamics): (&Fast, &Dynamics<'_>),
        (samples, x): (&Samples<S, L>, &[Quad]),
        (u, time_s): (&[Quad], &Quad),
        duration_s: &Quad,
    ) {
        let simd = samples.simd;
        let model = (fast, dynamics);
        let (size, columns) = (dynamics.size(), dynamics.columns());
        let wanted = if by == SlopesBy::State { size } else { columns };
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
        self.lags.begin(dynamics, x, duration_s, inner.len());
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
                self.drives.act(model, x, (u, time_s), WITH_SLOPES);
                Accelerations::by(model, samples, &self.drives.torque, &self.drives.thetadd)
            } else {
                Accelerations::of(model, samples, u)
            };
            for i in 0..L {
                self.k[i] = Quad(samples.qd[i].to_array());
                self.k[L + i] = Quad(a.qdd[i].to_array());
            }
            for i in 0..JOINTS {
                self.k[2 * L + i] = Quad(samples.thetad[i].to_array());
                self.k[2 * L + JOINTS + i] = Quad(a.thetadd[i].to_array());
            }
            for (state, rate) in fast.own.iter().zip(&self.drives.rates) {
                self.k[*state] = *rate;
            }
            for (next, k) in self.next.iter_mut().zip(&self.k) {
                next.0 = scale.mul_add(Wide::load(simd, &k.0), Wide::load(simd, &next.0)).to_array();
            }
            if WITH_SLOPES {
                let f = &mut self.f[stage * all..(stage + 1) * all];
                match fast.has_laws {
                    true => a.slopes_by(model, samples, &self.drives.rows, (columns, wanted), f),
                    false => a.slopes(model, samples, u, columns, f),
                }
                self.lags.take(model, samples, stage, Some((f, columns)));
            } else {
                self.lags.take(model, samples, stage, None);
            }
        }
        self.lags.put(&mut self.next);
        if !WITH_SLOPES {
            return;
        }
        if inner.len() == 1 {
            return self.single_slopes::<S, L>(simd, model, h * inner[0].1, wanted);
        }
        self.unit.resize(3 * size, Quad::default());
        self.unit[size] = Quad([1.0; 4]);
        for c in 0..size {
            self.column::<S, L, true>(simd, (size, columns, c), inner, h, fast);
        }
        for c in size..wanted {
            self.column::<S, L, false>(simd, (size, columns, c), inner, h, fast);
        }
    }

    /// 1 + h ∂f of a method with one stage.
    #[inline(always)]
    fn single_slopes<S: Simd, const L: usize>(
        &mut self,
        simd: S,
        (fast, dynamics): (&Fast, &Dynamics<'_>),
        scale: Wide<S>,
        wanted: usize,
    ) {
        let (size, columns) = (dynamics.size(), dynamics.columns());
        self.slopes.fill(Quad::default());
        for i in 0..size {
            self.slopes[i * columns + i] = Quad([1.0; 4]);
        }
        for i in 0..L + JOINTS {
            let (row, speed) = if i < L { (i, L + i) } else { (L + i, L + JOINTS + i) };
            // The derivative of a position is its speed.
            let to = &mut self.slopes[row * columns + speed].0;
            *to = (Wide::load(simd, to) + scale).to_array();
        }
        let speeds = (L..2 * L).chain(2 * L + JOINTS..2 * (L + JOINTS));
        for row in speeds.chain(fast.own.iter().copied()) {
            let from = &self.f[row * columns..(row + 1) * columns];
            for (to, from) in self.slopes[row * columns..(row + 1) * columns].iter_mut().zip(from) {
                to.0 = scale.mul_add(Wide::load(simd, &from.0), Wide::load(simd, &to.0)).to_array();
            }
        }
        self.unit.resize(3 * size, Quad::default());
        self.unit[size] = Quad([1.0; 4]);
        for c in 0..wanted {
            let unit = if c < size { &self.unit[size - c..2 * size - c] } else { &self.unit[2 * size..] };
            self.lags.begin_column::<S, L>(simd, (&self.f, columns, c), unit, &mut self.slopes[c..]);
        }
    }

    /// Column c of a method with inner stages, one `BY_STATE` or by a coordinate: dx = e_c + h dk, then dk = f_x dx + f_c, of which the step
    /// takes its share. What belongs to a column stays in registers through all stages; a stage's matrices would not even stay in the
    /// nearest cache.
    #[inline(always)]
    fn column<S: Simd, const L: usize, const BY_STATE: bool>(
        &mut self,
        simd: S,
        (size, columns, c): (usize, usize, usize),
        inner: &[(f64, f64)],
        h: Wide<S>,
        fast: &Fast,
    ) {
        let first = fast.first::<L>();
        let (theta, thetad) = (2 * L, 2 * L + JOINTS);
        let unit = if BY_STATE { &self.unit[size - c..2 * size - c] } else { &self.unit[2 * size..] };
        // Derivatives of the accelerations and of the speeds before them, at the last stage and of the step.
        let scale = h * inner[0].1;
        let (mut links, mut motors) = (
            Half::<S, L>::begin(simd, &self.f[L * columns + c..], columns, (unit, &unit[L..]), scale),
            Half::<S, JOINTS>::begin(
                simd,
                &self.f[thetad * columns + c..],
                columns,
                (&unit[theta..], &unit[thetad..]),
                scale,
            ),
        );
        let at = (&self.f[..], columns, c);
        let mut own = OwnColumn::begin(simd, fast, at, unit, scale);
        self.lags.begin_column::<S, L>(simd, at, unit, &mut self.slopes[c..]);
        for (stage, (f, &(along, weight))) in self.f.chunks_exact(size * columns).zip(inner).enumerate().skip(1) {
            let (step, scale) = (h * along, h * weight);
            let (q, qd) = links.moved(simd, (unit, &unit[L..]), step);
            let (theta_moved, thetad_moved) = motors.moved(simd, (&unit[theta..], &unit[thetad..]), step);
            let own_moved = own.moved(simd, fast, unit, step);
            let chain = ChainColumn { q, qd, theta: theta_moved, thetad: thetad_moved };
            for i in 0..L {
                let row = &f[(L + i) * columns..][..columns];
                links.fast[i] = by_all::<S, L, BY_STATE>(simd, fast, (row, c), (&chain, &own_moved));
            }
            for i in 0..JOINTS {
                let row = &f[(thetad + i) * columns..][..columns];
                let mut sum = Wide::splat(simd, 0.0);
                if !BY_STATE {
                    sum = load(simd, &row[c]);
                }
                // A motor sees its own joint only, …
                let link = first + i;
                sum = load(simd, &row[link]).mul_add(q[link], sum);
                sum = load(simd, &row[L + link]).mul_add(qd[link], sum);
                sum = load(simd, &row[theta + i]).mul_add(theta_moved[i], sum);
                sum = load(simd, &row[thetad + i]).mul_add(thetad_moved[i], sum);
                if fast.is_coupled {
                    // … and through the supply the speeds of all motors.
                    for j in (0..JOINTS).filter(|&j| j != i) {
                        sum = load(simd, &row[thetad + j]).mul_add(thetad_moved[j], sum);
                    }
                }
                motors.fast[i] = add_own(simd, fast, row, &own_moved, sum);
            }
            for (i, state) in fast.own.iter().enumerate() {
                let row = &f[state * columns..][..columns];
                let rate = by_all::<S, L, BY_STATE>(simd, fast, (row, c), (&chain, &own_moved));
                own.take(i, rate, scale);
            }
            self.lags.take_column(simd, (f, columns), (&q, &qd), stage, &mut self.slopes[c..]);
            links.take(qd, scale);
            motors.take(thetad_moved, scale);
        }
        links.put(&mut self.slopes[c..], columns);
        motors.put(&mut self.slopes[theta * columns + c..], columns);
        own.put(fast, &mut self.slopes[c..], columns);
    }
}

/// A column of the state at a stage, that of laws left out.
struct ChainColumn<S: Simd, const L: usize> {
    q: [Wide<S>; L],
    qd: [Wide<S>; L],
    theta: [Wide<S>; JOINTS],
    thetad: [Wide<S>; JOINTS],
}

/// Column c of a row of f that goes by the whole state.
#[inline(always)]
fn by_all<S: Simd, const L: usize, const BY_STATE: bool>(
    simd: S,
    fast: &Fast,
    (row, c): (&[Quad], usize),
    (chain, own): (&ChainColumn<S, L>, &[Wide<S>; MOST_OWN]),
) -> Wide<S> {
    let mut sum = Wide::splat(simd, 0.0);
    if !BY_STATE {
        sum = load(simd, &row[c]);
    }
    sum = add_products(simd, row, &chain.q, sum);
    sum = add_products(simd, &row[L..], &chain.qd, sum);
    sum = add_products(simd, &row[2 * L..], &chain.theta, sum);
    sum = add_products(simd, &row[2 * L + JOINTS..], &chain.thetad, sum);
    add_own(simd, fast, row, own, sum)
}

/// A column of the links or of the motors.
struct Half<S: Simd, const N: usize> {
    /// Derivatives of the accelerations at the last stage, and of the speeds there.
    fast: [Wide<S>; N],
    slow: [Wide<S>; N],
    /// Derivatives of the speeds and positions after the step, as far as its stages are taken.
    speeds: [Wide<S>; N],
    positions: [Wide<S>; N],
}

impl<S: Simd, const N: usize> Half<S, N> {
    /// At the first stage: `f` begins with the column's accelerations, `unit` are the derivatives of positions and speeds there.
    #[inline(always)]
    fn begin(simd: S, f: &[Quad], columns: usize, unit: (&[Quad], &[Quad]), scale: Wide<S>) -> Self {
        let zeros = [Wide::splat(simd, 0.0); N];
        let mut half = Half { fast: zeros, slow: zeros, speeds: zeros, positions: zeros };
        for i in 0..N {
            half.fast[i] = load(simd, &f[i * columns]);
            half.slow[i] = load(simd, &unit.1[i]);
            half.speeds[i] = scale.mul_add(half.fast[i], half.slow[i]);
            half.positions[i] = scale.mul_add(half.slow[i], load(simd, &unit.0[i]));
        }
        half
    }

    /// Derivatives of positions and speeds `step` after the beginning.
    #[inline(always)]
    fn moved(&self, simd: S, unit: (&[Quad], &[Quad]), step: Wide<S>) -> ([Wide<S>; N], [Wide<S>; N]) {
        let (mut positions, mut speeds) = (self.slow, self.fast);
        for i in 0..N {
            positions[i] = step.mul_add(self.slow[i], load(simd, &unit.0[i]));
            speeds[i] = step.mul_add(self.fast[i], load(simd, &unit.1[i]));
        }
        (positions, speeds)
    }

    /// Takes a stage with these derivatives of the speeds.
    #[inline(always)]
    fn take(&mut self, speeds: [Wide<S>; N], scale: Wide<S>) {
        self.slow = speeds;
        for i in 0..N {
            self.speeds[i] = scale.mul_add(self.fast[i], self.speeds[i]);
            self.positions[i] = scale.mul_add(self.slow[i], self.positions[i]);
        }
    }

    /// The column into the rows of positions, then of speeds.
    #[inline(always)]
    fn put(&self, to: &mut [Quad], columns: usize) {
        for i in 0..N {
            to[i * columns] = Quad(self.positions[i].to_array());
            to[(N + i) * columns] = Quad(self.speeds[i].to_array());
        }
    }
}

/// sum + Σ row[j] x[j].
#[inline(always)]
fn add_products<S: Simd, const N: usize>(simd: S, row: &[Quad], x: &[Wide<S>; N], mut sum: Wide<S>) -> Wide<S> {
    for j in 0..N {
        sum = load(simd, &row[j]).mul_add(x[j], sum);
    }
    sum
}
