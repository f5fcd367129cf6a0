//! The tangent against the forces, against the blocks and in single precision; invalid states.

use super::*;
use crate::element::VectorForm;
use crate::element::elements::Elements;
use crate::element::tet::cell::{Four, Ten};
use crate::element::tet::shape::{Shape, Tet4, Tet10};
use crate::element::tet::solid::Solid;
use crate::linear::block_matrix::BlockMatrix;
use crate::material::law::{Law, StVenantKirchhoff, StableNeoHookean};
use crate::material::{SolidMaterial, Tangent};
use crate::mesh::generate_box::solid_box;
use crate::mesh::{Cells, TetMesh};

type Linear<L, T> = PrincipalTets<L, T, Four, 4, 1>;
type Quadratic<L, T> = PrincipalTets<L, T, Ten, 10, 4>;

/// Young's modulus (Pa).
const YOUNG: f64 = 1e4;

/// 48 cells, which fill a block and a half.
fn mesh(quadratic: bool) -> TetMesh {
    let mesh = solid_box([1.0; 3], [2; 3]).unwrap();
    if quadratic { mesh.quadratic() } else { mesh }
}

fn solid<const N: usize, const Q: usize, S: Shape<N, Q>, L: Law>(
    mesh: &TetMesh,
    cells: &[[u32; N]],
) -> Solid<N, Q, S, L> {
    let material = SolidMaterial {
        young: YOUNG,
        poisson: 0.4,
        density: 1000.0,
    };
    Solid::new(L::default(), &mesh.positions, cells, &[material]).unwrap()
}

fn linear<T: Real, L: Law + LaneLaw>(mesh: &TetMesh) -> Linear<L, T> {
    let Cells::Linear(cells) = &mesh.cells else {
        unreachable!("linear");
    };
    let solid = solid::<4, 1, Tet4, L>(mesh, cells);
    let Some(VectorForm::IsotropicTets(_, tets)) = solid.vector_form() else {
        unreachable!("linear tetrahedra of an isotropic law");
    };
    Linear::new(&tets)
}

fn quadratic<T: Real, L: Law + LaneLaw>(mesh: &TetMesh) -> Quadratic<L, T> {
    let Cells::Quadratic(cells) = &mesh.cells else {
        unreachable!("quadratic");
    };
    let solid = solid::<10, 4, Tet10, L>(mesh, cells);
    let Some(VectorForm::IsotropicQuadraticTets(_, tets)) = solid.vector_form() else {
        unreachable!("quadratic tetrahedra of an isotropic law");
    };
    Quadratic::new(&tets)
}

/// Displacements that stretch by a third, contract sideways and bend. The modulus is positive definite, so that
/// clipping changes nothing.
fn pulled<T: Real>(mesh: &TetMesh) -> Vec<Node<T>> {
    let moved = |x: &Vec3| {
        let d = Vec3::new(0.3 * x.x, 0.05 * x.x * x.x - 0.08 * x.y, -0.08 * x.z);
        crate::lanes::to_node(&d)
    };
    mesh.positions.iter().map(moved).collect()
}

fn wave<T: Real>(count: usize) -> Vec<Node<T>> {
    let at = |k: usize| T::of((0.7 * k as f64).sin());
    let node = |n: usize| [at(3 * n), at(3 * n + 1), at(3 * n + 2), T::ZERO];
    (0..count).map(node).collect()
}

fn off<T: Real>(a: &[Node<T>], b: &[Node<f64>]) -> f64 {
    let entries = |(a, b): (&Node<T>, &Node<f64>)| {
        assert!(a[3] == T::ZERO);
        (0..3)
            .map(|i| (a[i].to_f64() - b[i]).abs())
            .fold(0.0, f64::max)
    };
    let largest = b
        .iter()
        .flatten()
        .fold(0.0_f64, |most, b| most.max(b.abs()));
    a.iter().zip(b).map(entries).fold(0.0, f64::max) / largest
}

