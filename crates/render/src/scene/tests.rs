use std::sync::Arc;

use nalgebra::Vector3;

use super::*;
use crate::timeline::Timeline;
use tautline_audit::Status;
use tautline_core::obstacle::{Obstacle, Shape};
use tautline_core::record::{Event, Sample};
use tautline_core::swarm::{ClosestApproach, Pair, Rows, Swarm, row};
use tautline_laws::formation::Formation;
use tautline_laws::graph::Graph;
use tautline_laws::space::{Metric, closest_pair};
use tautline_report::drawing::colours::{ALARM, NIGHT, PAPER};
use tautline_report::figures;
use tautline_report::flight_log::FlightLog;
use tautline_report::replay::PAGE_BYTES;
use tautline_report::request::replay_of_run;
use tautline_report::run::run;
use tautline_sim::scenario::{Scenario, Source};

/// Returns four vehicles at the corners of a square that fly to the right for ten seconds; 1 and 2 are too close from 4
/// s to 6 s.
fn timeline() -> Timeline {
    timeline_in(Metric::default())
}

fn timeline_in(metric: Metric) -> Timeline {
    let start = Swarm::at_rest(Rows::from_row_slice(&[0.0, 0.0, 1.0, 3.0, 0.0, 1.0, 3.0, 3.0, 1.0, 0.0, 3.0, 1.0]));
    let formation = Formation { slots_m: start.positions_m.clone() };
    let scenario = Scenario::new("square", start.clone(), formation, 2.0, 10.0);
    let log = FlightLog::new(metric, scenario.delta_m);
    let mut timeline = Timeline::flown(&scenario, Arc::new(log));
    for k in 0..=10_u32 {
        let time_s = f64::from(k);
        let mut swarm = start.clone();
        swarm.positions_m.column_mut(0).add_scalar_mut(time_s);
        let separation = Some(ClosestApproach { pair: Pair::new(0, 1), separation_m: 3.0 - 0.1 * time_s, time_s });
        let control = Rows::zeros(4);
        timeline.take(&Sample { separation, ..Sample::new(time_s, u64::from(k), &swarm, &control) });
    }
    timeline.note(&Event::ViolationBegan { pair: Pair::new(0, 1), time_s: 4.0 });
    timeline.note(&Event::ViolationEnded { pair: Pair::new(0, 1), time_s: 6.0, min_m: 1.5 });
    timeline
}

fn scene(timeline: &Timeline, time_s: f64, view: &View) -> Scene {
    let (frame, extent) = (timeline.log.at(time_s).expect("a frame"), Extent::of(timeline));
    let camera = extent.camera(timeline, &frame, view).expect("a camera");
    Scene::compose(timeline, &extent, &frame, view, camera)
}

fn words(scene: &Scene) -> Vec<&str> {
    let text = |mark: &'_ Annotation| matches!(mark, Annotation::Words { .. });
    scene
        .annotations
        .iter()
        .filter(|annotation| text(annotation))
        .map(|annotation| if let Annotation::Words { text, .. } = annotation { text } else { "" })
        .collect()
}

fn camera(text: &str) -> View {
    View { camera: text.parse().expect(text), ..View::default() }
}

#[test]
fn every_vehicle_is_in_the_list_once_for_any_camera() {
    let timeline = timeline();
    for text in
        ["auto", "perspective", "top", "front", "side", "closest", "follow", "follow:3", "10,80,5", "200,-30,100"]
    {
        let scene = scene(&timeline, 2.0, &camera(text));
        assert_eq!((scene.balls.len(), scene.shells.len()), (4, 4), "{text}");
        assert!(scene.balls.iter().all(|ball| ball.radius_m == 0.25), "{text}");
        assert!(scene.shells.iter().all(|shell| shell.radius_m == 1.0), "{text}");
    }
}

#[test]
fn shells_are_sorted_along_every_line_of_sight() {
    for (text, ratio) in
        ["perspective", "front", "40,20,9"].into_iter().flat_map(|text| [1.0, 3.0, 0.5].map(|ratio| (text, ratio)))
    {
        let metric = Metric::of_ratio(ratio);
        let timeline = timeline_in(metric);
        let scene = scene(&timeline, 2.0, &camera(text));
        assert_eq!(f64::from(scene.shell_ratio), ratio);
        let camera = scene.camera;
        let centre = |ball: &Ball| Vector3::from(ball.centre_m.map(f64::from));
        // Entry of rays into each shell, through points all over the picture, in lengths in which shells are balls.
        for n in 0..400_u32 {
            let at_px = [f64::from(n % 20) * 64.0, f64::from(n / 20) * 36.0];
            let [origin, direction] = camera.ray(at_px);
            let direction = metric.scaled(direction);
            let length = direction.norm_squared();
            let entries: Vec<f64> = scene
                .shells
                .iter()
                .filter_map(|shell| {
                    let to_centre = metric.scaled(centre(shell) - origin);
                    let along = to_centre.dot(&direction) / length;
                    let squared = 1.0 - (to_centre.norm_squared() - along * along * length);
                    (squared > 0.0).then(|| along - (squared / length).sqrt())
                })
                .collect();
            assert!(entries.windows(2).all(|pair| pair[0] >= pair[1]), "{text}, {ratio}: {entries:?}");
        }
    }
}

