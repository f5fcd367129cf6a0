//! A tool in the host: it moves along the path of its proxy, and the surface near it is published.
//!
//! To the bodies a tool is an obstacle that a hand moves. After a step that publishes, the tick is told the surface near the
//! tool as a patch: material points (the **sites**, which [`sites`] chooses), the triangles between them ([`triangles`]), the forces of
//! the tool on them, and their compliance (`rt_core::tool` has the law by which the tick uses it).

mod near;
mod sites;
mod triangles;

use super::body::HostBody;
use super::hands::catch_up;
use super::path::HandlePath;
use super::plan::renderable;
use crate::scene::LoadedScene;
use crate::scene::spec::contact::FRICTION;
use crate::scene::spec::{Scene, Tool};
use crate::world::World;
use crate::world::reach::{horizon, reach};
use nalgebra::{Isometry3, Translation3, UnitQuaternion};
use near::{Around, Surface, Vertex, Wall};
use physics::contact::obstacle::TimedPose;
use physics::contact::rounded::Rounded;
use physics::motion::contacts::{Contacts, MOST_BODIES, Side};
use physics::{Beside, HandlePose, Mat3, ShapeOptions, SiteCompliance, Vec3, resultant};
use rt_core::hull::Hull;
use rt_core::tool::{MAX_SITES, Patch};
use rt_core::{Pose, TickRecord};
use sites::Spread;
use std::sync::Arc;

/// The fraction of the largest force of a site below which the site is not loaded.
const LOADED: f64 = 1e-3;
/// The force (N) of the device's stiffest spring at whose depth a tool that just touches has met all sites that count as loaded: a flat
/// tool meets many of them at once.
const SOON: f64 = 0.3;
/// The stiffest springs (N/m, N m/rad) that any device renders, also one of unknown friction and damping: the second one is the first one
/// at a lever of 0.1 m.
const STIFFEST: f64 = 3000.0;
const STIFFEST_TURNING: f64 = 30.0;
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
    /// The stiffest rotational spring that it can render (N m/rad); `None` for a tool that keeps its attitude.
    pub turning: Option<f64>,
    /// The buttons of the device that take hold of what the tool touches, as a mask.
    pub take_buttons: u32,
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
    /// Whether the hand takes hold of what the tool touches.
    holds: bool,
    /// Where the tool is at the end of the step, and its hull there, about its centre, in axes of the scene.
    pose: HandlePose,
    hull: Hull,
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

