//! Axes: range, ticks and labels.

use super::svg::text_px;
use tautline_core::text::{at_least, decimals_of};

/// Largest number on an axis. Differences of larger numbers may overflow.
const LARGEST: f64 = 1e150;
/// Smallest span of a range relative to its magnitude. Below it, ticks would differ by rounding alone.
const NARROWEST: f64 = 1e-9;
/// Largest number of decades of a logarithmic axis. With 18 decades, 1e-12 and 1e6 are still distinct in a figure.
const MOST_DECADES: i32 = 18;

/// Mapping of numbers to positions on an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scale {
    Linear,
    /// Decimal logarithm.
    Log,
}

/// An axis with its label, such as `time [s]`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Axis {
    pub(super) label: String,
    pub(super) scale: Scale,
    /// Ends of the axis as positions: numbers, or their logarithms.
    pub(super) from: f64,
    pub(super) to: f64,
    /// Positions of the ticks.
    pub(super) ticks: Vec<f64>,
    step: f64,
}

impl Axis {
    /// Returns a linear axis over the finite `numbers`. It ends at ticks if `whole`. Without numbers it spans 0 to 1.
    pub(super) fn linear(label: &str, numbers: impl IntoIterator<Item = f64>, whole: bool) -> Self {
        let (low, high) = extent(numbers).unwrap_or((0.0, 1.0));
        let (low, high) = widened(low, high);
        let step = nice_step(high - low, if whole { 5.0 } else { 6.0 });
        let (from, to) = if whole { ((low / step).floor() * step, (high / step).ceil() * step) } else { (low, high) };
        Self::between(label, from, to, step)
    }

    /// Returns a linear axis from `from` to `to`, which is larger.
    pub(super) fn spanning(label: &str, from: f64, to: f64, most_ticks: f64) -> Self {
        let (from, to) = widened(from, to);
        Self::between(label, from, to, nice_step(to - from, most_ticks))
    }

    fn between(label: &str, from: f64, to: f64, step: f64) -> Self {
        /// A tick that rounding puts beyond the end of its axis by this share of a step is still on it.
        const ROUNDING: f64 = 1e-9;
        let first = (from / step - ROUNDING).ceil();
        let ticks = (0..100).map(|k| (first + f64::from(k)) * step).take_while(|&tick| tick <= to + ROUNDING * step);
        // Adding 0 turns -0 into 0.
        let ticks = ticks.map(|tick| tick + 0.0).collect();
        Self { label: label.to_owned(), scale: Scale::Linear, from, to, ticks, step }
    }

    /// Returns a logarithmic axis of whole decades over the finite positive `numbers`, or over the upper
    /// [`MOST_DECADES`] of their decades. Without numbers it spans 0.1 to 1.
    pub(super) fn log(label: &str, numbers: impl IntoIterator<Item = f64>) -> Self {
        let positive = numbers.into_iter().filter(|&x| x > 0.0).map(f64::log10);
        let (low, high) = extent(positive).unwrap_or((-1.0, 0.0));
        let to = high.ceil();
        let from = low.floor().min(to - 1.0).max(to - f64::from(MOST_DECADES));
        #[expect(clippy::cast_possible_truncation, reason = "between 1 and MOST_DECADES")]
        let decades = (to - from) as i32;
        let step = f64::from((decades + 6) / 7);
        // Ticks are decades divisible by the step, so that 1 is a tick if it is on the axis.
        let ticks = (0..=decades).map(|k| from + f64::from(k)).filter(|place| place.rem_euclid(step) == 0.0).collect();
        Self { label: label.to_owned(), scale: Scale::Log, from, to, ticks, step }
    }

    /// Returns the position of a number on the axis, if it has one.
    pub(super) fn place(&self, number: f64) -> Option<f64> {
        let place = match self.scale {
            Scale::Linear => number,
            Scale::Log if number > 0.0 => number.log10(),
            Scale::Log => return None,
        };
        // Tolerance for rounding, so that a line at the edge does not break.
        let slack = 1e-9 * (self.to - self.from);
        (place >= self.from - slack && place <= self.to + slack).then(|| place.clamp(self.from, self.to))
    }

    /// Returns the number at the upper end.
    pub(super) fn end(&self) -> f64 {
        if self.scale == Scale::Log { 10.0_f64.powf(self.to) } else { self.to }
    }

