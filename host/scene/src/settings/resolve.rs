//! From flags, scene and file to the values that hold, each with its origin.

use super::spec::{CoreName, MachineTables, Serve};
use super::{Machine, MachineFile};
use crate::error::{SceneError, SourceLocation};
use crate::load::LoadedScene;
use crate::source::Source;
use runner::schedule::{DEFAULT_PRIORITY, DEVICE_PRIORITY};
use runner::{CoreChoice, Cores, ThreadPlace};
use std::fmt;
use std::path::{Path, PathBuf};

/// The socket of `palpate status`, if neither the settings nor the service manager name one.
const SOCKET: &str = "/run/palpate/status.sock";

/// What gives a value.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Origin {
    /// This flag of the command.
    Flag(&'static str),
    /// This variable of the environment, which the service manager sets.
    Environment(&'static str),
    /// The scene, at this line.
    Scene(SourceLocation),
    /// The file of the machine's settings, at this line.
    Machine(SourceLocation),
    /// Nothing: it is the default.
    Default,
}

impl Origin {
    /// The kind of the origin, in a word.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Flag(_) => "flag",
            Self::Environment(_) => "environment",
            Self::Scene(_) => "scene",
            Self::Machine(_) => "machine",
            Self::Default => "default",
        }
    }

    /// The flag, the variable, or the file with its line; `None` for a default.
    pub fn place(&self) -> Option<String> {
        match self {
            Self::Flag(name) | Self::Environment(name) => Some((*name).to_owned()),
            Self::Scene(at) | Self::Machine(at) => Some(format!("{}:{}", at.file, at.line)),
            Self::Default => None,
        }
    }
}

impl fmt::Display for Origin {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.place() {
            Some(place) => write!(to, "{}, {place}", self.kind()),
            None => to.write_str(self.kind()),
        }
    }
}

/// A value, and what gives it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Setting<T> {
    /// The value.
    pub value: T,
    /// What gives the value.
    pub from: Origin,
}

/// The settings that flags of a command give.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Flags {
    /// `--core`.
    pub core: Option<usize>,
    /// `--priority`.
    pub priority: Option<u8>,
}

/// The values that hold.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// The core of the tick.
    pub core: Setting<CoreChoice>,
    /// The priority of the tick under SCHED_FIFO.
    pub priority: Setting<u8>,
    /// Whether the siblings of the tick's core stay idle.
    pub idle_sibling: Setting<bool>,
    /// The cores of the devices' threads; empty: any but the tick's.
    pub device_cores: Setting<Vec<usize>>,
    /// The priority of the devices' threads under SCHED_FIFO.
    pub device_priority: Setting<u8>,
    /// The folder of logs; empty: the working directory.
    pub log_folder: Setting<PathBuf>,
    /// The scene of `palpate serve`; `None`: the built-in scene.
    pub serve_scene: Setting<Option<PathBuf>>,
    /// Whether `palpate serve` logs.
    pub serve_log: Setting<bool>,
    /// Size at which a log of `palpate serve` is finished (MiB).
    pub file_mib: Setting<u64>,
    /// Age at which a log of `palpate serve` is finished (min).
    pub file_minutes: Setting<u64>,
    /// Size of all logs of `palpate serve` (MiB).
    pub total_mib: Setting<u64>,
    /// Time after which `palpate serve` tries again (s).
    pub retry: Setting<f64>,
    /// The socket of `palpate status`.
    pub socket: Setting<PathBuf>,
}

/// One value as `palpate settings` prints it.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// The field, such as `tick.core`.
    pub field: &'static str,
    /// The value, as a settings file writes it or in words.
    pub value: String,
    /// What gives the value.
    pub from: Origin,
}

/// What a place gives: its tables, and its text.
struct Layer<'a> {
    tables: MachineTables,
    source: &'a Source,
    /// What stands before the fields in this place.
    prefix: &'static str,
    origin: fn(SourceLocation) -> Origin,
}

