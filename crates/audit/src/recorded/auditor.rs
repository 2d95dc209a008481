//! The audit of a recording, as it is read.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use super::outcome::{Gaps, Outcome, Rates, Tallies, absences, alone};
use super::settings::{LARGEST, RecordedError, Settings};
use super::smallest::Smallest;
use super::vehicle::Vehicle;
use super::window::Windows;
use crate::envelope::LimitMonitor;
use crate::ledger::Interruption;
use crate::ledger::{Lists, Results};
use crate::outcome::Status;
use crate::sweep::Interval;
use tautline_core::track::Item;

/// Segments of a vehicle in a window, about.
const SEGMENTS: usize = 16;
/// Fewest items between two windows.
const FEWEST_ITEMS: usize = 48;
/// Vehicles that are first seen farther apart in time than this \[s\] are not on one clock. They would never be present
/// together, and no distance between them would be judged.
const ONE_CLOCK_S: f64 = 30.0 * DAY_S;
const DAY_S: f64 = 86_400.0;
/// Names that an error lists.
const NAMES_LISTED: usize = 12;

/// Judges a recording as it is read.
///
/// [`push`](TrackAuditor::push) takes items in order of time, any number at a time; the first push should hold some samples of
/// each vehicle, since usual intervals are learnt from it. [`finish`](TrackAuditor::finish) gives the verdict.
#[derive(Clone, Debug)]
pub struct TrackAuditor {
    settings: Settings,
    vehicles: Vec<Vehicle>,
    rates: Option<Rates>,
    windows: Windows,
    results: Results,
    gaps: Gaps,
    smallest: Option<Smallest>,
    envelope: Option<LimitMonitor>,
    /// Smallest clock offset of any vehicle \[s\].
    least_offset_s: f64,
    /// Time of the last item, and of the last one before that time \[s\].
    now_s: f64,
    before_s: f64,
    /// Up to when everything was judged \[s\].
    done_s: f64,
    pending: usize,
    segments: u64,
}

/// Judges a recording in memory: the items of vehicles with these names, in order of time.
///
/// # Errors
/// [`RecordedError`] where the settings or the recording are wrong.
pub fn audit(names: &[String], items: &[Item], settings: Settings) -> Result<Outcome, RecordedError> {
    let mut auditor = TrackAuditor::new(settings)?;
    auditor.push(names, items)?;
    auditor.finish()
}

impl TrackAuditor {
    /// An auditor with settings.
    ///
    /// # Errors
    /// [`RecordedError`] where a number of the settings is out of range.
    pub fn new(settings: Settings) -> Result<Self, RecordedError> {
        settings.check()?;
        Ok(Self {
            least_offset_s: settings.vehicles.values().map(|of| of.offset_s).fold(0.0, f64::min),
            windows: Windows::new(settings.limits(), &settings.obstacles),
            envelope: (!settings.envelope.is_empty())
                .then(|| LimitMonitor::new(&settings.envelope, settings.window(), settings.accel_window_s)),
            settings,
            vehicles: Vec::new(),
            rates: None,
            results: Results::bounded(Interruption::default()),
            gaps: Gaps::default(),
            smallest: None,
            now_s: f64::NEG_INFINITY,
            before_s: f64::NEG_INFINITY,
            done_s: f64::NEG_INFINITY,
            pending: 0,
            segments: 0,
        })
    }

    /// Follows the smallest distance over time too: see [`Outcome::smallest`]. It is asked for before anything is judged.
    #[must_use]
    pub fn with_smallest(mut self) -> Self {
        self.smallest = Some(Smallest::new(&self.settings));
        self
    }

    /// Ends the work soon after the flag is set: [`push`](Self::push) and [`finish`](Self::finish) give
    /// [`RecordedError::Interrupted`] then. It is given before anything is judged.
    #[must_use]
    pub fn with_interruption(mut self, flag: Arc<AtomicBool>) -> Self {
        let interruption = Interruption::new(flag);
        if let Some(envelope) = &mut self.envelope {
            envelope.set_interruption(interruption.clone());
        }
        if let Some(smallest) = &mut self.smallest {
            smallest.set_interruption(interruption.clone());
        }
        self.results = Results::bounded(interruption);
        self
    }

    fn check_interruption(&self) -> Result<(), RecordedError> {
        if self.results.interruption.is_set() { Err(RecordedError::Interrupted) } else { Ok(()) }
    }

    /// Judges what comes next. `names` are those of all vehicles known so far.
    ///
    /// # Errors
    /// [`RecordedError`] where an item is wrong, or the work is interrupted; nothing more can be judged then.
    pub fn push(&mut self, names: &[String], items: &[Item]) -> Result<(), RecordedError> {
        if self.rates.is_none() && !items.is_empty() {
            let given = self.settings.max_gap_s.is_some();
            self.rates = Some(if given { Rates::default() } else { Rates::learn(items, names.len()) });
        }
        for name in names.iter().skip(self.vehicles.len()) {
            let usual = || self.rates.as_ref().map_or(f64::INFINITY, |rates| rates.max_gap_s(self.vehicles.len()));
            let max_gap_s = self.settings.max_gap_s.unwrap_or_else(usual);
            self.vehicles.push(Vehicle::new(name, &self.settings, max_gap_s));
        }
        for item in items {
            self.take(item)?;
        }
        Ok(())
    }

