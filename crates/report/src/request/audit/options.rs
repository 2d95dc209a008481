//! Options of an audit, each once: for the command line, `tautline.toml`, keyword arguments of Python and programs.

use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

#[cfg(feature = "cli")]
use clap::builder::{PossibleValue, TypedValueParser};
use nalgebra::Vector3;
use serde::Deserialize;
use serde::de::{Deserializer, Error as _, MapAccess, Visitor};

#[cfg(feature = "cli")]
use super::super::one_of;
use super::Failure;
use super::rules::{self, Rules};
use super::venue_file;
use tautline_audit::envelope::{Envelope, Limit, Quantity};
use tautline_audit::recorded::{Interpolation, RecordedError, Settings, VehicleSettings};
use tautline_audit::{Cylinder, WellClear};
use tautline_core::option::{ELLIPSOID, IDS, LIMIT, MAX_ACCEL, MOTION, OFFSET, Opt, PLAN_DELAY, RADIUS, TUBE};
use tautline_recordings::read::{ArrayAxis, ArrayLayout, Axes, Scale};

/// Largest delay of a plan that may be given \[s\]: a century.
const MOST_DELAY_S: f64 = 3.2e9;

/// Number of all vehicles, or of the vehicle with this name.
pub type Entry = (Option<String>, f64);

/// Names of vehicles or obstacles.
#[derive(Clone, Debug, Deserialize)]
#[serde(from = "String")]
pub struct Names(pub Vec<String>);

impl From<String> for Names {
    fn from(name: String) -> Self {
        Self(vec![name])
    }
}

