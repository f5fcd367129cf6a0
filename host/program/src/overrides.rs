//! The arguments of `palpate run` that replace values of the scene.

use super::{CommandError, SceneArgument};
use host::scene::{LoadedScene, Override};

/// Values that replace values of the scene. The log holds the scene with the replaced values.
#[derive(Clone, Debug, Default, clap::Args)]
#[command(next_help_heading = "Values in place of those of the scene")]
pub(super) struct Overrides {
    /// Force scheme: hold, thesis, linear, proxy, classic or capped. Default: `loop.scheme` of the scene
    #[arg(long, value_name = "NAME", conflicts_with = "replay")]
    scheme: Option<String>,
    /// Rate of the tick, the haptic loop (Hz). Default: `loop.rate` of the scene
    #[arg(long, value_name = "HZ", conflicts_with = "replay")]
    rate: Option<f64>,
    /// Rate of the host's physics steps (Hz). Default: `host.step_rate` of the scene
    #[arg(long, value_name = "HZ", conflicts_with = "replay")]
    step_rate: Option<f64>,
    /// Rate at which the host publishes local models (Hz): the rate of the steps, divided by a whole number. Default:
    /// `host.publish_rate` of the scene
    #[arg(long, value_name = "HZ", conflicts_with = "replay")]
    publish_rate: Option<f64>,
    /// Virtual clock: time from reading the hands to the arrival of the model (s). Default: `host.latency` of the scene
    #[arg(long, value_name = "SECONDS", conflicts_with = "replay")]
    latency: Option<f64>,
    /// Arm the devices at the start, for a run that nobody attends. Default: `engage.arm` of each device in the scene; a
    /// real device waits to be armed
    #[arg(long, conflicts_with = "replay")]
    armed: bool,
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
        let armed = self
            .armed
            .then(|| ("--armed".to_owned(), Override::armed()));
        scheme.chain(numbers).chain(armed).collect()
    }

    /// The scene of the argument with these values. Prints the warnings about the scene.
    pub(super) fn load(&self, scene: &SceneArgument) -> Result<LoadedScene, CommandError> {
        scene.values.load(scene.scene.as_deref(), self.given())
    }
}
