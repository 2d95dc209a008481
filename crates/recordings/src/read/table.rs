//! Reads tables row by row, and their cells as numbers, times and names.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use tautline_core::fact::{Fact, FactKind, Source};
use tautline_core::option::{COLUMN, FPS, TIME_SCALE, TIME_UNIT};

use super::agreement::FrameAgreement;
use super::aviation::ClimbMonitor;
use super::axes::Axes;
use super::cells::{Cells, empty, number, odd_number, vector};
use super::clock::{Date, Probe, Stamp};
use super::earth::{EarthFrame, is_no_fix, no_fixes};
use super::error::{ContentKind, Fault, Place, ReadError, list, quoted, refuse};
use super::identity::{AlternativeId, Names, SuspectColumn, SwapMonitor};
use super::layout::{Layout, VehicleColumns};
use super::local_origin::{convert_to_local, origin};
use super::options::ReadOptions;
use super::order::{BATCH, Findings, Ordered, Recording, RecordingInfo, Row, Rows, observe};
use super::source::Source as File;
use super::time_unit::TimeUnit;

/// Number of vehicles, from the first on, whose rows are examined for several vehicles under one name.
const MOST_SUSPECTED: usize = 256;

/// Long or wide table.
struct Table<C> {
    cells: C,
    options: ReadOptions,
    layout: Layout,
    names: Names,
    /// Frame that converts latitude, longitude and height to metres.
    local: Option<EarthFrame>,
    /// Frame of the last origin, if rows have their own origin.
    row_frame: Option<EarthFrame>,
    /// First time, if times are dates.
    dates: Option<Date>,
    /// Alternative vehicle columns.
    alternative_ids: Vec<AlternativeId>,
    /// For each vehicle, unused columns that may distinguish several vehicles among its rows.
    suspects: Vec<Vec<SuspectColumn>>,
    /// Quantities of a wide table whose values may be vehicle names.
    watches: Vec<SwapMonitor>,
    /// Number of positions whose vehicle is named by a column of a wide table.
    named: usize,
    /// Comparison of heights with a vertical rate.
    climb: Option<ClimbMonitor>,
    /// Comparison with a second position on the Earth, and the axes of the first one in metres.
    agreement: Option<(FrameAgreement, Axes)>,
    /// Number of rows omitted because they lack a coordinate.
    incomplete: u64,
    /// Number of time units per second, once known.
    per_second: f64,
    /// Number of rows without a fix, by vehicle.
    no_fixes: BTreeMap<usize, u64>,
    /// Vehicle of the last row.
    vehicle: usize,
    /// Number of rows before the current one.
    count: i64,
}

/// Opens a table with these cells; `unit` is the unit of times if the format defines it.
pub(super) fn open<C: Cells + 'static>(
    source: &File,
    mut cells: C,
    layout: Layout,
    unit: Option<TimeUnit>,
    epoch_ns: i64,
    options: &ReadOptions,
) -> Result<Recording, ReadError> {
    if let (Some(rest), Some(_)) = (layout.rest, unit) {
        let problem =
            format!("it has a column of time stamps and a second time column {}", quoted(&cells.header()[rest.column]));
        let remedy = format!("name one of them with {}", COLUMN.set("t=NAME"));
        return refuse(ContentKind::AmbiguousColumn, problem, remedy);
    }
    let dates = dates(&mut cells, &layout, options)?;
    let unit = if dates.is_some() { Some(TimeUnit::Nanoseconds) } else { unit.or(layout.unit) };
    let mut info = RecordingInfo::new(source, options, unit, layout.notes.clone(), Fault::header_only());
    if dates.is_some_and(|first| !first.has_zone) {
        info.metadata.notes.push("times are dates without a zone and are read as UTC".to_owned());
    }
    info.metadata.has_directions = layout.convention.has_directions();
    info.metadata.is_planar = layout.is_planar;
    let names = Names::from_list(layout.names.clone())?;
    let local = origin(&mut cells, &layout, options)?;
    info.metadata.notes.extend(local.map(|local| local.note()));
    info.metadata.earth_origin = local.map(|local| local.measured_from(options.origin));
    cells.restart(&layout.columns_to_observe(), true)?;
    // For places on the Earth the scale applies to heights only, and is part of the column factors.
    info.scale = if layout.on_earth { 1.0 } else { info.scale };
    info.is_unit_in_file = true;
    info.metadata.facts.extend(layout.facts.iter().cloned());
    info.metadata.facts.push(if layout.counts_from_boot {
        Fact::name(FactKind::Clock, Source::Default, "times since the start of each vehicle's computer")
    } else {
        Fact::name(FactKind::Clock, Source::Deduced, "one column")
    });
    let alternative_ids = layout.alternative_ids.iter().copied().map(AlternativeId::new).collect();
    let watches = layout.slots.watched.iter().cloned().map(SwapMonitor::new).collect();
    let climb = layout.rate.map(ClimbMonitor::new);
    let agreement = (!layout.compared.is_empty())
        .then(|| (FrameAgreement::default(), options.turn().scaled([options.metres(); 3])));
    let table = Table {
        climb,
        agreement,
        incomplete: 0,
        per_second: 1.0,
        cells,
        options: options.clone(),
        layout,
        names,
        local,
        row_frame: None,
        dates,
        alternative_ids,
        suspects: Vec::new(),
        watches,
        named: 0,
        no_fixes: BTreeMap::new(),
        vehicle: 0,
        count: 0,
    };
    Ok(Box::new(Ordered::open(table, RecordingInfo { epoch_ns, ..info })?))
}

