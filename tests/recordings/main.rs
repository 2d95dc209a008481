//! Recordings of any origin read, written and exported.

#[path = "../support/recording.rs"]
mod recording;

mod any_bytes;
mod beside;
mod capture;
mod columns;
mod containers;
mod earth;
mod exports;
mod formats;
mod heights;
mod identity;
mod messages;
mod own;
mod own_channels;
mod parquet;
mod refusals;
mod ros;
mod told_apart;
mod vehicles;
