//! What touches in a world: the thickness of each body, the pairs with their friction, and faults of the start.
//!
//! Obstacles touch all bodies. Bodies touch each other if a `[[contact]]` names the two, and themselves if they have
//! `self_contact`. A scene without any of the three has no contact.

use super::Built;
use super::material::Elements;
use super::shapes::round;
use crate::scene::spec::contact::FRICTION;
use crate::scene::spec::{self, Scene};
use crate::scene::{LoadedScene, SceneError};
use physics::contact::obstacle::Geometry;
use physics::contact::shape::Shape;
use physics::contact::start::{Fault, Touching, deepest, faults, winding};
use physics::contact::{Meeting, Obstacle, Skin, Surfaces};
use physics::mesh::check_solid::size;
use physics::mesh::{Bounds, Mesh};
use physics::motion::contacts::{self, Side};
use physics::{Body, Vec3};

/// The thickness of a solid in contact, as a fraction of the side of a cube of the same volume.
const SKIN: f64 = 1e-3;
/// The fraction of a contact's distance by which a body may start inside a shape: rounding of positions in a scene.
const SLACK: f64 = 1e-3;
/// The winding number above which a point is inside.
const INSIDE: f64 = 0.5;

/// A body or an obstacle, by its number in the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Thing {
    /// A body.
    Body(usize),
    /// An obstacle.
    Obstacle(usize),
}

impl Thing {
    /// Its name in the scene.
    pub fn name(self, scene: &Scene) -> &str {
        match self {
            Self::Body(index) => &scene.bodies[index].name,
            Self::Obstacle(index) => &scene.obstacles[index].name,
        }
    }

    /// Its number in records of contacts: obstacles follow the bodies.
    pub fn number(self, scene: &Scene) -> u32 {
        match self {
            Self::Body(index) => index as u32,
            Self::Obstacle(index) => (scene.bodies.len() + index) as u32,
        }
    }
}

/// The pairs of a scene that may touch, ascending. The first of a pair is a body.
pub fn touching(scene: &Scene) -> Vec<[Thing; 2]> {
    let bodies = (0..scene.bodies.len()).map(Thing::Body);
    let obstacles = (0..scene.obstacles.len()).map(Thing::Obstacle);
    let things = bodies.clone().chain(obstacles);
    let pairs = bodies.flat_map(|one| {
        let others = things.clone().filter(move |other| *other >= one);
        others.map(move |other| [one, other])
    });
    let touches = |[one, other]: &[Thing; 2]| match *other {
        Thing::Obstacle(_) => true,
        Thing::Body(index) if one == other => scene.bodies[index].self_contact,
        Thing::Body(_) => given(scene, [*one, *other]).is_some(),
    };
    pairs.filter(touches).collect()
}

/// The contact of a pair in the scene; `None` if the scene has none.
fn given(scene: &Scene, [one, other]: [Thing; 2]) -> Option<&spec::contact::Contact> {
    scene.contact_between(one.name(scene), other.name(scene))
}

/// Two things that may touch. A body that touches itself is a pair with itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactPair {
    /// The things, ascending: the first one is a body.
    pub between: [Thing; 2],
    /// Coefficient of friction.
    pub friction: f64,
    /// The distance between the two meshes at which the two touch (m).
    pub distance: f64,
    /// The largest pressure of the contacts (Pa).
    pub pressure: f64,
    /// The largest normal force of a contact (N).
    pub force: f64,
}

/// The largest pressure of contacts, in Young's moduli: the largest one of each body (of a weave, that of its warp),
/// and the smaller one of both bodies. A linear tetrahedron is flat at one
/// modulus; a vertex of a coarse mesh bears the force of a sharp press alone, and a thread presses on a narrow area.
const CRUSHING: f64 = 100.0;

/// The largest force (N) of a contact of a tool is at least this, the force of a spring of 3 kN/m in a depth of 20 mm, and at least this many
/// times the largest force of its device. A hand presses no harder. Without a bound, a tool that its path moves into vertices that are held
/// would push the vertices beside them out of its way with kilonewtons.
const HARDEST: f64 = 60.0;
const HARDER: f64 = 2.0;

