//! Speed of reading recordings on one core, and memory for a file of two gigabytes.
//!
//! Reading includes opening, the check of the order of times, and all items.

use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::Path;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use tautline::read::{self, ReadOptions};

const VEHICLES: u64 = 20;

/// Size of the timed files \[bytes\].
const TIMED_BYTES: u64 = 32 * 1024 * 1024;

/// Size of the file for the measurement of memory \[bytes\].
const LARGE_BYTES: u64 = 2 * 1024 * 1024 * 1024;

/// Returns the coordinates of a vehicle at a time, with all digits of a double.
fn position(k: u64, vehicle: u64) -> [f64; 3] {
    let phase = k as f64 / 50.0 + vehicle as f64;
    [20.0 * phase.sin() + vehicle as f64, 20.0 * phase.cos(), 10.0 + phase.sin() * 0.1]
}

/// Writes a table of about this size: long with all digits, long with millimetres, or wide.
fn table(path: &Path, shape: &str, bytes: u64) {
    let mut out = BufWriter::new(File::create(path).expect("a file"));
    let header = match shape {
        "wide" => (1..=VEHICLES).fold(String::new(), |header, n| header + &format!(",x{n},y{n},z{n}")),
        _ => ",id,x,y,z".to_owned(),
    };
    writeln!(out, "t{header}").expect("written");
    let mut block = Vec::new();
    let mut written = 0;
    for k in 0_u64.. {
        let time_s = k as f64 * 0.02;
        block.clear();
        for vehicle in 0..VEHICLES {
            let [x, y, z] = position(k, vehicle);
            match shape {
                "wide" if vehicle == 0 => write!(block, "{time_s},{x},{y},{z}"),
                "wide" => write!(block, ",{x},{y},{z}"),
                "millimetres" => writeln!(block, "{time_s:.2},{},{x:.3},{y:.3},{z:.3}", vehicle + 1),
                _ => writeln!(block, "{time_s},{},{x},{y},{z}", vehicle + 1),
            }
            .expect("written");
        }
        if shape == "wide" {
            block.push(b'\n');
        }
        out.write_all(&block).expect("written");
        written += block.len() as u64;
        if written >= bytes {
            break;
        }
    }
    out.flush().expect("written");
}

fn read_all(path: &Path) -> u64 {
    let mut tracks = read::open(path, &ReadOptions::default()).expect("opens");
    let (mut items, mut count) = (Vec::new(), 0);
    while tracks.read(&mut items).expect("reads") {
        count += items.len() as u64;
        items.clear();
    }
    count
}

/// Returns the peak memory of the process \[bytes\], if the system reports it.
fn peak_bytes() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.split_whitespace().next()?.parse::<u64>().ok().map(|kib| kib * 1024)
}

fn csv(criterion: &mut Criterion) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("flight.csv");
    let mut group = criterion.benchmark_group("read-csv");
    group.sample_size(10);
    for shape in ["long", "millimetres", "wide"] {
        table(&path, shape, TIMED_BYTES);
        let bytes = fs::metadata(&path).expect("exists").len();
        group.throughput(Throughput::Bytes(bytes));
        group.bench_function(shape, |bencher| bencher.iter(|| read_all(&path)));
    }
    group.finish();
}

fn memory(_: &mut Criterion) {
    if std::env::args().any(|argument| argument == "--test") {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("large.csv");
    table(&path, "long", LARGE_BYTES);
    let begin = std::time::Instant::now();
    let rows = read_all(&path);
    let megabytes = fs::metadata(&path).expect("exists").len() as f64 / 1e6;
    let speed = megabytes / begin.elapsed().as_secs_f64();
    let peak = peak_bytes().map_or_else(|| "unknown".to_owned(), |bytes| format!("{:.1} MB", bytes as f64 / 1e6));
    println!("read-csv/large: {rows} rows, {megabytes:.0} MB, {speed:.0} MB/s; peak of the process {peak}");
}

criterion_group!(benches, csv, memory);
criterion_main!(benches);
