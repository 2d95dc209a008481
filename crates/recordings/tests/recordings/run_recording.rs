//! `run.mcap` round-trips bit for bit and reports damage.

use std::fs;
use std::path::{Path, PathBuf};

use mcap::records::op;
use proptest::prelude::*;
use tautline_core::record::{Event, OwnedSample, ReadFault, RecordError, Sink, StateHash};
use tautline_core::swarm::{ClosestApproach, Pair, Rows, Swarm};
use tautline_recordings::mcap::{Entry, FLUSH_BYTES, FLUSH_PERIOD_S, Header, McapRecorder, McapRecording};
use tempfile::TempDir;

const RECORD_HZ: f64 = 60.0;

/// Synthetic run with all kinds of events, numbers that use all bits, and samples with and without a summary.
pub(crate) struct Run {
    pub(crate) header: Header,
    pub(crate) samples: Vec<OwnedSample>,
    pub(crate) events: Vec<Event>,
}

impl Run {
    pub(crate) fn new(vehicles: usize, samples: usize) -> Self {
        let header = Header::new("made-up", "name = \"made-up\" # ünïcode\n", vehicles, 2.0);
        let samples = (0..samples).map(|k| sample(vehicles, k)).collect();
        let pair = Pair::new(2, 1);
        let events = vec![
            Event::StepRefined { time_s: 0.0, dt_s: 1.0 / 480.0 },
            Event::ViolationBegan { pair, time_s: 0.25 },
            Event::EngineContact { pair, time_s: 0.26 },
            Event::HullsHit { pair, time_s: 0.27, closing_m_s: 1.25 },
            Event::OtherLaw { time_s: 0.0, name: "springs".to_owned() },
            Event::LegBegan { leg: 2, time_s: 0.3 },
            Event::Approach { pair, time_s: 0.4, separation_m: 1.5327 },
            Event::ViolationEnded { pair, time_s: 0.5, min_m: 1.5327 },
            Event::EndedEarly { time_s: 0.75, reason: "the law is undefined".to_owned() },
        ];
        Self { header, samples, events }
    }

    /// Records everything and calls `after_sample` after each sample.
    fn record(&self, path: &Path, mut after_sample: impl FnMut(usize)) -> Result<(), RecordError> {
        let mut recorder = McapRecorder::create(path, &self.header)?;
        for (k, sample) in self.samples.iter().enumerate() {
            recorder.sample(&sample.as_sample())?;
            after_sample(k);
            if let Some(event) = self.events.get(k) {
                recorder.event(event)?;
            }
        }
        recorder.finish()
    }
}

fn sample(vehicles: usize, k: usize) -> OwnedSample {
    let time_s = k as f64 / RECORD_HZ;
    let rows = |seed: f64| Rows::from_fn(vehicles, |i, axis| ((i * 3 + axis) as f64 + seed).sin() / (1.0 + time_s));
    let known = k % 3 != 1;
    OwnedSample {
        time_s,
        step: 4 * k as u64,
        swarm: Swarm { positions_m: rows(0.1), velocities_m_s: rows(0.2) },
        control: rows(-0.0),
        separation: known.then(|| ClosestApproach {
            pair: Pair::new(0, 4),
            separation_m: 2.0 + time_s,
            time_s: time_s - 0.001,
        }),
        energy: known.then_some(1.0 / 3.0),
        peaks: tautline_core::record::Peaks::default(),
        channels: Vec::new(),
    }
}

pub(crate) fn folder() -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("run.mcap");
    (folder, path)
}

pub(crate) fn recorded(run: &Run) -> Vec<u8> {
    let (_folder, path) = folder();
    run.record(&path, |_| ()).expect("recorded");
    fs::read(&path).expect("readable")
}

pub(crate) fn read(bytes: &[u8]) -> Result<(Header, Vec<OwnedSample>, Vec<Event>, bool), RecordError> {
    let (_folder, path) = folder();
    fs::write(&path, bytes).expect("writable");
    let recording = McapRecording::open(&path)?;
    let (header, complete) = (recording.header().clone(), recording.is_complete());
    let (samples, events) = recording.read_all()?;
    Ok((header, samples, events, complete))
}

pub(crate) fn fault(bytes: &[u8]) -> ReadFault {
    match read(bytes) {
        Err(RecordError::Read { fault, .. }) => fault,
        other => panic!("expected a fault, got {other:?}"),
    }
}

pub(crate) fn hash(samples: &[OwnedSample]) -> String {
    let mut hash = StateHash::new();
    for sample in samples {
        hash.observe(&sample.as_sample());
    }
    hash.finish()
}