#[test]
fn layers_that_are_off_draw_nothing() {
    let timeline = timeline();
    let bare = scene(&timeline, 2.0, &View { layers: Layers::NONE, ..View::default() });
    assert_eq!((bare.balls.len(), bare.shells.len(), bare.lines.len(), bare.annotations.len()), (4, 0, 0, 0));
    let whole = scene(&timeline, 2.0, &View::default());
    assert!(whole.lines.len() > 6 + 4 * 2 && whole.annotations.len() > 10);
}

#[test]
fn a_violation_is_shown_while_it_lasts_and_in_the_verdict_after() {
    let timeline = timeline();
    let alarm = Theme::Dark.pick(ALARM);
    let red = |scene: &Scene| scene.balls.iter().filter(|ball| ball.colour == alarm).count();
    let says = |scene: &Scene, what: &str| words(scene).iter().any(|text| text.contains(what));
    let [before, during, after] = [3.9, 5.0, 6.1].map(|time_s| scene(&timeline, time_s, &View::default()));
    assert_eq!([&before, &during, &after].map(red), [0, 2, 0]);
    assert!(says(&before, "clear so far") && !says(&before, "VIOLATION"), "{:?}", words(&before));
    assert!(says(&during, "VIOLATION") && says(&during, "violated at 4.00 s by 1 and 2"), "{:?}", words(&during));
    assert!(!says(&after, "VIOLATION") && says(&after, "violated at 4.00 s"), "{:?}", words(&after));
    // Several violations are shown by their number and the first one.
    let mut again = timeline;
    again.note(&Event::ViolationBegan { pair: Pair::new(2, 3), time_s: 7.0 });
    let twice = scene(&again, 8.0, &View::default());
    assert!(says(&twice, "2 violations, the first at 4.00 s by 1 and 2"), "{:?}", words(&twice));
    let timeline = self::timeline();
    // A vehicle in violation has its shell even with every layer off.
    let bare = scene(&timeline, 5.0, &View { layers: Layers::NONE, ..View::default() });
    assert_eq!(bare.shells.len(), 2);
}

#[test]
fn a_violation_between_samples_shows_the_audited_separation() {
    let mut timeline = timeline();
    let pair = Pair::new(2, 3);
    timeline.note(&Event::ViolationBegan { pair, time_s: 8.2 });
    timeline.note(&Event::ViolationEnded { pair, time_s: 8.4, min_m: 1.25 });
    let violation = timeline.log.violations().of_vehicles().nth(1).expect("a violation");
    assert_eq!((violation.min_m, violation.min_at_s), (1.25, 0.5 * (8.2 + 8.4)));
    let scene = scene(&timeline, violation.min_at_s, &View::default());
    let (banner, label) = ("VIOLATION  vehicles 3 and 4 1.250 m apart, delta 2.000 m", "1.250 m");
    assert!(words(&scene).contains(&banner) && words(&scene).contains(&label), "{:?}", words(&scene));
    let closest = words(&scene).into_iter().find(|words| words.starts_with("closest so far")).expect("a caption");
    assert!(closest.starts_with("closest so far 1.250 m, vehicles 3 and 4 at 8.30 s"), "{closest}");
}

#[test]
fn label_banner_and_caption_show_the_number_of_the_judge() {
    // A sample at the same time has a larger distance of the pair than the judge.
    let timeline = timeline();
    let violation = timeline.log.violations().of_vehicles().next().expect("a violation");
    let scene = scene(&timeline, violation.min_at_s, &View::default());
    let number = metres(violation.min_m);
    let said = words(&scene);
    assert!(said.contains(&number.as_str()), "{number}: {said:?}");
    let with_number = |start: &str| said.iter().any(|text| text.starts_with(start) && text.contains(&number));
    assert!(with_number("VIOLATION") && with_number("closest so far"), "{number}: {said:?}");
}

#[test]
fn the_last_picture_has_the_final_verdict() {
    let clear = |status: Option<Status>| {
        let start = Swarm::at_rest(Rows::from_row_slice(&[0.0, 0.0, 1.0, 3.0, 0.0, 1.0]));
        let mut timeline = Timeline::new("two", 2);
        timeline.delta_m = Some(1.0);
        for time_s in [0.0, 4.0] {
            timeline.take(&Sample::new(time_s, 0, &start, &Rows::zeros(2)));
        }
        timeline.status = status;
        let said = |time_s: f64| {
            let scene = scene(&timeline, time_s, &View::default());
            words(&scene)
                .into_iter()
                .rev()
                .find(|text| text.contains("clear") || text.contains("undecided"))
                .map(str::to_owned)
        };
        [said(2.0), said(4.0)].map(|text| text.expect("a verdict"))
    };
    assert_eq!(clear(Some(Status::Clear)), ["clear so far", "clear from 0.00 s to 4.00 s"]);
    assert_eq!(clear(Some(Status::Undecided)), ["clear so far", "undecided"]);
    assert_eq!(clear(None), ["clear so far"; 2], "the flight goes on");
}

#[test]
fn only_the_part_of_a_trail_in_violation_is_red() {
    let timeline = timeline();
    let trails = View { layers: Layers { trails: true, ..Layers::NONE }, ..View::default() };
    let scene = scene(&timeline, 10.0, &trails);
    let alarm = Theme::Dark.pick(ALARM).rgba;
    let red = scene.lines.iter().filter(|line| line.colours[0].rgba[..3] == alarm[..3]);
    let length_m = |line: &Line| f64::from(line.ends_m[1][0] - line.ends_m[0][0]);
    let red_m: f64 = red.map(length_m).sum();
    // Two vehicles at 1 m/s for two seconds.
    assert!((red_m - 4.0).abs() < 1e-3, "{red_m} m");
}

