//! Comparison of two positions of each vehicle in one table: in metres, and as latitude and longitude.
//!
//! Both describe one motion if a turn about the vertical and a shift, common to all vehicles and times, bring one onto
//! the other. Positions from each vehicle's own start have no common shift. The plane and the heights are compared
//! apart, because heights may come from different sensors.

use nalgebra::{Matrix2, Vector2, Vector3};
use tautline_core::fact::{Fact, FactKind, Source};
use tautline_core::option::COLUMN;

use super::earth::{EarthFrame, Geodetic};
use super::error::{ContentKind, Fault, list, quoted};

/// Largest error of the difference of two fixes \[m\]: an uncorrected receiver is within 5 m (95 %).
const LARGEST_ERROR_M: f64 = 10.0;

/// Smallest difference of two shifts that is evidence \[m\]: local origins are converted with errors of this size.
const SMALLEST_EVIDENCE_M: f64 = 0.5;

/// Largest part of the tolerance of two shifts that follows the noise \[m\].
const MOST_NOISE_M: f64 = 2.5;

/// Largest root mean square deviation of the rows of a vehicle \[m\]: twice that of an uncorrected receiver.
const LARGEST_RESIDUAL_M: f64 = 5.0;

/// Largest difference of two shifts of heights \[m\]: one height may be barometric, the other from a receiver.
const HEIGHT_EVIDENCE_M: f64 = 5.0;

/// Largest relative error of differences of barometric heights: 15 K beside the standard atmosphere.
const BAROMETRIC: f64 = 0.05;

/// Largest relative error of lengths of a map projection. The scale of UTM differs from 1 by 0.0004.
const PROJECTION: f64 = 1e-3;

/// Radius of the Earth \[m\].
const EARTH_M: f64 = 6.371e6;

/// Returns how far a plane is from the surface of the Earth, at this distance from the point of contact \[m\].
fn curvature_m(distance_m: f64) -> f64 {
    distance_m * distance_m / (2.0 * EARTH_M)
}

/// Sums over the rows of a vehicle. Positions are counted from the first position of the table.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    count: f64,
    metric: Vector2<f64>,
    earth: Vector2<f64>,
    metric_squared: f64,
    earth_squared: f64,
    /// Sum of `earth * metric^T`.
    products: Matrix2<f64>,
    /// First positions.
    first: [Vector2<f64>; 2],
    heights: Heights,
}

/// Sums over the rows of a vehicle with both heights.
#[derive(Clone, Copy, Debug, Default)]
struct Heights {
    count: f64,
    metric: f64,
    earth: f64,
    products: f64,
    first: [f64; 2],
}

impl Sums {
    fn add(&mut self, other: &Self) {
        self.count += other.count;
        self.metric += other.metric;
        self.earth += other.earth;
        self.metric_squared += other.metric_squared;
        self.earth_squared += other.earth_squared;
        self.products += other.products;
        self.heights.count += other.heights.count;
        self.heights.metric += other.heights.metric;
        self.heights.earth += other.heights.earth;
        self.heights.products += other.heights.products;
    }

    /// Returns the products about the means.
    fn covariance(&self) -> Matrix2<f64> {
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

    /// Returns the root mean square deviation after this turn and the best shift of this vehicle \[m\].
    fn residual_m(&self, turn: &Matrix2<f64>) -> f64 {
        let turned = 2.0 * (turn.transpose() * self.covariance()).trace();
        ((self.squares() - turned).max(0.0) / self.count).sqrt()
    }

    /// Returns the shift from the turned mean position in metres to the mean place on the Earth.
    fn shift(&self, turn: &Matrix2<f64>) -> Vector2<f64> {
        (self.earth - turn * self.metric) / self.count
    }
}

/// Returns the turn, perhaps mirrored, that aligns the metric position best with the place on the Earth. Also returns
/// the products that the turn aligns.
fn alignment(covariance: &Matrix2<f64>) -> Option<(Matrix2<f64>, f64)> {
    let across = covariance.svd(true, true);
    Some((across.u? * across.v_t?, across.singular_values.sum()))
}

/// Contradiction of the two positions in a row: distances of a vehicle from its first position, or a place that is not
/// on the Earth.
#[derive(Debug)]
pub(super) enum RowContradiction {
    /// Distances in metres and on the Earth, and their direction.
    Distance([f64; 2], &'static str),
    NotOnEarth(Fault),
}

/// Largest difference in relation to its tolerance.
#[derive(Clone, Copy, Debug)]
struct Worst {
    vehicles: [usize; 2],
    difference_m: f64,
    tolerance_m: f64,
}

impl Worst {
    fn is_contradiction(&self) -> bool {
        self.difference_m > self.tolerance_m
    }

