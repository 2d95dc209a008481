//! Why a recording cannot be read: the file, the place in it, the fault and the remedy.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

use super::format::Format;

/// Longest value that a message repeats \[characters\].
const LONGEST_QUOTE: usize = 60;

/// A recording cannot be read.
#[derive(Debug, thiserror::Error)]
#[error("{file}{}: {fault}", self.comma_place())]
pub struct ReadError {
    /// The file.
    pub file: String,
    /// Where in the file, if in a certain place.
    pub place: Option<Place>,
    /// What is wrong.
    #[source]
    pub fault: Fault,
}

impl ReadError {
    /// Something is wrong with a file as a whole.
    #[must_use]
    pub fn new(file: &Path, fault: Fault) -> Self {
        Self { file: file.display().to_string(), place: None, fault }
    }

    /// What helps, as a sentence without a full stop.
    #[must_use]
    pub fn help(&self) -> String {
        self.fault.help()
    }

    /// Whether the machine failed and not the input.
    #[must_use]
    pub fn is_machine(&self) -> bool {
        use io::ErrorKind as Kind;
        let Fault::System(error) = &self.fault else { return false };
        !matches!(
            error.kind(),
            Kind::NotFound | Kind::PermissionDenied | Kind::IsADirectory | Kind::NotADirectory | Kind::InvalidInput
        )
    }

    fn comma_place(&self) -> String {
        self.place.as_ref().map_or_else(String::new, |place| format!(", {place}"))
    }
}

/// What is wrong, and where; who knows the file makes a [`ReadError`] of it.
#[derive(Debug)]
pub(super) struct FaultAt {
    /// Another file than that of the recording.
    file: Option<PathBuf>,
    place: Option<Place>,
    fault: Fault,
}

impl FaultAt {
    /// The same in another file than that of the recording.
    pub(super) fn in_file(self, file: &Path) -> Self {
        Self { file: Some(file.to_owned()), ..self }
    }

    /// The error of the recording.
    pub(super) fn of(self, recording: &Path) -> ReadError {
        let file = self.file.as_deref().unwrap_or(recording);
        ReadError { file: file.display().to_string(), place: self.place, fault: self.fault }
    }
}

impl<F: Into<Fault>> From<F> for FaultAt {
    fn from(fault: F) -> Self {
        Self { file: None, place: None, fault: fault.into() }
    }
}

/// Packed data grow beyond all measure.
#[derive(Debug, thiserror::Error)]
#[error("it grows to more than {inflated_bytes} bytes out of {packed_bytes}")]
pub(super) struct Grown {
    pub(super) inflated_bytes: u64,
    pub(super) packed_bytes: u64,
}

/// A place in a recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Place {
    /// A line of a text file, from 1.
    Line(u64),
    /// A row of a table, from 1.
    Row(u64),
    /// A byte of the file, from 0.
    Byte(u64),
    /// A part with a name: an array with its indices, a message of a topic, an entry of an archive.
    Part(String),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line(number) => write!(f, "line {number}"),
            Self::Row(number) => write!(f, "row {number}"),
            Self::Byte(offset) => write!(f, "byte {offset}"),
            Self::Part(name) => f.write_str(name),
        }
    }
}

