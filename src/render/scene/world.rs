//! What is in the world: vehicles, shells, edges, trails, start marks and goal slots.

use nalgebra::Vector3;

use super::{Ball, Colour, Line, Painting, Scene, Theme, single};
use crate::formation::best_rigid_motion;
use crate::swarm::{Pair, row};

/// Most edges that are drawn: more hide what they join.
pub(super) const MOST_EDGES: usize = 2100;
/// Most pieces of all trails together, and of one.
const TRAIL_PIECES: usize = 60_000;
const LONGEST_TRAIL: usize = 400;
/// Part of a flight after which a trail has faded, and what is left of it then.
const FADED_AFTER: f64 = 0.25;
const FADED: f32 = 0.16;
const FRESH: f32 = 0.95;
/// Corners of a ring.
const RING: u32 = 28;
/// Radius of a goal slot over that of the hull.
const SLOT: f64 = 1.45;
/// Most vehicles that have start marks and goal slots.
const MOST_MARKS: usize = 2000;
/// Least radius of a vehicle, of the cross where it started and of its goal slot in a picture 720 pixels high \[pixels\].
const LEAST_PX: [f32; 3] = [2.0, 3.0, 4.0];

impl Painting<'_> {
    /// The colour of a vehicle.
    pub(super) fn colour(&self, k: usize) -> Colour {
        self.view.theme.vehicle_among(k, self.footage.count())
    }

    /// A radius at a place \[m\], or what so many pixels are there, whichever is more.
    fn at_least(&self, place: Vector3<f64>, radius_m: f64, least_px: f32) -> f64 {
        let px_per_m = self.camera.project(place).map_or(f64::INFINITY, |at| at.px_per_m);
        radius_m.max(f64::from(least_px * self.view.unit_px()) / px_per_m)
    }

    /// Which vehicles are closer than delta to another one.
    pub(super) fn alarmed(&self) -> Vec<bool> {
        let mut alarmed = vec![false; self.footage.count()];
        for (pair, _) in &self.violated {
            (alarmed[pair.first()], alarmed[pair.second()]) = (true, true);
        }
        alarmed
    }

    /// What the vehicles, and those of their shells that are shown, cover of the picture: middles and radii \[pixels\].
    pub(super) fn covered_px(&self) -> Vec<([f64; 2], f64)> {
        let mut covered = Vec::new();
        for (k, alarm) in self.alarmed().into_iter().enumerate() {
            let Some(place) = self.vehicle(k) else { continue };
            let Some(at) = self.camera.project(place) else { continue };
            let shell_m = self.footage.delta_m.filter(|_| self.view.layers.shells || alarm).map_or(0.0, |d| d / 2.0);
            let radius_m = self.at_least(place, self.footage.radius_m[k], LEAST_PX[0]).max(shell_m);
            covered.push((at.at_px, radius_m * at.px_per_m));
        }
        covered
    }

    pub(super) fn vehicles(&self, scene: &mut Scene) {
        let theme = self.view.theme;
        let mut shells = Vec::new();
        for (k, alarm) in self.alarmed().into_iter().enumerate() {
            let Some(place) = self.vehicle(k) else { continue };
            let centre_m = single(place);
            #[expect(clippy::cast_possible_truncation, reason = "the draw list is in single precision")]
            let metres = |length_m: f64| length_m as f32;
            let colour = if alarm { theme.alarm() } else { self.colour(k) };
            let radius_m = metres(self.at_least(place, self.footage.radius_m[k], LEAST_PX[0]));
            scene.balls.push(Ball { centre_m, radius_m, colour });
            if let Some(delta_m) = self.footage.delta_m.filter(|_| self.view.layers.shells || alarm) {
                let radius_m = delta_m / 2.0;
                let strength = if theme == Theme::Paper { 0.75 } else { 0.6 };
                let colour = if alarm { theme.alarm().at(0.85) } else { theme.shell().at(strength) };
                let power = (place - self.camera.eye_m).norm_squared() - radius_m * radius_m;
                shells.push((power, Ball { centre_m, radius_m: metres(radius_m), colour }));
            }
        }
        // In parallel projection every line of sight is along the view.
        if let super::Lens::Parallel(_) = self.camera.lens {
            for (power, ball) in &mut shells {
                *power = -self.camera.seen(Vector3::from(ball.centre_m.map(f64::from))).z;
            }
        }
        shells.sort_by(|a, b| b.0.total_cmp(&a.0));
        scene.shells = shells.into_iter().map(|(_, ball)| ball).collect();
    }

    pub(super) fn edges(&self, scene: &mut Scene) {
        let Some(plan) = &self.footage.plan else { return };
        let unit_px = self.view.unit_px();
        if plan.graph.edge_count() <= MOST_EDGES {
            let many = plan.graph.edge_count() as f32;
            let opacity = (36.0 / many).clamp(0.08, 0.9);
            let width_px = (2.2 - many / 200.0).clamp(1.0, 2.2) * unit_px;
            for (i, j) in plan.graph.edges() {
                let (Some(from), Some(to)) = (self.vehicle(i), self.vehicle(j)) else { continue };
                #[expect(clippy::cast_possible_truncation, reason = "a colour")]
                let tension = plan.tension(Pair::new(i, j), (to - from).norm()) as f32;
                // What acts is seen before what rests.
                let strength = opacity * (0.45 + 0.55 * tension.abs());
                let colour = self.view.theme.tension(tension).at(strength);
                scene.lines.push(Line { ends_m: [single(from), single(to)], colours: [colour; 2], width_px });
            }
        }
    }

    /// The pair that must be seen: the closest one, and every one that is closer than delta.
    pub(super) fn pairs(&self, scene: &mut Scene) {
        let theme = self.view.theme;
        // The worst one last, which is over the others.
        let alarmed = self.violated.iter().rev().map(|(pair, _)| (*pair, theme.alarm(), 5.0));
        let nearest = self.clear_nearest().map(|(pair, _)| (pair, theme.ink(), 2.6));
        for (pair, colour, width) in nearest.into_iter().chain(alarmed) {
            if let (Some(from), Some(to)) = (self.vehicle(pair.first()), self.vehicle(pair.second())) {
                let width_px = width * self.view.unit_px();
                scene.lines.push(Line { ends_m: [single(from), single(to)], colours: [colour; 2], width_px });
            }
        }
    }

    /// Where every vehicle came from, fading with age. The corners are samples whose number is a multiple of a power of
    /// two, so that a trail does not shimmer as time goes on.
    pub(super) fn trails(&self, scene: &mut Scene) {
        let (count, last) = (self.footage.count(), self.moment.last);
        let most = (TRAIL_PIECES / count.max(1)).clamp(2, LONGEST_TRAIL);
        let mut stride = 1;
        while last / stride > most {
            stride *= 2;
        }
        let [first_s, last_s] = self.footage.range_s();
        let fading_s = (FADED_AFTER * (last_s - first_s)).max(1e-9);
        let now_s = self.moment.time_s;
        #[expect(clippy::cast_possible_truncation, reason = "an opacity")]
        let opacity = |time_s: f64| FADED + (FRESH - FADED) * (1.0 - (now_s - time_s) / fading_s).max(0.0) as f32;
        let width_px = if count < 50 { 2.0 } else { 1.3 } * self.view.unit_px();
        let corners: Vec<usize> = (0..=last).step_by(stride).collect();
        scene.lines.reserve(count * corners.len());
        for k in 0..count {
            let colour = self.colour(k);
            let mut from: Option<([f32; 3], f32)> = None;
            let recorded = corners.iter().map(|&corner| {
                let (time_s, positions_m) = self.footage.instant(corner);
                (self.stage.place(positions_m, k), opacity(time_s))
            });
            for (place, strength) in recorded.chain([(self.vehicle(k), FRESH)]) {
                let to = place.map(|place| (single(place), strength));
                if let (Some((start, faint)), Some((end, strong))) = (from, to)
                    && start != end
                {
                    let colours = [colour.at(faint), colour.at(strong)];
                    scene.lines.push(Line { ends_m: [start, end], colours, width_px });
                }
                from = to;
            }
        }
    }

    /// Crosses where the vehicles started and rings where they belong, the formation put on them by the rigid motion that
    /// fits best.
    pub(super) fn starts_and_goals(&self, scene: &mut Scene) {
        let count = self.footage.count();
        if count > MOST_MARKS || self.footage.instants() == 0 {
            return;
        }
        let (_, start_m) = self.footage.instant(0);
        let (right, up) = (self.camera.right, self.camera.up);
        let width_px = 1.8 * self.view.unit_px();
        // Many opaque ones would hide what they mark.
        let opacity = (40.0 / count.max(1) as f32).clamp(0.05, 0.9);
        for k in 0..count {
            let Some(place) = self.stage.place(start_m, k) else { continue };
            let (arm, colour) =
                (self.at_least(place, self.footage.radius_m[k] * 0.8, LEAST_PX[1]), self.colour(k).at(opacity));
            for across in [(right + up) * arm, (right - up) * arm] {
                scene.lines.push(Line {
                    ends_m: [single(place - across), single(place + across)],
                    colours: [colour; 2],
                    width_px,
                });
            }
        }
        let Some(plan) = &self.footage.plan else { return };
        let Some(motion) = best_rigid_motion(&self.moment.positions_m, &plan.formation) else { return };
        for k in 0..count {
            let centre = motion.apply(row(&plan.formation.slots_m, k)) - self.stage.origin_m();
            let (radius, colour) =
                (self.at_least(centre, self.footage.radius_m[k] * SLOT, LEAST_PX[2]), self.colour(k).at(opacity));
            let corner = |n: u32| {
                let (sin, cos) = (f64::from(n % RING) / f64::from(RING) * std::f64::consts::TAU).sin_cos();
                single(centre + (right * cos + up * sin) * radius)
            };
            scene.lines.extend((0..RING).map(|n| Line {
                ends_m: [corner(n), corner(n + 1)],
                colours: [colour; 2],
                width_px,
            }));
        }
    }
}
