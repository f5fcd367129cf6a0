//! Linear tetrahedra in blocks against the exact form, and the properties of the stiffness.

use common::kernels::{cells, difference, dot, hash, materials, nodes, tets, vectors, zeros};
use common::{Random, block, cube};
use physics::element::tet::hooke::Tets;
use physics::element::tet::shape::Tet4;
use physics::element::tet::solid::Solid;
use physics::lanes::block::LANES;
use physics::material::law::{Corotational, Frame};
use physics::mesh::TetMesh;
use physics::polar::svd;
use physics::{Body, BodyConfig, Mat3, Real, SolidLaw, Vec3};

fn solid(mesh: &TetMesh, law: SolidLaw) -> Body {
    let config = BodyConfig {
        gravity: Vec3::zeros(),
        ..BodyConfig::default()
    };
    let materials = materials(mesh.cells.len());
    Body::solid(mesh, &materials, law, config, &[]).unwrap()
}

/// The body, turned by `angle` about an oblique axis, with every vertex moved by up to `fraction` of the mesh.
fn displaced(mesh: &TetMesh, angle: f64, fraction: f64, seed: u64) -> Vec<Vec3> {
    let mut random = Random(seed);
    let axis = nalgebra::Unit::new_normalize(Vec3::new(1.0, -2.0, 0.5));
    let turn = nalgebra::Rotation3::from_axis_angle(&axis, angle);
    let moved = |x: &Vec3| turn * x - x + random.vector() * fraction;
    mesh.positions.iter().map(moved).collect()
}

fn forces<T: Real>(tets: &mut Tets<T>, d: &[Vec3]) -> (Vec<Vec3>, f64) {
    let mut force = zeros(d.len());
    let energy = tets.linearize(&nodes(d), &mut force);
    (vectors(&force), energy.to_f64())
}

fn product<T: Real>(tets: &Tets<T>, u: &[Vec3]) -> Vec<Vec3> {
    let mut y = zeros(u.len());
    tets.product(T::of(1.0), &nodes(u), &mut y);
    vectors(&y)
}

#[test]
fn forces_energy_and_rotations_are_those_of_the_body() {
    let mesh = cube(4, 0.2, false);
    let mut body = solid(&mesh, SolidLaw::Corotational);
    let list = materials(mesh.cells.len());
    let law = Solid::<4, 1, Tet4, _>::new(Corotational, &mesh.positions, cells(&mesh), &list);
    let law = law.unwrap();
    let mut inverted = 0;
    for (seed, fraction) in [0.0, 1e-4, 0.02, 0.1, 0.3].into_iter().enumerate() {
        // Each case starts from the rotations of the previous case, which are far away.
        let mut tets = Tets::<f64>::new(&tets(&mesh));
        for angle in [0.0, 0.01, 1.0, 2.0, 3.0] {
            if fraction == 0.0 && angle == 0.0 {
                continue;
            }
            let d = displaced(&mesh, angle, fraction, seed as u64);
            let x: Vec<Vec3> = mesh.positions.iter().zip(&d).map(|(x, d)| x + d).collect();
            body.set_positions(&x).unwrap();
            body.assemble();
            inverted += body.inverted_count();
            let expected: Vec<Vec3> = body.internal_forces().collect();
            let (force, energy) = forces(&mut tets, &d);
            let case = format!("angle {angle}, fraction {fraction}");
            if fraction > 0.0 {
                // The rounding of F gives a stress of 1e-15 of the moduli. With the rounding of the rotation and a
                // strain of at least 1e-4, the error is 1e-11 of the force. Elements near the line where the rotation
                // jumps (stretches s2 + s3 = 1e-3) enlarge 1e-15 to 1e-12.
                let bound = if fraction < 1e-2 { 1e-10 } else { 1e-12 };
                let found = difference(&force, &expected);
                assert!(found < bound, "{case}: forces {found:e}");
                let reference = body.elastic_energy();
                let found = (energy - reference).abs() / reference;
                assert!(found < bound, "{case}: energy {found:e}");
            }
            for element in 0..mesh.cells.len() {
                let svd = svd::svd(&law.deformation(element, &x)[0]);
                let gap = (svd.s[1] + svd.s[2]) / svd.s[0];
                let found = (tets.rotations(element)[0] - svd.u * svd.v.transpose()).amax();
                // The error is the rounding of F, 1e-15, over the gap that decides the rotation.
                assert!(
                    found < 5e-15 / gap,
                    "{case}: rotation {found:e}, gap {gap:e}"
                );
            }
        }
    }
    assert!(inverted > 500, "{inverted}");
}

#[test]
fn a_turned_body_has_no_forces() {
    let mesh = cube(3, 0.2, false);
    let mut tets = Tets::<f64>::new(&tets(&mesh));
    for angle in [0.1, 1.0, 3.1] {
        let (force, energy) = forces(&mut tets, &displaced(&mesh, angle, 0.0, 0));
        // The moduli are 1e5 Pa, the areas 0.1 m^2, and the strain is rounding, a few 1e-16.
        let largest = common::largest(force.into_iter());
        assert!(largest < 1e-10, "{largest:e}");
        assert!(energy.abs() < 1e-20, "{energy:e}");
    }
}

