//! The scenario file: its keys, units and defaults.
//!
//! Read by `text`, made into a flight by `build`; `resolved` makes it back from a flight and writes it. A table
//! whose keys depend on a choice (`shape`, `kind`) is an enum inside a struct that holds the keys common to all choices.

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
use tautline_core::swarm::{Rows, set_row};
use tautline_laws::formation::Ink;
use tautline_laws::law::LawSpec;
use tautline_laws::target::{Arrival, Begins, DeadlockOptions};
use tautline_laws::wind::WindSpec;

/// A flight of a swarm into a formation. Every number is in SI units, named at the end of its key. Vehicles, and the
/// entries of every list, are counted from 1.
#[derive(Debug, Deserialize, Serialize, JsonSchema)]
#[schemars(title = "tautline scenario")]
#[serde(deny_unknown_fields)]
pub(super) struct Document {
    /// Name of the scenario and of the folder of its runs: letters, digits, `-` and `_`. The file's name unless given.
    #[schemars(length(min = 1, max = 64), pattern("^[A-Za-z0-9_-]+$"))]
    pub(super) name: Option<String>,
    /// The vehicles.
    #[serde(default)]
    pub(super) swarm: SwarmTable,
    /// What kind of body they are: points unless given.
    #[serde(default, skip_serializing_if = "is_default")]
    pub(super) vehicle: VehicleTable,
    /// Air that moves.
    #[serde(default, skip_serializing_if = "is_default")]
    pub(super) wind: WindSpec,
    /// What must stay empty around each: a ball unless given.
    #[serde(default, skip_serializing_if = "is_default")]
    pub(super) safety: SafetyTable,
    /// Where they start.
    pub(super) start: StartTable,
    /// The slots that they shall reach.
    pub(super) formation: FormationTable,
    /// The formations after it, in their order.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) leg: Vec<LegTable>,
    /// Solids at rest that are in the way.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) obstacle: Vec<ObstacleTable>,
    /// A motion that the formations are carried along with; slots are places then.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "ReferenceTable")]
    pub(super) reference: Option<ReferenceTable>,
    /// The control law.
    pub(super) law: LawTable,
    /// Laws that `tautline compare` flies by name: `[laws.NAME]` holds the keys of a law, where NAME is its kind or any other
    /// name with a `kind` beside the keys.
    #[serde(default, skip_serializing_if = "Laws::is_empty")]
    pub(super) laws: Laws,
    /// Which vehicles sense each other: all of them unless given.
    #[serde(default)]
    pub(super) graph: GraphTable,
    /// The bodies that carry out the commands.
    #[serde(default)]
    pub(super) plant: PlantTable,
    /// Duration and rates.
    pub(super) time: TimeSpec,
    /// What counts as a reached formation.
    #[serde(default)]
    pub(super) arrival: Arrival,
    /// When slots are spread for a while, so that vehicles that stand in each other's way get past; under the displacement
    /// law.
    #[serde(default, skip_serializing_if = "is_default")]
    pub(super) deadlock: DeadlockOptions,
    /// What vehicles measure of themselves and of whoever is near.
    #[serde(default, skip_serializing_if = "is_default")]
    pub(super) sensing: SensingSpec,
    /// What vehicles hear of each other, and when.
    #[serde(default, skip_serializing_if = "is_default")]
    pub(super) network: NetworkSpec,
    /// How commands become accelerations.
    #[serde(default, skip_serializing_if = "is_default")]
    pub(super) actuation: ActuationSpec,
    /// Vehicles of which a part fails.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) failure: Vec<Failure>,
    /// Chance in flight.
    #[serde(default, skip_serializing_if = "is_default")]
    pub(super) noise: NoiseTable,
    #[serde(skip)]
    pub(super) given: Given,
}

/// Keys of `[time]` that the file gives; the others depend on other tables.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Given {
    pub(super) dt_s: bool,
    pub(super) record_hz: bool,
    pub(super) max_halvings: bool,
}

impl Document {
    /// What a vehicle's own velocity accelerates it by \[1/s\].
    pub(super) fn velocity_coefficient_per_s(&self) -> f64 {
        self.a22_per_s() - self.vehicle.drag_per_s
    }
}

