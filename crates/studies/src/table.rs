//! A table with typed columns, written as text, CSV, LaTeX, Parquet and a part of a page.

use std::fs::File;
use std::sync::Arc;

use parquet::basic::{Compression, LogicalType, Repetition, Type as Physical};
use parquet::data_type::{BoolType, ByteArray, ByteArrayType, DataType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::Type;

use crate::statistics::{Estimate, Proportion};
use tautline_core::text::{aligned, at_least, at_most, fixed, separation, shortest, significant};
use tautline_report::report::page::{self, Markup, Render as _, Tone, noted, tinted};

/// Text for an unknown or inapplicable value.
const UNKNOWN: &str = "-";
/// Significant digits of a measured number.
const DIGITS: u8 = 4;

/// A table: its columns, and a cell of each column in every row.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// Caption.
    pub caption: String,
    columns: Vec<Column>,
    rows: Vec<Vec<Cell>>,
}

/// A column.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// Name in CSV and Parquet, without the unit; empty for a column that files omit.
    name: String,
    /// Heading in texts and pages, with the unit in brackets; empty for a column that they omit.
    heading: String,
    kind: Kind,
}

/// Type of the cells of a column, and their form in texts and pages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Words.
    Text,
    /// Yes or no.
    Flag,
    /// An integer that identifies something, such as a seed.
    Integer,
    /// A count of things, shown with separators.
    Count,
    /// A number that was set: all digits.
    Exact,
    /// A measured number: four significant digits.
    Measured,
    /// An estimate: four significant digits, and its interval.
    Estimate,
    /// A separation or another smallest number, rounded down.
    AtLeast,
    /// A probability in powers of ten.
    Rare,
    /// `count of total` with the interval of the share in per cent; the share alone if the unit of the column is %.
    Share,
    /// A share of one flight: yes or no.
    OneFlight,
}

/// A cell.
#[derive(Clone, Debug, PartialEq)]
pub enum Cell {
    /// Unknown, or not applicable.
    Empty,
    /// Words.
    Text(String),
    /// Yes or no.
    Flag(bool),
    /// An integer.
    Integer(i64),
    /// A number.
    Number(f64),
    /// A share with its interval.
    Share(Proportion),
    /// An estimate with its interval.
    Estimate(Estimate),
}

impl Column {
    /// Returns a column with its name in files and its heading in texts and pages; either may be empty. A heading of
    /// a unit alone, ` [m]`, gives a file the unit.
    #[must_use]
    pub fn new(name: &str, heading: &str, kind: Kind) -> Self {
        Self { name: name.to_owned(), heading: heading.to_owned(), kind }
    }

    /// Returns whether large shares of the column are good or bad.
    fn tone(&self) -> Option<Tone> {
        match &*self.name {
            "clear" | "reached" | "pass" | "held" => Some(Tone::Good),
            "violated" => Some(Tone::Bad),
            _ => None,
        }
    }

    /// Returns the heading without its unit, and the unit.
    fn title(&self) -> (&str, &str) {
        let parts = self.heading.strip_suffix(']').and_then(|heading| heading.rsplit_once(" ["));
        parts.unwrap_or((&self.heading, ""))
    }

    /// Returns the names of the columns of a file, each with its type: an estimate has three, a share four.
    fn fields(&self) -> Vec<(String, Kind)> {
        let name = &self.name;
        let unit = match self.title().1 {
            "" | "%" => String::new(),
            unit => format!("_{}", unit.replace('/', "_").replace('^', "")),
        };
        match self.kind {
            Kind::Share | Kind::OneFlight => ["count", "share", "low", "high"]
                .map(|part| (format!("{name}_{part}"), if part == "count" { Kind::Count } else { Kind::Exact }))
                .to_vec(),
            Kind::Estimate => ["", "_low", "_high"].map(|part| (format!("{name}{part}{unit}"), Kind::Exact)).to_vec(),
            kind => vec![(format!("{name}{unit}"), kind)],
        }
    }