#[test]
fn cameras_frame_all_vehicles_between_the_texts() {
    let timeline = timeline();
    let area = View::default().area(true);
    for text in ["auto", "perspective", "top", "front", "side", "follow"] {
        for time_s in [0.0, 5.0, 10.0] {
            let scene = scene(&timeline, time_s, &camera(text));
            for ball in &scene.balls {
                let centre_px = scene.camera.project(Vector3::from(ball.centre_m.map(f64::from))).expect("ahead").at_px;
                let [top, bottom] = [area.texts_px[0], 720.0 - area.texts_px[1]];
                assert!(
                    (0.0..1280.0).contains(&centre_px[0]) && (top..bottom).contains(&centre_px[1]),
                    "{text}, {time_s} s: {centre_px:?}"
                );
            }
        }
    }
}

#[test]
fn no_vehicle_is_under_the_texts() {
    let timeline = timeline();
    // A camera near a vehicle sees others behind the caption.
    for (text, has_band) in [("-90,20,4", true), ("perspective", false)] {
        let scene = scene(&timeline, 0.0, &camera(text));
        let band = scene.annotations.iter().any(|annotation| match annotation {
            Annotation::Box { corners_px: [[left, _], [right, _]], colour, .. } => {
                *left == 0.0 && *right == 1280.0 && *colour == Theme::Dark.pick(PAPER)
            }
            _ => false,
        });
        assert_eq!(band, has_band, "{text}");
    }
}

#[test]
fn a_violation_after_the_last_sample_is_in_the_last_picture() {
    let mut timeline = timeline();
    timeline.note(&Event::ViolationBegan { pair: Pair::new(2, 3), time_s: 10.01 });
    let says = |time_s: f64| {
        let scene = scene(&timeline, time_s, &View::default());
        words(&scene).iter().any(|text| text.starts_with("VIOLATION  vehicles 3 and 4"))
    };
    assert_eq!([9.9, 10.0, 10.5].map(says), [false, true, true]);
}

#[test]
fn an_undecided_flight_is_not_shown_as_clear() {
    let mut timeline = timeline();
    timeline.undecided_s = Some(2.0);
    let verdict = |time_s: f64| {
        let scene = scene(&timeline, time_s, &View::default());
        words(&scene).into_iter().find(|text| text.starts_with("clear") || text.starts_with("und")).map(str::to_owned)
    };
    let said = [1.9, 2.0, 4.5].map(verdict);
    assert_eq!(said, [Some("clear so far".to_owned()), Some("undecided from 2.00 s on".to_owned()), None]);
    // The assumption is in the same line.
    (timeline.undecided_s, timeline.assumes_straight) = (None, true);
    let scene = scene(&timeline, 1.9, &View::default());
    assert!(words(&scene).contains(&"clear so far, if straight between samples"), "{:?}", words(&scene));
}

#[test]
fn the_caption_shows_the_smallest_separation_so_far() {
    let timeline = timeline();
    let scene = scene(&timeline, 3.0, &View::default());
    assert!(words(&scene).iter().any(|text| text.starts_with("closest so far 2.700 m, vehicles 1 and 2 at 3.00 s")));
    assert!(words(&scene).contains(&"t = 3.00 s") && words(&scene).contains(&"square"));
}

/// The last instant of a leg is drawn with the time of its end, which the report shows.
#[test]
fn the_end_of_a_leg_has_the_time_of_the_report() {
    let scenario = Scenario::read(&Source::Builtin("obstacles".to_owned()), &[]).expect("built in");
    let mut timeline = Timeline::of(&scenario);
    let swarm = Swarm::at_rest(scenario.start.positions_m.clone());
    // Half of a hundredth of a second: a time just before it is rounded down.
    let end_s = 30.925;
    for (step, time_s) in [0.0, end_s, 40.0].into_iter().enumerate() {
        timeline.take(&Sample::new(time_s, step as u64, &swarm, &Rows::zeros(8)));
    }
    timeline.note(&Event::LegBegan { leg: 1, time_s: end_s });
    let shown = |time_s: f64| words(&scene(&timeline, time_s, &View::default())).join("; ");
    assert!(
        shown(end_s.next_down()).contains(&format!("leg 1 of 2, t = {end_s:.2} s")),
        "{}",
        shown(end_s.next_down())
    );
    assert!(shown(end_s).contains(&format!("leg 2 of 2, t = {end_s:.2} s")), "{}", shown(end_s));
}

/// Pillars stand around the start of this flight; the automatic camera looks past them. Hidden vehicles have no names.
#[test]
fn the_automatic_camera_shows_every_vehicle_at_the_start_among_obstacles() {
    let scenario = Scenario::read(&Source::Builtin("obstacles".to_owned()), &[]).expect("built in");
    let mut timeline = Timeline::of(&scenario);
    for (step, along_m) in [0.0, 10.0, 20.0].into_iter().enumerate() {
        let mut swarm = Swarm::at_rest(scenario.start.positions_m.clone());
        swarm.positions_m.column_mut(0).add_scalar_mut(along_m);
        timeline.take(&Sample::new(step as f64, step as u64, &swarm, &Rows::zeros(8)));
    }
    let layers = Layers { labels: true, ..Layers::NONE };
    let named = |text: &str| words(&scene(&timeline, 0.0, &View { layers, ..camera(text) })).len();
    assert_eq!(named("auto"), 8);
    assert!(named("-66,28,40") < 8, "a pillar hides vehicles from the usual direction");
}