/// The same of rotation (N m/rad); `None` for a device that does not turn its tool.
pub(crate) fn stiffest_turning(loaded: &LoadedScene, device: usize) -> Option<f64> {
    let turns = loaded.models[device].rotation.is_some();
    turns.then(|| renderable(loaded)[device].turning.min(STIFFEST_TURNING))
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
            turning: stiffest_turning(world.loaded, device),
            take_buttons: tool.take_buttons(),
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
            holds: false,
            pose: HandlePose {
                position: spec.start,
                rotation: UnitQuaternion::identity(),
            },
            hull: *spec.shape.hull(),
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
        if let Some(Some(pose)) = record.tools.get(self.spec.device) {
            self.path.follow_to(record.time_ns, pose);
        }
        if let Some(buttons) = record.buttons.get(self.spec.device) {
            self.holds = buttons & self.spec.take_buttons != 0;
        }
    }

    /// Moves the tool to its pose at the end of a step between these times (s), as [`catch_up`] lets it.
    pub(super) fn lead(&mut self, contacts: &mut Contacts, [from, to]: [f64; 2]) {
        self.is_published = false;
        let target = self.path.pose_at((to * 1e9).round() as u64);
        let before = self.pose;
        (self.pose.position, self.pose.rotation) = (target.position, target.rotation);
        catch_up(&self.path, &before, &mut self.pose, to - from);
        let rows = [(from, &before), (to, &self.pose)].map(|(time, pose)| TimedPose {
            time,
            pose: Isometry3::from_parts(Translation3::from(pose.position), pose.rotation),
        });
        contacts.lead(self.spec.obstacle, rows);
        contacts.take_hold(self.spec.obstacle, self.holds);
        if self.spec.turning.is_some() {
            self.hull = self.spec.shape.hull().turned(&self.pose.rotation);
        }
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
        let (hull, radius) = (self.hull, self.spec.shape.radius());
        let turning = self.path.turning().norm() * hull.extent();
        let speed = self.path.velocity().norm() + turning;
        let reach = reach(self.spec.horizon, radius, speed);
        let around = Around {
            obstacle: self.spec.obstacle,
            hull: &hull,
            radius,
            centre: self.pose.position,
            beyond: reach,
            time: time_ns as f64 * 1e-9 + self.spec.horizon - 0.5 * self.spec.period,
        };
        self.surface.find(&around, &self.walls, contacts, bodies);
        self.surface.load(self.spec.obstacle, contacts);
        let spread = Spread::of(&hull, radius);
        spread.choose(&mut self.surface.vertices, &mut self.slots);
        self.fill();
        triangles::join(&self.surface, &around, &mut self.patch);
        self.is_published = self.yield_of(contacts, bodies).is_some();
        if self.is_published {
            self.floor();
            let head = &mut self.patch.head;
            head.sequence += 1;
            (head.epoch, head.time_ns, head.period) = (epoch, time_ns, self.spec.period);
            head.reach = reach;
            head.pose = Pose {
                position: self.pose.position,
                rotation: self.pose.rotation,
            };
        }
    }

    /// Fills the sites of the patch.
    fn fill(&mut self) {
        let used = self.slots.iter().rposition(Option::is_some);
        self.patch.head.site_count = used.map_or(0, |last| last + 1) as u8;
        for (slot, (site, vertex)) in self.patch.sites.iter_mut().zip(&self.slots).enumerate() {
            (site.force, site.velocity, site.drift) = Default::default();
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

    /// The compliance and the damping of the sites; `None` if a body near the tool failed to step, or cannot be condensed.
    fn yield_of(&mut self, contacts: &Contacts, bodies: &mut [HostBody]) -> Option<()> {
        let options = ShapeOptions {
            tolerance: TOLERANCE,
            at_a_time: RENEWED,
            ..ShapeOptions::default()
        };
        for row in &mut self.patch.compliance {
            row.fill(Mat3::zeros());
        }
        self.patch.head.damping = 0.0;
        let mut energies = [0.0; 2];
        for (number, body) in bodies.iter_mut().enumerate() {
            let on_body =
                |slot: &Option<Vertex>| slot.filter(|vertex| vertex.side == Side::Body(number));
            if !self.slots.iter().any(|slot| on_body(slot).is_some()) {
                continue;
            }
            let room = &mut self.compliance[number];
            let compliance = room.get_or_insert_with(|| Box::new(SiteCompliance::new(MAX_SITES)));
            let footprints = self.surface.footprints(number, &self.slots);
            let held = near::held(self.spec.obstacle, number, contacts);
            let Beside { body, stepper } = body.beside()?;
            let period = self.spec.period;
            let renewed = compliance.renew(stepper, body, period, &footprints, &held, &options);
            renewed.ok()?;
            let head = &mut self.patch.head;
            head.damping = head.damping.max(compliance.damping());
            let sites = &self.patch.sites;
            let found = compliance.energies(&|slot| {
                on_body(&self.slots[slot]).map_or_else(Vec3::zeros, |_| sites[slot].force)
            });
            for (slot, (site, vertex)) in self.patch.sites.iter_mut().zip(&self.slots).enumerate() {
                if on_body(vertex).is_some() {
                    site.drift = compliance.drift(slot);
                }
            }
            energies = [energies[0] + found[0], energies[1] + found[1]];
            for (one, row) in self.patch.compliance.iter_mut().enumerate() {
                for (other, block) in row.iter_mut().enumerate() {
                    if on_body(&self.slots[one]).is_some() && on_body(&self.slots[other]).is_some()
                    {
                        *block = compliance.between(one, other);
                    }
                }
            }
        }
        let [elastic, whole] = energies;
        self.patch.head.elastic = if whole > 0.0 { elastic / whole } else { 1.0 };
        Some(())
    }

    /// The stiffness of the resultant, and the floors: `1 / K_t - 1 / K` by direction, where it is positive.
    fn floor(&mut self) {
        let centre = self.pose.position;
        // A place seen from the nearest point of the hull (m).
        let apart = |place: &Vec3| {
            let own = place - centre;
            own - self.hull.nearest_to(&own).point
        };
        let head = &mut self.patch.head;
        head.stiffness = f64::INFINITY;
        head.floor = Mat3::identity() / self.spec.stiffest;
        let turning = self.spec.turning;
        head.turning_floor = Mat3::identity() * turning.map_or(0.0, f64::recip);
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
            let nearest = loaded.first().map_or(0.0, distance);
            let soon = |slot: &usize| distance(slot) < nearest + SOON / self.spec.stiffest;
            let count = loaded.iter().filter(|slot| soon(slot)).count();
            loaded.truncate(count.max(3));
        }
        let between = |one: usize, other: usize| self.patch.compliance[loaded[one]][loaded[other]];
        let arms = loaded.iter().map(|slot| sites[*slot].place - centre);
        let Some(stiffness) = resultant(&arms.collect::<Vec<_>>(), self.spec.stiffest, &between)
        else {
            return;
        };
        let along_axes = stiffness.fixed_view::<3, 3>(0, 0).into_owned();
        let about_axes = stiffness.fixed_view::<3, 3>(3, 3).into_owned();
        let along = loaded.iter().map(|slot| sites[*slot].force).sum::<Vec3>();
        let along = if along.norm() > 0.0 {
            along
        } else {
            loaded
                .first()
                .map_or(Vec3::z(), |slot| apart(&sites[*slot].place))
        };
        let along = along / along.norm().max(f64::MIN_POSITIVE);
        let whole = along.dot(&(along_axes * along));
        if whole.is_finite() && whole > 0.0 {
            head.stiffness = whole;
            head.floor = missing(&along_axes, self.spec.stiffest);
            if let Some(most) = turning {
                head.turning_floor = missing(&about_axes, most);
                // The springs of rotation must be as far below those of the device.
                let turning = about_axes.symmetric_eigenvalues().max() / most;
                head.stiffness = whole.max(turning * self.spec.stiffest);
            }
        }
    }
}

/// The compliance that a spring lacks, by direction, to be no stiffer than `most`.
fn missing(stiffness: &Mat3, most: f64) -> Mat3 {
    let parts = stiffness.symmetric_eigen();
    let each = parts.eigenvalues.iter();
    let each = each.zip(parts.eigenvectors.column_iter());
    each.map(|(value, axis)| {
        let more = (1.0 / most - 1.0 / value.max(f64::MIN_POSITIVE)).max(0.0);
        axis * axis.transpose() * more
    })
    .sum()
}
