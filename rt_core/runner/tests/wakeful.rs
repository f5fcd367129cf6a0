//! The request for a processor that stays awake. The kernel respects the request for as long as its file is open, so
//! the tests check that the file is open in every tick, with the right number in it. A plain file stands in for the
//! kernel's, and `/proc/self/fd` tells which files are open.
#![cfg(target_os = "linux")]

mod common;

use common::controller;
use rt_core::{Capabilities, Device, DeviceError, DeviceState, Freedom, Wrench};
use runner::link::{LinkConfig, link};
use runner::{CoreChoice, RunnerConfig, Stop, TickReport, spawn};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Whether this process has `path` open.
fn is_open(path: &Path) -> bool {
    let open = std::fs::read_dir("/proc/self/fd").expect("Linux lists open files");
    let mut targets = open.filter_map(|entry| std::fs::read_link(entry.ok()?.path()).ok());
    targets.any(|target| target == path)
}

/// A device that checks, in each read and write, whether a file is open.
#[derive(Debug)]
struct Watcher {
    path: PathBuf,
    open: u64,
    closed: u64,
}

impl Watcher {
    fn look(&mut self) {
        if is_open(&self.path) {
            self.open += 1;
        } else {
            self.closed += 1;
        }
    }
}

impl Device for Watcher {
    fn capabilities(&self) -> Capabilities {
        Capabilities {
            sensed: Freedom::Three,
            actuated: Freedom::Three,
            max_force: 8.0,
            max_moment: 0.0,
            workspace_radius: 0.1,
            position_step: 1e-5,
        }
    }

    fn read(&mut self, _now_ns: u64) -> Result<DeviceState, DeviceError> {
        self.look();
        Ok(DeviceState::resting())
    }

    fn write(&mut self, _now_ns: u64, _wrench: &Wrench) -> Result<(), DeviceError> {
        self.look();
        Ok(())
    }
}

/// Twenty ticks with the file `path` in place of the kernel's.
fn run(path: &Path, keep_awake: bool) -> TickReport<Watcher> {
    let (tick, _host, _log) = link(&LinkConfig::new(1000.0, 60.0));
    let name: &'static str = Box::leak(path.display().to_string().into_boxed_str());
    let config = RunnerConfig {
        ticks: Some(20),
        core: CoreChoice::Anywhere,
        priority: None,
        lock_memory: false,
        keep_awake,
        wake_latency: name,
        ..RunnerConfig::default()
    };
    let watcher = Watcher {
        path: path.to_owned(),
        open: 0,
        closed: 0,
    };
    let stop = Arc::new(Stop::new());
    let run = spawn(config, controller(1), vec![watcher], tick, stop).expect("it can run");
    run.join().expect("nothing panics")
}

/// An empty file, with its canonical path.
fn file(folder: &tempfile::TempDir) -> PathBuf {
    let path = folder.path().canonicalize().expect("it is there");
    let path = path.join("cpu_dma_latency");
    std::fs::write(&path, b"").expect("a file can be written");
    path
}

#[test]
fn the_request_is_open_in_every_tick_and_closed_after_the_last() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = file(&folder);
    let report = run(&path, true);
    let watcher = &report.devices[0];
    // A read and a write in each tick, and two writes that end the run.
    assert_eq!((watcher.open, watcher.closed), (2 * 20 + 2, 0));
    assert!(report.degradations.is_empty(), "{:?}", report.degradations);
    // The kernel takes a latency in us, as 32 bits: here zero.
    let written = std::fs::read(&path).expect("it can be read");
    assert_eq!(written, 0_i32.to_ne_bytes());
    assert!(!is_open(&path), "the processor may doze off again");
}

#[test]
fn nothing_is_opened_that_nobody_asked_for() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = file(&folder);
    let report = run(&path, false);
    assert_eq!((report.devices[0].open, report.degradations.len()), (0, 0));
    assert_eq!(std::fs::read(&path).expect("it can be read"), b"");
}

#[test]
fn a_request_that_is_refused_is_named_with_its_file() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("not there");
    let report = run(&path, true);
    let named: Vec<_> = report
        .degradations
        .iter()
        .map(ToString::to_string)
        .collect();
    assert_eq!(named.len(), 1, "{named:?}");
    assert!(named[0].contains("not there"), "{named:?}");
}
