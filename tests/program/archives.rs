//! Audits of folders and archives with several files.

use std::fs;
use std::io::{Cursor, Write as _};
use std::path::Path;

use tempfile::TempDir;
use zip::write::SimpleFileOptions;

use crate::program::{Ran, TAUTLINE, ran_by};

/// Two vehicles, 2 m apart.
const A: &str = "t,x,y,z\n0,0,0,0\n0.5,0,1,0\n1,0,2,0\n";
const B: &str = "t,x,y,z\n0,2,0,0\n0.5,2,1,0\n1,2,2,0\n";
/// The same as curves.
const CURVES: [&str; 2] = ["duration,x^0,y^0,z^0\n1,0,0,0\n", "duration,x^0,y^0,z^0\n1,2,0,0\n"];
const README: &str = "Columns: t, x, y, z (time in s, metres)\n0.5 1 2 3\n";

fn folder(files: &[(&str, &[u8])]) -> TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, content) in files {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().expect("a parent")).expect("a folder");
        fs::write(path, content).expect("written");
    }
    folder
}

fn zipped(files: &[(&str, &[u8])]) -> Vec<u8> {
    let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for (name, content) in files {
        zip.start_file(*name, SimpleFileOptions::default()).expect("an entry");
        zip.write_all(content).expect("written");
    }
    zip.finish().expect("finished").into_inner()
}

fn audit(folder: &Path, arguments: &[&str]) -> Ran {
    ran_by(TAUTLINE, folder, &[&["audit", "--delta", "1.9"], arguments].concat())
}

