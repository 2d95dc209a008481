//! Reads the rows of a recording in the order of the file and returns them in the order of time.

use std::path::PathBuf;

use nalgebra::Vector3;
use tautline_core::fact::{Fact, FactKind, Source};
use tautline_core::option::{COLUMN, DUPLICATES, TIME_UNIT};

use super::clock::{Probe, Stamp, Timing};
use super::error::{ContentKind, Fault, Place, ReadError, quoted};
use super::options::{Duplicates, ReadOptions};
use super::source::Source as File;
use super::time_unit::TimeUnit;
use tautline_core::track::{Item, Metadata, Plan, Sample, Tracks};

/// Longest step between two positions on the Earth that is accepted at any speed \[m\].
const LONGEST_JUMP_M: f64 = 1000.0;
/// Largest accepted speed of a longer step \[m/s\], above the escape velocity of the Earth.
const FASTEST_M_S: f64 = 12_000.0;

/// Consequence of an unknown height, for notes.
pub(super) const PLANAR: &str = "the recording is judged in the plane of x and y";

/// A recording being read.
pub type Recording = Box<dyn Tracks<Error = ReadError>>;

/// Properties of a recording besides its rows.
pub(super) struct RecordingInfo {
    pub(super) path: PathBuf,
    pub(super) options: ReadOptions,
    /// Unit of the times according to the file, if known. That of the user takes precedence.
    pub(super) unit: Option<TimeUnit>,
    /// Whether a column of the file gives the unit of the times; else the format defines it.
    pub(super) is_unit_in_file: bool,
    /// Epoch of the times according to the file \[ns\].
    pub(super) epoch_ns: i64,
    /// Metres per unit of length.
    pub(super) scale: f64,
    /// Metadata; the clock and the assumption are set while rows are read.
    pub(super) metadata: Metadata,
    /// Fault of a recording without rows.
    pub(super) none: Fault,
}

impl RecordingInfo {
    /// Returns the properties for these options; `unit` is the unit of times in the file.
    pub(super) fn new(
        source: &File,
        options: &ReadOptions,
        unit: Option<TimeUnit>,
        notes: Vec<String>,
        none: Fault,
    ) -> Self {
        let (path, scale, metadata) =
            (source.display_path(), options.metres(), Metadata { notes, ..Metadata::default() });
        let options = options.clone();
        Self { path, options, unit, is_unit_in_file: false, epoch_ns: 0, scale, metadata, none }
    }
}

/// Samples in order of time.
///
/// A recording with one row per time is streamed, and its time must not decrease. A recording with one row per vehicle
/// and time is surveyed first: it is streamed if time never decreases, else sorted in memory. The time of one vehicle
/// must not decrease: its clock was set, or two vehicles have one name. The option `sort` sorts such rows.
pub(super) struct Ordered<R> {
    info: RecordingInfo,
    rows: R,
    timing: Timing,
    /// Rows read but not yet returned.
    batch: std::vec::IntoIter<Row>,
    /// Whether all rows have been read.
    ended: bool,
    /// Whether all rows have been returned.
    finished: bool,
    /// Stamp and time of the last row.
    now: Option<(Stamp, f64)>,
    /// Last row of each vehicle, and its time.
    last: Vec<Option<(f64, Row)>>,
    /// Index of each vehicle's last sample in the current batch, where a later row may replace it.
    emitted: Vec<usize>,
    /// Number of rows omitted as duplicates in vehicle and time.
    left_out: u64,
}

