//! ROS 2 bags: the joint states of an MCAP file as the columns of a table.
//!
//! ```text
//!   /joint_states  sensor_msgs/msg/JointState     column                       stands for, unless [import] says otherwise
//!     header.stamp                                stamp (ns; else log_time)    the time
//!     name[i] = "elbow", position[i]              elbow.position               theta or q of the joint `elbow`
//!                        velocity[i]              elbow.velocity               thd or qd
//!                        effort[i]                elbow.effort                 u, where the input is a torque or force
//! ```
//!
//! Several topics are joined by time; where a joint is in more than one, its columns begin with the topic
//! (`/joint_commands/elbow.effort`).

use std::collections::{BTreeMap, HashMap};

use mcap::records::op;

use super::cdr::{self, JointState};
use super::header::Header;
use super::rows::Rows;
use super::{Place, TableError};
use crate::recording::mcap::{PROFILE, records};
use crate::robot::{ChannelKind, Import, ImportColumn, ImportTime, InputUnit, Robot, TimeUnit};

const JOINT_STATES: [&str; 2] = ["sensor_msgs/msg/JointState", "sensor_msgs/JointState"];

/// The rows of a bag, the columns that are passed over, and what is worth knowing of it.
pub(super) fn rows(bytes: &[u8], robot: &Robot) -> Result<(Rows, Vec<String>, Vec<String>), TableError> {
    let mut bag = Bag::default();
    bag.read(bytes)?;
    bag.messages.sort_by_key(|message| message.log_ns);
    let topics: Vec<&str> = bag.topics.values().map(String::as_str).collect();
    if bag.messages.is_empty() {
        let others = bag.others.iter().map(|(topic, schema)| format!("{topic} ({schema})")).collect::<Vec<_>>();
        let others = if others.is_empty() { "nothing".to_owned() } else { others.join(", ") };
        return Err(refuse(
            format!("there is no sensor_msgs/msg/JointState message in it, but {others}"),
            "record the topic with the joint states, or export what is there to a CSV table and import that",
        ));
    }
    let mut notes = bag.notes.clone();
    let stamped = bag.messages.iter().all(|message| message.state.stamp_ns > 0);
    if !stamped {
        notes.push(
            "messages have no stamp in their header: the time at which they were written to the bag is taken"
                .to_owned(),
        );
    }
    let time_ns = |message: &Message| if stamped { message.state.stamp_ns } else { i128::from(message.log_ns) };
    let first_ns = bag.messages.iter().map(time_ns).min().unwrap_or(0);
    let times = bag.messages.iter().map(|message| ((time_ns(message) - first_ns) as f64 * 1e-3).round() as u64);
    let times: Vec<u64> = times.collect();

    let columns = Columns::of(&bag.messages);
    let import = import(robot, &columns.names);
    let header = Header::named(columns.names.clone(), robot, &import, Place::Message(1))?;
    let ignored = header.ignored.iter().filter(|name| *name != TIME).cloned().collect();
    let mut rows = Rows::new(header, robot);
    let mut order: Vec<usize> = (0..times.len()).collect();
    // What one publisher sent stays in its order: a clock that runs backwards is told by the row.
    if topics.len() > 1 {
        order.sort_by_key(|&k| times[k]);
    }
    let mut at = 0;
    let mut fields = vec![None; columns.names.len()];
    while at < order.len() {
        fields.fill(None);
        let (t_us, place) = (times[order[at]], Place::Message(order[at] as u64 + 1));
        let topic = bag.messages[order[at]].channel;
        columns.fill(&bag.messages[order[at]], &mut fields);
        at += 1;
        // Messages of other topics with the same stamp are the same row.
        while at < order.len() && times[order[at]] == t_us && bag.messages[order[at]].channel != topic {
            columns.fill(&bag.messages[order[at]], &mut fields);
            at += 1;
        }
        rows.push(place, t_us, |field| Ok(fields[field]))?;
    }
    notes.insert(0, format!("{} joint states of {} read", bag.messages.len(), topics.join(", ")));
    Ok((rows, ignored, notes))
}

/// Name of the column with the time.
const TIME: &str = "stamp";

/// What the robot file says of columns, and for all else the joints of the same names.
fn import(robot: &Robot, names: &[String]) -> Import {
    let given = robot.import.clone();
    let mut columns = given.as_ref().map_or_else(
        || {
            let own = robot.columns().into_iter().skip(1);
            own.map(|name| ImportColumn { column: name.clone(), name, zero: 0.0, factor: 1.0 }).collect()
        },
        |import| import.columns.clone(),
    );
    let by_joint = |joint: usize, what: &str| format!("{}.{what}", robot.joints[joint].name);
    let is_effort = matches!(robot.input.unit, InputUnit::NewtonMetre | InputUnit::Newton);
    let inputs = (0..robot.joints.len()).map(|joint| is_effort.then(|| by_joint(joint, "effort")));
    let channels = robot.channels().into_iter().map(|channel| match channel.kind {
        ChannelKind::MotorPosition { joint } | ChannelKind::LinkPosition { joint } => Some(by_joint(joint, "position")),
        ChannelKind::MotorSpeed { joint } | ChannelKind::LinkSpeed { joint } => Some(by_joint(joint, "velocity")),
        ChannelKind::GyroAxis { .. } => None,
    });
    for (column, default) in columns.iter_mut().zip(inputs.chain(channels)) {
        if let Some(default) = default.filter(|_| column.column == column.name && !names.contains(&column.column)) {
            column.column = default;
        }
    }
    Import {
        time: Some(ImportTime { column: TIME.to_owned(), unit: TimeUnit::Microseconds, zero: 0.0 }),
        separator: ',',
        decimal: '.',
        missing: Vec::new(),
        torque_on: given.and_then(|import| import.torque_on),
        columns,
    }
}

