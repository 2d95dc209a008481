//! Topics of an MCAP file: names and schemas, messages in CDR, writer and reader.

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

/// Library name in the file header, for MCAP tools.
const LIBRARY: &str = concat!("tautline ", env!("CARGO_PKG_VERSION"));

/// Encapsulation header of plain little-endian CDR in ROS 2.
const CDR_LITTLE_ENDIAN: [u8; 4] = [0, 1, 0, 0];

/// Name of the message encoding CDR.
pub(crate) const CDR: &str = "cdr";

/// Name, encoding and schema of a topic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Topic<'a> {
    /// Name, such as `/scene`.
    pub name: &'a str,
    /// Encoding of the messages, such as `protobuf`.
    pub message_encoding: &'a str,
    /// Name of the schema.
    pub schema_name: &'a str,
    /// Encoding of the schema.
    pub schema_encoding: &'a str,
    /// Content of the schema.
    pub schema: &'a [u8],
}

impl<'a> Topic<'a> {
    /// Returns a topic with messages in CDR and a ROS 2 message definition as schema.
    pub(crate) const fn cdr(name: &'a str, schema_name: &'a str, schema: &'a str) -> Self {
        let schema = schema.as_bytes();
        Self { name, message_encoding: CDR, schema_name, schema_encoding: "ros2msg", schema }
    }
}

/// Length of the header of CDR.
const HEADER: usize = 4;
/// Largest alignment of CDR, which padding stays below.
const PADDING: usize = 8;

/// Replaces the content of `bytes` with the message in CDR.
pub(crate) fn encode(message: &impl Serialize, bytes: &mut Vec<u8>) -> io::Result<()> {
    bytes.clear();
    bytes.extend_from_slice(&CDR_LITTLE_ENDIAN);
    cdr_encoding::to_writer::<_, LittleEndian, _>(bytes, message).map_err(io::Error::other)
}

/// Reads a message in CDR of either byte order; the error describes the damage. Bytes after the last field are ignored,
/// so that later versions can append fields.
pub(crate) fn decode<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, String> {
    decode_start(bytes).map(|(message, _)| message)
}

/// Reads a message in CDR like [`decode`], and refuses bytes after the last field, except for padding.
pub(crate) fn decode_whole<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, String> {
    let (message, rest) = decode_start(bytes)?;
    if rest.len() < PADDING && rest.iter().all(|byte| *byte == 0) {
        return Ok(message);
    }
    Err(format!("it has {} bytes after its last field", rest.len()))
}

/// Reads a message in CDR, and returns the bytes after it.
fn decode_start<T: DeserializeOwned>(bytes: &[u8]) -> Result<(T, &[u8]), String> {
    let message = match bytes {
        [0, 1, _, _, body @ ..] => cdr_encoding::from_bytes::<T, LittleEndian>(body),
        [0, 0, _, _, body @ ..] => cdr_encoding::from_bytes::<T, BigEndian>(body),
        _ => return Err("it has no CDR header".to_owned()),
    };
    let (message, length) = message.map_err(|error| error.to_string())?;
    Ok((message, bytes.get(HEADER + length..).unwrap_or_default()))
}

/// Returns the time in nanoseconds since the epoch of the clock; 0 for earlier times and NaN.
pub(crate) fn log_time_ns(epoch_ns: i64, time_s: f64) -> u64 {
    #[expect(clippy::cast_possible_truncation, reason = "the cast saturates")]
    let since_epoch = (time_s * 1e9).round() as i64;
    u64::try_from(epoch_ns.saturating_add(since_epoch)).unwrap_or(0)
}

/// Writer of messages on several topics.
pub(crate) struct TopicWriter<W: Write + Seek> {
    out: Writer<W>,
    /// Channel number and message count of each topic.
    channels: Vec<(u16, u32)>,
}

impl<W: Write + Seek> TopicWriter<W> {
    pub(crate) fn new(out: W, options: WriteOptions) -> io::Result<Self> {
        let out = options.library(LIBRARY).create(out).map_err(io_error)?;
        Ok(Self { out, channels: Vec::new() })
    }

    /// Declares a topic and returns its index.
    pub(crate) fn declare(&mut self, topic: &Topic<'_>) -> io::Result<usize> {
        let schema = self.out.add_schema(topic.schema_name, topic.schema_encoding, topic.schema).map_err(io_error)?;
        let channel = self.out.add_channel(schema, topic.name, topic.message_encoding, &BTreeMap::new());
        self.channels.push((channel.map_err(io_error)?, 0));
        Ok(self.channels.len() - 1)
    }

    /// Writes a message on the topic with this index.
    pub(crate) fn write(&mut self, topic: usize, log_time: u64, message: &[u8]) -> io::Result<()> {
        let (channel_id, sequence) = &mut self.channels[topic];
        let header = MessageHeader { channel_id: *channel_id, sequence: *sequence, log_time, publish_time: log_time };
        *sequence = sequence.wrapping_add(1);
        self.out.write_to_known_channel(&header, message).map_err(io_error)
    }

