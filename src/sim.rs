//! The loop: sense, law, actuate, plant, observe, judge, record.
//!
//! [`fly`] takes any [`Law`] and any [`Plant`]. The law is asked at the beginning of each step, and what it commands is
//! recorded; the plant holds the command over the step (sample-and-hold) or, where it stands for continuous time, asks
//! the law itself. The audit sweeps every step, the step that a refusal shortened too. The loop allocates nothing per
//! step.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use crate::audit::{AuditError, AuditOutcome, Auditor, StepFinding, Violation, swept_separation_m};
use crate::law::{Certificate, Law, LawError};
use crate::plant::{Plant, PlantError};
use crate::record::{Event, RecordError, Recorder, Sample};
use crate::scenario::{MAX_HALVINGS, Scenario};
use crate::swarm::{ClosestApproach, Pair, Rows, Swarm, first_row_not_finite, row};

/// From this many vehicles on, law and audit of a step run side by side when two threads are at hand. Both read the
/// same state and share nothing, so the answer has the same bits either way; below, starting a thread costs more.
const SIDE_BY_SIDE_FROM: usize = 512;

/// A path may bend away from the straight line that is swept by this much \[m\]; two vehicles by twice as much. A step
/// that bends more is flown in halves.
const MAX_BEND_M: f64 = 1e-5;

/// What a flight left behind besides its recording.
#[derive(Clone, Debug)]
pub struct Flight {
    /// How it ended.
    pub ending: Ending,
    /// Time flown \[s\].
    pub duration_s: f64,
    /// Whole steps flown.
    pub steps: u64,
    /// The law's promise, made before the first step.
    pub certificate: Certificate,
    /// What the independent judge found.
    pub audit: AuditOutcome,
    /// Pairs whose keep-out balls the plant's own collision detection saw overlap, in index order.
    pub engine_contacts: Vec<Pair>,
    /// State at the end.
    pub last: Swarm,
    /// Wall-clock time by kind of work.
    pub performance: Performance,
}

/// How a flight ended.
#[derive(Clone, Debug, PartialEq)]
pub enum Ending {
    /// At the scenario's duration.
    Completed,
    /// The caller asked for it.
    Interrupted,
    /// The law had no answer for the state that was reached.
    LawUndefined(LawError),
    /// The motion could not be carried on.
    BrokeDown(Breakdown),
}

/// Wall-clock time by kind of work. Work done side by side counts in each kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Performance {
    /// From first to last step.
    pub wall: Duration,
    /// In the law.
    pub law: Duration,
    /// In the plant.
    pub physics: Duration,
    /// In the audit.
    pub audit: Duration,
    /// In the recorders.
    pub record: Duration,
}

/// Why a motion could not be carried on. The state before is the last.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Breakdown {
    /// The law commanded something that is not a number.
    #[error("step {step}: the law's command for vehicle {} is not a finite number", vehicle + 1)]
    CommandNotFinite {
        /// The step, from 1; 0 is the start.
        step: u64,
        /// The vehicle, from 0.
        vehicle: usize,
    },
    /// A vehicle's state left the range of numbers.
    #[error("step {step}: the state of vehicle {} is no longer a finite number", vehicle + 1)]
    StateNotFinite {
        /// The step, from 1; 0 is the start.
        step: u64,
        /// The vehicle, from 0.
        vehicle: usize,
    },
    /// The plant could not be solved any further.
    #[error("step {step}: the equation of motion cannot be solved to its tolerances")]
    Stalled {
        /// The step, from 1.
        step: u64,
    },
    /// A path bends too far from the straight line that is swept, however often the step is halved.
    #[error(
        "step {step}: a path bends by {bend_m:.1e} m from the straight line that is audited, and {MAX_BEND_M:e} m are allowed"
    )]
    Bent {
        /// The step, from 1.
        step: u64,
        /// By how much at most \[m\].
        bend_m: f64,
    },
    /// The judge refused what it was shown.
    #[error("step {step}: {why}")]
    Audit {
        /// The step, from 1; 0 is the start.
        step: u64,
        /// The judge's reason.
        why: AuditError,
    },
}

