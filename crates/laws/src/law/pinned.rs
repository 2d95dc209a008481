//! Consensus on slots over links, with a pull to the reference for vehicles that know it (pinned Laplacian).

use nalgebra::Vector3;

use super::consensus::{
    add_laplacian_product, add_received_terms, of_errors_m, of_table, relative_kinetic_energy,
    sum_of_squares_about_mean,
};
use super::error::LawError;
use super::modes::{DelayedLinks, Linear, Mode, ReceivedStateLoop};
use crate::formation::Formation;
use crate::graph::{Graph, Pinning};
use crate::observation::Observation;
use crate::target::Reference;
use tautline_core::swarm::{Rows, Swarm, columns, columns_mut, row, set_row};

/// Gains on errors of position \[1/s^2\] and of velocity \[1/s\].
#[derive(Clone, Copy, Debug)]
pub(super) struct Gains {
    pub(super) position: f64,
    pub(super) velocity: f64,
}

/// Links of a swarm and the vehicles that know the reference. Position errors are `e_i = p_i - h_i`.
#[derive(Clone, Debug)]
pub(super) struct PinnedConsensus {
    pub(super) graph: Graph,
    pub(super) pinning: Pinning,
    /// Scratch: `k e_i + c v_i`, used on graphs with many links.
    pulls: Rows,
}

impl PinnedConsensus {
    pub(super) fn new(graph: &Graph, pinning: Pinning) -> Self {
        Self { graph: graph.clone(), pinning, pulls: Rows::zeros(graph.count()) }
    }

    /// Returns the least eigenvalue of the pinned Laplacian M; 1 for a single vehicle without a reference.
    pub(super) fn connectivity(&self) -> f64 {
        if self.graph.count() == 1 && self.pinning == Pinning::Unpinned {
            return 1.0;
        }
        self.graph.pinned_connectivity(&self.pinning)
    }

    /// Returns the linearized motion about the slots with `gain` times the pinned Laplacian M. A leader follows the
    /// reference with the gains `lead`.
    pub(super) fn linear(&self, gain: Mode, lead: Mode) -> Linear {
        let leads = self.pinning.leader().map(|_| lead);
        let eigenvalues = self.graph.pinned_spectrum(&self.pinning);
        let free = eigenvalues.iter().map(|&eigenvalue| gain.times(eigenvalue)).chain(leads).collect();
        let links = self.delayed_links(&eigenvalues);
        Linear { free, stiffest_contact_mode: None, received: links.map(|links| ReceivedStateLoop { gain, links }) }
    }

    /// Returns the loop over links if own and received terms have the same modes, or on a star.
    fn delayed_links(&self, eigenvalues: &[f64]) -> Option<DelayedLinks> {
        let own = self.graph.pinned_diagonal(&self.pinning);
        let (&first, &last) = (own.first()?, own.last()?);
        if own.iter().all(|&other| other == first) {
            // M = D - A. Without a reference the common motion has the eigenvalue 0 of M.
            let common = (self.pinning == Pinning::Unpinned).then_some(first);
            return Some(DelayedLinks::EqualDegree {
                own: first,
                others: eigenvalues.iter().map(|eigenvalue| first - eigenvalue).chain(common).collect(),
            });
        }
        let (least, most) = (own.iter().copied().fold(first, f64::min), own.iter().copied().fold(last, f64::max));
        let leaves = self.graph.edge_count();
        let is_star = leaves + 1 == self.graph.count()
            && matches!(self.pinning, Pinning::Unpinned | Pinning::All)
            && most - least == (leaves - 1) as f64;
        is_star.then_some(DelayedLinks::Star { hub: most, leaf: least, leaves: leaves as f64 })
    }

