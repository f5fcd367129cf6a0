//! Machines made of files: a bare one lacks what it should, a tuned one lacks nothing, and no bytes make the examination
//! panic. The script mends and undoes below a root of its own.

use doctor::{Asked, Check, Report, Verdict, examine, script::script};
use proptest::prelude::*;
use std::collections::BTreeMap;
use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::Command;

/// A machine that is not tuned: paths and texts.
const BARE: &[(&str, &str)] = &[
    (
        "proc/sys/kernel/version",
        "#1 SMP PREEMPT_DYNAMIC Debian 6.12.1\n",
    ),
    ("proc/sys/kernel/osrelease", "6.12.1-amd64\n"),
    ("etc/os-release", "ID=debian\n"),
    ("usr/sbin/update-grub", ""),
    (
        "sys/kernel/debug/sched/fair_server/cpu3/runtime",
        "50000000\n",
    ),
    ("proc/sys/kernel/sched_rt_runtime_us", "950000\n"),
    (
        "sys/devices/system/clocksource/clocksource0/current_clocksource",
        "hpet\n",
    ),
    ("proc/cpuinfo", "flags\t\t: fpu tsc hypervisor\n"),
    ("sys/kernel/tracing/current_tracer", "hwlat\n"),
    ("sys/kernel/tracing/tracing_max_latency", "312\n"),
    ("sys/devices/system/cpu/online", "0-3\n"),
    ("sys/devices/system/cpu/isolated", "\n"),
    ("sys/devices/system/cpu/nohz_full", "(null)\n"),
    (
        "sys/devices/system/cpu/cpu3/topology/thread_siblings_list",
        "1,3\n",
    ),
    (
        "sys/devices/system/cpu/cpu3/cpufreq/scaling_governor",
        "powersave\n",
    ),
    ("sys/devices/system/cpu/cpu3/cpuidle/state1/name", "C6\n"),
    (
        "sys/devices/system/cpu/cpu3/cpuidle/state1/latency",
        "133\n",
    ),
    ("sys/devices/system/cpu/cpu3/cpuidle/state1/disable", "0\n"),
    ("proc/cmdline", "quiet\n"),
    ("proc/irq/9/effective_affinity_list", "3\n"),
    ("proc/irq/9/acpi/x", ""),
    ("proc/irq/12/smp_affinity_list", "0-3\n"),
    ("proc/irq/12/nvme0q3/x", ""),
    ("sys/kernel/debug/irq/irqs/12", "IRQD_AFFINITY_MANAGED\n"),
    ("proc/7/comm", "irqbalance\n"),
    ("proc/8/comm", "netdata\n"),
    ("proc/9/comm", "irq/129-xhci_hc\n"),
    ("proc/9/status", "Cpus_allowed_list:\t0-3\n"),
    ("proc/11/comm", "ModemManager\n"),
    (
        "proc/self/limits",
        "Max realtime priority     0                    0\nMax locked memory         8388608   8388608   bytes\n",
    ),
    (
        "proc/self/status",
        "CapEff:\t0000000000000000\nCpus_allowed_list:\t0-3\n",
    ),
    ("proc/self/cgroup", "0::/user.slice/a\n"),
    ("sys/fs/cgroup/user.slice/cpu.max", "50000 100000\n"),
    ("sys/fs/cgroup/user.slice/a/cpu.max", "max 100000\n"),
    ("proc/sys/kernel/nmi_watchdog", "1\n"),
    ("proc/sys/kernel/watchdog", "1\n"),
    ("proc/sys/kernel/soft_watchdog", "1\n"),
    ("proc/sys/kernel/watchdog_cpumask", "0-3\n"),
    ("proc/sys/kernel/timer_migration", "0\n"),
    ("sys/devices/virtual/workqueue/cpumask", "f\n"),
];

/// What tuning changes in the bare machine.
const TUNED: &[(&str, &str)] = &[
    ("sys/kernel/realtime", "1\n"),
    ("sys/kernel/debug/sched/fair_server/cpu3/runtime", "0\n"),
    (
        "sys/devices/system/clocksource/clocksource0/current_clocksource",
        "tsc\n",
    ),
    ("proc/cpuinfo", "flags\t\t: fpu tsc\n"),
    ("sys/kernel/tracing/tracing_max_latency", "0\n"),
    ("sys/devices/system/cpu/isolated", "2-3\n"),
    ("sys/devices/system/cpu/nohz_full", "2-3\n"),
    (
        "sys/devices/system/cpu/cpu3/topology/thread_siblings_list",
        "3\n",
    ),
    (
        "sys/devices/system/cpu/cpu3/cpufreq/scaling_governor",
        "performance\n",
    ),
    ("dev/cpu_dma_latency", ""),
    ("proc/irq/9/effective_affinity_list", "0\n"),
    ("proc/irq/12/smp_affinity_list", "0-2\n"),
    ("proc/8/comm", "bash\n"),
    ("proc/9/status", "Cpus_allowed_list:\t0-2\n"),
    (
        "proc/self/limits",
        "Max realtime priority     90                   90\nMax locked memory         unlimited   unlimited   bytes\n",
    ),
    ("sys/fs/cgroup/user.slice/cpu.max", "max 100000\n"),
    ("proc/sys/kernel/nmi_watchdog", "0\n"),
    ("proc/sys/kernel/watchdog_cpumask", "0-2\n"),
    ("proc/sys/kernel/timer_migration", "1\n"),
    ("sys/devices/virtual/workqueue/cpumask", "7\n"),
];

