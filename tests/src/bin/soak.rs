//! A long run under the real clock on a busy machine, with checks of its counts.
//!
//! `tests/soak [SECONDS] [ARGUMENTS OF palpate run]`, or `tests/soak serve [SECONDS]` for the service with a series of logs.
//! While the program runs, this one spins on every core, moves memory and writes files. Times are not checked, because a
//! loaded machine is late. Every lost tick must be counted, memory must not grow, and the logs of the service must replay.

use serde_json::Value;
use std::fs::File;
use std::hint::black_box;
use std::io::{Seek, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitCode};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Length without an argument (s).
const TEN_MINUTES: u64 = 600;
/// Largest growth of the memory between the end of the warm-up and the end of the run (KiB). The index of the log grows
/// by some hundred bytes a second; the rest is slack of the allocator.
const MOST_GROWTH_KIB: u64 = 16 * 1024;
/// Size of the memory that is moved.
const MOVED_BYTES: usize = 64 << 20;
/// Size of the file, which is then written again from its start.
const FILE_BYTES: usize = 256 << 20;

fn main() -> ExitCode {
    match soak() {
        Ok(()) => ExitCode::SUCCESS,
        Err(reason) => {
            eprintln!("soak: {reason}");
            ExitCode::FAILURE
        }
    }
}

fn soak() -> Result<(), String> {
    let mut arguments = std::env::args().skip(1).peekable();
    let serves = arguments.next_if(|first| first == "serve").is_some();
    let seconds: u64 = match arguments.next() {
        None => TEN_MINUTES,
        Some(text) => text
            .parse()
            .ok()
            .filter(|seconds| (2..=86_400).contains(seconds))
            .ok_or(format!(
                "found {text:?}, allowed: whole seconds from 2 to 86400"
            ))?,
    };
    let folder = tempfile::tempdir().map_err(|e| format!("no temporary folder: {e}"))?;
    let json = folder.path().join("run.json");
    let mut command = Command::new(beside("palpate")?);
    if serves {
        let settings = settings(folder.path()).map_err(|e| format!("no settings: {e}"))?;
        command.arg("serve").arg("--settings").arg(settings);
    } else {
        command
            .args(["run", "--clock", "real", "--duration", &seconds.to_string()])
            .arg("--log")
            .arg(folder.path().join("run.mcap"));
    }
    let mut program = command
        .args(arguments)
        .arg("--json")
        .arg(&json)
        .spawn()
        .map_err(|e| format!("palpate cannot be run: {e}"))?;

    let over = AtomicBool::new(false);
    let (memory, status) = std::thread::scope(|scope| {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        for _ in 0..cores {
            scope.spawn(|| spin(&over));
        }
        scope.spawn(|| move_memory(&over));
        let file = folder.path().join("load");
        scope.spawn(|| write_files(file, &over));
        let result = watch(&mut program, seconds, serves);
        over.store(true, Ordering::Relaxed);
        result
    })?;
    if !status {
        return Err("palpate failed".into());
    }
    let text = std::fs::read(&json).map_err(|e| format!("no summary: {e}"))?;
    let summary = serde_json::from_slice(&text).map_err(|e| format!("no summary: {e}"))?;
    judge(&summary, &memory)?;
    if serves {
        replay(folder.path(), &summary)?;
    }
    Ok(())
}

/// The settings of the service, whose logs turn over every few seconds.
fn settings(folder: &Path) -> std::io::Result<PathBuf> {
    let (file, logs) = (folder.join("palpate.toml"), folder.join("logs"));
    std::fs::create_dir(&logs)?;
    let socket = folder.join("status.sock");
    let text = format!(
        "log.folder = '{}'\nserve.socket = '{}'\nserve.file_mib = 8\n",
        logs.display(),
        socket.display()
    );
    std::fs::write(&file, text)?;
    Ok(file)
}

/// Replays the logs of the service, from the first file on. They must hold each record of the run.
fn replay(folder: &Path, summary: &Value) -> Result<(), String> {
    let logs = folder.join("logs");
    let files = std::fs::read_dir(&logs).map_err(|e| format!("no logs: {e}"))?;
    println!("soak: {} files of logs", files.count());
    let output = Command::new(beside("palpate")?)
        .arg("run")
        .arg("--replay")
        .arg(logs.join("palpate-000001-0001.mcap"))
        .output()
        .map_err(|e| format!("palpate cannot be run: {e}"))?;
    let said = String::from_utf8_lossy(&output.stdout);
    print!("{said}");
    let records = summary.pointer("/tick/records").and_then(Value::as_u64);
    let records = records.unwrap_or_default().to_string();
    let all = said
        .split(|c: char| !c.is_ascii_digit())
        .any(|number| number == records);
    if output.status.success() && all {
        Ok(())
    } else {
        Err(format!(
            "the replay of the logs does not have {records} ticks: {}",
            String::from_utf8_lossy(&output.stderr)
        ))
    }
}

