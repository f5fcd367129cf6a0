//! Times of the realtime step on several threads, for cubes of 20,250 and of 48,000 tetrahedra.
//!
//! `cargo run --release -p palpate-physics --example motion_threads [threads ...]`
//!
//! The settings take turns, a few steps at a time, so that a machine that slows down slows them all. The last line of a
//! cube is the speed-up that the machine allows: of two copies of the body, one on each of two threads, beside each other.
//! The copies share nothing but the machine. They need twice the memory of one body.

/// The threads of the program.
#[expect(unreachable_pub, reason = "in the host, the module is public")]
#[path = "../../src/engine/threads.rs"]
mod threads;

use physics::mesh::generate_box::solid_box;
use physics::{
    Body, BodyConfig, Border, Freedom, HandlePose, HandleSpec, Phase, SolidLaw, SolidMaterial,
    Stepper, StepperOptions, Vec3,
};
use std::error::Error;
use std::sync::Arc;
use std::time::Instant;
use threads::{Threads, awake};

const STEP: f64 = 0.005;
const ROUNDS: usize = 12;
const STEPS: usize = 20;
const PHASES: [Phase; 3] = [Phase::Linearize, Phase::Product, Phase::Precondition];

/// One number of threads, with a body of its own.
struct Setting {
    threads: usize,
    pool: Arc<Threads>,
    body: Body,
    stepper: Stepper<f64>,
    poses: [HandlePose; 2],
    steps: Vec<f64>,
    parts: [Vec<f64>; 3],
    iterations: usize,
}

impl Setting {
    fn new(threads: usize, body: &Body) -> Result<Self, Box<dyn Error>> {
        let options = StepperOptions {
            refresh: false,
            ..StepperOptions::default()
        };
        let mut stepper = Stepper::new(body, options)?;
        stepper.prepare(body, STEP)?;
        let pool = Arc::new(Threads::new(threads));
        stepper.team = pool.clone();
        Ok(Self {
            threads,
            pool,
            body: body.clone(),
            stepper,
            poses: [-0.05, 0.05].map(|z| HandlePose::at(Vec3::z() * z)),
            steps: Vec::new(),
            parts: Default::default(),
            iterations: 0,
        })
    }

    /// Some steps of a press and a shear, and each part alone.
    fn round(&mut self) -> Result<(), String> {
        self.steps()?;
        let Self {
            pool,
            stepper,
            parts,
            ..
        } = self;
        pool.run(|| {
            for (phase, times) in PHASES.iter().zip(parts) {
                for _ in 0..STEPS {
                    let start = Instant::now();
                    awake(|| stepper.repeat(*phase)).map_err(|e| e.to_string())?;
                    times.push(start.elapsed().as_secs_f64());
                }
            }
            Ok(())
        })
    }

    /// Some steps of a press and a shear.
    fn steps(&mut self) -> Result<(), String> {
        let Self {
            pool,
            body,
            stepper,
            poses,
            steps,
            iterations,
            ..
        } = self;
        pool.run(|| {
            for _ in 0..STEPS {
                let at = steps.len() as f64;
                poses[1].position = Vec3::new(2e-3 * (0.1 * at).sin(), 0.0, 0.05 - 2e-5 * at);
                let start = Instant::now();
                let report = awake(|| stepper.step(body, STEP, poses, || false));
                steps.push(start.elapsed().as_secs_f64());
                *iterations += report.map_err(|e| e.to_string())?.iterations;
            }
            Ok(())
        })
    }

    /// The median of the steps (s), once they are sorted.
    fn median(&self) -> f64 {
        self.steps[self.steps.len() / 2]
    }

    /// Prints a row of the table. `alone` is the median of the steps on one thread (s).
    fn print(&mut self, alone: Option<f64>) {
        let cell = |times: &mut Vec<f64>| {
            times.sort_by(f64::total_cmp);
            let at = |fraction: usize| 1e6 * times[times.len() * fraction / 100];
            format!("{:.0} / {:.0}", at(5), at(50))
        };
        let mean = self.iterations as f64 / self.steps.len() as f64;
        let parts = self.parts.each_mut().map(cell);
        let steps = cell(&mut self.steps);
        let speed_up = alone.map_or(String::new(), |alone| {
            format!("{:.2}", alone / self.median())
        });
        println!(
            "| {} | {} | {mean:.2} | {steps} | {} | {speed_up} |",
            self.body.element_count(),
            self.threads,
            parts.join(" | ")
        );
    }
}

/// Some steps of each of the copies at once.
fn side_by_side([one, other]: &mut [Setting; 2]) -> Result<(), String> {
    std::thread::scope(|scope| {
        let beside = scope.spawn(|| other.steps());
        one.steps()?;
        beside.join().map_err(|_| "a thread has panicked")?
    })
}

fn cube(cells: u32) -> Result<Body, Box<dyn Error>> {
    let mesh = solid_box([0.1; 3], [cells; 3])?;
    let material = SolidMaterial {
        young: 2e4,
        poisson: 0.3,
        density: 1000.0,
    };
    let mut handles = Vec::new();
    for (name, z) in [("bottom", -0.05), ("top", 0.05)] {
        handles.push(HandleSpec {
            vertices: mesh.group(name).ok_or(name)?.members.clone(),
            origin: Vec3::z() * z,
            freedom: Freedom::Translation,
            border: Border::Hinged,
        });
    }
    let config = BodyConfig {
        gravity: Vec3::zeros(),
        mass_damping: 0.1,
        stiffness_damping: 0.1,
        ..BodyConfig::default()
    };
    let law = SolidLaw::Corotational;
    Ok(Body::solid(&mesh, &[material], law, config, &handles)?)
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut threads = Vec::new();
    for argument in std::env::args().skip(1) {
        threads.push(argument.parse()?);
    }
    if threads.is_empty() {
        threads = vec![1, 2];
    }
    println!("Steps on several threads: 5th percentile / median (us)\n");
    println!(
        "| tetrahedra | threads | iterations | step | linearize | product | precondition | speed-up of the step |"
    );
    println!("|{}", "---|".repeat(8));
    for cells in [15, 20] {
        let body = cube(cells)?;
        let settings = threads.iter().map(|&count| Setting::new(count, &body));
        let mut settings = settings.collect::<Result<Vec<_>, _>>()?;
        let mut copies = [Setting::new(1, &body)?, Setting::new(1, &body)?];
        for _ in 0..ROUNDS {
            for setting in &mut settings {
                setting.round()?;
            }
            side_by_side(&mut copies)?;
        }
        for setting in &mut settings {
            setting.steps.sort_by(f64::total_cmp);
        }
        let alone = settings.iter().find(|setting| setting.threads == 1);
        let alone = alone.map(Setting::median);
        for setting in &mut settings {
            setting.print(alone);
        }
        for copy in &mut copies {
            copy.steps.sort_by(f64::total_cmp);
        }
        if let Some(alone) = alone {
            let [one, other] = copies.each_ref().map(|copy| alone / copy.median());
            println!(
                "| {} | two copies side by side | | | | | | {:.2} |",
                body.element_count(),
                one + other
            );
        }
    }
    Ok(())
}
