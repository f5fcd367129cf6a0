//! The frozen factor and its panels compared with the factorization by `faer` with its own order, on a solid and on a
//! sheet with bending.

use alloc_count::calls::count;
use common::{Random, rubber, tight};
use physics::linear::cholesky::Cholesky;
use physics::linear::factor::Factor;
use physics::linear::order::{order, places};
use physics::linear::panel::Panels;
use physics::mesh::generate::{Pattern, sheet};
use physics::mesh::generate_box::solid_box;
use physics::team::Work;
use physics::{
    BlockMatrix, Body, BodyConfig, Border, CondenseError, FactorCode, Freedom, HandleSpec, Node,
    SolidLaw, SolidMaterial, Team, Vec3,
};

/// Implicit Euler with a step of 10 ms, and Rayleigh damping of 0.1 and 0.1.
const BY_MASS: f64 = 1e4 + 10.0;
const BY_STIFFNESS: f64 = 11.0;

fn held(vertices: &[u32]) -> HandleSpec {
    HandleSpec {
        vertices: vertices.to_vec(),
        origin: Vec3::zeros(),
        freedom: Freedom::Rigid,
        border: Border::Hinged,
    }
}

fn solid(cells: [u32; 3]) -> Body {
    let mesh = solid_box([0.1; 3], cells).unwrap();
    let handles = ["bottom", "top"].map(|name| held(&mesh.group(name).unwrap().members));
    let material = SolidMaterial {
        young: 2e4,
        poisson: 0.3,
        density: 1000.0,
    };
    let mut body = Body::solid(
        &mesh,
        &[material],
        SolidLaw::Corotational,
        tight(),
        &handles,
    )
    .unwrap();
    body.assemble();
    body
}

fn cloth() -> Body {
    let mesh = sheet(0.1, 0.08, 20, 16, Pattern::Alternating).unwrap();
    let handles = ["left", "right"].map(|name| held(&mesh.group(name).unwrap().members));
    let config = BodyConfig {
        bending: 1.0,
        ..tight()
    };
    let mut body = Body::sheet(&mesh, &[rubber(0.3)], config, &handles).unwrap();
    body.assemble();
    body
}

