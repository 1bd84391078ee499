//! The parameters of the base model as a robot declares them.

use super::{Friction, InputUnit, Joint, JointKind, Transmission};

/// A number that is estimated from a start value, or known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameter {
    /// Start value, or the known value.
    pub start: f64,
    /// Whether it is estimated.
    pub free: bool,
    /// What a simulated robot of this kind has on average: the start value may be a poor guess.
    pub simulated: f64,
}

/// What a parameter is in the equations.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Symbol {
    /// Torque per volt of a motor.
    KPwm,
    /// Torque per ampere of a motor.
    KT,
    /// Torque per speed from the back-EMF.
    KMi,
    /// Motor inertia on the link side of the gear.
    B,
    /// Coulomb friction.
    Mu,
    /// Stiffness of the transmission.
    KS,
    /// Damping of the transmission.
    DS,
    /// Viscous friction, where no back-EMF stands for it.
    V,
    /// Constant torque that holds the motor back.
    O,
    /// Inertia about the joint's axis (of a sliding joint, mass) that the body has beyond its description.
    J,
    /// A component of the mass times centre that the body has beyond its description, in joint axes (0-based).
    FirstMoment {
        /// Axis of the joint frame.
        axis: usize,
    },
    /// What a link encoder reads where the link stands at zero.
    Zero,
    /// The share by which a link encoder tells too much.
    ScaleError,
    /// How much later a gyro reads than its description, its stamps and its known delay say.
    Lag {
        /// Which gyro.
        gyro: usize,
    },
    /// Bias of one gyro axis (0-based).
    Bias {
        /// Which gyro.
        gyro: usize,
        /// Sensor axis.
        axis: usize,
    },
    /// One component of a gyro's misalignment δ (0-based).
    Misalignment {
        /// Which gyro.
        gyro: usize,
        /// Body axis of the rotation vector.
        axis: usize,
    },
}

/// One parameter: its name in results, where it enters, and where its estimate starts.
#[derive(Debug, Clone, PartialEq)]
pub struct ParameterSpec {
    /// Name, as `k_pwm`, `k_s[2]`, `lag1`, `bias1[x]`, `R_imu2[z]`.
    pub name: String,
    /// What it is.
    pub symbol: Symbol,
    /// The joints it enters, 0-based; of a gyro's lag the one that moves its body; empty for other parameters of gyros.
    pub joints: Vec<usize>,
    /// Unit.
    pub unit: &'static str,
    /// Start value, free or not.
    pub value: Parameter,
}

impl Symbol {
    /// The parameters of joints, in the order of the results.
    pub const OF_JOINTS: [Self; 13] = [
        Self::KPwm,
        Self::KT,
        Self::KMi,
        Self::B,
        Self::Mu,
        Self::KS,
        Self::DS,
        Self::V,
        Self::O,
        Self::J,
        Self::FirstMoment { axis: 0 },
        Self::FirstMoment { axis: 1 },
        Self::FirstMoment { axis: 2 },
    ];

    /// What a body may have beyond its description.
    pub const OF_BODIES: [Self; 4] =
        [Self::J, Self::FirstMoment { axis: 0 }, Self::FirstMoment { axis: 1 }, Self::FirstMoment { axis: 2 }];

    /// The name in files and results, without an index.
    pub const fn name(self) -> &'static str {
        match self {
            Self::KPwm => "k_pwm",
            Self::KT => "k_t",
            Self::KMi => "k_mi",
            Self::B => "b",
            Self::Mu => "mu",
            Self::KS => "k_s",
            Self::DS => "d_s",
            Self::V => "v",
            Self::O => "o",
            Self::J => "J",
            Self::FirstMoment { axis: 0 } => "mx",
            Self::FirstMoment { axis: 1 } => "my",
            Self::FirstMoment { .. } => "mz",
            Self::Zero => "zero",
            Self::ScaleError => "scale_error",
            Self::Lag { .. } => "lag",
            Self::Bias { .. } => "bias",
            Self::Misalignment { .. } => "R_imu",
        }
    }

    /// The unit at a joint of this kind.
    pub const fn unit(self, kind: JointKind) -> &'static str {
        match (kind, self) {
            (_, Self::Lag { .. }) => "s",
            (_, Self::Bias { .. }) => "rad/s",
            (_, Self::Misalignment { .. }) => "rad",
            (_, Self::ScaleError) => "",
            (JointKind::Revolute, Self::KPwm) => "N m/V",
            (JointKind::Revolute, Self::KT) => "N m/A",
            (_, Self::FirstMoment { .. }) => "kg m",
            (JointKind::Revolute, Self::KMi | Self::DS | Self::V) => "N m s/rad",
            (JointKind::Revolute, Self::B | Self::J) => "kg m^2",
            (JointKind::Revolute, Self::Mu | Self::O) => "N m",
            (JointKind::Revolute, Self::Zero) => "rad",
            (JointKind::Revolute, Self::KS) => "N m/rad",
            (JointKind::Prismatic, Self::KPwm) => "N/V",
            (JointKind::Prismatic, Self::KT) => "N/A",
            (JointKind::Prismatic, Self::KMi | Self::DS | Self::V) => "N s/m",
            (JointKind::Prismatic, Self::B | Self::J) => "kg",
            (JointKind::Prismatic, Self::Mu | Self::O) => "N",
            (JointKind::Prismatic, Self::Zero) => "m",
            (JointKind::Prismatic, Self::KS) => "N/m",
        }
    }

    /// Whether the equations of this joint hold the parameter.
    pub(super) fn enters(self, joint: &Joint, input: InputUnit) -> bool {
        match self {
            Self::KPwm | Self::KMi => matches!(input, InputUnit::Duty | InputUnit::Volt),
            Self::KT => input == InputUnit::Ampere,
            Self::B => true,
            Self::Mu => joint.friction != Friction::None,
            Self::KS | Self::DS => joint.transmission == Transmission::Elastic,
            // With a voltage it is k_mi by another name.
            Self::V => !matches!(input, InputUnit::Duty | InputUnit::Volt),
            Self::O | Self::J | Self::FirstMoment { .. } => true,
            Self::Bias { .. } | Self::Misalignment { .. } | Self::Lag { .. } | Self::Zero | Self::ScaleError => false,
        }
    }

    /// Whether a joint may do without it: it is then zero.
    pub(super) const fn is_optional(self) -> bool {
        matches!(self, Self::V | Self::O | Self::J | Self::FirstMoment { .. })
    }

    /// Whether physics leaves its sign open.
    pub const fn has_either_sign(self) -> bool {
        matches!(self, Self::O | Self::J | Self::FirstMoment { .. } | Self::Zero | Self::ScaleError | Self::Lag { .. })
    }

    /// Whether zero is a value that the equations can stand.
    pub(super) const fn may_be_zero(self, joint: &Joint) -> bool {
        match self {
            Self::KPwm | Self::KT | Self::KS => false,
            Self::B => matches!(joint.transmission, Transmission::Rigid),
            _ => true,
        }
    }
}
