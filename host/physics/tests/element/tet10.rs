//! Quadratic tetrahedra in blocks, straight and curved, against the exact form, and the properties of the stiffness.

use common::kernels::{difference, dot, hash, materials, nodes, vectors, zeros};
use common::{Random, block, cube};
use physics::element::VectorForm;
use physics::element::tet::cell::QuadraticTet;
use physics::element::tet::hooke::QuadraticTets;
use physics::element::tet::shape::Tet10;
use physics::element::tet::solid::Solid;
use physics::material::law::{Corotational, Frame};
use physics::mesh::{Cells, TetMesh};
use physics::polar::svd;
use physics::{Body, BodyConfig, Elements, Mat3, Real, SolidLaw, Vec3};

type Quadratic = Solid<10, 4, Tet10, Corotational>;

fn cells(mesh: &TetMesh) -> &[[u32; 10]] {
    match &mesh.cells {
        Cells::Quadratic(cells) => cells,
        Cells::Linear(_) => &[],
    }
}

fn law(mesh: &TetMesh) -> Quadratic {
    let materials = materials(mesh.cells.len());
    Solid::new(Corotational, &mesh.positions, cells(mesh), &materials).unwrap()
}

fn list(mesh: &TetMesh) -> Vec<QuadraticTet> {
    match law(mesh).vector_form() {
        Some(VectorForm::HookeanQuadraticTets(_, tets)) => tets,
        other => panic!("no quadratic tetrahedra: {other:?}"),
    }
}

fn body(mesh: &TetMesh, law: SolidLaw) -> Body {
    let config = BodyConfig {
        gravity: Vec3::zeros(),
        ..BodyConfig::default()
    };
    let materials = materials(mesh.cells.len());
    Body::solid(mesh, &materials, law, config, &[]).unwrap()
}

/// The middles of edges are moved by up to a twentieth of a grid cell, so that no two points of an element have the
/// same gradients.
fn curved(mut mesh: TetMesh, n: f64) -> TetMesh {
    let mut random = Random(7);
    let middles: std::collections::BTreeSet<u32> = cells(&mesh)
        .iter()
        .flat_map(|cell| cell[4..].to_vec())
        .collect();
    for middle in middles {
        mesh.positions[middle as usize] += random.vector() * (0.05 / n);
    }
    mesh
}