impl Layer<'_> {
    fn origin(&self, field: &str) -> Origin {
        (self.origin)(self.source.location(&format!("{}{field}", self.prefix)))
    }
}

/// The first value that the layers give.
fn first<T>(
    layers: &[Layer<'_>],
    field: &str,
    flag: Option<(&'static str, T)>,
    get: impl Fn(&MachineTables) -> Option<T>,
    default: T,
) -> Setting<T> {
    if let Some((name, value)) = flag {
        return Setting {
            value,
            from: Origin::Flag(name),
        };
    }
    let mut given = layers.iter().filter_map(|layer| {
        let value = get(&layer.tables)?;
        let from = layer.origin(field);
        Some(Setting { value, from })
    });
    given.next().unwrap_or(Setting {
        value: default,
        from: Origin::Default,
    })
}

impl From<CoreName> for CoreChoice {
    fn from(name: CoreName) -> Self {
        match name {
            CoreName::Isolated => Self::Isolated,
            CoreName::Last => Self::Last,
            CoreName::Any => Self::Anywhere,
            CoreName::Number(number) => Self::Id(number),
        }
    }
}

impl Settings {
    /// The values that hold for a command with `flags`, a scene and the file of the machine. `runtime` is the folder that
    /// the service manager made for sockets (`RUNTIME_DIRECTORY`).
    ///
    /// # Errors
    /// [`SceneError`] for a core that `cores` has not, if the scene or the file names it. The caller checks the core of a
    /// flag.
    pub fn resolve(
        flags: Flags,
        scene: Option<&LoadedScene>,
        file: &MachineFile,
        runtime: Option<&Path>,
        cores: &Cores,
    ) -> Result<Self, SceneError> {
        let scene = scene.map(|loaded| Layer {
            tables: loaded.scene.machine.clone(),
            source: &loaded.source,
            prefix: "machine.",
            origin: Origin::Scene,
        });
        let Machine {
            tick,
            device_threads,
            log,
            ..
        } = file.machine.clone();
        let machine = Layer {
            tables: MachineTables {
                tick,
                device_threads,
                log,
            },
            source: &file.source,
            prefix: "",
            origin: Origin::Machine,
        };
        let layers: Vec<_> = scene.into_iter().chain([machine]).collect();
        for layer in &layers {
            layer.check(cores)?;
        }
        let core = first(
            &layers,
            "tick.core",
            flags.core.map(|n| ("--core", CoreChoice::Id(n))),
            |given| given.tick.core.map(CoreChoice::from),
            CoreChoice::default(),
        );
        let priority = first(
            &layers,
            "tick.priority",
            flags.priority.map(|p| ("--priority", p)),
            |given| given.tick.priority,
            DEFAULT_PRIORITY,
        );
        let idle_sibling = first(
            &layers,
            "tick.idle_sibling",
            None,
            |given| given.tick.idle_sibling,
            true,
        );
        let device_cores = first(
            &layers,
            "device_threads.cores",
            None,
            |given| given.device_threads.cores.clone(),
            Vec::new(),
        );
        let device_priority = first(
            &layers,
            "device_threads.priority",
            None,
            |given| given.device_threads.priority,
            DEVICE_PRIORITY,
        );
        let log_folder = first(
            &layers,
            "log.folder",
            None,
            |given| given.log.folder.clone(),
            PathBuf::new(),
        );
        let served = Served(file);
        let mut socket = served.first("socket", |serve| serve.socket.clone(), SOCKET.into());
        if let Some(folder) = runtime.filter(|_| socket.from == Origin::Default) {
            socket = Setting {
                value: folder.join("status.sock"),
                from: Origin::Environment("RUNTIME_DIRECTORY"),
            };
        }
        let scene = |serve: &Serve| serve.scene.as_ref().map(|path| Some(file.beside(path)));
        Ok(Self {
            core,
            priority,
            idle_sibling,
            device_cores,
            device_priority,
            log_folder,
            serve_scene: served.first("scene", scene, None),
            serve_log: served.first("log", |serve| serve.log, true),
            file_mib: served.first("file_mib", |serve| serve.file_mib, 256),
            file_minutes: served.first("file_minutes", |serve| serve.file_minutes, 60),
            total_mib: served.first("total_mib", |serve| serve.total_mib, 10_240),
            retry: served.first("retry", |serve| serve.retry, 1.0),
            socket,
        })
    }

    /// Where the threads of the devices run.
    pub fn device_threads(&self) -> ThreadPlace {
        ThreadPlace {
            cores: self.device_cores.value.clone(),
            priority: self.device_priority.value,
        }
    }

    /// The place of a log that a command names `path`: a relative path lies in the folder of logs.
    pub fn log(&self, path: &Path) -> PathBuf {
        self.log_folder.value.join(path)
    }

    /// Each value, in the order of the settings file.
    pub fn rows(&self) -> Vec<Row> {
        fn row<T>(field: &'static str, setting: &Setting<T>, say: impl Fn(&T) -> String) -> Row {
            Row {
                field,
                value: say(&setting.value),
                from: setting.from.clone(),
            }
        }
        let path = |path: &PathBuf| format!("{:?}", path.display().to_string());
        vec![
            row("tick.core", &self.core, |core| match core {
                CoreChoice::Isolated => "\"isolated\"".into(),
                CoreChoice::Last => "\"last\"".into(),
                CoreChoice::Anywhere => "\"any\"".into(),
                CoreChoice::Id(number) => number.to_string(),
            }),
            row("tick.priority", &self.priority, u8::to_string),
            row("tick.idle_sibling", &self.idle_sibling, bool::to_string),
            row(
                "device_threads.cores",
                &self.device_cores,
                |cores| match cores.as_slice() {
                    [] => "any but the tick's".into(),
                    cores => format!("{cores:?}"),
                },
            ),
            row(
                "device_threads.priority",
                &self.device_priority,
                u8::to_string,
            ),
            row("log.folder", &self.log_folder, |folder| {
                if folder.as_os_str().is_empty() {
                    "the working directory".into()
                } else {
                    path(folder)
                }
            }),
            row("serve.scene", &self.serve_scene, |scene| {
                scene.as_ref().map_or("the built-in scene".into(), path)
            }),
            row("serve.log", &self.serve_log, bool::to_string),
            row("serve.file_mib", &self.file_mib, u64::to_string),
            row("serve.file_minutes", &self.file_minutes, u64::to_string),
            row("serve.total_mib", &self.total_mib, u64::to_string),
            row("serve.retry", &self.retry, f64::to_string),
            row("serve.socket", &self.socket, path),
        ]
    }
}

impl Layer<'_> {
    /// Refuses cores that the machine has not.
    fn check(&self, cores: &Cores) -> Result<(), SceneError> {
        let tick = self.tables.tick.core.map(CoreChoice::from);
        let tick = tick.into_iter().map(|choice| ("tick.core", choice));
        let threads = self.tables.device_threads.cores.iter().flatten();
        let threads = threads.map(|core| ("device_threads.cores", CoreChoice::Id(*core)));
        for (field, choice) in tick.chain(threads) {
            cores.check(choice).map_err(|error| {
                let field = format!("{}{field}", self.prefix);
                self.source
                    .error(&field, error.found.to_string(), error.allowed())
            })?;
        }
        Ok(())
    }
}

/// The table `[serve]`, which only the file of the machine has.
struct Served<'a>(&'a MachineFile);

impl Served<'_> {
    fn first<T>(&self, field: &str, get: impl Fn(&Serve) -> Option<T>, default: T) -> Setting<T> {
        match get(&self.0.machine.serve) {
            Some(value) => Setting {
                value,
                from: Origin::Machine(self.0.source.location(&format!("serve.{field}"))),
            },
            None => Setting {
                value: default,
                from: Origin::Default,
            },
        }
    }
}
