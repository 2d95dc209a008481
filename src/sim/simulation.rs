//! A flight that is advanced step by step.

use std::time::{Duration, Instant};

use super::controller::Controller;
use super::ending::{Breakdown, Ending, Flight, MAX_BEND_M, Performance, SimError};
use super::finding::{note, note_contacts};
use super::motion::Motion;
use super::parts::Parts;
use super::resolution;
use crate::audit::{Auditor, swept_separation_m};
use crate::feedback::Feedback as _;
use crate::law::{Certificate, Void};
use crate::plant::Path;
use crate::record::{Event, Sample};
use crate::scenario::{MAX_HALVINGS, Scenario};
use crate::space::NearPairs;
use crate::swarm::{ClosestApproach, Pair, Rows, Swarm, first_row_not_finite, row};
use crate::target::CurrentTarget;

/// From this many vehicles on, law and audit of a step run side by side when two threads are at hand. Both read the
/// same state and share nothing, so the answer has the same bits either way; below, starting a thread costs more.
const SIDE_BY_SIDE_FROM: usize = 512;

/// A flight under way: law, link, supervisor, vehicles and judge, with everything that any of them remembers.
///
/// [`Simulation::step`] flies one step; what is to be recorded of it is then handed out by [`Simulation::events`] and
/// [`Simulation::sample`]. A clone goes on by itself with the same bits, which is what [`Simulation::save`] keeps.
///
/// ```
/// use tautline::scenario::{Scenario, Source};
/// use tautline::sim::Simulation;
///
/// let scenario = Scenario::read(&Source::resolve("pentagon")?, &[])?;
/// let mut simulation = Simulation::new(&scenario)?;
/// for _ in 0..240 {
///     simulation.step();
/// }
/// let saved = simulation.save();
/// simulation.step();
/// simulation.load(&saved, None);
/// assert_eq!(simulation.time_s(), 1.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone)]
pub struct Simulation {
    scenario: Scenario,
    controller: Controller,
    motion: Motion,
    certificate: Certificate,
    auditor: Auditor,
    state: Swarm,
    next: Swarm,
    path: Path,
    /// Pairs that a step may have brought too near.
    near: NearPairs,
    control: Rows,
    /// Whether `control` was given from outside and the law has not been asked about the present state.
    overruled: bool,
    time_s: f64,
    steps: u64,
    /// Closest approach since the last sample.
    closest: Option<ClosestApproach>,
    /// Smallest separation over the last sweep: bounds from below how near any pair is now.
    nearest_m: f64,
    engine_contacts: Vec<Pair>,
    contacts_now: Vec<Pair>,
    events: Vec<Event>,
    sample_is_due: bool,
    ending: Option<Ending>,
    pub(super) performance: Performance,
}

/// A [`Simulation`] as it was at one instant.
#[derive(Clone)]
pub struct Saved(Simulation);

impl Simulation {
    /// The scenario at its start, with its own law and vehicles. The scenario must be one that [`Scenario::validate`]
    /// accepts.
    ///
    /// # Errors
    /// [`SimError`] where law or judge do not exist.
    pub fn new(scenario: &Scenario) -> Result<Self, SimError> {
        Self::with(scenario, Parts::of(scenario)?)
    }

    /// The scenario at its start with other parts, all of its number of vehicles. The start is judged, and the law asked.
    ///
    /// # Errors
    /// [`SimError`] where there is no judge.
    pub fn with(scenario: &Scenario, parts: Parts) -> Result<Self, SimError> {
        let Parts { law, motion, link, supervisor } = parts;
        let certificate = law
            .certificate(&scenario.observation(&scenario.start))
            .void_where(!supervisor.is_idle(), Void::TargetChanges)
            .void_where(!link.is_exact(), Void::InexactLink);
        let mut state = scenario.start.clone();
        motion.observe(&mut state);
        let target = CurrentTarget::first_of(&scenario.legs).ok_or(SimError::NoLeg)?;
        let mut simulation = Self {
            controller: Controller::new(law, link, supervisor, target, scenario.graph.clone()),
            motion,
            certificate,
            auditor: Auditor::new(scenario.count(), scenario.delta_m)?,
            next: state.clone(),
            path: Path::default(),
            near: NearPairs::default(),
            control: Rows::zeros(scenario.count()),
            overruled: false,
            state,
            time_s: 0.0,
            steps: 0,
            closest: None,
            nearest_m: 0.0,
            engine_contacts: Vec::new(),
            contacts_now: Vec::new(),
            events: Vec::new(),
            sample_is_due: false,
            ending: None,
            performance: Performance::default(),
            scenario: scenario.clone(),
        };
        let began = simulation.begin();
        simulation.sample_is_due = began.is_ok();
        simulation.end_on(began);
        Ok(simulation)
    }