    /// Returns whether two lines with the same abscissae lie on each other: they are apart by less than a line's width.
    pub(super) fn draws_alike(&self, one: &[(f64, f64)], other: &[(f64, f64)]) -> bool {
        const WIDTH: f64 = 2e-3;
        let is_near = |(a, b): (&(f64, f64), &(f64, f64))| {
            let places = [a.1, b.1].map(|y| self.place(y).map(|place| self.share(place)));
            a.0 == b.0 && places[0].zip(places[1]).map_or(places[0] == places[1], |(a, b)| (a - b).abs() <= WIDTH)
        };
        one.len() == other.len() && !one.is_empty() && one.iter().zip(other).all(is_near)
    }

    /// Returns the share of the axis up to a position, from 0 to 1.
    pub(super) fn share(&self, place: f64) -> f64 {
        (place - self.from) / (self.to - self.from)
    }

    /// Returns the position in the middle of the axis.
    pub(super) fn middle(&self) -> f64 {
        f64::midpoint(self.from, self.to)
    }

    /// Returns an axis of time \[s\] between two instants, or of one second from the first if they are equal.
    pub(super) fn time(from_s: f64, to_s: f64) -> Self {
        let label = "time [s]";
        if to_s > from_s {
            return Self::spanning(label, from_s, to_s, 8.0);
        }
        let from_s = if from_s.is_finite() { from_s } else { 0.0 };
        Self::spanning(label, from_s, from_s + 1.0, 5.0)
    }

    /// Returns an axis of distances that contains 0, or a logarithmic axis if the limit would be invisible beside the
    /// largest number.
    pub(super) fn distances(unit: &str, numbers: &[f64], limit: f64) -> Self {
        /// Largest number on a linear axis relative to the limit.
        const LOG_FROM: f64 = 40.0;
        let label = format!("distance [{unit}]");
        let largest = numbers.iter().copied().filter(|x| x.is_finite()).fold(limit, f64::max);
        let numbers = numbers.iter().copied();
        // Distances inside an obstacle are negative.
        if limit > 0.0 && largest > LOG_FROM * limit && !numbers.clone().any(|x| x < 0.0) {
            Self::log(&label, numbers)
        } else {
            Self::linear(&label, numbers.chain([0.0]), true)
        }
    }

    /// Returns the width of the widest tick label \[px\].
    pub(super) fn labels_px(&self) -> f64 {
        self.ticks.iter().map(|&tick| text_px(&self.tick_label(tick))).fold(0.0, f64::max)
    }

    /// Formats a number of a linear axis, rounded down, with one digit more than the ticks.
    pub(super) fn rounded_down(&self, number: f64) -> String {
        at_least(number, u8::try_from(decimals_of(0.1 * self.step, 6)).unwrap_or(6))
    }

    /// Returns the label of the tick at `place`.
    pub(super) fn tick_label(&self, place: f64) -> String {
        match self.scale {
            Scale::Linear => number_label(place, self.step),
            Scale::Log => power_label(place, self.ticks.iter().any(|tick| tick.abs() > MOST_ZEROS)),
        }
    }
}

/// Returns the smallest and the largest number that can be on an axis.
pub(super) fn extent(numbers: impl IntoIterator<Item = f64>) -> Option<(f64, f64)> {
    numbers.into_iter().filter(|x| x.abs() <= LARGEST).fold(None, |extent, x| {
        let (low, high) = extent.unwrap_or((x, x));
        Some((low.min(x), high.max(x)))
    })
}

/// Widens a range that is too narrow to be shown.
fn widened(low: f64, high: f64) -> (f64, f64) {
    let magnitude = low.abs().max(high.abs());
    if high - low > NARROWEST * magnitude {
        return (low, high);
    }
    let margin = if magnitude > 0.0 { 0.1 * magnitude } else { 0.5 };
    (low - margin, high + margin)
}

/// Returns the step of 1, 2 or 5 times a power of ten that divides `span` into at most `most` parts.
fn nice_step(span: f64, most: f64) -> f64 {
    let least = span / most;
    let power = 10.0_f64.powf(least.log10().floor());
    let steps = [1.0, 2.0, 5.0].map(|digit| digit * power);
    steps.into_iter().find(|step| *step >= least * (1.0 - 1e-9)).unwrap_or(10.0 * power)
}