/// The vehicles.
#[derive(Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(super) struct SwarmTable {
    /// Number of vehicles N. Needed where neither the start nor the formation lists points; checked against them
    /// where they do.
    #[schemars(range(min = 2))]
    pub(super) count: Option<u64>,
    /// 2 keeps the swarm in the plane z = 0, 3 lets it use all axes. Without it: 2 when every position, velocity and
    /// slot has z = 0, otherwise 3.
    #[schemars(range(min = 2, max = 3))]
    pub(super) dimensions: Option<u64>,
    /// Mass of points in kg: one number for all vehicles or a list with one for each. Laws command accelerations, so it changes no
    /// motion until hulls touch; the ideal plant's vehicles are points and have no use for it.
    pub(super) mass_kg: PerVehicle,
    /// Radius of the solid hull of points in m, for all vehicles or for each. The hulls of any two vehicles must fit within
    /// `law.delta_m`, so they change no motion until a pair is closer than that; the ideal plant has no hulls.
    pub(super) hull_radius_m: PerVehicle,
    /// Velocity coefficient a22 of points, p'' = a22 v + u, in 1/s: negative is drag against the ground, whatever blows, positive
    /// feeds energy in. Drag in the air is `vehicle.drag_per_s`.
    pub(super) a22_per_s: f64,
}

/// Where the vehicles start: `positions_m`, or a `shape` with its parameters.
#[derive(Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct StartTable {
    /// Position of each vehicle in m.
    pub(super) positions_m: Option<Vec<Point>>,
    /// Velocity of each vehicle in m/s; at rest unless given.
    pub(super) velocities_m_s: Option<Vec<Point>>,
    /// Largest random offset along each axis in m, uniform, added to every position. Along z only in three
    /// dimensions.
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(extend("minimum" = 0, "default" = 0.0))]
    pub(super) jitter_m: f64,
    /// Seed of the random numbers (`ChaCha8`, the same on every machine).
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(extend("default" = 0))]
    pub(super) seed: u64,
    /// Whether vehicles take the start's places in an order that is drawn by `seed`.
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(extend("default" = false))]
    pub(super) shuffle: bool,
    #[schemars(flatten)]
    pub(super) shape: Option<StartShape>,
}

/// A start without a list of positions.
#[derive(Debug, Deserialize, Serialize, JsonSchema)]
#[schemars(tag = "shape")]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(super) enum StartShape {
    /// Vehicles 1, 2, ... along x.
    Line {
        /// Distance between neighbours in m.
        #[schemars(extend("exclusiveMinimum" = 0))]
        spacing_m: f64,
    },
    /// A near-square grid in the plane z = 0, row by row.
    Grid {
        /// Distance between neighbours in m.
        #[schemars(extend("exclusiveMinimum" = 0))]
        spacing_m: f64,
    },
    /// A circle in the plane z = 0.
    Circle {
        /// Radius in m.
        #[schemars(extend("exclusiveMinimum" = 0))]
        radius_m: f64,
    },
    /// Points spread evenly over a sphere.
    Sphere {
        /// Radius in m.
        #[schemars(extend("exclusiveMinimum" = 0))]
        radius_m: f64,
    },
    /// Uniformly random positions in a square, or in a cube in three dimensions, that keep a distance.
    Random {
        /// Half the side of the square or cube around the origin in m.
        #[schemars(extend("exclusiveMinimum" = 0))]
        half_extent_m: f64,
        /// Smallest distance between two vehicles in m: more than `law.delta_m`, and 1.5 times that unless given.
        #[schemars(extend("exclusiveMinimum" = 0))]
        min_separation_m: Option<f64>,
    },
}

/// The slots of the formation. Laws that control distances reach it up to rotation, reflection and translation.
#[derive(Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct FormationTable {
    #[serde(flatten)]
    pub(super) placement: Placement,
    #[schemars(flatten)]
    pub(super) shape: FormationShape,
}

/// A formation after the first: a `shape`, or the one before it, placed anew.
#[derive(Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct LegTable {
    /// Time at which it begins in s, or when the one before it begins if that is later; `"reached"`, once that one is reached,
    /// unless given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "LegStart")]
    pub(super) start_s: Option<LegStart>,
    #[serde(flatten)]
    pub(super) placement: Placement,
    #[schemars(flatten)]
    pub(super) shape: Option<FormationShape>,
}

