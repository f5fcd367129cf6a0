//! Bodies in contact, solved together: Newton passes over the rows of the contacts.
//!
//! The residual of a step is `r(u) = f - A u + sum J^T F(J u)`, with the force `F` of each row (`contact::row`). A pass
//! solves `(A + sum J^T D J) du = r` by conjugate gradients, with the tangent `D` of each row and the factor of each body
//! for itself as preconditioner. With the friction forces held at the cone of the pass's start, the residual is the gradient
//! of a convex function, so its product with `du` falls monotonically along `du`. If it changes sign within the pass, a line
//! search finds where it is zero (false position; Nocedal and Wright, "Numerical optimization", 2006, chapter 3). Without the
//! line search, friction cycles.
//!
//! Where contacts wedge a body, a larger friction force lowers the normal force that bounds it, and more. The bounds would swing
//! further with each pass. So a pass takes a fraction of the change of the bounds, which the last two changes tell (`relaxed`).

use super::joined::{At, Workspace, at, iterate};
use super::joint_equation::JointEquation;
use crate::contact::Contact;
use crate::contact::row::{Response, Row};
use crate::{Mat3, Vec3};

/// Most updates of the multipliers in a step.
const MOST_UPDATES: usize = 10;
/// A contact that is too deep becomes this many times as stiff as the bodies were against the last change of its force. One more
/// update leaves a ninth of the depth.
const STIFFER: f64 = 8.0;
/// The least change of a gap that tells how stiff the bodies are, as a fraction of the depth that the contact may have.
const RESOLVED: f64 = 1e-5;
/// Most passes of a step, for each update of the multipliers.
const PASSES: usize = 12;
/// The iterations of a pass end at this fraction of its residual.
const ACCURACY: f64 = 1e-1;
/// A pass is searched if its end overshoots by this fraction of its start.
const OVERSHOT: f64 = 0.1;
/// The least fraction of a change of friction's bounds that is taken.
const LEAST_RELAXATION: f64 = 0.2;
/// Most evaluations of the rows in a line search.
const EVALUATIONS: usize = 12;

/// The nodes of a contact of a step: those of a vertex and a triangle, or of two edges.
pub type Four = [(At, f64); 4];

/// A contact of a step, or of an equilibrium, where it may have more nodes.
#[derive(Clone, Debug, PartialEq)]
pub struct Touch<N = Four> {
    /// The nodes, and their weights; those of the first foot sum to one. A weight of zero has no node.
    pub nodes: N,
    /// The law.
    pub row: Row,
    /// The response at the end of the solve.
    pub response: Response,
    /// The stiffness along the normal that the contact took within the solve (N/m); zero if it took none, or if there was no
    /// solution.
    pub stiffened: f64,
    /// The response before the last update of the multiplier.
    before: Response,
    /// The largest friction force in a pass (N).
    bound: f64,
    /// The friction cone's largest force less the bound, before the last change of the bound (N).
    more: f64,
    pass: Pass,
}

/// The state of a contact in a pass.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Pass {
    /// The displacement of the first foot against the second one at the start of the pass, and at its end (m).
    start: Vec3,
    end: Vec3,
    /// The tangent (N/m) and the force (N) at the start.
    tangent: Mat3,
    force: Vec3,
}

impl<N: AsRef<[(At, f64)]>> Touch<N> {
    /// A contact between nodes.
    pub fn new(nodes: N, row: Row) -> Self {
        let response = row.response(&Vec3::zeros());
        Self {
            nodes,
            response,
            stiffened: 0.0,
            before: response,
            bound: row.most_friction(response.normal),
            more: 0.0,
            row,
            pass: Pass {
                start: Vec3::zeros(),
                end: Vec3::zeros(),
                tangent: Mat3::zeros(),
                force: Vec3::zeros(),
            },
        }
    }

    /// The force on the first foot (N) at the end of the solve. The second one has the opposite force.
    pub fn force(&self) -> Vec3 {
        self.row.normal * self.response.normal + self.response.friction
    }

