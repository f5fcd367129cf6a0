//! Clamped borders of sheets: deflections against theory, the moment on the hand, rigid motions, local models, and changes
//! of the constraints, at rest and in motion.

use common::*;
use nalgebra::UnitQuaternion;
use physics::mesh::TriMesh;
use physics::{
    Body, BodyConfig, BodyError, BodyMap, Border, Condenser, Equilibrium, EquilibriumOptions,
    Freedom, HandlePose, HandleSpec, Integrator, IntegratorOptions, Material, Precision,
    Preconditioner, ShapeOptions, Shapes, SolidLaw, SolidMaterial, Stepper, StepperOptions, Vec3,
};

const SIDE: f64 = 0.1;

fn bending() -> BodyConfig {
    BodyConfig {
        bending: 1.0,
        ..tight()
    }
}

fn chosen(mesh: &TriMesh, holds: impl Fn(&Vec3) -> bool) -> Vec<u32> {
    let numbered = (0_u32..).zip(&mesh.positions);
    numbered
        .filter(|(_, x)| holds(x))
        .map(|(vertex, _)| vertex)
        .collect()
}

fn clamped(mesh: &TriMesh, freedom: Freedom, holds: impl Fn(&Vec3) -> bool) -> HandleSpec {
    HandleSpec {
        border: Border::Clamped,
        ..handle(mesh, freedom, holds)
    }
}

fn balance(body: &mut Body, poses: &[HandlePose]) {
    Equilibrium::new(body, EquilibriumOptions::default())
        .unwrap()
        .solve(body, poses, 1.0)
        .unwrap();
}

/// Forces (N) of a uniform pressure (Pa) along z.
fn pressure(mesh: &TriMesh, pressure: f64) -> Vec<Vec3> {
    let mut forces = vec![Vec3::zeros(); mesh.positions.len()];
    for (number, triangle) in (0_u32..).zip(&mesh.triangles) {
        for &vertex in triangle {
            forces[vertex as usize].z += pressure * mesh.triangle_area(number).unwrap() / 3.0;
        }
    }
    forces
}

/// The deflection of the middle of a square plate under pressure, over that of the clamped plate in the theory of thin
/// plates (S. P. Timoshenko and S. Woinowsky-Krieger, "Theory of plates and shells", table 35).
fn plate(mesh: &TriMesh, hold: impl Fn(&mut Body, &[u32])) -> f64 {
    let material = rubber(0.3);
    let mut body = Body::sheet(mesh, &[material], bending(), &[]).unwrap();
    hold(&mut body, &chosen(mesh, |x| on_border(x, SIDE, SIDE)));
    // Small against the thickness: the sheet is nonlinear, and its error grows with the square.
    let deflection = 1e-4 * material.thickness;
    let load = deflection * material.bending_rigidity() / (0.001_265_319 * SIDE.powi(4));
    body.set_external_forces(&pressure(mesh, load)).unwrap();
    balance(&mut body, &[]);
    let middle = Vec3::new(0.5 * SIDE, 0.5 * SIDE, 0.0);
    let vertex = chosen(mesh, |x| (x - middle).norm() < 1e-9)[0];
    body.positions().nth(vertex as usize).unwrap().z / deflection
}

/// Parallel diagonals, with the inner vertices moved by up to a fifth of a cell; the middle one stays.
fn moved(cells: u32) -> TriMesh {
    let mut mesh = grid(cells, cells, SIDE, SIDE, Split::Right);
    let mut random = Random(31);
    let size = SIDE / f64::from(cells);
    let middle = Vec3::new(0.5 * SIDE, 0.5 * SIDE, 0.0);
    for x in &mut mesh.positions {
        let by = Vec3::new(random.signed(), random.signed(), 0.0) * (0.2 * size);
        if !on_border(x, SIDE, SIDE) && (*x - middle).norm() > 0.5 * size {
            *x += by;
        }
    }
    mesh
}

