//! Folders of vehicle files form one recording; unsupported files have a remedy.

use std::fs;
use std::io::{Cursor, Write as _};
use std::path::Path;

use tautline_core::track::Item;
use tautline_recordings::read::{self, ReadError, ReadOptions};
use tempfile::TempDir;
use zip::write::SimpleFileOptions;

use crate::recording::{Whole, assert_refused};

/// Creates a folder with these files.
fn folder(files: &[(&str, &str)]) -> TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, content) in files {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().expect("a parent")).expect("a folder");
        fs::write(path, content).expect("written");
    }
    folder
}

fn zipped<C: AsRef<[u8]>>(files: &[(&str, C)]) -> Vec<u8> {
    let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for (name, content) in files {
        zip.start_file(*name, SimpleFileOptions::default()).expect("an entry");
        zip.write_all(content.as_ref()).expect("written");
    }
    zip.finish().expect("finished").into_inner()
}

fn whole(path: &Path) -> Result<Whole, ReadError> {
    Whole::read(path, &ReadOptions::default())
}

const A: &str = "t,x,y,z,battery\n0,1,2,3,99\n0.5,1,2,4,98\n1,1,2,5,97\n";
const B: &str = "# t x y z\n0.25 7 8 9\n0.75 7 8 8\n";

const BOTH: [(f64, &str, [f64; 3]); 5] = [
    (0.0, "cf2", [1.0, 2.0, 3.0]),
    (0.25, "cf10", [7.0, 8.0, 9.0]),
    (0.5, "cf2", [1.0, 2.0, 4.0]),
    (0.75, "cf10", [7.0, 8.0, 8.0]),
    (1.0, "cf2", [1.0, 2.0, 5.0]),
];

#[test]
fn folder_or_archive_of_vehicle_files_is_one_recording() {
    let files = [("cf10.txt", B), ("cf2.csv", A), ("readme.md", "nothing"), (".hidden.csv", "nothing")];
    let folder = folder(&files);
    let found = whole(folder.path()).expect("read");
    assert_eq!((found.vehicles.clone(), found.samples()), (vec!["cf2".to_owned(), "cf10".to_owned()], BOTH.to_vec()));
    assert!(found.notes.iter().any(|note| note == "each file is one vehicle: cf2, cf10"), "{:?}", found.notes);
    let not_read = "not read, as they are not tables: readme.md";
    assert!(found.notes.iter().any(|note| note == not_read), "{:?}", found.notes);

    for name in ["flight", "flight.zip"] {
        let path = folder.path().join(name);
        fs::write(&path, zipped(&[("flight/cf10.txt", B), ("flight/cf2.csv", A), ("flight/readme.md", "nothing")]))
            .expect("written");
        assert_eq!(whole(&path).expect("read").samples(), BOTH, "{name}");
    }
    let (a, b) = (folder.path().join("cf2.csv"), folder.path().join("cf10.txt"));
    for paths in [&[&*b, &*a][..], &[folder.path()]] {
        let mut joined = read::open_joined(paths, &ReadOptions::default()).expect("opened");
        let mut items = Vec::new();
        while joined.read(&mut items).expect("read") {}
        assert_eq!((joined.vehicles().len(), items.len()), (2, 5), "{paths:?}");
    }
}

#[test]
fn seekable_formats_may_be_packed() {
    let folder = folder(&[("a.csv", A)]);
    let source = folder.path().join("a.csv");
    let expected = whole(&source).expect("read");
    let expected = expected.samples();
    let open = || read::open(&source, &ReadOptions::default());
    for (name, format) in [("b.parquet", read::Format::PARQUET), ("b.npz", read::Format::NPZ)] {
        let exported = folder.path().join(name);
        let mut file = fs::File::create(&exported).expect("a file");
        tautline_recordings::export::export(
            &open,
            format,
            &tautline_recordings::export::ExportOptions::default(),
            &mut file,
        )
        .expect("exported");
        let bytes = fs::read(&exported).expect("read");
        let archive = folder.path().join("flight.zip");
        fs::write(&archive, zipped(&[("a.csv", A.as_bytes()), (name, &bytes)])).expect("written");
        let distinct = ReadOptions { distinct: true, ..ReadOptions::default() };
        let found = Whole::read(&archive, &distinct).expect(name);
        let samples = found.samples();
        let of =
            |vehicle: &'static str| samples.iter().filter(move |sample| sample.1 == vehicle).map(|&(t, _, x)| (t, x));
        assert_eq!(samples.len(), 2 * expected.len(), "{name}");
        assert!(of("a").eq(of("b")) && of("a").eq(expected.iter().map(|&(t, _, x)| (t, x))), "{name}");
        let damaged = zipped(&[("a.csv", A.as_bytes()), (name, &bytes[..bytes.len() / 2])]);
        fs::write(&archive, damaged).expect("written");
        let refused = whole(&archive).expect_err("it breaks off").to_string();
        assert!(refused.contains(name), "{refused}");

        let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
        gzip.write_all(&bytes).expect("written");
        let packed = folder.path().join(format!("{name}.gz"));
        fs::write(&packed, gzip.finish().expect("finished")).expect("written");
        assert_eq!(whole(&packed).expect(name).samples().len(), expected.len());
    }
}

