//! Polar decomposition of a triangle's deformation gradient, strain and the part of its tangent out of the plane.
//!
//! Closed forms of straight arithmetic, for loops over lanes (see `triangle::kernels`).

use super::surface::STRETCH_FLOOR;
use crate::lanes::Real;

pub(crate) type Vector<T> = [T; 3];

/// xx, xy, yy of a symmetric matrix in the plane of a triangle.
pub(crate) type Plane<T> = [T; 3];

/// `F = R U` of a triangle.
pub(crate) struct Polar<T> {
    pub(crate) r: [Vector<T>; 2],
    pub(crate) n: Vector<T>,
    /// `U - I`.
    pub(crate) strain: Plane<T>,
    /// The inverse of `tr U`, bounded by the inverse of twice the least stretch.
    pub(crate) over_trace: T,
}

/// The polar decomposition of `F = frame + h`, as in [`membrane`](crate::element::triangle::membrane).
///
/// The strain is `(C - I) (U + I)^-1` with `C - I` from `h`, and `(U + I)^-1` is `(I + adj U) / det(U + I)`. A small
/// strain without rotation keeps its digits. With a rotation, `h` is not small and its terms in `C - I` cancel. The
/// error is one rounding times the angle (rad), in single precision at most 1e-7 of the moduli.
#[inline(always)]
pub(crate) fn polar<T: Real>(frame: &[Vector<T>; 2], h: &[Vector<T>; 2]) -> Polar<T> {
    let one = T::of(1.0);
    let [a1, a2] = *frame;
    let [h1, h2] = *h;
    let (mut f1, mut f2) = (sum(a1, h1), sum(a2, h2));
    let e = [
        dot(sum(a1, f1), h1),
        dot(f1, h2) + dot(a2, h1),
        dot(sum(a2, f2), h2),
    ];

    // Rounding leaves no direction in a triangle that is shrunk to a point. Any frame is valid.
    let point = dot(f1, f1) + dot(f2, f2) < T::EPSILON * T::EPSILON;
    let (x, y) = (
        [T::EPSILON, T::ZERO, T::ZERO],
        [T::ZERO, T::EPSILON, T::ZERO],
    );
    f1 = select(point, x, f1);
    f2 = select(point, y, f2);
    let c = [dot(f1, f1), dot(f1, f2), dot(f2, f2)];
    let trace_c = c[0] + c[2];

    // A triangle that is shrunk to a line has many normals. One of them is chosen. In double precision the bound is
    // 1e-14.
    let cross_product = cross(f1, f2);
    let thin = T::of(45.0) * T::EPSILON * trace_c;
    let flat = dot(cross_product, cross_product) > thin * thin;
    let line = select(c[0] >= c[2], f1, f2);
    let normal = select(flat, cross_product, across(line));
    let length = dot(normal, normal).sqrt();
    let n = times(normal, one / length);
    let s = if flat { length } else { T::ZERO };

    let q = (trace_c + (s + s)).sqrt();
    let w = s + q + one;
    let over = one / (q * w);
    let (over_q, over_w) = (over * w, over * q);
    let u = [(c[0] + s) * over_q, c[1] * over_q, (c[2] + s) * over_q];
    let strain = [
        (e[0] * (one + u[2]) - e[1] * u[1]) * over_w,
        (e[1] * (one + u[0]) - e[0] * u[1]) * over_w,
        (e[2] * (one + u[0]) - e[1] * u[1]) * over_w,
    ];
    Polar {
        r: [
            times(sum(f1, cross(f2, n)), over_q),
            times(sum(f2, cross(n, f1)), over_q),
        ],
        n,
        strain,
        over_trace: smaller(over_q, T::of(0.5 / STRETCH_FLOOR)),
    }
}

/// The positive part of `stress U^-1` at `strain = U - I`; `twice` is twice the shear modulus.
///
/// The principal values `v_k` are the principal stresses over the stretches, and the tensor is
/// `v_2 I + (v_1 - v_2) / (e_1 - e_2) (strain - e_2 I)`. The quotient is multiplied by the gap `e_1 - e_2` again, so
/// its error is that of the values.
#[inline(always)]
pub(crate) fn out_of_plane<T: Real>(strain: &Plane<T>, twice: T, pressure: T) -> Plane<T> {
    let (one, half) = (T::of(1.0), T::of(0.5));
    let mean = half * (strain[0] + strain[2]);
    let difference = half * (strain[0] - strain[2]);
    let radius = (difference * difference + strain[1] * strain[1]).sqrt();
    let principal = [mean + radius, mean - radius];
    let stress = principal.map(|e| larger(T::ZERO, twice * e + pressure));
    let stretch = principal.map(|e| larger(one + e, T::of(STRETCH_FLOOR)));
    let gap = if radius > T::ZERO {
        radius + radius
    } else {
        one
    };
    // One division for three.
    let over = one / (stretch[0] * stretch[1] * gap);
    let slope = (stress[0] * stretch[1] - stress[1] * stretch[0]) * over;
    let least = stress[1] * stretch[0] * gap * over;
    [
        least + slope * (radius + difference),
        slope * strain[1],
        least + slope * (radius - difference),
    ]
}

/// The cross product of `v` and the axis to which `v` is most nearly perpendicular.
#[inline(always)]
fn across<T: Real>(v: Vector<T>) -> Vector<T> {
    let [x, y, z] = v.map(|c| larger(c, -c));
    let by_x = [T::ZERO, v[2], -v[1]];
    let by_y = [-v[2], T::ZERO, v[0]];
    let by_z = [v[1], -v[0], T::ZERO];
    select(x <= smaller(y, z), by_x, select(y <= z, by_y, by_z))
}

#[inline(always)]
pub(crate) fn sum<T: Real>(a: Vector<T>, b: Vector<T>) -> Vector<T> {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[inline(always)]
pub(crate) fn times<T: Real>(v: Vector<T>, factor: T) -> Vector<T> {
    [v[0] * factor, v[1] * factor, v[2] * factor]
}

#[inline(always)]
pub(crate) fn combine<T: Real>(a: Vector<T>, of_a: T, b: Vector<T>, of_b: T) -> Vector<T> {
    sum(times(a, of_a), times(b, of_b))
}

#[inline(always)]
pub(crate) fn dot<T: Real>(a: Vector<T>, b: Vector<T>) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
pub(crate) fn cross<T: Real>(a: Vector<T>, b: Vector<T>) -> Vector<T> {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

#[inline(always)]
fn select<T: Real>(condition: bool, yes: Vector<T>, no: Vector<T>) -> Vector<T> {
    let choose = |i: usize| if condition { yes[i] } else { no[i] };
    [choose(0), choose(1), choose(2)]
}

#[inline(always)]
pub(crate) fn larger<T: Real>(a: T, b: T) -> T {
    if a > b { a } else { b }
}

#[inline(always)]
fn smaller<T: Real>(a: T, b: T) -> T {
    if a < b { a } else { b }
}
