//! Charts as plain data, and their drawing.

use super::Figure;
use super::axis::{Axis, Scale};
use super::labels::Labels;
use super::svg::{Align, Canvas, Marker, Point, Stroke, TEXT, text_px, thinned};
use crate::drawing::colours::{GRID, SOFT_INK, ThemeColour};

/// Largest number of entries of a legend.
pub(super) const LEGEND: usize = 6;
/// Width of a figure \[px\].
pub(super) const WIDTH: f64 = 460.0;
/// Space for the title \[px\].
pub(super) const TITLE: f64 = 32.0;
/// Left and right end of the plotting area \[px\]. Numbers and label of the vertical axis are to the left; wide numbers
/// move the left end to the right.
const LEFT: f64 = 64.0;
const RIGHT: f64 = WIDTH - 16.0;
/// Baseline of the label of the vertical axis \[px\].
const LABEL: f64 = 17.0;
/// Space for the numbers and the label of the horizontal axis \[px\].
const BELOW: f64 = 44.0;
/// Height of the plotting area \[px\]. With equal axes it follows the data, between `LEAST_HEIGHT` and `MOST_HEIGHT`.
const HEIGHT: f64 = 240.0;
const LEAST_HEIGHT: f64 = 130.0;
const MOST_HEIGHT: f64 = 380.0;
const HAIRLINE: f64 = 0.8;
/// Height of a second plot, and its distance from the first \[px\].
const PANEL: f64 = 110.0;
const PANEL_GAP: f64 = 14.0;
/// Side of an inset, and its distance from the edges of the plotting area \[px\].
const INSET: f64 = 130.0;
const INSET_GAP: f64 = 6.0;
/// Largest share of the chart's width that half of an inset may show. A larger inset would not enlarge anything.
const INSET_FROM: f64 = 0.1;
const TICK: f64 = 4.0;
/// Space between a tick and its number \[px\].
const BESIDE_TICK: f64 = 3.0;

/// A line through points in the units of the axes. It breaks at points that cannot be on them.
#[derive(Clone, Debug)]
pub(super) struct Line {
    pub(super) points: Vec<(f64, f64)>,
    pub(super) stroke: Stroke,
    pub(super) label: Option<String>,
}

/// A filled polygon in the units of the axes, within the chart.
#[derive(Clone, Debug)]
pub(super) struct Shape {
    pub(super) corners: Vec<(f64, f64)>,
    pub(super) colour: ThemeColour,
    pub(super) opacity: f64,
    pub(super) label: Option<String>,
}

impl Shape {
    /// Returns the area between two curves over the same abscissae: (x, low, high).
    pub(super) fn band(
        points: &[(f64, f64, f64)],
        colour: ThemeColour,
        opacity: f64,
        label: impl Into<Option<String>>,
    ) -> Self {
        let low = points.iter().map(|&(x, low, _)| (x, low));
        let high = points.iter().rev().map(|&(x, _, high)| (x, high));
        Self { corners: low.chain(high).collect(), colour, opacity, label: label.into() }
    }
}

/// A mark at a point, with an optional text beside it.
#[derive(Clone, Debug)]
pub(super) struct Mark {
    pub(super) at: (f64, f64),
    pub(super) marker: Marker,
    pub(super) colour: ThemeColour,
    pub(super) radius: f64,
    pub(super) text: Option<String>,
    pub(super) label: Option<String>,
}

impl Mark {
    /// Returns a ring with an optional entry in the legend.
    pub(super) fn ring(at: (f64, f64), colour: ThemeColour, label: Option<String>) -> Self {
        Self { at, marker: Marker::Ring, colour, radius: 4.5, text: None, label }
    }

    /// Returns a cross with an optional entry in the legend.
    pub(super) fn cross(at: (f64, f64), colour: ThemeColour, label: Option<String>) -> Self {
        Self { at, marker: Marker::Cross, colour, radius: 4.0, text: None, label }
    }
}

/// A chart.
#[derive(Clone, Debug)]
pub(super) struct Chart {
    pub(super) x: Axis,
    pub(super) y: Axis,
    /// Whether units have the same length on both axes.
    equal: bool,
    pub(super) shapes: Vec<Shape>,
    pub(super) lines: Vec<Line>,
    pub(super) marks: Vec<Mark>,
    pub(super) inset: Option<Inset>,
    pub(super) panel: Option<Panel>,
    /// Left end of the plotting area \[px\].
    left: f64,
}

