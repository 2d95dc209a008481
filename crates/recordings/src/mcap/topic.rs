//! Topics of an MCAP file: what they are called, their messages in CDR, and files of them written and read.

use std::collections::BTreeMap;
use std::io::{self, Seek, Write};
use std::path::{Path, PathBuf};

use byteorder::{BigEndian, LittleEndian};
use mcap::records::{MessageHeader, op};
use mcap::{McapError, WriteOptions, Writer};
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::framing::{self, Fields, Record, RecordReader, damaged};
use tautline_core::record::{ReadFault, RecordError};

/// Name of the writer of the file, for MCAP tools.
const LIBRARY: &str = concat!("tautline ", env!("CARGO_PKG_VERSION"));

/// How ROS 2 marks plain little-endian CDR at the head of each message.
const CDR_LITTLE_ENDIAN: [u8; 4] = [0, 1, 0, 0];

/// Encoding of messages in CDR.
pub(crate) const CDR: &str = "cdr";

/// What a topic is called and how its messages are to be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Topic<'a> {
    /// Its name, such as `/scene`.
    pub name: &'a str,
    /// How messages are encoded, such as `protobuf`.
    pub message_encoding: &'a str,
    /// Name of their schema.
    pub schema_name: &'a str,
    /// How the schema is encoded.
    pub schema_encoding: &'a str,
    /// The schema.
    pub schema: &'a [u8],
}

impl<'a> Topic<'a> {
    /// A topic of messages in CDR whose schema is a ROS 2 message definition.
    pub(crate) const fn cdr(name: &'a str, schema_name: &'a str, schema: &'a str) -> Self {
        let schema = schema.as_bytes();
        Self { name, message_encoding: CDR, schema_name, schema_encoding: "ros2msg", schema }
    }
}

/// Replaces the content of `bytes` by the message in CDR.
pub(crate) fn encode(message: &impl Serialize, bytes: &mut Vec<u8>) -> io::Result<()> {
    bytes.clear();
    bytes.extend_from_slice(&CDR_LITTLE_ENDIAN);
    cdr_encoding::to_writer::<_, LittleEndian, _>(bytes, message).map_err(io::Error::other)
}

/// Reads a message in CDR of either byte order; the error says what is wrong with it. Bytes behind its last field are
/// ignored, so that fields can be added later.
pub(crate) fn decode<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, String> {
    let message = match bytes {
        [0, 1, _, _, body @ ..] => cdr_encoding::from_bytes::<T, LittleEndian>(body),
        [0, 0, _, _, body @ ..] => cdr_encoding::from_bytes::<T, BigEndian>(body),
        _ => return Err("it does not begin as CDR does".to_owned()),
    };
    message.map(|(message, _)| message).map_err(|error| error.to_string())
}

/// Nanoseconds since the zero of a clock; 0 for what is before it or not a number.
pub(crate) fn log_time_ns(epoch_ns: i64, time_s: f64) -> u64 {
    #[expect(clippy::cast_possible_truncation, reason = "the cast saturates")]
    let since_epoch = (time_s * 1e9).round() as i64;
    u64::try_from(epoch_ns.saturating_add(since_epoch)).unwrap_or(0)
}

/// Writes the messages of some topics.
pub(crate) struct TopicWriter<W: Write + Seek> {
    out: Writer<W>,
    /// Number of each topic's channel and of its messages so far.
    channels: Vec<(u16, u32)>,
}

impl<W: Write + Seek> TopicWriter<W> {
    pub(crate) fn new(out: W, options: WriteOptions) -> io::Result<Self> {
        let out = options.library(LIBRARY).create(out).map_err(io_error)?;
        Ok(Self { out, channels: Vec::new() })
    }

    /// Declares a topic and gives its place among all that are declared.
    pub(crate) fn declare(&mut self, topic: &Topic<'_>) -> io::Result<usize> {
        let schema = self.out.add_schema(topic.schema_name, topic.schema_encoding, topic.schema).map_err(io_error)?;
        let channel = self.out.add_channel(schema, topic.name, topic.message_encoding, &BTreeMap::new());
        self.channels.push((channel.map_err(io_error)?, 0));
        Ok(self.channels.len() - 1)
    }

    /// Writes a message of the topic in this place.
    pub(crate) fn write(&mut self, topic: usize, log_time: u64, message: &[u8]) -> io::Result<()> {
        let (channel_id, sequence) = &mut self.channels[topic];
        let header = MessageHeader { channel_id: *channel_id, sequence: *sequence, log_time, publish_time: log_time };
        *sequence = sequence.wrapping_add(1);
        self.out.write_to_known_channel(&header, message).map_err(io_error)
    }

