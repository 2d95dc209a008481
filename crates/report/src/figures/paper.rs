//! Figures as files for papers: SVG, PDF and PNG of the width of a column.

use std::collections::BTreeMap;
use std::io::Write as _;
use std::sync::{Arc, LazyLock};

use flate2::Compression;
use flate2::write::ZlibEncoder;
use pdf_writer::types::LineCapStyle;
use pdf_writer::{Content, Filter, Finish as _, Name, Pdf, Rect, Ref};
use resvg::tiny_skia::{PathSegment, Pixmap, Transform};
use resvg::usvg::fontdb::Database;
use resvg::usvg::{Group, LineCap, Node, Options, Paint, Path, Tree};

use super::Figure;
use super::chart::WIDTH;

/// Width of a column \[mm\]. Texts of a figure are then 7 pt high.
const COLUMN_MM: f64 = 85.0;
const MM_PER_INCH: f64 = 25.4;
const POINTS_PER_INCH: f64 = 72.0;
/// Resolution of a PNG file \[pixels per inch\].
const DPI: f64 = 600.0;

/// Format of the file of a figure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// SVG, with texts in a font of the reader.
    Svg,
    /// PDF of 85 mm, with texts as outlines.
    Pdf,
    /// PNG of 85 mm at 600 pixels per inch, with texts as outlines.
    Png,
}

impl Format {
    /// All formats.
    pub const ALL: [Self; 3] = [Self::Svg, Self::Pdf, Self::Png];

    /// Returns the name, which is also the extension of a file.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Svg => "svg",
            Self::Pdf => "pdf",
            Self::Png => "png",
        }
    }
}

impl Figure {
    /// Returns the content of the figure's file. Equal figures give equal bytes.
    #[must_use]
    pub fn file(&self, format: Format) -> Vec<u8> {
        match format {
            Format::Svg => self.svg.clone().into_bytes(),
            Format::Pdf => pdf(&tree(&self.svg)),
            Format::Png => png(&tree(&self.svg)),
        }
    }
}

/// Fonts of this project: no font of the system is used.
static FONTS: LazyLock<Arc<Database>> = LazyLock::new(|| {
    let mut fonts = Database::new();
    for font in [epaint_default_fonts::UBUNTU_LIGHT, epaint_default_fonts::HACK_REGULAR] {
        fonts.load_font_data(font.to_vec());
    }
    let family = fonts.faces().next().and_then(|face| face.families.first()).map(|family| family.0.clone());
    fonts.set_sans_serif_family(family.unwrap_or_default());
    Arc::new(fonts)
});

/// Returns the shapes of a figure, with texts as outlines.
fn tree(svg: &str) -> Tree {
    let options = Options { fontdb: Arc::clone(&FONTS), ..Options::default() };
    Tree::from_str(svg, &options).expect("figures are valid SVG")
}

fn png(tree: &Tree) -> Vec<u8> {
    let scale = COLUMN_MM / MM_PER_INCH * DPI / WIDTH;
    let [width, height] = [tree.size().width(), tree.size().height()].map(|length| pixels(f64::from(length) * scale));
    let mut picture = Pixmap::new(width, height).expect("figures have a size");
    #[expect(clippy::cast_possible_truncation, reason = "drawn in single precision")]
    let scale = scale as f32;
    resvg::render(tree, Transform::from_scale(scale, scale), &mut picture.as_mut());
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Rgb);
    let per_metre = pixels(DPI / MM_PER_INCH * 1000.0);
    let size = png::PixelDimensions { xppu: per_metre, yppu: per_metre, unit: png::Unit::Meter };
    encoder.set_pixel_dims(Some(size));
    // The paper of a figure is opaque.
    let colours: Vec<u8> =
        picture.pixels().iter().flat_map(|pixel| [pixel.red(), pixel.green(), pixel.blue()]).collect();
    let mut writer = encoder.write_header().expect("memory can be written");
    writer.write_image_data(&colours).expect("the image has the announced size");
    writer.finish().expect("memory can be written");
    bytes
}

fn pixels(length: f64) -> u32 {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few thousand")]
    let pixels = length.round().max(1.0) as u32;
    pixels
}

/// Content of a PDF page, and its opacities \[per cent\] with their names.
struct PdfPage {
    content: Content,
    opacities: BTreeMap<u8, String>,
}

fn pdf(tree: &Tree) -> Vec<u8> {
    #[expect(clippy::cast_possible_truncation, reason = "drawn in single precision")]
    let scale = (COLUMN_MM / MM_PER_INCH * POINTS_PER_INCH / WIDTH) as f32;
    let (width, height) = (tree.size().width() * scale, tree.size().height() * scale);
    let mut page = PdfPage { content: Content::new(), opacities: BTreeMap::new() };
    // The vertical axis of a PDF page points upwards.
    page.content.transform([scale, 0.0, 0.0, -scale, 0.0, height]);
    page.group(tree.root(), 1.0);
    let PdfPage { content, opacities } = page;
    let mut packed = ZlibEncoder::new(Vec::new(), Compression::default());
    packed.write_all(&content.finish()).expect("memory can be written");
    let packed = packed.finish().expect("memory can be written");

    let [catalog, pages, only, stream] = [1, 2, 3, 4].map(Ref::new);
    let mut pdf = Pdf::new();
    pdf.catalog(catalog).pages(pages);
    pdf.pages(pages).kids([only]).count(1);
    let mut page = pdf.page(only);
    page.media_box(Rect::new(0.0, 0.0, width, height)).parent(pages).contents(stream);
    let mut resources = page.resources();
    let mut states = resources.ext_g_states();
    for (k, name) in (5..).zip(opacities.values()) {
        states.pair(Name(name.as_bytes()), Ref::new(k));
    }
    states.finish();
    resources.finish();
    page.finish();
    pdf.stream(stream, &packed).filter(Filter::FlateDecode);
    for (k, per_cent) in (5..).zip(opacities.keys()) {
        let opacity = f32::from(*per_cent) / 100.0;
        pdf.ext_graphics(Ref::new(k)).non_stroking_alpha(opacity).stroking_alpha(opacity);
    }
    pdf.finish()
}

