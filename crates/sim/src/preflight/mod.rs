//! Checks a scenario without flying it: stability, certified separation, required step, and whether the formation can
//! be reached.
//!
//! [`Preflight::of`] computes the numbers, and [`Warning`]s describe problems. Its fields are the keys of `tautline
//! check --json`.

mod margins;
mod peak;
mod shield;
mod stability;
mod warning;

use serde::Serialize;

use crate::scenario::{MAX_HALVINGS, PlantSpec, Resolved, Scenario, TimeSpec};
use crate::sim::{Breakdown, Ending, Simulation};
use crate::vehicle::Quadrotor;
use tautline_core::fact::{Coded, serialize_coded};
use tautline_core::swarm::{Rows, Swarm, row, set_row};
use tautline_core::text::at_least;
use tautline_laws::formation::affine_dimension;
use tautline_laws::law::{Controls, Law, LegBound, ParameterError, RateQuery, VelocityMargin, VoidReason};
use tautline_laws::space::{closest_pair, smallest_clearance_margin};

pub use margins::{Bound, ContactState, PredictedMargin};
pub use shield::ShieldCheck;
pub use stability::{FLATNESS, MOST_RANKED, RANK_TOLERANCE, Rigidity};
pub use warning::{Code, Warning};

/// Relative size below which a velocity margin is rounding of eigenvalues, not damping.
const MARGIN_ROUNDING: f64 = 1e-12;

/// Origin of the eigenvalues of a graph.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Connectivity {
    /// All eigenvalues are solved for.
    Solved,
    /// A lower bound replaces an eigenvalue that would take long to solve for.
    Bound,
}

