//! A tool in the host: it moves along the path of its proxy, and the surface near it is published.
//!
//! To the bodies a tool is an obstacle that a hand moves. After a step that publishes, the tick is told the surface near the
//! tool as a patch: material points (the **sites**), the triangles between them, the forces of the tool on them, and their
//! compliance (`rt_core::tool` has the law by which the tick uses it).
//!
//! **Sites.** Where the surface near the tool has more vertices than a patch has sites, the sites are some of the vertices, and
//! each other vertex belongs to the nearest site: its force counts at the site, and a triangle between three sites stands for
//! those between their vertices (vertex clustering: Rossignac and Borrel, "Multi-resolution 3D approximations for rendering
//! complex scenes", 1993). A vertex that was a site stays one while it is near.

use super::body::HostBody;
use super::hands::{CATCH_UP, shortened};
use super::path::HandlePath;
use super::plan::renderable;
use crate::scene::LoadedScene;
use crate::scene::spec::Host;
use crate::world::World;
use nalgebra::Isometry3;
use physics::contact::distance::point_triangle;
use physics::contact::obstacle::TimedPose;
use physics::motion::contacts::{Contacts, MOST_BODIES, Side};
use physics::{Beside, Mat3, ShapeOptions, SiteCompliance, Vec3, resultant};
use rt_core::tool::{MAX_SITES, MAX_TRIANGLES, Patch, Triangle};
use rt_core::{Pose, TickRecord};

/// The ways of the tool until the next patch, by which the surface is published beyond its radius.
pub(super) const REACH: f64 = 2.0;
/// The least of this reach, as a fraction of the radius.
pub(super) const LEAST_REACH: f64 = 0.5;
/// The growth of the distance between sites while there are too many.
const FURTHER: f64 = 1.2;
/// The fraction of the largest force of a site below which the site is not loaded.
const LOADED: f64 = 1e-3;
/// The stiffest spring (N/m) that any device renders, also one of unknown friction and damping.
const STIFFEST: f64 = 3000.0;
/// The residual of a shape (N), which a force of 1 N causes: the compliance is right to this fraction.
const TOLERANCE: f64 = 1e-3;
/// Number of sites whose compliance is renewed with a patch, in turn.
const RENEWED: usize = 4;

/// A tool as the scene has it.
#[derive(Clone, Copy, Debug)]
pub(super) struct ToolSpec {
    /// The device that moves it.
    pub device: usize,
    /// Its number among the obstacles.
    pub obstacle: usize,
    /// Radius (m).
    pub radius: f64,
    /// Where its centre is at rest (m).
    pub start: Vec3,
    /// The stiffest spring that the device can render (N/m).
    pub stiffest: f64,
    /// Cut-off of its path (Hz).
    pub cutoff: f64,
    /// The publication period, and the largest age at which a patch must be good (s).
    pub period: f64,
    pub horizon: f64,
}

/// A vertex of a body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Vertex {
    body: usize,
    node: u32,
}

/// A vertex near the tool.
#[derive(Clone, Copy, Debug)]
struct Near {
    vertex: Vertex,
    place: Vec3,
    /// The sum of the normals of its triangles, by area.
    normal: Vec3,
    /// Distance from the centre of the tool (m).
    distance: f64,
    /// The force of the tool on it (N).
    force: Vec3,
    /// Its site.
    site: usize,
}

/// A tool in the host.
pub(super) struct HostTool {
    spec: ToolSpec,
    path: HandlePath,
    /// Where the centre is at the end of the step (m).
    centre: Vec3,
    slots: [Option<Vertex>; MAX_SITES],
    /// By body; `None` before the tool came near.
    compliance: [Option<Box<SiteCompliance>>; MOST_BODIES],
    near: Vec<Near>,
    /// The triangles near the tool, by their places in `near`, with their distance (m), friction and the distance at which they
    /// touch (m).
    triangles: Vec<(f64, [usize; 3], f64, f64)>,
    /// By vertex of the surfaces: its place in `near` and one; zero for a vertex that is not near.
    places: Vec<u32>,
    patch: Box<Patch>,
    is_published: bool,
}

