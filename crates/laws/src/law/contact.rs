//! The nearest vehicles of a formation on the edge of pushing each other, as they are at the goal.

use super::modes::Mode;
use super::tension::EdgeTension;
use crate::formation::Formation;
use crate::graph::Graph;
use crate::space::NearPairs;

/// Distances of slots that differ by less, relatively, are the same one.
const SAME: f64 = 1e-6;

/// The stiffest mode there: those at the nearest slots push each other with `V_R''` at R, which adds at most its product with the
/// largest eigenvalue of the Laplacian of who is nearest. None for fewer than two vehicles.
pub(super) fn in_contact(free: Mode, tension: &EdgeTension, formation: &Formation) -> Option<Mode> {
    let (_, nearest_m) = formation.min_distance()?;
    let mut near = NearPairs::default();
    near.update(&formation.slots_m, nearest_m * (1.0 + SAME));
    let nearest = Graph::from_edges(formation.count(), near.pairs()).ok()?;
    let pushes_per_s2 = tension.second_derivative(tension.rest_m()) * nearest.largest_eigenvalue();
    Some(Mode { stiffness_per_s2: free.stiffness_per_s2 + pushes_per_s2, ..free })
}