/// Findings of the check of a scenario, in SI units. Values that do not apply or are unknown are null.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Preflight {
    /// Name of the scenario.
    pub scenario: String,
    /// The scenario with every default.
    #[serde(skip)]
    pub resolved: Resolved,
    /// Number of vehicles N.
    pub vehicles: usize,
    /// Number of dimensions: 2 for the plane z = 0, 3 for space.
    pub dimensions: usize,
    /// Safety distance delta \[m\].
    pub delta_m: f64,
    /// Half axes of the ellipsoid that must stay empty around a vehicle \[m\]. Separations are then scaled so that
    /// delta is the width of the ellipsoid.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub half_axes_m: Option<[f64; 3]>,
    /// Second smallest eigenvalue lambda2 of the graph's Laplacian.
    pub algebraic_connectivity: f64,
    /// Origin of this eigenvalue, or of the smallest eigenvalue of the pinned Laplacian.
    pub connectivity_is: Connectivity,
    /// g lambda2/N - a22 \[1/s\] with the law's gain g on velocities, 1 + a22 for the edge tension. For g >= 0,
    /// relative velocities are damped at least at this rate if it is positive, and grow if it is negative. For g < 0,
    /// the largest possible eigenvalue N replaces lambda2.
    pub velocity_margin_per_s: Option<f64>,
    /// Growth rate a22 of the swarm's mean velocity \[1/s\]; negative for decay.
    pub common_mode_rate_per_s: f64,
    /// Energy E(0) of the start \[m^2/s^2\].
    pub energy_initial: Option<f64>,
    /// Certified lower bound of the separation of every pair \[m\].
    pub certified_m: Option<f64>,
    /// Time until which the certificate holds \[s\]; null if it holds forever, or without a certificate. In wind: the
    /// end of the flight, or the time at which the energy that the wind may have added leaves a bound too close to
    /// delta.
    pub certified_until_s: Option<f64>,
    /// Certified lower bound of the distance of every vehicle beyond the clearance of every obstacle \[m\]; only with
    /// obstacles.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub certified_clearance_margin_m: Option<f64>,
    /// Smallest distance of a vehicle beyond the clearance of an obstacle at the start \[m\]; only with obstacles.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub start_clearance_margin_m: Option<f64>,
    /// Certificate of each leg, in order; only for several legs.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub legs: Vec<LegCertificate>,
    /// Whether a stalled swarm may spread its slots, which renews the certificate.
    pub recovers_from_deadlock: bool,
    /// Whether a stalled swarm may reassign interchangeable vehicles, which renews the certificate.
    pub reassigns: bool,
    /// Requirements of the law besides links, such as a sensor, in a few words each.
    pub needs: Vec<&'static str>,
    /// Reasons why no separation is certified, objects with `code` and `text` in JSON.
    #[serde(serialize_with = "serialize_coded")]
    pub certificate_void: Vec<VoidReason>,
    /// Shield of the scenario, whose certificate replaces that of the law.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shield: Option<ShieldCheck>,
    /// Certified lower bound of the separation of pairs joined by an edge \[m\], on a graph that is not complete, if
    /// the energy decays. Other pairs have no bound.
    pub certified_edges_m: Option<f64>,
    /// Distance of the swarm's mean position from the start at the end, due to its own velocity or to rounding \[m\].
    pub drift_m: f64,
    /// Spacing of floating-point numbers there \[m\].
    pub spacing_m: f64,
    /// Time step of the scenario \[s\].
    pub dt_s: f64,
    /// Lower bound of the substeps that the law's fastest rate requires \[s\]; see [`Preflight::of`].
    pub dt_max_s: Option<f64>,
    /// Upper bound of the substeps \[s\]: the step that the links require at any distances.
    pub dt_links_s: Option<f64>,
    /// Delays and command rates that the formation tolerates in linear theory; empty where the theory does not apply.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub margins: Vec<PredictedMargin>,
    /// Number of recorded samples.
    pub samples: u64,
    /// Size of positions, velocities and commands in the recording, which make up most of it \[bytes\].
    pub recording_bytes: u64,
    /// Dimension of the affine hull of the start and its relative velocities: 0 point, 1 line, 2 plane, 3 space.
    pub start_dimension: usize,
    /// Smallest separation at the start minus delta \[m\].
    pub start_margin_m: Option<f64>,
    /// Dimension of the affine hull of the formation.
    pub formation_dimension: usize,
    /// Smallest desired distance minus delta \[m\]; edge tensions exist only if it is positive.
    pub formation_margin_m: Option<f64>,
    /// Infinitesimal rigidity of the formation on its graph, in the space of the swarm.
    pub rigidity: Rigidity,
    /// Largest acceleration that the law commands at the start of a leg \[m/s^2\], with the vehicles at rest on the
    /// slots of the leg before. The peak of the flight is at least this if every leg is reached.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub start_peak_m_s2: Option<f64>,
    /// Note on the growth of the mean velocity, which is no reason for a warning.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub drift_note: Option<String>,
    /// Warnings, the most severe first.
    pub warnings: Vec<Warning>,
    /// Model of quadrotors, which replaces the properties of points.
    #[serde(skip)]
    vehicle: Option<Quadrotor>,
    #[serde(skip)]
    controls: Controls,
    #[serde(skip)]
    links_all: bool,
    #[serde(skip)]
    barrier_m: Option<f64>,
    /// Shortest substep \[s\].
    #[serde(skip)]
    dt_shortest_s: f64,
}

/// Certificate from the beginning of a leg to the beginning of the next.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LegCertificate {
    /// Lower bound of the separation of every pair \[m\].
    pub certified_m: Option<f64>,
    /// Upper bound of the energy \[m^2/s^2\].
    pub energy_bound: f64,
}

