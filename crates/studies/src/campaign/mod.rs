//! Many flights, one answer with an error bar: on one machine or on as many as see one folder.
//!
//! A [`Spec`] says what is flown; a [`Campaign`] is that with everything resolved, and makes the flight of any run from the
//! run's number alone. A [`Folder`] holds its manifest and the parts that shards leave, each whole or not at all; parts are
//! merged into one table of a row a flight and a [`Summary`]. The bytes of both are the same for any number of shards,
//! threads, machines and interruptions.

mod bins;
mod document;
mod flights;
mod folder;
mod manifest;
mod replay;
mod request;
mod row;
mod shard;
mod spec;
mod summary;
mod tally;
mod vary;

pub use bins::{Bin, BinShares, Varied};
pub use flights::{Campaign, Law, MOST_RUNS};
pub use folder::{ANSWER, Folder, Merged, RESULTS, listed, parse};
pub use manifest::{Manifest, Program};
pub use replay::{ReplayRequest, WorstFlight, replay};
pub use request::{CampaignAnswer, CampaignRequest, MOST_WORST, campaign, fly_shards, merge, missing_shards, report};
pub use row::{Known, Row};
pub use shard::{Found, Shard};
pub use spec::{Method, Spec, Stop};
pub use summary::{BadRun, LawSummary, Pair, Quantiles, Summary, Worst};
pub use tally::{BoundKind, Intervals, Tally, UpperBound};
pub use vary::{Grid, Variation};
