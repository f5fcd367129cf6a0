//! Steps on the incomplete factor are those on the complete factor. The incomplete factor takes less memory, and on
//! finer meshes it needs few more iterations.

use common::{Split, block, grid, handle, rest_poses};
use physics::linear::dense::Square;
use physics::mesh::generate_box::solid_box;
use physics::{
    Body, BodyConfig, Border, Condenser, Cost, Freedom, HandlePose, HandleSpec, Material, Phase,
    Preconditioner, ShapeOptions, Shapes, SolidLaw, SolidMaterial, Stepper, StepperOptions, Vec3,
    complete_bytes,
};

fn options(preconditioner: Preconditioner) -> StepperOptions {
    StepperOptions {
        preconditioner,
        tolerance: 1e-12,
        max_iterations: 1000,
        sleep_speed: 0.0,
        ..StepperOptions::default()
    }
}

fn config() -> BodyConfig {
    // Without weight, a body can be kept at small strains.
    BodyConfig {
        gravity: Vec3::zeros(),
        mass_damping: 0.1,
        stiffness_damping: 0.1,
        bending: 1.0,
        ..BodyConfig::default()
    }
}

/// A cube of 10 cm between two plates. Its core is stiffer than the rest by the given factor.
fn cube(n: u32, contrast: f64) -> Body {
    let mesh = solid_box([0.1; 3], [n; 3]).unwrap();
    let material = |cell: &[u32]| {
        let corners = cell.iter().take(4).map(|&v| mesh.positions[v as usize]);
        let centre = corners.sum::<Vec3>() * 0.25;
        SolidMaterial {
            young: if centre.amax() < 0.025 {
                contrast * 2e4
            } else {
                2e4
            },
            poisson: 0.3,
            density: 1000.0,
        }
    };
    let materials: Vec<_> = mesh.cells.vertices().map(material).collect();
    let handles = ["bottom", "top"].map(|name| HandleSpec {
        vertices: mesh.group(name).unwrap().members.clone(),
        origin: Vec3::z() * if name == "top" { 0.05 } else { -0.05 },
        freedom: Freedom::Rigid,
        border: Border::Hinged,
    });
    let mut body = Body::solid(
        &mesh,
        &materials,
        SolidLaw::Corotational,
        config(),
        &handles,
    )
    .unwrap();
    body.assemble();
    body
}

/// A bar that a support holds along two axes at one end, and a hand at the other end. Its law has no kernel of its own.
fn guided() -> Body {
    let mesh = block([6, 3, 3], 0.1, false);
    let end = |far: bool| -> Vec<u32> {
        let numbered = (0_u32..).zip(&mesh.positions);
        let chosen = numbered.filter(|(_, x)| if far { x.x > 1.0 - 1e-9 } else { x.x < 1e-9 });
        chosen.map(|(vertex, _)| vertex).collect()
    };
    let hand = HandleSpec {
        vertices: end(true),
        origin: Vec3::x(),
        freedom: Freedom::Rigid,
        border: Border::Hinged,
    };
    let material = SolidMaterial {
        young: 2e4,
        poisson: 0.35,
        density: 1000.0,
    };
    let law = SolidLaw::StableNeoHookean;
    let mut body = Body::solid(&mesh, &[material], law, config(), &[hand]).unwrap();
    body.add_support(&end(false), [true, false, true]).unwrap();
    body
}

fn cloth() -> Body {
    let mesh = grid(20, 12, 0.2, 0.12, Split::Alternating);
    let handles = [
        handle(&mesh, Freedom::Rigid, |x| x.x < 1e-9),
        handle(&mesh, Freedom::Rigid, |x| x.x > 0.2 - 1e-9),
    ];
    let rubber = Material {
        young: 1e6,
        poisson: 0.4,
        thickness: 0.001,
        density: 1000.0,
    };
    Body::sheet(&mesh, &[rubber], config(), &handles).unwrap()
}

fn bodies() -> Vec<(&'static str, Body)> {
    vec![
        ("cube", cube(5, 1.0)),
        ("core", cube(6, 100.0)),
        ("guided", guided()),
        ("cloth", cloth()),
    ]
}

