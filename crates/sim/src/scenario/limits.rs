//! Limits of the numbers, the size and the memory of a scenario.

use super::error::{ErrorKind, ScenarioError};
use tautline_core::swarm::{Pair, Rows, row};
use tautline_laws::space::SpacedPoints;

/// Largest magnitude of a number, in SI units; in metres a million kilometres, where doubles are 0.1 um apart.
pub const LARGEST: f64 = 1e9;

/// Smallest magnitude of a number that must be positive, in SI units.
pub const SMALLEST: f64 = 1e-9;

/// Largest number of steps of a flight. Up to here, the rounding of step number times step times recording rate stays
/// below the tolerance 1e-6 of [`super::TimeSpec::records`]. With steps of 1 us this is a flight of 17 minutes.
pub const MAX_STEPS: f64 = 1e9;

/// Largest number of halvings of a step. Up to here, doubles distinguish the times of substeps to the end of the
/// longest flight.
pub const MAX_HALVINGS: u32 = 20;

/// Distance at which the engine begins to act on two hulls that are about to touch \[m\]. Hulls of vehicles that are
/// delta apart must be farther apart than this.
pub const CONTACT_PREDICTION_M: f64 = 0.02;

/// Smallest relative excess of a desired distance over delta. A smaller excess is rounding, and its tension is too
/// stiff for any step.
pub(super) const SLOT_MARGIN: f64 = 1e-9;

/// Default smallest distance of slots, as a multiple of delta.
pub(super) const DEFAULT_SPACING: f64 = 1.5;

/// Length limit of a name \[characters\].
pub const MAX_NAME_CHARS: usize = 64;

/// Returns whether a name may contain the character.
pub(super) fn is_name_character(c: char) -> bool {
    c.is_ascii_alphanumeric() || c == '-' || c == '_'
}

/// Refuses a name that is not 1 to [`MAX_NAME_CHARS`] letters, digits, `-` and `_`. `what` describes it, `key` is its
/// key.
pub(super) fn check_name(what: &str, name: &str, key: &str) -> Result<(), ScenarioError> {
    let problem = match name.chars().find(|&c| !is_name_character(c)) {
        Some(c) => format!("{what} contains {c:?}"),
        None if name.is_empty() => format!("{what} is empty"),
        None if name.len() > MAX_NAME_CHARS => format!("{what} has {} characters", name.len()),
        None => return Ok(()),
    };
    let help = format!("use 1 to {MAX_NAME_CHARS} letters, digits, `-` and `_`");
    Err(ErrorKind::Name.at(&[key], problem, help))
}

/// Limit of the expected memory of a flight \[bytes\].
pub const MAX_MEMORY_BYTES: u128 = 8 << 30;

/// Expected memory of a vehicle \[bytes\]: state, rigid body, two colliders, and leaves in the bounding volume
/// hierarchies of the engine and the audit.
pub const BYTES_PER_VEHICLE: u128 = 4096;

/// Expected memory of an edge \[bytes\]: its parameters in the law and its entry in the graph.
pub const BYTES_PER_EDGE: u128 = 16;

/// Bytes of a GiB.
const GIB: f64 = (1_u64 << 30) as f64;

/// Refuses a swarm of fewer than two vehicles.
pub(super) fn check_count(count: usize) -> Result<(), ScenarioError> {
    if count >= 2 {
        return Ok(());
    }
    let problem = format!("a swarm needs at least 2 vehicles, got {count}");
    Err(ErrorKind::OutOfRange.at(&["swarm.count"], problem, "add vehicles"))
}

/// Refuses lists whose length is not the number of vehicles. Each list has a key, a description and a length.
pub(super) fn check_lengths<const N: usize>(
    count: usize,
    lists: [(&'static str, &str, Option<usize>); N],
) -> Result<(), ScenarioError> {
    match lists.into_iter().find(|&(.., length)| length.is_some_and(|length| length != count)) {
        Some((key, what, Some(length))) => Err(ErrorKind::CountMismatch.at(
            &[key, "swarm.count"],
            format!("{length} {what} for {count} vehicles"),
            "the number of vehicles is swarm.count if given, or else the number of start positions",
        )),
        _ => Ok(()),
    }
}

/// Refuses a swarm that needs more memory than [`MAX_MEMORY_BYTES`].
pub(super) fn check_memory(count: usize, edges: u128) -> Result<(), ScenarioError> {
    let bytes = (count as u128 * BYTES_PER_VEHICLE).saturating_add(edges.saturating_mul(BYTES_PER_EDGE));
    if bytes <= MAX_MEMORY_BYTES {
        return Ok(());
    }
    let problem = format!(
        "{count} vehicles with {edges} edges would take {:.1} GiB of memory ({BYTES_PER_VEHICLE} bytes a vehicle, \
         {BYTES_PER_EDGE} bytes an edge); at most {} GiB are used",
        bytes as f64 / GIB,
        MAX_MEMORY_BYTES >> 30
    );
    let help = "fly fewer vehicles, or choose a graph of fewer edges, such as [graph] kind = \"ring\"";
    Err(ErrorKind::Memory.at(&["swarm.count", "graph.kind"], problem, help))
}

/// Returns the number of pairs of `count` vehicles.
pub(super) fn pair_count(count: usize) -> u128 {
    let count = count as u128;
    count * count.saturating_sub(1) / 2
}

/// Rounds up to four significant digits; returns the number itself if that overflows.
pub(super) fn rounded_up(number: f64) -> f64 {
    let unit = libm::pow(10.0, libm::floor(libm::log10(number)) - 3.0);
    let digits = (number / unit).ceil();
    [digits, digits + 1.0]
        .map(|digits| format!("{:.3e}", digits * unit).parse().unwrap_or(number))
        .into_iter()
        .find(|&rounded| rounded >= number)
        .unwrap_or(number)
}

/// Returns the first pair of rows that are at most `distance_m` apart, and their distance.
pub(super) fn first_pair_within(rows: &Rows, distance_m: f64) -> Option<(Pair, f64)> {
    let mut spaced = SpacedPoints::new(distance_m);
    (0..rows.nrows()).find_map(|j| spaced.insert(row(rows, j)).err().map(|(i, apart_m)| (Pair::new(i, j), apart_m)))
}
