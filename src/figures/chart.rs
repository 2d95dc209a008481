//! A chart as plain data, and its drawing.
//!
//! The drawing library counts in whole pixels, so a chart is drawn ten times as large as it is shown.

use std::fmt::Write as _;

use plotters::chart::{ChartBuilder, ChartContext, LabelAreaPosition};
use plotters::coord::CoordTranslate;
use plotters::coord::Shift;
use plotters::coord::cartesian::Cartesian2d;
use plotters::drawing::{DrawingArea, DrawingAreaErrorKind, IntoDrawingArea as _};
use plotters::element::{Circle, Cross, EmptyElement, PathElement, PointCollection, Polygon, Text};
use plotters::prelude::SVGBackend;
use plotters::series::DashedLineSeries;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color as _, RGBColor, ShapeStyle, TextStyle};

use super::axis::Axis;
use super::thin::thinned;
use super::{Figure, FigureError, printable};

/// Parts of a pixel in which charts are drawn.
pub(super) const PX: u32 = 10;
/// Width of a figure \[px\].
pub(super) const WIDTH: u32 = 460;
/// Space for the numbers and the label of the vertical axis \[px\].
const LEFT: u32 = 58;
const MARGIN: u32 = 6;
const RIGHT: u32 = 16;
pub(super) const TITLE: u32 = 32;
/// Space for the numbers and the label of the horizontal axis \[px\].
const BELOW: u32 = 44;
const LEGEND_ROW: u32 = 18;
const LEGEND_MARGIN: u32 = 12;
/// Height of the plotting area \[px\]; with equal axes it follows the data between the two others.
const HEIGHT: u32 = 240;
const LEAST_HEIGHT: u32 = 130;
const MOST_HEIGHT: u32 = 380;
/// Font sizes \[px\].
pub(super) const TEXT: f64 = 13.0;
const HEADING: f64 = 14.0;
/// The library scales fonts by this before it writes them.
const FONT_FACTOR: f64 = 1.24;

/// Neutral colours.
pub(super) const PAPER: RGBColor = RGBColor(0xFF, 0xFF, 0xFF);
pub(super) const INK: RGBColor = RGBColor(0x1B, 0x1F, 0x24);
pub(super) const SOFT_INK: RGBColor = RGBColor(0x57, 0x60, 0x6A);
pub(super) const GRID: RGBColor = RGBColor(0xE1, 0xE4, 0xE8);

/// Colours that colour-blind people tell apart (after Okabe and Ito), each with a contrast of at least 3 on both papers.
pub(super) const PALETTE: [RGBColor; 6] = [
    RGBColor(0x00, 0x72, 0xB2),
    RGBColor(0xD5, 0x5E, 0x00),
    RGBColor(0x00, 0x93, 0x6C),
    RGBColor(0xB8, 0x5F, 0x95),
    RGBColor(0x9A, 0x76, 0x00),
    RGBColor(0x7D, 0x85, 0x8E),
];

/// Every colour and its counterpart for readers who prefer dark pages.
const DARK: [(RGBColor, RGBColor); 10] = [
    (PAPER, RGBColor(0x14, 0x19, 0x1F)),
    (INK, RGBColor(0xE6, 0xEA, 0xEF)),
    (SOFT_INK, RGBColor(0x9A, 0xA4, 0xAF)),
    (GRID, RGBColor(0x2A, 0x32, 0x3B)),
    (PALETTE[0], RGBColor(0x56, 0xA8, 0xE0)),
    (PALETTE[1], RGBColor(0xF0, 0x7F, 0x2E)),
    (PALETTE[2], RGBColor(0x2F, 0xBF, 0x94)),
    (PALETTE[3], RGBColor(0xDB, 0x8D, 0xBB)),
    (PALETTE[4], RGBColor(0xCB, 0xA4, 0x2B)),
    (PALETTE[5], RGBColor(0xA5, 0xAD, 0xB6)),
];

