//! Background work: on a thread of its own, or, in virtual time, taken at a fixed step.

use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::thread;

/// Work that takes longer than a step.
pub(super) trait Work: Send + 'static {
    /// Name of the thread that does such work.
    const THREAD: &'static str;

    /// Time from the beginning of the work to the use of its result in virtual time (s): about as long as the work
    /// takes on a thread.
    const TIME: f64;

    /// Does the work. The value then contains the result, or the reason why there is none.
    fn work(&mut self);
}

/// The thread has ended, and the work that was begun is lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the thread for work beside the steps has ended")]
pub(super) struct Lost;

/// A message to the thread.
pub(super) enum Message<W> {
    /// Work to do and to send back.
    Do(W),
    /// A value to drop. To free its memory may take as long as a step.
    Drop(W),
}

/// Does one piece of work at a time. Each piece that was begun comes back in the end, unless the thread has ended.
pub(super) enum Background<W> {
    /// At once. The result is not taken before its step, so that a run repeats to the byte.
    AtAStep {
        /// The work that was begun, and the number of steps until it is taken.
        begun: Option<(u32, W)>,
        /// Steps in [`Work::TIME`].
        steps: u32,
    },
    /// By a thread, which ends when this value is dropped.
    Thread {
        /// Work to do.
        to: Sender<Message<W>>,
        /// Work that has been done.
        from: Receiver<W>,
    },
}

impl<W: Work> Background<W> {
    /// Under the real clock on a thread, in virtual time at a step. The steps take `h` seconds.
    pub(super) fn new(real: bool, h: f64) -> Self {
        if real {
            Self::thread(h)
        } else {
            Self::at_a_step(h)
        }
    }

    fn at_a_step(h: f64) -> Self {
        Self::AtAStep {
            begun: None,
            steps: (W::TIME / h).ceil() as u32,
        }
    }

    /// On a thread. If the system gives no thread, as in virtual time.
    fn thread(h: f64) -> Self {
        let (to, messages) = channel::<Message<W>>();
        let (back, from) = channel();
        let worker = move || {
            for message in messages {
                match message {
                    Message::Do(mut work) => {
                        work.work();
                        if back.send(work).is_err() {
                            return;
                        }
                    }
                    Message::Drop(spent) => drop(spent),
                }
            }
        };
        match thread::Builder::new()
            .stack_size(runner::STACK)
            .name(W::THREAD.into())
            .spawn(worker)
        {
            Ok(_) => Self::Thread { to, from },
            Err(_) => Self::at_a_step(h),
        }
    }

    /// Begins a piece of work. Only one piece may be begun at a time.
    pub(super) fn begin(&mut self, mut work: W) {
        match self {
            Self::AtAStep { begun, steps } => {
                work.work();
                *begun = Some((*steps, work));
            }
            Self::Thread { to, .. } => {
                // If the thread has ended, the work is lost, and `done` says so.
                let _ = to.send(Message::Do(work));
            }
        }
    }

    /// Called once a step: the work that has been done since the last step, if any. Each piece is returned once. In virtual
    /// time the step counts as one that has taken the time of `passed` steps.
    ///
    /// # Errors
    /// [`Lost`].
    pub(super) fn done(&mut self, passed: u32) -> Result<Option<W>, Lost> {
        match self {
            Self::AtAStep { begun, .. } => Ok(match begun.take() {
                Some((steps, work)) if steps <= passed => Some(work),
                Some((steps, work)) => {
                    *begun = Some((steps - passed, work));
                    None
                }
                None => None,
            }),
            Self::Thread { from, .. } => match from.try_recv() {
                Ok(work) => Ok(Some(work)),
                Err(TryRecvError::Empty) => Ok(None),
                Err(TryRecvError::Disconnected) => Err(Lost),
            },
        }
    }

    /// Drops a value, on the thread if there is one.
    pub(super) fn drop(&mut self, spent: W) {
        if let Self::Thread { to, .. } = self {
            // If the thread has ended, the message is dropped here.
            let _ = to.send(Message::Drop(spent));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Counts the calls of `work` and panics in the third.
    struct Count(u32);

    impl Work for Count {
        const THREAD: &'static str = "count";
        const TIME: f64 = 0.01;

        fn work(&mut self) {
            self.0 += 1;
            assert!(self.0 < 3, "a panic on purpose");
        }
    }

    #[test]
    fn in_virtual_time_work_lands_at_its_step() {
        let mut background = Background::new(false, 4e-3);
        assert!(background.done(1).unwrap().is_none());
        background.begin(Count(0));
        let landed: Vec<bool> = (0..5)
            .map(|_| background.done(1).unwrap().is_some())
            .collect();
        // 10 ms are two and a half steps, rounded up.
        assert_eq!(landed, [false, false, true, false, false]);
        // A step that takes the time of two.
        background.begin(Count(0));
        let landed = [1, 2, 1].map(|passed| background.done(passed).unwrap().is_some());
        assert_eq!(landed, [false, true, false]);
    }

    fn wait(background: &mut Background<Count>) -> Result<Count, Lost> {
        loop {
            if let Some(work) = background.done(1)? {
                return Ok(work);
            }
            thread::yield_now();
        }
    }

    #[test]
    fn a_thread_gives_each_piece_back_once_and_a_panic_is_noticed() {
        let mut background = Background::new(true, 4e-3);
        background.begin(Count(0));
        let work = wait(&mut background).unwrap();
        assert_eq!(work.0, 1);
        assert!(background.done(1).unwrap().is_none());
        background.drop(work);
        background.begin(Count(2));
        assert_eq!(wait(&mut background).err(), Some(Lost));
    }
}
