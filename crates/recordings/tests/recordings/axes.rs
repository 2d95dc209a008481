//! Axes are mapped to x east, y north and z up by the user, by column names or by known programs.

use std::fs;

use tautline_core::track::Item;
use tautline_recordings::read::{Axes, ReadError, ReadOptions};
use tempfile::TempDir;

use crate::messages::read_bytes;
use crate::recording::{Whole, assert_refused};

fn read_with(text: &str, options: &ReadOptions) -> Result<Whole, ReadError> {
    read_bytes("flight.csv", text.as_bytes(), options)
}

fn read(text: &str) -> Whole {
    read_with(text, &ReadOptions::default()).unwrap_or_else(|error| panic!("{error}\n{text}"))
}

fn folder(files: &[(&str, &[u8])]) -> TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, bytes) in files {
        fs::write(folder.path().join(name), bytes).expect("written");
    }
    folder
}

fn turned(name: &str, scale: [f64; 3]) -> ReadOptions {
    ReadOptions { axes: Axes::from_name(name), scale: Some(scale.into()), ..ReadOptions::default() }
}

#[test]
fn axes_option_maps_positions_and_velocities() {
    let text = "t_s,id,x,y,z,vx,vy,vz\n0,a,1,2,3,4,5,6\n";
    for (name, position, velocity) in [
        ("enu", [1.0, 2.0, 3.0], [4.0, 5.0, 6.0]),
        ("ned", [2.0, 1.0, -3.0], [5.0, 4.0, -6.0]),
        ("nwu", [-2.0, 1.0, 3.0], [-5.0, 4.0, 6.0]),
        ("x,-z,y", [1.0, -3.0, 2.0], [4.0, -6.0, 5.0]),
    ] {
        let found = read_with(text, &turned(name, [1.0; 3])).expect("read");
        let Item::Sample(sample) = &found.items[0] else { panic!("a piece") };
        assert_eq!(
            (sample.position_m.into(), sample.velocity_m_s.map(Into::into)),
            (position, Some(velocity)),
            "{name}"
        );
        assert_eq!(found.notes.iter().any(|note| note.starts_with("axes are mapped")), name != "enu");
    }
    let curve = read_bytes("cf1.csv", b"duration,x^0,x^1,y^0,y^1,z^0,z^1\n1,1,4,2,5,3,6\n", &turned("ned", [1.0; 3]));
    let curve = curve.expect("read");
    let Item::Piece(piece) = &curve.items[0] else { panic!("a sample") };
    assert_eq!(piece.coefficients[1].as_slice(), [5.0, 4.0, -6.0]);
    // Signs of `--scale` are accepted with units in names; a factor would contradict them.
    let mm = "t,id,x [mm],y [mm],z [mm]\n0,a,1000,2000,3000\n";
    assert_eq!(read_with(mm, &turned("x,y,z", [1.0, 1.0, -1.0])).expect("read").samples()[0].2, [1.0, 2.0, -3.0]);
}

#[test]
fn scale_per_axis_is_refused_with_radii() {
    let text = "t,id,x,y,z,radius\n0,a,1,2,3,0.5\n";
    let stretched = read_with(text, &turned("x,y,z", [1.0, 1.0, 0.001])).expect_err("refused");
    assert_refused(&stretched, "recording/contradicts-option", "");
    assert!(read_with(text, &turned("x,y,z", [1.0, 1.0, -1.0])).is_ok());
    let none = read_with(text, &turned("x,y,z", [1.0, 0.0, 1.0])).expect_err("refused");
    assert_refused(&none, "recording/option-out-of-range", "");
}

#[test]
fn columns_named_by_direction_are_converted() {
    for header in [
        "t,id,north,east,down",
        "t,id,n,e,d",
        "t,id,x_ned,y_ned,z_ned",
        "t,id,ned_x,ned_y,ned_z",
        "t,id,pos_n,pos_e,pos_d",
        "t,id,North [m],East [m],Down [m]",
    ] {
        let found = read(&format!("{header}\n0,a,1,2,3\n"));
        assert_eq!(found.samples()[0].2, [2.0, 1.0, -3.0], "{header}");
        let named = read_with(&format!("{header}\n0,a,1,2,3\n"), &turned("ned", [1.0; 3])).expect_err("twice");
        assert_refused(&named, "recording/contradicts-option", "line 1");
    }
    assert_eq!(read("t,id,east,north,up\n0,a,1,2,3\n").samples()[0].2, [1.0, 2.0, 3.0]);
    assert_eq!(read("t,a.north,a.east,a.down,b.north,b.east,b.down\n0,1,2,3,4,5,6\n").samples()[1].2, [5.0, 4.0, -6.0]);
    // Columns without a frame are read unchanged.
    assert_eq!(read("t,id,x,y,z\n0,a,1,2,3\n").samples()[0].2, [1.0, 2.0, 3.0]);
}