#[test]
fn joined_tables_of_any_format_share_one_clock() {
    let early = "timestamp,x,y\n1700000000.5,1,2\n1700000001.5,1,3\n";
    let late = "timestamp,x,y\n1700000003.25,4,5\n";
    let folder = folder(&[("a.csv", early), ("b.csv", late)]);
    let source = folder.path().join("c.csv");
    fs::write(&source, "timestamp,id,x,y\n1700000001,7,8,9\n").expect("written");
    let open = || read::open(&source, &ReadOptions::default());
    let mut file = fs::File::create(folder.path().join("d.parquet")).expect("a file");
    let options = tautline_recordings::export::ExportOptions::default();
    tautline_recordings::export::export(&open, read::Format::PARQUET, &options, &mut file).expect("exported");
    fs::remove_file(&source).expect("removed");
    let found = whole(folder.path()).expect("read");
    let samples: Vec<_> = found.samples().iter().map(|&(t, name, [x, ..])| (t, name.to_owned(), x)).collect();
    let expected = [(0.5, "a", 1.0), (1.0, "d", 8.0), (1.5, "a", 1.0), (3.25, "b", 4.0)];
    assert_eq!(samples, expected.map(|(t, name, x)| (t, name.to_owned(), x)));
    assert_eq!(found.clock.epoch_ns, 1_700_000_000_000_000_000);
}

#[test]
fn files_of_different_recordings_are_refused() {
    for (files, file, code, place) in [
        (&[("a.csv", A), ("b.csv", "t,x1,y1,x2,y2\n0,1,2,3,4\n")][..], "b.csv", "recording/several-vehicles", ""),
        (&[("a.csv", A), ("b.csv", "t,model_name,x,y\n0,p,1,2\n1,q,3,4\n")], "b.csv", "recording/several-vehicles", ""),
        (&[("a.csv", A), ("b.csv", "t,x,y\n0,1,2\n10,1,2\n")], "b.csv", "recording/several-clocks", ""),
        (&[("a.csv", A), ("b.csv", "timestamp,x,y\n1700000000.5,1,2\n")], "b.csv", "recording/several-clocks", ""),
        (&[("a.csv", A), ("a.txt", B)], "a.txt", "recording/vehicle-twice", ""),
        (&[("a.csv", A), ("b.csv", "t,x,y\n0,one,2\n")], "b.csv", "recording/not-a-number", "line 2"),
        (&[("a.csv", A), ("b.csv", "duration,x^0,y^0,z^0\n1,0,0,0\n")], "b.csv", "recording/several-vehicles", ""),
        (&[("readme.md", "nothing")], "", "recording/folder", ""),
    ] {
        let error = whole(folder(files).path()).expect_err(code);
        assert_refused(&error, code, place);
        assert!(error.file.ends_with(file), "{error}");
    }
}

const CURVE: &str = "Duration,x^0,x^1,y^0,y^1,z^0,z^1\n1,0,1,0,0,1,0\n";

#[test]
fn start_option_shifts_relative_curves() {
    let folder = folder(&[("cf1.csv", CURVE), ("cf2.csv", CURVE)]);
    let found = whole(folder.path()).expect("read");
    assert!(found.notes.iter().any(|note| note.contains("start=NAME=X,Y,Z")), "{:?}", found.notes);
    let mut options = ReadOptions::default();
    options.starts.insert("cf2".to_owned(), [0.0, 3.0, 0.5]);
    let found = Whole::read(folder.path(), &options).expect("read");
    let begins = found.items.iter().map(|item| match item {
        Item::Piece(piece) => (piece.vehicle, piece.coefficients[0].as_slice().to_vec(), piece.coefficients[1].x),
        Item::Sample(_) => panic!("a sample"),
    });
    assert_eq!(begins.collect::<Vec<_>>(), [(0, vec![0.0, 0.0, 1.0], 1.0), (1, vec![0.0, 3.0, 1.5], 1.0)]);
    assert!(!found.notes.iter().any(|note| note.contains("start=NAME=X,Y,Z")), "{:?}", found.notes);
    options.starts.insert("cf3".to_owned(), [0.0; 3]);
    let refused = Whole::read(folder.path(), &options).expect_err("refused");
    assert_refused(&refused, "recording/unknown-vehicle", "");
    // An archive of the same folder is equivalent.
    let path = folder.path().join("curves.zip");
    fs::write(&path, zipped(&[("cf1.csv", CURVE), ("cf2.csv", CURVE)])).expect("written");
    assert_eq!(whole(&path).expect("read").vehicles, ["cf1", "cf2"]);
    // The option does not apply to samples.
    fs::write(folder.path().join("flight.csv"), A).expect("written");
    let refused = Whole::read(&folder.path().join("flight.csv"), &options).expect_err("refused");
    assert_refused(&refused, "recording/unused-option", "");
}

