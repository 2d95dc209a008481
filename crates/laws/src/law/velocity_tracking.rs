//! Tracking of chosen velocities by accelerations, for laws that choose the velocity of each vehicle.

use super::consensus::check_range;
use super::error::{LawError, ParameterError};
use super::interface::{Capabilities, LawContext, RateQuery, Rates, ReferenceUse};
use crate::observation::Observation;
use tautline_core::swarm::{Rows, row, set_row};

/// Velocity per distance from the target, tracking rate and limit of a law that chooses velocities.
#[derive(Clone, Debug)]
pub(super) struct VelocityTracking {
    /// Chosen velocity per metre of distance from the target \[1/s\].
    k_per_s: f64,
    /// Rate at which the chosen velocity is tracked \[1/s\].
    tracking_per_s: f64,
    /// Largest commanded acceleration \[m/s^2\].
    max_accel_m_s2: f64,
    /// Distance beyond which other vehicles have no effect \[m\].
    pub(super) range_m: f64,
    a22_per_s: f64,
    reference_use: ReferenceUse,
}

impl VelocityTracking {
    /// Returns the tracking with these rates \[1/s\], this limit \[m/s^2\] and this range \[m\].
    ///
    /// # Errors
    /// [`ParameterError`] if some vehicle does not know the reference.
    pub(super) fn new(
        context: &LawContext<'_>,
        [k_per_s, tracking_per_s]: [f64; 2],
        max_accel_m_s2: f64,
        range_m: f64,
    ) -> Result<Self, ParameterError> {
        let (a22_per_s, reference_use) = (context.a22_per_s, ReferenceUse::new(context)?);
        Ok(Self { k_per_s, tracking_per_s, max_accel_m_s2, range_m, a22_per_s, reference_use })
    }

    /// Replaces the chosen velocities V \[m/s\], N x 3, by the commands \[m/s^2\]:
    ///
    /// ```text
    /// u_i = r'' + tracking (V_i - v_i) - a22 v_i,    |u_i| <= max_accel
    /// ```
    pub(super) fn command(&self, observation: &Observation<'_>, chosen: &mut Rows) -> Result<(), LawError> {
        let feed_forward_m_s2 = self.reference_use.feed_forward_m_s2(&observation.target.reference);
        for i in 0..chosen.nrows() {
            let own_m_s = row(&observation.own.velocities_m_s, i);
            let tracked_m_s2 = (row(chosen, i) - own_m_s) * self.tracking_per_s;
            let wanted = feed_forward_m_s2 + tracked_m_s2 - own_m_s * self.a22_per_s;
            set_row(chosen, i, wanted.cap_magnitude(self.max_accel_m_s2));
        }
        check_range(chosen)
    }

    pub(super) fn capabilities(&self) -> Capabilities {
        Capabilities {
            max_command_m_s2: Some(self.max_accel_m_s2),
            sensing_range_m: Some(self.range_m),
            ..self.reference_use.capabilities()
        }
    }

    /// A vehicle without neighbours follows x'' = -tracking (x' + k x). With neighbours in range no bound is known. a22
    /// is compensated, so the common mode does not grow.
    pub(super) fn rates(&self, query: &RateQuery) -> Rates {
        let alone_per_s = self.tracking_per_s.max((self.tracking_per_s * self.k_per_s).sqrt());
        let is_alone = query.nearest_m.is_some_and(|nearest_m| nearest_m > self.range_m);
        Rates { fastest_per_s: is_alone.then_some(alone_per_s), common_mode_per_s: 0.0, ..Rates::unknown(query) }
    }
}
