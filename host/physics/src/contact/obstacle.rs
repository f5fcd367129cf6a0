//! Obstacles: shapes and closed meshes that bodies touch and that no body moves.
//!
//! An obstacle is a [`Shape`] or a closed mesh, in axes of its own. It is still, follows a table of poses, or takes its
//! vertices from frames. The position is linear between two rows of a table, and the rotation turns about one axis at a
//! constant rate (slerp: Shoemake, "Animating rotation with quaternion curves", 1985). Vertices are linear between two
//! frames. Before the first row an obstacle stands at the first row, after the last row at the last one.

use super::rounded::Rounded;
use super::shape::{Nearest, Shape, box_of};
use crate::Vec3;
use crate::mesh::{Adjacency, MeshError};
use nalgebra::{Isometry3, Point3};
use std::collections::BTreeSet;
use std::sync::Arc;

/// An obstacle.
#[derive(Clone, Debug)]
pub struct Obstacle {
    geometry: Geometry,
    motion: Motion,
    /// The corners and triangles of a box.
    sides: Option<(Vec<Vec3>, Vec<[u32; 3]>)>,
}

/// What an obstacle consists of, in axes of its own.
#[derive(Clone, Debug, PartialEq)]
pub enum Geometry {
    /// A shape with an exact distance.
    Shape(Shape),
    /// A closed mesh.
    Mesh(ClosedMesh),
}

/// How an obstacle moves.
#[derive(Clone, Debug, PartialEq)]
pub enum Motion {
    /// It stands at this pose.
    Still(Isometry3<f64>),
    /// It follows a table of poses.
    Poses(Vec<TimedPose>),
    /// The vertices of a mesh follow frames.
    Frames(Frames),
}

/// A row of a table of poses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimedPose {
    /// Time (s).
    pub time: f64,
    /// The pose of the obstacle's axes at this time.
    pub pose: Isometry3<f64>,
}

/// Vertices that follow frames.
#[derive(Clone, Debug, PartialEq)]
pub struct Frames {
    /// Frames per second (Hz). The first frame is at time 0.
    pub rate: f64,
    /// The positions of all vertices in each frame, in the axes of the obstacle (m).
    pub positions: Vec<Vec<Vec3>>,
    /// The pose of these axes.
    pub pose: Isometry3<f64>,
}

/// A mesh that bounds a volume, with its normals outwards.
#[derive(Clone, Debug, PartialEq)]
pub struct ClosedMesh {
    positions: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
}

/// The reason why triangles bound no volume, or why an obstacle cannot move so.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ObstacleError {
    /// An edge has one triangle.
    #[error("an open mesh: the edge from {from} to {to} has one triangle", from = place(.0), to = place(.1))]
    Open(Vec3, Vec3),
    /// Two triangles at an edge have normals to different sides.
    #[error(
        "a mesh with an inverted triangle: the normals of the two triangles at the edge from {from} to {to} \
         disagree", from = place(.0), to = place(.1)
    )]
    Twisted(Vec3, Vec3),
    /// The normals point inwards.
    #[error("an inverted mesh: its normals point inwards, its volume is {0:e} m3")]
    Inverted(f64),
    /// The triangles are no surface.
    #[error(transparent)]
    Surface(#[from] MeshError),
    /// Frames move the vertices of a shape, or another number of vertices.
    #[error("a frame of {found} vertices, for {expected}")]
    Frame {
        /// The vertices of the frame.
        found: usize,
        /// The vertices of the obstacle.
        expected: usize,
    },
    /// There is no row or no frame.
    #[error("a motion without a row")]
    Empty,
}

/// No material point within `radius` (m) of `p` moves further than this (m) from one pose to the other.
pub(super) fn most_motion([start, end]: [Isometry3<f64>; 2], p: &Vec3, radius: f64) -> f64 {
    let p = Point3::from(*p);
    let turn = end.rotation * start.rotation.inverse();
    (p - start * end.inverse_transform_point(&p)).norm() + turn.angle() * radius
}

/// A point to the micrometre.
fn place(point: &Vec3) -> String {
    // The sum has no negative zero.
    let [x, y, z]: [f64; 3] = point.map(|x| (x * 1e6).round() / 1e6 + 0.0).into();
    format!("[{x}, {y}, {z}]")
}

