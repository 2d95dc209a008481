//! Table of the readers, one row per format, and recognition of the format of a file by its content.

use std::io::Read;
use std::ops::Deref;
use std::path::Path;
use std::{fmt, str};

use super::error::{ContentKind, Fault, ReadError, refuse};
use super::options::ReadOptions;
use super::order::Recording;
use super::skybrush::SHOW;
use super::source::{Archive, GZIP_MAGIC, Source};
use super::{bezier, capture, compressed, crazyflie, csv, heading, mcap, npz, objects, parquet, skybrush, ulog, vviz};

/// Reader of a format: a row of [`READERS`].
pub struct Reader {
    /// Name for `--format`.
    pub name: &'static str,
    /// Name in sentences, with its article.
    pub title: &'static str,
    /// Usual extensions. Recognition uses only the content.
    pub extensions: &'static [&'static str],
    /// Description for `--help` and docs/recordings.md.
    pub docs: &'static str,
    /// First bytes of every file of the format; empty without such bytes.
    pub(super) magic: &'static [&'static [u8]],
    /// Whether a file is of this format, by its first bytes. The first row of [`READERS`] that accepts a file reads it.
    pub(super) sniff: fn(&Head<'_>) -> bool,
    pub(super) open: fn(&Source, &ReadOptions) -> Result<Recording, ReadError>,
    /// Options of [`FormatOption`] that this format supports.
    pub(super) supports: &'static [FormatOption],
    pub(super) packing: Packing,
}

/// All readers, in the order of recognition.
pub static READERS: &[Reader] = &[
    ulog::READER,
    parquet::READER,
    mcap::READER,
    npz::READER,
    compressed::SKYB,
    objects::READER,
    vviz::READER,
    skybrush::READER,
    compressed::CRAZYFLIE,
    capture::MOTIVE,
    capture::VICON,
    bezier::READER,
    crazyflie::READER,
    csv::CSV,
    csv::TRAJNET,
    csv::TEXT,
];

/// Options that only some formats support.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum FormatOption {
    TimeUnit,
    Rows,
    Dimensions,
    Starts,
    Columns,
    Layout,
    Origin,
    Frame,
    Topics,
    Axes,
    OneVehicle,
    Incomplete,
    Clock,
    Unfinished,
}

impl FormatOption {
    /// Options of tables with named columns.
    pub(super) const TABLE: &'static [Self] =
        &[Self::TimeUnit, Self::Rows, Self::Columns, Self::Origin, Self::Axes, Self::OneVehicle, Self::Incomplete];
}

/// Packing in which a file of a format is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Packing {
    /// With gzip and in an archive.
    Any,
    /// In an archive.
    Archive,
    None,
}

/// First bytes of a file.
pub(super) struct Head<'a> {
    pub(super) bytes: &'a [u8],
    /// The bytes from the first non-blank on, if the bytes contain no NUL.
    pub(super) text: Option<&'a [u8]>,
    /// The first line that is neither empty nor a comment.
    pub(super) line: Option<&'a [u8]>,
}

impl<'a> Head<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes).trim_ascii_start();
        let text = Some(text).filter(|text| memchr::memchr(0, text).is_none());
        let lines = text.unwrap_or_default().split(|&byte| byte == b'\n').map(<[u8]>::trim_ascii);
        let line = lines.into_iter().find(|line| !line.is_empty() && !line.starts_with(b"#"));
        Self { bytes, text, line }
    }

    pub(super) fn begins_with_any(&self, magic: &[&[u8]]) -> bool {
        magic.iter().any(|magic| self.bytes.starts_with(magic))
    }

    /// Returns whether the bytes are text and the text satisfies `has`.
    pub(super) fn is_text(&self, has: impl FnOnce(&[u8]) -> bool) -> bool {
        self.text.is_some_and(has)
    }
}

