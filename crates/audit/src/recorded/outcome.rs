//! What an audit says of a recording.

use serde::Serialize;

use crate::envelope::EnvelopeOutcome;
use crate::obstacle::Obstacle;
use crate::outcome::{Approach, ObjectPair, ParryEvidence, Status, Undecided, Violation};
use crate::shortlist::Tally;
use crate::slices::Slice;
use crate::sweep::Interval;

/// A time during which a vehicle was not seen.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Gap {
    /// The vehicle.
    #[serde(skip)]
    pub vehicle: usize,
    /// When it was last seen before \[s\].
    pub from_s: f64,
    /// When it was seen again \[s\].
    pub to_s: f64,
    /// The [`max_gap_s`](super::Settings::max_gap_s) that would join what is before it to what is after it \[s\]; longer than
    /// the gap where that is cut by the window.
    pub joined_by_s: f64,
}

impl Gap {
    pub(super) fn new(vehicle: usize, from_s: f64, to_s: f64) -> Self {
        Self { vehicle, from_s, to_s, joined_by_s: to_s - from_s }
    }

    /// As far as it lies in a window.
    pub(super) fn within(self, window: Interval) -> Option<Self> {
        let (from_s, to_s) = (self.from_s.max(window.from_s), self.to_s.min(window.to_s));
        (from_s < to_s).then_some(Self { from_s, to_s, ..self })
    }
}

/// When a vehicle is there.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Presence {
    /// First seen \[s\].
    pub from_s: f64,
    /// Last seen \[s\].
    pub to_s: f64,
}

/// A vehicle that is not seen over the whole window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Absence {
    /// The vehicle.
    pub vehicle: usize,
    /// When it is seen; `None` where it is not seen in the window at all.
    pub seen: Option<Presence>,
}

/// How many findings of each kind there are, and how many of them are listed: the worst [`LISTED`](crate::LISTED), and the
/// first of each of as many pairs or vehicles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Tallies {
    /// Of violations.
    pub violations: Tally,
    /// Of times that could not be decided.
    pub undecided: Tally,
    /// Of gaps; the worst are the longest.
    pub gaps: Tally,
}

impl Tallies {
    /// Whether some list is shorter than what was found.
    #[must_use]
    pub fn are_shortened(&self) -> bool {
        [self.violations, self.undecided, self.gaps].iter().any(Tally::is_shortened)
    }
}

/// Vehicles that are never there together with another: when nobody else was, nothing is judged.
pub(super) fn alone(presence: &[Option<Presence>]) -> Vec<usize> {
    let there = presence.iter().enumerate().filter_map(|(vehicle, there)| Some((there.as_ref()?, vehicle)));
    let mut there: Vec<_> = there.collect();
    there.sort_by(|(a, _), (b, _)| a.from_s.total_cmp(&b.from_s));
    let mut last_s = f64::NEG_INFINITY;
    let mut alone = Vec::new();
    for (place, &(of, vehicle)) in there.iter().enumerate() {
        let next_s = there.get(place + 1).map_or(f64::INFINITY, |(next, _)| next.from_s);
        if last_s < of.from_s && of.to_s < next_s {
            alone.push(vehicle);
        }
        last_s = last_s.max(of.to_s);
    }
    alone.sort_unstable();
    alone
}

/// Where a recording contradicts the bound on acceleration that it is judged by.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Contradiction {
    /// The vehicle.
    #[serde(skip)]
    pub vehicle: usize,
    /// When \[s\].
    pub time_s: f64,
    /// The samples there need at least this \[m/s^2\].
    pub needs_m_s2: f64,
    /// What was assumed \[m/s^2\].
    pub assumed_m_s2: f64,
}

/// The verdict and what it rests on.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// Clear where everything asked for was judged and nothing came too close; undecided where something could not be
    /// told, or there never were two to keep apart; a violation, whatever else there was, where two came too close or a
    /// vehicle was beyond a limit.
    pub status: Status,
    /// The verdict on how close any two came alone; none where only single vehicles were asked about.
    pub separation: Option<Status>,
    /// What was found of each vehicle by itself.
    pub envelope: EnvelopeOutcome,
    /// Names of the vehicles, as the recording has them; those that were not asked for are among them.
    pub vehicles: Vec<String>,
    /// When each vehicle is there within what was asked; `None` where it is not, or was not asked for.
    pub presence: Vec<Option<Presence>>,
    /// Vehicles that were asked for and are not seen over the whole window, by their numbers.
    pub absences: Vec<Absence>,
    /// Longest interval between two samples of each vehicle that was no gap \[s\]: as asked, or one and a half of the
    /// usual one.
    pub max_gaps_s: Vec<f64>,
    /// First and last instant judged \[s\]; `None` where there was nothing to judge.
    pub span_s: Option<(f64, f64)>,
    /// The ten pairs that came closest, the closest first, each at its closest.
    pub closest: Vec<Approach>,
    /// The ten closest approaches to obstacles, likewise.
    pub obstacles: Vec<Approach>,
    /// The closest approach of all pairs of vehicles in one slice of time after the other, about a sample long, of a long
    /// recording longer; of times at which no two are there, or both are on the ground, nothing is known. Empty unless it was
    /// asked for.
    pub smallest: Vec<Slice>,
    /// Violations in order of time, as many as [`Tallies`] says.
    pub violations: Vec<Violation<ObjectPair>>,
    /// Times that could not be decided, in order of time, as many as [`Tallies`] says.
    pub undecided: Vec<Undecided<ObjectPair>>,
    /// The sampling rate that would decide everything that is undecided of pairs \[Hz\]; `None` where there is none that would.
    pub deciding_rate_hz: Option<f64>,
    /// How many findings there are.
    pub tallies: Tallies,
    /// Listed gaps in order of time; [`Tallies`] counts all. A gap counts if another vehicle or an obstacle is present, or if
    /// limits of single vehicles are judged. The motion in a gap is not known.
    pub gaps: Vec<Gap>,
    /// Vehicles that are never there together with another, where they are to keep apart from nothing else: a wrong clock would
    /// look like that.
    pub alone: Vec<usize>,
    /// The largest contradiction to the assumed bound on acceleration, if there is one: then nothing is proved clear.
    pub contradiction: Option<Contradiction>,
    /// Whether everything is known but for the lists above.
    pub is_else_known: bool,
    /// Segments of motion that were judged, over all vehicles.
    pub segments: u64,
    /// Segments of pairs (and of vehicles and obstacles) that were swept; all others were proved, by bounds on where
    /// vehicles were, to be neither too close nor among the closest.
    pub swept: u64,
    /// What the second detector says.
    pub parry: ParryEvidence<ObjectPair>,
}

impl Outcome {
    /// The name of a vehicle: its number from 1 where there is no name.
    #[must_use]
    pub fn name(&self, vehicle: usize) -> String {
        self.vehicles.get(vehicle).cloned().unwrap_or_else(|| (vehicle + 1).to_string())
    }

    /// The names of a pair, given the obstacles that were judged.
    #[must_use]
    pub fn names(&self, pair: ObjectPair, obstacles: &[Obstacle]) -> [String; 2] {
        match pair {
            ObjectPair::Vehicles(pair) => [self.name(pair.first()), self.name(pair.second())],
            ObjectPair::Obstacle { vehicle, obstacle } => {
                [self.name(vehicle), obstacles.get(obstacle).map_or(String::new(), |of| of.name.clone())]
            }
        }
    }
}
