//! Drives one body to equilibrium or through time.
//!
//! A static solve has two stages if the scene has both weight and displacements or loads: first the body settles under
//! its weight while supports stay, then displacements and loads grow. If only one of the two acts, it grows in the load
//! steps. Bodies that touch are driven together (`contact`): each prepares a step and keeps its state after the step.

use super::grid;
use super::result::{BodySolution, Extreme, Reaction, Row};
use crate::scene::spec::solve::TimeScheme;
use crate::scene::spec::{Analysis, Body as BodySpec, Scene, Solve};
use crate::world::{Built, Carrier, Grasp, grasps};
use meshio::write_vtu::UnstructuredGrid;
use nalgebra::UnitQuaternion;
use physics::mesh::{Cells, Mesh};
use physics::motion::Goal;
use physics::{
    Body, BodyError, CondenseError, Equilibrium, EquilibriumOptions, EquilibriumReport, HandlePose,
    Integrator, IntegratorOptions, NewtonOptions, StepError, Vec3,
};

/// The progress of a body after a step.
pub(super) struct State {
    /// Number of the frame, if the state after the step is one.
    pub(super) frame: Option<usize>,
    /// Time (s), or fraction of the displacements and loads.
    pub(super) at: f64,
    /// Fraction of the steps done.
    pub(super) done: f64,
}

enum Method {
    Static(Box<Equilibrium>),
    /// The solver of all bodies that touch: the report of its last step.
    Contact(EquilibriumReport),
    Dynamic(Box<Integrator>),
}

/// A body that is driven step by step.
pub(super) struct Drive<'a> {
    spec: &'a BodySpec,
    /// The supports that hold the body as handles: its first handles.
    grasps: Vec<Grasp>,
    built: Built,
    method: Method,
    rest: Vec<Vec3>,
    targets: Vec<HandlePose>,
    forces: Vec<Vec3>,
    steps: usize,
    /// Length of a step: a time (s), or a fraction of the loads.
    step: f64,
    /// Time over which displacements and loads grow (s); 1 in a static solve.
    ramp: f64,
    frames: usize,
    done: usize,
    /// Whether the body settles under its weight before the first step.
    settles: bool,
    /// Whether the body still has to settle.
    unsettled: bool,
    rows: Vec<Row>,
}

/// Whether a static solve of the scene has a stage in which bodies settle under their weight: there is weight, and
/// something else grows in the load steps. All bodies of a scene have the same stages, so that their steps correspond.
pub(super) fn settles_first(scene: &Scene) -> bool {
    let acts = |v: &[f64; 3]| *v != [0.0; 3];
    let driven = |body: &BodySpec| {
        let mut supports = body.supports.iter();
        let mut loads = body.loads.iter();
        supports.any(|support| {
            acts(&support.displacement) || support.rotation.as_ref().is_some_and(acts)
        }) || loads.any(|load| [load.force, load.traction].iter().flatten().any(acts))
    };
    scene.solve.analysis == Analysis::Static
        && acts(&scene.gravity)
        && scene.bodies.iter().any(driven)
}

/// The cost of a step.
#[derive(Default)]
struct Effort {
    substeps: usize,
    refused: usize,
    iterations: usize,
    residual: f64,
    open: f64,
    /// The part of the step after which the body snapped to another balance.
    snapped: Option<f64>,
}

impl From<EquilibriumReport> for Effort {
    fn from(report: EquilibriumReport) -> Self {
        let last = report.last;
        Self {
            substeps: report.load_steps,
            refused: report.refused,
            iterations: report.iterations,
            residual: last.relative_residual(),
            open: last.open,
            // A step that ends early ends where the body came.
            snapped: report.snapped.map(|at| at / report.reached),
        }
    }
}

