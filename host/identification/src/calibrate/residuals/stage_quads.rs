//! What the fast kernel reads of four stages, one lane each.

use super::point::Point;
use crate::calibrate::data::series::Series;
use crate::model::fast::{JOINTS, StepQuads};
use solve::simd::{LANES, Quad, Simd, columns};

/// What a batch reads, one quad a value, and room for its step: one a thread.
#[derive(Debug, Clone, Default)]
pub(crate) struct StageQuads {
    pub(crate) x: Vec<Quad>,
    pub(crate) after: Vec<Quad>,
    pub(crate) u: Vec<Quad>,
    pub(crate) measured: Vec<Quad>,
    /// Which recording each stage is of.
    pub(crate) recording: [usize; LANES],
    pub(crate) time_s: Quad,
    pub(crate) duration_s: Quad,
    pub(crate) step: StepQuads,
}

impl StageQuads {
    /// Gathers `count` stages from `first` on; the lanes that are left repeat the last one.
    #[inline(always)]
    pub(crate) fn gather<S: Simd>(
        &mut self,
        simd: S,
        (series, point): (&Series, &Point<'_>),
        first: usize,
        count: usize,
    ) {
        let size = point.state(first).len();
        let last = series.stages() - 1;
        self.x.resize(size, Quad::default());
        self.after.resize(size, Quad::default());
        self.u.resize(JOINTS, Quad::default());
        self.measured.resize(series.channels.len(), Quad::default());
        let mut stages = [first; LANES];
        for (lane, k) in stages.iter_mut().enumerate() {
            *k = first + lane.min(count - 1);
            self.recording[lane] = series.recording_of(*k);
            self.time_s.0[lane] = series.time_s(*k);
            let duration_s = series.duration_s(*k);
            self.duration_s.0[lane] = if duration_s.is_nan() { 0.0 } else { duration_s };
        }
        let [a, b, c, d] = stages;
        columns(simd, [point.state(a), point.state(b), point.state(c), point.state(d)], &mut self.x);
        columns(simd, [series.input(a), series.input(b), series.input(c), series.input(d)], &mut self.u);
        let measured = [series.measured(a), series.measured(b), series.measured(c), series.measured(d)];
        columns(simd, measured, &mut self.measured);
        let [a, b, c, d] = [(a + 1).min(last), (b + 1).min(last), (c + 1).min(last), (d + 1).min(last)];
        columns(simd, [point.state(a), point.state(b), point.state(c), point.state(d)], &mut self.after);
    }
}
