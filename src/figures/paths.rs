//! Where the vehicles went.

use nalgebra::Vector3;
use plotters::chart::ChartBuilder;
use plotters::drawing::IntoDrawingArea as _;
use plotters::element::{Circle, Cross, EmptyElement, PathElement};
use plotters::prelude::SVGBackend;
use plotters::style::Color as _;
use plotters::style::RGBColor;

use super::axis::Axis;
use super::chart::{self, Chart, Drawn, GRID, INK, Line, Mark, MarkShape, PALETTE, PAPER, PX, SOFT_INK, Stroke, WIDTH};
use super::course::{Course, FEW_VEHICLES};
use super::thin::thinned;
use super::{Figure, FigureError, printable};
use crate::swarm::row;

/// Share of the extent left free on each side.
const MARGIN: f64 = 0.06;

/// Where the vehicles went, seen from above: x and y \[m\], a unit as long on both axes, a cross at each start and a
/// ring at each end. Up to 12 vehicles have their own colour and are numbered.
///
/// # Errors
/// [`FigureError`] when the drawing library refuses.
pub fn paths(course: &Course, title: &str) -> Result<Figure, FigureError> {
    let axis = |axis: usize, label: &str| {
        let (low, high) = course.extent(axis).unwrap_or((0.0, 1.0));
        let margin = MARGIN * (high - low);
        Axis::linear(label, [low - margin, high + margin], false)
    };
    let mut chart = Chart::new(axis(0, "x [m]"), axis(1, "y [m]"));
    chart.equal = true;
    for i in 0..course.vehicles() {
        let look = Look::of(i, course.vehicles());
        let points: Vec<_> = course.spans().map(|span| (span.positions_m[(i, 0)], span.positions_m[(i, 1)])).collect();
        let mark = |at: Option<&(f64, f64)>, shape, color, label: &str| {
            let label = (i == 0).then(|| label.to_owned());
            at.map(|&at| Mark { at, shape, color, size_px: look.mark_px, text: look.number.clone(), label })
        };
        chart.marks.extend(mark(points.first(), MarkShape::Cross, look.start, "start"));
        chart.marks.extend(mark(points.last(), MarkShape::Ring, look.end, "end"));
        chart.lines.push(Line { points, stroke: look.path, label: None });
    }
    chart.figure("paths", title, &description(course, "from above"))
}

/// How a vehicle is drawn.
struct Look {
    path: Stroke,
    start: RGBColor,
    end: RGBColor,
    mark_px: f64,
    number: Option<String>,
}

impl Look {
    fn of(vehicle: usize, count: usize) -> Self {
        if count <= FEW_VEHICLES {
            let path = Stroke::of_line(vehicle);
            let number = Some((vehicle + 1).to_string());
            return Self { path, start: path.color, end: path.color, mark_px: 4.5, number };
        }
        let path = Stroke { opacity: 0.45, ..Stroke::solid(PALETTE[0], 0.8) };
        let mark_px = if count <= 100 { 3.0 } else { 2.0 };
        Self { path, start: SOFT_INK, end: PALETTE[1], mark_px, number: None }
    }
}

fn description(course: &Course, from: &str) -> String {
    let (count, end_s) = (course.vehicles(), course.end_s());
    format!("Paths of {count} vehicles {from} over {end_s:.2} s; a cross marks each start and a ring each end.")
}

/// Angles of the view on a run in space \[rad\], and the height of the chart \[px\].
const YAW: f64 = 0.6;
const PITCH: f64 = 0.42;
const HEIGHT: u32 = 330;
/// Most that the box of the axes may take, across and up \[px\]; the rest is for the numbers.
const BOX: (f64, f64) = (340.0, 270.0);
/// Least space between the numbers of an axis \[px\].
const TICK_PX: f64 = 26.0;

/// Where the vehicles went in space: x, y and z \[m\] in a parallel projection, a unit as long on all axes. Marks and
/// colours as in [`paths`].
///
/// # Errors
/// [`FigureError`] when the drawing library refuses.
pub fn paths_in_space(course: &Course, title: &str) -> Result<Figure, FigureError> {
    let title = &printable(title);
    let size = (WIDTH * PX, (chart::TITLE + HEIGHT) * PX);
    let mut drawing = String::new();
    draw_in_space(course, &mut drawing, size, title).map_err(|error| FigureError::new("paths-3d", &error))?;
    Ok(Figure::framed("paths-3d", title, &description(course, "in space"), size, &drawing))
}

