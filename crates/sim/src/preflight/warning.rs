//! What stands in the way of a flight.

use serde::Serialize;

use super::{Connectivity, LegPromise, Preflight, margins};
use crate::vehicle::Quadrotor;
use tautline_core::text;
use tautline_core::text::{at_least, counted, seconds, table};

/// Something that stands in the way of a flight.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Warning {
    /// Stable name.
    pub code: Code,
    /// A sentence or two, with the remedy where there is one.
    pub message: String,
}

/// What a [`Warning`] is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Code {
    /// Relative velocities are not damped.
    RelativeVelocityUnstable,
    /// The start lies on a line that the law never leaves, and the formation does not.
    StartOnLine,
    /// The start lies in a plane that the law never leaves, and the formation does not.
    StartInPlane,
    /// Steps cannot be made as short as the law's links ask for.
    StepTooLong,
    /// By the end the swarm has drifted so far that numbers do not tell its positions apart.
    DriftUnresolved,
    /// More delay, or fewer commands, than the formation bears.
    BeyondMargin,
    /// Nothing is certified about separations.
    NoCertificate,
    /// The formation can be bent without changing the length of an edge to first order.
    NotRigid,
    /// A flat formation in space: nothing resists motion out of its flat to first order.
    FlatFormationInSpace,
    /// The swarm's mean velocity grows by itself.
    CommonModeUnstable,
}

impl Code {
    /// Every code, the worst first.
    pub const ALL: [Self; 10] = [
        Self::RelativeVelocityUnstable,
        Self::StartOnLine,
        Self::StartInPlane,
        Self::StepTooLong,
        Self::DriftUnresolved,
        Self::BeyondMargin,
        Self::NoCertificate,
        Self::NotRigid,
        Self::FlatFormationInSpace,
        Self::CommonModeUnstable,
    ];

    /// Whether the flight cannot do what it is for: the formation is out of reach, or nothing may be called stable.
    #[must_use]
    pub fn refuses(self) -> bool {
        matches!(
            self,
            Self::RelativeVelocityUnstable
                | Self::StartOnLine
                | Self::StartInPlane
                | Self::StepTooLong
                | Self::DriftUnresolved
        )
    }

    /// The stable name, such as `start-on-line`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::RelativeVelocityUnstable => "relative-velocity-unstable",
            Self::StartOnLine => "start-on-line",
            Self::StartInPlane => "start-in-plane",
            Self::StepTooLong => "step-too-long",
            Self::DriftUnresolved => "drift-unresolved",
            Self::BeyondMargin => "beyond-margin",
            Self::NoCertificate => "no-certificate",
            Self::NotRigid => "not-rigid",
            Self::FlatFormationInSpace => "flat-formation-in-space",
            Self::CommonModeUnstable => "common-mode-unstable",
        }
    }
}

impl std::fmt::Display for Warning {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "warning [{}]: {}", self.code.name(), self.message)
    }
}

/// A rate \[1/s\] to six decimals, with its sign.
pub(super) fn rate(rate_per_s: f64) -> String {
    // Adding zero takes the sign from what rounds to zero.
    format!("{:.6}", (rate_per_s * 1e6).round() / 1e6 + 0.0)
}

/// A positive number to three significant digits.
pub(super) fn significant(number: f64) -> String {
    if number == 0.0 || (1e-6..1e6).contains(&number.abs()) {
        text::significant(number, 3)
    } else {
        format!("{number:.2e}")
    }
}

impl Preflight {
    /// The check in one line: `READY: certified never closer than 2.055307 m in continuous time (delta 2 m), 2 warnings`,
    /// or `REFUSED: start-on-line`.
    #[must_use]
    pub fn headline(&self) -> String {
        let refusing = self.refusing();
        if !refusing.is_empty() {
            return format!("REFUSED: {}", refusing.join(", "));
        }
        let promise = match self.certified_m {
            Some(certified_m) => {
                format!(
                    "certified never closer than {} m in continuous time (delta {} m){}",
                    at_least(certified_m, 6),
                    self.delta_m,
                    match (self.recovers_from_deadlock, self.reassigns) {
                        (true, true) => " unless slots are spread or assigned anew",
                        (true, false) => " unless slots are spread",
                        _ => "",
                    }
                )
            }
            None => "no separation is certified".to_owned(),
        };
        let warnings = match self.warnings.len() {
            0 => "no warnings".to_owned(),
            n => counted(n as u64, "warning", "warnings"),
        };
        format!("READY: {promise}, {warnings}")
    }

