//! The tears of a sheet: after each step, tears start and tips move on.
//!
//! [`Tearing::advance`] is called after each step of a [`Stepper`]. It compares the energy release rate at each tip with
//! the toughness, or the stress with the strength, by the laws of the room [`tear`](crate::tear). A tip that advances
//! makes an [edit](Body::edit) of the body, by which the tear grows by one edge. The stepper follows the edit, and the
//! sides of the edge let go of each other gradually. The edits of several tips are made in the order of the tips, so
//! that two runs give the same bytes. Nothing is allocated after the construction.
//!
//! - `tips`: the tips, and how they grow. `limit`: how far handles can move before the next tear advances.
//! - `start`: where new tears start. `cost`: the change of the energy by snapping. `grown`: the effect of each edit.

mod cost;
mod grown;
mod limit;
mod start;
mod tips;

pub use grown::Grown;
pub use limit::TearLimit;
pub use tips::{Course, TipState};

use self::start::is_sharp;
use self::tips::Driven;
use super::constraint::cohesion::Cohesion;
use super::stepper::Stepper;
use crate::Vec3;
use crate::body::Body;
use crate::element::precision::Precision;
use crate::error::TearingError;
use crate::tear::strength::Symmetric;
use crate::tear::{Patch, Sheet, TearLaw, TearMaterial};
use crate::topology::{AdvanceOptions, Done, Edit, NONE, Surface};

/// Most tips of a sheet at a time. If there are more, no new tear starts.
pub const MOST_TIPS: usize = 32;
/// Most edges by which a tip advances after one step.
const MOST_EDGES: usize = 4;

/// The largest part of its own energy by which a pair makes good the errors of earlier pairs.
const MOST_SURPLUS: f64 = 0.1;

/// The sum of the squares of the angles between the triangles about a tip (rad²) from which the sheet is torn out of its plane,
/// and the tip paces its pairs: that of one fold of 18 degrees.
const FOLDED: f64 = 0.1;

/// How far an edge that opens may lead off the path, as a fraction of its length (8.6 degrees). The torn area is larger
/// than that of the path by 1 % at most, and cuts near vertices, which leave short edges, are rare.
const OPENING: f64 = 0.15;
/// This angle for the first edge of a tip (2.9 degrees). The direction in which a tear leaves its notch is the one that people
/// compare with the criterion, and no later edge turns it back.
const FIRST_OPENING: f64 = 0.05;
/// This angle in a sheet that is folded at the tip (20 degrees). A cut leaves narrow triangles, across which the same fold is
/// a larger curvature. The energy of this curvature would reach the hands in the next step.
const FOLDED_OPENING: f64 = 0.342;

/// Where tears may start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Starts {
    /// Only tips that exist advance. Stress is not computed.
    #[default]
    Tips,
    /// Tears also start where the stress reaches the strength, and the ends of sharp notches in the mesh are tips.
    Anywhere,
}

/// The options of the tears of a sheet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TearOptions {
    /// The law and its parameters.
    pub material: TearMaterial,
    /// Where tears may start.
    pub starts: Starts,
    /// The largest displacement by which a vertex snaps onto the path, as a fraction of the shortest edge at it: 0
    /// without snapping, at most 0.5.
    pub snapping: f64,
    /// Whether vertices are not compared with the strength in steps in which the energy density of every triangle rules
    /// out a start, see [`cannot_start`](crate::tear::strength::cannot_start). The edits are the same in both cases.
    pub skips: bool,
}

/// The tears so far.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TearReport {
    /// Number of edges that opened.
    pub opened: u64,
    /// Number of edges that were divided for this.
    pub cut: u64,
    /// Number of vertices that snapped.
    pub snapped: u64,
    /// Number of edits by which a piece may have come off.
    pub parted: u64,
    /// Number of tears that started at the strength.
    pub started: u64,
    /// Number of tips at present.
    pub tips: usize,
    /// The torn area (m²): length at rest times thickness.
    pub area: f64,
    /// The energy that the torn area takes (J): the toughness times the area; zero under the law `thesis`.
    pub due: f64,
    /// The part of this energy that no pair takes (J), because tips moved on inside edges, or faces let go at once: it goes
    /// into motion and damping about the tips.
    pub slackened: f64,
    /// The part of the energy of the torn area that pairs have still to take (J).
    pub pending: f64,
    /// The energy that hands and contacts supplied and that the body does not store (J): tears, damping, and what the time steps lose.
    /// Supports that move are not counted.
    pub spent: f64,
    /// The change of energy by edits (J): kinetic energy, energy of the loads, elastic energy.
    pub edits: f64,
    /// The largest flow of energy to a tip, `J`, after the last step (J/m²); 0 without a tip.
    pub driving: f64,
    /// Number of tips that rest because their vertex is held, after the last step.
    pub held: usize,
    /// Number of tips that rest although they are driven, because no edge leads on from them, after the last step.
    pub blocked: usize,
    /// The largest principal stress after the last step (Pa), if it was computed; otherwise 0.
    pub stress: f64,
    /// Whether a tear rests because the reserve of vertices or triangles is used up.
    pub full: bool,
}

