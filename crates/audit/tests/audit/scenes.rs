//! Random recordings compared with a brute-force computation.
//!
//! The reference shares no code with the audit. It checks every pair at every sample time of either vehicle, with
//! straight lines in between. It uses doubles, and exact fractions of the same doubles where a separation is close to
//! delta.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Vector3;
use tautline_audit::Status;
use tautline_audit::recorded::{ObjectPair, Outcome, Settings, audit};
use tautline_core::swarm::Pair;
use tautline_core::track::{Item, Sample};

use crate::fractions::{Fraction, exact};

/// Number of scenes by default and with `TAUTLINE_LONG=1`; `TAUTLINE_SCENES` overrides both.
const SCENES: u64 = 3000;
const LONG_SCENES: u64 = 20_000;
/// One scene in this many spans several windows.
const LONG_EVERY: u64 = 100;
const DELTA_M: f64 = 2.0;
/// Rounding of the closed form relative to the largest distance: 4 eps for one step, and 4 eps for displacements at
/// different sample times.
const ROUNDING: f64 = 8.0 * f64::EPSILON;
/// Relative difference of distances above which a pair is swept again.
const TIE: f64 = 1e-12;
/// Distance from delta below which exact fractions are used; larger than rounding and than every generated graze.
const NEAR_M: f64 = 1e-4;

/// `SplitMix64` (Steele, Lea, Flood 2014): the same scenes on every machine.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    pub(crate) fn below(&mut self, limit: u64) -> u64 {
        self.bits() % limit
    }

    fn index(&mut self, length: usize) -> usize {
        usize::try_from(self.below(length as u64)).expect("below a length")
    }

    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * ((self.bits() >> 11) as f64 / (1_u64 << 53) as f64)
    }

    fn vector(&mut self, size: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.between(-size, size))
    }
}

/// Samples of each vehicle.
pub(crate) type Tracks = Vec<Vec<(f64, Vector3<f64>)>>;

/// Returns a random scene. The kinds cover cases that once failed.
pub(crate) fn scene(number: u64) -> Tracks {
    let mut random = Random(number);
    let long = number.is_multiple_of(LONG_EVERY);
    let vehicles = 2 + random.below(29);
    let instants = if long { 60 + random.below(60) } else { 1 + random.below(5) };
    let size_m = if random.below(2) == 0 { 12.0 } else { 40.0 };
    let far = !long && random.below(16) == 0;
    let origin_m = if far { random.vector(1e7) } else { Vector3::zeros() };
    let together = random.below(2) == 0;
    let times: Vec<f64> = (0..instants).map(|k| k as f64 * 0.5).collect();
    let mut tracks: Tracks = (0..vehicles)
        .map(|_| {
            let kind = random.below(8);
            let start = random.vector(size_m);
            let velocity = random.vector(size_m);
            let mut own = times.clone();
            if !together {
                // Individual clock shifts, some of them equal.
                let shift = [0.0, 0.25, random.between(0.0, 0.5)][random.index(3)];
                for time_s in &mut own {
                    *time_s += shift;
                }
            }
            if kind == 0 {
                // Late, early, or a single sample.
                own.drain(..random.index(own.len()));
                own.truncate(1 + random.index(own.len()));
            }
            let at = |time_s: f64, random: &mut Random| match kind {
                1 => start,
                2 => random.vector(size_m),
                _ => start + velocity * time_s + random.vector(0.1),
            };
            own.into_iter().map(|time_s| (time_s, origin_m + at(time_s, &mut random))).collect()
        })
        .collect();
    match random.below(3) {
        0 => graze(&mut tracks, origin_m, &mut random),
        1 if tracks.len() > 2 => {
            let same = tracks[0].clone();
            tracks[1] = same;
        }
        _ => {}
    }
    tracks
}

