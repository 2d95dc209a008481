//! Who knows where a swarm shall go.

/// Who knows a reference: the pinned vehicles of pinning control. With the Laplacian L of the links, what they and those who
/// hear of it feel is the pinned Laplacian M:
///
/// - nobody: M = L, and its least eigenvalue that counts is the second, lambda2;
/// - all, or some: M = L + B, where B has a 1 on the diagonal for each who knows;
/// - a leader: L without the leader's row and column, grounded there.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Pinning {
    /// Nobody: the swarm goes where its mean goes.
    #[default]
    Nobody,
    /// Every vehicle.
    All,
    /// These vehicles, from 0, in ascending order.
    Listed(Vec<usize>),
    /// One vehicle, from 0, that flies the reference and listens to nobody; those who hear it follow.
    Leader(usize),
}

impl Pinning {
    /// Whether a vehicle is drawn to the reference itself. A leader is on it.
    #[must_use]
    pub fn pins(&self, vehicle: usize) -> bool {
        match self {
            Self::Nobody | Self::Leader(_) => false,
            Self::All => true,
            Self::Listed(listed) => listed.binary_search(&vehicle).is_ok(),
        }
    }

    /// The vehicle that listens to nobody.
    #[must_use]
    pub fn leader(&self) -> Option<usize> {
        if let &Self::Leader(leader) = self { Some(leader) } else { None }
    }
}
