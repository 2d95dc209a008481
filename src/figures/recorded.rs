//! Two vehicles of a recording: their distance over time, and their closest approach from above.

use super::axis::{Axis, Scale};
use super::chart::{Band, Chart, INK, Line, Mark, MarkShape, PALETTE, Stroke};
use super::{Figure, FigureError};

/// With the largest distance beyond this many limits the axis is logarithmic, or the limit could not be seen.
const LOG_FROM: f64 = 40.0;

/// Two vehicles over time.
#[derive(Clone, Debug, PartialEq)]
pub struct Encounter {
    /// Their names.
    pub names: [String; 2],
    /// Time \[s\], distance as drawn \[m\], and how much smaller or larger it can be \[m\].
    pub distances: Vec<(f64, f64, f64)>,
    /// Where each is over the same times, x and y \[m\].
    pub paths_m: [Vec<(f64, f64)>; 2],
    /// What the distance must not fall below \[m\].
    pub limit_m: f64,
    /// When they are closest \[s\], and how close \[m\].
    pub closest: (f64, f64),
}

/// Distances of pairs \[m\] over time \[s\] with the limit of the first, and bands where a distance is known to lie within
/// an interval alone.
///
/// # Errors
/// [`FigureError`] when the drawing library refuses.
pub fn encounters(encounters: &[Encounter], title: &str) -> Result<Figure, FigureError> {
    let all = || encounters.iter().flat_map(|encounter| &encounter.distances);
    let numbers: Vec<f64> = all().flat_map(|&(_, distance, slack)| [distance - slack, distance + slack]).collect();
    let limit_m = encounters.first().map_or(0.0, |first| first.limit_m);
    let largest = numbers.iter().copied().filter(|y| y.is_finite()).fold(limit_m, f64::max);
    let with_limit = numbers.iter().copied().chain([limit_m]);
    let y = if limit_m > 0.0 && largest > LOG_FROM * limit_m {
        Axis::log("distance [m]", with_limit.filter(|y| *y > 0.0))
    } else {
        Axis::linear("distance [m]", with_limit.chain([0.0]), true)
    };
    let from_s = all().map(|point| point.0).fold(f64::INFINITY, f64::min);
    let to_s = all().map(|point| point.0).fold(f64::NEG_INFINITY, f64::max);
    let x = if to_s > from_s {
        Axis::spanning("time [s]", from_s, to_s, 8.0)
    } else {
        let from_s = if from_s.is_finite() { from_s } else { 0.0 };
        Axis::spanning("time [s]", from_s, from_s + 1.0, 5.0)
    };
    let logarithmic = y.scale == Scale::Log;
    let mut chart = Chart::new(x, y);
    for (k, encounter) in encounters.iter().enumerate() {
        let [first, second] = &encounter.names;
        let stroke = Stroke::of_line(k);
        if encounter.distances.iter().any(|point| point.2 > 0.0) {
            // A logarithmic axis has no place for what may be zero.
            let least = if logarithmic { 10_f64.powf(chart.y.from) } else { 0.0 };
            let points =
                encounter.distances.iter().map(|&(t, d, slack)| (t, (d - slack).max(least), d + slack)).collect();
            chart.bands.push(Band { points, color: stroke.color, opacity: 0.22, label: None });
        }
        let points = encounter.distances.iter().map(|&(t, d, _)| (t, d)).collect();
        chart.lines.push(Line { points, stroke, label: Some(format!("{first} and {second}")) });
    }
    chart.level(limit_m, Stroke::solid(INK, 2.0), format!("limit {limit_m} m"));
    let mut words = String::new();
    if let Some(Encounter { names: [first, second], closest: (at_s, min_m), .. }) = encounters.first() {
        words = format!("{min_m:.6} m, {first} and {second} at {at_s:.3} s");
        let label = Some(format!("closest {words}"));
        let at = (*at_s, *min_m);
        chart.marks.push(Mark { at, shape: MarkShape::Ring, color: INK, size_px: 4.5, text: None, label });
    }
    let count = encounters.len();
    let description = format!("Distances of {count} pairs over time; the limit is {limit_m} m. Closest: {words}.");
    chart.figure("encounters", title, &description)
}

