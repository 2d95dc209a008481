//! What a flight is after: its formation, and how hard an edge of its graph pulls.

use crate::formation::Formation;
use crate::graph::Graph;
use crate::law::{EdgeTension, EdgeTensionKeys, LawSpec};
use crate::scenario::Scenario;
use crate::swarm::Pair;

/// Formation, graph and how hard an edge pulls.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The slots to be reached.
    pub formation: Formation,
    /// Who senses whom.
    pub graph: Graph,
    law: LawSpec,
    delta_m: f64,
}

impl Plan {
    /// Formation, graph and law of a scenario.
    pub(in crate::render) fn of(scenario: &Scenario) -> Self {
        Self {
            formation: scenario.formation().clone(),
            graph: scenario.graph.clone(),
            law: scenario.law.clone(),
            delta_m: scenario.delta_m,
        }
    }

    /// How hard the edge between two vehicles pulls (above 0) or pushes (below 0) at a distance \[m\], from -1 to 1.
    ///
    /// For an edge tension it is V'(l) over its limit alpha/K, which is 1 far away and reaches -1 at
    /// `l = delta + K asinh(1/sqrt 2)`. Any other law is taken for a spring: its elongation over the desired distance.
    #[expect(clippy::cast_possible_truncation, reason = "the share of a colour")]
    pub(in crate::render) fn tension(&self, pair: Pair, distance_m: f64) -> f32 {
        let tension = match self.edge_tension(pair) {
            Some((alpha, edge)) => edge.derivative(distance_m) * edge.k_m() / alpha,
            None => self.elongation(pair, distance_m),
        };
        tension.clamp(-1.0, 1.0) as f32
    }

    /// How hard the law accelerates a vehicle along its edge to another at a distance \[m\], in m/s^2: V'(l)/N, above 0
    /// where it pulls, below 0 where it pushes, minus infinity at or inside delta. None under a law without an edge tension.
    #[cfg(feature = "window")]
    pub(in crate::render) fn pull_m_s2(&self, pair: Pair, distance_m: f64) -> Option<f64> {
        let vehicles = self.formation.slots_m.nrows() as f64;
        self.edge_tension(pair).map(|(_, edge)| edge.derivative(distance_m) / vehicles)
    }

    /// How much longer a distance \[m\] is than the desired one, over that one.
    pub(in crate::render) fn elongation(&self, pair: Pair, distance_m: f64) -> f64 {
        let rest_m = self.formation.desired_distance(pair.first(), pair.second());
        (distance_m - rest_m) / rest_m
    }

    /// Alpha \[m^2/s^2\] and the tension of an edge, where the law has one.
    fn edge_tension(&self, pair: Pair) -> Option<(f64, EdgeTension)> {
        let LawSpec::EdgeTension(EdgeTensionKeys { alpha }) = self.law else { return None };
        let rest_m = self.formation.desired_distance(pair.first(), pair.second());
        Some((alpha, EdgeTension::new(alpha, self.delta_m, rest_m).ok()?))
    }
}