fn put(root: &Path, path: &str, text: impl AsRef<[u8]>) {
    let path = root.join(path);
    fs::create_dir_all(path.parent().expect("a folder")).expect("ours");
    fs::write(path, text).expect("ours");
}

/// The text of `/proc/PID/stat` with this realtime priority.
fn stat(priority: u8) -> String {
    let before = vec!["0"; 37].join(" ");
    format!("9 (irq/129) xhci) {before} {priority} 1 0\n")
}

/// A folder with the files of a machine.
fn machine(files: &[&[(&str, &str)]], xhci: u8) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    for (path, text) in files.iter().copied().flatten() {
        put(folder.path(), path, text);
    }
    put(folder.path(), "proc/9/stat", stat(xhci));
    folder
}

/// Plugs in a serial line on a port, with files of its USB device.
fn line(root: &Path, name: &str, port: &str, files: &[(&str, &str)]) {
    let usb = format!("sys/devices/pci/usb1/{port}");
    for (file, text) in [("idVendor", "2341"), ("idProduct", "0043"), ("serial", "A")] {
        put(root, &format!("{usb}/{file}"), text);
    }
    for (file, text) in files {
        put(root, &format!("{usb}/{file}"), text);
    }
    put(root, &format!("{usb}/{port}:1.0/interface"), "");
    put(root, &format!("sys/class/tty/{name}/dev"), "");
    put(root, &format!("dev/{name}"), "");
    let device = root.join(format!("sys/class/tty/{name}/device"));
    symlink(root.join(format!("{usb}/{port}:1.0")), device).expect("ours");
    let devices = root.join("sys/bus/usb/devices");
    fs::create_dir_all(&devices).expect("ours");
    symlink(root.join(&usb), devices.join(port)).expect("ours");
    let _ = symlink(root.join("sys/devices/pci/usb1"), devices.join("usb1"));
}

fn look(root: &Path) -> Report {
    let asked = Asked {
        core: Some(3),
        priority: None,
    };
    examine(root, &asked)
}

fn ids(report: &Report, verdict: Verdict) -> Vec<&str> {
    report.with(verdict).map(|check| check.id).collect()
}

fn check<'a>(report: &'a Report, id: &str) -> &'a Check {
    report.checks.iter().find(|check| check.id == id).expect(id)
}

#[test]
fn a_bare_machine_lacks_everything() {
    let folder = machine(&[BARE], 99);
    let report = look(folder.path());
    let other = [ids(&report, Verdict::Met), ids(&report, Verdict::Unknown)];
    assert_eq!(other, [Vec::<&str>::new(), Vec::new()]);
    assert_eq!(
        ids(&report, Verdict::NotApplicable),
        ["rt-throttling", "rt-budget", "usb-devices"]
    );
    for check in report.with(Verdict::Lacking) {
        assert!(
            !check.found.is_empty() && !check.wanted.is_empty(),
            "{check:?}"
        );
        assert!(
            !check.cost.is_empty() && !check.steps.is_empty(),
            "{check:?}"
        );
    }
    let interrupts = &check(&report, "interrupts").found;
    assert_eq!(
        interrupts,
        "on core 3: 12 (nvme0q3, managed by the kernel), 9 (acpi)"
    );
    let line = report.line();
    assert!(
        line.starts_with("doctor: 0 of 21 as wanted; lacking: PREEMPT_RT,") && !line.contains('\n'),
        "{line}"
    );
}

#[test]
fn a_tuned_machine_lacks_nothing() {
    let folder = machine(&[BARE, TUNED], 50);
    let report = look(folder.path());
    let not_met: Vec<_> = report
        .with(Verdict::Lacking)
        .chain(report.with(Verdict::Unknown))
        .collect();
    assert!(not_met.is_empty(), "{not_met:#?}");
    assert!(
        report.line().starts_with("doctor: 21 of 21 as wanted ("),
        "{}",
        report.line()
    );
}

