//! One step of a simulation: divided into substeps as required; each is moved, audited and answered by the law.

use std::time::Duration;

use super::super::controller::Controller;
use super::super::ending::{Breakdown, Ending, MAX_BEND, MAX_COMMAND_M_S2};
use super::super::judge::longest_move_m;
use super::super::monitors::Substep;
use super::Simulation;
use crate::plant::Feedback as _;
use crate::plant::PlantError;
use crate::scenario::{MAX_HALVINGS, Scenario, TimeSpec};
use tautline_core::record::Event;
use tautline_core::swarm::{Rows, Swarm, first_row_beyond, largest_row_norm};
use tautline_laws::law::{Law, LawError, RateQuery, VoidReason};

/// Number of vehicles from which law and audit of a step run concurrently, if two threads are available. Both only read
/// the state, so the bits are the same. For fewer vehicles, starting a thread costs more.
const SIDE_BY_SIDE_FROM: usize = 512;

/// Division of a step.
struct Substeps {
    /// Fewest smallest substeps flown at once.
    shortest: u64,
    /// Whether a substep that cannot be halved was too long for the law.
    is_overlong: bool,
}

/// Largest product of a substep and the fastest rate of the law anywhere on its way. A substep beyond it is refused
/// even if [`TimeSpec::max_rate_dt`] held at its beginning: it may leap over the law's barrier.
const MAX_RATE_DT_ON_THE_WAY: f64 = 1.0;

impl Simulation {
    /// Flies one step, and halves it when refused.
    pub(super) fn advance(&mut self, step: u64) -> Result<(), Ending> {
        let whole = 1_u64 << self.scenario.time.max_halvings.min(MAX_HALVINGS);
        let mut parts = Substeps { shortest: whole, is_overlong: false };
        let flown = self.fly_substeps(step, whole, &mut parts);
        let Substeps { shortest, is_overlong } = parts;
        if shortest < whole && shortest != self.shortest {
            let (time_s, length_s) = (self.scenario.time.end_s(step - 1), self.scenario.time.length_s(step));
            let dt_s = length_s * (shortest as f64 / whole as f64);
            self.events.push(Event::StepRefined { time_s, dt_s });
        }
        self.shortest = shortest;
        self.refined_steps += u64::from(shortest < whole);
        if is_overlong && self.overlong_steps == 0 {
            self.certificate = self.certificate.clone().void_where(true, VoidReason::StepsTooLong);
        }
        self.overlong_steps += u64::from(is_overlong);
        flown
    }

    /// Returns the fastest rate of the law in the present state \[1/s\]. It is 0 in continuous time, which chooses its
    /// own steps, and under given commands or a shield.
    fn rate_per_s(&self, length_s: f64) -> f64 {
        if self.overruled || self.controller.shield.is_some() || !self.plant.holds_commands() {
            return 0.0;
        }
        let Self { controller: Controller { law, links, .. }, scenario, judge, state, .. } = self;
        let rate = |nearest_m: f64| rate_per_s(law.as_ref(), scenario, (nearest_m, judge.clearance_margin_m));
        let of_any_pair = rate(judge.nearest_m);
        // The nearest pair may not be one that the law acts on. The exact distance visits every edge.
        if of_any_pair * length_s <= scenario.time.stable_rate_dt() {
            return of_any_pair;
        }
        rate(judge.smallest_separation_of_law_m(law.as_ref(), links, state))
    }

    /// Returns whether substeps of the law's length change the motion. Under a control rate or given commands, the
    /// motion does not depend on the substeps.
    fn follows_the_law(&self) -> bool {
        !self.overruled && self.scenario.time.control_hz.is_none()
    }

