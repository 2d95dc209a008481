//! Geometry of a scene: vehicles, shells, edges, trails, start marks, goal slots and obstacles.
//!
//! Balls and boxes are solid, capsules are made of balls, planes are drawn with lines.

use nalgebra::{UnitQuaternion, Vector3};

use super::camera::Lens;
use super::colour::{Colour, Colouring, Theme};
use super::compose::SceneBuilder;
use super::{Ball, Disc, Face, Line, Scene, single};
use tautline_core::obstacle::{Obstacle, Shape};
use tautline_core::swarm::Pair;
use tautline_report::drawing::colours::{ALARM, INK, OBSTACLE, SHELL, SOFT_INK};
use tautline_report::drawing::{LIGHT, LIMITS, MOST_LINKS, Rotors, box_sides, is_level, link_look, plane_section};
use tautline_sim::plan::Plan;

/// Largest number of line pieces of all trails together, and of one trail.
const MAX_TRAIL_PIECES: usize = 60_000;
const MAX_PIECES_PER_TRAIL: usize = 400;
/// Fraction of a flight after which a trail has faded, and its opacity then on dark and on light background.
const FADED_AFTER: f64 = 0.25;
const FADED: [f32; 2] = [0.16, 0.4];
const FRESH: f32 = 0.95;
/// Smallest opacity of the part of a trail that was a violation.
const VIOLATED: f32 = 0.75;
/// Largest number of distances that colour trails by clearance.
const MAX_DISTANCES: usize = 100_000_000;
/// Number of corners of a ring.
const RING: u32 = 28;
/// Radius of a goal slot over that of the hull.
const SLOT: f64 = 1.45;
/// Largest number of vehicles with start marks and goal slots.
const MAX_MARKS: usize = 2000;
/// Opacity of the line from a vehicle to its slot, relative to that of the slot.
const JOIN: f32 = 0.5;
/// Distance of a start mark from a goal slot below which it is not drawn, in radii of the slot.
const APART: f64 = 1.5;
/// Opacity of the line from a vehicle to the ground, and of the mark there.
const DROP: f32 = 0.4;
const GROUND_MARK: f32 = 0.6;
/// Sine of the elevation above which the ground below a vehicle is hidden by it.
const STRAIGHT_DOWN: f64 = 0.97;
/// Smallest radius of a ground mark and of a glow in a picture 720 pixels high \[pixels\].
const MIN_MARK_PX: f32 = 3.0;
const MIN_GLOW_PX: f32 = 17.0;
/// Radius of a glow in units of delta, or of the hull without delta, and that of its white centre relative to it.
const GLOW_DELTAS: f64 = 0.95;
const GLOW_RADII: f64 = 4.0;
const WHITE: f64 = 0.6;
/// Half the diagonal of the reference's diamond in a picture 720 pixels high \[pixels\].
const REFERENCE_PX: f32 = 7.0;
/// Smallest radius of a vehicle, of its start mark and of its goal slot in a picture 720 pixels high \[pixels\].
const MIN_RADIUS_PX: [f32; 3] = [2.0, 3.0, 4.0];

/// Returns whether a graph has few enough edges to be drawn.
pub(super) fn has_few_edges(plan: &Plan) -> bool {
    plan.graph.edge_count() <= MOST_LINKS
}

