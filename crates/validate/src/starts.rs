//! Random swarms and shapes, the same on every machine.

use super::interface::Untried;
use tautline_core::swarm::{Swarm, set_row};
use tautline_laws::formation::Formation;
use tautline_sim::scenario::{Scenario, Space, offset, random, scatter};

/// Fewest and most vehicles of a random start.
pub(super) const COUNTS: std::ops::RangeInclusive<usize> = 3..=8;
/// Safety distance \[m\].
pub(super) const DELTA_M: f64 = 1.0;
/// Smallest separation of start positions and of slots over delta: starts may be tight.
const START_SPACING: f64 = 1.05;
const SLOT_SPACING: f64 = 1.2;
/// Half side of the square or cube of start positions over delta, and of that of the slots.
const START_EXTENT: f64 = 4.0;
const SLOT_EXTENT: f64 = 3.0;
/// Largest velocity component \[m/s\] of a moving start.
const SPEED_M_S: f64 = 0.5;

/// So many flights of a random swarm to a random shape: the numbers of vehicles take turns, so do plane and space, and
/// every other start moves.
pub(super) fn random_starts(seed: u64, count: usize, duration_s: f64) -> Result<Vec<Scenario>, Untried> {
    let sizes: Vec<usize> = COUNTS.collect();
    (0..count)
        .map(|trial| {
            let (vehicles, round) = (sizes[trial % sizes.len()], trial / sizes.len());
            let space = if round.is_multiple_of(2) { Space::Plane } else { Space::Volume };
            // A stream of its own for each trial: none depends on how many numbers another one took.
            let mut random = random(seed);
            random.set_stream(trial as u64);
            let mut points =
                |extent: f64, spacing: f64| scatter(vehicles, space, extent * DELTA_M, spacing * DELTA_M, &mut random);
            let formation = Formation::points(points(SLOT_EXTENT, SLOT_SPACING)?);
            let mut swarm = Swarm::at_rest(points(START_EXTENT, START_SPACING)?);
            if (round / 2).is_multiple_of(2) {
                for i in 0..vehicles {
                    set_row(&mut swarm.velocities_m_s, i, offset(SPEED_M_S, space, &mut random));
                }
            }
            Ok(Scenario { space, ..Scenario::new("start", swarm, formation, DELTA_M, duration_s) })
        })
        .collect()
}
