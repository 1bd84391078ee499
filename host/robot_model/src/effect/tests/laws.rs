//! Each law at points that can be worked out by hand, and what physics forbids: friction that gives energy away.

use super::*;
use crate::robot::{Side, Symbol};

/// Doggy's pitch at a moment: μ = 2.5 N m, k_s = 400 N m/rad, d_s = 1.5 N m s/rad.
fn pitch(q: f64, qd: f64, theta: f64, thetad: f64) -> Moment<'static> {
    Moment {
        joint: 1,
        q,
        qd,
        theta,
        thetad,
        k_s: 400.0,
        d_s: 1.5,
        mu: 2.5,
        friction_speed: thetad,
        friction_sign: (200.0 * thetad).tanh(),
        ..Moment::default()
    }
}

fn told(hidden: &Hidden, name: &str) -> f64 {
    let value = hidden.values.iter().find(|value| value.name == format!("{}.{name}", hidden.id));
    value.unwrap_or_else(|| panic!("{name} of {hidden:?}")).value
}

fn near(a: f64, b: f64) {
    assert!((a - b).abs() < 1e-12 * (1.0 + b.abs()), "{a} is not {b}");
}

#[test]
fn motor_torques_follow_their_equations() {
    let at = pitch(0.1, 0.5, 0.2, 2.0);
    near(hide("torque_offset", Size::Exact(0.4)).physics.motor_torque(&at, 10.0), 10.4);
    let limit = hide("current_limit", Size::Exact(70.0));
    let clipped = [-90.0, -69.0, 69.0, 90.0].map(|torque| limit.physics.motor_torque(&at, torque));
    assert_eq!(clipped, [-70.0, -69.0, 69.0, 70.0]);

    let cogging = hide("cogging", Size::Medium);
    let (p, phi, a) = (told(&cogging, "p"), told(&cogging, "phi[2]"), told(&cogging, "A[2]"));
    near(cogging.physics.motor_torque(&at, 10.0), 10.0 + a * (p * 42.092 * 0.2 + phi).sin());
    assert!(p.fract() == 0.0 && (1.0..=14.0).contains(&p));
}

#[test]
fn transmission_torques_follow_their_equations() {
    let (spring, wound, unwound) = (400.0 * 0.05, pitch(0.25, 0.0, 0.2, 0.0), pitch(0.15, 0.0, 0.2, 0.0));
    let hardening = hide("belt_hardening", Size::Exact(8000.0));
    near(hardening.physics.transmission_torque(&wound, spring), spring + 8000.0 * 0.05f64.powi(3));
    near(hardening.physics.transmission_torque(&unwound, -spring), -spring - 8000.0 * 0.05f64.powi(3));
    let slack = hide("belt_slack_side", Size::Exact(0.2));
    near(slack.physics.transmission_torque(&wound, spring), 1.2 * spring);
    near(slack.physics.transmission_torque(&unwound, -spring), -0.8 * spring);
}

#[test]
fn link_loads_follow_their_equations() {
    let at = pitch(0.3, -1.5, 0.2, 2.0);
    near(hide("cable_spring", Size::Exact(2.0)).physics.link_load(&at, 1.0), 1.6);
    near(hide("quadratic_drag", Size::Exact(0.2)).physics.link_load(&at, 1.0), 1.0 - 0.2 * 2.25);
    let gravity = hide("gravity_residual", Size::Exact(0.8));
    near(gravity.physics.link_load(&at, 1.0), 1.0 + 0.8 * (0.3 + told(&gravity, "q0[2]")).sin());
    assert!(gravity.values.iter().all(|value| !value.name.contains("[1]")), "yaw feels no gravity");
    let friction = hide("link_friction", Size::Exact(0.5));
    near(friction.physics.link_load(&at, 0.0), -0.5 - 1.5 * told(&friction, "v_l[2]"));
}

