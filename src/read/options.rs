//! What the user says of a recording.

use super::clock::TimeUnit;
use super::error::Fault;
use super::format::Format;

/// Which axis of an array comes first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AxisOrder {
    /// T x N x 3.
    TimeFirst,
    /// N x T x 3.
    VehicleFirst,
}

/// Names of columns, where they are not the usual ones: one for each of [`ColumnNames::ROLES`].
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ColumnNames([Option<String>; 9]);

impl ColumnNames {
    /// Roles that a column can have: time, vehicle, position \[m\], velocity \[m/s\] and radius \[m\] of the vehicle.
    pub const ROLES: [&str; 9] = ["t", "id", "x", "y", "z", "vx", "vy", "vz", "radius"];

    /// Gives the column of a role a name; `false` where there is no such role.
    pub fn set(&mut self, role: &str, name: &str) -> bool {
        let slot = self.0.iter_mut().zip(Self::ROLES).find(|(_, known)| *known == role);
        slot.map(|(slot, _)| *slot = Some(name.to_owned())).is_some()
    }

    /// The name given for a role.
    pub(super) fn get(&self, role: &str) -> Option<&String> {
        self.0.iter().zip(Self::ROLES).find(|(_, known)| *known == role)?.0.as_ref()
    }

    /// Places of roles, and the names given for them.
    pub(super) fn given(&self) -> impl Iterator<Item = (usize, &String)> {
        self.0.iter().enumerate().filter_map(|(role, name)| Some((role, name.as_ref()?)))
    }
}

/// What the user knows about a recording that its file does not say.
#[derive(Clone, Debug, PartialEq)]
pub struct ReadOptions {
    /// The format, instead of recognising it by the content.
    pub format: Option<Format>,
    /// The unit of time, instead of what the file says or its numbers suggest.
    pub time_unit: Option<TimeUnit>,
    /// Metres per unit of length of the file; velocities and radii are scaled too.
    pub scale: f64,
    /// Names of columns of a table.
    pub columns: ColumnNames,
    /// Which axis of an array comes first, where its shape does not tell.
    pub axis_order: Option<AxisOrder>,
    /// The frame whose poses are read, where messages have several.
    pub frame: Option<String>,
    /// Whether to accept an MCAP file that was not closed, for what it holds.
    pub allow_unfinished: bool,
}

impl Default for ReadOptions {
    /// Everything recognised, lengths in metres.
    fn default() -> Self {
        Self {
            format: None,
            time_unit: None,
            scale: 1.0,
            columns: ColumnNames::default(),
            axis_order: None,
            frame: None,
            allow_unfinished: false,
        }
    }
}

impl ReadOptions {
    /// An option that means nothing for a format, and why.
    pub(super) fn needless_for(&self, format: Format) -> Option<(&'static str, &'static str)> {
        let is_table = matches!(format, Format::Csv | Format::Text | Format::Parquet | Format::Npz);
        let (is_npz, is_mcap) = (format == Format::Npz, format == Format::Mcap);
        let given = [
            (self.time_unit.is_some() && !is_table, "--time-unit", "has a unit of time of its own"),
            (self.columns != ColumnNames::default() && !is_table, "--column", "has no columns that could be named"),
            (self.axis_order.is_some() && !is_npz, "--axis-order", "has no arrays"),
            (self.frame.is_some() && !is_mcap, "--frame", "names no frames"),
            (self.allow_unfinished && !is_mcap, "--allow-unfinished", "cannot be read before it is closed"),
        ];
        given.into_iter().find_map(|(needless, option, why)| needless.then_some((option, why)))
    }

    /// What is to be said of an MCAP file that was not closed, or the fault that it is.
    pub(super) fn accept_unfinished(&self, complete: bool) -> Result<Vec<String>, Fault> {
        let note = "the recording was not closed: it is read up to the last part that was written";
        match (complete, self.allow_unfinished) {
            (true, _) => Ok(Vec::new()),
            (false, true) => Ok(vec![note.to_owned()]),
            (false, false) => Err(Fault::Unfinished),
        }
    }
}
