//! Writes `run.mcap`.

use std::fs::File;
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use mcap::WriteOptions;
use mcap::write::NoSeek;
use serde::Serialize;

use super::message::{
    AUDIT, ChannelMessage, EventMessage, Header, RunAudit, RunTopic, SummaryMessage, SwarmMessage, channel_topic,
    topic_of_channel,
};
use super::topic::{Topic, TopicWriter, encode, log_time_ns};
use tautline_core::record::{Channel, Event, MessageHash, RecordError, Sample, Sink};

/// Time after which the next message closes a chunk \[simulated s\].
pub const FLUSH_PERIOD_S: f64 = 1.0;

/// Size at which a chunk is closed and written \[bytes\].
pub const FLUSH_BYTES: usize = 256 * 1024;

/// Overhead of MCAP per message: record header and message header.
const MESSAGE_OVERHEAD_BYTES: usize = 31;

/// Source of messages of an additional topic.
pub trait ExtraTopic: Send {
    /// Returns the declaration of the topic; its name must differ from the topics of the recording.
    fn topic(&self) -> Topic<'_>;

    /// Replaces the content of `message` with the message of a sample; returns `false` if no message is due.
    ///
    /// # Errors
    /// If the message cannot be encoded.
    fn message(&mut self, sample: &Sample<'_>, message: &mut Vec<u8>) -> io::Result<bool>;

    /// Receives an event, in order with the samples.
    fn note(&mut self, _event: &Event) {}
}

/// Topic writer without seeking: a chunk is built in memory and written as a whole.
type RunWriter = TopicWriter<NoSeek<BufWriter<File>>>;

/// Recorder of a run into an MCAP file.
///
/// Memory holds one chunk (at most [`FLUSH_BYTES`] and one sample) and an index entry of about 200 bytes per written
/// chunk. [`McapRecorder::finish`] closes the file and reports errors. A dropped recorder closes the file too, but
/// cannot report an error. After an error the file is left as it is and every further call fails.
pub struct McapRecorder {
    path: PathBuf,
    /// Writer whose first topics are [`RunTopic::ALL`], so that `RunTopic as usize` is the index of a topic.
    out: Option<RunWriter>,
    /// Channels so far, with the indices of their topics.
    channels: Vec<(Arc<str>, usize)>,
    /// Additional topic and its index.
    extra: Option<(Box<dyn ExtraTopic>, usize)>,
    /// Buffer of the current message.
    message: Vec<u8>,
    waiting_bytes: usize,
    flushed_at_s: f64,
    /// Hash of the messages of [`RunTopic::ALL`].
    messages: MessageHash,
}

impl McapRecorder {
    /// Creates the file, overwriting an existing one, and writes the scenario into it.
    ///
    /// # Errors
    /// [`RecordError::Write`] if the system refuses.
    pub fn create(path: &Path, header: &Header) -> Result<Self, RecordError> {
        let out = open(path).map_err(|source| write_error(path, source))?;
        let mut recorder = Self {
            path: path.to_owned(),
            out: Some(out),
            channels: Vec::new(),
            extra: None,
            message: Vec::new(),
            waiting_bytes: 0,
            flushed_at_s: f64::NEG_INFINITY,
            messages: MessageHash::default(),
        };
        recorder.write(RunTopic::Scenario as usize, 0.0, header)?;
        Ok(recorder)
    }

    /// Adds a topic, recorded from the next sample on.
    ///
    /// # Errors
    /// [`RecordError::Write`] if the system refuses.
    pub fn with(mut self, extra: Box<dyn ExtraTopic>) -> Result<Self, RecordError> {
        let place = self.with_out(|out| out.declare(&extra.topic()))?;
        self.extra = Some((extra, place));
        Ok(self)
    }

    /// Writes the remaining messages and the closing index, and closes the file.
    ///
    /// # Errors
    /// [`RecordError::Write`] if the system refuses or refused before.
    pub fn finish(mut self) -> Result<(), RecordError> {
        self.with_out(RunWriter::finish)
    }

    /// Writes the audit of the finished run with its hash, and closes the file as [`McapRecorder::finish`] does.
    ///
    /// # Errors
    /// [`RecordError::Write`] if the system refuses or refused before.
    pub fn close(mut self, audit: RunAudit) -> Result<(), RecordError> {
        let sha256 = audit.hash(self.messages.clone()).map_err(|source| write_error(&self.path, source))?;
        let audit = RunAudit { sha256, ..audit };
        let place = self.with_out(|out| out.declare(&AUDIT))?;
        self.write_if_due(place, audit.duration_s, |bytes| encode(&audit, bytes).map(|()| true))?;
        self.finish()
    }

