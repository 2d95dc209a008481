//! Measurement of the tracking error of a quadrotor: one vehicle flies references of a shield that are hard to follow.
//!
//! References use the limits of the shield: its largest acceleration, speed and brake. The first are steps with a brake
//! from full speed, reversals over a ladder of periods, random ones, and two made for the vehicle:
//!
//! - *matched*: the response of the error to a pulse of one period is measured. A dynamic programme finds the sequence
//!   within the limits of acceleration and speed that makes the largest error of a linear vehicle with this response.
//! - *chase*: at each instant the reference accelerates away from the vehicle.
//!
//! They fly in still air and in the fastest wind of the scenario. [`search`] then changes times, directions
//! and winds of the worst, on all axes together. Errors of measurement are at their bounds. The result is the largest
//! error that the search found. It is not proved.

use std::fmt;

use nalgebra::Vector3;
use serde::Serialize;

use super::search::{self, GENERATIONS, Leg, Numbers, Plan};
use super::{ShieldSpec, refused};
use crate::link;
use crate::plant::{self, StepPath};
use crate::scenario::{ErrorKind, Scenario, ScenarioError, Space};
use crate::vehicle::{Model, Tracking, TrackingSearch};
use tautline_core::record::Channel;
use tautline_core::swarm::{Rows, Swarm, row, set_row};
use tautline_core::text::significant;
use tautline_laws::wind::WindSpec;
use tautline_shield::{Limits, Shield, State};

/// Recommended tracking error over the largest measured one.
pub const TRACKING_FACTOR: f64 = 1.25;
/// Reserved feedback over the largest measured feedback.
const FEEDBACK_FACTOR: f64 = 1.25;
/// Duration of a measurement \[s\].
pub(super) const DURATION_S: f64 = 16.0;
/// Duration of the response to a pulse \[s\].
const RESPONSE_S: f64 = 8.0;
/// Times between reversals \[s\], and the factors of the worst that are flown as well.
const REVERSALS_S: [f64; 12] = [0.01, 0.02, 0.05, 0.1, 0.2, 0.35, 0.5, 0.7, 1.0, 1.4, 2.0, 3.0];
const REFINED: [f64; 4] = [0.8, 0.9, 1.1, 1.2];
/// Time before the largest error in still air at which a wind turns around \[s\].
const TURNED_S: f64 = 1.5;
/// Number of random sequences.
const RANDOM: usize = 16;
/// Largest number of measurements. Each uses the push that the feedback of the previous one requires.
const ROUNDS: usize = 5;
/// Share of commands that the first measurement leaves to the tracker.
const FIRST_SHARE: f64 = 0.6;
/// Smallest used share of the reserved feedback; below it the reference gets more acceleration.
const NOT_TIGHT: f64 = 0.85;
/// Push with which the slope of the feedback is computed \[m/s^2\].
const TRIAL_M_S2: f64 = 1e-3;
/// Cosine between wishes of a chase that count as the same.
const SAME_DIRECTION: f64 = 0.99;
/// Distance to the reference from which the vehicle is lost \[m\].
const LOST_M: f64 = 2.0;
/// Wind at a time \[s\], with the wish of the law.
type Wind<'a> = &'a dyn Fn(f64, Vector3<f64>) -> Vector3<f64>;
/// Bound on the memory of the search for the worst sequence, as speeds times periods.
const MOST_CHOICES: f64 = 4e6;
/// Wish of nearly no acceleration; zero brakes.
pub(super) const COAST: Vector3<f64> = Vector3::new(1e-300, 0.0, 0.0);

/// Measured tracking error of the vehicles of a scenario.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Identification {
    /// Name of the model.
    pub model: String,
    /// Largest measured distance to the reference \[m\].
    pub largest_error_m: f64,
    /// Time of the largest distance \[s\].
    pub at_s: f64,
    /// Commands and wind that show the largest distance.
    pub sequence: String,
    /// Recommended `tracking_error_m` over `largest_error_m`.
    pub factor: f64,
    /// Largest acceleration of the reference \[m/s^2\].
    pub reference_m_s2: f64,
    /// Largest measured feedback of the tracker \[m/s^2\].
    pub largest_feedback_m_s2: f64,
    /// Largest command \[m/s^2\].
    pub largest_command_m_s2: f64,
    /// Largest thrust of a rotor over its limit.
    pub thrust_share: f64,
    /// Number of flights.
    pub flights: usize,
    /// Recommended assumption with its conditions.
    pub tracking: Tracking,
}

