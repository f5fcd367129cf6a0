//! When and where the tick runs: its core, its priority, and a processor that does not doze off.
//!
//! Each function asks the system once, before the first tick, from the thread that it is for, and checks
//! what came of it. What is refused comes back as a [`Degradation`]; the run goes on.

use crate::degradation::Degradation;
use core_affinity::CoreId;
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::num::NonZeroU64;
use thread_priority::{
    RealtimeThreadSchedulePolicy, ThreadPriority, ThreadPriorityValue, ThreadSchedulePolicy,
    set_thread_priority_and_policy, thread_native_id, thread_schedule_policy_param,
};

/// Priority of the tick under SCHED_FIFO, unless told otherwise: above threaded interrupts (50), below
/// the kernel's own watchdogs (99).
pub const DEFAULT_PRIORITY: u8 = 80;

/// The longest processor mask that is dealt with.
const MOST_CORES: usize = 1024;

/// Which core the tick is pinned to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CoreChoice {
    /// The last of those that the process may use, if there are at least two.
    #[default]
    Last,
    /// This one, also when it is outside the process's present mask (an isolated core is).
    Id(usize),
    /// None: the tick goes where the system puts it.
    Anywhere,
}

/// Pins the calling thread; returns the core, or `None` where no pinning was asked for.
///
/// # Errors
/// A [`Degradation`] where the thread does not run on that core alone.
pub fn pin(choice: CoreChoice) -> Result<Option<usize>, Degradation> {
    let allowed = core_affinity::get_core_ids().unwrap_or_default();
    let core = match choice {
        CoreChoice::Anywhere => return Ok(None),
        CoreChoice::Id(core) => core,
        CoreChoice::Last => match allowed.as_slice() {
            [_, .., last] => last.id,
            _ => return Err(not_pinned("this process may use one core only".into())),
        },
    };
    // The list of cores shows the present mask only, so a core outside it is tried all the same, and the
    // mask read back tells whether it worked.
    let pinned = core < MOST_CORES
        && core_affinity::set_for_current(CoreId { id: core })
        && core_affinity::get_core_ids().is_some_and(|mask| mask == [CoreId { id: core }]);
    if pinned {
        Ok(Some(core))
    } else {
        Err(not_pinned(format!("the system did not give core {core}")))
    }
}

fn not_pinned(why: String) -> Degradation {
    Degradation {
        what: "the tick is not pinned to a core of its own".into(),
        why,
        cost: "it shares or changes cores, which costs tens of microseconds at times",
        remedy:
            "give the process two cores or more, and name one that exists (best an isolated one)"
                .into(),
    }
}

/// Gives the calling thread timers at full resolution: ordinary threads are woken up to 50 us late on
/// purpose. Needs no privilege, and changes nothing under SCHED_FIFO.
pub fn sharpen_timers() {
    // Refused only by systems without such a delay.
    let _ = rustix::thread::set_current_timer_slack(NonZeroU64::new(1));
}

/// Puts the calling thread under SCHED_FIFO with `priority` (1 to 99).
///
/// # Errors
/// A [`Degradation`] where the thread stays under the ordinary scheduler.
pub fn realtime(priority: u8) -> Result<(), Degradation> {
    let policy = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
    let asked = ThreadPriorityValue::try_from(priority)
        .map_err(|_| format!("priority {priority} is not between 1 and 99"))
        .and_then(|value| {
            let thread = thread_native_id();
            set_thread_priority_and_policy(thread, ThreadPriority::Crossplatform(value), policy)
                .and_then(|()| thread_schedule_policy_param(thread))
                .map_err(|error| error.to_string())
        });
    let why = match asked {
        Ok((obtained, _)) if obtained == policy => return Ok(()),
        Ok((obtained, _)) => format!("the system says {obtained:?}"),
        Err(why) => why,
    };
    Err(Degradation {
        what: format!("the tick has no realtime priority (SCHED_FIFO {priority})"),
        why,
        cost: "any busy program may delay it by milliseconds",
        remedy: format!(
            "allow it with `rtprio {priority}` in /etc/security/limits.d, LimitRTPRIO={priority} in the \
             service, or CAP_SYS_NICE"
        ),
    })
}

/// Keeps the processor out of its deeper sleep states for as long as it is held.
#[derive(Debug)]
pub struct KeepAwake {
    /// The kernel drops the request when this is closed.
    _request: File,
}

impl KeepAwake {
    /// Where the kernel takes the request.
    const PATH: &str = "/dev/cpu_dma_latency";

    /// Asks for a wake-up latency of zero.
    ///
    /// # Errors
    /// A [`Degradation`] where the system does not allow or know it.
    pub fn hold() -> Result<Self, Degradation> {
        let ask = || {
            let mut request = OpenOptions::new().write(true).open(Self::PATH)?;
            request.write_all(&0_i32.to_ne_bytes())?;
            Ok(request)
        };
        ask()
            .map(|request| Self { _request: request })
            .map_err(|error: std::io::Error| Degradation {
                what: "the processor may sleep between ticks".into(),
                why: format!("{}: {error}", Self::PATH),
                cost: "waking from a deep sleep state costs up to some hundred microseconds",
                remedy: format!(
                    "give the account write access to {} (a udev rule)",
                    Self::PATH
                ),
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// In a thread of its own: the mask belongs to the thread.
    fn pin_elsewhere(choice: CoreChoice) -> Result<Option<usize>, Degradation> {
        std::thread::spawn(move || pin(choice))
            .join()
            .expect("pinning does not panic")
    }

    #[test]
    fn the_last_allowed_core_is_taken_where_there_is_a_choice() {
        let allowed = core_affinity::get_core_ids().unwrap_or_default();
        match pin_elsewhere(CoreChoice::Last) {
            Ok(core) => {
                assert!(allowed.len() > 1);
                assert_eq!(core, allowed.last().map(|core| core.id));
            }
            Err(degradation) => {
                assert!(allowed.len() < 2, "{degradation}");
            }
        }
    }

    #[test]
    fn a_core_that_does_not_exist_is_a_degradation_and_not_a_panic() {
        for core in [1023, 1024, usize::MAX] {
            let degradation = pin_elsewhere(CoreChoice::Id(core)).expect_err("no such core");
            assert!(
                degradation.to_string().contains(&core.to_string()),
                "{degradation}"
            );
        }
        assert_eq!(pin_elsewhere(CoreChoice::Anywhere), Ok(None));
    }

    #[test]
    fn a_priority_out_of_range_is_refused_with_a_remedy() {
        let degradation = std::thread::spawn(|| realtime(200))
            .join()
            .expect("does not panic");
        let line = degradation.expect_err("200 is no priority").to_string();
        assert!(
            line.contains("SCHED_FIFO 200") && line.contains("rtprio"),
            "{line}"
        );
        assert!(!line.contains('\n'), "{line}");
    }
}
