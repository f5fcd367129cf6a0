//! Judges the run of a world: the rules that it must keep.

use super::felt::Felt;
use crate::contact::crossings::crossings;
use host::engine::Engine;
use host::engine::body::HostBody;
use host::engine::contact::Contact;
use host::world::World;
use host::world::contact::Thing;
use physics::contact::Obstacle;
use physics::contact::obstacle::Geometry;
use physics::contact::shape::Shape;
use physics::motion::contacts::Side;
use physics::{Body, Vec3};
use rt_core::Telemetry;
use rt_core::tool::ToolCoupling;
use runner::TickLoop;

/// The largest net energy of the hands (J).
pub const NET_ENERGY: f64 = 1e-3;
/// The most that contacts may give to what they touch, and that bodies may gain beyond the work of hands and obstacles, as
/// a fraction of the energy that moves, and in any case (J). The aim of the study of contact for the sum of all steps that
/// give is 0.2 %.
const GIVEN: [f64; 2] = [2e-3, 1e-6];

/// The contacts of a run.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Counts {
    pub(super) steps: u64,
    /// Steps in which something touched, and in which displacements were shortened.
    pub(super) touched: u64,
    pub(super) truncated: u64,
    /// Steps after which nothing crosses, or must not.
    pub(super) judged: u64,
    pub(super) squeezed: u64,
    pub(super) dropped: u64,
    pub(super) most_rows: usize,
    pub(super) unconverged: u64,
    /// Edges that tore.
    pub(super) opened: u64,
}

/// What crosses after a step, in words.
#[derive(Default)]
struct Crossings {
    /// Bodies that no hand holds: they always have room to stop.
    with_room: Option<String>,
    /// Of hands or obstacles.
    pushed: Option<String>,
    /// Whether faces of a closed tear cross.
    is_tangled: bool,
}

/// Follows a run.
pub(super) struct Judge<'a> {
    world: &'a World<'a>,
    /// Steps between two tests of all edges and triangles.
    every: u64,
    /// Whether a hand holds a body.
    is_held: bool,
    /// The energy of the bodies beyond that at the start and the work of hands and obstacles (J): the most, and the last one.
    gained: f64,
    last: f64,
    /// The work of hands on bodies in the steps that were seen, and the change of energy in those that were not (J).
    by_hands: f64,
    /// A checksum over all ticks (FNV-1a).
    pub(super) checksum: u64,
    pub(super) counts: Counts,
    /// The largest force (N), and the deepest contact (m).
    pub(super) peak: f64,
    pub(super) depth: f64,
    /// The energy at the start (J), and the least potential of weight in the run (J).
    start: f64,
    lowest: f64,
    /// The most work of obstacles and of partings so far (J); the largest work on the hands beyond it.
    driven: f64,
    beyond: f64,
    /// What the hands felt with tools.
    pub(super) felt: Felt<'a>,
    /// The sum of the magnitudes of all work (J).
    moved: f64,
    before: [f64; 2],
    /// What contacts and shortening have given to both sides at most (J).
    given: f64,
    x: Vec<Vec3>,
    /// Pairs without room, and steps that tore, so far; whether something without room may have crossed.
    squeezed: u64,
    torn: u64,
    leaves: bool,
    infinite: Option<u64>,
    crossed: Option<(u64, String)>,
    /// Patches that the tick refused because of their contents.
    pub(super) refused: u64,
    faults: u64,
    first_fault: Option<String>,
    panicked: Option<String>,
}

impl<'a> Judge<'a> {
    pub(super) fn new(world: &'a World<'a>, engine: &Engine, every: u64) -> Self {
        let bodies = || engine.bodies().iter().map(HostBody::body);
        Self {
            world,
            every,
            is_held: bodies().any(|body| body.handle_count() > 0),
            gained: 0.0,
            last: 0.0,
            by_hands: 0.0,
            checksum: 0xcbf2_9ce4_8422_2325,
            counts: Counts::default(),
            peak: 0.0,
            depth: 0.0,
            start: bodies().map(Body::total_energy).sum(),
            lowest: bodies().map(Body::load_potential).sum(),
            driven: 0.0,
            beyond: 0.0,
            felt: Felt::new(world),
            moved: 0.0,
            before: [0.0; 2],
            given: 0.0,
            x: Vec::new(),
            squeezed: 0,
            torn: 0,
            leaves: false,
            infinite: None,
            crossed: None,
            refused: 0,
            faults: 0,
            first_fault: None,
            panicked: None,
        }
    }

