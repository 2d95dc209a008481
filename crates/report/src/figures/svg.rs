//! SVG drawings: colours, strokes, shapes and texts.

use std::fmt::Write as _;

use maud::{PreEscaped, html};

use super::Figure;
use crate::drawing::colours::{INK, PAPER, SOFT_INK, ThemeColour, VEHICLES};
use crate::simplify::needed;

/// A position on the drawing, to the right and down \[px\].
pub(super) type Point = (f64, f64);

/// A rectangle of the drawing: left, top, right and bottom \[px\].
pub(super) type Rect = [f64; 4];

/// Font sizes \[px\].
pub(super) const TEXT: f64 = 13.5;
const HEADING: f64 = 14.5;
/// Baseline of the title \[px\].
const TITLE_BASELINE: f64 = 19.0;
const MARK_WIDTH: f64 = 1.6;

/// Stroke of a line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stroke {
    pub(super) colour: ThemeColour,
    width: f64,
    opacity: f64,
    /// Lengths of dashes and gaps; `None` for a solid line.
    dashes: Option<&'static str>,
}

const DASHED: Option<&str> = Some("6 4");
const DOTTED: Option<&str> = Some("2 3");

impl Stroke {
    pub(super) fn solid(colour: ThemeColour, width: f64) -> Self {
        Self { colour, width, opacity: 1.0, dashes: None }
    }

    pub(super) fn dashed(colour: ThemeColour, width: f64) -> Self {
        Self { dashes: DASHED, ..Self::solid(colour, width) }
    }

    /// Returns the stroke of the `k`-th of several lines: colours change first, then dashes.
    pub(super) fn of_line(k: usize) -> Self {
        let dashes = [None, DASHED, DOTTED][(k / VEHICLES.len()) % 3];
        Self { dashes, ..Self::solid(VEHICLES[k % VEHICLES.len()], 1.5) }
    }

    /// Returns the stroke of lines that are not told apart.
    pub(super) fn of_others() -> Self {
        Self::solid(SOFT_INK, 0.9).faint(0.45)
    }

    /// Returns the same stroke with this opacity.
    pub(super) fn faint(self, opacity: f64) -> Self {
        Self { opacity, ..self }
    }

