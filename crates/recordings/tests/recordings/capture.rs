//! Motion capture exports in the formats that their vendors document.

use tautline_recordings::read::{ReadError, ReadOptions};

use crate::messages::read_bytes;
use crate::recording::{Whole, assert_refused};

fn read(text: &str) -> Result<Whole, ReadError> {
    read_bytes("recording", text.as_bytes(), &ReadOptions::default())
}

fn whole(text: &str) -> Whole {
    read(text).unwrap_or_else(|error| panic!("{error}\n{}", error.help()))
}

/// Asserts that a valid text is read, and that each change of it is refused with this code at this place.
fn refused(valid: &str, changes: &[(&str, &str, &str, &str)]) {
    whole(valid);
    for (from, to, code, place) in changes {
        assert!(valid.contains(from), "there is no {from}");
        assert_refused(&read(&valid.replacen(from, to, 1)).expect_err(to), code, place);
    }
}

fn mm(length: f64) -> f64 {
    length * 0.001
}

const MOTIVE: &str = concat!(
    "Format Version,1.23,Take Name,Take 1,Take Notes,,Capture Frame Rate,100.000000,Export Frame Rate,",
    "100.000000,Capture Start Time,2024-01-01 10.00.00.000 AM,Total Frames in Take,3,",
    "Total Exported Frames,3,Rotation Type,Quaternion,Length Units,Millimeters,Coordinate Space,Global\n",
    "\n",
    ",Type,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,",
    "Rigid Body Marker,Rigid Body Marker,Rigid Body Marker,Rigid Body,Rigid Body,Rigid Body,Rigid Body,",
    "Rigid Body,Rigid Body,Rigid Body,Rigid Body\n",
    ",Name,cf1,cf1,cf1,cf1,cf1,cf1,cf1,cf1,cf1:Marker 001,cf1:Marker 001,cf1:Marker 001,cf2,cf2,cf2,cf2,",
    "cf2,cf2,cf2,cf2\n",
    ",ID,A,A,A,A,A,A,A,A,B,B,B,C,C,C,C,C,C,C,C\n",
    ",,Rotation,Rotation,Rotation,Rotation,Position,Position,Position,Mean Marker Error,Position,",
    "Position,Position,Rotation,Rotation,Rotation,Rotation,Position,Position,Position,Mean Marker Error\n",
    "Frame,Time (Seconds),X,Y,Z,W,X,Y,Z,,X,Y,Z,X,Y,Z,W,X,Y,Z,\n",
    "0,0.000000,0,0,0,1,1000.0,1500.0,-250.0,0.1,9,9,9,0,0,0,1,0.0,500.0,125.0,",
    "0.2\n",
    "1,0.010000,0,0,0,1,1001.0,1500.0,-250.0,0.1,9,9,9,,,,,,,,\n",
    "2,0.020000,0,0,0,1,1002.0,1500.0,-250.0,0.1,9,9,9,0,0,0,1,0.0,500.0,125.0,",
    "0.2\n",
);

#[test]
fn motive_axes_are_mapped_and_lost_bodies_omitted() {
    let found = whole(MOTIVE);
    let expected = [
        (0.0, "cf1", [1.0, 0.25, 1.5]),
        (0.0, "cf2", [0.0, -0.125, 0.5]),
        (0.01, "cf1", [mm(1001.0), 0.25, 1.5]),
        (0.02, "cf1", [mm(1002.0), 0.25, 1.5]),
        (0.02, "cf2", [0.0, -0.125, 0.5]),
    ];
    assert_eq!(found.samples(), expected);
    let metres = MOTIVE.replace("Millimeters", "Meters").replace("1000.0", "1.0");
    assert_eq!(whole(&metres).samples()[0].2, [1.0, 250.0, 1500.0]);
    assert_eq!(whole(&MOTIVE.replace('\n', "\r\n")).samples(), expected);
    assert_eq!(whole(&format!("\u{feff}{}", MOTIVE.replace("\n\n", "\n"))).samples(), expected);
}

#[test]
fn motive_markers_form_vehicles_without_rigid_bodies() {
    let markers = MOTIVE.replace("Rigid Body Marker", "Marker").replace("Rigid Body", "Bone").replace(",cf2", ",cf1:x");
    let found = whole(&markers);
    assert_eq!(found.samples()[0], (0.0, "cf1", [mm(9.0), -mm(9.0), mm(9.0)]));
    let two = concat!(
        "Format Version,1.23,Length Units,Meters\n",
        ",Type,Marker,Marker,Marker,Marker,Marker,Marker,Marker,Marker,Marker\n",
        ",Name,a:1,a:1,a:1,a:2,a:2,a:2,Unlabeled 7,Unlabeled 7,Unlabeled 7\n",
        ",ID,1,1,1,2,2,2,3,3,3\n",
        ",,Position,Position,Position,Position,Position,Position,Position,Position,Position\n",
        "Frame,Time (Seconds),X,Y,Z,X,Y,Z,X,Y,Z\n",
        "0,0,1,1,1,3,1,1,9,9,9\n",
        "1,0.01,1,1,1,,,,9,9,9\n",
    );
    let found = whole(two);
    assert_eq!(found.samples(), [(0.0, "a", [2.0, -1.0, 1.0])]);
    assert!(found.notes.iter().any(|note| note.ends_with("if all of them are seen, for a (2)")), "{:?}", found.notes);
}

