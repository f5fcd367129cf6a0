//! The direction along which a device's force and motion are drawn: the principal direction of the force, or a direction
//! that a person chooses.

use nalgebra::{Matrix3, SymmetricEigen, Vector3};

use super::reduce::usable;

/// A direction within 18 degrees of an axis of the world is drawn as that axis (cosine of the angle).
const SNAP: f64 = 0.95;

/// The component of a force that a picture shows. Pictures of the same component of different runs can be compared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Component {
    /// The component along the principal direction of the force, which each picture finds by itself.
    #[default]
    Principal,
    /// The component along an axis of the scene: 0 for x, 1 for y, 2 for z.
    Axis(usize),
    /// The norm.
    Norm,
}

impl Component {
    /// The component of `vector` along the axis, or its norm; the norm if a picture finds its direction by itself.
    pub fn of(self, vector: &Vector3<f64>) -> f64 {
        match self {
            Self::Axis(axis) => vector.get(axis).copied().unwrap_or_default(),
            Self::Principal | Self::Norm => vector.norm(),
        }
    }

    /// The words of a label about the component, after the name of the quantity; the norm if a picture finds its direction by
    /// itself.
    pub fn label(self) -> String {
        match self {
            Self::Axis(axis) => format!(" along {}", AXES.get(axis).copied().unwrap_or_default()),
            Self::Principal | Self::Norm => ", norm".to_owned(),
        }
    }
}

const AXES: [&str; 3] = ["x", "y", "z"];

/// A direction in the scene.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Direction {
    /// Unit vector; its largest component is positive.
    pub(super) axis: Vector3<f64>,
    /// The name of the direction in labels: `x`, or its components.
    pub(super) name: String,
}

/// The principal direction of the force; without force, that of the motion; without both, x.
pub(super) fn main_direction(force: &[[f64; 3]], position: &[[f64; 3]]) -> Direction {
    let start = first_usable(position);
    let moved = position.iter().map(|p| Vector3::from(*p) - start);
    let axis = principal(force.iter().copied().map(Vector3::from))
        .or_else(|| principal(moved))
        .unwrap_or_else(Vector3::x);
    for (i, name) in AXES.into_iter().enumerate() {
        if axis[i] > SNAP {
            let mut snapped = Vector3::zeros();
            snapped[i] = 1.0;
            return Direction {
                axis: snapped,
                name: name.to_owned(),
            };
        }
    }
    // Adding zero turns -0 into 0.
    let [x, y, z]: [f64; 3] = axis.map(|x| (100.0 * x).round() / 100.0 + 0.0).into();
    let name = format!("({x:.2}, {y:.2}, {z:.2})").replace('-', "−");
    Direction { axis, name }
}

/// The first usable position, from which displacements are measured.
pub(super) fn first_usable(position: &[[f64; 3]]) -> Vector3<f64> {
    let found = position.iter().find(|p| p.iter().all(|x| usable(*x)));
    found.map_or_else(Vector3::zeros, |p| Vector3::from(*p))
}

/// The direction along which `vectors` have the largest sum of squares; `None` if all vectors are zero.
fn principal(vectors: impl Iterator<Item = Vector3<f64>> + Clone) -> Option<Vector3<f64>> {
    let usable = vectors.filter(|v| v.iter().all(|x| usable(*x)));
    let scale = usable
        .clone()
        .fold(0.0, |largest: f64, v| largest.max(v.amax()));
    if scale == 0.0 {
        return None;
    }
    let moment = usable.fold(Matrix3::zeros(), |sum: Matrix3<f64>, v| {
        let v = v / scale;
        sum + v * v.transpose()
    });
    let eigen = SymmetricEigen::try_new(moment, f64::EPSILON, 100)?;
    let axis = eigen
        .eigenvectors
        .column(eigen.eigenvalues.imax())
        .normalize();
    Some(if axis[axis.iamax()] < 0.0 {
        -axis
    } else {
        axis
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_force_near_an_axis_is_drawn_along_it() {
        let force = [[-3.0, 0.2, 0.1], [-2.0, -0.3, 0.1], [f64::NAN, 90.0, 0.0]];
        let direction = main_direction(&force, &[]);
        assert_eq!(
            (direction.name.as_str(), direction.axis),
            ("x", Vector3::x())
        );
    }

    #[test]
    fn an_oblique_force_is_drawn_along_itself() {
        let direction = main_direction(&[[0.0, -2.0, 2.0]], &[]);
        assert_eq!(direction.axis.x, 0.0);
        // The eigenvector errs by rounding only.
        assert!((direction.axis.y + direction.axis.z).abs() < 1e-14);
        assert!(direction.name.contains("0.71"), "{}", direction.name);
    }

    #[test]
    fn without_force_the_motion_decides_and_without_both_the_direction_is_x() {
        let zero = [[0.0; 3]; 2];
        assert_eq!(
            main_direction(&zero, &[[5.0, 0.0, 0.0], [5.0, 0.0, 1e-3]]).name,
            "z"
        );
        assert_eq!(main_direction(&zero, &zero).name, "x");
        assert_eq!(main_direction(&[], &[[f64::NAN; 3]]).name, "x");
    }
}
