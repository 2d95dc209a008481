//! Arguments that say how a recording is read, the same for all commands that read one.

use std::path::PathBuf;

use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};

use super::Failure;
use crate::read::{AxisOrder, ColumnNames, Format, ReadOptions, TimeUnit};

/// How a recording is read.
#[derive(Debug, Args)]
#[command(next_help_heading = "Reading")]
pub(super) struct ReadArguments {
    /// The recording: a file, or a folder of Crazyflie polynomials.
    #[arg(value_name = "RECORDING")]
    pub(super) recording: PathBuf,
    /// Unit of time of the recording [default: what it says, or its numbers suggest].
    #[arg(long, value_name = "UNIT", value_parser = unit())]
    time_unit: Option<TimeUnit>,
    /// Metres per unit of length of the recording.
    #[arg(long, value_name = "METRES", default_value_t = 1.0, allow_negative_numbers = true)]
    scale: f64,
    /// Name of a column: t, id, x, y, z, vx, vy, vz or radius. In NPZ, t and x name the arrays.
    #[arg(long = "column", value_name = "ROLE=NAME", value_parser = column)]
    columns: Vec<(String, String)>,
    /// Which axis of the positions of an NPZ archive comes first, where its shape does not tell.
    #[arg(long, value_name = "ORDER", value_parser = axis_order())]
    axis_order: Option<AxisOrder>,
    /// The frame whose positions are read, where an MCAP file gives several.
    #[arg(long, value_name = "NAME")]
    frame: Option<String>,
    /// Accept an MCAP file that was not closed, for what it holds.
    #[arg(long)]
    allow_unfinished: bool,
}

impl ReadArguments {
    /// The options of the library, with the format if it is given.
    pub(super) fn options(&self, format: Option<Format>) -> Result<ReadOptions, Failure> {
        if !(self.scale > 0.0 && self.scale.is_finite()) {
            let message = format!("--scale is {}", self.scale);
            return Err(Failure::input(message, "give a positive number of metres, such as 0.001 for millimetres"));
        }
        let mut columns = ColumnNames::default();
        for (role, name) in &self.columns {
            columns.set(role, name);
        }
        Ok(ReadOptions {
            format,
            time_unit: self.time_unit,
            scale: self.scale,
            columns,
            axis_order: self.axis_order,
            frame: self.frame.clone(),
            allow_unfinished: self.allow_unfinished,
        })
    }
}

fn column(text: &str) -> Result<(String, String), String> {
    let roles = ColumnNames::ROLES;
    match text.split_once('=') {
        Some((role, name)) if roles.contains(&role) && !name.is_empty() => Ok((role.to_owned(), name.to_owned())),
        Some((role, _)) if !roles.contains(&role) => {
            Err(format!("`{role}` is no column: the columns are {}", roles.join(", ")))
        }
        _ => Err("write ROLE=NAME, such as x=pos_east".to_owned()),
    }
}

/// A parser of these names, each with what it stands for.
pub(super) fn one_of<T: Clone + Send + Sync + 'static>(
    choices: Vec<(PossibleValue, T)>,
) -> impl TypedValueParser<Value = T> {
    let names = choices.iter().map(|(name, _)| name.clone()).collect::<Vec<_>>();
    PossibleValuesParser::new(names).try_map(move |given| {
        let chosen = choices.iter().find(|(name, _)| name.get_name() == given);
        chosen.map(|(_, value)| value.clone()).ok_or("it is none of the possible values")
    })
}

fn unit() -> impl TypedValueParser<Value = TimeUnit> {
    one_of(TimeUnit::ALL.map(|unit| (unit.name().into(), unit)).into())
}

fn axis_order() -> impl TypedValueParser<Value = AxisOrder> {
    one_of(vec![("time-first".into(), AxisOrder::TimeFirst), ("vehicle-first".into(), AxisOrder::VehicleFirst)])
}

/// A format that is read.
pub(super) fn format() -> impl TypedValueParser<Value = Format> {
    let help = |format| match format {
        Format::Csv => "A table in text with a header",
        Format::Text => "Numbers between blanks: t x y z x y z ...",
        Format::Parquet => "A table in Parquet",
        Format::Npz => "Arrays t and positions, as numpy.savez saves them",
        Format::Mcap => "MCAP: our own, Foxglove or ROS 2 messages",
        Format::Crazyflie => "A folder of Crazyflie polynomials",
        Format::Skybrush => "A Skybrush show",
    };
    one_of(Format::ALL.map(|format| (PossibleValue::new(format.name()).help(help(format)), format)).into())
}
