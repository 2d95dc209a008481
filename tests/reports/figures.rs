//! Figures: their SVG is parsed and measured against its own axes.

use roxmltree::{Document, Node};
use tautline::figures::{self, Criteria, Figure};
use tautline::flight_log::FlightLog;
use tautline::formation::Formation;
use tautline::graph::Graph;
use tautline::law::EdgeTension;
use tautline::mcap::{Header, McapRecorder, McapRecording};
use tautline::record::{Sample, Sink as _};
use tautline::swarm::{ClosestApproach, Pair, Rows, Swarm, separation, set_row};
use tautline::target::Leg;

/// Tolerance of coordinates, which are written in tenths of a pixel.
pub(crate) const TOLERANCE_PX: f64 = 0.2;
const DELTA_M: f64 = 2.0;
const CERTIFIED_M: f64 = 2.5;
/// Stroke and width of the line at delta.
const DELTA_LINE: (&str, &str) = ("#1B1F24", "2");
const CERTIFIED_LINE: (&str, &str) = ("#3F9E8E", "1.6");

/// Parsed figure.
pub(crate) struct Drawing<'a>(Document<'a>);

impl<'a> Drawing<'a> {
    pub(crate) fn of(figure: &'a Figure) -> Self {
        Self(Document::parse(&figure.svg).unwrap_or_else(|error| panic!("{}: {error}\n{}", figure.name, figure.svg)))
    }

    fn all(&self, tag: &str) -> Vec<Node<'_, '_>> {
        let is_of_panel = |node: &Node<'_, '_>| node.ancestors().any(|of| of.attribute("class") == Some("panel"));
        let nodes = self.0.descendants().filter(|node| node.has_tag_name(("http://www.w3.org/2000/svg", tag)));
        nodes.filter(|node| !is_of_panel(node)).collect()
    }

    pub(crate) fn words(&self) -> Vec<String> {
        self.all("text").iter().map(|node| node.text().unwrap_or("").trim().to_owned()).collect()
    }

    /// Returns number and position of each tick: of the vertical axis (texts that end at it) or of the horizontal one.
    fn ticks(&self, vertical: bool) -> Vec<(f64, f64)> {
        let (anchor, dy, along) = if vertical { ("end", "0.35em", "y") } else { ("middle", "0.76em", "x") };
        let texts = self.all("text").into_iter();
        let ticks =
            texts.filter(|text| text.attribute("text-anchor") == Some(anchor) && text.attribute("dy") == Some(dy));
        ticks
            .filter_map(|text| {
                let number = text.text()?.trim().replace('\u{2212}', "-").parse().ok()?;
                Some((number, number_of(&text, along)))
            })
            .collect()
    }

    /// Returns the position of a number on an axis.
    pub(crate) fn place(&self, vertical: bool, number: f64) -> f64 {
        let ticks = self.ticks(vertical);
        let [(a, at_a), .., (b, at_b)] = ticks[..] else { panic!("{} ticks", ticks.len()) };
        at_a + (number - a) / (b - a) * (at_b - at_a)
    }

    /// Returns the corners of each polyline that has the given stroke and stroke width.
    pub(crate) fn polylines(&self, (stroke, width): (&str, &str)) -> Vec<Vec<(f64, f64)>> {
        let of_style = |node: &Node<'_, '_>| {
            node.attribute("stroke") == Some(stroke) && node.attribute("stroke-width") == Some(width)
        };
        self.all("polyline").into_iter().filter(of_style).map(|node| corners(&node)).collect()
    }

    pub(crate) fn level(&self, style: (&str, &str)) -> f64 {
        let levels: Vec<_> = self.polylines(style).into_iter().filter(|line| length(line) > 100.0).collect();
        let [level] = &levels[..] else { panic!("{} lines of {style:?}", levels.len()) };
        assert_eq!(level.len(), 2);
        assert_eq!(level[0].1, level[1].1, "the line is not level");
        level[0].1
    }

