//! Text as the outlines of its letters.

use kurbo::{Affine, BezPath};
use skrifa::instance::{LocationRef, Size};
use skrifa::outline::{DrawSettings, OutlinePen};
use skrifa::{FontRef, GlyphId, MetadataProvider as _};

use super::error::DrawingError;
use super::limits::MAX_TEXT_CHARS;
use super::outline::Curves;

/// A thin sans serif, and one that has more characters.
const FONTS: [&[u8]; 2] = [epaint_default_fonts::UBUNTU_LIGHT, epaint_default_fonts::HACK_REGULAR];

/// What is added between letters, so that slots of neighbours do not run together \[em\].
const TRACKING_EM: f32 = 0.1;

/// From line to line \[em\].
const LINE_EM: f64 = 1.3;

/// The letters of a text, left to right, a line below the other, an em high; blanks have none.
pub(super) fn letters(text: &str) -> Result<Vec<Curves>, DrawingError> {
    let length = text.chars().count();
    if length > MAX_TEXT_CHARS {
        return Err(DrawingError::Length(length));
    }
    let fonts: Vec<_> = FONTS.iter().filter_map(|data| FontRef::new(data).ok()).collect();
    let mut letters = Vec::new();
    for (line, text) in text.lines().enumerate() {
        let mut right_em = 0.0;
        for letter in text.chars() {
            let in_font = |font: &FontRef<'static>| Some((font.clone(), font.charmap().map(letter)?));
            let found = if letter.is_control() { None } else { fonts.iter().find_map(in_font) };
            let (font, glyph) = found.ok_or(DrawingError::Glyph(letter))?;
            let path = outline(&font, glyph).ok_or(DrawingError::Glyph(letter))?;
            let place = Affine::translate((f64::from(right_em), -(line as f64) * LINE_EM));
            if !path.elements().is_empty() {
                letters.push(Curves { path: place * path, even_odd: false });
            }
            let metrics = font.glyph_metrics(Size::new(1.0), LocationRef::default());
            right_em += metrics.advance_width(glyph).unwrap_or_default() + TRACKING_EM;
        }
    }
    if letters.is_empty() { Err(DrawingError::Empty) } else { Ok(letters) }
}

fn outline(font: &FontRef<'_>, glyph: GlyphId) -> Option<BezPath> {
    let mut pen = Pen(BezPath::new());
    let settings = DrawSettings::unhinted(Size::new(1.0), LocationRef::default());
    font.outline_glyphs().get(glyph)?.draw(settings, &mut pen).ok()?;
    Some(pen.0)
}

struct Pen(BezPath);

fn at(x: f32, y: f32) -> (f64, f64) {
    (x.into(), y.into())
}

impl OutlinePen for Pen {
    fn move_to(&mut self, x: f32, y: f32) {
        self.0.move_to(at(x, y));
    }

    fn line_to(&mut self, x: f32, y: f32) {
        self.0.line_to(at(x, y));
    }

    fn quad_to(&mut self, cx0: f32, cy0: f32, x: f32, y: f32) {
        self.0.quad_to(at(cx0, cy0), at(x, y));
    }

    fn curve_to(&mut self, cx0: f32, cy0: f32, cx1: f32, cy1: f32, x: f32, y: f32) {
        self.0.curve_to(at(cx0, cy0), at(cx1, cy1), at(x, y));
    }

    fn close(&mut self) {
        self.0.close_path();
    }
}
