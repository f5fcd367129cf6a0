//! How well each scheme renders the force between publications.
//!
//! The sheet of the built-in scene is simulated with steps of 1 ms while both hands follow prescribed paths. The
//! reference is the wrench of every step, as if each were published. Couplings with each scheme receive a model at 30
//! to 500 Hz only, and evaluate it at the same poses and velocities. The study therefore measures the scheme and its
//! blending alone: there is no device, no latency and no encoder.
//!
//! Hands that **pull apart** stretch the sheet. Hands that **move together** hold the sheet stretched and carry it
//! around. The motions contain frequencies up to 5 Hz, the limit of voluntary motion.

mod tables;

use crate::StudyError;
use host::engine::publisher::{Elastic, Publisher, Publishing, reference_of};
use host::scene::{LoadedScene, Scene};
use host::world::{World, condense};
use physics::{Budget, Condenser, HandlePose};
use rt_core::coupling::{Coupling, CouplingConfig, Passed};
use rt_core::{HandleReference, MAX_DEVICES, PassivityConfig, Pose, Scheme, Twist, Vec3, Wrench};
use serde::Serialize;
use sim::minimum_jerk;

/// The blends that are compared: the default and the shortest.
pub const BLENDS: [f64; 2] = [0.5, 0.0];
/// Duration of the measured motion (s).
pub const DURATION: f64 = 6.0;
/// Length of a physics step, and the period of the tick (s).
const STEP: f64 = 1e-3;
/// Time in which hands and couplings settle, before the measurement (s).
const SETTLE: f64 = 1.0;
/// Publication rates (Hz).
pub const RATES: [f64; 5] = [30.0, 60.0, 125.0, 250.0, 500.0];

/// The motion of the hands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Motion {
    /// In opposite directions.
    Apart,
    /// In the same direction.
    Together,
}

impl Motion {
    /// Displacement of a hand (m): `side` is -1 for the left, +1 for the right.
    fn displacement(self, side: f64, t: f64) -> Vec3 {
        let (ramp, _) = minimum_jerk(t / SETTLE);
        let sine = |f: f64, phase: f64| libm::sin(std::f64::consts::TAU * f * t + phase);
        match self {
            // 4 to 12 mm of stretch a hand, mostly slow, with a small part at 4.7 Hz.
            Self::Apart => {
                let x =
                    8e-3 + 3e-3 * sine(0.6, 0.0) + 1e-3 * sine(2.1, 1.0) + 0.3e-3 * sine(4.7, 2.0);
                let z = 1e-3 * sine(1.3, 0.5);
                Vec3::new(side * x, 0.0, side * z) * ramp
            }
            // Stretched by 5 mm a hand, and carried around by up to 20 mm.
            Self::Together => {
                let x = 15e-3 * sine(0.5, 0.0) + 2e-3 * sine(2.3, 1.0);
                let y = 10e-3 * sine(0.8, 2.0) + 0.5e-3 * sine(4.7, 0.5);
                let z = 5e-3 * sine(1.1, 1.5);
                Vec3::new(side * 5e-3 + x, y, z) * ramp
            }
        }
    }
}

/// The schemes under test, in the order of the table.
pub const SCHEMES: [&str; 4] = ["hold", "thesis", "linear", "capped"];

/// One cell of the table.
#[derive(Clone, Debug, Serialize)]
pub struct Cell {
    /// The motion of the hands.
    pub motion: Motion,
    /// Publication rate (Hz).
    pub rate: f64,
    /// The scheme's name.
    pub scheme: &'static str,
    /// Fraction of a publication period over which a new model blends in.
    pub blend: f64,
    /// Root mean square error of the force on a hand (N), over both hands.
    pub rms: f64,
    /// Largest error (N).
    pub worst: f64,
}

/// The results of the study.
#[derive(Clone, Debug, Serialize)]
pub struct Extrapolation {
    /// `palpate.extrapolation/1`.
    pub schema: &'static str,
    /// Largest force on a hand while they pull apart, and while they move together (N).
    pub peak: [f64; 2],
    /// Spring and damper of the scheme `thesis` (N/m, N s/m): stiffness and damping of the sheet at 60 Hz.
    pub thesis_gains: [f64; 2],
    /// For each rate (Hz), `|sum_j K_ij|` along x (N/m): the published stiffness for hands that move together. Zero in
    /// the static limit.
    pub rigid_stiffness: Vec<(f64, f64)>,
    /// Largest fraction of the largest eigenvalue that clipping to semidefinite removed.
    pub worst_clip: f64,
    /// All cells.
    pub cells: Vec<Cell>,
}

