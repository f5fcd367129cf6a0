//! The stages of a host step, in their order: which of them the bodies of a scene need, and why, for people.

use super::{BodyPlan, TearPlan};
use crate::engine::parting::FAR;
use crate::scene::spec::{Scene, SolverName, Starts, TearLawName};
use crate::world::Kind;
use crate::world::contact::touching;
use crate::world::scheme;

/// One stage of the host step.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Stage {
    /// Its name.
    pub name: &'static str,
    /// Whether the scene needs it.
    pub needed: bool,
    /// The reason why the scene needs it, or why not.
    pub why: String,
}

impl Stage {
    fn new(name: &'static str, needed: bool, why: impl Into<String>) -> Self {
        let why = why.into();
        Self { name, needed, why }
    }

    /// A stage with the reason `why` if it is needed, else with `why_not`.
    fn either(name: &'static str, needed: bool, why: String, why_not: &str) -> Self {
        let why = if needed { why } else { why_not.to_owned() };
        Self { name, needed, why }
    }
}

/// The reason why a stage sleeps in a scene of tools and obstacles.
const NO_BODY: &str = "no body";

/// The stages of a host step for a scene whose bodies have these plans, in the scene's order.
pub fn stages(scene: &Scene, bodies: &[BodyPlan]) -> Vec<Stage> {
    let has_body = !bodies.is_empty();
    vec![
        handles(scene, bodies),
        collision(scene),
        Stage::either("elements", has_body, elements(bodies), NO_BODY),
        bending(bodies),
        supports(scene),
        loads(scene),
        Stage::either(
            "gravity",
            scene.gravity.iter().any(|g| *g != 0.0),
            "gravity is not zero".into(),
            "gravity = [0, 0, 0]",
        ),
        damping(scene),
        Stage::either("solve", has_body, solve(scene, bodies), NO_BODY),
        Stage::either(
            "sleep",
            has_body,
            "a body is not stepped after 20 steps in which no vertex moved faster than 0.1 um/s"
                .into(),
            NO_BODY,
        ),
        stress(bodies),
        tear(bodies),
        condense(scene, bodies),
        publish(scene, bodies),
    ]
}

fn handles(scene: &Scene, bodies: &[BodyPlan]) -> Stage {
    let held = bodies.iter().map(|body| body.handles).sum();
    let why = format!(
        "{} held; paths smoothed at {} Hz",
        count(held, "handle"),
        scene.host.smoothing
    );
    Stage::new("handles", held > 0, why)
}

fn collision(scene: &Scene) -> Stage {
    let pairs = touching(scene).len();
    let why = format!(
        "{} may touch: bodies that touch are solved together, and asleep together",
        count(pairs, "pair")
    );
    let why_not = if scene.bodies.is_empty() {
        NO_BODY
    } else {
        "no obstacle, no contact and no self-contact: bodies pass through each other"
    };
    Stage::either("collision", pairs > 0, why, why_not)
}

/// The elements of each kind of body.
fn elements(bodies: &[BodyPlan]) -> String {
    let of = |kind: Kind| bodies.iter().filter(|body| body.kind == kind).count();
    let parts = [
        (Kind::Sheet, "isotropic membranes"),
        (Kind::Woven, "woven membranes"),
        (Kind::Solid, "tetrahedra"),
        (Kind::Thread, "bars"),
    ];
    let parts: Vec<_> = parts
        .iter()
        .filter(|(kind, _)| of(*kind) > 0)
        .map(|(kind, what)| format!("{what} of {}", count(of(*kind), "body")))
        .collect();
    format!("forces and tangent: {}", parts.join(", "))
}

fn bending(bodies: &[BodyPlan]) -> Stage {
    let bent = bodies.iter().filter(|body| body.bends).count();
    let why = format!("bending > 0 in {}", count(bent, "body"));
    let why_not = if bodies.iter().any(|body| body.kind == Kind::Sheet) {
        "bending = 0 in every body"
    } else if bodies.iter().any(|body| body.kind == Kind::Woven) {
        "no weave has a rigidity"
    } else {
        "no sheet"
    };
    Stage::either("bending", bent > 0, why, why_not)
}

fn supports(scene: &Scene) -> Stage {
    let found = scene.bodies.iter().map(|body| body.supports.len()).sum();
    let why = format!("{}, left out of the solve", count(found, "support"));
    Stage::either("supports", found > 0, why, "no supports")
}

fn loads(scene: &Scene) -> Stage {
    let found = scene.bodies.iter().map(|body| body.loads.len()).sum();
    let why = count(found, "constant load");
    Stage::either("loads", found > 0, why, "no loads beside weight")
}

fn damping(scene: &Scene) -> Stage {
    let mut bodies = scene.bodies.iter();
    let damped = bodies.any(|body| body.damping.mass > 0.0 || body.damping.stiffness > 0.0);
    let why = "Rayleigh damping is not zero; it shares the stiffness matrix".into();
    Stage::either("damping", damped, why, "no Rayleigh damping")
}

/// A solver in a few words, with the `tolerance` to which it solves.
pub fn in_words(solver: SolverName, tolerance: f64) -> String {
    let on = |factor: &str| {
        format!(
            "conjugate gradients on {factor} to {tolerance:e} of the forces, refactorized in the background"
        )
    };
    match solver {
        SolverName::Incomplete => on("a frozen incomplete factor and the motions of patches"),
        SolverName::Auto | SolverName::Frozen => on("a frozen factor"),
    }
}

