//! Measured and predicted curves: the paper's Figures 3 to 8.

use std::ops::Range;

use super::CLOSE;
use crate::recording::Recording;
use crate::report::number::{percent, significant};
use crate::report::{Cell, Colour, LinePlot, Section, Series, Table, Tone};
use crate::robot::ChannelKind;
use crate::verify::stage::{Stage, StageKind};
use crate::verify::{ChannelError, FirstState, Traces, Verification};

/// Points of a plot of one stage; there are many of them.
const STAGE_BUDGET: usize = 1500;
/// Width of the zoom window, s.
const ZOOM_S: f64 = 1.0;

/// The paper's Figure 3.
pub(super) fn motion(recording: &Recording, traces: &Traces) -> Section {
    let mut section = Section::new("The motion");
    section
        .prose("What the motors were told and how they moved, with the stages of the motion (the paper's Figure 3).");
    let unit = if recording.robot.input.unit == crate::robot::InputUnit::Duty { "duty (1 = full)" } else { "input" };
    let mut duty = LinePlot::new(&traces.t_s, "time (s)", unit).group("motion").height_px(200);
    for (joint, u) in recording.duty.iter().enumerate() {
        duty = duty.series(Series::held(&recording.robot.joints[joint].name, Colour::Axis(joint), u));
    }
    section.plot("Input", with_bands(duty, traces));
    for PositionGroup { title, symbol, channels } in position_groups(recording) {
        let columns: Vec<(usize, Vec<f64>)> = channels
            .iter()
            .map(|&(joint, c)| (joint, broken(&recording.channels[c].values, 0..recording.len(), traces)))
            .collect();
        let unit = recording.channels[channels[0].1].spec.unit;
        let mut plot = LinePlot::new(&traces.t_s, "time (s)", format!("{symbol} ({unit})")).group("motion");
        for (joint, values) in &columns {
            plot = plot.series(Series::line(&recording.robot.joints[*joint].name, Colour::Axis(*joint), values));
        }
        section.plot(title, with_bands(plot, traces));
    }
    section
}

fn with_bands<'a>(mut plot: LinePlot<'a>, traces: &Traces) -> LinePlot<'a> {
    for stage in &traces.stages {
        plot = plot.band(span(stage, traces), &stage.label);
    }
    plot
}

/// The position channels of one side of the transmissions.
struct PositionGroup {
    title: &'static str,
    symbol: &'static str,
    /// (joint, channel).
    channels: Vec<(usize, usize)>,
}

fn position_groups(recording: &Recording) -> Vec<PositionGroup> {
    let of = |pick: fn(ChannelKind) -> Option<usize>| -> Vec<(usize, usize)> {
        let channels = recording.channels.iter().enumerate();
        channels.filter_map(|(c, channel)| pick(channel.spec.kind).map(|joint| (joint, c))).collect()
    };
    let motor = of(|kind| if let ChannelKind::MotorPosition { joint } = kind { Some(joint) } else { None });
    let link = of(|kind| if let ChannelKind::LinkPosition { joint } = kind { Some(joint) } else { None });
    [("Motor position", "θ", motor), ("Link position", "q", link)]
        .into_iter()
        .filter(|(.., channels)| !channels.is_empty())
        .map(|(title, symbol, channels)| PositionGroup { title, symbol, channels })
        .collect()
}

