//! Two bodies with a spring between them, solved together, move as one body that has the spring among its elements.
//!
//! A thread is cut at one of its bars. The bar becomes a law of this test between the two pieces.

use alloc_count::calls::{are_counted, count};
use physics::mesh::LineMesh;
use physics::motion::joined::{self, At, Joints, Workspace};
use physics::{
    Body, BodyConfig, Border, Freedom, HandlePose, HandleSpec, Mat3, Stepper, StepperOptions,
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

/// The spring between the last vertex of the first piece and the first vertex of the second.
struct Spring {
    rest: f64,
    ends: [Vec3; 2],
    /// The force on the first vertex (N), and the stiffness, at the start of the step.
    force: Vec3,
    stiffness: Mat3,
}

const ENDS: [At; 2] = [
    At {
        body: 0,
        node: HALF - 1,
    },
    At { body: 1, node: 0 },
];

impl Joints for Spring {
    fn begin(&mut self, body: usize, state: &Body, h: f64) {
        self.ends[body] = state.node_positions()[ENDS[body].node as usize];
        let [a, b] = self.ends;
        let length = (b - a).norm();
        let axis = (b - a) / length;
        let tension = EA / self.rest * (length - self.rest);
        let along = axis * axis.transpose();
        self.force = axis * tension;
        // A spring under compression holds nothing across: the tangent of the elements is clipped, too.
        self.stiffness = (along * (EA / self.rest)
            + (Mat3::identity() - along) * (tension / length).max(0.0))
            * (1.0 + BETA / h);
    }

    fn forces(&self, of: &dyn Fn(At) -> Vec3, add: &mut dyn FnMut(At, Vec3)) {
        let force = self.force + self.stiffness * (of(ENDS[1]) - of(ENDS[0]));
        add(ENDS[0], force);
        add(ENDS[1], -force);
    }

    fn product(&self, of: &dyn Fn(At) -> Vec3, add: &mut dyn FnMut(At, Vec3)) {
        let product = self.stiffness * (of(ENDS[1]) - of(ENDS[0]));
        add(ENDS[0], -product);
        add(ENDS[1], product);
    }
}

#[test]
fn two_joined_bodies_move_as_one() {
    assert!(are_counted());
    let mut whole = thread(0, 2 * HALF);
    let mut parts = [thread(0, HALF), thread(HALF, HALF)];
    let mut alone = stepper(&whole);
    let mut steppers = [stepper(&parts[0]), stepper(&parts[1])];
    let ends = [0, 1].map(|i| parts[i].node_positions()[ENDS[i].node as usize]);
    let mut spring = Spring {
        rest: (ends[1] - ends[0]).norm(),
        ends,
        force: Vec3::zeros(),
        stiffness: Mat3::zeros(),
    };
    let (mut moved, mut worst, mut missing, mut turnover) = (0.0_f64, 0.0_f64, 0.0_f64, 0.0_f64);
    let before = whole.node_positions().to_vec();
    let mut room = Workspace::default();
    for step in 0..300 {
        let angle = 0.03 * f64::from(step);
        let hand = HandlePose::at(Vec3::new(
            0.0,
            0.01 * angle.sin(),
            0.005 * (1.0 - angle.cos()),
        ));
        let report = alone.step(&mut whole, H, &[hand], || false).unwrap();
        assert!(report.converged && report.held_back == 0.0, "{report:?}");

        let targets: [&[HandlePose]; 2] = [&[hand], &[]];
        for i in 0..2 {
            steppers[i].predict(&parts[i], H).unwrap();
            steppers[i].constrain(&mut parts[i], targets[i]).unwrap();
            spring.begin(i, &parts[i], H);
        }
        let mut lent = steppers
            .each_mut()
            .map(|stepper| stepper.equation().unwrap());
        let calls = count(|| joined::solve(&mut lent, &spring, &mut room, || false));
        // The first step makes the room.
        assert!(calls == 0 || step == 0, "{step}: {calls}");
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

#[test]
fn a_body_without_an_equation_is_felt_as_held() {
    // The second piece is joined, but takes no step. The first one ends as a thread whose last vertex is tied to it.
    let (mut free, mut still) = (thread(0, HALF), thread(HALF, HALF));
    let mut stepper = stepper(&free);
    let ends = [&free, &still].map(|body| body.node_positions().to_vec());
    let mut spring = Spring {
        rest: (ends[1][0] - ends[0][HALF as usize - 1]).norm(),
        ends: [ends[0][HALF as usize - 1], ends[1][0]],
        force: Vec3::zeros(),
        stiffness: Mat3::zeros(),
    };
    let mut room = Workspace::default();
    let hand = HandlePose::at(Vec3::zeros());
    for _ in 0..12_000 {
        stepper.predict(&free, H).unwrap();
        stepper.constrain(&mut free, &[hand]).unwrap();
        spring.begin(0, &free, H);
        spring.begin(1, &still, H);
        let mut lent = [stepper.equation().unwrap(), None];
        joined::solve(&mut lent, &spring, &mut room, || false);
        assert!(stepper.finish(&mut free, || false).unwrap().converged);
    }
    // The thread hangs between its hand and the still piece: the spring carries its part of the weight.
    spring.begin(0, &free, H);
    let speed = free
        .node_velocities()
        .iter()
        .map(Vec3::norm)
        .fold(0.0, f64::max);
    assert!(speed < 1e-6, "{speed}");
    assert!(
        spring.force.z > 0.0 && spring.force.norm() > 1e-3,
        "{}",
        spring.force
    );

    // The second piece steps again, and hangs on the first one in the end.
    let mut steppers = [stepper, self::stepper(&still)];
    for _ in 0..24_000 {
        for (i, body) in [&mut free, &mut still].into_iter().enumerate() {
            steppers[i].predict(body, H).unwrap();
            steppers[i].constrain(body, &[hand][i..]).unwrap();
            spring.begin(i, body, H);
        }
        let mut lent = steppers
            .each_mut()
            .map(|stepper| stepper.equation().unwrap());
        joined::solve(&mut lent, &spring, &mut room, || false);
        assert!(steppers[0].finish(&mut free, || false).unwrap().converged);
        assert!(steppers[1].finish(&mut still, || false).unwrap().converged);
    }
    let weight: f64 = still.node_masses().iter().sum::<f64>() * 9.81;
    spring.begin(1, &still, H);
    assert!(
        (spring.force.norm() - weight).abs() < 1e-3 * weight,
        "{} {weight}",
        spring.force
    );
}
