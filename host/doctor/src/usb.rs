//! Checks of USB: the interrupt thread of the controllers, and each haptic device that is connected.
//!
//! Sources: `Documentation/ABI/testing/sysfs-bus-usb` (`speed`), `Documentation/driver-api/usb/power-management.rst`
//! (autosuspend), `proc_pid_stat(5)`, ModemManager's `ID_MM_DEVICE_IGNORE`, the rules of brltty (which name the devices
//! that it takes), and the rules 73-seat-late.rules of systemd, after which the tag `uaccess` has no effect.

use crate::check::{Check, Entry, Finding};
use crate::step::Step;
use crate::system::System;
use devices::found::{self, Found};
use runner::cores::parse_list;
use std::ffi::OsStr;
use std::fs::canonicalize;
use std::path::{Path, PathBuf};

/// The checks of this group.
pub(crate) fn checks(system: &System) -> Vec<Check> {
    let mut haptic = found::list(system.root());
    haptic.retain(|one| !one.input && !one.port.is_empty());
    let mut checks = vec![controller_thread(system)];
    if haptic.is_empty() {
        let entry = Entry {
            id: "usb-devices",
            name: "devices on USB",
            cost: "",
        };
        let none = Finding::NotApplicable("no haptic device is connected".into());
        checks.push(entry.check("a device, to check its connection", none));
    }
    let rules = Rules::read(system);
    for device in &haptic {
        let mut of_device = vec![
            speed(system, device),
            hub(system, device),
            controller(system, device, &haptic),
            autosuspend(system, device),
            grabbers(system, device, &rules),
            late_rules(device, &rules),
            serials(device, &haptic),
        ];
        for check in &mut of_device {
            check.device = Some(device.connect.clone());
        }
        checks.extend(of_device);
    }
    checks
}

/// The least priority of the interrupt thread: that of all threaded interrupts.
const LEAST_PRIORITY: u64 = 50;

fn controller_thread(system: &System) -> Check {
    let entry = Entry {
        id: "xhci-thread",
        name: "USB interrupt thread",
        cost: "the thread of the USB controller delays the tick, or other threads delay the reports of the devices",
    };
    let (core, priority) = (system.core, u64::from(system.priority));
    let wanted = format!(
        "priority {LEAST_PRIORITY} to {}, not on core {core}",
        priority.saturating_sub(1)
    );
    // The kernel cuts the names of threads to 15 letters.
    let threads = system.processes.iter().filter(|(name, _)| {
        let of_controller = name
            .split_once('-')
            .is_some_and(|(_, name)| name.starts_with("xhci"));
        name.starts_with("irq/") && of_controller
    });
    let mut found = Vec::new();
    let mut lacking = false;
    for (name, folder) in threads {
        let stat = system.text(&format!("{folder}/stat"));
        let status = system.text(&format!("{folder}/status"));
        let (Some(of_thread), Some(cores)) = (
            stat.as_deref().and_then(realtime_priority),
            status.as_deref().and_then(allowed_cores),
        ) else {
            return entry.check(
                wanted,
                Finding::Unknown(format!("the system does not tell of {name}")),
            );
        };
        let here = cores.contains(&core);
        lacking |= here || of_thread < LEAST_PRIORITY || of_thread >= priority;
        let place = if here { "on" } else { "not on" };
        found.push(format!("{name}: priority {of_thread}, {place} core {core}"));
    }
    let text = found.join("; ");
    let finding = if found.is_empty() {
        Finding::NotApplicable("the kernel has no thread for the interrupts of USB".into())
    } else if lacking {
        // The affinity of the thread follows that of its interrupt, which the check of interrupts mends.
        let others = system.others_listed();
        let place = others.map_or(String::new(), |others| {
            format!("taskset -p -c {others} $id; ")
        });
        let command = format!(
            "for comm in /proc/[0-9]*/comm; do read -r name < $comm; case $name in irq/*-xhci*) id=${{comm#/proc/}}; \
             id=${{id%%/comm}}; chrt -f -p {LEAST_PRIORITY} $id; {place};; esac; done; true"
        );
        Finding::Lacking(text, vec![Step::at_start(entry.id, &command)])
    } else {
        Finding::Met(text)
    };
    entry.check(wanted, finding)
}

