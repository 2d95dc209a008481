//! Figures of a pair of a recording: distance over time, and closest approach from above.

use super::Figure;
use super::axis::{Axis, Scale, extent};
use super::chart::{Chart, Inset, Mark, Shape};
use super::svg::Stroke;
use crate::drawing::colours::{INK, VEHICLES};
use tautline_core::text::up_to;

/// Width of the inset of a closest approach, relative to the distance in the plane.
const NEAR: f64 = 4.0;

/// Distance of a pair, or of a vehicle and an obstacle, over time.
#[derive(Clone, Debug, PartialEq)]
pub struct Encounter {
    /// Both names.
    pub names: [String; 2],
    /// Unit of distances: `m` or `ellipsoids`.
    pub unit: &'static str,
    /// Time \[s\], distance as drawn, and its uncertainty. A distance that is NaN breaks the line.
    pub distances: Vec<(f64, f64, f64)>,
    /// Positions of both over the same times, x and y \[m\].
    pub paths_m: [Vec<(f64, f64)>; 2],
    /// Limit of the distance.
    pub limit_m: f64,
    /// Time of the closest approach of the drawn motion \[s\].
    pub closest_s: f64,
    /// Smallest distance in words, with the unit.
    pub closest: String,
}

impl Encounter {
    /// Returns the index of the closest drawn instant.
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

/// Draws distances over time \[s\] with the limit of the first pair, and bands where a distance is known to an interval
/// only.
#[must_use]
pub fn encounters(encounters: &[Encounter], name: &str, title: &str) -> Figure {
    let all = || encounters.iter().flat_map(|encounter| &encounter.distances);
    let (limit, unit) = encounters.first().map_or((0.0, "m"), |first| (first.limit_m, first.unit));
    // Distances are negative only inside an obstacle.
    let least = if all().any(|point| point.1 < 0.0) { f64::NEG_INFINITY } else { 0.0 };
    let numbers = all().flat_map(|&(_, distance, slack)| [(distance - slack).max(least), distance + slack]);
    let y = Axis::distances(unit, &numbers.chain([limit]).collect::<Vec<_>>(), limit);
    let (from_s, to_s) = extent(all().map(|point| point.0)).unwrap_or((0.0, 0.0));
    // A logarithmic axis cannot show a lower bound of zero.
    let least = if y.scale == Scale::Log { 10_f64.powf(y.from) } else { least };
    let mut chart = Chart::new(Axis::time(from_s, to_s), y);
    for (k, encounter) in encounters.iter().enumerate() {
        let [first, second] = &encounter.names;
        uncertain_line(&mut chart, k, &encounter.distances, least, format!("{first} and {second}"));
    }
    chart.level(limit, Stroke::solid(INK, 2.0), format!("limit {limit:?} {unit}"));
    let mut description = format!("{title} over time; the limit is {limit:?} {unit}.");
    if let Some(encounter) = encounters.first() {
        let [first, second] = &encounter.names;
        let closest = encounter.closest();
        description.extend([" Closest: ", first, " and ", second, ", ", &closest, "."]);
        let drawn = encounter.nearest().map_or(f64::NAN, |k| encounter.distances[k].1);
        chart.marks.push(Mark::ring((encounter.closest_s, drawn), INK, Some(format!("closest {closest}"))));
    }
    chart.figure(name, title, &description)
}

/// Adds the `k`-th line through points (time, distance, uncertainty), with bands where the distance is uncertain, which
/// end at `least`.
fn uncertain_line(chart: &mut Chart, k: usize, points: &[(f64, f64, f64)], least: f64, label: String) {
    let stroke = Stroke::of_line(k);
    for known in points.split(|point| point.1.is_nan()).filter(|known| known.iter().any(|point| point.2 > 0.0)) {
        let points: Vec<_> = known.iter().map(|&(t, d, slack)| (t, (d - slack).max(least), d + slack)).collect();
        chart.shapes.push(Shape::band(&points, stroke.colour, 0.22, None));
    }
    chart.line(points.iter().map(|&(t, d, _)| (t, d)).collect(), stroke, label);
}

/// Lower bound of a distance in an interval of time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LowerBound {
    /// Start and end of the interval \[s\]; equal for an instant.
    pub interval_s: [f64; 2],
    /// No pair is closer in the interval.
    pub distance: f64,
}

