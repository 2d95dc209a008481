//! Parses times and dates, finds their columns, and converts them to seconds.

use std::cmp::Ordering;
use std::fmt::Write as _;

use chrono::{DateTime, NaiveDateTime};

use super::error::{ContentKind, Fault, quoted, refuse};
use super::heading;
use super::options::ReadOptions;
use super::time_unit::{TimeUnit, seconds_of};
use tautline_core::option::{COLUMN, FPS, TIME_SCALE, TIME_UNIT};
use tautline_core::track::Clock;

/// Distance from zero from which a clock is counted from an epoch \[s\]: doubles are coarser than 0.1 ns there.
const EPOCH_FROM_S: f64 = 1e6;

/// Length of a step from which times are not times since 1970, if most steps are as long \[s\]. The unit is smaller.
const LONGEST_STEP_S: f64 = 1e3;

/// Years 2000 to 2100 in seconds since 1970. Times in this range may be times since 1970.
const RECORDED_S: std::ops::Range<f64> = 946_684_800.0..4_102_444_800.0;

/// Reason for inferring a unit shorter than a second from whole numbers.
const BY_STEPS: &str = "because they are whole numbers with steps of that size";

/// Limit of the whole part of a double, below the range of 64 bits.
const TOP: f64 = 9.3e18;

/// Limit below which doubles represent whole numbers exactly.
pub(super) const EXACT: f64 = 9_007_199_254_740_992.0;

/// Number of decimals of a [`Stamp::Fixed`].
const DECIMALS: usize = 18;

/// Exact time in the unit of the recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Stamp {
    /// Whole number of units.
    Whole(i64),
    /// Number that a double represents accurately enough.
    Real(f64),
    /// Positive decimal number too long for a double: whole units and units of 10^-18.
    Fixed { whole: i64, decimals: u64 },
}

impl Stamp {
    /// Parses a time; `None` if the text is not a number. The result may be infinite or NaN.
    pub(super) fn parse(text: &str) -> Option<Self> {
        let digits = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
        if let Some((whole, fraction)) = text.split_once('.') {
            // From seven digits on, a double loses decimals of the text.
            if whole.len() >= 7 && digits(whole) && digits(fraction) && fraction.len() <= DECIMALS {
                let decimals = fraction.bytes().chain(std::iter::repeat(b'0')).take(DECIMALS);
                let decimals = decimals.fold(0, |sum: u64, digit| 10 * sum + u64::from(digit - b'0'));
                if let Ok(whole) = whole.parse() {
                    return Some(Self::Fixed { whole, decimals });
                }
            }
        } else if let Ok(whole) = text.parse() {
            return Some(Self::Whole(whole));
        }
        text.parse().ok().map(Self::Real)
    }

    /// Returns the time as a whole number; `None` if it has a fraction.
    pub(super) fn whole(self) -> Option<i64> {
        match self {
            Self::Whole(whole) | Self::Fixed { whole, decimals: 0 } => Some(whole),
            #[expect(clippy::cast_possible_truncation, reason = "a whole number below 2^53")]
            Self::Real(real) if real.fract() == 0.0 && real.abs() < EXACT => Some(real as i64),
            Self::Real(_) | Self::Fixed { .. } => None,
        }
    }

    /// Returns the nearest double \[units\].
    pub(super) fn approximately(self) -> f64 {
        match self {
            Self::Whole(whole) => whole as f64,
            Self::Real(real) => real,
            Self::Fixed { whole, decimals } => whole as f64 + decimals as f64 * 1e-18,
        }
    }

    /// Total order, also between different variants.
    pub(super) fn compare(self, other: Self) -> Ordering {
        match (self, other) {
            (Self::Whole(a), Self::Whole(b)) => a.cmp(&b),
            (Self::Real(a), Self::Real(b)) => a.total_cmp(&b),
            _ => {
                let ((a, c), (b, d)) = (self.digits(), other.digits());
                (a, c).cmp(&(b, d)).then(self.approximately().total_cmp(&other.approximately()))
            }
        }
    }

