//! ROS 2 bags, written as a recorder of ROS would.

use std::borrow::Cow;
use std::io::Cursor;
use std::path::Path;
use std::sync::Arc;

use mcap::{Channel, Compression, Message, Schema, WriteOptions};

use super::{EmptyInputs, Imported, TableError};
use crate::robot::Robot;

/// A joint state in CDR, little- or big-endian.
fn joint_state(stamp_ns: u64, names: &[&str], numbers: [&[f64]; 3], little: bool) -> Vec<u8> {
    let mut body = Vec::new();
    let align = |body: &mut Vec<u8>, size: usize| body.resize(body.len().next_multiple_of(size), 0);
    let u32 = |body: &mut Vec<u8>, value: u32| {
        align(body, 4);
        body.extend(if little { value.to_le_bytes() } else { value.to_be_bytes() });
    };
    let text = |body: &mut Vec<u8>, text: &str| {
        u32(body, text.len() as u32 + 1);
        body.extend(text.as_bytes());
        body.push(0);
    };
    u32(&mut body, (stamp_ns / 1_000_000_000) as u32);
    u32(&mut body, (stamp_ns % 1_000_000_000) as u32);
    text(&mut body, "base");
    u32(&mut body, names.len() as u32);
    names.iter().for_each(|name| text(&mut body, name));
    for numbers in numbers {
        u32(&mut body, numbers.len() as u32);
        for number in numbers {
            align(&mut body, 8);
            body.extend(if little { number.to_le_bytes() } else { number.to_be_bytes() });
        }
    }
    [&[0, u8::from(little), 0, 0], &body[..]].concat()
}

/// A bag of messages (topic, time of the log in ns, content), all of this type.
fn bag(schema: &str, messages: &[(&str, u64, Vec<u8>)]) -> Vec<u8> {
    let options = WriteOptions::new().profile("ros2").compression(Some(Compression::Lz4)).chunk_size(Some(4096));
    let mut writer = options.create(Cursor::new(Vec::new())).unwrap();
    let schema = Arc::new(Schema {
        id: 1,
        name: schema.to_owned(),
        encoding: "ros2msg".to_owned(),
        data: Cow::Borrowed(b"std_msgs/Header header"),
    });
    for (topic, log_time, data) in messages {
        let id = 1 + messages.iter().position(|(first, ..)| first == topic).unwrap() as u16;
        let channel = Channel {
            id,
            topic: (*topic).to_owned(),
            schema: Some(schema.clone()),
            message_encoding: "cdr".to_owned(),
            metadata: Default::default(),
        };
        let message = Message {
            channel: Arc::new(channel),
            sequence: 0,
            log_time: *log_time,
            publish_time: *log_time,
            data: Cow::Borrowed(data),
        };
        writer.write(&message).unwrap();
    }
    writer.finish().unwrap();
    writer.into_inner().into_inner()
}

const JOINT_STATE: &str = "sensor_msgs/msg/JointState";
/// An hour of the year 2024.
const START_NS: u64 = 1_714_561_200_000_000_000;

/// Two joints that take torques, without sensors but their encoders; `import` is added.
fn robot(import: &str) -> Robot {
    let joint = |name: &str| {
        format!(
            "[[joint]]\nname = \"{name}\"\nkind = \"revolute\"\naxis = [0.0, 0.0, 1.0]\nlimits_rad = [-3.0, 3.0]\ngravity = \"acts\"\n\
             transmission = \"rigid\"\nfriction = {{ law = \"none\" }}\ngear = 1.0\nparameters = {{ b = {{ start = 0.1 }} }}\n\
             body = {{ mass_kg = 1.0, centre_m = [0.1, 0.0, 0.0], inertia_kg_m2 = {{ xx = 0.01, yy = 0.01, zz = 0.01 }} }}\n"
        )
    };
    let sensor = |kind: &str, joint: &str| format!("[[sensor]]\nkind = \"{kind}\"\njoint = \"{joint}\"\n");
    let text = "name = \"two\"\nsample_period_s = 0.002\ncoriolis = true\ngravity_m_s2 = [0.0, 0.0, -9.81]\n[input]\nunit = \"newton_metre\"\n".to_owned()
        + &joint("shoulder")
        + &joint("elbow")
        + &sensor("motor_encoder", "shoulder")
        + "sigma_rad = 1e-4\n"
        + &sensor("motor_encoder", "elbow")
        + "sigma_rad = 1e-4\n"
        + &sensor("tachometer", "elbow")
        + "side = \"motor\"\nsigma_rad_s = 1e-2\n"
        + import;
    Robot::parse(&text).unwrap_or_else(|error| panic!("{error}"))
}

fn import(bytes: &[u8], robot: &Robot, inputs: Option<EmptyInputs>) -> Result<Imported, TableError> {
    super::parse(bytes, robot, Path::new("bag.mcap"), inputs)
}

#[track_caller]
fn refused(bytes: &[u8], robot: &Robot, parts: &[&str]) {
    let error = import(bytes, robot, None).unwrap_err();
    let text = format!("{error} | {}", error.advice());
    parts.iter().for_each(|part| assert!(text.contains(part), "`{part}` is not in: {text}"));
}

