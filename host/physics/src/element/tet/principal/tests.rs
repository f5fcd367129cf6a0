//! The tangent against the forces, against the blocks and in single precision; invalid states.

use super::*;
use crate::element::VectorForm;
use crate::element::elements::Elements;
use crate::element::tet::shape::{Shape, Tet4, Tet10};
use crate::element::tet::solid::Solid;
use crate::material::SolidMaterial;
use crate::material::law::{Law, StVenantKirchhoff, StableNeoHookean};
use crate::mesh::generate_box::solid_box;
use crate::mesh::{Cells, TetMesh};

type Linear<T> = PrincipalTets<T, Four, 4, 1>;
type Quadratic<T> = PrincipalTets<T, Ten, 10, 4>;

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
        young: 1e4,
        poisson: 0.4,
        density: 1000.0,
    };
    Solid::new(L::default(), &mesh.positions, cells, &[material]).unwrap()
}

fn linear<T: Real, L: Law>(mesh: &TetMesh) -> Linear<T> {
    let Cells::Linear(cells) = &mesh.cells else {
        unreachable!("linear");
    };
    let solid = solid::<4, 1, Tet4, L>(mesh, cells);
    let Some(VectorForm::IsotropicTets(law, tets)) = solid.vector_form() else {
        unreachable!("linear tetrahedra of an isotropic law");
    };
    Linear::linear(law, &tets)
}

fn quadratic<T: Real, L: Law>(mesh: &TetMesh) -> Quadratic<T> {
    let Cells::Quadratic(cells) = &mesh.cells else {
        unreachable!("quadratic");
    };
    let solid = solid::<10, 4, Tet10, L>(mesh, cells);
    let Some(VectorForm::IsotropicQuadraticTets(law, tets)) = solid.vector_form() else {
        unreachable!("quadratic tetrahedra of an isotropic law");
    };
    Quadratic::quadratic(law, &tets)
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
fn check<C: Cell<N, Q>, const N: usize, const Q: usize>(
    mesh: &TetMesh,
    mut double: PrincipalTets<f64, C, N, Q>,
    mut single: PrincipalTets<f32, C, N, Q>,
) {
    let count = mesh.positions.len();
    let zeros = vec![[0.0; 4]; count];
    let (d, u) = (pulled::<f64>(mesh), wave::<f64>(count));
    let force = |tets: &mut PrincipalTets<f64, C, N, Q>, d: &[Node<f64>]| {
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
