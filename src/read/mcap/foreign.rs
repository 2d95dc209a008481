//! Recordings of others.

use std::collections::{BTreeMap, BTreeSet};

use super::super::clock::{Probe, Stamp};
use super::super::error::{Fault, Place, ReadError, quoted};
use super::super::names::Names;
use super::super::order::{BATCH, Ordered, Row, Rows, survey};
use super::super::source::Source;
use super::super::{ReadOptions, Recording, TimeUnit};
use super::messages::{self, Encoding, Kind, Seen, Who};
use super::{accept_unfinished, error_of, records};
use crate::record::mcap::framing::{Fields, Record, RecordReader};
use mcap::records::op;

pub(super) fn open(source: &Source, options: &ReadOptions) -> Result<Recording, ReadError> {
    let records = records(source)?;
    let notes = accept_unfinished(source, records.is_complete(), options)?;
    let poses = Poses {
        source: source.clone(),
        records,
        schemas: BTreeMap::new(),
        channels: BTreeMap::new(),
        stamped: BTreeSet::new(),
        logged: BTreeSet::new(),
        wanted_frame: options.frame.clone(),
        frame: None,
        names: Names::default(),
        shown: Vec::new(),
        vehicle: 0,
        messages: 0,
    };
    let none = match &options.frame {
        Some(frame) => {
            Fault::content(format!("no position is given in the frame {}", quoted(frame)), "name another frame")
        }
        None => Fault::content("its topics with positions have no message", "record again"),
    };
    let about = options.about(Some(TimeUnit::Nanoseconds), notes, none);
    Ok(Box::new(Ordered::open(poses, about)?))
}

struct Channel {
    topic: String,
    kind: Kind,
    encoding: Encoding,
}

/// Positions out of messages.
struct Poses {
    source: Source,
    records: RecordReader,
    schemas: BTreeMap<u16, Option<Kind>>,
    channels: BTreeMap<u16, Channel>,
    /// Channels with a message that says its time, and those with one that was taken at the time of logging.
    stamped: BTreeSet<u16>,
    logged: BTreeSet<u16>,
    /// The frame that the user asks for.
    wanted_frame: Option<String>,
    /// The frame of all positions so far, and the topic that it was met on.
    frame: Option<(String, String)>,
    /// Topic and place, or frame, of each vehicle.
    names: Names,
    /// The names as they are shown.
    shown: Vec<String>,
    /// Vehicle of the last row.
    vehicle: usize,
    messages: u64,
}

impl Poses {
    /// Takes in one record; `false` when there is none.
    fn advance(&mut self, rows: &mut Vec<Row>) -> Result<bool, ReadError> {
        let record = self.records.next().map_err(|trouble| error_of(&self.source, trouble))?;
        let Some(Record { offset, opcode, body }) = record else { return Ok(false) };
        let mut fields = Fields(body);
        let known = match opcode {
            op::SCHEMA => fields.u16().zip(fields.str()).map(|(number, name)| {
                self.schemas.insert(number, Kind::of_schema(name));
            }),
            op::CHANNEL => channel(fields).map(|(number, schema, topic, encoding)| {
                let kind = self.schemas.get(&schema).copied().flatten();
                if let Some((kind, encoding)) = kind.zip(Encoding::of_name(encoding)) {
                    self.channels.insert(number, Channel { topic: topic.to_owned(), kind, encoding });
                }
            }),
            op::MESSAGE => match message(fields) {
                Some((number, log_ns, bytes)) => {
                    let Some(channel) = self.channels.get(&number) else { return Ok(true) };
                    self.messages += 1;
                    let seen = messages::decode(channel.kind, channel.encoding, bytes);
                    let topic = channel.topic.clone();
                    self.take((number, &topic), log_ns, seen, rows)?;
                    Some(())
                }
                None => None,
            },
            _ => Some(()),
        };
        let damaged = || {
            let fault = Fault::damaged("a record is shorter than its fields");
            self.source.error(fault).at(Place::Byte(offset))
        };
        known.map(|()| true).ok_or_else(damaged)
    }

    /// Appends the rows of a message.
    fn take(
        &mut self,
        (channel, topic): (u16, &str),
        log_ns: i64,
        seen: Result<Vec<Seen>, String>,
        rows: &mut Vec<Row>,
    ) -> Result<(), ReadError> {
        let place = Place::Part(format!("message {} on topic `{topic}`", self.messages));
        let seen = seen.map_err(|reason| self.source.error(Fault::Damaged { reason }).at(place.clone()))?;
        for seen in seen {
            if !self.is_in_frame(&seen.frame, topic).map_err(|fault| self.source.error(fault).at(place.clone()))? {
                continue;
            }
            if let Some(odd) = seen.position.iter().find(|x| !x.is_finite()) {
                let fault = Fault::NotFinite { column: "position".to_owned(), value: odd.to_string() };
                return Err(self.source.error(fault).at(place));
            }
            let name = match seen.who {
                Who::Topic => topic.to_owned(),
                Who::Listed(number) => format!("{topic}/{number}"),
                Who::Named(name) => name,
            };
            self.vehicle = self.names.index(&name, self.vehicle);
            let stamp = Stamp::Whole(self.time_of(channel, seen.stamp_ns, log_ns));
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

/// Number, schema, topic and encoding of a channel.
fn channel(mut fields: Fields<'_>) -> Option<(u16, u16, &str, &str)> {
    Some((fields.u16()?, fields.u16()?, fields.str()?, fields.str()?))
}

/// Channel, time of logging \[ns\] and content of a message.
fn message(mut fields: Fields<'_>) -> Option<(u16, i64, &[u8])> {
    let channel = fields.u16()?;
    let _sequence = fields.u32()?;
    let log_ns = i64::try_from(fields.u64()?).unwrap_or(i64::MAX);
    let _publish_ns = fields.u64()?;
    Some((channel, log_ns, fields.0))
}

impl Rows for Poses {
    fn next(&mut self, rows: &mut Vec<Row>) -> Result<bool, ReadError> {
        let before = rows.len();
        while rows.len() < before + BATCH && self.advance(rows)? {}
        Ok(rows.len() > before)
    }

    fn rewind(&mut self) -> Result<(), ReadError> {
        self.records = records(&self.source)?;
        self.schemas.clear();
        self.channels.clear();
        self.messages = 0;
        Ok(())
    }

    fn vehicles(&self) -> &[String] {
        &self.shown
    }

    /// Poses of a single topic are called by their numbers alone.
    fn settle_names(&mut self) {
        let plain: Option<Vec<(&str, u64)>> = self
            .names
            .all()
            .iter()
            .map(|name| name.rsplit_once('/').and_then(|(topic, number)| Some((topic, number.parse().ok()?))))
            .collect();
        match plain {
            Some(plain) if plain.windows(2).all(|pair| pair[0].0 == pair[1].0) && self.listed() => {
                self.shown = plain.iter().map(|(_, number)| number.to_string()).collect();
            }
            _ => {
                self.names.settle();
                self.shown = self.names.all().to_vec();
            }
        }
    }

    fn error(&self, fault: Fault) -> ReadError {
        self.source.error(fault)
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
        if self.stamped.is_disjoint(&self.logged) {
            return Ok(probe);
        }
        self.rewind()?;
        survey(self)
    }
}

impl Poses {
    /// Whether all channels hold lists of poses.
    fn listed(&self) -> bool {
        self.channels.values().all(|channel| matches!(channel.kind, Kind::PosesInFrame | Kind::PoseArray))
    }
}
