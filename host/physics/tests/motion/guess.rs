//! The guess from which iterations start. It is close in any smooth motion. When a motion begins, turns or ends, it is
//! no worse than the previous velocity.

use physics::mesh::generate_box::solid_box;
use physics::{
    Body, BodyConfig, Border, Freedom, Guess, HandlePose, HandleSpec, Precision, SolidLaw,
    SolidMaterial, Stepper, StepperOptions, Vec3,
};

/// The largest displacement of each motion (m).
const REACH: f64 = 0.01;

/// A cube of 10 cm times `scale`, held below and above. Stiffness and density are such that cubes of all scales have
/// the same motion.
fn cube(scale: f64) -> Body {
    let edge = 0.1 * scale;
    let mesh = solid_box([edge; 3], [5; 3]).unwrap();
    let face = |side: f64| HandleSpec {
        vertices: (0_u32..)
            .zip(&mesh.positions)
            .filter(|(_, x)| side * x.z > 0.499 * edge)
            .map(|(vertex, _)| vertex)
            .collect(),
        origin: Vec3::z() * (0.5 * side * edge),
        freedom: Freedom::Translation,
        border: Border::Hinged,
    };
    let handles = [face(-1.0), face(1.0)];
    let material = SolidMaterial {
        young: 2e4,
        poisson: 0.3,
        density: 1000.0 / (scale * scale),
    };
    let config = BodyConfig {
        gravity: Vec3::zeros(),
        mass_damping: 0.1,
        stiffness_damping: 0.1,
        ..BodyConfig::default()
    };
    Body::solid(&mesh, &[material], SolidLaw::Corotational, config, &handles).unwrap()
}

/// The iterations of each step of a motion of the upper face (m as a function of the time in s), and the final position
/// of each vertex (m).
fn drive<T: Precision>(
    scale: f64,
    options: StepperOptions,
    (h, steps): (f64, u32),
    motion: impl Fn(f64) -> Vec3,
) -> (Vec<usize>, Vec<Vec3>) {
    let mut body = cube(scale);
    let mut stepper = Stepper::<T>::new(&body, options).unwrap();
    let mut poses: Vec<HandlePose> = (0..2)
        .map(|handle| body.handle_report(handle).unwrap().pose)
        .collect();
    let top = poses[1].position;
    let step = |step: u32| {
        poses[1].position = top + motion(h * f64::from(step)) * scale;
        let report = stepper.step(&mut body, h, &poses, || false).unwrap();
        assert!(report.converged, "step {step}: {report:?}");
        report.iterations
    };
    let iterations = (1..=steps).map(step).collect();
    (iterations, body.positions().collect())
}

/// Options with a new factor for each step, so that the age of a factor has no effect, and without sleep.
fn options(guess: Guess) -> StepperOptions {
    StepperOptions {
        guess,
        sleep_speed: 0.0,
        patience: usize::MAX,
        ..StepperOptions::default()
    }
}

/// The iterations with each guess: the fitted guess, and the guesses of constant velocity and constant acceleration.
fn each<T: Precision>(
    tolerance: f64,
    time: (f64, u32),
    motion: impl Fn(f64) -> Vec3,
) -> [Vec<usize>; 3] {
    [Guess::Fitted, Guess::Velocity, Guess::Acceleration].map(|guess| {
        let options = StepperOptions {
            tolerance,
            ..options(guess)
        };
        drive::<T>(1.0, options, time, &motion).0
    })
}

fn press(t: f64) -> Vec3 {
    Vec3::z() * (-REACH * t.min(1.0))
}

fn swing(t: f64) -> Vec3 {
    Vec3::new(0.5, 0.0, -0.5) * (REACH * (1.0 - (core::f64::consts::TAU * 2.0 * t).cos()))
}

/// A press with a tremor of 10 Hz.
fn tremor(t: f64) -> Vec3 {
    press(t) + Vec3::new(2e-4, 0.0, 5e-4) * (core::f64::consts::TAU * 10.0 * t).sin()
}

/// A motion down, aside and back. Each part is a straight line with a rest after it.
fn corners(t: f64) -> Vec3 {
    let line = |from: f64| ((t - from) / 0.1).clamp(0.0, 1.0);
    Vec3::new(line(0.2) - line(0.4), 0.0, line(0.4) - line(0.0)) * REACH
}

#[test]
fn a_smooth_motion_takes_fewer_iterations() {
    // The first 50 steps of a motion are not smooth and are omitted.
    let late = |iterations: &[usize]| iterations[50..].iter().sum::<usize>();
    for (h, motion) in [
        (0.01, press as fn(f64) -> Vec3),
        (0.01, swing),
        (0.001, press),
        (0.001, tremor),
    ] {
        let found = each::<f64>(1e-6, (h, 100), motion);
        let [fitted, velocity, acceleration] = [0, 1, 2].map(|i| late(&found[i]));
        println!("{h} s: {fitted}, {velocity}, {acceleration} iterations");
        // The number decreases by at least a fifth.
        assert!(5 * fitted <= 4 * velocity.min(acceleration), "{found:?}");
        let found = each::<f32>(1e-3, (h, 100), motion);
        let [fitted, velocity, _] = [0, 1, 2].map(|i| late(&found[i]));
        assert!(fitted <= velocity, "in single precision: {found:?}");
    }
}

#[test]
fn the_guess_follows_no_trend_where_a_motion_turns() {
    let time = (0.01, 80);
    let [fitted, velocity, acceleration] = each::<f64>(1e-6, time, corners);
    println!("{fitted:?}\n{velocity:?}\n{acceleration:?}");
    for corner in [0, 10, 20, 30, 40, 50] {
        let around = |iterations: &[usize]| iterations[corner..corner + 6].iter().sum::<usize>();
        // In at most one step of six, the fitted guess needs one iteration more than the velocity alone.
        assert!(around(&fitted) <= around(&velocity) + 1, "at {corner}");
    }
    let most = |iterations: &[usize]| iterations.iter().max().copied();
    assert!(most(&fitted) <= most(&velocity));
}

/// Sizes that are powers of two change no digit, so that a body a thousand times as large moves the same digits.
#[test]
fn the_fit_does_not_depend_on_units() {
    let time = (0.01, 80);
    let (iterations, x) = drive::<f64>(1.0, options(Guess::Fitted), time, corners);
    let (in_large, large) = drive::<f64>(1024.0, options(Guess::Fitted), time, corners);
    assert_eq!(iterations, in_large);
    let scaled: Vec<Vec3> = x.iter().map(|x| x * 1024.0).collect();
    assert_eq!(scaled, large);
}