    /// The displacement of the first foot against the second one (m) at the end of the solve.
    pub fn moved(&self) -> &Vec3 {
        &self.pass.start
    }

    /// The displacement of the first foot against the second one (m), for displacements `of` nodes.
    pub fn difference(&self, of: &dyn Fn(At) -> Vec3) -> Vec3 {
        let nodes = self.nodes.as_ref().iter();
        let nodes = nodes.filter(|(_, weight)| *weight != 0.0);
        nodes.map(|(at, weight)| of(*at) * *weight).sum()
    }

    /// Responds to the displacement at the start of the pass, with friction bounded by its cone.
    fn respond(&mut self) {
        self.response = self.row.response(&self.pass.start);
        self.bound = self.row.most_friction(self.response.normal);
    }

    /// Takes the stiffness that the force needs at the depth that the contact may have, or that the bodies behind the contact need,
    /// whichever is larger. The masses of the vertices do not tell the stiffness of the bodies.
    fn stiffen(&mut self) {
        let Response { normal, gap, .. } = self.response;
        let needed = self.row.carried.abs() / self.row.depth;
        let [more, wider] = [normal - self.before.normal, gap - self.before.gap];
        let is_resolved = more > 0.0 && wider > RESOLVED * self.row.depth;
        let of_bodies = if is_resolved { more / wider } else { 0.0 };
        let stiffness = needed.max(STIFFER * of_bodies);
        if stiffness > self.row.normal_stiffness {
            self.row.normal_stiffness = stiffness;
            self.stiffened = stiffness;
        }
    }

    /// Takes another direction and gap (m), which hold better at the present displacement. The multiplier is carried on.
    pub(super) fn look_again(&mut self, normal: Vec3, gap: f64) {
        self.row = Row {
            normal,
            gap,
            carried: self.response.normal,
            ..self.row
        };
    }

    pub(super) fn add(&self, force: &Vec3, add: &mut dyn FnMut(At, Vec3)) {
        let nodes = self.nodes.as_ref().iter();
        for (at, weight) in nodes.filter(|(_, weight)| *weight != 0.0) {
            add(*at, force * *weight);
        }
    }
}

/// Fills `touches` with the contacts of a step. `at` gives the node of a vertex of the surfaces; a vertex whose motion is
/// prescribed has none.
pub fn fill(touches: &mut Vec<Touch>, contacts: &[Contact], at: &dyn Fn(u32) -> Option<At>) {
    const NONE: (At, f64) = (At { body: 0, node: 0 }, 0.0);
    touches.clear();
    touches.extend(contacts.iter().map(|contact| {
        let mut each = contact.vertices.into_iter().zip(contact.weights);
        let nodes = [(); 4].map(|()| {
            let (vertex, weight) = each.next()?;
            (weight != 0.0).then_some((at(vertex)?, weight))
        });
        Touch::new(nodes.map(|node| node.unwrap_or(NONE)), contact.row)
    }));
}

/// What a solve did.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TouchReport {
    /// Passes.
    pub passes: usize,
    /// Iterations of conjugate gradients over all passes.
    pub iterations: usize,
    /// Passes that were searched.
    pub searched: usize,
    /// Whether the residual is small.
    pub converged: bool,
    /// The residual, as a fraction of the forces of the contacts (1).
    pub left: f64,
}

/// Adds forces (N) to the residuals of the bodies.
fn load<E: JointEquation, N: AsRef<[(At, f64)]>>(
    bodies: &mut [Option<E>],
    touch: &Touch<N>,
    force: &Vec3,
) {
    touch.add(force, &mut |at, force| {
        if let Some(body) = &mut bodies[at.body] {
            body.load(at.node, &force);
        }
    });
}

