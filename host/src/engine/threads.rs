//! The threads of the host that share the work of a step: `host.threads`.
//!
//! The physics divides its work by its data and passes the parts to a team ([`physics::Team`]). Here the team is a pool
//! of threads that steal work from each other (crate `rayon-core`). Which thread does a part has no effect on a result.
//! A step allocates no memory for its parts.
//!
//! A step has a part every ten to a hundred microseconds, and waking a thread takes tens. The threads therefore stay
//! awake during a step ([`awake`]): a thread without work looks for parts, for half a millisecond at most, and yields its
//! core to any other thread. Between steps the threads sleep.
//!
//! An engine owns its threads, and its bodies share them. The threads inherit the processor mask of the thread that makes
//! them. Under the real clock the run has taken the tick's core from this mask before, so that no thread of the pool runs
//! there.

use physics::team::Work;
use physics::{Alone, Team};
use rayon_core::{ThreadPool, ThreadPoolBuilder, Yield, yield_now};
use std::cell::Cell;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// A thread that has found no part for this time sleeps until it is woken.
const PATIENCE: Duration = Duration::from_micros(500);

thread_local! {
    /// Whether this thread waits for a part that another thread does.
    static WAITS: Cell<bool> = const { Cell::new(false) };
}

/// The threads of an engine, and the team of its bodies. Inside of [`run`](Self::run) the threads share the work. Outside,
/// and by default, the caller's thread is alone. The threads end when the value is dropped.
#[derive(Debug, Default)]
pub struct Threads {
    /// `None` for the calling thread alone.
    pool: Option<ThreadPool>,
}

impl Threads {
    /// `count` threads. If the system gives fewer, the calling thread does all work, and every result is the same.
    pub fn new(count: usize) -> Self {
        let pool = ThreadPoolBuilder::new()
            .stack_size(runner::STACK)
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

/// Does `work`, a step, with the other threads of the present pool awake. Outside of a pool, this thread is alone.
pub fn awake<R: Send>(work: impl FnOnce() -> R + Send) -> R {
    if rayon_core::current_thread_index().is_none() {
        return work();
    }
    let others = rayon_core::current_num_threads() - 1;
    let done = Flag::default();
    let lead = || {
        let _done = done.when_dropped();
        work()
    };
    rayon_core::join(lead, || look_for_parts(others, &done)).0
}

/// Set once.
#[derive(Debug, Default)]
struct Flag(AtomicBool);

/// Sets a flag when dropped: at the end of a piece of work, even if the work panics.
struct WhenDropped<'a>(&'a Flag);

impl Flag {
    fn when_dropped(&self) -> WhenDropped<'_> {
        WhenDropped(self)
    }

    fn is_set(&self) -> bool {
        self.0.load(Ordering::Acquire)
    }
}

impl Drop for WhenDropped<'_> {
    fn drop(&mut self) {
        self.0.0.store(true, Ordering::Release);
    }
}

/// Does a part of the pool's work. Returns whether there was one.
fn do_part() -> bool {
    let found = yield_now() == Some(Yield::Executed);
    if !found {
        std::thread::yield_now();
    }
    found
}

/// Keeps `count` threads at work until `done`.
fn look_for_parts(count: usize, done: &Flag) {
    let look = || {
        let mut last = Instant::now();
        while !done.is_set() && last.elapsed() < PATIENCE {
            if do_part() {
                last = Instant::now();
            }
        }
    };
    // A thread that waits for a part may come here. It must return when that part is done.
    if WAITS.get() {
        return;
    }
    match count {
        0 => {}
        1 => look(),
        count => {
            rayon_core::join(look, || look_for_parts(count - 1, done));
        }
    }
}

impl Team for Threads {
    fn join(&self, one: &mut Work<'_>, other: &mut Work<'_>) {
        // Outside of its pool, `rayon_core` would start threads of its own.
        let pool = self.pool.as_ref();
        if pool.and_then(ThreadPool::current_thread_index).is_none() {
            return Alone.join(one, other);
        }
        let done = Flag::default();
        let one_and_wait = || {
            one();
            // `rayon_core` would soon sleep here. If no thread has taken the other piece, it is the next part.
            let outer = WAITS.replace(true);
            while !done.is_set() {
                do_part();
            }
            WAITS.set(outer);
        };
        rayon_core::join(one_and_wait, || {
            let _done = done.when_dropped();
            other();
        });
    }

    fn is_alone(&self) -> bool {
        self.pool.is_none()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::AtomicUsize;

    #[test]
    fn a_pool_does_both_pieces_once_inside_and_outside() {
        for count in [1, 2, 4] {
            let threads = Threads::new(count);
            let done = [const { AtomicUsize::new(0) }; 2];
            let both = || {
                let add = |at: usize| {
                    done[at].fetch_add(1, Ordering::Relaxed);
                };
                threads.join(&mut || add(0), &mut || add(1));
            };
            both();
            awake(both);
            threads.run(both);
            threads.run(|| awake(both));
            assert_eq!(done.each_ref().map(|n| n.load(Ordering::Relaxed)), [4, 4]);
        }
    }

    #[test]
    fn a_panic_on_another_thread_reaches_the_caller() {
        let threads = Threads::new(2);
        let failed = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
            threads.run(|| threads.join(&mut || (), &mut || panic!("on purpose")));
        }));
        assert!(failed.is_err());
        let failed = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
            threads.run(|| awake(|| panic!("on purpose")));
        }));
        assert!(failed.is_err());
        threads.run(|| awake(|| threads.join(&mut || (), &mut || ())));
    }

    /// The sum of the numbers up to `count`, by parts in parts.
    fn sum(team: &dyn Team, count: u64) -> u64 {
        if count < 2 {
            return count;
        }
        let (half, mut lower, mut upper) = (count / 2, 0, 0);
        team.join(&mut || lower = sum(team, half), &mut || {
            upper = sum(team, count - half);
        });
        lower + upper
    }

    /// Threads that wait for each other in parts within parts end, even with more threads than cores and one part for
    /// many threads.
    #[test]
    fn parts_within_parts_end_on_any_number_of_threads() {
        for count in [2, 3, 8, 33] {
            let threads = Threads::new(count);
            for parts in [1, 2, 1000] {
                for _ in 0..20 {
                    let found = threads.run(|| awake(|| sum(&threads, parts)));
                    assert_eq!(found, parts);
                }
            }
        }
    }
}
