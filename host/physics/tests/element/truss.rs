//! Threads: forces compared with analytic ones, the tangent compared with differences, hanging and vibrating threads
//! compared with theory.

use common::Random;
use nalgebra::UnitQuaternion;
use physics::mesh::LineMesh;
use physics::mesh::generate_thread::straight_thread;
use physics::{
    Body, BodyConfig, BodyError, Equilibrium, EquilibriumOptions, Integrator, IntegratorOptions,
    NewtonOptions, Stepper, StepperOptions, Tangent, ThreadMaterial, TimeScheme,
};
use physics::{Mat3, Vec3};
use std::f64::consts::PI;

/// The stiffness of a cross-section, `EA` (N), in all tests.
const EA: f64 = 100.0;
/// The mass per length at rest (kg/m).
const LINEAR_DENSITY: f64 = 0.01;

fn material(tension_only: bool) -> ThreadMaterial {
    let area = 1e-6;
    ThreadMaterial {
        young: EA / area,
        area,
        density: LINEAR_DENSITY / area,
        tension_only,
    }
}

fn weightless() -> BodyConfig {
    BodyConfig {
        gravity: Vec3::zeros(),
        tolerance: 1e-13,
        absolute_tolerance: 0.0,
        max_iterations: 20_000,
        ..BodyConfig::default()
    }
}

fn thread(mesh: &LineMesh, tension_only: bool, config: BodyConfig) -> Body {
    Body::thread(mesh, &[material(tension_only)], config, &[]).expect("a body")
}

/// Eight vertices in space, with a bar between any two.
fn net() -> LineMesh {
    let mut random = Random(7);
    let positions: Vec<Vec3> = (0..8).map(|_| random.vector()).collect();
    let lines = (0..8)
        .flat_map(|a| (0..a).map(move |b| [a, b]))
        .collect::<Vec<[u32; 2]>>();
    LineMesh::new(positions, lines).expect("a mesh")
}

/// The net with its vertices moved by up to a tenth of its size, so that some bars are longer and others shorter.
fn moved(mesh: &LineMesh) -> Vec<Vec3> {
    let mut random = Random(11);
    let moved = mesh.positions.iter().map(|x| x + random.vector() * 0.1);
    moved.collect()
}

/// The elastic forces at `x`, by vertex.
fn forces(body: &mut Body, x: &[Vec3], tangent: Tangent) -> Vec<Vec3> {
    body.set_positions(x).expect("positions");
    body.assemble_with(tangent);
    body.internal_forces().collect()
}

fn largest(vectors: impl IntoIterator<Item = Vec3>) -> f64 {
    let norms = vectors.into_iter().map(|v| v.norm());
    norms.fold(0.0, f64::max)
}

#[test]
fn a_stretched_bar_pulls_with_ea_times_its_strain_along_its_axis() {
    let mesh = straight_thread(0.2, 1).expect("a thread");
    for tension_only in [false, true] {
        let mut body = thread(&mesh, tension_only, weightless());
        assert_eq!(body.total_mass(), LINEAR_DENSITY * 0.2);
        // The bar is turned away from its rest direction and is a tenth longer, so its tension is EA / 10.
        let axis = Vec3::new(2.0, -1.0, 2.0) / 3.0;
        let start = Vec3::new(5.0, 6.0, 7.0);
        let force = forces(&mut body, &[start, start + axis * 0.22], Tangent::Exact);
        // The tolerance is ten digits. Coordinates of some metres are exact to 1e-15 m, and the elongation is 0.02 m.
        assert!(
            (force[0] - axis * 0.1 * EA).norm() < 1e-10 * EA,
            "{force:?}"
        );
        assert!(
            (force[1] + axis * 0.1 * EA).norm() < 1e-10 * EA,
            "{force:?}"
        );
        // The energy is k (l - L0)^2 / 2 with k = EA / L0.
        let energy = 0.5 * EA / 0.2 * 0.02 * 0.02;
        assert!((body.elastic_energy() - energy).abs() < 1e-10 * energy);
        // The stress is EA times the strain over the cross-section, along the axis.
        let stress = body.elements()[0].stress(0, body.node_positions());
        let expected = axis * axis.transpose() * (0.1 * EA / 1e-6);
        assert!((stress - expected).norm() < 1e-9 * expected.norm());
    }
}

