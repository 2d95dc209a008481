use std::f64::consts::TAU;

use nalgebra::{Matrix3, Rotation3};
use proptest::prelude::*;

use super::*;
use crate::graph::Graph;

/// Rounding of a fit, relative to the extent of the shape: sums of a few dozen products in double precision.
const FIT_TOLERANCE: f64 = 1e-13;
/// Tolerance of the dimension used throughout: far above rounding, far below any shape's aspect.
const DIMENSION_TOLERANCE: f64 = 1e-9;

fn rows(points: &[[f64; 3]]) -> Rows {
    Rows::from_fn(points.len(), |i, axis| points[i][axis])
}

fn moved(slots: &Rows, motion: &RigidMotion) -> Rows {
    let mut rows = slots.clone();
    for i in 0..rows.nrows() {
        set_row(&mut rows, i, motion.apply(row(slots, i)));
    }
    rows
}

fn shapes() -> [Formation; 6] {
    [
        Formation::pentagon(3.0),
        Formation::circle(7, 2.0),
        Formation::line(4, 1.5),
        Formation::grid(11, 0.7),
        Formation::sphere(23, 4.0),
        Formation::points(rows(&[[0.0, 0.0, 0.0], [1.0, 2.0, 3.0], [-4.0, 0.5, 0.25], [2.0, -1.0, 7.0]])),
    ]
}

fn motions() -> impl Strategy<Value = RigidMotion> {
    let angle = -TAU..TAU;
    ((angle.clone(), angle.clone(), angle), [-1e3..1e3, -1e3..1e3, -1e3..1e3], any::<bool>()).prop_map(
        |((roll, pitch, yaw), [x, y, z], reflect)| {
            let turn = *Rotation3::from_euler_angles(roll, pitch, yaw).matrix();
            let mirror = Matrix3::from_diagonal(&Vector3::new(if reflect { -1.0 } else { 1.0 }, 1.0, 1.0));
            RigidMotion { rotation: turn * mirror, translation_m: Vector3::new(x, y, z) }
        },
    )
}

proptest! {
    #[test]
    fn errors_ignore_rigid_motions_and_reflections(motion in motions()) {
        for shape in shapes() {
            let positions = moved(&shape.slots_m, &motion);
            let error = procrustes_rms_m(&positions, &shape);
            prop_assert!(error <= 1e3 * FIT_TOLERANCE, "{shape:?}: {error}");
            let edge_error = largest_edge_error_m(&positions, &shape, &Graph::complete(shape.count()));
            prop_assert!(edge_error <= 1e3 * FIT_TOLERANCE);
            let found = best_rigid_motion(&positions, &shape).ok_or_else(|| TestCaseError::fail("no motion"))?;
            let orthogonality = (found.rotation.transpose() * found.rotation - Matrix3::identity()).amax();
            prop_assert!(orthogonality <= FIT_TOLERANCE);
            for i in 0..shape.count() {
                let gap = (found.apply(row(&shape.slots_m, i)) - row(&positions, i)).norm();
                prop_assert!(gap <= 1e4 * FIT_TOLERANCE, "{gap}");
            }
        }
    }

    #[test]
    fn no_rigid_motion_fits_better_than_the_best(motion in motions(), noise in prop::collection::vec(-0.3..0.3, 15)) {
        let shape = Formation::pentagon(3.0);
        let positions = &shape.slots_m + Rows::from_fn(5, |i, axis| noise[3 * i + axis]);
        let other = RigidMotion { translation_m: motion.translation_m * 1e-4, ..motion };
        let rms_of = |motion: &RigidMotion| (moved(&shape.slots_m, motion) - &positions).norm() / 5.0_f64.sqrt();
        let best = procrustes_rms_m(&positions, &shape);
        let found = best_rigid_motion(&positions, &shape).ok_or_else(|| TestCaseError::fail("no motion"))?;
        prop_assert!((rms_of(&found) - best).abs() <= FIT_TOLERANCE);
        prop_assert!(best <= rms_of(&other) + FIT_TOLERANCE);
    }
}

#[test]
fn a_reflected_chiral_shape_needs_a_reflection() {
    let shape = &shapes()[5];
    let mirrored = rows(&[[0.0, 0.0, 0.0], [1.0, 2.0, -3.0], [-4.0, 0.5, -0.25], [2.0, -1.0, -7.0]]);
    assert_eq!(best_rigid_motion(&mirrored, shape).map(|motion| motion.reflects()), Some(true));
    assert_eq!(best_rigid_motion(&shape.slots_m, shape).map(|motion| motion.reflects()), Some(false));
}

#[test]
fn the_error_of_a_stretched_square_is_known() {
    // A square of side 2 stretched by 1.25 along x: each corner is 0.25 off, and no rotation helps.
    let square = Formation::points(rows(&[[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]]));
    let mut stretched = square.slots_m.clone();
    stretched.column_mut(0).scale_mut(1.25);
    assert!((procrustes_rms_m(&stretched, &square) - 0.25).abs() < FIT_TOLERANCE);
    let expected = 0.5_f64.max((2.5_f64.powi(2) + 4.0).sqrt() - 8.0_f64.sqrt());
    assert!((largest_edge_error_m(&stretched, &square, &Graph::complete(4)) - expected).abs() < FIT_TOLERANCE);
}

