//! Pictures of a run for its folder and its page.

use std::path::Path;
use std::sync::Arc;

use rayon::iter::{IntoParallelRefIterator as _, ParallelIterator as _};

use crate::scene::{Camera, metres};
use crate::{Extent, FoxgloveScene, Picture, RenderError, Renderer, Scene, Theme, Timeline, View, data_uri};
use tautline_core::failure::Failure;
use tautline_core::monitor::Monitor;
use tautline_core::record::Event;
use tautline_recordings::mcap::ExtraTopic;
use tautline_report::flight_log::{FlightLog, Frame, PICTURED};
use tautline_report::report::{Report, page};
use tautline_report::request::{NamedPicture, PICTURES_BYTES, Pictures, write_files};
use tautline_sim::plan::Plan;
use tautline_sim::scenario::Scenario;

/// Size of the pictures of a run \[pixels\]. A page shows them at less than half of it.
const SIZE_PX: [u32; 2] = [1280, 800];
/// Size of the texts of these pictures, so that they can be read in the page.
const TEXT_SCALE: f32 = 1.75;

/// Draws pictures of runs with a graphics adapter.
pub struct RunPictures {
    /// Adapter: `best`, `hardware`, `software`, or a part of its name.
    pub adapter: String,
    /// Whether pictures are taken. The scene is recorded in any case.
    pub takes_snapshots: bool,
}

impl Pictures for RunPictures {
    /// Writes `snapshots/*.png`; files of an earlier run are removed.
    fn draw(
        &self,
        scenario: &Scenario,
        report: &Report,
        log: &Arc<FlightLog>,
        folder: &Path,
        monitor: &dyn Monitor,
    ) -> Result<Vec<NamedPicture>, Failure> {
        let timeline = Timeline::flown(scenario, Arc::clone(log)).judged(report.answer.status);
        let snapshots = if self.takes_snapshots { snapshots(&self.adapter, timeline) } else { Ok(Vec::new()) };
        let snapshots = snapshots.unwrap_or_else(|error| {
            monitor.warn(&format!("no pictures were taken: {}", Failure::from(error).in_words()));
            Vec::new()
        });
        let file = |name: &str| format!("{name}.png");
        let max_bytes = PICTURES_BYTES / snapshots.len().max(1);
        let encoded: Vec<_> =
            snapshots.par_iter().map(|snapshot| encode(&snapshot.picture, max_bytes)).collect::<Result<_, _>>()?;
        let is_light = !Plan::of(scenario).is_show();
        let names: Vec<_> = snapshot_names().iter().map(|name| file(name)).collect();
        let (files, on_page): (Vec<_>, Vec<_>) = std::iter::zip(snapshots, encoded)
            .map(|(Snapshot { name, description, .. }, [png, small])| {
                let file = file(&name);
                let picture = page::Picture {
                    description,
                    data_uri: data_uri(&small),
                    file: format!("snapshots/{file}"),
                    is_light,
                };
                ((file, png), (name, picture))
            })
            .unzip();
        write_files(&folder.join("snapshots"), &names, &files)?;
        Ok(on_page)
    }

    fn topic(&self, scenario: &Scenario) -> Option<Box<dyn ExtraTopic>> {
        Some(Box::new(FoxgloveScene::of(scenario)))
    }
}

/// Picture with its file name without `.png`, and its description in a sentence.
struct Snapshot {
    name: String,
    description: String,
    picture: Picture,
}

/// Returns the names of all pictures that a run can have.
fn snapshot_names() -> Vec<String> {
    let numbered = ["leg", "violation"].into_iter().flat_map(|name| (1..=PICTURED).map(move |k| format!("{name}-{k}")));
    ["start", "closest", "end", "obstacle"].map(str::to_owned).into_iter().chain(numbered).collect()
}

/// Camera of a frame.
type CameraOf<'a> = dyn Fn(&Frame) -> Result<Camera, RenderError> + 'a;

