//! A flight that is advanced step by step.

use std::time::{Duration, Instant};

use super::controller::Controller;
use super::ending::{Breakdown, Ending, Flight, MAX_BEND_M, Performance, SimError};
use super::judge::{Judge, Judged};
use super::motion::Motion;
use super::parts::Parts;
use super::resolution::Resolution;
use super::watch::Watch;
use crate::feedback::Feedback as _;
use crate::law::{Certificate, Void};
use crate::plant::Path;
use crate::record::{Event, Peaks, Sample};
use crate::scenario::{MAX_HALVINGS, Scenario};
use crate::swarm::{Rows, Swarm, first_row_not_finite, largest_row_norm};

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
/// simulation.load(&saved, None);
/// assert_eq!(simulation.time_s(), 1.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone)]
pub struct Simulation {
    scenario: Scenario,
    resolution: Resolution,
    controller: Controller,
    motion: Motion,
    certificate: Certificate,
    judge: Judge,
    state: Swarm,
    next: Swarm,
    path: Path,
    control: Rows,
    /// Whether `control` was given from outside and the law has not been asked about the present state.
    overruled: bool,
    time_s: f64,
    steps: u64,
    events: Vec<Event>,
    /// The fewest parts at once in the last step.
    shortest: u64,
    /// Energy of the present state \[m^2/s^2\].
    energy: Option<f64>,
    watch: Watch,
    /// Since the last sample.
    peaks: Peaks,
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
        let count = scenario.count();
        if motion.count() != count {
            return Err(SimError::Vehicles { expected: count, found: motion.count() });
        }
        let certificate = scenario
            .certificate(law.as_ref())
            .void_where(!supervisor.keeps_to(&scenario.legs), Void::TargetChanges)
            .void_where(!link.is_exact(), Void::InexactLink);
        let mut state = scenario.start.clone();
        motion.observe(&mut state);
        let flies_another = scenario.law().is_ok_and(|own| own.name() != law.name());
        let other_law = flies_another.then(|| Event::OtherLaw { time_s: 0.0, name: law.name().to_owned() });
        let mut simulation = Self {
            controller: Controller::new(scenario, law, link, supervisor)?,
            motion,
            certificate,
            judge: Judge::new(scenario)?,
            next: state.clone(),
            path: Path::default(),
            control: Rows::zeros(count),
            overruled: false,
            state,
            time_s: 0.0,
            steps: 0,
            events: other_law.into_iter().collect(),
            shortest: 0,
            energy: None,
            watch: Watch::default(),
            peaks: Peaks::default(),
            sample_is_due: false,
            ending: None,
            performance: Performance::default(),
            resolution: Resolution::of(scenario),
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
        self.judge_and_command(None, true)
    }

