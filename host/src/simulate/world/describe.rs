//! What the firmware must know of a robot, from its description file: scales, limits, and what its drives bear.

use firmware::driver::GyroRange;
use protocol::description::{Axis, Description, EncoderDescription, GyroDescription, GyroPart, JointDescription};
use protocol::motion::Limits;
use protocol::units::text;
use protocol::{Duty, Layout};

use super::encoder::EncoderChip;
use crate::robot::{InputUnit, Joint, JointKind, Robot, Sensor, Symbol};
use crate::simulate::loads::Loads;
use crate::simulate::{SimulateError, TICK_S, Truth};

/// The description of this robot that a device stores and runs.
///
/// # Errors
/// [`SimulateError::Unsuited`] if the firmware has no place for such a robot. Whether the figures are ones that it can run
/// is not looked at ([`firmware::Hardware::check`]).
pub fn description(robot: &Robot) -> Result<Description, SimulateError> {
    suits(robot)?;
    let encoders = encoders(robot)?;
    let range_dps = gyro_range(robot)?.full_scale_dps();
    let count = |n: usize| u8::try_from(n).unwrap_or(u8::MAX);
    let (n, gyros) = (robot.joints.len(), robot.gyros().count());
    // Beyond these bounds the lists below have no room.
    Layout::new(count(n), count(encoders.len()), count(gyros)).map_err(|error| unsuited(&error.to_string()))?;

    let nominal = Truth::nominal(robot);
    let mut mass = vec![0.0; n * n];
    robot.chain().mass_matrix(&vec![0.0; n], &mut mass);
    let loads = Loads::of(robot, &nominal);
    let joint = |(j, joint): (usize, &Joint)| {
        let value = |symbol| nominal.get(robot, symbol, j).unwrap_or(0.0);
        let limits = Limits { min: joint.limits[0] as f32, max: joint.limits[1] as f32 };
        let axis = match joint.kind {
            JointKind::Revolute => Axis::Turns(in_base(robot, j, joint.axis)),
            JointKind::Prismatic => Axis::Slides,
        };
        // (motor + link inertia) / back-EMF
        let coast_s = (value(Symbol::B) + mass[j * n + j]) / value(Symbol::KMi);
        // What no motor can hold stands at no duty.
        let standing = (loads.standing[j] * f64::from(Duty::FULL)).min(f64::from(Duty::FULL)) as i16;
        let usual = firmware::JointSetup::new(limits, axis);
        JointDescription {
            limits,
            axis,
            standing_duty: usual.standing_duty.max(Duty(standing)),
            max_duty: usual.max_duty,
            coast_s: coast_s as f32,
            held_s: loads.held_s[j] as f32,
            carried_s2: loads.carried_s2[j].iter().map(|s2| *s2 as f32).collect(),
        }
    };
    let encoder = |chip: &EncoderChip| {
        let protocol::EncoderInfo { joint, side, counts_per_turn, gear, offset_us: _ } = chip.info;
        EncoderDescription { joint, side, counts_per_turn, gear }
    };
    let gyro = |(index, gyro): (usize, &crate::robot::Gyro)| GyroDescription {
        part: gyro.part.unwrap_or(usual_part(index)),
        range_dps,
        body: gyro.body as u8,
        mount: gyro.rotation.map(|row| in_base(robot, gyro.body, row)),
        give_rad: loads.give_rad[index] as f32,
        sag_rad: loads.sag_rad[index] as f32,
    };
    Ok(Description {
        robot: text(&robot.name),
        joints: robot.joints.iter().enumerate().map(joint).collect(),
        encoders: encoders.iter().map(encoder).collect(),
        gyros: robot.gyros().enumerate().map(gyro).collect(),
    })
}

/// The part in this place where the description file names none: as the boards have them, one on SPI, one on I²C.
pub(in crate::simulate) fn usual_part(gyro: usize) -> GyroPart {
    if gyro.is_multiple_of(2) { GyroPart::Icm42688p } else { GyroPart::Bmi323 }
}

/// Whether the firmware has inputs, a period and sensors as the robot's.
pub(in crate::simulate) fn suits(robot: &Robot) -> Result<(), SimulateError> {
    if robot.input.unit != InputUnit::Duty {
        return Err(unsuited("the firmware drives motors by duty, the description has another input"));
    }
    if (robot.sample_period_s - TICK_S).abs() > 1e-9 {
        return Err(unsuited("the firmware samples every 0.001 s, the description says otherwise"));
    }
    if robot.sensors.iter().any(|sensor| matches!(sensor, Sensor::Tachometer(_))) {
        return Err(unsuited("the firmware reads no tachometers"));
    }
    Ok(())
}

/// The encoders of the robot, in the sample's order.
pub(in crate::simulate) fn encoders(robot: &Robot) -> Result<Vec<EncoderChip>, SimulateError> {
    EncoderChip::of_robot(robot)
        .map_err(|joint| unsuited(&format!("the encoder of joint {joint} needs its counts_per_turn")))
}

/// The range that the description names, which must be one that the firmware knows and the same for all gyros.
pub(in crate::simulate) fn gyro_range(robot: &Robot) -> Result<GyroRange, SimulateError> {
    let mut ranges = robot.gyros().filter_map(|gyro| gyro.range_rad_s);
    let Some(wanted) = ranges.next() else { return Ok(GyroRange::default()) };
    let dps = wanted.to_degrees();
    let known = [GyroRange::Dps500, GyroRange::Dps1000, GyroRange::Dps2000];
    let fitting = known.into_iter().find(|range| (f64::from(range.full_scale_dps()) / dps - 1.0).abs() < 1e-3);
    match fitting {
        Some(range) if ranges.all(|other| (other / wanted - 1.0).abs() < 1e-3) => Ok(range),
        _ => Err(unsuited(&format!(
            "the firmware's gyros have a range of 500, 1000 or 2000 deg/s, the description {dps:.1}"
        ))),
    }
}

/// A vector in axes of a joint, in axes of the base, all joints at zero.
fn in_base(robot: &Robot, joint: usize, vector: [f64; 3]) -> [f32; 3] {
    let carriers = robot.joints[..=joint].iter().rev();
    // Each rotation takes vectors from the body before to the joint: backwards by its transpose.
    let back = |vector: [f64; 3], carrier: &Joint| -> [f64; 3] {
        std::array::from_fn(|i| (0..3).map(|k| carrier.rotation[k][i] * vector[k]).sum())
    };
    carriers.fold(vector, back).map(|part| part as f32)
}

fn unsuited(reason: &str) -> SimulateError {
    SimulateError::Unsuited { reason: reason.to_owned() }
}