/// Solves the equations of bodies with their contacts. Each of the `updates` carries the multipliers on once more within the
/// step. Further updates follow while the passes solve the step and a contact is too deep and has not its largest force; such a
/// contact becomes stiffer. `out_of_time` is called after each iteration; if it returns true, the step continues with the solution
/// so far.
pub fn solve<E: JointEquation, N: AsRef<[(At, f64)]>>(
    bodies: &mut [Option<E>],
    touches: &mut [Touch<N>],
    updates: usize,
    room: &mut Workspace,
    out_of_time: &mut dyn FnMut() -> bool,
) -> TouchReport {
    begin(bodies);
    let report = approach(bodies, touches, updates, room, out_of_time);
    end(bodies, touches, room, &report);
    report
}

/// Begins to solve bodies: takes the pairs of tears into their equations.
pub(super) fn begin<E: JointEquation>(bodies: &mut [Option<E>]) {
    bodies.iter_mut().flatten().for_each(E::hold_pairs);
}

/// Solves from the present displacements, whose residuals have no forces of these contacts. May be called again after
/// [`unload`], for other contacts.
pub(super) fn approach<E: JointEquation, N: AsRef<[(At, f64)]>>(
    bodies: &mut [Option<E>],
    touches: &mut [Touch<N>],
    updates: usize,
    room: &mut Workspace,
    out_of_time: &mut dyn FnMut() -> bool,
) -> TouchReport {
    let mut report = TouchReport::default();
    for touch in &mut *touches {
        let ju = touch.difference(&|node| at(bodies, node, E::displacement));
        touch.pass.start = ju;
        touch.respond();
        load(bodies, touch, &touch.force());
    }
    let is_deep = |touch: &Touch<N>| {
        let Touch { row, response, .. } = touch;
        let depth = if row.is_held {
            response.gap.abs()
        } else {
            -response.gap
        };
        row.depth > 0.0 && depth > row.depth && !row.is_at_most(response)
    };
    let mut is_solved = false;
    for update in 0..=MOST_UPDATES {
        if update > 0 {
            // Further updates of what has not been solved bring larger forces, and no solution.
            if update > updates && !(is_solved && touches.iter().any(is_deep)) {
                break;
            }
            for touch in &mut *touches {
                let before = touch.force();
                touch.row.carried = touch.response.normal;
                if update > updates && is_deep(touch) {
                    touch.stiffen();
                }
                touch.before = touch.response;
                touch.respond();
                load(bodies, touch, &(touch.force() - before));
            }
        }
        let mut relaxation = 1.0;
        for number in 0..=PASSES {
            let mut left = 0.0;
            if number > 0 {
                pass(bodies, touches, room, &mut report, out_of_time);
                relaxation = relaxed(touches, relaxation, number);
                left = bound(bodies, touches, relaxation);
            }
            bodies.iter_mut().flatten().for_each(E::let_go);
            weigh(bodies, touches, room);
            is_solved = room.is_solved(bodies) && left <= least_goal(bodies, room);
            if is_solved {
                break;
            }
        }
    }
    report.converged = is_solved;
    if !is_solved {
        bound(bodies, touches, 1.0);
        weigh(bodies, touches, room);
        // Without a solution, the stiffness may come from rows against each other.
        for touch in &mut *touches {
            touch.stiffened = 0.0;
        }
    }
    let sum = |of: &[f64]| of.iter().map(|one| one * one).sum::<f64>().sqrt();
    let loads = sum(&room.loads);
    report.left = if loads > 0.0 {
        sum(&room.left) / loads
    } else {
        0.0
    };
    report
}

/// Takes the forces of contacts out of the residuals.
pub(super) fn unload<E: JointEquation, N: AsRef<[(At, f64)]>>(
    bodies: &mut [Option<E>],
    touches: &[Touch<N>],
) {
    for touch in touches {
        load(bodies, touch, &-touch.force());
    }
}

