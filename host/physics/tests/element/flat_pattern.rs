//! Sheets that are cut out of flat patterns and sewn: sleeves and cones relax to the shapes that their patterns make, a
//! pattern that says nothing new changes nothing, and wrong patterns are refused.

use common::*;
use physics::mesh::{FlatPattern, MeshError, PatternError, TriMesh};
use physics::{
    Body, BodyConfig, BodyError, Border, Equilibrium, EquilibriumOptions, Freedom, HandleSpec,
    Mat3, Material, Rigidity, SheetLawName, Stepper, StepperOptions, Vec3, Weave,
};
use proptest::prelude::*;
use std::f64::consts::TAU;

fn bending() -> BodyConfig {
    BodyConfig {
        bending: 1.0,
        ..tight()
    }
}

fn cloth() -> Weave {
    Weave {
        warp: Vec3::x(),
        young_warp: 4e5,
        young_weft: 1e5,
        poisson: 0.2,
        shear: 2e4,
        thickness: 1e-3,
        density: 300.0,
        rigidity: Rigidity {
            warp: 5e-6,
            weft: 2e-6,
            twist: 7e-7,
        },
    }
}

/// The corners of each triangle of a mesh in the plane z = 0, at `place` of the triangle and the position.
fn corners(mesh: &TriMesh, place: impl Fn(usize, &Vec3) -> [f64; 2]) -> FlatPattern {
    let at = |(number, triangle): (usize, &[u32; 3])| {
        triangle.map(|vertex| place(number, &mesh.positions[vertex as usize]))
    };
    FlatPattern {
        corners: mesh.triangles.iter().enumerate().map(at).collect(),
    }
}

/// The same mesh, cut out of itself.
fn cut(mesh: &TriMesh, place: impl Fn(usize, &Vec3) -> [f64; 2]) -> TriMesh {
    TriMesh {
        flat_pattern: Some(corners(mesh, place)),
        ..mesh.clone()
    }
}

/// Pieces of a flat mesh, laid out anew: those left of `x` stay, the others are moved away, turned and laid down on their
/// other face.
fn two_pieces(mesh: &TriMesh, x: f64) -> TriMesh {
    let triangles: Vec<bool> = mesh
        .triangles
        .iter()
        .map(|corners| {
            let sum: f64 = corners.iter().map(|&v| mesh.positions[v as usize].x).sum();
            sum / 3.0 > x
        })
        .collect();
    let (s, c) = 0.7_f64.sin_cos();
    cut(mesh, |triangle, p| {
        if triangles[triangle] {
            [3.0 + c * p.x + s * p.y, 1.0 + s * p.x - c * p.y]
        } else {
            [p.x, p.y]
        }
    })
}

/// A piece of `nx` x `ny` cells whose left and right sides are sewn together: a sleeve around the z axis. `place` gives
/// the position of each point of the piece.
fn sewn(piece: &TriMesh, (nx, ny): (u32, u32), place: impl Fn(&Vec3) -> Vec3) -> TriMesh {
    let number = |vertex: u32| {
        let (i, j) = (vertex % (nx + 1), vertex / (nx + 1));
        j * nx + i % nx
    };
    let mut positions = vec![Vec3::zeros(); (nx * (ny + 1)) as usize];
    for (vertex, x) in (0_u32..).zip(&piece.positions) {
        // The right side is sewn onto the left side.
        if vertex % (nx + 1) < nx {
            positions[number(vertex) as usize] = place(x);
        }
    }
    let triangles = piece.triangles.iter().map(|t| t.map(number)).collect();
    let mut mesh = TriMesh::new(positions, triangles).unwrap();
    mesh.flat_pattern = Some(corners(piece, |_, x| [x.x, x.y]));
    mesh.validate().unwrap();
    mesh
}

/// A rectangle sewn to a sleeve of the radius `radius`, while its own is 0.1 m.
fn sleeve(piece: impl Fn(u32, u32, f64, f64) -> TriMesh, nx: u32, radius: f64) -> TriMesh {
    let (ny, around) = (nx / 2, TAU * 0.1);
    sewn(&piece(nx, ny, around, 0.3), (nx, ny), |x| {
        let angle = x.x / 0.1;
        Vec3::new(radius * angle.cos(), radius * angle.sin(), x.y)
    })
}