#[test]
fn the_automatic_camera_turns_until_no_obstacle_hides_the_pair() {
    let scenario = Scenario::read(&Source::Builtin("obstacles".to_owned()), &[]).expect("built in");
    let mut timeline = Timeline::of(&scenario);
    timeline.take(&Sample::new(0.0, 0, &scenario.start, &Rows::zeros(scenario.count())));
    let (extent, frame) = (Extent::of(&timeline), timeline.log.at(0.0).expect("a frame"));
    let pair = Pair::new(0, 1);
    let cameras = |timeline: &Timeline, view: &View| {
        let usual = extent.camera(timeline, &frame, view).expect("a camera");
        (usual, extent.camera_on(timeline, &frame, view, pair).expect("a camera"))
    };
    let (usual, shown) = cameras(&timeline, &camera("auto"));
    assert_eq!(usual, shown, "nothing is hidden");
    let place = |k: usize| extent.place(&frame.positions_m, k).expect("present");
    let plan = timeline.plan.as_mut().expect("a plan");
    let place_m = usual.eye_m.lerp(&place(1), 0.7) + extent.origin_m();
    plan.obstacles.push(Obstacle { shape: Shape::Ball { radius_m: 0.3 }, place_m, ..plan.obstacles[0].clone() });
    let (usual, shown) = cameras(&timeline, &camera("auto"));
    let hides = |camera: &Camera| [0, 1].map(|k| extent.is_behind_obstacle(&timeline, camera, place(k)));
    assert_eq!((hides(&usual), hides(&shown)), ([false, true], [false; 2]));
    let (usual, shown) = cameras(&timeline, &camera("perspective"));
    assert_eq!(usual, shown, "a camera of choice stays");
}

#[test]
fn goals_fit_the_formation_and_starts_are_at_the_first_positions() {
    let timeline = timeline();
    let only = View { layers: Layers { marks: true, ..Layers::NONE }, ..camera("top") };
    let scene = scene(&timeline, 10.0, &only);
    let extent = Extent::of(&timeline);
    // Two strokes of a cross for each start, then for each slot the line from its vehicle and a ring.
    assert_eq!(scene.lines.len(), 4 * 2 + 4 * (1 + 28));
    let middle = |line: &Line| {
        let [a, b] = line.ends_m.map(|end| Vector3::from(end.map(f64::from)));
        (a + b) / 2.0 + extent.origin_m()
    };
    assert!((middle(&scene.lines[0]) - Vector3::new(0.0, 0.0, 1.0)).norm() < 1e-6);
    let ring: Vector3<f64> = scene.lines[9..37].iter().map(middle).sum::<Vector3<f64>>() / 28.0;
    assert!((ring - Vector3::new(10.0, 0.0, 1.0)).norm() < 1e-6, "{ring}");
}

/// A cross within a slot would look like an arrival.
#[test]
fn a_start_within_a_slot_has_no_cross() {
    let scenario = Scenario::read(&Source::Builtin("swap".to_owned()), &[]).expect("built in");
    let mut timeline = Timeline::of(&scenario);
    for (step, turned) in [1.0, -1.0].into_iter().enumerate() {
        let swarm = Swarm::at_rest(&scenario.start.positions_m * turned);
        timeline.take(&Sample::new(step as f64, step as u64, &swarm, &Rows::zeros(12)));
    }
    let only = View { layers: Layers { marks: true, ..Layers::NONE }, ..camera("top") };
    assert_eq!(scene(&timeline, 1.0, &only).lines.len(), 12 * (1 + 28));
}

#[test]
fn heights_are_shown_unless_the_camera_looks_straight_down() {
    let timeline = timeline();
    let only = |text: &str, ground| View { layers: Layers { ground, ..Layers::NONE }, ..camera(text) };
    let drawn = scene(&timeline, 0.0, &only("perspective", true));
    let feet: Vec<_> = drawn.discs.iter().map(|disc| disc.centre_m).collect();
    let ground_m = Extent::of(&timeline).ground.corners_m[0].z;
    assert_eq!(feet.len(), 4);
    for (ball, foot) in drawn.balls.iter().zip(&feet) {
        assert_eq!((ball.centre_m[0], ball.centre_m[1]), (foot[0], foot[1]));
        assert!((f64::from(foot[2]) - ground_m).abs() < 1e-6, "{foot:?}");
        assert!(drawn.lines.iter().any(|line| line.ends_m == [ball.centre_m, *foot]));
    }
    for view in [only("top", true), only("perspective", false)] {
        assert!(scene(&timeline, 0.0, &view).discs.is_empty());
    }
}

#[test]
fn boxes_are_solid() {
    let scenario = Scenario::read(&Source::Builtin("obstacles".to_owned()), &[]).expect("built in");
    let mut timeline = Timeline::of(&scenario);
    let swarm = Swarm::at_rest(scenario.start.positions_m.clone());
    timeline.take(&Sample::new(0.0, 0, &swarm, &Rows::zeros(8)));
    let drawn = scene(&timeline, 0.0, &View::of(&timeline));
    assert_eq!(drawn.faces.len(), 6);
    let colours: Vec<_> = drawn.faces.iter().map(|face| face.colour.rgba).collect();
    assert!(colours.iter().any(|colour| *colour != colours[0]), "sides differ in light: {colours:?}");
    assert!(scene(&self::timeline(), 0.0, &View::default()).faces.is_empty());
}

