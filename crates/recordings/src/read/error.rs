//! Errors of readers: file, place, fault and remedy.

use std::borrow::Cow;
use std::path::Path;
use std::{fmt, io};

use super::format::Format;
use tautline_core::failure::Failure;
use tautline_core::option::{ALLOW_UNFINISHED, COLUMN, FORMAT, FPS, Opt, SCALE, SKIP_INCOMPLETE, SORT, TIME_SCALE};

/// Longest quoted value in a message \[characters\].
const LONGEST_QUOTE: usize = 60;

/// Remedy for a position that is not finite.
pub(super) const UNSEEN: &str = "remove the row, or leave the cells empty: a vehicle that was not seen has no position";

const NOTHING_RECORDED: &str = "record again, or give another file";

/// Error of reading a recording.
#[derive(Debug, thiserror::Error)]
#[error("{file}{}: {fault}", self.comma_place())]
pub struct ReadError {
    /// The file; empty until it is set by `ReadError::of`.
    pub file: String,
    /// Place in the file, if known.
    pub place: Option<Place>,
    /// The fault.
    #[source]
    pub fault: Fault,
}

impl ReadError {
    /// Returns an error of a file as a whole.
    #[must_use]
    pub fn new(file: &Path, fault: Fault) -> Self {
        Self::from(fault).of(file)
    }

    /// Sets the file, unless it is already set.
    pub(super) fn of(self, file: &Path) -> Self {
        if self.file.is_empty() { Self { file: file.display().to_string(), ..self } } else { self }
    }

    /// Adds the remedy for one of several files, which may not belong to the recording.
    pub(super) fn among_others(mut self) -> Self {
        if let Fault::Content { remedy, .. } = &mut self.fault {
            remedy.push_str("; or remove the file if it does not belong to the recording");
        }
        self
    }

    /// Returns the remedy, as a sentence without a full stop.
    #[must_use]
    pub fn help(&self) -> String {
        match self.fault {
            Fault::UnknownFormat => format!("set {FORMAT} to one of {}", Format::names()),
            ref fault => fault.help().into_owned(),
        }
    }

    /// Returns the stable code of the problem, such as `recording/unknown-format`.
    #[must_use]
    pub fn code(&self) -> &'static str {
        self.fault.code()
    }

    /// Returns whether the operating system failed, not the input.
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

impl<F: Into<Fault>> From<F> for ReadError {
    fn from(fault: F) -> Self {
        Self { file: String::new(), place: None, fault: fault.into() }
    }
}

/// Place in a recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Place {
    /// Line of a text file, from 1.
    Line(u64),
    /// Row of a table, from 1.
    Row(u64),
    /// Byte of the file, from 0.
    Byte(u64),
    /// Named part: an array element, a message of a topic, an entry of an archive.
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

/// Fault of a recording.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Fault {
    /// Error of the operating system.
    #[error("cannot read the file: {0}")]
    System(#[source] io::Error),
    /// The file has no bytes.
    #[error("it is empty")]
    Empty,
    /// The content has no known format.
    #[error("unknown format")]
    UnknownFormat,
    /// The content does not have the requested format.
    #[error("it is not {}: it begins with other bytes", .0.title)]
    WrongFormat(Format),
    /// A line exceeds the limit \[bytes\].
    #[error("the line is longer than {0} bytes")]
    LineTooLong(usize),
    /// The text is not UTF-8.
    #[error("the text is not in UTF-8")]
    NotUtf8,
    /// The file is truncated; the missing part.
    #[error("it is truncated: {0}")]
    Truncated(String),
    /// The file was not closed, so that its end may be missing.
    #[error("the recorder did not close the file, so the end may be missing")]
    Unfinished,
    /// Compressed data exceed the growth limit; the sizes.
    #[error("{0}")]
    Bomb(String),
    /// The content contradicts its format; the reason.
    #[error("it is damaged: {0}")]
    Damaged(String),
    /// The content has the format, but is not valid motion.
    #[error("{problem}")]
    Content {
        /// Kind of the problem.
        kind: ContentKind,
        /// The problem.
        problem: String,
        /// The remedy.
        remedy: String,
    },
}