    /// Returns the floor and the rest in units of 10^-18.
    fn digits(self) -> (i64, u64) {
        match self {
            Self::Whole(whole) => (whole, 0),
            Self::Fixed { whole, decimals } => (whole, decimals),
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the casts saturate")]
            Self::Real(real) => (real.floor() as i64, ((real - real.floor()) * 1e18) as u64),
        }
    }

    /// Returns the difference to a whole number, rounded once \[units\].
    fn since(self, epoch: i64) -> f64 {
        match self {
            Self::Whole(whole) => (i128::from(whole) - i128::from(epoch)) as f64,
            Self::Real(real) if epoch == 0 => real,
            Self::Real(real) => real - epoch as f64,
            Self::Fixed { whole, decimals } => match whole.checked_sub(epoch) {
                Some(whole) if whole >= 0 => {
                    // Parsing the decimal text of the difference rounds correctly.
                    let mut text = String::with_capacity(40);
                    let _ = write!(text, "{whole}.{decimals:018}");
                    text.parse().unwrap_or(f64::NAN)
                }
                _ => (i128::from(whole) - i128::from(epoch)) as f64 + decimals as f64 * 1e-18,
            },
        }
    }
}

/// Smallest step that may be in milliseconds: vehicles are recorded at most 500 times a second.
const LONG_STEP: f64 = 2.0;

/// Properties of the times of a recording.
#[derive(Clone, Debug)]
pub(super) struct Probe {
    first: Stamp,
    last: Stamp,
    /// Last time \[units\].
    last_time: f64,
    /// Smallest step between two different times \[units\].
    step: f64,
    /// Last time of each vehicle \[units\].
    last_of: Vec<Option<f64>>,
    /// Number of rows.
    pub(super) rows: u64,
    /// Number of steps of one vehicle, and of those that are at least 2 and at least 1000 seconds in each unit.
    steps: u64,
    long_steps: [[u64; 2]; TimeUnit::ALL.len()],
    /// Whether all times are written as whole numbers.
    whole: bool,
    /// Whether all times are whole numbers in any notation.
    integral: bool,
    /// Whether no time was smaller than the one before.
    pub(super) in_order: bool,
}

impl Probe {
    pub(super) fn new(first: Stamp) -> Self {
        let (whole, integral) = (matches!(first, Stamp::Whole(_)), first.whole().is_some());
        Self {
            first,
            last: first,
            last_time: first.since(0),
            step: f64::INFINITY,
            last_of: Vec::new(),
            rows: 0,
            steps: 0,
            long_steps: Default::default(),
            whole,
            integral,
            in_order: true,
        }
    }

    /// Records the time of a row of a vehicle.
    pub(super) fn observe(&mut self, stamp: Stamp, vehicle: usize) {
        self.rows += 1;
        if vehicle >= self.last_of.len() {
            self.last_of.resize(vehicle + 1, None);
        }
        let time = if stamp == self.last { self.last_time } else { stamp.since(0) };
        if let Some(before) = self.last_of[vehicle].replace(time).filter(|before| *before != time) {
            self.steps += 1;
            let step = (time - before).abs();
            // A step that is short in seconds is short in every unit.
            if step >= LONG_STEP {
                for (counts, unit) in self.long_steps.iter_mut().zip(TimeUnit::ALL) {
                    let step_s = step / unit.per_second() as f64;
                    for (count, least_s) in counts.iter_mut().zip([LONG_STEP, LONGEST_STEP_S]) {
                        *count += u64::from(step_s >= least_s);
                    }
                }
            }
        }
        let order = self.last.compare(stamp);
        if order == Ordering::Equal {
            return;
        }
        self.in_order &= order == Ordering::Less;
        self.whole &= matches!(stamp, Stamp::Whole(_));
        self.integral &= stamp.whole().is_some();
        self.step = self.step.min((time - self.last_time).abs());
        if self.first.compare(stamp) == Ordering::Greater {
            self.first = stamp;
        }
        (self.last, self.last_time) = (stamp, time);
    }