/// The last handle moves and turns by a few percent of the body.
fn poses(body: &Body, step: u32) -> Vec<HandlePose> {
    let mut poses = handle_poses(body);
    if let Some(last) = poses.last_mut() {
        let fraction = f64::from(step) / 20.0;
        last.position += Vec3::new(0.004, 0.002, -0.006) * fraction;
        last.rotation =
            nalgebra::UnitQuaternion::from_scaled_axis(Vec3::new(0.1, -0.2, 0.1) * fraction);
    }
    poses
}

fn handle_poses(body: &Body) -> Vec<HandlePose> {
    let reports = (0..body.handle_count()).filter_map(|handle| body.handle_report(handle));
    reports.map(|report| report.pose).collect()
}

#[test]
fn steps_are_those_on_the_complete_factor() {
    for (name, body) in bodies() {
        let (mut a, mut b) = (body.clone(), body);
        let rest: Vec<Vec<HandlePose>> = (1..=20).map(|step| poses(&a, step)).collect();
        let mut complete = Stepper::<f64>::new(&a, options(Preconditioner::Complete)).unwrap();
        let mut stepper = Stepper::<f64>::new(&b, options(Preconditioner::Incomplete)).unwrap();
        assert_eq!(stepper.preconditioner(), Preconditioner::Incomplete);
        for (step, targets) in rest.iter().enumerate() {
            let exact = complete.step(&mut a, 0.01, targets, || false).unwrap();
            let report = stepper.step(&mut b, 0.01, targets, || false).unwrap();
            assert!(exact.converged && report.converged, "{name}: {report:?}");
            let moved = a.positions().zip(b.positions());
            let off = moved.map(|(a, b)| (a - b).amax()).fold(0.0, f64::max);
            // Both bodies are solved to 1e-12 of the forces, twenty times. Bending is 1e4 times softer than stretching.
            assert!(off < 1e-8 * 0.006, "{name} step {step}: {off:e}");
            let hand = body_force(&a);
            let off = (hand - body_force(&b)).norm();
            assert!(off < 1e-7 * hand.norm(), "{name} step {step}: {off:e}");
        }
    }
}

fn body_force(body: &Body) -> Vec3 {
    let last = body.handle_count() - 1;
    body.handle_report(last).unwrap().wrench_on_hand.force
}

/// The purpose of the patches. The incomplete factor alone would take more than twice as many iterations on a mesh
/// twice as fine.
#[test]
fn finer_meshes_take_few_more_iterations() {
    let iterations = |n: u32| {
        let mut body = cube(n, 1.0);
        let options = StepperOptions {
            tolerance: 1e-6,
            ..options(Preconditioner::Incomplete)
        };
        let mut stepper = Stepper::<f64>::new(&body, options).unwrap();
        let mut all = 0;
        let start = handle_poses(&body);
        for step in 1..=5 {
            let mut targets = start.clone();
            targets[1].position.z -= 1e-3 * f64::from(step);
            let report = stepper.step(&mut body, 0.01, &targets, || false).unwrap();
            all += report.iterations;
        }
        all as f64 / 5.0
    };
    let (coarse, fine) = (iterations(10), iterations(20));
    println!("iterations: {coarse} at 10 cells along an edge, {fine} at 20");
    // Patches of constant size leave an increase of a quarter.
    assert!(fine < 1.5 * coarse, "{coarse} {fine}");
}

#[test]
fn memory_is_counted_and_grows_as_the_mesh() {
    let per_element = |n: u32| {
        let body = cube(n, 1.0);
        let stepper = Stepper::<f64>::new(&body, options(Preconditioner::Incomplete)).unwrap();
        let elements = body.element_count() as f64;
        (
            stepper.bytes() as f64 / elements,
            complete_bytes(&body) as f64 / elements,
        )
    };
    let ((small, complete_small), (large, complete_large)) = (per_element(7), per_element(14));
    println!(
        "bytes a tetrahedron: {small:.0}, {large:.0}; {complete_small:.0}, {complete_large:.0}"
    );
    // Only the fraction of cells at the surface changes. The complete factor grows at least by eight to the power 0.3.
    assert!(large < 1.15 * small, "{small} {large}");
    assert!(complete_large > 1.7 * complete_small);
    // The counted memory is a part of the memory of a stepper on the complete factor, and most of its growth.
    let body = cube(14, 1.0);
    let complete = Stepper::<f64>::new(&body, options(Preconditioner::Complete)).unwrap();
    let more = complete.bytes() as f64 / body.element_count() as f64 - large;
    let counted = complete_large / more;
    assert!((0.5..1.0).contains(&counted), "{counted}");
}

