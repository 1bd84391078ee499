//! Description files: what a writer may get wrong and what he is told.

use crate::robot::{ChannelKind, Robot, Symbol, Transmission};

fn doggy_with(from: &str, to: &str) -> String {
    let text = Robot::builtin("doggy").unwrap().toml().to_owned();
    assert!(text.contains(from), "the built-in file has {from:?}");
    text.replacen(from, to, 1)
}

fn complaint(from: &str, to: &str) -> String {
    Robot::parse(&doggy_with(from, to)).expect_err("must be refused").to_string()
}

#[test]
fn builtins_parse_and_keep_their_text() {
    for name in Robot::builtin_names() {
        let robot = Robot::load(name).unwrap();
        assert_eq!(robot.name, name);
        assert_eq!(Robot::parse(robot.toml()).unwrap(), robot);
        let rigid = robot.joints.iter().all(|joint| joint.transmission == Transmission::Rigid);
        assert_eq!(
            rigid,
            ["emps", "dfki_pendulum", "dfki_double_pendulum", "xl330_pendulum"].contains(&name),
            "{name}"
        );
    }
}

#[test]
fn doggy_has_the_columns_and_parameters_of_the_results() {
    let robot = Robot::builtin("doggy").unwrap();
    let channels = robot.channels();
    let columns: Vec<_> = channels.iter().map(|c| c.column.as_str()).collect();
    assert_eq!(columns.join(","), "theta1,theta2,theta3,g1x,g1y,g1z,g2x,g2y,g2z");
    let names: Vec<_> = channels.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names[..4], ["encoder1", "encoder2", "encoder3", "gyro1.x"]);
    assert_eq!(channels[8].kind, ChannelKind::GyroAxis { gyro: 1, body: 2, axis: 2 });
    let parameters: Vec<_> = robot.parameters().iter().map(|p| p.name.as_str()).collect();
    assert_eq!(
        parameters.join(" "),
        "k_pwm k_mi b mu[1] mu[2] mu[3] k_s[1] k_s[2] k_s[3] d_s[1] d_s[2] d_s[3] bias1[x] bias1[y] bias1[z] \
         bias2[x] bias2[y] bias2[z] R_imu1[x] R_imu1[y] R_imu1[z] R_imu2[x] R_imu2[y] R_imu2[z]"
    );
    assert_eq!(robot.joint_parameter(Symbol::KS, 2).unwrap().value.start, 600.0);
    assert_eq!(robot.joint_parameter(Symbol::KPwm, 2).unwrap().joints, [0, 1, 2]);
}

/// What only some robots have: viscous friction where no back-EMF stands for it, a constant torque, unknown inertia, an encoder's zero.
#[test]
fn a_parameter_that_a_joint_can_do_without_is_zero_unless_it_is_given() {
    let more = doggy_with(
        "d_s = { start = 1.0, simulated = 1.5 }",
        "d_s = { start = 1.0 }\nJ = { start = 0.0 }\nmx = { start = 0.1 }",
    );
    let encoder = "[[sensor]]\nkind = \"link_encoder\"\njoint = \"roll\"\nsigma_rad = 1e-5\nzero_rad = { start = 0.0 }\n\
         scale_error = { fixed = 1e-4 }\n";
    let robot = Robot::parse(&format!("{more}\n{encoder}")).unwrap();
    let names: Vec<_> = robot.parameters().iter().map(|p| (p.name.as_str(), p.unit)).collect();
    for known in [("J[1]", "kg m^2"), ("mx[1]", "kg m"), ("zero[3]", "rad"), ("scale_error[3]", "")] {
        assert!(names.contains(&known), "{known:?} is not in {names:?}");
    }
    assert!(robot.joint_parameter(Symbol::FirstMoment { axis: 0 }, 1).is_none(), "pitch has no mx");
    let emps = Robot::builtin("emps").unwrap();
    let units: Vec<_> = emps.parameters().iter().map(|p| (p.name.as_str(), p.unit)).collect();
    assert_eq!(units, [("b[1]", "kg"), ("mu[1]", "N"), ("v[1]", "N s/m"), ("o[1]", "N")]);
    // With a voltage the back-EMF is viscous friction by another name.
    let text = complaint("mu = { start = 2.0, simulated = 1.599 }", "mu = { start = 2.0 }\nv = { start = 1.0 }");
    assert!(text.contains("joint[1].parameters.v"), "{text}");
    let text = complaint("speed = \"motor\",", "acts = \"link\", speed = \"motor\",");
    assert!(text.contains("joint[1].friction.speed"), "{text}");
}