#[test]
fn skybrush_show_defines_its_minimum_distance() {
    let show = |settings: &str| format!(r#"{{"version": 1, {settings} "swarm": {{"drones": []}}}}"#);
    let folder = folder(&[
        ("said.json", &show(r#""settings": {"validation": {"minDistance": 2.5, "maxAltitude": 100}},"#)),
        ("silent.json", &show(r#""settings": {},"#)),
        ("wrong.json", &show(r#""settings": {"validation": {"minDistance": -1}},"#)),
        ("table.csv", A),
    ]);
    let rules =
        |name: &str, options: &ReadOptions| read::show_rules(&folder.path().join(name), options).expect("a show");
    let limit = |name: &str| rules(name, &ReadOptions::default()).and_then(|rules| rules.min_distance_m);
    assert_eq!(["said.json", "silent.json", "wrong.json", "table.csv"].map(limit), [Some(2.5), None, None, None]);
    let scaled = ReadOptions { scale: Some(0.5.into()), ..ReadOptions::default() };
    assert_eq!(rules("said.json", &scaled).and_then(|rules| rules.min_distance_m), Some(1.25));
    assert_eq!(rules("table.csv", &scaled), None);
}

#[test]
fn unsupported_formats_have_a_remedy() {
    let folder = folder(&[]);
    for (bytes, said, way) in [
        (&b"#ROSBAG V2.0\n"[..], "a ROS 1 bag", "rosbags-convert"),
        (b"SQLite format 3\0\x10", "SQLite", "rosbags-convert --src BAG --dst flight --dst-storage mcap"),
        (b"\xa3\x95\x80\x80", "ArduPilot", "mavlogdump"),
        (b"FMT, 128, 89, FMT, BBnNZ, Type,Length\n", "ArduPilot", "mavlogdump"),
        (b"\0\x05\xf0\0\0\0\0\0\xfd\x09", "MAVLink", "mavlogdump"),
        (b"<?xml version=\"1.0\"?>\n<gpx creator=\"x\">", "GPX", "lat,lon,alt"),
        (b"<?xml version=\"1.0\"?>\n<kml xmlns=\"x\">", "KML", "lat,lon,alt"),
        (b"  <?xml version=\"1.0\"?><flight/>", "XML", "t,id,x,y,z"),
        (b"{\"type\": \"FeatureCollection\", \"features\": []}", "not a Skybrush show", "t,id,x,y,z"),
        (b"{\"t\":{\"0\":0.0,\"1\":0.5},\"id\":{\"0\":\"a\"}}", "JSON object of columns", "orient=\"records\""),
        (b"{ \"columns\": [\"t\", \"id\"], \"data\": [[0, \"a\"]]}", "JSON object of columns", "orient=\"records\""),
        (b"[[0, 1, 2]]", "neither a Skybrush show nor an array of objects", "t,id,x,y,z"),
        (b"\x89HDF\r\n\x1a\n\0", "HDF5", "numpy.savez"),
        (b"7z\xbc\xaf\x27\x1c\0\x04", "7z archive", "give the folder"),
        (&[&[b'a'; 257][..], b"ustar\x0000"].concat(), "tar archive", "give the folder"),
    ] {
        let path = folder.path().join("recording");
        fs::write(&path, bytes).expect("written");
        let error = whole(&path).expect_err(said);
        assert_refused(&error, "recording/unsupported-format", "");
        assert!(error.to_string().contains(said) && error.help().contains(way), "{error}\n{}", error.help());
    }
    let said = "rosbag2_bagfile_information:\n  storage_identifier: sqlite3\n  relative_file_paths: [flight_0.db3]\n";
    let bag = self::folder(&[("metadata.yaml", said), ("flight_0.db3", "")]);
    let error = whole(bag.path()).expect_err("refused");
    assert_refused(&error, "recording/unsupported-format", "");
}
