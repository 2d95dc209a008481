//! Rows of a recording in the order of its file, given out in the order of time.

use std::path::PathBuf;

use nalgebra::Vector3;

use super::clock::{Probe, Stamp, TimeUnit, Timing};
use super::error::{Fault, Place, ReadError, quoted};
use super::options::ReadOptions;
use super::source::Source;
use crate::track::{Clock, EarthOrigin, Item, Sample, Tracks};

/// Rows given out at a time.
pub(super) const BATCH: usize = 10_000;

/// What follows for a recording in which some height is not known.
pub(super) const PLANAR: &str = "the recording is judged in the plane of x and y";

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
pub(super) fn survey<R: Rows + ?Sized>(rows: &mut R) -> Result<Option<Probe>, ReadError> {
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
    /// The unit of its times, where it is known.
    pub(super) unit: Option<TimeUnit>,
    /// How many of them the user says to make a second.
    pub(super) times_per_second: Option<f64>,
    /// What the times are counted from, as the file says it \[ns\].
    pub(super) epoch_ns: i64,
    /// Metres per unit of length.
    pub(super) scale: f64,
    /// Whether its rows have no height.
    pub(super) is_planar: bool,
    /// What its places on the Earth are measured from.
    pub(super) earth_origin: Option<EarthOrigin>,
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
        let unit = options.time_unit.or(said);
        let (path, times_per_second) = (source.shown(), options.times_per_second);
        Self {
            path,
            unit,
            times_per_second,
            epoch_ns: 0,
            scale: options.scale,
            is_planar: false,
            earth_origin: None,
            notes,
            none,
        }
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
    assumed: Option<String>,
    is_planar: bool,
    earth_origin: Option<EarthOrigin>,
    scale: f64,
    /// Rows read that have not been given out.
    batch: std::vec::IntoIter<Row>,
    /// All rows have been read.
    ended: bool,
    /// All rows have been given out.
    finished: bool,
    /// Stamp and time of the last row.
    now: Option<(Stamp, f64)>,
    /// Time of each vehicle's last row, and the row.
    last: Vec<Option<(f64, Row)>>,
}

impl<R: Rows> Ordered<R> {
    /// Looks at the recording as far as its order and its clock need.
    pub(super) fn open(mut rows: R, about: About) -> Result<Self, ReadError> {
        let About { path, unit, times_per_second, epoch_ns, scale, is_planar, earth_origin, mut notes, none } = about;
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
        let settled = || Timing::settle(&probe, unit);
        let (mut timing, note) = times_per_second.map_or_else(settled, |rate| (Timing::given(rate), None));
        timing.clock.epoch_ns = timing.clock.epoch_ns.saturating_add(epoch_ns);
        notes.extend(note);
        // What is known by now of all rows, where they were surveyed.
        let assumed = rows.assumed();
        notes.extend(rows.notes());
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
        let batch = first.into_iter();
        Ok(Self {
            path,
            rows,
            timing,
            notes,
            assumed,
            is_planar,
            earth_origin,
            scale,
            batch,
            ended,
            finished: false,
            now: None,
            last: Vec::new(),
        })
    }

    fn error(&self, row: &Row, fault: Fault) -> ReadError {
        fault.at(self.rows.place(row.place))
    }

    fn time_of(&mut self, row: &Row) -> Result<f64, ReadError> {
        let before = match self.now {
            Some((stamp, time_s)) if stamp == row.stamp => return Ok(time_s),
            Some((_, time_s)) => time_s,
            None => f64::NEG_INFINITY,
        };
        let time_s = self.timing.seconds(row.stamp);
        if time_s < before {
            return Err(self.error(row, Fault::time_backwards(time_s, before)));
        }
        self.now = Some((row.stamp, time_s));
        Ok(time_s)
    }

    fn sample(&mut self, row: &Row) -> Result<Sample, ReadError> {
        let time_s = self.time_of(row)?;
        if row.vehicle >= self.last.len() {
            self.last.resize(row.vehicle + 1, None);
        }
        if let Some((before_s, before)) = self.last[row.vehicle].replace((time_s, *row))
            && (before_s == time_s || before.radius.is_some() != row.radius.is_some())
        {
            return Err(self.error(row, self.contradiction(before_s == time_s, time_s, &before, row)));
        }
        let sample = Sample {
            vehicle: row.vehicle,
            time_s,
            position_m: row.position * self.scale,
            velocity_m_s: row.velocity.map(|velocity| velocity * self.scale),
            radius_m: row.radius.map(|radius| radius * self.scale),
        };
        let finite = |v: &Vector3<f64>| v.iter().all(|x| x.is_finite());
        if time_s.is_finite()
            && finite(&sample.position_m)
            && sample.velocity_m_s.as_ref().is_none_or(finite)
            && sample.radius_m.is_none_or(f64::is_finite)
        {
            return Ok(sample);
        }
        Err(self.error(row, Fault::out_of_range()))
    }

    /// What a row of a vehicle says against its row before: it is there twice, or has a radius in one of them alone.
    #[cold]
    fn contradiction(&self, twice: bool, time_s: f64, before: &Row, row: &Row) -> Fault {
        let vehicle = quoted(self.rows.vehicles().get(row.vehicle).map_or("", String::as_str));
        let first = self.rows.place(before.place);
        if twice {
            let problem = format!("vehicle {vehicle} is there a second time at {time_s} s; the first is {first}");
            return Fault::content(problem, "take one of the two out: a vehicle is in one place at a time");
        }
        let which = if row.radius.is_some() { "a radius here and none" } else { "no radius here and one" };
        let remedy = "fill the empty cells, or leave all radii of the vehicle empty";
        Fault::content(format!("vehicle {vehicle} has {which} at {first}"), remedy)
    }

    fn try_read(&mut self, items: &mut Vec<Item>) -> Result<bool, ReadError> {
        if self.batch.len() == 0 && !self.ended {
            let mut batch = Vec::with_capacity(BATCH);
            self.ended = !self.rows.next(&mut batch)?;
            self.batch = batch.into_iter();
        }
        let before = items.len();
        while items.len() < before + BATCH
            && let Some(row) = self.batch.next()
        {
            items.push(Item::Sample(self.sample(&row)?));
        }
        if items.len() == before && !self.finished {
            self.finished = true;
            self.notes.extend(self.rows.late_notes());
        }
        Ok(items.len() > before)
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

    fn assumed(&self) -> Option<&str> {
        self.assumed.as_deref()
    }

    fn is_planar(&self) -> bool {
        self.is_planar
    }

    fn earth_origin(&self) -> Option<&EarthOrigin> {
        self.earth_origin.as_ref()
    }
}