#[test]
fn a_view_leaves_out_what_would_hide_the_formation() {
    let view = |name: &str| {
        let scenario = Scenario::read(&Source::Builtin(name.to_owned()), &[]).expect("built in");
        View::of(&Timeline::of(&scenario))
    };
    let pentagon = view("pentagon");
    assert_eq!((pentagon.layers, pentagon.trail_s), (Layers::ALL, None));
    let swap = view("swap");
    assert!(!swap.layers.edges && swap.layers.marks, "a graph of 66 edges: {swap:?}");
    let thousand = view("thousand");
    assert!(!thousand.layers.marks && thousand.trail_s == Some(1.0) && !thousand.has_lights(), "{thousand:?}");
    let show = view("show");
    assert!(show.has_lights() && !show.layers.trails && show.layers.caption, "{show:?}");
}

#[test]
fn lights_are_on_a_night_sky_in_any_theme() {
    let timeline = timeline();
    for theme in [Theme::Dark, Theme::Light] {
        let view = View { theme, ..View::default() }.with_lights();
        let [clear, violated] = [2.0, 5.0].map(|time_s| scene(&timeline, time_s, &view));
        assert_eq!((clear.background, clear.discs.len()), (Theme::Dark.pick(NIGHT), 4 * 2));
        assert!(clear.discs.iter().all(|disc| disc.glow == 1.0));
        let alarm = Theme::Dark.pick(ALARM);
        assert!(clear.balls.iter().all(|ball| ball.colour != alarm));
        assert_eq!(violated.balls.iter().filter(|ball| ball.colour == alarm).count(), 2, "a violation is red");
    }
}

#[test]
fn both_vehicles_of_the_closest_pair_have_names() {
    let mut timeline = Timeline::new("crowd", 49);
    let rows: Vec<f64> = (0..49_u32).flat_map(|k| [f64::from(k % 7), f64::from(k / 7), 0.0]).collect();
    let mut positions_m = Rows::from_row_slice(&rows);
    positions_m[(24, 0)] += 0.4;
    timeline.take(&Sample::new(0.0, 0, &Swarm::at_rest(positions_m), &Rows::zeros(49)));
    let drawn = scene(&timeline, 0.0, &View::default());
    assert!(words(&drawn).contains(&"25") && words(&drawn).contains(&"26"), "{:?}", words(&drawn));
    let none = View { layers: Layers { closest: false, ..Layers::ALL }, ..View::default() };
    let drawn = scene(&timeline, 0.0, &none);
    assert!(!words(&drawn).contains(&"25"), "more than 24 vehicles have no names: {:?}", words(&drawn));
}

#[test]
fn the_automatic_camera_follows_a_swarm_that_travels_far() {
    let apart_px = |step_m: f64| {
        let mut timeline = Timeline::new("two", 2);
        for k in 0..=20_u32 {
            let x = step_m * f64::from(k);
            let swarm = Swarm::at_rest(Rows::from_row_slice(&[x, 0.0, 1.0, x, 2.0, 3.0]));
            timeline.take(&Sample::new(f64::from(k), u64::from(k), &swarm, &Rows::zeros(2)));
        }
        let drawn = scene(&timeline, 10.0, &camera("auto"));
        let [a, b] = [0, 1].map(|k| {
            let place = Vector3::from(drawn.balls[k].centre_m.map(f64::from));
            drawn.camera.project(place).expect("ahead").at_px
        });
        (a[0] - b[0]).hypot(a[1] - b[1])
    };
    let [near, far] = [0.01, 5.0].map(apart_px);
    assert!(far > 0.5 * near, "{far} and {near} pixels");
}

#[test]
fn edges_push_below_their_rest_length_and_pull_above_it() {
    let timeline = timeline();
    let plan = timeline.plan.as_ref().expect("a plan");
    assert_eq!(plan.graph, Graph::complete(4));
    let tension = |distance_m| plan.tension(Pair::new(0, 1), distance_m, 0.0);
    assert!(tension(3.0).abs() < 1e-12 && tension(2.5) < 0.0 && tension(4.0) > 0.0);
    assert_eq!((tension(2.0), tension(2.001)), (-1.0, -1.0));
    assert!(tension(1e3) > 0.999_999);
}

#[test]
fn an_unknown_vehicle_to_follow_is_refused_with_the_known_names() {
    let timeline = timeline();
    let frame = timeline.log.at(0.0).expect("a frame");
    let error = Extent::of(&timeline).camera(&timeline, &frame, &camera("follow:9")).expect_err("no vehicle 9");
    assert_eq!(error.to_string(), "there is no vehicle `9` to follow; the flight has 1, 2, 3, 4");
}

#[test]
fn any_picture_size_and_swarm_gives_a_finite_list() {
    let timeline = timeline();
    for size_px in [[1, 1], [64, 2000], [16_384, 16], [320, 180]] {
        let scene = scene(&timeline, 5.0, &View { size_px, ..View::default() });
        let finite = |point: &[f32; 2]| point.iter().all(|x| x.is_finite());
        assert!(scene.annotations.iter().all(|annotation| if let Annotation::Words { at_px, .. } = annotation {
            finite(at_px)
        } else {
            true
        }));
    }
    let mut alone = Timeline::new("alone", 1);
    let swarm = Swarm::at_rest(Rows::from_row_slice(&[f64::NAN, 0.0, 0.0]));
    alone.take(&Sample::new(0.0, 0, &swarm, &Rows::zeros(1)));
    assert!(scene(&alone, 0.0, &View::default()).balls.is_empty(), "a vehicle without a position is not drawn");
    let far = Swarm::at_rest(Rows::from_row_slice(&[5e6, 4e6, 100.0]));
    let mut far_away = Timeline::new("far", 1);
    far_away.take(&Sample::new(0.0, 0, &far, &Rows::zeros(1)));
    assert_eq!(scene(&far_away, 0.0, &View::default()).balls[0].centre_m, [0.0; 3], "drawn around its own origin");
}