/// 100 states, 2 ms apart; joints stand in another order than in the robot file, and there is one more.
fn states(little: bool) -> Vec<u8> {
    let messages: Vec<_> = (0..100u64)
        .map(|k| {
            let x = k as f64;
            let stamp_ns = START_NS + 2_000_000 * k;
            let numbers: [&[f64]; 3] = [&[x, 10.0 + x, 20.0 + x], &[0.1, 0.2, f64::NAN], &[1.0, 2.0, 3.0]];
            (
                "/joint_states",
                stamp_ns + 300_000,
                joint_state(stamp_ns, &["elbow", "finger", "shoulder"], numbers, little),
            )
        })
        .collect();
    bag(JOINT_STATE, &messages)
}

#[test]
fn joint_states_are_read_by_the_names_of_joints() {
    for little in [true, false] {
        let Imported { recording, ignored, notes } = import(&states(little), &robot(""), None).unwrap();
        assert_eq!((recording.len(), recording.t_us[1], recording.gaps()), (100, 2000, 0));
        let at = |name: &str| recording.channel(name).unwrap().values[7];
        assert_eq!([at("theta1"), at("theta2"), at("thd2")], [27.0, 7.0, 0.1]);
        assert_eq!([recording.duty[0][7], recording.duty[1][7]], [3.0, 1.0]);
        assert!(notes[0].contains("100 joint states of /joint_states"), "{notes:?}");
        assert!(
            ignored.contains(&"finger.position".to_owned()) && !ignored.contains(&"stamp".to_owned()),
            "{ignored:?}"
        );
    }
}

#[test]
fn the_robot_file_says_which_joint_is_which_and_in_which_unit() {
    let mapped = robot(
        "[import.columns]\nu1 = { column = \"finger.effort\", unit = \"N cm\", sign = -1 }\ntheta1 = { column = \"finger.position\", unit = \"deg\" }\n",
    );
    let Imported { recording, .. } = import(&states(true), &mapped, None).unwrap();
    assert!((recording.channel("theta1").unwrap().values[0] - 10f64.to_radians()).abs() < 1e-15);
    assert_eq!(recording.duty[0][0], -0.02);
    let wrong = robot("[import.columns]\nu1 = { column = \"wrist.effort\" }\n");
    refused(&states(true), &wrong, &["`wrist.effort` for u1", "elbow.position", "import.columns.u1"]);
}

#[test]
fn commands_of_another_topic_are_joined_on_demand() {
    let names = ["shoulder", "elbow"];
    let mut messages = Vec::new();
    for k in 0..100u64 {
        let stamp_ns = START_NS + 2_000_000 * k;
        let x = k as f64;
        messages.push(("/joint_states", stamp_ns, joint_state(stamp_ns, &names, [&[x, -x], &[0.0, 0.0], &[]], true)));
        let command = joint_state(stamp_ns + 500_000, &names, [&[0.5, 0.5], &[], &[0.1 * x, 0.0]], true);
        messages.push(("/commands", stamp_ns + 500_000, command));
    }
    let bytes = bag(JOINT_STATE, &messages);
    // Both topics have positions, so each is named with its own.
    refused(&bytes, &robot(""), &["`shoulder.position` for theta1", "/joint_states/shoulder.position"]);
    let mapped = robot(
        "[import.columns]\ntheta1 = { column = \"/joint_states/shoulder.position\" }\ntheta2 = { column = \"/joint_states/elbow.position\" }\n",
    );
    refused(&bytes, &mapped, &["message 1", "inputs and sensors stand in different rows", "--inputs hold"]);
    let Imported { recording, .. } = import(&bytes, &mapped, Some(EmptyInputs::Hold)).unwrap();
    // The first state comes before any command.
    assert_eq!((recording.len(), recording.channels[0].values[0]), (99, 1.0));
    let expected = 0.25 * 0.1 * 9.0 + 0.75 * 0.1 * 10.0;
    assert!((recording.duty[0][9] - expected).abs() < 1e-12, "{}", recording.duty[0][9]);
}

#[test]
fn bags_that_hold_no_robot_are_refused_with_what_they_hold() {
    let image = bag("sensor_msgs/msg/Image", &[("/camera", START_NS, vec![0, 1, 0, 0])]);
    refused(&image, &robot(""), &["no sensor_msgs/msg/JointState", "/camera (sensor_msgs/msg/Image in cdr)"]);
    let cut = bag(JOINT_STATE, &[("/joint_states", START_NS, vec![0, 1, 0, 0, 7])]);
    refused(&cut, &robot(""), &["the message at byte", "mcap recover"]);
    refused(mcap::MAGIC, &robot(""), &["no sensor_msgs/msg/JointState message in it, but nothing"]);
    let twice = [states(true), states(true)].concat();
    refused(&twice, &robot(""), &["a second file begins at byte", "mcap merge"]);
    // Stamps that nobody set: the time of the log.
    let unset: Vec<_> = (0..10u64)
        .map(|k| {
            let state = joint_state(0, &["shoulder", "elbow"], [&[0.0, 0.0], &[0.0, 0.0], &[0.0, 0.0]], true);
            ("/joint_states", START_NS + 2_000_000 * k, state)
        })
        .collect();
    let Imported { recording, notes, .. } = import(&bag(JOINT_STATE, &unset), &robot(""), None).unwrap();
    assert_eq!(recording.t_us[9], 18_000);
    assert!(notes.iter().any(|note| note.contains("no stamp")), "{notes:?}");
    // Any byte that is wrong ends in words.
    let whole = states(true);
    for at in (0..whole.len()).step_by(61) {
        let mut bytes = whole.clone();
        bytes[at] ^= 0x15;
        let _ = import(&bytes, &robot(""), None).map_err(|error| assert!(!error.advice().is_empty()));
    }
}
