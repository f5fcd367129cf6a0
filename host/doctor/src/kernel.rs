//! Checks of the kernel and of the hardware under the kernel.
//!
//! Sources: `/sys/kernel/realtime` (the PREEMPT_RT patches), `Documentation/scheduler/sched-rt-group.rst` (throttling),
//! `Documentation/scheduler/sched-deadline.rst` and `kernel/sched/debug.c` (the fair server, from kernel 6.12),
//! `Documentation/trace/hwlat_detector.rst`, and Intel's manual (model-specific register 0x34, `MSR_SMI_COUNT`).

use crate::check::{Check, Entry, Finding};
use crate::step::Step;
use crate::system::System;
use std::fs::File;
use std::os::unix::fs::FileExt;

/// The checks of this group.
pub(crate) fn checks(system: &System) -> Vec<Check> {
    vec![
        preempt_rt(system),
        throttling(system),
        fair_server(system),
        clock_source(system),
        hypervisor(system),
        hardware(system),
    ]
}

fn preempt_rt(system: &System) -> Check {
    let entry = Entry {
        id: "preempt-rt",
        name: "PREEMPT_RT",
        cost: "the kernel itself may delay the tick, at times by milliseconds",
    };
    let marked = system.line("sys/kernel/realtime").as_deref() == Some("1");
    let version = system.line("proc/sys/kernel/version");
    let finding = match version {
        _ if marked => Finding::Met("a PREEMPT_RT kernel".into()),
        Some(version) if version.contains("PREEMPT_RT") || version.contains("PREEMPT RT") => {
            Finding::Met("a PREEMPT_RT kernel".into())
        }
        Some(version) => Finding::Lacking(version, realtime_kernel(system)),
        None => Finding::Unknown("the system does not tell the version of its kernel".into()),
    };
    entry.check("a PREEMPT_RT kernel", finding)
}

/// The steps to a realtime kernel, by the identifier of the distribution (`os-release(5)`).
fn realtime_kernel(system: &System) -> Vec<Step> {
    let release = system.text("etc/os-release").unwrap_or_default();
    let id = release.lines().find_map(|line| line.strip_prefix("ID="));
    let step = match (
        id.map(|id| id.trim_matches(['"', '\''])),
        std::env::consts::ARCH,
    ) {
        (Some("debian"), "x86_64") => Step::Package("linux-image-rt-amd64".into()),
        (Some("debian"), "aarch64") => Step::Package("linux-image-rt-arm64".into()),
        (Some("ubuntu"), _) => {
            Step::ByHand("enable the realtime kernel: `sudo pro enable realtime-kernel`".into())
        }
        _ => Step::ByHand(
            "install the kernel of your distribution that is built with PREEMPT_RT".into(),
        ),
    };
    vec![
        step,
        Step::ByHand("restart the machine with the realtime kernel".into()),
    ]
}

fn throttling(system: &System) -> Check {
    let entry = Entry {
        id: "rt-throttling",
        name: "realtime throttling",
        cost: "if realtime threads use a core longer than this, the kernel stops them for the rest of the second. \
               Without the limit, a realtime thread that never sleeps keeps its core for ever",
    };
    let file = "proc/sys/kernel/sched_rt_runtime_us";
    let grouped = system.has_group_budgets();
    let finding = match (system.number::<i64>(file), system.kernel()) {
        (_, Some(version)) if version >= (6, 12) && !grouped => {
            Finding::NotApplicable("from kernel 6.12 the fair server is in its place".into())
        }
        (None, _) => Finding::Unknown("the system does not tell sched_rt_runtime_us".into()),
        (Some(-1), _) => Finding::Met("no limit".into()),
        // With budgets of groups, the budget of the root group must stay above those of the others.
        (Some(found), _) if grouped && found > 0 => Finding::NotApplicable(format!(
            "{found} us a period, which the budgets of control groups divide"
        )),
        (Some(found), _) => Finding::Lacking(
            format!("{found} us a period"),
            vec![Step::sysctl(entry.id, "kernel.sched_rt_runtime_us = -1")],
        ),
    };
    entry.check("sched_rt_runtime_us of -1 (no limit)", finding)
}

fn fair_server(system: &System) -> Check {
    let entry = Entry {
        id: "fair-server",
        name: "fair server",
        cost: "if other threads wait for the tick's core, the kernel lets them run before the tick, by default for up \
               to 50 ms a second",
    };
    let core = system.core;
    let file = format!("sys/kernel/debug/sched/fair_server/cpu{core}/runtime");
    let finding = match (system.kernel(), system.number::<u64>(&file)) {
        (Some(version), _) if version < (6, 12) => {
            Finding::NotApplicable("the kernel has no fair server (from 6.12)".into())
        }
        (_, Some(0)) => Finding::Met(format!("0 ns on core {core}")),
        (_, Some(found)) => Finding::Lacking(
            format!("{found} ns a period on core {core}"),
            vec![Step::at_start(entry.id, &format!("echo 0 > /{file}"))],
        ),
        (_, None) => Finding::Unknown(format!(
            "/{file} cannot be read (only root may, with debugfs mounted)"
        )),
    };
    entry.check(format!("a runtime of 0 on core {core}"), finding)
}

