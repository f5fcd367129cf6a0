//! A finished run in its parts, the same under either clock: the side of the tick, the side of the host, and what the
//! observers collected.

use super::collect::Collected;
use super::observer::Observers;
use super::pace::Pace;
use super::prepare::{HostSide, Prepared};
use super::session::Session;
use super::summary::PlaceSummary;
use super::{RunError, RunOptions, host_panicked, real_clock};
use crate::scene::LoadedScene;
use crate::scene::spec::Device;
use rt_core::Controller;
use runner::latency::Latencies;
use runner::link::{LogRecord, TickCounters};
use runner::{AnyDevice, Reserved};
use runner::{RunnerConfig, Stop};
use std::fmt;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Longest time on the wall between two reports of progress, unless a single step takes longer.
const SAID: Duration = Duration::from_millis(100);

/// A finished run, under either clock.
pub(super) struct Parts {
    pub(super) tick: TickSide,
    /// The side of the host; where the host panicked, as the panic left it. `None` if its thread was lost.
    pub(super) host: Option<HostSide>,
    pub(super) collected: Collected,
    pub(super) degradations: Vec<String>,
    pub(super) failures: Vec<String>,
    /// The files that an observer could not write.
    pub(super) unwritten: Vec<PathBuf>,
}

/// The tick's side of a finished run.
pub(super) struct TickSide {
    pub(super) ticks: u64,
    pub(super) missed: u64,
    pub(super) longest_miss: u64,
    pub(super) slots: u64,
    /// Whether the run ended early on request.
    pub(super) stopped: bool,
    /// The core and the priority of its thread; `None` under virtual time.
    pub(super) place: Option<PlaceSummary>,
    pub(super) locked_bytes: u64,
    /// Calls of the allocator by the tick's thread, where they are counted.
    pub(super) allocator_calls: Option<u64>,
    pub(super) counters: TickCounters,
    pub(super) refused_wrenches: u64,
    pub(super) latencies: Latencies,
    pub(super) controller: Box<Controller>,
    pub(super) devices: Vec<AnyDevice>,
}

impl Parts {
    /// Adds what the finished run of the scene shows: failed steps of the host, devices that were absent for most of the
    /// run or sent fewer states than their profiles say, and a log (`logged`) that cannot be replayed.
    pub(super) fn judge(&mut self, loaded: &LoadedScene, logged: bool) {
        let scene = &loaded.scene;
        if let Some(HostSide { engine, .. }) = &self.host
            && let Some(fault) = &engine.stats().first_fault
        {
            let count = engine.stats().faults;
            let failure = format!("{count} host steps failed; the first failure: {fault}");
            self.failures.push(failure);
        }
        let ticks = self.tick.ticks;
        let counters = self.tick.controller.safety_counters();
        let devices = scene.devices.iter().zip(&loaded.models).enumerate();
        for ((index, (device, model)), counters) in devices.zip(counters) {
            let missed = counters.missed_reads;
            let rates = Rates {
                states: self.collected.states_rate(index),
                profile: f64::from(model.rate_hz),
                ticks: scene.realtime.rate,
            };
            // A hand that felt nothing for most of its run has not tested the scene.
            if 2 * missed > ticks {
                self.failures
                    .push(no_readings(device, missed, ticks, &rates));
            } else if !device.is_simulated() && rates.are_low() {
                self.degradations.push(format!(
                    "device {:?} gave {rates}: its force is later than planned",
                    device.name
                ));
            }
        }
        if logged {
            let degradation = self.not_replayable();
            self.degradations.extend(degradation);
        }
    }

    /// A message on the ticks and models that a log lacks and a replay needs; `None` if the log is whole.
    fn not_replayable(&self) -> Option<String> {
        let ticks = self.tick.counters.refused_telemetry;
        let host = self.host.as_ref();
        let models = host.map_or(0, |host| host.end.refused_copies());
        (ticks + models > 0).then(|| {
            format!(
                "the log lacks {ticks} ticks and {models} models, because its ring was full; a log that lacks a tick, \
                 or a model that a tick used, cannot be replayed"
            )
        })
    }
}

/// A part of the expected rate below which the states of a device are too few. Clocks of devices differ by less.
const LOW: f64 = 0.9;

/// The rates of a device (Hz): of its states in a run, of its profile, and of the loop that asks for them.
struct Rates {
    states: f64,
    profile: f64,
    ticks: f64,
}

impl Rates {
    fn are_low(&self) -> bool {
        self.states < LOW * self.profile.min(self.ticks)
    }
}

impl fmt::Display for Rates {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{:.0} states a second, and its profile says {:.0}",
            self.states, self.profile
        )
    }
}

/// What to say of a device without a usable reading in most of its ticks.
fn no_readings(device: &Device, missed: u64, ticks: u64, rates: &Rates) -> String {
    let name = &device.name;
    let head =
        format!("device {name:?} gave no usable reading in {missed} of {ticks} ticks ({rates})");
    if device.is_simulated() {
        return format!(
            "{head}: the device was silent, or moved as no hand can; are the motions of its hand in metres?"
        );
    }
    // A person holds a real device.
    format!(
        "{head}: the device was silent, or its states were no motion. Check its cable and power, and whether the device has \
         been calibrated or homed; `palpate device probe {}` measures its states without force",
        device.connect
    )
}

