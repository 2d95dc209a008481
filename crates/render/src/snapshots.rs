//! The pictures that a run leaves.

use super::error::RenderError;
use super::gpu::Renderer;
use super::picture::Picture;
use super::scene::{CameraSpec, Extent, Scene, View, metres};
use super::timeline::{PICTURED, Timeline};
use tautline_core::swarm::Pair;

/// A picture with its name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Snapshot {
    /// Name of its file without `.png`.
    pub name: String,
    /// What it shows, in a sentence.
    pub description: String,
    /// The picture.
    pub picture: Picture,
}

/// Names of all pictures that [`snapshots_of_run`] can take.
#[must_use]
pub fn snapshot_names() -> Vec<String> {
    let violations = (1..=PICTURED).map(|k| format!("violation-{k}"));
    ["start", "closest", "end", "obstacle"].map(str::to_owned).into_iter().chain(violations).collect()
}

/// Pictures of the start, the closest approach, the end, the first violation of an obstacle's clearance and the first ten of two vehicles of a flight; none of a flight
/// without samples.
///
/// # Errors
/// [`RenderError`] when the adapter fails.
pub fn snapshots_of_run(
    renderer: &mut Renderer,
    timeline: &Timeline,
    view: &View,
) -> Result<Vec<Snapshot>, RenderError> {
    let extent = Extent::of(timeline);
    let view = View { camera: CameraSpec::Iso, ..view.clone() };
    let mut snapshots = Vec::new();
    // The whole flight, or one pair from near.
    let mut shoot = |name: &str, description: String, time_s: f64, pair: Option<Pair>| {
        let Some(frame) = timeline.at(time_s) else { return Ok(()) };
        let camera = match pair {
            Some(pair) => extent.close_up(timeline, &frame, pair, view.size_px),
            None => extent.camera(timeline, &frame, &view)?,
        };
        let picture = renderer.paint(&Scene::compose(timeline, &extent, &frame, &view, camera))?;
        snapshots.push(Snapshot { name: name.to_owned(), description, picture });
        Ok::<(), RenderError>(())
    };
    let [start_s, end_s] = timeline.range_s();
    shoot("start", format!("The start, at {start_s:.2} s."), start_s, None)?;
    if let Some(closest) = timeline.closest() {
        let (pair, time_s, apart) = (closest.pair, closest.time_s, metres(closest.separation_m));
        let what = format!("The closest approach of the flight: vehicles {pair} at {time_s:.2} s, {apart} apart.");
        shoot("closest", what, time_s, None)?;
    }
    shoot("end", format!("The end, at {end_s:.2} s."), end_s, None)?;
    if let Some(near) = timeline.too_near().first() {
        let (vehicle, obstacle) = (&timeline.vehicles[near.vehicle], timeline.obstacle(near.obstacle));
        let what = format!("Vehicle {vehicle} came too near to {obstacle} at {:.2} s.", near.from_s);
        shoot("obstacle", what, f64::midpoint(near.from_s, near.to_s.min(end_s)), None)?;
    }
    for (k, span) in timeline.violations().iter().take(PICTURED).enumerate() {
        let (pair, from_s, to_s) = (span.pair, span.from_s, span.to_s.min(end_s));
        let what = format!("Vehicles {pair} were closer than delta from {from_s:.2} s to {to_s:.2} s.");
        shoot(&format!("violation-{}", k + 1), what, span.min_at_s, Some(pair))?;
    }
    Ok(snapshots)
}