/// A joint state as it stands in the bag.
struct Message {
    channel: u16,
    topic: String,
    log_ns: u64,
    state: JointState,
}

/// What is found in a bag.
#[derive(Default)]
struct Bag {
    schemas: HashMap<u16, String>,
    /// Of joint states, by channel.
    topics: BTreeMap<u16, String>,
    /// Other topics and what they carry.
    others: BTreeMap<String, String>,
    messages: Vec<Message>,
    notes: Vec<String>,
}

impl Bag {
    fn read(&mut self, bytes: &[u8]) -> Result<(), TableError> {
        let mut walk = records::Records::from(bytes, mcap::MAGIC.len());
        let mut closed = false;
        for record in &mut walk {
            match record.opcode {
                op::HEADER if records::profile(record.body) == Some(PROFILE) => {
                    let (found, advice) =
                        ("a recording of this program", "it needs no import: give it to `host check` as it is");
                    return Err(TableError::Foreign { found, advice });
                }
                op::DATA_END => closed = true,
                _ if closed => {}
                op::CHUNK => {
                    let unpacked = records::unpack_chunk(record.body).map_err(|reason| {
                        refuse(
                            format!("the chunk at byte {} does not unpack: {reason}", record.at),
                            "copy the file again from where it was made, or make it anew: mcap recover BAG.mcap -o OUT.mcap",
                        )
                    })?;
                    for inner in records::Records::from(&unpacked, 0) {
                        self.record(inner, record.at)?;
                    }
                }
                _ => self.record(record, record.at)?,
            }
        }
        if let Some(at_byte) = walk.next_file() {
            return Err(refuse(
                format!("a second file begins at byte {at_byte}: several were put one behind the other"),
                "merge them with `mcap merge`, or import each by itself",
            ));
        }
        if !closed {
            self.notes.push(format!("the bag was cut off at byte {}: what stands before it is read", walk.at()));
        }
        Ok(())
    }

    fn record(&mut self, record: records::Record<'_>, at: usize) -> Result<(), TableError> {
        let senseless = || {
            let what = format!("the {} at byte {at} makes no sense", records::name(record.opcode));
            refuse(what, "the bag is damaged: make it anew with `mcap recover BAG.mcap -o OUT.mcap`")
        };
        match record.opcode {
            op::SCHEMA => {
                let (id, name, _) = records::schema(record.body).ok_or_else(senseless)?;
                self.schemas.insert(id, name.to_owned());
            }
            op::CHANNEL => {
                let channel = records::channel(record.body).ok_or_else(senseless)?;
                let schema = self.schemas.get(&channel.schema).map_or("no schema", String::as_str);
                match JOINT_STATES.contains(&schema) && channel.encoding == "cdr" {
                    true => drop(self.topics.insert(channel.id, channel.topic.to_owned())),
                    false => {
                        let carries = format!("{schema} in {}", channel.encoding);
                        self.others.insert(channel.topic.to_owned(), carries);
                    }
                }
            }
            op::MESSAGE => {
                let message = records::message(record.body).ok_or_else(senseless)?;
                if let Some(topic) = self.topics.get(&message.channel) {
                    let state = cdr::joint_state(message.content).ok_or_else(senseless)?;
                    let topic = topic.clone();
                    self.messages.push(Message { channel: message.channel, topic, log_ns: message.log_ns, state });
                }
            }
            _ => {}
        }
        Ok(())
    }
}

/// Which column each number of a message is.
struct Columns {
    names: Vec<String>,
    /// By channel, joint and what (0 position, 1 velocity, 2 effort).
    places: HashMap<(u16, String, usize), usize>,
}

impl Columns {
    fn of(messages: &[Message]) -> Self {
        let mut found: Vec<(u16, &str, &str, usize)> = Vec::new();
        let mut seen = std::collections::HashSet::new();
        for message in messages {
            for joint in &message.state.names {
                for (what, _) in parts(&message.state).into_iter().enumerate().filter(|(_, part)| !part.is_empty()) {
                    if seen.insert((message.channel, joint.as_str(), what)) {
                        found.push((message.channel, &message.topic, joint, what));
                    }
                }
            }
        }
        let mut columns = Self { names: vec![TIME.to_owned()], places: HashMap::new() };
        for &(channel, topic, joint, what) in &found {
            let alone = !found.iter().any(|other| other.0 != channel && other.2 == joint && other.3 == what);
            let short = format!("{joint}.{}", ["position", "velocity", "effort"][what]);
            columns.places.insert((channel, joint.to_owned(), what), columns.names.len());
            columns.names.push(if alone { short } else { format!("{topic}/{short}") });
        }
        columns
    }

    fn fill(&self, message: &Message, fields: &mut [Option<f64>]) {
        for (what, part) in parts(&message.state).into_iter().enumerate() {
            for (joint, value) in message.state.names.iter().zip(part) {
                if let Some(&place) = self.places.get(&(message.channel, joint.clone(), what)) {
                    // NaN is how ROS says that there is no reading.
                    fields[place] = Some(*value).filter(|value| value.is_finite());
                }
            }
        }
    }
}

fn parts(state: &JointState) -> [&[f64]; 3] {
    [&state.position, &state.velocity, &state.effort]
}

fn refuse(what: String, advice: &str) -> TableError {
    TableError::Bag { what, advice: advice.to_owned() }
}