/// The style sheet that exchanges the colours on dark pages.
pub(super) fn style() -> String {
    let hex = |RGBColor(red, green, blue)| format!("#{red:02X}{green:02X}{blue:02X}");
    let mut style = "@media (prefers-color-scheme:dark){".to_owned();
    for (light, dark) in DARK.map(|(light, dark)| (hex(light), hex(dark))) {
        for attribute in ["fill", "stroke"] {
            // Writing to a string cannot fail.
            let _ = write!(style, ".tautline-figure [{attribute}=\"{light}\"]{{{attribute}:{dark}}}");
        }
    }
    style + "}"
}

/// How a line is stroked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stroke {
    pub(super) color: RGBColor,
    pub(super) width_px: f64,
    pub(super) opacity: f64,
    pub(super) dash: Dash,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Dash {
    Solid,
    Dashed,
    Dotted,
}

impl Stroke {
    pub(super) fn solid(color: RGBColor, width_px: f64) -> Self {
        Self { color, width_px, opacity: 1.0, dash: Dash::Solid }
    }

    pub(super) fn dashed(color: RGBColor, width_px: f64) -> Self {
        Self { dash: Dash::Dashed, ..Self::solid(color, width_px) }
    }

    /// The stroke of the `k`-th of several lines: colours first, then dashes.
    pub(super) fn of_line(k: usize) -> Self {
        let dash = [Dash::Solid, Dash::Dashed, Dash::Dotted][(k / PALETTE.len()) % 3];
        Self { dash, ..Self::solid(PALETTE[k % PALETTE.len()], 1.5) }
    }

    pub(super) fn shape(self) -> ShapeStyle {
        ShapeStyle { color: self.color.mix(self.opacity), filled: false, stroke_width: tenths(self.width_px) }
    }
}

/// A line through points in the units of the axes; it breaks where a point has no place on them.
#[derive(Clone, Debug)]
pub(super) struct Line {
    pub(super) points: Vec<(f64, f64)>,
    pub(super) stroke: Stroke,
    pub(super) label: Option<String>,
}

/// An area between two curves over the same abscissae: (x, low, high).
#[derive(Clone, Debug)]
pub(super) struct Band {
    pub(super) points: Vec<(f64, f64, f64)>,
    pub(super) color: RGBColor,
    pub(super) opacity: f64,
    pub(super) label: Option<String>,
}

/// A mark at a point, perhaps with a text beside it.
#[derive(Clone, Debug)]
pub(super) struct Mark {
    pub(super) at: (f64, f64),
    pub(super) shape: MarkShape,
    pub(super) color: RGBColor,
    pub(super) size_px: f64,
    pub(super) text: Option<String>,
    pub(super) label: Option<String>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum MarkShape {
    Cross,
    Ring,
}

impl MarkShape {
    /// A text beside a mark: to the lower left of a cross and to the upper right of a ring, so that the numbers of one
    /// that ends where it started stay apart.
    pub(super) fn beside(self, words: &str) -> Text<'static, (i32, i32), String> {
        let (x, y, pos) = match self {
            Self::Cross => (-5.0, 4.0, Pos::new(HPos::Right, VPos::Top)),
            Self::Ring => (6.0, -3.0, Pos::new(HPos::Left, VPos::Bottom)),
        };
        Text::new(words.to_owned(), (tenths_i(x), tenths_i(y)), text(TEXT, INK).pos(pos))
    }
}

impl Mark {
    fn draw<'a, C: CoordTranslate>(&self, area: &DrawingArea<SVGBackend<'a>, C>, place: C::From) -> Drawn
    where
        for<'b> &'b Cross<C::From, i32>: PointCollection<'b, C::From>,
        for<'b> &'b Circle<C::From, i32>: PointCollection<'b, C::From>,
    {
        let (radius, shape) = (tenths_i(self.size_px), Stroke::solid(self.color, 1.6).shape());
        match self.shape {
            MarkShape::Cross => area.draw(&Cross::new(place, radius, shape)),
            MarkShape::Ring => area.draw(&Circle::new(place, radius, shape)),
        }
    }
}