    /// Flies the `whole` smallest substeps of a step, as many at once as the law's rate and the checks allow.
    fn fly_substeps(&mut self, step: u64, whole: u64, substeps: &mut Substeps) -> Result<(), Ending> {
        let (begin_s, length_s) = (self.scenario.time.end_s(step - 1), self.scenario.time.length_s(step));
        let seconds = |parts: u64| length_s * (parts as f64 / whole as f64);
        let (mut flown, mut part) = (0, whole);
        while flown < whole {
            let rate_per_s = self.rate_per_s(seconds(part));
            while part > 1 && seconds(part) * rate_per_s > self.scenario.time.max_rate_dt {
                part /= 2;
                substeps.shortest = part.min(substeps.shortest);
            }
            let undefined = self.move_vehicles(step, seconds(part))?;
            let (bend_m, limit_m) = (self.path.bend_m(), MAX_BEND * self.scenario.delta_m);
            let (is_refused, on_the_way_per_s) = self.is_step_too_long(seconds(part), rate_per_s);
            if part > 1 && (bend_m > limit_m || is_refused) {
                self.plant.restore(&self.state);
                self.controller.link.forget_after(self.time_s);
                part /= 2;
                substeps.shortest = part.min(substeps.shortest);
                continue;
            }
            if bend_m > limit_m {
                return Err(undefined.map_or(Breakdown::Bent { step, bend_m, limit_m }.into(), Ending::LawUndefined));
            }
            let [begun, way] = [rate_per_s.min(on_the_way_per_s), on_the_way_per_s].map(|rate| seconds(part) * rate);
            let is_honest = begun <= TimeSpec::DEFAULT_MAX_RATE_DT && way <= MAX_RATE_DT_ON_THE_WAY;
            let is_overlong = !is_honest && self.follows_the_law();
            substeps.is_overlong |= is_overlong;
            self.note_error(seconds(part), rate_per_s.max(on_the_way_per_s), is_overlong);
            flown += part;
            let from_s = self.time_s;
            if flown == whole {
                self.steps = step;
                self.time_s = self.scenario.time.end_s(step);
            } else {
                self.time_s = begin_s + seconds(flown);
            }
            std::mem::swap(&mut self.state, &mut self.next);
            self.resolution.add_step(&self.state, seconds(part), step)?;
            self.judge_and_command(Some((step, from_s)), flown == whole)?;
            while part < whole && flown.is_multiple_of(2 * part) {
                part *= 2;
            }
        }
        Ok(())
    }

    /// Updates the bound of the integration error after a substep, from the first overlong one on, and passes it to the
    /// judge.
    fn note_error(&mut self, length_s: f64, rate_per_s: f64, is_overlong: bool) {
        // Commands from delayed or wrong states do not change at the law's rate in the true state.
        if !self.controller.link.is_exact() || (!is_overlong && self.error.is_none()) {
            return;
        }
        let moved_m = longest_move_m(&self.state, &self.path, &self.next);
        let limits_m_s2 = [self.controller.law.capabilities().max_command_m_s2, self.scenario.actuation.max_accel_m_s2];
        let limit_m_s2 = limits_m_s2.into_iter().flatten().fold(f64::INFINITY, f64::min);
        let part = Substep { length_s, rate_per_s, moved_m, limit_m_s2, is_overlong };
        let error = self.error.unwrap_or_default().after(part);
        self.error = Some(error);
        self.judge.note_integration_error(error.position_m());
    }

    /// Moves the vehicles from `state` to `next`. Returns the law's error if the law was undefined on the way and the
    /// vehicles moved on.
    fn move_vehicles(&mut self, step: u64, dt_s: f64) -> Result<Option<LawError>, Ending> {
        let began = self.stopwatch.start();
        self.path.begin();
        let (interval, is_held) = ((self.time_s, dt_s), self.overruled || self.scenario.time.control_hz.is_some());
        let Self { plant, controller, next, path, .. } = self;
        let moved = if is_held {
            plant.advance(dt_s, next, path).map(|()| None)
        } else {
            plant.advance_under(controller, interval, next, path)
        };
        let undefined = moved.map_err(|error| match error {
            PlantError::NotFinite { vehicle } => Breakdown::StateNotFinite { step, vehicle }.into(),
            PlantError::EngineDiffers { vehicle } => Breakdown::EngineDiffers { step, vehicle }.into(),
            PlantError::Stalled => Breakdown::Stalled { step }.into(),
            PlantError::Law(source) => Ending::LawUndefined(source),
        })?;
        self.performance.physics += began.elapsed();
        match self.next.first_not_finite() {
            Some(vehicle) => Err(Breakdown::StateNotFinite { step, vehicle }.into()),
            None => Ok(undefined),
        }
    }

