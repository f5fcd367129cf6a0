//! Factors made beside the steps: on a thread of their own, or, in virtual time, at a fixed step.

use physics::{Real, Refresher};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread;

/// In virtual time a new factor is taken so long (s) after it was asked for, about as long as one takes.
const TIME: f64 = 0.01;

/// Where factors are made. Whatever has been begun comes back in the end, made or not.
pub(super) enum Beside<T> {
    /// At once, but not taken before its step: a run repeats to the byte.
    AtAStep {
        /// What was begun, and the steps until it is taken.
        begun: Option<(u32, Box<Refresher<T>>)>,
        /// Steps in `TIME`.
        steps: u32,
    },
    /// By a thread, which ends when this is dropped.
    Thread {
        /// What is to be worked.
        to: Sender<Box<Refresher<T>>>,
        /// What has been.
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

    /// On a thread; without one, as in virtual time.
    pub(super) fn thread(h: f64) -> Self {
        let (to, work) = channel::<Box<Refresher<T>>>();
        let (back, from) = channel();
        let worker = move || {
            for mut refresher in work {
                // One that fails has nothing to take: the old factor goes on.
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

    /// Begins a factor; one at a time.
    pub(super) fn begin(&mut self, mut refresher: Box<Refresher<T>>) {
        match self {
            Self::AtAStep { begun, steps } => {
                let _ = refresher.work();
                *begun = Some((*steps, refresher));
            }
            Self::Thread { to, .. } => {
                // A thread that has ended keeps it, and the old factor goes on.
                let _ = to.send(refresher);
            }
        }
    }

    /// What has been made since the last step, once.
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