/// Why there is no flight to report on.
#[derive(Debug, thiserror::Error)]
pub enum SimError {
    /// There is no judge for the scenario.
    #[error(transparent)]
    Audit(#[from] AuditError),
    /// The recording could not be kept.
    #[error(transparent)]
    Record(#[from] RecordError),
}

/// What stops the loop before its time.
enum Stop {
    /// The flight ends here.
    Ended(Ending),
    /// It cannot be recorded.
    Unrecorded(RecordError),
}

impl From<LawError> for Stop {
    fn from(undefined: LawError) -> Self {
        Self::Ended(Ending::LawUndefined(undefined))
    }
}

impl From<Breakdown> for Stop {
    fn from(breakdown: Breakdown) -> Self {
        Self::Ended(Ending::BrokeDown(breakdown))
    }
}

impl From<RecordError> for Stop {
    fn from(error: RecordError) -> Self {
        Self::Unrecorded(error)
    }
}

/// Flies a scenario under `law` in `plant` and hands every recorded instant to `recorder`.
///
/// `carry_on` is asked after each step with the number of steps flown and ends the flight with
/// [`ControlFlow::Break`].
///
/// A step that takes more than half of the clearance above the law's barrier from some pair is refused, undone and flown
/// in halves (at most [`crate::scenario::TimeSpec::max_halvings`] times), with the law asked anew in between. So is one
/// on which a path bends by more than 1e-5 m from the straight line that the audit sweeps, as the ideal plant's may.
///
/// The scenario must be one that [`Scenario::validate`] accepts, and law and plant of its number of vehicles.
///
/// # Errors
/// [`SimError`]; what was recorded up to then stays recorded. A motion that cannot be carried on is no error but an
/// [`Ending`], with the reason as the last event of the recording.
pub fn fly(
    scenario: &Scenario,
    law: &mut dyn Law,
    plant: &mut dyn Plant,
    recorder: &mut dyn Recorder,
    carry_on: &mut dyn FnMut(u64) -> ControlFlow<()>,
) -> Result<Flight, SimError> {
    let certificate = law.certificate(&scenario.start);
    let mut cockpit = Cockpit::new(scenario, law, plant, recorder)?;
    let began = Instant::now();
    let ending = cockpit.fly(carry_on)?;
    cockpit.performance.wall = began.elapsed();
    Ok(cockpit.land(ending, certificate))
}

/// Everything that a step needs, allocated once.
struct Cockpit<'a> {
    scenario: &'a Scenario,
    law: &'a mut dyn Law,
    plant: &'a mut dyn Plant,
    recorder: &'a mut dyn Recorder,
    auditor: Auditor,
    state: Swarm,
    next: Swarm,
    control: Rows,
    time_s: f64,
    steps: u64,
    /// Closest approach since the last sample.
    closest: Option<ClosestApproach>,
    /// Smallest separation over the last sweep: bounds from below how near any pair is now.
    nearest_m: f64,
    engine_contacts: Vec<Pair>,
    contacts_now: Vec<Pair>,
    performance: Performance,
}

impl<'a> Cockpit<'a> {
    fn new(
        scenario: &'a Scenario,
        law: &'a mut dyn Law,
        plant: &'a mut dyn Plant,
        recorder: &'a mut dyn Recorder,
    ) -> Result<Self, SimError> {
        let mut state = scenario.start.clone();
        plant.observe(&mut state);
        Ok(Self {
            auditor: Auditor::new(scenario.count(), scenario.delta_m)?,
            next: state.clone(),
            control: Rows::zeros(scenario.count()),
            state,
            scenario,
            law,
            plant,
            recorder,
            time_s: 0.0,
            steps: 0,
            closest: None,
            nearest_m: 0.0,
            engine_contacts: Vec::new(),
            contacts_now: Vec::new(),
            performance: Performance::default(),
        })
    }

    fn fly(&mut self, carry_on: &mut dyn FnMut(u64) -> ControlFlow<()>) -> Result<Ending, RecordError> {
        let ending = match self.fly_steps(carry_on) {
            Ok(()) => return Ok(Ending::Completed),
            Err(Stop::Ended(ending)) => ending,
            Err(Stop::Unrecorded(error)) => return Err(error),
        };
        self.record_end(&ending)?;
        Ok(ending)
    }

