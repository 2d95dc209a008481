//! Rows of a recording in the order of its file.

use nalgebra::Vector3;

use super::clock::{Probe, Stamp, Timing};
use super::error::{Fault, Place, ReadError, quoted};

/// Rows given out at a time.
pub(super) const BATCH: usize = 10_000;

/// A vehicle at an instant, as the file has it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row {
    /// When, in the unit of the file.
    pub(super) stamp: Stamp,
    /// Where in the file: see [`Rows::place`].
    pub(super) place: u64,
    pub(super) vehicle: usize,
    pub(super) position: Vector3<f64>,
    pub(super) velocity: Option<Vector3<f64>>,
    pub(super) radius: Option<f64>,
}

/// A recording that holds samples, row by row.
pub(super) trait Rows {
    /// Appends some [`BATCH`] rows in the order of the file; `false` when there was none to append.
    fn next(&mut self, rows: &mut Vec<Row>) -> Result<bool, ReadError>;

    /// Starts again with the first row. Nothing to do where time only runs forwards, so that rows are read once.
    fn rewind(&mut self) -> Result<(), ReadError> {
        Ok(())
    }

    /// Names of the vehicles met so far.
    fn vehicles(&self) -> &[String];

    /// Puts the names in their final order, once all have been met.
    fn settle_names(&mut self) {}

    /// What a person should know that shows as rows are read.
    fn notes(&self) -> Vec<String> {
        Vec::new()
    }

    /// What a person should know that shows once all rows have been read.
    fn late_notes(&self) -> Vec<String> {
        Vec::new()
    }

    /// What was assumed to know positions at their times, if anything was.
    fn assumed(&self) -> Option<String> {
        None
    }

    /// The place that a row's number means.
    fn place(&self, number: u64) -> Place;

    /// The file that a row is in, of a recording in several files: within one, rows of a vehicle do not go back in time.
    fn file(&self, _number: u64) -> usize {
        0
    }

    /// Whether each time is a row of the file, so that time can only run forwards.
    fn is_wide(&self) -> bool {
        true
    }

    /// Looks at all times and names; none where there are no rows.
    fn survey(&mut self) -> Result<Option<Probe>, ReadError> {
        survey(self)
    }
}

/// Looks at all times by reading all rows.
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

/// What the times of these rows look like; none where there are no rows.
pub(super) fn probe(rows: &[Row]) -> Option<Probe> {
    let mut probe = Probe::new(rows.first()?.stamp);
    for row in rows {
        probe.see(row.stamp);
    }
    Some(probe)
}

/// Refuses rows of a vehicle that go back in time, in the order of the file.
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
            return Err(Fault::content(problem, remedy).at(of.place(row.place)));
        }
    }
    Ok(())
}