/// Ends the solve.
pub(super) fn end<E: JointEquation, N: AsRef<[(At, f64)]>>(
    bodies: &mut [Option<E>],
    touches: &[Touch<N>],
    room: &mut Workspace,
    report: &TouchReport,
) {
    room.forces.clear();
    for touch in touches {
        touch.add(&touch.force(), &mut |at, force| {
            room.forces.push((at, force));
        });
    }
    let each = bodies.iter_mut().zip(room.left.iter().zip(&room.loads));
    for (number, (body, (left, load))) in each.enumerate() {
        if let Some(body) = body {
            let own = room.forces.iter().filter(|(at, _)| at.body == number);
            let mut own = own.map(|(at, force)| (at.node, *force));
            body.solved(&mut own, *load, report.iterations, *left);
        }
    }
}

/// The fraction of the changes of friction's bounds that is taken in the pass of this `number` (Irons and Tuck, "A version of the Aitken accelerator for
/// computer iteration", 1969).
fn relaxed<N>(touches: &[Touch<N>], relaxation: f64, number: usize) -> f64 {
    if number == 1 {
        return 1.0;
    }
    let mut sums = [0.0; 2];
    for touch in touches {
        let more = touch.row.most_friction(touch.response.normal) - touch.bound;
        let by = more - touch.more;
        sums = [sums[0] + touch.more * by, sums[1] + by * by];
    }
    let next = -relaxation * sums[0] / sums[1];
    if next.is_finite() {
        next.clamp(LEAST_RELAXATION, 1.0)
    } else {
        1.0
    }
}

/// Moves the bounds of friction towards the cones. Returns what is left (N).
fn bound<E: JointEquation, N: AsRef<[(At, f64)]>>(
    bodies: &mut [Option<E>],
    touches: &mut [Touch<N>],
    relaxation: f64,
) -> f64 {
    let mut left = 0.0_f64;
    for touch in touches {
        let cone = touch.row.most_friction(touch.response.normal);
        touch.more = cone - touch.bound;
        touch.bound += relaxation * touch.more;
        left = left.hypot(cone - touch.bound);
        let before = touch.force();
        touch.response = touch.row.response_within(&touch.pass.start, touch.bound);
        load(bodies, touch, &(touch.force() - before));
    }
    left
}

/// Computes the norms of the residuals and of the forces of the contacts.
fn weigh<E: JointEquation, N: AsRef<[(At, f64)]>>(
    bodies: &mut [Option<E>],
    touches: &[Touch<N>],
    room: &mut Workspace,
) {
    room.left.clear();
    let residuals = bodies.iter_mut();
    room.left
        .extend(residuals.map(|body| body.as_mut().map_or(0.0, E::residual)));
    room.loads.clear();
    room.loads.resize(bodies.len(), 0.0);
    for touch in touches {
        touch.add(&touch.force(), &mut |at, force| {
            room.loads[at.body] = room.loads[at.body].hypot(force.norm());
        });
    }
}

/// The least residual (N) at which a body is solved.
fn least_goal<E: JointEquation>(bodies: &[Option<E>], room: &Workspace) -> f64 {
    let each = bodies.iter().zip(&room.loads);
    let each = each.filter_map(|(body, load)| Some(body.as_ref()?.goal(*load)));
    each.fold(f64::INFINITY, f64::min)
}

