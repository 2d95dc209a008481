//! Tables in Parquet, with the same columns as in CSV.
//!
//! Columns are flat: numbers, text or whole numbers for the vehicle, and for time numbers or time stamps, whose unit is
//! then known. What time counts from may stand under `epoch_ns` in the metadata of the file.

use std::cell::Cell;
use std::fs::File;
use std::panic::{AssertUnwindSafe, catch_unwind};

use parquet::basic::{Compression, ConvertedType, LogicalType, TimeUnit as ParquetUnit};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::{ByteArray, DataType};
use parquet::errors::ParquetError;
use parquet::file::reader::{FileReader as _, SerializedFileReader};
use parquet::schema::types::ColumnDescriptor;

use super::clock::Stamp;
use super::error::{Fault, FaultAt, Place};
use super::layout::Layout;
use super::names::Names;
use super::order::BATCH;
use super::source::Source;
use super::table::{self, Cells};
use super::{ReadOptions, Recording, TimeUnit};

/// Key of the metadata that says what time counts from \[ns\].
pub(crate) const EPOCH_KEY: &str = "epoch_ns";

/// Opens a table.
pub(super) fn open(source: &Source, options: &ReadOptions) -> Result<Recording, FaultAt> {
    let file = File::open(&source.path)?;
    if file.metadata()?.len() < 12 {
        return Err(Fault::Truncated { what: "the end of the file is missing".to_owned() }.into());
    }
    let reader = guarded(|| SerializedFileReader::new(file))?;
    let metadata = reader.metadata().file_metadata();
    let schema = metadata.schema_descr();
    let header: Vec<String> = schema.columns().iter().map(|column| column.path().string()).collect();
    let layout = Layout::of(&header, &options.columns)?;
    let unit = unit_of(&schema.column(layout.time));
    for &column in &layout.columns() {
        let descriptor = schema.column(column);
        if descriptor.max_rep_level() > 0 {
            let problem = format!("column `{}` holds lists", header[column]);
            return Err(Fault::content(problem, "save a number in each cell").into());
        }
        if let Some(what) = other_than_numbers(&descriptor) {
            let problem = format!("column `{}` holds {what}", header[column]);
            let remedy = "save numbers as double, and time as double, int64 or time stamps";
            return Err(Fault::content(problem, remedy).into());
        }
        if let Some(packed) = packed_otherwise(&reader, column) {
            let problem = format!("column `{}` is packed by {packed}, which is not read", header[column]);
            return Err(Fault::content(problem, "save it plain, or packed by snappy, gzip, lz4 or zstd").into());
        }
    }
    let epoch_ns = metadata.key_value_metadata().into_iter().flatten().find(|pair| pair.key == EPOCH_KEY);
    let epoch_ns = epoch_ns.and_then(|pair| pair.value.as_deref()).and_then(|value| value.parse().ok());
    let groups = Groups {
        reader,
        header,
        wanted: Vec::new(),
        group: 0,
        columns: Vec::new(),
        rows_left: 0,
        count: 0,
        at: 0,
        rows_before: 0,
    };
    table::open(source, groups, layout, unit, epoch_ns.unwrap_or(0), options)
}

thread_local! {
    static GUARDED: Cell<bool> = const { Cell::new(false) };
}

/// Whether this thread is in a call whose panic becomes an error: a panic hook has nothing to say about it.
#[must_use]
pub fn is_guarded() -> bool {
    GUARDED.get()
}

/// Calls into the library, which panics on some damaged files.
fn guarded<T>(call: impl FnOnce() -> Result<T, ParquetError>) -> Result<T, Fault> {
    GUARDED.set(true);
    let outcome = catch_unwind(AssertUnwindSafe(call));
    GUARDED.set(false);
    match outcome {
        Ok(Ok(value)) => Ok(value),
        Ok(Err(ParquetError::EOF(what))) => Err(Fault::Truncated { what }),
        Ok(Err(error)) if error.to_string().contains("Invalid Parquet file") => Err(Fault::Truncated {
            what: "the end of the file, where its columns are described, is missing".to_owned(),
        }),
        Ok(Err(error)) => Err(Fault::damaged(error)),
        Err(_) => Err(Fault::damaged("its pages contradict each other")),
    }
}

/// The unit of a column of time stamps.
fn unit_of(column: &ColumnDescriptor) -> Option<TimeUnit> {
    match (column.logical_type_ref(), column.converted_type()) {
        (Some(LogicalType::Timestamp(stamp)), _) => Some(match stamp.unit {
            ParquetUnit::MILLIS => TimeUnit::Milliseconds,
            ParquetUnit::MICROS => TimeUnit::Microseconds,
            ParquetUnit::NANOS => TimeUnit::Nanoseconds,
        }),
        (_, ConvertedType::TIMESTAMP_MILLIS) => Some(TimeUnit::Milliseconds),
        (_, ConvertedType::TIMESTAMP_MICROS) => Some(TimeUnit::Microseconds),
        _ => None,
    }
}