    /// Returns the one of both that exceeds its tolerance by more.
    fn or(self, known: Option<Self>) -> Self {
        let excess_m = |worst: &Self| worst.difference_m - worst.tolerance_m;
        known.filter(|known| excess_m(known) >= excess_m(&self)).unwrap_or(self)
    }
}

/// Returns the worst pair of vehicles; `compare` returns difference and tolerance of two of them \[m\].
fn worst_pair<T>(shifts: &[(usize, T)], compare: impl Fn(&T, &T) -> (f64, f64)) -> Option<Worst> {
    let mut worst = None;
    for (k, (first, shift)) in shifts.iter().enumerate() {
        for (second, other) in &shifts[k + 1..] {
            let (difference_m, tolerance_m) = compare(shift, other);
            worst = Some(Worst { vehicles: [*first, *second], difference_m, tolerance_m }.or(worst));
        }
    }
    worst
}

/// Comparison over all rows.
#[derive(Debug, Default)]
pub(super) struct FrameAgreement {
    vehicles: Vec<Sums>,
    /// Frame of the first place, its height, and the metric position there.
    origin: Option<(EarthFrame, f64, Vector3<f64>)>,
}

impl FrameAgreement {
    /// Records both positions in a row of a vehicle. `has_heights`: whether both have a height.
    pub(super) fn observe(
        &mut self,
        vehicle: usize,
        metric: Vector3<f64>,
        place: Geodetic,
        has_heights: bool,
    ) -> Result<(), RowContradiction> {
        let (local, height, origin) = if let Some(origin) = self.origin {
            origin
        } else {
            let local = EarthFrame::at(place).map_err(RowContradiction::NotOnEarth)?;
            *self.origin.insert((local, place.z, metric))
        };
        // Without a height, the place is taken at the height of the first one.
        let place = if has_heights { place } else { Vector3::new(place.x, place.y, height) };
        let earth = local.place(place).map_err(RowContradiction::NotOnEarth)?.xy();
        if vehicle >= self.vehicles.len() {
            self.vehicles.resize(vehicle + 1, Sums::default());
        }
        let sums = &mut self.vehicles[vehicle];
        let (metric, metric_up, earth_up) = ((metric - origin).xy(), metric.z - origin.z, place.z);
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
        let longest_m = far[0].max(far[1]);
        if (far[0] - far[1]).abs() > LARGEST_ERROR_M + PROJECTION * longest_m {
            return Err(RowContradiction::Distance(far, "from its first position in the plane"));
        }
        if !has_heights {
            return Ok(());
        }
        let heights = &mut sums.heights;
        if heights.count == 0.0 {
            heights.first = [metric_up, earth_up];
        }
        heights.count += 1.0;
        heights.metric += metric_up;
        heights.earth += earth_up;
        heights.products += earth_up * metric_up;
        let risen = [metric_up - heights.first[0], earth_up - heights.first[1]].map(f64::abs);
        let most_m = LARGEST_ERROR_M + BAROMETRIC * risen[0].max(risen[1]) + curvature_m(longest_m);
        if (risen[0] - risen[1]).abs() > most_m {
            return Err(RowContradiction::Distance(risen, "above or below its first position"));
        }
        Ok(())
    }

    fn seen(&self) -> impl Iterator<Item = (usize, &Sums)> + Clone {
        self.vehicles.iter().enumerate().filter(|(_, sums)| sums.count > 0.0)
    }

    fn total(&self) -> Sums {
        let mut all = Sums::default();
        self.seen().for_each(|(_, sums)| all.add(sums));
        all
    }

    /// Returns the worst pair by the shifts in the plane that a common turn leaves.
    fn worst_in_plane(&self, all: &Sums, turn: &Matrix2<f64>) -> Option<Worst> {
        let noise = self.seen().map(|(_, sums)| sums.count * sums.noise_m().powi(2)).sum::<f64>() / all.count;
        let evidence_m = SMALLEST_EVIDENCE_M + noise.sqrt().min(MOST_NOISE_M);
        let shifts = self.seen().map(|(vehicle, sums)| (vehicle, (sums.shift(turn), sums.earth / sums.count)));
        worst_pair(&shifts.collect::<Vec<_>>(), |(shift, mean), (other_shift, other_mean)| {
            ((shift - other_shift).norm(), evidence_m + PROJECTION * (mean - other_mean).norm())
        })
    }

