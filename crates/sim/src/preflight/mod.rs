//! What is known before the first step: stability, the certified separation, the step that it asks for, and whether the
//! formation can be reached at all.
//!
//! [`Preflight::of`] computes numbers from a scenario alone, without flying it, and says in [`Warning`]s what stands in
//! the way. Its fields are the keys of `tautline check --json`.

mod margins;
mod stability;
mod warning;

use serde::Serialize;

use crate::scenario::{MAX_HALVINGS, Scenario, TimeSpec};
use crate::vehicle::Quadrotor;
use tautline_core::swarm::{Rows, Swarm, row, set_row};
use tautline_core::text::at_least;
use tautline_laws::formation::affine_dimension;
use tautline_laws::law::{Controls, Law, LegBound, ParameterError, RateQuery, VelocityMargin, Void};
use tautline_laws::space::{closest_pair, least_room};

pub use margins::{Bound, Near, PredictedMargin};
pub use stability::{FLATNESS, MOST_RANKED, RANK_TOLERANCE, Rigidity};
pub use warning::{Code, Warning};

/// A velocity margin up to this part of its two terms is rounding of eigenvalues, not damping.
const MARGIN_ROUNDING: f64 = 1e-12;

/// Where the eigenvalues of a graph come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Connectivity {
    /// They were solved for.
    Solved,
    /// A bound from below stands in for one of them, which would have taken long.
    Bound,
}

/// What is known before the first step. SI units; what does not apply or is not known is null.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Preflight {
    /// Name of the scenario.
    pub scenario: String,
    /// Number of vehicles N.
    pub vehicles: usize,
    /// The space that they live in: 2 the plane z = 0, 3 space.
    pub dimensions: usize,
    /// Safety distance delta \[m\].
    pub delta_m: f64,
    /// Half axes of the ellipsoid that must stay empty around a vehicle \[m\]; distances between vehicles are scaled lengths then, of
    /// which delta is the width of the ellipsoid.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub half_axes_m: Option<[f64; 3]>,
    /// Second smallest eigenvalue lambda2 of the graph's Laplacian.
    pub algebraic_connectivity: f64,
    /// Where it comes from, or the least eigenvalue of the pinned Laplacian.
    pub connectivity_is: Connectivity,
    /// g lambda2/N - a22 \[1/s\] with the law's gain g on velocities, 1 + a22 for the edge tension: for g >= 0 relative
    /// velocities are damped at least at this rate where it is positive, and grow where it is negative. For g < 0 the
    /// largest possible eigenvalue N takes the place of lambda2.
    pub velocity_margin_per_s: Option<f64>,
    /// Rate a22 at which the swarm's mean velocity grows \[1/s\]; negative where it decays.
    pub common_mode_rate_per_s: f64,
    /// Energy E(0) of the start \[m^2/s^2\].
    pub energy_initial: Option<f64>,
    /// Separation below which no pair ever comes \[m\].
    pub certified_m: Option<f64>,
    /// Up to when \[s\]; null where it holds for ever, or nothing is certified. Where a wind blows on it is the end of the flight, or
    /// when what the wind may have added leaves too little to be told from delta.
    pub certified_until_s: Option<f64>,
    /// What every vehicle keeps beyond the clearance of every obstacle \[m\], where there are obstacles.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub certified_room_m: Option<f64>,
    /// The least that a vehicle has beyond the clearance of an obstacle at the start \[m\], where there are obstacles.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub start_room_m: Option<f64>,
    /// The same for each leg of a flight of several, in their order.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub legs: Vec<LegPromise>,
    /// Whether slots may be spread where the swarm is stalled, which renews what is certified.
    pub recovers_from_deadlock: bool,
    /// Whether interchangeable vehicles may be given other slots before that, which renews it too.
    pub reassigns: bool,
    /// What the law needs beside the links, such as a sensor, in a few words each.
    pub needs: Vec<&'static str>,
    /// Why nothing is certified, a sentence each.
    pub certificate_void: Vec<String>,
    /// Separation below which no pair joined by an edge ever comes \[m\], where the graph is not complete, so that no other
    /// pair is kept apart, and the energy decays.
    pub certified_edges_m: Option<f64>,
    /// How far the swarm's mean is carried by the end, by its own velocity or by rounding \[m\].
    pub drift_m: f64,
    /// Distance between neighbouring numbers there \[m\].
    pub spacing_m: f64,
    /// The scenario's step \[s\].
    pub dt_s: f64,
    /// Steps are flown in parts where the law's fastest rate asks for shorter ones: these are at least so long \[s\], see
    /// [`Preflight::of`].
    pub dt_max_s: Option<f64>,
    /// No step is flown in parts longer than this \[s\]: the links alone ask for it, wherever vehicles are.
    pub dt_links_s: Option<f64>,
    /// How late and how seldom the law may be asked near the formation, as linear theory predicts; none where it does not.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub margins: Vec<PredictedMargin>,
    /// Samples that are recorded.
    pub samples: u64,
    /// What their positions, velocities and commands take in the recording, which holds little else \[bytes\].
    pub recording_bytes: u64,
    /// Dimension of the smallest flat that holds the start and its relative velocities: 0 point, 1 line, 2 plane, 3 space.
    pub start_dimension: usize,
    /// Smallest distance of two vehicles at the start, less delta \[m\].
    pub start_margin_m: Option<f64>,
    /// Dimension of the smallest flat that holds the formation.
    pub formation_dimension: usize,
    /// Smallest desired distance, less delta \[m\]: the tension of an edge exists only where it is positive.
    pub formation_margin_m: Option<f64>,
    /// Infinitesimal rigidity of the formation on its graph, in the space that the swarm lives in.
    pub rigidity: Rigidity,
    /// What stands in the way, the worst first.
    pub warnings: Vec<Warning>,
    /// What bodies that turn bring in the place of what describes points.
    #[serde(skip)]
    vehicle: Option<Quadrotor>,
    #[serde(skip)]
    controls: Controls,
    #[serde(skip)]
    links_all: bool,
    #[serde(skip)]
    barrier_m: Option<f64>,
    /// The shortest part that a step may be flown in \[s\].
    #[serde(skip)]
    dt_shortest_s: f64,
}

