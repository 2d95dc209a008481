//! Recognition of the format of a file by its first bytes, and of ROS 2 bags by their index.

use std::fs::File;
use std::io::{self, Read as _};
use std::path::Path;

use super::error::{ContentKind, Fault, ReadError, refuse};
use super::format::{Format, Packing, Reader};
use super::objects;
use super::options::ReadOptions;
use super::order::Recording;
use super::source::{Archive, GZIP_MAGIC, Source};

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
}

/// Remedies for files of other formats.
pub(super) const BAG: &str = "convert it with `rosbags-convert --src BAG --dst flight --dst-storage mcap` (from `pip \
                              install rosbags`), and give the folder `flight`";
pub(super) const TABLE: &str = "give positions over time, such as a table t,id,x,y,z, or one JSON object per line";

/// Number of bytes examined.
const HEAD_BYTES: u64 = 64 * 1024;

/// Returns the first bytes, unpacked.
pub(super) fn head_of(source: &Source) -> Result<Vec<u8>, ReadError> {
    let mut head = Vec::new();
    source.bytes()?.take(HEAD_BYTES).read_to_end(&mut head)?;
    if head.is_empty() { Err(Fault::empty().into()) } else { Ok(head) }
}

/// Name of the archive entry with a Skybrush show.
pub(super) const SHOW: &str = "show.json";

/// File name of the index of a ROS 2 bag.
pub(super) const BAG_INDEX: &str = "metadata.yaml";

/// Largest accepted index of a bag \[bytes\]: ten times the size for a thousand topics.
pub(super) const BAG_INDEX_LIMIT_BYTES: u64 = 4 * 1024 * 1024;

/// Returns the index of a ROS 2 bag, up to the first byte above the limit.
pub(super) fn bag_index(folder: &Path) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    File::open(folder.join(BAG_INDEX))?.take(BAG_INDEX_LIMIT_BYTES + 1).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Returns whether a folder is a ROS 2 bag.
pub(super) fn is_bag(folder: &Path) -> bool {
    let is_index = |bytes: Vec<u8>| {
        bytes.len() as u64 <= BAG_INDEX_LIMIT_BYTES
            && memchr::memmem::find(&bytes, b"rosbag2_bagfile_information").is_some()
    };
    folder.join(BAG_INDEX).is_file() && bag_index(folder).is_ok_and(is_index)
}

/// Returns whether bytes contain a part.
pub(super) fn finds(bytes: &[u8], part: &[u8]) -> bool {
    memchr::memmem::find(bytes, part).is_some()
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
    let alone = || vec![(source.stem(), vec![source.clone()])];
    match format.reader {
        Reader::File(open) => open(source, options),
        Reader::Curves(open) | Reader::Sequences(open) => open(alone(), None, options),
        #[cfg(not(all(feature = "arrow", feature = "mcap", feature = "shows")))]
        Reader::Missing(feature) => Err(Fault::without_feature(feature).into()),
    }
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
    Format::all().find(|format| has_magic(format.magic) && (format.accepts)(&head)).ok_or_else(Fault::unknown_format)
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
