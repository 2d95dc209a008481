//! The pictures that a run leaves.

use super::gpu::{Renderer, ShootError};
use super::picture::Picture;
use super::scene::{CameraSpec, Scene, Stage, View};
use super::{Footage, Moment};

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

/// What is worth a picture: name, description, time \[s\] and camera.
fn occasions(footage: &Footage) -> Vec<(String, String, f64, CameraSpec)> {
    let [start_s, end_s] = footage.range_s();
    let mut occasions = vec![("start".to_owned(), format!("The start, at {start_s:.2} s."), start_s, CameraSpec::Iso)];
    if let Some(closest) = footage.closest() {
        let description = format!(
            "The closest approach of the flight: vehicles {} at {:.2} s, {:.3} m apart.",
            closest.pair, closest.time_s, closest.separation_m
        );
        occasions.push(("closest".to_owned(), description, closest.time_s, CameraSpec::Iso));
    }
    occasions.push(("end".to_owned(), format!("The end, at {end_s:.2} s."), end_s, CameraSpec::Iso));
    for (k, span) in footage.violations().iter().take(MOST_VIOLATIONS).enumerate() {
        let until_s = span.to_s.min(end_s);
        let description =
            format!("Vehicles {} were closer than delta from {:.2} s to {until_s:.2} s.", span.pair, span.from_s);
        occasions.push((format!("violation-{}", k + 1), description, footage.worst_s(span), CameraSpec::Closest));
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
    for (name, description, time_s, camera) in occasions(footage) {
        let Some(moment): Option<Moment> = footage.at(time_s) else { break };
        let view = View { camera, ..view.clone() };
        let picture = renderer.paint(&Scene::compose(footage, &stage, &moment, &view)?)?;
        snapshots.push(Snapshot { name, description, picture });
    }
    Ok(snapshots)
}