/// The product is the derivative of the forces, and the sum of the blocks times the vector, also in single precision.
fn check<L: LaneLaw, C: Cell<N, Q>, const N: usize, const Q: usize>(
    mesh: &TetMesh,
    mut double: PrincipalTets<L, f64, C, N, Q>,
    mut single: PrincipalTets<L, f32, C, N, Q>,
) {
    let count = mesh.positions.len();
    let zeros = vec![[0.0; 4]; count];
    let (d, u) = (pulled::<f64>(mesh), wave::<f64>(count));
    let force = |tets: &mut PrincipalTets<L, f64, C, N, Q>, d: &[Node<f64>]| {
        let mut force = zeros.clone();
        let energy = tets.linearize(d, &mut force);
        (force, energy)
    };
    let step = 1e-6;
    let moved = |factor: f64| -> Vec<Node<f64>> {
        let pairs = d.iter().zip(&u);
        pairs
            .map(|(d, u)| core::array::from_fn(|i| d[i] + factor * u[i]))
            .collect()
    };
    let ((ahead, more), (behind, less)) = (
        force(&mut double, &moved(step)),
        force(&mut double, &moved(-step)),
    );
    let (now, energy) = force(&mut double, &d);
    let mut ku = zeros.clone();
    double.product(1.0, &u, &mut ku);
    let pairs = behind.iter().zip(&ahead);
    let slope: Vec<Node<f64>> = pairs
        .map(|(b, a)| core::array::from_fn(|i| (b[i] - a[i]) / (2.0 * step)))
        .collect();
    // The error is the third derivative times the square of a strain of 1e-5, and rounding: 1e-15 over 1e-6.
    assert!(off(&ku, &slope) < 1e-7, "{:e}", off(&ku, &slope));
    let work = crate::linear::vectors::dot(&now, &u);
    let found = (more - less) / (2.0 * step) + work;
    assert!(found.abs() < 1e-7 * energy, "{found:e} {energy}");

    let mut sum = zeros.clone();
    for element in 0..double.places.len() {
        let blocks = double.stiffness(element);
        let (block, lane) = double.places[element];
        let nodes = double.nodes[block as usize][lane as usize].map(|node| node as usize);
        for a in 0..N {
            for b in 0..N {
                let pull = blocks[a][b] * crate::lanes::to_vec(&u[nodes[b]]);
                crate::lanes::add(&mut sum[nodes[a]], &crate::lanes::to_node(&pull));
            }
        }
    }
    // The rounding of sums of a thousand terms in two orders.
    assert!(off(&ku, &sum) < 1e-13, "{:e}", off(&ku, &sum));

    // Stresses are in double precision. Displacements have 24 bits, and strains are of their size.
    let mut found = vec![[0.0_f32; 4]; count];
    let less = single.linearize(&pulled(mesh), &mut found);
    assert!(off(&found, &now) < 2e-6, "{:e}", off(&found, &now));
    assert!((less - energy).abs() < 1e-6 * energy, "{less} {energy}");
    let mut found = vec![[0.0_f32; 4]; count];
    single.product(1.0, &wave(count), &mut found);
    assert!(off(&found, &ku) < 5e-6, "{:e}", off(&found, &ku));
}

#[test]
fn the_product_is_the_slope_of_the_forces() {
    let (four, ten) = (mesh(false), mesh(true));
    check(
        &four,
        linear::<f64, StableNeoHookean>(&four),
        linear::<f32, StableNeoHookean>(&four),
    );
    check(
        &four,
        linear::<f64, StVenantKirchhoff>(&four),
        linear::<f32, StVenantKirchhoff>(&four),
    );
    check(
        &ten,
        quadratic::<f64, StableNeoHookean>(&ten),
        quadratic::<f32, StableNeoHookean>(&ten),
    );
    check(
        &ten,
        quadratic::<f64, StVenantKirchhoff>(&ten),
        quadratic::<f32, StVenantKirchhoff>(&ten),
    );
}

#[test]
fn bad_numbers_are_forgotten_and_crushed_cells_are_finite() {
    let mesh = mesh(false);
    let mut tets = linear::<f64, StableNeoHookean>(&mesh);
    let mut forces = |d: &[Node<f64>]| {
        let mut force = vec![[0.0; 4]; d.len()];
        let energy = tets.linearize(d, &mut force);
        (force, energy)
    };
    let d = pulled(&mesh);
    let (expected, _) = forces(&d);
    for bad in [f64::NAN, f64::INFINITY, 1e100] {
        forces(&vec![[bad, bad, bad, 0.0]; d.len()]);
        let mut worse = d.clone();
        worse[0][0] = bad;
        forces(&worse);
        // The iteration for the axes has another start. The forces do not depend on it.
        assert!(off(&forces(&d).0, &expected) < 1e-13);
    }
    for keep in [0.0, 1.0] {
        let crush = |x: &Vec3| [(keep - 1.0) * x.x, -x.y, -2.0 * x.z, 0.0];
        let d: Vec<_> = mesh.positions.iter().map(crush).collect();
        let (force, energy) = forces(&d);
        assert!(energy.is_finite() && force.iter().flatten().all(|f| f.is_finite()));
    }
}

