//! Readers that are features of the crate. A build without the feature recognises files of the format and refuses them.

#[cfg(not(feature = "mcap"))]
use tautline_core::record::Channel;

#[cfg(not(feature = "mcap"))]
use super::error::ReadError;
use super::format::Format;
use super::reader::Reader;
use crate::segments::Trajectory;

/// Returns the function that opens a file, or the fault of the missing feature.
macro_rules! open_with {
    ($feature:tt, $open:expr) => {{
        #[cfg(feature = $feature)]
        {
            $open
        }
        #[cfg(not(feature = $feature))]
        {
            |_, _| Err(super::error::Fault::without_feature($feature).into())
        }
    }};
}

/// Reader of tables in Parquet.
pub(super) const PARQUET: Reader = Reader {
    format: Format::PARQUET,
    sniff: |head| head.begins_with_any(Format::PARQUET.magic),
    open: open_with!("arrow", super::parquet::open),
};

/// Reader of MCAP files.
pub(super) const MCAP: Reader = Reader {
    format: Format::MCAP,
    sniff: |head| head.begins_with_any(Format::MCAP.magic),
    open: open_with!("mcap", super::mcap::open),
};

/// Reader of compiled Skybrush trajectories.
pub(super) const SKYB: Reader = Reader {
    format: Format::SKYB,
    sniff: |head| head.begins_with_any(Format::SKYB.magic),
    open: open_with!("shows", super::compressed::open_skyb),
};

/// Reader of VVIZ shows.
pub(super) const VVIZ: Reader = Reader {
    format: Format::VVIZ,
    sniff: |head| {
        let holds = |text: &[u8]| VVIZ_KEYS.iter().any(|key| memchr::memmem::find(text, key).is_some());
        head.is_text(|text| text.starts_with(b"{") && holds(text))
    },
    open: open_with!("shows", super::vviz::open),
};

/// Reader of Skybrush shows.
pub(super) const SKYBRUSH: Reader = Reader {
    format: Format::SKYBRUSH,
    sniff: |head| head.begins_with_any(Format::NPZ.magic) || head.is_text(|text| text.starts_with(b"{")),
    open: open_with!("shows", super::skybrush::open),
};

/// Reader of compressed Crazyflie trajectories.
pub(super) const CRAZYFLIE_COMPRESSED: Reader = Reader {
    format: Format::CRAZYFLIE_COMPRESSED,
    // A file without magic bytes: its segments must end with the last byte.
    sniff: |head| match Trajectory::decode(head.bytes, true) {
        Ok((trajectory, length)) => length == head.bytes.len() && !trajectory.segments.is_empty(),
        Err(_) => false,
    },
    open: open_with!("shows", super::compressed::open_crazyflie),
};

/// Keys before the long arrays of a VVIZ show.
const VVIZ_KEYS: [&[u8]; 2] = [b"\"defaultPositionRate\"", b"\"agentTraversal\""];

/// Channels of a recording of tautline: this build reads none, because it lacks the feature `mcap`.
#[cfg(not(feature = "mcap"))]
pub enum Channels {}

#[cfg(not(feature = "mcap"))]
impl Channels {
    /// Returns the channels of the next instant, one row per vehicle.
    ///
    /// # Errors
    /// [`ReadError`] if the recording is damaged.
    pub fn next(&mut self, _vehicles: usize) -> Result<Vec<Channel>, ReadError> {
        match *self {}
    }
}
