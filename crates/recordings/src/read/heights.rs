//! Columns whose names are those of heights and depths, as the third axis of positions.

use std::collections::{BTreeMap, BTreeSet};

use super::heading::{DEPTH, HEIGHT, Heading, POSITION, Role};

/// Columns of a table that are read because their names are those of heights or depths.
#[derive(Clone, Debug, Default)]
pub(super) struct Heights {
    named: BTreeSet<usize>,
    /// Those that count downwards.
    downward: BTreeSet<usize>,
}

impl Heights {
    /// Gives headings of heights and depths the role of the third axis of positions, whose first axis is `place`, where their
    /// vehicle has the other two axes and no third of its own. All others are dropped. `found` are the columns that the user
    /// names.
    pub(super) fn place(
        place: Role,
        header: &[String],
        found: &mut BTreeMap<(String, Role), usize>,
        headings: &mut Vec<(usize, Heading<'_>)>,
    ) -> Self {
        let (third, mut heights) = (place + 2, Self::default());
        // The user may call the third axis by either name; `z` means the numbers as they are.
        let [z, alt] = [POSITION + 2, HEIGHT].map(|role| found.remove(&(String::new(), role)));
        let given = if third == HEIGHT { alt.or(z) } else { z.or(alt) };
        found.extend(given.map(|column| ((String::new(), third), column)));
        if let Some(column) = alt.filter(|column| given == Some(*column)) {
            let is_depth = Heading::of(&header[column]).is_some_and(|heading| heading.role == DEPTH);
            heights.add(column, is_depth);
        }
        let all = headings.clone();
        let has = |vehicle: &str, role: Role| {
            all.iter().any(|(_, heading)| (heading.vehicle, heading.role) == (vehicle, role))
                || found.contains_key(&(vehicle.to_owned(), role))
        };
        let is_height = |role: Role| matches!(role, HEIGHT | DEPTH);
        headings.retain(|(_, Heading { vehicle, role, .. })| {
            let has = |axis: Role| has(vehicle, place + axis);
            !is_height(*role) || (has(0) && has(1) && (third == HEIGHT || !has(2)))
        });
        for (column, heading) in headings.iter_mut().filter(|(_, heading)| is_height(heading.role)) {
            heights.add(*column, heading.role == DEPTH);
            heading.role = third;
        }
        heights
    }

    fn add(&mut self, column: usize, is_depth: bool) {
        self.named.insert(column);
        self.downward.extend(is_depth.then_some(column));
    }

    /// Columns that count downwards.
    pub(super) fn downward(&self) -> impl Iterator<Item = usize> {
        self.downward.iter().copied()
    }

    /// Which of these columns are read as heights because of their names, and whether the sign is turned.
    pub(super) fn among(&self, columns: impl Iterator<Item = usize>) -> Vec<(usize, bool)> {
        let columns: BTreeSet<_> = columns.filter(|column| self.named.contains(column)).collect();
        columns.into_iter().map(|column| (column, self.downward.contains(&column))).collect()
    }
}