/// Returns the first time of a table if it is a date.
fn dates<C: Cells>(cells: &mut C, layout: &Layout, options: &ReadOptions) -> Result<Option<Date>, ReadError> {
    let Some(column) = layout.time else { return Ok(None) };
    cells.restart(&[column], false)?;
    let first = if cells.advance()? { cells.text(column).ok().and_then(|text| Date::parse(&text)) } else { None };
    if first.is_some() && (options.time_unit.is_some() || options.times_per_second.is_some()) {
        let problem = format!("the times in column {} are dates", quoted(&cells.header()[column]));
        let remedy = format!("omit {TIME_UNIT}, {FPS} and {TIME_SCALE}");
        return refuse(ContentKind::ContradictsOption, problem, remedy);
    }
    Ok(first)
}

impl<C: Cells> Table<C> {
    #[inline]
    fn stamp(&mut self) -> Result<Stamp, Fault> {
        let Some(column) = self.layout.time else {
            return Ok(Stamp::Whole(self.count));
        };
        if let Some(first) = self.dates {
            return self.date(column, first);
        }
        let time = self.number_of_units(column)?;
        match self.layout.rest {
            None => Ok(time),
            Some(rest) => rest.join(time, self.number_of_units(rest.column)?, self.cells.header(), column),
        }
    }

    /// Returns the time in a numeric column.
    #[inline]
    fn number_of_units(&mut self, column: usize) -> Result<Stamp, Fault> {
        if let Some(stamp) = self.cells.stamp(column).filter(|stamp| stamp.approximately().is_finite()) {
            return Ok(stamp);
        }
        if let Some(of_day) = self.cells.text(column).ok().filter(|text| text.contains(':')) {
            let what = if Date::parse(&of_day).is_some() { "a date after numbers" } else { "a time of day" };
            let problem = format!("column `{}` holds {}, {what}", self.cells.header()[column], quoted(of_day.trim()));
            return refuse(
                ContentKind::TimeFormat,
                problem,
                "write all times as numbers in one unit (s, ms, us, ns), or all as dates with a time like \
                 2023-11-14T22:13:20.5Z",
            );
        }
        let number = odd_number(&self.cells, column, "remove the row: each row needs a time")?;
        number.map(Stamp::Real).ok_or_else(|| empty(&self.cells, column))
    }

    /// Returns the time in a column of dates.
    fn date(&self, column: usize, first: Date) -> Result<Stamp, Fault> {
        let text = self.cells.text(column)?;
        if text.trim().is_empty() {
            return Err(empty(&self.cells, column));
        }
        let holds = |what: &str, remedy: &str| {
            let problem = format!("column `{}` holds {}, {what}", self.cells.header()[column], quoted(text.trim()));
            Fault::content(ContentKind::TimeFormat, problem, remedy)
        };
        match Date::parse(&text) {
            Some(date) if date.has_zone == first.has_zone => Ok(Stamp::Whole(date.since_1970_ns)),
            Some(_) => Err(holds("but other dates differ in the zone", "write the zone in all rows or in none")),
            None => Err(holds("which is not a date with a time", "write it like 2023-11-14T22:13:20.5Z")),
        }
    }

