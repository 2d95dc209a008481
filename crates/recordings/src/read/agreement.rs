//! Comparison of two positions of each vehicle in one table: in metres, and as latitude and longitude.
//!
//! Both describe one motion if a turn about the vertical and a shift, common to all vehicles and times, bring one onto
//! the other. Positions from each vehicle's own start have no common shift.

use nalgebra::{Matrix3, Vector3};

use super::earth::{Geodetic, LocalFrame};
use super::error::{Fault, quoted};

/// Largest error of the difference of two fixes \[m\]: an uncorrected receiver is within 5 m (95 %).
const LARGEST_ERROR_M: f64 = 10.0;

/// Smallest difference that is evidence \[m\]: local origins are converted with errors of this size.
const SMALLEST_EVIDENCE_M: f64 = 0.5;

/// Largest relative error of lengths of a map projection. The scale of UTM differs from 1 by 0.0004.
const PROJECTION: f64 = 1e-3;

/// Columns of the second position of a vehicle: latitude, longitude, and height if both positions have one.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct SecondPosition {
    pub(super) columns: [Option<usize>; 3],
    /// Factors of its columns \[degrees or m\].
    pub(super) units: [f64; 3],
}

/// Sums over the rows of a vehicle. Positions are counted from the first position of the table.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    count: f64,
    metric: Vector3<f64>,
    earth: Vector3<f64>,
    metric_squared: f64,
    earth_squared: f64,
    /// Sum of `earth * metric^T`.
    products: Matrix3<f64>,
    /// First positions.
    first: [Vector3<f64>; 2],
}

impl Sums {
    fn add(&mut self, other: &Self) {
        self.count += other.count;
        self.metric += other.metric;
        self.earth += other.earth;
        self.metric_squared += other.metric_squared;
        self.earth_squared += other.earth_squared;
        self.products += other.products;
    }

    /// Returns the products about the means.
    fn covariance(&self) -> Matrix3<f64> {
        self.products - self.earth * self.metric.transpose() / self.count
    }

    /// Returns the sum of squares of both positions about their means.
    fn squares(&self) -> f64 {
        let means = (self.metric.norm_squared() + self.earth.norm_squared()) / self.count;
        (self.metric_squared + self.earth_squared - means).max(0.0)
    }

    /// Returns the root mean square deviation after the best turn and shift of this vehicle alone \[m\].
    fn noise_m(&self) -> f64 {
        let aligned = alignment(&self.covariance()).map_or(0.0, |(_, aligned)| 2.0 * aligned);
        ((self.squares() - aligned).max(0.0) / self.count).sqrt()
    }
}

/// Returns the turn about the vertical, perhaps mirrored, that aligns the metric position best with the place on the
/// Earth. Also returns the products that the turn aligns.
fn alignment(covariance: &Matrix3<f64>) -> Option<(Matrix3<f64>, f64)> {
    let across = covariance.fixed_view::<2, 2>(0, 0).into_owned().svd(true, true);
    let up = covariance[(2, 2)];
    let mut turn = Matrix3::identity();
    turn.fixed_view_mut::<2, 2>(0, 0).copy_from(&(across.u? * across.v_t?));
    turn[(2, 2)] = 1.0_f64.copysign(up);
    Some((turn, across.singular_values.sum() + up.abs()))
}

/// Comparison over all rows.
#[derive(Debug, Default)]
pub(super) struct FrameAgreement {
    vehicles: Vec<Sums>,
    /// Frame of the first place, and the metric position there.
    origin: Option<(LocalFrame, Vector3<f64>)>,
}

impl FrameAgreement {
    /// Restarts at the first row.
    pub(super) fn rewind(&mut self) {
        *self = Self::default();
    }

    /// Records both positions in a row of a vehicle. Returns the distances from its first position in metres and on
    /// the Earth, if they contradict each other.
    pub(super) fn observe(&mut self, vehicle: usize, metric: Vector3<f64>, place: Geodetic) -> Option<[f64; 2]> {
        if self.origin.is_none() {
            self.origin = Some((LocalFrame::at(place).ok()?, metric));
        }
        let (local, origin) = self.origin?;
        let earth = local.place(place).ok()?;
        let metric = metric - origin;
        if vehicle >= self.vehicles.len() {
            self.vehicles.resize(vehicle + 1, Sums::default());
        }
        let sums = &mut self.vehicles[vehicle];
        if sums.count == 0.0 {
            sums.first = [metric, earth];
        }
        sums.count += 1.0;
        sums.metric += metric;
        sums.earth += earth;
        sums.metric_squared += metric.norm_squared();
        sums.earth_squared += earth.norm_squared();
        sums.products += earth * metric.transpose();
        let [first, first_earth] = sums.first;
        let far = [(metric - first).norm(), (earth - first_earth).norm()];
        let largest_m = LARGEST_ERROR_M + PROJECTION * far[0].max(far[1]);
        ((far[0] - far[1]).abs() > largest_m).then_some(far)
    }

