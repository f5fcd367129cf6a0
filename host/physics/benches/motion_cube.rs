//! Times of the realtime step on the reference cube.
//!
//! `cargo bench -p palpate-physics --bench motion_cube`

use physics::mesh::generate_box::solid_box;
use physics::{
    Body, BodyConfig, Border, Freedom, Guess, HandlePose, HandleSpec, Precision, SolidLaw,
    SolidMaterial, Stepper, StepperOptions, Vec3,
};
use std::time::Instant;

fn run<T: Precision>(n: u32, h: f64, options: StepperOptions, name: &str) {
    let mesh = solid_box([0.1; 3], [n; 3]).unwrap();
    let material = SolidMaterial {
        young: 2e4,
        poisson: 0.3,
        density: 1000.0,
    };
    let face = |z: f64| -> Vec<u32> {
        (0..mesh.positions.len() as u32)
            .filter(|&v| (mesh.positions[v as usize].z - z).abs() < 1e-9)
            .collect()
    };
    let spec = |z: f64| HandleSpec {
        vertices: face(z),
        origin: Vec3::z() * z,
        freedom: Freedom::Translation,
        border: Border::Hinged,
    };
    let handles = [spec(-0.05), spec(0.05)];
    let config = BodyConfig {
        gravity: Vec3::zeros(),
        mass_damping: 0.1,
        stiffness_damping: 0.1,
        ..BodyConfig::default()
    };
    let mut body =
        Body::solid(&mesh, &[material], SolidLaw::Corotational, config, &handles).unwrap();
    let mut stepper = Stepper::<T>::new(&body, options).unwrap();
    let steps = (15.0 / h) as usize;
    let mut times = Vec::new();
    let (mut iterations, mut most) = (0, 0);
    let mut poses = [
        HandlePose::at(handles[0].origin),
        HandlePose::at(handles[1].origin),
    ];
    let (mut asm, mut worst) = (Vec::new(), 0.0f64);
    let limit = 1500.min(steps);
    for step in 1..=limit {
        poses[1].position.z = 0.05 - 0.01 * step as f64 / steps as f64;
        let t = Instant::now();
        let r = stepper.step(&mut body, h, &poses, || false).unwrap();
        times.push(t.elapsed().as_secs_f64() * 1e6);
        iterations += r.iterations;
        most = most.max(r.iterations);
        worst = worst.max(r.residual / r.reference);
        if r.held_back > 0.0 {
            println!("held back {}", r.held_back);
        }
    }
    let t = Instant::now();
    physics::Shapes::default()
        .condense(&mut stepper, &body, h, &physics::ShapeOptions::default())
        .unwrap();
    asm.push(t.elapsed().as_secs_f64() * 1e6);
    let force = body.handle_report(0).unwrap().wrench_on_hand.force;
    times.sort_by(f64::total_cmp);
    let q = |s: f64| times[(s * (times.len() - 1) as f64) as usize];
    println!(
        "{name:28} n {n} h {h}: median {:7.1} us, 99 % {:7.1}, 99.9 % {:7.1}; iterations {:.2}, most {most}; residual {worst:.1e}; force {:.5}; first shapes {:.0} us",
        q(0.5),
        q(0.99),
        q(0.999),
        iterations as f64 / limit as f64,
        force.z,
        asm[0]
    );
}

fn main() {
    let strict = StepperOptions::default();
    let velocity = StepperOptions {
        guess: Guess::Velocity,
        ..strict
    };
    let one = StepperOptions {
        tolerance: 0.0,
        max_iterations: 1,
        guess: Guess::Velocity,
        ..strict
    };
    for n in [6, 8, 10] {
        for h in [0.01, 0.001] {
            run::<f64>(n, h, strict, "f64 1e-6 acceleration");
            run::<f64>(n, h, velocity, "f64 1e-6 velocity");
            run::<f64>(
                n,
                h,
                StepperOptions {
                    tolerance: 1e-9,
                    ..strict
                },
                "f64 1e-9 acceleration",
            );
            run::<f32>(n, h, one, "f32 one iteration");
            run::<f32>(
                n,
                h,
                StepperOptions {
                    max_iterations: 2,
                    ..one
                },
                "f32 two iterations",
            );
        }
    }
}
