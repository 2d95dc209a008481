//! Converts places on the Earth to metres east, north and up of an origin, on the ellipsoid of WGS 84.
//!
//! The conversion is exact, not a flat-map approximation: geodetic to Earth-centred coordinates, then to the frame of
//! the origin. A double resolves 1 nm at the distance of the Earth's radius.

use nalgebra::{Matrix3, Vector3};

use super::error::{ContentKind, Fault, quoted, refuse};
use super::options::ReadOptions;
use tautline_core::option::ORIGIN;
use tautline_core::track::EarthOrigin;

/// Semi-major axis a \[m\].
const EQUATOR_M: f64 = 6_378_137.0;

/// Flattening f = (a - b) / a.
const FLATTENING: f64 = 1.0 / 298.257_223_563;

/// Latitude and longitude \[degrees\], and height above the ellipsoid \[m\].
pub(super) type Geodetic = Vector3<f64>;

/// Frame of metres east, north and up of an origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EarthFrame {
    origin: Geodetic,
    centre_m: Vector3<f64>,
    /// Rows: east, north, up.
    axes: Matrix3<f64>,
}

impl EarthFrame {
    /// Returns the frame of an origin: latitude and longitude \[degrees\], and height above the ellipsoid \[m\].
    ///
    /// # Errors
    /// A sentence if the place is not on the Earth.
    pub fn new(origin: [f64; 3]) -> Result<Self, String> {
        Self::at(origin.into()).map_err(|fault| fault.to_string())
    }

    /// Converts a place, as in [`new`](Self::new), to metres east, north and up of the origin.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn position_m(&self, place: [f64; 3]) -> Result<Vector3<f64>, String> {
        self.place(place.into()).map_err(|fault| fault.to_string())
    }

    /// Converts a direction east, north and up at a place to this frame.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn direction_at(&self, place: [f64; 3], direction: Vector3<f64>) -> Result<Vector3<f64>, String> {
        Ok(self.direction_from(&Self::new(place)?, direction))
    }

    /// Returns the frame of this origin.
    pub(super) fn at(origin: Geodetic) -> Result<Self, Fault> {
        let centre_m = centred(origin)?;
        let [(north_sine, north_cosine), (east_sine, east_cosine)] = angles(origin);
        let east = Vector3::new(-east_sine, east_cosine, 0.0);
        let north = Vector3::new(-north_sine * east_cosine, -north_sine * east_sine, north_cosine);
        let up = Vector3::new(north_cosine * east_cosine, north_cosine * east_sine, north_sine);
        let axes = Matrix3::from_columns(&[east, north, up]).transpose();
        Ok(Self { origin, centre_m, axes })
    }

    /// Returns the frame of the user's origin, or of this first place.
    pub(super) fn first(place: Geodetic, options: &ReadOptions) -> Result<Self, Fault> {
        if let Some(origin) = options.origin {
            return Self::at(origin.into());
        }
        let local = Self::at(place)?;
        if !options.is_joined {
            return Ok(local);
        }
        // Other files would have other first places.
        let problem = "several files need one origin for their places on the Earth";
        let remedy = format!("set it with {ORIGIN}, such as {}", ORIGIN.set(local.origin()));
        refuse(ContentKind::NoOrigin, problem, remedy)
    }

    /// Converts a position relative to another origin \[m\] to this frame.
    pub(super) fn position_from(&self, other: &Self, place: Vector3<f64>) -> Vector3<f64> {
        if self == other {
            return place;
        }
        self.axes * (other.axes.transpose() * place + (other.centre_m - self.centre_m))
    }

    /// Converts a direction from the frame of another origin to this frame.
    pub(super) fn direction_from(&self, other: &Self, direction: Vector3<f64>) -> Vector3<f64> {
        if self == other { direction } else { self.axes * (other.axes.transpose() * direction) }
    }

    /// Moves the frame to this origin.
    pub(super) fn move_to(&mut self, origin: Geodetic) -> Result<(), Fault> {
        if self.origin != origin {
            *self = Self::at(origin)?;
        }
        Ok(())
    }

    /// Converts a place to east, north and up of the origin \[m\].
    pub(super) fn place(&self, place: Geodetic) -> Result<Vector3<f64>, Fault> {
        Ok(self.axes * (centred(place)? - self.centre_m))
    }

    /// Formats the origin as in `--origin`.
    pub(super) fn origin(&self) -> String {
        let [latitude, longitude, height] = self.origin.into();
        format!("{latitude:?},{longitude:?},{height:?}")
    }

    /// Returns the origin with a flag whether it was inferred.
    pub(super) fn measured_from(&self, given: Option<[f64; 3]>) -> EarthOrigin {
        EarthOrigin { place: self.origin.into(), is_inferred: given.is_none() }
    }

    /// Returns the note for the user.
    pub(super) fn note(&self) -> String {
        let origin = self.origin();
        let confirmed = ORIGIN.set(&origin);
        format!("positions are metres east, north and up of {origin} on WGS 84 (confirm with {confirmed})")
    }
}