/// What the cells of a column are, where reading them as numbers or text would change their meaning.
fn other_than_numbers(column: &ColumnDescriptor) -> Option<&'static str> {
    match (column.logical_type_ref(), column.converted_type()) {
        (Some(LogicalType::Decimal(_)), _) | (_, ConvertedType::DECIMAL) => Some("decimals"),
        (Some(LogicalType::Date), _) | (_, ConvertedType::DATE) => Some("dates"),
        (Some(LogicalType::Time(_)), _) | (_, ConvertedType::TIME_MILLIS | ConvertedType::TIME_MICROS) => {
            Some("times of day")
        }
        _ => None,
    }
}

/// The codec of a column that is packed by one that is not read.
fn packed_otherwise(reader: &SerializedFileReader<File>, column: usize) -> Option<&'static str> {
    let mut columns = reader.metadata().row_groups().iter().filter_map(|group| group.columns().get(column));
    columns.find_map(|column| match column.compression() {
        Compression::BROTLI(_) => Some("brotli"),
        Compression::LZO => Some("lzo"),
        _ => None,
    })
}

/// Whether the whole numbers of a column have no sign.
fn is_unsigned(column: &ColumnDescriptor) -> bool {
    use ConvertedType as Converted;
    match column.logical_type_ref() {
        Some(LogicalType::Integer(integer)) => !integer.is_signed,
        _ => matches!(
            column.converted_type(),
            Converted::UINT_8 | Converted::UINT_16 | Converted::UINT_32 | Converted::UINT_64
        ),
    }
}

/// Some cells of a column; none where a cell is null.
enum Batch {
    /// Wide enough for all of 64 bits, with and without a sign.
    Whole(Vec<Option<i128>>),
    Real(Vec<Option<f64>>),
    Text(Vec<Option<ByteArray>>),
}

impl Batch {
    fn len(&self) -> usize {
        match self {
            Self::Whole(cells) => cells.len(),
            Self::Real(cells) => cells.len(),
            Self::Text(cells) => cells.len(),
        }
    }

    /// The next cells of the column of this name.
    fn read(column: &mut Column, name: &str, count: usize) -> Result<Self, Fault> {
        let (present, unsigned) = (column.present, column.unsigned);
        match &mut column.reader {
            ColumnReader::DoubleColumnReader(reader) => cells(reader, present, count).map(Self::Real),
            ColumnReader::FloatColumnReader(reader) => {
                cells(reader, present, count).map(|cells| Self::Real(each(cells, f64::from)))
            }
            ColumnReader::Int64ColumnReader(reader) => {
                let wide = |cell: i64| if unsigned { cell.cast_unsigned().into() } else { cell.into() };
                cells(reader, present, count).map(|cells| Self::Whole(each(cells, wide)))
            }
            ColumnReader::Int32ColumnReader(reader) => {
                let wide = |cell: i32| if unsigned { cell.cast_unsigned().into() } else { cell.into() };
                cells(reader, present, count).map(|cells| Self::Whole(each(cells, wide)))
            }
            ColumnReader::ByteArrayColumnReader(reader) => cells(reader, present, count).map(Self::Text),
            _ => Err(Fault::content(
                format!("column `{name}` is neither of numbers (float, double, int32, int64) nor of text"),
                "save numbers as double, time as double, int64 or time stamps, and vehicles as text or int64",
            )),
        }
    }

    /// The number in a cell, or the text that is there instead.
    fn number(&self, row: usize) -> Result<Option<f64>, String> {
        match self {
            Self::Real(cells) => Ok(cells[row]),
            Self::Whole(cells) => Ok(cells[row].map(|whole| whole as f64)),
            Self::Text(cells) => match &cells[row] {
                Some(text) => Err(String::from_utf8_lossy(text.data()).into_owned()),
                None => Ok(None),
            },
        }
    }
}

fn each<A, B>(cells: Vec<Option<A>>, change: impl Fn(A) -> B) -> Vec<Option<B>> {
    cells.into_iter().map(|cell| cell.map(&change)).collect()
}

fn cells<D: DataType>(
    reader: &mut ColumnReaderImpl<D>,
    present: i16,
    count: usize,
) -> Result<Vec<Option<D::T>>, Fault> {
    let (mut values, mut levels) = (Vec::new(), Vec::new());
    guarded(|| reader.read_records(count, Some(&mut levels), None, &mut values))?;
    if present == 0 {
        return Ok(values.into_iter().map(Some).collect());
    }
    let mut values = values.into_iter();
    Ok(levels.into_iter().map(|level| if level == present { values.next() } else { None }).collect())
}

/// A column of the current group of rows.
struct Column {
    number: usize,
    /// The definition level of a cell that is there.
    present: i16,
    unsigned: bool,
    reader: ColumnReader,
    cells: Batch,
}

