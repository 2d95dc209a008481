use std::io;

use super::*;

fn pictures(size_px: [u32; 2], count: u8) -> Vec<Picture> {
    let plain = |k: u8| [k * 20, 100, 200, 255].repeat(size_px[0] as usize * size_px[1] as usize);
    (0..count).map(|k| Picture { size_px, rgba: plain(k) }).collect()
}

fn film(format: FilmFormat, fps: u32, pictures: &[Picture]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let count = u32::try_from(pictures.len()).expect("few");
    let mut film = Film::new(&mut bytes, format, pictures[0].size_px, fps, count).expect("a film");
    for few in pictures.chunks(2) {
        film.add(few).expect("room for pictures");
    }
    film.finish().expect("an end");
    bytes
}

#[test]
fn a_gif_holds_every_picture_and_has_the_right_duration() {
    let bytes = film(FilmFormat::Gif, 30, &pictures([20, 10], 6));
    let mut decoder = gif_decoder(&bytes);
    let mut delays = Vec::new();
    while let Some(frame) = decoder.read_next_frame().expect("a frame") {
        delays.push(frame.delay);
    }
    assert_eq!((delays.len(), delays.iter().sum::<u16>()), (6, 20));
}

#[test]
fn a_gif_holds_only_changes_and_shows_every_picture() {
    let size_px = [20, 10];
    let plain = |colour: [u8; 4]| Picture { size_px, rgba: colour.repeat(200) };
    let mut dotted = plain([9, 9, 9, 255]);
    let index = 4 * (5 * 20 + 7);
    dotted.rgba[index..index + 8].copy_from_slice(&[200, 0, 0, 255, 0, 200, 0, 255]);
    let same = dotted.clone();
    let bytes = film(FilmFormat::Gif, 10, &[plain([9, 9, 9, 255]), dotted.clone(), same]);
    let mut decoder = gif_decoder(&bytes);
    let mut rectangles = Vec::new();
    while let Some(frame) = decoder.read_next_frame().expect("a frame") {
        assert_eq!(frame.dispose, ::gif::DisposalMethod::Keep);
        rectangles.push([frame.left, frame.top, frame.width, frame.height]);
    }
    assert_eq!(rectangles, [[0, 0, 20, 10], [7, 5, 2, 1], [0, 0, 1, 1]]);
}

fn gif_decoder(bytes: &[u8]) -> ::gif::Decoder<&[u8]> {
    ::gif::DecodeOptions::new().read_info(bytes).expect("a GIF")
}

#[cfg(feature = "mp4")]
#[test]
fn an_mp4_holds_every_picture_with_its_colours() {
    let pictures = pictures([64, 32], 10);
    let bytes = film(FilmFormat::Mp4, 20, &pictures);
    assert_eq!(bytes[4..8], *b"ftyp");
    for name in [b"moov", b"avc1", b"avcC", b"mdat"] {
        assert!(bytes.windows(4).any(|window| window == name), "{name:?}");
    }
    // The stream itself is decoded again.
    let mut mp4 = mp4::Mp4::new(Vec::new(), [64, 32], 20).expect("an encoder");
    let mut decoder = openh264::decoder::Decoder::new().expect("a decoder");
    let mut decoded = 0;
    for picture in &pictures {
        let stream = mp4.encoded(&mp4::yuv(picture)).expect("a picture");
        if let Some(yuv) = decoder.decode(&stream).expect("a picture") {
            let mut rgb = vec![0; 64 * 32 * 3];
            yuv.write_rgb8(&mut rgb);
            let middle = &rgb[(16 * 64 + 32) * 3..][..3];
            for (found, wanted) in middle.iter().zip(&picture.rgba[..3]) {
                // 8 bits of brightness and colour with less than the full range lose some units.
                assert!(found.abs_diff(*wanted) <= 8, "{middle:?} of {:?}", &picture.rgba[..3]);
            }
            decoded += 1;
        }
    }
    assert_eq!(decoded, 10);
}

