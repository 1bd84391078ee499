//! The chain's algorithms against textbook closed forms and against each other, on chains of every kind of joint.

use num_dual::Dual64;
use proptest::prelude::*;

use crate::robot::chain::Chain;
use crate::robot::{Body, JointKind, Robot, Symbol};

/// A robot of `kinds` with skew axes, offsets and lopsided bodies.
fn skew_robot(kinds: &[JointKind]) -> Robot {
    let mut text = String::from(
        "name = 'skew'\nsample_period_s = 0.001\ncoriolis = true\ngravity_m_s2 = [0.3, -0.2, -9.81]\n\
         [input]\nunit = 'ampere'\n",
    );
    for (i, kind) in kinds.iter().enumerate() {
        let k = i as f64 + 1.0;
        let axis = [0.36, 0.48, 0.8];
        let axis = [axis[i % 3], axis[(i + 1) % 3], axis[(i + 2) % 3]];
        let (name, limits, slope) = match kind {
            Revolute => ("revolute", "limits_rad", "slope_s_rad"),
            Prismatic => ("prismatic", "limits_m", "slope_s_m"),
        };
        text += &format!(
            "[[joint]]\nname = 'j{i}'\nkind = '{name}'\naxis = {axis:?}\norigin_m = [{}, 0.2, {}]\n\
             rotation = [[0.6, 0.8, 0.0], [-0.8, 0.6, 0.0], [0.0, 0.0, 1.0]]\n{limits} = [-1.0, 1.0]\n\
             gravity = 'acts'\ntransmission = 'elastic'\nfriction = {{ law = 'coulomb', {slope} = 400.0 }}\ngear = 10.0\n\
             [joint.body]\nmass_kg = {}\ncentre_m = [0.05, {}, 0.1]\n\
             inertia_kg_m2 = {{ xx = 0.02, yy = 0.03, zz = 0.025, xy = 0.002, xz = -0.001, yz = 0.003 }}\n\
             [joint.parameters]\nk_t = {{ start = 1.0 }}\nb = {{ start = 1.0 }}\nmu = {{ start = 1.0 }}\n\
             k_s = {{ start = 1.0 }}\nd_s = {{ start = 1.0 }}\n",
            0.1 * k,
            -0.05 * k,
            0.5 + 0.3 * k,
            0.02 * k,
        );
    }
    Robot::parse(&text).unwrap()
}

use JointKind::{Prismatic, Revolute};
const MIXED: [JointKind; 5] = [Revolute, Prismatic, Revolute, Revolute, Prismatic];

fn mass_matrix(chain: &Chain, q: &[f64]) -> Vec<f64> {
    let mut m = vec![0.0; q.len() * q.len()];
    chain.mass_matrix(q, &mut m);
    m
}

/// Inertia about the axis and first moments of a body, added to a chain, are those of a body that has them.
#[test]
fn moments_of_mass_can_be_added_one_by_one() {
    // A bar that swings about y, under gravity.
    let text = Robot::builtin("one_joint").unwrap().toml().replace("axis = [0.0, 0.0, 1.0]", "axis = [0.0, 1.0, 0.0]");
    let robot = Robot::parse(&text).unwrap();
    let body = robot.joints[0].body;
    let [x, _, z] = body.centre_m;
    let mut point = robot.clone();
    point.joints[0].body = Body { centre_m: [0.0; 3], inertia_kg_m2: [[0.0; 3]; 3], ..body };
    let moments = point
        .chain()
        .with_moment(0, Symbol::J, body.inertia_kg_m2[1][1] + body.mass_kg * (x * x + z * z))
        .with_moment(0, Symbol::FirstMoment { axis: 0 }, body.mass_kg * x)
        .with_moment(0, Symbol::FirstMoment { axis: 2 }, body.mass_kg * z);
    let seen = |chain: &Chain| {
        let (mut mass, mut gravity) = ([0.0f64], [0.0f64]);
        chain.mass_matrix(&[0.3], &mut mass);
        chain.bias_torque(&[0.3], &[0.7], &mut gravity);
        [mass[0], gravity[0]]
    };
    for (a, b) in seen(&moments).iter().zip(seen(&robot.chain())) {
        // rtol 1e-12
        assert!(b != 0.0 && (a - b).abs() < 1e-12 * b.abs(), "{a} against {b}");
    }
    assert_eq!(seen(&robot.chain().massless()), [0.0; 2]);
}

