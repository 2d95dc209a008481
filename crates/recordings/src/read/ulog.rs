//! Reads `ULog` files of PX4: the positions of one vehicle.
//!
//! | topic | fields |
//! | --- | --- |
//! | `vehicle_global_position` | `lat`, `lon` \[degrees\], `alt` \[m\]; `lat_lon_valid`, `alt_valid` |
//! | `vehicle_local_position` | `x`, `y`, `z` \[m\] north, east and down of `ref_lat`, `ref_lon`, `ref_alt`; `xy_valid`, `z_valid`, `xy_global`, `z_global` |
//! | `vehicle_gps_position`, `sensor_gps` | `time_utc_usec`, which sets the clock of the vehicle |
//!
//! The global position is read if there is one, else the local position. Times count from the start of the vehicle's
//! computer; the GPS message with the smallest delay converts them to UTC. Messages are decoded here, because the
//! available crate fills truncated messages with zeros.

use std::collections::BTreeMap;
use std::io::{BufReader, Read};
use std::str;

use nalgebra::Vector3;
use tautline_core::fact::{self, Fact, FactKind};
use tautline_core::option::TOPIC;

use super::clock::Stamp;
use super::convention;
use super::earth::{EarthFrame, is_no_fix, no_fixes};
use super::error::{ContentKind, Fault, Place, ReadError, quoted, refuse};
use super::options::ReadOptions;
use super::order::{Ordered, Recording, RecordingInfo, Row, Rows};
use super::source::Source;
use super::time_unit::TimeUnit;

const GLOBAL: &str = "vehicle_global_position";
const LOCAL: &str = "vehicle_local_position";
const GPS: [&str; 2] = ["vehicle_gps_position", "sensor_gps"];

/// Size of the header \[bytes\]: magic, version, start time.
const HEADER_BYTES: usize = 16;

/// Largest nesting depth of formats.
const DEEPEST: usize = 8;

/// Earliest valid UTC of GPS \[us\], in 2001; receivers without a fix send earlier times.
const EARLIEST_UTC_US: u64 = 1_000_000_000_000_000;

/// Opens a log.
pub(super) fn open(source: &Source, options: &ReadOptions) -> Result<Recording, ReadError> {
    convention::refuse_known(options, "a log of PX4")?;
    let topic_option = match &options.topics[..] {
        [] => None,
        [topic] if topic == GLOBAL || topic == LOCAL => Some(topic.as_str()),
        [topic, ..] => {
            let problem = format!("{} is not a position topic", quoted(topic));
            let remedy = format!("use {} or {}", TOPIC.set(GLOBAL), TOPIC.set(LOCAL));
            return refuse(ContentKind::UnknownTopic, problem, remedy);
        }
    };
    let mut log = Log::default();
    let is_complete = log.scan(BufReader::new(source.bytes()?))?;
    let mut notes = options.accept_unfinished(is_complete)?;
    let topic = topic_option.unwrap_or(if log.global.is_empty() { LOCAL } else { GLOBAL });
    let fixes = if topic == GLOBAL { &log.global } else { &log.local };
    let Some(first) = fixes.first() else {
        let problem = format!("it has no {} with a known place on the Earth", topic_option.unwrap_or("position"));
        let remedy = "log vehicle_global_position, or give positions of a common frame as a table t,id,x,y,z";
        return refuse(ContentKind::NoFix, problem, remedy);
    };
    let local = EarthFrame::first(first.origin, options)?;
    let rows = log.rows(fixes, &local)?;
    notes.push(local.note());
    notes.push(format!("positions are read from {topic}"));
    let (clock, several) = match log.boot_us {
        Some(_) => ("times are set to UTC by GPS", FactKind::GpsClocks),
        None => ("times count from the start of the vehicle's computer", FactKind::CommonStart),
    };
    notes.push(clock.to_owned());
    notes.extend(no_fixes(if topic == GLOBAL { log.no_fixes } else { 0 }, ""));
    let none = Fault::content(ContentKind::Empty, "it holds no position", "record again");
    let mut info = RecordingInfo::new(source, options, Some(TimeUnit::Microseconds), notes, none);
    info.metadata.earth_origin = Some(local.measured_from(options.origin));
    let of_clock = if log.boot_us.is_some() { fact::Source::Recorded } else { fact::Source::Default };
    info.metadata.facts = vec![
        Fact::name(FactKind::Clock, of_clock, clock),
        Fact::name(FactKind::Identity, fact::Source::Convention, "one vehicle, named after the file"),
        Fact::name(FactKind::HeightUnit, fact::Source::Convention, "m"),
        Fact::name(FactKind::HeightReference, fact::Source::Convention, "sea level"),
    ];
    info.metadata.facts.extend(options.is_joined.then(|| Fact::new(several, fact::Source::Default)));
    let rows = Positions { names: vec![source.stem()], rows: rows.into_iter() };
    Ok(Box::new(Ordered::open(rows, info)?))
}

