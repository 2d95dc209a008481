//! Parses column names: a quantity, optionally with a vehicle and a unit.

use std::collections::BTreeMap;

use tautline_core::fact::Source;

use super::error::{ContentKind, Fault, quoted, refuse};
use super::time_unit::{TimeUnit, seconds_of};

/// List of words, separated by blanks.
#[derive(Clone, Copy)]
pub(super) struct Words(pub(super) &'static str);

impl Words {
    fn iter(self) -> impl Iterator<Item = &'static str> {
        self.0.split(' ')
    }

    pub(super) fn contains(self, word: &str) -> bool {
        self.iter().any(|known| known == word)
    }
}

/// Quantity of a column: an index into [`ColumnNames::ROLES`](super::options::ColumnNames::ROLES). The axes of a vector
/// have consecutive indices.
pub(super) type Role = usize;
pub(super) const TIME: Role = 0;
pub(super) const ID: Role = 1;
pub(super) const POSITION: Role = 2;
pub(super) const VELOCITY: Role = 5;
pub(super) const RADIUS: Role = 8;
/// Latitude; longitude and height follow.
pub(super) const EARTH: Role = 9;

pub(super) fn is_velocity(role: Role) -> bool {
    (VELOCITY..RADIUS).contains(&role)
}

/// Returns whether a column gives a latitude or a longitude.
pub(super) fn is_angle(role: Role) -> bool {
    (EARTH..EARTH + 2).contains(&role)
}

pub(super) const HEIGHT: Role = EARTH + 2;
/// Depth: a height with the opposite sign. Column names may have this role; the user cannot select it.
pub(super) const DEPTH: Role = EARTH + 3;

/// Names of latitude and longitude.
const EARTH_NAMES: [&[&str]; 2] = [&["lat", "latitude"], &["lon", "lng", "long", "longitude"]];

/// Prefixes of these names.
const EARTH_STARTS: [&str; 7] = ["", "gps_", "gnss_", "global_", "geo_", "geodetic_", "wgs84_"];

/// Names of heights and depths.
const HEIGHT_NAMES: Words = Words("alt altitude height hgt elevation elev ele agl msl amsl asl hae up");
const DEPTH_NAMES: [&str; 2] = ["depth", "down"];

/// Prefixes and suffixes of these names: reference and method of the measurement.
const HEIGHT_STARTS: Words = Words(
    "gps gnss global geo geometric geodetic ellipsoidal wgs84 baro barometric barometer pressure rel relative \
     abs absolute local pos position est estimated true raw filtered",
);
const HEIGHT_ENDS: Words = Words(concat!(
    "agl msl amsl asl hae rel relative above_ground above_ground_level above_sea_level above_takeoff ",
    "baro barometric pressure geom geometric gps gnss wgs84 ellipsoid",
));

/// Names of other quantities with axes, which are not vehicles.
const QUANTITIES: Words = Words(concat!(
    "vel velocity speed acc accel acceleration gyro gyr gyroscope imu mag magnetometer magnetic ",
    "omega angular linear rate rates angvel angle angles attitude orientation quat quaternion rot ",
    "rotation euler rpy twist wrench force torque moment thrust wind gravity bias noise std sigma ",
    "var cov covariance err error sp setpoint ref reference des desired cmd command jerk",
));

/// Letters of quantities with axes, which may also be vehicles.
pub(super) const LETTERS: [&str; 8] = ["a", "f", "g", "j", "q", "u", "v", "w"];

/// Parsed name of a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Heading<'a> {
    /// Vehicle; empty if the name is a quantity alone.
    pub(super) vehicle: &'a str,
    pub(super) role: Role,
    pub(super) unit: Option<&'a str>,
    /// Whether the name may also be another quantity: `a_x` is an acceleration or the position of `a`.
    pub(super) ambiguous: bool,
}

