//! Well clear of air traffic: thresholds on the horizontal distance, the vertical distance and the modified tau.
//!
//! With the horizontal relative position s and velocity v, a pair is not well clear horizontally if one of these holds:
//!
//! - |s| < D,
//! - s . v < 0, the horizontal miss distance |s x v| / |v| is below D, and the modified tau (D^2 - |s|^2) / (s . v) is
//!   below T.
//!
//! A pair is not well clear if it is not well clear horizontally and |z| < Z. D is both DMOD and the threshold HMD* of
//! the miss distance. This is `WCV_TAUMOD` of NASA's DAIDALUS without its vertical time threshold.
//!
//! On straight segments v is constant. With the time t from the closest approach, the miss distance m, and w^2 = (D^2 -
//! m^2) / |v|^2, the first condition is |t| < w. The second is t < 0 and t^2 + T t - w^2 < 0. Both together are the
//! interval from -T/2 - sqrt(T^2/4 + w^2) to w. It is empty if m >= D. All ends are enclosed by interval arithmetic.
//! Times within an enclosure of an end are undecided.

mod enclosed;

use nalgebra::Vector3;

use self::enclosed::Enclosed;
use super::pair_sweep::Overlap;
use super::polynomial::{BernsteinBasis, classify_parts, rescale, value};
use super::segment::Line;

/// Shortest part of an interval on curves, as a fraction of it, to which its ends are narrowed.
const SHORTEST_PART: f64 = 1e-7;
/// Largest number of parts of an interval on curves that are examined.
const MAX_PARTS: usize = 4000;

/// Thresholds of well clear.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WellClear {
    /// Horizontal distance D: DMOD, and threshold of the horizontal miss distance \[m\].
    pub horizontal_m: f64,
    /// Vertical distance Z \[m\].
    pub vertical_m: f64,
    /// Modified tau T \[s\]; 0 leaves out the criterion of time.
    pub tau_s: f64,
}

impl WellClear {
    /// Thresholds of RTCA DO-365 for cooperative traffic en route: 4000 ft, 450 ft, 35 s.
    pub const DO_365: Self = Self { horizontal_m: 4000.0 * FOOT_M, vertical_m: 450.0 * FOOT_M, tau_s: 35.0 };
    /// Thresholds of ASTM F3442 for small aircraft: 2000 ft and 250 ft.
    pub const F3442: Self = Self { horizontal_m: 2000.0 * FOOT_M, vertical_m: 250.0 * FOOT_M, tau_s: 0.0 };
    /// Presets by their names.
    pub const PRESETS: [(&'static str, Self); 2] = [("do-365", Self::DO_365), ("f3442", Self::F3442)];

    /// Returns whether another unit of time changes a loss of well clear.
    #[must_use]
    pub fn rests_on_seconds(self) -> bool {
        let Self { horizontal_m: _, vertical_m: _, tau_s } = self;
        tau_s != 0.0
    }
}

/// Length of an international foot \[m\].
const FOOT_M: f64 = 0.3048;

/// Times at which a pair is not well clear.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Loss {
    /// Start and end \[s\].
    pub(super) span_s: [f64; 2],
    /// Whether the loss is certain. If not, rounding could change the result.
    pub(super) is_certain: bool,
}

/// Condition over a whole interval, or enclosures of the times at which it begins and ends \[s\] from its start.
#[derive(Clone, Copy, Debug)]
enum Condition {
    Always,
    Never,
    Unknown,
    Between(Enclosed, Enclosed),
}

impl WellClear {
    /// Returns the times at which two vehicles are not well clear while they share an interval.
    pub(super) fn losses(&self, overlap: &Overlap<'_>) -> Vec<Loss> {
        if overlap.interval.to_s <= overlap.interval.from_s {
            return Vec::new();
        }
        if overlap.first.curve().is_none() && overlap.second.curve().is_none() {
            self.loss_on_lines(overlap).into_iter().collect()
        } else {
            self.losses_on_curves(overlap)
        }
    }