/// A material point of an obstacle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Point {
    /// A point that is fixed in the axes of the obstacle (m).
    Fixed(Vec3),
    /// A point of a triangle of the mesh, by the weights of the corners.
    OnTriangle {
        /// The number of the triangle.
        triangle: usize,
        /// The weights; their sum is 1.
        weights: [f64; 3],
    },
}

impl ClosedMesh {
    /// The mesh of `triangles` over `positions` (m). The corners of each triangle are counterclockwise seen from outside.
    ///
    /// # Errors
    /// [`ObstacleError`] for triangles that bound no volume, with the place.
    pub fn new(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Result<Self, ObstacleError> {
        let adjacency = Adjacency::new(&triangles)?;
        let ends = |[a, b]: [u32; 2]| (positions[a as usize], positions[b as usize]);
        if let Some(edge) = adjacency.boundary.first() {
            let (from, to) = ends(edge.vertices);
            return Err(ObstacleError::Open(from, to));
        }
        let mut sides = BTreeSet::new();
        for [a, b, c] in &triangles {
            for side in [[*a, *b], [*b, *c], [*c, *a]] {
                if !sides.insert(side) {
                    let (from, to) = ends(side);
                    return Err(ObstacleError::Twisted(from, to));
                }
            }
        }
        let mesh = Self {
            positions,
            triangles,
        };
        let volume = mesh.volume();
        if volume > 0.0 {
            Ok(mesh)
        } else {
            Err(ObstacleError::Inverted(volume))
        }
    }

    /// The positions of the vertices (m).
    pub fn positions(&self) -> &[Vec3] {
        &self.positions
    }

    /// The vertices of each triangle.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// The volume (m³).
    pub fn volume(&self) -> f64 {
        self.volume_at(&self.positions)
    }

    /// The volume (m³) if the vertices are at `positions` (m).
    ///
    /// # Panics
    /// For fewer positions than vertices.
    pub fn volume_at(&self, positions: &[Vec3]) -> f64 {
        let about = positions.first().copied().unwrap_or_default();
        let part = |triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(|v| positions[v as usize] - about);
            a.cross(&b).dot(&c) / 6.0
        };
        self.triangles.iter().map(part).sum()
    }
}

impl Obstacle {
    /// The obstacle that moves so.
    ///
    /// # Errors
    /// [`ObstacleError`] for a motion without a row, and for frames that do not fit the mesh.
    pub fn new(geometry: Geometry, motion: Motion) -> Result<Self, ObstacleError> {
        match &motion {
            Motion::Poses(rows) if rows.is_empty() => return Err(ObstacleError::Empty),
            Motion::Still(_) | Motion::Poses(_) => {}
            Motion::Frames(frames) if frames.positions.is_empty() => {
                return Err(ObstacleError::Empty);
            }
            Motion::Frames(frames) => {
                let expected = match &geometry {
                    Geometry::Shape(_) => 0,
                    Geometry::Mesh(mesh) => mesh.positions.len(),
                };
                let counts = frames.positions.iter().map(Vec::len);
                if let Some(found) = counts.into_iter().find(|&found| found != expected) {
                    return Err(ObstacleError::Frame { found, expected });
                }
            }
        }
        let sides = match &geometry {
            // The edges of a box can hold a surface up between the vertices of the surface.
            Geometry::Shape(Shape::Box { half }) => Some(box_of(half)),
            _ => None,
        };
        Ok(Self {
            geometry,
            motion,
            sides,
        })
    }

    /// The vertices and triangles that meet edges and triangles of bodies, in the axes of the obstacle (m); `None` for a shape
    /// that meets vertices alone.
    pub(crate) fn surface(&self) -> Option<(&[Vec3], &[[u32; 3]])> {
        match (&self.geometry, &self.sides) {
            (Geometry::Mesh(mesh), _) => Some((&mesh.positions, &mesh.triangles)),
            (Geometry::Shape(_), Some((positions, triangles))) => Some((positions, triangles)),
            (Geometry::Shape(_), None) => None,
        }
    }

    /// Moves the obstacle from one of these rows to the other, and leaves it there: a hand moves it. Nothing is allocated after
    /// the first call.
    pub fn lead(&mut self, rows: [TimedPose; 2]) {
        if let Motion::Poses(poses) = &mut self.motion {
            poses.clear();
            poses.extend(rows);
        } else {
            self.motion = Motion::Poses(rows.to_vec());
        }
    }