impl<R: Rows> Ordered<R> {
    /// Reads the part of the recording that its order and its clock require.
    pub(super) fn open(mut rows: R, mut info: RecordingInfo) -> Result<Self, ReadError> {
        let (options, metadata) = (&info.options, &mut info.metadata);
        let sort = options.sort;
        let mut first = Vec::new();
        let mut ended = false;
        let mut probe = None;
        if rows.is_wide() {
            ended = !rows.next_batch(&mut first)?;
            while sort && !ended {
                ended = !rows.next_batch(&mut first)?;
            }
            for row in &first {
                observe(&mut probe, row.stamp, row.vehicle);
            }
            // Decreasing times are refused when they are reached, unless they are sorted.
            if let Some(probe) = &mut probe {
                probe.in_order |= !sort;
            }
        } else {
            probe = rows.survey()?;
        }
        let Some(probe) = probe else { return Err(info.none.into()) };
        let settled = || Timing::settle(&probe, options.time_unit.or(info.unit));
        let (mut timing, note) = options.times_per_second.map_or_else(settled, |rate| (Timing::given(rate), None));
        timing.clock.epoch_ns = timing.clock.epoch_ns.saturating_add(info.epoch_ns);
        metadata.notes.extend(note);
        // After a survey, notes and facts cover all rows.
        let (notes, facts) = rows.findings();
        metadata.notes.extend(notes);
        metadata.facts.extend(facts);
        if !rows.is_wide() {
            rows.settle_names();
            rows.rewind()?;
        }
        if !probe.in_order {
            while rows.next_batch(&mut first)? {}
            if !sort {
                refuse_steps_back(&first, &rows, &timing)?;
            }
            // The sort is stable: rows with the same time stay in the order of the file.
            first.sort_by(|a, b| a.stamp.compare(b.stamp));
            ended = true;
            metadata.notes.push("rows were not in order of time and were sorted".to_owned());
        }
        metadata.clock = timing.clock.clone();
        let source = if options.time_unit.is_some() || options.times_per_second.is_some() {
            Source::Declared
        } else if timing.clock.inferred {
            Source::Inferred
        } else if info.is_unit_in_file {
            Source::Deduced
        } else {
            Source::Convention
        };
        metadata.facts.push(match options.times_per_second {
            Some(rate) => Fact::number(FactKind::TimeUnit, source, rate.recip(), "s"),
            None => Fact::name(FactKind::TimeUnit, source, timing.clock.unit),
        });
        let batch = first.into_iter();
        Ok(Self {
            info,
            rows,
            timing,
            batch,
            ended,
            finished: false,
            now: None,
            last: Vec::new(),
            emitted: Vec::new(),
            left_out: 0,
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
            let problem = format!("time runs backwards: {time_s} s comes after {before} s");
            return Err(self.error(row, Fault::time_backwards(problem)));
        }
        self.now = Some((row.stamp, time_s));
        Ok(time_s)
    }

    /// Appends a row as a sample, unless it duplicates another one.
    fn emit(&mut self, row: &Row, items: &mut Vec<Item>) -> Result<(), ReadError> {
        let time_s = self.time_of(row)?;
        if row.vehicle >= self.last.len() {
            self.last.resize(row.vehicle + 1, None);
            self.emitted.resize(row.vehicle + 1, 0);
        }
        if let Some((before_s, before)) = self.last[row.vehicle] {
            if before_s == time_s {
                return self.repeat(row, &before, time_s, items);
            }
            if before.radius.is_some() != row.radius.is_some() {
                return Err(self.error(row, self.radius_fault(&before, row)));
            }
        }
        let sample = self.sample(row, time_s)?;
        if let Some((before_s, before)) = self.last[row.vehicle].filter(|_| self.info.metadata.earth_origin.is_some()) {
            let jump_m = (row.position - before.position).norm();
            if jump_m > LONGEST_JUMP_M && jump_m > FASTEST_M_S * self.timing.longest_s(time_s - before_s) {
                return Err(self.error(row, self.jump_fault(before_s, &before, jump_m, time_s)));
            }
        }
        self.last[row.vehicle] = Some((time_s, *row));
        self.emitted[row.vehicle] = items.len();
        items.push(Item::Sample(sample));
        Ok(())
    }

    /// Omits one of two rows of a vehicle at one time, or refuses the recording.
    #[cold]
    fn repeat(&mut self, row: &Row, before: &Row, time_s: f64, items: &mut [Item]) -> Result<(), ReadError> {
        let is_equal = (row.position, row.velocity, row.radius) == (before.position, before.velocity, before.radius);
        match self.info.options.duplicates.or(is_equal.then_some(Duplicates::First)) {
            Some(Duplicates::First) => {}
            Some(Duplicates::Last) => {
                let sample = self.sample(row, time_s)?;
                // The first row is in the same batch: see `continues_instant`.
                items[self.emitted[row.vehicle]] = Item::Sample(sample);
                self.last[row.vehicle] = Some((time_s, *row));
            }
            None | Some(Duplicates::Refuse) => return Err(self.error(row, self.duplicate_fault(time_s, before, row))),
        }
        self.left_out += 1;
        Ok(())
    }

    fn sample(&self, row: &Row, time_s: f64) -> Result<Sample, ReadError> {
        let sample = Sample {
            vehicle: row.vehicle,
            time_s,
            position_m: row.position * self.info.scale,
            velocity_m_s: row.velocity.map(|velocity| velocity * self.info.scale),
            radius_m: row.radius.map(|radius| radius * self.info.scale),
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

    fn name(&self, row: &Row) -> String {
        quoted(self.rows.vehicles().get(row.vehicle).map_or("", String::as_str))
    }

    #[cold]
    fn duplicate_fault(&self, time_s: f64, before: &Row, row: &Row) -> Fault {
        let (vehicle, first) = (self.name(row), self.rows.place(before.place));
        let problem = format!("vehicle {vehicle} has a second row at {time_s} s; the first is at {first}");
        let remedy = format!(
            "remove one of the two, or choose one with {} or {}; if the rows belong to several vehicles, name their \
             column with {}",
            DUPLICATES.set("first"),
            DUPLICATES.set("last"),
            COLUMN.set("id=NAME")
        );
        Fault::content(ContentKind::DuplicateRow, problem, remedy)
    }

    #[cold]
    fn jump_fault(&self, before_s: f64, before: &Row, jump_m: f64, time_s: f64) -> Fault {
        let (vehicle, first) = (self.name(before), self.rows.place(before.place));
        let (jump_km, within_s) = (jump_m / 1e3, time_s - before_s);
        let problem =
            format!("vehicle {vehicle} jumps {jump_km:.0} km in {within_s:.3} s; its previous position is at {first}");
        let remedy = format!(
            "leave latitude and longitude empty where the receiver had no fix, or correct the unit of the times with \
             {TIME_UNIT}"
        );
        Fault::content(ContentKind::PositionJump, problem, remedy)
    }

    #[cold]
    fn radius_fault(&self, before: &Row, row: &Row) -> Fault {
        let (vehicle, first) = (self.name(row), self.rows.place(before.place));
        let which = if row.radius.is_some() { "a radius here, but none" } else { "no radius here, but one" };
        let remedy = "fill the empty cells, or leave all radii of the vehicle empty";
        Fault::content(ContentKind::Radius, format!("vehicle {vehicle} has {which} at {first}"), remedy)
    }

    /// Returns the next row without consuming it.
    fn peek(&mut self) -> Result<Option<&Row>, ReadError> {
        if self.batch.len() == 0 && !self.ended {
            let mut batch = Vec::with_capacity(BATCH);
            self.ended = !self.rows.next_batch(&mut batch)?;
            self.batch = batch.into_iter();
        }
        Ok(self.batch.as_slice().first())
    }

    /// Returns whether the next row has the time of the last one.
    fn continues_instant(&mut self) -> Result<bool, ReadError> {
        let Some((_, now_s)) = self.now else { return Ok(false) };
        let next = self.peek()?.map(|row| row.stamp);
        Ok(next.is_some_and(|stamp| self.timing.seconds(stamp) == now_s))
    }

    fn try_read(&mut self, items: &mut Vec<Item>) -> Result<bool, ReadError> {
        let before = items.len();
        let waits = self.info.options.duplicates == Some(Duplicates::Last);
        while items.len() < before + BATCH || (waits && self.continues_instant()?) {
            let Some(&row) = self.peek()? else { break };
            self.batch.next();
            self.emit(&row, items)?;
        }
        if items.len() == before && self.left_out > 0 {
            let rows = std::mem::take(&mut self.left_out);
            let which = if waits { "a later" } else { "an earlier" };
            self.info
                .metadata
                .notes
                .push(format!("rows omitted because {which} row of the vehicle has the same time: {rows}"));
        }
        if items.len() == before && !self.finished {
            self.finished = true;
            let (notes, facts) = self.rows.late_findings(self.timing.per_second)?;
            self.info.metadata.notes.extend(notes);
            self.info.metadata.facts.extend(facts);
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
        self.try_read(items).map_err(|fault| fault.of(&self.info.path))
    }

    fn metadata(&self) -> &Metadata {
        &self.info.metadata
    }

    fn plans(&self) -> &[Plan] {
        &[]
    }
}

/// Number of rows read at once.
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

/// Notes for the user, and facts.
pub(super) type Findings = (Vec<String>, Vec<Fact>);

/// Reader of a recording that yields samples row by row.
pub(super) trait Rows {
    /// Appends the rows of the next part of the file: a line, an instant or a message. Returns `false` after the last
    /// part.
    fn next(&mut self, rows: &mut Vec<Row>) -> Result<bool, ReadError>;

    /// Appends about [`BATCH`] rows in the order of the file. Returns `false` if no row was left.
    fn next_batch(&mut self, rows: &mut Vec<Row>) -> Result<bool, ReadError> {
        let before = rows.len();
        while rows.len() < before + BATCH && self.next(rows)? {}
        Ok(rows.len() > before)
    }

    /// Restarts at the first row. A reader whose time only runs forwards is read once and need not implement this.
    fn rewind(&mut self) -> Result<(), ReadError> {
        Ok(())
    }

    /// Names of the vehicles read so far.
    fn vehicles(&self) -> &[String];

    /// Puts the names in their final order after all of them have been read.
    fn settle_names(&mut self) {}

    /// Notes for the user and facts that are known before the first row is returned.
    fn findings(&self) -> Findings {
        Findings::default()
    }

    /// Notes and facts that are known after all rows have been read, or the fault that the rows show together.
    /// `per_second` is the number of time units per second.
    fn late_findings(&self, _per_second: f64) -> Result<Findings, Fault> {
        Ok(Findings::default())
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
        let (mut probe, mut batch) = (None, Vec::new());
        while self.next_batch(&mut batch)? {
            batch.drain(..).for_each(|row| observe(&mut probe, row.stamp, row.vehicle));
        }
        Ok(probe)
    }
}

/// Records the time of a row.
pub(super) fn observe(probe: &mut Option<Probe>, stamp: Stamp, vehicle: usize) {
    probe.get_or_insert_with(|| Probe::new(stamp)).observe(stamp, vehicle);
}

/// Refuses rows of one vehicle whose time decreases in the order of the file.
pub(super) fn refuse_steps_back(rows: &[Row], source: &impl Rows, timing: &Timing) -> Result<(), ReadError> {
    let mut last: Vec<Option<&Row>> = Vec::new();
    for row in rows {
        if row.vehicle >= last.len() {
            last.resize(row.vehicle + 1, None);
        }
        let Some(before) = last[row.vehicle].replace(row) else { continue };
        if row.stamp.compare(before.stamp).is_lt() && source.file(row.place) == source.file(before.place) {
            let name = quoted(source.vehicles().get(row.vehicle).map_or("", String::as_str));
            let (time_s, before_s) = (timing.seconds(row.stamp), timing.seconds(before.stamp));
            let problem = format!(
                "vehicle {name} goes back in time: {time_s} s comes after {before_s} s at {}",
                source.place(before.place)
            );
            return Err(Fault::time_backwards(problem).at(source.place(row.place)));
        }
    }
    Ok(())
}
