//! Pieces of B-splines and of minimum-jerk curves, as coefficients of the powers of time.

use nalgebra::{Matrix2, Matrix2x3, RowVector3, Vector3};

use super::curves::powers;

/// Part of a curve: start and end \[s\] from the start of the curve, and the coefficients \[m/s^k\] of the time since
/// the start of the part.
pub(super) type Part = (f64, f64, Vec<Vector3<f64>>);

/// Position, velocity and acceleration \[m, m/s, m/s^2\].
pub(super) type State = [Vector3<f64>; 3];

/// Returns the parts of a B-spline, one for each interval of knots \[s\] that is not empty.
///
/// The curve begins at `knots[degree]` and ends at `knots[points.len()]`. Conditions: `points.len() + degree + 1` knots
/// in ascending order, and more points than the degree.
pub(super) fn b_spline(degree: usize, knots: &[f64], points: &[Vector3<f64>]) -> Vec<Part> {
    let start_s = knots[degree];
    let is_part = |k: &usize| knots[*k] < knots[*k + 1];
    (degree..points.len())
        .filter(is_part)
        .map(|k| {
            // Control point j of the Bezier curve is the blossom at j times the end and otherwise the start.
            let control = (0..=degree).map(|j| blossom(degree, knots, points, k, j)).collect::<Vec<_>>();
            (knots[k] - start_s, knots[k + 1] - start_s, powers(&control, knots[k + 1] - knots[k]))
        })
        .collect()
}

/// Returns the blossom of the part of a B-spline over interval k: `at_end` arguments are the end of the interval, the
/// others its start. The steps are those of de Boor, each with an argument of its own.
fn blossom(degree: usize, knots: &[f64], points: &[Vector3<f64>], k: usize, at_end: usize) -> Vector3<f64> {
    let mut level = points[k - degree..=k].to_vec();
    for r in 1..=degree {
        let knot = if r <= at_end { knots[k + 1] } else { knots[k] };
        for i in (r..=degree).rev() {
            let (low, high) = (knots[i + k - degree], knots[i + 1 + k - r]);
            let share = (knot - low) / (high - low);
            level[i] = level[i - 1] * (1.0 - share) + level[i] * share;
        }
    }
    level[degree]
}

/// Returns the parts of the curve of least integral of the squared jerk between two states, through `inner` points
/// \[m\]. `durations` \[s\] are positive; there is one more of them than inner points.
///
/// Between two nodes the curve has degree 5. Its velocities v and accelerations a at the inner nodes are unknown. The
/// derivative of the integral with respect to a is the jump of the jerk, that with respect to v the jump of the snap.
/// Both are zero at the minimum, so the curve has four continuous derivatives. The equations are symmetric, positive
/// definite and couple neighbouring nodes only, so block elimination needs no pivots.
pub(super) fn minimum_jerk(start: State, inner: &[Vector3<f64>], end: State, durations: &[f64]) -> Vec<Part> {
    let nodes = nodes(start, inner, end, durations);
    let mut from_s = 0.0;
    let parts = nodes.windows(2).zip(durations).map(|(ends, &duration_s)| {
        let to_s = from_s + duration_s;
        let part = (from_s, to_s, quintic(ends[0], ends[1], duration_s));
        from_s = to_s;
        part
    });
    parts.collect()
}

