//! First bytes of a file, by which its format is recognised, and the index of a ROS 2 bag.

use std::fs::File;
use std::io::{self, Read as _};
use std::path::Path;

use super::error::{Fault, ReadError};
use super::source::Source;

/// First bytes of a file.
pub(super) struct Head<'a> {
    pub(super) bytes: &'a [u8],
    /// The bytes from the first non-blank on, if the bytes contain no NUL.
    pub(super) text: Option<&'a [u8]>,
    /// The first line that is neither empty nor a comment.
    pub(super) line: Option<&'a [u8]>,
}

impl<'a> Head<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes).trim_ascii_start();
        let text = Some(text).filter(|text| memchr::memchr(0, text).is_none());
        let lines = text.unwrap_or_default().split(|&byte| byte == b'\n').map(<[u8]>::trim_ascii);
        let line = lines.into_iter().find(|line| !line.is_empty() && !line.starts_with(b"#"));
        Self { bytes, text, line }
    }

    pub(super) fn begins_with_any(&self, magic: &[&[u8]]) -> bool {
        magic.iter().any(|magic| self.bytes.starts_with(magic))
    }
}

/// Remedies for files of other formats.
pub(super) const BAG: &str = "convert it with `rosbags-convert --src BAG --dst flight --dst-storage mcap` (from `pip \
                              install rosbags`), and give the folder `flight`";
pub(super) const TABLE: &str = "give positions over time, such as a table t,id,x,y,z, or one JSON object per line";

/// Number of bytes examined.
const HEAD_BYTES: u64 = 64 * 1024;

/// Returns the first bytes, unpacked.
pub(super) fn head_of(source: &Source) -> Result<Vec<u8>, ReadError> {
    let mut head = Vec::new();
    source.bytes()?.take(HEAD_BYTES).read_to_end(&mut head)?;
    if head.is_empty() { Err(Fault::empty().into()) } else { Ok(head) }
}

/// Name of the archive entry with a Skybrush show.
pub(super) const SHOW: &str = "show.json";

/// File name of the index of a ROS 2 bag.
pub(super) const BAG_INDEX: &str = "metadata.yaml";

/// Largest accepted index of a bag \[bytes\]: ten times the size for a thousand topics.
pub(super) const BAG_INDEX_LIMIT_BYTES: u64 = 4 * 1024 * 1024;

/// Returns the index of a ROS 2 bag, up to the first byte above the limit.
pub(super) fn bag_index(folder: &Path) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    File::open(folder.join(BAG_INDEX))?.take(BAG_INDEX_LIMIT_BYTES + 1).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Returns whether a folder is a ROS 2 bag.
pub(super) fn is_bag(folder: &Path) -> bool {
    let is_index = |bytes: Vec<u8>| {
        bytes.len() as u64 <= BAG_INDEX_LIMIT_BYTES
            && memchr::memmem::find(&bytes, b"rosbag2_bagfile_information").is_some()
    };
    folder.join(BAG_INDEX).is_file() && bag_index(folder).is_ok_and(is_index)
}