    fn opacity(self) -> Option<f64> {
        (self.opacity < 1.0).then_some(self.opacity)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Marker {
    Cross,
    Ring,
    Dot,
}

/// Anchor of a text: left, centre or right, and below (first letter), middle or above.
#[derive(Clone, Copy, Debug)]
pub(super) struct Align(&'static str, &'static str);

impl Align {
    pub(super) const LEFT: Self = Self("start", "0.35em");
    pub(super) const CENTRE: Self = Self("middle", "0.35em");
    pub(super) const CENTRE_BELOW: Self = Self("middle", "0");
    pub(super) const CENTRE_ABOVE: Self = Self("middle", "0.76em");
    pub(super) const RIGHT: Self = Self("end", "0.35em");
    pub(super) const RIGHT_ABOVE: Self = Self("end", "0.76em");
}

/// An unfinished drawing.
#[derive(Clone, Debug)]
pub(super) struct Canvas {
    size: (f64, f64),
    title: String,
    shapes: String,
}

impl Canvas {
    /// Returns an empty drawing of a size \[px\] under a title, which is centred at `middle`.
    pub(super) fn new(size: (f64, f64), title: &str, middle: f64) -> Self {
        let title = printable(title);
        let shapes = html! {
            rect width="100%" height="100%" fill=(PAPER.hex()) {}
            text x=(px(middle)) y=(px(TITLE_BASELINE)) text-anchor="middle" font-size=(HEADING) fill=(INK.hex()) {
                (title)
            }
        };
        Self { size, title, shapes: shapes.into_string() }
    }

    /// Draws a line through points, or a dot for a single point.
    pub(super) fn line(&mut self, points: &[Point], stroke: Stroke) {
        let Stroke { colour, width, dashes, .. } = stroke;
        let shape = match *points {
            [] => return,
            [(x, y)] => html! {
                circle cx=(px(x)) cy=(px(y)) r=(width) fill=(colour.hex()) opacity=[stroke.opacity()] {}
            },
            _ => html! {
                polyline points=(corners(points)) stroke=(colour.hex()) stroke-width=(width) stroke-dasharray=[dashes]
                    opacity=[stroke.opacity()] {}
            },
        };
        self.shapes += &shape.into_string();
    }

    /// Fills a polygon.
    pub(super) fn area(&mut self, points: &[Point], colour: ThemeColour, opacity: f64) {
        if points.is_empty() {
            return;
        }
        let shape = html! { polygon points=(corners(points)) fill=(colour.hex()) opacity=(opacity) {} };
        self.shapes += &shape.into_string();
    }

    /// Fills a rectangle from its upper left corner, with words of a given colour in its middle. Both colours are the
    /// same on light and dark paper.
    pub(super) fn tile(&mut self, (x, y): Point, (width, height): Point, fill: &str, words: Option<(String, &str)>) {
        let shape = html! {
            // Adjacent tiles overlap slightly, because the paper would show through between them otherwise.
            rect x=(px(x)) y=(px(y)) width=(px(width + 0.3)) height=(px(height + 0.3)) fill=(fill) {}
            @if let Some((words, ink)) = words {
                text x=(px(x + width / 2.0)) y=(px(y + height / 2.0)) text-anchor="middle" dy="0.35em" fill=(ink) {
                    (printable(&words))
                }
            }
        };
        self.shapes += &shape.into_string();
    }

    /// Draws a marker of a radius \[px\].
    pub(super) fn marker(&mut self, marker: Marker, (x, y): Point, radius: f64, colour: ThemeColour) {
        match marker {
            Marker::Ring => {
                let shape = html! {
                    circle cx=(px(x)) cy=(px(y)) r=(radius) stroke=(colour.hex()) stroke-width=(MARK_WIDTH) {}
                };
                self.shapes += &shape.into_string();
            }
            Marker::Dot => {
                let shape = html! { circle cx=(px(x)) cy=(px(y)) r=(radius) fill=(colour.hex()) {} };
                self.shapes += &shape.into_string();
            }
            Marker::Cross => {
                for down in [radius, -radius] {
                    self.line(&[(x - radius, y - down), (x + radius, y + down)], Stroke::solid(colour, MARK_WIDTH));
                }
            }
        }
    }

    /// Draws into a square with this upper left corner, which clips the content.
    pub(super) fn window(&mut self, (x, y): Point, side: f64, draw: impl FnOnce(&mut Self)) {
        let around = std::mem::take(&mut self.shapes);
        draw(self);
        let within = std::mem::replace(&mut self.shapes, around);
        let window = html! {
            svg x=(px(x)) y=(px(y)) width=(px(side)) height=(px(side))
                viewBox=(format!("{} {} {} {}", px(x), px(y), px(side), px(side))) {
                rect x=(px(x)) y=(px(y)) width="100%" height="100%" fill=(PAPER.hex()) {}
                (PreEscaped(within))
            }
        };
        self.shapes += &window.into_string();
    }

    /// Draws into a group of a class.
    pub(super) fn group(&mut self, class: &str, draw: impl FnOnce(&mut Self)) {
        let around = std::mem::take(&mut self.shapes);
        draw(self);
        let within = std::mem::replace(&mut self.shapes, around);
        self.shapes += &html! { g class=(class) { (PreEscaped(within)) } }.into_string();
    }

    /// Returns whether a rectangle is on the drawing, below the title.
    pub(super) fn contains(&self, [left, top, right, bottom]: Rect) -> bool {
        left >= 0.0 && top >= TITLE_BASELINE && right <= self.size.0 && bottom <= self.size.1
    }

    pub(super) fn text(&mut self, (x, y): Point, Align(anchor, dy): Align, words: &str) {
        let shape =
            html! { text x=(px(x)) y=(px(y)) text-anchor=(anchor) dy=(dy) fill=(INK.hex()) { (printable(words)) } };
        self.shapes += &shape.into_string();
    }

    /// Draws a text that reads upwards.
    pub(super) fn text_upwards(&mut self, (x, y): Point, words: &str) {
        let turned = format!("translate({} {}) rotate(-90)", px(x), px(y));
        let shape = html! { text transform=(turned) text-anchor="middle" fill=(INK.hex()) { (words) } };
        self.shapes += &shape.into_string();
    }

    /// Returns the figure, with a description for screen readers.
    pub(super) fn figure(self, name: &str, description: &str) -> Figure {
        let Self { size: (width, height), title, shapes } = self;
        let description = printable(description);
        let label = format!("{title}. {description}");
        let svg = html! {
            svg xmlns="http://www.w3.org/2000/svg" class="tautline-figure" width=(width) height=(height)
                viewBox=(format!("0 0 {width} {height}")) fill="none" font-family="sans-serif" font-size=(TEXT)
                role="img" aria-label=(label) {
                title { (title) }
                desc { (description) }
                (PreEscaped(shapes))
            }
        };
        Figure { name: name.to_owned(), title, description, svg: svg.into_string() }
    }
}

/// Returns the text without control characters, which XML forbids, and with a typographic minus sign before numbers and
/// in exponents.
fn printable(text: &str) -> String {
    let is_number = |c: &char| c.is_ascii_digit() || *c == '.';
    let chars: Vec<_> = text.chars().filter(|c| !c.is_control()).collect();
    let is_minus = |k: usize| {
        let before = match chars[..k] {
            [.., digit, 'e'] => is_number(&digit),
            [.., before] => matches!(before, ' ' | '(' | '[' | ',' | '='),
            [] => true,
        };
        chars[k] == '-' && before && chars.get(k + 1).is_some_and(is_number)
    };
    chars.iter().enumerate().map(|(k, &c)| if is_minus(k) { '\u{2212}' } else { c }).collect()
}

/// Returns an upper estimate of the width of words by the font size \[px\].
pub(super) fn text_px(words: &str) -> f64 {
    let narrow = words.chars().filter(|c| matches!(c, '.' | ' ' | '[' | ']')).count();
    TEXT * (0.6 * words.chars().count() as f64 - 0.3 * narrow as f64)
}

/// Returns the rectangle of a text, which contains its letters.
pub(super) fn text_rect((x, y): Point, Align(anchor, dy): Align, words: &str) -> Rect {
    let width = text_px(words);
    let left = match anchor {
        "start" => x,
        "end" => x - width,
        _ => x - width / 2.0,
    };
    let baseline = y + TEXT * dy.trim_end_matches("em").parse().unwrap_or(0.0);
    [left, baseline - 0.76 * TEXT, left + width, baseline + 0.2 * TEXT]
}

/// Rounds a length to a tenth of a pixel.
fn px(length: f64) -> f64 {
    // Adding 0 turns -0 into 0.
    (length * 10.0).round() / 10.0 + 0.0
}

fn corners(points: &[Point]) -> String {
    let mut text = String::with_capacity(12 * points.len());
    for &(x, y) in points {
        let space = if text.is_empty() { "" } else { " " };
        // Writing to a string cannot fail.
        let _ = write!(text, "{space}{},{}", px(x), px(y));
    }
    text
}

/// Largest distance of an omitted corner from the drawn line \[px\], unless there would be more than [`MOST_CORNERS`].
const TOLERANCE: f64 = 0.1;
/// Largest number of corners of a drawing besides the ends of its lines: about 120 kB.
const MOST_CORNERS: usize = 12_000;

/// Simplifies lines. Every omitted corner is within a tolerance of the line through the others. The tolerance is a
/// tenth of a pixel, or larger if more than [`MOST_CORNERS`] corners would stay. Ends and extremes stay.
pub(super) fn thinned<T>(mut lines: Vec<(T, Vec<Point>)>) -> Vec<(T, Vec<Point>)> {
    let weights: Vec<_> = lines.iter().map(|(_, points)| weights(points)).collect();
    let mut corners: Vec<f64> = weights.iter().flatten().copied().filter(|weight| weight.is_finite()).collect();
    corners.retain(|&weight| weight > TOLERANCE);
    let tolerance = match corners.len().checked_sub(MOST_CORNERS + 1) {
        Some(dropped) => *corners.select_nth_unstable_by(dropped, f64::total_cmp).1,
        None => TOLERANCE,
    };
    for ((_, points), weights) in lines.iter_mut().zip(weights) {
        let mut weights = weights.into_iter();
        points.retain(|_| weights.next().is_some_and(|weight| weight > tolerance));
    }
    lines
}

/// Returns the largest tolerance \[px\] that keeps each point of a line; 0 below [`TOLERANCE`].
fn weights(points: &[Point]) -> Vec<f64> {
    let mut weights = vec![0.0; points.len()];
    let Some(end) = points.len().checked_sub(1) else { return weights };
    (weights[0], weights[end]) = (f64::INFINITY, f64::INFINITY);
    for (k, weight) in needed(&[0, end], TOLERANCE, |k, from, to| distance(points[k], points[from], points[to])) {
        weights[k] = weight;
    }
    weights
}

/// Returns the distance of a point from the segment between two others.
fn distance(point: Point, from: Point, to: Point) -> f64 {
    let (along_x, along_y) = (to.0 - from.0, to.1 - from.1);
    let (x, y) = (point.0 - from.0, point.1 - from.1);
    let length_squared = along_x * along_x + along_y * along_y;
    let share = if length_squared > 0.0 { ((x * along_x + y * along_y) / length_squared).clamp(0.0, 1.0) } else { 0.0 };
    (x - share * along_x).hypot(y - share * along_y)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn thinned_line(points: &[Point]) -> Vec<Point> {
        thinned(vec![((), points.to_vec())]).remove(0).1
    }

    #[test]
    fn keeps_ends_and_spikes() {
        let line: Vec<_> = (0..1000).map(|k| (f64::from(k), 0.5 * f64::from(k))).collect();
        assert_eq!(thinned_line(&line), [line[0], line[999]]);
        let mut spiked = line.clone();
        spiked[500].1 += 2.0;
        assert!(thinned_line(&spiked).contains(&spiked[500]));
        spiked[500].1 -= 1.95;
        assert_eq!(thinned_line(&spiked).len(), 2, "too small to be seen");
    }

    #[test]
    fn omitted_points_are_within_the_tolerance() {
        let curve: Vec<_> = (0..2000).map(|k| f64::from(k) * 0.05).map(|x| (x, 30.0 * (x / 8.0).sin())).collect();
        let kept = thinned_line(&curve);
        assert!(kept.len() < curve.len() / 4, "{} of {}", kept.len(), curve.len());
        for &point in &curve {
            let nearest = kept.windows(2).map(|ends| distance(point, ends[0], ends[1])).fold(f64::INFINITY, f64::min);
            assert!(nearest <= TOLERANCE, "{point:?} is {nearest} off");
        }
    }

    #[test]
    fn keeps_the_farthest_of_too_many_corners() {
        let noise = |k: u32, height: f64| (f64::from(k), if k.is_multiple_of(2) { 0.0 } else { height });
        let lines = vec![
            ("high", (0..9001).map(|k| noise(k, 50.0)).collect()),
            ("low", (0..9001).map(|k| noise(k, 2.0)).collect::<Vec<_>>()),
        ];
        let thinned = thinned(lines);
        let corners = thinned.iter().map(|(_, points)| points.len() - 2).sum::<usize>();
        assert!(corners <= MOST_CORNERS, "{corners}");
        assert!(thinned[0].1.len() > 8000 && thinned[1].1.len() < 8000);
    }

    #[test]
    fn handles_empty_and_degenerate_lines() {
        assert!(thinned_line(&[]).is_empty());
        assert_eq!(thinned_line(&[(1.0, 2.0)]), [(1.0, 2.0)]);
        assert_eq!(thinned_line(&[(1.0, 2.0); 9]).len(), 2);
    }
}
