//! Comparison of side files with a recording: clocks of obstacle paths, and the time that paths, offsets and plans
//! share with the judged window.

use super::super::Failure;
use tautline_audit::MovingObstacle;
use tautline_audit::recorded::{Outcome, Settings};
use tautline_core::fact::{Fact, FactKind, Source};
use tautline_core::option::OFFSET;
use tautline_core::text::seconds;
use tautline_core::track::Item;

/// Clock of the path of an obstacle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum PathClock {
    /// Seconds from the epoch of the recording, as in its report.
    Report,
    /// Seconds on the recording's own clock, such as the time since 1970.
    Recording,
}

impl PathClock {
    fn name(self) -> &'static str {
        match self {
            Self::Report => "obstacles from the epoch of the recording",
            Self::Recording => "obstacles on the clock of the recording",
        }
    }
}

/// Moving obstacles of side files, on the clock of the report.
#[derive(Clone, Debug, Default)]
pub(super) struct SideFiles {
    /// Number of obstacles of side files, which are the first of the settings.
    count: usize,
    /// Epoch of the recording \[s\].
    epoch_s: f64,
    /// Clock of each path; `None` for obstacles at rest.
    clocks: Vec<Option<PathClock>>,
}

impl SideFiles {
    /// Moves the paths of the first `count` obstacles to the clock of the report. A path is on the clock that brings it
    /// nearer to the beginning of the judged window, which [`Self::check`] confirms at the end.
    pub(super) fn align(settings: &mut Settings, count: usize, epoch_ns: i64, first_s: f64) -> Result<Self, Failure> {
        let epoch_s = seconds_of(epoch_ns);
        let from_s = settings.from_s.map_or(first_s, |from_s| from_s.max(first_s));
        let away_s = |[start_s, end_s]: [f64; 2]| (start_s - from_s).max(from_s - end_s).max(0.0);
        let mut clocks = Vec::new();
        for obstacle in settings.obstacles.iter_mut().take(count) {
            let Some(span_s) = span_s(obstacle) else {
                clocks.push(None);
                continue;
            };
            let [report_s, recording_s] = [away_s(span_s), away_s(span_s.map(|time_s| time_s - epoch_s))];
            if epoch_ns != 0 && report_s == 0.0 && recording_s == 0.0 {
                return Err(ambiguous(obstacle, epoch_s));
            }
            let is_recording = epoch_ns != 0 && recording_s < report_s;
            if is_recording {
                obstacle.path.iter_mut().for_each(|(time_s, _)| *time_s -= epoch_s);
            }
            clocks.push(Some(if is_recording { PathClock::Recording } else { PathClock::Report }));
        }
        Ok(Self { count, epoch_s, clocks })
    }

    /// Refuses a path that shares no time with the judged window, or that shares time with it on either clock.
    pub(super) fn check(&self, settings: &Settings, outcome: &Outcome) -> Result<(), Failure> {
        let Some([from_s, to_s]) = window_s(settings, outcome) else { return Ok(()) };
        let shares = |[start_s, end_s]: [f64; 2]| start_s <= to_s && end_s >= from_s;
        for (obstacle, clock) in settings.obstacles.iter().zip(&self.clocks) {
            let Some((span_s, clock)) = span_s(obstacle).zip(*clock) else { continue };
            let other_s = match clock {
                PathClock::Report => span_s.map(|time_s| time_s - self.epoch_s),
                PathClock::Recording => span_s.map(|time_s| time_s + self.epoch_s),
            };
            if !shares(span_s) {
                let [start, end] = span_s.map(seconds);
                let epoch = if self.epoch_s == 0.0 {
                    String::new()
                } else {
                    format!(", or its own times, which are {:?} s larger", self.epoch_s)
                };
                let message = format!(
                    "the path of the obstacle `{}` is from {start} to {end}, outside the judged window from {} to {}",
                    obstacle.name,
                    seconds(from_s),
                    seconds(to_s)
                );
                let help = format!(
                    "give the times of the path in seconds of the audit{epoch}; an obstacle at rest has at_m instead"
                );
                return Err(Failure::input("audit/side-file-clock", message, help));
            }
            if self.epoch_s != 0.0 && shares(other_s) {
                return Err(ambiguous(obstacle, self.epoch_s));
            }
        }
        Ok(())
    }