    #[inline]
    fn vehicle(&mut self, id: usize) -> Result<usize, Fault> {
        // Most files list vehicles in turn.
        let (next, name) = self.names.after(self.vehicle);
        if !name.is_empty() && self.cells.has_name(id, name) {
            self.vehicle = next;
            return Ok(next);
        }
        let name = self.cells.name(id)?;
        let name = name.trim();
        if name.is_empty() {
            return Err(empty(&self.cells, id));
        }
        self.vehicle = self.names.index(name)?;
        Ok(self.vehicle)
    }

    /// Appends the positions of the current row.
    #[inline]
    fn append(&mut self, rows: &mut Vec<Row>) -> Result<(), Fault> {
        let stamp = self.stamp()?;
        let first = self.layout.id.map_or(Ok(0), |id| self.vehicle(id))?;
        for place in 0..self.layout.bodies.len() {
            let body = &self.layout.bodies[place];
            if self.options.skip_incomplete && is_incomplete(&self.cells, body) {
                self.incomplete += 1;
                continue;
            }
            let Some(mut row) = row(&self.cells, stamp, first + place, body, &self.layout.metres)? else { continue };
            if let Some(&id) = self.layout.slots.ids.get(place) {
                row.vehicle = self.vehicle(id)?;
                self.named += 1;
            }
            if self.layout.on_earth && is_no_fix(&row.position) {
                *self.no_fixes.entry(row.vehicle).or_default() += 1;
                continue;
            }
            self.compare(place, &row)?;
            if let Some(columns) = self.layout.convention.reference {
                let valid = &self.layout.convention.valid;
                if !convert_to_local(&self.cells, &mut row, (columns, valid), self.local, &mut self.row_frame)? {
                    continue;
                }
            } else if let Some(local) = &self.local {
                row.position = local.place(row.position)?;
            }
            if self.layout.is_planar {
                row.position.z = 0.0;
                row.velocity.iter_mut().for_each(|velocity| velocity.z = 0.0);
            }
            rows.push(row);
        }
        self.count += 1;
        for watch in &mut self.watches {
            let texts = watch.columns.iter().map(|&column| Ok(self.cells.text(column)?.trim().to_owned()));
            let texts = texts.collect::<Result<Vec<_>, Fault>>()?;
            watch.observe(texts, self.cells.header())?;
        }
        if !self.layout.suspects.is_empty() {
            self.suspect(rows.last().filter(|row| row.place == self.cells.row()).copied())?;
        }
        Ok(())
    }

    /// Compares a position with the vertical rate and the second position of its row.
    #[inline]
    fn compare(&mut self, place: usize, row: &Row) -> Result<(), Fault> {
        if let Some(climb) = &mut self.climb
            && let Some(rate) = self.cells.number(climb.column).filter(|rate| rate.is_finite())
        {
            climb.observe(row.vehicle, row.stamp, row.position.z, rate);
        }
        let Some((agreement, axes)) = &mut self.agreement else { return Ok(()) };
        let Some(Some(compared)) = self.layout.compared.get(place) else { return Ok(()) };
        let mut there = Vector3::zeros();
        let mut has_heights = false;
        for (axis, (column, unit)) in compared.earth.iter().zip(compared.units).enumerate() {
            let Some(column) = *column else { continue };
            match self.cells.number(column).filter(|number| number.is_finite()) {
                Some(number) => (there[axis], has_heights) = (number * unit, axis == 2),
                // Without a height, the plane is still compared.
                None if axis == 2 => {}
                None => return Ok(()),
            }
        }
        if is_no_fix(&there) {
            return Ok(());
        }
        agreement.observe(row.vehicle, axes.turn(row.position), there, has_heights).map_err(|found| {
            let name = self.names.all().get(row.vehicle).map_or("", String::as_str);
            compared.fault_of_row(self.cells.header(), name, &found)
        })
    }

    /// Returns the fault of heights that contradict the vertical rate.
    fn contradicting_rate(&self) -> Option<Fault> {
        let height = self.layout.bodies.first().and_then(|body| body.position[2])?;
        self.climb.as_ref()?.fault(self.per_second, self.cells.header(), height)
    }

