//! Warnings of a check, and its text.

use serde::Serialize;

use super::{Connectivity, LegCertificate, Preflight, margins};
use crate::shield::TrackingBasis;
use crate::vehicle::Quadrotor;
use tautline_core::coded;
use tautline_core::fact::Coded;
use tautline_core::text;
use tautline_core::text::{at_least, beside_limit, counted, metres, seconds, table};

/// Warning about a scenario.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Warning {
    /// Stable code.
    pub code: Code,
    /// Message with a remedy, one to three sentences.
    pub message: String,
}

coded! {
    /// Kind of a [`Warning`], the most severe first.
    #[derive(PartialOrd, Ord)]
    Code {
        /// Relative velocities are not damped.
        RelativeVelocityUnstable = "relative-velocity-unstable",
        /// The start lies on a line that the law never leaves, but the formation does not.
        StartOnLine = "start-on-line",
        /// The start lies in a plane that the law never leaves, but the formation does not.
        StartInPlane = "start-in-plane",
        /// Even the shortest substep is longer than the law's links require.
        StepTooLong = "step-too-long",
        /// The swarm drifts so far that numbers no longer resolve its positions.
        DriftUnresolved = "drift-unresolved",
        /// The flight ends before its first step.
        EndsAtStart = "ends-at-start",
        /// Slots are nearer than the shield lets vehicles come.
        SlotsTooNear = "slots-too-near",
        /// Slots are nearer than the gap that vehicles under a shield keep by choice.
        SlotsWithinEase = "slots-within-ease",
        /// A delay or command rate is beyond a predicted margin.
        BeyondMargin = "beyond-margin",
        /// No separation is certified.
        NoCertificate = "no-certificate",
        /// The formation can be deformed without changing an edge length to first order.
        NotRigid = "not-rigid",
        /// A flat formation in space: no force resists motion out of its plane to first order.
        FlatFormationInSpace = "flat-formation-in-space",
        /// The law commands accelerations that few vehicles reach.
        ExtremeAcceleration = "extreme-acceleration",
    }
}

impl Code {
    /// Returns whether the warning refuses the flight: the formation cannot be reached, or the flight would be
    /// meaningless.
    #[must_use]
    pub fn refuses(self) -> bool {
        matches!(
            self,
            Self::RelativeVelocityUnstable
                | Self::StartOnLine
                | Self::StartInPlane
                | Self::StepTooLong
                | Self::DriftUnresolved
                | Self::EndsAtStart
                | Self::SlotsTooNear
        )
    }
}

impl std::fmt::Display for Warning {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "warning [{}]: {}", self.code.code(), self.message)
    }
}

/// Formats a rate \[1/s\] with six decimals and sign.
pub(super) fn rate(rate_per_s: f64) -> String {
    // Adding zero removes the sign of -0.
    format!("{:.6}", (rate_per_s * 1e6).round() / 1e6 + 0.0)
}

/// Formats a positive number with three significant digits.
pub(super) fn significant(number: f64) -> String {
    if number == 0.0 || (1e-6..1e6).contains(&number.abs()) {
        text::significant(number, 3)
    } else {
        format!("{number:.2e}")
    }
}

impl Preflight {
    /// Returns the result in one line: `READY: certified never closer than 2.055307 m in continuous time (delta 2 m),
    /// no warnings`, or `REFUSED: start-on-line`.
    #[must_use]
    pub fn headline(&self) -> String {
        let refusing = self.refusing();
        if !refusing.is_empty() {
            return format!("REFUSED: {}", refusing.join(", "));
        }
        let certificate = match (self.certified_m, &self.shield) {
            (Some(certified_m), Some(shield)) => shield.brief(certified_m),
            (Some(certified_m), None) => {
                format!(
                    "certified never closer than {} m in continuous time (delta {} m){}",
                    beside_limit(certified_m, self.delta_m, 6),
                    self.delta_m,
                    match (self.recovers_from_deadlock, self.reassigns) {
                        (true, true) => " unless slots are spread or reassigned",
                        (true, false) => " unless slots are spread",
                        _ => "",
                    }
                )
            }
            (None, _) => "no separation is certified".to_owned(),
        };
        let warnings = match self.warnings.len() {
            0 => "no warnings".to_owned(),
            n => counted(n as u64, "warning", "warnings"),
        };
        format!("READY: {certificate}, {warnings}")
    }

