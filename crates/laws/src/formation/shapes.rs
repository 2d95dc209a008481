//! Parametric shapes: V, wedge, helix, rings and cube.

use std::f64::consts::{PI, TAU};

use nalgebra::Vector3;

use super::Formation;

/// Narrowest angle of a V \[rad\]. In a narrower V the first slots of the two arms are closer than the spacing.
pub const NARROWEST_V_RAD: f64 = PI / 3.0;

impl Formation {
    /// Two straight arms in the plane z = 0 that meet at the origin in this angle, with the tip towards x. The first
    /// slot is the tip; the others alternate between the left and the right arm.
    ///
    /// No two slots are nearer than `spacing_m`, and neighbours on an arm are that far apart, for angles from
    /// [`NARROWEST_V_RAD`] to pi.
    #[must_use]
    pub fn v(count: usize, spacing_m: f64, angle_rad: f64) -> Self {
        let (sin, cos) = libm::sincos(0.5 * angle_rad);
        Self::from_fn(count, |i| {
            let along_m = i.div_ceil(2) as f64 * spacing_m;
            Vector3::new(-along_m * cos, if i % 2 == 1 { along_m * sin } else { -along_m * sin }, 0.0)
        })
    }

    /// Filled triangle in the plane z = 0 with its tip at the origin and towards x: rows of 1, 2, 3, ... slots.
    /// Neighbours in a row and in adjacent rows are `spacing_m` apart. An incomplete last row is centred as far as the
    /// pattern allows.
    #[must_use]
    pub fn wedge(count: usize, spacing_m: f64) -> Self {
        let row_of = |i: usize| ((8 * i + 1).isqrt() - 1) / 2;
        let first_of = |row: usize| row * (row + 1) / 2;
        let last = row_of(count.saturating_sub(1));
        let missing = first_of(last + 1).saturating_sub(count);
        let row_spacing_m = 0.5 * 3.0_f64.sqrt() * spacing_m;
        Self::from_fn(count, |i| {
            let row = row_of(i);
            let place = i - first_of(row) + if row == last { missing / 2 } else { 0 };
            Vector3::new(-(row as f64 * row_spacing_m), (0.5 * row as f64 - place as f64) * spacing_m, 0.0)
        })
    }

    /// Helix about the z axis, upwards from (`radius_m`, 0, 0): each slot is turned by `step_rad`, and each full turn
    /// rises by `pitch_m`.
    #[must_use]
    pub fn helix(count: usize, radius_m: f64, pitch_m: f64, step_rad: f64) -> Self {
        Self::from_fn(count, |i| {
            let angle_rad = i as f64 * step_rad;
            let (sin, cos) = libm::sincos(angle_rad);
            Vector3::new(radius_m * cos, radius_m * sin, pitch_m * angle_rad / TAU)
        })
    }

    /// Returns the turn per slot \[rad\] for which neighbours on a helix are `spacing_m` apart; `None` if not even half
    /// a turn suffices.
    #[must_use]
    pub fn helix_step_rad(radius_m: f64, pitch_m: f64, spacing_m: f64) -> Option<f64> {
        let reaches = |step_rad: f64| chord_m(radius_m, pitch_m, step_rad) >= spacing_m;
        if !reaches(PI) {
            return None;
        }
        let (mut short_rad, mut long_rad) = (0.0, PI);
        loop {
            let middle_rad = 0.5 * (short_rad + long_rad);
            if middle_rad <= short_rad || middle_rad >= long_rad {
                return Some(long_rad);
            }
            *if reaches(middle_rad) { &mut long_rad } else { &mut short_rad } = middle_rad;
        }
    }

    /// Returns the smallest distance of two of `count` slots of [`Formation::helix`] \[m\], which depends only on the
    /// difference of their numbers. Infinite for fewer than two slots.
    #[must_use]
    pub fn helix_nearest_m(count: usize, radius_m: f64, pitch_m: f64, step_rad: f64) -> f64 {
        let mut nearest_m = f64::INFINITY;
        for apart in 1..count {
            let turn_rad = apart as f64 * step_rad;
            if pitch_m * turn_rad / TAU >= nearest_m {
                break;
            }
            nearest_m = nearest_m.min(chord_m(radius_m, pitch_m, turn_rad));
        }
        nearest_m
    }

    /// Circles about the origin in the plane z = 0: one slot in the centre, then 6, 12, 18, ... slots. Rings are
    /// `spacing_m` apart. Neighbours are `spacing_m` apart on the first ring and up to pi/3 times that on the others.
    /// An incomplete last ring is spread evenly.
    #[must_use]
    pub fn rings(count: usize, spacing_m: f64) -> Self {
        let inside = |ring: usize| if ring == 0 { 0 } else { 3 * ring * (ring - 1) + 1 };
        Self::from_fn(count, |i| {
            let ring = if i == 0 { 0 } else { (3 + (12 * i - 3).isqrt()) / 6 };
            let on_it = (6 * ring).min(count - inside(ring)).max(1);
            let (sin, cos) = libm::sincos(TAU * (i - inside(ring)) as f64 / on_it as f64);
            let radius_m = ring as f64 * spacing_m;
            Vector3::new(radius_m * cos, radius_m * sin, 0.0)
        })
    }

    /// Cubic grid from the origin, rows along x, layer on layer. It is as near to a cube as the number allows; the last
    /// row and layer may be incomplete.
    #[must_use]
    pub fn cube(count: usize, spacing_m: f64) -> Self {
        let columns = (1..=count).find(|side| side.saturating_pow(3) >= count).unwrap_or(1);
        let rows = (1..=columns).find(|rows| columns.saturating_mul(rows * rows) >= count).unwrap_or(columns);
        Self::from_fn(count, |i| {
            let (row, layer) = (i / columns % rows, i / (columns * rows));
            Vector3::new((i % columns) as f64, row as f64, layer as f64) * spacing_m
        })
    }
}

