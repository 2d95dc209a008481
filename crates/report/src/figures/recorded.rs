//! Two of a recording: their distance over time, and their closest approach from above.

use super::Figure;
use super::axis::{Axis, Scale, extent};
use super::chart::{Band, Chart, Inset, Mark};
use super::svg::{INK, PALETTE, Stroke};

/// Width of the inset of a closest approach, over the distance as it is seen from above.
const NEAR: f64 = 4.0;

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
#[must_use]
pub fn encounters(encounters: &[Encounter], name: &str, title: &str) -> Figure {
    let all = || encounters.iter().flat_map(|encounter| &encounter.distances);
    let (limit, unit) = encounters.first().map_or((0.0, "m"), |first| (first.limit_m, first.unit));
    // Only within an obstacle are distances below zero.
    let least = if all().any(|point| point.1 < 0.0) { f64::NEG_INFINITY } else { 0.0 };
    let numbers = all().flat_map(|&(_, distance, slack)| [(distance - slack).max(least), distance + slack]);
    let y = Axis::distances(unit, &numbers.chain([limit]).collect::<Vec<_>>(), limit);
    let (from_s, to_s) = extent(all().map(|point| point.0)).unwrap_or((0.0, 0.0));
    // A logarithmic axis has no place for what may be zero.
    let least = if y.scale == Scale::Log { 10_f64.powf(y.from) } else { least };
    let mut chart = Chart::new(Axis::time(from_s, to_s), y);
    for (k, encounter) in encounters.iter().enumerate() {
        let [first, second] = &encounter.names;
        let stroke = Stroke::of_line(k);
        for known in encounter.distances.split(|point| point.1.is_nan()) {
            if known.iter().any(|point| point.2 > 0.0) {
                let points = known.iter().map(|&(t, d, slack)| (t, (d - slack).max(least), d + slack)).collect();
                chart.bands.push(Band { points, colour: stroke.colour, opacity: 0.22, label: None });
            }
        }
        let points = encounter.distances.iter().map(|&(t, d, _)| (t, d)).collect();
        chart.line(points, stroke, format!("{first} and {second}"));
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

/// The smallest distance of all over time \[s\], and the limit and the closest approach of those who came closest. The
/// line breaks where no distance is known.
#[must_use]
pub fn smallest(distances: &[Option<(f64, f64)>], closest: &Encounter, title: &str) -> Figure {
    let Encounter { limit_m: limit, unit, .. } = *closest;
    let points: Vec<_> = distances.iter().map(|known| known.unwrap_or((f64::NAN, f64::NAN))).collect();
    let times_s = points.iter().map(|point| point.0).chain(closest.distances.iter().map(|point| point.0));
    let (from_s, to_s) = extent(times_s).unwrap_or((0.0, 0.0));
    let numbers: Vec<_> = points.iter().map(|point| point.1).chain([limit]).collect();
    let mut chart = Chart::new(Axis::time(from_s, to_s), Axis::distances(unit, &numbers, limit));
    let least = points.iter().copied().filter(|point| point.1.is_finite()).min_by(|a, b| a.1.total_cmp(&b.1));
    chart.line(points, Stroke::solid(PALETTE[0], 1.5), "smallest distance of any two");
    chart.level(limit, Stroke::solid(INK, 2.0), format!("limit {limit:?} {unit}"));
    let words = closest.closest();
    chart.marks.extend(least.map(|at| Mark::ring(at, INK, Some(format!("closest {words}")))));
    let description = format!("The smallest distance of any two over time; closest {words}, limit {limit:?} {unit}.");
    chart.figure("smallest", title, &description)
}

/// The paths of two vehicles from above \[m\], and where both are when they are closest; an inset shows that from near, four
/// times their distance wide.
#[must_use]
pub fn closest_approach(encounter: &Encounter, title: &str) -> Figure {
    let points = || encounter.paths_m.iter().flatten();
    let x = Axis::linear("x [m]", points().map(|point| point.0), false);
    let y = Axis::linear("y [m]", points().map(|point| point.1), false);
    let mut chart = Chart::new(x, y);
    chart.equal = true;
    let nearest = encounter.nearest();
    let places = encounter.paths_m.each_ref().map(|path| nearest.and_then(|k| path.get(k).copied()));
    for (k, (path, name)) in encounter.paths_m.iter().zip(&encounter.names).enumerate() {
        chart.line(path.clone(), Stroke::solid(PALETTE[k], 1.6), name.clone());
        chart.marks.extend(places[k].map(|at| Mark::ring(at, PALETTE[k], None)));
    }
    let closest = encounter.closest();
    if let [Some(one), Some(other)] = places {
        chart.line(vec![one, other], Stroke::dashed(INK, 1.4), format!("closest {closest}"));
        let middle = (f64::midpoint(one.0, other.0), f64::midpoint(one.1, other.1));
        let apart = (one.0 - other.0).hypot(one.1 - other.1);
        chart.inset = Some(Inset { middle, half: 0.5 * NEAR * apart });
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
        let sure = encounters(&[encounter(0.0)], "encounters", "Distance");
        let doubtful = encounters(&[encounter(0.5)], "encounters", "Distance");
        assert!(sure.svg.contains("alpha and bravo") && sure.svg.contains("closest 1.000000 m"));
        assert!(doubtful.svg.matches("<polygon").count() > sure.svg.matches("<polygon").count());
        let seen = closest_approach(&encounter(0.0), "Closest approach");
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
    fn nothing_to_draw_and_impossible_numbers_make_a_figure_all_the_same() {
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