    fn begin(&mut self) -> Result<(), Ending> {
        if let Some(vehicle) = self.state.first_not_finite() {
            return Err(Breakdown::StateNotFinite { step: 0, vehicle }.into());
        }
        self.judge_and_command(None)
    }

    /// Flies one step of the scenario's length, in halves where it is refused; nothing once the flight has ended.
    ///
    /// A step that takes more than half of the clearance above the law's barrier from some pair is refused, undone and
    /// flown in halves (at most [`crate::scenario::TimeSpec::max_halvings`] times), with the law asked anew in between.
    /// So is one on which a path bends by more than 1e-5 m from the straight line that the audit sweeps.
    pub fn step(&mut self) {
        if self.ending.is_none() && std::mem::take(&mut self.overruled) {
            let asked = self.ask();
            self.end_on(asked);
        }
        self.step_on();
    }

    /// Flies one step with accelerations \[m/s^2\], N x 3, from outside in the place of the law's, which is not asked.
    ///
    /// # Errors
    /// [`SimError::Commands`] where there is not a finite row for each vehicle; nothing is flown then. After the end nothing
    /// is flown either. A certificate that the law gave is void from then on.
    pub fn step_with(&mut self, commands: &Rows) -> Result<(), SimError> {
        let count = self.state.count();
        if commands.nrows() != count || first_row_not_finite(commands).is_some() {
            return Err(SimError::Commands { expected: count, found: commands.nrows() });
        }
        if self.ending.is_none() {
            self.overruled = true;
            self.certificate = self.certificate.clone().void_where(true, Void::CommandsFromOutside);
            self.control.clone_from(commands);
            self.motion.apply(commands, &mut self.state);
        }
        self.step_on();
        Ok(())
    }

    fn step_on(&mut self) {
        if self.ending.is_some() {
            return;
        }
        let step = self.steps + 1;
        let flown = self.advance(step).and_then(|()| Ok(resolution::check(&self.state, &self.scenario, step)?));
        let completed = flown.is_ok() && step == self.scenario.time.steps();
        self.sample_is_due = flown.is_ok() && self.scenario.time.records(step);
        self.end_on(flown);
        if completed {
            self.ending = Some(Ending::Completed);
        }
    }

    /// Ends the flight here because the caller wants it; one that has ended stays as it ended.
    pub fn interrupt(&mut self) {
        if self.ending.is_none() {
            self.end_on(Err(Ending::Interrupted));
        }
    }

    /// Ends the flight where it cannot go on; its last instant is recorded, unless it has been.
    fn end_on(&mut self, flown: Result<(), Ending>) {
        if let Err(ending) = flown {
            self.sample_is_due = self.closest.is_some();
            self.ending = Some(ending);
        }
    }

    /// How the flight ended, once it has.
    #[must_use]
    pub fn ending(&self) -> Option<&Ending> {
        self.ending.as_ref()
    }

    /// The present state.
    #[must_use]
    pub fn state(&self) -> &Swarm {
        &self.state
    }

    /// The accelerations \[m/s^2\], N x 3, that are held from now on; no rows where the law had no answer.
    #[must_use]
    pub fn control(&self) -> &Rows {
        &self.control
    }

    /// Time flown \[s\].
    #[must_use]
    pub fn time_s(&self) -> f64 {
        self.time_s
    }

