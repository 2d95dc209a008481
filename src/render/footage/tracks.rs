//! Footage of recorded motion, whoever recorded it.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use super::stretch::Stretch;
use super::{BUDGET_BYTES, COORDINATE, Footage, FootageError, Instant, Span, UNKNOWN_RADIUS_M, nearer};
use crate::space::closest_pair;
use crate::swarm::{Pair, Rows, row, set_row};
use crate::track::{Item, Piece, Tracks};

/// Instants a second at which known curves are drawn \[Hz\].
const CURVE_HZ: f64 = 30.0;
/// Instants of vehicles that were seen at times of their own, over those of the one that was seen most often.
const SHARED: usize = 2;

/// Why recorded motion cannot be drawn.
#[derive(Debug, thiserror::Error)]
pub enum TracksError<E> {
    /// It cannot be read.
    #[error("{0}")]
    Read(E),
    /// It can be read and not be drawn.
    #[error(transparent)]
    Footage(#[from] FootageError),
}

/// What is known of one vehicle.
#[derive(Default)]
struct Course {
    samples: Vec<(f64, Vector3<f64>)>,
    pieces: Vec<Piece>,
    radius_m: Option<f64>,
}

impl Footage {
    /// Reads recorded motion. Vehicles that were seen at times of their own are put on common ones, with straight lines
    /// between; one that has not been seen yet, or no longer, is not there. Separations, and violations of `delta_m`
    /// \[m\], are those of the straight lines.
    ///
    /// The result may be without instants.
    ///
    /// # Errors
    /// [`TracksError`] when the recording cannot be read, or a vehicle is beyond [`FARTHEST_M`](super::FARTHEST_M).
    pub fn from_tracks<T: Tracks + ?Sized>(
        name: &str,
        tracks: &mut T,
        delta_m: Option<f64>,
    ) -> Result<Self, TracksError<T::Error>> {
        let (mut courses, mut items): (Vec<Course>, _) = (Vec::new(), Vec::new());
        let mut more = true;
        while more {
            more = tracks.read(&mut items).map_err(TracksError::Read)?;
            for item in items.drain(..) {
                let k = item.vehicle();
                if let Item::Sample(sample) = &item {
                    let name = || vehicle(tracks, k);
                    FootageError::check(sample.position_m.iter(), COORDINATE, sample.time_s, name)?;
                    FootageError::check(&sample.radius_m, "radius", sample.time_s, name)?;
                }
                if courses.len() <= k {
                    courses.resize_with(k + 1, Course::default);
                }
                courses[k].take(item);
            }
        }
        let mut footage = Self { delta_m, ..Self::new(name, courses.len()) };
        footage.vehicles = (0..courses.len()).map(|k| vehicle(tracks, k)).collect();
        footage.radius_m = courses.iter().map(|course| course.radius_m.unwrap_or(UNKNOWN_RADIUS_M)).collect();
        if courses.iter().any(|course| course.radius_m.is_none()) {
            footage.notes.push(format!("vehicles of unknown radius are drawn with {UNKNOWN_RADIUS_M} m"));
        }
        let (mut places, mut last) = (vec![0; courses.len()], BTreeMap::new());
        for time_s in common_times(&courses) {
            let mut positions_m = Rows::zeros(courses.len());
            for (k, course) in courses.iter().enumerate() {
                let place = course.at(time_s, &mut places[k]);
                // Curves may go far between times that do not.
                FootageError::check(place.iter(), COORDINATE, time_s, || footage.vehicles[k].clone())?;
                set_row(&mut positions_m, k, place);
            }
            footage.see(time_s, positions_m, &mut last);
        }
        footage.spans.sort_by(|a, b| a.from_s.total_cmp(&b.from_s));
        footage.notes.extend_from_slice(tracks.notes());
        Ok(footage)
    }