fn draw_in_space(course: &Course, drawing: &mut String, size: (u32, u32), title: &str) -> Drawn {
    let root = SVGBackend::with_string(drawing, size).into_drawing_area();
    root.fill(&PAPER)?;
    chart::draw_title(&root, title)?;

    let spans = [0, 1, 2].map(|axis| {
        let (low, high) = course.extent(axis).unwrap_or((0.0, 1.0));
        Axis::linear("", [low, high], true)
    });
    let [across, deep, up] = spans.each_ref().map(|axis| axis.to - axis.from);
    let seen_across = across * YAW.cos() + deep * YAW.sin();
    let seen_up = (across * YAW.sin() + deep * YAW.cos()) * PITCH.sin() + up * PITCH.cos();
    let unit = (BOX.0 / seen_across).min(BOX.1 / seen_up) * f64::from(PX);
    #[expect(clippy::cast_possible_truncation, reason = "a length within a figure")]
    let pixels = |span: f64| (unit * span).round() as i32;
    let [x, mut y, z] = spans.map(|axis| {
        let room = unit * (axis.to - axis.from) / f64::from(PX);
        Axis::spanning("", axis.from, axis.to, (room / TICK_PX).max(1.0))
    });
    // The library's second axis points up and its third towards the reader: reversed, y makes a right-handed frame.
    y.reversed = true;
    let mut plot =
        ChartBuilder::on(&root).margin_top(chart::TITLE * PX).build_cartesian_3d(x.clone(), z.clone(), y.clone())?;
    plot.set_3d_pixel_range((pixels(across), pixels(up), pixels(deep)));
    plot.with_projection(|mut view| {
        (view.yaw, view.pitch, view.scale) = (YAW, PITCH, 1.0);
        view.into_matrix()
    });
    let tick = |name: &'static str, axis: &Axis| {
        let axis = axis.clone();
        move |&place: &f64| {
            let label = axis.tick_label(place);
            if axis.ticks.last() == Some(&place) { format!("{name} = {label} m") } else { label }
        }
    };
    let (tick_x, tick_y, tick_z) = (tick("x", &x), tick("y", &y), tick("z", &z));
    plot.configure_axes()
        .tick_size(6 * PX)
        .axis_panel_style(PAPER.mix(0.0))
        .bold_grid_style(Stroke::solid(GRID, 0.8).shape())
        .label_style(chart::text(chart::TEXT, INK))
        .x_formatter(&tick_x)
        .y_formatter(&tick_z)
        .z_formatter(&tick_y)
        .draw()?;

    let shows = |p: &Vector3<f64>| [&x, &y, &z].iter().zip(p.iter()).all(|(axis, &p)| axis.place(p).is_some());
    for i in 0..course.vehicles() {
        let look = Look::of(i, course.vehicles());
        let points: Vec<_> = course.spans().map(|span| row(&span.positions_m, i)).filter(shows).collect();
        let points: Vec<_> = points.into_iter().map(|p| (p.x, p.z, p.y)).collect();
        let on_paper = |point| {
            let (right, down) = plot.plotting_area().map_coordinate(&point);
            (f64::from(right), f64::from(down))
        };
        let points = thinned(&points, on_paper);
        let (Some(&start), Some(&end)) = (points.first(), points.last()) else { continue };
        let style = |color: RGBColor| Stroke::solid(color, 1.6).shape();
        let radius = chart::tenths_i(look.mark_px);
        plot.draw_series([PathElement::new(points, look.path.shape())])?;
        plot.draw_series([Cross::new(start, radius, style(look.start))])?;
        plot.draw_series([Circle::new(end, radius, style(look.end))])?;
        if let Some(number) = look.number {
            plot.draw_series([EmptyElement::at(start) + MarkShape::Cross.beside(&number)])?;
            plot.draw_series([EmptyElement::at(end) + MarkShape::Ring.beside(&number)])?;
        }
    }
    root.present()
}