/// Options of an audit.
///
/// An option that is not given has its default value. Units are those of the names. With the feature `cli` this struct
/// is a part of the arguments of `tautline audit`, and its comments are the help.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[cfg_attr(feature = "cli", derive(clap::Args), command(next_help_heading = "Judging"))]
#[expect(clippy::struct_excessive_bools, reason = "each is a flag of its own")]
#[allow(rustdoc::broken_intra_doc_links, reason = "units are in brackets, as in the help")]
pub struct AuditOptions {
    /// Safety distance between two centres [m]; default: that of a tautline recording. With --ellipsoid, a scaled
    /// distance; default: 2.
    #[serde(alias = "delta")]
    #[cfg_attr(feature = "cli", arg(long = "delta", value_name = "METRES", allow_negative_numbers = true))]
    pub delta_m: Option<f64>,
    /// Motion between samples [default: linear for samples, polynomial for curves].
    #[cfg_attr(feature = "cli", arg(long, value_name = "MOTION", value_parser = motion()))]
    pub motion: Option<Interpolation>,
    /// Largest acceleration [m/s^2] of all vehicles, or of one, for --motion bounded; repeatable.
    #[serde(alias = "max_accel", deserialize_with = "entries")]
    #[cfg_attr(feature = "cli", arg(long = "max-accel", value_name = "[NAME=]A", value_parser = entry))]
    #[cfg_attr(feature = "cli", arg(allow_negative_numbers = true))]
    pub max_accel_m_s2: Vec<Entry>,
    /// Radius [m] of all vehicles, or of one; repeatable.
    #[serde(alias = "radius", deserialize_with = "entries")]
    #[cfg_attr(feature = "cli", arg(long = "radius", value_name = "[NAME=]R", value_parser = entry))]
    #[cfg_attr(feature = "cli", arg(allow_negative_numbers = true))]
    pub radius_m: Vec<Entry>,
    /// Half axes [m] of an ellipsoid around each vehicle, such as its downwash, or a name (crazyswarm,
    /// crazyflie-firmware); two touch at a scaled distance of 2.
    #[serde(alias = "ellipsoid", deserialize_with = "ellipsoid")]
    #[cfg_attr(feature = "cli", arg(long = "ellipsoid", value_name = "AX,AY,AZ", value_parser = rules::ellipsoid))]
    #[cfg_attr(feature = "cli", arg(allow_hyphen_values = true, conflicts_with_all = ["radius_m", "obstacles"]))]
    pub ellipsoid_m: Option<Vector3<f64>>,
    /// Upright cylinder: a pair is too near if it is horizontally closer than R and vertically closer than H [m].
    #[serde(alias = "cylinder", deserialize_with = "cylinder")]
    #[cfg_attr(feature = "cli", arg(long = "cylinder", value_name = "R,H", value_parser = rules::cylinder))]
    #[cfg_attr(feature = "cli", arg(allow_hyphen_values = true))]
    pub cylinder_m: Option<Cylinder>,
    /// Well clear of air traffic: do-365, f3442, or D,Z,T (horizontal and vertical distance [m], modified tau [s]).
    #[serde(deserialize_with = "well_clear")]
    #[cfg_attr(feature = "cli", arg(long, value_name = "PRESET", value_parser = rules::well_clear))]
    #[cfg_attr(feature = "cli", arg(allow_hyphen_values = true))]
    pub well_clear: Option<WellClear>,
    /// Origin of limits that no option sets: the recording (a Skybrush show), the defaults of skybrush, or none
    /// [default: recording].
    #[serde(deserialize_with = "parsed")]
    #[cfg_attr(feature = "cli", arg(long, value_name = "ORIGIN"))]
    pub rules: Option<Rules>,
    /// TOML file of obstacles: balls, boxes, capsules, half-spaces; static or moving.
    #[cfg_attr(feature = "cli", arg(long, value_name = "FILE"))]
    pub obstacles: Option<PathBuf>,
    /// Limits of each vehicle: speed, horizontal, climb, descent [m/s], accel [m/s^2], height, floor,
    /// navigation-floor [m], yaw-rate [deg/s].
    #[serde(alias = "limit", deserialize_with = "limits")]
    #[cfg_attr(feature = "cli", arg(long = "limit", value_name = "LIMIT=VALUE,...", value_parser = limit))]
    #[cfg_attr(feature = "cli", arg(value_delimiter = ',', allow_hyphen_values = true))]
    pub limits: Vec<Limit>,
    /// Check means of the acceleration over this time [s] against --limit accel; corners of curves count.
    #[serde(alias = "accel_window")]
    #[cfg_attr(feature = "cli", arg(long = "accel-window", value_name = "SECONDS", allow_negative_numbers = true))]
    pub accel_window_s: Option<f64>,
    /// TOML file of a fence that contains all vehicles.
    #[cfg_attr(feature = "cli", arg(long, value_name = "FILE"))]
    pub fence: Option<PathBuf>,
    /// Plan of the flight, in any format that is read: its curves are compared with the flight, vehicle by vehicle.
    #[cfg_attr(feature = "cli", arg(long, value_name = "FILE"))]
    pub plan: Option<PathBuf>,
    /// Time of the flight at which the plan has time 0 [s] [default: estimated within a minute].
    #[serde(alias = "plan_delay")]
    #[cfg_attr(feature = "cli", arg(long = "plan-delay", value_name = "SECONDS", requires = "plan"))]
    #[cfg_attr(feature = "cli", arg(allow_negative_numbers = true))]
    pub plan_delay_s: Option<f64>,
    /// Largest allowed distance from the plan [m].
    #[serde(alias = "tube")]
    #[cfg_attr(feature = "cli", arg(long = "tube", value_name = "METRES", requires = "plan"))]
    #[cfg_attr(feature = "cli", arg(allow_negative_numbers = true))]
    pub tube_m: Option<f64>,
    /// Start of the judged window [s].
    #[cfg_attr(feature = "cli", arg(long = "from", value_name = "SECONDS", allow_negative_numbers = true))]
    pub from_s: Option<f64>,
    /// End of the judged window [s].
    #[cfg_attr(feature = "cli", arg(long = "until", value_name = "SECONDS", allow_negative_numbers = true))]
    pub until_s: Option<f64>,
    /// Ignore pairs of vehicles while both are at or below this height [m].
    #[serde(alias = "above")]
    #[cfg_attr(feature = "cli", arg(long = "above", value_name = "Z", allow_negative_numbers = true))]
    pub above_m: Option<f64>,
    /// Obstacles on which vehicles land: ignore these for a vehicle at or below --above; quote a name with a comma.
    /// Repeatable.
    #[cfg_attr(feature = "cli", arg(long, value_name = "NAME,...", value_parser = names))]
    pub land_on: Vec<Names>,
    /// Judge only these vehicles; quote a name with a comma. Repeatable.
    #[cfg_attr(feature = "cli", arg(long, value_name = "NAME,...", value_parser = names))]
    pub ids: Vec<Names>,
    /// Add this to the times of a vehicle with a clock offset [s]; repeatable.
    #[serde(deserialize_with = "offsets")]
    #[cfg_attr(feature = "cli", arg(long, value_name = "NAME=SECONDS", value_parser = offset))]
    pub offset: Vec<(String, f64)>,
    /// Expected number of vehicles; another number is wrong input.
    #[cfg_attr(feature = "cli", arg(long, value_name = "N"))]
    pub expect_vehicles: Option<usize>,
    /// Judge a tautline recording from its samples, without the run's audit of every step.
    #[cfg_attr(feature = "cli", arg(long))]
    pub independent: bool,
    /// Report undecided if a vehicle is absent in part of the window.
    #[cfg_attr(feature = "cli", arg(long))]
    pub require_presence: bool,
    /// Longest time between two samples that is not a gap [s] [default: 1.5 of the vehicle's usual interval].
    #[serde(alias = "max_gap")]
    #[cfg_attr(feature = "cli", arg(long = "max-gap", value_name = "SECONDS", allow_negative_numbers = true))]
    pub max_gap_s: Option<f64>,
    /// Read settings from this file instead of the nearest tautline.toml, which is searched from the folder of the
    /// recording up to the working folder.
    #[cfg_attr(feature = "cli", arg(long, value_name = "FILE"))]
    pub config: Option<PathBuf>,
    /// Ignore all tautline.toml files.
    #[cfg_attr(feature = "cli", arg(long, conflicts_with = "config"))]
    pub no_config: bool,
    /// Exit with 0 for undecided recordings too.
    #[cfg_attr(feature = "cli", arg(long, help_heading = "Output", display_order = 1000))]
    pub allow_undecided: bool,
    /// Directions of the axes of recordings whose [`ReadOptions`](super::super::ReadOptions) state none.
    #[serde(deserialize_with = "parsed")]
    #[cfg_attr(feature = "cli", arg(skip))]
    pub axes: Option<Axes>,
    /// Metres per unit of length of recordings whose [`ReadOptions`](super::super::ReadOptions) state none.
    #[serde(deserialize_with = "parsed")]
    #[cfg_attr(feature = "cli", arg(skip))]
    pub scale: Option<Scale>,
    /// Layout of arrays whose layout is ambiguous.
    #[serde(deserialize_with = "layout")]
    #[cfg_attr(feature = "cli", arg(skip))]
    pub layout: Option<ArrayLayout>,
}

