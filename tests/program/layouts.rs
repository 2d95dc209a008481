//! Layouts of arrays whose shape is ambiguous.

use std::fs;
use std::io::Write as _;

use crate::program::{TAUTLINE, ran_by};

/// Returns an array of doubles in the format of `NumPy`.
fn array(shape: &str, numbers: &[f64]) -> Vec<u8> {
    let header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}\n");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend_from_slice(&u16::try_from(header.len()).expect("short").to_le_bytes());
    bytes.extend_from_slice(header.as_bytes());
    bytes.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
    bytes
}

#[test]
fn a_layout_is_named_on_the_command_line_or_in_the_settings() {
    let folder = tempfile::tempdir().expect("a folder");
    // Two vehicles in space at four times, with axes before vehicles; they meet at the third time.
    let at = |time: f64| [time, 4.0 - time, 0.0, 0.0, 9.0, 9.0];
    let positions: Vec<_> = (0..4).flat_map(|time| at(f64::from(time))).collect();
    let file = fs::File::create(folder.path().join("flight.npz")).expect("a file");
    let mut zip = zip::ZipWriter::new(file);
    for (name, bytes) in
        [("t.npy", array("(4,)", &[0.0, 1.0, 2.0, 3.0])), ("positions.npy", array("(4, 3, 2)", &positions))]
    {
        zip.start_file(name, zip::write::SimpleFileOptions::default()).expect("an entry");
        zip.write_all(&bytes).expect("written");
    }
    zip.finish().expect("finished");
    fs::write(folder.path().join("flight.csv"), "t,id,x,y,z\n0,a,0,0,0\n0,b,9,0,0\n").expect("written");
    let audit = |words: &[&str]| ran_by(TAUTLINE, folder.path(), &[&["audit", "--delta", "0.5"], words].concat());

    let asked = audit(&["flight.npz"]);
    assert!(
        asked.exit == Some(2) && asked.err.contains("--layout time,vehicle,axis or time,axis,vehicle"),
        "{asked:?}"
    );
    let said = audit(&["flight.npz", "--layout", "time,axis,vehicle"]);
    assert!(said.exit == Some(1) && said.out.contains("1 and 2 came to 0.000 m"), "{said:?}");
    let plane = audit(&["flight.npz", "--layout", "time,vehicle,axis"]);
    assert!(plane.out.contains("in the plane of x and y"), "{plane:?}");
    let contradicted = audit(&["flight.npz", "--layout", "vehicle,time,axis"]);
    assert!(contradicted.exit == Some(2) && contradicted.err.contains("there are 4 times"), "{contradicted:?}");
    let unknown = audit(&["flight.npz", "--layout", "xyz"]);
    assert!(unknown.exit == Some(2) && unknown.err.contains("time,vehicle,axis"), "{unknown:?}");
    let needless = audit(&["flight.csv", "--layout", "time,vehicle,axis"]);
    assert!(needless.exit == Some(2) && needless.err.contains("omit --layout"), "{needless:?}");

    // Settings apply to all recordings beside them, of any format.
    fs::write(folder.path().join("tautline.toml"), "[audit]\nlayout = \"time,axis,vehicle\"\n").expect("written");
    assert_eq!((audit(&["flight.npz"]).exit, audit(&["flight.csv"]).exit), (Some(1), Some(0)));
    assert_eq!(audit(&["flight.npz", "--layout", "vehicle,time,axis"]).exit, Some(2));
}
