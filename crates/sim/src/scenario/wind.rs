//! `[wind]` of the scenario file: its keys, what they mean, and what they must be.

use std::fmt;

use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::de::{MapAccess, SeqAccess, Visitor, value::MapAccessDeserializer, value::SeqAccessDeserializer};
use serde::{Deserialize, Deserializer, Serialize};

use super::error::ScenarioError;
use super::values::Point;
use tautline_laws::wind::{Dryden, Gust, WindSpec};

/// Air that moves. Points feel it where they have a drag (`vehicle.drag_per_s`).
#[derive(Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct WindTable {
    /// Velocity of the air that never changes in m/s; none unless given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Point")]
    mean_m_s: Option<Point>,
    /// A gust, or a list of gusts that add up.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Gusts")]
    gust: Option<Gusts>,
    /// Dryden turbulence at low altitude (MIL-F-8785C), carried past vehicles at the mean wind's speed, and at 1 m/s at least.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "DrydenTable")]
    dryden: Option<DrydenTable>,
    /// Whether all vehicles are in the same turbulence, and not each in its own. Whom a gust meets it says itself.
    #[serde(default = "yes", skip_serializing_if = "Clone::clone")]
    #[schemars(extend("default" = true))]
    shared: bool,
}

fn yes() -> bool {
    true
}

/// One gust, or several.
#[derive(Debug, Serialize, JsonSchema)]
#[serde(untagged)]
enum Gusts {
    /// One.
    One(GustTable),
    /// Several, which add up.
    Several(Vec<GustTable>),
}

/// Air that rises to a velocity as 1 - cos, holds it, and falls back in the same way.
#[derive(Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct GustTable {
    /// When it begins in s.
    at_s: f64,
    /// How long it rises in s.
    rise_s: f64,
    /// How long it then stays in s.
    #[serde(default)]
    hold_s: f64,
    /// How long it falls in s; as long as it rises unless given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    fall_s: Option<f64>,
    /// What it adds to the wind at its height in m/s.
    velocity_m_s: Point,
    /// The vehicles that it meets; all unless given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    vehicles: Option<Vec<u64>>,
}

/// How strong turbulence is, and how large its eddies are.
#[derive(Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct DrydenTable {
    /// Wind speed 20 feet above the ground in m/s: a tenth of it is the standard deviation of the vertical part.
    speed_20ft_m_s: f64,
    /// Height above the ground in m, from 3.048 to 304.8.
    height_m: f64,
}

impl<'de> Deserialize<'de> for Gusts {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct GustsVisitor;

        impl<'de> Visitor<'de> for GustsVisitor {
            type Value = Gusts;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a gust { at_s = .., rise_s = .., velocity_m_s = .. }, or a list of gusts")
            }

            fn visit_map<A: MapAccess<'de>>(self, table: A) -> Result<Gusts, A::Error> {
                GustTable::deserialize(MapAccessDeserializer::new(table)).map(Gusts::One)
            }

            fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<Gusts, A::Error> {
                Vec::deserialize(SeqAccessDeserializer::new(list)).map(Gusts::Several)
            }
        }

        deserializer.deserialize_any(GustsVisitor)
    }
}

impl WindTable {
    /// What blows, over so many vehicles.
    pub(super) fn wind(self, count: usize) -> Result<WindSpec, ScenarioError> {
        let gusts = match self.gust {
            None => Vec::new(),
            Some(Gusts::One(gust)) => vec![gust],
            Some(Gusts::Several(gusts)) => gusts,
        };
        Ok(WindSpec {
            mean_m_s: self.mean_m_s.map_or_else(Vector3::zeros, |mean| mean.coordinates().into()),
            gusts: gusts.into_iter().map(|gust| gust.gust(count)).collect::<Result<_, _>>()?,
            turbulence: self.dryden.map(|DrydenTable { speed_20ft_m_s, height_m }| Dryden { speed_20ft_m_s, height_m }),
            shared: self.shared,
        })
    }

    /// The table of what blows, where anything does.
    pub(super) fn of(wind: &WindSpec) -> Option<Self> {
        (*wind != WindSpec::default()).then(|| Self {
            mean_m_s: Some(Point::Space(wind.mean_m_s.into())),
            gust: (!wind.gusts.is_empty()).then(|| Gusts::Several(wind.gusts.iter().map(GustTable::of).collect())),
            dryden: wind.turbulence.map(|Dryden { speed_20ft_m_s, height_m }| DrydenTable { speed_20ft_m_s, height_m }),
            shared: wind.shared,
        })
    }
}

impl GustTable {
    fn gust(self, count: usize) -> Result<Gust, ScenarioError> {
        let index = |number: u64| {
            let index = usize::try_from(number).ok().and_then(|number| number.checked_sub(1));
            index.filter(|&index| index < count).ok_or_else(|| {
                ScenarioError::new(format!("a gust meets vehicle {number}: they are counted from 1 to {count}"))
                    .coded("scenario/unknown-vehicle")
                    .with_help("name vehicles of the swarm")
                    .at("wind.gust")
            })
        };
        let met = |numbers: Vec<u64>| {
            let mut vehicles = numbers.into_iter().map(index).collect::<Result<Vec<_>, _>>()?;
            vehicles.sort_unstable();
            vehicles.dedup();
            Ok(vehicles)
        };
        Ok(Gust {
            at_s: self.at_s,
            rise_s: self.rise_s,
            hold_s: self.hold_s,
            fall_s: self.fall_s.unwrap_or(self.rise_s),
            velocity_m_s: self.velocity_m_s.coordinates().into(),
            vehicles: self.vehicles.map(met).transpose()?,
        })
    }

    fn of(gust: &Gust) -> Self {
        Self {
            at_s: gust.at_s,
            rise_s: gust.rise_s,
            hold_s: gust.hold_s,
            fall_s: Some(gust.fall_s),
            velocity_m_s: Point::Space(gust.velocity_m_s.into()),
            vehicles: gust.vehicles.as_ref().map(|met| met.iter().map(|&vehicle| vehicle as u64 + 1).collect()),
        }
    }
}
