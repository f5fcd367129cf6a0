//! Grab and release of handles, addition and lift of supports, at rest or in the middle of a motion.
//!
//! None of these calls moves the body: a new handle holds its vertices at their present positions, and a new support
//! guides its vertices there. Released vertices keep their velocity. At rest, before the first step, a call yields a
//! body that is equal to the last bit to a body built with the same handles and supports.
//!
//! Each call changes the constraints and begins a new topology epoch. No vertex gets another number, and neither state
//! nor model moves. In its next step each solver builds its matrices and factors again.

use super::assembly::Assembly;
use super::border::{self, Border};
use super::handle::{Handle, HandleSpec};
use super::support::SupportSpec;
use super::{Body, build};
use crate::error::BodyError;

impl Body {
    /// Adds a handle that holds vertices at their present positions; `spec.origin` is the origin of the handle at
    /// present. Returns the number of the handle, which is the number of handles before the call. The call allocates
    /// memory and takes about as long as the construction of a body.
    ///
    /// # Errors
    ///
    /// As [`Body::sheet`] for its handles, and [`BodyError::HeldAndGuided`]; nothing has changed then.
    pub fn grab(&mut self, spec: &HandleSpec) -> Result<usize, BodyError> {
        let handle = self.constraints.handles.len();
        let mut holder = vec![None; self.vertex_count()];
        for (held, other) in self.constraints.handles.iter().enumerate() {
            for &vertex in other.own() {
                holder[vertex as usize] = Some(held);
            }
        }
        build::check_handle(handle, spec, &mut holder)?;
        for &vertex in &spec.vertices {
            if let Some(support) = self.constraints.supports.owner_of(vertex) {
                return Err(BodyError::HeldAndGuided {
                    vertex,
                    handle,
                    support,
                });
            }
        }
        let clamps = build::clamps_of_handle(handle, spec, self.model.bent.as_ref())?;
        let held = Handle::new(&self.state.x, spec, clamps);
        self.constraints.handles.push(held);
        self.follow_handles();
        Ok(handle)
    }

    /// Removes a handle. Its vertices keep their velocity. The numbers of later handles decrease by one.
    ///
    /// # Errors
    ///
    /// [`BodyError::NoHandle`] for a handle that does not exist.
    pub fn release(&mut self, handle: usize) -> Result<(), BodyError> {
        let count = self.constraints.handles.len();
        if handle >= count {
            return Err(BodyError::NoHandle { handle, count });
        }
        self.constraints.handles.remove(handle);
        self.follow_handles();
        Ok(())
    }

    /// Adds a support that guides vertices along the world axes that are `true`. The vertices stay at their present
    /// positions along these axes until [`set_support`](Self::set_support) moves them. Returns the number of the
    /// support.
    ///
    /// If several supports guide the same axis of a vertex, the latest of them applies.
    ///
    /// # Errors
    ///
    /// [`BodyError::Support`], [`BodyError::HeldAndGuided`]; nothing has changed then.
    pub fn add_support(&mut self, vertices: &[u32], axes: [bool; 3]) -> Result<usize, BodyError> {
        self.add_support_of(vertices, axes, Border::Hinged)
    }

    /// Adds a support that holds vertices along all axes and clamps the border of a sheet that bends: the sheet leaves the
    /// edges of the border between these vertices in its present direction. All else is as with
    /// [`add_support`](Self::add_support). The clamp stays with this support if a later support guides the same
    /// vertices.
    ///
    /// # Errors
    ///
    /// As [`add_support`](Self::add_support), and [`BodyError::Clamp`] for a body without bending and for vertices that
    /// no edge of the border joins; nothing has changed then.
    pub fn add_clamp(&mut self, vertices: &[u32]) -> Result<usize, BodyError> {
        self.add_support_of(vertices, [true; 3], Border::Clamped)
    }

    fn add_support_of(
        &mut self,
        vertices: &[u32],
        axes: [bool; 3],
        border: Border,
    ) -> Result<usize, BodyError> {
        let support = SupportSpec {
            vertices: vertices.to_vec(),
            axes,
            border,
        };
        self.add_supports(&[support])
    }

