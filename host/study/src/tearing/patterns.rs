//! Rectangles in several patterns of triangles, with slits: the meshes of the specimens.
//!
//! The border and the slits have evenly spaced vertices. The vertices between are those of a square lattice, turned by an
//! angle or displaced at random. A slit is straight. Its vertices are doubled, but for its tips.

use super::delaunay::triangulate;
use crate::StudyError;
use crate::chance::Chance;
use physics::Vec3;
use physics::mesh::{Group, TriMesh, generate};

/// A lattice point is left out if it is nearer than this to the border or to a slit (as a fraction of the spacing).
const CLEAR: f64 = 0.55;
/// The largest displacement of a lattice point along each axis (as a fraction of the spacing).
const SCATTER: f64 = 0.3;
/// The shear of the lattice in which the diagonals are chosen. Its sign gives all cells the same diagonal.
const SHEAR: f64 = 1e-3;

/// How the triangles lie.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pattern {
    /// Squares with one diagonal each, turned by an angle (degrees).
    Turned(f64),
    /// Without order. The number chooses one of many such patterns.
    Scattered(u64),
    /// Squares whose diagonals alternate, so that they cross at every second vertex. Slits lie along the sides of squares.
    Crossed,
}

impl Pattern {
    /// The patterns of a study: three turned ones and one without order.
    pub const ALL: [Self; 4] = [
        Self::Turned(0.0),
        Self::Turned(22.0),
        Self::Turned(45.0),
        Self::Scattered(1),
    ];

    /// The name in tables.
    pub fn name(self) -> String {
        match self {
            Self::Turned(angle) => format!("{angle}°"),
            Self::Scattered(_) => "scattered".to_owned(),
            Self::Crossed => "crossed".to_owned(),
        }
    }
}

impl Default for Pattern {
    fn default() -> Self {
        Self::Turned(0.0)
    }
}

/// The triangles of a specimen.
#[derive(Clone, Debug)]
pub enum Triangles {
    /// Triangles in a pattern.
    Pattern(Pattern),
    /// A mesh of the specimen without its slits, with vertices along them: name, and text in the OBJ format.
    Obj(String, String),
}

impl Triangles {
    /// Their name, and the mesh of a rectangle of them. Its own pattern does not count.
    pub(super) fn mesh(&self, rectangle: Rectangle<'_>) -> Result<(String, Patterned), StudyError> {
        match self {
            &Self::Pattern(pattern) => {
                let rectangle = Rectangle {
                    pattern,
                    ..rectangle
                };
                Ok((pattern.name(), rectangle.mesh()?))
            }
            Self::Obj(name, text) => {
                let mesh = meshio::obj::parse(text.as_bytes(), None, None)?;
                Ok((name.clone(), rectangle.of(&mesh)?))
            }
        }
    }
}

/// A straight slit from one point to another (m). A point on the border of the rectangle is the mouth of a notch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slit {
    /// One end.
    pub from: [f64; 2],
    /// The other end.
    pub to: [f64; 2],
}

/// A rectangle, centred at the origin, in the xy-plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rectangle<'a> {
    /// Length along x (m).
    pub length: f64,
    /// Width along y (m).
    pub width: f64,
    /// The number of triangles to aim at.
    pub triangles: usize,
    /// How the triangles lie.
    pub pattern: Pattern,
    /// Its slits. They touch neither each other nor a corner.
    pub slits: &'a [Slit],
    /// Points of the border (m) that are vertices.
    pub marks: &'a [[f64; 2]],
}

/// The mesh of a rectangle.
#[derive(Clone, Debug)]
pub struct Patterned {
    /// The mesh, with the vertex groups "left", "right", "bottom" and "top".
    pub mesh: TriMesh,
    /// The vertices at the tips of the slits, slit by slit.
    pub tips: Vec<u32>,
    /// The spacing of the vertices (m).
    pub spacing: f64,
}