/// Whether nothing is in the way of a vertex of a body, by its number, to a place (m).
pub type IsClear<'a> = dyn Fn(&Body, u32, &Vec3) -> bool + 'a;

/// The tears of one sheet.
#[derive(Clone, Debug)]
pub struct Tearing {
    options: TearOptions,
    tips: Vec<TipState>,
    /// The speed of waves `sqrt(E / density)` (m/s).
    wave_speed: f64,
    /// The kinetic, elastic and potential energy of the body at the end of the last step (J); `None` before it.
    energy: Option<f64>,
    patch: Patch,
    /// The stress of each triangle (Pa); empty if no stress is needed.
    stress: Vec<Symmetric>,
    /// Whether each vertex is about a tip; empty if no tear can start.
    near: Vec<bool>,
    /// The driving forces of the tips after the last step.
    driven: Vec<Driven>,
    /// Room for displaced positions (m).
    displaced: Vec<Vec3>,
    report: TearReport,
    /// All edits so far, in their order.
    journal: Vec<Edit>,
    /// The effect of each of them.
    grown: Vec<Grown>,
}

impl Tearing {
    /// The tears of a [tearable](Body::make_tearable) body that begin at `tips`: vertices on a border of its surface. If tears
    /// may start [anywhere](Starts::Anywhere), the ends of sharp notches in the mesh become tips as well.
    ///
    /// # Errors
    ///
    /// [`TearingError::Kind`] for a body that is not tearable, [`TearingError::Tip`] for a tip that is no border vertex,
    /// [`TearingError::Law`] for parameters out of range.
    pub fn new(body: &Body, options: TearOptions, tips: &[u32]) -> Result<Self, TearingError> {
        let Some(surface) = body.surface() else {
            return Err(TearingError::Kind {
                found: "no surface that can tear",
            });
        };
        options.material.check()?;
        if let Some(&vertex) = tips.iter().find(|&&tip| !surface.on_border(tip)) {
            return Err(TearingError::Tip { vertex });
        }
        let limits = surface.limits();
        let starts = options.starts == Starts::Anywhere;
        let sharp = (0..surface.vertex_count() as u32)
            .filter(|vertex| starts && is_sharp(body, surface, *vertex) && !tips.contains(vertex));
        let mut all = Vec::with_capacity(MOST_TIPS.max(tips.len()));
        all.extend(tips.iter().copied().chain(sharp).map(TipState::new));
        let vertices = if starts { limits.vertices } else { 0 };
        let by_stress = starts || options.material.law == TearLaw::Thesis;
        let triangles = if by_stress { limits.triangles } else { 0 };
        Ok(Self {
            options,
            wave_speed: libm::sqrt(
                options.material.young / density(body, surface, options.material.thickness),
            ),
            energy: None,
            patch: Patch::new(limits.vertices, limits.triangles),
            stress: vec![[0.0; 3]; triangles],
            near: vec![false; vertices],
            driven: Vec::with_capacity(MOST_EDGES * MOST_TIPS.max(all.len())),
            displaced: Vec::with_capacity(limits.vertices),
            report: TearReport {
                tips: all.len(),
                ..TearReport::default()
            },
            tips: all,
            // Every edit adds a vertex.
            journal: Vec::with_capacity(limits.vertices - surface.vertex_count()),
            grown: Vec::with_capacity(limits.vertices - surface.vertex_count()),
        })
    }