/// What is wrong with a recording.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Fault {
    /// The system refuses to read.
    #[error("{0}")]
    System(#[source] io::Error),
    /// There are no bytes.
    #[error("it is empty")]
    Empty,
    /// There is a header and nothing below it.
    #[error("it has a header and no rows")]
    HeaderOnly,
    /// The content is of no known format.
    #[error("its content is of no format that is known")]
    UnknownFormat,
    /// Nothing in this build reads the format.
    #[error("it is {}, which this build does not read", .0.title())]
    NotBuilt(Format),
    /// The content is not of the format that was asked for.
    #[error("it is not {}: {reason}", .format.title())]
    WrongFormat {
        /// What was asked for.
        format: Format,
        /// What contradicts it.
        reason: String,
    },
    /// The first line holds numbers where a header is needed.
    #[error("the first line holds numbers and no names of columns")]
    NoHeader,
    /// A column is missing.
    #[error("there is no column for {role}; its columns are {}", list(.columns))]
    MissingColumn {
        /// What the column would hold.
        role: String,
        /// The option that names it.
        option: &'static str,
        /// The columns that are there.
        columns: Vec<String>,
    },
    /// Two columns claim the same role.
    #[error("the columns `{first}` and `{second}` both give {role}")]
    TwoColumns {
        /// What both hold.
        role: String,
        /// The first column.
        first: String,
        /// The second column.
        second: String,
    },
    /// A cell does not hold a number.
    #[error("column `{column}` holds {}, which is not a number", quoted(.value))]
    NotANumber {
        /// Name of the column.
        column: String,
        /// The cell.
        value: String,
    },
    /// A number is written with a decimal comma.
    #[error("column `{column}` holds {}, a number with a decimal comma", quoted(.value))]
    DecimalComma {
        /// Name of the column.
        column: String,
        /// The cell.
        value: String,
    },
    /// A number is infinite or not a number.
    #[error("column `{column}` holds {}, which is not finite", quoted(.value))]
    NotFinite {
        /// Name of the column.
        column: String,
        /// The cell.
        value: String,
    },
    /// A cell is empty that must not be.
    #[error("column `{column}` is empty")]
    EmptyCell {
        /// Name of the column.
        column: String,
    },
    /// A line has another number of fields than the first one.
    #[error("it has {found} fields where {expected} are expected")]
    FieldCount {
        /// Fields of the header, or of the first line.
        expected: usize,
        /// Fields found.
        found: usize,
        /// Whether fields are separated by commas, so that a decimal comma makes two of one.
        commas: bool,
    },
    /// Time runs backwards where it must not.
    #[error("time runs backwards: {time_s} s comes after {before_s} s")]
    TimeBackwards {
        /// The offending time \[s\].
        time_s: f64,
        /// The time before it \[s\].
        before_s: f64,
    },
    /// A vehicle is there twice at the same time.
    #[error("vehicle `{vehicle}` is there a second time at {time_s} s; the first is {first}")]
    Duplicate {
        /// Name of the vehicle.
        vehicle: String,
        /// The time \[s\].
        time_s: f64,
        /// Where it was first.
        first: Place,
    },
    /// A line is longer than any recording needs.
    #[error("the line is longer than {limit} bytes")]
    LineTooLong {
        /// The limit \[bytes\].
        limit: usize,
    },
    /// Text is not in UTF-8.
    #[error("the text is not in UTF-8")]
    NotUtf8,
    /// The file breaks off.
    #[error("it breaks off: {what}")]
    Truncated {
        /// What is missing.
        what: String,
    },
    /// The file was not closed, so that its end may be missing.
    #[error("it breaks off: it was not closed, so that its end may be missing")]
    Unfinished,
    /// Compressed data grow beyond all measure.
    #[error("it grows to more than {inflated_bytes} bytes out of {packed_bytes}")]
    Bomb {
        /// What it has grown to so far \[bytes\].
        inflated_bytes: u64,
        /// What it was packed into \[bytes\].
        packed_bytes: u64,
    },
    /// The content contradicts its format.
    #[error("it is damaged: {reason}")]
    Damaged {
        /// What is wrong with it.
        reason: String,
    },
    /// The content is of its format, but cannot be read as motion.
    #[error("{problem}")]
    Content {
        /// What is wrong.
        problem: String,
        /// What helps.
        remedy: String,
    },
}

impl From<io::Error> for Fault {
    /// What reading went wrong with, as a fault of the content where it is one.
    fn from(error: io::Error) -> Self {
        if let Some(grown) = error.get_ref().and_then(|inner| inner.downcast_ref::<Grown>()) {
            return Self::Bomb { inflated_bytes: grown.inflated_bytes, packed_bytes: grown.packed_bytes };
        }
        match error.kind() {
            io::ErrorKind::UnexpectedEof => Self::Truncated { what: "the end of its data is missing".to_owned() },
            io::ErrorKind::InvalidData | io::ErrorKind::InvalidInput | io::ErrorKind::Other => Self::damaged(error),
            _ => Self::System(error),
        }
    }
}