/// A second plot below a chart over the same abscissae: the lines around a limit, less the limit.
#[derive(Clone, Debug)]
pub(super) struct Panel {
    pub(super) y: Axis,
    pub(super) limit: f64,
}

/// A square part of a chart with equal axes, drawn enlarged in a corner.
#[derive(Clone, Copy, Debug)]
pub(super) struct Inset {
    pub(super) middle: (f64, f64),
    /// Half of its side in the units of the axes.
    pub(super) half: f64,
}

/// Paint of a line or an area.
#[derive(Clone, Copy)]
enum Paint {
    Line(Stroke),
    Area(ThemeColour, f64),
}

impl Chart {
    pub(super) fn new(x: Axis, y: Axis) -> Self {
        let (shapes, lines, marks) = (Vec::new(), Vec::new(), Vec::new());
        Self { x, y, equal: false, shapes, lines, marks, inset: None, panel: None, left: LEFT }
    }

    /// Gives units the same length on both axes, which widens one of them.
    pub(super) fn make_equal(&mut self) {
        self.equal = true;
        self.make_axes_equal();
    }

    /// Adds a line with an entry in the legend.
    pub(super) fn line(&mut self, points: Vec<(f64, f64)>, stroke: Stroke, label: impl Into<String>) {
        self.lines.push(Line { points, stroke, label: Some(label.into()) });
    }

    /// Adds a horizontal line across the chart.
    pub(super) fn level(&mut self, y: f64, stroke: Stroke, label: String) {
        self.line([self.x.from, self.x.to].map(|x| (x, y)).to_vec(), stroke, label);
    }

    /// Adds a vertical line across the chart, with an optional entry in the legend.
    pub(super) fn upright(&mut self, x: f64, stroke: Stroke, label: Option<String>) {
        self.lines.push(Line { points: [self.y.from, self.y.to].map(|y| (x, y)).to_vec(), stroke, label });
    }

    /// Adds a vertical line between the ends of an interval, if there is one.
    pub(super) fn interval(&mut self, x: f64, ends: Option<[f64; 2]>, stroke: Stroke) {
        let points = ends.into_iter().flatten().map(|y| (x, y)).collect();
        self.lines.push(Line { points, stroke, label: None });
    }

    /// Gives lines that lie on each other one entry in the legend, with all their names: the first would be hidden.
    pub(super) fn merge_equal_lines(&mut self) {
        for k in 1..self.lines.len() {
            let (before, rest) = self.lines.split_at_mut(k);
            let line = &mut rest[0];
            let alike = |other: &&mut Line| other.label.is_some() && self.y.draws_alike(&other.points, &line.points);
            let equal = before.iter_mut().find(alike);
            if let (Some(other), Some(label)) = (equal, line.label.as_ref()) {
                other.label = other.label.take().map(|first| joined(&first, label));
                line.label = None;
                line.points.clear();
            }
        }
    }