#[test]
fn the_closest_pair_is_named_first_and_few_are_labelled() {
    let mut timeline = timeline();
    for (i, j) in [(0, 2), (0, 3), (1, 2), (1, 3), (2, 3)] {
        timeline.note(&Event::ViolationBegan { pair: Pair::new(i, j), time_s: 1.0 });
    }
    let scene = scene(&timeline, 5.0, &View::default());
    let banner = "VIOLATION  vehicles 1 and 2 1.500 m apart, delta 2.000 m and 5 more";
    assert!(words(&scene).contains(&banner), "{:?}", words(&scene));
    let labels = words(&scene).iter().filter(|text| text.ends_with(".000 m") || text.ends_with(".500 m")).count();
    assert!((1..=3).contains(&labels), "{:?}", words(&scene));
}

#[test]
fn the_caption_of_a_small_picture_is_shortened_without_overlap() {
    let mut timeline = timeline();
    "an exceedingly long name of a flight".clone_into(&mut timeline.name);
    let said = |size_px| {
        let scene = scene(&timeline, 3.0, &View { size_px, ..View::default() });
        let [name, time] = ["an ex", "t = "].map(|start| words(&scene).iter().any(|text| text.starts_with(start)));
        (name, time)
    };
    assert_eq!(
        [[1280, 720], [320, 240], [90, 60], [40, 30]].map(said),
        [(true, true), (true, true), (false, true), (false, false)]
    );
}

#[test]
fn a_vehicle_too_small_to_see_is_a_dot() {
    let mut swarm = Swarm::at_rest(Rows::from_row_slice(&[0.0, 0.0, 1.0, 30e3, 0.0, 1.0]));
    let mut timeline = Timeline::new("far", 2);
    for (step, time_s) in [0.0, 1.0].into_iter().enumerate() {
        swarm.positions_m[(1, 1)] = time_s;
        let control = Rows::zeros(2);
        timeline.take(&Sample::new(time_s, step as u64, &swarm, &control));
    }
    let scene = scene(&timeline, 0.0, &camera("top"));
    let projection = scene.camera.project(Vector3::zeros()).expect("ahead");
    assert!(scene.balls.iter().all(|ball| f64::from(ball.radius_m) * projection.px_per_m > 1.4), "{:?}", scene.balls);
}

#[test]
fn the_scale_is_below_the_ground_edge_on_and_its_last_number_has_the_unit() {
    let timeline = timeline();
    for text in ["perspective", "front", "side", "top"] {
        let scene = scene(&timeline, 2.0, &camera(text));
        let unit = words(&scene).iter().filter(|text| text.ends_with(" m") && !text.contains('.')).count();
        assert!((1..=2).contains(&unit), "{text}: {:?}", words(&scene));
    }
    let layers = Layers { ground: true, ..Layers::NONE };
    let front = scene(&timeline, 2.0, &View { layers, ..camera("front") });
    let ground = front.camera.project(Extent::of(&timeline).ground.corners_m[0]).expect("ahead").at_px[1];
    let numbers = front.annotations.iter().filter_map(|annotation| match annotation {
        Annotation::Words { at_px, anchor: [0.5, 0.5], text, .. }
            if text.trim_end_matches(" m").parse::<f64>().is_ok() =>
        {
            Some(at_px[1])
        }
        _ => None,
    });
    assert!(numbers.clone().count() > 2 && numbers.clone().all(|y| f64::from(y) > ground + 4.0));
}

#[test]
fn only_vehicles_in_violation_are_named_in_a_large_swarm() {
    let places: Vec<f64> = (0..100_u32).flat_map(|k| [f64::from(k % 10) * 4.0, f64::from(k / 10) * 4.0, 5.0]).collect();
    let mut swarm = Swarm::at_rest(Rows::from_row_slice(&places));
    swarm.positions_m[(99, 0)] = swarm.positions_m[(98, 0)] + 0.5;
    let mut timeline = Timeline::new("many", 100);
    timeline.delta_m = Some(1.0);
    let control = Rows::zeros(100);
    for time_s in [0.0, 1.0] {
        timeline.take(&Sample::new(time_s, 0, &swarm, &control));
    }
    timeline.note(&Event::ViolationBegan { pair: Pair::new(98, 99), time_s: 0.5 });
    let named = |time_s| {
        let layers = Layers { labels: true, ..Layers::NONE };
        let scene = scene(&timeline, time_s, &View { layers, ..camera("top") });
        words(&scene).into_iter().map(str::to_owned).collect::<Vec<_>>()
    };
    assert_eq!(named(0.0), Vec::<String>::new());
    assert_eq!(named(1.0), ["99", "100"]);
}

