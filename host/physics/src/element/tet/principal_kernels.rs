//! Products with the tangent of isotropic laws on blocks of tetrahedra, compiled once for each width of vector
//! instructions.
//!
//! Loops over lanes must stay loops until the compiler makes vectors of them: see `hooke_kernels`.

use super::cell::Cell;
use crate::lanes::block::{LANES, Lanes, at};
use crate::lanes::{Node, Real};
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
    let mut derivatives = C::zero::<T>();
    for (nodes, tangents) in nodes.iter().zip(tangents) {
        C::spread(nodes, u, &mut derivatives);
        for q in 0..Q {
            let (axes, gradients) = (&tangents.axes[q], &tangents.gradients[q]);
            let moduli = &tangents.moduli[q];
            for lane in 0..LANES {
                let (axes, h) = (at(axes, lane), at(gradients, lane));
                let f = outer(&product_of(&C::at(&derivatives, q, lane), &axes), &h);
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
                C::put(&mut derivatives, q, lane, 0, times(&axes, times(&p, h[0])));
                C::put(&mut derivatives, q, lane, 1, times(&axes, times(&p, h[1])));
                C::put(&mut derivatives, q, lane, 2, times(&axes, times(&p, h[2])));
            }
        }
        C::collect(nodes, &mut derivatives, y);
    }
}
