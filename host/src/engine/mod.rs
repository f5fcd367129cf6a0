//! The host step: its stages in their order, up to the publication of a local model.
//!
//! `handles -> predict -> constrain -> contact -> solve -> certify -> finish -> condense -> publish`. This is the only module that joins
//! the physics to the tick. The engine reads no clock, and owns the [threads] that share a step. Under the real clock a
//! thread drives it; under virtual time the run's only loop does. The time of a stage is measured through the
//! [`Stopwatch`] that the caller passes; nothing in the state depends on this time.
//!
//! Bodies that are joined, by contact or by springs, are solved together ([`Engine::join`]): after `constrain` all bodies
//! have their equations, and `solve` solves each group as a whole.

mod background;
mod balance;
pub mod body;
pub mod build;
pub mod change;
pub mod choice;
mod clock;
pub mod contact;
pub mod damped;
pub mod faults;
mod hands;
mod joined;
pub mod pacer;
mod parting;
mod path;
pub mod plan;
pub mod projected;
pub mod publisher;
pub mod recipe;
pub(crate) mod records;
pub mod rehearsal;
mod renewal;
mod solver;
pub mod stats;
mod stepping;
pub mod stiff;
mod stored;
pub mod tears;
pub mod threads;
pub(crate) mod tool;
pub mod unrendered;
pub mod virtual_coupling;

use body::HostBody;
use change::{ChangeError, Edit};
use contact::Contact;
use core::ops::Range;
use joined::Group;
use pacer::Due;
use physics::motion::joined::Joints;
use physics::team::each_run;
use physics::{BodyError, Team, TearReport};
use rt_core::tool::Patch;
use rt_core::{LocalModel, TickRecord};
use stats::{EngineStats, StepFault, Stopwatch};
use std::sync::Arc;
use threads::{Threads, awake};
use tool::HostTool;

/// All bodies of a scene, stepped together.
pub struct Engine {
    bodies: Vec<HostBody>,
    groups: Vec<Group>,
    contact: Option<Contact>,
    /// The threads that share a step.
    threads: Arc<Threads>,
    stats: EngineStats,
}

impl Engine {
    /// An engine over `bodies`.
    pub fn new(bodies: Vec<HostBody>) -> Self {
        let mut stats = EngineStats::new();
        stats.tears = vec![TearReport::default(); bodies.len()];
        Self {
            bodies,
            groups: Vec::new(),
            contact: None,
            threads: Arc::default(),
            stats,
        }
    }

    /// The engine on `count` threads of its own, which its bodies share. One thread is the caller's.
    #[must_use]
    pub fn on(mut self, count: usize) -> Self {
        self.threads = Arc::new(Threads::new(count));
        for body in &mut self.bodies {
            body.stepping.solver.work_with(self.threads.clone());
        }
        self
    }

    /// The engine with these contacts between its bodies and with obstacles.
    #[must_use]
    pub fn touching(mut self, contact: Option<Contact>) -> Self {
        self.contact = contact;
        self
    }

    /// The contacts; `None` for a scene in which nothing touches.
    pub fn contact(&self) -> Option<&Contact> {
        self.contact.as_ref()
    }

    /// Gives the engine's bodies the physics and the solvers of `bodies`, in the engine's order, from the next step
    /// on.
    ///
    /// # Errors
    /// [`BodyError`] if a body is not of the same mesh as the body that it replaces.
    pub fn exchange(&mut self, bodies: Vec<HostBody>) -> Result<(), BodyError> {
        for (body, other) in self.bodies.iter_mut().zip(bodies) {
            body.exchange(other)?;
        }
        Ok(())
    }

    /// Joins `bodies`, by their numbers in ascending order, from the next step on. A body belongs to one group at most. The
    /// bodies are parted if the mesh of one is replaced and the joints do not follow it ([`Joints::follow`]); this is
    /// counted as a fault.
    pub fn join(&mut self, bodies: Vec<usize>, joints: Box<dyn Joints>) {
        self.groups.push(Group::new(bodies, joints));
    }