/// The gradients of affine displacements, from small to hostile.
fn gradients() -> Vec<Mat3> {
    let turn = |x: f64, y: f64, z: f64| {
        *nalgebra::Rotation3::new(Vec3::new(x, y, z)).matrix() - Mat3::identity()
    };
    let stretch =
        |x: f64, y: f64, z: f64| Mat3::from_diagonal(&Vec3::new(x - 1.0, y - 1.0, z - 1.0));
    let both =
        |r: Mat3, s: Mat3| (r + Mat3::identity()) * (s + Mat3::identity()) - Mat3::identity();
    let small = Mat3::new(3.0, 1.0, -2.0, 0.5, -1.0, 1.0, 2.0, 0.0, 1.0) * 1e-9;
    let half_a_turn = turn(0.0, core::f64::consts::PI, 0.0);
    let sheared = Mat3::new(0.0, 0.9, 0.0, 0.0, 0.0, 0.4, 0.0, 0.0, 0.0);
    let [point, line, flat] = [
        stretch(0.0, 0.0, 0.0),
        stretch(1.2, 0.0, 0.0),
        stretch(1.1, 0.9, 0.0),
    ];
    let nearly_a_line = both(turn(0.4, 0.4, 0.4), stretch(1.2, 1e-7, -1e-9));
    let mirrored = stretch(-1.0, 1.0, 1.0);
    let inverted = both(turn(2.0, 1.0, 0.0), stretch(-1.4, 0.9, 0.3));
    let inside_out = stretch(-0.5, -0.7, -0.9);
    let pulled = both(turn(-1.0, 1.0, 2.0), stretch(4.0, 0.5, 0.6));
    let pressed = stretch(0.3, 0.5, 0.2);
    let two_equal_stretches = stretch(1.3, 1.3, 0.8);
    let equal_stretches = both(turn(0.3, 0.2, 0.1), stretch(0.7, 0.7, 0.7));
    vec![
        Mat3::zeros(),
        small,
        turn(1.0, -2.0, 0.5),
        half_a_turn,
        two_equal_stretches,
        equal_stretches,
        sheared,
        pulled,
        pressed,
        mirrored,
        inverted,
        inside_out,
        flat,
        line,
        point,
        nearly_a_line,
    ]
}

/// The largest errors of forces, of energy and of the tangent as fractions of the largest force, energy and entry, over
/// [`gradients`] in turn with the vertices moved by up to `shaken`.
fn errors<
    T: Real,
    L: Law + LaneLaw,
    C: Cell<N, Q>,
    S: Shape<N, Q> + 'static,
    const N: usize,
    const Q: usize,
>(
    mesh: &TetMesh,
    solid: &mut Solid<N, Q, S, L>,
    tets: &mut PrincipalTets<L, T, C, N, Q>,
    shaken: f64,
) -> [f64; 3] {
    let count = mesh.positions.len();
    let nodes: Vec<Vec<u32>> = (0..solid.count())
        .map(|element| solid.nodes(element).to_vec())
        .collect();
    let mut matrix = BlockMatrix::new(count, count, nodes.iter().map(Vec::as_slice));
    let places: Vec<u32> = (0_u32..).take(count).collect();
    solid.bind(&matrix, &places);
    let shake = wave::<f64>(count);
    let mut worst = [0.0_f64; 3];
    for h in gradients() {
        // The same displacements in both precisions.
        let pairs = mesh.positions.iter().zip(&shake);
        let d: Vec<Node<T>> = pairs
            .map(|(x, shake)| {
                let moved = crate::lanes::to_vec(shake) * (shaken * h.amax().min(1.0));
                crate::lanes::to_node(&(h * x + moved))
            })
            .collect();
        let pairs = mesh.positions.iter().zip(&d);
        let x: Vec<Vec3> = pairs.map(|(x, d)| x + crate::lanes::to_vec(d)).collect();
        let mut expected = vec![Vec3::zeros(); count];
        matrix.clear();
        solid.assemble(&x, Tangent::Clipped, &mut expected, &mut matrix);
        let expected: Vec<Node<f64>> = expected.iter().map(crate::lanes::to_node).collect();
        let mut force = vec![[T::ZERO; 4]; count];
        let energy = tets.linearize(&d, &mut force);
        // A strain of one: Young's modulus times the area at a node, and times the volume.
        let scale = expected
            .iter()
            .flatten()
            .fold(0.25 * YOUNG, |most: f64, f| most.max(f.abs()));
        let pairs = force.iter().flatten().zip(expected.iter().flatten());
        let found = pairs
            .map(|(a, b)| (a.to_f64() - b).abs())
            .fold(0.0, f64::max)
            / scale;
        worst[0] = worst[0].max(found);
        let exact = solid.energy(&x);
        let found = (energy - exact).abs() / exact.max(YOUNG);
        worst[1] = worst[1].max(found);
        let u = wave::<f64>(count);
        let moved: Vec<Vec3> = u.iter().map(crate::lanes::to_vec).collect();
        let mut expected = moved.clone();
        matrix.product(&moved, &mut expected);
        let mut product = vec![[T::ZERO; 4]; count];
        tets.product(T::of(1.0), &wave::<T>(count), &mut product);
        let scale = expected.iter().map(Vec3::amax).fold(0.5 * YOUNG, f64::max);
        let pairs = product.iter().zip(&expected);
        let found = pairs
            .map(|(a, b)| (crate::lanes::to_vec(a) - b).amax())
            .fold(0.0, f64::max)
            / scale;
        worst[2] = worst[2].max(found);
    }
    worst
}

