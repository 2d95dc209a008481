//! Positions as 16-bit steps on a grid.

use nalgebra::Vector3;

/// Marks an absent point, in place of its step along x.
const ABSENT: i16 = i16::MIN;
/// Largest step in cells.
const LARGEST: f64 = 32_766.0;
/// Largest number of cells between the middle and the farthest point, so that a start fits into 32 bits.
const MOST_CELLS: f64 = 1_073_741_824.0;
/// Smallest cell \[m\].
const SMALLEST_M: f64 = 1e-9;
/// Largest number of cells up to the largest coordinate, so that every position on the grid is exactly a double.
const MOST_WHOLE: f64 = 2_251_799_813_685_248.0;

/// Motion of points on a grid. The cell is the smallest power of two for which every step fits into 16 bits.
///
/// Points are rounded to the nearest position on the grid, and steps lead between these, so rounding errors do not add
/// up.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PackedMotion {
    /// Origin of the grid, the middle of all points \[m\].
    pub(super) middle_m: [f64; 3],
    /// Edge of a cell \[m\].
    pub(super) cell_m: f64,
    /// Cells from the origin to the first position of each point; 0 for a point that is never present.
    starts: Vec<[i32; 3]>,
    /// Steps of all points, instant by instant; the first step is zero.
    steps: Vec<[i16; 3]>,
}

impl PackedMotion {
    /// Packs the points of each instant. Every instant has the same number of points, with `None` for an absent one. A
    /// point with a coordinate that is not finite counts as absent.
    ///
    /// Coordinates above 1e9 m give cells above 1e-6 m.
    pub(super) fn new(instants: &[Vec<Option<Vector3<f64>>>]) -> Self {
        let points = instants.first().map_or(0, Vec::len);
        let there = |k: usize, point: usize| instants[k].get(point).copied().flatten().filter(is_finite);
        let all = || (0..instants.len()).flat_map(|k| (0..points).filter_map(move |point| there(k, point)));
        let (mut low, mut high) = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
        for at in all() {
            (low, high) = (low.inf(&at), high.sup(&at));
        }
        if low.x > high.x {
            (low, high) = (Vector3::zeros(), Vector3::zeros());
        }
        let mut longest_m = 0.0_f64;
        for point in 0..points {
            let mut last: Option<Vector3<f64>> = None;
            for at in (0..instants.len()).filter_map(|k| there(k, point)) {
                longest_m = longest_m.max(last.map_or(0.0, |last| (at - last).amax()));
                last = Some(at);
            }
        }
        let reach_m = (0.5 * (high - low)).amax();
        let farthest_m = low.amax().max(high.amax());
        // A step on the grid is at most one cell longer than the motion.
        let cell_m = power_of_two(
            (longest_m / (LARGEST - 1.0))
                .max(reach_m / (MOST_CELLS - 2.0))
                .max(farthest_m / MOST_WHOLE)
                .max(SMALLEST_M),
        );
        let middle = (0.5 * low + 0.5 * high).map(|x| (x / cell_m).round());
        let place = |at: Vector3<f64>| at.map(|x| (x / cell_m).round()) - middle;
        let mut starts = vec![[0; 3]; points];
        let mut last: Vec<Option<Vector3<f64>>> = vec![None; points];
        let mut steps = Vec::with_capacity(points * instants.len());
        for k in 0..instants.len() {
            for point in 0..points {
                let Some(at) = there(k, point).map(place) else {
                    steps.push([ABSENT, 0, 0]);
                    continue;
                };
                let from = *last[point].get_or_insert_with(|| {
                    starts[point] = whole(at);
                    at
                });
                let step = at - from;
                steps.push([step.x, step.y, step.z].map(short));
                last[point] = Some(at);
            }
        }
        Self { middle_m: (middle * cell_m).into(), cell_m, starts, steps }
    }

    /// Returns the largest rounding error of a coordinate \[m\], half a cell.
    pub(super) fn rounding_m(&self) -> f64 {
        0.5 * self.cell_m
    }

    /// Returns the starts in cells as little-endian 32-bit integers: x, y, z, point by point.
    pub(super) fn start_bytes(&self) -> Vec<u8> {
        self.starts.iter().flatten().flat_map(|cells| cells.to_le_bytes()).collect()
    }