impl Rectangle<'_> {
    /// The spacing of the vertices (m).
    fn spacing(&self) -> f64 {
        (2.0 * self.length * self.width / self.triangles as f64).sqrt()
    }

    /// Whether a point is on the border.
    fn is_on_border(&self, [x, y]: [f64; 2]) -> bool {
        let near = 1e-9 * self.length.max(self.width);
        (x.abs() - 0.5 * self.length).abs() < near || (y.abs() - 0.5 * self.width).abs() < near
    }

    /// The mesh.
    ///
    /// # Errors
    /// [`StudyError::Slit`] for a slit that is not made of edges, and [`StudyError::Mesh`].
    pub fn mesh(&self) -> Result<Patterned, StudyError> {
        let spacing = self.spacing();
        if self.pattern == Pattern::Crossed {
            let [nx, ny] = [self.length, self.width].map(|size| (size / spacing).round() as u32);
            let diagonals = generate::Pattern::Alternating;
            return self.of(&generate::sheet(
                self.length,
                self.width,
                nx,
                ny,
                diagonals,
            )?);
        }
        let mut points = self.border(spacing);
        let mut slits = Vec::new();
        for slit in self.slits {
            let parts = parts(slit, spacing);
            let mut on_slit = Vec::new();
            for k in 0..=parts {
                let at = between(slit.from, slit.to, f64::from(k) / f64::from(parts));
                let found = points
                    .iter()
                    .position(|point| distance(*point, at) < 1e-6 * spacing);
                on_slit.push(found.unwrap_or(points.len()) as u32);
                if found.is_none() {
                    points.push(at);
                }
            }
            slits.push(on_slit);
        }
        let angle = match self.pattern {
            Pattern::Turned(angle) => angle.to_radians(),
            Pattern::Scattered(_) | Pattern::Crossed => 0.0,
        };
        points.extend(self.interior(spacing, angle));
        // The lattice along x, sheared: then no four points lie on one circle.
        let (sine, cosine) = (libm::sin(angle), libm::cos(angle));
        let sheared = points.iter().map(|[x, y]| {
            let (along, across) = (cosine * x + sine * y, cosine * y - sine * x);
            [along - SHEAR * across, across]
        });
        let triangles = triangulate(&sheared.collect::<Vec<_>>());
        self.cut(points, triangles, &slits)
    }

    /// The mesh `of` the rectangle without slits, of which vertices lie along the slits and at their ends.
    ///
    /// # Errors
    /// [`StudyError::Slit`] for a slit that is not made of edges or that ends at no vertex, and [`StudyError::Mesh`].
    pub fn of(&self, of: &TriMesh) -> Result<Patterned, StudyError> {
        let points: Vec<[f64; 2]> = of.positions.iter().map(|at| [at.x, at.y]).collect();
        let slits = self.slits.iter().map(|slit| {
            let near = 1e-6 * distance(slit.from, slit.to);
            let mut on_slit: Vec<u32> = (0_u32..)
                .zip(&points)
                .filter(|(_, point)| to_slit(slit, **point) < near)
                .map(|(vertex, _)| vertex)
                .collect();
            let along = |vertex: &u32| distance(slit.from, points[*vertex as usize]);
            on_slit.sort_by(|a, b| along(a).total_cmp(&along(b)));
            on_slit
        });
        let slits: Vec<_> = slits.collect();
        for (slit, on_slit) in self.slits.iter().zip(&slits) {
            let near = 1e-6 * distance(slit.from, slit.to);
            let is_at = |vertex: Option<&u32>, end| {
                vertex.is_some_and(|&vertex| distance(points[vertex as usize], end) < near)
            };
            if !is_at(on_slit.first(), slit.from) || !is_at(on_slit.last(), slit.to) {
                return Err(StudyError::Slit);
            }
        }
        self.cut(points, of.triangles.clone(), &slits)
    }

    /// The mesh of these points and triangles, cut along the vertices of each slit.
    fn cut(
        &self,
        mut points: Vec<[f64; 2]>,
        mut triangles: Vec<[u32; 3]>,
        slits: &[Vec<u32>],
    ) -> Result<Patterned, StudyError> {
        let mut tips = Vec::new();
        for on_slit in slits {
            open(on_slit, &mut points, &mut triangles)?;
            let ends = [on_slit.first(), on_slit.last()];
            let ends = ends.into_iter().flatten().copied();
            tips.extend(ends.filter(|&end| !self.is_on_border(points[end as usize])));
        }
        let positions: Vec<Vec3> = points.iter().map(|[x, y]| Vec3::new(*x, *y, 0.0)).collect();
        let mut mesh = TriMesh::new(positions, triangles)?;
        let sides: [(&str, usize, f64); 4] = [
            ("left", 0, -0.5 * self.length),
            ("right", 0, 0.5 * self.length),
            ("bottom", 1, -0.5 * self.width),
            ("top", 1, 0.5 * self.width),
        ];
        for (name, axis, at) in sides {
            let on_side = (0_u32..)
                .zip(&points)
                .filter(|(_, point)| (point[axis] - at).abs() < 1e-9);
            mesh.vertex_groups.push(Group {
                name: name.to_owned(),
                members: on_side.map(|(vertex, _)| vertex).collect(),
            });
        }
        Ok(Patterned {
            mesh,
            tips,
            spacing: self.spacing(),
        })
    }

    /// The points of the border, with the mouths of notches and the marks among them.
    fn border(&self, spacing: f64) -> Vec<[f64; 2]> {
        let (x, y) = (0.5 * self.length, 0.5 * self.width);
        let corners = [[-x, -y], [x, -y], [x, y], [-x, y]];
        let mouths = self.slits.iter().flat_map(|slit| [slit.from, slit.to]);
        let marks = mouths.chain(self.marks.iter().copied());
        let mouths: Vec<[f64; 2]> = marks.filter(|&end| self.is_on_border(end)).collect();
        let mut points = Vec::new();
        for side in 0..4 {
            let (from, to) = (corners[side], corners[(side + 1) % 4]);
            let length = distance(from, to);
            // They divide a side into stretches with an even spacing each.
            let mut stops = vec![0.0, 1.0];
            let on_side = |mouth: &&[f64; 2]| {
                (distance(from, **mouth) + distance(**mouth, to) - length).abs() < 1e-9 * length
            };
            stops.extend(
                mouths
                    .iter()
                    .filter(on_side)
                    .map(|mouth| distance(from, *mouth) / length),
            );
            stops.sort_by(f64::total_cmp);
            for pair in stops.windows(2) {
                let span = pair[1] - pair[0];
                let count = (span * length / spacing).round().max(1.0) as u32;
                for k in 0..count {
                    let at = pair[0] + span * f64::from(k) / f64::from(count);
                    points.push(between(from, to, at));
                }
            }
        }
        points
    }

    /// The lattice points that are clear of the border and of the slits.
    fn interior(&self, spacing: f64, angle: f64) -> Vec<[f64; 2]> {
        let (x, y) = (0.5 * self.length, 0.5 * self.width);
        // Without a turn the lattice fits the rectangle, and the axes are lines of it.
        let fit = |size: f64| size / (2.0 * (0.5 * size / spacing).round().max(1.0));
        let (dx, dy) = if angle == 0.0 {
            (fit(self.length), fit(self.width))
        } else {
            (spacing, spacing)
        };
        let (sine, cosine) = (libm::sin(angle), libm::cos(angle));
        let reach = libm::ceil(libm::hypot(self.length, self.width) / dx.min(dy)) as i32;
        let chance = match self.pattern {
            Pattern::Scattered(seed) => Some(Chance::new(seed, 0).of("lattice")),
            Pattern::Turned(_) | Pattern::Crossed => None,
        };
        let mut points = Vec::new();
        for j in -reach..=reach {
            for i in -reach..=reach {
                let (mut along, mut across) = (dx * f64::from(i), dy * f64::from(j));
                if let Some(chance) = chance {
                    let n =
                        u64::from((2 * reach + 1) as u32) * (j + reach) as u64 + (i + reach) as u64;
                    along += dx * chance.between(2 * n, -SCATTER, SCATTER);
                    across += dy * chance.between(2 * n + 1, -SCATTER, SCATTER);
                }
                let at = [
                    cosine * along - sine * across - x,
                    sine * along + cosine * across - y,
                ];
                let from_border = (x - at[0].abs()).min(y - at[1].abs());
                let is_clear = |slit: &Slit| to_slit(slit, at) > CLEAR * spacing;
                if from_border > CLEAR * spacing.min(dx.min(dy)) && self.slits.iter().all(is_clear)
                {
                    points.push(at);
                }
            }
        }
        points
    }
}

