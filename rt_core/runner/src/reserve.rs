//! A core for the tick alone: threads of this process that start later keep off it.
//!
//! A thread inherits the cores of the one that starts it, so it is enough that the thread which sets up a run gives
//! one up before it starts any other. The tick's own thread then pins itself there. Other processes are kept away by
//! the kernel's parameters only (`isolcpus`).

use crate::cores::{CoreChoice, Cores};
use crate::schedule::pin;
use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};

/// While it is held, the calling thread and those that it starts leave one core to the tick.
#[derive(Debug)]
pub struct Reserved {
    core: CoreChoice,
    before: Option<CpuSet>,
}

impl Reserved {
    /// Settles on a core for `choice` on `machine` and gives it up, if the process has another. Where it has not, or
    /// the system refuses, nothing changes: pinning will say so.
    pub fn new(choice: CoreChoice, machine: &Cores) -> Self {
        Self::take(choice, machine).unwrap_or(Self {
            core: choice,
            before: None,
        })
    }

    fn take(choice: CoreChoice, machine: &Cores) -> Option<Self> {
        let before = sched_getaffinity(None).ok()?;
        // Only the system knows whether it gives a core that is outside the mask: this thread goes there and comes back.
        let core = pin(choice, machine).ok().flatten();
        let mut others = before;
        if let Some(core) = core {
            others.unset(core);
        }
        if others.count() == 0 {
            others = before;
        }
        // A system that gave the mask before gives it again.
        sched_setaffinity(None, &others).ok()?;
        Some(Self {
            core: CoreChoice::Id(core?),
            before: (others != before).then_some(before),
        })
    }

    /// The core to pin the tick to; the choice as it was where none was settled on.
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
            let machine = Cores::of_this_machine();
            let reserved = Reserved::new(CoreChoice::Last, &machine);
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
            let pinned = apart(move || pin(core, &machine));
            assert_eq!(pinned, Ok(Some(*last)), "the tick may go there");
            drop(reserved);
            assert_eq!(cores(), all);
        });
    }

    #[test]
    fn a_core_of_ones_choice_is_left_to_the_tick() {
        apart(|| {
            let all = cores();
            let [first, rest @ ..] = all.as_slice() else {
                return;
            };
            let reserved = Reserved::new(CoreChoice::Id(*first), &Cores::of_this_machine());
            assert_eq!(reserved.core(), CoreChoice::Id(*first));
            assert_eq!(apart(cores), if rest.is_empty() { &all } else { rest });
        });
    }

    #[test]
    fn an_isolated_core_is_the_tick_s_without_being_the_other_threads() {
        apart(|| {
            let [first, .., last] = cores()[..] else {
                return;
            };
            // Isolated, as far as this thread is concerned: it exists, and is outside the mask.
            assert!(core_affinity::set_for_current(core_affinity::CoreId {
                id: first
            }));
            let machine = Cores::new(vec![first, last], vec![last]);
            let reserved = Reserved::new(CoreChoice::Isolated, &machine);
            assert_eq!(reserved.core(), CoreChoice::Id(last));
            assert_eq!(apart(cores), [first], "other threads keep off it");
        });
    }

    #[test]
    fn what_cannot_be_reserved_changes_nothing() {
        for choice in [CoreChoice::Anywhere, CoreChoice::Id(usize::MAX)] {
            apart(move || {
                let all = cores();
                let reserved = Reserved::new(choice, &Cores::of_this_machine());
                assert_eq!(reserved.core(), choice);
                assert_eq!(cores(), all);
            });
        }
    }
}
