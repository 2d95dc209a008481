//! Tests of builds without some of the features: a file of a missing format is refused, with the name of the feature.

#![cfg(not(all(feature = "arrow", feature = "mcap", feature = "shows")))]

use std::fs;

use tautline_recordings::read::{self, ReadOptions};

/// Returns the error and the remedy of opening a file with these bytes.
fn refusal(name: &str, bytes: &[u8]) -> String {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join(name);
    fs::write(&path, bytes).expect("written");
    let error = read::open(&path, &ReadOptions::default()).err().expect("refused");
    assert_eq!(error.code(), "recording/unsupported-format");
    format!("{error}; {}", error.help())
}

#[cfg(not(feature = "arrow"))]
#[test]
fn parquet_needs_the_feature_arrow() {
    assert!(refusal("flight.parquet", b"PAR1....PAR1").contains("feature `arrow`"));
}

#[cfg(not(feature = "mcap"))]
#[test]
fn mcap_needs_the_feature_mcap() {
    assert!(refusal("flight.mcap", b"\x89MCAP0\r\n").contains("feature `mcap`"));
}

#[cfg(not(feature = "shows"))]
#[test]
fn shows_need_the_feature_shows() {
    assert!(refusal("show.json", b"{\"swarm\": {}}").contains("feature `shows`"));
    assert!(refusal("show.skyb", b"skyb\x01").contains("feature `shows`"));
}
