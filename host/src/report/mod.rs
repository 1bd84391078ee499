//! Self-contained HTML pages from results. No arithmetic that a result does not already hold.
