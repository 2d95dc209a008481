//! Reads `run.mcap`.

use std::collections::VecDeque;
use std::path::Path;

use serde::de::DeserializeOwned;

use super::message::{
    AUDIT, CHANNEL_SCHEMA, ChannelMessage, EventMessage, Header, RunAudit, RunTopic, SummaryMessage, SwarmMessage,
    fault,
};
use super::topic::{CDR, DeclaredTopic, Message, Part, Topic, TopicReader, decode};
use tautline_core::record::{Event, MessageHash, OwnedSample, ReadFault, RecordError};

/// Entry of a recording, in the order of the file.
#[derive(Clone, Debug, PartialEq)]
pub enum Entry {
    /// A sample.
    Sample(OwnedSample),
    /// An event.
    Event(Event),
}

/// State of the audit that a run stores in its recording.
#[derive(Clone, Debug, PartialEq)]
pub enum StoredAudit {
    /// The recording has no audit, or was not closed.
    None,
    /// The recording was changed after the run.
    Altered,
    /// The recording is unchanged since the run.
    AsWritten(Box<RunAudit>),
}

/// Opened recording: an iterator over its samples and events that holds one chunk in memory.
///
/// A file that was not closed yields all entries of its complete chunks. Damage yields an error, after which the
/// iterator ends.
pub struct McapRecording {
    topics: TopicReader,
    contents: Contents,
    header: Header,
    failed: bool,
}

impl McapRecording {
    /// Opens a recording and reads up to its scenario.
    ///
    /// # Errors
    /// [`RecordError::Open`] if the system refuses. [`RecordError::Read`] if the file is empty, is not MCAP, is
    /// damaged, or has no `/scenario` message or no `/swarm` channel.
    pub fn open(path: &Path) -> Result<Self, RecordError> {
        let mut topics = TopicReader::open(path)?;
        let mut contents = Contents::default();
        let header = loop {
            if let Some(header) = contents.header.clone().filter(|_| contents.has_swarm) {
                break header;
            }
            if !contents.advance(&mut topics)? {
                let missing = if contents.has_swarm { RunTopic::Scenario } else { RunTopic::Swarm };
                return Err(topics.fault(ReadFault::NoChannel { topic: missing.topic().name }));
            }
        };
        Ok(Self { topics, contents, header, failed: false })
    }

    /// Returns the description of the run.
    #[must_use]
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// Returns whether the file was closed. A file whose writer was killed or failed holds everything up to the last
    /// complete chunk.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        self.topics.is_complete()
    }

    /// Returns the audit of the run, once all entries are read. It is valid only as the last message of a closed file
    /// whose messages have the hash of the audit.
    #[must_use]
    pub fn stored_audit(&self) -> StoredAudit {
        let Contents { audit, is_altered, messages, .. } = &self.contents;
        let is_hash_of = |audit: &RunAudit| audit.hash(messages.clone()).is_ok_and(|hash| hash == audit.sha256);
        match audit {
            _ if !self.is_complete() || self.failed => StoredAudit::None,
            Some(audit) if !is_altered && is_hash_of(audit) => StoredAudit::AsWritten(Box::new(audit.clone())),
            None if !is_altered => StoredAudit::None,
            _ => StoredAudit::Altered,
        }
    }

    /// Returns all remaining samples and events, each in order.
    ///
    /// # Errors
    /// The first error of the iterator.
    pub fn read_all(self) -> Result<(Vec<OwnedSample>, Vec<Event>), RecordError> {
        let (mut samples, mut events) = (Vec::new(), Vec::new());
        for entry in self {
            match entry? {
                Entry::Sample(sample) => samples.push(sample),
                Entry::Event(event) => events.push(event),
            }
        }
        Ok((samples, events))
    }

    fn try_next(&mut self) -> Result<Option<Entry>, RecordError> {
        loop {
            if let Some(entry) = self.contents.ready.pop_front() {
                return Ok(Some(entry));
            }
            if !self.contents.advance(&mut self.topics)? {
                return Ok(None);
            }
        }
    }
}

