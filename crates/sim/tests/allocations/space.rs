//! A search allocates no memory once its lists have grown.

use stats_alloc::Region;
use tautline_laws::formation::Formation;
use tautline_laws::space::CellList;

use crate::ALLOCATOR;

pub(crate) fn a_search_of_near_pairs_that_has_grown_allocates_nothing() {
    let positions_m = Formation::sphere(500, 10.0).slots_m;
    let mut near = CellList::default();
    near.update(&positions_m, 3.0);
    let region = Region::new(ALLOCATOR);
    for range_m in [3.0, 2.0, 1.8] {
        near.update(&positions_m, range_m);
    }
    let change = region.change();
    assert_eq!(change.allocations + change.reallocations, 0, "{change:?}");
    assert!(!near.pairs().is_empty());
}
