//! What a calibration assumes: method of integration, sensor rows and noise.

use serde::{Deserialize, Serialize};

use crate::model::Integrator;
use crate::robot::{Robot, Unmodelled};

/// A named set of assumptions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Preset {
    /// Runge–Kutta steps, every gyro predicted from the state on a rigid base, tight process noise.
    Default,
    /// The paper's problem, to reproduce it with its biases: Euler steps, rows (22) and (26), noise of (35)–(37).
    Paper,
}

/// Where the standard deviations that weight the rows come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum NoiseSource {
    /// The robot file's for the sensors, the preset's for the steps of the model.
    Fixed,
    /// The recording itself, by restricted maximum likelihood.
    Estimated,
}

/// How a calibration is made: the preset, and where the noise comes from. The default preset alone estimates it, the paper's keeps (35)–(37).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Method {
    /// Assumptions.
    pub preset: Preset,
    /// Where the noise comes from.
    pub noise: NoiseSource,
}

impl Method {
    /// The preset's own for this robot. Where its file says what the model does not explain, the noise is known: an estimate would pass errors of the
    /// model for noise.
    pub fn suited(preset: Preset, robot: &Robot) -> Self {
        match robot.joints.iter().any(|joint| joint.unmodelled != Unmodelled::default()) {
            true => Method { preset, noise: NoiseSource::Fixed },
            false => preset.into(),
        }
    }
}

impl From<Preset> for Method {
    fn from(preset: Preset) -> Self {
        let noise = match preset {
            Preset::Default => NoiseSource::Estimated,
            Preset::Paper => NoiseSource::Fixed,
        };
        Method { preset, noise }
    }
}

/// The assumptions themselves.
#[derive(Debug, Clone, PartialEq)]
pub struct Assumptions {
    /// One step a sample by this method.
    pub integrator: Integrator,
    /// Which rows the gyros give.
    pub gyro_rows: GyroRows,
    /// How far a step of the model may be wrong.
    pub process: ProcessNoise,
    /// What is known of the first state of a chain.
    pub initial: InitialNoise,
    /// Whether lone readings far from what the model and their neighbours say are left out.
    pub without_outliers: bool,
}

/// Which residual rows the gyros give.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum GyroRows {
    /// All axes of all gyros, predicted from (q, q̇) on a base at rest, each with its own noise.
    RigidBase,
    /// Equations (22), (25), (26) and (32): gyro 1 gives the rate about the axis before it, and its measurement is the base of
    /// every other gyro's prediction. The bias of gyro 1 is subtracted in both, which (26) forgets in print.
    Chained,
}

/// Standard deviations of the step's residual (31) over a step of 1 ms.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProcessNoise {
    /// q and θ, rad or m.
    pub position: f64,
    /// q̇, rad/s or m/s.
    pub link_speed: f64,
    /// θ̇, rad/s or m/s.
    pub motor_speed: f64,
    /// States that laws of effects have of their own: times what the law says.
    pub own: f64,
}

/// The step that process noise is told for: the paper's sample period, s.
const STEP_S: f64 = 1e-3;

impl ProcessNoise {
    /// The noise over a step of another length: a random walk grows with the square root of time.
    pub fn over(self, step_s: f64) -> Self {
        let scale = (step_s / STEP_S).sqrt();
        ProcessNoise {
            position: scale * self.position,
            link_speed: scale * self.link_speed,
            motor_speed: scale * self.motor_speed,
            own: scale * self.own,
        }
    }
}

/// Standard deviations of what (30) knows of the first state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InitialNoise {
    /// q − θ of elastic joints, rad or m.
    pub windup: f64,
    /// q̇ and θ̇ at rest, rad/s or m/s.
    pub speed: f64,
    /// States that laws of effects have of their own, as a share of how large they may be.
    pub own: f64,
    /// The same at rest.
    pub own_at_rest: f64,
}

/// Equation (36): √ of the printed variances.
const PAPER_PROCESS: ProcessNoise = ProcessNoise { position: 1e-6, link_speed: 0.011, motor_speed: 0.0083, own: 1.0 };

/// How much tighter the default preset takes the speeds' process noise. The paper's lets the states swallow gyro noise, and μ comes out 24 to
/// 30 % low on a record without any effect. With this one every dynamic parameter of that record is found within 0.03 %, and χ² per degree of freedom
/// of every channel is within 4 % of 1.
const TIGHTER: f64 = 100.0;

/// Equation (37): √0.0076 rad (5°), and σ_encoder of the paper for the speeds.
const PAPER_INITIAL: InitialNoise = InitialNoise { windup: 0.087_178, speed: 6.9259e-5, own: 1.0, own_at_rest: 1e-3 };

impl Preset {
    /// What the preset assumes.
    pub fn assumptions(self) -> Assumptions {
        match self {
            Preset::Default => Assumptions {
                integrator: Integrator::RungeKutta4,
                gyro_rows: GyroRows::RigidBase,
                process: ProcessNoise {
                    position: PAPER_PROCESS.position,
                    link_speed: PAPER_PROCESS.link_speed / TIGHTER,
                    motor_speed: PAPER_PROCESS.motor_speed / TIGHTER,
                    own: 1.0,
                },
                initial: PAPER_INITIAL,
                without_outliers: true,
            },
            Preset::Paper => Assumptions {
                integrator: Integrator::Euler,
                gyro_rows: GyroRows::Chained,
                process: PAPER_PROCESS,
                initial: PAPER_INITIAL,
                without_outliers: false,
            },
        }
    }
}