    /// Takes a tick.
    pub(super) fn see(&mut self, tick: &TickLoop, telemetry: &Telemetry, engine: Option<&Engine>) {
        let mut is_finite = true;
        let mut work = 0.0;
        for (device, shown) in tick.devices.iter().zip(&telemetry.devices) {
            let (force, place) = (shown.wrench.force, shown.pose.position);
            for value in force.iter().chain(place.iter()) {
                is_finite &= value.is_finite();
                self.take(value.to_bits());
            }
            self.peak = self.peak.max(force.norm());
            work += device.probe().map_or(f64::NAN, |probe| probe.on_hand);
        }
        if let Some(engine) = engine
            && engine.stats().steps > self.counts.steps
        {
            is_finite &= self.step(engine, telemetry.tick);
        }
        self.felt.see(telemetry);
        // A sum that is NaN counts as infinite.
        let beyond = work - self.driven;
        self.beyond = if beyond.is_nan() {
            f64::INFINITY
        } else {
            self.beyond.max(beyond)
        };
        self.moved += (work - self.before[0]).abs();
        self.before[0] = work;
        if !is_finite {
            self.infinite = self.infinite.or(Some(telemetry.tick));
        }
    }

    fn take(&mut self, bits: u64) {
        for byte in bits.to_le_bytes() {
            self.checksum = (self.checksum ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3);
        }
    }

    /// Takes a step of the host. Returns whether its state is finite.
    fn step(&mut self, engine: &Engine, tick: u64) -> bool {
        let missed = engine.stats().steps - self.counts.steps - 1;
        self.counts.steps = engine.stats().steps;
        let mut is_finite = true;
        for host in engine.bodies() {
            for value in host.body().node_positions().iter().flatten() {
                is_finite &= value.is_finite();
                self.take(value.to_bits());
            }
        }
        let bodies = || engine.bodies().iter().map(HostBody::body);
        self.lowest = self.lowest.min(bodies().map(Body::load_potential).sum());
        let Some(contact) = engine.contact() else {
            return is_finite;
        };
        let (report, totals) = (contact.contacts().report(), contact.totals().sums);
        self.counts.touched += u64::from(!contact.contacts().touching().is_empty());
        self.counts.truncated += u64::from(report.truncated.truncated > 0);
        let by_obstacles = totals.by_obstacles + totals.parted;
        // The obstacles of a world of tools stand, and what moves its tools are the hands.
        if self.world.loaded.scene.tools.is_empty() {
            self.driven = self.driven.max(by_obstacles);
        }
        self.moved += (by_obstacles - self.before[1]).abs();
        self.before[1] = by_obstacles;
        self.given = self.given.max(-totals.taken - totals.stopped);
        let energy: f64 = bodies().map(Body::total_energy).sum();
        let step = 1.0 / self.world.loaded.scene.host.step_rate;
        self.by_hands += bodies()
            .map(|body| power_of_hands(body) * step)
            .sum::<f64>();
        let gained = energy - self.start - by_obstacles - self.by_hands;
        if self.is_held && missed > 0 {
            // Nobody has seen the work of the hands in the steps before.
            self.by_hands += gained - self.last;
        }
        self.last = energy - self.start - by_obstacles - self.by_hands;
        self.gained = self.gained.max(self.last);
        let squeezed = core::mem::replace(&mut self.squeezed, totals.squeezed) < totals.squeezed;
        self.leaves |= squeezed;
        // The surfaces follow a tear in the next step.
        let torn = core::mem::replace(&mut self.torn, engine.stats().torn) < engine.stats().torn;
        let is_tested = self.counts.steps.is_multiple_of(self.every) && !torn;
        if is_tested && self.crossed.is_none() && is_finite {
            let found = self.crossings(engine, contact);
            if self.leaves {
                // What had no room may have crossed, and is judged again once nothing crosses any more.
                self.crossed = found.with_room.map(|crossed| (tick, crossed));
                self.leaves = found.pushed.is_some() || found.is_tangled;
            } else {
                let crossed = found.with_room.or(found.pushed);
                self.crossed = crossed.map(|crossed| (tick, crossed));
            }
            self.counts.judged += u64::from(!self.leaves);
        }
        is_finite
    }

