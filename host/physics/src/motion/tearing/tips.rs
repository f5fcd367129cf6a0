//! The tips: their driving force, their direction, and the edges by which they advance.
//!
//! **Two rates.** `G` is the energy that the sheet about the tip gives up for a unit of torn area: the vertex sum of
//! [`driving`](crate::tear::driving) subtracts the work of inertia, damping and pairs. While an edge opens, these hide
//! a part of the energy that flows from afar. `J` is that flow: of the forces on the vertices only the loads are
//! subtracted
//!
//! ```text
//! J = G - sum q_i (F e)_i . (f_i + p_i) / t
//! ```
//!
//! with the elastic force `f_i`, bending included, and the load `p_i` at the end of the step. A tip that rests
//! advances by `G`, a tip that runs by `J`.
//!
//! **Inside an edge.** The pair behind a tip loses its force as it opens. If `J` is the toughness, each opening of the pair
//! is in balance, and the damping alone would say how fast the tip runs. The tip therefore also moves on inside the edge, at
//! a speed by which the flow grows over the toughness, and the pair loses its force with the length that is left:
//!
//! ```text
//! x = 1 - (1 + m) G_c / J        v = k sqrt(E / density) x        strength -= (v h / a) first
//! ```
//!
//! (after L. B. Freund, "Dynamic Fracture Mechanics", 1990: `J (1 - v / c_R) = G_c`).
//!
//! **Out of the plane** a bend moves with the tip from vertex to vertex, and takes up and gives back energy within an edge. The
//! tip [paces](Cohesion::pace) the pair behind it, so that the flow stays at the toughness: below, the pair opens without a loss
//! of force; above, its force falls faster than by its law. `J` agrees with the force of the legs of trousers within 1 % at
//! every moment, so the force of the hands stays even. If the bend is shorter than an edge, edges let go in jumps that the
//! pace cannot even out, and the motion of each jump is lost. The balance of the whole body tells this loss. A tip out of the
//! plane therefore goes by a larger toughness as long as hands have still to supply energy for the area torn so far.
//!
//! **A tear that pairs bridge.** A tear that has just started at the strength is no crack yet: pairs hold its faces together
//! with the strength. Its tips advance where the stress reaches the strength, as the front of a cohesive zone does. So
//! a sheet carries the strength times its section at most, however large its toughness. When the first pair has let go,
//! the tear is a crack.

use super::{FIRST_OPENING, FOLDED, FOLDED_OPENING, IsClear, MOST_EDGES, OPENING, Tearing, sheet};
use crate::body::Body;
use crate::element::precision::Precision;
use crate::motion::constraint::cohesion::Cohesion;
use crate::motion::stepper::Stepper;
use crate::tear::fields::stretch;
use crate::tear::path::MOST_BY_TURN;
use crate::tear::strength::{candidate, onwards};
use crate::tear::{Intensity, RINGS, Tip};
use crate::topology::{Edit, NONE, Surface};

/// The largest angle by which an edge turns back to the path (rad): 45 degrees.
const MOST_BACK: f64 = core::f64::consts::FRAC_PI_4;

/// The part by which the flow of energy exceeds the toughness before a tip moves on inside an edge: `m`. The flow errs by
/// this part on meshes without order.
pub(super) const MARGIN: f64 = 0.01;

/// The speed inside an edge over the speed of waves `sqrt(E / density)` and over `x`: it grows with `x` up to that of
/// Rayleigh's waves, so that a tear that just advances does not overshoot.
fn swiftness(x: f64) -> f64 {
    (0.1 + 5.0 * x).min(0.57)
}

/// How eager a tip before a paced pair is: the part of an edge by which it moves on in a step, over `x`. The flow falls with this
/// part, in stiff paper a hundred times as fast as in rubber. A tip whose flow stays above the toughness grows more eager, and a
/// tip whose flow has fallen below is less eager next time.
const EAGER: f64 = 0.1;
const MOST_EAGER: f64 = 0.1;
const MORE: f64 = 1.2;
const LESS: f64 = 0.5;
/// The rise of the pace of a pair over the excess of the flow, relative to the toughness, and the highest pace. A force that
/// falls much faster than by its law falls faster than the sheet unloads, and the pair would let go at once.
const QUICKER: f64 = 20.0;
const QUICKEST: f64 = 1.5;

