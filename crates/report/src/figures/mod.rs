//! Charts of runs, recordings and studies in SVG.
//!
//! | function | shows |
//! | --- | --- |
//! | [`paths`] | paths from above: start x, end o, obstacles, equal units on both axes |
//! | [`at_closest`] | paths from above with the vehicles at the closest approach |
//! | [`paths_in_space`] | paths in space, if the run is not level |
//! | [`distances`] | distances of pairs, with the safety distance and the certified one, and the clearance |
//! | [`control`] | control effort of each vehicle |
//! | [`channels`] | tilt, rotor thrust, wind and age of messages of each vehicle |
//! | [`energy`] | the law's energy and its start E(0), its bound on a complete graph |
//! | [`shape_error`] | largest error of a desired distance |
//! | [`disagreement`] | largest speed relative to the mean velocity of the swarm |
//! | [`encounters`] | distances of pairs of a recording, with bands where they are uncertain |
//! | [`closest_approach`] | two paths of a recording from above, with their closest approach enlarged |
//! | [`smallest`] | the smallest separation of all pairs of a recording |
//! | [`tension_curve`] | an edge tension with its barrier and its minimum |
//! | [`convergence`] | an integrator's error over its step |
//! | [`attack`] | the smallest separation found so far over the flights of a search |
//! | [`margin`] | the share of flights with a property over the values of a key |
//! | [`verdicts`] | the smallest separation and the verdict of single flights over the values of a key |
//! | [`by_law`] | a number of each law with its interval |
//! | [`shares`] | such shares of several laws |
//! | [`separations`] | the smallest separation of flights over the values of a key |
//! | [`heat_map`](heat_map()) | a number over a grid of two keys |
//! | [`histograms`] | distributions of a number over many flights |
//!
//! [`of_run`] draws all figures that a run has data for, from a [`FlightLog`]. Drawing never fails: numbers that are
//! not finite break a line, and a log without samples gives empty axes. Equal logs give equal bytes. The size of a
//! figure is bounded for any swarm and duration: for many vehicles it shows quantiles and extremes, and its description
//! states that.
//!
//! A file has a white panel. A page replaces the colours by those of its theme (`drawing::colours`). Colour-blind
//! readers can distinguish the colours.

mod axis;
mod chart;
mod distances;
mod heat_map;
mod labels;
mod laws;
mod outlines;
mod over_time;
mod paper;
mod paths;
mod recorded;
mod space;
mod spans;
mod studies;
mod svg;
mod validation;

pub use distances::distances;
pub use heat_map::{GridAxis, heat_map};
pub use laws::{OfLaw, by_law};
pub use over_time::{channels, control, disagreement, energy, shape_error};
pub use paper::Format;
pub use paths::{at_closest, paths};
pub use recorded::{Encounter, LowerBound, PlanLine, closest_approach, encounters, plan_distances, smallest};
pub use space::paths_in_space;
pub use studies::{Histogram, Separation, Share, attack, histograms, margin, separations, shares, verdicts};
pub use validation::{Step, convergence, tension_curve};

use spans::Spans;
use tautline_audit::MovingObstacle;
use tautline_laws::graph::Graph;
use tautline_laws::target::Leg;

use crate::flight_log::FlightLog;

/// A finished chart.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Figure {
    /// Short name, such as `paths`, which is the name of its file without `.svg`.
    pub name: String,
    /// Title, also drawn above the chart.
    pub title: String,
    /// Description in sentences, for screen readers.
    pub description: String,
    /// Chart as a complete SVG document, which can be embedded in an HTML page.
    pub svg: String,
}

/// Limits and references that the figures of a run show.
#[derive(Clone, Copy, Debug)]
pub struct Criteria<'a> {
    /// Safety distance delta \[m\].
    pub delta_m: f64,
    /// Certified separation \[m\].
    pub certified_m: Option<f64>,
    /// Formations in their order, and the graph of the desired distances.
    pub shape: Option<(&'a [Leg], &'a Graph)>,
    /// Largest edge error that counts as reached \[m\].
    pub edge_error_m: Option<f64>,
    /// Largest velocity disagreement that counts as reached \[m/s\].
    pub disagreement_m_s: Option<f64>,
    /// Largest thrust of a rotor \[N\].
    pub most_thrust_n: Option<f64>,
    /// Obstacles.
    pub obstacles: &'a [MovingObstacle],
}

/// Draws all figures that a run has data for, in reading order.
#[must_use]
pub fn of_run(log: &FlightLog, criteria: &Criteria<'_>) -> Vec<Figure> {
    let spans = Spans::of(log);
    let mut figures = vec![paths(log, criteria.obstacles, "Paths from above")];
    if !spans.is_level() {
        figures.push(paths_in_space(log, criteria.obstacles, "Paths in space"));
    }
    if log.count() > 1 {
        let scaled = if log.metric().is_metres() { "" } else { ", scaled to ellipsoids" };
        let title = format!("Distances between vehicles{scaled}");
        figures.push(distances(log, criteria.delta_m, criteria.certified_m, &title));
    }
    figures.push(control(log, "Control effort"));
    figures.extend(channels(log, criteria.most_thrust_n));
    if log.energy_initial().is_some() {
        figures.push(energy(log, "Energy"));
    }
    if let Some((legs, graph)) = criteria.shape {
        figures.push(shape_error(log, legs, graph, criteria.edge_error_m, "Shape error"));
    }
    figures.push(disagreement(log, criteria.disagreement_m_s, "Velocity disagreement"));
    figures
}

/// Returns round times from one time to another \[s\] with their labels, for the axis of a chart.
pub(crate) fn time_ticks(from_s: f64, to_s: f64) -> Vec<(f64, String)> {
    let axis = axis::Axis::time(from_s, to_s);
    axis.ticks.iter().map(|&tick| (tick, axis.tick_label(tick))).collect()
}

/// Names of all figures of an audit of a recording.
pub const NAMES_OF_AUDIT: [&str; 5] = ["encounters", "closest-approach", "smallest", "obstacles", "plan"];

/// Names of all figures that [`of_run`] can draw.
pub const NAMES_OF_RUN: [&str; 11] = [
    "paths",
    "paths-3d",
    "distances",
    "control",
    "attitude",
    "rotors",
    "wind",
    "message-age",
    "energy",
    "shape-error",
    "disagreement",
];
