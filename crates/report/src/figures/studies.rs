//! Figures of studies: progress of a search, shares and separations over the values of a key, histograms.

use super::Figure;
use super::axis::Axis;
use super::chart::{Chart, Line, Mark};
use super::svg::Stroke;
use crate::drawing::colours::{ALARM, INK, SOFT_INK, VEHICLES};
use tautline_core::text::{exact, separation, significant};

/// Draws the smallest separation found so far \[m\] over the `flights` of a search, with delta and the separation of
/// the flight of the unchanged scenario. `found` holds each flight, numbered from 1, that was worse than all before.
#[must_use]
pub fn attack(found: &[(u64, f64)], flights: u64, delta_m: f64, own_m: Option<f64>) -> Figure {
    let last = flights.max(1) as f64;
    let lengths = found.iter().map(|&(_, min_m)| min_m).chain([delta_m]).chain(own_m);
    let mut chart =
        Chart::new(Axis::spanning("flights", 0.0, last, 6.0), Axis::linear("smallest separation [m]", lengths, true));
    let mut points = Vec::with_capacity(2 * found.len() + 1);
    for &(flight, min_m) in found {
        points.extend(points.last().map(|&(_, before_m): &(f64, f64)| (flight as f64, before_m)));
        points.push((flight as f64, min_m));
    }
    points.extend(points.last().map(|&(_, worst_m)| (last, worst_m)));
    chart.line(points, Stroke::solid(VEHICLES[0], 1.8), "worst so far");
    chart.level(delta_m, Stroke::dashed(INK, 1.3), format!("delta = {} m", exact(delta_m)));
    if let Some(own_m) = own_m {
        chart.level(own_m, Stroke::dashed(SOFT_INK, 1.0), "unchanged scenario".to_owned());
    }
    let worst = found.last();
    chart.marks.extend(worst.map(|&(flight, min_m)| Mark::ring((flight as f64, min_m), VEHICLES[0], None)));
    let found = worst.map(|(flight, min_m)| format!("{} m in flight {flight}", separation(*min_m)));
    let found = found.unwrap_or_else(|| "no flight".to_owned());
    let description = format!("The smallest separation found over the flights of the search: {found}.");
    chart.figure("attack", "Smallest separation found", &description)
}

/// Share of the flights at one value of a key.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Share {
    /// Value of the key.
    pub value: f64,
    /// Share of the flights with the property, from 0 to 1.
    pub share: f64,
    /// 95 % interval of the share, if known.
    pub interval: Option<[f64; 2]>,
}

/// Draws shares of flights with a property (`does`) over the values of a key, with 95 % intervals, the bracket in which
/// the verdict changes, and `predicted` values with their labels. The axis is logarithmic on request.
#[must_use]
pub fn margin(
    shares: &[Share],
    key: &str,
    does: &str,
    bracket: Option<[f64; 2]>,
    predicted: &[(f64, String)],
    logarithmic: bool,
) -> Figure {
    let mut chart = chart_of_shares(key, does, shares.iter(), logarithmic);
    for (k, share) in shares.iter().enumerate() {
        chart.interval(share.value, share.interval, Stroke::solid(VEHICLES[0], 1.2));
        let flights = if share.interval.is_some() { "with its 95 % interval" } else { "one flight" };
        let ring = Mark::ring((share.value, share.share), VEHICLES[0], (k == 0).then(|| flights.to_owned()));
        chart.marks.push(Mark { radius: 3.5, ..ring });
    }
    let turn = draw_turn(&mut chart, bracket, predicted);
    chart.figure("margin", &format!("Share that {does}"), &format!("The share that {does} over {key}; {turn}."))
}

/// Draws the bracket in which a verdict changes, and `predicted` values with their labels. Returns the bracket in
/// words.
fn draw_turn(chart: &mut Chart, bracket: Option<[f64; 2]>, predicted: &[(f64, String)]) -> String {
    for (k, side) in bracket.into_iter().flatten().enumerate() {
        let label = (k == 0).then(|| "the verdict turns in between".to_owned());
        chart.upright(side, Stroke::dashed(SOFT_INK, 1.0), label);
    }
    for (k, (value, what)) in predicted.iter().enumerate() {
        let stroke = Stroke::dashed(VEHICLES[1 + k % 2], 1.5);
        // A prediction beyond the axis has an entry in the legend only if the entry says so.
        let label = if chart.x.place(*value).is_some() {
            format!("predicted {what}")
        } else {
            format!("predicted {what}, not in this range")
        };
        chart.upright(*value, stroke, Some(label));
    }
    let shown = |value| significant(value, 4);
    bracket.map_or_else(
        || "the verdict does not turn".to_owned(),
        |[low, high]| format!("the verdict turns between {} and {}", shown(low), shown(high)),
    )
}

