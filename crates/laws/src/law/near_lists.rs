//! Near pairs as a list for each vehicle.

/// Who is near to each vehicle, in index order. Nothing is allocated once the lists have grown.
#[derive(Clone, Debug, Default)]
pub(super) struct NearLists {
    /// For each vehicle the end of its list in `others`.
    ends: Vec<usize>,
    others: Vec<usize>,
}

impl NearLists {
    /// The lists of these pairs i < j, which are in ascending order, of so many vehicles.
    pub(super) fn update(&mut self, count: usize, pairs: &[(usize, usize)]) {
        let Self { ends, others } = self;
        ends.clear();
        ends.resize(count + 1, 0);
        for &(i, j) in pairs {
            ends[i + 1] += 1;
            ends[j + 1] += 1;
        }
        for i in 0..count {
            ends[i + 1] += ends[i];
        }
        others.clear();
        others.resize(2 * pairs.len(), 0);
        for &(i, j) in pairs {
            for (of, other) in [(i, j), (j, i)] {
                others[ends[of]] = other;
                ends[of] += 1;
            }
        }
    }

    /// Who is near to vehicle `i`.
    pub(super) fn of(&self, i: usize) -> &[usize] {
        let start = if i == 0 { 0 } else { self.ends[i - 1] };
        &self.others[start..self.ends[i]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_vehicle_has_its_others_in_index_order() {
        let mut lists = NearLists::default();
        for (pairs, expected) in [
            (&[(0, 2), (0, 3), (1, 2), (2, 4)][..], [&[2, 3][..], &[2], &[0, 1, 4], &[0], &[2]]),
            (&[], [&[][..]; 5]),
            (&[(3, 4)], [&[], &[], &[], &[4], &[3]]),
        ] {
            lists.update(5, pairs);
            (0..5).for_each(|i| assert_eq!(lists.of(i), expected[i], "{pairs:?}"));
        }
    }
}
