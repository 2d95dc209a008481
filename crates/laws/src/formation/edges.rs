//! How far distances of vehicles are from those that are desired.

use super::Formation;
use super::fit::two_farthest_m;
use crate::graph::Graph;
use tautline_core::swarm::{Rows, row};

/// Edges of a complete graph up to which each of them is looked at.
const MOST_EDGES: usize = 1_000_000;

/// Edges or vehicles that [`largest_edge_error_m`] looks at.
#[must_use]
pub fn edges_looked_at(graph: &Graph) -> usize {
    if is_bounded(graph) { graph.count() } else { graph.edge_count() }
}

/// Whether pairs are too many to be looked at one by one.
fn is_bounded(graph: &Graph) -> bool {
    graph.is_complete() && graph.edge_count() > MOST_EDGES
}

/// Largest error of a desired distance over the edges of the graph, `max |l_ij - d_ij|` \[m\]; 0 without edges.
///
/// On a complete graph of more than a million edges (1414 vehicles) a bound on it, in O(N): no distance is off by more than
/// its two vehicles are from their slots, so the two largest of these distances are added, from the formation as
/// [`best_rigid_motion`](super::best_rigid_motion) lays it over the swarm. Two vehicles that are off in opposite directions reach it.
///
/// NaN where a position of an edge is NaN, or where positions, formation and graph do not have the same number of
/// vehicles.
#[must_use]
pub fn largest_edge_error_m(positions_m: &Rows, formation: &Formation, graph: &Graph) -> f64 {
    let count = positions_m.nrows();
    if formation.count() != count || graph.count() != count {
        return f64::NAN;
    }
    if is_bounded(graph) {
        return two_farthest_m(positions_m, formation);
    }
    let mut largest = 0.0;
    for i in 0..count {
        let (position, slot) = (row(positions_m, i), row(&formation.slots_m, i));
        for j in graph.later_neighbours(i) {
            let distance_m = (row(positions_m, j) - position).norm();
            let error = (distance_m - (row(&formation.slots_m, j) - slot).norm()).abs();
            if error.is_nan() {
                return f64::NAN;
            }
            largest = f64::max(largest, error);
        }
    }
    largest
}
