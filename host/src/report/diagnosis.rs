//! The page of `host diagnose`: verdict, findings, scan, defect, gain, parameters before and after, what is left.

use super::number::{percent, seconds, significant, with_error};
use super::{Bar, BarChart, Cell, Colour, LinePlot, Page, Section, Series, Table, Tone, calibration};
use crate::diagnose::{Diagnosis, Verdict};
use crate::effect::Effect;

/// Candidates in the chart.
const MOST_BARS: usize = 24;

/// The whole page.
pub fn page(diagnosis: &Diagnosis) -> Page {
    let mut page =
        Page::new(format!("What the model of {} gets wrong", diagnosis.base.robot)).lead(diagnosis.summary.as_str());
    for used in &diagnosis.base.recordings {
        page = page.fact("recording", format!("{}: {} samples", used.path, used.samples));
    }
    let holdout = diagnosis.holdout.clone();
    page = page.fact("gain measured on", holdout.unwrap_or_else(|| "the last third, which no fit has seen".into()));
    for section in sections(diagnosis) {
        page.push(section);
    }
    page.push(parameters(diagnosis));
    page.push(calibration::fit(&diagnosis.extended));
    page
}

/// What was found, what it brings, the defect as a curve, the scan and what is left.
pub(super) fn sections(diagnosis: &Diagnosis) -> Vec<Section> {
    vec![findings(diagnosis), gain(diagnosis), defect(diagnosis), scan(diagnosis), left(diagnosis)]
}

fn findings(diagnosis: &Diagnosis) -> Section {
    let mut section = Section::new("What was found");
    if diagnosis.findings.is_empty() {
        section.prose(match diagnosis.verdict {
            Verdict::None => "No law of the catalogue and no smooth curve explains more than noise would.",
            _ => "No law of the catalogue holds its own against a curve without a shape: see the picture below.",
        });
    }
    for finding in &diagnosis.findings {
        let effect = Effect::by_id(&finding.effect).ok();
        section.heading(effect.map_or(finding.effect.as_str(), |effect| effect.title));
        if let Some(effect) = effect {
            section.prose(effect.about);
            section.prose(effect.equation);
        }
        section.figures([
            ("share of what was unexplained", percent(finding.explained_excess), Tone::Good),
            ("twice the log-likelihood gained", significant(finding.score, 4), Tone::Plain),
            ("chance that noise does this", format!("{:.1e}", finding.p_value), Tone::Plain),
        ]);
        let mut table = Table::new().words("parameter").words("unit").numbers("estimate", "± standard error");
        for p in &finding.parameters {
            table.row([p.name.as_str().into(), p.unit.as_str().into(), with_error(p.estimate, p.std_error).into()]);
        }
        section.table(&table);
        if !finding.aliases.is_empty() {
            section.note(
                Tone::Warning,
                format!("This motion cannot tell it from {}: the fits are as good.", finding.aliases.join(", ")),
            );
        }
        if !finding.shape_final {
            section.note(
                Tone::Warning,
                "A curve on the same equation still explains more: the law's shape is not the last word.",
            );
        }
        if !finding.rivals.is_empty() {
            let mut chart = BarChart::new("twice the log-likelihood gained, refitted").by_decades();
            chart = chart.bar(Bar::new(&finding.effect, finding.score).tone(Tone::Good));
            chart = chart.bars(finding.rivals.iter().map(|rival| Bar::new(&rival.effect, rival.score)));
            section.bars("In its place", &chart);
        }
    }
    section
}

fn gain(diagnosis: &Diagnosis) -> Section {
    let mut section = Section::new("What knowing it brings");
    let Some(finding) = diagnosis.findings.first() else {
        section.prose("Nothing was added to the model, so predictions stay as they are.");
        return section;
    };
    section.prose(
        "Both models predict the same windows of a motion that no fit has seen, each from a state that only past readings give. \
         The interval is that of a paired block bootstrap.",
    );
    let mut table = Table::new()
        .words("sensor")
        .numbers("ahead", "")
        .numbers("before", "RMSE")
        .numbers("after", "RMSE")
        .numbers("gain", "")
        .numbers("95 % interval", "");
    let mut chart = BarChart::new("share of the error that is gone, 500 ms ahead");
    for entry in &finding.gain {
        let tone = match entry.ci95 {
            Some([low, _]) if low > 0.0 => Tone::Good,
            Some([_, high]) if high < 0.0 => Tone::Bad,
            _ => Tone::Plain,
        };
        table.row([
            entry.channel.as_str().into(),
            seconds(entry.horizon_s).into(),
            significant(entry.rmse_base, 3).into(),
            significant(entry.rmse_extended, 3).into(),
            Cell::toned(percent(entry.gain), tone),
            entry.ci95.map_or_else(String::new, |[low, high]| format!("{} … {}", percent(low), percent(high))).into(),
        ]);
        if entry.horizon_s == 0.5 {
            let bar = Bar::new(&entry.channel, entry.gain).tone(tone);
            chart = chart.bar(match entry.ci95 {
                Some([low, high]) => bar.interval(low, high),
                None => bar,
            });
        }
    }
    section.bars("Half a second ahead", &chart);
    section.table(&table);
    section
}

