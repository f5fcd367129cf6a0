//! Edits of a body that is a sheet which can tear: vertices and triangles are added in place, and the state is carried
//! over.
//!
//! The [surface](crate::topology) of the sheet makes an edit; this module lets the other parts of the body follow.
//! Vertices that the edit adds are appended to the nodes of the body, so that no node gets another number:
//!
//! - A **twin** starts at the position and velocity of the vertex that it was torn from. Each of the two has the mass of
//!   its own triangles, so mass, momentum and energy do not change.
//! - A vertex on a divided edge starts between the ends of the edge. Mass, its centre and momentum do not change. The
//!   lumped kinetic energy falls by the part that the ends had towards each other: a sixth of the mass of the divided
//!   triangles times the square of that velocity, times the two fractions of the edge.
//! - A vertex that **snapped** stays on the material: it moves in space to the place of the material point at which it now is.
//!   The lumped masses of its neighbours change, and with them the momentum; a common velocity of these nodes restores
//!   it.
//!
//! Nothing is allocated within the reserve with which the body was made [tearable](Body::make_tearable). The assembled
//! matrix keeps the pattern of before: [`Body::reassemble`] makes it anew. A
//! [`Stepper`](crate::Stepper) follows an edit without it.

use super::Body;
use super::assembly::Assembly;
use crate::Vec3;
use crate::element::Torn;
use crate::error::TearingError;
use crate::topology::{Done, Edit, Growth, Origin, Reserve, Surface};

/// Most nodes whose mass an edit may change: two growths, each with the fans of the tip, of the vertex ahead and of the
/// ends of a divided edge.
const MOST_NODES: usize = 256;

/// The surface of a sheet that can tear, and what is needed to follow its edits.
#[derive(Debug)]
pub(crate) struct Sheet {
    pub(crate) surface: Surface,
    /// Mass per area at rest, by original triangle (kg/m²).
    areal: Vec<f64>,
    /// The number of edits so far.
    pub(crate) edits: u64,
    /// Nodes whose mass the present edit may change, ascending.
    nodes: Vec<u32>,
    /// Vertices of pieces that leave the scene and have not halted.
    pub(super) leaving: Vec<u32>,
}

impl Clone for Sheet {
    fn clone(&self) -> Self {
        let mut leaving = Vec::with_capacity(self.surface.limits().vertices);
        leaving.extend_from_slice(&self.leaving);
        Self {
            surface: self.surface.clone(),
            areal: self.areal.clone(),
            edits: self.edits,
            nodes: Vec::with_capacity(MOST_NODES),
            leaving,
        }
    }
}

/// The effect of an edit on a body.
#[derive(Clone, Debug)]
pub struct BodyEdit {
    /// The effect of the edit on the surface. Its vertices are nodes of the body.
    pub surface: Done,
    /// The change of the kinetic energy (J).
    pub kinetic: f64,
    /// The change of the potential energy of the loads (J).
    pub potential: f64,
}

impl Body {
    /// Makes a sheet tearable, with room for what edits may add. All vectors by node grow within this room from then
    /// on.
    ///
    /// # Errors
    ///
    /// [`TearingError::Kind`] for a body that is not one set of triangles, or that has clamped borders, and
    /// [`TearingError::Surface`] for triangles that form no surface; nothing has changed then.
    pub fn make_tearable(&mut self, reserve: Reserve) -> Result<(), TearingError> {
        let count = self.topology.vertex_count;
        let kind = |found| Err(TearingError::Kind { found });
        let [set] = self.model.elements.as_mut_slice() else {
            return kind("elements of several kinds");
        };
        if self.state.x.len() != count {
            return kind("clamped borders");
        }
        let triangles: Option<Vec<[u32; 3]>> = (0..set.count())
            .map(|element| set.nodes(element).try_into().ok())
            .collect();
        let all = 0..set.count();
        let (Some(triangles), Some(set)) = (triangles, set.tearable_mut()) else {
            return kind("elements that are not triangles of an isotropic sheet");
        };
        let shapes: Vec<_> = all.clone().map(|element| set.rest_shape(element)).collect();
        let surface = Surface::new(count, &triangles, &shapes, reserve)?;
        let areal = all.map(|element| set.mass(element) / surface.area(element as u32));
        let areal = areal.collect();
        set.reserve(reserve.triangles);
        if let Some(bent) = &mut self.model.bent {
            if !bent.reserve(&surface, reserve.triangles) {
                return kind("stiffness against bending of other triangles");
            }
            // This makes the bending anew, with room for edits.
            self.assembly = Assembly::new(&mut self.model, &self.constraints);
        }
        self.reserve_nodes(reserve.vertices);
        self.sheet = Some(Box::new(Sheet {
            surface,
            areal,
            edits: 0,
            nodes: Vec::with_capacity(MOST_NODES),
            leaving: Vec::with_capacity(count + reserve.vertices),
        }));
        Ok(())
    }