#[test]
fn each_condition_is_judged_by_its_file() {
    use Verdict::{Lacking, Met, NotApplicable, Unknown};
    // A file of the tuned machine, its other text, the check, and the verdict.
    for (path, text, id, verdict) in [
        ("sys/kernel/realtime", "0", "preempt-rt", Lacking),
        (
            "proc/sys/kernel/osrelease",
            "6.1.0-rt",
            "rt-throttling",
            Lacking,
        ),
        (
            "proc/sys/kernel/osrelease",
            "6.1.0-rt",
            "fair-server",
            NotApplicable,
        ),
        (
            "sys/kernel/tracing/current_tracer",
            "nop",
            "hardware-latency",
            Unknown,
        ),
        (
            "sys/devices/system/cpu/isolated",
            "0-1,6",
            "isolated-core",
            Lacking,
        ),
        (
            "sys/fs/cgroup/cpuset.cpus.isolated",
            "3",
            "isolated-core",
            Met,
        ),
        (
            "sys/devices/system/cpu/nohz_full",
            "x",
            "nohz-full",
            Unknown,
        ),
        ("proc/cpuinfo", "BogoMIPS: 108", "hypervisor", Unknown),
        ("sys/hypervisor/type", "xen", "hypervisor", Lacking),
        (
            "proc/irq/9/effective_affinity_list",
            "0-3,6",
            "interrupts",
            Lacking,
        ),
        (
            "sys/devices/system/cpu/cpu3/topology/thread_siblings_list",
            "2-3",
            "smt-sibling",
            Met,
        ),
        (
            "sys/devices/system/cpu/cpu3/topology/thread_siblings_list",
            "3,7",
            "smt-sibling",
            Met,
        ),
        (
            "etc/default/irqbalance",
            "IRQBALANCE_BANNED_CPULIST=\"2\"",
            "irqbalance",
            Lacking,
        ),
        (
            "etc/default/irqbalance",
            "IRQBALANCE_BANNED_CPULIST=2-3",
            "irqbalance",
            Met,
        ),
        ("proc/self/limits", "", "rtprio", Unknown),
        (
            "proc/self/limits",
            "Max realtime priority 79 79",
            "rtprio",
            Lacking,
        ),
        (
            "sys/fs/cgroup/user.slice/a/cpu.rt_runtime_us",
            "0",
            "rt-budget",
            Lacking,
        ),
        (
            "sys/fs/cgroup/user.slice/a/cpu.rt_runtime_us",
            "9000",
            "rt-budget",
            Met,
        ),
        (
            "sys/fs/cgroup/cpu/user.slice/cpu.cfs_quota_us",
            "20000",
            "cpu-quota",
            Lacking,
        ),
        (
            "sys/fs/cgroup/cpu/user.slice/cpu.cfs_quota_us",
            "-1",
            "cpu-quota",
            Met,
        ),
        ("proc/9/status", "", "xhci-thread", Unknown),
    ] {
        let folder = machine(&[BARE, TUNED, &[(path, text)]], 50);
        let report = look(folder.path());
        assert_eq!(
            check(&report, id).verdict,
            verdict,
            "{path} {text}: {:?}",
            check(&report, id)
        );
    }
}

#[test]
fn what_a_system_does_not_tell_is_unknown_and_never_lacking() {
    let folder = tempfile::tempdir().expect("a folder");
    let report = look(folder.path());
    assert_eq!(ids(&report, Verdict::Lacking), [""; 0]);
    assert!(report.count(Verdict::Unknown) > 10);
}

#[test]
fn this_machine_is_judged() {
    assert!(examine(Path::new("/"), &Asked::default()).checks.len() > 20);
}

