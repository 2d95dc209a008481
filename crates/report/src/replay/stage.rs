//! What a replay shows beside motion.

use tautline_audit::Obstacle;
use tautline_sim::plan::Plan;
use tautline_sim::scenario::Scenario;

/// Who flies, what must stay empty around them, what they are after and what is in the way.
#[derive(Clone, Debug)]
pub struct Stage {
    /// Names of the vehicles.
    pub vehicles: Vec<String>,
    /// Radius of each vehicle \[m\]; none where it is not known.
    pub radius_m: Vec<Option<f64>>,
    /// Half axes of the shell around each vehicle \[m\], half of what two centres must keep; none where there is no such
    /// distance.
    pub shell_m: Option<[f64; 3]>,
    /// Formations and graph, where they are known.
    pub plan: Option<Plan>,
    /// What is in the way.
    pub obstacles: Vec<Obstacle>,
}

/// Radius of a vehicle of which nothing is known, at most \[m\].
const UNKNOWN_RADIUS_M: f64 = 0.1;

impl Stage {
    /// What a vehicle of unknown radius is drawn with \[m\]: two that keep their distance do not touch.
    pub(super) fn unknown_radius_m(&self) -> f64 {
        self.shell_m.into_iter().flatten().fold(UNKNOWN_RADIUS_M, f64::min)
    }

    /// How many of these vehicles have no known radius, where there are any, and what they are drawn with \[m\].
    pub(super) fn unknown_radii(&self, vehicles: &[usize]) -> Option<(usize, f64)> {
        let unknown =
            vehicles.iter().filter(|&&vehicle| self.radius_m.get(vehicle).copied().flatten().is_none()).count();
        (unknown > 0).then(|| (unknown, self.unknown_radius_m()))
    }

    pub(super) fn drawn_radius_m(&self, vehicle: usize) -> f64 {
        self.radius_m.get(vehicle).copied().flatten().unwrap_or_else(|| self.unknown_radius_m())
    }

    /// That of a scenario, with its obstacles as they are judged. What is told in the course of the flight is for
    /// [`Film`](super::Film) to note.
    #[must_use]
    pub fn of(scenario: &Scenario, obstacles: Vec<Obstacle>) -> Self {
        Self {
            vehicles: (1..=scenario.count()).map(|number| number.to_string()).collect(),
            radius_m: scenario.hull_radius_m.iter().copied().map(Some).collect(),
            shell_m: Some(scenario.half_axes_m().unwrap_or([0.5 * scenario.delta_m; 3])),
            plan: Some(Plan::of(scenario)),
            obstacles,
        }
    }
}