/// The stiffest spring that the tool of a device renders (N/m, scene).
pub(crate) fn stiffest(loaded: &LoadedScene, device: usize) -> f64 {
    renderable(loaded)[device].stiffness.min(STIFFEST)
}

/// The largest age at which a patch must be good (s).
pub(super) fn horizon(host: &Host) -> f64 {
    1.0 / host.publish_rate + host.latency
}

/// The tools of a world.
pub(super) fn all(world: &World<'_>) -> Vec<HostTool> {
    let scene = &world.loaded.scene;
    let tools = scene.numbered_tools().map(|(tool, device, obstacle)| {
        HostTool::new(ToolSpec {
            device,
            obstacle,
            radius: tool.radius,
            start: tool.position.into(),
            stiffest: stiffest(world.loaded, device),
            cutoff: scene.host.smoothing,
            period: 1.0 / scene.host.publish_rate,
            horizon: horizon(&scene.host),
        })
    });
    tools.collect()
}

impl HostTool {
    fn new(spec: ToolSpec) -> Self {
        Self {
            path: HandlePath::new(spec.device, spec.cutoff, Pose::at(spec.start)),
            centre: spec.start,
            slots: [None; MAX_SITES],
            compliance: [const { None }; MOST_BODIES],
            near: Vec::new(),
            triangles: Vec::new(),
            places: Vec::new(),
            patch: Box::new(Patch::empty()),
            is_published: false,
            spec,
        }
    }

    /// Takes one tick's record.
    pub(super) fn follow(&mut self, record: &TickRecord) {
        if let Some(Some(place)) = record.tools.get(self.spec.device) {
            self.path.follow_to(record.time_ns, &Pose::at(*place));
        }
    }

    /// Moves the tool to its place at the end of a step between these times (s), no faster than its hand plus [`CATCH_UP`].
    pub(super) fn lead(&mut self, contacts: &mut Contacts, [from, to]: [f64; 2]) {
        self.is_published = false;
        let target = self.path.pose_at((to * 1e9).round() as u64).position;
        let way = target - self.centre;
        let most = (self.path.velocity().norm() + CATCH_UP) * (to - from);
        let before = self.centre;
        self.centre += way * shortened(way.norm(), most).unwrap_or(1.0);
        let rows = [(from, before), (to, self.centre)].map(|(time, place)| TimedPose {
            time,
            pose: Isometry3::translation(place.x, place.y, place.z),
        });
        contacts.lead(self.spec.obstacle, rows);
    }

    /// The patch of the present step, with the device of the tool.
    pub(super) fn published(&self) -> Option<(usize, &Patch)> {
        self.is_published
            .then_some((self.spec.device, &*self.patch))
    }

    /// Makes the patch of a step that ended at `time_ns`. `epoch` counts the meshes that were replaced. There is no patch if a body
    /// near the tool failed: the former patch ages, as the model of the body does.
    pub(super) fn publish(
        &mut self,
        contacts: &Contacts,
        bodies: &mut [HostBody],
        time_ns: u64,
        epoch: u32,
    ) {
        self.find(contacts, bodies);
        self.load(contacts);
        self.choose();
        self.fill(bodies);
        self.join();
        self.is_published = self.yield_of(bodies).is_some();
        if self.is_published {
            self.floor();
            let head = &mut self.patch.head;
            head.sequence += 1;
            (head.epoch, head.time_ns, head.period) = (epoch, time_ns, self.spec.period);
        }
    }

