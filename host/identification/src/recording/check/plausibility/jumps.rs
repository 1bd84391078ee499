//! Positions that begin again after a turn. A table is unwrapped where it is imported; what jumps here has not been.

use crate::recording::check::{About, Findings};
use crate::recording::{Recording, Severity, wrap};

pub(super) fn look(recording: &Recording, findings: &mut Findings) {
    for found in wrap::find(recording, &[]) {
        let spec = &recording.channels[found.channel].spec;
        let sample = found.doubt.map_or(found.jumps[0], |doubt| doubt.sample);
        let why = found.doubt.map_or(String::new(), |doubt| format!(", and {}", doubt.why));
        findings.add(
            Severity::Error,
            About::Units,
            Some(&spec.name),
            format!(
                "jumps by {} between rows {} and {}, after {:.3} s ({:+.4} {}), one of {} times{why}",
                found.words(spec.unit),
                sample,
                sample + 1,
                recording.time_s(sample),
                found.jump(recording, sample),
                spec.unit,
                found.jumps.len(),
            ),
            "count its turns, or import it from a table: `host import` unwraps it where that is certain",
        );
    }
}
