//! Pictures, films and an interactive window of a flight.
//!
//! The data flow:
//!
//! 1. [`Timeline`] holds a flight with its log.
//! 2. [`scene`] turns any time of it into a draw list.
//! 3. [`gpu`] draws the list off-screen into a [`Picture`].
//! 4. [`Film`] encodes pictures.
//!
//! Only [`gpu`] and the window depend on wgpu.
//!
//! ```no_run
//! use std::path::Path;
//!
//! use tautline_render::{AdapterChoice, Renderer, Timeline, View};
//!
//! let timeline = Timeline::read_mcap(Path::new("out/pentagon/run.mcap"))?;
//! let mut renderer = Renderer::open(&AdapterChoice::Best)?;
//! let picture = renderer.shoot(&timeline, timeline.log.range_s()[1], &View::default())?;
//! std::fs::write("end.png", picture.to_png()?)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![deny(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

mod error;
mod film;
mod foxglove_scene;
pub mod gpu;
mod overlay;
mod picture;
mod run_pictures;
pub mod scene;
mod software;
mod timeline;
#[cfg(feature = "window")]
mod window;

pub use error::{FARTHEST_M, RenderError};
pub use film::{Film, FilmFormat};
pub use foxglove_scene::{FoxgloveScene, SCENE_HZ};
pub use gpu::{AdapterChoice, Renderer, adapters};
pub use nalgebra;
pub use picture::{Picture, contact_sheet, data_uri};
pub use run_pictures::RunPictures;
pub use scene::{Adjustment, CameraSpec, Colouring, Extent, Layers, Scene, Theme, View};
pub use tautline_report::drawing::Rotors;
pub use tautline_report::flight_log::{FlightLog, Frame, Keyframe};
pub use tautline_sim::plan::Plan;
pub use timeline::{Timeline, TracksError};
#[cfg(feature = "window")]
pub use window::{LiveUpdate, WINDOW_KEYS, is_in_window_library, show};
