//! `results.parquet`: a row a flight, in the order of runs and laws.

use std::fs::File;
use std::sync::Arc;

use parquet::basic::{Compression, LogicalType, Repetition, Type as Physical};
use parquet::data_type::{BoolType, ByteArray, ByteArrayType, DataType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::Type;
use serde_json::Value;

use super::plan::Campaign;
use super::row::Row;
use crate::compare::FlightRow;
use crate::splitting::Splitting;

/// Rows of a group, which is built in memory.
const GROUP_ROWS: usize = 50_000;

/// The cell of a row; none where it does not apply.
type Cell<'a, T> = Box<dyn Fn(&Row) -> Option<T> + 'a>;

/// A column by the kind of its cells.
enum Cells<'a> {
    Number(Cell<'a, f64>),
    Whole(Cell<'a, i64>),
    Flag(Cell<'a, bool>),
    Text(Cell<'a, String>),
}

/// The table while it is written.
pub(super) struct Table<'a> {
    writer: SerializedFileWriter<File>,
    columns: Vec<(String, Cells<'a>)>,
    rows: Vec<Row>,
}

fn number<'a>(of: impl Fn(&FlightRow) -> Option<f64> + 'a) -> Cells<'a> {
    Cells::Number(Box::new(move |row| row.flight.as_ref().and_then(&of)))
}

fn whole<'a>(of: impl Fn(&FlightRow) -> Option<u64> + 'a) -> Cells<'a> {
    Cells::Whole(Box::new(move |row| row.flight.as_ref().and_then(&of).map(u64::cast_signed)))
}

fn text<'a>(of: impl Fn(&FlightRow) -> Option<String> + 'a) -> Cells<'a> {
    Cells::Text(Box::new(move |row| row.flight.as_ref().and_then(&of)))
}

/// A drawn value as a column of numbers where all of them are numbers, else of texts.
fn drawn<'a>(place: usize, samples: &[toml::Value], is_whole: bool) -> Cells<'a> {
    let at = move |row: &Row| row.drawn.get(place).cloned();
    let is_number = samples.iter().all(|value| value.is_float() || value.is_integer());
    match (is_whole, is_number) {
        (true, _) => Cells::Whole(Box::new(move |row| at(row)?.as_i64())),
        (false, true) => Cells::Number(Box::new(move |row| at(row)?.as_f64())),
        (false, false) => Cells::Text(Box::new(move |row| {
            let value = at(row)?;
            Some(value.as_str().map_or_else(|| Value::to_string(&value), str::to_owned))
        })),
    }
}

fn columns(campaign: &Campaign) -> Vec<(String, Cells<'_>)> {
    let mut columns = vec![
        ("run".to_owned(), Cells::Whole(Box::new(|row: &Row| Some(row.run.cast_signed())))),
        ("law".to_owned(), Cells::Text(Box::new(|row: &Row| campaign.laws().get(row.law).map(|law| law.name.clone())))),
    ];
    for (place, (key, variation)) in campaign.variations().iter().enumerate() {
        let samples = variation.samples();
        let is_whole = samples.iter().all(toml::Value::is_integer);
        // Columns of our own have no dots.
        let name = if key.contains('.') { key.clone() } else { format!("vary.{key}") };
        columns.push((name, drawn(place, &samples, is_whole)));
    }
    let outcome = |row: &Row| row.flight.as_ref().map_or("not_flown", |flight| flight.outcome.name()).to_owned();
    let flag = |of: fn(&FlightRow) -> bool| Cells::Flag(Box::new(move |row: &Row| row.flight.as_ref().map(of)));
    let flight: Vec<(&str, Cells<'_>)> = vec![
        ("outcome", Cells::Text(Box::new(move |row: &Row| Some(outcome(row))))),
        ("pass", flag(|flight| flight.pass)),
        ("refused", text(|flight| Some(flight.refused.join(" ")).filter(|codes| !codes.is_empty()))),
        ("ended_early", text(|flight| flight.ended_early.clone())),
        ("not_flown_because", Cells::Text(Box::new(|row: &Row| row.not_flown.clone()))),
        ("delta_m", number(|flight| Some(flight.delta_m))),
        ("min_m", number(|flight| flight.min_m)),
        ("min_at_s", number(|flight| flight.min_at_s)),
        ("min_vehicle_a", whole(|flight| flight.min_pair.map(|pair| pair[0] as u64))),
        ("min_vehicle_b", whole(|flight| flight.min_pair.map(|pair| pair[1] as u64))),
        ("certified_m", number(|flight| flight.certified_m)),
        ("breaks_certificate", flag(|flight| flight.breaks_certificate)),
        ("reached", flag(|flight| flight.reached)),
        ("reached_at_s", number(|flight| flight.reached_at_s)),
        ("peak_control_m_s2", number(|flight| flight.peak_control_m_s2)),
        ("total_control_m_s", number(|flight| Some(flight.total_control_m_s))),
        ("path_length_m", number(|flight| Some(flight.path_length_m))),
        ("energy_max_over_initial", number(|flight| flight.energy_max_over_initial)),
        ("steps", whole(|flight| Some(flight.steps))),
        ("refined_steps", whole(|flight| Some(flight.refined_steps))),
        ("overlong_steps", whole(|flight| Some(flight.overlong_steps))),
        ("scenario_sha256", text(|flight| Some(flight.scenario_sha256.clone()))),
        ("state_hash", text(|flight| Some(flight.state_hash.clone()))),
    ];
    if campaign.splitting().is_some() {
        let estimate =
            |of: fn(&Splitting) -> f64| Cells::Number(Box::new(move |row: &Row| row.splitting.as_ref().map(of)));
        let count = |of: fn(&Splitting) -> u64| {
            Cells::Whole(Box::new(move |row: &Row| row.splitting.as_ref().map(of).map(u64::cast_signed)))
        };
        columns.extend([
            ("probability".to_owned(), estimate(|of| of.probability)),
            ("iterations".to_owned(), count(|of| of.iterations)),
            ("extinct".to_owned(), Cells::Flag(Box::new(|row: &Row| row.splitting.as_ref().map(|of| of.extinct)))),
            ("steps".to_owned(), count(|of| of.steps)),
            ("not_flown_because".to_owned(), Cells::Text(Box::new(|row: &Row| row.not_flown.clone()))),
        ]);
        return columns;
    }
    columns.extend(flight.into_iter().map(|(name, cells)| (name.to_owned(), cells)));
    columns
}