/// Returns whether a place is the output of a receiver without a fix: latitude and longitude are exactly 0.
pub(super) fn is_no_fix(place: &Geodetic) -> bool {
    place.x == 0.0 && place.y == 0.0
}

/// Returns the note on `count` omitted rows or messages without a fix; `of` names the vehicles.
pub(super) fn no_fixes(count: u64, what: &str) -> Option<String> {
    let positions = if count == 1 { "position" } else { "positions" };
    (count > 0)
        .then(|| format!("{count} {positions}{what} omitted for lack of a fix: latitude and longitude are exactly 0"))
}

/// Returns sine and cosine of latitude and of longitude.
fn angles(place: Geodetic) -> [(f64, f64); 2] {
    [place.x, place.y].map(|degrees| libm::sincos(degrees.to_radians()))
}

/// Converts a place to the Earth-centred frame \[m\].
fn centred(place: Geodetic) -> Result<Vector3<f64>, Fault> {
    let range = |what: &str, value: f64, most: f64| -> Result<(), Fault> {
        if value.abs() <= most {
            return Ok(());
        }
        let problem = format!("{what} {} is outside of +-{most} degrees", quoted(&format!("{value:?}")));
        let remedy = "write decimal degrees; divide integers of 1e-7 degrees by 1e7";
        refuse(ContentKind::NotOnEarth, problem, remedy)
    };
    range("latitude", place.x, 90.0)?;
    range("longitude", place.y, 360.0)?;
    let [(sine, cosine), (east_sine, east_cosine)] = angles(place);
    let squash = (1.0 - FLATTENING) * (1.0 - FLATTENING);
    let curvature_m = EQUATOR_M / (cosine * cosine + squash * sine * sine).sqrt();
    let from_axis_m = (curvature_m + place.z) * cosine;
    Ok(Vector3::new(from_axis_m * east_cosine, from_axis_m * east_sine, (squash * curvature_m + place.z) * sine))
}

#[cfg(test)]
mod tests {
    use nalgebra::vector;

    use super::*;

    /// Semi-minor axis b \[m\].
    const POLE_M: f64 = EQUATOR_M * (1.0 - FLATTENING);

    /// Two units in the last place of an Earth-centred coordinate.
    const ROUNDING_M: f64 = 2e-9;

    /// Computes Earth-centred coordinates by the reduced latitude, with the system's functions.
    fn by_reduced_latitude(place: Geodetic) -> Vector3<f64> {
        let (latitude, longitude) = (place.x.to_radians(), place.y.to_radians());
        let reduced = (POLE_M * latitude.sin()).atan2(EQUATOR_M * latitude.cos());
        let from_axis = EQUATOR_M * reduced.cos() + place.z * latitude.cos();
        let along = POLE_M * reduced.sin() + place.z * latitude.sin();
        vector![from_axis * longitude.cos(), from_axis * longitude.sin(), along]
    }

    /// Inverts the conversion by iteration.
    fn geodetic(centred: Vector3<f64>) -> Geodetic {
        let squash = (1.0 - FLATTENING) * (1.0 - FLATTENING);
        let from_axis = centred.x.hypot(centred.y);
        let mut latitude = centred.z.atan2(squash * from_axis);
        for _ in 0..20 {
            let curvature = EQUATOR_M / (1.0 - (1.0 - squash) * latitude.sin().powi(2)).sqrt();
            latitude = (centred.z + (1.0 - squash) * curvature * latitude.sin()).atan2(from_axis);
        }
        let curvature = EQUATOR_M / (1.0 - (1.0 - squash) * latitude.sin().powi(2)).sqrt();
        let (sine, cosine) = latitude.sin_cos();
        let height = from_axis * cosine + centred.z * sine - curvature * (1.0 - (1.0 - squash) * sine * sine);
        vector![latitude.to_degrees(), centred.y.atan2(centred.x).to_degrees(), height]
    }

