//! The pictures that a run leaves.

use std::path::Path;

use super::Failure;
use super::console::Console;
use crate::record::{Event, RecordError, Sample, Sink};
use crate::report::page::Picture;

/// A flight as it is watched to take pictures of it.
pub(super) struct Watched {
    #[cfg(feature = "viewer")]
    camera: Option<viewer::Camera>,
}

impl Watched {
    /// Takes no pictures.
    pub(super) fn nothing() -> Self {
        Self {
            #[cfg(feature = "viewer")]
            camera: None,
        }
    }

    /// Writes `snapshots/*.png` into a run's folder and gives them for its page; those of an earlier run are removed.
    /// A machine that cannot draw leaves none and says so.
    pub(super) fn snapshots(self, folder: &Path, console: Console) -> Result<Vec<Picture>, Failure> {
        #[cfg(feature = "viewer")]
        let taken = viewer::snapshots(self.camera, folder, console);
        #[cfg(not(feature = "viewer"))]
        let taken = {
            let _ = (self, folder, console);
            Ok(Vec::new())
        };
        taken
    }
}

impl Sink for Watched {
    fn sample(&mut self, sample: &Sample<'_>) -> Result<(), RecordError> {
        #[cfg(feature = "viewer")]
        if let Some(camera) = &mut self.camera {
            camera.timeline.take(sample);
        }
        let _ = sample;
        Ok(())
    }

    fn event(&mut self, event: &Event) -> Result<(), RecordError> {
        #[cfg(feature = "viewer")]
        if let Some(camera) = &mut self.camera {
            camera.timeline.note(event);
        }
        let _ = event;
        Ok(())
    }
}

#[cfg(feature = "viewer")]
mod viewer {
    use std::path::Path;

    use rayon::iter::{IntoParallelRefIterator as _, ParallelIterator as _};

    use super::super::{Failure, console::Console, pictures::write_files};
    use super::{Picture, Watched};
    use crate::render::{
        self, RenderError, Renderer, Snapshot, Theme, Timeline, View, data_uri, snapshot_names, snapshots_of_run,
    };
    use crate::scenario::Scenario;

    /// Room for pictures on a page \[bytes\].
    const PAGE_BYTES: usize = 900 << 10;

    /// A flight in memory, and what is to draw it.
    pub(super) struct Camera {
        pub(super) timeline: Timeline,
        adapter: String,
    }

    impl Watched {
        /// Watches a flight of this scenario, to be drawn by this adapter.
        pub(in super::super) fn of(scenario: &Scenario, adapter: &str) -> Self {
            Self { camera: Some(Camera { timeline: Timeline::of(scenario), adapter: adapter.to_owned() }) }
        }
    }

    pub(super) fn snapshots(camera: Option<Camera>, folder: &Path, console: Console) -> Result<Vec<Picture>, Failure> {
        let snapshots = match camera {
            Some(camera) => taken(&camera).unwrap_or_else(|failure| {
                console.warn(&format!("no pictures were taken: {}", failure.in_words()));
                Vec::new()
            }),
            None => Vec::new(),
        };
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

    /// A picture as PNG, and smaller where that takes more than its room on a page \[bytes\].
    fn encoded(picture: &render::Picture, room: usize) -> Result<[Vec<u8>; 2], Failure> {
        let png = picture.to_png()?;
        let (mut small, mut smaller) = (png.clone(), picture.clone());
        while small.len() > room {
            smaller = smaller.halved();
            small = smaller.to_png()?;
        }
        Ok([png, small])
    }

    fn taken(camera: &Camera) -> Result<Vec<Snapshot>, Failure> {
        let view = View { theme: Theme::Light, ..View::default() };
        if camera.timeline.keyframes().is_empty() {
            return Err(RenderError::Empty(camera.timeline.name.clone()).into());
        }
        let mut renderer = Renderer::open(&camera.adapter.as_str().into())?;
        Ok(snapshots_of_run(&mut renderer, &camera.timeline, &view)?)
    }
}
