//! The page of `host observe`: estimates, innovations, the watchdog.

use super::number::significant;
use super::{Cell, Colour, LinePlot, Page, Section, Series, Table, Tone};
use crate::observe::{Consistency, Estimates, Observation, Status};

/// Innovations are averaged over this time, s.
const AVERAGED_S: f64 = 0.1;

/// The whole page.
pub fn page(observation: &Observation, estimates: &Estimates) -> Page {
    let used = &observation.recording;
    let name = used.path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
    let mut page = Page::new(format!("Observer of {} on {name}", observation.robot))
        .lead(verdict(observation))
        .fact("recording", format!("{}, SHA-256 {}", used.path.display(), used.sha256))
        .fact("length", format!("{} samples in {:.1} s, {} gaps", used.samples, used.duration_s, used.gaps))
        .fact("role", if used.calibrated_on { "the model was calibrated on it" } else { "not used in the calibration" })
        .fact("read", observation.sensors.clone());
    page.push(consistency(observation, estimates));
    page.push(states(observation, estimates));
    page
}

fn verdict(observation: &Observation) -> String {
    let innovations = match &observation.nis {
        Some(nis) => format!("Innovations are {} of what the filter says", significant(nis.mean_per_dof, 3)),
        None => "The robot did not move".to_owned(),
    };
    let innovations = match observation.status {
        Status::Consistent => format!("The filter is consistent. {innovations}"),
        Status::TooSure => format!("The filter is not consistent, do not use its estimates. {innovations}"),
        Status::TooCareful => {
            format!("The filter is not consistent, its errors are smaller than it says. {innovations}")
        }
        Status::NoMotion => format!("Whether the filter is consistent is not known. {innovations}"),
    };
    match observation.events.first() {
        Some(event) => format!("{innovations}. At {:.3} s the robot stopped behaving like its model.", event.t_s),
        None => format!("{innovations}. The watchdog raised no event."),
    }
}

fn consistency(observation: &Observation, estimates: &Estimates) -> Section {
    let mut section = Section::new("Is the filter right about its errors?");
    section.prose(
        "Squares of innovations and of true errors, over what the filter says they should be: 1 on average, and 95 % of ticks within the central 95 % of their distribution.",
    );
    let mut table = Table::new().words("").numbers("mean", "").numbers("within 95 %", "").numbers("ticks", "");
    let mut row = |name: &str, found: &Option<Consistency>| {
        if let Some(found) = found {
            table.row([
                Cell::toned(name, Tone::Plain),
                significant(found.mean_per_dof, 4).as_str().into(),
                format!("{:.1} %", 100.0 * found.within_95).as_str().into(),
                found.ticks.to_string().as_str().into(),
            ]);
        }
    };
    row("innovations (NIS) in motion", &observation.nis);
    row("true errors (NEES)", &observation.nees);
    section.table(&table);
    let (t_s, nis) = averaged(&estimates.t_s, &estimates.nis_per_reading);
    let plot = LinePlot::new(&t_s, "time (s)", "NIS per reading (1)").group("time");
    section.plot("Innovations", plot.series(Series::line("mean of 0.1 s", Colour::Neutral, &nis)));
    let plot = LinePlot::new(&estimates.t_s, "time (s)", "level (1)").group("time");
    section.plot("Watchdog", plot.series(Series::line("1 raises an event", Colour::Neutral, &estimates.level)));
    section
}

/// Means over [`AVERAGED_S`].
fn averaged(t_s: &[f64], values: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let (mut times, mut means) = (Vec::new(), Vec::new());
    let mut from = 0;
    while from < t_s.len() {
        let count = t_s[from..].partition_point(|t| *t < t_s[from] + AVERAGED_S).max(1);
        let valid: Vec<f64> = values[from..from + count].iter().copied().filter(|value| value.is_finite()).collect();
        times.push(t_s[from]);
        means.push(valid.iter().sum::<f64>() / valid.len() as f64);
        from += count;
    }
    (times, means)
}

fn number(value: Option<f64>, digits: usize) -> Cell {
    value.map_or_else(|| "–".to_owned(), |value| significant(value, digits)).as_str().into()
}

fn states(observation: &Observation, estimates: &Estimates) -> Section {
    let mut section = Section::new("Estimates");
    let mut table = Table::new()
        .words("state")
        .words("unit")
        .numbers("at the end", "")
        .numbers("± sigma", "")
        .numbers("median sigma", "");
    for state in &observation.states {
        table.row([
            state.name.as_str().into(),
            state.unit.as_str().into(),
            number(state.last, 5),
            number(state.last_sigma, 3),
            number(state.median_sigma, 3),
        ]);
    }
    section.table(&table);
    for (state, values) in observation.states.iter().zip(&estimates.states) {
        let plot = LinePlot::new(&estimates.t_s, "time (s)", format!("{} ({})", state.name, state.unit)).group("time");
        section.plot(&state.name, plot.series(Series::line(&state.name, Colour::Neutral, values)));
    }
    section
}
