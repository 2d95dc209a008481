//! `[[obstacle]]`: obstacles of a scenario and of a file for `tautline audit --obstacles`.
//!
//! ```toml
//! [[obstacle]]
//! name = "tower"
//! box = { size_m = [2.0, 2.0, 30.0], yaw_deg = 15.0 }
//! at_m = [10.0, 4.0, 15.0]
//! clearance_m = 1.5
//!
//! [[obstacle]]
//! name = "truck"
//! ball = { radius_m = 3.0 }
//! path = [[0.0, -20.0, 0.0, 1.0], [8.0, 20.0, 0.0, 1.0]]   # t [s], x, y, z [m]
//!
//! [[obstacle]]
//! name = "cable"
//! capsule = { from_m = [0.0, 0.0, 8.0], to_m = [30.0, 0.0, 9.0], radius_m = 0.05 }
//!
//! [[obstacle]]
//! name = "ground"
//! half_space = { normal = [0.0, 0.0, 1.0] }
//! ```

use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::error::{ErrorKind, ScenarioError, entry_key, leg_key};
use super::limits::{CONTACT_PREDICTION_M, SLOT_MARGIN, SMALLEST};
use super::spec::Scenario;
use tautline_audit::MovingObstacle;
use tautline_core::obstacle::{Obstacle, Shape};
use tautline_core::option::OBSTACLES;
use tautline_core::swarm::{Rows, row, set_row};
use tautline_core::text::beside_limit;
use tautline_laws::space::{signed_distance_m, smallest_clearance_margin};

/// Remedy for a wrong obstacle: the format of the table.
pub const OBSTACLE_HELP: &str = "an obstacle has a name, one of ball, box, capsule and half_space, and at_m = [x, y, \
 z]. In \
                                        a file for an audit, path = [[t, x, y, z], ...] may replace at_m";

/// Obstacle: a name, one shape, and a position.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ObstacleTable {
    /// Name of the obstacle.
    pub name: String,
    /// A ball around the position.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Ball")]
    ball: Option<Ball>,
    /// An upright box around the position.
    #[serde(rename = "box", default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Cuboid")]
    cuboid: Option<Cuboid>,
    /// All points within a radius of a line segment.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Capsule")]
    capsule: Option<Capsule>,
    /// All points behind a plane through the position.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "HalfSpace")]
    half_space: Option<HalfSpace>,
    /// Position in m; the origin for a capsule or a half-space unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    at_m: Option<[f64; 3]>,
    /// Path of a moving obstacle: a row `[t, x, y, z]` for each instant. Only for `tautline audit --obstacles`.
    #[serde(skip_serializing_if = "Option::is_none")]
    path: Option<Vec<[f64; 4]>>,
    /// Smallest distance in m of the centre of a vehicle from the surface. Unless given, half of `law.delta_m`, or 0.02
    /// m more than the radius of the largest hull if that is more.
    #[serde(skip_serializing_if = "Option::is_none")]
    clearance_m: Option<f64>,
}

/// A ball.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Ball {
    /// Radius in m.
    #[schemars(extend("exclusiveMinimum" = 0))]
    radius_m: f64,
}

/// An upright box.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Cuboid {
    /// Lengths along x, y and z in m, before the rotation.
    #[schemars(extend("items" = { "type": "number", "exclusiveMinimum": 0 }))]
    size_m: [f64; 3],
    /// Rotation about the vertical in degrees, counterclockwise seen from above.
    #[serde(default)]
    yaw_deg: f64,
}

/// A line segment with a radius.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[expect(clippy::struct_field_names, reason = "each is in metres")]
struct Capsule {
    /// First end of the segment relative to the position, in m.
    from_m: [f64; 3],
    /// Second end of the segment relative to the position, in m.
    to_m: [f64; 3],
    /// Radius in m.
    #[schemars(extend("exclusiveMinimum" = 0))]
    radius_m: f64,
}

/// All points behind a plane.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct HalfSpace {
    /// Normal that points out of the half-space, of any length except 0.
    normal: [f64; 3],
}

