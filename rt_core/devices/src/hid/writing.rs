//! What the writing thread of a device does next, as a state machine: no thread, no clock and no ring.
//!
//! The driver of the machine tells it the time, whether the tick has lost the device, and the newest command of the tick,
//! and does what the [`Step`] says. A lost device is looked for at once, and then every [`RETRY_NS`]. Commands from before
//! the loss are not sent to the device that is back.

use crate::exchange::RETRY_NS;

/// What is to be done now.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step<T> {
    /// Write this command.
    Write(T),
    /// Wait until the tick asks for something, but at most until this time (ns) if there is one.
    Wait(Option<u64>),
    /// Close both ends of the device, try once to open it again, and tell [`Writing::reopened`].
    Reopen,
}

/// The state machine. Times are of one clock (ns), with any origin.
#[derive(Clone, Copy, Debug, Default)]
pub struct Writing {
    /// The next attempt to open a lost device (ns); `None` before the first attempt.
    retry_ns: Option<u64>,
}

impl Writing {
    /// What is to be done at `now_ns`. `newest` is the newest command since the call before.
    pub fn next<T>(&self, now_ns: u64, lost: bool, newest: Option<T>) -> Step<T> {
        if !lost {
            return newest.map_or(Step::Wait(None), Step::Write);
        }
        match self.retry_ns {
            Some(retry_ns) if now_ns < retry_ns => Step::Wait(Some(retry_ns)),
            _ => Step::Reopen,
        }
    }

    /// Ends the attempt that [`next`](Self::next) asked for.
    pub fn reopened(&mut self, now_ns: u64, is_open: bool) {
        self.retry_ns = (!is_open).then(|| now_ns.saturating_add(RETRY_NS));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lost_device_is_looked_for_at_once_and_then_at_intervals() {
        let mut writing = Writing::default();
        assert_eq!(writing.next(5, false, None::<u32>), Step::Wait(None));
        assert_eq!(writing.next(5, false, Some(1)), Step::Write(1));
        // The command is from before the loss.
        assert_eq!(writing.next(6, true, Some(2)), Step::Reopen);
        writing.reopened(7, false);
        let retry_ns = 7 + RETRY_NS;
        let wait = Step::Wait(Some(retry_ns));
        assert_eq!(writing.next(8, true, Some(3)), wait);
        assert_eq!(writing.next(retry_ns - 1, true, None), wait);
        assert_eq!(writing.next(retry_ns, true, None::<u32>), Step::Reopen);
        writing.reopened(retry_ns + 1, true);
        assert_eq!(writing.next(retry_ns + 2, false, Some(4)), Step::Write(4));
        // The next loss is another one.
        assert_eq!(writing.next(retry_ns + 3, true, None::<u32>), Step::Reopen);
    }
}
