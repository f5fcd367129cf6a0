//! Triangles in blocks against `membrane`: forces, energy and the blocks of the tangent.

use common::kernels::{difference, dot, hash, nodes, vectors, zeros};
use common::{Random, Split, grid, irregular, rubber};
use nalgebra::{Rotation3, Unit};
use physics::element::VectorForm;
use physics::element::triangle::membrane::Membrane;
use physics::element::triangle::triangles::{Triangle, Triangles};
use physics::lanes::block::LANES;
use physics::mesh::TriMesh;
use physics::{Elements, Real, Tangent, Vec3};

/// An irregular sheet in an oblique plane, so that every component matters.
fn mesh() -> TriMesh {
    let mut mesh = irregular(9, 5, 0.9, 0.5, 0.25, 3);
    let axis = Unit::new_normalize(Vec3::new(0.3, -1.0, 0.4));
    let tilt = Rotation3::from_axis_angle(&axis, 0.8);
    for x in &mut mesh.positions {
        *x = tilt * *x + Vec3::new(0.2, -0.1, 0.5);
    }
    mesh
}

fn membrane(mesh: &TriMesh) -> Membrane {
    // Two materials alternate.
    let material = |triangle: usize| {
        rubber(if triangle.is_multiple_of(2) {
            0.4
        } else {
            -0.2
        })
    };
    let materials: Vec<_> = (0..mesh.triangles.len()).map(material).collect();
    Membrane::new(mesh, &materials).unwrap()
}

fn list(mesh: &TriMesh) -> Vec<Triangle> {
    match membrane(mesh).vector_form() {
        Some(VectorForm::CorotationalTriangles(triangles)) => triangles,
        other => panic!("no triangles: {other:?}"),
    }
}

fn triangles<T: Real>(mesh: &TriMesh) -> Triangles<T> {
    Triangles::new(&list(mesh))
}

/// The sheet, stretched by `stretch` along the axes of its plane and turned by `angle` about an oblique axis, with
/// every vertex moved by up to `fraction`.
fn displaced(mesh: &TriMesh, stretch: [f64; 3], angle: f64, fraction: f64, seed: u64) -> Vec<Vec3> {
    let mut random = Random(seed);
    let axis = Unit::new_normalize(Vec3::new(1.0, -2.0, 0.5));
    let turn = Rotation3::from_axis_angle(&axis, angle);
    let stretch = Vec3::from(stretch);
    let moved = |x: &Vec3| turn * x.component_mul(&stretch) - x + random.vector() * fraction;
    mesh.positions.iter().map(moved).collect()
}

fn moved(mesh: &TriMesh, d: &[Vec3]) -> Vec<Vec3> {
    mesh.positions.iter().zip(d).map(|(x, d)| x + d).collect()
}

fn linearize<T: Real>(triangles: &mut Triangles<T>, d: &[Vec3]) -> (Vec<Vec3>, f64) {
    let mut force = zeros(d.len());
    let energy = triangles.linearize(&nodes(d), &mut force);
    (vectors(&force), energy.to_f64())
}

fn product<T: Real>(triangles: &Triangles<T>, factor: f64, u: &[Vec3]) -> Vec<Vec3> {
    let mut y = zeros(u.len());
    triangles.product(T::of(factor), &nodes(u), &mut y);
    vectors(&y)
}

/// The largest difference of forces, energy and tangent blocks, each as a fraction of the largest value.
fn compare<T: Real>(mesh: &TriMesh, d: &[Vec3]) -> [f64; 3] {
    let membrane = membrane(mesh);
    let mut triangles = triangles::<T>(mesh);
    let x = moved(mesh, d);
    let (force, energy) = linearize(&mut triangles, d);
    let mut expected = vec![Vec3::zeros(); d.len()];
    let (mut off, mut largest) = (0.0_f64, 0.0_f64);
    for e in 0..membrane.count() {
        let element = membrane.element(e, &x, Tangent::Clipped);
        let blocks = triangles.stiffness(e);
        assert_eq!(triangles.nodes(e), mesh.triangles[e]);
        for a in 0..3 {
            expected[mesh.triangles[e][a] as usize] += element.force[a];
            for b in 0..3 {
                off = off.max((blocks[a][b] - element.stiffness[a][b]).amax());
                largest = largest.max(element.stiffness[a][b].amax());
            }
        }
    }
    let reference = membrane.energy(&x);
    [
        difference(&force, &expected),
        (energy - reference).abs() / reference,
        off / largest,
    ]
}

