//! Vehicles whose attitude is known: a body with four arms, the discs of its rotors and a mark ahead.

use nalgebra::{UnitQuaternion, Vector3};

use super::colour::Colour;
use super::compose::SceneBuilder;
use super::draw_list::{Ball, Disc, Line, single};
use crate::timeline::QuadrotorShape;

/// Least radius of a hull that is drawn with arms in a picture 720 pixels high, and in any \[pixels\]: a smaller one is
/// a ball, which is seen better.
const LEAST_PX: [f64; 2] = [9.0, 6.0];
/// In units of the arm: radius of the body and of the mark ahead, how far ahead that is, height of the rotors above the
/// body's middle, width of an arm.
const BODY: f64 = 0.3;
const NOSE: f64 = 0.13;
const AHEAD: f64 = 0.72;
const ABOVE: f64 = 0.18;
const ARM: f64 = 0.11;
/// Least width of an arm, and that of a blade, in a picture 720 pixels high \[pixels\].
const ARM_PX: f32 = 1.5;
const BLADE_PX: f32 = 1.2;
/// Opacity of a rotor's rim and of its blade.
const DISC: f32 = 0.7;
const BLADE: f32 = 0.75;

/// A quadrotor in place, in the scene's coordinates.
pub(super) struct Quadrotor {
    place: Vector3<f64>,
    attitude: UnitQuaternion<f64>,
    shape: QuadrotorShape,
    arm_m: f64,
}

impl Quadrotor {
    /// A place on the body in the scene's coordinates \[m\].
    fn at(&self, on_body_m: Vector3<f64>) -> Vector3<f64> {
        self.place + self.attitude * on_body_m
    }

    /// The body and the mark ahead.
    pub(super) fn body(&self, colour: Colour, nose: Colour) -> [Ball; 2] {
        #[expect(clippy::cast_possible_truncation, reason = "the draw list is in single precision")]
        let ball = |centre, share: f64, colour| Ball {
            centre_m: single(centre),
            radius_m: (share * self.arm_m) as f32,
            colour,
        };
        [ball(self.place, BODY, colour), ball(self.nose(), NOSE, nose)]
    }

    fn nose(&self) -> Vector3<f64> {
        self.at(Vector3::x() * (AHEAD * self.arm_m))
    }

    /// Middles of the rotors \[m\].
    fn rotors(&self) -> [Vector3<f64>; 4] {
        let above = Vector3::z() * (ABOVE * self.arm_m);
        self.shape.rotors_m.map(|rotor_m| self.at(rotor_m + above))
    }

    /// Unit vector along the thrust.
    fn up(&self) -> Vector3<f64> {
        self.attitude * Vector3::z()
    }
}

impl SceneBuilder<'_> {
    /// A vehicle whose attitude is known, where it is large enough in the picture to be seen as more than a ball.
    pub(super) fn quadrotor(&self, k: usize) -> Option<Quadrotor> {
        let attitude = self.frame.attitude(k)?;
        let place = self.vehicle(k)?;
        let radius_m = self.timeline.radius_m[k];
        let radius_px = radius_m * self.camera.project(place)?.px_per_m;
        let [at_720, least] = LEAST_PX;
        if radius_px < least.max(at_720 * f64::from(self.view.unit_px())) {
            return None;
        }
        let shape = self.timeline.shape.unwrap_or_else(|| QuadrotorShape::within(radius_m));
        Some(Quadrotor { place, attitude, shape, arm_m: shape.arm_m() })
    }

    fn quadrotors(&self) -> impl Iterator<Item = (Quadrotor, Colour)> {
        (0..self.timeline.count()).filter_map(|k| Some((self.quadrotor(k)?, self.body_colour(k))))
    }

    /// What rotors sweep, the farthest first.
    pub(super) fn rotors(&self, discs: &mut Vec<Disc>) {
        let mut ordered = Vec::new();
        for (quadrotor, colour) in self.quadrotors() {
            let (normal, colour) = (single(quadrotor.up()), colour.at(DISC));
            #[expect(clippy::cast_possible_truncation, reason = "the draw list is in single precision")]
            let radius_m = quadrotor.shape.rotor_radius_m as f32;
            let disc = |centre| Disc { centre_m: single(centre), radius_m, normal, colour };
            ordered.extend(quadrotor.rotors().map(|centre| (self.camera.seen(centre).z, disc(centre))));
        }
        ordered.sort_by(|a, b| a.0.total_cmp(&b.0));
        discs.extend(ordered.into_iter().map(|(_, disc)| disc));
    }

    /// Arms, the neck of the mark ahead, and in every disc its diameter across the line of sight, which is seen from
    /// its edge too.
    pub(super) fn arms(&self, lines: &mut Vec<Line>) {
        let unit_px = self.view.unit_px();
        for (quadrotor, colour) in self.quadrotors() {
            let px_per_m = self.camera.project(quadrotor.place).map_or(0.0, |at| at.px_per_m);
            #[expect(clippy::cast_possible_truncation, reason = "pixels")]
            let width_px = (ARM * quadrotor.arm_m * px_per_m) as f32;
            let width_px = width_px.max(ARM_PX * unit_px);
            lines.push(Line::new([quadrotor.place, quadrotor.nose()], self.view.theme.ink(), width_px));
            let across = quadrotor.up().cross(&self.camera.back).try_normalize(1e-6);
            for rotor in quadrotor.rotors() {
                lines.push(Line::new([quadrotor.place, rotor], colour, width_px));
                let reach = across.map(|across| across * quadrotor.shape.rotor_radius_m);
                let blade = reach.map(|reach| [rotor - reach, rotor + reach]);
                lines.extend(blade.map(|ends| Line::new(ends, colour.at(BLADE), BLADE_PX * unit_px)));
            }
        }
    }
}