impl SceneBuilder<'_> {
    /// Returns the larger of a radius and the length of `least_px` pixels at a position \[m\].
    fn at_least(&self, place: Vector3<f64>, radius_m: f64, least_px: f32) -> f64 {
        let px_per_m = self.camera.project(place).map_or(f64::INFINITY, |projection| projection.px_per_m);
        radius_m.max(f64::from(least_px * self.view.unit_px()) / px_per_m)
    }

    /// Returns the radius of a vehicle's shell seen from above \[m\], if it is shown.
    fn shell_m(&self, k: usize) -> Option<f64> {
        self.timeline.delta_m.filter(|_| self.view.layers.shells || self.alarmed[k]).map(|delta_m| delta_m / 2.0)
    }

    /// Returns the areas that vehicles and their visible shells cover: centres and radii \[pixels\].
    pub(super) fn covered_areas_px(&self) -> Vec<([f64; 2], f64)> {
        let cover = |k| {
            let place = self.vehicle(k)?;
            let projection = self.camera.project(place)?;
            let radius_m = self.at_least(place, self.timeline.radius_m[k], MIN_RADIUS_PX[0]);
            let shell_m = self.shell_m(k).map_or(0.0, |shell_m| self.timeline.log.metric().longest_m(shell_m));
            Some((projection.at_px, radius_m.max(shell_m) * projection.px_per_m))
        };
        (0..self.timeline.count()).filter_map(cover).collect()
    }

    pub(super) fn vehicles(&self, scene: &mut Scene) {
        let theme = self.view.theme;
        let mut shells = Vec::new();
        for k in 0..self.timeline.count() {
            let Some(place) = self.vehicle(k) else { continue };
            let alarm = self.alarmed[k];
            let colour = self.body_colour(k);
            if let Some(quadrotor) = self.quadrotor(k) {
                scene.balls.extend(quadrotor.body(colour, theme.pick(INK)));
            } else {
                let radius_m = self.at_least(place, self.timeline.radius_m[k], MIN_RADIUS_PX[0]);
                scene.balls.push(Ball::new(place, radius_m, colour));
            }
            if let Some(radius_m) = self.shell_m(k) {
                let strength = if theme == Theme::Light { 0.75 } else { 0.6 };
                let colour = if alarm { theme.pick(ALARM).at(0.85) } else { theme.pick(SHELL).at(strength) };
                // In parallel projection all lines of sight are parallel to the view.
                let metric = self.timeline.log.metric();
                let away = metric.scaled(place - self.camera.eye_m);
                let power = match self.camera.lens {
                    Lens::Perspective(_) => away.norm_squared() - radius_m * radius_m,
                    Lens::Parallel(_) => -away.dot(&metric.scaled(self.camera.back)),
                };
                shells.push((power, Ball::new(place, radius_m, colour)));
            }
        }
        shells.sort_by(|a, b| b.0.total_cmp(&a.0));
        scene.shells = shells.into_iter().map(|(_, ball)| ball).collect();
    }

    pub(super) fn edges(&self, lines: &mut Vec<Line>) {
        let Some(plan) = self.timeline.plan.as_ref().filter(|plan| has_few_edges(plan)) else { return };
        let (width_px, opacity) = link_look(plan.graph.edge_count());
        let width_px = width_px * self.view.unit_px();
        for pair in plan.graph.edges().map(|(i, j)| Pair::new(i, j)) {
            let Some([from, to]) = self.ends(pair) else { continue };
            let tension = plan.tension(pair, (to - from).norm(), self.frame.time_s);
            // Edges under tension are more opaque than edges at rest.
            let strength = opacity * (0.45 + 0.55 * tension.abs());
            lines.push(Line::new([from, to], self.view.theme.tension(tension).at(strength), width_px));
        }
    }

    /// Draws lines between the closest pair, and between every pair closer than delta.
    pub(super) fn pairs(&self, lines: &mut Vec<Line>) {
        let theme = self.view.theme;
        // The closest pair comes last and covers the others.
        let alarmed = self.violated.iter().rev().map(|(violation, _)| (violation.pair, theme.pick(ALARM), 5.0));
        let nearest = self.closest_clear_pair().map(|(pair, _)| (pair, theme.pick(INK), 2.6));
        for (pair, colour, width) in nearest.into_iter().chain(alarmed) {
            let ends = self.ends(pair);
            lines.extend(ends.map(|ends| Line::new(ends, colour, width * self.view.unit_px())));
        }
    }

    /// Draws trails of the requested length that fade with age. Corners are samples whose index is a multiple of a
    /// power of two, so that trails do not flicker over time.
    pub(super) fn trails(&self, lines: &mut Vec<Line>) {
        let (count, last, keyframes) = (self.timeline.count(), self.frame.keyframe, self.timeline.log.keyframes());
        let ([first_s, last_s], now_s) = (self.timeline.log.range_s(), self.frame.time_s);
        let fading_s = self.view.trail_s.unwrap_or(FADED_AFTER * (last_s - first_s)).max(1e-9);
        let since_s = self.view.trail_s.map_or(first_s, |trail_s| now_s - trail_s);
        let first = keyframes.partition_point(|keyframe| keyframe.time_s < since_s);
        let most = (MAX_TRAIL_PIECES / count.max(1)).clamp(2, MAX_PIECES_PER_TRAIL);
        let mut stride = 1;
        while last.saturating_sub(first) / stride > most {
            stride *= 2;
        }
        let faded = FADED[usize::from(self.view.theme == Theme::Light)];
        #[expect(clippy::cast_possible_truncation, reason = "an opacity")]
        let opacity = |time_s: f64| faded + (FRESH - faded) * (1.0 - (now_s - time_s) / fading_s).max(0.0) as f32;
        let width_px = if count < 50 { 2.0 } else { 1.3 } * self.view.unit_px();
        let begins = self.timeline.log.positions_m(since_s).filter(|_| since_s > first_s);
        let recorded = (first..=last).filter(|k| k.is_multiple_of(stride)).map(|k| &keyframes[k]);
        let corners: Vec<_> = (begins.iter().map(|positions_m| (since_s, positions_m)))
            .chain(recorded.map(|corner| (corner.time_s, &corner.positions_m)))
            .chain([(now_s, &self.frame.positions_m)])
            .collect();
        let by_clearance =
            self.view.colouring == Colouring::Clearance && corners.len() * count * count <= MAX_DISTANCES;
        let clearances: Vec<_> =
            corners.iter().filter(|_| by_clearance).map(|(_, corner)| self.clearance_parts(corner)).collect();
        lines.reserve(count * corners.len());
        for k in 0..count {
            for (n, pair) in corners.windows(2).enumerate() {
                let [(from_s, from), (to_s, to)] = [pair[0], pair[1]];
                let (Some(start), Some(end)) = (self.extent.place(from, k), self.extent.place(to, k)) else { continue };
                if start == end || from_s >= to_s {
                    continue;
                }
                let colour = match self.view.colouring {
                    Colouring::Speed => self.view.theme.ramp(self.speed_part(k, [from, to], to_s - from_s)),
                    _ => clearances.get(n + 1).map_or(self.colour(k), |parts| self.view.theme.ramp(parts[k])),
                };
                for ([from_s, to_s], is_violation) in cut([from_s, to_s], &self.violating_s[k]) {
                    let point_at =
                        |time_s: f64| single(start.lerp(&end, (time_s - pair[0].0) / (pair[1].0 - pair[0].0)));
                    let (colour, least) =
                        if is_violation { (self.view.theme.pick(ALARM), VIOLATED) } else { (colour, 0.0) };
                    let colours = [from_s, to_s].map(|time_s| colour.at(opacity(time_s).max(least)));
                    lines.push(Line { ends_m: [point_at(from_s), point_at(to_s)], colours, width_px });
                }
            }
        }
    }

    /// Returns the vehicles with lines to the ground, with their positions and the points on the ground below.
    fn drops(&self) -> impl Iterator<Item = (usize, [Vector3<f64>; 2])> {
        let (count, ground_m) = (self.timeline.count(), self.extent.ground.corners_m[0].z);
        let shown = if count <= LIMITS.drops && self.camera.back.z < STRAIGHT_DOWN { count } else { 0 };
        (0..shown).filter_map(move |k| {
            let place = self.vehicle(k)?;
            Some((k, [place, Vector3::new(place.x, place.y, ground_m)]))
        })
    }

    /// Draws a line from each vehicle to the ground.
    pub(super) fn drop_lines(&self, lines: &mut Vec<Line>) {
        let width_px = 1.1 * self.view.unit_px();
        let line = |(_, ends_m)| Line::new(ends_m, self.view.theme.pick(SOFT_INK).at(DROP), width_px);
        lines.extend(self.drops().map(line));
    }

    /// Draws a mark on the ground below each vehicle.
    pub(super) fn ground_marks(&self, discs: &mut Vec<Disc>) {
        let mark = |(k, [_, foot]): (usize, [Vector3<f64>; 2])| {
            let radius_m = self.at_least(foot, self.timeline.radius_m[k], MIN_MARK_PX);
            Disc::new(foot, radius_m, Vector3::z(), self.body_colour(k).at(GROUND_MARK))
        };
        discs.extend(self.drops().map(mark));
    }

    /// Draws the glow of each light, with a white centre, in front of its hull.
    pub(super) fn glows(&self, discs: &mut Vec<Disc>) {
        let count = if self.view.has_lights() { self.timeline.count() } else { 0 };
        for k in 0..count {
            let (Some(place), hull_m) = (self.vehicle(k), self.timeline.radius_m[k]) else { continue };
            let around_m = self.timeline.delta_m.map_or(GLOW_RADII * hull_m, |delta_m| GLOW_DELTAS * delta_m);
            let radius_m = self.at_least(place, around_m, MIN_GLOW_PX);
            let towards = self.camera.back * (1.1 * self.at_least(place, hull_m, MIN_RADIUS_PX[0]));
            for (radius_m, colour) in [(radius_m, self.body_colour(k)), (WHITE * radius_m, self.view.theme.pick(INK))] {
                discs.push(Disc { glow: 1.0, ..Disc::new(place + towards, radius_m, self.camera.back, colour) });
            }
        }
    }

    /// Returns the start positions of vehicles that have left them, with the half sizes of their marks \[m\].
    pub(super) fn starts(&self) -> Vec<(usize, Vector3<f64>, f64)> {
        let count = self.timeline.count();
        let Some(first) = self.timeline.log.keyframes().first().filter(|_| count <= MAX_MARKS) else {
            return Vec::new();
        };
        let start = |k| {
            let place = self.extent.place(&first.positions_m, k)?;
            let arm = self.at_least(place, self.timeline.radius_m[k] * 0.8, MIN_RADIUS_PX[1]);
            let (start, now) = (self.camera.project(place)?, self.projected(k));
            let is_left = now.is_none_or(|now| {
                let apart_px = (now.at_px[0] - start.at_px[0]).hypot(now.at_px[1] - start.at_px[1]);
                let hull_px = (self.timeline.radius_m[k] * now.px_per_m).max(f64::from(self.view.text_px(0.7)));
                apart_px > hull_px + arm * start.px_per_m
            });
            is_left.then_some((k, place, arm))
        };
        (0..count).filter_map(start).collect()
    }

    /// Returns the goal slots: the formation of the current leg at the best-fitting motion that the law allows.
    pub(super) fn slots(&self) -> Option<Vec<Vector3<f64>>> {
        let plan = self.timeline.plan.as_ref().filter(|_| self.timeline.count() <= MAX_MARKS)?;
        let slots_m = plan.slots_at(self.frame.time_s, &self.frame.positions_m)?;
        Some(slots_m.into_iter().map(|slot_m| slot_m - self.extent.origin_m()).collect())
    }

    /// Draws crosses at the start positions, rings at the goal slots, and the reference.
    pub(super) fn starts_and_goals(&self, lines: &mut Vec<Line>) {
        let count = self.timeline.count();
        let (right, up) = (self.camera.right, self.camera.up);
        let width_px = 1.8 * self.view.unit_px();
        // Many opaque marks would hide the vehicles.
        let opacity = (40.0 / count.max(1) as f32).clamp(0.05, 0.9);
        let slots = self.slots().unwrap_or_default();
        for (k, place, arm) in self.starts() {
            // A cross within a slot would look like an arrival.
            if slots.iter().any(|slot| (slot - place).norm() < APART * SLOT * self.timeline.radius_m[k]) {
                continue;
            }
            for across in [(right + up) * arm, (right - up) * arm] {
                lines.push(Line::new([place - across, place + across], self.colour(k).at(opacity), width_px));
            }
        }
        for (k, centre) in slots.into_iter().enumerate().take(count) {
            if let Some(place) = self.vehicle(k) {
                let colour = self.colour(k).at(JOIN * opacity);
                lines.push(Line::new([place, centre], colour, 1.1 * self.view.unit_px()));
            }
            let radius = self.at_least(centre, self.timeline.radius_m[k] * SLOT, MIN_RADIUS_PX[2]);
            let corner = |n: u32| {
                let (sin, cos) = (f64::from(n % RING) / f64::from(RING) * std::f64::consts::TAU).sin_cos();
                centre + (right * cos + up * sin) * radius
            };
            let colour = self.colour(k).at(opacity);
            lines.extend((0..RING).map(|n| Line::new([corner(n), corner(n + 1)], colour, width_px)));
        }
        if let Some(place_m) = self.timeline.plan.as_ref().and_then(|plan| plan.reference_at(self.frame.time_s)) {
            self.diamond(place_m - self.extent.origin_m(), width_px, lines);
        }
    }

    /// Draws a diamond at the reference.
    fn diamond(&self, centre: Vector3<f64>, width_px: f32, lines: &mut Vec<Line>) {
        let arm = self.at_least(centre, 0.0, REFERENCE_PX);
        let [right, up] = [self.camera.right, self.camera.up].map(|axis| axis * arm);
        let corners = [centre + up, centre + right, centre - up, centre - right];
        let side = |k: usize| Line::new([corners[k], corners[(k + 1) % 4]], self.view.theme.pick(INK), width_px);
        lines.extend((0..4).map(side));
    }
}