impl<'a> Table<'a> {
    /// Begins the table of a campaign.
    ///
    /// # Errors
    /// [`ParquetError`] where the file cannot be written.
    pub(super) fn create(campaign: &'a Campaign, file: File) -> Result<Self, ParquetError> {
        let columns = columns(campaign);
        let fields = columns.iter().map(|(name, cells)| {
            let (physical, logical) = match cells {
                Cells::Number(_) => (Physical::DOUBLE, None),
                Cells::Whole(_) => (Physical::INT64, None),
                Cells::Flag(_) => (Physical::BOOLEAN, None),
                Cells::Text(_) => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
            };
            let field = Type::primitive_type_builder(name, physical).with_repetition(Repetition::OPTIONAL);
            field.with_logical_type(logical).build().map(Arc::new)
        });
        let schema = Type::group_type_builder("flights").with_fields(fields.collect::<Result<_, _>>()?).build()?;
        let about = KeyValue::new("tautline.campaign".to_owned(), campaign.manifest().campaign.clone());
        let properties = WriterProperties::builder()
            .set_compression(Compression::SNAPPY)
            .set_created_by(format!("{} {}", tautline_core::PROGRAM, tautline_core::VERSION))
            .set_key_value_metadata(Some(vec![about]));
        let writer = SerializedFileWriter::new(file, Arc::new(schema), Arc::new(properties.build()))?;
        Ok(Self { writer, columns, rows: Vec::new() })
    }

    /// Adds a row.
    ///
    /// # Errors
    /// [`ParquetError`] where the file cannot be written.
    pub(super) fn add(&mut self, row: Row) -> Result<(), ParquetError> {
        self.rows.push(row);
        if self.rows.len() == GROUP_ROWS { self.write_group() } else { Ok(()) }
    }

    /// Writes what is left.
    ///
    /// # Errors
    /// [`ParquetError`] where the file cannot be written.
    pub(super) fn close(mut self) -> Result<(), ParquetError> {
        if !self.rows.is_empty() {
            self.write_group()?;
        }
        self.writer.close().map(drop)
    }

    fn write_group(&mut self) -> Result<(), ParquetError> {
        let rows = std::mem::take(&mut self.rows);
        let mut group = self.writer.next_row_group()?;
        for (_, cells) in &self.columns {
            match cells {
                Cells::Number(of) => {
                    write_column::<DoubleType>(&mut group, rows.iter().map(|row| of(row).filter(|x| x.is_finite())))?;
                }
                Cells::Whole(of) => write_column::<Int64Type>(&mut group, rows.iter().map(of))?,
                Cells::Flag(of) => write_column::<BoolType>(&mut group, rows.iter().map(of))?,
                Cells::Text(of) => {
                    let bytes = |text: String| ByteArray::from(text.into_bytes());
                    write_column::<ByteArrayType>(&mut group, rows.iter().map(|row| of(row).map(bytes)))?;
                }
            }
        }
        group.close().map(drop)
    }
}

fn write_column<D: DataType>(
    group: &mut SerializedRowGroupWriter<'_, File>,
    cells: impl Iterator<Item = Option<D::T>>,
) -> Result<(), ParquetError> {
    let Some(mut column) = group.next_column()? else {
        return Err(ParquetError::General("the schema has too few columns".to_owned()));
    };
    let cells: Vec<_> = cells.collect();
    let levels: Vec<i16> = cells.iter().map(|cell| i16::from(cell.is_some())).collect();
    let values: Vec<_> = cells.into_iter().flatten().collect();
    column.typed::<D>().write_batch(&values, Some(&levels), None)?;
    column.close()
}