/// A table, group of rows by group of rows.
struct Groups {
    reader: SerializedFileReader<File>,
    header: Vec<String>,
    /// Columns that are read.
    wanted: Vec<usize>,
    /// Number of the next group of rows.
    group: usize,
    columns: Vec<Column>,
    /// Rows of the current group that have not been read.
    rows_left: usize,
    /// Rows in the cells that were read, which one of them is the current one, and how many came before them.
    count: usize,
    at: usize,
    rows_before: u64,
}

impl Groups {
    /// Goes to the next group of rows; `false` behind the last.
    fn open_group(&mut self) -> Result<bool, Fault> {
        if self.group >= self.reader.num_row_groups() {
            return Ok(false);
        }
        let schema = self.reader.metadata().file_metadata().schema_descr_ptr();
        let (group, reader) = (self.group, &self.reader);
        let mut columns = Vec::new();
        for &number in &self.wanted {
            let column = guarded(|| reader.get_row_group(group)?.get_column_reader(number))?;
            let descriptor = schema.column(number);
            let (present, unsigned) = (descriptor.max_def_level(), is_unsigned(&descriptor));
            columns.push(Column { number, present, unsigned, reader: column, cells: Batch::Whole(Vec::new()) });
        }
        let rows = self.reader.metadata().row_group(self.group).num_rows();
        self.rows_left = usize::try_from(rows).map_err(|_| Fault::damaged("a group has less than no rows"))?;
        self.columns = columns;
        self.group += 1;
        Ok(true)
    }

    /// Reads some rows; 0 at the end.
    fn fill(&mut self) -> Result<usize, Fault> {
        while self.rows_left == 0 {
            if !self.open_group()? {
                return Ok(0);
            }
        }
        let count = self.rows_left.min(BATCH);
        for column in &mut self.columns {
            column.cells = Batch::read(column, &self.header[column.number], count)?;
            if column.cells.len() != count {
                let what = format!("column `{}` has fewer cells than its group has rows", self.header[column.number]);
                return Err(Fault::Truncated { what });
            }
        }
        self.rows_left -= count;
        Ok(count)
    }

    fn cells(&self, number: usize) -> Option<&Batch> {
        let at = self.columns.binary_search_by_key(&number, |column| column.number).ok()?;
        Some(&self.columns[at].cells)
    }
}

impl Cells for Groups {
    fn header(&self) -> &[String] {
        &self.header
    }

    fn restart(&mut self, columns: &[usize], _all: bool) -> Result<(), FaultAt> {
        self.wanted = columns.to_vec();
        (self.group, self.rows_left, self.count, self.at, self.rows_before) = (0, 0, 0, 0, 0);
        Ok(())
    }

    fn advance(&mut self) -> Result<bool, FaultAt> {
        self.at += 1;
        if self.at >= self.count {
            self.rows_before += self.count as u64;
            (self.count, self.at) = (0, 0);
            self.count = self.fill().map_err(|fault| fault.at(Self::place(self.row())))?;
        }
        Ok(self.count > 0)
    }

    fn row(&self) -> u64 {
        self.rows_before + self.at as u64 + 1
    }

    fn place(row: u64) -> Place {
        Place::Row(row)
    }

    fn number(&self, column: usize) -> Result<Option<f64>, Fault> {
        let name = || self.header[column].clone();
        match self.cells(column).map_or(Ok(None), |cells| cells.number(self.at)) {
            Ok(Some(number)) if !number.is_finite() => {
                Err(Fault::NotFinite { column: name(), value: number.to_string() })
            }
            Ok(number) => Ok(number),
            Err(text) => Err(Fault::NotANumber { column: name(), value: text }),
        }
    }

    fn stamp(&mut self, column: usize) -> Result<Option<Stamp>, Fault> {
        if let Some(Batch::Whole(cells)) = self.cells(column) {
            let stamp = |whole: i128| i64::try_from(whole).map_or(Stamp::Real(whole as f64), Stamp::Whole);
            return Ok(cells[self.at].map(stamp));
        }
        Ok(self.number(column)?.map(Stamp::Real))
    }

    fn vehicle(&self, column: usize, names: &mut Names, before: usize) -> Result<Option<usize>, Fault> {
        match self.cells(column) {
            Some(Batch::Text(cells)) => {
                let name =
                    cells[self.at].as_ref().map(|text| text.as_utf8().map_err(|_| Fault::NotUtf8)).transpose()?;
                Ok(name.map(|name| names.index(name, before)))
            }
            Some(Batch::Whole(cells)) => Ok(cells[self.at].map(|number| names.index(&number.to_string(), before))),
            _ => {
                let problem = format!("column `{}` holds numbers with decimals", self.header[column]);
                Err(Fault::content(problem, "save vehicles as text or as whole numbers"))
            }
        }
    }
}