    /// The rounded hull that the obstacle is; `None` for another shape and for a mesh.
    pub fn rounded(&self) -> Option<&Arc<Rounded>> {
        match &self.geometry {
            Geometry::Shape(Shape::Rounded(rounded)) => Some(rounded),
            Geometry::Shape(_) | Geometry::Mesh(_) => None,
        }
    }

    /// What the obstacle consists of.
    pub fn geometry(&self) -> &Geometry {
        &self.geometry
    }

    /// How the obstacle moves.
    pub fn motion(&self) -> &Motion {
        &self.motion
    }

    /// Whether the obstacle never moves.
    pub fn is_still(&self) -> bool {
        match &self.motion {
            Motion::Still(_) => true,
            Motion::Poses(rows) => rows.len() == 1,
            Motion::Frames(frames) => frames.positions.len() == 1,
        }
    }

    /// Whether the obstacle does not move from time `t` to `t + h` (s).
    pub fn stands(&self, t: f64, h: f64) -> bool {
        let (from, to) = match &self.motion {
            Motion::Still(_) => return true,
            Motion::Poses(rows) => {
                let ends = rows.first().zip(rows.last());
                let ends = ends.filter(|(first, last)| rows.len() > 2 || first.pose != last.pose);
                ends.map_or((0.0, 0.0), |(first, last)| (first.time, last.time))
            }
            Motion::Frames(frames) => (0.0, (frames.positions.len() - 1) as f64 / frames.rate),
        };
        t + h <= from || t >= to
    }

    /// Seen from the axes of the obstacle, no point within `radius` (m) of `centre` (m) moves further than this (m) from one of the
    /// `times` (s) to the other, if it stands in the world. Infinite for moving frames.
    pub fn most_motion(&self, times: [f64; 2], centre: &Vec3, radius: f64) -> f64 {
        if self.stands(times[0], times[1] - times[0]) {
            return 0.0;
        }
        match &self.motion {
            Motion::Frames(_) => f64::INFINITY,
            Motion::Still(_) | Motion::Poses(_) => {
                most_motion(times.map(|t| self.pose(t)), centre, radius)
            }
        }
    }

    /// Number of vertices: 0 for a shape.
    pub fn vertices(&self) -> usize {
        match &self.geometry {
            Geometry::Shape(_) => 0,
            Geometry::Mesh(mesh) => mesh.positions.len(),
        }
    }

    /// The pose of the obstacle's axes at time `t` (s).
    pub fn pose(&self, t: f64) -> Isometry3<f64> {
        match &self.motion {
            Motion::Still(pose) => *pose,
            Motion::Frames(frames) => frames.pose,
            Motion::Poses(rows) => {
                let after = rows.partition_point(|row| row.time <= t);
                match (rows.get(after.wrapping_sub(1)), rows.get(after)) {
                    (Some(from), Some(to)) => {
                        let part = (t - from.time) / (to.time - from.time);
                        // Rotations that differ by less than rounding have no axis between them.
                        let between = from.pose.try_lerp_slerp(&to.pose, part, f64::EPSILON);
                        between.unwrap_or(from.pose)
                    }
                    (Some(row), None) | (None, Some(row)) => row.pose,
                    (None, None) => Isometry3::identity(),
                }
            }
        }
    }

    /// Writes the positions of the vertices at time `t` (s) to `x` (m), one for each vertex; a longer `x` keeps its end.
    pub fn write_positions(&self, t: f64, x: &mut [Vec3]) {
        let Some((positions, _)) = self.surface() else {
            return;
        };
        let pose = self.pose(t);
        if let Motion::Frames(frames) = &self.motion {
            let (from, to, part) = frames.around(t);
            let pairs = from.iter().zip(to);
            for (x, (from, to)) in x.iter_mut().zip(pairs) {
                *x = placed(&pose, &(from + (to - from) * part));
            }
        } else {
            for (x, own) in x.iter_mut().zip(positions) {
                *x = placed(&pose, own);
            }
        }
    }

