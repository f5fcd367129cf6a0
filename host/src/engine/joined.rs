//! Bodies that are joined: each step solves them together, and every other body by itself.

use super::body::HostBody;
use super::stats::Stopwatch;
use physics::Equation;
use physics::motion::joined::{Joints, solve};

/// Joined bodies, and what joins them.
pub(super) struct Group {
    /// The numbers of the bodies, in ascending order.
    bodies: Vec<usize>,
    joints: Box<dyn Joints>,
}

impl Group {
    /// The group of the `bodies` with these numbers, which are in ascending order.
    pub(super) fn new(bodies: Vec<usize>, joints: Box<dyn Joints>) -> Self {
        Self { bodies, joints }
    }

    /// The bodies of the group.
    fn members<'a>(&self, bodies: &'a mut [HostBody]) -> impl Iterator<Item = &'a mut HostBody> {
        let numbered = bodies.iter_mut().enumerate();
        numbered.filter_map(|(number, body)| self.bodies.contains(&number).then_some(body))
    }

    /// Wakes the bodies that sleep. Called before they are constrained.
    pub(super) fn wake(&self, bodies: &mut [HostBody]) {
        self.members(bodies)
            .for_each(|body| body.stepping.solver.wake());
    }

    /// Solves the bodies together. If a stage of one of them has failed, none is solved, and each keeps its state.
    pub(super) fn solve(&mut self, bodies: &mut [HostBody], watch: &dyn Stopwatch) {
        let start = watch.now_ns();
        for (number, &member) in self.bodies.iter().enumerate() {
            if let Some(body) = bodies.get(member) {
                let stepping = &body.stepping;
                self.joints.begin(number, &stepping.body, stepping.step);
            }
        }
        let lent = self.members(bodies).map(|body| body.stepping.equation());
        let lent: Option<Vec<Equation<'_, f64>>> = lent.collect();
        if let Some(lent) = lent {
            solve(lent, &*self.joints, || false);
        }
        let time = watch.now_ns().saturating_sub(start);
        self.members(bodies)
            .for_each(|body| body.stepping.solved_in(time));
    }
}
