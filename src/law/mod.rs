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

use crate::swarm::{Pair, Rows, Swarm};

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
        /// The pair.
        pair: Pair,
        /// Its separation \[m\].
        separation_m: f64,
        /// The safety distance delta \[m\].
        delta_m: f64,
    },
    /// A position or velocity is not a finite number.
    #[error("the state of vehicle {} is not a finite number", vehicle + 1)]
    NotFinite {
        /// The vehicle, from 0.
        vehicle: usize,
    },
}
