//! Control laws: what acceleration each vehicle asks for, given where all of them are.
//!
//! A law of your own implements [`Law`] and is flown by [`crate::sim::fly`] like the built-in ones
//! (see `examples/own_law.rs`).

mod certificate;
mod edge_tension;
mod kernel;
mod laplacian;
mod tension;

pub use certificate::{Certificate, Void};
pub use edge_tension::{EdgeTensionLaw, EdgeTensionParameters};
pub use laplacian::LaplacianLaw;
pub use tension::{EdgeTension, TensionError};

use nalgebra::Vector3;

use crate::formation::Formation;
use crate::graph::Graph;
use crate::swarm::{Pair, Rows, Swarm, first_row_not_finite, row};

/// A control law: a function from the swarm's state to an acceleration per vehicle.
pub trait Law: Send {
    /// Short name for reports, such as `edge-tension`.
    fn name(&self) -> &'static str;

    /// Writes the commanded accelerations u \[m/s^2\], N x 3, into `control`.
    ///
    /// Called once a step; implementations keep their scratch memory so that nothing is allocated here.
    ///
    /// # Errors
    /// [`LawError`] where the law is not defined, such as a pair at or inside the keep-out distance of a barrier.
    fn control(&mut self, swarm: &Swarm, control: &mut Rows) -> Result<(), LawError>;

    /// The law's Lyapunov function E \[m^2/s^2\] where it has one.
    fn energy(&self, _swarm: &Swarm) -> Option<f64> {
        None
    }

    /// Distance at which the law's barrier is infinite \[m\], where it has a barrier. The loop refuses a step that
    /// takes more than half of some pair's clearance above it.
    fn barrier_m(&self) -> Option<f64> {
        None
    }

    /// What the law promises about separation when started from `start`, before the first step.
    fn certificate(&self, _start: &Swarm) -> Certificate {
        Certificate::void(Void::NoBarrier)
    }
}

/// Why a law has no answer for a state.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum LawError {
    /// A pair is at or inside the distance where its tension is infinite: a collision, not a number to clamp.
    #[error("vehicles {pair} are {separation_m} m apart, not more than the safety distance {delta_m} m")]
    Collision {
        /// The first such pair in index order.
        pair: Pair,
        /// Its separation \[m\].
        separation_m: f64,
        /// The safety distance delta \[m\].
        delta_m: f64,
    },
    /// A position or velocity is not a finite number.
    #[error("the state of vehicle {} is not a finite number", vehicle + 1)]
    NotFinite {
        /// The first such vehicle, from 0.
        vehicle: usize,
    },
    /// The state is finite, but distances, velocities or accelerations computed from it are not.
    #[error("the state of the swarm is too large for double precision")]
    OutOfRange,
    /// The state or the table of accelerations is of another swarm.
    #[error("the law is for {expected} vehicles and was given {found}")]
    WrongCount {
        /// Number of vehicles of the law.
        expected: usize,
        /// Number of vehicles given.
        found: usize,
    },
}

/// Why a law cannot be made from its parameters.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum ParameterError {
    /// An edge has no tension.
    #[error("vehicles {pair}: {source}")]
    Tension {
        /// The first such edge in index order.
        pair: Pair,
        /// What is wrong.
        source: TensionError,
    },
    /// Graph and formation are of different swarms.
    #[error("the graph has {graph} vehicles and the formation has {formation}")]
    Counts {
        /// Number of vehicles of the graph.
        graph: usize,
        /// Number of slots of the formation.
        formation: usize,
    },
    /// A gain is not a finite number.
    #[error("{name} is {value}; it must be a finite number")]
    NotFinite {
        /// The gain, as in the equations.
        name: &'static str,
        /// As given.
        value: f64,
    },
    /// A slot of the formation is not a finite number.
    #[error("the slot of vehicle {} is not a finite number", vehicle + 1)]
    Slot {
        /// The first such vehicle, from 0.
        vehicle: usize,
    },
    /// The edges do not fit in memory.
    #[error("{edges} edges do not fit in memory")]
    Memory {
        /// Number of edges.
        edges: usize,
    },
}

impl ParameterError {
    fn check(graph: &Graph, formation: &Formation, gains: &[(&'static str, f64)]) -> Result<(), Self> {
        if graph.count() != formation.count() {
            return Err(Self::Counts { graph: graph.count(), formation: formation.count() });
        }
        if let Some(vehicle) = first_row_not_finite(&formation.slots_m) {
            return Err(Self::Slot { vehicle });
        }
        match gains.iter().find(|(_, value)| !value.is_finite()) {
            Some(&(name, value)) => Err(Self::NotFinite { name, value }),
            None => Ok(()),
        }
    }
}

/// Whether a state is of `count` vehicles and finite.
fn check_state(count: usize, swarm: &Swarm) -> Result<(), LawError> {
    check_count(count, swarm.positions_m.nrows())?;
    check_count(count, swarm.velocities_m_s.nrows())?;
    swarm.first_not_finite().map_or(Ok(()), |vehicle| Err(LawError::NotFinite { vehicle }))
}

fn check_count(expected: usize, found: usize) -> Result<(), LawError> {
    if expected == found { Ok(()) } else { Err(LawError::WrongCount { expected, found }) }
}

/// Whether the accelerations computed from a finite state are finite.
fn check_range(control: &Rows) -> Result<(), LawError> {
    first_row_not_finite(control).map_or(Ok(()), |_| Err(LawError::OutOfRange))
}

/// Adds `gain L_G X` to `sums`, where X has a row for each vehicle: row i gains `gain` times the sum of `x_i - x_j`
/// over the neighbours j of i. On the complete graph that sum is `N (x_i - mean x)` and takes O(N) for all rows.
fn add_laplacian_product(graph: &Graph, rows: &Rows, gain: f64, sums: &mut Rows) {
    let count = graph.count().max(1);
    for (x, sums) in rows.as_slice().chunks_exact(count).zip(sums.as_mut_slice().chunks_exact_mut(count)) {
        if graph.is_complete() {
            let mean = x.iter().sum::<f64>() / count as f64;
            let gain = gain * count as f64;
            sums.iter_mut().zip(x).for_each(|(sum, x)| *sum += gain * (x - mean));
        } else {
            for (i, j) in graph.edges() {
                let difference = gain * (x[i] - x[j]);
                sums[i] += difference;
                sums[j] -= difference;
            }
        }
    }
}

/// `1/2 sum |v_i - mean v|^2` \[m^2/s^2\].
fn relative_kinetic_energy(swarm: &Swarm) -> f64 {
    0.5 * sum_of_squares_about_mean(swarm.count(), |i| row(&swarm.velocities_m_s, i))
}

/// Sum of `|x_i - mean x|^2` over the vehicles.
fn sum_of_squares_about_mean(count: usize, x: impl Fn(usize) -> Vector3<f64>) -> f64 {
    let mean = (0..count).map(&x).sum::<Vector3<f64>>() / count.max(1) as f64;
    (0..count).map(|i| (x(i) - mean).norm_squared()).sum()
}
