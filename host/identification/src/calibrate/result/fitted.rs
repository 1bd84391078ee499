//! The end of a calibration, with what a further search starts from.

use super::calibration::Calibration;
use crate::calibrate::data::series::Series;
use crate::calibrate::residuals::noise::Noise;
use crate::model::Layout;

/// A calibration, and what a further search can start from.
#[derive(Debug, Clone)]
pub struct Fit {
    /// The result.
    pub calibration: Calibration,
    /// What the rows were weighted by in the end.
    pub noise: Noise,
    /// The samples, without outliers.
    pub series: Series,
    /// All states, `[k · size + i]`.
    pub(crate) states: Vec<f64>,
    /// What the components of a state are.
    pub(crate) layout: Layout,
}