/// Formats a number with the decimals that the tick step needs, and with a typographic minus sign.
fn number_label(number: f64, step: f64) -> String {
    /// Largest number of decimals in a power of ten. Beyond it, the plain number is shorter.
    const MOST_DIGITS: usize = 3;
    let digits = decimals_of(step / 10.0_f64.powf(number.abs().log10().floor()), 17);
    let text = if number != 0.0 && (number.abs() >= 1e5 && digits <= MOST_DIGITS || step < 1e-4) {
        format!("{number:.digits$e}").replace(".0e", "e")
    } else {
        let decimals = decimals_of(step, 4);
        format!("{number:.decimals$}")
    };
    text.replace('-', "\u{2212}")
}

/// Largest magnitude of an exponent on an axis of plain numbers.
const MOST_ZEROS: f64 = 3.0;

/// Formats a power of ten by its exponent: as `10⁻³`, or as a plain number. All ticks of an axis have one notation.
fn power_label(exponent: f64, as_power: bool) -> String {
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    if !as_power {
        let decimals = decimals_of(10.0_f64.powf(exponent), 17);
        return format!("{:.decimals$}", 10.0_f64.powf(exponent));
    }
    let raised = |c: char| c.to_digit(10).map_or('⁻', |digit| DIGITS[digit as usize]);
    format!("10{}", format!("{exponent:.0}").chars().map(raised).collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: &Axis) -> Vec<String> {
        axis.ticks.iter().map(|&tick| axis.tick_label(tick)).collect()
    }

    #[test]
    fn ticks_are_round_numbers_on_the_axis() {
        let axis = Axis::linear("time [s]", [0.0, 120.0], false);
        assert_eq!(labels(&axis), ["0", "20", "40", "60", "80", "100", "120"]);
        let axis = Axis::linear("x [m]", [-0.31, 0.27], true);
        assert_eq!(labels(&axis), ["\u{2212}0.4", "\u{2212}0.2", "0.0", "0.2", "0.4"]);
        let axis = Axis::linear("x [m]", [2.5e6, 7.5e6], true);
        assert_eq!(labels(&axis), ["2e6", "3e6", "4e6", "5e6", "6e6", "7e6", "8e6"]);
    }

    #[test]
    fn a_logarithmic_axis_has_whole_decades() {
        let axis = Axis::log("error [m]", [3.2e-3, 0.5, 8.0, 0.0, -1.0, f64::NAN]);
        assert_eq!((axis.from, axis.to), (-3.0, 1.0));
        assert_eq!(labels(&axis), ["0.001", "0.01", "0.1", "1", "10"]);
        assert_eq!((axis.place(0.0), axis.place(-1.0), axis.place(f64::NAN)), (None, None, None));
        assert_eq!(axis.place(0.01), Some(-2.0));
        let axis = Axis::log("error [m]", [1e-300, 1.0]);
        assert_eq!((axis.from, axis.to), (-18.0, 0.0));
        assert_eq!(labels(&axis), ["10⁻¹⁸", "10⁻¹⁵", "10⁻¹²", "10⁻⁹", "10⁻⁶", "10⁻³", "10⁰"]);
    }

    #[test]
    fn empty_and_non_finite_input_gives_an_axis() {
        let hostile: [&[f64]; 9] = [
            &[],
            &[f64::NAN],
            &[f64::INFINITY, f64::NEG_INFINITY],
            &[0.0],
            &[1e9],
            &[1e9, 1e9 + 1e-7],
            &[f64::MAX, -f64::MAX],
            &[1e150, -1e150],
            &[f64::MIN_POSITIVE],
        ];
        for numbers in hostile {
            for axis in [
                Axis::linear("", numbers.iter().copied(), true),
                Axis::linear("", numbers.iter().copied(), false),
                Axis::log("", numbers.iter().copied()),
            ] {
                assert!(axis.from < axis.to && axis.from.is_finite() && axis.to.is_finite(), "{numbers:?}: {axis:?}");
                assert!((1..=20).contains(&axis.ticks.len()), "{numbers:?}: {axis:?}");
                assert!(labels(&axis).iter().all(|label| label.chars().count() < 12), "{:?}", labels(&axis));
            }
        }
    }
}
