//! Two bodies with a spring between them, solved together, move as one body that has the spring among its elements.
//!
//! A thread is cut at one of its bars. The bar becomes a law of this test between the two pieces. Conjugate gradients run
//! over the two lent equations and the spring.

use physics::mesh::LineMesh;
use physics::motion::Equation;
use physics::{
    Body, BodyConfig, Border, Freedom, HandlePose, HandleSpec, Mat3, Node, Stepper, StepperOptions,
    ThreadMaterial, Vec3,
};

const H: f64 = 2e-3;
const BETA: f64 = 1e-3;
/// Vertices of each piece.
const HALF: u32 = 6;
/// Length of a bar (m), and the stiffness of its cross-section (N).
const LENGTH: f64 = 0.02;
const EA: f64 = 50.0;

/// A thread over `count` vertices from `first` on, with its first vertex held where it is that of the whole. The bar
/// between the pieces has hardly any mass.
fn thread(first: u32, count: u32) -> Body {
    let at = |n: u32| Vec3::new(f64::from(n), 0.3 * f64::from(n % 2), 0.0) * LENGTH;
    let positions = (first..first + count).map(at).collect();
    let lines: Vec<[u32; 2]> = (1..count).map(|n| [n - 1, n]).collect();
    let density = |line: u32| if first + line + 1 == HALF { 1e-9 } else { 1e4 };
    let materials: Vec<ThreadMaterial> = (0..count - 1)
        .map(|line| ThreadMaterial {
            young: EA / 1e-6,
            area: 1e-6,
            density: density(line),
            tension_only: false,
        })
        .collect();
    let hand = HandleSpec {
        vertices: vec![0],
        origin: at(0),
        freedom: Freedom::Fixed,
        border: Border::Hinged,
    };
    let config = BodyConfig {
        stiffness_damping: BETA,
        mass_damping: 0.5,
        ..BodyConfig::default()
    };
    let mesh = LineMesh::new(positions, lines).unwrap();
    let handles = if first == 0 { vec![hand] } else { Vec::new() };
    Body::thread(&mesh, &materials, config, &handles).unwrap()
}

fn stepper(body: &Body) -> Stepper<f64> {
    let options = StepperOptions {
        // The smallest that conjugate gradients reach in double precision.
        tolerance: 1e-12,
        max_iterations: 500,
        sleep_speed: 0.0,
        ..StepperOptions::default()
    };
    let mut stepper = Stepper::new(body, options).unwrap();
    stepper.keep_ledger(true);
    stepper.prepare(body, H).unwrap();
    stepper
}

/// The spring: its force on its first vertex and its stiffness at the start of the step.
struct Spring {
    force: Vec3,
    stiffness: Mat3,
}

impl Spring {
    fn between(a: &Vec3, b: &Vec3, rest: f64) -> Self {
        let length = (b - a).norm();
        let axis = (b - a) / length;
        let tension = EA / rest * (length - rest);
        let along = axis * axis.transpose();
        Self {
            force: axis * tension,
            // A spring under compression holds nothing across: the tangent of the elements is clipped, too.
            stiffness: along * (EA / rest)
                + (Mat3::identity() - along) * (tension / length).max(0.0),
        }
    }

    /// The force on the first vertex (N) for a change of the difference of the two, with damping.
    fn pull(&self, change: &Vec3) -> Vec3 {
        self.force + self.product(change)
    }

    fn product(&self, change: &Vec3) -> Vec3 {
        self.stiffness * change * (1.0 + BETA / H)
    }
}

fn add(to: &mut Node<f64>, value: &Vec3) {
    for i in 0..3 {
        to[i] += value[i];
    }
}

fn dot(a: &[Node<f64>], b: &[Node<f64>]) -> f64 {
    let pairs = a.iter().flatten().zip(b.iter().flatten());
    pairs.map(|(a, b)| a * b).sum()
}