/// Keys of `tautline.toml`, separated by spaces. The other options are those of one audit.
pub(super) const FILE_KEYS: &str = "delta_m radius_m ellipsoid_m cylinder_m well_clear rules motion max_accel_m_s2 \
                                    obstacles fence above_m land_on max_gap_s expect_vehicles layout allow_undecided \
                                    axes scale require_presence accel_window_s limits";

impl AuditOptions {
    /// Returns whether no limit on distances is given.
    pub(super) fn is_silent(&self) -> bool {
        let has_shape = self.ellipsoid_m.is_some() || self.cylinder_m.is_some();
        self.delta_m.is_none() && self.radius_m.is_empty() && !has_shape
    }

    /// Returns these options, with those that are not given taken from a file of settings in `folder`.
    pub(super) fn or(self, file: Self, folder: &Path) -> Self {
        // Limits of distance come either all from the request or all from the file. A mixture would be a third
        // question.
        let distances = if self.is_silent() { &file } else { &self };
        let (delta_m, radius_m) = (distances.delta_m, distances.radius_m.clone());
        let (ellipsoid_m, cylinder_m) = (distances.ellipsoid_m, distances.cylinder_m);
        let motion = self.motion.or(file.motion);
        let takes_max_accel = motion == Some(Interpolation::Bounded) && self.max_accel_m_s2.is_empty();
        let is_open = |limit: &Limit| self.limits.iter().all(|given| given.quantity != limit.quantity);
        let mut limits: Vec<_> = file.limits.into_iter().filter(is_open).collect();
        limits.sort_by_key(|limit| limit.quantity.key());
        Self {
            delta_m,
            radius_m,
            ellipsoid_m,
            cylinder_m,
            motion,
            max_accel_m_s2: if takes_max_accel { file.max_accel_m_s2 } else { self.max_accel_m_s2 },
            limits: self.limits.iter().copied().chain(limits).collect(),
            well_clear: self.well_clear.or(file.well_clear),
            rules: self.rules.or(file.rules),
            obstacles: self.obstacles.or(file.obstacles.map(|file| folder.join(file))),
            accel_window_s: self.accel_window_s.or(file.accel_window_s),
            fence: self.fence.or(file.fence.map(|file| folder.join(file))),
            above_m: self.above_m.or(file.above_m),
            land_on: if self.land_on.is_empty() { file.land_on } else { self.land_on },
            expect_vehicles: self.expect_vehicles.or(file.expect_vehicles),
            require_presence: self.require_presence || file.require_presence,
            max_gap_s: self.max_gap_s.or(file.max_gap_s),
            allow_undecided: self.allow_undecided || file.allow_undecided,
            axes: self.axes.or(file.axes),
            scale: self.scale.or(file.scale),
            layout: self.layout.or(file.layout),
            ..self
        }
    }