/// Cuts an interval of time where violations begin and end; returns the parts, and whether each is a violation.
fn cut([from_s, to_s]: [f64; 2], violating_s: &[[f64; 2]]) -> Vec<([f64; 2], bool)> {
    let mut at_s: Vec<f64> =
        violating_s.iter().flatten().copied().filter(|&at_s| from_s < at_s && at_s < to_s).collect();
    at_s.extend([from_s, to_s]);
    at_s.sort_by(f64::total_cmp);
    at_s.dedup();
    let is_violation = |middle_s: f64| violating_s.iter().any(|[from_s, to_s]| (*from_s..=*to_s).contains(&middle_s));
    at_s.windows(2).map(|part| ([part[0], part[1]], is_violation(f64::midpoint(part[0], part[1])))).collect()
}

/// Number of balls of a capsule per radius of length, and largest number in all.
const BALLS_PER_RADIUS: f64 = 24.0;
const MAX_BALLS: f64 = 3000.0;
/// Number of intervals between the lines across a plane.
const HATCHES: u32 = 12;
/// Light on a side that faces away from the light, and on the rims of a box.
const DARKEST: f64 = 0.45;
const RIM: f32 = 0.35;
/// Size of the rims of a box relative to its sides.
const RIM_SCALE: f64 = 1.003;
/// Opacity of lines of a plane.
const PLANE: f32 = 0.18;