/// The reason why a step failed.
#[derive(Debug, thiserror::Error)]
pub(super) enum DriveError {
    #[error(transparent)]
    Step(#[from] StepError),
    #[error(transparent)]
    Body(#[from] BodyError),
}

/// The options of the equilibria of a scene.
pub(super) fn equilibrium(solve: &Solve) -> EquilibriumOptions {
    EquilibriumOptions {
        newton: newton(solve),
        refuse_inversion: solve.refuse_inversion,
        find_snaps: true,
        ..EquilibriumOptions::default()
    }
}

fn newton(solve: &Solve) -> NewtonOptions {
    NewtonOptions {
        tolerance: solve.tolerance,
        max_iterations: solve.max_iterations,
    }
}

impl<'a> Drive<'a> {
    /// A body of a scene at rest. A body that `touches` has no solver of its own.
    pub(super) fn new(
        scene: &'a Scene,
        index: usize,
        mut built: Built,
        touches: bool,
    ) -> Result<Self, CondenseError> {
        let solve = &scene.solve;
        let newton = newton(solve);
        let (method, steps, step, ramp, frames) = match solve.analysis {
            Analysis::Static => {
                let options = equilibrium(solve);
                // Weight and loads grow from zero. The call cannot fail, because 0 is a finite factor.
                let _ = built.body.set_load_factor(0.0);
                let method = if touches {
                    Method::Contact(EquilibriumReport::default())
                } else {
                    Method::Static(Box::new(Equilibrium::new(&built.body, options)?))
                };
                let steps = solve.load_steps;
                (method, steps, 1.0 / steps as f64, 1.0, steps)
            }
            Analysis::Dynamic => {
                let options = IntegratorOptions {
                    scheme: match solve.scheme {
                        TimeScheme::ImplicitEuler => physics::TimeScheme::ImplicitEuler,
                        TimeScheme::TrBdf2 => physics::TimeScheme::TrBdf2,
                    },
                    newton,
                    refuse_inversion: solve.refuse_inversion,
                    ..IntegratorOptions::default()
                };
                let method = Method::Dynamic(Box::new(Integrator::new(&built.body, options)?));
                let steps = (scene.duration / solve.step).round().max(1.0);
                let ramp = solve.ramp.unwrap_or(scene.duration);
                (
                    method,
                    steps as usize,
                    scene.duration / steps,
                    ramp,
                    solve.frames,
                )
            }
        };
        let rest: Vec<Vec3> = built.body.positions().collect();
        let settles = settles_first(scene);
        if settles || (solve.analysis == Analysis::Dynamic && ramp > 0.0) {
            // Loads grow from zero. The call cannot fail, because there is one finite force per vertex.
            let _ = built
                .body
                .set_external_forces(&vec![Vec3::zeros(); rest.len()]);
        }
        let targets = built.handles.iter().map(|h| HandlePose::at(h.origin));
        Ok(Self {
            spec: &scene.bodies[index],
            grasps: grasps(scene, &scene.bodies[index]),
            targets: targets.collect(),
            forces: vec![Vec3::zeros(); rest.len()],
            built,
            method,
            rest,
            steps,
            step,
            ramp,
            frames: frames.min(steps),
            done: 0,
            settles,
            unsettled: settles,
            rows: Vec::new(),
        })
    }

    /// Where the body is, in words.
    pub(super) fn place(&self) -> String {
        let at = self.rows.last().map(|row| row.at);
        match self.method {
            // Rest is at -1, and the settled state is at 0.
            Method::Static(_) | Method::Contact(_) if self.unsettled => {
                format!("at {:.4} of its weight alone", at.unwrap_or(-1.0) + 1.0)
            }
            Method::Static(_) | Method::Contact(_) => {
                format!("at {:.4} of the loads", at.unwrap_or(0.0))
            }
            Method::Dynamic(_) => format!("at {} s", at.unwrap_or(0.0)),
        }
    }

    /// Advances the body by one step; `None` at the end. After an error, the body is in its previous state, or in a static
    /// solve in the state of the last substep that succeeded. [`halt`](Self::halt) keeps that state.
    pub(super) fn advance(&mut self) -> Result<Option<State>, DriveError> {
        if self.is_done() {
            if let Method::Dynamic(integrator) = &self.method {
                integrator.check_digits(&self.built.body)?;
            }
            return Ok(None);
        }
        let factor = self.prepare()?;
        let body = &mut self.built.body;
        let effort = match &mut self.method {
            Method::Static(equilibrium) if self.settles && !self.unsettled => {
                let report = equilibrium.solve_loaded(body, &self.targets, &self.forces)?;
                Effort::from(report)
            }
            Method::Static(equilibrium) => {
                Effort::from(equilibrium.solve(body, &self.targets, factor)?)
            }
            Method::Contact(report) => Effort::from(*report),
            Method::Dynamic(integrator) => {
                let report =
                    integrator.step_loaded(body, self.step, &self.targets, &self.forces)?;
                Effort {
                    substeps: report.substeps,
                    refused: report.refused,
                    iterations: report.iterations,
                    residual: report.relative_residual,
                    open: report.last.open,
                    snapped: None,
                }
            }
        };
        Ok(Some(self.complete(&effort)))
    }

    /// Whether the last step has been taken.
    pub(super) fn is_done(&self) -> bool {
        !self.unsettled && self.done == self.steps
    }

    /// Aims the supports, and gives the loads at the end of the next step. Returns the fraction of loads and weight that a
    /// static solve goes to.
    fn prepare(&mut self) -> Result<f64, BodyError> {
        if self.unsettled {
            return Ok(1.0);
        }
        let (_, fraction) = self.end_of(self.done + 1);
        self.aim(fraction)?;
        for (force, load) in self.forces.iter_mut().zip(&self.built.loads) {
            *force = load * fraction;
        }
        Ok(if self.settles { 1.0 } else { fraction })
    }

    /// Keeps the state after a step.
    fn complete(&mut self, effort: &Effort) -> State {
        if self.unsettled {
            self.unsettled = false;
            self.keep(Some("weight"), 0.0, 0.0, effort);
            return State {
                frame: Some(1),
                at: 0.0,
                done: 0.0,
            };
        }
        let next = self.done + 1;
        let (at, fraction) = self.end_of(next);
        self.done = next;
        self.keep(None, at, fraction, effort);
        // Frame k is the first step at or after the fraction k / frames of the solve.
        let part = |step: usize| step * self.frames / self.steps;
        let number = part(next) + usize::from(self.settles);
        State {
            frame: (part(next) > part(next - 1)).then_some(number),
            at,
            done: next as f64 / self.steps as f64,
        }
    }

    /// A body that touches others, and where it goes in the next step.
    pub(super) fn next(&mut self) -> Result<(&mut Body, Goal<'_>), DriveError> {
        let load_factor = self.prepare()?;
        let goal = Goal {
            targets: &self.targets,
            load_factor,
            forces: (self.settles && !self.unsettled).then_some(&*self.forces),
        };
        Ok((&mut self.built.body, goal))
    }

    /// After a step of a body that touches others: takes its report. If the step has failed, the state is that of
    /// [`halt`](Self::halt).
    pub(super) fn take(&mut self, report: EquilibriumReport, failed: bool) -> Option<State> {
        self.method = Method::Contact(report);
        if failed {
            self.halt()
        } else {
            Some(self.complete(&Effort::from(report)))
        }
    }

    /// The body.
    pub(super) fn body(&self) -> &Body {
        &self.built.body
    }

    /// The end of a step, from 1: its time (s) or fraction of the loads, and the fraction of the loads.
    fn end_of(&self, step: usize) -> (f64, f64) {
        // The last step ends exactly at the end of the solve.
        let at = if step == self.steps {
            self.step * self.steps as f64
        } else {
            self.step * step as f64
        };
        (at, if at < self.ramp { at / self.ramp } else { 1.0 })
    }

    /// After a failed step of a static solve: keeps the state of its last substep that succeeded; `None` if there is
    /// no such state.
    pub(super) fn halt(&mut self) -> Option<State> {
        let report = match &self.method {
            Method::Static(equilibrium) => *equilibrium.report(),
            Method::Contact(report) => *report,
            Method::Dynamic(_) => return None,
        };
        if report.reached <= 0.0 || report.reached >= 1.0 {
            return None;
        }
        let effort = Effort::from(report);
        let (frame, at) = if self.unsettled {
            let at = report.reached - 1.0;
            self.keep(Some("weight"), at, 0.0, &effort);
            (1, at)
        } else {
            let [(from, _), (to, _)] = [self.done, self.done + 1].map(|step| self.end_of(step));
            let at = from + (to - from) * report.reached;
            self.keep(None, at, at, &effort);
            // Every step of a static solve is a frame.
            (self.done + 1 + usize::from(self.settles), at)
        };
        Some(State {
            frame: Some(frame),
            at,
            done: self.done as f64 / self.steps as f64,
        })
    }

    /// Keeps the row of the present state.
    fn keep(&mut self, stage: Option<&'static str>, at: f64, fraction: f64, effort: &Effort) {
        let reactions = self.reactions();
        let rest = if self.settles { -1.0 } else { 0.0 };
        let before = self.rows.last().map_or(rest, |row| row.at);
        self.rows.push(Row {
            stage,
            at,
            substeps: effort.substeps,
            refused: effort.refused,
            iterations: effort.iterations,
            residual: effort.residual,
            open: (effort.open > 0.0).then_some(effort.open),
            snapped: effort.snapped.map(|part| before + (at - before) * part),
            elastic_energy: self.built.body.elastic_energy(),
            kinetic_energy: self.built.body.kinetic_energy(),
            forces: reactions.iter().map(|reaction| reaction.force).collect(),
            moments: reactions.iter().map(|reaction| reaction.moment).collect(),
            fraction,
            displacement: self.displacement(),
            von_mises: self.largest_stress(),
        });
    }

    /// Moves the supports by `fraction` of their displacements and rotations.
    fn aim(&mut self, fraction: f64) -> Result<(), BodyError> {
        for (support, carrier) in self.spec.supports.iter().zip(&self.built.carriers) {
            let displacement = Vec3::from(support.displacement) * fraction;
            match *carrier {
                Carrier::Support(number) => self.built.body.set_support(number, displacement)?,
                Carrier::Handle(number) => {
                    let turn = Vec3::from(support.rotation.unwrap_or_default()) * fraction;
                    self.targets[number] = HandlePose {
                        position: self.built.handles[number].origin + displacement,
                        rotation: UnitQuaternion::from_scaled_axis(turn),
                    };
                }
                Carrier::Nothing => {}
            }
        }
        Ok(())
    }

    /// The displacement of the part that gives each reaction, at the end of the ramp (m): zero for handles, along the
    /// axes that a support leaves free, and for a support all of whose vertices are held by handles.
    fn driven(&self) -> Vec<[f64; 3]> {
        let grasps = self.grasps.iter().map(|_| [0.0; 3]);
        let supports = self.spec.supports.iter().zip(&self.built.carriers);
        let supports = supports.map(|(support, carrier)| {
            let mut displacement = support.displacement;
            for (along, held) in displacement.iter_mut().zip(support.axes) {
                if !held || *carrier == Carrier::Nothing {
                    *along = 0.0;
                }
            }
            displacement
        });
        grasps.chain(supports).collect()
    }

    fn reactions(&self) -> Vec<Reaction> {
        let body = &self.built.body;
        let of_handle = |number: usize, name: &str, by| {
            let wrench = body.handle_report(number).map(|report| report.reaction);
            let wrench = wrench.unwrap_or_default();
            Reaction {
                name: name.to_owned(),
                by,
                force: wrench.force.into(),
                moment: Some(wrench.moment.into()),
            }
        };
        let handles = self.grasps.iter().enumerate();
        let handles =
            handles.map(|(number, grasp)| of_handle(number, &grasp.name(self.spec), "handle"));
        let supports = self.spec.supports.iter().zip(&self.built.carriers);
        let supports = supports.map(|(support, carrier)| match *carrier {
            Carrier::Handle(number) => of_handle(number, &support.name, "turned support"),
            Carrier::Support(number) => Reaction {
                name: support.name.clone(),
                by: "support",
                force: body.support_reaction(number).unwrap_or_default().into(),
                moment: None,
            },
            Carrier::Nothing => Reaction {
                name: support.name.clone(),
                by: "support",
                force: [0.0; 3],
                moment: None,
            },
        });
        handles.chain(supports).collect()
    }

    /// The longest displacement of a vertex (m).
    fn displacement(&self) -> Extreme {
        let moved = self.built.body.positions().zip(&self.rest);
        largest(moved.map(|(now, rest)| (now - rest).norm()))
    }

    /// The largest von Mises stress of an element (Pa).
    fn largest_stress(&self) -> Extreme {
        largest(grid::von_mises(&self.built).into_iter())
    }

    /// The present state of the body, with the positions of the deformed body.
    /// A body that touches others has the `pressure` of its contacts (Pa), by vertex.
    pub(super) fn grid(&self, pressure: Option<Vec<f64>>) -> UnstructuredGrid {
        let moves = matches!(self.method, Method::Dynamic(_));
        grid::of_body(&self.built, &self.rest, moves, pressure)
    }

    /// The solution of the body, in its present state.
    pub(super) fn finish(self) -> BodySolution {
        let body = &self.built.body;
        BodySolution {
            name: self.spec.name.clone(),
            kind: self.built.kind,
            law: self.built.law,
            vertices_of_element: match &self.built.mesh {
                Mesh::Thread(_) => 2,
                Mesh::Sheet(_) => 3,
                Mesh::Solid(mesh) => match mesh.cells {
                    Cells::Linear(_) => 4,
                    Cells::Quadratic(_) => 10,
                },
            },
            elements: body.element_count(),
            vertices: body.vertex_count(),
            unknowns: body.unknown_count(),
            mass: body.total_mass(),
            reactions: self.reactions(),
            applied: body.total_external_force().into(),
            displacement: self.displacement(),
            von_mises: self.largest_stress(),
            elastic_energy: body.elastic_energy(),
            kinetic_energy: body.kinetic_energy(),
            inverted: body.inverted_count(),
            driven: self.driven(),
            stress_free: !is_cut(&self.built.mesh),
            steps: self.rows,
        }
    }
}

/// The largest value and its index.
fn largest(values: impl Iterator<Item = f64>) -> Extreme {
    let start = Extreme::default();
    values.enumerate().fold(start, |most, (at, value)| {
        if value > most.value {
            Extreme { value, at }
        } else {
            most
        }
    })
}

/// Whether the mesh is cut out of a flat pattern, so that the body has stresses at rest.
fn is_cut(mesh: &Mesh) -> bool {
    matches!(mesh, Mesh::Sheet(mesh) if mesh.flat_pattern.is_some())
}