/// Sequence of wishes, in order of time.
#[derive(Clone, Debug)]
enum Wishes {
    /// Direction of full acceleration until a time \[s\]; zero brakes.
    Until(Vec<(f64, Vector3<f64>)>),
    /// Away from the vehicle, along the error plus this time \[s\] times its rate; first along a direction.
    Chase(Vector3<f64>, f64),
}

/// Result of a flight.
#[derive(Clone, Debug, Default)]
pub(super) struct Flown {
    pub(super) error_m: f64,
    pub(super) at_s: f64,
    pub(super) feedback_m_s2: f64,
    pub(super) command_m_s2: f64,
    pub(super) thrust_share: f64,
    /// Wish at each instant of a chase.
    pub(super) wishes: Vec<(f64, Vector3<f64>)>,
    /// Signed error along the direction at each instant \[m\].
    pub(super) errors_m: Vec<f64>,
}

impl Wishes {
    /// Returns the wish at a time \[s\], longer than any limit; NaN brakes.
    fn at(&self, time_s: f64, away_m: Vector3<f64>, away_m_s: Vector3<f64>) -> Vector3<f64> {
        const FULL_M_S2: f64 = 1e3;
        let along = match self {
            Self::Until(list) => {
                list.iter().find(|(until_s, _)| time_s < *until_s - 1e-9).map_or(Vector3::zeros(), |(_, along)| *along)
            }
            Self::Chase(first, rate_s) if time_s < 0.5 => *first * rate_s.signum(),
            Self::Chase(first, rate_s) => (away_m + away_m_s * *rate_s).try_normalize(1e-9).unwrap_or(*first),
        };
        if along == Vector3::zeros() { Vector3::repeat(f64::NAN) } else { along * FULL_M_S2 }
    }
}