#[test]
fn the_connection_of_each_device_is_judged() {
    let folder = machine(&[BARE, TUNED], 50);
    let root = folder.path();
    line(
        root,
        "ttyACM0",
        "1-1",
        &[("speed", "480"), ("power/control", "on")],
    );
    let rules = "usr/lib/udev/rules.d";
    put(
        root,
        &format!("{rules}/77-mm.rules"),
        "ATTRS{idVendor}==\"2341\", ATTRS{idProduct}==\"0043\", ENV{ID_MM_DEVICE_IGNORE}=\"1\"\n",
    );
    let good = look(root);
    assert_eq!(ids(&good, Verdict::Lacking), [""; 0], "{good:#?}");
    line(
        root,
        "ttyACM1",
        "1-2.3",
        &[("speed", "12"), ("power/control", "auto")],
    );
    put(
        root,
        "etc/udev/rules.d/99-arm.rules",
        "ATTRS{idVendor}==\"2341\", \\\n ATTRS{idProduct}==\"0043\", TAG+=\"uaccess\"\n",
    );
    fs::remove_file(root.join(format!("{rules}/77-mm.rules"))).expect("ours");
    put(
        root,
        &format!("{rules}/90-brltty.rules"),
        "ENV{PRODUCT}==\"2341/43/*\", ENV{BRLTTY_BRAILLE_DRIVER}=\"bm\"\n",
    );
    let bad = look(root);
    let of_second: Vec<_> = bad
        .with(Verdict::Lacking)
        .filter(|check| {
            check
                .device
                .as_deref()
                .is_some_and(|one| one.contains("ttyACM1"))
        })
        .map(|check| check.id)
        .collect();
    assert_eq!(
        of_second,
        [
            "usb-speed",
            "usb-hub",
            "usb-controller",
            "usb-autosuspend",
            "usb-grabbers",
            "usb-rules",
            "usb-serials",
        ]
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]
    /// Any bytes in any of the files.
    #[test]
    fn no_bytes_make_the_examination_panic(
        which in proptest::sample::subsequence(BARE.to_vec(), 1..8),
        bytes in proptest::collection::vec(any::<u8>(), 0..60),
        text in "[-0-9, /:a-f()\n]{0,40}",
        core in proptest::option::of(any::<usize>()),
    ) {
        for content in [bytes.as_slice(), text.as_bytes()] {
            let folder = machine(&[BARE], 50);
            for (path, _) in &which {
                put(folder.path(), path, content);
            }
            put(folder.path(), "proc/9/stat", content);
            let report = examine(folder.path(), &Asked { core, priority: None });
            prop_assert!(!report.line().contains('\n'));
            script(&report);
        }
    }
}

/// The files, links and folders of a tree, with what they hold.
fn tree(root: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut all = BTreeMap::new();
    let mut folders = vec![root.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).expect("ours") {
            let path = entry.expect("ours").path();
            let name = path
                .strip_prefix(root)
                .expect("below")
                .display()
                .to_string();
            let content = if path.is_symlink() {
                fs::read_link(&path)
                    .expect("ours")
                    .display()
                    .to_string()
                    .into_bytes()
            } else if path.is_dir() {
                folders.push(path);
                Vec::new()
            } else {
                fs::read(&path).expect("ours")
            };
            all.insert(name, content);
        }
    }
    all
}

#[test]
fn the_script_mends_and_undoes_to_the_byte() {
    let bare = machine(&[BARE], 99);
    let text = script(&look(bare.path()));
    // A folder with a blank in its name, a file in the place of one of the script's, and a link in the place of another.
    let parent = tempfile::tempdir().expect("a folder");
    let root = parent.path().join("a root");
    put(
        &root,
        "etc/sysctl.d/90-palpate-watchdogs.conf",
        "of a person\n",
    );
    fs::create_dir_all(root.join("etc/default/grub.d")).expect("ours");
    symlink(
        "elsewhere",
        root.join("etc/default/grub.d/palpate-nohz-full.cfg"),
    )
    .expect("ours");
    let file = parent.path().join("tune.sh");
    fs::write(&file, &text).expect("ours");
    let shell = |arguments: &[&str], root: &Path| {
        let mut command = Command::new("sh");
        command
            .args(arguments)
            .env("ROOT", root)
            .output()
            .expect("a shell")
    };
    let name = file.display().to_string();
    assert!(shell(&["-n", &name], &root).status.success(), "{text}");
    assert_eq!(shell(&[&name], &root).status.code(), Some(2));
    let before = tree(&root);
    let run = |mode: &str| {
        let output = shell(&[&name, mode], &root);
        assert!(
            output.status.success(),
            "{mode}: {}",
            String::from_utf8_lossy(&output.stderr)
        );
        tree(&root)
    };
    let mended = run("mend");
    let of = |path: &str| String::from_utf8_lossy(mended.get(path).expect(path)).into_owned();
    assert_eq!(
        of("etc/default/grub.d/palpate-isolated-core.cfg"),
        "GRUB_CMDLINE_LINUX_DEFAULT=\"$GRUB_CMDLINE_LINUX_DEFAULT isolcpus=managed_irq,domain,3\"\n"
    );
    assert!(of("etc/sysctl.d/90-palpate-watchdogs.conf").contains("kernel.nmi_watchdog = 0"));
    let unit = of("etc/systemd/system/palpate-governor.service");
    assert!(
        unit.contains("echo performance > /sys/devices/system/cpu/cpu3/"),
        "{unit}"
    );
    assert_eq!(
        of("etc/systemd/system/multi-user.target.wants/palpate-governor.service"),
        "../palpate-governor.service"
    );
    let again = run("mend");
    let without_lists = |tree: &BTreeMap<String, Vec<u8>>| {
        let mut tree = tree.clone();
        // Packages and groups are noted again, and undone once.
        tree.retain(|path, _| {
            !path.ends_with("doctor/packages") && !path.ends_with("doctor/groups")
        });
        tree
    };
    assert_eq!(without_lists(&again), without_lists(&mended));
    assert_eq!(run("undo"), before);
    assert_eq!(run("undo"), before);
}
