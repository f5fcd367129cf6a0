//! Builds the elements and the node vectors of the realtime step from meshes.

use physics::element::tet::cell::Tet;
use physics::material::law::Lame;
use physics::mesh::{Cells, TetMesh};
use physics::{Mat3, Node, Real, SolidMaterial, Vec3};

/// The largest norm.
pub fn largest(values: impl Iterator<Item = Vec3>) -> f64 {
    values.map(|value| value.norm()).fold(0.0, f64::max)
}

/// A list of materials in which two materials alternate.
pub fn materials(count: usize) -> Vec<SolidMaterial> {
    let material = |element: usize| SolidMaterial {
        young: if element.is_multiple_of(2) { 1e4 } else { 3e4 },
        poisson: if element.is_multiple_of(2) { 0.45 } else { 0.0 },
        density: 1000.0,
    };
    (0..count).map(material).collect()
}

/// The cells of a linear mesh.
pub fn cells(mesh: &TetMesh) -> &[[u32; 4]] {
    match &mesh.cells {
        Cells::Linear(cells) => cells,
        Cells::Quadratic(_) => &[],
    }
}

/// The cells with these materials. The vertices are the nodes.
pub fn tets(mesh: &TetMesh) -> Vec<Tet> {
    let tet = |(nodes, material): (&[u32; 4], SolidMaterial)| {
        let x = nodes.map(|node| mesh.positions[node as usize]);
        let edges = Mat3::from_columns(&[x[1] - x[0], x[2] - x[0], x[3] - x[0]]);
        let rows = edges.try_inverse().unwrap();
        let g: [Vec3; 3] = core::array::from_fn(|a| rows.row(a).transpose());
        let lame = Lame::new(material.young, material.poisson);
        Tet {
            nodes: *nodes,
            gradients: [g],
            volumes: [edges.determinant() / 6.0],
            lambda: lame.lambda,
            mu: lame.mu,
        }
    };
    let cells = cells(mesh);
    cells.iter().zip(materials(cells.len())).map(tet).collect()
}

/// Vectors as padded nodes.
pub fn nodes<T: Real>(vectors: &[Vec3]) -> Vec<Node<T>> {
    let node = |v: &Vec3| [T::of(v.x), T::of(v.y), T::of(v.z), T::ZERO];
    vectors.iter().map(node).collect()
}

/// Vectors of zero length.
pub fn zeros<T: Real>(count: usize) -> Vec<Node<T>> {
    vec![[T::ZERO; 4]; count]
}

/// Vectors without the padding, which must still be zero.
pub fn vectors<T: Real>(nodes: &[Node<T>]) -> Vec<Vec3> {
    assert!(nodes.iter().all(|node| node[3] == T::ZERO));
    let vector = |v: &Node<T>| Vec3::new(v[0].to_f64(), v[1].to_f64(), v[2].to_f64());
    nodes.iter().map(vector).collect()
}

/// The sum of the products of the vectors.
pub fn dot(a: &[Vec3], b: &[Vec3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(b)).sum()
}

/// The largest difference as a fraction of the largest entry of `b`.
pub fn difference(a: &[Vec3], b: &[Vec3]) -> f64 {
    let scale = largest(b.iter().copied());
    largest(a.iter().zip(b).map(|(a, b)| a - b)) / scale
}

/// Fowler, Noll and Vo's hash of the bits.
pub fn hash(vectors: &[Vec3]) -> u64 {
    let bytes = vectors
        .iter()
        .flat_map(|v| v.iter())
        .flat_map(|c| c.to_bits().to_le_bytes());
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}
