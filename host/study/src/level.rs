//! The extent of a study.

use serde::Serialize;

/// The extent of a study.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Level {
    /// The corners of the study, in seconds: the extent for tests.
    Quick,
    /// The whole study, in minutes: the extent for the figures in the book.
    Full,
}

impl Level {
    /// `quick` or `full`, by the level.
    pub(crate) fn choose<T>(self, quick: T, full: T) -> T {
        match self {
            Self::Quick => quick,
            Self::Full => full,
        }
    }

    /// The first `quick` entries of `all` at the quick level, otherwise all.
    pub(crate) fn take<T>(self, all: &[T], quick: usize) -> &[T] {
        self.choose(all.get(..quick).unwrap_or(all), all)
    }

    /// The first and the last of `full` at the quick level, otherwise all.
    pub(crate) fn ends<T: Copy>(self, full: &[T]) -> Vec<T> {
        match (self, full) {
            (Self::Quick, [first, .., last]) => vec![*first, *last],
            _ => full.to_vec(),
        }
    }
}
