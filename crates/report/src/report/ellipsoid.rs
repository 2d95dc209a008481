//! Distances in metres, where those that are judged are scaled to ellipsoids.

use serde::{Deserialize, Serialize};

use super::findings::{Findings, finite};
use tautline_core::text::{at_least, metres, seconds};

/// What must stay empty around a vehicle, and how close vehicles came in metres.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ellipsoid {
    /// Its half axes \[m\]: a scaled length is a level one in metres, and a height divided by the third over the first.
    pub half_axes_m: [f64; 3],
    /// Smallest distance of two centres over the whole run \[m\], unscaled.
    pub min_distance_m: Option<f64>,
    /// When it occurred \[s\].
    pub min_distance_at_s: Option<f64>,
    /// Which pair.
    pub min_distance_pair: Option<[usize; 2]>,
}

impl Ellipsoid {
    pub(super) fn of(findings: &Findings<'_>) -> Option<Self> {
        let closest = findings.in_metres.and_then(|in_metres| in_metres.closest);
        Some(Self {
            half_axes_m: findings.half_axes_m?,
            min_distance_m: closest.and_then(|closest| finite(closest.separation_m)),
            min_distance_at_s: closest.and_then(|closest| finite(closest.time_s)),
            min_distance_pair: closest.map(|closest| closest.pair.numbers()),
        })
    }

    /// In words, without the name of the line.
    pub(super) fn line(&self) -> String {
        let axes = self.half_axes_m.map(metres).join(", ");
        let closest = self.min_distance_m.map_or("-".to_owned(), |min_m| at_least(min_m, 6));
        let pair = self.min_distance_pair.map(|[first, second]| format!(", vehicles {first}-{second}"));
        let at = self.min_distance_at_s.map(|at_s| format!(" at {}", seconds(at_s)));
        format!(
            "half axes {axes} m; unscaled, centres never closer than {closest} m{}{}",
            at.unwrap_or_default(),
            pair.unwrap_or_default()
        )
    }
}
