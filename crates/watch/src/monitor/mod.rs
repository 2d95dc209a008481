//! The monitor: poses in, events and judgements out. It has no input, output or clock of its own.

mod faults;
mod intake;
mod past;
mod plans;
mod present;
mod sign_off;

use nalgebra::Vector3;

use crate::ahead;
use crate::clock::SourceClock;
use crate::event::{Event, Fault, Pair, Reason, Separation};
use crate::history::History;
use crate::plan::Plan;
use crate::settings::{Expected, Settings, SettingsError};
use crate::streams::StampOrder;
use crate::velocity::VelocityEnclosure;
use crate::violations::OpenViolations;
use faults::FaultCount;
use past::SweptBox;
use plans::PublishedPlans;
use tautline_audit::Violation;
use tautline_core::fact::{Fact, FactKind, Source};

/// Largest number of events that wait for [`Monitor::drain_events`]; further ones are counted.
pub const MOST_EVENTS: usize = 4096;
/// Largest number of bytes of a name that are kept.
pub const LONGEST_NAME: usize = 100;

/// Position of a vehicle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose<'a> {
    /// Stamp: time of the position on the clock of its source \[s\].
    pub t_s: f64,
    /// Name of the vehicle.
    pub id: &'a str,
    /// Position in a frame with z up that all vehicles share \[m\].
    pub position_m: Vector3<f64>,
    /// Velocity in this frame \[m/s\], if known.
    pub velocity_m_s: Option<Vector3<f64>>,
    /// Standard deviation of the position as the source reports it \[m\], if it does.
    pub accuracy_m: Option<f64>,
}

/// Pose that the monitor took, for a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Taken {
    /// The vehicle.
    pub vehicle: u32,
    /// Stamp as a time of the monitor \[s\]; it increases strictly for each vehicle.
    pub time_s: f64,
}

#[expect(clippy::struct_excessive_bools, reason = "each is a finding of its own")]
struct Vehicle {
    /// Clock of the vehicle; `None` if the stamps have a common clock.
    clock: Option<SourceClock>,
    /// Number of steps of the clock when the history began.
    epoch: u32,
    history: History,
    /// Newest stamp of the last judgement of the past.
    judged_t_s: Option<f64>,
    /// Time of the last pose that was taken \[s\].
    taken_s: Option<f64>,
    /// Velocities at the newest position that the bounds allow.
    velocity: VelocityEnclosure,
    /// Bound on the error of the newest position \[m\], if known.
    position_error_m: Option<f64>,
    /// Order of the stamps.
    streams: StampOrder,
    /// Whether the messages of the name are those of two vehicles.
    has_two_streams: bool,
    /// Whether the newest stamp has two positions.
    has_conflict: bool,
    is_stale: bool,
    /// Time of the sign-off \[s\], if no pose came after it.
    signed_off_s: Option<f64>,
    /// Index into the plan.
    planned: Option<usize>,
    deviation_m: Option<f64>,
    is_off_plan: bool,
}

/// Live monitor of separation.
///
/// [`take`](Self::take) takes poses, [`assess`](Self::assess) judges the present and the past since the last call.
/// Neither allocates memory once all vehicles are known.
pub struct Monitor {
    settings: Settings,
    plan: Plan,
    names: Vec<String>,
    /// Indices of vehicles in order of their names.
    by_name: Vec<u32>,
    /// Expected names in order, with their number heard.
    missing: Vec<String>,
    vehicles: Vec<Vehicle>,
    /// The common clock.
    clock: Option<SourceClock>,
    /// Difference of the monitor's time and the arrival time that callers give \[s\].
    shift_s: f64,
    now_s: f64,
    faults: [FaultCount; Fault::ALL.len()],
    /// Last fault that gives doubt, with its time \[s\].
    doubt: Option<(Fault, f64)>,
    /// Reason of the last refused sign-off.
    refusal: Option<Reason>,
    events: Vec<Event>,
    suppressed: u64,
    violations: OpenViolations,
    /// Number of poses that were compared with the plan.
    compared: u64,
    /// Plans of planners; `None` before the first one.
    plans: Option<PublishedPlans>,
    judgement: u64,
    ahead: ahead::Scratch,
    boxes: Vec<SweptBox>,
}