impl<'a> Heading<'a> {
    /// Parses a name; `None` if it is not a known quantity.
    pub(super) fn of(name: &'a str) -> Option<Self> {
        let (stem, unit) = bracketed(name);
        match unit {
            // A bracketed number is a vehicle: x[0].
            Some(number) if is_number(number) => {
                Some(Self { vehicle: number, ..Self::new("", quantity(&stem.to_lowercase())?) })
            }
            Some(_) => Self::without_unit(stem).map(|heading| Self { unit, ..heading }),
            None => Self::without_unit(stem)
                .or_else(|| {
                    endings(stem).find_map(|(stem, unit, velocity)| {
                        let heading =
                            Self::without_unit(stem).filter(|heading| is_velocity(heading.role) == velocity)?;
                        Some(Self { unit: Some(unit), ..heading }).filter(|heading| !is_angle(heading.role))
                    })
                })
                .or_else(|| {
                    let (stem, unit) = stem.rsplit_once('_').filter(|(_, unit)| degrees(unit).is_some())?;
                    let heading = Self::without_unit(stem).filter(|heading| is_angle(heading.role))?;
                    Some(Self { unit: Some(unit), ..heading })
                }),
        }
    }

    fn new(vehicle: &'a str, role: Role) -> Self {
        Self { vehicle, role, unit: None, ambiguous: false }
    }

    /// Splits `x1`, `vx_2`, `px.1`, `cf1.x`, `leader/vy` or `drone3_z` into vehicle and quantity.
    fn without_unit(name: &'a str) -> Option<Self> {
        if let Some(role) = quantity(&name.to_lowercase()) {
            return Some(Self::new("", role));
        }
        let stem = name.trim_end_matches(|c: char| c.is_ascii_digit());
        if stem.len() < name.len() {
            let role = quantity(&stem.strip_suffix(['_', '.']).unwrap_or(stem).to_lowercase())?;
            return Some(Self::new(&name[stem.len()..], role));
        }
        let mut splits = name.char_indices().filter(|&(index, c)| index > 0 && matches!(c, '.' | '/' | '_'));
        let (separator, heading) = splits.find_map(|(index, separator)| {
            Some((separator, Self::new(&name[..index], quantity(&name[index + 1..].to_lowercase())?)))
        })?;
        let ambiguous = LETTERS.contains(&heading.vehicle) && separator == '_';
        (ambiguous || !is_quantity_name(heading.vehicle)).then_some(Self { ambiguous, ..heading })
    }

    /// Returns whether the vehicle is a number.
    pub(super) fn is_numbered(&self) -> bool {
        is_number(self.vehicle)
    }
}

/// Returns whether a text consists of digits.
pub(super) fn is_number(text: &str) -> bool {
    !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit())
}

/// Returns the quantity of a plain lower-case name such as `x`, `pos_x`, `vy` or `radius`.
fn quantity(name: &str) -> Option<Role> {
    if name == "radius" {
        return Some(RADIUS);
    }
    let name = name.replace(['.', '/'], "_");
    let axis_after = |start: &&str| ["x", "y", "z"].iter().position(|axis| name.strip_prefix(start) == Some(axis));
    let axis = |role, starts: &[&str]| starts.iter().find_map(axis_after).map(|axis| role + axis);
    let on_earth = |start: &&str| {
        let name = name.strip_prefix(start)?;
        EARTH_NAMES.iter().position(|known| known.contains(&name)).map(|axis| EARTH + axis)
    };
    axis(POSITION, &["", "p", "p_", "pos_", "position_"])
        .or_else(|| axis(VELOCITY, &["v", "vel_", "velocity_"]))
        .or_else(|| EARTH_STARTS.iter().find_map(on_earth))
        .or_else(|| height(&name.replace([' ', '-'], "_")))
}

/// Returns the role of a lower-case name of a height, such as `geoaltitude`, `rel_alt`, `height_above_ground`, or of a
/// depth.
fn height(name: &str) -> Option<Role> {
    let role = |name: &str| {
        if HEIGHT_NAMES.contains(name) { Some(HEIGHT) } else { DEPTH_NAMES.contains(&name).then_some(DEPTH) }
    };
    let behind = |name: &str| {
        let starts = HEIGHT_STARTS.iter().filter_map(|start| name.strip_prefix(start));
        role(name).or_else(|| starts.map(|rest| rest.trim_start_matches('_')).find_map(role))
    };
    let mut ends = HEIGHT_ENDS.iter().filter_map(|end| name.strip_suffix(end)?.strip_suffix('_'));
    behind(name).or_else(|| ends.find_map(behind))
}