/// The paper's Figure 4: axes of the first gyro that should read nothing while only later joints move.
pub(super) fn disturbed_gyro(recording: &Recording, traces: &Traces) -> Option<Section> {
    let gyro = recording.robot.gyros().next()?;
    let beyond: Vec<&Stage> = traces
        .stages
        .iter()
        .filter(|s| s.kind != StageKind::Rest && !s.joints.is_empty() && s.joints.iter().all(|&j| j > gyro.body))
        .collect();
    let samples = beyond.first()?.samples.start..beyond.last()?.samples.end;
    let still = |predicted: &[f64], sigma: f64| {
        let valid = || predicted[samples.clone()].iter().copied().filter(|v| v.is_finite());
        let (low, high) = valid().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        high - low < 40.0 * sigma
    };
    let axes: Vec<(usize, usize)> = recording
        .channels
        .iter()
        .enumerate()
        .filter_map(|(c, channel)| match channel.spec.kind {
            ChannelKind::GyroAxis { gyro: 0, axis, .. } if still(&traces.predicted[c], channel.spec.sigma) => {
                Some((axis, c))
            }
            _ => None,
        })
        .collect();
    if axes.is_empty() {
        return None;
    }
    let joints: Vec<&str> = {
        let mut moving: Vec<usize> = beyond.iter().flat_map(|s| s.joints.iter().copied()).collect();
        moving.sort_unstable();
        moving.dedup();
        moving.into_iter().map(|j| recording.robot.joints[j].name.as_str()).collect()
    };
    let mut section = Section::new("Does the base give way?");
    section.prose(format!(
        "While only {} move, these axes of gyro 1 should read their bias and nothing else. A swing here that the model \
         does not have means that the base tilts (the paper's Figure 4).",
        joints.join(" and ")
    ));
    let t = &traces.t_s[samples.clone()];
    let columns: Vec<_> = axes
        .iter()
        .map(|&(axis, c)| {
            let measured = broken(&recording.channels[c].values, samples.clone(), traces);
            (axis, c, measured, broken(&traces.predicted[c], samples.clone(), traces))
        })
        .collect();
    let mut plot = LinePlot::new(t, "time (s)", "rate (rad/s)").zoom(traces.busiest(samples.clone(), ZOOM_S));
    for (axis, c, measured, predicted) in &columns {
        let name = &recording.channels[*c].spec.name;
        plot = plot
            .series(Series::measured(format!("{name} measured"), Colour::Axis(*axis), measured))
            .series(Series::line(format!("{name} predicted"), Colour::Axis(*axis), predicted));
    }
    for stage in &beyond {
        plot = plot.band(span(stage, traces), &stage.label);
    }
    section.plot("Gyro 1 across the axis that carries it", plot);
    Some(section)
}

/// The paper's Figures 5 to 8.
pub(super) fn free_run(verification: &Verification, recording: &Recording, traces: &Traces) -> Section {
    let run = &verification.free_run;
    let mut section = Section::new("Free run, stage by stage");
    let first = match run.first_state {
        FirstState::Calibrated => "the first state that the calibration estimated",
        FirstState::Rest => "the robot at rest before its first move",
        FirstState::Filter => "the filter's first settled state",
    };
    section.prose(format!(
        "The model starts from {first} and runs over the whole recording with the recorded input; no reading corrects \
         it (the paper's 5.2, Figures 5 to 8). Wide and pale: measured. Thin: predicted. Positions may drift, since \
         small errors of friction add up; speeds should not."
    ));
    if run.pieces > 1 || run.left_out > 0 {
        section.note(
            Tone::Warning,
            format!(
                "Ticks are missing, and with them the input: the run starts again after each gap from what the filter \
                 knows there. It falls into {} pieces; {} samples are not predicted.",
                run.pieces, run.left_out
            ),
        );
    }
    section.table(&stage_table(verification));
    for (number, stage) in traces.stages.iter().enumerate().filter(|(_, s)| s.kind != StageKind::Rest) {
        let range = span(stage, traces);
        section.heading(format!(
            "{} ({:.1} to {:.1} s, |input| up to {})",
            capital(&stage.label),
            range.start,
            range.end,
            significant(stage.peak_input, 2)
        ));
        stage_plots(&mut section, &format!("stage {number}"), stage, recording, traces);
    }
    section
}

fn stage_table(verification: &Verification) -> Table {
    let run = &verification.free_run;
    let mut table = Table::new().words("stage").numbers("from", "s").numbers("to", "s");
    for channel in &run.channels {
        table = table.numbers(&channel.channel, "%");
    }
    let errors = |channels: &[ChannelError]| -> Vec<Cell> {
        let cell = |c: &ChannelError| {
            let tone = if c.rmse_sigma <= CLOSE { Tone::Muted } else { Tone::Plain };
            Cell::toned(percent(c.nrmse).trim_end_matches(" %"), tone)
        };
        channels.iter().map(cell).collect()
    };
    for stage in run.stages.iter().filter(|s| s.kind != StageKind::Rest) {
        let span = [format!("{:.1}", stage.from_s), format!("{:.1}", stage.to_s)];
        let mut row: Vec<Cell> = vec![stage.label.as_str().into()];
        row.extend(span.map(Cell::from));
        row.extend(errors(&stage.channels));
        table.row(row);
    }
    let mut whole: Vec<Cell> = vec!["whole recording".into(), "".into(), "".into()];
    whole.extend(errors(&run.channels));
    table.row(whole);
    table.caption("Root mean square error of the free run as a share of the standard deviation of what was measured in that stage. Pale: within twice the sensor's noise, however large a share of a signal that hardly moves.")
}