/// A stop does nothing before contact, pushes back inside, and never pulls on a link that leaves it.
#[test]
fn a_stop_pushes_and_never_pulls() {
    let stop = hide("end_stop", Size::Exact(0.4));
    let k = told(&stop, "k");
    let load = |q: f64, qd: f64| stop.physics.link_load(&pitch(q, qd, 0.0, 0.0), 0.0);
    assert_eq!((load(0.399, 5.0), load(-0.399, -5.0)), (0.0, 0.0));
    near(load(0.41, 0.0), 0.01 * k);
    near(load(-0.41, 0.0), -0.01 * k);
    assert!(load(0.41, 1.0) > load(0.41, 0.0) && load(0.41, -1.0) < load(0.41, 0.0), "an impact costs energy");
    assert!(load(0.41, -2.0) > 0.0 && load(-0.41, 2.0) < 0.0);
    assert_eq!((load(0.41, -9.0), load(-0.41, 9.0)), (0.0, 0.0));
}

#[test]
fn friction_follows_its_equations() {
    let at = pitch(0.3, 0.0, 0.25, 1.0);
    let base = at.coulomb();
    near(base, 2.5);
    near(hide("viscous_friction", Size::Exact(1.2)).physics.friction_torque(&at, base), 3.7);
    let loaded = Moment { transmitted: -30.0, ..at };
    near(hide("load_friction", Size::Exact(0.02)).physics.friction_torque(&loaded, base), 2.5 * 1.6);
    let position = hide("position_friction", Size::Exact(0.2));
    near(position.physics.friction_torque(&at, base), 2.5 * (1.0 + 0.2 * (0.25 - told(&position, "phi[2]")).cos()));
    let drift = hide("friction_drift", Size::Exact(0.3));
    near(drift.physics.friction_torque(&at, base), 2.5 * 1.3);
    let later = Moment { time_s: told(&drift, "T"), ..at };
    near(drift.physics.friction_torque(&later, base), 2.5 * (1.0 + 0.3 / 1f64.exp()));
    let asymmetric = hide("asymmetric_friction", Size::Exact(0.5));
    let dv = told(&asymmetric, "dv[2]");
    near(asymmetric.physics.friction_torque(&at, base), 3.0 + dv);
    near(asymmetric.physics.friction_torque(&pitch(0.3, 0.0, 0.25, -1.0), -2.5), -2.0 + dv);
}

/// Whatever the speed, load, angle and time: base friction with the effect, and the back-EMF beside it, take energy out.
#[test]
fn no_friction_gives_energy_away() {
    let k_mi = doggy().joint_parameter(Symbol::KMi, 1).unwrap().value.simulated;
    for id in ["viscous_friction", "asymmetric_friction", "load_friction", "position_friction", "friction_drift"] {
        for seed in 0..20 {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let hidden = Effect::by_id(id).unwrap().hide_in(&doggy(), Size::Large, &mut rng).unwrap();
            for step in -60..=60i32 {
                let at = pitch(0.0, 0.0, 0.1 * f64::from(step), 0.1 * f64::from(step));
                let at = Moment { transmitted: -2.0 * f64::from(step), time_s: f64::from(step.abs()), ..at };
                let torque = hidden.physics.friction_torque(&at, at.coulomb()) + k_mi * at.thetad;
                assert!(torque * at.thetad >= 0.0, "{id}, seed {seed}: {torque} N m at {} rad/s", at.thetad);
            }
        }
    }
    for id in ["link_friction", "quadratic_drag"] {
        for speed in [-5.0, -0.01, 0.01, 5.0] {
            let at = pitch(0.0, speed, 0.0, 0.0);
            assert!(hide(id, Size::Large).physics.link_load(&at, 0.0) * speed > 0.0, "{id}");
        }
    }
}

/// LuGre at imposed speeds: the friction at each step, and the bristles left over.
fn bristles(hidden: &Hidden, own: &mut [f64], speeds: impl Iterator<Item = f64>, h: f64) -> Vec<f64> {
    let rates_at = |own: &[f64], speed: f64| {
        let joints = [0, 1, 2].map(|joint| Moment { joint, ..pitch(0.0, 0.0, 0.0, speed) });
        let mut rates = [0.0; 3];
        let line = Line { joints: &joints, motor_torque: &[0.0; 3], gyro_rates: &[] };
        hidden.physics.state_rates(own, &line, &mut rates);
        rates
    };
    speeds
        .map(|speed| {
            // Heun
            let first = rates_at(own, speed);
            let trial: Vec<f64> = own.iter().zip(first).map(|(z, rate)| z + h * rate).collect();
            let second = rates_at(&trial, speed);
            for (z, (a, b)) in own.iter_mut().zip(first.into_iter().zip(second)) {
                *z += 0.5 * h * (a + b);
            }
            let at = Moment { own, ..pitch(0.0, 0.0, 0.0, speed) };
            hidden.physics.friction_torque(&at, at.coulomb())
        })
        .collect()
}