    /// Makes room for `nodes` more nodes.
    fn reserve_nodes(&mut self, nodes: usize) {
        let (state, model, assembly) = (&mut self.state, &mut self.model, &mut self.assembly);
        for vector in [
            &mut state.x,
            &mut state.v,
            &mut state.displacement,
            &mut model.rest,
            &mut model.external,
            &mut assembly.internal,
            &mut assembly.promised,
            &mut assembly.missed,
            &mut assembly.ahead,
        ] {
            vector.reserve(nodes);
        }
        model.mass.reserve(nodes);
        model.load.reserve(nodes);
        assembly.places.reserve(nodes);
        self.constraints.reserve(nodes);
    }

    /// Makes the assembled matrix for the present triangles, if an edit has added nodes since the matrix was made, or nodes
    /// have [halted](Self::halt). This allocates memory and takes about as long as the construction of a body.
    pub fn reassemble(&mut self) {
        let free = self.constraints.free_nodes().count();
        if self.assembly.stiffness.nodes() == self.state.x.len()
            && self.assembly.places.free() == free
        {
            return;
        }
        self.assembly = Assembly::new(&mut self.model, &self.constraints);
        if let Some(sheet) = &self.sheet {
            // Every added vertex came out of the reserve.
            let left = sheet.surface.limits().vertices - sheet.surface.vertex_count();
            self.reserve_nodes(left);
        }
    }

    /// A copy that has the same room for edits.
    #[must_use]
    pub fn copy_with_room(&self) -> Self {
        let mut copy = self.clone();
        if let Some(sheet) = &self.sheet {
            copy.reserve_nodes(sheet.surface.limits().vertices - sheet.surface.vertex_count());
        }
        copy
    }

    /// The number of edits so far.
    pub fn edit_count(&self) -> u64 {
        self.sheet.as_ref().map_or(0, |sheet| sheet.edits)
    }

    /// The surface of a sheet that can tear; `None` for any other body.
    pub fn surface(&self) -> Option<&Surface> {
        self.sheet.as_ref().map(|sheet| &sheet.surface)
    }

    /// Whether a handle holds a vertex, or the vertex is one of a piece that has left the scene.
    pub fn is_held(&self, vertex: u32) -> bool {
        self.constraints.holds(vertex) || self.leaving().contains(&vertex)
    }

    /// The vertex that an added vertex is a twin of; `None` for other vertices.
    pub fn twin_of(&self, vertex: u32) -> Option<u32> {
        match self.surface()?.origin(vertex) {
            Origin::Twin { of } => Some(of),
            Origin::Original | Origin::Between { .. } => None,
        }
    }

    /// The mass per area at rest of the sheet at a vertex (kg/m²); 0 for a body that cannot tear.
    pub fn mass_per_area(&self, vertex: u32) -> f64 {
        let area = self
            .surface()
            .map_or(0.0, |surface| surface.area_of_vertex(vertex));
        if area > 0.0 {
            self.model.mass[vertex as usize] / area
        } else {
            0.0
        }
    }

    /// Positions at rest (m) by node. In a sheet with a flat pattern they are the positions at the start.
    pub fn rest_positions(&self) -> &[Vec3] {
        &self.model.rest
    }

    /// Velocities (m/s) by node.
    pub fn node_velocities(&self) -> &[Vec3] {
        &self.state.v
    }

