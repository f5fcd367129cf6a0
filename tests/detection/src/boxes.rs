//! The boxes of the triangles, grown by half of the distance that is searched.

use super::NEED;
use super::narrow::Things;
use physics::Vec3;

/// Above the error of a coordinate of half a metre in single precision (m).
const ROUNDING: f64 = 1e-7;

/// The corners of the box of each triangle (m).
pub(crate) fn of(things: &Things, x: &[Vec3], boxes: &mut Vec<[[f32; 3]; 2]>) {
    boxes.clear();
    boxes.extend(things.surfaces.triangles.iter().map(|corners| {
        let [a, b, c] = corners.map(|vertex| x[vertex as usize]);
        let grown = Vec3::repeat(0.5 * NEED + ROUNDING);
        let (least, most) = (a.inf(&b).inf(&c) - grown, a.sup(&b).sup(&c) + grown);
        [least, most].map(|corner| [corner.x as f32, corner.y as f32, corner.z as f32])
    }));
}
