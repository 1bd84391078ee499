//! What the filter asks of a model.

/// What acts on a model, held over a step.
#[derive(Debug, Clone, Copy)]
pub struct Input<'u, T> {
    /// Inputs, as late as they act.
    pub u: &'u [T],
    /// Time since the motion began, s: few models look at it.
    pub time_s: T,
}

/// ẋ = f(x, u, t) and y = h(x, u, t) with their derivatives by x.
///
/// Slices have the lengths that the first four methods say; matrices are stored by rows. Every element of an output is written.
pub trait Model<T> {
    /// Components of x that move.
    fn moving(&self) -> usize;

    /// All components of x: those that move, then constants.
    fn states(&self) -> usize;

    /// Inputs.
    fn inputs(&self) -> usize;

    /// Readings.
    fn readings(&self) -> usize;

    /// ẋ of the moving components.
    fn rates(&mut self, x: &[T], input: Input<'_, T>, xdot: &mut [T]);

    /// ẋ and ∂ẋ/∂x of the moving components: moving × moving. Constants act on readings only.
    fn rates_slopes(&mut self, x: &[T], input: Input<'_, T>, xdot: &mut [T], by_x: &mut [T]);

    /// y and ∂y/∂x: readings × states.
    fn readings_slopes(&mut self, x: &[T], input: Input<'_, T>, y: &mut [T], by_x: &mut [T]);
}