    /// Returns whether all rows have one time.
    pub(super) fn is_one_instant(&self) -> bool {
        self.step.is_infinite()
    }

    /// Returns the most likely unit for times of this size and step, the reason, and the other unit that fits as well.
    ///
    /// Times since 1970 are recognised by size, unless most steps of a vehicle are too long. With most steps of two
    /// seconds or more they may also be times since a computer started, in a smaller unit. Other whole numbers are
    /// recognised by their step: vehicles are recorded up to 500 times a second, and rarely more slowly than every two
    /// seconds. All other times are in seconds.
    fn likely_unit(&self) -> (TimeUnit, &'static str, Option<TimeUnit>) {
        let size = self.first.approximately();
        let are_most = |count: u64| 2 * count > self.steps;
        let mut units = TimeUnit::ALL.into_iter().zip(self.long_steps);
        let by_size = units.find(|(unit, [_, longest])| {
            let per_second = unit.per_second() as f64;
            !are_most(*longest) && (RECORDED_S.start * per_second..RECORDED_S.end * per_second).contains(&size)
        });
        if let Some((unit, [long, _])) = by_size {
            let smaller = units.next().map(|(smaller, _)| smaller);
            return (unit, "because they are of the size of times since 1970", smaller.filter(|_| are_most(long)));
        }
        let (unit, why) = match self.step {
            step if !self.whole || !step.is_finite() => (TimeUnit::Seconds, "which is the default"),
            step if step >= 1e6 => (TimeUnit::Nanoseconds, BY_STEPS),
            step if step >= 1e3 => (TimeUnit::Microseconds, BY_STEPS),
            step if step >= LONG_STEP => (TimeUnit::Milliseconds, BY_STEPS),
            _ => (TimeUnit::Seconds, "which is the default"),
        };
        // A long step in seconds may be a short step in a smaller unit.
        let other = if unit == TimeUnit::Seconds { TimeUnit::Milliseconds } else { TimeUnit::Seconds };
        let is_unsure = self.step.is_finite() && (self.integral || self.step >= LONG_STEP);
        (unit, why, is_unsure.then_some(other))
    }
}

/// Converter of stamps to seconds.
#[derive(Clone, Debug)]
pub(super) struct Timing {
    pub(super) clock: Clock,
    /// Number of units per second.
    pub(super) per_second: f64,
    /// Epoch: a whole number of seconds, in units.
    epoch: i64,
}

impl Timing {
    /// Returns a clock for the probed times, and a note if its unit was inferred.
    pub(super) fn settle(probe: &Probe, known: Option<TimeUnit>) -> (Self, Option<String>) {
        let inferred = || {
            let (unit, why, other) = probe.likely_unit();
            (unit, Some(why), other)
        };
        let (unit, why, other) = known.map_or_else(inferred, |unit| (unit, None, None));
        let name = unit.name();
        let note = why.map(|why| {
            let confirmed = TIME_UNIT.set(name);
            format!("times carry no unit and are taken as {name}, {why} (confirm with {confirmed})")
        });
        let per_second = unit.per_second();
        let seconds = probe.first.digits().0.div_euclid(per_second);
        let fits = probe.first.approximately().abs() < TOP;
        let seconds = Some(seconds).filter(|&seconds| fits && (seconds as f64).abs() >= EPOCH_FROM_S);
        let epoch = seconds.and_then(|s| Some((s.checked_mul(per_second)?, s.checked_mul(1_000_000_000)?)));
        let (epoch, epoch_ns) = epoch.unwrap_or((0, 0));
        let clock = Clock { unit: name, inferred: why.is_some(), other_unit: other.map(TimeUnit::name), epoch_ns };
        (Self { clock, per_second: per_second as f64, epoch }, note)
    }

    /// Returns a clock with `per_second` units per second.
    pub(super) fn given(per_second: f64) -> Self {
        Self { clock: Clock { unit: "given", ..Clock::default() }, per_second, epoch: 0 }
    }

