use clarabel::algebra::CscMatrix;
use clarabel::solver::SupportedConeT::{NonnegativeConeT, SecondOrderConeT};
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverStatus};
use proptest::prelude::*;

use super::*;

/// Tolerance of clarabel is 1e-8, for a violation and for the square of a distance.
const CLOSE: f64 = 1e-6;
/// Widening of a set that may have no interior, which clarabel needs.
const WIDER: f64 = 1e-3;

fn half_space(normal: [f64; 3], offset: f64) -> HalfSpace {
    HalfSpace { normal: Vector3::from(normal).normalize(), offset }
}

fn nearest(given: &[HalfSpace], wish: Vector3<f64>, radius: f64) -> Nearest {
    HalfSpaces { given: given.to_vec(), ..HalfSpaces::default() }.nearest(wish, radius)
}

/// Minimises `1/2 curvature |x|^2 + linear . x` over x with `rows . x <= limits`, whose first three components are in
/// the ball. `None` if clarabel does not converge, as in about one of a thousand nearly flat sets.
fn clarabel<const N: usize>(
    mut rows: Vec<[f64; N]>,
    mut limits: Vec<f64>,
    radius: f64,
    curvature: f64,
    linear: [f64; N],
) -> Option<Vec<f64>> {
    let cones = [NonnegativeConeT(rows.len()), SecondOrderConeT(4)];
    // The second-order cone of (radius, x).
    rows.push([0.0; N]);
    limits.push(radius);
    for axis in 0..3 {
        rows.push(std::array::from_fn(|column| if column == axis { -1.0 } else { 0.0 }));
        limits.push(0.0);
    }
    let quadratic: [[f64; N]; N] =
        std::array::from_fn(|row| std::array::from_fn(|column| if row == column { curvature } else { 0.0 }));
    let settings = DefaultSettings { verbose: false, ..DefaultSettings::default() };
    let (quadratic, rows) = (CscMatrix::from(&quadratic), CscMatrix::from(&rows));
    let mut solver = DefaultSolver::new(&quadratic, &linear, &rows, &limits, &cones, settings).expect("a program");
    solver.solve();
    (solver.solution.status == SolverStatus::Solved).then(|| solver.solution.x.clone())
}

/// Returns the least largest violation by clarabel: a fourth variable t with `normal . x + t >= offset`, t >= 0.
fn least_violation(given: &[HalfSpace], radius: f64) -> f64 {
    let rows = given.iter().map(|given| [-given.normal.x, -given.normal.y, -given.normal.z, -1.0]);
    let rows = rows.chain([[0.0, 0.0, 0.0, -1.0]]).collect();
    let limits = given.iter().map(|given| -given.offset).chain([0.0]).collect();
    clarabel(rows, limits, radius, 0.0, [0.0, 0.0, 0.0, 1.0]).expect("its set has an inside")[3]
}

/// Returns the square of the distance of `wish` to the half-spaces by clarabel.
fn squared_distance(given: &[HalfSpace], wish: Vector3<f64>, radius: f64) -> Option<f64> {
    let rows = given.iter().map(|given| [-given.normal.x, -given.normal.y, -given.normal.z]).collect();
    let limits = given.iter().map(|given| -given.offset).collect();
    let found = clarabel(rows, limits, radius, 1.0, [-wish.x, -wish.y, -wish.z])?;
    Some((Vector3::new(found[0], found[1], found[2]) - wish).norm_squared())
}

fn shifted(given: &[HalfSpace], by: f64) -> Vec<HalfSpace> {
    given.iter().map(|given| HalfSpace { offset: given.offset + by, ..*given }).collect()
}

