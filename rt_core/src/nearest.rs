//! The point of a triangle that is nearest to another point.
//!
//! The regions of a triangle are told apart as in Ericson, *Real-Time Collision Detection* (2005), section 5.1.5.

use crate::geometry::Vec3;

/// The weights of the corners at the point of a triangle that is nearest to `point`. They sum to one and are not negative.
/// A triangle without area has the weights of its nearest corner or edge.
pub(crate) fn weights(point: &Vec3, [a, b, c]: [&Vec3; 3]) -> [f64; 3] {
    let (ab, ac) = (b - a, c - a);
    let from_a = point - a;
    let (d1, d2) = (ab.dot(&from_a), ac.dot(&from_a));
    if d1 <= 0.0 && d2 <= 0.0 {
        return [1.0, 0.0, 0.0];
    }
    let from_b = point - b;
    let (d3, d4) = (ab.dot(&from_b), ac.dot(&from_b));
    if d3 >= 0.0 && d4 <= d3 {
        return [0.0, 1.0, 0.0];
    }
    let from_c = point - c;
    let (d5, d6) = (ab.dot(&from_c), ac.dot(&from_c));
    if d6 >= 0.0 && d5 <= d6 {
        return [0.0, 0.0, 1.0];
    }
    let beyond_ab = d1 * d4 - d3 * d2;
    if beyond_ab <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let along = d1 / (d1 - d3);
        return [1.0 - along, along, 0.0];
    }
    let beyond_ac = d5 * d2 - d1 * d6;
    if beyond_ac <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let along = d2 / (d2 - d6);
        return [1.0 - along, 0.0, along];
    }
    let beyond_bc = d3 * d6 - d5 * d4;
    let (to_c, to_b) = (d4 - d3, d5 - d6);
    if beyond_bc <= 0.0 && to_c >= 0.0 && to_b >= 0.0 {
        let along = to_c / (to_c + to_b);
        return [0.0, 1.0 - along, along];
    }
    let sum = beyond_ab + beyond_ac + beyond_bc;
    let (at_b, at_c) = (beyond_ac / sum, beyond_ab / sum);
    [1.0 - at_b - at_c, at_b, at_c]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn at(weights: [f64; 3], corners: [&Vec3; 3]) -> Vec3 {
        let each = weights.iter().zip(corners);
        each.map(|(weight, corner)| corner * *weight).sum()
    }

    proptest! {
        #[test]
        fn no_other_point_of_the_triangle_is_nearer(
            numbers in proptest::array::uniform12(-1.0..1.0_f64),
            other in proptest::array::uniform2(0.0..1.0_f64),
        ) {
            let [p, a, b, c] = [0, 3, 6, 9].map(|from| Vec3::from_column_slice(&numbers[from..from + 3]));
            let corners = [&a, &b, &c];
            let found = weights(&p, corners);
            prop_assert!(found.iter().all(|weight| *weight >= -1e-12));
            prop_assert!((found.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            let root = other[0].sqrt();
            let any = [1.0 - root, root * (1.0 - other[1]), root * other[1]];
            let [nearest, further] = [found, any].map(|weights| (at(weights, corners) - p).norm());
            // Rounding of the distances of a thin triangle.
            prop_assert!(nearest <= further + 1e-9);
        }
    }

    #[test]
    fn a_triangle_without_area_is_an_edge_or_a_point() {
        let (a, b) = (Vec3::zeros(), Vec3::x());
        assert_eq!(weights(&Vec3::new(0.25, 1.0, 0.0), [&a, &b, &b])[0], 0.75);
        let found = weights(&Vec3::z(), [&a, &a, &a]);
        assert_eq!(found.iter().sum::<f64>(), 1.0);
    }
}