impl PdfPage {
    fn group(&mut self, group: &Group, opacity: f32) {
        let opacity = opacity * group.opacity().get();
        self.content.save_state();
        if let Some(clip) = group.clip_path() {
            for node in clip.root().children() {
                if let Node::Path(path) = node {
                    self.outline(path);
                    self.content.clip_nonzero().end_path();
                }
            }
        }
        for node in group.children() {
            match node {
                Node::Group(group) => self.group(group, opacity),
                Node::Path(path) => self.path(path, opacity),
                Node::Text(text) => self.group(text.flattened(), opacity),
                Node::Image(_) => {}
            }
        }
        self.content.restore_state();
    }

    /// Appends the segments of a path in the coordinates of the figure.
    fn outline(&mut self, path: &Path) {
        let Some(path) = path.data().clone().transform(path.abs_transform()) else { return };
        let mut last = resvg::tiny_skia::Point::zero();
        for segment in path.segments() {
            match segment {
                PathSegment::MoveTo(to) => self.content.move_to(to.x, to.y),
                PathSegment::LineTo(to) => self.content.line_to(to.x, to.y),
                PathSegment::QuadTo(by, to) => {
                    let [(ax, ay), (bx, by)] =
                        [last, to].map(|end| (end.x + 2.0 / 3.0 * (by.x - end.x), end.y + 2.0 / 3.0 * (by.y - end.y)));
                    self.content.cubic_to(ax, ay, bx, by, to.x, to.y)
                }
                PathSegment::CubicTo(a, b, to) => self.content.cubic_to(a.x, a.y, b.x, b.y, to.x, to.y),
                PathSegment::Close => self.content.close_path(),
            };
            if let PathSegment::MoveTo(to)
            | PathSegment::LineTo(to)
            | PathSegment::QuadTo(_, to)
            | PathSegment::CubicTo(_, _, to) = segment
            {
                last = to;
            }
        }
    }

    fn path(&mut self, path: &Path, opacity: f32) {
        let of = |paint: &Paint| match paint {
            Paint::Color(colour) => Some([colour.red, colour.green, colour.blue].map(|part| f32::from(part) / 255.0)),
            _ => None,
        };
        if let Some((fill, [r, g, b])) = path.fill().and_then(|fill| Some((fill, of(fill.paint())?))) {
            self.opacity(opacity * fill.opacity().get());
            self.content.set_fill_rgb(r, g, b);
            self.outline(path);
            self.content.fill_nonzero();
        }
        if let Some((stroke, [r, g, b])) = path.stroke().and_then(|stroke| Some((stroke, of(stroke.paint())?))) {
            self.opacity(opacity * stroke.opacity().get());
            self.content.set_stroke_rgb(r, g, b).set_line_width(stroke.width().get());
            let dashes = stroke.dasharray().unwrap_or_default();
            self.content.set_dash_pattern(dashes.iter().copied(), 0.0);
            let cap = if stroke.linecap() == LineCap::Round { LineCapStyle::RoundCap } else { LineCapStyle::ButtCap };
            self.content.set_line_cap(cap);
            self.outline(path);
            self.content.stroke();
        }
    }

    fn opacity(&mut self, opacity: f32) {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 0 to 100")]
        let per_cent = (100.0 * opacity).round().clamp(0.0, 100.0) as u8;
        let name = self.opacities.entry(per_cent).or_insert_with(|| format!("o{per_cent}"));
        self.content.set_parameters(Name(name.as_bytes()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figures::{OfLaw, by_law};

    fn figure(law: &str) -> Figure {
        let row = OfLaw { law: law.to_owned(), value: Some(0.5), interval: [Some(0.2), None] };
        by_law("reached", "Reached", "m/s², 10⁻³, δ", &[row], Some([0.0, 1.0]), None)
    }

    #[test]
    fn files_have_the_width_of_a_column() {
        let png = figure("law").file(Format::Png);
        let [width, height] = [16, 20].map(|at| u32::from_be_bytes(png[at..at + 4].try_into().expect("four bytes")));
        assert_eq!(f64::from(width), (COLUMN_MM / MM_PER_INCH * DPI).round());
        assert!(height > 100 && png.starts_with(b"\x89PNG"));
        let pdf = figure("law").file(Format::Pdf);
        let text = String::from_utf8_lossy(&pdf);
        assert!(text.starts_with("%PDF") && text.contains("/MediaBox [0 0 240.9"), "{text:.600}");
    }

    #[test]
    fn every_letter_of_a_figure_has_an_outline() {
        let ink = |text: &str| {
            let tree = tree(&format!(
                "<svg xmlns='http://www.w3.org/2000/svg' width='99' height='20' \
                                      font-family='sans-serif'><text y='15'>{text}</text></svg>"
            ));
            let Some(Node::Text(text)) = tree.root().children().first() else { return 0 };
            format!("{:?}", text.flattened()).matches("Path").count()
        };
        for letter in "aδα²⁰⁴⁻−°–[]|'".chars() {
            assert!(ink(&letter.to_string()) > 0, "{letter}");
        }
        assert_ne!(figure("one").file(Format::Pdf), figure("two").file(Format::Pdf));
        assert_eq!(figure("one").file(Format::Pdf), figure("one").file(Format::Pdf));
    }
}
