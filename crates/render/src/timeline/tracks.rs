//! A timeline of recorded motion of any origin, judged as it is read.

use std::sync::Arc;

use nalgebra::Vector3;

use super::{Timeline, UNKNOWN_RADIUS_M};
use crate::error::{RenderError, check_lengths};
use tautline_audit::Status;
use tautline_audit::recorded::{Approach, Outcome, RecordedError, Settings, TrackAuditor};
use tautline_core::swarm::{ClosestApproach, Rows, set_row};
use tautline_core::track::{Item, Piece, Tracks};
use tautline_report::flight_log::{BUDGET_BYTES, FlightLog, PICTURED, Violations};

/// Keyframes a second at which known curves are drawn \[Hz\].
const CURVE_HZ: f64 = 30.0;
/// Items that are read before the first is judged: usual intervals are learnt from them.
const OPENING: usize = 65_536;
/// Keyframes of vehicles that were seen at times of their own, over those of the one that was seen most often.
const SHARED: usize = 2;

/// Why recorded motion cannot be drawn.
#[derive(Debug, thiserror::Error)]
pub enum TracksError<E> {
    /// It cannot be read.
    #[error("{0}")]
    Read(E),
    /// It can be read and not be drawn.
    #[error(transparent)]
    Render(#[from] RenderError),
}

/// What is known of one vehicle.
#[derive(Default)]
struct VehicleTrack {
    samples: Vec<(f64, Vector3<f64>)>,
    pieces: Vec<Piece>,
    radius_m: Option<f64>,
}

impl Timeline {
    /// Reads recorded motion. Vehicles that were seen at times of their own are put on common ones, with straight lines
    /// between; one that has not been seen yet, or no longer, is not there. The closest approaches, and the violations of
    /// `delta_m` \[m\], are those that [`TrackAuditor`](tautline_audit::recorded::TrackAuditor) finds in the recording; what
    /// it refuses is drawn and not judged.
    ///
    /// The result may be without keyframes.
    ///
    /// # Errors
    /// [`TracksError`] when the recording cannot be read, or a vehicle is beyond
    /// [`FARTHEST_M`](crate::FARTHEST_M).
    pub fn from_tracks<T: Tracks + ?Sized>(
        name: &str,
        recording: &mut T,
        delta_m: Option<f64>,
    ) -> Result<Self, TracksError<T::Error>> {
        let mut judge = Judge::new(delta_m);
        let tracks = read(recording, &mut judge)?;
        let mut timeline = Self::new(name, tracks.len());
        timeline.delta_m = delta_m;
        timeline.vehicles = (0..tracks.len()).map(|k| vehicle(recording, k)).collect();
        timeline.radius_m = tracks.iter().map(|track| track.radius_m.unwrap_or(UNKNOWN_RADIUS_M)).collect();
        if tracks.iter().any(|track| track.radius_m.is_none()) {
            timeline.notes.push(format!("vehicles of unknown radius are drawn with {UNKNOWN_RADIUS_M} m"));
        }
        timeline.by_radii = !tracks.is_empty() && tracks.iter().all(|track| track.radius_m.is_some());
        timeline.assumes_straight = tracks.iter().any(|track| !track.samples.is_empty());
        let mut places = vec![0; tracks.len()];
        let (judged, mut log) = (judge.finish(), FlightLog::default());
        for time_s in common_times(&tracks, &moments_s(&judged)) {
            let mut positions_m = Rows::zeros(tracks.len());
            for (k, track) in tracks.iter().enumerate() {
                let position_m = track.at(time_s, &mut places[k]);
                // Curves may go far between times that do not.
                check_lengths(position_m.iter(), "coordinate", time_s, || timeline.vehicles[k].clone())?;
                set_row(&mut positions_m, k, position_m);
            }
            log.take_positions(time_s, positions_m);
        }
        timeline.take_outcome(&mut log, judged);
        timeline.log = Arc::new(log);
        timeline.notes.extend_from_slice(recording.notes());
        Ok(timeline)
    }
}

/// Everything that is recorded, by vehicle.
fn read<T: Tracks + ?Sized>(recording: &mut T, judge: &mut Judge) -> Result<Vec<VehicleTrack>, TracksError<T::Error>> {
    let (mut tracks, mut items): (Vec<VehicleTrack>, _) = (Vec::new(), Vec::new());
    let (mut more, mut first) = (true, true);
    while more {
        while more && (items.is_empty() || first && items.len() < OPENING) {
            more = recording.read(&mut items).map_err(TracksError::Read)?;
        }
        first = false;
        judge.push(recording.vehicles(), &items);
        for item in items.drain(..) {
            let k = item.vehicle();
            if tracks.len() <= k {
                tracks.resize_with(k + 1, VehicleTrack::default);
            }
            match item {
                Item::Sample(sample) => {
                    let name = || vehicle(recording, k);
                    check_lengths(sample.position_m.iter(), "coordinate", sample.time_s, name)?;
                    check_lengths(&sample.radius_m, "radius", sample.time_s, name)?;
                    tracks[k].radius_m = sample.radius_m.or(tracks[k].radius_m);
                    tracks[k].samples.push((sample.time_s, sample.position_m));
                }
                Item::Piece(piece) => tracks[k].pieces.push(piece),
            }
        }
    }
    Ok(tracks)
}

/// The name of a vehicle; its number where it has none.
fn vehicle<T: Tracks + ?Sized>(recording: &T, k: usize) -> String {
    recording.vehicles().get(k).cloned().unwrap_or_else(|| (k + 1).to_string())
}

impl VehicleTrack {
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

/// The times of all samples where they are few, else evenly spaced ones and the moments that are looked at \[s\].
fn common_times(tracks: &[VehicleTrack], moments_s: &[f64]) -> Vec<f64> {
    let mut times: Vec<f64> = Vec::new();
    for track in tracks {
        times.extend(track.samples.iter().map(|sample| sample.0));
        times.extend(track.pieces.iter().flat_map(|piece| [piece.from_s, piece.to_s]));
    }
    times.retain(|time| time.is_finite());
    times.sort_unstable_by(f64::total_cmp);
    times.dedup();
    let (Some(&first), Some(&last)) = (times.first(), times.last()) else { return times };
    let most = BUDGET_BYTES / (tracks.len().max(1) * 6 * size_of::<f64>());
    let has_curves = tracks.iter().any(|track| !track.pieces.is_empty());
    let longest = tracks.iter().map(|track| track.samples.len()).max().unwrap_or(0);
    if !has_curves && times.len() <= most && times.len() <= SHARED * longest {
        return times;
    }
    let wanted = if has_curves { (last - first) * CURVE_HZ } else { longest as f64 };
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "bounded by both")]
    let steps = wanted.ceil().clamp(1.0, most.max(2) as f64) as usize;
    let even = (0..=steps).map(|k| first + (last - first) * (k as f64 / steps as f64));
    let mut times: Vec<f64> = even.chain(moments_s.iter().copied().filter(|at| (first..=last).contains(at))).collect();
    times.sort_unstable_by(f64::total_cmp);
    times.dedup();
    times
}

