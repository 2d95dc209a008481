//! The scenario file: its keys, units and defaults as serde types, and the JSON Schema made from them.
//!
//! A table whose keys depend on a choice (`shape`, `kind`) is an enum inside a struct that holds the keys common to all
//! choices. TOML writes both in one flat table; `document` moves the keys of a choice below it before serde
//! sees them, so a key of another choice is refused at its own place.

use std::fmt;

use schemars::JsonSchema;
use serde::de::{SeqAccess, Visitor, value::SeqAccessDeserializer};
use serde::{Deserialize, Deserializer, Serialize};

use super::TimeSpec;
use crate::target::Arrival;

/// Default mass of a vehicle in kg.
pub const DEFAULT_MASS_KG: f64 = 1.0;
/// Default radius of a vehicle's solid hull in m.
pub const DEFAULT_HULL_RADIUS_M: f64 = 0.25;
/// Default scale of the edge tension in m^2/s^2.
pub const DEFAULT_ALPHA: f64 = 1.0;
/// Default position gain of the Laplacian law in 1/s^2.
pub const DEFAULT_F1_PER_S2: f64 = 1.0;

/// Tables whose remaining keys belong to a choice: table, key of the choice, keys common to all choices.
pub(super) const CHOICES: [(&str, &str, &[&str]); 4] = [
    ("start", "shape", &["positions_m", "velocities_m_s", "jitter_m", "seed"]),
    ("formation", "shape", &[]),
    ("law", "kind", &["delta_m"]),
    ("graph", "kind", &[]),
];

/// The JSON Schema of the scenario file, with descriptions, units and defaults.
#[must_use]
pub fn schema() -> serde_json::Value {
    let mut schema = schemars::schema_for!(ScenarioFile).to_value();
    remove_null(&mut schema);
    schema
}

/// TOML has no null: a key that may be left out has the type that it has when it is there.
fn remove_null(schema: &mut serde_json::Value) {
    use serde_json::Value;
    match schema {
        Value::Object(object) => {
            object.retain(|key, value| !(key == "default" && value.is_null()));
            for (key, value) in object {
                match value {
                    Value::Array(types) if key == "type" => {
                        types.retain(|name| name != "null");
                        if let [only] = &mut types[..] {
                            *value = only.take();
                        }
                    }
                    other => remove_null(other),
                }
            }
        }
        Value::Array(list) => list.iter_mut().for_each(remove_null),
        _ => {}
    }
}

/// A flight of a swarm into a formation. Every number is in SI units, named at the end of its key. Vehicles, and the
/// entries of every list, are counted from 1.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "tautline scenario")]
pub(super) struct ScenarioFile {
    /// Name of the scenario and of the folder of its runs: letters, digits, `-` and `_`.
    #[schemars(length(min = 1, max = 64), pattern("^[A-Za-z0-9_-]+$"))]
    pub(super) name: String,
    /// The vehicles.
    #[serde(default)]
    pub(super) swarm: SwarmFile,
    /// Where they start.
    pub(super) start: StartFile,
    /// The slots that they shall reach.
    pub(super) formation: FormationFile,
    /// The control law.
    pub(super) law: LawFile,
    /// Which vehicles sense each other: all of them unless given.
    #[serde(default)]
    pub(super) graph: GraphFile,
    /// The bodies that carry out the commands.
    #[serde(default)]
    pub(super) plant: PlantFile,
    /// Duration and rates.
    pub(super) time: TimeFile,
    /// What counts as a reached formation.
    #[serde(default)]
    pub(super) judge: JudgeFile,
}

/// The vehicles.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(super) struct SwarmFile {
    /// Number of vehicles N. Needed where neither the start nor the formation lists points; checked against them
    /// where they do.
    #[schemars(range(min = 2))]
    pub(super) count: Option<u64>,
    /// Mass in kg: one number for all vehicles or a list with one for each.
    pub(super) mass_kg: PerVehicle,
    /// Radius of the solid hull in m, for all vehicles or for each. The hulls of any two vehicles must fit within
    /// `law.delta_m`.
    pub(super) hull_radius_m: PerVehicle,
    /// Velocity coefficient a22 of p'' = a22 v + u in 1/s: negative is drag, positive feeds energy in.
    pub(super) a22_per_s: f64,
    /// 2 keeps the swarm in the plane z = 0, 3 lets it use all axes. Without it: 2 when every position, velocity and
    /// slot has z = 0, otherwise 3.
    #[schemars(range(min = 2, max = 3))]
    pub(super) dimensions: Option<u8>,
}

