//! The surface of a body: what a person sees of its mesh.
//!
//! A sheet shows all its triangles, a thread all its bars, and a solid its boundary.

use super::field::{Record, Visitor, fields, record};
use super::kind::{Stamp, kind};
use physics::mesh::Mesh;
use serde::{Deserialize, Serialize};

/// The connectivity of a body as a person sees it: sent before the first frame of each topology epoch.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Surface {
    /// Index of the body.
    pub body: u32,
    /// Topology epoch.
    pub epoch: u32,
    /// Number of vertices of the body, including those inside.
    pub vertices: u32,
    /// Number of triangles.
    pub triangle_count: u32,
    /// Number of lines.
    pub line_count: u32,
    /// Positions at rest (m), three numbers a vertex. In the binary part, as are the next two.
    #[serde(skip)]
    pub rest: Vec<f32>,
    /// The triangles of a sheet, or of the boundary of a solid, whose corners run counterclockwise seen from outside:
    /// three vertices each. A quadratic face is divided into four triangles.
    #[serde(skip)]
    pub triangles: Vec<u32>,
    /// The bars of a thread: two vertices each.
    #[serde(skip)]
    pub lines: Vec<u32>,
}

impl Surface {
    /// The surface of a mesh, for the body of index `body` in this topology epoch.
    pub fn of_mesh(body: usize, epoch: u64, mesh: &Mesh) -> Self {
        let (triangles, lines) = match mesh {
            Mesh::Thread(mesh) => (Vec::new(), mesh.lines.as_flattened().to_vec()),
            Mesh::Sheet(mesh) => (mesh.triangles.as_flattened().to_vec(), Vec::new()),
            Mesh::Solid(mesh) => (mesh.boundary().into_flattened(), Vec::new()),
        };
        let positions = mesh.positions();
        Self {
            body: body as u32,
            epoch: epoch as u32,
            vertices: positions.len() as u32,
            triangle_count: (triangles.len() / 3) as u32,
            line_count: (lines.len() / 2) as u32,
            rest: positions
                .iter()
                .flat_map(|p| [p.x as f32, p.y as f32, p.z as f32])
                .collect(),
            triangles,
            lines,
        }
    }
}

impl Surface {
    /// The stamp of its message for the first frame with this surface, at `time_ns`.
    pub fn stamp(&self, time_ns: u64) -> Stamp {
        Stamp {
            body: self.body as usize,
            number: Some(self.epoch),
            time_ns,
        }
    }
}

kind! { Surface: "palpate_msgs/msg/Surface", Frames, |body| format!("/bodies/{body}/surface"); }

record! { Surface: Self::default(), Self::count;
    "# The surface of a body in one topology epoch.";
    "uint32 body         # index in a tick's bodies" body;
    "uint32 epoch        # topology epoch" epoch;
    "uint32 vertices     # number of vertices of the body, including those inside" vertices;
    "float32[] rest      # positions at rest (m), three numbers a vertex" rest;
    "uint32[] triangles  # three vertices each" triangles;
    "uint32[] lines      # the bars of a thread, two vertices each" lines;
    triangle_count: skip;
    line_count: skip;
}

