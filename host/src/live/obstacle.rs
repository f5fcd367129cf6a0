//! The obstacles of a scene for viewers: triangles, made once, and where the triangles are at a time.

use crate::world::World;
use physics::Vec3;
use physics::contact::Obstacle;
use physics::contact::obstacle::{Geometry, Motion};
use physics::contact::shape::Shape;
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};

/// Pieces of a circle.
const AROUND: u32 = 32;
/// Pieces of a quarter of a circle.
const QUARTER: u32 = 8;
/// The part of a plane that is drawn is larger than what lies on it by this factor.
const BEYOND: f64 = 1.25;

/// An obstacle as a viewer draws it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ObstacleInfo {
    /// Name in the scene.
    pub name: String,
    /// `plane`, `sphere`, `capsule`, `cylinder`, `box`, `hull` or `mesh`.
    pub shape: String,
    /// Positions in the axes of the obstacle (m), three numbers a vertex. Of a plane, a square about the bodies.
    pub positions: Vec<f32>,
    /// The triangles, three vertices each.
    pub triangles: Vec<u32>,
}

/// An obstacle at a time.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ObstacleState {
    /// The pose of its axes: position (m), and the quaternion x, y, z, w.
    pub pose: [f64; 7],
    /// The positions in its axes (m), if they change with time; else empty.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub positions: Vec<f32>,
}

impl ObstacleInfo {
    /// Its positions in the axes of the scene (m), in this state.
    pub fn placed(&self, state: &ObstacleState) -> Vec<[f32; 3]> {
        let [x, y, z, i, j, k, w] = state.pose;
        // The columns of the rotation of a quaternion of length one.
        let columns = [
            [
                1.0 - 2.0 * (j * j + k * k),
                2.0 * (i * j + k * w),
                2.0 * (i * k - j * w),
            ],
            [
                2.0 * (i * j - k * w),
                1.0 - 2.0 * (i * i + k * k),
                2.0 * (j * k + i * w),
            ],
            [
                2.0 * (i * k + j * w),
                2.0 * (j * k - i * w),
                1.0 - 2.0 * (i * i + j * j),
            ],
        ];
        let own = if state.positions.is_empty() {
            &self.positions
        } else {
            &state.positions
        };
        let place = |own: &[f32; 3]| {
            std::array::from_fn(|axis| {
                let turned: f64 = (own.iter().zip(&columns))
                    .map(|(x, column)| f64::from(*x) * column[axis])
                    .sum();
                ([x, y, z][axis] + turned) as f32
            })
        };
        own.as_chunks().0.iter().map(place).collect()
    }
}

/// The obstacles of a world.
pub(super) fn infos(world: &World<'_>) -> Vec<ObstacleInfo> {
    let each = world.loaded.scene.obstacles.iter().zip(&world.obstacles);
    let info = each.map(|(spec, obstacle)| {
        let (shape, positions, triangles) = match obstacle.geometry() {
            Geometry::Mesh(mesh) => (
                "mesh",
                mesh.positions().to_vec(),
                mesh.triangles().as_flattened().to_vec(),
            ),
            Geometry::Shape(shape) => {
                let pose = obstacle.pose(0.0);
                let points = world.bodies.iter().flat_map(|built| built.mesh.positions());
                let own = points.map(|point| {
                    let own = pose.inverse_transform_point(&(*point).into());
                    own.x.abs().max(own.y.abs())
                });
                let (positions, triangles) = surface(shape, BEYOND * own.fold(0.0, f64::max));
                (name(shape), positions, triangles)
            }
        };
        ObstacleInfo {
            name: spec.name.clone(),
            shape: shape.to_owned(),
            positions: rounded(&positions),
            triangles,
        }
    });
    info.collect()
}

