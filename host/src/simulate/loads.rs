//! What the drives and transmissions of a robot bear, for the watches of the firmware: the largest over the poses within
//! its limits.
//!
//! With inertia of the links M, of the motors B, full torques τ and transmissions of stiffness K:
//!
//! ```text
//!   from rest:   (B + M) q̈ = τ u        motors and links accelerate together
//!   transmitted: M q̈ = M (B + M)⁻¹ τ u  what the transmissions pass on to the links
//!   a gyro:      Σ aⱼ (M q̈)ⱼ / kⱼ        the transmissions before it give way about their axes a
//! ```
//!
//! Parameters are those of the average robot, made worse by the spread of real ones.

use nalgebra::DMatrix;

use super::Truth;
use super::truth::SPREAD;
use crate::robot::chain::Chain;
use crate::robot::{Joint, JointKind, Robot, Symbol, Transmission};

/// A quantity in the numerator is larger by the spread, and one in the denominator smaller.
const WORST: f64 = (1.0 + SPREAD) / (1.0 - SPREAD);

/// What a robot bears.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Loads {
    /// Angle by which the transmissions before each gyro give way together while full duty accelerates the robot, rad.
    pub give_rad: Vec<f64>,
    /// The same under gravity, from one pose to another.
    pub sag_rad: Vec<f64>,
    /// Duty (a part of full) at which each joint may stand: friction holds it, and what gravity loads it with.
    pub standing: Vec<f64>,
    /// Time for which the transmission of each joint, at the top of a swing, may hold the motor against full duty, s.
    pub held_s: Vec<f64>,
    /// By joint, then link: torque that the link's acceleration puts on the joint, over the joint's torque at full duty, s².
    pub carried_s2: Vec<Vec<f64>>,
}

impl Loads {
    pub fn of(robot: &Robot, nominal: &Truth) -> Self {
        let n = robot.joints.len();
        let chain = robot.chain();
        let value = |symbol, joint| nominal.get(robot, symbol, joint).unwrap_or(0.0);
        let torque: Vec<f64> = (0..n).map(|j| value(Symbol::KPwm, j) * robot.input.scale).collect();
        let motor: Vec<f64> = (0..n).map(|j| value(Symbol::B, j)).collect();
        let give = |j: usize| {
            let turns = robot.joints[j].kind == JointKind::Revolute;
            let elastic = robot.joints[j].transmission == Transmission::Elastic;
            if turns && elastic { 1.0 / value(Symbol::KS, j) } else { 0.0 }
        };
        let soft = |j: usize| match robot.joints[j].transmission {
            Transmission::Elastic => 1.0 / value(Symbol::KS, j),
            Transmission::Rigid => 0.0,
        };
        let bodies: Vec<usize> = robot.gyros().map(|gyro| gyro.body).collect();

        let rub = |j: usize| value(Symbol::Mu, j);
        let mut swing_s2 = vec![0.0_f64; n];
        let (mut give_rad, mut sag_rad) = (vec![0.0_f64; bodies.len()], vec![0.0_f64; bodies.len()]);
        let (mut gravity, mut carried) = (vec![0.0_f64; n], vec![vec![0.0_f64; n]; n]);
        let (mut mass, mut load) = (vec![0.0; n * n], vec![0.0; n]);
        for q in poses(robot) {
            chain.mass_matrix(&q, &mut mass);
            chain.gravity_torque(&q, &mut load);
            for (j, k) in (0..n).flat_map(|j| (0..n).map(move |k| (j, k))) {
                carried[j][k] = carried[j][k].max(mass[j * n + k].abs());
            }
            for (largest, load) in gravity.iter_mut().zip(&load) {
                *largest = largest.max(load.abs());
            }
            for (j, swing_s2) in swing_s2.iter_mut().enumerate() {
                // The motors stand: the largest sum of a row of K^(−1/2) M K^(−1/2) is no less than 1 / ω² of any swing.
                let row = (0..n).map(|k| mass[j * n + k].abs() * (soft(j) * soft(k)).sqrt()).sum::<f64>();
                *swing_s2 = swing_s2.max(row / (1.0 - SPREAD));
            }
            let links = DMatrix::from_row_slice(n, n, &mass);
            let all = DMatrix::from_fn(n, n, |j, k| links[(j, k)] + if j == k { motor[j] } else { 0.0 });
            // Motors have inertia, so the sum has an inverse.
            let Some(inverse) = all.try_inverse() else { continue };
            let passed = links * inverse;
            for (gyro, body) in bodies.iter().enumerate() {
                let axes = axes(&chain, &q, *body);
                let turn = |torques: &dyn Fn(usize) -> f64| -> [f64; 3] {
                    std::array::from_fn(|i| (0..=*body).map(|j| axes[j][i] * torques(j) * give(j)).sum())
                };
                let by_duty: Vec<[f64; 3]> = (0..n).map(|k| turn(&|j| passed[(j, k)] * torque[k])).collect();
                give_rad[gyro] = give_rad[gyro].max(longest(&by_duty));
                sag_rad[gyro] = sag_rad[gyro].max(2.0 * length(turn(&|j| load[j])));
            }
        }
        Self {
            give_rad: give_rad.iter().map(|rad| WORST * rad).collect(),
            sag_rad: sag_rad.iter().map(|rad| WORST * rad).collect(),
            standing: (0..n).map(|j| WORST * (rub(j) + value(Symbol::O, j).abs() + gravity[j]) / torque[j]).collect(),
            held_s: (0..n).map(|j| 4.0 * WORST.sqrt() * (rub(j) / torque[j]).sqrt() * swing_s2[j].sqrt()).collect(),
            carried_s2: (0..n).map(|j| carried[j].iter().map(|mass| WORST * mass / torque[j]).collect()).collect(),
        }
    }
}

