//! Messages of `run.mcap`, converted to CDR and back.

use std::io;
use std::sync::Arc;

use serde::ser::SerializeSeq;
use serde::{Deserialize, Serialize, Serializer};

use super::topic::{Topic, encode};
use tautline_core::record::{Channel, Event, MessageHash, OwnedSample, Peaks, ReadFault, Sample, sha256_hex};
use tautline_core::swarm::{ClosestApproach, Pair, Rows, Swarm};
use tautline_core::text::{at_least, up_to};

/// Description of a run: the fields of `scenario.msg`, in order.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// Name of the scenario.
    pub scenario_name: String,
    /// SHA-256 of `scenario_toml`, 64 hexadecimal digits.
    pub scenario_sha256: String,
    /// Number of vehicles N.
    pub vehicles: usize,
    /// Safety distance delta \[m\].
    pub delta_m: f64,
    /// The resolved scenario as TOML.
    pub scenario_toml: String,
}

/// Audit of every step by the run itself: the fields of `audit.msg`, in order.
///
/// Lengths are in metres, or relative to the half axes if the scenario has ellipsoids.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RunAudit {
    /// `clear`, `violation` or `undecided`.
    pub status: String,
    /// Reason why the run ended early; empty if the run was flown to its end.
    pub ended_early: String,
    /// Whether the samples are all steps of the run and every step was straight.
    pub holds_every_step: bool,
    /// Smallest distance that two centres must keep \[m\].
    pub limit_m: f64,
    /// Time flown \[s\].
    pub duration_s: f64,
    /// Steps that were judged.
    pub steps: u64,
    /// Pairs that were swept, summed over the steps.
    pub pairs_checked: u64,
    /// Number of all violations.
    pub violations_count: u64,
    /// Closest approach of two vehicles, and the closest approaches to obstacles.
    pub closest: Vec<RunFinding>,
    /// Violations in order of time, at most a bounded number.
    pub violations: Vec<RunFinding>,
    /// Hash of the messages and of this audit, computed by [`McapRecorder::close`](super::McapRecorder::close). The
    /// hash reveals accidental changes and edits. It is not a signature: a program can recompute it.
    pub sha256: String,
}

/// An approach or a violation of a [`RunAudit`]. Vehicles and obstacles are numbered from 1.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RunFinding {
    /// The vehicle.
    pub vehicle: u64,
    /// The other vehicle; 0 for an approach to an obstacle.
    pub other_vehicle: u64,
    /// The obstacle; 0 for an approach of two vehicles.
    pub obstacle: u64,
    /// Required distance \[m\].
    pub limit_m: f64,
    /// Start of the violation \[s\]; equal to `min_at_s` for an approach.
    pub from_s: f64,
    /// End of the violation \[s\]; equal to `min_at_s` for an approach.
    pub to_s: f64,
    /// Smallest distance \[m\].
    pub min_m: f64,
    /// Time of the smallest distance \[s\].
    pub min_at_s: f64,
}

impl RunAudit {
    /// Returns the hash of the messages followed by this audit.
    pub(super) fn hash(&self, mut messages: MessageHash) -> io::Result<String> {
        let mut bytes = Vec::new();
        encode(&Self { sha256: String::new(), ..self.clone() }, &mut bytes)?;
        messages.take(AUDIT.name, &bytes);
        Ok(messages.digits())
    }
}

impl Header {
    /// Returns the header of a run of this scenario and computes its hash.
    #[must_use]
    pub fn new(scenario_name: &str, scenario_toml: &str, vehicles: usize, delta_m: f64) -> Self {
        Self {
            scenario_name: scenario_name.to_owned(),
            scenario_toml: scenario_toml.to_owned(),
            scenario_sha256: sha256_hex(scenario_toml),
            vehicles,
            delta_m,
        }
    }
}

/// Topic that every run recording has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum RunTopic {
    Scenario,
    Swarm,
    Summary,
    Events,
}

impl RunTopic {
    /// All topics, in the order of their declaration.
    pub(super) const ALL: [Self; 4] = [Self::Scenario, Self::Swarm, Self::Summary, Self::Events];

