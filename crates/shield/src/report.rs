//! Numbers of a shielded flight, and whether the assumptions of its certificate held.

use std::fmt;

use serde::{Deserialize, Serialize};
use tautline_core::fact::{Fact, FactKind, Source};
use tautline_core::impl_coded;

use crate::contract::{Heard, Renewed};
use crate::settings::Limits;

/// Smallest change of a command that is counted, in m/s^2 or as a share of the limits of a unicycle.
const CHANGED_M_S2: f64 = 1e-9;

/// Excess of a bound that is rounding, in the unit of the bound. It is half of the margin of a vehicle for rounding.
const ROUNDING: f64 = 2.5e-7;

/// Relative excess of a time that is rounding, as a factor.
pub(crate) const TIME_ROUNDING: f64 = 1.0 + 1e-9;

/// Counters of one vehicle, or of several after [`Counters::merge`]. A share that was never observed is `None`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Counters {
    /// Commands in all.
    pub commands: u64,
    /// Commands that differ from the law's own.
    pub changed: u64,
    /// Changed commands that are the nearest command within the limits of acceleration and speed.
    pub limited: u64,
    /// Commands of the brake.
    pub brakes: u64,
    /// Largest distance from the law's own command \[m/s^2\].
    pub largest_change_m_s2: f64,
    /// Longest sequence of commands of the brake, in periods.
    pub longest_brake: u64,
    /// Length of the present sequence of commands of the brake, in periods.
    pub present_brake: u64,
    /// Proposals that this vehicle accepted.
    pub accepted: u64,
    /// Proposals that this vehicle refused.
    pub refused: u64,
    /// Largest age of a plane of a pair within reach of a period, in periods.
    pub oldest_plane: u64,
    /// Messages that were dropped because they are not messages of a vehicle, for example because they were altered.
    pub invalid_messages: u64,
    /// Messages of vehicles that hold other starts. Each one voids the certificate.
    pub other_starts: u64,
    /// First vehicle that sent the hash of other starts, counted from 0.
    pub other_starts_of: Option<u16>,
    /// Messages to this vehicle from one without an announced start. Each one voids the certificate.
    pub unknown_senders: u64,
    /// Instants without a measurement.
    pub missing_measurements: u64,
    /// Largest distance from a measured position to the reference, over the tube plus the error of measurement.
    pub offset_share: Option<f64>,
    /// Largest command over the largest one that the vehicle carries out.
    pub command_share: Option<f64>,
    /// Largest coordinate of the reserved segment over the largest one that the margin for rounding covers.
    pub coordinate_share: Option<f64>,
    /// Largest distance from the true position to the reference, over the tube.
    pub tracking_share: Option<f64>,
    /// Largest time between two instants over the longest one, or the shortest one over the smallest. Only the timed
    /// calls observe it.
    #[serde(default)]
    pub period_share: Option<f64>,
    /// Largest age of a measurement over its bound. Only the timed calls observe it.
    #[serde(default)]
    pub age_share: Option<f64>,
    /// Largest error of a measured position over its bound.
    pub position_share: Option<f64>,
    /// Largest error of a measured velocity over its bound.
    pub velocity_share: Option<f64>,
}

/// Assumption of a certificate that did not hold in a flight. The certificate is void then.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Exceeded {
    /// A vehicle, counted from 0, sent the hash of other starts.
    OtherStarts(u16),
    /// A vehicle without an announced start has a contract with this one.
    UnknownSender,
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
    /// A time between two instants was out of its range, by this factor.
    Period(f64),
    /// A measurement was older than its bound, by this factor.
    Age(f64),
    /// The reference was farther from the origin than the margin for rounding covers, by this factor.
    Coordinate(f64),
}

impl Exceeded {
    /// Factor by which a bound was exceeded; infinite where the assumption has no bound.
    #[must_use]
    pub fn factor(&self) -> f64 {
        match *self {
            Self::OtherStarts(_) | Self::UnknownSender | Self::MissingMeasurement => f64::INFINITY,
            Self::Measurement(factor)
            | Self::Tube(factor)
            | Self::Offset(factor)
            | Self::Command(factor)
            | Self::Period(factor)
            | Self::Age(factor)
            | Self::Coordinate(factor) => factor,
        }
    }
}

