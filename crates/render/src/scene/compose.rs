//! From a frame of a flight to a draw list.

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

/// What to show.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(clippy::struct_excessive_bools, reason = "each is a layer that is shown or not")]
pub struct Layers {
    /// Keep-out shells of radius delta/2.
    pub shells: bool,
    /// Edges in the colour of their tension.
    pub edges: bool,
    /// Where the vehicles came from.
    pub trails: bool,
    /// Start marks (x) and goal slots (o).
    pub marks: bool,
    /// Ground with its scale, and axes.
    pub ground: bool,
    /// Numbers of the vehicles.
    pub labels: bool,
    /// The closest pair with its distance.
    pub closest: bool,
    /// Caption and legend.
    pub caption: bool,
}

impl Layers {
    /// Vehicles alone.
    pub const NONE: Self = Self::all(false);
    /// Everything.
    pub const ALL: Self = Self::all(true);

    const fn all(on: bool) -> Self {
        Self { shells: on, edges: on, trails: on, marks: on, ground: on, labels: on, closest: on, caption: on }
    }
}

/// How to look at a flight.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// From where.
    pub camera: CameraSpec,
    /// In which colours.
    pub theme: Theme,
    /// Width and height \[pixels\].
    pub size_px: [u32; 2],
    /// What to show.
    pub layers: Layers,
    /// How long trails are \[s\]; none for the whole way.
    pub trail_s: Option<f64>,
}

impl Default for View {
    fn default() -> Self {
        let (camera, theme, layers) = (CameraSpec::Iso, Theme::Dark, Layers::ALL);
        Self { camera, theme, size_px: [1280, 720], layers, trail_s: None }
    }
}

impl View {
    /// Pixels of a length that is one pixel in a picture 720 pixels high.
    pub(super) fn unit_px(&self) -> f32 {
        let [width, height] = self.size_px.map(|size| size as f32);
        (height.min(0.75 * width) / 720.0).max(0.3)
    }

    /// Size of text \[pixels\] in units of the normal one.
    pub(super) fn text_px(&self, units: f32) -> f32 {
        (17.0 * self.unit_px()).max(9.0) * units
    }
}

/// Whether a part of a picture is shown, and what adds it.
type Part<'a, T> = (bool, fn(&SceneBuilder<'a>, &mut T));

impl Scene {
    /// The draw list of a frame of a flight, seen by a camera whose size of picture is that of the view.
    ///
    /// Shells are in the order of the square of their centre's distance less the square of their radius, farthest first.
    /// For balls that do not overlap this is the order along every line of sight: where a line meets a ball, that number
    /// is the product of the distances to the two points. Balls that overlap are a violation, and of one colour, so their
    /// order is of no account. So nothing pops while the camera moves. Shells that are ellipsoids are balls in scaled lengths, and in
    /// that order there.
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
        // In the order in which they cover each other, and in which they take room from each other.
        let lines: [Part<'_, Vec<Line>>; 7] = [
            (layers.ground, SceneBuilder::ground),
            (true, SceneBuilder::flat_obstacles),
            (layers.trails, SceneBuilder::trails),
            (layers.marks, SceneBuilder::starts_and_goals),
            (layers.edges, SceneBuilder::edges),
            (layers.closest, SceneBuilder::pairs),
            (true, SceneBuilder::arms),
        ];
        let words: [Part<'_, LabelLayout>; 6] = [
            (layers.caption, SceneBuilder::caption),
            (layers.caption, SceneBuilder::legend),
            (layers.labels, SceneBuilder::keep_off_vehicles),
            (layers.closest, SceneBuilder::distances),
            (layers.ground, SceneBuilder::scale),
            (layers.labels, SceneBuilder::names),
        ];
        lines.iter().filter(|(shown, _)| *shown).for_each(|(_, draw)| draw(&builder, &mut scene.lines));
        let mut labels = LabelLayout::new(view.size_px);
        words.iter().filter(|(shown, _)| *shown).for_each(|(_, write)| write(&builder, &mut labels));
        Self { annotations: labels.annotations, ..scene }
    }
}

/// Everything that a scene is made of.
pub(super) struct SceneBuilder<'a> {
    pub(super) timeline: &'a Timeline,
    pub(super) extent: &'a Extent,
    pub(super) frame: &'a Frame,
    pub(super) view: &'a View,
    pub(super) camera: Camera,
    /// Violations that last at this time, one of a pair, and the distances of the pairs as drawn \[m\], the nearest first.
    pub(super) violated: Vec<(Violation, f64)>,
    /// Vehicles and the obstacles to which they are too near at this time.
    pub(super) too_near: Vec<[usize; 2]>,
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
        let too_near = timeline.too_near_by(now_s).filter(|(found, _)| found.to_s >= now_s);
        let too_near: Vec<_> = too_near.map(|(_, of)| of).collect();
        for [vehicle, _] in &too_near {
            alarmed[*vehicle] = true;
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
