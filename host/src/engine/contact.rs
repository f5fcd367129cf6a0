//! Contact in the host step: the bodies, themselves and the obstacles of a world.
//!
//! The physics does the work (`physics::motion::contacts`). This file gives it the bodies between their stages, and the time.

use super::body::HostBody;
use super::stats::{StepFault, Stopwatch};
use super::tool::{self, HostTool};
use crate::scene::SceneError;
use crate::world::World;
use physics::motion::contacts::{Contacts, MOST_BODIES, Member, Side, Touching};
use physics::{Around, Beside, Vec3};
use physics::{Body, BodyMap};
use rt_core::{MAX_BODIES, TickRecord};
use serde::Serialize;

/// How much faster than the bodies an obstacle moves at most, while it makes up for steps that a late host left out.
const FASTEST: f64 = 2.0;

const _: () = assert!(MAX_BODIES <= MOST_BODIES);

/// The contacts of an engine.
pub struct Contact {
    contacts: Contacts,
    sides: Vec<Side>,
    /// The topology epoch of each body whose surface there is.
    epochs: Vec<u64>,
    /// By body: whether its surface could not follow.
    is_stale: [bool; MAX_BODIES],
    /// The bodies that have been replaced since the last step, and the vertices that theirs continue.
    replaced: Vec<(usize, Vec<u32>)>,
    /// Where the obstacles are (s), and where the present step takes them.
    time: f64,
    due: f64,
    /// The length of a step (s).
    step: f64,
    tools: Vec<HostTool>,
    /// Number of meshes that have been replaced.
    replacements: u32,
    totals: ContactTotals,
    /// The pairs that touched in the last step, by bit, and whether others touch now.
    pairs: u64,
    has_changed: bool,
}

/// The contacts of all steps so far.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ContactTotals {
    /// By pair of bodies and obstacles that have touched, in the order of their first contact.
    pub pairs: Vec<PairTotals>,
    /// The sums over all pairs.
    pub sums: ContactSums,
}

/// Sums over all steps and pairs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct ContactSums {
    /// Displacements that were shortened.
    pub truncated: u64,
    /// Pairs of elements without room. They may cross.
    pub squeezed: u64,
    /// Contacts without a row; there are six for each vertex of all surfaces.
    pub dropped: u64,
    /// Most rows of a step.
    pub most_rows: usize,
    /// Energy that contacts took (J).
    pub taken: f64,
    /// Its part in springs of friction at the end (J).
    pub stored: f64,
    /// Work of moving obstacles (J).
    pub by_obstacles: f64,
    /// Work with which overlapping starts parted (J).
    pub parted: f64,
    /// Energy that shortening took (J).
    pub stopped: f64,
}

/// The contacts of a pair in all steps so far.
#[derive(Clone, Debug, PartialEq)]
pub struct PairTotals {
    /// The pair.
    pub between: [Side; 2],
    /// Number of steps in which the two touched.
    pub steps: u64,
    /// Most contacts of a step.
    pub most: usize,
    /// The contacts of the last step; zero if the two did not touch in it.
    pub last: Touching,
    /// Largest sum of the normal forces (N), and its time (s).
    pub peak: (f64, f64),
    /// Largest depth (m).
    pub depth: f64,
}

impl Contact {
    /// The contacts between the `bodies` of a world and its obstacles; `None` if nothing touches.
    ///
    /// # Errors
    /// [`SceneError`] for a body or an obstacle whose triangles are no surface.
    pub fn new(world: &World<'_>, bodies: &[HostBody]) -> Result<Option<Self>, SceneError> {
        if world.contacts.is_empty() && world.loaded.scene.tools.is_empty() {
            return Ok(None);
        }
        let own: heapless::Vec<&Body, MAX_BODIES> = bodies.iter().map(HostBody::body).collect();
        let contacts = world.touching(&own)?;
        Ok(Some(Self {
            sides: contacts.sides(),
            epochs: bodies.iter().map(|body| body.body().epoch()).collect(),
            contacts,
            is_stale: [false; MAX_BODIES],
            replaced: Vec::new(),
            time: 0.0,
            due: 0.0,
            step: 1.0 / world.loaded.scene.host.step_rate,
            tools: tool::all(world),
            replacements: 0,
            totals: ContactTotals::default(),
            pairs: 0,
            has_changed: false,
        }))
    }

    /// The contacts of all steps so far.
    pub fn totals(&self) -> &ContactTotals {
        &self.totals
    }

