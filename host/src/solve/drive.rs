//! Drives one body to equilibrium or through time.
//!
//! A static solve has two stages if the scene has both weight and displacements or loads: first the body settles under
//! its weight while supports stay, then displacements and loads grow. If only one of the two acts, it grows in the load
//! steps.

use super::grid;
use super::result::{BodySolution, Extreme, Reaction, Row};
use crate::scene::spec::solve::TimeScheme;
use crate::scene::spec::{Analysis, Body as BodySpec, Scene};
use crate::world::{Built, Carrier, Grasp, grasps};
use meshio::write_vtu::UnstructuredGrid;
use nalgebra::UnitQuaternion;
use physics::mesh::{Cells, Mesh};
use physics::{
    BodyError, CondenseError, Equilibrium, EquilibriumOptions, EquilibriumReport, HandlePose,
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

impl<'a> Drive<'a> {
    pub(super) fn new(
        scene: &'a Scene,
        index: usize,
        mut built: Built,
    ) -> Result<Self, CondenseError> {
        let solve = &scene.solve;
        let newton = NewtonOptions {
            tolerance: solve.tolerance,
            max_iterations: solve.max_iterations,
        };
        let (method, steps, step, ramp, frames) = match solve.analysis {
            Analysis::Static => {
                let options = EquilibriumOptions {
                    newton,
                    refuse_inversion: solve.refuse_inversion,
                    find_snaps: true,
                    ..EquilibriumOptions::default()
                };
                // Weight and loads grow from zero. The call cannot fail, because 0 is a finite factor.
                let _ = built.body.set_load_factor(0.0);
                let method = Method::Static(Box::new(Equilibrium::new(&built.body, options)?));
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
            Method::Static(_) if self.unsettled => {
                format!("at {:.4} of its weight alone", at.unwrap_or(-1.0) + 1.0)
            }
            Method::Static(_) => format!("at {:.4} of the loads", at.unwrap_or(0.0)),
            Method::Dynamic(_) => format!("at {} s", at.unwrap_or(0.0)),
        }
    }

    /// Advances the body by one step; `None` at the end. After an error, the body is in its previous state, or in a static
    /// solve in the state of the last substep that succeeded. [`halt`](Self::halt) keeps that state.
    pub(super) fn advance(&mut self) -> Result<Option<State>, DriveError> {
        if self.unsettled {
            return self.settle().map(Some);
        }
        if self.done == self.steps {
            if let Method::Dynamic(integrator) = &self.method {
                integrator.check_digits(&self.built.body)?;
            }
            return Ok(None);
        }
        let next = self.done + 1;
        let (at, fraction) = self.end_of(next);
        self.aim(fraction)?;
        for (force, load) in self.forces.iter_mut().zip(&self.built.loads) {
            *force = load * fraction;
        }
        let body = &mut self.built.body;
        let effort = match &mut self.method {
            Method::Static(equilibrium) if self.settles => {
                let report = equilibrium.solve_loaded(body, &self.targets, &self.forces)?;
                Effort::from(report)
            }
            Method::Static(equilibrium) => {
                Effort::from(equilibrium.solve(body, &self.targets, fraction)?)
            }
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
        self.done = next;
        self.keep(None, at, fraction, &effort);
        // Frame k is the first step at or after the fraction k / frames of the solve.
        let part = |step: usize| step * self.frames / self.steps;
        let number = part(next) + usize::from(self.settles);
        Ok(Some(State {
            frame: (part(next) > part(next - 1)).then_some(number),
            at,
            done: next as f64 / self.steps as f64,
        }))
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
        let Method::Static(equilibrium) = &self.method else {
            return None;
        };
        let report = *equilibrium.report();
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

    /// Lets the body settle under its weight, with its supports in their places. The state is the first frame after rest.
    fn settle(&mut self) -> Result<State, DriveError> {
        let effort = match &mut self.method {
            Method::Static(equilibrium) => {
                Effort::from(equilibrium.solve(&mut self.built.body, &self.targets, 1.0)?)
            }
            // A motion begins at rest.
            Method::Dynamic(_) => Effort::default(),
        };
        self.unsettled = false;
        self.keep(Some("weight"), 0.0, 0.0, &effort);
        Ok(State {
            frame: Some(1),
            at: 0.0,
            done: 0.0,
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
    pub(super) fn grid(&self) -> UnstructuredGrid {
        let moves = matches!(self.method, Method::Dynamic(_));
        grid::of_body(&self.built, &self.rest, moves)
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
