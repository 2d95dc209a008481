//! Latitude, longitude and height are converted to metres from an origin.

use std::fs;

use tautline_recordings::read::{ReadError, ReadOptions};

use crate::messages::{Message, SEC, cdr, mcap_of, read_bytes};
use crate::recording::{Whole, assert_refused};

/// Two units in the last place of an Earth-centred coordinate.
const ROUNDING_M: f64 = 2e-9;

const ORIGIN: [f64; 3] = [47.397_742, 8.545_594, 488.0];

/// Places, and their positions relative to [`ORIGIN`] by PROJ 9 (`+proj=cart`, then `+proj=topocentric`).
const KNOWN: [([f64; 3], [f64; 3]); 4] = [
    (ORIGIN, [0.0, 0.0, 0.0]),
    ([47.398_742, 8.547_594, 508.5], [150.988_644_194_237_08, 111.189_420_765_010_33, 20.497_245_891_892_348]),
    ([47.3, 8.9, 400.0], [26_804.962_226_687_625, -10_806.380_650_633_424, -153.386_212_090_752_45]),
    ([-33.0, 151.0, 10.0], [3_262_982.205_143_963, 808_222.016_473_88, -11_783_142.139_647_465]),
];

/// Time between two successive known places \[s\], long enough for a vehicle to fly from one to the next.
const APART_S: i32 = 2000;

fn read(text: &str, options: &ReadOptions) -> Result<Whole, ReadError> {
    read_bytes("gps.csv", text.as_bytes(), options)
}

fn whole(text: &str) -> Whole {
    read(text, &ReadOptions::default()).unwrap_or_else(|error| panic!("{error}\n{}", error.help()))
}

fn table(header: &str) -> String {
    let rows = (0..).zip(KNOWN).map(|(k, ([lat, lon, alt], _))| format!("{},a,{lat},{lon},{alt}\n", k * APART_S));
    format!("{header}\n{}", rows.collect::<String>())
}

fn assert_known(found: &Whole) {
    assert_eq!(found.items.len(), KNOWN.len());
    for ((_, _, position), (place, expected)) in found.samples().iter().zip(KNOWN) {
        let off = position.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off < 2.0 * ROUNDING_M, "{place:?}: {position:?} is off by {off} m");
    }
}

#[test]
fn table_positions_agree_with_proj() {
    for header in [
        "t_s,id,lat,lon,alt",
        "t_s,id,Latitude,Longitude,Altitude",
        "t_s,id,latitude [deg],lng,height (m)",
        "t_s,id,gps_lat,gps_lon,gps_alt",
        "t_s,id,lat_deg,lon_deg,alt_m",
    ] {
        let found = whole(&table(header));
        assert_known(&found);
        let note = "east, north and up of 47.397742,8.545594,488.0 on WGS 84";
        assert!(found.notes.iter().any(|said| said.contains(note)), "{:?}", found.notes);
    }
    let mut named = ReadOptions::default();
    for (role, name) in [("lat", "phi"), ("lon", "lambda"), ("alt", "h")] {
        assert!(named.columns.set(role, name));
    }
    assert_known(&read(&table("t_s,id,phi,lambda,h"), &named).expect("read"));
}

#[test]
fn wide_tables_and_other_units_are_equivalent() {
    let [(a, _), (b, expected)] = [KNOWN[0], KNOWN[1]];
    let wide = format!(
        "t,cf1.lat,cf1.lon,cf1.alt,cf2.lat,cf2.lon,cf2.alt\n0,{},{},{},{},{},{}\n",
        a[0], a[1], a[2], b[0], b[1], b[2]
    );
    let found = whole(&wide);
    assert_eq!((found.vehicles.clone(), found.samples()[0].2), (vec!["cf1".to_owned(), "cf2".to_owned()], [0.0; 3]));
    let at = found.samples()[1].2;
    let other = format!(
        "t,id,lat [rad],lon [rad],alt [ft]\n0,a,{:?},{:?},{:?}\n0,b,{:?},{:?},{:?}\n",
        a[0].to_radians(),
        a[1].to_radians(),
        a[2] / 0.3048,
        b[0].to_radians(),
        b[1].to_radians(),
        b[2] / 0.3048
    );
    let turned = whole(&other).samples()[1].2;
    for axis in 0..3 {
        assert!((at[axis] - expected[axis]).abs() < 2.0 * ROUNDING_M, "{at:?}");
        assert!((turned[axis] - expected[axis]).abs() < 5.0 * ROUNDING_M, "{turned:?}");
    }
}

