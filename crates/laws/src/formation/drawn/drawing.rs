//! Drawings and their slots.

use thiserror::Error;

use crate::formation::{Formation, Ink};

use super::outline::{self, Curves, Point, Region, regions};
use super::picture::{Mask, mask};
use super::spread::spread;

use tautline_core::swarm::{Rows, set_row};

/// Samples per slot; odd, so that the middle of each segment of a line is a sample.
const SAMPLES: usize = 33;
/// Smallest number of samples.
const LEAST_SAMPLES: usize = 4097;

/// Pixels along the longer side of an area, and their largest number for many slots.
const PIXELS: usize = 1024;
const MOST_PIXELS: usize = 8192;

/// Letters, lines or areas in the plane, without a scale.
#[derive(Clone, Debug)]
pub struct Drawing {
    drawn: DrawnShape,
    /// Number of letters; each needs a slot.
    letters: usize,
}

#[derive(Clone, Debug)]
enum DrawnShape {
    Lines(Vec<Region>),
    Areas(Vec<Region>),
    Pixels(Mask),
}

impl Drawing {
    /// Reads letters, filled, with lines of text below each other.
    ///
    /// # Errors
    /// [`DrawingError`] for a character that the font does not have, more than
    /// [`MAX_TEXT_CHARS`](super::MAX_TEXT_CHARS) characters, or blanks alone.
    pub fn text(text: &str) -> Result<Self, DrawingError> {
        let letters = outline::letters(text)?;
        Ok(Self { drawn: DrawnShape::Areas(regions(&letters, false)?), letters: letters.len() })
    }

    /// Reads SVG path data (`M 0 0 L 4 3 ...`, y downwards): its lines, or the area inside them.
    ///
    /// # Errors
    /// [`DrawingError`] for data that cannot be read, are not finite, or are empty.
    pub fn path(data: &str, filled: bool) -> Result<Self, DrawingError> {
        Self::curves(&outline::path(data)?, filled)
    }

    /// Reads an SVG file: the lines of its visible shapes, or the area inside them. Text elements and images are
    /// ignored, and referenced files are not read.
    ///
    /// # Errors
    /// [`DrawingError`] for bytes that are not an SVG file, or an empty drawing.
    pub fn svg(bytes: &[u8], filled: bool) -> Result<Self, DrawingError> {
        Self::curves(&outline::file(bytes)?, filled)
    }

    /// Reads the pixels of a PNG picture that have this ink. By default these are the opaque pixels if some pixel is
    /// not opaque, and otherwise the dark ones.
    ///
    /// # Errors
    /// [`DrawingError`] for bytes that are not a PNG file, more than [`MAX_PIXELS`](super::MAX_PIXELS), or an empty
    /// drawing.
    pub fn png(bytes: &[u8], ink: Option<Ink>) -> Result<Self, DrawingError> {
        Ok(Self { drawn: DrawnShape::Pixels(mask(bytes, ink)?), letters: 0 })
    }

    fn curves(curves: &[Curves], filled: bool) -> Result<Self, DrawingError> {
        let regions = regions(curves, true)?;
        Ok(Self { drawn: if filled { DrawnShape::Areas(regions) } else { DrawnShape::Lines(regions) }, letters: 0 })
    }

    /// Returns width and height relative to the longer side.
    #[must_use]
    pub fn size(&self) -> [f64; 2] {
        match &self.drawn {
            DrawnShape::Lines(regions) | DrawnShape::Areas(regions) => {
                let points = || regions.iter().flat_map(|region| region.lines.iter().flatten());
                [0, 1].map(|axis| points().map(|point| point[axis]).fold(0.0, f64::max))
            }
            DrawnShape::Pixels(mask) => {
                [mask.width, mask.drawn.len() / mask.width].map(|pixels| pixels as f64 * mask.side)
            }
        }
    }

