//! Curves of letters and SVG as polylines of a drawing whose longer side is 1, and sample points on them.

use kurbo::{Affine, BezPath, PathEl, Rect, Shape as _};
use roxmltree::Document;
use skrifa::instance::{LocationRef, Size};
use skrifa::outline::{DrawSettings, OutlinePen};
use skrifa::{FontRef, GlyphId, MetadataProvider as _};
use usvg::tiny_skia_path::PathSegment;
use usvg::{FillRule, Group, ImageHrefResolver, Node, Options, Tree};

use super::drawing::{DrawingError, MAX_TEXT_CHARS};
use super::picture::Mask;

/// Point with x to the right and y upwards, in units of the drawing's longer side.
pub(super) type Point = [f64; 2];

/// Largest distance of a polyline from its curve.
const TOLERANCE: f64 = 1e-5;

/// Inverse of the rounding step of coordinates, so that slots do not depend on the last bits of a platform's sines.
const GRID: f64 = (1_u64 << 36) as f64;

/// Range of the drawing's longer side in its own units; squares of both ends are normal numbers.
const SIDES: std::ops::RangeInclusive<f64> = 1e-100..=1e100;

/// Polylines that are filled together by one rule.
#[derive(Clone, Debug)]
pub(super) struct Region {
    /// Polylines; closed when used as areas.
    pub(super) lines: Vec<Vec<Point>>,
    /// Fill rule: even-odd if true, else nonzero winding number.
    pub(super) even_odd: bool,
}

/// Path as read, with its fill rule.
#[derive(Clone, Debug)]
pub(super) struct Curves {
    pub(super) path: BezPath,
    pub(super) even_odd: bool,
}

/// Converts curves to polylines that fit within 1 x 1 from the origin. Flips y if it points downwards.
pub(super) fn regions(curves: &[Curves], y_is_down: bool) -> Result<Vec<Region>, DrawingError> {
    let boxes =
        curves.iter().filter(|curves| curves.path.segments().next().is_some()).map(|curves| curves.path.bounding_box());
    let whole = boxes.reduce(|a: Rect, b| a.union(b)).ok_or(DrawingError::Empty)?;
    let side = whole.width().max(whole.height());
    if !(whole.is_finite() && side.is_finite()) || side > *SIDES.end() {
        return Err(DrawingError::NotFinite);
    }
    if side < *SIDES.start() {
        return Err(DrawingError::Empty);
    }
    let (scale, top) = if y_is_down { (-1.0 / side, whole.y1) } else { (1.0 / side, whole.y0) };
    let fit = Affine::scale_non_uniform(1.0 / side, scale) * Affine::translate((-whole.x0, -top));
    Ok(curves
        .iter()
        .map(|Curves { path, even_odd }| Region { lines: polylines(&(fit * path)), even_odd: *even_odd })
        .collect())
}

fn polylines(path: &BezPath) -> Vec<Vec<Point>> {
    let rounded = |point: kurbo::Point| [point.x, point.y].map(|x| (x * GRID).round() / GRID);
    let mut lines: Vec<Vec<Point>> = Vec::new();
    kurbo::flatten(path, TOLERANCE, |element| match element {
        PathEl::MoveTo(point) => lines.push(vec![rounded(point)]),
        PathEl::ClosePath => {
            if let Some(line) = lines.last_mut()
                && let Some(&first) = line.first()
            {
                line.push(first);
            }
        }
        other => {
            if let (Some(line), Some(point)) = (lines.last_mut(), other.end_point()) {
                line.push(rounded(point));
            }
        }
    });
    lines.retain(|line| line.len() > 1);
    lines
}

/// Largest nesting depth of elements, which limits the recursion.
const MAX_NESTING: usize = 200;

/// Reads path data, as in the attribute `d` of SVG.
pub(super) fn path(data: &str) -> Result<Vec<Curves>, DrawingError> {
    let path = BezPath::from_svg(data).map_err(|error| DrawingError::Path(error.to_string()))?;
    Ok(vec![Curves { path, even_odd: false }])
}

/// Reads the visible shapes of a file. Text elements and images are ignored.
pub(super) fn file(bytes: &[u8]) -> Result<Vec<Curves>, DrawingError> {
    let text = std::str::from_utf8(bytes).map_err(|error| DrawingError::Svg(error.to_string()))?;
    let options = roxmltree::ParsingOptions { allow_dtd: true, ..roxmltree::ParsingOptions::default() };
    let document = Document::parse_with_options(text, options).map_err(|error| DrawingError::Svg(error.to_string()))?;
    check_nesting(&document)?;
    // Referenced files are not read.
    let resolver = ImageHrefResolver { resolve_data: Box::new(|_, _, _| None), resolve_string: Box::new(|_, _| None) };
    let options = Options { image_href_resolver: resolver, ..Options::default() };
    let tree = Tree::from_xmltree(&document, &options).map_err(|error| DrawingError::Svg(error.to_string()))?;
    let mut found = Vec::new();
    collect(tree.root(), &mut found);
    Ok(found)
}

