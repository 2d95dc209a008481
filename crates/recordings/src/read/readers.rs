//! Table of the readers, with a row for each format.

use std::fmt;
use std::ops::Deref;

use super::error::ReadError;
use super::options::ReadOptions;
use super::order::Recording;
use super::source::Source;
use super::{crazyflie, csv, mcap, motive, npz, objects, parquet, skybrush, ulog, vicon, vviz};

/// Reader of a format. Each reader is a file of this module and a row of [`READERS`].
pub struct Reader {
    /// Name for `--format`.
    pub name: &'static str,
    /// Name in sentences, with its article.
    pub title: &'static str,
    /// Usual extensions. Recognition uses only the content.
    pub extensions: &'static [&'static str],
    /// Description for `--help` and docs/recordings.md.
    pub docs: &'static str,
    /// First bytes of every file of the format; empty if there are none.
    pub(super) magic: &'static [&'static [u8]],
    /// Whether a file is of this format, by its first bytes. The first row of [`READERS`] that accepts a file reads it.
    pub(super) sniff: fn(&Head<'_>) -> bool,
    pub(super) open: fn(&Source, &ReadOptions) -> Result<Recording, ReadError>,
    /// Options of [`Takes`] that this format supports.
    pub(super) takes: &'static [Takes],
    pub(super) packing: Packing,
}

/// All readers, in the order of recognition.
pub static READERS: &[Reader] = &[
    ulog::READER,
    parquet::READER,
    mcap::READER,
    npz::READER,
    objects::READER,
    vviz::READER,
    skybrush::READER,
    motive::READER,
    vicon::READER,
    crazyflie::READER,
    csv::CSV,
    csv::TRAJNET,
    csv::TEXT,
];

/// Options that only some formats support.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Takes {
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
    Unfinished,
}

impl Takes {
    /// Options of tables with named columns.
    pub(super) const TABLE: &'static [Self] =
        &[Self::TimeUnit, Self::Rows, Self::Columns, Self::Origin, Self::Axes, Self::OneVehicle];
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

    /// Returns whether the text has a property; `false` if the bytes are not text.
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
    /// Numbers between blanks.
    pub const TEXT: Self = Self(&csv::TEXT);
    /// A table of `TrajNet`.
    pub const TRAJNET: Self = Self(&csv::TRAJNET);
    /// A table in Parquet.
    pub const PARQUET: Self = Self(&parquet::READER);
    /// `NumPy` arrays.
    pub const NPZ: Self = Self(&npz::READER);
    /// MCAP.
    pub const MCAP: Self = Self(&mcap::READER);
    /// Crazyflie polynomials.
    pub const CRAZYFLIE: Self = Self(&crazyflie::READER);
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
