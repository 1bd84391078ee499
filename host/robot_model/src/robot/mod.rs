//! What a robot is: its description file, its kinematic chain and its inertia.
//!
//! ```text
//! URDF ── urdf ──┐
//! TOML text ─────┴── file ──▶ tables ── validate ──▶ Robot ──┬─▶ channels()    what a recording of it holds
//!                                                            ├─▶ parameters()  what a calibration estimates
//!                                                            └─▶ chain()       M(q), c(q, q̇), g(q), body rates
//! ```
//!
//! A robot is a serial chain of revolute or prismatic joints. Each joint moves one body and is driven by one motor
//! through a gear and a rigid or elastic transmission; all motor quantities are meant on the link side of the gear.
//! The base frame stands where the robot is mounted (a compliant mounting tilts about its origin).

use std::path::Path;

use serde::{Deserialize, Serialize};

pub mod chain;
mod channel;
pub mod edit;
mod error;
mod file;
mod import;
mod parameter;
mod sensor;
#[cfg(test)]
mod tests;
mod urdf;
mod validate;
mod vector;

pub use channel::{Channel, ChannelKind};
pub use error::RobotError;
pub use import::{Import, ImportColumn, ImportTime, TimeUnit};
pub use parameter::{Parameter, ParameterSpec, Symbol};
pub use sensor::{Encoder, Gyro, Sensor, Tachometer};
pub use vector::{Matrix3, Vector3};

use chain::Chain;

/// The descriptions that come with the program: name and text.
const BUILTIN: [(&str, &str); 7] = [
    ("doggy", include_str!("builtin/doggy.toml")),
    ("one_joint", include_str!("builtin/one_joint.toml")),
    ("emps", include_str!("builtin/emps.toml")),
    ("kuka_kr300", include_str!("builtin/kuka_kr300.toml")),
    ("dfki_pendulum", include_str!("builtin/dfki_pendulum.toml")),
    ("dfki_double_pendulum", include_str!("builtin/dfki_double_pendulum.toml")),
    ("xl330_pendulum", include_str!("builtin/xl330_pendulum.toml")),
];

/// What `host robot new` writes; NAME stands for the robot's name.
const TEMPLATE: &str = include_str!("builtin/template.toml");

/// A robot, as its description file says and checked.
#[derive(Debug, Clone, PartialEq)]
pub struct Robot {
    /// Name, also in handshakes and results.
    pub name: String,
    /// One line for people.
    pub description: String,
    /// Period of the control loop and of recordings, s.
    pub sample_period_s: f64,
    /// What the motors are commanded with.
    pub input: Input,
    /// Whether the base model has Coriolis and centrifugal terms.
    pub coriolis: bool,
    /// Acceleration of free fall in base axes, m/s².
    pub gravity_m_s2: Vector3,
    /// Joints from the base outwards.
    pub joints: Vec<Joint>,
    /// Sensors in the order of the file.
    pub sensors: Vec<Sensor>,
    /// How tables with other columns than [`Robot::channels`] become recordings.
    pub import: Option<Import>,
    parameters: Vec<ParameterSpec>,
    toml: String,
}

/// One joint, the body that it moves and the drive that moves it.
#[derive(Debug, Clone, PartialEq)]
pub struct Joint {
    /// Name, unique in the robot.
    pub name: String,
    /// Turns or slides.
    pub kind: JointKind,
    /// Unit vector in joint axes, which are also the axes of the body.
    pub axis: Vector3,
    /// Origin of the joint frame at position 0, in the axes of the previous body, m.
    pub origin_m: Vector3,
    /// Takes vectors from the previous body's axes to the joint's at position 0.
    pub rotation: Matrix3,
    /// Allowed positions, rad or m.
    pub limits: [f64; 2],
    /// Whether gravity loads this joint.
    pub gravity: GravityLoad,
    /// What lies between motor and link.
    pub transmission: Transmission,
    /// Friction of the drive.
    pub friction: Friction,
    /// Motor radians per radian (or metre) of the link.
    pub gear: f64,
    /// The moved body.
    pub body: Body,
    /// What the model does not explain of its accelerations.
    pub unmodelled: Unmodelled,
}

/// Accelerations that no equation explains, from sample to sample, standard deviations in rad/s² or m/s²: what other axes do to the link, the noise of a
/// torque that was measured. A step of the model is not taken for more exact.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Unmodelled {
    /// Of the link.
    #[serde(default)]
    pub link: f64,
    /// Of the motor, on the link side of the gear.
    #[serde(default)]
    pub motor: f64,
}

/// How a joint moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum JointKind {
    /// Turns about its axis; position in rad.
    Revolute,
    /// Slides along its axis; position in m.
    Prismatic,
}

/// A rigid body in the axes of its joint frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Body {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Centre of mass, m.
    pub centre_m: Vector3,
    /// Inertia tensor about the centre of mass, kg m².
    pub inertia_kg_m2: Matrix3,
}

