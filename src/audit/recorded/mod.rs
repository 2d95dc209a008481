//! The judge of recorded motion: did any two vehicles come too close, by what a recording says?
//!
//! A recording is a stream of [`Item`]s, each vehicle at times of its own. What happens between two samples is stated
//! ([`Motion`]), never assumed silently, and the answer is one of three: **clear** (proved, under that motion), a
//! **violation**, or **undecided**, with the interval in which the smallest distance lies.
//!
//! - Straight flight and jumps are swept in closed form, like the steps of [`super::Auditor`].
//! - On curves the smallest distance is enclosed by Bernstein coefficients to [`WIDTH_M`].
//! - Under bounded acceleration A a vehicle is within A h^2 / 8 of the straight line between two samples h apart, or within
//!   A h^2 / 16 of the cubic where the samples have velocities. Two vehicles are at least as far apart as drawn, less both
//!   deviations; they are too close for certain only where even the deviations cannot keep them apart, such as at a sample.
//! - What bounds on the motion do not prove clear is judged a second time, by parry; where it contradicts, nothing is
//!   clear.
//!
//! Not every pair is swept: a window of time at a time, pairs are left out that bounds on their motion prove to be neither
//! too close nor among the ten closest, to 1e-12 of a distance. Memory is that of a window, and of what was found.
//!
//! Every instant counts, the first and the last too, and a vehicle that was seen once is judged where it was seen. A
//! vehicle that is late or leaves early is judged while it is there. While a vehicle is not seen for longer than
//! [`Question::max_gap_s`], nothing is known of it.
//!
//! ```
//! use nalgebra::Vector3;
//! use tautline::audit::Status;
//! use tautline::audit::recorded::{Question, judge};
//! use tautline::track::{Item, Sample};
//!
//! // Past each other in one second: far apart in every sample, 1 m apart in between.
//! let seen = |vehicle, time_s, x, y| {
//!     let position_m = Vector3::new(x, y, 0.0);
//!     Item::Sample(Sample { vehicle, time_s, position_m, velocity_m_s: None, radius_m: None })
//! };
//! let items = [seen(0, 0.0, -5.0, 0.0), seen(1, 0.0, 5.0, 1.0), seen(0, 1.0, 5.0, 0.0), seen(1, 1.0, -5.0, 1.0)];
//! let names = ["alpha".to_owned(), "bravo".to_owned()];
//! let outcome = judge(&names, &items, Question::delta(2.0))?;
//! assert_eq!(outcome.status, Status::Violation);
//! assert_eq!((outcome.closest[0].lower_m, outcome.closest[0].time_s), (1.0, 0.5));
//! # Ok::<(), tautline::audit::recorded::RecordedError>(())
//! ```

mod enclosure;
mod findings;
mod history;
mod meeting;
mod obstacle;
mod outcome;
mod question;
mod rates;
mod second;
mod segment;
mod vehicle;
mod window;

pub use history::{History, Moment};
pub use obstacle::{Obstacle, ObstacleError, Shape};
pub use outcome::{
    Approach, Contradiction, Disagreement, Gap, Outcome, Presence, RecordedError, Undecided, Violation, Who,
};
pub use question::{Motion, Question, Terms};

use super::Status;
use crate::track::Item;
use findings::Findings;
use rates::Rates;
use vehicle::{Course, Vehicle};
use window::{Limits, Windows};

/// Width of the interval in which the smallest distance on a curve is enclosed \[m\]; rounding widens it where coordinates
/// are large.
pub const WIDTH_M: f64 = 1e-9;

/// Scaled distance at which two equal ellipsoids touch.
pub const TOUCHING_ELLIPSOIDS: f64 = 2.0;
/// Smallest and largest distance that is judged by \[m\], and largest time \[s\] and acceleration \[m/s^2\].
const LEAST: f64 = 1e-70;
const MOST: f64 = 1e70;
/// Stretches of a vehicle in a window, about.
const STRETCHES: usize = 16;
/// Fewest items between two windows.
const FEWEST_ITEMS: usize = 48;
/// Names that an error lists.
const NAMES_LISTED: usize = 12;