/// A body parted in two: held still, the passive joints change nothing for the others; given free, the outer part
/// moves as the same body on the same joints would, and gyros on it feel all speeds.
#[test]
fn a_parted_body_is_the_whole_body_while_its_joints_stand_still() {
    let robot = skew_robot(&MIXED[..2]);
    let whole = &robot.joints[1].body;
    let outer = Body {
        mass_kg: 0.4 * whole.mass_kg,
        centre_m: whole.centre_m.map(|c| 1.3 * c),
        inertia_kg_m2: whole.inertia_kg_m2.map(|row| row.map(|element| 0.3 * element)),
    };
    let axes = [[0.6, 0.8, 0.0], [0.0, 0.0, 1.0]];
    let (chain, parted) = (robot.chain(), robot.chain().with_structure(&outer, &axes).unwrap());
    let q = [0.4, -0.7];
    let (before, after) = (mass_matrix(&chain, &q), mass_matrix(&parted, &[0.4, -0.7, 0.0, 0.0]));
    for (i, j) in [(0, 0), (0, 1), (1, 1)] {
        assert!((before[2 * i + j] - after[4 * i + j]).abs() < 1e-12, "{i} {j}");
    }
    // About the passive axes the outer part alone turns: its inertia about the common origin.
    for (k, axis) in axes.iter().enumerate() {
        let c = outer.centre_m;
        let along: f64 = (0..3).map(|i| c[i] * axis[i]).sum();
        let own: f64 = (0..9).map(|e| axis[e / 3] * outer.inertia_kg_m2[e / 3][e % 3] * axis[e % 3]).sum();
        let about = own + outer.mass_kg * (c.iter().map(|c| c * c).sum::<f64>() - along * along);
        assert!((after[4 * (2 + k) + 2 + k] - about).abs() < 1e-12, "axis {k}");
    }
    // Rates in the axes of the body: those of the whole body, and the passive speeds about their axes.
    let (mut of_whole, mut of_parts) = ([[0.0; 3]; 2], [[0.0; 3]; 4]);
    chain.body_rates(&q, &[1.0, -2.0], &mut of_whole);
    parted.body_rates(&[0.4, -0.7, 0.0, 0.0], &[1.0, -2.0, 0.5, 0.25], &mut of_parts);
    for i in 0..3 {
        let expected = of_whole[1][i] + 0.5 * axes[0][i] + 0.25 * axes[1][i];
        assert!((of_parts[3][i] - expected).abs() < 1e-12);
    }
    assert!(robot.chain().with_structure(&outer, &[[1.0, 0.0, 0.0]; 9]).is_err());
}

