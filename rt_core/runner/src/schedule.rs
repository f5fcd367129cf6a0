//! The core and the priority of the tick, and a request that keeps the processor awake.
//!
//! Each function asks the system once, before the first tick, from the thread concerned, and checks the outcome. A
//! function returns a refusal as a [`Degradation`], and the run continues.

use crate::cores::{self, CoreChoice, Cores};
use crate::degradation::Degradation;
use core_affinity::CoreId;
use rustix::thread::{CapabilitySet, CpuSet, Pid, capabilities, sched_setaffinity};
use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::num::NonZeroU64;
use std::path::Path;
use thread_priority::{
    RealtimeThreadSchedulePolicy, ThreadPriority, ThreadPriorityValue, ThreadSchedulePolicy,
    set_thread_priority_and_policy, thread_native_id, thread_schedule_policy_param,
};

/// Default priority of the tick under SCHED_FIFO: above threaded interrupts (50), below the kernel's own watchdogs
/// (99).
pub const DEFAULT_PRIORITY: u8 = 80;

/// Default priority of a device's thread under SCHED_FIFO: above ordinary threads, below threaded interrupts (50).
pub const DEVICE_PRIORITY: u8 = 45;

/// File through which the kernel takes a limit of the wake-up latency (us, as 32 bits). The limit holds while the file
/// is open.
pub const WAKE_LATENCY: &str = "/dev/cpu_dma_latency";

/// The cost of a tick without a core of its own.
pub const COST_OF_A_SHARED_CORE: &str =
    "the tick may share or change its core, which at times costs tens of microseconds";

/// The cost of a tick without realtime priority.
pub const COST_OF_NO_PRIORITY: &str = "any busy program may delay the tick by milliseconds";

/// The cost of a processor that sleeps deeply.
pub const COST_OF_SLEEP: &str =
    "waking from a deep sleep state costs up to some hundred microseconds";

/// Length of the longest processor mask that this module supports.
const MOST_CORES: usize = 1024;

/// Pins the calling thread to the best core of `choice` that the system gives (on `machine`). Returns the core, or
/// `None` if no pinning was asked for. If the system refuses every core, the thread keeps its cores.
///
/// # Errors
/// A [`Degradation`] if the thread does not run on that core alone, or if the process's other threads have no
/// other core.
pub fn pin(choice: CoreChoice, machine: &Cores) -> Result<Option<usize>, Degradation> {
    if choice == CoreChoice::Anywhere {
        return Ok(None);
    }
    let allowed = mask();
    let mut candidates = machine.candidates(choice, &allowed);
    // The only core of the process is not the tick's own: the other threads run there, too.
    candidates.retain(|&core| allowed != [core]);
    if candidates.is_empty() {
        return Err(not_pinned("this process may use one core only".into()));
    }
    // An isolated core lies outside the mask. A core is therefore tried whether or not it is in the mask. The mask,
    // read back afterwards, tells whether the system agreed.
    let given = candidates
        .iter()
        .find(|&&core| try_core(core) && mask() == [core]);
    match given {
        Some(core) => Ok(Some(*core)),
        None => Err(not_pinned(format!(
            "the system did not give core {}",
            cores::list(&candidates)
        ))),
    }
}

/// The cores that the calling thread may use, ascending.
pub fn mask() -> Vec<usize> {
    let cores = core_affinity::get_core_ids().unwrap_or_default();
    cores.iter().map(|core| core.id).collect()
}

/// Asks for `core` alone. Returns whether the system agreed.
fn try_core(core: usize) -> bool {
    core < MOST_CORES && core_affinity::set_for_current(CoreId { id: core })
}

/// Moves a thread of this process to `cores`.
///
/// # Errors
/// The system refuses.
pub fn move_thread(thread: i32, cores: &[usize]) -> io::Result<()> {
    let mut set = CpuSet::new();
    for &core in cores.iter().filter(|core| **core < CpuSet::MAX_CPU) {
        set.set(core);
    }
    Ok(sched_setaffinity(Pid::from_raw(thread), &set)?)
}