impl Monitor {
    /// Returns a monitor that has heard nothing. The plan may be empty.
    ///
    /// # Errors
    /// [`SettingsError`] if a number is outside of its range.
    pub fn new(settings: Settings, plan: Plan) -> Result<Self, SettingsError> {
        settings.check()?;
        let mut missing = match &settings.expected {
            Expected::Names(names) => names.clone(),
            _ => Vec::new(),
        };
        missing.sort_unstable();
        missing.dedup();
        Ok(Self {
            settings,
            plan,
            names: Vec::new(),
            by_name: Vec::new(),
            missing,
            vehicles: Vec::new(),
            clock: None,
            shift_s: 0.0,
            now_s: f64::NEG_INFINITY,
            faults: Default::default(),
            doubt: None,
            refusal: None,
            events: Vec::with_capacity(MOST_EVENTS),
            suppressed: 0,
            violations: OpenViolations::new(),
            compared: 0,
            plans: None,
            judgement: 0,
            ahead: ahead::Scratch::default(),
            boxes: Vec::new(),
        })
    }

    /// Returns the settings.
    #[must_use]
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Returns the names of the vehicles in the order in which they were first heard.
    #[must_use]
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Returns the expected names that were not heard.
    #[must_use]
    pub fn missing(&self) -> &[String] {
        &self.missing
    }

    /// Returns the present \[s\]; negative infinity before the first pose.
    #[must_use]
    pub fn now_s(&self) -> f64 {
        self.now_s
    }

    /// Converts an arrival time of the caller's clock to a time of the monitor \[s\].
    #[must_use]
    pub fn time_of_arrival(&self, arrival_s: f64) -> f64 {
        arrival_s + self.shift_s
    }

    /// Returns the number of measured violations so far.
    #[must_use]
    pub fn violations(&self) -> u64 {
        self.violations.total()
    }

    /// Returns the facts on which CLEAR rests at present, each with its source.
    #[must_use]
    pub fn facts(&self) -> Vec<Fact> {
        let present = || self.vehicles.iter().filter(|vehicle| vehicle.signed_off_s.is_none());
        let largest_m = present().filter_map(|vehicle| vehicle.position_error_m).reduce(f64::max);
        let mut facts = self.settings.facts(largest_m);
        let seen = |is_observed: bool| if is_observed { Source::Observed } else { Source::NotObservable };
        // A first velocity is not tested.
        if let Some(is_observed) = present().filter_map(|vehicle| vehicle.velocity.is_compared()).reduce(|a, b| a && b)
        {
            facts.push(Fact::new(FactKind::VelocityAgreement, seen(is_observed)));
        }
        facts.push(Fact::new(FactKind::OneStream, seen(self.settings.shows_two_streams())));
        facts.extend(self.plan_facts());
        facts
    }

    /// Returns the number of poses that were compared with the plan; `None` without a plan.
    #[must_use]
    pub fn compared(&self) -> Option<u64> {
        self.plan.names().next().map(|_| self.compared)
    }

    /// Returns the number of faults of a kind.
    #[must_use]
    pub fn faults(&self, fault: Fault) -> u64 {
        self.faults[fault as usize].total
    }

    /// Returns the number of events that did not fit into the queue.
    #[must_use]
    pub fn suppressed(&self) -> u64 {
        self.suppressed
    }