    /// The position of a material point at time `t` (m).
    pub fn position(&self, point: &Point, t: f64) -> Vec3 {
        let own = match (*point, &self.geometry) {
            (Point::Fixed(own), _) => own,
            (Point::OnTriangle { triangle, weights }, Geometry::Mesh(mesh)) => {
                let corners = mesh.triangles[triangle].map(|v| v as usize);
                let at = |v: usize| match &self.motion {
                    Motion::Frames(frames) => {
                        let (from, to, part) = frames.around(t);
                        from[v] + (to[v] - from[v]) * part
                    }
                    Motion::Still(_) | Motion::Poses(_) => mesh.positions[v],
                };
                corners
                    .into_iter()
                    .zip(weights)
                    .map(|(v, w)| at(v) * w)
                    .sum()
            }
            // A shape has no triangle.
            (Point::OnTriangle { .. }, Geometry::Shape(_)) => Vec3::zeros(),
        };
        placed(&self.pose(t), &own)
    }

    /// The displacement of a material point from time `t` to `t + h` (m).
    pub fn displacement(&self, point: &Point, t: f64, h: f64) -> Vec3 {
        if self.is_still() {
            return Vec3::zeros();
        }
        self.position(point, t + h) - self.position(point, t)
    }

    /// The material point of a rigid obstacle that is at the place `x` (m) at time `t` (s).
    pub fn fixed(&self, x: &Vec3, t: f64) -> Point {
        Point::Fixed(own(&self.pose(t), x))
    }

    /// The nearest point of a shape's surface to the place `x` (m) at time `t` (s), in world axes; `None` for a mesh.
    pub fn nearest(&self, x: &Vec3, t: f64) -> Option<Nearest> {
        let Geometry::Shape(shape) = &self.geometry else {
            return None;
        };
        let pose = self.pose(t);
        let near = shape.nearest(&own(&pose, x));
        Some(Nearest {
            distance: near.distance,
            normal: pose.rotation * near.normal,
        })
    }
}

impl Frames {
    /// The frames before and after time `t` (s), and the part of the way between them.
    fn around(&self, t: f64) -> (&[Vec3], &[Vec3], f64) {
        let last = self.positions.len() - 1;
        let at = (t * self.rate).clamp(0.0, last as f64);
        let from = (at as usize).min(last);
        let to = (from + 1).min(last);
        (&self.positions[from], &self.positions[to], at - from as f64)
    }
}

/// A point of an obstacle's own axes, in world axes (m).
fn placed(pose: &Isometry3<f64>, own: &Vec3) -> Vec3 {
    pose.transform_point(&Point3::from(*own)).coords
}