impl ObstacleTable {
    /// Returns the obstacle in the form of the audit, unchecked.
    ///
    /// # Errors
    /// A message about a wrong table, one sentence.
    pub fn into_moving(self) -> Result<MovingObstacle, String> {
        let Self { name, ball, cuboid, capsule, half_space, at_m, path, clearance_m } = self;
        let in_space = capsule.is_some() || half_space.is_some();
        let shapes = [
            ball.map(|ball| Shape::Ball { radius_m: ball.radius_m }),
            cuboid.map(|cuboid| Shape::Box { half_m: Vector3::from(cuboid.size_m) * 0.5, yaw_deg: cuboid.yaw_deg }),
            capsule.map(|capsule| Shape::Capsule {
                from_m: capsule.from_m.into(),
                to_m: capsule.to_m.into(),
                radius_m: capsule.radius_m,
            }),
            half_space.map(|half_space| Shape::HalfSpace { normal: half_space.normal.into() }),
        ];
        let mut shapes = shapes.into_iter().flatten();
        let (Some(shape), None) = (shapes.next(), shapes.next()) else {
            return Err(format!("obstacle `{name}` must have exactly one shape"));
        };
        let path = match (at_m, path) {
            (Some(at_m), None) => vec![(0.0, at_m.into())],
            (None, Some(path)) => path.into_iter().map(|[t, x, y, z]| (t, Vector3::new(x, y, z))).collect(),
            (None, None) if in_space => vec![(0.0, Vector3::zeros())],
            (None, None) => return Err(format!("obstacle `{name}` has neither at_m nor path")),
            (Some(_), Some(_)) => return Err(format!("obstacle `{name}` has both at_m and path")),
        };
        Ok(MovingObstacle { name, shape, clearance_m, path })
    }

    /// Returns the obstacle at rest, with a default clearance \[m\].
    pub(super) fn obstacle(&self, number: usize, clearance_m: f64) -> Result<Obstacle, ScenarioError> {
        let wrong =
            |problem: String, help: &str| ErrorKind::Obstacle.at(&[&entry_key("obstacle", number)], problem, help);
        let MovingObstacle { name, shape, clearance_m: own_m, path } =
            self.clone().into_moving().map_err(|problem| wrong(problem, OBSTACLE_HELP))?;
        let [(_, place_m)] = path[..] else {
            let command = format!("tautline audit {}", OBSTACLES.argument());
            let help = format!("give at_m = [x, y, z]; only `{command}` takes obstacles that move");
            return Err(wrong(format!("obstacle `{name}` moves"), &help));
        };
        Ok(Obstacle { name, place_m, shape, clearance_m: own_m.unwrap_or(clearance_m) })
    }
}

impl From<&Obstacle> for ObstacleTable {
    fn from(obstacle: &Obstacle) -> Self {
        let mut table = Self {
            name: obstacle.name.clone(),
            ball: None,
            cuboid: None,
            capsule: None,
            half_space: None,
            at_m: Some(obstacle.place_m.into()),
            path: None,
            clearance_m: Some(obstacle.clearance_m),
        };
        match obstacle.shape {
            Shape::Ball { radius_m } => table.ball = Some(Ball { radius_m }),
            Shape::Box { half_m, yaw_deg } => table.cuboid = Some(Cuboid { size_m: (half_m * 2.0).into(), yaw_deg }),
            Shape::Capsule { from_m, to_m, radius_m } => {
                table.capsule = Some(Capsule { from_m: from_m.into(), to_m: to_m.into(), radius_m });
            }
            Shape::HalfSpace { normal } => table.half_space = Some(HalfSpace { normal: normal.into() }),
        }
        table
    }
}

impl Scenario {
    /// Checks the shape, the name and the clearance of each obstacle; no start, and no slot at rest, may lie within a
    /// clearance.
    pub(super) fn check_obstacles(&self) -> Result<(), ScenarioError> {
        for (number, obstacle) in self.obstacles.iter().enumerate() {
            check_solid(obstacle, &entry_key("obstacle", number))?;
            if self.obstacles[..number].iter().any(|before| before.name == obstacle.name) {
                let problem = format!("two obstacles have the name `{}`", obstacle.name);
                let help = "give each obstacle its own name";
                return Err(ErrorKind::Name.at(&[&entry_key("obstacle", number)], problem, help));
            }
            self.check_hulls_beside(number, obstacle)?;
        }
        if let Some((_, vehicle, number)) = self.too_near(&self.start.positions_m, 0.0) {
            let key = entry_key("start.positions_m", vehicle);
            let point_m = row(&self.start.positions_m, vehicle);
            return Err(self.refuse(&key, point_m, number, &format!("vehicle {} starts", vehicle + 1)));
        }
        self.check_slots_beside_obstacles()
    }

