//! `palpate device list`: what is connected.

use super::super::CommandError;
use super::super::outputs::{Declared, Format};
use devices::found::{self, Found};
use host::atomic_file::write_json;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Arguments of `palpate device list`.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct ListArguments {
    /// Also list keyboards, mice and joysticks
    #[arg(long)]
    all: bool,
    /// Write the list as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// The JSON that `--json` writes.
#[derive(Serialize)]
struct DeviceList {
    /// Version of this layout.
    schema: &'static str,
    /// The devices, by connection.
    devices: Vec<ListedDevice>,
}

/// A device that is connected.
#[derive(Serialize)]
struct ListedDevice {
    /// The connection that a scene names.
    connect: String,
    /// Name of the device, as it states it.
    name: String,
    /// Serial number; empty if the device states none.
    serial: String,
    /// The port of USB, which stays when the device is plugged in again; empty for a device on another bus.
    port: String,
    /// The file of the device.
    file: String,
    /// Whether the device is behind a hub, which it shares with other devices.
    behind_hub: bool,
    /// Why the device cannot be opened; `None` if it can.
    trouble: Option<String>,
}

pub(super) fn run(arguments: &ListArguments) -> Result<(), CommandError> {
    let _held = Declared::default()
        .file("--json", arguments.json.as_ref(), Format::Json)
        .check()?;
    let mut all = found::list(Path::new("/"));
    let inputs = all.iter().filter(|found| found.input).count();
    if !arguments.all {
        all.retain(|found| !found.input);
    }
    for device in &all {
        outln!("{}", device.connect);
        outln!("  {:<10} {}", "name", device.name);
        outln!("  {:<10} {}", "file", device.file.display());
        if !device.port.is_empty() {
            outln!("  {:<10} USB {}", "port", device.port);
        }
        if device.behind_hub {
            outln!(
                "  {:<10} shared with other devices, which may delay it",
                "hub"
            );
        }
        match &device.trouble {
            None => outln!("  {:<10} yes", "usable"),
            Some(trouble) => outln!("  {:<10} no: {trouble}", "usable"),
        }
    }
    if all.is_empty() {
        outln!(
            "no haptic device is connected. Check cables and power; in a container or virtual machine, check that USB \
             devices are passed on"
        );
    }
    if inputs > 0 && !arguments.all {
        outln!("{inputs} keyboards, mice and joysticks are left out (--all lists them)");
    }
    if let Some(path) = &arguments.json {
        let list = DeviceList {
            schema: "palpate.devices/1",
            devices: all.into_iter().map(listed).collect(),
        };
        write_json(path, &list)?;
    }
    Ok(())
}

fn listed(found: Found) -> ListedDevice {
    ListedDevice {
        connect: found.connect,
        name: found.name,
        serial: found.serial,
        port: found.port,
        file: found.file.display().to_string(),
        behind_hub: found.behind_hub,
        trouble: found.trouble.map(|trouble| trouble.to_string()),
    }
}
