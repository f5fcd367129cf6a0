//! The logs of a series as one log: the parts of a run that `palpate serve` wrote into file after file.

use super::{Recorded, ReplayError, Seer};
use crate::log::index::LogIndex;
use rt_core::Capabilities;
use std::collections::BTreeMap;
use std::io::{Read, Seek};

/// Logs of one run, in their order. The first one tells the scene, the facts and the limits.
pub struct Chain<R>(LogIndex<R>, Vec<LogIndex<R>>);

impl<R: Read + Seek> Chain<R> {
    /// The log `first`, and the logs that continue it.
    pub fn new(first: LogIndex<R>, later: Vec<LogIndex<R>>) -> Self {
        Self(first, later)
    }
}

impl<R: Read + Seek> Recorded for &mut Chain<R> {
    fn facts(&self) -> &BTreeMap<String, String> {
        self.0.facts()
    }

    fn limits(&self) -> &[Capabilities] {
        self.0.limits()
    }

    fn scene(&self) -> (&str, &BTreeMap<String, Vec<u8>>) {
        (self.0.scene(), self.0.files())
    }

    fn is_complete(&self) -> bool {
        self.1.last().unwrap_or(&self.0).is_complete()
    }

    fn parts(&self) -> usize {
        let later: usize = self.1.iter().map(LogIndex::chunk_count).sum();
        self.0.chunk_count() + later
    }

    fn part(&mut self, number: usize, see: &mut Seer<'_>) -> Result<(), ReplayError> {
        let mut number = number;
        let Chain(first, later) = &mut **self;
        for mut log in std::iter::once(first).chain(later) {
            let Some(beyond) = number.checked_sub(log.chunk_count()) else {
                return Recorded::part(&mut log, number, see);
            };
            number = beyond;
        }
        Ok(())
    }
}
