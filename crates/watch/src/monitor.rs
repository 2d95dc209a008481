//! The monitor: poses in, events and judgements out. It has no input, output or clock of its own.

use nalgebra::Vector3;

use crate::ahead;
use crate::clock::{STEP_S, SourceClock};
use crate::event::{Assessment, Event, Fault, Pair, PairTime, Reason, State};
use crate::history::{Fix, History};
use crate::pair::{Prediction, sweep};
use crate::plan::Plan;
use crate::settings::{
    ClockScope, Expected, LARGEST_POSITION_M, LARGEST_SPEED_M_S, LARGEST_TIME_S, Settings, SettingsError, TimeBase,
};
use crate::violations::OpenViolations;

/// Largest number of events that wait for [`Monitor::drain_events`]; further ones are counted.
pub const MOST_EVENTS: usize = 4096;
/// Largest number of bytes of a name that are kept.
pub const LONGEST_NAME: usize = 100;
/// Smallest time between two events of one fault \[s\].
const FAULT_PERIOD_S: f64 = 1.0;

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
}

/// Pose that the monitor took, for a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Taken {
    /// The vehicle.
    pub vehicle: u32,
    /// Stamp as a time of the monitor \[s\]; it increases strictly for each vehicle.
    pub time_s: f64,
}

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
    /// Velocity at the newest position and the bound on its error.
    velocity: Option<(Vector3<f64>, f64)>,
    /// Whether the newest stamp has two positions.
    has_conflict: bool,
    is_stale: bool,
    /// Index into the plan.
    planned: Option<usize>,
    deviation_m: Option<f64>,
    is_off_plan: bool,
}

#[derive(Clone, Copy, Default)]
struct FaultCount {
    total: u64,
    waiting: u64,
    vehicle: Option<u32>,
    reported_s: Option<f64>,
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
    events: Vec<Event>,
    suppressed: u64,
    violations: OpenViolations,
    /// Number of poses that were compared with the plan.
    compared: u64,
    judgement: u64,
    ahead: ahead::Scratch,
    boxes: Vec<SweptBox>,
}

/// Box around the motion of a vehicle since the last judgement \[m\].
#[derive(Clone, Copy)]
struct SweptBox {
    vehicle: u32,
    low_m: Vector3<f64>,
    high_m: Vector3<f64>,
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
            events: Vec::with_capacity(MOST_EVENTS),
            suppressed: 0,
            violations: OpenViolations::new(),
            compared: 0,
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

    /// Returns the newest position \[m\], the velocity \[m/s\] and the age \[s\] of a vehicle.
    #[must_use]
    pub fn newest(&self, vehicle: usize) -> Option<(Vector3<f64>, Option<Vector3<f64>>, f64)> {
        let of = self.vehicles.get(vehicle)?;
        let fix = of.history.newest()?;
        Some((fix.position_m, of.velocity.map(|(velocity, _)| velocity), self.age_s(of).unwrap_or(f64::INFINITY)))
    }

