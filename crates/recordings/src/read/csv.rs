//! Reads tables in text: CSV with a header, and columns of plain numbers.
//!
//! Lines are found and split here. The reader of the `csv` crate allocates whole lines without a limit, continues over
//! line ends after an open quote, and does not split at runs of blanks.

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::str;

use csv_core::ReadRecordResult;

use super::cells::Cells;
use super::clock::Stamp;
use super::error::{ContentKind, Fault, Place, ReadError, one_of, quoted, refuse};
use super::format::Format;
use super::layout::{Layout, VehicleColumns};
use super::options::{Dimensions, ReadOptions};
use super::order::Recording;
use super::source::{Lines, Source};
use super::time_unit::TimeUnit;
use super::{clock, heading, table};
use tautline_core::option::{DIMENSIONS, FORMAT};

/// Returns whether a line is CSV rather than numbers between blanks or brackets.
pub(super) fn has_separators(line: &[u8]) -> bool {
    let has = |byte| memchr::memchr(byte, line).is_some();
    let is_number = |bytes: &[u8]| str::from_utf8(bytes).is_ok_and(|text| text.parse::<f64>().is_ok());
    let begins_with_a_number = line.split(u8::is_ascii_whitespace).next().is_some_and(is_number);
    let has_tuples = begins_with_a_number && has(b'(');
    (has(b',') && !has_tuples) || has(b';') || (has(b'\t') && !begins_with_a_number)
}

/// Separator of fields.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Separator {
    /// One byte.
    Byte(u8),
    /// Any number of these bytes.
    Any(&'static [u8]),
}

const BLANKS: Separator = Separator::Any(b" \t");

/// Columns of a `TrajNet` table, which has no header.
const TRAJNET_COLUMNS: [&str; 4] = ["frame", "id", "x", "y"];

/// Separators of `t (x,y) (x,y)`.
const TUPLES: Separator = Separator::Any(b" \t(),");

/// Table in text.
#[expect(clippy::struct_excessive_bools, reason = "independent properties of the lines")]
pub(super) struct TextTable {
    source: Source,
    lines: Lines,
    separator: Separator,
    has_header: bool,
    /// Whether the row below the header holds units.
    has_units: bool,
    /// Numbers of the first line, in a table without a header.
    first: Vec<f64>,
    /// Whether the columns have names.
    named: bool,
    /// Whether lines that begin with `#` are comments: below a header the first field may be such a name.
    comments: bool,
    header: Vec<String>,
    fields: Fields,
    /// Number of fields to split; `None` splits and requires all.
    wanted: Option<usize>,
    /// Text and value of the last time.
    time: (Vec<u8>, Stamp),
}

/// Opens a table.
pub(super) fn open(source: &Source, format: Format, options: &ReadOptions) -> Result<Recording, ReadError> {
    let mut text = TextTable::open(source, format)?;
    if format == Format::TEXT && !text.named && options.dimensions.is_none() {
        match trajnet(source, text.separator)? {
            Some(true) => text = TextTable::open(source, Format::TRAJNET)?,
            Some(false) => {
                let problem = "each line may be a frame, a vehicle, x and y, or a time, x, y and z: the first two \
                               numbers are whole";
                let remedy =
                    format!("use {}, or {} for a time and a position", FORMAT.set("trajnet"), DIMENSIONS.set("3"));
                return refuse(ContentKind::AmbiguousLayout, problem, remedy);
            }
            None => {}
        }
    }
    let header_row = text.row();
    text.take_units()?;
    let (stem, first) = (source.stem(), &text.first);
    let numbers = || {
        let dimensions = options.dimensions.or(text.tuples());
        layout(first, &ReadOptions { dimensions, ..options.clone() }, &stem)
    };
    let layout = match Layout::of(&text.header, options, &stem) {
        _ if !text.named => numbers(),
        _ if options.dimensions.is_some() => {
            let remedy = format!("omit {DIMENSIONS}");
            refuse(ContentKind::ContradictsOption, "its header defines the numbers of a vehicle", remedy)
        }
        // A line above numbers may be a comment instead of a header.
        Err(fault) if !first.is_empty() => numbers().map_err(|_| fault),
        layout => layout,
    };
    let layout = layout.map_err(|fault| fault.at(Place::Line(header_row)))?;
    table::open(source, text, layout, None, 0, options)
}