/// Runs what is prepared under virtual time, until `stop` is requested. `progress` is given the number of ticks done.
pub(super) fn under_virtual_time(
    prepared: Prepared,
    stop: &Stop,
    mut observers: Observers,
    progress: &mut dyn FnMut(u64),
) -> Parts {
    let planned = prepared.timing.ticks;
    let view = prepared.view.as_ref();
    let mut pace = view.and_then(|view| Pace::new(view.pace));
    let mut sink = |record: LogRecord<'_>| {
        let time_ns = match &record {
            LogRecord::Tick(telemetry) => Some(telemetry.time_ns),
            LogRecord::Model(..) => None,
        };
        observers.take(record);
        observers.drained();
        if let (Some(pace), Some(time_ns)) = (&mut pace, time_ns) {
            pace.wait(time_ns, || {
                observers.drained();
                !stop.is_requested()
            });
        }
    };
    let mut session = Session::of(prepared);
    let mut said = Instant::now();
    while session.tick().is_some() {
        session.records(&mut sink);
        let before = session.ticks() - 1;
        // Large bodies take long for a step: a person who waits sees something by the clock on the wall, too.
        if before.is_multiple_of(256) || said.elapsed() > SAID {
            said = Instant::now();
            progress(before);
        }
        if stop.is_requested() {
            break;
        }
    }
    let done = session.end();
    let observed = observers.finish();
    Parts {
        tick: TickSide {
            missed: 0,
            longest_miss: 0,
            slots: done.tick.ticks,
            stopped: done.tick.ticks < planned && stop.is_requested(),
            place: None,
            locked_bytes: 0,
            allocator_calls: None,
            ticks: done.tick.ticks,
            counters: done.tick.end.counters(),
            refused_wrenches: done.tick.refused_wrenches,
            latencies: done.tick.latencies,
            controller: done.tick.controller,
            devices: done.tick.devices,
        },
        host: Some(done.host),
        collected: observed.collected,
        degradations: observed.degradations,
        unwritten: observed.unwritten,
        failures: observed
            .failures
            .into_iter()
            .chain(done.panicked.as_deref().map(host_panicked))
            .collect(),
    }
}

/// Runs what is prepared under the real clock. `progress` is given the number of ticks done.
///
/// # Errors
/// The system gives no thread, or the tick's thread panicked.
pub(super) fn under_the_real_clock(
    prepared: Prepared,
    options: &RunOptions,
    reserved: &Reserved,
    observers: Observers,
    progress: &mut dyn FnMut(u64),
) -> Result<Parts, RunError> {
    let planned = prepared.timing.ticks;
    let stop = Arc::clone(&options.stop);
    let runner = RunnerConfig {
        core: reserved.core(),
        ..options.runner
    };
    let done = real_clock::run(prepared, runner, stop, observers, progress)?;
    let mut failures = done.failures;
    let observed = done.observers.map(Observers::finish).unwrap_or_default();
    failures.extend(observed.failures);
    let report = done.report;
    if let Some(call) = report.forbidden_call {
        failures.push(format!(
            "the tick made a system call that it may not make, and the loop ended after {} ticks: {call}",
            report.ticks
        ));
    }
    if let Some(calls) = report.allocator_calls.filter(|&calls| calls > 0) {
        failures.push(format!(
            "the tick called the memory allocator {calls} times in {} ticks, and an allocator may wait for another thread; \
             a driver that allocates must do so in a thread of its own",
            report.ticks
        ));
    }
    Ok(Parts {
        tick: TickSide {
            ticks: report.ticks,
            missed: report.missed_deadlines,
            longest_miss: report.longest_miss,
            slots: report.slots,
            stopped: report.ticks < planned && options.stop.is_requested(),
            place: Some(PlaceSummary {
                core: report.core,
                isolated: report.isolated,
                priority: report.priority,
                kept_awake: report.kept_awake,
            }),
            locked_bytes: report.locked_bytes as u64,
            allocator_calls: report.allocator_calls,
            counters: report.link,
            refused_wrenches: report.refused_wrenches,
            latencies: report.latencies,
            controller: report.controller,
            devices: report.devices,
        },
        host: done.host,
        collected: observed.collected,
        degradations: report
            .degradations
            .iter()
            .map(ToString::to_string)
            .chain(observed.degradations)
            .collect(),
        failures,
        unwritten: observed.unwritten,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Override, Scene};

    #[test]
    fn a_real_device_is_not_asked_about_its_hand() {
        let scene = Scene::embedded_default().expect("a scene");
        let rates = Rates {
            states: 100.0,
            profile: 1000.0,
            ticks: 1000.0,
        };
        let said = |loaded: &LoadedScene| no_readings(&loaded.scene.devices[0], 900, 1000, &rates);
        let simulated = said(&scene);
        assert!(
            simulated
                .contains("in 900 of 1000 ticks (100 states a second, and its profile says 1000)")
                && simulated.contains("its hand in metres"),
            "{simulated}"
        );
        for connect in [
            "tcp:localhost:4000",
            "hid:1209:c0de",
            "plugin:arm.so",
            "falcon",
        ] {
            let name = &scene.scene.devices[0].name;
            let real = [Override::connection(name, connect)];
            let real = said(&scene.overridden(&real).expect("a scene"));
            assert!(
                real.contains("in 900 of 1000 ticks") && !real.contains("hand"),
                "{real}"
            );
            assert!(real.contains("cable") && real.contains(connect), "{real}");
        }
    }
}
