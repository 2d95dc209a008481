//! Places on the Earth in metres east, north and up of an origin, on the ellipsoid of WGS 84.
//!
//! The way is exact and not that of a flat map: to coordinates around the centre of the Earth, and from there into the
//! frame of the origin. A double resolves 1 nm at that distance, and so do the places.

use nalgebra::{Matrix3, Vector3};

use super::axes;
use super::axes::GLOBAL;
use super::error::{Fault, ReadError, quoted, refuse};
use super::layout::Layout;
use super::options::ReadOptions;
use super::order::Row;
use super::table::{Cells, number, vector};
use tautline_core::track::EarthOrigin;

/// Half the equator's diameter \[m\].
const EQUATOR_M: f64 = 6_378_137.0;

/// How much shorter the axis is.
const FLATTENING: f64 = 1.0 / 298.257_223_563;

/// Latitude and longitude \[degrees\], and height above the ellipsoid \[m\].
pub(super) type Geodetic = Vector3<f64>;

/// The frame of an origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Local {
    origin: Geodetic,
    centre_m: Vector3<f64>,
    /// Rows: east, north, up.
    axes: Matrix3<f64>,
}

impl Local {
    /// The frame that is there.
    pub(super) fn at(origin: Geodetic) -> Result<Self, Fault> {
        let centre_m = centred(origin)?;
        let [(north_sine, north_cosine), (east_sine, east_cosine)] = angles(origin);
        let axes = Matrix3::new(
            -east_sine,
            east_cosine,
            0.0,
            -north_sine * east_cosine,
            -north_sine * east_sine,
            north_cosine,
            north_cosine * east_cosine,
            north_cosine * east_sine,
            north_sine,
        );
        Ok(Self { origin, centre_m, axes })
    }

    /// The frame where the user says, or else at this first place.
    pub(super) fn first(place: Geodetic, options: &ReadOptions) -> Result<Self, Fault> {
        if let Some(origin) = options.origin {
            return Self::at(origin.into());
        }
        let local = Self::at(place)?;
        if !options.is_joined {
            return Ok(local);
        }
        // Another file would begin somewhere else.
        let problem = "nothing says what its places on the Earth are measured from, the same for all files";
        let remedy = format!("say it with --origin, such as --origin {}", local.origin());
        refuse("recording/no-origin", problem, remedy)
    }

    /// A place that is given east, north and up of another origin \[m\].
    pub(super) fn place_from(&self, other: &Self, place: Vector3<f64>) -> Vector3<f64> {
        if self == other {
            return place;
        }
        self.axes * (other.axes.transpose() * place + (other.centre_m - self.centre_m))
    }

    /// A direction that is given east, north and up of another origin.
    pub(super) fn turn_from(&self, other: &Self, direction: Vector3<f64>) -> Vector3<f64> {
        if self == other { direction } else { self.axes * (other.axes.transpose() * direction) }
    }

    /// Whether a place is its origin.
    pub(super) fn is_at(&self, place: Geodetic) -> bool {
        self.origin == place
    }

    /// A place, east, north and up of the origin \[m\].
    pub(super) fn place(&self, place: Geodetic) -> Result<Vector3<f64>, Fault> {
        Ok(self.axes * (centred(place)? - self.centre_m))
    }

    /// The origin, as the user would say it.
    pub(super) fn origin(&self) -> String {
        let [latitude, longitude, height] = self.origin.into();
        format!("{latitude:?},{longitude:?},{height:?}")
    }

    /// The origin, which is `given` or inferred.
    pub(super) fn measured_from(&self, given: Option<[f64; 3]>) -> EarthOrigin {
        EarthOrigin { place: self.origin(), is_inferred: given.is_none() }
    }

    /// What a person should know.
    pub(super) fn note(&self) -> String {
        let origin = self.origin();
        format!(
            "places on the Earth are in metres east, north and up of {origin} on WGS 84 (--origin {origin} says so)"
        )
    }
}

/// Whether a receiver that had no fix wrote this: latitude and longitude are both exactly 0.
pub(super) fn is_no_fix(place: &Geodetic) -> bool {
    place.x == 0.0 && place.y == 0.0
}

/// Note on `count` rows or messages of the vehicles `of` that hold no fix.
pub(super) fn no_fixes(count: u64, of: &str) -> Option<String> {
    let is = if count == 1 { "place is no fix and was" } else { "places are no fixes and were" };
    (count > 0).then(|| format!("{count} {is} left out{of}: latitude and longitude are both exactly 0"))
}

