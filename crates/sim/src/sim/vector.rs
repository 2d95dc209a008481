//! [`VectorSimulation`]: many worlds of one scenario that advance together.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use nalgebra::Vector3;
use rayon::{Scope, ThreadPool};

use super::ending::{MAX_COMMAND_M_S2, SimError};
use super::simulation::{Components, Simulation};
use crate::plant::FreeSteps;
use crate::scenario::{
    BYTES_PER_EDGE, BYTES_PER_VEHICLE, Draw, MAX_MEMORY_BYTES, NamedLaw, Scenario, ScenarioError, Template,
};
use tautline_core::swarm::{Rows, Swarm, row};
use tautline_laws::observation::OtherStates;
use tautline_laws::space::signed_distance_m;

/// Number of chunks of worlds for each thread. A thread takes the next chunk when it is done with one.
const CHUNKS_PER_THREAD: usize = 8;
/// Number of steps of single vehicles that is worth waking a thread.
const LOAD_OF_A_THREAD: u64 = 1000;
/// Load of a new simulation, as a number of steps.
const LOAD_OF_A_START: u64 = 100;
/// Expected memory of a world besides its vehicles and edges \[bytes\].
const BYTES_PER_WORLD: u128 = 65_536;
/// Expected memory of a vehicle in the engine, which a world has while hulls are within reach \[bytes\].
const BYTES_PER_KEPT_VEHICLE: u128 = 1024;
/// Number of seeds that are tried for a valid start.
const MOST_SEEDS: u64 = 1000;
/// Time between two calls of `carries_on` while starts are searched.
const SEARCH_AT_ONCE: Duration = Duration::from_millis(50);
/// Number of steps of single vehicles between two calls of `carries_on`.
const VEHICLE_STEPS_AT_ONCE: u64 = 100_000;

/// Worlds of one scenario, each a [`Simulation`] with a seed of its own, on several threads.
///
/// World k flies the scenario with its seed as `start.seed` and, if the flight is random, as `noise.seed`. It has the
/// bits of a single simulation under the same commands, for any number of threads. A world that ends does not stop the
/// others; it keeps its last state until it is reset.
///
/// ```
/// use tautline_sim::scenario::{Source, Template};
/// use tautline_sim::sim::{States, Threads, VectorSimulation};
///
/// let template = Template::read(&Source::resolve("pentagon")?, &[])?;
/// let mut worlds = VectorSimulation::new(template, &[0, 1, 2], Threads::Current)?;
/// let mut states = States::of(&worlds);
/// let commands = vec![0.1; 3 * worlds.vehicles() * worlds.count()];
/// worlds.step(Some(&commands), 240, &mut states.borrow())?;
/// assert!(states.positions_m.len() == 45 && worlds.world(2).time_s() == 1.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// A clone is independent and continues with the same bits.
#[derive(Clone)]
pub struct VectorSimulation {
    starts: Starts,
    worlds: Vec<World>,
    vehicles: usize,
    resets_ended: bool,
    threads: Threads,
}

/// Threads of a [`VectorSimulation`]: the calling thread and helpers.
#[derive(Clone, Debug, Default)]
pub enum Threads {
    /// As many threads as the current rayon pool has.
    #[default]
    Current,
    /// The calling thread alone.
    One,
    /// The calling thread, and all threads of a pool.
    With(Arc<ThreadPool>),
}

/// Choice of the seed of a world.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SeedChoice {
    /// The next seed of the world with a valid start: its seed plus E, or else E later, at most 1000 seeds.
    #[default]
    Next,
    /// The first seed with a valid start, from this one on, at most 1000 seeds.
    From(u64),
    /// This seed. It is an error if it has no valid start.
    Exactly(u64),
}

/// Memory of a caller for the states of E worlds of N vehicles, world by world and vehicle by vehicle.
pub struct StatesMut<'a> {
    /// E x N x 3 positions \[m\].
    pub positions_m: &'a mut [f64],
    /// E x N x 3 velocities \[m/s\].
    pub velocities_m_s: &'a mut [f64],
    /// Smallest clearance of each world so far \[m\], as [`Simulation::least_clearance_m`]; NaN without pairs and
    /// obstacles.
    pub least_clearance_m: &'a mut [f64],
    /// Whether each world has ended.
    pub is_over: &'a mut [bool],
}