/// Safety distance of a recording that is to be drawn and not judged \[m\]: the closest approach is asked for alone.
const NO_DELTA_M: f64 = 1e-9;

/// The judge of recordings, as it reads on. Motion that it refuses is drawn and labelled as not judged.
struct Judge {
    auditor: Result<TrackAuditor, RecordedError>,
}

impl Judge {
    fn new(delta_m: Option<f64>) -> Self {
        let settings = Settings::delta(delta_m.unwrap_or(NO_DELTA_M));
        Self { auditor: TrackAuditor::new(settings).map(TrackAuditor::with_smallest) }
    }

    fn push(&mut self, names: &[String], items: &[Item]) {
        if let Ok(auditor) = &mut self.auditor
            && let Err(refused) = auditor.push(names, items)
        {
            self.auditor = Err(refused);
        }
    }

    fn finish(self) -> Result<Outcome, RecordedError> {
        self.auditor?.finish()
    }
}

/// Times of the closest approach and of the worst moments of the first violations \[s\].
fn moments_s(judged: &Result<Outcome, RecordedError>) -> Vec<f64> {
    let worst = |outcome: &Outcome| outcome.violations.iter().take(PICTURED).map(|found| found.min_at_s).collect();
    let mut moments: Vec<f64> = judged.as_ref().map_or_else(|_| Vec::new(), worst);
    moments.extend(judged.iter().filter_map(|outcome| outcome.closest.first()).map(|closest| closest.time_s));
    moments
}

impl Timeline {
    /// Takes the outcome of the judge on the motion of a log.
    fn take_outcome(&mut self, log: &mut FlightLog, judged: Result<Outcome, RecordedError>) {
        let outcome = match judged {
            Ok(outcome) => outcome,
            Err(refused) => {
                self.notes.push(format!("it was not judged: {refused}"));
                self.refused = true;
                return;
            }
        };
        let found = outcome.smallest.iter().map(|slice| &slice.closest).chain(outcome.closest.first());
        let mut closest: Vec<_> = found.filter_map(approach).collect();
        closest.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        let is_judged = self.delta_m.is_some() || self.by_radii;
        let violations = outcome.violations.into_iter().filter(|found| is_judged && found.pair.vehicles().is_some());
        log.judge(closest, Violations::judged(violations.collect()));
        if is_judged {
            let undecided = outcome.undecided.iter().map(|undecided| undecided.from_s);
            let open_s = undecided.chain(outcome.gaps.iter().map(|gap| gap.from_s)).reduce(f64::min);
            let open_s = open_s.or((outcome.status == Status::Undecided).then_some(f64::NEG_INFINITY));
            self.undecided_s = open_s.filter(|_| outcome.status != Status::Clear);
        }
    }
}

fn approach(found: &Approach) -> Option<ClosestApproach> {
    let (pair, separation_m, time_s) = (found.pair.vehicles()?, found.certain_m(), found.time_s);
    Some(ClosestApproach { pair, separation_m, time_s })
}