/// The relative increase of the toughness of a tip out of the plane for each edge whose energy the hands have not supplied,
/// and the largest number of such edges that counts.
const STIFFER: f64 = 0.5;
const MOST_LACKING: f64 = 4.0;

/// A tip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TipState {
    /// The vertex.
    pub vertex: u32,
    /// The pair of vertices behind the tip that lets each other go; `None` at the end of a notch and under a law without
    /// letting go.
    pub pair: Option<[u32; 2]>,
    /// The length of the edge behind the tip (m), infinite at the end of a notch.
    pub edge: f64,
    /// The first pair of a tear that started at the strength; `None` at a notch. As long as this pair has not let go, pairs
    /// bridge the whole tear.
    pub bridge: Option<[u32; 2]>,
    /// How eager a tip out of the plane is: the part of an edge by which it moves on in a step, for a flow of energy far above the
    /// toughness. Negative if the flow was below the toughness after the last step.
    pub eager: f64,
    /// The path of the tear.
    pub course: Course,
}

/// The path of a tear, as seen from its tip.
///
/// The path is the line that the stress intensities ask for. Edges of the mesh follow it as far as good triangles allow,
/// so the tip lies beside the path, and the last edge has another direction. The tear turns back to its path, so such
/// errors do not add up.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Course {
    /// The distance of the tip from the path (m): positive if the tip is on the left.
    pub aside: f64,
    /// The angle from the direction of the last edge to that of the path (rad), counterclockwise.
    pub turned: f64,
}

impl Course {
    /// The angle by which the next edge turns from the path so that it leads back (rad), if edges have about the
    /// length `reach` (m). At most 45 degrees: a tear that comes from large triangles among small ones turns back over
    /// several edges.
    pub fn back(&self, reach: f64) -> f64 {
        -libm::atan2(self.aside, reach).clamp(-MOST_BACK, MOST_BACK)
    }

    /// The course after an edge of the fan angle `angle` (rad) and of this `length` (m), if the path has the fan angle
    /// `path` (rad).
    pub(super) fn after(&self, angle: f64, length: f64, path: f64) -> Self {
        let (sine, cosine) = (libm::sin(path - angle), libm::cos(path - angle));
        Self {
            aside: self.aside - length * sine,
            turned: libm::atan2(sine, cosine),
        }
    }
}

impl Drive {
    /// The flow of energy to the tip from afar, `J` (J/m²).
    pub(super) fn flow(&self) -> f64 {
        self.rate + self.hidden
    }
}

impl TipState {
    /// A tip at the end of a notch.
    pub(super) fn new(vertex: u32) -> Self {
        Self {
            vertex,
            pair: None,
            edge: f64::INFINITY,
            bridge: None,
            eager: -EAGER,
            course: Course::default(),
        }
    }
}

/// The driving force of a tip.
#[derive(Clone, Copy, Debug)]
pub(super) struct Drive {
    /// The energy release rate `G` along its path, with bending (J/m²).
    pub(super) rate: f64,
    /// The share of bending (J/m²).
    pub(super) bending: f64,
    /// By how much the flow of energy from afar exceeds `G` (J/m²): the share of inertia, damping and pairs.
    pub(super) hidden: f64,
    /// The fan angle of the path (rad).
    pub(super) direction: f64,
}

/// The driving force of a tip when it was found to wait.
#[derive(Clone, Copy, Debug)]
pub(super) struct Driven {
    vertex: u32,
    /// The topology epoch of the body, and the numbers of its motions and of changes from outside.
    at: [u64; 3],
    pub(super) drive: Drive,
    /// The rate that is compared with the toughness (J/m²).
    pub(super) rate: f64,
}

/// The state of a body to which a [`Driven`] belongs.
fn state_of(body: &Body) -> [u64; 3] {
    [body.epoch(), body.state.motions, body.state.revision]
}

/// The direction straight ahead of a tip.
pub(super) fn ahead(surface: &Surface, vertex: u32) -> Option<Tip> {
    let (triangle, along) = surface.direction_at(vertex, surface.straight_ahead(vertex))?;
    Some(Tip {
        vertex,
        triangle,
        along,
    })
}

