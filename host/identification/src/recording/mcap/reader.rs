//! Reads a recording, whole or damaged. What is read is right, what is not is told.

use std::collections::HashMap;
use std::path::Path;

use mcap::records::op;

use super::error::{Damage, ReadError};
use super::protobuf::{MessageType, NoMessage};
use super::records::{self, Record, Records};
use super::schema::{self, SampleDecoder, SessionFile};
use super::{FORMAT_VERSION, MOTION_FILE, PROFILE, ROBOT_FILE, SESSION_FILE};
use crate::recording::{MotionFile, Recorder, Recording, Session, Source, sha256};
use crate::robot::Robot;

/// Reads the file at `path`.
///
/// # Errors
/// [`ReadError`].
pub fn read(path: &Path) -> Result<Recording, ReadError> {
    let bytes = std::fs::read(path).map_err(|source| ReadError::Open { path: path.to_owned(), source })?;
    parse(&bytes, path)
}

/// Reads a recording from the bytes of a file; `path` is only noted as its source.
///
/// # Errors
/// [`ReadError`], but never [`ReadError::Open`].
pub fn parse(bytes: &[u8], path: &Path) -> Result<Recording, ReadError> {
    if !bytes.starts_with(mcap::MAGIC) {
        return Err(not_mcap(bytes));
    }
    let mut parser = Parser::default();
    let mut records = Records::from(bytes, mcap::MAGIC.len());
    let mut closed = false;
    for record in &mut records {
        match record.opcode {
            op::DATA_END => {
                closed = true;
                parser.data_end(&bytes[..record.at], record);
            }
            _ if closed => {} // the summary repeats what was read
            _ => parser.record(record)?,
        }
    }
    let end = records.at();
    if let Some(at_byte) = records.next_file().filter(|_| closed) {
        return Err(ReadError::Several { at_byte: at_byte as u64 });
    }
    if !closed || !bytes.ends_with(mcap::MAGIC) {
        // Where a file is whole, the magic follows the last record.
        let lost_bytes = if closed { 0 } else { (bytes.len() - end) as u64 };
        parser.damage.push(Damage::CutOff { at_byte: end as u64, lost_bytes });
    }
    let source = Source { path: path.to_owned(), sha256: sha256(bytes) };
    parser.finish(source, end as u64)
}

#[derive(Default)]
struct Parser {
    profile_seen: bool,
    robot: Option<String>,
    motion: Option<String>,
    session: Option<SessionFile>,
    schemas: HashMap<u16, MessageType>,
    topics: HashMap<u16, Topic>,
    recorder: Option<Recorder>,
    damage: Vec<Damage>,
}

enum Topic {
    Sample(SampleDecoder),
    Event,
    Log,
    Balance,
}

impl Parser {
    fn record(&mut self, record: Record<'_>) -> Result<(), ReadError> {
        let Record { at, opcode, body } = record;
        let left_out = |reason: String| Damage::Record { what: records::name(opcode), at_byte: at as u64, reason };
        match opcode {
            op::HEADER => match records::profile(body) {
                Some(PROFILE) => self.profile_seen = true,
                Some(_) => {
                    return Err(ReadError::Foreign {
                        found: "an MCAP file of another program",
                        advice: "import it: host import BAG.mcap --robot R -o RUN.mcap reads the joint states of a ROS 2 bag; export others to a CSV table and import that",
                    });
                }
                None => self.damage.push(left_out("it does not parse".to_owned())),
            },
            op::ATTACHMENT => match records::attachment(body) {
                Some((name, content)) => self.attachment(name, content, at)?,
                None => self.damage.push(left_out("its checksum does not fit".to_owned())),
            },
            op::CHUNK => match records::unpack_chunk(body) {
                Ok(unpacked) => self.chunk(&unpacked, at)?,
                Err(reason) => self.damage.push(left_out(reason)),
            },
            // Not ours: without a chunk around it, a record has no checksum. A tool that rewrote the file made it so.
            op::SCHEMA | op::CHANNEL | op::MESSAGE => self.inner(record, at)?,
            _ => {}
        }
        Ok(())
    }

