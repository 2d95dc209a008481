//! Sums over a graph and over all vehicles, shared by several laws, and checks of their inputs.

use nalgebra::Vector3;

use super::error::LawError;
use super::interface::VelocityMargin;
use crate::graph::Graph;
use crate::observation::{NeighbourState, Observation, OtherStates};
use tautline_core::swarm::{Rows, Swarm, columns, columns_mut, first_row_not_finite, row, set_row};

/// Checks that a state is of `count` vehicles and finite.
pub(super) fn check_state(count: usize, swarm: &Swarm) -> Result<(), LawError> {
    check_rows(count, swarm)?;
    swarm.first_not_finite().map_or(Ok(()), |vehicle| Err(LawError::NotFinite { vehicle }))
}

/// Checks that a state is of `count` vehicles.
pub(super) fn check_rows(count: usize, swarm: &Swarm) -> Result<(), LawError> {
    check_count(count, swarm.positions_m.nrows())?;
    check_count(count, swarm.velocities_m_s.nrows())
}

pub(super) fn check_count(expected: usize, found: usize) -> Result<(), LawError> {
    if expected == found { Ok(()) } else { Err(LawError::WrongCount { expected, found }) }
}

/// Checks that the accelerations computed from a finite state are finite.
pub(super) fn check_range(command: &Rows) -> Result<(), LawError> {
    first_row_not_finite(command).map_or(Ok(()), |_| Err(LawError::OutOfRange))
}

/// Adds `gain L_G X` to `sums`, N x 3. `x[axis](i)` is the entry of X for vehicle i. Row i gains `gain` times the sum
/// of `x_i - x_j` over the neighbours j of i. On the complete graph that sum is `N (x_i - mean x)`, and all rows take
/// O(N).
#[inline]
pub(super) fn add_laplacian_product(graph: &Graph, x: &[impl Fn(usize) -> f64; 3], gain: f64, sums: &mut Rows) {
    let (count, sums) = (graph.count(), columns_mut(sums));
    if graph.is_complete() {
        let mut totals = [0.0; 3];
        for i in 0..count {
            (0..3).for_each(|axis| totals[axis] += x[axis](i));
        }
        let gain = gain * count as f64;
        for ((x, sums), total) in x.iter().zip(sums).zip(totals) {
            let mean = total / count as f64;
            sums.iter_mut().enumerate().for_each(|(i, sum)| *sum += gain * (x(i) - mean));
        }
    } else {
        for i in 0..count {
            let own = [x[0](i), x[1](i), x[2](i)];
            let mut of_own = [sums[0][i], sums[1][i], sums[2][i]];
            for j in graph.later_neighbours(i) {
                for axis in 0..3 {
                    let along = gain * (own[axis] - x[axis](j));
                    of_own[axis] += along;
                    sums[axis][j] -= along;
                }
            }
            (0..3).for_each(|axis| sums[axis][i] = of_own[axis]);
        }
    }
}

/// Returns the columns of a table as functions of the vehicle, for [`add_laplacian_product`].
pub(super) fn of_table(rows: &Rows) -> [impl Fn(usize) -> f64; 3] {
    columns(rows).map(|x| move |i: usize| x[i])
}

/// Returns the position errors `p_i - h_i` along each axis \[m\], for [`add_laplacian_product`].
pub(super) fn of_errors_m(positions_m: &Rows, slots_m: &Rows) -> [impl Fn(usize) -> f64; 3] {
    let ([x, y, z], [slot_x, slot_y, slot_z]) = (columns(positions_m), columns(slots_m));
    [(x, slot_x), (y, slot_y), (z, slot_z)].map(|(coordinate, slot)| move |i: usize| coordinate[i] - slot[i])
}

/// `1/2 sum |v_i - mean v|^2` \[m^2/s^2\].
pub(super) fn relative_kinetic_energy(swarm: &Swarm) -> f64 {
    0.5 * sum_of_squares_about_mean(swarm.count(), |i| row(&swarm.velocities_m_s, i))
}

/// Sum of `|x_i - mean x|^2` over the vehicles.
pub(super) fn sum_of_squares_about_mean(count: usize, x: impl Fn(usize) -> Vector3<f64>) -> f64 {
    let mean = (0..count).map(&x).sum::<Vector3<f64>>() / count.max(1) as f64;
    (0..count).map(|i| (x(i) - mean).norm_squared()).sum()
}