fn check_nesting(document: &Document<'_>) -> Result<(), DrawingError> {
    let mut depths: Vec<usize> = Vec::new();
    for node in document.descendants() {
        let depth = node.parent().and_then(|parent| depths.get(parent.id().get_usize())).map_or(0, |depth| depth + 1);
        if depth > MAX_NESTING {
            return Err(DrawingError::Nesting(MAX_NESTING));
        }
        depths.push(depth);
    }
    Ok(())
}

fn collect(group: &Group, found: &mut Vec<Curves>) {
    for node in group.children() {
        match node {
            Node::Group(group) => collect(group, found),
            Node::Path(path) if path.is_visible() => {
                let to_page = path.abs_transform();
                let numbers = [to_page.sx, to_page.ky, to_page.kx, to_page.sy, to_page.tx, to_page.ty];
                found.push(Curves {
                    path: Affine::new(numbers.map(f64::from)) * curve(path.data()),
                    even_odd: path.fill().is_some_and(|fill| fill.rule() == FillRule::EvenOdd),
                });
            }
            Node::Path(_) | Node::Image(_) | Node::Text(_) => {}
        }
    }
}

fn curve(path: &usvg::tiny_skia_path::Path) -> BezPath {
    let coordinates = |point: usvg::tiny_skia_path::Point| (f64::from(point.x), f64::from(point.y));
    let mut curve = BezPath::new();
    for segment in path.segments() {
        match segment {
            PathSegment::MoveTo(to) => curve.move_to(coordinates(to)),
            PathSegment::LineTo(to) => curve.line_to(coordinates(to)),
            PathSegment::QuadTo(control, to) => curve.quad_to(coordinates(control), coordinates(to)),
            PathSegment::CubicTo(first, second, to) => {
                curve.curve_to(coordinates(first), coordinates(second), coordinates(to));
            }
            PathSegment::Close => curve.close_path(),
        }
    }
    curve
}

/// Fonts: a thin sans serif, and one with more characters.
const FONTS: [&[u8]; 2] = [epaint_default_fonts::UBUNTU_LIGHT, epaint_default_fonts::HACK_REGULAR];

/// Extra space between letters that separates the slots of neighbours \[em\].
const TRACKING_EM: f32 = 0.1;

/// Distance of lines \[em\].
const LINE_EM: f64 = 1.3;

/// Returns the outlines of the letters of a text, one em high; blanks have none.
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

/// Order of the Hilbert curve through a raster: 2^16 pixels a side.
const ORDER: u8 = 16;

/// Returns points at equal steps along polylines, from half a step after the start, and the step; none without length.
pub(super) fn points_along(lines: &[&[Point]], points: usize) -> (Vec<Point>, f64) {
    let pieces =
        || lines.iter().flat_map(|line| line.windows(2).map(|ends| (ends[0], ends[1], length(ends[0], ends[1]))));
    let whole: f64 = pieces().map(|(.., length)| length).sum();
    let step = whole / points as f64;
    let mut walked = Vec::with_capacity(points);
    let mut before = 0.0;
    for (from, to, length) in pieces().filter(|&(.., length)| length > 0.0) {
        while walked.len() < points {
            let part = ((walked.len() as f64 + 0.5) * step - before) / length;
            if part > 1.0 {
                break;
            }
            walked.push([0, 1].map(|axis| from[axis] + (to[axis] - from[axis]) * part));
        }
        before += length;
    }
    (walked, step)
}

fn length([x0, y0]: Point, [x1, y1]: Point) -> f64 {
    libm::hypot(x1 - x0, y1 - y0)
}

/// Returns `count` sample points inside a mask, along a Hilbert curve, and the distance of neighbouring candidates. The
/// candidates are pixel centres or centres of equal parts of pixels, evenly thinned out. Empty for an empty mask.
pub(super) fn points_inside(mask: &Mask, count: usize) -> (Vec<Point>, f64) {
    let drawn = mask.count();
    let parts = (1..=count.isqrt() + 1).find(|parts| drawn * parts * parts >= count).unwrap_or(1);
    let mut places: Vec<[usize; 2]> = mask
        .pixels()
        .flat_map(|[x, y]| (0..parts * parts).map(move |part| [x * parts + part % parts, y * parts + part / parts]))
        .collect();
    places.sort_by_cached_key(|&[x, y]| fast_hilbert::xy2h(clamped(x), clamped(y), ORDER));
    let side = mask.side / parts as f64;
    let kept = places.len().min(count);
    let points = (0..kept).map(|i| places[(2 * i + 1) * places.len() / (2 * kept)].map(|x| (x as f64 + 0.5) * side));
    (points.collect(), side)
}

fn clamped(place: usize) -> u32 {
    u32::try_from(place).unwrap_or(u32::MAX)
}