    /// Returns the assumptions that obstacles stand still outside their paths, if the judged window goes beyond them.
    fn resting(&self, settings: &Settings, outcome: &Outcome) -> Vec<Fact> {
        let Some([from_s, to_s]) = window_s(settings, outcome) else { return Vec::new() };
        let resting = settings.obstacles.iter().take(self.count).filter_map(|obstacle| {
            let [start_s, end_s] = span_s(obstacle)?;
            let (before, after) = (format!("before {}", seconds(start_s)), format!("after {}", seconds(end_s)));
            let when = [(start_s > from_s).then_some(before), (end_s < to_s).then_some(after)];
            let when = when.into_iter().flatten().collect::<Vec<_>>().join(" and ");
            let name = &obstacle.name;
            (!when.is_empty()).then(|| Fact::name(FactKind::ObstacleMotion, Source::Convention, when).about(name))
        });
        resting.collect()
    }

    /// Returns the facts on the clocks of side files, on clocks that the user corrects, and on obstacles at rest.
    pub(super) fn facts(&self, settings: &Settings, outcome: &Outcome) -> Vec<Fact> {
        let of_clock = |clock: PathClock, source: Source| {
            let is_given = self.clocks.contains(&Some(clock));
            is_given.then(|| Fact::name(FactKind::SideFileClock, source, clock.name()))
        };
        let has_offset = settings.vehicles.values().any(|vehicle| vehicle.offset_s != 0.0);
        let facts = [
            of_clock(PathClock::Report, Source::Convention),
            of_clock(PathClock::Recording, Source::Deduced),
            has_offset.then(|| Fact::name(FactKind::SideFileClock, Source::Declared, "offsets of vehicles")),
        ];
        facts.into_iter().flatten().chain(self.resting(settings, outcome)).collect()
    }
}

/// Refuses an offset after which a vehicle cannot meet any other. Such an offset exceeds the span of the recording
/// \[s\], or leaves no time at which another vehicle is present.
pub(super) fn check_offsets(settings: &Settings, outcome: &Outcome, span_s: f64) -> Result<(), Failure> {
    for (vehicle, name) in outcome.vehicles.iter().enumerate() {
        let offset_s = settings.vehicles.get(name).map_or(0.0, |vehicle| vehicle.offset_s);
        let problem = if offset_s.abs() > span_s {
            format!("longer than the recording, {}", seconds(span_s))
        } else if offset_s != 0.0 && outcome.alone.contains(&vehicle) {
            "after which the vehicle is never present with another".to_owned()
        } else {
            continue;
        };
        let message = format!("{}: the offset is {problem}", OFFSET.set(format!("{name}={offset_s:?}")));
        let help = "give the seconds that are added to the times of the vehicle";
        return Err(Failure::input("audit/side-file-clock", message, help));
    }
    Ok(())
}

/// Times of the items of a recording \[s\].
#[derive(Clone, Copy, Debug)]
pub(super) struct ItemSpan {
    from_s: f64,
    to_s: f64,
}

impl Default for ItemSpan {
    fn default() -> Self {
        Self { from_s: f64::INFINITY, to_s: f64::NEG_INFINITY }
    }
}

impl ItemSpan {
    /// Adds items.
    pub(super) fn add(&mut self, items: &[Item]) {
        for item in items {
            let end_s = match item {
                Item::Sample(sample) => sample.time_s,
                Item::Piece(piece) => piece.to_s,
            };
            (self.from_s, self.to_s) = (self.from_s.min(item.time_s()), self.to_s.max(end_s));
        }
    }

