//! Times of the realtime step on a strip of 1,404 triangles with bending, on one thread. Two hands hold the ends of the
//! strip, and one of them pulls, lifts and turns its end.
//!
//! `cargo bench -p palpate-physics --bench motion_sheet`

use nalgebra::UnitQuaternion;
use physics::mesh::generate::{Pattern, sheet};
use physics::{
    Body, BodyConfig, Border, Freedom, Guess, HandlePose, HandleSpec, Material, Precision, Stepper,
    StepperOptions, Vec3,
};
use std::error::Error;
use std::time::Instant;

const STEPS: u32 = 1000;
const LENGTH: f64 = 0.195;

fn strip() -> Result<(Body, [HandleSpec; 2]), Box<dyn Error>> {
    let mesh = sheet(LENGTH, 0.09, 39, 18, Pattern::Alternating)?;
    let rubber = Material {
        young: 1e6,
        poisson: 0.4,
        thickness: 1e-3,
        density: 1000.0,
    };
    let end = |x: f64| HandleSpec {
        vertices: (0_u32..)
            .zip(&mesh.positions)
            .filter(|(_, position)| (position.x - x).abs() < 1e-9)
            .map(|(vertex, _)| vertex)
            .collect(),
        origin: Vec3::x() * x,
        freedom: Freedom::Rigid,
        border: Border::Hinged,
    };
    let handles = [end(-0.5 * LENGTH), end(0.5 * LENGTH)];
    let config = BodyConfig {
        mass_damping: 0.5,
        stiffness_damping: 1e-3,
        bending: 1.0,
        ..BodyConfig::default()
    };
    let body = Body::sheet(&mesh, &[rubber], config, &handles)?;
    Ok((body, handles))
}

fn row<T: Precision>(what: &str, h: f64, options: StepperOptions) -> Result<(), Box<dyn Error>> {
    let (mut body, handles) = strip()?;
    let mut stepper = Stepper::<T>::new(&body, options)?;
    let mut poses = handles.map(|handle| HandlePose::at(handle.origin));
    let origin = poses[1].position;
    let (mut times, mut iterations, mut most) = (Vec::new(), 0, 0);
    for step in 1..=STEPS {
        // A cycle a second.
        let phase = core::f64::consts::TAU * f64::from(step) * h;
        let (sine, rise) = (phase.sin(), 1.0 - phase.cos());
        poses[1].position = origin + Vec3::new(0.01 * rise, 0.0, 0.02 * sine);
        poses[1].rotation = UnitQuaternion::from_scaled_axis(Vec3::x() * (0.5 * sine));
        let start = Instant::now();
        let report = stepper.step(&mut body, h, &poses, || false)?;
        times.push(start.elapsed().as_secs_f64() * 1e6);
        iterations += report.iterations;
        most = most.max(report.iterations);
    }
    let force = body
        .handle_report(1)
        .map(|report| report.wrench_on_hand.force);
    let force = force.unwrap_or_default().norm();
    times.sort_by(f64::total_cmp);
    let quantile = |fraction: f64| times[(fraction * (times.len() - 1) as f64) as usize];
    println!(
        "{what:<22} {h:>6} s {:>8.1} {:>8.1} {:>8.1} {:>6.2} {most:>5} {force:>12.6}",
        quantile(0.1),
        quantile(0.5),
        quantile(0.99),
        f64::from(iterations as u32) / f64::from(STEPS),
    );
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    println!("                               10 % us   med us  99 % us   iter  most      force N");
    let strict = StepperOptions::default();
    let one = StepperOptions {
        tolerance: 0.0,
        max_iterations: 1,
        guess: Guess::Velocity,
        ..strict
    };
    for h in [0.01, 0.001] {
        row::<f64>("f64 to 1e-6", h, strict)?;
        row::<f32>(
            "f32 to 1e-4",
            h,
            StepperOptions {
                tolerance: 1e-4,
                ..strict
            },
        )?;
        row::<f32>("f32, one iteration", h, one)?;
    }
    Ok(())
}
