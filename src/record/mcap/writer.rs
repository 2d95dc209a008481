//! Writing `run.mcap`.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};

use mcap::records::MessageHeader;
use mcap::write::NoSeek;
use mcap::{McapError, WriteOptions, Writer};
use serde::Serialize;

use super::Header;
use super::message::{
    EventMessage, MESSAGE_ENCODING, SCHEMA_ENCODING, ScenarioMessage, SummaryMessage, SwarmMessage, Topic, encode,
};
use crate::record::{Event, RecordError, Sample, Sink};

/// A chunk is closed and handed to the system with the first message this long after the chunk before \[simulated s\].
pub const FLUSH_PERIOD_S: f64 = 1.0;

/// A chunk is closed and handed to the system when it holds this much \[bytes\].
pub const FLUSH_BYTES: usize = 256 * 1024;

/// Bytes that MCAP adds to each message: record head and message header.
const MESSAGE_OVERHEAD_BYTES: usize = 31;

/// Who wrote the file, for MCAP tools.
const LIBRARY: &str = concat!("tautline ", env!("CARGO_PKG_VERSION"));

/// Makes the messages of one more channel out of the samples.
pub trait Companion: Send {
    /// The channel.
    fn channel(&self) -> Channel;

    /// Replaces the content of `message` by the one that belongs to a sample; `false` where none is due.
    ///
    /// # Errors
    /// When the message cannot be encoded.
    fn message(&mut self, sample: &Sample<'_>, message: &mut Vec<u8>) -> io::Result<bool>;
}

/// What a [`Companion`]'s channel is called and how its messages are to be read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Channel {
    /// The topic; none of the recording's own.
    pub topic: String,
    /// How messages are encoded, such as `protobuf`.
    pub message_encoding: String,
    /// Name of their schema.
    pub schema_name: String,
    /// How the schema is encoded.
    pub schema_encoding: String,
    /// The schema.
    pub schema: Vec<u8>,
}

/// A companion with the number of its channel and its messages so far.
struct Joined {
    companion: Box<dyn Companion>,
    channel_id: u16,
    sequence: u32,
}

/// Records a run into an MCAP file as it is made.
///
/// Memory holds one chunk ([`FLUSH_BYTES`] and one sample at most) and an index entry of some 200 bytes per chunk
/// written. [`McapRecorder::finish`] closes the file and reports what went wrong. A recorder that is dropped closes the
/// file too, but can tell nobody about an error. After an error the file stays as it is and every further call fails.
pub struct McapRecorder {
    path: PathBuf,
    out: Option<Writer<NoSeek<BufWriter<File>>>>,
    /// Channel number and messages so far, in the order of [`Topic::ALL`].
    channels: [(u16, u32); 4],
    companion: Option<Joined>,
    /// The message being written.
    message: Vec<u8>,
    waiting_bytes: usize,
    flushed_at_s: f64,
}

impl McapRecorder {
    /// Creates the file (an existing one is overwritten) and writes the scenario into it.
    ///
    /// # Errors
    /// [`RecordError::Write`] when the system refuses.
    pub fn create(path: &Path, header: &Header) -> Result<Self, RecordError> {
        let (out, channels) = open(path).map_err(|source| write_error(path, source))?;
        let mut recorder = Self {
            path: path.to_owned(),
            out: Some(out),
            channels,
            companion: None,
            message: Vec::new(),
            waiting_bytes: 0,
            flushed_at_s: f64::NEG_INFINITY,
        };
        recorder.write(Topic::Scenario, 0.0, &ScenarioMessage::from(header))?;
        Ok(recorder)
    }

    /// Records one more channel beside the recording's own, from the next sample on.
    ///
    /// # Errors
    /// [`RecordError::Write`] when the system refuses.
    pub fn with(mut self, companion: Box<dyn Companion>) -> Result<Self, RecordError> {
        let Channel { topic, message_encoding, schema_name, schema_encoding, schema } = companion.channel();
        let mut channel_id = 0;
        self.with_out(|out, _| {
            let schema_id = out.add_schema(&schema_name, &schema_encoding, &schema)?;
            channel_id = out.add_channel(schema_id, &topic, &message_encoding, &BTreeMap::new())?;
            Ok(())
        })?;
        self.companion = Some(Joined { companion, channel_id, sequence: 0 });
        Ok(self)
    }

