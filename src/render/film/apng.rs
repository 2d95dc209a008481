//! Animated PNG: pictures that were encoded each by itself, put into one file (PNG, third edition, 11.3.6).

use std::io::Write;

use super::FilmError;

pub(super) const NAME: &str = "PNG";
const SIGNATURE: [u8; 8] = *b"\x89PNG\r\n\x1a\n";
/// How the area of a picture is left, and how it is put on the last one: neither cleared nor blended.
const NEITHER: [u8; 2] = [0, 0];

/// Name and data of a part of a PNG file.
type Chunk<'a> = ([u8; 4], &'a [u8]);

pub(super) struct Apng<W> {
    out: W,
    size_px: [u32; 2],
    fps: u32,
    /// Pictures that the film will have.
    pictures: u32,
    count: u32,
    /// Number of the next chunk of the animation.
    sequence: u32,
}

impl<W: Write> Apng<W> {
    pub(super) fn new(out: W, size_px: [u32; 2], fps: u32, pictures: u32) -> Self {
        Self { out, size_px, fps, pictures, count: 0, sequence: 0 }
    }

    /// Adds a picture given as PNG.
    pub(super) fn add(&mut self, png: &[u8]) -> Result<(), FilmError> {
        let chunks = chunks(png)?;
        let pixels = |(name, _): &&Chunk<'_>| name == b"IDAT";
        if self.count == 0 {
            self.out.write_all(&SIGNATURE)?;
            for (name, data) in chunks.iter().filter(|(name, _)| !matches!(name, b"IDAT" | b"IEND")) {
                chunk(&mut self.out, *name, &[data])?;
            }
            // Number of pictures, and 0: the film is shown again and again.
            chunk(&mut self.out, *b"acTL", &[&self.pictures.to_be_bytes(), &[0; 4]])?;
        }
        let [width, height] = self.size_px.map(u32::to_be_bytes);
        let delay = [1_u16, u16::try_from(self.fps).unwrap_or(u16::MAX)].map(u16::to_be_bytes).concat();
        let number = self.next();
        chunk(&mut self.out, *b"fcTL", &[&number, &width, &height, &[0; 8], &delay, &NEITHER])?;
        for (_, data) in chunks.iter().filter(pixels) {
            if self.count == 0 {
                chunk(&mut self.out, *b"IDAT", &[data])?;
            } else {
                let number = self.next();
                chunk(&mut self.out, *b"fdAT", &[&number, data])?;
            }
        }
        self.count += 1;
        Ok(())
    }

    fn next(&mut self) -> [u8; 4] {
        self.sequence += 1;
        (self.sequence - 1).to_be_bytes()
    }

    pub(super) fn finish(mut self) -> Result<(), FilmError> {
        chunk(&mut self.out, *b"IEND", &[])
    }
}

/// The chunks of a PNG file in order.
fn chunks(png: &[u8]) -> Result<Vec<Chunk<'_>>, FilmError> {
    let damaged = || FilmError::Encoder { format: NAME, reason: "a picture is not PNG".to_owned() };
    let mut rest = png.strip_prefix(&SIGNATURE).ok_or_else(damaged)?;
    let mut chunks = Vec::new();
    while !rest.is_empty() {
        let (length, tail) = rest.split_first_chunk::<4>().ok_or_else(damaged)?;
        let (name, tail) = tail.split_first_chunk::<4>().ok_or_else(damaged)?;
        let length = u32::from_be_bytes(*length) as usize;
        let (data, tail) = tail.split_at_checked(length).ok_or_else(damaged)?;
        chunks.push((*name, data));
        rest = tail.get(4..).ok_or_else(damaged)?;
    }
    Ok(chunks)
}

/// Writes a chunk whose data are these parts.
fn chunk(out: &mut impl Write, name: [u8; 4], parts: &[&[u8]]) -> Result<(), FilmError> {
    let mut check = crc32fast::Hasher::new();
    let length: usize = parts.iter().map(|part| part.len()).sum();
    // No picture has a chunk of more than 2^31 bytes.
    out.write_all(&u32::try_from(length).unwrap_or(u32::MAX).to_be_bytes())?;
    for part in [&name[..]].iter().chain(parts) {
        check.update(part);
        out.write_all(part)?;
    }
    Ok(out.write_all(&check.finalize().to_be_bytes())?)
}
