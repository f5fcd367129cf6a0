//! The sides of contacts: surfaces of bodies that may tear, obstacles, and how they meet.

use super::clearance::Clearance;
use super::{Contacts, MOST_BODIES, ROWS_PER_VERTEX, Side};
use crate::Vec3;
use crate::body::Body;
use crate::contact::obstacle::{Geometry, Motion, Obstacle};
use crate::contact::{Meeting, Placed, Rows, Skin, Surfaces};
use crate::mesh::{Mesh, MeshError, TriMesh};

/// What one part of the surfaces is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Owner {
    Body(usize),
    Obstacle(usize),
}

/// Where the surface of a part comes from.
#[derive(Clone, Debug)]
pub(super) struct Source {
    /// The mesh. Positions are those at rest; those without an element are room for vertices that tears will add.
    pub(super) mesh: Mesh,
    pub(super) skin: Skin,
    pub(super) tears: bool,
    /// Whether it keeps the shape of the mesh.
    pub(super) is_rigid: bool,
}

impl Source {
    /// The surface of a body with this mesh.
    pub(super) fn of(body: &Body, mut mesh: Mesh, skin: Skin) -> Self {
        let tears = body.surface().is_some();
        let positions = match &mut mesh {
            Mesh::Sheet(mesh) => &mut mesh.positions,
            Mesh::Solid(mesh) => &mut mesh.positions,
            Mesh::Thread(mesh) => &mut mesh.positions,
        };
        positions.clear();
        positions.extend_from_slice(&body.model.rest);
        if let Some(surface) = body.surface() {
            positions.resize(surface.limits().vertices, Vec3::zeros());
        }
        Self {
            mesh,
            skin,
            tears,
            is_rigid: false,
        }
    }

    pub(super) fn add_to(&self, surfaces: &mut Surfaces) -> Result<(), MeshError> {
        let part = surfaces.add(&self.mesh, self.skin)?;
        if self.tears {
            surfaces.tears(part, self.mesh.positions());
        }
        if self.is_rigid {
            surfaces.is_rigid(part, self.mesh.positions())?;
        }
        Ok(())
    }
}

/// How sides meet, by pair.
#[derive(Clone, Debug, Default)]
pub(super) struct Meetings {
    pub(super) count: usize,
    /// `None` for sides that do not touch.
    pub(super) of: Vec<Option<Meeting>>,
}

impl Meetings {
    pub(super) fn get(&self, one: usize, other: usize) -> Option<Meeting> {
        self.of[one * self.count + other]
    }

    /// Two sides touch no longer.
    pub(super) fn forget(&mut self, one: usize, other: usize) {
        self.of[one * self.count + other] = None;
        self.of[other * self.count + one] = None;
    }
}

impl Contacts {
    /// Adds the surface of the body of this number, of at most [`MOST_BODIES`].
    ///
    /// # Errors
    ///
    /// [`MeshError`] if the triangles of the mesh are no surface.
    pub fn add_body(
        &mut self,
        number: usize,
        body: &Body,
        mesh: Mesh,
        skin: Skin,
    ) -> Result<(), MeshError> {
        let source = Source::of(body, mesh, skin);
        source.add_to(&mut self.surfaces)?;
        self.sources.push(source);
        self.owners.push(Owner::Body(number));
        Ok(())
    }

    /// Follows the body of this number, whose connectivity has changed, with its new mesh. `continues` names the vertex of the body
    /// before that each vertex continues, if it is another body: contacts of vertices that nothing continues begin without
    /// force. This allocates.
    ///
    /// # Errors
    ///
    /// [`MeshError`] if the triangles of the mesh are no surface; the contacts are unchanged then.
    pub fn follow(
        &mut self,
        number: usize,
        body: &Body,
        mesh: Mesh,
        continues: Option<&[u32]>,
    ) -> Result<(), MeshError> {
        let Some(part) = self.owners.iter().position(|of| *of == Owner::Body(number)) else {
            return Ok(());
        };
        let source = Source::of(body, mesh, self.sources[part].skin);
        let mut surfaces = Surfaces::default();
        for (other, old) in self.sources.iter().enumerate() {
            let source = if other == part { &source } else { old };
            source.add_to(&mut surfaces)?;
        }
        self.sources[part] = source;
        let former = core::mem::replace(&mut self.surfaces, surfaces);
        self.keep_apart();
        self.lists = None;
        self.clearance = Clearance::default();
        if former.vertices != self.surfaces.vertices || continues.is_some() {
            self.renumber(&former, part, continues);
        } else {
            self.surfaces.keep_open(former.opened());
        }
        Ok(())
    }

    /// Makes the vectors of a step for other numbers of vertices than those of the `former` surfaces, and lets the contacts follow.
    fn renumber(&mut self, former: &Surfaces, part: usize, continues: Option<&[u32]>) {
        let rows = core::mem::replace(&mut self.rows, Rows::new(former, 0));
        self.reserve();
        let mut now = vec![None; former.parts[part].vertices.len()];
        match continues {
            Some(continues) => {
                for (vertex, from) in (0_u32..).zip(continues) {
                    if let Some(now) = now.get_mut(*from as usize) {
                        now.get_or_insert(vertex);
                    }
                }
            }
            None => now
                .iter_mut()
                .zip(0..)
                .for_each(|(now, own)| *now = Some(own)),
        }
        let count = self.surfaces.parts[part].vertices.len() as u32;
        let number = |vertex: u32| {
            let of = former.part_of(vertex);
            let own = vertex - former.parts[of].vertices.start;
            let own = if of == part {
                now[own as usize].filter(|own| *own < count)
            } else {
                Some(own)
            };
            own.map(|own| self.surfaces.parts[of].vertices.start + own)
        };
        self.rows.take_from(&rows, &number);
        let opened = former
            .opened()
            .filter_map(|[a, b]| Some([number(a)?, number(b)?]));
        let opened: Vec<_> = opened.collect();
        self.surfaces.keep_open(opened.into_iter());
    }