    fn crossings(&mut self, engine: &Engine, contact: &Contact) -> Crossings {
        let (contacts, time) = (contact.contacts(), contact.time());
        let (surfaces, sides) = (contacts.surfaces(), contacts.sides());
        self.x.clear();
        self.x.resize(surfaces.vertices, Vec3::repeat(f64::NAN));
        for (part, side) in surfaces.parts.iter().zip(&sides) {
            let range = part.vertices.start as usize..part.vertices.end as usize;
            let x = &mut self.x[range];
            match side {
                Side::Body(body) => {
                    let from = engine.bodies()[*body].body().node_positions();
                    let count = from.len().min(x.len());
                    x[..count].copy_from_slice(&from[..count]);
                }
                Side::Obstacle(number) => place(contacts.obstacle(*number), time, x),
            }
        }
        let name = |part: usize| thing(sides[part]).name(&self.world.loaded.scene).to_owned();
        let may_touch = |one: usize, other: usize| {
            let [a, b] = [one, other].map(|part| thing(sides[part]));
            self.world.contacts.pair(a, b).is_some()
        };
        let moves_freely = |part: usize| match sides[part] {
            Side::Body(body) => engine.bodies()[body].body().handle_count() == 0,
            Side::Obstacle(_) => false,
        };
        let mut found = Crossings::default();
        crossings(surfaces, &self.x, &may_touch, &mut |ends, corners| {
            // The faces of a tear touch each other once it is open.
            let mut twins = ends.iter().flat_map(|a| corners.iter().map(|b| [*a, *b]));
            if twins.any(|[a, b]| surfaces.are_open(a, b) == Some(false)) {
                found.is_tangled = true;
                return;
            }
            let parts = [ends[0], corners[0]].map(|vertex| surfaces.part_of(vertex));
            let first = if parts.into_iter().all(moves_freely) {
                &mut found.with_room
            } else {
                &mut found.pushed
            };
            first.get_or_insert_with(|| {
                let [one, other] = parts.map(name);
                format!("an edge of {one} passes through a triangle of {other}")
            });
        });
        // No vertex is inside a shape.
        for pair in &self.world.contacts.pairs {
            let [Thing::Body(body), Thing::Obstacle(number)] = pair.between else {
                continue;
            };
            let obstacle = contacts.obstacle(number);
            if matches!(
                obstacle.geometry(),
                Geometry::Mesh(_) | Geometry::Shape(Shape::Box { .. })
            ) {
                continue;
            }
            let Some(part) = sides.iter().position(|side| *side == Side::Body(body)) else {
                continue;
            };
            if let Some(tool) = obstacle.rounded() {
                let triangles = surfaces.parts[part].triangles.clone();
                let triangles = triangles.map(|triangle| {
                    surfaces.triangles[triangle as usize].map(|corner| &self.x[corner as usize])
                });
                self.felt.touches(tool, &obstacle.pose(time), triangles);
            }
            let vertices = surfaces.parts[part].edges.clone();
            let vertices = vertices.flat_map(|edge| surfaces.edges[edge as usize]);
            for vertex in vertices {
                let x = &self.x[vertex as usize];
                let near = obstacle.nearest(x, time);
                if let Some(near) = near.filter(|near| near.distance < 0.0) {
                    found.pushed.get_or_insert_with(|| {
                        format!(
                            "a vertex of {} is {:.3e} m inside {}",
                            name(part),
                            -near.distance,
                            pair.between[1].name(&self.world.loaded.scene)
                        )
                    });
                }
            }
        }
        found
    }

