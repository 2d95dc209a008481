//! Table of the readers, one row per format, and recognition of the format of a file by its content.

use std::path::Path;
use std::str;

use super::error::{ContentKind, Fault, ReadError, refuse};
use super::format::{Format, Packing};
use super::head::{BAG, Head, SHOW, TABLE, head_of};
use super::options::ReadOptions;
use super::order::Recording;
use super::source::{Archive, GZIP_MAGIC, Source};
use super::{bezier, capture, crazyflie, csv, npz, objects, ulog};
use crate::segments::Trajectory;

/// Returns the function that opens a file, or the fault of a feature that this build lacks.
macro_rules! open_with {
    ($feature:tt, $open:expr) => {{
        #[cfg(feature = $feature)]
        {
            $open
        }
        #[cfg(not(feature = $feature))]
        {
            |_, _| Err(Fault::without_feature($feature).into())
        }
    }};
}

/// Reader of a format.
struct Reader {
    format: Format,
    /// Whether a file with the first bytes of the format is of this format. The first reader that accepts a file reads
    /// it.
    accepts: fn(&Head<'_>) -> bool,
    open: fn(&Source, &ReadOptions) -> Result<Recording, ReadError>,
}

/// Accepts every file with the first bytes of the format.
const BY_MAGIC: fn(&Head<'_>) -> bool = |_| true;

/// All readers, in the order of recognition.
static READERS: &[Reader] = &[
    Reader { format: Format::ULOG, accepts: BY_MAGIC, open: ulog::open },
    Reader { format: Format::PARQUET, accepts: BY_MAGIC, open: open_with!("arrow", super::parquet::open) },
    Reader { format: Format::MCAP, accepts: BY_MAGIC, open: open_with!("mcap", super::mcap::open) },
    Reader { format: Format::NPZ, accepts: |head| finds(head.bytes, b".npy"), open: npz::open },
    Reader { format: Format::SKYB, accepts: BY_MAGIC, open: open_with!("shows", super::compressed::open_skyb) },
    Reader { format: Format::OBJECTS, accepts: |head| head.text.is_some_and(objects::are_in), open: objects::open },
    Reader {
        format: Format::VVIZ,
        accepts: |head| {
            head.text.is_some_and(|text| text.starts_with(b"{") && VVIZ_KEYS.iter().any(|key| finds(text, key)))
        },
        open: open_with!("shows", super::vviz::open),
    },
    Reader {
        format: Format::SKYBRUSH,
        accepts: |head| head.begins_with_any(Format::NPZ.magic) || head.text.is_some_and(|text| text.starts_with(b"{")),
        open: open_with!("shows", super::skybrush::open),
    },
    Reader {
        format: Format::CRAZYFLIE_COMPRESSED,
        // A file without magic bytes: its segments must end with the last byte.
        accepts: |head| {
            let is_whole =
                |(found, length): (Trajectory, usize)| length == head.bytes.len() && !found.segments.is_empty();
            Trajectory::decode(head.bytes, true).is_ok_and(is_whole)
        },
        open: open_with!("shows", super::compressed::open_crazyflie),
    },
    Reader {
        format: Format::MOTIVE,
        accepts: |head| head.text.is_some_and(|text| text.starts_with(capture::MOTIVE)),
        open: capture::open_motive,
    },
    Reader {
        format: Format::VICON,
        accepts: |head| head.text.is_some_and(capture::is_vicon),
        open: capture::open_vicon,
    },
    Reader {
        format: Format::BEZIER,
        accepts: |head| head.text.is_some_and(bezier::has_header),
        open: |source, options| bezier::open(alone(source), None, options),
    },
    Reader {
        format: Format::CRAZYFLIE,
        accepts: |head| head.line.is_some_and(|line| line.to_ascii_lowercase().starts_with(b"duration,")),
        open: |source, options| crazyflie::open(alone(source), None, options),
    },
    Reader {
        format: Format::CSV,
        // A text of comments only is also a table.
        accepts: |head| head.text.is_some() && head.line.is_none_or(csv::has_separators),
        open: |source, options| csv::open(source, Format::CSV, options),
    },
    Reader {
        format: Format::TRAJNET,
        // `csv::open` recognises this format from all lines of a text.
        accepts: |_| false,
        open: |source, options| csv::open(source, Format::TRAJNET, options),
    },
    Reader {
        format: Format::TEXT,
        accepts: |head| head.text.is_some(),
        open: |source, options| csv::open(source, Format::TEXT, options),
    },
];

/// Keys before the long arrays of a VVIZ show.
const VVIZ_KEYS: [&[u8]; 2] = [b"\"defaultPositionRate\"", b"\"agentTraversal\""];

fn finds(bytes: &[u8], part: &[u8]) -> bool {
    memchr::memmem::find(bytes, part).is_some()
}

/// Returns a file as the only one of its vehicle.
fn alone(source: &Source) -> Vec<(String, Vec<Source>)> {
    vec![(source.stem(), vec![source.clone()])]
}

/// Recognises the format of a file, and whether it is packed by gzip.
pub(super) fn recognise(source: &mut Source, forced: Option<Format>) -> Result<Format, ReadError> {
    source.gzip = false;
    let mut head = head_of(source)?;
    source.gzip = head.starts_with(&GZIP_MAGIC);
    if source.gzip {
        head = head_of(source)?;
    }
    let format = match forced {
        Some(format) if !format.magic.is_empty() && !Head::new(&head).begins_with_any(format.magic) => {
            return Err(Fault::wrong_format(format).into());
        }
        Some(format) => format,
        None => format_of(&head)?,
    };
    let packed = source.entry.is_some();
    let unpacks = match format.packing {
        Packing::Any => true,
        Packing::Archive => packed,
        Packing::None => false,
    };
    if (source.gzip || packed) && !unpacks {
        let (within, remedy) = if packed { ("an archive", "unzip") } else { ("gzip", "gunzip") };
        let problem = format!("it is {} inside {within}", format.title);
        return refuse(ContentKind::UnsupportedCompression, problem, format!("unpack it first, with {remedy}"));
    }
    Ok(format)
}

/// Opens a file of this format.
pub(super) fn open(format: Format, source: &Source, options: &ReadOptions) -> Result<Recording, ReadError> {
    let reader = READERS.iter().find(|reader| reader.format == format).ok_or_else(Fault::unknown_format)?;
    (reader.open)(source, options)
}

/// Returns whether a file is a zip archive that contains neither `NumPy` arrays nor a show.
pub(super) fn is_archive(path: &Path) -> Result<bool, ReadError> {
    let head = head_of(&Source::file(path))?;
    Ok(Head::new(&head).begins_with_any(Format::NPZ.magic)
        && !Archive::open(path)?.names().iter().any(|name| is_recording(name)))
}

fn is_recording(entry: &str) -> bool {
    entry == SHOW || entry.rsplit('.').next() == Some("npy")
}

fn format_of(bytes: &[u8]) -> Result<Format, Fault> {
    if let Some(fault) = unsupported_bytes(bytes) {
        return Err(fault);
    }
    let head = Head::new(bytes);
    if let Some(fault) = head.text.and_then(unsupported_text) {
        return Err(fault);
    }
    let has_magic = |magic: &[&[u8]]| magic.is_empty() || head.begins_with_any(magic);
    let reader = READERS.iter().find(|reader| has_magic(reader.format.magic) && (reader.accepts)(&head));
    reader.map(|reader| reader.format).ok_or_else(Fault::unknown_format)
}

/// Unsupported formats: first bytes, description and remedy.
const UNSUPPORTED: [(&[u8], &str, &str); 11] = [
    (b"#ROSBAG V", "a ROS 1 bag", BAG),
    (b"SQLite format 3\0", "an SQLite database, as ROS 2 bags are", BAG),
    (b"\xa3\x95", "a DataFlash log of ArduPilot", DATAFLASH),
    (b"FMT,", "a DataFlash log of ArduPilot", DATAFLASH),
    (b"FMT ", "a DataFlash log of ArduPilot", DATAFLASH),
    (
        b"\x89HDF\r\n\x1a\n",
        "an HDF5 file",
        "save its arrays with numpy.savez(\"flight.npz\", t=t, positions=positions)",
    ),
    (b"MATLAB 5.0", "a file of MATLAB", "write it with `writetable` as t,id,x,y,z"),
    (b"RRF2", "a recording of Rerun", "write its positions as a table t,id,x,y,z"),
    (b"\x28\xb5\x2f\xfd", "packed by zstd", "unpack it with unzstd"),
    (b"7z\xbc\xaf\x27\x1c", "a 7z archive", UNPACK),
    (b"Rar!\x1a\x07", "a RAR archive", UNPACK),
];

const DATAFLASH: &str = "write its POS messages with `mavlogdump.py --types POS --format csv`, and from that a table \
                         t,id,lat,lon,alt in degrees and metres";
const UNPACK: &str = "unpack it, and give the folder";
const EARTH: &str = "write it as a table t,id,lat,lon,alt: time, vehicle, degrees and metres";

const RECORDS: &str = "write an array of rows, as `to_json(\"flight.json\", orient=\"records\")` does";

/// Returns whether a text begins with an object of columns: `{"t":{"0":` or `{"columns":[`.
fn is_of_columns(text: &[u8]) -> bool {
    const LONGEST: usize = 200;
    let signs: Vec<u8> = text.iter().copied().filter(|byte| !byte.is_ascii_whitespace()).take(LONGEST).collect();
    let value = memchr::memchr(b':', &signs).map_or(&[][..], |colon| &signs[colon + 1..]);
    value.starts_with(b"{\"0\":") || signs.starts_with(b"{\"columns\":[")
}

/// Returns the fault of a known but unsupported format.
fn unsupported_bytes(head: &[u8]) -> Option<Fault> {
    if head.starts_with(b"\x93NUMPY") {
        let remedy = "save positions together with their times: numpy.savez(\"flight.npz\", t=t, positions=positions)";
        let problem = "it is a single NumPy array, without times";
        return Some(Fault::content(ContentKind::NoTimeColumn, problem, remedy));
    }
    if head.starts_with(b"\xff\xfe") || head.starts_with(b"\xfe\xff") {
        return Some(Fault::not_utf8());
    }
    // Each message of telemetry begins with the microseconds since 1970.
    if matches!(head, [0, 4..=7, _, _, _, _, _, _, 0xfd | 0xfe, ..]) {
        let remedy = "write its positions with `mavlogdump.py --types GLOBAL_POSITION_INT --format csv`, and from \
                      that a table t,id,lat,lon,alt in degrees and metres";
        return Some(Fault::content(
            ContentKind::UnsupportedFormat,
            "it is a MAVLink telemetry log, which is not supported",
            remedy,
        ));
    }
    if head.get(257..262) == Some(b"ustar") {
        return Some(Fault::content(
            ContentKind::UnsupportedFormat,
            "it is a tar archive, which is not supported",
            UNPACK,
        ));
    }
    let known = UNSUPPORTED.iter().find(|(begin, ..)| head.starts_with(begin));
    known.map(|(_, what, remedy)| {
        Fault::content(ContentKind::UnsupportedFormat, format!("it is {what}, which is not supported"), *remedy)
    })
}

/// Returns the fault of a known but unsupported text format; the text has no leading blanks.
fn unsupported_text(text: &[u8]) -> Option<Fault> {
    let holds = |word: &str| finds(text, word.as_bytes());
    let (what, remedy) = match text.first()? {
        b'<' if holds("<gpx") => ("a GPX track", EARTH),
        b'<' if holds("<kml") => ("a KML file", EARTH),
        b'<' if holds("<html") || holds("<HTML") => ("a page of HTML", TABLE),
        b'<' => ("an XML file", TABLE),
        b'{' if is_of_columns(text) => ("a JSON object of columns, as pandas writes", RECORDS),
        b'[' if !objects::are_in(text) => ("JSON, but neither a Skybrush show nor an array of objects", TABLE),
        _ => return None,
    };
    Some(Fault::content(ContentKind::UnsupportedFormat, format!("it is {what}, which is not supported"), remedy))
}

/// Channels of a recording of tautline: this build reads none, because it lacks the feature `mcap`.
#[cfg(not(feature = "mcap"))]
pub enum Channels {}

#[cfg(not(feature = "mcap"))]
impl Channels {
    /// Returns the channels of the next instant, one row per vehicle.
    ///
    /// # Errors
    /// [`ReadError`] if the recording is damaged.
    pub fn next(&mut self, _vehicles: usize) -> Result<Vec<tautline_core::record::Channel>, ReadError> {
        match *self {}
    }
}
