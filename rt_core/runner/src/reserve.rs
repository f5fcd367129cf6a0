//! A core for the tick alone: threads of this process that start later do not use the core.
//!
//! A thread inherits the cores of the thread that starts it. The thread that sets up a run therefore gives up one core
//! before it starts any other thread. The tick's own thread then pins itself to that core. Only the kernel's parameters
//! (`isolcpus`) keep other processes away.
//!
//! The threads of the devices inherit their cores in the same way: they start while a [`Confined`] lives.

use crate::cores::{CoreChoice, Cores, list};
use crate::degradation::Degradation;
use crate::schedule::{DEVICE_PRIORITY, pin};
use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};

/// While this value lives, the calling thread and the threads that it starts leave one core to the tick.
#[derive(Debug)]
pub struct Reserved {
    core: CoreChoice,
    before: Option<CpuSet>,
}

impl Reserved {
    /// Chooses a core for `choice` on `machine`, and gives up that core if the process has another. `idle_sibling`: also
    /// gives up the siblings of that core, if the process has a core beside them. If the process has only one core, or
    /// if the system refuses, nothing changes: pinning will report the failure.
    pub fn new(choice: CoreChoice, idle_sibling: bool, machine: &Cores) -> Self {
        Self::take(choice, idle_sibling, machine).unwrap_or(Self {
            core: choice,
            before: None,
        })
    }

    fn take(choice: CoreChoice, idle_sibling: bool, machine: &Cores) -> Option<Self> {
        let before = sched_getaffinity(None).ok()?;
        // Only the system knows whether it gives a core outside the mask. This thread therefore moves to the core, and
        // comes back.
        let core = pin(choice, machine).ok().flatten();
        let siblings = core.filter(|_| idle_sibling);
        let siblings: Vec<_> =
            siblings.map_or_else(Vec::new, |core| machine.siblings(core).collect());
        let without = |cores: &[usize]| {
            let mut others = before;
            for &core in cores {
                others.unset(core);
            }
            (others.count() > 0).then_some(others)
        };
        let own: Vec<_> = core.into_iter().collect();
        let others = without(&[&own[..], &siblings].concat()).or_else(|| without(&own));
        let others = others.unwrap_or(before);
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

/// Where the threads of the devices run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ThreadPlace {
    /// Their cores; empty: those of the other threads of the program.
    pub cores: Vec<usize>,
    /// Their priority under SCHED_FIFO (1 to 99).
    pub priority: u8,
}

impl ThreadPlace {
    /// Confines the calling thread to the cores, if there are any: the threads that it starts inherit them.
    ///
    /// # Errors
    /// As [`Confined::to`].
    pub fn confine(&self) -> Result<Option<Confined>, Degradation> {
        let confined = (!self.cores.is_empty()).then(|| Confined::to(&self.cores));
        confined.transpose()
    }
}

impl Default for ThreadPlace {
    /// With the other threads, above them.
    fn default() -> Self {
        Self {
            cores: Vec::new(),
            priority: DEVICE_PRIORITY,
        }
    }
}

/// While this value lives, the calling thread runs on some of its cores only, and so do the threads and processes that it
/// starts, for as long as these live.
#[derive(Debug)]
pub struct Confined {
    before: CpuSet,
}

impl Confined {
    /// Confines the calling thread to `cores`.
    ///
    /// # Errors
    /// A [`Degradation`] if the system does not give these cores. The thread then keeps the cores that it has.
    pub fn to(cores: &[usize]) -> Result<Self, Degradation> {
        let confine = || {
            let before = sched_getaffinity(None)?;
            let mut set = CpuSet::new();
            let known = cores.iter().filter(|core| **core < CpuSet::MAX_CPU);
            known.for_each(|core| set.set(*core));
            sched_setaffinity(None, &set)?;
            Ok(Self { before })
        };
        confine().map_err(|error: rustix::io::Errno| Degradation {
            missing: format!(
                "the threads of the devices are not confined to core {}",
                list(cores)
            ),
            reason: error.to_string(),
            cost: "other threads of the program may delay the exchange with a device",
            remedy: "in `device_threads.cores`, name cores that this process may use".into(),
        })
    }
}

impl Drop for Confined {
    /// Gives the thread its cores back.
    fn drop(&mut self) {
        // A system that gave the mask before gives it again.
        let _ = sched_setaffinity(None, &self.before);
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
            let reserved = Reserved::new(CoreChoice::Last, true, &machine);
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
    fn the_siblings_of_the_tick_s_core_stay_idle_if_the_others_have_a_core_left() {
        apart(|| {
            let all = cores();
            let [first, rest @ ..] = all.as_slice() else {
                return;
            };
            let [sibling, others @ ..] = rest else {
                return;
            };
            let machine =
                Cores::new(all.clone(), vec![]).with_siblings(vec![vec![*first, *sibling]]);
            for (idle, left) in [(true, others), (false, rest)] {
                let reserved = Reserved::new(CoreChoice::Id(*first), idle, &machine);
                assert_eq!(reserved.core(), CoreChoice::Id(*first));
                assert_eq!(apart(cores), if left.is_empty() { rest } else { left });
            }
            // All cores of the process are siblings: only the tick's own is given up.
            let machine = Cores::new(all.clone(), vec![]).with_siblings(vec![all.clone()]);
            let _reserved = Reserved::new(CoreChoice::Id(*first), true, &machine);
            assert_eq!(apart(cores), rest);
        });
    }

    #[test]
    fn threads_that_start_while_a_thread_is_confined_stay_on_those_cores() {
        apart(|| {
            let all = cores();
            let confined = Confined::to(&all[..1]).expect("a core of this process");
            assert_eq!(apart(cores), all[..1]);
            drop(confined);
            assert_eq!(cores(), all);
            for none in [&[1023][..], &[usize::MAX]] {
                let refused = Confined::to(none).expect_err("no such core");
                assert!(refused.to_string().contains("device_threads.cores"));
                assert_eq!(cores(), all, "the thread keeps its cores");
            }
        });
    }

    #[test]
    fn a_chosen_core_is_left_to_the_tick() {
        apart(|| {
            let all = cores();
            let [first, rest @ ..] = all.as_slice() else {
                return;
            };
            let reserved = Reserved::new(CoreChoice::Id(*first), false, &Cores::of_this_machine());
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
            let reserved = Reserved::new(CoreChoice::Isolated, true, &machine);
            assert_eq!(reserved.core(), CoreChoice::Id(last));
            assert_eq!(apart(cores), [first], "other threads keep off it");
        });
    }

    #[test]
    fn a_choice_that_cannot_be_reserved_changes_nothing() {
        for choice in [CoreChoice::Anywhere, CoreChoice::Id(usize::MAX)] {
            apart(move || {
                let all = cores();
                let reserved = Reserved::new(choice, true, &Cores::of_this_machine());
                assert_eq!(reserved.core(), choice);
                assert_eq!(cores(), all);
            });
        }
    }
}