    /// Examines the unused columns in a row of a vehicle.
    fn suspect(&mut self, row: Option<Row>) -> Result<(), Fault> {
        let Some(row) = row.filter(|row| row.vehicle < MOST_SUSPECTED) else { return Ok(()) };
        while self.suspects.len() <= row.vehicle {
            self.suspects.push(self.layout.suspects.iter().copied().map(SuspectColumn::new).collect());
        }
        let suspects = &mut self.suspects[row.vehicle];
        for suspect in suspects.iter_mut() {
            let value = self.cells.text(suspect.column)?;
            suspect.observe(value.trim(), row.stamp.approximately(), row.position);
        }
        suspects.retain(|suspect| !suspect.cleared);
        Ok(())
    }

    /// Returns the fault of a vehicle whose rows look like those of several vehicles.
    fn several_vehicles_fault(&self) -> Option<Fault> {
        let header = self.cells.header();
        if let Some(&column) = self.layout.slots.ids.first().filter(|_| self.count > 2)
            && self.names.all().len() == self.named
        {
            let problem =
                format!("column {} has a different value in each row and so names no vehicle", quoted(&header[column]));
            return Some(Fault::content(
                ContentKind::AmbiguousVehicle,
                problem,
                "remove such columns if their values are not names",
            ));
        }
        let id = self.layout.id.filter(|_| self.names.all().len() > 1);
        self.suspects.iter().enumerate().find_map(|(vehicle, suspects)| {
            let named = id.map(|id| (&*self.names.all()[vehicle], &*header[id]));
            suspects.iter().find_map(|suspect| suspect.fault(&header[suspect.column], named))
        })
    }

    /// Refuses a vehicle column that numbers the rows, or two vehicle columns that contradict each other.
    fn check_names(&self, id: usize, rows: usize, is_one_instant: bool) -> Result<(), Fault> {
        let header = self.cells.header();
        let called = |column: usize| quoted(&header[column]);
        // Two rows at two times may belong to two vehicles.
        if rows > 2 && self.names.all().len() == rows && !is_one_instant && !self.layout.is_id_given {
            let others: Vec<_> =
                self.layout.alternative_ids.iter().chain(&self.layout.suspects).copied().map(called).collect();
            let others = if others.is_empty() {
                String::new()
            } else {
                format!("; the other columns are {}", others.join(", "))
            };
            let problem =
                format!("column {} has a different value in each row and so names no vehicle{others}", called(id));
            let column = COLUMN.set("id=NAME");
            let remedy = format!("name the column of the vehicle with {column}, or remove this one");
            return refuse(ContentKind::AmbiguousVehicle, problem, remedy);
        }
        if let Some(alternative) = self.alternative_ids.iter().find(|alternative| alternative.is_one()) {
            let (first, other) = (called(id), called(alternative.column));
            let problem =
                format!("the columns {first} and {other} could both name the vehicle, but contradict each other");
            let [first, other] = [id, alternative.column].map(|column| COLUMN.set(format!("id={}", header[column])));
            let remedy = format!("choose one with {first} or {other}");
            return refuse(ContentKind::AmbiguousVehicle, problem, remedy);
        }
        Ok(())
    }
}

/// Returns whether some cells of a position or velocity are empty, and others are not.
fn is_incomplete(cells: &impl Cells, body: &VehicleColumns) -> bool {
    let is_empty = |column: usize| cells.text(column).is_ok_and(|text| text.trim().is_empty());
    let are_mixed = |columns: [Option<usize>; 3]| {
        let mut empty = columns.into_iter().flatten().map(is_empty);
        let first = empty.next();
        empty.any(|other| Some(other) != first)
    };
    are_mixed(body.position) || body.velocity.is_some_and(are_mixed)
}

/// Returns the position of a vehicle in a row; `None` if the vehicle was not seen, and all its cells are empty.
#[inline]
fn row(
    cells: &impl Cells,
    stamp: Stamp,
    vehicle: usize,
    body: &VehicleColumns,
    metres: &[f64],
) -> Result<Option<Row>, Fault> {
    let Some(position) = vector(cells, &body.position, metres)? else { return Ok(None) };
    let velocity = body.velocity.as_ref().map(|columns| vector(cells, columns, metres)).transpose()?.flatten();
    let radius = match body.radius {
        Some(column) => number(cells, column)?.map(|radius| radius * metres[column]),
        None => None,
    };
    if let (Some(radius), Some(column)) = (radius.filter(|radius| *radius < 0.0), body.radius) {
        let problem = format!("column `{}` holds {radius}, a negative radius", cells.header()[column]);
        return refuse(ContentKind::Radius, problem, "write 0 or a positive number");
    }
    Ok(Some(Row { stamp, place: cells.row(), vehicle, position, velocity, radius }))
}

