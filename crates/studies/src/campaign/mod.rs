//! Campaigns: many flights in shards, on one or several machines, merged into one answer with intervals.
//!
//! A [`Spec`] is the user's file. A [`Campaign`] is the resolved specification; it makes the flight of a run from the
//! run's number only. A [`Folder`] holds the manifest and a part for each finished shard; each file is complete or
//! absent. A merge writes a table with a row for each flight, and a [`Summary`]. Their bytes are the same for any
//! number of shards, threads, machines and interruptions.

mod document;
mod flights;
mod folder;
mod raise;
mod replay;
mod request;
mod shard;
mod spec;
mod summary;
mod tally;
mod vary;

pub use flights::{Campaign, Law, MOST_RUNS};
pub use folder::{ANSWER, Folder, LoadLaw, Manifest, Program, RESULTS, listed, parse};
pub use replay::{ReplayRequest, WorstFlight, replay};
pub use request::{CampaignRequest, MOST_WORST, campaign, fly_shards, merge, missing_shards, report};
pub use shard::{PartState, Row, Shard};
pub use spec::{Method, Spec, Stop};
pub use summary::{LawSummary, Pair, Quantiles, Summary, ViolatedRun, Worst};
pub use tally::{Bin, BinShares, BoundKind, Intervals, Tally, UpperBound, Varied};
pub use vary::{Grid, Variation};