    pub(super) const fn topic(self) -> Topic<'static> {
        match self {
            Self::Scenario => Topic::cdr("/scenario", "tautline_msgs/msg/Scenario", include_str!("scenario.msg")),
            Self::Swarm => Topic::cdr("/swarm", SWARM_SCHEMA, include_str!("swarm.msg")),
            Self::Summary => Topic::cdr("/summary", "tautline_msgs/msg/Summary", include_str!("summary.msg")),
            Self::Events => Topic::cdr("/events", "tautline_msgs/msg/Event", include_str!("event.msg")),
        }
    }

    /// Returns the topic with this name.
    pub(super) fn of(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|own| own.topic().name == name)
    }

    fn fault(self, reason: impl Into<String>) -> ReadFault {
        fault(self.topic().name, reason)
    }
}

/// Topic of the audit, declared and written when a finished run closes its recording.
pub(super) const AUDIT: Topic<'static> = Topic::cdr("/audit", "tautline_msgs/msg/Audit", include_str!("audit.msg"));

pub(super) fn fault(topic: &str, reason: impl Into<String>) -> ReadFault {
    ReadFault::Message { topic: topic.to_owned(), reason: reason.into() }
}

/// Schema name of swarm states.
pub(crate) const SWARM_SCHEMA: &str = "tautline_msgs/msg/Swarm";

/// Schema name of channels.
pub(crate) const CHANNEL_SCHEMA: &str = "tautline_msgs/msg/Channel";

/// Returns the topic name of a channel.
pub(crate) fn channel_topic(channel: &str) -> String {
    format!("/vehicles/{channel}")
}

/// Returns the topic with this name, with the schema of channels.
pub(crate) fn topic_of_channel(name: &str) -> Topic<'_> {
    Topic::cdr(name, CHANNEL_SCHEMA, include_str!("channel.msg"))
}

/// Fields of `swarm.msg`, in order.
#[derive(Serialize, Deserialize)]
pub(super) struct SwarmMessage<V> {
    pub(super) time_s: f64,
    step: u64,
    positions_m: V,
    velocities_m_s: V,
    controls_m_s2: V,
}

impl<'a> From<&Sample<'a>> for SwarmMessage<VehicleByVehicle<'a>> {
    fn from(sample: &Sample<'a>) -> Self {
        Self {
            time_s: sample.time_s,
            step: sample.step,
            positions_m: VehicleByVehicle(&sample.swarm.positions_m),
            velocities_m_s: VehicleByVehicle(&sample.swarm.velocities_m_s),
            controls_m_s2: VehicleByVehicle(sample.control),
        }
    }
}

impl SwarmMessage<Vec<f64>> {
    /// Returns the number of vehicles, derived from the positions.
    pub(super) fn vehicles(&self) -> usize {
        self.positions_m.len() / 3
    }

    /// Returns the sample, combined with the preceding summary and channels if they belong to the same step.
    pub(super) fn into_sample(
        self,
        vehicles: usize,
        summary: Option<&SummaryMessage>,
        channels: Vec<ChannelMessage<String, Vec<String>, Vec<f64>>>,
    ) -> Result<OwnedSample, ReadFault> {
        for (name, numbers) in [
            ("positions_m", &self.positions_m),
            ("velocities_m_s", &self.velocities_m_s),
            ("controls_m_s2", &self.controls_m_s2),
        ] {
            let without_command = name == "controls_m_s2" && numbers.is_empty();
            if Some(numbers.len()) != vehicles.checked_mul(3) && !without_command {
                let reason =
                    format!("{name} has {} numbers, which is not 3 for each of {vehicles} vehicles", numbers.len());
                return Err(RunTopic::Swarm.fault(reason));
            }
        }
        let summary = summary.filter(|summary| summary.step == self.step);
        let channels = channels.into_iter().filter(|channel| channel.step == self.step);
        Ok(OwnedSample {
            time_s: self.time_s,
            step: self.step,
            swarm: Swarm {
                positions_m: Rows::from_row_slice(&self.positions_m),
                velocities_m_s: Rows::from_row_slice(&self.velocities_m_s),
            },
            control: Rows::from_row_slice(&self.controls_m_s2),
            separation: summary.map(SummaryMessage::separation).transpose()?.flatten(),
            energy: summary.map(|summary| summary.energy_m2_s2).filter(|energy| !energy.is_nan()),
            peaks: Peaks::default(),
            channels: channels.map(|channel| channel.into_channel(vehicles)).collect::<Result<_, _>>()?,
        })
    }
}