impl Preflight {
    /// Checks a scenario.
    ///
    /// # Velocity margin
    /// With v~ = v - mean v and a velocity gain g, the energy obeys dE/dt <= -(g lambda2/N - a22) sum |v~_i|^2 on every
    /// connected graph.
    ///
    /// # Substeps
    /// [`Preflight::dt_max_s`] is [`crate::scenario::TimeSpec::max_rate_dt`] over the fastest rate of the law while no
    /// pair is closer than certified; see [`Rates::fastest_per_s`](tautline_laws::law::Rates::fastest_per_s).
    ///
    /// # Errors
    /// [`ParameterError`] if the parameters give no law; for a validated scenario only if memory cannot be allocated.
    pub fn of(scenario: &Scenario) -> Result<Self, ParameterError> {
        let mut law = scenario.flown_law()?;
        let mut found = Self::with_law(scenario, law.as_ref());
        // The shield limits the commands of the law. Only flights ask an external law for commands.
        if scenario.shield.is_none() && scenario.external_law.is_none() {
            found.start_peak_m_s2 = peak::start_peak_m_s2(scenario, law.as_mut());
        }
        // A flight makes the same start. Only flights ask an external law for commands.
        if scenario.external_law.is_none()
            && let Some(message) = ends_at_start(scenario)
        {
            let place = found.warnings.partition_point(|warning| warning.code < Code::EndsAtStart);
            found.warnings.insert(place, Warning { code: Code::EndsAtStart, message });
        }
        let message = found.start_peak_m_s2.and_then(peak::extreme_acceleration);
        found.warnings.extend(message.map(|message| Warning { code: Code::ExtremeAcceleration, message }));
        Ok(found)
    }

