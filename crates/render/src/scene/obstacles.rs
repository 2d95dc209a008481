//! Solids that are in the way: balls are solid, capsules are made of balls, boxes and planes are drawn by lines.

use nalgebra::{Rotation3, Vector3};

use super::builder::SceneBuilder;
use super::draw_list::{Ball, Line, Scene, single};
use tautline_laws::space::{Obstacle, Shape};

/// Balls that a capsule is made of: so many a radius, and no more than this in all.
const BALLS_A_RADIUS: f64 = 24.0;
const MOST_BALLS: f64 = 3000.0;
/// Lines across each side of a box, and of a plane.
const HATCHES: u32 = 12;
/// Opacity of lines across a side, of its rims, and of lines of a plane.
const HATCH: f32 = 0.35;
const RIM: f32 = 0.95;
const PLANE: f32 = 0.18;

impl SceneBuilder<'_> {
    fn solids(&self) -> &[Obstacle] {
        self.timeline.plan.as_ref().map_or(&[], |plan| &plan.obstacles)
    }

    /// Balls and capsules.
    pub(super) fn round_obstacles(&self, scene: &mut Scene) {
        let colour = self.view.theme.obstacle();
        for obstacle in self.solids() {
            let place = obstacle.place_m - self.extent.origin_m();
            #[expect(clippy::cast_possible_truncation, reason = "the draw list is in single precision")]
            let ball = |centre, radius_m: f64| Ball { centre_m: single(centre), radius_m: radius_m as f32, colour };
            match obstacle.shape {
                Shape::Ball { radius_m } => scene.balls.push(ball(place, radius_m)),
                Shape::Capsule { from_m, to_m, radius_m } => {
                    let wanted = (BALLS_A_RADIUS * (to_m - from_m).norm() / radius_m).ceil();
                    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
                    let count = wanted.clamp(1.0, MOST_BALLS) as u32;
                    let along = |k: u32| place + from_m.lerp(&to_m, f64::from(k) / f64::from(count));
                    scene.balls.extend((0..=count).map(|k| ball(along(k), radius_m)));
                }
                Shape::Box { .. } | Shape::HalfSpace { .. } => {}
            }
        }
    }

    /// Boxes and planes.
    pub(super) fn flat_obstacles(&self, lines: &mut Vec<Line>) {
        for obstacle in self.solids() {
            let place = obstacle.place_m - self.extent.origin_m();
            match obstacle.shape {
                Shape::Box { half_m, yaw_deg } => {
                    let turned = Rotation3::from_axis_angle(&Vector3::z_axis(), yaw_deg.to_radians());
                    for side in 0..6 {
                        let (axis, sign) = (side / 2, if side % 2 == 0 { 1.0 } else { -1.0 });
                        let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
                        let of = |k: usize, share: f64| turned * Vector3::ith(k, half_m[k] * share);
                        self.hatched([RIM, HATCH], place + of(axis, sign), of(u, 1.0), of(v, 1.0), lines);
                    }
                }
                Shape::HalfSpace { normal } => {
                    let normal = normal.normalize();
                    let (centre, reach_m) = self.extent.reach();
                    let foot = centre - normal * (centre - place).dot(&normal);
                    let least = normal.iamin();
                    let u = normal.cross(&Vector3::ith(least, 1.0)).normalize() * reach_m;
                    self.hatched([PLANE; 2], foot, u, normal.cross(&u), lines);
                }
                Shape::Ball { .. } | Shape::Capsule { .. } => {}
            }
        }
    }

    /// A flat piece around its middle, from minus to plus two vectors.
    fn hatched(
        &self,
        [rim, hatch]: [f32; 2],
        middle: Vector3<f64>,
        u: Vector3<f64>,
        v: Vector3<f64>,
        lines: &mut Vec<Line>,
    ) {
        let (colour, width_px) = (self.view.theme.obstacle(), 1.4 * self.view.unit_px());
        for k in 0..=HATCHES {
            let share = 2.0 * f64::from(k) / f64::from(HATCHES) - 1.0;
            let is_rim = k == 0 || k == HATCHES;
            let strength = if is_rim { rim } else { hatch };
            let mut line = |from, to| lines.push(Line::new([from, to], colour.at(strength), width_px));
            line(middle + u * share - v, middle + u * share + v);
            if is_rim {
                line(middle + v * share - u, middle + v * share + u);
            }
        }
    }
}