/// The number of edges of a slit.
fn parts(slit: &Slit, spacing: f64) -> u32 {
    (distance(slit.from, slit.to) / spacing).round().max(1.0) as u32
}

/// Opens the edges between the vertices of a slit: all but its tips are doubled. The copies belong to the triangles on its
/// left.
fn open(
    slit: &[u32],
    points: &mut Vec<[f64; 2]>,
    triangles: &mut [[u32; 3]],
) -> Result<(), StudyError> {
    let [first, .., last] = *slit else {
        return Err(StudyError::Slit);
    };
    let is_edge = |pair: &[u32]| {
        triangles
            .iter()
            .any(|corners| pair.iter().all(|v| corners.contains(v)))
    };
    if !slit.windows(2).all(is_edge) {
        return Err(StudyError::Slit);
    }
    let (from, to) = (points[first as usize], points[last as usize]);
    let side = |at: [f64; 2]| {
        (to[0] - from[0]) * (at[1] - from[1]) - (to[1] - from[1]) * (at[0] - from[0])
    };
    // At a tip all triangles stay one fan.
    let is_tip = [first, last].map(|end| !is_open(end, triangles));
    for &vertex in slit {
        if (vertex == first && is_tip[0]) || (vertex == last && is_tip[1]) {
            continue;
        }
        let copy = points.len() as u32;
        points.push(points[vertex as usize]);
        for corners in triangles.iter_mut() {
            let middle = [0, 1].map(|axis| {
                let all = corners.map(|corner| points[corner as usize][axis]);
                all.iter().sum::<f64>() / 3.0
            });
            if side(middle) > 0.0 {
                for corner in corners.iter_mut().filter(|corner| **corner == vertex) {
                    *corner = copy;
                }
            }
        }
    }
    Ok(())
}

