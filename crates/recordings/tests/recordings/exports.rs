//! Exports round-trip bit for bit.

use std::fs::{self, File};
use std::path::{Path, PathBuf};

use tautline_core::track::{Item, Sample};
use tautline_recordings::export::{self, ExportError, ExportOptions, Format};
use tautline_recordings::read::{self, ReadOptions};
use tempfile::TempDir;

use crate::recording::Whole;

fn export(from: &Path, to: &Path, format: Format, options: &ExportOptions) -> Result<(), ExportError> {
    let open = || read::open(from, &ReadOptions::default());
    let mut file = File::create(to).expect("a file");
    export::export(&open, format, options, &mut file).map(drop)
}

fn whole(path: &Path) -> Whole {
    Whole::read(path, &ReadOptions::default()).unwrap_or_else(|error| panic!("{error}"))
}

fn folder_with(name: &str, content: &str) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join(name);
    fs::write(&path, content).expect("written");
    (folder, path)
}

/// Returns all exported values as bits.
fn bits(whole: &Whole) -> Vec<(u64, String, Vec<u64>)> {
    let item = |item: &Item| {
        let Item::Sample(Sample { vehicle, time_s, position_m, velocity_m_s, radius_m }) = item else {
            panic!("a piece")
        };
        let unknown = [f64::NAN; 3].into();
        let velocity = velocity_m_s.unwrap_or(unknown);
        let numbers = position_m.iter().chain(&velocity).chain(radius_m).map(|x| x.to_bits()).collect();
        (time_s.to_bits(), whole.vehicles[*vehicle].clone(), numbers)
    };
    whole.items.iter().map(item).collect()
}

/// Returns a table with numbers that use all bits, a late vehicle, a vehicle without velocity, and unusual names.
fn awkward(first_time: &str, more_time: &str) -> String {
    [
        "t_s,id,x,y,z,vx,vy,vz,radius\n",
        &format!("{first_time},\"lead, er\",0.1,-0.0,1e-310,0.30000000000000004,1e300,-5e-324,0.15\n"),
        &format!("{first_time},10,1,2,3,,,,\n"),
        &format!("{more_time},10,3.141592653589793,2.718281828459045,-1.4142135623730951,1,2,3,\n"),
        &format!("{more_time},9,1e16,123456789.12345679,-7,,,,0.2\n"),
    ]
    .concat()
}

#[test]
fn every_format_round_trips_bit_for_bit() {
    for (first, more) in [
        ("0.1", "0.30000000000000004"),
        ("-3.5", "0"),
        ("-0.0", "1"),
        ("1700000000.123456789", "1700000000.2"),
        ("999999.9", "1000000.1"),
    ] {
        let (folder, source) = folder_with("source.csv", &awkward(first, more));
        let truth = whole(&source);
        assert_eq!(truth.items.len(), 4);
        for &format in export::WRITTEN {
            let target = folder.path().join(format!("target.{}", format.name));
            export(&source, &target, format, &ExportOptions::default()).unwrap_or_else(|e| panic!("{format:?}: {e}"));
            let found = whole(&target);
            assert_eq!(bits(&found), bits(&truth), "{format:?} from {first}");
            assert_eq!(found.clock.epoch_ns, truth.clock.epoch_ns, "{format:?} from {first}");
        }
    }
}

#[test]
fn chain_of_exports_is_lossless() {
    let rows: Vec<_> = (0..3000)
        .map(|k| {
            let (time, phase) = (f64::from(k / 3) / 60.0, f64::from(k));
            format!("{time},{},{},{},{}\n", k % 3 + 1, phase.sin(), phase.cos() * 1e3, phase.sqrt())
        })
        .collect();
    let (folder, source) = folder_with("source.csv", &format!("t_s,id,x,y,z\n{}", rows.concat()));
    let truth = bits(&whole(&source));
    let mut from = source;
    for format in [Format::NPZ, Format::MCAP, Format::PARQUET, Format::CSV, Format::MCAP, Format::NPZ] {
        let to = folder.path().join(format!("{}.{}", truth.len(), format.name));
        export(&from, &to, format, &ExportOptions::default()).unwrap_or_else(|error| panic!("{format:?}: {error}"));
        assert!(bits(&whole(&to)) == truth, "{format:?}");
        from = to;
    }
}