    fn loss_on_lines(&self, overlap: &Overlap<'_>) -> Option<Loss> {
        let Overlap { first, second, interval } = *overlap;
        let (a, b) = (first.line(), second.line());
        let duration = Enclosed::difference(interval.to_s, interval.from_s);
        let (s_a, v_a) = state(&a, interval.from_s);
        let (s_b, v_b) = state(&b, interval.from_s);
        let is_common = a.to - a.from == b.to - b.from && a.from_s == b.from_s && a.to_s == b.to_s;
        let starts_at_samples = is_common && interval.from_s == a.from_s;
        let s = [0, 1, 2].map(|axis| {
            if starts_at_samples { Enclosed::difference(b.from[axis], a.from[axis]) } else { s_b[axis] - s_a[axis] }
        });
        let v = [0, 1, 2].map(|axis| if is_common { Enclosed::ZERO } else { v_b[axis] - v_a[axis] });
        let elapsed = Enclosed { low: 0.0, high: duration.high };
        let conditions = [self.horizontally(s, v, elapsed), self.vertically(s[2], v[2], elapsed)];
        let (mut from, mut to) = (Enclosed::ZERO, duration);
        let mut is_certain = true;
        for condition in conditions {
            match condition {
                Condition::Always => {}
                Condition::Never => return None,
                Condition::Unknown => is_certain = false,
                Condition::Between(begin, end) => {
                    from = Enclosed { low: from.low.max(begin.low), high: from.high.max(begin.high) };
                    to = Enclosed { low: to.low.min(end.low), high: to.high.min(end.high) };
                }
            }
        }
        if from.low > to.high {
            return None;
        }
        let is_certain = is_certain && from.high < to.low;
        let time_at = |elapsed_s: f64| (interval.from_s + elapsed_s).clamp(interval.from_s, interval.to_s);
        let span_s = if is_certain {
            // An end of the interval is an end of the loss without rounding.
            [
                if from == Enclosed::ZERO { interval.from_s } else { time_at(from.middle()) },
                if to == duration { interval.to_s } else { time_at(to.middle()) },
            ]
        } else {
            [time_at(from.low), time_at(to.high)]
        };
        Some(Loss { span_s, is_certain })
    }

    /// Returns when the horizontal condition holds, for a relative position and a constant relative velocity.
    fn horizontally(&self, s: [Enclosed; 3], v: [Enclosed; 3], elapsed: Enclosed) -> Condition {
        let limit = Enclosed::exactly(self.horizontal_m).squared();
        let speed = v[0].squared() + v[1].squared();
        if speed.low <= 0.0 {
            // The velocity may be 0: the motion during the interval is bounded instead.
            let moved = [0, 1].map(|axis| s[axis] + v[axis] * elapsed);
            return self.over_a_box([moved[0], moved[1]], [v[0], v[1]]);
        }
        let cross = s[0] * v[1] - s[1] * v[0];
        let excess = limit - cross.squared() / speed;
        if excess.high <= 0.0 {
            return Condition::Never;
        }
        let closest = -(s[0] * v[0] + s[1] * v[1]) / speed;
        let half = (excess / speed).root();
        let half_tau = Enclosed::exactly(0.5 * self.tau_s);
        let lead = if self.tau_s > 0.0 { half_tau + (half_tau.squared() + half.squared()).root() } else { half };
        let (begin, end) = (closest - lead, closest + half);
        if excess.low > 0.0 {
            return Condition::Between(begin, end);
        }
        // The miss distance may be that of the threshold: the condition may never hold.
        Condition::Between(Enclosed { high: f64::INFINITY, ..begin }, Enclosed { low: f64::NEG_INFINITY, ..end })
    }

    /// Returns whether the horizontal condition holds for all relative positions and velocities of two intervals.
    fn over_a_box(&self, s: [Enclosed; 2], v: [Enclosed; 2]) -> Condition {
        let limit = Enclosed::exactly(self.horizontal_m).squared();
        let distance = s[0].squared() + s[1].squared();
        if distance.high < limit.low {
            return Condition::Always;
        }
        let speed = v[0].squared() + v[1].squared();
        let rate = s[0] * v[0] + s[1] * v[1];
        let cross = (s[0] * v[1] - s[1] * v[0]).squared();
        let miss = if speed.low > 0.0 { cross / speed } else { Enclosed { low: 0.0, high: distance.high } };
        let tau = distance + Enclosed::exactly(self.tau_s) * rate - limit;
        if self.tau_s > 0.0 && rate.high < 0.0 && miss.high < limit.low && tau.high < 0.0 {
            return Condition::Always;
        }
        let is_in_time = self.tau_s > 0.0 && rate.low < 0.0 && miss.low < limit.high && tau.low < 0.0;
        if distance.low >= limit.high && !is_in_time { Condition::Never } else { Condition::Unknown }
    }