    /// Begins a change of a body: all `edits` in their order, as one change. The body and its solver stay as they are
    /// until the new solver is ready; the change then lands at the start of a step. A change that turns out to be
    /// impossible is counted as a fault, and the body continues as it was.
    ///
    /// This call copies the body, which takes about as long as reading it from memory. Everything else is done beside
    /// the steps.
    ///
    /// # Errors
    /// [`ChangeError`] for a body, a device or a link that does not exist, and while an earlier change of the same body
    /// is under way.
    pub fn change(&mut self, body: usize, edits: Vec<Edit>) -> Result<(), ChangeError> {
        let count = self.bodies.len();
        match self.bodies.get_mut(body) {
            Some(body) => body.change(edits),
            None => Err(ChangeError::NoBody { body, count }),
        }
    }

    /// Takes the record of one tick with the poses of the hands. Records come in the order of the ticks.
    pub fn follow(&mut self, record: &TickRecord) {
        for body in &mut self.bodies {
            body.follow(record);
        }
        if let Some(contact) = &mut self.contact {
            contact.follow_hands(record);
        }
    }

    /// The patches that the last step published, each with the device of its tool.
    pub fn patches(&self) -> impl Iterator<Item = (usize, &Patch)> {
        let tools = self.contact.iter().flat_map(Contact::tools);
        tools.filter_map(HostTool::published)
    }

    /// Makes one host step of all bodies, call by call (predict, constrain, solve, finish). Joined bodies are solved before
    /// the others. If the step publishes, `publish` is given a local model of each
    /// body. A body whose step fails keeps its last good state and publishes nothing: its model ages, and the tick
    /// fades its force.
    pub fn step(
        &mut self,
        due: Due,
        watch: &dyn Stopwatch,
        publish: &mut (dyn FnMut(usize, &LocalModel) + Send),
    ) {
        let threads = Arc::clone(&self.threads);
        threads.run(|| awake(|| self.step_here(&*threads, due, watch, publish)));
    }

    /// Makes a step on the present thread, which leads the others.
    fn step_here(
        &mut self,
        team: &dyn Team,
        due: Due,
        watch: &dyn Stopwatch,
        publish: &mut dyn FnMut(usize, &LocalModel),
    ) {
        self.stats.steps += 1;
        let stats = &mut self.stats;
        for (index, body) in self.bodies.iter_mut().enumerate() {
            let (groups, mut is_parted) = (&mut self.groups, false);
            let contact = &mut self.contact;
            let landed = body.land(&mut |map| {
                if let Some(contact) = contact {
                    contact.replace(index, map);
                }
                let before = groups.len();
                groups.retain_mut(|group| group.follow(index, map));
                is_parted = groups.len() < before;
            });
            match landed {
                Ok(landed) => stats.changes += u64::from(landed),
                Err(fault) => stats.fault(index, &fault),
            }
            if is_parted {
                stats.fault(index, &StepFault::Parted);
            }
        }
        let all = 0..self.bodies.len();
        self.stage(team, all.clone(), &|_, body| body.predict(watch));
        for group in &self.groups {
            group.wake(&mut self.bodies);
        }
        if let Some(contact) = &mut self.contact {
            for body in contact.follow(&self.bodies) {
                self.stats.fault(body, &StepFault::Surface);
            }
            contact.begin(due.time_ns);
            contact.keep_awake(&mut self.bodies);
        }
        self.stage(team, all.clone(), &|_, body| body.constrain(watch));
        if let Some(contact) = &mut self.contact {
            contact.solve(&mut self.bodies, watch);
        }
        for group in &mut self.groups {
            group.solve(&mut self.bodies, watch);
        }
        self.stage(team, all.clone(), &|_, body| body.solve(watch));
        if let Some(contact) = &mut self.contact {
            contact.certify(&mut self.bodies, watch);
        }
        if self.contact.is_some() {
            self.stage(team, all.clone(), &|contact, body| body.end(contact, watch));
            self.publish_touching(due.publishes, watch);
            all.for_each(|index| self.tell(index, publish));
            if let Some(contact) = self.contact.as_mut().filter(|_| due.publishes) {
                contact.publish_tools(&mut self.bodies, due.time_ns);
            }
        } else {
            // One thread publishes the model of a body before it finishes the next body.
            let together = if team.is_alone() {
                1
            } else {
                self.bodies.len().max(1)
            };
            for first in all.step_by(together) {
                let range = first..self.bodies.len().min(first + together);
                self.stage(team, range.clone(), &|_, body| {
                    body.finish(due.publishes, watch)
                });
                range.for_each(|index| self.tell(index, publish));
            }
        }
        // No hand waits for this.
        for body in &mut self.bodies {
            body.read_ahead();
        }
    }

