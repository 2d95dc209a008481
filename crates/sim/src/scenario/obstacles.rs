//! `[[obstacle]]`: a solid that is in the way, in a scenario and in a file of obstacles.
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

use super::error::ScenarioError;
use super::limits::{CONTACT_PREDICTION_M, SLOT_MARGIN, SMALLEST};
use super::spec::Scenario;
use tautline_core::swarm::{Rows, row, set_row};
use tautline_laws::space::{Obstacle, Shape, least_room};

/// What an obstacle is made of, for messages.
pub const OBSTACLE_HELP: &str = "an obstacle has a name, one of ball, box, capsule and half_space, and a place \
                                        at_m = [x, y, z] or, in a file for an audit, a path = [[t, x, y, z], ...]";

/// A solid that is in the way: a name, one shape and where it is.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ObstacleTable {
    /// What it is called.
    pub name: String,
    /// A ball around its place.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Ball")]
    ball: Option<Ball>,
    /// A box around its place, upright.
    #[serde(rename = "box", default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Cuboid")]
    cuboid: Option<Cuboid>,
    /// Everything within a radius of a straight line.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Capsule")]
    capsule: Option<Capsule>,
    /// Everything behind a plane through its place.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "HalfSpace")]
    half_space: Option<HalfSpace>,
    /// Its place in m; the origin for a capsule or a half-space unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    at_m: Option<[f64; 3]>,
    /// Path of an obstacle that moves, a row `[t, x, y, z]` for each instant: for `tautline audit --obstacles` alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    path: Option<Vec<[f64; 4]>>,
    /// Distance in m that the centre of a vehicle must keep from its surface; unless given, half of `law.delta_m`, or 0.02
    /// m more than the radius of the largest hull where that is more.
    #[serde(skip_serializing_if = "Option::is_none")]
    clearance_m: Option<f64>,
}

/// A ball.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Ball {
    /// Its radius in m.
    #[schemars(extend("exclusiveMinimum" = 0))]
    radius_m: f64,
}

/// An upright box.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Cuboid {
    /// Its lengths along x, y and z in m, before it is turned.
    size_m: [f64; 3],
    /// How far it is turned about the vertical in degrees, counterclockwise seen from above.
    #[serde(default)]
    yaw_deg: f64,
}

/// A line with a radius.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[expect(clippy::struct_field_names, reason = "each is in metres")]
struct Capsule {
    /// One end of the line, from its place, in m.
    from_m: [f64; 3],
    /// The other end in m.
    to_m: [f64; 3],
    /// The radius in m.
    #[schemars(extend("exclusiveMinimum" = 0))]
    radius_m: f64,
}

/// What lies behind a plane.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct HalfSpace {
    /// Points out of it; of any length but zero.
    normal: [f64; 3],
}

/// What an `[[obstacle]]` table means.
pub struct Solid {
    /// Its shape, around its place.
    pub shape: Shape,
    /// Times \[s\] and places \[m\]; one entry where it stands still.
    pub path: Vec<(f64, Vector3<f64>)>,
    /// Distance \[m\] that the centre of a vehicle must keep from its surface, if given.
    pub clearance_m: Option<f64>,
}