/// Returns the surface from which a column counts heights, by its name.
pub(super) fn height_reference(name: &str) -> (Source, &'static str) {
    let name = bracketed(name).0.to_lowercase();
    let has = |words: &[&str]| words.iter().any(|word| name.contains(word));
    if has(&["hae", "ellipsoid", "wgs84", "geom", "geo_alt", "geoalt"]) {
        (Source::Deduced, "ellipsoid")
    } else if has(&["baro", "pressure"]) {
        (Source::Deduced, "pressure")
    } else if has(&["msl", "asl", "above_sea"]) {
        (Source::Deduced, "sea level")
    } else if has(&["rel", "agl", "above_ground", "takeoff"]) {
        (Source::Deduced, "ground")
    } else {
        (Source::Default, "one level for all vehicles")
    }
}

/// Returns whether the last word of a name is a quantity with axes, as in `cf1_gyro` and `../orientation`.
pub(super) fn is_quantity_name(name: &str) -> bool {
    let name = name.to_lowercase();
    let words = name.split(|c: char| !c.is_alphanumeric());
    let mut words = words.map(|word| word.trim_end_matches(|c: char| c.is_ascii_digit()));
    words.rfind(|word| !word.is_empty()).is_some_and(|word| QUANTITIES.contains(word))
}

/// Returns whether an unused column holds attitudes, rates or sensor values, and therefore no vehicle names.
pub(super) fn is_not_vehicle_column(name: &str) -> bool {
    let stem = bracketed(name).0.to_lowercase();
    let is_named = |start: &str, ends: &[&str]| stem.strip_prefix(start).is_some_and(|end| ends.contains(&end));
    let known = ["", "roll", "pitch", "yaw", "heading", "speed", "battery", "voltage", "thrust", "frame"];
    known.contains(&stem.as_str())
        || is_named("q", &["x", "y", "z", "w", "0", "1", "2", "3"])
        || ["a", "w", "yaw^"].iter().any(|start| is_named(start, &["x", "y", "z"]))
        || stem
            .rsplit_once(['.', '/', '_'])
            .is_some_and(|(start, _)| LETTERS.contains(&start) || is_quantity_name(start))
}

/// Returns whether the values of a column with this name could identify vehicles.
pub(super) fn may_identify_vehicles(name: &str) -> bool {
    !is_clock(name) && !is_not_vehicle_column(name) && Heading::of(name).is_none()
}

/// Returns whether a table reader would use a column with this name in a long table. Other columns must avoid such
/// names.
#[must_use]
pub fn is_read(name: &str) -> bool {
    let is_own = |heading: Heading<'_>| {
        (heading.role < EARTH || heading.role >= HEIGHT) && (heading.vehicle.is_empty() || heading.is_numbered())
    };
    is_clock(name) || is_id(name) || Heading::of(name).is_some_and(is_own)
}

/// Splits the name of a time column into the lower-case name without its unit, and the unit.
pub(super) fn time_and_unit(name: &str) -> (String, Option<String>) {
    let name = name.to_lowercase();
    let (stem, unit) = bracketed(&name);
    let ending = stem.rsplit_once('_').filter(|(_, end)| seconds_of(end).is_some());
    let (stem, unit) = match (unit, ending) {
        (None, Some((stem, end))) => (stem, Some(end)),
        _ => (stem, unit),
    };
    (stem.to_owned(), unit.map(str::to_owned))
}

/// Returns whether a column gives a time, frame number or duration.
pub(super) fn is_clock(name: &str) -> bool {
    is_time(name) || is_frame(name) || name.eq_ignore_ascii_case("duration")
}

