//! The plan: which stages a scene needs, and why the others are skipped.
//!
//! A scene pays only for what it needs. The plan is decided from the scene alone, before anything runs,
//! and the engine is built from the same answers.

use crate::bodies::{Kind, bending};
use crate::scene::spec::{Scene, SchemeName, SolverName};

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
    scene.realtime.scheme == SchemeName::Linear
}

/// What solves the steps of a body.
pub fn solver(scene: &Scene, _kind: Kind) -> SolverName {
    match scene.host.solver {
        SolverName::Auto => SolverName::Frozen,
        chosen => chosen,
    }
}

/// The stages of a host step in their order, for bodies of these kinds.
pub fn plan(scene: &Scene, kinds: &[Kind]) -> Vec<Stage> {
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
            "assemble",
            true,
            elements(of(Kind::Sheet), of(Kind::Woven), of(Kind::Solid)),
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
        stage(
            "solve",
            true,
            format!(
                "implicit Euler at {} Hz, conjugate gradients to {:e}, at most {} iterations",
                scene.host.step_rate, scene.host.tolerance, scene.host.max_iterations
            ),
        ),
        stage("stress", false, "no tear threshold".into()),
        stage("tear", false, "no tear threshold".into()),
        stage(
            "condense",
            condenses(scene),
            if condenses(scene) {
                format!(
                    "scheme \"linear\" extrapolates with stiffness and damping, translations only \
                     (the devices actuate no rotation), at {} Hz",
                    scene.host.publish_rate
                )
            } else {
                "the scheme renders no published stiffness".into()
            },
        ),
        stage(
            "publish",
            true,
            format!("one local model a body at {} Hz", scene.host.publish_rate),
        ),
    ]
}

fn count(n: usize, what: &str) -> String {
    match (n, what) {
        (1, _) => format!("1 {what}"),
        (_, "body") => format!("{n} bodies"),
        _ => format!("{n} {what}s"),
    }
}

/// What is assembled, for so many bodies of each kind.
fn elements(sheets: usize, woven: usize, solids: usize) -> String {
    let parts = [
        (sheets, "isotropic membranes"),
        (woven, "woven membranes"),
        (solids, "tetrahedra"),
    ];
    let parts: Vec<_> = parts
        .iter()
        .filter(|(bodies, _)| *bodies > 0)
        .map(|(bodies, what)| format!("{what} of {}", count(*bodies, "body")))
        .collect();
    format!("forces and tangent: {}", parts.join(", "))
}
