//! The vehicles of a recording by name.

use std::collections::HashMap;

/// Names in the order of their indices, and the way back.
#[derive(Clone, Debug, Default)]
pub(super) struct Names {
    names: Vec<String>,
    indices: HashMap<Box<str>, usize>,
}

impl Names {
    pub(super) fn from_list(names: Vec<String>) -> Self {
        let indices = names.iter().enumerate().map(|(index, name)| (name.as_str().into(), index)).collect();
        Self { names, indices }
    }

    /// `1`, `2`, ... up to `count`.
    pub(super) fn numbered(count: usize) -> Self {
        Self::from_list((1..=count).map(|number| number.to_string()).collect())
    }

    pub(super) fn all(&self) -> &[String] {
        &self.names
    }

    /// The index of a name, which is new if need be. Looked for first right after the vehicle before, or at the first
    /// after the last: most files go round.
    #[inline]
    pub(super) fn index(&mut self, name: &str, before: usize) -> usize {
        let next = if before + 1 < self.names.len() { before + 1 } else { 0 };
        if self.names.get(next).is_some_and(|known| known == name) {
            return next;
        }
        if let Some(&index) = self.indices.get(name) {
            return index;
        }
        let index = self.names.len();
        self.names.push(name.to_owned());
        self.indices.insert(name.into(), index);
        index
    }

    /// Puts the names in order of value where all are numbers. Indices given before lose their meaning.
    pub(super) fn settle(&mut self) {
        let numbers: Option<Vec<u64>> = self.names.iter().map(|name| name.parse().ok()).collect();
        let Some(numbers) = numbers else { return };
        let mut order: Vec<usize> = (0..self.names.len()).collect();
        order.sort_by_key(|&index| numbers[index]);
        *self = Self::from_list(order.iter().map(|&index| self.names[index].clone()).collect());
    }
}
