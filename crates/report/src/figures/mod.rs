//! A run as charts in SVG.
//!
//! | function | shows |
//! | --- | --- |
//! | [`paths`] | where the vehicles went, from above: start x, end o, a unit as long on both axes |
//! | [`paths_in_space`] | the same in space, where the run is not level |
//! | [`distances`] | distances of pairs, with the safety distance and the certified one |
//! | [`control`] | control effort of each vehicle |
//! | [`channels`] | tilt, rotor thrust, wind and age of messages of each vehicle |
//! | [`energy`] | the law's energy and its start E(0), its bound on a complete graph |
//! | [`shape_error`] | largest error of a desired distance |
//! | [`disagreement`] | largest speed relative to the swarm's mean |
//! | [`encounters`] | distances of pairs of a recording, with bands where they are not known exactly |
//! | [`closest_approach`] | two paths of a recording from above, and from near where they are closest |
//! | [`smallest`] | the smallest distance of all of a recording |
//! | [`tension_curve`] | an edge tension with its barrier and its minimum |
//! | [`convergence`] | an integrator's error over its step |
//! | [`attack`] | the smallest separation that a search had found over its flights |
//! | [`margin`] | the share of flights that show something over the values of a key |
//! | [`shares`] | the same of several laws |
//! | [`separations`] | the smallest separation of flights over the values of a key |
//! | [`heat_map`](heat_map()) | a number over a grid of two keys |
//! | [`histograms`] | how often a number of many flights falls where |
//!
//! [`of_run`] draws every one that a run has data for. All of them draw a [`FlightLog`] and never fail for
//! what is in it: what is not a finite number breaks a line, and a log without samples gives empty axes. The same log
//! gives the same bytes, and their number is bounded for any swarm and any time: of many vehicles, quantiles and the extremes are drawn, and a figure says what.
//!
//! Charts use no fonts and no style but their own. They are drawn on a panel that is white, and dark where the reader
//! prefers dark pages, in colours that colour-blind people tell apart.

mod axis;
mod chart;
mod distances;
mod heat_map;
mod over_time;
mod paths;
mod recorded;
mod spans;
mod studies;
mod svg;
mod validation;

pub use distances::distances;
pub use heat_map::{GridAxis, heat_map};
pub use over_time::{channels, control, disagreement, energy, shape_error};
pub use paths::{paths, paths_in_space};
pub use recorded::{Encounter, closest_approach, encounters, smallest};
pub use studies::{Histogram, Separation, Share, attack, histograms, margin, separations, shares};
pub use validation::{Step, convergence, tension_curve};

use spans::Spans;
use tautline_laws::graph::Graph;
use tautline_laws::target::Leg;

use crate::flight_log::FlightLog;

/// A finished chart.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Figure {
    /// Short name, such as `paths`: the name of its file without `.svg`.
    pub name: String,
    /// Title, also drawn above the chart.
    pub title: String,
    /// What the chart shows, in sentences, for people who cannot see it.
    pub description: String,
    /// The chart as a complete SVG document, which may also be put into an HTML page as it is.
    pub svg: String,
}

/// What the figures of a run are measured by.
#[derive(Clone, Copy, Debug)]
pub struct Criteria<'a> {
    /// Safety distance delta \[m\].
    pub delta_m: f64,
    /// Distance that the law's certificate promised \[m\].
    pub certified_m: Option<f64>,
    /// The formations, one after the other, and the graph whose edges they are judged by.
    pub shape: Option<(&'a [Leg], &'a Graph)>,
    /// Largest edge error that counts as reached \[m\].
    pub edge_error_m: Option<f64>,
    /// Largest velocity disagreement that counts as reached \[m/s\].
    pub disagreement_m_s: Option<f64>,
    /// Most thrust of a rotor \[N\].
    pub most_thrust_n: Option<f64>,
}

/// Every figure that a run has data for, in the order in which they are best read.
#[must_use]
pub fn of_run(log: &FlightLog, criteria: &Criteria<'_>) -> Vec<Figure> {
    let spans = Spans::of(log);
    let mut figures = vec![paths(log, "Paths from above")];
    if !spans.is_level() {
        figures.push(paths_in_space(log, "Paths in space"));
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