    /// Draws the chart under a title.
    pub(super) fn figure(mut self, name: &str, title: &str, description: &str) -> Figure {
        let mut height = if self.equal { self.make_axes_equal() } else { HEIGHT };
        // Wide numbers move the plotting area to the right, away from the label of their axis.
        let numbers_px =
            self.panel.iter().map(|panel| &panel.y).chain([&self.y]).map(Axis::labels_px).fold(0.0, f64::max);
        self.left = LEFT.max(LABEL + TEXT / 2.0 + 2.0 * BESIDE_TICK + TICK + numbers_px);
        if self.equal && self.left > LEFT {
            height = self.make_axes_equal();
        }
        let (left, bottom) = (self.left, TITLE + height);
        let legend = self.legend();
        let end = if self.panel.is_some() { bottom + PANEL_GAP + PANEL } else { bottom };
        let mut canvas = Canvas::new((WIDTH, end + BELOW + legend_height(&legend)), title, f64::midpoint(left, RIGHT));
        let on_paper = |(x, y)| (left + (RIGHT - left) * self.x.share(x), bottom - height * self.y.share(y));
        draw_frame(&mut canvas, [&self.x, &self.y], on_paper);
        self.draw_abscissae(&mut canvas, end);

        let areas = self.shapes.iter().map(|shape| {
            let corners = shape.corners.iter().filter_map(|&at| self.place(at)).collect::<Vec<_>>();
            (Paint::Area(shape.colour, shape.opacity), corners)
        });
        let lines = self.lines.iter().flat_map(|line| {
            self.stretches(&line.points).into_iter().map(|stretch| (Paint::Line(line.stroke), stretch))
        });
        let shapes = areas.chain(lines).map(|(paint, places)| (paint, places.into_iter().map(on_paper).collect()));
        for (paint, points) in thinned(shapes.collect()) {
            match paint {
                Paint::Line(stroke) => canvas.line(&points, stroke),
                Paint::Area(colour, opacity) => canvas.area(&points, colour, opacity),
            }
        }
        let mut labels = Labels::default();
        let marks = || self.marks.iter().filter_map(|mark| Some((mark, on_paper(self.place(mark.at)?))));
        for (mark, at) in marks() {
            canvas.marker(mark.marker, at, mark.radius, mark.colour);
            labels.avoid_mark(at);
        }
        for (mark, at) in marks() {
            if let Some(words) = &mark.text {
                labels.beside(&mut canvas, mark.marker, at, words);
            }
        }
        if let Some(inset) =
            self.inset.filter(|inset| inset.half > 0.0 && inset.half < INSET_FROM * (self.x.to - self.x.from))
        {
            self.draw_inset(&mut canvas, inset, on_paper(inset.middle), bottom);
        }
        if let Some(panel) = &self.panel {
            canvas.group("panel", |canvas| self.draw_panel(canvas, panel, end));
        }
        draw_legend(&mut canvas, &legend, end + BELOW);
        match self.cut_note() {
            Some(note) => {
                canvas.text((RIGHT, end + BELOW - 11.0), Align::RIGHT, &note);
                canvas.figure(name, &format!("{description} Values {note}."))
            }
            None => canvas.figure(name, description),
        }
    }

    /// Returns a note on numbers below a logarithmic axis.
    fn cut_note(&self) -> Option<String> {
        let is_cut = |&(_, y): &(f64, f64)| y.is_finite() && self.y.place(y).is_none() && y < self.y.end();
        let has_cut = self.y.scale == Scale::Log && self.lines.iter().flat_map(|line| &line.points).any(is_cut);
        has_cut.then(|| format!("below {} not shown", self.y.tick_label(self.y.from)))
    }