/// The obstacles at time `t` (s).
pub(super) fn states(obstacles: &[Obstacle], t: f64) -> Vec<ObstacleState> {
    let state = |obstacle: &Obstacle| {
        let pose = obstacle.pose(t);
        let mut positions = Vec::new();
        if matches!(obstacle.motion(), Motion::Frames(_)) {
            let mut x = vec![Vec3::zeros(); obstacle.vertices()];
            obstacle.write_positions(t, &mut x);
            for x in &mut x {
                *x = pose.inverse_transform_point(&(*x).into()).coords;
            }
            positions = rounded(&x);
        }
        let (at, turn) = (pose.translation.vector, pose.rotation.coords);
        ObstacleState {
            pose: [at.x, at.y, at.z, turn.x, turn.y, turn.z, turn.w],
            positions,
        }
    };
    obstacles.iter().map(state).collect()
}

fn rounded(positions: &[Vec3]) -> Vec<f32> {
    positions
        .iter()
        .flat_map(|p| [p.x as f32, p.y as f32, p.z as f32])
        .collect()
}

fn name(shape: &Shape) -> &'static str {
    match shape {
        Shape::Plane => "plane",
        Shape::Rounded(rounded) => match rounded.hull().corners().len() {
            1 => "sphere",
            2 => "capsule",
            _ => "hull",
        },
        Shape::Cylinder { .. } => "cylinder",
        Shape::Box { .. } => "box",
    }
}

/// The longest side of a triangle of a rounded hull, as a fraction of its size.
const PART: f64 = 0.3;
/// The part of a direction by which the two equators of a rounded hull differ: no length is drawn that finely.
const BESIDE: f64 = 1e-9;

/// Vertices and triangles of a shape, counterclockwise seen from outside. Of a plane, a square of half the side `half` (m).
fn surface(shape: &Shape, half: f64) -> (Vec<Vec3>, Vec<u32>) {
    // Rings about the z axis, from below: radius and height (m).
    let arc = |from: f64| {
        (0..=QUARTER).map(move |k| {
            let angle = from + f64::from(k) / f64::from(QUARTER) * 0.5 * PI;
            (angle.cos(), angle.sin())
        })
    };
    let rings: Vec<(f64, f64)> = match shape {
        Shape::Plane => {
            let corner = |x: f64, y: f64| Vec3::new(x, y, 0.0) * half;
            let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
            let positions = corners.map(|(x, y)| corner(x, y)).to_vec();
            return (positions, vec![0, 1, 2, 0, 2, 3]);
        }
        Shape::Box { half } => return cuboid(half),
        // A sphere of directions, in two halves: the equator of each has the corners on its side.
        Shape::Rounded(_) => arc(-0.5 * PI).chain(arc(0.0)).collect(),
        Shape::Cylinder { half, radius } => {
            let (half, radius) = (*half, *radius);
            // The edges have vertices of their own, so that the caps are flat.
            let heights = [(0.0, -half), (radius, -half), (radius, half), (0.0, half)];
            heights.to_vec()
        }
    };
    let mut positions = Vec::new();
    for (number, (radius, z)) in rings.iter().enumerate() {
        for k in 0..AROUND {
            let (sine, cosine) = (TAU * f64::from(k) / f64::from(AROUND)).sin_cos();
            let place = Vec3::new(radius * cosine, radius * sine, *z);
            positions.push(match shape {
                Shape::Rounded(rounded) => {
                    let side = if number <= QUARTER as usize {
                        -BESIDE
                    } else {
                        BESIDE
                    };
                    rounded.furthest(&(place + Vec3::z() * side))
                }
                _ => place,
            });
        }
    }
    let mut triangles = Vec::new();
    for ring in 0..rings.len() as u32 - 1 {
        for k in 0..AROUND {
            let (a, b) = (ring * AROUND + k, ring * AROUND + (k + 1) % AROUND);
            let (c, d) = (a + AROUND, b + AROUND);
            triangles.extend([a, b, d, a, d, c]);
        }
    }
    if let Shape::Rounded(rounded) = shape {
        // A flat end of a hull lies within the first ring or the last one.
        let last = positions.len() as u32 - AROUND;
        for (ring, is_below) in [(0, true), (last, false)] {
            let middle = positions.len() as u32;
            let corners = &positions[ring as usize..(ring + AROUND) as usize];
            positions.push(corners.iter().sum::<Vec3>() / f64::from(AROUND));
            for k in 0..AROUND {
                let (a, b) = (ring + k, ring + (k + 1) % AROUND);
                triangles.extend(if is_below {
                    [middle, b, a]
                } else {
                    [middle, a, b]
                });
            }
        }
        let size = rounded.hull().extent() + rounded.radius();
        triangles = divided(&mut positions, &triangles, PART * size);
    }
    (positions, triangles)
}

