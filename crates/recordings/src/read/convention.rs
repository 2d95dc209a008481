//! Directions of axes by column names, and their conversion to x east, y north and z up.
//!
//! | columns | frame | vehicle |
//! | --- | --- | --- |
//! | `north`, `east`, `down` or `up`; `n`, `e`, `d` or `u` | as named | as in any table |
//! | `x_ned`, `ned_x` and the like, with any three directions | as named | as in any table |
//! | `x`, `y`, `z` beside `ref_lat`, `ref_lon`, `ref_alt` (PX4 `vehicle_local_position`) | north, east, down of the reference | one |
//! | `px`, `py`, `pz` beside `ledr`, `ledg`, `ledb` (trajectories of MAVSDK Drone Show) | north, east, down | one |
//! | `p_RS_R_x`, ... (ground truth of `EuRoC`) | x, y, z | one |

use std::collections::BTreeSet;

use super::axes::{self, Axes};
use super::error::{ContentKind, Fault, quoted, refuse};
use super::heading;
use super::options::{ColumnNames, ReadOptions};
use tautline_core::option::{AXES, COLUMN, SCALE};

/// Refuses a mapping of axes by the user if the directions are known; `what` names their source.
pub(super) fn refuse_known(options: &ReadOptions, what: &str) -> Result<(), Fault> {
    if options.turn().is_identity() {
        return Ok(());
    }
    let remedy = format!("omit {AXES} and the signs of {SCALE}");
    refuse(ContentKind::ContradictsOption, format!("{what} gives the directions of its axes"), remedy)
}

/// Refuses a mapping that changes the direction of a height column.
pub(super) fn refuse_turned_height(options: &ReadOptions, column: &str) -> Result<(), Fault> {
    if options.turn().keeps_up() {
        return Ok(());
    }
    let problem =
        format!("column {} is a height by its name, but {AXES} or {SCALE} change its direction", quoted(column));
    let named = COLUMN.set(format!("z={column}"));
    let remedy = format!("keep z in {AXES} and {SCALE}, or take the numbers as z with {named}");
    refuse(ContentKind::ContradictsOption, problem, remedy)
}

/// Remedy for positions with a separate origin per vehicle.
pub(super) const GLOBAL: &str = "use vehicle_global_position: its lat, lon and alt have one origin for all vehicles";

/// Separators of words in a name.
const SEPARATORS: [char; 4] = ['_', '.', '/', ' '];

/// Words that name a frame. Other combinations of such letters are English words, such as `end`.
const FRAMES: [&str; 5] = ["enu", "ned", "nwu", "seu", "eus"];

/// Frame and program recognised by the columns of a table.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Convention {
    /// Column names, converted to those of x, y and z.
    pub(super) header: Vec<String>,
    /// Sign of each column: -1 for an axis in the opposite direction.
    pub(super) signs: Vec<f64>,
    /// Columns along an axis of known direction.
    pub(super) directed: BTreeSet<usize>,
    /// Columns of latitude, longitude and height of the origin of positions.
    pub(super) reference: Option<[usize; 3]>,
    /// Columns that hold 0 if the position is unknown.
    pub(super) valid: Vec<usize>,
    /// Whether times count from the start of each vehicle's computer \[us\].
    pub(super) counts_from_boot: bool,
    /// Whether the table has one vehicle, whatever other columns it has.
    pub(super) is_one_vehicle: bool,
    /// Note for the user.
    pub(super) note: Option<String>,
}

impl Convention {
    /// Recognises the convention of these columns. Position columns named by the user disable recognition.
    pub(super) fn of(header: &[String], options: &ReadOptions) -> Result<Self, Fault> {
        let plain = Self { header: header.to_vec(), signs: vec![1.0; header.len()], ..Self::default() };
        let is_place = |role: usize| !matches!(ColumnNames::ROLES[role], "t" | "id" | "radius");
        if options.columns.given().any(|(role, _)| is_place(role)) {
            return Ok(plain);
        }
        let lower: Vec<String> = header.iter().map(|name| name.trim().to_lowercase()).collect();
        let found = match plain.of_px4(&lower)? {
            Some(found) => Some(found),
            None => {
                plain.of_drone_show(&lower).or_else(|| plain.of_euroc(&lower)).or_else(|| plain.of_directions(&lower))
            }
        };
        Ok(found.unwrap_or(plain))
    }

    /// Returns whether the directions of axes are known.
    pub(super) fn has_directions(&self) -> bool {
        !self.directed.is_empty()
    }

    /// Renames a column along a directed axis to x, y or z, keeping the text before and after the axis.
    fn turn(&mut self, column: usize, axes: &Axes, axis: usize, [before, behind]: [&str; 2]) {
        let (to, sign) = axes.of(axis);
        self.header[column] = format!("{before}{}{behind}", ["x", "y", "z"][to]);
        self.signs[column] = sign;
        self.directed.insert(column);
    }

