//! What a recording shows of events and contacts before any law describes them: where laws that are nothing most of the time start from.

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
