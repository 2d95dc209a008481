//! Search for the sequence of wishes and winds with the largest tracking error.
//!
//! An evolution: each generation changes the worst plans so far in times, directions and winds. It flies the changed
//! plans and keeps the worst of each line of descent. Every number comes from a seed, and a generation is drawn before
//! it flies: the result is the same on any number of threads.

use nalgebra::Vector3;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng as _, SeedableRng as _};
use rayon::prelude::*;

use super::identify::{COAST, DURATION_S, Flown};
use crate::scenario::{Space, unit};
use tautline_laws::wind::{Gust, WindSpec};

/// Number of generations.
pub(super) const GENERATIONS: u64 = 40;
/// Number of plans in a generation.
const CHILDREN: usize = 32;
/// Number of flights with changed plans in one search.
pub(super) const CHANGED_FLIGHTS: u64 = GENERATIONS * CHILDREN as u64;
/// Number of plans of one line of descent that are kept.
const KEPT_OF_LINE: usize = 2;
/// Number of plans that are kept.
const KEPT: usize = 10;
/// Largest number of legs of a plan.
const MOST_LEGS: usize = 400;
/// Shortest leg \[s\].
const SHORTEST_S: f64 = 0.01;
/// Rise time of a change of the wind \[s\].
const RISE_S: f64 = 0.05;

/// Wish and wind until a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Leg {
    /// End of the leg \[s\].
    pub(super) until_s: f64,
    /// Direction of full acceleration; zero brakes.
    pub(super) wish: Vector3<f64>,
    /// Wind as a share of its bound, at most 1 long.
    pub(super) wind: Vector3<f64>,
}

/// Legs in order of time, to the end of a flight.
pub(super) type Plan = Vec<Leg>;

/// Plan with its flight.
#[derive(Clone, Debug)]
struct Candidate {
    plan: Plan,
    /// First plan of its line of descent.
    line: usize,
    error_m: f64,
    at_s: f64,
}

/// Random numbers from a seed.
pub(super) struct Numbers(ChaCha8Rng);

impl Numbers {
    pub(super) fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    /// Returns a number of a range.
    pub(super) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * unit(&mut self.0)
    }

    /// Returns an index below `count`.
    fn index(&mut self, count: usize) -> usize {
        #[expect(clippy::cast_possible_truncation, reason = "below count")]
        let index = (self.0.next_u64() % count.max(1) as u64) as usize;
        index
    }

    /// Returns a direction of the space of the references.
    pub(super) fn direction(&mut self, space: Space) -> Vector3<f64> {
        let z = if space == Space::Plane { 0.0 } else { self.between(-1.0, 1.0) };
        let along = Vector3::new(self.between(-1.0, 1.0), self.between(-1.0, 1.0), z);
        along.try_normalize(1e-3).unwrap_or(Vector3::x())
    }

    /// Returns a wind as a share of its bound.
    fn wind(&mut self) -> Vector3<f64> {
        if self.between(0.0, 1.0) < 0.1 { Vector3::zeros() } else { self.direction(Space::Volume) }
    }
}

/// Returns the wind of a plan with this bound \[m/s\]. Each change is a gust without an end. Changes that overlap stay
/// within the bound, since their sum is a mean of the winds of the legs.
pub(super) fn wind_of(plan: &[Leg], wind_m_s: f64) -> WindSpec {
    let first = plan.first().map_or_else(Vector3::zeros, |leg| leg.wind);
    let changes = plan.windows(2).filter(|pair| pair[0].wind != pair[1].wind);
    let gusts = changes.map(|pair| Gust {
        at_s: pair[0].until_s,
        rise_s: RISE_S,
        hold_s: 2.0 * DURATION_S,
        fall_s: None,
        velocity_m_s: (pair[1].wind - pair[0].wind) * wind_m_s,
        vehicles: None,
    });
    WindSpec { mean_m_s: first * wind_m_s, gusts: gusts.collect(), ..WindSpec::default() }
}

