//! Least squares on a chain of stages with a border of shared unknowns. Knows numbers only.
