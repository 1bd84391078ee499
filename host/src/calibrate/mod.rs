//! The calibration: residuals of a recording under a model, solved jointly for all states and the shared parameters.
