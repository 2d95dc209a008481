//! Heights are read from named columns; otherwise the recording is planar.

use std::fs;
use std::path::Path;

use tautline_recordings::export::{self, ExportOptions};
use tautline_recordings::read::{self, Format, ReadError, ReadOptions};

use crate::messages::{read_bytes, whole};
use crate::recording::{Whole, assert_refused};

fn read(text: &str, options: &ReadOptions) -> Result<Whole, ReadError> {
    read_bytes("flight.csv", text.as_bytes(), options)
}

/// Returns a table with one row whose cells are 1, 2, 3, ...
fn row(header: &str) -> String {
    let cells: Vec<_> = (1..=header.split(',').count()).map(|number| number.to_string()).collect();
    format!("{header}\n{}\n", cells.join(","))
}

fn is_planar(path: &Path) -> bool {
    read::open(path, &ReadOptions::default()).unwrap_or_else(|error| panic!("{error}")).is_planar()
}

fn has_note(found: &Whole, note: &str) {
    assert!(found.notes.iter().any(|said| said.contains(note)), "{:?}\ninstead of {note}", found.notes);
}

#[test]
fn height_columns_are_read_with_a_note() {
    for name in [
        "alt",
        "Altitude",
        "geoaltitude",
        "baroaltitude",
        "baro_alt",
        "height",
        "height_above_ground",
        "agl",
        "msl",
        "up",
        "elevation",
        "rel_alt",
        "alt_agl",
        "alt (m)",
        "pos_up",
        "geo-altitude",
    ] {
        let found = read(&row(&format!("t,id,x,y,{name}")), &ReadOptions::default()).expect(name);
        assert_eq!(found.samples()[0].2, [3.0, 4.0, 5.0], "{name}");
        has_note(&found, &format!("heights are read from column `{name}`"));
    }
    for (name, z) in [("depth", -5.0), ("down", -5.0), ("pos_down", -5.0), ("depth_cm", -0.05), ("alt [ft]", 1.524)] {
        let unit =
            if name.contains('_') && name.contains("cm") || name.contains('[') { [" [m]", " [m]"] } else { ["", ""] };
        let header = format!("t,id,x{},y{},{name}", unit[0], unit[1]);
        let found = read(&row(&header), &ReadOptions::default()).expect(name);
        assert!((found.samples()[0].2[2] - z).abs() < 1e-12, "{name}: {:?}", found.samples());
    }
    // Wide tables have a height column per vehicle.
    let wide = whole("flight.csv", row("t,a.x,a.y,a.alt,b.x,b.y,b.alt").as_bytes());
    assert_eq!(wide.samples(), [(1.0, "a", [2.0, 3.0, 4.0]), (1.0, "b", [5.0, 6.0, 7.0])]);
}

#[test]
fn other_columns_are_not_heights() {
    let path = tempfile::tempdir().expect("a folder");
    let file = path.path().join("flight.csv");
    for header in ["t,id,x,y", "t,id,x,y,alt_setpoint", "t,id,x,y,ground_height", "t,x1,y1,x2,y2,alt", "t,id,x,y,upper"]
    {
        fs::write(&file, row(header)).expect("written");
        assert!(is_planar(&file), "{header}");
    }
    for header in ["t,id,x,y,z", "t,id,x,y,alt", "t,id,lat,lon,alt", "t,id,x,y,depth"] {
        fs::write(&file, row(header)).expect("written");
        assert!(!is_planar(&file), "{header}");
    }
    // `z` takes precedence over height columns.
    let both = whole("flight.csv", row("t,id,x,y,alt,z").as_bytes());
    assert_eq!(both.samples()[0].2, [3.0, 4.0, 6.0]);
    has_note(&both, "columns not used: alt");
}