impl Scenario {
    /// Measures the tracking error of the scenario's quadrotors under its shield. Without a given push, the push is
    /// chosen so that the shield leaves enough of its largest command to the tracker.
    ///
    /// # Errors
    /// [`ScenarioError`] without quadrotors or shield, or if the tracker does not hold the vehicle on its reference.
    pub fn identify(&self) -> Result<Identification, ScenarioError> {
        let Some(quadrotor) = self.airframe.quadrotor() else {
            let problem = "only the tracking error of quadrotors is measured";
            let help = "points have a computed bound; set vehicle.model to a quadrotor";
            return Err(ErrorKind::Shield.at(&["vehicle.model"], problem, help));
        };
        let Some(given) = self.shield else {
            let problem = "there is no shield whose tracking error could be measured";
            return Err(ErrorKind::Shield.at(&["vehicle.model"], problem, "add [shield]"));
        };
        let mut alone = self.alone();
        let mut spec = alone.shield_keys().unwrap_or(given);
        // Limits of the reference do not depend on it.
        spec.tracking_error_m = Some(1.0);
        let wind_m_s = rounded_up(self.fastest_wind_m_s());
        let is_free = given.disturbance_m_s2.is_none();
        let mut share = FIRST_SHARE;
        let (flown, limits) = 'rounds: {
            for round in 1..=ROUNDS {
                if is_free {
                    spec.disturbance_m_s2 = Some(push_for(&alone, spec, share)?);
                }
                alone.shield = Some(spec);
                let limits = alone.limits_alone()?;
                let room_m_s2 = limits.tube().feedback_m_s2;
                let is_enough = |flown: &Measured| {
                    !flown.is_lost() && (!is_free || room_m_s2 >= FEEDBACK_FACTOR * flown.feedback_m_s2)
                };
                let mut flown = measure(&alone, &limits, wind_m_s, 0);
                let is_tight = room_m_s2 <= FEEDBACK_FACTOR * flown.feedback_m_s2 / NOT_TIGHT || round > 2;
                if is_enough(&flown) && (!is_free || is_tight) {
                    // Commands beyond the largest one are refused below.
                    let is_refused = flown.command_m_s2 > limits.settings().accel_m_s2;
                    if !is_refused {
                        flown = measure(&alone, &limits, wind_m_s, GENERATIONS);
                    }
                    if is_enough(&flown) {
                        break 'rounds (flown, limits);
                    }
                }
                let is_held = !flown.is_lost();
                let needed_m_s2 = FEEDBACK_FACTOR * flown.feedback_m_s2;
                if !is_free {
                    break;
                }
                // Feedback is nearly proportional to the acceleration of the reference.
                let ratio = needed_m_s2 / limits.reference_m_s2();
                share = if is_held { (1.02 * ratio / (1.0 + ratio)).min(0.98) } else { 0.5 * (1.0 + share) };
            }
            let keys = ["shield.tracker_per_s2", "shield.tracker_per_s", "shield.accel_m_s2"];
            let problem = "the tracker does not hold the vehicle on its reference";
            let help = "lower shield.tracker_per_s2, shield.tracker_per_s, shield.accel_m_s2 or the wind";
            return Err(ErrorKind::Shield.at(&keys, problem, help));
        };
        let settings = limits.settings();
        if flown.command_m_s2 > settings.accel_m_s2 {
            let help = "raise shield.disturbance_m_s2, or leave it out";
            let problem = "the tracker commands more than shield.accel_m_s2, up to";
            let keys = ["shield.disturbance_m_s2", "shield.accel_m_s2"];
            return Err(refused(&keys, problem, flown.command_m_s2, help));
        }
        let largest_error_m = (flown.worst.error_m * 1e4).ceil() / 1e4;
        let search = TrackingSearch {
            flights: flown.flights as u64,
            largest_error_m,
            margin: TRACKING_FACTOR,
            dimensions: vec![alone.space.dimensions()],
            model: String::new(),
        };
        let mut tracking = Tracking {
            error_m: rounded_up(TRACKING_FACTOR * largest_error_m),
            search: alone.has_engine().then_some(search),
            accel_m_s2: settings.accel_m_s2,
            disturbance_m_s2: spec.disturbance_m_s2.unwrap_or(0.0),
            max_speed_m_s: settings.max_speed_m_s,
            tracker_per_s2: settings.tracker_per_s2,
            tracker_per_s: settings.tracker_per_s,
            control_hz: alone.time.control_hz.unwrap_or_default(),
            attitude_hz: quadrotor.attitude_hz,
            dt_s: alone.time.dt_s,
            wind_m_s,
            position_error_m: settings.position_error_m,
            velocity_error_m_s: settings.velocity_error_m_s,
        };
        let fingerprint = Model { tracking: Some(tracking.clone()), ..quadrotor.model.clone() }.fingerprint();
        if let Some(search) = &mut tracking.search {
            search.model = fingerprint;
        }
        Ok(Identification {
            model: quadrotor.model.name.clone(),
            largest_error_m: flown.worst.error_m,
            at_s: flown.worst.at_s,
            sequence: flown.sequence,
            factor: TRACKING_FACTOR,
            reference_m_s2: limits.reference_m_s2(),
            largest_feedback_m_s2: flown.feedback_m_s2,
            largest_command_m_s2: flown.command_m_s2,
            thrust_share: flown.thrust_share,
            flights: flown.flights,
            tracking,
        })
    }

    fn limits_alone(&self) -> Result<Limits, ScenarioError> {
        self.shield_limits()?.ok_or_else(|| ErrorKind::Shield.at(&[], "there is no shield", "add [shield]"))
    }

    /// Returns the scenario with one vehicle at rest at the origin, in still air, without errors and other bodies.
    fn alone(&self) -> Self {
        let mut alone = self.clone();
        alone.start = Swarm::at_rest(Rows::zeros(1));
        alone.mass_kg.truncate(1);
        alone.hull_radius_m.truncate(1);
        alone.obstacles.clear();
        alone.failures.clear();
        alone.wind = WindSpec::default();
        alone
    }
}