#[test]
fn origin_option_is_used_and_metres_take_precedence() {
    let origin = ReadOptions { origin: Some(KNOWN[1].0), ..ReadOptions::default() };
    assert_eq!(read(&table("t_s,id,lat,lon,alt"), &origin).expect("read").samples()[1].2, [0.0; 3]);
    let both = whole("t,id,x,y,z,lat,lon\n0,a,1,2,3,47,8\n");
    assert_eq!(both.samples(), [(0.0, "a", [1.0, 2.0, 3.0])]);
    assert!(both.notes.iter().any(|note| note == "columns not used: lat, lon"), "{:?}", both.notes);
    let needless = read("t,id,x,y,z\n0,a,1,2,3\n", &origin).expect_err("refused");
    assert_eq!(needless.help(), "omit origin");
}

#[test]
fn empty_positions_are_omitted_and_heights_are_optional() {
    let found = whole("t,id,lat,lon,alt\n0,a,,,\n1,a,47,8,400\n");
    assert_eq!(found.samples(), [(1.0, "a", [0.0; 3])]);
    let flat = whole("t,id,lat,lon\n0,a,47,8\n");
    assert_eq!(flat.samples(), [(0.0, "a", [0.0; 3])]);
    assert!(flat.notes.iter().any(|note| note.contains("no column gives the height")), "{:?}", flat.notes);
}

#[test]
fn invalid_places_are_refused_with_their_line() {
    for (row, code) in [
        ("0,a,91,8,400", "recording/not-on-earth"),
        ("0,a,473977420,85455940,488", "recording/not-on-earth"),
        ("0,a,47,361,400", "recording/not-on-earth"),
        ("0,a,nan,8,400", "recording/not-finite"),
        ("0,a,47,8,", "recording/empty-cell"),
    ] {
        let error = read(&format!("t,id,lat,lon,alt\n{row}\n"), &ReadOptions::default()).expect_err(row);
        assert_refused(&error, code, "line 2");
    }
    let error = read(&table("t,id,lat [grad],lon,alt"), &ReadOptions::default()).expect_err("refused");
    assert_refused(&error, "recording/unknown-unit", "line 1");
}

#[test]
fn scale_applies_to_heights_and_missing_unit_is_noted() {
    let rows = "0,a,47,8,1000\n1,a,47,8,1100\n1,b,47,8.001,1100\n";
    let origin = [47.0, 8.0, 304.8];
    let read = |height: &str, scale: f64| {
        let options = ReadOptions { scale: Some(scale.into()), origin: Some(origin), ..ReadOptions::default() };
        read(&format!("t,id,lat,lon,{height}\n{rows}"), &options)
    };
    let metres = read("alt", 1.0).expect("read");
    let note = "heights are read from column `alt`, in metres: the name has no unit (scale sets another)";
    assert!(metres.notes.iter().any(|said| said == note), "{:?}", metres.notes);
    let feet = read("alt", 0.3048).expect("read");
    let note = "heights are read from column `alt`, in units of 0.3048 m (scale)";
    assert!(feet.notes.iter().any(|said| said == note), "{:?}", feet.notes);
    let heights = |found: &Whole| found.samples().iter().map(|(_, _, position)| position[2]).collect::<Vec<_>>();
    assert!((heights(&metres)[0] - 695.2).abs() < 1e-8 && heights(&feet)[0].abs() < 1e-8);
    assert!((heights(&feet)[1] - 30.48).abs() < 1e-8);
    // The scale does not apply to horizontal positions; a unit in the name has the same effect.
    let named = read("alt [ft]", 1.0).expect("read");
    assert_eq!(named.samples(), feet.samples());
    assert!(named.samples()[2].2[0] > 70.0 && !named.notes.iter().any(|note| note.contains("scale sets")));
    assert_refused(&read("alt [ft]", 0.5).expect_err("refused"), "recording/contradicts-option", "line 1");
}