/// Returns whether a column gives the time.
pub(super) fn is_time(name: &str) -> bool {
    is_main_time(name) || matches!(time_and_unit(name).0.as_str(), "tstamp" | "epoch" | "__time" | BOOT_TIME)
}

/// Returns whether a column gives the time, whatever other columns the table has.
pub(super) fn is_main_time(name: &str) -> bool {
    const NAMES: [&str; 10] =
        ["t", "time", "timestamp", "stamp", "datetime", "date_time", "utc", "time_utc", "utc_time", "timestamp_utc"];
    NAMES.contains(&time_and_unit(name).0.as_str())
}

/// Name of times since the start of the vehicle's computer without unit, as `time_boot_ms` of `MAVLink`.
pub(super) const BOOT_TIME: &str = "time_boot";

/// Returns whether a column counts frames or steps.
pub(super) fn is_frame(name: &str) -> bool {
    let name = time_and_unit(name).0.replace(['_', ' ', '-', '.'], "");
    let counted = name.trim_end_matches('s');
    let counted = ["number", "no", "nr", "num", "index", "idx", "count"]
        .iter()
        .find_map(|end| name.strip_suffix(end))
        .unwrap_or(counted);
    matches!(counted, "frame" | "step" | "timestep" | "tick" | "iteration" | "picture")
}

/// Words for vehicles in the names of vehicle columns, with or without a suffix of [`VEHICLE_ENDS`].
const VEHICLES: Words = Words(concat!(
    "vehicle drone uav uas quad quadrotor copter agent robot rover aircraft plane airplane ship ",
    "vessel boat usv auv car truck object obj track target body rigidbody model entity actor person ",
    "pedestrian ped player unit node tag device callsign flight tail registration icao icao24 hex ",
    "hexident mmsi imo childframe sys",
));

/// Suffixes of these words.
const VEHICLE_ENDS: [&str; 9] = ["id", "idx", "name", "number", "no", "nr", "num", "index", "code"];

/// Returns whether a column names the vehicle of a row.
pub(super) fn is_id(name: &str) -> bool {
    let name = joined(name);
    let is_vehicle = |stem: &str| VEHICLES.contains(stem);
    let behind = VEHICLE_ENDS.iter().filter_map(|end| name.strip_suffix(end));
    matches!(name.as_str(), "id" | "name" | "uid" | "uuid" | "sysid" | "systemid")
        || is_vehicle(&name)
        || behind.into_iter().any(is_vehicle)
}

/// Returns the rank of a column among the candidates for vehicle names; 0 is the best. The order is `id`, `track_id`,
/// `name`. Returns `None` for a name that may be a quantity, such as `track`, or a list index, such as `object_index`.
pub(super) fn rank_of_name(name: &str) -> Option<u8> {
    match joined(name).as_str() {
        "id" | "uid" | "uuid" => Some(0),
        name if name.ends_with("id") || name == "callsign" => Some(1),
        name => name.ends_with("name").then_some(2),
    }
}

/// Returns whether a column holds the address of an aircraft, which names it better than other columns do.
pub(super) fn is_aircraft_address(name: &str) -> bool {
    matches!(joined(name).as_str(), "icao24" | "icao" | "hex" | "hexident")
}

/// Returns whether a column names aircraft, and no other vehicles.
pub(super) fn names_aircraft(name: &str) -> bool {
    is_aircraft_address(name) || matches!(joined(name).as_str(), "callsign" | "flight" | "tail" | "registration")
}

/// Returns a name in lower case without unit and separators.
pub(super) fn joined(name: &str) -> String {
    bracketed(name).0.to_lowercase().replace(['_', ' ', '-', '.'], "")
}