/// Returns the states at all nodes of a minimum-jerk curve.
fn nodes(start: State, inner: &[Vector3<f64>], end: State, durations: &[f64]) -> Vec<State> {
    let position = |node: usize| match node {
        0 => start[0],
        node => inner.get(node - 1).copied().unwrap_or(end[0]),
    };
    let rows = |state: State| Matrix2x3::from_rows(&[state[1].transpose(), state[2].transpose()]);
    // Elimination: at each inner node, the state is `right - factor * next state`.
    let (mut factors, mut rights): (Vec<Matrix2<f64>>, Vec<Matrix2x3<f64>>) = (Vec::new(), Vec::new());
    for (node, spans) in (1..).zip(durations.windows(2)) {
        let (s, t) = (spans[0].recip(), spans[1].recip());
        let (s2, t2) = (s * s, t * t);
        let bend = 36.0 * (t2 - s2);
        let mut diagonal = Matrix2::new(192.0 * (s2 * s + t2 * t), bend, bend, 9.0 * (s + t));
        let before = Matrix2::new(168.0 * s2 * s, 24.0 * s2, -24.0 * s2, -3.0 * s);
        let after = Matrix2::new(168.0 * t2 * t, -24.0 * t2, 24.0 * t2, -3.0 * t);
        let by = [position(node) - position(node - 1), position(node + 1) - position(node)];
        let row = |values: [f64; 2]| -> RowVector3<f64> { (by[0] * values[0] + by[1] * values[1]).transpose() };
        let mut right =
            Matrix2x3::from_rows(&[row([360.0 * s2 * s2, 360.0 * t2 * t2]), row([-60.0 * s2 * s, 60.0 * t2 * t])]);
        match factors.last().zip(rights.last()) {
            None => right -= before * rows(start),
            Some((factor, known)) => {
                diagonal -= before * factor;
                right -= before * known;
            }
        }
        if node == inner.len() {
            right -= after * rows(end);
        }
        let inverse = diagonal.try_inverse().unwrap_or(Matrix2::repeat(f64::NAN));
        factors.push(inverse * after);
        rights.push(inverse * right);
    }
    let mut nodes = vec![end];
    for node in (1..=inner.len()).rev() {
        let last = nodes[nodes.len() - 1];
        let mut found = rights[node - 1];
        if node < inner.len() {
            found -= factors[node - 1] * rows(last);
        }
        nodes.push([position(node), found.row(0).transpose(), found.row(1).transpose()]);
    }
    nodes.push(start);
    nodes.reverse();
    nodes
}

/// Returns the coefficients of the polynomial of degree 5 between two states over a duration T.
fn quintic([p, v, a]: State, [q, w, b]: State, duration_s: f64) -> Vec<Vector3<f64>> {
    let t = duration_s;
    let by = q - p;
    let c3 = (by * 20.0 - (w * 8.0 + v * 12.0) * t - (a * 3.0 - b) * (t * t)) / (2.0 * t * t * t);
    let c4 = (by * -30.0 + (w * 14.0 + v * 16.0) * t + (a * 3.0 - b * 2.0) * (t * t)) / (2.0 * t * t * t * t);
    let c5 = (by * 12.0 - (v + w) * (6.0 * t) + (b - a) * (t * t)) / (2.0 * t * t * t * t * t);
    vec![p, v, a * 0.5, c3, c4, c5]
}

#[cfg(test)]
mod tests {
    use nalgebra::vector;
    use proptest::prelude::*;

    use super::*;

    fn value(coefficients: &[Vector3<f64>], t: f64) -> Vector3<f64> {
        coefficients.iter().rev().fold(Vector3::zeros(), |sum, c| sum * t + c)
    }

    fn derivative(coefficients: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        (1..).zip(&coefficients[1..]).map(|(k, c)| c * f64::from(k)).collect()
    }

    /// Evaluates a B-spline by the recursion of Cox and de Boor for the basis functions.
    fn by_basis(degree: usize, knots: &[f64], points: &[Vector3<f64>], time: f64) -> Vector3<f64> {
        fn basis(i: usize, p: usize, knots: &[f64], time: f64) -> f64 {
            if p == 0 {
                return if knots[i] <= time && time < knots[i + 1] { 1.0 } else { 0.0 };
            }
            let part = |low: f64, high: f64, distance: f64| if high > low { distance / (high - low) } else { 0.0 };
            part(knots[i], knots[i + p], time - knots[i]) * basis(i, p - 1, knots, time)
                + part(knots[i + 1], knots[i + p + 1], knots[i + p + 1] - time) * basis(i + 1, p - 1, knots, time)
        }
        points.iter().enumerate().map(|(i, point)| point * basis(i, degree, knots, time)).sum()
    }

    /// Integral of the squared jerk.
    fn cost(parts: &[Part]) -> f64 {
        let of_part = |(from, to, c): &Part| {
            let jerk = derivative(&derivative(&derivative(c)));
            let t = to - from;
            let product = |(i, j): (u8, u8)| {
                let order = i32::from(i) + i32::from(j) + 1;
                jerk[usize::from(i)].dot(&jerk[usize::from(j)]) * t.powi(order) / f64::from(order)
            };
            (0..3).flat_map(|i| (0..3).map(move |j| (i, j))).map(product).sum::<f64>()
        };
        parts.iter().map(of_part).sum()
    }