    /// Makes the models of bodies that may touch: each with the others. A model is also made when bodies begin or cease to touch.
    fn publish_touching(&mut self, publishes: bool, watch: &dyn Stopwatch) {
        let Some(contact) = self.contact.as_mut() else {
            return;
        };
        if !(contact.has_changed() || publishes) {
            return;
        }
        contact.hold(&mut self.bodies);
        for body in &mut self.bodies {
            body.fault = body.see().err();
        }
        for index in 0..self.bodies.len() {
            if self.bodies[index].fault.is_none() {
                let made = contact.publish(&mut self.bodies, index, watch);
                self.bodies[index].fault = made.err();
            }
        }
        for (index, body) in self.bodies.iter_mut().enumerate() {
            if let Some(fault) = body.fault.take() {
                self.stats.fault(index, &fault);
            }
        }
    }

    /// Counts the step of a body, and gives away its model.
    fn tell(&mut self, index: usize, publish: &mut dyn FnMut(usize, &LocalModel)) {
        let body = &self.bodies[index];
        self.stats.add(body.tally());
        if let Some(tears) = body.tears() {
            self.stats.tears[index] = *tears.tearing.report();
        }
        if let Some(model) = body.published() {
            publish(index, model);
        }
    }

    /// Makes one call for the bodies in `range`, beside each other, with the contacts and the number of the body in them.
    fn stage(
        &mut self,
        team: &dyn Team,
        range: Range<usize>,
        call: &(impl Fn(Option<(&Contact, usize)>, &mut HostBody) -> Result<(), StepFault> + Sync),
    ) {
        let contact = self.contact.as_ref();
        each_run(team, &mut self.bodies[range.clone()], 1, &|number, run| {
            for body in run {
                body.fault = call(contact.map(|all| (all, range.start + number)), body).err();
            }
        });
        for index in range {
            if let Some(fault) = self.bodies[index].fault.take() {
                self.stats.fault(index, &fault);
            }
        }
    }

    /// The bodies.
    pub fn bodies(&self) -> &[HostBody] {
        &self.bodies
    }

    /// Times and counts of the steps so far.
    pub fn stats(&self) -> &EngineStats {
        &self.stats
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Scene;
    use crate::world::World;

    #[test]
    fn the_threads_of_an_engine_are_its_own_and_end_with_it() {
        let scene = Scene::embedded_default().expect("a scene");
        let world = World::new(&scene).expect("a world");
        let engine = || {
            let bodies = build::bodies(&world, build::BuildOptions::default());
            Engine::new(bodies.expect("bodies")).on(2)
        };
        let (one, other) = (engine(), engine());
        assert!(!Arc::ptr_eq(&one.threads, &other.threads));
        let threads = Arc::downgrade(&one.threads);
        assert_eq!(threads.strong_count(), 1 + one.bodies.len());
        drop(one);
        assert_eq!(threads.strong_count(), 0);
    }
}