#[test]
fn a_typo_is_named_with_its_line_and_the_likely_word() {
    let text = complaint("coriolis = false", "corriolis = false");
    assert!(text.contains("corriolis") && text.contains("did you mean `coriolis`") && text.contains("line "), "{text}");
    let text = complaint("kind = \"gyro\"", "kind = \"gyros\"");
    assert!(text.contains("did you mean `gyro`"), "{text}");
    let text = complaint("k_s = { start = 400.0 }", "k_s = { strat = 400.0 }");
    assert!(text.contains("did you mean `start`"), "{text}");
}

#[test]
fn values_without_sense_are_named_with_a_way_out() {
    for (from, to, told) in [
        ("sample_period_s = 0.001", "sample_period_s = 1.0", "sample_period_s = 1: must lie between"),
        ("supply_v = 32.0", "", "input.supply_v = missing"),
        ("unit = \"duty\"", "unit = \"volt\"", "only a duty needs a supply voltage"),
        ("axis = [0.0, 1.0, 0.0]", "axis = [0.0, 2.0, 0.0]", "joint[2].axis = [0.0, 2.0, 0.0]: has length 2"),
        ("limits_rad = [-1.0, 1.0]", "limits_rad = [1.0, -1.0]", "lowest < highest"),
        ("limits_rad = [-1.0, 1.0]", "limits_m = [-1.0, 1.0]", "use joint[1].limits_rad"),
        ("limits_rad = [-1.0, 1.0]", "", "joint[1].limits_rad = missing"),
        ("mass_kg = 10.0", "mass_kg = -10.0", "joint[1].body.mass_kg = -10"),
        ("xx = 1.0, yy = 1.0", "xx = 0.1, yy = 0.1", "no body has such an inertia"),
        ("gear = 42.092", "gear = 42.092\nunmodelled_m_s2 = { link = 1.0 }", "give `unmodelled_rad_s2`"),
        ("gear = 42.092", "gear = 42.092\nunmodelled_rad_s2 = { link = -1.0 }", "joint[1].unmodelled_rad_s2.link = -1"),
        ("gear = 42.092", "gear = 42.092\nunmodelled_rad_s2 = { link = nan }", "joint[1].unmodelled_rad_s2.link = NaN"),
        ("sigma_rad = ", "scale_error = { start = 0.0 }\nsigma_rad = ", "a motor_encoder has no such field"),
        ("gear = 42.092", "gear = 0.0", "joint[1].gear = 0: must be a positive number"),
        ("k_s = { start = 400.0 }", "", "joint[1].parameters.k_s = nothing: missing"),
        ("k_s = { start = 400.0 }", "k_s = { start = 400.0, fixed = 1.0 }", "give one of the two"),
        ("k_s = { start = 400.0 }", "k_s = { start = -400.0 }", "sign is fixed by physics"),
        ("mu = { start = 2.0,", "mu = { start = nan,", "must be zero or positive"),
        ("mu = { start = 2.0,", "k_pwm = { start = 1.0 }\nmu = { start = 2.0,", "under [parameters] for all joints"),
        ("k_mi = {", "k_t = { start = 1.0 }\nk_mi = {", "parameters.k_t = given"),
        ("transmission = \"elastic\"", "transmission = \"rigid\"", "joint[1].parameters.k_s = given"),
        ("name = \"pitch\"", "name = \"yaw\"", "another joint has this name"),
        ("joint = \"roll\"", "joint = \"rol\"", "sensor[3].joint = rol: no such joint; there are yaw, pitch, roll"),
        ("joint = \"pitch\"", "joint = \"yaw\"", "has such a sensor already"),
        ("range_rad_s = 17.4533", "counts_per_turn = 3", "a gyro has no such field"),
        ("[0.0, -1.0, 0.0]]", "[0.0, 1.0, 0.0]]", "is a reflection"),
        ("[0.0, -1.0, 0.0]]", "[0.0, -0.9, 0.0]]", "is not a rotation"),
        ("law = \"coulomb\", ", "law = \"none\", ", "leave speed, acts and slope out"),
    ] {
        let text = complaint(from, to);
        assert!(text.contains(told), "{from} → {to} said:\n{text}");
    }
}

