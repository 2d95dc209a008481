//! Paths of the vehicles.

use nalgebra::Vector3;

use super::Figure;
use super::axis::Axis;
use super::chart::{Chart, Line, Mark, Shape, TITLE, WIDTH};
use super::distances::evenly;
use super::outlines::{Window, outline};
use super::spans::Spans;
use super::svg::{Align, Canvas, Colour, GRID, INK, Marker, OBSTACLE, PALETTE, Point, SOFT_INK, Stroke, thinned};
use crate::flight_log::{FEW_VEHICLES, FlightLog};
use tautline_audit::Obstacle;
use tautline_core::swarm::row;

/// Free share of the extent on each side.
const MARGIN: f64 = 0.06;
/// Largest number of drawn paths.
const MOST_PATHS: usize = 300;

/// Draws the paths from above: x and y \[m\] in equal units, a cross at each start and a ring at each end. Up to 12
/// vehicles have colours and numbers. Of more than 300 vehicles, 300 are drawn: the two of the closest approach, and
/// others chosen evenly. Obstacles are drawn at their first position.
#[must_use]
pub fn paths(log: &FlightLog, obstacles: &[Obstacle], title: &str) -> Figure {
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
    obstacles: &[Obstacle],
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
fn from_above(spans: &Spans<'_>, beside: &[Spans<'_>], obstacles: &[Obstacle]) -> Chart {
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
fn drawn(log: &FlightLog, most: usize) -> Vec<usize> {
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
struct Look {
    path: Stroke,
    start: Colour,
    end: Colour,
    radius: f64,
    number: Option<String>,
}

impl Look {
    fn of(vehicle: usize, count: usize) -> Self {
        if count <= FEW_VEHICLES {
            let path = Stroke::of_line(vehicle);
            let number = Some((vehicle + 1).to_string());
            return Self { path, start: path.colour, end: path.colour, radius: 4.5, number };
        }
        let path = Stroke::solid(PALETTE[0], 0.8).faint(0.45);
        let radius = if count <= 100 { 3.0 } else { 2.0 };
        Self { path, start: SOFT_INK, end: PALETTE[1], radius, number: None }
    }
}

fn description(log: &FlightLog, from: &str) -> String {
    let (count, end_s) = (log.count(), log.range_s()[1]);
    let of_all = match drawn(log, MOST_PATHS).len() {
        drawn if drawn < count => format!("{drawn} of {count} vehicles, chosen evenly,"),
        _ => format!("{count} vehicles"),
    };
    format!("Paths of {of_all} {from} over {end_s:.2} s; a cross marks each start and a ring each end.")
}

/// Angles of the view on a run in space \[rad\], and the height of the chart \[px\].
const YAW: f64 = 0.6;
const PITCH: f64 = 0.42;
const HEIGHT: f64 = 330.0;
/// Largest width and height of the box of axes \[px\]; the rest is for the numbers.
const BOX: Point = (340.0, 270.0);
/// Smallest distance between the ticks of an axis, and horizontally between their numbers \[px\].
const TICK_PX: f64 = 32.0;
const BESIDE_PX: f64 = 4.0;

/// Draws the paths in space: x, y and z \[m\] in a parallel projection with equal units. Selection, marks and colours
/// are those of [`paths`].
#[must_use]
pub fn paths_in_space(log: &FlightLog, title: &str) -> Figure {
    let spans = Spans::of(log);
    let view = View::of(&spans);
    let mut canvas = Canvas::new((WIDTH, TITLE + HEIGHT), title, WIDTH / 2.0);
    view.draw_axes(&mut canvas);
    let lines = drawn(log, MOST_PATHS).into_iter().map(|i| {
        let look = Look::of(i, log.count());
        let places = spans.iter().map(|span| row(span.positions_m, i)).filter(|place| view.shows(place));
        (look, places.map(|place| view.on_paper(place)).collect())
    });
    for (look, points) in thinned(lines.collect()) {
        let (Some(&start), Some(&end)) = (points.first(), points.last()) else { continue };
        canvas.line(&points, look.path);
        for (marker, at, colour) in [(Marker::Cross, start, look.start), (Marker::Ring, end, look.end)] {
            canvas.marker(marker, at, look.radius, colour);
            if let Some(number) = &look.number {
                canvas.text_beside(marker, at, number);
            }
        }
    }
    canvas.figure("paths-3d", &description(log, "in space"))
}

/// A box of axes, seen from above its edge of the largest x and smallest y.
struct View {
    axes: [Axis; 3],
    /// Pixels per metre.
    unit: f64,
}

impl View {
    fn of(spans: &Spans<'_>) -> Self {
        let axes = [(0, "x [m]"), (1, "y [m]"), (2, "z [m]")].map(|(axis, label)| {
            let (low, high) = spans.extent(axis).unwrap_or((0.0, 1.0));
            Axis::linear(label, [low, high], true)
        });
        let [across, deep, up] = axes.each_ref().map(|axis| axis.to - axis.from);
        let seen_across = across * YAW.cos() + deep * YAW.sin();
        let seen_up = (across * YAW.sin() + deep * YAW.cos()) * PITCH.sin() + up * PITCH.cos();
        let unit = (BOX.0 / seen_across).min(BOX.1 / seen_up);
        // Horizontal share of a length along each axis, because adjacent numbers must not overlap.
        let axes = [(0, YAW.cos()), (1, YAW.sin()), (2, 0.0)].map(|(k, across)| {
            let Axis { label, from, to, .. } = &axes[k];
            let spanning = |tick_px: f64| Axis::spanning(label, *from, *to, (unit * (to - from) / tick_px).max(1.0));
            let axis = spanning(TICK_PX);
            let wide_px = if across > 0.0 { (axis.labels_px() + BESIDE_PX) / across } else { 0.0 };
            if wide_px > TICK_PX { spanning(wide_px) } else { axis }
        });
        Self { axes, unit }
    }

    fn shows(&self, place: &Vector3<f64>) -> bool {
        self.axes.iter().zip(place.iter()).all(|(axis, &p)| axis.place(p).is_some())
    }

    /// Projects a position: x to the right and nearer, y to the right and farther, z up.
    fn on_paper(&self, place: Vector3<f64>) -> Point {
        let middle = Vector3::from(self.axes.each_ref().map(Axis::middle));
        let [x, y, z] = (self.unit * (place - middle)).into();
        let away = y * YAW.cos() - x * YAW.sin();
        let (right, up) = (x * YAW.cos() + y * YAW.sin(), z * PITCH.cos() + away * PITCH.sin());
        (WIDTH / 2.0 + right, TITLE + HEIGHT / 2.0 - up)
    }

    /// Draws the floor and the two rear walls with a grid, and the numbers along three edges.
    fn draw_axes(&self, canvas: &mut Canvas) {
        let [x, y, z] = &self.axes;
        let at = |x, y, z| self.on_paper(Vector3::new(x, y, z));
        let mut numbered = |axis: &Axis, line: &dyn Fn(f64) -> [Point; 3], (right, down), align| {
            for &tick in &axis.ticks {
                let line = line(tick);
                canvas.line(&line, Stroke::solid(GRID, 0.8));
                canvas.text((line[0].0 + right, line[0].1 + down), align, &axis.tick_label(tick));
            }
        };
        let on_x = |tick| [at(tick, y.from, z.from), at(tick, y.to, z.from), at(tick, y.to, z.to)];
        let on_y = |tick| [at(x.to, tick, z.from), at(x.from, tick, z.from), at(x.from, tick, z.to)];
        let on_z = |tick| [at(x.from, y.from, tick), at(x.from, y.to, tick), at(x.to, y.to, tick)];
        numbered(x, &on_x, (-8.0, 7.0), Align::CENTRE_ABOVE);
        numbered(y, &on_y, (11.0, 8.0), Align::LEFT);
        numbered(z, &on_z, (-7.0, 0.0), Align::RIGHT);
        for (axis, [beside, ..], (right, down), align) in [
            (x, on_x(x.middle()), (-8.0, 28.0), Align::RIGHT_ABOVE),
            (y, on_y(y.middle()), ((15.0 + y.labels_px()).max(38.0), 26.0), Align::LEFT),
            (z, on_z(z.to), (0.0, -12.0), Align::CENTRE_BELOW),
        ] {
            canvas.text((beside.0 + right, beside.1 + down), align, &axis.label);
        }
        let edges =
            [at(x.from, y.from, z.to), at(x.from, y.from, z.from), at(x.to, y.from, z.from), at(x.to, y.to, z.from)];
        canvas.line(&edges, Stroke::solid(SOFT_INK, 0.8));
    }
}
