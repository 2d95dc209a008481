//! The shield in flight: filters commands, carries contracts over the radio, observes the bounds.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use nalgebra::Vector3;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::{TrackingBasis, is_whole};
use crate::link::{Radio, RadioUse, Round, period};
use crate::scenario::{Scenario, ScenarioError, Space, random, unit};
use tautline_core::fact::{Fact, FactKind, Source};
use tautline_core::swarm::{Rows, Swarm, first_row_not_finite, row, set_row};
use tautline_laws::law::LawError;
use tautline_shield::report::Exceeded;
use tautline_shield::{Broadcast, ContractLog, Counters, Fleet, Limits, Settings, Shield, State, Timing};

/// Numbers of a shielded flight.
#[derive(Clone, Debug, PartialEq)]
pub struct ShieldReport {
    /// Certificate in words, with its assumptions.
    pub certificate: String,
    /// Facts that the certificate rests on.
    pub facts: Vec<Fact>,
    /// Bound on the distance of a vehicle to its reference \[m\].
    pub tube_m: f64,
    /// Period of the shield \[s\].
    pub period_s: f64,
    /// Numbers of all vehicles together.
    pub counters: Counters,
    /// Worst vehicle for which an assumption did not hold. The certificate does not cover the flight then.
    pub breach: Option<ShieldBreach>,
    /// Number of instants at which the law had no finite command for some vehicle, which braked.
    pub undefined: u64,
    /// Number of those instants at which the law failed or commanded numbers that are not finite: a defect of the law.
    pub failed: u64,
    /// Number of messages of contracts, one for each receiver. Vehicles far from each other send none.
    pub sent: u64,
    /// Number of them that never arrive.
    pub lost: u64,
}

/// Assumption of the shield that did not hold for a vehicle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShieldBreach {
    /// The vehicle, from 0.
    pub vehicle: usize,
    /// The assumption.
    pub exceeded: Exceeded,
}

/// Shields of all vehicles of a flight, with their messages under way.
#[derive(Clone)]
pub(crate) struct ShieldStage {
    fleet: Fleet,
    certificate: String,
    facts: Vec<Fact>,
    period_s: f64,
    /// Whether references stay in the plane z = 0. Quadrotors there hold their height by themselves, up to the sag of
    /// a tilt, and ignore commands along z.
    is_plane: bool,
    /// Messages of each sender.
    radio: Radio<Vec<Broadcast>>,
    /// Rate of messages \[Hz\]; each period unless given.
    rate_hz: Option<f64>,
    /// Next period of the rate of messages.
    next_period: u64,
    /// Hangs of the computers, and the last instant of each vehicle.
    hangs: Hangs,
    /// Age of each measurement \[s\], for shields that predict the state from it.
    age_s: f64,
    /// Whether the shields receive the times of their instants.
    is_timed: bool,
    /// True states at the last instants, oldest first, for measurements of that age.
    truths: VecDeque<Swarm>,
    /// Time from which a vehicle no longer flies its reference \[s\].
    failed_from_s: Vec<f64>,
    measured: Vec<State>,
    wanted: Vec<Vector3<f64>>,
    commands: Vec<Vector3<f64>>,
    /// Number of instants at which the law had no finite command for some vehicle, which braked.
    undefined: u64,
    /// Number of those instants at which the law failed or commanded numbers that are not finite.
    failed: u64,
    log: LogSlot,
}

/// Contract log of a flight, if one is written. A copy of a flight writes none.
#[derive(Default)]
struct LogSlot(Option<Arc<Mutex<ContractLog>>>);