impl_coded! { Exceeded {
    Self::OtherStarts(_) => "other-starts",
    Self::UnknownSender => "unknown-sender",
    Self::MissingMeasurement => "missing-measurement",
    Self::Measurement(_) => "measurement",
    Self::Tube(_) => "tube",
    Self::Offset(_) => "offset",
    Self::Command(_) => "command",
    Self::Period(_) => "period",
    Self::Age(_) => "age",
    Self::Coordinate(_) => "coordinate",
} }

impl fmt::Display for Exceeded {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::OtherStarts(from) => {
                write!(out, "vehicle {} holds other starts than this vehicle", u32::from(*from) + 1)
            }
            Self::UnknownSender => write!(out, "a vehicle without an announced start has a contract with this one"),
            Self::MissingMeasurement => write!(out, "a measurement was missing"),
            Self::Measurement(share) => write!(out, "error of a measurement {share:.3} times its bound"),
            Self::Tube(share) => write!(out, "distance to the reference {share:.3} times the tube"),
            Self::Offset(share) => write!(out, "measured distance to the reference {share:.3} times its bound"),
            Self::Command(share) => write!(out, "command {share:.3} times the largest one"),
            Self::Period(share) => write!(out, "time between two instants {share:.3} times out of its range"),
            Self::Age(share) => write!(out, "age of a measurement {share:.3} times its bound"),
            Self::Coordinate(share) => {
                write!(out, "coordinate {share:.3} times the largest one that the margin for rounding covers")
            }
        }
    }
}

/// Assumption of a certificate, and whether the assumption held so far.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Assumption {
    /// The assumption with its source and value.
    #[serde(flatten)]
    pub fact: Fact,
    /// Largest observed value over the bound; `None` if it was not observed.
    pub share: Option<f64>,
    /// Whether the assumption held so far; `None` if the observations do not decide it.
    pub held: Option<bool>,
}

/// Starts that the partners of a vehicle hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SharedStarts {
    /// Partners that announced a start.
    pub partners: usize,
    /// Partners that sent the hash of the same two starts.
    pub agreed: usize,
    /// Whether one program computed all shields from one list.
    pub is_one_list: bool,
}

impl Assumption {
    /// Assumption that no observation of a shield can confirm.
    pub(crate) fn declared(kind: FactKind, value: f64, unit: &'static str) -> Self {
        Self { fact: Fact::number(kind, Source::Declared, value, unit), share: None, held: None }
    }

