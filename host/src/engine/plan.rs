//! The plan: which stages a scene needs, and why the others are skipped.
//!
//! A scene pays only for what it needs. The plan is decided from the scene and its bodies' meshes, before anything runs,
//! and the engine is built from the same answers.

use super::build::links;
use super::choice::Choice;
use crate::bodies::{self, Kind, bending};
use crate::run::setup;
use crate::scene::LoadedScene;
use crate::scene::spec::{self, Scene, SchemeName, SolverName};
use physics::Freedom;

/// One stage of the host step.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Stage {
    /// Its name.
    pub name: &'static str,
    /// Whether the scene needs it.
    pub needed: bool,
    /// Why, or why not.
    pub why: String,
}

/// Whether the scheme uses the published stiffness and damping.
pub fn condenses(scene: &Scene) -> bool {
    matches!(
        scene.realtime.scheme,
        SchemeName::Linear | SchemeName::Proxy | SchemeName::Classic | SchemeName::Capped
    )
}

/// Whether the scheme uses the published energy.
pub fn tells_energy(scene: &Scene) -> bool {
    matches!(
        scene.realtime.scheme,
        SchemeName::Classic | SchemeName::Capped
    )
}

/// Whether steps assemble a matrix.
fn assembles(scene: &Scene) -> bool {
    scene.host.solver == SolverName::Assembled
}

/// A solver in a few words, with what it solves to.
pub fn in_words(solver: SolverName, tolerance: f64) -> String {
    let on = |factor: &str| {
        format!(
            "conjugate gradients on {factor} to {tolerance:e} of the forces, a new factor made beside the steps"
        )
    };
    match solver {
        SolverName::Assembled => {
            format!("conjugate gradients on diagonal blocks to {tolerance:e}")
        }
        SolverName::FrozenSingle => on("a frozen factor") + ", in single precision",
        SolverName::Incomplete => on("a frozen incomplete factor and the motions of patches"),
        SolverName::Auto | SolverName::Frozen => on("a frozen factor"),
    }
}

fn solver_in_words(scene: &Scene, choices: &[Choice]) -> String {
    let host = &scene.host;
    let alone = scene.bodies.len() == 1;
    let bodies = scene.bodies.iter().zip(choices).map(|(body, choice)| {
        let how = in_words(choice.solver, host.tolerance);
        let name = if alone {
            String::new()
        } else {
            format!("{}: ", body.name)
        };
        format!("{name}{how} ({})", choice.why)
    });
    format!(
        "implicit Euler at {} Hz, at most {} iterations: {}",
        host.step_rate,
        host.max_iterations,
        bodies.collect::<Vec<_>>().join("; ")
    )
}

