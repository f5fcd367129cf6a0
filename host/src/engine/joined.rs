//! Bodies that are joined: each step solves them together, and every other body by itself.

use super::body::HostBody;
use super::stats::Stopwatch;
use physics::motion::joined::{Joints, Workspace, solve};
use physics::{BodyMap, Equation};
use rt_core::MAX_BODIES;

/// Joined bodies, and what joins them.
pub(super) struct Group {
    /// The numbers of the bodies, in ascending order.
    bodies: Vec<usize>,
    joints: Box<dyn Joints>,
    room: Workspace,
}

impl Group {
    /// The group of the `bodies` with these numbers, which are in ascending order.
    pub(super) fn new(bodies: Vec<usize>, joints: Box<dyn Joints>) -> Self {
        Self {
            bodies,
            joints,
            room: Workspace::default(),
        }
    }

    /// The bodies of the group.
    fn members<'a>(&self, bodies: &'a mut [HostBody]) -> impl Iterator<Item = &'a mut HostBody> {
        let numbered = bodies.iter_mut().enumerate();
        numbered.filter_map(|(number, body)| self.bodies.contains(&number).then_some(body))
    }

    /// Follows a body whose mesh has been replaced. Returns whether its joints hold on, if it has any.
    pub(super) fn follow(&mut self, body: usize, map: &BodyMap) -> bool {
        let number = self.bodies.iter().position(|member| *member == body);
        number.is_none_or(|number| self.joints.follow(number, map))
    }

    /// Wakes the bodies that sleep. Called before they are constrained.
    pub(super) fn wake(&self, bodies: &mut [HostBody]) {
        self.members(bodies)
            .for_each(|body| body.stepping.solver.wake());
    }

    /// Solves the bodies together. A body of which a stage has failed keeps its state, and the others feel it as held. The
    /// solution ends with the time that the first of the bodies to run out of it may take.
    pub(super) fn solve(&mut self, bodies: &mut [HostBody], watch: &dyn Stopwatch) {
        let start = watch.now_ns();
        for (number, &member) in self.bodies.iter().enumerate() {
            if let Some(body) = bodies.get(member) {
                let stepping = &body.stepping;
                self.joints.begin(number, &stepping.body, stepping.step);
            }
        }
        let left = self
            .members(bodies)
            .filter_map(|body| body.stepping.solver.left_ns());
        let end = left.min().map(|left| start + left);
        let mut lent: [Option<Equation<'_, f64>>; MAX_BODIES] = [const { None }; MAX_BODIES];
        for (lent, body) in lent.iter_mut().zip(self.members(bodies)) {
            *lent = body.stepping.equation();
        }
        let lent = &mut lent[..self.bodies.len().min(MAX_BODIES)];
        let is_late = || end.is_some_and(|end| watch.now_ns() >= end);
        solve(lent, &*self.joints, &mut self.room, is_late);
        let time = watch.now_ns().saturating_sub(start);
        self.members(bodies)
            .for_each(|body| body.stepping.solved_in(time));
    }
}
