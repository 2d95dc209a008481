//! What recordings of ours say of every vehicle beside its motion.

use std::path::{Path, PathBuf};

use super::super::error::ReadError;
use super::exported::TRACKS;
use crate::mcap::topic::{Message, Part, TopicReader, decode};
use crate::mcap::{CHANNEL_SCHEMA, ChannelMessage, SWARM_SCHEMA};
use tautline_core::record::{Channel, ReadFault};

/// A message as it is read.
type Read = ChannelMessage<String, Vec<String>, Vec<f64>>;

/// The channels of a recording of ours, instant by instant, in the order of its tracks.
pub struct Channels {
    path: PathBuf,
    topics: TopicReader,
    /// Those of the next instant, where it has been looked at.
    next: Option<Vec<Read>>,
}

impl Channels {
    /// Those of a file in MCAP, where its first instant has some.
    pub(in crate::read) fn open(path: &Path) -> Result<Option<Self>, ReadError> {
        let mut channels = Self { path: path.to_owned(), topics: TopicReader::open(path)?, next: None };
        let first = channels.look()?;
        let has_some = !first.is_empty();
        channels.next = Some(first);
        Ok(has_some.then_some(channels))
    }

    /// The channels of the next instant, which is of so many vehicles, a row for each in the order of the instant; none
    /// behind the last one.
    ///
    /// # Errors
    /// [`ReadError`] when the recording is damaged.
    pub fn next(&mut self, vehicles: usize) -> Result<Vec<Channel>, ReadError> {
        let found = match self.next.take() {
            Some(found) => Ok(found),
            None => self.look(),
        };
        let channels = found.and_then(|found| {
            let channels: Result<_, ReadFault> = found.into_iter().map(|found| found.into_channel(vehicles)).collect();
            Ok(channels.map_err(|fault| self.topics.fault(fault))?)
        });
        channels.map_err(|error| error.of(&self.path))
    }

    /// The messages of channels before the next instant.
    fn look(&mut self) -> Result<Vec<Read>, ReadError> {
        let mut found: Vec<Read> = Vec::new();
        while let Some(part) = self.topics.next()? {
            let Part::Message(Message { of, bytes, .. }) = part else { continue };
            match &*of.schema {
                CHANNEL_SCHEMA => {
                    let fault = |reason| ReadFault::Message { topic: of.topic.clone(), reason };
                    let read = decode::<Read>(bytes).map_err(fault);
                    let message = read.map_err(|fault| self.topics.fault(fault))?;
                    found.retain(|before| before.name != message.name);
                    found.push(message);
                }
                schema if schema == SWARM_SCHEMA || schema == TRACKS.schema_name => break,
                _ => {}
            }
        }
        Ok(found)
    }
}
