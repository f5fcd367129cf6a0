//! The request for a processor that stays awake. The kernel respects the request for as long as its file is open, so
//! the tests check that the file is open in every tick, with the right number in it. A plain file replaces the kernel's
//! file, and `/proc/self/fd` lists the open files.
#![cfg(target_os = "linux")]

mod common;

use common::controller;
use devices::scripted::{Scripted, small};
use rt_core::{DeviceState, Freedom, Wrench};
use runner::link::{LinkConfig, link};
use runner::{AnyDevice, CoreChoice, RunnerConfig, Stop, TickReport, spawn};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Whether this process has `path` open.
fn is_open(path: &Path) -> bool {
    let open = std::fs::read_dir("/proc/self/fd").expect("Linux lists open files");
    let mut targets = open.filter_map(|entry| std::fs::read_link(entry.ok()?.path()).ok());
    targets.any(|target| target == path)
}

/// The numbers of reads and writes in which the file was open, and closed.
#[derive(Debug, Default)]
struct Watch {
    open: AtomicU64,
    closed: AtomicU64,
}

impl Watch {
    fn look(&self, path: &Path) {
        let count = if is_open(path) {
            &self.open
        } else {
            &self.closed
        };
        count.fetch_add(1, Ordering::Relaxed);
    }

    fn counts(&self) -> (u64, u64) {
        let [open, closed] = [&self.open, &self.closed].map(|n| n.load(Ordering::Relaxed));
        (open, closed)
    }
}

/// A device that looks, in each of its reads and writes, whether a file is open.
fn watcher(path: &Path) -> (AnyDevice, Arc<Watch>) {
    let watch = Arc::new(Watch::default());
    let (by_read, by_write) = (Arc::clone(&watch), Arc::clone(&watch));
    let (read_path, write_path) = (path.to_owned(), path.to_owned());
    let read = move |_| {
        by_read.look(&read_path);
        Ok(DeviceState::resting())
    };
    let write = move |_, _: &Wrench| {
        by_write.look(&write_path);
        Ok(())
    };
    let device = Scripted::new(small(Freedom::Three), read, write);
    (Box::new(device), watch)
}

/// Twenty ticks with the file `path` in place of the kernel's.
fn run(path: &Path, keep_awake: bool) -> (TickReport, Arc<Watch>) {
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
    let (watcher, watch) = watcher(path);
    let stop = Arc::new(Stop::new());
    let run = spawn(config, controller(1), vec![watcher], tick, stop).expect("it can run");
    (run.join().expect("nothing panics"), watch)
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
    let (report, watch) = run(&path, true);
    // A read and a write in each tick, and two writes that end the run.
    assert_eq!(watch.counts(), (2 * 20 + 2, 0));
    assert!(report.degradations.is_empty(), "{:?}", report.degradations);
    // The kernel takes a latency in us, as 32 bits: here zero.
    let written = std::fs::read(&path).expect("it can be read");
    assert_eq!(written, 0_i32.to_ne_bytes());
    assert!(!is_open(&path), "the processor may doze off again");
}

#[test]
fn no_file_is_opened_without_a_request() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = file(&folder);
    let (report, watch) = run(&path, false);
    assert_eq!((watch.counts().0, report.degradations.len()), (0, 0));
    assert_eq!(std::fs::read(&path).expect("it can be read"), b"");
}

#[test]
fn a_request_that_is_refused_is_named_with_its_file() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("not there");
    let (report, _) = run(&path, true);
    let named: Vec<_> = report
        .degradations
        .iter()
        .map(ToString::to_string)
        .collect();
    assert_eq!(named.len(), 1, "{named:?}");
    assert!(named[0].contains("not there"), "{named:?}");
}
