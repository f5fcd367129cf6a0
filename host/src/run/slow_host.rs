//! Finds out early whether a step takes longer than the scene allows, and says what to do.
//!
//! Under the real clock the answer must come before hands hold the devices: a rehearsal times some steps of a copy of
//! the bodies (`engine::rehearsal`), and so does `palpate plan`. Under virtual time the first steps of the run give the
//! answer: the run looks at the times that the engine measures in any case, so nothing waits for the answer. Nothing in
//! the state depends on it ([`SlowWatch`]). All of them measure processor time
//! ([`ProcessorStopwatch`](crate::engine::stats::ProcessorStopwatch)): a machine that is busy with other programs is no
//! fault of the scene.

use super::Clock;
use crate::engine::build::steps_per_publication;
use crate::engine::stats::{EngineStats, StepTimes};
use crate::scene::Scene;
use runner::Cores;
use std::sync::{Arc, OnceLock};

/// Steps after which the time of a step is judged, and the measured time after which fewer steps suffice (s).
const STEPS: u64 = 5;
const ENOUGH: f64 = 1.0;

/// The time of a step on this machine, and the time that the scene allows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StepTime {
    /// Mean time of a step, with its share of the publications (ns).
    pub took_ns: u64,
    /// Time from one step to the next in the scene (ns).
    pub asked_ns: u64,
}

impl StepTime {
    /// The time of a step of `scene`, which takes `took` seconds.
    pub fn new(scene: &Scene, took: f64) -> Self {
        Self {
            took_ns: (took * 1e9) as u64,
            asked_ns: (1e9 / scene.host.step_rate) as u64,
        }
    }

    /// Whether a step takes longer than the scene allows.
    pub fn is_too_slow(&self) -> bool {
        self.took_ns > self.asked_ns
    }

    /// The time of a step and the time that the scene allows, in words.
    pub fn in_words(&self) -> String {
        let [took, asked] = [self.took_ns, self.asked_ns].map(time);
        format!("a step takes about {took}, and the scene needs a step every {asked}")
    }

    /// A warning for people, if a step takes too long: what will happen under `clock` (`None`: under either) in a run
    /// of `duration` (s), and what to do on a machine with `cores` cores.
    pub fn warning(
        &self,
        scene: &Scene,
        clock: Option<Clock>,
        duration: f64,
        cores: usize,
    ) -> String {
        let ratio = self.took_ns as f64 / self.asked_ns.max(1) as f64;
        let skips = format!(
            "the real clock the host leaves out about {:.0} % of its steps, and the bodies move slower than the hands",
            100.0 * (1.0 - 1.0 / ratio.max(1.0))
        );
        let takes = format!(
            "virtual time a run of {duration} s takes {} or more",
            time((duration * ratio * 1e9) as u64)
        );
        let means = match clock {
            Some(Clock::Real) => format!("under {skips}"),
            Some(Clock::Virtual) => format!("in {takes}; under {skips}"),
            None => format!("under {skips}; in {takes}"),
        };
        format!(
            "{}: {means}. {}",
            self.in_words(),
            self.advice(scene, cores)
        )
    }

    /// What to do if a step takes too long.
    fn advice(&self, scene: &Scene, cores: usize) -> String {
        let rate = two_digits_down(0.8e9 / self.took_ns.max(1) as f64);
        let threads = cores.min(4);
        let more = if scene.host.threads < threads {
            format!(", or share the steps among cores (`host.threads = {threads}`)")
        } else {
            String::new()
        };
        format!(
            "Lower `host.step_rate` and `host.publish_rate` to {rate} Hz or less, or use a coarser mesh{more}"
        )
    }
}

/// Number of cores of this machine; zero if the system does not tell.
pub fn cores() -> usize {
    Cores::of_this_machine().online.len()
}

/// What to say of a run under the real clock whose host left out `skipped` steps and did those of `stats`; `None` if it
/// left out none.
pub(super) fn skipped(
    scene: &Scene,
    stats: &EngineStats,
    skipped: u64,
    cores: usize,
) -> Option<String> {
    if skipped == 0 {
        return None;
    }
    let all = stats.steps + skipped;
    let percent = 100.0 * skipped as f64 / all as f64;
    let time = StepTime::new(scene, stats.mean_step());
    let head = format!("the host left out {skipped} of {all} steps ({percent:.1} %)");
    Some(if time.is_too_slow() {
        format!(
            "{head}: {}; the bodies moved slower than the hands, and the models were older than planned. {}",
            time.in_words(),
            time.advice(scene, cores)
        )
    } else {
        format!(
            "{head}, although {}: the host waited for another reason (a fault on purpose, another program, a single \
             long step)",
            time.in_words()
        )
    })
}

/// Judges whether a step of a run takes too long, by a rehearsal or by the first steps of the run.
#[derive(Clone, Debug)]
pub struct SlowWatch {
    asked: f64,
    /// Steps from one publication to the next.
    cycle: u64,
    times: StepTimes,
    judged: bool,
    found: Arc<OnceLock<StepTime>>,
}

impl SlowWatch {
    /// A watch over the steps of `scene`.
    pub fn new(scene: &Scene) -> Self {
        Self {
            asked: 1.0 / scene.host.step_rate,
            cycle: steps_per_publication(scene),
            times: StepTimes::new(steps_per_publication(scene)),
            judged: false,
            found: Arc::default(),
        }
    }