    /// Takes a pose that arrived at `arrival_s` on the caller's clock \[s\], which must not go back. Returns the
    /// vehicle and the time of the monitor of a used pose, `None` for an ignored pose.
    pub fn take(&mut self, pose: &Pose<'_>, arrival_s: f64) -> Option<Taken> {
        let within = |of: &Vector3<f64>, most: f64| of.iter().all(|x| x.abs() <= most);
        let is_readable = pose.t_s.abs() <= LARGEST_TIME_S
            && within(&pose.position_m, LARGEST_POSITION_M)
            && pose.velocity_m_s.is_none_or(|velocity| within(&velocity, LARGEST_SPEED_M_S));
        if !is_readable {
            self.fault(Fault::OutOfRange, None, arrival_s);
            return None;
        }
        let scope = match self.settings.time_base {
            TimeBase::Arrival => self.settings.clocks,
            TimeBase::Stamps => ClockScope::Common,
        };
        let is_first = self.vehicles.is_empty() && scope == ClockScope::Common;
        if is_first {
            // Times of the monitor are those of the first source from here on.
            self.shift_s = pose.t_s - arrival_s;
            self.now_s = f64::NEG_INFINITY;
        }
        let Some(vehicle) = self.vehicle(pose.id) else {
            self.fault(Fault::TooManyVehicles, None, arrival_s);
            return None;
        };
        let (k, of) = (vehicle as usize, &self.vehicles[vehicle as usize]);
        let own = if scope == ClockScope::Common { self.clock } else { of.clock };
        let newest = of.history.newest();
        let arrival_s = match (self.settings.time_base, own) {
            (TimeBase::Arrival, _) => arrival_s + self.shift_s,
            (TimeBase::Stamps, Some(clock)) => clock.time_of(pose.t_s),
            (TimeBase::Stamps, None) => pose.t_s,
        };
        self.now_s = self.now_s.max(arrival_s);
        let now_s = self.now_s;
        if is_first {
            self.faults.iter_mut().for_each(|count| count.reported_s = None);
            self.doubt = self.doubt.map(|(fault, _)| (fault, now_s));
        }
        let mut clock = own.unwrap_or_else(|| SourceClock::new(pose.t_s, now_s, scope == ClockScope::Common));
        let is_same_clock = of.epoch == clock.epoch();
        let back_s = newest.filter(|_| is_same_clock).map_or(0.0, |fix| fix.t_s - pose.t_s);
        let jumps = self.settings.time_base == TimeBase::Arrival
            && own.is_some()
            && clock.is_ahead(pose.t_s, now_s, STEP_S.min(self.settings.max_age_s / 2.0));
        let steps = back_s > STEP_S || jumps;
        if steps {
            clock.step(pose.t_s, now_s);
        }
        if !steps
            && back_s >= 0.0
            && is_same_clock
            && let Some(fix) = newest
        {
            if back_s > 0.0 {
                self.fault_at(Fault::Reordered, Some(vehicle), now_s);
            } else if fix.position_m == pose.position_m {
                self.fault_at(Fault::Duplicate, Some(vehicle), now_s);
            } else {
                self.vehicles[k].has_conflict = true;
                self.fault_at(Fault::Conflict, Some(vehicle), now_s);
            }
            return None;
        }
        let is_fast = clock.take(pose.t_s, now_s);
        if steps || is_fast {
            self.fault_at(Fault::ClockStep, Some(vehicle), now_s);
        }
        if scope == ClockScope::Common {
            self.clock = Some(clock);
        } else {
            clock.settle();
            self.vehicles[k].clock = Some(clock);
        }
        if newest.is_none() {
            self.emit(Event::Heard { vehicle, at_s: now_s });
        }
        if self.vehicles[k].epoch != clock.epoch() {
            self.forget(vehicle, clock.epoch());
        }
        if self.breaks_bounds(k, pose) {
            self.fault_at(Fault::OutOfBounds, Some(vehicle), now_s);
        }
        let (eps, accel) = (self.settings.position_error_m, self.settings.accel_m_s2);
        let of = &mut self.vehicles[k];
        of.history.push(Fix { t_s: pose.t_s, position_m: pose.position_m });
        of.has_conflict = false;
        of.velocity = match pose.velocity_m_s {
            Some(velocity) => Some((velocity, self.settings.velocity_error_m_s)),
            None => of.history.velocity(eps, accel),
        };
        let at_s = clock.time_of(pose.t_s);
        // The offset of a clock may shrink by more than the time between two stamps.
        let time_s = of.taken_s.map_or(at_s, |last_s| at_s.max(last_s.next_up()));
        of.taken_s = Some(time_s);
        self.compare_with_plan(vehicle, at_s, pose.position_m);
        Some(Taken { vehicle, time_s })
    }

    /// Moves the present to a stamp of the common clock \[s\], with [`TimeBase::Stamps`]. Returns the time by which it
    /// moves \[s\]; a stamp of the past moves nothing.
    pub fn advance(&mut self, t_s: f64) -> f64 {
        let Some(clock) = self.clock.filter(|_| t_s.abs() <= LARGEST_TIME_S) else { return 0.0 };
        let (before_s, now_s) = (self.now_s, self.now_s.max(clock.time_of(t_s)));
        self.now_s = now_s;
        now_s - before_s
    }

