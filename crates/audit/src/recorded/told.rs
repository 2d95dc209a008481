//! What a recording itself says of the time between its instants.

use super::outcome::{Told, ToldViolation};
use super::settings::{Motion, Settings};
use crate::error::Limits;
use crate::outcome::{Approach, ObjectPair, Undecided, Violation};
use crate::results::{KEPT, Results};
use crate::sweep::Interval;
use tautline_core::swarm::{ClosestApproach, Pair};

/// Relative rounding of a distance that was computed again.
const ROUNDING: f64 = 1e-9;
/// Share of a limit by which a straight line may be off from what was told of the same instant and count as the same.
const SAME: f64 = 1e-3;

/// What is known of a vehicle that is judged.
#[derive(Clone, Copy, Debug)]
pub(super) struct Counted {
    pub(super) radius_m: f64,
    /// What is added to its times \[s\].
    pub(super) offset_s: f64,
}

/// Everything that was told, in order of time.
#[derive(Clone, Debug, Default)]
pub(super) struct AllTold {
    closest: Vec<Told>,
    violations: Vec<ToldViolation>,
}

/// What is asked of the time that was told of. Distances were told in metres and are judged in lengths over half axes.
struct Question<F> {
    counts: F,
    window: Interval,
    limits: Limits,
    above_m: Option<f64>,
    /// Longest and shortest half axis \[m\]; 1 where there is no ellipsoid, or what was told was scaled.
    longest_m: f64,
    shortest_m: f64,
    /// Whether what is drawn is all that is known between two instants: no bound on how far from it anybody was.
    is_drawn: bool,
}

/// What is asked of a pair, and how what was told of a time of it bears on that.
struct Asked {
    pair: ObjectPair,
    limit: f64,
    /// The part that is asked about, by the clock that is judged by.
    over: Interval,
    /// What is added to times by the clock of the recording \[s\]; none where that is not the same of both.
    later_s: Option<f64>,
    /// Whether all of what was told is asked about.
    is_whole: bool,
    /// Whether one of the two was above the ground at every instant around.
    is_above: bool,
}

impl<F: Fn(usize) -> Option<Counted>> Question<F> {
    fn new(settings: &Settings, counts: F) -> Self {
        let axes = settings.ellipsoid_m.filter(|_| !settings.is_told_scaled);
        let (longest_m, shortest_m) = axes.map_or((1.0, 1.0), |axes| (axes.max(), axes.min()));
        let (window, limits, above_m) = (settings.window(), settings.limits(), settings.above_m);
        let is_drawn = settings.motion != Some(Motion::Bounded);
        Self { counts, window, limits, above_m, longest_m, shortest_m, is_drawn }
    }

    /// The offset of a pair's clocks \[s\], where it is the same.
    fn later_s(&self, pair: Pair) -> Option<f64> {
        let [first, second] = [pair.first(), pair.second()].map(|of| (self.counts)(of).map(|of| of.offset_s));
        first.filter(|first| second == Some(*first))
    }

    /// What is asked of a time between two vehicles, the higher of which was between two heights; `None` where nothing is.
    fn of(&self, pair: Pair, [from_s, to_s]: [f64; 2], [low_m, high_m]: [f64; 2]) -> Option<Asked> {
        let (first, second) = ((self.counts)(pair.first())?, (self.counts)(pair.second())?);
        let limit = self.limits.of_vehicles(first.radius_m, second.radius_m);
        let (early_s, late_s) = (first.offset_s.min(second.offset_s), first.offset_s.max(second.offset_s));
        let all = Interval { from_s: from_s + early_s, to_s: to_s + late_s };
        let over = Interval { from_s: all.from_s.max(self.window.from_s), to_s: all.to_s.min(self.window.to_s) };
        let is_asked = over.from_s <= over.to_s && self.above_m.is_none_or(|above_m| high_m > above_m);
        is_asked.then(|| Asked {
            pair: ObjectPair::Vehicles(pair),
            limit,
            over,
            later_s: (early_s == late_s).then_some(early_s),
            is_whole: over.from_s == all.from_s && over.to_s == all.to_s,
            is_above: self.above_m.is_none_or(|above_m| low_m > above_m),
        })
    }

