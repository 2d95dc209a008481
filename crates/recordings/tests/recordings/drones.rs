//! Formats of drones: hand-made bytes are read, exports read back, and decoders that follow the firmware agree.

use std::fs;
use std::path::{Path, PathBuf};

use nalgebra::{Vector3, vector};
use tautline_core::track::Item;
use tautline_recordings::export::drones::motion::{Arc, Motion};
use tautline_recordings::export::drones::{self, Dialect, DroneOptions, deviation_with_rests};
use tautline_recordings::read::{self, ReadOptions};
use tempfile::TempDir;

use crate::recording::{Whole, assert_refused};

/// Block of a trajectory. Scale 10, start (0, 0, 1) m; a line of x to 5 m in 1 s, then a cubic of y in 2 s.
const BLOCK: &[u8] = &[
    1, 23, 0, 10, 0, 0, 0, 0, 100, 0, 0, 0, 0b01, 0xe8, 0x03, 0xf4, 0x01, 0b1000, 0xd0, 0x07, 0, 0, 0x2c, 0x01, 0x2c,
    0x01,
];

fn v1() -> Vec<u8> {
    // A comment comes first.
    [b"skyb\x01", &[3, 2, 0, b'h', b'i'][..], BLOCK].concat()
}

/// CRC-32, reflected, from 0 and without a complement.
fn checksum(bytes: &[u8]) -> u32 {
    bytes.iter().fold(0, |sum: u32, byte| {
        (0..8).fold(sum ^ u32::from(*byte), |sum, _| (sum >> 1) ^ if sum & 1 == 1 { 0xedb8_8320 } else { 0 })
    })
}

fn v2() -> Vec<u8> {
    let mut bytes = [b"skyb\x02\x01\0\0\0\0", &v1()[5..]].concat();
    let sum = checksum(&bytes).to_le_bytes();
    bytes[6..10].copy_from_slice(&sum);
    bytes
}

fn written(name: &str, bytes: &[u8]) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join(name);
    fs::write(&path, bytes).expect("written");
    (folder, path)
}

