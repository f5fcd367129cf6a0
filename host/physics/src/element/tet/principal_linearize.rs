//! Forces, energies and clipped tangents of isotropic laws on blocks of tetrahedra, compiled once for each width of
//! vector instructions.
//!
//! At each point the principal axes are found from those of the previous call. Lanes in which the axes do not converge,
//! whose left axes are not defined or whose stretches have an indefinite modulus are rare. These lanes are computed again
//! one by one.
//!
//! Stresses and energies are computed in double precision whatever the precision of the step. The energy of a turned
//! element is a difference of terms as large as the modulus of its material.
//!
//! Loops over lanes must stay loops until the compiler makes vectors of them: see `hooke_kernels`.

use super::cell::Cell;
use super::hooke_kernels::deformation;
use super::principal_kernels::{CROSSED, MODULI, SAME, Tangents};
use crate::Mat3;
use crate::lanes::block::{LANES, Lanes, at, put, quaternion_at, sum};
use crate::lanes::{Node, Real};
use crate::material::law::isotropic::{clipped, is_definite, symmetric};
use crate::material::law::lane_law::{LaneLame, LaneLaw, LaneModuli};
use crate::polar::axes::{Decomposed, decompose, green, sweep};
use crate::polar::lanes::{self, Matrix, of_rotation};
use crate::polar::matrices::{product_of, times};
use crate::polar::svd::svd_from;
#[cfg(not(palpate_one_version))]
use multiversion::multiversion;

/// The largest number of sweeps over the axes in a call. After these the singular values are computed one by one.
const MAX_SWEEPS: usize = 8;

/// The constant data of a block.
#[derive(Clone, Debug)]
pub(crate) struct Rest<T, const Q: usize> {
    /// At each point, component `j` of the gradient of barycentric coordinate `c + 1` in row `3 c + j` (1/m), zero in
    /// lanes that pad the block.
    pub(crate) gradients: [[Lanes<T>; 9]; Q],
    /// The Lame parameters times the volume of each point.
    pub(crate) mu: [Lanes<T>; Q],
    pub(crate) lambda: [Lanes<T>; Q],
}

impl<T: Real, const Q: usize> Rest<T, Q> {
    #[inline(always)]
    fn lame(&self, q: usize, lane: usize) -> LaneLame<T> {
        LaneLame {
            mu: self.mu[q][lane],
            lambda: self.lambda[q][lane],
        }
    }
}

/// The right axes of the points of a block as quaternions, by component.
pub(crate) type Axes<T, const Q: usize> = [[Lanes<T>; 4]; Q];

/// See [`PrincipalTets::linearize`](crate::element::tet::principal::PrincipalTets::linearize).
#[cfg_attr(
    not(palpate_one_version),
    multiversion(targets(
        "x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl+avx2+bmi1+bmi2",
        "x86_64+avx2+bmi1+bmi2"
    ))
)]
pub(crate) fn linearize<T: Real, L: LaneLaw, C: Cell<N, Q>, const N: usize, const Q: usize>(
    (nodes, rest): (&[[[u32; N]; LANES]], &[Rest<T, Q>]),
    (axes, tangents): (&mut [Axes<T, Q>], &mut [Tangents<T, Q>]),
    d: &[Node<T>],
    force: &mut [Node<T>],
) -> T::Wide {
    let mut energies = [<T::Wide as Real>::ZERO; LANES];
    let mut derivatives = C::zero::<T>();
    let mut h = [[T::ZERO; LANES]; 9];
    let state = axes.iter_mut().zip(tangents);
    for ((nodes, rest), (axes, tangents)) in nodes.iter().zip(rest).zip(state) {
        C::spread(nodes, d, &mut derivatives);
        for q in 0..Q {
            deformation::<T, C, N, Q>(&rest.gradients[q], &derivatives, q, &mut h);
            find_axes(&h, &mut axes[q]);
            modulus::<T, L, Q>(rest, q, &h, &axes[q], tangents);
            for lane in 0..LANES {
                let h = at(&h, lane).map(|row| row.map(Real::widen));
                let (energy, stress) = L::respond(rest.lame(q, lane).widen(), &h);
                energies[lane] += energy;
                let pull = stress.map(|row| row.map(|entry| -T::narrow(entry)));
                let g = at(&rest.gradients[q], lane);
                for c in 0..3 {
                    C::put(&mut derivatives, q, lane, c, times(&pull, g[c]));
                }
            }
        }
        C::collect(nodes, &mut derivatives, force);
    }
    sum(&energies)
}

/// Computes the right axes at a point of a block.
#[inline(always)]
fn find_axes<T: Real>(h: &[Lanes<T>; 9], axes: &mut [Lanes<T>; 4]) {
    let mut strains = [[T::ZERO; LANES]; 6];
    for lane in 0..LANES {
        let strain = green(&at(h, lane));
        for k in 0..6 {
            strains[k][lane] = strain[k];
        }
    }
    for _ in 0..MAX_SWEEPS {
        let mut open = 0_u32;
        for lane in 0..LANES {
            let strain = [0, 1, 2, 3, 4, 5].map(|k| strains[k][lane]);
            let (q, done) = sweep(quaternion_at(axes, lane), &strain);
            for k in 0..4 {
                axes[k][lane] = q[k];
            }
            open += u32::from(!done);
        }
        if open == 0 {
            return;
        }
    }
    find_axes_singly(h, axes);
}