    /// Returns the steps in cells from the last position of each point, as little-endian 16-bit integers: x, y, z,
    /// point by point, instant by instant. A step of -32768 along x marks an absent point.
    pub(super) fn step_bytes(&self) -> Vec<u8> {
        self.steps.iter().flatten().flat_map(|cells| cells.to_le_bytes()).collect()
    }
}

/// Returns the smallest power of two that is not below a positive normal number.
fn power_of_two(least: f64) -> f64 {
    const EXPONENT: u64 = 0x7ff << 52;
    let below = f64::from_bits(least.to_bits() & EXPONENT);
    if below < least { 2.0 * below } else { below }
}

fn is_finite(at: &Vector3<f64>) -> bool {
    at.iter().all(|x| x.is_finite())
}

#[expect(clippy::cast_possible_truncation, reason = "cells are chosen so that it fits")]
fn whole(at: Vector3<f64>) -> [i32; 3] {
    [at.x, at.y, at.z].map(|x| x as i32)
}

#[expect(clippy::cast_possible_truncation, reason = "cells are chosen so that it fits")]
fn short(step: f64) -> i16 {
    debug_assert!(step.abs() <= LARGEST, "a step of {step} cells");
    step as i16
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn coordinate() -> impl Strategy<Value = f64> {
        prop_oneof![
            8 => -50.0..50.0_f64,
            2 => -1e-6..1e-6_f64,
            2 => 4e6..4.000_01e6_f64,
            1 => -1e9..1e9_f64,
            1 => Just(f64::NAN),
            1 => Just(f64::INFINITY),
        ]
    }

    fn point() -> impl Strategy<Value = Option<Vector3<f64>>> {
        let at = [coordinate(), coordinate(), coordinate()].prop_map(|at| Some(Vector3::from(at)));
        prop_oneof![6 => at, 1 => Just(None)]
    }

    /// Returns the points at every instant as a page draws them \[m\].
    fn unpacked(motion: &PackedMotion) -> Vec<Vec<Option<Vector3<f64>>>> {
        let mut cells: Vec<_> = motion.starts.iter().map(|start| Vector3::from(start.map(f64::from))).collect();
        let instants = motion.steps.chunks(motion.starts.len().max(1)).map(|steps| {
            let at = std::iter::zip(&mut cells, steps).map(|(at, step)| {
                *at += if step[0] == ABSENT { Vector3::zeros() } else { Vector3::from(step.map(f64::from)) };
                (step[0] != ABSENT).then(|| *at * motion.cell_m + Vector3::from(motion.middle_m))
            });
            at.collect()
        });
        instants.collect()
    }

    proptest! {
        #[test]
        fn unpacked_points_are_within_half_a_cell(
            instants in (1..5_usize).prop_flat_map(|points| {
                prop::collection::vec(prop::collection::vec(point(), points), 1..30)
            }),
        ) {
            let motion = PackedMotion::new(&instants);
            let unpacked = unpacked(&motion);
            prop_assert_eq!(unpacked.len(), instants.len());
            for (is, was) in std::iter::zip(unpacked.iter().flatten(), instants.iter().flatten()) {
                let was = was.filter(is_finite);
                prop_assert_eq!(is.is_some(), was.is_some());
                if let (Some(is), Some(was)) = (is, was) {
                    prop_assert!((is - was).amax() <= motion.rounding_m(), "{} and {}", is, was);
                }
            }
        }
    }

    #[test]
    fn cells_are_as_small_as_the_steps_allow() {
        let at = |x: f64| vec![Some(Vector3::new(x, 0.0, 0.0))];
        let instants: Vec<_> = (0..1000).map(|k| at(0.1 * f64::from(k))).collect();
        let motion = PackedMotion::new(&instants);
        assert!((0.1 / LARGEST..0.2 / LARGEST * 1.01).contains(&motion.cell_m), "{}", motion.cell_m);
        let largest = motion.steps.iter().map(|step| i32::from(step[0])).max().expect("a step");
        assert!(2 * largest > 32_767, "twice as many cells would not fit: {largest}");
        // A point at rest keeps its exact position.
        let still = PackedMotion::new(&vec![at(3.25); 5]);
        assert_eq!(unpacked(&still)[4][0], Some(Vector3::new(3.25, 0.0, 0.0)));
        assert_eq!(unpacked(&PackedMotion::new(&[])).len(), 0);
    }
}
