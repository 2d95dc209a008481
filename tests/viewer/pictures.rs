//! Rendering: sizes, colours, occlusion, and comparison with reference pictures.
//!
//! Needs a graphics adapter, or a software driver; `tests/run.sh` installs one.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use nalgebra::Vector3;
use tautline::record::{Event, Sample};
use tautline::render::gpu::Renderer;
use tautline::render::scene::{Ball, Camera, Colour, Lens, Line, Orbit};
use tautline::render::{
    AdapterChoice, CameraSpec, Colouring, FlightLog, Layers, Picture, RenderError, Scene, Theme, Timeline, View,
};
use tautline::run::run;
use tautline::scenario::{Scenario, Source};
use tautline::swarm::{ClosestApproach, Pair, Rows, Swarm};

/// Largest mean FLIP of two pictures that look the same; adapters round differently at edges. Five small balls that
/// move by a part of their width give 0.005 (see `a_moved_vehicle_changes_the_picture`).
const MAX_FLIP: f32 = 0.003;

fn renderer() -> Renderer {
    Renderer::open(&AdapterChoice::Best)
        .unwrap_or_else(|error| panic!("{error}; `sh tests/run.sh` installs what this test needs"))
}

const BACKGROUND: Colour = Colour::hex(0x12_34_56);
const WHITE: Colour = Colour::hex(0xFF_FF_FF);
const RED: Colour = Colour::hex(0xC0_00_00);
const SIZE: [u32; 2] = [301, 201];

/// Returns a scene seen from +x, 10 m away, y to the right.
fn scene(lens: Option<f64>, balls: &[Ball]) -> Scene {
    let orbit = Orbit { azimuth_deg: 0.0, elevation_deg: 0.0, distance_m: 10.0 };
    let mut camera = Camera::orbiting(orbit, Vector3::zeros(), SIZE);
    if let Some(half_m) = lens {
        camera.lens = Lens::Parallel([half_m * f64::from(SIZE[0]) / f64::from(SIZE[1]), half_m]);
    }
    Scene {
        shell_ratio: 1.0,
        camera,
        depth_m: [1.0, 30.0],
        background: BACKGROUND,
        balls: balls.to_vec(),
        faces: Vec::new(),
        discs: Vec::new(),
        shells: Vec::new(),
        lines: Vec::new(),
        annotations: Vec::new(),
    }
}

fn ball(centre_m: [f32; 3], radius_m: f32, colour: Colour) -> Ball {
    Ball { centre_m, radius_m, colour }
}

fn is_background(pixel: [u8; 4]) -> bool {
    pixel == BACKGROUND.rgba
}

/// Returns the bounding box of all pixels that differ from the background: left, right, top, bottom.
fn extent(picture: &Picture) -> [u32; 4] {
    let mut extent = [u32::MAX, 0, u32::MAX, 0];
    for y in 0..picture.size_px[1] {
        for x in 0..picture.size_px[0] {
            if !is_background(picture.pixel(x, y).expect("inside")) {
                extent = [extent[0].min(x), extent[1].max(x), extent[2].min(y), extent[3].max(y)];
            }
        }
    }
    extent
}

#[test]
fn the_background_is_exactly_its_colour() {
    let picture = renderer().paint(&scene(None, &[])).expect("a picture");
    assert_eq!(picture.size_px, SIZE);
    assert!(picture.rgba.chunks_exact(4).all(|pixel| pixel == BACKGROUND.rgba));
}