/// Kind of a [`Fault::Content`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ContentKind {
    /// Several columns may hold a quantity.
    AmbiguousColumn,
    /// The layout of the numbers is ambiguous.
    AmbiguousLayout,
    /// Several topics may hold the positions.
    AmbiguousTopics,
    /// Several columns may name the vehicle.
    AmbiguousVehicle,
    /// An entry of the archive is missing or duplicate.
    ArchiveEntry,
    /// An array has the wrong shape.
    ArrayShape,
    /// The index of a ROS 2 bag contradicts its files.
    BagIndex,
    /// An option contradicts the file.
    ContradictsOption,
    /// The content contradicts its format.
    Damaged,
    /// A number has a decimal comma.
    DecimalComma,
    /// The degree of a curve is out of range.
    Degree,
    /// A vehicle has two positions at one time.
    DuplicateRow,
    /// A piece of a curve has no valid duration.
    Duration,
    /// The elements have a type that is not read.
    ElementType,
    /// There are no samples.
    Empty,
    /// A cell without a value needs one.
    EmptyCell,
    /// A row has the wrong number of fields.
    FieldCount,
    /// The folder has no tables, or tables in several folders.
    Folder,
    /// The frame rate is invalid.
    FrameRate,
    /// Times count frames of unknown duration.
    Frames,
    /// The knots of a B-spline have the wrong order or number.
    Knots,
    /// The line ends are those of no table.
    LineEnds,
    /// A list has the wrong length.
    ListLength,
    /// The text has the wrong structure.
    Malformed,
    /// A column is missing.
    MissingColumn,
    /// No row has a fix.
    NoFix,
    /// The header is missing.
    NoHeader,
    /// The origin of places on the Earth is missing.
    NoOrigin,
    /// The column of positions is missing.
    NoPositionColumn,
    /// No part of the file has positions.
    NoPositions,
    /// The column of times is missing.
    NoTimeColumn,
    /// The column of vehicles is missing.
    NoVehicleColumn,
    /// A pipe or device cannot be read twice.
    NotAFile,
    /// A text is not a number.
    NotANumber,
    /// A number is not finite.
    NotFinite,
    /// A latitude or longitude is out of range.
    NotOnEarth,
    /// An option is out of range.
    OptionOutOfRange,
    /// A number is too large.
    Overflow,
    /// A position jumps between two fixes.
    PositionJump,
    /// A radius is out of range.
    Radius,
    /// Times are of several clocks.
    SeveralClocks,
    /// Positions are in several frames.
    SeveralFrames,
    /// Rows of one vehicle may be of several.
    SeveralVehicles,
    /// Time runs backwards.
    TimeBackwards,
    /// A time has an unknown format.
    TimeFormat,
    /// Transforms are no tree of rigid motions.
    Transforms,
    /// Two options give the unit of time.
    TwoTimeUnits,
    /// Quotes are not closed.
    UnclosedQuotes,
    /// Units contradict each other.
    UnitConflict,
    /// The content has no known format.
    UnknownFormat,
    /// A named topic does not exist.
    UnknownTopic,
    /// A unit is unknown.
    UnknownUnit,
    /// A named vehicle does not exist.
    UnknownVehicle,
    /// The compression is not supported.
    UnsupportedCompression,
    /// The format is not supported.
    UnsupportedFormat,
    /// A frame cannot be used.
    UnusableFrame,
    /// An option has no meaning for the format.
    UnusedOption,
    /// Two vehicles may be the same.
    VehicleTwice,
    /// The content does not have the requested format.
    WrongFormat,
}

