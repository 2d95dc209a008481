//! Pictures as masks.

use std::io::Cursor;

use png::{ColorType, Decoder, DecodingError, Limits, Transformations};
use serde::{Deserialize, Serialize};

use super::error::DrawingError;
use super::limits::MAX_PIXELS;
use super::mask::Mask;

/// Which pixels of a picture are drawn.
#[derive(Clone, Copy, Debug, Deserialize, Eq, PartialEq, Serialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Ink {
    /// Those darker than middle grey, on white paper.
    Dark,
    /// Those lighter than middle grey, on black paper.
    Light,
    /// Those that cover more than half of what is below them.
    Opaque,
}

/// The drawn part of a PNG picture. Without an ink: what is opaque where something is not, or else what is dark.
pub(super) fn mask(bytes: &[u8], ink: Option<Ink>) -> Result<Mask, DrawingError> {
    let (pixels, width) = grey_and_alpha(bytes)?;
    let see_through = pixels.iter().any(|&[_, alpha]| !covers(alpha));
    let ink = ink.unwrap_or(if see_through { Ink::Opaque } else { Ink::Dark });
    let is_drawn = |&[grey, alpha]: &[u8; 2]| match ink {
        Ink::Dark => u32::from(grey) * u32::from(alpha) + 255 * (255 - u32::from(alpha)) < 255 * 128,
        Ink::Light => u32::from(grey) * u32::from(alpha) >= 255 * 128,
        Ink::Opaque => covers(alpha),
    };
    let drawn: Vec<bool> = pixels.chunks(width).rev().flatten().map(is_drawn).collect();
    cropped(&drawn, width).ok_or(DrawingError::Empty)
}

fn covers(alpha: u8) -> bool {
    alpha >= 128
}

/// The pixels, row by row from above, and how many a row has.
fn grey_and_alpha(bytes: &[u8]) -> Result<(Vec<[u8; 2]>, usize), DrawingError> {
    let wrong = |error: DecodingError| DrawingError::Png(error.to_string());
    let most = usize::try_from(8 * MAX_PIXELS).unwrap_or(usize::MAX);
    let mut decoder = Decoder::new_with_limits(Cursor::new(bytes), Limits { bytes: most });
    let header = decoder.read_header_info().map_err(wrong)?;
    let (width, height) = (header.width, header.height);
    if u64::from(width) * u64::from(height) > MAX_PIXELS {
        return Err(DrawingError::Pixels { width, height });
    }
    decoder.set_transformations(Transformations::normalize_to_color8());
    let mut reader = decoder.read_info().map_err(wrong)?;
    let mut samples = vec![0; reader.output_buffer_size().ok_or(DrawingError::Pixels { width, height })?];
    let info = reader.next_frame(&mut samples).map_err(wrong)?;
    let grey = |rgb: &[u8]| {
        let weighted: u32 = rgb.iter().zip([299, 587, 114]).map(|(&part, weight)| u32::from(part) * weight).sum();
        u8::try_from(weighted / 1000).unwrap_or(u8::MAX)
    };
    let pixel = |samples: &[u8]| match (info.color_type, samples) {
        (ColorType::GrayscaleAlpha, &[level, alpha]) => [level, alpha],
        (ColorType::Rgb, rgb) => [grey(rgb), u8::MAX],
        (ColorType::Rgba, &[ref rgb @ .., alpha]) => [grey(rgb), alpha],
        (_, samples) => [samples[0], u8::MAX],
    };
    let pixels = samples[..info.buffer_size()].chunks_exact(info.color_type.samples()).map(pixel).collect();
    Ok((pixels, width as usize))
}

/// The rows from below and columns that hold something; none if none does.
fn cropped(drawn: &[bool], width: usize) -> Option<Mask> {
    let rows: Vec<&[bool]> = drawn.chunks(width).collect();
    let holds = |row: &&[bool]| row.contains(&true);
    let (low, high) = (rows.iter().position(holds)?, rows.iter().rposition(holds)?);
    let left = rows.iter().filter_map(|row| row.iter().position(|&drawn| drawn)).min()?;
    let right = rows.iter().filter_map(|row| row.iter().rposition(|&drawn| drawn)).max()?;
    let (width, height) = (right + 1 - left, high + 1 - low);
    let drawn = rows[low..=high].iter().flat_map(|row| row[left..=right].iter().copied()).collect();
    Some(Mask { width, drawn, side: 1.0 / width.max(height) as f64 })
}