/// What is certified from the beginning of a leg to the beginning of the next.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LegPromise {
    /// No pair comes closer than this \[m\].
    pub certified_m: Option<f64>,
    /// The energy does not exceed this \[m^2/s^2\].
    pub energy_bound: f64,
}

impl Preflight {
    /// Everything that is known about a scenario before the first step.
    ///
    /// # The velocity margin
    /// With v~ = v - mean v and a velocity gain g the energy obeys dE/dt <= -(g lambda2/N - a22) sum |v~_i|^2 on every
    /// connected graph.
    ///
    /// # The shortest part of a step
    /// [`crate::scenario::TimeSpec::max_rate_dt`] of the inverse of the fastest rate that the law can have while no pair comes nearer than its
    /// certificate says, see [`Rates::fastest_per_s`](tautline_laws::law::Rates::fastest_per_s).
    ///
    /// # Errors
    /// [`ParameterError`] where the scenario's law does not exist, which a validated scenario rules out but for memory.
    pub fn of(scenario: &Scenario) -> Result<Self, ParameterError> {
        Ok(Self::under(scenario, scenario.law()?.as_ref()))
    }

    /// As [`Preflight::of`], under another law than the scenario's.
    #[must_use]
    pub fn under(scenario: &Scenario, law: &dyn Law) -> Self {
        let certificate = scenario.certificate(law);
        let formation_dimension = scenario.formation().affine_dimension(FLATNESS);
        let connectivity = scenario.graph.algebraic_connectivity();
        let capabilities = law.capabilities();
        let rates = law.rates(&RateQuery {
            a22_per_s: scenario.velocity_coefficient_per_s(),
            nearest_m: certificate.certified_m,
            obstacle_room_m: certificate.certified_room_m,
            connectivity,
        });
        let drift = scenario.drift(rates.common_mode_per_s);
        let scaled = |rows: &Rows| closest_pair(&scenario.metric().scaled_rows(rows));
        let margin = |rows: &Rows| scaled(rows).map(|(_, distance_m)| distance_m - scenario.delta_m);
        let mut found = Self {
            scenario: scenario.name.clone(),
            vehicles: scenario.count(),
            dimensions: scenario.space.dimensions(),
            delta_m: scenario.delta_m,
            half_axes_m: scenario.half_axes_m(),
            algebraic_connectivity: connectivity,
            connectivity_is: Connectivity::Solved,
            velocity_margin_per_s: rates.velocity_margin.map(|margin| margin.per_s),
            common_mode_rate_per_s: rates.common_mode_per_s,
            energy_initial: certificate.energy_initial,
            certified_m: certificate.certified_m,
            certified_until_s: certificate.certified_until_s,
            certified_room_m: certificate.certified_room_m,
            start_room_m: least_room(&scenario.obstacles, &scenario.start.positions_m).map(|(room_m, ..)| room_m),
            legs: certificate
                .legs
                .iter()
                .map(|&LegBound { energy, certified_m, .. }| LegPromise { certified_m, energy_bound: energy })
                .collect(),
            recovers_from_deadlock: capabilities.settling.is_some() && scenario.deadlock.is_on(),
            reassigns: capabilities.settling.is_some()
                && scenario.deadlock.is_on()
                && scenario.legs.iter().any(|leg| leg.interchangeable),
            needs: capabilities.needs.to_vec(),
            certificate_void: certificate.void.iter().map(ToString::to_string).collect(),
            certified_edges_m: None,
            drift_m: drift.distance_m,
            spacing_m: drift.spacing_m,
            dt_s: scenario.time.dt_s,
            dt_max_s: rates
                .fastest_per_s
                .map(|rate_per_s| scenario.time.stable_rate_dt() / rate_per_s.hypot(rates.obstacles_per_s2.sqrt())),
            dt_links_s: scenario.links_step_s(law),
            margins: margins::margins(law, scenario),
            samples: scenario.time.samples(),
            recording_bytes: scenario.time.samples() * TimeSpec::BYTES_PER_VEHICLE * scenario.count() as u64,
            start_dimension: motion_dimension(&scenario.start),
            start_margin_m: margin(&scenario.start.positions_m),
            formation_dimension,
            formation_margin_m: scenario.legs.iter().filter_map(|leg| margin(&leg.formation.slots_m)).reduce(f64::min),
            rigidity: Rigidity::of(scenario.formation(), &scenario.graph, scenario.space.dimensions()),
            warnings: Vec::new(),
            vehicle: scenario.airframe.quadrotor().cloned(),
            controls: capabilities.controls,
            links_all: scenario.graph.is_complete(),
            barrier_m: capabilities.barrier_m,
            dt_shortest_s: scenario.time.dt_s / f64::from(1_u32 << scenario.time.max_halvings.min(MAX_HALVINGS)),
        };
        // The law has a copy of the graph, and has asked it for the eigenvalues behind its rates by now.
        if scenario.graph.connectivity_is_bound() {
            found.connectivity_is = Connectivity::Bound;
        }
        let undamped = relative_velocity_unstable(rates.velocity_margin);
        if scenario.wind.is_still()
            && certificate.void == [Void::GraphNotComplete]
            && found.velocity_margin_per_s.is_some()
            && undamped.is_none()
        {
            found.certified_edges_m = certificate.linked_m;
        }
        let trap = if found.trap_dimension() == Some(2) { Code::StartInPlane } else { Code::StartOnLine };
        let warnings = [
            (Code::RelativeVelocityUnstable, undamped),
            (trap, found.start_too_flat()),
            (Code::StepTooLong, step_too_long(law, scenario)),
            (Code::DriftUnresolved, found.drift_unresolved(scenario)),
            (Code::BeyondMargin, margins::beyond(&found.margins, scenario)),
            (Code::NoCertificate, found.no_certificate()),
            (Code::NotRigid, found.not_rigid(scenario)),
            (Code::FlatFormationInSpace, found.flat_formation_in_space()),
            (Code::CommonModeUnstable, found.common_mode_unstable(scenario)),
        ];
        let said = |(code, message): (Code, Option<String>)| Some(Warning { code, message: message? });
        found.warnings = warnings.into_iter().filter_map(said).collect();
        found
    }