/// States of all worlds, with memory of their own. The fields are those of [`StatesMut`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct States {
    /// E x N x 3 positions \[m\].
    pub positions_m: Vec<f64>,
    /// E x N x 3 velocities \[m/s\].
    pub velocities_m_s: Vec<f64>,
    /// Smallest clearance of each world so far \[m\].
    pub least_clearance_m: Vec<f64>,
    /// Whether each world has ended.
    pub is_over: Vec<bool>,
}

/// Error of a [`VectorSimulation`]. Nothing was flown or reset.
#[derive(Debug, thiserror::Error)]
pub enum VectorError {
    /// There are no worlds.
    #[error("seeds: at least one world is needed, got 0")]
    NoWorlds,
    /// The worlds would take too much memory.
    #[error("seeds: at most {most} worlds of this scenario fit into {} GiB, got {found}", MAX_MEMORY_BYTES >> 30)]
    TooMany {
        /// Largest number of worlds.
        most: usize,
        /// Number given.
        found: usize,
    },
    /// A slice has a wrong length.
    #[error("{what}: {expected} values are needed, got {found}")]
    Length {
        /// Name of the slice.
        what: &'static str,
        /// Length needed.
        expected: usize,
        /// Length given.
        found: usize,
    },
    /// A command is not finite, or too large.
    #[error("u[{world}, {vehicle}, {axis}]: must be a finite number up to {MAX_COMMAND_M_S2:e} m/s^2, got {value:e}")]
    Command {
        /// The world, from 0.
        world: usize,
        /// The vehicle, from 0.
        vehicle: usize,
        /// The axis, from 0.
        axis: usize,
        /// The acceleration \[m/s^2\].
        value: f64,
    },
    /// A given seed gives no valid start.
    #[error("seeds[{world}]: seed {seed} gives no valid scenario: {why}")]
    Seed {
        /// The world, from 0.
        world: usize,
        /// Its seed.
        seed: u64,
        /// Reason.
        why: ScenarioError,
    },
    /// A given start is not valid.
    #[error("positions[{world}]: {why}")]
    Start {
        /// The world, from 0.
        world: usize,
        /// Reason.
        why: ScenarioError,
    },
    /// No seed of a search gives a valid start. If a world is reset because it ended, the other worlds have advanced.
    #[error("seeds[{world}]: {MOST_SEEDS} seeds from {first} on give no valid scenario, the last one because of {why}")]
    NoSeed {
        /// The world, from 0.
        world: usize,
        /// First seed of the search.
        first: u64,
        /// Reason of the last seed.
        why: ScenarioError,
    },
    /// The caller ended the search of starts.
    #[error("interrupted: no world was made or reset")]
    Interrupted,
    /// The scenario cannot be flown in this way.
    #[error(transparent)]
    Sim(#[from] SimError),
}

/// One world.
#[derive(Clone)]
struct World {
    seed: u64,
    simulation: Simulation,
    /// Commands of the present call, N x 3 \[m/s^2\].
    commands: Rows,
    /// Whether the present call reset this world, which then does not fly.
    rests: bool,
}

/// Source of new simulations.
#[derive(Clone)]
struct Starts {
    template: Template,
    law: NamedLaw,
    /// The start of all worlds, if neither start nor flight depends on a seed.
    common: Option<Arc<Mutex<Simulation>>>,
    /// Number of worlds E.
    worlds: u64,
}

/// States of all worlds at the start of a flight, E x N x 3, in the place of those of the scenario.
#[derive(Clone, Copy, Debug)]
pub struct GivenStarts<'a> {
    /// Positions \[m\].
    pub positions_m: &'a [f64],
    /// Velocities \[m/s\].
    pub velocities_m_s: &'a [f64],
}

impl GivenStarts<'_> {
    /// Returns the state of a world of `vehicles`.
    fn of(self, world: usize, vehicles: usize) -> Swarm {
        let rows = |numbers: &[f64]| Rows::from_row_slice(&numbers[3 * vehicles * world..][..3 * vehicles]);
        Swarm { positions_m: rows(self.positions_m), velocities_m_s: rows(self.velocities_m_s) }
    }
}

/// Found seed with the simulation at its start, or the error of a search.
type Started = Result<(u64, Simulation), VectorError>;

/// Search for a seed with a valid start.
struct Search<'a> {
    /// States of all worlds at the start, if they are given.
    given: Option<GivenStarts<'a>>,
    /// The world, from 0.
    world: usize,
    /// First seed.
    first: u64,
    /// Whether seeds after the first one are tried.
    goes_on: bool,
    /// Whether every seed is tried, not only those of the world.
    takes_every: bool,
    /// Next seed to try.
    seed: u64,
    /// Number of tried seeds.
    tried: u64,
    /// Result, once the search has ended.
    made: Option<Started>,
}

