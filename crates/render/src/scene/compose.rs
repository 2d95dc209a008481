//! Composition of a draw list from a frame of a flight.

use nalgebra::Vector3;

use super::camera::{Camera, CameraSpec, Projected};
use super::colour::{Colour, Theme};
use super::extent::Extent;
use super::labels::LabelLayout;
use super::{Line, Scene};
use crate::timeline::Timeline;
use tautline_audit::Violation;
use tautline_core::swarm::Pair;
use tautline_report::flight_log::Frame;

/// Layers of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(clippy::struct_excessive_bools, reason = "each is a layer that is shown or not")]
pub struct Layers {
    /// Keep-out shells of radius delta/2.
    pub shells: bool,
    /// Edges in the colour of their tension.
    pub edges: bool,
    /// Trails of past positions.
    pub trails: bool,
    /// Start marks (x) and goal slots (o).
    pub marks: bool,
    /// Ground with its scale, and axes.
    pub ground: bool,
    /// Names of the vehicles.
    pub labels: bool,
    /// Closest pair with its separation.
    pub closest: bool,
    /// Caption and legend.
    pub caption: bool,
}

impl Layers {
    /// No layer: vehicles only.
    pub const NONE: Self = Self::all(false);
    /// All layers.
    pub const ALL: Self = Self::all(true);

    const fn all(on: bool) -> Self {
        Self { shells: on, edges: on, trails: on, marks: on, ground: on, labels: on, closest: on, caption: on }
    }
}

/// View of a flight.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// Camera.
    pub camera: CameraSpec,
    /// Colours.
    pub theme: Theme,
    /// Width and height \[pixels\].
    pub size_px: [u32; 2],
    /// Layers.
    pub layers: Layers,
    /// Length of trails \[s\]; `None` for the whole flight.
    pub trail_s: Option<f64>,
}

impl Default for View {
    fn default() -> Self {
        let (camera, theme, layers) = (CameraSpec::Iso, Theme::Dark, Layers::ALL);
        Self { camera, theme, size_px: [1280, 720], layers, trail_s: None }
    }
}

impl View {
    /// Returns the length in pixels of one pixel in a picture 720 pixels high.
    pub(super) fn unit_px(&self) -> f32 {
        let [width, height] = self.size_px.map(|size| size as f32);
        (height.min(0.75 * width) / 720.0).max(0.3)
    }

    /// Returns the size of text \[pixels\] relative to the normal size.
    pub(super) fn text_px(&self, units: f32) -> f32 {
        (17.0 * self.unit_px()).max(9.0) * units
    }
}

/// Whether a part of a picture is shown, and the function that draws it.
type Part<'a, T> = (bool, fn(&SceneBuilder<'a>, &mut T));

impl Scene {
    /// Composes the draw list of a frame of a flight; `camera` must have the picture size of the view.
    ///
    /// Shells are ordered by |c|^2 - r^2, the squared distance of the centre less the squared radius, farthest first.
    /// If balls do not overlap, this is their order along every line of sight. Where a line meets a ball, the number is
    /// the product of the distances to both points. Shells that overlap are in violation and have one colour, so their
    /// order does not matter. The picture therefore does not flicker while the camera moves. Ellipsoidal shells are
    /// balls in scaled lengths, and are ordered there.
    #[must_use]
    pub fn compose(timeline: &Timeline, extent: &Extent, frame: &Frame, view: &View, camera: Camera) -> Self {
        let builder = SceneBuilder::new(timeline, extent, frame, view, camera);
        let mut scene = Self::empty(camera, extent.depth_m(&camera), view.theme.background());
        #[expect(clippy::cast_possible_truncation, reason = "the draw list is in single precision")]
        let shell_ratio = timeline.log.metric().ratio() as f32;
        scene.shell_ratio = shell_ratio;
        builder.vehicles(&mut scene);
        builder.rotors(&mut scene.discs);
        builder.round_obstacles(&mut scene);
        let layers = view.layers;
        // In drawing order: later ones cover earlier ones, and earlier texts take the room of later ones.
        let lines: [Part<'_, Vec<Line>>; 7] = [
            (layers.ground, SceneBuilder::ground),
            (true, SceneBuilder::flat_obstacles),
            (layers.trails, SceneBuilder::trails),
            (layers.marks, SceneBuilder::starts_and_goals),
            (layers.edges, SceneBuilder::edges),
            (layers.closest, SceneBuilder::pairs),
            (true, SceneBuilder::arms),
        ];
        let texts: [Part<'_, LabelLayout>; 6] = [
            (layers.caption, SceneBuilder::caption),
            (layers.caption, SceneBuilder::legend),
            (layers.labels, SceneBuilder::reserve_vehicles),
            (layers.closest, SceneBuilder::separations),
            (layers.ground, SceneBuilder::scale),
            (layers.labels, SceneBuilder::names),
        ];
        lines.iter().filter(|(shown, _)| *shown).for_each(|(_, draw)| draw(&builder, &mut scene.lines));
        let mut labels = LabelLayout::new(view.size_px);
        texts.iter().filter(|(shown, _)| *shown).for_each(|(_, write)| write(&builder, &mut labels));
        Self { annotations: labels.annotations, ..scene }
    }
}

