//! Reads the parts of a recording in several files.

use super::super::error::{ContentKind, ReadError, refuse};
use super::super::options::ReadOptions;
use super::super::source::Source;
use crate::mcap::topic::{Part, TopicReader};

/// Parts of consecutive files, in order. Compressed files are unpacked one at a time.
pub(super) struct SplitFiles {
    files: Vec<Source>,
    /// Index of the next file.
    next: usize,
    /// Reader and source of the current file.
    open: Option<(TopicReader, Source)>,
    options: ReadOptions,
    /// Lower bound of the number of messages.
    least_messages: u64,
    /// Notes on unclosed files that the user accepts.
    pub(super) notes: Vec<String>,
}

impl SplitFiles {
    pub(super) fn new(files: Vec<Source>, least_messages: u64, options: &ReadOptions) -> Self {
        Self { files, next: 0, open: None, options: options.clone(), least_messages, notes: Vec::new() }
    }

    /// Returns the number of files opened since the start.
    pub(super) fn opened_files(&self) -> usize {
        self.next
    }

    /// Restarts at the first file.
    pub(super) fn rewind(&mut self) {
        (self.next, self.open) = (0, None);
    }

    /// Passes the next part to `take`; returns `false` after the last one.
    pub(super) fn visit(&mut self, take: impl FnOnce(Part<'_>) -> Result<(), ReadError>) -> Result<bool, ReadError> {
        loop {
            if let Some((topics, source)) = &mut self.open {
                let part = topics.next().map_err(|error| ReadError::from(error).of(&source.display_path()))?;
                if let Some(part) = part {
                    return take(part).map(|()| true).map_err(|error| error.of(&source.display_path()));
                }
            }
            let Some(file) = self.files.get(self.next).cloned() else { return Ok(false) };
            let shown = file.display_path();
            self.open = Some(self.opened(file).map_err(|error| error.of(&shown))?);
            self.next += 1;
        }
    }

    fn opened(&mut self, file: Source) -> Result<(TopicReader, Source), ReadError> {
        let source = file.seekable()?;
        let topics = TopicReader::open(&source.path)?;
        for note in self.options.accept_unfinished(topics.is_complete())? {
            self.note(note);
        }
        Ok((topics, source))
    }

    fn note(&mut self, note: String) {
        if !self.notes.contains(&note) {
            self.notes.push(note);
        }
    }

    /// Passes every part to `take`, from the first one on, and restarts. Missing messages are an error, unless the user
    /// accepts an unclosed file.
    pub(super) fn visit_all(
        &mut self,
        mut take: impl FnMut(Part<'_>) -> Result<(), ReadError>,
    ) -> Result<(), ReadError> {
        self.rewind();
        let mut messages = 0;
        let mut counted = |part: Part<'_>| {
            messages += u64::from(matches!(part, Part::Message(_)));
            take(part)
        };
        while self.visit(&mut counted)? {}
        self.rewind();
        if messages < self.least_messages {
            let problem =
                format!("its files have {messages} messages, but metadata.yaml counts {}", self.least_messages);
            if self.notes.is_empty() {
                return refuse(ContentKind::BagIndex, problem, "copy the whole folder again");
            }
            self.note(problem);
        }
        Ok(())
    }
}