impl ContentKind {
    /// Returns the stable code, such as `recording/time-backwards`.
    #[must_use]
    pub fn code(self) -> &'static str {
        match self {
            Self::AmbiguousColumn => "recording/ambiguous-column",
            Self::AmbiguousLayout => "recording/ambiguous-layout",
            Self::AmbiguousTopics => "recording/ambiguous-topics",
            Self::AmbiguousVehicle => "recording/ambiguous-vehicle",
            Self::ArchiveEntry => "recording/archive-entry",
            Self::ArrayShape => "recording/array-shape",
            Self::BagIndex => "recording/bag-index",
            Self::ContradictsOption => "recording/contradicts-option",
            Self::Damaged => "recording/damaged",
            Self::DecimalComma => "recording/decimal-comma",
            Self::Degree => "recording/degree",
            Self::DuplicateRow => "recording/duplicate-row",
            Self::Duration => "recording/duration",
            Self::ElementType => "recording/element-type",
            Self::Empty => "recording/empty",
            Self::EmptyCell => "recording/empty-cell",
            Self::FieldCount => "recording/field-count",
            Self::Folder => "recording/folder",
            Self::FrameRate => "recording/frame-rate",
            Self::Frames => "recording/frames",
            Self::Knots => "recording/knots",
            Self::LineEnds => "recording/line-ends",
            Self::ListLength => "recording/list-length",
            Self::Malformed => "recording/malformed",
            Self::MissingColumn => "recording/missing-column",
            Self::NoFix => "recording/no-fix",
            Self::NoHeader => "recording/no-header",
            Self::NoOrigin => "recording/no-origin",
            Self::NoPositionColumn => "recording/no-position-column",
            Self::NoPositions => "recording/no-positions",
            Self::NoTimeColumn => "recording/no-time-column",
            Self::NoVehicleColumn => "recording/no-vehicle-column",
            Self::NotAFile => "recording/not-a-file",
            Self::NotANumber => "recording/not-a-number",
            Self::NotFinite => "recording/not-finite",
            Self::NotOnEarth => "recording/not-on-earth",
            Self::OptionOutOfRange => "recording/option-out-of-range",
            Self::Overflow => "recording/overflow",
            Self::PositionJump => "recording/position-jump",
            Self::Radius => "recording/radius",
            Self::SeveralClocks => "recording/several-clocks",
            Self::SeveralFrames => "recording/several-frames",
            Self::SeveralVehicles => "recording/several-vehicles",
            Self::TimeBackwards => "recording/time-backwards",
            Self::TimeFormat => "recording/time-format",
            Self::Transforms => "recording/transforms",
            Self::TwoTimeUnits => "recording/two-time-units",
            Self::UnclosedQuotes => "recording/unclosed-quotes",
            Self::UnitConflict => "recording/unit-conflict",
            Self::UnknownFormat => "recording/unknown-format",
            Self::UnknownTopic => "recording/unknown-topic",
            Self::UnknownUnit => "recording/unknown-unit",
            Self::UnknownVehicle => "recording/unknown-vehicle",
            Self::UnsupportedCompression => "recording/unsupported-compression",
            Self::UnsupportedFormat => "recording/unsupported-format",
            Self::UnusableFrame => "recording/unusable-frame",
            Self::UnusedOption => "recording/unused-option",
            Self::VehicleTwice => "recording/vehicle-twice",
            Self::WrongFormat => "recording/wrong-format",
        }
    }
}

impl From<io::Error> for Fault {
    /// Converts an error of reading; kinds that decoders use become faults of the content.
    fn from(error: io::Error) -> Self {
        use io::ErrorKind as Kind;
        match error.kind() {
            Kind::FileTooLarge => Self::Bomb(error.to_string()),
            Kind::UnexpectedEof => Self::Truncated("the end of its data is missing".to_owned()),
            Kind::InvalidData | Kind::InvalidInput | Kind::Other => Self::damaged(error),
            _ => Self::System(error),
        }
    }
}

impl Fault {
    pub(super) fn at(self, place: Place) -> ReadError {
        ReadError { place: Some(place), ..self.into() }
    }

    pub(super) fn content(kind: ContentKind, problem: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::Content { kind, problem: problem.into(), remedy: remedy.into() }
    }

    pub(super) fn damaged(reason: impl fmt::Display) -> Self {
        Self::Damaged(reason.to_string())
    }

    /// Returns the fault of a format whose reader is a feature that this build lacks.
    #[cfg(not(all(feature = "arrow", feature = "mcap", feature = "shows")))]
    pub(crate) fn without_feature(feature: &str) -> Self {
        let problem = format!("its format needs the feature `{feature}`, which this build lacks");
        let remedy = format!("build tautline-recordings with the feature `{feature}`");
        Self::content(ContentKind::UnsupportedFormat, problem, remedy)
    }

    /// Returns the fault of a table without rows.
    pub(super) fn header_only() -> Self {
        Self::content(ContentKind::Empty, "it has a header and no rows", NOTHING_RECORDED)
    }

    /// Returns the fault of a number that is infinite or NaN.
    pub(super) fn not_finite(column: &str, value: &str, remedy: &str) -> Self {
        let problem = format!("column `{column}` holds {}, which is not finite", quoted(value));
        Self::content(ContentKind::NotFinite, problem, remedy)
    }

    /// Returns the fault of an empty cell where a value is required.
    pub(super) fn empty_cell(column: &str) -> Self {
        let remedy = "fill it, or leave all cells of the position empty if the vehicle was not seen";
        Self::content(ContentKind::EmptyCell, format!("column `{column}` is empty"), remedy)
    }

    /// Returns the fault of an empty cell beside other coordinates.
    pub(super) fn empty_coordinate(column: &str) -> Self {
        let remedy = format!(
            "fill it, leave all cells of the position empty if the vehicle was not seen, or read such rows as rows \
             without a position with {SKIP_INCOMPLETE}"
        );
        Self::content(ContentKind::EmptyCell, format!("column `{column}` is empty"), remedy)
    }