fn not_pinned(reason: String) -> Degradation {
    Degradation {
        missing: "the tick is not pinned to a core of its own".into(),
        reason,
        cost: COST_OF_A_SHARED_CORE,
        remedy:
            "give the process two cores or more, or isolate a core; with --core, name a core that exists"
                .into(),
    }
}

/// Gives the calling thread timers at full resolution: the kernel deliberately wakes ordinary threads up to 50 us late.
/// The call needs no privilege, and has no effect under SCHED_FIFO.
pub(crate) fn sharpen_timers() {
    // Only systems without such a delay refuse.
    let _ = rustix::thread::set_current_timer_slack(NonZeroU64::new(1));
}

/// Puts the calling thread under SCHED_FIFO with `priority` (1 to 99). Returns the priority that the system then
/// reports.
///
/// # Errors
/// A [`Degradation`] if the thread does not get the priority.
pub fn realtime(priority: u8) -> Result<u8, Degradation> {
    let policy = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
    let asked = ThreadPriorityValue::try_from(priority)
        .map_err(|_| format!("priority {priority} is not between 1 and 99"))
        .and_then(|value| {
            let thread = thread_native_id();
            set_thread_priority_and_policy(thread, ThreadPriority::Crossplatform(value), policy)
                .and_then(|()| thread_schedule_policy_param(thread))
                .map_err(|error| match error {
                    // The system names its errors; the library has only their numbers.
                    thread_priority::Error::OS(number) => {
                        io::Error::from_raw_os_error(number).to_string()
                    }
                    error => error.to_string(),
                })
        });
    let reason = match asked {
        Ok((obtained, parameters))
            if obtained == policy && parameters.sched_priority == i32::from(priority) =>
        {
            return Ok(priority);
        }
        Ok((obtained, parameters)) => {
            format!(
                "the system reports {obtained:?} {}",
                parameters.sched_priority
            )
        }
        Err(reason) => reason,
    };
    let may = capabilities(None).is_ok_and(|sets| sets.effective.contains(CapabilitySet::SYS_NICE));
    Err(Degradation {
        missing: format!("the tick has no realtime priority (SCHED_FIFO {priority})"),
        reason,
        cost: COST_OF_NO_PRIORITY,
        remedy: remedy(priority, may, &Group::below(Path::new("/"))),
    })
}

/// The remedy for a refused realtime `priority`. `may` tells whether the account has CAP_SYS_NICE.
fn remedy(priority: u8, may: bool, group: &Group) -> String {
    let Group { name, runtime } = group;
    if !(1..=99).contains(&priority) {
        return "give a priority from 1 to 99".into();
    }
    if !may {
        return format!(
            "allow this priority with `rtprio {priority}` in /etc/security/limits.d, LimitRTPRIO={priority} in the \
             service, or CAP_SYS_NICE"
        );
    }
    if runtime.as_deref() == Some("0") {
        return format!(
            "the account has CAP_SYS_NICE, but its control group {name} has no realtime time: cpu.rt_runtime_us is 0 \
             (CONFIG_RT_GROUP_SCHED); write a time (us) there and into the groups above it, or start the program in the \
             root group"
        );
    }
    format!(
        "the account has CAP_SYS_NICE, so something else refuses: its control group {name}, which with \
         CONFIG_RT_GROUP_SCHED needs a time in cpu.rt_runtime_us, or a container's filter of system calls; start the \
         program in the root group and outside of the container"
    )
}

/// The control group that gives this process its share of the processor's time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Group {
    /// Its path below the root group.
    pub name: String,
    /// Its realtime budget (us), if the kernel has such budgets.
    pub runtime: Option<String>,
}

/// The folders of `/sys/fs/cgroup` that may hold the groups of the processor's time: those of the first version, and the
/// only one of the second.
pub const GROUP_FOLDERS: [&str; 3] = ["cpu", "cpu,cpuacct", ""];