    /// The tears of `body`, which has replaced the body of these tears. `vertices` names the vertex that each of its vertices
    /// continues. A tear goes on at the vertex of the border that continues its tip, if there is one. The law and the sums
    /// stay; of the energy that pairs had still to take, and of the change of the energy of the body, the report tells.
    ///
    /// # Errors
    ///
    /// As [`new`](Self::new).
    pub fn continued(&self, body: &Body, vertices: &[u32]) -> Result<Self, TearingError> {
        let tips = self.tips.iter().filter_map(|tip| {
            let surface = body.surface()?;
            let all = (0_u32..).zip(vertices);
            let same =
                all.filter(|(vertex, from)| **from == tip.vertex && surface.on_border(*vertex));
            let angle = |vertex: u32| surface.total_angle(vertex);
            let widest = same.max_by(|(a, _), (b, _)| angle(*a).total_cmp(&angle(*b)));
            widest.map(|(vertex, _)| vertex)
        });
        let mut next = Self::new(body, self.options, &tips.collect::<Vec<_>>())?;
        next.journal
            .reserve(self.journal.len() + next.journal.capacity());
        next.journal.extend_from_slice(&self.journal);
        next.grown.reserve(self.grown.len() + next.grown.capacity());
        next.grown.extend_from_slice(&self.grown);
        next.energy = self.energy.map(|before| {
            let now = body.elastic_energy() + body.kinetic_energy() + body.load_potential();
            next.report.edits = now - before;
            now
        });
        next.report = TearReport {
            tips: next.report.tips,
            edits: self.report.edits + next.report.edits,
            slackened: self.report.slackened + self.report.pending,
            pending: 0.0,
            full: false,
            ..self.report
        };
        Ok(next)
    }

    /// Follows a step of `stepper` after which no tear grows. Returns what tore so far.
    pub fn rest<T: Precision>(&mut self, body: &Body, stepper: &mut Stepper<T>) -> &TearReport {
        self.follow(body, stepper);
        self.report.slackened += stepper.take_lost();
        self.report.pending = stepper.pending();
        (self.report.driving, self.report.stress) = (0.0, 0.0);
        (self.report.held, self.report.blocked) = (0, 0);
        &self.report
    }

    /// Lets the tears grow after a step of `stepper`. Returns what tore so far.
    pub fn advance<T: Precision>(
        &mut self,
        body: &mut Body,
        stepper: &mut Stepper<T>,
    ) -> &TearReport {
        self.advance_among(body, stepper, &|_, _, _| true)
    }

    /// As [`advance`](Self::advance), for a body that touches others: a vertex snaps only if its way `is_clear`.
    #[inline(never)]
    pub fn advance_among<T: Precision>(
        &mut self,
        body: &mut Body,
        stepper: &mut Stepper<T>,
        is_clear: &IsClear<'_>,
    ) -> &TearReport {
        self.rest(body, stepper);
        match self.options.material.law {
            TearLaw::Toughness => self.advance_by_energy(body, stepper, is_clear),
            TearLaw::Thesis => self.advance_by_stress(body, stepper, is_clear),
        }
        if self.options.starts == Starts::Anywhere {
            self.start(body, stepper, is_clear);
        }
        self.report.tips = self.tips.len();
        self.report.slackened += stepper.take_lost();
        self.report.pending = stepper.pending();
        &self.report
    }

    /// Begins the balance of energy again at the end of the next step, for a body whose state or material was exchanged: the
    /// same shape stores another energy, which no hand supplied.
    pub fn begin_balance(&mut self) {
        self.energy = None;
    }

    /// Takes the work (J) of contacts on the body in a step into the balance of energy.
    pub fn push(&mut self, work: f64) {
        self.report.spent += work;
    }

    /// Follows the balance of energy of the body over a step. The power of a hand is that at the end of the step.
    fn follow<T: Precision>(&mut self, body: &Body, stepper: &Stepper<T>) {
        let reports = (0..).map_while(|handle| body.handle_report(handle));
        let power = reports.map(|report| {
            report.reaction.force.dot(&report.linear_velocity)
                + report.reaction.moment.dot(&report.angular_velocity)
        });
        let work = power.sum::<f64>() * stepper.step_length();
        let now = stepper.elastic_energy() + body.kinetic_energy() + body.load_potential();
        if let Some(before) = self.energy.replace(now) {
            self.report.spent += work - (now - before);
        }
    }

    /// The tears so far.
    pub fn report(&self) -> &TearReport {
        &self.report
    }

    /// All edits so far, in their order. A copy of the body that has fallen behind makes the last of them to catch up.
    pub fn journal(&self) -> &[Edit] {
        &self.journal
    }

    /// The options.
    pub fn options(&self) -> &TearOptions {
        &self.options
    }

    /// The present tips.
    pub fn tips(&self) -> &[TipState] {
        &self.tips
    }

