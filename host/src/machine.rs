//! The machine on which a program runs, as a paper states it: processor, kernel, clock, and the settings that delay a core
//! (frequency governor, sleep states).
//!
//! All facts come from files of the Linux kernel (`Documentation/admin-guide/pm`, `/proc/cpuinfo`) and from
//! `/etc/os-release`. A fact that the system does not give is absent, never guessed.

use runner::Cores;
use serde::Serialize;
use std::fmt;
use std::fs::read_to_string;
use std::path::Path;

/// Facts about program and machine.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Machine {
    /// Version of the program.
    pub version: &'static str,
    /// Commit from which the program was built, with `+` if its sources had changed since; `None` if it was built
    /// outside of a repository.
    pub commit: Option<&'static str>,
    /// Architecture and the vector instructions in use. Two runs under virtual time give equal bytes if these and the
    /// program are equal.
    pub instructions: String,
    /// Model of the processor; `None` if the system does not tell.
    pub processor: Option<String>,
    /// Number of cores that are online, hardware threads included; zero if the system does not tell.
    pub cores: usize,
    /// The cores that the kernel isolates, as the kernel lists them.
    pub isolated_cores: String,
    /// Whether two hardware threads share a core; `None` if the system does not tell.
    pub shared_cores: Option<bool>,
    /// Whether the machine is a virtual one, whose hypervisor may stop it at any time.
    pub virtual_machine: bool,
    /// Release and build of the kernel, such as `6.1.0-rt #1 SMP PREEMPT_RT`.
    pub kernel: Option<String>,
    /// The command line of the kernel.
    pub command_line: Option<String>,
    /// The operating system.
    pub system: Option<String>,
    /// The hardware behind the monotonic clock, such as `tsc`.
    pub clock_source: Option<String>,
    /// Frequency governor of the tick's core, or of the first core if the tick has none; `None` if the system
    /// does not scale frequencies.
    pub governor: Option<String>,
    /// Sleep states that the same core may enter, each with the time that it takes to wake (us).
    pub sleep_states: Vec<String>,
}

impl Machine {
    /// This machine. `core` is the core of the tick, if it has one of its own; `instructions` those in use.
    pub fn here(commit: Option<&'static str>, instructions: String, core: Option<usize>) -> Self {
        let cores = Cores::of_this_machine();
        Self::read(Path::new("/"), &cores, commit, instructions, core)
    }

    /// The machine whose files are below `root`.
    fn read(
        root: &Path,
        cores: &Cores,
        commit: Option<&'static str>,
        instructions: String,
        core: Option<usize>,
    ) -> Self {
        let line = |path: &str| {
            let text = read_to_string(root.join(path)).ok()?;
            // The device tree ends its texts with a zero.
            let text = text.trim_matches(|c: char| c.is_whitespace() || c == '\0');
            (!text.is_empty()).then(|| text.to_owned())
        };
        let cpuinfo = line("proc/cpuinfo").unwrap_or_default();
        let release = line("proc/sys/kernel/osrelease");
        let build = line("proc/sys/kernel/version");
        let core = core.or(cores.online.first().copied()).unwrap_or(0);
        let of_core = format!("sys/devices/system/cpu/cpu{core}");
        Self {
            version: env!("CARGO_PKG_VERSION"),
            commit,
            instructions,
            processor: field(&cpuinfo, "model name").or_else(|| line("proc/device-tree/model")),
            cores: cores.online.len(),
            isolated_cores: runner::cores::list(&cores.isolated),
            shared_cores: line("sys/devices/system/cpu/smt/active").map(|active| active == "1"),
            virtual_machine: field(&cpuinfo, "flags")
                .is_some_and(|flags| flags.split(' ').any(|flag| flag == "hypervisor")),
            kernel: release.map(|release| match build {
                Some(build) => format!("{release} {}", without_date(&build)),
                None => release,
            }),
            command_line: line("proc/cmdline"),
            system: line("etc/os-release").and_then(|text| pretty_name(&text)),
            clock_source: line("sys/devices/system/clocksource/clocksource0/current_clocksource"),
            governor: line(&format!("{of_core}/cpufreq/scaling_governor")),
            sleep_states: sleep_states(&|path| line(&format!("{of_core}/cpuidle/{path}"))),
        }
    }
}

/// The value of the first `name : value` in a text of `/proc`.
fn field(text: &str, name: &str) -> Option<String> {
    let mut fields = text.lines().filter_map(|line| line.split_once(':'));
    let (_, value) = fields.find(|(found, _)| found.trim() == name)?;
    let value = value.trim();
    (!value.is_empty()).then(|| value.to_owned())
}

/// A kernel's build without its date: `#1 SMP PREEMPT_RT Debian 6.1.1 (2024-01-01)` to `#1 SMP PREEMPT_RT`. The words
/// in capitals name what matters for latency.
fn without_date(build: &str) -> String {
    let words = build.split_whitespace();
    let kept: Vec<_> = words
        .take_while(|word| {
            let capital = |c: char| c.is_ascii_uppercase() || c == '_';
            word.starts_with('#') || word.chars().all(capital)
        })
        .collect();
    kept.join(" ")
}

/// The name in `/etc/os-release` (`os-release(5)`).
fn pretty_name(text: &str) -> Option<String> {
    let mut lines = text.lines();
    let value = lines.find_map(|line| line.strip_prefix("PRETTY_NAME="))?;
    Some(value.trim_matches(['"', '\'']).to_owned())
}