#[test]
fn the_tangent_is_the_derivative_of_the_forces() {
    let mesh = net();
    for tension_only in [false, true] {
        let mut body = thread(&mesh, tension_only, weightless());
        let x = moved(&mesh);
        let mut random = Random(13);
        let direction: Vec<Vec3> = x.iter().map(|_| random.vector()).collect();
        forces(&mut body, &x, Tangent::Exact);
        let mut product = vec![Vec3::zeros(); x.len()];
        // Without handles, the nodes are the vertices.
        body.stiffness().product(&direction, &mut product);
        let step = 1e-6;
        let mut at = |sign: f64| {
            let x: Vec<Vec3> = x
                .iter()
                .zip(&direction)
                .map(|(x, d)| x + d * (sign * step))
                .collect();
            forces(&mut body, &x, Tangent::Exact)
        };
        let (ahead, behind) = (at(1.0), at(-1.0));
        let difference = |(a, b): (&Vec3, &Vec3)| (b - a) / (2.0 * step);
        let by_differences: Vec<Vec3> = ahead.iter().zip(&behind).map(difference).collect();
        let wrong = product.iter().zip(&by_differences).map(|(k, d)| k - d);
        // The error is the rounding of forces over the step, 1e-16 * EA / 1e-6, plus the square of the step: 1e-8 at
        // most.
        let relative = largest(wrong) / largest(by_differences.iter().copied());
        assert!(relative < 1e-8, "tension only {tension_only}: {relative:e}");
    }
}

#[test]
fn forces_are_minus_the_gradient_of_the_energy() {
    let mesh = net();
    let mut body = thread(&mesh, true, weightless());
    let x = moved(&mesh);
    let force = forces(&mut body, &x, Tangent::Exact);
    let mut random = Random(17);
    let direction: Vec<Vec3> = x.iter().map(|_| random.vector()).collect();
    let mut energy = |by: f64| {
        let moved: Vec<Vec3> = x.iter().zip(&direction).map(|(x, d)| x + d * by).collect();
        body.set_positions(&moved).expect("positions");
        body.elastic_energy()
    };
    let slope = (energy(1e-6) - energy(-1e-6)) / 2e-6;
    let work: f64 = force.iter().zip(&direction).map(|(f, d)| f.dot(d)).sum();
    // The error is the rounding of the energy, some 1e-15 J, over the step.
    assert!((slope + work).abs() < 1e-7 * work.abs(), "{slope} {work}");
}

#[test]
fn a_clipped_tangent_has_no_negative_part() {
    let mesh = straight_thread(1.0, 1).expect("a thread");
    let mut body = thread(&mesh, false, weightless());
    let pressed = [Vec3::zeros(), Vec3::new(0.8, 0.0, 0.0)];
    let across = |body: &Body| body.stiffness().diagonal(0)[(1, 1)];
    forces(&mut body, &pressed, Tangent::Exact);
    // The negative part is N / l with N = -0.2 EA.
    assert!((across(&body) + 0.25 * EA).abs() < 1e-12 * EA);
    forces(&mut body, &pressed, Tangent::Clipped);
    assert_eq!(across(&body), 0.0);
}

#[test]
fn a_rigid_motion_gives_no_force() {
    let mesh = net();
    for tension_only in [false, true] {
        let mut body = thread(&mesh, tension_only, weightless());
        let turn = UnitQuaternion::from_scaled_axis(Vec3::new(1.0, -2.0, 0.5));
        let x: Vec<Vec3> = mesh
            .positions
            .iter()
            .map(|x| turn * x + Vec3::new(0.3, 0.2, -0.1))
            .collect();
        // The error is the rounding of lengths of a metre.
        assert!(largest(forces(&mut body, &x, Tangent::Exact)) < 1e-14 * EA);
    }
}

