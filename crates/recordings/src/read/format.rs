//! Names and properties of the formats of recordings.

use std::fmt;
use std::ops::Deref;

use super::error::ReadError;
use super::options::ReadOptions;
use super::order::Recording;
use super::recognition::{Head, finds};
use super::source::{Source, VehicleFiles};
use super::{bezier, capture, crazyflie, csv, npz, objects, ulog};
use crate::segments::Trajectory;

/// Reader of a format.
#[derive(Clone, Copy)]
pub(super) enum Reader {
    /// Reads a file.
    File(fn(&Source, &ReadOptions) -> Result<Recording, ReadError>),
    /// Reads curves of vehicles, with a file each.
    Curves(OpenCurves),
    /// Reads curves of vehicles, with a file or a folder each, whose files are flown in sequence.
    Sequences(OpenCurves),
    /// Feature of the reader, which this build lacks.
    #[cfg(not(all(feature = "arrow", feature = "mcap", feature = "shows")))]
    Missing(&'static str),
}

/// Opens curves of vehicles by their names and files. The second argument is the note on other files.
pub(super) type OpenCurves = fn(VehicleFiles, Option<String>, &ReadOptions) -> Result<Recording, ReadError>;

/// Returns a reader, or the feature of it that this build lacks.
macro_rules! of_feature {
    ($feature:tt, $reader:expr) => {{
        #[cfg(feature = $feature)]
        {
            $reader
        }
        #[cfg(not(feature = $feature))]
        {
            Reader::Missing($feature)
        }
    }};
}

/// Properties of a format.
pub struct FormatInfo {
    /// Name for `--input-format`.
    pub name: &'static str,
    /// Name in sentences, with its article.
    pub title: &'static str,
    /// Usual extensions. Recognition uses only the content.
    pub extensions: &'static [&'static str],
    /// Description for `--help`.
    pub docs: &'static str,
    /// First bytes of every file of the format; empty without such bytes.
    pub(super) magic: &'static [&'static [u8]],
    /// Options of [`FormatOption`] that this format supports.
    pub(super) supports: &'static [FormatOption],
    pub(super) packing: Packing,
    /// Whether a file with the first bytes of the format is of this format. The first format that accepts a file reads
    /// it.
    pub(super) accepts: fn(&Head<'_>) -> bool,
    pub(super) reader: Reader,
}

