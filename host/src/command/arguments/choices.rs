//! How the command line writes choices that the library only knows as enums: their names and their help.

use clap::ValueEnum;
use clap::builder::PossibleValue;

use crate::calibrate::{NoiseSource, Preset};
use crate::fleet::By;
use crate::plan::Criterion;
use crate::recording::import::EmptyInputs;
use crate::simulate::{GyroChips, Pace};

/// A choice among values of a type of the libraries.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Choice<T: 'static>(pub T);

/// A type of the libraries whose values are chosen on the command line: foreign types cannot be `ValueEnum` themselves.
pub trait Offered: Copy + 'static {
    /// The values, in the order of the help.
    const ALL: &'static [Choice<Self>];

    /// Name and help of one.
    fn possible_value(self) -> PossibleValue;
}

impl<T: Offered> ValueEnum for Choice<T> {
    fn value_variants<'a>() -> &'a [Self] {
        T::ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        Some(self.0.possible_value())
    }
}

impl Offered for Preset {
    const ALL: &'static [Choice<Self>] = &[Choice(Preset::Default), Choice(Preset::Paper)];

    fn possible_value(self) -> PossibleValue {
        match self {
            Preset::Default => PossibleValue::new("default")
                .help("Runge–Kutta steps, every gyro predicted from the state on a rigid base, tight process noise"),
            Preset::Paper => PossibleValue::new("paper")
                .help("The paper's problem, to reproduce it with its biases: Euler steps, rows (22) and (26), noise of (35)–(37)"),
        }
    }
}

impl Offered for NoiseSource {
    const ALL: &'static [Choice<Self>] = &[Choice(NoiseSource::Fixed), Choice(NoiseSource::Estimated)];

    fn possible_value(self) -> PossibleValue {
        match self {
            NoiseSource::Fixed => PossibleValue::new("fixed")
                .help("The robot file's for the sensors, the preset's for the steps of the model"),
            NoiseSource::Estimated => {
                PossibleValue::new("estimated").help("The recording itself, by restricted maximum likelihood")
            }
        }
    }
}

impl ValueEnum for Criterion {
    fn value_variants<'a>() -> &'a [Self] {
        &[Criterion::A, Criterion::D]
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        Some(match self {
            Criterion::A => {
                PossibleValue::new("a").help("Mean square of the relative errors of the dynamic parameters")
            }
            Criterion::D => PossibleValue::new("d").help("Volume of the ellipsoid of the same errors"),
        })
    }
}

impl Offered for By {
    const ALL: &'static [Choice<Self>] = &[Choice(By::Robot), Choice(By::Folder)];

    fn possible_value(self) -> PossibleValue {
        match self {
            By::Robot => PossibleValue::new("robot").help("The robot's name in the description"),
            By::Folder => PossibleValue::new("folder")
                .help("The folder that the result lies in: one folder a robot, where many have the same description"),
        }
    }
}

impl ValueEnum for GyroChips {
    fn value_variants<'a>() -> &'a [Self] {
        &[Self::Ideal, Self::Real, Self::Unstamped]
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        Some(match self {
            Self::Ideal => PossibleValue::new("ideal").help("Converted when they are read, without a filter"),
            Self::Real => PossibleValue::new("real").help("With clocks and filters of their own"),
            Self::Unstamped => {
                PossibleValue::new("unstamped").help("The same with \"data ready\" not wired: ages are unknown")
            }
        })
    }
}

impl ValueEnum for Pace {
    fn value_variants<'a>() -> &'a [Self] {
        &[Pace::Real, Pace::Fast]
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        match self {
            Pace::Real => Some(PossibleValue::new("real").help("As a real robot")),
            Pace::Fast => Some(
                PossibleValue::new("fast").help("In a motion as fast as the host keeps up; otherwise as a real robot"),
            ),
            // Set in code only.
            Pace::Patient => None,
        }
    }
}

impl Offered for EmptyInputs {
    const ALL: &'static [Choice<Self>] = &[Choice(EmptyInputs::Hold), Choice(EmptyInputs::Interpolate)];

    fn possible_value(self) -> PossibleValue {
        match self {
            EmptyInputs::Hold => {
                PossibleValue::new("hold").help("The last one: of a command, which lasts until the next")
            }
            EmptyInputs::Interpolate => {
                PossibleValue::new("interpolate").help("On a straight line to the next: of a torque that was measured")
            }
        }
    }
}
