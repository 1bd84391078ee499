//! The defect as a curve, what is left over, and the scan of all candidates.

use super::words::{self, Names};
use crate::diagnose::{Candidate, Diagnosis, Picture};
use crate::report::number::{percent, significant};
use crate::report::{Bar, BarChart, Cell, Colour, LinePlot, Section, Series, Table, Tone};

/// Candidates in the chart.
const MOST_BARS: usize = 24;

/// What the base model misses as curves.
pub(super) fn curves(diagnosis: &Diagnosis, names: &Names<'_>) -> Section {
    let mut section = Section::new("What the base model misses, as curves");
    let is_drawable = |picture: &&Picture| picture.at.len() == picture.torque.len() && picture.at.len() > 1;
    let pictures: Vec<&Picture> = diagnosis.curves.iter().filter(is_drawable).collect();
    if pictures.is_empty() {
        section.prose("No curve of one argument predicts blocks that it was not fitted to.");
        return section;
    }
    section.prose(
        "Smooth curves of one argument, estimated from blocks of time beside the base model, whatever the cause is called. \
         The same defect may show in several of them. What the base model has a parameter for is in the base model already.",
    );
    for group in pictures.chunk_by(|a, b| (a.row, &a.argument) == (b.row, &b.argument)) {
        let Some(first) = group.first() else { continue };
        let argument = words::argument(&first.argument);
        section.heading(format!("{}, by {argument}", words::capital(words::equation(first.row))));
        if first.score.is_finite() {
            section.prose(format!("Score out of sample: {}.", significant(first.score, 4)));
        }
        section.beside(|section| group.iter().for_each(|picture| curve(section, picture, &argument, names)));
    }
    section
}

fn curve(section: &mut Section, picture: &Picture, argument: &str, names: &Names<'_>) {
    let ([at], of_argument) = words::scaled([&picture.at], &picture.argument_unit);
    let ([missing], unit) = words::scaled([&picture.torque], &picture.unit);
    let what = match picture.unit.as_str() {
        "N m" => "missing torque",
        "N" => "missing force",
        _ => "error of the reading",
    };
    let plot = LinePlot::new(&at, format!("{argument} ({of_argument})"), format!("{what} ({unit})")).zero_line();
    let joint = names.joint(picture.axis);
    let colour = Colour::Axis(picture.axis.saturating_sub(1));
    section.plot(&joint, plot.series(Series::line(&joint, colour, &missing)));
}

/// What is left and where.
pub(super) fn left(diagnosis: &Diagnosis, names: &Names<'_>) -> Section {
    let mut section = Section::new("What is left over");
    let left = &diagnosis.unexplained;
    if left.excess.is_finite() {
        section.prose(format!(
            "With all causes in the model, the best curve still explains {} of what the base model left unexplained.",
            percent(left.excess)
        ));
    }
    if let Some(still) = words::still_missed(diagnosis, names) {
        section.prose(still);
    }
    if let Some(next) = words::next_motion(diagnosis, "DIAG.json") {
        section.prose(next);
    }
    if left.places.is_empty() {
        section.prose("No curve of one argument explains enough of it to name its place.");
    } else {
        section.prose("Where it is. The same misfit may follow several arguments, so that shares do not add up:");
        section.list(left.places.iter().map(|defect| {
            let share = words::share(defect.share, None).map_or_else(String::new, |share| format!(": {share}"));
            format!("{}{share}", words::capital(&names.place(defect)))
        }));
    }
    section
}

/// Every candidate, and what could not be tested.
pub(super) fn scan(diagnosis: &Diagnosis, names: &Names<'_>) -> Section {
    let mut section = Section::new("All candidates");
    section.prose(
        "The score test of every law of the catalogue on the base model: twice the log-likelihood that it promises on the data \
         of its fit, and on blocks by what the other blocks say. It chooses what is refitted; the refits decide.",
    );
    let tone = |candidate: &Candidate| {
        if diagnosis.findings.iter().any(|finding| finding.effect == candidate.effect) {
            Tone::Good
        } else if candidate.p_value < diagnosis.threshold_p {
            Tone::Warning
        } else {
            Tone::Muted
        }
    };
    let gaining: Vec<Bar> = diagnosis
        .scan
        .iter()
        .filter(|candidate| candidate.cv_score > 0.0)
        .take(MOST_BARS)
        .map(|candidate| Bar::new(words::title(&candidate.effect), candidate.cv_score).tone(tone(candidate)))
        .collect();
    if !gaining.is_empty() {
        let chart = BarChart::new("score out of sample").bars(gaining).by_decades();
        section.bars(
            "Candidates that gain out of sample",
            &chart.caption(format!(
                "Green: a cause. Orange: noise would bring any candidate this far in less than {} of recordings. Grey: no more \
                 than noise.",
                percent(diagnosis.threshold_p)
            )),
        );
    }
    if !diagnosis.scan.is_empty() {
        let mut table = Table::new()
            .words("candidate")
            .numbers("score", "out of sample")
            .numbers("score", "")
            .numbers("p", "")
            .numbers("variance inflation", "by the base model");
        let number = |value: f64, digits: usize| {
            if value.is_finite() { significant(value, digits) } else { String::new() }
        };
        for candidate in &diagnosis.scan {
            table.row([
                names.law(&candidate.effect, &candidate.axes).into(),
                Cell::toned(number(candidate.cv_score, 4), tone(candidate)),
                number(candidate.score, 4).into(),
                number(candidate.p_value, 2).into(),
                candidate.vif.map_or_else(String::new, |vif| number(vif, 3)).into(),
            ]);
        }
        section.table(&table);
    }
    if !diagnosis.not_testable.is_empty() {
        section.heading("Not testable on this robot");
        section.list(diagnosis.not_testable.iter().map(|entry| {
            let why = entry.why.strip_prefix(&format!("effect {}: ", entry.effect)).unwrap_or(&entry.why);
            format!("{}: {why}", words::capital(&words::title(&entry.effect)))
        }));
    }
    section
}
