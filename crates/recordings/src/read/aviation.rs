//! Heights of aircraft: their unit, and their agreement with a recorded vertical rate.
//!
//! Data of aircraft mix units. The library `traffic` and ADS-B receivers write heights in feet, vertical rates in feet
//! per minute and speeds in knots. The state vectors of `OpenSky` are in metres. Their columns have no unit.

use super::clock::Stamp;
use super::error::{ContentKind, Fault, quoted};
use super::heading;
use super::heading::Words;
use tautline_core::option::SCALE;

/// Names of columns that occur in data of aircraft only, without separators.
const COLUMNS: Words = Words(concat!(
    "icao24 icao hex hexident callsign squawk groundspeed gspeed gs tas ias mach track ",
    "verticalrate vertrate vspeed vs barorate geomrate altbaro altgeom flightlevel ",
    "flight flightid fr24id registration tailnumber aircraftid typecode adep ades",
));

/// Names of these columns that are also unambiguous after the name of a vehicle, as in `DLH1.gs`.
const OF_ONE: Words = Words(
    "icao24 callsign squawk gspeed gs tas ias mach verticalrate vertrate vspeed vs barorate geomrate altbaro altgeom",
);

/// Names that need their separator: a column `modes` does not mean Mode S.
const SEPARATED: [&str; 2] = ["mode_s", "mode-s"];

/// Names of columns with the rate of the height, without separators.
const RATES: Words = Words(
    "verticalrate vertrate vspeed vs barorate geomrate verticalspeed verticalvelocity climbrate rateofclimb climb roc \
     rocd vrate",
);

/// Units of a rate without a unit \[m/s\]: metres per second, feet per second, feet per minute, knots.
const RATE_UNITS_M_S: [f64; 4] = [1.0, 0.3048, 0.3048 / 60.0, 1852.0 / 3600.0];

/// Ends of names of rates in feet per minute, without separators.
const FEET_PER_MINUTE: [&str; 4] = ["feetperminute", "ftpermin", "ftmin", "fpm"];

const FOOT_PER_MINUTE_M_S: f64 = 0.3048 / 60.0;

/// Largest factor between a height's slope and its rate that noise explains.
const NOISE: f64 = 1.5;

/// Smallest squared correlation of slopes and rates that is evidence.
const CORRELATED: f64 = 0.8;

/// Number of rows over which a slope is taken: heights are rounded to 25 feet, and one step is often 0.
const ROWS_PER_SLOPE: u32 = 8;

/// Smallest number of slopes that is evidence.
const ENOUGH_SLOPES: u64 = 3;

/// Largest step of time within a slope, in mean steps: no rate is known in a gap.
const LONGEST_STEP: f64 = 4.0;

/// Returns the first column that shows data of aircraft, other than the column `id` of the vehicle and `height`.
/// `OpenSky` state vectors are in metres by convention and are left out.
pub(super) fn column_of_aircraft(header: &[String], id: Option<usize>, height: usize) -> Option<&String> {
    let mut others = header.iter().enumerate().filter(|(column, _)| *column != height);
    // A column `track` that names the vehicle is the track of a sensor.
    let is_sensor_track = |column: usize| id == Some(column) && heading::joined(&header[column]) == "track";
    let is_of_aircraft = |name: &str| {
        let quantity = name.rsplit(['.', '/']).next().unwrap_or(name);
        COLUMNS.contains(&heading::joined(name))
            || OF_ONE.contains(&heading::joined(quantity))
            || is_rate_in_feet_per_minute(quantity)
            || SEPARATED.contains(&name.trim().to_lowercase().as_str())
    };
    let found = others.find(|(column, name)| is_of_aircraft(name) && !is_sensor_track(*column));
    found.map(|(_, name)| name).filter(|_| !is_state_vectors(header))
}

/// Returns whether these are the columns of `OpenSky` state vectors, in its database or in its programming interface.
pub(super) fn is_state_vectors(header: &[String]) -> bool {
    let has = |name: &str| header.iter().any(|column| heading::joined(column) == name);
    has("velocity") && (has("baroaltitude") || has("geoaltitude")) && (has("vertrate") || has("truetrack"))
}

