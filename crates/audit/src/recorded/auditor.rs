//! Audit of a recording while it is read.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use super::outcome::{ExemptTime, Gaps, Outcome, Rates, Tallies, absences, vehicles_without_others};
use super::settings::{LARGEST, RecordedError, Settings};
use super::smallest::SmallestDistances;
use super::vehicle::Vehicle;
use super::well_clear::WellClearMonitor;
use super::window::Windows;
use crate::envelope::LimitMonitor;
use crate::ledger::Interruption;
use crate::ledger::{Lists, Results};
use crate::outcome::Status;
use crate::sweep::Interval;
use tautline_core::track::Item;

/// Approximate number of segments of a vehicle in a window.
const SEGMENTS: usize = 16;
/// Smallest number of items between two windows.
const MIN_ITEMS: usize = 48;
/// Largest time between the first samples of two vehicles with one clock \[s\]. Beyond, the vehicles would never be
/// present together, and no distance between them would be judged.
const ONE_CLOCK_S: f64 = 30.0 * DAY_S;
const DAY_S: f64 = 86_400.0;
/// Largest number of names that an error lists.
const NAMES_LISTED: usize = 12;

/// Audits a recording while it is read.
///
/// [`push`](TrackAuditor::push) takes items in order of time, any number per call. The usual intervals of vehicles are
/// learnt from the first call, which should hold some samples of each vehicle. [`finish`](TrackAuditor::finish) returns
/// the verdict.
#[derive(Clone, Debug)]
pub struct TrackAuditor {
    settings: Settings,
    has_plan: bool,
    has_own_limit: bool,
    vehicles: Vec<Vehicle>,
    rates: Option<Rates>,
    windows: Windows,
    results: Results,
    gaps: Gaps,
    smallest: Option<SmallestDistances>,
    /// Time on the ground, with a height of the ground.
    exempt: Option<ExemptTime>,
    envelope: Option<LimitMonitor>,
    well_clear: Option<WellClearMonitor>,
    /// Smallest clock offset of any vehicle \[s\].
    least_offset_s: f64,
    /// Time of the last item, and the latest item time before it \[s\].
    now_s: f64,
    before_s: f64,
    /// Time up to which everything was judged \[s\].
    done_s: f64,
    pending: usize,
    segments: u64,
    /// First vehicle that cannot be judged. An unknown name in the settings may be the cause, and is reported instead
    /// once all names are known.
    refused: Option<RecordedError>,
}

/// Audits a recording in memory: items in order of time, of vehicles with these names.
///
/// # Errors
/// [`RecordedError`] if the settings or the recording are invalid.
pub fn audit(names: &[String], items: &[Item], settings: Settings) -> Result<Outcome, RecordedError> {
    let mut auditor = TrackAuditor::new(settings)?;
    auditor.push(names, items)?;
    auditor.finish()
}

impl TrackAuditor {
    /// Creates an auditor with these settings.
    ///
    /// # Errors
    /// [`RecordedError`] if a number of the settings is out of range.
    pub fn new(settings: Settings) -> Result<Self, RecordedError> {
        settings.check()?;
        Ok(Self {
            least_offset_s: settings.vehicles.values().map(|vehicle| vehicle.offset_s).fold(0.0, f64::min),
            windows: Windows::new(settings.limits(), &settings.obstacles, &settings.land_on),
            envelope: (!settings.envelope.is_empty())
                .then(|| LimitMonitor::new(&settings.envelope, settings.window(), settings.accel_window_s)),
            well_clear: settings.well_clear.map(WellClearMonitor::new),
            exempt: settings.above_m.map(|_| ExemptTime::default()),
            settings,
            has_plan: false,
            has_own_limit: false,
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
            refused: None,
        })
    }

    /// Declares that the recording is compared with a plan. Without limits, separations are then not judged. Call it
    /// before the first [`push`](Self::push).
    #[must_use]
    pub fn with_plan(self) -> Self {
        Self { has_plan: true, ..self }
    }

    /// Declares that delta or the ellipsoid comes from the recording itself. With limits on single vehicles,
    /// separations are then judged only if the recording has a pair to judge.
    #[must_use]
    pub fn with_own_limit(self) -> Self {
        Self { has_own_limit: true, ..self }
    }

    /// Also records the smallest distance over time: see [`Outcome::smallest`]. Call it before the first
    /// [`push`](Self::push).
    #[must_use]
    pub fn with_smallest(mut self) -> Self {
        let mut smallest = SmallestDistances::new(&self.settings);
        smallest.set_interruption(self.results.interruption.clone());
        self.smallest = Some(smallest);
        self
    }

