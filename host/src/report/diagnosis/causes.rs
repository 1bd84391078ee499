//! The causes that were found and what was rejected.

use super::words::{self, Names};
use crate::diagnose::{Diagnosis, Finding, Flag, Gain, Verdict};
use crate::effect::Effect;
use crate::report::number::significant;
use crate::report::{Bar, BarChart, Section, Table, Tone};

/// Every cause, what brings most on the other motion first.
pub(super) fn found(diagnosis: &Diagnosis, names: &Names<'_>) -> Section {
    let mut section = Section::new("Causes");
    let findings = words::in_order(diagnosis);
    if findings.is_empty() {
        section.prose(match diagnosis.verdict {
            Verdict::None => "No law of the catalogue predicts data that no fit has seen better than the base model.",
            _ => "No law of the catalogue predicts data that no fit has seen better than the base model. What is missing \
                  is drawn below as a curve.",
        });
        return section;
    }
    section.prose(
        "In the order of what each brings on the other motion. Each is measured by leaving it out: by how much predictions of \
         the other motion get better with it, over all sensors and horizons up to 500 ms, and how much of what the base model \
         leaves unexplained it explains in blocks of this motion that its fit has not seen. Brackets hold 95 % intervals \
         between blocks of time.",
    );
    let bars: Vec<Bar> = findings
        .iter()
        .filter_map(|finding| {
            let gain = finding.holdout_gain.as_ref().filter(|gain| gain.share.is_finite())?;
            let bar = Bar::new(words::title(&finding.effect), gain.share).tone(tone(gain));
            Some(gain.ci95.map_or(bar.clone(), |[low, high]| bar.interval(low, high)))
        })
        .collect();
    if !bars.is_empty() {
        let chart = BarChart::new("share of the error that each removes").bars(bars).in_percent();
        section.bars("On the other motion", &chart);
    }
    for (place, finding) in findings.into_iter().enumerate() {
        cause(&mut section, finding, place + 1, names);
    }
    section
}

fn cause(section: &mut Section, finding: &Finding, number: usize, names: &Names<'_>) {
    section.heading(format!("{number}. {}", words::capital(&names.law(&finding.effect, &finding.axes))));
    if let Some(acts_like) = &finding.acts_like {
        section.note(Tone::Bad, format!("It {acts_like}."));
    }
    if !finding.flags.is_empty() {
        let flags: Vec<&str> = finding.flags.iter().map(|flag| flag.words()).collect();
        section.note(Tone::Warning, format!("{}.", words::capital(&flags.join("; "))));
    }
    if !finding.aliases.is_empty() {
        let others: Vec<String> = finding.aliases.iter().map(|alias| words::title(alias)).collect();
        section.note(Tone::Warning, format!("This motion cannot tell it from: {}.", others.join("; ")));
    }
    if let Ok(effect) = Effect::by_id(&finding.effect) {
        section.prose(effect.about);
        section.prose(effect.equation);
    }
    section.figures(figures(finding));
    parameters(section, finding, names);
    if let Some(stability) = &finding.stability {
        let is_constant = !finding.flags.contains(&Flag::NotConstant);
        section.prose(words::stability(stability, is_constant).unwrap_or_default());
    }
    rivals(section, finding, names);
}

fn figures(finding: &Finding) -> Vec<(&'static str, String, Tone)> {
    let on_other = finding.holdout_gain.as_ref();
    let all = [
        (
            "of the error on the other motion is removed",
            on_other.and_then(words::gain),
            on_other.map_or(Tone::Plain, tone),
        ),
        ("of what was unexplained is explained, out of sample", words::gain(&finding.cv_gain), tone(&finding.cv_gain)),
        (
            "coverage: its share of what it and the best curve on this equation gain together",
            words::share(finding.coverage, None),
            Tone::Plain,
        ),
        ("weight among the laws that could stand for it", number(finding.weight), Tone::Plain),
        (
            "p: share of worlds without any effect in which some law comes this far",
            finding.p_value.is_finite().then(|| significant(finding.p_value, 2)),
            Tone::Plain,
        ),
    ];
    all.into_iter().filter_map(|(name, value, tone)| Some((name, value?, tone))).collect()
}

fn number(value: f64) -> Option<String> {
    value.is_finite().then(|| significant(value, 3))
}

fn parameters(section: &mut Section, finding: &Finding, names: &Names<'_>) {
    if finding.parameters.is_empty() {
        return;
    }
    let mut table =
        Table::new().words("parameter").numbers("estimate", "± standard error").numbers("95 % interval", "");
    for p in &finding.parameters {
        let interval = words::interval_of(p).unwrap_or_default();
        let described =
            names.in_robot_file(&finding.effect, &p.name).map_or_else(String::new, |file| format!("; {file}"));
        let name = names.parameter(&finding.effect, &p.name) + &described;
        table.row([name.into(), words::estimate(p).into(), interval.into()]);
    }
    section.table(&table);
}

fn rivals(section: &mut Section, finding: &Finding, names: &Names<'_>) {
    if finding.rivals.is_empty() {
        return;
    }
    let mut table = Table::new()
        .words("refitted in its place")
        .numbers("weight", "")
        .numbers("score out of sample", "twice the log-likelihood gained");
    let own = (&finding.effect, &finding.axes, finding.weight, finding.score);
    let others = finding.rivals.iter().map(|rival| (&rival.effect, &rival.axes, rival.weight, rival.score));
    for (effect, axes, weight, score) in std::iter::once(own).chain(others) {
        let [weight, score] = [number(weight), number(score)].map(Option::unwrap_or_default);
        table.row([names.law(effect, axes).into(), weight.into(), score.into()]);
    }
    section.table(&table);
}

/// What was rejected, and why.
pub(super) fn rejected(diagnosis: &Diagnosis, names: &Names<'_>) -> Section {
    let mut section = Section::new("Rejected");
    if diagnosis.rejected.is_empty() {
        section.prose("Nothing that looked like a cause was rejected.");
        return section;
    }
    section.prose("These looked like causes and are none.");
    section.list(
        diagnosis.rejected.iter().map(|rejected| {
            format!("{}: {}", words::capital(&names.law(&rejected.effect, &rejected.axes)), rejected.why)
        }),
    );
    section
}

/// What a gain means: supported, harmful or neither.
pub(super) fn tone(gain: &Gain) -> Tone {
    tone_of(gain.ci95)
}

/// The same of its interval.
pub(super) fn tone_of(ci95: Option<[f64; 2]>) -> Tone {
    match ci95 {
        Some([low, _]) if low > 0.0 => Tone::Good,
        Some([_, high]) if high < 0.0 => Tone::Bad,
        _ => Tone::Plain,
    }
}