/// Sliding friction falls from μ + Δμ to μ as (v/v_s)² says; a motor pushed ever so slowly breaks away at μ + Δμ.
#[test]
fn stiction_falls_to_sliding_friction() {
    let hidden = hide("stribeck", Size::Exact(1.5));
    let v_s = told(&hidden, "v_s");
    for speed in [0.1 * v_s, -0.5 * v_s, v_s, -2.0 * v_s, 4.0] {
        let friction = bristles(&hidden, &mut [0.0; 3], std::iter::repeat_n(speed, 20_000), 2e-5);
        let sliding = 2.5 + 1.5 * (-(speed / v_s).powi(2)).exp();
        let last = friction.last().unwrap();
        assert!((last - speed.signum() * sliding).abs() < 1e-3, "{speed}: {last} for {sliding}");
    }
    let slow = bristles(&hidden, &mut [0.0; 3], std::iter::repeat_n(3e-5, 400_000), 1e-5);
    let most = slow.iter().fold(0.0f64, |most, torque| most.max(*torque));
    assert!((most - 4.0).abs() < 0.01, "breaks away at {most}");
    assert!(slow[100] < 0.1, "a spring before that: {}", slow[100]);
}

/// Over whole cycles of any amplitude, from inside the bristles' bending to sliding, friction takes energy.
#[test]
fn bristles_give_no_energy_away() {
    let hidden = hide("stribeck", Size::Large);
    for amplitude in [1e-6, 1e-5, 1e-4, 1e-2, 0.3] {
        for hz in [1.0, 5.0] {
            let (h, per_cycle) = (1e-5, (1e5 / hz) as usize);
            let omega = std::f64::consts::TAU * hz;
            let speed = move |k: usize| amplitude * omega * (omega * k as f64 * h).cos();
            let mut own = [0.0; 3];
            bristles(&hidden, &mut own, (0..per_cycle).map(speed), h);
            let friction = bristles(&hidden, &mut own, (0..per_cycle).map(speed), h);
            let taken: f64 = friction.iter().enumerate().map(|(k, torque)| torque * speed(k) * h).sum();
            assert!(taken > 0.0, "{taken} J at {amplitude} rad, {hz} Hz");
        }
    }
}

/// A Maxwell branch wound as A sin ωt takes π A² k₁ ωτ / (1 + (ωτ)²) a cycle, and has relaxed after a while.
#[test]
fn a_viscoelastic_belt_takes_what_its_loop_encloses() {
    let hidden = hide("belt_hysteresis", Size::Exact(100.0));
    let tau = told(&hidden, "tau[2]");
    let (amplitude, omega) = (0.05, 2.0 / tau);
    let steps = 20_000u32;
    let h = std::f64::consts::TAU / omega / f64::from(steps);
    let (mut own, mut out, mut taken) = ([0.0; 3], [0.0; 3], 0.0);
    let mut step = |own: &mut [f64; 3], rate: f64| {
        let at = |joint| Moment { joint, ..pitch(0.0, rate, 0.0, 0.0) };
        hidden.physics.state_rates(
            own,
            &Line { joints: &[0, 1, 2].map(at), motor_torque: &[], gyro_rates: &[] },
            &mut out,
        );
        own.iter_mut().zip(out).for_each(|(f, rate)| *f += h * rate);
        hidden.physics.transmission_torque(&Moment { own: &own[..], ..at(1) }, 0.0)
    };
    for k in 0..6 * steps {
        let rate = amplitude * omega * (omega * h * f64::from(k)).cos();
        let torque = step(&mut own, rate);
        if k >= 5 * steps {
            taken += torque * rate * h;
        }
    }
    let enclosed = std::f64::consts::PI * amplitude.powi(2) * 100.0 * 2.0 / 5.0;
    assert!((taken / enclosed - 1.0).abs() < 1e-3, "{taken} J of {enclosed} J");
    for _ in 0..20 * steps {
        step(&mut own, 0.0);
    }
    assert!(own[1].abs() < 1e-9, "relaxed");
}