impl Tearing {
    /// The driving force of a tip; `None` for a tip that is held or outside of the surface.
    ///
    /// The tear counts as straight along its path. The direction of the last edge would make the stress intensities err
    /// by the angle between both: triangles do not resolve the field about a kink of one edge.
    pub(super) fn drive<T: Precision>(
        &mut self,
        body: &Body,
        stepper: &Stepper<T>,
        tip: &TipState,
    ) -> Option<Drive> {
        let direction = self.lay_patch(body, tip)?;
        let measured = self
            .patch
            .measure(body.node_positions(), &self.options.material);
        measured.ok()?;
        let material = &self.options.material;
        let bending = body.bending_release(&mut self.patch) / material.thickness;
        let vertices = self.patch.vertices();
        let work = vertices.map(|vertex| {
            let motion = self.patch.motion(vertex);
            motion.dot(&stepper.unbalanced(body, vertex))
        });
        let hidden = -work.sum::<f64>() / material.thickness;
        Some(Drive {
            rate: self.patch.driving().rate() + bending,
            bending,
            hidden,
            direction,
        })
    }

    /// Finds the patch about a tip. Returns the fan angle of its path (rad).
    pub(super) fn lay_patch(&mut self, body: &Body, tip: &TipState) -> Option<f64> {
        let surface = body.surface()?;
        let vertex = tip.vertex;
        let direction = surface.straight_ahead(vertex) + tip.course.turned;
        let tip = Tip::at(surface, vertex, direction)?;
        let others = &self.tips;
        let barred = |found: u32| {
            body.is_held(found) || (found != vertex && others.iter().any(|tip| tip.vertex == found))
        };
        self.patch.find(&sheet(surface), &tip, RINGS, barred).ok()?;
        Some(direction)
    }

    /// The driving force of a tip, and the rate that is compared with the toughness: as found after the last step, or now if
    /// anything has changed.
    pub(super) fn driven<T: Precision>(
        &mut self,
        body: &Body,
        stepper: &Stepper<T>,
        tip: &TipState,
    ) -> Option<(Drive, f64)> {
        let now = state_of(body);
        let known = self.driven.iter();
        let mut known = known.filter(|known| known.at == now && known.vertex == tip.vertex);
        if let Some(known) = known.next() {
            return Some((known.drive, known.rate));
        }
        let drive = self.drive(body, stepper, tip)?;
        Some((drive, self.counts(tip, &drive)))
    }

    /// The edit by which a tip advances in the direction of a fan angle (rad). A vertex snaps only if this changes the
    /// energy little and nothing is in its way.
    pub(super) fn growth(
        &self,
        body: &Body,
        tip: &TipState,
        direction: f64,
        is_clear: &IsClear<'_>,
    ) -> Option<Edit> {
        let vertex = tip.vertex;
        let opening = if tip.edge.is_infinite() {
            FIRST_OPENING
        } else if self.patch.folding() > FOLDED {
            FOLDED_OPENING
        } else {
            OPENING
        };
        let surface = body.surface()?;
        let may_move = |vertex: u32| !body.is_held(vertex) && !self.is_tip(vertex);
        let advance = |snaps: bool| {
            surface.advance(
                vertex,
                direction,
                self.advance_options(snaps, opening),
                may_move,
            )
        };
        let edit = advance(true)?;
        if self.may_snap(body, &edit, is_clear) {
            return Some(edit);
        }
        advance(false)
    }

    /// The edit by which a tip advances along the path of this fan angle (rad), and the course after the edit.
    fn growth_along(
        &self,
        body: &Body,
        tip: &TipState,
        path: f64,
        is_clear: &IsClear<'_>,
    ) -> Option<(Edit, Course)> {
        let surface = body.surface()?;
        let back = tip.course.back(surface.mean_edge(tip.vertex));
        let edit = self.growth(body, tip, path + back, is_clear)?;
        let (angle, length) = surface.edge_of(tip.vertex, &edit.ahead)?;
        Some((edit, tip.course.after(angle, length, path)))
    }

