//! What numbers a scenario may hold, and how much of them.

use std::fmt::Display;

use super::error::ScenarioError;
use tautline_core::swarm::{Pair, Rows, row};
use tautline_laws::space::Spaced;

/// Largest magnitude of a number, in SI units: a million kilometres, where doubles are 0.1 um apart.
pub const LARGEST: f64 = 1e9;

/// Smallest magnitude of a number that must be positive, in SI units.
pub const SMALLEST: f64 = 1e-9;

/// Most steps of a flight. Up to here the product of step number, step and recording rate is known to better than the
/// 1e-6 that decides whether a step is recorded ([`super::TimeSpec::records`]); at a microsecond a step it takes 17 minutes.
pub const MAX_STEPS: f64 = 1e9;

/// Most halvings of a step. Up to here doubles tell the times of its parts apart to the end of the longest flight.
pub const MAX_HALVINGS: u32 = 20;

/// Distance at which the engine begins to act on two hulls that are about to touch \[m\]: hulls must stay so far from
/// touching while no pair is closer than delta.
pub const CONTACT_PREDICTION_M: f64 = 0.02;

/// A desired distance exceeds delta by at least this part of it: less is rounding, and its tension too stiff for any
/// step.
pub(super) const SLOT_MARGIN: f64 = 1e-9;

/// Distance of the nearest slots unless given, as a multiple of delta.
pub(super) const DEFAULT_SPACING: f64 = 1.5;

/// Longest name \[characters\].
pub const MAX_NAME_CHARS: usize = 64;

/// Whether a name may hold this.
pub(super) fn may_be_in_a_name(c: char) -> bool {
    c.is_ascii_alphanumeric() || c == '-' || c == '_'
}

/// Memory that a flight may be expected to take \[bytes\].
pub const MAX_MEMORY_BYTES: u128 = 8 << 30;

/// Memory expected for a vehicle: state, rigid body, two colliders and their places in the engine's and the audit's
/// bounding volumes \[bytes\].
pub const BYTES_PER_VEHICLE: u128 = 4096;

/// Memory expected for an edge: its parameters in the law and its place in the graph \[bytes\].
pub const BYTES_PER_EDGE: u128 = 16;

/// Bytes of a GiB.
const GIB: f64 = (1_u64 << 30) as f64;

/// Refuses a swarm in which nothing can be kept apart.
pub(super) fn check_count(count: usize) -> Result<(), ScenarioError> {
    if count >= 2 {
        return Ok(());
    }
    let vehicles = if count == 1 { "vehicle" } else { "vehicles" };
    Err(ScenarioError::out_of_range(format!("{count} {vehicles} cannot form a formation"))
        .with_help("a swarm has at least 2 vehicles")
        .at("swarm.count"))
}

/// Refuses the first list, by its key and what it holds, that is there and not as long as there are vehicles.
pub(super) fn check_lengths<const N: usize>(
    count: usize,
    lists: [(&'static str, &str, Option<usize>); N],
) -> Result<(), ScenarioError> {
    match lists.into_iter().find(|&(.., length)| length.is_some_and(|length| length != count)) {
        Some((key, what, Some(length))) => Err(ScenarioError::new(format!("{length} {what} for {count} vehicles"))
            .coded("scenario/count-mismatch")
            .with_help("the number of vehicles is swarm.count if given, or else the number of start positions")
            .at_keys([key, "swarm.count"])),
        _ => Ok(()),
    }
}

/// Refuses a swarm that would take more memory than [`MAX_MEMORY_BYTES`].
pub(super) fn check_memory(count: usize, edges: u128) -> Result<(), ScenarioError> {
    let bytes = (count as u128 * BYTES_PER_VEHICLE).saturating_add(edges.saturating_mul(BYTES_PER_EDGE));
    if bytes <= MAX_MEMORY_BYTES {
        return Ok(());
    }
    Err(ScenarioError::new(format!(
        "{count} vehicles with {edges} edges would take {:.1} GiB of memory ({BYTES_PER_VEHICLE} bytes a vehicle, \
         {BYTES_PER_EDGE} bytes an edge); at most {} GiB are used",
        bytes as f64 / GIB,
        MAX_MEMORY_BYTES >> 30
    ))
    .coded("scenario/memory")
    .with_help("fly fewer vehicles, or choose a graph of fewer edges, such as [graph] kind = \"ring\"")
    .at_keys(["swarm.count", "graph.kind"]))
}

/// Number of pairs of `count` vehicles.
pub(super) fn pair_count(count: usize) -> u128 {
    let count = count as u128;
    count * count.saturating_sub(1) / 2
}

/// The next number upwards with four digits, or itself where there is none.
pub(super) fn rounded_up(number: f64) -> f64 {
    let unit = libm::pow(10.0, libm::floor(libm::log10(number)) - 3.0);
    let digits = (number / unit).ceil();
    [digits, digits + 1.0]
        .map(|digits| format!("{:.3e}", digits * unit).parse().unwrap_or(number))
        .into_iter()
        .find(|&rounded| rounded >= number)
        .unwrap_or(number)
}

/// The first vehicle, and the first before it, that are at most `distance_m` apart.
pub(super) fn first_within(rows: &Rows, distance_m: f64) -> Option<(Pair, f64)> {
    let mut spaced = Spaced::new(distance_m);
    (0..rows.nrows()).find_map(|j| spaced.insert(row(rows, j)).err().map(|(i, apart_m)| (Pair::new(i, j), apart_m)))
}

/// Refuses a number that is not finite, or too large to compute with.
pub(super) fn require_finite(what: impl Display, number: f64) -> Result<f64, ScenarioError> {
    if number.abs() <= LARGEST {
        return Ok(number);
    }
    Err(match not_finite(number) {
        Some(shown) => ScenarioError::out_of_range(format!("{what} is {shown}")).with_help("give a finite number"),
        None => ScenarioError::out_of_range(format!("{what} is {number:e}, too large to compute with"))
            .with_help(format!("the most is {LARGEST:e} in either direction")),
    })
}

fn not_finite(number: f64) -> Option<&'static str> {
    (!number.is_finite()).then_some(if number.is_nan() { "not a number" } else { "infinite" })
}
