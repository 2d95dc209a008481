//! Errors of readers: file, place, fault and remedy.

use std::path::Path;
use std::{fmt, io};

use super::format::Format;
use tautline_core::failure::Failure;
use tautline_core::option::{COLUMN, FORMAT, FPS, Opt, SCALE, SKIP_INCOMPLETE, SORT, TIME_SCALE};

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
        match &self.fault {
            Fault::System(error) if error.kind() == io::ErrorKind::NotFound => "check the path".to_owned(),
            Fault::System(_) => "check the permissions of the file, and the disk".to_owned(),
            Fault::Content { remedy, .. } => remedy.clone(),
        }
    }

    /// Returns the stable code of the problem, such as `recording/unknown-format`.
    #[must_use]
    pub fn code(&self) -> &'static str {
        match &self.fault {
            Fault::System(error) if error.kind() == io::ErrorKind::NotFound => "recording/not-found",
            Fault::System(_) => "recording/cannot-read",
            Fault::Content { kind, .. } => kind.code(),
        }
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
    /// The content cannot be read, or is not valid motion.
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

/// Defines [`ContentKind`] with the stable code of each kind.
macro_rules! content_kinds {
    ($(#[doc = $doc:literal] $kind:ident = $code:literal,)+) => {
        /// Kind of a [`Fault::Content`].
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[non_exhaustive]
        pub enum ContentKind {
            $(#[doc = $doc] $kind,)+
        }

        impl ContentKind {
            /// Returns the stable code, such as `recording/time-backwards`.
            #[must_use]
            pub fn code(self) -> &'static str {
                match self {
                    $(Self::$kind => $code,)+
                }
            }
        }
    };
}

content_kinds! {
    /// Several columns may hold a quantity.
    AmbiguousColumn = "recording/ambiguous-column",
    /// The layout of the numbers is ambiguous.
    AmbiguousLayout = "recording/ambiguous-layout",
    /// Several topics may hold the positions.
    AmbiguousTopics = "recording/ambiguous-topics",
    /// Several columns may name the vehicle.
    AmbiguousVehicle = "recording/ambiguous-vehicle",
    /// An entry of the archive is missing or duplicate.
    ArchiveEntry = "recording/archive-entry",
    /// An array has the wrong shape.
    ArrayShape = "recording/array-shape",
    /// The index of a ROS 2 bag contradicts its files.
    BagIndex = "recording/bag-index",
    /// An option contradicts the file.
    ContradictsOption = "recording/contradicts-option",
    /// The content contradicts its format.
    Damaged = "recording/damaged",
    /// A number has a decimal comma.
    DecimalComma = "recording/decimal-comma",
    /// The degree of a curve is out of range.
    Degree = "recording/degree",
    /// A vehicle has two positions at one time.
    DuplicateRow = "recording/duplicate-row",
    /// A piece of a curve has no valid duration.
    Duration = "recording/duration",
    /// The elements have a type that is not read.
    ElementType = "recording/element-type",
    /// There are no samples.
    Empty = "recording/empty",
    /// A cell without a value needs one.
    EmptyCell = "recording/empty-cell",
    /// A row has the wrong number of fields.
    FieldCount = "recording/field-count",
    /// The folder has no tables, or tables in several folders.
    Folder = "recording/folder",
    /// The frame rate is invalid.
    FrameRate = "recording/frame-rate",
    /// Times count frames of unknown duration.
    Frames = "recording/frames",
    /// Compressed data grow beyond the limit.
    GrowsTooLarge = "recording/grows-too-large",
    /// The knots of a B-spline have the wrong order or number.
    Knots = "recording/knots",
    /// The line ends are those of no table.
    LineEnds = "recording/line-ends",
    /// A line exceeds the limit.
    LineTooLong = "recording/line-too-long",
    /// A list has the wrong length.
    ListLength = "recording/list-length",
    /// The text has the wrong structure.
    Malformed = "recording/malformed",
    /// A column is missing.
    MissingColumn = "recording/missing-column",
    /// No row has a fix.
    NoFix = "recording/no-fix",
    /// The header is missing.
    NoHeader = "recording/no-header",
    /// The origin of places on the Earth is missing.
    NoOrigin = "recording/no-origin",
    /// The column of positions is missing.
    NoPositionColumn = "recording/no-position-column",
    /// No part of the file has positions.
    NoPositions = "recording/no-positions",
    /// The column of times is missing.
    NoTimeColumn = "recording/no-time-column",
    /// The column of vehicles is missing.
    NoVehicleColumn = "recording/no-vehicle-column",
    /// A pipe or device cannot be read twice.
    NotAFile = "recording/not-a-file",
    /// A text is not a number.
    NotANumber = "recording/not-a-number",
    /// A number is not finite.
    NotFinite = "recording/not-finite",
    /// A latitude or longitude is out of range.
    NotOnEarth = "recording/not-on-earth",
    /// The text is not UTF-8.
    NotUtf8 = "recording/not-utf8",
    /// An option is out of range.
    OptionOutOfRange = "recording/option-out-of-range",
    /// A number is too large.
    Overflow = "recording/overflow",
    /// A position jumps between two fixes.
    PositionJump = "recording/position-jump",
    /// A radius is out of range.
    Radius = "recording/radius",
    /// Times are of several clocks.
    SeveralClocks = "recording/several-clocks",
    /// Positions are in several frames.
    SeveralFrames = "recording/several-frames",
    /// Rows of one vehicle may be of several.
    SeveralVehicles = "recording/several-vehicles",
    /// Time runs backwards.
    TimeBackwards = "recording/time-backwards",
    /// A time has an unknown format.
    TimeFormat = "recording/time-format",
    /// Transforms are no tree of rigid motions.
    Transforms = "recording/transforms",
    /// The file is truncated.
    Truncated = "recording/truncated",
    /// Two options give the unit of time.
    TwoTimeUnits = "recording/two-time-units",
    /// Quotes are not closed.
    UnclosedQuotes = "recording/unclosed-quotes",
    /// The file was not closed, so that its end may be missing.
    Unfinished = "recording/unfinished",
    /// Units contradict each other.
    UnitConflict = "recording/unit-conflict",
    /// The content has no known format.
    UnknownFormat = "recording/unknown-format",
    /// A named topic does not exist.
    UnknownTopic = "recording/unknown-topic",
    /// A unit is unknown.
    UnknownUnit = "recording/unknown-unit",
    /// A named vehicle does not exist.
    UnknownVehicle = "recording/unknown-vehicle",
    /// The compression is not supported.
    UnsupportedCompression = "recording/unsupported-compression",
    /// The format is not supported.
    UnsupportedFormat = "recording/unsupported-format",
    /// A frame cannot be used.
    UnusableFrame = "recording/unusable-frame",
    /// An option has no meaning for the format.
    UnusedOption = "recording/unused-option",
    /// Two vehicles may be the same.
    VehicleTwice = "recording/vehicle-twice",
    /// The content does not have the requested format.
    WrongFormat = "recording/wrong-format",
}

impl From<io::Error> for Fault {
    /// Converts an error of reading; kinds that decoders use become faults of the content.
    fn from(error: io::Error) -> Self {
        use io::ErrorKind as Kind;
        match error.kind() {
            Kind::FileTooLarge => Self::grows_too_large(error.to_string()),
            Kind::UnexpectedEof => Self::truncated("the end of its data is missing"),
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

    /// Returns the fault of a content that contradicts its format.
    pub(super) fn damaged(reason: impl fmt::Display) -> Self {
        let remedy = format!("copy or record it again, or set {FORMAT}");
        Self::content(ContentKind::Damaged, format!("it is damaged: {reason}"), remedy)
    }

    /// Returns the fault of a file whose end is missing; `what` names the missing part.
    pub(super) fn truncated(what: impl fmt::Display) -> Self {
        Self::content(ContentKind::Truncated, format!("it is truncated: {what}"), "copy or record it again")
    }

    /// Returns the fault of a file without bytes.
    pub(super) fn empty() -> Self {
        Self::content(ContentKind::Empty, "it is empty", NOTHING_RECORDED)
    }

    /// Returns the fault of an unknown content.
    pub(super) fn unknown_format() -> Self {
        let remedy = format!("set {FORMAT} to one of {}", Format::names());
        Self::content(ContentKind::UnknownFormat, "unknown format", remedy)
    }

    /// Returns the fault of a content without the first bytes of the requested format.
    pub(super) fn wrong_format(format: Format) -> Self {
        let remedy = format!("omit {FORMAT} to recognise the content, or set another format");
        let problem = format!("it is not {}: it begins with other bytes", format.title);
        Self::content(ContentKind::WrongFormat, problem, remedy)
    }

    /// Returns the fault of a line above the limit \[bytes\].
    pub(super) fn line_too_long(limit: usize) -> Self {
        let remedy = "check the line ends; a recording has one line per time";
        Self::content(ContentKind::LineTooLong, format!("the line is longer than {limit} bytes"), remedy)
    }

    /// Returns the fault of a text that is not UTF-8.
    pub(super) fn not_utf8() -> Self {
        Self::content(ContentKind::NotUtf8, "the text is not in UTF-8", "save it as UTF-8")
    }

    /// Returns the fault of compressed data that grow beyond the limit.
    pub(super) fn grows_too_large(problem: String) -> Self {
        let remedy = "if the size is expected, unpack it and give the unpacked file";
        Self::content(ContentKind::GrowsTooLarge, problem, remedy)
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
    pub(super) fn not_finite(column: impl fmt::Display, value: &str, remedy: &str) -> Self {
        let problem = format!("column `{column}` holds {}, which is not finite", quoted(value));
        Self::content(ContentKind::NotFinite, problem, remedy)
    }

    /// Returns the fault of an empty cell where a value is required.
    pub(super) fn empty_cell(column: impl fmt::Display) -> Self {
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
    pub(super) fn time_backwards(problem: String) -> Self {
        let remedy = format!(
            "check whether the clock was set; if the rows belong to several vehicles, name their column with {}; if \
             the rows are only out of order, use {SORT}",
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

/// Lists the first `shown` names, and the number of further ones.
pub(super) fn first_few(names: &[impl AsRef<str>], shown: usize) -> String {
    let first: Vec<_> = names.iter().take(shown).map(AsRef::as_ref).collect();
    let more = names.len().saturating_sub(shown);
    first.join(", ") + &if more > 0 { format!(" and {more} more") } else { String::new() }
}

/// Lists the first `shown` names that are not empty, quoted, and the number of further ones.
pub(super) fn list(names: &[impl AsRef<str>], shown: usize) -> String {
    let names = names.iter().map(AsRef::as_ref).filter(|name| !name.is_empty());
    let names: Vec<_> = names.map(quoted).collect();
    if names.is_empty() { "none".to_owned() } else { first_few(&names, shown) }
}

impl From<ReadError> for Failure {
    fn from(error: ReadError) -> Self {
        Self::new(error.code(), error.is_machine(), error.to_string()).with_help(error.help())
    }
}