#[test]
fn the_stiffness_is_symmetric_and_positive_and_has_rigid_motions_for_its_kernel() {
    let mesh = cube(3, 0.2, false);
    let count = mesh.positions.len();
    let mut tets = Tets::<f64>::new(&tets(&mesh));
    forces(&mut tets, &displaced(&mesh, 1.2, 0.1, 5));
    let mut random = Random(9);
    let mut field = || (0..count).map(|_| random.vector()).collect::<Vec<_>>();
    let (mut least, mut largest) = (f64::MAX, 0.0_f64);
    for _ in 0..20 {
        let (u, v) = (field(), field());
        let (ku, kv) = (product(&tets, &u), product(&tets, &v));
        let (uku, vku, ukv) = (dot(&u, &ku), dot(&v, &ku), dot(&u, &kv));
        // The sum has 200 products.
        assert!((vku - ukv).abs() < 1e-13 * uku, "{vku} {ukv}");
        least = least.min(uku);
        largest = largest.max(uku);
    }
    assert!(least > 0.1 * largest, "{least} {largest}");
    let shift = vec![Vec3::new(1.0, 2.0, -3.0); count];
    assert!(common::largest(product(&tets, &shift).into_iter()) == 0.0);

    // Turns are in the kernel if all elements have the rotation of the body.
    let angle = 0.7;
    forces(&mut tets, &displaced(&mesh, angle, 0.0, 0));
    let d = displaced(&mesh, angle, 0.0, 0);
    let axis = Vec3::new(0.3, 0.2, -1.0);
    let turn = mesh
        .positions
        .iter()
        .zip(&d)
        .map(|(x, d)| axis.cross(&(x + d)));
    let size = |u: &[Vec3]| common::largest(product(&tets, u).into_iter());
    let found = size(&turn.collect::<Vec<_>>()) / size(&field());
    // The terms cancel. They are up to 10 times as large as the result for another field, and they round.
    assert!(found < 1e-14, "{found:e}");
}

#[test]
fn the_stiffness_at_rest_is_the_derivative_of_the_forces_and_that_of_its_blocks() {
    let mesh = cube(3, 0.2, false);
    let count = mesh.positions.len();
    let mut tets = Tets::<f64>::new(&tets(&mesh));
    let mut random = Random(2);
    let u: Vec<Vec3> = (0..count).map(|_| random.vector()).collect();
    let ku = product(&tets, &u);
    let step = 1e-6;
    let scaled = |factor: f64| u.iter().map(|u| u * factor).collect::<Vec<_>>();
    let (ahead, _) = forces(&mut tets, &scaled(step));
    let (behind, _) = forces(&mut tets, &scaled(-step));
    let slope: Vec<Vec3> = ahead
        .iter()
        .zip(&behind)
        .map(|(a, b)| (b - a) / (2.0 * step))
        .collect();
    let found = difference(&slope, &ku);
    // The error is the third derivative times a squared strain of 1e-5, plus rounding: 1e-16 over 1e-5.
    assert!(found < 1e-9, "{found:e}");

    // The body is turned and strained, block by block.
    forces(&mut tets, &displaced(&mesh, 1.0, 0.05, 1));
    let mut sum = vec![Vec3::zeros(); count];
    for element in 0..mesh.cells.len() {
        let (nodes, blocks) = (cells(&mesh)[element], tets.stiffness(element));
        for a in 0..4 {
            for b in 0..4 {
                assert!(
                    (blocks[a][b] - blocks[b][a].transpose()).amax() <= 1e-12 * blocks[a][a].amax()
                );
                sum[nodes[a] as usize] += blocks[a][b] * u[nodes[b] as usize];
            }
        }
    }
    let found = difference(&product(&tets, &u), &sum);
    // The sums have 100 terms in two orders.
    assert!(found < 1e-13, "{found:e}");
}

#[test]
fn in_a_fixed_frame_the_law_is_linear() {
    let mesh = cube(3, 0.2, false);
    let mut body = solid(&mesh, SolidLaw::Linear);
    let mut tets = Tets::<f64>::new(&tets(&mesh)).in_frame(Frame::Fixed);
    for (angle, fraction) in [(0.0, 1e-4), (1.0, 0.0), (2.0, 0.3)] {
        let d = displaced(&mesh, angle, fraction, 1);
        let x: Vec<Vec3> = mesh.positions.iter().zip(&d).map(|(x, d)| x + d).collect();
        body.set_positions(&x).unwrap();
        body.assemble();
        let expected: Vec<Vec3> = body.internal_forces().collect();
        let (force, energy) = forces(&mut tets, &d);
        // The error is the rounding of F, 1e-16, over a strain of at least 1e-4.
        let found = difference(&force, &expected);
        assert!(found < 1e-11, "{fraction}: {found:e}");
        let reference = body.elastic_energy();
        let found = (energy - reference).abs() / reference;
        assert!(found < 1e-11, "{fraction}: {found:e}");
        // The forces are minus the product, and the kernel searched for no rotation.
        let minus: Vec<Vec3> = product(&tets, &d).iter().map(|f| -f).collect();
        assert_eq!(force, minus);
        assert_eq!(tets.rotations(0), [Mat3::identity()]);
    }
}