/// A format of recordings: a row of [`READERS`].
#[derive(Clone, Copy)]
pub struct Format(&'static Reader);

impl Format {
    /// A table in CSV.
    pub const CSV: Self = Self(&csv::CSV);
    /// Numbers separated by blanks.
    pub const TEXT: Self = Self(&csv::TEXT);
    /// A table of `TrajNet`.
    pub const TRAJNET: Self = Self(&csv::TRAJNET);
    /// A table in Parquet.
    pub const PARQUET: Self = Self(&parquet::READER);
    /// `NumPy` arrays.
    pub const NPZ: Self = Self(&npz::READER);
    /// MCAP.
    pub const MCAP: Self = Self(&mcap::READER);
    /// Pieces of Bezier curves.
    pub const BEZIER: Self = Self(&bezier::READER);
    /// Crazyflie polynomials.
    pub const CRAZYFLIE: Self = Self(&crazyflie::READER);
    /// Compressed Crazyflie trajectories.
    pub const CRAZYFLIE_COMPRESSED: Self = Self(&compressed::CRAZYFLIE);
    /// Compiled Skybrush trajectories.
    pub const SKYB: Self = Self(&compressed::SKYB);
    /// A Skybrush show.
    pub const SKYBRUSH: Self = Self(&skybrush::READER);

    /// Returns all formats.
    pub fn all() -> impl Iterator<Item = Self> {
        READERS.iter().map(Self)
    }

    /// Returns the names of all formats, for messages.
    #[must_use]
    pub fn names() -> String {
        READERS.iter().map(|reader| reader.name).collect::<Vec<_>>().join(", ")
    }
}

impl Deref for Format {
    type Target = Reader;

    fn deref(&self) -> &Reader {
        self.0
    }
}

impl PartialEq for Format {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl Eq for Format {}

impl fmt::Debug for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name)
    }
}

/// Number of bytes examined.
const HEAD_BYTES: u64 = 64 * 1024;

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

/// Returns whether a file is a zip archive that contains neither `NumPy` arrays nor a show.
pub(super) fn is_archive(path: &Path) -> Result<bool, ReadError> {
    let head = head_of(&Source::file(path))?;
    Ok(Head::new(&head).begins_with_any(Format::NPZ.magic)
        && !Archive::open(path)?.names().iter().any(|name| is_recording(name)))
}

/// Returns whether a file is text without a row of numbers or a time column, such as a note beside tables.
pub(super) fn is_prose(source: &Source) -> bool {
    let Ok(head) = head_of(source) else { return false };
    // The examined bytes may end inside a character.
    let text = match str::from_utf8(&head) {
        Ok(text) => text,
        Err(error) if error.error_len().is_none() => str::from_utf8(&head[..error.valid_up_to()]).unwrap_or_default(),
        Err(_) => return false,
    };
    let between = |c: char| c.is_whitespace() || matches!(c, ',' | ';' | '(' | ')' | '#');
    let is_of_a_table = |line: &str| {
        let words: Vec<_> = line.split(between).filter(|word| !word.is_empty()).collect();
        let numbers = words.iter().filter(|word| word.parse::<f64>().is_ok()).count();
        (numbers > 1 && 2 * numbers > words.len()) || words.iter().any(|word| heading::is_clock(word))
    };
    !text.contains('\0') && !text.lines().any(is_of_a_table)
}

fn is_recording(entry: &str) -> bool {
    entry == SHOW || entry.rsplit('.').next() == Some("npy")
}

/// Returns the first bytes, unpacked.
fn head_of(source: &Source) -> Result<Vec<u8>, ReadError> {
    let mut head = Vec::new();
    source.bytes()?.take(HEAD_BYTES).read_to_end(&mut head)?;
    if head.is_empty() { Err(Fault::Empty.into()) } else { Ok(head) }
}

fn format_of(bytes: &[u8]) -> Result<Format, Fault> {
    if let Some(fault) = unsupported_bytes(bytes) {
        return Err(fault);
    }
    let head = Head::new(bytes);
    if let Some(fault) = head.text.and_then(unsupported_text) {
        return Err(fault);
    }
    Format::all().find(|format| (format.sniff)(&head)).ok_or(Fault::UnknownFormat)
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

pub(super) const BAG: &str = "convert it with `rosbags-convert --src BAG --dst flight --dst-storage mcap` (from `pip \
                              install rosbags`), and give the folder `flight`";
const DATAFLASH: &str = "write its POS messages with `mavlogdump.py --types POS --format csv`, and from that a table \
                         t,id,lat,lon,alt in degrees and metres";
const UNPACK: &str = "unpack it, and give the folder";
pub(super) const TABLE: &str = "give positions over time, such as a table t,id,x,y,z, or one JSON object per line";
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