    /// Checks a scenario under another law, which is not asked for a command.
    #[must_use]
    pub fn with_law(scenario: &Scenario, law: &dyn Law) -> Self {
        let certificate = scenario.certificate(law);
        let formation_dimension = scenario.formation().affine_dimension(FLATNESS);
        let connectivity = scenario.graph.algebraic_connectivity();
        let capabilities = law.capabilities();
        let rates = law.rates(&RateQuery {
            a22_per_s: scenario.velocity_coefficient_per_s(),
            // The bounds of a shield are those of delta and clearances, where a law may have no rate.
            nearest_m: certificate.certified_m.filter(|_| scenario.shield.is_none()),
            obstacle_margin_m: certificate.certified_clearance_margin_m.filter(|_| scenario.shield.is_none()),
            connectivity,
        });
        let drift = scenario.drift(rates.common_mode_per_s);
        let scaled = |rows: &Rows| closest_pair(&scenario.metric().scaled_rows(rows));
        let margin = |rows: &Rows| scaled(rows).map(|(_, distance_m)| distance_m - scenario.delta_m);
        let mut found = Self {
            scenario: scenario.name.clone(),
            resolved: scenario.resolved(),
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
            certified_clearance_margin_m: certificate.certified_clearance_margin_m,
            start_clearance_margin_m: smallest_clearance_margin(&scenario.obstacles, &scenario.start.positions_m)
                .map(|(clearance_margin_m, ..)| clearance_margin_m),
            legs: certificate
                .legs
                .iter()
                .map(|&LegBound { energy, certified_m, .. }| LegCertificate { certified_m, energy_bound: energy })
                .collect(),
            recovers_from_deadlock: capabilities.settling.is_some() && scenario.deadlock.is_on(),
            reassigns: capabilities.settling.is_some()
                && scenario.deadlock.is_on()
                && scenario.legs.iter().any(|leg| leg.interchangeable),
            needs: capabilities.needs.to_vec(),
            certificate_void: certificate.void.clone(),
            shield: ShieldCheck::of(scenario),
            certified_edges_m: None,
            drift_m: drift.distance_m,
            spacing_m: drift.spacing_m,
            dt_s: scenario.time.dt_s,
            dt_max_s: rates
                .fastest_per_s
                .map(|rate_per_s| scenario.time.stable_rate_dt() / rate_per_s.hypot(rates.obstacles_per_s2.sqrt())),
            dt_links_s: scenario.links_step_s(law),
            // The tracker of a shield has limits of its own, which validation checks.
            margins: if scenario.shield.is_none() { margins::margins(law, scenario) } else { Vec::new() },
            samples: scenario.time.samples(),
            recording_bytes: scenario.time.samples() * TimeSpec::BYTES_PER_VEHICLE * scenario.count() as u64,
            start_dimension: motion_dimension(&scenario.start),
            start_margin_m: margin(&scenario.start.positions_m),
            formation_dimension,
            formation_margin_m: scenario.legs.iter().filter_map(|leg| margin(&leg.formation.slots_m)).reduce(f64::min),
            rigidity: Rigidity::of(scenario.formation(), &scenario.graph, scenario.space.dimensions()),
            start_peak_m_s2: None,
            drift_note: None,
            warnings: Vec::new(),
            vehicle: scenario.airframe.quadrotor().cloned(),
            controls: capabilities.controls,
            links_all: scenario.graph.is_complete(),
            barrier_m: capabilities.barrier_m,
            dt_shortest_s: scenario.time.dt_s / f64::from(1_u32 << scenario.time.max_halvings.min(MAX_HALVINGS)),
        };
        // The law holds a copy of the graph and has computed the eigenvalues for its rates by now.
        if scenario.graph.connectivity_is_bound() {
            found.connectivity_is = Connectivity::Bound;
        }
        let undamped = relative_velocity_unstable(rates.velocity_margin);
        if scenario.wind.is_still()
            && certificate.void == [VoidReason::GraphNotComplete]
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
            (Code::SlotsTooNear, found.shield.as_ref().and_then(ShieldCheck::slots_too_near)),
            (Code::SlotsWithinEase, found.shield.as_ref().and_then(ShieldCheck::slots_within_ease)),
            (Code::BeyondMargin, margins::exceeded_margin(&found.margins, scenario)),
            (Code::BeyondMargin, margins::lag_in_contact(law, scenario)),
            (Code::NoCertificate, found.no_certificate()),
            (Code::NotRigid, found.not_rigid(scenario)),
            (Code::FlatFormationInSpace, found.flat_formation_in_space()),
        ];
        let said = |(code, message): (Code, Option<String>)| Some(Warning { code, message: message? });
        found.warnings = warnings.into_iter().filter_map(said).collect();
        found.drift_note = found.drift_note(scenario);
        found
    }

    /// Returns the codes of the warnings that refuse the flight ([`Code::refuses`]).
    #[must_use]
    pub fn refusing(&self) -> Vec<&'static str> {
        self.warnings.iter().filter(|warning| warning.code.refuses()).map(|warning| warning.code.code()).collect()
    }

    /// Returns whether some warning refuses the flight.
    #[must_use]
    pub fn refuses(&self) -> bool {
        !self.refusing().is_empty()
    }

    fn controls_distances(&self) -> bool {
        self.controls == Controls::Distances
    }

    /// Returns the dimension of the affine hull of the start if the law cannot leave it but the formation requires it.
    /// A shield turns commands, so vehicles leave it.
    #[must_use]
    pub fn trap_dimension(&self) -> Option<usize> {
        (self.shield.is_none() && self.controls_distances() && self.start_dimension < self.formation_dimension)
            .then_some(self.start_dimension)
    }

    fn start_too_flat(&self) -> Option<String> {
        let (place, flat) = match self.trap_dimension()? {
            0 | 1 => ("on a line", "line"),
            _ => ("in a plane", "plane"),
        };
        Some(format!(
            "The start lies {place}. The law acts along the lines between vehicles, so the swarm never leaves \
             that {flat} and cannot reach the formation. Offset a start, or add start.jitter_m."
        ))
    }

    fn no_certificate(&self) -> Option<String> {
        let said = || format!("No separation is certified. {}", self.not_certified()).trim_end().to_owned();
        self.certified_m.is_none().then(said)
    }

    fn not_rigid(&self, scenario: &Scenario) -> Option<String> {
        // A flat formation is never rigid in space; another warning covers that.
        let rigidity = if self.is_flat_in_space() {
            self.rigidity.within(self.formation_dimension, self.vehicles)
        } else {
            self.rigidity
        };
        let remedy =
            if scenario.graph.is_complete() { "Bend the formation a little." } else { "Add edges to the graph." };
        (self.controls_distances() && rigidity.rigid == Some(false)).then(|| {
            format!(
                "The formation is not rigid on its graph: it has {} of {} independent constraints. Other shapes have \
                 the same edge lengths, or convergence is slow. {remedy}",
                rigidity.rank.map_or("too few".to_owned(), |rank| rank.to_string()),
                rigidity.needed
            )
        })
    }

    fn flat_formation_in_space(&self) -> Option<String> {
        let said = "The formation is flat but the swarm has three dimensions. Near the goal no force resists motion \
                    out of the flat to first order, so this part of the error decays as t^(-1/2). Set \
                    swarm.dimensions to 2 if the swarm may stay in the plane.";
        (self.controls_distances() && self.is_flat_in_space()).then(|| said.to_owned())
    }

    /// Returns the reasons for the missing certificate, and the bound of pairs joined by an edge.
    fn not_certified(&self) -> String {
        let edges = self.certified_edges_m.map(|edges_m| {
            let least = at_least(edges_m, 6);
            format!(
                "The energy decays, so pairs joined by an edge never come closer than {least} m in continuous time."
            )
        });
        self.certificate_void.iter().map(ToString::to_string).chain(edges).collect::<Vec<_>>().join(" ")
    }

    /// Returns whether the formation is flat in space although it has enough vehicles to span it.
    fn is_flat_in_space(&self) -> bool {
        self.dimensions == 3 && self.formation_dimension < 3.min(self.vehicles.saturating_sub(1))
    }
}

