//! Foxglove scene of a run: 3-D entities that Foxglove shows without a plug-in.

use std::io;

use foxglove::messages::line_primitive::Type as LineType;
use foxglove::messages::{
    Color, CubePrimitive, CylinderPrimitive, LinePrimitive, Point3, Pose, Quaternion, SceneEntity, SceneUpdate,
    SpherePrimitive, Timestamp, Vector3,
};
use foxglove::{Encode as _, Schema};
use nalgebra::UnitQuaternion;

use super::scene::{Colour, Theme};
use super::timeline::Timeline;
use tautline_audit::ObjectPair;
use tautline_core::obstacle::{Obstacle, Shape};
use tautline_core::record::{Event, Sample};
use tautline_core::swarm::{Pair, Rows, row, separation};
use tautline_recordings::mcap::{ExtraTopic, Topic};
use tautline_report::drawing::Rotors;
use tautline_report::drawing::colours::{ALARM, OBSTACLE, SHELL};
use tautline_report::flight_log::attitudes_of;
use tautline_sim::scenario::Scenario;

/// Rate of scenes \[Hz\].
pub const SCENE_HZ: f64 = 5.0;
/// Largest number of edges in a scene.
const MAX_EDGES: usize = 300;
/// Largest number of vehicles in a scene, apart from vehicles in violation.
const MAX_VEHICLES: usize = 2000;
/// Largest number of quadrotors with arms and rotors; in a larger swarm each vehicle is a ball.
const MAX_QUADROTORS: usize = 100;
/// Width of an edge \[m\].
const EDGE_M: f64 = 0.03;
/// Side of the plate that represents a half-space \[m\].
const PLATE_M: f64 = 100.0;
/// Tolerance of sample times, which are products of steps \[s\].
const ROUNDING_S: f64 = 1e-6;

/// Makes `foxglove.SceneUpdate` messages on `/scene` at [`SCENE_HZ`]: vehicles as balls or quadrotors, keep-out shells,
/// and edges in the colour of their tension. Colours are those of [`Theme::Dark`].
///
/// A swarm of more than 2000 vehicles is reduced to 2000, evenly chosen, plus vehicles closer than delta to another.
///
/// A scene takes about 230 bytes per vehicle, half of it for the shell, and 140 per edge; more than 300 edges are not
/// included. Relative to 72 bytes per vehicle and sample at 60 Hz a recording grows by less than a third, and one of
/// few vehicles by a half. Up to 100 quadrotors have arms and rotors with their attitude, about 1100 bytes each.
pub struct FoxgloveScene {
    /// Flight without samples.
    timeline: Timeline,
    next_s: f64,
    schema: Option<Schema>,
}

impl FoxgloveScene {
    /// Creates scenes for a flight of this scenario.
    #[must_use]
    pub fn of(scenario: &Scenario) -> Self {
        Self { timeline: Timeline::of(scenario), next_s: f64::NEG_INFINITY, schema: SceneUpdate::get_schema() }
    }

