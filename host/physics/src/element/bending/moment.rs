//! The moments in the triangles of a sheet, for reports.
//!
//! The slope at each side of a triangle feels the moment `A M . b_e` with the triangle's area, the moments `M` per width
//! and the curvature `b_e` that a unit slope makes. The three sides together determine the three components of `M`.
//! Nothing resists the slope at a border, where the moment is zero.

use super::exact::Bending;
use super::sheet::BentSheet;
use crate::element::triangle::frame::{rest_axes, rest_frame};
use crate::{Mat3, Vec3};

impl BentSheet {
    /// The stress (Pa) that bending adds on the face of a triangle at the side of its normal, in world axes: `-6 M / t^2`
    /// with the moment `M` per width and the thickness `t`. The other face has the opposite stress. `rest` and `x` are the
    /// positions of the vertices at the start and at present (m), and `nodes` is the vertex of each place in `bending`.
    pub(crate) fn stress(
        &self,
        triangle: usize,
        bending: &Bending,
        (rest, x): (&[Vec3], &[Vec3]),
        nodes: &[u32],
    ) -> Mat3 {
        let corners = self.triangles[triangle].map(|vertex| vertex as usize);
        let Some((gradients, area)) = rest_frame(self.corners(triangle, rest).each_ref()) else {
            return Mat3::zeros();
        };
        let (bends, _) = super::build::bends(gradients, area);
        let felt = Vec3::from(bending.moments(triangle, x, nodes));
        let rows = Mat3::from_rows(&bends.map(|bend| bend.transpose()));
        let Some(inverse) = rows.try_inverse() else {
            return Mat3::zeros();
        };
        let moment = inverse * felt / area;
        let [a1, a2] = rest_axes(corners.map(|vertex| &x[vertex]));
        let mixed = a1 * a2.transpose();
        let tensor = a1 * a1.transpose() * moment.x
            + a2 * a2.transpose() * moment.y
            + (mixed + mixed.transpose()) * moment.z;
        let thickness = self.plate(triangle).thickness;
        tensor * (-6.0 / (thickness * thickness))
    }
}
