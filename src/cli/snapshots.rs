//! The pictures that a run leaves.

use std::path::Path;

use rayon::iter::{IntoParallelRefIterator as _, ParallelIterator as _};

use super::Failure;
use super::console::Console;
use super::pictures::write_files;
use tautline_core::record::{Event, RecordError, Sample, Sink};
use tautline_render::{
    self, RenderError, Renderer, Snapshot, Theme, Timeline, View, data_uri, snapshot_names, snapshots_of_run,
};
use tautline_report::report::page::Picture;
use tautline_sim::scenario::Scenario;

/// Room for pictures on a page \[bytes\].
const PAGE_BYTES: usize = 900 << 10;

/// A flight as it is watched to take pictures of it.
pub(super) struct Watched {
    /// None where no pictures are wanted.
    timeline: Option<Timeline>,
    adapter: String,
}

impl Watched {
    /// Watches a flight of this scenario, if pictures of it are wanted, to be drawn by this adapter.
    pub(super) fn new(scenario: &Scenario, wanted: bool, adapter: &str) -> Self {
        Self { timeline: wanted.then(|| Timeline::of(scenario)), adapter: adapter.to_owned() }
    }

    /// Writes `snapshots/*.png` into a run's folder and gives them for its page; those of an earlier run are removed.
    /// A machine that cannot draw leaves none and says so.
    pub(super) fn snapshots(&self, folder: &Path, console: Console) -> Result<Vec<Picture>, Failure> {
        let snapshots = self.taken().unwrap_or_else(|failure| {
            console.warn(&format!("no pictures were taken: {}", failure.in_words()));
            Vec::new()
        });
        let file = |name: &str| format!("{name}.png");
        let room = PAGE_BYTES / snapshots.len().max(1);
        let encoded: Vec<_> =
            snapshots.par_iter().map(|snapshot| encoded(&snapshot.picture, room)).collect::<Result<_, _>>()?;
        let names: Vec<_> = snapshot_names().iter().map(|name| file(name)).collect();
        let (files, on_page): (Vec<_>, Vec<_>) = std::iter::zip(snapshots, encoded)
            .map(|(Snapshot { name, description, .. }, [png, small])| {
                ((file(&name), png), Picture { description, data_uri: data_uri(&small) })
            })
            .unzip();
        write_files(&folder.join("snapshots"), &names, &files)?;
        Ok(on_page)
    }

    fn taken(&self) -> Result<Vec<Snapshot>, Failure> {
        let Some(timeline) = &self.timeline else { return Ok(Vec::new()) };
        let view = View { theme: Theme::Light, ..View::default() };
        if timeline.keyframes().is_empty() {
            return Err(RenderError::Empty(timeline.name.clone()).into());
        }
        let mut renderer = Renderer::open(&self.adapter.as_str().into())?;
        Ok(snapshots_of_run(&mut renderer, timeline, &view)?)
    }
}

impl Sink for Watched {
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

/// A picture as PNG, small enough for a page with so many.
pub(super) fn on_page(picture: &tautline_render::Picture, count: usize) -> Result<Vec<u8>, Failure> {
    let [_, small] = encoded(picture, PAGE_BYTES / count.max(1))?;
    Ok(small)
}

/// A picture as PNG, and smaller where that takes more than its room on a page \[bytes\].
fn encoded(picture: &tautline_render::Picture, room: usize) -> Result<[Vec<u8>; 2], Failure> {
    let png = picture.to_png()?;
    let (mut small, mut smaller) = (png.clone(), picture.clone());
    while small.len() > room {
        smaller = smaller.halved();
        small = smaller.to_png()?;
    }
    Ok([png, small])
}