/// A chart.
#[derive(Clone, Debug)]
pub(super) struct Chart {
    pub(super) x: Axis,
    pub(super) y: Axis,
    /// A unit is as long on both axes.
    pub(super) equal: bool,
    pub(super) bands: Vec<Band>,
    pub(super) lines: Vec<Line>,
    pub(super) marks: Vec<Mark>,
}

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Plot<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<Axis, Axis>>;
pub(super) type Drawn<T = ()> = Result<T, DrawingAreaErrorKind<std::io::Error>>;

impl Chart {
    pub(super) fn new(x: Axis, y: Axis) -> Self {
        Self { x, y, equal: false, bands: Vec::new(), lines: Vec::new(), marks: Vec::new() }
    }

    /// Adds a horizontal line across the chart.
    pub(super) fn level(&mut self, y: f64, stroke: Stroke, label: String) {
        let ends = [self.x.from, self.x.to];
        self.lines.push(Line { points: ends.map(|x| (x, y)).to_vec(), stroke, label: Some(label) });
    }

    /// Draws the chart under a title.
    pub(super) fn figure(mut self, name: &str, title: &str, description: &str) -> Result<Figure, FigureError> {
        let title = &printable(title);
        let height_px = if self.equal { self.make_axes_equal() } else { HEIGHT };
        let legend = legend_rows(self.entries());
        let legend_px = legend_height(&legend);
        let size = (WIDTH * PX, (TITLE + height_px + BELOW + legend_px) * PX);
        let mut drawing = String::new();
        self.draw(&mut drawing, size, title, &legend).map_err(|error| FigureError::new(name, &error))?;
        Ok(Figure::framed(name, title, description, size, &drawing))
    }

    /// Widens one range until a unit is as long on both axes; returns the height of the plotting area \[px\].
    fn make_axes_equal(&mut self) -> u32 {
        let width = f64::from(WIDTH - MARGIN - LEFT - RIGHT);
        let (across, up) = (self.x.to - self.x.from, self.y.to - self.y.from);
        let height = (width * up / across).clamp(f64::from(LEAST_HEIGHT), f64::from(MOST_HEIGHT)).round();
        let unit = (across / width).max(up / height);
        let widen = |axis: &Axis, pixels: f64, tick_px: f64| {
            let (middle, half) = (0.5 * (axis.from + axis.to), 0.5 * unit * pixels);
            Axis::spanning(&axis.label, middle - half, middle + half, pixels / tick_px)
        };
        (self.x, self.y) = (widen(&self.x, width, 60.0), widen(&self.y, height, 40.0));
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
        let height = height as u32;
        height
    }

