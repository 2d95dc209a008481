//! Optimal assignment of interchangeable vehicles to slots.

use nalgebra::{Rotation3, Vector3};

use super::{Formation, Freedom, best_rigid_motion};
use tautline_core::swarm::{Rows, mean_row, row, set_row};

/// Returns the largest number of vehicles for an assignment within `freedom`. The table of squared distances takes 8
/// N^2 bytes. Each assignment takes O(N^3), dozens of times for rigid motions.
#[must_use]
pub const fn most_assigned(freedom: Freedom) -> usize {
    match freedom {
        Freedom::Fixed | Freedom::Translation => 5000,
        Freedom::RigidMotion => 500,
    }
}
/// Largest number of vehicles for which a rotatable formation starts from [`TURNS`] directions; beyond, from one.
const TURNED_UP_TO: usize = 200;
/// Number of start directions.
const TURNS: u32 = 8;
/// Largest number of alternating assignments and fits. Each lowers the sum, so few are needed.
const MOST_ROUNDS: usize = 50;

/// Returns for each vehicle the slot that minimizes the sum of squared distances after the best motion within
/// `freedom`. The result is exact unless the formation may rotate. For rigid motions, assignment and best fit alternate
/// from several start directions until no single step lowers the sum.
///
/// Straight lines to such slots keep their distance: `(p_i - p_j).(h_i - h_j) >= 0` for every pair (Turpin, Michael and
/// Kumar 2014).
///
/// `None` for different numbers of positions and slots, more vehicles than [`most_assigned`], or values that are not
/// finite.
#[must_use]
pub fn optimal_slots(positions_m: &Rows, formation: &Formation, freedom: Freedom) -> Option<Vec<usize>> {
    let count = positions_m.nrows();
    if count != formation.count() || count > most_assigned(freedom) {
        return None;
    }
    if freedom == Freedom::Fixed {
        return assign(positions_m, &formation.slots_m).map(|(slots, _)| slots);
    }
    let (centre_m, slots_centre_m) = (mean_row(positions_m), mean_row(&formation.slots_m));
    let positions_m = centred_on(positions_m, centre_m);
    let slots = Formation::points(centred_on(&formation.slots_m, slots_centre_m));
    if freedom == Freedom::Translation {
        return assign(&positions_m, &slots.slots_m).map(|(slots, _)| slots);
    }
    let turns = if count <= TURNED_UP_TO { TURNS } else { 1 };
    let mut best: Option<(Vec<usize>, f64)> = None;
    for (turn, mirror) in (0..turns).flat_map(|turn| [(turn, 1.0), (turn, -1.0)]) {
        let yaw_rad = f64::from(turn) * std::f64::consts::TAU / f64::from(turns);
        let (sin, cos) = libm::sincos(yaw_rad);
        let rotation =
            Rotation3::from_matrix_unchecked(nalgebra::matrix![cos, -sin, 0.0; sin, cos, 0.0; 0.0, 0.0, 1.0]);
        let turned = map(&slots.slots_m, |slot| rotation * Vector3::new(slot.x, mirror * slot.y, slot.z));
        let found = alternate(&positions_m, &slots, turned)?;
        if best.as_ref().is_none_or(|(_, least)| found.1 < *least) {
            best = Some(found);
        }
    }
    best.map(|(slots, _)| slots)
}

/// As [`optimal_slots`], but a leader keeps its slot and the formation is placed around it. The best slots of the
/// others do not depend on the position of the formation.
#[must_use]
pub fn optimal_slots_around(positions_m: &Rows, formation: &Formation, leader: usize) -> Option<Vec<usize>> {
    let count = positions_m.nrows();
    if count != formation.count() {
        return None;
    }
    let others: Vec<usize> = (0..count).filter(|&i| i != leader).collect();
    let of_others = |rows: &Rows| Formation::points(rows.clone()).reordered(&others);
    let found = optimal_slots(&of_others(positions_m).slots_m, &of_others(&formation.slots_m), Freedom::Fixed)?;
    let mut given: Vec<usize> = (0..count).collect();
    found.iter().enumerate().for_each(|(i, &slot)| given[others[i]] = others[slot]);
    Some(given)
}

/// Alternates assignment and best fit until the assignment stays the same.
fn alternate(positions_m: &Rows, slots: &Formation, mut placed_m: Rows) -> Option<(Vec<usize>, f64)> {
    let mut found = assign(positions_m, &placed_m)?;
    for _ in 0..MOST_ROUNDS {
        let motion = best_rigid_motion(positions_m, &slots.reordered(&found.0))?;
        placed_m = map(&slots.slots_m, |slot| motion.apply(slot));
        let next = assign(positions_m, &placed_m)?;
        let settled = next.0 == found.0;
        found = next;
        if settled {
            break;
        }
    }
    Some(found)
}

/// Returns the slot of each vehicle, and the sum of squared distances \[m^2\].
fn assign(positions_m: &Rows, slots_m: &Rows) -> Option<(Vec<usize>, f64)> {
    let count = positions_m.nrows();
    let square = |i: usize, j: usize| (row(positions_m, i) - row(slots_m, j)).norm_squared();
    let squares: Vec<f64> = (0..count).flat_map(|i| (0..count).map(move |j| square(i, j))).collect();
    if !squares.iter().all(|square| square.is_finite()) {
        return None;
    }
    let (_, slots) = lsap::solve(count, count, &squares, false).ok()?;
    let sum = slots.iter().enumerate().map(|(i, &slot)| squares[i * count + slot]).sum();
    Some((slots, sum))
}

