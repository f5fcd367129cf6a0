//! The tables of the settings, field by field. [`Settings`](super::Settings) has the defaults.

use super::visitors;
use crate::check;
use serde::Deserialize;
use std::path::PathBuf;

/// The tables that a scene may carry under `[machine]`, too.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MachineTables {
    /// The thread of the tick.
    #[serde(deserialize_with = "check::table")]
    pub tick: Tick,
    /// The threads of the devices.
    #[serde(deserialize_with = "check::table")]
    pub device_threads: DeviceThreads,
    /// The logs.
    #[serde(deserialize_with = "check::table")]
    pub log: LogFolder,
}

/// The file of the machine's settings.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Machine {
    /// The thread of the tick.
    #[serde(deserialize_with = "check::table")]
    pub tick: Tick,
    /// The threads of the devices.
    #[serde(deserialize_with = "check::table")]
    pub device_threads: DeviceThreads,
    /// The logs.
    #[serde(deserialize_with = "check::table")]
    pub log: LogFolder,
    /// `palpate serve`.
    #[serde(deserialize_with = "check::table")]
    pub serve: Serve,
}

/// The core of the tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CoreName {
    /// The first isolated core, or the last one of the program.
    Isolated,
    /// The last core of the program.
    Last,
    /// The core that the system chooses.
    Any,
    /// The core of this number.
    Number(usize),
}

/// `[tick]`: the thread of the tick.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Tick {
    /// Its core.
    #[serde(deserialize_with = "visitors::optional_core")]
    pub core: Option<CoreName>,
    /// Its priority under SCHED_FIFO, 1 to 99.
    #[serde(deserialize_with = "visitors::optional_priority")]
    pub priority: Option<u8>,
    /// Whether the other threads of the program leave the siblings of the tick's core alone, too. A sibling is another
    /// hardware thread of the same physical core.
    pub idle_sibling: Option<bool>,
}

/// `[device_threads]`: the threads and processes that exchange with devices.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DeviceThreads {
    /// Their cores.
    #[serde(deserialize_with = "visitors::optional_cores")]
    pub cores: Option<Vec<usize>>,
    /// Their priority under SCHED_FIFO, 1 to 99.
    #[serde(deserialize_with = "visitors::optional_priority")]
    pub priority: Option<u8>,
}

/// `[log]`: the logs.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LogFolder {
    /// The folder of a relative `--log FILE`, and of the logs of `palpate serve`: an absolute path.
    #[serde(deserialize_with = "visitors::optional_absolute")]
    pub folder: Option<PathBuf>,
}

/// `[serve]`: what `palpate serve` runs.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Serve {
    /// The scene, relative to the folder of the settings file.
    pub scene: Option<PathBuf>,
    /// Whether the runs are logged.
    pub log: Option<bool>,
    /// Size at which a log is finished and the next one begins (MiB).
    #[serde(deserialize_with = "visitors::optional_file_mib")]
    pub file_mib: Option<u64>,
    /// Age at which a log is finished and the next one begins (min).
    #[serde(deserialize_with = "visitors::optional_file_minutes")]
    pub file_minutes: Option<u64>,
    /// Size of all logs of `palpate serve` (MiB), above which the oldest finished ones are deleted.
    #[serde(deserialize_with = "visitors::optional_total_mib")]
    pub total_mib: Option<u64>,
    /// Time after which an absent device or a run that failed is tried again (s).
    #[serde(deserialize_with = "visitors::optional_retry")]
    pub retry: Option<f64>,
    /// The socket of `palpate status`: an absolute path.
    #[serde(deserialize_with = "visitors::optional_absolute")]
    pub socket: Option<PathBuf>,
}