/// Where the slots of a formation are, and which vehicle flies to which slot.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(default)]
pub(super) struct Placement {
    /// Which vehicle flies to which slot; for a leg, from the slots before.
    #[serde(skip_serializing_if = "is_default")]
    #[schemars(extend("default" = "given"))]
    pub(super) assignment: Assignment,
    /// Scale of the slots about their centre.
    #[serde(skip_serializing_if = "is_unscaled")]
    #[schemars(extend("exclusiveMinimum" = 0, "default" = 1.0))]
    pub(super) scale: f64,
    /// Turn of the scaled slots about their centre in degrees, counterclockwise seen from above.
    #[serde(skip_serializing_if = "is_default")]
    #[schemars(extend("default" = 0.0))]
    pub(super) yaw_deg: f64,
    /// Translation of the turned slots in m.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Point")]
    pub(super) move_m: Option<Point>,
}

impl Default for Placement {
    fn default() -> Self {
        Self { assignment: Assignment::Given, scale: 1.0, yaw_deg: 0.0, move_m: None }
    }
}

/// Who flies to which slot.
#[derive(Clone, Copy, Debug, Default, Deserialize, Eq, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Assignment {
    /// Each vehicle to the slot of its number.
    #[default]
    Given,
    /// Vehicles are interchangeable: the sum of squared ways is least, once the formation is moved as the law leaves it free, or
    /// around a leader, who keeps its slot; and so again where the swarm is stalled. For up to 5000 vehicles, and 500 under a law
    /// that holds distances.
    Optimal,
    /// Vehicles are interchangeable where the swarm is stalled; up to then each goes to the slot of its number. Under the
    /// displacement law.
    WhenStalled,
}

/// A formation and its size.
#[derive(Debug, Deserialize, Serialize, JsonSchema)]
#[schemars(tag = "shape")]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(super) enum FormationShape {
    /// Five slots: the corners of a house of side d, (0,0) (d,0) (d/2, sqrt3 d/2) (0, sqrt3 d) (d, sqrt3 d).
    Pentagon {
        /// Side d in m.
        #[schemars(extend("exclusiveMinimum" = 0))]
        side_m: f64,
    },
    /// Equal angles on a circle in the plane z = 0.
    Circle {
        /// Radius in m.
        #[schemars(extend("exclusiveMinimum" = 0))]
        radius_m: f64,
    },
    /// Along x.
    Line {
        /// Distance between neighbours in m.
        #[schemars(extend("exclusiveMinimum" = 0))]
        spacing_m: f64,
    },
    /// A near-square grid in the plane z = 0, row by row.
    Grid {
        /// Distance between neighbours in m.
        #[schemars(extend("exclusiveMinimum" = 0))]
        spacing_m: f64,
    },
    /// Points spread evenly over a sphere.
    Sphere {
        /// Radius in m.
        #[schemars(extend("exclusiveMinimum" = 0))]
        radius_m: f64,
    },
    /// Two arms that meet at the first slot, in the plane z = 0.
    V(VKeys),
    /// A filled triangle in the plane z = 0: rows of 1, 2, 3, ... slots.
    Wedge(SpacingKeys),
    /// Circles in the plane z = 0: 1, 6, 12, 18, ... slots.
    Rings(SpacingKeys),
    /// A screw about the z axis.
    Helix(HelixKeys),
    /// A cubic grid, as near to a cube as the number allows.
    Cube(SpacingKeys),
    /// Letters, in the plane z = 0.
    Text(TextKeys),
    /// An SVG drawing, in the plane z = 0.
    Svg(SvgKeys),
    /// The dark or opaque part of a picture, in the plane z = 0.
    Image(ImageKeys),
    /// A list of slots in a file.
    File(FileKeys),
    /// A list of slots.
    Points {
        /// Slot of each vehicle in m.
        points_m: Vec<Point>,
    },
}

/// The control law and the safety distance.
#[derive(Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct LawTable {
    #[schemars(flatten)]
    pub(super) kind: LawSpec,
    /// Safety distance delta in m: every flight is judged by it, whatever the law. Needed unless `[safety]` has an ellipsoid.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub(super) delta_m: Option<f64>,
}

/// The bodies that carry out the commands.
#[derive(Debug, Default, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(super) struct PlantTable {
    /// What moves the vehicles.
    pub(super) kind: PlantSpec,
}

/// Space around each vehicle that must stay empty.
#[derive(Debug, Default, Deserialize, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct SafetyTable {
    #[schemars(flatten)]
    pub(super) shape: Safety,
}