    /// The numbers as a short table, a line each, with a line end.
    #[must_use]
    pub fn text(&self) -> String {
        let mut rows =
            vec![("stability".to_owned(), self.stability_line()), ("certificate".to_owned(), self.certificate_line())];
        rows.extend(self.vehicle.iter().map(|quadrotor| ("vehicle".to_owned(), vehicle_line(quadrotor))));
        rows.extend(self.start_room_m.map(|room_m| ("obstacles".to_owned(), self.obstacles_line(room_m))));
        rows.extend(self.legs.iter().enumerate().map(|(leg, promise)| (format!("leg {}", leg + 1), leg_line(promise))));
        let rest = [
            ("needs", self.needs_line()),
            (
                "margins",
                margins::line(&self.margins).unwrap_or_else(|| "not known for this law, graph and vehicle".to_owned()),
            ),
            ("step", self.step_line()),
            ("recording", self.recording_line()),
            ("start", self.start_line()),
            ("formation", self.formation_line()),
            ("rigidity", self.rigidity_line()),
        ];
        rows.extend(rest.map(|(name, line)| (name.to_owned(), line)));
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
                Connectivity::Bound => ", a bound from below: more takes long",
            },
            self.common_mode_rate_per_s
        )
    }

    fn certificate_line(&self) -> String {
        let energy = self.energy_initial.map(|energy| format!("E(0) = {energy:.6} m^2/s^2")).unwrap_or_default();
        match self.certified_m {
            Some(certified_m) => {
                let renewal = match (self.recovers_from_deadlock, self.reassigns) {
                    (true, true) => ", renewed where slots are spread or assigned anew (deadlock.mode)",
                    (true, false) => ", renewed where slots are spread (deadlock.mode)",
                    _ => "",
                };
                let until = self.certified_until_s.map(|until_s| format!(" until {}", seconds(until_s)));
                format!("{} m{}, from {energy}{renewal}", at_least(certified_m, 6), until.unwrap_or_default())
            }
            None => format!("none. {} {energy}", self.not_certified()).trim_end().to_owned(),
        }
    }

    fn obstacles_line(&self, start_room_m: f64) -> String {
        let certified = match self.certified_room_m {
            Some(room_m) => format!("certified {} m beyond every clearance", at_least(room_m, 6)),
            None => "not certified".to_owned(),
        };
        format!("{certified}, {start_room_m:.6} m at the start")
    }

    fn needs_line(&self) -> String {
        let links =
            if self.links_all { "everybody hears everybody" } else { "neighbours on the graph hear each other" };
        std::iter::once(links).chain(self.needs.iter().copied()).collect::<Vec<_>>().join("; ")
    }

    fn step_line(&self) -> String {
        let dt_s = significant(self.dt_s);
        let links = match self.dt_links_s {
            Some(links_s) if links_s < self.dt_s => format!("; the links ask for {} s at most", significant(links_s)),
            _ => String::new(),
        };
        match self.dt_max_s {
            Some(dt_max_s) if dt_max_s >= self.dt_s => format!("{dt_s} s, short enough for the law"),
            Some(dt_max_s) => {
                let down = significant(dt_max_s.max(self.dt_shortest_s));
                let least = if dt_max_s < self.dt_shortest_s {
                    format!(
                        " (time.max_halvings; as near as is certified it could ask for {}, and a flight that does will not pass)",
                        significant(dt_max_s)
                    )
                } else {
                    String::new()
                };
                format!("{dt_s} s, flown in parts down to {down} s where the law asks for it{least}{links}")
            }
            None if self.barrier_m.is_some() => {
                format!("{dt_s} s, flown in parts where a clearance shrinks too fast{links}")
            }
            None => format!("{dt_s} s, what the law needs depends on how near vehicles come{links}"),
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
    /// How a formation that is not rigid is approached.
    fn approach(&self) -> &'static str {
        let edges = self.rigidity.edges;
        if self.rigidity.rank == Some(edges) {
            // Each length can be set by itself: shapes with the right lengths are a smooth family, approached as such.
            ", exponential convergence of the edges' lengths, which do not fix the shape"
        } else if edges == self.vehicles * self.vehicles.saturating_sub(1) / 2 {
            // All lengths fix the shape, and some motion changes none of them to first order.
            ", algebraic convergence at best"
        } else {
            ", convergence perhaps slow"
        }
    }
}

/// What a quadrotor brings in the place of what describes points.
fn vehicle_line(quadrotor: &Quadrotor) -> String {
    let model = &quadrotor.model;
    format!(
        "{}, {} kg, hull {} m, thrust to weight {:.2}, attitude at {} Hz; swarm.mass_kg, hull_radius_m and a22_per_s describe \
         points and are not used",
        model.name,
        model.mass_kg,
        model.hull_radius_m,
        model.most_thrust_n() / model.weight_n(),
        quadrotor.attitude_hz
    )
}

fn leg_line(promise: &LegPromise) -> String {
    let energy = format!("energy at most {:.6} m^2/s^2", promise.energy_bound);
    match promise.certified_m {
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
    margin_m.map_or("-".to_owned(), |margin_m| format!("{margin_m:.6}"))
}