    /// Flies one step of the scenario's length, in parts where that is too long; nothing once the flight has ended.
    ///
    /// A step that is too long for the law's fastest rate at the present state
    /// ([`crate::scenario::TimeSpec::max_rate_dt`]) is flown in halves (at most
    /// [`crate::scenario::TimeSpec::max_halvings`] times), with the law asked anew in between. A step that
    /// takes more than half of the clearance above the law's barrier from some pair is refused, undone and flown in halves;
    /// so is one on which a path bends by more than 1e-5 m from the straight line that the audit sweeps.
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
        let flown = self.advance(step).and_then(|()| Ok(self.resolution.check(&self.state, step)?));
        self.sample_is_due = flown.is_ok() && self.scenario.time.records(step);
        let is_last = step == self.scenario.time.steps();
        self.end_on(flown.and(if is_last { Err(Ending::Completed) } else { Ok(()) }));
    }

    /// Ends the flight here because the caller wants it; one that has ended stays as it ended.
    pub fn interrupt(&mut self) {
        if self.ending.is_none() {
            self.end_on(Err(Ending::Interrupted));
        }
    }

    /// Ends the flight where it is over or cannot go on; its last instant is recorded, unless it has been.
    fn end_on(&mut self, flown: Result<(), Ending>) {
        if let Err(ending) = flown {
            self.sample_is_due |= ending != Ending::Completed && self.judge.closest.is_some();
            self.events.extend(self.judge.closest_to_obstacles());
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
            separation: self.judge.closest.take(),
            energy: self.energy,
            peaks: std::mem::take(&mut self.peaks),
            channels: &[],
        })
    }

    /// Everything as it is now.
    #[must_use]
    pub fn save(&self) -> Saved {
        Saved(self.clone())
    }

    /// Becomes what was saved, of whatever scenario, and goes on with the same bits as if it had never been interrupted;
    /// with a `noise_seed`, all random numbers begin anew from it and nothing else changes.
    pub fn load(&mut self, saved: &Saved, noise_seed: Option<u64>) {
        self.clone_from(&saved.0);
        if let Some(seed) = noise_seed {
            self.controller.reseed(seed);
            self.motion.reseed(seed);
        }
    }

    /// What the flight left behind besides its recording. One that is under way counts as interrupted here.
    #[must_use]
    pub fn finish(self) -> Flight {
        let Judged { audit, clearance, engine_contacts, bounces } = self.judge.finish();
        Flight {
            law: self.controller.law.name().to_owned(),
            ending: self.ending.unwrap_or(Ending::Interrupted),
            duration_s: self.time_s,
            steps: self.steps,
            certificate: self.certificate,
            audit,
            clearance,
            engine_contacts,
            bounces,
            energy_rise: self.watch.worst(),
            breaths: self.watch.breaths,
            assignments: self.watch.assignments,
            last: self.state,
            performance: self.performance,
        }
    }

    /// Flies one step, in halves where it is refused.
    fn advance(&mut self, step: u64) -> Result<(), Ending> {
        let whole = 1_u64 << self.scenario.time.max_halvings.min(MAX_HALVINGS);
        let mut shortest = whole;
        let flown = self.fly_parts(step, whole, &mut shortest);
        if shortest < whole && shortest != self.shortest {
            let (time_s, length_s) = (self.scenario.time.end_s(step - 1), self.scenario.time.length_s(step));
            let dt_s = length_s * (shortest as f64 / whole as f64);
            self.events.push(Event::StepRefined { time_s, dt_s });
        }
        self.shortest = shortest;
        flown
    }

    /// Longest step that is honest at the present state \[s\]. Continuous time chooses its own.
    fn longest_step_s(&self) -> f64 {
        let (law, nearest_m) = (&self.controller.law, self.judge.nearest_m);
        let rate_per_s = law.fastest_rate_per_s(Some(nearest_m), self.scenario.a22_per_s);
        let rate_per_s = match law.obstacle_rate_squared(self.judge.room_m) {
            0.0 => rate_per_s,
            squared => rate_per_s.map(|rate_per_s| (rate_per_s.powi(2) + squared).sqrt()),
        };
        rate_per_s
            .filter(|_| self.motion.holds_commands())
            .map_or(f64::INFINITY, |rate_per_s| self.scenario.time.max_rate_dt / rate_per_s)
    }

    /// Flies the `whole` parts of a step, as many at once as are honest and not refused; the fewest at once are
    /// `shortest`.
    fn fly_parts(&mut self, step: u64, whole: u64, shortest: &mut u64) -> Result<(), Ending> {
        let (begin_s, length_s) = (self.scenario.time.end_s(step - 1), self.scenario.time.length_s(step));
        let seconds = |parts: u64| length_s * (parts as f64 / whole as f64);
        let (mut flown, mut part) = (0, whole);
        while flown < whole {
            let longest_s = self.longest_step_s();
            while part > 1 && seconds(part) > longest_s {
                part /= 2;
                *shortest = part.min(*shortest);
            }
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
                self.time_s = self.scenario.time.end_s(step);
            } else {
                self.time_s = begin_s + seconds(flown);
            }
            std::mem::swap(&mut self.state, &mut self.next);
            self.judge_and_command(Some((step, from_s)), flown == whole)?;
            while part < whole && flown.is_multiple_of(2 * part) {
                part *= 2;
            }
        }
        Ok(())
    }

    /// Moves the vehicles from `state` to `next`.
    fn move_vehicles(&mut self, step: u64, dt_s: f64) -> Result<(), Ending> {
        let began = Instant::now();
        let is_held = self.overruled || self.scenario.time.control_hz.is_some();
        let held = is_held.then_some(&self.control);
        let interval = (step, self.time_s, dt_s);
        self.motion.advance(interval, held, &mut self.controller, &mut self.next, &mut self.path)?;
        self.performance.physics += began.elapsed();
        match self.next.first_not_finite() {
            Some(vehicle) => Err(Breakdown::StateNotFinite { step, vehicle }.into()),
            None => Ok(()),
        }
    }

    fn is_refused(&mut self) -> bool {
        let Controller { law, links, .. } = &self.controller;
        self.judge.refuses(law.as_ref(), links, &self.state, &self.path, &self.next)
    }

    /// Audits the way that led to `state` (or the start), asks the law for the next command and lets the vehicles hold it.
    /// Between whole steps a command that is held for a period of its own is kept.
    fn judge_and_command(&mut self, step: Option<(u64, f64)>, is_whole: bool) -> Result<(), Ending> {
        let (number, from_s) = step.unwrap_or((0, self.time_s));
        let refused = |why| Ending::from(Breakdown::Audit { step: number, why });
        for (after_s, positions_m) in self.path.passed() {
            self.judge.sweep(from_s + after_s, positions_m, &mut self.events).map_err(refused)?;
        }
        self.controller.accept(self.time_s, &self.state);
        self.controller.link.settle(self.time_s);
        let time = &self.scenario.time;
        let is_asked = !self.overruled && (time.control_hz.is_none() || (is_whole && time.commands(number)));
        if time.control_hz.is_some() {
            self.motion.apply(&self.control, &mut self.state);
        }
        let Self { judge, controller, state, control, time_s, events, .. } = self;
        let (state, time_s): (&Swarm, f64) = (state, *time_s);
        let mut audit = || {
            let began = Instant::now();
            let positions_m = &state.positions_m;
            let judged = match step {
                None => judge.start(time_s, positions_m, events),
                Some(_) => judge.sweep(time_s, positions_m, events),
            };
            (judged, began.elapsed())
        };
        let mut act = || {
            let began = Instant::now();
            (controller.act(time_s, state, is_asked.then_some(control)), began.elapsed())
        };
        let side_by_side = state.count() >= SIDE_BY_SIDE_FROM && rayon::current_num_threads() > 1;
        let ((judged, audit_time), (commanded, law_time)) =
            if side_by_side { rayon::join(audit, act) } else { (audit(), act()) };
        self.performance.audit += audit_time;
        let Self { watch, scenario, controller, state, certificate, events, .. } = self;
        watch.look(scenario, controller, (time_s, state), certificate, events);
        let commanded = self.hold(number, commanded.map_err(Ending::from), law_time);
        judged.map_err(refused)?;
        self.judge.note_engine_contacts(&self.motion, self.time_s, &mut self.events);
        self.judge.note_bounces(&self.motion, from_s, &mut self.events);
        commanded
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
        if checked.is_err() {
            (self.control, self.energy) = (Rows::zeros(0), None);
            return checked;
        }
        self.motion.apply(&self.control, &mut self.state);
        if let Some(vehicle) = self.state.first_not_finite() {
            return Err(Breakdown::StateNotFinite { step, vehicle }.into());
        }
        self.energy = self.controller.energy(self.time_s, &self.state);
        self.watch.take(self.controller.target.view().revision, self.energy);
        self.peaks.take(largest_row_norm(&self.control), self.energy);
        Ok(())
    }
}
