//! Whether the base model fits, and how far ahead it can see.

use super::words::Names;
use crate::diagnose::Diagnosis;
use crate::report::number::significant;
use crate::report::{Bar, BarChart, Cell, Section, Table, Tone};

/// χ² per degree of freedom within these is what noise of the right size gives: 0.7² and 1.3², as on the page of a calibration.
const RIGHT: std::ops::Range<f64> = 0.49..1.69;

/// Errors of predictions up to so many standard deviations are at the sensor's noise, as for the answer whether the model fits.
const AT_NOISE: f64 = 1.5;

pub(super) fn section(diagnosis: &Diagnosis, names: &Names<'_>) -> Section {
    let fit = &diagnosis.base_fit;
    let mut section = Section::new("Does the base model fit?");
    let (answer, tone) = if fit.fits { ("yes", Tone::Good) } else { ("no", Tone::Bad) };
    section.figures([("does the base model fit?", answer, tone)]);
    let ahead = fit.ahead_500ms_sigma.iter().filter(|ahead| ahead.value.is_finite());
    let bars: Vec<Bar> = ahead
        .map(|ahead| {
            let tone = if ahead.value <= AT_NOISE { Tone::Good } else { Tone::Warning };
            Bar::new(names.channel(&ahead.channel), ahead.value).tone(tone)
        })
        .collect();
    if !bars.is_empty() {
        let chart = BarChart::new("error 500 ms ahead (standard deviations of the sensor)").bars(bars).by_decades();
        section.bars(
            "How far ahead the base model sees",
            &chart.threshold(1.0, "the sensor's noise").caption(
                "Root mean square of the errors of predictions half a second ahead, from past readings only, in standard \
                 deviations of the sensor. No model can be better than 1.",
            ),
        );
    }
    let mut table = Table::new().words("channel").numbers("χ² per degree of freedom", "1 is right");
    let mut is_empty = true;
    for channel in fit.chi2_per_dof.iter().filter(|channel| channel.value.is_finite()) {
        let tone = if RIGHT.contains(&channel.value) { Tone::Good } else { Tone::Warning };
        table.row([names.channel(&channel.channel).into(), Cell::toned(significant(channel.value, 3), tone)]);
        is_empty = false;
    }
    if !is_empty {
        section.heading("Fit of each channel");
        section.table(&table.caption(
            "Of the base calibration, under the noise that it estimated. Well above 1: the model misses something there.",
        ));
    }
    section
}