#[test]
fn forces_of_a_free_thread_add_up_to_no_force_and_no_moment() {
    let mesh = net();
    let mut body = thread(&mesh, true, weightless());
    let x = moved(&mesh);
    let force = forces(&mut body, &x, Tangent::Exact);
    let size = largest(force.iter().copied());
    assert!(size > 0.01 * EA, "{size}");
    let sum: Vec3 = force.iter().sum();
    let moment: Vec3 = x.iter().zip(&force).map(|(x, f)| x.cross(f)).sum();
    // The error is the rounding of sums over 28 bars.
    assert!(sum.norm() < 1e-13 * size && moment.norm() < 1e-13 * size);
}

#[test]
fn a_free_thread_keeps_its_momentum() {
    let mesh = straight_thread(0.5, 20).expect("a thread");
    let mut body = thread(&mesh, true, weightless());
    let mut random = Random(19);
    let v: Vec<Vec3> = mesh.positions.iter().map(|_| random.vector()).collect();
    body.set_velocities(&v).expect("velocities");
    let start = body.momentum();
    for _ in 0..200 {
        body.step(1e-3, &[]).expect("a step");
    }
    assert!((body.momentum() - start).norm() < 1e-10 * start.norm());
    assert!(body.kinetic_energy() > 0.0);
}

#[test]
fn a_slack_thread_exerts_nothing_and_has_no_stiffness() {
    let mesh = straight_thread(1.0, 1).expect("a thread");
    let mut body = thread(&mesh, true, weightless());
    let shorter = [Vec3::zeros(), Vec3::new(0.3, 0.6, 0.0)];
    assert_eq!(
        forces(&mut body, &shorter, Tangent::Exact),
        [Vec3::zeros(); 2]
    );
    assert_eq!(body.elastic_energy(), 0.0);
    assert_eq!(body.stiffness().diagonal(0), Mat3::zeros());
    // The thread exerts no force even with both ends at one place, where the thread has no direction.
    let nowhere = [Vec3::zeros(); 2];
    for tension_only in [false, true] {
        let mut body = thread(&mesh, tension_only, weightless());
        let force = forces(&mut body, &nowhere, Tangent::Exact);
        assert_eq!(force, [Vec3::zeros(); 2]);
    }
    // A rod of the same length pushes its ends apart.
    let mut rod = thread(&mesh, false, weightless());
    let force = forces(&mut rod, &shorter, Tangent::Exact);
    assert!(force[1].x > 0.0 && force[1].y > 0.0);
}

#[test]
fn energy_and_force_are_continuous_where_a_thread_becomes_taut_and_the_tangent_jumps() {
    let mesh = straight_thread(1.0, 1).expect("a thread");
    let mut body = thread(&mesh, true, weightless());
    let small = 1e-8;
    let mut at = |length: f64| {
        let x = [Vec3::zeros(), Vec3::new(length, 0.0, 0.0)];
        let force = forces(&mut body, &x, Tangent::Exact)[0].x;
        (
            body.elastic_energy(),
            force,
            body.stiffness().diagonal(0)[(0, 0)],
        )
    };
    let (slack, taut) = (at(1.0 - small), at(1.0 + small));
    assert_eq!(slack, (0.0, 0.0, 0.0));
    // The force is of first order in the elongation, the energy of second order.
    assert!(taut.1 > 0.0 && taut.1 < 2.0 * EA * small);
    assert!(taut.0 > 0.0 && taut.0 < EA * small * small);
    assert!((taut.2 - EA).abs() < 1e-12 * EA);
    // At rest the thread is taut, so a straight thread starts with a stiffness.
    assert_eq!(at(1.0), (0.0, 0.0, EA));
}

/// Half a symmetric elastic catenary (H. M. Irvine, "Cable structures", 1981, section 1.4). The function returns the
/// horizontal and the vertical distance from the lowest point, after the length `along` of the thread at rest, for a
/// horizontal tension.
fn catenary(along: f64, tension: f64, weight: f64) -> [f64; 2] {
    let slope = weight * along / tension;
    [
        tension * along / EA + tension / weight * slope.asinh(),
        weight * along * along / (2.0 * EA)
            + tension / weight * ((1.0 + slope * slope).sqrt() - 1.0),
    ]
}