fn solve(scene: &Scene, bodies: &[BodyPlan]) -> String {
    let host = &scene.host;
    let alone = bodies.len() == 1;
    let each = bodies.iter().map(|body| {
        let how = in_words(body.choice.solver, host.tolerance);
        let name = if alone {
            String::new()
        } else {
            format!("{}: ", body.name)
        };
        format!("{name}{how} ({})", body.choice.why)
    });
    let threads = match host.threads {
        1 => String::new(),
        count => format!(" on {count} threads"),
    };
    format!(
        "implicit Euler at {} Hz{threads}, at most {} iterations: {}",
        host.step_rate,
        host.max_iterations,
        each.collect::<Vec<_>>().join("; ")
    )
}

/// The plans of the bodies that tear, with the names of the bodies if the scene has several.
fn torn(bodies: &[BodyPlan]) -> impl Iterator<Item = (String, &TearPlan)> {
    let named = |body: &BodyPlan| match bodies {
        [_] => String::new(),
        _ => format!("{}: ", body.name),
    };
    let each = bodies.iter();
    each.filter_map(move |body| Some((named(body), body.tear.as_ref()?)))
}

fn stress(bodies: &[BodyPlan]) -> Stage {
    let each = torn(bodies).filter_map(|(name, tear)| {
        let anywhere = tear.starts == Starts::Anywhere || tear.law == TearLawName::Thesis;
        let why = if tear.starts == Starts::Anywhere {
            "principal stresses at the vertices, where the elastic energy allows the strength"
        } else {
            "principal stresses at the tips"
        };
        anywhere.then(|| format!("{name}{why}"))
    });
    let why = each.collect::<Vec<_>>().join("; ");
    let why_not = if torn(bodies).next().is_some() {
        "tears start at tips only, and the energy that they release drives them"
    } else {
        "no tear threshold"
    };
    Stage::either("stress", !why.is_empty(), why, why_not)
}

fn tear(bodies: &[BodyPlan]) -> Stage {
    let each = torn(bodies).map(|(name, tear)| {
        let law = match tear.law {
            TearLawName::Toughness => {
                "the energy release rate and the stress intensities over some 50 triangles about each tip"
            }
            TearLawName::Thesis => "the stress at each tip",
        };
        let starts = match (tear.starts, tear.tips) {
            (Starts::Anywhere, 0) => "tears start anywhere".to_owned(),
            (Starts::Anywhere, tips) => format!("tears start at {} and anywhere", count(tips, "tip")),
            (Starts::Tips, tips) => format!("tears start at {}", count(tips, "tip")),
        };
        let late = tear.late.map_or_else(String::new, |late| {
            let percent = 100.0 * late;
            format!(" up to {percent:.0} % late, because a notch is short for its mesh")
        });
        let room = format!("room for {}", count_vertices(tear.room));
        format!(
            "{name}{law}; {starts}{late}; {room}; a piece without a hand is left out once it is {FAR} diagonals of the sheet \
             from all hands"
        )
    });
    let why = each.collect::<Vec<_>>().join("; ");
    Stage::either("tear", !why.is_empty(), why, "no tear threshold")
}

/// A number of vertices in words.
fn count_vertices(n: usize) -> String {
    match n {
        1 => "1 more vertex".to_owned(),
        _ => format!("{n} more vertices"),
    }
}

fn condense(scene: &Scene, bodies: &[BodyPlan]) -> Stage {
    let why = format!(
        "scheme \"{}\" extrapolates with stiffness, damping and drift, {}, at {} Hz; the shapes are updated with the \
         frozen factor",
        scheme(scene).name(),
        motions(bodies),
        scene.host.publish_rate,
    );
    let needed = bodies.iter().any(|body| body.condenses);
    let why_not = "the scheme renders no published stiffness";
    Stage::either("condense", needed, why, why_not)
}

/// Which motions of the handles are condensed.
fn motions(bodies: &[BodyPlan]) -> String {
    let all: usize = bodies.iter().map(|body| body.handles).sum();
    match bodies.iter().map(|body| body.turned).sum() {
        0 => "translations only (the devices drive no rotation)".into(),
        turned if turned == all => "translations and rotations".into(),
        turned => format!(
            "translations, and rotations of {} whose devices drive them",
            count(turned, "handle")
        ),
    }
}

fn publish(scene: &Scene, bodies: &[BodyPlan]) -> Stage {
    let links = bodies.iter().flat_map(|body| &body.links);
    let links: Vec<_> = links
        .flatten()
        .map(|link| format!("{} N/m and {} N s/m", link.stiffness, link.damping))
        .collect();
    let through = if links.is_empty() {
        String::new()
    } else {
        format!(", coupled to a proxy by {}", links.join(", "))
    };
    let rate = scene.host.publish_rate;
    let why = format!("one local model a body at {rate} Hz{through}");
    Stage::new("publish", true, why)
}

fn count(n: usize, what: &str) -> String {
    match (n, what) {
        (1, _) => format!("1 {what}"),
        (_, "body") => format!("{n} bodies"),
        _ => format!("{n} {what}s"),
    }
}