impl<'a> Search<'a> {
    /// Returns the search of a choice. `next` is the seed after the present one of the world. No other seed changes
    /// given states.
    fn of(choice: SeedChoice, world: usize, next: u64, given: Option<GivenStarts<'a>>) -> Self {
        let (first, goes_on) = match choice {
            SeedChoice::Next => (next, true),
            SeedChoice::From(first) => (first, true),
            SeedChoice::Exactly(first) => (first, false),
        };
        let takes_every = matches!(choice, SeedChoice::From(_));
        let goes_on = goes_on && given.is_none();
        Self { given, world, first, goes_on, takes_every, seed: first, tried: 0, made: None }
    }

    /// Tries the next seed.
    fn try_next(&mut self, starts: &Starts) {
        let Self { world, first, goes_on, .. } = *self;
        self.tried += 1;
        let given = self.given.map(|given| given.of(world, starts.template.own().count()));
        self.made = match starts.simulation(world, self.seed, given) {
            Err(VectorError::Seed { .. }) if goes_on && self.tried < MOST_SEEDS => None,
            Err(VectorError::Seed { why, .. }) if goes_on => Some(Err(VectorError::NoSeed { world, first, why })),
            made => Some(made.map(|simulation| (self.seed, simulation))),
        };
        if self.made.is_none() {
            self.seed = if self.takes_every { next_seed(self.seed, 1) } else { starts.later(self.seed) };
        }
    }
}

impl VectorSimulation {
    /// Creates one world for each seed, at its start.
    ///
    /// # Errors
    /// [`VectorError::NoWorlds`], [`VectorError::TooMany`], [`VectorError::Seed`] if a seed gives no valid start, and
    /// [`VectorError::Sim`] if the audit does not support the scenario.
    pub fn new(template: Template, seeds: &[u64], threads: Threads) -> Result<Self, VectorError> {
        let seeds: Vec<_> = seeds.iter().copied().map(SeedChoice::Exactly).collect();
        Self::with_seeds(template, &seeds, threads)
    }

    /// Creates one world for each choice of a seed. The next seed of world k is k.
    ///
    /// # Errors
    /// As [`VectorSimulation::new`], and [`VectorError::NoSeed`].
    pub fn with_seeds(template: Template, seeds: &[SeedChoice], threads: Threads) -> Result<Self, VectorError> {
        Self::with_seeds_while(template, seeds, threads, &mut || true)
    }

    /// Creates worlds like [`VectorSimulation::with_seeds`], and calls `carries_on` every few hundredths of a second.
    /// Stops if it returns false.
    ///
    /// # Errors
    /// As [`VectorSimulation::with_seeds`], and [`VectorError::Interrupted`].
    pub fn with_seeds_while(
        template: Template,
        seeds: &[SeedChoice],
        threads: Threads,
        carries_on: &mut dyn FnMut() -> bool,
    ) -> Result<Self, VectorError> {
        if seeds.is_empty() {
            return Err(VectorError::NoWorlds);
        }
        let (most, found) = (Self::most_worlds(template.own()), seeds.len());
        if found > most {
            return Err(VectorError::TooMany { most, found });
        }
        let vehicles = template.own().count();
        let is_random = template.start_is_random() || template.flight_is_random();
        let law = template.own_law();
        let common =
            (!is_random).then(|| started(template.own())).transpose()?.map(|start| Arc::new(Mutex::new(start)));
        let starts = Starts { template, law, common, worlds: seeds.len() as u64 };
        let searches = seeds.iter().zip(0..).map(|(&choice, k)| Search::of(choice, k, k as u64, None)).collect();
        let world = |(seed, simulation)| World { seed, simulation, commands: Rows::zeros(vehicles), rests: false };
        let made = starts.simulations(searches, &threads, carries_on)?;
        let worlds = made.into_iter().map(|(_, made)| made.map(world)).collect::<Result<_, _>>()?;
        Ok(Self { starts, worlds, vehicles, resets_ended: false, threads })
    }