    /// A watch that knows the time of a step from a rehearsal.
    pub(super) fn rehearsed(scene: &Scene, time: StepTime) -> Self {
        let watch = Self {
            judged: true,
            ..Self::new(scene)
        };
        if time.is_too_slow() {
            let _ = watch.found.set(time);
        }
        watch
    }

    /// Receives the time of a step, if a step takes too long. Another thread may read it.
    pub(super) fn found(&self) -> Arc<OnceLock<StepTime>> {
        Arc::clone(&self.found)
    }

    /// Looks at the times of the steps so far, until there are enough of them.
    pub(super) fn look(&mut self, stats: &EngineStats) {
        if self.judged {
            return;
        }
        self.times.take(stats);
        let enough = stats.steps > STEPS.max(self.cycle) || stats.total_time() >= ENOUGH;
        if stats.steps < 2 || !enough {
            return;
        }
        let took = self.times.typical();
        self.judged = true;
        if took > self.asked {
            let time = StepTime {
                took_ns: (took * 1e9) as u64,
                asked_ns: (self.asked * 1e9) as u64,
            };
            let _ = self.found.set(time);
        }
    }
}

/// A time with two digits and a readable unit.
fn time(ns: u64) -> String {
    let seconds = ns as f64 * 1e-9;
    let (value, unit) = match seconds {
        s if s < 1e-3 => (s * 1e6, "us"),
        s if s < 1.0 => (s * 1e3, "ms"),
        s if s < 120.0 => (s, "s"),
        s if s < 7200.0 => (s / 60.0, "min"),
        s => (s / 3600.0, "h"),
    };
    if value < 9.95 {
        format!("{value:.1} {unit}")
    } else {
        format!("{value:.0} {unit}")
    }
}

/// A positive number rounded down to two significant digits.
fn two_digits_down(x: f64) -> f64 {
    let unit = 10_f64.powi(x.max(f64::MIN_POSITIVE).log10().floor() as i32 - 1);
    // The product of a whole number and a power of ten is not always the nearest number to its decimal digits.
    let digits = (x / unit).floor();
    format!("{:.6e}", digits * unit).parse().unwrap_or(x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::LoadedScene;

    fn scene() -> LoadedScene {
        Scene::embedded_default().expect("the built-in scene")
    }

    fn stats(steps: u64, ns: u64) -> EngineStats {
        let mut stats = EngineStats::new();
        for _ in 0..steps {
            stats.steps += 1;
            stats.solve.record(ns);
        }
        stats
    }

    #[test]
    fn a_slow_step_is_told_after_a_few_steps_and_a_fast_one_never() {
        let scene = scene();
        // 250 Hz, so 4 ms.
        let after = |steps, ns| {
            let mut watch = SlowWatch::new(&scene.scene);
            // The first step takes ten times as long, and does not count.
            let mut times = stats(1, 10 * ns);
            watch.look(&times);
            for _ in 1..steps {
                times.steps += 1;
                times.solve.record(ns);
                watch.look(&times);
            }
            watch.found().get().copied()
        };
        assert_eq!(after(5, 5_000_000), None);
        assert_eq!(after(6, 3_900_000), None);
        let found = after(6, 5_000_000).expect("too slow");
        assert!(found.is_too_slow() && found.asked_ns == 4_000_000);
        // Very slow steps are told after two of them.
        assert!(after(2, 100_000_000).is_some());
        assert_eq!(after(1, 700_000_000), None);
    }

    #[test]
    fn the_warning_says_what_happens_and_what_to_do() {
        let scene = scene();
        let slow = StepTime {
            took_ns: 260_000_000,
            asked_ns: 10_000_000,
        };
        let real = slow.warning(&scene.scene, Some(Clock::Real), 6.0, 8);
        assert_eq!(
            real,
            "a step takes about 260 ms, and the scene needs a step every 10 ms: under the real clock the host leaves out \
             about 96 % of its steps, and the bodies move slower than the hands. Lower `host.step_rate` and \
             `host.publish_rate` to 3 Hz or less, or use a coarser mesh, or share the steps among cores \
             (`host.threads = 4`)"
        );
        let virtual_time = slow.warning(&scene.scene, Some(Clock::Virtual), 6.0, 1);
        assert!(virtual_time.contains("in virtual time a run of 6 s takes 2.6 min or more"));
        assert!(!virtual_time.contains("host.threads"));
        // No advice of what the scene has already.
        let mut shared = scene.scene.clone();
        shared.host.threads = 4;
        let told = slow.warning(&shared, None, 6.0, 8);
        assert!(!told.contains("host.threads"), "{told}");
    }

    #[test]
    fn steps_left_out_are_told_with_their_cause() {
        let scene = scene();
        let told = |ns, count| skipped(&scene.scene, &stats(100, ns), count, 1);
        assert_eq!(told(5_000_000, 0), None);
        let slow = told(8_000_000, 100).expect("skipped");
        assert!(slow.starts_with("the host left out 100 of 200 steps (50.0 %): a step takes"));
        assert!(slow.contains("Lower `host.step_rate`"), "{slow}");
        let stalled = told(500_000, 1).expect("skipped");
        assert!(
            stalled.contains("although a step takes about 500 us"),
            "{stalled}"
        );
    }

    #[test]
    fn rates_are_rounded_down_to_two_digits() {
        for (x, rounded) in [(3.09, 3.0), (249.9, 240.0), (0.0876, 0.087), (100.0, 100.0)] {
            assert_eq!(two_digits_down(x), rounded);
        }
    }
}