/// Returns the column of the vertical rate, and the size of its unit \[m/s\] if its name has one.
pub(super) fn rate_column(header: &[String]) -> Option<(usize, Option<f64>)> {
    header.iter().enumerate().find_map(|(column, name)| {
        if is_rate_in_feet_per_minute(name) {
            return Some((column, Some(FOOT_PER_MINUTE_M_S)));
        }
        let (stem, unit) = heading::stem_and_unit(name, Some(true));
        let size = unit.and_then(|unit| heading::size_of(unit, true));
        RATES.contains(&heading::joined(stem)).then_some((column, size))
    })
}

/// Returns whether a column is a rate in feet per minute by its name, such as `vertical_rate_fpm`.
fn is_rate_in_feet_per_minute(name: &str) -> bool {
    let name = heading::joined(name);
    FEET_PER_MINUTE.iter().any(|end| name.strip_suffix(end).is_some_and(|stem| RATES.contains(stem)))
}

/// Comparison of heights with their recorded rate, over all vehicles.
#[derive(Clone, Debug)]
pub(super) struct ClimbMonitor {
    /// Column of the rate, and the size of its unit \[m/s\] if known.
    pub(super) column: usize,
    unit_m_s: Option<f64>,
    slopes: Vec<Option<Slope>>,
    count: u64,
    /// Sums of squares of the integrals of the rate and of the changes of height, and of their products.
    rates: f64,
    heights: f64,
    products: f64,
}

/// Rows of a vehicle since the last slope.
#[derive(Clone, Copy, Debug)]
struct Slope {
    first: (f64, f64),
    /// Time, height and rate of the last row.
    last: (f64, f64, f64),
    rows: u32,
    /// Integral of the rate.
    climbed: f64,
}

impl ClimbMonitor {
    pub(super) fn new((column, unit_m_s): (usize, Option<f64>)) -> Self {
        Self { column, unit_m_s, slopes: Vec::new(), count: 0, rates: 0.0, heights: 0.0, products: 0.0 }
    }

    /// Records height \[m\] and rate of a vehicle.
    pub(super) fn observe(&mut self, vehicle: usize, stamp: Stamp, height_m: f64, rate: f64) {
        let time = stamp.approximately();
        if vehicle >= self.slopes.len() {
            self.slopes.resize(vehicle + 1, None);
        }
        let start = Slope { first: (time, height_m), last: (time, height_m, rate), rows: 0, climbed: 0.0 };
        let Some(slope) = &mut self.slopes[vehicle] else {
            self.slopes[vehicle] = Some(start);
            return;
        };
        let step = time - slope.last.0;
        let mean_step = (slope.last.0 - slope.first.0) / f64::from(slope.rows.max(1));
        if step <= 0.0 || (slope.rows > 0 && step > LONGEST_STEP * mean_step) {
            *slope = start;
            return;
        }
        slope.climbed += 0.5 * (slope.last.2 + rate) * step;
        slope.last = (time, height_m, rate);
        slope.rows += 1;
        if slope.rows == ROWS_PER_SLOPE {
            let (integral, change_m) = (slope.climbed, height_m - slope.first.1);
            *slope = start;
            if integral != 0.0 || change_m != 0.0 {
                self.count += 1;
                self.rates += integral * integral;
                self.heights += change_m * change_m;
                self.products += integral * change_m;
            }
        }
    }

    /// Returns the change of height \[m\] per unit of the rate and second, if the heights contradict the rate.
    fn contradiction(&self, per_second: f64) -> Option<f64> {
        let is_evidence = self.count >= ENOUGH_SLOPES
            && self.products * self.products >= CORRELATED * self.rates * self.heights
            && self.products != 0.0;
        let found = self.products / self.rates * per_second;
        let known = self.unit_m_s.as_ref().map_or(&RATE_UNITS_M_S[..], std::slice::from_ref);
        let agrees = known.iter().any(|unit| (unit / NOISE..=unit * NOISE).contains(&found));
        (is_evidence && !agrees && found.is_finite()).then_some(found)
    }

