//! Every format is read with the motion that was written, and has a row in docs/recordings.md.

use std::collections::BTreeSet;
use std::fs;
use std::path::PathBuf;

use tautline_core::track::Item;
use tautline_recordings::read::{Dimensions, Format, ReadOptions, TimeUnit};
use tempfile::TempDir;

use crate::recording::Whole;

/// File in a temporary folder that lives as long as the value.
struct File {
    _folder: TempDir,
    path: PathBuf,
}

fn file(name: &str, bytes: impl AsRef<[u8]>) -> File {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join(name);
    fs::write(&path, bytes).expect("written");
    File { _folder: folder, path }
}

fn read(name: &str, bytes: impl AsRef<[u8]>) -> Whole {
    read_with(name, bytes, &ReadOptions::default())
}

fn read_with(name: &str, bytes: impl AsRef<[u8]>, options: &ReadOptions) -> Whole {
    Whole::read(&file(name, bytes).path, options).unwrap_or_else(|error| panic!("{error}"))
}

/// Two vehicles at two times, equal in all tables below.
const TRUTH: [(f64, &str, [f64; 3]); 4] = [
    (0.0, "1", [1.0, 2.0, 3.0]),
    (0.0, "2", [-1.5, 0.25, 1e-3]),
    (0.5, "1", [1.5, 2.0, 3.0]),
    (0.5, "2", [-1.0, 0.25, 2e-3]),
];

const LONG: &str = "t,id,x,y,z\n0,1,1,2,3\n0,2,-1.5,0.25,1e-3\n0.5,1,1.5,2,3\n0.5,2,-1,0.25,2e-3\n";

#[test]
fn tables_of_every_shape_are_equivalent() {
    let swapped = "id,z,y,x,t\n1,3,2,1,0\n2,1e-3,.25,-1.5,0\n1,3,2,1.5,.5\n2,2e-3,.25,-1,.5\n";
    let wide = "t,x1,y1,z1,x2,y2,z2\n0,1,2,3,-1.5,.25,1e-3\n.5,1.5,2,3,-1,.25,2e-3\n";
    let named = "time [s],1.x,1.y,1.z,2.x,2.y,2.z\n0,1,2,3,-1.5,.25,1e-3\n.5,1.5,2,3,-1,.25,2e-3\n";
    let text = "# made up\n0 1 2 3 -1.5 .25 1e-3\n.5   1.5\t2 3 -1 .25 2e-3\n";
    for (name, content) in [
        ("long.csv", LONG.to_owned()),
        ("swapped.csv", swapped.to_owned()),
        ("wide.csv", wide.to_owned()),
        ("named.csv", named.to_owned()),
        ("text.txt", text.to_owned()),
        ("semicolons.csv", LONG.replace(',', ";")),
        ("tabs.tsv", LONG.replace(',', "\t")),
        ("crlf.csv", LONG.replace('\n', "\r\n")),
        ("bom.csv", format!("\u{feff}{LONG}")),
        ("blanks.csv", format!("\n{}\n\n", LONG.replace(',', " , "))),
        ("unended.csv", LONG.trim_end().to_owned()),
        ("quoted.csv", LONG.replace(",1,", ",\"1\",").replace("t,id", "\"t\",\"id\"")),
        ("header.txt", "t x1 y1 z1 x2 y2 z2\n0 1 2 3 -1.5 .25 1e-3\n.5 1.5 2 3 -1 .25 2e-3\n".to_owned()),
    ] {
        let dimensions = (name == "text.txt").then_some(Dimensions::Space);
        let whole = read_with(name, content, &ReadOptions { dimensions, ..ReadOptions::default() });
        assert_eq!(whole.samples(), TRUTH, "{name}");
        assert_eq!(whole.vehicles, ["1", "2"], "{name}");
    }
}

#[test]
fn unordered_rows_are_sorted_with_a_note() {
    let grouped = "t,id,x,y,z\n0,1,1,2,3\n0.5,1,1.5,2,3\n0,2,-1.5,0.25,1e-3\n0.5,2,-1,0.25,2e-3\n";
    let whole = read("grouped.csv", grouped);
    assert_eq!(whole.samples(), TRUTH);
    assert!(whole.notes.iter().any(|note| note.contains("sorted")), "{:?}", whole.notes);
    assert!(!read("long.csv", LONG).notes.iter().any(|note| note.contains("sorted")));
}

#[test]
fn times_closer_than_double_precision_are_sorted() {
    let whole = read("fine.csv", "t,id,x,y,z\n1700000000.00000005,a,1,0,0\n1700000000,b,2,0,0\n");
    assert_eq!(whole.samples(), [(0.0, "b", [2.0, 0.0, 0.0]), (5e-8, "a", [1.0, 0.0, 0.0])]);
}

#[test]
fn names_may_begin_with_a_hash_below_the_header() {
    let whole = read("hash.csv", "# made up\nid,t_s,x,y,z\nleader,0,0,0,0\n#2,0,0,0,0\n");
    assert_eq!(whole.vehicles, ["leader", "#2"]);
    assert_eq!(read("hash.txt", "# up\n0 1.5 2 3\n# down\n1 1.5 2 3\n").items.len(), 2);
}

