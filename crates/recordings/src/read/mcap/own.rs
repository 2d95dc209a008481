//! Reads recordings of tautline: `run.mcap`, MCAP exports, and channels.
//!
//! ```text
#![doc = include_str!("vehicles.msg")]
//! ```
//!
//! ```text
#![doc = include_str!("tracks.msg")]
//! ```

use std::path::{Path, PathBuf};

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::super::clock::Stamp;
use super::super::convention;
use super::super::error::{ContentKind, Fault, Place, ReadError};
use super::super::identity::Names;
use super::super::options::ReadOptions;
use super::super::order::{Ordered, Recording, RecordingInfo, Row, Rows};
use super::super::source::Source;
use super::super::time_unit::TimeUnit;
use crate::mcap::topic::{Message, Part, Topic, TopicReader, decode};
use crate::mcap::{CHANNEL_SCHEMA, ChannelMessage, Entry, McapRecording, SWARM_SCHEMA};
use tautline_core::fact::{self, Fact, FactKind};
use tautline_core::record::{Channel, ReadFault};

/// Topic of the vehicle names.
pub(crate) const VEHICLES: Topic<'_> =
    Topic::cdr("/vehicles", "tautline_msgs/msg/Vehicles", include_str!("vehicles.msg"));

/// Topic of the motion.
pub(crate) const TRACKS: Topic<'_> = Topic::cdr("/tracks", "tautline_msgs/msg/Tracks", include_str!("tracks.msg"));

/// Fields of `vehicles.msg`, in order.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Vehicles {
    pub(crate) names: Vec<String>,
    pub(crate) epoch_ns: i64,
}

/// Fields of `tracks.msg`, in order.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Instant {
    pub(crate) time_s: f64,
    pub(crate) vehicles: Vec<u64>,
    pub(crate) positions_m: Vec<f64>,
    pub(crate) velocities_m_s: Vec<f64>,
    pub(crate) radii_m: Vec<f64>,
}

pub(super) fn open_export(source: &Source, options: &ReadOptions) -> Result<Recording, ReadError> {
    let topics = TopicReader::open(&source.path)?;
    let notes = options.accept_unfinished(topics.is_complete())?;
    let instants = Instants { names: Names::default(), axes: None, epoch_ns: 0, is_single: None, count: 0 };
    let mut exported = Exported { path: source.path.clone(), topics, instants };
    exported.next_batch(&mut Vec::new())?;
    let is_planar = exported.instants.axes == Some(2);
    let none = Fault::content(ContentKind::Empty, "it holds no instant", "export again");
    let mut info = RecordingInfo::new(source, options, Some(TimeUnit::Seconds), notes, none);
    (info.epoch_ns, info.metadata.is_planar) = (exported.instants.epoch_ns, is_planar);
    exported.rewind()?;
    Ok(Box::new(Ordered::open(exported, info)?))
}

/// Exported recording.
struct Exported {
    path: PathBuf,
    topics: TopicReader,
    instants: Instants,
}

/// State of the reader after the messages so far.
struct Instants {
    names: Names,
    /// Number of axes of all positions.
    axes: Option<usize>,
    epoch_ns: i64,
    /// Whether the first message has one vehicle, as those of a recorder that writes each position when it is heard.
    is_single: Option<bool>,
    count: u64,
}

impl Instants {
    /// Appends the rows of a message; the error describes the fault of the message.
    fn take(&mut self, message: &Message<'_>, rows: &mut Vec<Row>) -> Result<(), String> {
        if message.of.schema == TRACKS.schema_name {
            self.count += 1;
            let instant: Instant = decode(message.bytes)?;
            self.is_single.get_or_insert(instant.vehicles.len() == 1);
            let axes = if instant.positions_m.len() == 2 * instant.vehicles.len() { 2 } else { 3 };
            if !instant.vehicles.is_empty() && *self.axes.get_or_insert(axes) != axes {
                return Err("only some of its positions have heights".to_owned());
            }
            return take(&instant, axes, self.names.all().len(), (self.count, rows));
        }
        if message.of.schema == VEHICLES.schema_name {
            let Vehicles { names, epoch_ns } = decode(message.bytes)?;
            if !names.starts_with(self.names.all()) {
                return Err("the list of vehicles contradicts an earlier one".to_owned());
            }
            // The file numbers its vehicles: names may differ in spelling alone.
            self.names = Names::distinct(names).map_err(|fault| fault.to_string())?;
            self.epoch_ns = epoch_ns;
        }
        Ok(())
    }
}

/// Appends the rows of an instant; `number` is the number of its message. The error describes the fault of the message.
fn take(instant: &Instant, axes: usize, vehicles: usize, (number, rows): (u64, &mut Vec<Row>)) -> Result<(), String> {
    let count = instant.vehicles.len();
    let fits = |length: usize, each: usize| length == each * count;
    let velocities = !instant.velocities_m_s.is_empty();
    let radii = !instant.radii_m.is_empty();
    if !(fits(instant.positions_m.len(), axes)
        && (!velocities || fits(instant.velocities_m_s.len(), axes))
        && (!radii || fits(instant.radii_m.len(), 1)))
    {
        return Err(format!("the lengths of its arrays do not fit {count} vehicles"));
    }
    let vector = |numbers: &[f64], k: usize| {
        let coordinates = &numbers[axes * k..axes * (k + 1)];
        Vector3::new(coordinates[0], coordinates[1], coordinates.get(2).copied().unwrap_or(0.0))
    };
    for (k, &vehicle) in instant.vehicles.iter().enumerate() {
        let vehicle = usize::try_from(vehicle).ok().filter(|&vehicle| vehicle < vehicles);
        let vehicle = vehicle.ok_or("it contains a vehicle without a name")?;
        let velocity = velocities.then(|| vector(&instant.velocities_m_s, k)).filter(|v| !v.x.is_nan());
        let radius = radii.then(|| instant.radii_m[k]).filter(|radius| !radius.is_nan());
        let stamp = Stamp::Real(instant.time_s);
        rows.push(Row { stamp, place: number, vehicle, position: vector(&instant.positions_m, k), velocity, radius });
    }
    Ok(())
}