#[test]
fn a_hanging_thread_is_an_elastic_catenary_to_second_order() {
    const LENGTH: f64 = 1.0;
    const SPAN: f64 = 0.7;
    let gravity = 9.81;
    let weight = LINEAR_DENSITY * gravity;
    // Bisection finds the tension whose catenary has this span, because the span grows with the tension.
    let (mut low, mut high) = (1e-6, 10.0);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if catenary(0.5 * LENGTH, middle, weight)[0] < 0.5 * SPAN {
            low = middle;
        } else {
            high = middle;
        }
    }
    let tension = 0.5 * (low + high);
    let sag = catenary(0.5 * LENGTH, tension, weight)[1];

    let errors: Vec<f64> = [8_u32, 16, 32]
        .into_iter()
        .map(|segments| {
            let mesh = straight_thread(LENGTH, segments).expect("a thread");
            let config = BodyConfig {
                gravity: Vec3::new(0.0, 0.0, -gravity),
                ..weightless()
            };
            let mut body = thread(&mesh, true, config);
            let inwards = Vec3::new(0.5 * (LENGTH - SPAN), 0.0, 0.0);
            for (end, by) in [(0, inwards), (segments, -inwards)] {
                let support = body.add_support(&[end], [true; 3]).expect("a support");
                body.set_support(support, by).expect("moved");
            }
            // The start is near the solution, because a thread that is slack everywhere has no stiffness. The start is
            // slightly lower and narrower than the catenary, so that the solver has to move the thread.
            let start: Vec<Vec3> = mesh
                .positions
                .iter()
                .map(|x| {
                    let [across, up] = catenary(x.x.abs(), tension, weight);
                    Vec3::new(across * x.x.signum(), 0.0, (up - sag) * 1.05)
                })
                .collect();
            body.set_positions(&start).expect("positions");
            let options = EquilibriumOptions {
                newton: NewtonOptions {
                    tolerance: 1e-10,
                    max_iterations: 200,
                },
                ..EquilibriumOptions::default()
            };
            let mut equilibrium = Equilibrium::new(&body, options).expect("an equilibrium");
            let report = equilibrium.solve(&mut body, &[], 1.0).expect("a solution");
            assert!(report.last.converged, "{report:?}");
            // The ends carry the weight of the whole thread.
            let borne: f64 = (0..2)
                .filter_map(|support| body.support_reaction(support))
                .map(|force| force.z.abs())
                .sum();
            assert!((borne - weight * LENGTH).abs() < 1e-6 * weight, "{borne}");
            let lowest = body
                .positions()
                .nth(segments as usize / 2)
                .expect("a middle");
            (lowest.z + sag).abs() / sag
        })
        .collect();
    // A mesh three times as fine would take long. With 32 segments the error is within a thousandth.
    assert!(errors[2] < 1e-3, "{errors:?}");
    for pair in errors.windows(2) {
        let order = (pair[0] / pair[1]).log2();
        assert!((order - 2.0).abs() < 0.15, "order {order} of {errors:?}");
    }
}

#[test]
fn a_taut_string_sounds_at_its_first_frequency() {
    const SEGMENTS: u32 = 32;
    const REST: f64 = 0.5;
    const STRAIN: f64 = 0.02;
    let mesh = straight_thread(REST, SEGMENTS).expect("a thread");
    let mut body = thread(&mesh, true, weightless());
    let length = REST * (1.0 + STRAIN);
    let outwards = Vec3::new(0.5 * (length - REST), 0.0, 0.0);
    for (end, by) in [(0, -outwards), (SEGMENTS, outwards)] {
        let support = body.add_support(&[end], [true; 3]).expect("a support");
        body.set_support(support, by).expect("moved");
    }
    // The thread is displaced sideways by a ten-thousandth, so that the tension grows by less than one part in a
    // hundred thousand.
    let pulled: Vec<Vec3> = mesh
        .positions
        .iter()
        .map(|x| {
            let place = x.x * (1.0 + STRAIN);
            Vec3::new(place, 1e-4 * length * (PI * place / length).cos(), 0.0)
        })
        .collect();
    body.set_positions(&pulled).expect("positions");
    let tension = EA * STRAIN;
    let linear_density = LINEAR_DENSITY / (1.0 + STRAIN);
    let frequency = (tension / linear_density).sqrt() / (2.0 * length);

    let options = IntegratorOptions {
        scheme: TimeScheme::TrBdf2,
        newton: NewtonOptions {
            tolerance: 1e-10,
            max_iterations: 50,
        },
        ..IntegratorOptions::default()
    };
    let mut integrator = Integrator::new(&body, options).expect("an integrator");
    let h = 1.0 / (400.0 * frequency);
    let middle = |body: &Body| {
        body.positions()
            .nth(SEGMENTS as usize / 2)
            .map_or(0.0, |x| x.y)
    };
    // The first crossing is after a quarter of a period, the second half a period later.
    let mut crossings = Vec::new();
    let mut before = middle(&body);
    for step in 0..320 {
        integrator.step(&mut body, h, &[]).expect("a step");
        let now = middle(&body);
        if (before > 0.0) != (now > 0.0) {
            crossings.push((f64::from(step) + before / (before - now)) * h);
        }
        before = now;
    }
    let period = 2.0 * (crossings[1] - crossings[0]);
    let relative = (1.0 / period - frequency) / frequency;
    // The frequency of a chain of n masses is lower by (pi / 2n)^2 / 6 = 4e-4. With 400 steps a period, the step
    // lengthens the period by some 1e-5.
    assert!((relative + 4e-4).abs() < 1e-4, "{relative}");
}

