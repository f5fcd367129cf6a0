//! Taking hold of a body and letting go, at rest or in the middle of a motion.
//!
//! Nothing moves when it is taken hold of: a handle holds its vertices where they are, and a support guides them there.
//! What is let go of goes on as it moved. Done at rest, before the first step, either leaves a body that is the same to
//! the last bit as one built so.
//!
//! Solvers number held vertices last, so that they begin another epoch: each makes its matrices and factors anew with its
//! next step.

use super::assembly::Assembly;
use super::handle::{Handle, HandleSpec};
use super::topology::Topology;
use super::{Body, build};
use crate::Vec3;
use crate::error::BodyError;

impl Body {
    /// Takes hold of vertices where they are now, `spec.origin` being given there, too. Returns the handle's number, the
    /// next free one. Takes memory and about as long as building a body does.
    ///
    /// # Errors
    ///
    /// As [`Body::sheet`] for its handles, and [`BodyError::HeldAndGuided`]; nothing is changed then.
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

    /// Lets go of a handle: its vertices go on as they moved. Later handles count one less from now on.
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

    /// Guides vertices along those world axes that are `true`, where they are now until
    /// [`set_support`](Self::set_support) moves them. Returns the support's number.
    ///
    /// Where supports share an axis of a vertex, the later one guides it.
    ///
    /// # Errors
    ///
    /// [`BodyError::Support`], [`BodyError::HeldAndGuided`]; nothing is changed then.
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

    /// Takes a support away: what it guided is free, or another support's that it took it from. Later supports count one
    /// less from now on.
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

    /// The epoch: how often what is connected, held or supported has changed. What a solver made for one epoch is of no
    /// use in another.
    pub fn epoch(&self) -> u64 {
        self.topology.epoch
    }

    fn begin_epoch(&mut self) {
        self.topology.epoch += 1;
        self.state.revision += 1;
        self.forget_promise();
    }

    /// Numbers nodes for the handles that there are now, and lays everything out by them.
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

/// `values`, each at its new place.
fn moved<V: Copy>(values: &[V], place: &[u32], zero: V) -> Vec<V> {
    let mut moved = vec![zero; values.len()];
    for (value, &place) in values.iter().zip(place) {
        moved[place as usize] = *value;
    }
    moved
}
