//! What a report is made of.

use serde::{Deserialize, Serialize};

use super::failures::FailedVehicle;
use super::hulls::Hulls;
use super::network::Network;
use super::strain::VehicleNumbers;
use tautline_audit::{AuditOutcome, ClearanceOutcome, Status};
use tautline_core::record::{Breath, EnergyRise, Reassignment};
use tautline_laws::law::Certificate;
use tautline_laws::target::Arrival;
use tautline_sim::metrics::{LegSummary, Summary};

/// Everything that a report is made of.
#[derive(Clone, Copy, Debug)]
pub struct Findings<'a> {
    /// Name of the scenario.
    pub scenario_name: &'a str,
    /// SHA-256 of the resolved scenario, 64 hexadecimal digits.
    pub scenario_sha256: &'a str,
    /// Safety distance delta that was judged by \[m\].
    pub delta_m: f64,
    /// Half axes of the ellipsoid that must stay empty around a vehicle \[m\], of which delta is the width; none for a ball.
    pub half_axes_m: Option<[f64; 3]>,
    /// What counted as reached.
    pub judge: Arrival,
    /// Dimension of the flat that the start never leaves, where the formation does not fit into it: 0 point, 1 line,
    /// 2 plane.
    pub trap_dimension: Option<usize>,
    /// Dimension of the smallest flat that holds the formation.
    pub formation_dimension: usize,
    /// Stable names of what refused the flight before the first step, such as `start-on-line`.
    pub refused: &'a [&'static str],
    /// What the law promised.
    pub certificate: &'a Certificate,
    /// What the judge found.
    pub audit: &'a AuditOutcome,
    /// What it found in metres where lengths were scaled.
    pub in_metres: Option<&'a AuditOutcome>,
    /// What it found of the ways past obstacles, where there are any, and the names of these.
    pub clearance: Option<&'a ClearanceOutcome>,
    /// Names of the obstacles, in the order of the scenario.
    pub obstacles: &'a [String],
    /// Pairs whose keep-out balls the engine's own collision detection saw overlap; none for a plant without one.
    pub engine_contact_pairs: Option<u64>,
    /// What solid hulls did, or would have done.
    pub hulls: &'a Hulls,
    /// What was asked of bodies that turn.
    pub vehicle: Option<&'a VehicleNumbers>,
    /// What became of messages, where they were sent one by one.
    pub network: Option<Network>,
    /// Vehicles of which a part failed before the flight ended.
    pub failures: &'a [FailedVehicle],
    /// Whether something holds against commands, so that vehicles that are commanded may be at rest: wind, for one.
    pub is_disturbed: bool,
    /// Numbers of the samples.
    pub summary: &'a Summary,
    /// Number of legs that were asked for.
    pub legs: usize,
    /// Those that another one followed.
    pub ended_legs: &'a [LegSummary],
    /// Every time that slots were spread.
    pub breaths: &'a [Breath],
    /// Every time that interchangeable vehicles were given other slots.
    pub assignments: &'a [Reassignment],
    /// By how much the energy rose between two changes of the target, at most.
    pub energy_rise: Option<EnergyRise>,
    /// Whether the law's energy is proved never to grow in this flight.
    pub energy_falls: bool,
    /// Facts of the run.
    pub run: &'a Run,
    /// Wall-clock times.
    pub performance: Performance,
}

impl Findings<'_> {
    /// Returns the verdict on vehicles and obstacles together over the whole flight: never clear where the flight ended early.
    pub(super) fn status(&self) -> Status {
        let of_obstacles = self.clearance.map_or(Status::Clear, |clearance| clearance.status);
        let of_the_rest = if self.run.ended_early.is_some() { Status::Undecided } else { Status::Clear };
        self.audit.status.and(of_obstacles).and(of_the_rest)
    }

    /// Returns when the last formation was reached \[s\], where it was kept to the end of a flight that was flown to its end.
    pub(super) fn reached_at_s(&self) -> Option<f64> {
        self.summary.reached_at_s.filter(|_| self.run.ended_early.is_none())
    }
}

/// Why a run ended that its user stopped.
pub const INTERRUPTED: &str = "interrupted";

/// Facts of the run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// Time flown \[s\].
    pub duration_s: f64,
    /// Control and physics step \[s\].
    pub dt_s: f64,
    /// Steps flown.
    pub steps: u64,
    /// Those of them that were flown in parts, for a law too fast for them or vehicles too near each other.
    #[serde(default)]
    pub refined_steps: u64,
    /// Those of which even the shortest part was longer than the law allows: what was flown is not the law's motion.
    #[serde(default)]
    pub overlong_steps: u64,
    /// Why the run ended before its time, such as [`INTERRUPTED`]; null where it did not.
    pub ended_early: Option<String>,
    /// Number of vehicles N.
    pub vehicles: usize,
    /// [`tautline_core::record::StateHash`] of the recorded states.
    pub state_hash: String,
}

/// Wall-clock times. Work done side by side counts in each kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Performance {
    /// From first to last step \[s\].
    pub wall_s: f64,
    /// Time flown over `wall_s`; null where that took no time.
    pub real_time_factor: Option<f64>,
    /// In the law \[s\].
    pub law_s: f64,
    /// In the law's energy \[s\].
    #[serde(default)]
    pub energy_s: f64,
    /// In the plant \[s\].
    pub physics_s: f64,
    /// Of that, in the forces, rotors and attitude loops of vehicles that have them \[s\].
    #[serde(default)]
    pub airframe_s: f64,
    /// In the judge \[s\].
    pub audit_s: f64,
    /// In the recorders \[s\].
    pub record_s: f64,
}

/// None for what is no finite number.
pub(super) fn finite(number: f64) -> Option<f64> {
    Some(number).filter(|number| number.is_finite())
}
