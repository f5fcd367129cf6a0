//! Why some steps take longer than others: the slowest steps by their stages, the time of a step after a pause, and the
//! time of a step that takes a new factor.
//!
//! `cargo run --release -p palpate-physics --example motion_tails`
//!
//! The body is the cube of 6,000 tetrahedra of `palpate bench speed`, solved to 1e-6. All times are of the wall clock.

use physics::mesh::generate_box::solid_box;
use physics::{
    Body, BodyConfig, Border, Freedom, HandlePose, HandleSpec, Part, Refresher, SolidLaw,
    SolidMaterial, Stepper, StepperOptions, Vec3,
};
use std::hint::{black_box, spin_loop};
use std::sync::mpsc::channel;
use std::thread;
use std::time::{Duration, Instant};

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

    /// Repeats the parts of a step, so that the caches hold their data.
    fn warm(&mut self) {
        for part in [Part::Linearize, Part::Product, Part::Precondition] {
            self.stepper.repeat(part).unwrap();
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
    (0..1500)
        .map(|step| {
            let arrived = lent.take();
            let new_factor = arrived.is_some();
            if let Some(refresher) = arrived {
                cube.stepper.give_back(refresher);
            }
            let down = -0.01 * (step + 1) as f64 / 1500.0;
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

fn print_slowest(warm: bool) {
    let runs: [Vec<Taken>; 5] = core::array::from_fn(|_| press(warm));
    let said = if warm { "warmed" } else { "not warmed" };
    println!("pressed, {said} after a wait for a factor:");
    for run in &runs {
        let times = || run.iter().map(Taken::time);
        let (median, high) = (quantile(times(), 0.5), quantile(times(), 0.999));
        println!(
            "  median {median:.0} us, 99.9 % {high:.0}: {:.2}",
            high / median
        );
    }
    let least = |step: usize| {
        runs.iter()
            .fold(f64::INFINITY, |least, run| least.min(run[step].time()))
    };
    let (median, high) = (
        quantile((0..1500).map(least), 0.5),
        quantile((0..1500).map(least), 0.999),
    );
    println!(
        "  least time of each step: median {median:.0} us, 99.9 % {high:.0}: {:.2}",
        high / median
    );
    println!("  slowest steps by their least time, in the run in which they took it:");
    let mut steps: Vec<usize> = (0..1500).collect();
    steps.sort_by(|&a, &b| least(b).total_cmp(&least(a)));
    for &step in &steps[..10] {
        let run = runs
            .iter()
            .min_by(|a, b| a[step].time().total_cmp(&b[step].time()));
        let taken = run.unwrap()[step];
        let [predict, constrain, solve, finish] = taken.stages;
        println!(
            "    {:4}: {:.0} us = predict {predict:.0} + constrain {constrain:.0} + solve {solve:.0} + finish \
             {finish:.0}; {} iterations{}",
            taken.step,
            taken.time(),
            taken.iterations,
            if taken.new_factor { ", new factor" } else { "" }
        );
    }
}

/// A fixed loop over 4 MiB, about as long as a step: the part of the tails that the machine causes.
fn print_machine() {
    let mut numbers = vec![1.0_f64; 4 << 17];
    println!("a fixed loop over 4 MiB, 1500 times:");
    for _ in 0..5 {
        let mut times = Vec::new();
        for _ in 0..1500 {
            let start = Instant::now();
            for _ in 0..2 {
                for number in black_box(&mut numbers) {
                    *number = *number * 0.5 + 0.5;
                }
            }
            times.push(start.elapsed().as_secs_f64() * 1e6);
        }
        let of = |fraction| quantile(times.iter().copied(), fraction);
        println!(
            "  median {:.0} us, 99.9 % {:.0}: {:.2}",
            of(0.5),
            of(0.999),
            of(0.999) / of(0.5)
        );
    }
}

/// Steps after pauses in which this thread only spins.
fn print_pauses() {
    println!("a step of one iteration after a pause:");
    for pause_us in [0, 100, 300, 1000, 3000, 10_000] {
        let mut cube = Cube::new(0.01);
        let mut after = Vec::new();
        for step in 0..1500 {
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
            "  {pause_us:5} us: {:.0} us ({} steps)",
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
    let said = if read_ahead { "read ahead" } else { "not read" };
    println!("steps of one iteration, one each millisecond, factors {said}:");
    for new_factor in [false, true] {
        let of = || {
            let steps = all.iter();
            steps.filter(move |taken| taken.iterations == 1 && taken.new_factor == new_factor)
        };
        println!(
            "  {}: median {:.0} us, of which solve {:.0}; 90 % {:.0} ({} steps)",
            if new_factor {
                "new factor"
            } else {
                "old factor"
            },
            quantile(of().map(Taken::time), 0.5),
            quantile(of().map(|taken| taken.stages[2]), 0.5),
            quantile(of().map(Taken::time), 0.9),
            of().count()
        );
    }
}

fn main() {
    print_machine();
    print_pauses();
    for read_ahead in [false, true] {
        print_new_factors(read_ahead);
    }
    for warm in [false, true] {
        print_slowest(warm);
    }
}
