//! The times at which a measured input misses far more than it does otherwise: what the model does not explain there has a place in the result.

use super::calibration::Push;
use crate::calibrate::residuals::point::Point;
use crate::calibrate::residuals::problem::Problem;
use crate::robot::Robot;

/// Stages less than this apart are one push, s: a hand that pushes lets go and meets the robot again within it. Half and double have not been tried.
const ONE_PUSH_S: f64 = 0.5;

/// Of every joint, in the order of time.
pub(crate) fn pushes(problem: &Problem<'_>, point: &Point<'_>) -> Vec<Push> {
    let series = problem.series;
    let mut pushes: Vec<Push> = Vec::new();
    for (joint, component) in problem.model.layout().inputs().enumerate() {
        for (number, stages) in series.recordings.iter().enumerate() {
            let mut last: Option<(Push, usize)> = None;
            for k in stages.clone().filter(|k| series.input_spread(*k, joint) > 1.0) {
                let (t_s, error) = (series.time_s(k), point.state(k)[component]);
                match &mut last {
                    Some((push, samples)) if t_s - push.to_s < ONE_PUSH_S => {
                        push.to_s = t_s;
                        *samples += 1;
                        push.mean += (error - push.mean) / *samples as f64;
                    }
                    last => {
                        let new = Push { recording: number + 1, joint: joint + 1, from_s: t_s, to_s: t_s, mean: error };
                        pushes.extend(last.replace((new, 1)).map(|(push, _)| push));
                    }
                }
            }
            pushes.extend(last.map(|(push, _)| push));
        }
    }
    pushes
}

/// What a reader should know of them, one sentence a recording and joint.
pub(crate) fn sentences(robot: &Robot, pushes: &[Push]) -> Vec<String> {
    let several = pushes.iter().any(|push| push.recording > 1);
    let of_one = pushes.chunk_by(|a, b| (a.recording, a.joint) == (b.recording, b.joint));
    let sentence = |pushes: &[Push]| {
        let (first, count) = (&pushes[0], pushes.len());
        let joint = robot.joints.get(first.joint - 1).map_or("", |joint| joint.name.as_str());
        let recording = if several { format!(" of recording {}", first.recording) } else { String::new() };
        let unit = robot.input.unit.symbol();
        let times: Vec<String> = pushes
            .iter()
            .map(|push| format!("{:.2}–{:.2} s ({:+.3} {unit})", push.from_s, push.to_s, push.mean))
            .collect();
        format!(
            "the input of {joint}{recording} does not explain the motion at {count} time{}, as where somebody pushes the robot, it hits something, or friction at a reversal is not that of the model: {}; these hardly count",
            if count == 1 { "" } else { "s" },
            times.join(", ")
        )
    };
    of_one.map(sentence).collect()
}
