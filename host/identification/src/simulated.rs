//! Recordings of simulated robots for the tests of this crate.
//!
//! The simulator stands above this crate and is built with the library as users have it, whose types are not those under test. So a recording comes over
//! as the bytes of its file.

use std::path::Path;

pub(crate) use host::simulate::{Options, SHORT_MOTION};

use crate::recording::Recording;

/// A recording, and the true state at every tick, by columns.
pub(crate) struct Simulated {
    pub(crate) recording: Recording,
    pub(crate) states: Vec<(String, Vec<f64>)>,
}

/// Lets the robot of these options play a motion.
pub(crate) fn record(options: &Options, motion: &str) -> Simulated {
    let direct = host::simulate::Direct::record(options, motion).unwrap();
    let bytes = host::recording::mcap::write(Vec::new(), &direct.recording).unwrap();
    Simulated {
        recording: crate::recording::mcap::parse(&bytes, Path::new("simulated")).unwrap(),
        states: direct.states,
    }
}