fn motions(path: &Path) -> Vec<(String, Motion)> {
    let mut recording = read::open(path, &ReadOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    let flown = drones::motions(recording.as_mut()).expect("read");
    flown.into_iter().map(|of| (of.name, of.motion)).collect()
}

#[test]
fn compiled_trajectories_are_read_as_specified() {
    for bytes in [v1(), v2()] {
        let (_folder, path) = written("drone7.skyb", &bytes);
        let found = motions(&path);
        assert_eq!((found.len(), &*found[0].0, found[0].1.span_s()), (1, "drone7", Some((0.0, 3.0))));
        let at = |time_s: f64| found[0].1.position_m(time_s);
        // The cubic 0, 0, 3, 3 has its middle at 1.5, here in y.
        for (time_s, expected) in [
            (0.0, vector![0.0, 0.0, 1.0]),
            (0.5, vector![2.5, 0.0, 1.0]),
            (1.0, vector![5.0, 0.0, 1.0]),
            (2.0, vector![5.0, 1.5, 1.0]),
            (3.0, vector![5.0, 3.0, 1.0]),
        ] {
            assert!((at(time_s) - expected).norm() < 1e-12, "{time_s}: {}", at(time_s));
        }
    }
}

#[test]
fn damaged_trajectories_are_refused() {
    let refused = |bytes: &[u8]| {
        let (_folder, path) = written("a.skyb", bytes);
        Whole::read(&path, &ReadOptions::default()).expect_err("refused")
    };
    for (bytes, code, place) in [
        (b"skyb".to_vec(), "recording/truncated", ""),
        (b"skyb\x03".to_vec(), "recording/unsupported-format", "byte 4"),
        (b"skyb\x02\x04".to_vec(), "recording/unsupported-format", "byte 5"),
        (b"skyb\x02\x01\0\0".to_vec(), "recording/truncated", ""),
        (b"skyb\x01".to_vec(), "recording/no-positions", ""),
        (b"skyb\x01\x02\x01\0\0".to_vec(), "recording/no-positions", ""),
        (b"skyb\x01\x01\xff\xff\x01".to_vec(), "recording/truncated", "byte 5"),
        (b"skyb\x01\x01\x00\x00".to_vec(), "recording/truncated", "byte 8"),
        (b"skyb\x01\x01\x09\0\x80\0\0\0\0\0\0\0\0".to_vec(), "recording/no-positions", "byte 8"),
        (b"skyb\x01\x01\x0b\0\x01\0\0\0\0\0\0\0\0\x01\x01".to_vec(), "recording/truncated", "byte 17"),
    ] {
        assert_refused(&refused(&bytes), code, place);
    }
    // A changed bit anywhere contradicts the checksum, unless it changes the header.
    for byte in 10..v2().len() {
        let mut bytes = v2();
        bytes[byte] ^= 4;
        assert_refused(&refused(&bytes), "recording/damaged", "byte 6");
    }
    for length in 5..v1().len() {
        refused(&v1()[..length]);
    }
}

#[test]
fn a_trajectory_without_segments_is_a_drone_that_stands() {
    let (_folder, path) = written("a.skyb", b"skyb\x01\x01\x09\0\x02\xe8\x03\0\0\0\0\0\0");
    let whole = Whole::read(&path, &ReadOptions::default()).expect("read");
    assert_eq!(whole.samples(), [(0.0, "a", [2.0, 0.0, 0.0])]);
}

#[test]
fn compressed_crazyflie_trajectories_are_recognised_by_their_end() {
    let bytes = [&[0, 0, 0, 0, 0xe8, 0x03, 0, 0][..], &[1, 0xf4, 0x01, 0x88, 0x13], &[0; 3]].concat();
    let (_folder, path) = written("cf4", &bytes);
    let found = motions(&path);
    assert_eq!((&*found[0].0, found[0].1.span_s()), ("cf4", Some((0.0, 0.5))));
    assert_eq!(found[0].1.position_m(0.25), vector![2.5, 0.0, 1.0]);
    for other in [&bytes[..bytes.len() - 1], &[&bytes[..], &[0]].concat(), &[0; 11]] {
        let (_folder, path) = written("cf4", other);
        let error = Whole::read(&path, &ReadOptions::default()).expect_err("refused");
        assert_eq!(error.code(), "recording/unknown-format", "{error}");
    }
}

/// Two vehicles on curves, sampled at 50 Hz for 6.5 s.
fn flight() -> Vec<(String, Motion)> {
    let place = |vehicle: u32, k: u32| {
        let t = f64::from(k) / 50.0;
        vector![f64::from(vehicle) + t.sin(), (0.7 * t).cos() - 5.0, 1.0 + 0.1 * t]
    };
    let motion = |vehicle: u32| {
        let at = |k: u32| f64::from(k) / 50.0;
        let arc = |k| Arc::straight(at(k), at(k + 1), place(vehicle, k), place(vehicle, k + 1));
        Motion { arcs: (0..325).map(arc).collect() }
    };
    [3, 12].map(|vehicle| (vehicle.to_string(), motion(vehicle))).into()
}

fn exported(options: &DroneOptions) -> (TempDir, PathBuf) {
    let (folder, path, _) = exported_with(options);
    (folder, path)
}

fn exported_with(options: &DroneOptions) -> (TempDir, PathBuf, drones::Encoded) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("out");
    let encoded = drones::encode(&flight(), options, &|| false).unwrap_or_else(|error| panic!("{error}"));
    if options.dialect.is_folder() {
        fs::create_dir(&path).expect("a folder");
    }
    for file in &encoded.files {
        let target = if file.name.is_empty() { path.clone() } else { path.join(&file.name) };
        fs::write(target, &file.bytes).expect("written");
    }
    (folder, path, encoded)
}

#[test]
fn every_dialect_reads_back_within_its_tolerance() {
    for dialect in Dialect::ALL {
        let usual = DroneOptions::new(dialect);
        let mut forms = vec![usual];
        match dialect {
            Dialect::Crazyflie => forms.push(DroneOptions { is_compressed: true, ..usual }),
            Dialect::Skyb => forms.push(DroneOptions { skyb_version: 1, ..usual }),
            Dialect::Skyc => {}
        }
        for options in forms {
            let (_folder, path) = exported(&options);
            let found = motions(&path);
            assert_eq!(found.iter().map(|of| &*of.0).collect::<Vec<_>>(), ["3", "12"], "{dialect:?}");
            for ((_, flown), (_, found)) in flight().iter().zip(&found) {
                let deviation = deviation_with_rests(flown, found);
                assert!(
                    deviation.bound_m <= usual.tolerance_m && deviation.bound_m > 0.0,
                    "{options:?}: {deviation:?}"
                );
            }
            let again = exported(&options);
            assert_eq!(bytes_of(&path), bytes_of(&again.1), "{options:?} is not deterministic");
        }
    }
}

fn bytes_of(path: &Path) -> Vec<Vec<u8>> {
    let Ok(entries) = fs::read_dir(path) else { return vec![fs::read(path).expect("read")] };
    let mut paths: Vec<_> = entries.map(|entry| entry.expect("an entry").path()).collect();
    paths.sort();
    paths.iter().map(|path| fs::read(path).expect("read")).collect()
}

