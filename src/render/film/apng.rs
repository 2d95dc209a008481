//! Animated PNG: pictures that were encoded each by itself, put into one file (PNG, third edition, 11.3.6).

use super::FilmError;

pub(super) const NAME: &str = "PNG";
const SIGNATURE: [u8; 8] = *b"\x89PNG\r\n\x1a\n";
/// How the area of a picture is left, and how it is put on the last one: neither cleared nor blended.
const NEITHER: [u8; 2] = [0, 0];

pub(super) struct Apng {
    size_px: [u32; 2],
    fps: u32,
    /// Everything before the pictures, but for their number.
    header: Vec<u8>,
    pictures: Vec<u8>,
    count: u32,
    /// Number of the next chunk of the animation.
    sequence: u32,
}

impl Apng {
    pub(super) fn new(size_px: [u32; 2], fps: u32) -> Self {
        Self { size_px, fps, header: Vec::new(), pictures: Vec::new(), count: 0, sequence: 0 }
    }

    /// Adds a picture given as PNG.
    pub(super) fn add(&mut self, png: &[u8]) -> Result<(), FilmError> {
        let damaged = || FilmError::Encoder { format: NAME, reason: "a picture is not PNG".to_owned() };
        let [width, height] = self.size_px.map(u32::to_be_bytes);
        let delay = [1_u16, u16::try_from(self.fps).unwrap_or(u16::MAX)].map(u16::to_be_bytes).concat();
        let control = [&self.next()[..], &width, &height, &[0; 8], &delay, &NEITHER].concat();
        chunk(&mut self.pictures, *b"fcTL", &control);
        let mut rest = png.strip_prefix(&SIGNATURE).ok_or_else(damaged)?;
        while !rest.is_empty() {
            let (length, tail) = rest.split_first_chunk::<4>().ok_or_else(damaged)?;
            let (name, tail) = tail.split_first_chunk::<4>().ok_or_else(damaged)?;
            let length = u32::from_be_bytes(*length) as usize;
            let (data, tail) = tail.split_at_checked(length).ok_or_else(damaged)?;
            match name {
                b"IDAT" if self.count == 0 => chunk(&mut self.pictures, *name, data),
                b"IDAT" => {
                    let numbered = [&self.next()[..], data].concat();
                    chunk(&mut self.pictures, *b"fdAT", &numbered);
                }
                b"IEND" => {}
                _ if self.count == 0 => chunk(&mut self.header, *name, data),
                _ => {}
            }
            rest = tail.get(4..).ok_or_else(damaged)?;
        }
        self.count += 1;
        Ok(())
    }

    fn next(&mut self) -> [u8; 4] {
        self.sequence += 1;
        (self.sequence - 1).to_be_bytes()
    }

    pub(super) fn finish(self) -> Result<Vec<u8>, FilmError> {
        if self.count == 0 {
            return Err(FilmError::Encoder { format: NAME, reason: "the film has no pictures".to_owned() });
        }
        let mut bytes = SIGNATURE.to_vec();
        bytes.extend_from_slice(&self.header);
        // Number of pictures, and 0: the film is shown again and again.
        chunk(&mut bytes, *b"acTL", &[self.count.to_be_bytes(), [0; 4]].concat());
        bytes.extend_from_slice(&self.pictures);
        chunk(&mut bytes, *b"IEND", &[]);
        Ok(bytes)
    }
}

fn chunk(bytes: &mut Vec<u8>, name: [u8; 4], data: &[u8]) {
    // No picture has a chunk of more than 2^31 bytes.
    bytes.extend_from_slice(&u32::try_from(data.len()).unwrap_or(u32::MAX).to_be_bytes());
    let start = bytes.len();
    bytes.extend_from_slice(&name);
    bytes.extend_from_slice(data);
    let crc = crc32fast::hash(&bytes[start..]);
    bytes.extend_from_slice(&crc.to_be_bytes());
}