    /// Assumption that is observed at the true state, or else refuted by an observation that contradicts it.
    pub(crate) fn observed(
        kind: FactKind,
        (value, unit): (f64, &'static str),
        share: Option<f64>,
        is_refuted: bool,
    ) -> Self {
        let source = if share.is_some() { Source::Observed } else { Source::NotObservable };
        let held = if is_refuted { Some(false) } else { share.map(|share| share <= 1.0) };
        Self { fact: Fact::number(kind, source, value, unit), share, held }
    }

    /// Assumption about times, which the calls with times observe.
    pub(crate) fn timed(kind: FactKind, (value, unit): (f64, &'static str), share: Option<f64>) -> Self {
        match share {
            Some(_) => Self::observed(kind, (value, unit), share, false),
            None => Self::declared(kind, value, unit),
        }
    }

    /// Assumption that the starts of each pair are equal on both sides. The value counts the partners that confirmed
    /// it.
    pub(crate) fn shared_starts(counters: &Counters, starts: SharedStarts) -> Self {
        let is_complete = starts.agreed == starts.partners;
        let source = match (starts.is_one_list, is_complete) {
            (true, _) => Source::Proved,
            (false, true) => Source::Exchanged,
            (false, false) => Source::Declared,
        };
        let is_void = counters.other_starts + counters.unknown_senders > 0;
        let held = if is_void { Some(false) } else { (source != Source::Declared).then_some(true) };
        let fact = Fact::number(FactKind::SharedStarts, source, starts.agreed as f64, "vehicles");
        Self { fact, share: None, held }
    }

    /// Assumption that no message shows. It holds where one program computes all shields: there are no messages of an
    /// earlier flight, and no vehicle returns alone.
    pub(crate) fn of_one_program(kind: FactKind, starts: SharedStarts) -> Self {
        let source = if starts.is_one_list { Source::Proved } else { Source::NotObservable };
        Self { fact: Fact::new(kind, source), share: None, held: starts.is_one_list.then_some(true) }
    }
}

/// Returns the assumptions of a certificate in the order of the theorem.
///
/// An observation can refute each of them. It confirms only the measured quantities. Without a true state the own error
/// of measurement, pushes and the distance to the reference cannot be observed.
pub(crate) fn assumptions(limits: &Limits, counters: &Counters, starts: SharedStarts) -> Vec<Assumption> {
    let settings = limits.settings();
    let is_above = |share: Option<f64>| share.is_some_and(|share| share > 1.0);
    let is_off = is_above(counters.offset_share) || counters.missing_measurements > 0;
    let push = Fact::number(FactKind::Disturbance, Source::NotObservable, settings.disturbance_m_s2, "m/s^2");
    vec![
        Assumption::shared_starts(counters, starts),
        Assumption::of_one_program(FactKind::FlightNumber, starts),
        Assumption::of_one_program(FactKind::SavedContracts, starts),
        Assumption {
            share: counters.command_share,
            held: is_above(counters.command_share).then_some(false),
            ..Assumption::declared(FactKind::Acceleration, settings.accel_m_s2, "m/s^2")
        },
        Assumption { fact: push, share: None, held: None },
        Assumption::observed(FactKind::PositionError, (settings.position_error_m, "m"), counters.position_share, false),
        Assumption::observed(
            FactKind::VelocityError,
            (settings.velocity_error_m_s, "m/s"),
            counters.velocity_share,
            false,
        ),
        Assumption::observed(FactKind::TrackingError, (limits.tube().error_m, "m"), counters.tracking_share, is_off),
        Assumption::timed(FactKind::Period, (limits.times_s()[1], "s"), counters.period_share),
        if settings.measurement_age_s > 0.0 {
            Assumption::timed(FactKind::Age, (settings.measurement_age_s, "s"), counters.age_share)
        } else {
            Assumption::declared(FactKind::Age, settings.measurement_delay_periods as f64, "periods")
        },
        Assumption::observed(FactKind::Coordinates, (limits.farthest_m(), "m"), counters.coordinate_share, false),
    ]
}

impl Counters {
    /// Returns the first assumption that did not hold. The certificate does not cover the flight then.
    #[must_use]
    pub fn exceeded(&self) -> Option<Exceeded> {
        if let Some(from) = self.other_starts_of {
            return Some(Exceeded::OtherStarts(from));
        }
        if self.unknown_senders > 0 {
            return Some(Exceeded::UnknownSender);
        }
        if self.missing_measurements > 0 {
            return Some(Exceeded::MissingMeasurement);
        }
        let shares = [
            (self.period_share, Exceeded::Period as fn(f64) -> Exceeded),
            (self.age_share, Exceeded::Age),
            (self.measurement_share(), Exceeded::Measurement),
            (self.tracking_share, Exceeded::Tube),
            (self.offset_share, Exceeded::Offset),
            (self.command_share, Exceeded::Command),
            (self.coordinate_share, Exceeded::Coordinate),
        ];
        shares.into_iter().find_map(|(share, exceeded)| share.filter(|share| *share > 1.0).map(exceeded))
    }

    /// Adds the numbers of another vehicle, and takes the larger of two extremes.
    pub fn merge(&mut self, other: &Self) {
        self.commands += other.commands;
        self.changed += other.changed;
        self.limited += other.limited;
        self.brakes += other.brakes;
        self.accepted += other.accepted;
        self.refused += other.refused;
        self.invalid_messages += other.invalid_messages;
        self.other_starts += other.other_starts;
        self.other_starts_of = self.other_starts_of.or(other.other_starts_of);
        self.unknown_senders += other.unknown_senders;
        self.missing_measurements += other.missing_measurements;
        self.largest_change_m_s2 = self.largest_change_m_s2.max(other.largest_change_m_s2);
        self.longest_brake = self.longest_brake.max(other.longest_brake);
        self.oldest_plane = self.oldest_plane.max(other.oldest_plane);
        let shares = [
            (&mut self.offset_share, other.offset_share),
            (&mut self.command_share, other.command_share),
            (&mut self.coordinate_share, other.coordinate_share),
            (&mut self.period_share, other.period_share),
            (&mut self.age_share, other.age_share),
            (&mut self.tracking_share, other.tracking_share),
            (&mut self.position_share, other.position_share),
            (&mut self.velocity_share, other.velocity_share),
        ];
        for (share, other) in shares {
            raise(share, other);
        }
    }

    /// Largest error of a measurement over its bound.
    #[must_use]
    pub fn measurement_share(&self) -> Option<f64> {
        let mut share = self.position_share;
        raise(&mut share, self.velocity_share);
        share
    }

    /// Share of commands that differ from the law's own.
    #[must_use]
    pub fn changed_share(&self) -> f64 {
        self.changed as f64 / self.commands.max(1) as f64
    }

    /// Share of commands of the brake.
    #[must_use]
    pub fn brake_share(&self) -> f64 {
        self.brakes as f64 / self.commands.max(1) as f64
    }

    /// Counts a command, with its distance from the law's own one and from the nearest one within the limits
    /// \[m/s^2\].
    pub(crate) fn chosen(&mut self, is_brake: bool, change_m_s2: f64, beyond_limits_m_s2: f64) {
        self.commands += 1;
        let is_changed = change_m_s2 > CHANGED_M_S2;
        self.changed += u64::from(is_changed);
        self.limited += u64::from(is_changed && beyond_limits_m_s2 <= CHANGED_M_S2);
        if is_changed {
            self.largest_change_m_s2 = self.largest_change_m_s2.max(change_m_s2);
        }
        self.brakes += u64::from(is_brake);
        self.present_brake = if is_brake { self.present_brake + 1 } else { 0 };
        self.longest_brake = self.longest_brake.max(self.present_brake);
    }

    pub(crate) fn renewed(&mut self, renewed: Renewed) {
        self.accepted += u64::from(renewed.accepted);
        self.refused += u64::from(renewed.refused);
        self.oldest_plane = self.oldest_plane.max(renewed.oldest);
    }

    pub(crate) fn heard(&mut self, heard: Heard, from: u16) {
        match heard {
            Heard::Stored | Heard::Ignored => (),
            Heard::Invalid => self.invalid_messages += 1,
            Heard::OtherStarts => {
                self.other_starts += 1;
                self.other_starts_of = self.other_starts_of.or(Some(from));
            }
            Heard::Unknown => self.unknown_senders += 1,
        }
    }

    pub(crate) fn missing(&mut self) {
        self.missing_measurements += 1;
    }

    pub(crate) fn measured(&mut self, offset_m: f64, bound_m: f64) {
        raise(&mut self.offset_share, Some(share(offset_m, bound_m)));
    }

    pub(crate) fn commanded(&mut self, command_m_s2: f64, bound_m_s2: f64) {
        raise(&mut self.command_share, Some(share(command_m_s2, bound_m_s2)));
    }

    pub(crate) fn reserved(&mut self, coordinate_m: f64, farthest_m: f64) {
        raise(&mut self.coordinate_share, Some(share(coordinate_m, farthest_m)));
    }

    /// Records a time between two instants and its range \[s\].
    pub(crate) fn elapsed(&mut self, elapsed_s: f64, [shortest_s, longest_s]: [f64; 2]) {
        let late = elapsed_s / (longest_s * TIME_ROUNDING);
        let early = shortest_s / (elapsed_s * TIME_ROUNDING).max(f64::MIN_POSITIVE);
        let share = late.max(early);
        let is_number = elapsed_s.is_finite() && share.is_finite();
        raise(&mut self.period_share, Some(if is_number { share } else { f64::MAX }));
    }

    /// Records an age of a measurement and its bound \[s\].
    pub(crate) fn aged(&mut self, age_s: f64, bound_s: f64) {
        // Without a bound the age has no effect.
        if bound_s > 0.0 {
            let share = if age_s >= 0.0 { age_s / (bound_s * TIME_ROUNDING) } else { f64::MAX };
            raise(&mut self.age_share, Some(share.min(f64::MAX)));
        }
    }

    pub(crate) fn tracked(&mut self, error_m: f64, bound_m: f64) {
        raise(&mut self.tracking_share, Some(share(error_m, bound_m)));
    }

    pub(crate) fn sensed(&mut self, [position_m, velocity_m_s]: [f64; 2], bounds: [f64; 2]) {
        raise(&mut self.position_share, Some(share(position_m, bounds[0])));
        raise(&mut self.velocity_share, Some(share(velocity_m_s, bounds[1])));
    }
}

/// Returns a value over its bound. A value that is not finite exceeds every bound.
fn share(value: f64, bound: f64) -> f64 {
    let share = value / (bound + ROUNDING);
    if share.is_finite() { share } else { f64::MAX }
}

/// Replaces a share by another one that is larger.
fn raise(share: &mut Option<f64>, other: Option<f64>) {
    if other > *share {
        *share = other;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Settings;
    use tautline_core::fact::Coded as _;

    #[test]
    fn counters_add_and_name_the_assumption_that_failed() {
        let mut counters = Counters::default();
        assert_eq!((counters.exceeded(), counters.changed_share()), (None, 0.0));
        counters.chosen(false, 0.5, 0.5);
        counters.chosen(true, 0.0, 0.0);
        counters.chosen(true, 2.0, 2.0);
        counters.chosen(false, 1.0, 0.0);
        counters.renewed(Renewed { accepted: 2, refused: 1, oldest: 7 });
        assert_eq!((counters.changed, counters.limited, counters.brakes, counters.longest_brake), (3, 1, 2, 2));
        assert_eq!((counters.changed_share(), counters.brake_share()), (0.75, 0.5));
        assert_eq!((counters.tracking_share, counters.measurement_share()), (None, None));
        counters.tracked(0.19, 0.19);
        counters.commanded(5.0, 5.0);
        counters.sensed([0.0, 0.0], [0.0, 0.1]);
        assert_eq!((counters.exceeded(), counters.measurement_share()), (None, Some(0.0)));

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
        sensed.sensed([f64::NAN, 0.0], [1.0, 1.0]);
        assert_eq!(sensed.exceeded(), Some(Exceeded::Measurement(f64::MAX)));
        sensed.heard(Heard::Unknown, 9);
        assert_eq!(sensed.exceeded(), Some(Exceeded::UnknownSender));
        sensed.heard(Heard::OtherStarts, 3);
        sensed.heard(Heard::OtherStarts, 2);
        assert_eq!((sensed.exceeded(), sensed.other_starts), (Some(Exceeded::OtherStarts(3)), 2));
        assert_eq!(sensed.exceeded().map(|one| one.code()), Some("other-starts"));
    }

    #[test]
    fn assumptions_are_confirmed_only_by_what_observes_them() {
        let limits = Settings { position_error_m: 0.03, ..Settings::new(1.0, 0.05) }.limits().expect("valid");
        let starts = SharedStarts { partners: 2, agreed: 1, is_one_list: false };
        let mut counters = Counters::default();
        counters.commanded(4.0, 5.0);
        counters.measured(0.01, 0.2);
        counters.reserved(10.0, 1e6);
        let found = |counters: &Counters, starts| {
            let found = assumptions(&limits, counters, starts).into_iter();
            let found = found.map(|one| (one.fact.kind.code(), one.fact.source.code(), one.held));
            found.collect::<Vec<_>>()
        };
        assert_eq!(
            found(&counters, starts),
            [
                ("shared-starts", "declared", None),
                ("flight-number", "not-observable", None),
                ("saved-contracts", "not-observable", None),
                ("acceleration", "declared", None),
                ("disturbance", "not-observable", None),
                ("position-error", "not-observable", None),
                ("velocity-error", "not-observable", None),
                ("tracking-error", "not-observable", None),
                ("period", "declared", None),
                ("age", "declared", None),
                ("coordinates", "observed", Some(true)),
            ]
        );
        let agreed = SharedStarts { agreed: 2, ..starts };
        counters.tracked(0.1, 0.2);
        counters.sensed([0.04, 0.0], [0.03, 0.0]);
        let seen = found(&counters, agreed);
        assert_eq!(seen[0], ("shared-starts", "exchanged", Some(true)));
        assert_eq!(
            seen[5..8],
            [
                ("position-error", "observed", Some(false)),
                ("velocity-error", "observed", Some(true)),
                ("tracking-error", "observed", Some(true)),
            ]
        );
        // A measured distance refutes the tube without the truth.
        counters.measured(0.3, 0.2);
        counters.commanded(6.0, 5.0);
        counters.heard(Heard::OtherStarts, 1);
        let seen = found(&counters, agreed);
        let refuted = [seen[0].2, seen[3].2, seen[7].2];
        assert_eq!(refuted, [Some(false); 3]);
        let one = found(&Counters::default(), SharedStarts { is_one_list: true, ..starts });
        assert_eq!(
            one[..3],
            ["shared-starts", "flight-number", "saved-contracts"].map(|kind| (kind, "proved", Some(true)))
        );
    }
}
