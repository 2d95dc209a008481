//! Reads tables in Parquet, with the same columns as in CSV.
//!
//! Columns are flat. Vehicles are text or integers, other values are numbers. Times are numbers or time stamps, which
//! have a unit. The key `epoch_ns` of the file metadata optionally holds the epoch.

mod pages;

use std::borrow::Cow;
use std::fs::File;
use std::io::{self, Read as _, Seek as _, SeekFrom};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use parquet::basic::{Compression, ConvertedType, LogicalType, TimeUnit as ParquetUnit, Type as Physical};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl, get_column_reader};
use parquet::data_type::{ByteArray, DataType};
use parquet::errors::ParquetError;
use parquet::file::reader::{FileReader as _, SerializedFileReader};
use parquet::schema::types::ColumnDescriptor;

use self::pages::{Pages, delta_text};
use crate::read::cells::{self, Cells};
use crate::read::clock::Stamp;
use crate::read::error::{ContentKind, Fault, Place, ReadError, refuse};
use crate::read::layout::Layout;
use crate::read::options::ReadOptions;
use crate::read::order::{BATCH, Recording};
use crate::read::source::Source;
use crate::read::table;
use crate::read::time_unit::TimeUnit;

/// Metadata key of the epoch \[ns\].
pub(crate) const EPOCH_KEY: &str = "epoch_ns";

/// Largest number of cells read at once: some 20 MB.
const BATCH_CELLS: usize = 640_000;

/// Number of cells below which repeated cells are not limited: some 1 GB if each has eight bytes.
const FREE_CELLS: u64 = 1 << 27;

/// Largest number of cells for each byte of the file beyond [`FREE_CELLS`].
const CELLS_PER_BYTE: u64 = 25;

/// Opens a table.
pub(in crate::read) fn open(source: &Source, options: &ReadOptions) -> Result<Recording, ReadError> {
    let source = &source.clone().seekable()?;
    let mut file = File::open(&source.path)?;
    let file_bytes = file.metadata()?.len();
    if file_bytes < 12 {
        return Err(Fault::truncated("the end of the file is missing").into());
    }
    let mut end = [0; 8];
    file.seek(SeekFrom::End(-8))?;
    file.read_exact(&mut end)?;
    let [length @ .., _, _, _, _] = end;
    if end[4..] == *b"PARE" {
        return Err(Fault::damaged("its footer is encrypted").into());
    }
    let footer_bytes = i64::from(u32::from_le_bytes(length));
    if end[4..] != *b"PAR1" || file.seek(SeekFrom::End(-8 - footer_bytes)).is_err() {
        let what = "the end of the file, with the description of its columns, is missing".to_owned();
        return Err(Fault::truncated(what).into());
    }
    let mut footer = Vec::new();
    file.try_clone()?.take(footer_bytes.cast_unsigned()).read_to_end(&mut footer)?;
    pages::check_footer(&footer).map_err(|error| Fault::damaged(format!("the description of its columns: {error}")))?;
    let reader = guarded(|| SerializedFileReader::new(file.try_clone()?))?;
    let metadata = reader.metadata().file_metadata();
    let schema = metadata.schema_descr();
    let header: Vec<String> = schema.columns().iter().map(|column| column.path().string()).collect();
    let mut layout = Layout::of(&header, options, &source.stem())?;
    let can_name = |&column: &usize| {
        let physical = schema.column(column).physical_type();
        unreadable(&reader, column).is_none()
            && !matches!(physical, Physical::BOOLEAN | Physical::INT96 | Physical::FIXED_LEN_BYTE_ARRAY)
    };
    layout.alternative_ids.retain(can_name);
    layout.suspects.retain(can_name);
    layout.rate = layout.rate.filter(|(column, _)| can_name(column));
    if !layout.compared.iter().flatten().flat_map(|compared| compared.earth).flatten().all(|column| can_name(&column)) {
        layout.compared.clear();
    }
    let unit = layout.time.and_then(|time| unit_of(&schema.column(time)));
    for &column in &layout.columns() {
        if let Some((kind, what, remedy)) = unreadable(&reader, column) {
            return refuse(kind, format!("column `{}` {what}", header[column]), remedy);
        }
    }
    check_rows(&reader, layout.columns().len(), file_bytes)?;
    let epoch_ns = metadata.key_value_metadata().into_iter().flatten().find(|pair| pair.key == EPOCH_KEY);
    let epoch_ns = epoch_ns.and_then(|pair| pair.value.as_deref()).and_then(|value| value.parse().ok());
    let groups = Groups {
        reader,
        file,
        unpacked_bytes: Arc::default(),
        header,
        wanted: Vec::new(),
        columns: Vec::new(),
        cursor: Cursor::default(),
    };
    table::open(source, groups, layout, unit, epoch_ns.unwrap_or(0), options)
}