/// A program in the folder of this one.
fn beside(name: &str) -> Result<PathBuf, String> {
    let this = std::env::current_exe().map_err(|e| e.to_string())?;
    let path = this.with_file_name(name);
    let missing = format!("{} is missing; tests/soak builds it", path.display());
    path.exists().then_some(path).ok_or(missing)
}

fn spin(over: &AtomicBool) {
    let mut number = 1_u64;
    while !over.load(Ordering::Relaxed) {
        for _ in 0..10_000 {
            number = black_box(
                number
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1),
            );
        }
    }
}

fn move_memory(over: &AtomicBool) {
    let mut memory = vec![1_u8; MOVED_BYTES];
    while !over.load(Ordering::Relaxed) {
        memory.copy_within(..MOVED_BYTES / 2, MOVED_BYTES / 2);
        black_box(&mut memory);
    }
}

/// A disk that is full or slow is load as well, so errors are ignored.
fn write_files(path: PathBuf, over: &AtomicBool) {
    let block = vec![7_u8; 1 << 20];
    let Ok(mut file) = File::create(path) else {
        return;
    };
    let mut written = 0;
    while !over.load(Ordering::Relaxed) {
        let _ = file.write_all(&block);
        written += block.len();
        if written % (16 << 20) == 0 {
            let _ = file.sync_data();
        }
        if written >= FILE_BYTES {
            written = 0;
            let _ = file.rewind();
        }
    }
}

/// Memory of the program in use (KiB).
#[derive(Debug)]
struct Memory {
    after_warm_up: u64,
    most_later: u64,
}

/// Reads the memory of the program twice a second until it ends; `ends`: until it is asked to end after `seconds`. Also
/// returns whether the program succeeded.
fn watch(program: &mut Child, seconds: u64, ends: bool) -> Result<(Memory, bool), String> {
    let path = PathBuf::from(format!("/proc/{}/status", program.id()));
    // A tenth of the run, between one second and thirty.
    let warm_up = 2 * (seconds / 10).clamp(1, 30);
    let mut memory = Memory {
        after_warm_up: 0,
        most_later: 0,
    };
    for sample in 0_u64.. {
        if let Some(status) = program.try_wait().map_err(|e| e.to_string())? {
            // The measurement is complete. A signal or a failure is an unsuccessful run.
            return Ok((memory, status.success()));
        }
        let resident = resident_kib(&path).unwrap_or(0);
        if sample < warm_up {
            memory.after_warm_up = memory.after_warm_up.max(resident);
        } else {
            memory.most_later = memory.most_later.max(resident);
        }
        if ends && sample == 2 * seconds {
            let asked = Command::new("kill").arg(program.id().to_string()).status();
            asked.map_err(|e| format!("the program cannot be ended: {e}"))?;
        }
        std::thread::sleep(Duration::from_millis(500));
    }
    Err("the clock stood still".into())
}

fn resident_kib(status: &Path) -> Option<u64> {
    let text = std::fs::read_to_string(status).ok()?;
    let line = text.lines().find(|line| line.starts_with("VmRSS:"))?;
    line.split_whitespace().nth(1)?.parse().ok()
}

/// Prints the counts, and reports those that are inconsistent.
fn judge(summary: &Value, memory: &Memory) -> Result<(), String> {
    let number = |path: &str| {
        let value = summary.pointer(path).and_then(Value::as_u64);
        value.ok_or(format!("the summary has no {path}"))
    };
    let (ticks, missed) = (number("/tick/count")?, number("/tick/missed_deadlines")?);
    let (slots, records) = (number("/tick/slots")?, number("/tick/records")?);
    let refused = number("/dropped/telemetry")?;
    let (late, took) = (
        number("/tick/lateness/count")?,
        number("/tick/duration/count")?,
    );
    let growth = memory.most_later.saturating_sub(memory.after_warm_up);
    println!("soak: {ticks} ticks + {missed} missed deadlines = {slots} slots");
    println!("soak: {records} records + {refused} refused = {ticks} ticks");
    println!("soak: {late} latenesses and {took} durations in the histograms");
    println!(
        "soak: memory {} KiB after the warm-up, {growth} KiB more later (at most {MOST_GROWTH_KIB})",
        memory.after_warm_up
    );
    let checks = [
        (ticks > 0, "no tick was run"),
        (
            ticks + missed == slots,
            "ticks and missed deadlines are not the slots",
        ),
        (
            records + refused == ticks,
            "records and refused ones are not the ticks",
        ),
        (
            late == ticks && took == ticks,
            "the histograms do not hold every tick",
        ),
        (
            memory.after_warm_up > 0,
            "the program's memory was never read",
        ),
        (growth <= MOST_GROWTH_KIB, "memory grew"),
    ];
    let failed: Vec<_> = checks
        .iter()
        .filter(|(holds, _)| !holds)
        .map(|(_, failure)| *failure)
        .collect();
    if failed.is_empty() {
        Ok(())
    } else {
        Err(failed.join("; "))
    }
}