/// The enabled sleep states of a core. `line` reads the files of its folder `cpuidle`.
fn sleep_states(line: &dyn Fn(&str) -> Option<String>) -> Vec<String> {
    let states = (0..).map_while(|number| {
        let of = |name: &str| line(&format!("state{number}/{name}"));
        let name = of("name")?;
        let enabled = of("disable").is_none_or(|disabled| disabled == "0");
        Some(enabled.then(|| match of("latency") {
            Some(latency) => format!("{name} ({latency} us)"),
            None => name,
        }))
    });
    states.flatten().collect()
}

impl fmt::Display for Machine {
    /// Version and processor, which matter under either clock.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "palpate {}", self.version)?;
        if let Some(commit) = self.commit {
            write!(f, " ({commit})")?;
        }
        let processor = self.processor.as_deref().unwrap_or("unknown processor");
        write!(f, ", {processor}")
    }
}

impl Machine {
    /// The rest of the facts in a line, for a run under the real clock.
    pub(crate) fn surroundings(&self) -> String {
        let mut parts = vec![match self.cores {
            1 => "1 core".to_owned(),
            cores => format!("{cores} cores"),
        }];
        if self.virtual_machine {
            parts.push("virtual machine".to_owned());
        }
        let named = [
            ("Linux ", &self.kernel),
            ("", &self.system),
            ("clock ", &self.clock_source),
            ("governor ", &self.governor),
        ];
        for (name, fact) in named {
            parts.extend(fact.as_ref().map(|fact| format!("{name}{fact}")));
        }
        if !self.sleep_states.is_empty() {
            parts.push(format!("sleep states {}", self.sleep_states.join(" / ")));
        }
        parts.join(", ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::error::Error;
    use std::fs::{create_dir_all, write};

    /// A machine from the files of a system: a path and a text each.
    fn machine(files: &[(&str, &str)], core: Option<usize>) -> Result<Machine, Box<dyn Error>> {
        let root = tempfile::tempdir()?;
        for (path, text) in files {
            let path = root.path().join(path);
            create_dir_all(path.parent().ok_or("a folder")?)?;
            write(path, text)?;
        }
        let cores = Cores::new(vec![0, 1, 2, 3], vec![2, 3]);
        let instructions = "x86_64+avx2".to_owned();
        Ok(Machine::read(
            root.path(),
            &cores,
            Some("abc"),
            instructions,
            core,
        ))
    }

    #[test]
    fn the_facts_of_a_pc_are_read() -> Result<(), Box<dyn Error>> {
        let cpu = "sys/devices/system/cpu/cpu3";
        let state = |number: u8, name: &str| format!("{cpu}/cpuidle/state{number}/{name}");
        let files = [
            (
                "proc/cpuinfo",
                "processor\t: 0\nmodel name\t: Intel(R) Core(TM) i7\nflags\t\t: fpu sse hypervisors\n\n\
                 processor\t: 1\nmodel name\t: other\n",
            ),
            ("proc/sys/kernel/osrelease", "6.1.0-18-rt-amd64\n"),
            (
                "proc/sys/kernel/version",
                "#1 SMP PREEMPT_RT Debian 6.1.76-1 (2024-02-01)\n",
            ),
            (
                "etc/os-release",
                "NAME=\"Debian\"\nPRETTY_NAME=\"Debian GNU/Linux 12 (bookworm)\"\n",
            ),
            ("sys/devices/system/cpu/smt/active", "0\n"),
            (
                "sys/devices/system/clocksource/clocksource0/current_clocksource",
                "tsc\n",
            ),
            (&format!("{cpu}/cpufreq/scaling_governor"), "performance\n"),
            (&state(0, "name"), "POLL\n"),
            (&state(0, "disable"), "0\n"),
            (&state(0, "latency"), "0\n"),
            (&state(1, "name"), "C1E\n"),
            (&state(1, "disable"), "1\n"),
            (&state(1, "latency"), "10\n"),
            (&state(2, "name"), "C6\n"),
        ];
        let machine = machine(&files, Some(3))?;
        assert_eq!(machine.processor.as_deref(), Some("Intel(R) Core(TM) i7"));
        assert!(!machine.virtual_machine);
        assert_eq!((machine.cores, machine.isolated_cores.as_str()), (4, "2-3"));
        assert_eq!(machine.shared_cores, Some(false));
        assert_eq!(machine.sleep_states, ["POLL (0 us)", "C6"]);
        assert_eq!(
            machine.to_string(),
            format!(
                "palpate {} (abc), Intel(R) Core(TM) i7",
                env!("CARGO_PKG_VERSION")
            )
        );
        assert_eq!(
            machine.surroundings(),
            "4 cores, Linux 6.1.0-18-rt-amd64 #1 SMP PREEMPT_RT, Debian GNU/Linux 12 (bookworm), clock tsc, governor \
             performance, sleep states POLL (0 us) / C6"
        );
        Ok(())
    }

    #[test]
    fn what_a_system_does_not_tell_is_absent() -> Result<(), Box<dyn Error>> {
        // A board whose `cpuinfo` names no model, and the text of a device tree.
        let board = [
            ("proc/cpuinfo", "processor\t: 0\nBogoMIPS\t: 108.00\n"),
            ("proc/device-tree/model", "Raspberry Pi 5\0"),
        ];
        let machine_of_board = machine(&board, None)?;
        assert_eq!(
            machine_of_board.processor.as_deref(),
            Some("Raspberry Pi 5")
        );
        let nothing = machine(&[], None)?;
        assert!(nothing.to_string().ends_with("unknown processor"));
        assert_eq!(nothing.surroundings(), "4 cores");
        assert_eq!((nothing.kernel, nothing.shared_cores), (None, None));
        let virtual_one = machine(&[("proc/cpuinfo", "flags : fpu hypervisor\n")], None)?;
        assert!(virtual_one.virtual_machine);
        Ok(())
    }
}
