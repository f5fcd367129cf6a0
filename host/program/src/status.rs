//! `palpate status`: asks a program that serves.

use super::CommandError;
use super::outputs::{Declared, Format};
use super::serve::status::{Status, ask};
use super::settings::SettingsFile;
use host::atomic_file::write_json;
use std::path::PathBuf;

/// Arguments of `palpate status`.
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = "Exit codes: 0 if ticks advance, 1 if no program answers or its run waits.")]
pub(super) struct StatusArguments {
    /// The socket of the program. Default: `serve.socket` of the settings, or else /run/palpate/status.sock
    #[arg(long, value_name = "SOCKET")]
    socket: Option<PathBuf>,
    #[command(flatten)]
    file: SettingsFile,
    /// Write the answer as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

pub(super) fn run(arguments: &StatusArguments) -> Result<(), CommandError> {
    let _held = Declared::default()
        .file("--json", arguments.json.as_ref(), Format::Json)
        .check()?;
    let path = match &arguments.socket {
        Some(path) => path.clone(),
        None => arguments.file.resolve()?.socket.value,
    };
    let status = ask(&path).map_err(|source| CommandError::NotServed { path, source })?;
    status.print();
    if let Some(path) = &arguments.json {
        write_json(path, &status)?;
    }
    if status.state == "running" {
        Ok(())
    } else {
        Err(CommandError::NotRunning(status.state))
    }
}

impl Status {
    fn print(&self) {
        outln!(
            "{}: {}, {:.0} s since the start of the program",
            self.scene,
            self.state,
            self.uptime
        );
        outln!(
            "  ticks      {}, {} deadlines skipped, woke at most {:.0} µs late",
            self.ticks,
            self.skipped,
            1e6 * self.longest_lateness
        );
        for device in &self.devices {
            let state = if device.fresh { "" } else { ", no state" };
            outln!("  device     {}: {}{state}", device.name, device.safety);
        }
        match &self.logs {
            Some(folder) => outln!("  logs       {} ticks in {}", self.logged, folder.display()),
            None => outln!("  logs       none"),
        }
        if let Some(failure) = &self.last_failure {
            outln!("  ! {failure}");
        }
    }
}