impl LogSlot {
    fn open(&self) -> Option<MutexGuard<'_, ContractLog>> {
        Some(self.0.as_ref()?.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl Clone for LogSlot {
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl ShieldStage {
    /// Returns the shields of a scenario, at its start; `None` without a shield.
    pub(crate) fn of(scenario: &Scenario) -> Result<Option<Self>, ScenarioError> {
        let Some(limits) = scenario.shield_limits()? else { return Ok(None) };
        let (count, basis) = (scenario.count(), scenario.tracking_basis().unwrap_or(TrackingBasis::Assumed));
        let starts: Vec<_> = scenario.shield_starts(&limits)?.iter().map(|start| start.state).collect();
        let fleet = scenario.shield_fleet(&limits, &starts)?;
        let mut failed_from_s = vec![f64::INFINITY; count];
        for failure in scenario.failures.iter().filter(|failure| !failure.is_silent()) {
            failed_from_s[failure.index()] = failed_from_s[failure.index()].min(failure.at_s);
        }
        Ok(Some(Self {
            fleet,
            certificate: basis.certificate(&limits),
            facts: basis.facts(limits.tube().error_m).into_iter().chain(times(&limits)).collect(),
            period_s: limits.settings().period_s,
            is_plane: scenario.space == Space::Plane,
            radio: Radio::new(scenario, count * (count - 1), RadioUse::Contracts),
            rate_hz: scenario.network.rate_hz,
            next_period: 0,
            hangs: Hangs::new(scenario, limits.settings()),
            age_s: limits.settings().measurement_age_s,
            is_timed: times(&limits).next().is_some(),
            truths: VecDeque::new(),
            failed_from_s,
            measured: starts,
            wanted: vec![Vector3::zeros(); count],
            commands: vec![Vector3::zeros(); count],
            undefined: 0,
            failed: 0,
            log: LogSlot::default(),
        }))
    }

    /// Begins a contract log at the start of the flight.
    pub(crate) fn begin_log(&mut self, log: Arc<Mutex<ContractLog>>) {
        self.log = LogSlot(Some(log));
        if let Some(mut log) = self.log.open() {
            log.begin(&self.fleet);
        }
    }

    /// Counts an instant without a finite command of the law for some vehicle. The shield brakes such a vehicle, and
    /// all vehicles where the law is undefined.
    pub(crate) fn note_undefined(&mut self, commanded: Result<(), LawError>, command: &mut Rows) {
        let is_failed = match commanded {
            Ok(()) => first_row_not_finite(command).is_some(),
            Err(error) => {
                self.undefined += u64::from(error != LawError::Failed);
                command.fill(f64::NAN);
                error == LawError::Failed
            }
        };
        self.undefined += u64::from(is_failed);
        self.failed += u64::from(is_failed);
    }

    /// Replaces the law's commands at an instant \[m/s^2\], N x 3, by those of the shields. `own` is the knowledge of
    /// each vehicle of its own state.
    pub(crate) fn filter(&mut self, time_s: f64, truth: &Swarm, own: &Swarm, command: &mut Rows) {
        self.deliver(time_s);
        self.hangs.begin(time_s);
        for i in 0..command.nrows() {
            self.measured[i] = state(own, i);
            self.wanted[i] = row(command, i);
            if self.is_plane && self.wanted[i].z.is_finite() {
                self.wanted[i].z = 0.0;
            }
        }
        self.observe_measurements(time_s, truth);
        let sends = self.has_round(time_s);
        let count = command.nrows();
        let mut round = self.radio.round(|| (0..count).map(|_| Broadcast::for_swarm(count)).collect());
        let Self { fleet, measured, wanted, commands, hangs, age_s, is_timed, period_s, .. } = self;
        each(fleet.shields_mut(), commands, &mut round.content, |i, shield, command, broadcast| {
            match hangs.elapsed[i] {
                // The vehicle holds its command.
                None => broadcast.entries.clear(),
                Some(periods) => {
                    let timing = Timing { elapsed_s: f64::from(periods) * *period_s, age_s: *age_s };
                    *command = if *is_timed {
                        shield.filter_timed(measured[i], wanted[i], timing)
                    } else {
                        shield.filter(measured[i], wanted[i])
                    };
                    if sends {
                        shield.write_broadcast(broadcast);
                    }
                }
            }
        });
        if let Some(mut log) = self.log.open() {
            let heard = self.fleet.shields().iter().zip(&round.content).zip(&self.hangs.elapsed);
            for ((shield, broadcast), _) in heard.filter(|(_, elapsed)| elapsed.is_some()) {
                log.filtered(shield);
                if sends {
                    log.sent(broadcast);
                }
            }
        }
        for (i, shielded) in self.commands.iter().enumerate() {
            set_row(command, i, *shielded);
        }
        if sends {
            self.send(round, time_s, truth);
        } else {
            self.radio.recycle(round);
        }
    }

    /// Compares the measurements with the true states that they measured.
    fn observe_measurements(&mut self, time_s: f64, truth: &Swarm) {
        let settings = self.fleet.shields().first().map(|shield| *shield.limits().settings());
        let delay = settings.map_or(0, |settings| settings.measurement_delay_periods);
        let aged = self.age_s / self.period_s;
        if !is_whole(aged) {
            // No instant has this age.
            return;
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most 20 periods")]
        let delay = delay + aged.round() as usize;
        if self.truths.len() > delay {
            if let Some(mut oldest) = self.truths.pop_front() {
                oldest.copy_from(truth);
                self.truths.push_back(oldest);
            }
        } else {
            self.truths.push_back(truth.clone());
        }
        let Some(then) = self.truths.front().filter(|_| self.truths.len() > delay) else { return };
        for (i, shield) in self.fleet.shields_mut().iter_mut().enumerate() {
            if time_s < self.failed_from_s[i] {
                shield.observe_measurement(&self.measured[i], &state(then, i));
            }
        }
    }

    /// Compares a true state with the references.
    pub(crate) fn observe(&mut self, time_s: f64, truth: &Swarm) {
        for (i, shield) in self.fleet.shields_mut().iter_mut().enumerate() {
            if time_s < self.failed_from_s[i] {
                shield.observe(time_s - self.hangs.last_s[i], &state(truth, i));
            }
        }
    }

    fn deliver(&mut self, time_s: f64) {
        let Self { fleet, radio, log, .. } = self;
        let mut log = log.open();
        radio.deliver(time_s, |round, has_arrived| {
            let messages = round.content.iter().flat_map(Broadcast::messages);
            for (message, _) in messages.zip(has_arrived).filter(|(_, has_arrived)| *has_arrived) {
                fleet.hear(&message);
                if let Some(log) = &mut log {
                    log.heard(&message);
                }
            }
        });
    }

    /// Whether messages are sent at an instant.
    fn has_round(&mut self, time_s: f64) -> bool {
        let period = self.rate_hz.map_or(self.next_period, |rate_hz| period(time_s, rate_hz));
        if period < self.next_period {
            return false;
        }
        // A rate above that of the instants sends one round an instant.
        self.next_period = period + 1;
        true
    }

    /// Sends the messages of an instant.
    fn send(&mut self, mut round: Round<Vec<Broadcast>>, time_s: f64, truth: &Swarm) {
        let count = self.commands.len();
        for (sender, broadcast) in round.content.iter().enumerate() {
            let links = broadcast.entries.iter().map(|entry| {
                let receiver = entry.to as usize;
                (sender * (count - 1) + receiver - usize::from(receiver > sender), receiver)
            });
            self.radio.send((sender, time_s), &truth.positions_m, (links, count - 1), &mut round.arrives_s);
        }
        self.radio.end(round, time_s);
    }

    /// Changes the seed of later messages.
    pub(crate) fn reseed(&mut self, seed: u64) {
        self.radio.reseed(seed);
        self.hangs.reseed(seed);
    }

    /// Returns the numbers of the flight so far.
    pub(crate) fn report(&self) -> ShieldReport {
        let counters = self.fleet.report();
        // A vehicle that fails voids the certificate by itself.
        let flying = self.fleet.shields().iter().enumerate().filter(|(i, _)| self.failed_from_s[*i].is_infinite());
        let breaches = flying.filter_map(|(vehicle, shield)| {
            let exceeded = shield.counters().exceeded()?;
            Some(ShieldBreach { vehicle, exceeded })
        });
        // The worst; the first of equal ones.
        let breach = breaches.fold(None, |worst: Option<ShieldBreach>, one| match worst {
            Some(worst) if worst.exceeded.factor() >= one.exceeded.factor() => Some(worst),
            _ => Some(one),
        });
        let (sent, lost) = self.radio.counts();
        let first = self.fleet.shields().first().map(Shield::limits);
        ShieldReport {
            certificate: self.certificate.clone(),
            facts: self.facts.clone(),
            tube_m: first.map_or(0.0, |limits| limits.tube().error_m),
            period_s: self.period_s,
            counters,
            breach,
            undefined: self.undefined,
            failed: self.failed,
            sent,
            lost,
        }
    }
}

/// Returns the facts on irregular instants and ages of measurements, which the shields observe in flight.
fn times(limits: &Limits) -> impl Iterator<Item = Fact> {
    let [shortest_s, longest_s] = limits.times_s();
    let age_s = limits.settings().measurement_age_s;
    let observed = |kind, seconds| Fact::number(kind, Source::Observed, seconds, "s");
    let period = (shortest_s < longest_s).then(|| observed(FactKind::Period, longest_s));
    period.into_iter().chain((age_s > 0.0).then(|| observed(FactKind::Age, age_s)))
}

/// Stream of the random numbers of hangs, so that they differ from others of the same seed.
const HANG_STREAM: u64 = 0x4841_4E47;

/// Computers that miss instants.
#[derive(Clone)]
struct Hangs {
    random: ChaCha8Rng,
    /// Share of instants after which a vehicle misses some.
    share: f64,
    /// Largest number of missed instants in a row.
    longest: usize,
    /// Number of instants that each vehicle still misses.
    left: Vec<u32>,
    /// Number of instants since the last one that each vehicle did not miss.
    passed: Vec<u32>,
    /// Number of periods since the last instant of each vehicle. `None` if it misses the present one.
    elapsed: Vec<Option<u32>>,
    /// Last instant of each vehicle \[s\].
    last_s: Vec<f64>,
}

impl Hangs {
    fn new(scenario: &Scenario, settings: &Settings) -> Self {
        let count = scenario.count();
        Self {
            random: stream(scenario.noise_seed),
            share: scenario.shield.map_or(0.0, |spec| spec.hang_share),
            longest: settings.hang_periods,
            left: vec![0; count],
            passed: vec![0; count],
            elapsed: vec![None; count],
            last_s: vec![0.0; count],
        }
    }

    /// Changes the seed of later hangs.
    fn reseed(&mut self, seed: u64) {
        self.random = stream(seed);
    }

    /// Begins an instant, and draws the hangs after it.
    fn begin(&mut self, time_s: f64) {
        for i in 0..self.left.len() {
            self.passed[i] += 1;
            self.elapsed[i] = (self.left[i] == 0).then_some(self.passed[i]);
            if self.left[i] > 0 {
                self.left[i] -= 1;
                continue;
            }
            (self.passed[i], self.last_s[i]) = (0, time_s);
            if self.share > 0.0 && unit(&mut self.random) < self.share {
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "below 20")]
                let missed = (unit(&mut self.random) * self.longest as f64) as u32;
                self.left[i] = 1 + missed;
            }
        }
    }
}

fn stream(seed: u64) -> ChaCha8Rng {
    let mut random = random(seed);
    random.set_stream(HANG_STREAM);
    random
}

/// Number of vehicles from which the shields run concurrently. Each works on its own state, so the bits are the same.
const CONCURRENT_FROM: usize = 64;

/// Calls a function for each vehicle, with its shield, its command and its messages.
fn each(
    shields: &mut [Shield],
    commands: &mut [Vector3<f64>],
    broadcasts: &mut [Broadcast],
    work: impl Fn(usize, &mut Shield, &mut Vector3<f64>, &mut Broadcast) + Sync,
) {
    if shields.len() < CONCURRENT_FROM {
        let all = shields.iter_mut().zip(commands).zip(broadcasts).enumerate();
        all.for_each(|(i, ((shield, command), broadcast))| work(i, shield, command, broadcast));
    } else {
        let all = shields.par_iter_mut().zip(commands).zip(broadcasts).enumerate();
        all.for_each(|(i, ((shield, command), broadcast))| work(i, shield, command, broadcast));
    }
}

fn state(swarm: &Swarm, i: usize) -> State {
    State { position_m: row(&swarm.positions_m, i), velocity_m_s: row(&swarm.velocities_m_s, i) }
}