#[test]
fn a_ball_has_the_width_of_its_radius() {
    let mut renderer = renderer();
    let tangent = (35.0_f64 / 2.0).to_radians().tan();
    for radius_m in [0.05_f32, 0.25, 1.0, 2.5] {
        // In perspective the outline is where rays touch the ball: at the tangent of asin(r / d).
        let outline = (f64::from(radius_m) / 10.0).asin().tan() / tangent * 100.5;
        let parallel = f64::from(radius_m) / 3.0 * 100.5;
        for (lens, expected_px) in [(None, outline), (Some(3.0), parallel)] {
            let picture = renderer.paint(&scene(lens, &[ball([0.0; 3], radius_m, WHITE)])).expect("a picture");
            let [left, right, top, bottom] = extent(&picture).map(f64::from);
            for width in [right - left + 1.0, bottom - top + 1.0] {
                // A pixel at each end may be touched or not.
                let slack = width - 2.0 * expected_px;
                assert!((-0.6..=2.0).contains(&slack), "{radius_m} m: {width} pixels, expected {}", 2.0 * expected_px);
            }
            assert!((left + right + 1.0 - 301.0).abs() <= 1.0 && (top + bottom + 1.0 - 201.0).abs() <= 1.0);
        }
    }
}

#[test]
fn the_ratio_scales_only_the_height_of_a_shell() {
    let mut renderer = renderer();
    for (ratio, lens, radius_m) in [(1.0_f32, 3.0, 1.0_f32), (2.5, 3.0, 1.0), (0.4, 3.0, 2.0)] {
        let mut scene = scene(Some(lens), &[]);
        scene.shells.push(ball([0.0; 3], radius_m, WHITE));
        scene.shell_ratio = ratio;
        let [left, right, top, bottom] = extent(&renderer.paint(&scene).expect("a picture")).map(f64::from);
        let width_px = 201.0 * f64::from(radius_m) / lens;
        for (found, expected) in [(right - left + 1.0, width_px), (bottom - top + 1.0, width_px * f64::from(ratio))] {
            assert!((-0.6..=2.0).contains(&(found - expected)), "{ratio}: {found} pixels, expected {expected}");
        }
    }
}

#[test]
fn balls_behind_the_camera_are_not_drawn() {
    let mut renderer = renderer();
    let behind = vec![ball([12.0, 0.0, 0.0], 0.5, WHITE); 1000];
    let mut crowd = scene(None, &behind);
    crowd.shells = behind;
    let picture = renderer.paint(&crowd).expect("a picture");
    assert!(picture.rgba.chunks_exact(4).all(|pixel| pixel == BACKGROUND.rgba));
}

#[test]
fn a_ball_is_omitted_only_if_it_is_outside_the_picture() {
    let mut renderer = renderer();
    let tangent = (35.0_f64 / 2.0).to_radians().tan();
    let (across, up) = (10.0 * tangent * 301.0 / 201.0, 10.0 * tangent);
    // Beyond the edge by less and by more than the radius.
    for (beyond_m, is_seen) in [(0.4, true), (0.6, false)] {
        for (y, z) in [(across + beyond_m, 0.0), (-across - beyond_m, 0.0), (0.0, up + beyond_m), (0.0, -up - beyond_m)]
        {
            #[expect(clippy::cast_possible_truncation, reason = "the draw list is in single precision")]
            let ball = ball([0.0, y as f32, z as f32], 0.5, WHITE);
            let mut solid = scene(None, &[ball]);
            let mut shell = scene(None, &[]);
            shell.shells.push(ball);
            for picture in [&mut solid, &mut shell].map(|scene| renderer.paint(scene).expect("a picture")) {
                let seen = picture.rgba.chunks_exact(4).any(|pixel| pixel != BACKGROUND.rgba);
                assert_eq!(seen, is_seen, "{beyond_m} m beyond the edge at {y}, {z}");
            }
        }
    }
}

#[test]
fn a_later_line_covers_an_earlier_one() {
    let mut crossed = scene(None, &[]);
    // Along a slanted line of sight, so that the depths agree only up to rounding.
    let ends_m = [[-5.0, -2.0, -0.3], [5.0, 2.0, 0.3]];
    crossed.lines.push(Line { ends_m, colours: [WHITE; 2], width_px: 2.0 });
    let under = extent(&renderer().paint(&crossed).expect("a picture"));
    crossed.lines.push(Line { ends_m: [ends_m[1], ends_m[0]], colours: [RED; 2], width_px: 6.0 });
    let picture = renderer().paint(&crossed).expect("a picture");
    assert!(under[1] > under[0] && picture.rgba.chunks_exact(4).all(|pixel| pixel[1] <= BACKGROUND.rgba[1]));
}

