//! Crates for hierarchies of boxes beside the kept lists of the product, in the motions of `palpate bench contact`.
//!
//! ```sh
//! cargo run --release --manifest-path tests/detection/Cargo.toml -- [CELLS [FOLDER]]
//! ```
//!
//! FOLDER keeps the meshes and the pairs of the first 24 steps, for programs in other languages (`dump`).
//!
//! A method finds all vertex-triangle and edge-edge pairs that are nearer than 1 mm, in each step of a motion. The crates
//! hold a tree over the boxes of the triangles, grown by half of this distance; each pair of triangles whose boxes overlap
//! then goes through the same `narrow` search, with the product's own distances. The program fails if two methods find
//! different pairs.
//!
//! Times are processor times of the thread. The methods take turns in each step, so that all run under the same load.
//! Allocations are calls of the allocator (allocate, reallocate, free) in one step, after the first two steps.

mod boxes;
mod dump;
#[path = "../../../host/study/src/contact/motions.rs"]
mod motions;
mod narrow;
mod ours;
mod trees;

use dump::Dump;
use motions::Scene;
use narrow::Things;
use physics::Vec3;
use physics::contact::Pair;
use rustix::time::{ClockId, clock_gettime};
use std::error::Error;
use std::path::{Path, PathBuf};

#[global_allocator]
static ALLOCATOR: alloc_count::calls::Counting = alloc_count::calls::Counting;

/// The error of `motions`.
type StudyError = Box<dyn Error>;

/// The distance up to which all pairs are found (m).
const NEED: f64 = 2.0 * (motions::RADIUS + motions::REACH);
/// Steps of a motion, which then runs backwards.
const THERE: u32 = 24;

/// A way to find the pairs.
trait Method {
    /// The crate and its version, or what of the product.
    fn name(&self) -> &'static str;
    /// Makes the tree anew at the positions `x` (m).
    fn build(&mut self, things: &Things, x: &[Vec3]);
    /// Has the tree follow the positions `x` (m), and says whether it can.
    fn refit(&mut self, things: &Things, x: &[Vec3]) -> bool;
    /// Finds the pairs nearer than [`NEED`]. Returns the number of distances that were computed.
    fn search(&mut self, things: &Things, x: &[Vec3], found: &mut Vec<Pair>) -> usize;
}

/// What a method took in each step.
#[derive(Default)]
struct Taken {
    builds: Vec<f64>,
    refits: Vec<f64>,
    searches: Vec<f64>,
    steps: Vec<f64>,
    allocations: Vec<f64>,
    distances: Vec<f64>,
    /// The time of the last step (s).
    last: f64,
}

fn main() -> Result<(), StudyError> {
    let mut arguments = std::env::args().skip(1);
    let cells = arguments.next().map_or(Ok(29), |text| text.parse())?;
    let folder = arguments.next().map(PathBuf::from);
    println!(
        "| scene | triangles | method | build ms | refit ms | search ms | step ms, median | worst | distances | allocations |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    for scene in motions::all(cells)? {
        compare(&scene, folder.as_deref())?;
    }
    Ok(())
}

fn compare(scene: &Scene, folder: Option<&Path>) -> Result<(), StudyError> {
    let at = |step: u32| {
        let phase = step % (2 * THERE);
        scene.at(f64::from(phase.min(2 * THERE - phase)) * motions::STEP)
    };
    let things = Things::new(&scene.surfaces);
    let first = at(0);
    let mut methods: Vec<Box<dyn Method>> = vec![
        Box::new(ours::Kept::new(&things, &first)),
        Box::new(ours::Anew::new(&things, &first)),
        Box::new(trees::Parry::new(&things)),
        Box::new(trees::Obvhs::new(&things)),
        Box::new(trees::OfBvh::new(&things)),
    ];
    let mut taken: Vec<Taken> = methods.iter().map(|_| Taken::default()).collect();
    let mut found: Vec<Vec<Pair>> = methods
        .iter()
        .map(|_| Vec::with_capacity(1 << 20))
        .collect();
    for (method, taken) in methods.iter_mut().zip(&mut taken) {
        for _ in 0..5 {
            taken.builds.push(timed(|| method.build(&things, &first)).1);
        }
    }
    let mut dump = Dump::default();
    for step in 0..4 * THERE {
        let x = at(step);
        for ((method, taken), found) in methods.iter_mut().zip(&mut taken).zip(&mut found) {
            found.clear();
            let before = alloc_count::calls::so_far();
            let (can, refit) = timed(|| method.refit(&things, &x));
            let refit = if can {
                refit
            } else {
                timed(|| method.build(&things, &x)).1
            };
            let (distances, search) = timed(|| method.search(&things, &x, found));
            taken.last = refit + search;
            let allocations = alloc_count::calls::so_far() - before;
            if step < 2 {
                continue;
            }
            if can {
                taken.refits.push(refit);
            }
            taken.searches.push(search);
            taken.steps.push(refit + search);
            taken.allocations.push(allocations as f64);
            taken.distances.push(distances as f64);
        }
        for found in &mut found {
            found.sort_unstable();
        }
        if step < THERE {
            dump.step(&x, &found[0], taken[0].last);
        }
        for (method, other) in methods.iter().zip(&found) {
            if *other != found[0] {
                let missed = found[0]
                    .iter()
                    .filter(|pair| other.binary_search(pair).is_err());
                return Err(format!(
                    "{}, step {step}: {} finds {} pairs, the kept lists find {}, of which it misses {}",
                    scene.name,
                    method.name(),
                    other.len(),
                    found[0].len(),
                    missed.count(),
                )
                .into());
            }
        }
    }
    if let Some(folder) = folder {
        dump.write(scene, folder)?;
    }
    for (method, mut taken) in methods.iter().zip(taken) {
        let ms = |times: &mut Vec<f64>| {
            if times.is_empty() {
                "none".to_owned()
            } else {
                format!("{:.3}", 1e3 * median(times))
            }
        };
        println!(
            "| {} | {} | {} | {} | {} | {} | {} | {:.3} | {:.0} | {:.0} |",
            scene.name,
            scene.surfaces.triangles.len(),
            method.name(),
            ms(&mut taken.builds),
            ms(&mut taken.refits),
            ms(&mut taken.searches),
            ms(&mut taken.steps),
            1e3 * taken.steps.iter().copied().fold(0.0, f64::max),
            median(&mut taken.distances),
            taken.allocations.iter().copied().fold(0.0, f64::max),
        );
    }
    Ok(())
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    values[values.len() / 2]
}

/// What a call returns, and its processor time (s).
fn timed<T>(call: impl FnOnce() -> T) -> (T, f64) {
    let now = || {
        let time = clock_gettime(ClockId::ThreadCPUTime);
        time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
    };
    let start = now();
    let result = call();
    (result, now() - start)
}