/// The realtime priority in the text of `/proc/PID/stat`: field 40, the name in parentheses being field 2.
fn realtime_priority(stat: &str) -> Option<u64> {
    let (_, fields) = stat.rsplit_once(')')?;
    fields.split_whitespace().nth(37)?.parse().ok()
}

/// The cores that a thread may use, in the text of `/proc/PID/status`.
fn allowed_cores(status: &str) -> Option<Vec<usize>> {
    let list = status
        .lines()
        .find_map(|line| line.strip_prefix("Cpus_allowed_list:"))?;
    parse_list(list).ok()
}

/// A file of a device in sysfs.
fn fact(system: &System, device: &Found, file: &str) -> Option<String> {
    system.line(&format!("sys/bus/usb/devices/{}/{file}", device.port))
}

/// The ports of the hubs between a device and its controller: of `1-2.3.4`, these are `1-2` and `1-2.3`.
fn hubs(port: &str) -> Vec<&str> {
    port.match_indices('.')
        .map(|(end, _)| &port[..end])
        .collect()
}

fn speed(system: &System, device: &Found) -> Check {
    let entry = Entry {
        id: "usb-speed",
        name: "speed of USB",
        cost: "a low-speed device exchanges every 8 ms at best. A full-speed device behind a hub shares the hub's \
               translator, and waits up to a millisecond more",
    };
    let speed: Option<f64> = fact(system, device, "speed").and_then(|text| text.parse().ok());
    let elsewhere = || {
        vec![Step::ByHand(
            "connect the device to a port of the machine itself, by a cable that the device came with".into(),
        )]
    };
    let finding = match (speed, hubs(&device.port).last()) {
        (None, _) => Finding::Unknown("the system does not tell the speed".into()),
        (Some(speed), _) if speed < 12.0 => {
            Finding::Lacking(format!("low speed ({speed} Mbit/s)"), elsewhere())
        }
        (Some(speed), Some(hub)) if speed < 480.0 => Finding::Lacking(
            format!("full speed ({speed} Mbit/s) behind the hub on port {hub}"),
            elsewhere(),
        ),
        (Some(speed), _) => Finding::Met(format!("{speed} Mbit/s")),
    };
    entry.check(
        "12 Mbit/s or more; 480 Mbit/s or more behind a hub",
        finding,
    )
}

fn hub(system: &System, device: &Found) -> Check {
    let entry = Entry {
        id: "usb-hub",
        name: "hub",
        cost: "the device shares the hub with other devices, which may delay its reports",
    };
    let finding = match hubs(&device.port).last() {
        Some(hub) => {
            let name = system.line(&format!("sys/bus/usb/devices/{hub}/product"));
            let name = name.map_or(String::new(), |name| format!(" ({name})"));
            Finding::Lacking(
                format!("a hub on port {hub}{name}"),
                vec![Step::ByHand(
                    "connect the device to a port of the machine itself".into(),
                )],
            )
        }
        None if device.behind_hub => Finding::Lacking(
            "a hub".into(),
            vec![Step::ByHand(
                "connect the device to a port of the machine itself".into(),
            )],
        ),
        None => Finding::Met(format!("port {} of the machine", device.port)),
    };
    entry.check("no hub in between", finding)
}

/// The controller of a device, if the system tells.
fn controller_of(system: &System, device: &Found) -> Option<PathBuf> {
    let (bus, _) = device.port.split_once('-')?;
    let root_hub = system.path(&format!("sys/bus/usb/devices/usb{bus}"));
    Some(canonicalize(root_hub).ok()?.parent()?.to_owned())
}

