//! Files of other formats, read again.

use super::fixtures::{calibration, robot};
use crate::calibrate::Status;
use crate::export::{Exported, Kept, mjcf, robot_file, rust, urdf};
use crate::robot::{Robot, Symbol};

#[test]
fn a_robot_file_has_the_identified_values_and_the_comments_of_the_old_one() {
    for name in ["doggy", "one_joint", "emps", "rigid", "kuka_kr300", "arm7"] {
        let old = robot(name);
        let calibration = calibration(&old, &[]);
        let exported = Exported::of(&calibration).unwrap();
        let (text, losses) = robot_file(&exported).unwrap();
        let new = Robot::parse(&text).unwrap();
        assert_eq!(new.name, old.name);
        for (old, new) in old.parameters().iter().zip(new.parameters()) {
            assert_eq!((&old.name, old.value.free), (&new.name, new.value.free));
            match (old.symbol, calibration.parameter(&old.name)) {
                (Symbol::Misalignment { .. }, _) => {}
                (_, Some(found)) => {
                    // rtol 1e-15: once through the coordinates of the solver
                    assert!(
                        (new.value.start - found.estimate).abs() <= 1e-15 * found.estimate.abs(),
                        "{} {}",
                        name,
                        old.name
                    );
                    assert_eq!(new.value.start, new.value.simulated, "{} {}", name, old.name);
                }
                (_, None) => assert_eq!(old.value.start, new.value.start),
            }
        }
        // The calibrated rotations are the new nominal ones.
        for (gyro, rotation) in new.gyros().zip(exported.calibrated.rotations()) {
            for i in 0..3 {
                for j in 0..3 {
                    assert!((gyro.rotation[i][j] - rotation[(i, j)]).abs() < 1e-12);
                }
            }
        }
        for (old, new) in old.channels().iter().zip(new.channels()) {
            assert!((new.sigma - 1.5 * old.sigma).abs() < 1e-9 * old.sigma, "{name} {}", old.name);
        }
        assert!(losses.iter().any(|loss| loss.kept == Kept::Lost));
        let comments = |text: &str| text.matches('#').count();
        assert!(comments(&text) >= comments(old.toml()), "{text}");
    }
}

#[test]
fn what_must_not_be_trusted_says_so_in_the_first_line_and_marks_what_is_not_identified() {
    let mut calibration = calibration(&robot("doggy"), &["stribeck", "input_delay"]);
    calibration.status = Status::DoesNotFit;
    calibration.misfit = vec!["b of -1 kg m²".into()];
    calibration.parameters[2].identifiable = false;
    calibration.parameters[2].std_error = None;
    let exported = Exported::of(&calibration).unwrap();
    for (text, losses) in
        [rust(&exported).unwrap(), robot_file(&exported).unwrap(), mjcf(&exported).unwrap(), urdf(&exported).unwrap()]
    {
        let first = text.lines().find(|line| line.chars().any(char::is_alphabetic) && !line.contains("<?xml")).unwrap();
        assert!(first.contains("WARNING: does_not_fit: b of -1 kg m²"), "{first}");
        assert!(text.contains("NOT IDENTIFIED"));
        for id in ["stribeck", "input_delay"] {
            assert!(losses.iter().any(|loss| loss.part == id), "{id}");
            assert!(text.contains(&format!("{id}:")), "{id}");
        }
    }
    calibration.status = Status::Unidentifiable;
    let warning = Exported::of(&calibration).unwrap().warning().unwrap();
    assert!(warning.contains("do not determine b"), "{warning}");
}

#[test]
fn a_urdf_is_the_chain() {
    for name in ["doggy", "arm7", "rigid"] {
        let of = robot(name);
        let calibration = calibration(&of, &[]);
        let exported = Exported::of(&calibration).unwrap();
        let (text, _) = urdf(&exported).unwrap();
        let read = urdf_rs::read_from_string(&text).unwrap();
        assert_eq!(read.joints.len(), of.joints.len() + of.gyros().count());
        for ((joint, of), i) in read.joints.iter().zip(&of.joints).zip(0..) {
            let values = exported.joint_values(i);
            assert_eq!(joint.name, of.name);
            assert_eq!([joint.limit.lower, joint.limit.upper], of.limits);
            let dynamics = joint.dynamics.as_ref().unwrap();
            assert_eq!(dynamics.damping, values.viscous + values.link_viscous);
            assert_eq!(dynamics.friction, values.coulomb + values.link_coulomb);
        }
    }
}

#[test]
fn biases_of_several_recordings_are_told_by_their_mean() {
    let mut calibration = calibration(&robot("one_joint"), &[]);
    let place = calibration.parameters.iter().position(|parameter| parameter.name == "bias1[y]").unwrap();
    calibration.recordings.push(calibration.recordings[0].clone());
    let mut own = calibration.parameters.remove(place);
    for (number, estimate, error) in [(1, 0.01, 3e-3), (2, 0.03, 4e-3)] {
        own.name = format!("bias1[y]@{number}");
        (own.estimate, own.std_error) = (estimate, Some(error));
        calibration.parameters.push(own.clone());
    }
    let exported = Exported::of(&calibration).unwrap();
    let bias = exported.parameters.iter().find(|parameter| parameter.name == "bias1[y]").unwrap();
    assert!((bias.value - 0.02).abs() < 1e-15 && (bias.std_error.unwrap() - 2.5e-3).abs() < 1e-15, "{bias:?}");
    let new = Robot::parse(&robot_file(&exported).unwrap().0).unwrap();
    assert!((new.gyros().next().unwrap().bias_rad_s[1] - 0.02).abs() < 1e-15);
}