    /// Returns the value and the interval of a cell for texts and pages.
    fn shown(&self, cell: &Cell) -> (String, Option<String>) {
        let plain = |text: String| (text, None);
        match cell {
            Cell::Empty => plain(UNKNOWN.to_owned()),
            Cell::Text(text) => plain(text.clone()),
            Cell::Flag(flag) => plain(if *flag { "yes" } else { "no" }.to_owned()),
            Cell::Integer(number) if self.kind == Kind::Count => plain(separated(number.unsigned_abs())),
            Cell::Integer(number) => plain(number.to_string()),
            Cell::Number(number) => plain(self.number(*number)),
            Cell::Estimate(Estimate { value, low, high }) => {
                let end = |end: &Option<f64>| end.map_or_else(|| UNKNOWN.to_owned(), |end| self.number(end));
                let interval = (low.is_some() || high.is_some()).then(|| format!("[{}, {}]", end(low), end(high)));
                (end(value), interval)
            }
            Cell::Share(share) => self.share(share),
        }
    }

    fn number(&self, number: f64) -> String {
        match self.kind {
            Kind::AtLeast => separation(number),
            Kind::Measured | Kind::Estimate if number == 0.0 => "0".to_owned(),
            Kind::Measured | Kind::Estimate => significant(number, DIGITS),
            Kind::Rare => format!("{number:.2e}"),
            _ => shortest(number),
        }
    }

    fn share(&self, share: &Proportion) -> (String, Option<String>) {
        let interval = (share.of > 0 && share.high > share.low).then(|| interval_of(share));
        match (share.share, self.title().1) {
            (None, _) => (UNKNOWN.to_owned(), None),
            (Some(value), "%") => {
                (fixed(100.0 * value, decimals(value).into()), interval.map(|interval| interval.replace(" %", "")))
            }
            (Some(_), _) if self.kind == Kind::OneFlight => {
                (if share.count == 1 { "yes" } else { "no" }.to_owned(), None)
            }
            (Some(_), _) => (format!("{} of {}", separated(share.count), separated(share.of)), interval),
        }
    }
}

impl Cell {
    /// Returns the cells of the columns of a file.
    fn scalars(&self, kind: Kind) -> Vec<Self> {
        match (kind, self) {
            (Kind::Share | Kind::OneFlight, Self::Share(Proportion { count, share, low, high, .. })) => {
                vec![(*count).into(), (*share).into(), (*low).into(), (*high).into()]
            }
            (Kind::Share | Kind::OneFlight, _) => vec![Self::Empty; 4],
            (Kind::Estimate, Self::Estimate(Estimate { value, low, high })) => {
                [value, low, high].map(|&x| x.into()).to_vec()
            }
            (Kind::Estimate, _) => vec![Self::Empty; 3],
            (_, cell) => vec![cell.clone()],
        }
    }

    /// Returns the text of a scalar in CSV: all digits, or an empty text for an unknown value.
    fn csv(&self) -> String {
        match self {
            Self::Text(text) => text.clone(),
            Self::Flag(flag) => flag.to_string(),
            Self::Integer(number) => number.to_string(),
            Self::Number(number) => format!("{number:?}"),
            Self::Empty | Self::Share(_) | Self::Estimate(_) => String::new(),
        }
    }
}

macro_rules! cell_from {
    ($($from:ty => |$value:ident| $cell:expr),* $(,)?) => {
        $(impl From<$from> for Cell { fn from($value: $from) -> Self { $cell } })*
    };
}

cell_from! {
    String => |value| Self::Text(value),
    &str => |value| Self::Text(value.to_owned()),
    bool => |value| Self::Flag(value),
    i64 => |value| Self::Integer(value),
    u64 => |value| Self::Integer(i64::try_from(value).unwrap_or(i64::MAX)),
    usize => |value| (value as u64).into(),
    f64 => |value| Self::Number(value),
    Proportion => |value| Self::Share(value),
    Estimate => |value| Self::Estimate(value),
}

impl<T: Into<Self>> From<Option<T>> for Cell {
    fn from(value: Option<T>) -> Self {
        value.map_or(Self::Empty, Into::into)
    }
}