    /// Draws lines and marks around the middle of an inset, enlarged, in the upper corner that is farther from the
    /// middle.
    fn draw_inset(&self, canvas: &mut Canvas, inset: Inset, middle: Point, bottom: f64) {
        let side = INSET.min(0.5 * (bottom - TITLE));
        let is_right = middle.0 > f64::midpoint(self.left, RIGHT);
        let left = if is_right { self.left + INSET_GAP } else { RIGHT - INSET_GAP - side };
        let corner = (left, TITLE + INSET_GAP);
        let unit = side / (2.0 * inset.half);
        let on_inset = |(x, y): (f64, f64)| {
            (corner.0 + side / 2.0 + unit * (x - inset.middle.0), corner.1 + side / 2.0 - unit * (y - inset.middle.1))
        };
        // Corners inside the inset, and one more on each side.
        let near = |&(x, y): &(f64, f64)| (x - inset.middle.0).abs().max((y - inset.middle.1).abs()) <= inset.half;
        let stretches = self.lines.iter().flat_map(|line| {
            let is_near: Vec<bool> = line.points.iter().map(near).collect();
            let from = is_near.iter().position(|near| *near).unwrap_or(line.points.len()).saturating_sub(1);
            let to = is_near.iter().rposition(|near| *near).map_or(from, |last| line.points.len().min(last + 2));
            let known = line.points[from..to].split(|(x, y)| !(x + y).is_finite());
            known.map(|points| (line.stroke, points.iter().copied().map(on_inset).collect()))
        });
        canvas.window(corner, side, |canvas| {
            for (stroke, points) in thinned(stretches.collect()) {
                canvas.line(&points, stroke);
            }
            for mark in &self.marks {
                canvas.marker(mark.marker, on_inset(mark.at), mark.radius, mark.colour);
            }
        });
        let far = (corner.0 + side, corner.1 + side);
        let frame = [corner, (far.0, corner.1), far, (corner.0, far.1), corner];
        canvas.line(&frame, Stroke::solid(SOFT_INK, HAIRLINE));
        let part = inset.half * (RIGHT - self.left) / (self.x.to - self.x.from);
        let here = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0)]
            .map(|(right, down)| (middle.0 + right * part, middle.1 + down * part));
        canvas.line(&here, Stroke::solid(SOFT_INK, HAIRLINE));
    }

    /// Widens one range until units have the same length on both axes. Returns the height of the plotting area \[px\].
    fn make_axes_equal(&mut self) -> f64 {
        let width = RIGHT - self.left;
        let (across, up) = (self.x.to - self.x.from, self.y.to - self.y.from);
        let least = if self.inset.is_some() { HEIGHT } else { LEAST_HEIGHT };
        let height = (width * up / across).clamp(least, MOST_HEIGHT).round();
        let unit = (across / width).max(up / height);
        let widen = |axis: &Axis, pixels: f64, tick_px: f64| {
            let (middle, half) = (axis.middle(), 0.5 * unit * pixels);
            Axis::spanning(&axis.label, middle - half, middle + half, pixels / tick_px)
        };
        (self.x, self.y) = (widen(&self.x, width, 60.0), widen(&self.y, height, 40.0));
        height
    }

    /// Draws the numbers and the label of the horizontal axis below `bottom` \[px\].
    fn draw_abscissae(&self, canvas: &mut Canvas, bottom: f64) {
        let x = &self.x;
        let apart_px = (RIGHT - self.left) / x.ticks.len().max(1) as f64;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few")]
        let every = ((x.labels_px() + 2.0 * BESIDE_TICK) / apart_px).ceil().max(1.0) as usize;
        for &tick in x.ticks.iter().step_by(every) {
            let label = x.tick_label(tick);
            let at = (self.left + (RIGHT - self.left) * x.share(tick)).min(WIDTH - 0.5 * text_px(&label));
            canvas.text((at, bottom + TICK + BESIDE_TICK), Align::CENTRE_ABOVE, &label);
        }
        canvas.text((f64::midpoint(self.left, RIGHT), bottom + BELOW - 6.0), Align::CENTRE_BELOW, &x.label);
    }

    /// Draws the second plot, which ends at `bottom` \[px\].
    fn draw_panel(&self, canvas: &mut Canvas, Panel { y, limit }: &Panel, bottom: f64) {
        let on_paper =
            |(x, height)| (self.left + (RIGHT - self.left) * self.x.share(x), bottom - PANEL * y.share(height));
        draw_frame(canvas, [&self.x, y], on_paper);
        let stretches = self.lines.iter().flat_map(|line| {
            let points = line.points.iter().map(|&(x, height)| (x, height - limit)).collect::<Vec<_>>();
            let within = within(&points, [y.from, y.to]).into_iter();
            within.map(|stretch| (line.stroke, stretch.into_iter().map(on_paper).collect()))
        });
        for (stroke, points) in thinned(stretches.collect()) {
            canvas.line(&points, stroke);
        }
        for mark in &self.marks {
            let height = mark.at.1 - limit;
            if (y.from..=y.to).contains(&height) {
                canvas.marker(mark.marker, on_paper((mark.at.0, height)), mark.radius, mark.colour);
            }
        }
    }

    fn place(&self, (x, y): (f64, f64)) -> Option<(f64, f64)> {
        Some((self.x.place(x)?, self.y.place(y)?))
    }

    /// Returns points as positions on the axes, split where a point cannot be on them.
    fn stretches(&self, points: &[(f64, f64)]) -> Vec<Vec<(f64, f64)>> {
        let places: Vec<_> = points.iter().map(|&point| self.place(point)).collect();
        let stretches = places.split(Option::is_none).filter(|stretch| !stretch.is_empty());
        stretches.map(|stretch| stretch.iter().copied().flatten().collect()).collect()
    }

    /// Returns the entries of the legend, in rows of the width of a figure.
    fn legend(&self) -> Vec<Vec<Entry<'_>>> {
        let shapes = self.shapes.iter().map(|of| (&of.label, Sample::Area(of.colour, of.opacity)));
        let lines = self.lines.iter().map(|line| (&line.label, Sample::Line(line.stroke)));
        let marks = self.marks.iter().map(|mark| (&mark.label, Sample::Mark(mark)));
        let labelled = shapes.chain(lines).chain(marks);
        let entries = labelled.filter_map(|(words, sample)| Some(Entry { words: words.as_deref()?, sample }));
        let mut rows: Vec<Vec<_>> = Vec::new();
        let mut used = f64::INFINITY;
        for entry in entries {
            let width = entry.width();
            if used + BETWEEN + width > RIGHT - LEGEND_LEFT {
                rows.push(Vec::new());
                used = -BETWEEN;
            }
            used += BETWEEN + width;
            if let Some(row) = rows.last_mut() {
                row.push(entry);
            }
        }
        rows
    }
}

