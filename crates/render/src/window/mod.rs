//! The window: a flight played, scrubbed, turned around and looked into, live or from a recording.

mod app;
mod open_window;
mod panels;
mod player;
mod state;

pub use app::{is_in_window_library, show};
pub use player::LiveUpdate;