/// The contacts of a world.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Contacts {
    /// The distance of each body's surface from its mesh (m), in the order of the bodies; empty in a world without contact.
    pub radii: Vec<f64>,
    /// The pairs that may touch, ascending.
    pub pairs: Vec<ContactPair>,
}

impl Contacts {
    /// The contacts of a scene with these bodies.
    pub(super) fn new(loaded: &LoadedScene, bodies: &[Built]) -> Self {
        let scene = &loaded.scene;
        if !scene.has_contact() {
            return Self::default();
        }
        let radii: Vec<f64> = bodies.iter().map(|body| 0.5 * body.thickness).collect();
        let hardness = |thing: Thing| match thing {
            Thing::Body(index) => {
                let young = bodies[index].young.iter().copied();
                CRUSHING * young.fold(0.0, f64::max)
            }
            Thing::Obstacle(_) => f64::INFINITY,
        };
        let radius = |thing: Thing| match thing {
            Thing::Body(index) => radii[index],
            Thing::Obstacle(_) => 0.0,
        };
        let hardest = |thing: Thing| {
            let mut tools = scene.numbered_tools();
            let tool = tools.find(|(_, _, obstacle)| thing == Thing::Obstacle(*obstacle));
            tool.map_or(f64::INFINITY, |(_, device, _)| {
                HARDEST.max(HARDER * loaded.models[device].max_force)
            })
        };
        let pairs = touching(scene).into_iter().map(|between| {
            let [one, other] = between;
            let given = given(scene, between);
            let own = match other {
                Thing::Obstacle(index) => scene.obstacles[index].friction,
                Thing::Body(_) => None,
            };
            let friction = given.and_then(|contact| contact.friction).or(own);
            let thickness = given.and_then(|contact| contact.thickness);
            ContactPair {
                between,
                friction: friction.unwrap_or(FRICTION),
                distance: thickness.unwrap_or_else(|| radius(one) + radius(other)),
                pressure: hardness(one).min(hardness(other)),
                force: hardest(other),
            }
        });
        let pairs = pairs.collect();
        Self { radii, pairs }
    }

    /// Whether nothing touches.
    pub fn is_empty(&self) -> bool {
        self.pairs.is_empty()
    }

    /// How two things touch; `None` for things that do not touch.
    pub fn pair(&self, one: Thing, other: Thing) -> Option<&ContactPair> {
        let between = [one.min(other), one.max(other)];
        let place = self
            .pairs
            .binary_search_by_key(&between, |pair| pair.between);
        place.ok().map(|place| &self.pairs[place])
    }

    /// The largest distance at which a thing touches another one (m).
    fn farthest(&self, thing: Thing) -> f64 {
        let pairs = self.pairs.iter();
        let with = pairs.filter(|pair| pair.between.contains(&thing));
        with.map(|pair| pair.distance).fold(0.0, f64::max)
    }
}

/// The thickness of a body in contact (m): the `given` one, or else the largest of a sheet, the largest diameter of a
/// thread, a thousandth of the side of a cube of a solid's volume.
pub(super) fn thickness(given: Option<f64>, elements: &Elements, mesh: &Mesh) -> f64 {
    let largest = |values: &mut dyn Iterator<Item = f64>| values.fold(0.0, f64::max);
    let diameter = |area: f64| 2.0 * (area / core::f64::consts::PI).sqrt();
    given.unwrap_or_else(|| match elements {
        Elements::Sheet(sheets) => largest(&mut sheets.iter().map(|one| one.thickness)),
        Elements::Woven(weaves) => largest(&mut weaves.iter().map(|one| one.thickness)),
        Elements::Thread(threads) => diameter(largest(&mut threads.iter().map(|one| one.area))),
        Elements::Solid(_) => SKIN * volume(mesh).cbrt(),
    })
}

/// The volume of a solid (m³); 0 for another mesh.
fn volume(mesh: &Mesh) -> f64 {
    let Mesh::Solid(mesh) = mesh else {
        return 0.0;
    };
    let cells = mesh.cells.vertices();
    cells.map(|cell| size(&mesh.positions, cell).0 / 6.0).sum()
}

