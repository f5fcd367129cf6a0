//! Threads for the independent parts of a study.

use std::num::NonZero;
use std::thread::{Builder, Scope, available_parallelism};

pub(crate) use runner::STACK;

/// The number of threads for `parts` parts: `asked`, or that of the cores.
pub(crate) fn count(asked: Option<NonZero<usize>>, parts: usize) -> usize {
    let threads = asked.or_else(|| available_parallelism().ok());
    threads.map_or(1, NonZero::get).min(parts)
}

/// Starts up to `count` threads of `stack` bytes. Each thread does the work that `work` gives. Returns how many the system gave;
/// without any, the calling thread has to do the work.
pub(crate) fn start<'scope, F: FnOnce() + Send + 'scope>(
    scope: &'scope Scope<'scope, '_>,
    count: usize,
    stack: usize,
    mut work: impl FnMut() -> F,
) -> usize {
    let started = (0..count).map_while(|_| {
        let thread = Builder::new().stack_size(stack);
        thread.spawn_scoped(scope, work()).ok()
    });
    started.count()
}
