//! The force of a running tear under slow hosts, against the force of a host that steps and publishes in every tick.
//!
//! Some hosts make the same steps as the reference and publish rarely: their error is that of the extrapolation. The
//! other hosts also step rarely: their error contains that of the long steps, after which the tear is elsewhere.
//!
//! The models of each host are rendered with the limit that tears set to the extrapolation, and without it.

use crate::StudyError;
use crate::hands::Hands;
use crate::slow_host::{Forces, SlowHost, TICK, unlimited, whole};
use host::engine::stats::WallStopwatch;
use host::scene::LoadedScene;
use host::world::World;
use serde::Serialize;

/// Steps a second (Hz) of the hosts, and the steps for each publication. The last is the reference.
pub const HOSTS: [(f64, u64); 7] = [
    (1000.0, 16),
    (1000.0, 8),
    (1000.0, 4),
    (60.0, 1),
    (125.0, 1),
    (250.0, 1),
    (1000.0, 1),
];
/// The frequencies that count as ripple (Hz).
const BAND: [f64; 2] = [20.0, 400.0];

/// The result of one host.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Cell {
    /// Steps a second (Hz).
    pub step_rate: f64,
    /// Publications a second (Hz).
    pub publish_rate: f64,
    /// Whether the models say how far they may be extrapolated before a tear grows.
    pub limited: bool,
    /// Median error of the force on a hand, as a fraction of the plateau (1).
    pub median: f64,
    /// RMS of the error, as a fraction of the plateau (1).
    pub rms: f64,
    /// 95th percentile of the error, as a fraction of the plateau (1).
    pub p95: f64,
    /// Largest error of the force on a hand (N).
    pub worst: f64,
    /// Ripple of the force along the pull from 20 to 400 Hz (N, RMS): the larger of the hands.
    pub ripple: f64,
    /// Ripple of the error of that force from 20 to 400 Hz (N, RMS): the larger of the hands.
    pub error_ripple: f64,
    /// Steps in which the topology changed.
    pub torn: u64,
    /// Torn area, as a fraction of that of the reference (1).
    pub area: f64,
    /// Faults of the host.
    pub faults: u64,
}

/// The results of the part.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Feel {
    /// Name of the scene.
    pub scene: String,
    /// Mean force on a hand while the tear runs, of the reference (N).
    pub plateau: f64,
    /// The time from the first to the last edit of the reference (s).
    pub window: [f64; 2],
    /// All hosts. The reference has no error, but a ripple.
    pub cells: Vec<Cell>,
}

/// The torn area (m2).
fn area(host: &SlowHost) -> f64 {
    let tears = host.engine.stats().tears.iter();
    tears.map(|tear| tear.area).sum()
}

/// Runs the scene for at most `most` seconds.
///
/// # Errors
/// [`StudyError`] if the scene cannot be built.
pub fn run(loaded: &LoadedScene, most: f64, progress: &dyn Fn(f64)) -> Result<Feel, StudyError> {
    let duration = loaded.scene.duration.min(most);
    let ticks = (duration / TICK).round() as u64;
    let changes = [unlimited, whole];
    let rivals = HOSTS
        .iter()
        .map(|host| SlowHost::new(loaded, *host, &changes));
    let mut rivals: Vec<SlowHost> = rivals.collect::<Result<_, _>>()?;
    let Some(reference) = rivals.last() else {
        return Ok(empty(loaded));
    };
    let hands = Hands::new(&World::new(loaded)?, &reference.engine);
    let ways = hands.directions(duration);
    let watch = WallStopwatch::start();
    // The first and the last tick with an edit of the reference.
    let mut window: Option<[usize; 2]> = None;
    for number in 1..=ticks {
        let torn = rivals.last().map_or(0, |rival| rival.engine.stats().torn);
        for rival in &mut rivals {
            rival.tick(&hands, number, number * 1_000_000, &watch);
        }
        if rivals
            .last()
            .is_some_and(|rival| rival.engine.stats().torn > torn)
        {
            let at = number as usize - 1;
            window = Some([window.map_or(at, |[first, _]| first), at]);
        }
        progress(number as f64 / ticks as f64);
    }
    let Some(([first, last], reference)) = window.zip(rivals.last()) else {
        return Ok(empty(loaded));
    };
    let span = first..=last;
    let exact = &hands_of(&reference.forces(1)[span.clone()]);
    let norms = exact.iter().flatten().map(rt_core::Vec3::norm);
    let plateau = norms.sum::<f64>() / (2 * exact.len()) as f64;
    let torn = area(reference);
    let mut cells = Vec::new();
    for (rival, (rate, steps)) in rivals.iter().zip(HOSTS) {
        for limited in [false, true] {
            let forces = &hands_of(&rival.forces(usize::from(limited))[span.clone()]);
            let pairs = forces.iter().flatten().zip(exact.iter().flatten());
            let mut errors: Vec<f64> = pairs.map(|(force, exact)| (force - exact).norm()).collect();
            errors.sort_by(f64::total_cmp);
            let squares: f64 = errors.iter().map(|error| error * error).sum();
            let at = |part: f64| errors[((errors.len() - 1) as f64 * part) as usize];
            let ripple = |value: &dyn Fn(usize, usize) -> rt_core::Vec3| {
                let hands = ways.iter().take(2).enumerate().map(|(hand, way)| {
                    let ticks = 0..forces.len();
                    let along: Vec<f64> = ticks.map(|at| way.dot(&value(at, hand))).collect();
                    band(&along)
                });
                hands.fold(0.0, f64::max)
            };
            cells.push(Cell {
                step_rate: rate,
                publish_rate: rate / steps as f64,
                limited,
                median: at(0.5) / plateau,
                rms: (squares / errors.len() as f64).sqrt() / plateau,
                p95: at(0.95) / plateau,
                worst: at(1.0),
                ripple: ripple(&|at, hand| forces[at][hand]),
                error_ripple: ripple(&|at, hand| forces[at][hand] - exact[at][hand]),
                torn: rival.engine.stats().torn,
                area: area(rival) / torn,
                faults: rival.engine.stats().faults,
            });
        }
    }
    Ok(Feel {
        scene: loaded.scene.name.clone(),
        plateau,
        window: [first, last].map(|tick| (tick + 1) as f64 * TICK),
        cells,
    })
}