/// Position of the vehicle.
#[derive(Clone, Copy, Debug)]
struct Fix {
    /// Offset of its message in the file \[bytes\].
    at: u64,
    /// Time since the start of the vehicle's computer \[us\].
    time_us: u64,
    /// Origin: latitude, longitude \[degrees\] and height \[m\].
    origin: Vector3<f64>,
    /// East, north and up of the origin \[m\].
    position: Vector3<f64>,
}

/// Parsed content of a log.
#[derive(Default)]
struct Log {
    formats: BTreeMap<String, Vec<Field>>,
    topics: BTreeMap<u16, Topic>,
    global: Vec<Fix>,
    local: Vec<Fix>,
    /// Number of global positions without a fix.
    no_fixes: u64,
    /// Start of the computer \[us since 1970\], if known from GPS.
    boot_us: Option<i64>,
}

/// Field of a format.
struct Field {
    name: String,
    kind: String,
    count: usize,
}

/// Position topic or GPS topic: offset and kind of its fields.
struct Topic {
    name: String,
    fields: BTreeMap<String, (usize, Kind)>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Byte,
    U64,
    Float,
    Double,
}

impl Kind {
    /// Returns the size of a primitive type \[bytes\], and its kind if such fields are read.
    fn of(name: &str) -> Option<(usize, Option<Self>)> {
        Some(match name {
            "bool" => (1, Some(Self::Byte)),
            "int8_t" | "uint8_t" | "char" => (1, None),
            "int16_t" | "uint16_t" => (2, None),
            "int32_t" | "uint32_t" => (4, None),
            "int64_t" => (8, None),
            "uint64_t" => (8, Some(Self::U64)),
            "float" => (4, Some(Self::Float)),
            "double" => (8, Some(Self::Double)),
            _ => return None,
        })
    }
}

impl Log {
    /// Reads a log to its end; returns `false` if it is truncated.
    fn scan(&mut self, mut input: impl Read) -> Result<bool, ReadError> {
        let mut header = [0; HEADER_BYTES];
        if fill(&mut input, &mut header)? < HEADER_BYTES {
            return Ok(false);
        }
        let (mut offset, mut body, mut end) = (HEADER_BYTES as u64, Vec::new(), u64::MAX);
        while offset < end {
            let mut head = [0; 3];
            match fill(&mut input, &mut head)? {
                0 => return Ok(true),
                3 => {}
                _ => return Ok(false),
            }
            let size = u16::from_le_bytes([head[0], head[1]]);
            body.resize(usize::from(size), 0);
            if fill(&mut input, &mut body)? < body.len() {
                return Ok(false);
            }
            self.message(head[2], &body, offset, &mut end).map_err(|fault| fault.at(Place::Byte(offset)))?;
            offset += 3 + u64::from(size);
        }
        Ok(true)
    }

    fn message(&mut self, kind: u8, body: &[u8], offset: u64, end: &mut u64) -> Result<(), Fault> {
        match kind {
            b'B' => *end = flags(body)?,
            b'F' => {
                let (name, fields) = format_of(text(body)?)?;
                self.formats.insert(name, fields);
            }
            b'A' => self.subscribe(body)?,
            b'R' => {
                let id: [u8; 2] = take(body, 0)?;
                self.topics.remove(&u16::from_le_bytes(id));
            }
            b'D' => self.data(body, offset)?,
            // Other message types, also of later versions.
            _ if kind.is_ascii_uppercase() => {}
            _ => return Err(Fault::damaged(format!("a message of kind {kind:#04x}"))),
        }
        Ok(())
    }

    fn subscribe(&mut self, body: &[u8]) -> Result<(), Fault> {
        let id = u16::from_le_bytes(take(body, 1)?);
        let name = text(&body[3..])?;
        let wanted: &[&str] = match name {
            GLOBAL => &["timestamp", "lat", "lon", "alt"],
            LOCAL => &["timestamp", "x", "y", "z"],
            _ if GPS.contains(&name) => &["timestamp", "time_utc_usec"],
            _ => &[],
        };
        // Other instances belong to other sensors or estimators.
        if wanted.is_empty() || body[0] != 0 {
            self.topics.remove(&id);
            return Ok(());
        }
        let (mut fields, mut sizes) = (BTreeMap::new(), BTreeMap::new());
        let mut offset = 0_usize;
        let format = self.formats.get(name).ok_or_else(|| Fault::damaged(format!("`{name}` has no format")))?;
        for field in format {
            let bytes = self.size(&field.kind, DEEPEST, &mut sizes)?.saturating_mul(field.count);
            if let Some((_, Some(kind))) = Kind::of(&field.kind).filter(|_| field.count == 1) {
                fields.insert(field.name.clone(), (offset, kind));
            }
            offset = offset.saturating_add(bytes);
        }
        if let Some(missing) = wanted.iter().find(|name| !fields.contains_key(**name)) {
            return Err(Fault::damaged(format!("`{name}` has no field `{missing}` of its kind")));
        }
        self.topics.insert(id, Topic { name: name.to_owned(), fields });
        Ok(())
    }

