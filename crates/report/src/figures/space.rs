//! Paths of the vehicles in space.

use nalgebra::Vector3;

use super::Figure;
use super::axis::Axis;
use super::chart::{TITLE, WIDTH};
use super::labels::Labels;
use super::outlines::{Room, wires};
use super::paths::{Look, MOST_PATHS, description, drawn};
use super::spans::Spans;
use super::svg::{Align, Canvas, Marker, Point, Stroke, thinned};
use crate::drawing::colours::{GRID, OBSTACLE, SOFT_INK};
use crate::flight_log::FlightLog;
use tautline_audit::MovingObstacle;
use tautline_core::obstacle::Shape;
use tautline_core::swarm::row;

/// Angles of the view \[rad\].
const YAW: f64 = 0.6;
const PITCH: f64 = 0.42;
/// Largest height of the box of axes \[px\].
const MOST_UP: f64 = 300.0;
/// Space around the box for numbers and labels: left, right, above and below \[px\].
const MARGINS: [f64; 4] = [40.0, 44.0, 28.0, 46.0];
/// Smallest distance between the ticks of an axis, and horizontally between their numbers \[px\].
const TICK_PX: f64 = 32.0;
const BESIDE_PX: f64 = 4.0;
/// Reach of the box beyond the paths towards obstacles, as a share of the longest side.
const REACH: f64 = 0.15;

/// Draws the paths in space: x, y and z \[m\] in a parallel projection with equal units. Selection, marks and colours
/// are those of [`paths`](super::paths()). Obstacles near the paths are drawn as outlines, at their first position.
#[must_use]
pub fn paths_in_space(log: &FlightLog, obstacles: &[MovingObstacle], title: &str) -> Figure {
    let spans = Spans::of(log);
    let view = View::of(&spans, obstacles);
    let mut canvas = Canvas::new((WIDTH, view.height()), title, WIDTH / 2.0);
    let mut labels = Labels::default();
    view.draw_axes(&mut canvas, &mut labels);
    let room = view.room();
    let outlines: Vec<_> = obstacles.iter().flat_map(|obstacle| wires(obstacle, &room)).collect();
    let on_paper = |wire: Vec<Vector3<f64>>| ((), wire.into_iter().map(|place| view.on_paper(place)).collect());
    let has_obstacles = !outlines.is_empty();
    for ((), points) in thinned(outlines.into_iter().map(on_paper).collect()) {
        canvas.line(&points, Stroke::solid(OBSTACLE, 1.1).faint(0.8));
    }
    let lines = drawn(log, MOST_PATHS).into_iter().map(|i| {
        let look = Look::of(i, log.count());
        let places = spans.iter().map(|span| row(span.positions_m, i)).filter(|place| view.shows(place));
        (look, places.map(|place| view.on_paper(place)).collect())
    });
    let mut marks = Vec::new();
    for (look, points) in thinned(lines.collect()) {
        let (Some(&start), Some(&end)) = (points.first(), points.last()) else { continue };
        canvas.line(&points, look.path);
        marks.push((Marker::Cross, start, look.start, look.radius, look.number.clone()));
        marks.push((Marker::Ring, end, look.end, look.radius, look.number));
    }
    for &(marker, at, colour, radius, _) in &marks {
        canvas.marker(marker, at, radius, colour);
        labels.avoid_mark(at);
    }
    for (marker, at, .., number) in marks {
        if let Some(number) = number {
            labels.beside(&mut canvas, marker, at, &number);
        }
    }
    let outlined = if has_obstacles { " Obstacles are drawn as outlines." } else { "" };
    canvas.figure("paths-3d", &format!("{}{outlined}", description(log, "in space")))
}

/// A box of axes, seen from above its edge of the largest x and smallest y.
struct View {
    axes: [Axis; 3],
    /// Pixels per metre.
    unit: f64,
    /// Height of the box \[px\].
    up_px: f64,
}

impl View {
    fn of(spans: &Spans<'_>, obstacles: &[MovingObstacle]) -> Self {
        let paths = [0, 1, 2].map(|axis| spans.extent(axis).unwrap_or((0.0, 1.0)));
        let reach = REACH * paths.iter().map(|(low, high)| high - low).fold(0.0, f64::max);
        let around = Room {
            low: Vector3::from(paths.map(|(low, _)| low - reach)),
            high: Vector3::from(paths.map(|(_, high)| high + reach)),
        };
        // A half-space has no size of its own.
        let sized = obstacles.iter().filter(|obstacle| !matches!(obstacle.shape, Shape::HalfSpace { .. }));
        let places: Vec<_> = sized.flat_map(|obstacle| wires(obstacle, &around)).flatten().collect();
        let axes = [(0, "x [m]"), (1, "y [m]"), (2, "z [m]")].map(|(axis, label)| {
            let (low, high) = paths[axis];
            Axis::linear(label, places.iter().map(|place| place[axis]).chain([low, high]), true)
        });
        let [across, deep, up] = axes.each_ref().map(|axis| axis.to - axis.from);
        let seen_across = across * YAW.cos() + deep * YAW.sin();
        let seen_up = (across * YAW.sin() + deep * YAW.cos()) * PITCH.sin() + up * PITCH.cos();
        let unit = ((WIDTH - MARGINS[0] - MARGINS[1]) / seen_across).min(MOST_UP / seen_up);
        // Horizontal share of a length along each axis, because adjacent numbers must not overlap.
        let axes = [(0, YAW.cos()), (1, YAW.sin()), (2, 0.0)].map(|(k, across)| {
            let Axis { label, from, to, .. } = &axes[k];
            let spanning = |tick_px: f64| Axis::spanning(label, *from, *to, (unit * (to - from) / tick_px).max(1.0));
            let axis = spanning(TICK_PX);
            let wide_px = if across > 0.0 { (axis.labels_px() + BESIDE_PX) / across } else { 0.0 };
            if wide_px > TICK_PX { spanning(wide_px) } else { axis }
        });
        Self { axes, unit, up_px: unit * seen_up }
    }

    /// Returns the height of the drawing \[px\].
    fn height(&self) -> f64 {
        (TITLE + MARGINS[2] + self.up_px + MARGINS[3]).ceil()
    }

    fn room(&self) -> Room {
        let [low, high] = [|axis: &Axis| axis.from, |axis: &Axis| axis.to].map(|end| self.axes.each_ref().map(end));
        Room { low: Vector3::from(low), high: Vector3::from(high) }
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
        let centre = f64::midpoint(MARGINS[0], WIDTH - MARGINS[1]);
        (centre + right, TITLE + MARGINS[2] + self.up_px / 2.0 - up)
    }

    /// Draws the floor and the two rear walls with a grid, and the numbers along three edges.
    fn draw_axes(&self, canvas: &mut Canvas, labels: &mut Labels) {
        let [x, y, z] = &self.axes;
        let at = |x, y, z| self.on_paper(Vector3::new(x, y, z));
        let mut numbered = |axis: &Axis, line: &dyn Fn(f64) -> [Point; 3], (right, down), align| {
            for &tick in &axis.ticks {
                let line = line(tick);
                canvas.line(&line, Stroke::solid(GRID, 0.8));
                labels.text(canvas, (line[0].0 + right, line[0].1 + down), align, &axis.tick_label(tick));
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
            labels.text(canvas, (beside.0 + right, beside.1 + down), align, &axis.label);
        }
        let edges =
            [at(x.from, y.from, z.to), at(x.from, y.from, z.from), at(x.to, y.from, z.from), at(x.to, y.to, z.from)];
        canvas.line(&edges, Stroke::solid(SOFT_INK, 0.8));
    }
}