#[test]
fn numbers_of_the_ground_do_not_cover_vehicles_or_shells() {
    // One vehicle on the ground, and three high above its edges, which cover the edges from above.
    let places = [0.0, 0.0, 0.5, 6.0, 0.0, 9.0, 0.0, 6.0, 9.0, -6.0, -6.0, 9.0];
    let swarm = Swarm::at_rest(Rows::from_row_slice(&places));
    let mut timeline = Timeline::new("tower", 4);
    timeline.delta_m = Some(2.0);
    let control = Rows::zeros(4);
    timeline.take(&Sample::new(0.0, 0, &swarm, &control));
    let numbers = |view: &View| {
        let scene = scene(&timeline, 0.0, view);
        let number = |text: &str| text.trim_end_matches(" m").parse::<f64>().is_ok();
        let place_of = |annotation: &Annotation| match annotation {
            Annotation::Words { at_px, text, .. } if number(text) => Some(*at_px),
            _ => None,
        };
        (scene.camera, scene.annotations.iter().filter_map(place_of).collect::<Vec<_>>())
    };
    let mut dropped = 0;
    let sides = (0..360).step_by(20).flat_map(|azimuth| [5, 30, 60, 80].map(|elevation| (azimuth, elevation)));
    for (azimuth, elevation) in sides {
        let view = |shells| View {
            layers: Layers { ground: true, shells, ..Layers::NONE },
            ..camera(&format!("{azimuth},{elevation},18"))
        };
        let (camera, with) = numbers(&view(true));
        let (_, without) = numbers(&view(false));
        dropped += without.len() - with.len().min(without.len());
        for k in 0..4 {
            let place =
                Extent::of(&timeline).place(&timeline.log.at(0.0).expect("a frame").positions_m, k).expect("there");
            let Some(ball) = camera.project(place) else { continue };
            let clear = |point: &[f32; 2]| {
                let [x, y] = [0, 1].map(|axis| f64::from(point[axis]) - ball.at_px[axis]);
                x.hypot(y) > 1.0 * ball.px_per_m
            };
            assert!(with.iter().all(clear), "{azimuth}, {elevation} degrees");
        }
    }
    assert!(dropped > 0, "shells cover numbers from some side");
}

/// A later leg behind a moving reference: goals are the slots of that leg at the reference's position.
#[test]
fn goals_are_those_of_the_current_leg_at_the_reference() {
    use tautline_laws::target::{Guidance, Leg, LegTrigger, ReferenceMotion};

    let start = Swarm::at_rest(Formation::line(4, 3.0).slots_m);
    let mut scenario = Scenario::new("legs", start.clone(), Formation { slots_m: start.positions_m }, 2.0, 10.0);
    scenario.law = tautline_laws::law::LawSpec::Displacement(tautline_laws::law::DisplacementKeys::default());
    let next = Leg { begins: LegTrigger::At(1.0), ..Leg::first(Formation::grid(4, 5.0)) };
    scenario.legs.push(next);
    scenario.reference = Some(Guidance {
        motion: ReferenceMotion::Velocity { from_m: Vector3::zeros(), velocity_m_s: Vector3::new(0.5, 0.0, 0.0) },
        known_by: tautline_laws::graph::Pinning::Leader(2),
        feed_forward: true,
    });
    let mut plan = tautline_sim::plan::Plan::of(&scenario);
    plan.note(&tautline_core::record::Event::LegBegan { leg: 1, time_s: 1.0 });
    let slot = |time_s: f64, k: usize| plan.slots_at(time_s, &Rows::zeros(4)).expect("slots")[k];
    let first_m = row(&scenario.legs[0].formation.slots_m, 1);
    assert_eq!(slot(0.5, 1), first_m + Vector3::new(0.25, 0.0, 0.0));
    assert_eq!(slot(2.0, 1), Vector3::new(5.0 + 1.0, 0.0, 0.0));
    assert_eq!((plan.leg_at(0.5), plan.leg_at(2.0), plan.leader()), ((0, 2), (1, 2), Some(2)));
}

#[test]
fn the_closest_approach_is_the_same_in_report_figure_replay_and_picture() {
    let mut scenario = Scenario::read(&Source::Builtin("swap".to_owned()), &[]).expect("built in");
    scenario.time.record_hz = 1.0;
    let mut log = FlightLog::of(&scenario);
    let report = run(&scenario, &mut log).expect("a flight");
    let closest = report.closest_pair().expect("a pair");
    let (min_m, at_s, [first, second]) = (closest.separation_m, closest.time_s, closest.pair.numbers());
    log.conclude(min_m, at_s);
    let closest = log.closest().expect("an approach");
    assert_eq!((closest.separation_m, closest.time_s, closest.pair.numbers()), (min_m, at_s, [first, second]));
    let sampled = log.keyframes().iter().filter_map(|keyframe| closest_pair(&keyframe.positions_m));
    let sampled_m = sampled.map(|(_, distance_m)| distance_m).fold(f64::INFINITY, f64::min);
    assert!(sampled_m > 1.02 * min_m, "the closest approach lies between samples: {sampled_m} m and {min_m} m");
    assert_eq!(log.peak_control().map(|[peak, _]| peak), report.control.peak_m_s2);

    let metres = format!("{} m", tautline_core::text::at_least(min_m, 3));
    let figure = figures::distances(&log, scenario.delta_m, None, "Distances");
    assert!(
        figure.description.contains(&format!("Closest: {metres}, vehicles {first} and {second}")),
        "{}",
        figure.description
    );
    let control = figures::control(&log, "Control").description;
    let peak = report.control.peak_m_s2.expect("a peak");
    assert!(control.contains(&format!("at most {peak:.3} m/s")), "{control}");
    let replay = replay_of_run(&scenario, &log, &report, PAGE_BYTES).expect("a replay");
    let in_replay = format!("closest so far {metres}, {first} and {second}");
    assert!(replay.json.contains(&in_replay), "{in_replay}");

    let timeline = Timeline::flown(&scenario, Arc::new(log));
    let scene = scene(&timeline, at_s, &View::default());
    let caption = words(&scene).into_iter().find(|words| words.starts_with("closest so far")).expect("a caption");
    assert!(caption.starts_with(&format!("closest so far {metres}, vehicles {first} and {second}")), "{caption}");
    assert!(words(&scene).contains(&metres.as_str()), "{:?}", words(&scene));
    assert!(report.headline().contains(&metres), "{}", report.headline());
}

