//! `palpate latency --cyclictest`: the wake-up of the loop beside that of `cyclictest` (Debian's package rt-tests), on the same
//! core, with the same priority and period, while host, log and load run on.

use super::super::CommandError;
use runner::kernel::thread_named;
use runner::schedule::move_thread;
use serde_json::Value;
use std::fs::read_to_string;
use std::process::{Child, Command, Stdio};
use study::latency::beside::{Counts, Other};

/// The largest latency that cyclictest counts (ns). It gives the largest one apart.
const LARGEST_NS: u64 = 999_999;

/// cyclictest, and the thread of the tick that makes room for it.
#[derive(Debug)]
pub(super) struct Cyclictest {
    /// The core of both.
    core: usize,
    /// The other cores.
    others: Vec<usize>,
    priority: u8,
    period_us: u64,
    seconds: u64,
    /// The file of its result.
    result: tempfile::NamedTempFile,
    child: Option<Child>,
}

impl Cyclictest {
    /// Compares on `core` of the cores `online`, for `seconds` at a time.
    pub(super) fn new(
        core: usize,
        online: &[usize],
        priority: u8,
        rate: f64,
        seconds: u64,
    ) -> Result<Self, CommandError> {
        let version = Command::new("cyclictest")
            .arg("--help")
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .status();
        version.map_err(CommandError::NoCyclictest)?;
        Ok(Self {
            core,
            others: online
                .iter()
                .copied()
                .filter(|other| *other != core)
                .collect(),
            priority,
            period_us: (1e6 / rate).round() as u64,
            seconds,
            result: tempfile::NamedTempFile::new().map_err(CommandError::NoCyclictest)?,
            child: None,
        })
    }

    fn moved(cores: &[usize]) -> Result<(), String> {
        let thread = thread_named("palpate-tick").ok_or("the tick has no thread any more")?;
        move_thread(thread, cores)
            .map_err(|error| format!("the system does not move the tick's thread: {error}"))
    }
}

impl Other for Cyclictest {
    fn give(&mut self) -> Result<(), String> {
        Self::moved(&[self.core])
    }

    fn take(&mut self) -> Result<(), String> {
        Self::moved(&self.others)?;
        let mut command = Command::new("cyclictest");
        command
            .arg(format!("--affinity={}", self.core))
            .arg(format!("--priority={}", self.priority))
            .arg(format!("--interval={}", self.period_us))
            .arg(format!("--duration={}", self.seconds))
            .arg(format!("--histogram={LARGEST_NS}"))
            .arg(format!("--json={}", self.result.path().display()))
            .args([
                "--threads=1",
                "--policy=fifo",
                "--mlockall",
                "--nsecs",
                "--quiet",
            ])
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null());
        let child = command.spawn();
        self.child = Some(child.map_err(|error| format!("cyclictest: {error}"))?);
        Ok(())
    }

    fn ended(&mut self) -> Option<Result<Counts, String>> {
        let status = match self.child.as_mut()?.try_wait() {
            Ok(None) => return None,
            Ok(Some(status)) => status,
            Err(error) => return Some(Err(format!("cyclictest: {error}"))),
        };
        self.child = None;
        if !status.success() {
            return Some(Err(format!(
                "cyclictest ended with {status}; it needs the realtime privileges of the tick"
            )));
        }
        let text = read_to_string(self.result.path())
            .map_err(|error| format!("the result of cyclictest: {error}"));
        Some(text.and_then(|text| counts(&text)))
    }
}

impl Drop for Cyclictest {
    fn drop(&mut self) {
        if let Some(child) = &mut self.child {
            // A process that has ended is not there.
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

/// The latencies in the JSON of cyclictest. Those beyond its histogram count as its largest.
fn counts(text: &str) -> Result<Counts, String> {
    let wrong = |what: &str| {
        format!(
            "the result of cyclictest: found no {what}, allowed: the JSON of rt-tests 2.4 or later"
        )
    };
    let json: Value =
        serde_json::from_str(text).map_err(|error| format!("the result of cyclictest: {error}"))?;
    let thread = json.pointer("/thread/0").ok_or_else(|| wrong("thread 0"))?;
    let number = |name: &str| {
        thread
            .get(name)
            .and_then(Value::as_u64)
            .ok_or_else(|| wrong(name))
    };
    let (cycles, max) = (number("cycles")?, number("max")?);
    let histogram = thread.get("histogram").and_then(Value::as_object);
    let mut counts = Counts::new();
    for (ns, count) in histogram.ok_or_else(|| wrong("histogram"))? {
        let ns: u64 = ns.parse().map_err(|_| wrong("histogram of numbers"))?;
        counts.insert(ns, count.as_u64().ok_or_else(|| wrong("count"))?);
    }
    let beyond = cycles.saturating_sub(counts.values().sum());
    if beyond > 0 {
        *counts.entry(max).or_default() += beyond;
    }
    Ok(counts)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn latencies_beyond_the_histogram_count_as_the_largest() {
        let text = r#"{"thread": {"0": {"histogram": {"21237": 2, "23508": 1}, "cycles": 5, "min": 21237, "max": 3000000}}}"#;
        assert_eq!(
            counts(text),
            Ok([(21_237, 2), (23_508, 1), (3_000_000, 2)].into())
        );
        for wrong in [
            "",
            "{}",
            r#"{"thread": {"0": {"cycles": 5, "max": 1}}}"#,
            r#"{"thread": {"0": {"cycles": 5, "max": 1, "histogram": {"a": 1}}}}"#,
        ] {
            let error = counts(wrong).expect_err(wrong);
            assert!(error.starts_with("the result of cyclictest:"), "{error}");
        }
    }
}