    /// Returns the convention of one vehicle whose columns with these prefixes are north, east and down.
    fn of_ned(&self, lower: &[String], starts: [&str; 2]) -> Self {
        let (mut turned, ned) = (self.clone(), Axes::from_name("ned").unwrap_or_default());
        for (column, name) in lower.iter().enumerate() {
            for start in starts {
                let axis = ["x", "y", "z"].iter().position(|axis| name.strip_prefix(start) == Some(axis));
                if let Some(axis) = axis {
                    turned.turn(column, &ned, axis, [start, ""]);
                }
            }
        }
        turned.is_one_vehicle = true;
        turned
    }

    fn of_px4(&self, lower: &[String]) -> Result<Option<Self>, Fault> {
        let index_of = |name: &str| lower.iter().position(|known| known == name);
        let (Some(_), Some(_), Some(lat), Some(lon)) =
            (index_of("x"), index_of("y"), index_of("ref_lat"), index_of("ref_lon"))
        else {
            return Ok(None);
        };
        let Some(alt) = index_of("ref_alt") else {
            let problem = "its positions are relative to `ref_lat` and `ref_lon`, but there is no column `ref_alt`";
            return refuse(ContentKind::MissingColumn, problem, GLOBAL);
        };
        let mut px4 = self.of_ned(lower, ["", "v"]);
        px4.reference = Some([lat, lon, alt]);
        px4.valid = ["xy_valid", "z_valid"].into_iter().filter_map(index_of).collect();
        px4.counts_from_boot = index_of("timestamp").is_some();
        let what = "positions are north, east and down of `ref_lat`, `ref_lon` and `ref_alt` (PX4)";
        let clock = "; times count from the start of the vehicle's computer";
        px4.note = Some(format!("{what}{}", if px4.counts_from_boot { clock } else { "" }));
        Ok(Some(px4))
    }

    fn of_drone_show(&self, lower: &[String]) -> Option<Self> {
        let is_there = |name: &str| lower.iter().any(|known| known == name);
        ["t", "px", "py", "pz", "ledr", "ledg", "ledb"].into_iter().all(is_there).then(|| {
            let mut show = self.of_ned(lower, ["p", "v"]);
            show.note = Some("positions are north, east and down (MAVSDK Drone Show)".to_owned());
            show
        })
    }

    fn of_euroc(&self, lower: &[String]) -> Option<Self> {
        lower.iter().find(|name| name.starts_with("p_rs_r_x"))?;
        let mut truth = self.clone();
        for (column, name) in lower.iter().enumerate() {
            let stem = heading::bracketed(name).0;
            if let Some(axis) = stem.strip_prefix("p_rs_r_") {
                truth.header[column] = format!("{axis} [m]");
            } else if let Some(axis) = stem.strip_prefix("v_rs_r_") {
                truth.header[column] = format!("v{axis} [m/s]");
            }
        }
        truth.is_one_vehicle = true;
        Some(truth)
    }

    /// Recognises columns named by directions.
    fn of_directions(&self, lower: &[String]) -> Option<Self> {
        let mut turned = self.clone();
        // `x_ned`, `ned_x`, `cf1.vx_ned [m/s]`.
        for (column, name) in self.header.iter().enumerate() {
            let (stem, unit) = without_unit(name);
            let Some((rest, axes)) = without_frame(stem) else { continue };
            let start = rest.rfind(SEPARATORS).map_or(0, |index| index + 1);
            let word = rest[start..].to_lowercase();
            let axis = ["x", "y", "z"].iter().position(|axis| word.strip_prefix(['v', 'p']).unwrap_or(&word) == *axis);
            if let Some(axis) = axis {
                turned.turn(column, &axes, axis, [&rest[..rest.len() - 1], unit]);
            }
        }
        // `north`, `cf1.east [m]`, `vel_d_m_s`.
        let enu = Axes::default();
        let places: Vec<_> = lower.iter().filter_map(|name| Direction::of(without_unit(name).0)).collect();
        let across = |axis: usize, is_letter: bool| {
            places.iter().any(|place| place.axis == axis && place.is_letter == is_letter && !place.is_velocity)
        };
        let has_words = across(0, false) && across(1, false);
        let has_letters = across(0, true) && across(1, true) && across(2, true);
        for (column, name) in self.header.iter().enumerate() {
            let (stem, unit) = without_unit(name);
            let Some(direction) = Direction::of(stem) else { continue };
            let is_meant =
                if direction.is_letter { has_letters || (has_words && direction.is_velocity) } else { has_words };
            if is_meant {
                let before = if direction.is_velocity {
                    format!("{}v", direction.vehicle)
                } else {
                    direction.vehicle.to_owned()
                };
                turned.turn(column, &enu, direction.axis, [&before, unit]);
                turned.signs[column] = direction.sign;
            }
        }
        if !turned.has_directions() {
            return None;
        }
        turned.note = Some("positions are converted to east, north and up, by the names of columns".to_owned());
        Some(turned)
    }
}

/// Splits a name into the part before its unit and the unit as written.
fn without_unit(name: &str) -> (&str, &str) {
    let name = name.trim();
    name.split_at(heading::stem_and_unit(name, None).0.len())
}