    /// Ends the run.
    pub(super) fn end(&mut self, tick: &TickLoop, engine: &Engine, panicked: Option<String>) {
        let stats = engine.stats();
        let counters = tick.controller.tools().map(ToolCoupling::counters);
        self.refused = counters
            .map(|counts| counts.not_finite + counts.wrong_sites)
            .sum();
        (self.faults, self.first_fault) = (stats.faults, stats.first_fault.clone());
        self.counts.unconverged = stats.unconverged;
        self.counts.opened = stats.tears.iter().map(|report| report.opened).sum();
        self.panicked = panicked;
        if let Some(contact) = engine.contact() {
            let totals = contact.totals().sums;
            self.counts.squeezed = totals.squeezed;
            self.counts.dropped = totals.dropped;
            self.counts.most_rows = totals.most_rows;
            let depths = contact.totals().pairs.iter().map(|pair| pair.depth);
            self.depth = depths.fold(0.0, f64::max);
        }
    }

    /// The most energy that the hands got beyond what weight, obstacles and partings put in (J).
    ///
    /// The force that a hand feels is late. So the lowest place of the bodies in the whole run counts, and the most work of
    /// obstacles so far.
    pub(super) fn net_energy(&self) -> f64 {
        self.beyond - (self.start - self.lowest)
    }

    /// What the contacts gave to both sides at most (J), and the energy that moved (J).
    pub(super) fn given(&self) -> [f64; 2] {
        [self.given, self.moved + (self.start - self.lowest)]
    }

    /// The rules that the run broke.
    pub(super) fn failures(&self) -> Vec<String> {
        let mut found = Vec::new();
        if let Some(tick) = self.infinite {
            found.push(format!("a value is not finite in tick {tick}"));
        }
        if let Some((tick, crossed)) = &self.crossed {
            found.push(format!("{crossed} in tick {tick}"));
        }
        found.extend(self.felt.failures());
        let net = self.net_energy();
        if net.is_nan() || net > NET_ENERGY {
            found.push(format!(
                "the hands got {:.2} mJ beyond what weight and obstacles gave",
                1e3 * net
            ));
        }
        let [given, moved] = self.given();
        if given.is_nan() || given > GIVEN[0] * moved + GIVEN[1] {
            found.push(format!(
                "contacts gave {:.3} mJ, while {:.3} mJ moved",
                1e3 * given,
                1e3 * moved
            ));
        }
        if self.gained > GIVEN[0] * moved + GIVEN[1] {
            found.push(format!(
                "the bodies gained {:.3} mJ beyond the work of hands and obstacles, while {:.3} mJ moved",
                1e3 * self.gained,
                1e3 * moved
            ));
        }
        if self.faults > 0 {
            let first = self.first_fault.as_deref().unwrap_or_default();
            found.push(format!(
                "{} faults of the host; the first: {first}",
                self.faults
            ));
        }
        if self.refused > 0 {
            found.push(format!("the tick refused {} patches", self.refused));
        }
        if let Some(panic) = &self.panicked {
            found.push(format!("the host panicked: {panic}"));
        }
        found
    }
}

/// The power of the hands on a body in the last step (W).
fn power_of_hands(body: &Body) -> f64 {
    let reports = (0..).map_while(|handle| body.handle_report(handle));
    let powers = reports.map(|report| {
        report.reaction.force.dot(&report.linear_velocity)
            + report.reaction.moment.dot(&report.angular_velocity)
    });
    powers.sum()
}

fn thing(side: Side) -> Thing {
    match side {
        Side::Body(body) => Thing::Body(body),
        Side::Obstacle(number) => Thing::Obstacle(number),
    }
}

/// The positions of the triangles of an obstacle (m) at a time (s).
fn place(obstacle: &Obstacle, time: f64, x: &mut [Vec3]) {
    match obstacle.geometry() {
        Geometry::Shape(Shape::Box { half }) => {
            let pose = obstacle.pose(time);
            for (corner, x) in x.iter_mut().enumerate() {
                let sign = |axis: usize| if corner >> axis & 1 == 1 { 1.0 } else { -1.0 };
                let at = Vec3::from_fn(|axis, _| sign(axis) * half[axis]);
                *x = pose.rotation * at + pose.translation.vector;
            }
        }
        _ => obstacle.write_positions(time, x),
    }
}