/// Draws the smallest separation of all pairs in each interval of time \[s\] as steps. Also draws the limit and the
/// closest approach of the closest pair. Steps never lie above the separation; a line through the closest approaches
/// may. Steps break where no distance is known.
#[must_use]
pub fn smallest(bounds: &[LowerBound], closest: &Encounter, title: &str) -> Figure {
    let Encounter { limit_m: limit, unit, .. } = *closest;
    let points = steps(bounds);
    let times_s = points.iter().map(|point| point.0).chain(closest.distances.iter().map(|point| point.0));
    let (from_s, to_s) = extent(times_s).unwrap_or((0.0, 0.0));
    let numbers: Vec<_> = points.iter().map(|point| point.1).chain([limit]).collect();
    let mut chart = Chart::new(Axis::time(from_s, to_s), Axis::distances(unit, &numbers, limit));
    let least = bounds.iter().map(|bound| bound.distance).min_by(f64::total_cmp);
    chart.line(points, Stroke::solid(VEHICLES[0], 1.5), "smallest in each interval");
    chart.level(limit, Stroke::solid(INK, 2.0), format!("limit {limit:?} {unit}"));
    let words = closest.closest();
    let ring = |least| Mark::ring((closest.closest_s, least), INK, Some(format!("closest {words}")));
    chart.marks.extend(least.map(ring));
    let description = format!(
        "Smallest separation of all pairs in each interval of time, in steps; closest {words}, limit {limit:?} {unit}."
    );
    chart.figure("smallest", title, &description)
}

/// Returns the corners of steps, with a break before each interval that does not touch the previous one.
fn steps(bounds: &[LowerBound]) -> Vec<(f64, f64)> {
    let mut points = Vec::with_capacity(2 * bounds.len());
    let mut end_s = f64::NEG_INFINITY;
    for &LowerBound { interval_s: [from_s, to_s], distance } in bounds {
        if from_s > end_s && !points.is_empty() {
            points.push((f64::NAN, f64::NAN));
        }
        points.extend([(from_s, distance), (to_s, distance)]);
        end_s = to_s;
    }
    points
}

/// Smallest distance seen from above, as a share of the width of the paths, that an inset enlarges. Below, as when one
/// vehicle passes over the other, the direction between the two is rounding.
const LEAST_SHARE: f64 = 1e-4;

/// Draws the paths of two vehicles from above \[m\] and their positions at the closest approach. An inset enlarges that
/// approach; it is four times the distance wide.
#[must_use]
pub fn closest_approach(encounter: &Encounter, title: &str) -> Figure {
    let points = || encounter.paths_m.iter().flatten();
    let x = Axis::linear("x [m]", points().map(|point| point.0), false);
    let y = Axis::linear("y [m]", points().map(|point| point.1), false);
    let mut chart = Chart::new(x, y);
    chart.make_equal();
    let nearest = encounter.nearest();
    let places = encounter.paths_m.each_ref().map(|path| nearest.and_then(|k| path.get(k).copied()));
    for (k, (path, name)) in encounter.paths_m.iter().zip(&encounter.names).enumerate() {
        chart.line(path.clone(), Stroke::solid(VEHICLES[k], 1.6), name.clone());
        chart.marks.extend(places[k].map(|at| Mark::ring(at, VEHICLES[k], None)));
    }
    let closest = encounter.closest();
    if let [Some(one), Some(other)] = places {
        chart.line(vec![one, other], Stroke::dashed(INK, 1.4), format!("closest {closest}"));
        let middle = (f64::midpoint(one.0, other.0), f64::midpoint(one.1, other.1));
        let apart = (one.0 - other.0).hypot(one.1 - other.1);
        let spans = [extent(points().map(|point| point.0)), extent(points().map(|point| point.1))];
        let width = spans.into_iter().flatten().map(|(from, to)| to - from).fold(0.0, f64::max);
        let inset = Inset { middle, half: 0.5 * NEAR * apart };
        chart.inset = (apart > LEAST_SHARE * width).then_some(inset);
    }
    let [first, second] = &encounter.names;
    let description = format!("Paths of {first} and {second} from above; rings where they are closest, {closest}.");
    chart.figure("closest-approach", title, &description)
}

/// Largest number of vehicles with a line of their distance from the plan.
const DRAWN: usize = 6;

/// Name of a vehicle, and time \[s\], distance from its plan \[m\] and the uncertainty of the distance \[m\].
pub type PlanLine<'a> = (String, &'a [(f64, f64, f64)]);