    /// Whether what was told is unlike what is drawn of the same instant, which nobody can go by then.
    fn contradicts(&self, told: &Told, limit: f64) -> bool {
        self.is_drawn && (told.drawn_m - told.closest.separation_m).abs() > SAME * limit * self.shortest_m
    }

    /// What a distance in metres is at least and at most, as it is judged.
    fn scaled(&self, least_m: f64, most_m: f64) -> (f64, f64) {
        (least_m / self.longest_m, most_m / self.shortest_m)
    }
}

impl Asked {
    /// Nobody knows more of the two, over the time that is asked about, than that they were at least so far apart.
    fn leave_open(&self, lower_m: f64, upper_m: f64, results: &mut Results) {
        if lower_m < self.limit {
            let (Interval { from_s, to_s }, limit_m, rate_hz) = (self.over, self.limit, None);
            results.ledger.undecided(Undecided { pair: self.pair, from_s, to_s, lower_m, upper_m, limit_m, rate_hz });
        }
    }

    /// They were below the limit over a time, and so close at an instant of it.
    fn violate(&self, over: Interval, min_m: f64, min_at_s: f64, results: &mut Results) {
        let (Interval { from_s, to_s }, limit_m) = (over, self.limit);
        let violation = Violation { pair: self.pair, from_s, to_s, min_m, min_at_s, limit_m };
        results.ledger.violated(violation, false);
    }
}

impl AllTold {
    pub(super) fn push(&mut self, told: Told) {
        self.closest.push(told);
    }

    pub(super) fn push_violation(&mut self, told: ToldViolation) {
        self.violations.push(told);
    }

    /// What says that drawn between two instants they come closer than anybody did, in metres. What is so at an instant itself
    /// no word of the recording takes back.
    fn refuter(&self, pair: ObjectPair, [from_s, to_s]: [f64; 2], later_s: f64, drawn_m: f64) -> Option<&Told> {
        let rounding_s = if later_s == 0.0 { 0.0 } else { 8.0 * f64::EPSILON * (from_s.abs() + later_s.abs()) };
        let (from_s, to_s) = (from_s - later_s - rounding_s, to_s - later_s + rounding_s);
        let within = self.closest.get(self.closest.partition_point(|told| told.to_s <= to_s));
        let refutes = |told: &Told| told.from_s < from_s && drawn_m < told.closest.separation_m * (1.0 - ROUNDING);
        within.filter(|told| pair.vehicles().is_some() && refutes(told))
    }

    /// The first of these that were drawn, the closest first, that nobody refutes; where all are, a bound from what was told.
    pub(super) fn nearest_of(
        &self,
        drawn: &[Approach],
        settings: &Settings,
        counts: impl Fn(usize) -> Option<Counted>,
    ) -> Option<Approach> {
        let first = drawn.first()?;
        if self.closest.is_empty() {
            return Some(*first);
        }
        let question = Question::new(settings, counts);
        let refuter = |of: &Approach| {
            let later_s = question.later_s(of.pair.vehicles()?)?;
            self.refuter(of.pair, [of.time_s; 2], later_s, of.lower_m * question.longest_m)
        };
        let bound = |told: &Told| {
            let (lower_m, _) = question.scaled(told.closest.separation_m, 0.0);
            Approach { lower_m, upper_m: f64::INFINITY, ..*first }
        };
        drawn.iter().copied().find(|of| refuter(of).is_none()).or_else(|| refuter(first).map(bound))
    }