#[test]
fn invalid_motive_takes_are_refused() {
    refused(
        MOTIVE,
        &[
            ("Millimeters", "Hands", "recording/unknown-unit", "line 7"),
            ("Global", "Local", "recording/unusable-frame", "line 7"),
            ("Time (Seconds)", "Clock", "recording/no-time-column", "line 7"),
            ("Frame,Time", "Frames,Time", "recording/truncated", ""),
            ("1001.0", "nan", "recording/not-finite", "line 9"),
            ("1001.0", "lost", "recording/not-a-number", "line 9"),
            ("1001.0", "", "recording/empty-cell", "line 9"),
            ("1,0.010000", "1,0.000000", "recording/duplicate-row", "line 9"),
            ("1,0.010000", "1,-1", "recording/time-backwards", "line 9"),
            ("0,0,0,1,1001.0,1500.0,-250.0,0.1,9,9,9,,,,,,,,", "0,0,0,1", "recording/field-count", "line 9"),
        ],
    );
    let twice = MOTIVE.replace(",cf2", ",cf1");
    assert_refused(&read(&twice).expect_err("twice"), "recording/vehicle-twice", "line 7");
    let markers = MOTIVE.replace("Rigid Body Marker", "Body").replace("Rigid Body", "Marker").replace(",cf2", ",cf1");
    assert_refused(&read(&markers).expect_err("twice"), "recording/vehicle-twice", "line 7");
    let none = MOTIVE.replace(",Position", ",Place");
    assert_refused(&read(&none).expect_err("none"), "recording/no-positions", "line 7");
    let scaled = ReadOptions { scale: Some(0.1.into()), ..ReadOptions::default() };
    let error = read_bytes("take.csv", MOTIVE.as_bytes(), &scaled).expect_err("scaled");
    assert_eq!(error.help(), "omit scale");
}

const NEXUS: &str = "\
Devices\n1000\n,,Force\nFrame,Sub Frame,Fx\n,,N\n1,0,5\n1,1,5\n\nTrajectories\n100\n,,cf1:front,,,cf1:back,,,ball,,\n\
Frame,Sub Frame,X,Y,Z,X,Y,Z,X,Y,Z\n,,mm,mm,mm,mm,mm,mm,mm,mm,mm\n1,0,100,0,1000,300,0,1000,-500,250,0\n\
2,0,110,0,1000,310,0,1000,,,\n3,0,,,,320,0,1000,-500,250,0\n\nEvents\n100\n";

const TRACKER: &str = "\
Objects\n200\n,,cf1:cf1,,,,,,,cf2:cf2,,,,,,\nFrame,Sub Frame,RX,RY,RZ,RW,TX,TY,TZ,RX,RY,RZ,RW,TX,TY,TZ\n\
,,,,,,mm,mm,mm,,,,,mm,mm,mm\n1,0,0,0,0,1,1000,2000,500,0,0,0,1,-1,-2,-4\n2,0,0,0,0,1,1000,2000,500,,,,,,,\n";

#[test]
fn vicon_objects_and_marker_means_are_read() {
    let found = whole(NEXUS);
    let expected = [
        (0.01, "cf1", [0.2, 0.0, 1.0]),
        (0.01, "ball", [-0.5, 0.25, 0.0]),
        (0.02, "cf1", [0.21, 0.0, 1.0]),
        (0.03, "ball", [-0.5, 0.25, 0.0]),
    ];
    assert_eq!(found.samples(), expected);
    assert!(found.notes.iter().any(|note| note.ends_with("if all of them are seen, for cf1 (2)")), "{:?}", found.notes);
    let found = whole(TRACKER);
    let expected =
        [(0.005, "cf1", [1.0, 2.0, 0.5]), (0.005, "cf2", [-0.001, -0.002, -0.004]), (0.01, "cf1", [1.0, 2.0, 0.5])];
    assert_eq!(found.samples(), expected);
    // Objects take precedence over markers.
    let both = whole(&format!("{NEXUS}\n{TRACKER}"));
    assert_eq!(both.samples(), expected);
    let note = "not read, as they are outside the section Objects: Force, ball";
    assert!(both.notes.iter().any(|said| said == note), "{:?}", both.notes);
}

#[test]
fn invalid_vicon_exports_are_refused() {
    refused(
        NEXUS,
        &[
            ("Trajectories\n100", "Trajectories\n0", "recording/frame-rate", "line 13"),
            ("\n,,mm", "\n,,stone", "recording/unit-conflict", "line 13"),
            ("cf1:back", "cf1:front", "recording/vehicle-twice", "line 13"),
            ("Trajectories\n", "Joints\n", "recording/no-positions", ""),
            ("110", "inf", "recording/not-finite", "line 15"),
            ("110", "", "recording/empty-cell", "line 15"),
            ("2,0,110", "2,1,110", "recording/frame-rate", "line 15"),
            ("2,0,110", "1,0,110", "recording/duplicate-row", "line 15"),
            ("2,0,110,0,1000,310,0,1000,,,", "2,0,110", "recording/field-count", "line 15"),
        ],
    );
    refused(TRACKER, &[("cf2:cf2", "cf1:arm", "recording/ambiguous-column", "line 5")]);
    let unknown = NEXUS.replace("mm", "deg");
    assert_refused(&read(&unknown).expect_err("degrees"), "recording/unknown-unit", "line 13");
    assert_refused(&read("Trajectories\n100\n,,a\n").expect_err("cut"), "recording/truncated", "");
}
