//! What else is known of each vehicle, over time.

use super::axis::Axis;
use super::beside::{ROTORS, SERIES};
use super::chart::Chart;
use super::each::of_each;
use super::figure::Figure;
use super::history::RunHistory;
use super::svg::{INK, Stroke};

/// Tilt \[degrees\], largest thrust of a rotor \[N\], wind speed \[m/s\] and age of the oldest message \[s\] of each vehicle
/// over time \[s\], as control effort is drawn: each of them that the run has a channel for.
///
/// `most_thrust_n` is the most that a rotor gives.
#[must_use]
pub fn channels(history: &RunHistory, most_thrust_n: Option<f64>) -> Vec<Figure> {
    let has = |k: &usize| history.spans().any(|span| !span.beside[*k].is_empty());
    (0..SERIES.len()).filter(has).map(|k| figure(history, k, most_thrust_n)).collect()
}

fn figure(history: &RunHistory, k: usize, most_thrust_n: Option<f64>) -> Figure {
    let series = &SERIES[k];
    let (what, unit, count) = (series.what, series.unit, history.vehicles());
    let most = most_thrust_n.filter(|_| series.name == ROTORS);
    let numbers = || history.spans().flat_map(|span| &span.beside[k]).copied().filter(|number| number.is_finite());
    let peak = numbers().fold(f64::NAN, f64::max);
    let y = Axis::linear(&format!("{what} [{unit}]"), numbers().chain(most).chain([0.0]), true);
    let mut chart = Chart::new(history.time_axis(), y);
    of_each(&mut chart, history, |span| &span.beside[k]);
    let gap = if unit == "°" { "" } else { " " };
    let mut description = format!("The {what} of {count} vehicles over time; at most {peak:.3}{gap}{unit}.");
    if let Some(most) = most {
        chart.level(most, Stroke::dashed(INK, 1.3), format!("most of a rotor {most} N"));
        description = format!("{description} A rotor gives at most {most} N.");
    }
    chart.figure(series.name, series.title, &description)
}
