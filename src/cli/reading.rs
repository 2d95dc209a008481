//! Arguments that say how a recording is read, the same for all commands that read one.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

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
    #[arg(long, value_name = "UNIT")]
    time_unit: Option<UnitArgument>,
    /// Metres per unit of length of the recording.
    #[arg(long, value_name = "METRES", default_value_t = 1.0, allow_negative_numbers = true)]
    scale: f64,
    /// Name of a column: t, id, x, y, z, vx, vy, vz or radius. In NPZ, t and x name the arrays.
    #[arg(long = "column", value_name = "ROLE=NAME", value_parser = column)]
    columns: Vec<(String, String)>,
    /// Which axis of the positions of an NPZ archive comes first, where its shape does not tell.
    #[arg(long, value_name = "ORDER")]
    axis_order: Option<AxisArgument>,
    /// The frame whose positions are read, where an MCAP file gives several.
    #[arg(long, value_name = "NAME")]
    frame: Option<String>,
    /// Accept an MCAP file that was not closed, for what it holds.
    #[arg(long)]
    allow_unfinished: bool,
}

impl ReadArguments {
    /// The options of the library, with the format if it is given.
    pub(super) fn options(&self, format: Option<FormatArgument>) -> Result<ReadOptions, Failure> {
        if !(self.scale > 0.0 && self.scale.is_finite()) {
            let message = format!("--scale is {}", self.scale);
            return Err(Failure::input(message, "give a positive number of metres, such as 0.001 for millimetres"));
        }
        let mut columns = ColumnNames::default();
        for (role, name) in &self.columns {
            columns.set(role, name);
        }
        Ok(ReadOptions {
            format: format.map(FormatArgument::format),
            time_unit: self.time_unit.map(UnitArgument::unit),
            scale: self.scale,
            columns,
            axis_order: self.axis_order.map(AxisArgument::order),
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

#[derive(Clone, Copy, Debug, ValueEnum)]
enum UnitArgument {
    S,
    Ms,
    Us,
    Ns,
}

impl UnitArgument {
    fn unit(self) -> TimeUnit {
        match self {
            Self::S => TimeUnit::Seconds,
            Self::Ms => TimeUnit::Milliseconds,
            Self::Us => TimeUnit::Microseconds,
            Self::Ns => TimeUnit::Nanoseconds,
        }
    }
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum AxisArgument {
    TimeFirst,
    VehicleFirst,
}

impl AxisArgument {
    fn order(self) -> AxisOrder {
        match self {
            Self::TimeFirst => AxisOrder::TimeFirst,
            Self::VehicleFirst => AxisOrder::VehicleFirst,
        }
    }
}

/// A format that is read.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(super) enum FormatArgument {
    /// A table in text with a header.
    Csv,
    /// Numbers between blanks: t x y z x y z ...
    Text,
    /// A table in Parquet.
    Parquet,
    /// Arrays t and positions, as numpy.savez saves them.
    Npz,
    /// MCAP: our own, Foxglove or ROS 2 messages.
    Mcap,
    /// A folder of Crazyflie polynomials.
    Crazyflie,
    /// A Skybrush show.
    Skybrush,
}

impl FormatArgument {
    pub(super) fn format(self) -> Format {
        match self {
            Self::Csv => Format::Csv,
            Self::Text => Format::Text,
            Self::Parquet => Format::Parquet,
            Self::Npz => Format::Npz,
            Self::Mcap => Format::Mcap,
            Self::Crazyflie => Format::Crazyflie,
            Self::Skybrush => Format::Skybrush,
        }
    }
}
