//! Tables in text: CSV with a header, and columns of plain numbers.

use std::str;

use csv_core::ReadRecordResult;
use nalgebra::Vector3;

use super::clock::{Probe, Stamp};
use super::error::{Fault, Place, ReadError};
use super::names::Names;
use super::order::{BATCH, Ordered, Row, Rows};
use super::source::{Lines, Source};
use super::table::{Body, Layout, Shape};
use super::{ColumnNames, Format, ReadOptions, Recording};

/// What stands between two fields.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Separator {
    /// One of this byte.
    Byte(u8),
    /// Any number of blanks and tabs.
    Blanks,
}

/// A table in text.
struct Table {
    source: Source,
    lines: Lines,
    separator: Separator,
    has_header: bool,
    header: Vec<String>,
    layout: Layout,
    names: Names,
    fields: Fields,
    /// Text and value of the last time.
    time: (Vec<u8>, Stamp),
    /// Vehicle of the last row.
    vehicle: usize,
}

/// Opens a table.
pub(super) fn open(source: &Source, format: Format, options: &ReadOptions) -> Result<Recording, ReadError> {
    let table = Table::open(source.clone(), format, &options.columns)?;
    let about = options.about(source, table.layout.unit, table.layout.notes(), Fault::HeaderOnly);
    Ok(Box::new(Ordered::open(table, about)?))
}

impl Table {
    /// Opens a table and reads its header.
    fn open(source: Source, format: Format, columns: &ColumnNames) -> Result<Self, ReadError> {
        let mut lines = Lines::new(&source)?;
        if !next_line(&mut lines, true)? {
            return Err(source.error(Fault::Empty));
        }
        if let Some(value) = decimal_comma(lines.line()) {
            let fault = Fault::DecimalComma { column: "1".to_owned(), value };
            return Err(source.error(fault).at(Place::Line(lines.number())));
        }
        let separator = separator(lines.line(), format);
        let mut fields = Fields::default();
        let place = Place::Line(lines.number());
        let at = |fault: Fault| source.error(fault).at(place.clone());
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
            Layout::of(&header, columns).map_err(at)?
        } else {
            let fault = || {
                let problem =
                    format!("it has {} numbers where time and three for each vehicle are expected", header.len());
                Fault::content(problem, "write t x y z x y z ..., a line for each time")
            };
            Layout::without_header(header.len()).ok_or_else(fault).map_err(at)?
        };
        if !has_header {
            header = (1..=header.len()).map(|number| number.to_string()).collect();
        }
        let names = match &layout.shape {
            Shape::Long { .. } => Names::default(),
            Shape::Wide { names, .. } => Names::from_list(names.clone()),
        };
        let mut table = Self {
            source,
            lines,
            separator,
            has_header,
            header,
            layout,
            names,
            fields,
            time: (Vec::new(), Stamp::Whole(0)),
            vehicle: 0,
        };
        if !has_header {
            table.rewind()?;
        }
        Ok(table)
    }

    fn at_line(&self, fault: Fault) -> ReadError {
        self.source.error(fault).at(Place::Line(self.lines.number()))
    }

    /// The number in a column; none where the cell is empty.
    #[inline]
    fn number(&self, column: usize) -> Result<Option<f64>, Fault> {
        let bytes = self.fields.bytes(self.lines.line(), column);
        match str::from_utf8(bytes).ok().and_then(|text| text.parse::<f64>().ok()) {
            Some(number) if number.is_finite() => Ok(Some(number)),
            _ => self.odd_number(column),
        }
    }

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

    /// The time of the current line.
    #[inline]
    fn stamp(&mut self) -> Result<Stamp, Fault> {
        let bytes = self.fields.bytes(self.lines.line(), self.layout.time);
        if bytes == self.time.0 && !bytes.is_empty() {
            return Ok(self.time.1);
        }
        let column = self.layout.time;
        let stamp = str::from_utf8(bytes).ok().and_then(|text| Stamp::parse(text.trim()));
        let stamp = match stamp {
            Some(stamp) if stamp.approximately().is_finite() => stamp,
            _ => match self.odd_number(column).map_err(Fault::of_time)? {
                Some(number) => Stamp::Real(number),
                None => return Err(Fault::EmptyCell { column: self.header[column].clone() }),
            },
        };
        self.time.0.clear();
        self.time.0.extend_from_slice(self.fields.bytes(self.lines.line(), column));
        self.time.1 = stamp;
        Ok(stamp)
    }

    /// The vehicle of the current line.
    #[inline]
    fn vehicle(&mut self, id: usize) -> Result<usize, Fault> {
        if let Some(next) = self.names.next_if(self.fields.bytes(self.lines.line(), id), self.vehicle) {
            self.vehicle = next;
            return Ok(next);
        }
        let name = self.fields.text(self.lines.line(), id)?.trim();
        if name.is_empty() {
            return Err(Fault::EmptyCell { column: self.header[id].clone() });
        }
        self.vehicle = self.names.index(name, self.vehicle);
        Ok(self.vehicle)
    }

    fn split(&mut self, limit: usize) -> Result<(), Fault> {
        self.fields.split(self.lines.line(), self.separator, limit)
    }

    /// The row of a vehicle on the current line; none where the vehicle was not seen.
    #[inline]
    fn row(&self, stamp: Stamp, vehicle: usize, body: &Body) -> Result<Option<Row>, Fault> {
        let Some(position) = self.vector(&body.position)? else { return Ok(None) };
        let velocity = body.velocity.as_ref().map(|columns| self.vector(columns)).transpose()?.flatten();
        let radius = body.radius.map(|column| self.number(column)).transpose()?.flatten();
        if let (Some(radius), Some(column)) = (radius.filter(|radius| *radius < 0.0), body.radius) {
            let problem = format!("column `{}` holds {radius}, a negative radius", self.header[column]);
            return Err(Fault::content(problem, "write 0 or more"));
        }
        Ok(Some(Row { stamp, place: self.lines.number(), vehicle, position, velocity, radius }))
    }

    /// Three numbers, none where all cells are empty.
    #[inline]
    fn vector(&self, columns: &[Option<usize>; 3]) -> Result<Option<Vector3<f64>>, Fault> {
        let mut vector = Vector3::zeros();
        let (mut filled, mut empty) = (false, None);
        for (axis, column) in columns.iter().enumerate() {
            let Some(column) = *column else { continue };
            match self.number(column)? {
                Some(number) => (vector[axis], filled) = (number, true),
                None => empty = empty.or(Some(column)),
            }
        }
        match empty {
            None => Ok(Some(vector)),
            Some(_) if !filled => Ok(None),
            Some(column) => Err(Fault::EmptyCell { column: self.header[column].clone() }),
        }
    }

    fn rows_of_line(&mut self, shape: &Shape, rows: &mut Vec<Row>) -> Result<(), Fault> {
        self.split(usize::MAX)?;
        let (expected, found) = (self.header.len(), self.fields.count());
        if expected != found {
            return Err(Fault::FieldCount { expected, found, commas: self.separator == Separator::Byte(b',') });
        }
        let stamp = self.stamp()?;
        match shape {
            Shape::Long { id, body } => {
                let vehicle = self.vehicle(*id)?;
                rows.extend(self.row(stamp, vehicle, body)?);
            }
            Shape::Wide { bodies, .. } => {
                for (vehicle, body) in bodies.iter().enumerate() {
                    rows.extend(self.row(stamp, vehicle, body)?);
                }
            }
        }
        Ok(())
    }
}

