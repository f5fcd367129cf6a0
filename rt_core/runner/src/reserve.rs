//! A core for the tick alone: threads of this process that start later keep off it.
//!
//! A thread inherits the cores of the one that starts it, so it is enough that the thread which sets up a run gives
//! one up before it starts any other. The tick's own thread then pins itself there. Other processes are kept away by
//! the kernel's parameters only (`isolcpus`).

use crate::schedule::CoreChoice;
use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};

/// While it is held, the calling thread and those that it starts leave one core to the tick.
#[derive(Debug)]
pub struct Reserved {
    core: CoreChoice,
    before: Option<CpuSet>,
}

impl Reserved {
    /// Settles on a core for `choice` and gives it up, if the process has another. Where it has not, or the system
    /// refuses, nothing changes: pinning will say so.
    pub fn new(choice: CoreChoice) -> Self {
        Self::take(choice).unwrap_or(Self {
            core: choice,
            before: None,
        })
    }

    fn take(choice: CoreChoice) -> Option<Self> {
        let before = sched_getaffinity(None).ok()?;
        let core = match choice {
            CoreChoice::Anywhere => return None,
            CoreChoice::Id(core) => core,
            CoreChoice::Last => (0..CpuSet::MAX_CPU).rfind(|&core| before.is_set(core))?,
        };
        let mut others = before;
        if core < CpuSet::MAX_CPU {
            others.unset(core);
        }
        if others.count() == 0 || others == before {
            return None;
        }
        sched_setaffinity(None, &others).ok()?;
        Some(Self {
            core: CoreChoice::Id(core),
            before: Some(before),
        })
    }

    /// The core to pin the tick to.
    pub fn core(&self) -> CoreChoice {
        self.core
    }
}

impl Drop for Reserved {
    /// The thread may use all its cores again.
    fn drop(&mut self) {
        if let Some(before) = &self.before {
            // A system that gave the mask before gives it again; if not, a core less is no harm.
            let _ = sched_setaffinity(None, before);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core_affinity::get_core_ids;

    fn cores() -> Vec<usize> {
        let cores = get_core_ids().unwrap_or_default();
        cores.iter().map(|core| core.id).collect()
    }

    /// In a thread of its own: the mask belongs to the thread.
    fn apart<T: Send + 'static>(f: impl FnOnce() -> T + Send + 'static) -> T {
        std::thread::spawn(f).join().expect("does not panic")
    }

    #[test]
    fn threads_started_later_leave_the_core_to_the_tick_until_the_run_is_over() {
        apart(|| {
            let all = cores();
            let reserved = Reserved::new(CoreChoice::Last);
            let [rest @ .., last] = all.as_slice() else {
                return;
            };
            if rest.is_empty() {
                assert_eq!(apart(cores), all, "the only core is not given up");
                return;
            }
            assert_eq!(reserved.core(), CoreChoice::Id(*last));
            assert_eq!(apart(cores), rest);
            let core = reserved.core();
            let pinned = apart(move || crate::schedule::pin(core));
            assert_eq!(pinned, Ok(Some(*last)), "the tick may go there");
            drop(reserved);
            assert_eq!(cores(), all);
        });
    }

    #[test]
    fn what_cannot_be_reserved_changes_nothing() {
        for choice in [CoreChoice::Anywhere, CoreChoice::Id(usize::MAX)] {
            apart(move || {
                let all = cores();
                let reserved = Reserved::new(choice);
                assert_eq!(reserved.core(), choice);
                assert_eq!(cores(), all);
            });
        }
    }
}
