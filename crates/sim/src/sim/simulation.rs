//! [`Simulation`]: a flight that advances step by step.

mod step;

use std::sync::{Arc, Mutex};
use std::time::Duration;

use super::controller::Controller;
use super::ending::{Breakdown, Ending, Flight, MAX_COMMAND_M_S2, Performance, SimError, Stopwatch};
use super::judge::{AuditResults, Judge};
use super::monitors::EnergyMonitor;
use super::monitors::{IntegrationError, RoundingBound};
use crate::link::{self, Imperfections};
use crate::plant::{self, FreeSteps, Plant, StepPath};
use crate::scenario::Scenario;
use crate::shield::{ShieldReport, ShieldStage};
use tautline_core::record::{Channel, Event, Peaks, Sample};
use tautline_core::swarm::{ClosestApproach, Rows, Swarm, first_row_beyond};
use tautline_laws::law::{Certificate, Law, VoidReason};
use tautline_laws::observation::Observation;
use tautline_laws::target::{Schedule, Supervisor, Target};
use tautline_shield::ContractLog;

/// Flight in progress: law, link, supervisor, vehicles and audit, with all of their memory.
///
/// [`Simulation::step`] flies one step; then [`Simulation::events`] and [`Simulation::sample`] return its records. A
/// clone continues with the same bits; [`Simulation::save`] uses that.
///
/// ```
/// use tautline_sim::scenario::{Scenario, Source};
/// use tautline_sim::sim::Simulation;
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
    resolution: RoundingBound,
    controller: Controller,
    plant: Box<dyn Plant>,
    certificate: Certificate,
    judge: Judge,
    state: Swarm,
    next: Swarm,
    path: StepPath,
    control: Rows,
    /// Whether `control` is from outside and the law has not been evaluated for the present state.
    overruled: bool,
    time_s: f64,
    steps: u64,
    events: Vec<Event>,
    /// Fewest smallest substeps flown at once in the last step.
    shortest: u64,
    /// Number of steps that were divided.
    refined_steps: u64,
    /// Number of steps whose shortest substep was too long for the law.
    overlong_steps: u64,
    /// Integration error since the first of them.
    error: Option<IntegrationError>,
    /// Energy of the present state \[m^2/s^2\].
    energy: Option<f64>,
    energy_monitor: EnergyMonitor,
    /// Peaks since the last sample.
    peaks: Peaks,
    channels: Channels,
    sample_is_due: bool,
    ending: Option<Ending>,
    pub(super) performance: Performance,
    stopwatch: Stopwatch,
    /// Whether any steps are measured, and the number of those that were.
    is_measured: bool,
    measured_steps: u64,
}

/// State of a [`Simulation`] at one instant.
#[derive(Clone)]
pub struct SavedState(Simulation);

impl Simulation {
    /// Creates a flight at its start, with the scenario's own components. The scenario must be valid
    /// ([`Scenario::validate`]).
    ///
    /// # Errors
    /// [`SimError`] if the parameters give no law, or the audit does not support the scenario.
    pub fn new(scenario: &Scenario) -> Result<Self, SimError> {
        Self::with(scenario, Components::of(scenario)?)
    }

    /// Creates a flight at its start with other components, which must have the scenario's number of vehicles. Audits
    /// the start and evaluates the law.
    ///
    /// # Errors
    /// [`SimError`] if the audit does not support the scenario.
    pub fn with(scenario: &Scenario, parts: Components) -> Result<Self, SimError> {
        Self::at_start(scenario, parts, false)
    }

    /// Creates a flight at its start whose first commands may come from outside ([`Simulation::step_with`]): under a
    /// shield, the law is not evaluated before the first step.
    ///
    /// # Errors
    /// As [`Simulation::new`].
    pub fn awaiting_commands(scenario: &Scenario, parts: Components) -> Result<Self, SimError> {
        Self::at_start(scenario, parts, scenario.shield.is_some())
    }

