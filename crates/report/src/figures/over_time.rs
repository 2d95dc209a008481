//! Quantities of a run over time.

use super::Figure;
use super::axis::Axis;
use super::chart::{Chart, LEGEND, Line, Mark, Shape};
use super::distances::quantile;
use super::spans::{Span, Spans};
use super::svg::Stroke;
use crate::drawing::colours::{INK, VEHICLES};
use crate::flight_log::{FEW_VEHICLES, FlightLog, ROTORS, SERIES};
use tautline_core::text::up_to;
use tautline_laws::formation::{evaluated_edges, largest_edge_error_m};
use tautline_laws::graph::Graph;
use tautline_laws::target::{Leg, LegHistory};

/// Largest number of distances that are computed for the shape error.
const DISTANCES: usize = 16_000_000;
/// Smallest number of instants on its curve.
const FEWEST_INSTANTS: usize = 48;

/// Share of the flight whose peak may hide the rest, and the smallest ratio of the peaks at which it does.
const BEGINNING: f64 = 0.05;
const SPIKE: f64 = 5.0;
/// Smallest effort on a logarithmic axis, relative to the largest after the beginning.
const DECADES: f64 = 1e-3;

/// Returns the largest control effort after the beginning of a flight \[m/s^2\], if it is not zero.
fn later_peak(spans: &Spans<'_>) -> Option<f64> {
    let [from_s, to_s] = spans.log.range_s();
    let later = spans.iter().filter(|span| span.time_s > from_s + BEGINNING * (to_s - from_s));
    let efforts = later.flat_map(|span| &span.extremes.control_m_s2).copied().filter(|x| x.is_finite());
    Some(efforts.fold(0.0, f64::max)).filter(|&later| later > 0.0)
}

/// Draws the control effort |u| \[m/s^2\] over time \[s\]. Up to 12 vehicles have a line each. For more vehicles the
/// figure shows the largest effort, the median, and the band from 5 to 95 %. The peak over all steps has a mark if the
/// samples miss it. The axis is logarithmic if the peak of the start would hide the rest.
#[must_use]
pub fn control(log: &FlightLog, title: &str) -> Figure {
    let spans = Spans::of(log);
    let count = spans.vehicles();
    let sampled = || spans.iter().flat_map(|span| &span.extremes.control_m_s2).copied().filter(|x| x.is_finite());
    let peak = log.peak_control();
    let numbers = || sampled().chain(peak.map(|[peak, _]| peak));
    let y = match later_peak(&spans).filter(|&later| numbers().fold(0.0, f64::max) > SPIKE * later) {
        Some(later) => {
            let shown = numbers().map(|effort| effort.max(DECADES * later));
            Axis::log("control effort |u| [m/s^2], logarithmic", shown)
        }
        None => Axis::linear("control effort |u| [m/s^2]", numbers().chain([0.0]), true),
    };
    let mut chart = Chart::new(spans.time_axis(), y);
    of_each(&mut chart, &spans, |span| &span.extremes.control_m_s2);
    if let Some([peak, time_s]) = peak.filter(|[peak, _]| *peak > sampled().fold(0.0, f64::max)) {
        chart.marks.push(Mark::ring((time_s, peak), INK, Some(format!("peak of all steps {} m/s^2", up_to(peak)))));
    }
    let peak = peak.map_or(0.0, |[peak, _]| peak);
    let description = format!("Control effort of {count} vehicles over time; at most {} m/s^2.", up_to(peak));
    chart.figure("control", title, &description)
}

/// Draws a figure for each channel of the run over time \[s\], with lines and bands like those of [`control`].
///
/// Channels are tilt \[degrees\], largest thrust of a rotor \[N\], wind speed \[m/s\] and age of the oldest message
/// \[s\].
///
/// `most_thrust_n` is the largest thrust of a rotor.
#[must_use]
pub fn channels(log: &FlightLog, most_thrust_n: Option<f64>) -> Vec<Figure> {
    let spans = Spans::of(log);
    let has = |k: &usize| spans.iter().any(|span| !span.extremes.series[*k].is_empty());
    (0..SERIES.len()).filter(has).map(|k| channel(&spans, k, most_thrust_n)).collect()
}