fn meshes() -> [(&'static str, TetMesh); 2] {
    let straight = cube(3, 0.2, true);
    [
        ("curved", curved(straight.clone(), 3.0)),
        ("straight", straight),
    ]
}

/// The body, turned by `angle` about an oblique axis, with every vertex moved by up to `fraction` of the mesh.
fn displaced(mesh: &TetMesh, angle: f64, fraction: f64, seed: u64) -> Vec<Vec3> {
    let mut random = Random(seed);
    let axis = nalgebra::Unit::new_normalize(Vec3::new(1.0, -2.0, 0.5));
    let turn = nalgebra::Rotation3::from_axis_angle(&axis, angle);
    let moved = |x: &Vec3| turn * x - x + random.vector() * fraction;
    mesh.positions.iter().map(moved).collect()
}

fn moved(mesh: &TetMesh, d: &[Vec3]) -> Vec<Vec3> {
    mesh.positions.iter().zip(d).map(|(x, d)| x + d).collect()
}

fn forces<T: Real>(tets: &mut QuadraticTets<T>, d: &[Vec3]) -> (Vec<Vec3>, f64) {
    let mut force = zeros(d.len());
    let energy = tets.linearize(&nodes(d), &mut force);
    (vectors(&force), energy.to_f64())
}

fn product<T: Real>(tets: &QuadraticTets<T>, u: &[Vec3]) -> Vec<Vec3> {
    let mut y = zeros(u.len());
    tets.product(T::of(1.0), &nodes(u), &mut y);
    vectors(&y)
}

fn field(count: usize, random: &mut Random) -> Vec<Vec3> {
    (0..count).map(|_| random.vector()).collect()
}

#[test]
fn forces_energy_and_rotations_are_those_of_the_body() {
    for (name, mesh) in meshes() {
        let (mut body, law) = (body(&mesh, SolidLaw::Corotational), law(&mesh));
        let mut inverted = 0;
        for (seed, fraction) in [1e-4, 0.02, 0.1].into_iter().enumerate() {
            // Each case starts from the rotations of the previous case, which are far away.
            let mut tets = QuadraticTets::<f64>::new(&list(&mesh));
            for angle in [0.0, 0.01, 1.0, 2.0, 3.0] {
                let d = displaced(&mesh, angle, fraction, seed as u64);
                let x = moved(&mesh, &d);
                body.set_positions(&x).unwrap();
                body.assemble();
                inverted += body.inverted_count();
                let expected: Vec<Vec3> = body.internal_forces().collect();
                let (force, energy) = forces(&mut tets, &d);
                let case = format!("{name}, angle {angle}, fraction {fraction}");
                // The tolerance is that of linear elements, but the gradients are several times as large here.
                let bound = if fraction < 1e-2 { 1e-10 } else { 1e-12 };
                let found = difference(&force, &expected);
                assert!(found < bound, "{case}: forces {found:e}");
                let reference = body.elastic_energy();
                let found = (energy - reference).abs() / reference;
                assert!(found < bound, "{case}: energy {found:e}");
                for element in 0..mesh.cells.len() {
                    let deformations = law.deformation(element, &x);
                    for (f, rotation) in deformations.iter().zip(tets.rotations(element)) {
                        let svd = svd::svd(f);
                        let gap = (svd.s[1] + svd.s[2]) / svd.s[0];
                        let found = (rotation - svd.u * svd.v.transpose()).amax();
                        // The error is the rounding of F, a few 1e-15, over the gap that decides the rotation.
                        assert!(found < 2e-14 / gap, "{case}: {found:e}, gap {gap:e}");
                    }
                }
            }
        }
        assert!(inverted > 100, "{inverted}");
    }
}

#[test]
fn a_turned_body_has_no_forces() {
    for (name, mesh) in meshes() {
        let mut tets = QuadraticTets::<f64>::new(&list(&mesh));
        for angle in [0.1, 1.0, 3.1] {
            let (force, energy) = forces(&mut tets, &displaced(&mesh, angle, 0.0, 0));
            // The moduli are 1e5 Pa, the areas 0.1 m^2, and the strain is rounding, a few 1e-16.
            let largest = common::largest(force.into_iter());
            assert!(largest < 1e-10, "{name}: {largest:e}");
            assert!(energy.abs() < 1e-20, "{name}: {energy:e}");
        }
    }
}

/// The product from the deformation gradients of `fem` and the law alone: `dP = R (2 mu sym(R^T dF) + lambda tr(R^T
/// dF))`.
#[test]
fn the_product_is_that_of_the_warped_stiffness() {
    for mesh in [block([1, 1, 1], 0.0, true), curved(cube(1, 0.0, true), 1.0)] {
        let (law, list, count) = (law(&mesh), list(&mesh), mesh.positions.len());
        let mut tets = QuadraticTets::<f64>::new(&list);
        let d = displaced(&mesh, 1.0, 0.1, 4);
        let x = moved(&mesh, &d);
        forces(&mut tets, &d);
        let u = field(count, &mut Random(8));
        let stresses: Vec<[Mat3; 4]> = (0..mesh.cells.len())
            .map(|element| {
                let (now, change) = (law.deformation(element, &x), law.deformation(element, &u));
                let tet = &list[element];
                core::array::from_fn(|q| {
                    let svd = svd::svd(&now[q]);
                    let r = svd.u * svd.v.transpose();
                    let turned = r.transpose() * change[q];
                    let strain = (turned + turned.transpose()) * 0.5;
                    let pressure = tet.lambda * strain.trace();
                    let stress = strain * (2.0 * tet.mu) + Mat3::from_diagonal_element(pressure);
                    r * stress * tet.volumes[q]
                })
            })
            .collect();
        let expected: Vec<Vec3> = (0..count)
            .map(|node| {
                Vec3::from_fn(|axis, _| {
                    // This number is the work of a unit displacement.
                    let mut unit = vec![Vec3::zeros(); count];
                    unit[node][axis] = 1.0;
                    let work = |element: usize| -> f64 {
                        let change = law.deformation(element, &unit);
                        (0..4).map(|q| stresses[element][q].dot(&change[q])).sum()
                    };
                    (0..mesh.cells.len()).map(work).sum()
                })
            })
            .collect();
        let found = difference(&product(&tets, &u), &expected);
        // The rotations are known to 1e-14, and the sums have 100 terms.
        assert!(found < 1e-13, "{found:e}");
    }
}

#[test]
fn the_stiffness_is_symmetric_and_positive_and_has_rigid_motions_for_its_kernel() {
    for (name, mesh) in meshes() {
        let count = mesh.positions.len();
        let mut tets = QuadraticTets::<f64>::new(&list(&mesh));
        forces(&mut tets, &displaced(&mesh, 1.2, 0.05, 5));
        let mut random = Random(9);
        let (mut least, mut largest) = (f64::MAX, 0.0_f64);
        for _ in 0..20 {
            let (u, v) = (field(count, &mut random), field(count, &mut random));
            let (ku, kv) = (product(&tets, &u), product(&tets, &v));
            let (uku, vku, ukv) = (dot(&u, &ku), dot(&v, &ku), dot(&u, &kv));
            // The sum has 1000 products.
            assert!((vku - ukv).abs() < 1e-13 * uku, "{name}: {vku} {ukv}");
            least = least.min(uku);
            largest = largest.max(uku);
        }
        assert!(least > 0.1 * largest, "{least} {largest}");
        let shift = vec![Vec3::new(1.0, 2.0, -3.0); count];
        assert!(common::largest(product(&tets, &shift).into_iter()) == 0.0);

        // Turns are in the kernel if all points have the rotation of the body.
        let d = displaced(&mesh, 0.7, 0.0, 0);
        forces(&mut tets, &d);
        let axis = Vec3::new(0.3, 0.2, -1.0);
        let turn: Vec<Vec3> = moved(&mesh, &d).iter().map(|x| axis.cross(x)).collect();
        let size = |u: &[Vec3]| common::largest(product(&tets, u).into_iter());
        let found = size(&turn) / size(&field(count, &mut random));
        // The terms cancel. They are up to 10 times as large as the result for another field, and they round.
        assert!(found < 1e-14, "{name}: {found:e}");
    }
}

#[test]
fn the_stiffness_at_rest_is_the_derivative_of_the_forces_and_that_of_its_blocks() {
    for (name, mesh) in meshes() {
        let count = mesh.positions.len();
        let mut tets = QuadraticTets::<f64>::new(&list(&mesh));
        let u = field(count, &mut Random(2));
        let ku = product(&tets, &u);
        let step = 1e-6;
        let scaled = |factor: f64| u.iter().map(|u| u * factor).collect::<Vec<_>>();
        let (ahead, _) = forces(&mut tets, &scaled(step));
        let (behind, _) = forces(&mut tets, &scaled(-step));
        let both = ahead.iter().zip(&behind);
        let slope: Vec<Vec3> = both.map(|(a, b)| (b - a) / (2.0 * step)).collect();
        let found = difference(&slope, &ku);
        // The error is the third derivative times a squared strain of 1e-5, plus rounding: 1e-16 over 1e-5.
        assert!(found < 1e-9, "{name}: {found:e}");

        // The body is turned and strained, block by block.
        forces(&mut tets, &displaced(&mesh, 1.0, 0.03, 1));
        let mut sum = vec![Vec3::zeros(); count];
        for element in 0..mesh.cells.len() {
            let (nodes, blocks) = (cells(&mesh)[element], tets.stiffness(element));
            for a in 0..10 {
                for b in 0..10 {
                    let off = blocks[a][b] - blocks[b][a].transpose();
                    assert!(off.amax() <= 1e-12 * blocks[9][9].amax());
                    sum[nodes[a] as usize] += blocks[a][b] * u[nodes[b] as usize];
                }
            }
        }
        let found = difference(&product(&tets, &u), &sum);
        // The sums have 1000 terms in two orders.
        assert!(found < 1e-13, "{name}: {found:e}");
    }
}

#[test]
fn in_a_fixed_frame_the_law_is_linear() {
    for (name, mesh) in meshes() {
        let mut body = body(&mesh, SolidLaw::Linear);
        let mut tets = QuadraticTets::<f64>::new(&list(&mesh)).in_frame(Frame::Fixed);
        for (angle, fraction) in [(0.0, 1e-4), (1.0, 0.0), (2.0, 0.3)] {
            let d = displaced(&mesh, angle, fraction, 1);
            body.set_positions(&moved(&mesh, &d)).unwrap();
            body.assemble();
            let expected: Vec<Vec3> = body.internal_forces().collect();
            let (force, energy) = forces(&mut tets, &d);
            // The error is the rounding of F, a few 1e-16, over a strain of at least 1e-4.
            let found = difference(&force, &expected);
            assert!(found < 1e-11, "{name}, {fraction}: {found:e}");
            let reference = body.elastic_energy();
            let found = (energy - reference).abs() / reference;
            assert!(found < 1e-11, "{name}, {fraction}: {found:e}");
            // The forces are minus the product, and the kernel searched for no rotation.
            let minus: Vec<Vec3> = product(&tets, &d).iter().map(|f| -f).collect();
            assert_eq!(force, minus);
            assert_eq!(tets.rotations(0), [Mat3::identity(); 4]);
        }
    }
}

#[test]
fn single_precision_agrees_to_its_digits() {
    for (name, mesh) in meshes() {
        let mut double = QuadraticTets::<f64>::new(&list(&mesh));
        let mut single = QuadraticTets::<f32>::new(&list(&mesh));
        // The tolerance is that of linear elements, but the gradients are several times as large.
        let small = 5e-6;
        for (angle, fraction, bound) in [
            (0.0, 1e-4, small),
            (0.0, 1e-2, small),
            (1.0, 0.1, small),
            (1.0, 1e-3, 5e-4),
            (2.5, 1e-3, 5e-4),
        ] {
            let d = displaced(&mesh, angle, fraction, 6);
            let (expected, reference) = forces(&mut double, &d);
            let (force, energy) = forces(&mut single, &d);
            let case = format!("{name}, angle {angle}, fraction {fraction}");
            let found = difference(&force, &expected);
            assert!(found < bound, "{case}: forces {found:e}");
            let found = (energy - reference).abs() / reference;
            assert!(found < bound, "{case}: energy {found:e}");
            let found = difference(&product(&single, &d), &product(&double, &d));
            assert!(found < bound, "{case}: product {found:e}");
        }
    }
}

#[test]
fn a_warm_start_and_a_cold_start_give_the_same_rotations() {
    let mesh = curved(cube(2, 0.2, true), 2.0);
    let mut warm = QuadraticTets::<f64>::new(&list(&mesh));
    for step in 0..40 {
        let d = displaced(&mesh, 0.1 * f64::from(step), 0.05, 8);
        let (from_last, _) = forces(&mut warm, &d);
        let (from_rest, _) = forces(&mut QuadraticTets::<f64>::new(&list(&mesh)), &d);
        // The rotations are found to 1e-13 if the gap of the stretches is 0.02, and no rotation drifts.
        let found = difference(&from_last, &from_rest);
        assert!(found < 1e-12, "step {step}: {found:e}");
    }
}

#[test]
fn any_number_of_elements_fills_its_blocks() {
    let mesh = curved(block([2, 1, 3], 0.2, true), 3.0);
    let all = list(&mesh);
    // The mesh has 36 elements: one full block and four elements.
    for count in [1, 2, 31, 32, 33, all.len()] {
        let some = &all[..count];
        let mut tets = QuadraticTets::<f64>::new(some);
        let d = displaced(&mesh, 0.4, 0.05, 1);
        let (force, energy) = forces(&mut tets, &d);
        let ku = product(&tets, &d);
        // The elements are evaluated one by one.
        let mut sum = vec![Vec3::zeros(); d.len()];
        let (mut products, mut total) = (sum.clone(), 0.0);
        for &tet in some {
            let mut single = QuadraticTets::<f64>::new(&[tet]);
            let (force, energy) = forces(&mut single, &d);
            sum.iter_mut().zip(force).for_each(|(sum, f)| *sum += f);
            let ku = product(&single, &d);
            products.iter_mut().zip(ku).for_each(|(sum, f)| *sum += f);
            total += energy;
        }
        // The sums have another order.
        assert!(difference(&force, &sum) < 1e-14, "{count}");
        assert!(difference(&ku, &products) < 1e-14, "{count}");
        assert!((energy - total).abs() < 1e-14 * total, "{count}");
    }
    let mut none = QuadraticTets::<f32>::new(&[]);
    assert!(none.linearize(&[], &mut []) == 0.0);
}

#[test]
fn bad_numbers_come_out_as_they_are_and_are_forgotten() {
    let mesh = cube(2, 0.2, true);
    let mut tets = QuadraticTets::<f64>::new(&list(&mesh));
    let d = displaced(&mesh, 0.3, 0.05, 1);
    let (expected, _) = forces(&mut tets, &d);
    for bad in [f64::NAN, f64::INFINITY, 1e200, -1e-320] {
        let mut worse = d.clone();
        worse[0].x = bad;
        forces(&mut tets, &worse);
        forces(&mut tets, &vec![Vec3::repeat(bad); d.len()]);
        let found = difference(&forces(&mut tets, &d).0, &expected);
        assert!(found < 1e-13, "{bad}: {found:e}");
    }
    // Elements that are crushed to a point, crushed to a line or turned inside out give finite numbers.
    for squash in [0.0, -1.0] {
        for keep in [0.0, 1.0] {
            let crush = |x: &Vec3| Vec3::new(x.x * keep, x.y * squash, x.z * squash) - x;
            let d: Vec<Vec3> = mesh.positions.iter().map(crush).collect();
            let (force, energy) = forces(&mut tets, &d);
            assert!(energy.is_finite() && force.iter().all(|f| f.iter().all(|c| c.is_finite())));
        }
    }
}

fn hashes<T: Real>() -> [u64; 2] {
    let mesh = cube(2, 0.2, true);
    let mut tets = QuadraticTets::<T>::new(&list(&mesh));
    let d = displaced(&mesh, 1.0, 0.05, 1);
    let (force, _) = forces(&mut tets, &d);
    [hash(&force), hash(&product(&tets, &d))]
}

#[test]
fn bytes_do_not_depend_on_the_width_of_vectors() {
    // These hashes were recorded with vectors of 512 bits, and reproduced with 256 and 128. They change if the
    // arithmetic changes.
    let recorded = [
        [13_371_203_822_940_903_211, 14_155_941_559_127_313_246],
        [10_191_363_930_477_554_124, 18_398_915_991_308_564_296],
    ];
    assert_eq!([hashes::<f64>(), hashes::<f32>()], recorded);
}