    /// Finds the triangles near the tool, with their vertices.
    fn find(&mut self, contacts: &Contacts, bodies: &[HostBody]) {
        self.near.clear();
        self.triangles.clear();
        let surfaces = contacts.surfaces();
        self.places.clear();
        self.places.resize(surfaces.vertices, 0);
        let way = REACH * self.path.velocity().norm() * self.spec.horizon;
        let sides = contacts.sides();
        for (part, side) in surfaces.parts.iter().zip(&sides) {
            let Side::Body(number) = *side else { continue };
            let tool = Side::Obstacle(self.spec.obstacle);
            let Some(meeting) = contacts.meeting(*side, tool) else {
                continue;
            };
            let body = bodies[number].body();
            let x = body.node_positions();
            let reach =
                self.spec.radius + meeting.distance + way.max(LEAST_REACH * self.spec.radius);
            let first = part.vertices.start;
            let range = part.triangles.start as usize..part.triangles.end as usize;
            for triangle in &surfaces.triangles[range] {
                let nodes = triangle.map(|vertex| vertex - first);
                let Some([a, b, c]) = corners(x, nodes) else {
                    continue;
                };
                let [low, high] = [a.inf(&b).inf(&c), a.sup(&b).sup(&c)];
                let beyond = (low - self.centre).sup(&(self.centre - high));
                if beyond.max() > reach {
                    continue;
                }
                let foot = point_triangle(&self.centre, [&a, &b, &c]);
                let distance = foot.apart.norm();
                if distance > reach {
                    continue;
                }
                let outward = (b - a).cross(&(c - a));
                // The triangles of a solid look outwards. A sheet has its normals on the side of the tool.
                let is_turned = !part.is_solid && (self.centre - a).dot(&outward) < 0.0;
                let outward = if is_turned { -outward } else { outward };
                let mut places = [0; 3];
                for ((place, vertex), node) in places.iter_mut().zip(triangle).zip(nodes) {
                    let known = &mut self.places[*vertex as usize];
                    if *known == 0 {
                        let at = x[node as usize];
                        self.near.push(Near {
                            vertex: Vertex { body: number, node },
                            place: at,
                            normal: Vec3::zeros(),
                            distance: (at - self.centre).norm(),
                            force: Vec3::zeros(),
                            site: 0,
                        });
                        *known = self.near.len() as u32;
                    }
                    *place = *known as usize - 1;
                    self.near[*place].normal += outward;
                }
                if is_turned {
                    places.swap(1, 2);
                }
                let of = (distance, places, meeting.friction, meeting.distance);
                self.triangles.push(of);
            }
        }
        self.triangles.sort_by(|a, b| a.0.total_cmp(&b.0));
    }

    /// The forces of the tool on the vertices near it.
    fn load(&mut self, contacts: &Contacts) {
        let tool = Side::Obstacle(self.spec.obstacle);
        for (sides, _, touch) in contacts.points() {
            let sides = sides.map(|side| contacts.side(side));
            if !sides.contains(&tool) {
                continue;
            }
            let force = touch.force();
            for (at, weight) in touch.nodes.iter().filter(|(_, weight)| *weight != 0.0) {
                let is_this =
                    |near: &&mut Near| near.vertex.body == at.body && near.vertex.node == at.node;
                if let Some(near) = self.near.iter_mut().find(is_this) {
                    near.force += force * *weight;
                }
            }
        }
    }

