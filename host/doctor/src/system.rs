//! The files of the machine, and the core and the priority for which it is judged.
//!
//! A file may be missing, unreadable or hold any bytes; then it says nothing. No file is read beyond [`MOST`] bytes, because
//! some files of the kernel have no end.

use crate::step::Step;
use runner::cores::{list, parse_list};
use runner::schedule::{DEFAULT_PRIORITY, Group};
use runner::{CoreChoice, Cores};
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// The most bytes that are read of a file.
const MOST: u64 = 1 << 20;

/// The core and the priority that a run would use.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Asked {
    /// The core of the tick; by default the core that a run takes.
    pub core: Option<usize>,
    /// The priority of the tick under SCHED_FIFO, 1 to 99; by default that of a run.
    pub priority: Option<u8>,
}

/// A machine, as its files tell.
pub(crate) struct System<'a> {
    root: &'a Path,
    /// The core of the tick.
    pub(crate) core: usize,
    /// The priority of the tick under SCHED_FIFO.
    pub(crate) priority: u8,
    /// The cores.
    pub(crate) cores: Cores,
    /// Names of the running programs and of the kernel's threads, each with its folder in `/proc`.
    pub(crate) processes: Vec<(String, String)>,
}

impl<'a> System<'a> {
    /// The machine whose files are below `root`.
    pub(crate) fn new(root: &'a Path, asked: &Asked) -> Self {
        let cores = Cores::below(root);
        let mut system = Self {
            root,
            core: 0,
            priority: asked.priority.unwrap_or(DEFAULT_PRIORITY),
            cores,
            processes: Vec::new(),
        };
        let allowed = system.status("Cpus_allowed_list");
        let allowed = allowed.and_then(|text| parse_list(&text).ok());
        let allowed = allowed.unwrap_or_else(|| system.cores.online.clone());
        let candidates = system.cores.candidates(CoreChoice::default(), &allowed);
        let default = candidates.first().or(allowed.last()).copied();
        system.core = asked.core.or(default).unwrap_or(0);
        system.processes = system.read_processes();
        system
    }

    fn read_processes(&self) -> Vec<(String, String)> {
        let ids = self.names("proc").into_iter();
        let ids = ids.filter(|name| name.bytes().all(|byte| byte.is_ascii_digit()));
        ids.filter_map(|id| {
            let name = self.line(&format!("proc/{id}/comm"))?;
            Some((name, format!("proc/{id}")))
        })
        .collect()
    }

    /// The path of a file of the machine.
    pub(crate) fn path(&self, path: &str) -> PathBuf {
        self.root.join(path)
    }

    /// The root of the machine.
    pub(crate) fn root(&self) -> &Path {
        self.root
    }

    /// The text of a file; `None` if the system does not give it.
    pub(crate) fn text(&self, path: &str) -> Option<String> {
        let path = self.path(path);
        // A pipe or a device in the place of a file could keep the reader waiting.
        if !path.metadata().ok()?.is_file() {
            return None;
        }
        let mut bytes = Vec::new();
        File::open(path)
            .ok()?
            .take(MOST)
            .read_to_end(&mut bytes)
            .ok()?;
        Some(String::from_utf8_lossy(&bytes).into_owned())
    }

    /// The text of a file without its blank ends; `None` if nothing is left.
    pub(crate) fn line(&self, path: &str) -> Option<String> {
        let text = self.text(path)?;
        let text = text.trim_matches(|c: char| c.is_whitespace() || c == '\0');
        (!text.is_empty()).then(|| text.to_owned())
    }

    /// The number in a file.
    pub(crate) fn number<T: std::str::FromStr>(&self, path: &str) -> Option<T> {
        self.line(path)?.parse().ok()
    }

    /// The cores that a file lists. The kernel writes `(null)` for an empty mask.
    pub(crate) fn cores_in(&self, path: &str) -> Option<Vec<usize>> {
        let text = self.text(path)?;
        if text.trim() == "(null)" {
            return Some(Vec::new());
        }
        parse_list(&text).ok()
    }

    /// The names in a folder, sorted; none if the system does not list it.
    pub(crate) fn names(&self, folder: &str) -> Vec<String> {
        let entries = std::fs::read_dir(self.path(folder)).into_iter().flatten();
        let names = entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
        let mut names: Vec<_> = names.collect();
        names.sort();
        names
    }

    /// A field of the status of this process (`proc_pid_status(5)`).
    pub(crate) fn status(&self, field: &str) -> Option<String> {
        let text = self.text("proc/self/status")?;
        let fields = text.lines().filter_map(|line| line.split_once(':'));
        let mut values = fields.filter(|(name, _)| *name == field);
        values.next().map(|(_, value)| value.trim().to_owned())
    }

    /// Whether this process has a capability, by its number in `capability.h`; `None` if the system does not tell.
    pub(crate) fn capable(&self, number: u32) -> Option<bool> {
        let sets = u64::from_str_radix(&self.status("CapEff")?, 16).ok()?;
        Some(sets >> number & 1 == 1)
    }

    /// The names of the running programs among `wanted`, without repetition.
    pub(crate) fn running(&self, wanted: &[&str]) -> Vec<&str> {
        let mut names: Vec<_> = self
            .processes
            .iter()
            .map(|(name, _)| name.as_str())
            .collect();
        names.retain(|name| wanted.contains(name));
        names.sort_unstable();
        names.dedup();
        names
    }

    /// Whether the kernel gives realtime budgets to control groups (CONFIG_RT_GROUP_SCHED).
    pub(crate) fn has_group_budgets(&self) -> bool {
        Group::below(self.root).runtime.is_some()
    }

    /// Major and minor version of the kernel.
    pub(crate) fn kernel(&self) -> Option<(u32, u32)> {
        let release = self.line("proc/sys/kernel/osrelease")?;
        let mut numbers = release.split(|c: char| !c.is_ascii_digit());
        Some((numbers.next()?.parse().ok()?, numbers.next()?.parse().ok()?))
    }

    /// The values of a parameter on the kernel's command line, in order.
    pub(crate) fn boot_values(&self, name: &str) -> Option<Vec<String>> {
        let line = self.text("proc/cmdline")?;
        let words = line
            .split_whitespace()
            .filter_map(|word| word.split_once('='));
        let values = words.filter(|(found, _)| *found == name);
        Some(values.map(|(_, value)| value.to_owned()).collect())
    }

    /// The online cores but the tick's.
    pub(crate) fn others(&self) -> Vec<usize> {
        let others = self.cores.online.iter().copied();
        others.filter(|core| *core != self.core).collect()
    }

    /// The other cores as the kernel lists them, if there are any.
    pub(crate) fn others_listed(&self) -> Option<String> {
        Some(list(&self.others())).filter(|list| !list.is_empty())
    }

    /// The step that gives the kernel a parameter at its start.
    pub(crate) fn kernel_parameter(&self, id: &str, name: &str, value: &str) -> Step {
        let given = self.boot_values(name).unwrap_or_default();
        if let Some(given) = given.last() {
            return Step::ByHand(format!(
                "change {name}={given} to {name}={value} in the configuration of the boot loader, which already has it"
            ));
        }
        if self.path("usr/sbin/update-grub").exists() {
            Step::kernel_parameter(id, &format!("{name}={value}"))
        } else {
            Step::ByHand(format!(
                "add {name}={value} to the kernel's command line in the configuration of the boot loader (on a Raspberry \
                 Pi: /boot/firmware/cmdline.txt), and restart the machine"
            ))
        }
    }
}