/// Clock sources that the kernel lets a program read without a system call.
const FAST_CLOCKS: [&str; 6] = [
    "tsc",
    "arch_sys_counter",
    "riscv_clocksource",
    "kvm-clock",
    "hyperv_clocksource_tsc_page",
    "timebase",
];

fn clock_source(system: &System) -> Check {
    let entry = Entry {
        id: "clock-source",
        name: "clock source",
        cost: "each reading of the clock is a system call to slow hardware, a microsecond or more, several times a tick",
    };
    let file = "sys/devices/system/clocksource/clocksource0/current_clocksource";
    let finding = match system.line(file) {
        Some(found) if FAST_CLOCKS.contains(&found.as_str()) => Finding::Met(found),
        Some(found) => Finding::Lacking(
            found,
            vec![Step::ByHand(
                "look in `sudo dmesg | grep -i -e tsc -e clocksource` why the kernel left the fast clock; a newer \
                 firmware often mends it"
                    .into(),
            )],
        ),
        None => Finding::Unknown("the system does not tell its clock source".into()),
    };
    entry.check("tsc, or another clock in the processor", finding)
}

fn hypervisor(system: &System) -> Check {
    let entry = Entry {
        id: "hypervisor",
        name: "no hypervisor",
        cost: "the hypervisor may stop the processor at any time, for milliseconds",
    };
    let information = system.text("proc/cpuinfo").unwrap_or_default();
    let flags = information.lines().find_map(|line| {
        let (name, flags) = line.split_once(':')?;
        (name.trim() == "flags").then_some(flags)
    });
    let flagged = flags.map(|flags| flags.split_whitespace().any(|flag| flag == "hypervisor"));
    // Boards without that flag: Xen, and the node of a device tree.
    let kind = system
        .line("sys/hypervisor/type")
        .or_else(|| system.line("proc/device-tree/hypervisor/compatible"));
    let finding = match (flagged, kind) {
        (_, Some(kind)) => Finding::Lacking(format!("a virtual machine ({kind})"), on_metal()),
        (Some(true), None) => Finding::Lacking("a virtual machine".into(), on_metal()),
        (Some(false), None) => Finding::Met("none".into()),
        (None, None) => Finding::Unknown("the processor does not tell".into()),
    };
    entry.check("none", finding)
}

fn on_metal() -> Vec<Step> {
    vec![Step::ByHand(
        "run on the machine itself, outside of a virtual machine".into(),
    )]
}

/// Latency of the hardware that a realtime PC may have (us). The detector itself reports from 10 us on.
const MOST_LATENCY: u64 = 20;
/// System management interrupts that a realtime PC may have, in a minute since the start of the machine.
const MOST_INTERRUPTS: f64 = 1.0;

fn hardware(system: &System) -> Check {
    let entry = Entry {
        id: "hardware-latency",
        name: "hardware latency",
        cost: "the firmware stops all cores (system management interrupts), unseen by the kernel, for up to hundreds of \
               microseconds",
    };
    let quiet = || {
        vec![Step::ByHand(
            "in the setup of the firmware, switch off what it does by itself (emulation of USB keyboards, power and fan \
             management, error reports), or update the firmware"
                .into(),
        )]
    };
    let detected = ["sys/kernel/tracing", "sys/kernel/debug/tracing"]
        .into_iter()
        .filter(|folder| {
            system.line(&format!("{folder}/current_tracer")).as_deref() == Some("hwlat")
        })
        .find_map(|folder| system.number::<u64>(&format!("{folder}/tracing_max_latency")));
    let finding = match (detected, interrupts_a_minute(system)) {
        (Some(found), _) if found > MOST_LATENCY => {
            Finding::Lacking(format!("{found} us by the tracer hwlat"), quiet())
        }
        (_, Some(found)) if found > MOST_INTERRUPTS => Finding::Lacking(
            format!("{found:.1} system management interrupts a minute"),
            quiet(),
        ),
        (Some(found), _) => Finding::Met(format!("{found} us by the tracer hwlat")),
        (None, Some(found)) => Finding::Met(format!(
            "{found:.1} system management interrupts a minute"
        )),
        (None, None) => Finding::Unknown(
            "no result: neither the tracer hwlat (`sudo rtla hwnoise`, or `echo hwlat > \
             /sys/kernel/tracing/current_tracer`) nor the count of system management interrupts can be read"
                .into(),
        ),
    };
    entry.check(format!("at most {MOST_LATENCY} us"), finding)
}

/// System management interrupts in a minute, on the average since the start of the machine; `None` if the account may not
/// read the count, or the processor has none.
fn interrupts_a_minute(system: &System) -> Option<f64> {
    const SMI_COUNT: u64 = 0x34;
    let uptime = system.line("proc/uptime")?;
    let seconds: f64 = uptime.split_whitespace().next()?.parse().ok()?;
    let file = File::open(system.path(&format!("dev/cpu/{}/msr", system.core))).ok()?;
    let mut bytes = [0; 8];
    file.read_exact_at(&mut bytes, SMI_COUNT).ok()?;
    // The upper half is reserved.
    let count = u64::from_le_bytes(bytes) & 0xffff_ffff;
    (seconds > 0.0).then(|| 60.0 * count as f64 / seconds)
}