impl Rows for Table {
    fn next(&mut self, rows: &mut Vec<Row>) -> Result<bool, ReadError> {
        // Taken out for the time of the loop, so that the columns can be read while the table changes.
        let shape = std::mem::replace(&mut self.layout.shape, Shape::Wide { names: Vec::new(), bodies: Vec::new() });
        let before = rows.len();
        let mut done = Ok(());
        while done.is_ok() && rows.len() < before + BATCH {
            match next_line(&mut self.lines, !self.has_header) {
                Ok(true) => done = self.rows_of_line(&shape, rows).map_err(|fault| self.at_line(fault)),
                Ok(false) => break,
                Err(error) => done = Err(error),
            }
        }
        self.layout.shape = shape;
        done.map(|()| rows.len() > before)
    }

    fn rewind(&mut self) -> Result<(), ReadError> {
        self.lines = Lines::new(&self.source)?;
        if self.has_header {
            next_line(&mut self.lines, true)?;
        }
        self.time.0.clear();
        Ok(())
    }

    fn vehicles(&self) -> &[String] {
        self.names.all()
    }

    fn settle_names(&mut self) {
        self.names.settle();
    }

    fn place(&self, number: u64) -> Place {
        Place::Line(number)
    }

    fn is_wide(&self) -> bool {
        matches!(self.layout.shape, Shape::Wide { .. })
    }

    /// Only times and names are looked at, which is several times faster than reading everything.
    fn survey(&mut self) -> Result<Option<Probe>, ReadError> {
        let Shape::Long { id, .. } = self.layout.shape else { return Ok(None) };
        let last = id.max(self.layout.time);
        let mut probe: Option<Probe> = None;
        while next_line(&mut self.lines, !self.has_header)? {
            let row = self.split(last + 1).and_then(|()| {
                let found = self.fields.count();
                if found <= last {
                    return Err(Fault::FieldCount { expected: self.header.len(), found, commas: false });
                }
                let stamp = self.stamp()?;
                self.vehicle(id)?;
                Ok(stamp)
            });
            let stamp = row.map_err(|fault| self.at_line(fault))?;
            probe.get_or_insert_with(|| Probe::new(stamp)).see(stamp);
        }
        Ok(probe)
    }
}

/// Goes to the next line that is not blank, nor a comment where there may be `comments`: below a header the first field
/// may be a name that begins with `#`.
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
