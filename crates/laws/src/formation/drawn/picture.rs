//! Masks of PNG pictures and of filled regions.

use std::io::Cursor;

use png::{ColorType, Decoder, DecodingError, Limits, Transformations};

use super::drawing::{DrawingError, MAX_PIXELS};
use super::outline::{Point, Region};
use crate::formation::Ink;

/// Returns the drawn part of a PNG picture. Without an ink: opaque pixels if some pixel is not opaque, else dark ones.
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

/// Returns grey and alpha of the pixels, row by row from above, and the number of pixels per row.
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

/// Crops a raster to its drawn rows and columns, with rows from below; `None` if nothing is drawn.
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

/// Raster of square pixels: rows from below, each from the left.
#[derive(Clone, Debug)]
pub(super) struct Mask {
    pub(super) width: usize,
    /// One flag per pixel.
    pub(super) drawn: Vec<bool>,
    /// Side of a pixel, relative to the drawing's longer side.
    pub(super) side: f64,
}

impl Mask {
    /// Rasterizes an area within 1 x 1 with `pixels` pixels a side. A pixel is drawn if its centre is inside.
    pub(super) fn of(regions: &[Region], pixels: usize) -> Self {
        let mut mask = Self { width: pixels, drawn: vec![false; pixels * pixels], side: 1.0 / pixels as f64 };
        for region in regions {
            mask.fill(region);
        }
        mask
    }

    /// Number of drawn pixels.
    pub(super) fn count(&self) -> usize {
        self.drawn.iter().filter(|&&drawn| drawn).count()
    }

    /// Returns column and row of each drawn pixel.
    pub(super) fn pixels(&self) -> impl Iterator<Item = [usize; 2]> {
        let drawn = self.drawn.iter().enumerate().filter(|&(_, &drawn)| drawn);
        drawn.map(|(place, _)| [place % self.width, place / self.width])
    }

    fn fill(&mut self, region: &Region) {
        let inside = |winding: i32| if region.even_odd { winding % 2 != 0 } else { winding != 0 };
        for (row, mut crossings) in self.crossings(region).into_iter().enumerate() {
            crossings.sort_by(|a, b| a.0.total_cmp(&b.0));
            let mut winding = 0;
            for pair in crossings.windows(2) {
                winding += pair[0].1;
                if inside(winding) {
                    let [from, to] = [pair[0].0, pair[1].0].map(|x| self.first_from(x));
                    self.drawn[row * self.width + from..row * self.width + to].fill(true);
                }
            }
        }
    }

    /// Returns the crossings of each row's centre line with the region's lines, with +1 upwards and -1 downwards.
    fn crossings(&self, region: &Region) -> Vec<Vec<(f64, i32)>> {
        let mut rows: Vec<Vec<(f64, i32)>> = vec![Vec::new(); self.width];
        let mut cross = |from: Point, to: Point| {
            let ([x0, y0], [x1, y1], sense) = if from[1] < to[1] { (from, to, 1) } else { (to, from, -1) };
            let first = self.first_from(y0);
            for (row, crossings) in rows[..self.first_from(y1)].iter_mut().enumerate().skip(first) {
                let y = (row as f64 + 0.5) * self.side;
                crossings.push((x0 + (x1 - x0) * (y - y0) / (y1 - y0), sense));
            }
        };
        for line in &region.lines {
            line.windows(2).for_each(|ends| cross(ends[0], ends[1]));
            if let (Some(&first), Some(&last)) = (line.first(), line.last()) {
                cross(last, first);
            }
        }
        rows
    }

    /// Returns the index of the first pixel, along one axis, whose centre is at or beyond `coordinate`.
    fn first_from(&self, coordinate: f64) -> usize {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the raster")]
        let first = (coordinate / self.side - 0.5).ceil().clamp(0.0, self.width as f64) as usize;
        first
    }
}
