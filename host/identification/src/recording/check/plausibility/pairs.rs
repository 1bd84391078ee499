//! Sensors of one joint against one another: motor encoder, link encoder, tachometers.

use super::correlation::Correlation;
use super::stats::{mean_rate, position};
use super::unit::{self, DEGREES};
use crate::recording::check::{About, Findings};
use crate::recording::{Channel, Recording, Severity};
use crate::robot::ChannelKind;

/// Two readings of one motion go together at least so well; transmissions bend, encoders of links may lag.
const TOGETHER: f64 = 0.9;
/// Their ratio may differ from 1 by this factor before it is a mistake.
const RATIO: f64 = 1.5;
/// A mistake's factor is met within this factor.
const MET: f64 = 1.15;
/// Fewest samples that prove something.
const LEAST_SAMPLES: usize = 200;
/// A motion below this many sigmas of a sensor proves nothing.
const VISIBLE_SIGMAS: f64 = 20.0;

pub(super) fn look(recording: &Recording, findings: &mut Findings) {
    for joint in 0..recording.robot.joints.len() {
        let of = |kind| recording.channels.iter().find(|channel| channel.spec.kind == kind);
        if let (Some(motor), Some(link)) =
            (of(ChannelKind::MotorPosition { joint }), of(ChannelKind::LinkPosition { joint }))
        {
            encoders(recording, joint, motor, link, findings);
        }
        let Some(encoder) = position(recording, joint) else { continue };
        for kind in [ChannelKind::MotorSpeed { joint }, ChannelKind::LinkSpeed { joint }] {
            if let Some(speed) = of(kind) {
                tachometer(recording, joint, encoder, speed, findings);
            }
        }
    }
}

fn visible(values: &[f64], sigma: f64) -> bool {
    super::stats::spread(values).is_some_and(|spread| spread.deviation > VISIBLE_SIGMAS * sigma)
}

fn encoders(recording: &Recording, joint: usize, motor: &Channel, link: &Channel, findings: &mut Findings) {
    let sums = Correlation::of(&motor.values, &link.values);
    let seen = visible(&motor.values, motor.spec.sigma) || visible(&link.values, link.spec.sigma);
    if sums.count < LEAST_SAMPLES || !seen {
        return;
    }
    let (correlation, gain) = (sums.coefficient(), sums.gain());
    let name = &recording.robot.joints[joint].name;
    let mut add = |message: String, advice: &str| {
        findings.add(Severity::Error, About::Units, Some(&link.spec.name), message, advice);
    };
    if correlation < -TOGETHER {
        add(
            format!("link and motor encoder of {name} run against one another (correlation {correlation:.2})"),
            "change the sign of one of them (sign = -1 under import.columns in the robot file)",
        );
    } else if correlation < TOGETHER {
        add(
            format!("link and motor encoder of {name} do not go together (correlation {correlation:.2})"),
            "check the order of the columns q1… and theta1…, in the table or under import.columns in the robot file",
        );
    } else if !(1.0 / RATIO..RATIO).contains(&gain) {
        let of_link = unit::of_position(recording, joint, true);
        let of_motor = unit::of_position(recording, joint, false);
        let link_looks = unit::nearest(&of_link, gain, MET);
        let motor_looks = unit::nearest(&of_motor, 1.0 / gain, MET);
        let told = [(link, link_looks), (motor, motor_looks)];
        let told: Vec<_> = told.iter().filter_map(|(channel, mistake)| Some((channel, (*mistake)?))).collect();
        let looks: Vec<String> = told.iter().map(|(channel, m)| format!("{} {}", channel.spec.name, m.looks)).collect();
        let advice = match told.first() {
            Some((_, mistake)) => mistake.advice.clone(),
            None => "check counts per turn and gear in the robot file, and the units of both columns".to_owned(),
        };
        let looks = if looks.is_empty() { String::new() } else { format!(": {}", looks.join(", or ")) };
        add(format!("the link encoder of {name} moves {gain:.4} times as far as the motor's{looks}"), &advice);
    }
}

fn tachometer(recording: &Recording, joint: usize, encoder: &Channel, speed: &Channel, findings: &mut Findings) {
    let rates = mean_rate(recording, &encoder.values);
    let measured = super::stats::window_mean(recording, &speed.values);
    let sums = Correlation::of(&rates, &measured);
    if sums.count < LEAST_SAMPLES || !(visible(&measured, speed.spec.sigma) || visible(&rates, speed.spec.sigma)) {
        return;
    }
    let (correlation, gain) = (sums.coefficient(), sums.gain());
    let name = &recording.robot.joints[joint].name;
    let mut add = |message: String, advice: String| {
        findings.add(Severity::Error, About::Units, Some(&speed.spec.name), message, &advice);
    };
    let column = &speed.spec.column;
    if correlation < -TOGETHER {
        let advice = format!("change its sign (sign = -1 for {column} under import.columns in the robot file)");
        add(format!("the tachometer of {name} runs against its encoder (correlation {correlation:.2})"), advice);
    } else if correlation < 0.5 {
        let advice = format!("check which column {column} is, in the table or under import.columns in the robot file");
        add(format!("the tachometer of {name} does not go with its encoder (correlation {correlation:.2})"), advice);
    } else if !(1.0 / RATIO..RATIO).contains(&gain) {
        let gear = recording.robot.joints[joint].gear;
        let rpm = 60.0 / std::f64::consts::TAU;
        let units = [
            (DEGREES, "degrees per second"),
            (rpm, "rpm"),
            (gear, "the motor's side of the gear"),
            (gear * DEGREES, "degrees per second on the motor's side of the gear"),
            (gear * rpm, "rpm on the motor's side of the gear"),
            (1e3, "millimetres per second"),
            (1.0 / gear, "a speed to which the gear was applied twice"),
        ];
        let near = |factor: f64| (1.0 / MET..MET).contains(&(gain / factor));
        let looks = units.iter().filter(|(factor, _)| near(*factor)).map(|(_, words)| *words).collect::<Vec<_>>();
        let looks = if looks.is_empty() { String::new() } else { format!(": it looks like {}", looks.join(", or ")) };
        let advice = format!(
            "give speeds in SI on the link side, or write unit and side for {column} under import.columns in the robot file"
        );
        add(format!("the tachometer of {name} reads {gain:.4} times what its encoder gives{looks}"), advice);
    }
}