    /// Adds an obstacle: a part of the surfaces, or a shape that meets their vertices.
    ///
    /// # Errors
    ///
    /// [`MeshError`] if the triangles are no surface.
    pub fn add_obstacle(&mut self, obstacle: Obstacle) -> Result<(), MeshError> {
        let number = self.obstacles.len();
        if let Some((positions, triangles)) = obstacle.surface() {
            let (positions, triangles) = (positions.to_vec(), triangles.to_vec());
            let skin = Skin {
                radius: 0.0,
                touches_itself: false,
                is_obstacle: true,
            };
            let source = Source {
                mesh: Mesh::Sheet(TriMesh::new(positions, triangles)?),
                skin,
                tears: false,
                is_rigid: !matches!(obstacle.motion(), Motion::Frames(_)),
            };
            source.add_to(&mut self.surfaces)?;
            self.sources.push(source);
            self.owners.push(Owner::Obstacle(number));
        } else if let Geometry::Shape(shape) = obstacle.geometry() {
            let pose = obstacle.pose(0.0);
            self.of_shapes.push(number);
            self.shapes.push(Placed {
                shape: shape.clone(),
                start: pose,
                end: pose,
                holds: false,
            });
        }
        self.obstacles.push(obstacle);
        Ok(())
    }

    /// Ends the lists of bodies and obstacles. `meeting` tells how two sides meet;
    /// `None` for sides that do not touch.
    pub fn complete(&mut self, meeting: &dyn Fn(Side, Side) -> Option<Meeting>) {
        let sides = self.sides();
        let mut of = Vec::with_capacity(sides.len() * sides.len());
        for one in &sides {
            of.extend(sides.iter().map(|other| meeting(*one, *other)));
        }
        self.meetings = Meetings {
            count: sides.len(),
            of,
        };
        self.keep_apart();
        self.reserve();
    }

    /// Keeps parts from touching that do not meet. Pairs are listed up to the sum of the radii of their parts, which is at least
    /// the distance at which they meet.
    pub(super) fn keep_apart(&mut self) {
        for part in 0..self.surfaces.parts.len() {
            let meetings =
                (0..self.meetings.count).filter_map(|other| self.meetings.get(part, other));
            let farthest = meetings.map(|meeting| meeting.distance).fold(0.0, f64::max);
            let own = self.meetings.get(part, part);
            let part = &mut self.surfaces.parts[part];
            part.radius = part.radius.max(0.5 * farthest);
            part.thickness = own.map_or(part.thickness, |meeting| meeting.distance);
        }
        for one in 0..self.surfaces.parts.len() {
            for other in one + 1..self.surfaces.parts.len() {
                if self.meetings.get(one, other).is_none() {
                    self.surfaces.keep_apart(one, other);
                }
            }
        }
    }

    /// Makes the vectors of a step.
    pub(super) fn reserve(&mut self) {
        let vertices = self.surfaces.vertices;
        let ahead = &mut self.foreseen;
        let vectors = [&mut self.x, &mut self.u, &mut self.v];
        for vectors in vectors
            .into_iter()
            .chain([&mut ahead.x, &mut ahead.u, &mut ahead.v])
        {
            *vectors = vec![Vec3::zeros(); vertices];
        }
        self.mass = vec![f64::INFINITY; vertices];
        self.fractions = vec![1.0; vertices];
        self.pushed = vec![0.0; vertices];
        let most = ROWS_PER_VERTEX * vertices;
        self.rows = Rows::new(&self.surfaces, most);
        self.foreseen.rows = Rows::new(&self.surfaces, most);
        self.touches.reserve(most);
        self.of_row.reserve(most);
        self.springs.reserve(2 * most);
        let sides = self.meetings.count;
        self.touching.reserve(sides * (sides + 1) / 2);
        self.is_near = vec![false; MOST_BODIES];
        self.islands.begin(MOST_BODIES);
    }

    /// The sides: the parts, and after them the shapes.
    pub fn sides(&self) -> Vec<Side> {
        let count = self.owners.len() + self.of_shapes.len();
        (0..count).map(|number| self.side(number)).collect()
    }

    /// How two sides meet; `None` for sides that do not touch.
    pub fn meeting(&self, one: Side, other: Side) -> Option<Meeting> {
        let sides = 0..self.meetings.count;
        let number = |side: Side| sides.clone().find(|number| self.side(*number) == side);
        self.meetings.get(number(one)?, number(other)?)
    }

    /// The side of this number.
    pub fn side(&self, number: usize) -> Side {
        match self.owners.get(number) {
            Some(Owner::Body(body)) => Side::Body(*body),
            Some(Owner::Obstacle(obstacle)) => Side::Obstacle(*obstacle),
            None => Side::Obstacle(self.of_shapes[number - self.owners.len()]),
        }
    }
}