impl TextTable {
    /// Opens a table and reads its header, or the first line of a table without one.
    pub(super) fn open(source: &Source, format: Format) -> Result<Self, ReadError> {
        let mut lines = Lines::new(source)?;
        // The last comment above the first line may be the header.
        let mut comment = Vec::new();
        while next_line(&mut lines, false)? && lines.line().starts_with(b"#") {
            let hashes = lines.line().iter().take_while(|&&byte| byte == b'#').count();
            comment = lines.line()[hashes..].trim_ascii().to_vec();
        }
        if lines.line().is_empty() {
            return Err(Fault::empty().into());
        }
        let mut text = Self {
            source: source.clone(),
            separator: separator(lines.line(), format),
            lines,
            has_header: true,
            has_units: false,
            first: Vec::new(),
            named: true,
            comments: false,
            header: Vec::new(),
            fields: Fields::default(),
            wanted: None,
            time: (Vec::new(), Stamp::Whole(0)),
        };
        text.read_header(format, &comment).map_err(|fault| text.fault(fault))?;
        Ok(text)
    }

    fn read_header(&mut self, format: Format, comment: &[u8]) -> Result<(), Fault> {
        let line = self.lines.line();
        if line.contains(&b'\r') {
            let remedy = "save it with the line ends of Unix or Windows";
            return refuse(
                ContentKind::LineEnds,
                "its lines end with carriage returns only, as on old Macintoshes",
                remedy,
            );
        }
        if let Some(value) = decimal_comma(line) {
            let problem = format!("column `1` holds {}, a number with a decimal comma", quoted(&value));
            return refuse(ContentKind::DecimalComma, problem, "write numbers with a decimal point");
        }
        self.header = names(line, self.separator)?;
        let numeric = self.header.iter().filter(|name| !name.is_empty()).all(|name| name.parse::<f64>().is_ok());
        self.has_header = !numeric;
        self.comments = numeric || format == Format::CRAZYFLIE;
        let named = |names: &[String]| names.iter().any(|name| heading::is_time(name) || heading::is_frame(name));
        let above = [self.separator, Separator::Byte(b','), BLANKS].map(|separator| names(comment, separator));
        let above = above.into_iter().filter_map(Result::ok);
        let above =
            above.filter(|_| !named(&self.header)).find(|names| names.len() == self.header.len() && named(names));
        if format == Format::TRAJNET && !(numeric && self.header.len() == TRAJNET_COLUMNS.len()) {
            let problem = format!("its first line has {} fields that are not all numbers", self.header.len());
            let remedy =
                format!("a TrajNet table has frame, vehicle, x and y in each line, and no header; omit {FORMAT}");
            return refuse(ContentKind::WrongFormat, problem, remedy);
        }
        if numeric {
            self.first = self.header.iter().map(|number| number.parse()).collect::<Result<_, _>>().unwrap_or_default();
        }
        if let Some(names) = above {
            (self.header, self.has_header, self.comments) = (names, false, true);
        } else if !numeric {
            self.header.pop_if(|name| name.is_empty());
        } else if format == Format::TRAJNET {
            self.header = TRAJNET_COLUMNS.map(str::to_owned).into();
            self.first.clear();
        } else if format == Format::TEXT {
            self.header = (1..=self.header.len()).map(|number| number.to_string()).collect();
            self.named = false;
        } else {
            let remedy = "add a header: t,id,x,y,z for one row per vehicle and time, or t,x1,y1,z1,x2,... for one \
                          row per time";
            return refuse(ContentKind::NoHeader, "the first line holds numbers, not column names", remedy);
        }
        Ok(())
    }

    /// Reads a row of units below the header, if there is one, into the column names.
    fn take_units(&mut self) -> Result<(), ReadError> {
        let found = clock::time_columns(&self.header, &ReadOptions::default()).ok().flatten();
        let Some((time, _)) = found.filter(|_| self.has_header) else { return Ok(()) };
        if !next_line(&mut self.lines, self.comments)? {
            return Ok(());
        }
        let Ok(cells) = names(self.lines.line(), self.separator) else { return Ok(()) };
        let units: Vec<_> = cells.iter().map(|cell| cell.trim_matches(['[', ']', '(', ')', ' '])).collect();
        let is_of_time = |unit: &&str| TimeUnit::from_name(&unit.to_lowercase()).is_some();
        let is_number = |unit: &&str| *unit != "1" && unit.parse::<f64>().is_ok();
        if !units.get(time).is_some_and(is_of_time) || units.iter().any(is_number) {
            return Ok(());
        }
        self.header = heading::with_units(&self.header, &units).map_err(|fault| self.fault(fault))?;
        self.has_units = true;
        Ok(())
    }