proptest! {
    /// Two algorithms, one M: Newton–Euler with unit accelerations gives the columns of the composite-body matrix.
    #[test]
    fn newton_euler_agrees_with_composite_bodies(q in prop::array::uniform5(-2.0..2.0f64)) {
        let chain = skew_robot(&MIXED).chain();
        let m = mass_matrix(&chain, &q);
        for j in 0..5 {
            let mut unit = [0.0; 5];
            unit[j] = 1.0;
            let mut tau = [0.0; 5];
            chain.inverse_dynamics(&q, None, &unit, &mut tau);
            for i in 0..5 {
                prop_assert!((tau[i] - m[5 * i + j]).abs() <= 1e-12 * (1.0 + m[5 * i + j].abs()), "{i} {j}");
            }
        }
    }

    /// Lagrange: c(q, q̇) = Ṁ q̇ − ½ ∂(q̇ᵀ M q̇)/∂q with exact derivatives of M.
    #[test]
    fn coriolis_terms_follow_from_the_mass_matrix(
        q in prop::array::uniform5(-2.0..2.0f64),
        qd in prop::array::uniform5(-3.0..3.0f64),
    ) {
        let chain = skew_robot(&MIXED).chain();
        let slope = |j: usize| -> Vec<f64> {
            let mut dual = q.map(Dual64::from_re);
            dual[j] = dual[j].derivative();
            let mut m = [Dual64::from_re(0.0); 25];
            chain.mass_matrix(&dual, &mut m);
            m.iter().map(|entry| entry.eps).collect()
        };
        let slopes: Vec<_> = (0..5).map(slope).collect();
        let mut tau = [0.0; 5];
        chain.inverse_dynamics(&q, Some(&qd), &[0.0; 5], &mut tau);
        for i in 0..5 {
            let mut expected = 0.0;
            for j in 0..5 {
                for k in 0..5 {
                    expected += (slopes[k][5 * i + j] - 0.5 * slopes[i][5 * j + k]) * qd[j] * qd[k];
                }
            }
            prop_assert!((tau[i] - expected).abs() < 1e-11 * (1.0 + expected.abs()), "{i}: {} {expected}", tau[i]);
        }
    }

    /// Gravity is the slope of the potential −Σ m g·p.
    #[test]
    fn gravity_is_the_slope_of_the_potential(q in prop::array::uniform5(-2.0..2.0f64)) {
        let robot = skew_robot(&MIXED);
        let chain = robot.chain();
        let mut tau = [0.0; 5];
        chain.gravity_torque(&q, &mut tau);
        for i in 0..5 {
            let mut dual = q.map(Dual64::from_re);
            dual[i] = dual[i].derivative();
            let mut slope = 0.0;
            for (body, joint) in robot.joints.iter().enumerate() {
                let position = chain.position(&dual, body, joint.body.centre_m);
                for axis in 0..3 {
                    slope -= joint.body.mass_kg * robot.gravity_m_s2[axis] * position[axis].eps;
                }
            }
            prop_assert!((tau[i] - slope).abs() < 1e-11, "{i}: {} {slope}", tau[i]);
        }
    }

    /// The estimator's derivatives against central differences of the torque.
    #[test]
    fn torque_derivatives_are_slopes(
        q in prop::array::uniform5(-2.0..2.0f64),
        qd in prop::array::uniform5(-3.0..3.0f64),
        qdd in prop::array::uniform5(-5.0..5.0f64),
    ) {
        let chain = skew_robot(&MIXED).chain();
        let (mut tau, mut by_q, mut by_qd) = ([0.0; 5], [0.0; 25], [0.0; 25]);
        chain.link_torque_derivatives(&q, &qd, &qdd, &mut tau, &mut by_q, &mut by_qd);
        let step = 1e-5;
        for j in 0..5 {
            let at = |dq: f64, dqd: f64| {
                let (mut q, mut qd) = (q, qd);
                q[j] += dq;
                qd[j] += dqd;
                let mut tau = [0.0; 5];
                chain.link_torque(&q, &qd, &qdd, &mut tau);
                tau
            };
            let (q_up, q_down, qd_up, qd_down) = (at(step, 0.0), at(-step, 0.0), at(0.0, step), at(0.0, -step));
            for i in 0..5 {
                let (dq, dqd) = ((q_up[i] - q_down[i]) / (2.0 * step), (qd_up[i] - qd_down[i]) / (2.0 * step));
                prop_assert!((by_q[5 * i + j] - dq).abs() < 1e-7 * (1.0 + dq.abs()));
                prop_assert!((by_qd[5 * i + j] - dqd).abs() < 1e-7 * (1.0 + dqd.abs()));
            }
        }
    }

    /// Rates are what orientations change by: Ṙ = −[ω]× R for base → body.
    #[test]
    fn rates_are_the_change_of_orientation(
        q in prop::array::uniform5(-2.0..2.0f64),
        qd in prop::array::uniform5(-3.0..3.0f64),
    ) {
        let chain = skew_robot(&MIXED).chain();
        let mut along = [Dual64::from_re(0.0); 5];
        for i in 0..5 {
            along[i] = Dual64::new(q[i], qd[i]);
        }
        let mut rotations = [[[Dual64::from_re(0.0); 3]; 3]; 5];
        chain.body_rotations(&along, &mut rotations);
        let mut rates = [[0.0; 3]; 5];
        chain.body_rates(&q, &qd, &mut rates);
        for body in 0..5 {
            let r = &rotations[body];
            for (i, j, k) in [(0, 1, 2), (1, 2, 0), (2, 0, 1)] {
                // ω_i = (R Ṙᵀ)_kj
                let omega: f64 = (0..3).map(|c| r[k][c].re * r[j][c].eps).sum();
                prop_assert!((omega - rates[body][i]).abs() < 1e-13, "body {body} axis {i}");
            }
        }
    }
}