/// Whether gravity loads a joint.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GravityLoad {
    /// The joint bears it.
    Acts,
    /// Counter-springs or weights cancel it on this joint. What carries the chain still bears it.
    Compensated,
}

/// What lies between motor and link.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Transmission {
    /// Spring and damper: τ_c = k_s (q − θ) + d_s (q̇ − θ̇).
    Elastic,
    /// q = θ.
    Rigid,
}

/// A side of the transmission.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Side {
    /// The motor's, θ.
    Motor,
    /// The link's, q.
    Link,
}

/// Friction law of a drive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Friction {
    /// None.
    None,
    /// Equation (12): τ_f = 2 μ (1 / (1 + exp(−κ v)) − 1/2).
    Coulomb {
        /// Whose speed v is.
        speed: Side,
        /// What it holds back, with viscous friction and constant torque: motor and gear, or bearings and seals of the link.
        acts: Side,
        /// κ, s/rad or s/m.
        slope_s: f64,
    },
}

/// What a motor is commanded with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum InputUnit {
    /// Fraction of the supply voltage, −1 … 1: τ_m = k_pwm U_max u − k_mi θ̇.
    Duty,
    /// Motor voltage: τ_m = k_pwm u − k_mi θ̇.
    Volt,
    /// Motor current: τ_m = k_t u.
    Ampere,
    /// Torque on the link side of the gear: τ_m = u.
    NewtonMetre,
    /// Force on the link side of the gear: τ_m = u.
    Newton,
}

impl InputUnit {
    /// What a motor's torque is per unit of input; none where the input is the torque.
    pub const fn torque_constant(self) -> Option<Symbol> {
        match self {
            InputUnit::Duty | InputUnit::Volt => Some(Symbol::KPwm),
            InputUnit::Ampere => Some(Symbol::KT),
            InputUnit::NewtonMetre | InputUnit::Newton => None,
        }
    }

    /// The unit as results print it.
    pub const fn symbol(self) -> &'static str {
        match self {
            InputUnit::Duty => "",
            InputUnit::Volt => "V",
            InputUnit::Ampere => "A",
            InputUnit::NewtonMetre => "N m",
            InputUnit::Newton => "N",
        }
    }
}

/// The input and what scales it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Input {
    /// Unit of u.
    pub unit: InputUnit,
    /// What one unit of u is in the unit of the torque constant: U_max in V for duty, 1 otherwise.
    pub scale: f64,
    /// Noise of the recorded values.
    pub noise: InputNoise,
}

/// Whether the recorded input is what drove the motor, or a measurement of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum InputNoise {
    /// What is recorded drove the motor: a command.
    None,
    /// A measurement with white noise of this standard deviation, in the input's unit.
    Known(f64),
    /// A measurement whose noise is estimated.
    Unknown,
}

impl Input {
    /// What the description means where it says nothing: a duty or a voltage is commanded, a current, a torque or a force is measured.
    pub fn usual_noise(unit: InputUnit) -> InputNoise {
        match unit {
            InputUnit::Duty | InputUnit::Volt => InputNoise::None,
            InputUnit::Ampere | InputUnit::NewtonMetre | InputUnit::Newton => InputNoise::Unknown,
        }
    }
}

impl Robot {
    /// The noise of its recorded inputs. Where the file tells accelerations that no equation explains and no deviation of the input, they stand for it. That
    /// of elastic joints is not estimated beside the process noise of their links: the file has to tell it.
    pub fn input_noise(&self) -> InputNoise {
        let told = self.joints.iter().any(|joint| joint.unmodelled != Unmodelled::default());
        let elastic = self.joints.iter().any(|joint| joint.transmission == Transmission::Elastic);
        match self.input.noise {
            InputNoise::Unknown if told || elastic => InputNoise::None,
            noise => noise,
        }
    }

    /// The same robot with inputs that are what drove it, as a prediction takes them.
    pub fn with_exact_input(mut self) -> Self {
        self.input.noise = InputNoise::None;
        self
    }

