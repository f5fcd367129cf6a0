//! The incomplete factor: exact where nothing fills up, positive definite whatever it meets, and steps on it as on the
//! complete one.

mod fem_support;

use fem_support::{Random, Split, block, grid, handle, rest_poses};
use physics::fast::factor::Factor;
use physics::fast::incomplete::{Blocks, aggregates::aggregates, order::order};
use physics::fast::{
    Cost, Node, Part, Preconditioner, ShapeOptions, Stepper, StepperOptions, complete_bytes,
};
use physics::fem::dense::Square;
use physics::fem::{
    BlockMatrix, Body, BodyConfig, CondenseError, Condenser, Freedom, HandlePose, HandleSpec,
    Material, SolidLaw, SolidMaterial,
};
use physics::mesh::generate_box::solid_box;
use physics::{Mat3, Vec3};

/// A matrix with these blocks and their transposes.
fn matrix(nodes: usize, blocks: &[(u32, u32, Mat3)]) -> BlockMatrix {
    let pairs: Vec<[u32; 2]> = blocks.iter().map(|&(i, j, _)| [i, j]).collect();
    let mut matrix = BlockMatrix::new(nodes, nodes, pairs.iter().map(<[u32; 2]>::as_slice));
    for (i, j, block) in blocks {
        let slot = matrix.slot(*i, *j).unwrap();
        matrix.add(slot, block);
        if i != j {
            let slot = matrix.slot(*j, *i).unwrap();
            matrix.add(slot, &block.transpose());
        }
    }
    matrix
}

fn any(random: &mut Random) -> Mat3 {
    Mat3::from_columns(&[random.vector(), random.vector(), random.vector()])
}

/// `sum B B^T` over the pairs of a chain: positive definite and block-tridiagonal.
fn chain(nodes: u32, random: &mut Random) -> BlockMatrix {
    let mut blocks = Vec::new();
    for i in 0..nodes {
        let own = any(random);
        blocks.push((i, i, own * own.transpose() + Mat3::identity()));
        if i + 1 < nodes {
            let (left, right) = (any(random), any(random));
            blocks.push((i, i, left * left.transpose()));
            blocks.push((i + 1, i + 1, right * right.transpose()));
            blocks.push((i, i + 1, left * right.transpose()));
        }
    }
    matrix(nodes as usize, &blocks)
}

fn random_nodes(count: usize, random: &mut Random) -> Vec<Node<f32>> {
    let node = |_| {
        let v = random.vector();
        [v.x as f32, v.y as f32, v.z as f32, 0.0]
    };
    (0..count).map(node).collect()
}

fn flat(nodes: &[Node<f32>]) -> Vec<f64> {
    let numbers = nodes.iter().flat_map(|node| node[..3].iter());
    numbers.copied().map(f64::from).collect()
}

/// Largest difference as a share of the largest number.
fn off(a: &[f64], b: &[f64]) -> f64 {
    let difference = a.iter().zip(b).map(|(a, b)| (a - b).abs());
    difference.fold(0.0, f64::max) / b.iter().map(|b| b.abs()).fold(0.0, f64::max)
}

#[test]
fn without_fill_it_is_the_complete_factor_and_solves() {
    let mut random = Random(11);
    let nodes = 200;
    let matrix = chain(nodes, &mut random);
    let mass: Vec<f64> = (0..nodes).map(|_| 1.5 + random.signed()).collect();
    let mask: Vec<Vec3> = (0..nodes)
        .map(|node| Vec3::new(1.0, f64::from(node % 7 > 0), f64::from(node % 5 > 0)))
        .collect();
    for mask in [None, Some(mask.as_slice())] {
        let mut blocks = Blocks::new(&matrix);
        blocks.factorize(&matrix, &mass, 2.0, 3.0, mask).unwrap();
        assert_eq!(blocks.shift(), 0.0);
        let places: Vec<u32> = (0..nodes).collect();
        let mut factor = Factor::new(&matrix, &places).unwrap();
        factor.factorize(&matrix, &mass, 2.0, 3.0, mask).unwrap();
        let mut ours = random_nodes(nodes as usize, &mut random);
        let mut exact = flat(&ours);
        blocks.solve(&mut ours);
        assert!(ours.iter().all(|node| node[3] == 0.0));
        factor.solve(&mut exact);
        // Rounding of single precision, some tens of times: the matrix's condition is about that.
        let off = off(&flat(&ours), &exact);
        assert!(off < 1e-5, "{off:e}");
    }
}

