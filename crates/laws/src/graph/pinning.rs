//! Pinning: which vehicles know the reference.

/// Vehicles that know the reference, as in pinning control. With the Laplacian L of the links, the pinned Laplacian M
/// is
///
/// - M = L without a reference; the relevant eigenvalue is the second smallest, lambda2;
/// - M = L + B if all or some vehicles know it, where B is diagonal with a 1 for each of these vehicles;
/// - M = L without the leader's row and column (grounded Laplacian) if a leader flies it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Pinning {
    /// No vehicle: the mean of the swarm moves freely.
    #[default]
    Unpinned,
    /// Every vehicle.
    All,
    /// These vehicles, from 0, in ascending order.
    Listed(Vec<usize>),
    /// One vehicle, from 0, that flies the reference independent of all others. Its neighbours follow it.
    Leader(usize),
}

impl Pinning {
    /// Whether a vehicle is pulled to the reference by M. False for a leader.
    #[must_use]
    pub fn pins(&self, vehicle: usize) -> bool {
        match self {
            Self::Unpinned | Self::Leader(_) => false,
            Self::All => true,
            Self::Listed(listed) => listed.binary_search(&vehicle).is_ok(),
        }
    }

    /// Returns the leader, if there is one.
    #[must_use]
    pub fn leader(&self) -> Option<usize> {
        if let &Self::Leader(leader) = self { Some(leader) } else { None }
    }
}