#[test]
fn zero_latitude_and_longitude_is_no_fix() {
    let found = whole("t,id,lat,lon,alt\n0,a,0,0,0\n1,a,47,8,400\n2,a,0.0,-0.0,400\n3,a,47,8,400\n3,b,0,0,0\n");
    assert_eq!(found.samples(), [(1.0, "a", [0.0; 3]), (3.0, "a", [0.0; 3])]);
    let note = "3 positions of `a`, `b` omitted for lack of a fix: latitude and longitude are exactly 0";
    assert!(found.notes.iter().any(|said| said == note), "{:?}", found.notes);
    // A single 0 is a place on the equator or the meridian of Greenwich.
    let near = whole("t,id,lat,lon,alt\n0,a,0,8,0\n0,b,51,0,0\n0,c,0,1e-7,0\n");
    assert_eq!(near.items.len(), 3);
    assert!(!near.notes.iter().any(|said| said.contains("lack of a fix")), "{:?}", near.notes);
    // Zero is a valid position in metres.
    assert_eq!(whole("t,id,x,y,z\n0,a,0,0,0\n").items.len(), 1);
    let none = read("t,id,lat,lon,alt\n0,a,0,0,0\n1,a,0,0,9\n", &ReadOptions::default()).expect_err("refused");
    assert_refused(&none, "recording/no-fix", "");

    let folder = tempfile::tempdir().expect("a folder");
    for name in ["a.csv", "b.csv"] {
        fs::write(folder.path().join(name), "t,lat,lon,alt\n0,0,0,0\n1,47,8,400\n2,47,8,400\n").expect("written");
    }
    let error = Whole::read(folder.path(), &ReadOptions::default()).expect_err("refused");
    assert_refused(&error, "recording/no-origin", "line 3");
    let origin = ReadOptions { origin: Some([47.0, 8.0, 400.0]), ..ReadOptions::default() };
    let found = Whole::read(folder.path(), &origin).expect("read");
    assert_eq!(found.items.len(), 4);
    for name in ["a", "b"] {
        let note = format!("1 position of `{name}` omitted for lack of a fix");
        assert!(found.notes.iter().any(|said| said.contains(&note)), "{:?}", found.notes);
    }
    let kind = "sensor_msgs/msg/NavSatFix";
    let messages = [[0.0; 3], [47.0, 8.0, 400.0]].map(|place| ("/r1/fix", kind, "cdr", 1, fix(0, 0, place)));
    let found = read_bytes("gps.mcap", &mcap_of(&messages), &ReadOptions::default()).expect("read");
    assert_eq!(found.samples().len(), 1);
    assert!(found.notes.iter().any(|said| said.contains("1 position omitted for lack of a fix")), "{:?}", found.notes);
}

#[test]
fn impossible_jumps_are_refused() {
    for other in ["0,8", "1e-7,0", "-1,-1", "90,0", "47,188"] {
        let text = format!("t,id,lat,lon,alt\n0,a,47,8,400\n0.1,a,47,8,400\n0.2,a,{other},400\n0.3,a,47,8,400\n");
        let error = read(&text, &ReadOptions::default()).expect_err(other);
        assert_refused(&error, "recording/position-jump", "line 4");
        assert!(error.to_string().ends_with("is at line 3"), "{error}");
    }
    let kind = "sensor_msgs/msg/NavSatFix";
    let places = [(0, [47.0, 8.0, 400.0]), (1, [0.0, 8.0, 400.0])];
    let messages =
        places.map(|(second, place)| ("/r1/fix", kind, "cdr", 1 + u64::from(second != 0), fix(second, 0, place)));
    let error = read_bytes("gps.mcap", &mcap_of(&messages), &ReadOptions::default()).expect_err("refused");
    assert_eq!(error.code(), "recording/position-jump", "{error}");
    // A satellite is slower than the limit, and a jump of less than 1 km is accepted.
    assert_eq!(whole("t_s,id,lat,lon,alt\n0,a,0,8,400000\n10,a,0,8.6,400000\n").items.len(), 2);
    assert_eq!(whole("t_s,id,lat,lon,alt\n0,a,47,8,400\n0.001,a,47.005,8,400\n").items.len(), 2);
}