/// The name of a kind of triangles, and the rectangle of a number of cells and of a size.
type Piece = (&'static str, fn(u32, u32, f64, f64) -> TriMesh);

/// A pattern of right-angled, of alternating and of irregular triangles.
fn pieces() -> [Piece; 3] {
    [
        ("right", |nx, ny, lx, ly| grid(nx, ny, lx, ly, Split::Right)),
        ("alternating", |nx, ny, lx, ly| {
            grid(nx, ny, lx, ly, Split::Alternating)
        }),
        ("irregular", |nx, ny, lx, ly| {
            irregular(nx, ny, lx, ly, 0.2, 17)
        }),
    ]
}

fn moved(mesh: &TriMesh, by: f64, seed: u64) -> Vec<Vec3> {
    let mut random = Random(seed);
    let at = mesh.positions.iter();
    at.map(|x| x + random.vector() * by).collect()
}

fn forces(body: &mut Body, x: &[Vec3]) -> Vec<Vec3> {
    body.set_positions(x).unwrap();
    body.assemble();
    body.internal_forces().collect()
}

fn near(found: &[Vec3], expected: &[Vec3], tolerance: f64) {
    let scale = largest(expected.iter().copied());
    let error = largest(found.iter().zip(expected).map(|(a, b)| a - b));
    assert!(error <= tolerance * scale, "{error:e} of {scale:e}");
}

#[test]
fn a_pattern_that_is_the_mesh_changes_nothing() {
    let mesh = irregular(8, 6, 0.2, 0.15, 0.2, 5);
    let same = cut(&mesh, |_, x| [x.x, x.y]);
    let x = moved(&mesh, 0.004, 9);
    let of = |mesh: &TriMesh, config| Body::sheet(mesh, &[rubber(0.3)], config, &[]).unwrap();
    // Without bending to the last bit. With it, lengths are divided by themselves.
    assert_eq!(
        forces(&mut of(&same, tight()), &x),
        forces(&mut of(&mesh, tight()), &x)
    );
    near(
        &forces(&mut of(&same, bending()), &x),
        &forces(&mut of(&mesh, bending()), &x),
        1e-12,
    );
    for law in [SheetLawName::Corotational, SheetLawName::StVenantKirchhoff] {
        let of = |mesh| Body::woven(mesh, &[cloth()], law, bending(), &[]).unwrap();
        near(
            &forces(&mut of(&same), &x),
            &forces(&mut of(&mesh), &x),
            1e-12,
        );
    }
}

#[test]
fn pieces_may_lie_anywhere_and_on_either_face() {
    let mesh = irregular(8, 6, 0.2, 0.15, 0.2, 6);
    let pieces = two_pieces(&mesh, 0.1);
    pieces.validate().unwrap();
    let x = moved(&mesh, 0.004, 10);
    let of = |mesh: &TriMesh| {
        let mut body = Body::sheet(mesh, &[rubber(0.3)], bending(), &[]).unwrap();
        let forces = forces(&mut body, &x);
        let stress: Vec<_> = (0..mesh.triangles.len())
            .map(|element| body.bending_stress(element))
            .collect();
        (forces, stress, body.total_mass())
    };
    let ((found, stress, mass), (expected, expected_stress, expected_mass)) =
        (of(&pieces), of(&mesh));
    near(&found, &expected, 1e-11);
    let scale = expected_stress.iter().map(Mat3::amax).fold(0.0, f64::max);
    for (found, expected) in stress.iter().zip(&expected_stress) {
        assert!((found - expected).amax() < 1e-9 * scale);
    }
    assert!((mass / expected_mass - 1.0).abs() < 1e-12);
}

/// The warp is a direction of the pattern: a pattern that is turned against the mesh turns the warp back.
#[test]
fn the_warp_is_a_direction_of_the_pattern() {
    let mesh = irregular(6, 5, 0.2, 0.15, 0.2, 7);
    let x = moved(&mesh, 0.004, 11);
    let (s, c) = 0.6_f64.sin_cos();
    let turned = cut(&mesh, |_, p| [c * p.x - s * p.y, s * p.x + c * p.y]);
    let on_mesh = Weave {
        warp: Vec3::new(c, -s, 0.0),
        ..cloth()
    };
    for law in [SheetLawName::Corotational, SheetLawName::StVenantKirchhoff] {
        let of = |mesh, weave| Body::woven(mesh, &[weave], law, bending(), &[]).unwrap();
        let expected = forces(&mut of(&mesh, on_mesh), &x);
        near(&forces(&mut of(&turned, cloth()), &x), &expected, 1e-11);
        // The direction matters.
        let unturned = forces(&mut of(&mesh, cloth()), &x);
        let difference = largest(unturned.iter().zip(&expected).map(|(a, b)| a - b));
        assert!(difference > 0.1 * largest(expected.into_iter()));
    }
}

#[test]
fn mass_and_stress_follow_the_pattern() {
    let mesh = grid(4, 3, 0.4, 0.3, Split::Right);
    let large = cut(&mesh, |_, x| [1.1 * x.x, 1.1 * x.y]);
    assert!((large.area() / mesh.area() - 1.21).abs() < 1e-12);
    let material = rubber(0.3);
    let mut body = Body::sheet(&large, &[material], bending(), &[]).unwrap();
    let mass = material.density * material.thickness * 0.12 * 1.21;
    assert!((body.total_mass() / mass - 1.0).abs() < 1e-12);
    // Both principal stretches are 1/1.1.
    let strain: f64 = 1.0 / 1.1 - 1.0;
    let stress = material.young / (1.0 - material.poisson) * strain;
    let expected = 0.12 * 1.21 * material.thickness * stress * strain;
    assert!((body.elastic_energy() / expected - 1.0).abs() < 1e-12);
    assert_eq!(body.bending_energy(), 0.0);
    // The Cauchy stress acts on the shortened edge.
    let found = body.elements()[0].stress(0, body.node_positions());
    assert!((found[(0, 0)] / (stress * 1.1) - 1.0).abs() < 1e-12);
    let scale = largest(forces(&mut body, &mesh.positions).into_iter());
    assert!(scale > 0.0);
}

/// Half the rigidity times area over the square of the radius, on a polygon whose sides have their rest lengths. Triangles
/// along the two open ends have no moment across them, which is right: the sheet has no Poisson's ratio.
#[test]
fn a_sleeve_stores_the_energy_of_its_cylinder() {
    let material = rubber(0.0);
    let exact = 0.5 * material.bending_rigidity() * (TAU * 0.1 * 0.3) / 0.01;
    for (name, piece) in pieces() {
        let errors = [12, 24, 48].map(|nx| {
            let body = Body::sheet(&sleeve(piece, nx, 0.1), &[material], bending(), &[]).unwrap();
            body.bending_energy() / exact - 1.0
        });
        assert!(errors[2].abs() < 0.002, "{name}: {errors:?}");
        assert!(
            errors[2].abs() < 0.26 * errors[1].abs(),
            "{name}: {errors:?}"
        );
    }
}

/// A sector of a ring, sewn to a cone: the curvature at the distance s from the apex is `cot(a) / s` with half the opening
/// angle a.
#[test]
fn a_cone_stores_the_energy_of_its_curvature() {
    let material = rubber(0.0);
    let (opening, near, far): (f64, f64, f64) = (0.5, 0.1, 0.3);
    let sine = opening.sin();
    let exact = 0.5 * material.bending_rigidity() / opening.tan().powi(2)
        * (TAU * sine)
        * (far / near).ln();
    let errors = [16, 32, 64].map(|nx| {
        let ny = nx / 4;
        let mut piece = irregular(nx, ny, TAU * sine, far - near, 0.15, 3);
        for x in &mut piece.positions {
            let (turn, along) = (x.x, near + x.y);
            *x = Vec3::new(along * turn.cos(), along * turn.sin(), 0.0);
        }
        let cone = sewn(&piece, (nx, ny), |x| {
            let (along, turn) = (x.xy().norm(), x.y.atan2(x.x).rem_euclid(TAU) / sine);
            let radius = along * sine;
            Vec3::new(
                radius * turn.cos(),
                radius * turn.sin(),
                along * opening.cos(),
            )
        });
        let body = Body::sheet(&cone, &[material], bending(), &[]).unwrap();
        body.bending_energy() / exact - 1.0
    });
    assert!(errors[2].abs() < 0.002, "{errors:?}");
    assert!(errors[2].abs() < 0.3 * errors[1].abs(), "{errors:?}");
}

/// Guides a sleeve so that it keeps its symmetry: no force of a support is left at its equilibrium.
fn guided(mesh: &TriMesh, body: &mut Body) {
    let chosen = |holds: &dyn Fn(&Vec3) -> bool| -> Vec<u32> {
        let vertices = (0_u32..).zip(&mesh.positions);
        let chosen = vertices.filter(|(_, x)| holds(x));
        chosen.map(|(vertex, _)| vertex).collect()
    };
    for (holds, axes) in [
        (chosen(&|x| x.z < 1e-9), [false, false, true]),
        (chosen(&|x| x.y.abs() < 1e-9), [false, true, false]),
        (chosen(&|x| x.x.abs() < 1e-9), [true, false, false]),
    ] {
        body.add_support(&holds, axes).unwrap();
    }
}

/// Brings a sleeve of 32 cells around to equilibrium, which is a cylinder with the radius of its pattern. The places of the
/// mesh are not in balance, so the way from there is no snap.
fn relax_to_pattern(body: &mut Body) {
    let options = EquilibriumOptions {
        find_snaps: true,
        ..EquilibriumOptions::default()
    };
    let report = Equilibrium::new(body, options)
        .unwrap()
        .solve(body, &[], 1.0)
        .unwrap();
    assert_eq!(report.snapped, None);
    // The polygon of 32 sides is 0.16 % further out than the circle of the same length. The moment presses the sheet by
    // the square of thickness over radius, 1e-4 over 12.
    for x in body.positions() {
        assert!((x.xy().norm() / 0.1 - 1.0016).abs() < 1e-4, "{x}");
    }
}

#[test]
fn a_sleeve_relaxes_to_the_radius_of_its_pattern() {
    let material = rubber(0.0);
    let exact = 0.5 * material.bending_rigidity() * (TAU * 0.1 * 0.3) / 0.01;
    for start in [0.08, 0.09, 0.125] {
        let mesh = sleeve(pieces()[1].1, 32, start);
        let mut body = Body::sheet(&mesh, &[material], bending(), &[]).unwrap();
        guided(&mesh, &mut body);
        relax_to_pattern(&mut body);
        let membrane = body.elastic_energy() - body.bending_energy();
        assert!(membrane < 1e-4 * exact, "{membrane:e} {exact:e}");
        assert!((body.bending_energy() / exact - 1.0).abs() < 0.01);
    }
}

#[test]
fn a_woven_sleeve_relaxes_too() {
    // The warp goes around; without Poisson's ratio the rigidity of the warp alone is felt.
    let weave = Weave {
        poisson: 0.0,
        ..cloth()
    };
    let exact = 0.5 * weave.rigidity.warp * (TAU * 0.1 * 0.3) / 0.01;
    let mesh = sleeve(pieces()[1].1, 32, 0.12);
    let law = SheetLawName::StVenantKirchhoff;
    let mut body = Body::woven(&mesh, &[weave], law, bending(), &[]).unwrap();
    guided(&mesh, &mut body);
    relax_to_pattern(&mut body);
    assert!((body.bending_energy() / exact - 1.0).abs() < 0.01);
}

/// A bag of two squares that are sewn together along three sides. It starts 5 % too large and open.
fn bag(cells: u32, side: f64) -> TriMesh {
    let piece = irregular(cells, cells, side, side, 0.15, 12);
    let count = piece.positions.len() as u32;
    let sewn = |x: &Vec3| x.x < 1e-9 || x.x > side - 1e-9 || x.y < 1e-9;
    let mut positions = piece.positions.clone();
    let mut of_back = Vec::new();
    for (vertex, x) in (0_u32..).zip(&piece.positions) {
        if sewn(x) {
            of_back.push(vertex);
        } else {
            of_back.push(positions.len() as u32);
            positions.push(*x);
        }
    }
    for (vertex, x) in (0_u32..).zip(&mut positions) {
        let face = if vertex < count { 1.0 } else { -1.0 };
        x.z = face * 0.4 * x.x * (side - x.x) * x.y / (side * side);
        *x *= 1.05;
    }
    let back = piece.triangles.iter();
    let back = back.map(|&[a, b, c]| [a, c, b].map(|vertex| of_back[vertex as usize]));
    let triangles = piece.triangles.iter().copied().chain(back).collect();
    let mut mesh = TriMesh::new(positions, triangles).unwrap();
    let at = |vertex: u32| piece.positions[vertex as usize];
    let front = piece
        .triangles
        .iter()
        .map(|t| t.map(|v| [at(v).x, at(v).y]));
    let back = piece.triangles.iter();
    let back = back.map(|&[a, b, c]| [a, c, b].map(|v| [2.0 * side + at(v).x, at(v).y]));
    mesh.flat_pattern = Some(FlatPattern {
        corners: front.chain(back).collect(),
    });
    mesh.validate().unwrap();
    mesh
}

#[test]
fn a_bag_of_two_pieces_shrinks_to_their_size() {
    let mesh = bag(8, 0.2);
    let material = rubber(0.3);
    let mut body = Body::sheet(&mesh, &[material], bending(), &[]).unwrap();
    let mass = 2.0 * 0.04 * material.thickness * material.density;
    assert!((body.total_mass() / mass - 1.0).abs() < 1e-12);
    let start = body.elastic_energy();
    settle(&mut body, &[], 0.05, 100).unwrap();
    // The two pieces come to lie on each other, flat and without strain: a fold that is closed has no moment.
    assert!(body.elastic_energy() < 1e-12 * start);
    let sides: Vec<f64> = body.positions().map(|x| x.y).collect();
    let height = sides.iter().fold(f64::MIN, |most, y| y.max(most))
        - sides.iter().fold(f64::MAX, |least, y| y.min(least));
    // The bag has turned a little in its plane.
    assert!((height / 0.2 - 1.0).abs() < 1e-4, "{height}");
    let moved = body
        .positions()
        .zip(&mesh.positions)
        .map(|(x, start)| x - start);
    assert!(largest(moved) > 0.005);
}

/// A plate that is clamped all round, laid out as two pieces: the clamp sees the shapes of the pattern.
#[test]
fn a_clamped_plate_in_two_pieces_bends_like_one() {
    let mesh = irregular(8, 8, 0.1, 0.1, 0.2, 8);
    let deflection = |mesh: &TriMesh| {
        let mut body = Body::sheet(mesh, &[rubber(0.3)], bending(), &[]).unwrap();
        let border = (0_u32..).zip(&mesh.positions);
        let border = border.filter(|(_, x)| on_border(x, 0.1, 0.1));
        let border: Vec<u32> = border.map(|(vertex, _)| vertex).collect();
        body.add_clamp(&border).unwrap();
        let push = vec![Vec3::new(0.0, 0.0, 1e-6); mesh.positions.len()];
        body.set_external_forces(&push).unwrap();
        Equilibrium::new(&body, EquilibriumOptions::default())
            .unwrap()
            .solve(&mut body, &[], 1.0)
            .unwrap();
        body.positions().collect::<Vec<_>>()
    };
    let z = |positions: &[Vec3]| -> Vec<Vec3> {
        positions.iter().map(|x| Vec3::new(0.0, 0.0, x.z)).collect()
    };
    let expected = z(&deflection(&mesh));
    near(&z(&deflection(&two_pieces(&mesh, 0.05))), &expected, 1e-6);
}

/// The realtime step has kernels of its own, for which the positions at the start are neither flat nor without stress.
#[test]
fn the_realtime_step_is_the_assembled_step() {
    for law in [None, Some(SheetLawName::StVenantKirchhoff)] {
        let mesh = sleeve(pieces()[2].1, 12, 0.11);
        let end = |low: bool| HandleSpec {
            vertices: (0_u32..)
                .zip(&mesh.positions)
                .filter(|(_, x)| if low { x.z < 1e-9 } else { x.z > 0.3 - 1e-9 })
                .map(|(vertex, _)| vertex)
                .collect(),
            origin: Vec3::new(0.0, 0.0, if low { 0.0 } else { 0.3 }),
            freedom: Freedom::Rigid,
            border: if low { Border::Clamped } else { Border::Hinged },
        };
        let handles = [end(true), end(false)];
        let config = BodyConfig {
            stiffness_damping: 0.01,
            bending: 1.0,
            tolerance: 1e-14,
            max_iterations: 10_000,
            ..BodyConfig::default()
        };
        let body = match law {
            None => Body::sheet(&mesh, &[rubber(0.3)], config, &handles),
            Some(law) => Body::woven(&mesh, &[cloth()], law, config, &handles),
        }
        .unwrap();
        let options = StepperOptions {
            tolerance: 1e-13,
            sleep_speed: 0.0,
            ..StepperOptions::default()
        };
        let (mut fast, mut single, mut slow) = (body.clone(), body.clone(), body);
        let mut stepper = Stepper::<f64>::new(&fast, options).unwrap();
        let mut rough = Stepper::<f32>::new(&single, options).unwrap();
        for step in 1..=5 {
            let mut targets = rest_poses(&handles);
            targets[1].position.z += 1e-3 * f64::from(step);
            stepper.step(&mut fast, 0.004, &targets, || false).unwrap();
            rough.step(&mut single, 0.004, &targets, || false).unwrap();
            slow.step(0.004, &targets).unwrap();
            let x: Vec<Vec3> = slow.positions().collect();
            // The sheet moves by millimetres.
            for (body, tolerance) in [(&fast, 1e-13), (&single, 1e-7)] {
                let error = largest(body.positions().zip(&x).map(|(a, b)| a - b));
                assert!(error < tolerance, "{error:e}");
            }
        }
        let displaced = slow.positions().zip(&mesh.positions).map(|(a, b)| a - b);
        assert!(largest(displaced) > 1e-3);
    }
}

#[test]
fn wrong_patterns_are_refused() {
    let mesh = grid(2, 1, 0.2, 0.1, Split::Right);
    let good = corners(&mesh, |_, x| [x.x, x.y]);
    let refused = |change: &dyn Fn(&mut FlatPattern)| {
        let mut mesh = mesh.clone();
        let mut pattern = good.clone();
        change(&mut pattern);
        mesh.flat_pattern = Some(pattern);
        let error = mesh.check_pattern().unwrap_err();
        assert_eq!(mesh.validate(), Err(MeshError::Pattern(error.clone())));
        let sheet = Body::sheet(&mesh, &[rubber(0.3)], tight(), &[]).map(|_| ());
        assert_eq!(sheet, Err(BodyError::Pattern(error.clone())));
        let law = SheetLawName::StVenantKirchhoff;
        let woven = Body::woven(&mesh, &[cloth()], law, tight(), &[]).map(|_| ());
        assert_eq!(woven, Err(BodyError::Pattern(error.clone())));
        error
    };
    assert_eq!(
        refused(&|pattern| pattern.corners.truncate(3)),
        PatternError::Count {
            found: 3,
            triangles: 4
        }
    );
    let error = refused(&|pattern| pattern.corners[2][1][0] = f64::INFINITY);
    let found = f64::INFINITY;
    assert_eq!(error, PatternError::Coordinate { triangle: 2, found });
    let error = refused(&|pattern| pattern.corners[1][2] = pattern.corners[1][0]);
    assert_eq!(
        error,
        PatternError::Flat {
            triangle: 1,
            found: 0.0
        }
    );
    let error = refused(&|pattern| pattern.corners[3] = [[0.5, 0.5]; 3]);
    assert_eq!(error.triangle(), Some(3));
    // The third corner of the second triangle of the first cell falls on the other side of the diagonal.
    let error = refused(&|pattern| pattern.corners[1][2] = [0.1, 0.0]);
    assert_eq!(
        error,
        PatternError::Mirrored {
            triangle: 1,
            neighbour: 0
        }
    );
    assert!(error.to_string().contains("move their panels apart"));
}

/// A mesh with a pattern of two pieces whose sides at the seam differ in length, with random shapes inside.
fn eased(seed: u64) -> TriMesh {
    let mut mesh = irregular(6, 4, 0.3, 0.2, 0.2, seed);
    let flat = mesh.clone();
    let pieces = two_pieces(&flat, 0.15);
    let mut pattern = pieces.flat_pattern.unwrap();
    let mut random = Random(seed);
    // One piece is 20 % larger, and every triangle of it has a slightly different shape.
    for corners in &mut pattern.corners {
        if corners[0][0] > 1.0 {
            for c in corners.iter_mut().flatten() {
                *c *= 1.2 + 0.002 * random.signed();
            }
        }
    }
    mesh.flat_pattern = Some(pattern);
    for x in &mut mesh.positions {
        x.z = 0.5 * x.x * x.x + 0.3 * x.x * x.y;
    }
    mesh
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn forces_of_eased_seams_are_the_gradient_of_the_energy_and_balance(seed in any::<u64>()) {
        let mesh = eased(seed);
        // Thick, so that bending matters.
        let material = Material { thickness: 0.01, ..rubber(0.3) };
        let mut body = Body::sheet(&mesh, &[material], bending(), &[]).unwrap();
        let x = moved(&mesh, 0.01, seed);
        let pull = forces(&mut body, &x);
        let energy = body.elastic_energy();
        let scale = largest(pull.iter().copied());
        let sum: Vec3 = pull.iter().sum();
        let moment: Vec3 = x.iter().zip(&pull).map(|(x, f)| x.cross(f)).sum();
        prop_assert!(sum.norm() < 1e-10 * scale && moment.norm() < 1e-10 * scale);

        let tilt = nalgebra::Rotation3::from_euler_angles(0.4, -1.0, 2.0);
        let turned: Vec<Vec3> = x.iter().map(|x| tilt * x + Vec3::new(0.5, -0.4, 0.3)).collect();
        let found = forces(&mut body, &turned);
        let error = found.iter().zip(&pull).map(|(a, b)| a - tilt * b);
        prop_assert!(largest(error) < 1e-9 * scale);
        prop_assert!((body.elastic_energy() / energy - 1.0).abs() < 1e-11);

        let mut random = Random(seed ^ 1);
        let direction: Vec<Vec3> = x.iter().map(|_| random.vector()).collect();
        let slope: f64 = pull.iter().zip(&direction).map(|(f, d)| -f.dot(d)).sum();
        let step = 1e-7;
        let mut at = |by: f64| {
            let x: Vec<Vec3> = x.iter().zip(&direction).map(|(x, d)| x + d * by).collect();
            body.set_positions(&x).unwrap();
            body.elastic_energy()
        };
        let difference = (at(step) - at(-step)) / (2.0 * step);
        prop_assert!((slope - difference).abs() < 1e-6 * scale, "{slope} {difference}");
    }

    #[test]
    fn no_rigid_motion_of_sewn_flat_pieces_is_felt(seed in any::<u64>(), at in 0.05..0.25) {
        let mesh = two_pieces(&irregular(6, 4, 0.3, 0.2, 0.2, seed), at);
        let mut body = Body::sheet(&mesh, &[rubber(0.3)], bending(), &[]).unwrap();
        let mut random = Random(seed);
        let axis = random.vector() * 3.0;
        let tilt = nalgebra::Rotation3::new(axis);
        let shift = random.vector();
        let turned: Vec<Vec3> = mesh.positions.iter().map(|x| tilt * x + shift).collect();
        // Rounding of coordinates of a metre in triangles of centimetres, times the stiffness of a triangle, 1e3 N/m.
        prop_assert!(largest(forces(&mut body, &turned).into_iter()) < 1e-11);
    }
}