/// Cart and pole: M and g as every textbook has them.
#[test]
fn cart_pole_is_the_textbook() {
    let text = "name = 'cart_pole'\nsample_period_s = 0.01\ncoriolis = true\ngravity_m_s2 = [0.0, 0.0, -9.81]\n\
        input = { unit = 'ampere' }\nparameters = { k_t = { fixed = 1.0 } }\n\
        [[joint]]\nname = 'cart'\nkind = 'prismatic'\naxis = [1, 0, 0]\nlimits_m = [-1, 1]\ngravity = 'acts'\n\
        transmission = 'rigid'\nfriction = { law = 'none' }\ngear = 1\n\
        body = { mass_kg = 2.0, centre_m = [0, 0, 0], inertia_kg_m2 = { xx = 0.1, yy = 0.1, zz = 0.1 } }\n\
        parameters = { b = { fixed = 0.0 } }\n\
        [[joint]]\nname = 'pole'\nkind = 'revolute'\naxis = [0, 1, 0]\nlimits_rad = [-3, 3]\ngravity = 'acts'\n\
        transmission = 'rigid'\nfriction = { law = 'none' }\ngear = 1\n\
        body = { mass_kg = 0.5, centre_m = [0, 0, 0.8], inertia_kg_m2 = { xx = 0.03, yy = 0.03, zz = 0.001 } }\n\
        parameters = { b = { fixed = 0.0 } }\n";
    let error = Robot::parse(text).unwrap_err().to_string();
    assert!(error.contains("cannot share"), "a torque constant in N m/A is not one in N/A: {error}");
    let text = text.replace("parameters = { k_t = { fixed = 1.0 } }\n", "");
    let text = text.replace("b = { fixed = 0.0 }", "b = { fixed = 0.0 }, k_t = { fixed = 1.0 }");
    let chain = Robot::parse(&text).unwrap().chain();
    let angle = 0.6f64;
    let m = mass_matrix(&chain, &[0.3, angle]);
    let coupling = 0.5 * 0.8 * angle.cos();
    for (got, expected) in m.iter().zip([2.5, coupling, coupling, 0.03 + 0.5 * 0.64]) {
        assert!((got - expected).abs() < 1e-15, "{m:?}");
    }
    let mut tau = [0.0; 2];
    chain.link_torque(&[0.3, angle], &[0.7, 2.0], &[0.0, 0.0], &mut tau);
    assert!((tau[0] + 0.5 * 0.8 * angle.sin() * 4.0).abs() < 1e-14, "centrifugal pull on the cart: {}", tau[0]);
    assert!((tau[1] + 0.5 * 9.81 * 0.8 * angle.sin()).abs() < 1e-14, "gravity topples the pole: {}", tau[1]);
}

#[test]
fn passive_joints_have_their_limit() {
    let chain = skew_robot(&[Revolute; 7]).chain();
    assert_eq!(chain.with_base_joints([0.0; 3], &[[1.0, 0.0, 0.0]; 3]).unwrap().joints(), 10);
    assert!(chain.with_base_joints([0.0; 3], &[[1.0, 0.0, 0.0]; 4]).is_err());
    assert_eq!(chain.with_base_joints([0.0; 3], &[]).unwrap(), chain);
}
