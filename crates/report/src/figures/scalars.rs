//! Single numbers of a run over time.

use super::axis::Axis;
use super::chart::Chart;
use super::each::of_each;
use super::figure::Figure;
use super::history::{RunHistory, Span};
use super::svg::{INK, PALETTE, Stroke};
use tautline_core::record::Event;
use tautline_laws::formation::{edges_looked_at, largest_edge_error_m};
use tautline_laws::graph::Graph;
use tautline_laws::target::{Course, Leg};

/// Distances that are computed for the shape error, at most.
const DISTANCES: usize = 16_000_000;
/// Fewest instants that its curve is drawn through.
const FEWEST_INSTANTS: usize = 48;

/// Control effort |u| \[m/s^2\] over time \[s\]: a line for each of up to 12 vehicles; of more vehicles the largest
/// effort, the median and the band that holds nine tenths of them.
#[must_use]
pub fn control(history: &RunHistory, title: &str) -> Figure {
    let count = history.vehicles();
    let peak = history.spans().flat_map(|span| &span.control_m_s2).copied().fold(0.0, f64::max);
    let y =
        Axis::linear("control effort |u| [m/s²]", history.spans().flat_map(Span::finite_control).chain([0.0]), true);
    let mut chart = Chart::new(history.time_axis(), y);
    of_each(&mut chart, history, |span| &span.control_m_s2);
    let description = format!("Control effort of {count} vehicles over time; at most {peak:.3} m/s².");
    chart.figure("control", title, &description)
}

/// The law's energy \[m^2/s^2\] over time \[s\] with E(0), which on a complete graph it never exceeds.
#[must_use]
pub fn energy(history: &RunHistory, title: &str) -> Figure {
    let points: Vec<_> = history.spans().filter_map(|span| Some((span.time_s, span.energy?))).collect();
    let initial = history.energy_initial();
    let y = Axis::linear("energy E [m²/s²]", points.iter().map(|&(_, y)| y).chain(initial).chain([0.0]), true);
    let largest = points.iter().map(|&(_, y)| y).fold(f64::NAN, f64::max);
    let mut chart = Chart::new(history.time_axis(), y);
    chart.line(points, Stroke::solid(PALETTE[0], 1.8), "E(t)");
    let mut comparison = String::new();
    if let Some(initial) = initial {
        chart.level(initial, Stroke::dashed(INK, 1.3), format!("E(0) = {initial:.4} m²/s²"));
        let excess = largest / initial - 1.0;
        comparison = if initial == 0.0 && largest > 0.0 {
            format!(" It begins at nothing and rises to {largest:.4} m²/s².")
        } else if excess > 0.0 {
            format!(" It exceeds E(0), {initial:.4} m²/s², by a share of {excess:.1e}.")
        } else {
            format!(" It never exceeds E(0), {initial:.4} m²/s².")
        };
    }
    chart.figure("energy", title, &format!("The law's energy over time.{comparison}"))
}

/// Largest error of a desired distance over the graph's edges \[m\], on a logarithmic axis, over time \[s\]: of the formation
/// of the leg that was under way.
///
/// `allowed_m` is what counts as reached.
#[must_use]
pub fn shape_error(history: &RunHistory, legs: &[Leg], graph: &Graph, allowed_m: Option<f64>, title: &str) -> Figure {
    let count = history.vehicles();
    let fits = !legs.is_empty() && legs.iter().all(|leg| leg.formation.count() == count) && graph.count() == count;
    let instants = history.spread((DISTANCES / edges_looked_at(graph).max(1)).max(FEWEST_INSTANTS));
    let mut course = Course::new(legs);
    for turn in &history.turns {
        match turn {
            &Event::LegBegan { leg, time_s } => course.begin(leg, time_s),
            Event::Assigned { slots, time_s } => course.assign(slots, *time_s),
            _ => {}
        }
    }
    let error = |span: &&Span| {
        let formation = course.formation_at(span.time_s)?;
        Some((span.time_s, largest_edge_error_m(&span.positions_m, formation, graph)))
    };
    let points = if fits { instants.iter().filter_map(error).collect() } else { Vec::new() };
    decay(history, "shape-error", title, "largest edge error", "m", points, allowed_m)
}

/// Largest speed relative to the swarm's mean velocity \[m/s\], on a logarithmic axis, over time \[s\].
///
/// `allowed_m_s` is what counts as reached.
#[must_use]
pub fn disagreement(history: &RunHistory, allowed_m_s: Option<f64>, title: &str) -> Figure {
    let points = history.spans().map(|span| (span.time_s, span.disagreement_m_s)).collect();
    decay(history, "disagreement", title, "velocity disagreement", "m/s", points, allowed_m_s)
}

/// A number that should vanish, on a logarithmic axis, with the largest value that counts as vanished.
fn decay(
    history: &RunHistory,
    name: &str,
    title: &str,
    what: &str,
    unit: &str,
    points: Vec<(f64, f64)>,
    allowed: Option<f64>,
) -> Figure {
    let y = Axis::log(&format!("{what} [{unit}]"), points.iter().map(|&(_, y)| y).chain(allowed));
    let at_end = points.last().map_or(f64::NAN, |&(_, y)| y);
    let mut chart = Chart::new(history.time_axis(), y);
    chart.line(points, Stroke::solid(PALETTE[0], 1.8), what);
    if let Some(allowed) = allowed {
        chart.level(allowed, Stroke::dashed(INK, 1.3), format!("counts as reached: {allowed} {unit}"));
    }
    let description = format!("The {what} over time on a logarithmic axis; {at_end:.2e} {unit} at the end.");
    chart.figure(name, title, &description)
}
