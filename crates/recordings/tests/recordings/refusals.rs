//! Invalid recordings are refused with the file, the place, the value and the remedy.

use std::fs::{self, File};
use std::io::{Cursor, Write as _};
use std::path::PathBuf;

use tautline_recordings::export::{self, ExportOptions};
use tautline_recordings::read::{self, ArrayAxis, Dimensions, Format, Place, ReadError, ReadOptions, TimeUnit};
use tempfile::TempDir;
use zip::write::SimpleFileOptions;

use crate::recording::{Whole, assert_refused};

fn written(name: &str, bytes: &[u8]) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join(name);
    fs::write(&path, bytes).expect("written");
    (folder, path)
}

fn refused(name: &str, bytes: &[u8]) -> ReadError {
    refused_with(name, bytes, &ReadOptions::default())
}

fn refused_with(name: &str, bytes: &[u8], options: &ReadOptions) -> ReadError {
    let (_folder, path) = written(name, bytes);
    match Whole::read(&path, options) {
        Err(error) => {
            assert!(error.to_string().contains(name), "names no file: {error}");
            assert!(!error.is_machine(), "{error}");
            error
        }
        Ok(whole) => panic!("{name} was read: {} items", whole.items.len()),
    }
}

const LONG: &str = "t,id,x,y,z\n0,1,1,2,3\n0,2,1,2,3\n0.5,1,1,2,3\n0.5,2,1,2,3\n";

#[test]
fn invalid_tables_are_refused_with_their_place() {
    let change = |from: &str, to: &str| LONG.replacen(from, to, 1);
    let last = |to: &str| change("0.5,2,1,2,3", to);
    for (content, place, code) in [
        (change("t,id", "when,id"), "line 1", "recording/no-time-column"),
        (change("t,id", "t,who"), "line 1", "recording/no-vehicle-column"),
        (change("x,y,z", "x,w,z"), "line 1", "recording/no-position-column"),
        ("t,x1,y1,z1,x2,z2\n0,1,2,3,4,5\n".to_owned(), "line 1", "recording/no-position-column"),
        (change("x,y,z", "x,x,y"), "line 1", "recording/ambiguous-column"),
        (last("0.5,2,one,2,3"), "line 5", "recording/not-a-number"),
        (last("0.5,2,1,NaN,3"), "line 5", "recording/not-finite"),
        (last("0.5,2,1,2,-inf"), "line 5", "recording/not-finite"),
        (last("0.5,2,1,2,1e999"), "line 5", "recording/not-finite"),
        (last("later,2,1,2,3"), "line 5", "recording/not-a-number"),
        (last("12:00:01,2,1,2,3"), "line 5", "recording/time-format"),
        (LONG.replace('\n', "\r"), "line 1", "recording/line-ends"),
        (last("nan,2,1,2,3"), "line 5", "recording/not-finite"),
        (last(",2,1,2,3"), "line 5", "recording/empty-cell"),
        (last("0.5,,1,2,3"), "line 5", "recording/empty-cell"),
        (last("0.5,2,1,,3"), "line 5", "recording/empty-cell"),
        (last("0.5,2,1,2"), "line 5", "recording/field-count"),
        (last("0.5,1,1,2,4"), "line 5", "recording/duplicate-row"),
        (last("0.5,2,1,5,2,3"), "line 5", "recording/field-count"),
        (LONG.replace(',', ";").replace("0.5;2", "0,5;2"), "line 5", "recording/decimal-comma"),
        (last("0.5,\"2,1,2,3"), "line 5", "recording/unclosed-quotes"),
        ("t,x1,y1,z1\n0,1,2,3\n1,1,2,3\n0.5,1,2,3\n".into(), "line 4", "recording/time-backwards"),
        ("t,x1,y1,z1\n0,1,2,3\n0,1,2,4\n".into(), "line 3", "recording/duplicate-row"),
        ("0,1,1,2,3\n0.5,1,1,2,3\n".into(), "line 1", "recording/no-header"),
        ("t,id,x,y,z\n".into(), "", "recording/empty"),
        ("t,x1,y1,z1\r\n\r\n".into(), "", "recording/empty"),
        ("\n\n".into(), "", "recording/empty"),
        ("0 1 2 3\n0.5 1 2\n".into(), "line 2", "recording/field-count"),
        ("0 1 2 3 4\n".into(), "line 1", "recording/ambiguous-layout"),
        ("0 1 2 3 4 5 6 7\n".into(), "line 1", "recording/field-count"),
        ("0 1 2 3\n1 1 2 3\n0.5 1 2 3\n".into(), "line 3", "recording/time-backwards"),
        ("t,id,x,y,z,radius\n0,1,1,2,3,-1\n".into(), "line 2", "recording/radius"),
        ("t,id,x,y,z,radius\n0,a,1,2,3,1\n1,a,1,2,3,\n".into(), "line 3", "recording/radius"),
        ("t,id,x,y,z,vx,vy\n0,1,1,2,3,4,5\n".into(), "line 1", "recording/missing-column"),
        ("0,0 1,5 2,5 3,5\n".into(), "line 1", "recording/decimal-comma"),
        ("# at rest\n0 1,5 2 3\n".into(), "line 2", "recording/decimal-comma"),
        (change("0,2,1", "#0,2,1"), "line 3", "recording/not-a-number"),
    ] {
        assert_refused(&refused("flight.csv", content.as_bytes()), code, place);
    }
}