    /// Returns when the vertical condition holds, for a relative height and a constant relative velocity.
    fn vertically(&self, z: Enclosed, v: Enclosed, elapsed: Enclosed) -> Condition {
        let limit = Enclosed::exactly(self.vertical_m);
        if v.has_zero() {
            return self.within_height(z + v * elapsed);
        }
        let ends = [(-limit - z) / v, (limit - z) / v];
        let [begin, end] = if v.low > 0.0 { ends } else { [ends[1], ends[0]] };
        Condition::Between(begin, end)
    }

    fn within_height(&self, z: Enclosed) -> Condition {
        let height = z.absolute();
        match self.vertical_m {
            limit if height.high < limit => Condition::Always,
            limit if height.low >= limit => Condition::Never,
            _ => Condition::Unknown,
        }
    }

    /// Returns the losses where one of the two is on a curve, by bisection of the shared interval.
    fn losses_on_curves(&self, overlap: &Overlap<'_>) -> Vec<Loss> {
        let Overlap { first, second, interval } = *overlap;
        let duration_s = interval.to_s - interval.from_s;
        let r = overlap.relative();
        let rate: Vec<_> = r.iter().enumerate().skip(1).map(|(k, c)| c * (k as f64 / duration_s)).collect();
        let rate = if rate.is_empty() { vec![Vector3::zeros()] } else { rate };
        let rounding = first.rounding() + second.rounding();
        // By Markov's inequality the derivative of a polynomial on a unit interval is at most 2 n^2 times its size.
        let rounding_of_rate = rounding * 2.0 * (r.len() * r.len()) as f64 / duration_s;
        let bases = [&r, &rate].map(|c| BernsteinBasis::of_degree(c.len() - 1));
        let classify = |start: f64, length: f64| {
            let s = components(&r, &bases[0], (start, length), rounding);
            let v = components(&rate, &bases[1], (start, length), rounding_of_rate);
            match (self.over_a_box([s[0], s[1]], [v[0], v[1]]), self.within_height(s[2])) {
                (Condition::Never, _) | (_, Condition::Never) => Some(false),
                (Condition::Always, Condition::Always) => Some(true),
                _ => None,
            }
        };
        let parts = classify_parts(SHORTEST_PART, MAX_PARTS, classify);
        let runs = parts.chunk_by(|a, b| a.2 != Some(false) && b.2 != Some(false));
        let losses = runs.filter_map(|run| {
            let (from, to) = (run.first()?.0, run.last()?.1);
            let is_certain = run.iter().any(|part| part.2 == Some(true));
            let is_open = run.iter().any(|part| part.2 != Some(false));
            is_open.then(|| Loss { span_s: [interval.at(from), interval.at(to)], is_certain })
        });
        losses.collect()
    }

    /// Returns the smallest horizontal and vertical distance within a span \[s\], rounded \[m\].
    pub(super) fn smallest_m(overlap: &Overlap<'_>, [from_s, to_s]: [f64; 2]) -> [f64; 2] {
        let interval = overlap.interval;
        let r = overlap.relative();
        let share = |time_s: f64| ((time_s - interval.from_s) / (interval.to_s - interval.from_s)).clamp(0.0, 1.0);
        let (from, to) = (share(from_s), share(to_s));
        let mut instants = vec![from, to];
        if let [start, by] = r[..] {
            let (s, v) = (start.xy(), by.xy());
            instants.extend([-s.dot(&v) / v.norm_squared(), -start.z / by.z].into_iter().filter(|u| u.is_finite()));
        } else {
            instants.extend((1..32).map(|k| from + (to - from) * f64::from(k) / 32.0));
        }
        let places = instants.into_iter().map(|u| value(&r, u.clamp(from, to)));
        places.fold([f64::INFINITY; 2], |[across, up], r| [across.min(r.xy().norm()), up.min(r.z.abs())])
    }

