//! Recordings of any origin read, written and exported.

mod recording;

mod any_bytes;
mod axes;
mod beside;
mod capture;
mod clocks;
mod columns;
mod containers;
mod doors;
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
mod stored_audit;
mod told_apart;
mod ulog;
mod vehicles;