impl Rows for Exported {
    fn next(&mut self, rows: &mut Vec<Row>) -> Result<bool, ReadError> {
        let Some(part) = self.topics.next()? else { return Ok(false) };
        if let Part::Message(message) = part {
            let damaged = |reason: String| Fault::damaged(reason).at(Place::Byte(message.offset));
            self.instants.take(&message, rows).map_err(damaged)?;
        }
        Ok(true)
    }

    fn rewind(&mut self) -> Result<(), ReadError> {
        self.topics = TopicReader::open(&self.path)?;
        (self.instants.names, self.instants.count) = (Names::default(), 0);
        Ok(())
    }

    fn vehicles(&self) -> &[String] {
        self.instants.names.all()
    }

    fn is_wide(&self) -> bool {
        self.instants.is_single != Some(true)
    }

    fn place(&self, number: u64) -> Place {
        Place::Part(format!("message {number} of topic `{}`", TRACKS.name))
    }
}

/// Decoded message of a channel.
type Read = ChannelMessage<String, Vec<String>, Vec<f64>>;

/// Channels of a recording of tautline, instant by instant, in the order of its tracks.
pub struct Channels {
    path: PathBuf,
    topics: TopicReader,
    /// Channels of the next instant, if already read.
    next: Option<Vec<Read>>,
}

impl Channels {
    /// Opens the channels of an MCAP file; `None` if its first instant has none.
    pub(in crate::read) fn open(path: &Path) -> Result<Option<Self>, ReadError> {
        let mut channels = Self { path: path.to_owned(), topics: TopicReader::open(path)?, next: None };
        let first = channels.read_instant()?;
        let has_some = !first.is_empty();
        channels.next = Some(first);
        Ok(has_some.then_some(channels))
    }

    /// Returns the channels of the next instant, one row per vehicle in the order of the instant; empty after the last
    /// instant.
    ///
    /// # Errors
    /// [`ReadError`] if the recording is damaged.
    pub fn next(&mut self, vehicles: usize) -> Result<Vec<Channel>, ReadError> {
        let found = match self.next.take() {
            Some(found) => Ok(found),
            None => self.read_instant(),
        };
        let channels = found.and_then(|found| {
            let channels: Result<_, ReadFault> = found.into_iter().map(|found| found.into_channel(vehicles)).collect();
            Ok(channels.map_err(|fault| self.topics.fault(fault))?)
        });
        channels.map_err(|error| error.of(&self.path))
    }

    /// Reads the channel messages before the next instant.
    fn read_instant(&mut self) -> Result<Vec<Read>, ReadError> {
        let mut found: Vec<Read> = Vec::new();
        while let Some(part) = self.topics.next()? {
            let Part::Message(Message { of: topic, bytes, .. }) = part else { continue };
            match &*topic.schema {
                CHANNEL_SCHEMA => {
                    let fault = |reason| ReadFault::Message { topic: topic.topic.clone(), reason };
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

pub(super) fn open_samples(source: &Source, options: &ReadOptions) -> Result<Recording, ReadError> {
    let recording = McapRecording::open(&source.path)?;
    convention::refuse_known(options, "a recording of tautline")?;
    let notes = options.accept_unfinished(recording.is_complete())?;
    let vehicles = recording.header().vehicles;
    let run = Run { recording, vehicles, names: Names::default(), samples: 0 };
    let none = Fault::content(ContentKind::Empty, "it holds no sample", "record again");
    let mut info = RecordingInfo::new(source, options, Some(TimeUnit::Seconds), notes, none);
    info.metadata.facts.push(Fact::name(FactKind::Identity, fact::Source::Recorded, "numbers of the simulation"));
    info.metadata.facts.push(Fact::name(FactKind::Clock, fact::Source::Recorded, "time of the simulation"));
    Ok(Box::new(Ordered::open(run, info)?))
}

/// Samples of a run.
struct Run {
    recording: McapRecording,
    /// Number of vehicles in the header.
    vehicles: usize,
    names: Names,
    samples: u64,
}

impl Rows for Run {
    fn next(&mut self, rows: &mut Vec<Row>) -> Result<bool, ReadError> {
        let Some(entry) = self.recording.next() else { return Ok(false) };
        let Entry::Sample(sample) = entry? else { return Ok(true) };
        if self.names.all().is_empty() {
            // A sample has confirmed the number of vehicles in the header.
            self.names = Names::numbered(self.vehicles);
        }
        self.samples += 1;
        for vehicle in 0..self.vehicles {
            let position = sample.swarm.positions_m.row(vehicle).transpose();
            let velocity = Some(sample.swarm.velocities_m_s.row(vehicle).transpose());
            let stamp = Stamp::Real(sample.time_s);
            rows.push(Row { stamp, place: self.samples, vehicle, position, velocity, radius: None });
        }
        Ok(true)
    }

    fn vehicles(&self) -> &[String] {
        self.names.all()
    }

    fn place(&self, number: u64) -> Place {
        Place::Part(format!("sample {number} of topic `/swarm`"))
    }
}
