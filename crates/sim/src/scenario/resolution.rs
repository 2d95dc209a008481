//! Certificates of a scenario, limited by the resolution of the plant's numbers.
//!
//! A plant computes positions relative to the centre of the start. A drift of the whole swarm therefore costs digits.
//! Causes are the mean velocity, which no force between vehicles brakes, and rounding, which grows if a22 > 0.

use super::spec::{PlantSpec, Scenario};
use crate::link::ImperfectionSpec;
use tautline_core::swarm::{Rows, mean_row, row};
use tautline_laws::law::{Certificate, Law, VoidReason, certificate_through};
use tautline_laws::target::DeadlockMode;

/// Drift of the whole swarm until the end of the flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drift {
    /// Speed of the mean position at the end \[m/s\].
    pub speed_m_s: f64,
    /// Distance of the mean position from the start at the end \[m\].
    pub distance_m: f64,
    /// Spacing of doubles there \[m\], for the vehicle farthest from the centre.
    pub spacing_m: f64,
}

impl PlantSpec {
    /// Returns whether the plant holds a command over a step; otherwise it evaluates the law in continuous time.
    #[must_use]
    pub fn holds_commands(self) -> bool {
        matches!(self, Self::Rapier)
    }
}

impl Scenario {
    /// Returns the drift for a growth rate \[1/s\] of the mean velocity. The mean velocity starts with a rounding error
    /// of [`f64::EPSILON`] m/s; wind and the reference add to the drift.
    #[must_use]
    pub fn drift(&self, rate_per_s: f64) -> Drift {
        let (epsilon, duration_s) = (f64::EPSILON, self.time.duration_s);
        let seed_m_s = self.start.mean_velocity_m_s().norm() + epsilon;
        let reference_travel_m = self.reference_travel_m(duration_s);
        let gained_s = |per_s: f64| if per_s == 0.0 { duration_s } else { (per_s * duration_s).exp_m1() / per_s };
        let is_held = self.reference.is_some();
        let air_m_s = if is_held { 0.0 } else { self.fastest_wind_m_s() };
        let blown_m_s = self.drag_per_s * air_m_s * gained_s(rate_per_s);
        // Replaces infinity and NaN (0 times infinity) by the largest number: `min` ignores NaN.
        let counted = |value: f64| value.min(f64::MAX);
        let distance_m = counted(reference_travel_m + seed_m_s * gained_s(rate_per_s) + blown_m_s * duration_s);
        let speed_m_s = counted(seed_m_s * (rate_per_s * duration_s).exp() + blown_m_s);
        Drift { speed_m_s, distance_m, spacing_m: epsilon * (self.extent_m() + distance_m) }
    }

    /// Returns the largest distance of the centre of a formation, carried by the reference, from the centre of the
    /// start \[m\].
    fn reference_travel_m(&self, duration_s: f64) -> f64 {
        let Some(guidance) = &self.reference else { return 0.0 };
        let begins_m = guidance.motion.at(0.0).position_m - mean_row(&self.start.positions_m);
        let away_m = self.legs.iter().map(|leg| (mean_row(&leg.formation.slots_m) + begins_m).norm());
        away_m.fold(0.0, f64::max) + guidance.motion.reach_m(duration_s)
    }

    /// Returns the certificate of a law from the start through all legs, void where the scenario violates its
    /// assumptions. A shield replaces it by its own, which holds under any law.
    #[must_use]
    pub fn certificate(&self, law: &dyn Law) -> Certificate {
        if let Some(certificate) = self.shield_certificate() {
            return certificate;
        }
        let ignored = !self.obstacles.is_empty() && !law.capabilities().avoids_obstacles;
        let is_uncounted = !self.wind.is_still() && !law.capabilities().certifies_under_wind;
        self.with_scenario_limits(self.certificate_of_legs(law))
            .void_where(ignored, VoidReason::ObstaclesNotAvoided)
            .void_where(is_uncounted, VoidReason::WindNotCovered)
    }

    /// Certificate of all legs, with the spread slots that a leg begins with under `deadlock.mode = "start"`.
    fn certificate_of_legs(&self, law: &dyn Law) -> Certificate {
        let start = self.observation(&self.start);
        if self.deadlock.mode != DeadlockMode::Start || law.capabilities().settling.is_none() {
            let ahead: Vec<_> = self.legs.iter().skip(1).map(|leg| &leg.formation).collect();
            return certificate_through(law, &start, &ahead);
        }
        let leader = self.reference.as_ref().and_then(|guidance| guidance.known_by.leader());
        let spread: Vec<_> = self.legs.iter().map(|leg| leg.spread(self.deadlock.scale, leader)).collect();
        let ahead: Vec<_> = spread.iter().zip(&self.legs).flat_map(|(spread, leg)| [spread, &leg.formation]).collect();
        let mut certificate = certificate_through(law, &start, &ahead);
        // The bound of a leg is that after its slots have come together.
        certificate.legs = certificate.legs.into_iter().skip(2).step_by(2).collect();
        if self.legs.len() < 2 {
            certificate.legs.clear();
        }
        certificate
    }

    /// Voids a certificate that the scenario does not support: with held commands, imperfections or bodies that are not
    /// points, or if the certified distance cannot be distinguished from delta.
    #[must_use]
    pub fn with_scenario_limits(&self, certificate: Certificate) -> Certificate {
        let of_time = self.time.control_hz.map(|_| VoidReason::CommandsHeld);
        let of_body = (!self.airframe.is_point()).then_some(VoidReason::VehicleNotPoint);
        let of_links = self.imperfections().into_iter().flat_map(ImperfectionSpec::voids);
        let voids = of_time.into_iter().chain(of_links).chain(of_body);
        let certificate = voids.fold(certificate, |certificate, void| certificate.void_where(true, void));
        let unresolved = certificate.certified_m.is_some_and(|certified_m| self.is_unresolved(certified_m));
        certificate.void_where(unresolved, VoidReason::Unresolved)
    }

    /// Returns whether a distance is too close to delta for the resolution of the plant's numbers.
    fn is_unresolved(&self, distance_m: f64) -> bool {
        distance_m - self.delta_m <= self.resolution_m()
    }

    /// Returns the spacing of doubles at the farthest intended position \[m\].
    fn resolution_m(&self) -> f64 {
        f64::EPSILON * (self.extent_m() + self.reference_travel_m(self.time.duration_s))
    }

    /// Returns the smallest reliable distance from delta \[m\].
    pub(super) fn smallest_resolved_m(&self) -> f64 {
        2.0 * self.resolution_m()
    }

    /// Returns the largest distance of a start or a slot from the centre of its swarm \[m\].
    fn extent_m(&self) -> f64 {
        let slots_m = self.legs.iter().map(|leg| extent_m(&leg.formation.slots_m));
        slots_m.fold(extent_m(&self.start.positions_m), f64::max)
    }
}

/// Returns the largest distance of a row from the mean of all rows \[m\].
fn extent_m(rows: &Rows) -> f64 {
    let mean = mean_row(rows);
    (0..rows.nrows()).map(|i| (row(rows, i) - mean).norm()).fold(0.0, f64::max)
}
