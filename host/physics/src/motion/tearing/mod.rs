//! The tears of a sheet: after each step, tears start and tips move on.
//!
//! [`Tearing::advance`] is called after each step of a [`Stepper`]. It compares the energy release rate at each tip with
//! the toughness, or the stress with the strength, by the laws of the room [`tear`](crate::tear). A tip that goes on makes
//! an [edit](Body::edit) of the body, by which the tear grows by one edge. The stepper follows the edit, and the sides of
//! the edge let go of each other gradually. The edits of several tips are made in the order of the tips, so that two runs
//! give the same bytes. Nothing is allocated after the construction.
//!
//! - `tips`: the tips, and how they grow. `limit`: how far handles can move until then.
//! - `start`: where new tears start. `cost`: what snapping would cost. `grown`: what each edit did.

mod cost;
mod grown;
mod limit;
mod start;
mod tips;

pub use grown::Grown;
pub use limit::TearLimit;
pub use tips::{Course, TipState};

use self::start::is_sharp;
use super::stepper::{Pair, Stepper};
use crate::Vec3;
use crate::body::Body;
use crate::element::precision::Precision;
use crate::error::TearingError;
use crate::tear::strength::Symmetric;
use crate::tear::{Patch, Sheet, TearLaw, TearMaterial};
use crate::topology::{AdvanceOptions, Done, Edit, NONE, Surface};

/// Most tips of a sheet at a time. Where there are more, no new tear starts.
pub const MOST_TIPS: usize = 32;
/// Most edges by which a tip goes on after one step.
const MOST_EDGES: usize = 4;

/// The largest factor by which a pair's first force is larger than the present force. A force that falls linearly from
/// twice the present force has the present force as its mean.
const MOST_STRONGER: f64 = 2.0;

/// The largest opening at which a pair out of the plane has let go, in lengths of its edge. With 2, the sides of
/// trousers without stiffness against bending hold on until the legs have stretched, and the force is 20 % larger.
const WIDEST: f64 = 4.0 / 3.0;

/// How far an edge that opens may lead off the path, as a fraction of its length (8.6 degrees). The torn area is larger
/// than that of the path by 1 % at most, and cuts near vertices, which leave short edges, are rare.
const OPENING: f64 = 0.15;

/// Where tears may start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Starts {
    /// Only tips that exist go on. Stress is not computed.
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

/// What tore so far.
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
    /// The change of energy by edits (J): kinetic energy, energy of the loads, elastic energy.
    pub edits: f64,
    /// The largest energy release rate of a tip after the last step (J/m²); 0 without a tip.
    pub driving: f64,
    /// The largest principal stress after the last step (Pa), where it was computed; otherwise 0.
    pub stress: f64,
    /// Whether a tear rests because the reserve of vertices or triangles is used up.
    pub full: bool,
}

/// The tears of one sheet.
#[derive(Clone, Debug)]
pub struct Tearing {
    options: TearOptions,
    tips: Vec<TipState>,
    patch: Patch,
    /// The stress of each triangle (Pa); empty where no stress is needed.
    stress: Vec<Symmetric>,
    /// Whether each vertex is about a tip; empty where no tear can start.
    near: Vec<bool>,
    /// Room for displaced positions (m).
    displaced: Vec<Vec3>,
    report: TearReport,
    /// All edits so far, in their order.
    journal: Vec<Edit>,
    /// What each of them did.
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
            patch: Patch::new(limits.vertices, limits.triangles),
            stress: vec![[0.0; 3]; triangles],
            near: vec![false; vertices],
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

    /// Lets the tears grow after a step of `stepper`. Returns what tore so far.
    #[inline(never)]
    pub fn advance<T: Precision>(
        &mut self,
        body: &mut Body,
        stepper: &mut Stepper<T>,
    ) -> &TearReport {
        self.report.driving = 0.0;
        self.report.stress = 0.0;
        match self.options.material.law {
            TearLaw::Toughness => self.advance_by_energy(body, stepper),
            TearLaw::Thesis => self.advance_by_stress(body, stepper),
        }
        if self.options.starts == Starts::Anywhere {
            self.start(body, stepper);
        }
        self.report.tips = self.tips.len();
        &self.report
    }