impl SceneBuilder<'_> {
    fn obstacles(&self) -> &[Obstacle] {
        self.timeline.plan.as_ref().map_or(&[], |plan| &plan.obstacles)
    }

    /// Draws balls and capsules.
    pub(super) fn round_obstacles(&self, scene: &mut Scene) {
        let colour = self.view.theme.pick(OBSTACLE);
        for obstacle in self.obstacles() {
            let place = obstacle.place_m - self.extent.origin_m();
            match obstacle.shape {
                Shape::Ball { radius_m } => scene.balls.push(Ball::new(place, radius_m, colour)),
                Shape::Capsule { from_m, to_m, radius_m } => {
                    let needed = (BALLS_PER_RADIUS * (to_m - from_m).norm() / radius_m).ceil();
                    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
                    let count = needed.clamp(1.0, MAX_BALLS) as u32;
                    let along = |k: u32| place + from_m.lerp(&to_m, f64::from(k) / f64::from(count));
                    scene.balls.extend((0..=count).map(|k| Ball::new(along(k), radius_m, colour)));
                }
                Shape::Box { .. } | Shape::HalfSpace { .. } => {}
            }
        }
    }

    /// Returns the sides of all boxes: the centre and the half sides, the first along the normal \[m\].
    fn sides(&self) -> impl Iterator<Item = (Vector3<f64>, [Vector3<f64>; 3])> {
        let boxes = self.obstacles().iter().filter_map(|obstacle| match obstacle.shape {
            Shape::Box { half_m, yaw_deg } => Some((obstacle.place_m - self.extent.origin_m(), half_m, yaw_deg)),
            _ => None,
        });
        boxes.flat_map(|(place, half_m, yaw_deg)| box_sides(half_m, yaw_deg).map(move |half| (place, half)))
    }

    /// Draws the solid sides of boxes, lit from above the camera's left shoulder.
    pub(super) fn walls(&self, faces: &mut Vec<Face>) {
        let colour = self.view.theme.pick(OBSTACLE);
        let light =
            (self.camera.right * LIGHT[0] + self.camera.up * LIGHT[1] + self.camera.back * LIGHT[2]).normalize();
        faces.extend(self.sides().map(|(place, [normal, u, v])| {
            let up = normal.try_normalize(0.0).map_or(0.0, |normal| normal.dot(&light).max(0.0));
            #[expect(clippy::cast_possible_truncation, reason = "a colour")]
            let colour = colour.lit((DARKEST + (1.0 - DARKEST) * up) as f32);
            Face { centre_m: single(place + normal), half_m: [single(u), single(v)], colour }
        }));
    }

    /// Draws the rims of boxes, and planes.
    pub(super) fn flat_obstacles(&self, lines: &mut Vec<Line>) {
        let width_px = 1.4 * self.view.unit_px();
        for (place, half) in self.sides() {
            // Slightly outside, so that the sides do not hide them.
            let [normal, u, v] = half.map(|half| half * RIM_SCALE);
            for (along, across) in [(u, v), (v, u)] {
                let ends_m = [place + normal + across - along, place + normal + across + along];
                lines.push(Line::new(ends_m, self.view.theme.pick(OBSTACLE).lit(RIM), width_px));
            }
        }
        for obstacle in self.obstacles() {
            let place = obstacle.place_m - self.extent.origin_m();
            match obstacle.shape {
                // The grid of the ground shows a level plane.
                Shape::HalfSpace { normal } if is_level(normal) => {}
                Shape::HalfSpace { normal } => {
                    let (centre, reach_m) = self.extent.reach();
                    let [foot, u, v] = plane_section(normal, centre - place, reach_m);
                    self.hatched(place + foot, u, v, lines);
                }
                Shape::Ball { .. } | Shape::Capsule { .. } | Shape::Box { .. } => {}
            }
        }
    }

    /// Draws a hatched parallelogram with this centre and half sides `u` and `v`.
    fn hatched(&self, middle: Vector3<f64>, u: Vector3<f64>, v: Vector3<f64>, lines: &mut Vec<Line>) {
        let (colour, width_px) = (self.view.theme.pick(OBSTACLE).at(PLANE), 1.4 * self.view.unit_px());
        for k in 0..=HATCHES {
            let share = 2.0 * f64::from(k) / f64::from(HATCHES) - 1.0;
            let is_rim = k == 0 || k == HATCHES;
            let mut line = |from, to| lines.push(Line::new([from, to], colour, width_px));
            line(middle + u * share - v, middle + u * share + v);
            if is_rim {
                line(middle + v * share - u, middle + v * share + u);
            }
        }
    }
}