    /// The checksum over everything: it tells of what the others cannot, a record that lost its kind.
    fn data_end(&mut self, before: &[u8], record: Record<'_>) {
        let saved = record.body.try_into().map_or(0, u32::from_le_bytes);
        if self.damage.is_empty() && saved != 0 && saved != crc32fast::hash(before) {
            let reason = "its checksum does not fit: a part of it may have been left out".to_owned();
            self.damage.push(Damage::Record { what: "data section", at_byte: 0, reason });
        }
    }

    fn attachment(&mut self, name: &str, content: &[u8], at: usize) -> Result<(), ReadError> {
        let senseless = || ReadError::Senseless { what: "attachment", at_byte: at as u64, source: None };
        let text = || std::str::from_utf8(content).map(str::to_owned).map_err(|_| senseless());
        match name {
            ROBOT_FILE => self.robot = Some(text()?),
            MOTION_FILE => self.motion = Some(text()?),
            SESSION_FILE => {
                let value: serde_json::Value = serde_json::from_slice(content).map_err(|_| senseless())?;
                let version = value.get("format_version").and_then(serde_json::Value::as_u64).ok_or_else(senseless)?;
                if version > FORMAT_VERSION.into() {
                    let file = u32::try_from(version).unwrap_or(u32::MAX);
                    return Err(ReadError::Version { file, ours: FORMAT_VERSION });
                }
                self.session = Some(serde_json::from_value(value).map_err(|_| senseless())?);
            }
            _ => {}
        }
        Ok(())
    }

    fn chunk(&mut self, unpacked: &[u8], at: usize) -> Result<(), ReadError> {
        let mut records = Records::from(unpacked, 0);
        for record in &mut records {
            self.inner(record, at)?;
        }
        match records.at() == unpacked.len() {
            true => Ok(()),
            false => Err(ReadError::Senseless { what: "chunk", at_byte: at as u64, source: None }),
        }
    }

    /// A record inside of the chunk at byte `at`.
    fn inner(&mut self, record: Record<'_>, at: usize) -> Result<(), ReadError> {
        let what = records::name(record.opcode);
        let senseless = || ReadError::Senseless { what, at_byte: at as u64, source: None };
        match record.opcode {
            op::SCHEMA => {
                let (id, name, content) = records::schema(record.body).ok_or_else(senseless)?;
                if let Some(message) = MessageType::from_descriptor(name, content) {
                    self.schemas.insert(id, message);
                }
            }
            op::CHANNEL => {
                let channel = records::channel(record.body).ok_or_else(senseless)?;
                self.channel(channel.id, channel.schema, channel.topic, at)?;
            }
            op::MESSAGE => {
                let message = records::message(record.body).ok_or_else(senseless)?;
                self.message(message.channel, message.content, at)?;
            }
            _ => {}
        }
        Ok(())
    }

    fn channel(&mut self, id: u16, schema_id: u16, topic: &str, at: usize) -> Result<(), ReadError> {
        if self.topics.contains_key(&id) {
            return Ok(()); // repeated in a later chunk
        }
        let topic = match topic {
            topic if topic == schema::SAMPLE.0 => {
                let recorder = self.recorder(at as u64)?;
                let robot = recorder.robot().clone();
                let missing = |column| ReadError::Column { column };
                let written = self.schemas.get(&schema_id).ok_or_else(|| missing("t_us".to_owned()))?;
                Topic::Sample(SampleDecoder::new(written, &robot).map_err(|column| missing(column.0))?)
            }
            topic if topic == schema::EVENT.0 => Topic::Event,
            topic if topic == schema::LOG.0 => Topic::Log,
            topic if topic == schema::BALANCE.0 => Topic::Balance,
            _ => return Ok(()), // added by another tool
        };
        self.topics.insert(id, topic);
        Ok(())
    }