/// The errors of all shapes and laws with the vertices moved by up to `shaken`.
fn check_exact<T: Real, L: Law + LaneLaw>(shaken: f64) -> [f64; 3] {
    let (four, ten) = (mesh(false), mesh(true));
    let Cells::Linear(cells) = &four.cells else {
        unreachable!("linear");
    };
    let mut tets = linear::<T, L>(&four);
    let a = errors(
        &four,
        &mut solid::<4, 1, Tet4, L>(&four, cells),
        &mut tets,
        shaken,
    );
    let Cells::Quadratic(cells) = &ten.cells else {
        unreachable!("quadratic");
    };
    let mut tets = quadratic::<T, L>(&ten);
    let b = errors(
        &ten,
        &mut solid::<10, 4, Tet10, L>(&ten, cells),
        &mut tets,
        shaken,
    );
    [0, 1, 2].map(|k| a[k].max(b[k]))
}

/// The errors of both laws.
fn both_laws<T: Real>(shaken: f64) -> [f64; 3] {
    let a = check_exact::<T, StVenantKirchhoff>(shaken);
    let b = check_exact::<T, StableNeoHookean>(shaken);
    [0, 1, 2].map(|k| a[k].max(b[k]))
}

#[test]
fn the_vector_form_is_the_exact_form() {
    for shaken in [0.0, 0.01, 0.3] {
        // Forces and energies are sums of tens of terms. Sweeps end after one that met an angle of 3e-7, the root of the
        // error that it leaves, if the stretches of all axes differ clearly; otherwise the error is that angle times
        // the difference of two stretches.
        let [force, energy, tangent] = both_laws::<f64>(shaken);
        assert!(force < 5e-14, "{shaken}: {force:e}");
        assert!(energy < 2e-14, "{shaken}: {energy:e}");
        assert!(tangent < 1e-8, "{shaken}: {tangent:e}");
        // The entries of a gradient have 24 bits. The last angle is 3e-4.
        let [force, energy, tangent] = both_laws::<f32>(shaken);
        assert!(force < 5e-6, "{shaken}: {force:e}");
        assert!(energy < 5e-7, "{shaken}: {energy:e}");
        assert!(tangent < 2e-4, "{shaken}: {tangent:e}");
    }
}

/// The force of a strain of a billionth against the tangent. An exact form that starts from `F` itself would be wrong by
/// 1e-7 of that force.
fn check_small<T: Real, L: Law + LaneLaw>(tolerance: f64) {
    let mesh = mesh(false);
    let mut tets = linear::<T, L>(&mesh);
    let small = Mat3::new(3.0, 1.0, -2.0, 0.5, -1.0, 1.0, 2.0, 0.0, 1.0) * 1e-9;
    let moved = |x: &Vec3| crate::lanes::to_node::<T>(&(small * x));
    let d: Vec<Node<T>> = mesh.positions.iter().map(moved).collect();
    let mut force = vec![[T::ZERO; 4]; d.len()];
    tets.linearize(&d, &mut force);
    let mut product = vec![[T::ZERO; 4]; d.len()];
    tets.product(T::of(-1.0), &d, &mut product);
    let product: Vec<Node<f64>> = product.iter().map(|f| f.map(Real::to_f64)).collect();
    let error = off(&force, &product);
    assert!(error < tolerance, "{error:e}");
}

#[test]
fn small_strains_keep_their_digits() {
    // The second order of the strain; and 24 bits.
    check_small::<f64, StVenantKirchhoff>(1e-8);
    check_small::<f64, StableNeoHookean>(1e-8);
    check_small::<f32, StVenantKirchhoff>(2e-6);
    check_small::<f32, StableNeoHookean>(2e-6);
}
