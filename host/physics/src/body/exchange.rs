//! The replacement of a body in the middle of a motion: by one of another material, with other handles and supports,
//! or with another mesh.
//!
//! The new body is built while the old one still moves, and takes over the motion at the end ([`Body::continue_from`]).
//! A [`BodyMap`] names the vertex, the handle and the support of the old body that each one of the new body continues.

use super::Body;
use super::handle::HandlePose;
use crate::Vec3;
use crate::error::BodyError;

/// For each vertex, handle and support of a new body: the one of the old body that it continues.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BodyMap {
    /// For each new vertex the old vertex at whose position and velocity it starts. A tear gives two new vertices the
    /// same old vertex.
    pub vertices: Vec<u32>,
    /// For each new handle the old handle that it continues; `None` for a handle that is grabbed.
    pub handles: Vec<Option<usize>>,
    /// For each new support the old support that it continues; `None` for a support that is added.
    pub supports: Vec<Option<usize>>,
}

impl BodyMap {
    /// The map from `body` to a body with the same vertices, handles and supports.
    pub fn identity(body: &Body) -> Self {
        Self {
            vertices: (0..body.vertex_count() as u32).collect(),
            handles: (0..body.handle_count()).map(Some).collect(),
            supports: (0..body.support_count()).map(Some).collect(),
        }
    }

    /// The map of two changes: this map, and then `next`.
    #[must_use]
    pub fn then(&self, next: &Self) -> Self {
        let through = |list: &[Option<usize>], next: &[Option<usize>]| -> Vec<Option<usize>> {
            let first = |&at: &Option<usize>| at.and_then(|at| list.get(at).copied().flatten());
            next.iter().map(first).collect()
        };
        let vertices = next.vertices.iter();
        Self {
            vertices: vertices
                .map(|&vertex| {
                    let first = self.vertices.get(vertex as usize);
                    first.copied().unwrap_or(u32::MAX)
                })
                .collect(),
            handles: through(&self.handles, &next.handles),
            supports: through(&self.supports, &next.supports),
        }
    }

    /// Checks that the map leads from `old` to `new`.
    ///
    /// # Errors
    ///
    /// [`BodyError::Length`], [`BodyError::Map`] and [`BodyError::Left`].
    pub fn check(&self, old: &Body, new: &Body) -> Result<(), BodyError> {
        let lengths = [
            ("map of vertices", self.vertices.len(), new.vertex_count()),
            ("map of handles", self.handles.len(), new.handle_count()),
            ("map of supports", self.supports.len(), new.support_count()),
        ];
        for (quantity, found, expected) in lengths {
            if found != expected {
                return Err(BodyError::Length {
                    quantity,
                    found,
                    expected,
                });
            }
        }
        let numbers = |list: &[Option<usize>]| list.iter().copied().flatten().max();
        let largest = [
            (
                "map of vertices",
                self.vertices.iter().max().map(|&vertex| vertex as usize),
                old.vertex_count(),
            ),
            ("map of handles", numbers(&self.handles), old.handle_count()),
            (
                "map of supports",
                numbers(&self.supports),
                old.support_count(),
            ),
        ];
        for (part, largest, count) in largest {
            if let Some(found) = largest.filter(|&found| found >= count) {
                return Err(BodyError::Map { part, found, count });
            }
        }
        let gone = old.constraints.gone();
        let stays = |vertex: u32| !new.constraints.gone().contains(&vertex);
        let mut left = (0_u32..).zip(&self.vertices);
        match left.find(|(vertex, from)| gone.contains(from) && stays(*vertex)) {
            Some((vertex, &from)) => Err(BodyError::Left { vertex, from }),
            None => Ok(()),
        }
    }
}

