//! Numbers of a shielded flight, and whether the assumptions of its certificate held.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::contract::Renewed;

/// Excess of a bound that is rounding, in the unit of the bound. The margin for rounding covers it twice for each
/// vehicle.
const ROUNDING: f64 = 2.5e-7;

/// Counters of one vehicle, or of several after [`Counters::merge`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Counters {
    /// Commands in all.
    pub commands: u64,
    /// Commands that differ from the law's, after the law's was cut to the limits of acceleration and speed.
    pub changed: u64,
    /// Commands of the brake.
    pub brakes: u64,
    /// Largest change of a command \[m/s^2\].
    pub largest_change_m_s2: f64,
    /// Longest sequence of commands of the brake, in periods.
    pub longest_brake: u64,
    /// Length of the present sequence of commands of the brake.
    #[serde(skip)]
    present_brake: u64,
    /// Proposals that this vehicle accepted.
    pub accepted: u64,
    /// Proposals that this vehicle refused.
    pub refused: u64,
    /// Largest age of a plane of a pair within reach of a period, in periods.
    pub oldest_plane: u64,
    /// Instants without a measurement.
    pub missing_measurements: u64,
    /// Largest distance from a measured position to the reference, over the tube plus the error of measurement.
    pub offset_share: f64,
    /// Largest command over the largest one that the vehicle carries out.
    pub command_share: f64,
    /// Largest distance from the true position to the reference, over the tube; 0 if the truth was not observed.
    pub tracking_share: f64,
    /// Largest error of a measurement over its bound; 0 if the truth was not observed.
    pub measurement_share: f64,
}

/// Assumption of a certificate that did not hold in a flight.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Exceeded {
    /// A measurement was missing.
    MissingMeasurement,
    /// A measurement was farther from the truth than its bound, by this factor.
    Measurement(f64),
    /// A vehicle was farther from its reference than the tube, by this factor.
    Tube(f64),
    /// A measured position was farther from the reference than tube and bound allow, by this factor.
    Offset(f64),
    /// A command was larger than the vehicle carries out, by this factor.
    Command(f64),
}

impl Exceeded {
    /// Factor by which a bound was exceeded; infinite for a missing measurement.
    #[must_use]
    pub fn factor(&self) -> f64 {
        match *self {
            Self::MissingMeasurement => f64::INFINITY,
            Self::Measurement(factor) | Self::Tube(factor) | Self::Offset(factor) | Self::Command(factor) => factor,
        }
    }
}

impl fmt::Display for Exceeded {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::MissingMeasurement => write!(out, "a measurement was missing"),
            Self::Measurement(share) => write!(out, "error of a measurement {share:.3} times its bound"),
            Self::Tube(share) => write!(out, "distance to the reference {share:.3} times the tube"),
            Self::Offset(share) => write!(out, "measured distance to the reference {share:.3} times its bound"),
            Self::Command(share) => write!(out, "command {share:.3} times the largest one"),
        }
    }
}

impl Counters {
    /// Returns the first assumption that did not hold. The certificate does not cover the flight then.
    #[must_use]
    pub fn exceeded(&self) -> Option<Exceeded> {
        if self.missing_measurements > 0 {
            return Some(Exceeded::MissingMeasurement);
        }
        let shares = [
            (self.measurement_share, Exceeded::Measurement as fn(f64) -> Exceeded),
            (self.tracking_share, Exceeded::Tube),
            (self.offset_share, Exceeded::Offset),
            (self.command_share, Exceeded::Command),
        ];
        shares.into_iter().find(|(share, _)| *share > 1.0).map(|(share, exceeded)| exceeded(share))
    }

    /// Adds the numbers of another vehicle, and takes the larger of two extremes.
    pub fn merge(&mut self, other: &Self) {
        self.commands += other.commands;
        self.changed += other.changed;
        self.brakes += other.brakes;
        self.accepted += other.accepted;
        self.refused += other.refused;
        self.missing_measurements += other.missing_measurements;
        self.largest_change_m_s2 = self.largest_change_m_s2.max(other.largest_change_m_s2);
        self.longest_brake = self.longest_brake.max(other.longest_brake);
        self.oldest_plane = self.oldest_plane.max(other.oldest_plane);
        self.offset_share = self.offset_share.max(other.offset_share);
        self.command_share = self.command_share.max(other.command_share);
        self.tracking_share = self.tracking_share.max(other.tracking_share);
        self.measurement_share = self.measurement_share.max(other.measurement_share);
    }

