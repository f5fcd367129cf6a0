//! One scene under several force schemes, side by side: the same hands, the same seed, the same host.
//!
//! Each run is the run of `palpate run` in virtual time, tick for tick. Beside them, the reference run has the physics
//! inside the tick, with hands of its own that have the same targets: see [`crate::stress::scene`]. The force error of a
//! scheme is the difference from the reference at the same time. It contains what the scheme, the period and the latency
//! of the host do to the force, and what the hand does in response.
//!
//! Net energy is integrated at the ports between ticks, as in `palpate stress`. The account of the controller is not
//! used.

mod measure;
mod picture;
mod record;
mod table;
#[cfg(test)]
mod tests;
mod words;

pub use measure::{BodyMeasures, DeviceMeasures, ForceError, Measures};
pub use record::{BodyRecord, DeviceRecord, Record};
pub use table::csv;

use crate::stress::scene::draw::Draw;
use crate::stress::scene::trial::Trial;
use crate::stress::scene::{SCHEMES, reference};
use crate::workers;
use crate::{Results, StudyError};
use host::engine::faults::HostFault;
use host::plot::Picture;
use host::run::prepare::{Options, Prepared};
use host::run::session::Session;
use host::run::tear_force::TearForce;
use host::scene::LoadedScene;
use host::scene::spec::SchemeName;
use host::world::World;
use physics::TearReport;
use record::Recorder;
use serde::Serialize;
use std::num::NonZero;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

/// Version of the JSON of a [`Comparison`].
pub const SCHEMA: &str = "palpate.compare/1";
/// Largest difference of the ratio of two rates from a whole number, relative.
const WHOLE: f64 = 1e-9;

/// The options of a comparison.
#[derive(Clone, Debug, Default)]
pub struct Settings {
    /// The schemes; all of them if there are none.
    pub schemes: Vec<SchemeName>,
    /// Publication rates of the host (Hz); that of the scene if there are none.
    pub publish_rates: Vec<f64>,
    /// The seed, if not the scene's.
    pub seed: Option<u64>,
    /// Length of the runs (s), if not the scene's.
    pub duration: Option<f64>,
    /// Time from which errors and ripple are measured (s); if none: when the first forces have faded in, see
    /// [`Comparison::measured_from`].
    pub from: Option<f64>,
    /// Faults that the host makes on purpose. The reference has no host, and no faults.
    pub faults: Vec<HostFault>,
    /// Whether to leave out the reference.
    pub without_reference: bool,
    /// Number of threads; the number of cores if none. The number changes no result.
    pub threads: Option<NonZero<usize>>,
}

/// A scene under several schemes.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    /// [`SCHEMA`].
    pub schema: &'static str,
    /// Name of the scene.
    pub scene: String,
    /// The seed.
    pub seed: u64,
    /// Length of each run (s).
    pub duration: f64,
    /// Ticks a second (Hz).
    pub tick_rate: f64,
    /// Physics steps of the host a second (Hz).
    pub step_rate: f64,
    /// Time from reading the hands to the arrival of the model (s).
    pub latency: f64,
    /// Time from which force errors, RMS forces and ripple are measured (s): the time that was given, or the arrival of the
    /// first model at the slowest rate plus twice `loop.recovery`, in which the force fades in, but at most half of the run.
    pub measured_from: f64,
    /// The faults that the host made on purpose.
    pub faults: Vec<String>,
    /// Values of the scene that few scenes mean.
    pub warnings: Vec<String>,
    /// The reference run; none if it was left out or could not run.
    pub reference: Option<Measures>,
    /// Why there is no reference, if it could not run.
    pub no_reference: Option<String>,
    /// The runs, by publication rate in the given order, then by scheme.
    pub runs: Vec<Run>,
    /// The reference, tick by tick.
    #[serde(skip)]
    pub reference_record: Option<Record>,
}

impl Results for Comparison {
    fn tables(&self) -> String {
        words::words(self)
    }

    fn picture(&self) -> Option<Picture> {
        Some(picture::picture(self))
    }
}

/// One run.
#[derive(Clone, Debug, Serialize)]
pub struct Run {
    /// The scheme.
    pub scheme: &'static str,
    /// Local models a second (Hz).
    pub publish_rate: f64,
    /// The measurements.
    #[serde(flatten)]
    pub measures: Measures,
    /// Failures of the host, such as a panic.
    pub failures: Vec<String>,
    /// The run, tick by tick.
    #[serde(skip)]
    pub record: Record,
}