/// Vehicles with a known attitude.
mod quadrotors {
    use nalgebra::{UnitQuaternion, Vector3};

    use super::super::*;
    use crate::timeline::Timeline;
    use tautline_core::record::{Channel, Sample};
    use tautline_core::swarm::{Rows, Swarm};
    use tautline_report::drawing::Rotors;

    const PLACES_M: [f64; 6] = [0.0, 0.0, 1.0, 3.0, 0.0, 1.0];

    /// Returns two vehicles 3 m apart with the same attitude.
    fn timeline(attitude: Option<UnitQuaternion<f64>>) -> Timeline {
        let swarm = Swarm::at_rest(Rows::from_row_slice(&PLACES_M));
        let mut timeline = Timeline::new("pair", 2);
        timeline.radius_m = vec![0.25; 2];
        timeline.delta_m = Some(1.0);
        let mut channels = Vec::new();
        if let Some(q) = attitude {
            let values = [q.w, q.i, q.j, q.k].repeat(2);
            channels.push(Channel { values, ..Channel::new("attitude", &["qw", "qx", "qy", "qz"]) });
        }
        let control = Rows::zeros(2);
        timeline.take(&Sample { channels: &channels, ..Sample::new(0.0, 0, &swarm, &control) });
        timeline
    }

    fn scene(timeline: &Timeline, size_px: [u32; 2]) -> Scene {
        let (frame, extent) = (timeline.log.at(0.0).expect("a frame"), Extent::of(timeline));
        let view = View { size_px, layers: Layers { shells: true, ..Layers::NONE }, ..View::default() };
        let camera = extent.camera(timeline, &frame, &view).expect("a camera");
        Scene::compose(timeline, &extent, &frame, &view, camera)
    }

    /// Returns the largest distance of discs from the rotors of both vehicles at an attitude \[m\].
    fn off_m(timeline: &Timeline, attitude: UnitQuaternion<f64>) -> f64 {
        let (rotors, origin_m) = (Rotors::within(0.25), Extent::of(timeline).origin_m());
        let scene = scene(timeline, [1280, 720]);
        assert_eq!(scene.discs.len(), 8);
        let expected = PLACES_M.chunks_exact(3).flat_map(|place| {
            let place = Vector3::new(place[0], place[1], place[2]) - origin_m;
            rotors.places_m().map(|rotor_m| place + attitude * rotor_m)
        });
        let nearest = |rotor: Vector3<f64>| {
            let off = |disc: &Disc| {
                let normal = Vector3::from(disc.normal.map(f64::from));
                let centre = Vector3::from(disc.centre_m.map(f64::from));
                (centre - rotor).norm() + (normal - attitude * Vector3::z()).norm()
            };
            scene.discs.iter().map(off).fold(f64::INFINITY, f64::min)
        };
        expected.map(nearest).fold(0.0, f64::max)
    }

    #[test]
    fn the_discs_of_a_tilted_quadrotor_follow_its_attitude() {
        let tilted = UnitQuaternion::from_euler_angles(0.3, -0.4, 1.1);
        assert!(off_m(&timeline(Some(tilted)), tilted) < 1e-6);
        assert!(
            off_m(&timeline(Some(tilted)), UnitQuaternion::identity()) > 0.05,
            "the discs differ from those of a level vehicle"
        );
        assert!(
            off_m(&timeline(Some(tilted)), tilted.inverse()) > 0.05,
            "the discs differ from those of the inverse attitude"
        );
    }

    #[test]
    fn a_quadrotor_has_a_shell_and_a_mark_ahead() {
        let left = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::FRAC_PI_2);
        let timeline = timeline(Some(left));
        let scene = scene(&timeline, [1280, 720]);
        assert_eq!(scene.shells.len(), 2);
        // A body and a mark ahead per vehicle.
        assert_eq!(scene.balls.len(), 4);
        let [body, nose] = [0, 1].map(|k| Vector3::from(scene.balls[k].centre_m.map(f64::from)));
        let ahead = (nose - body).normalize();
        assert!((ahead - Vector3::y()).norm() < 1e-6, "{ahead}");
        assert!(scene.balls[1].radius_m < scene.balls[0].radius_m && scene.balls[0].radius_m < 0.25);
    }

    #[test]
    fn a_small_vehicle_or_one_without_attitude_is_a_ball() {
        let level = timeline(Some(UnitQuaternion::identity()));
        let small = scene(&level, [28, 16]);
        let unknown = scene(&timeline(None), [28, 16]);
        assert_eq!((small.balls, small.discs.len(), small.lines.len()), (unknown.balls, 0, 0));
        let large = scene(&timeline(None), [1280, 720]);
        assert_eq!((large.balls.len(), large.discs.len(), large.lines.len()), (2, 0, 0));
    }
}