    fn places() -> impl Iterator<Item = Geodetic> {
        let latitudes = [-90.0, -89.999_999, -47.3, -1e-9, 0.0, 12.5, 47.397_742, 89.999_999, 90.0];
        let longitudes = [-180.0, -122.4, -1e-9, 0.0, 8.545_594, 179.999_999_9, 180.0];
        let heights = [-400.0, 0.0, 488.0, 9000.0];
        latitudes.into_iter().flat_map(move |latitude| {
            longitudes.into_iter().flat_map(move |longitude| heights.map(|height| vector![latitude, longitude, height]))
        })
    }

    #[test]
    fn conversion_agrees_with_independent_formula_and_inverse() {
        for place in places() {
            let found = centred(place).expect("a place");
            assert!((found - by_reduced_latitude(place)).norm() < 2.0 * ROUNDING_M, "{place}");
            let back = by_reduced_latitude(geodetic(found));
            assert!((found - back).norm() < 2.0 * ROUNDING_M, "{place}: {}", (found - back).norm());
        }
    }

    #[test]
    fn local_frame_is_a_rotation_and_a_shift() {
        let all: Vec<_> = places().collect();
        for origin in &all {
            let local = EarthFrame::at(*origin).expect("a place");
            assert_eq!(local.place(*origin).expect("a place"), Vector3::zeros());
            assert!((local.axes * local.axes.transpose() - Matrix3::identity()).norm() < 1e-15);
            assert!((local.axes.determinant() - 1.0).abs() < 1e-15);
            let above = local.place(origin + vector![0.0, 0.0, 100.0]).expect("a place");
            assert!((above - vector![0.0, 0.0, 100.0]).norm() < 3.0 * ROUNDING_M, "{origin}: {above}");
        }
    }

    #[test]
    fn positions_keep_their_place_when_the_origin_changes() {
        let (here, other) = (vector![47.0, 8.0, 400.0], vector![47.01, 8.02, 450.0]);
        let [here, other] = [here, other].map(|place| EarthFrame::at(place).expect("a place"));
        let place = vector![47.011, 8.019, 470.0];
        let moved = here.position_from(&other, other.place(place).expect("a place"));
        assert!((moved - here.place(place).expect("a place")).norm() < 4.0 * ROUNDING_M, "{moved}");
        let step = here.position_from(&other, vector![1.0, 2.0, 3.0]) - here.position_from(&other, Vector3::zeros());
        assert!((here.direction_from(&other, vector![1.0, 2.0, 3.0]) - step).norm() < ROUNDING_M);
    }

    #[test]
    fn arc_seconds_match_the_radii_of_curvature() {
        let origin = vector![47.0, 8.0, 0.0];
        let local = EarthFrame::at(origin).expect("a place");
        let second = 1.0 / 3600.0;
        let squared = FLATTENING * (2.0 - FLATTENING);
        let sine = 47.0_f64.to_radians().sin();
        let across = EQUATOR_M / (1.0 - squared * sine * sine).sqrt();
        let along = across * (1.0 - squared) / (1.0 - squared * sine * sine);
        let east = local.place(origin + vector![0.0, second, 0.0]).expect("a place");
        let north = local.place(origin + vector![second, 0.0, 0.0]).expect("a place");
        let arc = second.to_radians();
        assert!((east.x - across * 47.0_f64.to_radians().cos() * arc).abs() < 1e-6 && east.y.abs() < 1e-3, "{east}");
        assert!((north.y - along * arc).abs() < 1e-6 && north.x.abs() < ROUNDING_M, "{north}");
    }

    #[test]
    fn antimeridian_and_poles_need_no_special_case() {
        let local = EarthFrame::at(vector![0.0, 179.999_99, 0.0]).expect("a place");
        let over = local.place(vector![0.0, -179.999_99, 0.0]).expect("a place");
        assert!((over.x - 2.0e-5_f64.to_radians() * EQUATOR_M).abs() < 1e-6, "{over}");
        let pole = EarthFrame::at(vector![90.0, 0.0, 0.0]).expect("a place");
        let turned = pole.place(vector![90.0, 123.0, 0.0]).expect("a place");
        assert!(turned.norm() < ROUNDING_M, "every longitude is the pole: {turned}");
    }

    #[test]
    fn places_off_the_earth_are_refused() {
        for place in [vector![90.1, 0.0, 0.0], vector![473_977_420.0, 0.0, 0.0], vector![f64::NAN, 0.0, 0.0]] {
            assert!(EarthFrame::at(place).is_err(), "{place}");
        }
        assert!(EarthFrame::at(vector![0.0, 360.1, 0.0]).is_err());
    }
}