    fn vectors(count: usize) -> impl Strategy<Value = Vec<Vector3<f64>>> {
        prop::collection::vec(prop::array::uniform3(-5.0..5.0).prop_map(Vector3::from), count)
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn parts_of_a_b_spline_agree_with_its_basis_functions(
            degree in 1_usize..6,
            is_clamped in any::<bool>(),
            points in vectors(9),
            steps in prop::collection::vec(prop_oneof![1 => Just(0.0), 4 => 0.1..2.0], 15),
        ) {
            let mut knots: Vec<f64> = steps[..=points.len() + degree].iter().scan(-1.0, |knot, step| {
                *knot += step;
                Some(*knot)
            }).collect();
            if is_clamped {
                let [first, last] = [knots[degree], knots[points.len()]];
                knots[..degree].fill(first);
                knots[points.len()..].fill(last);
            }
            prop_assume!(knots[degree] < knots[points.len()]);
            let parts = b_spline(degree, &knots, &points);
            prop_assert_eq!(parts[0].0, 0.0);
            for (from, to, coefficients) in &parts {
                for share in [0.01, 0.3, 0.77] {
                    let t = share * (to - from);
                    let expected = by_basis(degree, &knots, &points, knots[degree] + from + t);
                    prop_assert!((value(coefficients, t) - expected).norm() < 1e-9, "{share}");
                }
            }
        }

        #[test]
        fn a_minimum_jerk_curve_is_smooth_and_passes_its_points(
            inner in vectors(4),
            ends in vectors(6),
            durations in prop::collection::vec(0.2..3.0, 5),
            push in vectors(8),
        ) {
            let (start, end) = ([ends[0], ends[1], ends[2]], [ends[3], ends[4], ends[5]]);
            let parts = minimum_jerk(start, &inner, end, &durations);
            let orders = |coefficients: &[Vector3<f64>], t: f64| -> Vec<Vector3<f64>> {
                let all = std::iter::successors(Some(coefficients.to_vec()), |c| Some(derivative(c)));
                all.take(5).map(|c| value(&c, t)).collect()
            };
            for (k, pair) in parts.windows(2).enumerate() {
                let (before, after) = (orders(&pair[0].2, pair[0].1 - pair[0].0), orders(&pair[1].2, 0.0));
                prop_assert!((before[0] - inner[k]).norm() < 1e-9 && after[0] == inner[k]);
                for (order, (before, after)) in before.iter().zip(&after).enumerate() {
                    let scale = 1.0 + before.norm();
                    prop_assert!((before - after).norm() < 1e-7 * scale, "{order}: {before} {after}");
                }
            }
            for order in 0..3 {
                prop_assert!((orders(&parts[0].2, 0.0)[order] - start[order]).norm() < 1e-9);
                let (from, to, last) = &parts[4];
                prop_assert!((orders(last, to - from)[order] - end[order]).norm() < 1e-6);
            }
            // Negative twin: other velocities and accelerations at the points cost more.
            let mut other = nodes(start, &inner, end, &durations);
            for (node, push) in other[1..5].iter_mut().zip(push.chunks(2)) {
                node[1] += push[0];
                node[2] += push[1];
            }
            let other: Vec<_> = other.windows(2).zip(&parts).map(|(ends, (from, to, _))| {
                (*from, *to, quintic(ends[0], ends[1], to - from))
            }).collect();
            prop_assert!(cost(&other) > cost(&parts) * (1.0 - 1e-9));
        }
    }

    #[test]
    fn a_single_part_of_least_jerk_from_rest_to_rest_has_the_known_coefficients() {
        let rest = |x: f64| [vector![x, 0.0, 0.0], Vector3::zeros(), Vector3::zeros()];
        let parts = minimum_jerk(rest(0.0), &[], rest(1.0), &[1.0]);
        let x: Vec<_> = parts[0].2.iter().map(|c| c.x).collect();
        assert_eq!((parts.len(), x), (1, vec![0.0, 0.0, 0.0, 10.0, -15.0, 6.0]));
    }
}