impl Group {
    /// The group of this process on the machine whose files are below `root`.
    pub fn below(root: &Path) -> Self {
        let groups = std::fs::read_to_string(root.join("proc/self/cgroup")).unwrap_or_default();
        let name = Self::name_in(&groups).unwrap_or("/").to_owned();
        let runtime = |folder: &str| {
            let path = format!("sys/fs/cgroup/{folder}{name}/cpu.rt_runtime_us");
            std::fs::read_to_string(root.join(path)).ok()
        };
        let runtime = GROUP_FOLDERS.into_iter().find_map(runtime);
        Self {
            runtime: runtime.map(|text| text.trim().to_owned()),
            name,
        }
    }

    /// The name of the group in the text of `/proc/self/cgroup`: lines of a number, the controllers and the path.
    fn name_in(groups: &str) -> Option<&str> {
        let lines = || {
            groups
                .lines()
                .filter_map(|line| line.split_once(':')?.1.split_once(':'))
        };
        let of_cpu = lines().find(|(controllers, _)| controllers.split(',').any(|c| c == "cpu"));
        // All controllers of the second version have one path.
        let path = of_cpu.or_else(|| lines().find(|(controllers, _)| controllers.is_empty()));
        path.map(|(_, path)| path)
    }
}

/// Keeps the processor out of its deeper sleep states while this value lives.
#[derive(Debug)]
pub struct KeepAwake {
    /// The kernel drops the request when this file is closed.
    _request: File,
}