/// Every joint at zero and at both of its limits, in all combinations.
fn poses(robot: &Robot) -> impl Iterator<Item = Vec<f64>> + '_ {
    (0..3_usize.pow(robot.joints.len() as u32)).map(|combination| {
        let place = |(j, joint): (usize, &Joint)| match combination / 3_usize.pow(j as u32) % 3 {
            0 => 0.0,
            1 => joint.limits[0],
            _ => joint.limits[1],
        };
        robot.joints.iter().enumerate().map(place).collect()
    })
}

/// Axis of each joint in axes of a body, zero where it does not turn the body.
fn axes(chain: &Chain, q: &[f64], body: usize) -> Vec<[f64; 3]> {
    let n = q.len();
    let axis = |j: usize| {
        let (mut speeds, mut rates) = (vec![0.0; n], vec![[0.0; 3]; n]);
        speeds[j] = 1.0;
        chain.body_rates(q, &speeds, &mut rates);
        rates[body]
    };
    (0..n).map(axis).collect()
}

/// Length of the longest sum of these vectors, each with either sign.
fn longest(vectors: &[[f64; 3]]) -> f64 {
    // The sign of the first does not matter.
    let signs = 0..1_usize << vectors.len().saturating_sub(1);
    let sum = |signs: usize| -> [f64; 3] {
        vectors.iter().enumerate().fold([0.0; 3], |sum, (k, vector)| {
            let sign = if signs >> k & 1 == 0 { 1.0 } else { -1.0 };
            std::array::from_fn(|i| sum[i] + sign * vector[i])
        })
    };
    signs.map(|signs| length(sum(signs))).fold(0.0, f64::max)
}

fn length(vector: [f64; 3]) -> f64 {
    vector.iter().map(|part| part * part).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn loads(name: &str) -> Loads {
        let robot = Robot::builtin(name).unwrap();
        Loads::of(&robot, &Truth::nominal(&robot))
    }

    /// 36 N m accelerate 0.25 and 0.139 kg m²; 12.8 N m pass through 80 N m/rad.
    #[test]
    fn one_joints_belt_gives_way_as_reckoned_by_hand() {
        let Loads { give_rad, sag_rad, standing, held_s, carried_s2 } = loads("one_joint");
        let link = 0.045 + 1.5 * 0.25_f64.powi(2);
        assert!((give_rad[0] / WORST - 36.0 * link / (0.25 + link) / 80.0).abs() < 1e-12, "{give_rad:?}");
        assert_eq!(sag_rad, [0.0], "the axis is upright");
        assert!((standing[0] / WORST - 0.6 / 36.0).abs() < 1e-12);
        let swing_s = (link / 80.0 / (1.0 - SPREAD)).sqrt();
        assert!((held_s[0] - 4.0 * swing_s * (WORST * 0.6 / 36.0).sqrt()).abs() < 1e-12, "{held_s:?}");
        assert!((carried_s2[0][0] / WORST - link / 36.0).abs() < 1e-12);
    }

    #[test]
    fn a_gyro_behind_more_belts_has_more_that_gives_way() {
        let Loads { give_rad, .. } = loads("doggy");
        assert!(give_rad[1] > give_rad[0] && give_rad[0] > 0.05, "{give_rad:?}");
    }

    #[test]
    fn a_joint_that_bears_a_load_needs_a_duty_to_stand() {
        let text =
            Robot::builtin("one_joint").unwrap().toml().replace("axis = [0.0, 0.0, 1.0]", "axis = [0.0, 1.0, 0.0]");
        let robot = Robot::parse(&text).unwrap();
        let Loads { sag_rad, standing, .. } = Loads::of(&robot, &Truth::nominal(&robot));
        // 1.5 kg, 0.25 m from the axis.
        let gravity = 1.5 * 0.25 * 9.81;
        assert!((standing[0] / WORST - (0.6 + gravity) / 36.0).abs() < 1e-9, "{standing:?}");
        assert!((sag_rad[0] / WORST - 2.0 * gravity / 80.0).abs() < 1e-9, "{sag_rad:?}");
    }

    #[test]
    fn the_longest_sum_of_vectors() {
        assert_eq!(longest(&[[3.0, 0.0, 0.0], [0.0, -4.0, 0.0]]), 5.0);
        assert_eq!(longest(&[[3.0, 0.0, 0.0], [-4.0, 0.0, 0.0]]), 7.0);
        assert_eq!(longest(&[]), 0.0);
    }
}
