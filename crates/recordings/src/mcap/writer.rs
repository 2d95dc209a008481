//! Writing `run.mcap`.

use std::fs::File;
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use mcap::WriteOptions;
use mcap::write::NoSeek;
use serde::Serialize;

use super::message::{
    AUDIT, ChannelMessage, EventMessage, Own, SummaryMessage, SwarmMessage, channel_topic, topic_of_channel,
};
use super::topic::{Topic, TopicWriter, encode, log_time_ns};
use super::{Header, RunAudit};
use tautline_core::record::MessageHash;
use tautline_core::record::{Channel, Event, RecordError, Sample, Sink};

/// A chunk is closed and handed to the system with the first message this long after the chunk before \[simulated s\].
pub const FLUSH_PERIOD_S: f64 = 1.0;

/// A chunk is closed and handed to the system when it holds this much \[bytes\].
pub const FLUSH_BYTES: usize = 256 * 1024;

/// Bytes that MCAP adds to each message: record head and message header.
const MESSAGE_OVERHEAD_BYTES: usize = 31;

/// Makes the messages of one more topic out of the samples.
pub trait ExtraTopic: Send {
    /// What is declared of it; its name is none of the recording's own.
    fn topic(&self) -> Topic<'_>;

    /// Replaces the content of `message` by the one that belongs to a sample; `false` where none is due.
    ///
    /// # Errors
    /// When the message cannot be encoded.
    fn message(&mut self, sample: &Sample<'_>, message: &mut Vec<u8>) -> io::Result<bool>;

    /// Hears of an event, in order with the samples.
    fn note(&mut self, _event: &Event) {}
}

/// Topics without seeking: a chunk is built in memory and written whole.
type Out = TopicWriter<NoSeek<BufWriter<File>>>;

/// Records a run into an MCAP file as it is made.
///
/// Memory holds one chunk ([`FLUSH_BYTES`] and one sample at most) and an index entry of some 200 bytes per chunk
/// written. [`McapRecorder::finish`] closes the file and reports what went wrong. A recorder that is dropped closes the
/// file too, but cannot report an error. After an error the file stays as it is and every further call fails.
pub struct McapRecorder {
    path: PathBuf,
    /// Begins with [`Own::ALL`], so that their numbers are their places.
    out: Option<Out>,
    /// Channels met so far, and the places of their topics.
    channels: Vec<(Arc<str>, usize)>,
    /// The extra topic and its place.
    extra: Option<(Box<dyn ExtraTopic>, usize)>,
    /// The message being written.
    message: Vec<u8>,
    waiting_bytes: usize,
    flushed_at_s: f64,
    /// Over the messages of [`Own::ALL`].
    messages: MessageHash,
}

impl McapRecorder {
    /// Creates the file (an existing one is overwritten) and writes the scenario into it.
    ///
    /// # Errors
    /// [`RecordError::Write`] when the system refuses.
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
        recorder.write(Own::Scenario as usize, 0.0, header)?;
        Ok(recorder)
    }

    /// Records one more topic beside the recording's own, from the next sample on.
    ///
    /// # Errors
    /// [`RecordError::Write`] when the system refuses.
    pub fn with(mut self, extra: Box<dyn ExtraTopic>) -> Result<Self, RecordError> {
        let place = self.with_out(|out| out.declare(&extra.topic()))?;
        self.extra = Some((extra, place));
        Ok(self)
    }

    /// Writes what is waiting and the closing index, and closes the file.
    ///
    /// # Errors
    /// [`RecordError::Write`] when the system refuses, or has refused before.
    pub fn finish(mut self) -> Result<(), RecordError> {
        self.with_out(Out::finish)
    }

    /// Writes the audit of the finished run, with its hash, and closes the file as [`McapRecorder::finish`] does.
    ///
    /// # Errors
    /// [`RecordError::Write`] when the system refuses, or has refused before.
    pub fn close(mut self, audit: RunAudit) -> Result<(), RecordError> {
        let sha256 = audit.hash(self.messages.clone()).map_err(|source| write_error(&self.path, source))?;
        let audit = RunAudit { sha256, ..audit };
        let place = self.with_out(|out| out.declare(&AUDIT))?;
        self.write_if_due(place, audit.duration_s, |bytes| encode(&audit, bytes).map(|()| true))?;
        self.finish()
    }

    fn write(&mut self, topic: usize, time_s: f64, message: &impl Serialize) -> Result<(), RecordError> {
        self.write_if_due(topic, time_s, |bytes| encode(message, bytes).map(|()| true))?;
        if let Some(own) = Own::ALL.get(topic) {
            self.messages.take(own.topic().name, &self.message);
        }
        Ok(())
    }

    /// Writes the message that `fill` makes, if it says that one is due.
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
            self.with_out(Out::flush)?;
            self.flushed_at_s = time_s;
            self.waiting_bytes = 0;
        }
        Ok(())
    }

    /// Runs `action` on the open file, which the first error closes for good.
    fn with_out<T>(&mut self, action: impl FnOnce(&mut Out) -> io::Result<T>) -> Result<T, RecordError> {
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
        self.write(Own::Summary as usize, sample.time_s, &SummaryMessage::from(sample))?;
        for channel in sample.channels {
            self.write_channel(sample, channel)?;
        }
        self.write(Own::Swarm as usize, sample.time_s, &SwarmMessage::from(sample))?;
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
        self.write(Own::Events as usize, event.time_s(), &EventMessage::from(event))?;
        self.flush_if_due(event.time_s())
    }

    fn looks_at_steps(&self) -> bool {
        false
    }
}

fn open(path: &Path) -> io::Result<Out> {
    // Chunks are closed by the recorder and not by their size alone, so that the messages of one sample stay together.
    let options = WriteOptions::new().chunk_size(None).disable_seeking(true);
    let mut out = TopicWriter::new(NoSeek::new(BufWriter::new(File::create(path)?)), options)?;
    for own in Own::ALL {
        out.declare(&own.topic())?;
    }
    Ok(out)
}

fn write_error(path: &Path, source: io::Error) -> RecordError {
    RecordError::Write { path: path.display().to_string(), source }
}
