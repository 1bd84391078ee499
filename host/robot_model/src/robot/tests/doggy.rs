//! Doggy's bodies against the paper's equation (10) and the masses that its file adds.

use nalgebra::{DMatrix, DVector, Matrix3, SMatrix, SVector, Vector3};
use proptest::prelude::*;

use crate::robot::Robot;

/// The printed rounding of (10), kg m².
const PRINT_KG_M2: f64 = 3e-7;

/// Equation (10) as printed (g m²), in kg m²: m11, m12, m13, m22, m23, m33.
fn equation_10(q: [f64; 3]) -> [f64; 6] {
    let ((s2, c2), (s3, c3)) = (q[1].sin_cos(), q[2].sin_cos());
    [
        1.824 * c2 * s2 - 2.975 * c2 * c2 - 503.760 * c2 * c2 * c3 * c3
            + 0.106 * c2 * c2 * c3 * s3
            + 0.183 * c2 * c3 * s2
            - 0.138 * c2 * s2 * s3
            + 1012.973,
        0.8192 * s2 - 8.5760 * c2 + 0.0691 * c3 * s2 + 0.0916 * s2 * s3
            - 0.1062 * c2 * c3 * c3
            - 503.7604 * c2 * c3 * s3,
        514.2253 * s2 + 0.0916 * c2 * c3 - 0.0691 * c2 * s3,
        503.7604 * c3 * c3 - 0.0531 * (2.0 * q[2]).sin() + 40.0367,
        0.0691 * c3 + 0.0916 * s3,
        514.2253,
    ]
    .map(|g_m2| g_m2 * 1e-3)
}

fn assert_near_print(m: &[f64; 9], q: [f64; 3]) {
    let printed = equation_10(q);
    for (entry, (i, j)) in [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)].into_iter().enumerate() {
        let error = m[3 * i + j] - printed[entry];
        assert!(error.abs() < PRINT_KG_M2, "m{}{} is off by {error:.2e} kg m² at q = {q:?}", i + 1, j + 1);
        assert_eq!(m[3 * i + j], m[3 * j + i], "M is symmetric");
    }
}

proptest! {
    /// Over twice the joints' range. Farther out the roundings of m11's print (three decimals) add up to 3.5e-7.
    #[test]
    fn mass_matrix_is_equation_10(q1 in -2.0..2.0f64, q2 in -1.2..1.2f64, q3 in -1.2..1.2f64) {
        let chain = Robot::builtin("doggy").unwrap().chain();
        let mut m = [0.0; 9];
        chain.mass_matrix(&[q1, q2, q3], &mut m);
        assert_near_print(&m, [q1, q2, q3]);
    }
}