    /// Returns the fault of decreasing time.
    pub(super) fn time_backwards(time_s: f64, before_s: f64) -> Self {
        let problem = format!("time runs backwards: {time_s} s comes after {before_s} s");
        let remedy = format!(
            "check whether the clock was set; if rows belong to several vehicles, name their column with {}; if rows \
             are only out of order, use {SORT}",
            COLUMN.set("id=NAME")
        );
        Self::content(ContentKind::TimeBackwards, problem, remedy)
    }

    /// Returns the fault of times that count frames of unknown duration.
    pub(super) fn frames(problem: impl Into<String>) -> Self {
        let remedy = format!(
            "set the frame rate with {FPS}, such as {}, or the duration of a frame in seconds with {TIME_SCALE}",
            FPS.set("30")
        );
        Self::content(ContentKind::Frames, problem, remedy)
    }

    /// Returns the fault of a value that overflows in metres or seconds.
    pub(super) fn out_of_range() -> Self {
        let remedy = format!("check {SCALE} and the values");
        Self::content(ContentKind::Overflow, "a value exceeds the range of numbers", remedy)
    }

    fn code(&self) -> &'static str {
        match self {
            Self::System(error) if error.kind() == io::ErrorKind::NotFound => "recording/not-found",
            Self::System(_) => "recording/cannot-read",
            Self::Empty => "recording/empty",
            Self::UnknownFormat => "recording/unknown-format",
            Self::WrongFormat(_) => "recording/wrong-format",
            Self::LineTooLong(_) => "recording/line-too-long",
            Self::NotUtf8 => "recording/not-utf8",
            Self::Truncated(_) => "recording/truncated",
            Self::Unfinished => "recording/unfinished",
            Self::Bomb(_) => "recording/grows-too-large",
            Self::Damaged(_) => "recording/damaged",
            Self::Content { kind, .. } => kind.code(),
        }
    }

    fn help(&self) -> Cow<'_, str> {
        let remedy = match self {
            Self::System(error) if error.kind() == io::ErrorKind::NotFound => "check the path",
            Self::System(_) => "check the permissions of the file, and the disk",
            Self::Empty => NOTHING_RECORDED,
            Self::UnknownFormat => return format!("set {FORMAT}").into(),
            Self::WrongFormat(_) => {
                return format!("omit {FORMAT} to recognise the content, or set another format").into();
            }
            Self::LineTooLong(_) => "check the line ends; a recording has one line per time",
            Self::NotUtf8 => "save it as UTF-8",
            Self::Truncated(_) => "copy or record it again",
            Self::Unfinished => {
                return format!("copy or record it again, or accept the complete part with {ALLOW_UNFINISHED}").into();
            }
            Self::Bomb(_) => "if the size is expected, unpack it and give the unpacked file",
            Self::Damaged(_) => return format!("copy or record it again, or set {FORMAT}").into(),
            Self::Content { remedy, .. } => remedy,
        };
        remedy.into()
    }
}

/// Returns a fault of the content as an error.
pub(super) fn refuse<T, E: From<Fault>>(
    kind: ContentKind,
    problem: impl Into<String>,
    remedy: impl Into<String>,
) -> Result<T, E> {
    Err(Fault::content(kind, problem, remedy).into())
}

/// Returns an option with its possible values, such as `--layout A or B`.
pub(super) fn one_of(option: Opt, values: &[impl AsRef<str>]) -> String {
    let Some((first, others)) = values.split_first() else { return option.to_string() };
    let first = option.set(first.as_ref()).to_string();
    others.iter().fold(first, |text, value| format!("{text} or {}", value.as_ref()))
}

/// Quotes a value with backticks, shortened and without control characters.
pub(super) fn quoted(value: &str) -> String {
    let printable = |c: char| if c.is_control() { '\u{fffd}' } else { c };
    let mut shown: String = value.chars().take(LONGEST_QUOTE).map(printable).collect();
    if value.chars().nth(LONGEST_QUOTE).is_some() {
        shown.push('…');
    }
    format!("`{shown}`")
}

/// Lists the first `shown` names that are not empty, and the number of further ones.
pub(super) fn list(names: &[String], shown: usize) -> String {
    let names: Vec<_> = names.iter().filter(|name| !name.is_empty()).map(|name| quoted(name)).collect();
    match names.len() {
        0 => "none".to_owned(),
        count if count > shown => format!("{} and {} more", names[..shown].join(", "), count - shown),
        _ => names.join(", "),
    }
}

impl From<ReadError> for Failure {
    fn from(error: ReadError) -> Self {
        Self::new(error.code(), error.is_machine(), error.to_string()).with_help(error.help())
    }
}
