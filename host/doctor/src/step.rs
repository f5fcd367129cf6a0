//! A step that mends: one change of the machine that lasts, with the commands that make it and undo it.
//!
//! Every step writes a file of its own, named after its check, so the files of several scripts add up. The formats are
//! those of grub-mkconfig (`/etc/default/grub.d`, Debian), `sysctl.d(5)`, `limits.d` (`pam_limits(8)`), `udev(7)` and
//! `systemd.service(5)`.

/// One change of the machine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Step {
    /// A file with this text. The text comes from the program and from numbers, never from a device.
    File {
        /// Absolute path.
        path: String,
        /// The whole text.
        text: String,
    },
    /// A systemd unit that never starts.
    Mask(&'static str),
    /// A package of Debian.
    Package(String),
    /// A group of accounts.
    Group(&'static str),
    /// Work for a person, as a sentence. The text may hold names that the machine gave.
    ByHand(String),
}

impl Step {
    /// A parameter of the kernel's command line, for the check `id`. Rescue entries of the boot menu stay without it.
    pub(crate) fn kernel_parameter(id: &str, parameter: &str) -> Self {
        Self::File {
            path: format!("/etc/default/grub.d/palpate-{id}.cfg"),
            text: format!(
                "GRUB_CMDLINE_LINUX_DEFAULT=\"$GRUB_CMDLINE_LINUX_DEFAULT {parameter}\"\n"
            ),
        }
    }

    /// Kernel settings that `sysctl` applies at every start: lines of `name = value`.
    pub(crate) fn sysctl(id: &str, lines: &str) -> Self {
        Self::File {
            path: format!("/etc/sysctl.d/90-palpate-{id}.conf"),
            text: format!("{lines}\n"),
        }
    }

    /// A rule of udev. The number is below 73 (see `usb::rules`).
    pub(crate) fn udev(id: &str, rule: &str) -> Self {
        Self::File {
            path: format!("/etc/udev/rules.d/70-palpate-{id}.rules"),
            text: format!("{rule}\n"),
        }
    }

    /// Limits of the accounts in the group `realtime`, and the group.
    pub(crate) fn limit(id: &str, limit: &str) -> Vec<Self> {
        let file = Self::File {
            path: format!("/etc/security/limits.d/palpate-{id}.conf"),
            text: format!("@{GROUP} - {limit}\n"),
        };
        vec![Self::Group(GROUP), file, Self::join_group()]
    }

    /// The membership in the group `realtime`, which a script cannot know the account for.
    pub(crate) fn join_group() -> Self {
        Self::ByHand(format!(
            "add your account to the group (`sudo usermod -aG {GROUP} $USER`) and log in again"
        ))
    }

    /// A command of the shell at every start of the machine, without single quotes: a unit, and the link that enables
    /// the unit by its folder of wants.
    pub(crate) fn at_start(id: &str, command: &str) -> Self {
        // systemd expands `$` and `%`.
        let command = command.replace('%', "%%").replace('$', "$$");
        Self::File {
            path: format!("/etc/systemd/system/palpate-{id}.service"),
            text: format!(
                "[Unit]\nDescription=Palpate: {id}\nAfter=sys-kernel-debug.mount\n\n[Service]\nType=oneshot\n\
                 ExecStart=/bin/sh -c '{command}'\n\n[Install]\nWantedBy=multi-user.target\n"
            ),
        }
    }

    /// The unit that the step installs and that must be enabled.
    pub(crate) fn unit(&self) -> Option<&str> {
        match self {
            Self::File { path, .. } => path
                .strip_prefix("/etc/systemd/system/")
                .filter(|name| name.ends_with(".service")),
            _ => None,
        }
    }

    /// The command by which the change takes effect, after it is made or undone.
    pub(crate) fn reload(&self) -> Option<&'static str> {
        let Self::File { path, .. } = self else {
            return matches!(self, Self::Mask(_)).then_some("systemctl daemon-reload");
        };
        let commands = [
            ("/etc/default/grub.d/", "update-grub"),
            ("/etc/sysctl.d/", "sysctl --system"),
            ("/etc/udev/rules.d/", "udevadm control --reload"),
            ("/etc/systemd/system/", "systemctl daemon-reload"),
        ];
        let command = commands.iter().find(|(begin, _)| path.starts_with(begin));
        command.map(|(_, command)| *command)
    }

    /// The command or the sentence that mends.
    pub fn mend(&self) -> String {
        let command = match self {
            Self::File { path, text } => {
                let text = text.trim_end().replace('\'', "'\\''").replace('\n', "\\n");
                // `printf %b` reads the ends of lines.
                format!("printf '%b\\n' '{text}' | sudo install -D -m 644 /dev/stdin {path}")
            }
            Self::Mask(unit) => format!("sudo systemctl mask {unit}"),
            Self::Package(name) => format!("sudo apt-get install {name}"),
            Self::Group(name) => format!("sudo groupadd --force --system {name}"),
            Self::ByHand(text) => return text.clone(),
        };
        let enable = self
            .unit()
            .map(|unit| format!("sudo systemctl enable --now {unit}"));
        joined([Some(command), self.reload_by_sudo(), enable])
    }

    /// The command that undoes; `None` if a person must.
    pub fn undo(&self) -> Option<String> {
        let command = match self {
            Self::File { path, .. } => format!("sudo rm {path}"),
            Self::Mask(unit) => format!("sudo systemctl unmask {unit}"),
            Self::Package(name) => format!("sudo apt-get remove {name}"),
            Self::Group(name) => format!("sudo groupdel {name}"),
            Self::ByHand(_) => return None,
        };
        let disable = self
            .unit()
            .map(|unit| format!("sudo systemctl disable {unit}"));
        Some(joined([disable, Some(command), self.reload_by_sudo()]))
    }

    fn reload_by_sudo(&self) -> Option<String> {
        self.reload().map(|command| format!("sudo {command}"))
    }
}

/// The group whose accounts may run a realtime loop, as the book names it.
pub(crate) const GROUP: &str = "realtime";

/// Commands one after the other.
fn joined(commands: [Option<String>; 3]) -> String {
    let commands: Vec<_> = commands.into_iter().flatten().collect();
    commands.join(" && ")
}
