//! Why some steps take longer than others: the slowest steps by their stages, the time of a step after a pause, and the
//! time of a step that takes a new factor.
//!
//! `cargo bench -p palpate-physics --bench motion_tails`
//!
//! The body is the cube of 6,000 tetrahedra of `palpate bench speed`, solved to 1e-6. All times are of the wall clock.

use physics::mesh::generate_box::solid_box;
use physics::{
    Body, BodyConfig, Border, Freedom, HandlePose, HandleSpec, Phase, Refresher, SolidLaw,
    SolidMaterial, Stepper, StepperOptions, Vec3,
};
use std::hint::{black_box, spin_loop};
use std::sync::mpsc::channel;
use std::thread;
use std::time::{Duration, Instant};

/// Steps of a run.
const STEPS: usize = 1500;

/// One step.
#[derive(Clone, Copy)]
struct Taken {
    step: usize,
    /// Times of `predict`, `constrain`, `solve` and `finish` (us).
    stages: [f64; 4],
    iterations: usize,
    /// Whether the step is the first with a new factor.
    new_factor: bool,
}

impl Taken {
    fn time(&self) -> f64 {
        self.stages.iter().sum()
    }
}

/// A cube and its stepper. The upper face of the cube moves.
struct Cube {
    body: Body,
    stepper: Stepper<f64>,
    poses: [HandlePose; 2],
    /// Length of a step (s).
    h: f64,
}

impl Cube {
    fn new(h: f64) -> Self {
        let mesh = solid_box([0.1; 3], [10; 3]).unwrap();
        let material = SolidMaterial {
            young: 2e4,
            poisson: 0.3,
            density: 1000.0,
        };
        let face = |z: f64| HandleSpec {
            vertices: (0_u32..)
                .zip(&mesh.positions)
                .filter(|(_, x)| (x.z - z).abs() < 1e-9)
                .map(|(vertex, _)| vertex)
                .collect(),
            origin: Vec3::z() * z,
            freedom: Freedom::Translation,
            border: Border::Hinged,
        };
        let handles = [face(-0.05), face(0.05)];
        let config = BodyConfig {
            gravity: Vec3::zeros(),
            mass_damping: 0.1,
            stiffness_damping: 0.1,
            ..BodyConfig::default()
        };
        let law = SolidLaw::Corotational;
        let body = Body::solid(&mesh, &[material], law, config, &handles).unwrap();
        let options = StepperOptions {
            sleep_speed: 0.0,
            refresh: false,
            ..StepperOptions::default()
        };
        let mut stepper = Stepper::new(&body, options).unwrap();
        stepper.prepare(&body, h).unwrap();
        let poses = handles.map(|handle| HandlePose::at(handle.origin));
        Self {
            body,
            stepper,
            poses,
            h,
        }
    }

    /// Takes a step after which the upper face is displaced by `to` (m).
    fn step(&mut self, step: usize, to: Vec3) -> Taken {
        self.poses[1].position = Vec3::z() * 0.05 + to;
        let mut at = [Instant::now(); 5];
        self.stepper.predict(&self.body, self.h).unwrap();
        at[1] = Instant::now();
        self.stepper.constrain(&mut self.body, &self.poses).unwrap();
        at[2] = Instant::now();
        self.stepper.solve(|| false).unwrap();
        at[3] = Instant::now();
        let report = self.stepper.finish(&mut self.body, || false).unwrap();
        at[4] = Instant::now();
        Taken {
            step,
            stages: core::array::from_fn(|i| (at[i + 1] - at[i]).as_secs_f64() * 1e6),
            iterations: report.iterations,
            new_factor: false,
        }
    }

    /// Repeats the phases of a step, so that the caches hold their data.
    fn warm(&mut self) {
        for phase in [Phase::Linearize, Phase::Product, Phase::Precondition] {
            self.stepper.repeat(phase).unwrap();
        }
    }
}

