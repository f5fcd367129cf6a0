//! Grabbing and releasing handles, lifting supports. At rest the bytes are those of a body that was built so. In motion
//! no force jumps.

use physics::mesh::TetMesh;
use physics::mesh::generate::{Pattern, sheet};
use physics::mesh::generate_box::solid_box;
use physics::{
    Body, BodyConfig, BodyError, Border, CondenseError, Condenser, Freedom, HandlePose, HandleSpec,
    Integrator, IntegratorOptions, Material, Precision, Preconditioner, ShapeOptions, Shapes,
    SheetLawName, SolidLaw, SolidMaterial, Stepper, StepperOptions, SupportSpec, Vec3, Weave,
};

const H: f64 = 2e-3;

fn config(gravity: f64) -> BodyConfig {
    BodyConfig {
        gravity: Vec3::new(0.0, 0.0, -gravity),
        mass_damping: 0.1,
        stiffness_damping: 1e-3,
        ..BodyConfig::default()
    }
}

fn spec(positions: &[Vec3], holds: impl Fn(&Vec3) -> bool) -> HandleSpec {
    let numbered = (0_u32..).zip(positions);
    let vertices: Vec<u32> = numbered
        .filter(|(_, x)| holds(x))
        .map(|(vertex, _)| vertex)
        .collect();
    let sum: Vec3 = vertices.iter().map(|&v| positions[v as usize]).sum();
    HandleSpec {
        origin: sum / vertices.len() as f64,
        vertices,
        freedom: Freedom::Rigid,
        border: Border::Hinged,
    }
}

fn bar() -> TetMesh {
    solid_box([0.2, 0.05, 0.05], [8, 2, 2]).unwrap()
}

const RUBBER: SolidMaterial = SolidMaterial {
    young: 2e5,
    poisson: 0.4,
    density: 1000.0,
};

type Build = Box<dyn Fn(&[HandleSpec]) -> Body>;