/// Draws the smallest separations of single flights over the values of a key, with the safety distance delta \[m\]. A
/// flight `holds` if it shows the verdict; `words` are the predicates of a flight that does and of one that does not.
/// Bracket and predictions are those of [`margin`].
#[must_use]
pub fn verdicts(
    flights: &[(Separation, bool)],
    key: &str,
    words: [&str; 2],
    delta_m: f64,
    bracket: Option<[f64; 2]>,
    predicted: &[(f64, String)],
    logarithmic: bool,
) -> Figure {
    let separations: Vec<_> = flights.iter().map(|&(of, _)| of).collect();
    let mut chart = chart_of_separations(key, &separations, delta_m, logarithmic);
    let points = separations.iter().map(|of| (of.value, of.smallest_m)).collect();
    chart.lines.push(Line { points, stroke: Stroke::solid(SOFT_INK, 1.0), label: None });
    let at = |of: &Separation| (of.value, of.smallest_m);
    let mark = |of: &Separation, holds: bool, label| {
        if holds { Mark::ring(at(of), VEHICLES[0], label) } else { Mark::cross(at(of), ALARM, label) }
    };
    for (verdict, word) in [true, false].into_iter().zip(words) {
        let marked = flights.iter().filter(|&&(_, holds)| holds == verdict);
        chart
            .marks
            .extend(marked.enumerate().map(|(k, (of, holds))| mark(of, *holds, (k == 0).then(|| word.to_owned()))));
    }
    chart.level(delta_m, Stroke::dashed(INK, 1.3), format!("delta = {} m", exact(delta_m)));
    let turn = draw_turn(&mut chart, bracket, predicted);
    let title = format!("Smallest separation over {key}");
    let [does, does_not] = words;
    let description = format!("{title}, one flight for each value: a ring {does}, a cross {does_not}; {turn}.");
    chart.figure("margin", &title, &description)
}

/// Returns an empty chart of smallest separations over the values of a key.
fn chart_of_separations(key: &str, flights: &[Separation], delta_m: f64, logarithmic: bool) -> Chart {
    let lengths = flights
        .iter()
        .flat_map(|of| [of.smallest_m, of.median_m].into_iter().chain(of.interval_m.into_iter().flatten()));
    let values = flights.iter().map(|of| of.value);
    let x = if logarithmic { Axis::log(key, values) } else { Axis::linear(key, values, false) };
    Chart::new(x, Axis::linear("smallest separation [m]", lengths.chain([delta_m]), true))
}

/// Returns an empty chart of shares over the values of a key.
fn chart_of_shares<'a>(key: &str, does: &str, shares: impl Iterator<Item = &'a Share>, logarithmic: bool) -> Chart {
    let values = shares.map(|share| share.value);
    let x = if logarithmic { Axis::log(key, values) } else { Axis::linear(key, values, false) };
    Chart::new(x, Axis::spanning(&format!("share that {does}"), 0.0, 1.0, 5.0))
}

/// Draws shares of flights of several laws with a property over the values of a key, with 95 % intervals.
#[must_use]
pub fn shares(name: &str, key: &str, does: &str, series: &[(String, Vec<Share>)], logarithmic: bool) -> Figure {
    let mut chart = chart_of_shares(key, does, series.iter().flat_map(|(_, shares)| shares), logarithmic);
    for (k, (law, shares)) in series.iter().enumerate() {
        for share in shares {
            chart.interval(share.value, share.interval, Stroke::of_line(k));
        }
        chart.line(shares.iter().map(|share| (share.value, share.share)).collect(), Stroke::of_line(k), law.clone());
    }
    let title = format!("Share that {does} over {key}");
    let has_intervals = series.iter().flat_map(|(_, shares)| shares).any(|share| share.interval.is_some());
    let about = if has_intervals { "with 95 % intervals" } else { "one flight for each value" };
    chart.figure(name, &title, &format!("{title}, {about}."))
}

/// Smallest separations of the flights at one value of a key.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Separation {
    /// Value of the key.
    pub value: f64,
    /// Number of flights.
    pub flights: u64,
    /// Smallest over all flights \[m\].
    pub smallest_m: f64,
    /// Median of the flights \[m\].
    pub median_m: f64,
    /// 95 % interval of the median \[m\], if known.
    pub interval_m: Option<[f64; 2]>,
}

