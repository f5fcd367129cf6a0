//! Checks of the power management of the tick's core.
//!
//! Sources: `Documentation/admin-guide/pm/cpufreq.rst`, `cpuidle.rst`, and `Documentation/power/pm_qos_interface.rst`
//! (`/dev/cpu_dma_latency`).

use crate::check::{Check, Entry, Finding};
use crate::step::{GROUP, Step};
use crate::system::System;
use runner::schedule::{COST_OF_SLEEP, WAKE_LATENCY};
use rustix::fs::{Access, access};

/// The checks of this group.
pub(crate) fn checks(system: &System) -> Vec<Check> {
    vec![governor(system), sleep(system)]
}

fn governor(system: &System) -> Check {
    let entry = Entry {
        id: "governor",
        name: "governor",
        cost: "the core runs slowly when the tick wakes, and the tick takes several times as long",
    };
    let file = format!(
        "sys/devices/system/cpu/cpu{}/cpufreq/scaling_governor",
        system.core
    );
    let finding = match system.line(&file) {
        Some(found) if found == "performance" => Finding::Met(found),
        Some(found) => Finding::Lacking(
            found,
            vec![Step::at_start(
                entry.id,
                &format!("echo performance > /{file}"),
            )],
        ),
        None => {
            Finding::NotApplicable("the kernel does not scale the frequency of the core".into())
        }
    };
    entry.check(format!("performance on core {}", system.core), finding)
}

/// The time to wake that a sleep state may have (us).
const MOST_LATENCY: u64 = 5;

fn sleep(system: &System) -> Check {
    let entry = Entry {
        id: "sleep-states",
        name: "sleep states",
        cost: COST_OF_SLEEP,
    };
    let deep = deep_states(system);
    let request = system.path(WAKE_LATENCY.trim_start_matches('/'));
    let finding = match deep {
        None => Finding::NotApplicable("the kernel puts the core into no sleep states".into()),
        Some(deep) if deep.is_empty() => Finding::Met("no deep state is enabled".into()),
        Some(deep) => {
            let deep = deep.join(", ");
            if access(&request, Access::WRITE_OK).is_ok() {
                Finding::Met(format!("{deep}; a run keeps the core out of these"))
            } else {
                Finding::Lacking(
                    format!("{deep}; this account may not write to {WAKE_LATENCY}"),
                    vec![
                        Step::Group(GROUP),
                        Step::udev(
                            entry.id,
                            &format!(
                                "KERNEL==\"cpu_dma_latency\", GROUP=\"{GROUP}\", MODE=\"0660\""
                            ),
                        ),
                        Step::join_group(),
                    ],
                )
            }
        }
    };
    entry.check(
        format!(
            "no state that takes over {MOST_LATENCY} us to wake, or write access to {WAKE_LATENCY}"
        ),
        finding,
    )
}

/// The enabled states of the tick's core that take long to wake; `None` if the kernel lists no states.
fn deep_states(system: &System) -> Option<Vec<String>> {
    let folder = format!("sys/devices/system/cpu/cpu{}/cpuidle", system.core);
    let states = system.names(&folder);
    if states.is_empty() {
        return None;
    }
    let deep = states.iter().filter_map(|state| {
        let of = |file: &str| system.line(&format!("{folder}/{state}/{file}"));
        let latency: u64 = of("latency")?.parse().ok()?;
        let enabled = of("disable").is_none_or(|disabled| disabled == "0");
        let name = of("name").unwrap_or_else(|| state.clone());
        (enabled && latency > MOST_LATENCY).then(|| format!("{name} ({latency} us)"))
    });
    Some(deep.collect())
}
