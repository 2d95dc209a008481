//! Recordings of others.

use std::collections::BTreeSet;
use std::path::PathBuf;

use super::super::clock::{Probe, Stamp, TimeUnit};
use super::super::error::{Fault, Place, ReadError, UNSEEN, quoted};
use super::super::names::Names;
use super::super::options::ReadOptions;
use super::super::order::{About, BATCH, Ordered, Recording, Row, Rows, survey};
use super::super::source::Source;
use super::messages::{self, Seen, Who};
use crate::record::mcap::topic::{CDR, Declared, Message, Part, TopicReader};

pub(super) fn open(source: &Source, options: &ReadOptions) -> Result<Recording, ReadError> {
    let topics = TopicReader::open(&source.path)?;
    let notes = options.accept_unfinished(topics.is_complete())?;
    let poses = Poses {
        stamped: BTreeSet::new(),
        logged: BTreeSet::new(),
        wanted_frame: options.frame.clone(),
        frame: None,
        names: Names::default(),
        vehicle: 0,
        messages: 0,
        fixed: BTreeSet::new(),
        listed: true,
    };
    let none = match &options.frame {
        Some(frame) => {
            Fault::content(format!("no position is given in the frame {}", quoted(frame)), "name another frame")
        }
        None => Fault::content("its topics with positions have no message", "record again"),
    };
    let about = About::new(source, options, Some(TimeUnit::Nanoseconds), notes, none);
    Ok(Box::new(Ordered::open(Foreign { path: source.path.clone(), topics, poses, shown: Vec::new() }, about)?))
}

/// A recording of others.
struct Foreign {
    path: PathBuf,
    topics: TopicReader,
    poses: Poses,
    /// The names of the vehicles as they are shown.
    shown: Vec<String>,
}

/// Positions out of messages.
struct Poses {
    /// Channels with a message that says its time, and those with one that was taken at the time of logging.
    stamped: BTreeSet<u16>,
    logged: BTreeSet<u16>,
    /// The frame that the user asks for.
    wanted_frame: Option<String>,
    /// The frame of all positions so far, and the topic that it was met on.
    frame: Option<(String, String)>,
    /// Topic and place, or frame, of each vehicle.
    names: Names,
    /// Vehicle of the last row.
    vehicle: usize,
    messages: u64,
    /// Frames that never move, out of `/tf_static`.
    fixed: BTreeSet<String>,
    /// Whether all topics hold lists of poses.
    listed: bool,
}

/// What reads the messages of a topic, where they hold positions.
fn reader_of(topic: &Declared) -> Option<messages::Reader> {
    messages::reader_of(&topic.schema).filter(|_| matches!(&*topic.encoding, "protobuf" | "json" | CDR))
}

impl Poses {
    /// Appends the rows of a message.
    fn take(&mut self, message: &Message<'_>, rows: &mut Vec<Row>) -> Result<(), ReadError> {
        let Declared { topic, encoding, .. } = message.of;
        let Some(reader) = reader_of(message.of) else { return Ok(()) };
        self.messages += 1;
        self.append(reader(encoding, message.bytes), message, rows)
            .map_err(|fault| fault.at(Place::Part(format!("message {} on topic `{topic}`", self.messages))))
    }

    fn append(
        &mut self,
        seen: Result<Vec<Seen>, String>,
        message: &Message<'_>,
        rows: &mut Vec<Row>,
    ) -> Result<(), Fault> {
        let topic = &message.of.topic;
        let is_static = topic.rsplit('/').next() == Some("tf_static");
        for seen in seen.map_err(Fault::Damaged)? {
            if let Who::Named(name) = &seen.who
                && is_static
            {
                self.fixed.insert(name.clone());
                continue;
            }
            if !self.is_in_frame(&seen.frame, topic)? {
                continue;
            }
            if let Some(odd) = seen.position.iter().find(|x| !x.is_finite()) {
                return Err(Fault::not_finite("position", &odd.to_string(), UNSEEN));
            }
            let name = match seen.who {
                Who::Topic => topic.clone(),
                Who::Listed(number) => format!("{topic}/{number}"),
                Who::Named(name) => name,
            };
            self.vehicle = self.names.index(&name, self.vehicle);
            let log_ns = i64::try_from(message.log_ns).unwrap_or(i64::MAX);
            let stamp = Stamp::Whole(self.time_of(message.of.channel, seen.stamp_ns, log_ns));
            let (vehicle, position) = (self.vehicle, seen.position);
            rows.push(Row { stamp, place: self.messages, vehicle, position, velocity: None, radius: None });
        }
        Ok(())
    }

