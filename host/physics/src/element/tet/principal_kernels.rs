//! Products with the tangent of isotropic laws on blocks of tetrahedra, compiled once for each width of vector
//! instructions.
//!
//! Loops over lanes must stay loops until the compiler makes vectors of them: see `tet4::kernels`.

use crate::element::tet4::kernels::{at, node, put, vectors_at};
use crate::element::tet10::kernels::{self, FACTOR, WEIGHT};
use crate::lanes::block::{LANES, Lanes, gather, scatter};
use crate::lanes::{Node, Real};
use crate::mesh::tet::MIDSIDE_ENDS;
use crate::polar::matrices::{outer, product_of, times};
#[cfg(not(palpate_one_version))]
use multiversion::multiversion;

/// Numbers of the modulus at a point in principal axes: stretches 00, 11, 22, 12, 02, 01; then for each pair of axes
/// the derivative of a shear stress by the same shear, and the derivative by its transpose.
pub(crate) const MODULI: usize = 12;
pub(crate) const SAME: usize = 6;
pub(crate) const CROSSED: usize = 9;

/// The tangent at the points of a block.
#[derive(Clone, Debug)]
pub(crate) struct Tangents<T, const Q: usize> {
    /// Component `i` of left axis `k` in row `3 i + k`.
    pub(crate) axes: [[Lanes<T>; 9]; Q],
    /// The gradients of the barycentric coordinates along the right axes. Row `3 c + j` contains the component along
    /// axis `j` of the gradient of coordinate `c + 1`.
    pub(crate) gradients: [[Lanes<T>; 9]; Q],
    /// [`MODULI`] times the volume.
    pub(crate) moduli: [[Lanes<T>; MODULI]; Q],
}

/// How displacements of `N` nodes give derivatives by barycentric coordinates at `Q` points.
pub(crate) trait Cell<const N: usize, const Q: usize>:
    Clone + core::fmt::Debug + Send + Sync
{
    /// A factor that the derivatives lack and the gradients contain.
    const FACTOR: f64;

    /// Derivatives by coordinates 1, 2 and 3, minus the derivative by coordinate 0.
    fn spread<T: Real>(nodes: &[[u32; N]; LANES], of: &[Node<T>], points: &mut [[Lanes<T>; 9]; Q]);

    /// The transpose of `spread`: adds the forces that correspond to the derivatives to the nodes.
    fn collect<T: Real>(nodes: &[[u32; N]; LANES], points: &[[Lanes<T>; 9]; Q], to: &mut [Node<T>]);

    /// For each node, the derivatives of its shape function by the four coordinates at a point, without `FACTOR`.
    fn weights(point: usize) -> [[f64; 4]; N];
}

/// Linear tetrahedra.
#[derive(Clone, Debug)]
pub(crate) struct Four;

impl Cell<4, 1> for Four {
    const FACTOR: f64 = 1.0;

    #[inline(always)]
    fn spread<T: Real>(nodes: &[[u32; 4]; LANES], of: &[Node<T>], points: &mut [[Lanes<T>; 9]; 1]) {
        let mut vectors = [[[T::ZERO; 4]; LANES]; 3];
        gather(nodes, of, &mut vectors);
        let [point] = points;
        for lane in 0..LANES {
            let [a, b, c] = vectors_at(&vectors, lane);
            put(point, lane, 0, a);
            put(point, lane, 1, b);
            put(point, lane, 2, c);
        }
    }

    #[inline(always)]
    fn collect<T: Real>(
        nodes: &[[u32; 4]; LANES],
        points: &[[Lanes<T>; 9]; 1],
        to: &mut [Node<T>],
    ) {
        let mut vectors = [[[T::ZERO; 4]; LANES]; 3];
        for lane in 0..LANES {
            let [a, b, c] = at(&points[0], lane);
            vectors[0][lane] = node(a);
            vectors[1][lane] = node(b);
            vectors[2][lane] = node(c);
        }
        scatter(nodes, &vectors, to);
    }

    fn weights(_: usize) -> [[f64; 4]; 4] {
        core::array::from_fn(|a| core::array::from_fn(|c| f64::from(u8::from(a == c))))
    }
}