impl ObstacleTable {
    /// The solid that it describes.
    ///
    /// # Errors
    /// What is wrong with the table, in one sentence.
    pub fn solid(self) -> Result<Solid, String> {
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
            return Err(format!("obstacle `{name}` needs one shape and no more"));
        };
        let path = match (at_m, path) {
            (Some(at_m), None) => vec![(0.0, at_m.into())],
            (None, Some(path)) => path.into_iter().map(|[t, x, y, z]| (t, Vector3::new(x, y, z))).collect(),
            (None, None) if in_space => vec![(0.0, Vector3::zeros())],
            (None, None) => return Err(format!("obstacle `{name}` has no place")),
            (Some(_), Some(_)) => return Err(format!("obstacle `{name}` has a place and a path")),
        };
        Ok(Solid { shape, path, clearance_m })
    }

    /// The obstacle at rest that it means, with a clearance \[m\] where it has none.
    pub(super) fn obstacle(&self, number: usize, clearance_m: f64) -> Result<Obstacle, ScenarioError> {
        let wrong = |said: String| ScenarioError::new(said).coded("scenario/obstacle").at_entry("obstacle", number);
        let Solid { shape, path, clearance_m: own_m } =
            self.clone().solid().map_err(|said| wrong(said).with_help(OBSTACLE_HELP))?;
        let [(_, place_m)] = path[..] else {
            return Err(wrong(format!("obstacle `{}` moves", self.name)).with_help(
                "the obstacles of a flight stand: give at_m = [x, y, z]; `tautline audit --obstacles` judges ones that move",
            ));
        };
        Ok(Obstacle { name: self.name.clone(), place_m, shape, clearance_m: own_m.unwrap_or(clearance_m) })
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
    /// Solids with a size, a place and a clearance that holds a vehicle's hull; no start within a clearance, and no slot where
    /// slots are places that stay.
    pub(super) fn check_obstacles(&self) -> Result<(), ScenarioError> {
        for (number, obstacle) in self.obstacles.iter().enumerate() {
            check_solid(obstacle).map_err(|error| error.at_entry("obstacle", number))?;
            if self.obstacles[..number].iter().any(|before| before.name == obstacle.name) {
                return Err(ScenarioError::new(format!("two obstacles are named `{}`", obstacle.name))
                    .coded("scenario/name")
                    .with_help("give each a name of its own")
                    .at_entry("obstacle", number));
            }
            self.check_hulls_beside(number, obstacle)?;
        }
        if let Some((_, vehicle, number)) = self.too_near(&self.start.positions_m, 0.0) {
            return Err(self
                .refuse(row(&self.start.positions_m, vehicle), number, format_args!("vehicle {} starts", vehicle + 1))
                .at_entry("start.positions_m", vehicle)
                .at_entry("obstacle", number));
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
                let of = if leg == 0 { String::new() } else { format!(" of leg {}", leg + 1) };
                return Err(self
                    .refuse(row(&slots_m, vehicle), number, format_args!("the slot of vehicle {}{of} is", vehicle + 1))
                    .at_leg_entry(leg, "formation.points_m", vehicle)
                    .at_entry("obstacle", number));
            }
        }
        Ok(())
    }

    /// Who of these has the least room, and which obstacle leaves no more of it than that \[m\].
    fn too_near(&self, positions_m: &Rows, margin_m: f64) -> Option<(f64, usize, usize)> {
        least_room(&self.obstacles, positions_m).filter(|&(room_m, ..)| room_m <= margin_m)
    }

    fn refuse(&self, point_m: Vector3<f64>, number: usize, who: std::fmt::Arguments<'_>) -> ScenarioError {
        let Obstacle { name, clearance_m, shape, place_m } = &self.obstacles[number];
        let (distance_m, _) = shape.signed_distance_m(point_m - place_m);
        let said = if distance_m <= 0.0 {
            format!("{who} inside obstacle `{name}`")
        } else {
            format!("{who} {distance_m} m from obstacle `{name}`, not more than its clearance of {clearance_m} m")
        };
        ScenarioError::new(said)
            .coded("scenario/near-obstacle")
            .with_help("move one of them away, or reduce the clearance_m of the obstacle")
    }

    fn check_hulls_beside(&self, number: usize, obstacle: &Obstacle) -> Result<(), ScenarioError> {
        let widest = self.hull_radius_m.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1));
        let Some((vehicle, &radius_m)) = widest else { return Ok(()) };
        if radius_m + CONTACT_PREDICTION_M <= obstacle.clearance_m {
            return Ok(());
        }
        Err(ScenarioError::new(format!(
            "the hull of vehicle {} touches obstacle `{}` at {radius_m} m, not {CONTACT_PREDICTION_M} m before its \
             clearance of {} m",
            vehicle + 1,
            obstacle.name,
            obstacle.clearance_m
        ))
        .coded("scenario/hulls-touch")
        .with_help("enlarge the clearance_m of the obstacle, or reduce swarm.hull_radius_m")
        .at_entry("obstacle", number)
        .at_entry("swarm.hull_radius_m", vehicle))
    }
}

/// A solid with a name that is no vehicle's, and a normal with a direction.
fn check_solid(obstacle: &Obstacle) -> Result<(), ScenarioError> {
    let Obstacle { name, shape, .. } = obstacle;
    if name.trim().is_empty() {
        return Err(ScenarioError::new("the name of an obstacle is empty")
            .coded("scenario/name")
            .with_help("give it one"));
    }
    if name.trim().parse::<u64>().is_ok() {
        return Err(ScenarioError::new(format!("an obstacle is named `{name}`, as a vehicle is"))
            .coded("scenario/name")
            .with_help("give it a name that is no number"));
    }
    match shape {
        Shape::HalfSpace { normal } if normal.norm() < SMALLEST => {
            Err(ScenarioError::new(format!("the normal of obstacle `{name}` has the length {}", normal.norm()))
                .coded("scenario/out-of-range")
                .with_help("give the direction that points out of the half-space, such as [0, 0, 1]"))
        }
        _ => Ok(()),
    }
}
