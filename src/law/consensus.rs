//! Sums over a graph and over all vehicles that several laws are made of.

use nalgebra::Vector3;

use super::error::LawError;
use super::interface::VelocityMargin;
use crate::graph::Graph;
use crate::observation::{Neighbour, Observation, Others};
use crate::swarm::{Rows, Swarm, first_row_not_finite, row, set_row};

/// Whether a state is of `count` vehicles and finite.
pub(super) fn check_state(count: usize, swarm: &Swarm) -> Result<(), LawError> {
    check_rows(count, swarm)?;
    swarm.first_not_finite().map_or(Ok(()), |vehicle| Err(LawError::NotFinite { vehicle }))
}

/// Whether a state is of `count` vehicles.
pub(super) fn check_rows(count: usize, swarm: &Swarm) -> Result<(), LawError> {
    check_count(count, swarm.positions_m.nrows())?;
    check_count(count, swarm.velocities_m_s.nrows())
}

pub(super) fn check_count(expected: usize, found: usize) -> Result<(), LawError> {
    if expected == found { Ok(()) } else { Err(LawError::WrongCount { expected, found }) }
}

/// Whether the accelerations computed from a finite state are finite.
pub(super) fn check_range(command: &Rows) -> Result<(), LawError> {
    first_row_not_finite(command).map_or(Ok(()), |_| Err(LawError::OutOfRange))
}

/// Adds `gain L_G X` to `sums`, where X has a row for each vehicle: row i gains `gain` times the sum of `x_i - x_j`
/// over the neighbours j of i. On the complete graph that sum is `N (x_i - mean x)` and takes O(N) for all rows.
pub(super) fn add_laplacian_product(graph: &Graph, rows: &Rows, gain: f64, sums: &mut Rows) {
    let count = graph.count();
    let (x, sums) = (rows.as_slice(), sums.as_mut_slice());
    if graph.is_complete() {
        for (x, sums) in x.chunks_exact(count.max(1)).zip(sums.chunks_exact_mut(count.max(1))) {
            let mean = x.iter().sum::<f64>() / count as f64;
            let gain = gain * count as f64;
            sums.iter_mut().zip(x).for_each(|(sum, x)| *sum += gain * (x - mean));
        }
    } else {
        let (x_axis, rest) = x.split_at(count);
        let (y_axis, z_axis) = rest.split_at(count);
        let (x_sums, rest) = sums.split_at_mut(count);
        let (y_sums, z_sums) = rest.split_at_mut(count);
        for i in 0..count {
            let (x, y, z) = (x_axis[i], y_axis[i], z_axis[i]);
            let (mut x_sum, mut y_sum, mut z_sum) = (x_sums[i], y_sums[i], z_sums[i]);
            for j in graph.later_neighbours(i) {
                let [along_x, along_y, along_z] =
                    [gain * (x - x_axis[j]), gain * (y - y_axis[j]), gain * (z - z_axis[j])];
                (x_sum, y_sum, z_sum) = (x_sum + along_x, y_sum + along_y, z_sum + along_z);
                x_sums[j] -= along_x;
                y_sums[j] -= along_y;
                z_sums[j] -= along_z;
            }
            (x_sums[i], y_sums[i], z_sums[i]) = (x_sum, y_sum, z_sum);
        }
    }
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

/// The margin of a law that damps relative velocities by g/N times the graph's Laplacian: g lambda2/N - a22. For g < 0
/// the largest possible eigenvalue N takes the place of lambda2.
pub(super) fn consensus_margin(count: usize, gain_per_s: f64, connectivity: f64, a22_per_s: f64) -> VelocityMargin {
    let count = count.max(1) as f64;
    let worst = if gain_per_s < 0.0 { count } else { connectivity };
    VelocityMargin {
        per_s: gain_per_s * (worst / count) - a22_per_s,
        terms_per_s: gain_per_s.abs() + a22_per_s.abs(),
        remedy: "Add edges to the graph, or reduce swarm.a22_per_s.",
    }
}

/// Whether an observation is of `count` vehicles and finite, and the table of accelerations of as many.
pub(super) fn check_observation(count: usize, at: &Observation<'_>, command: &Rows) -> Result<(), LawError> {
    check_state(count, at.own)?;
    if let Others::Held(held) = at.others {
        if !held.is_of(count) {
            return Err(LawError::Pictures { count });
        }
        held.first_not_finite().map_or(Ok(()), |vehicle| Err(LawError::NotFinite { vehicle }))?;
    }
    check_count(count, command.nrows())
}

/// Adds to row i of `sums` what vehicle i makes of each of its neighbours j, from its own state and from what it heard
/// of j: `term(i, own, j, heard)`.
pub(super) fn add_heard(
    at: &Observation<'_>,
    sums: &mut Rows,
    term: impl Fn(usize, Neighbour, usize, Neighbour) -> Result<Vector3<f64>, LawError>,
) -> Result<(), LawError> {
    let own = |i: usize| Neighbour {
        position_m: row(&at.own.positions_m, i),
        velocity_m_s: row(&at.own.velocities_m_s, i),
        age_s: 0.0,
    };
    for (a, b) in at.links.edges() {
        for (i, j) in [(a, b), (b, a)] {
            let sum = row(sums, i) + term(i, own(i), j, at.heard(i, j))?;
            set_row(sums, i, sum);
        }
    }
    Ok(())
}

/// Adds to the row of each vehicle what it makes of every other that is near, from where it sees itself apart \[m\]:
/// `push(i, j, apart_m)` gives that and the potential of the pair, and the opposite push for the opposite way. The sum of the
/// potentials over the near pairs is the result, where all share one state.
pub(super) fn add_pushes(
    at: &Observation<'_>,
    sums: &mut Rows,
    push: impl Fn(usize, usize, Vector3<f64>) -> Result<(Vector3<f64>, f64), LawError>,
) -> Result<Option<f64>, LawError> {
    if let Some(swarm) = at.shared() {
        let mut potential = 0.0;
        // Two who see each other where they are push each other alike.
        for &(i, j) in at.near {
            let (pushed, of_pair) = push(i, j, row(&swarm.positions_m, i) - row(&swarm.positions_m, j))?;
            let (of_i, of_j) = (row(sums, i) + pushed, row(sums, j) - pushed);
            set_row(sums, i, of_i);
            set_row(sums, j, of_j);
            potential = (potential + 0.5 * of_pair) + 0.5 * of_pair;
        }
        return Ok(Some(potential));
    }
    for &(a, b) in at.near {
        for (i, j) in [(a, b), (b, a)] {
            let (pushed, _) = push(i, j, row(&at.own.positions_m, i) - at.seen(i, j).position_m)?;
            let sum = row(sums, i) + pushed;
            set_row(sums, i, sum);
        }
    }
    Ok(None)
}
