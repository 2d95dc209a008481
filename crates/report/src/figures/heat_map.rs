//! Heat maps over a grid of two keys.

use super::Figure;
use super::axis::{Axis, extent};
use super::chart::{TITLE, WIDTH};
use tautline_core::text::{at_least, capitalised, decimals_of};

use super::svg::{Align, Canvas, Marker, Stroke, TEXT, text_px};
use crate::drawing::colours::{SOFT_INK, mixed};

/// Space for the numbers and the label below the cells \[px\].
const BELOW: f64 = 44.0;
/// Space for the label of the vertical axis, and between the numbers and the cells \[px\].
const LABEL: f64 = 32.0;
const GAP: f64 = 6.0;
/// Width of the colour scale, and the space for it with its numbers and its label \[px\].
const SCALE: f64 = 14.0;
const SCALE_SPACE: f64 = 92.0;
/// Height of the cells together \[px\].
const HEIGHT: f64 = 260.0;
/// Steps of the colour scale.
const STEPS: u32 = 40;
/// Colours from the smallest to the largest number: cividis of Nunez, Anderton and Renslow (2018). Its lightness grows
/// evenly, and colour-blind readers can distinguish its colours. They are the same on light and dark paper.
const COLOURS: [u32; 6] = [0x00_22_4E, 0x35_45_6C, 0x66_69_70, 0x94_8E_77, 0xC8_B8_66, 0xFE_E8_38];

/// An axis of a grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GridAxis<'a> {
    /// The key; its name ends with its unit.
    pub key: &'a str,
    /// Values of the key, in the order in which they are drawn.
    pub values: &'a [f64],
}

/// Draws a heat map of one quantity over two keys, with a colour scale.
///
/// `numbers` has a row for each value of `y`, and each row a cell for each value of `x`. A cell without a number is
/// crossed out. The scale spans `range`, or the range of the numbers if `range` is `None`.
#[must_use]
pub fn heat_map(
    name: &str,
    label: &str,
    [x, y]: [GridAxis<'_>; 2],
    numbers: &[Option<f64>],
    range: Option<[f64; 2]>,
) -> Figure {
    // Numbers that are not finite have no colour.
    let numbers: Vec<_> = numbers.iter().map(|number| number.filter(|number| extent([*number]).is_some())).collect();
    let known = || numbers.iter().flatten().copied();
    let scale = match range {
        Some([from, to]) => Axis::spanning(label, from, to, 5.0),
        None => Axis::linear(label, known(), false),
    };
    let y_labels = tick_labels(y.values);
    let left = LABEL + GAP + y_labels.iter().map(|label| text_px(label)).fold(0.0, f64::max);
    let (right, bottom) = (WIDTH - SCALE_SPACE, TITLE + HEIGHT);
    let (columns, rows) = (x.values.len().max(1), y.values.len().max(1));
    let (width, height) = ((right - left) / columns as f64, HEIGHT / rows as f64);
    let title = format!("{} over two keys", capitalised(label));
    let mut canvas = Canvas::new((WIDTH, bottom + BELOW), &title, f64::midpoint(left, right));
    let shown = |number: f64| scale.rounded_down(number);
    let has_room =
        numbers.iter().flatten().all(|&number| text_px(&shown(number)) + GAP <= width) && height >= TEXT + 2.0;
    for (place, number) in numbers.iter().enumerate() {
        let corner = (left + width * (place % columns) as f64, bottom - height * (1 + place / columns) as f64);
        let Some(number) = number else {
            let middle = (corner.0 + width / 2.0, corner.1 + height / 2.0);
            canvas.marker(Marker::Cross, middle, 4.0_f64.min(0.3 * width.min(height)), SOFT_INK);
            continue;
        };
        let (fill, ink) = colour(scale.place(*number).map_or(0.0, |place| scale.share(place)));
        let words = has_room.then(|| shown(*number));
        canvas.tile(corner, (width, height), &fill, words.map(|words| (words, ink)));
    }
    let every = |room: f64, count: usize, each: f64| -> usize {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few")]
        let most = (room / each).max(1.0) as usize;
        count.div_ceil(most)
    };
    let x_labels = tick_labels(x.values);
    let widest = x_labels.iter().map(|label| text_px(label)).fold(0.0, f64::max) + GAP;
    for (k, words) in x_labels.iter().enumerate().step_by(every(right - left, columns, widest)) {
        canvas.text((left + width * (k as f64 + 0.5), bottom + GAP), Align::CENTRE_ABOVE, words);
    }
    for (k, words) in y_labels.iter().enumerate().step_by(every(HEIGHT, rows, TEXT + 2.0)) {
        canvas.text((left - GAP, bottom - height * (k as f64 + 0.5)), Align::RIGHT, words);
    }
    canvas.text((f64::midpoint(left, right), bottom + BELOW - 6.0), Align::CENTRE_BELOW, x.key);
    canvas.text_upwards((17.0, TITLE + HEIGHT / 2.0), y.key);
    let edge = right + 16.0;
    let step = HEIGHT / f64::from(STEPS);
    for k in 0..STEPS {
        let (fill, _) = colour((f64::from(k) + 0.5) / f64::from(STEPS));
        canvas.tile((edge, bottom - step * f64::from(k + 1)), (SCALE, step), &fill, None);
    }
    for &tick in &scale.ticks {
        let (at, end) = (bottom - HEIGHT * scale.share(tick), edge + SCALE);
        canvas.line(&[(end, at), (end + 4.0, at)], Stroke::solid(SOFT_INK, 0.8));
        canvas.text((end + 7.0, at), Align::LEFT, &scale.tick_label(tick));
    }
    canvas.text_upwards((WIDTH - 5.0, TITLE + HEIGHT / 2.0), label);
    canvas.figure(name, &description(label, [x, y], &numbers))
}

/// Largest number of decimals of a value on an axis.
const DECIMALS: u8 = 12;

/// Returns the values of an axis, rounded to a hundredth of their smallest distance.
fn tick_labels(values: &[f64]) -> Vec<String> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let steps = sorted.windows(2).map(|pair| pair[1] - pair[0]).filter(|&step| step > 0.0);
    let Some(step) = steps.reduce(f64::min) else { return values.iter().map(f64::to_string).collect() };
    let decimals = decimals_of(step, DECIMALS) + 2;
    let rounded = |value: &f64| format!("{value:.decimals$}").parse().unwrap_or(*value);
    values.iter().map(|value| rounded(value).to_string()).collect()
}