const UNSTRETCHED: [f64; 3] = [1.0; 3];

#[test]
fn forces_energy_and_tangent_are_those_of_the_membrane() {
    let mesh = mesh();
    let mut seed = 0;
    for stretch in [
        UNSTRETCHED,
        [1.5, 1.4, 1.3],
        [0.6, 0.7, 0.5],
        [0.02, 0.03, 0.02],
        [0.005, 0.004, 0.003],
        [20.0, 10.0, 0.1],
    ] {
        for angle in [0.0, 0.01, 1.0, 3.1] {
            // The edges are 0.1 m long. The strains are a hundredth and a third, and the last sheet is crumpled.
            for fraction in [1e-3, 0.03, 0.3] {
                seed += 1;
                let d = displaced(&mesh, stretch, angle, fraction, seed);
                let [force, energy, tangent] = compare::<f64>(&mesh, &d);
                let case = format!("{stretch:?} {angle} {fraction}");
                // Strains are known to some 1e-16 of the largest stretch, which is 1e-14 of the smallest stretch here.
                assert!(force < 1e-12, "{case}: forces {force:e}");
                assert!(energy < 1e-12, "{case}: energy {energy:e}");
                assert!(tangent < 1e-12, "{case}: tangent {tangent:e}");
            }
        }
    }
}

/// The kernel computes small strains from displacements, so the rest positions cost no digits.
#[test]
fn small_strains_keep_their_digits() {
    let mesh = mesh();
    let count = mesh.positions.len();
    let mut triangles = triangles::<f64>(&mesh);
    let still = displaced(&mesh, UNSTRETCHED, 0.0, 0.0, 0);
    linearize(&mut triangles, &still);
    let mut random = Random(8);
    let u: Vec<Vec3> = (0..count).map(|_| random.vector()).collect();
    let linear = product(&triangles, -1.0, &u);
    for size in [1e-9, 1e-12, 1e-30] {
        let d: Vec<Vec3> = u.iter().map(|u| u * size).collect();
        let (force, energy) = linearize(&mut triangles, &d);
        let expected: Vec<Vec3> = linear.iter().map(|f| f * size).collect();
        // The error is the next term of the series, at strains 10 times as large, plus rounding.
        let bound = 100.0 * size + 1e-13;
        let found = difference(&force, &expected);
        assert!(found < bound, "{size:e}: {found:e}");
        let reference = -0.5 * dot(&linear, &u) * size * size;
        let found = (energy - reference).abs() / reference;
        assert!(found < bound, "{size:e}: energy {found:e}");
    }
}

#[test]
fn a_turned_sheet_has_no_forces() {
    let mesh = mesh();
    let mut triangles = triangles::<f64>(&mesh);
    for angle in [0.1, 1.0, 3.1] {
        let d = displaced(&mesh, UNSTRETCHED, angle, 0.0, 0);
        let (force, energy) = linearize(&mut triangles, &d);
        // The force is 1e3 N/m times edges of 0.1 m times a strain of rounding, some 1e-15, from six triangles.
        let largest = common::largest(force.into_iter());
        assert!(largest < 5e-12, "{largest:e}");
        assert!(energy < 1e-25, "{energy:e}");
    }
}