/// Checks the numbers of rows that the file claims. A row of `columns` cells takes no byte if all cells repeat.
fn check_rows(reader: &SerializedFileReader<File>, columns: usize, file_bytes: u64) -> Result<(), Fault> {
    let metadata = reader.metadata();
    let rows = metadata
        .row_groups()
        .iter()
        .try_fold(0_u64, |sum, group| u64::try_from(group.num_rows()).ok().and_then(|rows| sum.checked_add(rows)));
    let rows = rows.filter(|&rows| u64::try_from(metadata.file_metadata().num_rows()) == Ok(rows));
    let rows = rows.ok_or_else(|| Fault::damaged("its number of rows is not the sum over its row groups"))?;
    if rows.saturating_mul(columns as u64) > FREE_CELLS.max(file_bytes.saturating_mul(CELLS_PER_BYTE)) {
        return Err(Fault::grows_too_large(format!(
            "it claims {rows} rows of {columns} columns in {file_bytes} bytes"
        )));
    }
    Ok(())
}

thread_local! {
    static GUARDED: std::cell::Cell<bool> = const { std::cell::Cell::new(false) };
}

/// Returns whether this thread is in a call whose panic becomes an error. A panic hook should then print nothing.
#[must_use]
pub fn is_guarded() -> bool {
    GUARDED.get()
}

/// Calls the library and converts its panics on damaged files to errors.
fn guarded<T>(call: impl FnOnce() -> Result<T, ParquetError>) -> Result<T, Fault> {
    GUARDED.set(true);
    let outcome = catch_unwind(AssertUnwindSafe(call));
    GUARDED.set(false);
    match outcome {
        Ok(Ok(value)) => Ok(value),
        Ok(Err(ParquetError::EOF(what))) => Err(Fault::truncated(what)),
        Ok(Err(ParquetError::External(error))) => Err(match error.downcast::<io::Error>() {
            Ok(error) => Fault::from(*error),
            Err(error) => Fault::damaged(error),
        }),
        Ok(Err(error)) => Err(Fault::damaged(error)),
        Err(_) => Err(Fault::damaged("its pages contradict each other")),
    }
}

/// Returns the unit of a column of time stamps.
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

/// Returns kind, problem and remedy of a column that cannot be read as numbers or text.
fn unreadable(reader: &SerializedFileReader<File>, column: usize) -> Option<(ContentKind, &'static str, &'static str)> {
    const ELEMENT_TYPE: ContentKind = ContentKind::ElementType;
    const PACKED: ContentKind = ContentKind::UnsupportedCompression;
    let metadata = reader.metadata();
    let descriptor = metadata.file_metadata().schema_descr().column(column);
    if descriptor.max_rep_level() > 0 {
        return Some((ELEMENT_TYPE, "holds lists", "save one number per cell"));
    }
    let other = match (descriptor.logical_type_ref(), descriptor.converted_type()) {
        (Some(LogicalType::Decimal(_)), _) | (_, ConvertedType::DECIMAL) => Some("holds decimals"),
        (Some(LogicalType::Date), _) | (_, ConvertedType::DATE) => Some("holds dates"),
        (Some(LogicalType::Time(_)), _) | (_, ConvertedType::TIME_MILLIS | ConvertedType::TIME_MICROS) => {
            Some("holds times of day")
        }
        _ => None,
    };
    if let Some(what) = other {
        return Some((ELEMENT_TYPE, what, "save numbers as double, and time as double, int64 or time stamps"));
    }
    let chunks = || metadata.row_groups().iter().filter_map(|group| group.columns().get(column));
    let packed = chunks().find_map(|chunk| match chunk.compression() {
        Compression::BROTLI(_) => Some("is packed by brotli, which is not supported"),
        Compression::LZO => Some("is packed by lzo, which is not supported"),
        _ => None,
    });
    if let Some(what) = packed {
        return Some((PACKED, what, "save it uncompressed, or packed by one of snappy, gzip, lz4, zstd"));
    }
    let is_delta = descriptor.physical_type() == Physical::BYTE_ARRAY
        && chunks().any(|chunk| chunk.encodings().any(|encoding| delta_text(encoding).is_some()));
    is_delta.then_some((PACKED, "holds text in a delta encoding", "save text with a dictionary or in plain encoding"))
}