    /// Returns the largest number of worlds of a scenario whose expected memory is within [`MAX_MEMORY_BYTES`], at
    /// least one.
    #[must_use]
    pub fn most_worlds(scenario: &Scenario) -> usize {
        let edges = scenario.graph.edges().count() as u128;
        let of_vehicle = BYTES_PER_VEHICLE + BYTES_PER_KEPT_VEHICLE;
        let of_vehicles = scenario.count() as u128 * of_vehicle + edges * BYTES_PER_EDGE;
        let most = MAX_MEMORY_BYTES / (BYTES_PER_WORLD + of_vehicles);
        usize::try_from(most).unwrap_or(usize::MAX).max(1)
    }

    /// Sets whether [`VectorSimulation::step`] resets worlds that have ended, instead of leaving them.
    pub fn set_autoreset(&mut self, resets_ended: bool) {
        self.resets_ended = resets_ended;
    }

    /// Sets the threads that later calls use. The results do not depend on them.
    pub fn set_threads(&mut self, threads: Threads) {
        self.threads = threads;
    }

    /// Returns the number of worlds E.
    #[must_use]
    pub fn count(&self) -> usize {
        self.worlds.len()
    }

    /// Returns the number of vehicles N of a world.
    #[must_use]
    pub fn vehicles(&self) -> usize {
        self.vehicles
    }

    /// Returns a world, from 0.
    ///
    /// # Panics
    /// If there is no such world.
    #[must_use]
    pub fn world(&self, world: usize) -> &Simulation {
        &self.worlds[world].simulation
    }

