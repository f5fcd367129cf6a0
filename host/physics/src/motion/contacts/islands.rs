//! Islands: bodies that share rows.

/// Bodies that share rows: a forest (Tarjan, "Efficiency of a good but not linear set union algorithm", 1975).
#[derive(Debug, Default)]
pub(super) struct Islands {
    parent: Vec<usize>,
}

impl Islands {
    /// Each body is an island.
    pub(super) fn begin(&mut self, bodies: usize) {
        self.parent.clear();
        self.parent.extend(0..bodies);
    }

    /// The first body of an island.
    pub(super) fn root(&self, mut body: usize) -> usize {
        while self.parent[body] != body {
            body = self.parent[body];
        }
        body
    }

    /// Joins the islands of two bodies.
    pub(super) fn join(&mut self, one: usize, other: usize) {
        let (one, other) = (self.root(one), self.root(other));
        let (first, second) = (one.min(other), one.max(other));
        self.parent[second] = first;
    }
}