/// Returns the byte ranges of the chunks, by the framing alone: type, length, content.
fn chunks(bytes: &[u8]) -> Vec<std::ops::Range<usize>> {
    let (mut at, mut found) = (mcap::MAGIC.len(), Vec::new());
    while bytes[at] != op::DATA_END {
        let length = u64::from_le_bytes(bytes[at + 1..at + 9].try_into().expect("8 bytes"));
        let end = at + 9 + usize::try_from(length).expect("fits");
        if bytes[at] == op::CHUNK {
            found.push(at..end);
        }
        at = end;
    }
    found
}

#[test]
fn round_trip_preserves_all_bits() {
    let run = Run::new(5, 150);
    let (header, samples, events, complete) = read(&recorded(&run)).expect("read back");
    assert!(complete);
    assert_eq!(header, run.header);
    assert_eq!(samples, run.samples);
    assert_eq!(events, run.events);
    assert_eq!(hash(&samples), hash(&run.samples));
    let mut changed = samples;
    changed[149].control[(4, 2)] = changed[149].control[(4, 2)].next_up();
    assert_ne!(hash(&changed), hash(&run.samples), "one bit of the last control goes unnoticed");
}

#[test]
fn samples_and_events_keep_their_order() {
    let run = Run::new(5, 4);
    let (_folder, path) = folder();
    run.record(&path, |_| ()).expect("recorded");
    let entries: Vec<_> = McapRecording::open(&path).expect("opens").map(|entry| entry.expect("reads")).collect();
    let expected = run.samples.iter().zip(&run.events);
    let expected = expected.flat_map(|(s, e)| [Entry::Sample(s.clone()), Entry::Event(e.clone())]);
    assert_eq!(entries, expected.collect::<Vec<_>>());
}

#[test]
fn two_recordings_of_one_run_are_equal_byte_for_byte() {
    let first = recorded(&Run::new(5, 150));
    std::thread::sleep(std::time::Duration::from_millis(20));
    assert!(first == recorded(&Run::new(5, 150)), "the same run gave different bytes");
    let mut other = Run::new(5, 150);
    other.samples[70].swarm.positions_m[(3, 1)] += 1e-15;
    assert!(first != recorded(&other), "another run gave the same bytes");
}

#[test]
fn messages_agree_with_the_reader_of_the_mcap_crate() {
    let run = Run::new(5, 90);
    let bytes = recorded(&run);
    let mut topics = std::collections::BTreeMap::new();
    for message in mcap::MessageStream::new(&bytes).expect("an MCAP file") {
        let message = message.expect("a message");
        let schema = message.channel.schema.as_ref().expect("a schema");
        assert_eq!((message.channel.message_encoding.as_str(), schema.encoding.as_str()), ("cdr", "ros2msg"));
        assert_eq!(message.log_time, message.publish_time);
        if message.channel.topic == "/swarm" {
            // CDR header of 4 bytes, time and step precede the length of the first array.
            assert_eq!(message.data[..4], [0, 1, 0, 0]);
            let time_s = f64::from_le_bytes(message.data[4..12].try_into().expect("8 bytes"));
            assert!((message.log_time as f64 - time_s * 1e9).abs() <= 0.5, "{} ns at {time_s} s", message.log_time);
            assert_eq!(message.data[20..24], 15_u32.to_le_bytes());
        }
        *topics.entry(message.channel.topic.clone()).or_insert(0) += 1;
    }
    let expected = [("/events", 9), ("/scenario", 1), ("/summary", 90), ("/swarm", 90)];
    assert_eq!(topics, expected.map(|(topic, count)| (topic.to_owned(), count)).into());
    assert!(mcap::Summary::read(&bytes).expect("a readable index").is_some());
}

#[test]
fn truncated_file_yields_all_flushed_chunks() {
    let run = Run::new(5, 200);
    let (_folder, path) = folder();
    let mut flushed = vec![(0, 0)];
    run.record(&path, |k| {
        let length = usize::try_from(fs::metadata(&path).expect("exists").len()).expect("fits");
        if flushed.last().is_none_or(|&(before, _)| length > before) {
            flushed.push((length, k + 1));
        }
    })
    .expect("recorded");
    assert!(flushed.len() >= 4, "three seconds of samples were flushed {} times", flushed.len() - 1);
    let bytes = fs::read(&path).expect("readable");
    for cut in (0..bytes.len()).step_by(37).chain(flushed.iter().map(|&(length, _)| length)) {
        let promised = flushed.iter().rev().find(|&&(length, _)| length <= cut).map_or(0, |&(_, n)| n);
        match read(&bytes[..cut]) {
            Ok((header, samples, _, complete)) => {
                assert!(!complete, "a file cut at {cut} passes for whole");
                assert!(samples.len() >= promised, "cut at {cut}: {} of {promised} samples", samples.len());
                assert_eq!(samples, run.samples[..samples.len()], "cut at {cut}");
                assert_eq!(header, run.header);
            }
            Err(RecordError::Read { fault, .. }) => {
                assert_eq!(promised, 0, "cut at {cut}: {fault} in spite of {promised} flushed samples");
            }
            Err(other) => panic!("cut at {cut}: {other}"),
        }
    }
}

