//! Scenario file: its keys, units and defaults.
//!
//! `text` reads a document, `build` makes a scenario of it, and `resolved` converts a scenario back. A table whose keys
//! depend on a choice (`shape`, `kind`) is an enum inside a struct that holds the common keys. Doc comments of the keys
//! become the schema, the reference in docs/scenario.md and parts of error messages.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::graph::GraphTable;
use super::obstacles::ObstacleTable;
use super::reference::ReferenceTable;
use super::spec::{DEFAULT_HULL_RADIUS_M, DEFAULT_MASS_KG, PlantSpec, Safety};
use super::template::Laws;
use super::time::TimeSpec;
use super::vehicle::VehicleTable;
use crate::link::{ActuationSpec, Failure, NetworkSpec, SensingSpec};
use crate::shield::ShieldSpec;
use tautline_core::swarm::{Rows, set_row};
use tautline_laws::formation::Ink;
use tautline_laws::law::LawSpec;
use tautline_laws::target::{Arrival, DeadlockOptions, LegTrigger};
use tautline_laws::wind::WindSpec;

/// Scenario: a swarm, its start, its formations and its control law. All numbers are in SI units, named at the end of
/// the key. Vehicles and entries of lists are counted from 1.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[schemars(title = "tautline scenario")]
#[serde(deny_unknown_fields)]
pub(super) struct Document {
    /// Name of the scenario and of the folder of its runs: letters, digits, `-` and `_`. The name of the file unless
    /// given.
    #[schemars(length(min = 1, max = 64), pattern("^[A-Za-z0-9_-]+$"))]
    pub(super) name: Option<String>,
    /// Number and properties of the vehicles.
    #[serde(default)]
    pub(super) swarm: SwarmTable,
    /// Model of the vehicles: points unless given.
    #[serde(default, skip_serializing_if = "is_default")]
    pub(super) vehicle: VehicleTable,
    /// Wind: none unless given.
    #[serde(default, skip_serializing_if = "is_default")]
    pub(super) wind: WindSpec,
    /// Space around each vehicle that must stay empty: a ball unless given.
    #[serde(default, skip_serializing_if = "is_default")]
    pub(super) safety: SafetyTable,
    /// Positions and velocities at the start.
    pub(super) start: StartTable,
    /// Slots of the first formation.
    pub(super) formation: FormationTable,
    /// Later formations, in their order.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) leg: Vec<LegTable>,
    /// Obstacles at rest.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) obstacle: Vec<ObstacleTable>,
    /// Motion of the reference, which carries the formations. With it, slots are absolute positions relative to the
    /// reference.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "ReferenceTable")]
    pub(super) reference: Option<ReferenceTable>,
    /// The control law.
    pub(super) law: LawTable,
    /// Laws that `tautline compare` flies by name. `[laws.NAME]` holds the keys of a law; without a `kind`, NAME is the
    /// kind.
    #[serde(default, skip_serializing_if = "Laws::is_empty")]
    pub(super) laws: Laws,
    /// Pairs of vehicles that sense each other: all pairs unless given.
    #[serde(default)]
    pub(super) graph: GraphTable,
    /// Equations of motion that are solved.
    #[serde(default)]
    pub(super) plant: PlantTable,
    /// Duration and rates.
    pub(super) time: TimeSpec,
    /// Criteria of a reached formation.
    #[serde(default)]
    pub(super) arrival: Arrival,
    /// Deadlock recovery: a stalled swarm spreads its slots for some time, so that vehicles that block each other can
    /// pass. Only under the displacement law.
    #[serde(default, skip_serializing_if = "is_default")]
    pub(super) deadlock: DeadlockOptions,
    /// Measurements by the vehicles of themselves and of near vehicles.
    #[serde(default, skip_serializing_if = "is_default")]
    pub(super) sensing: SensingSpec,
    /// Messages between the vehicles.
    #[serde(default, skip_serializing_if = "is_default")]
    pub(super) network: NetworkSpec,
    /// Conversion of commands into accelerations.
    #[serde(default, skip_serializing_if = "is_default")]
    pub(super) actuation: ActuationSpec,
    /// Stage between law and vehicles that certifies separations under any law: none unless the table exists.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "ShieldSpec")]
    pub(super) shield: Option<ShieldSpec>,
    /// Vehicles with a failed part.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) failure: Vec<Failure>,
    /// Seed of the random numbers in flight.
    #[serde(default, skip_serializing_if = "is_default")]
    pub(super) noise: NoiseTable,
    #[serde(skip)]
    pub(super) given: TimeKeys,
}

