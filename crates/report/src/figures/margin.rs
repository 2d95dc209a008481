//! Shares and separations of flights over the values of a key.

use super::Figure;
use super::axis::Axis;
use super::chart::{Chart, Line, Mark};
use super::svg::{INK, Marker, PALETTE, SOFT_INK, Stroke};
use tautline_core::text::metres;

/// The flights of one value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Share {
    /// The value.
    pub value: f64,
    /// The share that showed what was asked, from 0 to 1.
    pub share: f64,
    /// Its 95 % interval, where there is one.
    pub interval: Option<[f64; 2]>,
}

/// Shares of flights that show something (`does`) over the values of a key, with their 95 % intervals and the bracket in which
/// the verdict turns, and values that are `predicted`, each with what it is. The axis is logarithmic where asked.
#[must_use]
pub fn margin(
    shares: &[Share],
    key: &str,
    does: &str,
    bracket: Option<[f64; 2]>,
    predicted: &[(f64, String)],
    logarithmic: bool,
) -> Figure {
    let values = shares.iter().map(|share| share.value);
    let x = if logarithmic { Axis::log(key, values) } else { Axis::linear(key, values, false) };
    let mut chart = Chart::new(x, Axis::spanning(&format!("share that {does}"), 0.0, 1.0, 5.0));
    for share in shares {
        let ends = share.interval.into_iter().flatten().map(|end| (share.value, end));
        chart.lines.push(Line { points: ends.collect(), stroke: Stroke::solid(PALETTE[0], 1.2), label: None });
    }
    let marks = shares.iter().enumerate().map(|(k, share)| Mark {
        at: (share.value, share.share),
        marker: Marker::Ring,
        colour: PALETTE[0],
        radius: 3.5,
        text: None,
        label: (k == 0)
            .then(|| if share.interval.is_some() { "with its 95 % interval" } else { "one flight" }.to_owned()),
    });
    chart.marks.extend(marks);
    for (k, side) in bracket.into_iter().flatten().enumerate() {
        chart.lines.push(Line {
            points: vec![(side, 0.0), (side, 1.0)],
            stroke: Stroke::dashed(SOFT_INK, 1.0),
            label: (k == 0).then(|| "the verdict turns in between".to_owned()),
        });
    }
    for (k, (value, what)) in predicted.iter().enumerate() {
        let points = vec![(*value, 0.0), (*value, 1.0)];
        chart.line(points, Stroke::dashed(PALETTE[1 + k % 2], 1.5), format!("predicted {what}"));
    }
    let description = match bracket {
        Some([low, high]) => format!("The share that {does} over {key}; the verdict turns between {low} and {high}."),
        None => format!("The share that {does} over {key}; the verdict does not turn."),
    };
    chart.figure("margin", &format!("Share that {does}"), &description)
}

/// Shares of flights of several laws that show something over the values of a key, with their 95 % intervals.
#[must_use]
pub fn shares(name: &str, key: &str, does: &str, series: &[(String, Vec<Share>)], logarithmic: bool) -> Figure {
    let values = series.iter().flat_map(|(_, shares)| shares.iter().map(|share| share.value));
    let x = if logarithmic { Axis::log(key, values) } else { Axis::linear(key, values, false) };
    let mut chart = Chart::new(x, Axis::spanning(&format!("share that {does}"), 0.0, 1.0, 5.0));
    for (k, (law, shares)) in series.iter().enumerate() {
        for share in shares {
            let ends = share.interval.into_iter().flatten().map(|end| (share.value, end));
            chart.lines.push(Line { points: ends.collect(), stroke: Stroke::of_line(k), label: None });
        }
        chart.line(shares.iter().map(|share| (share.value, share.share)).collect(), Stroke::of_line(k), law.clone());
    }
    let title = format!("Share that {does} over {key}");
    chart.figure(name, &title, &format!("{title}, with 95 % intervals."))
}

/// The smallest separations of the flights of one value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Separation {
    /// The value.
    pub value: f64,
    /// Smallest of all flights \[m\].
    pub smallest_m: f64,
    /// Median of the flights \[m\].
    pub median_m: f64,
    /// Its 95 % interval \[m\], where there is one.
    pub interval_m: Option<[f64; 2]>,
}

/// Smallest separations of flights over the values of a key, with the safety distance delta \[m\].
#[must_use]
pub fn separations(name: &str, key: &str, flights: &[Separation], delta_m: f64) -> Figure {
    let lengths = flights
        .iter()
        .flat_map(|of| [of.smallest_m, of.median_m].into_iter().chain(of.interval_m.into_iter().flatten()));
    let x = Axis::linear(key, flights.iter().map(|of| of.value), false);
    let mut chart = Chart::new(x, Axis::linear("smallest separation [m]", lengths.chain([delta_m]), true));
    for of in flights {
        let ends = of.interval_m.into_iter().flatten().map(|end| (of.value, end));
        chart.lines.push(Line { points: ends.collect(), stroke: Stroke::of_line(0), label: None });
    }
    let curve = |of: fn(&Separation) -> f64| flights.iter().map(|flight| (flight.value, of(flight))).collect();
    chart.line(curve(|of| of.median_m), Stroke::of_line(0), "median of the flights");
    chart.line(curve(|of| of.smallest_m), Stroke::of_line(1), "smallest of all flights");
    chart.level(delta_m, Stroke::dashed(INK, 1.3), format!("delta = {} m", metres(delta_m)));
    let title = format!("Smallest separation over {key}");
    chart.figure(
        name,
        &title,
        &format!("{title}: the median of the flights with its 95 % interval, and the smallest of all."),
    )
}