    /// Adds supports, in their order, as [`add_support`](Self::add_support) and [`add_clamp`](Self::add_clamp) add one. The
    /// matrix is built once for all of them. Returns the number of the first.
    ///
    /// # Errors
    ///
    /// As the calls for one support; nothing has changed then.
    pub fn add_supports(&mut self, specs: &[SupportSpec]) -> Result<usize, BodyError> {
        let first = self.constraints.supports.list.len();
        let mut holder = vec![None; self.topology.vertex_count];
        for (handle, held) in self.constraints.handles.iter().enumerate() {
            for &vertex in held.own() {
                holder[vertex as usize] = Some(handle);
            }
        }
        let rigid = self.rigid_triangles();
        for spec in specs {
            if let Err(error) = self.add_unlaid(spec, &holder) {
                self.constraints.supports.list.truncate(first);
                return Err(error);
            }
        }
        if !specs.is_empty() {
            self.follow_supports(&rigid);
        }
        Ok(first)
    }

    /// Adds a support that has still to be laid. `holder`: the handle that holds each vertex.
    fn add_unlaid(
        &mut self,
        spec: &SupportSpec,
        holder: &[Option<usize>],
    ) -> Result<(), BodyError> {
        let support = self.constraints.supports.list.len();
        for &vertex in &spec.vertices {
            match holder.get(vertex as usize) {
                None => {
                    return Err(BodyError::Support {
                        support,
                        found: "it names a vertex that does not exist",
                    });
                }
                Some(&Some(handle)) => {
                    return Err(BodyError::HeldAndGuided {
                        vertex,
                        handle,
                        support,
                    });
                }
                Some(None) => {}
            }
        }
        let axes = match spec.border {
            Border::Hinged => spec.axes,
            Border::Clamped => [true; 3],
        };
        let bent = self.model.bent.as_ref();
        let clamps = border::clamps(spec.border, &spec.vertices, bent);
        let clamps = clamps.map_err(|found| BodyError::Clamp {
            part: "support",
            number: support,
            found,
        })?;
        let supports = &mut self.constraints.supports;
        supports.add(&spec.vertices, axes, clamps, &self.state.x)?;
        Ok(())
    }

    /// Removes a support. Its vertices become free along its axes, or return to an earlier support that guides the same
    /// axes. The numbers of later supports decrease by one.
    ///
    /// # Errors
    ///
    /// [`BodyError::Support`] for a support that does not exist.
    pub fn lift_support(&mut self, support: usize) -> Result<(), BodyError> {
        if support >= self.constraints.supports.list.len() {
            return Err(BodyError::Support {
                support,
                found: "it does not exist",
            });
        }
        let rigid = self.rigid_triangles();
        self.constraints.supports.lift(support);
        self.follow_supports(&rigid);
        Ok(())
    }

    /// The topology epoch: the number of changes of connectivity, handles and supports. Data that a solver made for one
    /// epoch are invalid in another.
    pub fn epoch(&self) -> u64 {
        self.topology.epoch
    }

    fn begin_epoch(&mut self) {
        self.topology.epoch += 1;
        self.state.revision += 1;
        self.forget_promise();
    }

    /// Whether the motion of each triangle of a sheet that bends is prescribed. Such a triangle clamps its neighbours.
    fn rigid_triangles(&self) -> Vec<bool> {
        let is_rigid = |nodes: &[u32; 3]| self.constraints.prescribe_all(nodes);
        let bent = self.model.bent.as_ref();
        bent.map_or_else(Vec::new, |sheet| sheet.rigid(is_rigid))
    }

    /// Lays the ghosts, and takes the mask of the present supports. Other triangles may be rigid than `before`; the
    /// bending is then built again.
    fn follow_supports(&mut self, before: &[bool]) {
        let other_ghosts = self.lay_ghosts();
        if !other_ghosts && self.rigid_triangles() == before {
            self.assembly.guide(&self.constraints);
        } else {
            self.assembly = Assembly::new(&mut self.model, &self.constraints);
        }
        self.begin_epoch();
    }

    /// Lays the ghosts of the present constraints. Returns whether they have changed.
    fn lay_ghosts(&mut self) -> bool {
        border::lay(
            self.topology.vertex_count,
            &mut self.constraints,
            &mut self.model,
            &mut self.state,
        )
    }

    /// Lays the ghosts, builds the matrix for the present handles, and discards what the last step left.
    fn follow_handles(&mut self) {
        self.lay_ghosts();
        self.constraints.forget_grips();
        self.state.forget_step();
        self.assembly = Assembly::new(&mut self.model, &self.constraints);
        self.begin_epoch();
    }
}