    fn fly_steps(&mut self, carry_on: &mut dyn FnMut(u64) -> ControlFlow<()>) -> Result<(), Stop> {
        if let Some(vehicle) = self.state.first_not_finite() {
            return Err(Breakdown::StateNotFinite { step: 0, vehicle }.into());
        }
        self.judge_and_command(None)?;
        self.record_sample()?;
        for step in 1..=self.scenario.time.steps() {
            self.advance(step)?;
            if self.scenario.time.records(step) {
                self.record_sample()?;
            }
            if carry_on(step).is_break() && step < self.scenario.time.steps() {
                return Err(Stop::Ended(Ending::Interrupted));
            }
        }
        Ok(())
    }

    /// Flies one step, in halves where it is refused.
    fn advance(&mut self, step: u64) -> Result<(), Stop> {
        let whole = 1_u64 << self.scenario.time.max_halvings.min(MAX_HALVINGS);
        let mut shortest = whole;
        let flown = self.fly_parts(step, whole, &mut shortest);
        if shortest < whole {
            let dt_s = self.scenario.time.dt_s;
            let (time_s, dt_s) = ((step - 1) as f64 * dt_s, dt_s * (shortest as f64 / whole as f64));
            self.recorder.event(&Event::StepRefined { time_s, dt_s })?;
        }
        flown
    }

    /// Flies the `whole` parts of a step, as many at once as are not refused; the fewest at once are `shortest`.
    fn fly_parts(&mut self, step: u64, whole: u64, shortest: &mut u64) -> Result<(), Stop> {
        let dt_s = self.scenario.time.dt_s;
        let seconds = |parts: u64| dt_s * (parts as f64 / whole as f64);
        let (mut flown, mut part) = (0, whole);
        while flown < whole {
            self.move_vehicles(step, seconds(part))?;
            let bend_m = self.plant.bend_m();
            if part > 1 && (bend_m > MAX_BEND_M || self.is_refused()) {
                self.plant.restore(&self.state);
                part /= 2;
                *shortest = part.min(*shortest);
                continue;
            }
            if bend_m > MAX_BEND_M {
                return Err(Breakdown::Bent { step, bend_m }.into());
            }
            flown += part;
            if flown == whole {
                self.steps = step;
                self.time_s = step as f64 * dt_s;
            } else {
                self.time_s = (step - 1) as f64 * dt_s + seconds(flown);
            }
            std::mem::swap(&mut self.state, &mut self.next);
            self.judge_and_command(Some(step))?;
            while part < whole && flown.is_multiple_of(2 * part) {
                part *= 2;
            }
        }
        Ok(())
    }

    /// Moves the vehicles from `state` to `next`.
    fn move_vehicles(&mut self, step: u64, dt_s: f64) -> Result<(), Stop> {
        let began = Instant::now();
        self.plant.step(self.law, &self.control, dt_s).map_err(|error| match error {
            PlantError::LawUndefined(undefined) => Stop::from(undefined),
            PlantError::NotFinite { vehicle } => Breakdown::StateNotFinite { step, vehicle }.into(),
            PlantError::Stalled => Breakdown::Stalled { step }.into(),
        })?;
        self.plant.observe(&mut self.next);
        self.performance.physics += began.elapsed();
        match self.next.first_not_finite() {
            Some(vehicle) => Err(Breakdown::StateNotFinite { step, vehicle }.into()),
            None => Ok(()),
        }
    }

    /// Whether the move from `state` to `next` takes more than half of some pair's clearance above the barrier.
    fn is_refused(&self) -> bool {
        let Some(barrier_m) = self.law.barrier_m() else { return false };
        let moved_m = (0..self.state.count())
            .map(|i| (row(&self.next.positions_m, i) - row(&self.state.positions_m, i)).norm())
            .fold(0.0, f64::max);
        // No pair is nearer than `nearest_m` and none closes by more than twice the longest move.
        if 2.0 * moved_m <= 0.5 * (self.nearest_m - barrier_m) {
            return false;
        }
        self.scenario.graph.edges().any(|(i, j)| {
            let from = row(&self.state.positions_m, j) - row(&self.state.positions_m, i);
            let to = row(&self.next.positions_m, j) - row(&self.next.positions_m, i);
            let clearance_m = from.norm() - barrier_m;
            swept_separation_m(from, to) - barrier_m < 0.5 * clearance_m
        })
    }