/// A kind of mesh: its name, and the mesh of a number of cells a side.
type Kind = (&'static str, Box<dyn Fn(u32) -> TriMesh>);

#[test]
fn a_plate_clamped_all_round_converges_to_the_theory() {
    let split = |split: Split| move |n: u32| grid(n, n, SIDE, SIDE, split);
    let kinds: [Kind; 4] = [
        ("parallel", Box::new(split(Split::Right))),
        ("alternating", Box::new(split(Split::Alternating))),
        ("crossed", Box::new(split(Split::Crossed))),
        ("moved", Box::new(moved)),
    ];
    for (name, mesh) in kinds {
        let clamp = |body: &mut Body, border: &[u32]| {
            assert_eq!(body.add_clamp(border), Ok(0));
        };
        let [coarse, fine] = [8, 16].map(|cells| plate(&mesh(cells), clamp) - 1.0);
        println!("{name}: {coarse:.4} {fine:.4}");
        assert!(fine.abs() < 0.06, "{name}: {fine}");
        assert!(fine.abs() < 0.3 * coarse.abs(), "{name}: {fine} {coarse}");
        // A plate that is only supported is softer by the factor 0.00406 / 0.00127.
        let hinge = |body: &mut Body, border: &[u32]| {
            body.add_support(border, [true; 3]).unwrap();
        };
        let hinged = plate(&mesh(8), hinge);
        println!("{name} hinged {hinged:.4}");
        assert!((3.0..3.5).contains(&hinged), "{name}: {hinged}");
    }
}

const LENGTH: f64 = 0.1;
const WIDTH: f64 = 0.03;

fn strip(cells: u32) -> TriMesh {
    grid(cells, 3 * cells / 10, LENGTH, WIDTH, Split::Alternating)
}

fn at_left(x: &Vec3) -> bool {
    x.x < 1e-9
}

fn at_right(x: &Vec3) -> bool {
    x.x > LENGTH - 1e-9
}

/// Forces (N) of a total `force` on the right end.
fn end_load(mesh: &TriMesh, force: Vec3) -> Vec<Vec3> {
    let end = chosen(mesh, at_right);
    let (forces, length) =
        physics::body::load::edge_traction(mesh, &end, |_, _| force / WIDTH).unwrap();
    assert!((length - WIDTH).abs() < 1e-12);
    forces
}

#[test]
fn a_cantilever_held_at_its_edge_bends_as_a_beam_and_turns_the_hand() {
    let material = rubber(0.0);
    let mut errors = Vec::new();
    for cells in [10, 20, 40] {
        let mesh = strip(cells);
        let spec = clamped(&mesh, Freedom::Rigid, at_left);
        let poses = rest_poses(std::slice::from_ref(&spec));
        let origin = spec.origin;
        let mut body = Body::sheet(&mesh, &[material], bending(), &[spec]).unwrap();
        let deflection = 1e-4 * material.thickness;
        let force =
            deflection * 3.0 * material.bending_rigidity() * WIDTH / LENGTH.powi(3) * Vec3::z();
        let forces = end_load(&mesh, force);
        body.set_external_forces(&forces).unwrap();
        balance(&mut body, &poses);
        let end = Vec3::new(LENGTH, 0.0, 0.0);
        let vertex = chosen(&mesh, |x| (x - end).norm() < 1e-9)[0];
        errors.push(body.positions().nth(vertex as usize).unwrap().z / deflection - 1.0);
        // The wrench on the hand is that of the load. Newton's method leaves 1e-8 of the forces in balance, which are
        // the moment over the size of a cell.
        let wrench = body.handle_report(0).unwrap().wrench_on_hand;
        let arms = body.positions().map(|x| x - origin).zip(&forces);
        let moment: Vec3 = arms.map(|(arm, force)| arm.cross(force)).sum();
        assert!((wrench.force - force).norm() < 1e-5 * force.norm());
        assert!((moment.norm() / (LENGTH * force.norm()) - 1.0).abs() < 1e-3);
        assert!((wrench.moment - moment).norm() < 1e-5 * moment.norm());
    }
    println!("{errors:?}");
    assert!(errors[2].abs() < 1e-3, "{errors:?}");
    assert!(errors[2].abs() < 0.35 * errors[1].abs(), "{errors:?}");
}

#[test]
fn a_support_that_clamps_bears_the_load() {
    let mesh = strip(10);
    let mut body = Body::sheet(&mesh, &[rubber(0.3)], bending(), &[]).unwrap();
    let support = body.add_clamp(&chosen(&mesh, at_left)).unwrap();
    let force = Vec3::new(0.0, 0.0, 1e-6);
    body.set_external_forces(&end_load(&mesh, force)).unwrap();
    balance(&mut body, &[]);
    let reaction = body.support_reaction(support).unwrap();
    assert!((reaction + force).norm() < 1e-5 * force.norm());
    // The clamp moves with its support.
    let before: Vec<Vec3> = body.positions().collect();
    let shift = Vec3::new(1e-3, 0.0, -2e-3);
    body.set_support(support, shift).unwrap();
    balance(&mut body, &[]);
    let (mut moved, mut error) = (0.0_f64, 0.0_f64);
    for ((now, before), rest) in body.positions().zip(before).zip(&mesh.positions) {
        moved = moved.max((before - rest).norm());
        error = error.max((now - before - shift).norm());
    }
    // The solves leave 1e-8 of the forces in balance open, those of stretched edges of the clamp.
    assert!(error < 1e-5 * moved, "{error:e} of {moved:e}");
}

#[test]
fn a_clamp_carries_a_free_strip_rigidly() {
    let mesh = irregular(10, 3, LENGTH, WIDTH, 0.2, 5);
    let mut spec = clamped(&mesh, Freedom::Rigid, at_left);
    spec.origin = Vec3::new(-0.02, 0.01, 0.03);
    let origin = spec.origin;
    let mut body = Body::sheet(&mesh, &[rubber(0.3)], bending(), &[spec]).unwrap();
    let pose = HandlePose {
        position: Vec3::new(0.3, -0.1, 0.2),
        rotation: UnitQuaternion::from_scaled_axis(Vec3::new(0.3, -0.8, 0.5)),
    };
    let options = EquilibriumOptions {
        load_steps: 20,
        ..EquilibriumOptions::default()
    };
    Equilibrium::new(&body, options)
        .unwrap()
        .solve(&mut body, &[pose], 1.0)
        .unwrap();
    for (x, rest) in body.positions().zip(&mesh.positions) {
        let carried = pose.position + pose.rotation * (rest - origin);
        assert!((x - carried).norm() < 1e-7, "{}", (x - carried).norm());
    }
    // Against the forces that bend the strip by its width.
    let unit = rubber(0.3).bending_rigidity() / WIDTH;
    let wrench = body.handle_report(0).unwrap().wrench_on_hand;
    assert!(wrench.force.norm() < 1e-5 * unit, "{}", wrench.force.norm());
    assert!(wrench.moment.norm() < 1e-5 * unit * WIDTH);
    assert!(body.elastic_energy().abs() < 1e-10 * unit * WIDTH);
}

/// A strip that a handle clamps at its left end and a support at its right, under pressure.
fn clamped_strip(handle: Border) -> (TriMesh, Body) {
    let mesh = irregular(10, 3, LENGTH, WIDTH, 0.2, 5);
    let spec = HandleSpec {
        border: handle,
        ..clamped(&mesh, Freedom::Rigid, at_left)
    };
    let config = BodyConfig {
        mass_damping: 0.5,
        stiffness_damping: 1e-3,
        ..bending()
    };
    let mut body = Body::sheet(&mesh, &[rubber(0.3)], config, &[spec]).unwrap();
    body.add_clamp(&chosen(&mesh, at_right)).unwrap();
    body.set_external_forces(&pressure(&mesh, 1.0)).unwrap();
    (mesh, body)
}

fn poses(body: &Body) -> Vec<HandlePose> {
    let reports = (0..body.handle_count()).map(|handle| body.handle_report(handle));
    reports.map(|report| report.unwrap().pose).collect()
}

/// The poses of the handles after `step` steps in which each hand turns and pushes.
fn turned(rest: &[HandlePose], step: u32) -> Vec<HandlePose> {
    let by = f64::from(step);
    rest.iter()
        .map(|pose| HandlePose {
            position: pose.position + Vec3::new(1e-5, 0.0, 2e-5) * by,
            rotation: UnitQuaternion::from_scaled_axis(Vec3::y() * (2e-3 * by)) * pose.rotation,
        })
        .collect()
}

fn furthest(body: &Body, other: &Body) -> f64 {
    let pairs = body.positions().zip(other.positions());
    largest(pairs.map(|(x, y)| x - y))
}

const H: f64 = 2e-3;
const STEPS: u32 = 40;

fn stepped<T: Precision>(mut body: Body, preconditioner: Preconditioner) -> Body {
    let options = StepperOptions {
        preconditioner,
        tolerance: 1e-10,
        ..StepperOptions::default()
    };
    let mut stepper = Stepper::<T>::new(&body, options).unwrap();
    let mut shapes = Shapes::default();
    let rest = poses(&body);
    for step in 1..=STEPS {
        stepper
            .step(&mut body, H, &turned(&rest, step), || false)
            .unwrap();
        let (model, _) = shapes
            .condense(&mut stepper, &body, 0.01, &ShapeOptions::default())
            .unwrap();
        assert!(model.drift.iter().all(|value| value.is_finite()));
    }
    // Shapes without a factor of the present matrix, and those of the assembled matrix.
    let tight = ShapeOptions {
        tolerance: 1e-10,
        max_iterations: 1000,
        ..ShapeOptions::default()
    };
    let mut shapes = Shapes::default();
    let (model, _) = shapes.condense(&mut stepper, &body, 0.01, &tight).unwrap();
    let found = model.raw_stiffness.clone();
    let mut assembled = body.clone();
    assembled.assemble();
    let mut condenser = Condenser::new(&assembled).unwrap();
    let expected = &condenser.condense(&assembled, 0.01).unwrap().raw_stiffness;
    for motion in 0..6 {
        let (found, expected) = (found[(motion, motion)], expected[(motion, motion)]);
        // The kernels of single precision have seven digits.
        let most = if size_of::<T>() == 4 { 1e-3 } else { 1e-6 };
        assert!(
            (found / expected - 1.0).abs() < most,
            "{motion}: {found} {expected}"
        );
    }
    body
}

#[test]
fn every_solver_moves_a_clamped_strip_alike() {
    let (_, start) = clamped_strip(Border::Clamped);
    let rest = poses(&start);
    let mut body = start.clone();
    for step in 1..=STEPS {
        body.step(H, &turned(&rest, step)).unwrap();
    }
    let moved = furthest(&body, &start);
    assert!(moved > 1e-3, "{moved}");
    for preconditioner in [Preconditioner::Complete, Preconditioner::Incomplete] {
        let other = stepped::<f64>(start.clone(), preconditioner);
        let apart = furthest(&body, &other) / moved;
        println!("{preconditioner:?}: {apart:.1e}");
        // The tolerance of a step is 1e-10 of its forces, and a strip bends a thousand times more easily than it
        // stretches.
        assert!(apart < 1e-6, "{preconditioner:?}: {apart}");
        let wrenches =
            [&body, &other].map(|body| body.handle_report(0).unwrap().wrench_on_hand.moment);
        let apart = (wrenches[0] - wrenches[1]).norm() / wrenches[0].norm();
        assert!(apart < 1e-4, "{preconditioner:?}: {apart}");
    }
    let single = stepped::<f32>(start.clone(), Preconditioner::Complete);
    assert!(furthest(&body, &single) < 1e-2 * moved);

    // A long motion by TR-BDF2 ends in the balance.
    let targets = turned(&rest, STEPS);
    let (mut still, mut swung) = (start.clone(), start.clone());
    balance(&mut still, &targets);
    let mut integrator = Integrator::new(&swung, IntegratorOptions::default()).unwrap();
    for step in 1..=STEPS {
        integrator
            .step(&mut swung, H, &turned(&rest, step))
            .unwrap();
    }
    for _ in 0..40 {
        integrator.step(&mut swung, 10.0, &targets).unwrap();
    }
    let apart = furthest(&still, &swung) / moved;
    assert!(apart < 1e-6, "{apart}");
}

#[test]
fn ghosts_are_no_vertices() {
    let (mesh, mut body) = clamped_strip(Border::Clamped);
    let (_, hinged) = clamped_strip(Border::Hinged);
    let count = mesh.positions.len();
    assert_eq!(body.vertex_count(), count);
    assert_eq!(body.positions().len(), count);
    assert_eq!(body.velocities().len(), count);
    assert_eq!(body.internal_forces().len(), count);
    // Three edges are clamped at either end.
    assert_eq!(body.node_positions().len(), count + 6);
    assert_eq!(hinged.node_positions().len(), count + 3);
    assert_eq!(body.unknown_count(), hinged.unknown_count());
    assert_eq!(body.element_count(), hinged.element_count());
    assert_eq!(body.total_mass(), hinged.total_mass());
    assert_eq!(body.total_external_force(), hinged.total_external_force());
    assert_eq!(body.set_positions(&mesh.positions), Ok(()));
    assert_eq!(body.set_velocities(&mesh.positions), Ok(()));
    let beyond = vec![Vec3::zeros(); count + 6];
    assert!(matches!(
        body.set_positions(&beyond),
        Err(BodyError::Length { .. })
    ));
    let ghost = count as u32;
    assert!(matches!(
        body.add_support(&[ghost], [true; 3]),
        Err(BodyError::Support { .. })
    ));
    let spec = HandleSpec {
        vertices: vec![ghost],
        ..handle(&mesh, Freedom::Rigid, |x| x.x > 0.05)
    };
    assert!(matches!(
        body.grab(&spec),
        Err(BodyError::HandleVertex { .. })
    ));
    assert_eq!(BodyMap::identity(&body).vertices.len(), count);
}

#[test]
fn changes_in_motion_neither_move_the_body_nor_turn_a_clamp() {
    let (mesh, mut body) = clamped_strip(Border::Clamped);
    let count = mesh.positions.len();
    let rest = poses(&body);
    for step in 1..=STEPS {
        body.step(H, &turned(&rest, step)).unwrap();
    }
    let state = |body: &Body| -> Vec<Vec3> { body.positions().chain(body.velocities()).collect() };
    let before = state(&body);
    let ghosts = |body: &Body| body.node_positions()[count..].to_vec();
    let [first, last]: [Vec<Vec3>; 2] = [ghosts(&body)[..3].to_vec(), ghosts(&body)[3..].to_vec()];

    // The lower border between the two ends is free. The new ghosts come before those of the support.
    let along = |x: &Vec3| x.y < 1e-9 && x.x > 0.025 && x.x < 0.075;
    assert_eq!(body.grab(&clamped(&mesh, Freedom::Rigid, along)), Ok(1));
    assert_eq!(state(&body), before);
    let all = ghosts(&body);
    assert_eq!(all[..3], first);
    assert_eq!(all[all.len() - 3..], last);
    let new = all[3..all.len() - 3].to_vec();
    assert_eq!(new.len(), chosen(&mesh, along).len() - 1);

    body.release(0).unwrap();
    assert_eq!(state(&body), before);
    assert_eq!(ghosts(&body), [new.clone(), last.clone()].concat());
    body.lift_support(0).unwrap();
    assert_eq!(state(&body), before);
    assert_eq!(ghosts(&body), new);
    assert_eq!(body.add_clamp(&chosen(&mesh, at_right)), Ok(0));
    assert_eq!(state(&body), before);

    // The new clamp stays as it is while its hand rests, and turns with its hand.
    let poses = poses(&body);
    body.step(H, &poses).unwrap();
    let error = |body: &Body, to: &HandlePose| {
        let pairs = ghosts(body).into_iter().zip(&new);
        let back = poses[0].rotation.inverse();
        largest(
            pairs
                .map(|(x, new)| x - to.position - to.rotation * (back * (new - poses[0].position))),
        )
    };
    assert!(error(&body, &poses[0]) < 1e-15);
    let targets = turned(&poses, 100);
    body.step(H, &targets).unwrap();
    assert!(error(&body, &targets[0]) < 1e-15);
    body.release(0).unwrap();
    body.lift_support(0).unwrap();
    assert_eq!(body.node_positions().len(), count);
}

#[test]
fn another_body_continues_with_the_clamps_as_they_are() {
    let (mesh, mut body) = clamped_strip(Border::Clamped);
    let rest = poses(&body);
    for step in 1..=STEPS {
        body.step(H, &turned(&rest, step)).unwrap();
    }
    let map = BodyMap::identity(&body);
    let (_, mut same) = clamped_strip(Border::Clamped);
    same.continue_from(&body, &map).unwrap();
    assert_eq!(same.node_positions(), body.node_positions());
    for step in STEPS + 1..=STEPS + 10 {
        for body in [&mut body, &mut same] {
            body.step(H, &turned(&rest, step)).unwrap();
        }
    }
    assert_eq!(same.node_positions(), body.node_positions());

    // A clamp that the old body did not have continues the sheet, which stays where it is.
    let (_, mut hinged) = clamped_strip(Border::Hinged);
    hinged.continue_from(&body, &map).unwrap();
    let (_, mut other) = clamped_strip(Border::Clamped);
    let mut map = map.clone();
    map.handles[0] = None;
    other.continue_from(&hinged, &map).unwrap();
    other.hold_at(0, &poses(&body)[0]).unwrap();
    assert_eq!(furthest(&other, &body), 0.0);
    let count = mesh.positions.len();
    let before = other.node_positions()[count..].to_vec();
    other.step(H, &poses(&body)).unwrap();
    let ghosts = other.node_positions()[count..].iter().zip(before);
    assert!(largest(ghosts.map(|(now, before)| now - before)) < 1e-15);
}

#[test]
fn a_clamp_without_a_meaning_is_refused() {
    let mesh = strip(10);
    let spec = clamped(&mesh, Freedom::Rigid, at_left);
    let refuse = |result: Result<Body, BodyError>| result.map(|_| ()).unwrap_err().to_string();
    let material = Material { ..rubber(0.3) };
    let flat = Body::sheet(&mesh, &[material], tight(), std::slice::from_ref(&spec));
    let text = "handle 0 cannot clamp the border of the body: the body has no stiffness against bending; \
                make this border hinged";
    assert_eq!(refuse(flat), text);
    let inner = |x: &Vec3| x.x > 0.03 && x.x < 0.07 && x.y > 0.005 && x.y < 0.025;
    let specs = [spec, clamped(&mesh, Freedom::Rigid, inner)];
    let found = Body::sheet(&mesh, &[material], bending(), &specs);
    let text = "handle 1 cannot clamp the border of the body: its vertices contain no edge of the sheet's border; make this \
                border hinged";
    assert_eq!(refuse(found), text);

    let mut body = Body::sheet(&mesh, &[material], bending(), &[]).unwrap();
    let refused = body.add_clamp(&[0]).unwrap_err();
    assert!(refused.to_string().starts_with("support 0 cannot clamp"));
    assert!(matches!(body.grab(&specs[1]), Err(BodyError::Clamp { .. })));
    assert_eq!((body.support_count(), body.handle_count()), (0, 0));
    // A part that is held as a whole clamps the sheet beside it without ghosts.
    let rows = |x: &Vec3| x.x < 0.015;
    assert_eq!(body.grab(&clamped(&mesh, Freedom::Rigid, rows)), Ok(0));
    assert_eq!(body.node_positions().len(), body.vertex_count());

    let solid = SolidMaterial {
        young: 1e5,
        poisson: 0.3,
        density: 1000.0,
    };
    let mesh = block([2; 3], 0.0, false);
    let spec = HandleSpec {
        vertices: vec![0, 1, 2],
        origin: Vec3::zeros(),
        freedom: Freedom::Rigid,
        border: Border::Clamped,
    };
    let found = Body::solid(&mesh, &[solid], SolidLaw::Corotational, tight(), &[spec]);
    assert!(refuse(found).starts_with("handle 0 cannot clamp the border"));
}