/// Flies these plans and `generations` of changed ones. `fly` flies a plan; `take` gets each flight in order, with the
/// index of the plan from which it descends and its generation.
pub(super) fn search(
    seeds: &[Plan],
    generations: u64,
    (space, has_wind): (Space, bool),
    fly: &(dyn Fn(&[Leg]) -> Flown + Sync),
    mut take: impl FnMut(Flown, usize, u64),
) {
    let mut kept: Vec<Candidate> = Vec::new();
    let mut next: Vec<(Plan, usize)> = seeds.iter().cloned().zip(0..).collect();
    for generation in 0..=generations {
        let flown: Vec<_> = next.par_iter().map(|(plan, _)| fly(plan)).collect();
        for ((plan, line), flown) in next.drain(..).zip(flown) {
            kept.push(Candidate { plan, line, error_m: flown.error_m, at_s: flown.at_s });
            take(flown, line, generation);
        }
        if kept.is_empty() || kept.iter().any(|candidate| candidate.error_m.is_nan()) {
            return;
        }
        kept.sort_by(|a, b| b.error_m.total_cmp(&a.error_m));
        let mut counts = Vec::new();
        kept.retain(|candidate| {
            counts.push(candidate.line);
            counts.iter().filter(|line| **line == candidate.line).count() <= KEPT_OF_LINE
        });
        kept.truncate(KEPT);
        let mut numbers = Numbers::new(generation);
        next = (0..CHILDREN)
            .map(|child| {
                let parent = &kept[child % kept.len()];
                let mut plan = parent.plan.clone();
                for _ in 0..=numbers.index(3) {
                    change(&mut plan, parent.at_s, &kept, &mut numbers, (space, has_wind));
                }
                (plan, parent.line)
            })
            .collect();
    }
}

/// Changes a plan at random, mostly before the time of its largest error.
fn change(plan: &mut Plan, at_s: f64, kept: &[Candidate], numbers: &mut Numbers, (space, has_wind): (Space, bool)) {
    let before = plan.iter().position(|leg| leg.until_s >= at_s).map_or(plan.len(), |leg| leg + 1);
    let leg = numbers.index(before);
    match numbers.index(if has_wind { 12 } else { 8 }) {
        // Stretches all times.
        0 => {
            let factor = 1.0 + numbers.between(-0.15, 0.15);
            for leg in plan.iter_mut() {
                leg.until_s *= factor;
            }
        }
        // Moves the end of a leg, alone or with all later ones.
        1 | 2 => {
            let shift_s = numbers.between(-1.0, 1.0) * numbers.between(0.0, 0.6);
            let count = if numbers.index(2) == 0 { 1 } else { plan.len() };
            plan[leg..].iter_mut().take(count).for_each(|leg| leg.until_s += shift_s);
        }
        // Replaces the wish of a leg.
        3 => {
            plan[leg].wish = match numbers.index(6) {
                0 => Vector3::zeros(),
                1 => COAST,
                2 | 3 => -plan[leg].wish,
                _ => numbers.direction(space),
            };
        }
        // Turns the wish of a leg, alone or with all later ones.
        4 => {
            let by = numbers.direction(space) * numbers.between(0.0, 0.6);
            let count = if numbers.index(2) == 0 { 1 } else { plan.len() };
            for leg in plan[leg..].iter_mut().take(count).filter(|leg| leg.wish.norm() > 0.5) {
                leg.wish = (leg.wish + by).try_normalize(1e-3).unwrap_or(leg.wish);
            }
        }
        // Reflects all directions.
        5 => {
            let normal = numbers.direction(space);
            let reflected = |along: Vector3<f64>| along - normal * (2.0 * along.dot(&normal));
            for leg in plan.iter_mut() {
                leg.wind = reflected(leg.wind);
                if leg.wish != COAST {
                    leg.wish = reflected(leg.wish);
                }
            }
        }
        // Removes or adds a leg.
        6 => {
            if numbers.index(2) == 0 && plan.len() > 1 {
                plan.remove(leg);
            } else if plan.len() < MOST_LEGS {
                let from_s = leg.checked_sub(1).map_or(0.0, |before| plan[before].until_s);
                let until_s = numbers.between(from_s, plan[leg].until_s);
                let wish = if numbers.index(2) == 0 { -plan[leg].wish } else { numbers.direction(space) };
                plan.insert(leg, Leg { until_s, wish, ..plan[leg] });
            }
        }
        // Appends the end of another plan.
        7 => {
            let other = &kept[numbers.index(kept.len())];
            let cut_s = numbers.between(0.0, at_s.max(0.1));
            let shift_s = numbers.between(-1.0, 1.0);
            plan.retain(|leg| leg.until_s < cut_s);
            plan.extend(other.plan.iter().map(|leg| Leg { until_s: leg.until_s + shift_s, ..*leg }));
        }
        // Replaces the wind of a leg or of all later ones, or turns it around.
        8 => plan[leg].wind = numbers.wind(),
        9 => {
            let wind = numbers.wind();
            plan[leg..].iter_mut().for_each(|leg| leg.wind = wind);
        }
        10 => plan[leg..].iter_mut().for_each(|leg| leg.wind = -leg.wind),
        // Turns the wind along or against the wishes.
        _ => {
            let sign = if numbers.index(2) == 0 { 1.0 } else { -1.0 };
            plan.iter_mut().filter(|leg| leg.wish.norm() > 0.5).for_each(|leg| leg.wind = leg.wish * sign);
        }
    }
    tidy(plan);
}

