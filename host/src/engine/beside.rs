//! Factors made beside the steps: on a thread of their own, or, in virtual time, at a fixed step.

use physics::{Real, Refresher};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread;

/// Time from the request for a new factor to its use in virtual time (s), about as long as a factor takes.
const TIME: f64 = 0.01;

/// Makes factors beside the steps. Each refresher that was begun comes back in the end, whether or not its factor was
/// made, unless the thread has ended.
pub(super) enum Beside<T> {
    /// At once. A factor is not taken before its step, so that a run repeats to the byte.
    AtAStep {
        /// The refresher that was begun, and the number of steps until it is taken.
        begun: Option<(u32, Box<Refresher<T>>)>,
        /// Steps in `TIME`.
        steps: u32,
    },
    /// By a thread, which ends when this value is dropped.
    Thread {
        /// The refreshers to work.
        to: Sender<Box<Refresher<T>>>,
        /// The refreshers that have been worked.
        from: Receiver<Box<Refresher<T>>>,
    },
}

impl<T: Real> Beside<T> {
    /// In virtual time, for steps of `h` seconds.
    pub(super) fn at_a_step(h: f64) -> Self {
        Self::AtAStep {
            begun: None,
            steps: (TIME / h).ceil() as u32,
        }
    }

    /// On a thread, for steps of `h` seconds. If the system gives no thread, as in virtual time.
    pub(super) fn thread(h: f64) -> Self {
        let (to, work) = channel::<Box<Refresher<T>>>();
        let (back, from) = channel();
        let worker = move || {
            for mut refresher in work {
                // A refresher that fails gives no new factor, and the old factor stays in use.
                let _ = refresher.work();
                if back.send(refresher).is_err() {
                    return;
                }
            }
        };
        match thread::Builder::new().name("factor".into()).spawn(worker) {
            Ok(_) => Self::Thread { to, from },
            Err(_) => Self::at_a_step(h),
        }
    }

    /// Begins a factor. Only one factor may be begun at a time.
    pub(super) fn begin(&mut self, mut refresher: Box<Refresher<T>>) {
        match self {
            Self::AtAStep { begun, steps } => {
                let _ = refresher.work();
                *begun = Some((*steps, refresher));
            }
            Self::Thread { to, .. } => {
                // If the thread has ended, the refresher is lost and the old factor stays in use.
                let _ = to.send(refresher);
            }
        }
    }

    /// The refresher that has finished since the last step, if any. Each is returned once.
    pub(super) fn done(&mut self) -> Option<Box<Refresher<T>>> {
        match self {
            Self::AtAStep { begun, .. } => match begun.take() {
                Some((0 | 1, refresher)) => Some(refresher),
                Some((steps, refresher)) => {
                    *begun = Some((steps - 1, refresher));
                    None
                }
                None => None,
            },
            Self::Thread { from, .. } => from.try_recv().ok(),
        }
    }
}