/// Returns a warning if even the shortest substep is too long for the law with all vehicles far apart; close vehicles
/// require shorter ones.
fn step_too_long(law: &dyn Law, scenario: &Scenario) -> Option<String> {
    let shortest_s = scenario.time.shortest_step_s();
    let needed_s = scenario.links_step_s(law).filter(|_| scenario.shield.is_none())?;
    (shortest_s > needed_s).then(|| {
        format!(
            "The law's links require steps of {} s, but time.dt_s and time.max_halvings allow at least {} s: the \
             flight would not follow the law. Reduce time.dt_s, add links, or reduce the law's gains.",
            warning::significant(needed_s),
            warning::significant(shortest_s)
        )
    })
}

/// Returns a warning if the flight ends before the end of its first step, with the law's command for the sensed start.
fn ends_at_start(scenario: &Scenario) -> Option<String> {
    // A scenario that cannot be flown at all is refused by its validation.
    let mut simulation = Simulation::new(scenario).ok()?;
    // In continuous time the bend of the first paths is known only after the step.
    if scenario.plant == PlantSpec::Ideal {
        simulation.step();
    }
    let ending = simulation.ending().filter(|_| simulation.steps() == 0)?;
    let remedy = match ending {
        // The reason has a remedy.
        Ending::BrokeDown(Breakdown::Bent { .. }) => "",
        Ending::LawUndefined(error) if error.is_at_barrier() => {
            "Move the vehicles of [start] apart, or reduce law.delta_m or the errors of [sensing]."
        }
        _ => "Reduce the numbers of [start], or the gains of [law].",
    };
    let message = format!("The flight ends at its start: {}. {remedy}", ending.reason()?.trim_end_matches('.'));
    Some(message.trim_end().to_owned())
}

/// Returns the dimension of the affine subspace that forces along the lines between vehicles never leave. It moves with
/// the mean velocity and contains positions and relative velocities, each scaled by its extent.
fn motion_dimension(start: &Swarm) -> usize {
    let count = start.count();
    let mut directions = Rows::zeros(2 * count);
    for (place, rows) in [(0, &start.positions_m), (count, &start.velocities_m_s)] {
        // Relative to the first vehicle: its own row is zero, so that the subspace contains the origin.
        let from_first = |i: usize| row(rows, i) - row(rows, 0);
        let extent = (0..count).map(|i| from_first(i).amax()).fold(0.0, f64::max);
        if extent > 0.0 {
            (0..count).for_each(|i| set_row(&mut directions, place + i, from_first(i) / extent));
        }
    }
    affine_dimension(&directions, FLATNESS)
}

/// Returns a warning if relative velocities are not damped.
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