/// Returns whether the integers of a column are unsigned.
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

/// Cell of a column.
type Cell = cells::Cell<ByteArray>;

/// Reads the next cells of the column with this name.
fn read_cells(column: &mut Column, name: &str, count: usize) -> Result<Vec<Cell>, Fault> {
    let (present, unsigned) = (column.present, column.unsigned);
    match &mut column.reader {
        ColumnReader::DoubleColumnReader(reader) => read_records(reader, present, count, Cell::Real),
        ColumnReader::FloatColumnReader(reader) => read_records(reader, present, count, |cell| Cell::Real(cell.into())),
        ColumnReader::Int64ColumnReader(reader) => read_records(reader, present, count, |cell| {
            Cell::Whole(if unsigned { cell.cast_unsigned().into() } else { cell.into() })
        }),
        ColumnReader::Int32ColumnReader(reader) => read_records(reader, present, count, |cell| {
            Cell::Whole(if unsigned { cell.cast_unsigned().into() } else { cell.into() })
        }),
        ColumnReader::ByteArrayColumnReader(reader) => read_records(reader, present, count, Cell::Text),
        _ => refuse(
            ContentKind::ElementType,
            format!("column `{name}` holds neither numbers (float, double, int32, int64) nor text"),
            "save numbers as double, time as one of double, int64, timestamp, and vehicles as one of text, int64",
        ),
    }
}

fn read_records<D: DataType>(
    reader: &mut ColumnReaderImpl<D>,
    present: i16,
    count: usize,
    cell: impl Fn(D::T) -> Cell,
) -> Result<Vec<Cell>, Fault> {
    let (mut values, mut levels) = (Vec::new(), Vec::new());
    guarded(|| reader.read_records(count, Some(&mut levels), None, &mut values))?;
    let mut cells = values.into_iter().map(cell);
    if present == 0 {
        return Ok(cells.collect());
    }
    let next = |level| if level == present { cells.next() } else { None };
    Ok(levels.into_iter().map(next).map(|cell| cell.unwrap_or(Cell::Empty)).collect())
}

/// Column of the current row group.
struct Column {
    number: usize,
    /// Definition level of a cell that is not null.
    present: i16,
    unsigned: bool,
    reader: ColumnReader,
    cells: Vec<Cell>,
}

/// Table, read one row group after another.
struct Groups {
    reader: SerializedFileReader<File>,
    /// The same file, for its pages, and their unpacked size up to now \[bytes\].
    file: File,
    unpacked_bytes: Arc<AtomicU64>,
    header: Vec<String>,
    /// Columns to read.
    wanted: Vec<usize>,
    columns: Vec<Column>,
    cursor: Cursor,
}

/// Reading position in a table.
#[derive(Default)]
struct Cursor {
    /// Index of the next row group.
    group: usize,
    /// Number of unread rows of the current group.
    rows_left: usize,
    /// Number of rows in the cells, index of the current one, and number of rows before them.
    count: usize,
    at: usize,
    rows_before: u64,
}