fn controller(system: &System, device: &Found, all: &[Found]) -> Check {
    let entry = Entry {
        id: "usb-controller",
        name: "controller of USB",
        cost: "the reports of two devices on one controller wait for each other",
    };
    let own = controller_of(system, device);
    let shared: Vec<_> = all
        .iter()
        .filter(|other| other.port != device.port)
        .filter(|other| own.is_some() && controller_of(system, other) == own)
        .map(|other| other.connect.as_str())
        .collect();
    let finding = if own.is_none() && all.iter().any(|other| other.port != device.port) {
        Finding::Unknown("the system does not tell the controller".into())
    } else if shared.is_empty() {
        Finding::Met("not shared with another haptic device".into())
    } else {
        Finding::Lacking(
            format!("shared with {}", shared.join(", ")),
            vec![Step::ByHand(
                "connect the devices to ports of different controllers (`lsusb -t`), if need be with a card".into(),
            )],
        )
    };
    entry.check("a controller for each haptic device", finding)
}

fn autosuspend(system: &System, device: &Found) -> Check {
    let entry = Entry {
        id: "usb-autosuspend",
        name: "autosuspend",
        cost: "the kernel may put the device to sleep between runs, and its first reports come late or not at all",
    };
    let finding = match (
        fact(system, device, "power/control").as_deref(),
        device.numbers,
    ) {
        (Some("on"), _) => Finding::Met("on (never suspended)".into()),
        (Some(found), Some((vid, pid))) => Finding::Lacking(
            found.to_owned(),
            vec![Step::udev(
                &format!("{}-{vid:04x}-{pid:04x}", entry.id),
                &format!(
                    "ACTION==\"add\", SUBSYSTEM==\"usb\", ATTR{{idVendor}}==\"{vid:04x}\", \
                     ATTR{{idProduct}}==\"{pid:04x}\", ATTR{{power/control}}=\"on\""
                ),
            )],
        ),
        _ => Finding::Unknown("the system does not tell power/control".into()),
    };
    entry.check("power/control of on", finding)
}

/// The rules of udev, each line with the name of its file.
struct Rules(Vec<(String, String)>);

impl Rules {
    /// The rules of all folders (`udev(7)`). A file in an earlier folder replaces one of its name in a later folder.
    fn read(system: &System) -> Self {
        let mut files: Vec<(String, String)> = Vec::new();
        for folder in [
            "etc/udev/rules.d",
            "run/udev/rules.d",
            "usr/local/lib/udev/rules.d",
            "usr/lib/udev/rules.d",
            "lib/udev/rules.d",
        ] {
            for name in system.names(folder) {
                let known = files.iter().any(|(file, _)| *file == name);
                if Path::new(&name).extension() == Some(OsStr::new("rules")) && !known {
                    let text = system.text(&format!("{folder}/{name}")).unwrap_or_default();
                    files.push((name, text));
                }
            }
        }
        let lines = files.into_iter().flat_map(|(name, text)| {
            // A backslash continues a line.
            let text = text.replace("\\\n", " ").to_lowercase();
            let lines = text
                .lines()
                .filter(|line| !line.trim_start().starts_with('#'));
            lines
                .map(|line| (name.clone(), line.to_owned()))
                .collect::<Vec<_>>()
        });
        Self(lines.collect())
    }

    /// The lines that name a device by its numbers: as attributes, or as the kernel's product.
    fn naming(&self, (vid, pid): (u16, u16)) -> impl Iterator<Item = &(String, String)> {
        let attributes = [
            format!("{{idvendor}}==\"{vid:04x}\""),
            format!("{{idproduct}}==\"{pid:04x}\""),
        ];
        let product = format!("\"{vid:x}/{pid:x}/");
        self.0.iter().filter(move |(_, line)| {
            attributes.iter().all(|part| line.contains(part)) || line.contains(&product)
        })
    }
}