    /// Adds to row i `scale` times the sum over neighbours j of `k (e_i - e_j) + c (v_i - v_j)`, plus `scale` times
    /// `k (e_i - r) + c (v_i - r')` if i knows the reference.
    pub(super) fn add_pulls(
        &mut self,
        observation: &Observation<'_>,
        gains: Gains,
        scale: f64,
        sums: &mut Rows,
    ) -> Result<(), LawError> {
        let (slots_m, Gains { position: k, velocity: c }) = (&observation.target.formation.slots_m, gains);
        if let Some(swarm) = observation.shared() {
            let (errors_m, velocities_m_s) = (of_errors_m(&swarm.positions_m, slots_m), columns(&swarm.velocities_m_s));
            let pull = |axis: usize| {
                let (error_m, velocity_m_s) = (&errors_m[axis], velocities_m_s[axis]);
                move |i: usize| k * error_m(i) + c * velocity_m_s[i]
            };
            let pulls = [pull(0), pull(1), pull(2)];
            if self.graph.is_complete() || self.graph.edge_count() <= self.graph.count() {
                add_laplacian_product(&self.graph, &pulls, scale, sums);
            } else {
                // Each row is read at several links, so it is computed once.
                for (pull, column) in pulls.iter().zip(columns_mut(&mut self.pulls)) {
                    column.iter_mut().enumerate().for_each(|(i, kept)| *kept = pull(i));
                }
                add_laplacian_product(&self.graph, &of_table(&self.pulls), scale, sums);
            }
        } else {
            add_received_terms(observation, sums, |i, own, j, received| {
                let error_m = (own.position_m - row(slots_m, i)) - (received.position_m - row(slots_m, j));
                Ok(scale * (k * error_m + c * (own.velocity_m_s - received.velocity_m_s)))
            })?;
        }
        if matches!(self.pinning, Pinning::All | Pinning::Listed(_)) {
            for i in (0..self.graph.count()).filter(|&i| self.pinning.pins(i)) {
                let (error_m, velocity_m_s) = reference_errors(observation, i);
                let sum = row(sums, i) + scale * (k * error_m + c * velocity_m_s);
                set_row(sums, i, sum);
            }
        }
        Ok(())
    }

    /// Replaces the leader's row by its own tracking of the reference, independent of other vehicles.
    pub(super) fn lead(&self, observation: &Observation<'_>, gains: Gains, a22_per_s: f64, command: &mut Rows) {
        if let Some(leader) = self.pinning.leader() {
            let (error_m, velocity_m_s) = reference_errors(observation, leader);
            let back = gains.position * error_m + gains.velocity * velocity_m_s;
            set_row(command, leader, feed_forward_acceleration(&observation.target.reference, a22_per_s) - back);
        }
    }

    /// Returns `e' M e` \[m^2\]: the sum of `|e_i - e_j|^2` over links, plus the sum of `|e_i|^2` over the vehicles
    /// that know the reference. Errors are relative to the reference.
    pub(super) fn stretch_m2(&self, error_m: impl Fn(usize) -> Vector3<f64>) -> f64 {
        let count = self.graph.count();
        let links = if self.graph.is_complete() {
            count as f64 * sum_of_squares_about_mean(count, &error_m)
        } else {
            self.graph.edges().map(|(i, j)| (error_m(i) - error_m(j)).norm_squared()).sum()
        };
        let pinned = (0..count).filter(|&i| self.pinning.pins(i)).map(|i| error_m(i).norm_squared());
        links + pinned.sum::<f64>()
    }

    /// Returns `1/2 sum |v~_i|^2` \[m^2/s^2\]. Velocities v~ are relative to the mean without a reference, to the
    /// leader if there is one, and otherwise to the reference.
    pub(super) fn kinetic_energy(&self, swarm: &Swarm, reference: &Reference) -> f64 {
        let velocity_m_s = match self.pinning {
            Pinning::Unpinned => return relative_kinetic_energy(swarm),
            Pinning::Leader(leader) => row(&swarm.velocities_m_s, leader),
            Pinning::All | Pinning::Listed(_) => reference.velocity_m_s,
        };
        let square = |i: usize| (row(&swarm.velocities_m_s, i) - velocity_m_s).norm_squared();
        0.5 * (0..swarm.count()).map(square).sum::<f64>()
    }
}

/// `p_i - h_i - r` \[m\] and `v_i - r'` \[m/s\].
fn reference_errors(observation: &Observation<'_>, i: usize) -> (Vector3<f64>, Vector3<f64>) {
    let reference = &observation.target.reference;
    let error_m = error_m(&observation.own.positions_m, observation.target.formation, reference.position_m, i);
    (error_m, row(&observation.own.velocities_m_s, i) - reference.velocity_m_s)
}

/// Returns `p_i - h_i - place` \[m\].
pub(super) fn error_m(positions_m: &Rows, formation: &Formation, place_m: Vector3<f64>, i: usize) -> Vector3<f64> {
    row(positions_m, i) - row(&formation.slots_m, i) - place_m
}

/// Returns the acceleration `r'' - a22 r'` \[m/s^2\] that keeps a vehicle on the reference.
pub(super) fn feed_forward_acceleration(reference: &Reference, a22_per_s: f64) -> Vector3<f64> {
    reference.acceleration_m_s2 - a22_per_s * reference.velocity_m_s
}