/// One pass from the present displacement, whose residual includes the forces of the contacts there.
fn pass<E: JointEquation, N: AsRef<[(At, f64)]>>(
    bodies: &mut [Option<E>],
    touches: &mut [Touch<N>],
    room: &mut Workspace,
    report: &mut TouchReport,
    out_of_time: &mut dyn FnMut() -> bool,
) {
    for touch in &mut *touches {
        touch.pass.tangent = touch.row.tangent(&touch.response);
        touch.pass.force = touch.force();
    }
    bodies.iter_mut().flatten().for_each(E::mark);
    let sum = |left: &[f64]| left.iter().map(|left| left * left).sum::<f64>().sqrt();
    let goal = (0.5 * least_goal(bodies, room)).max(ACCURACY * sum(&room.left));
    let shared: &[Touch<N>] = touches;
    report.passes += 1;
    report.iterations += iterate(
        bodies,
        room,
        &|of, add| {
            for touch in shared {
                // A contact that is open adds nothing.
                if touch.row.is_held || touch.response.acts() {
                    touch.add(&(touch.pass.tangent * touch.difference(of)), add);
                }
            }
        },
        |_, room| sum(&room.left) <= goal,
        out_of_time,
    );
    // Along the pass, the product of the residual with the displacement of the pass.
    let mut linear = [0.0; 2];
    for body in bodies.iter().flatten() {
        let [start, end] = body.along();
        linear = [linear[0] + start, linear[1] + end];
    }
    for touch in &mut *touches {
        touch.pass.end = touch.difference(&|node| at(bodies, node, E::displacement));
    }
    let along = |a: f64| {
        let mut sum = (1.0 - a) * linear[0] + a * linear[1];
        for Touch {
            row, bound, pass, ..
        } in &*touches
        {
            let by = pass.end - pass.start;
            let found = row.force_with(&(pass.start + by * a), *bound);
            sum += (found - (pass.force - pass.tangent * by * a)).dot(&by);
        }
        sum
    };
    let (start, end) = (linear[0], along(1.0));
    let fraction = if end < -OVERSHOT * start {
        report.searched += 1;
        zero(start, end, &along)
    } else {
        1.0
    };
    if fraction < 1.0 {
        for body in bodies.iter_mut().flatten() {
            body.back(fraction);
        }
    }
    for touch in touches {
        let by = (touch.pass.end - touch.pass.start) * fraction;
        let linear = touch.pass.force - touch.pass.tangent * by;
        touch.pass.start += by;
        touch.response = touch.row.response_within(&touch.pass.start, touch.bound);
        load(bodies, touch, &(touch.force() - linear));
    }
}

/// Where, from 0 to 1, a falling function is zero whose values at the ends are `start` and `end`.
fn zero(start: f64, end: f64, along: &dyn Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = ((0.0, start), (1.0, end));
    for _ in 0..EVALUATIONS {
        let width = high.0 - low.0;
        let guess = low.0 + width * low.1 / (low.1 - high.1);
        // The function may be flat at one end, from which false position would not come away.
        let a = guess.clamp(low.0 + 0.1 * width, high.0 - 0.1 * width);
        let value = along(a);
        if value.abs() <= OVERSHOT * start {
            return a;
        }
        if value > 0.0 {
            low = (a, value);
        } else {
            high = (a, value);
        }
    }
    0.5 * (low.0 + high.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::stepper::Equation;

    /// The bound of friction after some passes of a contact that is wedged: its normal force falls by `fall` times the bound.
    fn settled(fall: f64, relaxes: bool) -> f64 {
        let row = Row {
            normal: Vec3::z(),
            gap: 0.0,
            motion: Vec3::zeros(),
            friction: 0.5,
            depth: 0.0,
            normal_stiffness: 100.0,
            friction_stiffness: 100.0,
            carried: 2.0,
            most: f64::INFINITY,
            anchored: Vec3::x() * 9.0,
            is_held: false,
        };
        let mut touches = [Touch::new([], row)];
        let mut relaxation = 1.0;
        for number in 1..=PASSES {
            let [touch] = &mut touches;
            touch.pass.start = Vec3::z() * (fall * touch.bound / row.normal_stiffness);
            touch.response = row.response_within(&touch.pass.start, touch.bound);
            if relaxes {
                relaxation = relaxed(&touches, relaxation, number);
            }
            bound::<Equation<'_, f64>, _>(&mut [], &mut touches, relaxation);
        }
        touches[0].bound
    }

    #[test]
    fn the_bound_of_friction_settles_in_a_wedge() {
        for fall in [0.5, 1.0, 2.6, 4.0] {
            let exact = 0.5 * 2.0 / (1.0 + 0.5 * fall);
            assert!((settled(fall, true) - exact).abs() < 1e-9, "{fall}");
        }
        // Without a fraction, it swings between nothing and the cone.
        assert!((settled(2.6, false) - 1.0 / 2.3).abs() > 0.3);
    }
}
