//! Many flights, one answer with an error bar: on one machine or on as many as see one folder.
//!
//! A [`Spec`] says what is flown; a [`Campaign`] is that with everything resolved, and makes the flight of any run from the
//! run's number alone. A [`Folder`] holds its manifest and the parts that shards leave, each whole or not at all; parts are
//! merged into one table of a row a flight and a [`Summary`]. The bytes of both are the same for any number of shards,
//! threads, machines and interruptions.

mod again;
mod bins;
mod error;
mod fly;
mod folder;
mod html;
mod manifest;
mod merge;
mod overlaps;
mod part;
mod place;
mod plan;
mod request;
mod result;
mod row;
mod shard;
mod spec;
mod table;
mod tally;
mod vary;
mod words;
mod worst;

pub use bins::{Bin, BinShares, Varied};
pub use error::{CampaignError, DamagedPart};
pub use folder::{Folder, listed, parse};
pub use html::{CampaignPage, WorstFlight};
pub use manifest::{Manifest, Program};
pub use merge::{ANSWER, Merged, RESULTS};
pub use part::Found;
pub use plan::{Campaign, Law, MOST_RUNS};
pub use request::{
    CampaignAnswer, CampaignRequest, MOST_WORST, ReplayRequest, campaign, fly_shards, merge, missing_shards, replay,
    report,
};
pub use result::{BadRun, LawSummary, Pair, Quantiles, SCHEMA_VERSION, Summary};
pub use row::{Known, Row};
pub use shard::Shard;
pub use spec::{Asked, Method, Spec, SplittingKeys, Stop};
pub use tally::{BoundKind, Intervals, Tally, UpperBound};
pub use vary::{Grid, Variation};
pub use worst::Worst;