impl Extrapolation {
    /// The error of one cell (N, RMS), if it was measured.
    pub fn rms(&self, motion: Motion, rate: f64, scheme: &str, blend: f64) -> Option<f64> {
        let mut cells = self.cells.iter();
        cells
            .find(|c| {
                c.motion == motion && c.rate == rate && c.scheme == scheme && c.blend == blend
            })
            .map(|c| c.rms)
    }
}

/// One coupling under test.
struct Rival {
    rate: usize,
    scheme: Scheme,
    blend: f64,
    coupling: Coupling,
    squares: f64,
    worst: f64,
}

/// Runs the study over `duration` seconds of motion, at these rates and blends. `progress` receives the fraction done.
///
/// # Errors
/// [`StudyError`].
pub fn run(
    duration: f64,
    rates: &[f64],
    blends: &[f64],
    progress: &mut dyn FnMut(f64),
) -> Result<Extrapolation, StudyError> {
    let loaded = Scene::embedded_default()?;
    let gains = thesis_gains(&loaded)?;
    let mut found = Extrapolation {
        schema: "palpate.extrapolation/1",
        peak: [0.0; 2],
        thesis_gains: gains,
        rigid_stiffness: Vec::new(),
        worst_clip: 0.0,
        cells: Vec::new(),
    };
    let schemes = SCHEMES.map(|name| match name {
        "hold" => Scheme::Hold,
        "thesis" => Scheme::Thesis {
            stiffness: gains[0],
            damping: gains[1],
        },
        "linear" => Scheme::Linear,
        _ => Scheme::Capped,
    });
    for (half, motion) in [Motion::Apart, Motion::Together].into_iter().enumerate() {
        let mut rivals = Vec::new();
        for rate in 0..rates.len() {
            for scheme in schemes {
                for &blend in blends {
                    let coupling = Coupling::new(config(scheme, blend));
                    rivals.push(Rival {
                        rate,
                        scheme,
                        blend,
                        coupling,
                        squares: 0.0,
                        worst: 0.0,
                    });
                }
            }
        }
        let mut report = |fraction: f64| progress(0.5 * (half as f64 + fraction));
        let race = race(&loaded, motion, duration, rates, &mut rivals, &mut report)?;
        found.peak[half] = race.peak;
        found.worst_clip = found.worst_clip.max(race.worst_clip);
        found.rigid_stiffness = rates.iter().copied().zip(race.rigid_stiffness).collect();
        found.cells.extend(rivals.into_iter().map(|rival| Cell {
            motion,
            rate: rates[rival.rate],
            scheme: rival.scheme.name(),
            blend: rival.blend,
            rms: (rival.squares / race.samples).sqrt(),
            worst: rival.worst,
        }));
    }
    Ok(found)
}

fn config(scheme: Scheme, blend: f64) -> CouplingConfig {
    CouplingConfig {
        scheme,
        period: STEP,
        blend,
        // Models are never late here, and the trust is one long before the measurement.
        age_limit: 1.0,
        decay: 0.1,
        recovery: 0.1,
        hold_damping: [0.0; MAX_DEVICES],
        passivity: PassivityConfig::new(1e-3),
    }
}

/// The results of a race, except for the errors of its couplings.
struct Race {
    peak: f64,
    worst_clip: f64,
    rigid_stiffness: Vec<f64>,
    samples: f64,
}