    fn at_start(scenario: &Scenario, parts: Components, awaits_command: bool) -> Result<Self, SimError> {
        let Components { law, plant, link, supervisor, contract_log } = parts;
        let count = scenario.count();
        if plant.count() != count {
            return Err(SimError::Vehicles { expected: count, found: plant.count() });
        }
        let certificate = scenario.certificate(law.as_ref()).void_where(
            scenario.shield.is_none() && !supervisor.follows_legs(&scenario.legs),
            VoidReason::TargetChanges,
        );
        // The scenario's own imperfections already void the certificate.
        let is_void = !scenario.is_exact() && (scenario.shield.is_some() || !certificate.void.is_empty());
        let certificate = certificate.void_where(!link.is_exact() && !is_void, VoidReason::InexactLink);
        let mut state = scenario.start.clone();
        plant.observe(&mut state);
        let flies_another = scenario.external_law.is_some() || scenario.law().is_ok_and(|own| own.name() != law.name());
        let other_law = flies_another.then(|| Event::OtherLaw { time_s: 0.0, name: law.name().to_owned() });
        let channels = Channels::of(plant.as_ref(), link.as_ref());
        let mut simulation = Self {
            controller: Controller::new(scenario, law, link, supervisor)?.with_contract_log(contract_log),
            plant,
            certificate,
            judge: Judge::new(scenario)?,
            next: state.clone(),
            path: StepPath::default(),
            control: Rows::zeros(count),
            overruled: awaits_command,
            state,
            time_s: 0.0,
            steps: 0,
            events: other_law.into_iter().collect(),
            shortest: 0,
            refined_steps: 0,
            overlong_steps: 0,
            error: None,
            energy: None,
            energy_monitor: EnergyMonitor::default(),
            peaks: Peaks::default(),
            channels,
            sample_is_due: false,
            ending: None,
            performance: Performance::default(),
            stopwatch: Stopwatch { is_on: false },
            is_measured: true,
            measured_steps: 0,
            resolution: RoundingBound::of(scenario),
            scenario: scenario.clone(),
        };
        let began = simulation.begin();
        simulation.sample_is_due = began.is_ok();
        simulation.end_if_over(began);
        Ok(simulation)
    }

    fn begin(&mut self) -> Result<(), Ending> {
        if let Some(vehicle) = self.state.first_not_finite() {
            return Err(Breakdown::StateNotFinite { step: 0, vehicle }.into());
        }
        self.judge_and_command(None, true)
    }

    /// Flies one step of the scenario's length, divided if necessary. Does nothing after the end of the flight.
    ///
    /// A step that is too long for the law's fastest rate in the present state
    /// ([`crate::scenario::TimeSpec::max_rate_dt`]) is halved, at most [`crate::scenario::TimeSpec::max_halvings`]
    /// times; the law is evaluated in between. A step that takes more than half of the clearance of some pair above the
    /// law's barrier is undone and halved. So is a step on which a path bends by more than 1e-5 delta from the straight
    /// line that the audit sweeps. If even the shortest substep is too long, it is flown and counted
    /// ([`Flight::overlong_steps`]), and the certificate is void.
    pub fn step(&mut self) {
        if self.ending.is_none() && std::mem::take(&mut self.overruled) {
            // A shield keeps its command until its next instant.
            if std::mem::take(&mut self.controller.awaits_command) || self.controller.shield.is_none() {
                self.controller.begins = true;
                let asked = self.evaluate_law();
                self.end_if_over(asked);
            }
        }
        self.step_or_end();
    }

    /// Flies one step with given accelerations \[m/s^2\], N x 3, instead of those of the law. They pass through the
    /// shield and the actuators. The step is not divided for the barrier or the rate of the law, and the law's energy
    /// is not computed. Without a shield, the certificate is void from then on.
    ///
    /// A shield changes its commands at its own instants only and holds them in between. It takes given accelerations
    /// from its next instant on, which is the present one if it has no command there yet
    /// ([`Simulation::awaiting_commands`]).
    ///
    /// # Errors
    /// [`SimError::Commands`] unless each vehicle has a finite row; then nothing is flown. Does nothing after the end
    /// of the flight.
    pub fn step_with(&mut self, commands: &Rows) -> Result<(), SimError> {
        let count = self.state.count();
        if commands.nrows() != count || first_row_beyond(commands, MAX_COMMAND_M_S2).is_some() {
            return Err(SimError::Commands { expected: count, found: commands.nrows() });
        }
        self.step_with_checked(commands);
        Ok(())
    }

    /// Flies one step like [`Simulation::step_with`], with accelerations that were checked.
    pub(super) fn step_with_checked(&mut self, commands: &Rows) {
        if self.ending.is_none() {
            self.overruled = true;
            let took = self.take_commands(commands);
            self.end_if_over(took);
        }
        self.step_or_end();
    }

    /// Applies accelerations from outside at the present instant, after the shield if there is one.
    fn take_commands(&mut self, commands: &Rows) -> Result<(), Ending> {
        let is_shielded = self.controller.shield.is_some();
        if is_shielded && !std::mem::take(&mut self.controller.awaits_command) {
            return Ok(());
        }
        if !is_shielded && !self.certificate.void.contains(&VoidReason::ExternalCommands) {
            self.certificate = self.certificate.clone().void_where(true, VoidReason::ExternalCommands);
        }
        self.controller.filter(self.time_s, &self.state, commands, &mut self.control);
        self.apply_command(self.steps, Ok(()), Duration::ZERO)
    }

