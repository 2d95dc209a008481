//! Reading `run.mcap` back.

use std::collections::{BTreeMap, VecDeque};
use std::path::{Path, PathBuf};

use mcap::records::op;

use super::Header;
use super::framing::{Fields, Record, RecordReader, Trouble, damaged};
use super::message::{EventMessage, MESSAGE_ENCODING, ScenarioMessage, SummaryMessage, SwarmMessage, Topic, decode};
use crate::record::{Event, OwnedSample, ReadFault, RecordError};

/// What a recording gives back, in the order in which it was written.
#[derive(Clone, Debug, PartialEq)]
pub enum Entry {
    /// A sample.
    Sample(OwnedSample),
    /// An event.
    Event(Event),
}

/// A recording opened for reading: an iterator over its samples and events that holds one chunk in memory.
///
/// A file that was not closed gives everything up to where it breaks off. Damage gives an error, after which the
/// iterator ends.
pub struct McapRecording {
    path: PathBuf,
    records: RecordReader,
    contents: Contents,
    header: Header,
    failed: bool,
}

impl McapRecording {
    /// Opens a recording and reads as far as its scenario.
    ///
    /// # Errors
    /// [`RecordError::Open`] when the system refuses; [`RecordError::Read`] when the file is empty, is not MCAP, has no
    /// `/scenario` message or no `/swarm` channel, or is damaged.
    pub fn open(path: &Path) -> Result<Self, RecordError> {
        Self::try_open(path).map_err(|trouble| record_error(path, trouble))
    }

    fn try_open(path: &Path) -> Result<Self, Trouble> {
        let mut records = RecordReader::open(path)?;
        let mut contents = Contents::default();
        while contents.header.is_none() || !contents.declares(Topic::Swarm) {
            if !contents.advance(&mut records)? {
                let missing = if contents.declares(Topic::Swarm) { Topic::Scenario } else { Topic::Swarm };
                return Err(ReadFault::NoChannel { topic: missing.name() }.into());
            }
        }
        let header = contents.header.clone().ok_or(ReadFault::NoChannel { topic: Topic::Scenario.name() })?;
        Ok(Self { path: path.to_owned(), records, contents, header, failed: false })
    }

    /// What the recording says about the run as a whole.
    #[must_use]
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// Whether the file was closed. One that was not, because its writer was killed or could write no more, holds
    /// everything up to the last chunk that was written.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        self.records.is_complete()
    }

    /// All remaining samples and events, each in order.
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

    fn try_next(&mut self) -> Result<Option<Entry>, Trouble> {
        loop {
            if let Some(entry) = self.contents.ready.pop_front() {
                return Ok(Some(entry));
            }
            if !self.contents.advance(&mut self.records)? {
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
        self.try_next()
            .map_err(|trouble| {
                self.failed = true;
                record_error(&self.path, trouble)
            })
            .transpose()
    }
}

fn record_error(path: &Path, trouble: Trouble) -> RecordError {
    let path = path.display().to_string();
    match trouble {
        Trouble::System(source) => RecordError::Open { path, source },
        Trouble::Fault(fault) => RecordError::Read { path, fault },
    }
}

/// What the records read so far amount to.
#[derive(Default)]
struct Contents {
    /// Name of each schema by its number.
    schemas: BTreeMap<u16, String>,
    /// The channels that matter here by their number.
    channels: BTreeMap<u16, Topic>,
    header: Option<Header>,
    summary: Option<SummaryMessage>,
    ready: VecDeque<Entry>,
}

impl Contents {
    fn declares(&self, topic: Topic) -> bool {
        self.channels.values().any(|&declared| declared == topic)
    }

    /// Takes in one record; `false` when there is none.
    fn advance(&mut self, records: &mut RecordReader) -> Result<bool, Trouble> {
        let Some(Record { offset, opcode, body }) = records.next()? else { return Ok(false) };
        let known = match opcode {
            op::SCHEMA => self.schema(Fields(body)),
            op::CHANNEL => self.channel(Fields(body)).transpose()?,
            op::MESSAGE => self.message(Fields(body)).transpose()?,
            _ => Some(()),
        };
        known.ok_or_else(|| damaged(offset, "a record is shorter than its fields"))?;
        Ok(true)
    }

    fn schema(&mut self, mut fields: Fields<'_>) -> Option<()> {
        let (number, name) = (fields.u16()?, fields.str()?);
        self.schemas.insert(number, name.to_owned());
        Some(())
    }

    fn channel(&mut self, mut fields: Fields<'_>) -> Option<Result<(), ReadFault>> {
        let (number, schema, name, encoding) = (fields.u16()?, fields.u16()?, fields.str()?, fields.str()?);
        let Some(topic) = Topic::ALL.into_iter().find(|topic| topic.name() == name) else { return Some(Ok(())) };
        let schema = self.schemas.get(&schema).map_or("no schema", String::as_str);
        if schema != topic.schema_name() || encoding != MESSAGE_ENCODING {
            let (topic, expected) = (topic.name(), topic.schema_name());
            return Some(Err(ReadFault::ForeignChannel {
                topic,
                found: format!("{schema} in {encoding} encoding"),
                expected,
            }));
        }
        self.channels.insert(number, topic);
        Some(Ok(()))
    }

    fn message(&mut self, mut fields: Fields<'_>) -> Option<Result<(), ReadFault>> {
        let channel = fields.u16()?;
        let _sequence = fields.u32()?;
        let _times = (fields.u64()?, fields.u64()?);
        let Some(&topic) = self.channels.get(&channel) else { return Some(Ok(())) };
        Some(self.content(topic, fields.0))
    }

    fn content(&mut self, topic: Topic, bytes: &[u8]) -> Result<(), ReadFault> {
        match topic {
            Topic::Scenario => {
                let header = decode::<ScenarioMessage<String>>(topic, bytes)?.into_header()?;
                self.header.get_or_insert(header);
            }
            Topic::Summary => self.summary = Some(decode(topic, bytes)?),
            Topic::Swarm => {
                let message = decode::<SwarmMessage<Vec<f64>>>(topic, bytes)?;
                let vehicles = self.header.as_ref().map_or(message.vehicles(), |header| header.vehicles);
                let sample = message.into_sample(vehicles, self.summary.as_ref())?;
                self.ready.push_back(Entry::Sample(sample));
            }
            Topic::Events => {
                let event = decode::<EventMessage<String>>(topic, bytes)?.into_event()?;
                self.ready.push_back(Entry::Event(event));
            }
        }
        Ok(())
    }
}
