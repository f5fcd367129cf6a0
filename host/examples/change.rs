//! What a change of a body costs the steps: a third hand grabs a solid in motion, on blocks of several sizes.
//!
//! ```text
//! cargo run --release -p palpate-host --example change
//! ```
//!
//! The times are medians over `RUNS` changes, on a background thread: of an ordinary step, of the call that asks
//! for the change (it copies the body), of the step in which the change lands, and from the call to the landing.

use host::engine::Engine;
use host::engine::build::{BuildOptions, bodies};
use host::engine::change::{Edit, Grip};
use host::engine::pacer::Due;
use host::engine::stats::{Stopwatch, WallStopwatch};
use host::scene::Scene;
use host::world::World;
use physics::{Border, Freedom, HandleSpec};
use rt_core::{Pose, TickRecord};
use std::collections::BTreeMap;
use std::error::Error;

/// Changes of each block.
const RUNS: usize = 5;

/// A block of `cells` cubes of six tetrahedra along each side of its square cross-section and twice as many along it.
fn scene(cells: u32) -> String {
    let mut text = format!(
        r#"
name = "block"
gravity = [0.0, 0.0, 0.0]
[[body]]
name = "block"
mesh.box = {{ size = [0.2, 0.1, 0.1], cells = [{}, {cells}, {cells}] }}
material = {{ young = 20e3, poisson = 0.3, density = 1000.0 }}
"#,
        2 * cells
    );
    let sides = ["left", "right"];
    text.extend(sides.map(|side| {
        format!(
            r#"
[[body.handle]]
name = "{side} end"
group = "{side}"
device = "{side}"
"#
        )
    }));
    text.extend(sides.map(|side| {
        format!(
            r#"
[[device]]
name = "{side}"
model = "falcon"
[device.hand]
waypoints = [[0.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]]
"#
        )
    }));
    text
}

struct Rig {
    engine: Engine,
    hands: [Pose; 3],
    tick: u64,
    watch: WallStopwatch,
}

impl Rig {
    /// Takes a step after four ticks in which the right hand pulls slowly. Returns its time (ns).
    fn step(&mut self) -> u64 {
        for _ in 0..4 {
            self.tick += 1;
            let mut record = TickRecord::empty();
            record.time_ns = self.tick * 1_000_000;
            record.device_count = 3;
            self.hands[1].position.x += 5e-6;
            for (proxy, hand) in record.proxies.iter_mut().zip(&self.hands) {
                proxy.0 = *hand;
            }
            self.engine.follow(&record);
        }
        let due = Due {
            time_ns: self.tick * 1_000_000,
            publishes: true,
        };
        let start = self.watch.now_ns();
        self.engine.step(due, &self.watch, &mut |_, _| {});
        self.watch.now_ns() - start
    }
}

fn median(mut times: Vec<u64>) -> f64 {
    times.sort_unstable();
    times[times.len() / 2] as f64 * 1e-6
}

fn main() -> Result<(), Box<dyn Error>> {
    println!("| tetrahedra | step (ms) | call (ms) | landing step (ms) | until it lands (ms) |");
    println!("|---|---|---|---|---|");
    for cells in [5, 8, 12] {
        let loaded = Scene::load_texts("block.toml", &scene(cells), &BTreeMap::new())?;
        let [mut steps, mut calls, mut landings, mut waits] = [const { Vec::new() }; 4];
        let mut count = 0;
        for _ in 0..RUNS {
            let how = BuildOptions {
                real: true,
                ..BuildOptions::default()
            };
            let built = bodies(&World::new(&loaded).unwrap(), how)?;
            let body = built[0].body();
            count = body.element_count();
            let pose = |handle| {
                let report = body.handle_report(handle);
                report.map_or(Pose::identity(), |report| Pose::at(report.pose.position))
            };
            // The third hand grabs the top, above the middle.
            let top = (0_u32..)
                .zip(body.positions())
                .filter(|(_, x)| x.x.abs() < 0.02 && x.z > 0.0499);
            let spec = HandleSpec {
                vertices: top.map(|(vertex, _)| vertex).collect(),
                origin: rt_core::Vec3::new(0.0, 0.0, 0.05),
                freedom: Freedom::Translation,
                border: Border::Hinged,
            };
            let hands = [pose(0), pose(1), Pose::at(spec.origin)];
            let mut rig = Rig {
                engine: Engine::new(built),
                hands,
                tick: 0,
                watch: WallStopwatch::start(),
            };
            let usual = (0..100).map(|_| rig.step()).collect::<Vec<_>>();
            steps.push((median(usual) * 1e6) as u64);

            let grab = Edit::Grab(Grip {
                spec,
                device: 2,
                link: None,
            });
            let start = rig.watch.now_ns();
            rig.engine.change(0, vec![grab])?;
            calls.push(rig.watch.now_ns() - start);
            let landing = loop {
                let time = rig.step();
                if !rig.engine.bodies()[0].is_changing() {
                    break time;
                }
            };
            landings.push(landing);
            waits.push(rig.watch.now_ns() - start);
            let stats = rig.engine.stats();
            if let Some(fault) = &stats.first_fault {
                return Err(fault.clone().into());
            }
        }
        println!(
            "| {count} | {:.2} | {:.2} | {:.2} | {:.0} |",
            median(steps),
            median(calls),
            median(landings),
            median(waits)
        );
    }
    Ok(())
}