#[test]
fn unsupported_sizes_and_rates_are_refused() {
    assert!(matches!(FilmFormat::Mp4.check([63, 32], 20), Err(RenderError::FilmSize(_))));
    assert!(matches!(FilmFormat::Mp4.check([8000, 4000], 20), Err(RenderError::FilmSize(_))));
    assert!(matches!(FilmFormat::Gif.check([70_000, 10], 20), Err(RenderError::FilmSize(_))));
    let too_fast = FilmFormat::Gif.check([10, 10], 60).expect_err("too fast").to_string();
    assert_eq!(too_fast, "GIF films must have 1 to 50 pictures per second, got 60");
    assert!(matches!(Film::new(Vec::new(), FilmFormat::Gif, [10, 10], 0, 1), Err(RenderError::FilmRate(_))));
    assert!(Film::new(Vec::new(), FilmFormat::Gif, [10, 10], 10, 0).is_err(), "a film needs pictures");
    let mut film = Film::new(Vec::new(), FilmFormat::Gif, [10, 10], 10, 2).expect("a film");
    let mixed = film.add(&pictures([20, 10], 1)).expect_err("another size").to_string();
    assert_eq!(mixed, "all pictures of a film must have the size of the film");
    film.add(&pictures([10, 10], 1)).expect("a picture");
    assert_eq!(film.finish().expect_err("too few").to_string(), "the film must have 2 pictures, got 1");
    assert_eq!(FilmFormat::of(Path::new("a/film.MP4")).ok(), Some(FilmFormat::Mp4));
    let refused = FilmFormat::of(Path::new("film.avi"));
    assert!(matches!(&refused, Err(RenderError::UnknownFilm(name)) if name == "film.avi"), "{refused:?}");
    assert!(FilmFormat::of(Path::new("film")).is_err());
}

/// Writer that fails after `room` bytes.
struct Full<'a> {
    room: usize,
    largest_write: &'a mut usize,
}

impl Write for Full<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        *self.largest_write = bytes.len().max(*self.largest_write);
        self.room = self.room.checked_sub(bytes.len()).ok_or_else(|| io::Error::other("no room"))?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[test]
fn a_write_error_is_reported_at_any_position() {
    #[cfg(feature = "mp4")]
    let formats = [FilmFormat::Mp4, FilmFormat::Gif];
    #[cfg(not(feature = "mp4"))]
    let formats = [FilmFormat::Gif];
    for format in formats {
        let pictures = pictures([64, 32], 3);
        let whole = film(format, 20, &pictures).len();
        for room in [0, whole / 2, whole - 1] {
            let mut largest_write = 0;
            let out = Full { room, largest_write: &mut largest_write };
            let written = Film::new(out, format, [64, 32], 20, 3).and_then(|mut film| {
                film.add(&pictures)?;
                film.finish()
            });
            let is_reported = matches!(&written, Err(RenderError::Write(error)) if error.to_string() == "no room");
            assert!(is_reported, "{format:?}, {room} bytes: {written:?}");
        }
    }
}

#[test]
fn pictures_are_written_at_once() {
    let pictures = pictures([64, 32], 3);
    let whole = film(FilmFormat::Gif, 20, &pictures).len();
    let mut out = Vec::new();
    let mut film = Film::new(&mut out, FilmFormat::Gif, [64, 32], 20, 3).expect("a film");
    film.add(&pictures).expect("pictures");
    // Without `finish` only the end of the file is missing.
    std::mem::forget(film);
    assert!(out.len() + 16 > whole, "{} of {whole} bytes", out.len());
}

#[cfg(feature = "mp4")]
#[test]
fn an_mp4_has_the_right_duration() {
    for count in [1, 2, 5] {
        let bytes = film(FilmFormat::Mp4, 20, &pictures([64, 32], count));
        // The media header: version and flags, two dates, ticks per second, ticks.
        let offset = bytes.windows(4).position(|name| name == b"mdhd").expect("a header") + 4;
        let [ticks_per_second, ticks] =
            [12, 16].map(|after| u32::from_be_bytes(bytes[offset + after..][..4].try_into().expect("four bytes")));
        let lasts_s = f64::from(ticks) / f64::from(ticks_per_second);
        assert!((lasts_s - f64::from(count) / 20.0).abs() < 1e-4, "{count} pictures last {lasts_s} s");
    }
}