/// The forces on the first two hands.
fn hands_of(forces: &[Forces]) -> Vec<[rt_core::Vec3; 2]> {
    forces.iter().map(|forces| [forces[0], forces[1]]).collect()
}

/// The result if nothing tears.
fn empty(loaded: &LoadedScene) -> Feel {
    Feel {
        scene: loaded.scene.name.clone(),
        plateau: 0.0,
        window: [0.0; 2],
        cells: Vec::new(),
    }
}

/// The RMS value of the parts of `values` (one a tick) with frequencies in [`BAND`], by a discrete Fourier transform
/// under a Hann window, after the straight line through the values was taken away.
fn band(values: &[f64]) -> f64 {
    let n = values.len();
    if n < 100 {
        return 0.0;
    }
    let middle = 0.5 * (n - 1) as f64;
    let mean = values.iter().sum::<f64>() / n as f64;
    let about = |k: usize| k as f64 - middle;
    let [products, squares] = (0..n).fold([0.0; 2], |[p, s], k| {
        [p + about(k) * values[k], s + about(k) * about(k)]
    });
    let slope = products / squares;
    let turn = std::f64::consts::TAU / n as f64;
    let window = |k: usize| 0.5 - 0.5 * libm::cos(turn * k as f64);
    let power = (0..n).map(|k| window(k) * window(k)).sum::<f64>();
    let rest: Vec<f64> = (0..n)
        .map(|k| (values[k] - mean - slope * about(k)) * window(k))
        .collect();
    let bins = (1..n / 2).filter(|bin| {
        let frequency = *bin as f64 / (n as f64 * TICK);
        (BAND[0]..=BAND[1]).contains(&frequency)
    });
    let squares = bins.map(|bin| {
        let (mut re, mut im) = (0.0, 0.0);
        for (k, value) in rest.iter().enumerate() {
            // The angle is reduced as an integer, so that it stays exact.
            let angle = turn * ((bin * k) % n) as f64;
            re += value * libm::cos(angle);
            im += value * libm::sin(angle);
        }
        2.0 * (re * re + im * im)
    });
    (squares.sum::<f64>() / (n as f64 * power)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ripple_of_a_sine_is_its_own_inside_the_band_and_none_outside() {
        let sine = |frequency: f64| -> Vec<f64> {
            let angle = std::f64::consts::TAU * frequency * TICK;
            (0..1000)
                .map(|k| 3.0 + 0.01 * f64::from(k) + libm::sin(angle * f64::from(k)))
                .collect()
        };
        // The RMS value of a sine is 1 / sqrt(2). The window spreads it over three bins.
        assert!((band(&sine(100.0)) - 0.5_f64.sqrt()).abs() < 1e-3);
        assert!(band(&sine(5.0)) < 1e-3);
    }
}