/// Judges a recording as it is read.
///
/// [`push`](Judge::push) takes items in order of time, any number at a time; the first push should hold some samples of
/// each vehicle, since usual intervals are learnt from it. [`finish`](Judge::finish) gives the verdict.
#[derive(Clone, Debug)]
pub struct Judge {
    question: Question,
    vehicles: Vec<Vehicle>,
    rates: Option<Rates>,
    windows: Windows,
    findings: Findings,
    gaps: Vec<Gap>,
    /// Smallest clock offset of any vehicle \[s\].
    least_offset_s: f64,
    /// Time of the last item, and of the last one before that time \[s\].
    now_s: f64,
    before_s: f64,
    /// Up to when everything was judged \[s\].
    done_s: f64,
    pending: usize,
    stretches: u64,
}

/// Judges a recording in memory: the items of vehicles with these names, in order of time.
///
/// # Errors
/// [`RecordedError`] where the question or the recording is wrong.
pub fn judge(names: &[String], items: &[Item], question: Question) -> Result<Outcome, RecordedError> {
    let mut judge = Judge::new(question)?;
    judge.push(names, items)?;
    judge.finish()
}

impl Judge {
    /// A judge with a question.
    ///
    /// # Errors
    /// [`RecordedError`] where a number of the question is out of range.
    pub fn new(question: Question) -> Result<Self, RecordedError> {
        question.check()?;
        let touching = question.ellipsoid_m.map_or(0.0, |_| TOUCHING_ELLIPSOIDS);
        let delta = question.delta_m.unwrap_or(touching);
        let above = question.above_m.map(|above_m| question.ellipsoid_m.map_or(above_m, |axes| above_m / axes.z));
        let limits = Limits { delta, by_radii: question.ellipsoid_m.is_none(), above };
        let offsets_s = question.vehicles.values().map(|terms| terms.offset_s);
        Ok(Self {
            least_offset_s: offsets_s.fold(0.0, f64::min),
            windows: Windows::new(limits, question.obstacles.clone()),
            question,
            vehicles: Vec::new(),
            rates: None,
            findings: Findings::default(),
            gaps: Vec::new(),
            now_s: f64::NEG_INFINITY,
            before_s: f64::NEG_INFINITY,
            done_s: f64::NEG_INFINITY,
            pending: 0,
            stretches: 0,
        })
    }

    /// Judges what comes next. `names` are those of all vehicles known so far.
    ///
    /// # Errors
    /// [`RecordedError`] where an item is wrong; nothing more can be judged then.
    pub fn push(&mut self, names: &[String], items: &[Item]) -> Result<(), RecordedError> {
        if self.rates.is_none() && !items.is_empty() {
            let given = self.question.max_gap_s.is_some();
            self.rates = Some(if given { Rates::default() } else { Rates::learn(items, names.len()) });
        }
        for name in names.iter().skip(self.vehicles.len()) {
            let usual = || self.rates.as_ref().map_or(f64::INFINITY, |rates| rates.max_gap_s(self.vehicles.len()));
            let max_gap_s = self.question.max_gap_s.unwrap_or_else(usual);
            self.vehicles.push(self.question.vehicle(name, max_gap_s));
        }
        for item in items {
            match item {
                Item::Sample(sample) => self.take(sample.vehicle, sample.time_s, |vehicle| vehicle.sample(sample))?,
                Item::Piece(piece) => self.take(piece.vehicle, piece.from_s, |vehicle| vehicle.piece(piece))?,
            }
        }
        Ok(())
    }

    #[inline]
    fn take(
        &mut self,
        index: usize,
        time_s: f64,
        take: impl FnOnce(&mut Vehicle) -> Result<Option<Gap>, RecordedError>,
    ) -> Result<(), RecordedError> {
        if time_s != self.now_s {
            self.turn_to(time_s, index)?;
        }
        let Some(vehicle) = self.vehicles.get_mut(index) else {
            return Err(RecordedError::Unnamed { vehicle: index });
        };
        if !vehicle.asked_for {
            return Ok(());
        }
        let unseen = vehicle.is_unseen();
        let gap = take(vehicle)?;
        if unseen {
            self.question.check_vehicle(vehicle)?;
        }
        if let Some(gap) = gap {
            self.note(gap);
        }
        self.pending += 1;
        Ok(())
    }

