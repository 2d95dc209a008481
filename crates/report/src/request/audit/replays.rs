//! Replays of recordings that were judged.

use std::collections::BTreeMap;

use super::super::{Failure, Monitor};
use super::{Open, encounters};
use crate::figures::Figure;
use crate::flight_log::FlightLog;
use crate::replay::{Kind, MOST_INSTANTS, NoReplay, PAGE_BYTES, Replay, Span, Stage, chosen};
use crate::report::recorded::RecordedReport;
use tautline_audit::Slices;
use tautline_audit::recorded::{Motion, Outcome, Places, Settings, TOUCHING_ELLIPSOIDS};
use tautline_core::track::Item;

/// Most times of a recording that are kept while it is judged.
const MOST_TIMES: usize = 1 << 20;
/// Instants a second at which known curves are drawn \[Hz\].
const CURVE_HZ: f64 = 30.0;

/// When a recording says something, as it is read.
#[derive(Default)]
pub(super) struct Instants {
    times_s: Vec<f64>,
    /// Different times.
    seen: usize,
    has_curves: bool,
}

impl Instants {
    /// Takes note of items, by clocks that these settings set right. Beyond a million times every second one is dropped.
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

    /// The times that are shown of a recording with this outcome.
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

/// Reads a recording again for its replay, or why there is none, and for the figures of those who came closest.
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
    let mut places = Places::new(settings, outcome, instants.shown(outcome, &spans));
    let figures = encounters::figures(open, monitor, settings, outcome, &mut places)?;
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
        obstacles: settings.obstacles.clone(),
    };
    let gaps = places.gaps().iter().map(|gap| (gap.vehicle, [gap.from_s, gap.to_s])).collect();
    let (times_s, positions_m) = places.finish();
    let holds = settings.motion == Some(Motion::Hold);
    let mut log = FlightLog::recorded(times_s, positions_m, near, seen);
    (log.gaps, log.holds) = (gaps, holds);
    Ok((Replay::new(&stage, &log, &moments, report.judgement(), PAGE_BYTES), figures))
}