/// Sine and cosine of latitude and of longitude.
fn angles(place: Geodetic) -> [(f64, f64); 2] {
    [place.x, place.y].map(|degrees| libm::sincos(degrees.to_radians()))
}

/// A place in the frame of the Earth's centre \[m\].
fn centred(place: Geodetic) -> Result<Vector3<f64>, Fault> {
    let range = |what: &str, value: f64, most: f64| -> Result<(), Fault> {
        if value.abs() <= most {
            return Ok(());
        }
        let problem = format!("{} is no {what}: it is not within {most} degrees", quoted(&format!("{value:?}")));
        let remedy = "write degrees with decimals; whole numbers of 1e-7 degrees are to be divided by 1e7";
        refuse("recording/not-on-earth", problem, remedy)
    };
    range("latitude", place.x, 90.0)?;
    range("longitude", place.y, 360.0)?;
    let [(sine, cosine), (east_sine, east_cosine)] = angles(place);
    let squash = (1.0 - FLATTENING) * (1.0 - FLATTENING);
    let curvature_m = EQUATOR_M / (cosine * cosine + squash * sine * sine).sqrt();
    let from_axis_m = (curvature_m + place.z) * cosine;
    Ok(Vector3::new(from_axis_m * east_cosine, from_axis_m * east_sine, (squash * curvature_m + place.z) * sine))
}

/// The frame of places on the Earth, where a table gives such: where the user says, or at the first place of the table.
pub(super) fn origin<C: Cells>(
    cells: &mut C,
    layout: &Layout,
    options: &ReadOptions,
) -> Result<Option<Local>, ReadError> {
    let reference = layout.convention.reference;
    if !layout.on_earth && reference.is_none() {
        let needless = Fault::coded(
            "recording/unused-option",
            "it has no columns of latitude and longitude",
            "leave --origin away",
        );
        return if options.origin.is_some() { Err(needless.into()) } else { Ok(None) };
    }
    axes::refuse_known(options, "a table of latitudes and longitudes")?;
    cells.restart(&layout.columns(), true)?;
    let mut unfixed = false;
    while cells.advance()? {
        let place = match reference {
            Some(columns) => measured_from(cells, columns),
            None => fix(cells, layout, &mut unfixed),
        };
        let at_row = |fault: Fault| fault.at(C::place(cells.row()));
        if let Some(place) = place.map_err(at_row)? {
            return Ok(Some(Local::first(place, options).map_err(at_row)?));
        }
    }
    if reference.is_some() {
        let problem = "the place that its positions are measured from is not known in any row (`ref_lat`, `ref_lon`)";
        return refuse("recording/no-fix", problem, GLOBAL);
    }
    if unfixed {
        let problem = "no row has a fix: every latitude and longitude is exactly 0";
        return refuse("recording/no-fix", problem, "record again once the receiver has a fix, or give another file");
    }
    Ok(None)
}

/// The place that the positions of a row are measured from; none where it is not known: empty, NaN, or where latitude and
/// longitude are 0.
fn measured_from(cells: &impl Cells, columns: [usize; 3]) -> Result<Option<Geodetic>, Fault> {
    let mut place = Vector3::zeros();
    for (slot, column) in place.iter_mut().zip(columns) {
        match cells.number(column) {
            Some(number) if number.is_nan() => return Ok(None),
            _ => match number(cells, column)? {
                Some(number) => *slot = number,
                None => return Ok(None),
            },
        }
    }
    Ok(Some(place).filter(|place| !is_no_fix(place)))
}

/// The first place on the Earth of a row; none where it has none. Sets `unfixed` where it has no fix.
fn fix(cells: &impl Cells, layout: &Layout, unfixed: &mut bool) -> Result<Option<Geodetic>, Fault> {
    for body in &layout.bodies {
        match vector(cells, &body.position, &layout.metres)? {
            Some(place) if is_no_fix(&place) => *unfixed = true,
            None => {}
            place => return Ok(place),
        }
    }
    Ok(None)
}

/// Brings a position that is measured from a place in some columns into the frame `local`; `false` where it is not known, as
/// other columns may say by a 0. The frame of the place is kept in `there`.
pub(super) fn bring(
    cells: &impl Cells,
    row: &mut Row,
    (columns, valid): ([usize; 3], &[usize]),
    local: Option<Local>,
    there: &mut Option<Local>,
) -> Result<bool, Fault> {
    for &column in valid {
        if matches!(cells.text(column)?.trim(), "0" | "0.0" | "false" | "False") {
            return Ok(false);
        }
    }
    let (Some(place), Some(local)) = (measured_from(cells, columns)?, local) else { return Ok(false) };
    let there = match there.filter(|there| there.is_at(place)) {
        Some(there) => there,
        None => *there.insert(Local::at(place)?),
    };
    row.position = local.place_from(&there, row.position);
    row.velocity = row.velocity.map(|velocity| local.turn_from(&there, velocity));
    Ok(true)
}