    /// Returns the longest duration that a difference of times can mean \[s\]: with a guessed unit, the numbers may be
    /// seconds.
    pub(super) fn longest_s(&self, difference_s: f64) -> f64 {
        if self.clock.other_unit.is_some() { difference_s * self.per_second } else { difference_s }
    }

    /// Returns the seconds since the epoch.
    pub(super) fn seconds(&self, stamp: Stamp) -> f64 {
        stamp.since(self.epoch) / self.per_second
    }
}

/// Instant, and whether its text has a time zone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Date {
    /// Time since 1970 \[ns\]; a text without a zone counts as UTC.
    pub(super) since_1970_ns: i64,
    pub(super) has_zone: bool,
}

impl Date {
    /// Parses a date with a time of day, separated by `T` or a blank, with or without a zone. Returns `None` for other
    /// text and outside the years 1678 to 2261.
    pub(super) fn parse(text: &str) -> Option<Self> {
        let text = text.trim();
        // The shortest form is `2023-11-14T22:13:20`.
        let (day, of_day) = text.split_at_checked(10).filter(|(day, _)| day.as_bytes()[4] == b'-')?;
        let of_day = of_day.strip_prefix(['T', 't', ' '])?.replacen(',', ".", 1);
        let text = format!("{day}T{of_day}").replace('z', "Z");
        if let Ok(local) = NaiveDateTime::parse_from_str(&text, "%Y-%m-%dT%H:%M:%S%.f") {
            return Some(Self { since_1970_ns: local.and_utc().timestamp_nanos_opt()?, has_zone: false });
        }
        let text = text.strip_suffix('Z').map_or_else(|| text.clone(), |before| format!("{}+00:00", before.trim_end()));
        let zoned = DateTime::parse_from_str(&text, "%Y-%m-%dT%H:%M:%S%.f%#z").ok()?;
        Some(Self { since_1970_ns: zoned.timestamp_nanos_opt()?, has_zone: true })
    }
}

/// Words before the unit of a column with a part of a time, as in `header.stamp.nanosec`.
const CLOCK_WORDS: [&str; 8] = ["", "t", "time", "timestamp", "stamp", "header", "tv", "unix"];

/// Column with the remainder of a time, in a smaller unit than the first column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct SubunitColumn {
    pub(super) column: usize,
    /// Number of units of this column per unit of the first.
    per_unit: i64,
    /// Unit of this column and of the sum.
    pub(super) unit: TimeUnit,
}

impl SubunitColumn {
    /// Returns the exact time of a row.
    pub(super) fn join(self, whole: Stamp, rest: Stamp, header: &[String], first: usize) -> Result<Stamp, Fault> {
        let (first, own) = (quoted(&header[first]), quoted(&header[self.column]));
        let problem = match (whole.whole(), rest.whole()) {
            (Some(units), Some(below)) if (0..self.per_unit).contains(&below) => {
                let joined = units.checked_mul(self.per_unit).and_then(|time| time.checked_add(below));
                return joined.map(Stamp::Whole).ok_or_else(Fault::out_of_range);
            }
            (Some(_), Some(below)) => {
                format!("column {own} holds {below}, which is not a remainder of a unit of {first}")
            }
            (None, _) => {
                format!("column {first} holds {}, which must be whole beside {own}", whole.approximately())
            }
            (_, None) => format!("column {own} holds {}, which is not a whole number", rest.approximately()),
        };
        let remedy = format!("if one of the two is the whole time, name it with {}", COLUMN.set("t=NAME"));
        refuse(ContentKind::TimeFormat, problem, remedy)
    }
}

/// Column with a time or a part of a time.
struct Candidate {
    column: usize,
    /// Name before the unit; empty for the unit alone.
    stem: String,
    unit: Option<TimeUnit>,
}