    /// Returns whether the last move must be halved: it comes too close to the barrier, or to states in which the law
    /// is too fast for this length \[s\]. The second result is the fastest rate of the law on the way \[1/s\]. It is
    /// that at the start if the law has no barrier or is not evaluated.
    fn is_step_too_long(&mut self, length_s: f64, at_start_per_s: f64) -> (bool, f64) {
        let Self {
            controller: Controller { law, links, link, shield, .. },
            judge,
            state,
            path,
            next,
            scenario,
            plant,
            overruled,
            ..
        } = self;
        let (inputs, moves) = ((law.as_ref(), &*links), (&*state, &*path, &*next));
        let Some(barrier_m) = law.capabilities().barrier_m.filter(|_| !*overruled && shield.is_none()) else {
            return (false, at_start_per_s);
        };
        let moved_m = longest_move_m(state, path, next);
        if !plant.holds_commands() {
            return (judge.is_step_too_long(inputs, moves, moved_m), at_start_per_s);
        }
        let (clearance_margin_m, most) =
            (judge.clearance_margin_m - moved_m, TimeSpec::DEFAULT_MAX_RATE_DT.min(scenario.time.max_rate_dt));
        let rate = |nearest_m: f64| rate_per_s(law.as_ref(), scenario, (nearest_m, clearance_margin_m));
        let enough = |nearest_m: f64| nearest_m > barrier_m && rate(nearest_m) * length_s <= most;
        let may_leap = link.is_exact() && judge.nearest_m > barrier_m;
        let nearest_m = judge.smallest_separation_of_move(inputs, moves, moved_m, enough);
        let on_the_way_per_s = rate(nearest_m);
        let is_too_fast = on_the_way_per_s * length_s > MAX_RATE_DT_ON_THE_WAY.max(scenario.time.max_rate_dt);
        let is_refused = is_too_fast || judge.is_step_too_long(inputs, moves, moved_m);
        // A law may have no rate at or inside its barrier; no substep is short enough there.
        let leaps = may_leap && nearest_m <= barrier_m;
        (is_refused, if leaps { f64::INFINITY } else { on_the_way_per_s })
    }