#[test]
fn degrees_and_metres_in_one_table_are_refused() {
    for header in ["t,A.lat,A.lon,A.alt,B_x,B_y,B_z", "t,B_x,B_y,B_z,cf1_lat,cf1_lon,cf1_alt,B_lat,B_lon"] {
        let cells = "0,".repeat(header.split(',').count());
        let text = format!("{header}\n{}\n", cells.trim_end_matches(','));
        let error = read(&text, &ReadOptions::default()).expect_err(header);
        assert_refused(&error, "recording/several-frames", "line 1");
    }
    let both = whole("t,A.lat,A.lon,A.alt,A.x,A.y,A.z\n0,47,8,400,1,2,3\n");
    assert_eq!(both.samples(), [(0.0, "A", [1.0, 2.0, 3.0])]);
    // Columns of a named vehicle beside `x`, `y`, `z` may be a second vehicle.
    for header in ["t,x,y,z,B.x,B.y,B.z", "t,x,y,z,b.lat,b.lon,b.alt"] {
        let error = read(&format!("{header}\n0,1,2,3,4,5,6\n"), &ReadOptions::default()).expect_err(header);
        assert_refused(&error, "recording/no-vehicle-column", "line 1");
        assert!(error.help().ends_with("use one_vehicle"), "{}", error.help());
    }
}

#[test]
fn joined_files_share_one_origin() {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, ([lat, lon, alt], _)) in ["a.csv", "b.csv"].iter().zip(KNOWN) {
        fs::write(folder.path().join(name), format!("t,lat,lon,alt\n0,{lat},{lon},{alt}\n")).expect("written");
    }
    let error = Whole::read(folder.path(), &ReadOptions::default()).expect_err("refused");
    assert_refused(&error, "recording/no-origin", "line 2");
    assert!(error.help().contains("origin=47.397742,8.545594,488.0"), "{error}\n{}", error.help());
    let origin = ReadOptions { origin: Some(ORIGIN), ..ReadOptions::default() };
    let found = Whole::read(folder.path(), &origin).expect("read");
    assert!((found.samples()[1].2[0] - KNOWN[1].1[0]).abs() < 2.0 * ROUNDING_M, "{:?}", found.samples());
}

/// Returns a fix at a time \[s\]; status -1 means no fix.
fn fix(second: i32, status: i8, [latitude, longitude, height]: [f64; 3]) -> Vec<u8> {
    let position = ((latitude, longitude, height), [0.0; 9], 2_u8);
    cdr(&(((SEC + second, 0), "gps"), (status, 1_u16), position), second % 2 == 0)
}

#[test]
fn nav_sat_fixes_are_read_unless_status_is_no_fix() {
    let kind = "sensor_msgs/msg/NavSatFix";
    let nan = f64::NAN;
    let mut messages: Vec<_> =
        (0..).zip(KNOWN).map(|(k, (place, _))| ("/r1/fix", kind, "cdr", 1, fix(k * APART_S, 0, place))).collect();
    messages.insert(0, ("/r1/fix", kind, "cdr", 1, fix(-2, -1, [nan; 3])));
    messages.insert(1, ("/r1/fix", kind, "cdr", 1, fix(-1, 0, [47.0, 8.0, nan])));
    let found = read_bytes("gps.mcap", &mcap_of(&messages), &ReadOptions::default()).expect("read");
    assert_eq!(found.vehicles, ["/r1/fix"]);
    assert_known(&found);
    messages.push(("/r1/fix", kind, "cdr", 1, fix(9 * APART_S, 0, [nan, 8.0, 1.0])));
    let refused = |messages: &[Message], options: &ReadOptions| {
        read_bytes("gps.mcap", &mcap_of(messages), options).expect_err("refused")
    };
    let error = refused(&messages, &ReadOptions::default());
    assert_refused(&error, "recording/not-finite", "message 7 on topic `/r1/fix`");
    assert_refused(&refused(&messages[..2], &ReadOptions::default()), "recording/no-positions", "");
    let pose =
        ("/r2/pose", "geometry_msgs/msg/PoseStamped", "cdr", 1, cdr(&(((SEC, 0), "map"), ([0.0; 3], [0.0; 4])), true));
    let error = refused(&[messages[2].clone(), pose.clone()], &ReadOptions::default());
    assert_refused(&error, "recording/several-frames", "message 2 on topic `/r2/pose`");
    let origin = ReadOptions { origin: Some(ORIGIN), ..ReadOptions::default() };
    assert_eq!(refused(&[pose], &origin).help(), "omit origin");
}
