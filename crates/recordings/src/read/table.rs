//! Reads tables row by row, and their cells as numbers, times and names.

use nalgebra::Vector3;
use tautline_core::fact::{Fact, FactKind, Source};
use tautline_core::option::{COLUMN, FPS, ORIGIN, TIME_SCALE, TIME_UNIT};

use super::cells::{Cells, number, odd_number, vector};
use super::clock::{Date, Probe, Stamp};
use super::convention::{self, GLOBAL};
use super::earth::{EarthFrame, Geodetic, is_no_fix};
use super::error::{ContentKind, Fault, Place, ReadError, quoted, refuse};
use super::evidence::Evidence;
use super::identity::Names;
use super::layout::{Layout, VehicleColumns};
use super::options::ReadOptions;
use super::order::{Findings, Ordered, Recording, RecordingInfo, Row, Rows, observe};
use super::source::Source as File;
use super::time_unit::TimeUnit;

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
    evidence: Evidence,
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
    let table = Table {
        evidence: Evidence::new(&layout, options),
        cells,
        options: options.clone(),
        layout,
        names,
        local,
        row_frame: local,
        dates,
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
        number.map(Stamp::Real).ok_or_else(|| Fault::empty_cell(&self.cells.header()[column]))
    }

    /// Returns the time in a column of dates.
    fn date(&self, column: usize, first: Date) -> Result<Stamp, Fault> {
        let text = self.cells.text(column)?;
        if text.trim().is_empty() {
            return Err(Fault::empty_cell(&self.cells.header()[column]));
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
            return Err(Fault::empty_cell(&self.cells.header()[id]));
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
                self.evidence.incomplete += 1;
                continue;
            }
            let Some(mut row) = row(&self.cells, stamp, first + place, body, &self.layout.metres)? else { continue };
            if let Some(&id) = self.layout.slots.ids.get(place) {
                row.vehicle = self.vehicle(id)?;
                self.evidence.named += 1;
            }
            if self.layout.on_earth && self.evidence.lacks_fix(&row) {
                continue;
            }
            self.evidence.compare(&self.cells, &self.layout, place, &row, self.names.all())?;
            if let Some(columns) = self.layout.convention.reference {
                let valid = &self.layout.convention.valid;
                if !convert_to_local(&self.cells, &mut row, (columns, valid), self.local.zip(self.row_frame.as_mut()))?
                {
                    continue;
                }
            } else if let Some(local) = &self.local {
                row.position = local.place(row.position)?;
            }
            rows.push(row);
        }
        self.count += 1;
        self.evidence.examine(&self.cells, &self.layout, rows.last())
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
    #[inline]
    fn next(&mut self, rows: &mut Vec<Row>) -> Result<bool, ReadError> {
        if self.cells.advance()? {
            return self.append(rows).map(|()| true).map_err(|fault| self.cells.fault(fault));
        }
        let (header, names) = (self.cells.header(), self.names.all());
        self.evidence.check_vehicles(header, &self.layout, names, self.count)?;
        Ok(false)
    }

    fn rewind(&mut self) -> Result<(), ReadError> {
        self.count = 0;
        self.evidence = Evidence::new(&self.layout, &self.options);
        self.cells.restart(&self.layout.columns_to_observe(), true)
    }

    fn vehicles(&self) -> &[String] {
        self.names.all()
    }

    fn settle_names(&mut self) {
        self.names.settle();
    }

    fn late_findings(&self, per_second: f64) -> Result<Findings, Fault> {
        let (header, names) = (self.cells.header(), self.names.all());
        self.evidence.findings(header, &self.layout, &self.options, names, per_second)
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
        while self.cells.advance()? {
            let stamp = self.stamp().and_then(|stamp| {
                let vehicle = self.vehicle(id)?;
                self.evidence.compare_names(&self.cells, vehicle).map(|()| stamp)
            });
            let stamp = stamp.map_err(|fault| self.cells.fault(fault))?;
            observe(&mut probe, stamp, self.vehicle);
        }
        if let Some(probe) = &probe {
            self.evidence.check_names(self.cells.header(), &self.layout, id, self.names.all().len(), probe)?;
        }
        Ok(probe)
    }
}

/// Returns the frame of a table with places on the Earth: of the user's origin, or of the first place of the table.
fn origin(cells: &mut impl Cells, layout: &Layout, options: &ReadOptions) -> Result<Option<EarthFrame>, ReadError> {
    let reference = layout.convention.reference;
    if !layout.on_earth && reference.is_none() {
        let needless = Fault::content(
            ContentKind::UnusedOption,
            "it has no columns of latitude and longitude",
            format!("omit {ORIGIN}"),
        );
        return if options.origin.is_some() { Err(needless.into()) } else { Ok(None) };
    }
    convention::refuse_known(options, "a table of latitudes and longitudes")?;
    cells.restart(&layout.columns(), true)?;
    let mut unfixed = false;
    while cells.advance()? {
        let place = match reference {
            Some(columns) => measured_from(cells, columns),
            None => fix(cells, layout, &mut unfixed),
        };
        let at_row = |fault| cells.fault(fault);
        if let Some(place) = place.map_err(at_row)? {
            return Ok(Some(EarthFrame::first(place, options).map_err(at_row)?));
        }
    }
    if reference.is_some() {
        let problem = "no row has the origin of its positions (`ref_lat`, `ref_lon`)";
        return refuse(ContentKind::NoFix, problem, GLOBAL);
    }
    if unfixed {
        let problem = "no row has a fix: all latitudes and longitudes are exactly 0";
        return refuse(ContentKind::NoFix, problem, "record again with a fix, or give another file");
    }
    Ok(None)
}

/// Returns the origin of the positions in a row; `None` if a cell is empty or NaN, or latitude and longitude are 0.
fn measured_from(cells: &impl Cells, columns: [usize; 3]) -> Result<Option<Geodetic>, Fault> {
    let mut place = Vector3::zeros();
    for (slot, column) in place.iter_mut().zip(columns) {
        match cells.number(column) {
            Some(number) if number.is_nan() => return Ok(None),
            _ => match number(cells, column)? {
                Some(number) => *slot = number,
                None => return Ok(None),
            },
        }
    }
    Ok(Some(place).filter(|place| !is_no_fix(place)))
}

/// Returns the first place on the Earth in a row, if there is one. Sets `unfixed` for a place without a fix.
fn fix(cells: &impl Cells, layout: &Layout, unfixed: &mut bool) -> Result<Option<Geodetic>, Fault> {
    for body in &layout.bodies {
        match vector(cells, &body.position, &layout.metres)? {
            Some(place) if is_no_fix(&place) => *unfixed = true,
            None => {}
            place => return Ok(place),
        }
    }
    Ok(None)
}

/// Converts a position with an origin in its row to the first of `frames`; returns `false` if the origin is unknown or
/// a validity column is 0. The second of `frames` is that of the last origin.
fn convert_to_local(
    cells: &impl Cells,
    row: &mut Row,
    (columns, valid): ([usize; 3], &[usize]),
    frames: Option<(EarthFrame, &mut EarthFrame)>,
) -> Result<bool, Fault> {
    for &column in valid {
        if matches!(cells.text(column)?.trim(), "0" | "0.0" | "false" | "False") {
            return Ok(false);
        }
    }
    let Some((place, (local, row_frame))) = measured_from(cells, columns)?.zip(frames) else { return Ok(false) };
    row_frame.move_to(place)?;
    row.position = local.position_from(row_frame, row.position);
    row.velocity = row.velocity.map(|velocity| local.direction_from(row_frame, velocity));
    Ok(true)
}