    fn step_or_end(&mut self) {
        if self.ending.is_some() {
            return;
        }
        let step = self.steps + 1;
        self.start_measuring(step);
        let flown = self.advance(step);
        self.sample_is_due = flown.is_ok() && self.scenario.time.records(step);
        let is_last = step == self.scenario.time.steps();
        self.end_if_over(flown.and(if is_last { Err(Ending::Completed) } else { Ok(()) }));
    }

    /// Ends the flight as interrupted, unless it has ended.
    pub fn interrupt(&mut self) {
        if self.ending.is_none() {
            self.end_if_over(Err(Ending::Interrupted));
        }
    }

    /// Ends the flight if it is over or cannot continue. Records its last instant if that is not recorded yet.
    fn end_if_over(&mut self, flown: Result<(), Ending>) {
        if let Err(ending) = flown {
            self.sample_is_due |= ending != Ending::Completed && self.judge.closest.is_some();
            self.events.extend(self.judge.ongoing_violations(self.time_s));
            self.events.extend(self.judge.closest_to_obstacles());
            self.ending = Some(ending);
        }
    }

    /// Leaves all times of [`Performance`] at zero.
    pub(super) fn stop_measuring_time(&mut self) {
        self.is_measured = false;
    }

    /// Measures the times of this step if it is one of the sample.
    fn start_measuring(&mut self, step: u64) {
        let is_on = self.is_measured && Performance::is_sampled(step, self.state.count());
        self.measured_steps += u64::from(is_on);
        if is_on != self.stopwatch.is_on {
            self.stopwatch.is_on = is_on;
            self.plant.measure_time(is_on);
        }
    }

    /// Allows steps without the engine while no contact is possible ([`Plant::allow_free_steps`]). The bits are the
    /// same.
    pub fn allow_free_steps(&mut self, free: FreeSteps) {
        self.plant.allow_free_steps(free);
    }

    /// Returns the ending of the flight; `None` in flight.
    #[must_use]
    pub fn ending(&self) -> Option<&Ending> {
        self.ending.as_ref()
    }

    /// Returns the present state.
    #[must_use]
    pub fn state(&self) -> &Swarm {
        &self.state
    }

    /// Returns the present target of the law.
    #[must_use]
    pub fn target(&self) -> Target<'_> {
        self.controller.target.view()
    }

    /// Returns what the vehicles know at present, without the pairs in sensing range.
    pub fn observation(&mut self) -> Observation<'_> {
        self.controller.observation(self.time_s, &self.state)
    }

    /// Returns the accelerations \[m/s^2\], N x 3, that are held from now on; no rows if the law is undefined.
    #[must_use]
    pub fn control(&self) -> &Rows {
        &self.control
    }

    /// Returns the time flown \[s\].
    #[must_use]
    pub fn time_s(&self) -> f64 {
        self.time_s
    }

    /// Returns the number of whole steps flown.
    #[must_use]
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// Returns the smallest clearance so far \[m\], also between steps. For two vehicles it is their separation minus
    /// delta, in the metric of delta ([`tautline_laws::space::Metric`]); for a vehicle and an obstacle their distance
    /// minus the clearance. Negative exactly if there is a violation; `None` without pairs and obstacles.
    #[must_use]
    pub fn least_clearance_m(&self) -> Option<f64> {
        self.judge.least_clearance_m()
    }

    /// Returns the closest approach of two vehicles so far \[m\], also between steps; scaled if the safety shape is an
    /// ellipsoid ([`tautline_laws::space::Metric`]). `None` for fewer than two vehicles.
    #[must_use]
    pub fn closest(&self) -> Option<ClosestApproach> {
        self.judge.least_separation()
    }

    /// Returns the smallest separation over the last step \[m\], in the same metric; at the start, that of the start.
    #[must_use]
    pub fn separation_m(&self) -> f64 {
        self.judge.nearest_m
    }

    /// Takes the events since the last call, in order of time.
    pub fn events(&mut self) -> impl Iterator<Item = Event> + '_ {
        self.events.drain(..)
    }

    /// Returns whether [`Simulation::sample`] returns the present instant.
    pub(super) fn sample_is_due(&self) -> bool {
        self.sample_is_due
    }

    /// Returns the present instant if the recording rate or the end of the flight requires it, once.
    pub fn sample(&mut self) -> Option<Sample<'_>> {
        if !std::mem::take(&mut self.sample_is_due) {
            return None;
        }
        self.channels.write(self.plant.as_ref(), self.controller.link.as_ref());
        Some(Sample {
            time_s: self.time_s,
            step: self.steps,
            swarm: &self.state,
            control: &self.control,
            separation: self.judge.closest.take(),
            energy: self.energy,
            peaks: std::mem::take(&mut self.peaks),
            channels: self.channels.all(),
        })
    }

    /// Saves the present state.
    #[must_use]
    pub fn save(&self) -> SavedState {
        SavedState(self.clone())
    }

    /// Restores a saved state, of any scenario, and continues with the same bits. A `noise_seed` changes later random
    /// numbers only: the present wind, a held measurement, constant errors of sensors and messages under way stay.
    pub fn load(&mut self, saved: &SavedState, noise_seed: Option<u64>) {
        self.clone_from(&saved.0);
        if let Some(seed) = noise_seed {
            self.controller.reseed(seed);
            self.plant.reseed(seed);
        }
    }

    /// Returns the numbers of the shield so far, if there is one.
    #[must_use]
    pub fn shield_report(&self) -> Option<ShieldReport> {
        self.controller.shield.as_ref().map(ShieldStage::report)
    }

    /// Returns the result of the flight. A flight in progress counts as interrupted.
    #[must_use]
    pub fn finish(self) -> Flight {
        let shield = self.shield_report();
        let is_exceeded = shield.as_ref().is_some_and(|shield| shield.breach.is_some());
        let certificate = self.certificate.void_where(is_exceeded, VoidReason::ShieldExceeded);
        let AuditResults { audit, in_metres, clearance, engine_contacts, bounces } = self.judge.finish();
        Flight {
            law: self.controller.law.name().to_owned(),
            ending: self.ending.unwrap_or(Ending::Interrupted),
            duration_s: self.time_s,
            steps: self.steps,
            engine_steps: self.plant.engine_steps(),
            refined_steps: self.refined_steps,
            overlong_steps: self.overlong_steps,
            certificate,
            audit,
            in_metres,
            clearance,
            engine_contacts,
            bounces,
            energy_rise: self.energy_monitor.worst(),
            deadlock_recoveries: self.energy_monitor.deadlock_recoveries,
            assignments: self.energy_monitor.assignments,
            traffic: self.controller.link.traffic(),
            shield,
            last: self.state,
            performance: Performance { airframe: self.plant.airframe_time(), ..self.performance }
                .scaled(self.steps, self.measured_steps),
        }
    }
}