/// Makes the first two vehicles pass each other at delta (1 +- 1e-6 ... 1e-12), in any direction.
fn graze(tracks: &mut Tracks, origin_m: Vector3<f64>, random: &mut Random) {
    let exponent = 6 + i32::try_from(random.below(7)).expect("small");
    let sign = if random.below(2) == 0 { 1.0 } else { -1.0 };
    let miss_m = DELTA_M * (1.0 + sign * 10_f64.powi(-exponent));
    let along = random.vector(1.0).try_normalize(1e-3).unwrap_or(Vector3::x());
    let aside = along.cross(&random.vector(1.0)).try_normalize(1e-3).unwrap_or(along.yzx());
    let aside = (aside - along * aside.dot(&along)).normalize();
    let (before, after) = (random.between(1.0, 9.0), random.between(1.0, 9.0));
    let middle = origin_m + random.vector(5.0);
    tracks[0] = vec![(0.0, middle + along * before), (1.0, middle - along * after)];
    tracks[1] = vec![(0.0, middle + aside * miss_m - along * before), (1.0, middle + aside * miss_m + along * after)];
}

pub(crate) fn items(tracks: &Tracks) -> Vec<Item> {
    let mut items: Vec<_> = tracks
        .iter()
        .enumerate()
        .flat_map(|(vehicle, track)| {
            track.iter().map(move |&(time_s, position_m)| {
                Item::Sample(Sample { vehicle, time_s, position_m, velocity_m_s: None, radius_m: None })
            })
        })
        .collect();
    items.sort_by(|a, b| a.time_s().total_cmp(&b.time_s()));
    items
}

/// Result of brute force for a pair.
#[derive(Clone, Copy, Debug)]
struct Expected {
    min_m: f64,
    /// Whether the separation is exactly below delta.
    violates: bool,
    /// Largest distance, which scales the rounding.
    scale_m: f64,
    /// Smallest distance at a common sample time.
    sampled_m: f64,
}

/// Returns the sample times of either vehicle while both are present.
pub(crate) fn instants(a: &[(f64, Vector3<f64>)], b: &[(f64, Vector3<f64>)]) -> Vec<f64> {
    let (from_s, to_s) = (a[0].0.max(b[0].0), a[a.len() - 1].0.min(b[b.len() - 1].0));
    let mut times: Vec<f64> =
        a.iter().chain(b).map(|seen| seen.0).filter(|time_s| from_s <= *time_s && *time_s <= to_s).collect();
    times.sort_by(f64::total_cmp);
    times.dedup();
    times
}

pub(crate) fn place(track: &[(f64, Vector3<f64>)], time_s: f64) -> Vector3<f64> {
    let next = track.partition_point(|seen| seen.0 < time_s);
    if track[next].0 == time_s {
        return track[next].1;
    }
    let ((t0, p0), (t1, p1)) = (track[next - 1], track[next]);
    p0 + (p1 - p0) * ((time_s - t0) / (t1 - t0))
}

pub(crate) fn exact_place(track: &[(f64, Vector3<f64>)], time_s: f64) -> [Fraction; 3] {
    let next = track.partition_point(|seen| seen.0 < time_s);
    let fraction = |axis: usize| exact(track[next].1[axis]);
    if track[next].0 == time_s {
        return [0, 1, 2].map(fraction);
    }
    let ((t0, p0), (t1, p1)) = (track[next - 1], track[next]);
    let share = (exact(time_s) - exact(t0)) / (exact(t1) - exact(t0));
    [0, 1, 2].map(|axis| exact(p0[axis]) + (exact(p1[axis]) - exact(p0[axis])) * &share)
}

/// Returns the exact square of the smallest distance between two instants.
pub(crate) fn exact_squared(from: &[Fraction; 3], to: &[Fraction; 3]) -> Fraction {
    let dot = |a: &[Fraction; 3], b: &[Fraction; 3]| &a[0] * &b[0] + &a[1] * &b[1] + &a[2] * &b[2];
    let by = [0, 1, 2].map(|axis| &to[axis] - &from[axis]);
    let zero = exact(0.0);
    let (towards, beyond, length) = (dot(from, &by), dot(to, &by), dot(&by, &by));
    if towards >= zero || beyond <= zero {
        return dot(from, from).min(dot(to, to));
    }
    dot(from, from) - &towards * &towards / length
}

