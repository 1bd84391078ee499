//! Chains from URDFs: frames and bodies by hand, and what is refused.

use crate::robot::{JointKind, Robot, RobotError};

/// Two joints with a flange between them; a gripper's finger and a camera sit on the second link.
const URDF: &str = r#"
<robot name="arm">
  <link name="base"><inertial><mass value="9"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
  <joint name="mount" type="fixed">
    <origin xyz="0 0 0.5" rpy="0 0 0"/><parent link="base"/><child link="post"/>
  </joint>
  <link name="post"/>
  <joint name="shoulder" type="revolute">
    <origin xyz="0.1 0 0" rpy="0 0 1.5707963267948966"/><parent link="post"/><child link="upper"/>
    <axis xyz="0 0 2"/><limit lower="-1" upper="2" effort="1" velocity="1"/>
  </joint>
  <link name="upper"><inertial>
    <origin xyz="0.2 0 0" rpy="0 0 1.5707963267948966"/><mass value="2"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.025"/>
  </inertial></link>
  <joint name="flange" type="fixed">
    <origin xyz="0.4 0 0" rpy="0 0 0"/><parent link="upper"/><child link="flange_link"/>
  </joint>
  <link name="flange_link"><inertial>
    <mass value="2"/><inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/>
  </inertial></link>
  <joint name="slide" type="prismatic">
    <origin xyz="0 0.3 0" rpy="0 0 0"/><parent link="flange_link"/><child link="carriage"/>
    <axis xyz="1 0 0"/><limit lower="0" upper="0.2" effort="1" velocity="1"/>
  </joint>
  <link name="carriage"><inertial>
    <mass value="1"/><inertia ixx="0.001" ixy="0" ixz="0" iyy="0.001" iyz="0" izz="0.001"/>
  </inertial></link>
  <joint name="finger" type="prismatic">
    <origin xyz="0 0 1" rpy="0 0 0"/><parent link="carriage"/><child link="finger_link"/>
    <axis xyz="0 1 0"/><limit lower="0" upper="0.1" effort="1" velocity="1"/>
  </joint>
  <link name="finger_link"><inertial>
    <mass value="1"/><inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/>
  </inertial></link>
</robot>"#;

const REST: &str = r#"
name = "arm"
sample_period_s = 0.002
coriolis = true
gravity_m_s2 = [0.0, 0.0, -9.81]
[urdf]
file = "arm.urdf"
locked = ["finger"]
[input]
unit = "ampere"
[[joint]]
name = "shoulder"
gravity = "acts"
transmission = "elastic"
friction = { law = "coulomb", slope_s_rad = 400.0 }
gear = 100.0
parameters = { k_t = { start = 1.0 }, b = { start = 0.2 }, mu = { start = 1.0 }, k_s = { start = 900.0 }, d_s = { start = 1.0 } }
[[joint]]
name = "slide"
gravity = "acts"
transmission = "rigid"
friction = { law = "none" }
gear = 100.0
limits_m = [0.0, 0.15]
parameters = { k_t = { start = 1.0 }, b = { start = 3.0 } }
"#;

fn load(rest: &str, urdf: &str) -> Result<Robot, RobotError> {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("arm.urdf"), urdf).unwrap();
    let file = folder.path().join("arm.toml");
    std::fs::write(&file, rest).unwrap();
    Robot::load(file.to_str().unwrap())
}

#[track_caller]
fn close(found: &[f64], expected: &[f64]) {
    assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?} against {expected:?}");
}

