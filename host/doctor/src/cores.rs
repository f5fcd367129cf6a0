//! Checks of the tick's core: what else the kernel lets run there.
//!
//! Sources: `Documentation/admin-guide/kernel-parameters.txt` (`isolcpus`, `nohz_full`, `rcu_nocbs`, `irqaffinity`),
//! `Documentation/timers/no_hz.rst`, `Documentation/core-api/irq/irq-affinity.rst`,
//! `Documentation/admin-guide/cputopology.rst`, and irqbalance(1).

use crate::check::{Check, Entry, Finding};
use crate::step::Step;
use crate::system::System;
use runner::cores::list;
use runner::schedule::COST_OF_A_SHARED_CORE;

/// The checks of this group.
pub(crate) fn checks(system: &System) -> Vec<Check> {
    vec![
        isolated(system),
        nohz_full(system),
        rcu_nocbs(system),
        interrupts(system),
        irqbalance(system),
        sibling(system),
    ]
}

/// The cores to name in the kernel's parameters. The kernel wants equal lists in `isolcpus` and `nohz_full`.
fn reserved(system: &System) -> String {
    let mut cores = system.cores.isolated.clone();
    cores.push(system.core);
    cores.sort_unstable();
    cores.dedup();
    list(&cores)
}

/// Steps that need other cores for the rest of the machine; `steps` takes the list of these.
fn with_another_core(system: &System, steps: impl FnOnce(&str) -> Vec<Step>) -> Vec<Step> {
    match system.others_listed() {
        Some(others) => steps(&others),
        None => vec![Step::ByHand(
            "give the machine two cores or more: a core can be reserved only where there is another"
                .into(),
        )],
    }
}

fn isolated(system: &System) -> Check {
    let entry = Entry {
        id: "isolated-core",
        name: "isolated core",
        cost: COST_OF_A_SHARED_CORE,
    };
    let core = system.core;
    // The second list is that of isolated partitions (`Documentation/admin-guide/cgroup-v2.rst`).
    let lists = [
        "sys/devices/system/cpu/isolated",
        "sys/fs/cgroup/cpuset.cpus.isolated",
    ]
    .map(|file| system.cores_in(file));
    let finding = if lists.iter().flatten().any(|list| list.contains(&core)) {
        Finding::Met(format!("core {core} is isolated"))
    } else {
        match &lists[0] {
            None => Finding::Unknown("the system does not list its isolated cores".into()),
            Some(isolated) => Finding::Lacking(
                if isolated.is_empty() {
                    "no core is isolated".into()
                } else {
                    format!("isolated are only {}", list(isolated))
                },
                with_another_core(system, |_| {
                    let value = format!("managed_irq,domain,{}", reserved(system));
                    vec![system.kernel_parameter(entry.id, "isolcpus", &value)]
                }),
            ),
        }
    };
    entry.check(format!("core {core} isolated"), finding)
}

fn nohz_full(system: &System) -> Check {
    let entry = Entry {
        id: "nohz-full",
        name: "nohz_full",
        cost: "the kernel's own timer interrupts the tick's core 100 to 1000 times a second, for microseconds each",
    };
    let file = "sys/devices/system/cpu/nohz_full";
    let core = system.core;
    let finding = match system.cores_in(file) {
        Some(found) if found.contains(&core) => Finding::Met(format!("cores {}", list(&found))),
        Some(found) => Finding::Lacking(
            if found.is_empty() {
                "no core".into()
            } else {
                format!("only cores {}", list(&found))
            },
            with_another_core(system, |_| {
                vec![system.kernel_parameter(entry.id, "nohz_full", &reserved(system))]
            }),
        ),
        // A kernel that has the feature has the file, also without a core in it.
        None if system.path(file).exists() || system.cores.online.is_empty() => {
            Finding::Unknown("the system does not tell the cores of nohz_full".into())
        }
        None => Finding::Lacking(
            "the kernel is built without it".into(),
            vec![Step::ByHand(
                "install a kernel that is built with CONFIG_NO_HZ_FULL".into(),
            )],
        ),
    };
    entry.check(format!("nohz_full with core {core}"), finding)
}