    /// Returns how far a stamp of the common clock lies after the present \[s\]; `None` before the first pose.
    #[must_use]
    pub fn is_ahead_s(&self, t_s: f64) -> Option<f64> {
        let clock = self.clock.filter(|_| t_s.abs() <= LARGEST_TIME_S)?;
        Some(clock.time_of(t_s) - self.now_s)
    }

    /// Counts an error of the input at an arrival time \[s\].
    pub fn fault(&mut self, fault: Fault, vehicle: Option<u32>, arrival_s: f64) {
        let at_s = match self.settings.time_base {
            TimeBase::Arrival => self.time_of_arrival(arrival_s),
            TimeBase::Stamps if self.now_s.is_finite() => self.now_s,
            TimeBase::Stamps => 0.0,
        };
        self.fault_at(fault, vehicle, at_s.max(self.now_s));
    }

    /// Judges the present and the past since the last call. `arrival_s` is the present on the caller's clock \[s\];
    /// it is ignored with [`TimeBase::Stamps`].
    pub fn assess(&mut self, arrival_s: f64) -> Assessment {
        if self.settings.time_base == TimeBase::Arrival {
            self.now_s = self.now_s.max(self.time_of_arrival(arrival_s));
        }
        let now_s = self.now_s;
        self.judge_past();
        let mut reason = None;
        let mut note = |of: Reason| reason = reason.or(Some(of));
        if let Expected::Names(_) = self.settings.expected
            && !self.missing.is_empty()
        {
            note(Reason::MissingName(0));
        }
        match self.settings.expected {
            Expected::Count(count) if self.names.len() < count => note(Reason::Missing([self.names.len(), count])),
            _ if self.names.len() < 2 => note(Reason::TooFew(self.names.len())),
            _ => {}
        }
        if let Some((fault, at_s)) = self.doubt
            && now_s - at_s < self.settings.max_age_s
        {
            note(Reason::Doubt(fault));
        }
        self.ahead.clear();
        for k in 0..self.vehicles.len() {
            let vehicle = u32::try_from(k).unwrap_or(u32::MAX);
            let of = &self.vehicles[k];
            let Some(age_s) = self.age_s(of) else {
                note(Reason::ClockStepped(vehicle));
                continue;
            };
            let (was_stale, is_stale) = (of.is_stale, age_s > self.settings.max_age_s);
            let ready = match (of.velocity, of.history.newest()) {
                _ if is_stale => Err(Reason::Stale(vehicle, age_s)),
                (Some((velocity, error_m_s)), Some(fix)) => {
                    let (eps, accel) = (self.settings.position_error_m, self.settings.accel_m_s2);
                    if of.has_conflict {
                        note(Reason::Conflict(vehicle));
                    }
                    Ok(Prediction::new(fix.position_m, velocity, age_s, eps, error_m_s, accel))
                }
                _ => Err(Reason::SpeedUnknown(vehicle)),
            };
            match ready {
                Ok(prediction) => self.ahead.push(vehicle, prediction),
                Err(of) => note(of),
            }
            self.vehicles[k].is_stale = is_stale;
            match (was_stale, is_stale) {
                (false, true) => self.emit(Event::Stale { vehicle, age_s, at_s: now_s }),
                (true, false) => self.emit(Event::Back { vehicle, at_s: now_s }),
                _ => {}
            }
        }
        self.report_faults();
        let found = self.ahead.search(&self.settings);
        let measured = self.violations.worst();
        let nearest = found.closest.filter(|near| near.nominal_m < self.settings.delta_m);
        let state = match (nearest, measured, reason, found.uncertain) {
            (Some(near), ..) => State::Violation(near.pair, near.nominal_m),
            (None, Some(of), ..) => State::Violation(of.pair, of.min_m),
            (None, None, Some(reason), _) => State::NotKnown(reason),
            (None, None, None, Some((pair, least_m))) => State::NotKnown(Reason::Uncertain(pair, least_m)),
            (None, None, None, None) => State::Clear,
        };
        let time = |(pair, in_s): (Pair, f64)| PairTime { pair, at_s: now_s + in_s };
        let clear = found.clear.filter(|_| state == State::Clear);
        let deviations = self.vehicles.iter().enumerate().filter(|(_, of)| !of.is_stale);
        Assessment {
            now_s,
            state,
            heard: self.names.len(),
            closest: found.closest,
            clear_until: clear.map(time),
            is_clear_to_horizon: clear.is_some_and(|(_, in_s)| in_s >= self.settings.horizon_s),
            nominal_violation: found.nominal_violation.map(time),
            last_brake: found.last_brake.map(time),
            deviation: deviations
                .filter_map(|(k, of)| Some((u32::try_from(k).ok()?, of.deviation_m?)))
                .max_by(|a, b| a.1.total_cmp(&b.1)),
        }
    }