/// Appends the units of a row of units to the column names. A name that already has the same unit stays unchanged. So
/// does a name that ends with a unit of time and is not a time itself, such as `stamp.nanosec`.
pub(super) fn with_units(header: &[String], below: &[&str]) -> Result<Vec<String>, Fault> {
    let with_unit = |(name, unit): (&String, &&str)| -> Result<String, Fault> {
        let is_time = is_time(name);
        let is_part =
            !is_time && TimeUnit::from_name(name.rsplit(['.', '/', '_', ' ']).next().unwrap_or_default()).is_some();
        if is_part || matches!(*unit, "" | "-" | "1") {
            return Ok(name.clone());
        }
        let own_unit = if is_time { time_and_unit(name).1 } else { stem_and_unit(name, None).1.map(str::to_owned) };
        let Some(own_unit) = own_unit else { return Ok(format!("{name} [{unit}]")) };
        let is_same =
            |velocity: bool| size_of(&own_unit, velocity).is_some_and(|size| size_of(unit, velocity) == Some(size));
        let time = |unit: &str| TimeUnit::from_name(&unit.to_lowercase());
        if own_unit.eq_ignore_ascii_case(unit)
            || is_same(false)
            || is_same(true)
            || (is_time && time(&own_unit) == time(unit))
        {
            return Ok(name.clone());
        }
        let problem = format!(
            "column {} has the unit {}, but the row of units {}",
            quoted(name),
            quoted(&own_unit),
            quoted(unit)
        );
        refuse(ContentKind::UnitConflict, problem, "remove one of the two units")
    };
    let mut named = header.iter().zip(below).map(with_unit).collect::<Result<Vec<_>, _>>()?;
    named.extend(header.iter().skip(named.len()).cloned());
    Ok(named)
}

/// Names of units of length, and their size \[m\].
const LENGTHS_M: [(&[&str], f64); 10] = [
    (&["m", "meter", "meters", "metre", "metres"], 1.0),
    (&["dm"], 0.1),
    (&["cm", "centimeter", "centimeters", "centimetre", "centimetres"], 0.01),
    (&["mm", "millimeter", "millimeters", "millimetre", "millimetres"], 0.001),
    (&["um", "µm", "μm"], 1e-6),
    (&["km", "kilometer", "kilometers", "kilometre", "kilometres"], 1000.0),
    (&["in", "inch", "inches"], 0.0254),
    (&["ft", "foot", "feet"], 0.3048),
    (&["yd", "yard", "yards"], 0.9144),
    (&["nmi"], 1852.0),
];

/// Units without brackets at the end of a name, as in `vx_m_s` and `x_mm`.
const VELOCITY_ENDS: [&str; 6] = ["m_s", "cm_s", "mm_s", "km_s", "km_h", "ft_s"];
const LENGTH_ENDS: [&str; 6] = ["m", "dm", "cm", "mm", "km", "ft"];

/// Returns the size of a unit of length \[m\] or velocity \[m/s\]; `None` for an unknown unit.
pub(super) fn size_of(unit: &str, velocity: bool) -> Option<f64> {
    let unit = unit.trim().to_lowercase();
    let metres = |name: &str| LENGTHS_M.iter().find(|(known, _)| known.contains(&name)).map(|(_, size_m)| *size_m);
    if !velocity {
        return metres(&unit);
    }
    match unit.as_str() {
        "mps" => return Some(1.0),
        "kmh" | "kph" => return Some(1.0 / 3.6),
        _ => {}
    }
    let per = |separator| unit.split_once(separator);
    let (length, time) = per("/").or_else(|| per("_")).or_else(|| per(" per "))?;
    Some(metres(length.trim())? / seconds_of(time.trim())?)
}

/// Returns the size of a unit of latitude and longitude \[degrees\]; `None` for an unknown unit.
pub(super) fn degrees(unit: &str) -> Option<f64> {
    match unit.trim().to_lowercase().as_str() {
        "deg" | "degree" | "degrees" | "°" => Some(1.0),
        "rad" | "radian" | "radians" => Some(1.0_f64.to_degrees()),
        "dege7" | "1e-7 deg" | "1e7" | "e7" => Some(1e-7),
        _ => None,
    }
}