impl super::World<'_> {
    /// The contacts of the physics between `bodies`, those of this world, and its obstacles.
    ///
    /// # Errors
    /// [`SceneError`] for a body or an obstacle whose triangles are no surface.
    pub fn touching(&self, bodies: &[&Body]) -> Result<contacts::Contacts, SceneError> {
        let refuse = |thing: Thing, error: &dyn std::fmt::Display| {
            let allowed = "a surface whose edges have two triangles at most";
            let source = &self.loaded.source;
            source.error(
                &field(&self.loaded.scene, thing),
                error.to_string(),
                allowed,
            )
        };
        let mut found = contacts::Contacts::new();
        for (number, (body, built)) in bodies.iter().zip(&self.bodies).enumerate() {
            let thing = Thing::Body(number);
            let skin = Skin {
                radius: self.contacts.radii[number],
                touches_itself: self.contacts.pair(thing, thing).is_some(),
                is_obstacle: false,
            };
            let added = found.add_body(number, body, built.mesh.clone(), skin);
            added.map_err(|error| refuse(thing, &error))?;
        }
        for (number, obstacle) in self.obstacles.iter().enumerate() {
            let added = found.add_obstacle(obstacle.clone());
            added.map_err(|error| refuse(Thing::Obstacle(number), &error))?;
        }
        let thing = |side: Side| match side {
            Side::Body(body) => Thing::Body(body),
            Side::Obstacle(number) => Thing::Obstacle(number),
        };
        found.complete(&|one, other| {
            let pair = self.contacts.pair(thing(one), thing(other));
            pair.map(|pair| Meeting {
                distance: pair.distance,
                friction: pair.friction,
                pressure: pair.pressure,
                force: pair.force,
            })
        });
        Ok(found)
    }
}

/// Refuses bodies and obstacles that cross, lie inside each other or are too thin at the start, at rest.
///
/// # Errors
/// [`SceneError`] at the first fault, with the place.
pub(super) fn check_start(
    loaded: &LoadedScene,
    bodies: &[Built],
    obstacles: &[Obstacle],
    contacts: &Contacts,
) -> Result<(), SceneError> {
    if contacts.is_empty() {
        return Ok(());
    }
    let start = Start {
        loaded,
        bodies,
        obstacles,
        contacts,
    };
    start.shapes()?;
    start.meshes()
}

struct Start<'a> {
    loaded: &'a LoadedScene,
    bodies: &'a [Built],
    obstacles: &'a [Obstacle],
    contacts: &'a Contacts,
}

