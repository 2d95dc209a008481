//! Tests of reading, writing and exporting recordings.

mod recording;

mod ambiguous_messages;
mod axes;
mod capture;
mod channels;
mod clocks;
mod columns;
mod containers;
mod contract;
mod data_sets;
mod drones;
mod earth;
mod exports;
mod facts;
mod formats;
mod fuzz;
mod heights;
mod identity;
mod messages;
mod parquet;
mod planners;
mod refusals;
mod ros;
mod run_channels;
mod run_recording;
mod stored_audit;
mod ulog;
mod vehicles;
