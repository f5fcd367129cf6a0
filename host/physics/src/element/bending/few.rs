//! A list of a few values without an allocation, so that an edit can compute the derivatives across edges again.

use core::ops::Deref;

/// Most vertices near an edge: its ends, those across it, and those of two rings of triangles, 4 and 8.
pub(super) const MOST_NEAR: usize = 16;

/// At most [`MOST_NEAR`] values.
#[derive(Clone, Copy, Debug)]
pub(super) struct Few<T> {
    values: [T; MOST_NEAR],
    count: usize,
}

impl<T: Copy + Default> Default for Few<T> {
    fn default() -> Self {
        Self {
            values: [T::default(); MOST_NEAR],
            count: 0,
        }
    }
}

impl<T> Few<T> {
    /// Adds a value. No more than [`MOST_NEAR`] are kept.
    pub(super) fn push(&mut self, value: T) {
        if let Some(slot) = self.values.get_mut(self.count) {
            *slot = value;
            self.count += 1;
        }
    }
}

impl<T> Deref for Few<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        &self.values[..self.count]
    }
}

impl<T: Copy + Default> FromIterator<T> for Few<T> {
    fn from_iter<I: IntoIterator<Item = T>>(values: I) -> Self {
        let mut few = Self::default();
        for value in values {
            few.push(value);
        }
        few
    }
}