    /// Share of commands that differ from the law's.
    #[must_use]
    pub fn changed_share(&self) -> f64 {
        self.changed as f64 / self.commands.max(1) as f64
    }

    /// Share of commands of the brake.
    #[must_use]
    pub fn brake_share(&self) -> f64 {
        self.brakes as f64 / self.commands.max(1) as f64
    }

    pub(crate) fn chosen(&mut self, is_brake: bool, change_m_s2: f64) {
        self.commands += 1;
        self.changed += u64::from(change_m_s2 > 0.0);
        self.largest_change_m_s2 = self.largest_change_m_s2.max(change_m_s2);
        self.brakes += u64::from(is_brake);
        self.present_brake = if is_brake { self.present_brake + 1 } else { 0 };
        self.longest_brake = self.longest_brake.max(self.present_brake);
    }

    pub(crate) fn renewed(&mut self, renewed: Renewed) {
        self.accepted += u64::from(renewed.accepted);
        self.refused += u64::from(renewed.refused);
        self.oldest_plane = self.oldest_plane.max(renewed.oldest);
    }

    pub(crate) fn missing(&mut self) {
        self.missing_measurements += 1;
    }

    pub(crate) fn measured(&mut self, offset_m: f64, bound_m: f64) {
        self.offset_share = self.offset_share.max(share(offset_m, bound_m));
    }

    pub(crate) fn commanded(&mut self, command_m_s2: f64, bound_m_s2: f64) {
        self.command_share = self.command_share.max(share(command_m_s2, bound_m_s2));
    }

    pub(crate) fn tracked(&mut self, error_m: f64, bound_m: f64) {
        self.tracking_share = self.tracking_share.max(share(error_m, bound_m));
    }

    pub(crate) fn sensed(&mut self, error: f64, bound: f64) {
        self.measurement_share = self.measurement_share.max(share(error, bound));
    }
}

/// Returns a value over its bound. A value that is not a number exceeds every bound.
fn share(value: f64, bound: f64) -> f64 {
    if value.is_nan() { f64::INFINITY } else { value / (bound + ROUNDING) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counters_add_and_name_the_assumption_that_failed() {
        let mut counters = Counters::default();
        assert_eq!((counters.exceeded(), counters.changed_share()), (None, 0.0));
        counters.chosen(false, 0.5);
        counters.chosen(true, 0.0);
        counters.chosen(true, 2.0);
        counters.chosen(false, 0.0);
        counters.renewed(Renewed { accepted: 2, refused: 1, oldest: 7 });
        assert_eq!((counters.changed, counters.brakes, counters.longest_brake), (2, 2, 2));
        assert_eq!((counters.changed_share(), counters.brake_share()), (0.5, 0.5));
        counters.tracked(0.19, 0.19);
        counters.commanded(5.0, 5.0);
        counters.sensed(0.0, 0.0);
        assert_eq!(counters.exceeded(), None);

        let mut all = counters;
        let mut other = Counters::default();
        other.tracked(0.2, 0.1);
        all.merge(&other);
        assert_eq!((all.commands, all.accepted, all.refused, all.oldest_plane), (4, 2, 1, 7));
        assert!(matches!(all.exceeded(), Some(Exceeded::Tube(share)) if share > 1.99));
        assert_eq!(
            all.exceeded().map(|one| one.to_string()).as_deref(),
            Some("distance to the reference 2.000 times the tube")
        );
        other.missing();
        assert_eq!(other.exceeded(), Some(Exceeded::MissingMeasurement));
        let mut sensed = Counters::default();
        sensed.sensed(f64::NAN, 1.0);
        assert_eq!(sensed.exceeded(), Some(Exceeded::Measurement(f64::INFINITY)));
    }
}