    /// Removes and returns the events since the last call.
    pub fn drain_events(&mut self) -> std::vec::Drain<'_, Event> {
        self.events.drain(..)
    }

    /// Returns the number of elements for which the monitor holds memory. It is constant once all vehicles are known.
    #[must_use]
    pub fn capacity(&self) -> usize {
        self.names.capacity()
            + self.vehicles.capacity()
            + self.events.capacity()
            + self.boxes.capacity()
            + self.ahead.capacity()
    }

    /// Returns whether a vehicle has signed off and was not heard since.
    #[must_use]
    pub fn has_signed_off(&self, vehicle: usize) -> bool {
        self.vehicles.get(vehicle).is_some_and(|of| of.signed_off_s.is_some())
    }

    /// Returns whether a vehicle is present and was not heard for the largest age.
    #[must_use]
    pub fn is_stale(&self, vehicle: usize) -> bool {
        let most_s = self.settings.max_age_s.value;
        !self.has_signed_off(vehicle) && self.newest(vehicle).is_some_and(|(.., age_s)| age_s > most_s)
    }

    /// Returns the measured violations that are present.
    pub fn open_violations(&self) -> impl Iterator<Item = Violation<Pair>> + '_ {
        self.violations.open()
    }

    /// Returns the newest position \[m\], the velocity \[m/s\] and the age \[s\] of a vehicle.
    #[must_use]
    pub fn newest(&self, vehicle: usize) -> Option<(Vector3<f64>, Option<Vector3<f64>>, f64)> {
        let of = self.vehicles.get(vehicle)?;
        let fix = of.history.newest()?;
        Some((fix.position_m, of.velocity.velocity().map(|ball| ball.centre), self.age_s(of).unwrap_or(f64::INFINITY)))
    }

    /// Returns the closest pairs of the last judgement, at most `count`, the closest one first. Stale vehicles and
    /// vehicles without a known velocity have no pair.
    #[must_use]
    pub fn closest_pairs(&self, count: usize) -> Vec<Separation> {
        self.ahead.closest_pairs(count)
    }

    /// Returns the index of a vehicle, and adds a vehicle that is not known; `None` beyond the largest number.
    fn vehicle(&mut self, id: &str) -> Option<u32> {
        let id = kept(id);
        let place = match self.find(id) {
            Ok(vehicle) => return Some(vehicle),
            Err(place) => place,
        };
        if self.names.len() >= self.settings.max_vehicles {
            return None;
        }
        let vehicle = u32::try_from(self.names.len()).ok()?;
        self.names.push(id.to_owned());
        self.by_name.insert(place, vehicle);
        if let Ok(k) = self.missing.binary_search_by(|name| name.as_str().cmp(id)) {
            self.missing.remove(k);
        }
        self.vehicles.push(Vehicle {
            clock: None,
            epoch: self.clock.map_or(0, |clock| clock.epoch()),
            history: History::new(),
            judged_t_s: None,
            taken_s: None,
            velocity: VelocityEnclosure::default(),
            position_error_m: None,
            streams: StampOrder::default(),
            has_two_streams: false,
            has_conflict: false,
            is_stale: false,
            signed_off_s: None,
            planned: self.plan.find(id),
            deviation_m: None,
            is_off_plan: false,
        });
        self.ahead.reserve(self.vehicles.len());
        self.boxes.reserve(self.vehicles.len());
        Some(vehicle)
    }

    /// Returns the index of a vehicle, or its place in the order of names.
    fn find(&self, id: &str) -> Result<u32, usize> {
        let place = self.by_name.binary_search_by(|&k| self.names[k as usize].as_str().cmp(id))?;
        Ok(self.by_name[place])
    }

    /// Returns the clock of a vehicle, unless it stepped since the vehicle was heard.
    fn clock_of(&self, of: &Vehicle) -> Option<SourceClock> {
        of.clock.or(self.clock).filter(|clock| clock.epoch() == of.epoch)
    }

    fn age_s(&self, of: &Vehicle) -> Option<f64> {
        let clock = self.clock_of(of)?;
        Some(clock.age_s(of.history.newest()?.t_s, self.now_s) + self.settings.latency_s.value)
    }
}

/// Returns the part of a name that is kept.
fn kept(id: &str) -> &str {
    let mut end = id.len().min(LONGEST_NAME);
    while !id.is_char_boundary(end) {
        end -= 1;
    }
    &id[..end]
}
