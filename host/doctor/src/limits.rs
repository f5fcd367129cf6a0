//! Checks of what the system grants to this account and to its control group.
//!
//! Sources: `proc_pid_limits(5)`, `capabilities(7)`, `Documentation/scheduler/sched-rt-group.rst` (realtime budgets) and
//! `Documentation/admin-guide/cgroup-v2.rst`, `Documentation/scheduler/sched-bwc.rst` (quotas).

use crate::check::{Check, Entry, Finding};
use crate::step::Step;
use crate::system::System;
use runner::schedule::{COST_OF_NO_PRIORITY, GROUP_FOLDERS, Group};
use runner::setup::COST_OF_UNLOCKED_MEMORY;
use std::path::Path;

/// Numbers of `linux/capability.h`.
const CAP_IPC_LOCK: u32 = 14;
const CAP_SYS_NICE: u32 = 23;

/// The checks of this group.
pub(crate) fn checks(system: &System) -> Vec<Check> {
    vec![
        priority(system),
        memory(system),
        budget(system),
        quota(system),
    ]
}

/// The soft limit of this process with this name in `/proc/self/limits`; the greatest number for none.
fn limit(system: &System, name: &str) -> Option<u64> {
    let text = system.text("proc/self/limits")?;
    let rest = text.lines().find_map(|line| line.strip_prefix(name))?;
    match rest.split_whitespace().next()? {
        "unlimited" => Some(u64::MAX),
        number => number.parse().ok(),
    }
}

fn priority(system: &System) -> Check {
    let entry = Entry {
        id: "rtprio",
        name: "realtime priority",
        cost: COST_OF_NO_PRIORITY,
    };
    let wanted = system.priority;
    let finding = match (
        system.capable(CAP_SYS_NICE),
        limit(system, "Max realtime priority"),
    ) {
        (Some(true), _) => Finding::Met("CAP_SYS_NICE".into()),
        (_, Some(found)) if found >= u64::from(wanted) => {
            Finding::Met(format!("a limit of {found}"))
        }
        (_, Some(found)) => Finding::Lacking(
            format!("a limit of {found}"),
            Step::limit(entry.id, &format!("rtprio {wanted}")),
        ),
        (_, None) => Finding::Unknown("the system does not tell the limits of this process".into()),
    };
    entry.check(format!("a limit of {wanted} or more (rtprio)"), finding)
}

fn memory(system: &System) -> Check {
    let entry = Entry {
        id: "memlock",
        name: "locked memory",
        cost: COST_OF_UNLOCKED_MEMORY,
    };
    let finding = match (
        system.capable(CAP_IPC_LOCK),
        limit(system, "Max locked memory"),
    ) {
        (Some(true), _) => Finding::Met("CAP_IPC_LOCK".into()),
        (_, Some(u64::MAX)) => Finding::Met("no limit".into()),
        (_, Some(found)) => Finding::Lacking(
            format!("a limit of {found} bytes"),
            Step::limit(entry.id, "memlock unlimited"),
        ),
        (_, None) => Finding::Unknown("the system does not tell the limits of this process".into()),
    };
    entry.check("no limit (memlock)", finding)
}

fn budget(system: &System) -> Check {
    let entry = Entry {
        id: "rt-budget",
        name: "realtime budget",
        cost: COST_OF_NO_PRIORITY,
    };
    let Group { name, runtime } = Group::below(system.root());
    let finding = match runtime {
        None => {
            Finding::NotApplicable("the kernel has no realtime budgets of control groups".into())
        }
        Some(found) => match found.parse::<i64>() {
            Ok(0) => Finding::Lacking(
                format!("0 us in the group {name}"),
                vec![Step::ByHand(format!(
                    "write a time (us) into cpu.rt_runtime_us of the control group {name} and of the groups above it, or \
                     start the program in the root group"
                ))],
            ),
            Ok(found) => Finding::Met(format!("{found} us in the group {name}")),
            Err(_) => Finding::Unknown(format!("{found:?} in the group {name}")),
        },
    };
    entry.check("a time in cpu.rt_runtime_us", finding)
}

fn quota(system: &System) -> Check {
    let entry = Entry {
        id: "cpu-quota",
        name: "processor quota",
        cost: "when the quota is used up, the threads of host and log stand still for the rest of the period, tens of \
               milliseconds",
    };
    let group = Group::below(system.root()).name;
    let finding = if system.text("proc/self/cgroup").is_none() {
        Finding::Unknown("the system does not tell the control group of this process".into())
    } else {
        let mut quotas = Path::new(&group).ancestors().filter_map(|group| {
            let group = group.to_str()?.trim_end_matches('/');
            let quota = quota_of(system, group)?;
            Some((group.to_owned(), quota))
        });
        match quotas.next() {
            None => Finding::Met("none".into()),
            Some((group, quota)) => Finding::Lacking(
                format!("{quota} in the group {group}"),
                vec![Step::ByHand(format!(
                    "take the quota off the group {group} (CPUQuota= of its unit, or the limit of the container)"
                ))],
            ),
        }
    };
    entry.check("none", finding)
}

/// The quota of a control group, in words; `None` without one.
fn quota_of(system: &System, group: &str) -> Option<String> {
    GROUP_FOLDERS.into_iter().find_map(|folder| {
        let folder = format!("sys/fs/cgroup/{folder}{group}");
        let second = system.line(&format!("{folder}/cpu.max"));
        let second = second.and_then(|text| {
            let (quota, period) = text.split_once(' ')?;
            (quota != "max").then(|| format!("{quota} us of {period} us"))
        });
        second.or_else(|| {
            let quota: i64 = system.number(&format!("{folder}/cpu.cfs_quota_us"))?;
            let period = system
                .line(&format!("{folder}/cpu.cfs_period_us"))
                .unwrap_or_default();
            (quota >= 0).then(|| format!("{quota} us of {period} us"))
        })
    })
}