/// Builder of a table, column by column.
pub struct Builder<'a, R> {
    of: &'a [R],
    table: Table,
}

impl<R> Builder<'_, R> {
    /// Adds a column: its name in files, its heading in texts and pages (either may be empty), and the cell of each
    /// row.
    #[must_use]
    pub fn column<C: Into<Cell>>(mut self, name: &str, heading: &str, kind: Kind, cell: impl Fn(&R) -> C) -> Self {
        self.table.columns.push(Column::new(name, heading, kind));
        for (row, item) in self.table.rows.iter_mut().zip(self.of) {
            row.push(cell(item).into());
        }
        self
    }

    /// Returns the table.
    #[must_use]
    pub fn build(self) -> Table {
        self.table
    }
}

/// Largest strength of the background of a share that misses its goal of 1.
const PARTIAL: f64 = 0.4;

impl Table {
    /// Returns a table with a row for each element.
    pub fn of<R>(caption: impl Into<String>, rows: &[R]) -> Builder<'_, R> {
        let table = Self { caption: caption.into(), columns: Vec::new(), rows: vec![Vec::new(); rows.len()] };
        Builder { of: rows, table }
    }

    /// Returns a table with the columns whose index `is_kept` accepts, under another caption.
    #[must_use]
    pub fn part(&self, caption: &str, is_kept: impl Fn(usize) -> bool) -> Self {
        fn kept<T: Clone>(list: &[T], is_kept: &impl Fn(usize) -> bool) -> Vec<T> {
            list.iter().enumerate().filter(|(place, _)| is_kept(*place)).map(|(_, one)| one.clone()).collect()
        }
        Self {
            caption: caption.to_owned(),
            columns: kept(&self.columns, &is_kept),
            rows: self.rows.iter().map(|row| kept(row, &is_kept)).collect(),
        }
    }

    /// Returns the columns with a heading, each with its cell in a row.
    fn shown<'a>(&'a self, row: &'a [Cell]) -> impl Iterator<Item = (&'a Column, &'a Cell)> + 'a {
        self.columns.iter().zip(row).filter(|(column, _)| !column.title().0.is_empty())
    }

    fn headings(&self) -> Vec<&Column> {
        self.columns.iter().filter(|column| !column.title().0.is_empty()).collect()
    }

    /// Returns the table for a terminal, intervals in brackets.
    #[must_use]
    pub fn text(&self) -> String {
        let cell = |(column, cell): (&Column, &Cell)| {
            let (value, interval) = column.shown(cell);
            interval.map_or_else(|| value.clone(), |interval| format!("{value} {interval}"))
        };
        let headings = self.headings().iter().map(|column| column.heading.clone()).collect();
        let rows = self.rows.iter().map(|row| self.shown(row).map(cell).collect());
        format!("{}:\n{}", self.caption, aligned(&std::iter::once(headings).chain(rows).collect::<Vec<_>>()))
    }

    /// Returns the table as CSV with a line of names: all digits, and an empty cell for an unknown value.
    ///
    /// # Errors
    /// None in practice: the table is written to memory.
    pub fn csv(&self) -> Result<Vec<u8>, csv::Error> {
        let mut out = csv::Writer::from_writer(Vec::new());
        let columns = || self.columns.iter().filter(|column| !column.name.is_empty());
        out.write_record(columns().flat_map(Column::fields).map(|(name, _)| name))?;
        for row in &self.rows {
            let named = self.columns.iter().zip(row).filter(|(column, _)| !column.name.is_empty());
            out.write_record(named.flat_map(|(column, cell)| cell.scalars(column.kind)).map(|cell| cell.csv()))?;
        }
        out.into_inner().map_err(|error| error.into_error().into())
    }

    /// Returns the table as a `tabular` of LaTeX, which needs no package. Units are below headings, intervals below
    /// values.
    #[must_use]
    pub fn latex(&self) -> String {
        let line = |cells: Vec<String>| format!("{} \\\\\n", cells.join(" & "));
        let titles: Vec<_> = self.headings().into_iter().map(Column::title).collect();
        let name = |(name, _): &(&str, &str)| match name.split_once(", ") {
            Some((first, second)) => format!("\\shortstack{{{}\\\\{}}}", escaped(first), escaped(second)),
            None => escaped(name),
        };
        let mut out = format!("\\begin{{tabular}}{{l{}}}\n\\hline\n", "r".repeat(titles.len().saturating_sub(1)));
        out += &line(titles.iter().map(name).collect());
        out += &line(titles.iter().map(|(_, unit)| escaped(unit)).collect());
        out += "\\hline\n";
        for row in &self.rows {
            let (values, intervals): (Vec<_>, Vec<_>) =
                self.shown(row).map(|(column, cell)| column.shown(cell)).unzip();
            out += &line(values.iter().map(|value| escaped(value)).collect());
            let small = |interval: Option<String>| {
                interval.map_or_else(String::new, |interval| format!("{{\\small {}}}", escaped(&interval)))
            };
            out += &line(intervals.into_iter().map(small).collect());
        }
        out + "\\hline\n\\end{tabular}\n"
    }

    /// Returns the table as a part of a page, intervals in small print.
    #[must_use]
    pub fn html(&self) -> Markup {
        let headings: Vec<_> = self.headings().iter().map(|column| column.heading.as_str()).collect();
        let cell = |(column, cell): (&Column, &Cell)| {
            let (value, interval) = column.shown(cell);
            let shown = interval.map_or_else(|| value.render(), |interval| noted(&value, &interval));
            match (cell, column.tone()) {
                (Cell::Share(share), Some(Tone::Good)) if column.kind == Kind::OneFlight && share.count == 0 => {
                    tinted(&shown, Tone::Bad, share.of as f64)
                }
                (Cell::Share(share), Some(Tone::Good)) if share.count < share.of => {
                    tinted(&shown, Tone::Good, PARTIAL * share.share.unwrap_or(0.0))
                }
                (Cell::Share(share), Some(tone)) => tinted(&shown, tone, share.share.unwrap_or(0.0)),
                _ => shown,
            }
        };
        let rows = self.rows.iter().map(|row| self.shown(row).map(cell).collect::<Vec<_>>());
        if self.headings().iter().all(|column| column.kind == Kind::Text) {
            page::words(&self.caption, &headings, rows)
        } else {
            page::numbers(&self.caption, &headings, rows)
        }
    }
}