/// Returns the push for which the shield leaves a share of its commands to the tracker \[m/s^2\].
fn push_for(alone: &Scenario, spec: ShieldSpec, share: f64) -> Result<f64, ScenarioError> {
    let error_at = |push_m_s2: f64| -> Result<_, ScenarioError> {
        let spec = ShieldSpec { disturbance_m_s2: Some(push_m_s2), ..spec };
        let limits = Scenario { shield: Some(spec), ..alone.clone() }.limits_alone()?;
        Ok((limits.tube().feedback_m_s2, limits.reference_m_s2()))
    };
    // The bound on the feedback is affine in the push.
    let (least_m_s2, left_m_s2) = error_at(0.0)?;
    let slope = (error_at(TRIAL_M_S2)?.0 - least_m_s2) / TRIAL_M_S2;
    Ok(rounded_up(((least_m_s2 + left_m_s2) * share - least_m_s2).max(0.0) / slope))
}

/// Rounds up to three decimals.
fn rounded_up(value: f64) -> f64 {
    (value * 1e3).ceil() / 1e3
}

/// Returns the whole part of a positive number.
fn whole(value: f64) -> usize {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "positive; more saturates")]
    let whole = value as usize;
    whole
}

/// Extremes of all flights.
#[derive(Default)]
struct Measured {
    worst: Flown,
    sequence: String,
    feedback_m_s2: f64,
    command_m_s2: f64,
    thrust_share: f64,
    flights: usize,
}

impl Measured {
    /// Returns whether a flight lost its reference.
    fn is_lost(&self) -> bool {
        self.worst.error_m.is_nan() || self.worst.error_m > LOST_M
    }

    fn add(&mut self, flown: Flown, name: impl FnOnce() -> String) {
        self.flights += 1;
        self.feedback_m_s2 = self.feedback_m_s2.max(flown.feedback_m_s2);
        self.command_m_s2 = self.command_m_s2.max(flown.command_m_s2);
        self.thrust_share = self.thrust_share.max(flown.thrust_share);
        // A distance that is no number is the largest.
        if self.flights == 1 || flown.error_m.is_nan() || flown.error_m > self.worst.error_m {
            self.sequence = name();
            self.worst = flown;
        }
    }
}

/// Flies all courses, then a search of some generations from the worst of each direction.
fn measure(alone: &Scenario, limits: &Limits, wind_m_s: f64, generations: u64) -> Measured {
    let mut measured = Measured::default();
    let mut seeds: Vec<(String, Plan)> = Vec::new();
    let period_s = limits.settings().period_s;
    for (direction, along) in directions(alone.space) {
        let flown = |(name, wishes): (String, Wishes)| {
            let flown = fly(alone, limits, along, &wishes, DURATION_S);
            (flown, name, wishes)
        };
        let reversed = REVERSALS_S.map(|half_s| (half_s, flown(reversals(direction, along, half_s))));
        let worst = reversed.iter().max_by(|(_, a), (_, b)| a.0.error_m.total_cmp(&b.0.error_m));
        let worst_s = worst.map_or(1.0, |(half_s, _)| *half_s);
        let refined = REFINED.map(|factor| flown(reversals(direction, along, factor * worst_s)));
        let others =
            courses(direction, along).into_iter().chain([matched(alone, limits, (direction, along), period_s)]);
        let mut still: Vec<_> =
            others.map(flown).chain(reversed.into_iter().map(|(_, flown)| flown)).chain(refined).collect();
        still.sort_by(|(a, ..), (b, ..)| b.error_m.total_cmp(&a.error_m));
        for (flown, name, wishes) in still.iter().take(2) {
            seeds.extend(in_winds(name, &plan(wishes, flown), (along, flown.at_s), wind_m_s > 0.0));
        }
        for (flown, name, _) in still {
            measured.add(flown, || name);
        }
        if measured.is_lost() {
            return measured;
        }
    }
    let randoms = (0..RANDOM as u64).map(|seed| (format!("random sequence {seed}"), random(seed, alone.space)));
    seeds.extend(randoms);
    let (names, plans): (Vec<_>, Vec<_>) = seeds.into_iter().unzip();
    let flown = |plan: &[Leg]| {
        let scenario = Scenario { wind: search::wind_of(plan, wind_m_s), ..alone.clone() };
        let along = plan.iter().map(|leg| leg.wish).find(|wish| wish.norm() > 0.5).unwrap_or(Vector3::x());
        let wishes = Wishes::Until(plan.iter().map(|leg| (leg.until_s, leg.wish)).collect());
        fly(&scenario, limits, along, &wishes, DURATION_S)
    };
    search::search(&plans, generations, (alone.space, wind_m_s > 0.0), &flown, |flown, line, generation| {
        measured.add(flown, || match generation {
            0 => names[line].clone(),
            _ => format!("{}, changed by {generation} generations of the search", names[line]),
        });
    });
    measured
}