    fn message(&mut self, id: u16, content: &[u8], at: usize) -> Result<(), ReadError> {
        let at_byte = at as u64;
        let senseless = |what| move |NoMessage| ReadError::Senseless { what, at_byte, source: None };
        let (Some(topic), Some(recorder)) = (self.topics.get_mut(&id), self.recorder.as_mut()) else {
            return Ok(());
        };
        match topic {
            Topic::Sample(decoder) => {
                let row = decoder.decode(content).map_err(senseless("sample"))?;
                recorder.push(&row).map_err(|error| ReadError::Senseless {
                    what: "sample",
                    at_byte,
                    source: Some(error),
                })?;
            }
            Topic::Event => recorder.event(schema::decode_event(content).map_err(senseless("event"))?),
            Topic::Log => recorder.log(schema::decode_log(content).map_err(senseless("line of the log"))?),
            Topic::Balance => recorder.balance(schema::decode_balance(content).map_err(senseless("loss balance"))?),
        }
        Ok(())
    }

    /// The recorder, made when the first channel is met: all that it needs comes before.
    fn recorder(&mut self, at_byte: u64) -> Result<&mut Recorder, ReadError> {
        if self.recorder.is_none() {
            let missing = |missing| ReadError::NothingUsable { at_byte, missing };
            let robot = self.robot.as_deref().ok_or_else(|| missing("the robot description"))?;
            let about = self.session.take().ok_or_else(|| missing("the session's facts"))?;
            let motion = about.motion.map(|name| {
                let toml = self.motion.take().ok_or_else(|| missing("the motion"))?;
                Ok::<_, ReadError>(MotionFile { name, toml })
            });
            self.recorder = Some(Recorder::new(Session {
                robot: Robot::parse(robot)?,
                motion: motion.transpose()?,
                zero_rad: about.zero_rad,
                firmware: about.firmware,
                gyro_times: about.gyro_times,
                imported_from: about.imported_from,
                period_s: about.period_s.filter(|period_s| period_s.is_finite() && *period_s > 0.0),
            }));
        }
        Ok(self.recorder.as_mut().expect("made in the lines above"))
    }

    fn finish(self, source: Source, at_byte: u64) -> Result<Recording, ReadError> {
        let missing = if self.profile_seen { "the first sample" } else { "its header" };
        let recorder = self.recorder.filter(|recorder| !recorder.is_empty());
        let mut recording = recorder.ok_or(ReadError::NothingUsable { at_byte, missing })?.finish(source);
        recording.damage = self.damage;
        Ok(recording)
    }
}

/// What a file without MCAP's first bytes looks like.
fn not_mcap(bytes: &[u8]) -> ReadError {
    let import = "import it: host import DATA.csv -o RUN.mcap";
    let start = &bytes[..bytes.len().min(4096)];
    // A window on a text may cut its last character in two.
    let text = match std::str::from_utf8(start) {
        Ok(text) => Some(text),
        Err(error) if error.error_len().is_none() => std::str::from_utf8(&start[..error.valid_up_to()]).ok(),
        Err(_) => None,
    };
    match text {
        _ if bytes.is_empty() => ReadError::Empty,
        _ if mcap::MAGIC.starts_with(bytes) => {
            ReadError::NothingUsable { at_byte: bytes.len() as u64, missing: "its header" }
        }
        _ if bytes.starts_with(&[0x1f, 0x8b]) => {
            ReadError::Foreign { found: "a gzip file (a compressed table?)", advice: import }
        }
        _ if start.iter().all(|&byte| byte == 0) => ReadError::Foreign {
            found: "a file of zeros, as a power cut leaves behind",
            advice: "there is no sample in it to save: record again",
        },
        Some(text) if text.contains(',') && text.contains('\n') => {
            ReadError::Foreign { found: "a table of text", advice: import }
        }
        _ => ReadError::Foreign {
            found: "a file of another kind",
            advice: "give a file that `host record` or `host import` has made (RUN.mcap)",
        },
    }
}