/// A point of world axes, in an obstacle's own axes (m).
fn own(pose: &Isometry3<f64>, x: &Vec3) -> Vec3 {
    pose.inverse_transform_point(&Point3::from(*x)).coords
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The corners of a unit tetrahedron, and its faces seen from outside.
    fn tetrahedron() -> (Vec<Vec3>, Vec<[u32; 3]>) {
        let positions = vec![Vec3::zeros(), Vec3::x(), Vec3::y(), Vec3::z()];
        let triangles = vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]];
        (positions, triangles)
    }

    fn closed() -> ClosedMesh {
        let (positions, triangles) = tetrahedron();
        ClosedMesh::new(positions, triangles).expect("it is closed")
    }

    /// Turns about z at 2 rad/s while it moves along x at 3 m/s, from 1 s to 2 s.
    fn turning(geometry: Geometry) -> Obstacle {
        let row = |time: f64| TimedPose {
            time,
            pose: Isometry3::new(
                Vec3::x() * (3.0 * (time - 1.0)),
                Vec3::z() * (2.0 * (time - 1.0)),
            ),
        };
        Obstacle::new(geometry, Motion::Poses(vec![row(1.0), row(1.5), row(2.0)])).expect("rows")
    }

    #[test]
    fn a_closed_mesh_has_its_volume_and_others_are_refused() {
        let (positions, triangles) = tetrahedron();
        assert!((closed().volume() - 1.0 / 6.0).abs() < 1e-15);
        let refused = |triangles: Vec<[u32; 3]>| ClosedMesh::new(positions.clone(), triangles);
        let open = refused(triangles[1..].to_vec()).expect_err("a face is missing");
        assert_eq!(
            open.to_string(),
            "an open mesh: the edge from [0, 0, 0] to [1, 0, 0] has one triangle"
        );
        let mut turned = triangles.clone();
        turned[0].swap(0, 1);
        assert!(matches!(refused(turned), Err(ObstacleError::Twisted(..))));
        let inside_out = triangles.iter().map(|[a, b, c]| [*a, *c, *b]).collect();
        assert!(matches!(refused(inside_out), Err(ObstacleError::Inverted(v)) if v < 0.0));
    }

    #[test]
    fn a_table_of_poses_is_followed_at_a_constant_rate() {
        let wheel = turning(Geometry::Shape(Shape::sphere(0.1)));
        // A point at (0, 2, 0) of the axes: x = 3 s - 2 sin 2s, y = 2 cos 2s.
        let point = Point::Fixed(Vec3::y() * 2.0);
        let exact = |t: f64| {
            let s = (t - 1.0).clamp(0.0, 1.0);
            let (sine, cosine) = (2.0 * s).sin_cos();
            Vec3::new(3.0 * s - 2.0 * sine, 2.0 * cosine, 0.0)
        };
        for t in [0.0, 1.0, 1.1, 1.5, 1.77, 2.0, 9.0] {
            assert!((wheel.position(&point, t) - exact(t)).norm() < 1e-14, "{t}");
            let moved = wheel.displacement(&point, t, 0.004);
            assert!((moved - (exact(t + 0.004) - exact(t))).norm() < 1e-14);
            let Point::Fixed(back) = wheel.fixed(&exact(t), t) else {
                panic!("a rigid obstacle has fixed points");
            };
            assert!((back - Vec3::y() * 2.0).norm() < 1e-14);
        }
        // The sphere's surface, 0.1 m from the centre.
        let near = wheel
            .nearest(&Vec3::new(1.5, 0.0, 1.0), 1.5)
            .expect("a shape");
        assert!((near.distance - 0.9).abs() < 1e-14 && (near.normal - Vec3::z()).norm() < 1e-14);
        assert!(!wheel.is_still());
    }

    #[test]
    fn the_vertices_of_a_rigid_mesh_follow_its_pose() {
        let wheel = turning(Geometry::Mesh(closed()));
        let mut x = [Vec3::zeros(); 4];
        wheel.write_positions(1.25, &mut x);
        let (sine, cosine) = 0.5_f64.sin_cos();
        assert!((x[1] - Vec3::new(0.75 + cosine, sine, 0.0)).norm() < 1e-15);
        let point = Point::OnTriangle {
            triangle: 2,
            weights: [0.2, 0.3, 0.5],
        };
        let expected = x[1] * 0.2 + x[2] * 0.3 + x[3] * 0.5;
        assert!((wheel.position(&point, 1.25) - expected).norm() < 1e-15);
        assert_eq!(wheel.nearest(&Vec3::zeros(), 0.0), None);
    }

    #[test]
    fn vertices_are_linear_between_frames() {
        let mesh = closed();
        let grown = |by: f64| mesh.positions().iter().map(|x| x * by).collect();
        let frames = Frames {
            rate: 10.0,
            positions: vec![grown(1.0), grown(2.0), grown(4.0)],
            pose: Isometry3::translation(0.0, 1.0, 0.0),
        };
        let motion = Motion::Frames(frames.clone());
        let balloon = Obstacle::new(Geometry::Mesh(mesh.clone()), motion).expect("frames fit");
        let mut x = [Vec3::zeros(); 4];
        for (t, size) in [
            (-1.0, 1.0),
            (0.05, 1.5),
            (0.1, 2.0),
            (0.15, 3.0),
            (7.0, 4.0),
        ] {
            balloon.write_positions(t, &mut x);
            assert!((x[1] - Vec3::new(size, 1.0, 0.0)).norm() < 1e-14, "{t}");
        }
        let corner = Point::OnTriangle {
            triangle: 0,
            weights: [0.0, 0.0, 1.0],
        };
        let moved = balloon.displacement(&corner, 0.1, 0.01);
        assert!((moved - Vec3::x() * 0.2).norm() < 1e-14);

        let mut short = frames.clone();
        short.positions[1].pop();
        let error = Obstacle::new(Geometry::Mesh(mesh), Motion::Frames(short)).expect_err("short");
        assert_eq!(
            error,
            ObstacleError::Frame {
                found: 3,
                expected: 4
            }
        );
        let shape = Geometry::Shape(Shape::Plane);
        assert!(Obstacle::new(shape.clone(), Motion::Frames(frames)).is_err());
        let none = Obstacle::new(shape, Motion::Poses(Vec::new())).expect_err("no row");
        assert_eq!(none, ObstacleError::Empty);
    }
}