    /// Audits the way to `state` (or the start), evaluates the law and applies its command. With a control rate, the
    /// command is kept between whole steps.
    pub(super) fn judge_and_command(&mut self, step: Option<(u64, f64)>, is_whole: bool) -> Result<(), Ending> {
        let (number, from_s) = step.unwrap_or((0, self.time_s));
        let refused = |why| Ending::from(Breakdown::Audit { step: number, why });
        let bend_m = self.path.bend_m() + self.resolution.rounding_m();
        for (after_s, positions_m) in self.path.instants() {
            self.judge.sweep(from_s + after_s, positions_m, bend_m, &mut self.events).map_err(refused)?;
        }
        if let Some(shield) = &mut self.controller.shield {
            shield.observe(self.time_s, &self.state);
        }
        let time = &self.scenario.time;
        let is_instant = time.control_hz.is_none() || (is_whole && time.commands(number));
        let is_asked = !self.overruled && is_instant;
        self.controller.awaits_command = self.overruled && is_instant && self.controller.shield.is_some();
        if time.control_hz.is_some() || (self.overruled && !self.controller.link.is_exact()) {
            if step.is_some() {
                self.controller.actuate(self.time_s, &mut self.control);
            }
            self.plant.apply(&self.control, &mut self.state);
        }
        // Held commands complete the velocities before sensors measure them.
        self.controller.accept(self.time_s, &self.state);
        self.controller.link.settle(self.time_s);
        let Self { judge, controller, state, control, time_s, events, stopwatch, .. } = self;
        let may_move = !controller.law.capabilities().requires_calling_thread;
        let (state, time_s): (&Swarm, f64) = (state, *time_s);
        let mut audit = || {
            let began = stopwatch.start();
            let positions_m = &state.positions_m;
            let judged = match step {
                None => judge.start(time_s, positions_m, events),
                Some(_) => judge.sweep(time_s, positions_m, bend_m, events),
            };
            (judged, began.elapsed())
        };
        let mut act = || {
            let began = stopwatch.start();
            (controller.act(time_s, state, is_asked.then_some(control)), began.elapsed())
        };
        let side_by_side = may_move && state.count() >= SIDE_BY_SIDE_FROM && rayon::current_num_threads() > 1;
        let ((judged, audit_time), (commanded, law_time)) =
            if side_by_side { rayon::join(audit, act) } else { (audit(), act()) };
        self.performance.audit += audit_time;
        let Self { energy_monitor, scenario, controller, state, certificate, events, .. } = self;
        energy_monitor.note_changes(scenario, controller, (time_s, state), certificate, events);
        let commanded = self.apply_command(number, commanded.map_err(Ending::from), law_time);
        judged.map_err(refused)?;
        self.judge.note_engine_contacts(self.plant.as_ref(), self.time_s, &mut self.events);
        self.judge.note_bounces(self.plant.as_ref(), from_s, &mut self.events);
        commanded
    }

    /// Evaluates the law for the present state.
    pub(super) fn evaluate_law(&mut self) -> Result<(), Ending> {
        let began = self.stopwatch.start();
        let commanded = self.controller.command(self.time_s, &self.state, &mut self.control);
        self.apply_command(self.steps, commanded.map_err(Ending::from), began.elapsed())
    }

    /// Applies the command to the plant, if the law has one.
    pub(super) fn apply_command(
        &mut self,
        step: u64,
        commanded: Result<(), Ending>,
        took: Duration,
    ) -> Result<(), Ending> {
        self.performance.law += took;
        let checked = commanded.and_then(|()| match first_row_beyond(&self.control, MAX_COMMAND_M_S2) {
            Some(vehicle) if self.control.row(vehicle).iter().all(|x| x.is_finite()) => {
                Err(Breakdown::CommandOutOfRange { step, vehicle }.into())
            }
            Some(vehicle) => Err(Breakdown::CommandNotFinite { step, vehicle }.into()),
            None => Ok(()),
        });
        if checked.is_err() {
            (self.control, self.energy) = (Rows::zeros(0), None);
            return checked;
        }
        self.plant.apply(&self.control, &mut self.state);
        if let Some(vehicle) = self.state.first_not_finite() {
            return Err(Breakdown::StateNotFinite { step, vehicle }.into());
        }
        if self.overruled {
            self.energy = None;
        } else {
            let began = self.stopwatch.start();
            self.energy = self.controller.energy(self.time_s, &self.state);
            self.performance.energy += began.elapsed();
        }
        self.energy_monitor.add(self.controller.target.view().revision, self.energy);
        self.peaks.take(largest_row_norm(&self.control), self.energy);
        Ok(())
    }
}

/// Returns the fastest rate of a law \[1/s\] while no pair and no obstacle is closer than given \[m\].
fn rate_per_s(law: &dyn Law, scenario: &Scenario, (nearest_m, clearance_margin_m): (f64, f64)) -> f64 {
    let query = RateQuery::new(scenario.velocity_coefficient_per_s(), Some(nearest_m));
    let rates = law.rates(&RateQuery { obstacle_margin_m: Some(clearance_margin_m), ..query });
    let of_pairs = rates.fastest_per_s.unwrap_or(0.0);
    match rates.obstacles_per_s2 {
        0.0 => of_pairs,
        squared => (of_pairs.powi(2) + squared).sqrt(),
    }
}