/// Returns the plan of a flight in still air.
fn plan(wishes: &Wishes, flown: &Flown) -> Plan {
    let wishes = match wishes {
        Wishes::Until(list) => list,
        Wishes::Chase(..) => &flown.wishes,
    };
    let leg = |until_s: f64, wish: Vector3<f64>| Leg { until_s, wish, wind: Vector3::zeros() };
    let mut plan: Plan = wishes.iter().map(|(until_s, wish)| leg(*until_s, *wish)).collect();
    // Without a wish the reference brakes.
    plan.push(leg(DURATION_S, Vector3::zeros()));
    search::tidy(&mut plan);
    plan
}

/// Returns a plan in winds at their bound: constant, turning around before a time \[s\], and turning with the wishes.
fn in_winds(name: &str, plan: &[Leg], (along, at_s): (Vector3<f64>, f64), has_wind: bool) -> Vec<(String, Plan)> {
    let still = (name.to_owned(), plan.to_vec());
    if !has_wind {
        return vec![still];
    }
    let across = if along.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() };
    let across = (across - along * across.dot(&along)).normalize();
    let turns_s = (at_s - TURNED_S).max(0.0);
    let constant = |wind: Vector3<f64>| move |_: f64, _: Vector3<f64>| wind;
    let turning =
        |sign: f64| move |from_s: f64, _: Vector3<f64>| if from_s < turns_s { along * sign } else { along * -sign };
    let with = |sign: f64| move |_: f64, wish: Vector3<f64>| if wish.norm() > 0.5 { wish * sign } else { along * sign };
    let winds: [(&str, Wind<'_>); 7] = [
        ("wind along its axis", &constant(along)),
        ("wind against its axis", &constant(-along)),
        ("wind across its axis", &constant(across)),
        ("wind that turns against its axis", &turning(1.0)),
        ("wind that turns along its axis", &turning(-1.0)),
        ("wind that turns with the reference", &with(1.0)),
        ("wind that turns against the reference", &with(-1.0)),
    ];
    let blown = winds.into_iter().map(|(wind_name, wind)| {
        let mut blown = Plan::new();
        let mut from_s = 0.0;
        for leg in plan {
            if from_s < turns_s && turns_s < leg.until_s {
                blown.push(Leg { until_s: turns_s, wish: leg.wish, wind: wind(from_s, leg.wish) });
                from_s = turns_s;
            }
            blown.push(Leg { wind: wind(from_s, leg.wish), ..*leg });
            from_s = leg.until_s;
        }
        (format!("{name}, {wind_name}"), blown)
    });
    std::iter::once(still).chain(blown).collect()
}

/// Returns the directions of references with their names.
fn directions(space: Space) -> Vec<(&'static str, Vector3<f64>)> {
    let mut all =
        vec![("x", Vector3::x()), ("y", Vector3::y()), ("the diagonal of x and y", Vector3::new(1.0, 1.0, 0.0))];
    if space != Space::Plane {
        all.extend([
            ("z", Vector3::z()),
            ("the diagonal of x and z", Vector3::new(1.0, 0.0, 1.0)),
            ("the diagonal of x, y and z", Vector3::new(1.0, 1.0, 1.0)),
        ]);
    }
    all.into_iter().map(|(name, along)| (name, along.normalize())).collect()
}

/// Returns the sequences of a direction that need no measurement, with their names.
fn courses(direction: &str, along: Vector3<f64>) -> Vec<(String, Wishes)> {
    vec![
        (format!("step along {direction} for 4 s, then brake"), Wishes::Until(vec![(4.0, along)])),
        (format!("step against {direction} for 4 s, then brake"), Wishes::Until(vec![(4.0, -along)])),
        (format!("step along {direction} for 4 s, then reversal"), Wishes::Until(vec![(4.0, along), (8.0, -along)])),
        (format!("chase along {direction}"), Wishes::Chase(along, 0.3)),
        (format!("slow chase along {direction}"), Wishes::Chase(along, 1.0)),
    ]
}