/// Bodies of every kind, and a sheet whose handles clamp its border: the function that builds each with given handles, and
/// the positions of its vertices.
fn kinds() -> Vec<(&'static str, Vec<Vec3>, Build)> {
    let mut kinds: Vec<(&'static str, Vec<Vec3>, Build)> = Vec::new();
    for (name, law, quadratic) in [
        ("corotational", SolidLaw::Corotational, false),
        ("quadratic", SolidLaw::Corotational, true),
        ("neo-hookean", SolidLaw::StableNeoHookean, false),
    ] {
        let mesh = if quadratic { bar().quadratic() } else { bar() };
        let positions = mesh.positions.clone();
        let build =
            move |specs: &[HandleSpec]| Body::solid(&mesh, &[RUBBER], law, config(9.81), specs);
        kinds.push((
            name,
            positions,
            Box::new(move |specs| build(specs).unwrap()),
        ));
    }
    let mesh = sheet(0.2, 0.1, 8, 4, Pattern::Regular).unwrap();
    let bent = mesh.clone();
    let foil = Material {
        young: 1e6,
        poisson: 0.3,
        thickness: 1e-3,
        density: 1000.0,
    };
    let bending = BodyConfig {
        bending: 1.0,
        ..config(1.0)
    };
    for name in ["sheet", CLAMPED] {
        let bent = bent.clone();
        kinds.push((
            name,
            mesh.positions.clone(),
            Box::new(move |specs| Body::sheet(&bent, &[foil], bending, specs).unwrap()),
        ));
    }
    let cloth = Weave {
        warp: Vec3::x(),
        young_warp: 1e6,
        young_weft: 5e5,
        poisson: 0.2,
        shear: 1e5,
        thickness: 1e-3,
        density: 500.0,
        rigidity: physics::Rigidity::default(),
    };
    let law = SheetLawName::StVenantKirchhoff;
    kinds.push((
        "woven",
        mesh.positions.clone(),
        Box::new(move |specs| Body::woven(&mesh, &[cloth], law, config(1.0), specs).unwrap()),
    ));
    kinds
}

/// The kind of body whose handles at either end clamp its border.
const CLAMPED: &str = "clamped sheet";

/// One handle at either end, and one in the middle, for a body of the kind `name`.
fn specs_of(name: &str, positions: &[Vec3]) -> [HandleSpec; 3] {
    let mut specs = specs(positions);
    if name == CLAMPED {
        specs[0].border = Border::Clamped;
        specs[1].border = Border::Clamped;
    }
    specs
}

/// One handle at either end, and one in the middle.
fn specs(positions: &[Vec3]) -> [HandleSpec; 3] {
    let corner = |pick: fn(f64, f64) -> f64| {
        let start = positions[0];
        positions.iter().fold(start, |a, b| a.zip_map(b, pick))
    };
    let (min, max) = (corner(f64::min), corner(f64::max));
    let middle = 0.5 * (min.x + max.x);
    [
        spec(positions, |x| x.x < min.x + 1e-9),
        spec(positions, |x| x.x > max.x - 1e-9),
        spec(positions, |x| {
            (x.x - middle).abs() < 1e-9 && x.y < min.y + 1e-9
        }),
    ]
}

fn poses(body: &Body) -> Vec<HandlePose> {
    (0..body.handle_count())
        .map(|handle| body.handle_report(handle).unwrap().pose)
        .collect()
}

fn bits(vectors: impl Iterator<Item = Vec3>) -> Vec<u64> {
    vectors
        .flat_map(|v| [v.x.to_bits(), v.y.to_bits(), v.z.to_bits()])
        .collect()
}

/// The results of some steps by every solver, and the local models of these steps.
fn story(body: &Body) -> Vec<u64> {
    let mut story = Vec::new();
    frozen::<f64>(body, Preconditioner::Complete, &mut story);
    frozen::<f32>(body, Preconditioner::Complete, &mut story);
    frozen::<f64>(body, Preconditioner::Incomplete, &mut story);
    let mut assembled = body.clone();
    let mut condenser = Condenser::new(&assembled).unwrap();
    for step in 1..=4 {
        assembled.step(H, &pulled(body, step)).unwrap();
    }
    assembled.assemble();
    let condensed = condenser.condense(&assembled, 0.01).unwrap();
    for i in 0..condensed.stiffness.size() {
        story.extend((0..=i).map(|j| condensed.stiffness[(i, j)].to_bits()));
    }
    story.extend(bits(assembled.positions()));
    let mut exact = body.clone();
    let mut integrator = Integrator::new(&exact, IntegratorOptions::default()).unwrap();
    for step in 1..=2 {
        integrator.step(&mut exact, H, &pulled(body, step)).unwrap();
    }
    story.extend(bits(exact.positions()));
    story
}

fn frozen<T: Precision>(body: &Body, preconditioner: Preconditioner, story: &mut Vec<u64>) {
    let mut body = body.clone();
    let options = StepperOptions {
        preconditioner,
        ..StepperOptions::default()
    };
    let mut stepper = Stepper::<T>::new(&body, options).unwrap();
    let mut shapes = Shapes::default();
    let rest = body.clone();
    for step in 1..=6 {
        stepper
            .step(&mut body, H, &pulled(&rest, step), || false)
            .unwrap();
        let (model, _) = shapes
            .condense(&mut stepper, &body, 0.01, &ShapeOptions::default())
            .unwrap();
        story.extend(model.drift.iter().map(|value| value.to_bits()));
    }
    story.extend(bits(body.positions()));
    story.extend(bits(body.velocities()));
    for handle in 0..body.handle_count() {
        let report = body.handle_report(handle).unwrap();
        story.extend(bits([report.wrench_on_hand.force].into_iter()));
    }
}

/// The handles move apart. A handle with a higher number moves faster.
fn pulled(rest: &Body, step: u32) -> Vec<HandlePose> {
    let mut poses = poses(rest);
    for (handle, pose) in poses.iter_mut().enumerate() {
        pose.position.x += 2e-4 * f64::from(step) * handle as f64;
        pose.position.z += 1e-4 * f64::from(step) * handle as f64;
    }
    poses
}

#[test]
fn grabbing_a_body_at_rest_gives_the_bytes_of_a_body_built_with_the_handle() {
    for (name, positions, build) in kinds() {
        let [left, right, middle] = specs_of(name, &positions);
        let built = story(&build(&[left.clone(), right.clone()]));

        let mut grabbed = build(&[]);
        assert_eq!(grabbed.grab(&left), Ok(0));
        assert_eq!(grabbed.grab(&right), Ok(1));
        assert!(story(&grabbed) == built, "{name}: grabbed");

        let mut released = build(&[left, middle]);
        assert_eq!(released.grab(&right), Ok(2));
        released.release(1).unwrap();
        assert!(story(&released) == built, "{name}: released");
        // Each change begins another epoch, so that no solver mistakes one body for another.
        assert_eq!(released.epoch(), 2);
    }
}

#[test]
fn supporting_a_body_at_rest_gives_the_bytes_of_a_body_built_with_the_support() {
    let (first, second) = ([true, false, true], [true, true, false]);
    for (name, positions, build) in kinds() {
        let [left, right, middle] = specs_of(name, &positions);
        let add = |body: &mut Body| match name {
            CLAMPED => body.add_clamp(&left.vertices),
            _ => body.add_support(&left.vertices, first),
        };
        let mut built = build(std::slice::from_ref(&right));
        add(&mut built).unwrap();
        let built = story(&built);

        // Supports outlive handles, and return the vertices that they took from others.
        let mut lifted = build(&[]);
        lifted.add_support(&middle.vertices, second).unwrap();
        add(&mut lifted).unwrap();
        lifted.add_support(&left.vertices, second).unwrap();
        lifted.grab(&right).unwrap();
        lifted.lift_support(2).unwrap();
        lifted.lift_support(0).unwrap();
        assert_eq!(lifted.support_count(), 1);
        assert!(story(&lifted) == built, "{name}");
    }
}

/// Positions, velocities and masses by node, and the nodes of every element.
fn layout(body: &Body) -> (Vec<u64>, Vec<u32>) {
    let masses = body.node_masses().iter().map(|mass| mass.to_bits());
    let mut numbers = bits(body.node_positions().iter().copied());
    numbers.extend(bits(body.velocities()));
    numbers.extend(masses);
    let elements = body.elements().iter();
    let nodes = elements.flat_map(|set| (0..set.count()).flat_map(|e| set.nodes(e).to_vec()));
    (numbers, nodes.collect())
}

/// A change of the constraints of a body, and its name.
type Change = (&'static str, Box<dyn Fn(&mut Body)>);

#[test]
fn a_node_keeps_its_number_through_every_change_of_the_constraints() {
    // The clamped sheet differs from the sheet by its handles alone, and these handles hinge.
    for (name, positions, build) in kinds() {
        let [left, right, middle] = specs(&positions);
        let free = build(&[]);
        assert_eq!(free.node_positions(), positions, "{name}");
        let (_, vertices) = layout(&free);

        let mut body = build(std::slice::from_ref(&middle));
        for step in 1..=4 {
            let mut targets = poses(&body);
            targets[0].position.z += 1e-4 * f64::from(step);
            body.step(H, &targets).unwrap();
        }
        let before = layout(&body);
        assert_eq!(
            before.1, vertices,
            "{name}: the elements have the mesh's vertices"
        );
        let (last, axes) = (right.vertices.clone(), [true, false, true]);
        let changes: [Change; 5] = [
            (
                "grab",
                Box::new(move |body| assert_eq!(body.grab(&left), Ok(1))),
            ),
            (
                "add_support",
                Box::new(move |body| assert_eq!(body.add_support(&last, axes), Ok(0))),
            ),
            ("release", Box::new(|body| body.release(0).unwrap())),
            (
                "lift_support",
                Box::new(|body| body.lift_support(0).unwrap()),
            ),
            (
                "grab again",
                Box::new(move |body| assert_eq!(body.grab(&right), Ok(1))),
            ),
        ];
        for (change, apply) in changes {
            let epoch = body.epoch();
            apply(&mut body);
            assert_eq!(body.epoch(), epoch + 1, "{name}: {change}");
            assert!(layout(&body) == before, "{name}: {change}");
            assert!(body.positions().eq(body.node_positions().iter().copied()));
        }
        // Only the rows of the matrix are in another order: the held nodes come last.
        let [left, right, _] = specs(&positions);
        let held = [left.vertices, right.vertices].concat();
        let places = body.places();
        assert_eq!(places.nodes()[places.free()..], held, "{name}");
        assert!(places.nodes()[..places.free()].is_sorted(), "{name}");
    }
}

/// The largest distance of a vertex from its earlier position (m).
fn moved(body: &Body, from: &[Vec3]) -> f64 {
    let distances = body
        .positions()
        .zip(from)
        .map(|(x, from)| (x - from).norm());
    distances.fold(0.0, f64::max)
}

#[test]
fn a_released_body_swings_back_without_a_jump() {
    let mesh = bar();
    let [left, right, _] = specs(&mesh.positions);
    let tip = right.vertices[0] as usize;
    let law = SolidLaw::Corotational;
    let free_of_damping = BodyConfig {
        mass_damping: 0.0,
        stiffness_damping: 0.0,
        ..config(0.0)
    };
    let mut body = Body::solid(&mesh, &[RUBBER], law, free_of_damping, &[left, right]).unwrap();
    let rest: Vec<Vec3> = body.positions().collect();
    let mut stepper = Stepper::<f64>::new(&body, StepperOptions::default()).unwrap();
    let mut shapes = Shapes::default();
    let mut targets = poses(&body);
    for _ in 0..100 {
        targets[1].position.z += 1e-4;
        stepper.step(&mut body, H, &targets, || false).unwrap();
    }
    for _ in 0..50 {
        stepper.step(&mut body, H, &targets, || false).unwrap();
    }
    let model = shapes.condense(&mut stepper, &body, 0.01, &ShapeOptions::default());
    assert_eq!(model.unwrap().0.stiffness.size(), 12);
    let before: Vec<Vec3> = body.positions().collect();
    let velocities = bits(body.velocities());
    let energy = body.total_energy();

    body.release(1).unwrap();
    // The release moves no vertex.
    assert_eq!(bits(body.positions()), bits(before.iter().copied()));
    assert_eq!(bits(body.velocities()), velocities);
    targets.truncate(1);
    // Before the first step of the new epoch there is no model of that epoch.
    let model = shapes.condense(&mut stepper, &body, 0.01, &ShapeOptions::default());
    assert_eq!(model.err(), Some(CondenseError::NotAssembled));
    stepper.step(&mut body, H, &targets, || false).unwrap();
    // From rest, a step moves the vertices that the elastic forces accelerate. The displacement is a small fraction of
    // the pull.
    let bent = before[tip].z - rest[tip].z;
    assert!(
        moved(&body, &before) < 0.3 * bent,
        "{}",
        moved(&body, &before)
    );
    let model = shapes.condense(&mut stepper, &body, 0.01, &ShapeOptions::default());
    assert_eq!(model.unwrap().0.stiffness.size(), 6);
    let mut lowest = f64::INFINITY;
    for _ in 0..100 {
        stepper.step(&mut body, H, &targets, || false).unwrap();
        assert!(body.total_energy() <= energy * (1.0 + 1e-6));
        lowest = lowest.min(body.positions().nth(tip).unwrap().z - rest[tip].z);
    }
    // The body swings through its rest shape.
    assert!(lowest < -0.2 * bent, "{lowest} {bent}");
}

#[test]
fn a_body_without_its_handles_keeps_its_momentum() {
    for (name, positions, build) in kinds() {
        let [left, right, _] = specs(&positions);
        let mut body = build(&[left, right]);
        body.set_load_factor(0.0).unwrap();
        let mut stepper = Stepper::<f64>::new(&body, StepperOptions::default()).unwrap();
        let mut targets = poses(&body);
        for _ in 0..50 {
            for target in &mut targets {
                target.position.x += 2e-4;
            }
            stepper.step(&mut body, H, &targets, || false).unwrap();
        }
        body.release(0).unwrap();
        body.release(0).unwrap();
        assert_eq!(body.handle_count(), 0);
        let momentum = body.momentum();
        let steps = 20;
        for _ in 0..steps {
            stepper.step(&mut body, H, &[], || false).unwrap();
        }
        // Only the damping by mass, 0.1 /s, slows the body. The residuals of the solves cause the rest of the
        // difference.
        let slowed = momentum / (1.0 + 0.1 * H).powi(steps);
        let off = (body.momentum() - slowed).norm() / slowed.norm();
        assert!(off < 1e-4, "{name}: {off:e}");
        // No hand feels the body.
        let mut shapes = Shapes::default();
        let (model, _) = shapes
            .condense(&mut stepper, &body, 0.01, &ShapeOptions::default())
            .unwrap();
        assert_eq!(model.stiffness.size(), 0, "{name}");
        body.step(H, &[]).unwrap();
    }
}

#[test]
fn a_moving_body_is_grabbed_at_its_present_place() {
    for (name, positions, build) in kinds() {
        let [left, right, _] = specs(&positions);
        let mut body = build(std::slice::from_ref(&left));
        let mut stepper = Stepper::<f32>::new(&body, StepperOptions::default()).unwrap();
        let mut condenser = Condenser::new(&body).unwrap();
        let mut targets = poses(&body);
        for _ in 0..50 {
            stepper.step(&mut body, H, &targets, || false).unwrap();
        }
        // A refresher that is lent when the epoch ends is useless in the next epoch.
        stepper.options.refresh = false;
        stepper.options.patience = 0;
        stepper.step(&mut body, H, &targets, || false).unwrap();
        let lent = stepper.lend();
        let now: Vec<Vec3> = body.positions().collect();
        let held: Vec<Vec3> = right.vertices.iter().map(|&v| now[v as usize]).collect();
        let origin = held.iter().sum::<Vec3>() / held.len() as f64;
        let grabbed = body.grab(&HandleSpec {
            origin,
            ..right.clone()
        });
        assert_eq!(grabbed, Ok(1), "{name}");
        assert_eq!(bits(body.positions()), bits(now.into_iter()), "{name}");
        targets.push(HandlePose::at(origin));
        for _ in 0..20 {
            stepper.step(&mut body, H, &targets, || false).unwrap();
            if let Some(mut refresher) = lent.as_ref().and_then(|_| stepper.lend()) {
                refresher.work().unwrap();
                stepper.give_back(refresher);
            }
        }
        if let Some(lent) = lent {
            stepper.give_back(lent);
        }
        stepper.step(&mut body, H, &targets, || false).unwrap();
        // The support holds the bent shape, up to rounding.
        let at: Vec<Vec3> = body.positions().collect();
        for (&vertex, held) in right.vertices.iter().zip(&held) {
            assert!((at[vertex as usize] - held).norm() < 1e-12, "{name}");
        }
        assert!(body.handle_report(1).unwrap().reaction.force.norm() > 0.0);
        body.assemble();
        let condensed = condenser.condense(&body, 0.01).unwrap();
        assert_eq!(condensed.stiffness.size(), 12, "{name}");
    }
}

#[test]
fn a_moving_body_is_supported_at_its_present_place_and_falls_when_the_support_is_lifted() {
    let mesh = bar();
    let [left, right, _] = specs(&mesh.positions);
    let law = SolidLaw::Corotational;
    let mut body = Body::solid(&mesh, &[RUBBER], law, config(9.81), &[left]).unwrap();
    let mut stepper = Stepper::<f64>::new(&body, StepperOptions::default()).unwrap();
    let targets = poses(&body);
    for _ in 0..40 {
        stepper.step(&mut body, H, &targets, || false).unwrap();
    }
    let tip = right.vertices[0] as usize;
    let before = body.positions().nth(tip).unwrap();
    let support = body
        .add_support(&right.vertices, [false, false, true])
        .unwrap();
    for _ in 0..20 {
        stepper.step(&mut body, H, &targets, || false).unwrap();
    }
    let held = body.positions().nth(tip).unwrap();
    assert!((held.z - before.z).abs() < 1e-12);
    assert!(body.support_reaction(support).unwrap().z.abs() > 0.0);
    body.lift_support(support).unwrap();
    stepper.step(&mut body, H, &targets, || false).unwrap();
    assert!(body.positions().nth(tip).unwrap().z != held.z);
    assert_eq!(body.support_count(), 0);
}

#[test]
fn an_impossible_handle_or_support_is_refused_and_changes_nothing() {
    let mesh = bar();
    let [left, right, middle] = specs(&mesh.positions);
    let law = SolidLaw::Corotational;
    let specs = std::slice::from_ref(&left);
    let mut body = Body::solid(&mesh, &[RUBBER], law, config(9.81), specs).unwrap();
    body.add_support(&right.vertices, [true; 3]).unwrap();
    let epoch = body.epoch();
    assert!(matches!(
        body.grab(&left),
        Err(BodyError::SharedVertex {
            first: 0,
            second: 1,
            ..
        })
    ));
    assert!(matches!(
        body.grab(&right),
        Err(BodyError::HeldAndGuided {
            handle: 1,
            support: 0,
            ..
        })
    ));
    assert!(matches!(
        body.grab(&HandleSpec {
            vertices: vec![u32::MAX],
            ..middle
        }),
        Err(BodyError::HandleVertex { handle: 1, .. })
    ));
    assert_eq!(
        body.release(1),
        Err(BodyError::NoHandle {
            handle: 1,
            count: 1
        })
    );
    assert!(matches!(
        body.lift_support(1),
        Err(BodyError::Support { support: 1, .. })
    ));
    assert!(matches!(
        body.add_support(&left.vertices, [true; 3]),
        Err(BodyError::HeldAndGuided { handle: 0, .. })
    ));
    assert_eq!(body.epoch(), epoch);
}

/// A thousand supports cost one build of the matrix. The body is that to which they were added one by one; a fault leaves
/// the body as it was.
#[test]
fn many_supports_are_added_at_once() {
    let mesh = sheet(0.1, 0.1, 8, 8, Pattern::Alternating).unwrap();
    let material = Material {
        young: 1e6,
        poisson: 0.3,
        thickness: 1e-3,
        density: 1000.0,
    };
    let left: Vec<u32> = spec(&mesh.positions, |x| x.x < -0.049).vertices;
    let each = (0..1000).map(|number: usize| SupportSpec {
        vertices: left[number % 3..].to_vec(),
        axes: [0, 1, 2].map(|axis| axis == number % 3),
        border: Border::Hinged,
    });
    let clamp = SupportSpec {
        vertices: left.clone(),
        axes: [true; 3],
        border: Border::Clamped,
    };
    let specs: Vec<_> = each.chain([clamp]).collect();
    let config = BodyConfig {
        bending: 1.0,
        ..config(9.81)
    };
    let build = || Body::sheet(&mesh, &[material], config, &[]).unwrap();
    let (mut at_once, mut one_by_one) = (build(), build());
    let before = at_once.epoch();
    assert_eq!(at_once.add_supports(&specs), Ok(0));
    assert_eq!(at_once.epoch(), before + 1);
    // The last of each kind decides.
    for (number, spec) in specs.iter().enumerate() {
        let added = match spec.border {
            Border::Hinged => one_by_one.add_support(&spec.vertices, spec.axes),
            Border::Clamped => one_by_one.add_clamp(&spec.vertices),
        };
        assert_eq!(added, Ok(number));
    }
    for body in [&mut at_once, &mut one_by_one] {
        for _ in 0..3 {
            body.step(H, &[]).unwrap();
        }
    }
    assert!(at_once.positions().eq(one_by_one.positions()));
    let epoch = at_once.epoch();
    let mut wrong = specs[..2].to_vec();
    wrong[1].vertices.push(9999);
    let error = at_once.add_supports(&wrong).unwrap_err();
    assert!(
        matches!(error, BodyError::Support { support: 1002, .. }),
        "{error}"
    );
    assert_eq!(at_once.epoch(), epoch);
    assert_eq!(at_once.add_supports(&specs[..1]), Ok(1001));
}