/// Whether a vertex is on the border: it has more neighbours than triangles.
fn is_open(vertex: u32, triangles: &[[u32; 3]]) -> bool {
    let about = triangles.iter().filter(|corners| corners.contains(&vertex));
    let mut neighbours: Vec<u32> = about
        .clone()
        .flatten()
        .copied()
        .filter(|&v| v != vertex)
        .collect();
    neighbours.sort_unstable();
    neighbours.dedup();
    neighbours.len() > about.count()
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    libm::hypot(a[0] - b[0], a[1] - b[1])
}

fn between(a: [f64; 2], b: [f64; 2], at: f64) -> [f64; 2] {
    [a[0] + at * (b[0] - a[0]), a[1] + at * (b[1] - a[1])]
}

/// The distance of a point from a slit (m).
fn to_slit(slit: &Slit, point: [f64; 2]) -> f64 {
    let along = [slit.to[0] - slit.from[0], slit.to[1] - slit.from[1]];
    let from = [point[0] - slit.from[0], point[1] - slit.from[1]];
    let square = along[0] * along[0] + along[1] * along[1];
    let at = ((from[0] * along[0] + from[1] * along[1]) / square).clamp(0.0, 1.0);
    distance(point, between(slit.from, slit.to, at))
}

#[cfg(test)]
mod tests {
    use super::*;
    use physics::topology::{Reserve, Surface};

    fn surface(mesh: &TriMesh) -> Surface {
        let flat = |corners: &[u32; 3]| {
            corners.map(|v| [mesh.positions[v as usize].x, mesh.positions[v as usize].y])
        };
        let shapes: Vec<_> = mesh.triangles.iter().map(flat).collect();
        let surface = Surface::new(
            mesh.positions.len(),
            &mesh.triangles,
            &shapes,
            Reserve::default(),
        );
        surface.expect("a surface")
    }

    #[test]
    fn every_pattern_fills_the_rectangle_with_sound_triangles() {
        let notch = Slit {
            from: [-0.05, 0.0],
            to: [-0.03, 0.0],
        };
        let inner = Slit {
            from: [0.0, -0.01],
            to: [0.02, 0.012],
        };
        for pattern in Pattern::ALL {
            for triangles in [700, 2800] {
                let rectangle = Rectangle {
                    length: 0.1,
                    width: 0.08,
                    triangles,
                    pattern,
                    slits: &[notch, inner],
                    marks: &[],
                };
                let made = rectangle.mesh().expect("a mesh");
                let surface = surface(&made.mesh);
                assert!((made.mesh.area() - 0.008).abs() < 1e-14);
                let count = made.mesh.triangles.len() as f64 / triangles as f64;
                assert!((0.9..1.15).contains(&count), "{pattern:?}: {count}");
                let smallest = surface.smallest_angle().to_degrees();
                assert!(smallest > 15.0, "{pattern:?} {triangles}: {smallest}");
                // The notch has one tip, and the slit has two. The rectangle with a slit has no other hole.
                assert_eq!(made.tips.len(), 3);
                let (v, t) = (
                    surface.vertex_count() as i64,
                    surface.triangle_count() as i64,
                );
                let open = surface.neighbours().iter().flatten();
                let open = open.filter(|&&n| n == physics::topology::NONE).count() as i64;
                let edges = i64::midpoint(3 * t, open);
                assert_eq!(v - edges + t, 0);
            }
        }
    }
}