impl Start<'_> {
    /// No body begins inside a shape, and no shape inside a body.
    fn shapes(&self) -> Result<(), SceneError> {
        for pair in &self.contacts.pairs {
            let [Thing::Body(body), Thing::Obstacle(number)] = pair.between else {
                continue;
            };
            let obstacle = &self.obstacles[number];
            let Geometry::Shape(shape) = obstacle.geometry() else {
                continue;
            };
            let mesh = &self.bodies[body].mesh;
            let x = mesh.positions();
            let elements: Vec<[u32; 3]> = match mesh {
                Mesh::Thread(mesh) => mesh.lines.iter().map(|[a, b]| [*a, *b, *b]).collect(),
                Mesh::Sheet(mesh) => mesh.triangles.clone(),
                Mesh::Solid(mesh) => mesh.boundary(),
            };
            let each = elements.iter().filter_map(|corners| {
                let corners = corners.map(|v| &x[v as usize]);
                deepest(obstacle, corners, 0.0, -SLACK * pair.distance)
            });
            let found = each.min_by(|a, b| a.0.total_cmp(&b.0));
            if let Some((depth, at)) = found {
                let found = format!(
                    "{} {} m inside {} at {}",
                    self.name(pair.between[0]),
                    round(-depth),
                    self.name(pair.between[1]),
                    place(&at)
                );
                return Err(self.apart(pair.between, found));
            }
            let centre = obstacle.pose(0.0).translation.vector;
            let is_solid = matches!(mesh, Mesh::Solid(_)) && *shape != Shape::Plane;
            if is_solid && winding(&elements, x, &centre) > INSIDE {
                let found = self.inside(pair.between[1], pair.between[0], &centre);
                return Err(self.apart(pair.between, found));
            }
        }
        Ok(())
    }

    /// No two meshes cross, none lies inside another one, and none is too thin.
    fn meshes(&self) -> Result<(), SceneError> {
        let mut surfaces = Surfaces::default();
        let (mut x, mut things, mut walls) = (Vec::new(), Vec::new(), Vec::new());
        let refuse = |thing: Thing, error: &dyn std::fmt::Display| {
            let allowed = "a surface";
            let source = &self.loaded.source;
            source.error(
                &field(&self.loaded.scene, thing),
                error.to_string(),
                allowed,
            )
        };
        for (index, built) in self.bodies.iter().enumerate() {
            let thing = Thing::Body(index);
            let farthest = self.contacts.farthest(thing);
            let is_closed = matches!(built.mesh, Mesh::Solid(_)) && farthest > 0.0;
            let skin = Skin {
                radius: self.contacts.radii[index],
                touches_itself: is_closed || self.contacts.pair(thing, thing).is_some(),
                is_obstacle: false,
            };
            (surfaces.add(&built.mesh, skin)).map_err(|error| refuse(thing, &error))?;
            x.extend_from_slice(built.mesh.positions());
            things.push(thing);
            walls.push(is_closed.then_some(farthest));
        }
        for (index, obstacle) in self.obstacles.iter().enumerate() {
            let Geometry::Mesh(mesh) = obstacle.geometry() else {
                continue;
            };
            let thing = Thing::Obstacle(index);
            let skin = Skin {
                radius: 0.0,
                touches_itself: true,
                is_obstacle: true,
            };
            (surfaces.add_closed(mesh, skin)).map_err(|error| refuse(thing, &error))?;
            let first = x.len();
            x.resize(first + obstacle.vertices(), Vec3::zeros());
            obstacle.write_positions(0.0, &mut x[first..]);
            things.push(thing);
            walls.push(Some(self.contacts.farthest(thing)));
        }
        let distance = |p: usize, q: usize| {
            let pair = self.contacts.pair(things[p], things[q]);
            pair.map(|pair| pair.distance)
        };
        let touching = Touching {
            distance: &distance,
            walls: &walls,
        };
        let Some(fault) = faults(&surfaces, &x, &touching).into_iter().next() else {
            return Ok(());
        };
        Err(match fault {
            Fault::Crossed { parts: [p, q], at } => {
                let [one, other] = [things[p], things[q]];
                let with = if p == q {
                    "itself".to_owned()
                } else {
                    self.name(one)
                };
                let found = format!("{} crosses {with} at {}", self.name(other), place(&at));
                self.apart([one, other], found)
            }
            Fault::Inside { part, of, at } => {
                let [one, other] = [things[part], things[of]];
                self.apart([one, other], self.inside(one, other, &at))
            }
            Fault::Thin { part, at, apart } => {
                let thing = things[part];
                let most = distance(part, part).into_iter().chain(walls[part]);
                let found = format!(
                    "two places of {} that are {} m apart at {}",
                    self.name(thing),
                    round(apart),
                    place(&at)
                );
                let allowed = format!(
                    "places that are more than {} m apart, the distance at which contact begins: give a smaller thickness",
                    round(most.fold(0.0, f64::max))
                );
                let field = field(&self.loaded.scene, thing);
                self.loaded.source.error(&field, found, allowed)
            }
        })
    }

    /// A thing in words.
    fn name(&self, thing: Thing) -> String {
        let kind = match thing {
            Thing::Body(_) => "body",
            Thing::Obstacle(index) if index < self.loaded.scene.given_obstacles().len() => {
                "obstacle"
            }
            Thing::Obstacle(_) => "tool",
        };
        format!("{kind} {:?}", thing.name(&self.loaded.scene))
    }

    fn inside(&self, one: Thing, other: Thing, at: &Vec3) -> String {
        let [inner, outer] = [one, other].map(|thing| self.name(thing));
        format!("{inner} inside {outer}, at {}", place(at))
    }

    /// The error for two things that begin in each other.
    fn apart(&self, [one, other]: [Thing; 2], found: String) -> SceneError {
        let distance = self.contacts.pair(one, other).map(|pair| pair.distance);
        let allowed = format!(
            "surfaces that are apart at the start, best by {} m, the distance at which contact begins",
            round(distance.unwrap_or_default())
        );
        let source = &self.loaded.source;
        let field = field(&self.loaded.scene, one.max(other));
        source.error(&field, found, allowed)
    }
}

