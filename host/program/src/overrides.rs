//! The arguments of `palpate run` that replace values of the scene.

use super::{CommandError, load};
use host::scene::{LoadedScene, Override, Scene};
use std::path::Path;

/// Values that replace values of the scene. The log holds the scene with the replaced values.
#[derive(Clone, Debug, Default, clap::Args)]
#[command(next_help_heading = "Values in place of those of the scene")]
pub(super) struct Overrides {
    /// Force scheme: hold, thesis, linear, proxy, classic or capped. Default: `loop.scheme` of the scene
    #[arg(long, value_name = "NAME", conflicts_with = "replay")]
    scheme: Option<String>,
    /// Rate of the tick, the haptic loop (Hz). Default: `loop.rate` of the scene
    #[arg(
        long,
        value_name = "HZ",
        conflicts_with = "replay",
        allow_negative_numbers = true
    )]
    rate: Option<f64>,
    /// Rate of the host's physics steps (Hz). Default: `host.step_rate` of the scene
    #[arg(
        long,
        value_name = "HZ",
        conflicts_with = "replay",
        allow_negative_numbers = true
    )]
    step_rate: Option<f64>,
    /// Rate at which the host publishes local models (Hz): the rate of the steps, divided by a whole number. Default:
    /// `host.publish_rate` of the scene
    #[arg(
        long,
        value_name = "HZ",
        conflicts_with = "replay",
        allow_negative_numbers = true
    )]
    publish_rate: Option<f64>,
    /// Virtual clock: time from reading the hands to the arrival of the model (s). Default: `host.latency` of the scene
    #[arg(
        long,
        value_name = "SECONDS",
        conflicts_with = "replay",
        allow_negative_numbers = true
    )]
    latency: Option<f64>,
    /// Connection of a device: `left=sim` simulates the device `left` (its hand is the scene's, or holds still), and
    /// `left=hid:1209:c0de` opens a real device. May be given several times. Default: `connect` of the device in the
    /// scene
    #[arg(long = "device", value_name = "NAME=CONNECT", value_parser = named_connection, conflicts_with = "replay")]
    devices: Vec<(String, String)>,
    /// Arm the devices at the start, for a run that nobody attends. Default: `engage.arm` of each device in the scene; a
    /// real device waits to be armed
    #[arg(long, conflicts_with = "replay")]
    armed: bool,
}

/// Parses `NAME=CONNECT`.
fn named_connection(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((name, to)) if !name.is_empty() && !to.is_empty() => {
            Ok((name.to_owned(), to.to_owned()))
        }
        _ => Err(format!(
            "found {text}, allowed: the name of a device and its connection, such as left=sim"
        )),
    }
}

impl Overrides {
    /// Whether the latency is replaced.
    pub(super) fn has_latency(&self) -> bool {
        self.latency.is_some()
    }

    /// Each argument that is given, as the user writes it, and its field.
    fn given(&self) -> Vec<(String, Override)> {
        let numbers = [
            ("--rate", "loop", "rate", self.rate),
            ("--step-rate", "host", "step_rate", self.step_rate),
            ("--publish-rate", "host", "publish_rate", self.publish_rate),
            ("--latency", "host", "latency", self.latency),
        ];
        let scheme = self.scheme.iter().map(|name| {
            let flag = format!("--scheme {name}");
            (flag, Override::word("loop", "scheme", name))
        });
        let numbers = numbers
            .into_iter()
            .filter_map(|(flag, table, name, value)| {
                let value = value?;
                let field = Override::number(table, name, value);
                Some((format!("{flag} {value}"), field))
            });
        let devices = self.devices.iter().map(|(name, to)| {
            let flag = format!("--device {name}={to}");
            (flag, Override::connection(name, to))
        });
        let armed = self
            .armed
            .then(|| ("--armed".to_owned(), Override::armed()));
        scheme.chain(numbers).chain(devices).chain(armed).collect()
    }

    /// Checks that every device whose connection is given exists.
    fn check_devices(&self, scene: &LoadedScene) -> Result<(), CommandError> {
        let known = &scene.scene.devices;
        let missing = self
            .devices
            .iter()
            .find(|(name, _)| known.iter().all(|device| device.name != *name));
        match missing {
            None => Ok(()),
            Some((name, to)) => Err(CommandError::NoSuchDevice {
                given: format!("--device {name}={to}"),
                found: name.clone(),
                allowed: known
                    .iter()
                    .map(|device| format!("{:?}", device.name))
                    .collect::<Vec<_>>()
                    .join(", "),
            }),
        }
    }

    /// The scene at `path`, or the built-in one, with these values. Prints what is possible in the scene, but unlikely.
    pub(super) fn load(&self, path: Option<&Path>) -> Result<LoadedScene, CommandError> {
        let (flags, fields): (Vec<_>, Vec<_>) = self.given().into_iter().unzip();
        if fields.is_empty() {
            return Ok(load(path)?);
        }
        let original = path.map_or_else(Scene::embedded_default, Scene::load)?;
        self.check_devices(&original)?;
        let loaded = original
            .overridden(&fields)
            .map_err(|source| CommandError::Override {
                given: flags.join(" "),
                source,
            })?;
        for warning in host::bodies::warnings(&loaded) {
            errln!("warning: {warning}");
        }
        Ok(loaded)
    }
}