#[test]
fn frames_limits_and_bodies_are_the_urdf_s() {
    let robot = load(REST, URDF).unwrap();
    let [shoulder, slide] = &robot.joints[..] else { panic!("{robot:?}") };
    // The fixed mount lifts the first joint; its frame is turned by a quarter, x towards y.
    close(&shoulder.origin_m, &[0.1, 0.0, 0.5]);
    close(&shoulder.rotation.concat(), &[0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
    close(&shoulder.axis, &[0.0, 0.0, 1.0]);
    assert_eq!((shoulder.kind, shoulder.limits), (JointKind::Revolute, [-1.0, 2.0]));
    // Two bodies of 2 kg at 0.2 and 0.4 m: 0.1 m from their centre each, and the first one's tensor turned by a quarter.
    close(&[shoulder.body.mass_kg], &[4.0]);
    close(&shoulder.body.centre_m, &[0.3, 0.0, 0.0]);
    close(
        &shoulder.body.inertia_kg_m2.concat(),
        &[0.02, 0.0, 0.0, 0.0, 0.01 + 4.0 * 0.01, 0.0, 0.0, 0.0, 0.025 + 4.0 * 0.01],
    );
    // The second joint stands behind the flange; its own limits go before the URDF's.
    close(&slide.origin_m, &[0.4, 0.3, 0.0]);
    assert_eq!((slide.kind, slide.limits), (JointKind::Prismatic, [0.0, 0.15]));
    // The locked finger belongs to the carriage: centre halfway, 0.5 m from each.
    close(&slide.body.centre_m, &[0.0, 0.0, 0.5]);
    close(&[slide.body.inertia_kg_m2[0][0], slide.body.inertia_kg_m2[2][2]], &[0.001 + 2.0 * 0.25, 0.001]);
    // What recordings carry needs no URDF beside it.
    assert!(!robot.toml().contains("urdf"), "{}", robot.toml());
    let again = Robot::parse(robot.toml()).unwrap();
    assert_eq!((again.joints, again.parameters), (robot.joints.clone(), robot.parameters.clone()));
}

#[test]
fn a_urdf_that_is_not_the_robot_s_chain_is_refused_by_name() {
    let cases = [
        (REST.replace("locked = [\"finger\"]", ""), URDF.to_owned(), "finger", "urdf.locked"),
        (REST.replace("\"slide\"", "\"slider\""), URDF.to_owned(), "slider", "shoulder, slide, finger"),
        (REST.replace("arm.urdf", "leg.urdf"), URDF.to_owned(), "leg.urdf", "cannot read"),
        (REST.to_owned(), "<robot".to_owned(), "arm.urdf", "is no URDF"),
        (REST.to_owned(), URDF.replace("parent link=\"flange_link\"", "parent link=\"post\""), "slide", "one chain"),
        (REST.replace("locked", "closed"), URDF.to_owned(), "closed", "locked"),
        (REST.to_owned(), URDF.replace("xyz=\"0 0 2\"", "xyz=\"0 0 0\""), "shoulder", "axis of no length"),
        (
            REST.to_owned(),
            URDF.replace("\"shoulder\" type=\"revolute\"", "\"shoulder\" type=\"planar\""),
            "shoulder",
            "neither",
        ),
        // A limit that the URDF has not and the file neither.
        (
            REST.to_owned(),
            URDF.replace("\"shoulder\" type=\"revolute\"", "\"shoulder\" type=\"continuous\""),
            "limits",
            "rad",
        ),
    ];
    for (rest, urdf, named, advice) in cases {
        let error = load(&rest, &urdf).unwrap_err().to_string();
        assert!(error.contains(named) && error.contains(advice), "{named}, {advice}: {error}");
    }
    let swapped =
        REST.replace("\"slide\"", "\"x\"").replace("\"shoulder\"", "\"slide\"").replace("\"x\"", "\"shoulder\"");
    let error = load(&swapped, URDF).unwrap_err().to_string();
    assert!(error.contains("from the base outwards"), "{error}");
    // A circle has no root, and is no reason to hang.
    let circle = URDF
        .replace("<parent link=\"base\"/><child link=\"post\"/>", "<parent link=\"carriage\"/><child link=\"post\"/>");
    let error = load(REST, &circle).unwrap_err().to_string();
    assert!(error.contains("follows slide"), "{error}");
}

/// The error of the first joint's link, or of the text.
#[track_caller]
fn refused(rest: &str, urdf: &str, parts: &[&str]) {
    let error = load(rest, urdf).unwrap_err().to_string();
    for part in parts {
        assert!(error.contains(part), "`{part}` is not in: {error}");
    }
}

#[test]
fn a_link_without_inertia_behind_a_spring_is_named() {
    let massless = URDF
        .replace("<mass value=\"2\"/>\n    <inertia ixx=\"0.01\"", "<mass value=\"0\"/>\n    <inertia ixx=\"0.01\"")
        .replace(
            "ixx=\"0.01\" ixy=\"0\" ixz=\"0\" iyy=\"0.02\" iyz=\"0\" izz=\"0.025\"",
            "ixx=\"0\" ixy=\"0\" ixz=\"0\" iyy=\"0\" iyz=\"0\" izz=\"0\"",
        )
        .replace("<mass value=\"2\"/><inertia", "<mass value=\"0\"/><inertia");
    // What is behind it gives it an inertia…
    load(REST, &massless).unwrap();
    // …but not where that has none.
    let nothing = massless.replace("<mass value=\"1\"/>", "<mass value=\"0\"/>").replace("0.001", "0");
    refused(REST, &nothing, &["link `upper` of arm.urdf", "joint[1].body", "`shoulder` on its spring", "rigid"]);
    // A rigid joint has its motor's, and an elastic one may be given some.
    load(
        &REST.replace("\"elastic\"", "\"rigid\"").replace(", k_s = { start = 900.0 }, d_s = { start = 1.0 }", ""),
        &nothing,
    )
    .unwrap();
    load(&REST.replace("b = { start = 0.2 }", "b = { start = 0.2 }, J = { start = 0.1 }"), &nothing).unwrap();
}

#[test]
fn bodies_in_millimetres_and_grams_are_asked_about() {
    let millimetres = URDF.replace("xyz=\"0.2 0 0\"", "xyz=\"200 0 0\"").replace(
        "ixx=\"0.01\" ixy=\"0\" ixz=\"0\" iyy=\"0.02\" iyz=\"0\" izz=\"0.025\"",
        "ixx=\"10000\" ixy=\"0\" ixz=\"0\" iyy=\"20000\" iyz=\"0\" izz=\"25000\"",
    );
    refused(REST, &millimetres, &["link `upper` of arm.urdf", "kg m²", "mass of 4 kg", "millimetres and grams?"]);
    // The inertia alone, and the way between joints alone.
    let inertia = URDF.replace(
        "ixx=\"0.01\" ixy=\"0\" ixz=\"0\" iyy=\"0.02\" iyz=\"0\" izz=\"0.025\"",
        "ixx=\"10000\" ixy=\"0\" ixz=\"0\" iyy=\"20000\" iyz=\"0\" izz=\"25000\"",
    );
    refused(REST, &inertia, &["link `upper` of arm.urdf", "inertia of 25000.04", "millimetres and grams?"]);
    refused(
        REST,
        &URDF.replace("xyz=\"0.1 0 0\"", "xyz=\"100 0 0\""),
        &["joint `shoulder` of arm.urdf", "100.0", "millimetres"],
    );
    // The arm of a crane: centre 9 m, gyration 8 m.
    let crane = URDF.replace("xyz=\"0.2 0 0\"", "xyz=\"9 0 0\"").replace(
        "ixx=\"0.01\" ixy=\"0\" ixz=\"0\" iyy=\"0.02\" iyz=\"0\" izz=\"0.025\"",
        "ixx=\"1\" ixy=\"0\" ixz=\"0\" iyy=\"128\" iyz=\"0\" izz=\"128\"",
    );
    load(REST, &crane).unwrap();
}

#[test]
fn numbers_that_are_none_are_told_with_line_and_attribute() {
    let limit = "<limit lower=\"-1\" upper=\"2\"";
    let with = |text: &str| URDF.replace(limit, text);
    refused(
        REST,
        &with("<limit lower=\"${-pi}\" upper=\"2\""),
        &["arm.urdf, line 10, attribute lower of <limit>", "`${-pi}`", "run xacro first"],
    );
    refused(REST, &with("<limit lower=\"$(arg low)\" upper=\"2\""), &["line 10", "run xacro first"]);
    refused(
        REST,
        &with("<limit lower=\"-1\"\n  upper='1,5'"),
        &["line 11, attribute upper of <limit>", "`1,5`", "decimal point"],
    );
    refused(REST, &URDF.replace("xyz=\"0.4 0 0\"", "xyz=\"0.4 0\""), &["attribute xyz of <origin>", "three numbers"]);
    refused(REST, &with("<limit lower=\"low\" upper=\"2\""), &["`low`", "is not a number"]);
    let macros = URDF.replace("<link name=\"post\"/>", "<!-- <xacro:post/> -->\n<xacro:post name=\"post\"/>");
    refused(REST, &macros, &["line 8, element", "<xacro:post>", "run xacro first"]);
    // What an expanded file keeps of xacro is no reason to refuse it.
    load(REST, &URDF.replace("<robot name", "<robot xmlns:xacro=\"http://www.ros.org/wiki/xacro\" name")).unwrap();
}
