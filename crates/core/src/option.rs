//! Options that messages name: one table for the library, the command line and Python.
//!
//! A message names an option by its constant, so that each user reads the spelling of their interface:
//!
//! ```
//! use tautline_core::option::{FPS, TIME_UNIT};
//!
//! let remedy = format!("give {}, or omit {FPS}", TIME_UNIT.set("ms"));
//! assert_eq!(remedy, "give time_unit=ms, or omit fps");
//! ```
//!
//! The library writes the name of the field. A program calls [`spell_with`] at its start to write its own form, such as
//! `--time-unit ms`.

use std::fmt::{self, Display, Formatter};
use std::sync::{PoisonError, RwLock};

/// Kind of the value of an option.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ValueKind {
    /// No value: the option switches something on.
    Flag,
    /// No value: the option switches something off.
    Off,
    /// A number, several numbers separated by commas, or a path.
    Number,
    /// A word.
    Word,
    /// A name and a number, `NAME=NUMBER`.
    NamedNumber,
    /// A name and a word, `NAME=WORD`.
    NamedWord,
}

/// Option of a command, and field of its request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Opt {
    /// Name on the command line, without dashes, such as `time-unit`.
    pub name: &'static str,
    /// Name of the field or argument, such as `time_unit`.
    pub field: &'static str,
    /// Kind of its value.
    pub kind: ValueKind,
}

/// Option with a value, as in a remedy.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OptWithValue {
    /// The option.
    pub option: Opt,
    /// The value as text: a number, a word, or a placeholder in capitals.
    pub value: String,
}

impl Opt {
    /// Returns the option with a value.
    #[must_use]
    pub fn set(self, value: impl Display) -> OptWithValue {
        OptWithValue { option: self, value: value.to_string() }
    }

    /// Returns the option as an argument of a command line, such as `--time-unit`.
    #[must_use]
    pub fn argument(self) -> String {
        format!("--{}", self.name)
    }
}