#[test]
fn mavsdk_drone_show_is_north_east_down() {
    let text = "idx,t,px,py,pz,vx,vy,vz,ax,ay,az,yaw,mode,ledr,ledg,ledb\n0,0.0,1,2,-3,4,5,-6,0,0,0,0,70,255,255,255\n";
    let Item::Sample(sample) = &read(text).items[0] else { panic!("a piece") };
    assert_eq!(sample.position_m.as_slice(), [2.0, 1.0, 3.0]);
    assert_eq!(sample.velocity_m_s.map(Into::into), Some([5.0, 4.0, 6.0]));
}

/// Returns a `vehicle_local_position` table of `ulog2csv`, 10 m above its reference.
fn px4(lat: &str, rows: &[(&str, u8)]) -> Vec<u8> {
    let mut text =
        "timestamp,timestamp_sample,ref_timestamp,ref_lat,ref_lon,x,y,z,delta_z,vx,vy,vz,z_deriv,ax,ay,az,heading,\
                    ref_alt,xy_valid,z_valid,eph\n"
            .to_owned();
    for (k, (x, valid)) in rows.iter().enumerate() {
        let time = 1_000_000 + 20_000 * k;
        let line = format!("{time},{time},0,{lat},8.0,{x},0,-10,0,1,2,3,0,0,0,0,0,400,{valid},1,0.1\n");
        text.push_str(&line);
    }
    text.into_bytes()
}

#[test]
fn px4_local_positions_share_one_origin() {
    // The references are a hundred metres apart, the positions are equal.
    let apart = 100.0 / 111_176.0;
    let (a, b) = (px4("47.0", &[("100", 1), ("100", 1)]), px4(&format!("{}", 47.0 + apart), &[("0", 1), ("0", 1)]));
    let folder = folder(&[("a.csv", &a), ("b.csv", &b)]);
    let asked = Whole::read(folder.path(), &ReadOptions::default()).expect_err("no origin");
    assert_refused(&asked, "recording/no-origin", "line 2");
    assert!(asked.help().contains("origin=47.0,8.0,400.0"), "{}", asked.help());
    let options = ReadOptions { origin: Some([47.0, 8.0, 400.0]), ..ReadOptions::default() };
    let found = Whole::read(folder.path(), &options).expect("read");
    let samples = found.samples();
    let [(_, "a", first), (_, "b", second), ..] = samples[..] else { panic!("{samples:?}") };
    assert!((first[0] - second[0]).hypot(first[1] - second[1]) < 0.02, "{first:?} {second:?}");
    assert!(first == [0.0, 100.0, 10.0] && (second[2] - 10.0).abs() < 0.01, "{first:?} {second:?}");
    assert_eq!(found.assumed.as_deref(), Some("the clocks of all vehicles started together"));
    assert_eq!(found.clock.unit, "us");
    // A single file needs no assumption.
    let alone = Whole::read(&folder.path().join("a.csv"), &ReadOptions::default()).expect("read");
    assert_eq!((alone.samples()[0].2, alone.assumed), ([0.0, 100.0, 10.0], None));
    let Item::Sample(sample) = &alone.items[0] else { panic!("a piece") };
    assert_eq!(sample.velocity_m_s.map(Into::into), Some([2.0, 1.0, -3.0]));
}

#[test]
fn px4_local_positions_without_a_reference_are_unknown() {
    let read = |bytes: &[u8]| read_bytes("px4.csv", bytes, &ReadOptions::default());
    let found = read(&px4("47.0", &[("1", 0), ("2", 1)])).expect("read");
    assert_eq!(found.items.len(), 1, "the first row says that it is not valid");
    for lat in ["nan", "", "0"] {
        let text = String::from_utf8(px4(lat, &[("1", 1)])).expect("text");
        let text = if lat == "0" { text.replace(",8.0,", ",0,") } else { text };
        let error = read(text.as_bytes()).expect_err("nowhere");
        assert_refused(&error, "recording/no-fix", "");
    }
    let error = read(b"timestamp,x,y,z,ref_lat,ref_lon\n0,1,2,3,47,8\n").expect_err("no height");
    assert_refused(&error, "recording/missing-column", "line 1");
    let scaled = ReadOptions { scale: Some(0.001.into()), ..ReadOptions::default() };
    let error = read_bytes("px4.csv", &px4("47.0", &[("1", 1)]), &scaled).expect_err("metres");
    assert_refused(&error, "recording/contradicts-option", "line 1");
}