    /// Makes an edit of a sheet that can tear, and begins a new topology epoch. Nothing is allocated. A stepper has to
    /// [grow](crate::Stepper::grow) with each edit.
    ///
    /// # Errors
    ///
    /// [`TearingError::Kind`] for a body that is not [tearable](Self::make_tearable), [`TearingError::Held`] if the edit
    /// would part vertices that a handle holds, and [`TearingError::Edit`]; nothing has changed then.
    pub fn edit(&mut self, edit: &Edit) -> Result<BodyEdit, TearingError> {
        let Some(mut sheet) = self.sheet.take() else {
            return Err(TearingError::Kind {
                found: "a body that cannot tear",
            });
        };
        let result = self.edit_sheet(&mut sheet, edit);
        self.sheet = Some(sheet);
        result
    }

    fn edit_sheet(&mut self, sheet: &mut Sheet, edit: &Edit) -> Result<BodyEdit, TearingError> {
        if let Some(vertex) = self.parted(&sheet.surface, edit) {
            return Err(TearingError::Held { vertex });
        }
        let done = sheet.surface.edit(edit)?;
        sheet.gather();
        let before = self.sums(&sheet.nodes);
        self.move_nodes(&done);
        for vertex in done.vertices.clone() {
            self.push_node(sheet.surface.origin(vertex));
        }
        self.share_mass(sheet, &done);
        if done.moved.iter().any(Option::is_some) {
            self.keep_momentum(&sheet.nodes, before.momentum);
        }
        self.follow_surface(sheet);
        sheet.edits += 1;
        let after = self.sums(&sheet.nodes);
        Ok(BodyEdit {
            kinetic: after.kinetic - before.kinetic,
            potential: after.potential - before.potential,
            surface: done,
        })
    }

    /// A vertex that a handle holds and that the edit would part from the handle, if there is one.
    fn parted(&self, surface: &Surface, edit: &Edit) -> Option<u32> {
        if self.is_held(edit.tip) {
            return Some(edit.tip);
        }
        let growths = [Some(edit.ahead), edit.behind];
        growths
            .into_iter()
            .flatten()
            .find_map(|growth| match growth {
                // A tear may end at a handle inside the sheet. A border vertex would be doubled.
                Growth::Open { to } => (self.is_held(to) && surface.on_border(to)).then_some(to),
                Growth::Snap { vertex, .. } => self.is_held(vertex).then_some(vertex),
                Growth::Cut { edge: [a, b], .. } => {
                    (self.is_held(a) && self.is_held(b)).then_some(a)
                }
            })
    }

    /// Kinetic energy, potential energy and momentum of those of `nodes` that the body has.
    fn sums(&self, nodes: &[u32]) -> Sums {
        let mut sums = Sums::default();
        for &node in nodes {
            let node = node as usize;
            if let Some(v) = self.state.v.get(node) {
                let mass = self.model.mass[node];
                sums.kinetic += 0.5 * mass * v.norm_squared();
                sums.potential -=
                    self.model.load_factor * self.model.external[node].dot(&self.state.x[node]);
                sums.momentum += v * mass;
            }
        }
        sums
    }

    /// Moves the vertices that snapped to the places of their new material points.
    fn move_nodes(&mut self, done: &Done) {
        let moved = done.moved.iter().flatten();
        for moved in moved {
            let node = moved.vertex as usize;
            for values in [
                &mut self.model.rest,
                &mut self.state.x,
                &mut self.state.v,
                &mut self.state.displacement,
            ] {
                let corners = moved.corners.iter().zip(moved.weights);
                values[node] = corners
                    .map(|(&corner, weight)| values[corner as usize] * weight)
                    .sum();
            }
            self.constraints
                .supports
                .shift(moved.vertex, moved.corners, moved.weights);
        }
    }

    /// Adds a node of an added vertex.
    fn push_node(&mut self, origin: Origin) {
        let (ends, at) = match origin {
            Origin::Twin { of } => ([of; 2], 0.0),
            Origin::Between { ends, weight } => (ends, weight),
            // No edit adds an original vertex.
            Origin::Original => return,
        };
        let [a, b] = ends.map(|end| end as usize);
        let (state, model, assembly) = (&mut self.state, &mut self.model, &mut self.assembly);
        for values in [
            &mut model.rest,
            &mut state.x,
            &mut state.v,
            &mut state.displacement,
        ] {
            // A twin is equal to the last bit.
            let between = if a == b {
                values[a]
            } else {
                values[a] + (values[b] - values[a]) * at
            };
            values.push(between);
        }
        for values in [
            &mut model.external,
            &mut assembly.internal,
            &mut assembly.promised,
            &mut assembly.missed,
            &mut assembly.ahead,
        ] {
            values.push(Vec3::zeros());
        }
        model.mass.push(0.0);
        model.load.push(0.0);
        assembly.places.push();
        self.constraints.push(ends, at);
        self.topology.vertex_count += 1;
    }