#[test]
fn chunks_are_flushed_by_time_and_by_size() {
    for (vehicles, samples) in [(5, 200), (1000, 40)] {
        let run = Run::new(vehicles, samples);
        let (_folder, path) = folder();
        let mut seen = (0, 0);
        run.record(&path, |k| {
            let length = fs::metadata(&path).expect("exists").len();
            if length > seen.0 {
                seen = (length, k);
            }
            let waiting = k - seen.1;
            assert!(waiting as f64 / RECORD_HZ < FLUSH_PERIOD_S, "{waiting} samples are waiting");
            assert!(waiting * 72 * vehicles < FLUSH_BYTES, "{waiting} samples of {vehicles} vehicles are waiting");
        })
        .expect("recorded");
        assert!(seen.1 > 0);
    }
}

#[test]
fn rare_samples_are_flushed_individually() {
    let (_folder, path) = folder();
    let mut recorder = McapRecorder::create(&path, &Run::new(5, 0).header).expect("creates");
    let mut length = 0;
    for k in 0..3 {
        let rare = OwnedSample { time_s: 10.0 * f64::from(k), ..sample(5, 0) };
        recorder.sample(&rare.as_sample()).expect("recorded");
        let before = std::mem::replace(&mut length, fs::metadata(&path).expect("exists").len());
        assert!(length > before, "sample {k} is waiting");
    }
}

#[test]
fn dropped_recorder_leaves_a_readable_file() {
    let run = Run::new(5, 10);
    let (_folder, path) = folder();
    let mut recorder = McapRecorder::create(&path, &run.header).expect("creates");
    for sample in &run.samples {
        recorder.sample(&sample.as_sample()).expect("recorded");
    }
    drop(recorder);
    let (samples, _) = McapRecording::open(&path).expect("opens").read_all().expect("reads");
    assert_eq!(samples, run.samples);
}

#[test]
#[cfg(target_os = "linux")]
fn full_disk_is_a_persistent_error_with_the_path() {
    let run = Run::new(5, 2);
    let mut recorder = McapRecorder::create(Path::new("/dev/full"), &run.header).expect("opens");
    let full = |result: Result<(), RecordError>| match result {
        Err(RecordError::Write { path, source }) => (path, source.kind()),
        other => panic!("expected a write error, got {other:?}"),
    };
    let first = full(recorder.sample(&run.samples[0].as_sample()));
    assert_eq!(first, ("/dev/full".to_owned(), std::io::ErrorKind::StorageFull));
    full(recorder.sample(&run.samples[1].as_sample()));
    full(recorder.event(&run.events[0]));
    full(recorder.finish());
    let mut dropped = McapRecorder::create(Path::new("/dev/full"), &run.header).expect("opens");
    full(dropped.sample(&run.samples[0].as_sample()));
    drop(dropped);
    drop(McapRecorder::create(Path::new("/dev/full"), &run.header).expect("opens"));
}

#[test]
fn missing_folder_is_an_error_with_the_path() {
    let (folder, _) = folder();
    let path = folder.path().join("missing/run.mcap");
    let error = McapRecorder::create(&path, &Run::new(5, 0).header).err().expect("an error");
    assert!(matches!(error, RecordError::Write { .. }));
    assert!(error.to_string().contains("missing/run.mcap"));
    assert!(matches!(McapRecording::open(&path), Err(RecordError::Open { .. })));
    assert!(matches!(McapRecording::open(folder.path()), Err(RecordError::Open { .. })));
}

#[test]
fn other_files_are_identified_in_the_error() {
    assert_eq!(fault(b""), ReadFault::Empty);
    assert_eq!(fault(b"time,x,y\n0,1,2\n"), ReadFault::NotMcap);
    assert_eq!(fault(&mcap::MAGIC[..5]), ReadFault::NotMcap);
    assert_eq!(fault(mcap::MAGIC), ReadFault::NoChannel { topic: "/swarm" });
}

/// Returns an MCAP file with one channel and one message, written by the `mcap` crate.
fn foreign(topic: &str, schema: &str, encoding: &str) -> Vec<u8> {
    let mut out = mcap::Writer::new(std::io::Cursor::new(Vec::new())).expect("writes");
    let schema = out.add_schema(schema, "ros2msg", b"float64 x").expect("a schema");
    let channel_id = out.add_channel(schema, topic, encoding, &[].into()).expect("a channel");
    let header = mcap::records::MessageHeader { channel_id, sequence: 0, log_time: 0, publish_time: 0 };
    out.write_to_known_channel(&header, &[0, 1, 0, 0]).expect("writes");
    out.finish().expect("finishes");
    out.into_inner().into_inner()
}

