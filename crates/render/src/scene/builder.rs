//! What a scene is made of.

use nalgebra::Vector3;

use super::camera::{Camera, Projected};
use super::colour::Colour;
use super::extent::Extent;
use super::view::View;
use crate::timeline::{Frame, Timeline, TooNear};
use tautline_audit::Violation;
use tautline_core::swarm::Pair;

/// Everything that a scene is made of.
pub(super) struct SceneBuilder<'a> {
    pub(super) timeline: &'a Timeline,
    pub(super) extent: &'a Extent,
    pub(super) frame: &'a Frame,
    pub(super) view: &'a View,
    pub(super) camera: Camera,
    /// Violations that last at this time, one of a pair, and the distances of the pairs as drawn \[m\], the nearest first.
    pub(super) violated: Vec<(&'a Violation, f64)>,
    /// Who is nearer to an obstacle than its clearance at this time.
    pub(super) too_near: Vec<&'a TooNear>,
    /// Whether a vehicle is closer than delta to another one, or too near to an obstacle.
    pub(super) alarmed: Vec<bool>,
}

impl<'a> SceneBuilder<'a> {
    pub(super) fn new(
        timeline: &'a Timeline,
        extent: &'a Extent,
        frame: &'a Frame,
        view: &'a View,
        camera: Camera,
    ) -> Self {
        let lasts = timeline.begun(frame.time_s).filter(|violation| violation.to_s >= frame.time_s);
        let mut violated: Vec<_> = lasts.map(|violation| (violation, frame.distance_m(violation.pair))).collect();
        violated.retain(|(_, distance_m)| distance_m.is_finite());
        violated.sort_by_key(|(violation, _)| violation.pair);
        violated.dedup_by_key(|(violation, _)| violation.pair);
        violated.sort_by(|a, b| a.1.total_cmp(&b.1));
        let mut alarmed = vec![false; timeline.count()];
        let now_s = frame.time_s;
        let too_near: Vec<_> = timeline.too_near_by(now_s).filter(|near| near.to_s >= now_s).collect();
        for near in &too_near {
            alarmed[near.vehicle] = true;
        }
        for (Violation { pair, .. }, _) in &violated {
            (alarmed[pair.first()], alarmed[pair.second()]) = (true, true);
        }
        Self { timeline, extent, frame, view, camera, violated, too_near, alarmed }
    }

    /// Where a vehicle is, in the scene's coordinates \[m\]; none where it is not there.
    pub(super) fn vehicle(&self, k: usize) -> Option<Vector3<f64>> {
        self.extent.place(&self.frame.positions_m, k)
    }

    /// Where both vehicles of a pair are, in the scene's coordinates \[m\].
    pub(super) fn ends(&self, pair: Pair) -> Option<[Vector3<f64>; 2]> {
        Some([self.vehicle(pair.first())?, self.vehicle(pair.second())?])
    }

    /// Where a vehicle is in the picture.
    pub(super) fn projected(&self, k: usize) -> Option<Projected> {
        self.camera.project(self.vehicle(k)?)
    }

    /// The colour of a vehicle.
    pub(super) fn colour(&self, k: usize) -> Colour {
        self.view.theme.vehicle_among(k, self.timeline.count())
    }

    /// The colour of a vehicle's body: that of a violation while it is in one.
    pub(super) fn body_colour(&self, k: usize) -> Colour {
        if self.alarmed[k] { self.view.theme.alarm() } else { self.colour(k) }
    }

    /// The closest pair, where it is not closer than delta, and its distance \[m\].
    pub(super) fn clear_nearest(&self) -> Option<(Pair, f64)> {
        self.frame.nearest.filter(|(nearest, _)| self.violated.iter().all(|(violation, _)| violation.pair != *nearest))
    }
}