    /// Returns the fault of heights that contradict the rate. `header` has the names of the columns, `height` the
    /// column of the height.
    pub(super) fn fault(&self, per_second: f64, header: &[String], height: usize) -> Option<Fault> {
        let found = self.contradiction(per_second)?;
        let [height, rate] = [height, self.column].map(|column| quoted(&header[column]));
        let unit = if self.unit_m_s.is_some() { "its unit" } else { "any of m/s, ft/s, ft/min and knots" };
        let problem = format!(
            "column {height}, read in metres, contradicts column {rate}: the height changes by {found:.4} m per second \
             and unit of the rate, which is not {unit}"
        );
        let remedy = format!(
            "if the heights are in feet, use {}; if heights and times are read in their units, confirm metres with {} \
             or remove column {rate}",
            SCALE.set("0.3048"),
            SCALE.set("1")
        );
        Some(Fault::content(ContentKind::UnitConflict, problem, remedy))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fault(rate: f64, unit_m_s: Option<f64>, height_m: f64) -> bool {
        let mut climb = ClimbMonitor::new((1, unit_m_s));
        for k in 0..60 {
            let time_s = f64::from(k);
            let height = 1000.0 + 40.0 * libm::sin(time_s / 10.0);
            let slope = 4.0 * libm::cos(time_s / 10.0);
            climb.observe(0, Stamp::Real(time_s), height * height_m, slope * rate);
        }
        let header = ["alt".to_owned(), "vertical_rate".to_owned()];
        climb.fault(1.0, &header, 0).is_some()
    }

    #[test]
    fn heights_agree_with_rates_in_known_units_only() {
        let feet = 1.0 / 0.3048;
        for (rate, height_m, is_refused) in [
            (1.0, 1.0, false),
            (feet, 1.0, false),
            (60.0 * feet, 1.0, false),
            (1.0, feet, true),
            (60.0 * feet, feet, true),
            (-1.0, 1.0, true),
            (0.0, 1.0, false),
            (1.0, 0.0, false),
        ] {
            assert_eq!(fault(rate, None, height_m), is_refused, "{rate} {height_m}");
        }
        assert!(fault(feet, Some(1.0), 1.0) && !fault(feet, Some(0.3048), 1.0));
    }

    #[test]
    fn columns_of_aircraft_are_recognised() {
        let header = |text: &str| text.split(',').map(str::to_owned).collect::<Vec<_>>();
        let found = |text: &str, id| column_of_aircraft(&header(text), id, usize::MAX).cloned();
        assert_eq!(found("t,id,lat,lon,alt,vertical_rate", Some(1)).as_deref(), Some("vertical_rate"));
        assert_eq!(found("time,icao24,lat,lon,velocity,heading,vertrate,callsign,baroaltitude", Some(1)), None);
        assert_eq!(found("t,track,lat,lon,alt", Some(1)), None);
        assert_eq!(found("t,id,lat,lon,alt,yaw", Some(1)), None);
        for name in [
            "flight",
            "flight_id",
            "registration",
            "tail_number",
            "aircraft_id",
            "typecode",
            "adep",
            "ades",
            "vertical_rate_fpm",
        ] {
            assert_eq!(found(&format!("t,{name},lat,lon,alt"), Some(1)).as_deref(), Some(name));
        }
        for name in ["DLH1.gs", "planes.1.squawk", "vs", "vspeed", "mode_s", "fr24_id", "DLH1.vertical_rate_fpm"] {
            assert_eq!(found(&format!("t,id,lat,lon,alt,{name}"), Some(1)).as_deref(), Some(name));
        }
        for name in ["fl", "modes", "mission.flight", "gps/track", "VFR_HUD.groundspeed", "climb_cm_s"] {
            assert_eq!(found(&format!("t,id,lat,lon,alt,{name}"), Some(1)), None, "{name}");
        }
        assert_eq!(rate_column(&header("t,alt,vertical_rate [ft/min]")), Some((2, Some(0.3048 / 60.0))));
        assert_eq!(rate_column(&header("t,climb_m_s")), Some((1, Some(1.0))));
        for (name, unit_m_s) in [
            ("vertical_rate_fpm", FOOT_PER_MINUTE_M_S),
            ("vertical_rate_ftmin", FOOT_PER_MINUTE_M_S),
            ("vertical_rate_ft_min", FOOT_PER_MINUTE_M_S),
            ("vertical_rate_cm_s", 0.01),
        ] {
            assert_eq!(rate_column(&header(&format!("t,alt,{name}"))), Some((2, Some(unit_m_s))), "{name}");
        }
    }
}