#[test]
fn a_close_up_in_a_flight_of_thirty_kilometres_shows_edges() {
    let scenario = Scenario::read(&Source::Builtin("pentagon".to_owned()), &[]).expect("built in");
    let mut timeline = Timeline::of(&scenario);
    let mut swarm = Swarm::at_rest(scenario.start.positions_m.clone());
    for (step, time_s) in [0.0, 1.0].into_iter().enumerate() {
        swarm.positions_m[(4, 0)] += 30e3 * time_s;
        let control = Rows::zeros(5);
        timeline.take(&Sample::new(time_s, step as u64, &swarm, &control));
    }
    let view = View {
        layers: Layers { edges: true, ..Layers::NONE },
        camera: "closest".parse().expect("a camera"),
        ..small()
    };
    let mut renderer = renderer();
    let with = renderer.shoot(&timeline, 0.0, &view).expect("a picture");
    let without = renderer.shoot(&timeline, 0.0, &View { layers: Layers::NONE, ..view }).expect("a picture");
    let (difference, _) = flip(&without, &with);
    assert!(difference > MAX_FLIP, "the edges are missing: {difference}");
}

#[test]
fn the_edge_of_a_ball_is_smooth() {
    let picture = renderer().paint(&scene(Some(3.0), &[ball([0.0; 3], 1.0, WHITE)])).expect("a picture");
    // An edge pixel is a mixture of ball and background, in quarters of its coverage.
    let half_covered = picture
        .rgba
        .chunks_exact(4)
        .filter(|pixel| pixel[2] != BACKGROUND.rgba[2] && pixel[2] < 150 && pixel[0] < pixel[2])
        .count();
    assert!(half_covered > 20, "{half_covered} pixels at the edge are mixed with the background");
}

#[test]
fn a_ball_in_front_hides_one_behind_in_any_order() {
    let mut renderer = renderer();
    let front = ball([2.0, 0.0, 0.0], 0.5, RED);
    let behind = ball([-2.0, 0.0, 0.0], 0.5, WHITE);
    for balls in [[front, behind], [behind, front]] {
        let picture = renderer.paint(&scene(Some(3.0), &balls)).expect("a picture");
        let [red, green, _, _] = picture.pixel(150, 100).expect("inside");
        assert!(red > 90 && green < 60, "the middle is red");
        let no_white = picture.rgba.chunks_exact(4).all(|pixel| pixel[1] < 200);
        assert!(no_white, "the white ball is hidden");
    }
    let beside = renderer.paint(&scene(Some(3.0), &[front, ball([-2.0, 1.5, 0.0], 0.5, WHITE)])).expect("a picture");
    assert!(beside.rgba.chunks_exact(4).any(|pixel| pixel[1] > 200), "beside the red ball the white one is visible");
}

#[test]
fn a_shell_is_transparent_and_may_contain_the_camera() {
    let mut renderer = renderer();
    let mut inside = scene(Some(3.0), &[ball([0.0; 3], 0.5, RED)]);
    let bare = renderer.paint(&inside).expect("a picture");
    inside.shells.push(ball([0.0; 3], 1.0, WHITE.at(0.5)));
    let shelled = renderer.paint(&inside).expect("a picture");
    let middle = |picture: &Picture| picture.pixel(150, 100).expect("inside");
    assert!(middle(&shelled)[0] > 90 && middle(&shelled)[1] > middle(&bare)[1], "red, seen through white");
    let mut within = scene(None, &[]);
    within.shells.push(ball([10.0, 0.0, 0.0], 2.0, WHITE.at(0.5)));
    let picture = renderer.paint(&within).expect("a picture");
    assert!(
        picture.rgba.chunks_exact(4).all(|pixel| !is_background(pixel.try_into().expect("four"))),
        "the shell covers the whole picture"
    );
}