impl Iterator for McapRecording {
    type Item = Result<Entry, RecordError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.failed {
            return None;
        }
        let next = self.try_next();
        self.failed = next.is_err();
        next.transpose()
    }
}

/// State of the reader after the messages read so far.
#[derive(Default)]
struct Contents {
    /// Whether the topic of states is declared.
    has_swarm: bool,
    header: Option<Header>,
    summary: Option<SummaryMessage>,
    /// Last message of each channel since the last state.
    channels: Vec<ChannelMessage<String, Vec<String>, Vec<f64>>>,
    ready: VecDeque<Entry>,
    audit: Option<RunAudit>,
    /// Whether a message of a run follows the audit, or an audit is unreadable or repeated.
    is_altered: bool,
    /// Hash of the messages of [`RunTopic::ALL`].
    messages: MessageHash,
}

impl Contents {
    /// Processes one part of the file; returns `false` at its end.
    fn advance(&mut self, topics: &mut TopicReader) -> Result<bool, RecordError> {
        let taken = match topics.next()? {
            Some(Part::Topic(declared)) => self.declare(declared),
            Some(Part::Message(message)) => self.take(&message),
            Some(Part::Schema(..) | Part::Other) => Ok(()),
            None => return Ok(false),
        };
        taken.map(|()| true).map_err(|fault| topics.fault(fault))
    }

    fn declare(&mut self, declared: &DeclaredTopic) -> Result<(), ReadFault> {
        let Some(own) = RunTopic::of(&declared.topic) else { return Ok(()) };
        let Topic { name: topic, schema_name: expected, message_encoding, .. } = own.topic();
        if declared.schema != expected || declared.encoding != message_encoding {
            let schema = if declared.schema.is_empty() { "no schema" } else { &declared.schema };
            let found = format!("{schema} in {} encoding", declared.encoding);
            return Err(ReadFault::ForeignChannel { topic, found, expected });
        }
        self.has_swarm |= own == RunTopic::Swarm;
        Ok(())
    }

    fn take(&mut self, message: &Message<'_>) -> Result<(), ReadFault> {
        let DeclaredTopic { topic, schema, encoding, .. } = message.of;
        let own = RunTopic::of(topic);
        if own.is_some() {
            self.messages.take(topic, message.bytes);
            self.is_altered |= self.audit.is_some();
        }
        match own {
            Some(RunTopic::Scenario) => {
                let header = content(message)?;
                self.header.get_or_insert(header);
            }
            Some(RunTopic::Summary) => self.summary = Some(content(message)?),
            Some(RunTopic::Swarm) => {
                let state = content::<SwarmMessage<Vec<f64>>>(message)?;
                let vehicles = self.header.as_ref().map_or(state.vehicles(), |header| header.vehicles);
                let channels = std::mem::take(&mut self.channels);
                self.ready.push_back(Entry::Sample(state.into_sample(vehicles, self.summary.as_ref(), channels)?));
            }
            Some(RunTopic::Events) => {
                self.ready.push_back(Entry::Event(content::<EventMessage<String>>(message)?.into_event()?));
            }
            None if topic == AUDIT.name => {
                let read = (schema == AUDIT.schema_name && encoding == CDR).then(|| content(message).ok()).flatten();
                self.is_altered |= read.is_none() || self.audit.is_some();
                self.audit = read;
            }
            None if schema == CHANNEL_SCHEMA && encoding == CDR => {
                let channel = content::<ChannelMessage<String, Vec<String>, Vec<f64>>>(message)?;
                self.channels.retain(|before| before.name != channel.name);
                self.channels.push(channel);
            }
            None => {}
        }
        Ok(())
    }
}

fn content<T: DeserializeOwned>(message: &Message<'_>) -> Result<T, ReadFault> {
    decode(message.bytes).map_err(|reason| fault(&message.of.topic, reason))
}
