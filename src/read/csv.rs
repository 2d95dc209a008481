//! Tables in text: CSV with a header, and columns of plain numbers.
//!
//! Lines are found and split here: the reader of `csv` takes as much memory as a line is long, without a limit, reads on
//! over the end of a line where a quote is left open, and knows no fields between any number of blanks.

use std::str;

use csv_core::ReadRecordResult;

use super::clock::Stamp;
use super::error::{Fault, FaultAt, Place};
use super::format::Format;
use super::layout::Layout;
use super::names::Names;
use super::options::ReadOptions;
use super::order::Recording;
use super::source::{Lines, Source};
use super::table::{self, Cells};

/// What stands between two fields.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Separator {
    /// One of this byte.
    Byte(u8),
    /// Any number of blanks and tabs.
    Blanks,
}

/// A table in text.
struct Text {
    source: Source,
    lines: Lines,
    separator: Separator,
    has_header: bool,
    header: Vec<String>,
    fields: Fields,
    /// Fields that are looked at; all have to be there where no number says how many.
    wanted: Option<usize>,
    /// Text and value of the last time.
    time: (Vec<u8>, Stamp),
}

/// Opens a table.
pub(super) fn open(source: &Source, format: Format, options: &ReadOptions) -> Result<Recording, FaultAt> {
    let mut lines = Lines::new(source)?;
    if !next_line(&mut lines, true)? {
        return Err(Fault::Empty.into());
    }
    let place = Place::Line(lines.number());
    let at = |fault: Fault| fault.at(place.clone());
    if let Some(value) = decimal_comma(lines.line()) {
        return Err(at(Fault::DecimalComma { column: "1".to_owned(), value }));
    }
    let separator = separator(lines.line(), format);
    let mut fields = Fields::default();
    fields.split(lines.line(), separator, usize::MAX).map_err(at)?;
    let mut header = Vec::new();
    for index in 0..fields.count() {
        header.push(fields.text(lines.line(), index).map_err(at)?.trim().to_owned());
    }
    let numeric = header.iter().filter(|name| !name.is_empty()).all(|name| name.parse::<f64>().is_ok());
    let has_header = !(numeric && format == Format::Text);
    let layout = if has_header {
        if numeric {
            return Err(at(Fault::NoHeader));
        }
        Layout::of(&header, &options.columns).map_err(at)?
    } else {
        let count = header.len();
        header = (1..=count).map(|number| number.to_string()).collect();
        let fault = || {
            let problem = format!("it has {count} numbers where time and three for each vehicle are expected");
            at(Fault::content(problem, "write t x y z x y z ..., a line for each time"))
        };
        Layout::without_header(count).ok_or_else(fault)?
    };
    let time = (Vec::new(), Stamp::Whole(0));
    let text = Text { source: source.clone(), lines, separator, has_header, header, fields, wanted: None, time };
    table::open(source, text, layout, None, 0, options)
}

impl Text {
    /// The number in a cell that is not a plain finite number.
    #[cold]
    fn odd_number(&self, column: usize) -> Result<Option<f64>, Fault> {
        let text = self.fields.text(self.lines.line(), column)?.trim();
        if text.is_empty() {
            return Ok(None);
        }
        let (value, column) = (text.to_owned(), self.header[column].clone());
        match text.parse::<f64>() {
            Ok(number) if number.is_finite() => Ok(Some(number)),
            Ok(_) => Err(Fault::NotFinite { column, value }),
            Err(_) if text.replacen(',', ".", 1).parse::<f64>().is_ok() => Err(Fault::DecimalComma { column, value }),
            Err(_) => Err(Fault::NotANumber { column, value }),
        }
    }

    /// Splits the current line.
    #[inline]
    fn split(&mut self) -> Result<(), Fault> {
        self.fields.split(self.lines.line(), self.separator, self.wanted.unwrap_or(usize::MAX))?;
        let (expected, found) = (self.header.len(), self.fields.count());
        match self.wanted {
            None if found != expected => {
                Err(Fault::FieldCount { expected, found, commas: self.separator == Separator::Byte(b',') })
            }
            Some(wanted) if found < wanted => Err(Fault::FieldCount { expected, found, commas: false }),
            _ => Ok(()),
        }
    }
}

impl Cells for Text {
    fn header(&self) -> &[String] {
        &self.header
    }

    fn restart(&mut self, columns: &[usize], all: bool) -> Result<(), FaultAt> {
        self.wanted = columns.last().filter(|_| !all).map(|last| last + 1);
        self.lines = Lines::new(&self.source)?;
        if self.has_header {
            next_line(&mut self.lines, true)?;
        }
        self.time.0.clear();
        Ok(())
    }

    #[inline]
    fn advance(&mut self) -> Result<bool, FaultAt> {
        if !next_line(&mut self.lines, !self.has_header)? {
            return Ok(false);
        }
        self.split().map(|()| true).map_err(|fault| fault.at(Self::place(self.row())))
    }

    #[inline]
    fn row(&self) -> u64 {
        self.lines.number()
    }

    fn place(row: u64) -> Place {
        Place::Line(row)
    }