/// A solid, a sheet, a bar that separates into many parts of one node, and a body with one free node.
fn bodies() -> [(&'static str, Body); 4] {
    [
        ("solid", solid([6, 5, 7])),
        ("sheet", cloth()),
        ("layer", solid([3, 2, 2])),
        ("node", one_node()),
    ]
}

/// A cube with two grid cells along each axis. All vertices but the middle one are held.
fn one_node() -> Body {
    let mesh = solid_box([0.1; 3], [2; 3]).unwrap();
    let outer: Vec<u32> = (0..27).filter(|&vertex| vertex != 13).collect();
    let material = SolidMaterial {
        young: 2e4,
        poisson: 0.3,
        density: 1000.0,
    };
    let law = SolidLaw::Corotational;
    let mut body = Body::solid(&mesh, &[material], law, tight(), &[held(&outer)]).unwrap();
    body.assemble();
    body
}

/// Positions in the order of the matrix (m).
fn positions(body: &Body) -> Vec<Vec3> {
    body.places().gather(body.node_positions())
}

/// Masses in the order of the matrix (kg).
fn masses(body: &Body) -> Vec<f64> {
    body.places().gather(body.node_masses())
}

fn factor_of(body: &Body, mask: Option<&[Vec3]>) -> Factor {
    let order = order(body.stiffness(), &positions(body));
    let (matrix, mass) = (body.stiffness(), &masses(body));
    let mut factor = Factor::new(matrix, &order).unwrap();
    factor
        .factorize(matrix, mass, BY_MASS, BY_STIFFNESS, mask)
        .unwrap();
    factor
}

fn right_side(unknowns: usize) -> Vec<f64> {
    let mut random = Random(5);
    (0..unknowns).map(|_| random.signed()).collect()
}

/// The solution by `faer` with its own order, by nodes.
fn reference(body: &Body, mask: Option<&[Vec3]>, b: &[f64]) -> Vec<f64> {
    let (matrix, mass) = (body.stiffness(), &masses(body));
    let mut cholesky = Cholesky::new(matrix, 1, FactorCode::Fastest).unwrap();
    cholesky
        .factorize(matrix, mass, BY_MASS, BY_STIFFNESS, mask)
        .unwrap();
    let mut x = b.to_vec();
    cholesky.solve(&mut x);
    x
}

/// A vector of three numbers per node, in the new order of the nodes.
fn renumbered(x: &[f64], from: &[u32]) -> Vec<f64> {
    from.iter()
        .flat_map(|&at| x[3 * at as usize..3 * at as usize + 3].to_vec())
        .collect()
}

fn padded(b: &[f64]) -> Vec<Node<f32>> {
    let node = |b: &[f64]| [b[0] as f32, b[1] as f32, b[2] as f32, 0.0];
    b.chunks_exact(3).map(node).collect()
}

fn difference(a: &[f64], b: &[f64]) -> f64 {
    let norm = |x: &mut dyn Iterator<Item = f64>| x.map(|x| x * x).sum::<f64>().sqrt();
    norm(&mut a.iter().zip(b).map(|(a, b)| a - b)) / norm(&mut b.iter().copied())
}

/// The solution by the panels, by places.
fn by_panels(panels: &mut Panels, b: &[f64]) -> Vec<f64> {
    let mut r = padded(b);
    panels.solve(&mut r);
    assert!(r.iter().all(|node| node[3] == 0.0));
    r.iter()
        .flat_map(|node| node[..3].iter().map(|&x| f64::from(x)))
        .collect()
}

/// The condition number from power iterations on the matrix and on its inverse, exact to some per cent.
fn condition(matrix: &BlockMatrix, mass: &[f64], factor: &mut Factor) -> f64 {
    let free = matrix.free();
    let norm = |x: &[Vec3]| x.iter().map(Vec3::norm_squared).sum::<f64>().sqrt();
    let mut random = Random(9);
    let mut x: Vec<Vec3> = (0..free).map(|_| random.vector()).collect();
    let mut y = x.clone();
    let (mut largest, mut smallest) = (0.0, 0.0);
    for _ in 0..60 {
        let scale = norm(&x);
        for x in &mut x {
            *x /= scale;
        }
        let product =
            |at: usize| matrix.free_product(at, &x) * BY_STIFFNESS + x[at] * (BY_MASS * mass[at]);
        x = (0..free).map(product).collect();
        largest = norm(&x);
        let scale = norm(&y);
        let order = factor.order().to_vec();
        let mut flat: Vec<f64> = order
            .iter()
            .flat_map(|&node| (y[node as usize] / scale).as_slice().to_vec())
            .collect();
        factor.solve(&mut flat);
        for (&node, x) in order.iter().zip(flat.chunks_exact(3)) {
            y[node as usize] = Vec3::from_column_slice(x);
        }
        smallest = 1.0 / norm(&y);
    }
    largest / smallest
}

#[test]
fn the_order_names_every_free_node_once() {
    for (name, body) in bodies() {
        let matrix = body.stiffness();
        let order = order(matrix, &positions(&body));
        let mut sorted = order.clone();
        sorted.sort_unstable();
        assert!(sorted.into_iter().eq(0..matrix.free() as u32), "{name}");
        let places = places(&order);
        let back = |(place, &node): (usize, &u32)| places[node as usize] as usize == place;
        assert!(order.iter().enumerate().all(back), "{name}");
    }
}

#[test]
fn the_order_fills_less_than_minimum_degree_on_solids() {
    let body = solid([10; 3]);
    let cholesky = Cholesky::new(body.stiffness(), 1, FactorCode::Portable).unwrap();
    let order = order(body.stiffness(), &positions(&body));
    let factor = Factor::with_code(body.stiffness(), &order, FactorCode::Portable).unwrap();
    // A factorization column by column stores no zeros in either order. Measured: 537,426 against 631,224 entries, 15 %
    // fewer.
    let fraction = factor.factor_entries() as f64 / cholesky.factor_entries() as f64;
    assert!(fraction < 0.9, "{fraction}");
}

#[test]
fn a_wrong_order_is_refused() {
    let body = solid([3, 2, 2]);
    let matrix = body.stiffness();
    let mut order = order(matrix, &positions(&body));
    let factor = |order: &[u32]| Factor::new(matrix, order).map(|_| ());
    assert_eq!(factor(&order[1..]), Err(CondenseError::Topology));
    order[0] = order[1];
    assert_eq!(factor(&order), Err(CondenseError::Topology));
    order[0] = u32::MAX;
    assert_eq!(factor(&order), Err(CondenseError::Topology));
}

#[test]
fn the_factor_solves_as_the_factorization_by_minimum_degree() {
    for (name, body) in bodies() {
        let mut factor = factor_of(&body, None);
        let b = right_side(factor.unknowns());
        let expected = reference(&body, None, &b);
        let mut x = renumbered(&b, factor.order());
        // Seven right-hand sides are more than one pass solves.
        x = x.repeat(7);
        factor.solve(&mut x);
        for x in x.chunks_exact(b.len()) {
            let error = difference(&renumbered(x, factor.places()), &expected);
            // The error is the rounding of two factorizations, 1e-16, times a condition number of up to 3e5.
            assert!(error < 1e-10, "{name}: {error:e}");
        }
    }
}

#[test]
fn panels_solve_with_the_accuracy_of_single_precision() {
    for (name, body) in bodies() {
        let mut factor = factor_of(&body, None);
        let mut panels = Panels::new(&factor);
        let b = right_side(factor.unknowns());
        let expected = renumbered(&reference(&body, None, &b), factor.order());
        let error = difference(
            &by_panels(&mut panels, &renumbered(&b, factor.order())),
            &expected,
        );
        // A product with rounded inverses errs by about the rounding times the square root of the
        // condition number (the norm of a triangular factor times that of its inverse), in either pass.
        let condition = condition(body.stiffness(), &masses(&body), &mut factor);
        let bound = 2.0 * f64::from(f32::EPSILON) * condition.sqrt();
        assert!(error < bound, "{name}: {error:e}, {bound:e}, {condition:e}");
        // The lower bound shows that the panels are not in double precision by mistake.
        assert!(error > 1e-10, "{name}: {error:e}");
    }
}

/// A factor that is solved in pieces, from numbers of 16 bits.
#[test]
fn the_panels_of_a_large_factor_solve_in_pieces() {
    let body = solid([14, 13, 12]);
    let mut factor = factor_of(&body, None);
    let mut panels = Panels::new(&factor);
    let b = right_side(factor.unknowns());
    let mut expected = b.clone();
    factor.solve(&mut expected);
    let error = difference(&by_panels(&mut panels, &b), &expected);
    // As for small factors, with the rounding of 16 bits instead of that of single precision.
    let condition = condition(body.stiffness(), &masses(&body), &mut factor);
    let bound = 2.0 * 0.5_f64.powi(16) * condition.sqrt();
    assert!(error < bound, "{error:e}, {bound:e}, {condition:e}");
    // The two passes use the same rounded numbers. Only sums round, in single precision.
    let mut random = Random(3);
    let other: Vec<f64> = b.iter().map(|_| random.signed()).collect();
    let (x, y) = (by_panels(&mut panels, &b), by_panels(&mut panels, &other));
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    assert!((dot(&other, &x) - dot(&b, &y)).abs() < 1e-6 * dot(&b, &x).abs());
    let places: Vec<Node<f32>> = padded(&b);
    let mut turned = places.clone();
    panels.solve_with(&Turned, &mut turned);
    let mut straight = places;
    panels.solve(&mut straight);
    assert_eq!(turned, straight);
}

/// Does the second piece of work first.
#[derive(Debug)]
struct Turned;

impl Team for Turned {
    fn join(&self, one: &mut Work<'_>, other: &mut Work<'_>) {
        other();
        one();
    }
}

#[test]
fn the_solution_is_symmetric_and_linear() {
    let body = solid([6, 5, 7]);
    let factor = factor_of(&body, None);
    let mut panels = Panels::new(&factor);
    let mut random = Random(21);
    let mut vector = || -> Vec<f64> { (0..factor.unknowns()).map(|_| random.signed()).collect() };
    let (a, b) = (vector(), vector());
    let (x, y) = (by_panels(&mut panels, &a), by_panels(&mut panels, &b));
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let scale = dot(&a, &x).abs() + dot(&b, &y).abs();
    // The forward and the backward pass use the same rounded panels. Only sums round, by some 1e-7 each.
    assert!((dot(&b, &x) - dot(&a, &y)).abs() < 1e-6 * scale);
    let sum: Vec<f64> = a.iter().zip(&b).map(|(a, b)| 2.0 * a - b).collect();
    let both: Vec<f64> = x.iter().zip(&y).map(|(x, y)| 2.0 * x - y).collect();
    assert!(difference(&by_panels(&mut panels, &sum), &both) < 1e-6);
}

#[test]
fn places_past_the_factor_are_unchanged_and_a_short_vector_is_unchanged() {
    let body = solid([6, 5, 7]);
    let factor = factor_of(&body, None);
    let mut panels = Panels::new(&factor);
    let mut r = padded(&right_side(factor.unknowns()));
    let mut longer = r.clone();
    longer.push([1.0, 2.0, 3.0, 4.0]);
    let before = r[1..].to_vec();
    panels.solve(&mut r[1..]);
    assert_eq!(r[1..], before);
    panels.solve(&mut r);
    panels.solve(&mut longer);
    assert_eq!(longer.pop(), Some([1.0, 2.0, 3.0, 4.0]));
    assert_eq!(longer, r);
}

#[test]
fn refreshed_panels_are_new_ones() {
    for (name, mut body) in bodies() {
        let mut factor = factor_of(&body, None);
        let mut panels = Panels::new(&factor);
        let b = right_side(factor.unknowns());
        let before = by_panels(&mut panels, &b);
        let moved: Vec<Vec3> = body
            .positions()
            .map(|x| x * 1.1 + Vec3::x() * x.z)
            .collect();
        body.set_positions(&moved).unwrap();
        body.assemble();
        let (matrix, mass) = (body.stiffness(), &masses(&body));
        factor
            .factorize(matrix, mass, 2.0 * BY_MASS, BY_STIFFNESS, None)
            .unwrap();
        panels.refresh(&factor).unwrap();
        let refreshed = by_panels(&mut panels, &b);
        assert_eq!(
            refreshed,
            by_panels(&mut Panels::new(&factor), &b),
            "{name}"
        );
        assert!(difference(&refreshed, &before) > 1e-3, "{name}");
    }
}

#[test]
fn guided_axes_keep_their_right_hand_side() {
    let body = solid([6, 5, 7]);
    let free = body.stiffness().free();
    let mut random = Random(2);
    let mut mask = vec![Vec3::repeat(1.0); free];
    for (node, mask) in mask.iter_mut().enumerate() {
        if random.signed() > 0.0 {
            mask[node % 3] = 0.0;
        }
    }
    let mut factor = factor_of(&body, Some(&mask));
    let b = right_side(factor.unknowns());
    let expected = reference(&body, Some(&mask), &b);
    let mut x = renumbered(&b, factor.order());
    let rough = by_panels(&mut Panels::new(&factor), &x);
    factor.solve(&mut x);
    let x = renumbered(&x, factor.places());
    let rough = renumbered(&rough, factor.places());
    // The tolerances are those of the test without a mask.
    assert!(difference(&x, &expected) < 1e-10);
    assert!(difference(&rough, &expected) < 1e-5);
    for at in (0..b.len()).filter(|&at| mask[at / 3][at % 3] == 0.0) {
        // A row without coupling has a one on the diagonal, and zeros.
        assert_eq!(x[at], b[at]);
        assert_eq!(rough[at], f64::from(b[at] as f32));
    }
}

#[test]
fn portable_and_fastest_kernels_give_the_same_panels_up_to_rounding() {
    let body = solid([6, 5, 7]);
    let (matrix, mass) = (body.stiffness(), &masses(&body));
    let order = order(matrix, &positions(&body));
    let b = right_side(3 * order.len());
    let solution = |code| {
        let mut factor = Factor::with_code(matrix, &order, code).unwrap();
        factor
            .factorize(matrix, mass, BY_MASS, BY_STIFFNESS, None)
            .unwrap();
        by_panels(&mut Panels::new(&factor), &b)
    };
    let error = difference(
        &solution(FactorCode::Portable),
        &solution(FactorCode::Fastest),
    );
    // The factors differ in double precision. One number in 1e8 may round to the other neighbour in single precision.
    assert!(error < 1e-6, "{error:e}");
}

#[test]
fn a_matrix_that_is_not_positive_leaves_the_panels_usable() {
    let body = solid([6, 5, 7]);
    let (matrix, mass) = (body.stiffness(), &masses(&body));
    let mut factor = factor_of(&body, None);
    let mut panels = Panels::new(&factor);
    let b = right_side(factor.unknowns());
    let before = by_panels(&mut panels, &b);
    for (by_mass, by_stiffness) in [(-1e9, BY_STIFFNESS), (BY_MASS, f64::NAN)] {
        let error = factor.factorize(matrix, mass, by_mass, by_stiffness, None);
        assert!(
            matches!(error, Err(CondenseError::NotPositiveDefinite { .. })),
            "{error:?}"
        );
    }
    assert_eq!(by_panels(&mut panels, &b), before);
    // A later factorization on the same factor succeeds.
    factor
        .factorize(matrix, mass, BY_MASS, BY_STIFFNESS, None)
        .unwrap();
    panels.refresh(&factor).unwrap();
    assert_eq!(by_panels(&mut panels, &b), before);
}

#[test]
fn another_body_s_matrix_is_refused() {
    let (body, other) = (solid([6, 5, 7]), solid([3, 2, 2]));
    let mut factor = factor_of(&body, None);
    let (matrix, mass) = (other.stiffness(), &masses(&other));
    let error = factor.factorize(matrix, mass, BY_MASS, BY_STIFFNESS, None);
    assert_eq!(error, Err(CondenseError::Topology));
    let error = factor.factorize(body.stiffness(), &mass[..1], BY_MASS, BY_STIFFNESS, None);
    assert_eq!(error, Err(CondenseError::Topology));
    let mut panels = Panels::new(&factor_of(&body, None));
    let b = right_side(factor.unknowns());
    let before = by_panels(&mut panels, &b);
    let error = panels.refresh(&factor_of(&other, None));
    assert_eq!(error, Err(CondenseError::Topology));
    assert_eq!(by_panels(&mut panels, &b), before);
}

#[test]
fn nothing_is_allocated_after_construction() {
    for (name, body) in bodies() {
        let (matrix, mass) = (body.stiffness(), &masses(&body));
        let mut factor = factor_of(&body, None);
        let mut panels = Panels::new(&factor);
        let mut exact = right_side(factor.unknowns());
        let mut rough = padded(&exact);
        let made = count(|| drop(Panels::new(&factor)));
        assert_ne!(made, 0, "the counter counts");
        let found = count(|| {
            for _ in 0..3 {
                factor
                    .factorize(matrix, mass, BY_MASS, BY_STIFFNESS, None)
                    .unwrap();
                panels.refresh(&factor).unwrap();
                panels.solve(&mut rough);
                factor.solve(&mut exact);
            }
        });
        assert_eq!(found, 0, "{name}");
    }
}
