//! The page of `host check`: findings first, then what they were drawn from.

use super::number::{percent, seconds, significant};
use super::{Cell, Colour, LinePlot, Page, Section, Series, Table, Tone};
use crate::recording::check::{Check, Finding};
use crate::recording::{Channel, Recording, Severity};
use crate::robot::ChannelKind;

/// The page of a check of that recording.
pub fn check_page(recording: &Recording, check: &Check) -> Page {
    let lead = match (check.usable, check.findings.iter().any(|finding| finding.severity == Severity::Warning)) {
        (false, _) => "This recording is not fit for calibration.",
        (true, true) => "This recording can be calibrated; the warnings say what would make it better.",
        (true, false) => "This recording is fit for calibration.",
    };
    let mut page = Page::new(format!("Check of a recording of {}", check.robot))
        .lead(lead)
        .fact("recording", &check.path)
        .fact("SHA-256", &check.sha256)
        .fact("samples", format!("{} in {}", check.samples, seconds(check.duration_s)))
        .fact("missing", format!("{} ticks in {} gaps", check.missing_ticks, check.gaps))
        .fact("rate", format!("{} Hz", significant(check.rate_hz, 6)));
    page.push(findings(check));
    page.push(motion(recording, check));
    page.push(rest(check));
    page.push(timing(check));
    page
}

fn tone(severity: Severity) -> Tone {
    match severity {
        Severity::Note => Tone::Plain,
        Severity::Warning => Tone::Warning,
        Severity::Error => Tone::Bad,
    }
}

fn findings(check: &Check) -> Section {
    let mut section = Section::new("Findings");
    if check.findings.is_empty() {
        section.note(Tone::Good, "Nothing was found to be wrong.");
        return section;
    }
    let mut table = Table::new().words("").words("where").words("what").words("what to do");
    for Finding { severity, channel, message, advice, .. } in &check.findings {
        table.row([
            Cell::toned(severity.name(), tone(*severity)),
            channel.as_deref().unwrap_or("").into(),
            message.as_str().into(),
            advice.as_str().into(),
        ]);
    }
    section.table(&table);
    section
}

fn motion(recording: &Recording, check: &Check) -> Section {
    let mut section = Section::new("Motion");
    let mut table = Table::new()
        .words("joint")
        .numbers("range", "")
        .numbers("of the allowed", "")
        .numbers("top speed", "")
        .numbers("reversals", "")
        .numbers("largest input", "")
        .numbers("slow motion", "")
        .numbers("quick reversals of the input", "");
    for joint in &check.joints {
        table.row([
            joint.joint.as_str().into(),
            format!("{} {}", significant(joint.range, 3), joint.unit).into(),
            percent(joint.range_share).into(),
            format!("{} {}/s", significant(joint.max_speed, 3), joint.unit).into(),
            joint.reversals.to_string().into(),
            percent(joint.max_input).into(),
            seconds(joint.slow_s).into(),
            Cell::from(joint.fast_reversals.to_string()),
        ]);
    }
    section.table(&table);

    let time: Vec<f64> = (0..recording.len()).map(|k| recording.time_s(k)).collect();
    let mut input = LinePlot::new(&time, "time (s)", "input").group("recording");
    for (joint, duty) in recording.duty.iter().enumerate() {
        let label = format!("u{} {}", joint + 1, recording.robot.joints[joint].name);
        input = input.series(Series::held(label, Colour::Axis(joint), duty));
    }
    if check.rest_s > 0.0 {
        input = input.band(0.0..check.rest_s, "rest");
    }
    section.plot("Input", input);
    // One plot a kind of sensor: joints' positions, joints' speeds, each gyro.
    let mut kinds: Vec<(String, &str)> = Vec::new();
    for channel in &recording.channels {
        let kind = (kind(channel), channel.spec.unit);
        if !kinds.contains(&kind) {
            kinds.push(kind);
        }
    }
    for (title, unit) in kinds {
        let mut plot = LinePlot::new(&time, "time (s)", format!("reading ({unit})")).group("recording");
        for channel in
            recording.channels.iter().filter(|channel| (kind(channel), channel.spec.unit) == (title.clone(), unit))
        {
            plot = plot.series(Series::measured(&channel.spec.name, colour(channel), &channel.values));
        }
        section.plot(title, plot);
    }
    section
}

fn kind(channel: &Channel) -> String {
    match channel.spec.kind {
        ChannelKind::MotorPosition { .. } => "Motor positions".to_owned(),
        ChannelKind::LinkPosition { .. } => "Link positions".to_owned(),
        ChannelKind::MotorSpeed { .. } => "Motor speeds".to_owned(),
        ChannelKind::LinkSpeed { .. } => "Link speeds".to_owned(),
        ChannelKind::GyroAxis { gyro, .. } => format!("Gyro {}", gyro + 1),
    }
}

fn colour(channel: &Channel) -> Colour {
    match channel.spec.kind {
        ChannelKind::GyroAxis { axis, .. } => Colour::Axis(axis),
        ChannelKind::MotorPosition { joint }
        | ChannelKind::LinkPosition { joint }
        | ChannelKind::MotorSpeed { joint }
        | ChannelKind::LinkSpeed { joint } => Colour::Axis(joint),
    }
}

fn rest(check: &Check) -> Section {
    let mut section = Section::new("At rest");
    section.prose(format!("The input is zero for the first {}.", seconds(check.rest_s)));
    let mut table = Table::new()
        .words("channel")
        .words("unit")
        .numbers("mean", "")
        .numbers("sigma", "")
        .numbers("robot file", "")
        .numbers("unrest", "")
        .caption("Unrest: scatter of the means of ten blocks against what white noise gives, which is 1.");
    for rest in &check.rest {
        table.row(
            [
                rest.channel.as_str(),
                rest.unit.as_str(),
                &significant(rest.mean, 4),
                &significant(rest.sigma, 3),
                &significant(rest.sigma_described, 3),
                &significant(rest.unrest, 2),
            ]
            .map(Cell::from),
        );
    }
    section.table(&table);
    section
}

fn timing(check: &Check) -> Section {
    let mut section = Section::new("Ticks");
    let timing = &check.timing;
    let mut table = Table::new().words("quantity").numbers("value", "");
    let mut row = |name: &str, value: String| table.row([Cell::from(name), value.into()]);
    row("rate", format!("{} Hz", significant(timing.rate_hz, 6)));
    row("jitter, rms", format!("{} µs", significant(timing.jitter_us, 3)));
    row("jitter, worst", format!("{} µs", significant(timing.worst_step_us, 3)));
    if let Some(execution_us) = timing.execution_us {
        row("longest computation", format!("{} µs", significant(execution_us, 3)));
    }
    row("overruns", timing.overruns.to_string());
    if let Some(balance) = &check.balance {
        row("samples missing", balance.missing.to_string());
        row("… dropped by the device", balance.device_dropped.to_string());
        row("… dropped by the host", balance.host_dropped.to_string());
        row("… lost on the line", balance.line_lost.to_string());
        row("damaged frames", balance.damaged_frames.to_string());
    }
    section.table(&table);
    section
}