#[test]
fn a_line_has_its_width_and_colour() {
    let mut picture = scene(Some(3.0), &[]);
    let ends_m = [[0.0, -1.0, 0.0], [0.0, 1.0, 0.0]];
    picture.lines.push(Line { ends_m, colours: [RED; 2], width_px: 6.0 });
    let picture = renderer().paint(&picture).expect("a picture");
    let [left, right, top, bottom] = extent(&picture);
    assert_eq!(picture.pixel(150, 100), Some(RED.rgba));
    assert!((6..=7).contains(&(bottom - top + 1)) && (66..=68).contains(&(right - left + 1)), "{left} {right}");
}

#[test]
fn frames_are_identical_on_every_renderer() {
    let timeline = crossing();
    let shoot = |renderer: &mut Renderer| renderer.shoot(&timeline, 2.0, &small()).expect("a picture");
    let (mut first, mut second) = (renderer(), renderer());
    let once = shoot(&mut first);
    assert!(once == shoot(&mut first) && once == shoot(&mut second));
    assert!(once != first.shoot(&timeline, 2.1, &small()).expect("a picture"), "pictures at two times differ");
}

#[test]
fn a_size_that_cannot_be_drawn_is_refused() {
    let mut renderer = renderer();
    for size_px in [[0, 10], [10, 0], [100_000, 10], [10, 100_000]] {
        let refused = renderer.shoot(&crossing(), 0.0, &View { size_px, ..View::default() }).expect_err("too large");
        assert!(refused.to_string().contains("pixels a side"), "{refused}");
    }
    for size_px in [[1, 1], [7, 333]] {
        let picture = renderer.shoot(&crossing(), 0.0, &View { size_px, ..View::default() }).expect("a picture");
        assert_eq!(picture.rgba.len(), size_px[0] as usize * size_px[1] as usize * 4);
    }
    let none = Renderer::open(&AdapterChoice::Named("no such adapter".to_owned())).err();
    assert!(matches!(none, Some(RenderError::NoSuchAdapter(_))), "{none:?}");
}

/// Returns vehicles that pass each other; two of them are too close from 2 s to 3 s.
fn crossing() -> Timeline {
    let scenario = Scenario::read(&Source::Builtin("pentagon-laplacian".to_owned()), &[]).expect("built in");
    let mut timeline = Timeline::of(&scenario);
    for k in 0..=40_u32 {
        let time_s = f64::from(k) / 10.0;
        let mut swarm = Swarm::at_rest(scenario.start.positions_m.clone());
        for vehicle in 0..5 {
            let turn = time_s * (0.2 + 0.1 * vehicle as f64);
            swarm.positions_m[(vehicle, 1)] += 2.0 * turn.sin();
        }
        let separation = Some(ClosestApproach { pair: Pair::new(0, 2), separation_m: 3.0 - 0.4 * time_s, time_s });
        let control = Rows::zeros(5);
        timeline.take(&Sample { separation, ..Sample::new(time_s, u64::from(k), &swarm, &control) });
    }
    timeline.note(&Event::ViolationBegan { pair: Pair::new(0, 2), time_s: 2.0 });
    timeline.note(&Event::ViolationEnded { pair: Pair::new(0, 2), time_s: 3.0, min_m: 1.8 });
    timeline
}

fn small() -> View {
    View { size_px: [320, 180], ..View::default() }
}

fn medium() -> View {
    View { size_px: [480, 270], ..View::default() }
}

fn reference_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/pictures")
}