    /// Returns the settings of the audit, with the obstacles and the fence of the files.
    ///
    /// # Errors
    /// [`Failure`] if options contradict each other or a file is wrong.
    pub fn settings(&self) -> Result<Settings, Failure> {
        self.check()?;
        let mut vehicles: BTreeMap<String, VehicleSettings> = BTreeMap::new();
        for (name, radius_m) in once_each(RADIUS, named(&self.radius_m))? {
            vehicles.entry(name.clone()).or_default().radius_m = Some(radius_m);
        }
        for (name, max_accel_m_s2) in once_each(MAX_ACCEL, named(&self.max_accel_m_s2))? {
            vehicles.entry(name.clone()).or_default().max_accel_m_s2 = Some(max_accel_m_s2);
        }
        for (name, offset_s) in once_each(OFFSET, self.offset.iter().map(|(name, offset_s)| (name, *offset_s)))? {
            vehicles.entry(name.clone()).or_default().offset_s = offset_s;
        }
        let names = |lists: &[Names]| lists.iter().flat_map(|Names(names)| names.iter().cloned()).collect();
        Ok(Settings {
            delta_m: self.delta_m,
            motion: self.motion,
            max_accel_m_s2: of_all(MAX_ACCEL, &self.max_accel_m_s2)?,
            radius_m: of_all(RADIUS, &self.radius_m)?,
            ellipsoid_m: self.ellipsoid_m,
            cylinder: self.cylinder_m,
            well_clear: self.well_clear,
            from_s: self.from_s,
            until_s: self.until_s,
            above_m: self.above_m,
            land_on: names(&self.land_on),
            max_gap_s: self.max_gap_s,
            require_presence: self.require_presence,
            vehicles,
            only: (!self.ids.is_empty()).then(|| names(&self.ids)),
            obstacles: self.obstacles.as_deref().map_or(Ok(Vec::new()), venue_file::read_obstacles)?,
            yaw: BTreeMap::new(),
            envelope: Envelope {
                limits: self.limits.clone(),
                fence: self.fence.as_deref().map(venue_file::read_fence).transpose()?,
            },
            accel_window_s: self.accel_window_s,
        })
    }

