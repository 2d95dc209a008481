//! The columns of a table that give the time of a row: one, or one of whole units and one of the rest below a unit, as ROS
//! splits seconds and nanoseconds.

use super::clock::{Stamp, TimeUnit};
use super::error::{Fault, quoted};
use super::heading;
use super::options::ReadOptions;

/// Words before the unit of a column that gives a part of a time, as in `header.stamp.nanosec`.
const CLOCK_WORDS: [&str; 8] = ["", "t", "time", "timestamp", "stamp", "header", "tv", "unix"];

/// The rest of a time below a unit of its first column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Rest {
    pub(super) column: usize,
    /// How many units of this column make one of the first.
    per_unit: i64,
    /// The unit of this column, which is that of the two together.
    pub(super) unit: TimeUnit,
}

impl Rest {
    /// The time of a row, exact.
    pub(super) fn join(self, whole: Stamp, rest: Stamp, header: &[String], first: usize) -> Result<Stamp, Fault> {
        let (first, own) = (quoted(&header[first]), quoted(&header[self.column]));
        let problem = match (whole.whole(), rest.whole()) {
            (Some(units), Some(below)) if (0..self.per_unit).contains(&below) => {
                let joined = units.checked_mul(self.per_unit).and_then(|time| time.checked_add(below));
                return joined.map(Stamp::Whole).ok_or_else(Fault::out_of_range);
            }
            (Some(_), Some(below)) => {
                format!("column {own} holds {below}, which is not the rest below a unit of {first}")
            }
            (None, _) => {
                format!("column {first} holds {}, which is no whole number beside {own}", whole.approximately())
            }
            (_, None) => format!("column {own} holds {}, which is no whole number", rest.approximately()),
        };
        let remedy = "where one of the two is the whole time, name it with --column t=NAME";
        Err(Fault::coded("recording/time-format", problem, remedy))
    }
}

/// A column that gives a time or a part of one.
struct Candidate {
    column: usize,
    /// What stands before the unit; empty where nothing does.
    stem: String,
    unit: Option<TimeUnit>,
}

/// The columns of time of a header: the first, and that of the rest if there is one; none where nothing gives a time.
pub(super) fn find(header: &[String], options: &ReadOptions) -> Result<Option<(usize, Option<Rest>)>, Fault> {
    let mut candidates: Vec<_> =
        header.iter().enumerate().filter_map(|(column, name)| candidate(column, name)).collect();
    let is_whole_time = |candidate: &Candidate| heading::is_time(&header[candidate.column]);
    // A part alone, such as `sec` or `ms`, is no time: what it is a part of is not known.
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
                return Err(Fault::coded(
                    "recording/contradicts-option",
                    problem,
                    "leave --time-unit, --fps and --time-scale away",
                ));
            }
            Ok(Some((whole.column, Some(rest))))
        }
        [a, b, ..] => Err(both(header, a, b)),
    }
}

/// Whether a column of this name gives a time or a part of one.
pub(super) fn is_part(name: &str) -> bool {
    candidate(0, name).is_some()
}

fn candidate(column: usize, name: &str) -> Option<Candidate> {
    let (stem, unit) = heading::time_and_unit(name);
    let known = unit.as_deref().and_then(TimeUnit::from_name);
    if heading::is_time(name) {
        return Some(Candidate { column, stem, unit: known });
    }
    // `sec`, `tv_usec`, `header.stamp.nanosec`: the last word is a unit that nobody abbreviates to a letter.
    let name = name.trim().to_lowercase();
    let (before, word) = name.rsplit_once(['.', '/', '_', ' ']).unwrap_or(("", &name));
    let unit = TimeUnit::from_name(word).filter(|_| word.len() > 1)?;
    let is_clock = before.rsplit(['.', '/', '_', ' ']).next().is_some_and(|word| CLOCK_WORDS.contains(&word));
    // The same words of anything else, such as `flight_sec`, are durations.
    is_clock.then(|| Candidate { column, stem: before.to_owned(), unit: Some(unit) })
}

/// How one column continues another one, where they may be the two parts of a time.
fn split(whole: &Candidate, rest: &Candidate) -> Option<Rest> {
    let unit = rest.unit?;
    let per_unit = unit.per_second() / whole.unit.unwrap_or(TimeUnit::Seconds).per_second();
    let are_of_one = whole.stem == rest.stem || whole.stem.is_empty() || rest.stem.is_empty();
    (are_of_one && per_unit > 1).then_some(Rest { column: rest.column, per_unit, unit })
}

fn both(header: &[String], a: &Candidate, b: &Candidate) -> Fault {
    let (first, second) = (quoted(&header[a.column]), quoted(&header[b.column]));
    let problem = format!("the columns {first} and {second} both give the time");
    Fault::coded(
        "recording/ambiguous-column",
        problem,
        "name the one that is meant with --column t=NAME, or take the other out",
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(header: &str) -> Result<Option<(usize, Option<usize>)>, String> {
        let header: Vec<_> = header.split(',').map(str::to_owned).collect();
        let found = find(&header, &ReadOptions::default()).map_err(|fault| fault.to_string())?;
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
    fn of_two_times_none_is_ignored() {
        for header in ["t,time", "time_ms,stamp", "time_s,stamp_ns", "t,ms,us", "sec,nsec,usec", "time_ms,sec,nsec"] {
            assert!(found(header).is_err_and(|said| said.contains("both give the time")), "{header}");
        }
    }

    #[test]
    fn other_columns_are_no_times() {
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