#[test]
fn it_is_symmetric() {
    let body = cube(4, 1.0);
    let places = order(body.stiffness());
    let mut blocks = Blocks::new(body.stiffness());
    blocks
        .factorize(body.stiffness(), body.node_masses(), 1e4, 11.0, None)
        .unwrap();
    let mut random = Random(3);
    let [a, b] = [(); 2].map(|()| random_nodes(places.len(), &mut random));
    let product = |left: &[Node<f32>], right: &[Node<f32>]| -> f64 {
        let mut solved = right.to_vec();
        blocks.solve(&mut solved);
        let pairs = flat(left).into_iter().zip(flat(&solved));
        pairs.map(|(a, b)| a * b).sum()
    };
    let (forth, back) = (product(&a, &b), product(&b, &a));
    let scale = (product(&a, &a) * product(&b, &b)).sqrt();
    // Single precision.
    assert!((forth - back).abs() < 1e-5 * scale, "{forth} {back}");
}

/// Kershaw's matrix ("The incomplete Cholesky-conjugate gradient method for the iterative solution of systems of linear
/// equations", 1978): positive definite, and its incomplete factor without a shift has a pivot of -5.
#[test]
fn bad_pivots_enlarge_the_diagonal_and_leave_a_positive_preconditioner() {
    let one = Mat3::identity();
    let turn = *nalgebra::Rotation3::from_scaled_axis(Vec3::new(0.4, 1.0, -0.3)).matrix();
    for turn in [one, turn] {
        // Turned from node to node, which changes no eigenvalue.
        let entries = [(0, 1, -2.0), (1, 2, -2.0), (2, 3, -2.0), (0, 3, 2.0)];
        let mut blocks: Vec<_> = (0..4).map(|i| (i, i, one * 3.0)).collect();
        let turns: [Mat3; 4] = core::array::from_fn(|i| (0..i).fold(one, |all, _| all * turn));
        for (i, j, value) in entries {
            let block = turns[i] * turns[j].transpose() * value;
            blocks.push((i as u32, j as u32, block));
        }
        let matrix = matrix(4, &blocks);
        let mut factor = Blocks::new(&matrix);
        factor
            .factorize(&matrix, &[0.0; 4], 0.0, 1.0, None)
            .unwrap();
        assert!((1e-3..1.0).contains(&factor.shift()), "{}", factor.shift());
        for unknown in 0..12 {
            let mut unit = vec![[0.0_f32; 4]; 4];
            unit[unknown / 3][unknown % 3] = 1.0;
            factor.solve(&mut unit);
            let own = unit[unknown / 3][unknown % 3];
            assert!(own > 0.0 && own.is_finite(), "{own}");
        }
    }
}

#[test]
fn what_is_not_positive_definite_is_refused() {
    let mut random = Random(2);
    let good = chain(6, &mut random);
    let mut factor = Blocks::new(&good);
    for entry in [-1e9, f64::NAN] {
        let mut bad = good.clone();
        let slot = bad.slot(3, 3).unwrap();
        bad.add(slot, &Mat3::from_diagonal_element(entry));
        let error = factor.factorize(&bad, &[1.0; 6], 1.0, 1.0, None);
        let expected = CondenseError::NotPositiveDefinite { pivot: 9 };
        assert_eq!(error.unwrap_err(), expected);
    }
    let error = factor.factorize(&chain(5, &mut random), &[1.0; 6], 1.0, 1.0, None);
    assert_eq!(error.unwrap_err(), CondenseError::Topology);
    let error = factor.factorize(&good, &[1.0; 5], 1.0, 1.0, None);
    assert_eq!(error.unwrap_err(), CondenseError::Topology);
    factor.factorize(&good, &[1.0; 6], 1.0, 1.0, None).unwrap();
}

/// Two chains that touch nowhere, and a node alone.
#[test]
fn orders_and_patches_have_every_node() {
    let mut random = Random(8);
    let mut blocks = vec![(0, 0, Mat3::identity())];
    for start in [1_u32, 120] {
        blocks.extend((start..start + 99).map(|i| (i, i + 1, any(&mut random))));
    }
    let matrix = matrix(220, &blocks);
    let mut order = order(&matrix);
    // Along a chain neighbours follow each other.
    let steps = order
        .windows(2)
        .filter(|pair| pair[0].abs_diff(pair[1]) == 1);
    assert!(steps.count() >= 198);
    order.sort_unstable();
    assert!(order.into_iter().eq(0..220));
    let (patch, count) = aggregates(&matrix);
    let mut sizes = vec![0; count];
    for &patch in &patch {
        sizes[patch as usize] += 1;
    }
    // Pieces of sixty and the rest of each chain, and nodes that touch nothing.
    assert!(
        sizes.iter().all(|&size| size <= 75 && size > 0),
        "{sizes:?}"
    );
    assert!(
        sizes.iter().filter(|&&size| size >= 15).count() == 4,
        "{sizes:?}"
    );
}

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
    // Weightless, a body can be kept at small strains.
    BodyConfig {
        gravity: Vec3::zeros(),
        mass_damping: 0.1,
        stiffness_damping: 0.1,
        bending: 1.0,
        ..BodyConfig::default()
    }
}