/// Quadratic tetrahedra: see `tet10::kernels`.
#[derive(Clone, Debug)]
pub(crate) struct Ten;

impl Cell<10, 4> for Ten {
    const FACTOR: f64 = FACTOR;

    #[inline(always)]
    fn spread<T: Real>(
        nodes: &[[u32; 10]; LANES],
        of: &[Node<T>],
        points: &mut [[Lanes<T>; 9]; 4],
    ) {
        let mut others = [[[T::ZERO; 4]; LANES]; 9];
        kernels::gather(nodes, of, &mut others);
        kernels::spread(&others, points);
    }

    #[inline(always)]
    fn collect<T: Real>(
        nodes: &[[u32; 10]; LANES],
        points: &[[Lanes<T>; 9]; 4],
        to: &mut [Node<T>],
    ) {
        let mut others = [[[T::ZERO; 4]; LANES]; 9];
        kernels::collect(points, &mut others);
        kernels::scatter(nodes, &others, to);
    }

    fn weights(point: usize) -> [[f64; 4]; 10] {
        let near = |corner: usize| if corner == point { 1.0 } else { 0.0 };
        let mut weights = [[0.0; 4]; 10];
        for c in 0..4 {
            weights[c][c] = near(c) - 0.25;
        }
        for (weights, [c, e]) in weights[4..].iter_mut().zip(MIDSIDE_ENDS) {
            weights[c] = WEIGHT + near(e);
            weights[e] = WEIGHT + near(c);
        }
        weights
    }
}

/// See [`PrincipalTets::product`](crate::element::tet::principal::PrincipalTets::product).
#[cfg_attr(
    not(palpate_one_version),
    multiversion(targets(
        "x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl+avx2+bmi1+bmi2",
        "x86_64+avx2+bmi1+bmi2"
    ))
)]
pub(crate) fn product<T: Real, C: Cell<N, Q>, const N: usize, const Q: usize>(
    (nodes, tangents): (&[[[u32; N]; LANES]], &[Tangents<T, Q>]),
    factor: T,
    u: &[Node<T>],
    y: &mut [Node<T>],
) {
    let mut points = [[[T::ZERO; LANES]; 9]; Q];
    for (nodes, tangents) in nodes.iter().zip(tangents) {
        C::spread(nodes, u, &mut points);
        for q in 0..Q {
            let (axes, gradients) = (&tangents.axes[q], &tangents.gradients[q]);
            let (moduli, point) = (&tangents.moduli[q], &mut points[q]);
            for lane in 0..LANES {
                let (axes, h) = (at(axes, lane), at(gradients, lane));
                let f = outer(&product_of(&at(point, lane), &axes), &h);
                let c = |k: usize| factor * moduli[k][lane];
                let (s12, s02, s01) = (moduli[3][lane], moduli[4][lane], moduli[5][lane]);
                let stretch = [
                    factor * (moduli[0][lane] * f[0][0] + s01 * f[1][1] + s02 * f[2][2]),
                    factor * (s01 * f[0][0] + moduli[1][lane] * f[1][1] + s12 * f[2][2]),
                    factor * (s02 * f[0][0] + s12 * f[1][1] + moduli[2][lane] * f[2][2]),
                ];
                let [a12, a02, a01] = [c(SAME), c(SAME + 1), c(SAME + 2)];
                let [b12, b02, b01] = [c(CROSSED), c(CROSSED + 1), c(CROSSED + 2)];
                let p = [
                    [
                        stretch[0],
                        a01 * f[0][1] + b01 * f[1][0],
                        a02 * f[0][2] + b02 * f[2][0],
                    ],
                    [
                        a01 * f[1][0] + b01 * f[0][1],
                        stretch[1],
                        a12 * f[1][2] + b12 * f[2][1],
                    ],
                    [
                        a02 * f[2][0] + b02 * f[0][2],
                        a12 * f[2][1] + b12 * f[1][2],
                        stretch[2],
                    ],
                ];
                put(point, lane, 0, times(&axes, times(&p, h[0])));
                put(point, lane, 1, times(&axes, times(&p, h[1])));
                put(point, lane, 2, times(&axes, times(&p, h[2])));
            }
        }
        C::collect(nodes, &points, y);
    }
}
