//! Drift of the swarm by its mean velocity: its distance, and whether floating-point numbers resolve positions there.

use nalgebra::DMatrix;
use serde::Serialize;

use super::{Preflight, warning};
use crate::scenario::{LARGEST, Scenario};
use tautline_core::swarm::row;
use tautline_laws::formation::Formation;
use tautline_laws::graph::Graph;

/// Fewest spacings of floating-point numbers within the arrival tolerance at which a drift is harmless.
const FINE_SPACINGS: f64 = 100.0;
/// Smallest drift by the growth of the mean velocity that is reported, relative to delta.
const VISIBLE_DRIFT: f64 = 0.01;

impl Preflight {
    /// Describes the growth of the mean velocity and the distance over which it carries the swarm.
    fn drift_in_words(&self, scenario: &Scenario, why: &str) -> String {
        let drift = scenario.drift(self.common_mode_rate_per_s);
        let seed = if scenario.start.mean_velocity_m_s().norm() > 0.0 { "it" } else { "rounding" };
        format!(
            "the mean velocity grows as exp({} t), since {why}: in {} s {seed} grows to about {} m/s and carries the \
             whole swarm {} m away",
            self.common_mode_rate_per_s,
            scenario.time.duration_s,
            warning::significant(drift.speed_m_s),
            warning::significant(drift.distance_m)
        )
    }

    pub(super) fn drift_unresolved(&self, scenario: &Scenario) -> Option<String> {
        let (needed_m, spacing_m) = (scenario.arrival.edge_error_m, self.spacing_m);
        let unresolved = if spacing_m > needed_m {
            format!("where the position resolution is {} m; {needed_m} m is required", warning::significant(spacing_m))
        } else if self.drift_rounding_m(scenario) > needed_m {
            let rounding_m = warning::significant(self.drift_rounding_m(scenario));
            format!("where the rounding of all steps adds up to {rounding_m} m; {needed_m} m is required")
        } else if self.drift_m > LARGEST {
            format!("beyond the limit of {LARGEST:e} m")
        } else {
            return None;
        };
        let said = if self.common_mode_rate_per_s > 0.0 {
            self.drift_in_words(scenario, self.why_common_mode_grows(scenario))
        } else {
            format!("the mean velocity carries the whole swarm {} m away", warning::significant(self.drift_m))
        };
        Some(format!(
            "Positions are not resolved: {said}, {unresolved}. Reduce time.duration_s, or the cause of the mean \
             velocity."
        ))
    }

    /// Returns a bound of the rounding errors of all steps of the drift \[m\].
    ///
    /// A step rounds the position x to eps |x|/2 and the velocity to 3 eps |v|/2. The error of the velocity moves the
    /// vehicle in all later steps. With x growing as exp(r t), the sum over steps of dt is 4 (eps/2) x/(r dt). With a
    /// constant velocity it is 2 (eps/2) x T/dt.
    fn drift_rounding_m(&self, scenario: &Scenario) -> f64 {
        let time = &scenario.time;
        let uniform = 2.0 * time.duration_s / time.dt_s;
        let rate_dt = self.common_mode_rate_per_s.max(0.0) * time.dt_s;
        0.5 * f64::EPSILON * self.drift_m * uniform.min(4.0 / rate_dt)
    }

    pub(super) fn why_common_mode_grows(&self, scenario: &Scenario) -> &'static str {
        if self.common_mode_rate_per_s < scenario.velocity_coefficient_per_s() {
            "the law damps it too little"
        } else {
            "the law cannot move the centre of mass"
        }
    }

    /// Returns a note on the growth of the mean velocity, if it carries the swarm a visible distance.
    pub(super) fn drift_note(&self, scenario: &Scenario) -> Option<String> {
        let is_visible = self.drift_m >= VISIBLE_DRIFT * scenario.delta_m;
        if self.common_mode_rate_per_s <= 0.0 || !is_visible || self.drift_unresolved(scenario).is_some() {
            return None;
        }
        let effect = if FINE_SPACINGS * self.spacing_m <= scenario.arrival.edge_error_m {
            "; this changes no separation".to_owned()
        } else {
            let spacing = warning::significant(self.spacing_m);
            format!(", where the position resolution is {spacing} m; reduce time.duration_s or swarm.a22_per_s")
        };
        Some(self.drift_in_words(scenario, self.why_common_mode_grows(scenario)) + &effect)
    }
}