fn read_png(path: &Path) -> Picture {
    let file = fs::File::open(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let mut reader = png::Decoder::new(std::io::BufReader::new(file)).read_info().expect("a PNG");
    let mut rgb = vec![0; reader.output_buffer_size().expect("a size")];
    let info = reader.next_frame(&mut rgb).expect("a picture");
    let rgba = rgb.chunks_exact(3).flat_map(|pixel| [pixel[0], pixel[1], pixel[2], 255]).collect();
    Picture { size_px: [info.width, info.height], rgba }
}

fn flip_image(picture: &Picture) -> nv_flip::FlipImageRgb8 {
    let rgb: Vec<u8> = picture.rgba.chunks_exact(4).flat_map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect();
    nv_flip::FlipImageRgb8::with_data(picture.size_px[0], picture.size_px[1], &rgb)
}

/// Returns the mean FLIP of two pictures, from 0 to 1, and a map of their differences.
fn flip(expected: &Picture, actual: &Picture) -> (f32, Picture) {
    let map = nv_flip::flip(flip_image(expected), flip_image(actual), nv_flip::DEFAULT_PIXELS_PER_DEGREE);
    let mean = nv_flip::FlipPool::from_image(&map).mean();
    let shown = map.apply_color_lut(&nv_flip::magma_lut()).to_vec();
    let rgba = shown.chunks_exact(3).flat_map(|pixel| [pixel[0], pixel[1], pixel[2], 255]).collect();
    (mean, Picture { size_px: actual.size_px, rgba })
}

/// Compares a picture with `NAME.png` of a folder, up to a mean FLIP. If they differ, writes the actual picture and
/// the difference to the target folder. `UPDATE_PICTURES=1` overwrites the reference.
fn assert_looks_like(folder: &Path, name: &str, actual: &Picture, max_flip: f32) {
    let path = folder.join(format!("{name}.png"));
    if std::env::var_os("UPDATE_PICTURES").is_some() {
        fs::create_dir_all(folder).expect("a folder");
        fs::write(&path, actual.to_png().expect("a PNG")).expect("written");
    }
    let expected = read_png(&path);
    assert_eq!(expected.size_px, actual.size_px, "{name}");
    let (mean, difference) = flip(&expected, actual);
    if mean > max_flip {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
        let write = |suffix: &str, picture: &Picture| {
            let path = folder.join(format!("{name}-{suffix}.png"));
            fs::write(&path, picture.to_png().expect("a PNG")).expect("written");
            path
        };
        let (actual, difference) = (write("actual", actual), write("difference", &difference));
        panic!("{name}: mean FLIP {mean} above {max_flip}: see {} and {}", actual.display(), difference.display());
    }
}

#[test]
fn pictures_match_their_references() {
    let (timeline, mut renderer) = (crossing(), renderer());
    let mut shoot = |name: &str, time_s: f64, view: View| {
        assert_looks_like(&reference_folder(), name, &renderer.shoot(&timeline, time_s, &view).expect(name), MAX_FLIP);
    };
    let camera = |text: &str| text.parse().expect("a camera");
    shoot("start", 0.0, small());
    shoot("violation", 2.5, View { theme: Theme::Light, camera: camera("perspective"), ..small() });
    shoot("top", 4.0, View { camera: camera("top"), theme: Theme::Light, ..medium() });
    shoot("speed", 2.5, View { camera: camera("follow"), colouring: Colouring::Speed, ..medium() });
    shoot("vehicles", 4.0, View { layers: Layers::NONE, ..small() });
}

/// Largest mean FLIP between a picture of the README and a fresh one. Both are drawn on the processor and have the
/// same bytes on one machine. Another C library may round differently.
const MAX_FLIP_OF_GALLERY: f32 = 0.0005;

/// `UPDATE_PICTURES=1` draws the pictures of the README anew.
#[test]
fn pictures_of_the_readme_are_those_of_the_program() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/gallery");
    let mut renderer = Renderer::open(&AdapterChoice::None).expect("no adapter needed");
    for (name, scenario, time_s, camera) in [
        // The closest approach.
        ("violation", "pentagon-laplacian", None, CameraSpec::Closest),
        ("obstacles", "obstacles", Some(10.0), CameraSpec::Auto),
        ("show", "show", Some(23.8), CameraSpec::Follow(None)),
    ] {
        let scenario = Scenario::read(&Source::Builtin(scenario.to_owned()), &[]).expect("built in");
        let mut log = FlightLog::of(&scenario);
        let report = run(&scenario, &mut log).expect("flown");
        let timeline = Timeline::flown(&scenario, Arc::new(log)).judged(report.answer.status);
        let time_s = time_s.or(timeline.log.closest().map(|closest| closest.time_s)).expect("two vehicles");
        let view = View { camera, size_px: [960, 540], ..View::of(&timeline) };
        let shoot = |renderer: &mut Renderer, time_s: f64| renderer.shoot(&timeline, time_s, &view).expect("a picture");
        let picture = shoot(&mut renderer, time_s);
        assert_looks_like(&folder, name, &picture, MAX_FLIP_OF_GALLERY);
        let (earlier, _) = flip(&picture, &shoot(&mut renderer, time_s - 0.5));
        assert!(earlier > MAX_FLIP_OF_GALLERY, "{name}: a picture half a second earlier differs by {earlier} only");
    }
}