/// Checks an answer against clarabel: it is in the ball, has the least largest violation, and is the nearest such
/// point. If the set of these points has no interior, the answer must be no nearer than in a wider set. In the wider
/// set it must agree with clarabel.
fn check(given: &[HalfSpace], wish: Vector3<f64>, radius: f64, found: Nearest) -> Result<(), String> {
    let expect = |holds: bool, said: &str| if holds { Ok(()) } else { Err(format!("{said}: {found:?}")) };
    expect(found.point.norm() <= radius * (1.0 + 1e-12), "outside of the ball")?;
    let outside = given.iter().map(|given| given.violation(&found.point)).fold(0.0, f64::max);
    expect((outside - found.violation).abs() <= 1e-9, "the violation is another")?;
    let least = least_violation(given, radius);
    expect((found.violation - least).abs() <= CLOSE, &format!("the least violation is {least}"))?;
    let wider = shifted(given, -least - WIDER);
    let Some(expected) = squared_distance(&wider, wish, radius) else { return Ok(()) };
    let distance = |nearest: Nearest| (nearest.point - wish).norm_squared();
    expect(distance(found) >= expected - CLOSE, "nearer than can be")?;
    let in_wider = distance(nearest(&wider, wish, radius));
    expect((in_wider - expected).abs() <= CLOSE, &format!("in a wider set {in_wider} is not {expected}"))?;
    if least_violation(&shifted(given, WIDER), radius) > CLOSE {
        return Ok(());
    }
    let Some(expected) = squared_distance(given, wish, radius) else { return Ok(()) };
    expect((distance(found) - expected).abs() <= CLOSE, &format!("the nearest is the root of {expected} away"))
}

fn normals() -> impl Strategy<Value = [f64; 3]> {
    prop::array::uniform3(-1.0..1.0_f64).prop_filter("a direction", |v| Vector3::from(*v).norm() > 0.1)
}

/// Half-spaces with planes far from parallel; most intersections are neither empty nor thin.
fn general() -> impl Strategy<Value = Vec<HalfSpace>> {
    prop::collection::vec((normals(), -1.0..0.7_f64).prop_map(|(normal, offset)| half_space(normal, offset)), 0..9)
}

/// Planes along the axes and diagonals, with parallel, opposite and repeated ones, each rotated by up to one of these
/// angles.
fn degenerate(turned: &'static [f64]) -> impl Strategy<Value = Vec<HalfSpace>> {
    let whole = prop::array::uniform3(-1..2_i32).prop_filter("a direction", |v| *v != [0; 3]);
    let one = (whole, prop::sample::select(turned), -3..3_i32).prop_map(|(v, by, offset)| {
        half_space([f64::from(v[0]) + by, f64::from(v[1]) - by, f64::from(v[2])], 0.25 * f64::from(offset))
    });
    prop::collection::vec(one, 0..9)
}

fn wishes() -> impl Strategy<Value = Vector3<f64>> {
    prop::array::uniform3(-1.5..1.5_f64).prop_map(Vector3::from)
}