    /// When a message speaks of \[ns\]. A stamp of 0 is a time like any other on a channel with other stamps.
    fn time_of(&mut self, channel: u16, stamp_ns: i64, log_ns: i64) -> i64 {
        if stamp_ns != 0 {
            self.stamped.insert(channel);
        }
        if self.stamped.contains(&channel) {
            return stamp_ns;
        }
        self.logged.insert(channel);
        log_ns
    }

    /// Whether a position is given in the frame that is read.
    fn is_in_frame(&mut self, frame: &str, topic: &str) -> Result<bool, Fault> {
        if let Some(wanted) = &self.wanted_frame {
            return Ok(wanted == frame);
        }
        match &self.frame {
            None => self.frame = Some((frame.to_owned(), topic.to_owned())),
            Some((known, _)) if known == frame => {}
            Some((known, first)) => {
                let problem = format!(
                    "positions are given in the frame {} on topic {} and in the frame {} here",
                    quoted(known),
                    quoted(first),
                    quoted(frame)
                );
                return Err(Fault::content(problem, "name the frame that is meant with --frame"));
            }
        }
        Ok(true)
    }
}

impl Rows for Foreign {
    fn next(&mut self, rows: &mut Vec<Row>) -> Result<bool, ReadError> {
        let before = rows.len();
        while rows.len() < before + BATCH {
            match self.topics.next()? {
                Some(Part::Message(message)) => self.poses.take(&message, rows)?,
                Some(Part::Topic(topic)) => {
                    let is_list = matches!(&*topic.schema, "foxglove.PosesInFrame" | "geometry_msgs/msg/PoseArray");
                    self.poses.listed &= is_list || reader_of(topic).is_none();
                }
                Some(_) => {}
                None => break,
            }
        }
        Ok(rows.len() > before)
    }

    fn rewind(&mut self) -> Result<(), ReadError> {
        self.topics = TopicReader::open(&self.path)?;
        self.poses.messages = 0;
        Ok(())
    }

    fn vehicles(&self) -> &[String] {
        &self.shown
    }

    /// Poses of a single topic are called by their numbers alone.
    fn settle_names(&mut self) {
        let names = &mut self.poses.names;
        let plain: Option<Vec<(&str, u64)>> = names
            .all()
            .iter()
            .map(|name| name.rsplit_once('/').and_then(|(topic, number)| Some((topic, number.parse().ok()?))))
            .collect();
        match plain {
            Some(plain) if plain.windows(2).all(|pair| pair[0].0 == pair[1].0) && self.poses.listed => {
                self.shown = plain.iter().map(|(_, number)| number.to_string()).collect();
            }
            _ => {
                names.settle();
                self.shown = names.all().to_vec();
            }
        }
    }

    fn notes(&self) -> Vec<String> {
        let fixed: Vec<_> = self.poses.fixed.iter().map(String::as_str).collect();
        let note = || format!("frames of tf_static stand still and are no vehicles: {}", fixed.join(", "));
        if fixed.is_empty() { Vec::new() } else { vec![note()] }
    }

    fn place(&self, number: u64) -> Place {
        Place::Part(format!("message {number} with positions"))
    }

    fn is_wide(&self) -> bool {
        false
    }

    /// Whether a channel says its times is known when all of it has been read.
    fn survey(&mut self) -> Result<Option<Probe>, ReadError> {
        let probe = survey(self)?;
        if self.poses.stamped.is_disjoint(&self.poses.logged) {
            return Ok(probe);
        }
        self.rewind()?;
        survey(self)
    }
}