    fn draw(&self, drawing: &mut String, size: (u32, u32), title: &str, legend: &[Vec<Entry<'_>>]) -> Drawn {
        let root = SVGBackend::with_string(drawing, size).into_drawing_area();
        root.fill(&PAPER)?;
        draw_title(&root, title)?;
        let legend_top = size.1 - legend_height(legend) * PX;
        let (upper, lower) = root.split_vertically(legend_top);
        let mut plot = self.plot_area(&upper)?;
        for band in &self.bands {
            self.draw_band(&mut plot, band)?;
        }
        for line in &self.lines {
            self.draw_line(&mut plot, line)?;
        }
        for mark in &self.marks {
            self.draw_mark(&mut plot, mark)?;
        }
        for (k, row) in legend.iter().enumerate() {
            let middle = f64::from(LEGEND_MARGIN) / 2.0 + (k as f64 + 0.5) * f64::from(LEGEND_ROW);
            draw_legend_row(&lower, row, middle)?;
        }
        root.present()
    }

    /// The frame, the grid, the ticks and the labels.
    fn plot_area<'a, 'b>(&self, area: &'a Area<'b>) -> Drawn<Plot<'a, 'b>> {
        let mut plot = ChartBuilder::on(area)
            .margin_top(TITLE * PX)
            .margin_left(MARGIN * PX)
            .margin_right(RIGHT * PX)
            .set_label_area_size(LabelAreaPosition::Left, LEFT * PX)
            .set_label_area_size(LabelAreaPosition::Bottom, BELOW * PX)
            .build_cartesian_2d(self.x.clone(), self.y.clone())?;
        let hairline = |color: RGBColor| Stroke::solid(color, 0.8).shape();
        plot.configure_mesh()
            .bold_line_style(hairline(GRID))
            .axis_style(hairline(SOFT_INK))
            .label_style(text(TEXT, INK))
            .axis_desc_style(text(TEXT, INK))
            .set_all_tick_mark_size(4 * PX)
            .x_desc(self.x.label.as_str())
            .y_desc(self.y.label.as_str())
            .draw()?;
        Ok(plot)
    }

    fn place(&self, (x, y): (f64, f64)) -> Option<(f64, f64)> {
        Some((self.x.place(x)?, self.y.place(y)?))
    }

    /// Points as places, in unbroken stretches without points that nobody can see.
    fn stretches(&self, plot: &Plot<'_, '_>, points: &[(f64, f64)]) -> Vec<Vec<(f64, f64)>> {
        let (width, height) = plot.plotting_area().dim_in_pixel();
        let per_x = f64::from(width) / (self.x.to - self.x.from);
        let per_y = f64::from(height) / (self.y.to - self.y.from);
        let places: Vec<_> = points.iter().map(|&point| self.place(point)).collect();
        places
            .split(Option::is_none)
            .map(|stretch| stretch.iter().copied().flatten().collect::<Vec<_>>())
            .filter(|stretch| !stretch.is_empty())
            .map(|stretch| thinned(&stretch, |(x, y)| (x * per_x, y * per_y)))
            .collect()
    }

    fn draw_line(&self, plot: &mut Plot<'_, '_>, line: &Line) -> Drawn {
        for stretch in self.stretches(plot, &line.points) {
            let shape = line.stroke.shape();
            if let [only] = stretch[..] {
                // A line through one point would not be seen.
                let dot = Circle::new(only, tenths_i(1.5), ShapeStyle { filled: true, ..shape });
                plot.draw_series([dot])?;
                continue;
            }
            match line.stroke.dash {
                Dash::Solid => plot.draw_series([PathElement::new(stretch, shape)]).map(drop)?,
                Dash::Dashed => plot.draw_series(DashedLineSeries::new(stretch, 6 * PX, 4 * PX, shape)).map(drop)?,
                Dash::Dotted => plot.draw_series(DashedLineSeries::new(stretch, 2 * PX, 3 * PX, shape)).map(drop)?,
            }
        }
        Ok(())
    }

    fn draw_band(&self, plot: &mut Plot<'_, '_>, band: &Band) -> Drawn {
        let curve = |side: fn(&(f64, f64, f64)) -> (f64, f64)| {
            let points: Vec<_> = band.points.iter().map(side).collect();
            self.stretches(plot, &points).concat()
        };
        let (mut outline, high) = (curve(|&(x, low, _)| (x, low)), curve(|&(x, _, high)| (x, high)));
        outline.extend(high.into_iter().rev());
        if outline.len() > 2 {
            plot.draw_series([Polygon::new(outline, band.color.mix(band.opacity))])?;
        }
        Ok(())
    }

    fn draw_mark(&self, plot: &mut Plot<'_, '_>, mark: &Mark) -> Drawn {
        let Some(place) = self.place(mark.at) else { return Ok(()) };
        let area = plot.plotting_area();
        mark.draw(area, place)?;
        match &mark.text {
            Some(words) => area.draw(&(EmptyElement::at(place) + mark.shape.beside(words))),
            None => Ok(()),
        }
    }

    fn entries(&self) -> Vec<Entry<'_>> {
        let entry =
            |words: &Option<String>, sample| words.as_deref().map(|words| Entry { words: words.to_owned(), sample });
        let bands = self.bands.iter().filter_map(|band| entry(&band.label, Sample::Band(band)));
        let lines = self.lines.iter().filter_map(|line| entry(&line.label, Sample::Line(line.stroke)));
        let marks = self.marks.iter().filter_map(|mark| entry(&mark.label, Sample::Mark(mark)));
        bands.chain(lines).chain(marks).collect()
    }
}

/// An entry of the legend.
struct Entry<'a> {
    words: String,
    sample: Sample<'a>,
}