/// Returns the margin of a law that damps relative velocities by g/N times the graph's Laplacian: g lambda2/N - a22.
/// For g < 0 the largest possible eigenvalue N replaces lambda2.
pub(super) fn consensus_margin(count: usize, gain_per_s: f64, connectivity: f64, a22_per_s: f64) -> VelocityMargin {
    let count = count.max(1) as f64;
    let worst = if gain_per_s < 0.0 { count } else { connectivity };
    VelocityMargin {
        per_s: gain_per_s * (worst / count) - a22_per_s,
        terms_per_s: gain_per_s.abs() + a22_per_s.abs(),
        remedy: "Add edges to the graph, or reduce swarm.a22_per_s.",
    }
}

/// Checks that an observation is of `count` vehicles and finite, and that the table of accelerations has `count` rows.
pub(super) fn check_observation(count: usize, observation: &Observation<'_>, command: &Rows) -> Result<(), LawError> {
    check_state(count, observation.own)?;
    check_tables(count, observation, command)
}

/// Checks the sizes as [`check_observation`] does, but does not check a shared state for finite numbers.
pub(super) fn check_tables(count: usize, observation: &Observation<'_>, command: &Rows) -> Result<(), LawError> {
    check_rows(count, observation.own)?;
    if let OtherStates::PerVehicle(held) = observation.others {
        check_state(count, observation.own)?;
        if !held.matches_count(count) {
            return Err(LawError::Pictures { count });
        }
        held.first_not_finite().map_or(Ok(()), |vehicle| Err(LawError::NotFinite { vehicle }))?;
    }
    check_count(count, command.nrows())
}

/// Adds `term(i, own, j, received)` to row i of `sums` for each neighbour j of vehicle i: `own` is the state of i and
/// `received` the state of j that i received.
pub(super) fn add_received_terms(
    observation: &Observation<'_>,
    sums: &mut Rows,
    term: impl Fn(usize, NeighbourState, usize, NeighbourState) -> Result<Vector3<f64>, LawError>,
) -> Result<(), LawError> {
    let own = |i: usize| NeighbourState {
        position_m: row(&observation.own.positions_m, i),
        velocity_m_s: row(&observation.own.velocities_m_s, i),
        age_s: 0.0,
    };
    for (a, b) in observation.links.edges() {
        for (i, j) in [(a, b), (b, a)] {
            let sum = row(sums, i) + term(i, own(i), j, observation.received(i, j))?;
            set_row(sums, i, sum);
        }
    }
    Ok(())
}

/// Adds the push of every near vehicle to the row of each vehicle. `push(i, j, apart_m)` returns the push on i and the
/// potential of the pair for the position of i relative to j \[m\], or `None` out of range. It must be odd in
/// `apart_m`. Returns the sum of the potentials over the near pairs if all vehicles share one state.
pub(super) fn add_pushes(
    observation: &Observation<'_>,
    sums: &mut Rows,
    push: impl Fn(usize, usize, Vector3<f64>) -> Result<Option<(Vector3<f64>, f64)>, LawError>,
) -> Result<Option<f64>, LawError> {
    if let Some(swarm) = observation.shared() {
        let mut potential = 0.0;
        // With shared states the two pushes of a pair are opposite and computed once.
        for &(i, j) in observation.near {
            let apart_m = row(&swarm.positions_m, i) - row(&swarm.positions_m, j);
            if let Some((pushed, of_pair)) = push(i, j, apart_m)? {
                let (of_i, of_j) = (row(sums, i) + pushed, row(sums, j) - pushed);
                set_row(sums, i, of_i);
                set_row(sums, j, of_j);
                potential = (potential + 0.5 * of_pair) + 0.5 * of_pair;
            }
        }
        return Ok(Some(potential));
    }
    for &(a, b) in observation.near {
        for (i, j) in [(a, b), (b, a)] {
            let apart_m = row(&observation.own.positions_m, i) - observation.sensed(i, j).position_m;
            if let Some((pushed, _)) = push(i, j, apart_m)? {
                let sum = row(sums, i) + pushed;
                set_row(sums, i, sum);
            }
        }
    }
    Ok(None)
}