/// The paths of two vehicles from above \[m\], and where both are when they are closest.
///
/// # Errors
/// [`FigureError`] when the drawing library refuses.
pub fn closest_approach(encounter: &Encounter, title: &str) -> Result<Figure, FigureError> {
    let points = || encounter.paths_m.iter().flatten();
    let x = Axis::linear("x [m]", points().map(|point| point.0), false);
    let y = Axis::linear("y [m]", points().map(|point| point.1), false);
    let mut chart = Chart { equal: true, ..Chart::new(x, y) };
    let (at_s, min_m) = encounter.closest;
    let nearest = encounter
        .distances
        .iter()
        .enumerate()
        .min_by(|(_, a), (_, b)| (a.0 - at_s).abs().total_cmp(&(b.0 - at_s).abs()))
        .map(|(k, _)| k);
    let places = encounter.paths_m.each_ref().map(|path| nearest.and_then(|k| path.get(k).copied()));
    for (k, (path, name)) in encounter.paths_m.iter().zip(&encounter.names).enumerate() {
        let label = Some(name.clone());
        chart.lines.push(Line { points: path.clone(), stroke: Stroke::solid(PALETTE[k], 1.6), label });
        if let Some(at) = places[k] {
            let color = PALETTE[k];
            chart.marks.push(Mark { at, shape: MarkShape::Ring, color, size_px: 4.5, text: None, label: None });
        }
    }
    if let [Some(one), Some(other)] = places {
        let label = Some(format!("{min_m:.6} m apart at {at_s:.3} s"));
        chart.lines.push(Line { points: vec![one, other], stroke: Stroke::dashed(INK, 1.4), label });
    }
    let [first, second] = &encounter.names;
    let description = format!(
        "Paths of {first} and {second} from above; rings where they are closest, {min_m:.6} m apart at {at_s:.3} s."
    );
    chart.figure("closest-approach", title, &description)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn encounter(slack_m: f64) -> Encounter {
        let times = (0..=20).map(|k| 0.1 * f64::from(k));
        Encounter {
            names: ["alpha".to_owned(), "bravo".to_owned()],
            distances: times.clone().map(|t| (t, (10.0 * t - 10.0).hypot(1.0), slack_m)).collect(),
            paths_m: [times.clone().map(|t| (5.0 * t, 0.0)).collect(), times.map(|t| (10.0 - 5.0 * t, 1.0)).collect()],
            limit_m: 2.0,
            closest: (1.0, 1.0),
        }
    }

    #[test]
    fn a_figure_names_both_and_their_closest_and_shows_a_band_where_there_is_doubt() {
        let sure = encounters(&[encounter(0.0)], "Distance").unwrap();
        let doubtful = encounters(&[encounter(0.5)], "Distance").unwrap();
        assert!(sure.svg.contains("alpha and bravo") && sure.svg.contains("closest 1.000000 m"));
        assert!(doubtful.svg.matches("<polygon").count() > sure.svg.matches("<polygon").count());
        let seen = closest_approach(&encounter(0.0), "Closest approach").unwrap();
        assert!(seen.svg.contains("alpha") && seen.svg.contains("1.000000 m apart at 1.000 s"));
    }

    #[test]
    fn nothing_to_draw_and_impossible_numbers_make_a_figure_all_the_same() {
        assert!(encounters(&[], "Distance").is_ok());
        let mut odd = encounter(f64::NAN);
        odd.distances.push((f64::INFINITY, -1.0, 0.0));
        odd.limit_m = 1e-9;
        assert!(encounters(&[odd.clone()], "Distance").is_ok());
        odd.paths_m = [vec![], vec![]];
        assert!(closest_approach(&odd, "Closest approach").is_ok());
    }
}