    /// Stable names of the warnings that refuse the flight ([`Code::refuses`]).
    #[must_use]
    pub fn refusing(&self) -> Vec<&'static str> {
        self.warnings.iter().filter(|warning| warning.code.refuses()).map(|warning| warning.code.name()).collect()
    }

    /// Whether some warning refuses the flight.
    #[must_use]
    pub fn refuses(&self) -> bool {
        !self.refusing().is_empty()
    }

    fn controls_distances(&self) -> bool {
        self.controls == Controls::Distances
    }

    /// Dimension of the flat that the start never leaves, where the formation does not fit into it.
    #[must_use]
    pub fn trap_dimension(&self) -> Option<usize> {
        (self.controls_distances() && self.start_dimension < self.formation_dimension).then_some(self.start_dimension)
    }

    fn start_too_flat(&self) -> Option<String> {
        let (place, flat) = match self.trap_dimension()? {
            0 | 1 => ("on a line", "line"),
            _ => ("in a plane", "plane"),
        };
        Some(format!(
            "The start lies {place}, the law pushes and pulls along the lines between vehicles, and so they never leave \
             that {flat}: the formation cannot be reached. Offset a start, or add start.jitter_m."
        ))
    }

    fn no_certificate(&self) -> Option<String> {
        let said = || format!("No separation is certified. {}", self.not_certified()).trim_end().to_owned();
        self.certified_m.is_none().then(said)
    }

    fn not_rigid(&self, scenario: &Scenario) -> Option<String> {
        // Out of its own flat a flat formation is never rigid in space, which has a warning of its own.
        let rigidity = if self.is_flat_in_space() {
            self.rigidity.within(self.formation_dimension, self.vehicles)
        } else {
            self.rigidity
        };
        let remedy =
            if scenario.graph.is_complete() { "Bend the formation a little." } else { "Add edges to the graph." };
        (self.controls_distances() && rigidity.rigid == Some(false)).then(|| {
            format!(
                "The formation is not rigid on its graph: {} of {} independent constraints hold it, so other shapes have \
                 the same edges or are approached only slowly. {remedy}",
                rigidity.rank.map_or("too few".to_owned(), |rank| rank.to_string()),
                rigidity.needed
            )
        })
    }

    fn flat_formation_in_space(&self) -> Option<String> {
        let said = "The formation is flat and the swarm lives in space: at the goal nothing resists motion out of the \
                    flat to first order, so that part of the error falls as t^(-1/2), not exponentially. Set \
                    swarm.dimensions to 2 if the swarm may stay in the plane.";
        (self.controls_distances() && self.is_flat_in_space()).then(|| said.to_owned())
    }

    /// Why no separation is certified, and what is in its place.
    fn not_certified(&self) -> String {
        let edges = self.certified_edges_m.map(|edges_m| {
            let least = at_least(edges_m, 6);
            format!(
                "The energy decays, so pairs joined by an edge never come closer than {least} m in continuous time."
            )
        });
        self.certificate_void.iter().cloned().chain(edges).collect::<Vec<_>>().join(" ")
    }

    /// Whether the formation spans less of space than so many vehicles can.
    fn is_flat_in_space(&self) -> bool {
        self.dimensions == 3 && self.formation_dimension < 3.min(self.vehicles.saturating_sub(1))
    }
}