fn rcu_nocbs(system: &System) -> Check {
    let entry = Entry {
        id: "rcu-nocbs",
        name: "rcu_nocbs",
        cost: "the kernel frees memory on the tick's core in batches, which take up to hundreds of microseconds",
    };
    let core = system.core;
    let most = system.cores.online.last().copied().unwrap_or(core);
    // The kernel takes callbacks off the cores of nohz_full, too.
    let full = system.cores_in("sys/devices/system/cpu/nohz_full");
    let finding = match (full, system.boot_values("rcu_nocbs")) {
        (Some(full), _) if full.contains(&core) => {
            Finding::Met(format!("core {core}, by nohz_full"))
        }
        (_, None) => Finding::Unknown("the system does not tell its command line".into()),
        (_, Some(given)) => match given.last() {
            Some(given) if boot_list_contains(given, core, most) => {
                Finding::Met(format!("rcu_nocbs={given}"))
            }
            given => Finding::Lacking(
                given.map_or("no core".into(), |given| format!("rcu_nocbs={given}")),
                with_another_core(system, |_| {
                    vec![system.kernel_parameter(entry.id, "rcu_nocbs", &reserved(system))]
                }),
            ),
        },
    };
    entry.check(format!("rcu_nocbs with core {core}"), finding)
}

/// Whether a list of the kernel's command line contains `core`: numbers, ranges, `N` for the last core, `all`, and ranges
/// with a stride (`0-31:2/4`: the first two of each four).
fn boot_list_contains(list: &str, core: usize, last: usize) -> bool {
    let number = |text: &str| match text {
        "N" => Some(last),
        text => text.parse::<usize>().ok(),
    };
    let has = |part: &str| {
        let (range, stride) = part.split_once(':').unwrap_or((part, "1/1"));
        let (from, to) = match range {
            "all" => ("0", "N"),
            range => range.split_once('-').unwrap_or((range, range)),
        };
        let (used, group) = stride.split_once('/')?;
        let (from, to) = (number(from)?, number(to)?);
        let (used, group) = (number(used)?, number(group)?);
        let offset = core.checked_sub(from).filter(|_| core <= to)?;
        Some(offset.checked_rem(group)? < used)
    };
    list.split(',').any(|part| has(part).unwrap_or(false))
}

/// An interrupt with a handler.
struct Interrupt {
    /// Its number.
    number: String,
    /// The names of its handlers.
    names: String,
    /// Whether the kernel alone decides its cores; only root may know.
    managed: bool,
}

fn interrupts(system: &System) -> Check {
    let entry = Entry {
        id: "interrupts",
        name: "interrupts",
        cost: "each interrupt on the tick's core delays the tick by microseconds, with its follow-up work by tens",
    };
    let core = system.core;
    let numbers: Vec<_> = system
        .names("proc/irq")
        .into_iter()
        .filter(|name| name.bytes().all(|byte| byte.is_ascii_digit()))
        .collect();
    let here: Vec<_> = numbers
        .iter()
        .filter_map(|number| interrupt(system, number))
        .collect();
    let finding = if numbers.is_empty() {
        Finding::Unknown("the system does not list its interrupts (/proc/irq)".into())
    } else if here.is_empty() {
        Finding::Met(format!("none of {} on core {core}", numbers.len()))
    } else {
        let names: Vec<_> = here
            .iter()
            .take(MOST_NAMES)
            .map(|one| {
                let managed = if one.managed {
                    ", managed by the kernel"
                } else {
                    ""
                };
                format!("{} ({}{managed})", one.number, one.names)
            })
            .collect();
        let more = match here.len().saturating_sub(MOST_NAMES) {
            0 => String::new(),
            more => format!(" and {more} more"),
        };
        let found = format!("on core {core}: {}{more}", names.join(", "));
        Finding::Lacking(found, move_interrupts(system, entry.id))
    };
    entry.check(format!("none on core {core}"), finding)
}

/// The most names in a line.
const MOST_NAMES: usize = 6;

/// The steps that keep interrupts off the tick's core. The kernel refuses to move managed ones; these stay away by the flag
/// `managed_irq` of `isolcpus`, while another core serves their queue.
fn move_interrupts(system: &System, id: &str) -> Vec<Step> {
    with_another_core(system, |others| {
        let command = format!(
            "for irq in /proc/irq/[0-9]*; do echo {others} > $irq/smp_affinity_list; done 2> /dev/null; true"
        );
        vec![
            system.kernel_parameter(id, "irqaffinity", others),
            Step::at_start(id, &command),
        ]
    })
}

