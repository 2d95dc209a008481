//! The pictures that a run leaves.

use super::Footage;
use super::gpu::{Renderer, ShootError};
use super::picture::Picture;
use super::scene::{CameraSpec, Scene, Stage, View, metres};
use crate::swarm::Pair;

/// Most violations that are pictured.
const MOST_VIOLATIONS: usize = 10;

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

/// What is worth a picture.
struct Occasion {
    name: String,
    description: String,
    time_s: f64,
    /// The pair to be seen from near; the whole flight where there is none.
    pair: Option<Pair>,
}

fn occasions(footage: &Footage) -> Vec<Occasion> {
    let [start_s, end_s] = footage.range_s();
    let whole = |name: &str, description, time_s| Occasion { name: name.to_owned(), description, time_s, pair: None };
    let mut occasions = vec![whole("start", format!("The start, at {start_s:.2} s."), start_s)];
    if let Some(closest) = footage.closest() {
        let description = format!(
            "The closest approach of the flight: vehicles {} at {:.2} s, {} apart.",
            closest.pair,
            closest.time_s,
            metres(closest.separation_m)
        );
        occasions.push(whole("closest", description, closest.time_s));
    }
    occasions.push(whole("end", format!("The end, at {end_s:.2} s."), end_s));
    for (k, span) in footage.violations().iter().take(MOST_VIOLATIONS).enumerate() {
        let until_s = span.to_s.min(end_s);
        let description =
            format!("Vehicles {} were closer than delta from {:.2} s to {until_s:.2} s.", span.pair, span.from_s);
        let (name, time_s) = (format!("violation-{}", k + 1), footage.worst_s(span));
        occasions.push(Occasion { name, description, time_s, pair: Some(span.pair) });
    }
    occasions
}

/// Names of all pictures that [`snapshots_of_run`] can take.
#[must_use]
pub fn snapshot_names() -> Vec<String> {
    let violations = (1..=MOST_VIOLATIONS).map(|k| format!("violation-{k}"));
    ["start", "closest", "end"].map(str::to_owned).into_iter().chain(violations).collect()
}

/// Pictures of the start, the closest approach, the end and the first ten violations of a flight; none of a flight
/// without instants.
///
/// # Errors
/// [`ShootError`] when the adapter fails.
pub fn snapshots_of_run(renderer: &mut Renderer, footage: &Footage, view: &View) -> Result<Vec<Snapshot>, ShootError> {
    let stage = Stage::of(footage);
    let mut snapshots = Vec::new();
    let view = View { camera: CameraSpec::Iso, ..view.clone() };
    for Occasion { name, description, time_s, pair } in occasions(footage) {
        let Some(moment) = footage.at(time_s) else { break };
        let camera = match pair {
            Some(pair) => stage.close_up(footage, &moment, pair, view.size_px),
            None => stage.camera(footage, &moment, &view)?,
        };
        let picture = renderer.paint(&Scene::seen_by(camera, footage, &stage, &moment, &view))?;
        snapshots.push(Snapshot { name, description, picture });
    }
    Ok(snapshots)
}
