//! Runs one case and compares the diagnosis with the truth.

use std::f64::consts::{PI, TAU};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Instant;

use host::diagnose::{Diagnosis, Options, diagnose};
use host::recording::check::obstacles;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use solve::levenberg::Settings;

use super::effect::Truth;
use super::said::{self, Estimated, Finding, Standing, Whole};
use super::{Case, Drawn, Main, draw};

/// The result of a case.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// Which.
    pub case: Case,
    /// `none`, `named`, `unknown`, `not_separable`; `error` where the diagnosis failed.
    pub verdict: String,
    /// Why it failed.
    pub error: Option<String>,
    /// Errors that `host check` reports for the recording.
    pub obstacles: Vec<String>,
    /// Ids of the trace effects.
    pub traces: Vec<String>,
    /// Findings in their order.
    pub findings: Vec<Finding>,
    /// Ids of rejected effects.
    pub rejected: Vec<String>,
    /// The main effect's parameters.
    pub parameters: Vec<Compared>,
    /// Joint gain on held-out data.
    pub whole: Option<Whole>,
    /// Whether held-out predictions got worse; see [`said::is_harmed`].
    pub is_harmed: bool,
    /// Row, joint and argument of the largest unexplained defect.
    pub place: Option<(String, Option<u64>, String)>,
    /// How long the diagnosis took, s.
    pub seconds: f64,
}

/// A parameter against the truth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Compared {
    /// As results name it.
    pub name: String,
    /// True value.
    pub truth: f64,
    /// Whether the plant's law means the same number.
    pub is_comparable: bool,
    /// Null where no finding has it.
    pub estimate: Option<f64>,
    /// Its interval.
    pub ci95: Option<[f64; 2]>,
    /// Whether the interval contains the truth; null without an interval or a comparable truth.
    pub holds: Option<bool>,
}

impl Outcome {
    /// Whether the main effect is in the list.
    pub fn lists_main(&self) -> bool {
        self.findings.iter().any(|finding| finding.standing == Standing::Main)
    }

    /// Whether it is the first finding, errors of the file passed over.
    pub fn begins_with_main(&self) -> bool {
        let mut causes = self.findings.iter().filter(|finding| finding.standing != Standing::File);
        causes.next().is_some_and(|finding| finding.standing == Standing::Main)
    }

    /// Number of false names.
    pub fn false_names(&self) -> usize {
        self.findings.iter().filter(|finding| finding.standing == Standing::False).count()
    }
}

/// Draws, simulates and diagnoses a case.
pub fn outcome(case: &Case) -> Outcome {
    let empty = Outcome {
        case: case.clone(),
        verdict: "error".to_owned(),
        error: None,
        obstacles: Vec::new(),
        traces: Vec::new(),
        findings: Vec::new(),
        rejected: Vec::new(),
        parameters: Vec::new(),
        whole: None,
        is_harmed: false,
        place: None,
        seconds: 0.0,
    };
    let drawn = match draw(case) {
        Ok(drawn) => drawn,
        Err(error) => return Outcome { error: Some(error), ..empty },
    };
    let clock = Instant::now();
    let answer = ask(&drawn);
    let seconds = clock.elapsed().as_secs_f64();
    let obstacles = obstacles(&drawn.recording).into_iter().map(|finding| finding.message).collect();
    let empty = Outcome { obstacles, traces: drawn.traces.clone(), seconds, ..empty };
    match answer.and_then(|found| serde_json::to_value(found).map_err(|error| error.to_string())) {
        Ok(said) => compare(&said, &drawn, empty),
        Err(error) => Outcome { error: Some(error), ..empty },
    }
}

/// The diagnosis. A panic is recorded as an error, so that the study goes on.
fn ask(drawn: &Drawn) -> Result<Diagnosis, String> {
    let options = Options { settings: Settings { threads: 1, ..Settings::default() }, ..Options::default() };
    let answer =
        catch_unwind(AssertUnwindSafe(|| diagnose(&drawn.robot, &[&drawn.recording], None, &options, &|_| {})));
    match answer {
        Ok(answer) => answer.map_err(|error| error.to_string()),
        Err(panic) => {
            let said = panic.downcast_ref::<String>().map(String::as_str).or_else(|| panic.downcast_ref().copied());
            Err(format!("panicked: {}", said.unwrap_or("without a word")))
        }
    }
}

fn compare(said: &Value, drawn: &Drawn, empty: Outcome) -> Outcome {
    let family = empty.case.family;
    let standing = |id: &str| match &empty.case.main {
        Main::Effect(main) if said::same(family, main, id) => Standing::Main,
        _ if drawn.traces.iter().any(|trace| said::same(family, trace, id)) => Standing::Trace,
        _ if family.faults_of_the_file().contains(&id) => Standing::File,
        _ => Standing::False,
    };
    let findings = said::findings(said, standing);
    let whole = said::whole(said);
    Outcome {
        verdict: said["verdict"].as_str().unwrap_or("error").to_owned(),
        rejected: said::rejected(said),
        parameters: drawn.truths.iter().map(|truth| compared(truth, said::estimated(said, &truth.name))).collect(),
        is_harmed: said::is_harmed(&findings, whole.as_ref()),
        place: said::place(said),
        findings,
        whole,
        ..empty
    }
}

fn compared(truth: &Truth, estimated: Option<Estimated>) -> Compared {
    let Truth { name, value, is_comparable } = truth.clone();
    let (estimate, ci95) = estimated.map_or((None, None), |estimated| (Some(estimated.estimate), estimated.ci95));
    // Phases are compared modulo a turn.
    let nearest = match estimate {
        Some(estimate) if name.contains(".phi[") => estimate + (value - estimate + PI).rem_euclid(TAU) - PI,
        _ => value,
    };
    let holds = ci95.filter(|_| is_comparable).map(|[low, high]| (low..=high).contains(&nearest));
    Compared { name, truth: value, is_comparable, estimate, ci95, holds }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn phases_are_compared_up_to_whole_turns() {
        let truth = |name: &str, value| Truth { name: name.to_owned(), value, is_comparable: true };
        let estimated = Some(Estimated { estimate: -3.1, ci95: Some([-3.2, -3.0]) });
        assert_eq!(compared(&truth("cogging.phi[1]", 3.15), estimated.clone()).holds, Some(true));
        assert_eq!(compared(&truth("cogging.A[1]", 3.15), estimated).holds, Some(false));
        let nothing = compared(&truth("cogging.A[1]", 3.15), None);
        assert_eq!((nothing.estimate, nothing.holds), (None, None));
    }
}