/// Components of a flight, besides its scenario.
pub struct Components {
    /// The control law.
    pub law: Box<dyn Law>,
    /// Plant that moves the vehicles.
    pub plant: Box<dyn Plant>,
    /// Imperfections between true state and law.
    pub link: Box<dyn Imperfections>,
    /// Supervisor that changes the target.
    pub supervisor: Box<dyn Supervisor>,
    /// Log of the shield's contracts, if one is to be written. The caller ends it after the flight. A flight in which
    /// vehicles miss instants (`shield.hang_share`) gives a log that the model forbids.
    pub contract_log: Option<Arc<Mutex<ContractLog>>>,
}

impl Components {
    /// Returns the components of a scenario, with its external law if it has one.
    ///
    /// # Errors
    /// [`SimError::Law`] if the parameters give no law; for a valid scenario only if memory cannot be allocated.
    pub fn of(scenario: &Scenario) -> Result<Self, SimError> {
        Ok(Self::with_law(scenario, scenario.flown_law()?))
    }

    /// Allows steps without the engine while no contact is possible, for studies. The bits are the same.
    #[must_use]
    pub fn with_free_steps(mut self, free: FreeSteps) -> Self {
        self.plant.allow_free_steps(free);
        self
    }

    /// Returns the components of a scenario under another law.
    #[must_use]
    pub fn with_law(scenario: &Scenario, law: Box<dyn Law>) -> Self {
        let link = link::of(scenario, law.capabilities().sensing_range_m.is_some());
        let supervisor = Schedule::new(&scenario.legs, &scenario.graph, scenario.arrival)
            .with_freedom(law.capabilities().controls.freedom());
        let supervisor = match law.capabilities().settling {
            Some(settling) => {
                let leader = scenario.reference.as_ref().and_then(|guidance| guidance.known_by.leader());
                supervisor.deadlock_recovery(scenario.deadlock, settling, leader).with_wind(!scenario.wind.is_still())
            }
            None => supervisor,
        };
        Self { law, plant: plant::of(scenario), link, supervisor: Box::new(supervisor), contract_log: None }
    }
}

/// Channels of a flight, those of the vehicles before those of the link. Their memory is reused for each sample.
#[derive(Clone)]
pub(super) struct Channels {
    all: Vec<Channel>,
    /// Number of channels of the vehicles.
    vehicles: usize,
}

impl Channels {
    pub(super) fn of(plant: &dyn Plant, link: &dyn Imperfections) -> Self {
        let mut all = plant.channels();
        let vehicles = all.len();
        all.extend(link.channels());
        Self { all, vehicles }
    }

    /// Writes the present values.
    pub(super) fn write(&mut self, plant: &dyn Plant, link: &dyn Imperfections) {
        let (vehicles, links) = self.all.split_at_mut(self.vehicles);
        plant.write_channels(vehicles);
        link.write_channels(links);
    }

    pub(super) fn all(&self) -> &[Channel] {
        &self.all
    }
}