#[test]
fn messages_name_file_place_value_and_remedy() {
    let text = "t,id,x,y,z,radius\n0,a,1,2,3,1\n1,a,1,2,3,\n";
    let error = refused("flight.csv", text.as_bytes());
    assert!(error.to_string().ends_with("flight.csv, line 3: vehicle `a` has no radius here, but one at line 2"));
    let error = refused("flight.csv", LONG.replacen("0.5,2,1,2,3", "0.5,2,one,2,3", 1).as_bytes());
    assert!(error.to_string().ends_with("line 5: column `x` holds `one`, which is not a number"), "{error}");
    assert_eq!(error.help(), "write a number with a decimal point");
    let error = refused("flight.csv", LONG.replacen("t,id", "when,id", 1).as_bytes());
    assert!(error.help().starts_with("name the column with column=t=NAME"), "{}", error.help());
}

#[test]
fn unmodified_table_is_read() {
    let (_folder, path) = written("flight.csv", LONG.as_bytes());
    assert_eq!(Whole::read(&path, &ReadOptions::default()).expect("read").items.len(), 4);
}

#[test]
fn other_files_are_refused() {
    assert_eq!(refused("nothing.csv", b"").code(), "recording/empty");
    assert_eq!(refused("picture.png", b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR").code(), "recording/unknown-format");
    assert_eq!(refused("wide.txt", b"\xff\xfet\0,\0").code(), "recording/not-utf8");
    assert_eq!(refused("latin.csv", b"t,id,x,y,z\n0,caf\xe9,1,2,3\n").code(), "recording/not-utf8");
    let missing = read::open(&PathBuf::from("/no/such/file.csv"), &ReadOptions::default()).err().expect("refused");
    assert!(!missing.is_machine() && missing.to_string().contains("/no/such/file.csv"), "{missing}");
    assert_refused(&refused("array.npy", b"\x93NUMPY\x01\x00"), "recording/no-time-column", "");
    let folder = tempfile::tempdir().expect("a folder");
    let error = read::open(folder.path(), &ReadOptions::default()).err().expect("refused");
    assert_refused(&error, "recording/folder", "");
}

#[test]
fn line_length_is_limited() {
    let mut long = b"t,id,x,y,z\n0,1,1,2,".to_vec();
    long.resize(10_000_000, b'3');
    let error = refused("long.csv", &long);
    assert!(error.code() == "recording/line-too-long", "{error}");
    assert_eq!(error.place, Some(Place::Line(2)));
    let vehicles = 30_000;
    let wide: String = std::iter::once("0".to_owned()).chain((0..vehicles).map(|k| format!(" {k} 2 3"))).collect();
    let (_folder, path) = written("wide.txt", wide.as_bytes());
    let options = ReadOptions { dimensions: Some(Dimensions::Space), ..ReadOptions::default() };
    assert_eq!(Whole::read(&path, &options).expect("read").items.len(), vehicles);
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut out = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    out.write_all(bytes).expect("written");
    out.finish().expect("finished")
}

/// Returns one long recording in every format with detection of truncation.
fn in_every_format() -> Vec<(&'static str, Vec<u8>)> {
    let rows: Vec<_> = (0..2000).map(|k| format!("{},{},{k}.5,2,3\n", f64::from(k / 2), k % 2 + 1)).collect();
    let csv = format!("t_s,id,x,y,z\n{}", rows.concat());
    let (folder, source) = written("source.csv", csv.as_bytes());
    let exported = |format: export::Format| {
        let path = folder.path().join(format.name);
        let open = || read::open(&source, &ReadOptions::default());
        let mut file = File::create(&path).expect("a file");
        export::export(&open, format, &ExportOptions::default(), &mut file).expect("exported");
        fs::read(&path).expect("read")
    };
    vec![
        ("flight.csv.gz", gzip(csv.as_bytes())),
        ("flight.parquet", exported(export::Format::PARQUET)),
        ("flight.npz", exported(export::Format::NPZ)),
        ("flight.mcap", exported(export::Format::MCAP)),
    ]
}

#[test]
fn truncated_files_are_refused() {
    for (name, bytes) in in_every_format() {
        let (_folder, path) = written(name, &bytes);
        assert_eq!(Whole::read(&path, &ReadOptions::default()).expect("whole").items.len(), 2000, "{name}");
        for part in [0.1, 0.5, 0.9, 0.999] {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a part of a length")]
            let cut = (bytes.len() as f64 * part) as usize;
            let error = refused(name, &bytes[..cut]);
            let truncated = matches!(error.code(), "recording/truncated" | "recording/unfinished");
            assert!(truncated, "{name} at {part}: {error}");
        }
    }
}

#[test]
fn changed_byte_is_detected_by_checksums() {
    for (name, mut bytes) in in_every_format().into_iter().filter(|(name, _)| *name != "flight.parquet") {
        let middle = bytes.len() / 2;
        bytes[middle] ^= 0x10;
        let error = refused(name, &bytes);
        assert!(matches!(error.code(), "recording/damaged" | "recording/truncated"), "{name}: {error}");
    }
}

/// Returns an archive with an entry much larger than the file.
fn bomb(name: &str, begin: &[u8]) -> Vec<u8> {
    const INFLATED_BYTES: usize = 80 * 1024 * 1024;
    let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
    let packed = SimpleFileOptions::default().compression_method(zip::CompressionMethod::Deflated);
    if name == "positions.npy" {
        zip.start_file("t.npy", packed).expect("an entry");
        let header = "{'descr': '<f8', 'fortran_order': False, 'shape': (1,), }\n";
        zip.write_all(b"\x93NUMPY\x01\x00").expect("written");
        zip.write_all(&[u8::try_from(header.len()).expect("short"), 0]).expect("written");
        zip.write_all(header.as_bytes()).expect("written");
        zip.write_all(&[0; 8]).expect("written");
    }
    zip.start_file(name, packed).expect("an entry");
    zip.write_all(begin).expect("written");
    let block = vec![b' '; 1024 * 1024];
    for _ in 0..INFLATED_BYTES / block.len() {
        zip.write_all(&block).expect("written");
    }
    zip.finish().expect("finished").into_inner()
}

#[test]
fn decompression_bombs_are_refused() {
    let header = "{'descr': '<f8', 'fortran_order': False, 'shape': (1, 4000000, 3), }\n";
    let mut array = b"\x93NUMPY\x01\x00".to_vec();
    array.extend_from_slice(&[u8::try_from(header.len()).expect("short"), 0]);
    array.extend_from_slice(header.as_bytes());
    for (name, bytes) in [
        ("show.skyc", bomb("show.json", b"{")),
        ("flight.npz", bomb("positions.npy", &array)),
        ("flight.csv.gz", {
            let mut text = LONG.as_bytes().to_vec();
            text.resize(80 * 1024 * 1024, b'\n');
            gzip(&text)
        }),
    ] {
        assert!(bytes.len() < 1024 * 1024, "{name} is no bomb");
        let error = refused(name, &bytes);
        assert!(error.code() == "recording/grows-too-large", "{name}: {error}");
    }
}

#[test]
fn chunks_that_grow_without_end_are_refused() {
    // Five chunks of 250 MiB, each with one record of zeros of an unknown kind.
    const UNPACKED_BYTES: usize = 250 << 20;
    let mut records = vec![0; UNPACKED_BYTES];
    records[0] = 0x80;
    records[1..9].copy_from_slice(&(UNPACKED_BYTES as u64 - 9).to_le_bytes());
    let packed = zstd::encode_all(&records[..], 1).expect("packed");
    drop(records);
    let mut chunk = [[0; 16].as_slice(), &(UNPACKED_BYTES as u64).to_le_bytes(), &[0; 4]].concat();
    for field in [&4_u32.to_le_bytes()[..], b"zstd", &(packed.len() as u64).to_le_bytes(), &packed] {
        chunk.extend_from_slice(field);
    }
    let chunk = [&[6][..], &(chunk.len() as u64).to_le_bytes(), &chunk].concat();
    let header = [&[1][..], &8_u64.to_le_bytes(), &[0; 8]].concat();
    let file = |chunks: usize| [b"\x89MCAP0\r\n".as_slice(), &header, &chunk.repeat(chunks)].concat();
    let refused = |chunks| {
        let options = ReadOptions { allow_unfinished: true, ..ReadOptions::default() };
        refused_with("flight.mcap", &file(chunks), &options).to_string()
    };
    assert!(!refused(1).contains("200 times"), "{}", refused(1));
    assert!(refused(5).contains("its chunks unpack to more than 200 times their size"), "{}", refused(5));
}

#[test]
fn entries_that_share_bytes_are_refused() {
    let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for name in ["a.csv", "b.csv"] {
        zip.start_file(name, SimpleFileOptions::default()).expect("an entry");
        zip.write_all(b"t,x,y,z\n0,1,2,3\n1,1,2,3\n").expect("written");
    }
    let mut bytes = zip.finish().expect("finished").into_inner();
    let (_folder, path) = written("flight.zip", &bytes);
    assert!(Whole::read(&path, &ReadOptions::default()).is_ok());
    // The second entry of the directory points to the first one: its offset follows 42 bytes after the signature.
    let directory: Vec<_> = (0..bytes.len() - 4).filter(|&at| bytes[at..].starts_with(b"PK\x01\x02")).collect();
    bytes[directory[1] + 42..directory[1] + 46].fill(0);
    let error = refused("flight.zip", &bytes);
    assert_eq!(error.code(), "recording/archive-entry", "{error}");
    assert!(error.to_string().contains("two entries share bytes"), "{error}");
}

#[test]
fn rules_of_a_show_are_limited() {
    let show = |zeros: usize| {
        let values = vec!["{}"; zeros].join(",");
        let drone = r#"{"settings": {"trajectory": {"points": [[0, [1, 2, 3]], [1, [1, 2, 4]]]}}}"#;
        format!(r#"{{"swarm": {{"drones": [{drone}]}}, "settings": {{"x": [{values}]}}}}"#)
    };
    for (zeros, is_read) in [(10, true), (2_000_000, false)] {
        let (_folder, path) = written("show.json", show(zeros).as_bytes());
        assert!(Whole::read(&path, &ReadOptions::default()).is_ok(), "positions do not depend on the rules");
        match read::show_rules(&path, &ReadOptions::default()) {
            Ok(rules) => assert!(is_read && rules.is_some(), "{zeros}"),
            Err(error) => {
                assert!(!is_read, "{error}");
                assert_refused(&error, "recording/malformed", "");
            }
        }
    }
}

#[test]
fn documents_that_a_show_repeats_are_limited() {
    // Each drone refers to the same trajectory of 40 MB.
    let drone = r#"{"settings": {"trajectory": {"$ref": "./a.json"}}}"#;
    let show = format!(r#"{{"swarm": {{"drones": [{}]}}}}"#, [drone; 5].join(","));
    let mut trajectory = br#"{"points": [[0, [1, 2, 3]], [1, [1, 2, 4]]]"#.to_vec();
    trajectory.resize(40 * 1024 * 1024, b' ');
    trajectory.push(b'}');
    let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in [("show.json", show.as_bytes()), ("a.json", &trajectory)] {
        zip.start_file(name, SimpleFileOptions::default()).expect("an entry");
        zip.write_all(bytes).expect("written");
    }
    let error = refused("show.skyc", &zip.finish().expect("finished").into_inner());
    assert!(error.code() == "recording/grows-too-large", "{error}");
}

#[test]
fn false_lengths_allocate_no_memory() {
    // The header declares 10^15 numbers, but no data follow.
    let array = |shape: &str| {
        let header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}\n");
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend_from_slice(&[u8::try_from(header.len()).expect("short"), 0]);
        bytes.extend_from_slice(header.as_bytes());
        bytes.extend_from_slice(&[0; 8]);
        bytes
    };
    for shape in ["(1, 333333333333333, 3)", "(0, 999999999999999, 3)", "(1, 1000000000000000000, 3)"] {
        let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
        for (name, bytes) in [("t.npy", array("(1,)")), ("positions.npy", array(shape))] {
            zip.start_file(name, SimpleFileOptions::default()).expect("an entry");
            zip.write_all(&bytes).expect("written");
        }
        refused("flight.npz", &zip.finish().expect("finished").into_inner());
    }
}

#[test]
fn invalid_shows_are_refused_with_their_place() {
    let show = |points: &str| {
        format!(r#"{{"swarm": {{"drones": [{{"settings": {{"name": "A", "trajectory": {{"points": {points}}}}}}}]}}}}"#)
    };
    for (points, place, code) in [
        ("[[0, [1, 2, 3], []], [0, [1, 2, 3], []]]", "drone `A`, point 2", "recording/duplicate-row"),
        ("[[1, [1, 2, 3], []], [0, [1, 2, 3], []]]", "drone `A`, point 2", "recording/time-backwards"),
        ("[[0, [1, 2]]]", "line 1", "recording/malformed"),
        ("[[0, [1, 2, 1e999]]]", "line 1", "recording/malformed"),
        ("[]", "", "recording/no-positions"),
        ("[[0, [1, 2, 3]", "line 1", "recording/truncated"),
    ] {
        let whole = show(points);
        let is_cut = code == "recording/truncated";
        let show = if is_cut { whole.split('}').next().expect("a part").to_owned() } else { whole };
        assert_refused(&refused("show.json", show.as_bytes()), code, place);
    }
}

#[test]
fn invalid_polynomials_are_refused_with_their_place() {
    let header = "duration,x^0,x^1,y^0,y^1,z^0,z^1\n";
    for (rows, place, code) in [
        ("1,0,0,0,0,0,0\n1,0,zero,0,0,0,0\n", "line 3", "recording/not-a-number"),
        ("1,0,0,0,0,0,inf\n", "line 2", "recording/not-finite"),
        ("0,0,0,0,0,0,0\n", "line 2", "recording/duration"),
        ("-1,0,0,0,0,0,0\n", "line 2", "recording/duration"),
        ("1,0,0,0,0\n", "line 2", "recording/field-count"),
        ("", "", "recording/empty"),
    ] {
        assert_refused(&refused("cf1.csv", format!("{header}{rows}").as_bytes()), code, place);
    }
    for (header, missing) in [("x^0,y^0", "z^0"), ("x^0,y^0,z^0,x^1,y^1", "z^1"), ("x^0,y^0,z^0,x^2,y^2,z^2", "x^1")] {
        let error = refused("cf1.csv", format!("duration,{header}\n1,0,0\n").as_bytes());
        assert_refused(&error, "recording/missing-column", "line 1");
        assert!(error.to_string().ends_with(&format!("`{missing}`")), "{error}");
    }
}

#[test]
fn forced_format_must_match_the_content() {
    let forced = |format| ReadOptions { format: Some(format), ..ReadOptions::default() };
    for format in [Format::PARQUET, Format::NPZ, Format::MCAP, Format::CRAZYFLIE, Format::SKYBRUSH] {
        let error = refused_with("flight.csv", LONG.as_bytes(), &forced(format));
        let has_magic = [Format::PARQUET, Format::NPZ, Format::MCAP].contains(&format);
        assert_eq!(has_magic, error.code() == "recording/wrong-format", "{format:?}: {error}");
    }
    let unit = ReadOptions { time_unit: Some(TimeUnit::Milliseconds), ..ReadOptions::default() };
    let error = refused_with("cf1.csv", b"duration,x^0,y^0,z^0\n1,0,0,0\n", &unit);
    assert_refused(&error, "recording/unused-option", "");
    for (options, option) in [
        (ReadOptions { frame: Some("map".to_owned()), ..ReadOptions::default() }, "frame"),
        (ReadOptions { layout: Some(ArrayAxis::LAYOUTS[0]), ..ReadOptions::default() }, "layout"),
        (ReadOptions { allow_unfinished: true, ..ReadOptions::default() }, "allow_unfinished"),
    ] {
        let error = refused_with("flight.csv", LONG.as_bytes(), &options);
        assert_eq!(error.help(), format!("omit {option}"), "{error}");
    }
    for scale in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let options = ReadOptions { scale: Some(scale.into()), ..ReadOptions::default() };
        assert_refused(&refused_with("flight.csv", LONG.as_bytes(), &options), "recording/option-out-of-range", "");
    }
}