/// Keys of `[time]` that the file gives; the others depend on other tables.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct TimeKeys {
    pub(super) dt_s: bool,
    pub(super) record_hz: bool,
    pub(super) max_halvings: bool,
}

impl Document {
    /// Returns the velocity coefficient a22 less the drag of the air \[1/s\].
    pub(super) fn velocity_coefficient_per_s(&self) -> f64 {
        self.a22_per_s() - self.vehicle.drag_per_s
    }
}

/// Number and properties of the vehicles.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(super) struct SwarmTable {
    /// Number of vehicles N. Required if neither the start nor the formation lists points; otherwise it must match
    /// them.
    #[schemars(range(min = 2))]
    pub(super) count: Option<u64>,
    /// Number of dimensions: 2 restricts the swarm to the plane z = 0, 3 allows all axes. Unless given, 2 if every
    /// position, velocity and slot has z = 0, otherwise 3.
    #[schemars(range(min = 2, max = 3))]
    pub(super) dimensions: Option<u64>,
    /// Mass of points in kg, for all vehicles or for each. Laws command accelerations, so the mass matters only if
    /// hulls touch. The ideal plant ignores it.
    pub(super) mass_kg: PerVehicle,
    /// Radius of the solid hull of points in m, for all vehicles or for each. Two hulls must fit within `law.delta_m`,
    /// so hulls touch only after a violation. The ideal plant ignores it.
    pub(super) hull_radius_m: PerVehicle,
    /// Velocity coefficient a22 of points in p'' = a22 v + u, in 1/s. Negative is drag relative to the ground, positive
    /// adds energy. `vehicle.drag_per_s` is drag relative to the air.
    pub(super) a22_per_s: f64,
}

/// Positions and velocities at the start: `positions_m`, or a `shape` with its keys.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct StartTable {
    /// Position of each vehicle in m.
    pub(super) positions_m: Option<Vec<Point>>,
    /// Velocity of each vehicle in m/s; 0 unless given.
    pub(super) velocities_m_s: Option<Vec<Point>>,
    /// Largest random offset along each axis in m, uniform, added to every position; along z only in three dimensions.
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(extend("minimum" = 0, "default" = 0.0))]
    pub(super) jitter_m: f64,
    /// Seed of the random numbers of the start (`ChaCha8`, the same on every machine).
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(extend("default" = 0))]
    pub(super) seed: u64,
    /// Whether the vehicles take the positions in a random order, drawn with `seed`.
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(extend("default" = false))]
    pub(super) shuffle: bool,
    #[schemars(flatten)]
    pub(super) shape: Option<StartShape>,
}

/// A start without a list of positions.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[schemars(tag = "shape")]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(super) enum StartShape {
    /// Vehicles 1, 2, ... along the x axis.
    Line(DistanceKeys),
    /// A near-square grid in the plane z = 0, row by row.
    Grid(DistanceKeys),
    /// A circle in the plane z = 0.
    Circle(RadiusKeys),
    /// Points distributed evenly over a sphere.
    Sphere(RadiusKeys),
    /// Uniformly random positions in a square, or in a cube in three dimensions, with a smallest separation.
    Random {
        /// Half the side of the square or cube around the origin in m.
        #[schemars(extend("exclusiveMinimum" = 0))]
        half_extent_m: f64,
        /// Smallest separation in m, more than `law.delta_m`; 1.5 times `law.delta_m` unless given.
        #[schemars(extend("exclusiveMinimum" = 0))]
        min_separation_m: Option<f64>,
    },
}