    #[inline]
    fn number(&self, column: usize) -> Result<Option<f64>, Fault> {
        let bytes = self.fields.bytes(self.lines.line(), column);
        match str::from_utf8(bytes).ok().and_then(|text| text.parse::<f64>().ok()) {
            Some(number) if number.is_finite() => Ok(Some(number)),
            _ => self.odd_number(column),
        }
    }

    #[inline]
    fn stamp(&mut self, column: usize) -> Result<Option<Stamp>, Fault> {
        let bytes = self.fields.bytes(self.lines.line(), column);
        if bytes == self.time.0 && !bytes.is_empty() {
            return Ok(Some(self.time.1));
        }
        let stamp = str::from_utf8(bytes).ok().and_then(|text| Stamp::parse(text.trim()));
        let stamp = match stamp {
            Some(stamp) if stamp.approximately().is_finite() => stamp,
            _ => match self.odd_number(column)? {
                Some(number) => Stamp::Real(number),
                None => return Ok(None),
            },
        };
        self.time.0.clear();
        self.time.0.extend_from_slice(bytes);
        self.time.1 = stamp;
        Ok(Some(stamp))
    }

    #[inline]
    fn vehicle(&self, column: usize, names: &mut Names, before: usize) -> Result<Option<usize>, Fault> {
        if let Some(next) = names.next_if(self.fields.bytes(self.lines.line(), column), before) {
            return Ok(Some(next));
        }
        let name = self.fields.text(self.lines.line(), column)?.trim();
        Ok((!name.is_empty()).then(|| names.index(name, before)))
    }
}

/// Goes to the next line that is not blank, nor a comment where there may be `comments`: below a header the first field
/// may be a name that begins with `#`.
#[inline]
fn next_line(lines: &mut Lines, comments: bool) -> Result<bool, FaultAt> {
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

/// The separator that a line most likely uses.
fn separator(line: &[u8], format: Format) -> Separator {
    let count = |byte| memchr::memchr_iter(byte, line).count();
    let (comma, semicolon, tab) = (count(b','), count(b';'), count(b'\t'));
    match format {
        Format::Text if comma == 0 && semicolon == 0 => Separator::Blanks,
        _ if semicolon > 0 && semicolon >= comma => Separator::Byte(b';'),
        _ if tab > comma => Separator::Byte(b'\t'),
        _ => Separator::Byte(b','),
    }
}

/// The first of some numbers between blanks, where one of them has a decimal comma and so none a comma behind it.
fn decimal_comma(line: &[u8]) -> Option<String> {
    let words: Vec<_> = str::from_utf8(line).ok()?.split_whitespace().collect();
    let number = |word: &&str| word.replacen(',', ".", 1).parse::<f64>().is_ok();
    let comma = words.iter().find(|word| word.contains(','))?;
    (words.len() > 1 && words.iter().all(number)).then(|| (*comma).to_owned())
}

/// The fields of a line.
#[derive(Debug, Default)]
struct Fields {
    /// Begin and end of each field, in the line or in `unquoted`.
    ends: Vec<(usize, usize)>,
    /// The line without its quotes, where it has some.
    unquoted: Option<Vec<u8>>,
}

impl Fields {
    fn count(&self) -> usize {
        self.ends.len()
    }

    #[inline]
    fn bytes<'a>(&'a self, line: &'a [u8], index: usize) -> &'a [u8] {
        let (start, end) = self.ends[index];
        &self.unquoted.as_deref().unwrap_or(line)[start..end]
    }

    #[inline]
    fn text<'a>(&'a self, line: &'a [u8], index: usize) -> Result<&'a str, Fault> {
        str::from_utf8(self.bytes(line, index)).map_err(|_| Fault::NotUtf8)
    }

    /// Splits a line into fields, the first `limit` of them.
    #[inline]
    fn split(&mut self, line: &[u8], separator: Separator, limit: usize) -> Result<(), Fault> {
        self.ends.clear();
        self.unquoted = None;
        match separator {
            Separator::Byte(byte) => {
                let mut start = 0;
                // Fields are a few bytes long: looking at each byte is faster than searching.
                for (end, &found) in line.iter().enumerate() {
                    if found == byte {
                        self.ends.push((start, end));
                        if self.ends.len() == limit {
                            return Ok(());
                        }
                        start = end + 1;
                    } else if found == b'"' {
                        return self.split_quoted(line, byte);
                    }
                }
                self.ends.push((start, line.len()));
            }
            Separator::Blanks => {
                let mut start = 0;
                for end in memchr::memchr2_iter(b' ', b'\t', line).chain([line.len()]) {
                    if start < end {
                        self.ends.push((start, end));
                    }
                    start = end + 1;
                }
            }
        }
        Ok(())
    }

    /// Splits a line that has quotes.
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
            return Err(Fault::content("its quotes are not closed on the same line", remedy));
        }
        let starts = std::iter::once(0).chain(ends.iter().copied());
        self.ends.clear();
        self.ends.extend(starts.zip(ends.iter().copied()).take(count));
        self.unquoted = Some(unquoted);
        Ok(())
    }
}