    /// Returns the size of a type \[bytes\], which may be a format. `known` keeps the sizes of formats.
    fn size<'a>(&'a self, kind: &'a str, depth: usize, known: &mut BTreeMap<&'a str, usize>) -> Result<usize, Fault> {
        if let Some(bytes) = Kind::of(kind).map(|(bytes, _)| bytes).or_else(|| known.get(kind).copied()) {
            return Ok(bytes);
        }
        let unknown = || Fault::damaged(format!("there is no format {}", quoted(kind)));
        let fields = self.formats.get(kind).filter(|_| depth > 0).ok_or_else(unknown)?;
        let mut bytes = 0_usize;
        for field in fields {
            bytes = bytes.saturating_add(self.size(&field.kind, depth - 1, known)?.saturating_mul(field.count));
        }
        known.insert(kind, bytes);
        Ok(bytes)
    }

    fn data(&mut self, body: &[u8], offset: u64) -> Result<(), Fault> {
        let id = u16::from_le_bytes(take(body, 0)?);
        let Some(topic) = self.topics.get(&id) else { return Ok(()) };
        let message = Message { topic, bytes: &body[2..] };
        let time_us = message.whole("timestamp")?;
        match topic.name.as_str() {
            GLOBAL => {
                let place = message.place(["lat", "lon", "alt"])?;
                let valid = message.is_set("lat_lon_valid")? && message.is_set("alt_valid")?;
                let numbers = Vector3::from(message.numbers(["lat", "lon", "alt"])?);
                self.no_fixes += u64::from(valid && is_no_fix(&numbers));
                if let Some(origin) = place.filter(|_| valid) {
                    self.global.push(Fix { at: offset, time_us, origin, position: Vector3::zeros() });
                }
            }
            LOCAL => {
                let mut valid = true;
                for flag in ["xy_valid", "z_valid", "xy_global", "z_global"] {
                    valid &= message.is_set(flag)?;
                }
                let knows = ["ref_lat", "ref_lon", "ref_alt"].iter().all(|name| topic.fields.contains_key(*name));
                let origin = if knows { message.place(["ref_lat", "ref_lon", "ref_alt"])? } else { None };
                let [north, east, down] = message.numbers(["x", "y", "z"])?;
                let position = Vector3::new(east, north, -down);
                if let Some(origin) = origin.filter(|_| valid && position.iter().all(|x| x.is_finite())) {
                    self.local.push(Fix { at: offset, time_us, origin, position });
                }
            }
            _ => {
                let utc_us = message.whole("time_utc_usec")?;
                // The message with the smallest delay gives the latest start time.
                let boot_us = i64::try_from(utc_us)
                    .ok()
                    .zip(i64::try_from(time_us).ok())
                    .and_then(|(utc, time)| utc.checked_sub(time));
                if utc_us > EARLIEST_UTC_US {
                    self.boot_us = self.boot_us.max(boot_us);
                }
            }
        }
        Ok(())
    }

    fn rows(&self, fixes: &[Fix], local: &EarthFrame) -> Result<Vec<Row>, ReadError> {
        let mut fix_frame = *local;
        let row = |fix: &Fix| self.row(fix, local, &mut fix_frame).map_err(|fault| fault.at(Place::Byte(fix.at)));
        fixes.iter().map(row).collect()
    }

    /// Converts a position to the frame `local`; `fix_frame` caches the frame of the last origin.
    fn row(&self, fix: &Fix, local: &EarthFrame, fix_frame: &mut EarthFrame) -> Result<Row, Fault> {
        fix_frame.move_to(fix.origin)?;
        let time_us = i64::try_from(fix.time_us).ok().and_then(|time| time.checked_add(self.boot_us.unwrap_or(0)));
        let stamp = Stamp::Whole(time_us.ok_or_else(Fault::out_of_range)?);
        let position = local.position_from(fix_frame, fix.position);
        Ok(Row { stamp, place: fix.at, vehicle: 0, position, velocity: None, radius: None })
    }
}

/// Message of a subscribed topic.
struct Message<'a> {
    topic: &'a Topic,
    bytes: &'a [u8],
}

