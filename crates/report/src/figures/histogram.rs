//! How often numbers of many flights fall where.

use super::Figure;
use super::axis::Axis;
use super::chart::{Chart, Line};
use super::svg::{SOFT_INK, Stroke};

/// Numbers of one kind counted in intervals of one width.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Histogram {
    /// Lower end of the first interval.
    pub from: f64,
    /// Upper end of the last.
    pub to: f64,
    /// How many fell into each.
    pub counts: Vec<u64>,
}

impl Histogram {
    /// Counts the finite ones of `values` in so many intervals between the smallest and the largest; none of none.
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

    /// The outline of its bars as shares of `of`.
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

/// Histograms of several laws over one axis, as shares of each law's numbers, with a limit where there is one.
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
        let points = vec![(at, 0.0), (at, highest.max(0.01))];
        chart.lines.push(Line { points, stroke: Stroke::dashed(SOFT_INK, 1.0), label: Some(what.to_owned()) });
    }
    let said = |(law, of): &(String, Histogram)| format!("{law} from {:.3} to {:.3}", of.from, of.to);
    let description = series.iter().map(said).collect::<Vec<_>>().join("; ");
    chart.figure(name, title, &format!("{title}: {description}."))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_finite_number_is_counted_once_the_largest_in_the_last_interval() {
        let counted = Histogram::of(&[0.0, 0.9, 1.0, 3.9, 4.0, f64::NAN], 4).expect("numbers");
        assert_eq!((counted.from, counted.to, counted.counts.clone()), (0.0, 4.0, vec![2, 1, 0, 2]));
        assert_eq!(Histogram::of(&[2.0, 2.0], 3).expect("numbers").counts, [2, 0, 0]);
        assert_eq!(Histogram::of(&[f64::INFINITY], 3), None);
        assert!(counted.outline(5).iter().any(|&(x, share)| x == 1.0 && share == 0.4));
        let figure =
            histograms("h", "Clearance", "clearance [m]", &[("law".to_owned(), counted)], Some((0.0, "delta")));
        assert!(figure.svg.contains("clearance [m]") && figure.svg.contains("delta"));
    }
}