impl Groups {
    /// Opens the next row group; returns `false` after the last one.
    fn open_group(&mut self) -> Result<bool, Fault> {
        if self.cursor.group >= self.reader.num_row_groups() {
            return Ok(false);
        }
        let schema = self.reader.metadata().file_metadata().schema_descr_ptr();
        let (group, reader) = (self.cursor.group, &self.reader);
        let mut columns = Vec::new();
        for &number in &self.wanted {
            let descriptor = schema.column(number);
            let pages =
                guarded(|| Pages::new(&self.file, &self.unpacked_bytes, reader.metadata().row_group(group), number))?;
            let column = get_column_reader(Arc::clone(&descriptor), Box::new(pages));
            let (present, unsigned) = (descriptor.max_def_level(), is_unsigned(&descriptor));
            columns.push(Column { number, present, unsigned, reader: column, cells: Vec::new() });
        }
        let rows = self.reader.metadata().row_group(self.cursor.group).num_rows();
        self.cursor.rows_left =
            usize::try_from(rows).map_err(|_| Fault::damaged("a row group has a negative row count"))?;
        self.columns = columns;
        self.cursor.group += 1;
        Ok(true)
    }

    /// Reads some rows; returns their number, 0 at the end.
    fn fill(&mut self) -> Result<usize, Fault> {
        while self.cursor.rows_left == 0 {
            if !self.open_group()? {
                return Ok(0);
            }
        }
        let count = self.cursor.rows_left.min(BATCH).min((BATCH_CELLS / self.wanted.len()).max(1));
        for column in &mut self.columns {
            column.cells = read_cells(column, &self.header[column.number], count)?;
            if column.cells.len() != count {
                let what = format!("column `{}` has fewer cells than its group has rows", self.header[column.number]);
                return Err(Fault::truncated(what));
            }
        }
        self.cursor.rows_left -= count;
        if self.cursor.rows_left == 0 {
            for column in &mut self.columns {
                let name = &self.header[column.number];
                if !read_cells(column, name, 1)?.is_empty() {
                    return Err(Fault::damaged(format!("column `{name}` has more cells than its group has rows")));
                }
            }
        }
        Ok(count)
    }

    /// Returns the cell of the current row in a column.
    fn cell(&self, number: usize) -> &Cell {
        let index = self.columns.binary_search_by_key(&number, |column| column.number);
        index.ok().and_then(|index| self.columns[index].cells.get(self.cursor.at)).unwrap_or(&Cell::Empty)
    }
}

impl Cells for Groups {
    fn header(&self) -> &[String] {
        &self.header
    }

    fn restart(&mut self, columns: &[usize], _all: bool) -> Result<(), ReadError> {
        self.wanted = columns.to_vec();
        self.unpacked_bytes.store(0, Ordering::Relaxed);
        self.cursor = Cursor::default();
        Ok(())
    }

    fn advance(&mut self) -> Result<bool, ReadError> {
        self.cursor.at += 1;
        if self.cursor.at >= self.cursor.count {
            self.cursor.rows_before += self.cursor.count as u64;
            (self.cursor.count, self.cursor.at) = (0, 0);
            self.cursor.count = self.fill().map_err(|fault| self.fault(fault))?;
        }
        Ok(self.cursor.count > 0)
    }

    fn row(&self) -> u64 {
        self.cursor.rows_before + self.cursor.at as u64 + 1
    }

    fn place(&self, row: u64) -> Place {
        Place::Row(row)
    }

    fn text(&self, column: usize) -> Result<Cow<'_, str>, Fault> {
        self.cell(column).text()
    }

    fn number(&self, column: usize) -> Option<f64> {
        self.cell(column).number()
    }

    fn stamp(&mut self, column: usize) -> Option<Stamp> {
        self.cell(column).stamp()
    }

    fn name(&self, column: usize) -> Result<Cow<'_, str>, Fault> {
        if let Cell::Real(_) = self.cell(column) {
            let problem = format!("column `{}` holds numbers with decimals", self.header[column]);
            return refuse(ContentKind::ElementType, problem, "save vehicles as text or as integers");
        }
        self.text(column)
    }
}