    /// Returns the worst pair by the differences between its heights.
    fn worst_in_height(&self, all: &Sums) -> Option<Worst> {
        let all = all.heights;
        let up = 1.0_f64.copysign(all.products - all.earth * all.metric / all.count);
        let with_heights = self.seen().filter(|(_, sums)| sums.heights.count > 0.0);
        let shifts = with_heights.map(|(vehicle, sums)| {
            let Heights { count, metric, earth, .. } = sums.heights;
            (vehicle, ((earth - up * metric) / count, earth / count, sums.earth / sums.count))
        });
        worst_pair(&shifts.collect::<Vec<_>>(), |(shift, height, mean), (other_shift, other_height, other_mean)| {
            let of_sensors_m = HEIGHT_EVIDENCE_M + BAROMETRIC * (height - other_height).abs();
            ((shift - other_shift).abs(), of_sensors_m + curvature_m((mean - other_mean).norm()))
        })
    }

    /// Returns the vehicle whose rows deviate most after a common turn and its own shift.
    fn worst_motion(&self, turn: &Matrix2<f64>) -> Option<Worst> {
        self.seen().fold(None, |worst, (vehicle, sums)| {
            let evidence_m = (SMALLEST_EVIDENCE_M + 2.0 * sums.noise_m()).min(LARGEST_RESIDUAL_M);
            let tolerance_m = evidence_m + PROJECTION * (sums.squares() / sums.count).sqrt();
            let motion = Worst { vehicles: [vehicle; 2], difference_m: sums.residual_m(turn), tolerance_m };
            Some(motion.or(worst))
        })
    }

    /// Returns the worst pair in the plane, the worst pair in height, and the worst motion of a vehicle.
    fn worst(&self) -> [Option<Worst>; 3] {
        let all = self.total();
        let turn = alignment(&all.covariance()).map(|(turn, _)| turn).filter(|_| self.seen().count() > 1);
        turn.map_or([None; 3], |turn| {
            [self.worst_in_plane(&all, &turn), self.worst_in_height(&all), self.worst_motion(&turn)]
        })
    }

    /// Returns the fault of positions without a common frame.
    pub(super) fn fault(&self, names: &[String], header: &[String], columns: &Compared) -> Option<Fault> {
        let [plane, height, motion] = self.worst().map(|worst| worst.filter(Worst::is_contradiction));
        let called = |vehicle: usize| quoted(names.get(vehicle).map_or("", String::as_str));
        let (metric, earth) = columns.names(header);
        let said = |worst: Worst, what: &str, remains: &str| {
            let [first, second] = worst.vehicles.map(called);
            let vehicles =
                if first == second { format!("vehicle {first}") } else { format!("vehicles {first} and {second}") };
            let Worst { difference_m, tolerance_m, .. } = worst;
            format!(
                "{metric} and {earth} give different {what} {vehicles}: {remains} {difference_m:.3} m, and at most \
                 {tolerance_m:.3} m is tolerated"
            )
        };
        let problem = if let Some(worst) = plane {
            said(worst, "distances between", "a common origin and direction leave a difference of")
        } else if let Some(worst) = height {
            said(worst, "differences of height between", "a common origin leaves a difference of")
        } else {
            said(motion?, "motions of", "a common direction leaves a root mean square deviation of")
        };
        Some(columns.fault(problem, header))
    }

    /// Returns the largest tolerances with which the positions were compared.
    pub(super) fn fact(&self) -> Fact {
        match self.worst() {
            [Some(plane), height, _] => {
                let plane = format!("metres agree with degrees within {:.3} m in the plane", plane.tolerance_m);
                let height = height.map(|worst| format!(" and {:.3} m in height", worst.tolerance_m));
                Fact::name(FactKind::Frame, Source::Observed, plane + &height.unwrap_or_default())
            }
            _ if self.seen().next().is_some() => {
                let said = format!("metres agree with degrees within {LARGEST_ERROR_M:?} m of the first position");
                Fact::name(FactKind::Frame, Source::Observed, said)
            }
            _ => Fact::name(FactKind::Frame, Source::NotObservable, "no row has both metres and degrees"),
        }
    }