impl<C: Cells> Rows for Table<C> {
    fn next(&mut self, rows: &mut Vec<Row>) -> Result<bool, ReadError> {
        let before = rows.len();
        while rows.len() < before + BATCH {
            if !self.cells.advance()? {
                return self.several_vehicles_fault().map_or(Ok(rows.len() > before), |fault| Err(fault.into()));
            }
            self.append(rows).map_err(|fault| self.cells.fault(fault))?;
        }
        Ok(rows.len() > before)
    }

    fn rewind(&mut self) -> Result<(), ReadError> {
        self.count = 0;
        self.no_fixes.clear();
        self.suspects.clear();
        (self.named, self.incomplete) = (0, 0);
        self.climb.iter_mut().for_each(ClimbMonitor::rewind);
        self.agreement.iter_mut().for_each(|(agreement, _)| agreement.rewind());
        self.cells.restart(&self.layout.columns_to_observe(), true)
    }

    fn vehicles(&self) -> &[String] {
        self.names.all()
    }

    fn settle_names(&mut self) {
        self.names.settle();
    }

    /// Refuses heights or positions that contradict other columns of the table.
    fn late_findings(&self) -> Result<Findings, Fault> {
        let (mut notes, mut facts) = Findings::default();
        let vehicles = self.no_fixes.keys().filter_map(|&vehicle| self.names.all().get(vehicle));
        let vehicles = format!(" of {}", list(&vehicles.collect::<Vec<_>>(), 12));
        notes.extend(no_fixes(self.no_fixes.values().sum(), &vehicles));
        if self.incomplete > 0 {
            notes.push(format!("positions omitted because one of their coordinates is empty: {}", self.incomplete));
            facts.push(Fact::number(FactKind::Rows, Source::Declared, self.incomplete as f64, "incomplete"));
        }
        match self.contradicting_rate() {
            Some(fault) if self.options.scale.is_some() => {
                notes.push(format!("the given unit of heights is used, but {fault}"));
            }
            Some(fault) => return Err(fault),
            None => {}
        }
        if let Some((agreement, _)) = &self.agreement {
            let compared = self.layout.compared.iter().flatten().next();
            let fault = compared.and_then(|compared| agreement.fault(self.names.all(), self.cells.header(), compared));
            fault.map_or(Ok(()), Err)?;
            notes.extend(agreement.notes(self.names.all()));
            facts.push(agreement.fact());
        }
        Ok((notes, facts))
    }

    fn settle_clock(&mut self, per_second: f64) {
        self.per_second = per_second;
    }

    fn place(&self, number: u64) -> Place {
        self.cells.place(number)
    }

    fn is_wide(&self) -> bool {
        self.layout.id.is_none()
    }

    fn findings(&self) -> Findings {
        // After a survey all names of a long table are known.
        let is_assumed = self.layout.counts_from_boot && (self.options.is_joined || self.names.all().len() > 1);
        let start = is_assumed.then(|| Fact::new(FactKind::CommonStart, Source::Default));
        (Vec::new(), start.into_iter().collect())
    }

    /// Reads only times and names, which is several times faster.
    fn survey(&mut self) -> Result<Option<Probe>, ReadError> {
        let Some(id) = self.layout.id else { return Ok(None) };
        let mut columns: Vec<usize> = self.layout.time_columns().chain([id]).collect();
        columns.extend(&self.layout.alternative_ids);
        columns.sort_unstable();
        self.cells.restart(&columns, false)?;
        let mut probe = None;
        let (mut rows, mut first, mut is_one_instant) = (0, None, true);
        while self.cells.advance()? {
            let stamp = self.stamp().and_then(|stamp| self.vehicle(id).map(|_| stamp));
            let stamp = stamp.map_err(|fault| self.cells.fault(fault))?;
            observe(&mut probe, stamp, self.vehicle);
            rows += 1;
            is_one_instant &= *first.get_or_insert(stamp) == stamp;
            for alternative in &mut self.alternative_ids {
                let value = self.cells.text(alternative.column).map_err(|fault| self.cells.fault(fault))?;
                alternative.observe(self.vehicle, value.trim());
            }
        }
        self.check_names(id, rows, is_one_instant)?;
        Ok(probe)
    }
}
