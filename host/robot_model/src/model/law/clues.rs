//! What a recording shows before any law describes it: where laws of events and contacts start from, and laws of sensors that end.

/// Along the samples of a recording: the motion, and the torques that a model leaves open which is right whenever nothing happens.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Clues {
    /// Of each sample since the first one of the whole recording, s.
    pub time_s: Vec<f64>,
    /// One a joint.
    pub joints: Vec<JointClues>,
}

/// The clues of one joint, a value a sample.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct JointClues {
    /// Position of the link, rad or m.
    pub q: Vec<f64>,
    /// Its speed, per s.
    pub qd: Vec<f64>,
    /// Torque that the link gets and no equation has, N m or N.
    pub missing: Vec<f64>,
    /// Stiffness of the transmission, N m/rad; none of a joint that has no such parameter.
    pub k_s: Option<f64>,
}

/// What the readings alone show, before any fit.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Readings {
    /// Sizes that hardly any reading of a gyro goes beyond, on its axis that goes farthest, rad/s: one list a gyro, of the same length, likeliest first.
    pub gyro_ends_rad_s: Vec<Vec<f64>>,
}