#[test]
fn a_winding_fills_with_its_time_constant() {
    let hidden = hide("electrical_lag", Size::Exact(2e-3));
    let (mut own, mut out) = ([0.0; 3], [0.0; 3]);
    for _ in 0..20_000 {
        let line = Line { joints: &[], motor_torque: &[10.0, -20.0, 0.0], gyro_rates: &[] };
        hidden.physics.state_rates(&own, &line, &mut out);
        own.iter_mut().zip(out).for_each(|(torque, rate)| *torque += 1e-7 * rate);
    }
    let share = 1.0 - (-1.0f64).exp();
    for (joint, full) in [10.0, -20.0, 0.0].into_iter().enumerate() {
        let at = Moment { joint, own: &own, ..Moment::default() };
        assert!((hidden.physics.motor_torque(&at, full) - share * full).abs() < 1e-3);
    }
}

#[test]
fn small_duties_vanish_in_the_dead_zone() {
    let hidden = hide("pwm_dead_zone", Size::Exact(0.02));
    let through = |duty: f64| hidden.physics.duty(0, &Past::default(), duty);
    assert_eq!([0.0, 0.019, -0.019].map(|duty| through(duty).abs()), [0.0; 3]);
    near(through(0.5), 0.48);
    near(through(-0.5), -0.48);
}

/// Differences of each kind add up to nothing, so that the shared parameter stays what it is.
#[test]
fn mismatched_motors_share_their_mean() {
    let hidden = hide("motor_mismatch", Size::Medium);
    for (symbol, name) in [(Symbol::B, "db"), (Symbol::KPwm, "dk_pwm"), (Symbol::KMi, "dk_mi")] {
        let each = [0, 1, 2].map(|joint| hidden.physics.parameter(symbol, joint, 10.0));
        near(each.iter().sum::<f64>(), 30.0);
        near(each[1], 10.0 * (1.0 + told(&hidden, &format!("{name}[2]"))));
        assert!(each.iter().any(|value| (value / 10.0 - 1.0).abs() > 0.06), "{each:?}");
    }
    assert_eq!(hidden.physics.parameter(Symbol::KS, 0, 400.0), 400.0);
}

#[test]
fn sensors_err_as_their_equations_say() {
    let none = Past::default();
    let disc = hide("encoder_eccentricity", Size::Exact(1e-3));
    let read = disc.physics.encoder(Side::Motor, 1, &none, 0.3, 0.3);
    near(read, 0.3 + 1e-3 * (0.3 + told(&disc, "phi[2]")).sin());
    let scale = hide("gyro_scale", Size::Exact(0.02));
    assert_eq!(scale.physics.gyro_rate(&[], 1, [1.0, -2.0, 0.0]), [1.02, -2.04, 0.0]);
    let clipping = hide("gyro_clipping", Size::Exact(4.0));
    assert_eq!(clipping.physics.gyro_reading(0.0, 0, [5.0, -3.0, -4.5]), [4.0, -3.0, -4.0]);
    let drift = hide("gyro_bias_drift", Size::Exact(0.02));
    assert_eq!(drift.physics.gyro_reading(0.0, 0, [1.0; 3]), [1.0; 3]);
    let late = drift.physics.gyro_reading(told(&drift, "T"), 0, [1.0; 3]);
    near(late[2], 1.0 + 0.02 * (1.0 - 1.0 / 1f64.exp()));
}

/// The payload makes the roll axis m p² heavier, seen by the chain that the plant builds.
#[test]
fn a_payload_weighs_what_it_weighs() {
    let hidden = hide("link_inertia", Size::Exact(0.2));
    let mut robot = doggy();
    let mut before = [0.0; 9];
    robot.chain().mass_matrix(&[0.1, 0.2, 0.3], &mut before);
    robot.joints[2].body = hidden.physics.body(2, robot.joints[2].body);
    let mut after = [0.0; 9];
    robot.chain().mass_matrix(&[0.1, 0.2, 0.3], &mut after);
    let arm: f64 = 4.0 / 3.0 * 0.60869565;
    assert!((after[8] - before[8] - 0.2 * arm * arm).abs() < 1e-12);
    assert_eq!(hidden.physics.body(1, robot.joints[1].body), robot.joints[1].body);
}