/// Relative offset below which a point counts as within a line or plane: far above rounding (1e-16), far below any
/// intended offset.
pub const FLATNESS: f64 = 1e-9;

/// Largest number of vehicles for which the rank is computed on an incomplete graph, in O((3 N)^3): one or two seconds.
pub const MOST_RANKED: usize = 200;

/// Relative size above which eigenvalues of R^T R count towards the rank. Rounding leaves up to 1e-13 in the rigid
/// motions at [`MOST_RANKED`] vehicles; a mode 1e11 times softer than another has no effect in any flight.
pub const RANK_TOLERANCE: f64 = 1e-11;

/// Infinitesimal rigidity of a formation on its graph.
///
/// Row (i, j) of the rigidity matrix R is the unit vector along the edge in the columns of i and its opposite in those
/// of j. R times the velocities of the slots is the rate of the edge lengths. The formation is rigid if only rigid
/// motions keep all lengths, that is if R has the rank of the complete graph. Then the law's stiffness matrix R^T
/// diag(V'') R / N at the formation has no other zero modes, and convergence is exponential. Otherwise convergence is
/// algebraic at best.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Rigidity {
    /// Rank of R, the same in the plane and in space; null for an incomplete graph of more than [`MOST_RANKED`]
    /// vehicles.
    pub rank: Option<usize>,
    /// Rank of a rigid formation: n N - n (n + 1)/2 in n dimensions, N (N - 1)/2 for N <= n vehicles.
    pub needed: usize,
    /// Whether the formation is rigid; null if unknown.
    pub rigid: Option<bool>,
    #[serde(skip)]
    pub(super) edges: usize,
}

impl Rigidity {
    /// Computes the rigidity of a formation in a space of n = `dimensions`.
    ///
    /// On the complete graph, slots that span k dimensions give the rank k N - k (k + 1)/2. On other graphs the rank is
    /// the number of nonzero eigenvalues of R^T R. A graph with fewer edges than needed is never rigid.
    #[must_use]
    pub fn of(formation: &Formation, graph: &Graph, dimensions: usize) -> Self {
        let count = formation.count();
        let rank = if graph.is_complete() {
            Some(needed(count, formation.affine_dimension(FLATNESS)))
        } else if count <= MOST_RANKED {
            Some(rank(formation, graph))
        } else {
            None
        };
        Self { rank, needed: 0, rigid: None, edges: graph.edge_count() }.within(dimensions, count)
    }

    /// Returns the rigidity of the same formation of `count` vehicles in a space (or its own affine hull) of another
    /// dimension.
    #[must_use]
    pub fn within(self, dimensions: usize, count: usize) -> Self {
        let needed = needed(count, dimensions);
        let too_few_edges = (self.edges < needed).then_some(false);
        Self { needed, rigid: self.rank.map_or(too_few_edges, |rank| Some(rank >= needed)), ..self }
    }
}

/// Returns the rank of the rigidity matrix of the complete graph on `count` points in general position in a space
/// of dimension `dimensions`.
fn needed(count: usize, dimensions: usize) -> usize {
    if count <= dimensions {
        count * count.saturating_sub(1) / 2
    } else {
        dimensions * count - dimensions * (dimensions + 1) / 2
    }
}

pub(super) fn rank(formation: &Formation, graph: &Graph) -> usize {
    let count = formation.count();
    let mut gram = DMatrix::zeros(3 * count, 3 * count);
    for (i, j) in graph.edges() {
        let along = (row(&formation.slots_m, j) - row(&formation.slots_m, i)).normalize();
        let block = along * along.transpose();
        for (a, b, sign) in [(i, i, 1.0), (j, j, 1.0), (i, j, -1.0), (j, i, -1.0)] {
            let mut view = gram.fixed_view_mut::<3, 3>(3 * a, 3 * b);
            view += block * sign;
        }
    }
    if !gram.iter().all(|x: &f64| x.is_finite()) {
        return 0;
    }
    let eigenvalues = gram.symmetric_eigenvalues();
    let largest = eigenvalues.amax();
    eigenvalues.iter().filter(|&&value| value > RANK_TOLERANCE * largest).count()
}