#[test]
fn axes_option_is_refused_for_known_axes() {
    let ned = turned("ned", [1.0; 3]);
    let earth = read_with("t,id,lat,lon,alt\n0,a,47,8,400\n", &ned).expect_err("known");
    assert_refused(&earth, "recording/contradicts-option", "");
    let motive = "Format Version,1.23,Length Units,Meters,Coordinate Space,Global\n";
    let error = read_bytes("take.csv", motive.as_bytes(), &ned).expect_err("known");
    assert_refused(&error, "recording/unused-option", "");
}

#[test]
fn height_columns_are_inverted_once() {
    for (header, z) in [
        ("t,id,north,east,down", -3.0),
        ("t,id,north,east,depth", -3.0),
        ("t,id,north,east,alt", 3.0),
        ("t,id,x_ned,y_ned,z_ned", -3.0),
    ] {
        assert_eq!(read(&format!("{header}\n0,a,1,2,3\n")).samples()[0].2, [2.0, 1.0, z], "{header}");
    }
    // The direction of a height column contradicts the option.
    for name in ["depth", "alt"] {
        let text = format!("t,id,x,y,{name}\n0,a,1,2,3\n");
        let z = if name == "alt" { 3.0 } else { -3.0 };
        for options in [turned("ned", [1.0; 3]), turned("x,y,z", [1.0, 1.0, -1.0]), turned("x,z,y", [1.0; 3])] {
            let error = read_with(&text, &options).expect_err("both");
            assert_refused(&error, "recording/contradicts-option", "line 1");
            assert!(error.help().ends_with(&format!("column=z={name}")), "{error} {}", error.help());
        }
        assert_eq!(read_with(&text, &turned("y,x,z", [1.0; 3])).expect("read").samples()[0].2, [2.0, 1.0, z]);
        let mut plain = turned("ned", [1.0; 3]);
        plain.columns.set("z", name);
        assert_eq!(read_with(&text, &plain).expect("read").samples()[0].2, [2.0, 1.0, -3.0]);
    }
}

#[test]
fn planar_recording_stays_planar() {
    let folder = folder(&[("flat.csv", b"t,id,x,y,vx,vy\n0,a,1,2,3,4\n")]);
    let flat = folder.path().join("flat.csv");
    let ned = turned("ned", [1.0; 3]);
    assert!(tautline_recordings::read::open(&flat, &ned).expect("read").is_planar());
    assert_eq!(Whole::read(&flat, &ned).expect("read").samples()[0].2, [2.0, 1.0, 0.0]);
    let error = Whole::read(&flat, &turned("x,z,y", [1.0; 3])).expect_err("no z");
    assert_refused(&error, "recording/contradicts-option", "");
    // North and east alone are planar too.
    std::fs::write(&flat, "t,id,north,east\n0,a,1,2\n").expect("written");
    let open = || tautline_recordings::read::open(&flat, &ReadOptions::default()).expect("read");
    assert!(
        open().is_planar()
            && Whole::read(&flat, &ReadOptions::default()).expect("read").samples()[0].2 == [2.0, 1.0, 0.0]
    );
}

#[test]
fn partly_directed_axes_are_refused() {
    for header in ["t,a_x_ned,a_y_ned,a_z_ned,b_x,b_y,b_z", "t,a.north,a.east,a.down,b.x,b.y,b.z"] {
        let error = read_with(&format!("{header}\n0,1,2,3,4,5,6\n"), &ReadOptions::default()).expect_err(header);
        assert_refused(&error, "recording/several-frames", "line 1");
    }
    let error = read_with("t,id,north,east,z\n0,a,1,2,3\n", &ReadOptions::default()).expect_err("up or down?");
    assert_refused(&error, "recording/several-frames", "line 1");
    assert_eq!(read("t,id,north,east,alt\n0,a,1,2,3\n").samples()[0].2, [2.0, 1.0, 3.0], "a height is up");
    let (ned, silent): (&[u8], &[u8]) = (b"t,north,east,down\n0,1,2,3\n", b"t,x,y,z\n0,1,2,3\n");
    let earth: &[u8] = b"t,lat,lon,alt\n0,47,8,400\n";
    let origin = ReadOptions { origin: Some([47.0, 8.0, 400.0]), ..ReadOptions::default() };
    for (files, options) in [
        ([("a.csv", ned), ("b.csv", silent)], ReadOptions::default()),
        ([("a.csv", silent), ("b.csv", ned)], ReadOptions::default()),
        ([("a.csv", earth), ("b.csv", silent)], origin),
    ] {
        let folder = folder(&files);
        assert!(Whole::read(folder.path(), &options).is_err(), "{files:?}");
    }
    assert_eq!(
        Whole::read(folder(&[("a.csv", ned), ("b.csv", ned)]).path(), &ReadOptions::default())
            .expect("read")
            .items
            .len(),
        2
    );
}
