//! Why a recording cannot be read: the file, the place in it, the fault and the remedy.

use std::path::Path;
use std::{fmt, io};

use super::readers::Format;

/// Longest value that a message repeats \[characters\].
const LONGEST_QUOTE: usize = 60;

/// What helps where a position is not finite.
pub(super) const UNSEEN: &str =
    "take the row out, or leave the cells empty: a vehicle that was not seen has no position";

const NOTHING_RECORDED: &str = "nothing was recorded: record again, or give another file";

/// A recording cannot be read.
#[derive(Debug, thiserror::Error)]
#[error("{file}{}: {fault}", self.comma_place())]
pub struct ReadError {
    /// The file; empty until it is named.
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
        Self::from(fault).of(file)
    }

    /// The same in this file, unless it is known to be in another.
    pub(super) fn of(self, file: &Path) -> Self {
        if self.file.is_empty() { Self { file: file.display().to_string(), ..self } } else { self }
    }

    /// The same of one of several files, which may be none of the recording.
    pub(super) fn among_others(mut self) -> Self {
        if let Fault::Content { remedy, .. } = &mut self.fault {
            remedy.push_str("; or take the file away, if it is none of the recording");
        }
        self
    }

    /// What helps, as a sentence without a full stop.
    #[must_use]
    pub fn help(&self) -> String {
        match self.fault {
            Fault::UnknownFormat => format!("formats that can be read are {}; --format names one", Format::names()),
            ref fault => fault.help().to_owned(),
        }
    }

    /// The stable name of the problem, such as `recording/unknown-format`.
    #[must_use]
    pub fn code(&self) -> &'static str {
        self.fault.code()
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

impl<F: Into<Fault>> From<F> for ReadError {
    fn from(fault: F) -> Self {
        Self { file: String::new(), place: None, fault: fault.into() }
    }
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
    /// The content is of no known format.
    #[error("its content is of no format that is known")]
    UnknownFormat,
    /// The content is not of the format that was asked for.
    #[error("it is not {}: it does not begin as one does", .0.title)]
    WrongFormat(Format),
    /// A line is longer than any recording needs.
    #[error("the line is longer than {0} bytes")]
    LineTooLong(usize),
    /// Text is not in UTF-8.
    #[error("the text is not in UTF-8")]
    NotUtf8,
    /// The file breaks off; what is missing.
    #[error("it breaks off: {0}")]
    Truncated(String),
    /// The file was not closed, so that its end may be missing.
    #[error("it breaks off: it was not closed, so that its end may be missing")]
    Unfinished,
    /// Packed data grow beyond all measure; how far.
    #[error("{0}")]
    Bomb(String),
    /// The content contradicts its format; how.
    #[error("it is damaged: {0}")]
    Damaged(String),
    /// The content is of its format, but cannot be read as motion.
    #[error("{problem}")]
    Content {
        /// The stable name of the problem, such as `recording/time-backwards`.
        code: &'static str,
        /// What is wrong.
        problem: String,
        /// What helps.
        remedy: String,
    },
}

impl From<io::Error> for Fault {
    /// What reading went wrong with, as a fault of the content where it is one.
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

    pub(super) fn coded(code: &'static str, problem: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::Content { code, problem: problem.into(), remedy: remedy.into() }
    }

    pub(super) fn damaged(reason: impl fmt::Display) -> Self {
        Self::Damaged(reason.to_string())
    }

    /// There is a header and nothing below it.
    pub(super) fn header_only() -> Self {
        Self::coded("recording/empty", "it has a header and no rows", NOTHING_RECORDED)
    }

    /// A number is infinite or not a number.
    pub(super) fn not_finite(column: &str, value: &str, remedy: &str) -> Self {
        let problem = format!("column `{column}` holds {}, which is not finite", quoted(value));
        Self::coded("recording/not-finite", problem, remedy)
    }

    /// A cell is empty that must not be.
    pub(super) fn empty_cell(column: &str) -> Self {
        let remedy = "fill it, or leave all cells of the position empty where the vehicle was not seen";
        Self::coded("recording/empty-cell", format!("column `{column}` is empty"), remedy)
    }

    /// Time runs backwards where it must not.
    pub(super) fn time_backwards(time_s: f64, before_s: f64) -> Self {
        let problem = format!("time runs backwards: {time_s} s comes after {before_s} s");
        let remedy = "look whether two recordings were joined or the clock was set; where the rows are of several \
                      vehicles, name the column that tells them apart with --column id=NAME; where the lines are only \
                      out of order, sort the lines by time, or have them sorted with --sort";
        Self::coded("recording/time-backwards", problem, remedy)
    }

    /// Times are numbers of frames, and the duration of a frame is not given.
    pub(super) fn frames(problem: impl Into<String>) -> Self {
        let remedy = "say how many there are in a second with --fps, such as --fps 30, or how many seconds each lasts \
                      with --time-scale";
        Self::coded("recording/frames", problem, remedy)
    }

    /// Numbers that are finite in the file are not in metres and seconds.
    pub(super) fn out_of_range() -> Self {
        Self::coded(
            "recording/overflow",
            "its numbers leave the range of numbers",
            "look at --scale and at the numbers themselves",
        )
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
            Self::Content { code, .. } => code,
        }
    }

    fn help(&self) -> &str {
        match self {
            Self::System(error) if error.kind() == io::ErrorKind::NotFound => "look at the spelling of the path",
            Self::System(_) => "look at the permissions of the file and at the disk",
            Self::Empty => NOTHING_RECORDED,
            Self::UnknownFormat => "name the format with --format",
            Self::WrongFormat(_) => "leave --format away to have the content recognised, or name another format",
            Self::LineTooLong(_) => "look whether the lines end as they should; a recording has a line for each time",
            Self::NotUtf8 => "save it as UTF-8",
            Self::Truncated(_) => "copy or record it again",
            Self::Unfinished => "copy or record it again, or accept what it holds with --allow-unfinished",
            Self::Bomb(_) => "unpack it yourself if it is what you expect, and give the unpacked file",
            Self::Damaged(_) => "copy or record it again, or name the format with --format",
            Self::Content { remedy, .. } => remedy,
        }
    }
}

/// Fails with a fault of the content.
pub(super) fn refuse<T, E: From<Fault>>(
    code: &'static str,
    problem: impl Into<String>,
    remedy: impl Into<String>,
) -> Result<T, E> {
    Err(Fault::coded(code, problem, remedy).into())
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

/// The first of some names that are not empty.
pub(super) fn list(names: &[String], shown: usize) -> String {
    let names: Vec<_> = names.iter().filter(|name| !name.is_empty()).map(|name| quoted(name)).collect();
    match names.len() {
        0 => "none".to_owned(),
        count if count > shown => format!("{} and {} more", names[..shown].join(", "), count - shown),
        _ => names.join(", "),
    }
}