/// Returns the sequence that reverses every `half_s` seconds.
fn reversals(direction: &str, along: Vector3<f64>, half_s: f64) -> (String, Wishes) {
    let sign = |k: usize| if k.is_multiple_of(2) { 1.0 } else { -1.0 };
    let count = whole(DURATION_S / half_s);
    let times_s = (0..=count).map(|k| ((k as f64 + 0.5) * half_s, along * sign(k)));
    let name = format!("reversals along {direction} every {} s", significant(half_s, 3));
    (name, Wishes::Until(times_s.collect()))
}

/// Returns the sequence that makes the largest error of a linear vehicle, from its measured response to a pulse.
fn matched(
    alone: &Scenario,
    limits: &Limits,
    (direction, along): (&str, Vector3<f64>),
    period_s: f64,
) -> (String, Wishes) {
    // The reference goes on without acceleration, so that the error is the response to the pulse alone.
    let pulse = Wishes::Until(vec![(period_s, along), (RESPONSE_S, COAST)]);
    let response_m = fly(alone, limits, along, &pulse, RESPONSE_S).errors_m;
    let speeds = (limits.settings().max_speed_m_s / (limits.reference_m_s2() * period_s))
        .min(MOST_CHOICES / response_m.len() as f64);
    let sides = worst_sides(&response_m, whole(speeds));
    let mut wishes: Vec<_> = sides
        .iter()
        .enumerate()
        .map(|(k, side)| ((k + 1) as f64 * period_s, if *side == 0 { COAST } else { along * f64::from(*side) }))
        .collect();
    wishes.dedup_by(|next, last| {
        let is_same = next.1 == last.1;
        if is_same {
            last.0 = next.0;
        }
        is_same
    });
    (format!("matched to the response along {direction}"), Wishes::Until(wishes))
}

/// Returns the accelerations -1, 0 or 1 of each period whose responses add up to the most at the end. The speed starts
/// at 0 and stays within `most` periods of acceleration: a dynamic programme over the speeds.
fn worst_sides(response_m: &[f64], most: usize) -> Vec<i8> {
    let count = 2 * most + 1;
    // Most that the periods from here on add, by speed.
    let mut best = vec![0.0_f64; count];
    let mut choices = vec![vec![0_i8; count]; response_m.len()];
    // The last period acts through the first number of the response.
    for (choice, added_m) in choices.iter_mut().rev().zip(response_m) {
        let after = best.clone();
        for speed in 0..count {
            let sides = [0_i8, -1, 1].into_iter().filter_map(|side| {
                let next = speed.checked_add_signed(isize::from(side)).filter(|next| *next < count)?;
                Some((side, after[next] + f64::from(side) * added_m))
            });
            let (side, value) =
                sides.fold((0, f64::NEG_INFINITY), |best, next| if next.1 > best.1 { next } else { best });
            (choice[speed], best[speed]) = (side, value);
        }
    }
    let mut speed = most;
    let chosen = choices.iter().map(|choice| {
        let side = choice[speed];
        speed = speed.saturating_add_signed(isize::from(side));
        side
    });
    chosen.collect()
}

/// Returns a random sequence of full accelerations, brakes and winds.
fn random(seed: u64, space: Space) -> Plan {
    let mut numbers = Numbers::new(seed);
    let mut plan = Plan::new();
    let mut until_s = 0.0;
    while until_s < DURATION_S {
        until_s += numbers.between(0.1, 1.5);
        let wish = numbers.direction(space);
        let wish = if numbers.between(0.0, 1.0) < 0.15 { Vector3::zeros() } else { wish };
        let wind = plan.last().map(|leg: &Leg| leg.wind).filter(|_| numbers.between(0.0, 1.0) < 0.7);
        let wind = wind.unwrap_or_else(|| numbers.direction(Space::Volume));
        plan.push(Leg { until_s, wish, wind });
    }
    plan
}