/// A format of recordings.
#[derive(Clone, Copy)]
pub struct Format(&'static FormatInfo);

/// Properties that most formats have.
const CSV_TABLE: FormatInfo = FormatInfo {
    name: "",
    title: "",
    extensions: &["csv"],
    docs: "",
    magic: &[],
    supports: FormatOption::TABLE,
    packing: Packing::Any,
    // Accepts every file with the first bytes of the format.
    accepts: |_| true,
    reader: Reader::File(|source, options| csv::open(source, Format::CSV, options)),
};

impl Format {
    /// A log of PX4.
    pub const ULOG: Self = Self(&FormatInfo {
        name: "ulog",
        title: "a ULog of PX4",
        extensions: &["ulg"],
        docs: "Log of PX4",
        magic: &[b"ULog\x01\x12\x35"],
        supports: &[
            FormatOption::Rows,
            FormatOption::Origin,
            FormatOption::Topics,
            FormatOption::Axes,
            FormatOption::Unfinished,
        ],
        reader: Reader::File(ulog::open),
        ..CSV_TABLE
    });
    /// A table in Parquet.
    pub const PARQUET: Self = Self(&FormatInfo {
        name: "parquet",
        title: "a Parquet file",
        extensions: &["parquet"],
        docs: "Table in Parquet, long or wide",
        magic: &[b"PAR1"],
        reader: of_feature!("arrow", Reader::File(super::parquet::open)),
        ..CSV_TABLE
    });
    /// MCAP.
    pub const MCAP: Self = Self(&FormatInfo {
        name: "mcap",
        title: "an MCAP file",
        extensions: &["mcap"],
        docs: "MCAP: recordings of tautline, messages of Foxglove or ROS 2",
        magic: &[b"\x89MCAP0\r\n"],
        supports: &[
            FormatOption::Rows,
            FormatOption::Origin,
            FormatOption::Frame,
            FormatOption::Topics,
            FormatOption::Plans,
            FormatOption::Clock,
            FormatOption::Axes,
            FormatOption::Unfinished,
        ],
        packing: Packing::None,
        reader: of_feature!("mcap", Reader::File(super::mcap::open)),
        ..CSV_TABLE
    });
    /// `NumPy` arrays.
    pub const NPZ: Self = Self(&FormatInfo {
        name: "npz",
        title: "an NPZ archive",
        extensions: &["npz"],
        docs: "NumPy arrays `t` and `positions`, as `numpy.savez` writes them",
        magic: &[b"PK\x03\x04", b"PK\x05\x06"],
        supports: &[
            FormatOption::TimeUnit,
            FormatOption::Rows,
            FormatOption::Columns,
            FormatOption::Layout,
            FormatOption::Axes,
            FormatOption::OneVehicle,
        ],
        accepts: |head| finds(head.bytes, b".npy"),
        reader: Reader::File(npz::open),
        ..CSV_TABLE
    });
    /// Compiled Skybrush trajectories.
    pub const SKYB: Self = Self(&FormatInfo {
        name: "skyb",
        title: "a compiled Skybrush trajectory",
        extensions: &["skyb"],
        docs: "Compiled Skybrush trajectory, a file for each drone in a folder",
        magic: &[b"skyb"],
        supports: &[FormatOption::Axes],
        packing: Packing::Archive,
        reader: of_feature!("shows", Reader::Curves(super::compressed::open_skyb)),
        ..CSV_TABLE
    });
    /// A table of JSON objects.
    pub const OBJECTS: Self = Self(&FormatInfo {
        name: "jsonl",
        title: "a table of JSON objects",
        extensions: &["jsonl", "ndjson", "json"],
        docs: "Table with an object of JSON in each line, or a JSON array of objects",
        accepts: |head| head.text.is_some_and(objects::are_in),
        reader: Reader::File(objects::open),
        ..CSV_TABLE
    });
    /// A Skybrush show.
    pub const SKYBRUSH: Self = Self(&FormatInfo {
        name: "skybrush",
        title: "a Skybrush show",
        extensions: &["skyc", "json"],
        docs: "Skybrush show, or its JSON",
        supports: &[FormatOption::Axes],
        packing: Packing::None,
        accepts: |head| head.begins_with_any(Format::NPZ.magic) || head.text.is_some_and(|text| text.starts_with(b"{")),
        reader: of_feature!("shows", Reader::File(super::skybrush::open)),
        ..CSV_TABLE
    });
    /// Compressed Crazyflie trajectories.
    pub const CRAZYFLIE_COMPRESSED: Self = Self(&FormatInfo {
        name: "crazyflie-compressed",
        title: "a compressed Crazyflie trajectory",
        extensions: &["traj"],
        docs: "Compressed Crazyflie trajectory, a file for each vehicle in a folder",
        supports: &[FormatOption::Axes],
        packing: Packing::Archive,
        // A file without magic bytes: its segments must end with the last byte.
        accepts: |head| {
            Trajectory::decode(head.bytes, true)
                .is_ok_and(|(found, length)| length == head.bytes.len() && !found.segments.is_empty())
        },
        reader: of_feature!("shows", Reader::Curves(super::compressed::open_crazyflie)),
        ..CSV_TABLE
    });
    /// A take of `OptiTrack` Motive.
    pub const MOTIVE: Self = Self(&FormatInfo {
        name: "motive",
        title: "a take of OptiTrack Motive",
        docs: "Take of OptiTrack Motive as CSV",
        supports: &[FormatOption::Rows],
        accepts: |head| head.text.is_some_and(|text| text.starts_with(capture::MOTIVE)),
        reader: Reader::File(capture::open_motive),
        ..CSV_TABLE
    });
    /// An export of Vicon.
    pub const VICON: Self = Self(&FormatInfo {
        name: "vicon",
        title: "an export of Vicon",
        docs: "Export of Vicon Nexus or Tracker as CSV",
        supports: &[FormatOption::Rows, FormatOption::Axes],
        accepts: |head| head.text.is_some_and(capture::is_vicon),
        reader: Reader::File(capture::open_vicon),
        ..CSV_TABLE
    });
    /// Pieces of Bezier curves.
    pub const BEZIER: Self = Self(&FormatInfo {
        name: "bezier",
        title: "a table of Bezier curves",
        docs: "Pieces of Bezier curves, a CSV for each vehicle in a folder",
        supports: &[FormatOption::Starts, FormatOption::Axes],
        packing: Packing::Archive,
        accepts: |head| head.text.is_some_and(bezier::has_header),
        reader: Reader::Sequences(bezier::open),
        ..CSV_TABLE
    });
    /// Crazyflie polynomials.
    pub const CRAZYFLIE: Self = Self(&FormatInfo {
        name: "crazyflie",
        title: "a folder of Crazyflie polynomials",
        docs: "Crazyflie polynomials, a CSV for each vehicle in a folder",
        supports: &[FormatOption::Starts, FormatOption::Axes],
        packing: Packing::Archive,
        accepts: |head| head.line.is_some_and(|line| line.to_ascii_lowercase().starts_with(b"duration,")),
        reader: Reader::Sequences(crazyflie::open),
        ..CSV_TABLE
    });
    /// A table in CSV.
    pub const CSV: Self = Self(&FormatInfo {
        name: "csv",
        title: "a table in CSV",
        extensions: &["csv", "txt"],
        docs: "Table in text with a header, long (`t,id,x,y,z`) or wide (`t,x1,y1,z1,x2,...`)",
        // A text of comments only is also a table.
        accepts: |head| head.text.is_some() && head.line.is_none_or(csv::has_separators),
        ..CSV_TABLE
    });
    /// A table of `TrajNet`.
    pub const TRAJNET: Self = Self(&FormatInfo {
        name: "trajnet",
        title: "a table of TrajNet",
        extensions: &["txt"],
        docs: "Numbers between blanks: frame, vehicle, x and y",
        // `csv::open` recognises this format from all lines of a text.
        accepts: |_| false,
        reader: Reader::File(|source, options| csv::open(source, Format::TRAJNET, options)),
        ..CSV_TABLE
    });
    /// Numbers separated by blanks.
    pub const TEXT: Self = Self(&FormatInfo {
        name: "text",
        title: "a table in plain text",
        extensions: &["txt"],
        docs: "Numbers between blanks: `t x y z x y z ...`",
        supports: &[
            FormatOption::TimeUnit,
            FormatOption::Rows,
            FormatOption::Dimensions,
            FormatOption::Columns,
            FormatOption::Origin,
            FormatOption::Axes,
            FormatOption::OneVehicle,
            FormatOption::Incomplete,
        ],
        accepts: |head| head.text.is_some(),
        reader: Reader::File(|source, options| csv::open(source, Format::TEXT, options)),
        ..CSV_TABLE
    });

    /// All formats, in the order of recognition.
    const ALL: &[Self] = &[
        Self::ULOG,
        Self::PARQUET,
        Self::MCAP,
        Self::NPZ,
        Self::SKYB,
        Self::OBJECTS,
        Self::SKYBRUSH,
        Self::CRAZYFLIE_COMPRESSED,
        Self::MOTIVE,
        Self::VICON,
        Self::BEZIER,
        Self::CRAZYFLIE,
        Self::CSV,
        Self::TRAJNET,
        Self::TEXT,
    ];

    /// Returns all formats, in the order of recognition.
    pub fn all() -> impl Iterator<Item = Self> {
        Self::ALL.iter().copied()
    }

    /// Returns the names of all formats, for messages.
    #[must_use]
    pub fn names() -> String {
        Self::ALL.iter().map(|format| format.name).collect::<Vec<_>>().join(", ")
    }
}

impl Deref for Format {
    type Target = FormatInfo;

    fn deref(&self) -> &FormatInfo {
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
    Plans,
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