impl Body {
    /// Continues the motion of `old` where `map` leads: copies positions, velocities, handle reports, and the
    /// displacements and reactions of supports. Materials and loads stay those of this body. A softer body stores less
    /// energy in the same shape; the difference of the energies is lost.
    ///
    /// A handle that `map` does not lead to holds its vertices from where they are now, at the pose that it was built
    /// with; [`hold_at`](Self::hold_at) gives it another. A new support guides its vertices from where they are now.
    ///
    /// # Errors
    ///
    /// [`BodyError::Length`] and [`BodyError::Map`] for a map that does not lead from `old` to this body, and
    /// [`BodyError::Left`] for a vertex that is no longer in the scene; nothing has changed then.
    pub fn continue_from(&mut self, old: &Self, map: &BodyMap) -> Result<(), BodyError> {
        map.check(old, self)?;
        for (node, &from) in map.vertices.iter().enumerate() {
            self.state.x[node] = old.state.x[from as usize];
            self.state.v[node] = old.state.v[from as usize];
        }
        self.place_ghosts(old, map);
        for (handle, from) in map.handles.iter().enumerate() {
            if let Some(from) = *from {
                self.constraints.handles[handle].report = old.constraints.handles[from].report;
            } else {
                let pose = self.constraints.handles[handle].report.pose;
                self.take_hold(handle, &pose);
            }
        }
        for (support, from) in map.supports.iter().enumerate() {
            if let Some(from) = *from {
                let from = &old.constraints.supports.list[from];
                let entry = &mut self.constraints.supports.list[support];
                entry.displacement = from.displacement;
                entry.reaction = from.reaction;
            } else {
                self.constraints.supports.settle(support, &self.state.x);
            }
        }
        self.note_moved();
        Ok(())
    }

    /// Counts the epochs of this body on from those of `old`, which it replaces: what was made for an epoch of `old` is for none
    /// of this body. Solvers are made afterwards.
    pub fn follow_epochs(&mut self, old: &Self) {
        self.topology.epoch = self.topology.epoch.max(old.topology.epoch + 1);
    }

    /// Places the ghosts. The ghost of an edge that `old` clamps, too, keeps its position; any other ghost continues the sheet.
    fn place_ghosts(&mut self, old: &Self, map: &BodyMap) {
        for clamp in self.constraints.clamps() {
            let node = clamp.ghost as usize;
            let ends = clamp.side.ends.map(|end| map.vertices[end as usize]);
            let from = old.constraints.clamps().find(|other| other.joins(ends));
            for (now, then) in [
                (&mut self.state.x, &old.state.x),
                (&mut self.state.v, &old.state.v),
            ] {
                now[node] =
                    from.map_or_else(|| clamp.extend(now), |from| then[from.ghost as usize]);
            }
        }
    }

    /// Gives a handle the pose `pose`; its vertices stay where they are and move with the handle from now on.
    ///
    /// # Errors
    ///
    /// [`BodyError::NoHandle`] for a handle that does not exist, and [`BodyError::Pose`] for a pose that is not finite;
    /// nothing has changed then.
    pub fn hold_at(&mut self, handle: usize, pose: &HandlePose) -> Result<(), BodyError> {
        let count = self.constraints.handles.len();
        if handle >= count {
            return Err(BodyError::NoHandle { handle, count });
        }
        if !pose.is_finite() {
            return Err(BodyError::Pose { handle });
        }
        self.take_hold(handle, pose);
        self.note_moved();
        Ok(())
    }

    /// Makes the offsets of a handle those of its nodes from `pose`.
    fn take_hold(&mut self, handle: usize, pose: &HandlePose) {
        let held = &mut self.constraints.handles[handle];
        held.report.pose = *pose;
        held.report.linear_velocity = Vec3::zeros();
        held.report.angular_velocity = Vec3::zeros();
        let back = pose.rotation.inverse();
        for (offset, &vertex) in held.offsets.iter_mut().zip(&held.vertices) {
            *offset = back * (self.state.x[vertex as usize] - pose.position);
        }
    }

    /// Notes that the state has changed outside a step.
    fn note_moved(&mut self) {
        self.forget_promise();
        self.state.revision += 1;
        self.state.motions += 1;
    }
}