    /// Returns the present seed of each world.
    pub fn seeds(&self) -> impl Iterator<Item = u64> + '_ {
        self.worlds.iter().map(|world| world.seed)
    }

    /// Flies a number of steps in every world, fewer where a world ends, and writes the states.
    ///
    /// `commands` are accelerations \[m/s^2\], E x N x 3, held over all of these steps ([`Simulation::step_with`]).
    /// Those of ended worlds are ignored. Without commands the law flies ([`Simulation::step`]). With
    /// [`VectorSimulation::set_autoreset`], a world that had ended before this call is reset instead, to its next seed
    /// ([`SeedChoice::Next`]). The call returns early when all worlds have ended.
    ///
    /// # Errors
    /// [`VectorError`]: a wrong length; a command that is not finite. For [`VectorError::NoSeed`] the world stays
    /// ended, and the others fly all steps.
    pub fn step(
        &mut self,
        commands: Option<&[f64]>,
        steps: u64,
        states: &mut StatesMut<'_>,
    ) -> Result<(), VectorError> {
        self.step_while(commands, steps, states, &mut || true)
    }

    /// Flies like [`VectorSimulation::step`], and calls `carries_on` after some steps of all worlds, every few
    /// hundredths of a second. Stops if it returns false.
    ///
    /// # Errors
    /// As [`VectorSimulation::step`], and [`VectorError::Interrupted`] before the first step.
    pub fn step_while(
        &mut self,
        commands: Option<&[f64]>,
        steps: u64,
        states: &mut StatesMut<'_>,
        carries_on: &mut dyn FnMut() -> bool,
    ) -> Result<(), VectorError> {
        self.check_lengths(states)?;
        if let Some(commands) = commands {
            self.check_commands(commands)?;
        }
        let (count, vehicles, width) = (self.worlds.len() as u64, self.vehicles as u64, 3 * self.vehicles);
        let at_once = (VEHICLE_STEPS_AT_ONCE / (count * vehicles)).max(1);
        self.worlds.iter_mut().for_each(|world| world.rests = false);
        let restarted = if self.resets_ended && steps > 0 { self.restart_ended(carries_on)? } else { Ok(()) };
        let mut flown = 0;
        while flown < steps {
            let some = at_once.min(steps - flown);
            let advance = |(k, world): (usize, &mut World)| {
                if !world.rests && world.simulation.ending().is_none() {
                    world.fly(commands.map(|commands| &commands[k * width..(k + 1) * width]), some);
                }
            };
            for_each(&mut self.worlds, (&self.threads, some.saturating_mul(count * vehicles)), states, advance);
            flown += some;
            let all_rest = self.worlds.iter().all(|world| world.rests || world.simulation.ending().is_some());
            if all_rest || !carries_on() {
                break;
            }
        }
        restarted
    }

    /// Resets the worlds that have ended. The inner error is that of the first one without a valid start, which stays
    /// ended.
    fn restart_ended(&mut self, carries_on: &mut dyn FnMut() -> bool) -> Result<Result<(), VectorError>, VectorError> {
        let ended = |(k, world): (usize, &World)| {
            let next = self.starts.later(world.seed);
            world.simulation.ending().map(|_| Search::of(SeedChoice::Next, k, next, None))
        };
        let searches = self.worlds.iter().enumerate().filter_map(ended).collect();
        let mut restarted = Ok(());
        for (k, made) in self.starts.simulations(searches, &self.threads, carries_on)? {
            let world = &mut self.worlds[k];
            world.rests = true;
            match made {
                Ok(made) => (world.seed, world.simulation) = made,
                Err(error) => restarted = restarted.and(Err(error)),
            }
        }
        Ok(restarted)
    }

    /// Resets the chosen worlds to their starts, with these seeds or else with the next seed of each. Writes the states
    /// of all worlds. The seeds of other worlds are ignored.
    ///
    /// # Errors
    /// [`VectorError`]: a wrong length, or seeds without a valid start. No world is reset then.
    pub fn reset(
        &mut self,
        chosen: &[bool],
        seeds: Option<&[SeedChoice]>,
        states: &mut StatesMut<'_>,
    ) -> Result<(), VectorError> {
        self.reset_while(chosen, seeds, None, states, &mut || true)
    }

    /// Resets worlds like [`VectorSimulation::reset`], to given states if there are any, and calls `carries_on` every
    /// few hundredths of a second. Stops if it returns false. Slots and random numbers are those of the seeds.
    ///
    /// # Errors
    /// As [`VectorSimulation::reset`], and [`VectorError::Interrupted`]. No world is reset then.
    pub fn reset_while(
        &mut self,
        chosen: &[bool],
        seeds: Option<&[SeedChoice]>,
        given: Option<GivenStarts<'_>>,
        states: &mut StatesMut<'_>,
        carries_on: &mut dyn FnMut() -> bool,
    ) -> Result<(), VectorError> {
        let count = self.count();
        self.check_lengths(states)?;
        check("mask", count, chosen.len())?;
        seeds.map_or(Ok(()), |seeds| check("seeds", count, seeds.len()))?;
        if let Some(given) = given {
            let numbers = 3 * self.vehicles * count;
            check("given positions_m", numbers, given.positions_m.len())?;
            check("given velocities_m_s", numbers, given.velocities_m_s.len())?;
        }
        let choice = |k| seeds.map_or(SeedChoice::Next, |seeds: &[SeedChoice]| seeds[k]);
        let next = |(k, world): (usize, &World)| Search::of(choice(k), k, self.starts.later(world.seed), given);
        let searches = self.worlds.iter().enumerate().filter(|(k, _)| chosen[*k]).map(next).collect();
        let made = self.starts.simulations(searches, &self.threads, carries_on)?;
        let made = made.into_iter().map(|(k, made)| Ok((k, made?))).collect::<Result<Vec<_>, VectorError>>()?;
        for (k, made) in made {
            (self.worlds[k].seed, self.worlds[k].simulation) = made;
        }
        for_each(&mut self.worlds, (&Threads::One, 0), states, |_| ());
        Ok(())
    }

    /// Writes the present slots of all vehicles \[m\], E x N x 3: those of the leg, moved by the reference.
    ///
    /// # Errors
    /// [`VectorError::Length`].
    pub fn write_slots(&self, slots_m: &mut [f64]) -> Result<(), VectorError> {
        check("slots_m", 3 * self.vehicles * self.count(), slots_m.len())?;
        for (world, slots_m) in self.worlds.iter().zip(slots_m.chunks_exact_mut(3 * self.vehicles)) {
            let target = world.simulation.target();
            for (i, slot_m) in slots_m.chunks_exact_mut(3).enumerate() {
                let place_m = row(&target.formation.slots_m, i) + target.reference.position_m;
                slot_m.copy_from_slice(place_m.as_slice());
            }
        }
        Ok(())
    }

    /// Writes the states that the vehicles measure of themselves at present, E x N x 3 positions \[m\] and velocities
    /// \[m/s\].
    ///
    /// # Errors
    /// [`VectorError::Length`].
    pub fn write_measured(&mut self, positions_m: &mut [f64], velocities_m_s: &mut [f64]) -> Result<(), VectorError> {
        let (numbers, width) = (3 * self.vehicles * self.count(), 3 * self.vehicles);
        check("positions_m", numbers, positions_m.len())?;
        check("velocities_m_s", numbers, velocities_m_s.len())?;
        let states = positions_m.chunks_exact_mut(width).zip(velocities_m_s.chunks_exact_mut(width));
        for (world, (positions_m, velocities_m_s)) in self.worlds.iter_mut().zip(states) {
            write_rows(world.simulation.observation().own, positions_m, velocities_m_s);
        }
        Ok(())
    }

    /// Writes the positions \[m\] that vehicle i last received from vehicle j, E x N x N x 3. They are NaN without a
    /// link, and that of a vehicle itself is measured.
    ///
    /// # Errors
    /// [`VectorError::Length`].
    pub fn write_received(&mut self, positions_m: &mut [f64]) -> Result<(), VectorError> {
        let of_world = 3 * self.vehicles * self.vehicles;
        check("positions_m", of_world * self.count(), positions_m.len())?;
        for (world, positions_m) in self.worlds.iter_mut().zip(positions_m.chunks_exact_mut(of_world)) {
            let known = world.simulation.observation();
            let pairs = (0..self.vehicles).flat_map(|i| (0..self.vehicles).map(move |j| (i, j)));
            for ((i, j), position_m) in pairs.zip(positions_m.chunks_exact_mut(3)) {
                let is_linked = matches!(known.others, OtherStates::Shared) || known.links.has_edge(i, j);
                let received_m = match (i == j, is_linked) {
                    (true, _) => row(&known.own.positions_m, i),
                    (false, true) => known.received(i, j).position_m,
                    (false, false) => Vector3::from_element(f64::NAN),
                };
                position_m.copy_from_slice(received_m.as_slice());
            }
        }
        Ok(())
    }

    /// Writes the vectors from each vehicle to the nearest point of the surface of each obstacle \[m\], E x N x K x 3.
    ///
    /// # Errors
    /// [`VectorError::Length`].
    pub fn write_obstacles(&self, vectors_m: &mut [f64]) -> Result<(), VectorError> {
        let obstacles = &self.starts.template.own().obstacles;
        check("vectors_m", 3 * self.vehicles * self.count() * obstacles.len(), vectors_m.len())?;
        let vehicles = self.worlds.iter().flat_map(|world| {
            let positions_m = &world.simulation.state().positions_m;
            (0..self.vehicles).map(move |i| row(positions_m, i))
        });
        let pairs = vehicles.flat_map(|position_m| obstacles.iter().map(move |obstacle| (position_m, obstacle)));
        for ((position_m, obstacle), vector_m) in pairs.zip(vectors_m.chunks_exact_mut(3)) {
            let (distance_m, away) = signed_distance_m(&obstacle.shape, position_m - obstacle.place_m);
            vector_m.copy_from_slice((-distance_m * away).as_slice());
        }
        Ok(())
    }

    /// Writes the states of all worlds.
    ///
    /// # Errors
    /// [`VectorError::Length`].
    pub fn write(&mut self, states: &mut StatesMut<'_>) -> Result<(), VectorError> {
        self.check_lengths(states)?;
        for_each(&mut self.worlds, (&Threads::One, 0), states, |_| ());
        Ok(())
    }

    fn check_lengths(&self, states: &StatesMut<'_>) -> Result<(), VectorError> {
        let (worlds, numbers) = (self.count(), 3 * self.vehicles * self.count());
        check("positions_m", numbers, states.positions_m.len())?;
        check("velocities_m_s", numbers, states.velocities_m_s.len())?;
        check("least_clearance_m", worlds, states.least_clearance_m.len())?;
        check("is_over", worlds, states.is_over.len())
    }

    fn check_commands(&self, commands: &[f64]) -> Result<(), VectorError> {
        let width = 3 * self.vehicles;
        check("u", width * self.count(), commands.len())?;
        // A fold without branches lets the compiler vectorize the comparison.
        let are_within = |some: &[f64]| some.iter().fold(true, |all, x| all & (x.abs() <= MAX_COMMAND_M_S2));
        for (world, some) in commands.chunks_exact(width.max(1)).enumerate() {
            if !are_within(some) && self.world(world).ending().is_none() {
                let index = some.iter().position(|x| !are_within(&[*x])).unwrap_or_default();
                return Err(VectorError::Command { world, vehicle: index / 3, axis: index % 3, value: some[index] });
            }
        }
        Ok(())
    }
}

