//! Why a recording could not be kept or read.

/// Why a sample could not be kept, or a recording not be read.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// The file could not be written.
    #[error("cannot write {path}: {source}")]
    Write {
        /// The file.
        path: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// The system could not read the file.
    #[error("cannot read {path}: {source}")]
    Open {
        /// The file.
        path: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// The file was read, and its content is not a recording or is damaged.
    #[error("{path} is not a recording that can be read: {fault}")]
    Read {
        /// The file.
        path: String,
        /// What is wrong with it.
        fault: ReadFault,
    },
}

/// What is wrong with the content of a recording.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ReadFault {
    /// The file has no bytes.
    #[error("the file is empty")]
    Empty,
    /// The file does not begin as MCAP files do.
    #[error("it is not an MCAP file")]
    NotMcap,
    /// A channel that every recording has is missing.
    #[error("it has no {topic} channel with a message definition of this program")]
    NoChannel {
        /// The channel's topic.
        topic: &'static str,
    },
    /// A channel has the expected topic and another message definition or encoding.
    #[error("its {topic} channel holds {found} instead of {expected} in cdr encoding")]
    ForeignChannel {
        /// The channel's topic.
        topic: &'static str,
        /// Schema and encoding that were found.
        found: String,
        /// Schema that was expected.
        expected: &'static str,
    },
    /// A record is longer than any recording needs.
    #[error("the record at byte {offset} claims {bytes} bytes, more than the limit of {limit}")]
    TooLong {
        /// Where in the file.
        offset: u64,
        /// The length that it claims \[bytes\].
        bytes: u64,
        /// The limit \[bytes\].
        limit: u64,
    },
    /// A record contradicts its checksum or the format.
    #[error("the record at byte {offset} is damaged: {reason}")]
    Damaged {
        /// Where in the file.
        offset: u64,
        /// What is wrong with it.
        reason: String,
    },
    /// A message does not hold what its channel promises.
    #[error("a {topic} message is wrong: {reason}")]
    Message {
        /// The channel's topic.
        topic: String,
        /// What is wrong with it.
        reason: String,
    },
}