    /// The stress intensities that say how a tip turns that is driven by the energy release rate `rate` (J/m²).
    ///
    /// They are those in the plane of the sheet. If hands tear a sheet out of its plane, most of the
    /// energy comes from the tearing mode and from bending, which drive the tip straight ahead. This part counts with the
    /// opening mode: `K_I` is replaced by `sqrt(E G - K_II^2)` if that is larger. In the plane the two are equal.
    fn intensity(&self, rate: f64) -> Intensity {
        let found = self.patch.intensity();
        let ahead = self.options.material.young * rate - found.k2 * found.k2;
        let k1 = found.k1.max(libm::sqrt(ahead.max(0.0)));
        Intensity { k1, ..found }
    }

    /// The rate that is compared with the toughness at a tip with this drive, which the patch holds. The first edge of a tip
    /// goes by `G`, and by the criterion that says where it turns: a tear that turns starts at a smaller load. The further
    /// edges go by `J`.
    pub(super) fn counts(&self, tip: &TipState, drive: &Drive) -> f64 {
        if tip.pair.is_some() {
            return drive.flow();
        }
        // A rate that no turn could make the toughness needs no intensities.
        if drive.rate * MOST_BY_TURN < self.options.material.toughness {
            return drive.rate;
        }
        drive.rate * self.intensity(drive.rate).by_turn()
    }

    /// Lets the pair behind a tip lose force as the tip moves on inside the edge, if the flow of energy `flow` (J/m²) asks
    /// for it, and paces a pair out of the plane. `length` is that of the step (s). Returns whether the pair has let go.
    fn slacken<T: Precision>(
        &mut self,
        stepper: &mut Stepper<T>,
        tip: &mut TipState,
        nodes: [u32; 2],
        (flow, length): (f64, f64),
    ) -> bool {
        let material = &self.options.material;
        let is_paced = stepper.pair(nodes).is_some_and(Cohesion::is_paced);
        let mut toughness = material.toughness;
        if is_paced {
            // The energy that hands and contacts have still to supply for the torn area, in edges.
            let taken = self.report.due - stepper.pending();
            let due = material.toughness * material.thickness * tip.edge;
            let lacking = ((taken - self.report.spent) / due).clamp(0.0, MOST_LACKING);
            toughness *= 1.0 + STIFFER * lacking;
        }
        // The comparison is false for a flow that is no number.
        let is_above = flow > (1.0 + MARGIN) * toughness;
        if is_paced && flow.is_finite() {
            let pace = 1.0 + QUICKER * (flow / toughness - 1.0);
            stepper.pace(nodes, pace.min(QUICKEST));
            tip.eager = match (is_above, tip.eager > 0.0) {
                (true, true) => (MORE * tip.eager).min(MOST_EAGER),
                (false, true) => -LESS * tip.eager,
                (_, false) => tip.eager * if is_above { -1.0 } else { 1.0 },
            };
        }
        if !is_above || length <= 0.0 {
            return false;
        }
        let x = 1.0 - (1.0 + MARGIN) * toughness / flow;
        let part = if is_paced {
            tip.eager * x
        } else {
            swiftness(x) * self.wave_speed * x * length / tip.edge
        };
        // A tip moves on by one edge in a step at most.
        self.report.slackened += stepper.slacken(nodes, part.min(1.0));
        stepper.pair(nodes).is_none()
    }