/// Returns standard error with single blanks.
fn words(ran: &Ran) -> String {
    ran.err.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Writes the same files into a folder and into an archive.
fn both(files: &[(&str, &[u8])]) -> TempDir {
    let inside: Vec<_> = files.iter().map(|(name, content)| (format!("flight/{name}"), *content)).collect();
    let inside: Vec<_> = inside.iter().map(|(name, content)| (name.as_str(), *content)).collect();
    let folder = folder(&inside);
    fs::write(folder.path().join("flight.zip"), zipped(files)).expect("written");
    folder
}

fn refused(folder: &Path, arguments: &[&str], said: &str, remedy: &str) {
    let ran = audit(folder, arguments);
    let words = words(&ran);
    assert_eq!(ran.exit, Some(2), "{arguments:?}: {words} {}", ran.out);
    assert!(words.contains(said), "{arguments:?}: {words}\ninstead of {said}");
    assert!(words.contains(remedy), "{arguments:?}: {words}\ninstead of {remedy}");
}

#[test]
fn nested_folders_are_named_with_a_remedy() {
    let both = both(&[("day1/a.csv", A.as_bytes()), ("day1/b.csv", B.as_bytes()), ("day2/a.csv", A.as_bytes())]);
    let said = "its tables are in folders: day1/ (2 tables), day2/ (1 table)";
    refused(both.path(), &["flight.zip"], said, "unpack it, and give one of its folders: day1");
    refused(both.path(), &["flight"], said, "give one of them: flight/day1");
    let one = audit(both.path(), &["flight/day1"]);
    assert_eq!(one.exit, Some(0), "{one:?}");
    // Beside another file, nested tables are named too.
    fs::write(both.path().join("c.csv"), A).expect("written");
    refused(both.path(), &["--join", "c.csv", "flight"], "some of its tables are in folders: day1/", "flight/day1");
    // Curves in folders are read in order; in an archive, files at the top come before folders.
    let curves = self::both(&[("a/1.csv", CURVES[0].as_bytes()), ("b/1.csv", CURVES[1].as_bytes())]);
    for path in ["flight", "flight.zip"] {
        assert_eq!(audit(curves.path(), &[path]).exit, Some(0), "{path}");
    }
    let top = self::both(&[("a.csv", A.as_bytes()), ("b.csv", B.as_bytes()), ("old/c.csv", A.as_bytes())]);
    for path in ["flight", "flight.zip"] {
        let ran = audit(top.path(), &[path]);
        assert_eq!(ran.exit, Some(0), "{path}: {ran:?}");
        assert!(words(&ran).contains("not read, as they are not tables: old/"), "{path}: {ran:?}");
    }
}

#[test]
fn nested_archives_and_recordings_are_named() {
    let inner = zipped(&[("a.csv", A.as_bytes()), ("b.csv", B.as_bytes())]);
    let folder = folder(&[
        ("outer.zip", &zipped(&[("inner.zip", &inner), ("readme.md", b"")])),
        ("beside.zip", &zipped(&[("a.csv", A.as_bytes()), ("b.csv", B.as_bytes()), ("inner.zip", &inner)])),
        ("words.zip", &zipped(&[("readme.md", b"words")])),
        ("bag/flight.mcap", b"\x89MCAP0\r\n"),
    ]);
    let said = "there is no table in the archive; it contains inner.zip, readme.md";
    refused(folder.path(), &["outer.zip"], said, "unpack it, and give inner.zip");
    refused(folder.path(), &["words.zip"], "there is no table in the archive", "pack one table per vehicle");
    refused(folder.path(), &["bag"], "there is no table in the folder", "give flight.mcap inside it");
    let beside = audit(folder.path(), &["beside.zip"]);
    assert_eq!(beside.exit, Some(0), "{beside:?}");
    assert!(words(&beside).contains("not read, as they are not tables: inner.zip"), "{beside:?}");
}

#[test]
fn notes_beside_tables_are_named_and_not_read() {
    let (readme, a, b) = (("readme.txt", README.as_bytes()), ("a.csv", A.as_bytes()), ("b.csv", B.as_bytes()));
    let site = ("site.dat", "Flown on 12 May 2024, 8 m/s of wind.\nSee www.example.org for more.\n".as_bytes());
    let curves = [("a.csv", CURVES[0].as_bytes()), ("b.csv", CURVES[1].as_bytes()), readme, site];
    for files in [&[a, b, readme, site][..], &curves] {
        let both = both(files);
        for path in ["flight", "flight.zip"] {
            let ran = audit(both.path(), &[path]);
            assert_eq!(ran.exit, Some(0), "{path}: {ran:?}");
            assert!(words(&ran).contains("not read, as they are not tables: readme.txt, site.dat"), "{path}: {ran:?}");
        }
    }
    // Compressed tables are read, in any order.
    let packed = |table: &str| {
        let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
        gzip.write_all(table.as_bytes()).expect("written");
        gzip.finish().expect("finished")
    };
    let packed = self::both(&[("a.csv.gz", &packed(A)), ("b.csv.gz", &packed(B))]);
    for path in ["flight", "flight.zip"] {
        let ran = audit(packed.path(), &[path]);
        assert_eq!(ran.exit, Some(0), "{path}: {ran:?}");
    }
    // Wrong or empty tables may belong to a vehicle.
    for (name, content, said) in [
        ("c.txt", "t x y z\n", "c.txt: it has a header and no rows"),
        ("c.txt", "", "c.txt: it is empty"),
        ("c.txt", "0 1 2 x\n1 1 2 3\n", "c.txt, line 1: "),
        ("c.csv", "mass,1.5\n", "c.csv, line 1: "),
        ("c.dat", "# time east north\n", "c.dat"),
    ] {
        let both = both(&[a, b, (name, content.as_bytes())]);
        for path in ["flight", "flight.zip"] {
            let ran = audit(both.path(), &[path]);
            assert!(ran.exit == Some(2) && words(&ran).contains(said), "{path} {name}: {ran:?}");
        }
    }
    let broken = both(&[a, b, ("c.csv", b"mass,1.5\n")]);
    refused(broken.path(), &["flight"], "c.csv", "remove the file if it does not belong to the recording");
}

#[test]
fn two_entries_of_one_name_are_refused() {
    let mut bytes = zipped(&[("one/x.csv", A.as_bytes()), ("one/y.csv", B.as_bytes()), ("one/z.csv", B.as_bytes())]);
    let at: Vec<_> = memchr::memmem::find_iter(&bytes, b"one/y.csv").collect();
    assert_eq!(at.len(), 2, "beside the file and in the directory");
    for at in at {
        bytes[at..at + 9].copy_from_slice(b"one/x.csv");
    }
    let folder = folder(&[("twice.zip", &bytes)]);
    refused(folder.path(), &["twice.zip"], "two entries have the name `one/x.csv`", "unpack it");
}

#[test]
fn errors_in_joined_files_name_their_file() {
    let late = "t,x,y,z\n1700000000.5,2,0,0\n1700000001,2,1,0\n";
    let folder = folder(&[
        ("a.csv", A.as_bytes()),
        ("b.csv", B.as_bytes()),
        ("late.csv", late.as_bytes()),
        ("other/a.csv", B.as_bytes()),
        ("wrong.csv", b"t,x,y,z\n0,2,zero,0\n"),
        ("radius.csv", b"t,x,y,z,radius\n0,2,0,0,1\n1,2,0,0,2\n"),
    ]);
    for (files, said) in [
        (["a.csv", "late.csv"], "late.csv: the clock of `late` begins more than a month"),
        (["a.csv", "other/a.csv"], "other/a.csv: the vehicle of a.csv has the same name `a`"),
        (["a.csv", "wrong.csv"], "wrong.csv, line 2: column `y` holds `zero`"),
        (["a.csv", "nowhere.csv"], "nowhere.csv: "),
        (["a.csv", "radius.csv"], "a.csv, radius.csv: vehicle radius at 1.0 s: the radius changes"),
    ] {
        refused(folder.path(), &[&["--join"][..], &files].concat(), said, "");
    }
    let joined = audit(folder.path(), &["--join", "a.csv", "b.csv", "--json"]);
    let report: serde_json::Value = serde_json::from_str(&joined.out).expect("JSON");
    assert_eq!((joined.exit, &report["recording"]), (Some(0), &"a.csv, b.csv".into()));
}