    /// Returns the numbers as a table, one line each.
    #[must_use]
    pub fn text(&self) -> String {
        let mut rows =
            vec![("stability".to_owned(), self.stability_line()), ("certificate".to_owned(), self.certificate_line())];
        rows.extend(self.vehicle.iter().map(|quadrotor| ("vehicle".to_owned(), vehicle_line(quadrotor))));
        rows.extend(
            self.start_clearance_margin_m
                .map(|clearance_margin_m| ("obstacles".to_owned(), self.obstacles_line(clearance_margin_m))),
        );
        rows.extend(self.legs.iter().enumerate().map(|(leg, promise)| (format!("leg {}", leg + 1), leg_line(promise))));
        let rest = [
            ("needs", self.needs_line()),
            ("margins", margins::line(&self.margins).unwrap_or_else(|| self.no_margins().to_owned())),
            ("step", self.step_line()),
            ("recording", self.recording_line()),
            ("start", self.start_line()),
            ("formation", self.formation_line()),
            ("rigidity", self.rigidity_line()),
        ];
        rows.extend(rest.map(|(name, line)| (name.to_owned(), line)));
        rows.extend(self.peak_line().map(|line| ("control".to_owned(), line)));
        rows.extend(self.drift_note.iter().map(|note| ("drift".to_owned(), note.clone())));
        table(rows)
    }

    fn stability_line(&self) -> String {
        let margin = self.velocity_margin_per_s.map_or("unknown".to_owned(), rate);
        format!(
            "margin of relative velocities {margin} 1/s (algebraic connectivity {}{}), growth of the common \
             velocity {} 1/s",
            eigenvalue(self.algebraic_connectivity),
            match self.connectivity_is {
                Connectivity::Solved => "",
                Connectivity::Bound => ", a lower bound: the exact value takes long",
            },
            self.common_mode_rate_per_s
        )
    }

    fn certificate_line(&self) -> String {
        if let (Some(shield), Some(_)) = (&self.shield, self.certified_m) {
            return shield.line();
        }
        let energy = self.energy_initial.map(|energy| format!("E(0) = {energy:.6} m^2/s^2")).unwrap_or_default();
        match self.certified_m {
            Some(certified_m) => {
                let renewal = match (self.recovers_from_deadlock, self.reassigns) {
                    (true, true) => ", renewed when slots are spread or reassigned (deadlock.mode)",
                    (true, false) => ", renewed when slots are spread (deadlock.mode)",
                    _ => "",
                };
                let until = self.certified_until_s.map(|until_s| format!(" until {}", seconds(until_s)));
                format!("{} m{}, from {energy}{renewal}", at_least(certified_m, 6), until.unwrap_or_default())
            }
            None => format!("none. {} {energy}", self.not_certified()).trim_end().to_owned(),
        }
    }

    fn obstacles_line(&self, start_clearance_margin_m: f64) -> String {
        let certified = match self.certified_clearance_margin_m {
            Some(clearance_margin_m) => {
                let beyond = format!("{} m beyond every clearance", at_least(clearance_margin_m, 6));
                let is_assumed = self.shield.as_ref().is_some_and(|shield| shield.basis == TrackingBasis::Assumed);
                if is_assumed {
                    format!("{beyond} if the assumed tracking error holds")
                } else {
                    format!("certified {beyond}")
                }
            }
            None => "not certified".to_owned(),
        };
        format!("{certified}, {} m at the start", at_least(start_clearance_margin_m, 6))
    }