fn channel(spans: &Spans<'_>, k: usize, most_thrust_n: Option<f64>) -> Figure {
    let series = &SERIES[k];
    let (what, unit, count) = (series.what, series.unit, spans.vehicles());
    let most = most_thrust_n.filter(|_| series.name == ROTORS);
    let numbers =
        || spans.iter().flat_map(|span| &span.extremes.series[k]).copied().filter(|number| number.is_finite());
    let peak = numbers().fold(f64::NAN, f64::max);
    let y = Axis::linear(&format!("{what} [{unit}]"), numbers().chain(most).chain([0.0]), true);
    let mut chart = Chart::new(spans.time_axis(), y);
    of_each(&mut chart, spans, |span| &span.extremes.series[k]);
    let gap = if unit == "°" { "" } else { " " };
    let mut description = format!("The {what} of {count} vehicles over time; at most {}{gap}{unit}.", up_to(peak));
    if let Some(most) = most {
        chart.level(most, Stroke::dashed(INK, 1.3), format!("maximum of a rotor {most} N"));
        description = format!("{description} A rotor gives at most {most} N.");
    }
    chart.figure(series.name, series.title, &description)
}

/// Draws a line for each of up to 12 vehicles; for more vehicles the largest number, the median, and the band from 5 to
/// 95 %. A span without numbers breaks the lines.
fn of_each(chart: &mut Chart, spans: &Spans<'_>, numbers: impl for<'b> Fn(&'b Span<'_>) -> &'b [f64]) {
    let count = spans.vehicles();
    if count <= FEW_VEHICLES {
        let points = |i: usize| -> Vec<(f64, f64)> {
            let number = |span| numbers(span).get(i).copied().unwrap_or(f64::NAN);
            spans.iter().map(|span| (span.time_s, number(span))).collect()
        };
        // Colours are those of the vehicles with the largest numbers.
        let mut order: Vec<_> = (0..count).collect();
        if count > LEGEND {
            let peak = |i: usize| points(i).iter().map(|point| point.1).fold(f64::NEG_INFINITY, f64::max);
            let peaks: Vec<_> = (0..count).map(peak).collect();
            order.sort_by(|&a, &b| peaks[b].total_cmp(&peaks[a]));
        }
        let (coloured, others) = order.split_at(if count > LEGEND { LEGEND - 1 } else { count });
        let grey = |points, label| Line { points, stroke: Stroke::of_others(), label };
        chart.lines.extend(others.iter().map(|&i| grey(points(i), None)));
        let mut coloured = coloured.to_vec();
        coloured.sort_unstable();
        for i in coloured {
            chart.line(points(i), Stroke::of_line(i), format!("vehicle {}", i + 1));
        }
        chart.merge_equal_lines();
        if !others.is_empty() {
            chart.lines.push(grey(Vec::new(), Some(format!("{} other vehicles", others.len()))));
        }
    } else {
        let ranks = spans.iter().map(|span| {
            let mut finite: Vec<_> = numbers(span).iter().copied().filter(|number| number.is_finite()).collect();
            (span.time_s, [0.05, 0.5, 0.95, 1.0].map(|share| quantile(&mut finite, share)))
        });
        let ranks: Vec<_> = ranks.collect();
        let points = |k: usize| ranks.iter().map(|(time_s, ranks)| (*time_s, ranks[k])).collect();
        chart.line(points(3), Stroke::solid(VEHICLES[1], 1.5), "largest");
        chart.line(points(1), Stroke::solid(VEHICLES[0], 1.5), "median");
        let points: Vec<_> = ranks.iter().map(|&(time_s, [low, _, high, _])| (time_s, low, high)).collect();
        chart.shapes.push(Shape::band(&points, VEHICLES[0], 0.2, "5 to 95 %".to_owned()));
    }
}

