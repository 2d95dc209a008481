use proptest::prelude::*;

use super::*;
use crate::formation::{Formation, Ink};
use tautline_core::swarm::row;

const STAR: &str = "M50 0 L61 35 L98 35 L68 57 L79 91 L50 70 L21 91 L32 57 L2 35 L39 35 Z";
const CIRCLE: &str = "M 10 0 A 10 10 0 1 1 -10 0 A 10 10 0 1 1 10 0 Z";

fn slots(drawing: Result<Drawing, DrawingError>, count: usize) -> Formation {
    drawing.and_then(|drawing| drawing.slots(count)).expect("a drawing")
}

/// Returns the distance of each slot to its nearest one, smallest first.
fn nearest_m(formation: &Formation) -> Vec<f64> {
    let count = formation.count();
    let others = |i: usize| (0..count).filter(move |&j| j != i);
    let nearest = |i: usize| others(i).map(|j| formation.desired_distance(i, j)).fold(f64::INFINITY, f64::min);
    let mut nearest: Vec<f64> = (0..count).map(nearest).collect();
    nearest.sort_by(f64::total_cmp);
    nearest
}

/// Whether all slots have about the same distance to their nearest one.
fn is_even(formation: &Formation) -> bool {
    let nearest_m = nearest_m(formation);
    let median_m = nearest_m[nearest_m.len() / 2];
    nearest_m[0] > 0.65 * median_m && nearest_m[nearest_m.len() - 1] < 1.6 * median_m
}

/// Returns the number of slots in a part of the drawing. Coordinates are relative to its centre and longer side.
fn within(formation: &Formation, x: std::ops::Range<f64>, y: std::ops::Range<f64>) -> usize {
    let slots_m = &formation.slots_m;
    (0..formation.count()).filter(|&i| x.contains(&slots_m[(i, 0)]) && y.contains(&slots_m[(i, 1)])).count()
}

/// Returns a PNG file whose pixels are given by column and row from above.
fn png(width: u32, height: u32, pixel: impl Fn(u32, u32) -> [u8; 4]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = ::png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(::png::ColorType::Rgba);
    encoder.set_depth(::png::BitDepth::Eight);
    let pixels: Vec<u8> =
        (0..height).flat_map(|y| (0..width).map(move |x| [x, y])).flat_map(|[x, y]| pixel(x, y)).collect();
    let mut writer = encoder.write_header().expect("a header");
    writer.write_image_data(&pixels).expect("pixels");
    writer.finish().expect("an end");
    bytes
}

const BLACK: [u8; 4] = [0, 0, 0, 255];
const WHITE: [u8; 4] = [255; 4];
const CLEAR: [u8; 4] = [0; 4];

#[test]
fn a_line_and_a_circle_are_divided_evenly() {
    for count in [2, 3, 7, 24, 101] {
        for path in ["M 0 0 L 10 0", "M 3 1 L 3 9 V 11"] {
            let line = nearest_m(&slots(Drawing::path(path, false), count));
            assert!(line.iter().all(|apart_m| (apart_m * count as f64 - 1.0).abs() < 1e-9), "{count}: {line:?}");
        }
        let circle = nearest_m(&slots(Drawing::path(CIRCLE, false), count));
        let chord_m = libm::sin(std::f64::consts::PI / count as f64);
        assert!(circle.iter().all(|apart_m| (apart_m / chord_m - 1.0).abs() < 1e-3), "{count}: {circle:?}");
    }
}

#[test]
fn slots_are_spread_evenly_over_letters_lines_and_areas() {
    for (drawing, count) in [
        (Drawing::text("HELLO"), 60),
        (Drawing::text("HELLO"), 200),
        (Drawing::path(STAR, false), 33),
        (Drawing::path(STAR, true), 100),
        (Drawing::path("M0 0 L10 10 M0 10 L10 0 M5 -1 L5 11", false), 31),
        (Drawing::png(&png(40, 40, |x, y| if x > y { BLACK } else { WHITE }), None), 80),
    ] {
        let formation = slots(drawing, count);
        assert_eq!(formation.count(), count);
        assert!(is_even(&formation), "{:?}", nearest_m(&formation));
        let mut uneven = formation.clone();
        let beside = row(&formation.slots_m, 0).lerp(&row(&formation.slots_m, 1), 0.9);
        tautline_core::swarm::set_row(&mut uneven.slots_m, 0, beside);
        assert!(!is_even(&uneven));
    }
}

#[test]
fn the_same_drawing_has_the_same_slots_and_neighbours_have_near_numbers() {
    let formation = slots(Drawing::text("Rapier 8"), 150);
    assert_eq!(formation, slots(Drawing::text("Rapier 8"), 150));
    let steps_m: f64 = (1..150).map(|i| formation.desired_distance(i - 1, i)).sum();
    assert!(steps_m < 6.0, "{steps_m} m from slot to slot over a drawing of 1 m");
}

