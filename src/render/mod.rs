//! Pictures, films and a window of a flight.
//!
//! [`Footage`] is a recorded flight in memory, [`scene`] makes a draw list of any time of it, [`gpu`] draws that list
//! without a screen into a [`Picture`], and [`Film`] strings pictures together. Only [`gpu`] and the window know of wgpu.
//!
//! ```no_run
//! use std::path::Path;
//!
//! use tautline::render::{AdapterChoice, Footage, Renderer, View};
//!
//! let footage = Footage::read_mcap(Path::new("out/pentagon/run.mcap"))?;
//! let mut renderer = Renderer::open(&AdapterChoice::Best)?;
//! let picture = renderer.shoot(&footage, footage.range_s()[1], &View::default())?;
//! std::fs::write("end.png", picture.to_png()?)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod film;
mod footage;
mod foxglove_scene;
pub mod gpu;
mod picture;
pub mod scene;
mod snapshots;
mod window;

pub use film::{Film, FilmError, FilmFormat};
pub use footage::{BUDGET_BYTES, FARTHEST_M, Footage, FootageError, Moment, Plan, Span, TracksError};
pub use foxglove_scene::{FoxgloveScene, SCENE_HZ};
pub use gpu::{AdapterChoice, GpuError, Renderer, ShootError};
pub use picture::{Picture, PictureError, contact_sheet, data_uri};
pub use scene::{CameraError, CameraSpec, Layers, Scene, Theme, View};
pub use snapshots::{Snapshot, snapshot_names, snapshots_of_run};
pub use window::{Fed, WindowError, in_window_library, show};
