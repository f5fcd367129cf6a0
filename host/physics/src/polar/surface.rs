//! Polar decomposition `F = R U` of the 3 x 2 deformation gradient of a surface, in closed form; see
//! [`membrane`](crate::element::triangle::membrane) for the formulas.

use crate::Vec3;

/// The least stretch by which the out-of-plane part of the tangent divides. A triangle that is crushed to a hundredth
/// must not make the matrix arbitrarily stiff.
pub(crate) const STRETCH_FLOOR: f64 = 0.01;

/// Polar decomposition of a deformation gradient, with the terms that the force and the tangent need.
pub(crate) struct Polar {
    /// Columns of the 3 x 2 rotation.
    pub(crate) r: [Vec3; 2],
    pub(crate) n: Vec3,
    /// `U`: xx, xy, yy.
    pub(crate) u: [f64; 3],
    /// `tr U`.
    pub(crate) trace: f64,
}

impl Polar {
    pub(crate) fn new(f1: &Vec3, f2: &Vec3) -> Self {
        let c = [f1.dot(f1), f1.dot(f2), f2.dot(f2)];
        let trace_c = c[0] + c[2];
        // A triangle that is shrunk to a point has no direction. Any frame is valid.
        if trace_c < 1e-200 {
            return Self {
                r: [Vec3::x(), Vec3::y()],
                n: Vec3::z(),
                u: [0.0; 3],
                trace: 0.0,
            };
        }
        let cross = f1.cross(f2);
        let s = cross.norm();
        let n = if s > 1e-14 * trace_c {
            cross / s
        } else {
            normal_of_line(if c[0] >= c[2] { f1 } else { f2 })
        };
        let q = libm::sqrt(trace_c + 2.0 * s);
        Self {
            r: [(f1 + f2.cross(&n)) / q, (f2 + n.cross(f1)) / q],
            n,
            u: [(c[0] + s) / q, c[1] / q, (c[2] + s) / q],
            trace: q,
        }
    }

    /// Principal stretches, the larger first.
    pub(crate) fn stretches(&self) -> [f64; 2] {
        let mean = 0.5 * (self.u[0] + self.u[2]);
        let radius = libm::hypot(0.5 * (self.u[0] - self.u[2]), self.u[1]);
        [mean + radius, mean - radius]
    }

    /// The tensor (xx, xy, yy) with the principal axes of `U` that has the principal `values` if `U` has the
    /// `stretches`.
    pub(crate) fn with_principal(&self, stretches: [f64; 2], values: [f64; 2]) -> [f64; 3] {
        // S = s_2 I + (s_1 - s_2) v_1 v_1^T and v_1 v_1^T = (U - l_2 I) / (l_1 - l_2). The quotient of the
        // differences is bounded, so nearly equal stretches lose no digits.
        let gap = stretches[0] - stretches[1];
        let slope = if gap > 1e-14 * stretches[0] {
            (values[0] - values[1]) / gap
        } else {
            0.0
        };
        let [xx, xy, yy] = self.u;
        [
            values[1] + slope * (xx - stretches[1]),
            slope * xy,
            values[1] + slope * (yy - stretches[1]),
        ]
    }
}

/// A unit vector perpendicular to `line`, a function of `line` alone.
fn normal_of_line(line: &Vec3) -> Vec3 {
    let axis = match line.iamin() {
        0 => Vec3::x(),
        1 => Vec3::y(),
        _ => Vec3::z(),
    };
    line.cross(&axis).normalize()
}