/// Returns the smallest distance of two straight motions in doubles.
fn distance_in_doubles(from: Vector3<f64>, to: Vector3<f64>) -> f64 {
    let by = to - from;
    let length = by.norm_squared();
    let at = if length > 0.0 { (-from.dot(&by) / length).clamp(0.0, 1.0) } else { 0.0 };
    (from + by * at).norm()
}

fn brute_force(a: &[(f64, Vector3<f64>)], b: &[(f64, Vector3<f64>)]) -> Option<Expected> {
    let times = instants(a, b);
    let first = *times.first()?;
    let ends: Vec<(f64, f64)> =
        if times.len() == 1 { vec![(first, first)] } else { times.windows(2).map(|t| (t[0], t[1])).collect() };
    let mut answer = Expected { min_m: f64::INFINITY, violates: false, scale_m: 0.0, sampled_m: f64::INFINITY };
    let apart = |time_s: f64| place(b, time_s) - place(a, time_s);
    for (from_s, to_s) in ends {
        let (from, to) = (apart(from_s), apart(to_s));
        let mut min_m = distance_in_doubles(from, to);
        // Interpolated positions far from the origin are as coarse as the coordinates.
        let coarse_m = 8.0 * f64::EPSILON * place(a, from_s).amax();
        if (min_m - DELTA_M).abs() < NEAR_M.max(coarse_m) || coarse_m > 1e-12 {
            let difference = |time_s: f64| {
                let (a, b) = (exact_place(a, time_s), exact_place(b, time_s));
                [0, 1, 2].map(|axis| &b[axis] - &a[axis])
            };
            let squared = exact_squared(&difference(from_s), &difference(to_s));
            let limit = exact(DELTA_M) * exact(DELTA_M);
            // The square root of the quotient keeps a difference from delta in the last digits.
            let over = nearest_double(&((&squared - &limit) / &limit));
            min_m = DELTA_M * (1.0 + over).max(0.0).sqrt();
            answer.violates |= squared < limit;
        } else {
            answer.violates |= min_m < DELTA_M;
        }
        answer.min_m = answer.min_m.min(min_m);
        answer.scale_m = answer.scale_m.max(from.norm()).max(to.norm()).max((to - from).norm());
    }
    let seen = |track: &[(f64, Vector3<f64>)], time_s: f64| track.iter().any(|seen| seen.0 == time_s);
    for &time_s in times.iter().filter(|&&time_s| seen(a, time_s) && seen(b, time_s)) {
        answer.sampled_m = answer.sampled_m.min(apart(time_s).norm());
    }
    Some(answer)
}

/// Returns a double close to a fraction.
fn nearest_double(fraction: &Fraction) -> f64 {
    let (above, below) = (fraction.numer(), fraction.denom());
    let shift = i64::try_from(above.bits()).expect("small") - i64::try_from(below.bits()).expect("small");
    // Scaled so that the integer quotient has about 64 bits.
    let scaled = if shift < 64 { above << u64::try_from(64 - shift).expect("positive") } else { above.clone() };
    let exponent = if shift < 64 { 64 - shift } else { 0 };
    let quotient: f64 = (scaled / below).to_string().parse().expect("a whole number");
    quotient * 2_f64.powi(-i32::try_from(exponent).expect("small"))
}

fn judged(tracks: &Tracks) -> Outcome {
    let names: Vec<String> = (1..=tracks.len()).map(|k| k.to_string()).collect();
    // Scenes have no gaps.
    let settings = Settings { max_gap_s: Some(f64::INFINITY), ..Settings::delta(DELTA_M) };
    audit(&names, &items(tracks), settings).expect("a scene can be judged")
}