/// Splits a name into the part before its unit, in brackets or at its end, and the unit. The unit at the end is one of
/// velocity if `is_velocity` is true, one of length if it is false.
pub(super) fn stem_and_unit(name: &str, is_velocity: Option<bool>) -> (&str, Option<&str>) {
    match bracketed(name) {
        (stem, None) => {
            let mut found = endings(stem).filter(|(.., velocity)| is_velocity.is_none_or(|wanted| wanted == *velocity));
            found.next().map_or((stem, None), |(stem, unit, _)| (stem, Some(unit)))
        }
        known => known,
    }
}

/// Splits a name into the part before a bracketed unit and the unit: `x [mm]`, `x (ft)`.
pub(super) fn bracketed(name: &str) -> (&str, Option<&str>) {
    let name = name.trim();
    let within = |open, close| name.strip_suffix(close)?.rsplit_once(open);
    match within('[', ']').or_else(|| within('(', ')')) {
        Some((stem, unit)) if !stem.trim().is_empty() => (stem.trim(), Some(unit.trim())),
        _ => (name, None),
    }
}

/// Returns each split of a name such as `x_mm` into stem and unit; the flag is true for units of velocity.
fn endings(name: &str) -> impl Iterator<Item = (&str, &str, bool)> {
    let units = VELOCITY_ENDS.map(|unit| (unit, true)).into_iter().chain(LENGTH_ENDS.map(|unit| (unit, false)));
    units.filter_map(|(unit, velocity)| {
        let (stem, end) = name.split_at_checked(name.len().checked_sub(unit.len())?)?;
        Some((stem.strip_suffix('_')?, end, velocity)).filter(|_| end.eq_ignore_ascii_case(unit))
    })
}

/// Columns of a table that are recognised as heights or depths by their names, and whether they count downwards.
#[derive(Clone, Debug, Default)]
pub(super) struct Heights(BTreeMap<usize, bool>);

impl Heights {
    /// Assigns height and depth columns to the third position axis, if their vehicle has the other two axes and no
    /// third column. `place` is the role of the first axis. All other height headings are dropped. `found` holds the
    /// columns named by the user.
    pub(super) fn place(
        place: Role,
        header: &[String],
        found: &mut BTreeMap<(String, Role), usize>,
        headings: &mut Vec<(usize, Heading<'_>)>,
    ) -> Self {
        let (third, mut heights) = (place + 2, Self::default());
        // The user may name the third axis `z` or `alt`; `z` is read without a change of sign.
        let [z, alt] = [POSITION + 2, HEIGHT].map(|role| found.remove(&(String::new(), role)));
        let given = if third == HEIGHT { alt.or(z) } else { z.or(alt) };
        found.extend(given.map(|column| ((String::new(), third), column)));
        if let Some(column) = alt.filter(|column| given == Some(*column)) {
            let is_depth = Heading::of(&header[column]).is_some_and(|heading| heading.role == DEPTH);
            heights.0.insert(column, is_depth);
        }
        let all = headings.clone();
        let has = |vehicle: &str, role: Role| {
            all.iter().any(|(_, heading)| (heading.vehicle, heading.role) == (vehicle, role))
                || found.contains_key(&(vehicle.to_owned(), role))
        };
        let is_height = |role: Role| matches!(role, HEIGHT | DEPTH);
        headings.retain(|(_, Heading { vehicle, role, .. })| {
            let has = |axis: Role| has(vehicle, place + axis);
            !is_height(*role) || (has(0) && has(1) && (third == HEIGHT || !has(2)))
        });
        for (column, heading) in headings.iter_mut().filter(|(_, heading)| is_height(heading.role)) {
            heights.0.insert(*column, heading.role == DEPTH);
            heading.role = third;
        }
        heights
    }

    /// Returns the columns that count downwards.
    pub(super) fn downward(&self) -> impl Iterator<Item = usize> {
        self.0.iter().filter(|(_, is_depth)| **is_depth).map(|(column, _)| *column)
    }

    /// Returns those of the given columns that are read as heights by name, and whether the sign is inverted.
    pub(super) fn among(&self, columns: impl Iterator<Item = usize>) -> BTreeMap<usize, bool> {
        columns.filter_map(|column| Some((column, *self.0.get(&column)?))).collect()
    }
}
