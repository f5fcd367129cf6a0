//! The incomplete factor: exact for matrices without fill, symmetric, and positive definite for every matrix.

use common::{Random, block};
use physics::linear::factor::Factor;
use physics::linear::incomplete::Blocks;
use physics::linear::incomplete::aggregates::aggregates;
use physics::linear::incomplete::order::order;
use physics::{
    BlockMatrix, Body, BodyConfig, CondenseError, Mat3, Node, SolidLaw, SolidMaterial, Vec3,
};

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

/// The sum `B B^T` over the pairs of a chain. It is positive definite and block-tridiagonal.
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

/// The largest difference as a fraction of the largest number.
fn off(a: &[f64], b: &[f64]) -> f64 {
    let difference = a.iter().zip(b).map(|(a, b)| (a - b).abs());
    difference.fold(0.0, f64::max) / b.iter().map(|b| b.abs()).fold(0.0, f64::max)
}

#[test]
fn without_fill_the_incomplete_factor_is_the_complete_one_and_solves() {
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
        // The tolerance is the rounding of single precision, some tens of times, because the condition number of the
        // matrix is about that.
        let off = off(&flat(&ours), &exact);
        assert!(off < 1e-5, "{off:e}");
    }
}

/// The matrix at rest of a body that nothing holds.
fn solid() -> Body {
    let material = SolidMaterial {
        young: 2e4,
        poisson: 0.3,
        density: 1000.0,
    };
    let mesh = block([4, 4, 4], 0.1, false);
    let law = SolidLaw::Corotational;
    let mut body = Body::solid(&mesh, &[material], law, BodyConfig::default(), &[]).unwrap();
    body.assemble();
    body
}

#[test]
fn the_preconditioner_is_symmetric() {
    let body = solid();
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
    // The tolerance is that of single precision.
    assert!((forth - back).abs() < 1e-5 * scale, "{forth} {back}");
}

/// Kershaw's matrix ("The incomplete Cholesky-conjugate gradient method for the iterative solution of systems of linear
/// equations", 1978). It is positive definite, and its incomplete factor without a shift has a pivot of -5.
#[test]
fn bad_pivots_enlarge_the_diagonal_and_leave_a_positive_preconditioner() {
    let one = Mat3::identity();
    let turn = *nalgebra::Rotation3::from_scaled_axis(Vec3::new(0.4, 1.0, -0.3)).matrix();
    for turn in [one, turn] {
        // Each node has its own rotation, which changes no eigenvalue.
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
fn a_matrix_that_is_not_positive_definite_is_refused() {
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

/// Two chains without contact, and a single node.
#[test]
fn orders_and_patches_have_every_node() {
    let mut random = Random(8);
    let mut blocks = vec![(0, 0, Mat3::identity())];
    for start in [1_u32, 120] {
        blocks.extend((start..start + 99).map(|i| (i, i + 1, any(&mut random))));
    }
    let matrix = matrix(220, &blocks);
    let mut order = order(&matrix);
    // The nodes of a chain are numbered one after another.
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
    // The patches are pieces of sixty nodes, the rest of each chain, and single nodes without neighbours.
    assert!(
        sizes.iter().all(|&size| size <= 75 && size > 0),
        "{sizes:?}"
    );
    assert!(
        sizes.iter().filter(|&&size| size >= 15).count() == 4,
        "{sizes:?}"
    );
}