#[test]
fn square_arrays_keep_their_axes() {
    let (folder, source) = folder_with("source.csv", "t_s,id,x,y,z\n0,1,1,2,3\n0,2,4,5,6\n1,1,7,8,9\n1,2,10,11,12\n");
    let target = folder.path().join("target.npz");
    export(&source, &target, Format::NPZ, &ExportOptions::default()).expect("exported");
    assert_eq!(bits(&whole(&target)), bits(&whole(&source)));
}

#[test]
fn bit_comparison_detects_one_changed_bit() {
    let (_folder, source) = folder_with("source.csv", &awkward("0", "1"));
    let mut changed = whole(&source);
    let truth = bits(&changed);
    let Item::Sample(sample) = &mut changed.items[0] else { panic!("a piece") };
    sample.position_m.x = f64::from_bits(sample.position_m.x.to_bits() + 1);
    assert_ne!(bits(&changed), truth);
}

const PARABOLA: &str = "duration,x^0,x^1,x^2,y^0,y^1,y^2,z^0,z^1,z^2\n2,1,2,3,0,0,0,1,0,0\n";

#[test]
fn curves_require_a_sampling_rate() {
    let (folder, source) = folder_with("cf1.csv", PARABOLA);
    let target = folder.path().join("target.csv");
    let refused = export(&source, &target, Format::CSV, &ExportOptions::default()).expect_err("refused");
    assert!(matches!(refused, ExportError::Curves) && refused.help().contains("with sample_hz;"), "{refused}");

    export(&source, &target, Format::CSV, &ExportOptions { sample_hz: Some(2.0) }).expect("exported");
    let positions: Vec<_> = whole(&target).samples().iter().map(|&(t, _, p)| (t, p[0])).collect();
    let expected = [0.0, 0.5, 1.0, 1.5, 2.0].map(|t| (t, 1.0 + 2.0 * t + 3.0 * t * t));
    assert_eq!(positions, expected);
    let Item::Sample(last) = whole(&target).items[4].clone() else { panic!("a piece") };
    assert_eq!(last.velocity_m_s.map(|v| v.x), Some(14.0));
}

#[test]
fn end_of_every_curve_is_sampled() {
    let folder = tempfile::tempdir().expect("a folder");
    let curves = folder.path().join("curves");
    fs::create_dir(&curves).expect("a folder");
    fs::write(curves.join("cf1.csv"), PARABOLA).expect("written");
    fs::write(curves.join("cf2.csv"), PARABOLA.replace("\n2,1,", "\n1.75,9,")).expect("written");
    let target = folder.path().join("target.csv");
    export(&curves, &target, Format::CSV, &ExportOptions { sample_hz: Some(0.8) }).expect("exported");
    let whole = whole(&target);
    let times = |name: &str| whole.samples().iter().filter(|s| s.1 == name).map(|s| s.0).collect::<Vec<_>>();
    assert_eq!(times("cf1"), [0.0, 1.25, 1.75, 2.0]);
    assert_eq!(times("cf2"), [0.0, 1.25, 1.75]);
}

#[test]
fn resampling_and_invalid_rates_are_refused() {
    let (folder, samples) = folder_with("source.csv", &awkward("0", "1"));
    let target = folder.path().join("target.csv");
    let at = |hz| ExportOptions { sample_hz: Some(hz) };
    assert!(matches!(export(&samples, &target, Format::CSV, &at(2.0)), Err(ExportError::NoCurves)));
    let (_other, curves) = folder_with("cf1.csv", PARABOLA);
    for hz in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e300] {
        assert!(matches!(export(&curves, &target, Format::CSV, &at(hz)), Err(ExportError::SampleRate(_))), "{hz}");
    }
}
