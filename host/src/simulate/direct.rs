//! A motion played and recorded in memory: sensors, drivers, timing and the firmware's motion player as on the simulated board, but
//! neither its safety nor a line. A second of motion takes some 50 ms, where studies need hundreds of recordings.

use firmware::motion::{Player, Step};
use protocol::{Duty, MAX_JOINTS, Motion};

use super::board::wires::Wires;
use super::simulator::Drawn;
use super::{Board, EffectTruth, Options, SimulateError};
use crate::effect::TrueValue;
use crate::recording::{GyroTime, MotionFile, Recorder, Recording, Row, Session, Source, Tick};

/// A motion of 24 s that shows every parameter of a robot like Doggy: rest, slow sines and moves of all joints, steps and a chirp
/// of each, steps and a chirp of all.
pub const SHORT_MOTION: &str = include_str!("motion/short.toml");

/// A recording in memory, with what is true of the robot.
#[derive(Debug)]
pub struct Direct {
    /// From the first tick of the motion to its last.
    pub recording: Recording,
    /// The true parameters of the base model.
    pub truth: Vec<TrueValue>,
    /// The effects in the plant.
    pub effects: Vec<EffectTruth>,
    /// The true state at every tick, by columns: q, q̇, θ and θ̇ of each joint, named as in exported models (`qd1`).
    pub states: Vec<(String, Vec<f64>)>,
}

impl Direct {
    /// Lets the robot of these options play a motion file (TOML), and records it. Pace, faults, link and truth file of the options
    /// do not matter. The recording depends on nothing but robot, seed, effects, process noise and motion.
    ///
    /// # Errors
    /// [`SimulateError`] if the robot or its effects cannot be simulated, or the text is not a motion for it.
    pub fn record(options: &Options, motion: &str) -> Result<Self, SimulateError> {
        Self::record_nth(options, motion, 1)
    }

    /// The same as the n-th motion of that robot: with other noise.
    ///
    /// # Errors
    /// As [`Direct::record`].
    pub fn record_nth(options: &Options, motion: &str, n: u64) -> Result<Self, SimulateError> {
        let robot = &options.robot;
        let played: Motion =
            toml::from_str(motion).map_err(|error| SimulateError::Motion { said: error.to_string() })?;
        let limits = |joint: &crate::robot::Joint| protocol::motion::Limits {
            min: joint.limits[0] as f32,
            max: joint.limits[1] as f32,
        };
        let limits: Vec<_> = robot.joints.iter().map(limits).collect();
        played.validate(&limits).map_err(|error| SimulateError::Motion { said: format!("{error:?}") })?;

        let Drawn { world, truth, effects } = Drawn::new(options)?;
        let mut board = Board::new(robot, world)?;
        let wires = Wires::new(robot, &board);
        let file = MotionFile { name: played.name.to_string(), toml: motion.to_owned() };
        let gyro_times = GyroTime::of(board.world().gyro_infos());
        let session = Session { motion: Some(file), gyro_times, ..Session::of(robot.clone()) };
        let mut recorder = Recorder::new(session);
        let mut player: Option<Player> = None;
        (0..n).for_each(|_| board.begin_motion());
        let names = |joint: usize| ["q", "qd", "theta", "thetad"].map(|name| format!("{name}{}", joint + 1));
        let joints = robot.joints.len();
        let mut states: Vec<_> = (0..joints).flat_map(names).map(|name| (name, Vec::new())).collect();
        for k in 0_u64.. {
            let mut phase = None;
            let before: Vec<f64> = (0..joints).flat_map(|joint| board.world().plant().joint_state(joint)).collect();
            let (inputs, duty) = board.tick_with(|inputs| {
                let positions = wires.positions(inputs);
                let player =
                    player.get_or_insert_with(|| Player::new(&played, wires.counts_per_unit, &positions, TICK_US));
                match player.step(&played, &positions) {
                    Step::Playing { phase: playing, duty, .. } => {
                        phase = Some(playing);
                        duty
                    }
                    Step::Finished => [Duty::ZERO; MAX_JOINTS],
                }
            });
            let Some(phase) = phase else { break };
            let values = wires.values(&inputs);
            let duty = &duty[..robot.joints.len()];
            let gyro_ages_us = inputs.gyro_ages.map(|age| age.us().map_or(f64::NAN, f64::from));
            let tick = Tick { gyro_ages_us, ..Tick::default() };
            let row = Row { t_us: 1000 * k, seq: k, phase, tick, duty, values: &values };
            states.iter_mut().zip(before).for_each(|((_, values), value)| values.push(value));
            recorder.push(&row).map_err(|error| SimulateError::Machine { said: error.to_string() })?;
        }
        let source = Source { path: "simulated".into(), sha256: String::new() };
        Ok(Self { recording: recorder.finish(source), truth, effects, states })
    }
}

const TICK_US: u32 = 1000;