enum Sample<'a> {
    Band(&'a Band),
    Line(Stroke),
    Mark(&'a Mark),
}

/// Length of a legend's sample \[px\].
const SAMPLE: f64 = 18.0;
/// Space between a sample and its words, and between entries \[px\].
const SPACE: f64 = 5.0;
const BETWEEN: f64 = 12.0;

impl Entry<'_> {
    /// Width by a crude estimate of the font \[px\], rather that of a wide one.
    fn width_px(&self) -> f64 {
        SAMPLE + SPACE + 0.6 * TEXT * self.words.chars().count() as f64
    }
}

/// Entries in rows as wide as a figure.
fn legend_rows(entries: Vec<Entry<'_>>) -> Vec<Vec<Entry<'_>>> {
    let room = f64::from(WIDTH - RIGHT) - legend_left();
    let mut rows: Vec<Vec<_>> = Vec::new();
    let mut used = f64::INFINITY;
    for entry in entries {
        let width = entry.width_px();
        if used + BETWEEN + width > room {
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

/// Height of a legend with its margins \[px\].
fn legend_height(rows: &[Vec<Entry<'_>>]) -> u32 {
    if rows.is_empty() {
        return 0;
    }
    LEGEND_MARGIN + rows.iter().map(|_| LEGEND_ROW).sum::<u32>()
}

fn legend_left() -> f64 {
    f64::from(LEFT) - 30.0
}

fn draw_legend_row(area: &Area<'_>, row: &[Entry<'_>], y_px: f64) -> Drawn {
    let mut x_px = legend_left();
    let at = |x_px: f64, y_px: f64| (tenths_i(x_px), tenths_i(y_px));
    for entry in row {
        let (from, middle, to) = (at(x_px, y_px), at(x_px + SAMPLE / 2.0, y_px), at(x_px + SAMPLE, y_px));
        match &entry.sample {
            Sample::Line(stroke) => match stroke.dash {
                Dash::Solid => area.draw(&PathElement::new(vec![from, to], stroke.shape()))?,
                Dash::Dashed | Dash::Dotted => {
                    let period = if stroke.dash == Dash::Dashed { 10.0 } else { 5.0 };
                    let dash = if stroke.dash == Dash::Dashed { 6.0 } else { 2.0 };
                    let mut start = 0.0;
                    while start < SAMPLE {
                        let ends = vec![at(x_px + start, y_px), at(x_px + (start + dash).min(SAMPLE), y_px)];
                        area.draw(&PathElement::new(ends, stroke.shape()))?;
                        start += period;
                    }
                }
            },
            Sample::Band(band) => {
                let (top, bottom) = (y_px - 5.0, y_px + 5.0);
                let corners = vec![at(x_px, top), at(x_px + SAMPLE, top), at(x_px + SAMPLE, bottom), at(x_px, bottom)];
                area.draw(&Polygon::new(corners, band.color.mix(band.opacity)))?;
            }
            Sample::Mark(mark) => mark.draw(area, middle)?,
        }
        let style = text(TEXT, INK).pos(Pos::new(HPos::Left, VPos::Center));
        area.draw_text(&entry.words, &style, at(x_px + SAMPLE + SPACE, y_px))?;
        x_px += entry.width_px() + BETWEEN;
    }
    Ok(())
}

/// The title above a chart.
pub(super) fn draw_title(root: &Area<'_>, title: &str) -> Drawn {
    let middle = f64::from(MARGIN + LEFT + WIDTH - RIGHT) / 2.0;
    let style = text(HEADING, INK).pos(Pos::new(HPos::Center, VPos::Bottom));
    root.draw_text(title, &style, (tenths_i(middle), tenths_i(22.0)))
}

/// Text of a size \[px\].
pub(super) fn text(size_px: f64, color: RGBColor) -> TextStyle<'static> {
    let style = TextStyle::from(("sans-serif", size_px * f64::from(PX) * FONT_FACTOR));
    TextStyle { color: color.to_backend_color(), ..style }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a length within a figure")]
fn tenths(px: f64) -> u32 {
    (px * f64::from(PX)).round() as u32
}

#[expect(clippy::cast_possible_truncation, reason = "a length within a figure")]
pub(super) fn tenths_i(px: f64) -> i32 {
    (px * f64::from(PX)).round() as i32
}
