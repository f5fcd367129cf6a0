//! The models of a log that no tick has taken into use yet.
//!
//! A log has each model before the ticks that used it. A tick takes the newest model of its body, so the models of the
//! body before that one are never used. What waits is therefore short, and a bound keeps it short in a damaged log, too.

use std::collections::BTreeMap;

/// Most models of a body that wait. The ring of a body's models holds five seconds of them; at the fastest rate of
/// publication that is common, 1 kHz, these are three times as many.
const MOST: usize = 1 << 14;

/// Values by body and number of the model.
#[derive(Debug)]
pub(super) struct Waiting<T>(BTreeMap<usize, BTreeMap<u64, T>>);

impl<T> Default for Waiting<T> {
    fn default() -> Self {
        Self(BTreeMap::new())
    }
}

impl<T> Waiting<T> {
    /// Takes a model that a tick begins to use; `None` if the log lacks it. The models before it are dropped.
    pub(super) fn take(&mut self, (body, sequence): (usize, u64)) -> Option<T> {
        let models = self.0.get_mut(&body)?;
        let later = models.split_off(&sequence);
        *models = later;
        models.remove(&sequence)
    }

    /// Drops the oldest models of a body that has more than wait in a sound log.
    pub(super) fn bound(&mut self) {
        for models in self.0.values_mut() {
            while models.len() > MOST {
                models.pop_first();
            }
        }
    }
}

impl<T> Extend<((usize, u64), T)> for Waiting<T> {
    fn extend<I: IntoIterator<Item = ((usize, u64), T)>>(&mut self, models: I) {
        for ((body, sequence), model) in models {
            self.0.entry(body).or_default().insert(sequence, model);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_model_is_taken_once_and_the_ones_before_it_are_dropped() {
        let mut waiting = Waiting::default();
        waiting.extend((1..5).map(|sequence| ((0, sequence), sequence)));
        waiting.extend([((1, 2), 20)]);
        assert_eq!(waiting.take((0, 3)), Some(3));
        assert_eq!(waiting.take((0, 3)), None);
        assert_eq!(waiting.take((0, 2)), None);
        assert_eq!(waiting.take((1, 2)), Some(20), "of another body");
        assert_eq!(waiting.take((0, 4)), Some(4));
        assert_eq!(waiting.take((0, 5)), None);
    }

    /// However many models nobody uses, the newest ones wait.
    #[test]
    fn what_waits_is_bounded() {
        let mut waiting = Waiting::default();
        let all = 3 * MOST as u64;
        waiting.extend((0..all).map(|sequence| ((0, sequence), ())));
        waiting.bound();
        assert_eq!(waiting.0[&0].len(), MOST);
        assert!(waiting.take((0, all - MOST as u64)).is_some());
        assert!(waiting.take((0, all - 1)).is_some());
        assert!(waiting.0[&0].is_empty());
    }
}