impl Message<'_> {
    fn field(&self, name: &str) -> Result<(usize, Kind), Fault> {
        let field = self.topic.fields.get(name).copied();
        field.ok_or_else(|| Fault::damaged(format!("`{}` has no field `{name}`", self.topic.name)))
    }

    fn whole(&self, name: &str) -> Result<u64, Fault> {
        match self.field(name)? {
            (offset, Kind::U64) => Ok(u64::from_le_bytes(take(self.bytes, offset)?)),
            _ => Err(Fault::damaged(format!("field `{name}` of `{}` is of another kind", self.topic.name))),
        }
    }

    fn numbers(&self, names: [&str; 3]) -> Result<[f64; 3], Fault> {
        let mut numbers = [0.0; 3];
        for (number, name) in numbers.iter_mut().zip(names) {
            *number = match self.field(name)? {
                (offset, Kind::Double) => f64::from_le_bytes(take(self.bytes, offset)?),
                (offset, Kind::Float) => f64::from(f32::from_le_bytes(take(self.bytes, offset)?)),
                _ => return Err(Fault::damaged(format!("field `{name}` of `{}` is of another kind", self.topic.name))),
            };
        }
        Ok(numbers)
    }

    /// Returns a place on the Earth; `None` if a number is not finite, or latitude and longitude are 0.
    fn place(&self, names: [&str; 3]) -> Result<Option<Vector3<f64>>, Fault> {
        let place = Vector3::from(self.numbers(names)?);
        Ok(Some(place).filter(|place| place.iter().all(|x| x.is_finite()) && !is_no_fix(place)))
    }

    /// Returns whether a flag is set or absent.
    fn is_set(&self, name: &str) -> Result<bool, Fault> {
        match self.topic.fields.get(name) {
            Some(&(offset, Kind::Byte)) => Ok(take::<1>(self.bytes, offset)? != [0]),
            _ => Ok(true),
        }
    }
}

/// Fills the buffer as far as possible; returns the number of bytes read.
fn fill(input: &mut impl Read, bytes: &mut [u8]) -> Result<usize, ReadError> {
    let mut filled = 0;
    while filled < bytes.len() {
        match input.read(&mut bytes[filled..]) {
            Ok(0) => break,
            Ok(read) => filled += read,
            Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
            Err(error) => return Err(Fault::from(error).into()),
        }
    }
    Ok(filled)
}

fn take<const N: usize>(bytes: &[u8], offset: usize) -> Result<[u8; N], Fault> {
    let part = offset.checked_add(N).and_then(|end| bytes.get(offset..end)).and_then(|part| part.try_into().ok());
    part.ok_or_else(|| Fault::damaged("a message is shorter than its format"))
}

fn text(bytes: &[u8]) -> Result<&str, Fault> {
    str::from_utf8(bytes).map_err(|_| Fault::not_utf8())
}

/// Reads the flags of a log and returns the byte offset at which its messages end. Data that were appended after a
/// crash hold no positions.
fn flags(body: &[u8]) -> Result<u64, Fault> {
    const APPENDED: u8 = 1;
    let needed: [u8; 8] = take(body, 8)?;
    if needed[0] & !APPENDED != 0 || needed[1..].iter().any(|&byte| byte != 0) {
        let problem = "unknown version of ULog";
        let remedy = "convert its vehicle_global_position with `ulog2csv`, and give the result";
        return refuse(ContentKind::UnsupportedFormat, problem, remedy);
    }
    let appended = u64::from_le_bytes(take(body, 16)?);
    Ok(if needed[0] & APPENDED == 0 || appended == 0 { u64::MAX } else { appended })
}

/// Parses the name and the fields of a format such as `gps:uint64_t timestamp;float[3] v;`.
fn format_of(text: &str) -> Result<(String, Vec<Field>), Fault> {
    let damaged = || Fault::damaged(format!("invalid format {}", quoted(text)));
    let (name, fields) = text.split_once(':').ok_or_else(damaged)?;
    let field = |text: &str| {
        let (kind, name) = text.trim().split_once(' ')?;
        let (kind, count) = match kind.split_once('[') {
            Some((kind, count)) => (kind, count.strip_suffix(']')?.parse().ok()?),
            None => (kind, 1),
        };
        Some(Field { name: name.trim().to_owned(), kind: kind.to_owned(), count })
    };
    let fields = fields.split(';').filter(|field| !field.trim().is_empty());
    let fields: Option<Vec<_>> = fields.map(field).collect();
    Ok((name.to_owned(), fields.ok_or_else(damaged)?))
}

/// Positions of a log.
struct Positions {
    names: Vec<String>,
    rows: std::vec::IntoIter<Row>,
}

impl Rows for Positions {
    fn next(&mut self, rows: &mut Vec<Row>) -> Result<bool, ReadError> {
        let next = self.rows.next();
        rows.extend(next);
        Ok(next.is_some())
    }

    fn vehicles(&self) -> &[String] {
        &self.names
    }

    fn place(&self, number: u64) -> Place {
        Place::Byte(number)
    }
}