/// The value that the fraction `fraction` of `values` do not exceed.
fn quantile(values: impl Iterator<Item = f64>, fraction: f64) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    let rank = (fraction * values.len() as f64).ceil() as usize;
    values
        .get(rank.saturating_sub(1))
        .copied()
        .unwrap_or(f64::NAN)
}

/// A press by a tenth in 15 s, step after step. The steps wait for each factor. `warm`: they are warmed after the wait.
fn press(warm: bool) -> Vec<Taken> {
    let mut cube = Cube::new(0.01);
    if warm {
        cube.warm();
    }
    let mut lent: Option<Box<Refresher<f64>>> = None;
    (0..STEPS)
        .map(|step| {
            let arrived = lent.take();
            let new_factor = arrived.is_some();
            if let Some(refresher) = arrived {
                cube.stepper.give_back(refresher);
            }
            let down = -0.01 * (step + 1) as f64 / STEPS as f64;
            let taken = cube.step(step, Vec3::z() * down);
            if let Some(mut refresher) = cube.stepper.lend() {
                thread::scope(|scope| scope.spawn(|| refresher.work().unwrap()).join()).unwrap();
                lent = Some(refresher);
                if warm {
                    cube.warm();
                }
            }
            Taken {
                new_factor,
                ..taken
            }
        })
        .collect()
}

/// A cell of the table of tails: the two percentiles (us) and their ratio.
fn tail(times: impl Iterator<Item = f64> + Clone) -> String {
    let (median, high) = (quantile(times.clone(), 0.5), quantile(times, 0.999));
    format!("{high:.0} / {median:.0} = {:.2}", high / median)
}

/// The least time of a step in several runs (us).
fn least(runs: &[Vec<Taken>], step: usize) -> f64 {
    let times = runs.iter().map(|run| run[step].time());
    times.fold(f64::INFINITY, f64::min)
}

/// The tails of a fixed loop, which the machine causes, and those of a pressed cube.
fn print_tails() {
    println!("Distribution of the time of a step: 99.9th percentile / median (us)\n");
    println!("| | run 1 | run 2 | run 3 | run 4 | run 5 | least time of each step |");
    println!("|{}", "---|".repeat(7));
    let row = |name: &str, cells: [String; 5], least: &str| {
        println!("| {name} | {} | {least} |", cells.join(" | "));
    };
    let loops = core::array::from_fn(|_| tail(fixed_loop().into_iter()));
    row("a fixed loop over 4 MiB", loops, "");
    let mut slowest = Vec::new();
    for (name, warm) in [
        ("pressed cube; caches cold after a wait for a factor", false),
        ("pressed cube; caches warm", true),
    ] {
        let runs: [Vec<Taken>; 5] = core::array::from_fn(|_| press(warm));
        let cells = runs.each_ref().map(|run| tail(run.iter().map(Taken::time)));
        let of_least = tail((0..STEPS).map(|step| least(&runs, step)));
        row(name, cells, &of_least);
        slowest.push((name, runs));
    }
    for (name, runs) in &slowest {
        print_slowest(name, runs);
    }
}

/// The ten slowest steps by their least time, with the stages of the run in which they took that time.
fn print_slowest(name: &str, runs: &[Vec<Taken>; 5]) {
    println!("\nSlowest steps, {name}\n");
    println!("| step | us | predict | constrain | solve | finish | iterations | new factor |");
    println!("|{}", "---|".repeat(8));
    let mut steps: Vec<usize> = (0..STEPS).collect();
    steps.sort_by(|&a, &b| least(runs, b).total_cmp(&least(runs, a)));
    for &step in &steps[..10] {
        let run = runs
            .iter()
            .min_by(|a, b| a[step].time().total_cmp(&b[step].time()));
        let taken = run.unwrap()[step];
        let [predict, constrain, solve, finish] = taken.stages;
        println!(
            "| {} | {:.0} | {predict:.0} | {constrain:.0} | {solve:.0} | {finish:.0} | {} | {} |",
            taken.step,
            taken.time(),
            taken.iterations,
            if taken.new_factor { "yes" } else { "" }
        );
    }
}