/// Where even the shortest parts of a step are too long for the law with all vehicles far apart: near each other they need be
/// shorter still.
fn step_too_long(law: &dyn Law, scenario: &Scenario) -> Option<String> {
    let shortest_s = scenario.time.shortest_step_s();
    let needed_s = scenario.links_step_s(law)?;
    (shortest_s > needed_s).then(|| {
        format!(
            "The law's links ask for steps of {} s, and the shortest that time.dt_s and time.max_halvings allow are {} s: what would \
             be flown is not the motion of the law. Shorten time.dt_s, add links, or lower the law's gains.",
            warning::significant(needed_s),
            warning::significant(shortest_s)
        )
    })
}

/// Dimension of the flat, moving with the swarm's mean velocity, that forces along the lines between vehicles never
/// leave: that of the positions and the relative velocities together, each by its own extent.
fn motion_dimension(start: &Swarm) -> usize {
    let count = start.count();
    let mut directions = Rows::zeros(2 * count);
    for (place, rows) in [(0, &start.positions_m), (count, &start.velocities_m_s)] {
        // From the first vehicle, whose own row is zero: the flat goes through the origin.
        let from_first = |i: usize| row(rows, i) - row(rows, 0);
        let extent = (0..count).map(|i| from_first(i).amax()).fold(0.0, f64::max);
        if extent > 0.0 {
            (0..count).for_each(|i| set_row(&mut directions, place + i, from_first(i) / extent));
        }
    }
    affine_dimension(&directions, FLATNESS)
}

/// A warning where relative velocities are not damped.
fn relative_velocity_unstable(margin: Option<VelocityMargin>) -> Option<String> {
    let margin = margin?;
    (margin.per_s <= MARGIN_ROUNDING * margin.terms_per_s).then(|| {
        let rate = warning::rate(margin.per_s);
        format!(
            "Relative velocities are not damped: their margin is {rate} 1/s and must be positive. {}",
            margin.remedy
        )
    })
}

#[cfg(test)]
mod tests;