#[test]
fn foreign_mcap_files_are_refused_with_the_missing_channel() {
    assert_eq!(fault(&foreign("/odom", "nav_msgs/msg/Odometry", "cdr")), ReadFault::NoChannel { topic: "/swarm" });
    assert_eq!(
        fault(&foreign("/swarm", "tautline_msgs/msg/Swarm", "cdr")),
        ReadFault::Message { topic: "/swarm".to_owned(), reason: "unexpected end of input".to_owned() }
    );
    for (schema, encoding) in [("nav_msgs/msg/Odometry", "cdr"), ("tautline_msgs/msg/Swarm", "json")] {
        let found = fault(&foreign("/swarm", schema, encoding));
        assert!(matches!(found, ReadFault::ForeignChannel { topic: "/swarm", .. }), "{found}");
    }
}

#[test]
fn damaged_chunk_is_refused_after_the_intact_chunks() {
    let run = Run::new(5, 200);
    let bytes = recorded(&run);
    let chunks = chunks(&bytes);
    let mut broken = bytes.clone();
    broken[chunks[0].start + 9 + 100] ^= 1;
    assert!(matches!(fault(&broken), ReadFault::Damaged { offset, .. } if offset == chunks[0].start as u64));

    let mut broken = bytes;
    broken[chunks[2].end - 1] ^= 1;
    let (_folder, path) = folder();
    fs::write(&path, &broken).expect("writable");
    let entries: Vec<_> = McapRecording::open(&path).expect("opens").collect();
    let (last, before) = entries.split_last().expect("entries");
    assert!(matches!(last, Err(RecordError::Read { fault: ReadFault::Damaged { .. }, .. })), "{last:?}");
    assert!(before.len() > 60 && before.iter().all(Result::is_ok), "{} entries before", before.len());
}

#[test]
fn oversized_record_is_refused_before_reading() {
    let mut bytes = recorded(&Run::new(5, 10));
    let chunk = chunks(&bytes)[0].clone();
    bytes[chunk.start + 1..chunk.start + 9].copy_from_slice(&u64::MAX.to_le_bytes());
    assert!(matches!(fault(&bytes), ReadFault::TooLong { bytes: u64::MAX, .. }));
}

#[test]
fn record_past_the_end_of_a_closed_file_is_damage() {
    let mut bytes = recorded(&Run::new(5, 10));
    let chunk = chunks(&bytes)[0].clone();
    let beyond = bytes.len() as u64;
    bytes[chunk.start + 1..chunk.start + 9].copy_from_slice(&beyond.to_le_bytes());
    assert!(matches!(fault(&bytes), ReadFault::Damaged { .. }));
    bytes.truncate(bytes.len() - 1);
    assert_eq!(fault(&bytes), ReadFault::NoChannel { topic: "/swarm" });
}

#[test]
fn concatenated_recordings_are_refused() {
    let bytes = recorded(&Run::new(5, 10));
    assert!(matches!(fault(&[&bytes[..], &bytes[..]].concat()), ReadFault::Damaged { .. }));
}

#[test]
fn samples_with_a_wrong_vehicle_count_are_refused() {
    let mut run = Run::new(5, 3);
    run.samples[2] = sample(6, 2);
    assert!(matches!(fault(&recorded(&run)), ReadFault::Message { topic, .. } if topic == "/swarm"));
}

/// Sets the checksums of all chunks to "none", so that damage inside reaches the parsers.
fn without_checksums(mut bytes: Vec<u8>) -> Vec<u8> {
    for chunk in chunks(&bytes) {
        bytes[chunk.start + 9 + 24..chunk.start + 9 + 28].fill(0);
    }
    bytes
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn arbitrary_bytes_never_panic(magic in any::<bool>(), tail in proptest::collection::vec(any::<u8>(), 0..400)) {
        let bytes = if magic { [mcap::MAGIC, &tail].concat() } else { tail };
        let _ = read(&bytes);
    }

    #[test]
    fn damaged_recording_never_panics(
        checked in any::<bool>(),
        changes in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
    ) {
        let mut bytes = recorded(&Run::new(5, 8));
        prop_assert!(read(&without_checksums(bytes.clone())).is_ok());
        if !checked {
            bytes = without_checksums(bytes);
        }
        for (at, value) in changes {
            let at = at.index(bytes.len());
            bytes[at] = value;
        }
        let _ = read(&bytes);
    }
}
