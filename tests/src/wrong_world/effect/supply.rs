//! Effects between the command and the motor's torque.

use rand::RngExt;

use super::{Hiding, Size, Truth, of_joint, single};

/// See [`Hiding::hide`].
pub(super) fn hide(to: &mut Hiding<'_>, id: &str, size: Size) -> Option<Vec<Truth>> {
    Some(match id {
        "voltage_sag" => {
            to.machine.sag = to.draw(size, [0.005, 0.015, 0.04]);
            vec![single(id, "r", to.machine.sag)]
        }
        "current_limit" => {
            let peak = to.usage.iter().map(|usage| usage.torque_peak).fold(0.0, f64::max);
            let share = 1.0 - to.draw(size, [0.08, 0.2, 0.4]);
            to.machine.torque_limit = share * peak;
            vec![single(id, "T", to.machine.torque_limit)]
        }
        "pwm_dead_zone" => dead_zone(to, size),
        "electrical_lag" => {
            to.machine.current_lag_s = to.slower() * to.draw(size, [0.6e-3, 1.8e-3, 4.3e-3]);
            vec![single(id, "T", to.machine.current_lag_s)]
        }
        "input_delay" => {
            to.machine.input_delay_s = to.slower() * to.draw(size, [0.6e-3, 1.8e-3, 4.3e-3]);
            vec![single(id, "T", to.machine.input_delay_s)]
        }
        "motor_mismatch" => mismatch(to, size),
        _ => return None,
    })
}

fn dead_zone(to: &mut Hiding<'_>, size: Size) -> Vec<Truth> {
    let mut truths = Vec::new();
    for joint in to.some_of(to.all()) {
        let dead = to.draw(size, [0.004, 0.012, 0.04]);
        to.machine.joints[joint].dead_zone = dead;
        truths.push(of_joint("pwm_dead_zone", "d", joint, dead));
    }
    truths
}

/// Differences between the motors that add up to nothing.
fn mismatch(to: &mut Hiding<'_>, size: Size) -> Vec<Truth> {
    let mut truths = Vec::new();
    for symbol in ["db", "dk_pwm", "dk_mi"] {
        let largest = to.draw(size, [0.04, 0.08, 0.13]);
        let mut shares: Vec<f64> = to.all().map(|_| to.rng.random_range(-1.0..1.0)).collect();
        let mean = shares.iter().sum::<f64>() / shares.len() as f64;
        shares.iter_mut().for_each(|share| *share -= mean);
        let most = shares.iter().fold(1e-9_f64, |most, share| most.max(share.abs()));
        for (joint, share) in shares.into_iter().enumerate() {
            let (drive, share) = (&mut to.machine.joints[joint], share * largest / most);
            match symbol {
                "db" => drive.inertia *= 1.0 + share,
                "dk_pwm" => drive.gain *= 1.0 + share,
                _ => drive.back_emf *= 1.0 + share,
            }
            truths.push(of_joint("motor_mismatch", symbol, joint, share));
        }
    }
    truths
}
