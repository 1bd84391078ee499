//! Measured against predicted on the motion that no fit has seen, before and after.

use super::causes::{tone, tone_of};
use super::words::{self, Names};
use crate::diagnose::{ChannelGain, Diagnosis, HoldoutGain, OverTime, Stretch};
use crate::report::number::{percent, seconds, significant};
use crate::report::{Bar, BarChart, Cell, Colour, LinePlot, Section, Series, Table};

/// Length of a worst moment, s.
const MOMENT_S: f64 = 1.0;
/// How many of them are drawn.
const MOMENTS: usize = 3;
/// The horizon of the predictions that are drawn, s.
const SHOWN_S: f64 = 0.5;

pub(super) fn section(diagnosis: &Diagnosis, names: &Names<'_>) -> Section {
    let mut section = Section::new("Predictions before and after, on the other motion");
    let Some(all) = &diagnosis.holdout_gain else {
        section.prose(if diagnosis.findings.is_empty() {
            "Nothing was added to the model, so predictions stay as they are."
        } else {
            "The other motion could not be predicted."
        });
        return section;
    };
    section.prose(format!(
        "Both models predict the same windows of {}, which no fit has seen, each from a state that only past readings give. \
         The base model is before, the model with all causes is after.",
        words::other_motion(diagnosis)
    ));
    horizons(&mut section, all);
    if let Some(finding) = diagnosis.findings.first() {
        sensors(&mut section, &finding.gain, names);
    }
    let shown: Vec<&OverTime> = all.over_time.iter().filter(|over_time| over_time.is_complete()).collect();
    if !shown.is_empty() {
        section.heading("Over time, 500 ms ahead");
        section.prose(
            "What was measured at each time, and what both models predicted for it half a second before. Bands 1 to 3 are the \
             seconds in which the base model is worst.",
        );
    }
    for over_time in shown {
        channel(&mut section, over_time, names);
    }
    section
}

/// The joint gain of all sensors.
fn horizons(section: &mut Section, all: &HoldoutGain) {
    let figure = words::error_change(all.share, all.ci95);
    section.figures(figure.map(|value| ("all sensors, horizons up to 500 ms", value, tone(&all.joint()))));
    let bars: Vec<Bar> = all
        .by_horizon
        .iter()
        .filter(|horizon| horizon.share.is_finite())
        .map(|horizon| {
            let bar =
                Bar::new(format!("{} ahead", seconds(horizon.horizon_s)), horizon.share).tone(tone(&horizon.gain()));
            horizon.ci95.map_or(bar.clone(), |[low, high]| bar.interval(low, high))
        })
        .collect();
    if !bars.is_empty() {
        let chart = BarChart::new("share of the error that is gone").bars(bars).in_percent();
        section.bars(
            "All sensors together, by how far ahead",
            &chart.caption("Whiskers are 95 % intervals between blocks of time."),
        );
    }
}

/// The gain of each sensor.
fn sensors(section: &mut Section, gains: &[ChannelGain], names: &Names<'_>) {
    let known: Vec<&ChannelGain> = gains.iter().filter(|entry| entry.gain.is_finite()).collect();
    let bars: Vec<Bar> = known
        .iter()
        .filter(|entry| entry.horizon_s == SHOWN_S)
        .map(|entry| {
            let bar = Bar::new(names.channel(&entry.channel), entry.gain).tone(tone_of(entry.ci95));
            entry.ci95.map_or(bar.clone(), |[low, high]| bar.interval(low, high))
        })
        .collect();
    if !bars.is_empty() {
        section.bars(
            "Each sensor, 500 ms ahead",
            &BarChart::new("share of the error that is gone").bars(bars).in_percent(),
        );
    }
    if known.is_empty() {
        return;
    }
    let mut table = Table::new()
        .words("sensor")
        .numbers("ahead", "")
        .numbers("gain", "95 % interval")
        .numbers("before", "RMS error")
        .numbers("after", "RMS error");
    for entry in known {
        let [before, after] = words::in_unit([entry.rmse_base, entry.rmse_extended], names.unit(&entry.channel));
        let gain = words::share(entry.gain, entry.ci95).unwrap_or_default();
        table.row([
            names.channel(&entry.channel).into(),
            seconds(entry.horizon_s).into(),
            Cell::toned(gain, tone_of(entry.ci95)),
            before.into(),
            after.into(),
        ]);
    }
    section.table(&table);
}

/// One channel: the whole motion, errors, the worst moments.
fn channel(section: &mut Section, over_time: &OverTime, names: &Names<'_>) {
    let OverTime { channel, unit, t_s, .. } = over_time;
    let name = names.channel(channel);
    let worst = over_time.worst(MOMENT_S, MOMENTS);
    let (values, of_values) = words::scaled([&over_time.measured, &over_time.base, &over_time.extended], unit);
    let [base, extended] = over_time.errors();
    let ([base, extended], of_errors) = words::scaled([&base, &extended], unit);
    let whole = LinePlot::new(t_s, "time (s)", format!("{channel} ({of_values})")).group(channel);
    let whole = three(whole, &values, 0..t_s.len());
    section.plot(&name, with_bands(whole, &worst));
    let error = LinePlot::new(t_s, "time (s)", format!("error ({of_errors})"))
        .group(channel)
        .zero_line()
        .height_px(180)
        .series(Series::line("before", Colour::Before, &base))
        .series(Series::line("after", Colour::After, &extended));
    section.plot(format!("{name}: predicted less measured"), with_bands(error, &worst));
    if worst.is_empty() {
        return;
    }
    section.beside(|section| {
        for (place, stretch) in worst.iter().enumerate() {
            let readings = stretch.readings.clone();
            let plot =
                LinePlot::new(&t_s[readings.clone()], "time (s)", format!("{channel} ({of_values})")).height_px(180);
            let title = format!("{}: {}", place + 1, moment(stretch, unit));
            section.plot(title, three(plot, &values, readings));
        }
    });
}

/// The worst moments behind the curves, by their numbers.
fn with_bands<'a>(mut plot: LinePlot<'a>, worst: &[Stretch]) -> LinePlot<'a> {
    let mut bands: Vec<(usize, &Stretch)> = worst.iter().enumerate().collect();
    bands.sort_by(|(_, a), (_, b)| a.from_s.total_cmp(&b.from_s));
    for (place, stretch) in bands {
        plot = plot.band(stretch.from_s..stretch.to_s, (place + 1).to_string());
    }
    plot
}

/// Measured, before and after.
fn three<'a>(plot: LinePlot<'a>, values: &'a [Vec<f64>; 3], readings: std::ops::Range<usize>) -> LinePlot<'a> {
    plot.series(Series::measured("measured", Colour::Neutral, &values[0][readings.clone()]))
        .series(Series::line("before", Colour::Before, &values[1][readings.clone()]))
        .series(Series::line("after", Colour::After, &values[2][readings]))
}

/// A worst moment with its errors in numbers.
fn moment(stretch: &Stretch, unit: &str) -> String {
    let [before, after] = words::in_unit([stretch.rmse_base, stretch.rmse_extended], unit);
    let times = format!("{} … {} s", significant(stretch.from_s, 3), significant(stretch.to_s, 3));
    let change = match stretch.gain() {
        gain if !gain.is_finite() => String::new(),
        gain if gain < 0.0 => format!(" ({} more)", percent(-gain)),
        gain => format!(" ({} less)", percent(gain)),
    };
    format!("{times}: RMS error {before} before, {after} after{change}")
}