fn description(label: &str, [x, y]: [GridAxis<'_>; 2], numbers: &[Option<f64>]) -> String {
    let without = numbers.iter().filter(|number| number.is_none()).count();
    let spanned = match extent(numbers.iter().flatten().copied()) {
        Some((low, high)) => format!("from {} to {}", at_least(low, 3), at_least(high, 3)),
        None => "unknown everywhere".to_owned(),
    };
    let crossed = if without > 0 { format!("; {without} crossed cells have none") } else { String::new() };
    format!("{} over {} (to the right) and {} (upwards): {spanned}{crossed}.", capitalised(label), x.key, y.key)
}

/// Returns the colour of a place on the scale, from 0 to 1, and a colour of words that can be read on it.
fn colour(share: f64) -> (String, &'static str) {
    let [red, green, blue] = mixed(&COLOURS, share);
    let fill = format!("#{red:02X}{green:02X}{blue:02X}");
    (fill, if share < 0.55 { "#FFFFFE" } else { "#000001" })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(numbers: &[Option<f64>]) -> Figure {
        let x = GridAxis { key: "sensing.latency_s", values: &[0.0, 0.1, 0.2] };
        let y = GridAxis { key: "network.loss", values: &[0.0, 0.5] };
        heat_map("sweep", "smallest separation [m]", [x, y], numbers, None)
    }

    #[test]
    fn each_number_has_a_colour_and_a_missing_one_is_crossed_out() {
        let figure = map(&[Some(1.0), Some(2.0), Some(3.0), Some(1.5), None, Some(2.5)]);
        assert_eq!(figure.svg.matches("<rect").count(), 1 + 5 + 40, "paper, cells and the scale");
        for part in ["#00224E", "#FEE838", "sensing.latency_s", "network.loss", "smallest separation [m]", ">2.5<"] {
            assert!(figure.svg.contains(part), "{part}: {}", figure.svg);
        }
        assert!(
            figure.description.contains("from 1.000 to 3.000; 1 crossed cells have none"),
            "{}",
            figure.description
        );
    }

    #[test]
    fn values_on_an_axis_are_short_and_differ() {
        let thirds: Vec<_> = (0..4).map(|k| f64::from(k) / 6.0).collect();
        assert_eq!(tick_labels(&thirds), ["0", "0.167", "0.333", "0.5"]);
        assert_eq!(tick_labels(&[0.001, 0.01, 100.0]), ["0.001", "0.01", "100"]);
        assert_eq!(tick_labels(&[1234.5, 1234.5001]), ["1234.5", "1234.5001"]);
        assert_eq!(tick_labels(&[1.0 / 3.0]), [(1.0_f64 / 3.0).to_string()], "one value has no distance");
    }

    #[test]
    fn grids_of_any_size_and_impossible_numbers_are_drawn() {
        let values: Vec<_> = (0..50).map(|k| f64::from(k) / 7.0).collect();
        let axis = GridAxis { key: "law.alpha", values: &values };
        let numbers: Vec<_> = (0..2500).map(|k| Some(f64::from(k))).collect();
        let large = heat_map("sweep", "share", [axis, axis], &numbers, Some([0.0, 1.0]));
        assert!(large.svg.len() < 600_000, "{}", large.svg.len());
        for numbers in [vec![None; 6], vec![Some(f64::NAN); 6], vec![Some(f64::INFINITY); 6], vec![Some(1e300); 6]] {
            assert!(!map(&numbers).svg.contains("NaN"));
        }
        let none = GridAxis { key: "law.alpha", values: &[] };
        assert!(heat_map("sweep", "share", [none, none], &[], None).svg.contains("law.alpha"));
    }
}
