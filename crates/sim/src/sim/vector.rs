//! [`VectorSimulation`]: many worlds of one scenario that advance together.

use rayon::prelude::*;

use super::ending::{MAX_COMMAND_M_S2, SimError};
use super::simulation::Simulation;
use crate::scenario::{Draw, NamedLaw, ScenarioError, Template};
use tautline_core::swarm::Rows;

/// Worlds of one scenario, each a [`Simulation`] with a seed of its own, on the threads of the current rayon pool.
///
/// World k flies the scenario with its seed as `start.seed` and, if the flight is random, as `noise.seed`. It has the
/// bits of a single simulation under the same commands, for any number of threads. A world that ends does not stop the
/// others; it keeps its last state until it is reset.
///
/// ```
/// use tautline_sim::scenario::{Source, Template};
/// use tautline_sim::sim::{States, VectorSimulation};
///
/// let template = Template::read(&Source::resolve("pentagon")?, &[])?;
/// let mut worlds = VectorSimulation::new(template, &[0, 1, 2])?;
/// let mut states = States::of(&worlds);
/// let commands = vec![0.1; 3 * worlds.vehicles() * worlds.count()];
/// worlds.step(Some(&commands), 240, &mut states.borrow())?;
/// assert!(states.positions_m.len() == 45 && worlds.world(2).time_s() == 1.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct VectorSimulation {
    starts: Starts,
    worlds: Vec<World>,
    vehicles: usize,
    resets_ended: bool,
    is_parallel: bool,
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
    #[error("u[{world}, {vehicle}, {axis}]: must be a finite number up to {MAX_COMMAND_M_S2:e} m/s^2, got {value}")]
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
    /// A seed gives no valid start. If a world is reset because it ended, the other worlds have advanced.
    #[error("seeds[{world}]: seed {seed} gives no valid scenario: {why}")]
    Seed {
        /// The world, from 0.
        world: usize,
        /// Its seed.
        seed: u64,
        /// Reason.
        why: ScenarioError,
    },
    /// The scenario cannot be flown in this way.
    #[error(transparent)]
    Sim(#[from] SimError),
}

/// One world.
struct World {
    seed: u64,
    simulation: Simulation,
    /// Commands of the present call, N x 3 \[m/s^2\].
    commands: Rows,
    /// Error of the present call.
    failure: Option<VectorError>,
}

/// Worlds to change, each with `width` numbers of positions.
struct Stage<'a> {
    worlds: &'a mut [World],
    width: usize,
    is_parallel: bool,
}

/// Source of new simulations.
struct Starts {
    template: Template,
    law: NamedLaw,
    /// Whether start or flight depends on a seed.
    is_random: bool,
}

impl VectorSimulation {
    /// Creates one world for each seed, at its start.
    ///
    /// # Errors
    /// [`VectorError::NoWorlds`], [`VectorError::Seed`] if a seed gives no valid start, and [`VectorError::Sim`] if the
    /// audit does not support the scenario.
    pub fn new(template: Template, seeds: &[u64]) -> Result<Self, VectorError> {
        if seeds.is_empty() {
            return Err(VectorError::NoWorlds);
        }
        let vehicles = template.own().count();
        let is_random = template.start_is_random() || template.flight_is_random();
        let starts = Starts { law: template.own_law(), template, is_random };
        let simulations: Vec<_> =
            seeds.par_iter().enumerate().map(|(world, &seed)| starts.simulation(world, seed)).collect();
        let worlds = simulations.into_iter().zip(seeds).map(|(simulation, &seed)| {
            Ok(World { seed, simulation: simulation?, commands: Rows::zeros(vehicles), failure: None })
        });
        let worlds = worlds.collect::<Result<Vec<_>, VectorError>>()?;
        Ok(Self { starts, worlds, vehicles, resets_ended: false, is_parallel: true })
    }

    /// Sets whether [`VectorSimulation::step`] resets worlds that have ended, instead of leaving them.
    pub fn set_autoreset(&mut self, resets_ended: bool) {
        self.resets_ended = resets_ended;
    }

