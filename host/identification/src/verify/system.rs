//! What the filter and the runs need to know of a model, and of a recording: numbers only.

use std::ops::Range;

use solve::simd::{LANES, Quad};

/// A system x_{k+1} = f(x_k, u_k, Δt), z_k = h(x_k) with Jacobians.
///
/// All slices have the lengths that [`states`](Self::states) and [`outputs`](Self::outputs) say; matrices are row-major.
/// Methods take `&mut self` for scratch space and the time only: the same arguments at the same time give the same result. Each thread has a
/// clone.
pub trait System: Clone + Send {
    /// Number of states.
    fn states(&self) -> usize;

    /// What follows belongs to the sample at this time, s: that of [`Columns::t_s`](super::Columns). Few systems change with time.
    fn at_time(&mut self, _time_s: f64) {}

    /// Number of outputs, in the order of the recording's channels.
    fn outputs(&self) -> usize;

    /// The state after `dt_s` seconds under the constant input `u`.
    fn step(&mut self, x: &[f64], u: &[f64], dt_s: f64, next: &mut [f64]);

    /// [`Self::step`] with ∂next/∂x (states × states).
    fn step_jacobian(&mut self, x: &[f64], u: &[f64], dt_s: f64, next: &mut [f64], jacobian: &mut [f64]);

    /// [`Self::step`] of four states at once, by [`Four::step_each`] where a system has no faster way.
    fn step_four(&mut self, four: &Four, next: &mut [Quad]) {
        four.step_each(self, next);
    }

    /// [`Self::step_jacobian`] of four states, likewise.
    fn step_jacobian_four(&mut self, four: &Four, next: &mut [Quad], jacobian: &mut [Quad]) {
        four.step_jacobian_each(self, next, jacobian);
    }

    /// The outputs without noise. `u` is in force after the sample: sensors may be read a little later than the state.
    fn outputs_of(&mut self, x: &[f64], u: &[f64], outputs: &mut [f64]);

    /// [`Self::outputs_of`] with ∂outputs/∂x (outputs × states).
    fn outputs_jacobian(&mut self, x: &[f64], u: &[f64], outputs: &mut [f64], jacobian: &mut [f64]);

    /// Whether state i is a velocity: where the world pushes, and where process noise therefore enters.
    fn is_velocity(&self, state: usize) -> bool;

    /// What is known of the state from the readings of one tick alone (NaN: no reading): mean, and standard deviation
    /// of each state.
    fn first_guess(&mut self, readings: &[f64]) -> (Vec<f64>, Vec<f64>);
}

/// Four states on their way, a lane each.
#[derive(Debug, Clone)]
pub struct Four {
    /// The states, one quad a component.
    pub x: Vec<Quad>,
    /// Their inputs.
    pub u: Vec<Quad>,
    /// The time of each, s: see [`System::at_time`].
    pub time_s: Quad,
    /// How long the step takes, s.
    pub dt_s: Quad,
}

impl Four {
    /// All zero.
    pub fn new(states: usize, inputs: usize) -> Self {
        let zero = Quad::default();
        Four { x: vec![zero; states], u: vec![zero; inputs], time_s: zero, dt_s: zero }
    }

    /// [`System::step`] of one state after the other.
    pub fn step_each<S: System>(&self, system: &mut S, next: &mut [Quad]) {
        let mut own = vec![0.0; next.len()];
        for lane in 0..LANES {
            system.at_time(self.time_s.0[lane]);
            system.step(&lane_of(&self.x, lane), &lane_of(&self.u, lane), self.dt_s.0[lane], &mut own);
            set_lane(next, lane, &own);
        }
    }

    /// [`System::step_jacobian`] of one state after the other.
    pub fn step_jacobian_each<S: System>(&self, system: &mut S, next: &mut [Quad], jacobian: &mut [Quad]) {
        let (mut own, mut slopes) = (vec![0.0; next.len()], vec![0.0; jacobian.len()]);
        for lane in 0..LANES {
            system.at_time(self.time_s.0[lane]);
            let (x, u) = (lane_of(&self.x, lane), lane_of(&self.u, lane));
            system.step_jacobian(&x, &u, self.dt_s.0[lane], &mut own, &mut slopes);
            set_lane(next, lane, &own);
            set_lane(jacobian, lane, &slopes);
        }
    }
}

/// One lane of quads.
pub fn lane_of(quads: &[Quad], lane: usize) -> Vec<f64> {
    quads.iter().map(|quad| quad.0[lane]).collect()
}

/// Sets one lane of quads.
pub fn set_lane(quads: &mut [Quad], lane: usize, values: &[f64]) {
    for (quad, value) in quads.iter_mut().zip(values) {
        quad.0[lane] = *value;
    }
}

/// A recording as columns of numbers.
#[derive(Debug, Clone)]
pub struct Columns<'a> {
    /// Time of each sample, s, ascending.
    pub t_s: &'a [f64],
    /// `[joint][k]`, in force from t_k to t_{k+1}.
    pub duty: Vec<&'a [f64]>,
    /// `[channel][k]`, NaN = no valid reading.
    pub measured: Vec<&'a [f64]>,
    /// Standard deviation of each channel's noise.
    pub sigma: Vec<f64>,
    /// Runs without a gap, in order.
    pub segments: Vec<Range<usize>>,
    /// Nominal time between samples, s.
    pub period_s: f64,
}

impl Columns<'_> {
    /// Number of samples.
    pub fn len(&self) -> usize {
        self.t_s.len()
    }

    /// Whether there is no sample.
    pub fn is_empty(&self) -> bool {
        self.t_s.is_empty()
    }

    /// The input in force after sample k.
    pub fn input(&self, k: usize, u: &mut [f64]) {
        for (u, duty) in u.iter_mut().zip(&self.duty) {
            *u = duty[k];
        }
    }

    /// The readings of sample k.
    pub fn readings(&self, k: usize, z: &mut [f64]) {
        for (z, channel) in z.iter_mut().zip(&self.measured) {
            *z = channel[k];
        }
    }

    /// The segment that each sample belongs to ends here (exclusive), `[k]`.
    pub fn segment_ends(&self) -> Vec<usize> {
        let mut ends = vec![0; self.len()];
        for segment in &self.segments {
            ends[segment.clone()].fill(segment.end);
        }
        ends
    }
}