#[test]
fn two_height_columns_are_refused() {
    for header in ["t,id,x,y,geoaltitude,baroaltitude", "t,id,lat,lon,baroaltitude,geoaltitude", "t,id,x,y,up,down"] {
        let refused = read(&row(header), &ReadOptions::default()).expect_err(header);
        assert_refused(&refused, "recording/ambiguous-column", "line 1");
    }
    for (role, header, z) in [("z", "t,id,x,y,up,down", 6.0), ("alt", "t,id,x,y,up,down", -6.0)] {
        let mut options = ReadOptions::default();
        options.columns.set(role, "down");
        assert_eq!(read(&row(header), &options).expect("read").samples()[0].2[2], z, "{role}");
    }
    let mut options = ReadOptions { origin: Some([3.0, 4.0, 0.0]), ..ReadOptions::default() };
    options.columns.set("z", "geoaltitude");
    let found = read(&row("t,id,lat,lon,baroaltitude,geoaltitude"), &options).expect("read");
    assert!((found.samples()[0].2[2] - 6.0).abs() < 1e-8, "{:?}", found.samples());
}

#[test]
fn recording_without_some_height_is_planar_in_every_format() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    let text = "t,id,x,y,vx,vy\n0,a,1,2,0.5,0.25\n0,b,3,4,0,0\n1,a,1.5,2.25,0.5,0.25\n1,b,3,4,0,0\n";
    fs::write(path("flat.csv"), text).expect("written");
    fs::write(path("plain.txt"), "0 1 2 3 4\n1 1 2 3 4\n").expect("written");
    fs::write(path("rvo.txt"), "0 (1,2) (-3,4.5)\n0.25 (1.5, 2) (-3,4)\n").expect("written");
    fs::write(path("earth.csv"), "t,id,lat,lon\n0,a,47,8\n0,b,47.1,8\n").expect("written");
    // One vehicle has no height.
    fs::write(path("half.csv"), "t,a.x,a.y,a.z,b.x,b.y\n0,1,2,300,3,4\n").expect("written");
    for name in ["flat.csv", "rvo.txt", "earth.csv", "half.csv"] {
        assert!(is_planar(&path(name)), "{name}");
        let found = Whole::read(&path(name), &ReadOptions::default()).expect(name);
        assert!(found.samples().iter().all(|(_, _, position)| position[2] == 0.0), "{name}: {:?}", found.samples());
    }
    let half = Whole::read(&path("half.csv"), &ReadOptions::default()).expect("read");
    has_note(&half, "no column gives the height of `b`: the recording is judged in the plane");
    // Exports have no height either.
    let truth = Whole::read(&path("flat.csv"), &ReadOptions::default()).expect("read");
    for &format in export::WRITTEN {
        let to = path(&format!("exported.{}", format.name));
        let open = || read::open(&path("flat.csv"), &ReadOptions::default());
        let mut file = fs::File::create(&to).expect("a file");
        export::export(&open, format, &ExportOptions::default(), &mut file).expect("exported");
        assert!(is_planar(&to), "{format:?}");
        let found = Whole::read(&to, &ReadOptions::default()).expect("read");
        assert_eq!((found.vehicles, found.items), (truth.vehicles.clone(), truth.items.clone()), "{format:?}");
        if format == Format::CSV {
            let text = fs::read_to_string(&to).expect("read");
            assert_eq!(text.lines().next(), Some("t_s,id,x,y,vx,vy"));
        }
    }
}

#[test]
fn one_file_without_heights_makes_the_folder_planar() {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("a.csv"), "t,x,y,z\n0,1,2,300\n1,1,2,300\n").expect("written");
    fs::write(folder.path().join("b.csv"), "t,x,y\n0,1,2\n1,1,2\n").expect("written");
    assert!(is_planar(folder.path()));
    let found = Whole::read(folder.path(), &ReadOptions::default()).expect("read");
    assert!(found.samples().iter().all(|(_, _, position)| *position == [1.0, 2.0, 0.0]), "{:?}", found.samples());
    has_note(&found, "no height is known of `b`: the heights of the other files are not used");
    fs::write(folder.path().join("b.csv"), "t,x,y,alt\n0,1,2,3\n1,1,2,3\n").expect("written");
    assert!(!is_planar(folder.path()));
}