    /// Takes the next instant, with the last violation of every pair that lasted at the one before.
    fn see(&mut self, time_s: f64, positions_m: Rows, last: &mut BTreeMap<Pair, usize>) {
        let before = self.instants.last();
        let stretch = Stretch {
            times_s: [before.map_or(time_s, |before| before.time_s), time_s],
            positions_m: [before.map_or(&positions_m, |before| &before.positions_m), &positions_m],
        };
        // Nothing came nearer than the nearest now, unless it did on the way.
        let now_m = nearest_present(&positions_m).map_or(0.0, |(_, distance_m)| distance_m);
        let reach_m = now_m.max(self.delta_m.unwrap_or(0.0));
        // A little more, for rounding.
        let near = stretch.near(reach_m * (1.0 + 4.0 * f64::EPSILON));
        let here = near.iter().map(|&pair| stretch.approach(pair)).fold(None, nearer);
        if let Some(delta_m) = self.delta_m {
            for (pair, [from_s, to_s]) in near.iter().filter_map(|&pair| Some((pair, stretch.inside_s(pair, delta_m)?)))
            {
                match last.get(&pair).map(|&k| &mut self.spans[k]) {
                    Some(span) if span.to_s >= from_s => span.to_s = to_s,
                    _ => {
                        last.insert(pair, self.spans.len());
                        self.spans.push(Span { pair, from_s, to_s });
                    }
                }
            }
            last.retain(|_, k| self.spans[*k].to_s >= time_s);
        }
        self.push(Instant { time_s, positions_m, control_m_s2: None, here, so_far: None });
    }
}

/// The name of a vehicle; its number where it has none.
fn vehicle<T: Tracks + ?Sized>(tracks: &T, k: usize) -> String {
    tracks.vehicles().get(k).cloned().unwrap_or_else(|| (k + 1).to_string())
}

impl Course {
    fn take(&mut self, item: Item) {
        match item {
            Item::Sample(sample) => {
                self.radius_m = sample.radius_m.or(self.radius_m);
                self.samples.push((sample.time_s, sample.position_m));
            }
            Item::Piece(piece) => self.pieces.push(piece),
        }
    }

    /// Where the vehicle is at a time that is not before the time of the last call; `place` is kept between calls.
    fn at(&self, time_s: f64, place: &mut usize) -> Vector3<f64> {
        let nowhere = Vector3::repeat(f64::NAN);
        if self.pieces.is_empty() {
            while self.samples.get(*place + 1).is_some_and(|next| next.0 <= time_s) {
                *place += 1;
            }
            return match (self.samples.get(*place), self.samples.get(*place + 1)) {
                (Some(here), _) if here.0 == time_s => here.1,
                (Some(here), Some(next)) if here.0 < time_s => {
                    here.1 + (next.1 - here.1) * ((time_s - here.0) / (next.0 - here.0))
                }
                _ => nowhere,
            };
        }
        while self.pieces.get(*place).is_some_and(|piece| piece.to_s < time_s) {
            *place += 1;
        }
        self.pieces.get(*place).filter(|piece| piece.from_s <= time_s).map_or(nowhere, |piece| {
            let t = time_s - piece.from_s;
            piece.coefficients.iter().rev().fold(Vector3::zeros(), |sum, coefficient| sum * t + coefficient)
        })
    }
}

/// The times of all samples where they are few, else evenly spaced ones.
fn common_times(courses: &[Course]) -> Vec<f64> {
    let mut times: Vec<f64> = Vec::new();
    for course in courses {
        times.extend(course.samples.iter().map(|sample| sample.0));
        times.extend(course.pieces.iter().flat_map(|piece| [piece.from_s, piece.to_s]));
    }
    times.retain(|time| time.is_finite());
    times.sort_unstable_by(f64::total_cmp);
    times.dedup();
    let (Some(&first), Some(&last)) = (times.first(), times.last()) else { return times };
    let most = BUDGET_BYTES / (courses.len().max(1) * 6 * size_of::<f64>());
    let has_curves = courses.iter().any(|course| !course.pieces.is_empty());
    let longest = courses.iter().map(|course| course.samples.len()).max().unwrap_or(0);
    if !has_curves && times.len() <= most && times.len() <= SHARED * longest {
        return times;
    }
    let wanted = if has_curves { (last - first) * CURVE_HZ } else { longest as f64 };
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "bounded by both")]
    let steps = wanted.ceil().clamp(1.0, most.max(2) as f64) as usize;
    (0..=steps).map(|k| first + (last - first) * (k as f64 / steps as f64)).collect()
}

/// The nearest two of the vehicles that are there, and their distance \[m\].
pub(super) fn nearest_present(positions_m: &Rows) -> Option<(Pair, f64)> {
    let is_there = |i: &usize| row(positions_m, *i).iter().all(|x| x.is_finite());
    let there: Vec<usize> = (0..positions_m.nrows()).filter(is_there).collect();
    if there.len() == positions_m.nrows() {
        return closest_pair(positions_m);
    }
    let mut rows = Rows::zeros(there.len());
    for (k, &i) in there.iter().enumerate() {
        set_row(&mut rows, k, row(positions_m, i));
    }
    let (pair, distance_m) = closest_pair(&rows)?;
    Some((Pair::new(there[pair.first()], there[pair.second()]), distance_m))
}