/// Flies a sequence. Errors are measured along a direction.
fn fly(alone: &Scenario, limits: &Limits, along: Vector3<f64>, wishes: &Wishes, duration_s: f64) -> Flown {
    let settings = limits.settings();
    let (dt_s, period_s) = (alone.time.dt_s, settings.period_s);
    let steps = whole((period_s / dt_s).round().max(1.0));
    let start = limits.slot(Vector3::zeros());
    let mut flown = Flown::default();
    let Ok(mut shield) = Shield::new(limits, 0, &[start]) else { return flown };
    let (mut plant, mut actuators) = (plant::of(alone), link::of(alone, false));
    let mut rotors = plant.channels();
    let most_n = alone.airframe.quadrotor().map_or(f64::INFINITY, |quadrotor| quadrotor.model.max_thrust_n);
    let mut state = alone.start.clone();
    plant.observe(&mut state);
    let (mut next, mut path) = (state.clone(), StepPath::default());
    let (mut held, mut acted) = (Rows::zeros(1), Rows::zeros(1));
    let mut past = vec![truth(&state)];
    for instant in 0..whole(duration_s / period_s) {
        let time_s = instant as f64 * period_s;
        let now = truth(&state);
        past.push(now);
        let then = past[past.len() - 1 - settings.measurement_delay_periods.min(past.len() - 1)];
        let reference = shield.next_reference();
        let (away_m, away_m_s) = (reference.position_m - now.position_m, reference.velocity_m_s - now.velocity_m_s);
        let mut wish = wishes.at(time_s, away_m, away_m_s);
        if alone.space == Space::Plane && wish.z.is_finite() {
            wish.z = 0.0;
        }
        if let Wishes::Chase(..) = wishes {
            let away = wish.try_normalize(0.0).filter(|away| away.x.is_finite()).unwrap_or_default();
            match flown.wishes.last_mut() {
                Some((until_s, last)) if last.dot(&away) > SAME_DIRECTION => *until_s = time_s + period_s,
                _ => flown.wishes.push((time_s + period_s, away)),
            }
        }
        // The measurement error points against the wish, so that the feedback adds to the acceleration.
        let side = -wish.try_normalize(0.0).filter(|side| side.x.is_finite()).unwrap_or(along);
        let measured = State {
            position_m: then.position_m + side * settings.position_error_m,
            velocity_m_s: then.velocity_m_s + side * settings.velocity_error_m_s,
        };
        let command = shield.filter(measured, wish);
        let feedback =
            command - shield.reference_acceleration_m_s2() + shield.reference().velocity_m_s * settings.a22_per_s;
        flown.feedback_m_s2 = flown.feedback_m_s2.max(feedback.norm());
        flown.command_m_s2 = flown.command_m_s2.max(command.norm());
        set_row(&mut held, 0, command);
        for step in 0..steps {
            acted.copy_from(&held);
            actuators.actuate(time_s + step as f64 * dt_s, &mut acted);
            plant.apply(&acted, &mut state);
            path.begin();
            if plant.advance(dt_s, &mut next, &mut path).is_err() {
                flown.error_m = f64::NAN;
                return flown;
            }
            std::mem::swap(&mut state, &mut next);
            let since_s = (step + 1) as f64 * dt_s;
            let reference = shield.reference().after(shield.reference_acceleration_m_s2(), since_s);
            let error = reference.position_m - row(&state.positions_m, 0);
            if error.norm().is_nan() || error.norm() > flown.error_m {
                (flown.error_m, flown.at_s) = (error.norm(), time_s + since_s);
                if flown.error_m > LOST_M {
                    return flown;
                }
            }
            plant.write_channels(&mut rotors);
            flown.thrust_share = flown.thrust_share.max(largest_thrust_n(&rotors) / most_n);
            if step + 1 == steps {
                flown.errors_m.push(error.dot(&along));
            }
        }
        plant.apply(&acted, &mut state);
    }
    flown
}

fn truth(state: &Swarm) -> State {
    State { position_m: row(&state.positions_m, 0), velocity_m_s: row(&state.velocities_m_s, 0) }
}

fn largest_thrust_n(channels: &[Channel]) -> f64 {
    let rotors = channels.iter().find(|channel| *channel.name == *"rotors");
    rotors.map_or(0.0, |rotors| rotors.values.iter().fold(0.0, |most: f64, thrust_n| most.max(*thrust_n)))
}