    /// Rejects options that contradict each other, and numbers of a plan that are out of range.
    fn check(&self) -> Result<(), Failure> {
        if !self.max_accel_m_s2.is_empty() && self.motion != Some(Interpolation::Bounded) {
            let bounded = MOTION.set("bounded");
            return Err(Failure::input(
                "audit/unused-acceleration",
                format!("{MAX_ACCEL} has no effect without {bounded}"),
                format!("add {bounded}, or leave {MAX_ACCEL} out"),
            ));
        }
        if self.ellipsoid_m.is_some() && !self.radius_m.is_empty() {
            return Err(Failure::input(
                "audit/radius-and-ellipsoid",
                format!("{RADIUS} and {ELLIPSOID} are both given"),
                "an ellipsoid has its own size: leave one of them out",
            ));
        }
        if !self.ids.is_empty() && self.ids.iter().all(|Names(names)| names.is_empty()) {
            let help = format!("name at least one vehicle, or leave {IDS} out to judge all");
            return Err(Failure::input("audit/nothing-to-judge", format!("{IDS} names no vehicle"), help));
        }
        let jumps = self.motion.filter(|motion| matches!(motion, Interpolation::Hold | Interpolation::Bounded));
        if let Some(motion) = jumps.filter(|_| self.well_clear.is_some()) {
            return Err(RecordedError::WellClearMotion { motion: motion.name() }.into());
        }
        for (k, limit) in self.limits.iter().enumerate() {
            if self.limits[..k].iter().any(|before| before.quantity == limit.quantity) {
                let message = format!("{LIMIT}: {} is given twice", limit.quantity.name());
                return Err(Failure::input("audit/limit-twice", message, "give each limit once"));
            }
        }
        if let Some(tube_m) = self.tube_m.filter(|tube_m| !(tube_m.is_finite() && *tube_m > 0.0)) {
            let message = format!("{TUBE}: must be a finite number above 0, got {tube_m:?}");
            return Err(Failure::input("audit/out-of-range", message, "give the largest allowed distance in metres"));
        }
        if let Some(delay_s) = self.plan_delay_s.filter(|delay_s| delay_s.is_nan() || delay_s.abs() > MOST_DELAY_S) {
            let message = format!("{PLAN_DELAY}: must be a finite number of at most {MOST_DELAY_S} s, got {delay_s:?}");
            return Err(Failure::input("audit/out-of-range", message, "give the delay in seconds"));
        }
        Ok(())
    }
}

/// Returns the entries of single vehicles.
fn named(entries: &[Entry]) -> impl Iterator<Item = (&String, f64)> {
    entries.iter().filter_map(|(name, value)| Some((name.as_ref()?, *value)))
}

/// Returns the entries of an option. Refuses two values for one vehicle.
fn once_each<'a>(
    option: Opt,
    entries: impl Iterator<Item = (&'a String, f64)>,
) -> Result<BTreeMap<&'a String, f64>, Failure> {
    let mut known = BTreeMap::new();
    for (name, value) in entries {
        if known.insert(name, value).is_some() {
            return Err(twice(option, &format!("vehicle {name}")));
        }
    }
    Ok(known)
}

/// Returns the value of all vehicles. Refuses two.
fn of_all(option: Opt, entries: &[Entry]) -> Result<Option<f64>, Failure> {
    let mut values = entries.iter().filter(|(name, _)| name.is_none()).map(|(_, value)| *value);
    match (values.next(), values.next()) {
        (_, Some(_)) => Err(twice(option, "all vehicles")),
        (value, None) => Ok(value),
    }
}

fn twice(option: Opt, vehicles: &str) -> Failure {
    Failure::input("usage/twice", format!("{option}: two values for {vehicles}"), "give one value")
}

/// Text, a number, or several numbers, which stand for the text with commas between them.
#[derive(Deserialize)]
#[serde(untagged, expecting = "a text, a number or a list of numbers is needed")]
enum Words {
    Text(String),
    Number(f64),
    Numbers(Vec<f64>),
}

/// Parses text or numbers with a function of the command line, which has the same checks.
fn parsed_by<'de, D: Deserializer<'de>, T>(
    given: D,
    parse: fn(&str) -> Result<T, String>,
) -> Result<Option<T>, D::Error> {
    let numbers = |list: &[f64]| list.iter().map(|number| format!("{number:?}")).collect::<Vec<_>>().join(",");
    let text = match Words::deserialize(given)? {
        Words::Text(text) => text,
        Words::Number(number) => numbers(&[number]),
        Words::Numbers(list) => numbers(&list),
    };
    parse(&text).map(Some).map_err(D::Error::custom)
}