/// Motor position, motor velocity, then the gyros from the outermost inwards, as the paper stacks them; then what else there is.
fn stage_plots(section: &mut Section, group: &str, stage: &Stage, recording: &Recording, traces: &Traces) {
    let samples = stage.samples.clone();
    let t = &traces.t_s[samples.clone()];
    let zoom = traces.busiest(samples.clone(), ZOOM_S);
    let names: Vec<&str> = recording.robot.joints.iter().map(|j| j.name.as_str()).collect();
    let mut draw = |title: String, y_label: String, curves: Vec<Curve<'_>>| {
        let cut: Vec<_> = curves
            .into_iter()
            .map(|c| {
                let measured = c.measured.map(|m| broken(m, samples.clone(), traces));
                (c.name, c.colour, measured, broken(c.predicted, samples.clone(), traces))
            })
            .collect();
        let mut plot =
            LinePlot::new(t, "time (s)", y_label).group(group).zoom(zoom.clone()).budget(STAGE_BUDGET).height_px(180);
        for (name, colour, measured, predicted) in &cut {
            if let Some(measured) = measured {
                plot = plot.series(Series::measured(format!("{name} measured"), *colour, measured));
            }
            plot = plot.series(Series::line(format!("{name} predicted"), *colour, predicted));
        }
        section.plot(title, plot);
    };
    let channel = |joint: usize, c: usize| Curve {
        name: names[joint],
        colour: Colour::Axis(joint),
        measured: Some(&recording.channels[c].values),
        predicted: &traces.predicted[c],
    };
    for PositionGroup { title, symbol, channels } in position_groups(recording) {
        let unit = recording.channels[channels[0].1].spec.unit;
        let curves = channels.iter().map(|&(joint, c)| channel(joint, c)).collect();
        draw(title.into(), format!("{symbol} ({unit})"), curves);
    }
    let speeds = (0..names.len()).map(|joint| Curve {
        name: names[joint],
        colour: Colour::Axis(joint),
        measured: Some(traces.measured_motor_speed[joint].as_slice()).filter(|m| !m.is_empty()),
        predicted: &traces.motor_speed[joint],
    });
    draw("Motor velocity (measured: slope of the encoder over ±10 ms)".into(), "θ̇ (rad/s)".into(), speeds.collect());
    for gyro in (0..recording.robot.gyros().count()).rev() {
        let axes = recording.channels.iter().enumerate().filter_map(|(c, channel)| match channel.spec.kind {
            ChannelKind::GyroAxis { gyro: g, axis, .. } if g == gyro => Some(Curve {
                name: ["x", "y", "z"][axis],
                colour: Colour::Axis(axis),
                measured: Some(&channel.values),
                predicted: &traces.predicted[c],
            }),
            _ => None,
        });
        draw(format!("Gyro {}", gyro + 1), "rate (rad/s)".into(), axes.collect());
    }
    let tachometers: Vec<Curve<'_>> = recording
        .channels
        .iter()
        .enumerate()
        .filter_map(|(c, spec)| match spec.spec.kind {
            ChannelKind::MotorSpeed { joint } | ChannelKind::LinkSpeed { joint } => Some(channel(joint, c)),
            _ => None,
        })
        .collect();
    if !tachometers.is_empty() {
        draw("Tachometers".into(), "speed (rad/s)".into(), tachometers);
    }
}

/// One quantity, measured and predicted.
struct Curve<'a> {
    name: &'a str,
    colour: Colour,
    measured: Option<&'a [f64]>,
    predicted: &'a [f64],
}

/// A copy whose first value after each gap is NaN, so that no line is drawn across.
fn broken(values: &[f64], samples: Range<usize>, traces: &Traces) -> Vec<f64> {
    let mut copy = values[samples.clone()].to_vec();
    for &k in traces.breaks.iter().filter(|k| samples.contains(k)) {
        copy[k - samples.start] = f64::NAN;
    }
    copy
}

fn span(stage: &Stage, traces: &Traces) -> Range<f64> {
    traces.t_s[stage.samples.start]..traces.t_s[stage.samples.end - 1]
}

fn capital(text: &str) -> String {
    let mut chars = text.chars();
    chars.next().map_or_else(String::new, |first| first.to_uppercase().chain(chars).collect())
}