    /// Returns the circles of the plotting area; those of the legend are below all ticks.
    fn rings(&self) -> Vec<(f64, f64)> {
        let lowest = self.ticks(false).len();
        assert!(lowest > 0, "no ticks");
        let below = self
            .all("text")
            .iter()
            .filter(|t| t.attribute("dy") == Some("0.76em"))
            .map(|t| number_of(t, "y"))
            .fold(0.0, f64::max);
        let circles = self.all("circle").into_iter().map(|node| (number_of(&node, "cx"), number_of(&node, "cy")));
        circles.filter(|&(_, y)| y < below).collect()
    }
}

fn number_of(node: &Node<'_, '_>, attribute: &str) -> f64 {
    node.attribute(attribute).and_then(|text| text.parse().ok()).unwrap_or_else(|| panic!("{attribute} of {node:?}"))
}

fn corners(node: &Node<'_, '_>) -> Vec<(f64, f64)> {
    let points = node.attribute("points").expect("points").split_whitespace();
    let corner = |pair: &str| pair.split_once(',').map(|(x, y)| (x.parse().expect("x"), y.parse().expect("y")));
    points.map(|pair| corner(pair).expect("a pair")).collect()
}

fn length(line: &[(f64, f64)]) -> f64 {
    line.windows(2).map(|ends| (ends[1].0 - ends[0].0).hypot(ends[1].1 - ends[0].1)).sum()
}