/// The result of one run.
enum Done {
    Reference(Result<Record, StudyError>),
    Run(Result<Ran, StudyError>),
}

/// Runs `loaded` under each scheme and each publication rate. `progress` receives the fraction done, from any thread.
///
/// # Errors
/// [`StudyError`] if the scene cannot be built, if the host of the scene cannot publish at one of the rates, or if the
/// measurements would begin after the runs.
pub fn compare(
    loaded: &LoadedScene,
    settings: &Settings,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Comparison, StudyError> {
    let mut loaded = loaded.clone();
    loaded.scene.seed = settings.seed.unwrap_or(loaded.scene.seed);
    loaded.scene.duration = settings.duration.unwrap_or(loaded.scene.duration);
    let duration = loaded.scene.duration;
    if let Some(found) = settings.from.filter(|from| *from >= duration) {
        return Err(StudyError::MeasuredFrom { found, duration });
    }
    let built = World::new(&loaded)?;
    let runs = runs(&loaded, settings)?;
    // The scene of each run; none for the reference, which takes longest and is first.
    let mut jobs: Vec<Option<&LoadedScene>> = runs.iter().map(|(_, run)| Some(run)).collect();
    if !settings.without_reference {
        jobs.insert(0, None);
    }
    let trial = Trial {
        draw: Draw::untroubled(loaded.scene.host.publish_rate, loaded.scene.host.latency),
        soft: None,
        loaded: loaded.clone(),
    };
    let done = AtomicU64::new(0);
    let of = jobs.len() as f64 * 1000.0;
    let add = |thousandths: u64| {
        let before = done.fetch_add(thousandths, Ordering::Relaxed);
        progress((before + thousandths) as f64 / of);
    };
    let found = in_threads(settings.threads, &jobs, workers::STACK, &|job| match job {
        None => {
            let found = reference::run(&trial).map(|trace| Record::of_reference(&trace));
            add(1000);
            Done::Reference(found)
        }
        Some(loaded) => Done::Run(run(loaded, &settings.faults, &add)),
    });
    let (mut reference_record, mut no_reference) = (None, None);
    let mut records = Vec::new();
    for done in found {
        match done {
            Done::Reference(Ok(record)) => reference_record = Some(record),
            Done::Reference(Err(error)) => no_reference = Some(error.to_string()),
            Done::Run(run) => records.push(run?),
        }
    }
    let names: Vec<_> = loaded
        .scene
        .devices
        .iter()
        .map(|d| d.name.clone())
        .collect();
    let expected = reference_record.as_ref();
    let from = settings.from.unwrap_or_else(|| faded_in(&loaded, &runs));
    let mut outcomes = Vec::new();
    for ((scheme, loaded), ran) in runs.iter().zip(records) {
        let Ran {
            record, failures, ..
        } = ran;
        outcomes.push(Run {
            scheme,
            publish_rate: loaded.scene.host.publish_rate,
            measures: Measures::of(&record, &names, expected, from),
            failures,
            record,
        });
    }
    let scene = &loaded.scene;
    Ok(Comparison {
        schema: SCHEMA,
        scene: scene.name.clone(),
        seed: scene.seed,
        duration: scene.duration,
        tick_rate: scene.realtime.rate,
        step_rate: scene.host.step_rate,
        latency: scene.host.latency,
        measured_from: from,
        faults: settings.faults.iter().map(describe).collect(),
        warnings: built.warnings.iter().map(ToString::to_string).collect(),
        reference: expected.map(|record| Measures::of(record, &names, None, from)),
        no_reference,
        runs: outcomes,
        reference_record,
    })
}

/// The time at which the first forces of all `runs` have faded in (s); at most half of the run.
fn faded_in(loaded: &LoadedScene, runs: &[(&'static str, LoadedScene)]) -> f64 {
    let scene = &loaded.scene;
    let rates = runs.iter().map(|(_, run)| run.scene.host.publish_rate);
    let slowest = rates.fold(scene.host.step_rate, f64::min);
    let arrival = scene.host.latency + 1.0 / slowest;
    (arrival + 2.0 * scene.realtime.recovery).min(0.5 * scene.duration)
}

fn describe(fault: &HostFault) -> String {
    let HostFault { at, duration, .. } = fault;
    format!("{} at {at:?} s, for {duration:?} s", fault.name())
}

/// The scene of each run, with the name of its scheme.
fn runs(
    loaded: &LoadedScene,
    settings: &Settings,
) -> Result<Vec<(&'static str, LoadedScene)>, StudyError> {
    let step_rate = loaded.scene.host.step_rate;
    let mut rates = settings.publish_rates.clone();
    if rates.is_empty() {
        rates.push(loaded.scene.host.publish_rate);
    }
    let wanted =
        |scheme: SchemeName| settings.schemes.is_empty() || settings.schemes.contains(&scheme);
    let mut runs = Vec::new();
    for rate in rates {
        let ratio = step_rate / rate;
        let whole = ratio >= 1.0 - WHOLE && (ratio - ratio.round()).abs() <= WHOLE * ratio;
        if !whole {
            return Err(StudyError::PublishRate {
                found: rate,
                step_rate,
            });
        }
        for (scheme, name) in SCHEMES.into_iter().filter(|(scheme, _)| wanted(*scheme)) {
            let mut loaded = loaded.clone();
            loaded.scene.realtime.scheme = scheme;
            loaded.scene.host.publish_rate = rate;
            runs.push((name, loaded));
        }
    }
    Ok(runs)
}

/// A run in virtual time.
pub(crate) struct Ran {
    /// The run, tick by tick.
    pub(crate) record: Record,
    /// The tears of each body at the end.
    pub(crate) tears: Vec<TearReport>,
    /// The force at the tears of each body.
    pub(crate) tear_forces: Vec<Option<TearForce>>,
    /// Failures of the host, such as a panic.
    pub(crate) failures: Vec<String>,
}

/// Runs a scene in virtual time. `add` receives thousandths of the run.
pub(crate) fn run(
    loaded: &LoadedScene,
    faults: &[HostFault],
    add: &dyn Fn(u64),
) -> Result<Ran, StudyError> {
    let scene = &loaded.scene;
    let options = Options {
        faults: faults.to_vec(),
        ..Options::new(scene.duration, scene.seed)
    };
    let mut prepared = Prepared::new(&World::new(loaded)?, &options)?;
    let ticks = prepared.timing.ticks;
    let mut recorder = Recorder::new(scene, &mut prepared);
    let mut session = Session::of(prepared);
    let mut shown = 0;
    while let Some(telemetry) = session.tick() {
        recorder.take(session.tick_loop(), &telemetry, session.engine());
        let now = 1000 * session.ticks() / ticks.max(1);
        if now > shown {
            add(now - shown);
            shown = now;
        }
    }
    let running = session.end();
    add(1000 - shown);
    let mut failures = Vec::new();
    if let Some(message) = &running.panicked {
        failures.push(format!("the host panicked: {message}"));
    }
    if let Some(fault) = &running.host.engine.stats().first_fault {
        failures.push(format!("host steps failed; the first failure: {fault}"));
    }
    let (record, tear_forces) = recorder.finish(&running.tick);
    Ok(Ran {
        record,
        tear_forces,
        tears: running.host.engine.stats().tears.clone(),
        failures,
    })
}

/// The results of `work` on each of `jobs`, in their order, computed by `threads` threads of `stack`
/// bytes, or by the calling thread if the system gives none.
fn in_threads<J: Sync, D: Send>(
    threads: Option<NonZero<usize>>,
    jobs: &[J],
    stack: usize,
    work: &(dyn Fn(&J) -> D + Sync),
) -> Vec<D> {
    let threads = workers::count(threads, jobs.len());
    let next = AtomicUsize::new(0);
    let found = Mutex::new(Vec::new());
    let some = || {
        loop {
            let number = next.fetch_add(1, Ordering::Relaxed);
            let Some(job) = jobs.get(number) else { break };
            let done = work(job);
            let mut found = found.lock().unwrap_or_else(PoisonError::into_inner);
            found.push((number, done));
        }
    };
    std::thread::scope(|scope| {
        if workers::start(scope, threads, stack, || &some) == 0 {
            some();
        }
    });
    let mut found = found.into_inner().unwrap_or_else(PoisonError::into_inner);
    found.sort_by_key(|(number, _)| *number);
    found.into_iter().map(|(_, done)| done).collect()
}
