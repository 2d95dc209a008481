//! What a scene is made of.

use nalgebra::Vector3;

use super::camera::{Camera, Projected};
use super::colour::Colour;
use super::extent::Extent;
use super::view::View;
use crate::render::timeline::{Frame, Timeline};
use crate::swarm::Pair;

/// Everything that a scene is made of.
pub(super) struct SceneBuilder<'a> {
    pub(super) timeline: &'a Timeline,
    pub(super) extent: &'a Extent,
    pub(super) frame: &'a Frame,
    pub(super) view: &'a View,
    pub(super) camera: Camera,
    /// Pairs that are closer than delta at this time and their distances \[m\], the nearest first.
    pub(super) violated: Vec<(Pair, f64)>,
    /// Whether a vehicle is closer than delta to another one.
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
        let lasts = timeline.violations().iter().filter(|span| (span.from_s..=span.to_s).contains(&frame.time_s));
        let mut pairs: Vec<Pair> = lasts.map(|span| span.pair).collect();
        pairs.sort_unstable();
        pairs.dedup();
        let mut violated: Vec<_> = pairs.into_iter().map(|pair| (pair, frame.distance_m(pair))).collect();
        violated.retain(|(_, distance_m)| distance_m.is_finite());
        violated.sort_by(|a, b| a.1.total_cmp(&b.1));
        let mut alarmed = vec![false; timeline.count()];
        for (pair, _) in &violated {
            (alarmed[pair.first()], alarmed[pair.second()]) = (true, true);
        }
        Self { timeline, extent, frame, view, camera, violated, alarmed }
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

    /// The closest pair, where it is not closer than delta, and its distance \[m\].
    pub(super) fn clear_nearest(&self) -> Option<(Pair, f64)> {
        self.frame.nearest.filter(|(nearest, _)| self.violated.iter().all(|(pair, _)| pair != nearest))
    }
}