/// Returns the time column of a header, and the column of the remainder if there is one; `None` without a time.
pub(super) fn time_columns(
    header: &[String],
    options: &ReadOptions,
) -> Result<Option<(usize, Option<SubunitColumn>)>, Fault> {
    let mut candidates: Vec<_> =
        header.iter().enumerate().filter_map(|(column, name)| candidate(column, name)).collect();
    // Names such as `epoch` and `time_boot_ms` give the time only in a table without another time.
    if candidates.iter().any(|candidate| heading::is_main_time(&header[candidate.column])) {
        let is_second = |name: &str| heading::is_time(name) && !heading::is_main_time(name);
        candidates.retain(|candidate| !is_second(&header[candidate.column]));
    }
    let is_whole_time = |candidate: &Candidate| heading::is_time(&header[candidate.column]);
    // A part alone, such as `sec` or `ms`, is not a time: the whole is unknown.
    if candidates.len() == 1 && !is_whole_time(&candidates[0]) {
        candidates.clear();
    }
    match &candidates[..] {
        [] => Ok(header.iter().position(|name| heading::is_frame(name)).map(|column| (column, None))),
        [only] => Ok(Some((only.column, None))),
        [a, b] => {
            let pair = [(a, b), (b, a)].into_iter().find_map(|(whole, rest)| Some((whole, rest, split(whole, rest)?)));
            let Some((whole, _, rest)) = pair else { return Err(both(header, a, b)) };
            if options.time_unit.is_some() || options.times_per_second.is_some() {
                let (whole, own) = (quoted(&header[whole.column]), quoted(&header[rest.column]));
                let problem = format!("times are split over the columns {whole} and {own}, whose units are known");
                let remedy = format!("omit {TIME_UNIT}, {FPS} and {TIME_SCALE}");
                return refuse(ContentKind::ContradictsOption, problem, remedy);
            }
            Ok(Some((whole.column, Some(rest))))
        }
        [a, b, ..] => Err(both(header, a, b)),
    }
}

/// Returns whether a column with this name gives a time or a part of a time.
pub(super) fn is_part_of_time(name: &str) -> bool {
    candidate(0, name).is_some()
}

fn candidate(column: usize, name: &str) -> Option<Candidate> {
    let (stem, unit) = heading::time_and_unit(name);
    let known = unit.as_deref().and_then(TimeUnit::from_name);
    if heading::is_time(name) {
        return Some(Candidate { column, stem, unit: known });
    }
    // In `sec`, `tv_usec` and `header.stamp.nanosec` the last word is a unit of more than one letter.
    let name = name.trim().to_lowercase();
    let (before, word) = name.rsplit_once(['.', '/', '_', ' ']).unwrap_or(("", &name));
    let unit = TimeUnit::from_name(word).filter(|_| word.len() > 1)?;
    let is_clock = before.rsplit(['.', '/', '_', ' ']).next().is_some_and(|word| CLOCK_WORDS.contains(&word));
    // The same words after other names, such as `flight_sec`, are durations.
    is_clock.then(|| Candidate { column, stem: before.to_owned(), unit: Some(unit) })
}

/// Returns how `rest` continues `whole`, if they can be two parts of a time.
fn split(whole: &Candidate, rest: &Candidate) -> Option<SubunitColumn> {
    let unit = rest.unit?;
    let per_unit = unit.per_second() / whole.unit.unwrap_or(TimeUnit::Seconds).per_second();
    let are_of_one = whole.stem == rest.stem || whole.stem.is_empty() || rest.stem.is_empty();
    (are_of_one && per_unit > 1).then_some(SubunitColumn { column: rest.column, per_unit, unit })
}

fn both(header: &[String], a: &Candidate, b: &Candidate) -> Fault {
    let (first, second) = (quoted(&header[a.column]), quoted(&header[b.column]));
    let problem = format!("the columns {first} and {second} both give the time");
    let remedy = format!("name one of them with {}, or remove the other", COLUMN.set("t=NAME"));
    Fault::content(ContentKind::AmbiguousColumn, problem, remedy)
}

/// Relative rounding of a unit of time.
const ROUNDING: f64 = 1e-9;