    fn scene(&self, sample: &Sample<'_>) -> SceneUpdate {
        let (theme, timeline) = (Theme::Dark, &self.timeline);
        let obstacles = || timeline.plan.iter().flat_map(|plan| &plan.obstacles);
        let (time_s, positions_m) = (sample.time_s, &sample.swarm.positions_m);
        let count = positions_m.nrows();
        let mut alarm = vec![false; count];
        let too_close = timeline.log.violations().open().filter_map(ObjectPair::vehicles);
        for pair in too_close.filter(|pair| pair.second() < count) {
            (alarm[pair.first()], alarm[pair.second()]) = (true, true);
        }
        // A vehicle is chosen where the share of vehicles up to it passes an integer.
        let share = |k: usize| k * MAX_VEHICLES / count;
        let is_shown = |k: &usize| count <= MAX_VEHICLES || alarm[*k] || share(*k) < share(*k + 1);
        let hull_colour = |k: usize| if alarm[k] { theme.pick(ALARM) } else { theme.vehicle_among(k, count) };
        let attitudes = if count <= MAX_QUADROTORS { attitudes_of(sample) } else { Vec::new() };
        let attitude = |k: usize| attitudes.get(k).copied().flatten();
        let mut entity = SceneEntity {
            timestamp: Some(timestamp(time_s)),
            frame_id: "world".to_owned(),
            id: "swarm".to_owned(),
            cubes: obstacles().filter_map(cube).collect(),
            cylinders: obstacles().filter_map(cylinder).collect(),
            lines: self.edges(positions_m, time_s).into_iter().collect(),
            ..SceneEntity::default()
        };
        for k in (0..count).filter(is_shown) {
            let (place_m, radius_m) = (row(positions_m, k), timeline.radius_m[k]);
            match attitude(k) {
                Some(attitude) => {
                    let rotors = timeline.rotors.unwrap_or_else(|| Rotors::within(radius_m));
                    add_quadrotor(&mut entity, &rotors, place_m, attitude, hull_colour(k));
                }
                None => entity.spheres.push(ball(place_m, radius_m, hull_colour(k))),
            }
        }
        entity.spheres.extend((0..count).filter(is_shown).map(|k| {
            let colour = theme.pick(if alarm[k] { ALARM } else { SHELL });
            let mut shell = ball(row(positions_m, k), timeline.delta_m.unwrap_or(0.0) / 2.0, colour.at(0.15));
            shell.size.iter_mut().for_each(|size| size.z *= timeline.log.metric().ratio());
            shell
        }));
        entity.spheres.extend(obstacles().filter_map(|obstacle| match obstacle.shape {
            Shape::Ball { radius_m } => Some(ball(obstacle.place_m, radius_m, theme.pick(OBSTACLE))),
            _ => None,
        }));
        SceneUpdate { deletions: Vec::new(), entities: vec![entity] }
    }

    /// Returns the edges in the colour of their tension; `None` without edges, or for too many.
    fn edges(&self, positions_m: &Rows, time_s: f64) -> Option<LinePrimitive> {
        let plan = self.timeline.plan.as_ref().filter(|plan| (1..=MAX_EDGES).contains(&plan.graph.edge_count()))?;
        let (mut points, mut colors) = (Vec::new(), Vec::new());
        for (i, j) in plan.graph.edges() {
            let tension = plan.tension(Pair::new(i, j), separation(positions_m, i, j), time_s);
            for place in [i, j].map(|k| row(positions_m, k)) {
                points.push(Point3 { x: place.x, y: place.y, z: place.z });
                colors.push(colour(Theme::Dark.tension(tension).at(0.8)));
            }
        }
        let pose = Some(pose(nalgebra::Vector3::zeros(), UnitQuaternion::identity()));
        let r#type = LineType::LineList.into();
        Some(LinePrimitive { r#type, pose, thickness: EDGE_M, points, colors, ..LinePrimitive::default() })
    }
}

impl ExtraTopic for FoxgloveScene {
    fn topic(&self) -> Topic<'_> {
        let (schema_name, schema_encoding, schema) = self
            .schema
            .as_ref()
            .map(|schema| (schema.name.as_str(), schema.encoding.as_str(), &*schema.data))
            .unwrap_or_default();
        Topic { name: "/scene", message_encoding: "protobuf", schema_name, schema_encoding, schema }
    }

    fn message(&mut self, sample: &Sample<'_>, message: &mut Vec<u8>) -> io::Result<bool> {
        if sample.time_s < self.next_s - ROUNDING_S {
            return Ok(false);
        }
        self.next_s = sample.time_s + 1.0 / SCENE_HZ;
        message.clear();
        self.scene(sample).encode(message).map_err(io::Error::other)?;
        Ok(true)
    }

    fn note(&mut self, event: &Event) {
        self.timeline.note(event);
    }
}

/// Returns the cube of a box, or a plate for a half-space.
fn cube(obstacle: &Obstacle) -> Option<CubePrimitive> {
    let (size, turn) = match obstacle.shape {
        Shape::Box { half_m, yaw_deg } => {
            (half_m * 2.0, UnitQuaternion::from_axis_angle(&nalgebra::Vector3::z_axis(), yaw_deg.to_radians()))
        }
        Shape::HalfSpace { normal } => (nalgebra::Vector3::new(PLATE_M, PLATE_M, 1e-3), from_z(normal)),
        Shape::Ball { .. } | Shape::Capsule { .. } => return None,
    };
    Some(CubePrimitive {
        pose: Some(pose(obstacle.place_m, turn)),
        size: Some(Vector3 { x: size.x, y: size.y, z: size.z }),
        color: Some(colour(Theme::Dark.pick(OBSTACLE))),
    })
}

/// Returns the cylinder of a capsule, without its round ends.
fn cylinder(obstacle: &Obstacle) -> Option<CylinderPrimitive> {
    let Shape::Capsule { from_m, to_m, radius_m } = obstacle.shape else { return None };
    let side = 2.0 * radius_m;
    Some(CylinderPrimitive {
        pose: Some(pose(obstacle.place_m + (from_m + to_m) / 2.0, from_z(to_m - from_m))),
        size: Some(Vector3 { x: side, y: side, z: (to_m - from_m).norm() + side }),
        bottom_scale: 1.0,
        top_scale: 1.0,
        color: Some(colour(Theme::Dark.pick(OBSTACLE))),
    })
}

/// Returns the rotation of the z axis to a direction.
fn from_z(direction: nalgebra::Vector3<f64>) -> UnitQuaternion<f64> {
    let z = nalgebra::Vector3::z();
    UnitQuaternion::rotation_between(&z, &direction)
        .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&nalgebra::Vector3::x_axis(), std::f64::consts::PI))
}

