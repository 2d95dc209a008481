//! The vehicles of a recording by name.

use std::collections::HashMap;

use super::error::Fault;
use super::identity::{alike, spelling};

/// Names in the order of their indices, and the way back.
#[derive(Clone, Debug, Default)]
pub(super) struct Names {
    in_order: Vec<String>,
    indices: HashMap<Box<str>, usize>,
    /// Indices by what names are but for their spelling.
    spellings: HashMap<String, usize>,
}

impl Names {
    /// Names in this order.
    ///
    /// # Errors
    /// Where two differ only in how they are spelled.
    pub(super) fn from_list(names: Vec<String>) -> Result<Self, Fault> {
        let mut all = Self::default();
        for name in names {
            all.add(name)?;
        }
        Ok(all)
    }

    /// `1`, `2`, ... up to `count`.
    pub(super) fn numbered(count: usize) -> Self {
        Self::ordered((1..=count).map(|number| number.to_string()).collect())
    }

    /// Names that are known to differ.
    fn ordered(names: Vec<String>) -> Self {
        let spellings = names.iter().enumerate().map(|(index, name)| (spelling(name), index)).collect();
        let indices = names.iter().enumerate().map(|(index, name)| (name.as_str().into(), index)).collect();
        Self { in_order: names, indices, spellings }
    }

    /// Adds a name and gives its index.
    fn add(&mut self, name: String) -> Result<usize, Fault> {
        let index = self.in_order.len();
        if let Some(&first) = self.spellings.get(&spelling(&name)) {
            return Err(alike(&self.in_order[first], &name));
        }
        self.spellings.insert(spelling(&name), index);
        self.indices.insert(name.as_str().into(), index);
        self.in_order.push(name);
        Ok(index)
    }

    pub(super) fn all(&self) -> &[String] {
        &self.in_order
    }

    /// The index of a name, which is new if need be. Looked for first right after the vehicle before, or at the first
    /// after the last: most files go round.
    ///
    /// # Errors
    /// Where a new name differs from another only in how it is spelled.
    #[inline]
    pub(super) fn index(&mut self, name: &str, before: usize) -> Result<usize, Fault> {
        let next = if before + 1 < self.in_order.len() { before + 1 } else { 0 };
        if self.in_order.get(next).is_some_and(|known| known == name) {
            return Ok(next);
        }
        if let Some(&index) = self.indices.get(name) {
            return Ok(index);
        }
        self.add(name.to_owned())
    }

    /// Puts the names in order of value where all are numbers. Indices given before lose their meaning.
    pub(super) fn settle(&mut self) {
        let numbers: Option<Vec<u64>> = self.in_order.iter().map(|name| name.parse().ok()).collect();
        let Some(numbers) = numbers else { return };
        let mut order: Vec<usize> = (0..self.in_order.len()).collect();
        order.sort_by_key(|&index| numbers[index]);
        *self = Self::ordered(order.iter().map(|&index| self.in_order[index].clone()).collect());
    }
}
