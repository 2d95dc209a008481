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
            let _ = (folder, console);
            Ok(Vec::new())
        };
        taken
    }
}

impl Sink for Watched {
    fn sample(&mut self, sample: &Sample<'_>) -> Result<(), RecordError> {
        #[cfg(feature = "viewer")]
        if let Some(camera) = &mut self.camera {
            camera.footage.take(sample);
        }
        let _ = sample;
        Ok(())
    }

    fn event(&mut self, event: &Event) -> Result<(), RecordError> {
        #[cfg(feature = "viewer")]
        if let Some(camera) = &mut self.camera {
            camera.footage.note(event);
        }
        let _ = event;
        Ok(())
    }
}

#[cfg(feature = "viewer")]
mod viewer {
    use std::fs;
    use std::io;
    use std::path::Path;

    use rayon::iter::{IntoParallelRefIterator as _, ParallelIterator as _};

    use super::super::{Failure, console::Console, drawing};
    use super::{Picture, Watched};
    use crate::render::{Footage, Renderer, ShootError, Snapshot, Theme, View, snapshot_names, snapshots_of_run};
    use crate::report::write_atomically;
    use crate::scenario::Scenario;

    /// Footage, and what is to draw it.
    pub(super) struct Camera {
        pub(super) footage: Footage,
        adapter: String,
    }

    impl Watched {
        /// Watches a flight of this scenario, to be drawn by this adapter.
        pub(in super::super) fn of(scenario: &Scenario, adapter: &str) -> Self {
            Self { camera: Some(Camera { footage: Footage::of(scenario), adapter: adapter.to_owned() }) }
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
        let folder = folder.join("snapshots");
        let failure =
            |path: &Path, error: &io::Error| Failure::machine(format!("cannot write {}: {error}", path.display()));
        if !snapshots.is_empty() {
            fs::create_dir_all(&folder).map_err(|error| failure(&folder, &error))?;
        }
        for name in snapshot_names().iter().filter(|&name| snapshots.iter().all(|snapshot| snapshot.name != *name)) {
            let path = folder.join(format!("{name}.png"));
            match fs::remove_file(&path) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(failure(&path, &error)),
                _ => {}
            }
        }
        snapshots.par_iter().map(|snapshot| kept(&folder, snapshot)).collect()
    }

    fn taken(camera: &Camera) -> Result<Vec<Snapshot>, Failure> {
        let view = View { theme: Theme::Light, ..View::default() };
        if camera.footage.instants() == 0 {
            return Err(ShootError::Empty.into());
        }
        let mut renderer = Renderer::open(&drawing::adapter(&camera.adapter))?;
        Ok(snapshots_of_run(&mut renderer, &camera.footage, &view)?)
    }

    fn kept(folder: &Path, snapshot: &Snapshot) -> Result<Picture, Failure> {
        let png = snapshot.picture.to_png()?;
        write_atomically(&folder.join(format!("{}.png", snapshot.name)), &png)?;
        Ok(Picture { description: snapshot.description.clone(), data_uri: crate::render::data_uri(&png) })
    }
}
