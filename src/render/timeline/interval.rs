//! Straight flight from one instant to the next: who came how near, and when.

use nalgebra::Vector3;

use super::frame::Keyframe;
use crate::space::closest_pair;
use crate::swarm::{ClosestApproach, Pair, Rows, row};

/// Two instants, between which every vehicle flies on a straight line. One that is only there at the end is judged there.
pub(super) struct Interval<'a> {
    times_s: [f64; 2],
    positions_m: [&'a Rows; 2],
}

/// How one vehicle moves relative to another: `first_m` at the first of two times and longer by `change_m` at the second.
struct PairMotion {
    first_m: Vector3<f64>,
    change_m: Vector3<f64>,
    times_s: [f64; 2],
}

impl<'a> Interval<'a> {
    pub(super) fn between(before: &'a Keyframe, after: &'a Keyframe) -> Self {
        Self { times_s: [before.time_s, after.time_s], positions_m: [&before.positions_m, &after.positions_m] }
    }

    /// Where a vehicle is at both ends, and when it is there first; none where it is not there at the end.
    fn ends(&self, k: usize) -> Option<([Vector3<f64>; 2], f64)> {
        let is_there = |at: &Vector3<f64>| at.iter().all(|x| x.is_finite());
        let second = Some(row(self.positions_m[1], k)).filter(is_there)?;
        let first = Some(row(self.positions_m[0], k)).filter(is_there);
        Some(first.map_or(([second; 2], self.times_s[1]), |first| ([first, second], self.times_s[0])))
    }

    fn motion(&self, pair: Pair) -> Option<PairMotion> {
        let ((from, from_s), (to, to_s)) = (self.ends(pair.first())?, self.ends(pair.second())?);
        let [first_m, second_m] = [0, 1].map(|end| to[end] - from[end]);
        let since_s = from_s.max(to_s);
        let first_m = if since_s < self.times_s[1] { first_m } else { second_m };
        Some(PairMotion { first_m, change_m: second_m - first_m, times_s: [since_s, self.times_s[1]] })
    }

    /// When a pair was nearest, and how near.
    pub(super) fn approach(&self, pair: Pair) -> Option<ClosestApproach> {
        let motion = self.motion(pair)?;
        let squared = motion.change_m.norm_squared();
        let part = if squared > 0.0 { (-motion.first_m.dot(&motion.change_m) / squared).clamp(0.0, 1.0) } else { 0.0 };
        let separation_m = (motion.first_m + motion.change_m * part).norm();
        separation_m.is_finite().then_some(ClosestApproach { pair, separation_m, time_s: motion.time_s(part) })
    }

    /// From when to when a pair was closer than delta \[s\].
    pub(super) fn inside_s(&self, pair: Pair, delta_m: f64) -> Option<[f64; 2]> {
        let motion = self.motion(pair)?;
        // |first + part change|^2 < delta^2, with its two roots.
        let (a, b) = (motion.change_m.norm_squared(), motion.first_m.dot(&motion.change_m));
        let c = motion.first_m.norm_squared() - delta_m * delta_m;
        if a == 0.0 {
            return (c < 0.0).then_some(motion.times_s);
        }
        let root = (b * b - a * c).sqrt();
        let [enters, leaves] = [(-b - root) / a, (-b + root) / a];
        (enters < 1.0 && leaves > 0.0 && enters < leaves).then(|| [enters, leaves].map(|part| motion.time_s(part)))
    }

    /// Every pair that may come within reach, in order: the boxes around their ways do.
    pub(super) fn near(&self, reach_m: f64) -> Vec<Pair> {
        let mut boxes: Vec<(usize, [Vector3<f64>; 2])> = (0..self.positions_m[1].nrows())
            .filter_map(|k| self.ends(k).map(|([first, second], _)| (k, [first.inf(&second), first.sup(&second)])))
            .collect();
        let none = Vector3::repeat(f64::INFINITY);
        let (low, high) =
            boxes.iter().fold((none, -none), |(low, high), (_, [from, to])| (low.inf(from), high.sup(to)));
        // Halves first: the extent of the largest numbers is not a number.
        let axis = (high / 2.0 - low / 2.0).imax();
        boxes.sort_by(|(_, a), (_, b)| a[0][axis].total_cmp(&b[0][axis]));
        let mut pairs = Vec::new();
        for (place, (i, here)) in boxes.iter().enumerate() {
            for (j, there) in
                boxes[place + 1..].iter().take_while(|(_, there)| there[0][axis] - here[1][axis] <= reach_m)
            {
                if (0..3).all(|k| there[0][k] - here[1][k] <= reach_m && here[0][k] - there[1][k] <= reach_m) {
                    pairs.push(Pair::new(*i, *j));
                }
            }
        }
        pairs.sort_unstable();
        pairs
    }
}