/// A cube of 10 cm between two plates, its core so many times stiffer than the rest.
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

/// A bar held by a support along two axes at one end, by a hand at the other; a law without a kernel of its own.
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

/// The last handle moves and turns, by a few percent of the body.
fn poses(body: &Body, step: u32) -> Vec<HandlePose> {
    let mut poses = handle_poses(body);
    if let Some(last) = poses.last_mut() {
        let share = f64::from(step) / 20.0;
        last.position += Vec3::new(0.004, 0.002, -0.006) * share;
        last.rotation =
            nalgebra::UnitQuaternion::from_scaled_axis(Vec3::new(0.1, -0.2, 0.1) * share);
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
            // Both are solved to 1e-12 of the forces, twenty times; bending is 1e4 times softer than stretching.
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

/// What the patches are for: the incomplete factor alone would take more than twice as many on twice as fine a mesh.
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
    // A quarter more is what patches of one size leave.
    assert!(fine < 1.5 * coarse, "{coarse} {fine}");
}

#[test]
fn memory_is_counted_and_grows_as_the_mesh() {
    let share = |n: u32| {
        let body = cube(n, 1.0);
        let stepper = Stepper::<f64>::new(&body, options(Preconditioner::Incomplete)).unwrap();
        let elements = body.element_count() as f64;
        (
            stepper.bytes() as f64 / elements,
            complete_bytes(&body) as f64 / elements,
        )
    };
    let ((small, complete_small), (large, complete_large)) = (share(7), share(14));
    println!(
        "bytes a tetrahedron: {small:.0}, {large:.0}; {complete_small:.0}, {complete_large:.0}"
    );
    // The rim's share changes, no more; the complete factor grows by eight to the power 0.3 and more.
    assert!(large < 1.15 * small, "{small} {large}");
    assert!(complete_large > 1.7 * complete_small);
    // What it counts is a part of what a stepper on the complete factor holds, and most of what that grows by.
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
            assert_eq!(stepper.cost(Part::Refresh), None);
            refresher.work().unwrap();
            stepper.give_back(refresher);
            taken += 1;
        }
    }
    assert!(taken > 1, "{taken}");
    for part in [Part::Precondition, Part::Refresh] {
        let Cost { read, flops, .. } = stepper.cost(part).unwrap();
        assert!(read > 100 * body.vertex_count() && flops > 100 * body.vertex_count());
        stepper.repeat(part).unwrap();
    }
}

#[test]
fn local_models_are_those_of_a_factorization() {
    for (name, mut body) in bodies() {
        if name == "core" {
            // A cube like the first.
            continue;
        }
        let handles = body.handle_count();
        let mut stepper = Stepper::<f64>::new(&body, options(Preconditioner::Incomplete)).unwrap();
        let mut condenser = Condenser::new(&body).unwrap();
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
            let (ours, report) = stepper.condense(&body, 0.02, &options).unwrap();
            assert!(report.residual <= 1e-11, "{name}: {report:?}");
            let off = square_off(&ours.stiffness, &exact.stiffness);
            // As tight as the shapes, by the condition of what is condensed.
            assert!(off < 1e-7, "{name}: {off:e}");
            // Those of the last time are where the next begin.
            if step > 0 {
                assert!(report.iterations < before, "{name}: {report:?}");
            } else {
                before = report.iterations;
            }
        }
    }
}

fn square_off(a: &Square, b: &Square) -> f64 {
    let entries = |square: &Square| -> Vec<f64> {
        let size = square.size();
        (0..size * size)
            .map(|at| square[(at / size, at % size)])
            .collect()
    };
    off(&entries(a), &entries(b))
}

#[test]
fn a_body_without_free_nodes_steps() {
    let mesh = solid_box([0.1; 3], [1, 1, 1]).unwrap();
    let hand = HandleSpec {
        vertices: (0..8).collect(),
        origin: Vec3::zeros(),
        freedom: Freedom::Rigid,
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