    /// Returns the dimensions of a table with bracketed tuples.
    fn tuples(&self) -> Option<Dimensions> {
        let (_, tuple) =
            str::from_utf8(self.lines.line()).ok().filter(|_| self.separator == TUPLES)?.split_once('(')?;
        match tuple.split(')').next()?.split(',').count() {
            2 => Some(Dimensions::Plane),
            3 => Some(Dimensions::Space),
            _ => None,
        }
    }

    /// Splits the current line into fields.
    #[inline]
    fn split(&mut self) -> Result<(), Fault> {
        let line = self.lines.line();
        self.fields.split(line, self.separator, self.wanted.unwrap_or(usize::MAX))?;
        let (expected, found) = (self.wanted.unwrap_or(self.header.len()), self.fields.ends.len());
        let too_many = self.wanted.is_none() && found > expected;
        // A separator after the last field does not start another one.
        if found < expected || (too_many && !(found == expected + 1 && self.fields.bytes(line, expected).is_empty())) {
            return Err(self.field_count(found));
        }
        Ok(())
    }

    #[cold]
    fn field_count(&self, found: usize) -> Fault {
        let expected = self.header.len();
        let remedy = if found > expected && self.separator == Separator::Byte(b',') {
            "every line needs one field per column; write decimals with points, not commas"
        } else {
            "every line needs one field per column; leave cells empty if a vehicle was not seen"
        };
        Fault::content(ContentKind::FieldCount, format!("it has {found} fields, expected {expected}"), remedy)
    }
}

impl Cells for TextTable {
    fn header(&self) -> &[String] {
        &self.header
    }

    fn restart(&mut self, columns: &[usize], all: bool) -> Result<(), ReadError> {
        self.wanted = columns.last().filter(|_| !all).map(|last| last + 1);
        self.lines = Lines::new(&self.source)?;
        if self.has_header {
            next_line(&mut self.lines, true)?;
        }
        if self.has_units {
            next_line(&mut self.lines, self.comments)?;
        }
        self.time.0.clear();
        Ok(())
    }

    #[inline]
    fn advance(&mut self) -> Result<bool, ReadError> {
        if !next_line(&mut self.lines, self.comments)? {
            return Ok(false);
        }
        self.split().map(|()| true).map_err(|fault| self.fault(fault))
    }

    #[inline]
    fn row(&self) -> u64 {
        self.lines.number()
    }

    fn place(&self, row: u64) -> Place {
        Place::Line(row)
    }

    #[inline]
    fn text(&self, column: usize) -> Result<Cow<'_, str>, Fault> {
        self.fields.text(self.lines.line(), column).map(Cow::Borrowed)
    }

    #[inline]
    fn number(&self, column: usize) -> Option<f64> {
        let bytes = self.fields.bytes(self.lines.line(), column);
        decimal(bytes).or_else(|| str::from_utf8(bytes).ok()?.parse().ok())
    }

    #[inline]
    fn has_name(&self, column: usize, name: &str) -> bool {
        self.fields.bytes(self.lines.line(), column) == name.as_bytes()
    }

    #[inline]
    fn stamp(&mut self, column: usize) -> Option<Stamp> {
        let bytes = self.fields.bytes(self.lines.line(), column);
        if bytes.is_empty() || bytes != self.time.0 {
            self.time.1 = Stamp::parse(str::from_utf8(bytes).ok()?.trim())?;
            self.time.0.clear();
            self.time.0.extend_from_slice(bytes);
        }
        Some(self.time.1)
    }
}

/// Advances to the next line that is not blank and, if `comments` is set, not a comment.
#[inline]
fn next_line(lines: &mut Lines, comments: bool) -> Result<bool, ReadError> {
    loop {
        if !lines.advance()? {
            return Ok(false);
        }
        match lines.line() {
            [b'0'..=b'9' | b'-', ..] => return Ok(true),
            line if (comments && line.starts_with(b"#")) || line.trim_ascii().is_empty() => {}
            _ => return Ok(true),
        }
    }
}

