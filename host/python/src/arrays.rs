//! Arrays on their way between the interpreter and the library: 64-bit floats in the machine's byte order.

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

/// As Python's `numpy.frombuffer` reads them.
pub fn to_bytes<'py>(py: Python<'py>, values: &[f64]) -> PyResult<Bound<'py, PyBytes>> {
    PyBytes::new_with(py, size_of_val(values), |bytes| {
        for (place, value) in bytes.chunks_exact_mut(8).zip(values) {
            place.copy_from_slice(&value.to_ne_bytes());
        }
        Ok(())
    })
}

/// From Python's `numpy.ndarray.tobytes`.
pub fn from_bytes(bytes: &[u8]) -> PyResult<Vec<f64>> {
    let (values, rest) = bytes.as_chunks::<8>();
    match rest {
        [] => Ok(values.iter().map(|value| f64::from_ne_bytes(*value)).collect()),
        _ => Err(PyValueError::new_err(format!("{} bytes are no 64-bit floats", bytes.len()))),
    }
}
