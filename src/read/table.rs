//! Tables row by row, whatever their cells are written as.

use nalgebra::Vector3;

use super::clock::{Probe, Stamp, TimeUnit};
use super::error::{Fault, FaultAt, Place};
use super::layout::{Body, Layout, Shape};
use super::names::Names;
use super::options::ReadOptions;
use super::order::{About, BATCH, Ordered, Recording, Row, Rows};
use super::source::Source;

/// The cells of the current row of a table.
pub(super) trait Cells {
    /// Names of the columns.
    fn header(&self) -> &[String];

    /// Goes before the first row. Of each row these columns are asked, in rising order; where not `all` that a table
    /// needs are among them, no more is looked at.
    fn restart(&mut self, columns: &[usize], all: bool) -> Result<(), FaultAt>;

    /// Goes to the next row; `false` behind the last one.
    fn advance(&mut self) -> Result<bool, FaultAt>;

    /// Number of the current row.
    fn row(&self) -> u64;

    /// Where a row of this number is.
    fn place(row: u64) -> Place;

    /// A finite number; none where the cell is empty.
    fn number(&self, column: usize) -> Result<Option<f64>, Fault>;

    /// A finite time; none where the cell is empty.
    fn stamp(&mut self, column: usize) -> Result<Option<Stamp>, Fault>;

    /// The vehicle of this name, looked for first after the one `before`; none where the cell is empty.
    fn vehicle(&self, column: usize, names: &mut Names, before: usize) -> Result<Option<usize>, Fault>;
}

fn empty(cells: &impl Cells, column: usize) -> Fault {
    Fault::EmptyCell { column: cells.header()[column].clone() }
}

/// A table, long or wide.
struct Table<C> {
    cells: C,
    layout: Layout,
    names: Names,
    /// Vehicle of the last row.
    vehicle: usize,
}

/// Opens a table of these cells; `unit` is that of its times where the format says it.
pub(super) fn open<C: Cells + 'static>(
    source: &Source,
    mut cells: C,
    layout: Layout,
    unit: Option<TimeUnit>,
    epoch_ns: i64,
    options: &ReadOptions,
) -> Result<Recording, FaultAt> {
    let about = About::new(source, options, unit.or(layout.unit), layout.notes(), Fault::HeaderOnly);
    let names = match &layout.shape {
        Shape::Long { .. } => Names::default(),
        Shape::Wide { names, .. } => Names::from_list(names.clone()),
    };
    cells.restart(&layout.columns(), true)?;
    let table = Table { cells, layout, names, vehicle: 0 };
    Ok(Box::new(Ordered::open(table, About { epoch_ns, ..about })?))
}

impl<C: Cells> Table<C> {
    fn at_row(&self, fault: Fault) -> FaultAt {
        fault.at(C::place(self.cells.row()))
    }

    #[inline]
    fn stamp(&mut self) -> Result<Stamp, Fault> {
        let stamp = self.cells.stamp(self.layout.time).map_err(Fault::of_time)?;
        stamp.ok_or_else(|| empty(&self.cells, self.layout.time))
    }

    #[inline]
    fn vehicle(&mut self, id: usize) -> Result<usize, Fault> {
        let vehicle = self.cells.vehicle(id, &mut self.names, self.vehicle)?;
        self.vehicle = vehicle.ok_or_else(|| empty(&self.cells, id))?;
        Ok(self.vehicle)
    }

    /// Appends what the current row says.
    #[inline]
    fn append(&mut self, rows: &mut Vec<Row>) -> Result<(), Fault> {
        let stamp = self.stamp()?;
        if let Shape::Long { id, .. } = self.layout.shape {
            self.vehicle(id)?;
        }
        match &self.layout.shape {
            Shape::Long { body, .. } => rows.extend(row(&self.cells, stamp, self.vehicle, body)?),
            Shape::Wide { bodies, .. } => {
                for (vehicle, body) in bodies.iter().enumerate() {
                    rows.extend(row(&self.cells, stamp, vehicle, body)?);
                }
            }
        }
        Ok(())
    }
}

/// The row of a vehicle; none where it was not seen.
#[inline]
fn row(cells: &impl Cells, stamp: Stamp, vehicle: usize, body: &Body) -> Result<Option<Row>, Fault> {
    let Some(position) = vector(cells, &body.position)? else { return Ok(None) };
    let velocity = body.velocity.as_ref().map(|columns| vector(cells, columns)).transpose()?.flatten();
    let radius = body.radius.map(|column| cells.number(column)).transpose()?.flatten();
    if let (Some(radius), Some(column)) = (radius.filter(|radius| *radius < 0.0), body.radius) {
        let problem = format!("column `{}` holds {radius}, a negative radius", cells.header()[column]);
        return Err(Fault::content(problem, "write 0 or more"));
    }
    Ok(Some(Row { stamp, place: cells.row(), vehicle, position, velocity, radius }))
}

/// Three numbers, none where all cells are empty.
#[inline]
fn vector(cells: &impl Cells, columns: &[Option<usize>; 3]) -> Result<Option<Vector3<f64>>, Fault> {
    let mut vector = Vector3::zeros();
    let (mut filled, mut missing) = (false, None);
    for (axis, column) in columns.iter().enumerate() {
        let Some(column) = *column else { continue };
        match cells.number(column)? {
            Some(number) => (vector[axis], filled) = (number, true),
            None => missing = missing.or(Some(column)),
        }
    }
    match missing {
        None => Ok(Some(vector)),
        Some(_) if !filled => Ok(None),
        Some(column) => Err(empty(cells, column)),
    }
}

impl<C: Cells> Rows for Table<C> {
    fn next(&mut self, rows: &mut Vec<Row>) -> Result<bool, FaultAt> {
        let before = rows.len();
        while rows.len() < before + BATCH && self.cells.advance()? {
            self.append(rows).map_err(|fault| self.at_row(fault))?;
        }
        Ok(rows.len() > before)
    }

    fn rewind(&mut self) -> Result<(), FaultAt> {
        self.cells.restart(&self.layout.columns(), true)
    }

    fn vehicles(&self) -> &[String] {
        self.names.all()
    }

    fn settle_names(&mut self) {
        self.names.settle();
    }

    fn place(&self, number: u64) -> Place {
        C::place(number)
    }

    fn is_wide(&self) -> bool {
        matches!(self.layout.shape, Shape::Wide { .. })
    }

    /// Only times and names are looked at, which is several times faster than reading everything.
    fn survey(&mut self) -> Result<Option<Probe>, FaultAt> {
        let Shape::Long { id, .. } = self.layout.shape else { return Ok(None) };
        let mut columns = [self.layout.time, id];
        columns.sort_unstable();
        self.cells.restart(&columns, false)?;
        let mut probe: Option<Probe> = None;
        while self.cells.advance()? {
            let stamp = self.stamp().and_then(|stamp| self.vehicle(id).map(|_| stamp));
            let stamp = stamp.map_err(|fault| self.at_row(fault))?;
            probe.get_or_insert_with(|| Probe::new(stamp)).see(stamp);
        }
        Ok(probe)
    }
}