fn timestamp(time_s: f64) -> Timestamp {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the casts saturate")]
    let (seconds, nanoseconds) = (time_s.floor() as u32, ((time_s - time_s.floor()) * 1e9) as u32);
    Timestamp::new_checked(seconds, nanoseconds).unwrap_or(Timestamp::MAX)
}

/// Thickness of a rotor relative to the arm.
const ROTOR: f64 = 0.04;
/// Opacity of a rotor.
const OPACITY: f32 = 0.5;

/// Adds a quadrotor at a position \[m\]: body, rotors, and arms with a mark ahead.
fn add_quadrotor(
    entity: &mut SceneEntity,
    shape: &Rotors,
    place_m: nalgebra::Vector3<f64>,
    attitude: UnitQuaternion<f64>,
    shown: Colour,
) {
    let (arm_m, side) = (shape.arm_m(), 2.0 * shape.radius_m);
    entity.spheres.push(ball(place_m, Rotors::BODY * arm_m, shown));
    entity.cylinders.extend(shape.places_m().map(|rotor_m| CylinderPrimitive {
        pose: Some(pose(place_m + attitude * rotor_m, attitude)),
        size: Some(Vector3 { x: side, y: side, z: ROTOR * arm_m }),
        bottom_scale: 1.0,
        top_scale: 1.0,
        color: Some(colour(shown.at(OPACITY))),
    }));
    let ends = shape.places_m().into_iter().chain([shape.nose_m()]);
    entity.lines.push(LinePrimitive {
        r#type: LineType::LineList.into(),
        pose: Some(pose(place_m, attitude)),
        thickness: Rotors::WIDTH * arm_m,
        points: ends.flat_map(|end| [Point3::default(), Point3 { x: end.x, y: end.y, z: end.z }]).collect(),
        color: Some(colour(shown)),
        ..LinePrimitive::default()
    });
}

/// Returns the pose at a position with a rotation.
fn pose(place: nalgebra::Vector3<f64>, turn: UnitQuaternion<f64>) -> Pose {
    let [x, y, z, w] = turn.coords.into();
    Pose {
        position: Some(Vector3 { x: place.x, y: place.y, z: place.z }),
        orientation: Some(Quaternion { x, y, z, w }),
    }
}

/// Returns a ball with a radius \[m\].
fn ball(place: nalgebra::Vector3<f64>, radius_m: f64, shown: Colour) -> SpherePrimitive {
    let side = 2.0 * radius_m;
    SpherePrimitive {
        pose: Some(pose(place, UnitQuaternion::identity())),
        size: Some(Vector3 { x: side, y: side, z: side }),
        color: Some(colour(shown)),
    }
}

/// Converts a colour to Foxglove's type.
fn colour(colour: Colour) -> Color {
    let [r, g, b, a] = colour.rgba.map(|channel| f64::from(channel) / 255.0);
    Color { r, g, b, a }
}

#[cfg(test)]
mod tests {
    use foxglove::Decode as _;

    use super::*;
    use tautline_core::swarm::Swarm;
    use tautline_sim::scenario::Source;

    fn pentagon() -> Scenario {
        Scenario::read(&Source::Builtin("pentagon".to_owned()), &[]).expect("built in")
    }

