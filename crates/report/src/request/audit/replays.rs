//! Replays of judged recordings, and figures of the closest pairs.

use std::collections::BTreeMap;

use super::super::{Failure, Monitor};
use super::Open;
use crate::figures;
use crate::figures::{Encounter, Figure, LowerBound};
use crate::flight_log::FlightLog;
use crate::replay::{Kind, MOST_INSTANTS, NoReplay, PAGE_BYTES, Replay, Span, Stage, chosen};
use crate::report::recorded::{RecordedReport, interval, unit};
use tautline_audit::recorded::{
    Approach, Interpolation, Outcome, PairSeries, PositionLookup, RecordedError, Settings, TOUCHING_ELLIPSOIDS,
};
use tautline_audit::{Slice, Slices};
use tautline_core::track::Item;

/// Largest number of times that are kept during an audit.
const MOST_TIMES: usize = 1 << 20;
/// Rate at which curves are drawn \[Hz\].
const CURVE_HZ: f64 = 30.0;

/// Times of the samples of a recording.
#[derive(Default)]
pub(super) struct Instants {
    times_s: Vec<f64>,
    /// Number of different times.
    seen: usize,
    has_curves: bool,
}

impl Instants {
    /// Adds the times of items, corrected by the clocks of the settings. Every second time is dropped beyond
    /// [`MOST_TIMES`].
    pub(super) fn note(&mut self, items: &[Item], names: &[String], settings: &Settings) {
        let offsets: BTreeMap<usize, f64> =
            names.iter().enumerate().filter_map(|(k, name)| Some((k, settings.vehicles.get(name)?.offset_s))).collect();
        for item in items {
            let time_s = item.time_s() + offsets.get(&item.vehicle()).copied().unwrap_or(0.0);
            self.has_curves |= matches!(item, Item::Piece(_));
            if self.times_s.last() != Some(&time_s) {
                self.times_s.push(time_s);
                self.seen += 1;
            }
            if self.times_s.len() > MOST_TIMES {
                let mut k = 0_usize;
                self.times_s.retain(|_| {
                    k += 1;
                    k % 2 == 1
                });
            }
        }
    }

    /// Returns the times that the replay shows for this outcome.
    fn shown(self, outcome: &Outcome, spans: &[Span]) -> Vec<f64> {
        let Some((from_s, to_s)) = outcome.span_s else { return Vec::new() };
        let mut times_s = self.times_s;
        if self.has_curves {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
            let steps = ((to_s - from_s) * CURVE_HZ).ceil().clamp(1.0, MOST_INSTANTS as f64) as usize;
            times_s.extend((0..=steps).map(|k| from_s + (to_s - from_s) * (k as f64 / steps as f64)));
        }
        times_s.extend(spans.iter().flat_map(|span| [span.from_s, span.at_s, span.to_s]));
        times_s.extend([from_s, to_s]);
        times_s.retain(|time_s| (from_s..=to_s).contains(time_s));
        times_s.sort_unstable_by(f64::total_cmp);
        times_s.dedup();
        chosen(&times_s, spans, MOST_INSTANTS).into_iter().map(|k| times_s[k]).collect()
    }
}

/// Reads a recording again and returns its replay, or the reason for its absence, and the figures of the closest
/// pairs.
pub(super) fn of_recording(
    open: &Open<'_>,
    monitor: &dyn Monitor,
    settings: &Settings,
    outcome: &Outcome,
    report: &RecordedReport,
    instants: Instants,
) -> Result<(Result<Replay, NoReplay>, Vec<Figure>), Failure> {
    let moments = report.moments();
    let spans: Vec<_> = moments.iter().filter(|of| of.kind != Kind::Unseen).map(|moment| moment.span).collect();
    let seen = instants.seen;
    let mut places = PositionLookup::new(settings, outcome, instants.shown(outcome, &spans));
    let figures = encounter_figures(open, monitor, settings, outcome, &mut places)?;
    let mut near = Slices::default();
    outcome.smallest.iter().for_each(|slice| near.take(*slice));
    let half = |delta_m: f64| [0.5 * delta_m; 3];
    let ellipsoid =
        settings.ellipsoid_m.map(|axes_m| (axes_m * (0.5 * settings.delta_m.unwrap_or(TOUCHING_ELLIPSOIDS))).into());
    let stage = Stage {
        vehicles: outcome.vehicles.clone(),
        radius_m: places.radius_m(),
        shell_m: ellipsoid.or(settings.delta_m.map(half)),
        plan: None,
        rotors: None,
        obstacles: settings.obstacles.clone(),
    };
    let gaps = places.gaps().iter().map(|gap| (gap.vehicle, [gap.from_s, gap.to_s])).collect();
    let (times_s, positions_m) = places.finish();
    let holds = settings.motion == Some(Interpolation::Hold);
    let mut log = FlightLog::recorded(times_s, positions_m, near, seen);
    (log.gaps, log.holds) = (gaps, holds);
    Ok((Replay::new(&stage, &log, &moments, report.judgement(), PAGE_BYTES), figures))
}

