//! Rows of a recording in the order of its file, given out in the order of time.

use std::path::PathBuf;

use nalgebra::Vector3;

use super::clock::{KnownUnit, Probe, Stamp, TimeUnit, Timing};
use super::error::{Fault, FaultAt, Place, ReadError, quoted};
use super::options::ReadOptions;
use super::source::Source;
use crate::track::{Clock, Item, Sample, Tracks};

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
    fn next(&mut self, rows: &mut Vec<Row>) -> Result<bool, FaultAt>;

    /// Starts again with the first row. Nothing to do where time only runs forwards, so that rows are read once.
    fn rewind(&mut self) -> Result<(), FaultAt> {
        Ok(())
    }

    /// Names of the vehicles met so far.
    fn vehicles(&self) -> &[String];

    /// Puts the names in their final order, once all have been met.
    fn settle_names(&mut self) {}

    /// The place that a row's number means.
    fn place(&self, number: u64) -> Place;

    /// Whether each time is a row of the file, so that time can only run forwards.
    fn is_wide(&self) -> bool {
        true
    }

    /// Looks at all times and names; none where there are no rows.
    fn survey(&mut self) -> Result<Option<Probe>, FaultAt> {
        survey(self)
    }
}

/// Looks at all times by reading all rows.
pub(super) fn survey<R: Rows + ?Sized>(rows: &mut R) -> Result<Option<Probe>, FaultAt> {
    let mut probe: Option<Probe> = None;
    let mut batch = Vec::new();
    while rows.next(&mut batch)? {
        for row in batch.drain(..) {
            probe.get_or_insert_with(|| Probe::new(row.stamp)).see(row.stamp);
        }
    }
    Ok(probe)
}

/// A recording being read.
pub type Recording = Box<dyn Tracks<Error = ReadError>>;

/// What is known of a recording beside its rows.
pub(super) struct About {
    pub(super) path: PathBuf,
    pub(super) unit: KnownUnit,
    /// What the times are counted from, as the file says it \[ns\].
    pub(super) epoch_ns: i64,
    /// Metres per unit of length.
    pub(super) scale: f64,
    pub(super) notes: Vec<String>,
    /// The fault of a recording without rows.
    pub(super) none: Fault,
}

impl About {
    /// What the user says of the unit of time goes before what the file says.
    pub(super) fn new(
        source: &Source,
        options: &ReadOptions,
        said: Option<TimeUnit>,
        notes: Vec<String>,
        none: Fault,
    ) -> Self {
        let unit = options.time_unit.or(said).map_or(KnownUnit::Unsaid, KnownUnit::Given);
        Self { path: source.path.clone(), unit, epoch_ns: 0, scale: options.scale, notes, none }
    }
}

/// Samples in order of time.
///
/// A recording with a row for each time is streamed, and must not run backwards. One with a row for each vehicle and
/// time is surveyed first: it is streamed where time never runs backwards, and sorted in memory where it does.
pub(super) struct Ordered<R> {
    path: PathBuf,
    rows: R,
    timing: Timing,
    notes: Vec<String>,
    scale: f64,
    /// Rows read, of which those before `given` have been given out.
    batch: Vec<Row>,
    given: usize,
    /// All rows have been read.
    ended: bool,
    /// Stamp and time of the last row.
    now: Option<(Stamp, f64)>,
    /// Time of each vehicle's last row, and the row.
    last: Vec<Option<(f64, Row)>>,
}

impl<R: Rows> Ordered<R> {
    /// Looks at the recording as far as its order and its clock need.
    pub(super) fn open(mut rows: R, about: About) -> Result<Self, FaultAt> {
        let About { path, unit, epoch_ns, scale, mut notes, none } = about;
        let mut first = Vec::new();
        let mut ended = false;
        let probe = if rows.is_wide() {
            ended = !rows.next(&mut first)?;
            first.first().map(|row| {
                let mut probe = Probe::new(row.stamp);
                for row in &first {
                    probe.see(row.stamp);
                }
                probe.in_order = true;
                probe
            })
        } else {
            rows.survey()?
        };
        let Some(probe) = probe else { return Err(none.into()) };
        let (mut timing, note) = Timing::settle(&probe, unit);
        timing.clock.epoch_ns = timing.clock.epoch_ns.saturating_add(epoch_ns);
        notes.extend(note);
        if !rows.is_wide() {
            rows.settle_names();
            rows.rewind()?;
        }
        if !probe.in_order {
            while rows.next(&mut first)? {}
            // Stable: rows of one time stay in the order of the file.
            first.sort_by(|a, b| a.stamp.compare(b.stamp));
            ended = true;
            notes.push("rows are not in order of time and were sorted".to_owned());
        }
        Ok(Self { path, rows, timing, notes, scale, batch: first, given: 0, ended, now: None, last: Vec::new() })
    }

