//! `palpate settings`: prints the settings of the machine that hold, each with what gives it; and the flags of the commands
//! that tick in real time, which resolve the same settings.

use super::CommandError;
use super::outputs::{Declared, Format};
use super::sets::Values;
use host::atomic_file::write_json;
use host::run::RunOptions;
use host::scene::LoadedScene;
use host::scene::settings::{Flags, MachineFile, Settings};
use runner::Cores;
use serde::Serialize;
use std::path::PathBuf;

const EXAMPLES: &str = "\
A value comes from the first place that gives it: a flag, the table [machine] of the scene, the file of the machine, the
default. A settings file:
  tick.core = 3                     # or \"isolated\", \"last\", \"any\"
  tick.priority = 80
  tick.idle_sibling = true
  device_threads.cores = [1, 2]
  device_threads.priority = 45
  log.folder = \"/var/log/palpate\"
In a scene, the same tables stand under [machine]: machine.tick.core = 3

Examples:
  palpate settings                            print the settings of this machine
  palpate settings my_scene.toml --core 2     print the settings that a run with these arguments has";

/// Flags of a command that ticks in real time.
#[derive(Clone, Debug, Default, clap::Args)]
pub(super) struct MachineArguments {
    /// Real clock: the core that this program reserves for the tick, preferably an isolated one. Default: `tick.core` of
    /// the settings (`palpate settings`), or else the first isolated core, or without one the last core that this program
    /// may use
    #[arg(long, value_name = "N")]
    pub(super) core: Option<usize>,
    /// Real clock: priority of the tick under SCHED_FIFO, 1 to 99. Default: `tick.priority` of the settings, or else 80,
    /// which is above threaded interrupts (50) and below the kernel's own watchdogs (99)
    #[arg(long, value_name = "P", value_parser = priority)]
    pub(super) priority: Option<u8>,
    #[command(flatten)]
    file: SettingsFile,
}

/// The flag of a command that needs the settings of the machine.
#[derive(Clone, Debug, Default, clap::Args)]
pub(super) struct SettingsFile {
    /// File of the machine's settings. Default: /etc/palpate/palpate.toml, if it exists
    #[arg(long, value_name = "FILE")]
    pub(super) settings: Option<PathBuf>,
}

impl SettingsFile {
    /// The settings that hold without a scene.
    ///
    /// # Errors
    /// [`CommandError`] for a wrong file.
    pub(super) fn resolve(&self) -> Result<Settings, CommandError> {
        self.with(Flags::default(), None)
    }

    fn with(&self, flags: Flags, scene: Option<&LoadedScene>) -> Result<Settings, CommandError> {
        let cores = Cores::of_this_machine();
        let file = MachineFile::load(self.settings.as_deref())?;
        let runtime = std::env::var_os("RUNTIME_DIRECTORY").map(PathBuf::from);
        let settings = Settings::resolve(flags, scene, &file, runtime.as_deref(), &cores)?;
        if flags.core.is_some() {
            cores.check(settings.core.value)?;
        }
        Ok(settings)
    }
}

/// Parses a priority under SCHED_FIFO.
fn priority(text: &str) -> Result<u8, String> {
    let allowed = text.parse().ok().filter(|value| (1..=99).contains(value));
    allowed.ok_or_else(|| format!("found {text}, allowed: a whole number from 1 to 99"))
}

impl MachineArguments {
    /// The settings that hold for `scene`.
    ///
    /// # Errors
    /// [`CommandError`] for a wrong file, and for a core that the machine has not.
    pub(super) fn resolve(&self, scene: Option<&LoadedScene>) -> Result<Settings, CommandError> {
        let flags = Flags {
            core: self.core,
            priority: self.priority,
        };
        self.file.with(flags, scene)
    }
}

/// Gives the options of a run the settings.
pub(super) fn apply(settings: &Settings, options: &mut RunOptions) {
    options.runner.core = settings.core.value;
    options.runner.priority = Some(settings.priority.value);
    options.idle_sibling = settings.idle_sibling.value;
    options.device_threads = settings.device_threads();
}

/// Arguments of `palpate settings`.
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct SettingsArguments {
    /// Scene file (TOML). Default: no scene
    scene: Option<PathBuf>,
    #[command(flatten)]
    values: Values,
    #[command(flatten)]
    machine: MachineArguments,
    /// Write the settings as JSON as well
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// The JSON that `--json` writes.
#[derive(Serialize)]
pub(super) struct SettingsJson {
    /// Version of this layout.
    schema: &'static str,
    /// Each setting, in the order of the settings file.
    settings: Vec<SettingJson>,
}

/// A setting.
#[derive(Serialize)]
struct SettingJson {
    /// Its field in the settings file, such as `tick.core`.
    field: &'static str,
    /// Its value as a settings file writes it, or in words.
    value: String,
    /// What gives the value: `flag`, `environment`, `scene`, `machine` or `default`.
    from: &'static str,
    /// The flag, the variable of the environment, or the file with its line; `None` for a default.
    place: Option<String>,
}

impl SettingsJson {
    pub(super) fn of(settings: &Settings) -> Self {
        let settings = settings.rows().into_iter().map(|row| SettingJson {
            field: row.field,
            value: row.value,
            from: row.from.kind(),
            place: row.from.place(),
        });
        Self {
            schema: "palpate.settings/1",
            settings: settings.collect(),
        }
    }
}

pub(super) fn run(arguments: &SettingsArguments) -> Result<(), CommandError> {
    let scene = arguments.scene.as_deref();
    let loaded = scene
        .map(|path| arguments.values.load(Some(path), Vec::new()))
        .transpose()?;
    let mut declared = Declared::default();
    if let Some(loaded) = &loaded {
        declared = declared.scene(scene, loaded);
    }
    let _held = declared
        .file("--json", arguments.json.as_ref(), Format::Json)
        .check()?;
    let settings = arguments.machine.resolve(loaded.as_ref())?;
    for row in settings.rows() {
        outln!("  {:<24} {:<24} {}", row.field, row.value, row.from);
    }
    if let Some(path) = &arguments.json {
        write_json(path, &SettingsJson::of(&settings))?;
    }
    Ok(())
}