/// Returns the interval of a share in per cent, rounded outwards.
pub(crate) fn interval_of(share: &Proportion) -> String {
    let low = at_least(100.0 * share.low, decimals(share.low));
    format!("[{low} %, {}]", percent_at_most(share.high))
}

/// Returns a share in per cent, rounded up.
pub(crate) fn percent_at_most(share: f64) -> String {
    format!("{} %", at_most(100.0 * share, decimals(share)))
}

/// Returns the decimals that show two digits of a share in per cent, at most 8.
fn decimals(share: f64) -> u8 {
    let from_the_nearer_end = (100.0 * share).min(100.0 * (1.0 - share));
    if from_the_nearer_end <= 0.0 {
        return 0;
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between 0 and 8")]
    let decimals = (1.0 - from_the_nearer_end.log10().floor()).clamp(0.0, 8.0) as u8;
    decimals
}

/// Returns an integer with separators: `1,234,567`.
pub(crate) fn separated(number: u64) -> String {
    let digits = number.to_string();
    let first = digits.len() % 3;
    digits.chars().enumerate().fold(String::new(), |mut text, (k, digit)| {
        if k > 0 && k % 3 == first {
            text.push(',');
        }
        text.push(digit);
        text
    })
}

/// Returns a text that LaTeX prints unchanged.
fn escaped(text: &str) -> String {
    let escape = |c: char| match c {
        '\\' => "\\textbackslash{}".to_owned(),
        '~' => "\\textasciitilde{}".to_owned(),
        '^' => "\\textasciicircum{}".to_owned(),
        '&' | '%' | '$' | '#' | '_' | '{' | '}' => format!("\\{c}"),
        other => other.to_string(),
    };
    text.split("^2").map(|part| part.chars().map(escape).collect::<String>()).collect::<Vec<_>>().join("$^2$")
}

/// Writer of a table in Parquet, one group of rows at a time. Columns are scalars.
pub struct ParquetTable {
    writer: SerializedFileWriter<File>,
    columns: Vec<Column>,
}

impl ParquetTable {
    /// Begins a table with these columns and an entry of metadata.
    ///
    /// # Errors
    /// [`ParquetError`] where the file cannot be written.
    pub fn create(columns: Vec<Column>, [key, value]: [&str; 2], file: File) -> Result<Self, ParquetError> {
        let field = |(name, kind): (String, Kind)| {
            let (physical, logical) = match kind {
                Kind::Text => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
                Kind::Flag => (Physical::BOOLEAN, None),
                Kind::Integer | Kind::Count => (Physical::INT64, None),
                _ => (Physical::DOUBLE, None),
            };
            let field = Type::primitive_type_builder(&name, physical).with_repetition(Repetition::OPTIONAL);
            field.with_logical_type(logical).build().map(Arc::new)
        };
        let fields = columns.iter().flat_map(Column::fields).map(field).collect::<Result<_, _>>()?;
        let schema = Type::group_type_builder("flights").with_fields(fields).build()?;
        let properties = WriterProperties::builder()
            .set_compression(Compression::SNAPPY)
            .set_created_by(format!("{} {}", tautline_core::PROGRAM, tautline_core::VERSION))
            .set_key_value_metadata(Some(vec![KeyValue::new(key.to_owned(), value.to_owned())]));
        let writer = SerializedFileWriter::new(file, Arc::new(schema), Arc::new(properties.build()))?;
        Ok(Self { writer, columns })
    }

    /// Writes a group of rows, each with a cell of every column.
    ///
    /// # Errors
    /// [`ParquetError`] where the file cannot be written.
    pub fn write(&mut self, rows: &[Vec<Cell>]) -> Result<(), ParquetError> {
        let mut group = self.writer.next_row_group()?;
        for (place, column) in self.columns.iter().enumerate() {
            let cells = rows.iter().map(|row| row.get(place).unwrap_or(&Cell::Empty));
            match column.kind {
                Kind::Text => write_column::<ByteArrayType>(&mut group, cells, |cell| match cell {
                    Cell::Text(text) => Some(ByteArray::from(text.as_bytes().to_vec())),
                    _ => None,
                })?,
                Kind::Flag => write_column::<BoolType>(&mut group, cells, |cell| match cell {
                    Cell::Flag(flag) => Some(*flag),
                    _ => None,
                })?,
                Kind::Integer | Kind::Count => write_column::<Int64Type>(&mut group, cells, |cell| match cell {
                    Cell::Integer(number) => Some(*number),
                    _ => None,
                })?,
                _ => write_column::<DoubleType>(&mut group, cells, |cell| match cell {
                    Cell::Number(number) => Some(*number).filter(|number| number.is_finite()),
                    _ => None,
                })?,
            }
        }
        group.close().map(drop)
    }

    /// Ends the table.
    ///
    /// # Errors
    /// [`ParquetError`] where the file cannot be written.
    pub fn close(self) -> Result<(), ParquetError> {
        self.writer.close().map(drop)
    }
}

fn write_column<'a, D: DataType>(
    group: &mut SerializedRowGroupWriter<'_, File>,
    cells: impl Iterator<Item = &'a Cell>,
    value: impl Fn(&Cell) -> Option<D::T>,
) -> Result<(), ParquetError> {
    let Some(mut column) = group.next_column()? else {
        return Err(ParquetError::General("the schema has too few columns".to_owned()));
    };
    let cells: Vec<_> = cells.map(value).collect();
    let levels: Vec<i16> = cells.iter().map(|cell| i16::from(cell.is_some())).collect();
    let values: Vec<_> = cells.into_iter().flatten().collect();
    column.typed::<D>().write_batch(&values, Some(&levels), None)?;
    column.close()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> Table {
        let estimate = |value: f64| Estimate { value: Some(value), low: None, high: Some(2.0 * value) };
        Table::of("Laws", &[("a_b", 0_u64, Some(1.5)), ("c", 3, None)])
            .column("law", "Law", Kind::Text, |row| row.0)
            .column("seed", "", Kind::Integer, |row| row.1)
            .column("clear", "Proved clear [%]", Kind::Share, |row| Proportion::new(row.1, 3))
            .column("control_mean", "Control, mean [m/s^2]", Kind::Estimate, move |row| row.2.map(estimate))
            .column("", "Smallest [m]", Kind::AtLeast, |row| row.2)
            .build()
    }

    #[test]
    fn one_table_is_text_csv_latex_and_a_part_of_a_page() {
        let table = table();
        let text = table.text();
        let lines: Vec<_> = text.lines().collect();
        assert_eq!(lines[0], "Laws:");
        assert_eq!(lines[1], "Law  Proved clear [%]  Control, mean [m/s^2]  Smallest [m]");
        assert_eq!(lines[2], "a_b  0 [0, 71]         1.500 [-, 3.000]       1.500");
        assert_eq!(lines[3], "c    100 [29, 100]     -                      -");
        let csv = String::from_utf8(table.csv().expect("csv")).expect("text");
        let lines: Vec<_> = csv.lines().collect();
        assert_eq!(
            lines[0],
            "law,seed,clear_count,clear_share,clear_low,clear_high,\
             control_mean_m_s2,control_mean_low_m_s2,control_mean_high_m_s2"
        );
        assert!(lines[1].starts_with("a_b,0,0,0.0,0.0,0.70") && lines[1].ends_with(",1.5,,3.0"), "{csv}");
        assert!(lines[2].ends_with(",1.0,,,"), "{csv}");
        let latex = table.latex();
        assert!(
            latex.contains("\\begin{tabular}{lrrr}") && latex.contains("a\\_b & 0 & 1.500 & 1.500 \\\\"),
            "{latex}"
        );
        assert!(latex.contains(" & \\% & m/s$^2$ & m \\\\"), "{latex}");
        assert!(latex.contains("\\shortstack{Control\\\\mean}") && latex.contains("{\\small [0, 71]}"), "{latex}");
        let html = table.html().into_string();
        assert!(html.contains("<small>[0, 71]</small>") && html.contains("Smallest [m]") && !html.contains("seed"));
    }

    #[test]
    fn integers_are_grouped_and_intervals_are_rounded_outwards() {
        assert_eq!([0, 7, 1000, 10_000, 1_234_567].map(separated), ["0", "7", "1,000", "10,000", "1,234,567"]);
        let column = Column::new("x", "X", Kind::Share);
        assert_eq!(column.shown(&Cell::Share(Proportion::new(0, 10_000))).0, "0 of 10,000");
        let interval = |low: f64, high: f64| interval_of(&Proportion { low, high, ..Proportion::new(1, 2) });
        assert_eq!(interval(0.0, 0.000_368_9), "[0 %, 0.037 %]");
        assert_eq!(interval(0.123_9, 0.123_1), "[12 %, 13 %]");
        assert!(column.shown(&Cell::Share(Proportion::new(1, 1))).1.is_some(), "one flight of several has an interval");
        let flight = Column::new("x", "X", Kind::OneFlight);
        assert_eq!(flight.shown(&Cell::Share(Proportion::new(1, 1))), ("yes".to_owned(), None));
        assert_eq!(column.shown(&Cell::Share(Proportion::new(0, 0))), ("-".to_owned(), None));
        let percent = Column::new("x", "X [%]", Kind::Share);
        assert_eq!(percent.shown(&Cell::Share(Proportion::new(99_987, 100_000))).0, "99.987");
    }

    #[test]
    fn latex_shows_special_characters_as_they_are() {
        assert_eq!(escaped("m/s^2 50 % a_b {x} #1"), "m/s$^2$ 50 \\% a\\_b \\{x\\} \\#1");
        assert_eq!(escaped("a\\b^~"), "a\\textbackslash{}b\\textasciicircum{}\\textasciitilde{}");
    }
}