fn race(
    loaded: &LoadedScene,
    motion: Motion,
    duration: f64,
    rates: &[f64],
    rivals: &mut [Rival],
    progress: &mut dyn FnMut(f64),
) -> Result<Race, StudyError> {
    let world = World::new(loaded)?;
    let mut sheet = world.start(0).clone();
    let handles = &world.bodies[0].handles;
    // Far tighter than any measured error.
    sheet.set_budget(Budget {
        tolerance: 1e-9,
        absolute_tolerance: 1e-10,
        max_iterations: 10_000,
    })?;
    // One condenser and one publisher for each rate, because the drift and the energy of a model need the model before.
    let condensers: Result<Vec<_>, _> = rates.iter().map(|_| Condenser::new(&sheet)).collect();
    let mut condensers = condensers?;
    let devices: Vec<u8> = (0..handles.len() as u8).collect();
    let publisher = |rate: &f64| {
        let publishing = Publishing {
            period: 1.0 / rate,
            horizon: 1.0,
            // The cap needs the energy that the models claim.
            energy: true,
            ..Publishing::default()
        };
        Publisher::new(&sheet, &devices, publishing)
    };
    let mut publishers: Vec<_> = rates.iter().map(publisher).collect();
    let steps = (duration / STEP).round() as u64;
    let mut published = vec![0_u64; rates.len()];
    let mut race = Race {
        peak: 0.0,
        worst_clip: 0.0,
        rigid_stiffness: vec![0.0; rates.len()],
        samples: 0.0,
    };
    for step in 1..=steps {
        let t = step as f64 * STEP;
        let target = |(i, handle): (usize, &physics::HandleSpec)| {
            let side = if i == 0 { -1.0 } else { 1.0 };
            HandlePose::at(handle.origin + motion.displacement(side, t))
        };
        let targets: Vec<_> = handles.iter().enumerate().map(target).collect();
        sheet.step(STEP, &targets)?;

        let time_ns = step * 1_000_000;
        let reports = (0..).map_while(|device| Some((device, sheet.handle_report(device.into())?)));
        let truth: Vec<HandleReference> = reports
            .map(|(device, report)| reference_of(device, report))
            .collect();
        let hands: Vec<(Pose, Twist)> = truth.iter().map(|h| (h.pose, h.twist)).collect();

        for (index, rate) in rates.iter().enumerate() {
            // A publication is due at the first step at or after each multiple of the period.
            let due = (t * rate * (1.0 + 1e-12)) as u64;
            if due == published[index] {
                continue;
            }
            published[index] = due;
            let condensed = condensers[index].condense(&sheet, 1.0 / rate)?;
            race.worst_clip = race.worst_clip.max(condensed.stiffness_clip.fraction);
            let row = (0..handles.len()).map(|j| condensed.stiffness[(0, 6 * j)]);
            race.rigid_stiffness[index] = row.sum::<f64>().abs();
            let publisher = &mut publishers[index];
            publisher.take(condensed);
            let elastic = Elastic::Whole(sheet.elastic_energy());
            let model = publisher.publish(&sheet, elastic, time_ns);
            for rival in rivals.iter_mut().filter(|rival| rival.rate == index) {
                // The coupling accepts any sound model. A refusal would appear as a growing error.
                let _ = rival.coupling.accept(model);
            }
        }

        let measured = t > SETTLE;
        for rival in rivals.iter_mut() {
            let wrenches = rival.coupling.tick(time_ns, &hands);
            // Nothing limits the devices here: they hold what the scheme renders. The account needs to know.
            let mut held = [Wrench::zero(); MAX_DEVICES];
            for (held, (wrench, _)) in held.iter_mut().zip(wrenches.iter().zip(handles)) {
                *held = *wrench;
            }
            rival.coupling.hold(&held, &[Passed::WHOLE; MAX_DEVICES]);
            if measured {
                for (wrench, reference) in wrenches.iter().zip(&truth) {
                    let error = (wrench.force - reference.wrench.force).norm();
                    rival.squares += error * error;
                    rival.worst = rival.worst.max(error);
                }
            }
        }
        if measured {
            race.samples += handles.len() as f64;
            let forces = truth.iter().map(|h| h.wrench.force.norm());
            race.peak = forces.fold(race.peak, f64::max);
        }
        progress(step as f64 / steps as f64);
    }
    Ok(race)
}

/// The best constants for equation 4.5: stiffness and damping of the sheet along the pull, as the left hand meets them
/// at 60 Hz.
fn thesis_gains(loaded: &LoadedScene) -> Result<[f64; 2], StudyError> {
    let condenser = condense(&World::new(loaded)?.bodies[0], 1.0 / 60.0)?;
    let condensed = condenser.condensed();
    Ok([condensed.stiffness[(0, 0)], condensed.damping[(0, 0)]])
}
