//! Geometry in space: search of near pairs, scaled lengths and distances from obstacles.
//!
//! - [`CellList`] finds all near pairs of a table.
//! - [`VerletList`] reuses them while points move little.
//! - [`closest_pair`] finds the nearest pair.
//! - [`SpacedPoints`] accepts points one by one that keep a minimum distance.
//! - [`signed_distance_m`] gives the distance of a point from a solid.
//! - [`Metric`] scales lengths so that keep-out ellipsoids become balls.
//!
//! The auditor in `audit` uses none of this, so a defect here cannot hide a violation.

mod distance;
mod metric;
mod near;
mod spaced;

pub use distance::{clearance_margin_m, signed_distance_m, smallest_clearance_margin};
pub use metric::Metric;
pub(crate) use near::NearLists;
pub use near::{CellList, VerletList};
pub use spaced::{SpacedPoints, closest_pair};
