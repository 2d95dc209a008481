//! A scenario as TOML with nothing left to be derived: every default written out, every shape as points, random
//! numbers drawn.

use std::fmt::Write as _;

use sha2::{Digest, Sha256};

use super::{PlantSpec, Precision, Scenario, Space};
use crate::law::LawSpec;
use crate::swarm::Rows;

impl Scenario {
    /// The scenario as TOML with every default written out; reading it gives an equal scenario, bit for bit.
    ///
    /// Start and formation are lists of points, so the text depends on no random number, no shape and no version of
    /// either. Equal scenarios have equal texts.
    #[must_use]
    pub fn resolved_toml(&self) -> String {
        let mut out = String::new();
        // Writing to a string cannot fail.
        let _ = self.write(&mut out);
        out
    }

    /// SHA-256 of [`Scenario::resolved_toml`] in hexadecimal: what was flown, in 64 characters.
    #[must_use]
    pub fn sha256_hex(&self) -> String {
        Sha256::digest(self.resolved_toml()).iter().fold(String::with_capacity(64), |mut hex, byte| {
            let _ = write!(hex, "{byte:02x}");
            hex
        })
    }

    fn write(&self, out: &mut String) -> std::fmt::Result {
        writeln!(out, "name = {}", toml::Value::from(self.name.as_str()))?;

        writeln!(out, "\n[swarm]")?;
        writeln!(out, "count = {}", self.count())?;
        writeln!(out, "dimensions = {}", if self.space == Space::Plane { 2 } else { 3 })?;
        writeln!(out, "mass_kg = {}", per_vehicle(&self.mass_kg))?;
        writeln!(out, "hull_radius_m = {}", per_vehicle(&self.hull_radius_m))?;
        writeln!(out, "a22_per_s = {}", number(self.a22_per_s))?;

        writeln!(out, "\n[start]")?;
        self.write_rows(out, "positions_m", &self.start.positions_m)?;
        self.write_rows(out, "velocities_m_s", &self.start.velocities_m_s)?;

        writeln!(out, "\n[formation]\nshape = \"points\"")?;
        self.write_rows(out, "points_m", &self.formation().slots_m)?;

        writeln!(out, "\n[law]")?;
        match &self.law {
            LawSpec::EdgeTension(keys) => writeln!(out, "kind = \"edge-tension\"\nalpha = {}", number(keys.alpha))?,
            LawSpec::Laplacian(keys) => {
                writeln!(out, "kind = \"laplacian\"")?;
                let f2_per_s = keys.f2_per_s.unwrap_or(1.0 + self.a22_per_s);
                writeln!(out, "f1_per_s2 = {}\nf2_per_s = {}", number(keys.f1_per_s2), number(f2_per_s))?;
            }
        }
        writeln!(out, "delta_m = {}", number(self.delta_m))?;

        writeln!(out, "\n[graph]")?;
        if self.graph.is_complete() {
            writeln!(out, "kind = \"complete\"")?;
        } else {
            writeln!(out, "kind = \"edges\"\nedges = [")?;
            for (i, j) in self.graph.edges() {
                writeln!(out, "    [{}, {}],", i + 1, j + 1)?;
            }
            writeln!(out, "]")?;
        }

        writeln!(out, "\n[plant]")?;
        match self.plant {
            PlantSpec::Rapier(precision) => {
                let precision = match precision {
                    Precision::Single => "single",
                    Precision::Double => "double",
                };
                writeln!(out, "kind = \"rapier\"\nprecision = \"{precision}\"")?;
            }
            PlantSpec::Ideal => writeln!(out, "kind = \"ideal\"")?,
        }

        writeln!(out, "\n[time]")?;
        writeln!(out, "duration_s = {}", number(self.time.duration_s))?;
        writeln!(out, "dt_s = {}", number(self.time.dt_s))?;
        writeln!(out, "record_hz = {}", number(self.time.record_hz))?;
        writeln!(out, "max_halvings = {}", self.time.max_halvings)?;

        writeln!(out, "\n[judge]")?;
        writeln!(out, "edge_error_m = {}", number(self.arrival.edge_error_m))?;
        writeln!(out, "disagreement_m_s = {}", number(self.arrival.disagreement_m_s))?;
        writeln!(out, "hold_s = {}", number(self.arrival.hold_s))
    }

    fn write_rows(&self, out: &mut String, key: &str, rows: &Rows) -> std::fmt::Result {
        writeln!(out, "{key} = [")?;
        for i in 0..rows.nrows() {
            write!(out, "    [{}, {}", number(rows[(i, 0)]), number(rows[(i, 1)]))?;
            if self.space == Space::Volume {
                write!(out, ", {}", number(rows[(i, 2)]))?;
            }
            writeln!(out, "],")?;
        }
        writeln!(out, "]")
    }
}

/// One number if all are the same, otherwise the list.
fn per_vehicle(numbers: &[f64]) -> String {
    match numbers {
        [first, rest @ ..] if rest.iter().all(|other| other.to_bits() == first.to_bits()) => number(*first),
        _ => format!("[{}]", numbers.iter().map(|&x| number(x)).collect::<Vec<_>>().join(", ")),
    }
}

/// The shortest decimal number that reads back to the same bits, as TOML writes it.
fn number(x: f64) -> String {
    if x.is_nan() { "nan".to_owned() } else { format!("{x:?}") }
}