impl fmt::Display for Identification {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let tracking = &self.tracking;
        let number = |value: f64| significant(value, 3);
        writeln!(
            out,
            "measured     {}: at most {} m from its reference in {} flights",
            self.model,
            number(self.largest_error_m),
            self.flights
        )?;
        writeln!(out, "worst        {}, at {} s", self.sequence, number(self.at_s))?;
        writeln!(
            out,
            "commands     up to {} m/s^2 of {}, feedback up to {}, reference up to {}; rotor thrust up to {} % of \
             the maximum",
            number(self.largest_command_m_s2),
            tracking.accel_m_s2,
            number(self.largest_feedback_m_s2),
            number(self.reference_m_s2),
            (100.0 * self.thrust_share).round()
        )?;
        write!(
            out,
            "recommended  tracking_error_m = {}, {} times the largest error. This bound is measured; each flight \
             checks it at each step.",
            tracking.error_m, self.factor
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::Source;

    fn crazyflies() -> (Scenario, Limits, Tracking) {
        let source = Source::Builtin("shielded-crazyflies".to_owned());
        let scenario = Scenario::read(&source, &[]).expect("a built-in");
        let tracking =
            scenario.airframe.quadrotor().and_then(|quadrotor| quadrotor.model.tracking.clone()).expect("a table");
        let limits = scenario.limits_alone().expect("limits");
        (scenario.alone(), limits, tracking)
    }

    #[test]
    fn the_worst_sequence_of_the_table_repeats_its_error() {
        let (alone, limits, tracking) = crazyflies();
        let along = Vector3::y();
        let (_, wishes) = reversals("y", along, 1.54);
        let wind = WindSpec { mean_m_s: along * -tracking.wind_m_s, ..WindSpec::default() };
        let flown = fly(&Scenario { wind, ..alone }, &limits, along, &wishes, DURATION_S);
        let share = TRACKING_FACTOR * flown.error_m / tracking.error_m;
        // The table was measured in space.
        assert!((0.93..1.0).contains(&share), "{share} of the table");
        assert!(flown.command_m_s2 < tracking.accel_m_s2, "{}", flown.command_m_s2);
        assert!((0.5..1.0).contains(&flown.thrust_share), "{}", flown.thrust_share);
    }

    #[test]
    fn the_matched_sequence_is_worse_than_a_step_and_within_the_table() {
        let (alone, limits, tracking) = crazyflies();
        let along = Vector3::x();
        let [(_, step), ..] = &courses("x", along)[..] else { panic!("courses") };
        let step = fly(&alone, &limits, along, step, DURATION_S);
        let (_, matched) = matched(&alone, &limits, ("x", along), limits.settings().period_s);
        let flown = fly(&alone, &limits, along, &matched, DURATION_S);
        assert!(flown.error_m > 1.2 * step.error_m, "{} {}", flown.error_m, step.error_m);
        assert!(flown.error_m < tracking.error_m, "{}", flown.error_m);
    }

    #[test]
    fn the_worst_sequence_of_a_response_respects_the_speed() {
        // Without a limit of speed, the signs of the response in reverse.
        assert_eq!(worst_sides(&[1.0, -2.0, 3.0], 5), [1, -1, 1]);
        // With one period of acceleration to full speed, no two accelerations in a row to the same side.
        assert_eq!(worst_sides(&[3.0, 1.0, -1.0, -2.0], 5), [-1, -1, 1, 1]);
        assert_eq!(worst_sides(&[3.0, 1.0, -1.0, -2.0], 1), [-1, 0, 1, 1]);
    }

    #[test]
    fn a_tracker_that_loses_the_vehicle_is_refused() {
        let (alone, ..) = crazyflies();
        let gains = ShieldSpec { tracker_per_s2: Some(30.0), tracker_per_s: Some(12.0), ..ShieldSpec::default() };
        let fast = ShieldSpec { disturbance_m_s2: Some(0.1), ..gains };
        let error = Scenario { shield: Some(fast), ..alone.clone() }.identify().expect_err("lost");
        assert!(error.to_string().contains("does not hold the vehicle"), "{error}");
        let no_room = ShieldSpec { disturbance_m_s2: Some(0.0), ..ShieldSpec::default() };
        let error = Scenario { shield: Some(no_room), ..alone.clone() }.identify().expect_err("no room");
        assert!(error.to_string().contains("commands more than shield.accel_m_s2"), "{error}");
        let points = Scenario { airframe: crate::vehicle::Airframe::Point, ..alone };
        assert!(points.identify().expect_err("points").to_string().contains("only the tracking error of quadrotors"));
    }
}