    /// Returns the first time \[s\]; 0 without items.
    pub(super) fn first_s(self) -> f64 {
        if self.from_s.is_finite() { self.from_s } else { 0.0 }
    }

    /// Returns the start and the end, if there are items.
    pub(super) fn ends_s(self) -> Option<[f64; 2]> {
        (self.from_s <= self.to_s).then_some([self.from_s, self.to_s])
    }

    /// Returns the length \[s\]; 0 without items.
    pub(super) fn length_s(self) -> f64 {
        (self.to_s - self.from_s).max(0.0)
    }
}

/// Returns the time from the first to the last point of a path; `None` at rest.
fn span_s(obstacle: &MovingObstacle) -> Option<[f64; 2]> {
    match &obstacle.path[..] {
        [(first_s, _), .., (last_s, _)] => Some([*first_s, *last_s]),
        _ => None,
    }
}

/// Returns the judged window, if anything is judged.
fn window_s(settings: &Settings, outcome: &Outcome) -> Option<[f64; 2]> {
    let (first_s, last_s) = outcome.span_s?;
    Some([settings.from_s.unwrap_or(first_s), settings.until_s.unwrap_or(last_s)])
}

/// Returns an epoch in seconds. A whole number of seconds has no rounding.
pub(super) fn seconds_of(epoch_ns: i64) -> f64 {
    (epoch_ns / 1_000_000_000) as f64 + (epoch_ns % 1_000_000_000) as f64 * 1e-9
}

fn ambiguous(obstacle: &MovingObstacle, epoch_s: f64) -> Failure {
    let message = format!(
        "the path of the obstacle `{}` meets the judged window with times from the epoch of the recording, {epoch_s:?} \
         s, and with times from 0",
        obstacle.name
    );
    Failure::input("audit/side-file-clock", message, "leave out the points of the path outside the recording")
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use tautline_core::obstacle::Shape;

    use super::*;

    fn truck(times_s: [f64; 2]) -> MovingObstacle {
        let path = times_s.map(|time_s| (time_s, Vector3::zeros())).to_vec();
        MovingObstacle { name: "truck".to_owned(), shape: Shape::Ball { radius_m: 1.0 }, clearance_m: None, path }
    }

    fn aligned(times_s: [f64; 2], epoch_s: i64, first_s: f64) -> Result<[f64; 2], String> {
        let mut settings = Settings { obstacles: vec![truck(times_s)], ..Settings::default() };
        let files = SideFiles::align(&mut settings, 1, epoch_s * 1_000_000_000, first_s);
        files.map_err(|failure| failure.code().to_owned())?;
        Ok(span_s(&settings.obstacles[0]).expect("a path"))
    }

    #[test]
    fn paths_are_moved_to_the_clock_of_the_report() {
        let epoch = 1_700_000_000;
        assert_eq!(aligned([1_700_000_001.0, 1_700_000_009.5], epoch, 0.25), Ok([1.0, 9.5]));
        assert_eq!(aligned([1_699_999_000.0, 1_700_000_009.5], epoch, 0.25), Ok([-1000.0, 9.5]), "it began earlier");
        assert_eq!(aligned([0.0, 9.5], epoch, 0.25), Ok([0.0, 9.5]));
        assert_eq!(aligned([100.0, 200.0], 0, 0.25), Ok([100.0, 200.0]), "a recording without an epoch");
        assert_eq!(aligned([0.0, 3e6], 1_500_000, 0.25), Err("audit/side-file-clock".to_owned()), "either clock");
    }

    #[test]
    fn an_epoch_in_whole_seconds_is_exact() {
        assert_eq!(seconds_of(1_700_000_001_000_000_000), 1_700_000_001.0);
        assert_eq!(seconds_of(-1_500_000_000), -1.5);
    }
}