/// Radius of a hull below which it is drawn as a ball \[pixels\], and smallest radius with arms in a picture 720
/// pixels high \[pixels\].
const BALL_PX: f64 = 3.0;
const MIN_HULL_PX: f64 = 13.0;
/// Radius of the mark ahead relative to the arm.
const NOSE: f64 = 0.13;
/// Smallest width of an arm, and width of a blade, in a picture 720 pixels high \[pixels\].
const ARM_PX: f32 = 1.5;
const BLADE_PX: f32 = 1.2;
/// Opacity of a rotor's rim and of its blade.
const DISC: f32 = 0.7;
const BLADE: f32 = 0.75;

/// Quadrotor with position and attitude, in scene coordinates.
pub(super) struct Quadrotor {
    place: Vector3<f64>,
    attitude: UnitQuaternion<f64>,
    rotors: Rotors,
    arm_m: f64,
}

impl Quadrotor {
    /// Transforms a point on the body to scene coordinates \[m\].
    fn at(&self, on_body_m: Vector3<f64>) -> Vector3<f64> {
        self.place + self.attitude * on_body_m
    }

    /// Returns the body and the mark ahead.
    pub(super) fn body(&self, colour: Colour, nose: Colour) -> [Ball; 2] {
        let body = Ball::new(self.place, Rotors::BODY * self.arm_m, colour);
        [body, Ball::new(self.nose(), NOSE * self.arm_m, nose)]
    }

