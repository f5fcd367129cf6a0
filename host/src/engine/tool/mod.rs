//! A tool in the host: it moves along the path of its proxy, and the surface near it is published.
//!
//! To the bodies a tool is an obstacle that a hand moves. After a step that publishes, the tick is told the surface near the
//! tool as a patch: material points (the **sites**), the triangles between them, the forces of the tool on them, and their
//! compliance (`rt_core::tool` has the law by which the tick uses it).
//!
//! **Sites.** Where the surface near the tool has more vertices than a patch has sites, the sites are some of the vertices, the
//! denser the nearer to the tool, and each other vertex belongs to the nearest site: its force counts at the site, and a triangle between three sites stands for
//! those between their vertices (vertex clustering: Rossignac and Borrel, "Multi-resolution 3D approximations for rendering
//! complex scenes", 1993). A vertex that was a site stays one while it is near.

mod near;

use super::body::HostBody;
use super::hands::{CATCH_UP, shortened};
use super::path::HandlePath;
use super::plan::renderable;
use crate::scene::LoadedScene;
use crate::scene::spec::contact::FRICTION;
use crate::scene::spec::{Host, Scene, Tool};
use crate::world::World;
use nalgebra::Isometry3;
use near::{Around, Near, Surface, Vertex, Wall};
use physics::contact::obstacle::TimedPose;
use physics::contact::rounded::Rounded;
use physics::motion::contacts::{Contacts, MOST_BODIES, Side};
use physics::{Beside, Mat3, ShapeOptions, SiteCompliance, Vec3, resultant};
use rt_core::tool::{MAX_SITES, MAX_TRIANGLES, Patch, Triangle};
use rt_core::{Pose, TickRecord};
use std::sync::Arc;

/// The ways of the tool until the next patch, by which the surface is published beyond its radius.
pub(super) const REACH: f64 = 2.0;
/// The least of this reach, as a fraction of the radius.
pub(super) const LEAST_REACH: f64 = 0.5;
/// The speed (m/s) for which a tool at rest is told of the surface near it.
pub(super) const LEAST_SPEED: f64 = 0.5;
/// The distance between sites grows with the distance from the tool, by this slope (1) at least, and by as much more in each trial
/// while there are too many.
const LEAST_SLOPE: f64 = 0.1;
const FURTHER: f64 = 1.1;
/// The distance from the nearest site, as a fraction of the radius, within which sites are equally dense.
const FINEST: f64 = 0.25;
/// The fraction of the largest force of a site below which the site is not loaded.
const LOADED: f64 = 1e-3;
/// The stiffest spring (N/m) that any device renders, also one of unknown friction and damping.
const STIFFEST: f64 = 3000.0;
/// The residual of a shape (N), which a force of 1 N causes: the compliance is right to this fraction.
const TOLERANCE: f64 = 1e-3;
/// Number of sites whose compliance is renewed with a patch, in turn.
const RENEWED: usize = 4;

