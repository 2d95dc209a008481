//! SVG paths and files as curves.

use kurbo::{Affine, BezPath};
use roxmltree::Document;
use usvg::tiny_skia_path::PathSegment;
use usvg::{FillRule, Group, ImageHrefResolver, Node, Options, Tree};

use super::error::DrawingError;
use super::outline::Curves;

/// Deepest nesting of elements: drawing goes down into them one by one.
const MAX_NESTING: usize = 200;

/// Path data, as the attribute `d` of SVG has it.
pub(super) fn path(data: &str) -> Result<Vec<Curves>, DrawingError> {
    let path = BezPath::from_svg(data).map_err(|error| DrawingError::Path(error.to_string()))?;
    Ok(vec![Curves { path, even_odd: false }])
}

/// The visible shapes of a file. What is written in letters or holds pixels is not drawn.
pub(super) fn file(bytes: &[u8]) -> Result<Vec<Curves>, DrawingError> {
    let text = std::str::from_utf8(bytes).map_err(|error| DrawingError::Svg(error.to_string()))?;
    let options = roxmltree::ParsingOptions { allow_dtd: true, ..roxmltree::ParsingOptions::default() };
    let document = Document::parse_with_options(text, options).map_err(|error| DrawingError::Svg(error.to_string()))?;
    check_nesting(&document)?;
    // Nothing is read but this file.
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
    let at = |point: usvg::tiny_skia_path::Point| (f64::from(point.x), f64::from(point.y));
    let mut curve = BezPath::new();
    for segment in path.segments() {
        match segment {
            PathSegment::MoveTo(to) => curve.move_to(at(to)),
            PathSegment::LineTo(to) => curve.line_to(at(to)),
            PathSegment::QuadTo(control, to) => curve.quad_to(at(control), at(to)),
            PathSegment::CubicTo(first, second, to) => curve.curve_to(at(first), at(second), at(to)),
            PathSegment::Close => curve.close_path(),
        }
    }
    curve
}