/// Largest number of pairs, and of approaches to obstacles, in figures.
const DRAWN: usize = 3;

/// Reads the recording again for the closest pairs and for the positions of all vehicles.
fn encounter_figures(
    open: &Open<'_>,
    monitor: &dyn Monitor,
    settings: &Settings,
    outcome: &Outcome,
    places: &mut PositionLookup,
) -> Result<Vec<Figure>, Failure> {
    let follow = |approach: &Approach| Ok((PairSeries::new(settings, outcome, approach.pair)?, *approach));
    let closest = |of: &[Approach]| of.iter().take(DRAWN).map(follow).collect::<Result<Vec<_>, RecordedError>>();
    let (mut pairs, mut obstacles) = (closest(&outcome.closest)?, closest(&outcome.obstacles)?);
    let mut recording = open()?;
    let (mut items, mut more) = (Vec::new(), true);
    while more {
        if monitor.is_interrupted() {
            return Err(Failure::interrupted());
        }
        items.clear();
        more = recording.read(&mut items)?;
        places.push(&items)?;
        for (series, _) in pairs.iter_mut().chain(&mut obstacles) {
            series.push(&items)?;
        }
    }
    let drawn = |followed: Vec<(PairSeries, Approach)>| -> Vec<Encounter> {
        followed.into_iter().map(|(series, approach)| encounter(series, &approach, settings, outcome)).collect()
    };
    let (pairs, obstacles) = (drawn(pairs), drawn(obstacles));
    let mut drawn = Vec::new();
    if let Some(nearest) = pairs.first() {
        drawn.push(figures::encounters(&pairs, "encounters", "Distances of the closest pairs"));
        drawn.push(figures::closest_approach(nearest, "Closest approach from above"));
        drawn.push(figures::smallest(&lower_bounds(&outcome.smallest), nearest, "Smallest separation of all pairs"));
    }
    if !obstacles.is_empty() {
        drawn.push(figures::encounters(&obstacles, "obstacles", "Distances from the closest obstacles"));
    }
    Ok(drawn)
}

/// Returns the lower bounds of the separation in the intervals in which it is known.
fn lower_bounds(slices: &[Slice]) -> Vec<LowerBound> {
    slices.iter().map(|slice| LowerBound { interval_s: slice.known_s(), distance: slice.closest.lower_m }).collect()
}

/// Returns the data of a figure of a close pair.
fn encounter(series: PairSeries, approach: &Approach, settings: &Settings, outcome: &Outcome) -> Encounter {
    let unit = unit(settings);
    let mut encounter = Encounter {
        names: outcome.names(approach.pair, &settings.obstacles),
        unit,
        distances: Vec::new(),
        paths_m: [Vec::new(), Vec::new()],
        limit_m: approach.limit_m,
        closest_s: approach.time_s,
        closest: format!("{} {unit}", interval(approach.lower_m, approach.upper_m, approach.limit_m)),
    };
    for sample in series.finish() {
        if sample.unseen_before {
            encounter.distances.push((sample.time_s, f64::NAN, 0.0));
            encounter.paths_m.iter_mut().for_each(|path| path.push((f64::NAN, f64::NAN)));
        }
        encounter.distances.push((sample.time_s, sample.distance_m, sample.deviation_m));
        for (path, at) in encounter.paths_m.iter_mut().zip(sample.positions_m) {
            path.push((at.x, at.y));
        }
    }
    encounter
}