/// A tool as the scene has it.
#[derive(Clone, Debug)]
pub(super) struct ToolSpec {
    /// The device that moves it.
    pub device: usize,
    /// Its number among the obstacles.
    pub obstacle: usize,
    /// Its shape about its centre.
    pub shape: Arc<Rounded>,
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

/// A tool in the host.
pub(super) struct HostTool {
    spec: ToolSpec,
    path: HandlePath,
    /// Where the centre is at the end of the step (m).
    centre: Vec3,
    slots: [Option<Vertex>; MAX_SITES],
    /// By body; `None` before the tool came near.
    compliance: [Option<Box<SiteCompliance>>; MOST_BODIES],
    surface: Surface,
    walls: Vec<Wall>,
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

/// The obstacles that a tool can touch: all of the scene. Other tools are none.
fn walls(scene: &Scene, tool: &Tool) -> Vec<Wall> {
    let obstacles = scene.given_obstacles().iter().enumerate();
    let walls = obstacles.map(|(obstacle, given)| {
        let pair = scene.contact_between(&tool.name, &given.name);
        let friction = pair.and_then(|pair| pair.friction);
        let friction = friction.or(tool.friction).or(given.friction);
        Wall {
            obstacle,
            friction: friction.unwrap_or(FRICTION),
            skin: pair.and_then(|pair| pair.thickness).unwrap_or(0.0),
        }
    });
    walls.collect()
}

/// The tools of a world.
pub(super) fn all(world: &World<'_>) -> Vec<HostTool> {
    let scene = &world.loaded.scene;
    let each = scene.numbered_tools().zip(world.tool_shapes());
    let tools = each.map(|((tool, device, obstacle), shape)| {
        let spec = ToolSpec {
            device,
            obstacle,
            shape: Arc::clone(shape),
            start: tool.position.into(),
            stiffest: stiffest(world.loaded, device),
            cutoff: scene.host.smoothing,
            period: 1.0 / scene.host.publish_rate,
            horizon: horizon(&scene.host),
        };
        HostTool::new(spec, walls(scene, tool))
    });
    tools.collect()
}

impl HostTool {
    fn new(spec: ToolSpec, walls: Vec<Wall>) -> Self {
        Self {
            path: HandlePath::new(spec.device, spec.cutoff, Pose::at(spec.start)),
            centre: spec.start,
            slots: [None; MAX_SITES],
            compliance: [const { None }; MOST_BODIES],
            surface: Surface::default(),
            walls,
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
    /// near the tool failed, or was stopped in the step: the former patch ages, as the model of the body does.
    pub(super) fn publish(
        &mut self,
        contacts: &Contacts,
        bodies: &mut [HostBody],
        time_ns: u64,
        epoch: u32,
    ) {
        self.is_published = false;
        if !contacts.moved_as_solved(Side::Obstacle(self.spec.obstacle)) {
            return;
        }
        let speed = self.path.velocity().norm().max(LEAST_SPEED);
        let way = REACH * speed * self.spec.horizon;
        let around = Around {
            obstacle: self.spec.obstacle,
            shape: &self.spec.shape,
            centre: self.centre,
            beyond: way.max(LEAST_REACH * self.spec.shape.radius()),
            time: time_ns as f64 * 1e-9 + self.spec.horizon - 0.5 * self.spec.period,
        };
        self.surface.find(&around, &self.walls, contacts, bodies);
        self.surface.load(self.spec.obstacle, contacts);
        self.choose();
        self.fill();
        self.join();
        self.is_published = self.yield_of(bodies).is_some();
        if self.is_published {
            self.floor();
            let head = &mut self.patch.head;
            head.sequence += 1;
            (head.epoch, head.time_ns, head.period) = (epoch, time_ns, self.spec.period);
        }
    }

    /// Chooses the sites among the vertices near the tool, and the site of each other vertex.
    fn choose(&mut self) {
        let slots = self.slots;
        let is_kept = |near: &Near| slots.contains(&Some(near.vertex));
        let mut order: Vec<usize> = (0..self.surface.vertices.len()).collect();
        order.sort_by(|a, b| {
            let [a, b] = [*a, *b].map(|at| &self.surface.vertices[at]);
            let by_kept = is_kept(b).cmp(&is_kept(a));
            by_kept.then(a.distance.total_cmp(&b.distance))
        });
        let each = self.surface.vertices.iter().map(|near| near.distance);
        let nearest = each.fold(f64::INFINITY, f64::min);
        let mut slope = 0.0;
        let mut sites: Vec<usize> = Vec::new();
        loop {
            sites.clear();
            for at in &order {
                // Each body near the tool has a site.
                let near = &self.surface.vertices[*at];
                let apart = slope * (near.distance - nearest + FINEST * self.spec.shape.radius());
                let others = sites.iter().map(|site| &self.surface.vertices[*site]);
                let mut others = others.filter(|other| other.vertex.side == near.vertex.side);
                if others.all(|other| (other.place - near.place).norm() > apart) {
                    sites.push(*at);
                }
            }
            if sites.len() <= MAX_SITES {
                break;
            }
            slope = (slope * FURTHER).max(LEAST_SLOPE);
        }
        // A vertex that was a site keeps its slot.
        let mut slots = [None; MAX_SITES];
        let mut of_slot = [None; MAX_SITES];
        let mut new: Vec<usize> = Vec::new();
        for site in sites {
            let vertex = Some(self.surface.vertices[site].vertex);
            match self.slots.iter().position(|slot| *slot == vertex) {
                Some(slot) => (slots[slot], of_slot[slot]) = (vertex, Some(site)),
                None => new.push(site),
            }
        }
        for site in new {
            if let Some(slot) = slots.iter().position(Option::is_none) {
                (slots[slot], of_slot[slot]) =
                    (Some(self.surface.vertices[site].vertex), Some(site));
            }
        }
        self.slots = slots;
        let centres = of_slot.map(|site| site.map(|site| self.surface.vertices[site]));
        for near in &mut self.surface.vertices {
            let each = centres.iter().enumerate();
            let same = each.filter_map(|(slot, centre)| {
                let centre = centre.filter(|centre| centre.vertex.side == near.vertex.side)?;
                Some((slot, (centre.place - near.place).norm_squared()))
            });
            let nearest = same.min_by(|a, b| a.1.total_cmp(&b.1));
            near.site = nearest.map_or(0, |(slot, _)| slot);
        }
    }

    /// Fills the sites of the patch.
    fn fill(&mut self) {
        let used = self.slots.iter().rposition(Option::is_some);
        self.patch.head.site_count = used.map_or(0, |last| last + 1) as u8;
        for (slot, (site, vertex)) in self.patch.sites.iter_mut().zip(&self.slots).enumerate() {
            (site.force, site.velocity) = (Vec3::zeros(), Vec3::zeros());
            let Some(vertex) = vertex else {
                // A place without a site is far away, and no triangle has it.
                site.vertex = u32::MAX;
                continue;
            };
            site.vertex = vertex.number();
            for near in self
                .surface
                .vertices
                .iter()
                .filter(|near| near.site == slot)
            {
                site.force += near.force;
                if near.vertex == *vertex {
                    // The tick's tool touches the sites where the host's touches the skin over them.
                    let outward = near.normal.try_normalize(0.0).unwrap_or_default();
                    site.place = near.place + outward * near.skin;
                    site.velocity = near.velocity;
                }
            }
        }
    }

    /// Fills the triangles of the patch: the nearest ones between three sites.
    fn join(&mut self) {
        let mut joined: heapless::Vec<[u8; 3], MAX_TRIANGLES> = heapless::Vec::new();
        for triangle in &self.surface.triangles {
            let [a, b, c] = triangle
                .vertices
                .map(|at| self.surface.vertices[at].site as u8);
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
                self.patch.head.triangles[number] = Triangle {
                    corners,
                    friction: triangle.friction,
                };
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
            let on_body =
                |slot: &Option<Vertex>| slot.filter(|vertex| vertex.side == Side::Body(number));
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
        // A place seen from the nearest point of the hull (m).
        let apart = |place: &Vec3| {
            let own = place - self.centre;
            own - self.spec.shape.hull().nearest_to(&own).point
        };
        let head = &mut self.patch.head;
        (head.stiffness, head.floor) = (f64::INFINITY, rigid);
        let is_wall = |slot: &Option<Vertex>| {
            slot.is_some_and(|vertex| matches!(vertex.side, Side::Obstacle(_)))
        };
        if self.slots.iter().any(is_wall) {
            // An obstacle within reach is as stiff as the device can render. A body beside it is felt in series with that stiffness.
            return;
        }
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
            let distance = |slot: &usize| apart(&sites[*slot].place).norm();
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
                .map_or(Vec3::z(), |slot| apart(&sites[*slot].place))
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