/// Computes the axes one by one, by one-sided rotations if the sweeps have not converged. The axes are always finite.
#[cold]
#[inline(never)]
fn find_axes_singly<T: Real>(h: &[Lanes<T>; 9], axes: &mut [Lanes<T>; 4]) {
    for lane in 0..LANES {
        let h = at(h, lane);
        let (mut q, done) = sweep(quaternion_at(axes, lane), &green(&h));
        if !done {
            q = of_rotation(&svd_from(&gradient(&h), &Mat3::identity()).v);
        }
        for k in 0..4 {
            axes[k][lane] = q[k];
        }
    }
}

/// Computes the tangent at point `q` of a block from the right axes.
#[inline(always)]
fn modulus<T: Real, L: LaneLaw, const Q: usize>(
    rest: &Rest<T, Q>,
    q: usize,
    h: &[Lanes<T>; 9],
    axes: &[Lanes<T>; 4],
    tangents: &mut Tangents<T, Q>,
) {
    let mut odd = 0_u32;
    for lane in 0..LANES {
        let (found, unique) = decompose(quaternion_at(axes, lane), &at(h, lane));
        let moduli = L::moduli(rest.lame(q, lane), found.s);
        odd += u32::from(!(unique && is_definite(&moduli.stretch)));
        put_tangent(
            tangents,
            q,
            lane,
            &at(&rest.gradients[q], lane),
            &found,
            &moduli,
        );
    }
    if odd > 0 {
        modulus_singly::<T, L, Q>(rest, q, h, axes, tangents);
    }
}

/// Computes the tangents one by one that the loop over lanes has not computed.
#[cold]
#[inline(never)]
fn modulus_singly<T: Real, L: LaneLaw, const Q: usize>(
    rest: &Rest<T, Q>,
    q: usize,
    h: &[Lanes<T>; 9],
    axes: &[Lanes<T>; 4],
    tangents: &mut Tangents<T, Q>,
) {
    for lane in 0..LANES {
        let h = at(h, lane);
        let axes = quaternion_at(axes, lane);
        let (mut found, unique) = decompose(axes, &h);
        if !unique {
            let svd = svd_from(&gradient(&h), &lanes::matrix(axes));
            found = Decomposed {
                u: rounded(&svd.u),
                s: [0, 1, 2].map(|k| T::of(svd.s[k])),
                v: rounded(&svd.v),
            };
        }
        let mut moduli = L::moduli(rest.lame(q, lane), found.s);
        if unique && is_definite(&moduli.stretch) {
            continue;
        }
        let stretch = clipped(&symmetric(&moduli.stretch.map(Real::to_f64)));
        let entries = [(0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)];
        moduli.stretch = entries.map(|entry| T::of(stretch[entry]));
        put_tangent(
            tangents,
            q,
            lane,
            &at(&rest.gradients[q], lane),
            &found,
            &moduli,
        );
    }
}

/// Stores the tangent of one lane, its twists and flips clipped.
#[inline(always)]
fn put_tangent<T: Real, const Q: usize>(
    tangents: &mut Tangents<T, Q>,
    q: usize,
    lane: usize,
    gradients: &Matrix<T>,
    found: &Decomposed<T>,
    moduli: &LaneModuli<T>,
) {
    let (axes, rows) = (&mut tangents.axes[q], &mut tangents.gradients[q]);
    let turned = product_of(gradients, &found.v);
    for i in 0..3 {
        put(axes, lane, i, found.u[i]);
        put(rows, lane, i, turned[i]);
    }
    let rows: &mut [Lanes<T>; MODULI] = &mut tangents.moduli[q];
    for k in 0..6 {
        rows[k][lane] = moduli.stretch[k];
    }
    let half = T::of(0.5);
    for k in 0..3 {
        let (twist, flip) = (clip(moduli.twist[k]), clip(moduli.flip[k]));
        rows[SAME + k][lane] = half * (flip + twist);
        rows[CROSSED + k][lane] = half * (flip - twist);
    }
}

/// Zero instead of a negative eigenvalue.
#[inline(always)]
fn clip<T: Real>(eigenvalue: T) -> T {
    if eigenvalue > T::ZERO {
        eigenvalue
    } else {
        T::ZERO
    }
}

/// `I + H`.
fn gradient<T: Real>(h: &Matrix<T>) -> Mat3 {
    Mat3::from_fn(|i, j| h[i][j].to_f64()) + Mat3::identity()
}

fn rounded<T: Real>(m: &Mat3) -> Matrix<T> {
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| T::of(m[(i, j)])))
}