/// Returns the distance \[m\] of two points of a helix that differ by this turn.
fn chord_m(radius_m: f64, pitch_m: f64, turn_rad: f64) -> f64 {
    libm::hypot(2.0 * radius_m * libm::sin(0.5 * turn_rad), pitch_m * turn_rad / TAU)
}

#[cfg(test)]
mod tests {
    use super::*;
    use tautline_core::swarm::row;

    /// Rounding of a distance between two slots some dozen spacings from the origin, relative to the spacing.
    const ROUNDING: f64 = 1e-12;

    fn nearest_m(formation: &Formation) -> f64 {
        formation.min_distance().expect("two slots").1
    }

    #[test]
    fn the_nearest_slots_are_the_spacing_apart() {
        for count in [2, 3, 4, 5, 6, 7, 8, 19, 20, 25, 100, 137] {
            for spacing_m in [0.3, 2.0, 70.0] {
                let step_rad = Formation::helix_step_rad(3.0 * spacing_m, 1.2 * spacing_m, spacing_m).expect("a step");
                let shapes = [
                    Formation::v(count, spacing_m, NARROWEST_V_RAD),
                    Formation::v(count, spacing_m, 1.9),
                    Formation::v(count, spacing_m, PI),
                    Formation::wedge(count, spacing_m),
                    Formation::helix(count, 3.0 * spacing_m, 1.2 * spacing_m, step_rad),
                    Formation::rings(count, spacing_m),
                    Formation::cube(count, spacing_m),
                ];
                for (shape, formation) in shapes.iter().enumerate() {
                    assert_eq!(formation.count(), count);
                    let off = nearest_m(formation) / spacing_m - 1.0;
                    assert!(off.abs() < ROUNDING, "shape {shape} of {count}: off by {off:e}");
                }
            }
        }
    }

    #[test]
    fn a_too_narrow_v_has_slots_nearer_than_the_spacing() {
        assert!(nearest_m(&Formation::v(3, 2.0, 0.9 * NARROWEST_V_RAD)) < 1.9);
    }

    #[test]
    fn a_v_has_two_arms_in_its_angle() {
        let v = Formation::v(7, 2.0, 1.2).slots_m;
        assert_eq!(row(&v, 0), Vector3::zeros());
        assert!((row(&v, 5).angle(&row(&v, 6)) - 1.2).abs() < ROUNDING);
        assert!(row(&v, 5).y > 0.0 && (row(&v, 5).norm() - 6.0).abs() < ROUNDING && row(&v, 6).x < 0.0);
    }

    #[test]
    fn a_wedge_has_rows_of_1_2_3_and_a_centred_last_row() {
        let rows_of = |count| {
            let wedge = Formation::wedge(count, 1.0).slots_m;
            (0..count).map(|i| (-wedge[(i, 0)] / 0.75_f64.sqrt()).round()).collect::<Vec<_>>()
        };
        assert_eq!(rows_of(7), [0.0, 1.0, 1.0, 2.0, 2.0, 2.0, 3.0]);
        let eight = Formation::wedge(8, 1.0).slots_m;
        assert_eq!([eight[(6, 1)], eight[(7, 1)]], [0.5, -0.5]);
    }

    #[test]
    fn rings_have_1_6_12_slots_and_an_even_last_ring() {
        let rings = Formation::rings(1 + 6 + 12 + 3, 2.0);
        let radii: Vec<f64> = (0..22).map(|i| row(&rings.slots_m, i).norm().round()).collect();
        assert_eq!(radii, [vec![0.0], vec![2.0; 6], vec![4.0; 12], vec![6.0; 3]].concat());
        assert!((rings.desired_distance(19, 20) - rings.desired_distance(21, 19)).abs() < ROUNDING * 10.0);
    }

    #[test]
    fn a_helix_rises_by_its_pitch_and_gives_its_smallest_slot_distance() {
        let (radius_m, pitch_m) = (3.0, 0.5);
        let helix = Formation::helix(13, radius_m, pitch_m, TAU / 12.0);
        assert!((row(&helix.slots_m, 12) - Vector3::new(radius_m, 0.0, pitch_m)).norm() < ROUNDING);
        for (pitch_m, step_rad, count) in [(0.5, 0.4, 90), (2.0, 0.4, 90), (0.01, 1.0, 300), (1.0, PI, 9)] {
            let helix = Formation::helix(count, radius_m, pitch_m, step_rad);
            let known_m = Formation::helix_nearest_m(count, radius_m, pitch_m, step_rad);
            assert!((nearest_m(&helix) / known_m - 1.0).abs() < 1e-9, "{known_m}");
        }
        assert_eq!(Formation::helix_step_rad(1.0, 0.5, 2.1), None);
    }

    #[test]
    fn a_cube_has_equal_sides() {
        let cube = Formation::cube(1000, 2.0).slots_m;
        assert_eq!(row(&cube, 999), Vector3::repeat(18.0));
        assert_eq!(row(&Formation::cube(9, 1.0).slots_m, 8), Vector3::new(2.0, 0.0, 1.0));
        assert_eq!(row(&Formation::cube(13, 1.0).slots_m, 12), Vector3::new(0.0, 1.0, 1.0));
    }

    #[test]
    fn shapes_without_a_slot_are_empty() {
        let none =
            [Formation::v(0, 1.0, 2.0), Formation::wedge(0, 1.0), Formation::rings(0, 1.0), Formation::cube(0, 1.0)];
        assert!(none.iter().all(|formation| formation.count() == 0));
        assert_eq!(Formation::rings(1, 1.0).slots_m, Formation::cube(1, 1.0).slots_m);
    }
}