/// Removes the word that names a frame; returns the rest and the axes of the frame.
fn without_frame(stem: &str) -> Option<(String, Axes)> {
    let lower = stem.to_lowercase();
    // A name whose length changes in lower case contains no known word.
    let words = lower.split(SEPARATORS).filter(|_| lower.len() == stem.len());
    let (index, word, axes) = words
        .map(|word| (word.as_ptr() as usize - lower.as_ptr() as usize, word))
        .find_map(|(index, word)| Some((index, word, Axes::from_name(word).filter(|_| FRAMES.contains(&word))?)))?;
    let (before, behind) = (&stem[..index], &stem[index + word.len()..]);
    // One of the two separators around the word is removed too.
    let rest = if behind.is_empty() {
        before.strip_suffix(SEPARATORS)?.to_owned()
    } else {
        format!("{before}{}", behind.strip_prefix(SEPARATORS)?)
    };
    (!rest.is_empty()).then_some((rest, axes))
}

/// Column named by a direction.
#[derive(Debug, PartialEq)]
struct Direction<'a> {
    /// Text before the quantity, with its separator.
    vehicle: &'a str,
    is_velocity: bool,
    /// 0 for east, 1 for north, 2 for up.
    axis: usize,
    sign: f64,
    is_letter: bool,
}

impl<'a> Direction<'a> {
    fn of(stem: &'a str) -> Option<Self> {
        const WORDS: [&str; 8] = ["east", "easting", "west", "north", "northing", "south", "up", "down"];
        let end = stem.rfind(SEPARATORS).map_or(0, |index| index + 1);
        let (word, mut before) = (stem[end..].to_lowercase(), &stem[..end]);
        let letter = word.strip_prefix('v').unwrap_or(&word);
        let (is_letter, mut is_velocity) = (matches!(letter, "e" | "n" | "u" | "d"), letter.len() < word.len());
        let (axis, sign) = axes::direction(letter.chars().next()?)?;
        if !is_letter && !WORDS.contains(&&*word) {
            return None;
        }
        // Quantity before the direction: `vel_n`, `position_east`.
        let quantity = before.trim_end_matches(SEPARATORS);
        let start = quantity.rfind(SEPARATORS).map_or(0, |index| index + 1);
        match quantity[start..].to_lowercase().as_str() {
            "v" | "vel" | "velocity" => (is_velocity, before) = (true, &before[..start]),
            "p" | "pos" | "position" => before = &before[..start],
            // A single letter after another name is ambiguous.
            _ if is_letter && !quantity.is_empty() => return None,
            _ => {}
        }
        Some(Self { vehicle: before, is_velocity, axis, sign, is_letter })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn convention(header: &str) -> Convention {
        let header: Vec<_> = header.split(',').map(str::to_owned).collect();
        Convention::of(&header, &ReadOptions::default()).expect("a convention")
    }

    #[test]
    fn columns_with_a_frame_are_converted() {
        for (header, expected, signs) in [
            ("t,north,east,down", "t,y,x,z", [1.0, 1.0, 1.0, -1.0]),
            ("t,n,e,d", "t,y,x,z", [1.0, 1.0, 1.0, -1.0]),
            ("t,e,n,u", "t,x,y,z", [1.0; 4]),
            ("t,North [m],East [m],Up [m]", "t,y [m],x [m],z [m]", [1.0; 4]),
            ("t,cf1.north_m,cf1.east_m,cf1.down_m", "t,cf1.y_m,cf1.x_m,cf1.z_m", [1.0, 1.0, 1.0, -1.0]),
            ("t,x_ned,y_ned,z_ned", "t,y,x,z", [1.0, 1.0, 1.0, -1.0]),
            ("t,ned_x,ned_y,ned_z", "t,y,x,z", [1.0, 1.0, 1.0, -1.0]),
            ("t,cf1.x_nwu [m],cf1.y_nwu [m],cf1.z_nwu [m]", "t,cf1.y [m],cf1.x [m],cf1.z [m]", [1.0, 1.0, -1.0, 1.0]),
            ("t,pos_n,pos_e,pos_d", "t,y,x,z", [1.0, 1.0, 1.0, -1.0]),
        ] {
            let found = convention(header);
            assert_eq!((found.header.join(","), &found.signs[..]), (expected.to_owned(), &signs[..]), "{header}");
            assert!(found.has_directions(), "{header}");
        }
        let velocities = convention("t,north,east,down,vel_n_m_s,v_east,vd");
        assert_eq!(velocities.header[4..], ["vy_m_s", "vx", "vz"]);
        assert_eq!(velocities.signs[4..], [1.0, 1.0, -1.0]);
    }

    #[test]
    fn other_columns_are_unchanged() {
        for header in [
            "t,x,y,z",
            "t,x,y,up",
            "t,e,f,g",
            "t,n,x,y",
            "t,lat,lon,vel_n_m_s,vel_e_m_s",
            "t,x,y,depth,n_e",
            "t,end_x,end_y,max_ned",
        ] {
            let found = convention(header);
            assert_eq!((found.header.join(","), found.has_directions()), (header.to_owned(), false), "{header}");
        }
    }
}