/// Inputs of a scene, with its current violations.
pub(super) struct SceneBuilder<'a> {
    pub(super) timeline: &'a Timeline,
    pub(super) extent: &'a Extent,
    pub(super) frame: &'a Frame,
    pub(super) view: &'a View,
    pub(super) camera: Camera,
    /// Current violations, one per pair, with the separation as drawn \[m\], the smallest first.
    pub(super) violated: Vec<(Violation, f64)>,
    /// Vehicles and the obstacles to which they are currently too close.
    pub(super) too_close_to_obstacle: Vec<[usize; 2]>,
    /// Whether each vehicle is closer than delta to another, or too close to an obstacle.
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
        let lasts = timeline.violations_by(frame.time_s).filter(|violation| violation.to_s >= frame.time_s);
        let mut violated: Vec<_> = lasts.map(|violation| (violation, frame.distance_m(violation.pair))).collect();
        violated.retain(|(_, distance_m)| distance_m.is_finite());
        violated.sort_by_key(|(violation, _)| violation.pair);
        violated.dedup_by_key(|(violation, _)| violation.pair);
        violated.sort_by(|a, b| a.1.total_cmp(&b.1));
        let mut alarmed = vec![false; timeline.count()];
        let now_s = frame.time_s;
        let too_close_to_obstacle = timeline.obstacle_violations_by(now_s).filter(|(found, _)| found.to_s >= now_s);
        let too_close_to_obstacle: Vec<_> = too_close_to_obstacle.map(|(_, of)| of).collect();
        for [vehicle, _] in &too_close_to_obstacle {
            alarmed[*vehicle] = true;
        }
        for (Violation { pair, .. }, _) in &violated {
            (alarmed[pair.first()], alarmed[pair.second()]) = (true, true);
        }
        Self { timeline, extent, frame, view, camera, violated, too_close_to_obstacle, alarmed }
    }

    /// Returns the position of a vehicle in scene coordinates \[m\]; `None` if it is absent.
    pub(super) fn vehicle(&self, k: usize) -> Option<Vector3<f64>> {
        self.extent.place(&self.frame.positions_m, k)
    }

    /// Returns the positions of both vehicles of a pair in scene coordinates \[m\].
    pub(super) fn ends(&self, pair: Pair) -> Option<[Vector3<f64>; 2]> {
        Some([self.vehicle(pair.first())?, self.vehicle(pair.second())?])
    }

    /// Returns the projection of a vehicle.
    pub(super) fn projected(&self, k: usize) -> Option<Projected> {
        self.camera.project(self.vehicle(k)?)
    }

    /// Returns the colour of a vehicle.
    pub(super) fn colour(&self, k: usize) -> Colour {
        self.view.theme.vehicle_among(k, self.timeline.count())
    }

    /// Returns the colour of a vehicle's body: that of a violation during one.
    pub(super) fn body_colour(&self, k: usize) -> Colour {
        if self.alarmed[k] { self.view.theme.alarm() } else { self.colour(k) }
    }

    /// Returns the closest pair and its separation \[m\], if it is not in violation.
    pub(super) fn closest_clear_pair(&self) -> Option<(Pair, f64)> {
        self.frame.nearest.filter(|(nearest, _)| self.violated.iter().all(|(violation, _)| violation.pair != *nearest))
    }
}
