//! Foreign text on a page, which is cut where it is long.

/// Most letters of a name.
pub const LONGEST_NAME: usize = 40;
/// Most letters of a sentence.
pub(super) const LONGEST_SENTENCE: usize = 240;

/// At most so many letters of a text.
#[must_use]
pub fn cut(text: &str, most: usize) -> String {
    match text.char_indices().nth(most) {
        None => text.to_owned(),
        Some((end, _)) => format!("{}…", &text[..end]),
    }
}