    /// Returns slots on the drawing in the plane z = 0, centred at the origin, with a longer side of 1 m. Slots are
    /// spread as evenly as the drawing allows, deterministically. Slots near each other have near numbers.
    ///
    /// # Errors
    /// [`DrawingError`] for more than [`MAX_DRAWN_SLOTS`], fewer slots than letters, or lines and areas without extent.
    pub fn slots(&self, count: usize) -> Result<Formation, DrawingError> {
        if count > MAX_DRAWN_SLOTS {
            return Err(DrawingError::Slots(count));
        }
        if count < self.letters {
            return Err(DrawingError::Letters { slots: count, letters: self.letters });
        }
        let places = self.places(count)?;
        let middle = self.size().map(|side| 0.5 * side);
        let mut slots_m = Rows::zeros(count);
        for (i, place) in places.into_iter().enumerate() {
            set_row(&mut slots_m, i, [place[0] - middle[0], place[1] - middle[1], 0.0].into());
        }
        Ok(Formation::points(slots_m))
    }

    fn places(&self, count: usize) -> Result<Vec<Point>, DrawingError> {
        let least = (count * SAMPLES).max(LEAST_SAMPLES);
        let raster;
        let mask = match &self.drawn {
            DrawnShape::Lines(regions) => {
                let lines: Vec<&[Point]> = regions.iter().flat_map(|region| &region.lines).map(Vec::as_slice).collect();
                let odd = least.div_ceil(count.max(1)) | 1;
                let (samples, step) = outline::points_along(&lines, odd * count);
                return if samples.is_empty() {
                    Err(DrawingError::Empty)
                } else {
                    Ok(spread(&samples, count, step, 0.0))
                };
            }
            DrawnShape::Areas(regions) => {
                raster = fine_enough(regions, least);
                &raster
            }
            DrawnShape::Pixels(mask) => mask,
        };
        if mask.count() == 0 {
            return Err(DrawingError::Empty);
        }
        let (samples, side) = outline::points_inside(mask, least);
        Ok(spread(&samples, count, side, mask.side))
    }
}

/// Returns a raster of the regions with at least about `least` filled pixels, and at most [`MOST_PIXELS`] a side.
fn fine_enough(regions: &[Region], least: usize) -> Mask {
    let coarse = Mask::of(regions, PIXELS);
    let finer = (least as f64 / coarse.count().max(1) as f64).sqrt();
    if finer <= 1.0 {
        return coarse;
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at least 1, and clamped")]
    let pixels = ((PIXELS as f64 * finer).ceil().min(MOST_PIXELS as f64)) as usize;
    Mask::of(regions, pixels)
}

/// Largest number of slots of a drawing.
pub const MAX_DRAWN_SLOTS: usize = 100_000;

/// Largest number of pixels of a picture: 4096 x 4096, in any proportion.
pub const MAX_PIXELS: u64 = 1 << 24;

/// Longest text \[characters\].
pub const MAX_TEXT_CHARS: usize = 1000;

/// Reason why a drawing has no slots.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum DrawingError {
    /// A character that the font does not have.
    #[error("the font has no glyph for {0:?}")]
    Glyph(char),
    /// A text that is too long.
    #[error("a text of {0} characters; at most {MAX_TEXT_CHARS} are drawn")]
    Length(usize),
    /// Fewer slots than there are letters.
    #[error("{slots} slots for {letters} letters")]
    Letters {
        /// Requested slots.
        slots: usize,
        /// Letters of the text without blanks.
        letters: usize,
    },
    /// Path data that cannot be read.
    #[error("invalid SVG path: {0}")]
    Path(String),
    /// An SVG file that cannot be read.
    #[error("invalid SVG file: {0}")]
    Svg(String),
    /// An SVG file whose elements are nested too deeply.
    #[error("elements of the SVG file are nested more than {0} deep")]
    Nesting(usize),
    /// A picture that cannot be read.
    #[error("invalid PNG picture: {0}")]
    Png(String),
    /// A picture that is too large.
    #[error("{width} x {height} pixels; at most {MAX_PIXELS} in all are read")]
    Pixels {
        /// Pixels of a row.
        width: u32,
        /// Rows.
        height: u32,
    },
    /// Lines that are not finite, or too long for double precision.
    #[error("drawing coordinates overflow")]
    NotFinite,
    /// No line and no area.
    #[error("nothing is drawn")]
    Empty,
    /// Too many slots.
    #[error("{0} slots; a drawing has at most {MAX_DRAWN_SLOTS}")]
    Slots(usize),
}
