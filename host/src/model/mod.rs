//! The elastic-joint model as a pipeline of named quantities, generic over the scalar, with its integrators.
