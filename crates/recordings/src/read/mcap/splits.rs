//! The files of a recording of others, one after the other.

use super::super::error::{Fault, ReadError};
use super::super::options::ReadOptions;
use super::super::source::Source;
use crate::mcap::topic::{Part, TopicReader};

/// The parts of some files, in their order. One that is packed is unpacked while it is read.
pub(super) struct Splits {
    files: Vec<Source>,
    /// Number of the next file.
    next: usize,
    /// The current file, and what it is read from.
    open: Option<(TopicReader, Source)>,
    options: ReadOptions,
    /// Fewest messages that they have by what is said of them.
    least_messages: u64,
    /// What is to be said of files that were not closed, which the user accepts.
    pub(super) notes: Vec<String>,
}

impl Splits {
    pub(super) fn new(files: Vec<Source>, least_messages: u64, options: &ReadOptions) -> Self {
        Self { files, next: 0, open: None, options: options.clone(), least_messages, notes: Vec::new() }
    }

    /// How many files have been opened since the start.
    pub(super) fn opened_files(&self) -> usize {
        self.next
    }

    /// Starts again with the first file.
    pub(super) fn rewind(&mut self) {
        (self.next, self.open) = (0, None);
    }

    /// Takes the next part; `false` behind the last one.
    pub(super) fn visit(&mut self, take: impl FnOnce(Part<'_>) -> Result<(), ReadError>) -> Result<bool, ReadError> {
        loop {
            if let Some((topics, source)) = &mut self.open {
                let part = topics.next().map_err(|error| ReadError::from(error).of(&source.shown()))?;
                if let Some(part) = part {
                    return take(part).map(|()| true).map_err(|error| error.of(&source.shown()));
                }
            }
            let Some(file) = self.files.get(self.next).cloned() else { return Ok(false) };
            let shown = file.shown();
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

    /// Takes every part, from the first one on, and starts again. Fewer messages than there should be are an error, unless a
    /// file was not closed and the user accepts what it holds.
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
                format!("its files have {messages} messages, and metadata.yaml counts {}", self.least_messages);
            if self.notes.is_empty() {
                return Err(Fault::coded("recording/bag-index", problem, "copy the whole folder again").into());
            }
            self.note(problem);
        }
        Ok(())
    }
}