/// Passes samples of `count` vehicles 3 m apart on the x axis to `take`. All move at `(0.5, 0.2, rise)` m/s for 10 s.
/// At 4 s the second vehicle is `near_m` from the first for one sample.
fn samples(count: usize, rise_m_s: f64, near_m: f64, take: &mut dyn FnMut(&Sample<'_>)) {
    for k in 0..=200_u32 {
        let time_s = f64::from(k) * 0.05;
        let mut swarm = Swarm::at_rest(Rows::zeros(count));
        for i in 0..count {
            let visiting = i == 1 && k == 80;
            let x = if visiting { near_m } else { 3.0 * i as f64 };
            set_row(&mut swarm.positions_m, i, [x + 0.5 * time_s, 0.2 * time_s, rise_m_s * time_s * i as f64].into());
            set_row(&mut swarm.velocities_m_s, i, [0.5 / (1.0 + time_s), 0.2 * i as f64, 0.0].into());
        }
        let mut control = Rows::zeros(count);
        control.column_mut(1).fill(2.0 - 0.1 * time_s);
        let closest = (count > 1).then(|| ClosestApproach {
            pair: Pair::new(0, 1),
            separation_m: separation(&swarm.positions_m, 0, 1),
            time_s,
        });
        take(&Sample {
            separation: closest,
            energy: Some(4.0 - 0.3 * time_s),
            ..Sample::new(time_s, u64::from(k), &swarm, &control)
        });
    }
}

fn history(count: usize) -> FlightLog {
    let mut history = FlightLog::default();
    samples(count, 0.0, 2.75, &mut |sample| history.take(sample));
    history
}

fn all_of(history: &FlightLog, delta_m: f64) -> Vec<Figure> {
    let (formation, graph) = (Formation::line(history.count(), 4.0), Graph::complete(history.count()));
    let criteria = Criteria {
        delta_m,
        certified_m: Some(CERTIFIED_M),
        shape: Some((&[Leg::first(formation.clone())], &graph)),
        edge_error_m: Some(0.01),
        disagreement_m_s: Some(0.02),
        most_thrust_n: Some(0.12),
        obstacles: &[],
    };
    figures::of_run(history, &criteria)
}

fn names(figures: &[Figure]) -> Vec<&str> {
    figures.iter().map(|figure| figure.name.as_str()).collect()
}

#[test]
fn the_lines_at_delta_and_at_the_certified_distance_are_correct() {
    let history = history(3);
    for delta_m in [1.0, DELTA_M, 2.9] {
        let figure = figures::distances(&history, delta_m, None, "Distances");
        let drawing = Drawing::of(&figure);
        let (found, expected) = (drawing.level(DELTA_LINE), drawing.place(true, delta_m));
        assert!((found - expected).abs() <= TOLERANCE_PX, "delta {delta_m}: {found}, not {expected}");
        let elsewhere = drawing.place(true, delta_m + 0.1);
        assert!((found - elsewhere).abs() > TOLERANCE_PX, "a shift of a tenth of a metre must be visible");
    }
    let figure = figures::distances(&history, DELTA_M, Some(CERTIFIED_M), "Distances");
    let drawing = Drawing::of(&figure);
    let expected = drawing.place(true, CERTIFIED_M);
    assert!((drawing.level(CERTIFIED_LINE) - expected).abs() <= TOLERANCE_PX);
    let figure = figures::distances(&history, DELTA_M, Some(DELTA_M), "Distances");
    let equal = Drawing::of(&figure);
    assert!(equal.words().iter().any(|word| word == "safety distance δ = certified = 2 m"), "{:?}", equal.words());
    assert!(equal.polylines(CERTIFIED_LINE).is_empty(), "one line for both");
}

#[test]
fn every_pair_of_a_small_swarm_has_a_line_and_the_closest_approach_is_marked() {
    let figure = figures::distances(&history(4), DELTA_M, Some(CERTIFIED_M), "Distances");
    let drawing = Drawing::of(&figure);
    // The legend has six entries: delta, certified, closest, two pairs, and the other pairs in grey.
    let colors = ["#332288", "#CC6677"];
    for color in colors {
        let lines = drawing.polylines((color, "1.5"));
        assert_eq!(lines.iter().filter(|line| length(line) > 100.0).count(), 1, "{color}");
    }
    let others = drawing.polylines(("#57606A", "0.9"));
    assert_eq!(others.iter().filter(|line| length(line) > 100.0).count(), 4);
    for words in ["1-2", "2-3", "4 other pairs"] {
        assert!(drawing.words().iter().any(|word| word == words), "{words} in {:?}", drawing.words());
    }
    let expected = (drawing.place(false, 4.0), drawing.place(true, 2.75));
    let rings = drawing.rings();
    let &[(x, y)] = &rings[..] else { panic!("{rings:?}") };
    assert!(
        (x - expected.0).abs() <= TOLERANCE_PX && (y - expected.1).abs() <= TOLERANCE_PX,
        "({x}, {y}), not {expected:?}"
    );
    assert!(figure.description.contains("2.750 m, vehicles 1 and 2 at 4.00 s"), "{}", figure.description);
    // The approach lasts one sample of two hundred; the line of the pair must reach it.
    let lowest = drawing.polylines((colors[0], "1.5"))[0].iter().map(|&(_, y)| y).fold(0.0, f64::max);
    assert!((lowest - expected.1).abs() <= TOLERANCE_PX, "{lowest}, not {}", expected.1);
}

#[test]
fn the_clearance_is_enlarged_unless_the_chart_shows_it() {
    let panels = |figure: &Figure| figure.svg.matches("class=\"panel\"").count();
    let figure = figures::distances(&history(6), DELTA_M, None, "Distances");
    assert_eq!(panels(&figure), 1);
    let panel = figure.svg.split("class=\"panel\"").nth(1).expect("a panel");
    assert!(panel.contains("clearance [m]") && panel.contains("<circle"), "the closest approach is in it: {panel}");
    assert_eq!(panels(&figures::distances(&history(2), 0.5, None, "Distances")), 0, "it would enlarge nothing");
    assert_eq!(panels(&figures::distances(&history(6), 0.0, None, "Distances")), 0);
}

#[test]
fn a_peak_of_the_start_gives_control_a_logarithmic_axis() {
    let label = |first: f64| {
        let mut log = FlightLog::default();
        let mut scale = first;
        samples(3, 0.0, 2.75, &mut |sample| {
            let control = sample.control * std::mem::replace(&mut scale, 1.0);
            log.take(&Sample { control: &control, ..*sample });
        });
        Drawing::of(&figures::control(&log, "Control")).words().concat()
    };
    assert!(label(100.0).contains("control effort |u| [m/s^2], logarithmic"), "{}", label(100.0));
    assert!(!label(2.0).contains("logarithmic"), "{}", label(2.0));
}

#[test]
fn paths_show_obstacles_within_the_axes() {
    let ball = |x: f64, radius_m: f64| tautline::audit::MovingObstacle {
        name: "ball".to_owned(),
        shape: tautline::obstacle::Shape::Ball { radius_m },
        clearance_m: None,
        path: vec![(0.0, [x, 1.0, 0.0].into())],
    };
    let figure = figures::paths(&history(3), &[ball(5.0, 0.5), ball(500.0, 1.0)], "Paths");
    let drawing = Drawing::of(&figure);
    let outlines: Vec<_> = drawing.all("polygon").iter().map(corners).collect();
    assert_eq!(outlines.len(), 2, "one in the chart, one in the legend");
    let across = outlines[0].iter().map(|at| at.0).fold(f64::NEG_INFINITY, f64::max);
    assert!((across - drawing.place(false, 5.5)).abs() <= TOLERANCE_PX, "{across}");
}

#[test]
fn paths_have_a_cross_at_each_start_a_ring_at_each_end_and_equal_axes() {
    let figure = figures::paths(&history(3), &[], "Paths");
    let drawing = Drawing::of(&figure);
    let per_metre = |vertical| drawing.place(vertical, 1.0) - drawing.place(vertical, 0.0);
    assert!((per_metre(false) + per_metre(true)).abs() < 0.01 * per_metre(false), "a metre differs between the axes");

    let mut rings = drawing.rings();
    rings.sort_by(|a, b| a.0.total_cmp(&b.0));
    assert_eq!(rings.len(), 3);
    for (i, (x, y)) in rings.into_iter().enumerate() {
        let expected = (drawing.place(false, 3.0 * i as f64 + 5.0), drawing.place(true, 2.0));
        assert!(
            (x - expected.0).abs() <= TOLERANCE_PX && (y - expected.1).abs() <= TOLERANCE_PX,
            "({x}, {y}), not {expected:?}"
        );
    }
    for (i, color) in ["#332288", "#CC6677", "#3F9E8E"].into_iter().enumerate() {
        let paths = drawing.polylines((color, "1.5"));
        let [path] = &paths[..] else { panic!("{} paths", paths.len()) };
        let start = (drawing.place(false, 3.0 * i as f64), drawing.place(true, 0.0));
        assert!(
            (path[0].0 - start.0).abs() <= TOLERANCE_PX && (path[0].1 - start.1).abs() <= TOLERANCE_PX,
            "{:?}, {start:?}",
            path[0]
        );
        let strokes = drawing.polylines((color, "1.6"));
        let at_start =
            strokes.iter().filter(|stroke| (f64::midpoint(stroke[0].0, stroke[1].0) - start.0).abs() <= TOLERANCE_PX);
        assert_eq!(at_start.count(), 2, "a cross of two strokes at the start of vehicle {}", i + 1);
    }
    for word in ["1", "2", "3", "start", "end"] {
        assert!(drawing.words().iter().any(|words| words == word), "{word}");
    }
}

#[test]
fn every_axis_names_its_unit() {
    for (name, labels) in [
        ("paths", ["x [m]", "y [m]"]),
        ("distances", ["time [s]", "distance [m]"]),
        ("control", ["time [s]", "control effort |u| [m/s^2]"]),
        ("energy", ["time [s]", "energy E [m^2/s^2]"]),
        ("shape-error", ["time [s]", "largest edge error [m]"]),
        ("disagreement", ["time [s]", "velocity disagreement [m/s]"]),
    ] {
        let figures = all_of(&history(3), DELTA_M);
        let figure = figures.iter().find(|figure| figure.name == name).expect(name);
        let words = Drawing::of(figure).words();
        assert!(labels.iter().all(|label| words.iter().any(|word| word == label)), "{name}: {words:?}");
    }
}

/// Returns the width of a number in most fonts \[px\].
fn width(words: &str) -> f64 {
    words.chars().map(|c| if c == '.' { 4.0 } else { 7.3 }).sum()
}

#[test]
fn numbers_of_the_axes_do_not_overlap() {
    let mut widest_px = 0.0_f64;
    for (offset, scale) in [(0.0, 1.0), (0.0, 1e3), (123_456.0, 1.0), (-1e6, 10.0), (0.0, 1e-3), (0.0, 1e7)] {
        let mut history = FlightLog::default();
        samples(3, 0.0, 2.75, &mut |sample| {
            let mut swarm = sample.swarm.clone();
            swarm.positions_m = swarm.positions_m.map(|x| offset + scale * x);
            swarm.velocities_m_s *= scale;
            let (control, time_s) = (sample.control * scale, sample.time_s * scale);
            let energy = sample.energy.map(|energy| energy * scale);
            history.take(&Sample { swarm: &swarm, control: &control, time_s, energy, separation: None, ..*sample });
        });
        for figure in all_of(&history, DELTA_M * scale) {
            let drawing = Drawing::of(&figure);
            let of = |anchor: &str, dy: &str| -> Vec<(f64, f64, String)> {
                let texts = drawing.all("text").into_iter();
                let texts =
                    texts.filter(|t| t.attribute("text-anchor") == Some(anchor) && t.attribute("dy") == Some(dy));
                texts.map(|t| (number_of(&t, "x"), number_of(&t, "y"), t.text().unwrap_or("").to_owned())).collect()
            };
            let ticks = of("end", "0.35em");
            assert!(ticks.len() > 1, "{}", figure.name);
            for (at, (x, _, words)) in ticks.iter().enumerate() {
                // The axis label is rotated: its letters are 13 px to the left of 24 px.
                assert!(x - width(words) >= 23.0, "{}, {offset}, {scale}: {words} ends at {x} px", figure.name);
                assert!(ticks[..at].iter().all(|other| other.2 != *words), "{}: {words} twice", figure.name);
                widest_px = widest_px.max(width(words));
            }
            let mut ticks = of("middle", "0.76em");
            ticks.sort_by(|a, b| a.0.total_cmp(&b.0));
            for two in ticks.windows(2) {
                let apart = two[1].0 - two[0].0 - 0.5 * (width(&two[0].2) + width(&two[1].2));
                assert!(apart > 2.0, "{}, {offset}, {scale}: {two:?}", figure.name);
            }
        }
    }
    assert!(widest_px > 45.0, "no number is wide enough for the test: {widest_px} px");
}

#[test]
fn a_run_has_the_figures_that_it_has_data_for() {
    let level = ["paths", "distances", "control", "energy", "shape-error", "disagreement"];
    assert_eq!(names(&all_of(&history(3), DELTA_M)), level);
    let mut in_space = FlightLog::default();
    samples(3, 0.3, 2.75, &mut |sample| in_space.take(sample));
    let figures = all_of(&in_space, DELTA_M);
    assert_eq!(names(&figures)[..3], ["paths", "paths-3d", "distances"]);
    let words = Drawing::of(&figures[1]).words();
    for label in ["x [m]", "y [m]", "z [m]"] {
        assert!(words.iter().any(|word| word == label), "{label}: {words:?}");
    }
    let mut without_energy = FlightLog::default();
    samples(1, 0.0, 0.0, &mut |sample| without_energy.take(&Sample { energy: None, ..*sample }));
    assert_eq!(names(&all_of(&without_energy, DELTA_M)), ["paths", "control", "shape-error", "disagreement"]);
    for figure in all_of(&in_space, DELTA_M) {
        assert!(figures::NAMES_OF_RUN.contains(&figure.name.as_str()), "{}", figure.name);
    }
}

#[test]
fn a_large_swarm_has_bands_and_the_closest_pairs() {
    let figures = all_of(&history(60), DELTA_M);
    let drawing = Drawing::of(&figures[1]);
    let words = drawing.words();
    for word in ["5 to 95 %", "25 to 75 %", "median", "smallest", "1-2"] {
        assert!(words.iter().any(|words| words == word), "{word} in {words:?}");
    }
    assert_eq!(drawing.all("polygon").len(), 4, "two bands, each also in the legend");
    let bytes: usize = figures.iter().map(|figure| figure.svg.len()).sum();
    assert!(bytes < 400_000, "{bytes} bytes");
}

#[test]
fn the_size_of_all_figures_is_bounded() {
    let mut history = FlightLog::default();
    let (count, control) = (5000, Rows::from_element(5000, 1.0));
    for k in 0..300_u32 {
        // Every vehicle has its own path.
        let place = |i: usize, axis: usize| (i * (axis + 1)) as f64 + 50.0 * f64::from(k * k) * (i as f64 + 1.0).sin();
        let swarm = Swarm::at_rest(Rows::from_fn(count, |i, axis| place(i, axis).sin() * 100.0));
        history.take(&Sample {
            separation: Some(ClosestApproach { pair: Pair::new(4321, 4999), separation_m: 1.0, time_s: 7.0 }),
            energy: Some(f64::from(k % 7)),
            ..Sample::new(f64::from(k), u64::from(k), &swarm, &control)
        });
    }
    let (formation, graph) = (Formation::line(count, 4.0), Graph::path(count));
    let criteria = Criteria {
        delta_m: DELTA_M,
        certified_m: None,
        shape: Some((&[Leg::first(formation.clone())], &graph)),
        edge_error_m: None,
        disagreement_m_s: None,
        most_thrust_n: None,
        obstacles: &[],
    };
    let figures = figures::of_run(&history, &criteria);
    assert_eq!(figures.len(), 7);
    let bytes: usize = figures.iter().map(|figure| figure.svg.len()).sum();
    assert!(bytes < 800_000, "{bytes} bytes");
    let words = &figures[0].description;
    assert!(words.starts_with("Paths of 30") && words.contains(" of 5000 vehicles, chosen evenly,"), "{words}");
    assert!(figures[2].description.contains("20000 of the 12497500 pairs"), "{}", figures[2].description);
}

#[test]
fn no_recording_makes_a_figure_fail_or_contain_nan() {
    let mut histories = vec![("without samples", FlightLog::default())];
    let mut one = FlightLog::default();
    let mut first = true;
    samples(3, 0.0, 2.75, &mut |sample| {
        if std::mem::take(&mut first) {
            one.take(sample);
        }
    });
    histories.push(("of one sample", one));
    for (name, number) in [("NaN", f64::NAN), ("infinite", f64::INFINITY), ("huge", 1e300), ("tiny", 1e-300)] {
        for count in [1, 3, 20] {
            let (mut energy, mut state, mut control) =
                (FlightLog::default(), FlightLog::default(), FlightLog::default());
            samples(count, 0.1, 2.75, &mut |sample| {
                energy.take(&Sample { energy: Some(number), ..*sample });
                let mut swarm = sample.swarm.clone();
                swarm.positions_m[(0, 1)] = number;
                swarm.velocities_m_s[(0, 1)] = number;
                let separation = sample.separation.map(|closest| ClosestApproach { separation_m: number, ..closest });
                state.take(&Sample { swarm: &swarm, separation, ..*sample });
                let rows = Rows::from_element(count, number);
                control.take(&Sample { control: &rows, time_s: number, ..*sample });
            });
            histories.extend([(name, energy), (name, state), (name, control)]);
        }
    }
    for (name, history) in &histories {
        for delta_m in [DELTA_M, 0.0, 1e300, f64::NAN] {
            for figure in all_of(history, delta_m) {
                let drawing = Drawing::of(&figure);
                let numbers = drawing.0.descendants().flat_map(|node| node.attributes());
                for attribute in numbers.filter(|attribute| attribute.name() != "aria-label") {
                    let value = attribute.value();
                    assert!(!value.contains("NaN") && !value.contains("inf"), "{name}, {}: {value}", figure.name);
                }
            }
            let space = figures::paths_in_space(history, &[], "Paths");
            Drawing::of(&space);
        }
    }
}

#[test]
fn a_recording_gives_the_same_figures_as_its_run() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.mcap");
    let mut recorder = McapRecorder::create(&path, &Header::new("line", "", 3, DELTA_M)).expect("a recording");
    samples(3, 0.0, 2.75, &mut |sample| recorder.sample(sample).expect("recorded"));
    recorder.finish().expect("closed");
    let read = FlightLog::read(McapRecording::open(&path).expect("opens")).expect("reads");
    assert_eq!(all_of(&read, DELTA_M), all_of(&history(3), DELTA_M));
}