#[test]
fn the_realtime_step_takes_a_thread() {
    // The reference is a step that is linearized anew. Each is solved to its tolerance.
    let mesh = straight_thread(0.3, 12).expect("a thread");
    let config = BodyConfig {
        gravity: Vec3::new(0.0, 0.0, -9.81),
        mass_damping: 0.5,
        stiffness_damping: 0.001,
        tolerance: 1e-14,
        max_iterations: 10_000,
        ..BodyConfig::default()
    };
    let hold = |mut body: Body| {
        body.add_support(&[0, 12], [true; 3]).expect("a support");
        body
    };
    let mut assembled = hold(thread(&mesh, true, config));
    let mut frozen = assembled.clone();
    let options = StepperOptions {
        tolerance: 1e-13,
        sleep_speed: 0.0,
        ..StepperOptions::default()
    };
    let mut stepper = Stepper::<f64>::new(&frozen, options).expect("a stepper");
    stepper.prepare(&frozen, 4e-3).expect("a factor");
    for _ in 0..50 {
        assembled.step(4e-3, &[]).expect("a step");
        stepper
            .step(&mut frozen, 4e-3, &[], || false)
            .expect("a step");
    }
    let apart = assembled.positions().zip(frozen.positions());
    let apart = largest(apart.map(|(a, b)| a - b));
    assert!(apart < 1e-9, "{apart:e}");
    let sag = assembled.positions().nth(6).map_or(0.0, |x| x.z);
    assert!(sag < -1e-3, "{sag}");
}

#[test]
fn invalid_threads_are_refused() {
    let mesh = straight_thread(1.0, 2).expect("a thread");
    let good = material(true);
    let built = |materials: &[ThreadMaterial]| Body::thread(&mesh, materials, weightless(), &[]);
    assert!(built(&[good, good]).is_ok());
    assert_eq!(
        built(&[good; 3]).err(),
        Some(BodyError::MaterialCount {
            found: 3,
            elements: 2
        })
    );
    for (field, bad) in [
        ("young", ThreadMaterial { young: 0.0, ..good }),
        ("area", ThreadMaterial { area: -1.0, ..good }),
        (
            "density",
            ThreadMaterial {
                density: f64::NAN,
                ..good
            },
        ),
    ] {
        match built(&[good, bad]) {
            Err(BodyError::Material {
                element: 1,
                field: found,
                ..
            }) => assert_eq!(found, field),
            other => panic!("{field}: {other:?}"),
        }
    }
    let mut flat = mesh.clone();
    flat.positions[1] = flat.positions[0];
    assert_eq!(
        Body::thread(&flat, &[good], weightless(), &[]).err(),
        Some(BodyError::NoLength {
            line: 0,
            length: 0.0
        })
    );
    let empty = LineMesh::default();
    let error = Body::thread(&empty, &[good], weightless(), &[]).err();
    assert_eq!(error, Some(BodyError::Empty));
}
