//! Evidence in the rows of a table against its reading, weighed in one place.
//!
//! Columns may name other vehicles, heights may contradict a vertical rate, and metres may contradict degrees.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use tautline_core::fact::{Fact, FactKind, Source};
use tautline_core::option::COLUMN;

use super::agreement::FrameAgreement;
use super::aviation::ClimbMonitor;
use super::axes::Axes;
use super::cells::Cells;
use super::clock::Probe;
use super::earth::{is_no_fix, no_fixes};
use super::error::{ContentKind, Fault, list, quoted, refuse};
use super::identity::{AlternativeId, SuspectColumn, SwapMonitor};
use super::layout::Layout;
use super::options::ReadOptions;
use super::order::{Findings, Row};

/// Number of vehicles, from the first on, whose rows are examined for several vehicles under one name.
const MOST_SUSPECTED: usize = 256;

/// Evidence in the rows up to now.
pub(super) struct Evidence {
    /// Alternative vehicle columns.
    alternative_ids: Vec<AlternativeId>,
    /// For each vehicle, unused columns that may distinguish several vehicles among its rows.
    suspects: Vec<Vec<SuspectColumn>>,
    /// Quantities of a wide table whose values may be vehicle names.
    watches: Vec<SwapMonitor>,
    /// Number of positions whose vehicle is named by a column of a wide table.
    pub(super) named: usize,
    /// Comparison of heights with a vertical rate.
    climb: Option<ClimbMonitor>,
    /// Comparison with a second position on the Earth, and the axes of the first one in metres.
    agreement: Option<(FrameAgreement, Axes)>,
    /// First name of a frame.
    frame: Option<Box<str>>,
    /// Number of rows omitted because they lack a coordinate.
    pub(super) incomplete: u64,
    /// Number of rows without a fix, by vehicle.
    no_fixes: BTreeMap<usize, u64>,
}

impl Evidence {
    pub(super) fn new(layout: &Layout, options: &ReadOptions) -> Self {
        let agreement = (!layout.compared.is_empty())
            .then(|| (FrameAgreement::default(), options.turn().scaled([options.metres(); 3])));
        Self {
            alternative_ids: layout.alternative_ids.iter().copied().map(AlternativeId::new).collect(),
            suspects: Vec::new(),
            watches: layout.slots.watched.iter().cloned().map(SwapMonitor::new).collect(),
            named: 0,
            climb: layout.rate.map(ClimbMonitor::new),
            agreement,
            frame: None,
            incomplete: 0,
            no_fixes: BTreeMap::new(),
        }
    }

    /// Returns whether a place on the Earth has no fix, and counts it.
    #[inline]
    pub(super) fn lacks_fix(&mut self, row: &Row) -> bool {
        let lacks_fix = is_no_fix(&row.position);
        if lacks_fix {
            *self.no_fixes.entry(row.vehicle).or_default() += 1;
        }
        lacks_fix
    }

    /// Compares a position with the vertical rate and the second position of its row. `place` is the index of its
    /// columns, `names` are those of the vehicles.
    #[inline]
    pub(super) fn compare(
        &mut self,
        cells: &impl Cells,
        layout: &Layout,
        place: usize,
        row: &Row,
        names: &[String],
    ) -> Result<(), Fault> {
        if let Some(climb) = &mut self.climb
            && let Some(rate) = cells.number(climb.column).filter(|rate| rate.is_finite())
        {
            climb.observe(row.vehicle, row.stamp, row.position.z, rate);
        }
        let Some((agreement, axes)) = &mut self.agreement else { return Ok(()) };
        let Some(Some(compared)) = layout.compared.get(place) else { return Ok(()) };
        let mut there = Vector3::zeros();
        let mut has_heights = false;
        for (axis, (column, unit)) in compared.earth.iter().zip(compared.units).enumerate() {
            let Some(column) = *column else { continue };
            match cells.number(column).filter(|number| number.is_finite()) {
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
            compared.fault_of_row(cells.header(), names.get(row.vehicle).map_or("", String::as_str), &found)
        })
    }

    /// Examines the unused columns of a row; `last` is the last position in it.
    pub(super) fn examine(&mut self, cells: &impl Cells, layout: &Layout, last: Option<&Row>) -> Result<(), Fault> {
        for watch in &mut self.watches {
            let texts = watch.columns.iter().map(|&column| Ok(cells.text(column)?.trim().to_owned()));
            watch.observe(texts.collect::<Result<_, Fault>>()?, cells.header())?;
        }
        for &column in &layout.frames {
            self.compare_frame(&cells.text(column)?, &cells.header()[column])?;
        }
        let is_examined = |row: &&Row| row.place == cells.row() && row.vehicle < MOST_SUSPECTED;
        let Some(row) = last.filter(|_| !layout.suspects.is_empty()).filter(is_examined) else { return Ok(()) };
        while self.suspects.len() <= row.vehicle {
            self.suspects.push(layout.suspects.iter().copied().map(SuspectColumn::new).collect());
        }
        let suspects = &mut self.suspects[row.vehicle];
        for suspect in suspects.iter_mut() {
            suspect.observe(cells.text(suspect.column)?.trim(), row.stamp.approximately(), row.position);
        }
        suspects.retain(|suspect| !suspect.cleared);
        Ok(())
    }

