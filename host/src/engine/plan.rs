//! The plan: which stages a scene needs, and why the others are skipped.
//!
//! A scene pays only for what it needs. The plan is decided from the scene alone, before anything runs,
//! and the engine is built from the same answers.

use crate::scene::spec::{Body, Scene, SchemeName};

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

/// Whether a body's bending is computed.
pub fn bends(body: &Body) -> bool {
    body.bending > 0.0
}

/// Whether the scheme uses the published stiffness and damping.
pub fn condenses(scene: &Scene) -> bool {
    scene.realtime.scheme == SchemeName::Linear
}

/// The stages of a host step in their order.
pub fn plan(scene: &Scene) -> Vec<Stage> {
    let stage = |name, needed, why: String| Stage { name, needed, why };
    let handles: usize = scene.bodies.iter().map(|body| body.handles.len()).sum();
    let count = |n: usize, what: &str| {
        if n == 1 {
            format!("1 {what}")
        } else {
            format!("{n} {what}s")
        }
    };
    let bending = scene.bodies.iter().filter(|body| bends(body)).count();
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
            format!(
                "{}: membrane forces and tangent",
                count(scene.bodies.len(), "body")
            ),
        ),
        stage(
            "bending",
            bending > 0,
            if bending > 0 {
                format!(
                    "bending > 0 in {}; its matrix is constant",
                    count(bending, "body")
                )
            } else {
                "bending = 0 in every body".into()
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
