//! A recording in memory (columns with units) and its files.