impl PairMotion {
    /// The time at a part of the way \[s\]; at either end exactly that of the instant.
    fn time_s(&self, part: f64) -> f64 {
        let [from_s, to_s] = self.times_s;
        if part <= 0.0 {
            from_s
        } else if part >= 1.0 {
            to_s
        } else {
            from_s + (to_s - from_s) * part
        }
    }
}

/// The nearest two of the vehicles that are there, and their distance \[m\].
pub(super) fn nearest_present(positions_m: &Rows) -> Option<(Pair, f64)> {
    let is_there = |i: &usize| row(positions_m, *i).iter().all(|x| x.is_finite());
    let there: Vec<usize> = (0..positions_m.nrows()).filter(is_there).collect();
    let (pair, distance_m) = closest_pair(&positions_m.select_rows(&there))?;
    Some((Pair::new(there[pair.first()], there[pair.second()]), distance_m))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(places: &[[f64; 3]]) -> Rows {
        Rows::from_row_slice(&places.concat())
    }

    #[test]
    fn two_that_pass_through_each_other_met_halfway() {
        let (before, after) = (rows(&[[-2.0, 0.0, 0.0], [2.0, 0.0, 0.0]]), rows(&[[2.0, 0.0, 0.0], [-2.0, 0.0, 0.0]]));
        let interval = Interval { times_s: [0.0, 1.0], positions_m: [&before, &after] };
        let pair = Pair::new(0, 1);
        assert_eq!(interval.approach(pair), Some(ClosestApproach { pair, separation_m: 0.0, time_s: 0.5 }));
        assert_eq!(interval.inside_s(pair, 1.0), Some([0.375, 0.625]));
        assert_eq!(interval.inside_s(pair, 1e3), Some([0.0, 1.0]));
        let away = Interval { times_s: [0.0, 1.0], positions_m: [&before, &before] };
        assert_eq!(away.inside_s(pair, 4.0), None, "at delta is not below it");
        assert_eq!(away.inside_s(pair, 4.1), Some([0.0, 1.0]));
    }

    #[test]
    fn one_that_was_not_there_before_is_judged_from_where_it_appears() {
        let (before, after) = (rows(&[[0.0; 3], [f64::NAN; 3]]), rows(&[[4.0, 0.0, 0.0], [1.0, 0.0, 0.0]]));
        let pair = Pair::new(0, 1);
        let appears = Interval { times_s: [0.0, 1.0], positions_m: [&before, &after] };
        assert_eq!(appears.approach(pair), Some(ClosestApproach { pair, separation_m: 3.0, time_s: 1.0 }));
        assert_eq!(appears.inside_s(pair, 3.5), Some([1.0, 1.0]));
        let leaves = Interval { times_s: [0.0, 1.0], positions_m: [&after, &before] };
        assert_eq!((leaves.approach(pair), leaves.near(100.0)), (None, Vec::new()));
    }

    #[test]
    fn no_pair_that_comes_within_reach_is_left_out() {
        let place = |k: u32, turn: f64| {
            let (sin, cos) = (f64::from(k) * turn).sin_cos();
            [3.0 * sin + 0.1 * f64::from(k), 2.0 * cos, sin * cos]
        };
        let [before, after] = [1.3, 2.9].map(|turn| rows(&(0..40).map(|k| place(k, turn)).collect::<Vec<_>>()));
        let interval = Interval { times_s: [0.0, 1.0], positions_m: [&before, &after] };
        let all = || (0..40).flat_map(|i| (i + 1..40).map(move |j| Pair::new(i, j)));
        let inside = |pair: &Pair| interval.inside_s(*pair, 0.8).is_some();
        let (found, expected): (Vec<_>, Vec<_>) =
            (interval.near(0.8).into_iter().filter(inside).collect(), all().filter(inside).collect());
        assert!(!expected.is_empty());
        assert_eq!(found, expected);
        assert!(interval.near(0.8).len() < all().count());
    }
}