    /// Whole steps flown.
    #[must_use]
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// Takes what happened since this was asked last, in its order.
    pub fn events(&mut self) -> impl Iterator<Item = Event> + '_ {
        self.events.drain(..)
    }

    /// The present instant where the recording rate, or the end of the flight, asks for it, once.
    pub fn sample(&mut self) -> Option<Sample<'_>> {
        if !std::mem::take(&mut self.sample_is_due) {
            return None;
        }
        Some(Sample {
            time_s: self.time_s,
            step: self.steps,
            swarm: &self.state,
            control: &self.control,
            separation: self.closest.take(),
            energy: self.controller.energy(self.time_s, &self.state),
            channels: &[],
        })
    }

    /// Everything as it is now.
    #[must_use]
    pub fn save(&self) -> Saved {
        Saved(self.clone())
    }

    /// Becomes what was saved, of whatever scenario, and goes on with the same bits as if it had never been interrupted; with a `noise_seed`, the random
    /// numbers of the link begin anew from it and nothing else changes.
    pub fn load(&mut self, saved: &Saved, noise_seed: Option<u64>) {
        self.clone_from(&saved.0);
        if let Some(seed) = noise_seed {
            self.controller.link.reseed(seed);
        }
    }

    /// What the flight left behind besides its recording. One that is under way counts as interrupted here.
    #[must_use]
    pub fn finish(self) -> Flight {
        Flight {
            law: self.controller.law.name().to_owned(),
            ending: self.ending.unwrap_or(Ending::Interrupted),
            duration_s: self.time_s,
            steps: self.steps,
            certificate: self.certificate,
            audit: self.auditor.finish(),
            engine_contacts: self.engine_contacts,
            last: self.state,
            performance: self.performance,
        }
    }

    /// Flies one step, in halves where it is refused.
    fn advance(&mut self, step: u64) -> Result<(), Ending> {
        let whole = 1_u64 << self.scenario.time.max_halvings.min(MAX_HALVINGS);
        let mut shortest = whole;
        let flown = self.fly_parts(step, whole, &mut shortest);
        if shortest < whole {
            let dt_s = self.scenario.time.dt_s;
            let (time_s, dt_s) = ((step - 1) as f64 * dt_s, dt_s * (shortest as f64 / whole as f64));
            self.events.push(Event::StepRefined { time_s, dt_s });
        }
        flown
    }

    /// Flies the `whole` parts of a step, as many at once as are not refused; the fewest at once are `shortest`.
    fn fly_parts(&mut self, step: u64, whole: u64, shortest: &mut u64) -> Result<(), Ending> {
        let dt_s = self.scenario.time.dt_s;
        let seconds = |parts: u64| dt_s * (parts as f64 / whole as f64);
        let (mut flown, mut part) = (0, whole);
        while flown < whole {
            self.move_vehicles(step, seconds(part))?;
            let bend_m = self.path.bend_m();
            if part > 1 && (bend_m > MAX_BEND_M || self.is_refused()) {
                self.motion.restore(&self.state);
                self.controller.link.forget_after(self.time_s);
                part /= 2;
                *shortest = part.min(*shortest);
                continue;
            }
            if bend_m > MAX_BEND_M {
                return Err(Breakdown::Bent { step, bend_m }.into());
            }
            flown += part;
            let from_s = self.time_s;
            if flown == whole {
                self.steps = step;
                self.time_s = step as f64 * dt_s;
            } else {
                self.time_s = (step - 1) as f64 * dt_s + seconds(flown);
            }
            std::mem::swap(&mut self.state, &mut self.next);
            self.judge_and_command(Some((step, from_s)))?;
            while part < whole && flown.is_multiple_of(2 * part) {
                part *= 2;
            }
        }
        Ok(())
    }

    /// Moves the vehicles from `state` to `next`.
    fn move_vehicles(&mut self, step: u64, dt_s: f64) -> Result<(), Ending> {
        let began = Instant::now();
        let held = self.overruled.then_some(&self.control);
        let interval = (step, self.time_s, dt_s);
        self.motion.advance(interval, held, &mut self.controller, &mut self.next, &mut self.path)?;
        self.performance.physics += began.elapsed();
        match self.next.first_not_finite() {
            Some(vehicle) => Err(Breakdown::StateNotFinite { step, vehicle }.into()),
            None => Ok(()),
        }
    }

    /// Whether the move from `state` to `next` takes more than half of some pair's clearance above the barrier.
    fn is_refused(&mut self) -> bool {
        let Some(barrier_m) = self.controller.law.barrier_m() else { return false };
        let start = &self.state.positions_m;
        let instants = || self.path.passed().map(|(_, rows)| rows).chain([&self.next.positions_m]);
        let moved_m = instants()
            .flat_map(|rows| (0..start.nrows()).map(move |i| (row(rows, i) - row(start, i)).norm()))
            .fold(0.0, f64::max);
        // No pair is nearer than `nearest_m` and none closes by more than twice the longest move.
        if 2.0 * moved_m <= 0.5 * (self.nearest_m - barrier_m) {
            return false;
        }
        let loses_half = |(i, j): (usize, usize)| {
            let apart = |rows: &Rows| row(rows, j) - row(rows, i);
            let mut from = apart(start);
            let least_m = barrier_m + 0.5 * (from.norm() - barrier_m);
            instants().map(apart).any(|to| swept_separation_m(std::mem::replace(&mut from, to), to) < least_m)
        };
        if self.controller.law.sensing_range_m().is_none() {
            return self.controller.links.edges().any(loses_half);
        }
        // A pair that begins farther apart keeps half of its clearance.
        self.near.update(start, barrier_m + 4.0 * moved_m);
        self.near.pairs().iter().copied().any(loses_half)
    }

    /// Audits the way that led to `state` (or the start), asks the law for the next command and lets the vehicles hold it.
    fn judge_and_command(&mut self, step: Option<(u64, f64)>) -> Result<(), Ending> {
        let (number, from_s) = step.unwrap_or((0, self.time_s));
        if let Err(why) = self.judge_passed(from_s) {
            return Err(Breakdown::Audit { step: number, why }.into());
        }
        self.controller.accept(self.time_s, &self.state);
        self.controller.link.settle(self.time_s);
        self.supervise()?;
        let Self { auditor, controller, state, control, time_s, overruled, .. } = self;
        let (state, time_s, overruled): (&Swarm, f64, bool) = (state, *time_s, *overruled);
        let audit = move || {
            let began = Instant::now();
            let auditor = auditor;
            let finding = match step {
                None => auditor.start(time_s, &state.positions_m),
                Some(_) => auditor.step(time_s, &state.positions_m),
            };
            (finding, began.elapsed())
        };
        let mut command = || {
            let began = Instant::now();
            let commanded = if overruled { Ok(()) } else { controller.command(time_s, state, control) };
            (commanded, began.elapsed())
        };
        let side_by_side = state.count() >= SIDE_BY_SIDE_FROM && rayon::current_num_threads() > 1;
        let ((finding, audit_time), (commanded, law_time)) =
            if side_by_side { rayon::join(audit, command) } else { (audit(), command()) };
        let noted = finding.map(|finding| note(finding, &mut self.closest, &mut self.nearest_m, &mut self.events));
        self.performance.audit += audit_time;
        let commanded = self.hold(number, commanded.map_err(Ending::from), law_time);
        noted.map_err(|why| Breakdown::Audit { step: number, why })?;
        self.note_engine_contacts();
        commanded
    }

    /// Audits the instants between the ends of the last step.
    fn judge_passed(&mut self, from_s: f64) -> Result<(), crate::audit::AuditError> {
        for (after_s, positions_m) in self.path.passed() {
            let finding = self.auditor.step(from_s + after_s, positions_m)?;
            note(finding, &mut self.closest, &mut self.nearest_m, &mut self.events);
        }
        Ok(())
    }

    /// Asks the law about the present state.
    fn ask(&mut self) -> Result<(), Ending> {
        let began = Instant::now();
        let commanded = self.controller.command(self.time_s, &self.state, &mut self.control);
        self.hold(self.steps, commanded.map_err(Ending::from), began.elapsed())
    }

    /// Lets the vehicles hold the command from now on, where there is one.
    fn hold(&mut self, step: u64, commanded: Result<(), Ending>, took: Duration) -> Result<(), Ending> {
        self.performance.law += took;
        let checked = commanded.and_then(|()| match first_row_not_finite(&self.control) {
            Some(vehicle) => Err(Breakdown::CommandNotFinite { step, vehicle }.into()),
            None => Ok(()),
        });
        match checked {
            Ok(()) => self.motion.apply(&self.control, &mut self.state),
            Err(_) => self.control = Rows::zeros(0),
        }
        checked
    }

    fn supervise(&mut self) -> Result<(), Ending> {
        let before = self.controller.target.view().leg;
        let followed = self.controller.supervise(self.time_s, &self.state);
        let leg = self.controller.target.view().leg;
        if leg != before {
            self.events.push(Event::LegBegan { leg, time_s: self.time_s });
        }
        followed.inspect_err(|_| self.control = Rows::zeros(0))?;
        Ok(())
    }

    fn note_engine_contacts(&mut self) {
        self.contacts_now.clear();
        self.motion.keep_out_contacts(&mut self.contacts_now);
        note_contacts(&self.contacts_now, &mut self.engine_contacts, self.time_s, &mut self.events);
    }
}
