//! Two of a recording: their distance over time, and their closest approach from above.

use super::axis::{Axis, Scale};
use super::chart::{Band, Chart, INK, Line, Mark, MarkShape, PALETTE, Stroke};
use super::{Figure, FigureError};

/// With the largest distance beyond this many limits the axis is logarithmic, or the limit could not be seen.
const LOG_FROM: f64 = 40.0;

/// Two over time.
#[derive(Clone, Debug, PartialEq)]
pub struct Encounter {
    /// Their names.
    pub names: [String; 2],
    /// What distances are counted in: `m`, or `ellipsoids`.
    pub unit: &'static str,
    /// Time \[s\], distance as drawn, and how much smaller or larger it can be. Nothing is drawn across a distance that is
    /// no number.
    pub distances: Vec<(f64, f64, f64)>,
    /// Where each is over the same times, x and y \[m\].
    pub paths_m: [Vec<(f64, f64)>; 2],
    /// What the distance must not fall below.
    pub limit_m: f64,
    /// When the motion as drawn is closest \[s\].
    pub closest_s: f64,
    /// How close in words, with the unit.
    pub closest: String,
}

impl Encounter {
    /// The moment that is drawn closest.
    fn nearest(&self) -> Option<usize> {
        let off =
            |point: &(f64, f64, f64)| if point.1.is_nan() { f64::INFINITY } else { (point.0 - self.closest_s).abs() };
        let moments = self.distances.iter().enumerate();
        moments.min_by(|(_, a), (_, b)| off(a).total_cmp(&off(b))).map(|(k, _)| k)
    }

    fn closest(&self) -> String {
        format!("{} at {:.3} s", self.closest, self.closest_s)
    }
}