#[test]
fn the_product_is_that_of_the_blocks() {
    let mesh = mesh();
    let count = mesh.positions.len();
    let mut triangles = triangles::<f64>(&mesh);
    let mut random = Random(2);
    let u: Vec<Vec3> = (0..count).map(|_| random.vector()).collect();
    assert_eq!(product(&triangles, 1.0, &u), vec![Vec3::zeros(); count]);
    linearize(
        &mut triangles,
        &displaced(&mesh, [1.2, 0.9, 1.0], 1.0, 0.1, 1),
    );
    let factor = 0.37;
    let mut sum = vec![Vec3::zeros(); count];
    for element in 0..triangles.count() {
        let (nodes, blocks) = (triangles.nodes(element), triangles.stiffness(element));
        for a in 0..3 {
            for b in 0..3 {
                let symmetric = (blocks[a][b] - blocks[b][a].transpose()).amax();
                assert!(symmetric <= 1e-12 * blocks[a][a].amax());
                sum[nodes[a] as usize] += blocks[a][b] * u[nodes[b] as usize] * factor;
            }
        }
    }
    let found = difference(&product(&triangles, factor, &u), &sum);
    // The sums have some 50 terms in two orders.
    assert!(found < 1e-13, "{found:e}");
    let shift = vec![Vec3::new(1.0, 2.0, -3.0); count];
    let pushed = product(&triangles, 1.0, &shift);
    assert_eq!(common::largest(pushed.into_iter()), 0.0);
}

#[test]
fn the_tangent_is_positive() {
    let mesh = mesh();
    let mut triangles = triangles::<f64>(&mesh);
    for (seed, stretch) in [UNSTRETCHED, [0.3; 3], [2.0, 0.1, 1.0], [0.0; 3]]
        .into_iter()
        .enumerate()
    {
        let d = displaced(&mesh, stretch, 0.4, 0.05, seed as u64);
        linearize(&mut triangles, &d);
        for element in 0..triangles.count() {
            let blocks = triangles.stiffness(element);
            let whole = nalgebra::SMatrix::<f64, 9, 9>::from_fn(|i, j| {
                blocks[i / 3][j / 3][(i % 3, j % 3)]
            });
            let values = whole.symmetric_eigenvalues();
            // The tolerance is the rounding of the largest eigenvalue.
            assert!(values.min() > -1e-13 * values.max(), "{stretch:?} {values}");
        }
    }
}

#[test]
fn single_precision_agrees_to_its_digits() {
    let mesh = mesh();
    // Strains that are not small against the rotation lose only the last digits. With a rotation, `C - I` has an error
    // of about 2e-7. The relative error of the force is that error over the strain, here about 20 times the fraction.
    let small = 4e-6;
    for (stretch, angle, fraction, bound) in [
        (UNSTRETCHED, 0.0, 1e-6, small),
        (UNSTRETCHED, 0.0, 1e-4, small),
        (UNSTRETCHED, 0.0, 1e-2, small),
        (UNSTRETCHED, 1.0, 0.05, small),
        ([0.5, 0.6, 0.7], 0.5, 0.03, small),
        ([2.0, 1.5, 1.7], 2.0, 0.03, small),
        (UNSTRETCHED, 1.0, 1e-3, 1e-4),
        (UNSTRETCHED, 2.5, 1e-3, 1e-4),
    ] {
        // Single precision represents these displacements exactly.
        let d: Vec<Vec3> = displaced(&mesh, stretch, angle, fraction, 6)
            .iter()
            .map(|d| d.map(|c| f64::from(c as f32)))
            .collect();
        let found = compare::<f32>(&mesh, &d);
        let case = format!("{stretch:?} {angle} {fraction}");
        assert!(found.iter().all(|&off| off < bound), "{case}: {found:?}");
    }
}

/// A triangle that is collapsed to a line has a normal by the convention of the membrane, unless rounding decides
/// between two normals. Rounding decides along an axis, by symmetry, and in a point.
#[test]
fn collapsed_triangles_stay_finite() {
    let (crooked, even) = (mesh(), grid(6, 3, 0.6, 0.3, Split::Alternating));
    let line = |mesh: &TriMesh| -> Vec<Vec3> {
        let positions = mesh.positions.iter();
        positions
            .map(|x| Vec3::new(1.0, -2.0, 0.5) * x.x - x)
            .collect()
    };
    for (mesh, d, unique) in [
        (&crooked, line(&crooked), true),
        (&even, line(&even), false),
        (&even, displaced(&even, [1.0, 0.0, 0.0], 0.0, 0.0, 0), false),
        (&even, displaced(&even, [0.0; 3], 0.0, 0.0, 0), false),
    ] {
        let [force, energy, tangent] = compare::<f64>(mesh, &d);
        // The tolerance is that of the cases above.
        assert!(energy < 1e-12, "{energy:e}");
        assert!(
            !unique || (force < 1e-12 && tangent < 1e-12),
            "{force:e} {tangent:e}"
        );
        finite::<f64>(mesh, &d);
        finite::<f32>(mesh, &d);
    }
}

