//! Paths of the vehicles.

use super::Figure;
use super::axis::Axis;
use super::chart::{Chart, Line, Mark, Shape};
use super::distances::evenly;
use super::outlines::{Window, outline};
use super::spans::Spans;
use super::svg::{Marker, Stroke};
use crate::drawing::colours::{INK, OBSTACLE, SOFT_INK, ThemeColour, VEHICLES};
use crate::flight_log::{FEW_VEHICLES, FlightLog};
use tautline_audit::MovingObstacle;

/// Free share of the extent on each side.
const MARGIN: f64 = 0.06;
/// Largest number of drawn paths.
pub(super) const MOST_PATHS: usize = 300;

/// Draws the paths from above: x and y \[m\] in equal units, a cross at each start and a ring at each end. Up to 12
/// vehicles have colours and numbers. Of more than 300 vehicles, 300 are drawn: the two of the closest approach, and
/// others chosen evenly. Obstacles are drawn at their first position.
#[must_use]
pub fn paths(log: &FlightLog, obstacles: &[MovingObstacle], title: &str) -> Figure {
    let spans = Spans::of(log);
    let mut chart = from_above(&spans, &[], obstacles);
    for (k, &i) in drawn(log, MOST_PATHS).iter().enumerate() {
        let look = Look::of(i, log.count());
        let points = path(&spans, i);
        let mark = |at: Option<&(f64, f64)>, marker, colour, label: &str| {
            let label = (k == 0).then(|| label.to_owned());
            at.map(|&at| Mark { at, marker, colour, radius: look.radius, text: look.number.clone(), label })
        };
        chart.marks.extend(mark(points.first(), Marker::Cross, look.start, "start"));
        chart.marks.extend(mark(points.last(), Marker::Ring, look.end, "end"));
        chart.lines.push(Line { points, stroke: look.path, label: None });
    }
    chart.figure("paths", title, &description(log, "from above"))
}

/// Largest number of paths of a still picture.
const STILL_PATHS: usize = 40;

/// Draws the paths from above with the vehicles at the time of the closest approach \[s\], and the closest two, from 0,
/// joined. This still picture replaces a replay that cannot be drawn. The title begins with the name of the flight,
/// unless it is empty. Flights `beside` it widen the axes.
#[must_use]
pub fn at_closest(
    name: &str,
    log: &FlightLog,
    obstacles: &[MovingObstacle],
    closest: Option<([usize; 2], f64)>,
    beside: &[FlightLog],
) -> Figure {
    let spans = Spans::of(log);
    let beside: Vec<_> = beside.iter().map(Spans::of).collect();
    let mut chart = from_above(&spans, &beside, obstacles);
    let time_s = closest.map_or(log.range_s()[0], |(_, time_s)| time_s);
    let now = log.positions_m(time_s);
    let place = |i: usize| now.as_ref().map(|now| (now[(i, 0)], now[(i, 1)]));
    let mut shown = drawn(log, STILL_PATHS);
    shown.extend(closest.iter().flat_map(|(pair, _)| *pair).filter(|&i| i < log.count()));
    shown.sort_unstable();
    shown.dedup();
    for i in shown {
        let look = Look::of(i, log.count());
        chart.lines.push(Line { points: path(&spans, i), stroke: look.path.faint(0.45), label: None });
        let mark = |at| Mark { text: look.number.clone(), ..Mark::ring(at, look.path.colour, None) };
        chart.marks.extend(place(i).map(mark));
    }
    let title = closest.map_or("Paths from above".to_owned(), |_| format!("Closest approach, at {time_s:.2} s"));
    let title = if name.is_empty() { title } else { format!("{name}: {title}") };
    if let Some([Some(one), Some(other)]) = closest.map(|(pair, _)| pair.map(place)) {
        chart.line(vec![one, other], Stroke::solid(INK, 2.6), "closest two");
    }
    chart.figure("still", &title, &format!("{} Rings: the vehicles at {time_s:.2} s.", description(log, "from above")))
}

/// Returns an empty chart of x and y \[m\] in equal units, with the obstacles.
fn from_above(spans: &Spans<'_>, beside: &[Spans<'_>], obstacles: &[MovingObstacle]) -> Chart {
    let axis = |axis: usize, label: &str| {
        let extents = beside.iter().chain([spans]).filter_map(|spans| spans.extent(axis));
        let (low, high) = extents.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1))).unwrap_or((0.0, 1.0));
        let margin = MARGIN * (high - low);
        Axis::linear(label, [low - margin, high + margin], false)
    };
    let mut chart = Chart::new(axis(0, "x [m]"), axis(1, "y [m]"));
    chart.make_equal();
    let window = Window { low: (chart.x.from, chart.y.from), high: (chart.x.to, chart.y.to) };
    let outlines = obstacles.iter().map(|obstacle| outline(obstacle, window)).filter(|outline| !outline.is_empty());
    for (k, corners) in outlines.enumerate() {
        chart.shapes.push(Shape {
            corners,
            colour: OBSTACLE,
            opacity: 0.45,
            label: (k == 0).then(|| "obstacle".to_owned()),
        });
    }
    chart
}

fn path(spans: &Spans<'_>, vehicle: usize) -> Vec<(f64, f64)> {
    spans.iter().map(|span| (span.positions_m[(vehicle, 0)], span.positions_m[(vehicle, 1)])).collect()
}

/// Returns the vehicles whose paths are drawn, about `most`.
pub(super) fn drawn(log: &FlightLog, most: usize) -> Vec<usize> {
    let count = log.count();
    if count <= most {
        return (0..count).collect();
    }
    let closest = log.closest().map(|closest| [closest.pair.first(), closest.pair.second()]);
    let spread = (0..most).map(|k| evenly(k, count));
    let mut drawn: Vec<_> = spread.chain(closest.into_iter().flatten().filter(|&i| i < count)).collect();
    drawn.sort_unstable();
    drawn.dedup();
    drawn
}

/// Look of the path of a vehicle.
pub(super) struct Look {
    pub(super) path: Stroke,
    pub(super) start: ThemeColour,
    pub(super) end: ThemeColour,
    pub(super) radius: f64,
    pub(super) number: Option<String>,
}

impl Look {
    pub(super) fn of(vehicle: usize, count: usize) -> Self {
        if count <= FEW_VEHICLES {
            let path = Stroke::of_line(vehicle);
            let number = Some((vehicle + 1).to_string());
            return Self { path, start: path.colour, end: path.colour, radius: 4.5, number };
        }
        let path = Stroke::solid(VEHICLES[0], 0.8).faint(0.45);
        let radius = if count <= 100 { 3.0 } else { 2.0 };
        Self { path, start: SOFT_INK, end: VEHICLES[1], radius, number: None }
    }
}

pub(super) fn description(log: &FlightLog, from: &str) -> String {
    let (count, end_s) = (log.count(), log.range_s()[1]);
    let of_all = match drawn(log, MOST_PATHS).len() {
        drawn if drawn < count => format!("{drawn} of {count} vehicles, chosen evenly,"),
        _ => format!("{count} vehicles"),
    };
    format!("Paths of {of_all} {from} over {end_s:.2} s; a cross marks each start and a ring each end.")
}