    /// The snapping of the options, or none, and how far an edge that opens may lead off the path.
    fn advance_options(&self, snaps: bool, opening: f64) -> AdvanceOptions {
        AdvanceOptions {
            snapping: if snaps { self.options.snapping } else { 0.0 },
            opening,
        }
    }

    /// Whether `vertex` is a tip.
    fn is_tip(&self, vertex: u32) -> bool {
        self.tips.iter().any(|tip| tip.vertex == vertex)
    }

    /// Makes an edit, lets the stepper follow, and ties the sides of the new edges. Returns whether the edit was made.
    fn make<T: Precision>(
        &mut self,
        body: &mut Body,
        stepper: &mut Stepper<T>,
        edit: &Edit,
    ) -> Option<[TipState; 2]> {
        let done = match body.edit(edit) {
            Ok(done) => done,
            Err(error) => {
                self.report.full |= error.is_full();
                return None;
            }
        };
        self.journal.push(*edit);
        // A stepper that cannot follow makes itself again in its next step.
        let elastic = match stepper.grow(body, &done.surface) {
            Ok(()) => stepper.settle(body),
            Err(_) => 0.0,
        };
        let report = &mut self.report;
        report.edits += done.kinetic + done.potential + elastic;
        report.parted += u64::from(done.surface.parted);
        report.snapped += done.surface.moved.iter().flatten().count() as u64;
        if let Some(surface) = body.surface() {
            report.cut += surface.divided().len().div_ceil(2) as u64;
        }
        let material = &self.options.material;
        let mut ends = [TipState::new(NONE); 2];
        let length: f64 = done
            .surface
            .opened
            .iter()
            .flatten()
            .map(|opened| opened.length)
            .sum();
        report.opened += done.surface.opened.iter().flatten().count() as u64;
        report.area += length * material.thickness;
        let energy = match material.law {
            TearLaw::Toughness => length * material.thickness * material.toughness,
            TearLaw::Thesis => 0.0,
        };
        report.due += energy;
        self.note(edit.tip, &done.surface, length, energy);
        let pair = self.tie(body, stepper, &done.surface, length);
        for (end, &vertex) in ends.iter_mut().zip(&done.surface.tips) {
            *end = TipState {
                pair,
                edge: length,
                ..TipState::new(vertex)
            };
        }
        // Another tear whose tip was met has ended.
        for met in done.surface.met {
            self.tips.retain(|tip| tip.vertex != met);
        }
        Some(ends)
    }
}

impl Tearing {
    /// Ties the sides of new edges of this `length` (m), so that they let go of each other gradually. Returns a pair to
    /// wait for, if there is one.
    fn tie<T: Precision>(
        &mut self,
        body: &Body,
        stepper: &mut Stepper<T>,
        done: &Done,
        length: f64,
    ) -> Option<[u32; 2]> {
        let material = &self.options.material;
        if material.law == TearLaw::Thesis {
            return None;
        }
        // Vertices that were doubled share the energy of the edges. In most edits there is only one, the old tip. The
        // errors of earlier pairs are made good, by a small part at a time: they change the force that tears.
        let twins = done.vertices.clone();
        let twins = twins.filter_map(|vertex| body.twin_of(vertex).map(|of| [of, vertex]));
        let due = material.toughness * material.thickness * length;
        let energy = due + stepper.take_surplus(MOST_SURPLUS * due, due);
        let count = twins.clone().count();
        let share = 1.0 / count.max(1) as f64;
        let (mut left, energy, length) = (energy, energy * share, length * share);
        let is_folded = self.patch.folding() > FOLDED;
        let mut first = None;
        for nodes in twins {
            let force = stepper.force_between(body, nodes);
            let Some(mut pair) = Cohesion::new(nodes, &force, energy) else {
                continue;
            };
            if is_folded {
                pair = pair.paced(length);
            }
            if stepper.add_pair(pair) {
                first = first.or(Some(nodes));
                left -= energy;
            }
        }
        // Faces without a force between them, and those for whose pair there is no room, let go at once.
        self.report.slackened += left;
        first
    }
}

/// The mean density of a sheet of this `thickness` (kg/m³).
fn density(body: &Body, surface: &Surface, thickness: f64) -> f64 {
    let areas = (0..surface.triangle_count() as u32).map(|triangle| surface.area(triangle));
    body.total_mass() / (areas.sum::<f64>() * thickness)
}

/// The surface as the room `tear` takes it.
fn sheet(surface: &Surface) -> Sheet<'_> {
    Sheet {
        triangles: surface.triangles(),
        neighbours: surface.neighbours(),
        shapes: surface.shapes(),
    }
}