impl World {
    /// Flies steps, with accelerations that were checked.
    fn fly(&mut self, commands: Option<&[f64]>, steps: u64) {
        if let Some(commands) = commands {
            for (i, command) in commands.chunks_exact(3).enumerate() {
                (0..3).for_each(|axis| self.commands[(i, axis)] = command[axis]);
            }
        }
        for _ in 0..steps {
            match commands {
                None => self.simulation.step(),
                Some(_) => self.simulation.step_with_checked(&self.commands),
            }
            // Events are not recorded here.
            self.simulation.events().for_each(drop);
            if self.simulation.ending().is_some() {
                return;
            }
        }
    }

    fn write(
        &self,
        (positions_m, velocities_m_s, clearance_m, is_over): (&mut [f64], &mut [f64], &mut f64, &mut bool),
    ) {
        write_rows(self.simulation.state(), positions_m, velocities_m_s);
        *clearance_m = self.simulation.least_clearance_m().unwrap_or(f64::NAN);
        *is_over = self.simulation.ending().is_some();
    }
}

/// Writes a state vehicle by vehicle.
fn write_rows(state: &Swarm, positions_m: &mut [f64], velocities_m_s: &mut [f64]) {
    for (rows, numbers) in [(&state.positions_m, positions_m), (&state.velocities_m_s, velocities_m_s)] {
        for (i, number) in numbers.chunks_exact_mut(3).enumerate() {
            (0..3).for_each(|axis| number[axis] = rows[(i, axis)]);
        }
    }
}

