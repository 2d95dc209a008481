//! Start positions of shapes and random starts.

use nalgebra::Vector3;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use super::document::StartShape;
use super::error::{ErrorKind, ScenarioError};
use super::spec::Space;
use tautline_core::swarm::{Rows, Swarm, row, set_row};
use tautline_laws::formation::Formation;
use tautline_laws::space::SpacedPoints;

/// Default smallest separation of random positions, as a multiple of delta.
const DEFAULT_SEPARATION: f64 = 1.5;

/// Number of random positions tried for a vehicle before an error.
const TRIES: u32 = 1000;

/// Returns the positions \[m\] of a shape.
pub(super) fn positions(
    shape: &StartShape,
    count: usize,
    space: Space,
    delta_m: f64,
    random: &mut ChaCha8Rng,
) -> Result<Rows, ScenarioError> {
    let formation = match shape {
        StartShape::Line(keys) => Formation::line(count, keys.spacing_m),
        StartShape::Grid(keys) => Formation::grid(count, keys.spacing_m),
        StartShape::Circle(keys) => Formation::circle(count, keys.radius_m),
        StartShape::Sphere(keys) => Formation::sphere(count, keys.radius_m),
        &StartShape::Random { half_extent_m, min_separation_m } => {
            let min_separation_m = min_separation_m.unwrap_or(DEFAULT_SEPARATION * delta_m);
            if min_separation_m <= delta_m {
                let problem =
                    format!("the smallest separation must be more than delta = {delta_m} m, got {min_separation_m} m");
                let help = "enlarge start.min_separation_m or reduce law.delta_m";
                return Err(ErrorKind::WithinDelta.at(&["start.min_separation_m", "law.delta_m"], problem, help));
            }
            return scatter(count, space, half_extent_m, min_separation_m, random);
        }
    };
    Ok(formation.slots_m)
}

/// Adds a uniform offset of at most `jitter_m` along each axis, along z only in space.
pub(super) fn jitter(positions_m: &mut Rows, jitter_m: f64, space: Space, random: &mut ChaCha8Rng) {
    if jitter_m == 0.0 {
        return;
    }
    for i in 0..positions_m.nrows() {
        let moved = row(positions_m, i) + offset(jitter_m, space, random);
        set_row(positions_m, i, moved);
    }
}

/// Puts the vehicles into a uniformly random order, each with its position and velocity.
pub(super) fn shuffle(swarm: &mut Swarm, random: &mut ChaCha8Rng) {
    for last in (1..swarm.count()).rev() {
        let other = below(last as u64 + 1, random);
        swarm.positions_m.swap_rows(last, other);
        swarm.velocities_m_s.swap_rows(last, other);
    }
}

/// Returns uniform positions \[m\], `count` x 3 within `half_extent_m` of the origin along each axis. Positions are
/// drawn in order; each is drawn again until it is at least `min_separation_m` from those before it.
///
/// # Errors
/// [`ScenarioError`] if no position was found for a vehicle in `TRIES` tries.
pub fn scatter(
    count: usize,
    space: Space,
    half_extent_m: f64,
    min_separation_m: f64,
    random: &mut ChaCha8Rng,
) -> Result<Rows, ScenarioError> {
    let mut placed = SpacedPoints::new(min_separation_m);
    let mut positions_m = Rows::zeros(count);
    for i in 0..count {
        let free = (0..TRIES).map(|_| offset(half_extent_m, space, random)).find(|&p| placed.insert(p).is_ok());
        let Some(position) = free else {
            let problem = format!(
                "there is no room for vehicle {} of {count}: {TRIES} random positions were all within \
                 {min_separation_m} m of another",
                i + 1
            );
            let help = "enlarge start.half_extent_m, reduce start.min_separation_m or fly fewer vehicles";
            let keys = ["start.half_extent_m", "start.min_separation_m", "swarm.count"];
            return Err(ErrorKind::NoRoom.at(&keys, problem, help));
        };
        set_row(&mut positions_m, i, position);
    }
    Ok(positions_m)
}

/// Returns a uniform point in the square or cube with half side `half_extent_m` around the origin.
pub fn offset(half_extent_m: f64, space: Space, random: &mut ChaCha8Rng) -> Vector3<f64> {
    let mut along = || half_extent_m * (2.0 * unit(random) - 1.0);
    let (x, y) = (along(), along());
    Vector3::new(x, y, if space == Space::Volume { along() } else { 0.0 })
}

/// Returns the random generator of a seed.
#[must_use]
pub fn random(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

/// Returns a uniform integer below `end`; words that would bias the result are drawn again.
#[expect(clippy::cast_possible_truncation, reason = "it is below a number of vehicles")]
pub(super) fn below(end: u64, random: &mut ChaCha8Rng) -> usize {
    let fair = u64::MAX - u64::MAX % end;
    loop {
        let word = random.next_u64();
        if word < fair {
            return (word % end) as usize;
        }
    }
}

/// Returns a uniform number in \[0, 1), a multiple of 2^-53.
pub(crate) fn unit(random: &mut ChaCha8Rng) -> f64 {
    const SCALE: f64 = 1.0 / (1_u64 << 53) as f64;
    (random.next_u64() >> 11) as f64 * SCALE
}
