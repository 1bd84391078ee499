//! The page of `host diagnose`: whether the model fits, causes, what was rejected, predictions before and after, the defect as a curve, what is left.

mod causes;
mod fit;
#[cfg(test)]
pub(crate) mod fixture;
mod predictions;
mod rest;
pub(crate) mod words;

use super::number::{percent, with_error};
use super::{Page, Section, Table, calibration};
use crate::diagnose::Diagnosis;
use words::Names;

/// The whole page.
pub fn page(diagnosis: &Diagnosis) -> Page {
    let robot = &diagnosis.base.robot;
    let mut page = Page::new(format!("Diagnosis of {robot}")).lead(diagnosis.base_fit.sentence.as_str());
    let why = words::why(diagnosis);
    if !why.is_empty() {
        page = page.fact("answer", why);
    }
    for used in &diagnosis.base.recordings {
        page = page.fact("recording", format!("{}: {} samples", used.path, used.samples));
    }
    page = page.fact("gain measured on", words::other_motion(diagnosis));
    for section in sections(diagnosis) {
        page.push(section);
    }
    page.push(parameters(diagnosis));
    page.push(calibration::fit(&diagnosis.extended));
    page
}

/// All that is the diagnosis's own.
pub(super) fn sections(diagnosis: &Diagnosis) -> Vec<Section> {
    let names = Names::of(diagnosis);
    vec![
        fit::section(diagnosis, &names),
        causes::found(diagnosis, &names),
        causes::rejected(diagnosis, &names),
        predictions::section(diagnosis, &names),
        rest::curves(diagnosis, &names),
        rest::left(diagnosis, &names),
        rest::scan(diagnosis, &names),
    ]
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