impl Fault {
    pub(super) fn at(self, place: Place) -> FaultAt {
        FaultAt { place: Some(place), ..self.into() }
    }

    pub(super) fn content(problem: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::Content { problem: problem.into(), remedy: remedy.into() }
    }

    pub(super) fn damaged(reason: impl fmt::Display) -> Self {
        Self::Damaged { reason: reason.to_string() }
    }

    /// The same of a time: a row without one says nothing.
    pub(super) fn of_time(self) -> Self {
        match self {
            Self::NotFinite { .. } => Self::content(self.to_string(), "take the row out: each needs a time"),
            other => other,
        }
    }

    fn help(&self) -> String {
        let text = match self {
            Self::System(error) if error.kind() == io::ErrorKind::NotFound => "look at the spelling of the path",
            Self::System(_) => "look at the permissions of the file and at the disk",
            Self::Empty | Self::HeaderOnly => "nothing was recorded: record again, or give another file",
            Self::UnknownFormat => {
                "name the format with --format: csv, text, parquet, npz, mcap, crazyflie or skybrush"
            }
            Self::NotBuilt(_) => "build it with the feature of the format's name",
            Self::WrongFormat { .. } => "leave --format away to have the content recognised, or name another format",
            Self::NoHeader => {
                "put a header above: t,id,x,y,z with a row for each vehicle and time, or t,x1,y1,z1,x2,... with a row \
                 for each time"
            }
            Self::MissingColumn { option, .. } => {
                return format!("name the column with --column {option}=NAME, or put it into the header");
            }
            Self::TwoColumns { .. } => "name the one that is meant with --column, or take the other out",
            Self::NotANumber { .. } => "write a number with a decimal point",
            Self::DecimalComma { .. } => "write numbers with a decimal point",
            Self::NotFinite { .. } => {
                "take the row out, or leave the cells empty: a vehicle that was not seen has no position"
            }
            Self::EmptyCell { .. } => {
                "fill it, or leave all cells of the position empty where the vehicle was not seen"
            }
            Self::FieldCount { commas: true, found, expected } if found > expected => {
                "every line needs a field for each column; where decimals are written with commas, write them with points"
            }
            Self::FieldCount { .. } => {
                "every line needs a field for each column; leave cells empty where a vehicle was not seen"
            }
            Self::TimeBackwards { .. } => "sort the lines by time, and look whether two recordings were joined",
            Self::Duplicate { .. } => "take one of the two out: a vehicle is in one place at a time",
            Self::LineTooLong { .. } => {
                "look whether the lines end as they should; a recording has a line for each time"
            }
            Self::NotUtf8 => "save it as UTF-8",
            Self::Truncated { .. } => "copy or record it again",
            Self::Unfinished => "copy or record it again, or accept what it holds with --allow-unfinished",
            Self::Bomb { .. } => "unpack it yourself if it is what you expect, and give the unpacked file",
            Self::Damaged { .. } => "copy or record it again, or name the format with --format",
            Self::Content { remedy, .. } => remedy,
        };
        text.to_owned()
    }
}

fn list(names: &[String]) -> String {
    const SHOWN: usize = 12;
    let shown: Vec<_> = names.iter().take(SHOWN).map(|name| quoted(name)).collect();
    let more = if names.len() > SHOWN { format!(" and {} more", names.len() - SHOWN) } else { String::new() };
    if shown.is_empty() { "none".to_owned() } else { shown.join(", ") + &more }
}

/// A value between backticks, shortened, and without what would steer a terminal.
pub(super) fn quoted(value: &str) -> String {
    let harmless = |c: char| if c.is_control() { '\u{fffd}' } else { c };
    let mut shown: String = value.chars().take(LONGEST_QUOTE).map(harmless).collect();
    if value.chars().nth(LONGEST_QUOTE).is_some() {
        shown.push('…');
    }
    format!("`{shown}`")
}