/// Draws grid, axes, ticks, and the numbers and the label of the vertical axis.
fn draw_frame(canvas: &mut Canvas, [x, y]: [&Axis; 2], on_paper: impl Fn(Point) -> Point) {
    let (grid, frame) = (Stroke::solid(GRID, HAIRLINE), Stroke::solid(SOFT_INK, HAIRLINE));
    let mut ticks = Vec::new();
    for &tick in &x.ticks {
        let (at, top) = (on_paper((tick, y.from)), on_paper((tick, y.to)));
        canvas.line(&[at, top], grid);
        ticks.push([at, (at.0, at.1 + TICK)]);
    }
    for &tick in &y.ticks {
        let (at, end) = (on_paper((x.from, tick)), on_paper((x.to, tick)));
        canvas.line(&[at, end], grid);
        ticks.push([at, (at.0 - TICK, at.1)]);
        canvas.text((at.0 - TICK - BESIDE_TICK, at.1), Align::RIGHT, &y.tick_label(tick));
    }
    let corner = on_paper((x.from, y.from));
    let (top, end) = (on_paper((x.from, y.to)), on_paper((x.to, y.from)));
    canvas.line(&[top, corner, end], frame);
    for tick in ticks {
        canvas.line(&tick, frame);
    }
    canvas.text_upwards((LABEL, f64::midpoint(corner.1, top.1)), &y.label);
}

/// Returns two names of the legend as one: `vehicle 1` and `vehicle 2` as `vehicle 1, 2`.
fn joined(first: &str, second: &str) -> String {
    let shared = first.split_once(' ').map(|(word, _)| format!("{word} "));
    let short = shared.and_then(|word| second.strip_prefix(&word));
    format!("{first}, {}", short.unwrap_or(second))
}

/// Returns the parts of a line whose ordinates are between two numbers.
fn within(points: &[(f64, f64)], [low, high]: [f64; 2]) -> Vec<Vec<(f64, f64)>> {
    let mut parts: Vec<Vec<(f64, f64)>> = Vec::new();
    for two in points.windows(2) {
        let [(x, y), (to_x, to_y)] = [two[0], two[1]];
        let shares = [low, high].map(|end| (end - y) / (to_y - y));
        let (from, to) =
            if y == to_y { (0.0, 1.0) } else { (shares[0].min(shares[1]).max(0.0), shares[0].max(shares[1]).min(1.0)) };
        if !(x + y + to_x + to_y).is_finite() || from > to || (y == to_y && !(low..=high).contains(&y)) {
            continue;
        }
        let at = |share: f64| (x + share * (to_x - x), (y + share * (to_y - y)).clamp(low, high));
        match parts.last_mut().filter(|part| from == 0.0 && part.last() == Some(&at(0.0))) {
            Some(part) => part.push(at(to)),
            None => parts.push(vec![at(from), at(to)]),
        }
    }
    parts
}

/// Entry of the legend.
struct Entry<'a> {
    words: &'a str,
    sample: Sample<'a>,
}

enum Sample<'a> {
    Area(ThemeColour, f64),
    Line(Stroke),
    Mark(&'a Mark),
}