#[test]
fn a_figure_escapes_its_title_and_is_self_contained() {
    let hostile = "</title><script>alert('1')</script>\u{0} & \"quoted\"";
    let mut figures = all_of(&history(3), DELTA_M);
    figures.push(figures::paths_in_space(&history(3), &[], hostile));
    figures.push(figures::energy(&history(3), hostile));
    for figure in &figures {
        let drawing = Drawing::of(figure);
        assert!(drawing.all("script").is_empty());
        let plain = figure.svg.replace("http://www.w3.org/2000/svg", "");
        for reference in ["http", "href", "url(", "@import", "data:"] {
            assert!(!plain.contains(reference), "{}: {reference}", figure.name);
        }
        let root = drawing.0.root_element();
        assert!(root.attribute("aria-label").is_some_and(|label| label.contains(&figure.description)));
        assert_eq!(drawing.all("title")[0].text(), Some(figure.title.as_str()));
        assert_eq!(drawing.all("desc")[0].text(), Some(figure.description.as_str()));
    }
}

#[test]
fn the_tension_curve_has_the_right_barrier_and_minimum() {
    let (delta_m, k_m) = (0.5, 1.0);
    let rest_m = delta_m + k_m * 1.0_f64.asinh();
    let tension = EdgeTension::new(1.0, delta_m, rest_m).expect("a tension");
    let figure = figures::tension_curve(&tension, "Fig. 1");
    let drawing = Drawing::of(&figure);
    let rings = drawing.rings();
    let &[(x, y)] = &rings[..] else { panic!("{rings:?}") };
    assert!(
        (x - drawing.place(false, rest_m)).abs() <= TOLERANCE_PX
            && (y - drawing.place(true, 0.0)).abs() <= TOLERANCE_PX
    );
    let curves = drawing.polylines(("#332288", "1.8"));
    let curve = curves.iter().max_by(|a, b| length(a).total_cmp(&length(b))).expect("a curve");
    let lowest = curve.iter().copied().max_by(|a, b| a.1.total_cmp(&b.1)).expect("a point");
    // The curve is flat near its minimum: a tenth of a pixel of height is several pixels of width.
    assert!((lowest.0 - x).abs() < 5.0 && (lowest.1 - y).abs() <= TOLERANCE_PX, "{lowest:?}, not ({x}, {y})");
    let barriers = drawing.polylines(("#1B1F24", "1.6"));
    assert!(
        barriers
            .iter()
            .any(|line| (line[0].0 - drawing.place(false, delta_m)).abs() <= TOLERANCE_PX && length(line) > 100.0)
    );
    assert!(figure.description.contains("Vmin = 2.7956"), "{}", figure.description);
}
