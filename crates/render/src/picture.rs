//! Pictures in memory: PNG encoding, halving, and contact sheets.

use std::ops::Range;

use super::error::RenderError;

/// Picture in sRGB: rows from the top, pixels from the left, with red, green, blue and opacity.
#[derive(Clone, PartialEq, Eq)]
pub struct Picture {
    /// Width and height \[pixels\].
    pub size_px: [u32; 2],
    /// Pixels, 4 bytes each.
    pub rgba: Vec<u8>,
}

impl std::fmt::Debug for Picture {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Picture of {} x {} pixels", self.size_px[0], self.size_px[1])
    }
}

impl Picture {
    /// Returns the colour of a pixel; `None` outside the picture.
    #[must_use]
    pub fn pixel(&self, x: u32, y: u32) -> Option<[u8; 4]> {
        let [width, height] = self.size_px;
        if x >= width || y >= height {
            return None;
        }
        let offset = (y as usize * width as usize + x as usize) * 4;
        self.rgba.get(offset..offset + 4)?.try_into().ok()
    }

    /// Encodes the picture as PNG without opacity; all pictures are opaque.
    ///
    /// # Errors
    /// [`RenderError::Picture`] if the number of bytes does not match the size.
    pub fn to_png(&self) -> Result<Vec<u8>, RenderError> {
        let mut bytes = Vec::new();
        let write = |bytes| {
            let mut writer = png_encoder(bytes, self.size_px).write_header()?;
            writer.write_image_data(&self.rgb())?;
            writer.finish()
        };
        write(&mut bytes).map_err(|error: png::EncodingError| RenderError::Picture(error.to_string()))?;
        Ok(bytes)
    }

    /// Returns the picture at half its size: every pixel is the mean of four.
    #[must_use]
    pub fn halved(&self) -> Self {
        let size_px = self.size_px.map(|size| size / 2);
        let mean = |x: u32, y: u32| {
            let four = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(right, down)| self.pixel(2 * x + right, 2 * y + down));
            [0, 1, 2, 3].map(|part| {
                let sum: u16 = four.iter().flatten().map(|pixel| u16::from(pixel[part])).sum();
                u8::try_from((sum + 2) / 4).unwrap_or(u8::MAX)
            })
        };
        let rgba = (0..size_px[1]).flat_map(|y| (0..size_px[0]).flat_map(|x| mean(x, y)).collect::<Vec<_>>()).collect();
        Self { size_px, rgba }
    }

    /// Returns 3 bytes per pixel, without opacity.
    pub(super) fn rgb(&self) -> Vec<u8> {
        self.rgba.chunks_exact(4).flat_map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect()
    }
}

/// Returns a PNG encoder for pictures of this size.
pub(super) fn png_encoder<W: std::io::Write>(out: W, [width, height]: [u32; 2]) -> png::Encoder<'static, W> {
    let mut encoder = png::Encoder::new(out, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::Balanced);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    encoder
}

/// Encodes a PNG as a data URI, for self-contained pages.
#[must_use]
pub fn data_uri(png: &[u8]) -> String {
    use base64::Engine as _;
    format!("data:image/png;base64,{}", base64::engine::general_purpose::STANDARD.encode(png))
}

/// Arranges pictures of one size in rows of `columns`. The rest of the last row has the colour of the first pixel.
///
/// # Errors
/// [`RenderError::Picture`] without pictures, without columns, or if sizes differ.
pub fn contact_sheet(pictures: &[Picture], columns: u32) -> Result<Picture, RenderError> {
    let Some(first) = pictures.first() else {
        return Err(RenderError::Picture("a contact sheet needs at least one picture".to_owned()));
    };
    let [width, height] = first.size_px;
    if columns == 0 || pictures.iter().any(|picture| picture.size_px != first.size_px) {
        return Err(RenderError::Picture(
            "a contact sheet needs at least one column, and pictures of one size".to_owned(),
        ));
    }
    let rows = u32::try_from(pictures.len().div_ceil(columns as usize)).unwrap_or(u32::MAX);
    let size_px = [width.saturating_mul(columns), height.saturating_mul(rows)];
    let row_bytes = size_px[0] as usize * 4;
    let filling = first.pixel(0, 0).unwrap_or([255; 4]);
    let mut rgba = filling.repeat(size_px[0] as usize * size_px[1] as usize);
    for (k, picture) in pictures.iter().enumerate() {
        let (left, top) = (k % columns as usize * width as usize * 4, k / columns as usize * height as usize);
        for (y, row) in picture.rgba.chunks_exact(width as usize * 4).enumerate() {
            let offset = (top + y) * row_bytes + left;
            rgba[offset..offset + row.len()].copy_from_slice(row);
        }
    }
    Ok(Picture { size_px, rgba })
}

/// Returns the pixels whose centres may be between two coordinates.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the casts saturate")]
pub(super) fn pixels(from: f32, to: f32, side: u32) -> Range<usize> {
    (from.floor().max(0.0) as usize).min(side as usize)..(to.ceil().max(0.0) as usize).min(side as usize)
}

/// Returns a channel from 0 to 255, rounded.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the cast saturates")]
pub(super) fn byte(value: f32) -> u8 {
    value.round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plain(size_px: [u32; 2], colour: [u8; 4]) -> Picture {
        Picture { size_px, rgba: colour.repeat(size_px[0] as usize * size_px[1] as usize) }
    }

    #[test]
    fn a_picture_survives_png_encoding() {
        let mut picture = plain([3, 2], [10, 20, 30, 255]);
        picture.rgba[..4].copy_from_slice(&[1, 2, 3, 255]);
        let png = picture.to_png().expect("a PNG");
        let mut reader = png::Decoder::new(std::io::Cursor::new(png)).read_info().expect("a header");
        let mut rgb = vec![0; reader.output_buffer_size().expect("a size")];
        reader.next_frame(&mut rgb).expect("a frame");
        assert_eq!(rgb[..6], [1, 2, 3, 10, 20, 30]);
        assert_eq!((reader.info().width, reader.info().height), (3, 2));
    }

    #[test]
    fn a_contact_sheet_holds_every_picture_in_its_place() {
        let colours = [[1, 0, 0, 255], [2, 0, 0, 255], [3, 0, 0, 255]];
        let sheet = contact_sheet(&colours.map(|colour| plain([4, 2], colour)), 2).expect("a sheet");
        assert_eq!(sheet.size_px, [8, 4]);
        assert_eq!(
            [[0, 0], [4, 1], [3, 2], [7, 3]].map(|[x, y]| sheet.pixel(x, y).map(|pixel| pixel[0])),
            [Some(1), Some(2), Some(3), Some(1)]
        );
        assert_eq!(sheet.pixel(8, 0), None);
        assert!(contact_sheet(&[], 2).is_err());
        assert!(contact_sheet(&[plain([1, 1], [0; 4]), plain([2, 1], [0; 4])], 2).is_err());
    }
}
