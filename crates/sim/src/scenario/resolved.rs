//! Converts a scenario to a document without shapes or defaults: every value written out, every shape as points, random
//! numbers drawn.

use std::fmt::{self, Write as _};

use toml::{Table, Value};

use super::document::{
    Assignment, Document, FormationShape, FormationTable, LawTable, LegTable, NoiseTable, Placement, PlantTable,
    SafetyTable, StartTable, SwarmTable, TimeKeys,
};
use super::document::{Edge, LegStart, PerVehicle, Point};
use super::graph::{GraphKind, GraphTable};
use super::obstacles::ObstacleTable;
use super::reference::ReferenceTable;
use super::spec::{Scenario, Space};
use super::template::Laws;
use super::vehicle::VehicleTable;
use tautline_core::record::sha256_hex;
use tautline_core::swarm::Rows;
use tautline_laws::target::{Leg, LegTrigger};

/// Scenario as TOML with every default written out, and its hash. Reading the TOML gives an equal scenario, bit for
/// bit.
///
/// Start and formations are lists of points, so the text does not depend on the generators of shapes and random
/// numbers. Equal scenarios have equal texts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Resolved {
    /// The TOML.
    pub toml: String,
    /// SHA-256 of the TOML in hexadecimal, 64 characters: the identity of a flight.
    pub sha256: String,
}

impl Scenario {
    /// Writes the scenario with every default.
    #[must_use]
    pub fn resolved(&self) -> Resolved {
        let toml = Document::from(self).toml();
        let sha256 = sha256_hex(&toml);
        Resolved { toml, sha256 }
    }

    /// Returns the hash of the settings that determine the flight. It is [`Resolved::sha256`], but without the seed of
    /// the noise if nothing in flight is random. Scenarios with equal hashes have the same flight.
    #[must_use]
    pub fn flight_sha256(&self) -> String {
        if self.is_random_in_flight() || self.noise_seed == 0 {
            return self.resolved().sha256;
        }
        Self { noise_seed: 0, ..self.clone() }.resolved().sha256
    }

    fn leg_table(&self, leg: &Leg) -> LegTable {
        LegTable {
            start_s: match leg.begins {
                LegTrigger::At(start_s) => Some(LegStart::At(start_s)),
                LegTrigger::Reached => None,
            },
            placement: placement(leg),
            shape: Some(FormationShape::Points { points_m: self.points(&leg.formation.slots_m) }),
        }
    }

    fn points(&self, rows: &Rows) -> Vec<Point> {
        rows.row_iter()
            .map(|row| match self.space {
                Space::Plane => Point::Plane([row[0], row[1]]),
                Space::Volume => Point::Space([row[0], row[1], row[2]]),
            })
            .collect()
    }
}

impl Document {
    /// Returns the document as TOML.
    pub(super) fn toml(&self) -> String {
        let mut out = String::new();
        // Every key of the document can be written as TOML, and writing to a string cannot fail.
        let _ = Table::try_from(self).map(|tables| write_document(&mut out, &tables));
        out
    }

    /// Returns the document without its lists of points and edges.
    pub(super) fn without_lists(mut self) -> Self {
        let no_points = || FormationShape::Points { points_m: Vec::new() };
        self.start.positions_m = None;
        self.start.velocities_m_s = None;
        self.formation.shape = no_points();
        self.leg.iter_mut().for_each(|leg| leg.shape = Some(no_points()));
        self.graph.kind = GraphKind::Complete {};
        self
    }
}