    fn error(&self, row: &Row, fault: Fault) -> FaultAt {
        fault.at(self.rows.place(row.place))
    }

    fn time_of(&mut self, row: &Row) -> Result<f64, FaultAt> {
        let before = match self.now {
            Some((stamp, time_s)) if stamp == row.stamp => return Ok(time_s),
            Some((_, time_s)) => time_s,
            None => f64::NEG_INFINITY,
        };
        let time_s = self.timing.seconds(row.stamp);
        if time_s < before {
            return Err(self.error(row, Fault::TimeBackwards { time_s, before_s: before }));
        }
        self.now = Some((row.stamp, time_s));
        Ok(time_s)
    }

    fn sample(&mut self, row: &Row) -> Result<Sample, FaultAt> {
        let time_s = self.time_of(row)?;
        if row.vehicle >= self.last.len() {
            self.last.resize(row.vehicle + 1, None);
        }
        if let Some((before_s, before)) = self.last[row.vehicle].replace((time_s, *row)) {
            let vehicle = || self.rows.vehicles().get(row.vehicle).cloned().unwrap_or_default();
            let first = self.rows.place(before.place);
            let fault = if before_s == time_s {
                Some(Fault::Duplicate { vehicle: vehicle(), time_s, first })
            } else if before.radius.is_some() != row.radius.is_some() {
                let which = if row.radius.is_some() { "a radius here and none" } else { "no radius here and one" };
                let problem = format!("vehicle {} has {which} at {first}", quoted(&vehicle()));
                Some(Fault::content(problem, "fill the empty cells, or leave all radii of the vehicle empty"))
            } else {
                None
            };
            if let Some(fault) = fault {
                return Err(self.error(row, fault));
            }
        }
        let sample = Sample {
            vehicle: row.vehicle,
            time_s,
            position_m: row.position * self.scale,
            velocity_m_s: row.velocity.map(|velocity| velocity * self.scale),
            radius_m: row.radius.map(|radius| radius * self.scale),
        };
        let finite = |v: &Vector3<f64>| v.iter().all(|x| x.is_finite());
        if time_s.is_finite() && finite(&sample.position_m) && sample.velocity_m_s.as_ref().is_none_or(finite) {
            return Ok(sample);
        }
        let remedy = "look at --scale and at the numbers themselves";
        Err(self.error(row, Fault::content("its numbers leave the range of numbers", remedy)))
    }

    fn try_read(&mut self, items: &mut Vec<Item>) -> Result<bool, FaultAt> {
        if self.given == self.batch.len() && !self.ended {
            self.batch.clear();
            self.given = 0;
            self.ended = !self.rows.next(&mut self.batch)?;
        }
        let end = self.batch.len().min(self.given + BATCH);
        let count = end - self.given;
        items.reserve(count);
        while self.given < end {
            let row = self.batch[self.given];
            items.push(Item::Sample(self.sample(&row)?));
            self.given += 1;
        }
        Ok(count > 0)
    }
}

impl<R: Rows> Tracks for Ordered<R> {
    type Error = ReadError;

    fn vehicles(&self) -> &[String] {
        self.rows.vehicles()
    }

    fn read(&mut self, items: &mut Vec<Item>) -> Result<bool, ReadError> {
        self.try_read(items).map_err(|fault| fault.of(&self.path))
    }

    fn clock(&self) -> &Clock {
        &self.timing.clock
    }

    fn notes(&self) -> &[String] {
        &self.notes
    }
}
