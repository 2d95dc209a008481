//! What a scene of Foxglove is put together from.

use foxglove::messages::line_primitive::Type as LineType;
use foxglove::messages::{Color, CylinderPrimitive, LinePrimitive, Point3, Pose, Quaternion, SpherePrimitive, Vector3};
use nalgebra::UnitQuaternion;

use super::scene::Colour;
use super::timeline::QuadrotorShape;

/// In units of the arm: radius of the body, width of an arm, how far ahead its mark reaches, height of a rotor.
const BODY: f64 = 0.3;
const ARM: f64 = 0.11;
const AHEAD: f64 = 0.72;
const ROTOR: f64 = 0.04;
/// Opacity of a rotor.
const OPACITY: f32 = 0.5;

/// A quadrotor: its body, its rotors, and its arms with a mark ahead, all turned as it is.
pub(super) struct QuadrotorParts {
    pub(super) body: SpherePrimitive,
    pub(super) rotors: [CylinderPrimitive; 4],
    pub(super) arms: LinePrimitive,
}

/// The parts of a quadrotor at a place \[m\].
pub(super) fn quadrotor(
    shape: &QuadrotorShape,
    place_m: nalgebra::Vector3<f64>,
    attitude: UnitQuaternion<f64>,
    shown: Colour,
) -> QuadrotorParts {
    let (arm_m, side) = (shape.arm_m(), 2.0 * shape.rotor_radius_m);
    let rotors = shape.rotors_m.map(|rotor_m| CylinderPrimitive {
        pose: Some(turned(place_m + attitude * rotor_m, attitude)),
        size: Some(Vector3 { x: side, y: side, z: ROTOR * arm_m }),
        bottom_scale: 1.0,
        top_scale: 1.0,
        color: Some(colour(shown.at(OPACITY))),
    });
    let ahead_m = nalgebra::Vector3::x() * (AHEAD * arm_m);
    let ends = shape.rotors_m.into_iter().chain([ahead_m]);
    let arms = LinePrimitive {
        r#type: LineType::LineList.into(),
        pose: Some(turned(place_m, attitude)),
        thickness: ARM * arm_m,
        points: ends.flat_map(|end| [Point3::default(), Point3 { x: end.x, y: end.y, z: end.z }]).collect(),
        color: Some(colour(shown)),
        ..LinePrimitive::default()
    };
    QuadrotorParts { body: ball(place_m, BODY * arm_m, shown), rotors, arms }
}

/// Moved to a place and turned.
pub(super) fn turned(place: nalgebra::Vector3<f64>, turn: UnitQuaternion<f64>) -> Pose {
    let [x, y, z, w] = turn.coords.into();
    Pose {
        position: Some(Vector3 { x: place.x, y: place.y, z: place.z }),
        orientation: Some(Quaternion { x, y, z, w }),
    }
}

/// A ball of a radius \[m\].
pub(super) fn ball(place: nalgebra::Vector3<f64>, radius_m: f64, shown: Colour) -> SpherePrimitive {
    let side = 2.0 * radius_m;
    SpherePrimitive {
        pose: Some(pose(Vector3 { x: place.x, y: place.y, z: place.z })),
        size: Some(Vector3 { x: side, y: side, z: side }),
        color: Some(colour(shown)),
    }
}

/// Moved to a place and not turned.
pub(super) fn pose(position: Vector3) -> Pose {
    Pose { position: Some(position), orientation: Some(Quaternion { x: 0.0, y: 0.0, z: 0.0, w: 1.0 }) }
}

/// The colour as Foxglove has it.
pub(super) fn colour(colour: Colour) -> Color {
    let [r, g, b, a] = colour.rgba.map(|channel| f64::from(channel) / 255.0);
    Color { r, g, b, a }
}