/// Draws smallest separations of flights over the values of a key, with the safety distance delta \[m\].
#[must_use]
pub fn separations(name: &str, key: &str, flights: &[Separation], delta_m: f64, logarithmic: bool) -> Figure {
    let mut chart = chart_of_separations(key, flights, delta_m, logarithmic);
    for of in flights {
        chart.interval(of.value, of.interval_m, Stroke::of_line(0));
    }
    let curve = |of: fn(&Separation) -> f64| flights.iter().map(|flight| (flight.value, of(flight))).collect();
    if flights.iter().any(|of| of.median_m != of.smallest_m) {
        chart.line(curve(|of| of.median_m), Stroke::of_line(0), "median of the flights");
    }
    let is_single = flights.iter().all(|of| of.flights <= 1);
    let smallest = if is_single { "one flight for each value" } else { "smallest of all flights" };
    chart.line(curve(|of| of.smallest_m), Stroke::of_line(1), smallest);
    for flight in flights {
        let at = (flight.value, flight.smallest_m);
        chart.marks.push(Mark { radius: 3.5, ..Mark::ring(at, Stroke::of_line(1).colour, None) });
    }
    chart.level(delta_m, Stroke::dashed(INK, 1.3), format!("delta = {} m", exact(delta_m)));
    let title = format!("Smallest separation over {key}");
    let about = if is_single {
        "one flight for each value"
    } else if flights.iter().any(|of| of.interval_m.is_some()) {
        "the median of the flights with its 95 % interval, and the smallest of all"
    } else {
        "the median of the flights, whose interval needs more flights, and the smallest of all"
    };
    chart.figure(name, &title, &format!("{title}: {about}."))
}

/// Counts of values in intervals of equal width.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Histogram {
    /// Lower end of the first interval.
    pub from: f64,
    /// Upper end of the last interval.
    pub to: f64,
    /// Count of each interval.
    pub counts: Vec<u64>,
}

impl Histogram {
    /// Counts the finite `values` in `intervals` between the smallest and the largest value. Returns `None` without a
    /// finite value.
    #[must_use]
    pub fn of(values: &[f64], intervals: usize) -> Option<Self> {
        let finite = || values.iter().copied().filter(|value| value.is_finite());
        let (from, to) = (finite().reduce(f64::min)?, finite().reduce(f64::max)?);
        let mut counts = vec![0; intervals.max(1)];
        let width = (to - from) / counts.len() as f64;
        let last = counts.len() - 1;
        for value in finite() {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "not negative, and small")]
            let place = if width > 0.0 { ((value - from) / width).floor() as usize } else { 0 };
            counts[place.min(last)] += 1;
        }
        Some(Self { from, to, counts })
    }

    /// Returns the outline of the bars as shares of `of`.
    fn outline(&self, of: u64) -> Vec<(f64, f64)> {
        let width = (self.to - self.from) / self.counts.len() as f64;
        let at = |number: usize| self.from + width * number as f64;
        let bars = self.counts.iter().enumerate().flat_map(|(number, &count)| {
            let share = count as f64 / of.max(1) as f64;
            [(at(number), share), (at(number + 1), share)]
        });
        std::iter::once((self.from, 0.0)).chain(bars).chain([(self.to, 0.0)]).collect()
    }
}

/// Draws histograms of several laws on one axis, as shares of each law's values, with an optional limit.
#[must_use]
pub fn histograms(
    name: &str,
    title: &str,
    label: &str,
    series: &[(String, Histogram)],
    limit: Option<(f64, &str)>,
) -> Figure {
    let ends = series.iter().flat_map(|(_, histogram)| [histogram.from, histogram.to]);
    let x = Axis::linear(label, ends.chain(limit.iter().map(|(at, _)| *at)), false);
    let outlines: Vec<_> = series.iter().map(|(_, of)| of.outline(of.counts.iter().sum())).collect();
    let highest = outlines.iter().flatten().map(|&(_, share)| share).fold(0.0, f64::max);
    let mut chart = Chart::new(x, Axis::spanning("share of flights", 0.0, highest.max(0.01), 5.0));
    for (k, (points, (law, _))) in std::iter::zip(outlines, series).enumerate() {
        chart.line(points, Stroke::of_line(k), law.clone());
    }
    if let Some((at, what)) = limit {
        chart.upright(at, Stroke::dashed(SOFT_INK, 1.0), Some(what.to_owned()));
    }
    let said = |(law, of): &(String, Histogram)| format!("{law} from {} to {}", separation(of.from), separation(of.to));
    let description = series.iter().map(said).collect::<Vec<_>>().join("; ");
    chart.figure(name, title, &format!("{title}: {description}."))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_each_finite_value_once() {
        let counted = Histogram::of(&[0.0, 0.9, 1.0, 3.9, 4.0, f64::NAN], 4).expect("numbers");
        assert_eq!((counted.from, counted.to, counted.counts.clone()), (0.0, 4.0, vec![2, 1, 0, 2]));
        assert_eq!(Histogram::of(&[2.0, 2.0], 3).expect("numbers").counts, [2, 0, 0]);
        assert_eq!(Histogram::of(&[f64::INFINITY], 3), None);
        assert!(counted.outline(5).iter().any(|&(x, share)| x == 1.0 && share == 0.4));
        let rounded = Histogram::of(&[0.0, 4.0009], 4).expect("numbers");
        let (series, limit) = ([("law".to_owned(), rounded)], Some((0.0, "delta")));
        let figure = histograms("h", "Clearance", "clearance [m]", &series, limit);
        assert!(figure.svg.contains("clearance [m]") && figure.svg.contains("delta"));
        assert_eq!(figure.description, "Clearance: law from 0.000 to 4.000.", "rounded down, as in tables");
    }
}