#[test]
fn numeric_vehicle_names_are_sorted() {
    let vehicles = |ids: [&str; 3]| {
        let rows = ids.map(|id| format!("0,{id},1,2,3\n")).concat();
        read("ids.csv", format!("t,id,x,y,z\n{rows}")).vehicles
    };
    assert_eq!(vehicles(["10", "9", "1"]), ["1", "9", "10"]);
    assert_eq!(vehicles(["cf10", "cf9", "cf1"]), ["cf10", "cf9", "cf1"]);
}

#[test]
fn velocities_and_radii_are_optional() {
    let whole = read("more.csv", "t,id,x,y,z,vx,vy,vz,radius\n0,a,1,2,3,4,5,6,0.1\n0,b,1,2,3,,,,\n");
    let known = |item: &Item| match item {
        Item::Sample(sample) => (sample.velocity_m_s.map(Into::into), sample.radius_m),
        Item::Piece(_) => panic!("a piece"),
    };
    let samples: Vec<_> = whole.items.iter().map(known).collect();
    assert_eq!(samples, [(Some([4.0, 5.0, 6.0]), Some(0.1)), (None, None)]);
}

#[test]
fn unseen_vehicle_has_no_sample() {
    let whole = read("late.csv", "t,x1,y1,z1,x2,y2,z2\n0,1,2,3,,,\n0.5,1,2,3,4,5,6\n");
    let seen: Vec<_> = whole.samples().iter().map(|&(t, name, _)| (t, name.to_owned())).collect();
    assert_eq!(seen, [(0.0, "1".to_owned()), (0.5, "1".to_owned()), (0.5, "2".to_owned())]);
}

#[test]
fn table_without_z_is_planar_with_a_note() {
    let whole = read("flat.csv", "t,id,x,y\n0,1,1,2\n");
    assert_eq!(whole.samples(), [(0.0, "1", [1.0, 2.0, 0.0])]);
    assert!(
        whole
            .notes
            .iter()
            .any(|note| note.contains("no column gives the height: the recording is judged in the plane")),
        "{:?}",
        whole.notes
    );
}

#[test]
fn column_names_unit_and_scale_options_are_used() {
    let mut options =
        ReadOptions { time_unit: Some(TimeUnit::Milliseconds), scale: Some(0.01.into()), ..ReadOptions::default() };
    for (role, name) in [("t", "clock"), ("id", "who"), ("x", "east"), ("y", "north"), ("z", "up")] {
        assert!(options.columns.set(role, name));
    }
    assert!(!options.columns.set("w", "yaw"));
    let whole = read_with("odd.csv", "clock,who,east,north,up\n0,1,100,200,300\n500,1,150,200,300\n", &options);
    assert_eq!(whole.samples(), [(0.0, "1", [1.0, 2.0, 3.0]), (0.5, "1", [1.5, 2.0, 3.0])]);
    assert_eq!((whole.clock.unit, whole.clock.inferred), ("ms", false));
}

#[test]
fn inferred_time_unit_is_noted() {
    let named = read("named.csv", "time_ms,id,x,y,z\n0,1,1,2,3\n500,1,1,2,3\n");
    assert_eq!((named.clock.unit, named.clock.inferred, named.samples()[1].0), ("ms", false, 0.5));
    let inferred = read("unsaid.csv", "t,id,x,y,z\n0,1,1,2,3\n20000000,1,1,2,3\n");
    assert_eq!((inferred.clock.unit, inferred.clock.inferred, inferred.samples()[1].0), ("ns", true, 0.02));
    assert!(inferred.notes.iter().any(|note| note.contains("taken as ns")), "{:?}", inferred.notes);
}

#[test]
fn rows_across_batches_are_complete_and_ordered() {
    const ROWS: usize = 25_001;
    let rows: Vec<_> = (0..ROWS).map(|k| format!("{},{},{k},0,0\n", (k / 3) as f64 * 0.25, k % 3 + 1)).collect();
    let whole = read("many.csv", ["t,id,x,y,z\n", &rows.concat()].concat());
    let expected: Vec<_> = (0..ROWS).map(|k| ((k / 3) as f64 * 0.25, k % 3)).collect();
    let found: Vec<_> = whole.items.iter().map(|item| (item.time_s(), item.vehicle())).collect();
    assert!(found == expected);
}

#[test]
fn docs_list_every_reader() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/recordings.md");
    let docs = fs::read_to_string(path).expect("the page");
    let names: Vec<_> = Format::all().map(|reader| format!("`{}`", reader.name)).collect();
    let words = docs.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(words.contains(&names.join(", ")), "docs/recordings.md must list the readers in this order: {names:?}");
    for reader in Format::all() {
        let extensions: Vec<_> = reader.extensions.iter().map(|extension| format!("`.{extension}`")).collect();
        let cells = format!(" | `{}` | {} | ", reader.name, extensions.join(", "));
        assert!(docs.contains(&cells), "docs/recordings.md must have a row with{cells}");
    }
}

#[test]
fn reader_names_are_distinct() {
    let names: BTreeSet<_> = Format::all().map(|reader| reader.name).collect();
    assert_eq!(names.len(), Format::all().count());
}
