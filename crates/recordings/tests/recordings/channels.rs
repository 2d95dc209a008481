//! Channels of a run are exported with it, and readers of motion ignore them.

use std::fs::{self, File};
use std::io::Read as _;
use std::path::{Path, PathBuf};

use parquet::file::reader::SerializedFileReader;
use parquet::record::RowAccessor as _;
use tautline_core::record::{Channel, Sample, Sink as _};
use tautline_core::swarm::{Rows, Swarm};
use tautline_recordings::export::{self, ExportOptions, Format};
use tautline_recordings::mcap::{Header, McapRecorder};
use tautline_recordings::read::{self, ReadOptions};
use tempfile::TempDir;

use crate::recording::Whole;

const VEHICLES: usize = 3;
const SAMPLES: usize = 40;

/// Returns a number that uses all its bits; the last column of the last vehicle is unknown at first.
fn number(k: usize, vehicle: usize, column: usize) -> f64 {
    let unknown = k == 0 && vehicle == 2 && column == 3;
    if unknown { f64::INFINITY } else { ((k * 12 + vehicle * 4 + column) as f64 + 0.1).sin() / 3.0 }
}

/// Returns a run with an attitude channel and a channel whose columns have names of position columns.
fn run() -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.mcap");
    let mut recorder = McapRecorder::create(&path, &Header::new("made-up", "", VEHICLES, 0.5)).expect("created");
    for k in 0..SAMPLES {
        let positions_m = Rows::from_fn(VEHICLES, |i, axis| (i * 3 + axis) as f64 + (k as f64).cos());
        let (swarm, control) = (Swarm::at_rest(positions_m), Rows::zeros(VEHICLES));
        let filled = |name, columns: &[&str]| {
            let cell = |n| number(k, n / columns.len(), n % columns.len());
            let values = (0..VEHICLES * columns.len()).map(cell).collect();
            Channel { values, ..Channel::new(name, columns) }
        };
        let channels =
            [filled("attitude", &["qw", "qx", "qy", "qz"]), filled("positions", &["x", "y", "x2", "wind_x_m_s"])];
        let sample = Sample { channels: &channels, ..Sample::new(k as f64 / 60.0, k as u64, &swarm, &control) };
        recorder.sample(&sample).expect("recorded");
    }
    recorder.finish().expect("written");
    (folder, path)
}

fn exported(from: &Path, format: Format) -> PathBuf {
    let to = from.with_file_name(format!("{}-{}", from.file_name().expect("a name").display(), format.name));
    let open = || read::open(from, &ReadOptions::default());
    let channels = || read::open_channels(from);
    let mut file = File::create(&to).expect("a file");
    export::export_with(&open, &channels, format, &ExportOptions::default(), &mut file).expect("exported");
    to
}

fn whole(path: &Path) -> Whole {
    Whole::read(path, &ReadOptions::default()).unwrap_or_else(|error| panic!("{error}"))
}

const HEADER: [&str; 16] = [
    "t_s",
    "id",
    "x",
    "y",
    "z",
    "vx",
    "vy",
    "vz",
    "qw",
    "qx",
    "qy",
    "qz",
    "positions_x",
    "positions_y",
    "positions_x2",
    "wind_x_m_s",
];

#[test]
fn channels_do_not_affect_the_motion() {
    let (_folder, run) = run();
    let truth = whole(&run);
    assert_eq!((truth.vehicles.len(), truth.items.len()), (VEHICLES, VEHICLES * SAMPLES));
    for &format in export::WRITTEN {
        let found = whole(&exported(&run, format));
        assert_eq!((found.vehicles, found.items == truth.items), (truth.vehicles.clone(), true), "{format:?}");
    }
}

#[test]
fn tables_have_channel_columns_with_empty_cells_for_unknown_values() {
    let (_folder, run) = run();
    let text = fs::read_to_string(exported(&run, Format::CSV)).expect("a table");
    let mut lines = text.lines().map(|line| line.split(',').collect::<Vec<_>>());
    assert_eq!(lines.next().expect("a header"), HEADER);
    let mut empty = 0;
    for (n, cells) in lines.enumerate() {
        for (column, cell) in cells[8..].iter().enumerate() {
            let expected = number(n / VEHICLES, n % VEHICLES, column % 4);
            empty += usize::from(cell.is_empty());
            let read = cell.parse().unwrap_or(f64::INFINITY);
            assert_eq!(f64::to_bits(read), expected.to_bits(), "line {n}, column {column}: {cell}");
        }
    }
    assert_eq!(empty, 2);
    // Parquet has the same columns.
    let file = File::open(exported(&run, Format::PARQUET)).expect("a file");
    let rows = SerializedFileReader::new(file).expect("Parquet").into_iter();
    for (n, row) in rows.map(|row| row.expect("a row")).enumerate() {
        assert!(row.get_column_iter().map(|(name, _)| name).eq(&HEADER), "{row}");
        for column in 0..8 {
            let expected = Some(number(n / VEHICLES, n % VEHICLES, column % 4)).filter(|number| number.is_finite());
            assert_eq!(row.get_double(8 + column).ok(), expected, "row {n}, column {column}");
        }
    }
}

#[test]
fn npz_has_arrays_of_channels_and_column_names() {
    let (_folder, run) = run();
    let file = File::open(exported(&run, Format::NPZ)).expect("a file");
    let mut archive = zip::ZipArchive::new(file).expect("an archive");
    let mut content = |name: &str| {
        let mut bytes = Vec::new();
        archive.by_name(name).unwrap_or_else(|_| panic!("{name}")).read_to_end(&mut bytes).expect("read");
        bytes
    };
    for name in ["attitude.npy", "channel_positions.npy"] {
        let bytes = content(name);
        let (header, numbers) = bytes.split_at(bytes.len() - SAMPLES * VEHICLES * 4 * 8);
        assert!(String::from_utf8_lossy(header).contains("(40, 3, 4,)"), "{}", String::from_utf8_lossy(header));
        for (n, eight) in numbers.chunks_exact(8).enumerate() {
            let found = f64::from_le_bytes(eight.try_into().expect("eight bytes"));
            assert_eq!(found.to_bits(), number(n / 12, n / 4 % 3, n % 4).to_bits(), "{name}, {n}");
        }
    }
    let letters: String = content("attitude_columns.npy").iter().map(|&byte| char::from(byte)).collect();
    assert!(letters.replace('\0', "").ends_with("qwqxqyqz"), "{letters}");
}

#[test]
fn channels_survive_repeated_mcap_export() {
    let (_folder, run) = run();
    let once = fs::read(exported(&run, Format::CSV)).expect("a table");
    let mcap = exported(&run, Format::MCAP);
    assert!(fs::read(exported(&mcap, Format::CSV)).expect("a table") == once);
    let open = || read::open(&run, &ReadOptions::default());
    let bare = run.with_file_name("bare.csv");
    export::export(&open, Format::CSV, &ExportOptions::default(), &mut File::create(&bare).expect("a file"))
        .expect("exported");
    let bare_text = fs::read_to_string(&bare).expect("a table");
    assert_eq!(bare_text.lines().next(), Some("t_s,id,x,y,z,vx,vy,vz"), "exported without channels");
    assert!(read::open_channels(&bare).expect("no channels").is_none());
}
