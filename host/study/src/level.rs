//! How much of a study is done.

use serde::Serialize;

/// How much of a study is done.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Level {
    /// Its corners, in seconds: what the tests run.
    Quick,
    /// All that the book quotes, in minutes.
    Full,
}

impl Level {
    /// `quick` or `full`.
    pub(crate) fn choose<T>(self, quick: T, full: T) -> T {
        match self {
            Self::Quick => quick,
            Self::Full => full,
        }
    }

    /// The first `quick` of `all`, or all of them.
    pub(crate) fn take<T>(self, all: &[T], quick: usize) -> &[T] {
        self.choose(all.get(..quick).unwrap_or(all), all)
    }

    /// The first and the last of `full`, or all of them.
    pub(crate) fn ends<T: Copy>(self, full: &[T]) -> Vec<T> {
        match (self, full) {
            (Self::Quick, [first, .., last]) => vec![*first, *last],
            _ => full.to_vec(),
        }
    }
}