fn grabbers(system: &System, device: &Found, rules: &Rules) -> Check {
    let entry = Entry {
        id: "usb-grabbers",
        name: "programs that take ports",
        cost: "the program opens the device when it is plugged in, sends bytes to it, and keeps it from the run",
    };
    let numbers = device.numbers;
    let mut found = Vec::new();
    let mut steps = Vec::new();
    let is_line = device.connect.starts_with("tty:");
    let ignored = numbers.is_some_and(|numbers| {
        rules
            .naming(numbers)
            .any(|(_, line)| line.contains("id_mm_device_ignore"))
    });
    if is_line && !ignored && !system.running(&["ModemManager"]).is_empty() {
        found.push("ModemManager is running");
        steps.extend(numbers.map(|(vid, pid)| {
            Step::udev(
                &format!("modem-{vid:04x}-{pid:04x}"),
                &format!(
                    "ATTRS{{idVendor}}==\"{vid:04x}\", ATTRS{{idProduct}}==\"{pid:04x}\", ENV{{ID_MM_DEVICE_IGNORE}}=\"1\""
                ),
            )
        }));
    }
    let braille =
        |(file, line): &(String, String)| file.contains("brltty") && line.contains("brltty");
    let claimed = numbers.is_some_and(|numbers| rules.naming(numbers).any(braille));
    if claimed {
        found.push("the rules of brltty claim the device");
        steps.push(Step::Mask("brltty-udev.service"));
    }
    let finding = if found.is_empty() {
        Finding::Met("none".into())
    } else if system
        .path("etc/systemd/system/brltty-udev.service")
        .is_symlink()
        && found.len() == 1
        && claimed
    {
        Finding::Met("brltty is masked".into())
    } else {
        Finding::Lacking(found.join(", "), steps)
    };
    entry.check("none", finding)
}

fn late_rules(device: &Found, rules: &Rules) -> Check {
    let entry = Entry {
        id: "usb-rules",
        name: "udev rules",
        cost: "the tag uaccess has no effect in rules after 73-seat-late.rules, and the account may not open the device",
    };
    let tagged: Vec<_> = device.numbers.map_or(Vec::new(), |numbers| {
        let naming = rules.naming(numbers);
        let tagged = naming.filter(|(_, line)| line.contains("\"uaccess\""));
        tagged.map(|(file, _)| file.as_str()).collect()
    });
    let early = tagged.iter().any(|file| *file < LAST_RULES);
    let finding = match (tagged.first(), device.numbers) {
        (Some(late), Some((vid, pid))) if !early => Finding::Lacking(
            format!("only in {late}"),
            vec![Step::udev(
                &format!("access-{vid:04x}-{pid:04x}"),
                &format!(
                    "ATTRS{{idVendor}}==\"{vid:04x}\", ATTRS{{idProduct}}==\"{pid:04x}\", MODE=\"0660\", \
                     TAG+=\"uaccess\""
                ),
            )],
        ),
        (Some(file), _) => Finding::Met((*file).to_owned()),
        (None, _) => Finding::Met("no tag uaccess after 73".into()),
    };
    entry.check("the tag uaccess in rules before 73", finding)
}

/// The rules that give devices with the tag `uaccess` to the person at the seat.
const LAST_RULES: &str = "73-seat-late.rules";

fn serials(device: &Found, all: &[Found]) -> Check {
    let entry = Entry {
        id: "usb-serials",
        name: "serial numbers",
        cost: "only the port tells the devices apart, so exchanged cables exchange the hands",
    };
    let equal = all.iter().any(|other| {
        other.port != device.port
            && other.numbers == device.numbers
            && other.serial == device.serial
    });
    let finding = if equal {
        Finding::Lacking(
            format!("{:?}, as of another device", device.serial),
            vec![Step::ByHand(format!(
                "name the device by its port in the scene ({}), and mark the cables",
                device.connect
            ))],
        )
    } else {
        Finding::Met(if device.serial.is_empty() {
            "none, and no other device of this kind".into()
        } else {
            device.serial.clone()
        })
    };
    entry.check("a serial number of its own", finding)
}
