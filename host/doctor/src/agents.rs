//! Checks of what wakes an isolated core all the same.
//!
//! Sources: `Documentation/admin-guide/lockup-watchdogs.rst`, `Documentation/admin-guide/sysctl/kernel.rst`
//! (`nmi_watchdog`, `watchdog_cpumask`, `timer_migration`), `Documentation/admin-guide/kernel-per-CPU-kthreads.rst` and
//! `Documentation/core-api/workqueue.rst` (`cpumask`).

use crate::check::{Check, Entry, Finding};
use crate::step::Step;
use crate::system::System;

/// Programs that read counters of every core, and so interrupt every core, by the names of their processes (15 letters at
/// most).
const AGENTS: [&str; 12] = [
    "netdata",
    "collectd",
    "telegraf",
    "node_exporter",
    "prometheus-node",
    "datadog-agent",
    "pmdalinux",
    "pmdaperfevent",
    "turbostat",
    "perf",
    "powertop",
    "sysdig",
];

/// The checks of this group.
pub(crate) fn checks(system: &System) -> Vec<Check> {
    vec![
        agents(system),
        watchdogs(system),
        timers(system),
        workqueues(system),
    ]
}

fn agents(system: &System) -> Check {
    let entry = Entry {
        id: "agents",
        name: "monitoring agents",
        cost: "an agent that reads the counters of every core interrupts the tick's core each time, for tens of \
               microseconds",
    };
    let finding = if system.processes.is_empty() {
        Finding::Unknown("the system does not list its processes".into())
    } else {
        let found = system.running(&AGENTS);
        if found.is_empty() {
            Finding::Met("none of the known ones".into())
        } else {
            let found = found.join(", ");
            let step = format!(
                "stop {found} while the loop runs, or configure it not to read the counters of single cores"
            );
            Finding::Lacking(found, vec![Step::ByHand(step)])
        }
    };
    entry.check("none", finding)
}

fn watchdogs(system: &System) -> Check {
    let entry = Entry {
        id: "watchdogs",
        name: "lockup watchdogs",
        cost: "the kernel's search for lockups interrupts the tick's core every few seconds, above every priority",
    };
    let core = system.core;
    let of = |file: &str| system.line(&format!("proc/sys/kernel/{file}"));
    let wanted = format!("nmi_watchdog 0, and core {core} not in watchdog_cpumask");
    let on = |value: Option<String>| value.is_some_and(|value| value != "0");
    let on_core = system
        .cores_in("proc/sys/kernel/watchdog_cpumask")
        .is_some_and(|cores| cores.contains(&core));
    // With all cores masked, no other core is left for the search.
    let nmi = on(of("nmi_watchdog")) && on_core;
    let soft = on(of("soft_watchdog")) && on(of("watchdog")) && on_core;
    let finding = if of("watchdog").is_none() && of("nmi_watchdog").is_none() {
        Finding::NotApplicable("the kernel has no lockup watchdogs".into())
    } else if nmi || soft {
        let which = match (nmi, soft) {
            (true, true) => "both watchdogs",
            (true, false) => "the NMI watchdog",
            _ => "the soft watchdog",
        };
        let line = match system.others_listed() {
            Some(others) => {
                format!("kernel.nmi_watchdog = 0\nkernel.watchdog_cpumask = {others}")
            }
            None => "kernel.watchdog = 0".into(),
        };
        Finding::Lacking(
            format!("{which} on core {core}"),
            vec![Step::sysctl(entry.id, &line)],
        )
    } else {
        Finding::Met(format!("none on core {core}"))
    };
    entry.check(wanted, finding)
}

fn timers(system: &System) -> Check {
    let entry = Entry {
        id: "timer-migration",
        name: "timer migration",
        cost: "timers of other programs stay on the tick's core and interrupt the tick",
    };
    let finding = match system.line("proc/sys/kernel/timer_migration") {
        None => Finding::NotApplicable("the kernel has no such setting".into()),
        Some(found) if found == "1" => Finding::Met(found),
        Some(found) => Finding::Lacking(
            found,
            vec![Step::sysctl(entry.id, "kernel.timer_migration = 1")],
        ),
    };
    entry.check("timer_migration of 1", finding)
}

fn workqueues(system: &System) -> Check {
    let entry = Entry {
        id: "workqueues",
        name: "work queues",
        cost: "deferred work of the kernel runs on the tick's core, for tens of microseconds at a time",
    };
    let file = "sys/devices/virtual/workqueue/cpumask";
    let core = system.core;
    let finding = match system.line(file) {
        None => Finding::Unknown("the system does not tell the cores of its work queues".into()),
        Some(found) => match mask_contains(&found, core) {
            None => Finding::Unknown(format!("{found:?}")),
            Some(false) => Finding::Met(format!("not on core {core}")),
            Some(true) => {
                let step = match mask(&system.others()) {
                    Some(mask) => Step::at_start(entry.id, &format!("echo {mask} > /{file}")),
                    None => Step::ByHand("give the machine two cores or more".into()),
                };
                Finding::Lacking(format!("on core {core} (mask {found})"), vec![step])
            }
        },
    };
    entry.check(format!("not on core {core}"), finding)
}

/// Whether a mask of the kernel (hexadecimal words of 32 cores, the last one first) contains `core`; `None` in another
/// format.
fn mask_contains(mask: &str, core: usize) -> Option<bool> {
    let words: Option<Vec<_>> = mask
        .split(',')
        .map(|word| u32::from_str_radix(word, 16).ok())
        .collect();
    let words = words?;
    let word = words.iter().rev().nth(core / 32).copied().unwrap_or(0);
    Some(word >> (core % 32) & 1 == 1)
}

/// The mask of these cores; `None` for no core.
fn mask(cores: &[usize]) -> Option<String> {
    let last = cores.iter().max()?;
    let mut words = vec![0_u32; last / 32 + 1];
    for core in cores {
        if let Some(word) = words.get_mut(core / 32) {
            *word |= 1 << (core % 32);
        }
    }
    let words: Vec<_> = words
        .iter()
        .rev()
        .map(|word| format!("{word:08x}"))
        .collect();
    Some(words.join(","))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mask_is_read_as_it_was_written() {
        for cores in [vec![0], vec![0, 1, 3], vec![31, 32, 70]] {
            let written = mask(&cores).expect("there is a core");
            for core in 0..100 {
                assert_eq!(
                    mask_contains(&written, core),
                    Some(cores.contains(&core)),
                    "{core}"
                );
            }
        }
        assert_eq!(mask(&[]), None);
        assert_eq!(mask_contains("f", 3), Some(true));
        assert_eq!(mask_contains("f", 64), Some(false));
        for other in ["", "g", "1,,1", "123456789"] {
            assert_eq!(mask_contains(other, 0), None, "{other}");
        }
    }
}
