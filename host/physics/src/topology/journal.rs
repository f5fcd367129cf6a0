//! The changes of an edit: the list of changed triangles, and the values from before, by which a refused edit is undone.

use super::surface::{Reserve, Shape, Surface, copied};

/// A triangle before the edit.
#[derive(Clone, Copy, Debug)]
struct Before {
    triangle: u32,
    corners: [u32; 3],
    neighbours: [u32; 3],
    shape: Shape,
}

/// The most changes of first triangles in one edit: nine in each of two cuts, two in each of two openings.
const FIRSTS: usize = 32;
/// The most triangles that one edit divides: two cuts of two.
const DIVIDED: usize = 4;

/// The changes of one edit.
#[derive(Debug)]
pub(super) struct Journal {
    before: Vec<Before>,
    /// Vertices with their first triangles before each change.
    firsts: Vec<(u32, u32)>,
    touched: Vec<u32>,
    divided: Vec<[u32; 2]>,
    /// The last edit that changed each triangle.
    stamps: Vec<u64>,
    edit: u64,
    /// Numbers of vertices and triangles before the edit.
    counts: Reserve,
}

impl Clone for Journal {
    fn clone(&self) -> Self {
        let triangles = self.stamps.len();
        Self {
            before: copied(&self.before, triangles),
            firsts: copied(&self.firsts, FIRSTS),
            touched: copied(&self.touched, triangles),
            divided: copied(&self.divided, DIVIDED),
            stamps: self.stamps.clone(),
            edit: self.edit,
            counts: self.counts,
        }
    }
}

impl Journal {
    pub(super) fn new(limits: Reserve) -> Self {
        Self {
            before: Vec::with_capacity(limits.triangles),
            firsts: Vec::with_capacity(FIRSTS),
            touched: Vec::with_capacity(limits.triangles),
            divided: Vec::with_capacity(DIVIDED),
            stamps: vec![0; limits.triangles],
            edit: 0,
            counts: Reserve::default(),
        }
    }

    pub(super) fn touched(&self) -> &[u32] {
        &self.touched
    }

    pub(super) fn divided(&self) -> &[[u32; 2]] {
        &self.divided
    }
}

impl Surface {
    /// Begins an edit.
    pub(super) fn begin(&mut self) {
        let counts = Reserve {
            vertices: self.vertex_count(),
            triangles: self.triangle_count(),
        };
        let journal = &mut self.journal;
        journal.before.clear();
        journal.firsts.clear();
        journal.touched.clear();
        journal.divided.clear();
        journal.edit += 1;
        journal.counts = counts;
    }

    /// Numbers of vertices and triangles before the edit.
    pub(super) fn counts_before(&self) -> Reserve {
        self.journal.counts
    }

    /// Notes that the edit changes a triangle, before it does.
    pub(super) fn touch(&mut self, triangle: u32) {
        let t = triangle as usize;
        if self.journal.stamps[t] == self.journal.edit {
            return;
        }
        self.journal.stamps[t] = self.journal.edit;
        self.journal.touched.push(triangle);
        if t < self.journal.counts.triangles {
            self.journal.before.push(Before {
                triangle,
                corners: self.triangles[t],
                neighbours: self.neighbours[t],
                shape: self.shapes[t],
            });
        }
    }

    /// Notes that the edit divides a triangle.
    pub(super) fn note_division(&mut self, parts: [u32; 2]) {
        self.journal.divided.push(parts);
    }

    /// Makes the fan of a vertex begin with the first triangle of the fan that contains `triangle`.
    pub(super) fn begin_fan(&mut self, vertex: u32, triangle: u32) {
        let first = self.first_from(vertex, triangle);
        let old = std::mem::replace(&mut self.first[vertex as usize], first);
        if old != first && (vertex as usize) < self.journal.counts.vertices {
            self.journal.firsts.push((vertex, old));
        }
    }

    /// Ends an edit that succeeded.
    pub(super) fn finish(&mut self) {
        self.journal.touched.sort_unstable();
    }

    /// Takes back all changes of the edit.
    pub(super) fn undo(&mut self) {
        let Reserve {
            vertices,
            triangles,
        } = self.journal.counts;
        self.triangles.truncate(triangles);
        self.neighbours.truncate(triangles);
        self.shapes.truncate(triangles);
        self.parents.truncate(triangles);
        self.origins.truncate(vertices);
        self.first.truncate(vertices);
        for before in &self.journal.before {
            let t = before.triangle as usize;
            self.triangles[t] = before.corners;
            self.neighbours[t] = before.neighbours;
            self.shapes[t] = before.shape;
        }
        while let Some((vertex, first)) = self.journal.firsts.pop() {
            self.first[vertex as usize] = first;
        }
        self.journal.touched.clear();
        self.journal.divided.clear();
    }
}
