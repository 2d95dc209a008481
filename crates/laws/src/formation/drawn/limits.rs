//! How much is drawn.

/// Most slots of a drawing.
pub const MAX_DRAWN_SLOTS: usize = 100_000;

/// Most pixels of a picture in all, whatever its sides: 4096 x 4096.
pub const MAX_PIXELS: u64 = 1 << 24;

/// Longest text \[characters\].
pub const MAX_TEXT_CHARS: usize = 1000;