/// Where the vehicles start: `positions_m`, or a `shape` with its parameters.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct StartFile {
    /// Position of each vehicle in m.
    pub(super) positions_m: Option<Vec<Point>>,
    /// Velocity of each vehicle in m/s; at rest unless given.
    pub(super) velocities_m_s: Option<Vec<Point>>,
    /// Largest random offset along each axis in m, uniform, added to every position. Along z only in three
    /// dimensions.
    #[serde(default)]
    pub(super) jitter_m: f64,
    /// Seed of the random numbers (`ChaCha8`, the same on every machine).
    #[serde(default)]
    pub(super) seed: u64,
    #[schemars(flatten)]
    pub(super) shape: Option<StartShape>,
}

/// A start without a list of positions.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
#[schemars(tag = "shape")]
pub(super) enum StartShape {
    /// Vehicles 1, 2, ... along x.
    Line {
        /// Distance between neighbours in m.
        spacing_m: f64,
    },
    /// A near-square grid in the plane z = 0, row by row.
    Grid {
        /// Distance between neighbours in m.
        spacing_m: f64,
    },
    /// A circle in the plane z = 0.
    Circle {
        /// Radius in m.
        radius_m: f64,
    },
    /// Points spread evenly over a sphere.
    Sphere {
        /// Radius in m.
        radius_m: f64,
    },
    /// Uniformly random positions in a square, or in a cube in three dimensions, that keep a distance.
    Random {
        /// Half the side of the square or cube around the origin in m.
        half_extent_m: f64,
        /// Smallest distance between two vehicles in m: more than `law.delta_m`.
        min_separation_m: f64,
    },
}

/// The slots of the formation. Laws that control distances reach it up to rotation, reflection and translation.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct FormationFile {
    #[schemars(flatten)]
    pub(super) shape: FormationShape,
}

/// A formation and its size.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
#[schemars(tag = "shape")]
pub(super) enum FormationShape {
    /// Five slots: the corners of a house of side d, (0,0) (d,0) (d/2, sqrt3 d/2) (0, sqrt3 d) (d, sqrt3 d).
    Pentagon {
        /// Side d in m.
        side_m: f64,
    },
    /// Equal angles on a circle in the plane z = 0.
    Circle {
        /// Radius in m.
        radius_m: f64,
    },
    /// Along x.
    Line {
        /// Distance between neighbours in m.
        spacing_m: f64,
    },
    /// A near-square grid in the plane z = 0, row by row.
    Grid {
        /// Distance between neighbours in m.
        spacing_m: f64,
    },
    /// Points spread evenly over a sphere.
    Sphere {
        /// Radius in m.
        radius_m: f64,
    },
    /// A list of slots.
    Points {
        /// Slot of each vehicle in m.
        points_m: Vec<Point>,
    },
}

/// The control law and the safety distance.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct LawFile {
    /// Safety distance delta in m: every flight is judged by it, whatever the law.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub(super) delta_m: f64,
    #[schemars(flatten)]
    pub(super) kind: LawKind,
}

/// A control law and its parameters.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
#[schemars(tag = "kind")]
pub(super) enum LawKind {
    /// Distances as springs with a barrier at delta: collision-free on the complete graph.
    EdgeTension {
        /// Scale of the tension in m^2/s^2.
        #[serde(default = "default_alpha")]
        alpha: f64,
    },
    /// The Laplacian baseline: converges from every start and avoids nothing.
    Laplacian {
        /// Gain on positions in 1/s^2.
        #[serde(default = "default_f1_per_s2")]
        f1_per_s2: f64,
        /// Gain on velocities in 1/s; 1 + `swarm.a22_per_s` unless given.
        f2_per_s: Option<f64>,
    },
}

/// Which vehicles sense each other.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct GraphFile {
    #[schemars(flatten)]
    pub(super) kind: GraphKind,
}

/// An undirected, connected graph.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
#[schemars(tag = "kind")]
pub(super) enum GraphKind {
    /// Every pair.
    Complete {},
    /// Vehicle 1 with every other.
    Star {},
    /// Each vehicle with the next, and the last with the first.
    Ring {},
    /// Each vehicle with the next.
    Path {},
    /// A list of pairs.
    Edges {
        /// Pairs of vehicles, counted from 1.
        edges: Vec<Edge>,
    },
}

/// The bodies that carry out the commands.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(super) struct PlantFile {
    /// What moves the vehicles.
    pub(super) kind: PlantKind,
    /// Floating-point precision of Rapier: 32 or 64 bits. The ideal plant has no choice of it.
    pub(super) precision: PrecisionFile,
}

/// A plant.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub(super) enum PlantKind {
    /// Rapier rigid bodies, the command held over each step.
    #[default]
    Rapier,
    /// The equation p'' = a22 v + u solved to 12 digits in continuous time: what Rapier is measured against.
    Ideal,
}

/// Floating-point precision.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub(super) enum PrecisionFile {
    /// 32 bits.
    #[default]
    Single,
    /// 64 bits.
    Double,
}

