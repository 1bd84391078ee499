//! What a calibration says: estimates, errors, fit, and whether the model fits.

pub(crate) mod calibration;
pub(crate) mod channels;
pub(crate) mod fitted;
pub(crate) mod misfit;
pub(crate) mod pushes_told;
pub(crate) mod summary;
pub(crate) mod untold_ages;