    /// Gives the nodes of the edit the mass of their triangles. A force that the host set is shared by a vertex and its
    /// twin as their masses are.
    fn share_mass(&mut self, sheet: &Sheet, done: &Done) {
        let model = &mut self.model;
        let gravity = model.config.gravity;
        for &node in &sheet.nodes {
            let node = node as usize;
            model.external[node] -= gravity * model.load[node];
            let fan = sheet.surface.fan(node as u32);
            let mass = fan.map(|corner| sheet.mass(corner.triangle)).sum::<f64>() / 3.0;
            (model.mass[node], model.load[node]) = (mass, mass);
        }
        for vertex in done.vertices.clone() {
            if let Origin::Twin { of } = sheet.surface.origin(vertex) {
                let (twin, of) = (vertex as usize, of as usize);
                let share = model.load[twin] / (model.load[twin] + model.load[of]);
                let force = model.external[of] * share;
                model.external[twin] = force;
                model.external[of] -= force;
            }
        }
        for &node in &sheet.nodes {
            let node = node as usize;
            model.external[node] += gravity * model.load[node];
        }
    }

    /// Adds a common velocity to `nodes`, so that their momentum is `momentum` again (kg m/s). Held nodes and guided axes
    /// keep their velocity.
    fn keep_momentum(&mut self, nodes: &[u32], momentum: Vec3) {
        let missing = momentum - self.sums(nodes).momentum;
        let mask = self.constraints.supports.mask();
        let free = |node: u32| {
            let all = Vec3::repeat(f64::from(u8::from(!self.constraints.holds(node))));
            mask.map_or(all, |mask| all.component_mul(&mask[node as usize]))
        };
        let mass = |&node: &u32| free(node) * self.model.mass[node as usize];
        let mass: Vec3 = nodes.iter().map(mass).sum();
        let velocity = missing.zip_map(
            &mass,
            |missing, mass| if mass > 0.0 { missing / mass } else { 0.0 },
        );
        for &node in nodes {
            self.state.v[node as usize] += velocity.component_mul(&free(node));
        }
    }

    /// Lets the elements follow the latest edit, and begins an epoch.
    fn follow_surface(&mut self, sheet: &Sheet) {
        let surface = &sheet.surface;
        let torn = Torn {
            surface,
            place: None,
            rest: &self.model.rest,
        };
        for set in &mut self.model.elements {
            if let Some(set) = set.tearable_mut() {
                set.follow(&torn);
            }
        }
        if let Some(bent) = &mut self.model.bent {
            bent.follow(surface);
        }
        if let Some(bending) = &mut self.model.bending {
            let (places, rest) = (&self.assembly.places, &self.model.rest);
            let torn = Torn {
                place: Some(places.of_nodes()),
                ..torn
            };
            let nodes = places.nodes();
            bending.follow(&torn, &|place| rest[nodes[place as usize] as usize]);
        }
        self.topology.epoch += 1;
        self.state.revision += 1;
        self.state.motions += 1;
        self.assembly.at = None;
        self.forget_promise();
    }
}

/// Sums over the nodes of an edit.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    kinetic: f64,
    potential: f64,
    momentum: Vec3,
}

impl Sheet {
    /// Finds the nodes whose mass the latest edit may have changed.
    fn gather(&mut self) {
        self.nodes.clear();
        for &triangle in self.surface.touched() {
            for vertex in self.surface.triangles()[triangle as usize] {
                if let Err(at) = self.nodes.binary_search(&vertex) {
                    self.nodes.insert(at, vertex);
                }
            }
        }
    }

    /// The mass of a triangle (kg).
    fn mass(&self, triangle: u32) -> f64 {
        self.areal[self.surface.parent(triangle) as usize] * self.surface.area(triangle)
    }
}
