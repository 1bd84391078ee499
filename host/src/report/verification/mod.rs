//! The page of `host verify`: the windowed predictions, and the paper's Figures 3 to 8 for any robot and motion.

mod curves;

use super::number::{percent, seconds, significant};
use super::{Bar, BarChart, Cell, Page, Section, Table, Tone};
use crate::recording::Recording;
use crate::verify::{ChannelError, Traces, Verification};

/// An error up to this many sigmas is the sensor's noise and no more.
const AS_GOOD_AS_NOISE: f64 = 1.10;
/// Up to here the model is close; above it something is missing.
const CLOSE: f64 = 2.0;

/// The horizon that the first sentence speaks of, s.
const HEADLINE_S: f64 = 0.1;

/// The whole page.
pub fn page(verification: &Verification, recording: &Recording, traces: &Traces) -> Page {
    let used = &verification.recording;
    let name = used.path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
    let mut page = Page::new(format!("Verification of {} on {name}", verification.robot)).lead(verdict(verification));
    page = page
        .fact("recording", format!("{}, SHA-256 {}", used.path.display(), short(&used.sha256)))
        .fact(
            "length",
            format!(
                "{} samples in {:.1} s, {} ticks missing in {} gaps",
                used.samples, used.duration_s, used.missing_ticks, used.gaps
            ),
        )
        .fact("role", if used.calibrated_on { "the model was calibrated on it" } else { "not used in the calibration" })
        .fact("model", model(verification));
    for section in sections(verification, recording, traces) {
        page.push(section);
    }
    page
}

/// The sections of the page, for pages that hold more (the demo's).
pub fn sections(verification: &Verification, recording: &Recording, traces: &Traces) -> Vec<Section> {
    let mut sections = vec![windows(verification), curves::motion(recording, traces)];
    sections.extend(curves::disturbed_gyro(recording, traces));
    sections.push(curves::free_run(verification, recording, traces));
    sections
}

fn verdict(verification: &Verification) -> String {
    let Some(worst) = verification.horizon(HEADLINE_S).and_then(|h| h.worst()) else {
        return "No stretch of the recording is long enough without a gap to predict 100 ms ahead.".into();
    };
    let (name, sigmas) = (&worst.channel, significant(worst.rmse_sigma, 3));
    if worst.rmse_sigma <= AS_GOOD_AS_NOISE {
        format!(
            "The model predicts every sensor 100 ms ahead as well as the sensor itself can tell: at worst {sigmas} times its noise ({name})."
        )
    } else if worst.rmse_sigma <= CLOSE {
        format!("The model predicts 100 ms ahead closely: at worst {sigmas} times the sensor's noise ({name}).")
    } else {
        format!("The model misses something: 100 ms ahead {name} is off by {sigmas} times the sensor's noise.")
    }
}

fn model(verification: &Verification) -> String {
    let preset = match verification.preset {
        crate::calibrate::Preset::Default => "Runge–Kutta steps (preset default)",
        crate::calibrate::Preset::Paper => "Euler steps (preset paper)",
    };
    if verification.extensions.is_empty() {
        format!("base model, {preset}")
    } else {
        format!("base model with {}, {preset}", verification.extensions.join(", "))
    }
}

fn short(sha256: &str) -> &str {
    sha256.get(..12).unwrap_or(sha256)
}

fn tone(rmse_sigma: f64) -> Tone {
    match rmse_sigma {
        r if r <= AS_GOOD_AS_NOISE => Tone::Good,
        r if r <= CLOSE => Tone::Plain,
        r if r <= 5.0 => Tone::Warning,
        _ => Tone::Bad,
    }
}

fn windows(verification: &Verification) -> Section {
    let mut section = Section::new("How far ahead the model can see");
    section.prose(
        "From a state that only past readings give (a Kalman filter running forward), the model alone continues with \
         the recorded input; at the end of the window it is compared with the sensor. The unit is the sensor's own \
         noise σ: 1 means that the sensor could not tell the model from the robot.",
    );
    let figure = |horizon: &crate::verify::HorizonResult| {
        let worst = horizon.worst()?;
        let value = format!("{} σ", significant(worst.rmse_sigma, 3));
        Some((
            format!("{} ahead, worst channel: {}", seconds(horizon.horizon_s), worst.channel),
            value,
            tone(worst.rmse_sigma),
        ))
    };
    section.figures(verification.horizons.iter().filter_map(figure));

    let mut table = Table::new().words("channel").numbers("sensor noise σ", "");
    for horizon in &verification.horizons {
        let ahead = seconds(horizon.horizon_s);
        table = table.numbers(format!("{ahead} ahead"), "σ");
    }
    let counts: Vec<String> = verification
        .horizons
        .iter()
        .map(|h| {
            let left_out = match h.touching_gap {
                0 => String::new(),
                n => format!(" ({n} more touch a gap and are left out)"),
            };
            format!("{}: {} windows{left_out}", seconds(h.horizon_s), h.windows)
        })
        .collect();
    table = table.caption(format!(
        "Root mean square error at the window's end over the sensor's noise σ. {}.",
        counts.join(", ")
    ));
    let first = verification.horizons.first().map_or(&[][..], |h| &h.channels);
    for (i, channel) in first.iter().enumerate() {
        let noise = channel.rmse / channel.rmse_sigma;
        let mut row: Vec<Cell> =
            vec![channel.channel.as_str().into(), format!("{} {}", significant(noise, 3), channel.unit).into()];
        for error in verification.horizons.iter().filter_map(|h| h.channels.get(i)) {
            row.push(Cell::toned(significant(error.rmse_sigma, 3), tone(error.rmse_sigma)));
        }
        table.row(row);
    }
    section.table(&table);
    if let Some(headline) = verification.horizon(HEADLINE_S) {
        let bar = |c: &ChannelError| Bar::new(&c.channel, c.rmse_sigma).tone(tone(c.rmse_sigma));
        section.bars(
            format!("Error {} ahead", seconds(HEADLINE_S)),
            &BarChart::new("RMSE (σ of the sensor)")
                .bars(headline.channels.iter().map(bar))
                .threshold(1.0, "the sensor's noise alone"),
        );
    }
    section.table(&in_units(verification));
    section.prose(format!(
        "The filter took the model to be off by {} rad/s a tick in each velocity, the value under which the readings \
         are most likely; its normalised innovation squared is {} (1 if it knows its own uncertainty).",
        significant(verification.filter.velocity_sigma, 2),
        significant(verification.filter.mean_nis, 4)
    ));
    section
}

/// The same errors in the channels' units and as shares of the signal.
fn in_units(verification: &Verification) -> Table {
    let mut table = Table::new().words("channel").words("unit");
    for horizon in &verification.horizons {
        let ahead = seconds(horizon.horizon_s);
        table = table.numbers(format!("{ahead} ahead"), "unit").numbers("", "of the signal");
    }
    let first = verification.horizons.first().map_or(&[][..], |h| &h.channels);
    for (i, channel) in first.iter().enumerate() {
        let mut row: Vec<Cell> = vec![channel.channel.as_str().into(), channel.unit.as_str().into()];
        for error in verification.horizons.iter().filter_map(|h| h.channels.get(i)) {
            row.push(significant(error.rmse, 3).into());
            row.push(percent(error.nrmse).into());
        }
        table.row(row);
    }
    table
        .caption("The same error in the channel's unit, and as a share of the standard deviation of what was measured.")
}