#[test]
fn single_precision_agrees_to_its_digits() {
    let mesh = cube(4, 0.2, false);
    let (mut double, mut single) = (
        Tets::<f64>::new(&tets(&mesh)),
        Tets::<f32>::new(&tets(&mesh)),
    );
    // Small strains without a rotation keep their digits. With a rotation, `R^T F - I` has an error of about 2e-7. The
    // relative error of the force is that error over the strain, here about 5 times the fraction.
    let small = 2e-6;
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
        let case = format!("angle {angle}, fraction {fraction}");
        let found = difference(&force, &expected);
        assert!(found < bound, "{case}: forces {found:e}");
        let found = (energy - reference).abs() / reference;
        assert!(found < bound, "{case}: energy {found:e}");
        let found = difference(&product(&single, &d), &product(&double, &d));
        assert!(found < bound, "{case}: product {found:e}");
    }
}

#[test]
fn a_warm_start_and_a_cold_start_give_the_same_rotations() {
    let mesh = cube(3, 0.2, false);
    let mut warm = Tets::<f64>::new(&tets(&mesh));
    for step in 0..40 {
        let d = displaced(&mesh, 0.1 * f64::from(step), 0.15, 8);
        let (from_last, _) = forces(&mut warm, &d);
        let (from_rest, _) = forces(&mut Tets::<f64>::new(&tets(&mesh)), &d);
        // The rotations are found to 1e-13 if the gap of the stretches is 0.02, and no rotation drifts.
        let found = difference(&from_last, &from_rest);
        assert!(found < 1e-12, "step {step}: {found:e}");
    }
}

#[test]
fn any_number_of_elements_fills_its_blocks() {
    for n in [[1, 1, 1], [1, 1, 5], [2, 1, 3], [2, 4, 4]] {
        let mesh = block(n, 0.2, false);
        let all = tets(&mesh);
        for count in [1, 2, all.len() - 1, all.len()] {
            let some = &all[..count];
            let mut tets = Tets::<f64>::new(some);
            let d = displaced(&mesh, 0.4, 0.1, 1);
            let (force, energy) = forces(&mut tets, &d);
            let ku = product(&tets, &d);
            // The elements are evaluated one by one.
            let (mut sum, mut products, mut total) = (d.clone(), d.clone(), 0.0);
            sum.fill(Vec3::zeros());
            products.fill(Vec3::zeros());
            for &tet in some {
                let mut single = Tets::<f64>::new(&[tet]);
                let (force, energy) = forces(&mut single, &d);
                sum.iter_mut().zip(force).for_each(|(sum, f)| *sum += f);
                let ku = product(&single, &d);
                products.iter_mut().zip(ku).for_each(|(sum, f)| *sum += f);
                total += energy;
            }
            // The sums have another order.
            assert!(difference(&force, &sum) < 1e-14, "{n:?} {count}");
            assert!(difference(&ku, &products) < 1e-14, "{n:?} {count}");
            assert!((energy - total).abs() < 1e-14 * total, "{n:?} {count}");
        }
    }
    assert!(
        tets(&block([2, 4, 4], 0.0, false))
            .len()
            .is_multiple_of(LANES)
    );
    let mut none = Tets::<f32>::new(&[]);
    assert!(none.linearize(&[], &mut []) == 0.0);
}

#[test]
fn bad_numbers_come_out_as_they_are_and_are_forgotten() {
    let mesh = cube(2, 0.2, false);
    let mut tets = Tets::<f64>::new(&tets(&mesh));
    let d = displaced(&mesh, 0.3, 0.1, 1);
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
    let mesh = cube(3, 0.2, false);
    let mut tets = Tets::<T>::new(&tets(&mesh));
    let d = displaced(&mesh, 1.0, 0.1, 1);
    let (force, _) = forces(&mut tets, &d);
    // A second call takes one more Newton iteration for each rotation.
    forces(&mut tets, &d);
    [hash(&force), hash(&product(&tets, &d))]
}

#[test]
fn bytes_do_not_depend_on_the_width_of_vectors() {
    // These hashes were recorded with vectors of 128 bits, and reproduced with 256 and 512. They change if the
    // arithmetic changes.
    let recorded = [
        [6_982_058_669_032_132_808, 17_004_073_737_035_744_235],
        [10_684_530_719_341_219_140, 9_012_960_100_648_045_529],
    ];
    assert_eq!([hashes::<f64>(), hashes::<f32>()], recorded);
}