    /// Audits the sweep that led to `state` (or the start) and asks the law for the next command.
    fn judge_and_command(&mut self, step: Option<u64>) -> Result<(), Stop> {
        let Self { auditor, law, state, control, time_s, .. } = self;
        let (state, time_s): (&Swarm, f64) = (state, *time_s);
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
            (law.control(state, control), began.elapsed())
        };
        let side_by_side = state.count() >= SIDE_BY_SIDE_FROM && rayon::current_num_threads() > 1;
        let ((finding, audit_time), (commanded, law_time)) =
            if side_by_side { rayon::join(audit, command) } else { (audit(), command()) };
        self.performance.audit += audit_time;
        self.performance.law += law_time;
        let step = step.unwrap_or(0);
        let commanded = commanded.map_err(Stop::from).and_then(|()| match first_row_not_finite(&self.control) {
            Some(vehicle) => Err(Breakdown::CommandNotFinite { step, vehicle }.into()),
            None => Ok(()),
        });
        if commanded.is_err() {
            self.control = Rows::zeros(0);
        }
        let finding = finding.map_err(|why| Breakdown::Audit { step, why })?;
        if let Some(closest) = finding.closest {
            self.nearest_m = closest.separation_m;
            self.closest = self.closest.filter(|before| before.separation_m <= closest.separation_m).or(Some(closest));
        }
        record_violations(self.recorder, &finding)?;
        self.collect_engine_contacts()?;
        commanded
    }

    fn collect_engine_contacts(&mut self) -> Result<(), RecordError> {
        self.contacts_now.clear();
        self.plant.keep_out_contacts(&mut self.contacts_now);
        for &pair in &self.contacts_now {
            if let Err(place) = self.engine_contacts.binary_search(&pair) {
                self.engine_contacts.insert(place, pair);
                self.recorder.event(&Event::EngineContact { pair, time_s: self.time_s })?;
            }
        }
        Ok(())
    }

    fn record_sample(&mut self) -> Result<(), RecordError> {
        let began = Instant::now();
        self.recorder.sample(&Sample {
            time_s: self.time_s,
            step: self.steps,
            swarm: &self.state,
            control: &self.control,
            separation: self.closest.take(),
            energy: self.law.energy(&self.state),
            channels: &[],
        })?;
        self.performance.record += began.elapsed();
        Ok(())
    }

    /// Records the last instant, unless it has been, and why it is the last.
    fn record_end(&mut self, ending: &Ending) -> Result<(), RecordError> {
        let reason = match ending {
            Ending::Completed => return Ok(()),
            Ending::Interrupted => "interrupted".to_owned(),
            Ending::LawUndefined(why) => format!("the law is undefined: {why}"),
            Ending::BrokeDown(why) => why.to_string(),
        };
        if self.closest.is_some() {
            self.record_sample()?;
        }
        self.recorder.event(&Event::EndedEarly { time_s: self.time_s, reason })
    }

    fn land(self, ending: Ending, certificate: Certificate) -> Flight {
        Flight {
            ending,
            duration_s: self.time_s,
            steps: self.steps,
            certificate,
            audit: self.auditor.finish(),
            engine_contacts: self.engine_contacts,
            last: self.state,
            performance: self.performance,
        }
    }
}

fn record_violations(recorder: &mut dyn Recorder, finding: &StepFinding<'_>) -> Result<(), RecordError> {
    for violation in finding.began {
        recorder.event(&Event::ViolationBegan { pair: violation.pair, time_s: violation.from_s })?;
    }
    for violation in finding.ended {
        let &Violation { pair, to_s, min_m, .. } = violation;
        recorder.event(&Event::ViolationEnded { pair, time_s: to_s, min_m })?;
    }
    Ok(())
}