/// Duration and rates.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct TimeFile {
    /// Length of the flight in s.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub(super) duration_s: f64,
    /// Control and physics step in s.
    #[serde(default = "default_dt_s")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub(super) dt_s: f64,
    /// Samples recorded per second of flight in Hz, at most one a step.
    #[serde(default = "default_record_hz")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub(super) record_hz: f64,
    /// How often a step that takes more than half of a clearance may be halved; 0 takes every step as it is.
    #[serde(default = "default_max_halvings")]
    pub(super) max_halvings: u32,
}

/// What counts as a reached formation: to the end of the flight, and at least for `hold_s`, both limits hold, and the
/// vehicles are no more than `edge_error_m` (root mean square) from the formation laid over them.
#[derive(Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(super) struct JudgeFile {
    /// Largest error of a desired distance over the edges of the graph in m.
    pub(super) edge_error_m: f64,
    /// Largest speed relative to the swarm's mean velocity in m/s.
    pub(super) disagreement_m_s: f64,
    /// Shortest time for which both must hold in s.
    pub(super) hold_s: f64,
}

/// One number for all vehicles or a list with one for each.
#[derive(Debug, Serialize, JsonSchema)]
#[serde(untagged)]
pub(super) enum PerVehicle {
    /// The same for all.
    All(f64),
    /// One for each.
    Each(Vec<f64>),
}

/// x, y and, unless it is 0, z.
#[derive(Clone, Copy, Debug, JsonSchema)]
#[schemars(transparent)]
pub(super) struct Point(#[schemars(with = "Vec<f64>", length(min = 2, max = 3))] pub(super) [f64; 3]);

/// Two vehicles, counted from 1.
#[derive(Clone, Copy, Debug, JsonSchema)]
#[schemars(transparent)]
pub(super) struct Edge(pub(super) [u64; 2]);

impl Default for SwarmFile {
    fn default() -> Self {
        Self {
            count: None,
            mass_kg: PerVehicle::All(DEFAULT_MASS_KG),
            hull_radius_m: PerVehicle::All(DEFAULT_HULL_RADIUS_M),
            a22_per_s: 0.0,
            dimensions: None,
        }
    }
}

impl Default for GraphFile {
    fn default() -> Self {
        Self { kind: GraphKind::Complete {} }
    }
}

impl Default for JudgeFile {
    fn default() -> Self {
        let Arrival { edge_error_m, disagreement_m_s, hold_s } = Arrival::default();
        Self { edge_error_m, disagreement_m_s, hold_s }
    }
}

fn default_alpha() -> f64 {
    DEFAULT_ALPHA
}

fn default_f1_per_s2() -> f64 {
    DEFAULT_F1_PER_S2
}

fn default_dt_s() -> f64 {
    TimeSpec::DEFAULT_DT_S
}

fn default_record_hz() -> f64 {
    TimeSpec::DEFAULT_RECORD_HZ
}

fn default_max_halvings() -> u32 {
    TimeSpec::DEFAULT_MAX_HALVINGS
}

impl<'de> Deserialize<'de> for PerVehicle {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct PerVehicleVisitor;

        impl<'de> Visitor<'de> for PerVehicleVisitor {
            type Value = PerVehicle;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number, or a list with a number for each vehicle")
            }

            fn visit_f64<E>(self, number: f64) -> Result<PerVehicle, E> {
                Ok(PerVehicle::All(number))
            }

            fn visit_i64<E>(self, number: i64) -> Result<PerVehicle, E> {
                Ok(PerVehicle::All(number as f64))
            }

            fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<PerVehicle, A::Error> {
                Vec::deserialize(SeqAccessDeserializer::new(list)).map(PerVehicle::Each)
            }
        }

        deserializer.deserialize_any(PerVehicleVisitor)
    }
}

impl<'de> Deserialize<'de> for Point {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer
            .deserialize_seq(ShortList { expected: "a point: [x, y] or [x, y, z]", numbers: [0.0; 3] })
            .map(Self)
    }
}

impl<'de> Deserialize<'de> for Edge {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_seq(ShortList { expected: "an edge: two vehicle numbers", numbers: [0; 2] }).map(Self)
    }
}

/// Reads a list of 2 to `N` numbers; those that are not there keep their value.
struct ShortList<T, const N: usize> {
    expected: &'static str,
    numbers: [T; N],
}

impl<'de, T: Deserialize<'de>, const N: usize> Visitor<'de> for ShortList<T, N> {
    type Value = [T; N];

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.expected)
    }

    fn visit_seq<A: SeqAccess<'de>>(mut self, mut list: A) -> Result<Self::Value, A::Error> {
        let mut length = 0;
        while let Some(number) = list.next_element()? {
            if let Some(slot) = self.numbers.get_mut(length) {
                *slot = number;
            }
            length += 1;
        }
        if (2..=N).contains(&length) { Ok(self.numbers) } else { Err(serde::de::Error::invalid_length(length, &self)) }
    }
}