/// Fields of `channel.msg`, in order.
#[derive(Serialize, Deserialize)]
pub(crate) struct ChannelMessage<N, C, V> {
    time_s: f64,
    step: u64,
    pub(crate) name: N,
    columns: C,
    values: V,
}

impl<'a> ChannelMessage<&'a str, &'a [String], &'a [f64]> {
    pub(crate) fn of(time_s: f64, step: u64, channel: &'a Channel) -> Self {
        let Channel { name, columns, values } = channel;
        Self { time_s, step, name, columns, values }
    }
}

impl ChannelMessage<String, Vec<String>, Vec<f64>> {
    /// Returns the channel of `vehicles` vehicles.
    pub(crate) fn into_channel(self, vehicles: usize) -> Result<Channel, ReadFault> {
        let (columns, numbers) = (self.columns.len(), self.values.len());
        if Some(numbers) != columns.checked_mul(vehicles) {
            let reason = format!("it has {numbers} numbers, which is not {columns} for each of {vehicles} vehicles");
            return Err(fault(&channel_topic(&self.name), reason));
        }
        Ok(Channel { name: self.name.into(), columns: Arc::from(self.columns), values: self.values })
    }
}

/// Table serialized as the sequence x1, y1, z1, x2, ...
pub(super) struct VehicleByVehicle<'a>(&'a Rows);

impl Serialize for VehicleByVehicle<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut sequence = serializer.serialize_seq(Some(self.0.len()))?;
        for i in 0..self.0.nrows() {
            for axis in 0..3 {
                sequence.serialize_element(&self.0[(i, axis)])?;
            }
        }
        sequence.end()
    }
}

/// Fields of `summary.msg`, in order.
#[derive(Serialize, Deserialize)]
pub(super) struct SummaryMessage {
    time_s: f64,
    step: u64,
    separation_m: f64,
    separation_time_s: f64,
    pair: [u64; 2],
    energy_m2_s2: f64,
}

impl From<&Sample<'_>> for SummaryMessage {
    fn from(sample: &Sample<'_>) -> Self {
        Self {
            time_s: sample.time_s,
            step: sample.step,
            separation_m: sample.separation.map_or(f64::NAN, |closest| closest.separation_m),
            separation_time_s: sample.separation.map_or(f64::NAN, |closest| closest.time_s),
            pair: numbers_of(sample.separation.map(|closest| closest.pair)),
            energy_m2_s2: sample.energy.unwrap_or(f64::NAN),
        }
    }
}

impl SummaryMessage {
    fn separation(&self) -> Result<Option<ClosestApproach>, ReadFault> {
        if self.pair[0] == 0 {
            return Ok(None);
        }
        let pair = pair_of(RunTopic::Summary, self.pair)?;
        Ok(Some(ClosestApproach { pair, separation_m: self.separation_m, time_s: self.separation_time_s }))
    }
}

/// Prefix of the text of an `assigned` event. The new slots of vehicles 1, 2, ... follow, each named after its previous
/// vehicle.
const ASSIGNED: &str = "vehicles 1, 2, ... go to the slots of ";

/// Fields of `event.msg`, in order.
#[derive(Serialize, Deserialize)]
pub(super) struct EventMessage<S> {
    kind: S,
    time_s: f64,
    pair: [u64; 2],
    value: f64,
    text: String,
}

/// Vehicle numbers of an event without a pair.
const NO_PAIR: [usize; 2] = [0, 0];

