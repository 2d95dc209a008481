//! Numbers of a shielded flight.

use serde::Serialize;

use tautline_core::fact::Fact;
use tautline_core::text::{counted, seconds, up_to};
use tautline_sim::shield::ShieldReport;

/// Numbers of the shield, of all vehicles together.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ShieldNumbers {
    /// Certificate in words, with its assumptions.
    pub certificate: String,
    /// Facts that the certificate rests on.
    pub facts: Vec<Fact>,
    /// Bound on the distance of a vehicle to its reference \[m\].
    pub tube_m: f64,
    /// Assumption that did not hold, with its vehicle. The certificate does not cover the flight then. Null if all of
    /// them held.
    pub exceeded: Option<String>,
    /// Number of commands.
    pub commands: u64,
    /// Share of commands that differ from the law's own.
    pub changed_share: f64,
    /// Largest change of a command \[m/s^2\].
    pub largest_change_m_s2: f64,
    /// Share of commands that are those of the brake.
    pub brake_share: f64,
    /// Longest time that a vehicle braked \[s\].
    pub longest_brake_s: f64,
    /// Largest distance of a vehicle to its reference, as a share of the tube; null if it was not observed.
    pub tube_share: Option<f64>,
    /// Largest command of a vehicle, as a share of the largest one that it carries out.
    pub command_share: Option<f64>,
    /// Largest error of a measured own state, as a share of its bound; null if it was not observed.
    pub measurement_share: Option<f64>,
    /// Number of proposed planes that were accepted.
    pub proposals_accepted: u64,
    /// Number of proposed planes that were refused.
    pub proposals_refused: u64,
    /// Largest age of a plane \[s\].
    pub oldest_plane_s: f64,
    /// Number of instants at which the law had no finite command for some vehicle, which braked.
    pub law_undefined: u64,
    /// Number of those instants at which the law failed or commanded numbers that are not finite. The flight does not
    /// pass then.
    pub law_failed: u64,
    /// Number of messages of the shield, one for each receiver.
    pub messages_sent: u64,
    /// Number of them that were lost.
    pub messages_lost: u64,
}

impl From<&ShieldReport> for ShieldNumbers {
    fn from(of: &ShieldReport) -> Self {
        let counters = &of.counters;
        let periods_s = |periods: u64| periods as f64 * of.period_s;
        Self {
            certificate: of.certificate.clone(),
            facts: of.facts.clone(),
            tube_m: of.tube_m,
            exceeded: of.breach.map(|breach| format!("vehicle {}: {}", breach.vehicle + 1, breach.exceeded)),
            commands: counters.commands,
            changed_share: counters.changed_share(),
            largest_change_m_s2: counters.largest_change_m_s2,
            brake_share: counters.brake_share(),
            longest_brake_s: periods_s(counters.longest_brake),
            tube_share: counters.tracking_share,
            command_share: counters.command_share,
            measurement_share: counters.measurement_share(),
            proposals_accepted: counters.accepted,
            proposals_refused: counters.refused,
            oldest_plane_s: periods_s(counters.oldest_plane),
            law_undefined: of.undefined,
            law_failed: of.failed,
            messages_sent: of.sent,
            messages_lost: of.lost,
        }
    }
}

impl ShieldNumbers {
    /// Returns the numbers in one line.
    pub(super) fn line(&self) -> String {
        let percent = |share: f64| format!("{:.1} %", 100.0 * share);
        let undefined = match self.law_undefined {
            0 => String::new(),
            count => format!("; the law had no command at {}", counted(count, "instant", "instants")),
        };
        format!(
            "changed {} of commands by up to {} m/s^2, braked in {} (longest {}); used {} of the tube of {} m; {} \
             accepted, {} refused{undefined}",
            percent(self.changed_share),
            up_to(self.largest_change_m_s2),
            percent(self.brake_share),
            seconds(self.longest_brake_s),
            self.tube_share.map_or_else(|| "an unknown part".into(), percent),
            up_to(self.tube_m),
            counted(self.proposals_accepted, "plane", "planes"),
            self.proposals_refused,
        )
    }
}