#[test]
fn only_edges_of_the_graph_count() {
    let shape = Formation::line(3, 1.0);
    let bent = rows(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]]);
    assert_eq!(largest_edge_error_m(&bent, &shape, &Graph::path(3)), 0.0);
    let error = largest_edge_error_m(&bent, &shape, &Graph::complete(3));
    assert!((error - (2.0 - 2.0_f64.sqrt())).abs() < FIT_TOLERANCE);
}

#[test]
fn a_nan_position_never_gives_a_small_error() {
    let shape = Formation::pentagon(3.0);
    for bad in [f64::NAN, f64::INFINITY] {
        for i in 0..5 {
            let mut positions = shape.slots_m.clone();
            positions[(i, 1)] = bad;
            assert!(procrustes_rms_m(&positions, &shape).is_nan());
            let error = largest_edge_error_m(&positions, &shape, &Graph::complete(5));
            assert!(error.is_nan() || error == f64::INFINITY);
        }
    }
    let graph = Graph::complete(5);
    assert!(procrustes_rms_m(&Rows::zeros(4), &shape).is_nan());
    assert!(largest_edge_error_m(&Rows::zeros(4), &shape, &graph).is_nan());
    assert!(best_rigid_motion(&Rows::zeros(0), &Formation::line(0, 1.0)).is_none());
}

#[test]
fn vehicles_at_a_single_point_have_a_fit() {
    let shape = Formation::line(2, 2.0);
    assert!((procrustes_rms_m(&Rows::zeros(2), &shape) - 1.0).abs() < FIT_TOLERANCE);
    assert_eq!(procrustes_rms_m(&Rows::zeros(1), &Formation::line(1, 2.0)), 0.0);
}

#[test]
fn the_affine_dimension_of_shapes_is_known() {
    let dimensions = shapes().map(|shape| shape.affine_dimension(DIMENSION_TOLERANCE));
    assert_eq!(dimensions, [2, 2, 1, 2, 3, 3]);
    assert_eq!(affine_dimension(&rows(&[[1.0, 2.0, 3.0]; 4]), DIMENSION_TOLERANCE), 0);
    assert_eq!(affine_dimension(&Rows::zeros(0), DIMENSION_TOLERANCE), 0);
    assert_eq!(affine_dimension(&rows(&[[0.0; 3], [f64::NAN, 0.0, 1.0]]), DIMENSION_TOLERANCE), 0);
    assert_eq!(affine_dimension(&rows(&[[-1e308, 0.0, 0.0], [1e308, 0.0, 0.0]]), DIMENSION_TOLERANCE), 0);
}

#[test]
fn the_affine_dimension_is_invariant_to_translation_and_scale() {
    for scale in [1e-150, 1e-6, 1.0, 1e150] {
        let line = rows(&[[1.0, 2.0, 3.0], [2.0, 4.0, 6.0], [5.0, 10.0, 15.0]]) * scale;
        assert_eq!(affine_dimension(&line, DIMENSION_TOLERANCE), 1);
    }
    let far = rows(&[[5e6, 5e6, 5e6]; 3]) + Formation::line(3, 2.0).slots_m;
    assert_eq!(affine_dimension(&far, DIMENSION_TOLERANCE), 1);
    let bent = rows(&[[0.0; 3], [1.0, 0.0, 0.0], [2.0, 1e-6, 0.0]]);
    assert_eq!((affine_dimension(&bent, DIMENSION_TOLERANCE), affine_dimension(&bent, 1e-3)), (2, 1));
}

#[test]
fn shapes_have_their_distances() {
    let pentagon = Formation::pentagon(3.0);
    for (i, j) in [(0, 1), (0, 2), (1, 2), (2, 3), (2, 4), (3, 4)] {
        assert!((pentagon.desired_distance(i, j) - 3.0).abs() < FIT_TOLERANCE);
    }
    assert!((pentagon.desired_distance(0, 3) - 27.0_f64.sqrt()).abs() < FIT_TOLERANCE);
    assert!((Formation::circle(6, 1.5).desired_distance(5, 0) - 1.5).abs() < FIT_TOLERANCE);
    assert!((Formation::circle(6, 1.5).desired_distance(1, 4) - 3.0).abs() < FIT_TOLERANCE);
    assert_eq!(Formation::line(5, 2.0).desired_distance(1, 4), 6.0);
    let grid = Formation::grid(7, 2.0);
    assert_eq!(row(&grid.slots_m, 6), Vector3::new(0.0, 4.0, 0.0));
    assert_eq!(row(&Formation::grid(9, 1.0).slots_m, 8), Vector3::new(2.0, 2.0, 0.0));
    let sphere = Formation::sphere(200, 3.0);
    assert!((0..200).all(|i| (row(&sphere.slots_m, i).norm() - 3.0).abs() < FIT_TOLERANCE));
    // An even spread of N points on a sphere of radius r keeps them about r sqrt(4 pi / N) apart.
    let apart = sphere.min_distance().map_or(0.0, |(_, distance)| distance);
    assert!(apart > 0.7 * 3.0 * (2.0 * TAU / 200.0).sqrt(), "{apart}");
    assert!(pentagon.is_in_plane_z0() && grid.is_in_plane_z0() && !sphere.is_in_plane_z0());
    assert_eq!(
        [Formation::grid(0, 1.0).count(), Formation::sphere(0, 1.0).count(), Formation::circle(0, 1.0).count()],
        [0; 3]
    );
}