/// Conjugate gradients over two equations and a spring between the last vertex of the first body and the first vertex of
/// the second.
fn solve(mut bodies: [Equation<'_, f64>; 2], spring: &Spring) {
    let ends = [HALF - 1, 0];
    let at = [0, 1].map(|i| bodies[i].place()[ends[i] as usize] as usize);
    let change = |bodies: &[Equation<'_, f64>; 2]| {
        bodies[1].displacement_of(ends[1]) - bodies[0].displacement_of(ends[0])
    };
    let start = spring.pull(&change(&bodies));
    for (body, (at, sign)) in bodies.iter_mut().zip(at.into_iter().zip([1.0, -1.0])) {
        add(&mut body.residual()[at], &(start * sign));
    }
    let zeros = [0, 1].map(|i| vec![[0.0; 4]; bodies[i].places().0]);
    let (mut p, mut q) = (zeros.clone(), zeros);
    let goal = bodies[0].goal().min(bodies[1].goal());
    let (mut iterations, mut rz, mut left) = (0, 1.0, f64::INFINITY);
    while left > goal && iterations < 500 {
        let mut next = 0.0;
        let z = [0, 1].map(|i| {
            let wide = |z: &Node<f32>| z.map(f64::from);
            let z: Vec<_> = bodies[i].precondition().iter().map(wide).collect();
            next += dot(&z, bodies[i].residual());
            z
        });
        let beta = if iterations == 0 { 0.0 } else { next / rz };
        rz = next;
        for i in 0..2 {
            for (p, z) in p[i].iter_mut().zip(&z[i]) {
                *p = [0, 1, 2, 3].map(|axis| z[axis] + beta * p[axis]);
            }
            bodies[i].multiply(&p[i], &mut q[i]);
        }
        let end = |i: usize| Vec3::from_column_slice(&p[i][at[i]][..3]);
        let force = spring.product(&(end(1) - end(0)));
        add(&mut q[0][at[0]], &-force);
        add(&mut q[1][at[1]], &force);
        let alpha = rz / (dot(&p[0], &q[0]) + dot(&p[1], &q[1]));
        left = 0.0;
        for i in 0..2 {
            let steps = bodies[i].displacement().iter_mut().zip(&p[i]);
            for (u, p) in steps {
                *u = [0, 1, 2, 3].map(|axis| u[axis] + alpha * p[axis]);
            }
            for (r, q) in bodies[i].residual().iter_mut().zip(&q[i]) {
                *r = [0, 1, 2, 3].map(|axis| r[axis] - alpha * q[axis]);
            }
            let free = bodies[i].places().1;
            let residual = &bodies[i].residual()[..free];
            left += dot(residual, residual);
        }
        left = left.sqrt();
        iterations += 1;
    }
    assert!(left <= goal, "{left:e} of {goal:e}");
    let force = spring.pull(&change(&bodies));
    let [first, second] = bodies;
    first.solved(&[(ends[0], force)], iterations, left);
    second.solved(&[(ends[1], -force)], iterations, left);
}

#[test]
fn two_joined_bodies_move_as_one() {
    let mut whole = thread(0, 2 * HALF);
    let mut parts = [thread(0, HALF), thread(HALF, HALF)];
    let mut alone = stepper(&whole);
    let mut steppers = [stepper(&parts[0]), stepper(&parts[1])];
    let rest = (parts[1].node_positions()[0] - parts[0].node_positions()[HALF as usize - 1]).norm();
    let (mut moved, mut worst, mut missing, mut turnover) = (0.0_f64, 0.0_f64, 0.0_f64, 0.0_f64);
    let before = whole.node_positions().to_vec();
    for step in 0..300 {
        let angle = 0.03 * f64::from(step);
        let hand = HandlePose::at(Vec3::new(
            0.0,
            0.01 * angle.sin(),
            0.005 * (1.0 - angle.cos()),
        ));
        let report = alone.step(&mut whole, H, &[hand], || false).unwrap();
        assert!(report.converged && report.held_back == 0.0, "{report:?}");

        let spring = Spring::between(
            &parts[0].node_positions()[HALF as usize - 1],
            &parts[1].node_positions()[0],
            rest,
        );
        let targets: [&[HandlePose]; 2] = [&[hand], &[]];
        for i in 0..2 {
            steppers[i].predict(&parts[i], H).unwrap();
            steppers[i].constrain(&mut parts[i], targets[i]).unwrap();
        }
        let [first, second] = &mut steppers;
        let lent = [first, second].map(|stepper| stepper.equation().unwrap().unwrap());
        solve(lent, &spring);
        for i in 0..2 {
            let report = steppers[i].finish(&mut parts[i], || false).unwrap();
            assert!(
                report.converged && report.held_back == 0.0,
                "{step} {report:?}"
            );
            let ledger = steppers[i].ledger().unwrap();
            missing = missing.max(ledger.missing().abs());
            turnover = turnover.max(ledger.turnover());
        }
        let joined = parts.iter().flat_map(Body::node_positions);
        for ((found, expected), before) in joined.zip(whole.node_positions()).zip(&before) {
            worst = worst.max((found - expected).norm());
            moved = moved.max((expected - before).norm());
        }
    }
    println!("{worst:e} m of {moved} m; {missing:e} J of {turnover:e} J");
    // The thread falls by decimetres. Only the bar's mass, 1e-13 of that of a bar of the thread, and the solver's tolerance
    // of 1e-12 in each of 300 steps differ.
    assert!(
        moved > 0.05 && worst < 1e-10 * moved,
        "{worst:e} of {moved}"
    );
    // The account of each piece is closed with the work of the spring, up to rounding.
    assert!(missing < 1e-10 * turnover, "{missing:e} of {turnover:e}");
}

#[test]
fn an_equation_is_lent_after_constrain_only() {
    let body = thread(HALF, HALF);
    let mut stepper = stepper(&body);
    assert!(stepper.equation().is_err());
    stepper.predict(&body, H).unwrap();
    assert!(stepper.equation().is_err());
}
