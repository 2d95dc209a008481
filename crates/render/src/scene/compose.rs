//! Composition of a draw list from a frame of a flight.

use nalgebra::Vector3;

use super::camera::{Adjustment, Area, Camera, CameraSpec, Projected};
use super::colour::{Colour, Colouring, Theme};
use super::extent::Extent;
use super::labels::LabelLayout;
use super::{Line, Scene};
use crate::timeline::Timeline;
use rayon::iter::{IntoParallelIterator as _, ParallelIterator as _};
use tautline_audit::Violation;
use tautline_core::swarm::{Pair, Rows, row};
use tautline_report::drawing::colours::{ALARM, NIGHT, PAPER};
use tautline_report::drawing::{LIMITS, max_clearance_m};
use tautline_report::flight_log::Frame;
use tautline_sim::plan::Plan;

/// Largest width, and largest height, of a picture without a legend \[pixels\].
const NO_LEGEND_PX: [u32; 2] = [420, 260];

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

impl Layers {
    /// Returns the layers that do not hide the formation of a flight.
    #[must_use]
    pub fn of(timeline: &Timeline) -> Self {
        let edges = timeline.plan.as_ref().map_or(0, |plan| plan.graph.edge_count()) <= LIMITS.links;
        Self { edges, marks: timeline.count() <= LIMITS.slots, ..Self::ALL }
    }
}

/// View of a flight.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// Camera.
    pub camera: CameraSpec,
    /// Changes of the camera by hand.
    pub adjustment: Adjustment,
    /// What the colours of vehicles and trails show.
    pub colouring: Colouring,
    /// Colours.
    pub theme: Theme,
    /// Width and height \[pixels\].
    pub size_px: [u32; 2],
    /// Size of texts and widths of lines, relative to their usual part of the height.
    pub text_scale: f32,
    /// Layers.
    pub layers: Layers,
    /// Length of trails \[s\]; `None` for the whole flight.
    pub trail_s: Option<f64>,
    /// Vehicle that always has its name.
    pub picked: Option<usize>,
}

impl Default for View {
    fn default() -> Self {
        Self {
            camera: CameraSpec::Auto,
            adjustment: Adjustment::NONE,
            colouring: Colouring::Vehicle,
            theme: Theme::Dark,
            size_px: [1280, 720],
            text_scale: 1.0,
            layers: Layers::ALL,
            trail_s: None,
            picked: None,
        }
    }
}

impl View {
    /// Returns the view of a flight. Vehicle and edge counts select layers and trails. A show has lights.
    #[must_use]
    pub fn of(timeline: &Timeline) -> Self {
        let trail_s = match timeline.count() {
            count if count <= LIMITS.trails[0] => None,
            count if count <= LIMITS.trails[1] => Some(5.0),
            _ => Some(1.0),
        };
        let view = Self { layers: Layers::of(timeline), trail_s, ..Self::default() };
        if timeline.plan.as_ref().is_some_and(Plan::is_show) { view.with_lights() } else { view }
    }

    /// Returns the view with vehicles as lights, without the layers that outshine them.
    #[must_use]
    pub fn with_lights(self) -> Self {
        let layers = Layers { caption: self.layers.caption, ..Layers::NONE };
        Self { colouring: Colouring::Lights, camera: CameraSpec::Follow(None), layers, ..self }
    }

    /// Returns whether vehicles are lights.
    pub(super) fn has_lights(&self) -> bool {
        self.colouring == Colouring::Lights
    }

    /// Returns the length in pixels of one pixel in a picture 720 pixels high with the usual size of texts.
    pub(super) fn unit_px(&self) -> f32 {
        let [width, height] = self.size_px.map(|size| size as f32);
        self.text_scale * (height.min(0.75 * width) / 720.0).max(0.3)
    }

    /// Returns the size of text \[pixels\] relative to the normal size.
    pub(super) fn text_px(&self, units: f32) -> f32 {
        (17.0 * self.unit_px()).max(9.0) * units
    }

    /// Returns the distance of texts from the sides \[pixels\].
    pub(super) fn margin_px(&self) -> f32 {
        16.0 * self.unit_px()
    }