    /// Returns the horizontal distance beyond which two vehicles with these speeds are well clear \[m\].
    pub(super) fn reach_m(&self, speed_m_s: f64) -> f64 {
        // |s|^2 - D^2 <= -T s . v <= T |s| |v| holds only up to |s| = D + T |v|.
        (self.horizontal_m + self.tau_s * speed_m_s) * (1.0 + MARGIN)
    }
}

/// Relative margin of a bound for rounding.
const MARGIN: f64 = 1e-9;

/// Returns position and velocity of a vehicle on a line at a time.
fn state(line: &Line, time_s: f64) -> ([Enclosed; 3], [Enclosed; 3]) {
    let duration = Enclosed::difference(line.to_s, line.from_s);
    let elapsed = Enclosed::difference(time_s, line.from_s);
    let velocity = [0, 1, 2].map(|axis| Enclosed::difference(line.to[axis], line.from[axis]) / duration);
    let position = [0, 1, 2].map(|axis| Enclosed::exactly(line.from[axis]) + velocity[axis] * elapsed);
    (position, velocity)
}

/// Returns the range of each component of a polynomial over a part of the interval.
fn components(c: &[Vector3<f64>], basis: &BernsteinBasis, (start, length): (f64, f64), rounding: f64) -> [Enclosed; 3] {
    let mut part = c.to_vec();
    rescale(&mut part, start, length);
    let low = basis.points(&part).reduce(|a, b| a.inf(&b)).unwrap_or_default();
    let high = basis.points(&part).reduce(|a, b| a.sup(&b)).unwrap_or_default();
    let size = 4.0 * c.len() as f64 * f64::EPSILON * c.iter().map(Vector3::amax).sum::<f64>();
    [0, 1, 2].map(|axis| Enclosed { low: low[axis], high: high[axis] }.widened(rounding + size))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::segment::{Curve, Deviation, Segment};
    use crate::sweep::Interval;

    const KNOT_M_S: f64 = 1852.0 / 3600.0;
    const MILE_M: f64 = 1852.0;
    /// Thresholds of DAIDALUS for DO-365: 0.66 nautical miles instead of 4000 ft.
    const DAIDALUS: WellClear = WellClear { horizontal_m: 0.66 * MILE_M, ..WellClear::DO_365 };
    const DURATION_S: f64 = 300.0;

    /// Returns a segment from a position along a velocity.
    fn flight(at_m: [f64; 3], velocity_m_s: [f64; 3]) -> Segment {
        let (from, v) = (Vector3::from(at_m), Vector3::from(velocity_m_s));
        Segment::straight(0.0, DURATION_S, from, from + v * DURATION_S)
    }

    fn losses(definition: WellClear, first: &Segment, second: &Segment) -> Vec<Loss> {
        definition.losses(&Overlap { first, second, interval: Interval { from_s: 0.0, to_s: DURATION_S } })
    }

    fn span(definition: WellClear, first: &Segment, second: &Segment) -> Option<[f64; 2]> {
        match losses(definition, first, second)[..] {
            [] => None,
            [Loss { span_s, is_certain: true }] => Some(span_s),
            ref other => panic!("{other:?}"),
        }
    }

    fn assert_span(found: Option<[f64; 2]>, expected: [f64; 2], tolerance_s: f64) {
        let found = found.expect("a loss of well clear");
        for (found, expected) in found.into_iter().zip(expected) {
            assert!((found - expected).abs() < tolerance_s, "{found}, expected {expected}");
        }
    }

    /// Definition of `WCV_TAUMOD`, evaluated at one instant.
    fn is_lost(definition: WellClear, s: Vector3<f64>, v: Vector3<f64>) -> bool {
        let (across, rate) = (s.xy().norm(), s.xy().dot(&v.xy()));
        let cpa = (-rate / v.xy().norm_squared()).max(0.0);
        let miss = (s.xy() + v.xy() * cpa).norm();
        let tau = (definition.horizontal_m * definition.horizontal_m - across * across) / rate;
        let is_timely =
            definition.tau_s > 0.0 && rate < 0.0 && miss < definition.horizontal_m && tau < definition.tau_s;
        (across < definition.horizontal_m || is_timely) && s.z.abs() < definition.vertical_m
    }

    #[test]
    fn random_encounters_agree_with_the_definition_at_sampled_instants() {
        let mut random = Random(7);
        let (mut lost, mut late) = (0, 0);
        for _ in 0..2000 {
            let mut vector =
                |size: f64, height: f64| [random.between(size), random.between(size), random.between(height)];
            let first = flight(vector(9000.0, 200.0), vector(60.0, 2.0));
            let second = flight(vector(9000.0, 200.0), vector(60.0, 2.0));
            let found = span(WellClear::DO_365, &first, &second);
            let v = (second.to - second.from - first.to + first.from) / DURATION_S;
            for k in 0..=600 {
                let t = 0.5 * f64::from(k);
                let s = second.from - first.from + v * t;
                // An instant at an end of the interval is on neither side.
                if found.is_some_and(|ends| ends.iter().any(|end| (end - t).abs() < 1e-6)) {
                    continue;
                }
                let is_inside = found.is_some_and(|[from_s, to_s]| from_s < t && t < to_s);
                assert_eq!(is_lost(WellClear::DO_365, s, v), is_inside, "{first:?} {second:?} at {t}: {found:?}");
                late += u32::from(is_inside && s.xy().norm() > WellClear::DO_365.horizontal_m);
            }
            lost += u32::from(found.is_some());
        }
        assert!(lost > 50 && late > 100, "{lost} {late}");
    }

    /// Linear congruential generator (Knuth, MMIX).
    struct Random(u64);

    impl Random {
        fn between(&mut self, size: f64) -> f64 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            size * (2.0 * ((self.0 >> 11) as f64 / (1_u64 << 53) as f64) - 1.0)
        }
    }