/// Leaves out the `starts` of bodies that meet something on their way from rest: an equilibrium without contact may lie behind
/// an obstacle.
pub(super) fn keep_apart(
    contacts: &Contacts,
    bodies: &[Built],
    obstacles: &[Obstacle],
    starts: &mut [Option<Body>],
) {
    let rest = |body: usize| bodies[body].mesh.positions();
    let mut ways: Vec<Option<Bounds>> = Vec::new();
    for (body, start) in starts.iter().enumerate() {
        let settled = start.iter().flat_map(Body::positions);
        let all: Vec<Vec3> = rest(body).iter().copied().chain(settled).collect();
        ways.push(Bounds::of(&all));
    }
    for (body, start) in starts.iter_mut().enumerate() {
        let Some(settled) = start else { continue };
        let thing = Thing::Body(body);
        let mut pairs = contacts.pairs.iter();
        let meets = pairs.any(|pair| {
            let [one, other] = pair.between;
            match (one == thing, other) {
                (true, Thing::Obstacle(number)) => {
                    let ends = [rest(body).to_vec(), settled.positions().collect()];
                    meets(
                        &obstacles[number],
                        ways[body].as_ref(),
                        &ends,
                        pair.distance,
                    )
                }
                (true, other) if other == thing => {
                    folds(&bodies[body].mesh, settled, pair.distance)
                }
                (_, Thing::Body(other)) if one == thing || other == body => {
                    let [Thing::Body(one), Thing::Body(other)] = pair.between else {
                        return false;
                    };
                    overlap(ways[one].as_ref(), ways[other].as_ref(), pair.distance)
                }
                _ => false,
            }
        });
        if meets {
            *start = None;
        }
    }
}

/// Whether two boxes are nearer to each other than a distance (m).
fn overlap(one: Option<&Bounds>, other: Option<&Bounds>, distance: f64) -> bool {
    let (Some(one), Some(other)) = (one, other) else {
        return false;
    };
    let gaps = (one.min - other.max).sup(&(other.min - one.max));
    gaps.max() < distance
}

/// Whether an obstacle lies on a way: in its box, or on the wrong side of a plane.
fn meets(obstacle: &Obstacle, way: Option<&Bounds>, ends: &[Vec<Vec3>; 2], distance: f64) -> bool {
    let Some(bounds) = way else { return false };
    match obstacle.geometry() {
        Geometry::Mesh(_) => {
            let mut x = vec![Vec3::zeros(); obstacle.vertices()];
            obstacle.write_positions(0.0, &mut x);
            overlap(way, Bounds::of(&x).as_ref(), distance)
        }
        Geometry::Shape(Shape::Plane) => ends.iter().flatten().any(|x| {
            let near = obstacle.nearest(x, 0.0);
            near.is_some_and(|near| near.distance < (1.0 - SLACK) * distance)
        }),
        Geometry::Shape(_) => {
            let (centre, around) = ((bounds.min + bounds.max) / 2.0, bounds.size().norm() / 2.0);
            let near = obstacle.nearest(&centre, 0.0);
            near.is_some_and(|near| near.distance < around + distance)
        }
    }
}

/// Whether a settled body crosses itself, or is nearer to itself than a distance (m).
fn folds(mesh: &Mesh, settled: &Body, distance: f64) -> bool {
    let mut surfaces = Surfaces::default();
    let skin = Skin {
        radius: 0.5 * distance,
        touches_itself: true,
        is_obstacle: false,
    };
    let x: Vec<Vec3> = settled.positions().collect();
    let touching = Touching {
        distance: &|_, _| Some(distance),
        walls: &[None],
    };
    surfaces.add(mesh, skin).is_err() || !faults(&surfaces, &x, &touching).is_empty()
}

/// The field of a thing.
fn field(scene: &Scene, thing: Thing) -> String {
    match thing {
        Thing::Body(index) => format!("body[{index}]"),
        Thing::Obstacle(index) => scene.field_of_obstacle(index),
    }
}

/// A place in words, to the micrometre.
fn place(at: &Vec3) -> String {
    // The sum has no negative zero.
    let [x, y, z]: [f64; 3] = at.map(|x| (x * 1e6).round() / 1e6 + 0.0).into();
    format!("[{x}, {y}, {z}]")
}