    fn message(scene: &mut FoxgloveScene, time_s: f64, swarm: &Swarm) -> Option<Vec<u8>> {
        let control = Rows::zeros(swarm.count());
        let sample = Sample::new(time_s, 0, swarm, &control);
        let mut bytes = Vec::new();
        scene.message(&sample, &mut bytes).expect("encoded").then_some(bytes)
    }

    #[test]
    fn a_scene_holds_the_obstacles() {
        let scenario = Scenario::read(&Source::Builtin("obstacles".to_owned()), &[]).expect("built in");
        let mut scene = FoxgloveScene::of(&scenario);
        let bytes = message(&mut scene, 0.0, &scenario.start).expect("a message");
        let update = SceneUpdate::decode(bytes.as_slice()).expect("a scene");
        let entity = &update.entities[0];
        assert_eq!((entity.cubes.len(), entity.cylinders.len()), (2, 3));
        let cable = entity.cylinders[2].pose.and_then(|pose| pose.position).expect("a place");
        assert_eq!((cable.x, cable.y, cable.z), (16.0, 0.0, 7.25));
        assert_eq!(entity.cubes[0].size.map(|size| (size.x, size.y, size.z)), Some((3.0, 5.0, 3.0)));
    }

    #[test]
    fn a_scene_holds_every_vehicle_with_its_shell_and_every_edge() {
        let scenario = pentagon();
        let mut scene = FoxgloveScene::of(&scenario);
        let bytes = message(&mut scene, 0.0, &scenario.start).expect("a message");
        let update = SceneUpdate::decode(bytes.as_slice()).expect("a scene");
        let entity = &update.entities[0];
        assert_eq!((entity.spheres.len(), entity.lines[0].points.len()), (10, 20));
        assert_eq!(entity.spheres[0].size.map(|size| size.x), Some(0.5));
        assert_eq!(
            entity.spheres[0].pose.and_then(|pose| pose.position).map(|position| (position.x, position.y)),
            Some((3.0, -0.05))
        );
        assert_eq!(entity.spheres[5].size.map(|size| size.x), Some(2.0));
        let topic = scene.topic();
        assert_eq!(
            (topic.schema_name, topic.message_encoding),
            ("foxglove.SceneUpdate", SceneUpdate::get_message_encoding().as_str())
        );
        assert!(!topic.schema.is_empty());
    }

    #[test]
    fn a_shell_has_the_shape_of_the_ellipsoid() {
        let scenario = Scenario {
            safety: tautline_sim::scenario::Safety::Ellipsoid { half_axes_m: [1.0, 1.0, 3.0] },
            ..pentagon()
        };
        let bytes = message(&mut FoxgloveScene::of(&scenario), 0.0, &scenario.start).expect("a message");
        let update = SceneUpdate::decode(bytes.as_slice()).expect("a scene");
        let size = |k: usize| update.entities[0].spheres[k].size.map(|size| (size.x, size.y, size.z));
        assert_eq!((size(0), size(5)), (Some((0.5, 0.5, 0.5)), Some((2.0, 2.0, 6.0))));
    }

    #[test]
    fn a_quadrotor_has_its_attitude_and_a_large_swarm_has_balls() {
        let entity = |count: usize, tilt_rad: f64| {
            let start = Swarm::at_rest(tautline_laws::formation::Formation::grid(count, 3.0).slots_m);
            let formation = tautline_laws::formation::Formation { slots_m: start.positions_m.clone() };
            let mut scene = FoxgloveScene::of(&Scenario::new("fliers", start.clone(), formation, 2.0, 1.0));
            let mut attitude = tautline_core::record::Channel::new("attitude", &["qw", "qx", "qy", "qz"]);
            let half = 0.5 * tilt_rad;
            attitude.values = [half.cos(), 0.0, half.sin(), 0.0].repeat(count);
            let (control, channels, mut bytes) = (Rows::zeros(count), [attitude], Vec::new());
            let sample = Sample { channels: &channels, ..Sample::new(0.0, 0, &start, &control) };
            scene.message(&sample, &mut bytes).expect("encoded");
            (
                SceneUpdate::decode(bytes.as_slice()).expect("a scene").entities.remove(0),
                row(&start.positions_m, 0),
                bytes,
            )
        };
        let (tilted, place, bytes) = entity(2, 0.4);
        assert_eq!((tilted.spheres.len(), tilted.cylinders.len(), tilted.lines.len()), (4, 8, 3));
        assert!(bytes.len() < 2 * (1100 + 230) + 140 + 100, "{} bytes", bytes.len());
        let front = |entity: &SceneEntity| entity.cylinders[0].pose.expect("a pose");
        let (position, turn) = (front(&tilted).position.expect("a place"), front(&tilted).orientation.expect("a turn"));
        // A vehicle that flies ahead tilts its front down.
        let at = Rotors::within(0.25).places_m()[0];
        let (sin, cos) = 0.4_f64.sin_cos();
        assert!((position.x - place.x - at.x * cos - at.z * sin).abs() < 1e-12);
        assert!((position.z - place.z + at.x * sin - at.z * cos).abs() < 1e-12);
        assert!((turn.y - 0.2_f64.sin()).abs() < 1e-12 && (turn.w - 0.2_f64.cos()).abs() < 1e-12);
        let (level, place, _) = entity(2, 0.0);
        assert_eq!(front(&level).position.map(|position| position.z), Some(place.z + at.z));
        let (many, ..) = entity(MAX_QUADROTORS + 1, 0.4);
        assert_eq!((many.spheres.len(), many.cylinders.len()), (2 * (MAX_QUADROTORS + 1), 0));
    }