    /// Closes the chunk and writes it to the file.
    pub(crate) fn flush(&mut self) -> io::Result<()> {
        self.out.flush().map_err(io_error)
    }

    /// Writes the remaining messages and the closing index.
    pub(crate) fn finish(&mut self) -> io::Result<()> {
        self.out.finish().map(drop).map_err(io_error)
    }

    /// Leaves the file unfinished. Dropping the writer instead would close the file as if it were complete.
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

/// Topic as declared in a file.
#[derive(Clone, Debug)]
pub(crate) struct DeclaredTopic {
    pub(crate) channel: u16,
    pub(crate) topic: String,
    /// Name of the schema; empty without a schema.
    pub(crate) schema: String,
    pub(crate) encoding: String,
    /// Definition of the messages; empty if the file has none, or if it is no text.
    pub(crate) definition: String,
}

/// Message of a topic.
pub(crate) struct Message<'a> {
    /// Position of the message, or of its chunk, in the file \[bytes\].
    pub(crate) offset: u64,
    pub(crate) of: &'a DeclaredTopic,
    pub(crate) log_ns: u64,
    pub(crate) bytes: &'a [u8],
}

/// Next part of a file.
pub(crate) enum Part<'a> {
    /// Name and definition of a schema.
    Schema(&'a str, &'a str),
    Topic(&'a DeclaredTopic),
    Message(Message<'a>),
    /// Record without topic information, or a message of an undeclared topic.
    Other,
}

/// Reader of topics and their messages in the order of the file.
pub(crate) struct TopicReader {
    path: PathBuf,
    records: RecordReader,
    /// Names and definitions of the schemas.
    schemas: BTreeMap<u16, (String, String)>,
    topics: BTreeMap<u16, DeclaredTopic>,
}

impl TopicReader {
    pub(crate) fn open(path: &Path) -> Result<Self, RecordError> {
        let records = RecordReader::open(path).map_err(|error| framing::error(path, error))?;
        Ok(Self { path: path.to_owned(), records, schemas: BTreeMap::new(), topics: BTreeMap::new() })
    }

    /// Returns the error for a fault in the content of this file.
    pub(crate) fn fault(&self, fault: ReadFault) -> RecordError {
        RecordError::Read { path: self.path.display().to_string(), fault }
    }

    /// Returns whether the file was closed.
    pub(crate) fn is_complete(&self) -> bool {
        self.records.is_complete()
    }

    /// Returns the next part; `None` at the end, or at the truncation of an unclosed file.
    pub(crate) fn next(&mut self) -> Result<Option<Part<'_>>, RecordError> {
        let path = &self.path;
        let record = self.records.next().map_err(|error| framing::error(path, error))?;
        let Some(Record { offset, opcode, body }) = record else { return Ok(None) };
        let mut fields = Fields(body);
        let part = match opcode {
            op::SCHEMA => fields.u16().zip(fields.str()).map(|(number, name)| {
                let definition = fields.str().and_then(|_| fields.str()).unwrap_or_default();
                self.schemas.insert(number, (name.to_owned(), definition.to_owned()));
                Part::Schema(name, definition)
            }),
            op::CHANNEL => declared(fields, &self.schemas).map(|declared| {
                let channel = declared.channel;
                Part::Topic(self.topics.entry(channel).insert_entry(declared).into_mut())
            }),
            op::MESSAGE => message(fields).map(|(channel, log_ns, bytes)| match self.topics.get(&channel) {
                Some(topic) => Part::Message(Message { offset, of: topic, log_ns, bytes }),
                None => Part::Other,
            }),
            _ => Some(Part::Other),
        };
        let short = || framing::error(path, damaged(offset, "a record is shorter than its fields"));
        part.map(Some).ok_or_else(short)
    }
}

fn declared(mut fields: Fields<'_>, schemas: &BTreeMap<u16, (String, String)>) -> Option<DeclaredTopic> {
    let (channel, schema) = (fields.u16()?, fields.u16()?);
    let (topic, encoding) = (fields.str()?.to_owned(), fields.str()?.to_owned());
    let (schema, definition) = schemas.get(&schema).cloned().unwrap_or_default();
    Some(DeclaredTopic { channel, topic, schema, encoding, definition })
}

/// Returns channel, log time \[ns\] and content of a message.
fn message(mut fields: Fields<'_>) -> Option<(u16, u64, &[u8])> {
    let channel = fields.u16()?;
    let _sequence = fields.u32()?;
    let (log_ns, _publish_ns) = (fields.u64()?, fields.u64()?);
    Some((channel, log_ns, fields.0))
}
