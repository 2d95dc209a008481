//! All figures of a run.

use super::channels::channels;
use super::distances::distances;
use super::figure::Figure;
use super::history::RunHistory;
use super::paths::{paths, paths_in_space};
use super::scalars::{control, disagreement, energy, shape_error};
use tautline_laws::graph::Graph;
use tautline_laws::target::Leg;

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
pub fn of_run(history: &RunHistory, criteria: &Criteria<'_>) -> Vec<Figure> {
    let mut figures = vec![paths(history, "Paths from above")];
    if !history.is_level() {
        figures.push(paths_in_space(history, "Paths in space"));
    }
    if history.vehicles() > 1 {
        let scaled = if history.metric().is_metres() { "" } else { ", scaled to ellipsoids" };
        let title = format!("Distances between vehicles{scaled}");
        figures.push(distances(history, criteria.delta_m, criteria.certified_m, &title));
    }
    figures.push(control(history, "Control effort"));
    figures.extend(channels(history, criteria.most_thrust_n));
    if history.energy_initial().is_some() {
        figures.push(energy(history, "Energy"));
    }
    if let Some((legs, graph)) = criteria.shape {
        figures.push(shape_error(history, legs, graph, criteria.edge_error_m, "Shape error"));
    }
    figures.push(disagreement(history, criteria.disagreement_m_s, "Velocity disagreement"));
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
