//! Common interface of film encoders.

use crate::error::RenderError;
use crate::picture::Picture;

/// Returns the error of a failed encoder.
pub(super) fn failed(format: &str, error: impl std::fmt::Display) -> RenderError {
    RenderError::Film(format!("the {format} encoder failed: {error}"))
}

/// Encodes pictures of one size as a film.
pub(super) trait FilmEncoder: Send {
    /// Adds pictures in order. Work on single pictures runs in parallel.
    fn add(&mut self, pictures: &[Picture]) -> Result<(), RenderError>;

    /// Writes the end of the film.
    fn finish(self: Box<Self>) -> Result<(), RenderError>;
}