    /// Chooses the sites among the vertices near the tool, and the site of each other vertex.
    fn choose(&mut self) {
        let slots = self.slots;
        let is_kept = |near: &Near| slots.contains(&Some(near.vertex));
        let mut order: Vec<usize> = (0..self.near.len()).collect();
        order.sort_by(|a, b| {
            let [a, b] = [*a, *b].map(|at| &self.near[at]);
            let by_kept = is_kept(b).cmp(&is_kept(a));
            by_kept.then(a.distance.total_cmp(&b.distance))
        });
        let mut apart = 0.0;
        let mut sites: Vec<usize> = Vec::new();
        loop {
            sites.clear();
            for at in &order {
                // Each body near the tool has a site.
                let Near { vertex, place, .. } = self.near[*at];
                let others = sites.iter().map(|site| &self.near[*site]);
                let mut others = others.filter(|other| other.vertex.body == vertex.body);
                if others.all(|other| (other.place - place).norm() > apart) {
                    sites.push(*at);
                }
            }
            if sites.len() <= MAX_SITES {
                break;
            }
            // The first distance is that of a patch with as many sites.
            let radius = self.triangles.last().map_or(0.0, |last| last.0);
            apart = (apart * FURTHER).max(radius / MAX_SITES as f64);
        }
        // A vertex that was a site keeps its slot.
        let mut slots = [None; MAX_SITES];
        let mut of_slot = [None; MAX_SITES];
        let mut new: Vec<usize> = Vec::new();
        for site in sites {
            let vertex = Some(self.near[site].vertex);
            match self.slots.iter().position(|slot| *slot == vertex) {
                Some(slot) => (slots[slot], of_slot[slot]) = (vertex, Some(site)),
                None => new.push(site),
            }
        }
        for site in new {
            if let Some(slot) = slots.iter().position(Option::is_none) {
                (slots[slot], of_slot[slot]) = (Some(self.near[site].vertex), Some(site));
            }
        }
        self.slots = slots;
        let centres = of_slot.map(|site| site.map(|site| self.near[site]));
        for near in &mut self.near {
            let each = centres.iter().enumerate();
            let same = each.filter_map(|(slot, centre)| {
                let centre = centre.filter(|centre| centre.vertex.body == near.vertex.body)?;
                Some((slot, (centre.place - near.place).norm_squared()))
            });
            let nearest = same.min_by(|a, b| a.1.total_cmp(&b.1));
            near.site = nearest.map_or(0, |(slot, _)| slot);
        }
    }

    /// Fills the sites of the patch.
    fn fill(&mut self, bodies: &[HostBody]) {
        let used = self.slots.iter().rposition(Option::is_some);
        self.patch.head.site_count = used.map_or(0, |last| last + 1) as u8;
        for (slot, (site, vertex)) in self.patch.sites.iter_mut().zip(&self.slots).enumerate() {
            (site.force, site.velocity) = (Vec3::zeros(), Vec3::zeros());
            let Some(vertex) = vertex else {
                // A place without a site is far away, and no triangle has it.
                site.vertex = u32::MAX;
                continue;
            };
            let body = bodies[vertex.body].body();
            // Bodies have fewer vertices than this.
            site.vertex = (vertex.body as u32) << 28 | vertex.node;
            site.velocity = body.node_velocities()[vertex.node as usize];
            site.place = body.node_positions()[vertex.node as usize];
            for near in self.near.iter().filter(|near| near.site == slot) {
                site.force += near.force;
            }
        }
        // The tick's tool touches the sites where the host's touches the skin over them.
        let distance = self.triangles.iter().map(|of| of.3).fold(0.0, f64::max);
        for near in &self.near {
            if self.slots[near.site] == Some(near.vertex) && near.normal.norm() > 0.0 {
                self.patch.sites[near.site].place += near.normal.normalize() * distance;
            }
        }
    }

    /// Fills the triangles of the patch: the nearest ones between three sites.
    fn join(&mut self) {
        let mut joined: heapless::Vec<[u8; 3], MAX_TRIANGLES> = heapless::Vec::new();
        for (_, places, friction, _) in &self.triangles {
            let [a, b, c] = places.map(|at| self.near[at].site as u8);
            if a == b || b == c || c == a {
                continue;
            }
            // The same triangle begins at its least corner.
            let corners = if a < b && a < c {
                [a, b, c]
            } else if b < c {
                [b, c, a]
            } else {
                [c, a, b]
            };
            if !joined.contains(&corners) {
                let number = joined.len();
                if joined.push(corners).is_err() {
                    break;
                }
                let friction = *friction;
                self.patch.head.triangles[number] = Triangle { corners, friction };
            }
        }
        self.patch.head.triangle_count = joined.len() as u8;
    }