/// Solves (10) for the 13 numbers of three concentric bodies. Only 11 combinations are fixed by it; the other two are
/// chosen: the head's inertia about the rod, and a body 2 whose moments about its first and last axes average that
/// about the second (as round as (10) allows). The file holds this solution.
#[test]
fn the_file_holds_a_physical_solution_of_equation_10() {
    // Unknowns in EOF axes, g m²: J3 xx yy zz xy xz yz, J2 the same, J1 zz. The robot's equations are not used here.
    let jacobians = |q: [f64; 3]| {
        let rotation = |q3: f64| {
            let ((s2, c2), (s3, c3)) = (q[1].sin_cos(), q3.sin_cos());
            Matrix3::new(s2 * c3, s3, c2 * c3, s2 * s3, -c3, c2 * s3, c2, 0.0, -s2)
        };
        let (s3, c3) = q[2].sin_cos();
        let w3 = Matrix3::from_columns(&[
            rotation(q[2]).column(2).into(),
            Vector3::new(s3, -c3, 0.0),
            Vector3::new(0.0, 0.0, -1.0),
        ]);
        let w2 =
            Matrix3::from_columns(&[rotation(0.0).column(2).into(), Vector3::new(0.0, -1.0, 0.0), Vector3::zeros()]);
        (w3, w2)
    };
    let inertia_basis = |k: usize| -> Matrix3<f64> {
        let (i, j) = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)][k];
        let mut basis = Matrix3::zeros();
        basis[(i, j)] = 1.0;
        basis[(j, i)] = 1.0;
        basis
    };
    let grid = [-1.1, -0.4, 0.3, 0.9];
    let points = grid.iter().flat_map(|&q2| grid.iter().map(move |&q3| [0.0, q2, q3]));
    let mut rows: Vec<([f64; 13], f64)> = Vec::new();
    for q in points {
        let (w3, w2) = jacobians(q);
        let printed = equation_10(q);
        for (entry, (i, j)) in [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)].into_iter().enumerate() {
            let mut row = [0.0; 13];
            for k in 0..6 {
                row[k] = (w3.transpose() * inertia_basis(k) * w3)[(i, j)];
                row[6 + k] = (w2.transpose() * inertia_basis(k) * w2)[(i, j)];
            }
            row[12] = if (i, j) == (0, 0) { 1.0 } else { 0.0 };
            rows.push((row, printed[entry] * 1e3));
        }
    }
    let matrix = |rows: &[([f64; 13], f64)]| DMatrix::from_fn(rows.len(), 13, |i, j| rows[i].0[j]);
    let singular = matrix(&rows).svd(false, false).singular_values;
    assert_eq!(singular.iter().filter(|s| **s > 1e-9 * singular[0]).count(), 11, "(10) fixes 11 of the 13 numbers");

    let mut chosen = [0.0; 13];
    chosen[0] = 1.0;
    rows.push((chosen, 10.4396));
    let mut chosen = [0.0; 13];
    (chosen[6], chosen[7], chosen[8]) = (1.0, -2.0, 1.0);
    rows.push((chosen, 0.0));
    let target = DVector::from_iterator(rows.len(), rows.iter().map(|row| row.1));
    let solution = matrix(&rows).svd(true, true).solve(&target, 1e-12).unwrap() * 1e-3;

    // What the file says, in EOF axes about the joint axes' common point.
    let robot = Robot::builtin("doggy").unwrap();
    let tensor = |j: usize| Matrix3::from_fn(|a, b| robot.joints[j].body.inertia_kg_m2[a][b]);
    let eof_from_pitch = Matrix3::from_fn(|a, b| robot.joints[2].rotation[a][b]);
    let head = &robot.joints[2].body;
    let centre = Vector3::from(head.centre_m);
    let steiner = head.mass_kg * (Matrix3::identity() * centre.norm_squared() - centre * centre.transpose());
    let in_file = [tensor(2) + steiner, eof_from_pitch * tensor(1) * eof_from_pitch.transpose()];
    let places = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)];
    for (body, in_file) in in_file.iter().enumerate() {
        for (k, &(i, j)) in places.iter().enumerate() {
            let solved = solution[6 * body + k];
            let error = in_file[(i, j)] - solved;
            assert!(error.abs() < 1e-7, "J{} {i}{j}: file {} solved {solved}", 3 - body, in_file[(i, j)]);
        }
    }
    assert!((tensor(0)[(2, 2)] - solution[12]).abs() < 1e-7, "J1 zz solved {}", solution[12]);
}