fn parsed<'de, D: Deserializer<'de>, T: FromStr<Err = String>>(given: D) -> Result<Option<T>, D::Error> {
    parsed_by(given, T::from_str)
}

fn ellipsoid<'de, D: Deserializer<'de>>(given: D) -> Result<Option<Vector3<f64>>, D::Error> {
    parsed_by(given, rules::ellipsoid)
}

fn cylinder<'de, D: Deserializer<'de>>(given: D) -> Result<Option<Cylinder>, D::Error> {
    parsed_by(given, rules::cylinder)
}

fn well_clear<'de, D: Deserializer<'de>>(given: D) -> Result<Option<WellClear>, D::Error> {
    parsed_by(given, rules::well_clear)
}

fn layout<'de, D: Deserializer<'de>>(given: D) -> Result<Option<ArrayLayout>, D::Error> {
    parsed_by(given, ArrayAxis::layout_of)
}

/// Reads limits by the keys of their quantities, such as `speed_m_s`.
fn limits<'de, D: Deserializer<'de>>(given: D) -> Result<Vec<Limit>, D::Error> {
    let limits = by_name(given, "limits")?.into_iter().map(|(key, allowed)| {
        let quantity = Quantity::NUMBERS.into_iter().find(|quantity| quantity.key() == key);
        quantity.map(|quantity| Limit { quantity, allowed }).ok_or_else(|| D::Error::custom(unknown_limit(&key)))
    });
    limits.collect()
}

/// Returns the error for a key that is no limit.
pub(super) fn unknown_limit(key: &str) -> String {
    format!("`{key}` is not a limit: the limits are {}", Quantity::NUMBERS.map(Quantity::key).join(", "))
}

/// Reads clock offsets by the names of vehicles.
fn offsets<'de, D: Deserializer<'de>>(given: D) -> Result<Vec<(String, f64)>, D::Error> {
    by_name(given, "vehicles")
}

fn by_name<'de, D: Deserializer<'de>>(given: D, names: &str) -> Result<Vec<(String, f64)>, D::Error> {
    let wrong = || D::Error::custom(format!("numbers by the names of {names} are needed"));
    entries(given)?.into_iter().map(|(name, number)| Ok((name.ok_or_else(wrong)?, number))).collect()
}

/// Reads the number of all vehicles, or numbers by the names of vehicles.
fn entries<'de, D: Deserializer<'de>>(given: D) -> Result<Vec<Entry>, D::Error> {
    struct Entries;

    impl<'de> Visitor<'de> for Entries {
        type Value = Vec<Entry>;

        fn expecting(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
            out.write_str("a number, or numbers by name")
        }

        fn visit_f64<E>(self, number: f64) -> Result<Self::Value, E> {
            Ok(vec![(None, number)])
        }

        fn visit_i64<E>(self, number: i64) -> Result<Self::Value, E> {
            Ok(vec![(None, number as f64)])
        }

        fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
            let mut entries = Vec::new();
            while let Some((name, number)) = map.next_entry()? {
                entries.push((Some(name), number));
            }
            Ok(entries)
        }
    }

    given.deserialize_any(Entries)
}

#[cfg(feature = "cli")]
fn motion() -> impl TypedValueParser<Value = Interpolation> {
    let help = |motion| match motion {
        Interpolation::Linear => "Straight lines",
        Interpolation::Hold => "Constant positions, with a jump at each sample",
        Interpolation::Polynomial => "The recording's own curves",
        Interpolation::Bounded => "Any motion within the largest acceleration",
    };
    one_of(Interpolation::ALL.map(|motion| (PossibleValue::new(motion.name()).help(help(motion)), motion)).into())
}

#[cfg(feature = "cli")]
fn names(text: &str) -> Result<Names, String> {
    let mut lines = csv::ReaderBuilder::new().has_headers(false).from_reader(text.as_bytes());
    match lines.records().next() {
        Some(Ok(names)) => Ok(Names(names.iter().map(str::to_owned).collect())),
        Some(Err(error)) => Err(error.to_string()),
        None => Err("give at least one name".to_owned()),
    }
}