    fn nose(&self) -> Vector3<f64> {
        self.at(self.rotors.nose_m())
    }

    /// Returns the centres of the rotors \[m\].
    fn rotors(&self) -> [Vector3<f64>; 4] {
        self.rotors.places_m().map(|rotor_m| self.at(rotor_m))
    }

    /// Returns the unit vector along the thrust.
    fn up(&self) -> Vector3<f64> {
        self.attitude * Vector3::z()
    }
}

impl SceneBuilder<'_> {
    /// Returns a vehicle with a known attitude, if it is large enough in the picture to be drawn as a quadrotor.
    pub(super) fn quadrotor(&self, k: usize) -> Option<Quadrotor> {
        let attitude = self.frame.attitude(k)?;
        let place = self.vehicle(k)?;
        let radius_m = self.timeline.radius_m[k];
        let radius_px = radius_m * self.camera.project(place)?.px_per_m;
        if radius_px < BALL_PX {
            return None;
        }
        let enlarged = (MIN_HULL_PX * f64::from(self.view.unit_px()) / radius_px).max(1.0);
        let rotors = self.timeline.rotors.unwrap_or_else(|| Rotors::within(radius_m)).scaled(enlarged);
        Some(Quadrotor { place, attitude, rotors, arm_m: rotors.arm_m() })
    }

    fn quadrotors(&self) -> impl Iterator<Item = (Quadrotor, Colour)> {
        (0..self.timeline.count()).filter_map(|k| Some((self.quadrotor(k)?, self.body_colour(k))))
    }

    /// Draws the discs of rotors, farthest first.
    pub(super) fn rotors(&self, discs: &mut Vec<Disc>) {
        let mut ordered = Vec::new();
        for (quadrotor, colour) in self.quadrotors() {
            let disc = |centre| Disc::new(centre, quadrotor.rotors.radius_m, quadrotor.up(), colour.at(DISC));
            ordered.extend(quadrotor.rotors().map(|centre| (self.camera.in_camera_frame(centre).z, disc(centre))));
        }
        ordered.sort_by(|a, b| a.0.total_cmp(&b.0));
        discs.extend(ordered.into_iter().map(|(_, disc)| disc));
    }

    /// Draws arms, the neck of the mark ahead, and in every disc the diameter across the line of sight, which is
    /// visible edge-on too.
    pub(super) fn arms(&self, lines: &mut Vec<Line>) {
        let unit_px = self.view.unit_px();
        for (quadrotor, colour) in self.quadrotors() {
            let px_per_m = self.camera.project(quadrotor.place).map_or(0.0, |projection| projection.px_per_m);
            #[expect(clippy::cast_possible_truncation, reason = "pixels")]
            let width_px = (Rotors::WIDTH * quadrotor.arm_m * px_per_m) as f32;
            let width_px = width_px.max(ARM_PX * unit_px);
            lines.push(Line::new([quadrotor.place, quadrotor.nose()], self.view.theme.pick(INK), width_px));
            let across = quadrotor.up().cross(&self.camera.back).try_normalize(1e-6);
            for rotor in quadrotor.rotors() {
                lines.push(Line::new([quadrotor.place, rotor], colour, width_px));
                let reach = across.map(|across| across * quadrotor.rotors.radius_m);
                let blade = reach.map(|reach| [rotor - reach, rotor + reach]);
                lines.extend(blade.map(|ends| Line::new(ends, colour.at(BLADE), BLADE_PX * unit_px)));
            }
        }
    }
}
