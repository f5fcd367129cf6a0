//! The surface near a tool: the triangles of bodies and obstacles within reach, with their vertices.

use crate::engine::body::HostBody;
use physics::contact::vicinity::Vicinity;
use physics::motion::contacts::{Contacts, MOST_BODIES, Side};
use physics::{Footprint, Held, Vec3};
use rt_core::hull::Hull;
use std::collections::HashMap;

/// The bits of a vertex in its number. The others are for 72 sides.
const NODE_BITS: u32 = 25;

/// A vertex of a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Vertex {
    pub side: Side,
    pub node: u32,
}

impl Vertex {
    /// The number of the vertex in a patch: another one for each vertex of a scene. Bodies and obstacles have fewer vertices than
    /// the lower bits tell apart.
    pub(super) fn number(self) -> u32 {
        let side = match self.side {
            Side::Body(number) => number,
            Side::Obstacle(number) => MOST_BODIES + number,
        };
        (side as u32) << NODE_BITS | self.node & ((1 << NODE_BITS) - 1)
    }
}

/// A vertex near the tool.
#[derive(Clone, Copy, Debug)]
pub(super) struct Near {
    pub vertex: Vertex,
    pub place: Vec3,
    /// Velocity over the last step (m/s); zero on an obstacle.
    pub velocity: Vec3,
    /// The sum of the normals of its triangles, by area.
    pub normal: Vec3,
    /// The nearest point of the hull of the tool, and its distance (m).
    pub on_tool: Vec3,
    pub distance: f64,
    /// The distance by which it counts as near (m): on a body its own, on an obstacle that of the nearest of its triangles. An obstacle
    /// may have large triangles, whose corners are far from a tool that touches them.
    pub surface: f64,
    /// The distance at which the tool touches its surface (m).
    pub skin: f64,
    /// The force of the tool on it (N).
    pub force: Vec3,
    /// Its site.
    pub site: usize,
}

/// A triangle near the tool.
#[derive(Clone, Copy, Debug)]
pub(super) struct NearTriangle {
    /// Distance from the hull of the tool (m).
    pub distance: f64,
    /// Its vertices, by their places in [`Surface::vertices`].
    pub vertices: [usize; 3],
    /// Coefficient of friction.
    pub friction: f64,
}

/// An obstacle that the tool can touch.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wall {
    /// Its number among the obstacles.
    pub obstacle: usize,
    /// Coefficient of friction.
    pub friction: f64,
    /// The distance at which the tool touches it (m).
    pub skin: f64,
}

/// The tool, and how far around it surfaces are looked for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Around<'a> {
    /// Its number among the obstacles.
    pub obstacle: usize,
    /// Its hull about its centre, in axes of the scene.
    pub hull: &'a Hull,
    /// Its radius (m).
    pub radius: f64,
    /// Its centre (m).
    pub centre: Vec3,
    /// The distance beyond the radius (m).
    pub beyond: f64,
    /// The time at which obstacles are taken (s): amid the use of the patch.
    pub time: f64,
}

/// The surface near a tool.
#[derive(Debug, Default)]
pub(super) struct Surface {
    pub vertices: Vec<Near>,
    pub triangles: Vec<NearTriangle>,
    places: HashMap<Vertex, usize>,
    vicinity: Vicinity,
    /// Number of searches: a corner of a shape is another point in each.
    searches: u32,
}

/// A triangle of a surface: its side, the numbers and the places of its corners (m).
type Found = (Side, [u32; 3], [Vec3; 3]);

impl Surface {
    /// Finds the surface near a tool; the nearest triangles come first.
    pub(super) fn find(
        &mut self,
        around: &Around<'_>,
        walls: &[Wall],
        contacts: &Contacts,
        bodies: &[HostBody],
    ) {
        self.vertices.clear();
        self.triangles.clear();
        self.places.clear();
        self.find_bodies(around, contacts, bodies);
        self.find_walls(around, walls, contacts);
        self.triangles
            .sort_by(|a, b| a.distance.total_cmp(&b.distance));
    }

    fn find_bodies(&mut self, around: &Around<'_>, contacts: &Contacts, bodies: &[HostBody]) {
        let surfaces = contacts.surfaces();
        let centre = &around.centre;
        for (part, side) in surfaces.parts.iter().zip(&contacts.sides()) {
            let Side::Body(number) = *side else { continue };
            let Some(meeting) = contacts.meeting(*side, Side::Obstacle(around.obstacle)) else {
                continue;
            };
            let body = bodies[number].body();
            let (x, v) = (body.node_positions(), body.node_velocities());
            let reach = around.radius + meeting.distance + around.beyond;
            let extent = around.hull.extent();
            let first = part.vertices.start;
            let range = part.triangles.start as usize..part.triangles.end as usize;
            for triangle in &surfaces.triangles[range] {
                let mut nodes = triangle.map(|vertex| vertex - first);
                let Some(mut corners) = corners(x, nodes) else {
                    continue;
                };
                let [a, b, c] = corners;
                let [low, high] = [a.inf(&b).inf(&c), a.sup(&b).sup(&c)];
                if (low - centre).sup(&(centre - high)).max() > reach + extent {
                    continue;
                }
                let own = corners.map(|corner| corner - centre);
                let near = around.hull.nearest(own.each_ref());
                let foot = own.iter().zip(near.weights);
                let apart = near.point - foot.map(|(corner, weight)| corner * weight).sum::<Vec3>();
                let distance = apart.norm();
                if distance > reach {
                    continue;
                }
                // The triangles of a solid look outwards. A sheet has its normals on the side of the tool.
                if !part.is_solid && apart.dot(&(b - a).cross(&(c - a))) < 0.0 {
                    nodes.swap(1, 2);
                    corners.swap(1, 2);
                }
                let velocities = nodes.map(|node| v[node as usize]);
                let found = (*side, nodes, corners);
                self.add(
                    around,
                    found,
                    velocities,
                    [distance, meeting.distance, meeting.friction],
                );
            }
        }
    }