impl Starts {
    /// Returns the world of each search with its result. Calls `carries_on` on the calling thread every
    /// [`SEARCH_AT_ONCE`].
    ///
    /// # Errors
    /// [`VectorError::Interrupted`] if `carries_on` returns false.
    fn simulations(
        &self,
        mut searches: Vec<Search<'_>>,
        threads: &Threads,
        carries_on: &mut dyn FnMut() -> bool,
    ) -> Result<Vec<(usize, Started)>, VectorError> {
        let helpers = threads.helpers(LOAD_OF_A_START * searches.len() as u64);
        while searches.iter().any(|search| search.made.is_none()) {
            let began = Instant::now();
            let in_progress = searches.iter_mut().filter(|search| search.made.is_none());
            threads.share(helpers, in_progress, |search| {
                while search.made.is_none() && began.elapsed() < SEARCH_AT_ONCE {
                    search.try_next(self);
                }
            });
            if !carries_on() {
                return Err(VectorError::Interrupted);
            }
        }
        Ok(searches.into_iter().filter_map(|search| Some((search.world, search.made?))).collect())
    }

    /// Returns the next seed of a world, among those of a scenario file.
    fn later(&self, seed: u64) -> u64 {
        next_seed(seed, self.worlds)
    }

    /// Returns a simulation at the start of a seed, or at a given one.
    fn simulation(&self, world: usize, seed: u64, given: Option<Swarm>) -> Result<Simulation, VectorError> {
        let refused = |why| VectorError::Start { world, why };
        match (&self.common, given) {
            (Some(common), None) => Ok(common.lock().unwrap_or_else(PoisonError::into_inner).clone()),
            (Some(_), Some(start)) => started(&starting_at(self.template.own().clone(), start).map_err(refused)?),
            (None, given) => {
                let drawn = self.template.scenario(&self.law, Draw { seed, jitter_m: None });
                let drawn = drawn.map_err(|why| VectorError::Seed { world, seed, why })?;
                match given {
                    None => started(&drawn),
                    Some(start) => started(&starting_at(drawn, start).map_err(refused)?),
                }
            }
        }
    }
}

/// Returns a seed after another one, among those of a scenario file.
fn next_seed(seed: u64, by: u64) -> u64 {
    seed.wrapping_add(by) & i64::MAX.cast_unsigned()
}

fn starting_at(scenario: Scenario, start: Swarm) -> Result<Scenario, ScenarioError> {
    let scenario = Scenario { start, ..scenario };
    scenario.validate()?;
    Ok(scenario)
}

/// Returns a world at its start: its first commands may come from outside, its time is not measured, and free steps are
/// trusted.
fn started(scenario: &Scenario) -> Result<Simulation, VectorError> {
    let mut simulation = Simulation::awaiting_commands(scenario, Components::of(scenario)?)?;
    simulation.stop_measuring_time();
    simulation.allow_free_steps(FreeSteps::Trusted);
    Ok(simulation)
}

