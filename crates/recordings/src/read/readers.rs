//! Table of the readers, one row per format, and recognition of the format of a file by its content.

use std::path::Path;
use std::str;

use super::error::{ContentKind, Fault, ReadError, refuse};
use super::format::{Format, Packing};
use super::options::ReadOptions;
use super::order::Recording;
use super::reader::{BAG, Head, Reader, SHOW, TABLE, head_of};
use super::source::{Archive, GZIP_MAGIC, Source};
use super::{bezier, capture, crazyflie, csv, npz, objects, optional, ulog};

/// All readers, in the order of recognition.
static READERS: &[Reader] = &[
    ulog::READER,
    optional::PARQUET,
    optional::MCAP,
    npz::READER,
    optional::SKYB,
    objects::READER,
    optional::VVIZ,
    optional::SKYBRUSH,
    optional::CRAZYFLIE_COMPRESSED,
    capture::MOTIVE,
    capture::VICON,
    bezier::READER,
    crazyflie::READER,
    csv::CSV,
    csv::TRAJNET,
    csv::TEXT,
];

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
            return Err(Fault::WrongFormat(format).into());
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
    let reader = READERS.iter().find(|reader| reader.format == format).ok_or(Fault::UnknownFormat)?;
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
    let reader = READERS.iter().find(|reader| (reader.sniff)(&head)).ok_or(Fault::UnknownFormat)?;
    Ok(reader.format)
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

/// Returns the fault of a known but unsupported format.
fn unsupported_bytes(head: &[u8]) -> Option<Fault> {
    if head.starts_with(b"\x93NUMPY") {
        let remedy = "save positions together with their times: numpy.savez(\"flight.npz\", t=t, positions=positions)";
        let problem = "it is a single NumPy array, without times";
        return Some(Fault::content(ContentKind::NoTimeColumn, problem, remedy));
    }
    if head.starts_with(b"\xff\xfe") || head.starts_with(b"\xfe\xff") {
        return Some(Fault::NotUtf8);
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
    let holds = |word: &str| memchr::memmem::find(text, word.as_bytes()).is_some();
    let (what, remedy) = match text.first()? {
        b'<' if holds("<gpx") => ("a GPX track", EARTH),
        b'<' if holds("<kml") => ("a KML file", EARTH),
        b'<' if holds("<html") || holds("<HTML") => ("a page of HTML", TABLE),
        b'<' => ("an XML file", TABLE),
        b'[' if !objects::is_array(text) => ("JSON, but neither a Skybrush show nor an array of objects", TABLE),
        _ => return None,
    };
    Some(Fault::content(ContentKind::UnsupportedFormat, format!("it is {what}, which is not supported"), remedy))
}