impl Surface {
    /// Counts triangles and lines. `None` if the numbers contradict each other.
    fn count(&mut self) -> Option<()> {
        self.triangle_count = self.triangles.len() as u32 / 3;
        self.line_count = self.lines.len() as u32 / 2;
        let inside = |indices: &[u32]| indices.iter().all(|index| *index < self.vertices);
        let whole = self.rest.len() as u64 == 3 * u64::from(self.vertices)
            && self.triangles.len().is_multiple_of(3)
            && self.lines.len().is_multiple_of(2);
        (whole && inside(&self.triangles) && inside(&self.lines)).then_some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::BodyFrame;
    use crate::record::Kind;
    use crate::record::cdr::decode;
    use physics::Vec3;
    use physics::mesh::generate::{self, Pattern};
    use physics::mesh::generate_box::solid_box;
    use physics::mesh::generate_thread::straight_thread;
    use std::collections::BTreeMap;

    fn corners(surface: &Surface) -> Vec<[Vec3; 3]> {
        let at = |v: u32| {
            let p = &surface.rest[3 * v as usize..][..3];
            Vec3::new(p[0].into(), p[1].into(), p[2].into())
        };
        let (triangles, _) = surface.triangles.as_chunks::<3>();
        triangles.iter().map(|t| t.map(at)).collect()
    }

    /// The volume by the divergence theorem: a third of the flux of the position.
    fn volume(surface: &Surface) -> f64 {
        let each = corners(surface).into_iter();
        each.map(|[a, b, c]| a.dot(&b.cross(&c)) / 6.0).sum()
    }

    /// Every edge is passed once in each direction.
    fn is_closed(surface: &Surface) -> bool {
        let mut passed: BTreeMap<(u32, u32), i32> = BTreeMap::new();
        let (triangles, _) = surface.triangles.as_chunks::<3>();
        for [a, b, c] in triangles {
            for (from, to) in [(a, b), (b, c), (c, a)] {
                *passed.entry((*from.min(to), *from.max(to))).or_default() +=
                    if from < to { 1 } else { 100 };
            }
        }
        passed.values().all(|count| *count == 101)
    }

    #[test]
    fn the_boundary_of_a_box_is_closed_and_faces_outwards() {
        let mesh = solid_box([0.1, 0.2, 0.05], [3, 4, 2]).expect("a box");
        let quadratic = mesh.quadratic();
        // Two triangles on each face of a grid cell on the boundary.
        let linear = 2 * 2 * (3 * 4 + 4 * 2 + 3 * 2);
        for (mesh, expected) in [(mesh, linear), (quadratic, 4 * linear)] {
            let surface = Surface::of_mesh(2, 7, &Mesh::Solid(mesh));
            assert_eq!((surface.body, surface.epoch), (2, 7));
            assert_eq!(surface.triangle_count, expected);
            assert_eq!(surface.triangles.len(), 3 * expected as usize);
            assert!(is_closed(&surface));
            // Positions are rounded to f32, to 6e-8 of their size.
            assert!((volume(&surface) / 1e-3 - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn a_bent_quadratic_face_bends_the_surface() {
        let mut mesh = solid_box([0.1; 3], [1; 3]).expect("a box").quadratic();
        let straight = volume(&Surface::of_mesh(0, 0, &Mesh::Solid(mesh.clone())));
        // The middle of the diagonal of the top is the only vertex in the middle of the top.
        let top = mesh
            .positions
            .iter_mut()
            .find(|p| p.x.abs() < 1e-9 && p.y.abs() < 1e-9 && p.z > 0.04)
            .expect("a middle");
        top.z += 0.01;
        let bent = volume(&Surface::of_mesh(0, 0, &Mesh::Solid(mesh)));
        // Of the eight triangles of the top, six meet in this vertex: 6/8 of the area, raised by a third of 1 cm.
        let expected = 0.75 * 0.01 * 0.01 / 3.0;
        assert!(
            (bent - straight - expected).abs() < 1e-9,
            "{}",
            bent - straight
        );
    }

    #[test]
    fn a_sheet_shows_its_triangles_and_a_thread_its_bars() {
        let sheet = generate::sheet(0.2, 0.1, 4, 3, Pattern::Alternating).expect("a sheet");
        let (vertices, triangles) = (sheet.positions.len(), sheet.triangles.len());
        let surface = Surface::of_mesh(0, 0, &Mesh::Sheet(sheet));
        assert_eq!(
            (surface.vertices, surface.triangle_count),
            (vertices as u32, triangles as u32)
        );
        let areas = corners(&surface).into_iter();
        let twice: f64 = areas.map(|[a, b, c]| (b - a).cross(&(c - a)).norm()).sum();
        assert!((0.5 * twice / 0.02 - 1.0).abs() < 1e-6 && surface.lines.is_empty());

        let thread = straight_thread(0.3, 7).expect("a thread");
        let surface = Surface::of_mesh(0, 0, &Mesh::Thread(thread));
        assert_eq!((surface.line_count, surface.lines.len()), (7, 14));
        assert!(surface.triangles.is_empty());
    }

    #[test]
    fn a_frame_and_a_surface_are_read_back() {
        let frame = BodyFrame {
            body: 1,
            step: 7,
            time_ns: 9,
            epoch: 3,
        };
        assert_eq!(decode(&frame.message()), Some(frame));
        let surface = Surface {
            body: 1,
            epoch: 2,
            vertices: 3,
            triangle_count: 1,
            line_count: 1,
            rest: (0..9_u8).map(f32::from).collect(),
            triangles: vec![0, 1, 2],
            lines: vec![2, 0],
        };
        let message = surface.clone().message();
        assert_eq!(decode(&message), Some(surface));
        for cut in 0..message.len() {
            assert_eq!(decode::<Surface>(&message[..cut]), None, "{cut}");
        }
    }

    #[test]
    fn a_surface_with_a_vertex_that_does_not_exist_is_refused() {
        let surface = Surface {
            vertices: 1,
            rest: vec![0.0; 3],
            triangles: vec![0, 0, 1],
            ..Surface::default()
        };
        assert_eq!(decode::<Surface>(&surface.message()), None);
    }
}