/// Evaluates control points as the firmware does: coefficients of powers in single precision, then Horner's rule.
fn firmware(points: &[f32], duration: f32, t: f32) -> f32 {
    let n = points.len() - 1;
    let factorial = |k: usize| (1..=k).product::<usize>() as f32;
    let coefficient = |j: usize| {
        let term = |i: usize| {
            let sign = if (i + j).is_multiple_of(2) { 1.0 } else { -1.0 };
            sign * points[i] / factorial(i) / factorial(j - i)
        };
        (0..=j).map(term).sum::<f32>() * factorial(n)
            / factorial(n - j)
            / std::iter::repeat_n(duration, j).product::<f32>()
    };
    (0..=n).rev().fold(0.0, |sum, j| sum * t + coefficient(j))
}

/// Decodes segments independently of the crate: position at a time, and the offset after the last segment.
fn decoded(bytes: &[u8], unit_m: f32, time_s: f32) -> Vector3<f64> {
    let number = |at: usize| f32::from(i16::from_le_bytes([bytes[at], bytes[at + 1]])) * unit_m;
    let mut start = [0, 2, 4, 6].map(number);
    let (mut at, mut from_s) = (8, 0.0);
    loop {
        let header = bytes[at];
        let duration = f32::from(u16::from_le_bytes([bytes[at + 1], bytes[at + 2]])) / 1000.0;
        at += 3;
        let mut place = [0.0; 4];
        for axis in 0..4 {
            let count = [0, 1, 3, 7][usize::from(header >> (2 * axis) & 3)];
            let points: Vec<f32> = std::iter::once(start[axis]).chain((0..count).map(|k| number(at + 2 * k))).collect();
            at += 2 * count;
            place[axis] = firmware(&points, duration, (time_s - from_s).min(duration));
            start[axis] = points[count];
        }
        from_s += duration;
        if time_s <= from_s || at + 3 >= bytes.len() {
            return vector![place[0], place[1], place[2]].map(f64::from);
        }
    }
}

#[test]
fn decoders_in_single_precision_agree_with_the_reader() {
    let usual = DroneOptions::new(Dialect::Skyb);
    let (_skyb, skyb, of_skyb) = exported_with(&usual);
    let compressed = DroneOptions { is_compressed: true, ..DroneOptions::new(Dialect::Crazyflie) };
    let (_traj, traj, of_traj) = exported_with(&compressed);
    let (_plain, plain, of_plain) = exported_with(&DroneOptions::new(Dialect::Crazyflie));
    let mut largest_m = [0.0_f64; 3];
    for (index, name) in ["3", "12"].into_iter().enumerate() {
        let file = fs::read(skyb.join(format!("{name}.skyb"))).expect("read");
        assert_eq!(file[6..10], checksum(&[&file[..6], &[0; 4], &file[10..]].concat()).to_le_bytes());
        let unit_m = f32::from(file[13]) / 1000.0;
        let segments = fs::read(traj.join(format!("{name}.traj"))).expect("read");
        let rows = fs::read_to_string(plain.join(format!("{name}.csv"))).expect("read");
        let found = [&skyb, &traj, &plain].map(|path| motions(path)[index].1.clone());
        for k in 0..=65_u16 {
            let time_s = f32::from(k) / 10.0;
            let truth = flight()[index].1.position_m(f64::from(time_s));
            let held =
                [decoded(&file[14..], unit_m, time_s), decoded(&segments, 0.001, time_s), polynomial(&rows, time_s)];
            for (k, (held, found)) in held.iter().zip(&found).enumerate() {
                let read = found.position_m(f64::from(time_s));
                let bound_m = [&of_skyb, &of_traj, &of_plain][k].vehicles[index].add_evaluation(&mut found.clone());
                // The time itself has single precision, at 1 m/s.
                let off_m = (held - read).norm();
                assert!(off_m <= bound_m + 1e-6, "{time_s}: {held} {read} {bound_m}");
                assert!((read - truth).norm() <= 0.01, "{time_s}: {read} {truth}");
                largest_m[k] = largest_m[k].max(off_m);
            }
        }
    }
    // Negative twin: the rounding of the compressed forms is no rounding of their positions of 6 m.
    assert!(largest_m[0].min(largest_m[1]) > 10.0 * 6.0 / 16_777_216.0, "{largest_m:?}");
}

/// Evaluates the CSV of a Crazyflie in single precision.
fn polynomial(text: &str, time_s: f32) -> Vector3<f64> {
    let mut t = time_s;
    let rows: Vec<Vec<f32>> = text
        .lines()
        .skip(1)
        .map(|line| line.split(',').map(|cell| cell.parse().expect("a number")).collect())
        .collect();
    let row = rows
        .iter()
        .find(|row| {
            t <= row[0] || {
                t -= row[0];
                false
            }
        })
        .unwrap_or_else(|| {
            t += rows[rows.len() - 1][0];
            &rows[rows.len() - 1]
        });
    Vector3::from_fn(|axis, _| {
        let powers = &row[1 + 8 * axis..9 + 8 * axis];
        f64::from(powers.iter().rev().fold(0.0, |sum, power| sum * t + power))
    })
}