    /// Ends the watch: judges the past and ends the measured violations that are present.
    pub fn finish(&mut self, arrival_s: f64) -> Assessment {
        let last = self.assess(arrival_s);
        while let Some(of) = self.violations.close(None) {
            self.emit(Event::Ended(of));
        }
        for count in &mut self.faults {
            count.reported_s = None;
        }
        self.report_faults();
        last
    }

    /// Returns the index of a vehicle, and adds a vehicle that is not known; `None` beyond the largest number.
    fn vehicle(&mut self, id: &str) -> Option<u32> {
        let mut end = id.len().min(LONGEST_NAME);
        while !id.is_char_boundary(end) {
            end -= 1;
        }
        let id = &id[..end];
        let place = match self.by_name.binary_search_by(|&k| self.names[k as usize].as_str().cmp(id)) {
            Ok(place) => return Some(self.by_name[place]),
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
            velocity: None,
            has_conflict: false,
            is_stale: false,
            planned: self.plan.find(id),
            deviation_m: None,
            is_off_plan: false,
        });
        self.ahead.reserve(self.vehicles.len());
        self.boxes.reserve(self.vehicles.len());
        Some(vehicle)
    }

    /// Returns the clock of a vehicle, unless it stepped since the vehicle was heard.
    fn clock_of(&self, of: &Vehicle) -> Option<SourceClock> {
        of.clock.or(self.clock).filter(|clock| clock.epoch() == of.epoch)
    }

    fn age_s(&self, of: &Vehicle) -> Option<f64> {
        let clock = self.clock_of(of)?;
        Some(clock.age_s(of.history.newest()?.t_s, self.now_s) + self.settings.latency_s)
    }

    /// Drops the history of a vehicle after a step of its clock.
    fn forget(&mut self, vehicle: u32, epoch: u32) {
        let of = &mut self.vehicles[vehicle as usize];
        of.history.clear();
        (of.epoch, of.judged_t_s, of.velocity) = (epoch, None, None);
        while let Some(of) = self.violations.close(Some(vehicle)) {
            self.emit(Event::Ended(of));
        }
    }

    /// Returns whether a vehicle cannot have moved from its newest position to this pose within the bounds.
    fn breaks_bounds(&self, k: usize, pose: &Pose<'_>) -> bool {
        let of = &self.vehicles[k];
        let (Some(fix), Some((velocity, error_m_s))) = (of.history.newest(), of.velocity) else { return false };
        let h_s = pose.t_s - fix.t_s;
        let accel = self.settings.accel_m_s2;
        let bound_m = 2.0 * self.settings.position_error_m
            + error_m_s * h_s
            + accel * h_s * h_s / 2.0
            // Stamps may be wrong by one unit in the last place.
            + velocity.norm() * 4.0 * f64::EPSILON * pose.t_s.abs();
        let moved_m = (pose.position_m - fix.position_m - velocity * h_s).norm();
        moved_m > bound_m * (1.0 + 1e-9) + 1e-9 * (1.0 + pose.position_m.amax())
    }

    fn compare_with_plan(&mut self, vehicle: u32, time_s: f64, position_m: Vector3<f64>) {
        let of = &mut self.vehicles[vehicle as usize];
        let planned = of.planned.and_then(|k| self.plan.position_m(k, time_s));
        of.deviation_m = planned.map(|planned| (position_m - planned).norm());
        self.compared += u64::from(planned.is_some());
        let was_outside = of.is_off_plan;
        of.is_off_plan = of.deviation_m.is_some_and(|deviation| deviation > self.settings.tube_m);
        let (is_outside, deviation_m) = (of.is_off_plan, of.deviation_m.unwrap_or(0.0));
        if is_outside != was_outside {
            self.emit(Event::Plan { vehicle, deviation_m, is_outside, at_s: self.now_s });
        }
    }

    fn fault_at(&mut self, fault: Fault, vehicle: Option<u32>, at_s: f64) {
        let count = &mut self.faults[fault as usize];
        count.total += 1;
        count.waiting += 1;
        count.vehicle = vehicle;
        if fault.gives_doubt() {
            self.doubt = Some((fault, at_s));
        }
        if count.reported_s.is_none() {
            self.report_faults_at(at_s);
        }
    }

    fn report_faults(&mut self) {
        self.report_faults_at(self.now_s);
    }

    /// Emits an event for each kind of fault that occurred, at most one in each period.
    fn report_faults_at(&mut self, at_s: f64) {
        for fault in Fault::ALL {
            let count = &mut self.faults[fault as usize];
            let is_due = count.reported_s.is_none_or(|last_s| at_s - last_s >= FAULT_PERIOD_S);
            if count.waiting > 0 && is_due {
                let event = Event::Fault { fault, count: count.waiting, vehicle: count.vehicle, at_s };
                (count.waiting, count.reported_s) = (0, Some(at_s));
                self.emit(event);
            }
        }
    }

    fn emit(&mut self, event: Event) {
        if self.events.len() < MOST_EVENTS {
            self.events.push(event);
        } else {
            self.suppressed += 1;
        }
    }

    /// Judges all pairs over the time between the last judgement and the newest positions.
    ///
    /// The motion between two positions of a vehicle is straight. A gap longer than the largest age is not judged,
    /// because the vehicle was stale within the gap.
    fn judge_past(&mut self) {
        // Time until which every vehicle with a new position was judged.
        let mut floor_s = f64::INFINITY;
        for of in &self.vehicles {
            let (Some(newest), Some(clock)) = (of.history.newest(), self.clock_of(of)) else { continue };
            let mut judged_t_s = of.judged_t_s.unwrap_or(of.history.at(0).t_s);
            // A gap is not judged.
            let next = (of.history.up_to(judged_t_s) + 1).min(of.history.len() - 1);
            if of.history.at(next).t_s - judged_t_s > self.settings.max_age_s {
                judged_t_s = of.history.at(next).t_s;
            }
            if newest.t_s > judged_t_s {
                floor_s = floor_s.min(clock.time_of(judged_t_s));
            }
        }
        if floor_s == f64::INFINITY {
            return;
        }
        self.judgement += 1;
        self.boxes.clear();
        let mut lost = None;
        for (k, of) in self.vehicles.iter().enumerate() {
            let (Some(newest), Some(clock)) = (of.history.newest(), self.clock_of(of)) else { continue };
            let (mut low_m, mut high_m) = (newest.position_m, newest.position_m);
            for step in (0..of.history.len()).rev() {
                let fix = of.history.at(step);
                (low_m, high_m) = (low_m.inf(&fix.position_m), high_m.sup(&fix.position_m));
                if clock.time_of(fix.t_s) <= floor_s {
                    break;
                }
            }
            if of.history.is_wrapped() && clock.time_of(of.history.at(0).t_s) > floor_s {
                lost = lost.or(u32::try_from(k).ok());
            }
            // The box of each vehicle is wider by half of the limit.
            let room_m = Vector3::repeat(self.settings.delta_m / 2.0 * (1.0 + 1e-9) + 1e-6);
            let vehicle = u32::try_from(k).unwrap_or(u32::MAX);
            self.boxes.push(SweptBox { vehicle, low_m: low_m - room_m, high_m: high_m + room_m });
        }
        if let Some(vehicle) = lost {
            self.fault_at(Fault::NotJudged, Some(vehicle), self.now_s);
        }
        let axis = ahead::widest_axis(self.boxes.iter().map(|of| of.low_m));
        self.boxes.sort_unstable_by(|a, b| a.low_m[axis].total_cmp(&b.low_m[axis]));
        for a in 0..self.boxes.len() {
            let first = self.boxes[a];
            for b in a + 1..self.boxes.len() {
                let second = self.boxes[b];
                if second.low_m[axis] > first.high_m[axis] {
                    break;
                }
                if (0..3).all(|k| first.low_m[k] <= second.high_m[k] && second.low_m[k] <= first.high_m[k]) {
                    let (i, j) = (first.vehicle.min(second.vehicle), first.vehicle.max(second.vehicle));
                    self.judge_pair([i, j]);
                }
            }
        }
        while let Some(pair) = self.violations.unexamined(self.judgement) {
            self.judge_pair(pair);
            self.violations.examined(pair, self.judgement);
        }
        for of in &mut self.vehicles {
            of.judged_t_s = of.history.newest().map(|fix| fix.t_s);
        }
    }

    /// Judges a pair over its time since the last judgement.
    fn judge_pair(&mut self, pair: Pair) {
        let number = self.judgement;
        self.violations.examined(pair, number);
        let of = pair.map(|k| &self.vehicles[k as usize]);
        let [Some(clock_a), Some(clock_b)] = of.map(|of| self.clock_of(of)) else { return };
        let clocks = [clock_a, clock_b];
        let first_s = [0, 1].map(|k| clocks[k].time_of(of[k].history.at(0).t_s));
        let newest_s = [0, 1].map(|k| clocks[k].time_of(of[k].history.at(of[k].history.len() - 1).t_s));
        let judged_s = [0, 1].map(|k| of[k].judged_t_s.map_or(first_s[k], |t_s| clocks[k].time_of(t_s)));
        let from_s = judged_s[0].min(judged_s[1]).max(first_s[0]).max(first_s[1]);
        let to_s = newest_s[0].min(newest_s[1]);
        let mut at = [0, 1].map(|k| of[k].history.up_to(from_s - clocks[k].time_of(0.0)));
        let mut time_s = from_s;
        while time_s < to_s {
            let of = pair.map(|k| &self.vehicles[k as usize].history);
            let mut ends = [(Fix::default(), Fix::default()); 2];
            for k in 0..2 {
                while at[k] + 2 < of[k].len() && clocks[k].time_of(of[k].at(at[k] + 1).t_s) <= time_s {
                    at[k] += 1;
                }
                ends[k] = (of[k].at(at[k]), of[k].at(at[k] + 1));
            }
            let end_s = [0, 1].into_iter().fold(to_s, |end_s, k| end_s.min(clocks[k].time_of(ends[k].1.t_s)));
            if end_s <= time_s {
                break;
            }
            let is_gap = ends.iter().any(|(from, to)| to.t_s - from.t_s > self.settings.max_age_s);
            if !is_gap {
                let apart = |at_s: f64| {
                    let place = |k: usize| {
                        let (from, to) = ends[k];
                        let (from_s, to_s) = (clocks[k].time_of(from.t_s), clocks[k].time_of(to.t_s));
                        let share = ((at_s - from_s) / (to_s - from_s)).clamp(0.0, 1.0);
                        from.position_m + (to.position_m - from.position_m) * share
                    };
                    place(0) - place(1)
                };
                let found = sweep(apart(time_s), apart(end_s), self.settings.delta_m);
                for event in self.violations.take(pair, [time_s, end_s], &found, number).into_iter().flatten() {
                    self.emit(event);
                }
            }
            time_s = end_s;
        }
    }
}