/// Returns whether a table without a header is certainly `TrajNet`: some successive lines have the same frame. `None`
/// unless each line has whole numbers for frame and vehicle, and two more numbers.
fn trajnet(source: &Source, separator: Separator) -> Result<Option<bool>, ReadError> {
    let mut lines = Lines::new(source)?;
    let (mut fields, mut frame, mut vehicles) = (Fields::default(), None, BTreeSet::new());
    let mut is_certain = false;
    while next_line(&mut lines, true)? {
        if fields.split(lines.line(), separator, usize::MAX).is_err() || fields.ends.len() != TRAJNET_COLUMNS.len() {
            return Ok(None);
        }
        let whole = |index| {
            let text = str::from_utf8(fields.bytes(lines.line(), index)).ok()?;
            Stamp::parse(text.trim())?.whole()
        };
        let (Some(of_frame), Some(vehicle)) = (whole(0), whole(1)) else { return Ok(None) };
        if frame.replace(of_frame) == Some(of_frame) {
            is_certain = true;
        } else {
            vehicles.clear();
        }
        if !vehicles.insert(vehicle) {
            return Ok(None);
        }
    }
    Ok(Some(is_certain))
}

/// Splits a line of names.
fn names(line: &[u8], separator: Separator) -> Result<Vec<String>, Fault> {
    let mut fields = Fields::default();
    fields.split(line, separator, usize::MAX)?;
    (0..fields.ends.len()).map(|index| Ok(fields.text(line, index)?.trim().to_owned())).collect()
}

/// Returns a number of at most 15 digits with a decimal point and without an exponent; `None` for any other text.
///
/// A double holds these digits and their power of ten exactly. Their quotient is therefore the nearest double, as from
/// [`str::parse`], which takes several times longer.
#[inline]
fn decimal(text: &[u8]) -> Option<f64> {
    const POWERS: [f64; 16] = [1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15];
    let unsigned = text.strip_prefix(b"-").unwrap_or(text);
    if !(2..=POWERS.len()).contains(&unsigned.len()) {
        return None;
    }
    let digits_of = |bytes: &[u8], mut digits: u64| {
        for (index, byte) in bytes.iter().enumerate() {
            match byte.wrapping_sub(b'0') {
                digit @ 0..=9 => digits = 10 * digits + u64::from(digit),
                _ => return (digits, Some(index)),
            }
        }
        (digits, None)
    };
    let (whole, end) = digits_of(unsigned, 0);
    let decimals = unsigned[end?..].strip_prefix(b".")?;
    let (digits, None) = digits_of(decimals, whole) else { return None };
    let number = digits as f64 / POWERS[decimals.len()];
    Some(if unsigned.len() < text.len() { -number } else { number })
}

/// Returns the most likely separator of a line.
fn separator(line: &[u8], format: Format) -> Separator {
    let count = |byte| memchr::memchr_iter(byte, line).count();
    let (comma, semicolon, tab) = (count(b','), count(b';'), count(b'\t'));
    if format == Format::TEXT && line.contains(&b'(') {
        TUPLES
    } else if (format == Format::TEXT || format == Format::TRAJNET) && comma == 0 && semicolon == 0 {
        BLANKS
    } else if semicolon > 0 && semicolon >= comma {
        Separator::Byte(b';')
    } else {
        Separator::Byte(if tab > comma { b'\t' } else { b',' })
    }
}

/// Returns the first number with a decimal comma in a line of numbers between blanks.
fn decimal_comma(line: &[u8]) -> Option<String> {
    let words: Vec<_> = str::from_utf8(line).ok()?.split_whitespace().collect();
    let number = |word: &&str| word.replacen(',', ".", 1).parse::<f64>().is_ok();
    let comma = words.iter().find(|word| word.contains(','))?;
    (words.len() > 1 && words.iter().all(number)).then(|| (*comma).to_owned())
}

/// Returns a mask of the bytes that equal `byte`: the highest bit of each is set. The first byte is the lowest of the
/// mask.
#[inline]
fn matches(bytes: [u8; 8], byte: u8) -> u64 {
    const LOW_BITS: u64 = 0x7f7f_7f7f_7f7f_7f7f;
    let zero_where_equal = u64::from_le_bytes(bytes) ^ u64::from_le_bytes([byte; 8]);
    !(((zero_where_equal & LOW_BITS) + LOW_BITS) | zero_where_equal | LOW_BITS)
}

/// Fields of a line.
#[derive(Debug, Default)]
struct Fields {
    /// Start and end of each field, in the line or in `unquoted`.
    ends: Vec<(usize, usize)>,
    /// The line without its quotes, if it has any.
    unquoted: Option<Vec<u8>>,
}