    /// Returns the notes on the comparison.
    pub(super) fn notes(&self, names: &[String]) -> Vec<String> {
        const LISTED: usize = 12;
        let is_seen = |vehicle: usize| self.vehicles.get(vehicle).is_some_and(|sums| sums.count > 0.0);
        let unseen = names.iter().enumerate().filter(|(vehicle, _)| !is_seen(*vehicle));
        let unseen: Vec<_> = unseen.map(|(_, name)| name).collect();
        let mut notes: Vec<_> = self.fact().value.map(|value| value.to_string()).into_iter().collect();
        if !unseen.is_empty() && unseen.len() < names.len() {
            notes.push(format!("positions in metres are not compared with degrees for {}", list(&unseen, LISTED)));
        }
        notes
    }
}

/// Columns of both positions of a vehicle: in metres, and on the Earth with a height if both positions have one.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Compared {
    pub(super) metric: [Option<usize>; 3],
    pub(super) earth: [Option<usize>; 3],
    /// Factors of the columns on the Earth \[degrees or m\].
    pub(super) units: [f64; 3],
    /// Whether the names of the columns in metres give directions, which columns chosen by the user do not have.
    pub(super) has_directions: bool,
    /// Whether the header names several vehicles, whose columns the user cannot choose by role.
    pub(super) is_wide: bool,
}

impl Compared {
    /// Returns the names of the columns in metres, and of those on the Earth.
    fn names(&self, header: &[String]) -> (String, String) {
        let listed = |columns: &[Option<usize>; 3]| {
            list(&columns.iter().flatten().map(|&column| &*header[column]).collect::<Vec<_>>(), 3)
        };
        (listed(&self.metric), listed(&self.earth))
    }

    /// Returns the fault of a row with contradicting positions.
    pub(super) fn fault_of_row(&self, header: &[String], name: &str, found: &RowContradiction) -> Fault {
        let ((metric, earth), name) = (self.names(header), quoted(name));
        let problem = match found {
            RowContradiction::Distance([by_metric, by_earth], direction) => {
                format!("vehicle {name} is {by_metric:.3} m {direction} by {metric}, but {by_earth:.3} m by {earth}")
            }
            RowContradiction::NotOnEarth(fault) => {
                format!("vehicle {name} has a position by {metric}, but {earth} are not a place on the Earth: {fault}")
            }
        };
        self.fault(problem, header)
    }

    /// Returns the fault of two positions that need a choice.
    pub(super) fn fault(&self, problem: String, header: &[String]) -> Fault {
        let chosen = |columns: &[Option<usize>; 3], roles: [&str; 3]| {
            let given = columns.iter().zip(roles).filter_map(|(column, role)| Some((role, (*column)?)));
            let named = |(role, column): (&str, usize)| COLUMN.set(format!("{role}={}", header[column])).to_string();
            let given: Vec<_> = given.map(named).collect();
            format!("with {}", given.join(" "))
        };
        let (metric, earth) = self.names(header);
        let (metric, earth) = if self.is_wide {
            let removing = |kind: &str, names: &str| format!("by removing all columns in {kind}, such as {names}");
            (removing("degrees", &earth), removing("metres", &metric))
        } else if self.has_directions {
            let degrees = chosen(&self.earth, ["lat", "lon", "alt"]);
            (format!("by removing the columns {earth}"), degrees)
        } else {
            (chosen(&self.metric, ["x", "y", "z"]), chosen(&self.earth, ["lat", "lon", "alt"]))
        };
        let remedy = format!("choose the positions that have one origin for all vehicles, {metric}, or {earth}");
        Fault::content(ContentKind::SeveralFrames, problem, remedy)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix3, Rotation3, vector};

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
                if agreement.observe(vehicle, metric, place, true).is_err() {
                    return true;
                }
            }
        }
        agreement.worst().iter().flatten().any(Worst::is_contradiction)
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
            assert!(contradicts([Vector3::zeros(), vector![0.0, 8.0, 0.0]], rotation, 2.0), "noise hides no home");
            assert!(contradicts([Vector3::zeros(), vector![0.0, 0.0, 8.0]], rotation, 0.0));
            assert!(!contradicts([Vector3::zeros(), vector![0.0, 0.0, 3.0]], rotation, 0.0), "barometric heights");
        }
    }

    #[test]
    fn another_unit_of_length_is_a_contradiction() {
        assert!(contradicts([Vector3::zeros(); 2], Matrix3::identity() * 3.28, 0.0));
    }
}