    #[test]
    fn the_criterion_of_time_is_met_far_away_and_not_without_it() {
        // Head-on at 100 m/s: tau is below 35 s long before the distance is below D.
        let (own, intruder) = (flight([0.0; 3], [50.0, 0.0, 0.0]), flight([20_000.0, 0.0, 0.0], [-50.0, 0.0, 0.0]));
        let [from_s, to_s] = span(WellClear::DO_365, &own, &intruder).expect("a loss");
        let apart_m = 20_000.0 - 100.0 * from_s;
        assert!(apart_m > 3.0 * WellClear::DO_365.horizontal_m / 1.5, "{apart_m}");
        assert!((to_s - (200.0 + 12.192)).abs() < 1e-9);
        let without = WellClear { tau_s: 0.0, ..WellClear::DO_365 };
        assert_span(span(without, &own, &intruder), [200.0 - 12.192, 200.0 + 12.192], 1e-9);
        // Past at more than D: never lost, however short tau is. 500 ft above: never lost.
        let aside = flight([20_000.0, 1220.0, 0.0], [-50.0, 0.0, 0.0]);
        let above = flight([20_000.0, 0.0, 152.4], [-50.0, 0.0, 0.0]);
        assert_eq!(span(WellClear::DO_365, &own, &aside), None);
        assert_eq!(span(WellClear::DO_365, &own, &above), None);
        // Diverging outside D is never lost.
        let behind = flight([2000.0, 0.0, 0.0], [90.0, 0.0, 0.0]);
        assert_eq!(span(WellClear::DO_365, &own, &behind), None);
    }

    #[test]
    fn rounding_alone_never_decides() {
        // Formation flight at exactly D: neither lost nor well clear.
        let (own, wing) = (flight([0.0; 3], [50.0, 1.0, 0.0]), flight([609.6, 0.0, 0.0], [50.0, 1.0, 0.0]));
        assert_eq!(losses(WellClear::F3442, &own, &wing).iter().filter(|loss| loss.is_certain).count(), 0);
        let near = flight([609.5, 0.0, 0.0], [50.0, 1.0, 0.0]);
        assert_eq!(losses(WellClear::F3442, &own, &near), [Loss { span_s: [0.0, DURATION_S], is_certain: true }]);
        let far = flight([609.7, 0.0, 0.0], [50.0, 1.0, 0.0]);
        assert_eq!(losses(WellClear::F3442, &own, &far), []);
    }

