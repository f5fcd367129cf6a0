//! A core for the tick alone: threads of this process that start later do not use the core.
//!
//! A thread inherits the cores of the thread that starts it. The thread that sets up a run therefore gives up one core
//! before it starts any other thread. The tick's own thread then pins itself to that core. Only the kernel's parameters
//! (`isolcpus`) keep other processes away.

use crate::cores::{CoreChoice, Cores};
use crate::schedule::pin;
use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};

/// While this value lives, the calling thread and the threads that it starts leave one core to the tick.
#[derive(Debug)]
pub struct Reserved {
    core: CoreChoice,
    before: Option<CpuSet>,
}

impl Reserved {
    /// Chooses a core for `choice` on `machine`, and gives up that core if the process has another. If the process has
    /// only one core, or if the system refuses, nothing changes: pinning will report the failure.
    pub fn new(choice: CoreChoice, machine: &Cores) -> Self {
        Self::take(choice, machine).unwrap_or(Self {
            core: choice,
            before: None,
        })
    }

    fn take(choice: CoreChoice, machine: &Cores) -> Option<Self> {
        let before = sched_getaffinity(None).ok()?;
        // Only the system knows whether it gives a core outside the mask. This thread therefore moves to the core, and
        // comes back.
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

    /// The core to pin the tick to, or the original choice if no core could be chosen.
    pub fn core(&self) -> CoreChoice {
        self.core
    }
}

impl Drop for Reserved {
    /// Gives the thread all its cores back.
    fn drop(&mut self) {
        if let Some(before) = &self.before {
            // A system that gave the mask before gives it again. If the system refuses, one core less does no harm.
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

    /// Runs `f` in a thread of its own, because the mask belongs to the thread.
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
    fn a_chosen_core_is_left_to_the_tick() {
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
            // To this thread, the core looks isolated: it exists and lies outside the mask.
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
    fn a_choice_that_cannot_be_reserved_changes_nothing() {
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
