//! The page of `host plan`: what the motion tells, what it asks, and the motion itself.

use super::number::{percent, seconds, significant};
use super::{Cell, Colour, LinePlot, Page, Section, Series, Table};
use crate::plan::Plan;
use crate::robot::ChannelKind;

/// The page of a plan.
pub fn plan_page(plan: &Plan) -> Page {
    let lead = if plan.is_preset {
        "Nothing better than the preset calibration motion was found.".to_owned()
    } else {
        format!("Expected errors are {} of those by the preset calibration motion.", percent(plan.error_ratio))
    };
    let known = if plan.calibrated { "a calibration" } else { "the description" };
    let mut page = Page::new(format!("Planned motion of {}", plan.robot))
        .lead(lead)
        .fact("known from", known)
        .fact("length", format!("{}, the preset's {}", seconds(plan.duration_s), seconds(plan.preset_duration_s)))
        .fact("segments", plan.segments.to_string())
        .fact("blocks tried", plan.blocks_tried.to_string())
        .fact("robots tried", plan.robots.to_string())
        .fact("seed", plan.seed.to_string());
    if !plan.sizes.is_empty() {
        page.push(sizes(plan));
    }
    page.push(errors(plan));
    page.push(demands(plan));
    page.push(motion(plan));
    page
}

fn sizes(plan: &Plan) -> Section {
    let mut section = Section::new("Effects");
    section.prose(
        "How surely a typical size of each effect would be seen, with all parameters and all other effects of this table free: its size in standard errors. What \
         the motion tells of it grows with the square.",
    );
    let mut table = Table::new()
        .words("size")
        .words("unit")
        .numbers("typical", "")
        .numbers("planned, errors", "")
        .numbers("preset, errors", "")
        .numbers("information, ratio", "")
        .numbers("worst robot, ratio", "");
    for p in &plan.sizes {
        let seen =
            |error: Option<f64>| error.map_or("not seen".to_owned(), |error| significant((p.value / error).abs(), 3));
        let ratio = |ratio: Option<f64>| ratio.map_or(String::new(), |ratio| significant(ratio.powi(-2), 3));
        table.row([
            Cell::from(p.name.as_str()),
            p.unit.as_str().into(),
            significant(p.value, 3).into(),
            seen(p.std_error).into(),
            seen(p.preset_std_error).into(),
            ratio(p.ratio).into(),
            ratio(p.worst_ratio).into(),
        ]);
    }
    section.table(&table);
    section
}

fn errors(plan: &Plan) -> Section {
    let mut section = Section::new("Expected standard errors");
    let mut table = Table::new()
        .words("parameter")
        .words("unit")
        .numbers("likeliest value", "")
        .numbers("planned", "")
        .numbers("preset", "")
        .numbers("ratio", "")
        .numbers("worst ratio", "")
        .caption("Errors on the likeliest robot; ratios over all robots that it may be: geometric mean, and largest.");
    for p in &plan.parameters {
        let error = |error: Option<f64>| error.map_or("not determined".to_owned(), |error| significant(error, 3));
        let ratio = |ratio: Option<f64>| ratio.map_or(String::new(), |ratio| significant(ratio, 3));
        table.row([
            Cell::from(p.name.as_str()),
            p.unit.as_str().into(),
            significant(p.value, 4).into(),
            error(p.std_error).into(),
            error(p.preset_std_error).into(),
            ratio(p.ratio).into(),
            ratio(p.worst_ratio).into(),
        ]);
    }
    section.table(&table);
    section
}

fn demands(plan: &Plan) -> Section {
    let mut section = Section::new("What the motion asks of the robot");
    let mut table = Table::new()
        .words("joint")
        .words("motion")
        .numbers("travel", "")
        .numbers("speed", "")
        .numbers("motor torque", "")
        .numbers("transmission torque", "")
        .numbers("duty, rms", "")
        .caption("The largest over all robots that it may be; torques in N m or N on the link side.");
    for j in &plan.joints {
        let mut row = |motion: &str, travel: [f64; 2], [speed, motor, transmission, duty]: [f64; 4]| {
            table.row([
                Cell::from(j.joint.as_str()),
                motion.into(),
                format!("{} to {} {}", significant(travel[0], 3), significant(travel[1], 3), j.unit).into(),
                format!("{} {}/s", significant(speed, 3), j.unit).into(),
                significant(motor, 3).into(),
                significant(transmission, 3).into(),
                percent(duty).into(),
            ]);
        };
        row("planned", j.travel, [j.speed, j.motor_torque, j.transmission_torque, j.duty_rms]);
        let preset = [j.preset_speed, j.preset_motor_torque, j.preset_transmission_torque, j.preset_duty_rms];
        row("preset", j.preset_travel, preset);
    }
    section.table(&table);
    section.prose(format!(
        "The firmware's watches come as near as {} of their bounds, in the preset {}.",
        percent(plan.watch),
        percent(plan.preset_watch)
    ));
    section
}

fn motion(plan: &Plan) -> Section {
    let mut section = Section::new("Motion");
    let Some(recording) = &plan.recording else { return section };
    section.prose("As the likeliest robot plays it.");
    let time: Vec<f64> = (0..recording.len()).map(|k| recording.time_s(k)).collect();
    let mut input = LinePlot::new(&time, "time (s)", "duty").group("motion");
    for (joint, duty) in recording.duty.iter().enumerate() {
        input = input.series(Series::held(recording.robot.joints[joint].name.as_str(), Colour::Axis(joint), duty));
    }
    section.plot("Duty", input);
    let mut positions = LinePlot::new(&time, "time (s)", "motor position").group("motion");
    for channel in &recording.channels {
        if let ChannelKind::MotorPosition { joint } = channel.spec.kind {
            let name = recording.robot.joints[joint].name.as_str();
            positions = positions.series(Series::line(name, Colour::Axis(joint), &channel.values));
        }
    }
    section.plot("Motor positions", positions);
    section
}