/// Distances over time \[s\] with the limit of the first, and bands where a distance is known to lie within an interval
/// alone.
///
/// # Errors
/// [`FigureError`] when the drawing library refuses.
pub fn encounters(encounters: &[Encounter], name: &str, title: &str) -> Result<Figure, FigureError> {
    let all = || encounters.iter().flat_map(|encounter| &encounter.distances);
    let numbers: Vec<f64> = all().flat_map(|&(_, distance, slack)| [distance - slack, distance + slack]).collect();
    let (limit, unit) = encounters.first().map_or((0.0, "m"), |first| (first.limit_m, first.unit));
    let largest = numbers.iter().copied().filter(|y| y.is_finite()).fold(limit, f64::max);
    let with_limit = numbers.iter().copied().chain([limit]);
    // Within an obstacle distances are below zero.
    let within = all().any(|point| point.1 < 0.0);
    let label = format!("distance [{unit}]");
    let y = if limit > 0.0 && !within && largest > LOG_FROM * limit {
        Axis::log(&label, with_limit.filter(|y| *y > 0.0))
    } else {
        Axis::linear(&label, with_limit.chain([0.0]), true)
    };
    let from_s = all().map(|point| point.0).fold(f64::INFINITY, f64::min);
    let to_s = all().map(|point| point.0).fold(f64::NEG_INFINITY, f64::max);
    let x = if to_s > from_s {
        Axis::spanning("time [s]", from_s, to_s, 8.0)
    } else {
        let from_s = if from_s.is_finite() { from_s } else { 0.0 };
        Axis::spanning("time [s]", from_s, from_s + 1.0, 5.0)
    };
    // A logarithmic axis has no place for what may be zero.
    let least = match y.scale {
        Scale::Log => 10_f64.powf(y.from),
        Scale::Linear if within => f64::NEG_INFINITY,
        Scale::Linear => 0.0,
    };
    let mut chart = Chart::new(x, y);
    for (k, encounter) in encounters.iter().enumerate() {
        let [first, second] = &encounter.names;
        let stroke = Stroke::of_line(k);
        for known in encounter.distances.split(|point| point.1.is_nan()) {
            if known.iter().any(|point| point.2 > 0.0) {
                let points = known.iter().map(|&(t, d, slack)| (t, (d - slack).max(least), d + slack)).collect();
                chart.bands.push(Band { points, color: stroke.color, opacity: 0.22, label: None });
            }
        }
        let points = encounter.distances.iter().map(|&(t, d, _)| (t, d)).collect();
        chart.lines.push(Line { points, stroke, label: Some(format!("{first} and {second}")) });
    }
    chart.level(limit, Stroke::solid(INK, 2.0), format!("limit {limit:?} {unit}"));
    let mut words = String::new();
    if let Some(encounter) = encounters.first() {
        let [first, second] = &encounter.names;
        words = format!(" Closest: {first} and {second}, {}.", encounter.closest());
        let drawn = encounter.nearest().map_or(f64::NAN, |k| encounter.distances[k].1);
        let (at, label) = ((encounter.closest_s, drawn), Some(format!("closest {}", encounter.closest())));
        chart.marks.push(Mark { at, shape: MarkShape::Ring, color: INK, size_px: 4.5, text: None, label });
    }
    let description = format!("{title} over time; the limit is {limit:?} {unit}.{words}");
    chart.figure(name, title, &description)
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
    let nearest = encounter.nearest();
    let places = encounter.paths_m.each_ref().map(|path| nearest.and_then(|k| path.get(k).copied()));
    for (k, (path, name)) in encounter.paths_m.iter().zip(&encounter.names).enumerate() {
        let label = Some(name.clone());
        chart.lines.push(Line { points: path.clone(), stroke: Stroke::solid(PALETTE[k], 1.6), label });
        if let Some(at) = places[k] {
            let color = PALETTE[k];
            chart.marks.push(Mark { at, shape: MarkShape::Ring, color, size_px: 4.5, text: None, label: None });
        }
    }
    let closest = encounter.closest();
    if let [Some(one), Some(other)] = places {
        let label = Some(format!("closest {closest}"));
        chart.lines.push(Line { points: vec![one, other], stroke: Stroke::dashed(INK, 1.4), label });
    }
    let [first, second] = &encounter.names;
    let description = format!("Paths of {first} and {second} from above; rings where they are closest, {closest}.");
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
            unit: "m",
            limit_m: 2.0,
            closest_s: 1.0,
            closest: "1.000000 m".to_owned(),
        }
    }

    #[test]
    fn a_figure_names_both_and_their_closest_and_shows_a_band_where_there_is_doubt() {
        let sure = encounters(&[encounter(0.0)], "encounters", "Distance").unwrap();
        let doubtful = encounters(&[encounter(0.5)], "encounters", "Distance").unwrap();
        assert!(sure.svg.contains("alpha and bravo") && sure.svg.contains("closest 1.000000 m"));
        assert!(doubtful.svg.matches("<polygon").count() > sure.svg.matches("<polygon").count());
        let seen = closest_approach(&encounter(0.0), "Closest approach").unwrap();
        assert!(seen.svg.contains("alpha") && seen.svg.contains("closest 1.000000 m at 1.000 s"));
    }

    #[test]
    fn nothing_is_drawn_across_a_gap_and_scaled_distances_are_no_metres() {
        let closest = "1.000000 ellipsoids".to_owned();
        let whole = Encounter { unit: "ellipsoids", closest, ..encounter(0.5) };
        let mut broken = whole.clone();
        broken.distances.insert(10, (1.0, f64::NAN, 0.0));
        broken.paths_m.iter_mut().for_each(|path| path.insert(10, (f64::NAN, f64::NAN)));
        let shapes = |encounter: &Encounter, shape: &str| {
            let drawn = encounters(std::slice::from_ref(encounter), "encounters", "Distance").unwrap();
            drawn.svg.matches(shape).count()
        };
        for shape in ["<polygon", "<polyline"] {
            assert_eq!(shapes(&broken, shape), shapes(&whole, shape) + 1, "{shape}");
        }
        let drawn = encounters(&[whole], "encounters", "Distance").unwrap().svg;
        assert!(drawn.contains("distance [ellipsoids]") && !drawn.contains(" m "), "{drawn}");
    }

    #[test]
    fn nothing_to_draw_and_impossible_numbers_make_a_figure_all_the_same() {
        assert!(encounters(&[], "encounters", "Distance").is_ok());
        let mut odd = encounter(f64::NAN);
        odd.distances.push((f64::INFINITY, -1.0, 0.0));
        odd.limit_m = 1e-9;
        assert!(encounters(&[odd.clone()], "encounters", "Distance").is_ok());
        odd.paths_m = [vec![], vec![]];
        assert!(closest_approach(&odd, "Closest approach").is_ok());
    }
}