/// Largest mean FLIP of the pictures of an adapter and of the processor.
const MAX_FLIP_OF_SOFTWARE: f32 = 0.02;

#[test]
fn pictures_without_an_adapter_look_like_those_of_an_adapter() {
    let (mut software, mut renderer) = (Renderer::open(&AdapterChoice::None).expect("no adapter needed"), renderer());
    assert!(software.adapter().contains("without a graphics adapter"));
    let timeline = crossing();
    for camera in ["perspective", "top", "closest", "30,-20,4"] {
        let view = View { camera: camera.parse().expect("a camera"), ..medium() };
        let [with, without] =
            [&mut renderer, &mut software].map(|renderer| renderer.shoot(&timeline, 2.5, &view).expect("a picture"));
        let (difference, _) = flip(&with, &without);
        assert!(difference < MAX_FLIP_OF_SOFTWARE, "{camera}: {difference}");
        assert!(without == software.shoot(&timeline, 2.5, &view).expect("a picture"), "{camera}: the same bytes");
    }
    let scenario = Scenario::read(&Source::Builtin("obstacles".to_owned()), &[]).expect("built in");
    let mut houses = Timeline::of(&scenario);
    houses.take(&Sample::new(0.0, 0, &Swarm::at_rest(scenario.start.positions_m.clone()), &Rows::zeros(8)));
    let camera = "-40,20,40".parse().expect("a camera");
    let front = View { camera, layers: Layers::NONE, ..medium() };
    for (what, timeline, view) in [("houses", &houses, front), ("lights", &timeline, medium().with_lights())] {
        let [with, without] =
            [&mut renderer, &mut software].map(|renderer| renderer.shoot(timeline, 2.5, &view).expect("a picture"));
        let (difference, _) = flip(&with, &without);
        assert!(difference < MAX_FLIP_OF_SOFTWARE, "{what}: {difference}");
    }
    let refused = software.check_size([0, 10]).expect_err("too small").to_string();
    assert!(refused.contains("pixels a side"), "{refused}");
}

#[test]
fn a_moved_vehicle_changes_the_picture() {
    let mut renderer = renderer();
    let bare = View { layers: Layers::NONE, ..small() };
    let timeline = crossing();
    let [first, second] = [2.0, 2.1].map(|time_s| renderer.shoot(&timeline, time_s, &bare).expect("a picture"));
    let (same, _) = flip(&first, &first);
    let (moved, _) = flip(&first, &second);
    assert_eq!(same, 0.0);
    assert!(moved > MAX_FLIP, "{moved}");
}