#[test]
fn letters_have_their_shapes_and_order() {
    // The upright of L is on the left and its foot below, with nothing at the upper right. T is the opposite.
    let l = slots(Drawing::text("L"), 30);
    assert_eq!(within(&l, 0.0..1.0, -0.3..1.0), 0);
    assert!(within(&l, -1.0..-0.1, -0.3..1.0) > 12 && within(&l, 0.0..1.0, -1.0..-0.4) > 3);
    let t = slots(Drawing::text("T"), 30);
    assert_eq!(within(&t, -1.0..-0.15, -1.0..0.3) + within(&t, 0.15..1.0, -1.0..0.3), 0);
    let [width, height] = Drawing::text("L L").expect("letters").size();
    assert!(width == 1.0 && height > 0.4 && height < 0.8, "{height}");
    let lines = slots(Drawing::text("TT\nTT"), 80);
    assert_eq!(within(&lines, -1.0..1.0, -1.0..0.0), 40);
    assert_eq!(within(&slots(Drawing::text("\u{00c4}\u{03a9}\u{042f}\u{2192}"), 60), -0.5..0.5, -0.5..0.5), 60);
}

#[test]
fn an_svg_file_is_drawn_as_it_looks() {
    let file =
        |inside: &str| format!(r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 100 100">{inside}</svg>"#);
    let circle = |r: u32| format!("M {r} 0 A {r} {r} 0 1 1 -{r} 0 A {r} {r} 0 1 1 {r} 0 Z");
    let circles = format!("{} {}", circle(20), circle(10));
    let ring = file(&format!(r#"<path fill-rule="evenodd" transform="translate(50 50) scale(2)" d="{circles}"/>"#));
    let ring = slots(Drawing::svg(ring.as_bytes(), true), 90);
    assert!((0..90).all(|i| (0.25..0.5).contains(&row(&ring.slots_m, i).norm())));
    let outline = file(
        "<style>.hidden { display: none }</style><rect x='10' y='10' width='50' height='25'/> \
         <circle class='hidden' r='90'/>",
    );
    let drawing = Drawing::svg(outline.as_bytes(), false).expect("a drawing");
    assert!((drawing.size()[1] - 0.5).abs() < 1e-6);
    let outline = slots(Ok(drawing), 30);
    let on_it = |x: f64, y: f64| (x.abs() - 0.5).abs() < 1e-6 || (y.abs() - 0.25).abs() < 1e-6;
    assert!((0..30).all(|i| on_it(outline.slots_m[(i, 0)], outline.slots_m[(i, 1)])));
    // y points downwards in SVG, so the tip is above.
    let tip = slots(Drawing::svg(file("<polygon points='50,0 100,100 0,100'/>").as_bytes(), true), 60);
    assert!(within(&tip, -1.0..1.0, 0.0..1.0) < 20);
    for nothing in [
        "",
        "<text x='5' y='5'>A</text>",
        "<image href='a.png' width='9' height='9'/>",
        "<g display='none'><rect width='9' height='9'/></g>",
    ] {
        assert_eq!(Drawing::svg(file(nothing).as_bytes(), false).map(|_| ()), Err(DrawingError::Empty), "{nothing}");
    }
}

#[test]
fn slots_lie_on_the_ink_of_a_picture() {
    // Dark on the upper left of white, with a margin that is cropped.
    let dark =
        png(60, 60, |x, y| if (10..50).contains(&x) && (10..50).contains(&y) && x + y < 60 { BLACK } else { WHITE });
    let corner = slots(Drawing::png(&dark, None), 50);
    assert!(within(&corner, 0.05..1.0, -1.0..-0.05) == 0 && within(&corner, -1.0..0.0, 0.0..1.0) > 20);
    assert_eq!(slots(Drawing::png(&dark, Some(Ink::Dark)), 50), corner);
    let inverted = png(40, 40, |x, y| if x + y < 40 { WHITE } else { BLACK });
    assert_eq!(slots(Drawing::png(&inverted, Some(Ink::Light)), 50), corner);
    let opaque = png(40, 40, |x, y| if x + y < 40 { WHITE } else { CLEAR });
    assert_eq!(slots(Drawing::png(&opaque, None), 50), corner);
    assert_eq!(Drawing::png(&opaque, Some(Ink::Dark)).map(|_| ()), Err(DrawingError::Empty));
    let dot = slots(Drawing::png(&png(1, 1, |_, _| BLACK), None), 50);
    assert!(is_even(&dot) && within(&dot, -0.5..0.5, -0.5..0.5) == 50);
}

#[test]
fn invalid_drawings_are_refused() {
    let refusal =
        |drawing: Result<Drawing, DrawingError>, count| drawing.and_then(|drawing| drawing.slots(count)).err();
    assert_eq!(refusal(Drawing::text("A\u{65e5}"), 9), Some(DrawingError::Glyph('\u{65e5}')));
    assert_eq!(refusal(Drawing::text("A\tB"), 9), Some(DrawingError::Glyph('\t')));
    assert_eq!(refusal(Drawing::text(&"A".repeat(1001)), 9), Some(DrawingError::Length(1001)));
    assert_eq!(refusal(Drawing::text("A B C"), 2), Some(DrawingError::Letters { slots: 2, letters: 3 }));
    assert_eq!(refusal(Drawing::text("A B C"), 3), None);
    assert_eq!(refusal(Drawing::text(""), 9), Some(DrawingError::Empty));
    assert_eq!(refusal(Drawing::text(" \n "), 9), Some(DrawingError::Empty));
    assert_eq!(refusal(Drawing::text("A"), 100_001), Some(DrawingError::Slots(100_001)));
    assert!(matches!(refusal(Drawing::path("L 1 2", false), 9), Some(DrawingError::Path(_))));
    assert!(matches!(refusal(Drawing::path("no path", false), 9), Some(DrawingError::Path(_))));
    for empty in ["", "M 1 1", "M 1 1 L 1 1", "M 1 1 Z"] {
        assert_eq!(refusal(Drawing::path(empty, false), 9), Some(DrawingError::Empty), "{empty}");
    }
    assert_eq!(refusal(Drawing::path("M 0 0 L 1 1", true), 9), Some(DrawingError::Empty), "a line surrounds nothing");
    for endless in ["M 0 0 L 1e200 0", "M 0 0 L 1e999 1"] {
        assert_eq!(refusal(Drawing::path(endless, false), 9), Some(DrawingError::NotFinite), "{endless}");
    }
    assert!(matches!(refusal(Drawing::svg(b"M 0 0 L 1 1", false), 9), Some(DrawingError::Svg(_))));
    assert!(matches!(refusal(Drawing::svg(&[0xff, 0xfe], false), 9), Some(DrawingError::Svg(_))));
    let deep =
        format!("<svg xmlns='http://www.w3.org/2000/svg'>{}{}</svg>", "<g>".repeat(100_000), "</g>".repeat(100_000));
    assert_eq!(refusal(Drawing::svg(deep.as_bytes(), false), 9), Some(DrawingError::Nesting(200)));
    assert!(matches!(refusal(Drawing::png(b"GIF89a", None), 9), Some(DrawingError::Png(_))));
    let white = png(8, 8, |_, _| WHITE);
    assert_eq!(refusal(Drawing::png(&white, None), 9), Some(DrawingError::Empty));
    assert!(matches!(refusal(Drawing::png(&white[..white.len() / 2], None), 9), Some(DrawingError::Png(_))));
}

#[test]
fn a_huge_picture_is_refused_by_its_header() {
    let mut bytes = png(8, 8, |_, _| BLACK);
    bytes[16..24].copy_from_slice(&[0, 1, 0, 0, 0, 2, 0, 0]);
    let crc = !bytes[12..29].iter().fold(!0_u32, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| if crc & 1 == 1 { (crc >> 1) ^ 0xedb8_8320 } else { crc >> 1 })
    });
    bytes[29..33].copy_from_slice(&crc.to_be_bytes());
    assert_eq!(Drawing::png(&bytes, None).map(|_| ()), Err(DrawingError::Pixels { width: 65_536, height: 131_072 }));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn arbitrary_input_is_drawn_or_refused(
        text in "\\PC{0,6}",
        path in "[MLHVCQSTAZmlhvcqstaz]( ?-?[0-9]{1,3}(\\.[0-9])?(e[0-9]{1,3})?){0,7}\
                 ( [LCQAZ]( -?[0-9]{1,3}){0,7}){0,3}",
        bytes in prop::collection::vec(any::<u8>(), 0..200), place in 0..200_usize, filled in any::<bool>(),
    ) {
        let shown = format!("<svg xmlns='http://www.w3.org/2000/svg' width='9' height='9'><path d='{path}'/></svg>");
        let mut broken = png(9, 9, |x, y| if x * y > 9 { BLACK } else { CLEAR });
        let end = broken.len();
        for (byte, with) in broken[place.min(end)..].iter_mut().zip(&bytes) {
            *byte ^= with;
        }
        for drawing in [
            Drawing::text(&text), Drawing::path(&path, filled), Drawing::svg(shown.as_bytes(), filled),
            Drawing::svg(&bytes, filled), Drawing::png(&bytes, None), Drawing::png(&broken, None),
        ] {
            if let Ok(formation) = drawing.and_then(|drawing| drawing.slots(7)) {
                prop_assert_eq!(within(&formation, -0.5001..0.5001, -0.5001..0.5001), 7);
            }
        }
    }
}