impl From<&Event> for EventMessage<&'static str> {
    fn from(event: &Event) -> Self {
        let (kind, pair, value, text) = match event {
            Event::ViolationBegan { pair, .. } => (
                "violation-began",
                pair.numbers(),
                f64::NAN,
                format!("vehicles {pair} came closer than the safety distance"),
            ),
            Event::ViolationEnded { pair, min_m, .. } => (
                "violation-ended",
                pair.numbers(),
                *min_m,
                format!("vehicles {pair} are clear again after coming to {} m", at_least(*min_m, 6)),
            ),
            Event::Approach { pair, separation_m, .. } => (
                "approach",
                pair.numbers(),
                *separation_m,
                format!("vehicles {pair} came to {} m at the closest", at_least(*separation_m, 6)),
            ),
            Event::ObstacleViolationBegan { vehicle, obstacle, .. } => (
                "obstacle-violation-began",
                [vehicle + 1, obstacle + 1],
                f64::NAN,
                format!("vehicle {} came nearer to obstacle {} than its clearance", vehicle + 1, obstacle + 1),
            ),
            Event::ObstacleViolationEnded { vehicle, obstacle, min_m, .. } => (
                "obstacle-violation-ended",
                [vehicle + 1, obstacle + 1],
                *min_m,
                format!(
                    "vehicle {} is clear of obstacle {} again after coming to {} m",
                    vehicle + 1,
                    obstacle + 1,
                    at_least(*min_m, 6)
                ),
            ),
            Event::ObstacleApproach { vehicle, obstacle, distance_m, .. } => (
                "obstacle-approach",
                [vehicle + 1, obstacle + 1],
                *distance_m,
                format!(
                    "vehicle {} came to {} m from obstacle {} at the closest",
                    vehicle + 1,
                    at_least(*distance_m, 6),
                    obstacle + 1
                ),
            ),
            Event::OtherLaw { name, .. } => ("other-law", NO_PAIR, f64::NAN, name.clone()),
            Event::LegBegan { leg, .. } => {
                ("leg-began", NO_PAIR, (leg + 1) as f64, format!("leg {} of the flight began", leg + 1))
            }
            Event::DeadlockRecovery { scale, .. } => (
                "deadlock-recovery",
                NO_PAIR,
                *scale,
                format!("slots were scaled by {scale} to let vehicles past each other"),
            ),
            Event::Assigned { slots, .. } => {
                let slots: Vec<_> = slots.iter().map(|slot| (slot + 1).to_string()).collect();
                ("assigned", NO_PAIR, f64::NAN, format!("{ASSIGNED}{}", slots.join(" ")))
            }
            Event::EngineContact { pair, .. } => (
                "engine-contact",
                pair.numbers(),
                f64::NAN,
                format!("the keep-out balls of vehicles {pair} overlap in the engine"),
            ),
            Event::HullsHit { pair, closing_m_s, .. } => (
                "hulls-hit",
                pair.numbers(),
                *closing_m_s,
                format!("the hulls of vehicles {pair} hit at {} m/s", up_to(*closing_m_s)),
            ),
            Event::StepRefined { dt_s, .. } => {
                ("step-refined", NO_PAIR, *dt_s, format!("a step was flown in steps down to {dt_s} s"))
            }
            Event::EndedEarly { reason, .. } => ("ended-early", NO_PAIR, f64::NAN, reason.clone()),
        };
        Self { kind, time_s: event.time_s(), pair: pair.map(|number| number as u64), value, text }
    }
}

impl EventMessage<String> {
    pub(super) fn into_event(self) -> Result<Event, ReadFault> {
        let time_s = self.time_s;
        let pair = || pair_of(RunTopic::Events, self.pair);
        Ok(match self.kind.as_str() {
            "violation-began" => Event::ViolationBegan { pair: pair()?, time_s },
            "violation-ended" => Event::ViolationEnded { pair: pair()?, time_s, min_m: self.value },
            "approach" => Event::Approach { pair: pair()?, time_s, separation_m: self.value },
            "obstacle-violation-began" => {
                let [vehicle, obstacle] = self.vehicle_and_obstacle()?;
                Event::ObstacleViolationBegan { vehicle, obstacle, time_s }
            }
            "obstacle-violation-ended" => {
                let [vehicle, obstacle] = self.vehicle_and_obstacle()?;
                Event::ObstacleViolationEnded { vehicle, obstacle, time_s, min_m: self.value }
            }
            "obstacle-approach" => {
                let [vehicle, obstacle] = self.vehicle_and_obstacle()?;
                Event::ObstacleApproach { vehicle, obstacle, time_s, distance_m: self.value }
            }
            "engine-contact" => Event::EngineContact { pair: pair()?, time_s },
            "hulls-hit" => Event::HullsHit { pair: pair()?, time_s, closing_m_s: self.value },
            "other-law" => Event::OtherLaw { time_s, name: self.text },
            "leg-began" => Event::LegBegan { leg: self.leg()?, time_s },
            "deadlock-recovery" => Event::DeadlockRecovery { time_s, scale: self.value },
            "assigned" => Event::Assigned { time_s, slots: self.slots()? },
            "step-refined" => Event::StepRefined { time_s, dt_s: self.value },
            "ended-early" => Event::EndedEarly { time_s, reason: self.text },
            unknown => return Err(RunTopic::Events.fault(format!("unknown kind {unknown:?}"))),
        })
    }