    /// Returns the height of the bar of a violation \[pixels\].
    pub(super) fn banner_px(&self) -> f32 {
        1.9 * self.text_px(1.1)
    }

    /// Returns whether the picture is large enough for a legend.
    pub(super) fn has_legend(&self) -> bool {
        self.layers.caption && std::iter::zip(self.size_px, NO_LEGEND_PX).all(|(side, least)| side >= least)
    }

    /// Returns the picture with the heights of its texts; a flight with violations has one text more.
    pub(super) fn area(&self, has_violations: bool) -> Area {
        let (margin, line) = (self.margin_px(), self.text_px(1.0));
        let top = if has_violations { self.banner_px() + 0.6 * margin } else { margin };
        let top = if self.layers.caption { top + 2.9 * line } else { 0.0 };
        let bottom = if self.has_legend() { margin + 1.7 * line } else { 0.0 };
        Area { size_px: self.size_px, texts_px: [top, bottom].map(f64::from) }
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
        let night = View { theme: Theme::Dark, ..view.clone() };
        let view = if view.has_lights() { &night } else { view };
        let builder = SceneBuilder::new(timeline, extent, frame, view, camera);
        let background = view.theme.pick(if view.has_lights() { NIGHT } else { PAPER });
        let mut scene = Self::empty(camera, extent.depth_m(&camera), background);
        #[expect(clippy::cast_possible_truncation, reason = "the draw list is in single precision")]
        let shell_ratio = timeline.log.metric().ratio() as f32;
        scene.shell_ratio = shell_ratio;
        let layers = view.layers;
        builder.vehicles(&mut scene);
        if layers.ground {
            builder.ground_marks(&mut scene.discs);
        }
        builder.rotors(&mut scene.discs);
        builder.glows(&mut scene.discs);
        builder.round_obstacles(&mut scene);
        builder.walls(&mut scene.faces);
        // In drawing order: later ones cover earlier ones, and earlier texts take the room of later ones.
        let lines: [Part<'_, Vec<Line>>; 8] = [
            (layers.ground, SceneBuilder::ground),
            (layers.ground, SceneBuilder::drop_lines),
            (true, SceneBuilder::flat_obstacles),
            (layers.trails, SceneBuilder::trails),
            (layers.marks, SceneBuilder::starts_and_goals),
            (layers.edges, SceneBuilder::edges),
            (layers.closest, SceneBuilder::pairs),
            (true, SceneBuilder::arms),
        ];
        let texts: [Part<'_, LabelLayout>; 6] = [
            (layers.caption, SceneBuilder::caption),
            (view.has_legend(), SceneBuilder::legend),
            (layers.labels || layers.closest, SceneBuilder::reserve_vehicles),
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
    /// Intervals of each vehicle's violations so far \[s\].
    pub(super) violating_s: Vec<Vec<[f64; 2]>>,
    /// Colour of each vehicle.
    colours: Vec<Colour>,
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
        let too_close_to_obstacle: Vec<_> = too_close_to_obstacle.map(|(_, vehicle)| vehicle).collect();
        for [vehicle, _] in &too_close_to_obstacle {
            alarmed[*vehicle] = true;
        }
        for (Violation { pair, .. }, _) in &violated {
            (alarmed[pair.first()], alarmed[pair.second()]) = (true, true);
        }
        let mut violating_s = vec![Vec::new(); timeline.count()];
        for Violation { pair, from_s, to_s, .. } in timeline.violations_by(now_s) {
            for k in [pair.first(), pair.second()] {
                violating_s[k].push([from_s, to_s]);
            }
        }
        for (found, [vehicle, _]) in timeline.obstacle_violations_by(now_s) {
            violating_s[vehicle].push([found.from_s, found.to_s]);
        }
        let builder = Self {
            timeline,
            extent,
            frame,
            view,
            camera,
            violated,
            too_close_to_obstacle,
            alarmed,
            violating_s,
            colours: Vec::new(),
        };
        let colours = builder.colours();
        Self { colours, ..builder }
    }

    /// Returns the colours of the vehicles.
    fn colours(&self) -> Vec<Colour> {
        let (count, frame) = (self.timeline.count(), self.frame);
        let keyframes = self.timeline.log.keyframes();
        let before = &keyframes[frame.keyframe.min(keyframes.len() - 1)];
        let [from, to] = match keyframes.get(frame.keyframe + 1) {
            Some(after) => [before, after],
            None => [&keyframes[frame.keyframe.saturating_sub(1)], before],
        };
        let quantities = match self.view.colouring {
            Colouring::Speed if from.time_s < to.time_s => (0..count)
                .map(|k| self.speed_part(k, [&from.positions_m, &to.positions_m], to.time_s - from.time_s))
                .collect(),
            Colouring::Clearance => self.clearance_parts(&frame.positions_m),
            Colouring::Lights => return self.lights(count),
            _ => return (0..count).map(|k| self.view.theme.vehicle_among(k, count)).collect(),
        };
        quantities.into_iter().map(|part| self.view.theme.ramp(part)).collect()
    }

    /// Returns the colours of lights, by their places across the swarm.
    fn lights(&self, count: usize) -> Vec<Colour> {
        let across_px: Vec<_> = (0..count).map(|k| self.projected(k).map(|projected| projected.at_px[0])).collect();
        let known = || across_px.iter().flatten().copied();
        let [left, right] = [known().fold(f64::INFINITY, f64::min), known().fold(f64::NEG_INFINITY, f64::max)];
        #[expect(clippy::cast_possible_truncation, reason = "a colour")]
        let part = |x_px: f64| ((x_px - left) / (right - left).max(1e-9)) as f32;
        across_px.into_iter().map(|x_px| Colour::light(x_px.map_or(0.0, part))).collect()
    }

    /// Returns the speed of a vehicle between two instants, relative to the largest one of the flight.
    pub(super) fn speed_part(&self, k: usize, [from, to]: [&Rows; 2], seconds: f64) -> f32 {
        let speed_m_s = (row(to, k) - row(from, k)).norm() / seconds;
        #[expect(clippy::cast_possible_truncation, reason = "a colour")]
        let part = (speed_m_s / self.extent.max_speed_m_s.max(1e-9)) as f32;
        if part.is_finite() { part } else { 0.0 }
    }

    /// Returns the clearance that has the last colour of the ramp \[m\].
    pub(super) fn max_clearance_m(&self) -> f64 {
        max_clearance_m(self.timeline.delta_m, self.timeline.radius_m.iter().copied())
    }

    /// Returns the clearance of each vehicle to the nearest other one: 1 for none, 0 for at least the largest one.
    pub(super) fn clearance_parts(&self, positions_m: &Rows) -> Vec<f32> {
        let scaled = self.timeline.log.metric().scaled_rows(positions_m);
        let count = scaled.nrows();
        let nearest_m = |k: usize| {
            let others = (0..count).filter(|&other| other != k);
            others.map(|other| (row(&scaled, other) - row(&scaled, k)).norm()).fold(f64::INFINITY, f64::min)
        };
        let clearance_m = |k: usize| nearest_m(k) - self.timeline.delta_m.unwrap_or(0.0);
        #[expect(clippy::cast_possible_truncation, reason = "a colour")]
        let part = |k: usize| (1.0 - clearance_m(k) / self.max_clearance_m()).clamp(0.0, 1.0) as f32;
        (0..count).into_par_iter().map(part).collect()
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
        self.colours[k]
    }

    /// Returns the colour of a vehicle's body: that of a violation during one.
    pub(super) fn body_colour(&self, k: usize) -> Colour {
        if self.alarmed[k] { self.view.theme.pick(ALARM) } else { self.colour(k) }
    }

    /// Returns the closest pair and its separation \[m\], if it is not in violation.
    pub(super) fn closest_clear_pair(&self) -> Option<(Pair, f64)> {
        self.frame.nearest.filter(|(nearest, _)| self.violated.iter().all(|(violation, _)| violation.pair != *nearest))
    }
}