fn defect(diagnosis: &Diagnosis) -> Section {
    let mut section = Section::new("The defect as a curve");
    if diagnosis.curves.is_empty() {
        section.prose("No curve of one argument explains more of this recording than noise would.");
        return section;
    }
    section.prose(
        "Whatever its name: the torque that the base model misses, as a smooth curve of one argument, fitted with all else. Straight \
         parts are in the base model already where it has a parameter for them.",
    );
    let mut shown: Option<String> = None;
    for picture in &diagnosis.curves {
        let title = format!("{:?} equation, by {}", picture.row, picture.argument.replace('_', " "));
        let first = shown.as_ref() != Some(&title);
        if first {
            section.heading(&title);
        }
        let plot = LinePlot::new(
            &picture.at,
            format!("{} ({})", picture.argument.replace('_', " "), picture.argument_unit),
            "missing torque (N m)",
        );
        let label = format!("joint {}", picture.axis);
        section.plot(&label, plot.series(Series::line(&label, Colour::Axis(picture.axis - 1), &picture.torque)));
        if first {
            shown = Some(title);
        }
    }
    section
}

fn scan(diagnosis: &Diagnosis) -> Section {
    let mut section = Section::new("Every candidate");
    section.prose(
        "Twice the log-likelihood that each law of the catalogue promises on top of the base model, after a step or two on a part of the \
         recording. It chooses what is refitted; the refits decide.",
    );
    let named = |id: &str| diagnosis.findings.iter().any(|finding| finding.effect == id);
    let bars = diagnosis.scan.iter().take(MOST_BARS).map(|candidate| {
        let tone = if named(&candidate.effect) {
            Tone::Good
        } else if candidate.p_value < diagnosis.threshold_p {
            Tone::Warning
        } else {
            Tone::Muted
        };
        Bar::new(&candidate.effect, candidate.score).tone(tone)
    });
    let chart = BarChart::new("score").bars(bars).by_decades().caption(format!(
        "Green: accepted. Orange: noise would bring any candidate this far in less than {} of recordings. Grey: no more than noise.",
        percent(diagnosis.threshold_p)
    ));
    section.bars("Scores", &chart);
    section
}

fn parameters(diagnosis: &Diagnosis) -> Section {
    let mut section = Section::new("Parameters before and after");
    let mut table = Table::new()
        .words("parameter")
        .words("unit")
        .numbers("base model", "± standard error")
        .numbers("extended model", "± standard error")
        .numbers("change", "");
    for p in &diagnosis.extended.parameters {
        let before = diagnosis.base.parameter(&p.name);
        let change = before.filter(|before| before.estimate != 0.0 && p.identifiable && before.identifiable);
        table.row([
            p.name.as_str().into(),
            p.unit.as_str().into(),
            before.map_or_else(String::new, |before| with_error(before.estimate, before.std_error)).into(),
            with_error(p.estimate, p.std_error).into(),
            change.map_or_else(String::new, |before| percent(p.estimate / before.estimate - 1.0)).into(),
        ]);
    }
    section.table(&table);
    section
}

fn left(diagnosis: &Diagnosis) -> Section {
    let mut section = Section::new("What is left over, and what could not be tested");
    section.prose(format!(
        "Curves still explain {} of what the base model left unexplained.",
        percent(diagnosis.unexplained.excess)
    ));
    if !diagnosis.unexplained.places.is_empty() {
        let mut table = Table::new().words("equation").words("joint").words("argument").numbers("share", "");
        for defect in &diagnosis.unexplained.places {
            table.row([
                format!("{:?}", defect.row).to_lowercase().into(),
                defect.axis.map_or_else(String::new, |axis| axis.to_string()).into(),
                defect.argument.replace('_', " ").into(),
                percent(defect.share).into(),
            ]);
        }
        section.table(&table);
    }
    section.heading("Not testable with this robot");
    section.list(diagnosis.not_testable.iter().map(|entry| format!("{}: {}", entry.effect, entry.why)));
    section
}