/// Returns the unit in the name of a time column, unless the user gives the unit. Refuses a given unit that contradicts
/// the name.
pub(super) fn unit_of_time(name: &str, options: &ReadOptions) -> Result<Option<TimeUnit>, Fault> {
    let given = options.time_unit.map(|unit| unit.per_second() as f64).or(options.times_per_second);
    if let Some(given) = given {
        let named = heading::time_and_unit(name).1.and_then(|unit| Some((seconds_of(&unit)?, unit)));
        return match named.filter(|(seconds, _)| (seconds * given - 1.0).abs() > ROUNDING) {
            None => Ok(None),
            Some((_, unit)) => {
                let problem = format!("column {} is in {} by its name, but another unit is given", quoted(name), unit);
                let remedy = "leave the unit to the name, or rename the column if its name is wrong";
                Err(Fault::content(ContentKind::UnitConflict, problem, remedy))
            }
        };
    }
    if heading::is_frame(name) {
        return Err(Fault::frames(format!("its times are the numbers of frames in column {}", quoted(name))));
    }
    // `time (utc)` gives a zone, not a unit.
    let is_zone = |unit: &String| matches!(unit.as_str(), "utc" | "gmt" | "iso8601" | "iso 8601");
    let Some(unit) = heading::time_and_unit(name).1.filter(|unit| !is_zone(unit)) else { return Ok(None) };
    TimeUnit::from_name(&unit).map(Some).ok_or_else(|| {
        let problem = format!("column {} has an unknown unit of time, {}", quoted(name), quoted(&unit));
        let remedy = format!("set its length in seconds with {TIME_SCALE}, such as 60 for minutes");
        Fault::content(ContentKind::UnknownUnit, problem, remedy)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn timing(texts: &[&str], known: Option<TimeUnit>) -> (Timing, Option<String>, Vec<f64>) {
        let stamps: Vec<_> = texts.iter().map(|text| Stamp::parse(text).expect("a number")).collect();
        let mut probe = Probe::new(stamps[0]);
        for &stamp in &stamps {
            probe.observe(stamp, 0);
        }
        let (timing, note) = Timing::settle(&probe, known);
        let seconds = stamps.iter().map(|&stamp| timing.seconds(stamp)).collect();
        (timing, note, seconds)
    }

    #[test]
    fn nanosecond_clock_keeps_all_digits() {
        let (timing, note, seconds) = timing(&["1700000000123456789", "1700000000123456790"], None);
        assert_eq!(
            timing.clock,
            Clock { unit: "ns", inferred: true, other_unit: None, epoch_ns: 1_700_000_000_000_000_000 }
        );
        assert_eq!(seconds, [0.123_456_789, 0.123_456_790]);
        assert!(note.is_some_and(|note| note.contains("taken as ns")));
    }

    #[test]
    fn decimal_seconds_since_1970_keep_all_digits() {
        let (timing, _, seconds) = timing(&["1700000000.123456789", "1700000003.000000001"], None);
        assert_eq!((timing.clock.unit, timing.clock.epoch_ns), ("s", 1_700_000_000_000_000_000));
        assert_eq!(seconds, [0.123_456_789, 3.000_000_001]);
    }

    #[test]
    fn small_times_keep_the_bits_of_their_text() {
        let (timing, note, seconds) = timing(&["0.1", "0.30000000000000004", "7"], Some(TimeUnit::Seconds));
        assert_eq!((timing.clock.epoch_ns, note), (0, None));
        assert_eq!(seconds, [0.1, 0.300_000_000_000_000_04, 7.0]);
    }

    #[test]
    fn units_are_inferred_from_steps_unless_the_size_decides() {
        for (texts, unit, by_steps) in [
            (["0", "10"], "ms", true),
            (["0", "10000"], "us", true),
            (["0", "10000000"], "ns", true),
            (["0", "1"], "s", true),
            (["0", "0.02"], "s", false),
            (["0.5", "10.5"], "s", true),
            (["1700000000000", "1700000000010"], "ms", false),
            (["1700000000000000", "1700000000010000"], "us", false),
            (["1700000000", "1700000001"], "s", false),
            (["1700000000", "1700000002"], "s", true),
            (["1700000000", "1700000600"], "s", true),
            (["500000000", "500000300"], "ms", true),
            (["1500000000", "1500005000"], "us", true),
            (["1500000000", "1510000000"], "ns", true),
            (["200000000", "200010000"], "us", true),
            (["500000000000", "500010000000"], "ns", true),
        ] {
            let clock = timing(&texts, None).0.clock;
            assert_eq!((clock.unit, clock.other_unit.is_some()), (unit, by_steps), "{texts:?}");
        }
    }

    #[test]
    fn a_given_unit_is_that_of_the_name() {
        let given = |name: &str, per_second: f64| {
            unit_of_time(name, &ReadOptions { times_per_second: Some(per_second), ..ReadOptions::default() })
        };
        // A reciprocal is rounded.
        for (name, per_second) in [("t_ns", 1e-9_f64.recip()), ("t_min", 60.0_f64.recip()), ("t", 7.0), ("t_s", 1.0)] {
            assert_eq!(given(name, per_second).ok(), Some(None), "{name}");
        }
        for (name, per_second) in [("t_ms", 1.0), ("t_min", 3600.0_f64.recip()), ("t_min", 1e9), ("t_s", 1000.0)] {
            assert!(given(name, per_second).is_err(), "{name}");
        }
    }

    #[test]
    fn whole_numbers_and_long_steps_leave_the_unit_uncertain() {
        for (texts, by_steps) in
            [(["0.0", "10.0"], true), (["0", "1"], true), (["0.0", "10.5"], true), (["0.0", "1.5"], false)]
        {
            let clock = timing(&texts, None).0.clock;
            assert_eq!((clock.unit, clock.other_unit.is_some()), ("s", by_steps), "{texts:?}");
            assert_eq!(timing(&texts, Some(TimeUnit::Seconds)).0.clock.other_unit, None);
        }
    }

    /// Returns the clock of rows: times and vehicles.
    fn clock_of(rows: impl Iterator<Item = (i64, usize)>) -> Clock {
        let mut probe: Option<Probe> = None;
        for (time, vehicle) in rows {
            let stamp = Stamp::Whole(time);
            probe.get_or_insert_with(|| Probe::new(stamp)).observe(stamp, vehicle);
        }
        Timing::settle(&probe.expect("rows"), None).0.clock
    }

    #[test]
    fn steps_are_those_of_one_vehicle() {
        // Times since the start of a computer, at 100 Hz, in each unit. All vehicles have times of their own.
        for (start, step, other) in
            [(1_500_000_000, 10, "ms"), (1_500_000_000_000, 10_000, "us"), (1_500_000_000_000_000, 10_000_000, "ns")]
        {
            let row = |k: i64| {
                (0_u8..6).map(move |vehicle| (start + step * k + step / 8 * i64::from(vehicle), vehicle.into()))
            };
            let clock = clock_of((0..50).flat_map(row));
            assert_eq!(clock.other_unit, Some(other), "{clock:?}");
        }
        // Unix times at 1 Hz with a gap, of 20 vehicles one after another over a day.
        let blocks = (0_u8..20).flat_map(|vehicle| {
            let start = 1_700_000_000 + 4000 * i64::from(vehicle);
            (0..100).map(move |k| (start + k + if k > 50 { 700 } else { 0 }, vehicle.into()))
        });
        let clock = clock_of(blocks);
        assert_eq!((clock.unit, clock.other_unit), ("s", None));
        // Every five seconds, seconds and milliseconds fit.
        let clock = clock_of((0..50).map(|k| (1_700_000_000_000 + 5000 * k, 0)));
        assert_eq!((clock.unit, clock.other_unit), ("ms", Some("us")));
    }

    #[test]
    fn stamps_of_all_variants_have_one_order() {
        let texts = [
            "-1",
            "-1e-3",
            "-1e-30",
            "0",
            "1e-30",
            "9999999",
            "9999999.000000000000000001",
            "9999999.1",
            "1.7e9",
            "1700000000.00000005",
            "1700000000.0000001",
            "1700000000.5",
            "1700000001",
            "1e30",
        ];
        let stamps = texts.map(|text| Stamp::parse(text).expect("a number"));
        for (i, a) in stamps.iter().enumerate() {
            for (j, b) in stamps.iter().enumerate() {
                assert_eq!(a.compare(*b), i.cmp(&j), "{} and {}", texts[i], texts[j]);
            }
        }
        let same = ["1700000000", "1700000000.0", "1.7e9"].map(|text| Stamp::parse(text).expect("a number"));
        assert!(same.iter().all(|a| same.iter().all(|b| a.compare(*b) == Ordering::Equal)), "{same:?}");
    }

    #[test]
    fn decreasing_time_is_detected() {
        let mut probe = Probe::new(Stamp::Whole(2));
        probe.observe(Stamp::Whole(2), 0);
        assert!(probe.in_order);
        probe.observe(Stamp::Whole(1), 0);
        assert!(!probe.in_order);
    }
}

#[cfg(test)]
mod dates_tests {
    use super::*;

    #[test]
    fn dates_are_read_to_the_nanosecond() {
        let parsed = |text: &str| Date::parse(text).map(|date| (date.since_1970_ns, date.has_zone));
        let start = 1_700_000_000_000_000_000;
        for (text, expected) in [
            ("2023-11-14T22:13:20Z", (start, true)),
            ("2023-11-14 22:13:20.123456789z", (start + 123_456_789, true)),
            ("2023-11-14T23:13:20.5+01:00", (start + 500_000_000, true)),
            ("2023-11-14T23:13:20,5+0100", (start + 500_000_000, true)),
            ("2023-11-14T21:13:20-01", (start, true)),
            (" 2023-11-14 22:13:20.000000001 ", (start + 1, false)),
            ("1969-12-31T23:59:59.999999999Z", (-1, true)),
        ] {
            assert_eq!(parsed(text), Some(expected), "{text}");
        }
    }

    #[test]
    fn other_texts_are_not_dates() {
        for text in [
            "",
            "12:00:01",
            "2023-11-14",
            "2023-13-14T00:00:00Z",
            "14-11-2023 22:13:20",
            "2023-11-14T25:00:00",
            "ä234-11-14T",
            "2023-11-14T22:13:20 Mars",
            "9999-01-01T00:00:00Z",
        ] {
            assert_eq!(Date::parse(text), None, "{text}");
        }
    }

    fn found(header: &str) -> Result<Option<(usize, Option<usize>)>, String> {
        let header: Vec<_> = header.split(',').map(str::to_owned).collect();
        let found = time_columns(&header, &ReadOptions::default()).map_err(|fault| fault.to_string())?;
        Ok(found.map(|(time, rest)| (time, rest.map(|rest| rest.column))))
    }

    #[test]
    fn parts_of_a_time_are_joined() {
        for header in [
            "t_sec,t_nsec",
            "time_s,time_ns",
            "timestamp,timestamp_ns",
            "time,usec",
            "sec,nanosec",
            "secs,nsecs",
            "tv_sec,tv_usec",
            "header.stamp.sec,header.stamp.nanosec",
            "Time [s],Time [ns]",
            "time,ms",
        ] {
            assert_eq!(found(header), Ok(Some((0, Some(1)))), "{header}");
            let turned: Vec<_> = header.split(',').rev().collect();
            assert_eq!(found(&turned.join(",")), Ok(Some((1, Some(0)))), "{header}");
        }
    }

    #[test]
    fn two_whole_times_are_ambiguous() {
        for header in ["t,time", "time_ms,stamp", "time_s,stamp_ns", "t,ms,us", "sec,nsec,usec", "time_ms,sec,nsec"] {
            assert!(found(header).is_err_and(|problem| problem.contains("both give the time")), "{header}");
        }
    }

    #[test]
    fn other_columns_are_not_times() {
        for (header, expected) in [
            ("x,y", None),
            ("sec,x", None),
            ("frame,x", Some((0, None))),
            ("frame,t", Some((1, None))),
            ("t,flight_sec,latency_ms,timestamp_sample", Some((0, None))),
        ] {
            assert_eq!(found(header), Ok(expected), "{header}");
        }
    }
}