#[cfg(feature = "cli")]
fn number(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(number),
        _ => Err(format!("`{text}` is not a number")),
    }
}

#[cfg(feature = "cli")]
fn entry(text: &str) -> Result<Entry, String> {
    match text.rsplit_once('=') {
        Some((name, value)) => Ok((Some(name.to_owned()), number(value)?)),
        None => Ok((None, number(text)?)),
    }
}

#[cfg(feature = "cli")]
fn offset(text: &str) -> Result<(String, f64), String> {
    let (name, value) = text.rsplit_once('=').ok_or("write NAME=SECONDS, such as cf3=-0.12")?;
    Ok((name.to_owned(), number(value)?))
}

/// Parses a limit such as `speed=5`.
#[cfg(feature = "cli")]
fn limit(text: &str) -> Result<Limit, String> {
    let names = || Quantity::NUMBERS.map(Quantity::name).join(", ");
    let (name, value) = text.split_once('=').ok_or_else(|| format!("write LIMIT=VALUE with a limit of {}", names()))?;
    let quantity = Quantity::NUMBERS.into_iter().find(|quantity| quantity.name() == name.trim());
    let quantity = quantity.ok_or_else(|| format!("unknown limit `{name}`; the limits are {}", names()))?;
    Ok(Limit { quantity, allowed: number(value)? })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_of_vehicles_without_a_name_is_refused() {
        let judged = |ids| AuditOptions { ids, ..AuditOptions::default() }.settings().map(|settings| settings.only);
        assert_eq!(judged(vec![]).expect("all vehicles"), None);
        let refused = judged(vec![Names(vec![])]).expect_err("no vehicle");
        assert_eq!(refused.code(), "audit/nothing-to-judge");
    }

    #[test]
    fn numbers_of_a_plan_out_of_range_are_refused() {
        let question = |plan_delay_s, tube_m| AuditOptions { plan_delay_s, tube_m, ..AuditOptions::default() }.check();
        assert!(question(Some(-3.0), Some(0.15)).is_ok() && question(None, None).is_ok());
        for tube_m in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let failure = question(None, Some(tube_m)).expect_err("refused");
            assert!(failure.message().contains(&format!("got {tube_m:?}")), "{}", failure.message());
        }
        for delay_s in [f64::NAN, f64::NEG_INFINITY, 1e300] {
            assert!(question(Some(delay_s), None).is_err(), "{delay_s}");
        }
    }

    #[test]
    fn options_are_read_by_keys_with_and_without_units() {
        let read = |text| toml::from_str::<AuditOptions>(text);
        let options = read("max_gap = inf\nradius = { a = 1, b = 0.5 }\noffset = { a = -1 }\nellipsoid = [1, 1, 2]");
        let options = options.expect("options");
        assert_eq!((options.max_gap_s, options.ellipsoid_m), (Some(f64::INFINITY), Some(Vector3::new(1.0, 1.0, 2.0))));
        let settings = AuditOptions { ellipsoid_m: None, ..options }.settings().expect("settings");
        let of_a = VehicleSettings { radius_m: Some(1.0), offset_s: -1.0, max_accel_m_s2: None };
        assert_eq!((settings.vehicles["a"], settings.vehicles["b"].radius_m), (of_a, Some(0.5)));
        assert!(read("delta = true").is_err() && read("detla = 1").is_err());
    }

    #[cfg(feature = "cli")]
    #[test]
    fn limits_are_read_by_their_names() {
        let read = limit(" climb = 2.5").expect("a limit");
        assert_eq!((read.quantity, read.allowed), (Quantity::Climb, 2.5));
        assert_eq!(
            limit("speed").unwrap_err(),
            "write LIMIT=VALUE with a limit of speed, horizontal, climb, descent, accel, height, floor, \
             navigation-floor, yaw-rate"
        );
        assert!(limit("spee=3").unwrap_err().starts_with("unknown limit `spee`"));
        assert_eq!(limit("speed=NaN").unwrap_err(), "`NaN` is not a number");
    }
}