impl From<&Scenario> for Document {
    fn from(scenario: &Scenario) -> Self {
        let law = scenario.law.clone().complete(scenario.velocity_coefficient_per_s());
        Self {
            name: Some(scenario.name.clone()),
            swarm: SwarmTable {
                count: Some(scenario.count() as u64),
                dimensions: Some(scenario.space.dimensions() as u64),
                mass_kg: per_vehicle(&scenario.mass_kg),
                hull_radius_m: per_vehicle(&scenario.hull_radius_m),
                a22_per_s: scenario.a22_per_s,
            },
            vehicle: VehicleTable::from(scenario),
            wind: scenario.wind.clone(),
            safety: SafetyTable { shape: scenario.safety },
            start: StartTable {
                positions_m: Some(scenario.points(&scenario.start.positions_m)),
                velocities_m_s: Some(scenario.points(&scenario.start.velocities_m_s)),
                jitter_m: 0.0,
                seed: 0,
                shuffle: false,
                shape: None,
            },
            formation: FormationTable {
                placement: scenario.legs.first().map(placement).unwrap_or_default(),
                shape: FormationShape::Points { points_m: scenario.points(&scenario.formation().slots_m) },
            },
            leg: scenario.legs.iter().skip(1).map(|leg| scenario.leg_table(leg)).collect(),
            obstacle: scenario.obstacles.iter().map(ObstacleTable::from).collect(),
            reference: scenario.reference.as_ref().map(ReferenceTable::from),
            law: LawTable { kind: law, delta_m: Some(scenario.delta_m) },
            laws: Laws::new(),
            graph: GraphTable {
                kind: if scenario.graph.is_complete() {
                    GraphKind::Complete {}
                } else {
                    let edges = scenario.graph.edges().map(|(i, j)| Edge([i as u64 + 1, j as u64 + 1])).collect();
                    GraphKind::Edges { edges }
                },
            },
            plant: PlantTable { kind: scenario.plant },
            time: scenario.time,
            arrival: scenario.arrival,
            deadlock: scenario.deadlock,
            sensing: scenario.sensing,
            network: scenario.network.clone(),
            actuation: scenario.actuation,
            shield: scenario.shield,
            failure: scenario.failures.clone(),
            noise: NoiseTable { seed: scenario.noise_seed },
            given: TimeKeys::default(),
        }
    }
}

/// Returns the assignment; slots are already in the order of their vehicles.
fn placement(leg: &Leg) -> Placement {
    let assignment = if leg.interchangeable { Assignment::WhenStalled } else { Assignment::Given };
    Placement { assignment, ..Placement::default() }
}

/// Returns one number if all are equal, otherwise the list.
fn per_vehicle(numbers: &[f64]) -> PerVehicle {
    match numbers {
        [first, rest @ ..] if rest.iter().all(|other| other.to_bits() == first.to_bits()) => PerVehicle::All(*first),
        _ => PerVehicle::Each(numbers.to_vec()),
    }
}

fn write_document(out: &mut String, document: &Table) -> fmt::Result {
    for (key, value) in document {
        match value {
            Value::Table(table) => {
                writeln!(out, "\n[{key}]")?;
                write_keys(out, table)?;
            }
            Value::Array(tables) => {
                for table in tables.iter().filter_map(Value::as_table) {
                    writeln!(out, "\n[[{key}]]")?;
                    write_keys(out, table)?;
                }
            }
            _ => writeln!(out, "{key} = {value}")?,
        }
    }
    Ok(())
}

/// Writes the keys of a table, then those of its choice.
fn write_keys(out: &mut String, table: &Table) -> fmt::Result {
    for (key, value) in table {
        match value {
            Value::Table(choice) if choice.values().all(Value::is_table) => {
                for (name, keys) in choice {
                    writeln!(out, "{key} = \"{name}\"")?;
                    write_keys(out, keys.as_table().unwrap_or(&Table::new()))?;
                }
            }
            Value::Array(rows) if rows.iter().all(Value::is_array) => {
                writeln!(out, "{key} = [")?;
                rows.iter().try_for_each(|row| writeln!(out, "    {},", inline(row)))?;
                writeln!(out, "]")?;
            }
            _ => writeln!(out, "{key} = {}", inline(value))?,
        }
    }
    Ok(())
}

/// Formats a value in one line; a number as the shortest decimal with the same bits.
fn inline(value: &Value) -> String {
    match value {
        Value::Array(list) => format!("[{}]", list.iter().map(inline).collect::<Vec<_>>().join(", ")),
        Value::Table(keys) => {
            let keys: Vec<_> = keys.iter().map(|(key, value)| format!("{key} = {}", inline(value))).collect();
            format!("{{ {} }}", keys.join(", "))
        }
        Value::Float(x) if x.is_nan() => "nan".to_owned(),
        Value::Float(x) => format!("{x:?}"),
        _ => value.to_string(),
    }
}
