//! What drives a step: the inputs that are held, and the time, for laws that know it.

/// The inputs over one step.
#[derive(Debug, Clone, Copy)]
pub struct Input<'a> {
    /// One a joint, in the unit of the robot's input.
    pub u: &'a [f64],
    /// ∂u by the parameter of the law that delays inputs; empty where there is none.
    pub by_delay: &'a [f64],
    /// Time since the start of the motion, s.
    pub time_s: f64,
}

impl<'a> From<&'a [f64]> for Input<'a> {
    fn from(u: &'a [f64]) -> Self {
        Input { u, by_delay: &[], time_s: 0.0 }
    }
}

impl<'a> From<&'a Vec<f64>> for Input<'a> {
    fn from(u: &'a Vec<f64>) -> Self {
        u.as_slice().into()
    }
}