/// Random numbers in flight: wind, sensors, radio.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(super) struct NoiseTable {
    /// Seed of the random numbers in flight (`ChaCha8`, the same on every machine). The start has its own seed.
    pub(super) seed: u64,
}

impl Document {
    /// Velocity coefficient a22 \[1/s\] that laws know of: 0 for other bodies than points.
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

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// Keys of `shape = "v"`.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct VKeys {
    /// Distance between neighbours on an arm in m, and of the nearest slots; 1.5 times `law.delta_m` unless given.
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

/// Keys of a shape that has only a spacing.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct SpacingKeys {
    /// Distance of the nearest slots in m; 1.5 times `law.delta_m` unless given.
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
    /// Rise of a full turn in m.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub(super) pitch_m: f64,
    /// Distance between neighbours in m, and of the nearest slots; 1.5 times `law.delta_m` unless this or `turns` is
    /// given.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub(super) spacing_m: Option<f64>,
    /// Turns from the first slot to the last, in place of `spacing_m`.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub(super) turns: Option<f64>,
}

/// Size of a drawing: one of the keys, or none.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[expect(clippy::struct_field_names, reason = "each is in metres")]
pub(super) struct DrawingSize {
    /// Height of everything that is drawn in m.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub(super) height_m: Option<f64>,
    /// Width of everything that is drawn in m, in place of `height_m`.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub(super) width_m: Option<f64>,
    /// Distance of the nearest slots in m; 1.5 times `law.delta_m` unless this, the height or the width is given.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub(super) spacing_m: Option<f64>,
}

/// Keys of `shape = "text"`.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct TextKeys {
    /// The text; a line break begins a new line below.
    #[schemars(length(min = 1, max = 1000))]
    pub(super) text: String,
    #[serde(flatten)]
    pub(super) size: DrawingSize,
}

/// Keys of `shape = "svg"`.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct SvgKeys {
    /// Path data, in the form of the attribute `d` of SVG.
    pub(super) path: Option<String>,
    /// An SVG file, in place of `path`; relative to the folder of the scenario file.
    pub(super) file: Option<PathBuf>,
    /// Whether slots fill the areas inside the lines, instead of standing on the lines.
    #[serde(default)]
    pub(super) filled: bool,
    #[serde(flatten)]
    pub(super) size: DrawingSize,
}

/// Keys of `shape = "image"`.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct ImageKeys {
    /// A PNG picture; relative to the folder of the scenario file.
    pub(super) file: PathBuf,
    /// Pixels that are drawn: unless given, the opaque pixels of a picture with transparent ones, otherwise the dark
    /// pixels.
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
    /// A text file with a line for each slot: x, y and, unless it is 0, z in m, with commas, semicolons, tabs or
    /// blanks between; relative to the folder of the scenario file. A first line may name the columns.
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

/// A point: x, y and, unless it is 0, z.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[schemars(with = "Vec<f64>", extend("minItems" = 2, "maxItems" = 3))]
#[serde(untagged)]
pub(super) enum Point {
    /// In the plane z = 0.
    Plane([f64; 2]),
    /// In space.
    Space([f64; 3]),
}

/// Two vehicles, counted from 1.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(transparent)]
pub(super) struct Edge(#[schemars(inner(range(min = 1)))] pub(super) [u64; 2]);

impl Point {
    /// x, y and z.
    pub(super) fn coordinates(self) -> [f64; 3] {
        match self {
            Self::Plane([x, y]) => [x, y, 0.0],
            Self::Space(coordinates) => coordinates,
        }
    }
}

/// Some vehicles, counted from 1, or all of them.
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

/// When a leg begins.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(untagged)]
pub(super) enum LegStart {
    /// As soon as the previous leg is reached.
    When(Reached),
    /// At this time in s.
    At(f64),
}

/// The word `reached`.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Reached {
    /// As soon as the previous leg is reached.
    Reached,
}

impl LegStart {
    pub(super) fn begins(self) -> Begins {
        match self {
            Self::When(Reached::Reached) => Begins::Reached,
            Self::At(start_s) => Begins::At(start_s),
        }
    }
}

/// A row for each point.
pub(super) fn rows(points: &[Point]) -> Rows {
    let mut rows = Rows::zeros(points.len());
    for (i, point) in points.iter().enumerate() {
        set_row(&mut rows, i, point.coordinates().into());
    }
    rows
}
