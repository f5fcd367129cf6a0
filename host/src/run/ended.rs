//! A session or a run after its end, the same under either clock.

use super::observer::Observed;
use crate::engine::Engine;
use crate::engine::pacer::Pacer;
use crate::scene::LoadedScene;
use crate::scene::spec::Device;
use runner::TickReport;
use runner::link::HostEnd;
use std::fmt;

/// A session or a run after its end.
pub struct Ended {
    /// The tick with its devices.
    pub tick: TickReport,
    /// The host; if the host panicked, as the panic left it.
    pub host: HostSide,
    /// The message of the host's panic, if there was one.
    pub panicked: Option<String>,
    /// Whether the run ended early on request.
    pub stopped: bool,
    /// The results of the observers. A session has none.
    pub observed: Observed,
}

/// The host's side of a run.
pub struct HostSide {
    /// The physics.
    pub engine: Engine,
    /// The due times of the host's steps.
    pub pacer: Pacer,
    /// The host's end of the link.
    pub end: HostEnd,
}

impl Ended {
    /// Adds to the failures and degradations what the finished run of the scene shows: a panic of the host and its failed
    /// steps, calls that the tick may not make, devices that were absent for most of the run or sent fewer states than
    /// their profiles say, and a log (`logged`) that cannot be replayed.
    pub(super) fn judge(&mut self, loaded: &LoadedScene, logged: bool) {
        let scene = &loaded.scene;
        let (tick, observed) = (&self.tick, &mut self.observed);
        let failures = &mut observed.failures;
        let ticks = tick.ticks;
        failures.extend(self.panicked.as_deref().map(|panic| {
            format!("the host panicked, and the tick continued without the host: {panic}")
        }));
        failures.extend(tick.forbidden_call.map(|call| {
            format!("the tick made a system call that it may not make, and the loop ended after {ticks} ticks: {call}")
        }));
        failures.extend(tick.allocator_calls.filter(|&calls| calls > 0).map(|calls| {
            format!(
                "the tick called the memory allocator {calls} times in {ticks} ticks, and an allocator may wait for another \
                 thread; a driver that allocates must do so in a thread of its own"
            )
        }));
        let stats = self.host.engine.stats();
        failures.extend(stats.first_fault.as_ref().map(|fault| {
            let count = stats.faults;
            format!("{count} host steps failed; the first failure: {fault}")
        }));
        let counters = tick.controller.safety_counters();
        let devices = scene.devices.iter().zip(&loaded.models).enumerate();
        for ((index, (device, model)), counters) in devices.zip(counters) {
            let missed = counters.missed_reads;
            let rates = Rates {
                states: observed.collected.states_rate(index),
                profile: f64::from(model.rate_hz),
                ticks: scene.realtime.rate,
            };
            // A hand that felt nothing for most of its run has not tested the scene.
            if 2 * missed > ticks {
                let failure = no_readings(device, missed, ticks, &rates);
                observed.failures.push(failure);
            } else if !device.is_simulated() && rates.are_low() {
                observed.degradations.push(format!(
                    "device {:?} gave {rates}: its force is later than planned",
                    device.name
                ));
            }
        }
        if logged {
            let degradation = self.not_replayable();
            self.observed.degradations.extend(degradation);
        }
    }

    /// A message on the ticks and models that a log lacks and a replay needs; `None` if the log is whole.
    fn not_replayable(&self) -> Option<String> {
        let ticks = self.tick.link.refused_telemetry;
        let models = self.host.end.refused_copies();
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

/// The message about a device without a usable reading in most of its ticks.
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