    #[test]
    fn a_pair_in_violation_is_red_with_or_without_an_edge() {
        let mut scenario = pentagon();
        scenario.graph = tautline_laws::graph::Graph::ring(5);
        let mut swarm = scenario.start.clone();
        let place = row(&swarm.positions_m, 0) + nalgebra::Vector3::new(0.0, 0.0, 1.9);
        tautline_core::swarm::set_row(&mut swarm.positions_m, 2, place);
        let mut scene = FoxgloveScene::of(&scenario);
        let red = |scene: &mut FoxgloveScene, time_s: f64| {
            let bytes = message(scene, time_s, &swarm).expect("a message");
            let entity = SceneUpdate::decode(bytes.as_slice()).expect("a scene").entities.remove(0);
            assert!(entity.lines[0].pose.is_some());
            [0, 2, 4].map(|k| entity.spheres[k].color == Some(colour(Theme::Dark.pick(ALARM))))
        };
        assert_eq!(red(&mut scene, 0.0), [false; 3], "no violation was reported");
        let (pair, time_s, min_m) = (Pair::new(0, 2), 0.5, 1.9);
        scene.note(&Event::ViolationBegan { pair, time_s });
        assert_eq!(red(&mut scene, 1.0), [true, true, false]);
        scene.note(&Event::ViolationEnded { pair, time_s, min_m });
        assert_eq!(red(&mut scene, 2.0), [false; 3]);
    }

    #[test]
    fn a_scene_of_a_large_swarm_holds_a_choice_and_all_violations() {
        let count = 4001;
        let formation = tautline_laws::formation::Formation::grid(count, 3.0);
        let start = Swarm::at_rest(formation.slots_m.clone());
        let scenario = Scenario::new("many", start.clone(), formation, 2.0, 1.0);
        let mut scene = FoxgloveScene::of(&scenario);
        let shown = |time_s: f64, scene: &mut FoxgloveScene| {
            let bytes = message(scene, time_s, &start).expect("a message");
            SceneUpdate::decode(bytes.as_slice()).expect("a scene").entities[0].spheres.len()
        };
        assert_eq!(shown(0.0, &mut scene), 2 * MAX_VEHICLES);
        for first in [0, 2, 3, 4000] {
            scene.note(&Event::ViolationBegan { pair: Pair::new(first, (first + 1) % count), time_s: 0.5 });
        }
        let more = shown(1.0, &mut scene) / 2 - MAX_VEHICLES;
        assert!((2..=4).contains(&more), "some of the vehicles 0 to 4 and 4000 are chosen anyway: {more}");
    }

    #[test]
    fn the_rate_and_size_of_scenes_are_as_documented() {
        let scenario = pentagon();
        let mut scene = FoxgloveScene::of(&scenario);
        let sizes: Vec<usize> = (0..=60_u32)
            .filter_map(|k| message(&mut scene, f64::from(k) / 60.0, &scenario.start))
            .map(|bytes| bytes.len())
            .collect();
        assert_eq!(sizes.len(), 6);
        let most = 5 * 230 + 10 * 140 + 60;
        assert!(sizes.iter().all(|&size| size <= most && size > most / 2), "{sizes:?} of {most}");
    }
}