    /// A new instant: everything before it has been read.
    #[inline(never)]
    fn turn_to(&mut self, time_s: f64, vehicle: usize) -> Result<(), RecordedError> {
        let name = || self.vehicles.get(vehicle).map(|vehicle| vehicle.name.clone()).unwrap_or_default();
        if !time_s.is_finite() || time_s.abs() > MOST {
            return Err(RecordedError::NotFinite { vehicle: name(), time_s, what: "the time" });
        }
        if time_s < self.now_s {
            return Err(RecordedError::OutOfOrder { vehicle: name(), previous_s: self.now_s, time_s });
        }
        (self.before_s, self.now_s) = (self.now_s, time_s);
        if self.before_s == f64::NEG_INFINITY {
            self.done_s = time_s + self.least_offset_s;
        } else if self.pending >= (STRETCHES * self.vehicles.len()).max(FEWEST_ITEMS) {
            self.advance();
        }
        Ok(())
    }

    /// Judges up to where every vehicle that may still be there is known.
    fn advance(&mut self) {
        let read_s = self.now_s + self.least_offset_s;
        let seen = self.vehicles.iter().filter(|vehicle| !vehicle.is_unseen());
        let there = seen.filter(|vehicle| read_s - vehicle.known_s() <= vehicle.course.max_gap_s);
        let until_s = there.map(Vehicle::known_s).fold(self.before_s + self.least_offset_s, f64::min);
        if until_s > self.done_s {
            self.judge_until(until_s);
            self.pending = 0;
        } else {
            // Somebody is seen more seldom: look again after as many items.
            self.pending /= 2;
        }
    }

    fn judge_until(&mut self, until_s: f64) {
        self.windows.judge(&self.vehicles, self.done_s, until_s, &mut self.findings);
        for vehicle in &mut self.vehicles {
            self.stretches += vehicle.forget(until_s) as u64;
        }
        self.done_s = until_s;
    }

    /// Notes a gap as far as it lies in the window that is asked for.
    fn note(&mut self, gap: Gap) {
        let (from_s, to_s) = self.question.window_s();
        let (from_s, to_s) = (gap.from_s.max(from_s), gap.to_s.min(to_s));
        if from_s < to_s {
            self.gaps.push(Gap { from_s, to_s, ..gap });
        }
    }

    /// The verdict over everything judged.
    ///
    /// # Errors
    /// [`RecordedError::UnknownVehicle`] where the question names a vehicle that the recording does not have.
    pub fn finish(mut self) -> Result<Outcome, RecordedError> {
        self.check_names()?;
        let end_s = self.vehicles.iter().map(Vehicle::known_s).fold(self.done_s, f64::max);
        if end_s.is_finite() {
            self.judge_until(end_s);
        }
        let presence: Vec<_> = self.vehicles.iter().map(|vehicle| vehicle.presence).collect();
        let there = || presence.iter().flatten();
        let span_s = there().next().map(|_| {
            let from_s = there().map(|there| there.from_s).fold(f64::INFINITY, f64::min);
            (from_s, there().map(|there| there.to_s).fold(f64::NEG_INFINITY, f64::max))
        });
        let contradiction =
            self.vehicles.iter().filter_map(|v| v.contradiction).max_by(|a, b| a.needs_m_s2.total_cmp(&b.needs_m_s2));
        let Findings { closest, obstacles, violations, undecided, .. } = self.findings;
        let mut violations: Vec<_> = violations.into_values().flatten().collect();
        let mut undecided: Vec<_> = undecided.into_values().flatten().collect();
        violations.sort_by(|a, b| a.from_s.total_cmp(&b.from_s).then(a.who.cmp(&b.who)));
        undecided.sort_by(|a, b| a.from_s.total_cmp(&b.from_s).then(a.who.cmp(&b.who)));
        self.gaps.sort_by(|a, b| a.from_s.total_cmp(&b.from_s).then(a.vehicle.cmp(&b.vehicle)));
        let in_the_way = there().count() > 1 || !self.question.obstacles.is_empty();
        let unseen = in_the_way && !self.gaps.is_empty();
        let decided = span_s.is_some()
            && undecided.is_empty()
            && !unseen
            && contradiction.is_none()
            && self.findings.disagreements == 0;
        let status = match (violations.is_empty(), decided) {
            (false, _) => Status::Violation,
            (true, true) => Status::Clear,
            (true, false) => Status::Undecided,
        };
        Ok(Outcome {
            status,
            max_gaps_s: self.vehicles.iter().map(|vehicle| vehicle.course.max_gap_s).collect(),
            vehicles: self.vehicles.into_iter().map(|vehicle| vehicle.name).collect(),
            presence,
            span_s,
            closest: closest.into_vec(),
            obstacles: obstacles.into_vec(),
            violations,
            undecided,
            gaps: self.gaps,
            contradiction,
            stretches: self.stretches,
            swept: self.findings.swept,
            min_toi_s: self.findings.min_toi_s,
            disagreements: self.findings.disagreements,
            first_disagreement: self.findings.first_disagreement,
        })
    }