    fn vehicle_and_obstacle(&self) -> Result<[usize; 2], ReadFault> {
        let [vehicle, obstacle] =
            self.pair.map(|number| number.checked_sub(1).and_then(|index| usize::try_from(index).ok()));
        let both = vehicle.zip(obstacle).map(|(vehicle, obstacle)| [vehicle, obstacle]);
        both.ok_or_else(|| RunTopic::Events.fault("vehicle or obstacle number is 0; numbers count from 1".to_owned()))
    }

    /// Returns the slots in the text, from 0, if they are a permutation of the vehicles.
    fn slots(&self) -> Result<Vec<usize>, ReadFault> {
        let listed = self.text.strip_prefix(ASSIGNED).unwrap_or_default().split_whitespace();
        let slots = listed.map(|number| number.parse::<usize>().ok()?.checked_sub(1)).collect::<Option<Vec<_>>>();
        let is_permutation = |slots: &Vec<usize>| {
            let mut sorted = slots.clone();
            sorted.sort_unstable();
            !slots.is_empty() && sorted.into_iter().eq(0..slots.len())
        };
        slots
            .filter(is_permutation)
            .ok_or_else(|| RunTopic::Events.fault("the slots are not a permutation of the vehicles".to_owned()))
    }

    fn leg(&self) -> Result<usize, ReadFault> {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the cast saturates")]
        let number = self.value as usize;
        let leg = number.checked_sub(1).filter(|_| self.value.fract() == 0.0);
        leg.ok_or_else(|| RunTopic::Events.fault(format!("there is no leg {}", self.value)))
    }
}

/// Returns both vehicle numbers from 1, or zeros for no pair.
fn numbers_of(pair: Option<Pair>) -> [u64; 2] {
    pair.map_or([0, 0], |pair| pair.numbers().map(|number| number as u64))
}

fn pair_of(topic: RunTopic, numbers: [u64; 2]) -> Result<Pair, ReadFault> {
    let index = |number: u64| number.checked_sub(1).and_then(|index| usize::try_from(index).ok());
    match numbers.map(index) {
        [Some(first), Some(second)] if first != second => Ok(Pair::new(first, second)),
        _ => Err(topic.fault(format!("{} and {} are not a pair of vehicles", numbers[0], numbers[1]))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(event: &Event) -> EventMessage<String> {
        let EventMessage { kind, time_s, pair, value, text } = EventMessage::from(event);
        EventMessage { kind: kind.to_owned(), time_s, pair, value, text }
    }

    #[test]
    fn slots_round_trip_and_must_be_a_permutation() {
        let event = Event::Assigned { time_s: 2.5, slots: vec![2, 0, 1] };
        let encoded = message(&event);
        assert_eq!(encoded.text, "vehicles 1, 2, ... go to the slots of 3 1 2");
        assert_eq!(encoded.into_event().expect("an event"), event);
        for wrong in ["", "3 1", "1 1 2", "0 1 2", "1 2 4", "1 2 x"] {
            let text = format!("{ASSIGNED}{wrong}");
            assert!(EventMessage { text, ..message(&event) }.into_event().is_err(), "{wrong}");
        }
        assert!(EventMessage { text: "1 2 3".to_owned(), ..message(&event) }.into_event().is_err());
    }
}
