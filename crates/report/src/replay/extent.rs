//! How far a flight goes.

use nalgebra::Vector3;

use super::film::Film;
use super::stage::Stage;
use tautline_audit::{Obstacle, Shape};
use tautline_core::swarm::row;

/// Least half of an edge \[m\].
const LEAST_M: f64 = 1e-6;

/// A box around a flight, with the shells and with the obstacles that are not far larger than it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extent {
    pub(super) low_m: Vector3<f64>,
    pub(super) high_m: Vector3<f64>,
}

impl Extent {
    /// That of the vehicles that are shown.
    pub(super) fn of(stage: &Stage, film: &Film, shown: &[usize]) -> Self {
        let (mut low, mut high) = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
        let places = film.positions_m.iter().flat_map(|at| shown.iter().map(move |&vehicle| row(at, vehicle)));
        for at in places.filter(|at| at.iter().all(|x| x.is_finite())) {
            (low, high) = (low.inf(&at), high.sup(&at));
        }
        if low.x > high.x {
            (low, high) = (Vector3::zeros(), Vector3::zeros());
        }
        let radii = shown.iter().map(|&vehicle| stage.drawn_radius_m(vehicle));
        let around_m = radii.chain(stage.shell_m.into_iter().flatten()).fold(LEAST_M, f64::max);
        (low, high) = (low.add_scalar(-around_m), high.add_scalar(around_m));
        let (size_m, middle) = ((high - low).norm(), 0.5 * (low + high));
        for (least, most) in stage.obstacles.iter().flat_map(boxes) {
            if (least - middle).amax().max((most - middle).amax()) < 2.0 * size_m {
                (low, high) = (low.inf(&least), high.sup(&most));
            }
        }
        Self { low_m: low, high_m: high }
    }

    pub(super) fn middle_m(&self) -> Vector3<f64> {
        0.5 * (self.low_m + self.high_m)
    }

    pub(super) fn half_m(&self) -> Vector3<f64> {
        0.5 * (self.high_m - self.low_m)
    }

    pub(super) fn reach_m(&self) -> f64 {
        self.half_m().norm()
    }
}

/// A box around an obstacle at each point of its way; none around one without an end.
fn boxes(obstacle: &Obstacle) -> Vec<(Vector3<f64>, Vector3<f64>)> {
    let (low, high) = match obstacle.shape {
        Shape::Ball { radius_m } => (Vector3::repeat(-radius_m), Vector3::repeat(radius_m)),
        Shape::Box { half_m, .. } => (Vector3::repeat(-half_m.norm()), Vector3::repeat(half_m.norm())),
        Shape::Capsule { from_m, to_m, radius_m } => {
            (from_m.inf(&to_m).add_scalar(-radius_m), from_m.sup(&to_m).add_scalar(radius_m))
        }
        Shape::HalfSpace { .. } => return Vec::new(),
    };
    obstacle.path.iter().map(|(_, at)| (at + low, at + high)).collect()
}