/// The 5×5 matrix on two tilting joints, against the sum over bodies written out with positions and rates.
#[test]
fn tilting_base_carries_the_masses_above_it() {
    let robot = Robot::builtin("doggy").unwrap();
    let chain = robot.chain().with_base_joints([0.0; 3], &[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]).unwrap();
    let q = [0.03, -0.02, 0.7, -0.4, 0.5];
    let mut m = [0.0; 25];
    chain.mass_matrix(&q, &mut m);

    // Kinetic energy from finite differences of positions and from body rates: ½ q̇ᵀ M q̇, polarised by columns.
    let column = |j: usize| -> (Vec<Vector3<f64>>, Vec<Vector3<f64>>) {
        let mut qd = [0.0; 5];
        qd[j] = 1.0;
        let mut rates = [[0.0; 3]; 5];
        chain.body_rates(&q, &qd, &mut rates);
        let velocities = (0..3).map(|body| {
            let step = 1e-6;
            let at = |sign: f64| {
                let mut moved = q;
                moved[j] += sign * step;
                Vector3::from(chain.position(&moved, body + 2, robot.joints[body].body.centre_m))
            };
            (at(1.0) - at(-1.0)) / (2.0 * step)
        });
        (velocities.collect(), rates[2..].iter().map(|rate| Vector3::from(*rate)).collect())
    };
    let columns: Vec<_> = (0..5).map(column).collect();
    for i in 0..5 {
        for j in 0..5 {
            let sum: f64 = (0..3)
                .map(|body| {
                    let b = &robot.joints[body].body;
                    let inertia = Matrix3::from_fn(|r, c| b.inertia_kg_m2[r][c]);
                    b.mass_kg * columns[i].0[body].dot(&columns[j].0[body])
                        + columns[i].1[body].dot(&(inertia * columns[j].1[body]))
                })
                .sum();
            assert!((m[5 * i + j] - sum).abs() < 1e-8, "m{i}{j}: {} against {sum}", m[5 * i + j]);
        }
    }

    // The joint block is the unextended matrix, and the figures that the choice of masses is known by.
    let mut joints = [0.0; 9];
    robot.chain().mass_matrix(&q[2..], &mut joints);
    for i in 0..3 {
        for j in 0..3 {
            assert!((m[5 * (i + 2) + j + 2] - joints[3 * i + j]).abs() < 1e-12);
        }
    }
    chain.mass_matrix(&[0.0; 5], &mut m);
    assert!(
        (m[0] - 9.1).abs() < 0.1 && (m[6] - 9.1).abs() < 0.1,
        "about 9.1 kg m² about the bearing: {} {}",
        m[0],
        m[6]
    );
    let tilt: f64 = 1e-6;
    let mut gravity = [0.0; 5];
    chain.gravity_torque(&[tilt, 0.0, 0.0, 0.0, 0.0], &mut gravity);
    let toppling = -gravity[0] / tilt;
    assert!((toppling - 92.0).abs() < 0.5, "92 N m/rad of toppling moment: {toppling}");
    assert_eq!(gravity[3..], [0.0, 0.0], "counter-springs hold pitch and roll");
}

/// The proper matrix of R₁→EOF, and the rates of equations (27) and (28).
#[test]
fn kinematics_are_the_proper_rotation() {
    let chain = Robot::builtin("doggy").unwrap().chain();
    let q: [f64; 3] = [0.4, -0.5, 0.3];
    let qd = [0.7, -1.1, 2.3];
    let ((s2, c2), (s3, c3)) = (q[1].sin_cos(), q[2].sin_cos());
    let eof_from_1 = SMatrix::<f64, 3, 3>::new(s2 * c3, s3, c2 * c3, s2 * s3, -c3, c2 * s3, c2, 0.0, -s2);
    let expected = eof_from_1 * SVector::from([0.0, 0.0, qd[0]])
        + SVector::from([s3, -c3, 0.0]) * qd[1]
        + SVector::from([0.0, 0.0, -1.0]) * qd[2];

    let mut rates = [[0.0; 3]; 3];
    chain.body_rates(&q, &qd, &mut rates);
    assert_eq!(rates[0], [0.0, 0.0, qd[0]]);
    let mut rotations = [[[0.0; 3]; 3]; 3];
    chain.body_rotations(&q, &mut rotations);
    let to_matrix = |m: [[f64; 3]; 3]| Matrix3::from_fn(|i, j| m[i][j]);
    let relative = to_matrix(rotations[2]) * to_matrix(rotations[0]).transpose();
    for i in 0..3 {
        assert!((rates[2][i] - expected[i]).abs() < 1e-15);
        for j in 0..3 {
            assert!((relative[(i, j)] - eof_from_1[(i, j)]).abs() < 1e-15);
        }
    }
}