    #[test]
    fn a_straight_curve_agrees_with_its_line() {
        let (own, intruder) = (flight([0.0; 3], [50.0, 0.0, 1.0]), flight([9_000.0, 300.0, 90.0], [-40.0, 0.0, 0.0]));
        let v = Vector3::new(50.0, 0.0, 1.0);
        let coefficients = vec![Vector3::zeros(), v, Vector3::new(0.0, 0.0, 1e-12)];
        let curved =
            Segment::curved(Curve { from_s: 0.0, to_s: DURATION_S, coefficients, deviation: Deviation::default() });
        let expected = span(WellClear::DO_365, &own, &intruder).expect("a loss");
        assert_span(span(WellClear::DO_365, &curved, &intruder), expected, 1e-3);
    }

    /// Returns own ship and intruder in the plane around the own ship: latitude and longitude \[deg\], altitude \[ft\],
    /// track \[deg\] and ground speed \[knot\] of each.
    fn encounter(own: [f64; 5], intruder: [f64; 5]) -> [Segment; 2] {
        let mile_per_deg = [60.0 * own[0].to_radians().cos(), 60.0];
        [own, intruder].map(|[latitude, longitude, altitude_ft, track, speed]| {
            let x = (longitude - own[1]) * mile_per_deg[0] * MILE_M;
            let y = (latitude - own[0]) * mile_per_deg[1] * MILE_M;
            let (sin, cos) = track.to_radians().sin_cos();
            flight([x, y, altitude_ft * FOOT_M], [speed * KNOT_M_S * sin, speed * KNOT_M_S * cos, 0.0])
        })
    }

    /// Scenarios of NASA's DAIDALUS v2.0.4 with the intervals of its detectors: `H1` from
    /// `Regression/gold/DaidalusBatch-no_sum.out`, the example from `Regression/gold/DaidalusExample-*.out`. The states
    /// are rounded to 1e-6 degrees there, which is 1 ms of flight.
    #[test]
    fn daidalus_finds_the_same_intervals() {
        for (latitudes, expected) in [
            ([33.842_767, 34.474_061], [135.214_585, 173.354_675]),
            ([33.907_697, 34.279_281], [65.089_621, 103.229_616]),
            ([33.930_886, 34.209_715], [40.045_31, 78.185_284]),
        ] {
            let [own, intruder] = encounter(
                [latitudes[0], -117.0, 17_000.0, 0.0, 200.0],
                [latitudes[1], -117.002_841, 17_000.0, 180.0, 600.0],
            );
            assert_span(span(DAIDALUS, &own, &intruder), expected, 5e-3);
            // The thresholds of the standard are 10 ft smaller.
            let [wide, narrow] =
                [DAIDALUS, WellClear::DO_365].map(|definition| span(definition, &own, &intruder).expect("a loss"));
            assert!(wide[0] < narrow[0] && narrow[1] < wide[1] && narrow[0] - wide[0] < 0.1);
        }
        let [own, intruder] =
            encounter([33.95, -96.7, 8700.0, 206.0, 151.0], [33.861_916_58, -96.732_726_01, 9000.0, 0.0, 210.0]);
        // DO-365, the buffered volume of 1 nautical mile, and a cylinder of 5 nautical miles.
        for (horizontal_miles, tau_s, expected_s) in [(0.66, 35.0, 21.02), (1.0, 35.0, 19.42), (5.0, 0.0, 5.46)] {
            let thresholds = WellClear { horizontal_m: horizontal_miles * MILE_M, tau_s, ..WellClear::DO_365 };
            let [from_s, _] = span(thresholds, &own, &intruder).expect("a loss");
            assert!((from_s - expected_s).abs() < 0.02, "{from_s}, expected {expected_s}");
        }
        // Head-on, 0.5 nautical miles aside, in the plane of the scenario `H0`: 120 and 180 knots.
        let own = flight([-3.333_333 * MILE_M, 0.0, 0.0], [120.0 * KNOT_M_S, 0.0, 0.0]);
        let intruder = flight([5.0 * MILE_M, 0.5 * MILE_M, 0.0], [-180.0 * KNOT_M_S, 0.0, 0.0]);
        let half_s = (0.66_f64.powi(2) - 0.25).sqrt() / 300.0 * 3600.0;
        let lead_s = 17.5 + (17.5_f64.powi(2) + half_s * half_s).sqrt();
        let closest_s = 99.999_996;
        assert_span(span(DAIDALUS, &own, &intruder), [closest_s - lead_s, closest_s + half_s], 1e-6);
    }
}
