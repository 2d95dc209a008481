//! The window: a flight played, scrubbed, turned around and looked into, live or from a recording.

mod app;
mod guard;
mod open_window;
mod panels;
mod player;
mod plot;
mod state;

pub use app::show;
pub use guard::is_in_window_library;
pub use player::LiveUpdate;
