//! How well a calibrated model predicts a recording: the free run of the paper's section 5.2 and windowed predictions.
