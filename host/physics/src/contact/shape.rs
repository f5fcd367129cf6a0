//! Shapes of obstacles with an exact distance: plane, cylinder, box, and rounded hulls, among them spheres and capsules.
//!
//! Distances are signed: negative inside. They are those of Quilez, "Distance functions" (2008), with the direction in
//! which they grow. Inside an edge or a corner the direction is that of the nearest face.

use super::rounded::Rounded;
use crate::Vec3;
use std::sync::Arc;

/// A shape, in axes of its own.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// The half space below `z = 0`.
    Plane,
    /// All points within a radius of a hull.
    Rounded(Arc<Rounded>),
    /// A cylinder about the z axis, with flat ends.
    Cylinder {
        /// Half the length (m).
        half: f64,
        /// Radius (m).
        radius: f64,
    },
    /// A box about the origin.
    Box {
        /// Half the lengths of the edges (m).
        half: Vec3,
    },
}

/// The nearest point of a shape's surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// Signed distance (m).
    pub distance: f64,
    /// The direction in which the distance grows, of length one.
    pub normal: Vec3,
}

impl Shape {
    /// A sphere about the origin, by its radius (m).
    pub fn sphere(radius: f64) -> Self {
        Self::Rounded(Arc::new(Rounded::sphere(radius)))
    }

    /// All points within a radius (m) of a segment of the z axis about the origin, by half its length (m).
    pub fn capsule(half: f64, radius: f64) -> Self {
        Self::Rounded(Arc::new(Rounded::capsule(half, radius)))
    }

    /// The nearest point of the surface to `p` (m): `p - normal * distance`.
    pub fn nearest(&self, p: &Vec3) -> Nearest {
        match self {
            Self::Plane => Nearest {
                distance: p.z,
                normal: Vec3::z(),
            },
            Self::Rounded(rounded) => rounded.nearest(p),
            Self::Cylinder { half, radius } => {
                let out = p.x.hypot(p.y);
                let side = if out > 0.0 {
                    Vec3::new(p.x / out, p.y / out, 0.0)
                } else {
                    Vec3::x()
                };
                let [a, b] = faced([out - radius, p.z.abs() - half]);
                let normal = side * a.1 + Vec3::z() * (b.1 * p.z.signum());
                Nearest {
                    distance: distance([a.0, b.0]),
                    normal,
                }
            }
            Self::Box { half } => {
                let over = [0, 1, 2].map(|i| p[i].abs() - half[i]);
                let faces = faced(over);
                let normal = Vec3::from_fn(|i, _| faces[i].1 * p[i].signum());
                Nearest {
                    distance: distance(over),
                    normal,
                }
            }
        }
    }
}

/// The signed distance to an edge or corner, from the distances `over` its faces (m).
fn distance<const N: usize>(over: [f64; N]) -> f64 {
    let outside = over
        .iter()
        .map(|o| o.max(0.0) * o.max(0.0))
        .sum::<f64>()
        .sqrt();
    let nearest = over.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if nearest > 0.0 { outside } else { nearest }
}

/// The distances `over` faces (m), each with its part of the direction in which the distance grows.
fn faced<const N: usize>(over: [f64; N]) -> [(f64, f64); N] {
    let length = distance(over);
    let nearest = over.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let mut is_taken = false;
    over.map(|o| {
        if nearest > 0.0 {
            (o, o.max(0.0) / length)
        } else {
            let is_face = o == nearest && !is_taken;
            is_taken |= is_face;
            (o, f64::from(u8::from(is_face)))
        }
    })
}

/// The corners of a box.
fn corners(half: &Vec3) -> [Vec3; 8] {
    [0, 1, 2, 3, 4, 5, 6, 7].map(|corner: usize| {
        Vec3::from_fn(|axis, _| {
            if corner >> axis & 1 == 1 {
                half[axis]
            } else {
                -half[axis]
            }
        })
    })
}

/// The corners and the triangles of a box, counterclockwise seen from outside.
pub(crate) fn box_of(half: &Vec3) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let faces = [
        [0, 4, 6, 2],
        [1, 3, 7, 5],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 2, 3, 1],
        [4, 5, 7, 6],
    ];
    let triangles = faces
        .iter()
        .flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]);
    (corners(half).to_vec(), triangles.collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn shapes() -> [Shape; 5] {
        [
            Shape::Plane,
            Shape::sphere(0.7),
            Shape::capsule(0.4, 0.3),
            Shape::Cylinder {
                half: 0.5,
                radius: 0.4,
            },
            Shape::Box {
                half: Vec3::new(0.3, 0.5, 0.7),
            },
        ]
    }

    #[test]
    fn distances_are_those_of_geometry() {
        let at = |x: f64, y: f64, z: f64| Vec3::new(x, y, z);
        let [plane, sphere, capsule, cylinder, cube] = shapes();
        let cases = [
            (plane, at(1.0, 2.0, -0.5), -0.5),
            (sphere.clone(), at(0.0, 1.0, 0.0), 0.3),
            (sphere, at(0.0, 0.0, 0.0), -0.7),
            (capsule.clone(), at(0.0, 0.0, 1.0), 0.3),
            (capsule, at(0.5, 0.0, 0.2), 0.2),
            (cylinder.clone(), at(0.0, 0.0, 0.6), 0.1),
            (cylinder.clone(), at(0.7, 0.0, 0.9), 0.5),
            (cylinder, at(0.3, 0.0, 0.0), -0.1),
            (cube.clone(), at(0.6, 0.9, 0.0), 0.5),
            (cube, at(0.25, 0.0, 0.0), -0.05),
        ];
        for (shape, point, expected) in cases {
            let found = shape.nearest(&point).distance;
            assert!(
                (found - expected).abs() < 1e-15,
                "{shape:?} {point:?} {found}"
            );
        }
    }

    proptest! {
        #[test]
        fn the_nearest_point_lies_on_the_surface(p in [-1.5..1.5, -1.5..1.5, -1.5..1.5]) {
            let p = Vec3::from(p);
            for shape in shapes() {
                let Nearest { distance, normal } = shape.nearest(&p);
                prop_assert!((normal.norm() - 1.0).abs() < 1e-12);
                let foot = shape.nearest(&(p - normal * distance));
                prop_assert!(foot.distance.abs() < 1e-12, "{shape:?} {foot:?}");
                // The distance grows by one along the normal, if the point stays on its side of edges inside.
                let further = shape.nearest(&(p + normal * 1e-6)).distance;
                prop_assert!((further - distance - 1e-6).abs() < 1e-9, "{shape:?}");
            }
        }

        #[test]
        fn no_distance_changes_more_than_the_point_moves(
            p in [-1.5..1.5, -1.5..1.5, -1.5..1.5],
            q in [-1.5..1.5, -1.5..1.5, -1.5..1.5],
        ) {
            let (p, q) = (Vec3::from(p), Vec3::from(q));
            for shape in shapes() {
                let change = shape.nearest(&p).distance - shape.nearest(&q).distance;
                prop_assert!(change.abs() <= (p - q).norm() + 1e-12);
            }
        }
    }
}