/// Slots of the first formation. Laws that control distances reach them up to rotation, reflection and translation.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct FormationTable {
    #[serde(flatten)]
    pub(super) placement: Placement,
    #[schemars(flatten)]
    pub(super) shape: FormationShape,
}

/// Later formation: a `shape`, or the slots of the previous formation with a new placement.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct LegTable {
    /// Time in s at which the leg begins, but not before the previous leg begins; or `"reached"`: once the previous
    /// formation is reached. `"reached"` unless given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "LegStart")]
    pub(super) start_s: Option<LegStart>,
    #[serde(flatten)]
    pub(super) placement: Placement,
    #[schemars(flatten)]
    pub(super) shape: Option<FormationShape>,
}

/// Placement of the slots, and assignment of vehicles to slots.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(default)]
pub(super) struct Placement {
    /// Assignment of vehicles to slots; for a leg, from the slots of the previous leg.
    #[serde(skip_serializing_if = "is_default")]
    #[schemars(extend("default" = "given"))]
    pub(super) assignment: Assignment,
    /// Scale of the slots about their centre.
    #[serde(skip_serializing_if = "is_unscaled")]
    #[schemars(extend("exclusiveMinimum" = 0, "default" = 1.0))]
    pub(super) scale: f64,
    /// Rotation of the scaled slots about their centre in degrees, counterclockwise seen from above.
    #[serde(skip_serializing_if = "is_default")]
    #[schemars(extend("default" = 0.0))]
    pub(super) yaw_deg: f64,
    /// Translation of the rotated slots in m.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Point")]
    pub(super) move_m: Option<Point>,
}

impl Default for Placement {
    fn default() -> Self {
        Self { assignment: Assignment::Given, scale: 1.0, yaw_deg: 0.0, move_m: None }
    }
}

/// Assignment of vehicles to slots.
#[derive(Clone, Copy, Debug, Default, Deserialize, Eq, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Assignment {
    /// Each vehicle flies to the slot with its number.
    #[default]
    Given,
    /// The assignment with the least sum of squared distances, over the rigid motions that the law leaves free or
    /// around a leader, which keeps its slot. A stalled swarm is reassigned. At most 5000 vehicles, or 500 under a law
    /// that controls distances.
    Optimal,
    /// Each vehicle flies to the slot with its number until the swarm is stalled, which reassigns the slots. Only under
    /// the displacement law.
    WhenStalled,
}

/// Shape of a formation and its size.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[schemars(tag = "shape")]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(super) enum FormationShape {
    /// Five slots: the corners of a house of side d, (0,0) (d,0) (d/2, sqrt3 d/2) (0, sqrt3 d) (d, sqrt3 d).
    Pentagon {
        /// Side d in m.
        #[schemars(extend("exclusiveMinimum" = 0))]
        side_m: f64,
    },
    /// Slots at equal angles on a circle in the plane z = 0.
    Circle(RadiusKeys),
    /// Slots along the x axis.
    Line(DistanceKeys),
    /// A near-square grid in the plane z = 0, row by row.
    Grid(DistanceKeys),
    /// Points distributed evenly over a sphere.
    Sphere(RadiusKeys),
    /// Two arms that meet at the first slot, in the plane z = 0.
    V(VKeys),
    /// A filled triangle in the plane z = 0: rows of 1, 2, 3, ... slots.
    Wedge(SpacingKeys),
    /// Concentric circles in the plane z = 0: 1, 6, 12, 18, ... slots.
    Rings(SpacingKeys),
    /// A helix about the z axis.
    Helix(HelixKeys),
    /// A cubic grid, as close to a cube as the number of slots allows.
    Cube(SpacingKeys),
    /// Letters in the plane z = 0.
    Text(TextKeys),
    /// An SVG drawing in the plane z = 0.
    Svg(SvgKeys),
    /// The dark or opaque part of a picture, in the plane z = 0.
    Image(ImageKeys),
    /// Slots listed in a file.
    File(FileKeys),
    /// Slots listed in the scenario.
    Points {
        /// Slot of each vehicle in m.
        points_m: Vec<Point>,
    },
}

