//! Drives one body to equilibrium or through time.

use super::result::{BodySolution, Extreme, Reaction, Row};
use crate::bodies::{self, Built, Carrier, Tool};
use crate::scene::spec::solve::TimeScheme;
use crate::scene::spec::{Analysis, Body as BodySpec, Scene};
use meshio::write_vtu::{Snapshot, Values};
use nalgebra::UnitQuaternion;
use physics::mesh::{Cells, Mesh};
use physics::{
    BodyError, CondenseError, Equilibrium, EquilibriumOptions, HandlePose, Integrator,
    IntegratorOptions, Mat3, NewtonOptions, StepError, Vec3,
};

/// The progress of a body after a step.
pub(super) struct State {
    /// Number of the frame, if the state after the step is one.
    pub(super) frame: Option<usize>,
    /// Time (s), or fraction of the loads.
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
    /// What holds the body: its first handles.
    tools: Vec<Tool>,
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
    rows: Vec<Row>,
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
        if solve.analysis == Analysis::Dynamic && ramp > 0.0 {
            // Loads grow from zero. The call cannot fail, because there is one finite force per vertex.
            let _ = built
                .body
                .set_external_forces(&vec![Vec3::zeros(); rest.len()]);
        }
        let targets = built.handles.iter().map(|h| HandlePose::at(h.origin));
        Ok(Self {
            spec: &scene.bodies[index],
            tools: bodies::tools(scene, &scene.bodies[index]),
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
            rows: Vec::new(),
        })
    }

    /// Time (s) or fraction of the loads that the body has reached.
    pub(super) fn reached(&self) -> f64 {
        self.rows.last().map_or(0.0, |row| row.at)
    }

    /// Advances the body by one step; `None` at the end. An error leaves the body in its previous state.
    pub(super) fn advance(&mut self) -> Result<Option<State>, DriveError> {
        if self.done == self.steps {
            if let Method::Dynamic(integrator) = &self.method {
                integrator.check_digits(&self.built.body)?;
            }
            return Ok(None);
        }
        let next = self.done + 1;
        // The last step ends exactly at the end of the solve.
        let at = if next == self.steps {
            self.step * self.steps as f64
        } else {
            self.step * next as f64
        };
        let fraction = if at < self.ramp { at / self.ramp } else { 1.0 };
        self.aim(fraction)?;
        let body = &mut self.built.body;
        let (substeps, refused, iterations, residual, open) = match &mut self.method {
            Method::Static(equilibrium) => {
                let report = equilibrium.solve(body, &self.targets, fraction)?;
                let last = report.last;
                let residual = last.residual / last.reference.max(f64::MIN_POSITIVE);
                (
                    report.load_steps,
                    report.refused,
                    report.iterations,
                    residual,
                    last.open,
                )
            }
            Method::Dynamic(integrator) => {
                for (force, load) in self.forces.iter_mut().zip(&self.built.loads) {
                    *force = load * fraction;
                }
                let report =
                    integrator.step_loaded(body, self.step, &self.targets, &self.forces)?;
                (
                    report.substeps,
                    report.refused,
                    report.iterations,
                    report.relative_residual,
                    report.last.open,
                )
            }
        };
        self.done = next;
        let reactions = self.reactions();
        self.rows.push(Row {
            at,
            substeps,
            refused,
            iterations,
            residual,
            open: (open > 0.0).then_some(open),
            elastic_energy: self.built.body.elastic_energy(),
            kinetic_energy: self.built.body.kinetic_energy(),
            forces: reactions.iter().map(|reaction| reaction.force).collect(),
        });
        // Frame k is the first step at or after the fraction k / frames of the solve.
        let part = |step: usize| step * self.frames / self.steps;
        Ok(Some(State {
            frame: (part(next) > part(next - 1)).then(|| part(next)),
            at,
            done: next as f64 / self.steps as f64,
        }))
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
        let handles = self.tools.iter().enumerate();
        let handles =
            handles.map(|(number, tool)| of_handle(number, &tool.name(self.spec), "handle"));
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

    /// Cauchy stress of each element (Pa), of a sheet in the middle of its thickness.
    fn stresses(&self) -> Vec<Mat3> {
        let body = &self.built.body;
        let sets = body.elements().iter();
        sets.flat_map(|set| (0..set.count()).map(|e| set.stress(e, body.node_positions())))
            .collect()
    }

    /// The stress of each triangle on the face at the side of its normal and on the other face (Pa), from the stress in
    /// the middle. `None` for a body that does not bend.
    fn faces(&self, middle: &[Mat3]) -> Option<[Vec<Mat3>; 2]> {
        let body = &self.built.body;
        body.bends().then(|| {
            let on_face = |sign: f64| {
                let elements = middle.iter().enumerate();
                elements
                    .map(|(e, middle)| middle + body.bending_stress(e) * sign)
                    .collect()
            };
            [on_face(1.0), on_face(-1.0)]
        })
    }

    /// The largest von Mises stress of each element (Pa): of a sheet that bends, on its two faces.
    fn von_mises(middle: &[Mat3], faces: Option<&[Vec<Mat3>; 2]>) -> Vec<f64> {
        match faces {
            None => middle.iter().map(von_mises).collect(),
            Some([top, bottom]) => {
                let pairs = top.iter().zip(bottom);
                pairs
                    .map(|(top, bottom)| von_mises(top).max(von_mises(bottom)))
                    .collect()
            }
        }
    }

    /// The present state of the body, with the positions of the deformed body.
    pub(super) fn snapshot(&self) -> Snapshot {
        let mut snapshot = match &self.built.mesh {
            Mesh::Thread(mesh) => Snapshot::of_thread(mesh),
            Mesh::Sheet(mesh) => Snapshot::of_sheet(mesh),
            Mesh::Solid(mesh) => Snapshot::of_solid(mesh),
        };
        let body = &self.built.body;
        snapshot.positions = body.positions().collect();
        let moved = snapshot.positions.iter().zip(&self.rest);
        let mut at_vertices = |name: &str, values: Vec<Vec3>| {
            let values = Values::Vector(values);
            snapshot.at_vertices.push((name.to_owned(), values));
        };
        at_vertices(
            "displacement",
            moved.map(|(now, rest)| now - rest).collect(),
        );
        if matches!(self.method, Method::Dynamic(_)) {
            at_vertices("velocity", body.velocities().collect());
        }
        let stresses = self.stresses();
        let faces = self.faces(&stresses);
        let mut in_cells = |name: &str, values: Values| {
            // A field of the mesh file that has the same name is renamed.
            for (other, _) in &mut snapshot.in_cells {
                if other == name {
                    other.push_str("_in_file");
                }
            }
            snapshot.in_cells.push((name.to_owned(), values));
        };
        in_cells(
            "von_mises",
            Values::Scalar(Self::von_mises(&stresses, faces.as_ref())),
        );
        in_cells("stress", Values::Tensor(stresses));
        if let Some([top, bottom]) = faces {
            in_cells("stress_top", Values::Tensor(top));
            in_cells("stress_bottom", Values::Tensor(bottom));
        }
        in_cells("young", Values::Scalar(self.built.young.clone()));
        if !self.built.poisson.is_empty() {
            in_cells("poisson", Values::Scalar(self.built.poisson.clone()));
        }
        snapshot
    }

    /// The solution of the body, in its present state.
    pub(super) fn finish(self) -> BodySolution {
        let body = &self.built.body;
        let moved = body.positions().zip(&self.rest);
        let stresses = self.stresses();
        let faces = self.faces(&stresses);
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
            displacement: largest(moved.map(|(now, rest)| (now - rest).norm())),
            von_mises: largest(Self::von_mises(&stresses, faces.as_ref()).into_iter()),
            elastic_energy: body.elastic_energy(),
            kinetic_energy: body.kinetic_energy(),
            inverted: body.inverted_count(),
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

/// The von Mises stress `sqrt(3/2 s : s)`, where `s` is the deviatoric stress.
fn von_mises(stress: &Mat3) -> f64 {
    let deviator = stress - Mat3::identity() * (stress.trace() / 3.0);
    (1.5 * deviator.norm_squared()).sqrt()
}