    fn no_margins(&self) -> &'static str {
        if self.shield.is_some() { "unknown under a shield" } else { "unknown for this law, graph and vehicle" }
    }

    fn needs_line(&self) -> String {
        let links = if self.links_all { "links between all pairs" } else { "links along the edges of the graph" };
        std::iter::once(links).chain(self.needs.iter().copied()).collect::<Vec<_>>().join("; ")
    }

    fn step_line(&self) -> String {
        let dt_s = significant(self.dt_s);
        let links = match self.dt_links_s {
            Some(links_s) if links_s < self.dt_s => format!("; the links require at most {} s", significant(links_s)),
            _ => String::new(),
        };
        if let Some(shield) = &self.shield {
            return format!("{dt_s} s, commands are held for {} s", significant(shield.period_s));
        }
        match self.dt_max_s {
            Some(dt_max_s) if dt_max_s >= self.dt_s => format!("{dt_s} s, short enough for the law"),
            Some(dt_max_s) => {
                let down = significant(dt_max_s.max(self.dt_shortest_s));
                let least = if dt_max_s < self.dt_shortest_s {
                    format!(
                        " (time.max_halvings; the law requires {} s at the certified separation, where a flight fails)",
                        significant(dt_max_s)
                    )
                } else {
                    String::new()
                };
                format!("{dt_s} s, divided down to {down} s as the law requires{least}{links}")
            }
            None if self.barrier_m.is_some() => {
                format!("{dt_s} s, divided where a clearance shrinks too fast{links}")
            }
            None => format!("{dt_s} s, the required step depends on the separations{links}"),
        }
    }

    fn recording_line(&self) -> String {
        /// Bytes of a MB.
        const MB: f64 = 1e6;
        let samples = counted(self.samples, "sample", "samples");
        format!("{samples}, {:.1} MB of numbers", self.recording_bytes as f64 / MB)
    }

    fn start_line(&self) -> String {
        format!("{}, nearest pair {} m above delta", flat(self.start_dimension), margin(self.start_margin_m))
    }

    fn formation_line(&self) -> String {
        format!("{}, nearest slots {} m above delta", flat(self.formation_dimension), margin(self.formation_margin_m))
    }

    fn peak_line(&self) -> Option<String> {
        let of_leg = if self.legs.is_empty() { "" } else { " of a leg" };
        self.start_peak_m_s2.map(|peak_m_s2| format!("{} m/s^2 at the start{of_leg}", metres(peak_m_s2)))
    }

    fn rigidity_line(&self) -> String {
        let rank = self.rigidity.rank.map_or("unknown".to_owned(), |rank| rank.to_string());
        let place = |dimensions: usize| {
            let rigidity = self.rigidity.within(dimensions, self.vehicles);
            let said = match rigidity.rigid {
                Some(true) => "rigid",
                Some(false) => "not rigid",
                None => "unknown",
            };
            format!("{said} (needs {})", rigidity.needed)
        };
        let convergence = match self.rigidity.rigid {
            Some(true) if self.controls_distances() && !self.refuses() => ", exponential convergence near the goal",
            Some(false) if self.controls_distances() && !self.refuses() => self.approach(),
            _ => "",
        };
        format!("rank {rank}: in the plane {}, in space {}{convergence}", place(2), place(3))
    }
}

impl Preflight {
    /// Describes the convergence to a formation that is not rigid.
    fn approach(&self) -> &'static str {
        let edges = self.rigidity.edges;
        if self.rigidity.rank == Some(edges) {
            // The lengths are independent: shapes with these lengths are a smooth family with exponential convergence.
            ", exponential convergence of the edges' lengths, which do not fix the shape"
        } else if edges == self.vehicles * self.vehicles.saturating_sub(1) / 2 {
            // The lengths fix the shape, but some motion changes none of them to first order.
            ", algebraic convergence at best"
        } else {
            ", convergence may be slow"
        }
    }
}

/// Describes the model of quadrotors.
fn vehicle_line(quadrotor: &Quadrotor) -> String {
    let model = &quadrotor.model;
    format!(
        "{}, {} kg, hull {} m, thrust to weight {:.2}, attitude at {} Hz; swarm.mass_kg, hull_radius_m and \
         a22_per_s describe points and are not used",
        model.name,
        model.mass_kg,
        model.hull_radius_m,
        model.most_thrust_n() / model.weight_n(),
        quadrotor.attitude_hz
    )
}

fn leg_line(leg: &LegCertificate) -> String {
    let energy = format!("energy at most {:.6} m^2/s^2", leg.energy_bound);
    match leg.certified_m {
        Some(certified_m) => format!("{} m, {energy}", at_least(certified_m, 6)),
        None => energy,
    }
}

fn eigenvalue(number: f64) -> String {
    if number == 0.0 || number >= 1e-2 { format!("{number:.6}") } else { significant(number) }
}

fn flat(dimension: usize) -> &'static str {
    match dimension {
        0 => "in a point",
        1 => "on a line",
        2 => "in a plane",
        _ => "in space",
    }
}

fn margin(margin_m: Option<f64>) -> String {
    margin_m.map_or("-".to_owned(), |margin_m| at_least(margin_m, 6))
}