/// Function that writes an option, with a value if one is given.
pub type Spelling = fn(Opt, Option<&str>, &mut Formatter<'_>) -> fmt::Result;

static SPELLING: RwLock<Spelling> = RwLock::new(as_field);

/// Sets how messages of this process write options. Returns the previous spelling.
pub fn spell_with(spelling: Spelling) -> Spelling {
    std::mem::replace(&mut *SPELLING.write().unwrap_or_else(PoisonError::into_inner), spelling)
}

/// Returns the spelling of this process.
fn spelling() -> Spelling {
    *SPELLING.read().unwrap_or_else(PoisonError::into_inner)
}

/// Writes the name of the field and the value.
fn as_field(option: Opt, value: Option<&str>, out: &mut Formatter<'_>) -> fmt::Result {
    match value {
        Some(value) => write!(out, "{}={value}", option.field),
        None => out.write_str(option.field),
    }
}

/// Writes the option in the spelling of the process.
impl Display for Opt {
    fn fmt(&self, out: &mut Formatter<'_>) -> fmt::Result {
        spelling()(*self, None, out)
    }
}

/// Writes the option and its value in the spelling of the process.
impl Display for OptWithValue {
    fn fmt(&self, out: &mut Formatter<'_>) -> fmt::Result {
        spelling()(self.option, Some(&self.value), out)
    }
}

macro_rules! options {
    ($($constant:ident = $name:literal $field:literal $kind:ident;)*) => {
        $(
            #[doc = concat!("Option `", $name, "`, field `", $field, "`.")]
            pub const $constant: Opt = Opt { name: $name, field: $field, kind: ValueKind::$kind };
        )*

        /// All options that messages name.
        pub const ALL: &[Opt] = &[$($constant),*];
    };
}

options! {
    ABOVE = "above" "above" Number;
    ACCEL = "accel" "accel" Number;
    ACCEL_WINDOW = "accel-window" "accel_window" Number;
    ADAPTER = "adapter" "adapter" Word;
    ALLOW_UNFINISHED = "allow-unfinished" "allow_unfinished" Flag;
    APART = "apart" "apart" Number;
    AXES = "axes" "axes" Word;
    BAD = "bad" "bad" Number;
    BRAKE = "brake" "brake" Number;
    CLOCK = "clock" "clock" Word;
    COLUMN = "column" "column" NamedWord;
    COMPRESSED = "compressed" "compressed" Flag;
    CONTRACT_LOG = "contract-log" "contract_log" Number;
    CSV = "csv" "csv" Number;
    CYLINDER = "cylinder" "cylinder" Number;
    DELTA = "delta" "delta" Number;
    DIMENSIONS = "dimensions" "dimensions" Number;
    DISTINCT = "distinct" "distinct" Flag;
    DUPLICATES = "duplicates" "duplicates" Word;
    ELLIPSOID = "ellipsoid" "ellipsoid" Number;
    EXPECT = "expect" "expect" Number;
    EXPECT_VEHICLES = "expect-vehicles" "expect_vehicles" Number;
    EXPORT_FORMAT = "format" "to" Word;
    FENCE = "fence" "fence" Number;
    FILM = "film" "film" Number;
    FILM_FPS = "film-fps" "film_fps" Number;
    FLIGHTS = "flights" "flights" Number;
    FORCE = "force" "overwrite" Flag;
    FORMAT = "input-format" "format" Word;
    FPS = "fps" "fps" Number;
    FRAME = "frame" "frame" Word;
    FROM = "from" "from_s" Number;
    HALVINGS = "halvings" "halvings" Number;
    HORIZON = "horizon" "horizon" Number;
    HTML = "html" "html" Number;
    IDENTIFY = "identify" "identify" Flag;
    IDS = "ids" "ids" Number;
    INDEPENDENT = "independent" "independent" Flag;
    JOIN = "join" "join" Flag;
    JSON = "json" "json" Number;
    LAND_ON = "land-on" "land_on" Word;
    LATENCY = "latency" "latency" Number;
    LATEX = "latex" "latex" Number;
    LAW = "law" "law" Word;
    LAWS = "laws" "laws" Word;
    LAYOUT = "layout" "layout" Word;
    LIMIT = "limit" "limit" NamedNumber;
    LOG = "log" "log" Flag;
    MARGIN_KEY = "key" "key" NamedNumber;
    MAX_ACCEL = "max-accel" "max_accel" NamedNumber;
    MAX_AGE = "max-age" "max_age" Number;
    MAX_GAP = "max-gap" "max_gap" Number;
    MAX_VEHICLES = "max-vehicles" "max_vehicles" Number;
    MOVE_START = "move-start" "start" Number;
    MOTION = "motion" "motion" Word;
    NO_CONFIG = "no-config" "config" Off;
    OBSTACLES = "obstacles" "obstacles" Number;
    OFFSET = "offset" "offset" NamedNumber;
    ONE_VEHICLE = "one-vehicle" "one_vehicle" Flag;
    ORIGIN = "origin" "origin" Number;
    OUT = "out" "out" Number;
    OUTPUT = "out" "output" Number;
    PLAN = "plan" "plan" Number;
    PLAN_DELAY = "plan-delay" "plan_delay" Number;
    PLAN_END = "plan-end" "plan_end" Word;
    POSITION_ERROR = "position-error" "position_error" Number;
    PROOF = "proof" "proof" Number;
    PYTHON_LAW = "python-law" "law" Word;
    RADIUS = "radius" "radius" NamedNumber;
    REQUIRE_PRESENCE = "require-presence" "require_presence" Flag;
    RULES = "rules" "rules" Word;
    RUN = "run" "run" Number;
    RUNS = "runs" "runs" Number;
    SAMPLE_HZ = "sample-hz" "sample_hz" Number;
    SCALE = "scale" "scale" Number;
    SCAN = "scan" "scan" Number;
    SEED = "seed" "seed" Number;
    SEEDS = "seeds" "seeds" Number;
    SET = "set" "set" NamedWord;
    SHARD = "shard" "shard" Number;
    SHARDS = "shards" "shards" Number;
    SIZE = "size" "size" Number;
    SKIP_INCOMPLETE = "skip-incomplete" "skip_incomplete" Flag;
    SKYB_VERSION = "skyb-version" "skyb_version" Number;
    SORT = "sort" "sort" Flag;
    START = "start" "start" NamedNumber;
    SWEEP_KEY = "key" "keys" Word;
    THREADS = "threads" "threads" Number;
    TIME_SCALE = "time-scale" "time_scale" Number;
    TIME_UNIT = "time-unit" "time_unit" Word;
    TOLERANCE = "tolerance" "tolerance" Number;
    TOPIC = "topic" "topic" Word;
    TUBE = "tube" "tube" Number;
    UNTIL = "until" "until_s" Number;
    UNTIL_DECIDED = "until-decided" "until_decided" Number;
    UNTIL_WIDTH = "until-width" "until_width" Number;
    VARY = "vary" "vary" NamedNumber;
    VELOCITY = "velocity" "velocity" Number;
    VELOCITY_ERROR = "velocity-error" "velocity_error" Number;
    VERDICT = "verdict" "verdict" Word;
    WELL_CLEAR = "well-clear" "well_clear" Word;
    WORST = "worst" "worst" Number;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_library_writes_fields_and_an_argument_is_of_the_command_line() {
        assert_eq!(format!("{NO_CONFIG}, {}", COLUMN.set("id=NAME")), "config, column=id=NAME");
        assert_eq!(MAX_ACCEL.argument(), "--max-accel");
    }

    #[test]
    fn an_option_is_in_the_table_once() {
        for (k, option) in ALL.iter().enumerate() {
            assert!(ALL[..k].iter().all(|other| other != option), "{option:?}");
            assert_eq!(option.name, option.name.to_lowercase());
        }
    }
}
