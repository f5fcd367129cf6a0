//! Grab and release of handles, addition and lift of supports, at rest or in the middle of a motion.
//!
//! None of these calls moves the body: a new handle holds its vertices at their present positions, and a new support
//! guides its vertices there. Released vertices keep their velocity. At rest, before the first step, a call yields a
//! body that is equal to the last bit to a body built with the same handles and supports.
//!
//! Each call begins a new topology epoch: solvers number held vertices last and leave out guided axes. Each solver
//! builds its matrices and factors again in its next step.

use super::assembly::Assembly;
use super::handle::{Handle, HandleSpec};
use super::topology::Topology;
use super::{Body, build};
use crate::Vec3;
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
            for &vertex in &other.vertices {
                holder[vertex as usize] = Some(held);
            }
        }
        build::check_handle(handle, spec, &mut holder)?;
        for &vertex in &spec.vertices {
            let node = self.topology.node_of_vertex[vertex as usize];
            if let Some(support) = self.constraints.supports.owner_of(node) {
                return Err(BodyError::HeldAndGuided {
                    vertex,
                    handle,
                    support,
                });
            }
        }
        let at = |&vertex: &u32| {
            self.state.x[self.topology.node_of_vertex[vertex as usize] as usize] - spec.origin
        };
        let offsets = spec.vertices.iter().map(at).collect();
        self.constraints.handles.push(Handle::new(0, offsets, spec));
        self.number_anew();
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
        self.number_anew();
        Ok(())
    }

    /// Adds a support that guides vertices along the world axes that are `true`. The vertices stay at their present
    /// positions along these axes until [`set_support`](Self::set_support) moves them. Returns the number of the
    /// support.
    ///
    /// Where several supports guide the same axis of a vertex, the latest of them applies.
    ///
    /// # Errors
    ///
    /// [`BodyError::Support`], [`BodyError::HeldAndGuided`]; nothing has changed then.
    pub fn add_support(&mut self, vertices: &[u32], axes: [bool; 3]) -> Result<usize, BodyError> {
        let support = self.constraints.supports.list.len();
        let free = self.assembly.stiffness.free();
        let mut nodes = Vec::with_capacity(vertices.len());
        for &vertex in vertices {
            let Some(&node) = self.topology.node_of_vertex.get(vertex as usize) else {
                return Err(BodyError::Support {
                    support,
                    found: "it names a vertex that does not exist",
                });
            };
            let holds = |handle: &Handle| handle.nodes().contains(&(node as usize));
            if let Some(handle) = self.constraints.handles.iter().position(holds) {
                return Err(BodyError::HeldAndGuided {
                    vertex,
                    handle,
                    support,
                });
            }
            nodes.push(node);
        }
        let supports = &mut self.constraints.supports;
        let support = supports.add(&nodes, axes, free, &self.state.x)?;
        self.begin_epoch();
        Ok(support)
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
        let free = self.assembly.stiffness.free();
        self.constraints.supports.lift(support, free);
        self.begin_epoch();
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

    /// Numbers the nodes for the present handles, and moves all data by node to the new numbers.
    fn number_anew(&mut self) {
        let count = self.vertex_count();
        let (nodes, free) = Topology::number(count, self.constraints.held());
        let mut place = vec![0; count];
        for (&old, &new) in self.topology.node_of_vertex.iter().zip(&nodes) {
            place[old as usize] = new;
        }
        self.topology.node_of_vertex = nodes;
        for set in &mut self.model.elements {
            set.renumber(&place);
        }
        for vectors in [
            &mut self.state.x,
            &mut self.state.v,
            &mut self.model.rest,
            &mut self.model.external,
        ] {
            *vectors = moved(vectors, &place, Vec3::zeros());
        }
        for numbers in [&mut self.model.mass, &mut self.model.load] {
            *numbers = moved(numbers, &place, 0.0);
        }
        let mut first = free;
        for handle in &mut self.constraints.handles {
            handle.first = first;
            first += handle.offsets.len();
        }
        self.constraints.supports.renumber(&place, free);
        self.assembly = Assembly::new(&mut self.model, &self.topology, free);
        self.begin_epoch();
    }
}

/// `values`, each moved to its new place.
fn moved<V: Copy>(values: &[V], place: &[u32], zero: V) -> Vec<V> {
    let mut moved = vec![zero; values.len()];
    for (value, &place) in values.iter().zip(place) {
        moved[place as usize] = *value;
    }
    moved
}
