//! Writes a long table in Parquet with the columns of the CSV export.

use std::fs::File;
use std::sync::Arc;

use parquet::basic::{Compression, LogicalType, Repetition, Type as Physical};
use parquet::data_type::{ByteArray, ByteArrayType, DataType, DoubleType};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::{Type, TypePtr};

use super::ExportError;
use super::source::{ExportInfo, Source};
use crate::read::parquet::EPOCH_KEY;
use tautline_core::track::Sample;

/// Number of rows of a row group, which is built in memory.
const GROUP_ROWS: usize = 200_000;

pub(super) fn write(source: &Source<'_>, info: &ExportInfo, file: &mut File) -> Result<(), ExportError> {
    let schema = schema(info).map_err(write_error)?;
    let mut properties = WriterProperties::builder().set_compression(Compression::SNAPPY).set_created_by(format!(
        "{} {}",
        tautline_core::PROGRAM,
        tautline_core::VERSION
    ));
    if info.clock.epoch_ns != 0 {
        let epoch = KeyValue::new(EPOCH_KEY.to_owned(), info.clock.epoch_ns.to_string());
        properties = properties.set_key_value_metadata(Some(vec![epoch]));
    }
    let file = file.try_clone()?;
    let mut writer = SerializedFileWriter::new(file, schema, Arc::new(properties.build())).map_err(write_error)?;
    let names: Vec<ByteArray> = info.names.iter().map(|name| ByteArray::from(name.as_str())).collect();
    let (mut rows, mut extra) = (Vec::new(), Vec::new());
    source.each_instant(|instant, channels| {
        rows.extend_from_slice(instant);
        (0..instant.len()).for_each(|row| info.extra.cells(channels, row, &mut extra));
        if rows.len() >= GROUP_ROWS {
            write_group(&mut writer, (&rows, &extra), &names, info).map_err(write_error)?;
            rows.clear();
            extra.clear();
        }
        Ok(())
    })?;
    if !rows.is_empty() {
        write_group(&mut writer, (&rows, &extra), &names, info).map_err(write_error)?;
    }
    writer.close().map_err(write_error)?;
    Ok(())
}

fn schema(info: &ExportInfo) -> Result<TypePtr, ParquetError> {
    let column = |name: &str, physical, repetition, logical| {
        let column = Type::primitive_type_builder(name, physical).with_repetition(repetition);
        column.with_logical_type(logical).build().map(Arc::new)
    };
    let double = |name: &str, repetition| column(name, Physical::DOUBLE, repetition, None);
    let mut columns = vec![
        double("t_s", Repetition::REQUIRED)?,
        column("id", Physical::BYTE_ARRAY, Repetition::REQUIRED, Some(LogicalType::String))?,
    ];
    for position in info.position_columns() {
        columns.push(double(position.name, Repetition::REQUIRED)?);
    }
    for optional in info.optional_columns() {
        columns.push(double(optional.name, Repetition::OPTIONAL)?);
    }
    for extra in info.extra.columns() {
        columns.push(double(&extra, Repetition::OPTIONAL)?);
    }
    Type::group_type_builder("samples").with_fields(columns).build().map(Arc::new)
}

fn write_group(
    writer: &mut SerializedFileWriter<File>,
    (rows, extra): (&[Sample], &[f64]),
    names: &[ByteArray],
    info: &ExportInfo,
) -> Result<(), ParquetError> {
    let mut group = writer.next_row_group()?;
    let time = |sample: &Sample| Some(sample.time_s);
    write_column::<DoubleType, _>(&mut group, rows, time)?;
    write_column::<ByteArrayType, _>(&mut group, rows, |sample| Some(names[sample.vehicle].clone()))?;
    for column in info.position_columns().iter().chain(info.optional_columns()) {
        write_column::<DoubleType, _>(&mut group, rows, column.of)?;
    }
    let width = info.extra.columns().len();
    for column in 0..width {
        let known = |row: &&[f64]| Some(row[column]).filter(|cell| cell.is_finite());
        let cells: Vec<_> = extra.chunks_exact(width).collect();
        write_column::<DoubleType, _>(&mut group, &cells, known)?;
    }
    group.close().map(drop)
}

fn write_column<D: DataType, R>(
    group: &mut SerializedRowGroupWriter<'_, File>,
    rows: &[R],
    cell: impl Fn(&R) -> Option<D::T>,
) -> Result<(), ParquetError> {
    let Some(mut column) = group.next_column()? else {
        return Err(ParquetError::General("the schema has too few columns".to_owned()));
    };
    let cells: Vec<_> = rows.iter().map(cell).collect();
    let levels: Vec<i16> = cells.iter().map(|cell| i16::from(cell.is_some())).collect();
    let values: Vec<_> = cells.into_iter().flatten().collect();
    column.typed::<D>().write_batch(&values, Some(&levels), None)?;
    column.close()
}

fn write_error(error: ParquetError) -> ExportError {
    ExportError::Write(std::io::Error::other(error))
}
