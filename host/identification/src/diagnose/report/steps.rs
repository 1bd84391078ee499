//! Where a misfit is that no curve shows: the equation and the joint whose steps err most.
//!
//! What follows several joints at once, as the friction of one motor that another joint's angle changes, is a curve of none of them. The noise that a calibration
//! estimates of the model's steps has its place all the same.

use crate::calibrate::Fit;
use crate::diagnose::criteria::WRONG;
use crate::diagnose::result::Defect;
use crate::diagnose::yardstick;
use crate::effect::Row;
use crate::model::Model;
use crate::robot::Robot;

/// The place whose steps err most, in what they may miss at least ([`yardstick`]); none where no step errs by more than [`WRONG`] times that.
pub fn place_of_steps(robot: &Robot, base: &Fit, last: &Fit) -> Option<Defect> {
    let allowed = yardstick(robot, &base.series).process;
    let model = Model::new(robot);
    let layout = model.layout();
    let missed = |row: Row, joint: usize| {
        let (speed, i) = match row {
            Row::Link => ("qd", layout.qd(joint)),
            _ => ("thetad", layout.thetad(joint)),
        };
        let name = format!("process.{speed}[{}]", joint + 1);
        let sigma = last.calibration.noise.iter().find(|noise| noise.channel == name)?.sigma;
        Some((row, joint, sigma / allowed.get(i).filter(|allowed| **allowed > 0.0)?))
    };
    let rows = (0..layout.joints()).flat_map(|joint| [Row::Link, Row::Motor].map(|row| missed(row, joint)));
    worst(&rows.flatten().filter(|(.., times)| times.is_finite()).collect::<Vec<_>>())
}

/// The row and joint with the most, and its share of all squares.
fn worst(rows: &[(Row, usize, f64)]) -> Option<Defect> {
    let (row, joint, times) = rows.iter().copied().max_by(|(.., a), (.., b)| a.total_cmp(b))?;
    let all: f64 = rows.iter().map(|(.., times)| times * times).sum();
    (times > WRONG).then(|| Defect {
        row,
        axis: Some(joint + 1),
        argument: Defect::UNKNOWN.to_string(),
        share: times * times / all,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_place_is_that_of_the_steps_that_err_most_and_none_where_all_are_about_exact() {
        let place = worst(&[(Row::Link, 0, 12.0), (Row::Motor, 1, 57.0), (Row::Motor, 2, 31.0)]).unwrap();
        assert_eq!((place.row, place.axis), (Row::Motor, Some(2)));
        assert!((place.share - 57.0 * 57.0 / (12.0 * 12.0 + 57.0 * 57.0 + 31.0 * 31.0)).abs() < 1e-12);
        assert_eq!(worst(&[(Row::Link, 0, 0.9 * WRONG)]), None);
        assert_eq!(worst(&[]), None);
    }
}
