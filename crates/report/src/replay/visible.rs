//! Which vehicles are drawn, and when each is absent.

use std::collections::BTreeSet;

use nalgebra::Vector3;

use super::decimate::around_worst;
use super::{LONGEST_NAME, Moment, NoReplay, Stage, base64_bytes, cut};
use crate::flight_log::FlightLog;
use tautline_core::swarm::row;

/// Most vehicles of a replay: a texture of every graphics card has so many columns, and some for slots.
pub const MOST_VEHICLES: usize = 2000;
/// Fewest instants that vehicles are left out for.
const FEWEST_INSTANTS: usize = 50;
/// Farthest coordinate: beyond, single precision draws nothing well \[m\].
const FARTHEST_M: f64 = 1e9;

/// Which vehicles are ever there.
pub(super) fn present(stage: &Stage, log: &FlightLog) -> Result<Vec<usize>, NoReplay> {
    let mut seen = BTreeSet::new();
    for keyframe in log.keyframes() {
        for vehicle in 0..keyframe.positions_m.nrows() {
            let (at, time_s) = (row(&keyframe.positions_m, vehicle), keyframe.time_s);
            if at.iter().any(|x| x.is_finite() && x.abs() > FARTHEST_M) {
                let name = cut(&stage.vehicles[vehicle], LONGEST_NAME);
                return Err(NoReplay::TooFar { name, time_s, farthest_m: FARTHEST_M });
            }
            if at.iter().all(|x| x.is_finite()) {
                seen.insert(vehicle);
            }
        }
    }
    if seen.is_empty() { Err(NoReplay::Empty) } else { Ok(seen.into_iter().collect()) }
}

/// The vehicles that are drawn, in order: of those that are there those of the moments, the weightiest first, and evenly chosen
/// others, as many as there is room for beside an instant of each moment.
pub(super) fn shown(times_s: &[f64], present: &[usize], moments: &[Moment], room_bytes: usize) -> Vec<usize> {
    // Findings have three quarters of the instants.
    let worst: BTreeSet<_> = moments.iter().flat_map(|moment| around_worst(times_s, &moment.span)).collect();
    let instants = times_s.len().min((worst.len() * 3 / 2).max(FEWEST_INSTANTS));
    // A share of the room is for everything else.
    let affordable = room_bytes / 4 * 3 / base64_bytes(12 + 6 * instants);
    let (all, most) = (present.len(), present.len().min(MOST_VEHICLES).min(affordable.max(2)));
    let mut shown = BTreeSet::new();
    let of_moments = moments.iter().flat_map(|moment| moment.vehicles.iter().copied());
    let there = of_moments.filter(|vehicle| present.binary_search(vehicle).is_ok());
    let evenly = (0..most).map(|k| present[k * all / most.max(1)]);
    for vehicle in there.chain(evenly).chain(present.iter().copied()) {
        if shown.len() >= most {
            break;
        }
        shown.insert(vehicle);
    }
    shown.into_iter().collect()
}

/// Where vehicles that are there at an instant and at the one before were not in between: places of instant and vehicle, in
/// order.
pub(super) fn breaks(log: &FlightLog, times_s: &[f64], place: impl Fn(usize) -> Option<usize>) -> Vec<[usize; 2]> {
    let found: BTreeSet<_> = log
        .gaps
        .iter()
        .filter_map(|&(vehicle, [from_s, to_s])| {
            let after = times_s.partition_point(|&time_s| time_s < to_s);
            let is_between = after < times_s.len() && after > 0 && times_s[after - 1] <= from_s;
            Some([after, place(vehicle).filter(|_| is_between)?])
        })
        .collect();
    found.into_iter().collect()
}

/// Place of a vehicle of the weightiest moment at that moment \[m\]: drawing is most precise there.
pub(super) fn place_of_weightiest(log: &FlightLog, moments: &[Moment]) -> Option<Vector3<f64>> {
    let weightiest = moments.iter().find(|moment| !moment.vehicles.is_empty())?;
    let keyframes = log.keyframes();
    let at = keyframes.partition_point(|keyframe| keyframe.time_s < weightiest.span.at_s);
    let positions_m = &keyframes.get(at.min(keyframes.len().checked_sub(1)?))?.positions_m;
    let places = weightiest.vehicles.iter().map(|&vehicle| row(positions_m, vehicle));
    places.into_iter().find(|at| at.iter().all(|x| x.is_finite()))
}