    /// Sets whether steps use the threads of the current rayon pool (the default) or only the calling thread.
    pub fn set_parallel(&mut self, is_parallel: bool) {
        self.is_parallel = is_parallel;
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
    /// [`VectorSimulation::set_autoreset`], a world that had ended before this call is reset instead, to its next seed:
    /// its seed plus E.
    ///
    /// # Errors
    /// [`VectorError`]: a wrong length; a command that is not finite; commands under a shield.
    pub fn step(
        &mut self,
        commands: Option<&[f64]>,
        steps: u64,
        states: &mut StatesMut<'_>,
    ) -> Result<(), VectorError> {
        self.check_lengths(states)?;
        if let Some(commands) = commands {
            self.check_commands(commands)?;
        }
        let (resets_ended, worlds) = (self.resets_ended, self.worlds.len() as u64);
        let starts = &self.starts;
        let width = 3 * self.vehicles;
        let advance = |(k, world): (usize, &mut World)| {
            if world.simulation.ending().is_none() {
                let commands = commands.map(|commands| &commands[k * width..(k + 1) * width]);
                world.fly(commands, steps);
            } else if resets_ended {
                world.failure = world.restart(starts, k, later(world.seed, worlds)).err();
            }
        };
        Stage { worlds: &mut self.worlds, width, is_parallel: self.is_parallel }.for_each(states, advance);
        self.worlds.iter_mut().find_map(|world| world.failure.take()).map_or(Ok(()), Err)
    }

    /// Resets the chosen worlds to their starts, with these seeds or else with the next seed of each: its seed plus E.
    /// Writes the states of all worlds.
    ///
    /// # Errors
    /// [`VectorError`]: a wrong length, or a seed without a valid start.
    pub fn reset(
        &mut self,
        chosen: &[bool],
        seeds: Option<&[u64]>,
        states: &mut StatesMut<'_>,
    ) -> Result<(), VectorError> {
        let count = self.count();
        self.check_lengths(states)?;
        check("mask", count, chosen.len())?;
        seeds.map_or(Ok(()), |seeds| check("seeds", count, seeds.len()))?;
        let starts = &self.starts;
        let next = |(k, world): (usize, &World)| (k, seeds.map_or_else(|| later(world.seed, count as u64), |of| of[k]));
        let drawn: Vec<_> = self.worlds.iter().enumerate().filter(|(k, _)| chosen[*k]).map(next).collect();
        let made: Vec<_> = drawn.into_par_iter().map(|(k, seed)| (k, seed, starts.simulation(k, seed))).collect();
        let made = made.into_iter().map(|(k, seed, simulation)| Ok((k, seed, simulation?)));
        for (k, seed, simulation) in made.collect::<Result<Vec<_>, VectorError>>()? {
            (self.worlds[k].seed, self.worlds[k].simulation) = (seed, simulation);
        }
        let width = 3 * self.vehicles;
        Stage { worlds: &mut self.worlds, width, is_parallel: self.is_parallel }.for_each(states, |_| ());
        Ok(())
    }

    /// Writes the states of all worlds.
    ///
    /// # Errors
    /// [`VectorError::Length`].
    pub fn write(&mut self, states: &mut StatesMut<'_>) -> Result<(), VectorError> {
        self.check_lengths(states)?;
        let width = 3 * self.vehicles;
        Stage { worlds: &mut self.worlds, width, is_parallel: self.is_parallel }.for_each(states, |_| ());
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
        if self.starts.template.own().shield.as_ref().is_some_and(|shield| shield.enabled) {
            return Err(SimError::ShieldedCommands.into());
        }
        let width = 3 * self.vehicles;
        check("u", width * self.count(), commands.len())?;
        // A fold without branches lets the compiler vectorize the comparison.
        let are_within = |some: &[f64]| some.iter().fold(true, |all, x| all & (x.abs() <= MAX_COMMAND_M_S2));
        for (world, some) in commands.chunks_exact(width.max(1)).enumerate() {
            if !are_within(some) && self.world(world).ending().is_none() {
                let at = some.iter().position(|x| !are_within(&[*x])).unwrap_or_default();
                return Err(VectorError::Command { world, vehicle: at / 3, axis: at % 3, value: some[at] });
            }
        }
        Ok(())
    }
}

impl Stage<'_> {
    /// Changes each world, in any order, and writes its state.
    fn for_each(self, states: &mut StatesMut<'_>, change: impl Fn((usize, &mut World)) + Sync) {
        let Self { worlds, width, is_parallel } = self;
        let update = |k: usize, world: &mut World, state: (&mut [f64], &mut [f64], &mut f64, &mut bool)| {
            change((k, world));
            world.write(state);
        };
        let StatesMut { positions_m, velocities_m_s, least_clearance_m, is_over } = states;
        if is_parallel && worlds.len() > 1 && rayon::current_num_threads() > 1 {
            worlds
                .par_iter_mut()
                .zip(positions_m.par_chunks_exact_mut(width))
                .zip(velocities_m_s.par_chunks_exact_mut(width))
                .zip(least_clearance_m.par_iter_mut())
                .zip(is_over.par_iter_mut())
                .enumerate()
                .for_each(|(k, ((((world, p), v), clearance), over))| update(k, world, (p, v, clearance, over)));
        } else {
            let moving = positions_m.chunks_exact_mut(width).zip(velocities_m_s.chunks_exact_mut(width));
            let judged = least_clearance_m.iter_mut().zip(is_over.iter_mut());
            for (k, ((world, (p, v)), (clearance, over))) in worlds.iter_mut().zip(moving).zip(judged).enumerate() {
                update(k, world, (p, v, clearance, over));
            }
        }
    }
}

