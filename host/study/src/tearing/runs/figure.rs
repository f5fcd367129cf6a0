//! The force over a tear: elastic rise, onset, and a plateau at a fraction of the peak (thesis, figure 4.7).
//!
//! The scene runs under virtual time with its simulated devices and hands. The force is that which a device renders.

use crate::StudyError;
use host::run::prepare::Options;
use host::run::session::Session;
use host::scene::LoadedScene;
use host::world::World;
use rt_core::Vec3;
use serde::Serialize;

/// Part of the torn area at the start and at the end of the plateau. Before, the force falls from its peak; after, hands
/// slow down.
const PLATEAU: [f64; 2] = [0.1, 0.9];

/// The state in a tick.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Sample {
    /// Time (s).
    pub time: f64,
    /// How far each hand has moved along its way (m).
    pub moved: [f64; 2],
    /// The force against the motion of each hand (N).
    pub force: [f64; 2],
    /// Torn area (m^2).
    pub area: f64,
}

/// The course of a tear.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Course {
    /// Name of the scene.
    pub scene: String,
    /// Stiffness of the elastic rise at each hand (N/m): the slope of the force over the displacement before the first
    /// edit.
    pub rise: [f64; 2],
    /// How far each hand had moved when the tear started (m).
    pub onset: [f64; 2],
    /// The largest force of each hand (N).
    pub peak: [f64; 2],
    /// Mean force of each hand while the tear runs (N).
    pub plateau: [f64; 2],
    /// Standard deviation of the force of each hand while the tear runs, about its mean (N).
    pub spread: [f64; 2],
    /// Torn area at the end (m^2).
    pub area: f64,
    /// Steps in which the topology changed.
    pub edits: u64,
    /// Faults of the host.
    pub faults: u64,
    /// The course by time.
    pub samples: Vec<Sample>,
}

impl Course {
    /// The plateau as a fraction of the peak, by hand.
    pub fn fractions(&self) -> [f64; 2] {
        [0, 1].map(|hand| self.plateau[hand] / self.peak[hand])
    }
}

/// Runs the scene for at most `most` seconds.
///
/// # Errors
/// [`StudyError`] if the scene cannot be built.
pub fn run(loaded: &LoadedScene, most: f64, progress: &dyn Fn(f64)) -> Result<Course, StudyError> {
    let scene = &loaded.scene;
    let duration = scene.duration.min(most);
    let world = World::new(loaded)?;
    let mut session = Session::new(&world, &Options::new(duration, scene.seed))?;
    let ticks = duration * scene.realtime.rate;
    let mut start: Option<[Vec3; 2]> = None;
    let mut paths: Vec<(f64, [Vec3; 2], [Vec3; 2], f64)> = Vec::new();
    while let Some(telemetry) = session.tick() {
        let devices = [0, 1].map(|hand| &telemetry.devices[hand]);
        let places = devices.map(|device| device.pose.position);
        let start = start.get_or_insert(places);
        let moved = [0, 1].map(|hand| places[hand] - start[hand]);
        let force = devices.map(|device| device.wrench.force);
        let area = session.engine().map_or(0.0, |engine| {
            engine.stats().tears.iter().map(|tear| tear.area).sum()
        });
        paths.push((telemetry.time_ns as f64 * 1e-9, moved, force, area));
        if session.ticks().is_multiple_of(256) {
            progress(session.ticks() as f64 / ticks);
        }
    }
    let running = session.end();
    // Each hand moves along a line.
    let ways = paths.last().map_or([Vec3::zeros(); 2], |(_, moved, ..)| {
        moved.map(|moved| moved.try_normalize(0.0).unwrap_or_default())
    });
    let samples = paths.iter().map(|(time, moved, force, area)| Sample {
        time: *time,
        moved: [0, 1].map(|hand| ways[hand].dot(&moved[hand])),
        force: [0, 1].map(|hand| -ways[hand].dot(&force[hand])),
        area: *area,
    });
    let stats = running.host.engine.stats();
    Ok(course(
        scene.name.clone(),
        samples.collect(),
        [stats.torn, stats.faults],
    ))
}

/// The figures of a course. `counts` are the steps with edits, and the faults.
fn course(scene: String, samples: Vec<Sample>, [edits, faults]: [u64; 2]) -> Course {
    let area = samples.last().map_or(0.0, |sample| sample.area);
    let first = samples.iter().position(|sample| sample.area > 0.0);
    let elastic = &samples[..first.unwrap_or(samples.len())];
    let torn = PLATEAU.map(|part| part * area);
    let plateau: Vec<&Sample> = samples
        .iter()
        .filter(|sample| area > 0.0 && sample.area >= torn[0] && sample.area <= torn[1])
        .collect();
    let count = plateau.len().max(1) as f64;
    let mean = [0, 1].map(|hand| plateau.iter().map(|s| s.force[hand]).sum::<f64>() / count);
    let spread = [0, 1].map(|hand| {
        let squares = plateau.iter().map(|s| (s.force[hand] - mean[hand]).powi(2));
        (squares.sum::<f64>() / count).sqrt()
    });
    Course {
        scene,
        rise: [0, 1].map(|hand| slope(elastic.iter().map(|s| (s.moved[hand], s.force[hand])))),
        onset: first.map_or([f64::NAN; 2], |first| samples[first].moved),
        peak: [0, 1].map(|hand| samples.iter().map(|s| s.force[hand]).fold(0.0, f64::max)),
        plateau: mean,
        spread,
        area,
        edits,
        faults,
        samples,
    }
}

/// The slope of the line through the origin that is nearest to the points, by least squares.
fn slope(points: impl Iterator<Item = (f64, f64)>) -> f64 {
    let [products, squares] = points.fold([0.0; 2], |[p, s], (x, y)| [p + x * y, s + x * x]);
    products / squares
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_figures_of_a_made_course_are_its_own() {
        // A rise of 100 N/m up to 2 N, then 1 N while the tear grows evenly.
        let samples = (0..100).map(|k| {
            let moved = f64::from(k) * 1e-3;
            let force = if k <= 20 { 100.0 * moved } else { 1.0 };
            Sample {
                time: moved,
                moved: [moved; 2],
                force: [force; 2],
                area: (f64::from(k) - 20.0).max(0.0),
            }
        });
        let found = course(String::new(), samples.collect(), [79, 0]);
        assert!((found.rise[0] - 100.0).abs() < 1e-9);
        assert!((found.peak[1] - 2.0).abs() < 1e-12);
        assert!((found.onset[0] - 0.021).abs() < 1e-12);
        assert!((found.plateau[0] - 1.0).abs() < 1e-12 && found.spread[0] < 1e-12);
        assert!((found.fractions()[0] - 0.5).abs() < 1e-12);
    }
}