    #[inline]
    fn take(&mut self, item: &Item) -> Result<(), RecordedError> {
        let (index, time_s) = (item.vehicle(), item.time_s());
        if time_s != self.now_s {
            self.turn_to(time_s, index)?;
        }
        let Some(vehicle) = self.vehicles.get_mut(index) else {
            return Err(RecordedError::Unnamed { vehicle: index });
        };
        if !vehicle.asked_for {
            return Ok(());
        }
        let unseen = vehicle.is_unseen();
        // Matched in place: moving the gap out of the result first takes longer than all else that is done with a sample here.
        let after_gap = match vehicle.take(item) {
            Ok(None) => false,
            Ok(Some(gap)) => {
                self.gaps.extend(gap.within(self.settings.window()));
                true
            }
            Err(error) => return Err(error),
        };
        if unseen {
            vehicle.check(&self.settings)?;
        }
        if let Some(envelope) = &mut self.envelope {
            envelope.take(item, vehicle.seen(after_gap));
            if self.results.interruption.is_set() {
                return Err(RecordedError::Interrupted);
            }
        }
        self.pending += 1;
        Ok(())
    }

    /// A new instant: everything before it has been read.
    #[inline(never)]
    fn turn_to(&mut self, time_s: f64, vehicle: usize) -> Result<(), RecordedError> {
        let name = || self.vehicles.get(vehicle).map(|vehicle| vehicle.name.clone()).unwrap_or_default();
        if !time_s.is_finite() || time_s.abs() > LARGEST {
            return Err(RecordedError::Item {
                vehicle: name(),
                time_s,
                what: "the time is not a finite number below 1e70".to_owned(),
            });
        }
        if time_s < self.now_s {
            return Err(RecordedError::OutOfOrder { vehicle: name(), previous_s: self.now_s, time_s });
        }
        (self.before_s, self.now_s) = (self.now_s, time_s);
        if self.before_s == f64::NEG_INFINITY {
            self.done_s = time_s + self.least_offset_s;
        } else if self.pending >= (SEGMENTS * self.vehicles.len()).max(FEWEST_ITEMS) {
            self.advance();
        }
        self.check_interruption()
    }

    /// Judges up to where every vehicle that may still be there is known.
    fn advance(&mut self) {
        let read_s = self.now_s + self.least_offset_s;
        let seen = self.vehicles.iter().filter(|vehicle| !vehicle.is_unseen());
        let there = seen.filter(|vehicle| read_s - vehicle.known_s() <= vehicle.max_gap_s);
        let until_s = there.map(Vehicle::known_s).fold(self.before_s + self.least_offset_s, f64::min);
        if until_s > self.done_s {
            self.judge_until(until_s);
            self.pending = 0;
        } else {
            // Some vehicle has a lower rate: look again after as many items.
            self.pending /= 2;
        }
    }

    fn judge_until(&mut self, to_s: f64) {
        let window = Interval { from_s: self.done_s, to_s };
        if self.asks_for_separation() {
            self.windows.judge(&self.vehicles, window, &mut self.results);
        }
        if let Some(smallest) = &mut self.smallest {
            smallest.follow(&self.vehicles, window);
        }
        for vehicle in &mut self.vehicles {
            self.segments += vehicle.forget(to_s) as u64;
        }
        self.done_s = to_s;
    }

    /// Whether anything says how close two may come: where single vehicles alone are asked about, a recording's own radii
    /// do.
    fn asks_for_separation(&self) -> bool {
        self.settings.asks_for_separation() || self.vehicles.iter().any(|vehicle| vehicle.radius_m.is_some())
    }

    /// Whether the verdict is on pairs too: always where the question is about them. Limits that a recording brings of its own
    /// count beside a question about single vehicles where there are two, or one and an obstacle, and each vehicle has one.
    fn is_separation_asked(&self) -> bool {
        let is_own = self.settings.is_own_limit || !self.settings.asks_for_separation();
        let mut judged = self.vehicles.iter().filter(|vehicle| vehicle.is_judged());
        if !is_own || self.settings.envelope.is_empty() {
            return true;
        }
        let are_two = match judged.clone().count() {
            0 => false,
            1 => !self.settings.obstacles.is_empty(),
            _ => true,
        };
        are_two && judged.all(|vehicle| vehicle.has_limit(&self.settings)) && self.asks_for_separation()
    }

