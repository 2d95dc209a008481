//! What draws flights.

use tautline_report::request::Pictures;

/// Draws with the adapter of this name, perhaps without snapshots. A build without the viewer draws nothing.
#[cfg(feature = "viewer")]
pub(super) fn pictures(adapter: &str, takes_snapshots: bool) -> Box<dyn Pictures> {
    Box::new(tautline_render::RunPictures::new(adapter).with_snapshots(takes_snapshots))
}

/// Draws with the adapter of this name, perhaps without snapshots. A build without the viewer draws nothing.
#[cfg(not(feature = "viewer"))]
pub(super) fn pictures(_adapter: &str, _takes_snapshots: bool) -> Box<dyn Pictures> {
    Box::new(())
}