fn finite<T: Real>(mesh: &TriMesh, d: &[Vec3]) {
    let mut triangles = triangles::<T>(mesh);
    let (force, energy) = linearize(&mut triangles, d);
    assert!(energy.is_finite() && energy > 0.0);
    assert!(force.iter().all(|f| f.iter().all(|c| c.is_finite())));
    let pushed = product(&triangles, 1.0, d);
    assert!(pushed.iter().all(|f| f.iter().all(|c| c.is_finite())));
}

#[test]
fn bad_numbers_are_forgotten() {
    let mesh = mesh();
    let mut triangles = triangles::<f64>(&mesh);
    let d = displaced(&mesh, UNSTRETCHED, 0.3, 0.02, 1);
    let expected = linearize(&mut triangles, &d);
    for bad in [f64::NAN, f64::INFINITY, 1e200, -1e-320] {
        let mut worse = d.clone();
        worse[0].x = bad;
        linearize(&mut triangles, &worse);
        linearize(&mut triangles, &vec![Vec3::repeat(bad); d.len()]);
        assert_eq!(linearize(&mut triangles, &d), expected);
    }
}

#[test]
fn any_number_of_elements_fills_its_blocks() {
    let mesh = grid(8, 6, 0.8, 0.6, Split::Right);
    let all = list(&mesh);
    assert!(all.len().is_multiple_of(LANES));
    for count in [1, 2, LANES - 1, LANES + 1, all.len()] {
        let mut triangles = Triangles::<f64>::new(&all[..count]);
        assert!(triangles.count() == count);
        let d = displaced(&mesh, [1.1, 0.9, 1.0], 0.4, 0.02, 1);
        let (force, energy) = linearize(&mut triangles, &d);
        let (mut sum, mut total) = (vec![Vec3::zeros(); d.len()], 0.0);
        for &triangle in &all[..count] {
            let mut single = Triangles::<f64>::new(&[triangle]);
            let (force, energy) = linearize(&mut single, &d);
            sum.iter_mut().zip(force).for_each(|(sum, f)| *sum += f);
            total += energy;
        }
        // The sums have another order.
        assert!(difference(&force, &sum) < 1e-14, "{count}");
        assert!((energy - total).abs() < 1e-14 * total, "{count}");
    }
    let mut none = Triangles::<f32>::new(&[]);
    assert!(none.linearize(&[], &mut []) == 0.0);
}

fn hashes<T: Real>() -> [u64; 3] {
    let mesh = mesh();
    let mut triangles = triangles::<T>(&mesh);
    let d = displaced(&mesh, [1.2, 0.9, 1.0], 1.0, 0.03, 1);
    let (force, energy) = linearize(&mut triangles, &d);
    [
        hash(&force),
        hash(&product(&triangles, 1.0, &d)),
        hash(&[Vec3::repeat(energy)]),
    ]
}

#[test]
fn bytes_do_not_depend_on_the_width_of_vectors() {
    // These hashes were recorded with vectors of 128 bits, and reproduced with 256 and 512. They change if the
    // arithmetic changes.
    let recorded = [
        [
            2_770_978_872_323_474_846,
            11_316_100_060_175_695_654,
            1_286_823_771_407_054_726,
        ],
        [
            17_967_427_155_806_770_743,
            2_316_522_339_184_435_477,
            17_509_681_211_477_132_495,
        ],
    ];
    assert_eq!([hashes::<f64>(), hashes::<f32>()], recorded);
}