/// Draws distances from the plan over time \[s\] with the tube \[m\], and bands where a distance is known to an
/// interval only. `lines` holds name, time, distance and its uncertainty of each vehicle, the farthest first; the first
/// six are drawn. A distance that is NaN breaks the line.
#[must_use]
pub fn plan_distances(lines: &[PlanLine<'_>], tube_m: Option<f64>, title: &str) -> Figure {
    let all = || lines.iter().take(DRAWN).flat_map(|(_, points)| points.iter());
    let numbers = all().flat_map(|&(_, distance, slack)| [distance, distance + slack]);
    let y = Axis::linear("distance from the plan [m]", numbers.chain(tube_m).chain([0.0]), true);
    let (from_s, to_s) = extent(all().map(|point| point.0)).unwrap_or((0.0, 0.0));
    let mut chart = Chart::new(Axis::time(from_s, to_s), y);
    for (k, (name, points)) in lines.iter().take(DRAWN).enumerate() {
        uncertain_line(&mut chart, k, points, 0.0, name.clone());
    }
    if let Some(tube_m) = tube_m {
        chart.level(tube_m, Stroke::solid(INK, 2.0), format!("tube {tube_m:?} m"));
    }
    let most = all().map(|point| point.1 + point.2).filter(|m| m.is_finite()).fold(0.0, f64::max);
    let (count, drawn) = (lines.len(), lines.len().min(DRAWN));
    let description =
        format!("{title} over time, of {drawn} of {count} vehicles with the largest; at most {} m.", up_to(most));
    chart.figure("plan", title, &description)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figures::Format;

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
    fn figure_names_both_and_shows_uncertainty_as_a_band() {
        let sure = encounters(&[encounter(0.0)], "encounters", "Distance");
        let doubtful = encounters(&[encounter(0.5)], "encounters", "Distance");
        assert!(sure.svg.contains("alpha and bravo") && sure.svg.contains("closest 1.000000 m"));
        assert!(doubtful.svg.matches("<polygon").count() > sure.svg.matches("<polygon").count());
        let seen = closest_approach(&encounter(0.0), "Closest approach");
        assert!(seen.svg.contains("alpha") && seen.svg.contains("closest 1.000000 m at 1.000 s"));
    }

    #[test]
    fn a_vertical_approach_has_no_inset_and_becomes_a_picture() {
        let above = |aside_m: f64| {
            let mut seen = encounter(0.0);
            // The paths cross at right angles, with this distance from above.
            seen.paths_m[1] = (0..=20).map(|k| (5.0 + aside_m, 0.5 * f64::from(k) - 5.0)).collect();
            closest_approach(&seen, "Closest approach")
        };
        let frames = |figure: &Figure| figure.svg.matches("<svg x=").count();
        for (aside_m, insets) in [(1e-15, 0), (0.0, 0), (1.1e-3, 1), (0.05, 1)] {
            let figure = above(aside_m);
            assert_eq!(frames(&figure), insets, "{aside_m}: {}", figure.svg);
            assert!(figure.file(Format::Png).starts_with(b"\x89PNG"));
        }
    }

    #[test]
    fn steps_cover_each_interval_and_break_between_intervals_that_do_not_touch() {
        let bound = |from_s: f64, to_s: f64, distance: f64| LowerBound { interval_s: [from_s, to_s], distance };
        let bounds = [bound(0.0, 1.0, 5.0), bound(1.0, 2.0, 3.0), bound(4.0, 5.0, 6.0), bound(7.0, 7.0, 2.0)];
        let found = steps(&bounds);
        let (known, breaks): (Vec<_>, Vec<_>) = found.iter().copied().partition(|(time_s, _)| time_s.is_finite());
        assert_eq!(breaks.len(), 2);
        let expected = [(0.0, 5.0), (1.0, 5.0), (1.0, 3.0), (2.0, 3.0), (4.0, 6.0), (5.0, 6.0), (7.0, 2.0), (7.0, 2.0)];
        assert_eq!(known, expected);
        let drawn = smallest(&bounds, &encounter(0.0), "Smallest separation").svg;
        assert!(drawn.contains("smallest in each interval") && drawn.contains("closest 1.000000 m at 1.000 s"));
    }

    #[test]
    fn gaps_break_the_line_and_scaled_distances_have_their_unit() {
        let closest = "1.000000 ellipsoids".to_owned();
        let whole = Encounter { unit: "ellipsoids", closest, ..encounter(0.5) };
        let mut broken = whole.clone();
        broken.distances.insert(10, (1.0, f64::NAN, 0.0));
        broken.paths_m.iter_mut().for_each(|path| path.insert(10, (f64::NAN, f64::NAN)));
        let shapes = |encounter: &Encounter, shape: &str| {
            let drawn = encounters(std::slice::from_ref(encounter), "encounters", "Distance");
            drawn.svg.matches(shape).count()
        };
        for shape in ["<polygon", "<polyline"] {
            assert_eq!(shapes(&broken, shape), shapes(&whole, shape) + 1, "{shape}");
        }
        let drawn = encounters(&[whole], "encounters", "Distance").svg;
        assert!(drawn.contains("distance [ellipsoids]") && !drawn.contains(" m "), "{drawn}");
    }

    #[test]
    fn empty_and_non_finite_input_gives_a_figure() {
        assert!(encounters(&[], "encounters", "Distance").svg.contains("distance [m]"));
        let mut odd = encounter(f64::NAN);
        odd.distances.push((f64::INFINITY, -1.0, 0.0));
        odd.limit_m = 1e-9;
        let drawn = |figure: Figure| !figure.svg.contains("=\"NaN") && !figure.svg.contains("inf,");
        assert!(drawn(encounters(std::slice::from_ref(&odd), "encounters", "Distance")));
        odd.paths_m = [vec![], vec![]];
        assert!(drawn(closest_approach(&odd, "Closest approach")));
    }
}