#[test]
fn shows_state_their_distance_and_names() {
    let (_folder, path) = exported(&DroneOptions { delta_m: Some(1.5), ..DroneOptions::new(Dialect::Skyc) });
    let rules = read::show_rules(&path, &ReadOptions::default()).expect("a show").expect("rules");
    assert_eq!(rules.min_distance_m, Some(1.5));
    let whole = Whole::read(&path, &ReadOptions::default()).expect("read");
    let degrees = whole.items.iter().filter_map(|item| match item {
        Item::Piece(piece) => Some(piece.coefficients.len() - 1),
        Item::Sample(_) => None,
    });
    assert!(degrees.clone().count() > 1 && degrees.clone().all(|degree| [0, 1, 3, 7].contains(&degree)));
}

#[test]
fn a_folder_of_compiled_trajectories_is_one_recording() {
    let folder = tempfile::tempdir().expect("a folder");
    let stands = b"skyb\x01\x01\x09\0\x02\xe8\x03\0\0\0\0\0\0";
    for (name, bytes) in [("d10.skyb", &v1()[..]), ("d9.skyb", &v2()), ("d2.skyb", stands), ("show.md", b"notes")] {
        fs::write(folder.path().join(name), bytes).expect("written");
    }
    let found = motions(folder.path());
    assert_eq!(found.iter().map(|of| &*of.0).collect::<Vec<_>>(), ["d2", "d9", "d10"]);
    assert!(found.iter().all(|(_, motion)| motion.span_s() == Some((0.0, 3.0))), "{found:?}");
    fs::write(folder.path().join("d11.skyb"), b"skyb\x01").expect("written");
    let refused = Whole::read(folder.path(), &ReadOptions::default()).expect_err("refused");
    assert!(refused.file.ends_with("d11.skyb") && refused.help().contains("remove the file"), "{refused}");
}

/// The firmware evaluates polynomials by the scheme of Horner in single precision.
#[test]
fn deviation_covers_single_precision_in_the_drone() {
    let options = DroneOptions { tolerance_m: 0.1, ..DroneOptions::new(Dialect::Crazyflie) };
    let x_m = |k: u32| 3e4 + f64::from(k % 4);
    let arc = |k: u32| {
        Arc::straight(f64::from(k), f64::from(k + 1), vector![x_m(k), 0.0, 0.0], vector![x_m(k + 1), 0.0, 0.0])
    };
    let flight = [("a".to_owned(), Motion { arcs: (0..4).map(arc).collect() })];
    let encoded = drones::encode(&flight, &DroneOptions { tolerance_m: 0.5, ..options }, &|| false);
    let encoded = encoded.expect("encoded");
    let file = &encoded.files[0];
    let (_folder, path) = written("a.csv", &file.bytes);
    let mut held = motions(&path).remove(0).1;
    let exact = deviation_with_rests(&flight[0].1, &held);
    let added_m = encoded.vehicles[0].add_evaluation(&mut held);
    let whole = deviation_with_rests(&flight[0].1, &held);
    // At least 24 roundings of 30 km.
    assert!(
        added_m > 24.0 * 3e4 / 16_777_216.0 && whole.bound_m >= exact.found_m + 0.5 * added_m,
        "{exact:?} {whole:?}"
    );
    let text = String::from_utf8(file.bytes.clone()).expect("text");
    let (mut start_s, mut worst_m) = (0.0, 0.0_f64);
    for line in text.lines().skip(1) {
        let numbers: Vec<f32> = line.split(',').map(|cell| cell.parse().expect("a number")).collect();
        for step in 0..=1000_u16 {
            let t = numbers[0] * (f32::from(step) / 1000.0);
            let x = numbers[1..9].iter().rev().fold(0.0_f32, |sum, power| sum * t + power);
            let judged_m = held.position_m(start_s + f64::from(t)).x;
            worst_m = worst_m.max((f64::from(x) - judged_m).abs());
        }
        start_s += f64::from(numbers[0]);
    }
    assert!(worst_m > 1e-3 && worst_m <= added_m, "{worst_m} {added_m}");
    // A tolerance below the rounding of the drone is refused.
    let far = [(
        "a".to_owned(),
        Motion { arcs: vec![Arc::straight(0.0, 1.0, vector![1e6, 0.0, 0.0], vector![1e6, 1.0, 0.0])] },
    )];
    let refused = drones::encode(&far, &DroneOptions::new(Dialect::Crazyflie), &|| false).expect_err("refused");
    assert_eq!(refused.code(), "export/tolerance", "{refused}");
}
