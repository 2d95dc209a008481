//! Names and properties of the formats of recordings.

use std::fmt;
use std::ops::Deref;

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
        ..CSV_TABLE
    });
    /// A table in Parquet.
    pub const PARQUET: Self = Self(&FormatInfo {
        name: "parquet",
        title: "a Parquet file",
        extensions: &["parquet"],
        docs: "Table in Parquet, long or wide",
        magic: &[b"PAR1"],
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
            FormatOption::Clock,
            FormatOption::Axes,
            FormatOption::Unfinished,
        ],
        packing: Packing::None,
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
    });
    /// A table of JSON objects.
    pub const OBJECTS: Self = Self(&FormatInfo {
        name: "jsonl",
        title: "a table of JSON objects",
        extensions: &["jsonl", "ndjson", "json"],
        docs: "Table with an object of JSON in each line, or a JSON array of objects",
        ..CSV_TABLE
    });
    /// A VVIZ show.
    pub const VVIZ: Self = Self(&FormatInfo {
        name: "vviz",
        title: "a VVIZ show",
        extensions: &["vviz"],
        docs: "VVIZ show of Verge Aero or Finale 3D",
        supports: &[FormatOption::Rows],
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
        ..CSV_TABLE
    });
    /// A take of `OptiTrack` Motive.
    pub const MOTIVE: Self = Self(&FormatInfo {
        name: "motive",
        title: "a take of OptiTrack Motive",
        docs: "Take of OptiTrack Motive as CSV",
        supports: &[FormatOption::Rows],
        ..CSV_TABLE
    });
    /// An export of Vicon.
    pub const VICON: Self = Self(&FormatInfo {
        name: "vicon",
        title: "an export of Vicon",
        docs: "Export of Vicon Nexus or Tracker as CSV",
        supports: &[FormatOption::Rows, FormatOption::Axes],
        ..CSV_TABLE
    });
    /// Pieces of Bezier curves.
    pub const BEZIER: Self = Self(&FormatInfo {
        name: "bezier",
        title: "a table of Bezier curves",
        docs: "Pieces of Bezier curves, a CSV for each vehicle in a folder",
        supports: &[FormatOption::Starts, FormatOption::Axes],
        packing: Packing::Archive,
        ..CSV_TABLE
    });
    /// Crazyflie polynomials.
    pub const CRAZYFLIE: Self = Self(&FormatInfo {
        name: "crazyflie",
        title: "a folder of Crazyflie polynomials",
        docs: "Crazyflie polynomials, a CSV for each vehicle in a folder",
        supports: &[FormatOption::Starts, FormatOption::Axes],
        packing: Packing::Archive,
        ..CSV_TABLE
    });
    /// A table in CSV.
    pub const CSV: Self = Self(&FormatInfo {
        name: "csv",
        title: "a table in CSV",
        extensions: &["csv", "txt"],
        docs: "Table in text with a header, long (`t,id,x,y,z`) or wide (`t,x1,y1,z1,x2,...`)",
        ..CSV_TABLE
    });
    /// A table of `TrajNet`.
    pub const TRAJNET: Self = Self(&FormatInfo {
        name: "trajnet",
        title: "a table of TrajNet",
        extensions: &["txt"],
        docs: "Numbers between blanks: frame, vehicle, x and y",
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
        Self::VVIZ,
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
