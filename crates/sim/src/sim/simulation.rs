//! A flight that is advanced step by step.

mod step;

use super::controller::Controller;
use super::ending::{Breakdown, Ending, Flight, MAX_COMMAND_M_S2, Performance, SimError};
use super::judge::{Judge, Judged};
use super::monitors::EnergyMonitor;
use super::monitors::{IntegrationError, Resolution};
use crate::link::{self, Imperfections};
use crate::plant::{self, Path, Plant};
use crate::scenario::Scenario;
use tautline_core::record::{Channel, Event, Peaks, Sample};
use tautline_core::swarm::{ClosestApproach, Rows, Swarm, first_row_beyond};
use tautline_laws::law::{Certificate, Law, Void};
use tautline_laws::target::{Schedule, Supervisor};

/// A flight under way: law, link, supervisor, vehicles and judge, with everything that any of them remembers.
///
/// [`Simulation::step`] flies one step; what is to be recorded of it is then handed out by [`Simulation::events`] and
/// [`Simulation::sample`]. A clone goes on by itself with the same bits, which is what [`Simulation::save`] keeps.
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
    resolution: Resolution,
    controller: Controller,
    plant: Box<dyn Plant>,
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
    /// Steps that were flown in parts.
    refined_steps: u64,
    /// Steps of which even the shortest part was too long for the law.
    overlong_steps: u64,
    /// Error of integration since the first of them.
    error: Option<IntegrationError>,
    /// Energy of the present state \[m^2/s^2\].
    energy: Option<f64>,
    energy_monitor: EnergyMonitor,
    /// Since the last sample.
    peaks: Peaks,
    channels: Channels,
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
        let Parts { law, plant, link, supervisor } = parts;
        let count = scenario.count();
        if plant.count() != count {
            return Err(SimError::Vehicles { expected: count, found: plant.count() });
        }
        let certificate =
            scenario.certificate(law.as_ref()).void_where(!supervisor.keeps_to(&scenario.legs), Void::TargetChanges);
        // A link of the scenario's own is void for reasons of its own.
        let is_told = !scenario.is_exact() && !certificate.void.is_empty();
        let certificate = certificate.void_where(!link.is_exact() && !is_told, Void::InexactLink);
        let mut state = scenario.start.clone();
        plant.observe(&mut state);
        let flies_another = scenario.law().is_ok_and(|own| own.name() != law.name());
        let other_law = flies_another.then(|| Event::OtherLaw { time_s: 0.0, name: law.name().to_owned() });
        let channels = Channels::of(plant.as_ref(), link.as_ref());
        let mut simulation = Self {
            controller: Controller::new(scenario, law, link, supervisor)?,
            plant,
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
    /// so is one on which a path bends by more than 1e-5 m from the straight line that the audit sweeps. A step of which even
    /// the shortest part is too long is flown all the same, counted ([`Flight::overlong_steps`]), and voids the certificate.
    pub fn step(&mut self) {
        if self.ending.is_none() && std::mem::take(&mut self.overruled) {
            let asked = self.ask();
            self.end_on(asked);
        }
        self.step_on();
    }

    /// Flies one step with accelerations \[m/s^2\], N x 3, from outside in the place of the law's, which is not asked. The step
    /// is not shortened for the barrier or the rate of the law.
    ///
    /// # Errors
    /// [`SimError::Commands`] where there is not a finite row for each vehicle; nothing is flown then. After the end nothing
    /// is flown either. A certificate that the law gave is void from then on.
    pub fn step_with(&mut self, commands: &Rows) -> Result<(), SimError> {
        let count = self.state.count();
        if commands.nrows() != count || first_row_beyond(commands, MAX_COMMAND_M_S2).is_some() {
            return Err(SimError::Commands { expected: count, found: commands.nrows() });
        }
        if self.ending.is_none() {
            self.overruled = true;
            self.certificate = self.certificate.clone().void_where(true, Void::CommandsFromOutside);
            self.control.clone_from(commands);
            self.plant.apply(commands, &mut self.state);
        }
        self.step_on();
        Ok(())
    }

    fn step_on(&mut self) {
        if self.ending.is_some() {
            return;
        }
        let step = self.steps + 1;
        let flown = self.advance(step);
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
            self.events.extend(self.judge.lasting(self.time_s));
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

    /// The smallest clearance so far \[m\], between steps included: of two vehicles, their distance less delta in the lengths that
    /// delta is meant in ([`tautline_laws::space::Metric`]); of a vehicle and an obstacle, its distance less the obstacle's clearance. Below 0
    /// exactly where the judge has found a violation; none where nothing can come near anything.
    #[must_use]
    pub fn least_clearance_m(&self) -> Option<f64> {
        self.judge.least_clearance_m()
    }

    /// The closest that two vehicles came so far, between steps included \[m\]; in scaled lengths where what must stay empty
    /// around a vehicle is an ellipsoid ([`tautline_laws::space::Metric`]). None of fewer than two vehicles.
    #[must_use]
    pub fn closest(&self) -> Option<ClosestApproach> {
        self.judge.least_separation()
    }

    /// The smallest distance of two vehicles over the last step \[m\], in the same lengths; at the start, of the start.
    #[must_use]
    pub fn separation_m(&self) -> f64 {
        self.judge.nearest_m
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

    /// Everything as it is now.
    #[must_use]
    pub fn save(&self) -> Saved {
        Saved(self.clone())
    }

    /// Becomes what was saved, of whatever scenario, and goes on with the same bits as if it had never been interrupted;
    /// with a `noise_seed`, all that is drawn from now on is drawn from it and nothing else changes: the air that vehicles are
    /// in, a measurement that they hold, a sensor's lasting error and messages under way stay what they are.
    pub fn load(&mut self, saved: &Saved, noise_seed: Option<u64>) {
        self.clone_from(&saved.0);
        if let Some(seed) = noise_seed {
            self.controller.reseed(seed);
            self.plant.reseed(seed);
        }
    }

    /// What the flight left behind besides its recording. One that is under way counts as interrupted here.
    #[must_use]
    pub fn finish(self) -> Flight {
        let Judged { audit, in_metres, clearance, engine_contacts, bounces } = self.judge.finish();
        Flight {
            law: self.controller.law.name().to_owned(),
            ending: self.ending.unwrap_or(Ending::Interrupted),
            duration_s: self.time_s,
            steps: self.steps,
            refined_steps: self.refined_steps,
            overlong_steps: self.overlong_steps,
            certificate: self.certificate,
            audit,
            in_metres,
            clearance,
            engine_contacts,
            bounces,
            energy_rise: self.energy_monitor.worst(),
            deadlock_recoveries: self.energy_monitor.deadlock_recoveries,
            assignments: self.energy_monitor.assignments,
            traffic: self.controller.link.traffic(),
            last: self.state,
            performance: Performance { airframe: self.plant.airframe_time(), ..self.performance },
        }
    }
}

/// What a flight is made of beside its scenario.
pub struct Parts {
    /// The control law.
    pub law: Box<dyn Law>,
    /// What moves the vehicles.
    pub plant: Box<dyn Plant>,
    /// What lies between truth and law.
    pub link: Box<dyn Imperfections>,
    /// Who changes the target.
    pub supervisor: Box<dyn Supervisor>,
}

impl Parts {
    /// What the scenario asks for.
    ///
    /// # Errors
    /// [`SimError::Law`] where its law does not exist, which a validated scenario rules out but for memory.
    pub fn of(scenario: &Scenario) -> Result<Self, SimError> {
        Ok(Self::under(scenario, scenario.law()?))
    }

    /// What the scenario asks for, under another law.
    #[must_use]
    pub fn under(scenario: &Scenario, law: Box<dyn Law>) -> Self {
        let link = link::of(scenario, law.capabilities().sensing_range_m.is_some());
        let supervisor = Schedule::new(&scenario.legs, &scenario.graph, scenario.arrival)
            .free_by(law.capabilities().controls.freedom());
        let supervisor = match law.capabilities().settling {
            Some(settling) => {
                let leader = scenario.reference.as_ref().and_then(|guidance| guidance.known_by.leader());
                supervisor.deadlock_recovery(scenario.deadlock, settling, leader).blown(!scenario.wind.is_still())
            }
            None => supervisor,
        };
        Self { law, plant: plant::of(scenario), link, supervisor: Box::new(supervisor) }
    }
}

/// The channels of a flight, vehicles' before link's, in memory that is used again for each sample.
#[derive(Clone)]
pub(super) struct Channels {
    all: Vec<Channel>,
    /// How many of them are the vehicles'.
    vehicles: usize,
}

impl Channels {
    pub(super) fn of(plant: &dyn Plant, link: &dyn Imperfections) -> Self {
        let mut all = plant.channels();
        let vehicles = all.len();
        all.extend(link.channels());
        Self { all, vehicles }
    }

    /// Takes the present values.
    pub(super) fn write(&mut self, plant: &dyn Plant, link: &dyn Imperfections) {
        let (vehicles, links) = self.all.split_at_mut(self.vehicles);
        plant.write_channels(vehicles);
        link.write_channels(links);
    }

    pub(super) fn all(&self) -> &[Channel] {
        &self.all
    }
}
