//! How what is judged is opened, whoever holds it.

use tautline_core::track::Tracks;
use tautline_recordings::read::ReadError;

/// Opens what is judged, each time from its beginning.
pub(super) type Open<'a> = dyn Fn() -> Result<Box<dyn Tracks<Error = ReadError> + 'a>, ReadError> + 'a;