    /// The verdict over everything judged.
    ///
    /// # Errors
    /// [`RecordedError::UnknownVehicle`] where the settings name a vehicle that the recording does not have,
    /// [`RecordedError::TwoClocks`] where two vehicles are first seen more than a month apart.
    pub fn finish(mut self) -> Result<Outcome, RecordedError> {
        self.check_names()?;
        let end_s = self.vehicles.iter().map(Vehicle::known_s).fold(self.done_s, f64::max);
        if end_s.is_finite() {
            self.judge_until(end_s);
        }
        self.check_interruption()?;
        self.check_clocks()?;
        let presence: Vec<_> = self.vehicles.iter().map(|vehicle| vehicle.presence).collect();
        let there = || presence.iter().flatten();
        let span_s = there().map(|there| (there.from_s, there.to_s)).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
        let contradiction =
            self.vehicles.iter().filter_map(|v| v.contradiction).max_by(|a, b| a.needs_m_s2.total_cmp(&b.needs_m_s2));
        let separates = self.is_separation_asked();
        if !separates {
            self.results = Results::default();
        }
        let envelope = self.envelope.take().map(|envelope| {
            let judged: Vec<_> = self.vehicles.iter().map(Vehicle::is_judged).collect();
            envelope.finish(&judged, self.gaps.is_empty() && contradiction.is_none())
        });
        // A gap does not matter for pairs if no other vehicle is present during the gap.
        let obstructed = !self.settings.obstacles.is_empty();
        let (gaps, gaps_tally, is_gapless) = self.gaps.finish(&presence, obstructed, envelope.is_some());
        let envelope = envelope.unwrap_or_default();
        let absences = absences(&self.vehicles, &self.settings, span_s);
        if self.results.interruption.is_set() {
            return Err(RecordedError::Interrupted);
        }
        let Results { ledger, closest, obstacles, swept, .. } = self.results;
        let looked_at = !(closest.kept.is_empty() && obstacles.kept.is_empty());
        let alone = if obstructed || !separates { Vec::new() } else { alone(&presence) };
        let decided = looked_at && ledger.is_decided() && is_gapless && contradiction.is_none();
        let parry = ledger.parry;
        let of_pairs = looked_at && parry.disagreements == 0 && contradiction.is_none();
        let Lists { violations, undecided, violations_tally, undecided_tally, deciding_rate_hz } = ledger.into_lists();
        let tallies = Tallies { violations: violations_tally, undecided: undecided_tally, gaps: gaps_tally };
        let is_everyone_there = !self.settings.require_presence || absences.is_empty();
        Ok(Outcome {
            status: Status::new(
                !violations.is_empty() || envelope.is_exceeded(),
                (decided || !separates) && envelope.is_kept() && is_everyone_there,
            ),
            is_else_known: (of_pairs || !separates) && envelope.is_else_known() && !tallies.are_shortened(),
            separation: separates.then(|| Status::new(!violations.is_empty(), decided)),
            envelope,
            max_gaps_s: self.vehicles.iter().map(|vehicle| vehicle.max_gap_s).collect(),
            vehicles: self.vehicles.into_iter().map(|vehicle| vehicle.name).collect(),
            presence,
            absences,
            span_s,
            closest: closest.kept,
            obstacles: obstacles.kept,
            smallest: self.smallest.filter(|_| separates).map_or_else(Vec::new, Smallest::finish),
            violations,
            undecided,
            gaps,
            tallies,
            deciding_rate_hz,
            alone,
            contradiction,
            segments: self.segments,
            swept,
            parry,
        })
    }

    fn check_clocks(&self) -> Result<(), RecordedError> {
        let begins = self.vehicles.iter().filter_map(|vehicle| Some((vehicle.presence?.from_s, vehicle)));
        let first = begins.clone().reduce(|a, b| if b.0 < a.0 { b } else { a });
        let last = begins.reduce(|a, b| if b.0 > a.0 { b } else { a });
        let Some(((from_s, first), (to_s, last))) =
            first.zip(last).filter(|(first, last)| last.0 - first.0 > ONE_CLOCK_S)
        else {
            return Ok(());
        };
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the cast saturates")]
        let days = ((to_s - from_s) / DAY_S) as u64;
        Err(RecordedError::TwoClocks { first: first.name.clone(), second: last.name.clone(), days })
    }

    fn check_names(&self) -> Result<(), RecordedError> {
        let asked = self.settings.vehicles.keys().chain(self.settings.only.iter().flatten());
        let known: Vec<&str> = self.vehicles.iter().map(|vehicle| vehicle.name.as_str()).collect();
        for name in asked {
            if !known.contains(&name.as_str()) {
                let mut listed = known.iter().take(NAMES_LISTED).copied().collect::<Vec<_>>().join(", ");
                if known.len() > NAMES_LISTED {
                    listed += ", ...";
                }
                return Err(RecordedError::UnknownVehicle { name: name.clone(), known: listed });
            }
        }
        Ok(())
    }
}