    fn check_names(&self) -> Result<(), RecordedError> {
        let asked = self.question.vehicles.keys().chain(self.question.only.iter().flatten());
        let known: Vec<&str> = self.vehicles.iter().map(|vehicle| vehicle.name.as_str()).collect();
        for name in asked {
            if !known.contains(&name.as_str()) {
                let mut listed = known.iter().take(NAMES_LISTED).copied().collect::<Vec<_>>().join(", ");
                if known.len() > NAMES_LISTED {
                    listed += ", ...";
                }
                return Err(RecordedError::UnknownVehicle { name: name.clone(), known: listed });
            }
        }
        Ok(())
    }
}

impl Question {
    fn window_s(&self) -> (f64, f64) {
        (self.from_s.unwrap_or(f64::NEG_INFINITY), self.to_s.unwrap_or(f64::INFINITY))
    }

    fn vehicle(&self, name: &str, max_gap_s: f64) -> Vehicle {
        let terms = self.vehicles.get(name).copied().unwrap_or_default();
        let course = Course {
            offset_s: terms.offset_s,
            motion: self.motion,
            max_accel_m_s2: terms.max_accel_m_s2.or(self.max_accel_m_s2).unwrap_or(f64::NAN),
            scale: self.ellipsoid_m.map(|axes| axes.map(f64::recip)),
            window_s: self.window_s(),
            above_m: self.above_m,
            max_gap_s,
        };
        let asked_for = self.only.as_ref().is_none_or(|only| only.contains(name));
        Vehicle::new(name.to_owned(), asked_for, course, terms.radius_m.or(self.radius_m))
    }

    fn check(&self) -> Result<(), RecordedError> {
        let positive = "above 0, and finite";
        let check = |what: &str, value: Option<f64>, least: f64, range| match value {
            Some(value) if !(least..=MOST).contains(&value) => {
                Err(RecordedError::OutOfRange { what: what.to_owned(), range, value })
            }
            _ => Ok(()),
        };
        check("delta", self.delta_m, LEAST, positive)?;
        check("the radius", self.radius_m, 0.0, "0 m or more, and finite")?;
        check("the largest acceleration", self.max_accel_m_s2, 0.0, "0 or more, and finite")?;
        for axis in self.ellipsoid_m.iter().flatten() {
            check("each axis of the ellipsoid", Some(*axis), LEAST, positive)?;
        }
        for (what, value) in
            [("the start of the window", self.from_s), ("its end", self.to_s), ("the height", self.above_m)]
        {
            check(what, value, -MOST, "a finite number")?;
        }
        if let Some(value) = self.max_gap_s.filter(|gap_s| gap_s.is_nan() || *gap_s < 0.0) {
            return Err(RecordedError::OutOfRange { what: "the longest gap".to_owned(), range: "0 s or more", value });
        }
        let (from_s, to_s) = self.window_s();
        if from_s > to_s {
            return Err(RecordedError::EmptyWindow { from_s, to_s });
        }
        for (name, terms) in &self.vehicles {
            check(&format!("the radius of {name}"), terms.radius_m, 0.0, "0 m or more, and finite")?;
            check(&format!("the clock offset of {name}"), Some(terms.offset_s), -MOST, "a finite number")?;
            check(&format!("the largest acceleration of {name}"), terms.max_accel_m_s2, 0.0, "0 or more, and finite")?;
        }
        if self.ellipsoid_m.is_some() && !self.obstacles.is_empty() {
            return Err(RecordedError::ObstaclesAndEllipsoid);
        }
        self.obstacles.iter().try_for_each(|obstacle| Ok(obstacle.check()?))
    }

    fn check_vehicle(&self, vehicle: &Vehicle) -> Result<(), RecordedError> {
        let name = || vehicle.name.clone();
        if self.motion == Some(Motion::Bounded) && vehicle.course.max_accel_m_s2.is_nan() {
            return Err(RecordedError::NoBound { vehicle: name() });
        }
        let limited = self.delta_m.is_some() || self.ellipsoid_m.is_some();
        if !limited && vehicle.radius_m.is_none_or(|radius_m| radius_m < LEAST) {
            return Err(RecordedError::NoLimit { vehicle: name() });
        }
        Ok(())
    }
}