/// Compares the audit with brute force; returns whether the samples alone give a wrong verdict.
fn compare(number: u64, tracks: &Tracks) -> bool {
    let outcome = judged(tracks);
    let mut answers: BTreeMap<Pair, Expected> = BTreeMap::new();
    for i in 0..tracks.len() {
        for j in i + 1..tracks.len() {
            answers.extend(brute_force(&tracks[i], &tracks[j]).map(|answer| (Pair::new(i, j), answer)));
        }
    }
    let reported: BTreeSet<Pair> = outcome
        .violations
        .iter()
        .map(|violation| match violation.pair {
            ObjectPair::Vehicles(pair) => pair,
            ObjectPair::Obstacle { .. } => panic!("the scene has no obstacle"),
        })
        .collect();
    let expected_pairs: BTreeSet<Pair> =
        answers.iter().filter(|(_, answer)| answer.violates).map(|(pair, _)| *pair).collect();
    assert_eq!(
        reported,
        expected_pairs,
        "scene {number}: {:?}",
        reported.symmetric_difference(&expected_pairs).map(|p| answers[p]).collect::<Vec<_>>()
    );
    let status = match (answers.is_empty(), expected_pairs.is_empty()) {
        (true, _) => Status::Undecided,
        (false, true) => Status::Clear,
        (false, false) => Status::Violation,
    };
    assert_eq!(outcome.status, status, "scene {number}: {outcome:?}");
    assert_eq!(outcome.parry.disagreements, 0, "scene {number}: {:?}", outcome.parry.first_disagreement);

    let mut smallest: Vec<f64> = answers.values().map(|answer| answer.min_m).collect();
    smallest.sort_by(f64::total_cmp);
    smallest.truncate(10);
    assert_eq!(outcome.closest.len(), smallest.len(), "scene {number}");
    for (approach, min_m) in outcome.closest.iter().zip(smallest) {
        let ObjectPair::Vehicles(pair) = approach.pair else { panic!("the scene has no obstacle") };
        let answer = answers[&pair];
        // The distance is that of the pair, and the list holds the smallest distances.
        let rounding_m = ROUNDING * answer.scale_m + TIE * min_m;
        assert!((approach.lower_m - answer.min_m).abs() <= rounding_m, "scene {number}: {approach:?} {answer:?}");
        assert!((approach.lower_m - min_m).abs() <= rounding_m, "scene {number}: {approach:?}, expected {min_m}");
        let there = place(&tracks[pair.second()], approach.time_s) - place(&tracks[pair.first()], approach.time_s);
        let coarse_m = 1e-9 + 8.0 * f64::EPSILON * tracks[pair.first()][0].1.amax();
        assert!((there.norm() - approach.lower_m).abs() < coarse_m, "scene {number}: {approach:?}");
    }
    let sampled_violation = answers.values().any(|answer| answer.sampled_m < DELTA_M);
    sampled_violation == expected_pairs.is_empty()
}

#[test]
fn random_scenes_match_brute_force() {
    let scenes = if std::env::var_os("TAUTLINE_LONG").is_some() { LONG_SCENES } else { SCENES };
    let scenes = std::env::var("TAUTLINE_SCENES").map_or(scenes, |count| count.parse().expect("a number"));
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let misled: u64 = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..threads as u64)
            .map(|first| {
                scope.spawn(move || {
                    (first..scenes).step_by(threads).filter(|&number| compare(number, &scene(number))).count() as u64
                })
            })
            .collect();
        workers.into_iter().map(|worker| worker.join().expect("every scene agrees")).sum()
    });
    println!("samples alone would have misled on {misled} of {scenes} scenes");
    assert!(misled > scenes / 100, "{misled}");
}

#[test]
fn the_reference_detects_a_wrong_result() {
    let tracks: Tracks = vec![
        vec![(0.0, Vector3::new(-5.0, 0.0, 0.0)), (1.0, Vector3::new(5.0, 0.0, 0.0))],
        vec![(0.0, Vector3::new(5.0, 1.0, 0.0)), (1.0, Vector3::new(-5.0, 1.0, 0.0))],
    ];
    let answer = brute_force(&tracks[0], &tracks[1]).expect("both are present");
    assert!(answer.violates && (answer.min_m - 1.0).abs() < 1e-15 && answer.sampled_m > 10.0);
    assert!(compare(0, &tracks), "the samples miss the violation");
    let mut moved = tracks.clone();
    moved[1][1].1.y = 4.0;
    let (right, wrong) = (judged(&tracks), judged(&moved));
    assert!((right.closest[0].lower_m - wrong.closest[0].lower_m).abs() > 1e-3);
}