    fn find_walls(&mut self, around: &Around<'_>, walls: &[Wall], contacts: &Contacts) {
        self.searches = self.searches.wrapping_add(1);
        for wall in walls {
            let reach = around.radius + wall.skin + around.beyond;
            let mut vicinity = core::mem::take(&mut self.vicinity);
            let obstacle = contacts.obstacle(wall.obstacle);
            let lengths = [reach, around.beyond];
            vicinity.find(obstacle, around.time, around.hull, &around.centre, lengths);
            let from = if vicinity.are_kept() {
                0
            } else {
                self.searches.wrapping_mul(Vicinity::MOST_CORNERS)
            };
            for (distance, numbers) in vicinity.triangles() {
                let places = numbers.map(|number| vicinity.corners()[number as usize]);
                let numbers = numbers.map(|number| number.wrapping_add(from));
                let found = (Side::Obstacle(wall.obstacle), numbers, places);
                let of = [*distance, wall.skin, wall.friction];
                self.add(around, found, [Vec3::zeros(); 3], of);
            }
            self.vicinity = vicinity;
        }
    }

    /// Adds a triangle with its distance from the tool (m), the distance at which the tool touches it (m), and its friction.
    fn add(
        &mut self,
        around: &Around<'_>,
        (side, nodes, places): Found,
        velocities: [Vec3; 3],
        [distance, skin, friction]: [f64; 3],
    ) {
        let [a, b, c] = places;
        let outward = (b - a).cross(&(c - a));
        let mut vertices = [0; 3];
        let each = nodes.iter().zip(places).zip(velocities);
        for (number, ((node, place), velocity)) in vertices.iter_mut().zip(each) {
            let vertex = Vertex { side, node: *node };
            *number = *self.places.entry(vertex).or_insert_with(|| {
                let own = place - around.centre;
                let on_tool = around.hull.nearest_to(&own).point;
                self.vertices.push(Near {
                    vertex,
                    place,
                    velocity,
                    normal: Vec3::zeros(),
                    on_tool: around.centre + on_tool,
                    distance: (own - on_tool).norm(),
                    surface: f64::INFINITY,
                    skin,
                    force: Vec3::zeros(),
                    site: 0,
                });
                self.vertices.len() - 1
            });
            let near = &mut self.vertices[*number];
            near.normal += outward;
            near.surface = match side {
                Side::Body(_) => near.distance,
                Side::Obstacle(_) => near.surface.min(distance),
            };
        }
        self.triangles.push(NearTriangle {
            distance,
            vertices,
            friction,
        });
    }

    /// The footprints of the sites on a body: a site takes forces as its vertices have them at present, or at its own vertex while there
    /// are none.
    pub(super) fn footprints(
        &self,
        body: usize,
        slots: &[Option<Vertex>],
    ) -> Vec<Option<Footprint>> {
        let each = slots.iter().enumerate();
        let footprint = |(slot, site): (usize, &Option<Vertex>)| {
            let site = site.filter(|site| site.side == Side::Body(body))?;
            let own = self.vertices.iter();
            let own = own.filter(|near| near.site == slot && near.vertex.side == site.side);
            let mut weights: Vec<(u32, f64)> = (own.filter(|near| near.force != Vec3::zeros()))
                .map(|near| (near.vertex.node, near.force.norm()))
                .collect();
            let whole: f64 = weights.iter().map(|(_, force)| force).sum();
            for (_, weight) in &mut weights {
                *weight /= whole;
            }
            Some(if weights.is_empty() {
                Footprint::of(site.node)
            } else {
                Footprint {
                    node: site.node,
                    weights,
                }
            })
        };
        each.map(footprint).collect()
    }

    /// Finds the forces of the tool on the vertices, from the contacts of the present step.
    pub(super) fn load(&mut self, obstacle: usize, contacts: &Contacts) {
        let tool = Side::Obstacle(obstacle);
        for (sides, _, touch) in contacts.points() {
            let sides = sides.map(|side| contacts.side(side));
            if !sides.contains(&tool) {
                continue;
            }
            let force = touch.force();
            for (at, weight) in touch.nodes.iter().filter(|(_, weight)| *weight != 0.0) {
                let vertex = Vertex {
                    side: Side::Body(at.body),
                    node: at.node,
                };
                if let Some(number) = self.places.get(&vertex) {
                    self.vertices[*number].force += force * *weight;
                }
            }
        }
    }
}

/// The nodes of a body at its contacts with obstacles other than the tool, which other tools are too.
pub(super) fn held(obstacle: usize, body: usize, contacts: &Contacts) -> Vec<Held> {
    let mut held = Vec::new();
    for (sides, _, touch) in contacts.points() {
        let sides = sides.map(|side| contacts.side(side));
        let is_other = |side: &Side| matches!(side, Side::Obstacle(number) if *number != obstacle);
        if !sides.contains(&Side::Body(body)) || !sides.iter().any(is_other) {
            continue;
        }
        for (at, weight) in touch.nodes.iter().filter(|(_, weight)| *weight != 0.0) {
            held.push(Held {
                node: at.node,
                force: touch.response.normal.abs() * weight.abs(),
                normal: touch.row.normal,
                slips: touch.response.slips,
            });
        }
    }
    held
}

/// The corners of a triangle (m); `None` for a triangle that the body has no longer.
fn corners(x: &[Vec3], nodes: [u32; 3]) -> Option<[Vec3; 3]> {
    let [a, b, c] = nodes.map(|node| x.get(node as usize).copied());
    Some([a?, b?, c?])
}