proptest! {
    #[test]
    fn the_answer_matches_clarabel(given in general(), wish in wishes(), radius in 0.3..2.0_f64) {
        let found = nearest(&given, wish, radius);
        check(&given, wish, radius, found).map_err(TestCaseError::fail)?;
        let inside = HalfSpaces { given, ..HalfSpaces::default() }.nearest_inside(wish, radius);
        // A violation of rounding only may be either.
        prop_assert!(inside == (found.violation == 0.0).then_some(found.point) || found.violation.abs() < 1e-9);
    }

    #[test]
    fn parallel_opposite_and_repeated_planes_agree_with_clarabel(
        given in degenerate(&[0.0]), wish in wishes(), radius in 0.3..2.0_f64,
    ) {
        // If the planes leave a point or a line, clarabel needs a wider set.
        let wider = shifted(&given, -WIDER);
        check(&wider, wish, radius, nearest(&wider, wish, radius)).map_err(TestCaseError::fail)?;
        let (found, least) = (nearest(&given, wish, radius), least_violation(&given, radius));
        prop_assert!((found.violation - least).abs() <= CLOSE, "{found:?} {least}");
    }

    #[test]
    fn nearly_parallel_planes_give_the_violation_of_clarabel(
        given in degenerate(&[0.0, 1e-3, 1e-6, 1e-9, 1e-10, 1e-12]), wish in wishes(), radius in 0.3..2.0_f64,
    ) {
        let found = nearest(&given, wish, radius);
        prop_assert!(found.point.norm() <= radius * (1.0 + 1e-12));
        let least = least_violation(&given, radius);
        prop_assert!((found.violation - least).abs() <= CLOSE + 1e-6 * (radius + 0.5), "{found:?} {least}");
    }

    #[test]
    fn a_planar_problem_has_a_planar_answer(
        given in prop_oneof![general(), degenerate(&[0.0, 1e-9])], wish in wishes(), radius in 0.3..2.0_f64,
    ) {
        let flat: Vec<HalfSpace> = given
            .iter()
            .filter(|given| given.normal.xy().norm() > 1e-3)
            .map(|given| half_space([given.normal.x, given.normal.y, 0.0], given.offset))
            .collect();
        let wish = Vector3::new(wish.x, wish.y, 0.0);
        let found = nearest(&flat, wish, radius);
        prop_assert_eq!(found.point.z, 0.0);
        let least = least_violation(&flat, radius);
        prop_assert!((found.violation - least).abs() <= CLOSE, "{found:?} {least}");
    }

    #[test]
    fn the_check_against_clarabel_notices_an_omitted_half_space(mut given in general(), away in normals()) {
        let wish = 2.0 * Vector3::from(away).normalize();
        let wrong = nearest(&given, wish, 1.0);
        let left_out = HalfSpace { normal: -0.5 * wish, offset: 0.3 };
        prop_assume!(left_out.violation(&wrong.point) > 1e-3 + wrong.violation);
        given.push(left_out);
        prop_assert!(check(&given, wish, 1.0, wrong).is_err());
    }
}

#[test]
fn projections_match_hand_calculations() {
    let wish = Vector3::new(2.0, 1.0, 0.0);
    let is_at = |given: &[HalfSpace], radius: f64, point: [f64; 3], violation: f64| {
        let found = nearest(given, wish, radius);
        assert!((found.point - Vector3::from(point)).norm() < 1e-9, "{given:?}: {found:?}");
        assert!((found.violation - violation).abs() < 1e-9, "{given:?}: {found:?}");
    };
    is_at(&[], 3.0, [2.0, 1.0, 0.0], 0.0);
    is_at(&[], 1.0, [2.0 / 5.0_f64.sqrt(), 1.0 / 5.0_f64.sqrt(), 0.0], 0.0);
    let left_of_1 = half_space([-1.0, 0.0, 0.0], -1.0);
    let below_half = half_space([0.0, -1.0, 0.0], -0.5);
    is_at(&[left_of_1], 3.0, [1.0, 1.0, 0.0], 0.0);
    is_at(&[left_of_1, below_half], 3.0, [1.0, 0.5, 0.0], 0.0);
    is_at(&[below_half, left_of_1, half_space([0.0, 0.0, 1.0], 0.25)], 3.0, [1.0, 0.5, 0.25], 0.0);
    // No point is right of 2 and left of 1. The answer is halfway between, at the point nearest to the wish.
    is_at(&[left_of_1, half_space([1.0, 0.0, 0.0], 2.0)], 3.0, [1.5, 1.0, 0.0], 0.5);
    // The half-space is beyond the ball, so the answer is the nearest point of the ball.
    is_at(&[half_space([1.0, 0.0, 0.0], 2.0)], 1.0, [1.0, 0.0, 0.0], 1.0);
    // Three half-planes with an empty intersection: the answer is the centre of the triangle.
    let triangle = [0.0, 120.0, 240.0_f64].map(|degrees| {
        let (sin, cos) = libm::sincos(degrees.to_radians());
        half_space([cos, sin, 0.0], 1.0)
    });
    is_at(&triangle, 3.0, [0.0, 0.0, 0.0], 1.0);
    is_at(&[triangle[0], triangle[0], triangle[1], triangle[2], triangle[0]], 3.0, [0.0, 0.0, 0.0], 1.0);
}