/// Triangles with no side longer than `most` (m): a picture draws triangle after triangle by their distances, which is right for
/// small ones.
fn divided(positions: &mut Vec<Vec3>, triangles: &[u32], most: f64) -> Vec<u32> {
    let mut small = Vec::new();
    let mut rest: Vec<[u32; 3]> = triangles.as_chunks().0.to_vec();
    while let Some([a, b, c]) = rest.pop() {
        let length = |a: u32, b: u32| (positions[a as usize] - positions[b as usize]).norm();
        // The longest side comes first.
        let turned = [[a, b, c], [b, c, a], [c, a, b]];
        let longest = turned
            .into_iter()
            .max_by(|p, q| length(p[0], p[1]).total_cmp(&length(q[0], q[1])));
        let [a, b, c] = longest.unwrap_or([a, b, c]);
        if length(a, b) <= most {
            small.extend([a, b, c]);
            continue;
        }
        let middle = positions.len() as u32;
        positions.push((positions[a as usize] + positions[b as usize]) / 2.0);
        rest.extend([[a, middle, c], [middle, b, c]]);
    }
    small
}

/// A box about the origin. Each side has four vertices of its own, so that it is flat.
fn cuboid(half: &Vec3) -> (Vec<Vec3>, Vec<u32>) {
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            let first = positions.len() as u32;
            for (u, v) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
                let mut corner = Vec3::zeros();
                corner[axis] = side * half[axis];
                corner[(axis + 1) % 3] = side * u * half[(axis + 1) % 3];
                corner[(axis + 2) % 3] = v * half[(axis + 2) % 3];
                positions.push(corner);
            }
            triangles.extend([0, 1, 2, 0, 2, 3].map(|k| first + k));
        }
    }
    (positions, triangles)
}

#[cfg(test)]
mod tests {
    use super::*;
    use physics::contact::rounded::Rounded;
    use rt_core::hull::Hull;
    use std::sync::Arc;

    /// The volume within triangles whose normals point outwards.
    fn volume((positions, triangles): (Vec<Vec3>, Vec<u32>)) -> f64 {
        let part = |corners: &[u32; 3]| {
            let [a, b, c] = corners.map(|v| positions[v as usize]);
            a.cross(&b).dot(&c) / 6.0
        };
        triangles.as_chunks().0.iter().map(part).sum()
    }

    #[test]
    fn shapes_have_their_volumes() {
        let (half, radius) = (0.4, 0.3);
        let ball = 4.0 / 3.0 * PI * radius * radius * radius;
        let tube = 2.0 * half * PI * radius * radius;
        let corners = [[0.3, 0.4], [-0.3, 0.4], [-0.3, -0.4], [0.3, -0.4]];
        let hull = Hull::new(&corners.map(|[x, y]| Vec3::new(x, y, 0.0))).expect("few points");
        let plate = Shape::Rounded(Arc::new(Rounded::new(&hull, 0.1)));
        let ball_of_edge = 4.0 / 3.0 * PI * 0.1 * 0.1 * 0.1;
        let cases = [
            (Shape::sphere(radius), ball),
            (Shape::capsule(half, radius), ball + tube),
            (
                plate,
                0.6 * 0.8 * 2.0 * 0.1 + PI * 0.1 * 0.1 * 1.4 + ball_of_edge,
            ),
            (Shape::Cylinder { half, radius }, tube),
            (
                Shape::Box {
                    half: Vec3::new(0.1, 0.2, 0.3),
                },
                0.048,
            ),
        ];
        for (shape, expected) in cases {
            let found = volume(surface(&shape, 0.0));
            // Chords instead of arcs take up to 2 %.
            assert!((0.98..1.000_001).contains(&(found / expected)), "{shape:?}");
        }
    }
}
