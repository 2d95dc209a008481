//! What every format of films does.

use crate::error::RenderError;
use crate::picture::Picture;

/// That the encoder of a format failed.
pub(super) fn failed(format: &str, error: impl std::fmt::Display) -> RenderError {
    RenderError::Film(format!("the {format} encoder failed: {error}"))
}

/// Writes pictures of one size as a film.
pub(super) trait FilmEncoder: Send {
    /// Adds pictures in order. What can be done to each by itself is done side by side.
    fn add(&mut self, pictures: &[Picture]) -> Result<(), RenderError>;

    /// Writes the end of the film.
    fn finish(self: Box<Self>) -> Result<(), RenderError>;
}