    /// Refuses a second frame: coordinates of two frames have no distance. Numbers are those of pictures.
    fn compare_frame(&mut self, cell: &str, column: &str) -> Result<(), Fault> {
        let frame = cell.trim().trim_start_matches('/');
        if frame.is_empty() || frame.parse::<f64>().is_ok() {
            return Ok(());
        }
        match &self.frame {
            None => self.frame = Some(frame.into()),
            Some(first) if **first == *frame => {}
            Some(first) => {
                let [column, first, second] = [column, first, frame].map(quoted);
                let problem = format!("column {column} has the frames {first} and {second}");
                let remedy = "transform all positions into one frame; remove the column if they are in one";
                return refuse(ContentKind::SeveralFrames, problem, remedy);
            }
        }
        Ok(())
    }

    /// Compares the alternative vehicle columns of a row with the column in use.
    pub(super) fn compare_names(&mut self, cells: &impl Cells, vehicle: usize) -> Result<(), Fault> {
        for alternative in &mut self.alternative_ids {
            alternative.observe(vehicle, cells.text(alternative.column)?.trim());
        }
        Ok(())
    }

    /// Refuses a vehicle column that numbers the rows, and two vehicle columns that contradict each other. `vehicles`
    /// is the number of names, `probe` has the times of all rows.
    pub(super) fn check_names(
        &self,
        header: &[String],
        layout: &Layout,
        id: usize,
        vehicles: usize,
        probe: &Probe,
    ) -> Result<(), Fault> {
        // Two rows at two times may belong to two vehicles.
        if probe.rows > 2 && vehicles as u64 == probe.rows && !probe.is_one_instant() && !layout.is_id_given {
            let others = layout.alternative_ids.iter().chain(&layout.suspects);
            let others: Vec<_> = others.map(|&column| quoted(&header[column])).collect();
            let prefix = if others.is_empty() { "" } else { "; the other columns are " };
            let problem = names_no_vehicle(&header[id]) + prefix + &others.join(", ");
            let remedy = format!("name the column of the vehicle with {}, or remove this one", COLUMN.set("id=NAME"));
            return refuse(ContentKind::AmbiguousVehicle, problem, remedy);
        }
        let Some(alternative) = self.alternative_ids.iter().find(|alternative| alternative.is_one()) else {
            return Ok(());
        };
        let [first, other] = [id, alternative.column].map(|column| quoted(&header[column]));
        let problem = format!("the columns {first} and {other} could both name the vehicle, but contradict each other");
        let [first, other] = [id, alternative.column].map(|column| COLUMN.set(format!("id={}", header[column])));
        refuse(ContentKind::AmbiguousVehicle, problem, format!("choose one with {first} or {other}"))
    }

    /// Refuses a vehicle whose rows look like those of several vehicles.
    pub(super) fn check_vehicles(
        &self,
        header: &[String],
        layout: &Layout,
        names: &[String],
        rows: i64,
    ) -> Result<(), Fault> {
        if let Some(&column) = layout.slots.ids.first().filter(|_| rows > 2 && names.len() == self.named) {
            let remedy = "remove such columns if their values are not names";
            return refuse(ContentKind::AmbiguousVehicle, names_no_vehicle(&header[column]), remedy);
        }
        let id = layout.id.filter(|_| names.len() > 1);
        let fault = self.suspects.iter().enumerate().find_map(|(vehicle, suspects)| {
            let named = id.map(|id| (&*names[vehicle], &*header[id]));
            suspects.iter().find_map(|suspect| suspect.fault(&header[suspect.column], named))
        });
        fault.map_or(Ok(()), Err)
    }

    /// Returns notes and facts after all rows. Refuses heights or positions that contradict other columns of the table.
    /// `per_second` is the number of time units per second.
    pub(super) fn findings(
        &self,
        header: &[String],
        layout: &Layout,
        options: &ReadOptions,
        names: &[String],
        per_second: f64,
    ) -> Result<Findings, Fault> {
        let (mut notes, mut facts) = Findings::default();
        let vehicles: Vec<_> = self.no_fixes.keys().filter_map(|&vehicle| names.get(vehicle)).collect();
        notes.extend(no_fixes(self.no_fixes.values().sum(), &format!(" of {}", list(&vehicles, 12))));
        if self.incomplete > 0 {
            notes.push(format!("positions omitted because one of their coordinates is empty: {}", self.incomplete));
            facts.push(Fact::number(FactKind::Rows, Source::Declared, self.incomplete as f64, "incomplete"));
        }
        let height = layout.bodies.first().and_then(|body| body.position[2]);
        let climb = self.climb.as_ref().zip(height);
        match climb.and_then(|(climb, height)| climb.fault(per_second, header, height)) {
            Some(fault) if options.scale.is_some() => {
                notes.push(format!("the given unit of heights is used, but {fault}"));
            }
            Some(fault) => return Err(fault),
            None => {}
        }
        if let Some((agreement, _)) = &self.agreement {
            let compared = layout.compared.iter().flatten().next();
            compared.and_then(|compared| agreement.fault(names, header, compared)).map_or(Ok(()), Err)?;
            notes.extend(agreement.notes(names));
            facts.push(agreement.fact());
        }
        Ok((notes, facts))
    }
}

/// Returns the problem of a vehicle column that numbers the rows.
fn names_no_vehicle(column: &str) -> String {
    format!("column {} has a different value in each row and so names no vehicle", quoted(column))
}