    /// Returns the vehicle with the largest deviation after the best common turn and shift, and the deviation \[m\],
    /// if it contradicts a common frame.
    fn contradiction(&self) -> Option<(usize, f64)> {
        let seen = || self.vehicles.iter().enumerate().filter(|(_, sums)| sums.count > 0.0);
        let mut all = Sums::default();
        seen().for_each(|(_, sums)| all.add(sums));
        if seen().count() < 2 {
            return None;
        }
        let (turn, _) = alignment(&all.covariance())?;
        let noise = seen().map(|(_, sums)| sums.count * sums.noise_m().powi(2)).sum::<f64>() / all.count;
        let extent_m = (all.squares() / all.count).sqrt();
        let evidence_m = (2.0 * noise.sqrt()).clamp(SMALLEST_EVIDENCE_M, LARGEST_ERROR_M) + PROJECTION * extent_m;
        let deviation_m = |sums: &Sums| {
            let shift = (sums.earth / sums.count - all.earth / all.count)
                - turn * (sums.metric / sums.count - all.metric / all.count);
            let turned = 2.0 * (turn.transpose() * sums.covariance()).trace();
            (shift.norm_squared() + (sums.squares() - turned).max(0.0) / sums.count).sqrt()
        };
        let worst = seen().map(|(vehicle, sums)| (vehicle, deviation_m(sums))).max_by(|a, b| a.1.total_cmp(&b.1));
        worst.filter(|(_, deviation_m)| *deviation_m > evidence_m)
    }

    /// Returns the fault of positions without a common frame.
    pub(super) fn fault(&self, names: &[String], header: &[String], columns: &Compared) -> Option<Fault> {
        let (vehicle, deviation_m) = self.contradiction()?;
        let name = quoted(names.get(vehicle).map_or("", String::as_str));
        let (metric, earth) = columns.names(header);
        let problem = format!(
            "{metric} and {earth} give different distances between vehicles: no common origin and direction brings \
             them closer than {deviation_m:.3} m at vehicle {name}"
        );
        Some(columns.fault(problem, header))
    }
}

/// Columns of both positions of a vehicle.
pub(super) struct Compared {
    pub(super) metric: [Option<usize>; 3],
    pub(super) earth: [Option<usize>; 3],
    /// Whether the names of the columns in metres give directions, which columns chosen by the user do not have.
    pub(super) has_directions: bool,
}

impl Compared {
    /// Returns the names of the columns in metres, and of those on the Earth.
    fn names(&self, header: &[String]) -> (String, String) {
        let listed = |columns: &[Option<usize>; 3]| {
            let names: Vec<_> = columns.iter().flatten().map(|&column| quoted(&header[column])).collect();
            names.join(", ")
        };
        (listed(&self.metric), listed(&self.earth))
    }

    /// Returns the fault of a row with contradicting distances from the vehicle's first position.
    pub(super) fn fault_of_row(&self, header: &[String], name: &str, far_m: [f64; 2]) -> Fault {
        let (metric, earth) = self.names(header);
        let (name, [by_metric, by_earth]) = (quoted(name), far_m);
        let problem = format!(
            "vehicle {name} is {by_metric:.3} m from its first position by {metric}, but {by_earth:.3} m by {earth}"
        );
        self.fault(problem, header)
    }

    /// Returns the fault of two positions that need a choice.
    pub(super) fn fault(&self, problem: String, header: &[String]) -> Fault {
        let chosen = |columns: &[Option<usize>; 3], roles: [&str; 3]| {
            let given = columns.iter().zip(roles).filter_map(|(column, role)| Some((role, (*column)?)));
            let given: Vec<_> = given.map(|(role, column)| format!("--column {role}={}", header[column])).collect();
            given.join(" ")
        };
        let metric = if self.has_directions {
            format!("by removing the columns {}", self.names(header).1)
        } else {
            format!("with {}", chosen(&self.metric, ["x", "y", "z"]))
        };
        let earth = chosen(&self.earth, ["lat", "lon", "alt"]);
        let remedy = format!("choose the positions that have one origin for all vehicles, {metric}, or with {earth}");
        Fault::coded("recording/several-frames", problem, remedy)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Rotation3, vector};

    use super::*;

    /// Returns whether positions of two vehicles are contradictory; `homes` are the origins of x, y and z.
    fn contradicts(homes: [Vector3<f64>; 2], rotation: Matrix3<f64>, noise_m: f64) -> bool {
        let mut agreement = FrameAgreement::default();
        for k in 0..200_u32 {
            let s = f64::from(k) / 10.0;
            let wave = noise_m * libm::sin(7.0 * s);
            for (vehicle, home) in homes.iter().enumerate() {
                let side = if vehicle == 0 { 1.0 } else { -1.0 };
                let true_m = vector![side * (s - 10.0), 3.0 * side + wave, 5.0 + libm::sin(s)];
                let metric = rotation * (true_m - home);
                let degree_m = 111_194.93;
                let place = vector![(true_m.y + wave) / degree_m, true_m.x / degree_m, true_m.z];
                if agreement.observe(vehicle, metric, place).is_some() {
                    return true;
                }
            }
        }
        agreement.contradiction().is_some()
    }

    #[test]
    fn rotations_and_mirrored_axes_are_one_frame() {
        let ned = Matrix3::new(0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0);
        let turned = Rotation3::from_euler_angles(0.0, 0.0, 0.7).into_inner();
        let home = vector![100.0, -50.0, 4.0];
        for rotation in [Matrix3::identity(), ned, turned, Matrix3::from_diagonal(&vector![1.0, 1.0, -1.0])] {
            assert!(!contradicts([home; 2], rotation, 0.0));
            assert!(!contradicts([home; 2], rotation, 2.0), "noise of receivers");
            assert!(contradicts([Vector3::zeros(), vector![0.0, 10.0, 0.0]], rotation, 0.0));
            assert!(contradicts([Vector3::zeros(), vector![0.0, 1.2, 0.0]], rotation, 0.0));
            assert!(contradicts([Vector3::zeros(), vector![0.0, 0.0, 1.2]], rotation, 0.0));
        }
    }

    #[test]
    fn another_unit_of_length_is_a_contradiction() {
        assert!(contradicts([Vector3::zeros(); 2], Matrix3::identity() * 3.28, 0.0));
    }
}
