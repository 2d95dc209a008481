//! Single numbers of a run over time.

use super::axis::Axis;
use super::chart::{Band, Chart, INK, Line, PALETTE, Stroke};
use super::course::{Course, FEW_VEHICLES, Span};
use super::distances::{instants, quantile, time_axis};
use super::{Figure, FigureError};
use crate::formation::{Formation, largest_edge_error_m};
use crate::graph::Graph;

/// Control effort |u| \[m/s^2\] over time \[s\]: a line for each of up to 12 vehicles; of more vehicles the largest
/// effort, the median and the band that holds nine tenths of them.
///
/// # Errors
/// [`FigureError`] when the drawing library refuses.
pub fn control(course: &Course, title: &str) -> Result<Figure, FigureError> {
    let (bands, lines) =
        if course.vehicles() <= FEW_VEHICLES { control_of_each(course) } else { control_of_many(course) };
    let numbers = lines.iter().flat_map(|line| line.points.iter().map(|&(_, y)| y));
    let y = Axis::linear("control effort |u| [m/s²]", numbers.chain([0.0]), true);
    let peak = course.spans().flat_map(|span| &span.control_m_s2).copied().fold(0.0, f64::max);
    let mut chart = Chart::new(time_axis(course), y);
    (chart.bands, chart.lines) = (bands, lines);
    let count = course.vehicles();
    let description = format!("Control effort of {count} vehicles over time; at most {peak:.3} m/s².");
    chart.figure("control", title, &description)
}

fn control_of_each(course: &Course) -> (Vec<Band>, Vec<Line>) {
    let lines = (0..course.vehicles()).map(|i| Line {
        points: course.spans().map(|span| (span.time_s, span.control_m_s2[i])).collect(),
        stroke: Stroke::of_line(i),
        label: Some(format!("vehicle {}", i + 1)),
    });
    (Vec::new(), lines.collect())
}

fn control_of_many(course: &Course) -> (Vec<Band>, Vec<Line>) {
    let (mut largest, mut median, mut middle) = (Vec::new(), Vec::new(), Vec::new());
    for span in course.spans() {
        let mut efforts: Vec<_> = span.control_m_s2.iter().copied().filter(|u| u.is_finite()).collect();
        let [low, half, high, top] = [0.05, 0.5, 0.95, 1.0].map(|share| quantile(&mut efforts, share));
        largest.push((span.time_s, top));
        median.push((span.time_s, half));
        middle.push((span.time_s, low, high));
    }
    let line = |points, stroke, label: &str| Line { points, stroke, label: Some(label.to_owned()) };
    let lines = vec![
        line(largest, Stroke::solid(PALETTE[1], 1.5), "largest"),
        line(median, Stroke::solid(PALETTE[0], 1.5), "median"),
    ];
    let band = Band { points: middle, color: PALETTE[0], opacity: 0.2, label: Some("5 to 95 %".to_owned()) };
    (vec![band], lines)
}

/// The law's energy \[m^2/s^2\] over time \[s\] with E(0), which on a complete graph it never exceeds.
///
/// # Errors
/// [`FigureError`] when the drawing library refuses.
pub fn energy(course: &Course, title: &str) -> Result<Figure, FigureError> {
    let points: Vec<_> = course.spans().filter_map(|span| Some((span.time_s, span.energy?))).collect();
    let initial = course.energy_initial();
    let y = Axis::linear("energy E [m²/s²]", points.iter().map(|&(_, y)| y).chain(initial).chain([0.0]), true);
    let largest = points.iter().map(|&(_, y)| y).fold(f64::NAN, f64::max);
    let mut chart = Chart::new(time_axis(course), y);
    chart.lines.push(Line { points, stroke: Stroke::solid(PALETTE[0], 1.8), label: Some("E(t)".to_owned()) });
    let mut comparison = String::new();
    if let Some(initial) = initial {
        chart.level(initial, Stroke::dashed(INK, 1.3), format!("E(0) = {initial:.4} m²/s²"));
        let excess = largest / initial - 1.0;
        comparison = if excess > 0.0 {
            format!(" It exceeds E(0), {initial:.4} m²/s², by a share of {excess:.1e}.")
        } else {
            format!(" It never exceeds E(0), {initial:.4} m²/s².")
        };
    }
    let description = format!("The law's energy over time.{comparison}");
    chart.figure("energy", title, &description)
}

/// Largest error of a desired distance over the graph's edges \[m\], on a logarithmic axis, over time \[s\].
///
/// `allowed_m` is what counts as reached.
///
/// # Errors
/// [`FigureError`] when the drawing library refuses.
pub fn shape_error(
    course: &Course,
    formation: &Formation,
    graph: &Graph,
    allowed_m: Option<f64>,
    title: &str,
) -> Result<Figure, FigureError> {
    let fits = formation.count() == course.vehicles() && graph.count() == course.vehicles();
    let error = |span: &&Span| (span.time_s, largest_edge_error_m(&span.positions_m, formation, graph));
    let points = if fits { instants(course).iter().map(error).collect() } else { Vec::new() };
    decay(course, "shape-error", title, "largest edge error [m]", "m", points, allowed_m)
}

/// Largest speed relative to the swarm's mean velocity \[m/s\], on a logarithmic axis, over time \[s\].
///
/// `allowed_m_s` is what counts as reached.
///
/// # Errors
/// [`FigureError`] when the drawing library refuses.
pub fn disagreement(course: &Course, allowed_m_s: Option<f64>, title: &str) -> Result<Figure, FigureError> {
    let points = course.spans().map(|span| (span.time_s, span.disagreement_m_s)).collect();
    decay(course, "disagreement", title, "velocity disagreement [m/s]", "m/s", points, allowed_m_s)
}

/// A number that should vanish, on a logarithmic axis, with the largest value that counts as vanished.
fn decay(
    course: &Course,
    name: &str,
    title: &str,
    label: &str,
    unit: &str,
    points: Vec<(f64, f64)>,
    allowed: Option<f64>,
) -> Result<Figure, FigureError> {
    let y = Axis::log(label, points.iter().map(|&(_, y)| y).chain(allowed));
    let at_end = points.last().map_or(f64::NAN, |&(_, y)| y);
    let what = label.split(" [").next().unwrap_or(label);
    let mut chart = Chart::new(time_axis(course), y);
    chart.lines.push(Line { points, stroke: Stroke::solid(PALETTE[0], 1.8), label: Some(what.to_owned()) });
    if let Some(allowed) = allowed {
        chart.level(allowed, Stroke::dashed(INK, 1.3), format!("counts as reached: {allowed} {unit}"));
    }
    let description = format!("The {what} over time on a logarithmic axis; {at_end:.2e} {unit} at the end.");
    chart.figure(name, title, &description)
}