fn centred_on(rows: &Rows, centre_m: Vector3<f64>) -> Rows {
    map(rows, |point| point - centre_m)
}

fn map(rows: &Rows, image: impl Fn(Vector3<f64>) -> Vector3<f64>) -> Rows {
    let mut images = rows.clone();
    (0..rows.nrows()).for_each(|i| set_row(&mut images, i, image(row(rows, i))));
    images
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn sum(positions_m: &Rows, formation: &Formation, slots: &[usize]) -> f64 {
        let given = formation.reordered(slots);
        let offset = mean_row(positions_m) - mean_row(&given.slots_m);
        (0..slots.len()).map(|i| (row(positions_m, i) - row(&given.slots_m, i) - offset).norm_squared()).sum()
    }

    /// Returns every permutation of 0..count.
    fn orders(count: usize) -> Vec<Vec<usize>> {
        if count == 0 {
            return vec![Vec::new()];
        }
        let insert = |order: Vec<usize>| {
            (0..count).map(move |place| {
                let mut order = order.clone();
                order.insert(place, count - 1);
                order
            })
        };
        orders(count - 1).into_iter().flat_map(insert).collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn assignment_is_optimal(
            positions in prop::collection::vec(-5.0..5.0_f64, 18), slots in prop::collection::vec(-5.0..5.0_f64, 18),
        ) {
            let (positions_m, formation) =
                (Rows::from_column_slice(&positions), Formation::points(Rows::from_column_slice(&slots)));
            let found = optimal_slots(&positions_m, &formation, Freedom::Translation).expect("finite numbers");
            let sums = orders(6).into_iter().map(|order| sum(&positions_m, &formation, &order));
            let least = sums.fold(f64::INFINITY, f64::min);
            prop_assert!((sum(&positions_m, &formation, &found) - least).abs() < 1e-9 * (1.0 + least));
            // Monge property: relative positions of vehicles and of their slots never point in opposite directions.
            let given = formation.reordered(&found);
            for i in 0..6 {
                for j in 0..i {
                    let apart = row(&positions_m, i) - row(&positions_m, j);
                    prop_assert!(apart.dot(&(row(&given.slots_m, i) - row(&given.slots_m, j))) > -1e-9);
                }
            }
        }

        #[test]
        fn assignment_around_a_leader_is_optimal(
            positions in prop::collection::vec(-5.0..5.0_f64, 15), slots in prop::collection::vec(-5.0..5.0_f64, 15),
            leader in 0..5_usize,
        ) {
            let (positions_m, formation) =
                (Rows::from_column_slice(&positions), Formation::points(Rows::from_column_slice(&slots)));
            let sum = |order: &[usize]| {
                let given = formation.reordered(order);
                let offset = row(&positions_m, leader) - row(&given.slots_m, leader);
                let square = |i| (row(&positions_m, i) - row(&given.slots_m, i) - offset).norm_squared();
                (0..5).map(square).sum::<f64>()
            };
            let found = optimal_slots_around(&positions_m, &formation, leader).expect("finite numbers");
            prop_assert_eq!(found[leader], leader);
            let orders = orders(5);
            let of_others = orders.iter().filter(|order| order[leader] == leader);
            let least = of_others.map(|order| sum(order)).fold(f64::INFINITY, f64::min);
            prop_assert!((sum(&found) - least).abs() < 1e-9 * (1.0 + least), "{} {}", sum(&found), least);
        }

        #[test]
        fn a_turned_mirrored_and_shuffled_formation_is_recognised(yaw_rad in 0.0..6.25_f64, mirror in any::<bool>()) {
            let formation = Formation::points(Rows::from_row_slice(&[
                0.0, 0.0, 0.0, 4.0, 0.3, 0.0, 1.0, 2.0, 0.0, 7.0, 3.0, 0.0, 2.0, 5.5, 0.0,
            ]));
            let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), yaw_rad);
            let flip = if mirror { -1.0 } else { 1.0 };
            let shuffled = formation.reordered(&[3, 0, 4, 2, 1]);
            let motion = |slot: Vector3<f64>| turn * Vector3::new(slot.x, flip * slot.y, 0.0) + Vector3::repeat(9.0);
            let moved = map(&shuffled.slots_m, motion);
            let found = optimal_slots(&moved, &formation, Freedom::RigidMotion).expect("finite numbers");
            prop_assert_eq!(found, [3, 0, 4, 2, 1]);
        }
    }

    #[test]
    fn invalid_assignments_return_none() {
        let formation = Formation::line(3, 1.0);
        assert_eq!(optimal_slots(&Rows::zeros(2), &formation, Freedom::Translation), None);
        let lost = Rows::from_element(3, f64::NAN);
        assert_eq!(optimal_slots(&lost, &formation, Freedom::Translation), None);
        assert_eq!(optimal_slots(&lost, &formation, Freedom::RigidMotion), None);
        for freedom in [Freedom::Translation, Freedom::RigidMotion] {
            let many = Formation::line(most_assigned(freedom) + 1, 1.0);
            assert_eq!(optimal_slots(&many.slots_m, &many, freedom), None);
        }
    }
}