impl World {
    fn fly(&mut self, commands: Option<&[f64]>, steps: u64) {
        if let Some(commands) = commands {
            for (i, command) in commands.chunks_exact(3).enumerate() {
                (0..3).for_each(|axis| self.commands[(i, axis)] = command[axis]);
            }
        }
        for _ in 0..steps {
            let flown = match commands {
                Some(_) => self.simulation.step_with(&self.commands),
                None => {
                    self.simulation.step();
                    Ok(())
                }
            };
            if let Err(error) = flown {
                self.failure = Some(error.into());
                return;
            }
            // Events are not recorded here.
            self.simulation.events().for_each(drop);
            if self.simulation.ending().is_some() {
                return;
            }
        }
    }

    fn restart(&mut self, starts: &Starts, place: usize, seed: u64) -> Result<(), VectorError> {
        self.simulation = starts.simulation(place, seed)?;
        self.seed = seed;
        Ok(())
    }

    fn write(
        &self,
        (positions_m, velocities_m_s, clearance_m, is_over): (&mut [f64], &mut [f64], &mut f64, &mut bool),
    ) {
        let state = self.simulation.state();
        for (rows, numbers) in [(&state.positions_m, positions_m), (&state.velocities_m_s, velocities_m_s)] {
            for (i, number) in numbers.chunks_exact_mut(3).enumerate() {
                (0..3).for_each(|axis| number[axis] = rows[(i, axis)]);
            }
        }
        *clearance_m = self.simulation.least_clearance_m().unwrap_or(f64::NAN);
        *is_over = self.simulation.ending().is_some();
    }
}

impl Starts {
    /// Returns a simulation at the start of a seed.
    fn simulation(&self, world: usize, seed: u64) -> Result<Simulation, VectorError> {
        if !self.is_random {
            return Ok(Simulation::new(self.template.own())?);
        }
        let drawn = self.template.scenario(&self.law, Draw { seed, jitter_m: None });
        let scenario = drawn.map_err(|why| VectorError::Seed { world, seed, why })?;
        Ok(Simulation::new(&scenario)?)
    }
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

/// Returns the next seed of a world, among those of a scenario file.
fn later(seed: u64, worlds: u64) -> u64 {
    seed.wrapping_add(worlds) & i64::MAX.cast_unsigned()
}

fn check(what: &'static str, expected: usize, found: usize) -> Result<(), VectorError> {
    if expected == found { Ok(()) } else { Err(VectorError::Length { what, expected, found }) }
}