/// Puts the ends of legs in order, removes legs that are too short, and extends the last to the end.
pub(super) fn tidy(plan: &mut Plan) {
    let mut from_s = 0.0;
    plan.retain(|leg| {
        let is_long = leg.until_s >= from_s + SHORTEST_S && from_s < DURATION_S;
        if is_long {
            from_s = leg.until_s;
        }
        is_long
    });
    plan.truncate(MOST_LEGS);
    if plan.is_empty() {
        plan.push(Leg { until_s: DURATION_S, wish: Vector3::x(), wind: Vector3::zeros() });
    }
    if let Some(last) = plan.last_mut() {
        last.until_s = last.until_s.max(DURATION_S);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn leg(until_s: f64, wish: Vector3<f64>, wind: Vector3<f64>) -> Leg {
        Leg { until_s, wish, wind }
    }

    /// Largest where the first leg ends at 1.234 s, the second wish points along -y and the wind against x.
    fn error_m(plan: &[Leg]) -> Flown {
        let off = (plan[0].until_s - 1.234).abs();
        let wish = plan.get(1).map_or(0.0, |leg| -leg.wish.y);
        let error_m = 1.0 / (1.0 + off) + wish - plan[0].wind.x;
        Flown { error_m, at_s: 8.0, ..Flown::default() }
    }

    #[test]
    fn a_search_approaches_the_largest_error_and_repeats_its_flights() {
        let still = Vector3::zeros();
        let seeds = [vec![leg(3.0, Vector3::x(), still), leg(DURATION_S, Vector3::x(), still)]];
        let errors = || {
            let mut errors = Vec::new();
            let seen = &mut errors;
            search(&seeds, GENERATIONS, (Space::Volume, true), &error_m, |flown, line, generation| {
                seen.push((flown.error_m, line, generation));
            });
            errors
        };
        let found = errors();
        let count = 1 + usize::try_from(GENERATIONS).expect("a count") * CHILDREN;
        assert_eq!((found.len(), found.clone()), (count, errors()));
        let largest_m = found.iter().map(|(error_m, ..)| *error_m).fold(0.0, f64::max);
        assert!(found[0].0 < 0.4 && largest_m > 2.4, "{} to {largest_m} of 3", found[0].0);
    }

    #[test]
    fn a_wind_that_changes_at_short_intervals_stays_within_its_bound() {
        let mut numbers = Numbers::new(1);
        let plan: Plan =
            (1..200).map(|k| leg(0.02 * f64::from(k), Vector3::x(), numbers.direction(Space::Volume))).collect();
        let wind = wind_of(&plan, 2.0);
        let speeds = (0..5000).map(|k| wind.steady_m_s(0, 0.001 * f64::from(k)).norm());
        let fastest_m_s = speeds.fold(0.0, f64::max);
        assert!((1.5..=2.0 + 1e-9).contains(&fastest_m_s), "{fastest_m_s} m/s");
    }

    #[test]
    fn legs_are_in_order_and_reach_the_end() {
        let wish = Vector3::x();
        let mut plan = vec![leg(2.0, wish, wish), leg(1.0, wish, wish), leg(2.005, wish, wish), leg(30.0, wish, wish)];
        tidy(&mut plan);
        assert_eq!(plan.iter().map(|leg| leg.until_s).collect::<Vec<_>>(), [2.0, 30.0]);
        let mut none = vec![leg(-1.0, wish, wish)];
        tidy(&mut none);
        assert_eq!(none.len(), 1);
    }
}