    /// Closes the chunk and hands it to the system.
    pub(crate) fn flush(&mut self) -> io::Result<()> {
        self.out.flush().map_err(io_error)
    }

    /// Writes what is waiting and the closing index.
    pub(crate) fn finish(&mut self) -> io::Result<()> {
        self.out.finish().map(drop).map_err(io_error)
    }

    /// Leaves the file as it is: a writer that is dropped closes it as if it were whole.
    pub(crate) fn abandon(self) {
        drop(self.out.into_inner());
    }
}

fn io_error(error: McapError) -> io::Error {
    match error {
        McapError::Io(error) => error,
        other => io::Error::other(other),
    }
}

/// A topic as a file declares it.
#[derive(Clone, Debug)]
pub(crate) struct Declared {
    pub(crate) channel: u16,
    pub(crate) topic: String,
    /// Name of the schema; empty where it has none.
    pub(crate) schema: String,
    pub(crate) encoding: String,
}

/// A message of a topic.
pub(crate) struct Message<'a> {
    /// Where in the file it, or the chunk around it, begins \[bytes\].
    pub(crate) offset: u64,
    pub(crate) of: &'a Declared,
    pub(crate) log_ns: u64,
    pub(crate) bytes: &'a [u8],
}

/// What a file says next.
pub(crate) enum Part<'a> {
    /// The name of a schema.
    Schema(&'a str),
    Topic(&'a Declared),
    Message(Message<'a>),
    /// What tells nothing of topics, or a message of a topic that was not declared.
    Other,
}

/// Reads topics and their messages in the order of the file.
pub(crate) struct TopicReader {
    path: PathBuf,
    records: RecordReader,
    schemas: BTreeMap<u16, String>,
    topics: BTreeMap<u16, Declared>,
}

impl TopicReader {
    pub(crate) fn open(path: &Path) -> Result<Self, RecordError> {
        let records = RecordReader::open(path).map_err(|error| framing::error(path, error))?;
        Ok(Self { path: path.to_owned(), records, schemas: BTreeMap::new(), topics: BTreeMap::new() })
    }

    /// A fault of the file's content.
    pub(crate) fn fault(&self, fault: ReadFault) -> RecordError {
        RecordError::Read { path: self.path.display().to_string(), fault }
    }

    /// Whether the file was closed.
    pub(crate) fn is_complete(&self) -> bool {
        self.records.is_complete()
    }

    /// The next part; `None` at the end, or where a file that was not closed breaks off.
    pub(crate) fn next(&mut self) -> Result<Option<Part<'_>>, RecordError> {
        let path = &self.path;
        let record = self.records.next().map_err(|error| framing::error(path, error))?;
        let Some(Record { offset, opcode, body }) = record else { return Ok(None) };
        let mut fields = Fields(body);
        let part = match opcode {
            op::SCHEMA => fields.u16().zip(fields.str()).map(|(number, name)| {
                self.schemas.insert(number, name.to_owned());
                Part::Schema(name)
            }),
            op::CHANNEL => declared(fields, &self.schemas).map(|declared| {
                let channel = declared.channel;
                Part::Topic(self.topics.entry(channel).insert_entry(declared).into_mut())
            }),
            op::MESSAGE => message(fields).map(|(channel, log_ns, bytes)| match self.topics.get(&channel) {
                Some(of) => Part::Message(Message { offset, of, log_ns, bytes }),
                None => Part::Other,
            }),
            _ => Some(Part::Other),
        };
        let short = || framing::error(path, damaged(offset, "a record is shorter than its fields"));
        part.map(Some).ok_or_else(short)
    }
}

fn declared(mut fields: Fields<'_>, schemas: &BTreeMap<u16, String>) -> Option<Declared> {
    let (channel, schema) = (fields.u16()?, fields.u16()?);
    let (topic, encoding) = (fields.str()?.to_owned(), fields.str()?.to_owned());
    Some(Declared { channel, topic, schema: schemas.get(&schema).cloned().unwrap_or_default(), encoding })
}

/// Channel, time of logging \[ns\] and content of a message.
fn message(mut fields: Fields<'_>) -> Option<(u16, u64, &[u8])> {
    let channel = fields.u16()?;
    let _sequence = fields.u32()?;
    let (log_ns, _publish_ns) = (fields.u64()?, fields.u64()?);
    Some((channel, log_ns, fields.0))
}