impl Fields {
    #[inline]
    fn bytes<'a>(&'a self, line: &'a [u8], index: usize) -> &'a [u8] {
        let (start, end) = self.ends[index];
        &self.unquoted.as_deref().unwrap_or(line)[start..end]
    }

    #[inline]
    fn text<'a>(&'a self, line: &'a [u8], index: usize) -> Result<&'a str, Fault> {
        str::from_utf8(self.bytes(line, index)).map_err(|_| Fault::not_utf8())
    }

    /// Splits a line into its first `limit` fields.
    #[inline]
    fn split(&mut self, line: &[u8], separator: Separator, limit: usize) -> Result<(), Fault> {
        self.ends.clear();
        self.unquoted = None;
        match separator {
            Separator::Byte(byte) => return self.split_at(line, byte, limit),
            Separator::Any(bytes) => {
                let mut start = 0;
                let ends = (0..line.len()).filter(|&index| bytes.contains(&line[index]));
                for end in ends.chain([line.len()]) {
                    if start < end {
                        self.ends.push((start, end));
                    }
                    start = end + 1;
                }
            }
        }
        Ok(())
    }

    /// Splits a line at a byte into its first `limit` fields.
    #[inline]
    fn split_at(&mut self, line: &[u8], separator: u8, limit: usize) -> Result<(), Fault> {
        let (mut start, mut from) = (0, 0);
        while from < line.len() {
            // Fields are a few bytes long: eight bytes at once are faster than a search for each separator.
            let bytes = line[from..].first_chunk().copied().unwrap_or_else(|| {
                let mut bytes = [0; 8];
                bytes.iter_mut().zip(&line[from..]).for_each(|(to, byte)| *to = *byte);
                bytes
            });
            let (separators, quotes) = (matches(bytes, separator), matches(bytes, b'"'));
            let mut left = separators;
            while left != 0 {
                let end = from + left.trailing_zeros() as usize / 8;
                // A quote before the end of the last field that is needed.
                if quotes & (left ^ (left - 1)) != 0 {
                    return self.split_quoted(line, separator);
                }
                self.ends.push((start, end));
                if self.ends.len() == limit {
                    return Ok(());
                }
                start = end + 1;
                left &= left - 1;
            }
            if quotes != 0 {
                return self.split_quoted(line, separator);
            }
            from += 8;
        }
        self.ends.push((start, line.len()));
        Ok(())
    }

    /// Splits a line with quotes.
    #[cold]
    fn split_quoted(&mut self, line: &[u8], separator: u8) -> Result<(), Fault> {
        let mut reader = csv_core::ReaderBuilder::new().delimiter(separator).build();
        let mut unquoted = vec![0; line.len() + 1];
        let mut ends = vec![0; line.len() + 2];
        let mut text = line.to_vec();
        text.push(b'\n');
        let (result, read, _, count) = reader.read_record(&text, &mut unquoted, &mut ends);
        if result != ReadRecordResult::Record || read < text.len() {
            let remedy = "close the quotes on the line where they begin";
            return refuse(ContentKind::UnclosedQuotes, "its quotes are not closed on the same line", remedy);
        }
        let starts = std::iter::once(0).chain(ends.iter().copied());
        self.ends.clear();
        self.ends.extend(starts.zip(ends.iter().copied()).take(count));
        self.unquoted = Some(unquoted);
        Ok(())
    }
}

/// Largest deviation of the norm of a unit quaternion from 1.
const NORM: f64 = 0.01;

/// Returns the columns of a vehicle whose x is in column `x`.
fn body(x: usize, dimensions: Dimensions) -> VehicleColumns {
    let (axes, count) = dimensions.counts();
    let from = |first: usize| [0, 1, 2].map(|axis| (axis < axes).then_some(first + axis));
    VehicleColumns { position: from(x), velocity: (count > axes).then(|| from(x + axes)), radius: None }
}