impl States {
    /// Returns states of the size of these worlds, all zero.
    #[must_use]
    pub fn of(worlds: &VectorSimulation) -> Self {
        let (worlds, numbers) = (worlds.count(), 3 * worlds.vehicles() * worlds.count());
        Self {
            positions_m: vec![0.0; numbers],
            velocities_m_s: vec![0.0; numbers],
            least_clearance_m: vec![0.0; worlds],
            is_over: vec![false; worlds],
        }
    }

    /// Borrows the memory.
    #[must_use]
    pub fn borrow(&mut self) -> StatesMut<'_> {
        let Self { positions_m, velocities_m_s, least_clearance_m, is_over } = self;
        StatesMut { positions_m, velocities_m_s, least_clearance_m, is_over }
    }
}

/// Changes each world, in any order, and writes its state. `load` is the number of steps of single vehicles.
fn for_each(
    worlds: &mut [World],
    (threads, load): (&Threads, u64),
    states: &mut StatesMut<'_>,
    change: impl Fn((usize, &mut World)) + Sync,
) {
    let helpers = threads.helpers(load).min(worlds.len() - 1);
    let width = states.positions_m.len() / worlds.len();
    let at_once = worlds.len().div_ceil(if helpers == 0 { 1 } else { CHUNKS_PER_THREAD * (helpers + 1) });
    let StatesMut { positions_m, velocities_m_s, least_clearance_m, is_over } = states;
    let chunks = worlds
        .chunks_mut(at_once)
        .zip(positions_m.chunks_mut(at_once * width))
        .zip(velocities_m_s.chunks_mut(at_once * width))
        .zip(least_clearance_m.chunks_mut(at_once))
        .zip(is_over.chunks_mut(at_once))
        .enumerate();
    threads.share(helpers, chunks, |(chunk, ((((worlds, positions), velocities), clearances), over))| {
        let moving = positions.chunks_mut(width).zip(velocities.chunks_mut(width));
        let states = moving.zip(clearances).zip(over);
        for (k, (world, (((p, v), clearance), over))) in worlds.iter_mut().zip(states).enumerate() {
            change((chunk * at_once + k, world));
            world.write((p, v, clearance, over));
        }
    });
}

impl Threads {
    /// Returns the number of threads that help with this number of steps of single vehicles.
    fn helpers(&self, load: u64) -> usize {
        let present = match self {
            Self::Current => rayon::current_num_threads() - 1,
            Self::One => 0,
            Self::With(pool) => pool.current_num_threads(),
        };
        present.min(usize::try_from(load / LOAD_OF_A_THREAD).unwrap_or(usize::MAX))
    }

    /// Passes each item to `work`, on the calling thread and the helpers.
    fn share<T>(&self, helpers: usize, items: impl Iterator<Item = T> + Send, work: impl Fn(T) + Sync) {
        fn with_helpers<'a>(scope: &Scope<'a>, helpers: usize, run: &'a (impl Fn() + Sync)) {
            (0..helpers).for_each(|_| scope.spawn(|_| run()));
            run();
        }
        let queue = Mutex::new(items);
        let next = || queue.lock().unwrap_or_else(PoisonError::into_inner).next();
        let run = || {
            while let Some(item) = next() {
                work(item);
            }
        };
        match self {
            _ if helpers == 0 => run(),
            Self::With(pool) => pool.in_place_scope(|scope| with_helpers(scope, helpers, &run)),
            _ => rayon::in_place_scope(|scope| with_helpers(scope, helpers, &run)),
        }
    }
}

fn check(what: &'static str, expected: usize, found: usize) -> Result<(), VectorError> {
    if expected == found { Ok(()) } else { Err(VectorError::Length { what, expected, found }) }
}

#[cfg(test)]
mod tests {
    use std::sync::Barrier;
    use std::sync::atomic::{AtomicU32, Ordering};

    use super::*;

    #[test]
    fn helpers_work_beside_the_calling_thread() {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().expect("threads");
        let (threads, all, sum) = (Threads::With(Arc::new(pool)), Barrier::new(3), AtomicU32::new(0));
        // Each item waits until three threads have one.
        threads.share(threads.helpers(u64::MAX), [1, 2, 4].into_iter(), |item| {
            all.wait();
            sum.fetch_add(item, Ordering::Relaxed);
        });
        assert_eq!(sum.into_inner(), 7);
        assert_eq!((threads.helpers(999), threads.helpers(1000)), (0, 1));
        assert_eq!(Threads::One.helpers(u64::MAX), 0);
    }
}