    /// Stops soon after the flag is set: [`push`](Self::push) and [`finish`](Self::finish) then return
    /// [`RecordedError::Interrupted`]. Call it before the first [`push`](Self::push).
    #[must_use]
    pub fn with_interruption(mut self, flag: Arc<AtomicBool>) -> Self {
        let interruption = Interruption::new(flag);
        if let Some(envelope) = &mut self.envelope {
            envelope.set_interruption(interruption.clone());
        }
        if let Some(well_clear) = &mut self.well_clear {
            well_clear.set_interruption(interruption.clone());
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

    /// Judges the next items. `names` are those of all vehicles known so far.
    ///
    /// # Errors
    /// [`RecordedError`] if an item is invalid, or the work is interrupted. The auditor cannot be used after an error.
    pub fn push(&mut self, names: &[String], items: &[Item]) -> Result<(), RecordedError> {
        Rates::add_vehicles(&mut self.rates, &mut self.vehicles, &self.settings, names, items);
        for item in items {
            if self.refused.is_some() {
                break;
            }
            self.take(item)?;
        }
        Ok(())
    }

    #[inline]
    fn take(&mut self, item: &Item) -> Result<(), RecordedError> {
        let (index, time_s) = (item.vehicle(), item.time_s());
        if time_s != self.now_s {
            self.begin_instant(time_s, index)?;
        }
        let Some(vehicle) = self.vehicles.get_mut(index) else {
            return Err(RecordedError::Unnamed { vehicle: index });
        };
        if !vehicle.is_selected {
            return Ok(());
        }
        let unseen = vehicle.is_unseen();
        // Matched in place: moving the gap out of the result first takes longer than the rest of this function.
        let after_gap = match vehicle.take(item) {
            Ok(None) => false,
            Ok(Some(gap)) => {
                self.gaps.extend(gap.within(self.settings.window()));
                true
            }
            Err(error) => return Err(error),
        };
        if unseen && let Err(refused) = vehicle.check(&self.settings, self.has_plan) {
            self.refused = Some(refused);
            return Ok(());
        }
        if let Some(envelope) = &mut self.envelope {
            envelope.take(item, vehicle.item_context(after_gap));
            if self.results.interruption.is_set() {
                return Err(RecordedError::Interrupted);
            }
        }
        self.pending += 1;
        Ok(())
    }

    /// Begins a new instant: every earlier item has been read.
    #[inline(never)]
    fn begin_instant(&mut self, time_s: f64, vehicle: usize) -> Result<(), RecordedError> {
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
        } else if self.pending >= (SEGMENTS * self.vehicles.len()).max(MIN_ITEMS) {
            self.advance();
        }
        self.check_interruption()
    }

    /// Judges up to the time up to which every vehicle that may still be present is known.
    fn advance(&mut self) {
        let read_s = self.now_s + self.least_offset_s;
        let seen = self.vehicles.iter().filter(|vehicle| !vehicle.is_unseen());
        let present = seen.filter(|vehicle| read_s - vehicle.known_s() <= vehicle.max_gap_s);
        let until_s = present.map(Vehicle::known_s).fold(self.before_s + self.least_offset_s, f64::min);
        if until_s > self.done_s {
            self.judge_until(until_s);
            self.pending = 0;
        } else {
            // A vehicle has a lower rate: try again after half the items.
            self.pending /= 2;
        }
    }

    fn judge_until(&mut self, to_s: f64) {
        let window = Interval { from_s: self.done_s, to_s };
        if self.has_separation_limit() {
            self.windows.judge(&self.vehicles, window, &mut self.results);
        }
        if let Some(well_clear) = &mut self.well_clear {
            well_clear.judge(&self.vehicles, window);
        }
        if let Some(smallest) = &mut self.smallest {
            smallest.follow(&self.vehicles, window);
        }
        if let Some(exempt) = &mut self.exempt {
            exempt.add(&self.vehicles, window);
        }
        for vehicle in &mut self.vehicles {
            self.segments += vehicle.discard_until(to_s) as u64;
        }
        self.done_s = to_s;
    }

    /// Returns whether a limit on separations exists, from the settings or from the recording's radii.
    fn has_separation_limit(&self) -> bool {
        self.settings.has_separation_limit(self.has_plan)
            || self.vehicles.iter().any(|vehicle| vehicle.radius_m.is_some())
    }

    /// Returns whether the verdict includes separations. It always does if the settings limit them. If the only limits
    /// are those of the recording, and the settings limit single vehicles, two conditions must hold. There are two
    /// vehicles, or one and an obstacle, and each vehicle has a limit.
    fn judges_separation(&self) -> bool {
        let is_own = self.has_own_limit || !self.settings.has_separation_limit(self.has_plan);
        let mut judged = self.vehicles.iter().filter(|vehicle| vehicle.is_judged());
        if !is_own || !self.settings.judges_single_vehicles(self.has_plan) {
            return true;
        }
        let is_a_pair_present = match judged.clone().count() {
            0 => false,
            1 => !self.settings.obstacles.is_empty(),
            _ => true,
        };
        is_a_pair_present && judged.all(|vehicle| vehicle.has_limit(&self.settings)) && self.has_separation_limit()
    }

    /// Returns the verdict over everything judged.
    ///
    /// # Errors
    /// [`RecordedError`] in one of these cases:
    ///
    /// - the settings name a vehicle that the recording does not have,
    /// - a vehicle cannot be judged,
    /// - the first samples of two vehicles are more than a month apart.
    pub fn finish(mut self) -> Result<Outcome, RecordedError> {
        self.check_names()?;
        if let Some(refused) = self.refused {
            return Err(refused);
        }
        let end_s = self.vehicles.iter().map(Vehicle::known_s).fold(self.done_s, f64::max);
        if end_s.is_finite() {
            self.judge_until(end_s);
        }
        self.check_interruption()?;
        self.check_clocks()?;
        let presence: Vec<_> = self.vehicles.iter().map(|vehicle| vehicle.presence).collect();
        let present = || presence.iter().flatten();
        let span_s =
            present().map(|present| (present.from_s, present.to_s)).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
        let contradiction =
            self.vehicles.iter().filter_map(|v| v.contradiction).max_by(|a, b| a.needs_m_s2.total_cmp(&b.needs_m_s2));
        let is_separation_judged = self.judges_separation();
        if !is_separation_judged {
            self.results = Results::default();
        }
        let envelope = self.envelope.take().map(|mut envelope| {
            for (index, vehicle) in self.vehicles.iter().enumerate().filter(|(_, vehicle)| vehicle.is_judged()) {
                if let Some(setpoints) = self.settings.yaw.get(&vehicle.name) {
                    envelope.judge_yaw(index, setpoints);
                }
            }
            let judged: Vec<_> = self.vehicles.iter().map(Vehicle::is_judged).collect();
            envelope.finish(&judged, self.gaps.is_empty() && contradiction.is_none())
        });
        // A gap does not matter for pairs if no other vehicle is present during the gap.
        let obstructed = !self.settings.obstacles.is_empty();
        let (gaps, gaps_tally, is_gapless) = self.gaps.finish(&presence, obstructed, envelope.is_some());
        let envelope = envelope.unwrap_or_default();
        let well_clear = self.well_clear.take().map(|monitor| monitor.finish(is_gapless));
        let has_status = |status: Status| well_clear.as_ref().is_some_and(|found| found.status == status);
        let (is_lost, is_open) = (has_status(Status::Violation), has_status(Status::Undecided));
        let absences = absences(&self.vehicles, &self.settings, span_s);
        if self.results.interruption.is_set() {
            return Err(RecordedError::Interrupted);
        }
        let Results { ledger, closest, obstacles, swept, undecided_of_obstacles, .. } = self.results;
        let has_approach = !(closest.kept.is_empty() && obstacles.kept.is_empty());
        let alone = if obstructed || !is_separation_judged { Vec::new() } else { vehicles_without_others(&presence) };
        let decided = has_approach && ledger.is_decided() && is_gapless && contradiction.is_none();
        let parry = ledger.parry;
        let are_pairs_known = has_approach && parry.disagreements == 0 && contradiction.is_none();
        let Lists { violations, undecided, violations_tally, undecided_tally, deciding_rate_hz } = ledger.into_lists();
        let tallies = Tallies { violations: violations_tally, undecided: undecided_tally, gaps: gaps_tally };
        let is_presence_satisfied = !self.settings.require_presence || absences.is_empty();
        Ok(Outcome {
            status: Status::new(
                !violations.is_empty() || envelope.is_exceeded() || is_lost,
                (decided || !is_separation_judged) && envelope.is_kept() && !is_open && is_presence_satisfied,
            ),
            exempt: self.exempt.filter(|_| is_separation_judged || well_clear.is_some()),
            is_else_known: (are_pairs_known || !is_separation_judged)
                && envelope.is_else_known()
                && !is_open
                && !tallies.are_shortened(),
            separation: is_separation_judged.then(|| Status::new(!violations.is_empty(), decided)),
            envelope,
            well_clear,
            max_gaps_s: self.vehicles.iter().map(|vehicle| vehicle.max_gap_s).collect(),
            vehicles: self.vehicles.into_iter().map(|vehicle| vehicle.name).collect(),
            presence,
            absences,
            span_s,
            closest: closest.kept,
            obstacles: obstacles.kept,
            smallest: self.smallest.filter(|_| is_separation_judged).map_or_else(Vec::new, SmallestDistances::finish),
            violations,
            undecided,
            gaps,
            tallies,
            undecided_of_obstacles,
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
        let named = self.settings.vehicles.keys().chain(self.settings.only.iter().flatten());
        let known: Vec<&str> = self.vehicles.iter().map(|vehicle| vehicle.name.as_str()).collect();
        for name in named {
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