    fn check_slots_beside_obstacles(&self) -> Result<(), ScenarioError> {
        let Some(guidance) = self.reference.as_ref().filter(|guidance| guidance.motion.is_at_rest()) else {
            return Ok(());
        };
        let place_m = guidance.motion.at(0.0).position_m;
        for (leg, of_leg) in self.legs.iter().enumerate() {
            let mut slots_m = of_leg.formation.slots_m.clone();
            (0..slots_m.nrows()).for_each(|i| {
                let slot_m = row(&slots_m, i) + place_m;
                set_row(&mut slots_m, i, slot_m);
            });
            if let Some((_, vehicle, number)) = self.too_near(&slots_m, SLOT_MARGIN * self.delta_m) {
                let of_leg = if leg == 0 { String::new() } else { format!(" of leg {}", leg + 1) };
                let key = entry_key(&leg_key(leg, "points_m"), vehicle);
                let subject = format!("the slot of vehicle {}{of_leg} is", vehicle + 1);
                return Err(self.refuse(&key, row(&slots_m, vehicle), number, &subject));
            }
        }
        Ok(())
    }

    /// Returns the vehicle with the smallest margin to a clearance and the obstacle, if the margin is at most
    /// `margin_m` \[m\].
    fn too_near(&self, positions_m: &Rows, margin_m: f64) -> Option<(f64, usize, usize)> {
        smallest_clearance_margin(&self.obstacles, positions_m)
            .filter(|&(clearance_margin_m, ..)| clearance_margin_m <= margin_m)
    }

    /// Returns an error about a point at a key within the clearance of an obstacle.
    fn refuse(&self, key: &str, point_m: Vector3<f64>, number: usize, subject: &str) -> ScenarioError {
        let Obstacle { name, clearance_m, shape, place_m } = &self.obstacles[number];
        let (distance_m, _) = signed_distance_m(shape, point_m - place_m);
        let said = if distance_m <= 0.0 {
            format!("{subject} inside obstacle `{name}`")
        } else {
            let distance = beside_limit(distance_m, *clearance_m, 3);
            format!("{subject} {distance} m from obstacle `{name}`, not more than its clearance of {clearance_m} m")
        };
        let help = "move one of them away, or reduce the clearance_m of the obstacle";
        ErrorKind::NearObstacle.at(&[key, &entry_key("obstacle", number)], said, help)
    }

    fn check_hulls_beside(&self, number: usize, obstacle: &Obstacle) -> Result<(), ScenarioError> {
        let widest = self.hull_radius_m.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1));
        let Some((vehicle, &radius_m)) = widest else { return Ok(()) };
        if radius_m + CONTACT_PREDICTION_M <= obstacle.clearance_m {
            return Ok(());
        }
        let problem = format!(
            "the hull of vehicle {} touches obstacle `{}` at {radius_m} m, less than {CONTACT_PREDICTION_M} m before \
             its clearance of {} m",
            vehicle + 1,
            obstacle.name,
            obstacle.clearance_m
        );
        let help = "enlarge the clearance_m of the obstacle, or reduce swarm.hull_radius_m";
        let keys = [&*entry_key("obstacle", number), &entry_key("swarm.hull_radius_m", vehicle)];
        Err(ErrorKind::HullsTouch.at(&keys, problem, help))
    }
}

/// Refuses an empty name, a name that is a number (as of a vehicle), and a normal of length 0.
fn check_solid(obstacle: &Obstacle, key: &str) -> Result<(), ScenarioError> {
    let Obstacle { name, shape, .. } = obstacle;
    if name.trim().is_empty() {
        return Err(ErrorKind::Name.at(&[key], "the name of an obstacle is empty", "name the obstacle"));
    }
    if name.trim().parse::<u64>().is_ok() {
        let problem = format!("the name of an obstacle must not be a number, got `{name}`");
        return Err(ErrorKind::Name.at(&[key], problem, "add a letter: numbers are names of vehicles"));
    }
    match shape {
        Shape::HalfSpace { normal } if normal.norm() < SMALLEST => {
            let problem = format!("the normal of obstacle `{name}` has the length {}", normal.norm());
            let help = "give the direction that points out of the half-space, such as [0, 0, 1]";
            Err(ErrorKind::OutOfRange.at(&[key], problem, help))
        }
        _ => Ok(()),
    }
}