    fn write_companion(&mut self, sample: &Sample<'_>) -> Result<(), RecordError> {
        let Some(mut joined) = self.companion.take() else { return Ok(()) };
        let mut bytes = std::mem::take(&mut self.message);
        let due = joined.companion.message(sample, &mut bytes);
        let result = self.with_out(|out, _| {
            if due? {
                let (channel_id, sequence, log_time) = (joined.channel_id, joined.sequence, nanoseconds(sample.time_s));
                let header = MessageHeader { channel_id, sequence, log_time, publish_time: log_time };
                joined.sequence = sequence.wrapping_add(1);
                out.write_to_known_channel(&header, &bytes)?;
            }
            Ok(())
        });
        self.waiting_bytes += bytes.len() + MESSAGE_OVERHEAD_BYTES;
        self.message = bytes;
        self.companion = Some(joined);
        result
    }

    /// Writes what is waiting and the closing index, and closes the file.
    ///
    /// # Errors
    /// [`RecordError::Write`] when the system refuses, or has refused before.
    pub fn finish(mut self) -> Result<(), RecordError> {
        self.with_out(|out, _| out.finish().map(drop))
    }

    fn write(&mut self, topic: Topic, time_s: f64, message: &impl Serialize) -> Result<(), RecordError> {
        let mut bytes = std::mem::take(&mut self.message);
        let result = self.with_out(|out, channels| {
            encode(message, &mut bytes).map_err(io::Error::other)?;
            let (channel_id, sequence) = &mut channels[topic as usize];
            let log_time = nanoseconds(time_s);
            let header =
                MessageHeader { channel_id: *channel_id, sequence: *sequence, log_time, publish_time: log_time };
            *sequence = sequence.wrapping_add(1);
            out.write_to_known_channel(&header, &bytes)
        });
        self.waiting_bytes += bytes.len() + MESSAGE_OVERHEAD_BYTES;
        self.message = bytes;
        result
    }

    fn flush_if_due(&mut self, time_s: f64) -> Result<(), RecordError> {
        if time_s - self.flushed_at_s >= FLUSH_PERIOD_S || self.waiting_bytes >= FLUSH_BYTES {
            self.with_out(|out, _| out.flush())?;
            self.flushed_at_s = time_s;
            self.waiting_bytes = 0;
        }
        Ok(())
    }

    /// Runs `action` on the open file, which the first error closes for good.
    fn with_out(
        &mut self,
        action: impl FnOnce(&mut Writer<NoSeek<BufWriter<File>>>, &mut [(u16, u32); 4]) -> Result<(), McapError>,
    ) -> Result<(), RecordError> {
        let Some(out) = self.out.as_mut() else {
            return Err(write_error(&self.path, io::Error::other("writing failed before")));
        };
        action(out, &mut self.channels).map_err(|error| {
            // Taken apart rather than dropped: a dropped writer would go on and close the file as if it were whole.
            drop(self.out.take().map(Writer::into_inner));
            write_error(&self.path, io_error(error))
        })
    }
}

impl Sink for McapRecorder {
    fn sample(&mut self, sample: &Sample<'_>) -> Result<(), RecordError> {
        self.write(Topic::Summary, sample.time_s, &SummaryMessage::from(sample))?;
        self.write(Topic::Swarm, sample.time_s, &SwarmMessage::from(sample))?;
        self.write_companion(sample)?;
        self.flush_if_due(sample.time_s)
    }

    fn event(&mut self, event: &Event) -> Result<(), RecordError> {
        self.write(Topic::Events, event.time_s(), &EventMessage::from(event))?;
        self.flush_if_due(event.time_s())
    }
}

type Opened = (Writer<NoSeek<BufWriter<File>>>, [(u16, u32); 4]);

fn open(path: &Path) -> io::Result<Opened> {
    let file = NoSeek::new(BufWriter::new(File::create(path)?));
    let mut out = WriteOptions::new()
        .library(LIBRARY)
        // Chunks are closed here and not by their size alone, so that the messages of one sample stay together.
        .chunk_size(None)
        // Without seeking a chunk is built in memory and written whole.
        .disable_seeking(true)
        .create(file)
        .map_err(io_error)?;
    let mut channels = [(0, 0); 4];
    for topic in Topic::ALL {
        let schema = out.add_schema(topic.schema_name(), SCHEMA_ENCODING, topic.schema_text().as_bytes());
        let channel = schema.and_then(|id| out.add_channel(id, topic.name(), MESSAGE_ENCODING, &BTreeMap::new()));
        channels[topic as usize] = (channel.map_err(io_error)?, 0);
    }
    Ok((out, channels))
}

fn io_error(error: McapError) -> io::Error {
    match error {
        McapError::Io(error) => error,
        other => io::Error::other(other),
    }
}

fn write_error(path: &Path, source: io::Error) -> RecordError {
    RecordError::Write { path: path.display().to_string(), source }
}

/// Simulated nanoseconds since the start; 0 for what is negative or not a number.
fn nanoseconds(time_s: f64) -> u64 {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the cast saturates")]
    let nanoseconds = (time_s * 1e9).round() as u64;
    nanoseconds
}