    fn write(&mut self, topic: usize, time_s: f64, message: &impl Serialize) -> Result<(), RecordError> {
        self.write_if_due(topic, time_s, |bytes| encode(message, bytes).map(|()| true))?;
        if let Some(own) = RunTopic::ALL.get(topic) {
            self.messages.take(own.topic().name, &self.message);
        }
        Ok(())
    }

    /// Writes the message from `fill`, unless `fill` returns `false`.
    fn write_if_due(
        &mut self,
        topic: usize,
        time_s: f64,
        fill: impl FnOnce(&mut Vec<u8>) -> io::Result<bool>,
    ) -> Result<(), RecordError> {
        let mut bytes = std::mem::take(&mut self.message);
        let written = self.with_out(|out| {
            if fill(&mut bytes)? {
                out.write(topic, log_time_ns(0, time_s), &bytes)?;
            }
            Ok(())
        });
        self.waiting_bytes += bytes.len() + MESSAGE_OVERHEAD_BYTES;
        self.message = bytes;
        written
    }

    fn write_channel(&mut self, sample: &Sample<'_>, channel: &Channel) -> Result<(), RecordError> {
        let known = self.channels.iter().find(|(name, _)| *name == channel.name);
        let topic = if let Some(&(_, topic)) = known {
            topic
        } else {
            let name = channel_topic(&channel.name);
            let topic = self.with_out(|out| out.declare(&topic_of_channel(&name)))?;
            self.channels.push((channel.name.clone(), topic));
            topic
        };
        self.write(topic, sample.time_s, &ChannelMessage::of(sample.time_s, sample.step, channel))
    }

    fn flush_if_due(&mut self, time_s: f64) -> Result<(), RecordError> {
        if time_s - self.flushed_at_s >= FLUSH_PERIOD_S || self.waiting_bytes >= FLUSH_BYTES {
            self.with_out(RunWriter::flush)?;
            self.flushed_at_s = time_s;
            self.waiting_bytes = 0;
        }
        Ok(())
    }

    /// Runs `action` on the open file; the first error closes the file permanently.
    fn with_out<T>(&mut self, action: impl FnOnce(&mut RunWriter) -> io::Result<T>) -> Result<T, RecordError> {
        let Some(out) = self.out.as_mut() else {
            return Err(write_error(&self.path, io::Error::other("writing failed before")));
        };
        action(out).map_err(|error| {
            if let Some(out) = self.out.take() {
                out.abandon();
            }
            write_error(&self.path, error)
        })
    }
}

impl Sink for McapRecorder {
    fn sample(&mut self, sample: &Sample<'_>) -> Result<(), RecordError> {
        self.write(RunTopic::Summary as usize, sample.time_s, &SummaryMessage::from(sample))?;
        for channel in sample.channels {
            self.write_channel(sample, channel)?;
        }
        self.write(RunTopic::Swarm as usize, sample.time_s, &SwarmMessage::from(sample))?;
        if let Some((mut extra, topic)) = self.extra.take() {
            let written = self.write_if_due(topic, sample.time_s, |bytes| extra.message(sample, bytes));
            self.extra = Some((extra, topic));
            written?;
        }
        self.flush_if_due(sample.time_s)
    }

    fn event(&mut self, event: &Event) -> Result<(), RecordError> {
        if let Some((extra, _)) = &mut self.extra {
            extra.note(event);
        }
        self.write(RunTopic::Events as usize, event.time_s(), &EventMessage::from(event))?;
        self.flush_if_due(event.time_s())
    }

    fn needs_steps(&self) -> bool {
        false
    }
}

fn open(path: &Path) -> io::Result<RunWriter> {
    // The recorder closes the chunks, not their size alone: the messages of one sample stay in one chunk.
    let options = WriteOptions::new().chunk_size(None).disable_seeking(true);
    let mut out = TopicWriter::new(NoSeek::new(BufWriter::new(File::create(path)?)), options)?;
    for own in RunTopic::ALL {
        out.declare(&own.topic())?;
    }
    Ok(out)
}

fn write_error(path: &Path, source: io::Error) -> RecordError {
    RecordError::Write { path: path.display().to_string(), source }
}