#[test]
fn a_factor_may_be_lent_and_costs_are_known() {
    let mut body = cloth();
    let elsewhere = StepperOptions {
        refresh: false,
        patience: 0,
        ..options(Preconditioner::Incomplete)
    };
    let mut stepper = Stepper::<f64>::new(&body, elsewhere).unwrap();
    let mut taken = 0;
    for step in 1..=40 {
        let mut targets = handle_poses(&body);
        targets[1].position += Vec3::new(-5e-4, 0.0, 1e-3) * f64::from(step % 2);
        let report = stepper.step(&mut body, 0.01, &targets, || false).unwrap();
        assert!(report.converged);
        if let Some(mut refresher) = stepper.lend() {
            assert!(stepper.lend().is_none(), "it is not here");
            assert_eq!(stepper.cost(Phase::Refresh), None);
            refresher.work().unwrap();
            let read = [(); 3].map(|()| refresher.read_ahead(3));
            assert_eq!(read, [false, false, true]);
            stepper.give_back(refresher);
            taken += 1;
        }
    }
    assert!(taken > 1, "{taken}");
    for phase in [Phase::Precondition, Phase::Refresh] {
        let Cost { read, flops, .. } = stepper.cost(phase).unwrap();
        assert!(read > 100 * body.vertex_count() && flops > 100 * body.vertex_count());
        stepper.repeat(phase).unwrap();
    }
}

#[test]
fn local_models_are_those_of_a_factorization() {
    for (name, mut body) in bodies() {
        if name == "core" {
            // This body is a cube like the first one.
            continue;
        }
        let handles = body.handle_count();
        let mut stepper = Stepper::<f64>::new(&body, options(Preconditioner::Incomplete)).unwrap();
        let mut condenser = Condenser::new(&body).unwrap();
        let mut shapes = Shapes::default();
        let rest = handle_poses(&body);
        stepper.step(&mut body, 0.01, &rest, || false).unwrap();
        let mut before = 0;
        for step in 0..3 {
            let mut targets = rest.clone();
            targets[handles - 1].position.z += 1e-9 * f64::from(step);
            stepper.step(&mut body, 0.01, &targets, || false).unwrap();
            body.assemble();
            let exact = condenser.condense(&body, 0.02).unwrap();
            let options = ShapeOptions {
                tolerance: 1e-11,
                max_iterations: 500,
                ..ShapeOptions::default()
            };
            let (ours, report) = shapes
                .condense(&mut stepper, &body, 0.02, &options)
                .unwrap();
            assert!(report.residual <= 1e-11, "{name}: {report:?}");
            let off = square_off(&ours.stiffness, &exact.stiffness);
            // The error is the tolerance of the shapes times the condition number of the condensed matrix.
            assert!(off < 1e-7, "{name}: {off:e}");
            // The next iterations start from the previous shapes.
            if step > 0 {
                assert!(report.iterations < before, "{name}: {report:?}");
            } else {
                before = report.iterations;
            }
        }
    }
}

/// Largest difference as a fraction of the largest entry.
fn square_off(a: &Square, b: &Square) -> f64 {
    let (mut difference, mut largest) = (0.0_f64, 0.0_f64);
    for i in 0..a.size() {
        for j in 0..a.size() {
            difference = difference.max((a[(i, j)] - b[(i, j)]).abs());
            largest = largest.max(b[(i, j)].abs());
        }
    }
    difference / largest
}

#[test]
fn a_body_without_free_nodes_steps() {
    let mesh = solid_box([0.1; 3], [1, 1, 1]).unwrap();
    let hand = HandleSpec {
        vertices: (0..8).collect(),
        origin: Vec3::zeros(),
        freedom: Freedom::Rigid,
        border: Border::Hinged,
    };
    let material = SolidMaterial {
        young: 2e4,
        poisson: 0.3,
        density: 1000.0,
    };
    let law = SolidLaw::Corotational;
    let mut body = Body::solid(
        &mesh,
        &[material],
        law,
        config(),
        std::slice::from_ref(&hand),
    )
    .unwrap();
    let mut stepper = Stepper::<f64>::new(&body, options(Preconditioner::Incomplete)).unwrap();
    let report = stepper
        .step(&mut body, 0.01, &rest_poses(&[hand]), || false)
        .unwrap();
    assert!(report.converged);
}