    /// Adds the present step to the totals.
    fn sum_up(&mut self) {
        let (report, totals) = (self.contacts.report(), &mut self.totals);
        let sums = &mut totals.sums;
        sums.truncated += report.truncated.truncated as u64;
        sums.squeezed += report.truncated.squeezed as u64;
        sums.dropped += report.rows.dropped as u64;
        sums.most_rows = sums.most_rows.max(report.rows.rows);
        sums.taken += report.taken;
        sums.stored = report.stored;
        sums.by_obstacles += report.by_obstacles;
        sums.parted += report.parted;
        sums.stopped += report.stopped;
        for pair in &mut totals.pairs {
            pair.last = Touching::default();
        }
        for found in self.contacts.touching() {
            let between = found.sides.map(|side| self.sides[side]);
            let at = totals.pairs.iter().position(|pair| pair.between == between);
            let at = at.unwrap_or_else(|| {
                totals.pairs.push(PairTotals {
                    between,
                    steps: 0,
                    most: 0,
                    last: Touching::default(),
                    peak: (0.0, 0.0),
                    depth: 0.0,
                });
                totals.pairs.len() - 1
            });
            let pair = &mut totals.pairs[at];
            pair.steps += 1;
            pair.most = pair.most.max(found.count);
            pair.depth = pair.depth.max(found.depth);
            if found.normal > pair.peak.0 {
                pair.peak = (found.normal, self.time);
            }
            pair.last = *found;
        }
        // The pairs are numbered in the order of their first contact. Those beyond the bits change unseen.
        let touching = totals.pairs.iter().take(64).enumerate();
        let pairs = touching.map(|(bit, pair)| u64::from(pair.last.count > 0) << bit);
        let pairs = pairs.fold(0, |all, pair| all | pair);
        self.has_changed = pairs != self.pairs;
        self.pairs = pairs;
    }

    /// Where the obstacles are (s): the time of the last step.
    pub fn time(&self) -> f64 {
        self.time
    }

    /// The contacts of the physics.
    pub fn contacts(&self) -> &Contacts {
        &self.contacts
    }

    /// Whether two sides began or ceased to touch in the last step.
    pub(super) fn has_changed(&self) -> bool {
        self.has_changed
    }

    /// Prepares the contacts of the last step for local models, and those that close while the models last.
    pub(super) fn hold(&mut self, bodies: &mut [HostBody]) {
        self.contacts.hold();
        let horizons = bodies
            .iter()
            .map(|body| body.publisher().model().head.horizon);
        let horizon = horizons.fold(0.0, f64::max);
        self.contacts.foresee(&members(bodies), horizon);
    }