    /// What tore so far.
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

    /// The snapping of the options, or none.
    fn advance_options(&self, snaps: bool) -> AdvanceOptions {
        AdvanceOptions {
            snapping: if snaps { self.options.snapping } else { 0.0 },
            opening: OPENING,
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
        // A stepper that cannot follow makes itself anew in its next step.
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
        &self,
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
        // errors of earlier pairs are made good.
        let twins = done.vertices.clone();
        let twins = twins.filter_map(|vertex| body.twin_of(vertex).map(|of| [of, vertex]));
        let due = material.toughness * material.thickness * length;
        let energy = (due + stepper.take_surplus()).max(0.5 * due);
        let count = twins.clone().count().max(1) as f64;
        let (energy, length) = (energy / count, length / count);
        let normal = self.patch.normal();
        let mut first = None;
        for nodes in twins {
            let force = stepper.force_between(body, nodes);
            let strength = strength(stepper, nodes, &force, (energy, length), &normal);
            if let Some(pair) = Pair::new(nodes, &(force * strength.factor), energy)
                && stepper.add_pair(pair.weakening(strength.least))
            {
                first = first.or(Some(nodes));
            }
        }
        first
    }
}

/// The strength of a new pair.
struct Strength {
    /// The first force, as a multiple of the present force.
    factor: f64,
    /// The force to which a pair weakens that unloads (N).
    least: f64,
}

/// The strength of a pair, so that the pair lets go once the sheet gives up its energy. The pair is rigid below its first
/// force, so nothing jumps. The first force is the present one, or larger by a factor of at most [`MOST_STRONGER`].
///
/// **In the plane.** A sheet whose opening responds by `R` to a force gives up `R f^2 / 2` where a force `f` falls. On an
/// uneven mesh this can be much less than the energy, although the tip is driven by the toughness. A pair with the
/// present force would then hold on until its opening is far larger than a crack opens, and the tip would wait for it.
///
/// **Out of the plane,** as trousers tear, the sheet gives up almost no energy of its own: the hands supply the energy at
/// about the present force, and a larger force would only hold them back. But the two sides of an edge of the length `a`
/// are `2 a` apart at most when the tip has reached the next vertex. The pair has to let go before: an opening of
/// [`WIDEST`] takes the energy if the first force is large enough. A larger force than that comes from the bending of
/// short edges beside the tip. It vanishes as the sheet moves, and the pair weakens with it: otherwise the hands would
/// have to raise it again.
///
/// A force that is inclined to the sheet by 30 degrees or more counts as out of the plane. Below, the square of its part
/// across the sheet mixes both.
fn strength<T: Precision>(
    stepper: &mut Stepper<T>,
    nodes: [u32; 2],
    force: &Vec3,
    (energy, length): (f64, f64),
    normal: &Vec3,
) -> Strength {
    let size = force.norm();
    let direction = force / size;
    let response = stepper.response_between(nodes, &direction);
    let by_response = at_least_one((2.0 * energy / response).sqrt() / size);
    // The force with which an opening of the widest length takes the energy.
    let least = 2.0 * energy / (WIDEST * length);
    let by_length = at_least_one(least / size);
    // A square of 1/4 is 30 degrees.
    let across = (4.0 * direction.dot(normal).powi(2)).min(1.0);
    let factor = by_response + (by_length - by_response) * across;
    // The comparison is false for a value that is not a number.
    let factor = if factor > 1.0 { factor } else { 1.0 };
    let first = size * factor;
    Strength {
        factor,
        least: first + (least.min(first) - first) * across,
    }
}

/// A factor between 1 and [`MOST_STRONGER`]; 1 for a value that is not a number.
fn at_least_one(factor: f64) -> f64 {
    if factor > 1.0 {
        factor.min(MOST_STRONGER)
    } else {
        1.0
    }
}

/// The surface as the room `tear` takes it.
fn sheet(surface: &Surface) -> Sheet<'_> {
    Sheet {
        triangles: surface.triangles(),
        neighbours: surface.neighbours(),
        shapes: surface.shapes(),
    }
}