#[test]
fn a_robot_that_is_not_there_is_told_apart_from_one_that_cannot_be_read() {
    let text = Robot::load("dogy").unwrap_err().to_string();
    assert!(text.contains("doggy, one_joint") && text.contains("did you mean `doggy`"), "{text}");
    let text = Robot::load("no/such/robot.toml").unwrap_err().to_string();
    assert!(text.contains("cannot read the robot file no/such/robot.toml"), "{text}");
}

#[test]
fn the_template_is_a_robot_and_shows_every_field() {
    let text = Robot::template("my-arm_2").unwrap();
    assert_eq!(Robot::parse(&text).unwrap().name, "my-arm_2");
    for name in ["", "my robot", "a\"b"] {
        assert!(Robot::template(name).unwrap_err().to_string().contains("letters, digits"), "{name:?}");
    }
    for field in ["rotation", "limits_m", "k_t", "link_encoder", "tachometer", "offset_us", "fixed", "prismatic"] {
        assert!(text.contains(field), "{field}");
    }
}

/// The hints of the template on imports, each taken at its word.
#[test]
fn the_templates_import_is_one() {
    let template = Robot::template("mine").unwrap();
    let (robot, hints) = template.split_once("# [import]").unwrap();
    let tachometer = "[[sensor]]\nkind = \"tachometer\"\njoint = \"first\"\nside = \"motor\"\nsigma_rad_s = 1e-3\n";
    for skipped in ["enc", "motor_deg"] {
        let is_code = |line: &&str| (line.starts_with("# [") || line.contains(" = ")) && !line.starts_with("#  ");
        let code: Vec<&str> = hints
            .lines()
            .filter(is_code)
            .filter(|line| !line.contains(&format!("theta1 = {{ column = \"{skipped}\"")))
            .map(|line| line.trim_start_matches("# "))
            .collect();
        let text = format!("{robot}{tachometer}[import]\n{}", code.join("\n"));
        let import = Robot::parse(&text).unwrap_or_else(|error| panic!("{error}\n{text}")).import.unwrap();
        assert_eq!((import.separator, import.decimal, import.missing.len()), (';', ',', 2));
        let factor = |name: &str| import.columns.iter().find(|column| column.name == name).unwrap().factor;
        assert_eq!(factor("u1"), -0.01);
        let count = std::f64::consts::TAU / 2048.0 / 30.0;
        let degree = 1f64.to_radians() / 30.0;
        let expected = if skipped == "enc" { degree } else { count };
        assert!((factor("theta1") / expected - 1.0).abs() < 1e-12, "{}", factor("theta1"));
        assert!((factor("thd1") / (std::f64::consts::TAU / 60.0 / 30.0) - 1.0).abs() < 1e-12);
        assert!((factor("g1x") / 0.0609756f64.to_radians() - 1.0).abs() < 1e-12);
    }
}