/// Draws the law's energy \[m^2/s^2\] over time \[s\] with E(0), which bounds it on a complete graph.
#[must_use]
pub fn energy(log: &FlightLog, title: &str) -> Figure {
    let spans = Spans::of(log);
    let points: Vec<_> = spans.iter().filter_map(|span| Some((span.time_s, span.extremes.energy?))).collect();
    let initial = log.energy_initial();
    let y = Axis::linear("energy E [m^2/s^2]", points.iter().map(|&(_, y)| y).chain(initial).chain([0.0]), true);
    let largest = points.iter().map(|&(_, y)| y).fold(f64::NAN, f64::max);
    let mut chart = Chart::new(spans.time_axis(), y);
    chart.line(points, Stroke::solid(VEHICLES[0], 1.8), "E(t)");
    let mut comparison = String::new();
    if let Some(initial) = initial {
        chart.level(initial, Stroke::dashed(INK, 1.3), format!("E(0) = {initial:.4} m^2/s^2"));
        let excess = largest / initial - 1.0;
        comparison = if initial == 0.0 && largest > 0.0 {
            format!(" It starts at zero and rises to {largest:.4} m^2/s^2.")
        } else if excess > 0.0 {
            format!(" It exceeds E(0), {initial:.4} m^2/s^2, by a share of {excess:.1e}.")
        } else {
            format!(" It never exceeds E(0), {initial:.4} m^2/s^2.")
        };
    }
    chart.figure("energy", title, &format!("The law's energy over time.{comparison}"))
}

/// Draws the largest error of a desired distance over the graph's edges \[m\], on a logarithmic axis, over time \[s\].
/// The formation is that of the current leg.
///
/// `allowed_m` is the largest error that counts as reached.
#[must_use]
pub fn shape_error(log: &FlightLog, legs: &[Leg], graph: &Graph, allowed_m: Option<f64>, title: &str) -> Figure {
    let spans = Spans::of(log);
    let count = spans.vehicles();
    let fits = !legs.is_empty() && legs.iter().all(|leg| leg.formation.count() == count) && graph.count() == count;
    let instants = spans.spread((DISTANCES / evaluated_edges(graph).max(1)).max(FEWEST_INSTANTS));
    let mut course = LegHistory::new(legs);
    log.targets().iter().for_each(|event| course.note(event));
    let error = |span: &&Span<'_>| {
        let formation = course.formation_at(span.time_s)?;
        Some((span.time_s, largest_edge_error_m(span.positions_m, formation, graph)))
    };
    let points = if fits { instants.iter().filter_map(error).collect() } else { Vec::new() };
    decay(&spans, "shape-error", title, "largest edge error", "m", points, allowed_m)
}

/// Draws the largest speed relative to the mean velocity of the swarm \[m/s\], on a logarithmic axis, over time \[s\].
///
/// `allowed_m_s` is the largest disagreement that counts as reached.
#[must_use]
pub fn disagreement(log: &FlightLog, allowed_m_s: Option<f64>, title: &str) -> Figure {
    let spans = Spans::of(log);
    let points = spans.iter().map(|span| (span.time_s, span.extremes.disagreement_m_s)).collect();
    decay(&spans, "disagreement", title, "velocity disagreement", "m/s", points, allowed_m_s)
}

/// Draws a quantity that should vanish on a logarithmic axis, with its tolerance.
fn decay(
    spans: &Spans<'_>,
    name: &str,
    title: &str,
    what: &str,
    unit: &str,
    points: Vec<(f64, f64)>,
    allowed: Option<f64>,
) -> Figure {
    let y = Axis::log(&format!("{what} [{unit}]"), points.iter().map(|&(_, y)| y).chain(allowed));
    let at_end = points.last().map_or(f64::NAN, |&(_, y)| y);
    let mut chart = Chart::new(spans.time_axis(), y);
    chart.line(points, Stroke::solid(VEHICLES[0], 1.8), what);
    if let Some(allowed) = allowed {
        chart.level(allowed, Stroke::dashed(INK, 1.3), format!("counts as reached: {allowed} {unit}"));
    }
    let at_end = if at_end == 0.0 { "0".to_owned() } else { format!("{at_end:.2e}") };
    let description = format!("The {what} over time on a logarithmic axis; {at_end} {unit} at the end.");
    chart.figure(name, title, &description)
}
