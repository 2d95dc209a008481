//! The audit of a run is valid only in an unchanged file.

use std::borrow::Cow;
use std::fs;
use std::io::Cursor;

use mcap::Message;
use tautline_core::record::Sink as _;
use tautline_recordings::mcap::{McapRecorder, McapRecording, RunAudit, RunFinding, StoredAudit};

use super::run_recording::{Run, folder};

fn audit() -> RunAudit {
    let closest = RunFinding { vehicle: 1, other_vehicle: 2, limit_m: 2.0, min_m: 2.5, ..RunFinding::default() };
    RunAudit { status: "clear".to_owned(), limit_m: 2.0, closest: vec![closest], ..RunAudit::default() }
}

/// Returns a recording that was closed with the audit.
fn closed() -> Vec<u8> {
    let ((_folder, path), run) = (folder(), Run::new(5, 8));
    let mut recorder = McapRecorder::create(&path, &run.header).expect("made");
    for sample in &run.samples {
        recorder.sample(&sample.as_sample()).expect("recorded");
    }
    recorder.event(&run.events[0]).expect("recorded");
    recorder.close(audit()).expect("closed");
    fs::read(&path).expect("readable")
}

fn stored(bytes: &[u8]) -> StoredAudit {
    let (_folder, path) = folder();
    fs::write(&path, bytes).expect("writable");
    let mut recording = McapRecording::open(&path).expect("a recording");
    for entry in recording.by_ref() {
        entry.expect("readable");
    }
    recording.stored_audit()
}

/// Returns the recording with edited messages, as written by an MCAP editor.
fn edited(edit: impl Fn(&mut Vec<Message<'static>>)) -> Vec<u8> {
    let bytes: &'static [u8] = closed().leak();
    let messages = mcap::MessageStream::new(bytes).expect("an MCAP file");
    let mut messages: Vec<_> = messages.map(|message| message.expect("a message")).collect();
    edit(&mut messages);
    let mut out = mcap::Writer::new(Cursor::new(Vec::new())).expect("writes");
    for message in &messages {
        out.write(message).expect("written");
    }
    out.finish().expect("closed");
    out.into_inner().into_inner()
}

fn place(messages: &[Message<'_>], topic: &str) -> usize {
    messages.iter().position(|message| message.channel.topic == topic).expect("a message")
}

#[test]
fn audit_does_not_depend_on_log_times_and_chunks() {
    let StoredAudit::AsWritten(found) = stored(&closed()) else { panic!("{:?}", stored(&closed())) };
    assert_eq!(RunAudit { sha256: String::new(), ..(*found).clone() }, audit());
    assert_eq!(found.sha256.len(), 64);
    let later = edited(|messages| messages.iter_mut().for_each(|message| message.log_time += 5));
    assert!(matches!(stored(&later), StoredAudit::AsWritten(_)), "log times are no times of samples");
}

#[test]
fn edited_file_has_no_valid_audit() {
    type Edit = fn(&mut Vec<Message<'static>>);
    let edits: [(&str, Edit); 8] = [
        ("a number of a sample", |messages| {
            let of = place(messages, "/swarm");
            let mut bytes = messages[of].data.to_vec();
            bytes[40] ^= 1;
            messages[of].data = Cow::Owned(bytes);
        }),
        ("a byte of the scenario", |messages| {
            let of = place(messages, "/scenario");
            let mut bytes = messages[of].data.to_vec();
            bytes[9] ^= 1;
            messages[of].data = Cow::Owned(bytes);
        }),
        ("a byte of the audit", |messages| {
            let of = place(messages, "/audit");
            let mut bytes = messages[of].data.to_vec();
            bytes[32] ^= 1;
            messages[of].data = Cow::Owned(bytes);
        }),
        ("an audit that cannot be read", |messages| {
            let of = place(messages, "/audit");
            messages[of].data = Cow::Owned(vec![0, 1, 0, 0]);
        }),
        ("a sample less", |messages| drop(messages.remove(place(messages, "/swarm")))),
        ("an event less", |messages| drop(messages.remove(place(messages, "/events")))),
        ("messages in another order", |messages| {
            let of = place(messages, "/events");
            let event = messages.remove(of);
            messages.insert(1, event);
        }),
        ("a message behind the audit", |messages| messages.push(messages[place(messages, "/swarm")].clone())),
    ];
    assert!(matches!(stored(&edited(|_| {})), StoredAudit::AsWritten(_)));
    for (what, edit) in edits {
        assert_eq!(stored(&edited(edit)), StoredAudit::Altered, "{what}");
    }
    assert_eq!(
        stored(&edited(|messages| messages.push(messages[place(messages, "/audit")].clone()))),
        StoredAudit::Altered
    );
}

#[test]
fn missing_and_truncated_audits_are_absent() {
    assert_eq!(stored(&edited(|messages| drop(messages.pop()))), StoredAudit::None);
    let bytes = closed();
    assert_eq!(stored(&bytes[..bytes.len() - 8]), StoredAudit::None);
}