/// The control law and the safety distance.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct LawTable {
    #[schemars(flatten)]
    pub(super) kind: LawSpec,
    /// Safety distance delta in m; the audit of every flight uses it. Required unless `[safety]` gives an ellipsoid.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub(super) delta_m: Option<f64>,
}

/// Equations of motion that are solved.
#[derive(Clone, Debug, Default, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(super) struct PlantTable {
    /// Plant that moves the vehicles.
    pub(super) kind: PlantSpec,
}

/// Space around each vehicle that must stay empty.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct SafetyTable {
    #[schemars(flatten)]
    pub(super) shape: Safety,
}

/// Random numbers in flight: wind, sensors, radio.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(super) struct NoiseTable {
    /// Seed of the random numbers in flight (`ChaCha8`, the same on every machine). `start.seed` is separate.
    pub(super) seed: u64,
}

impl Document {
    /// Returns the velocity coefficient a22 \[1/s\] that laws use; 0 for vehicles that are not points.
    pub(super) fn a22_per_s(&self) -> f64 {
        if self.vehicle.is_point() { self.swarm.a22_per_s } else { 0.0 }
    }
}

impl Default for SwarmTable {
    fn default() -> Self {
        Self {
            count: None,
            dimensions: None,
            mass_kg: PerVehicle::All(DEFAULT_MASS_KG),
            hull_radius_m: PerVehicle::All(DEFAULT_HULL_RADIUS_M),
            a22_per_s: 0.0,
        }
    }
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks for a reference")]
fn is_unscaled(scale: &f64) -> bool {
    *scale == 1.0
}

/// Returns whether a key has its default, which is not written.
pub(crate) fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// Keys of `shape = "v"`.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct VKeys {
    /// Distance between neighbours on an arm in m, and smallest distance of slots; 1.5 times `law.delta_m` unless
    /// given.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub(super) spacing_m: Option<f64>,
    /// Angle between the arms in degrees, from 60 to 180.
    #[serde(default = "right_angle_deg")]
    #[schemars(range(min = 60, max = 180))]
    pub(super) angle_deg: f64,
}

fn right_angle_deg() -> f64 {
    90.0
}

/// Keys of a shape with a distance between neighbours.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct DistanceKeys {
    /// Distance between neighbours in m.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub(super) spacing_m: f64,
}

/// Keys of a shape with a radius.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct RadiusKeys {
    /// Radius in m.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub(super) radius_m: f64,
}

/// Keys of a shape that has only a spacing.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct SpacingKeys {
    /// Smallest distance of slots in m; 1.5 times `law.delta_m` unless given.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub(super) spacing_m: Option<f64>,
}

/// Keys of `shape = "helix"`.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct HelixKeys {
    /// Radius in m.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub(super) radius_m: f64,
    /// Rise per full turn in m.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub(super) pitch_m: f64,
    /// Distance between neighbours in m, and smallest distance of slots; 1.5 times `law.delta_m` unless this or `turns`
    /// is given.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub(super) spacing_m: Option<f64>,
    /// Number of turns from the first slot to the last, instead of `spacing_m`.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub(super) turns: Option<f64>,
}

/// Size of a drawing: at most one of these keys.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[expect(clippy::struct_field_names, reason = "each is in metres")]
pub(super) struct DrawingSize {
    /// Height of the drawing in m.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub(super) height_m: Option<f64>,
    /// Width of the drawing in m, instead of `height_m`.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub(super) width_m: Option<f64>,
    /// Smallest distance of slots in m; 1.5 times `law.delta_m` unless this, the height or the width is given.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub(super) spacing_m: Option<f64>,
}