/// The interrupt with this number, if it may come to the tick's core. One without a handler never comes.
fn interrupt(system: &System, number: &str) -> Option<Interrupt> {
    let folder = format!("proc/irq/{number}");
    let names = system.names(&folder).into_iter();
    let names: Vec<_> = names
        .filter(|name| system.path(&format!("{folder}/{name}")).is_dir())
        .collect();
    // The effective list is empty for a kernel that does not keep it.
    let cores = ["effective_affinity_list", "smp_affinity_list"]
        .into_iter()
        .filter_map(|file| system.cores_in(&format!("{folder}/{file}")))
        .find(|cores| !cores.is_empty())?;
    let here = !names.is_empty() && cores.contains(&system.core);
    here.then(|| Interrupt {
        number: number.to_owned(),
        names: names.join(", "),
        managed: system
            .text(&format!("sys/kernel/debug/irq/irqs/{number}"))
            .is_some_and(|text| text.contains("IRQD_AFFINITY_MANAGED")),
    })
}

fn irqbalance(system: &System) -> Check {
    let entry = Entry {
        id: "irqbalance",
        name: "irqbalance",
        cost: "irqbalance moves interrupts to the tick's core while the run lasts",
    };
    let core = system.core;
    let isolated = system.cores.isolated.contains(&core);
    let finding = if system.running(&["irqbalance"]).is_empty() {
        if system.processes.is_empty() {
            Finding::Unknown("the system does not list its processes".into())
        } else {
            Finding::Met("not running".into())
        }
    } else {
        match banned(system) {
            Some(cores) if cores.contains(&core) => {
                Finding::Met(format!("running, banned from {}", list(&cores)))
            }
            // Without a list of its own, irqbalance keeps off isolated cores.
            None if isolated => Finding::Met(format!("running, off the isolated core {core}")),
            _ => Finding::Lacking("running".into(), vec![ban(system)]),
        }
    };
    entry.check(format!("not running, or banned from core {core}"), finding)
}

/// The variable of irqbalance that lists the cores that it must not use.
const BANNED: &str = "IRQBALANCE_BANNED_CPULIST=";

fn ban(system: &System) -> Step {
    Step::File {
        path: "/etc/systemd/system/irqbalance.service.d/palpate.conf".into(),
        text: format!("[Service]\nEnvironment={BANNED}{}\n", reserved(system)),
    }
}

/// The cores from which irqbalance is banned, by its configuration; `None` without a list. Its file of defaults overrides
/// the settings of its unit (`systemd.exec(5)`).
fn banned(system: &System) -> Option<Vec<usize>> {
    let folder = "etc/systemd/system/irqbalance.service.d";
    let drop_ins = system
        .names(folder)
        .into_iter()
        .map(|name| format!("{folder}/{name}"));
    let files = drop_ins.chain(["etc/default/irqbalance".to_owned()]);
    let mut lists = files.filter_map(|file| {
        let text = system.text(&file)?;
        let lines = text
            .lines()
            .map(|line| line.trim().trim_start_matches("Environment="));
        let mut values = lines.filter_map(|line| line.trim_matches('"').strip_prefix(BANNED));
        let value = values.next_back()?.trim_matches(['"', '\'']).to_owned();
        runner::cores::parse_list(&value).ok()
    });
    lists.next_back()
}

fn sibling(system: &System) -> Check {
    let entry = Entry {
        id: "smt-sibling",
        name: "SMT sibling",
        cost: "another thread on the same core shares its units and caches, and slows the tick to as little as half",
    };
    let core = system.core;
    let folder = "sys/devices/system/cpu";
    let wanted = format!("no second thread on core {core}, or an isolated one");
    let Some(threads) =
        system.cores_in(&format!("{folder}/cpu{core}/topology/thread_siblings_list"))
    else {
        return entry.check(
            wanted,
            Finding::Unknown("the system does not tell which threads share a core".into()),
        );
    };
    let busy: Vec<_> = threads
        .into_iter()
        .filter(|other| *other != core && !system.cores.isolated.contains(other))
        .filter(|other| system.cores.online.contains(other))
        .collect();
    let finding = if busy.is_empty() {
        Finding::Met("no busy thread".into())
    } else {
        let commands: Vec<_> = busy
            .iter()
            .map(|other| format!("echo 0 > /{folder}/cpu{other}/online"))
            .collect();
        Finding::Lacking(
            format!("thread {} is online", list(&busy)),
            vec![Step::at_start(entry.id, &commands.join("; "))],
        )
    };
    entry.check(wanted, finding)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_of_the_command_line_is_read_in_every_form() {
        for (list, expected) in [
            ("3", true),
            ("2-3,6", true),
            ("all", true),
            ("2-N", true),
            ("N", false),
            ("0-7:1/4", false),
            ("0-7:4/4", true),
            ("1-7:1/2", true),
            ("4-7", false),
            ("0-7:1/0", false),
            ("", false),
            ("3-", false),
            ("x", false),
        ] {
            assert_eq!(boot_list_contains(list, 3, 7), expected, "{list:?}");
        }
    }
}