/// Times (us) of a fixed loop over 4 MiB, about as long as a step: the part of the tails that the machine causes.
fn fixed_loop() -> Vec<f64> {
    let mut numbers = vec![1.0_f64; 4 << 17];
    let mut times = Vec::new();
    for _ in 0..STEPS {
        let start = Instant::now();
        for _ in 0..2 {
            for number in black_box(&mut numbers) {
                *number = *number * 0.5 + 0.5;
            }
        }
        times.push(start.elapsed().as_secs_f64() * 1e6);
    }
    times
}

/// Steps after pauses in which this thread only spins.
fn print_pauses() {
    println!("\nSteps of one iteration after a pause\n");
    println!("| pause (us) | time of the step, median (us) | steps |");
    println!("|{}", "---|".repeat(3));
    for pause_us in [0, 100, 300, 1000, 3000, 10_000] {
        let mut cube = Cube::new(0.01);
        let mut after = Vec::new();
        for step in 0..STEPS {
            let paused = step > 50 && step % 10 == 0;
            if paused {
                let start = Instant::now();
                while start.elapsed() < Duration::from_micros(pause_us) {
                    spin_loop();
                }
            }
            let taken = cube.step(step, Vec3::z() * (-2e-6 * (step + 1) as f64));
            if paused && taken.iterations == 1 {
                after.push(taken);
            }
        }
        println!(
            "| {pause_us} | {:.0} | {} |",
            quantile(after.iter().map(Taken::time), 0.5),
            after.len()
        );
    }
}

/// Steps of 1 ms, one each millisecond, of a swing to the side. Another thread makes the factors.
fn print_new_factors(read_ahead: bool) {
    let mut cube = Cube::new(1e-3);
    let (to, messages) = channel::<Box<Refresher<f64>>>();
    let (back, from) = channel();
    let worker = thread::spawn(move || {
        for mut refresher in messages {
            refresher.work().unwrap();
            back.send(refresher).unwrap();
        }
    });
    let (mut made, mut read) = (None, false);
    let mut all = Vec::new();
    let start = Instant::now();
    for step in 0..4000 {
        let deadline = Duration::from_millis(step as u64);
        thread::sleep(deadline.saturating_sub(start.elapsed()));
        let new_factor = read;
        if core::mem::take(&mut read) {
            cube.stepper.give_back(made.take().unwrap());
        }
        let phase = core::f64::consts::PI * 1e-3 * (step + 1) as f64;
        let taken = cube.step(step, Vec3::x() * (0.025 * (1.0 - phase.cos())));
        all.push(Taken {
            new_factor,
            ..taken
        });
        if made.is_none() {
            made = from.try_recv().ok();
        }
        if let Some(refresher) = &mut made {
            let parts = if read_ahead {
                Refresher::<f64>::parts(cube.h)
            } else {
                0
            };
            read = refresher.read_ahead(parts);
        }
        if let Some(refresher) = cube.stepper.lend() {
            to.send(refresher).unwrap();
        }
    }
    drop(to);
    worker.join().unwrap();
    for new_factor in [false, true] {
        let of = || {
            let steps = all.iter();
            steps.filter(move |taken| taken.iterations == 1 && taken.new_factor == new_factor)
        };
        println!(
            "| {} | {} | {:.0} | {:.0} | {:.0} | {} |",
            if read_ahead { "read ahead" } else { "not read" },
            if new_factor { "new" } else { "old" },
            quantile(of().map(Taken::time), 0.5),
            quantile(of().map(|taken| taken.stages[2]), 0.5),
            quantile(of().map(Taken::time), 0.9),
            of().count()
        );
    }
}

fn main() {
    print_tails();
    print_pauses();
    println!("\nSteps of one iteration, one each millisecond\n");
    println!("| next factor | factor of the step | median us | of which solve | 90 % us | steps |");
    println!("|{}", "---|".repeat(6));
    for read_ahead in [false, true] {
        print_new_factors(read_ahead);
    }
}
