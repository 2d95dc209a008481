//! Rows of a recording in the order of its file.

use nalgebra::Vector3;

use super::clock::{Probe, Stamp, Timing};
use super::error::{Fault, Place, ReadError, quoted};

/// Number of rows that are read at a time.
pub(super) const BATCH: usize = 10_000;

/// State of a vehicle at an instant, as read from the file.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row {
    /// Time in the unit of the file.
    pub(super) stamp: Stamp,
    /// Number of the place in the file; see [`Rows::place`].
    pub(super) place: u64,
    pub(super) vehicle: usize,
    pub(super) position: Vector3<f64>,
    pub(super) velocity: Option<Vector3<f64>>,
    pub(super) radius: Option<f64>,
}

/// Reader of a recording that yields samples row by row.
pub(super) trait Rows {
    /// Appends about [`BATCH`] rows in the order of the file. Returns `false` if no row was left.
    fn next(&mut self, rows: &mut Vec<Row>) -> Result<bool, ReadError>;

    /// Restarts at the first row. A reader whose time only runs forwards is read once and need not implement this.
    fn rewind(&mut self) -> Result<(), ReadError> {
        Ok(())
    }

    /// Names of the vehicles read so far.
    fn vehicles(&self) -> &[String];

    /// Puts the names in their final order after all of them have been read.
    fn settle_names(&mut self) {}

    /// Notes for the user that are known while rows are read.
    fn notes(&self) -> Vec<String> {
        Vec::new()
    }

    /// Notes for the user that are known after all rows have been read.
    fn late_notes(&self) -> Vec<String> {
        Vec::new()
    }

    /// Assumption that the positions and their times rest on, if there is one.
    fn assumed(&self) -> Option<String> {
        None
    }

    /// Returns the place in the file for the number in [`Row::place`].
    fn place(&self, number: u64) -> Place;

    /// Returns the index of the file that contains a row. Within one file the times of a vehicle must not decrease.
    fn file(&self, _number: u64) -> usize {
        0
    }

    /// Whether the file has one row for each time, so that time can only run forwards.
    fn is_wide(&self) -> bool {
        true
    }

    /// Reads all times and names. Returns `None` if there are no rows.
    fn survey(&mut self) -> Result<Option<Probe>, ReadError> {
        survey(self)
    }
}

/// Reads the times of all rows. Returns `None` if there are no rows.
fn survey<R: Rows + ?Sized>(rows: &mut R) -> Result<Option<Probe>, ReadError> {
    let mut probe: Option<Probe> = None;
    let mut batch = Vec::new();
    while rows.next(&mut batch)? {
        for row in batch.drain(..) {
            probe.get_or_insert_with(|| Probe::new(row.stamp)).see(row.stamp);
        }
    }
    Ok(probe)
}

/// Returns the properties of the times of these rows, or `None` if there are no rows.
pub(super) fn probe(rows: &[Row]) -> Option<Probe> {
    let mut probe = Probe::new(rows.first()?.stamp);
    for row in rows {
        probe.see(row.stamp);
    }
    Some(probe)
}

/// Refuses rows of one vehicle whose time decreases in the order of the file.
pub(super) fn refuse_steps_back(rows: &[Row], of: &impl Rows, timing: &Timing) -> Result<(), ReadError> {
    let mut last: Vec<Option<&Row>> = Vec::new();
    for row in rows {
        if row.vehicle >= last.len() {
            last.resize(row.vehicle + 1, None);
        }
        let Some(before) = last[row.vehicle].replace(row) else { continue };
        if row.stamp.compare(before.stamp).is_lt() && of.file(row.place) == of.file(before.place) {
            let name = quoted(of.vehicles().get(row.vehicle).map_or("", String::as_str));
            let (time_s, before_s) = (timing.seconds(row.stamp), timing.seconds(before.stamp));
            let problem = format!(
                "vehicle {name} goes back in time: {time_s} s comes after {before_s} s at {}",
                of.place(before.place)
            );
            let remedy = "look whether its clock was set; where the rows are of several vehicles, name the column that \
                          tells them apart with --column id=NAME; where they are only out of order, have them sorted \
                          with --sort";
            return Err(Fault::coded("recording/time-backwards", problem, remedy).at(of.place(row.place)));
        }
    }
    Ok(())
}