/// Returns the layout of a table without a header by its first row. The columns are time and the numbers of each
/// vehicle, or those of a TUM or KITTI table of the vehicle `alone`.
pub(super) fn layout(first: &[f64], options: &ReadOptions, alone: &str) -> Result<Layout, Fault> {
    let count = first.len();
    let fits = |dimensions: &Dimensions| count > 1 && (count - 1).is_multiple_of(dimensions.counts().1);
    let table = |time, names, bodies: Vec<VehicleColumns>, words: &str| {
        let note = format!("there is no header: the numbers are read as {words}");
        Layout {
            time,
            names,
            metres: vec![1.0; count],
            is_planar: bodies.iter().any(|body| body.position[2].is_none()),
            bodies,
            notes: vec![note],
            ..Layout::default()
        }
    };
    let one = |time, position: [usize; 3], words| {
        let body = VehicleColumns { position: position.map(Some), velocity: None, radius: None };
        table(time, vec![alone.to_owned()], vec![body], words)
    };
    if let &[_, _, _, _, x, y, z, w] = first
        && ((x * x + y * y + z * z + w * w).sqrt() - 1.0).abs() < NORM
    {
        return Ok(one(Some(0), [1, 2, 3], "time, position and attitude of one vehicle (TUM)"));
    }
    let known: Vec<_> = Dimensions::ALL.into_iter().filter(fits).collect();
    let dimensions = match (options.dimensions, &known[..]) {
        (Some(given), _) if fits(&given) => given,
        (None, &[only]) if count == 1 + only.counts().1 => only,
        (None, [_, ..]) => {
            let problem = format!("the number of columns per vehicle is ambiguous for {count} columns");
            let ways: Vec<_> = known.iter().map(|dimensions| dimensions.name()).collect();
            let remedy =
                format!("use {}: x and y, x, y and z, and +2 or +3 for their velocities", one_of(DIMENSIONS, &ways));
            return refuse(ContentKind::AmbiguousLayout, problem, remedy);
        }
        (None, []) if count == 12 => {
            if options.times_per_second.is_none() {
                return Err(Fault::frames("it has twelve numbers per line, as KITTI poses, and no time"));
            }
            return Ok(one(None, [3, 7, 11], "a pose of one vehicle in each line (KITTI)"));
        }
        (given, _) => {
            let each = given.map_or(3, |given| given.counts().1);
            let problem = format!("the line has {count} numbers, expected time and {each} for each vehicle");
            let remedy = format!("write t x y z x y z ..., one line per time, or set {DIMENSIONS}");
            return refuse(ContentKind::FieldCount, problem, remedy);
        }
    };
    let (axes, each) = dimensions.counts();
    let bodies: Vec<_> = (1..count).step_by(each).map(|x| body(x, dimensions)).collect();
    let names: Vec<_> = (1..=bodies.len()).map(|number| number.to_string()).collect();
    let words = format!(
        "time and {}{} of each of {} vehicles",
        if axes == 2 { "x, y (no height)" } else { "x, y, z" },
        if each > axes { " and velocity" } else { "" },
        names.len()
    );
    Ok(table(Some(0), names, bodies, &words))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::{Fields, Separator, decimal};

    #[test]
    fn short_decimals_are_read_and_other_texts_are_left() {
        for text in ["0.5", ".5", "5.", "-0.0", "-12.25", "000.001", "99999999999999.9", "0.00000000000001"] {
            let expected: f64 = text.parse().expect("a number");
            assert_eq!(decimal(text.as_bytes()).map(f64::to_bits), Some(expected.to_bits()), "{text}");
        }
        for text in
            ["", "-", ".", "-.", "5", "+0.5", "--0.5", "1.2.3", "1.5e3", " 0.5", "0.5 ", "nan", "0.1234567890123456"]
        {
            assert_eq!(decimal(text.as_bytes()), None, "{text}");
        }
    }

    proptest! {
        #[test]
        fn lines_are_split_as_at_single_bytes(line in "[a,;\u{ac}\u{1ac}]{0,40}", limit in 1..9_usize) {
            let mut fields = Fields::default();
            prop_assert!(fields.split(line.as_bytes(), Separator::Byte(b','), limit).is_ok());
            let expected: Vec<_> = line.split(',').take(limit).collect();
            let found = (0..fields.ends.len()).map(|at| fields.text(line.as_bytes(), at).expect("UTF-8"));
            prop_assert_eq!(found.collect::<Vec<_>>(), expected);
        }

        #[test]
        fn decimals_have_the_bits_of_the_standard_library(text in "-?[0-9]{0,8}[.]?[0-9]{0,9}[.e]?") {
            if let Some(number) = decimal(text.as_bytes()) {
                prop_assert_eq!(Ok(number.to_bits()), text.parse::<f64>().map(f64::to_bits), "{}", text);
            }
        }
    }
}