#[cfg(test)]
mod tests {
    use nalgebra::vector;

    use super::*;

    /// Half the shorter diameter \[m\].
    const POLE_M: f64 = EQUATOR_M * (1.0 - FLATTENING);

    /// Two units in the last place of a coordinate around the Earth's centre.
    const ROUNDING_M: f64 = 2e-9;

    /// The same by the reduced latitude, and with the system's own functions.
    fn by_reduced_latitude(place: Geodetic) -> Vector3<f64> {
        let (latitude, longitude) = (place.x.to_radians(), place.y.to_radians());
        let reduced = (POLE_M * latitude.sin()).atan2(EQUATOR_M * latitude.cos());
        let from_axis = EQUATOR_M * reduced.cos() + place.z * latitude.cos();
        let along = POLE_M * reduced.sin() + place.z * latitude.sin();
        vector![from_axis * longitude.cos(), from_axis * longitude.sin(), along]
    }

    /// The way back, by iteration.
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
    fn places_agree_with_an_independent_formula_and_with_the_way_back() {
        for place in places() {
            let found = centred(place).expect("a place");
            assert!((found - by_reduced_latitude(place)).norm() < 2.0 * ROUNDING_M, "{place}");
            let back = by_reduced_latitude(geodetic(found));
            assert!((found - back).norm() < 2.0 * ROUNDING_M, "{place}: {}", (found - back).norm());
        }
    }

    #[test]
    fn the_frame_of_an_origin_turns_and_shifts_alone() {
        let all: Vec<_> = places().collect();
        for origin in &all {
            let local = Local::at(*origin).expect("a place");
            assert_eq!(local.place(*origin).expect("a place"), Vector3::zeros());
            assert!((local.axes * local.axes.transpose() - Matrix3::identity()).norm() < 1e-15);
            assert!((local.axes.determinant() - 1.0).abs() < 1e-15);
            let above = local.place(origin + vector![0.0, 0.0, 100.0]).expect("a place");
            assert!((above - vector![0.0, 0.0, 100.0]).norm() < 3.0 * ROUNDING_M, "{origin}: {above}");
        }
    }

    #[test]
    fn places_around_another_origin_are_the_places_that_they_are() {
        let (here, there) = (vector![47.0, 8.0, 400.0], vector![47.01, 8.02, 450.0]);
        let [here, there] = [here, there].map(|place| Local::at(place).expect("a place"));
        let place = vector![47.011, 8.019, 470.0];
        let moved = here.place_from(&there, there.place(place).expect("a place"));
        assert!((moved - here.place(place).expect("a place")).norm() < 4.0 * ROUNDING_M, "{moved}");
        let step = here.place_from(&there, vector![1.0, 2.0, 3.0]) - here.place_from(&there, Vector3::zeros());
        assert!((here.turn_from(&there, vector![1.0, 2.0, 3.0]) - step).norm() < ROUNDING_M);
    }

    #[test]
    fn a_second_of_arc_is_as_long_as_the_radii_of_curvature_say() {
        let origin = vector![47.0, 8.0, 0.0];
        let local = Local::at(origin).expect("a place");
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
    fn the_antimeridian_and_the_poles_are_places_like_any_other() {
        let local = Local::at(vector![0.0, 179.999_99, 0.0]).expect("a place");
        let over = local.place(vector![0.0, -179.999_99, 0.0]).expect("a place");
        assert!((over.x - 2.0e-5_f64.to_radians() * EQUATOR_M).abs() < 1e-6, "{over}");
        let pole = Local::at(vector![90.0, 0.0, 0.0]).expect("a place");
        let turned = pole.place(vector![90.0, 123.0, 0.0]).expect("a place");
        assert!(turned.norm() < ROUNDING_M, "every longitude is the pole: {turned}");
    }

    #[test]
    fn what_is_no_place_is_refused() {
        for place in [vector![90.1, 0.0, 0.0], vector![473_977_420.0, 0.0, 0.0], vector![f64::NAN, 0.0, 0.0]] {
            assert!(Local::at(place).is_err(), "{place}");
        }
        assert!(Local::at(vector![0.0, 360.1, 0.0]).is_err());
    }
}