    /// Makes the model of the body of this number among `bodies`, with those that share contacts with it.
    pub(super) fn publish(
        &mut self,
        bodies: &mut [HostBody],
        number: usize,
        watch: &dyn Stopwatch,
    ) -> Result<(), StepFault> {
        let mut others: [Option<Beside<'_, f64>>; MOST_BODIES] = [const { None }; MOST_BODIES];
        let mut own = None;
        for (other, (body, room)) in bodies.iter_mut().zip(&mut others).enumerate() {
            if other == number {
                own = Some(body);
            } else if self.contacts.share(number, other) {
                *room = body.beside();
            }
        }
        let ([springs, coming], room) = self.contacts.held(number);
        let mut around = Around {
            number,
            springs,
            coming,
            others,
            room,
        };
        own.map_or(Ok(()), |body| body.publish(Some(&mut around), watch))
    }

    /// Notes that the mesh of a body has been replaced. `map` leads from the new body to the old one.
    pub(super) fn replace(&mut self, body: usize, map: &BodyMap) {
        self.replacements += 1;
        self.replaced.push((body, map.vertices.clone()));
    }

    /// Whether a vertex of the body of this number can go to a place (m), see [`Contacts::is_clear`]. The surface follows an edit
    /// in the next step.
    pub(super) fn is_clear(&self, number: usize, body: &Body, vertex: u32, to: &Vec3) -> bool {
        let epoch = self.epochs.get(number).copied();
        let is_followed = epoch == Some(body.epoch()) && !self.is_stale[number];
        (self.contacts).is_clear(number, body, vertex, to, is_followed)
    }

    /// Follows bodies that have torn or have been changed. Returns the bodies whose new surface cannot touch: they touch with
    /// the surface that they had.
    pub(super) fn follow(&mut self, bodies: &[HostBody]) -> impl Iterator<Item = usize> {
        let mut failed = [false; MAX_BODIES];
        let each = bodies.iter().zip(&mut self.epochs).zip(&mut failed);
        for (number, ((body, epoch), failed)) in each.enumerate() {
            let body = body.body();
            if *epoch != body.epoch() {
                *epoch = body.epoch();
                let replaced = self.replaced.iter();
                let continues = replaced.rev().find(|(body, _)| *body == number);
                let continues = continues.map(|(_, vertices)| vertices.as_slice());
                let followed = body
                    .mesh()
                    .map(|mesh| self.contacts.follow(number, body, mesh, continues));
                *failed = !matches!(followed, Some(Ok(())));
                self.is_stale[number] = *failed;
            }
        }
        self.replaced.clear();
        let failed = failed.into_iter().enumerate();
        failed.filter_map(|(number, failed)| failed.then_some(number))
    }

    /// Takes one tick's record, with the places of the tools.
    pub(super) fn follow_hands(&mut self, record: &TickRecord) {
        for tool in &mut self.tools {
            tool.follow(record);
        }
    }

    /// Begins the step up to the time `due_ns` (ns): leads the tools. Called before the bodies are constrained.
    pub(super) fn begin(&mut self, due_ns: u64) {
        // After steps that a late host left out, the bodies have moved by one step only. An obstacle that jumped to its place
        // would pass through them.
        self.due = (due_ns as f64 * 1e-9).min(self.time + FASTEST * self.step);
        for tool in &mut self.tools {
            tool.lead(&mut self.contacts, [self.time, self.due]);
        }
    }

    /// Makes the patch of each tool, after a step that ended at `due_ns` (ns).
    pub(super) fn publish_tools(&mut self, bodies: &mut [HostBody], due_ns: u64) {
        for tool in &mut self.tools {
            tool.publish(&self.contacts, bodies, due_ns, self.replacements);
        }
    }

    /// The tools.
    pub(super) fn tools(&self) -> &[HostTool] {
        &self.tools
    }

    /// Keeps bodies awake that touch a body which moves. Called before the bodies are constrained.
    pub(super) fn keep_awake(&self, bodies: &mut [HostBody]) {
        let mut rests = [false; MAX_BODIES];
        for (rests, body) in rests.iter_mut().zip(&*bodies) {
            *rests = body.rests();
        }
        self.contacts.keep_awake(
            bodies.len().min(MAX_BODIES),
            &|body| rests[body],
            &mut |body, is_kept| bodies[body].stepping.solver.keep_awake(is_kept),
        );
    }

    /// Solves the bodies that have contacts, up to the time at which the step [ends](Self::begin). Called after the bodies have
    /// been constrained.
    pub(super) fn solve(&mut self, bodies: &mut [HostBody], watch: &dyn Stopwatch) {
        let start = watch.now_ns();
        let left = bodies
            .iter()
            .filter_map(|body| body.stepping.solver.left_ns());
        let end = left.min().map(|left| start + left);
        let mut members = members(bodies);
        self.contacts
            .begin(&members, [self.time, self.due], self.step);
        self.time = self.due;
        let mut is_late = |_| end.is_some_and(|end| watch.now_ns() >= end);
        self.contacts.solve(&mut members, &mut is_late);
        drop(members);
        let time = watch.now_ns().saturating_sub(start);
        for body in bodies {
            body.stepping.solver.spend(time);
        }
    }

    /// Certifies the displacements. Called after all bodies have been solved.
    pub(super) fn certify(&mut self, bodies: &mut [HostBody], watch: &dyn Stopwatch) {
        let start = watch.now_ns();
        self.contacts.certify(&mut members(bodies));
        self.sum_up();
        for (number, body) in bodies.iter_mut().enumerate() {
            if let Some(tears) = &mut body.stepping.tears {
                let work = self.contacts.work_on(number);
                tears.balance.push(work);
                tears.tearing.push(work);
            }
            body.receive(self.contacts.work_of_bodies_on(number));
        }
        let time = watch.now_ns().saturating_sub(start);
        for body in bodies {
            body.stepping.solver.spend(time);
        }
    }
}

/// The bodies as the physics takes them. A body of which a stage has failed stands still.
fn members(bodies: &mut [HostBody]) -> heapless::Vec<Member<'_, f64>, MAX_BODIES> {
    let members = bodies.iter_mut().map(|body| {
        let stepping = &mut body.stepping;
        let stepper = stepping.sound.then(|| stepping.solver.stepper());
        Member {
            body: &stepping.body,
            stepper,
        }
    });
    members.collect()
}
