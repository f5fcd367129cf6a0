//! The vector operations of conjugate gradients, each in one pass. Each is compiled for the widest registers that make
//! it faster.
//!
//! Sums have sixteen lanes that are added at the end. The result has the same bytes on every machine.
//!
//! [`dot_single`] and [`advance`] use AVX2 at most. With AVX-512, LLVM gathers and scatters four nodes at once and
//! keeps the sums in memory, which takes about ten times as long.

use crate::lanes::{Node, Real};
#[cfg(not(palpate_one_version))]
use multiversion::multiversion;

/// Number of nodes that are summed side by side.
const SIDE: usize = 4;

/// The sum of all lanes.
#[inline(always)]
fn add_up<T: Real>(sums: &[Node<T>; SIDE]) -> f64 {
    let mut total = 0.0;
    for sum in sums {
        for lane in sum {
            total += lane.to_f64();
        }
    }
    total
}

/// Sets `z` to `r` in single precision, over the length of `z`.
#[cfg_attr(
    not(palpate_one_version),
    multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw+avx2", "x86_64+avx2"))
)]
pub(crate) fn round<T: Real>(r: &[Node<T>], z: &mut [Node<f32>]) {
    for (z, r) in z.iter_mut().zip(r) {
        for i in 0..4 {
            z[i] = r[i].to_f64() as f32;
        }
    }
}

/// Sets `z` to `factor r` in single precision, over the length of `z`.
#[cfg_attr(
    not(palpate_one_version),
    multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw+avx2", "x86_64+avx2"))
)]
pub(crate) fn round_scaled<T: Real>(factor: f64, r: &[Node<T>], z: &mut [Node<f32>]) {
    for (z, r) in z.iter_mut().zip(r) {
        for i in 0..4 {
            z[i] = (factor * r[i].to_f64()) as f32;
        }
    }
}

/// `z . r`, over the length of `z`.
#[cfg_attr(not(palpate_one_version), multiversion(targets("x86_64+avx2")))]
pub(crate) fn dot_single<T: Real>(z: &[Node<f32>], r: &[Node<T>]) -> f64 {
    let mut sums = [[T::ZERO; 4]; SIDE];
    let r = &r[..z.len()];
    for (z, r) in z.chunks(SIDE).zip(r.chunks(SIDE)) {
        for ((sum, z), r) in sums.iter_mut().zip(z).zip(r) {
            for i in 0..4 {
                sum[i] += T::of(f64::from(z[i])) * r[i];
            }
        }
    }
    add_up(&sums)
}

/// `a . b`, over the smaller length.
#[cfg_attr(
    not(palpate_one_version),
    multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw+avx2", "x86_64+avx2"))
)]
pub(crate) fn dot<T: Real>(a: &[Node<T>], b: &[Node<T>]) -> f64 {
    let mut sums = [[T::ZERO; 4]; SIDE];
    for (a, b) in a.chunks(SIDE).zip(b.chunks(SIDE)) {
        for ((sum, a), b) in sums.iter_mut().zip(a).zip(b) {
            for i in 0..4 {
                sum[i] += a[i] * b[i];
            }
        }
    }
    add_up(&sums)
}

/// `p := z + beta p` and `q := m p`, over the length of `z`.
#[cfg_attr(
    not(palpate_one_version),
    multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw+avx2", "x86_64+avx2"))
)]
pub(crate) fn turn<T: Real>(
    z: &[Node<f32>],
    beta: T,
    mass: &[T],
    p: &mut [Node<T>],
    q: &mut [Node<T>],
) {
    for (((p, q), z), &mass) in p.iter_mut().zip(q).zip(z).zip(mass) {
        for i in 0..4 {
            p[i] = T::of(f64::from(z[i])) + beta * p[i];
            q[i] = mass * p[i];
        }
    }
}

/// `u := u + alpha p` and `r := r - alpha q`; returns `r . r`.
#[cfg_attr(not(palpate_one_version), multiversion(targets("x86_64+avx2")))]
pub(crate) fn advance<T: Real>(
    alpha: T,
    p: &[Node<T>],
    q: &[Node<T>],
    u: &mut [Node<T>],
    r: &mut [Node<T>],
) -> f64 {
    let mut sums = [[T::ZERO; 4]; SIDE];
    let (p, q) = (p.chunks(SIDE), q.chunks(SIDE));
    for (((p, q), u), r) in p.zip(q).zip(u.chunks_mut(SIDE)).zip(r.chunks_mut(SIDE)) {
        for ((((sum, p), q), u), r) in sums.iter_mut().zip(p).zip(q).zip(u).zip(r) {
            for i in 0..4 {
                u[i] += alpha * p[i];
                r[i] -= alpha * q[i];
                sum[i] += r[i] * r[i];
            }
        }
    }
    add_up(&sums)
}

/// `y := y + factor x`, over the smaller length.
#[cfg_attr(
    not(palpate_one_version),
    multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw+avx2", "x86_64+avx2"))
)]
pub(crate) fn add_single(factor: f32, x: &[Node<f32>], y: &mut [Node<f32>]) {
    for (y, x) in y.iter_mut().zip(x) {
        for i in 0..4 {
            y[i] += factor * x[i];
        }
    }
}

/// `v := mask v`, over the length of the mask.
pub(crate) fn filter<T: Real, U: Real>(mask: &[Node<T>], v: &mut [Node<U>]) {
    for (v, mask) in v.iter_mut().zip(mask) {
        for i in 0..4 {
            v[i] = v[i] * U::of(mask[i].to_f64());
        }
    }
}
