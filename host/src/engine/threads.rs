//! The threads of the host that share the work of a step: `host.threads`.
//!
//! The physics divides its work by its data and passes the parts to a team ([`physics::Team`]). Here the team is a pool
//! of threads that steal work from each other (crate `rayon-core`). Which thread does a part has no effect on a result.
//! A step allocates no memory for its parts, and a thread without work sleeps.
//!
//! The threads inherit the processor mask of the thread that makes them. Under the real clock the run has taken the
//! tick's core from this mask before, so that no thread of the pool runs there.

use physics::team::Work;
use physics::{Alone, Team};
use rayon_core::{ThreadPool, ThreadPoolBuilder};

/// The threads of a run.
#[derive(Debug, Default)]
pub struct Threads {
    /// `None` for the calling thread alone.
    pool: Option<ThreadPool>,
}

impl Threads {
    /// `count` threads. If the system gives fewer, the calling thread does all work, and every result is the same.
    pub fn new(count: usize) -> Self {
        let pool = ThreadPoolBuilder::new()
            .num_threads(count)
            .thread_name(|index| format!("palpate-step-{index}"));
        Self {
            pool: (count > 1).then(|| pool.build().ok()).flatten(),
        }
    }

    /// Does `work` on one of the threads. The others take the parts that `work` gives to its team.
    pub fn run<R: Send>(&self, work: impl FnOnce() -> R + Send) -> R {
        match &self.pool {
            Some(pool) => pool.install(work),
            None => work(),
        }
    }
}

/// The team of the present thread's pool.
#[derive(Debug)]
struct Pool;

impl Team for Pool {
    fn join(&self, one: &mut Work<'_>, other: &mut Work<'_>) {
        // Outside of a pool, `rayon_core` would start threads of its own.
        if rayon_core::current_thread_index().is_some() {
            rayon_core::join(one, other);
        } else {
            Alone.join(one, other);
        }
    }
}

/// The team of `count` threads, inside and outside of [`Threads::run`].
pub(super) fn team(count: usize) -> &'static dyn Team {
    if count > 1 { &Pool } else { &Alone }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicUsize, Ordering};

    #[test]
    fn a_pool_does_both_pieces_once_inside_and_outside() {
        for count in [1, 2, 4] {
            let threads = Threads::new(count);
            let done = [const { AtomicUsize::new(0) }; 2];
            let both = || {
                let add = |at: usize| {
                    done[at].fetch_add(1, Ordering::Relaxed);
                };
                team(count).join(&mut || add(0), &mut || add(1));
            };
            both();
            threads.run(both);
            assert_eq!(done.each_ref().map(|n| n.load(Ordering::Relaxed)), [2, 2]);
        }
    }

    #[test]
    fn a_panic_on_another_thread_reaches_the_caller() {
        let threads = Threads::new(2);
        let failed = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
            threads.run(|| team(2).join(&mut || (), &mut || panic!("on purpose")));
        }));
        assert!(failed.is_err());
    }
}