    /// The closest of a pair that was told within a time, and when that was: known where they were the closest of all.
    fn nearest(&self, pair: Pair, from_s: f64, to_s: f64) -> Option<(f64, f64)> {
        let known = self.closest.iter().map(|told| told.closest);
        let known = known.filter(|at| at.pair == pair && from_s <= at.time_s && at.time_s <= to_s);
        known.map(|at| (at.separation_m, at.time_s)).min_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// Puts what was told in the place of what was drawn: leaves out what nobody did, enters who came closest of those that
    /// are asked for, in the time that is asked for, and leaves open what neither says. Whether all that is open is listed.
    pub(super) fn correct(
        &self,
        results: &mut Results,
        settings: &Settings,
        vehicles: usize,
        counts: impl Fn(usize) -> Option<Counted>,
    ) -> bool {
        let question = Question::new(settings, counts);
        let refuted = |pair: ObjectPair, span_s, drawn: f64| {
            let later_s = pair.vehicles().and_then(|pair| question.later_s(pair));
            later_s.is_some_and(|later_s| self.refuter(pair, span_s, later_s, drawn * question.longest_m).is_some())
        };
        results.closest.retain(|kept| !refuted(kept.pair, [kept.time_s; 2], kept.lower_m));
        results.ledger.violations.retain(|v| !refuted(v.pair, [v.from_s, v.to_s], v.min_m));
        for told in &self.violations {
            let Some(asked) = question.of(told.pair, [told.from_s, told.to_s], told.height_m) else { continue };
            let (lower_m, upper_m) = question.scaled(told.least_m, told.min_m);
            match asked.later_s {
                Some(later_s) if asked.is_above => self.enter(told, &asked, later_s, &question, results),
                Some(_) => asked.leave_open(lower_m, upper_m, results),
                None if question.is_drawn => asked.leave_open(0.0, f64::INFINITY, results),
                None => {}
            }
        }
        let told_too = |told: &Told| {
            let (pair, time_s) = (told.closest.pair, told.closest.time_s);
            self.violations.iter().any(|v| v.pair == pair && v.from_s <= time_s && time_s <= v.to_s)
        };
        for told in self.closest.iter().filter(|told| !told_too(told)) {
            Self::enter_closest(told, &question, results);
        }
        self.leave_others_open(vehicles, &question, results)
    }

    /// Leaves open what lines say of other pairs where they are unlike what was told of one; of the first pairs, if many, and
    /// not beside a violation. Whether all that is open is listed.
    fn leave_others_open<F: Fn(usize) -> Option<Counted>>(
        &self,
        vehicles: usize,
        question: &Question<F>,
        results: &mut Results,
    ) -> bool {
        let counted: Vec<_> = (0..vehicles).filter_map(&question.counts).collect();
        let radii = || counted.iter().map(|of| of.radius_m);
        let (small_m, large_m) = (radii().fold(f64::INFINITY, f64::min), radii().fold(0.0, f64::max));
        let [smallest, largest] = [small_m, large_m].map(|radius_m| question.limits.of_vehicles(radius_m, radius_m));
        let one_clock = counted.windows(2).all(|pair| pair[0].offset_s == pair[1].offset_s);
        let least = |told: &Told| question.scaled(told.closest.separation_m.max(told.others_m), 0.0).0;
        let is_odd = |told: &&Told| question.contradicts(told, smallest) && !(one_clock && least(told) >= largest);
        let odd: Vec<_> = self.closest.iter().filter(is_odd).collect();
        if odd.is_empty() || !results.ledger.violations.is_empty() {
            return odd.is_empty();
        }
        let pairs = (0..vehicles).flat_map(|i| (i + 1..vehicles).map(move |j| Pair::new(i, j)));
        let mut left_open = 0;
        for pair in pairs {
            if results.interruption.is_set() {
                return false;
            }
            let open = odd.iter().filter_map(|told| {
                let asked = question.of(pair, [told.from_s, told.to_s], [f64::INFINITY; 2])?;
                let lower = if asked.later_s.is_some() { least(told) } else { 0.0 };
                // At a sample alone it is known where they are.
                let at_ends = |later_s: f64| [told.from_s + later_s, told.to_s + later_s].contains(&asked.over.from_s);
                let is_sample = asked.over.from_s == asked.over.to_s && asked.later_s.is_some_and(at_ends);
                (!is_sample && lower < asked.limit && question.contradicts(told, asked.limit)).then_some((asked, lower))
            });
            let open: Vec<_> = open.collect();
            for (asked, lower) in &open {
                asked.leave_open(*lower, f64::INFINITY, results);
            }
            left_open += usize::from(!open.is_empty());
            if left_open == KEPT {
                return false;
            }
        }
        true
    }

    /// Enters the closest approach of all between two instants. Where its bounds say less than a straight line that agrees
    /// with it, the line stays.
    fn enter_closest<F: Fn(usize) -> Option<Counted>>(told: &Told, question: &Question<F>, results: &mut Results) {
        let ClosestApproach { pair, separation_m, time_s: at_s } = told.closest;
        let Some(around) = question.of(pair, [told.from_s, told.to_s], told.height_m) else { return };
        let agrees = !question.contradicts(told, around.limit);
        let (lower_m, upper_m) = question.scaled(separation_m, separation_m);
        let Some(later_s) = around.later_s.filter(|_| around.is_above) else {
            let (lower_m, upper_m) = if around.later_s.is_some() { (lower_m, upper_m) } else { (0.0, f64::INFINITY) };
            if !agrees {
                around.leave_open(lower_m, upper_m, results);
            }
            return;
        };
        let Some(asked) = question.of(pair, [at_s; 2], told.height_m) else { return };
        if lower_m < upper_m && agrees {
            return;
        }
        let (pair, limit_m, time_s) = (asked.pair, asked.limit, at_s + later_s);
        results.enter(Approach { pair, lower_m, upper_m, time_s, limit_m });
        if upper_m < limit_m {
            asked.violate(asked.over, upper_m, time_s, results);
        } else {
            around.leave_open(lower_m, upper_m, results);
        }
    }

    /// Enters the part of a told violation that is asked about. All along it the two were nearer than the limit of the
    /// recording; how near is known for the whole, and for a part where they were closest in it, or the closest of all.
    fn enter<F: Fn(usize) -> Option<Counted>>(
        &self,
        told: &ToldViolation,
        asked: &Asked,
        later_s: f64,
        question: &Question<F>,
        results: &mut Results,
    ) {
        let Asked { pair, limit: limit_m, over: Interval { from_s, to_s }, is_whole, .. } = *asked;
        let (lower_m, of_all_m) = question.scaled(told.least_m, told.min_m);
        let below_m = told.limit_m / question.shortest_m;
        let within = |at_s: &f64| (from_s..=to_s).contains(at_s);
        let deepest_s = told.min_at_s.map(|at_s| at_s + later_s).filter(within);
        let seen = self.nearest(told.pair, from_s - later_s, to_s - later_s);
        let seen = seen.map(|(seen_m, at_s)| (seen_m / question.shortest_m, at_s + later_s));
        let drawn = results.ledger.violations.iter().filter(|v| v.pair == pair && within(&v.min_at_s));
        let drawn = drawn.map(|v| (v.min_m, v.min_at_s)).min_by(|a, b| a.0.total_cmp(&b.0));
        let deepest_s = deepest_s.or(seen.filter(|(seen_m, _)| is_whole && *seen_m <= of_all_m).map(|(_, at_s)| at_s));
        let all_along_m = below_m.next_down();
        let (upper_m, time_s) = match deepest_s {
            Some(at_s) => (of_all_m, at_s),
            None if is_whole => (of_all_m, drawn.map_or(to_s, |(_, at_s)| at_s)),
            None => seen.or(drawn).map_or((all_along_m, from_s), |(near_m, at_s)| (near_m.min(all_along_m), at_s)),
        };
        results.closest.offer(Approach { pair, lower_m, upper_m, time_s, limit_m });
        // Where it is not told when they were as near as that, it is known in the end.
        let known_s = if deepest_s.is_none() && is_whole { to_s } else { time_s };
        results.told.push(Approach { pair, lower_m, upper_m, time_s: known_s, limit_m });
        if limit_m >= below_m {
            // What is drawn of the same time is a part of the same violation.
            let (mut from_s, mut to_s) = (from_s, to_s);
            results.ledger.violations.retain(|v| {
                let is_other = v.pair != pair || v.to_s < from_s || to_s < v.from_s;
                if !is_other && limit_m > below_m {
                    (from_s, to_s) = (from_s.min(v.from_s), to_s.max(v.to_s));
                }
                is_other
            });
            asked.violate(Interval { from_s, to_s }, upper_m, time_s, results);
        } else if upper_m < limit_m {
            // Below a smaller limit they were at one instant for certain, and nothing is told of when they went below it.
            asked.violate(Interval { from_s: time_s, to_s: time_s }, upper_m, time_s, results);
        } else {
            asked.leave_open(lower_m, upper_m, results);
        }
    }
}