/// Keys of `shape = "text"`.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct TextKeys {
    /// Text to draw; a line break starts a new line below.
    #[schemars(length(min = 1, max = 1000))]
    pub(super) text: String,
    #[serde(flatten)]
    pub(super) size: DrawingSize,
}

/// Keys of `shape = "svg"`.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct SvgKeys {
    /// Path data, as in the attribute `d` of SVG.
    pub(super) path: Option<String>,
    /// SVG file instead of `path`, relative to the folder of the scenario file.
    pub(super) file: Option<PathBuf>,
    /// Whether slots fill the areas inside the lines instead of lying on the lines.
    #[serde(default)]
    pub(super) filled: bool,
    #[serde(flatten)]
    pub(super) size: DrawingSize,
}

/// Keys of `shape = "image"`.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct ImageKeys {
    /// PNG picture, relative to the folder of the scenario file.
    pub(super) file: PathBuf,
    /// Pixels that belong to the drawing. Unless given, the opaque pixels of a picture with transparent ones, otherwise
    /// the dark pixels.
    #[serde(default)]
    #[schemars(with = "Ink")]
    pub(super) ink: Option<Ink>,
    #[serde(flatten)]
    pub(super) size: DrawingSize,
}

/// Keys of `shape = "file"`.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct FileKeys {
    /// Text file with one line per slot: x, y and optionally z in m, separated by commas, semicolons, tabs or blanks. A
    /// first line may name the columns. Relative to the folder of the scenario file.
    pub(super) file: PathBuf,
}

/// One number for all vehicles or a list with one for each.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(untagged)]
pub(super) enum PerVehicle {
    /// One value for all vehicles.
    All(#[schemars(extend("exclusiveMinimum" = 0))] f64),
    /// One value for each vehicle.
    Each(#[schemars(extend("items" = { "type": "number", "exclusiveMinimum": 0 }))] Vec<f64>),
}

/// A point: x, y and optionally z.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[schemars(with = "Vec<f64>", extend("minItems" = 2, "maxItems" = 3))]
#[serde(untagged)]
pub(super) enum Point {
    /// A point in the plane z = 0.
    Plane([f64; 2]),
    /// A point in space.
    Space([f64; 3]),
}

/// Two vehicles, counted from 1.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(transparent)]
pub(super) struct Edge(#[schemars(inner(range(min = 1)))] pub(super) [u64; 2]);

impl Point {
    /// Returns x, y and z.
    pub(super) fn coordinates(self) -> [f64; 3] {
        match self {
            Self::Plane([x, y]) => [x, y, 0.0],
            Self::Space(coordinates) => coordinates,
        }
    }
}

/// A list of vehicles, counted from 1, or all vehicles.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(untagged)]
pub(super) enum Vehicles {
    /// All vehicles.
    All(All),
    /// The listed vehicles.
    Listed(#[schemars(inner(range(min = 1)))] Vec<u64>),
}

/// The word `all`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub(super) enum All {
    /// All vehicles.
    All,
}

/// Start of a leg.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(untagged)]
pub(super) enum LegStart {
    /// Once the previous formation is reached.
    When(Reached),
    /// A time in s.
    At(f64),
}

/// The word `reached`.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Reached {
    /// Once the previous formation is reached.
    Reached,
}

impl LegStart {
    pub(super) fn begins(self) -> LegTrigger {
        match self {
            Self::When(Reached::Reached) => LegTrigger::Reached,
            Self::At(start_s) => LegTrigger::At(start_s),
        }
    }
}

/// Returns a matrix with a row for each point.
pub(super) fn rows(points: &[Point]) -> Rows {
    let mut rows = Rows::zeros(points.len());
    for (i, point) in points.iter().enumerate() {
        set_row(&mut rows, i, point.coordinates().into());
    }
    rows
}