/// Draws the start, the closest approach, the ends of the first ten legs, the end, the first violation of an obstacle's
/// clearance, and the first ten violations of two vehicles.
fn snapshots(adapter: &str, timeline: Timeline) -> Result<Vec<Snapshot>, RenderError> {
    if timeline.log.keyframes().is_empty() {
        return Err(RenderError::Empty(timeline.name));
    }
    let mut renderer = Renderer::open(&adapter.into())?;
    let (timeline, extent) = (&timeline, Extent::of(&timeline));
    let view = &View { theme: Theme::Light, size_px: SIZE_PX, text_scale: TEXT_SCALE, ..View::of(timeline) };
    let mut snapshots = Vec::new();
    let mut shoot = |name: &str, description: String, time_s: f64, camera: &CameraOf<'_>| {
        let Some(frame) = timeline.log.at(time_s) else { return Ok(()) };
        let camera = camera(&frame)?;
        let picture = renderer.paint(&Scene::compose(timeline, &extent, &frame, view, camera))?;
        snapshots.push(Snapshot { name: name.to_owned(), description, picture });
        Ok::<(), RenderError>(())
    };
    let [start_s, end_s] = timeline.log.range_s();
    let whole = |frame: &Frame| extent.camera(timeline, frame, view);
    shoot("start", format!("The start, at {start_s:.2} s."), start_s, &whole)?;
    if let Some(closest) = timeline.log.closest() {
        let (pair, time_s, apart) = (closest.pair, closest.time_s, metres(closest.separation_m));
        let what = format!("The closest approach of the flight: vehicles {pair} at {time_s:.2} s, {apart} apart.");
        shoot("closest", what, time_s, &|frame| extent.camera_on(timeline, frame, view, pair))?;
    }
    // A leg ends when the next one begins.
    let legs = timeline.log.targets().iter().filter_map(|event| match event {
        Event::LegBegan { leg, time_s } if (1..=PICTURED).contains(leg) && *time_s > start_s => Some((*leg, *time_s)),
        _ => None,
    });
    for (leg, time_s) in legs {
        shoot(&format!("leg-{leg}"), format!("The end of leg {leg}, at {time_s:.2} s."), time_s.next_down(), &whole)?;
    }
    shoot("end", format!("The end, at {end_s:.2} s."), end_s, &whole)?;
    if let Some((near, [vehicle, obstacle])) = timeline.log.violations().of_obstacles().next() {
        let (vehicle, obstacle) = (&timeline.vehicles[vehicle], timeline.obstacle(obstacle));
        let what = format!("Vehicle {vehicle} came too close to {obstacle} at {:.2} s.", near.from_s);
        shoot("obstacle", what, f64::midpoint(near.from_s, near.to_s.min(end_s)), &whole)?;
    }
    for (k, span) in timeline.log.violations().of_vehicles().take(PICTURED).enumerate() {
        let (pair, from_s, to_s) = (span.pair, span.from_s, span.to_s.min(end_s));
        let what = format!("Vehicles {pair} were closer than delta from {from_s:.2} s to {to_s:.2} s.");
        let near = |frame: &Frame| Ok(extent.close_up(timeline, frame, pair, view));
        shoot(&format!("violation-{}", k + 1), what, span.min_at_s, &near)?;
    }
    Ok(snapshots)
}

/// Encodes a picture as PNG twice: in full size, and halved until it takes at most `room` bytes.
fn encode(picture: &Picture, max_bytes: usize) -> Result<[Vec<u8>; 2], RenderError> {
    let png = picture.to_png()?;
    let (mut small, mut smaller) = (png.clone(), picture.clone());
    while small.len() > max_bytes {
        smaller = smaller.halved();
        small = smaller.to_png()?;
    }
    Ok([png, small])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_of_a_run_have_known_names() {
        let names = snapshot_names();
        for name in ["start", "closest", "end", "obstacle", "leg-1", "leg-10", "violation-10"] {
            assert!(names.iter().any(|known| known == name), "{name}");
        }
        assert_eq!(names.len(), 4 + 2 * PICTURED);
    }
}
