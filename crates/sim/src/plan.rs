//! [`Plan`]: formations of a flight, their placement over the swarm, and edge tensions, for pictures and reports.

use std::sync::LazyLock;

use nalgebra::{Matrix3, Vector3};

use crate::scenario::Scenario;
use tautline_core::obstacle::Obstacle;
use tautline_core::record::Event;
use tautline_core::swarm::{Pair, row};
use tautline_core::swarm::{Rows, mean_row};
use tautline_laws::formation::{Formation, Freedom, RigidMotion, best_rigid_motion};
use tautline_laws::graph::Graph;
use tautline_laws::law::LawSpec;
use tautline_laws::law::{EdgeTension, EdgeTensionKeys};
use tautline_laws::target::{Guidance, LegHistory};

/// Smallest number of vehicles of a show.
const SHOW: usize = 60;

/// Formations, graph and edge tensions of a flight.
#[derive(Clone, Debug)]
pub struct Plan {
    course: LegHistory,
    guidance: Option<Guidance>,
    freedom: Freedom,
    /// Pairs that sense each other.
    pub graph: Graph,
    law: LawSpec,
    delta_m: f64,
    /// Obstacles.
    pub obstacles: Vec<Obstacle>,
}

impl Plan {
    /// Creates the plan of a scenario.
    #[must_use]
    pub fn of(scenario: &Scenario) -> Self {
        Self {
            course: LegHistory::new(&scenario.legs),
            guidance: scenario.reference.clone(),
            freedom: scenario.flown_law().map_or(Freedom::RigidMotion, |law| law.capabilities().controls.freedom()),
            graph: scenario.graph.clone(),
            law: scenario.law.clone(),
            delta_m: scenario.delta_m,
            obstacles: scenario.obstacles.clone(),
        }
    }

    /// Updates the plan with an event.
    pub fn note(&mut self, event: &Event) {
        self.course.note(event);
    }

    /// Returns the leg in progress at a time \[s\], from 0, and the number of legs.
    #[must_use]
    pub fn leg_at(&self, time_s: f64) -> (usize, usize) {
        (self.course.leg_at(time_s), self.course.count())
    }

    /// Returns whether many vehicles fly through several flat formations, such as words. Pictures draw them as lights.
    #[must_use]
    pub fn is_show(&self) -> bool {
        let slots_m = &self.formation_at(f64::NEG_INFINITY).slots_m;
        let is_flat = slots_m.column(2).iter().all(|&z| z == slots_m[(0, 2)]);
        self.graph.count() >= SHOW && self.course.count() > 1 && slots_m.nrows() > 0 && is_flat
    }

    /// Returns the target slots at a time \[s\].
    #[must_use]
    pub fn formation_at(&self, time_s: f64) -> &Formation {
        static NOWHERE: LazyLock<Formation> = LazyLock::new(|| Formation::line(0, 1.0));
        self.course.formation_at(time_s).unwrap_or(&NOWHERE)
    }

    /// Returns the position of the reference at a time \[s\] \[m\]; `None` without a reference.
    #[must_use]
    pub fn reference_at(&self, time_s: f64) -> Option<Vector3<f64>> {
        self.guidance.as_ref().map(|guidance| guidance.motion.at(time_s).position_m)
    }

    /// Returns the vehicle that follows only the reference, from 0.
    #[must_use]
    pub fn leader(&self) -> Option<usize> {
        self.guidance.as_ref()?.known_by.leader()
    }

    /// Returns the rigid motion, among those that the law leaves free, that best fits the slots at a time \[s\] to the
    /// vehicles; `None` if positions are unknown.
    #[must_use]
    pub fn laid_at(&self, time_s: f64, positions_m: &Rows) -> Option<RigidMotion> {
        let formation = self.formation_at(time_s);
        let moved = |translation_m| RigidMotion { rotation: Matrix3::identity(), translation_m };
        match self.freedom {
            Freedom::Fixed => self.reference_at(time_s).map(moved),
            Freedom::Translation if positions_m.nrows() == formation.count() => {
                Some(mean_row(positions_m) - mean_row(&formation.slots_m))
                    .filter(|by_m| by_m.iter().all(|x| x.is_finite()))
                    .map(moved)
            }
            Freedom::Translation => None,
            Freedom::RigidMotion => best_rigid_motion(positions_m, formation),
        }
    }

    /// Returns the slots at a time \[s\], fitted to the vehicles \[m\]; `None` if positions are unknown.
    #[must_use]
    pub fn slots_at(&self, time_s: f64, positions_m: &Rows) -> Option<Vec<Vector3<f64>>> {
        let (laid, slots_m) = (self.laid_at(time_s, positions_m)?, &self.formation_at(time_s).slots_m);
        Some((0..slots_m.nrows()).map(|k| laid.apply(row(slots_m, k))).collect())
    }

    /// Returns the formations with the times at which they begin \[s\], in order; the first begins at the start.
    #[must_use]
    pub fn formations(&self) -> Vec<(f64, &Formation)> {
        self.course.formations()
    }

    /// Returns the safety distance \[m\].
    #[must_use]
    pub fn delta_m(&self) -> f64 {
        self.delta_m
    }

    /// Returns whether edges have a tension; otherwise they are drawn as springs.
    #[must_use]
    pub fn has_tension(&self) -> bool {
        matches!(self.law, LawSpec::EdgeTension(_))
    }

    /// Returns the tension of an edge at a distance \[m\] and a time \[s\], from -1 (push) to 1 (pull).
    ///
    /// For an edge tension it is V'(l) over its limit alpha/K, which is 1 far away and -1 at `l = delta + K
    /// asinh(1/sqrt 2)`. For any other law it is the elongation relative to the desired distance.
    #[expect(clippy::cast_possible_truncation, reason = "the share of a colour")]
    #[must_use]
    pub fn tension(&self, pair: Pair, distance_m: f64, time_s: f64) -> f32 {
        let tension = match self.edge_tension(pair, time_s) {
            Some((alpha, edge)) => edge.derivative(distance_m) * edge.k_m() / alpha,
            None => self.elongation(pair, distance_m, time_s),
        };
        tension.clamp(-1.0, 1.0) as f32
    }

    /// Returns the acceleration of a vehicle along its edge to another at a distance \[m\], in m/s^2: V'(l)/N. It is
    /// positive for a pull, negative for a push, and minus infinity at or within delta. `None` under a law without an
    /// edge tension.
    #[must_use]
    pub fn pull_m_s2(&self, pair: Pair, distance_m: f64, time_s: f64) -> Option<f64> {
        let vehicles = self.graph.count() as f64;
        self.edge_tension(pair, time_s).map(|(_, edge)| edge.derivative(distance_m) / vehicles)
    }

    /// Returns the excess of a distance \[m\] over the desired one, relative to the desired one.
    #[must_use]
    pub fn elongation(&self, pair: Pair, distance_m: f64, time_s: f64) -> f64 {
        let rest_m = self.formation_at(time_s).desired_distance(pair.first(), pair.second());
        (distance_m - rest_m) / rest_m
    }

    /// Returns alpha \[m^2/s^2\] and the tension of an edge, if the law has one.
    fn edge_tension(&self, pair: Pair, time_s: f64) -> Option<(f64, EdgeTension)> {
        let LawSpec::EdgeTension(EdgeTensionKeys { alpha }) = self.law else { return None };
        let rest_m = self.formation_at(time_s).desired_distance(pair.first(), pair.second());
        Some((alpha, EdgeTension::new(alpha, self.delta_m, rest_m).ok()?))
    }
}