    /// Names of the built-in descriptions.
    pub fn builtin_names() -> impl Iterator<Item = &'static str> {
        BUILTIN.iter().map(|(name, _)| *name)
    }

    /// A robot that comes with the program.
    ///
    /// # Errors
    /// [`RobotError::UnknownRobot`] with the known names.
    pub fn builtin(name: &str) -> Result<Self, RobotError> {
        match BUILTIN.iter().find(|(known, _)| *known == name) {
            Some((_, text)) => Self::parse(text),
            None => Err(RobotError::unknown_robot(name, &Self::builtin_names().collect::<Vec<_>>())),
        }
    }

    /// A commented description to start from.
    ///
    /// # Errors
    /// [`RobotError::Invalid`] for a name that no robot can have.
    pub fn template(name: &str) -> Result<String, RobotError> {
        let text = TEMPLATE.replace("\"NAME\"", &format!("{name:?}"));
        Self::parse(&text).map(|_| text)
    }

    /// A robot from the text of a description file.
    ///
    /// # Errors
    /// [`RobotError`] names the field, its value and what to do.
    pub fn parse(text: &str) -> Result<Self, RobotError> {
        let file: file::RobotFile = toml::from_str(text).map_err(|error| RobotError::syntax(&error))?;
        validate::robot(file, text)
    }

    /// The same robot with the lag of every gyro estimated whose description says nothing of it: no data sheet tells all that a real
    /// part's filters delay.
    #[must_use]
    pub fn with_free_lags(self) -> Self {
        self.with_lags(|table| {
            if !table.contains_key("lag_s") {
                let mut free = toml_edit::InlineTable::new();
                free.insert("start", 0.0.into());
                table.insert("lag_s", toml_edit::value(free));
            }
        })
    }

    /// The same robot without an estimate of lags: they are what the description has them start from.
    #[must_use]
    pub fn with_known_lags(self) -> Self {
        self.with_lags(|table| {
            let lag = table.get_mut("lag_s").and_then(toml_edit::Item::as_table_like_mut);
            if let Some(lag) = lag
                && let Some(start) = lag.remove("start")
            {
                lag.insert("fixed", start);
            }
        })
    }

    /// The same robot with other tables of gyros; itself where nothing changes.
    fn with_lags(self, change: impl Fn(&mut dyn toml_edit::TableLike)) -> Self {
        // A description that was read can be read again.
        let Ok(mut file) = self.toml.parse::<toml_edit::DocumentMut>() else { return self };
        edit::each(&mut file, "sensor").filter(|table| edit::is(*table, "kind", "gyro")).for_each(change);
        let text = file.to_string();
        if text == self.toml { self } else { Self::parse(&text).unwrap_or(self) }
    }

    /// A built-in robot by its name, or a description file by its path.
    ///
    /// # Errors
    /// As [`Self::parse`]; a file that cannot be read; a name that is neither.
    pub fn load(name_or_path: &str) -> Result<Self, RobotError> {
        if Self::builtin_names().any(|known| known == name_or_path) {
            return Self::builtin(name_or_path);
        }
        let path = Path::new(name_or_path);
        let looks_like_a_path = path.components().count() > 1 || path.extension().is_some();
        if !looks_like_a_path && !path.exists() {
            return Self::builtin(name_or_path);
        }
        let text =
            std::fs::read_to_string(path).map_err(|source| RobotError::Read { path: path.to_owned(), source })?;
        Self::parse_in(&text, path.parent().unwrap_or_else(|| Path::new("")))
    }

    /// A robot from the text of a description file that lies in `folder`, where its URDF is looked for.
    ///
    /// # Errors
    /// As [`Self::parse`]; a URDF that cannot be read or is not the chain that the description speaks of.
    pub fn parse_in(text: &str, folder: &Path) -> Result<Self, RobotError> {
        match urdf::expand(text, folder)? {
            Some(complete) => Self::parse(&complete.text).map_err(|error| complete.name(error)),
            None => Self::parse(text),
        }
    }

    /// The text of the description file, comments and all; with what stands in a URDF written out.
    pub fn toml(&self) -> &str {
        &self.toml
    }

    /// The kinematic chain with its inertias, gravity and Coriolis terms as described.
    pub fn chain(&self) -> Chain {
        Chain::of(self)
    }

    /// Gyros in the order of the file: the first is gyro 1.
    pub fn gyros(&self) -> impl Iterator<Item = &Gyro> {
        self.sensors.iter().filter_map(|sensor| match sensor {
            Sensor::Gyro(gyro) => Some(gyro),
            _ => None,
        })
    }

    /// What a recording of this robot holds beside time and input, in the order of its columns.
    pub fn channels(&self) -> Vec<Channel> {
        channel::channels(self)
    }

    /// Names of the columns of a table: `t_us`, the inputs `u1…`, then the channels.
    pub fn columns(&self) -> Vec<String> {
        let inputs = (1..=self.joints.len()).map(|joint| format!("u{joint}"));
        let channels = self.channels().into_iter().map(|channel| channel.column);
        std::iter::once("t_us".to_owned()).chain(inputs).chain(channels).collect()
    }

    /// Every parameter of the base model, in the order of the results: `k_pwm k_t k_mi b mu[i] k_s[i] d_s[i]`, then each
    /// gyro's bias, then each gyro's misalignment.
    pub fn parameters(&self) -> &[ParameterSpec] {
        &self.parameters
    }

    /// The parameter that `symbol` means at `joint` (0-based), if that joint has one.
    pub fn joint_parameter(&self, symbol: Symbol, joint: usize) -> Option<&ParameterSpec> {
        self.parameters.iter().find(|spec| spec.symbol == symbol && spec.joints.contains(&joint))
    }
}
