//! Numbers of several laws side by side.

use super::Figure;
use super::axis::{Axis, extent};
use super::chart::{TITLE, WIDTH};
use tautline_core::text::significant;

use super::svg::{Align, Canvas, Marker, Stroke, text_px};
use crate::drawing::colours::{GRID, INK, SOFT_INK, VEHICLES};

/// Height of a row, of the numbers and label below the rows, and of the label of the limit \[px\].
const ROW: f64 = 26.0;
const BELOW: f64 = 44.0;
const LIMIT: f64 = 16.0;
/// Space on the left, beside the names, and on the right \[px\].
const LEFT: f64 = 12.0;
const GAP: f64 = 10.0;
const RIGHT: f64 = WIDTH - 20.0;
/// Largest share of the width for names.
const NAMES: f64 = 0.4;

/// Number of a law with its interval.
#[derive(Clone, Debug, PartialEq)]
pub struct OfLaw {
    /// Name of the law.
    pub law: String,
    /// The number; `None` if it is unknown.
    pub value: Option<f64>,
    /// Ends of its interval; an end that is `None` is unknown, and the interval then ends with the axis.
    pub interval: [Option<f64>; 2],
}

/// Draws a number of each law as a dot with its interval, a row for each law, with an optional limit. The axis spans
/// `range`, or the numbers.
#[must_use]
pub fn by_law(
    name: &str,
    title: &str,
    label: &str,
    rows: &[OfLaw],
    range: Option<[f64; 2]>,
    limit: Option<(f64, &str)>,
) -> Figure {
    let known = || rows.iter().filter(|row| row.value.is_some());
    let numbers = known().flat_map(|row| row.interval.into_iter().chain([row.value])).flatten();
    let x = match range {
        Some([from, to]) => Axis::spanning(label, from, to, 5.0),
        None => Axis::linear(label, numbers.chain(limit.map(|limit| limit.0)), true),
    };
    let names_px = rows.iter().map(|row| text_px(&row.law)).fold(0.0, f64::max);
    let left = (LEFT + GAP + names_px).min(NAMES * WIDTH);
    let top = TITLE + if limit.is_some() { LIMIT } else { 0.0 };
    let bottom = top + ROW * rows.len().max(1) as f64;
    let on_paper = |number: f64| left + (RIGHT - left) * x.share(x.place(number).unwrap_or(x.from));
    let mut canvas = Canvas::new((WIDTH, bottom + BELOW), title, WIDTH / 2.0);
    for &tick in &x.ticks {
        let at = left + (RIGHT - left) * x.share(tick);
        canvas.line(&[(at, top), (at, bottom)], Stroke::solid(GRID, 0.8));
        canvas.text((at, bottom + 7.0), Align::CENTRE_ABOVE, &x.tick_label(tick));
    }
    if let Some((at, words)) = limit {
        canvas.line(&[(on_paper(at), top), (on_paper(at), bottom)], Stroke::dashed(INK, 1.3));
        canvas.text((on_paper(at), top - 4.0), Align::CENTRE_BELOW, words);
    }
    for (k, row) in rows.iter().enumerate() {
        let y = top + ROW * (k as f64 + 0.5);
        canvas.text((LEFT, y), Align::LEFT, &row.law);
        let Some(value) = row.value.filter(|value| extent([*value]).is_some()) else {
            canvas.text((left + GAP, y), Align::LEFT, "none");
            continue;
        };
        if row.interval.iter().any(Option::is_some) {
            let ends = [row.interval[0].unwrap_or(x.from), row.interval[1].unwrap_or(x.to)].map(on_paper);
            canvas.line(&ends.map(|end| (end, y)), Stroke::solid(VEHICLES[0], 1.6));
            for (end, _) in ends.into_iter().zip(row.interval).filter(|(_, end)| end.is_some()) {
                canvas.line(&[(end, y - 4.0), (end, y + 4.0)], Stroke::solid(VEHICLES[0], 1.6));
            }
        }
        canvas.marker(Marker::Dot, (on_paper(value), y), 4.5, VEHICLES[0]);
    }
    canvas.line(&[(left, top), (left, bottom), (RIGHT, bottom)], Stroke::solid(SOFT_INK, 0.8));
    canvas.text((f64::midpoint(left, RIGHT), bottom + BELOW - 6.0), Align::CENTRE_BELOW, label);
    let unit = label.rsplit_once(" [").and_then(|(_, unit)| unit.strip_suffix(']')).unwrap_or_default();
    let said = rows.iter().map(|row| match row.value {
        Some(value) => format!("{} {} {unit}", row.law, trimmed(value)).trim_end().to_owned(),
        None => format!("{} none", row.law),
    });
    let lacks_interval = known().any(|row| row.interval == [None; 2]);
    let note = if lacks_interval { " A dot without a line: an interval needs more flights." } else { "" };
    canvas.figure(name, &format!("{title}: {}.{note}", said.collect::<Vec<_>>().join(", ")))
}

/// Formats a number with three significant digits, without zeros at the end.
fn trimmed(number: f64) -> String {
    let text = significant(number, 3);
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_law_has_a_row_and_unknown_numbers_are_named() {
        let row = |law: &str, value, interval| OfLaw { law: law.to_owned(), value, interval };
        let rows = [
            row("one", Some(0.5), [Some(0.2), Some(0.8)]),
            row("two", None, [None; 2]),
            row("three", Some(f64::INFINITY), [None, Some(1.0)]),
            row("four", Some(1.0), [Some(0.7), None]),
        ];
        let figure = by_law("reached", "Reached", "share", &rows, Some([0.0, 1.0]), Some((0.9, "limit")));
        assert_eq!(figure.svg.matches("<circle").count(), 2);
        assert_eq!(figure.svg.matches(">none<").count(), 2);
        assert!(["one", "two", "three", "four", "limit", "share"].iter().all(|word| figure.svg.contains(word)));
        assert!(!figure.svg.contains("NaN") && !figure.svg.contains("inf\""), "{}", figure.svg);
        assert!(by_law("none", "None", "share", &[], None, None).svg.contains("share"));
    }
}