    /// Advances the tips that the toughness cannot hold. A tip waits until the pair behind it has let go.
    pub(super) fn advance_by_energy<T: Precision>(
        &mut self,
        body: &mut Body,
        stepper: &mut Stepper<T>,
        is_clear: &IsClear<'_>,
    ) {
        let length = stepper.step_length();
        self.driven.clear();
        let mut number = 0;
        while let Some(&(mut tip)) = self.tips.get(number) {
            let mut left = length;
            for _ in 0..MOST_EDGES {
                let Some(drive) = self.drive(body, stepper, &tip) else {
                    self.report.held += 1;
                    break;
                };
                self.report.driving = self.report.driving.max(drive.flow());
                let rate = self.counts(&tip, &drive);
                self.driven.push(Driven {
                    vertex: tip.vertex,
                    at: state_of(body),
                    drive,
                    rate,
                });
                let waits = tip.pair.and_then(|nodes| stepper.pair(nodes));
                let bridge = tip.bridge.and_then(|nodes| stepper.pair(nodes));
                let path = if bridge.is_some() {
                    let Some((stress, direction)) = self.stressed(body, tip.vertex) else {
                        break;
                    };
                    if stress < self.options.material.strength {
                        break;
                    }
                    direction
                } else {
                    if let Some(&Cohesion { nodes, .. }) = waits {
                        let step = (drive.flow(), core::mem::take(&mut left));
                        let has_let_go = self.slacken(stepper, &mut tip, nodes, step);
                        if let Some(entry) = self.tips.get_mut(number) {
                            entry.eager = tip.eager;
                        }
                        if !has_let_go {
                            break;
                        }
                    }
                    // The comparison is false for a rate that is no number.
                    let goes_on = rate >= self.options.material.toughness;
                    if !goes_on {
                        break;
                    }
                    drive.direction + self.intensity(drive.rate).kink()
                };
                let edit = self.growth_along(body, &tip, path, is_clear);
                let made = edit.and_then(|(edit, course)| {
                    let [tip, _] = self.make(body, stepper, &edit)?;
                    Some((tip, course))
                });
                let Some((mut next, course)) = made else {
                    self.report.blocked += 1;
                    break;
                };
                (next.course, next.bridge, next.eager) = (course, tip.bridge, tip.eager);
                // A met tip before this one has been removed.
                number = self
                    .tips
                    .iter()
                    .position(|found| found.vertex == tip.vertex)
                    .unwrap_or(number);
                tip = next;
                if let Some(entry) = self.tips.get_mut(number) {
                    *entry = next;
                }
                if next.vertex == NONE {
                    break;
                }
            }
            if tip.vertex == NONE {
                self.tips.remove(number);
            } else {
                number += 1;
            }
        }
    }

    /// The principal stress at the tip of a tear (Pa), and the fan angle of the direction orthogonal to it that
    /// continues (rad).
    fn stressed(&mut self, body: &Body, vertex: u32) -> Option<(f64, f64)> {
        let surface = body.surface()?;
        let from = ahead(surface, vertex)?;
        let view = sheet(surface);
        for corner in surface.fan(vertex) {
            let triangle = corner.triangle as usize;
            let x = view.triangles[triangle].map(|vertex| body.node_positions()[vertex as usize]);
            self.stress[triangle] =
                stretch(&view.shapes[triangle], x, &self.options.material).stress;
        }
        let found = candidate(&view, vertex, from.triangle, &self.stress);
        let along = onwards(found.along, from.along);
        let direction = surface.fan_angle(vertex, from.triangle, along)?;
        Some((found.stress, direction))
    }

    /// The law of the thesis: of all tips, the one with the highest principal stress advances by one edge, if that
    /// stress is at least the strength, orthogonal to the direction of the stress and never backwards (Le Gouis et al.
    /// 2017).
    pub(super) fn advance_by_stress<T: Precision>(
        &mut self,
        body: &mut Body,
        stepper: &mut Stepper<T>,
        is_clear: &IsClear<'_>,
    ) {
        let mut highest: Option<(usize, f64, f64)> = None;
        for number in 0..self.tips.len() {
            let Some((stress, direction)) = self.stressed(body, self.tips[number].vertex) else {
                continue;
            };
            self.report.stress = self.report.stress.max(stress);
            if stress >= self.options.material.strength
                && highest.is_none_or(|(_, highest, _)| stress > highest)
            {
                highest = Some((number, stress, direction));
            }
        }
        let Some((number, _, direction)) = highest else {
            return;
        };
        let Some(edit) = self.growth(body, &self.tips[number], direction, is_clear) else {
            return;
        };
        let vertex = self.tips[number].vertex;
        let Some([next, _]) = self.make(body, stepper, &edit) else {
            return;
        };
        if let Some(number) = self.tips.iter().position(|tip| tip.vertex == vertex) {
            if next.vertex == NONE {
                self.tips.remove(number);
            } else {
                self.tips[number] = next;
            }
        }
    }
}