#[test]
fn the_fit_respects_the_freedom() {
    let formation = Formation::grid(6, 2.0);
    let quarter = |x: f64, y: f64| [7.0 - y, x + 3.0, 0.0];
    let turned: Vec<f64> = (0..6).flat_map(|i| quarter(formation.slots_m[(i, 0)], formation.slots_m[(i, 1)])).collect();
    let moved = Rows::from_fn(6, |i, axis| formation.slots_m[(i, axis)] + 5.0);
    let place_m = Vector3::repeat(5.0);
    let error_m = |positions_m: &Rows, freedom| PositionError::of(positions_m, &formation, place_m, freedom).rms_m;
    let turned = Rows::from_row_slice(&turned);
    assert!(error_m(&turned, Freedom::RigidMotion) < 1e-12 && error_m(&turned, Freedom::Translation) > 1.0);
    assert!(error_m(&moved, Freedom::RigidMotion) < 1e-12 && error_m(&moved, Freedom::Translation) < 1e-12);
    let further = Rows::from_fn(6, |i, axis| moved[(i, axis)] + if axis == 0 { 2.0 } else { 0.0 });
    assert!(error_m(&moved, Freedom::Fixed) < 1e-12 && (error_m(&further, Freedom::Fixed) - 2.0).abs() < 1e-12);
    for freedom in [Freedom::Fixed, Freedom::Translation, Freedom::RigidMotion] {
        assert!(error_m(&Rows::zeros(5), freedom).is_nan());
    }
}

#[test]
fn the_largest_position_error_is_that_of_the_farthest_vehicle() {
    let count = 400;
    let formation = Formation::grid(count, 2.0);
    let mut one_off = formation.slots_m.clone();
    one_off[(7, 1)] += 0.19;
    for freedom in [Freedom::Fixed, Freedom::Translation, Freedom::RigidMotion] {
        let error = PositionError::of(&one_off, &formation, Vector3::zeros(), freedom);
        assert!((error.rms_m - 0.19 / 20.0).abs() < 1e-4, "{freedom:?} {error:?}");
        assert!((error.max_m - 0.19).abs() < 2e-3, "{freedom:?} {error:?}");
    }
    one_off[(3, 0)] = f64::NAN;
    for freedom in [Freedom::Fixed, Freedom::Translation, Freedom::RigidMotion] {
        let error = PositionError::of(&one_off, &formation, Vector3::zeros(), freedom);
        assert!(error.rms_m.is_nan() && error.max_m.is_nan(), "{freedom:?} {error:?}");
    }
}

#[test]
fn large_complete_graphs_use_a_tight_bound_of_the_edge_error() {
    let count = 1500;
    let (formation, graph) = (Formation::grid(count, 2.0), Graph::complete(count));
    assert!(evaluated_edges(&graph) == count && evaluated_edges(&Graph::complete(1414)) == 1414 * 1413 / 2);
    assert_eq!(evaluated_edges(&Graph::star(count)), count - 1);
    let all_pairs = |positions_m: &Rows| {
        let pairs = (0..count).flat_map(|i| (i + 1..count).map(move |j| (i, j)));
        let error = |(i, j)| (separation(positions_m, i, j) - formation.desired_distance(i, j)).abs();
        pairs.map(error).fold(0.0, f64::max)
    };
    let bound = |positions_m: &Rows| largest_edge_error_m(positions_m, &formation, &graph);
    let turned = Rows::from_fn(count, |i, axis| 7.0 + formation.slots_m[(i, [1, 0, 2][axis])]);
    assert!(bound(&turned) < 1e-10, "a turned and mirrored grid is that grid");
    let wider = &formation.slots_m * 1.1;
    assert!((bound(&wider) / all_pairs(&wider) - 1.0).abs() < 0.02, "its corners are off in opposite directions");
    let shaken = Rows::from_fn(count, |i, axis| formation.slots_m[(i, axis)] + 0.1 * ((3 * i + axis) as f64).sin());
    let (exact, bound_m) = (all_pairs(&shaken), bound(&shaken));
    assert!(exact <= bound_m && bound_m < 2.0 * exact, "{exact} {bound_m}");
    let mut lost = shaken;
    lost[(3, 1)] = f64::NAN;
    assert!(bound(&lost).is_nan() && bound(&Rows::zeros(7)).is_nan());
}