impl KeepAwake {
    /// Asks for a wake-up latency of zero, at `path` ([`WAKE_LATENCY`], or a file in its place).
    ///
    /// # Errors
    /// A [`Degradation`] if the system does not allow or does not know the request.
    pub fn hold(path: &Path) -> Result<Self, Degradation> {
        let ask = || {
            let mut request = OpenOptions::new().write(true).open(path)?;
            request.write_all(&0_i32.to_ne_bytes())?;
            Ok(request)
        };
        ask()
            .map(|request| Self { _request: request })
            .map_err(|error: io::Error| Degradation {
                missing: "the processor may sleep between ticks".into(),
                reason: format!("{}: {error}", path.display()),
                cost: COST_OF_SLEEP,
                remedy: format!(
                    "give the account write access to {} (a udev rule)",
                    path.display()
                ),
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Runs `f` in a thread of its own, because the mask belongs to the thread.
    fn apart<T: Send + 'static>(f: impl FnOnce() -> T + Send + 'static) -> T {
        std::thread::spawn(f).join().expect("does not panic")
    }

    fn pin_elsewhere(choice: CoreChoice) -> Result<Option<usize>, Degradation> {
        apart(move || pin(choice, &Cores::of_this_machine()))
    }

    #[test]
    fn the_last_allowed_core_is_taken_where_there_is_a_choice() {
        let allowed = mask();
        match pin_elsewhere(CoreChoice::Last) {
            Ok(core) => {
                assert!(allowed.len() > 1);
                assert_eq!(core, allowed.last().copied());
            }
            Err(degradation) => {
                assert!(allowed.len() < 2, "{degradation}");
            }
        }
    }

    #[test]
    fn a_core_that_the_process_has_given_up_is_given_by_its_number() {
        // This is the effect of isolation on a process: the core exists and lies outside the mask.
        let [first, .., last] = mask()[..] else {
            return;
        };
        apart(move || {
            assert!(try_core(first));
            assert_eq!(mask(), [first]);
            assert_eq!(pin(CoreChoice::Id(last), &Cores::default()), Ok(Some(last)));
            assert_eq!(mask(), [last], "the mask read back is that core alone");
        });
        apart(move || {
            assert!(try_core(first));
            let machine = Cores::new(vec![first, last], vec![last]);
            assert_eq!(pin(CoreChoice::Isolated, &machine), Ok(Some(last)));
        });
    }

    #[test]
    fn an_isolated_core_that_the_system_does_not_give_leaves_the_next_choice() {
        let allowed = mask();
        let machine = Cores::new(vec![0, 1023], vec![1023]);
        let pinned = apart(move || pin(CoreChoice::Isolated, &machine));
        match allowed.as_slice() {
            [_, .., last] => assert_eq!(pinned, Ok(Some(*last))),
            _ => assert!(pinned.is_err()),
        }
    }

    #[test]
    fn the_only_core_of_a_process_is_not_the_tick_s_own() {
        let first = mask()[0];
        for choice in [
            CoreChoice::Id(first),
            CoreChoice::Last,
            CoreChoice::Isolated,
        ] {
            let pinned = apart(move || {
                assert!(try_core(first));
                pin(choice, &Cores::default())
            });
            let degradation = pinned.expect_err("the other threads are there, too");
            assert!(
                degradation.reason.contains("one core only"),
                "{degradation}"
            );
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
    fn timers_of_the_thread_are_sharp() {
        let slack = apart(|| {
            sharpen_timers();
            rustix::thread::current_timer_slack()
        });
        // A system without such a delay has no number.
        assert!(slack.is_err() || slack == Ok(1), "{slack:?}");
    }

    #[test]
    fn a_priority_that_is_granted_is_the_thread_s() {
        let (answer, found) = apart(|| {
            let answer = realtime(10);
            (answer, thread_schedule_policy_param(thread_native_id()))
        });
        let (policy, parameters) = found.expect("the system tells");
        let fifo = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
        match answer {
            Ok(priority) => {
                let found = (policy, parameters.sched_priority);
                assert_eq!((priority, found), (10, (fifo, 10)));
            }
            Err(degradation) => {
                assert_ne!(policy, fifo);
                let line = degradation.to_string();
                assert!(
                    line.contains("LimitRTPRIO=10") || line.contains("control group"),
                    "{line}"
                );
            }
        }
    }

    /// Root has every limit and CAP_SYS_NICE, so advice on them would lead astray.
    #[test]
    fn the_remedy_is_what_the_account_lacks() {
        let group = |runtime: Option<&str>| Group {
            name: "/p".into(),
            runtime: runtime.map(Into::into),
        };
        let line = remedy(10, false, &group(Some("0")));
        assert!(
            line.contains("LimitRTPRIO=10") && line.contains("or CAP_SYS_NICE"),
            "{line}"
        );
        let line = remedy(10, true, &group(Some("0")));
        assert!(
            line.contains("control group /p has no realtime time: cpu.rt_runtime_us is 0")
                && !line.contains("rtprio"),
            "{line}"
        );
        for runtime in [None, Some("950000")] {
            let line = remedy(10, true, &group(runtime));
            assert!(
                line.contains("control group /p, which with CONFIG_RT_GROUP_SCHED")
                    && !line.contains("rtprio"),
                "{line}"
            );
        }
    }

    #[test]
    fn the_group_is_that_of_the_processor() {
        for (groups, name) in [
            (
                "9:name=systemd:/a\n4:cpuacct,cpu:/p/q\n0::/b\n",
                Some("/p/q"),
            ),
            (
                "9:name=systemd:/a\n0::/user.slice/b\n",
                Some("/user.slice/b"),
            ),
            ("9:cpuset:/a\n", None),
            ("", None),
        ] {
            assert_eq!(Group::name_in(groups), name, "{groups:?}");
        }
    }

    #[test]
    fn a_priority_out_of_range_is_refused_with_a_remedy() {
        let degradation = std::thread::spawn(|| realtime(200))
            .join()
            .expect("does not panic");
        let line = degradation.expect_err("200 is no priority").to_string();
        assert!(
            line.contains("SCHED_FIFO 200") && line.contains("from 1 to 99"),
            "{line}"
        );
        assert!(!line.contains('\n'), "{line}");
    }
}