const LEGEND_LEFT: f64 = 28.0;
const LEGEND_ROW: f64 = 18.0;
const LEGEND_MARGIN: f64 = 12.0;
/// Length of a line sample in the legend \[px\].
const SAMPLE: f64 = 18.0;
/// Space between a sample and its words, and between entries \[px\].
const SPACE: f64 = 5.0;
const BETWEEN: f64 = 12.0;

impl Entry<'_> {
    /// Returns an upper estimate of the width by the font size \[px\].
    fn width(&self) -> f64 {
        SAMPLE + SPACE + 0.6 * TEXT * self.words.chars().count() as f64
    }
}

/// Returns the height of a legend with its margins \[px\].
fn legend_height(rows: &[Vec<Entry<'_>>]) -> f64 {
    if rows.is_empty() { 0.0 } else { LEGEND_MARGIN + LEGEND_ROW * rows.len() as f64 }
}

fn draw_legend(canvas: &mut Canvas, rows: &[Vec<Entry<'_>>], top: f64) {
    for (k, row) in rows.iter().enumerate() {
        let (mut x, y) = (LEGEND_LEFT, top + LEGEND_MARGIN / 2.0 + (k as f64 + 0.5) * LEGEND_ROW);
        for entry in row {
            let end = x + SAMPLE;
            match entry.sample {
                Sample::Line(stroke) => canvas.line(&[(x, y), (end, y)], stroke),
                Sample::Area(colour, opacity) => {
                    let (top, bottom) = (y - 5.0, y + 5.0);
                    canvas.area(&[(x, top), (end, top), (end, bottom), (x, bottom)], colour, opacity);
                }
                Sample::Mark(mark) => canvas.marker(mark.marker, (x + SAMPLE / 2.0, y), mark.radius, mark.colour),
            }
            canvas.text((end + SPACE, y), Align::LEFT, entry.words);
            x += entry.width() + BETWEEN;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_lines_share_an_entry_of_the_legend() {
        let mut chart = Chart::new(Axis::time(0.0, 1.0), Axis::linear("y", [0.0, 100.0], true));
        for (k, top) in [1.0, 50.0, 1.01, 1.0].into_iter().enumerate() {
            chart.line(vec![(0.0, 0.0), (1.0, top)], Stroke::of_line(k), format!("vehicle {}", k + 1));
        }
        chart.merge_equal_lines();
        let svg = chart.figure("name", "Title", "Description.").svg;
        assert!(svg.contains(">vehicle 1, 3, 4<") && svg.contains(">vehicle 2<"), "{svg}");
        assert_eq!(joined("1-2", "2-3"), "1-2, 2-3");
    }

    #[test]
    fn a_note_names_the_end_of_a_logarithmic_axis_that_cuts_numbers() {
        let figure = |least: f64| {
            let mut chart = Chart::new(Axis::time(0.0, 1.0), Axis::log("error [m]", [1e-4, 1.0]));
            chart.line(vec![(0.0, 1.0), (1.0, least)], Stroke::of_line(0), "error");
            chart.figure("name", "Title", "Description.")
        };
        let cut = figure(1e-5);
        assert!(cut.svg.contains(">below 10⁻⁴ not shown<"), "{}", cut.svg);
        assert!(cut.description.ends_with("Values below 10⁻⁴ not shown."), "{}", cut.description);
        assert!(figure(0.0).svg.contains("not shown") && !figure(1e-4).svg.contains("not shown"));
    }

    #[test]
    fn lines_are_cut_where_they_leave_a_range() {
        let line =
            [(0.0, 3.0), (1.0, 1.0), (2.0, 0.5), (3.0, 4.5), (4.0, 5.0), (5.0, f64::NAN), (6.0, 1.0), (7.0, 1.0)];
        let expected = vec![vec![(0.5, 2.0), (1.0, 1.0), (2.0, 0.5), (2.375, 2.0)], vec![(6.0, 1.0), (7.0, 1.0)]];
        assert_eq!(within(&line, [0.0, 2.0]), expected);
        assert_eq!(within(&[(0.0, 5.0), (1.0, 5.0)], [0.0, 2.0]), Vec::<Vec<_>>::new());
        assert_eq!(within(&[(0.0, -5.0), (1.0, 5.0)], [0.0, 5.0]), [[(0.5, 0.0), (1.0, 5.0)]]);
    }
}
