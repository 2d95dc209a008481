//! Errors of writing and reading recordings.

/// Error of writing a sample or reading a recording.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// The file could not be written.
    #[error("cannot write {path}: {source}")]
    Write {
        /// The file.
        path: String,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The operating system could not read the file.
    #[error("cannot read {path}: {source}")]
    Open {
        /// The file.
        path: String,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The content of the file is damaged or is not a recording.
    #[error("{path} is not a recording that can be read: {fault}")]
    Read {
        /// The file.
        path: String,
        /// Problem of the content.
        fault: ReadFault,
    },
}

/// Problem of the content of a recording.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ReadFault {
    /// The file has no bytes.
    #[error("the file is empty")]
    Empty,
    /// The file does not begin with the magic bytes of MCAP.
    #[error("it is not an MCAP file")]
    NotMcap,
    /// A channel that every recording has is missing.
    #[error("it has no {topic} channel with a message definition of this program")]
    NoChannel {
        /// The channel's topic.
        topic: &'static str,
    },
    /// A channel has the expected topic but another message definition or encoding.
    #[error("its {topic} channel holds {found} instead of {expected} in cdr encoding")]
    ForeignChannel {
        /// The channel's topic.
        topic: &'static str,
        /// Schema and encoding that were found.
        found: String,
        /// Schema that was expected.
        expected: &'static str,
    },
    /// A record is longer than the limit.
    #[error("the record at byte {offset} claims {bytes} bytes, more than the limit of {limit}")]
    TooLong {
        /// Position in the file \[bytes\].
        offset: u64,
        /// Length in the record's header \[bytes\].
        bytes: u64,
        /// The limit \[bytes\].
        limit: u64,
    },
    /// A record contradicts its checksum or the format.
    #[error("the record at byte {offset} is damaged: {reason}")]
    Damaged {
        /// Position in the file \[bytes\].
        offset: u64,
        /// Problem of the record.
        reason: String,
    },
    /// A message does not match the definition of its channel.
    #[error("a {topic} message is wrong: {reason}")]
    Message {
        /// The channel's topic.
        topic: String,
        /// Problem of the message.
        reason: String,
    },
}
