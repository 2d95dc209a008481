use nalgebra::{UnitQuaternion, Vector3};

use super::*;
use crate::timeline::{QuadrotorShape, Timeline};
use tautline_core::record::{Channel, Sample};
use tautline_core::swarm::{Rows, Swarm};

const ABOVE: f64 = 0.18;
const PLACES_M: [f64; 6] = [0.0, 0.0, 1.0, 3.0, 0.0, 1.0];

/// Two vehicles 3 m apart, both with one attitude.
fn timeline(attitude: Option<UnitQuaternion<f64>>) -> Timeline {
    let swarm = Swarm::at_rest(Rows::from_row_slice(&PLACES_M));
    let mut timeline = Timeline::new("pair", 2);
    timeline.radius_m = vec![0.25; 2];
    timeline.delta_m = Some(1.0);
    let mut channels = Vec::new();
    if let Some(q) = attitude {
        let values = [q.w, q.i, q.j, q.k].repeat(2);
        channels.push(Channel { values, ..Channel::new("attitude", &["qw", "qx", "qy", "qz"]) });
    }
    let control = Rows::zeros(2);
    timeline.take(&Sample { channels: &channels, ..Sample::new(0.0, 0, &swarm, &control) });
    timeline
}

fn scene(timeline: &Timeline, size_px: [u32; 2]) -> Scene {
    let (frame, extent) = (timeline.log.at(0.0).expect("a frame"), Extent::of(timeline));
    let view = View { size_px, layers: Layers { shells: true, ..Layers::NONE }, ..View::default() };
    let camera = extent.camera(timeline, &frame, &view).expect("a camera");
    Scene::compose(timeline, &extent, &frame, &view, camera)
}

/// How far the discs of a scene are from where the rotors of both vehicles are under an attitude \[m\].
fn off_m(timeline: &Timeline, attitude: UnitQuaternion<f64>) -> f64 {
    let (shape, origin_m) = (QuadrotorShape::within(0.25), Extent::of(timeline).origin_m());
    let scene = scene(timeline, [1280, 720]);
    assert_eq!(scene.discs.len(), 8);
    let expected = PLACES_M.chunks_exact(3).flat_map(|place| {
        let place = Vector3::new(place[0], place[1], place[2]) - origin_m;
        shape.rotors_m.map(|rotor_m| place + attitude * (rotor_m + Vector3::z() * (ABOVE * shape.arm_m())))
    });
    let nearest = |rotor: Vector3<f64>| {
        let off = |disc: &Disc| {
            let normal = Vector3::from(disc.normal.map(f64::from));
            let centre = Vector3::from(disc.centre_m.map(f64::from));
            (centre - rotor).norm() + (normal - attitude * Vector3::z()).norm()
        };
        scene.discs.iter().map(off).fold(f64::INFINITY, f64::min)
    };
    expected.map(nearest).fold(0.0, f64::max)
}

#[test]
fn the_discs_of_a_tilted_quadrotor_are_where_its_attitude_says() {
    let tilted = UnitQuaternion::from_euler_angles(0.3, -0.4, 1.1);
    assert!(off_m(&timeline(Some(tilted)), tilted) < 1e-6);
    assert!(off_m(&timeline(Some(tilted)), UnitQuaternion::identity()) > 0.05, "level they would be elsewhere");
    assert!(off_m(&timeline(Some(tilted)), tilted.inverse()) > 0.05, "turned the other way they would be too");
}

#[test]
fn a_quadrotor_keeps_its_shell_and_shows_where_it_looks() {
    let left = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::FRAC_PI_2);
    let timeline = timeline(Some(left));
    let scene = scene(&timeline, [1280, 720]);
    assert_eq!(scene.shells.len(), 2);
    // A body and the mark ahead each.
    assert_eq!(scene.balls.len(), 4);
    let [body, nose] = [0, 1].map(|k| Vector3::from(scene.balls[k].centre_m.map(f64::from)));
    let ahead = (nose - body).normalize();
    assert!((ahead - Vector3::y()).norm() < 1e-6, "{ahead}");
    assert!(scene.balls[1].radius_m < scene.balls[0].radius_m && scene.balls[0].radius_m < 0.25);
}

#[test]
fn what_is_small_or_of_unknown_attitude_is_a_ball() {
    let level = timeline(Some(UnitQuaternion::identity()));
    let small = scene(&level, [64, 36]);
    let unknown = scene(&timeline(None), [64, 36]);
    assert_eq!((small.balls, small.discs.len(), small.lines.len()), (unknown.balls, 0, 0));
    let large = scene(&timeline(None), [1280, 720]);
    assert_eq!((large.balls.len(), large.discs.len(), large.lines.len()), (2, 0, 0));
}