/// The stages of a host step in their order, for bodies of these kinds with these solvers.
pub fn plan(loaded: &LoadedScene, kinds: &[Kind], choices: &[Choice]) -> Vec<Stage> {
    let scene = &loaded.scene;
    let stage = |name, needed, why: String| Stage { name, needed, why };
    let handles: usize = scene.bodies.iter().map(|body| body.handles.len()).sum();
    let each = || scene.bodies.iter().zip(kinds);
    let bent = each()
        .filter(|(body, kind)| bending(body, **kind) > 0.0)
        .count();
    let of = |kind: Kind| kinds.iter().filter(|other| **other == kind).count();
    let supports: usize = scene.bodies.iter().map(|body| body.supports.len()).sum();
    let loads: usize = scene.bodies.iter().map(|body| body.loads.len()).sum();
    let weight = scene.gravity.iter().any(|g| *g != 0.0);
    let damped = scene
        .bodies
        .iter()
        .any(|b| b.damping.mass > 0.0 || b.damping.stiffness > 0.0);
    vec![
        stage(
            "handles",
            handles > 0,
            format!(
                "{} held; paths smoothed at {} Hz",
                count(handles, "handle"),
                scene.host.smoothing
            ),
        ),
        stage(
            "collision",
            false,
            "no tools or obstacles in the scene".into(),
        ),
        stage(
            "elements",
            true,
            elements([
                (of(Kind::Sheet), "isotropic membranes"),
                (of(Kind::Woven), "woven membranes"),
                (of(Kind::Solid), "tetrahedra"),
                (of(Kind::Thread), "bars"),
            ]),
        ),
        stage(
            "assemble",
            assembles(scene),
            if assembles(scene) {
                "one matrix a step".into()
            } else {
                "a frozen solver multiplies by elements (those without a kernel keep their own blocks)".into()
            },
        ),
        stage(
            "bending",
            bent > 0,
            if bent > 0 {
                format!(
                    "bending > 0 in {}; its matrix is constant",
                    count(bent, "body")
                )
            } else if of(Kind::Sheet) > 0 {
                "bending = 0 in every body".into()
            } else {
                "no isotropic sheet".into()
            },
        ),
        stage(
            "supports",
            supports > 0,
            if supports > 0 {
                format!("{}, left out of the solve", count(supports, "support"))
            } else {
                "no supports".into()
            },
        ),
        stage(
            "loads",
            loads > 0,
            if loads > 0 {
                count(loads, "constant load")
            } else {
                "no loads beside weight".into()
            },
        ),
        stage(
            "gravity",
            weight,
            if weight {
                "gravity is not zero".into()
            } else {
                "gravity = [0, 0, 0]".into()
            },
        ),
        stage(
            "damping",
            damped,
            if damped {
                "Rayleigh damping is not zero; it shares the stiffness matrix".into()
            } else {
                "no Rayleigh damping".into()
            },
        ),
        stage("solve", true, solver_in_words(scene, choices)),
        stage(
            "sleep",
            !assembles(scene),
            if assembles(scene) {
                "only frozen solvers let bodies sleep".into()
            } else {
                "a body that nothing has moved faster than 0.1 um/s for 20 steps is left alone"
                    .into()
            },
        ),
        stage("stress", false, "no tear threshold".into()),
        stage("tear", false, "no tear threshold".into()),
        stage(
            "condense",
            condenses(scene),
            if condenses(scene) {
                format!(
                    "scheme \"{}\" extrapolates with stiffness, damping and drift, {}, at {} Hz{}",
                    setup::scheme(scene).name(),
                    motions(loaded),
                    scene.host.publish_rate,
                    if assembles(scene) {
                        ""
                    } else {
                        "; shapes are kept up with the frozen factor"
                    }
                )
            } else {
                "the scheme renders no published stiffness".into()
            },
        ),
        stage(
            "publish",
            true,
            format!(
                "one local model a body at {} Hz{}",
                scene.host.publish_rate,
                through(loaded)
            ),
        ),
    ]
}

/// Which motions of the handles are condensed.
fn motions(loaded: &LoadedScene) -> String {
    let bodies = loaded.scene.bodies.iter();
    let all: Vec<_> = bodies.flat_map(|body| &body.handles).collect();
    let rigid = |handle: &&&spec::Handle| bodies::freedom(loaded, handle) == Freedom::Rigid;
    match all.iter().filter(rigid).count() {
        0 => "translations only (the devices drive no rotation)".into(),
        turned if turned == all.len() => "translations and rotations".into(),
        turned => format!(
            "translations, and rotations of {} whose devices drive them",
            count(turned, "handle")
        ),
    }
}

fn count(n: usize, what: &str) -> String {
    match (n, what) {
        (1, _) => format!("1 {what}"),
        (_, "body") => format!("{n} bodies"),
        _ => format!("{n} {what}s"),
    }
}

/// What devices feel a body through, if not its local model itself.
fn through(loaded: &LoadedScene) -> String {
    let scene = &loaded.scene;
    if scene.realtime.scheme != SchemeName::Proxy {
        return String::new();
    }
    let links = scene.bodies.iter().flat_map(|body| links(loaded, body));
    let links: Vec<_> = links
        .map(|link| format!("{} N/m and {} N s/m", link.stiffness, link.damping))
        .collect();
    format!(", felt through {} to a proxy", links.join(", "))
}

/// What is assembled, for so many bodies of each kind.
fn elements(parts: [(usize, &str); 4]) -> String {
    let parts: Vec<_> = parts
        .iter()
        .filter(|(bodies, _)| *bodies > 0)
        .map(|(bodies, what)| format!("{what} of {}", count(*bodies, "body")))
        .collect();
    format!("forces and tangent: {}", parts.join(", "))
}