    /// The compliance and the damping of the sites; `None` if a body near the tool failed to step, or cannot be condensed.
    fn yield_of(&mut self, bodies: &mut [HostBody]) -> Option<()> {
        let options = ShapeOptions {
            tolerance: TOLERANCE,
            at_a_time: RENEWED,
            ..ShapeOptions::default()
        };
        for row in &mut self.patch.compliance {
            row.fill(Mat3::zeros());
        }
        self.patch.head.damping = 0.0;
        for (number, body) in bodies.iter_mut().enumerate() {
            let on_body = |slot: &Option<Vertex>| slot.filter(|vertex| vertex.body == number);
            if !self.slots.iter().any(|slot| on_body(slot).is_some()) {
                continue;
            }
            let room = &mut self.compliance[number];
            let compliance = room.get_or_insert_with(|| Box::new(SiteCompliance::new(MAX_SITES)));
            let sites = self.slots.iter().map(|slot| on_body(slot).map(|v| v.node));
            let Beside { body, stepper } = body.beside()?;
            let renewed = compliance.renew(stepper, body, self.spec.period, sites, &options);
            renewed.ok()?;
            let head = &mut self.patch.head;
            head.damping = head.damping.max(compliance.damping());
            for (one, row) in self.patch.compliance.iter_mut().enumerate() {
                for (other, block) in row.iter_mut().enumerate() {
                    if on_body(&self.slots[one]).is_some() && on_body(&self.slots[other]).is_some()
                    {
                        *block = compliance.between(one, other);
                    }
                }
            }
        }
        Some(())
    }

    /// The stiffness of the resultant, and the floor: `1 / K_t - 1 / K` by direction, where it is positive.
    fn floor(&mut self) {
        let rigid = Mat3::identity() / self.spec.stiffest;
        let head = &mut self.patch.head;
        (head.stiffness, head.floor) = (f64::INFINITY, rigid);
        let sites = &self.patch.sites;
        let used = |slot: &usize| self.slots[*slot].is_some();
        let most = sites
            .iter()
            .map(|site| site.force.norm())
            .fold(0.0, f64::max);
        let mut loaded: Vec<usize> = (0..MAX_SITES).filter(used).collect();
        if most > 0.0 {
            loaded.retain(|slot| sites[*slot].force.norm() > LOADED * most);
        } else {
            let distance = |slot: &usize| (sites[*slot].place - self.centre).norm();
            loaded.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
            loaded.truncate(3);
        }
        let between = |one: usize, other: usize| self.patch.compliance[loaded[one]][loaded[other]];
        let Some(stiffness) = resultant(loaded.len(), &between) else {
            return;
        };
        let along = loaded.iter().map(|slot| sites[*slot].force).sum::<Vec3>();
        let along = if along.norm() > 0.0 {
            along
        } else {
            loaded
                .first()
                .map_or(Vec3::z(), |slot| sites[*slot].place - self.centre)
        };
        let along = along / along.norm().max(f64::MIN_POSITIVE);
        let whole = along.dot(&(stiffness * along));
        if whole.is_finite() && whole > 0.0 {
            head.stiffness = whole;
            let parts = stiffness.symmetric_eigen();
            head.floor = Mat3::zeros();
            for (value, axis) in parts
                .eigenvalues
                .iter()
                .zip(parts.eigenvectors.column_iter())
            {
                let more = (1.0 / self.spec.stiffest - 1.0 / value.max(f64::MIN_POSITIVE)).max(0.0);
                head.floor += axis * axis.transpose() * more;
            }
        }
    }
}

/// The corners of a triangle (m); `None` for a triangle that the body has no longer.
fn corners(x: &[Vec3], nodes: [u32; 3]) -> Option<[Vec3; 3]> {
    let [a, b, c] = nodes.map(|node| x.get(node as usize).copied());
    Some([a?, b?, c?])
}
