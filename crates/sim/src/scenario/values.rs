//! Values of the scenario file: numbers for each vehicle, points, edges, lists of vehicles.

use std::fmt;

use schemars::JsonSchema;
use serde::de::{SeqAccess, Visitor, value::SeqAccessDeserializer};
use serde::{Deserialize, Deserializer, Serialize};

use tautline_core::swarm::{Rows, set_row};
use tautline_laws::target::Begins;

/// One number for all vehicles or a list with one for each.
#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(untagged)]
pub(super) enum PerVehicle {
    /// The same for all.
    All(f64),
    /// One for each.
    Each(Vec<f64>),
}

/// x, y and, unless it is 0, z.
#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
#[schemars(with = "Vec<f64>", extend("minItems" = 2, "maxItems" = 3))]
#[serde(untagged)]
pub(super) enum Point {
    /// In the plane z = 0.
    Plane([f64; 2]),
    /// In space.
    Space([f64; 3]),
}

/// Two vehicles, counted from 1.
#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
#[schemars(transparent)]
pub(super) struct Edge(pub(super) [u64; 2]);

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
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub(super) enum Vehicles {
    /// All of them.
    All(All),
    /// These.
    Listed(Vec<u64>),
}

/// The word `all`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub(super) enum All {
    /// All of them.
    All,
}

/// When a leg begins.
#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
#[serde(untagged)]
pub(super) enum LegStart {
    /// Once the one before it is reached.
    When(Reached),
    /// At this time in s.
    At(f64),
}

/// The word `reached`.
#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Reached {
    /// Once the one before it is reached.
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

impl<'de> Deserialize<'de> for LegStart {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct LegStartVisitor;

        impl Visitor<'_> for LegStartVisitor {
            type Value = LegStart;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a time in s, or \"reached\"")
            }

            fn visit_f64<E>(self, start_s: f64) -> Result<LegStart, E> {
                Ok(LegStart::At(start_s))
            }

            fn visit_i64<E>(self, start_s: i64) -> Result<LegStart, E> {
                Ok(LegStart::At(start_s as f64))
            }

            fn visit_str<E: serde::de::Error>(self, word: &str) -> Result<LegStart, E> {
                if word == "reached" {
                    Ok(LegStart::When(Reached::Reached))
                } else {
                    Err(E::invalid_value(serde::de::Unexpected::Str(word), &self))
                }
            }
        }

        deserializer.deserialize_any(LegStartVisitor)
    }
}

impl<'de> Deserialize<'de> for Vehicles {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct VehiclesVisitor;

        impl<'de> Visitor<'de> for VehiclesVisitor {
            type Value = Vehicles;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("\"all\", or a list of vehicle numbers")
            }

            fn visit_str<E: serde::de::Error>(self, word: &str) -> Result<Vehicles, E> {
                if word == "all" {
                    Ok(Vehicles::All(All::All))
                } else {
                    Err(E::invalid_value(serde::de::Unexpected::Str(word), &self))
                }
            }

            fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<Vehicles, A::Error> {
                Vec::deserialize(SeqAccessDeserializer::new(list)).map(Vehicles::Listed)
            }
        }

        deserializer.deserialize_any(VehiclesVisitor)
    }
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
        let list = ShortList { expected: "a point: [x, y] or [x, y, z]", numbers: [0.0; 3] };
        deserializer.deserialize_seq(list).map(Self::Space)
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

/// A row for each point.
pub(super) fn rows(points: &[Point]) -> Rows {
    let mut rows = Rows::zeros(points.len());
    for (i, point) in points.iter().enumerate() {
        set_row(&mut rows, i, point.coordinates().into());
    }
    rows
}
