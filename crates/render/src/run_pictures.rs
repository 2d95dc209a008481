//! Pictures for the folder and the page of a run.

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::{Mutex, PoisonError};

use rayon::iter::{IntoParallelRefIterator as _, ParallelIterator as _};

use crate::{
    FoxgloveScene, Picture, RenderError, Renderer, Snapshot, Theme, Timeline, View, data_uri, snapshot_names,
    snapshots_of_run,
};
use tautline_core::record::{Event, RecordError, Sample, Sink};
use tautline_recordings::mcap::ExtraTopic;
use tautline_report::report::page;
use tautline_report::request::{Failure, FlightPictures, Monitor, NamedPicture, PICTURES_BYTES, Pictures, write_files};
use tautline_report::run::run_while;
use tautline_sim::preflight::Preflight;
use tautline_sim::scenario::Scenario;

/// Draws runs with the graphics adapter of the machine.
pub struct RunPictures {
    adapter: String,
    /// Whether snapshots are taken. The scene is recorded in any case.
    takes_snapshots: bool,
    renderer: Mutex<Option<Renderer>>,
}

impl RunPictures {
    /// Draws with the adapter of this name: `best`, `hardware`, `software`, or a part of its own name.
    #[must_use]
    pub fn new(adapter: &str) -> Self {
        Self { adapter: adapter.to_owned(), takes_snapshots: true, renderer: Mutex::new(None) }
    }

    /// The same, perhaps without snapshots.
    #[must_use]
    pub fn with_snapshots(self, takes_snapshots: bool) -> Self {
        Self { takes_snapshots, ..self }
    }
}

impl Pictures for RunPictures {
    fn observe(&self, scenario: &Scenario) -> Box<dyn FlightPictures> {
        let timeline = self.takes_snapshots.then(|| Timeline::of(scenario));
        Box::new(Observer { timeline, adapter: self.adapter.clone() })
    }

    fn shot(&self, scenario: &Scenario, at_s: f64, room_bytes: usize) -> Result<String, Failure> {
        let mut renderer = self.renderer.lock().unwrap_or_else(PoisonError::into_inner);
        let renderer = match &mut *renderer {
            Some(renderer) => renderer,
            none => none.insert(Renderer::open(&self.adapter.as_str().into())?),
        };
        let view = View { theme: Theme::Light, ..View::default() };
        let [_, small] = encoded(&renderer.shoot(&flown_to(scenario, at_s)?, at_s, &view)?, room_bytes)?;
        Ok(data_uri(&small))
    }

    fn topic(&self, scenario: &Scenario) -> Option<Box<dyn ExtraTopic>> {
        Some(Box::new(FoxgloveScene::of(scenario)))
    }
}

/// A flight up to just after an instant, with every step of it.
fn flown_to(scenario: &Scenario, time_s: f64) -> Result<Timeline, Failure> {
    let mut scenario = scenario.clone();
    scenario.time.record_hz = 1.0 / scenario.time.dt_s;
    let mut timeline = Timeline::of(&scenario);
    let mut carry_on = |step: u64| {
        if scenario.time.end_s(step) > time_s { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    run_while(&scenario, &Preflight::of(&scenario)?, &mut timeline, &mut carry_on)?;
    Ok(timeline)
}

/// A flight as it is observed to take pictures of it.
struct Observer {
    /// None where no pictures are wanted.
    timeline: Option<Timeline>,
    adapter: String,
}

impl Observer {
    fn snapshots(&self) -> Result<Vec<Snapshot>, RenderError> {
        let Some(timeline) = &self.timeline else { return Ok(Vec::new()) };
        let view = View { theme: Theme::Light, ..View::default() };
        if timeline.keyframes().is_empty() {
            return Err(RenderError::Empty(timeline.name.clone()));
        }
        let mut renderer = Renderer::open(&self.adapter.as_str().into())?;
        snapshots_of_run(&mut renderer, timeline, &view)
    }
}

impl Sink for Observer {
    fn sample(&mut self, sample: &Sample<'_>) -> Result<(), RecordError> {
        self.timeline.as_mut().map_or(Ok(()), |timeline| timeline.sample(sample))
    }

    fn event(&mut self, event: &Event) -> Result<(), RecordError> {
        self.timeline.as_mut().map_or(Ok(()), |timeline| timeline.event(event))
    }

    fn looks_at_steps(&self) -> bool {
        false
    }
}

impl FlightPictures for Observer {
    /// Writes `snapshots/*.png`; those of an earlier run are removed.
    fn write(&self, folder: &Path, monitor: &dyn Monitor) -> Result<Vec<NamedPicture>, Failure> {
        let snapshots = self.snapshots().unwrap_or_else(|error| {
            monitor.warn(&format!("no pictures were taken: {}", Failure::from(error).in_words()));
            Vec::new()
        });
        let file = |name: &str| format!("{name}.png");
        let room = PICTURES_BYTES / snapshots.len().max(1);
        let encoded: Vec<_> =
            snapshots.par_iter().map(|snapshot| encoded(&snapshot.picture, room)).collect::<Result<_, _>>()?;
        let names: Vec<_> = snapshot_names().iter().map(|name| file(name)).collect();
        let (files, on_page): (Vec<_>, Vec<_>) = std::iter::zip(snapshots, encoded)
            .map(|(Snapshot { name, description, .. }, [png, small])| {
                let picture = page::Picture { description, data_uri: data_uri(&small) };
                ((file(&name), png), (name.clone(), picture))
            })
            .unzip();
        write_files(&folder.join("snapshots"), &names, &files)?;
        Ok(on_page)
    }
}

/// A picture as PNG, and smaller where that takes more than its room on a page \[bytes\].
fn encoded(picture: &Picture, room: usize) -> Result<[Vec<u8>; 2], RenderError> {
    let png = picture.to_png()?;
    let (mut small, mut smaller) = (png.clone(), picture.clone());
    while small.len() > room {
        smaller = smaller.halved();
        small = smaller.to_png()?;
    }
    Ok([png, small])
}
